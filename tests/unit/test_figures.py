"""Figures of runs: the whole vehicle is in them, legends stand clear of curves, what a result is worth is below."""

import json

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image
from scipy.spatial.transform import Rotation

from exumob.flow.output.vehicle_surface import body_triangles, stored_vehicle
from exumob.ground.terrain import Terrain
from exumob.simulation.animation import _scene, animate_run
from exumob.simulation.plotting import (
    _band,
    at_places,
    compare_runs,
    frame_path,
    plot_run,
    stored_terrain,
    vehicle_outlines,
)
from exumob.support.figures import footnote, legend_above_curves
from exumob.vehicle.motion import WHEELS

PATHS = {
    "short": lambda s: (0.0 * s, 0.0 * s, 0.0 * s),
    "long": lambda s: (30.0 * s, 0.1 * np.sin(6.0 * s), 0.0 * s),
    "circle": lambda s: (3.0 * np.sin(6.0 * s), 3.0 - 3.0 * np.cos(6.0 * s), 6.0 * s),
    "to the side": lambda s: (0.0 * s, -8.0 * s, 0.0 * s),
    "backwards": lambda s: (-5.0 * s, 0.0 * s, 0.0 * s),
    "far from the origin": lambda s: (5e6 + 2.0 * s, 4e6 + s, 0.5 * s),
}
"""Position [m] and heading [rad] of the hull by the share of the time."""


def along(run, path):
    """The run with all bodies moved and turned together."""
    share = np.linspace(0.0, 1.0, run.sizes["time"])
    x, y, yaw = path(share)
    position, turned = run["position"].values.copy(), run["yaw"].values.copy()
    relative = position[..., :2] - position[:, :1, :2]
    c, s = np.cos(yaw)[:, None], np.sin(yaw)[:, None]
    position[..., 0] = x[:, None] + c * relative[..., 0] - s * relative[..., 1]
    position[..., 1] = y[:, None] + s * relative[..., 0] + c * relative[..., 1]
    return run.assign(
        position=run["position"].copy(data=position), yaw=run["yaw"].copy(data=turned + yaw[:, None])
    )  # fmt: skip


def with_members(run):
    """The run with three members that end beside it."""
    hull = run["position"].sel(body="hull").values
    members = np.stack([hull + shift for shift in (-0.1, 0.0, 0.1)])
    return run.assign(
        member_position=(("member", "time", "axis"), members), member_yaw=(("member", "time"), members[..., 0])
    )


def inside(axes, points):
    """Whether all points lie within the limits of the axes."""
    (x_low, x_high), (y_low, y_high) = axes.get_xlim(), axes.get_ylim()
    return bool(
        (points[:, 0] >= x_low).all() and (points[:, 0] <= x_high).all()
        and (points[:, 1] >= y_low).all() and (points[:, 1] <= y_high).all()
    )  # fmt: skip


@pytest.mark.parametrize("path", PATHS)
def test_the_whole_vehicle_is_in_the_frame_at_any_time(short_run, path):
    run = along(short_run, PATHS[path])
    axes = Figure().subplots()
    for ratio in (0.0, 3.0):
        frame_path(axes, run, ratio)
        for index in range(run.sizes["time"]):
            assert all(inside(axes, outline) for outline in vehicle_outlines(run, index))
        (x_low, x_high), (y_low, y_high) = axes.get_xlim(), axes.get_ylim()
        assert (x_high - x_low) / (y_high - y_low) >= ratio - 1e-9


@pytest.mark.parametrize("path", ["short", "circle"])
def test_animation_keeps_the_whole_vehicle_in_both_views(short_run, path):
    run = along(short_run, PATHS[path])
    figure, scene = _scene(run)
    for index in (0, 10, 20):
        scene.frame(index)
        assert all(inside(scene.top, patch.get_xy()) for patch in scene.outlines)
        assert all(inside(scene.side, part.get_xy()) for part in scene.profile)
        for rim in scene.rims:
            assert inside(scene.side, np.array(rim.center) + scene.radius * np.array([[-1.0, 0.0], [1.0, 0.0]]))
    plt.close(figure)


def test_legends_stand_clear_of_curves_and_everything_within_the_page(short_run):
    """Curves that fill their panels: the whole height is swept everywhere."""
    wave = np.cos(60.0 * short_run["time"])
    names = ("forward_velocity", "slip_ratio", "soil_force", "water_wrench", "spin_power", "steering_angle")
    run = along(short_run, PATHS["circle"]).assign({n: short_run[n] + 3.0 * wave for n in names})
    figure = plot_run(run)
    figure.canvas.draw()
    panels = figure.axes[1:]
    assert len(panels) == 6
    for axes in panels:
        box = axes.get_legend().get_window_extent()
        for line in axes.lines:
            values = np.column_stack([line.get_xdata(), line.get_ydata()]).astype(float)
            shown = axes.transData.transform(values[np.isfinite(values).all(axis=1)])
            assert not box.count_contains(shown), (axes.get_title(), line.get_label())
        assert axes.get_xlabel() and "[" in axes.get_ylabel()
    page = figure.bbox
    note = figure._supxlabel.get_window_extent()
    boxes = [note, *(axes.get_tightbbox() for axes in figure.axes)]
    for n, box in enumerate(boxes):
        assert box.x0 >= page.x0 and box.x1 <= page.x1 and box.y0 >= page.y0 and box.y1 <= page.y1
        assert not any(box.overlaps(other) for other in boxes[n + 1 :])
    assert "Trust. coefficients, beyond what was measured" in " ".join(figure.get_supxlabel().split())
    plt.close(figure)


