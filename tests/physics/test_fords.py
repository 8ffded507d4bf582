"""Water over terrain in short runs: level ground as ever, restart in a ford, leaving the water, starts anywhere.

`tests/runs/test_ford_crossing.py` holds whole crossings.
"""

import math

import numpy as np
import pytest
from banked_ford import ford, seen_from_start

from exumob.driving.maneuver import ConstantSteer, LaneChange
from exumob.driving.path_following import PathFollowing, lane_shift
from exumob.ground.terrain import Terrain
from exumob.simulation.run import simulate
from exumob.support.errors import SimulationError
from exumob.vehicle.start_pose import StartPose
from exumob.water.conditions import Water
from exumob.water.water_field import WaterField


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
    scene = {"water": Water(0.1, 0.5), "maneuver": ConstantSteer(), "hydrodynamics": "coefficients", "duration": 0.5}
    low, high = (simulate(vehicle, sand, terrain=Terrain(z), **scene)["position"].values for z in (0.0, 35.0))
    np.testing.assert_allclose(high - [0.0, 0.0, 35.0], low, rtol=0.0, atol=1e-9)


INTO_THE_WATER = {"maneuver": ConstantSteer(start_speed=8.0), "hydrodynamics": "networks", "duration": 1.6}


@pytest.fixture(scope="module")
def whole(vehicle, sand):
    """Rolling from dry land into a ford."""
    return simulate(vehicle, sand, **INTO_THE_WATER, **ford())


def test_a_ford_anywhere_on_the_map(vehicle, sand, whole):
    """Moved by (1000, 2000, 7) m and turned by 37 degrees; the networks compute in single precision: 1e-6 m."""
    place = {"x": 1000.0, "y": 2000.0, "z": 7.0, "heading": math.radians(37.0)}
    there = simulate(vehicle, sand, **INTO_THE_WATER, **ford(**place))
    np.testing.assert_allclose(seen_from_start(there, **place), whole["position"], rtol=0.0, atol=1e-6)
    np.testing.assert_allclose(there["water_depth"], whole["water_depth"], rtol=0.0, atol=1e-6)


def test_a_ford_can_be_resumed(vehicle, sand, whole, tmp_path):
    """Stopped in the water and gone on with: the same bits."""
    scene = INTO_THE_WATER | ford()

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
