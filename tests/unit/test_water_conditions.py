"""Water by depth, level or field: what may be given, and what compiled code and users read of it."""

import math

import numpy as np
import pytest

from exumob.ground.terrain import Terrain, terrain_height
from exumob.support.errors import SimulationError
from exumob.vehicle.motion import BodyStates
from exumob.vehicle.start_pose import StartPose
from exumob.water.conditions import Water, require_within
from exumob.water.water_field import WaterField, water_at

RNG = np.random.default_rng(4)
LEVEL = RNG.uniform(0.1, 0.3, (5, 7))


def at(water, terrain, x, y):
    record, nodes = water.as_arrays(terrain)
    return water_at(record[0], nodes, x, y)


def test_a_depth_is_what_it_was():
    water = Water(0.12, 1.0, 2.0, 1025.0)
    assert (water.depth, water.current_speed, water.current_direction, water.density) == (0.12, 1.0, 2.0, 1025.0)
    assert water.uniform_depth == 0.12
    assert water.parameters == {"depth": 0.12, "current_speed": 1.0, "current_direction": 2.0, "density": 1025.0}
    assert at(water, Terrain(height=3.5), 9.0, 9.0) == (3.62, *water.velocity[:2])


@pytest.mark.parametrize(
    ("given", "text"),
    [
        ({}, "none of them given"),
        ({"depth": 0.1, "level": 0.1}, "depth and level given"),
        ({"level": 0.1, "field": WaterField(LEVEL)}, "level and field given"),
        ({"field": WaterField(LEVEL), "current_speed": 1.0}, "current_speed = 1 m/s beside a field"),
        ({"level": 1e5}, "Water.level"),
        ({"level": math.nan}, "Water.level"),
        ({"field": LEVEL}, "Water.field"),
    ],
)
def test_water_is_given_in_one_way(given, text):
    with pytest.raises(ValueError, match=text):
        Water(**given)


@pytest.mark.parametrize("terrain", [Terrain.slope(0.1), Terrain(heights=np.zeros((3, 3)))])
def test_a_depth_needs_level_ground(terrain):
    with pytest.raises(ValueError, match=r"Water\.depth = 0\.1 m.*Water\(level="):
        Water(0.1).as_arrays(terrain)
    assert at(Water(level=0.4, current_speed=0.5, current_direction=0.0), terrain, 1.0, 1.0) == (0.4, 0.5, 0.0)


@pytest.mark.parametrize("water", [Water(level=0.1), Water(field=WaterField(LEVEL))])
def test_models_of_one_depth_say_so(water):
    with pytest.raises(ValueError, match="one depth"):
        water.uniform_depth  # noqa: B018


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"level": np.full((3, 3), np.nan)}, "nan everywhere"),
        ({"level": np.zeros(4)}, "shape"),
        ({"level": np.zeros((1, 4))}, "2 by 2"),
        ({"level": np.full((5, 7), -9999.0)}, "give nan"),
        ({"velocity_x": np.zeros((5, 7))}, "velocity_y is missing"),
        ({"velocity_x": np.zeros((5, 6)), "velocity_y": np.zeros((5, 7))}, "one grid"),
        ({"velocity_x": np.full((5, 7), np.nan), "velocity_y": np.zeros((5, 7))}, "35 wet points"),
        ({"velocity_x": np.full((5, 7), 40.0), "velocity_y": np.zeros((5, 7))}, "plausible"),
        ({"spacing": -1.0}, r"level\[::-1\]"),
        ({"spacing": (1.0, 0.0)}, "spacing"),
    ],
)
def test_fields_that_cannot_be(change, text):
    with pytest.raises(ValueError, match=text):
        WaterField(**({"level": LEVEL} | change))


def test_a_constant_field_is_its_constant_bit_for_bit():
    values = 0.123456789, 0.3 * math.cos(2.0), 0.3 * math.sin(2.0)
    field = WaterField(*(np.full((4, 6), v) for v in values), origin=(-1.0, 2.0), spacing=(0.3, 0.7), direction=0.6)
    for x, y in RNG.uniform(-3.0, 6.0, (200, 2)):
        assert at(Water(field=field), Terrain(), x, y) == values


