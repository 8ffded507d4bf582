"""Mobility maps: verdicts on single runs, scatter, bad input."""

import math
from dataclasses import replace

import numpy as np
import pytest
from made_up_runs import made_up_run

from exumob.mobility.crossing import FAILURES, Crossing, Limits, judge_crossing
from exumob.mobility.map import Axis, MobilityMap
from exumob.mobility.map_figure import FAILURE_COLORS
from exumob.simulation.verdict import CONDITIONS, VerdictLimits
from exumob.support.errors import SimulationError
from exumob.support.quantities import unusual
from exumob.sweeps.experiment import amphibious_crossing
from exumob.sweeps.sampling import Normal

QUICK = replace(amphibious_crossing(), hydrodynamics="coefficients", duration=1.5)
BRIEF = Limits(window=0.5)


def run_at(outside=False, **given):
    """A run of 4 s, by default at 1 m/s with 90 % of the weight on the wheels."""
    run = made_up_run(end=4.0, step=0.1, **{"forward": 1.0, "load": 0.9, "push": (0.0, 20.0)} | given)
    macro = run["time"].values[:-1]
    return run.assign(
        hydrodynamics_out_of_range=(("macro_time", "body"), np.full((len(macro), 5), outside)),
    ).assign_coords(macro_time=macro)


@pytest.mark.parametrize(
    ("given", "failure", "since"),
    [
        ({}, "none", math.nan),
        ({"forward": 0.61}, "none", math.nan),
        ({"forward": 0.59}, "too slow", math.nan),
        ({"tread": 0.0, "forward": 0.0}, "too slow", math.nan),
        ({"forward": 0.04}, "stuck", 0.0),
        ({"forward": -0.5, "push": (-9.0, 0.0)}, "swept away", 0.0),
        ({"forward": -0.5, "depth": 0.0}, "slides", 0.0),
        ({"lateral": 0.08}, "none", math.nan),
        ({"lateral": 0.09}, "pushed aside", math.nan),
        ({"lateral": -0.09}, "pushed aside", math.nan),
        ({"roll": 0.9, "forward": 0.1}, "tipped", 0.0),
        ({"roll": lambda t: 0.9 if t < 1.0 else 0.0}, "tipped", 0.0),
        ({"load": 0.04}, "afloat", 0.0),
        ({"load": lambda t: 0.0 if t > 1.95 else 0.9}, "afloat", 2.0),
        ({"load": lambda t: 0.0 if t < 1.05 else 0.9}, "none", math.nan),  # over before the window
        ({"load": lambda t: 0.0 if t < 2.55 else 0.9}, "afloat", 0.0),
        ({"sinkage": 0.95}, "sunk", 0.0),
        ({"depth": 0.5}, "submerged", 0.0),
    ],
)
def test_verdicts(given, failure, since):
    found = judge_crossing(run_at(**given), Limits())
    assert FAILURES[int(found["failure"])] == failure
    assert found["failure_since"] == pytest.approx(since, abs=1e-6, nan_ok=True)
    assert found["crossed"] == (failure == "none")
    assert found["power"] == pytest.approx(100.0)
    assert found["speed"] == pytest.approx(given.get("forward", 1.0))


def test_every_condition_is_a_failure_and_old_maps_keep_their_numbers():
    assert set(CONDITIONS) | {"broke down"} <= set(FAILURES)
    before = ("none", "sunk", "afloat", "swept away", "tipped", "stuck", "too slow", "pushed aside", "broke down")
    assert FAILURES[: len(before)] == before
    assert len(FAILURE_COLORS) == len(FAILURES)


def test_drift_is_over_the_width_and_range_over_the_window():
    assert judge_crossing(run_at(forward=0.8, lateral=0.02), Limits())["drift"] == pytest.approx(0.3)
    assert judge_crossing(run_at(outside=True), Limits())["out_of_range"] == 1.0
    found = run_at()
    wide = np.where(found["macro_time"] >= 4.0 - Limits().window - 1e-9, 0.25, 1.0)
    shared = found.assign(hydrodynamics_wide_range_share=found["hydrodynamics_out_of_range"] + wide[:, None])
    assert judge_crossing(found, Limits())["wide_range"] == 0.0
    assert judge_crossing(shared, Limits())["wide_range"] == pytest.approx(0.25)
    with pytest.raises(ValueError, match=r"longer than Limits\.window"):
        judge_crossing(run_at(), Limits(window=5.0))