def test_members_are_told_apart_in_the_legend(short_run):
    figure = plot_run(with_members(short_run))
    found = [text.get_text() for text in figure.axes[0].get_legend().get_texts()]
    assert found == ["mean of the networks' loads", "each of the 3 networks alone", "range of these"]
    plt.close(figure)
    figure, scene = _scene(with_members(short_run))
    assert len(scene.top.get_legend().get_texts()) == 3
    plt.close(figure)


def test_the_band_of_the_members_is_their_range_at_equal_places_of_the_path():
    """Circles of 3, 3.1 and 2.95 m round one centre; the inner one ends at a third, another broke down at once.

    Equal length is an angle 0.968 as large on the outer circle: at the end 3.6 mm less across the path.
    """
    angle = np.linspace(0.0, 1.5, 60)
    path, outer, inner = (
        np.stack([r * np.sin(angle), 3.0 - r * np.cos(angle)], axis=1) for r in (3.0, 3.1, 2.95)
    )  # fmt: skip
    inner[20:] = inner[20]
    band = _band(path, np.stack([outer, inner, np.full_like(path, np.nan)]))
    low, high = np.split(band, 2)
    radius = [np.hypot(side[:, 0], side[:, 1] - 3.0) for side in (low, high[::-1])]
    assert radius[0] == pytest.approx(np.full(200, 3.1), abs=0.005)
    until = int(200 * 2.95 * angle[20] / 4.5) - 1
    assert radius[1][:until] == pytest.approx(np.full(until, 2.95), abs=0.005)
    assert radius[1][-20:] == pytest.approx(radius[0][-20:], abs=1e-9)  # the outer alone came here


@pytest.mark.filterwarnings("error")
def test_members_that_all_broke_down_at_once_have_no_band(short_run):
    run = with_members(short_run)
    run = run.assign(member_position=np.nan * run["member_position"], member_yaw=np.nan * run["member_yaw"])
    figure = plot_run(run)
    assert "range of these" not in figure.axes[0].get_legend_handles_labels()[1]
    plt.close(figure)


def test_values_at_places_are_those_of_the_first_arrival():
    place = np.array([0.0, -0.1, 1.0, 0.5, 2.0, np.nan])
    values = np.array([5.0, 9.0, 6.0, 9.0, 8.0, 1.0])
    found = at_places(place, values, np.array([-0.05, 0.0, 0.5, 1.0, 1.5, 2.0, 2.5]))
    assert found == pytest.approx([np.nan, 5.0, 5.5, 6.0, 7.0, 8.0, np.nan], nan_ok=True)
    assert np.isnan(at_places(np.full(3, np.nan), np.zeros(3), np.zeros(2))).all()


def test_a_vehicle_that_stands_is_not_drawn_as_if_it_moved(short_run):
    """Rounding errors must not fill the panels."""
    still = short_run.assign(forward_velocity=1e-12 * short_run["forward_velocity"])
    figure = plot_run(still)
    low, high = figure.axes[1].get_ylim()
    assert high - low > 0.1
    plt.close(figure)


def test_a_dry_run_shows_how_deep_the_wheels_sink(short_run):
    """In the place of the water's forces, of which there are none."""
    parameters = json.loads(short_run.attrs["parameters"]) | {"water": None}
    figure = plot_run(short_run.assign_attrs(parameters=json.dumps(parameters)))
    (panel,) = (axes for axes in figure.axes if axes.get_title() == "Sinkage of the wheels")
    assert not any(axes.get_title().startswith("Water") for axes in figure.axes)
    drawn = [line.get_ydata() for line in panel.get_lines()]
    np.testing.assert_allclose(drawn, 1e3 * short_run["sinkage"].values.T)
    assert panel.get_ylabel() == "sinkage [mm]"
    plt.close(figure)


@pytest.mark.parametrize("yaw", [0.0, 90.0])
def test_the_water_on_the_wheels_is_drawn_beside_that_on_the_hull(short_run, yaw):
    """A world force of 3, 2, 1 N on each of four wheels: along and across the hull, whichever way that points."""
    run = short_run.copy(deep=True)
    run["water_load"].loc[{"body": list(WHEELS)}] = np.array([3.0, 2.0, 1.0])
    run["quaternion"].loc[{"body": "hull"}] = Rotation.from_euler("z", yaw, degrees=True).as_quat(scalar_first=True)
    figure = plot_run(run)
    (panel,) = (axes for axes in figure.axes if axes.get_title().startswith("Water on hull and wheels"))
    lines = {line.get_label(): line.get_ydata() for line in panel.get_lines()}
    assert list(lines) == [f"{of} $F_{axis}$" for of in ("hull", "wheels") for axis in "xyz"]
    for axis, force in zip("xyz", (12.0, 8.0, 4.0) if yaw == 0.0 else (8.0, -12.0, 4.0), strict=True):
        assert lines[f"wheels $F_{axis}$"] == pytest.approx(force, abs=1e-9)
        np.testing.assert_array_equal(
            lines[f"hull $F_{axis}$"], run["water_wrench"].sel(body="hull", component=f"F{axis}")
        )
    plt.close(figure)


