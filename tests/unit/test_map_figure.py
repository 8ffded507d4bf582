"""What a map may claim: intervals and the lines that they support, counts of computed nodes, tables in words."""

import json
import math
from dataclasses import replace

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
import pytest
import xarray as xr
from matplotlib.text import Text
from scipy.stats import binom, norm

from exumob.mobility.crossing import FAILURES, Crossing
from exumob.mobility.lattice import Lattice, fewest_runs, separated_cells, sides, wilson_interval
from exumob.mobility.map import Axis, MobilityMap, table, verdict_lines
from exumob.mobility.map_figure import plot_map
from exumob.sweeps.experiment import amphibious_crossing
from exumob.vehicle.start_pose import StartPose
from exumob.water.conditions import Water

X, Y = np.linspace(0.0, 1.2, 5), np.linspace(0.4, 0.6, 5)


def a_map(chance, runs=10, outside=None, has_range=True, computed=None):
    """A map of one panel with a given chance at its nodes; the nearest whole number of runs crosses."""
    lattice = Lattice(["sand"], X, Y, 0.5)
    crossed = np.round(np.asarray(chance, float) * runs) / runs
    lattice.values["crossed"][0] = crossed
    lattice.values["speed"][0] = 0.2 + 0.6 * crossed
    lattice.values["out_of_range"][0] = 0.0 if outside is None else outside
    lattice.failure[0] = np.where(crossed < 1.0, FAILURES.index("too slow"), 0)
    lattice.runs[0] = runs
    if computed is not None:
        lattice.runs[0][~computed] = 0
        lattice.failure[0][~computed] = -1
    found = lattice.dataset(has_range)
    found["x"].attrs |= {"units": "m s-1", "long_name": "speed of the current"}
    found["y"].attrs |= {"units": "1", "long_name": "depth over diameter"}
    return found.assign_attrs(
        failures=", ".join(FAILURES), x="water.current_speed", y="water.depth_ratio", range_share=0.5, width=12.0,
        least_speed=0.6, trust="networks, measured on runs like this one: 1 %",
    )  # fmt: skip


STEP = np.where(X[None, :] < 0.7, 1.0, 0.0) * np.ones((5, 1))
"""A border at a current between 0.6 and 0.9 m/s."""


def texts(figure):
    """Texts of the legend."""
    (legend,) = figure.legends
    return [text.get_text() for text in legend.get_texts()]


# -- lines of equal speed ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("slope", [(0.8, 0.2), (-0.1, 0.9), (0.6, -0.7)])
def test_every_line_of_equal_speed_that_passes_the_middle_says_it(slope):
    """Also on a map of four nodes, whose lines begin and end at the edges of the panel."""
    mapped = a_map(np.ones((5, 5))).isel(x=[0, -1], y=[0, -1])
    x, y = np.meshgrid([-0.5, 0.5], [-0.5, 0.5])
    mapped["speed"][0] = 1.0 + slope[0] * x + slope[1] * y
    figure = plot_map(mapped)
    axes = figure.axes[0]
    figure.canvas.draw()
    labels = [text for text in axes.findobj(Text) if text.get_text().endswith(" m/s")]
    places = [axes.transAxes.inverted().transform(axes.transData.transform(t.get_position())) for t in labels]
    assert len(labels) >= 4 and len({t.get_text() for t in labels}) == len(labels)
    assert all(np.abs(place - 0.5).max() < 0.45 for place in places)
    for text, place in zip(labels, places, strict=True):
        said = float(text.get_text().split()[0])
        assert said == pytest.approx(1.0 + slope[0] * (place[0] - 0.5) + slope[1] * (place[1] - 0.5), abs=0.02)
    plt.close(figure)


# -- intervals ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("runs", "least", "most"), [(1, 0.8, 1.0), (4, 0.93, 0.97), (10, 0.94, 0.965), (48, 0.945, 0.96)]
)
def test_interval_holds_the_chance_in_95_of_100_maps(runs, least, most):
    """Coverage from scipy's binomial distribution, mean over all chances: exact, no random numbers."""
    chances = np.linspace(0.0005, 0.9995, 1000)
    bounds = np.array([wilson_interval(crossed, runs) for crossed in range(runs + 1)])
    held = (bounds[:, :1] <= chances) & (chances <= bounds[:, 1:])
    coverage = (binom.pmf(np.arange(runs + 1)[:, None], runs, chances) * held).sum(axis=0)
    assert least < coverage.mean() < most


def test_bounds_solve_the_equation_of_wilson():
    """At each bound the share lies 1.96 standard deviations of the binomial from it."""
    for crossed, runs in ((1, 2), (3, 10), (9, 10), (20, 48)):
        for bound, sign in zip(wilson_interval(crossed, runs), (1.0, -1.0), strict=True):
            deviation = binom.std(runs, bound) / runs
            assert (crossed / runs - bound) / deviation == pytest.approx(sign * norm.ppf(0.975), rel=1e-9)


