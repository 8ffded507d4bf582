"""Mobility maps: verdicts on single runs, scatter, bad input."""

import math
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr

from exumob.mobility.crossing import FAILURES, Crossing, Limits, judge
from exumob.mobility.map import Axis, MobilityMap
from exumob.support.errors import SimulationError
from exumob.support.quantities import unusual
from exumob.sweeps.experiment import amphibious_crossing
from exumob.sweeps.sampling import Normal

QUICK = replace(amphibious_crossing(), hydrodynamics="coefficients", duration=1.5)
BRIEF = Limits(window=0.5)


def run_at(speed=1.0, sideways=0.0, roll=0.0, load=0.9, outside=False):
    """A run of 4 s at constant velocity."""
    time = np.linspace(0.0, 4.0, 41)
    position = np.zeros((41, 1, 3))
    position[:, 0, 0], position[:, 0, 1] = speed * time, sideways * time
    macro = time[:-1]
    return xr.Dataset(
        {
            "position": (("time", "body", "axis"), position),
            "roll": (("time", "body"), np.full((41, 1), roll)),
            "pitch": (("time", "body"), np.zeros((41, 1))),
            "slip_ratio": (("time", "wheel"), np.full((41, 4), 0.3)),
            "spin_power": (("time", "wheel"), np.full((41, 4), 25.0)),
            "soil_force": (("time", "wheel", "axis"), np.full((41, 4, 3), load * 100.0 * 9.81 / 4)),
            "mass": ("body", [100.0]),
            "hydrodynamics_out_of_range": (("macro_time", "body"), np.full((40, 1), outside)),
        },
        coords={"time": time, "macro_time": macro, "body": ["hull"], "axis": ["x", "y", "z"]},
    )


@pytest.mark.parametrize(
    ("given", "failure"),
    [
        ({}, "none"),
        ({"speed": 0.61}, "none"),
        ({"speed": 0.59}, "too slow"),
        ({"speed": 0.04}, "stuck"),
        ({"speed": -0.5}, "stuck"),
        ({"sideways": 0.08}, "none"),
        ({"sideways": 0.09}, "pushed aside"),
        ({"sideways": -0.09}, "pushed aside"),
        ({"roll": 0.6, "speed": 0.1}, "tipped"),
        ({"load": 0.04}, "afloat"),
    ],
)
def test_verdicts(given, failure):
    found = judge(run_at(**given), Limits())
    assert FAILURES[int(found["failure"])] == failure
    assert found["crossed"] == (failure == "none")
    assert found["power"] == pytest.approx(100.0)
    assert found["speed"] == pytest.approx(given.get("speed", 1.0))


def test_drift_is_over_the_width_and_range_over_the_window():
    assert judge(run_at(speed=0.8, sideways=0.02), Limits())["drift"] == pytest.approx(0.3)
    assert judge(run_at(outside=True), Limits())["out_of_range"] == 1.0
    with pytest.raises(ValueError, match=r"longer than Limits\.window"):
        judge(run_at(), Limits(window=5.0))


def test_a_run_with_water_is_judged():
    found = Crossing(QUICK, BRIEF)({"water.depth_ratio": 0.4, "water.current_speed": 0.0})
    assert 0.3 < found["speed"] < 1.0
    assert 0.7 < found["wheel_load"] < 1.0
    assert found["power"] > 10.0


@pytest.mark.parametrize(
    ("values", "failure"),
    [
        ({"soil.k_phi": unusual(4e3), "soil.k_c": 0.0, "water.depth_ratio": 0.3}, "sunk"),
        ({"water.depth": 0.5}, "afloat"),
    ],
)
def test_vehicles_that_cannot_even_stand(values, failure):
    found = Crossing(QUICK, BRIEF)(values)
    assert FAILURES[int(found["failure"])] == failure
    assert found["crossed"] == 0.0
    assert math.isnan(found["speed"])


def test_a_breakdown_outside_the_range_says_so():
    outside = run_at(outside=True)

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
    with pytest.raises(ValueError, match="stuck"):
        Limits(stuck_speed=0.7)
