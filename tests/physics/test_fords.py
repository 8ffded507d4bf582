"""Water over terrain in a run: a ford wherever it lies on the map, level ground as ever, the ledgers, restart.

The ford: banks of 15 %, a bottom 0.12 m under water and 0.8 m wide, a current to the left of the path in proportion to
the depth to the power 2/3.
"""

import math

import numpy as np
import pytest

from exumob.driving.maneuver import ConstantSteer, LaneChange
from exumob.driving.path_following import PathFollowing, lane_shift
from exumob.ground.terrain import Terrain
from exumob.simulation.run import simulate
from exumob.simulation.summary import energy_residual, force_residual, summary
from exumob.support.constants import GRAVITY
from exumob.support.errors import SimulationError
from exumob.vehicle.start_pose import StartPose
from exumob.water.conditions import Water
from exumob.water.cross_section import CrossSection
from exumob.water.water_field import WaterField

DEPTH = 0.12
X = np.arange(-3.0, 9.01, 0.1)
BANK = (DEPTH + 0.045) / 0.15  # [m], long
BED = np.interp(X, [0.9, 0.9 + BANK, 1.7 + BANK, 1.7 + 2.0 * BANK], [0.045, -DEPTH, -DEPTH, 0.045])
AHEAD = ConstantSteer()
WEIGHT = 57.0 * GRAVITY


def ford(x=0.0, y=0.0, z=0.0, heading=0.0, speed=0.3, **options):
    """Terrain, water and start of the ford, moved and turned about the start."""
    start = StartPose(x, y, heading)
    origin = tuple(start.to_world([X[0], -4.0]).tolist())
    depth = np.maximum(-BED, 0.0)
    across = np.tile(speed * (depth / DEPTH) ** (2.0 / 3.0), (9, 1))
    field = WaterField(
        np.full(across.shape, z), -math.sin(heading) * across, math.cos(heading) * across, origin, (0.1, 1.0), heading,
        **options,
    )  # fmt: skip
    terrain = Terrain(z, heights=np.tile(BED, (9, 1)), origin=origin, spacing=(0.1, 1.0), direction=heading)
    return {"terrain": terrain, "water": Water(field=field), "start": start}


def seen_from_start(run, x=0.0, y=0.0, z=0.0, heading=0.0):
    """Positions in axes that begin at the start and head as it does."""
    c, s = math.cos(heading), math.sin(heading)
    return (run["position"].values - [x, y, z]) @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


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


@pytest.mark.parametrize("model", ["coefficients", "networks"])
def test_a_constant_field_is_a_constant_depth_bit_for_bit(vehicle, sand, model):
    """So is a level; with a head current the networks, too."""
    depth = Water(0.12, 0.7)
    scene = {"maneuver": LaneChange(start=0.2, end=0.8), "hydrodynamics": model, "duration": 0.9}
    expected = simulate(vehicle, sand, depth, **scene)
    velocity = [np.full((4, 5), v) for v in depth.velocity[:2]]
    field = WaterField(np.full((4, 5), 0.12), *velocity, (-3.0, -4.0), (3.0, 4.0))
    for water in (Water(field=field), Water(level=0.12, current_speed=0.7)):
        found = simulate(vehicle, sand, water, **scene)
        for name in ("position", "water_wrench", "flow_state"):
            np.testing.assert_array_equal(found[name], expected[name], err_msg=name)


def test_level_ground_at_another_height(vehicle, sand):
    """A depth goes with it: the run at z = 35 m is that at z = 0, 1e-9 m."""
    scene = {"water": Water(0.1, 0.5), "maneuver": AHEAD, "hydrodynamics": "coefficients", "duration": 0.5}
    low, high = (simulate(vehicle, sand, terrain=Terrain(z), **scene)["position"].values for z in (0.0, 35.0))
    np.testing.assert_allclose(high - [0.0, 0.0, 35.0], low, rtol=0.0, atol=1e-9)


