"""Whole crossings of a ford: it is crossed, the ledgers close, and it may lie anywhere on the map, mirrored or not."""

import math

import numpy as np
import pytest
from banked_ford import BED, DEPTH, X, ford, seen_from_start

from exumob.driving.maneuver import ConstantSteer
from exumob.simulation.run import simulate
from exumob.simulation.summary import energy_residual, force_residual, summary
from exumob.support.constants import GRAVITY
from exumob.water.cross_section import CrossSection

AHEAD = ConstantSteer()
WEIGHT = 57.0 * GRAVITY


@pytest.fixture(scope="module")
def crossing(vehicle, sand):
    """The whole crossing: down the bank, through the water, up the other side."""
    return simulate(vehicle, sand, maneuver=AHEAD, hydrodynamics="coefficients", duration=7.0, **ford())


def test_the_vehicle_crosses(crossing):
    """It drives from dry land into 0.12 m and out again; the water lifts it and pushes it downstream."""
    depth, place = crossing["water_depth"].values, crossing["position"].sel(body="hull").values
    assert depth[0] == 0.0 and depth[-1] == 0.0
    assert depth.max() == pytest.approx(DEPTH, abs=1e-3)
    assert crossing.attrs["verdict"] == "drives"
    assert place[-1, 0] > 3.7
    in_water = depth > 0.9 * DEPTH
    lift = crossing["water_load"].sel(axis="z").sum("body").values
    share = lift[in_water].mean() / WEIGHT
    assert 0.15 < share < 0.42  # 0.41 on a level bed of that depth: the hull is longer than the ford
    np.testing.assert_array_equal(crossing["water_load"].values[0], 0.0)
    np.testing.assert_allclose(crossing["current"].sel(axis="y").values[in_water], 0.3, atol=0.03)
    np.testing.assert_allclose(crossing["water_level"], 0.0)
    push = crossing["water_load"].sel(axis="y").sum("body").values[in_water].mean()
    assert 2.0 < push < 30.0  # [N] to the left, with the current
    assert 0.002 < place[-1, 1] < 0.1
    state = crossing["flow_state"].sel(body="hull", state="water_depth")
    np.testing.assert_array_equal(state, depth)
    assert "water a field" in crossing.attrs["trust"]


def test_energy_and_forces_close_on_a_ford(crossing):
    """As on level ground: 1 % of the spin work, 1e-4 of the weight."""
    spin = float(crossing["work"].sel(work_kind="spin")[-1])
    assert spin > 50.0
    assert float(np.abs(energy_residual(crossing)).max()) < 0.01 * spin
    assert float(np.abs(force_residual(crossing)).max()) < 1e-4 * WEIGHT
    assert float(crossing["work"].sel(work_kind="water")[-1]) < -1.0


@pytest.mark.parametrize(("model", "tolerance"), [("coefficients", 1e-8), ("networks", 1e-6)])
def test_a_ford_anywhere_on_the_map(vehicle, sand, crossing, model, tolerance):
    """Moved by (1000, 2000, 7) m and turned by 37 degrees: positions after 4.5 s, and all before.

    The networks compute in single precision: 1e-6 m.
    """
    place = {"x": 1000.0, "y": 2000.0, "z": 7.0, "heading": math.radians(37.0)}
    scene = {"maneuver": AHEAD, "hydrodynamics": model, "duration": 4.5}
    here = crossing if model == "coefficients" else simulate(vehicle, sand, **scene, **ford())
    there = simulate(vehicle, sand, **scene, **ford(**place))
    found = seen_from_start(there, **place)
    np.testing.assert_allclose(found, here["position"].values[: len(found)], rtol=0.0, atol=tolerance)
    figures = summary(there)
    assert figures["forward"] == pytest.approx(found[-1, 0, 0] - found[0, 0, 0], abs=1e-6)
    assert figures["lateral"] == pytest.approx(found[-1, 0, 1] - found[0, 0, 1], abs=1e-6)
    assert float(there["water_depth"].max()) == pytest.approx(DEPTH, abs=1e-3)


def test_a_ford_and_its_mirror_image(vehicle, sand, crossing):
    """The current from the other side: the path mirrored to 1e-6 m."""
    mirrored = simulate(
        vehicle, sand, maneuver=AHEAD, hydrodynamics="coefficients", duration=4.5, **ford(speed=-0.3)
    )  # fmt: skip
    order = [0, 2, 1, 4, 3]
    expected = crossing["position"].values[: mirrored.sizes["time"], order] * [1.0, -1.0, 1.0]
    np.testing.assert_allclose(mirrored["position"], expected, rtol=0.0, atol=1e-6)


def test_a_section_is_a_ford(vehicle, sand, crossing):
    """The ford from its cross-section and discharge: the same path to 1 mm."""
    section = CrossSection(X, BED)
    depth = np.maximum(-BED, 0.0)
    discharge = 0.3 * float(np.trapezoid((depth / DEPTH) ** (2.0 / 3.0) * depth, X))
    scene = {"maneuver": AHEAD, "hydrodynamics": "coefficients", "duration": 3.0}
    run = simulate(vehicle, sand, section.water(0.0, discharge), terrain=section.terrain(), **scene)
    np.testing.assert_allclose(run["position"], crossing["position"][: run.sizes["time"]], rtol=0.0, atol=1e-3)
