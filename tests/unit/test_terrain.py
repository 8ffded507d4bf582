"""Terrain: planes, height fields, their continuity and bad input."""

import math

import numpy as np
import pytest

from exumob.ground.terrain import Terrain, terrain_height


@pytest.fixture
def hills():
    x, y = np.arange(9) * 0.5 - 1.0, np.arange(7) * 0.4 + 2.0
    return Terrain(
        height=0.1, slope_x=0.05, slope_y=-0.02, origin=(-1.0, 2.0), spacing=(0.5, 0.4),
        heights=0.1 * np.sin(1.3 * x) * np.cos(0.9 * y)[:, None],
    )  # fmt: skip


def test_flat_by_default():
    z, normal = Terrain().height_and_normal(3.0, -7.0)
    assert z == 0.0
    assert normal == pytest.approx([0.0, 0.0, 1.0], abs=0.0)
    assert Terrain().is_flat


def test_slope_rises_in_its_direction():
    terrain = Terrain.slope(math.radians(20.0), direction=math.radians(60.0))
    z, normal = terrain.height_and_normal(math.cos(math.radians(60.0)), math.sin(math.radians(60.0)))
    assert z == pytest.approx(math.tan(math.radians(20.0)))
    assert math.degrees(math.acos(normal[2])) == pytest.approx(20.0)
    assert not terrain.is_flat


def test_field_passes_through_its_points(hills):
    terrain, heights = hills.as_arrays()
    for j, i in ((0, 0), (3, 4), (6, 8), (5, 0)):
        x, y = -1.0 + 0.5 * i, 2.0 + 0.4 * j
        assert terrain_height(terrain[0], heights, x, y)[0] == pytest.approx(0.1 + 0.05 * x - 0.02 * y + heights[j, i])


def test_field_reproduces_a_linear_ramp_exactly_inside():
    ramp = Terrain(heights=0.3 * np.arange(6)[None, :] + 0.1 * np.arange(5)[:, None])
    terrain, heights = ramp.as_arrays()
    z, dz_dx, dz_dy = terrain_height(terrain[0], heights, 2.37, 1.81)
    assert (z, dz_dx, dz_dy) == pytest.approx((0.3 * 2.37 + 0.1 * 1.81, 0.3, 0.1))


def test_slopes_are_the_derivatives(hills):
    terrain, heights = hills.as_arrays()
    arrays, h = (terrain[0], heights), 1e-6
    for x, y in np.random.default_rng(1).uniform((-0.9, 2.1), (2.9, 4.3), (50, 2)):
        _, dz_dx, dz_dy = terrain_height(*arrays, x, y)
        forward = (terrain_height(*arrays, x + h, y)[0] - terrain_height(*arrays, x - h, y)[0]) / (2.0 * h)
        sideways = (terrain_height(*arrays, x, y + h)[0] - terrain_height(*arrays, x, y - h)[0]) / (2.0 * h)
        assert (dz_dx, dz_dy) == pytest.approx((forward, sideways), abs=1e-7)


def test_slope_is_continuous_across_cells(hills):
    terrain, heights = hills.as_arrays()
    arrays, h = (terrain[0], heights), 1e-9
    for x in (0.0, 0.5, 2.0):
        assert terrain_height(*arrays, x - h, 2.9)[1] == pytest.approx(terrain_height(*arrays, x + h, 2.9)[1], abs=1e-7)


def test_continues_outside_with_the_edge_values(hills):
    terrain, heights = hills.as_arrays()
    z, dz_dx, dz_dy = terrain_height(terrain[0], heights, 50.0, 90.0)
    assert z == pytest.approx(0.1 + 0.05 * 50.0 - 0.02 * 90.0 + heights[-1, -1])
    assert (dz_dx, dz_dy) == (0.05, -0.02)
    edge = 3.0
    inside, outside = (terrain_height(terrain[0], heights, edge + s, 3.1)[0] for s in (-1e-9, 1e-9))
    assert inside == pytest.approx(outside, abs=1e-8)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"slope_x": 3.0}, "slope_x = 3.0 is outside"),
        ({"height": math.nan}, "height = nan is not a finite number"),
        ({"heights": np.zeros(4)}, r"heights has shape \(4,\)"),
        ({"heights": np.zeros((1, 4))}, r"heights has shape \(1, 4\)"),
        ({"heights": [[0.0, math.inf], [0.0, 0.0]]}, r"heights\[0, 1\] is not finite"),
        ({"heights": np.zeros((3, 3)), "spacing": 0.0}, "spacing_x = 0.0 must be > 0"),
    ],
)
def test_bad_input_is_named(arguments, message):
    with pytest.raises(ValueError, match=message):
        Terrain(**arguments)


def test_angle_in_degrees_is_rejected():
    with pytest.raises(ValueError, match="radians"):
        Terrain.slope(20.0)