def test_limits_of_the_verdict_are_limits_of_the_crossing():
    strict = Limits(verdict=VerdictLimits(wheel_load=0.95))
    assert FAILURES[int(judge_crossing(run_at(), strict)["failure"])] == "afloat"


def test_a_run_with_water_is_judged():
    found = Crossing(QUICK, BRIEF)({"water.depth_ratio": 0.4, "water.current_speed": 0.0})
    assert 0.3 < found["speed"] < 1.0
    assert 0.7 < found["wheel_load"] < 1.0
    assert found["power"] > 10.0


def test_a_vehicle_that_cannot_even_stand_has_failed():
    found = Crossing(QUICK, BRIEF)({"soil.k_phi": unusual(4e3), "soil.k_c": 0.0, "water.depth_ratio": 0.3})
    assert FAILURES[int(found["failure"])] == "sunk"
    assert (found["crossed"], found["failure_since"]) == (0.0, 0.0)
    assert math.isnan(found["speed"])


@pytest.mark.parametrize(("current", "failure"), [(0.0, "afloat"), (1.0, "swept away")])
def test_a_vehicle_that_floats_has_failed(current, failure):
    found = Crossing(QUICK, BRIEF)({"water.depth": 0.5, "water.current_speed": current})
    assert FAILURES[int(found["failure"])] == failure
    assert found["crossed"] == 0.0
    assert found["wheel_load"] < 0.01
    assert math.isnan(found["slip"])
    assert found["speed"] == pytest.approx(-0.5 * current, abs=0.5 * current + 0.01)


def test_a_breakdown_outside_the_range_says_so():
    outside = run_at(outside=True, status="broke down at 4.0000 s: Newton did not converge")

    def broken(values):
        error = SimulationError("Newton did not converge")
        error.result = outside
        raise error

    crossing = Crossing(QUICK, BRIEF)
    object.__setattr__(crossing, "experiment", broken)
    found = crossing({})
    assert FAILURES[int(found["failure"])] == "broke down"
    assert found["out_of_range"] == 1.0


def test_same_draws_serve_every_node_and_members_take_turns():
    networks = replace(QUICK, hydrodynamics="networks")
    wanted = MobilityMap(Crossing(networks, BRIEF), draws=10)
    factors = wanted.factors()
    assert sorted(case["hydrodynamics.member"] for case in factors) == sorted(2 * list(range(5)))
    one, other = (wanted.case({"soil": "LETE sand"}, x, y, factors[3]) for x, y in ((0.5, 0.4), (1.0, 0.6)))
    assert one["soil.cohesion"] == other["soil.cohesion"]
    assert one["water.current_speed"] / 0.5 == pytest.approx(other["water.current_speed"])
    assert one["water.depth_ratio"] / 0.4 == pytest.approx(other["water.depth_ratio"] / 0.6)


def test_bad_maps_are_refused_before_anything_runs():
    with pytest.raises(ValueError, match="low"):
        Axis("water.depth_ratio", 0.6, 0.4)
    with pytest.raises(ValueError, match="panels"):
        MobilityMap(Crossing(QUICK, BRIEF), panels={})
    with pytest.raises(ValueError, match="not known"):
        MobilityMap(Crossing(QUICK, BRIEF), scatter={"soil.cohesoin": Normal(1.0, 0.1)})
    with pytest.raises(ValueError, match="no soil is called"):
        MobilityMap(Crossing(QUICK, BRIEF), panels={"mud": {"soil": "mud of the moon"}})
    with pytest.raises(ValueError, match=r"Limits\.window"):
        Crossing(replace(QUICK, duration=1.0))
    for change, match in (
        ({"levels": 1.5}, "whole number"),
        ({"x": Axis("water.depth_ratio", 0.1, 0.2)}, "two different names"),
        ({"panels": {"a": {}, "b": {"soil.cohesion": 900.0}}}, "the same names in all"),
        ({"panels": {"a": {"water.current_speed": 0.1}}}, "is an axis"),
    ):
        with pytest.raises(ValueError, match=match):
            MobilityMap(Crossing(QUICK, BRIEF), **change)
    networks = Crossing(replace(QUICK, hydrodynamics="networks"), BRIEF)
    with pytest.raises(ValueError, match="trained"):
        MobilityMap(networks, scatter={"hull.length": Normal(1.0, 0.02)})
    with pytest.raises(ValueError, match=r"Limits\.drift"):
        Limits(drift=0.0)
    with pytest.raises(ValueError, match=r"Limits\.verdict"):
        Limits(verdict=0.1)