def test_four_runs_are_needed_to_tell_go_from_no_go():
    assert fewest_runs(0.5) == 4
    assert wilson_interval(3, 3)[0] < 0.5 < wilson_interval(4, 4)[0]
    assert wilson_interval(10, 10)[0] < 0.9 < wilson_interval(fewest_runs(0.9), fewest_runs(0.9))[0]


def test_sides_of_a_level():
    low, high = np.array([0.6, 0.4, 0.1, np.nan]), np.array([0.9, 0.6, 0.4, np.nan])
    assert sides(low, high, 0.5).tolist() == [1, 0, -1, 0]


def test_lines_are_supported_between_decided_nodes_only():
    """Nodes of one row: above, undecided, below; the line lies along that stretch, and nowhere else."""
    low, high = np.full((3, 5), 0.2), np.full((3, 5), 0.8)
    low[1, 0], high[1, 2] = 0.6, 0.4
    expected = np.zeros((2, 4), bool)
    expected[:, :2] = True
    assert (separated_cells(low, high, 0.5) == expected).all()
    assert (separated_cells(low.T, high.T, 0.5) == expected.T).all()
    low[1, 0] = 0.2  # no node is above for sure
    assert not separated_cells(low, high, 0.5).any()


# -- figures -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("runs", "lines"), [(2, []), (3, []), (4, ["chance 50 %"]), (10, ["chance 50 %"]),
                        (48, ["chance 10 %", "chance 50 %", "chance 90 %"])],
)  # fmt: skip
def test_lines_that_the_runs_support(runs, lines):
    figure = plot_map(a_map(STEP, runs))
    found = texts(figure)
    assert [text for text in found if text.startswith("chance")] == lines
    undecided = any(text.startswith("not decided") for text in found)
    assert undecided  # between two nodes, at least
    assert ("No line is drawn" in " ".join(figure.get_supxlabel().split())) == (not lines)
    plt.close(figure)


def test_one_run_a_node_has_a_border_and_no_chance():
    figure = plot_map(a_map(STEP, 1))
    found = texts(figure)
    assert found[:3] == ["go", "no go", "border of go and no-go, one run a node"]
    assert "no go: too slow" in found
    assert len(figure.axes) == 1  # no bar of chances
    assert "no chance" in " ".join(figure.get_supxlabel().split())
    border = next(line for line in figure.axes[0].lines if line.get_linewidth() == 2.0)
    assert border.get_xdata() == pytest.approx(np.full(len(border.get_xdata()), 0.75))
    plt.close(figure)


@pytest.mark.parametrize("has_range", [True, False])
def test_hatch_is_in_the_legend_only_where_something_is_hatched(has_range):
    inside = plot_map(a_map(STEP, has_range=has_range))
    assert not any("training range" in text for text in texts(inside))
    outside = plot_map(a_map(STEP, outside=np.where(Y[:, None] > 0.5, 1.0, 0.0) * np.ones(5), has_range=has_range))
    assert any("training range" in text for text in texts(outside)) == has_range
    plt.close("all")


def test_nodes_outside_the_range_decide_nothing():
    """The border lies where every second column does not count: no line can be drawn."""
    outside = np.where(X[None, :] > 0.7, 1.0, 0.0) * np.ones((5, 1))
    figure = plot_map(a_map(STEP, outside=outside))
    assert not any(text.startswith("chance") for text in texts(figure))
    plt.close(figure)


def test_axes_have_names_and_units_and_the_foot_says_what_it_is_worth():
    figure = plot_map(a_map(STEP))
    axes = figure.axes[0]
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("current [m/s]", "depth over tyre diameter [-]")
    other = plot_map(a_map(STEP).assign_attrs(x="soil.cohesion"))
    assert other.axes[0].get_xlabel() == "speed of the current [m/s]"
    note = " ".join(figure.get_supxlabel().split())
    assert "Trust. networks, measured" in note
    assert "10 runs a node" in note
    for one in (figure, other):
        one.canvas.draw()
        boxes = [legend.get_window_extent() for legend in one.legends]
        boxes += [one._supxlabel.get_window_extent(), *(axes.get_tightbbox() for axes in one.axes[:1])]
        for n, box in enumerate(boxes):
            assert one.bbox.containsx(box.x0) and one.bbox.containsx(box.x1 - 1e-6)
            assert not any(box.overlaps(another) for another in boxes[n + 1 :])
    plt.close("all")


# -- counts and tables -------------------------------------------------------------------------------------------------


def test_the_foot_says_who_crosses_in_which_current_and_how_far_aside():
    figure = plot_map(a_map(STEP).assign_attrs(vehicle="buggy", current_from="from 90 deg right", largest_drift=1.0))
    foot = " ".join(text.get_text() for text in figure.findobj(Text)).replace("\n", " ")
    assert "buggy. Current from 90 deg right. Go: the width of 12 m at 0.6 m/s at least, at most 1 m aside." in foot
    plt.close(figure)