def test_a_ford_and_its_mirror_image(vehicle, sand, crossing):
    """The current from the other side: the path mirrored to 1e-6 m."""
    mirrored = simulate(
        vehicle, sand, maneuver=AHEAD, hydrodynamics="coefficients", duration=4.5, **ford(speed=-0.3)
    )  # fmt: skip
    order = [0, 2, 1, 4, 3]
    expected = crossing["position"].values[: mirrored.sizes["time"], order] * [1.0, -1.0, 1.0]
    np.testing.assert_allclose(mirrored["position"], expected, rtol=0.0, atol=1e-6)


def test_a_ford_can_be_resumed(vehicle, sand, tmp_path):
    """Stopped in the water and gone on with: the same bits."""
    scene = {"maneuver": ConstantSteer(start_speed=8.0), "hydrodynamics": "networks", "duration": 1.6, **ford()}
    whole = simulate(vehicle, sand, **scene)

    def stop(time):
        if time > 1.2:
            raise RuntimeError("enough")

    file = tmp_path / "run.npz"
    with pytest.raises(SimulationError, match="enough"):
        simulate(vehicle, sand, checkpoint=file, progress=stop, **scene)
    resumed = simulate(vehicle, sand, checkpoint=file, resume=True, **scene)
    assert float(whole["water_depth"][-1]) > 0.0
    for name in ("position", "water_wrench", "work"):
        np.testing.assert_array_equal(resumed[name], whole[name], err_msg=name)


def test_a_section_is_a_ford(vehicle, sand, crossing):
    """The ford from its cross-section and discharge: the same path to 1 mm."""
    section = CrossSection(X, BED)
    depth = np.maximum(-BED, 0.0)
    discharge = 0.3 * float(np.trapezoid((depth / DEPTH) ** (2.0 / 3.0) * depth, X))
    scene = {"maneuver": AHEAD, "hydrodynamics": "coefficients", "duration": 3.0}
    run = simulate(vehicle, sand, section.water(0.0, discharge), terrain=section.terrain(), **scene)
    np.testing.assert_allclose(run["position"], crossing["position"][: run.sizes["time"]], rtol=0.0, atol=1e-3)


def test_a_run_that_leaves_its_water_stops(vehicle, sand):
    small = WaterField(np.full((2, 3), 0.1), origin=(-1.0, -1.0), spacing=(1.0, 2.0))
    with pytest.raises(SimulationError, match=r"has left the field of water at") as caught:
        simulate(vehicle, sand, Water(field=small), ConstantSteer(start_speed=10.0), "coefficients", duration=1.5)
    ended = caught.value.result
    assert ended is not None and ended.attrs["status"].startswith("broke down")
    assert float(ended["position"].sel(axis="x").max()) == pytest.approx(1.0, abs=0.05)


def test_a_path_stays_where_it_is_and_a_maneuver_goes_with_the_start(vehicle, sand):
    """On dry ground, to 1e-8 m: lane change and rolling start along the heading, waypoints in the world."""
    start = StartPose(300.0, -40.0, 2.0)
    path = lane_shift(0.3, 0.3, 0.8, end=5.0)
    moved = tuple(map(tuple, start.to_world(path).tolist()))
    for here, there in (
        (PathFollowing(path), PathFollowing(moved)), (LaneChange(start=0.1, end=0.7), LaneChange(start=0.1, end=0.7)),
    ):  # fmt: skip
        run, other = (
            simulate(vehicle, sand, None, maneuver, duration=0.8, start=pose, initial_speed=1.0)
            for maneuver, pose in ((here, None), (there, start))
        )
        found = seen_from_start(other, start.x, start.y, 0.0, start.heading)
        np.testing.assert_allclose(found, run["position"], rtol=0.0, atol=1e-8)
    with pytest.raises(ValueError, match=r"PathFollowing.waypoints: the path comes no nearer"):
        simulate(vehicle, sand, None, PathFollowing(path), duration=1.2, start=(300.0, -40.0, 2.0))