def test_a_vehicle_that_never_touches_the_ground_has_no_empty_panel_of_slip(short_run):
    figure = plot_run(short_run.assign(slip_ratio=np.nan * short_run["slip_ratio"]))
    (panel,) = (axes for axes in figure.axes if axes.get_title() == "Slip")
    assert [text.get_text() for text in panel.texts] == ["no contact with the soil"] and panel.get_legend() is None
    low, high = panel.get_xlim()
    assert low <= 0.0 and high >= float(short_run["time"][-1])
    plt.close(figure)


def test_runs_side_by_side_share_one_legend_and_say_what_each_is_worth(short_run):
    other = short_run.assign_attrs(trust="no water, measured: nothing")
    figure = compare_runs({"one": short_run, "other": other, "again": other})
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["one", "other", "again"]
    assert " ".join(figure.get_supxlabel().split()).count("Trust.") == 2
    plt.close(figure)


def test_the_soil_of_a_slope_is_drawn_under_the_wheels(short_run):
    """The vehicle of the short run, moved up a slope."""
    slope = Terrain.slope(0.2)
    parameters = json.loads(short_run.attrs["parameters"])
    parameters["terrain"]["Terrain"]["slope_x"] = slope.slope_x
    position = short_run["position"].copy()
    position[..., 2] += slope.slope_x * position[..., 0]
    run = short_run.assign(position=position).assign_attrs(parameters=json.dumps(parameters))
    assert stored_terrain(run).slope_x == pytest.approx(slope.slope_x)
    figure, scene = _scene(run)
    scene.frame(0)
    surface = scene.soil.get_xy()[1:-2]
    for rim in scene.rims:
        x, z = rim.center
        assert z - np.interp(x, *surface.T) == pytest.approx(0.1, abs=0.02)  # the radius, less its sinkage
        assert inside(scene.side, np.array([[x, z - scene.radius]]))
    plt.close(figure)


def test_an_animation_of_a_short_run_shows_its_beginning_and_end(short_run, tmp_path):
    animate_run(short_run, tmp_path / "short.gif", 4)
    with Image.open(tmp_path / "short.gif") as picture:
        assert picture.n_frames == 2


def test_footnotes_are_wrapped_within_the_page():
    figure, axes = plt.subplots(figsize=(4.0, 3.0), layout="constrained")
    axes.plot([0.0, 1.0])
    footnote(figure, "word " * 80, "", "another")
    figure.canvas.draw()
    box = figure._supxlabel.get_window_extent()
    assert box.x1 <= figure.bbox.x1
    assert not box.overlaps(axes.get_tightbbox())
    assert figure.get_supxlabel().endswith("another")
    plt.close(figure)


@pytest.mark.parametrize("values", [[0.0, 0.0, 0.0], [np.nan, np.nan, np.nan], [1e9, 1e9, 1e9], [-1.0, 5.0, 2.0]])
def test_legend_finds_room_whatever_is_drawn(values):
    figure, axes = plt.subplots()
    for n in range(4):
        axes.plot(values, label=f"line {n}")
    legend_above_curves(axes)
    figure.canvas.draw()
    box = axes.get_legend().get_window_extent()
    for line in axes.lines:
        points = np.column_stack([line.get_xdata(), line.get_ydata()]).astype(float)
        assert not box.count_contains(axes.transData.transform(points[np.isfinite(points).all(axis=1)]))
    plt.close(figure)


def test_results_without_a_line_of_trust_are_drawn(short_run):
    """Runs of earlier versions hold none."""
    old = short_run.copy()
    del old.attrs["trust"]
    figure = plot_run(old)
    assert figure.get_supxlabel() == ""
    plt.close(figure)


def test_a_hull_whose_mesh_is_gone_is_drawn_as_its_box(short_run, caplog):
    """A result is drawn in another folder than that of the run, or on another machine."""
    parameters = json.loads(short_run.attrs["parameters"])
    parameters["vehicle"]["Vehicle"]["hull"]["mesh"] = "gone/hull.stl"
    run = short_run.assign_attrs(parameters=json.dumps(parameters))
    box = body_triangles(stored_vehicle(run))[0]
    assert np.ptp(box[..., 0]) == pytest.approx(1.0)  # the length
    assert "gone/hull.stl is not there any more" in caplog.text
    figure, scene = _scene(run)
    scene.frame(0)
    plt.close(figure)
    plt.close(plot_run(run))