@pytest.mark.parametrize(
    ("changed", "x", "said"),
    [
        ({}, "water.current_speed", "from ahead"),
        ({"water": Water(0.1, 0.5, 0.5 * math.pi)}, "water.current_speed", "from 90 deg right"),
        ({"water": Water(0.1, 0.5, 0.0), "start": StartPose(heading=math.radians(30.0))}, "water.current_speed",
         "from 150 deg left"),
        ({}, "water.current_direction", ""),
        ({"water": Water(0.1, 0.0)}, "water.density", ""),
    ],
)  # fmt: skip
def test_a_map_knows_whence_its_current_comes(changed, x, said):
    crossing = Crossing(replace(amphibious_crossing(), hydrodynamics="coefficients", **changed))
    wanted = MobilityMap(
        crossing,
        Axis(x, *((990.0, 1010.0) if "density" in x else (0.1, 0.6))),
        Axis("water.depth", 0.08, 0.12),
        {"LETE sand": {}},
        scatter={},
    )
    assert wanted.current_from() == said


def test_computed_nodes_are_counted_and_not_interpolated_ones():
    computed = np.zeros((5, 5), bool)
    computed[::2, ::2] = True
    found = a_map(STEP, computed=computed)
    (line,) = verdict_lines(found)
    assert line == (
        "sand: go at 6, no go at 3, outside the training range at 0 of 9 computed nodes (16 more are interpolated); "
        "10 runs decide at 6 and 3 of these (95 % interval)."
    )
    assert "2 runs decide at none of them, 4 could" in verdict_lines(a_map(STEP, 2))[0]
    assert "one run a node, without scatter" in verdict_lines(a_map(STEP, 1))[0]


def test_a_model_without_training_range_is_not_within_it():
    found = a_map(STEP, has_range=False)
    line, note = verdict_lines(found)
    assert "training range" not in line
    assert "has no training range" in note
    assert np.isnan(found["out_of_range"]).all()


def test_a_table_is_in_words_with_units():
    computed = np.ones((5, 5), bool)
    computed[0, 1] = False
    rows = table(a_map(STEP, computed=computed))
    header = list(rows.columns)
    assert header[:5] == [
        "panel", "water.depth_ratio [-]", "water.current_speed [m/s]", "probability [-]", "probability_low [-]",
    ]  # fmt: skip
    assert {"speed [m/s]", "drift [m]", "power [W]", "tilt [rad]", "runs [-]"} < set(header)
    assert set(rows["failure"]) == {"none", "too slow", "interpolated"}
    assert rows["water.current_speed [m/s]"].iloc[-1] == 1.2


def test_every_variable_of_a_map_has_unit_and_name():
    found = a_map(STEP)
    for name, variable in found.variables.items():
        if name != "panel":
            assert variable.attrs["units"] and variable.attrs["long_name"], name


@pytest.mark.parametrize(
    ("name", "unit"),
    [
        ("water.depth_ratio", "1"), ("water.current_speed", "m s-1"), ("water.depth", "m"), ("soil.cohesion", "Pa"),
        ("hull.mass", "kg"), ("wheelbase", "m"), ("maneuver.speed", "rad s-1"), ("duration", "s"),
        ("water.density", "kg m-3"), ("initial_speed", "m s-1"),
    ],
)  # fmt: skip
def test_axes_know_the_units_of_their_parameters(name, unit):
    found = amphibious_crossing().meaning(name)
    assert found[0] == unit
    assert found[1]


def test_another_map_in_the_folder_is_named(tmp_path):
    from dataclasses import replace

    from exumob.mobility.crossing import Crossing, Limits
    from exumob.mobility.map import MobilityMap, _claim

    quick = replace(amphibious_crossing(), hydrodynamics="coefficients", duration=1.5)
    wanted = MobilityMap(Crossing(quick, Limits(window=0.5)), scatter={}, levels=0)
    _claim(tmp_path, wanted)
    _claim(tmp_path, replace(wanted, levels=2))  # may be refined further
    with pytest.raises(ValueError, match=r"holds another map: seed was 0, and is 1\. Give another folder"):
        _claim(tmp_path, replace(wanted, seed=1))
    with pytest.raises(ValueError, match=r"another map: crossing\.limits\.width was 12\.0, and is 8\.0"):
        _claim(tmp_path, replace(wanted, crossing=Crossing(quick, Limits(width=8.0, window=0.5))))
    (tmp_path / "map.json").write_text(json.dumps({})[:1])
    with pytest.raises(ValueError, match="is damaged"):
        _claim(tmp_path, wanted)


def test_lost_runs_leave_no_answer():
    mapped = a_map(STEP)
    lost = mapped.where(xr.DataArray(X < 1.1, {"x": mapped["x"]}, "x")).assign(
        runs=mapped["runs"].where(mapped["x"] < 1.1, 0), failure=mapped["failure"]
    )
    figure = plot_map(lost.assign_attrs(mapped.attrs))
    assert "no answer" in texts(figure)
    plt.close(figure)