def test_a_field_is_bilinear_in_its_own_axes():
    """Of a + b u + c v + d u v all is reproduced; beyond the edges the nearest point of the edge counts."""
    turn, origin = 0.4, np.array([10.0, -4.0])
    c, s = math.cos(turn), math.sin(turn)
    u, v = np.meshgrid(0.5 * np.arange(7), 0.25 * np.arange(5))
    field = WaterField(
        0.1 + 0.02 * u - 0.03 * v + 0.01 * u * v, 0.1 * u, -0.2 * v, tuple(origin), (0.5, 0.25), turn
    )  # fmt: skip
    for a, b in RNG.uniform((-1.0, -1.0), (4.0, 2.0), (100, 2)):
        x, y = origin[0] + c * a - s * b, origin[1] + s * a + c * b
        p, q = np.clip(a, 0.0, 3.0), np.clip(b, 0.0, 1.0)
        expected = 0.1 + 0.02 * p - 0.03 * q + 0.01 * p * q, 0.1 * p, -0.2 * q
        assert at(Water(field=field), None, x, y) == pytest.approx(expected, abs=1e-12)
        assert field.holds([x, y]) == (0.0 <= a <= 3.0 and 0.0 <= b <= 1.0)
    assert np.isnan(at(Water(field=field), None, math.nan, 0.0)).all()


def test_dry_points_take_the_nearest_level_and_stand_still():
    level = np.full((3, 5), np.nan)
    level[:, 0], level[:, 4] = 0.1, 0.3
    field = WaterField(level, np.where(np.isnan(level), np.nan, 1.0), np.ones((3, 5)))
    nodes = field.nodes
    np.testing.assert_array_equal(nodes[1, [0, 1, 3, 4], 0], [0.1, 0.1, 0.3, 0.3])
    np.testing.assert_array_equal(nodes[1, :, 1], [1.0, 0.0, 0.0, 0.0, 1.0])
    np.testing.assert_array_equal(nodes[1, :, 2], [1.0, 0.0, 0.0, 0.0, 1.0])


def bodies_at(x):
    zeros = np.zeros((1, 5, 3))
    position = np.tile([x, 1.0, 0.1], (1, 5, 1))
    return BodyStates(np.array([2.5]), position, np.tile(np.eye(3), (1, 5, 1, 1)), *[zeros] * 4, np.zeros((1, 4)))


def test_a_run_stops_where_the_field_ends():
    field = WaterField(LEVEL)
    require_within(Water(field=field), bodies_at(5.9))
    with pytest.raises(SimulationError, match=r"hull has left the field of water at 2\.5000 s.*continued"):
        require_within(Water(field=field), bodies_at(6.1))
    for water in (Water(field=WaterField(LEVEL, continued=True)), Water(level=0.1), Water(0.1)):
        require_within(water, bodies_at(60.0))


def test_water_at_many_places():
    level, velocity = Water(level=0.2, current_speed=0.5, current_direction=math.pi / 2).at(np.zeros((2, 3, 2)))
    assert level.shape == (2, 3) and velocity.shape == (2, 3, 2)
    np.testing.assert_allclose(velocity[0, 0], [0.0, 0.5], atol=1e-15)


# -- terrain that is turned, and the start -----------------------------------------------------------------------------


def test_a_turned_field_of_heights_is_the_same_ground_turned():
    """Heights and slopes at turned places; the plane under it stays. 1e-12."""
    heights, turn = RNG.normal(0.0, 0.05, (6, 8)), 0.7
    straight = Terrain(heights=heights, spacing=(0.5, 0.3))
    turned = Terrain(0.2, 0.03, -0.04, heights, (5.0, 7.0), (0.5, 0.3), direction=turn)
    c, s = math.cos(turn), math.sin(turn)
    (first, nodes), (second, same) = straight.as_arrays(), turned.as_arrays()
    np.testing.assert_array_equal(nodes, same)
    for u, v in RNG.uniform((-1.0, -1.0), (5.0, 3.0), (100, 2)):
        x, y = 5.0 + c * u - s * v, 7.0 + s * u + c * v
        z, a, b = terrain_height(first[0], nodes, u, v)
        expected = z + 0.2 + 0.03 * x - 0.04 * y, c * a - s * b + 0.03, s * a + c * b - 0.04
        assert terrain_height(second[0], nodes, x, y) == pytest.approx(expected, abs=1e-12)
        assert turned.holds([x, y]) == straight.holds([u, v])
        near = turned.as_arrays((x, y, 0.3))[0]
        assert terrain_height(near[0], nodes, 0.0, 0.0) == pytest.approx((expected[0] - 0.3, *expected[1:]), abs=1e-12)
    x_low, x_high, y_low, y_high = turned.extent
    assert (x_low, x_high) == pytest.approx((5.0 - s * 1.5, 5.0 + c * 3.5))
    assert (y_low, y_high) == pytest.approx((7.0, 7.0 + s * 3.5 + c * 1.5))


def test_start_pose_turns_and_moves():
    start = StartPose(10.0, 20.0, math.pi / 2)
    np.testing.assert_allclose(start.to_world([[1.0, 0.0], [0.0, 2.0]]), [[10.0, 21.0], [8.0, 20.0]], atol=1e-12)
    with pytest.raises(ValueError, match="degrees"):
        StartPose(heading=90.0)
