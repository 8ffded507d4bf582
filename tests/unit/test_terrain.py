"""Terrain: planes, height fields, their continuity and bad input."""

import math
from dataclasses import replace

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


def test_largest_slope_is_that_of_plane_and_field_together():
    """A ramp of 0.3 that is turned by 90 degrees, on a plane that rises by 0.4 along x: 0.5 in all."""
    ramp = 0.3 * np.tile(np.arange(4.0), (3, 1))
    turned = Terrain(slope_x=0.4, heights=ramp, spacing=1.0, direction=0.5 * math.pi)
    assert math.tan(turned.largest_slope) == pytest.approx(0.5)
    assert math.tan(replace(turned, direction=0.0).largest_slope) == pytest.approx(0.7)
    assert Terrain().largest_slope == 0.0


def test_field_passes_through_its_points(hills):
    terrain, nodes = hills.as_arrays()
    for j, i in ((0, 0), (3, 4), (6, 8), (5, 0)):
        x, y = -1.0 + 0.5 * i, 2.0 + 0.4 * j
        assert terrain_height(terrain[0], nodes, x, y)[0] == pytest.approx(0.1 + 0.05 * x - 0.02 * y + nodes[j, i, 0])


def test_field_reproduces_a_linear_ramp_exactly_inside():
    ramp = Terrain(heights=0.3 * np.arange(6)[None, :] + 0.1 * np.arange(5)[:, None])
    terrain, nodes = ramp.as_arrays()
    z, dz_dx, dz_dy = terrain_height(terrain[0], nodes, 2.37, 1.81)
    assert (z, dz_dx, dz_dy) == pytest.approx((0.3 * 2.37 + 0.1 * 1.81, 0.3, 0.1))


def test_slopes_are_the_derivatives(hills):
    terrain, nodes = hills.as_arrays()
    arrays, h = (terrain[0], nodes), 1e-6
    for x, y in np.random.default_rng(1).uniform((-0.9, 2.1), (2.9, 4.3), (50, 2)):
        _, dz_dx, dz_dy = terrain_height(*arrays, x, y)
        forward = (terrain_height(*arrays, x + h, y)[0] - terrain_height(*arrays, x - h, y)[0]) / (2.0 * h)
        sideways = (terrain_height(*arrays, x, y + h)[0] - terrain_height(*arrays, x, y - h)[0]) / (2.0 * h)
        assert (dz_dx, dz_dy) == pytest.approx((forward, sideways), abs=1e-7)


def test_slope_is_continuous_across_cells(hills):
    terrain, nodes = hills.as_arrays()
    arrays, h = (terrain[0], nodes), 1e-9
    for x in (0.0, 0.5, 2.0):
        assert terrain_height(*arrays, x - h, 2.9)[1] == pytest.approx(terrain_height(*arrays, x + h, 2.9)[1], abs=1e-7)


def test_continues_outside_with_the_edge_values(hills):
    terrain, nodes = hills.as_arrays()
    z, dz_dx, dz_dy = terrain_height(terrain[0], nodes, 50.0, 90.0)
    assert z == pytest.approx(0.1 + 0.05 * 50.0 - 0.02 * 90.0 + nodes[-1, -1, 0])
    assert (dz_dx, dz_dy) == (0.05, -0.02)
    edge = 3.0
    inside, outside = (terrain_height(terrain[0], nodes, edge + s, 3.1)[0] for s in (-1e-9, 1e-9))
    assert inside == pytest.approx(outside, abs=1e-8)


FIELDS = {
    "noise": lambda rng: rng.normal(0.0, 0.1, (9, 8)),
    "steps": lambda rng: 0.3 * rng.integers(0, 2, (9, 8)),
    "plateaus": lambda rng: np.repeat(np.repeat(rng.normal(0.0, 0.1, (5, 4)), 2, 0), 2, 1),
    "spike": lambda rng: np.pad([[0.4]], ((3, 5), (4, 3))),
    "waves": lambda rng: 0.2 * np.sin(np.arange(8) * rng.uniform(0.5, 2.5) + np.arange(9)[:, None]),
    "two by two": lambda rng: rng.normal(0.0, 0.1, (2, 2)),
    "strip": lambda rng: rng.normal(0.0, 0.1, (2, 30)),
}


@pytest.mark.parametrize("kind", FIELDS)
def test_never_leaves_the_range_of_its_cell(kind):
    rng = np.random.default_rng(3)
    for _ in range(20):
        field = FIELDS[kind](rng)
        terrain, nodes = Terrain(heights=field, spacing=(0.7, 0.4), steepest=100.0).as_arrays()
        n_y, n_x = field.shape
        for column, row in rng.uniform(0.0, 1.0, (100, 2)) * (n_x - 1, n_y - 1):
            j, i = int(row), int(column)
            corners = field[j : j + 2, i : i + 2]
            z = terrain_height(terrain[0], nodes, 0.7 * column, 0.4 * row)[0]
            assert corners.min() - 1e-13 <= z <= corners.max() + 1e-13


def test_a_ledge_has_no_lip():
    ledge = Terrain(heights=np.tile(np.where(np.arange(30) < 15, 0.5, 0.0), (3, 1)), spacing=0.1)
    terrain, nodes = ledge.as_arrays()
    profile = np.array([terrain_height(terrain[0], nodes, x, 0.13)[0] for x in np.linspace(0.0, 2.9, 2901)])
    assert profile.max() == pytest.approx(0.5, abs=1e-15)
    assert profile.min() == pytest.approx(0.0, abs=1e-15)
    assert (np.diff(profile) <= 1e-15).all()


def _errors(n):
    """Largest and mean error of the height, and largest one of the slope, on a smooth surface in n by n cells."""
    x = np.linspace(0.0, 2.0, n + 1)

    def surface(x, y):
        return 0.2 * np.sin(2.0 * x + 0.3) * np.cos(1.7 * y) + 0.1 * np.sin(x - 2.0 * y)

    def slope_x(x, y):
        return 0.4 * np.cos(2.0 * x + 0.3) * np.cos(1.7 * y) + 0.1 * np.cos(x - 2.0 * y)

    terrain, nodes = Terrain(heights=surface(x, x[:, None]), spacing=2.0 / n).as_arrays()
    places = np.random.default_rng(5).uniform(0.0, 2.0, (4000, 2))
    found = np.array([terrain_height(terrain[0], nodes, *place) for place in places])
    apart = np.abs(found[:, 0] - surface(*places.T))
    return apart.max(), apart.mean(), np.abs(found[:, 1] - slope_x(*places.T)).max()


def test_order_on_a_smooth_surface():
    coarse, fine = np.array(_errors(20)), np.array(_errors(80))
    largest, mean, slope = np.log2(coarse / fine) / 2.0
    assert largest > 1.9  # crests and hollows
    assert mean > 2.5
    assert slope > 0.9


def test_map_coordinates_lose_nothing():
    rng = np.random.default_rng(9)
    field = rng.normal(0.0, 0.05, (12, 10))
    near = Terrain(heights=field, spacing=0.25).as_arrays()
    away = Terrain(heights=field, spacing=0.25, origin=(456_789.25, 5_432_101.75)).as_arrays()
    for x, y in rng.uniform(0.0, 2.2, (200, 2)):
        here = terrain_height(near[0][0], near[1], x, y)
        there = terrain_height(away[0][0], away[1], x + 456_789.25, y + 5_432_101.75)
        assert there == pytest.approx(here, abs=1e-8)


def test_a_place_that_is_none_has_no_height(hills):
    terrain, nodes = hills.as_arrays()
    assert np.isnan(terrain_height(terrain[0], nodes, math.nan, 3.0)).all()
    assert np.isnan(terrain_height(terrain[0], nodes, 0.0, math.nan)).all()
    assert terrain_height(terrain[0], nodes, 1e300, -1e300)[1:] == (0.05, -0.02)


def test_knows_what_it_holds():
    field = Terrain(heights=np.zeros((5, 9)), origin=(456_789.0, 5_432_101.0), spacing=(0.5, 0.25))
    assert field.extent == (456_789.0, 456_793.0, 5_432_101.0, 5_432_102.0)
    points = [(456_789.0, 5_432_102.0), (456_788.9, 5_432_101.5), (456_790.0, 5_432_102.1), (0.0, 0.0)]
    assert field.holds(points).tolist() == [True, False, False, False]
    assert Terrain(slope_x=0.1).extent is None
    assert Terrain(slope_x=0.1).holds((1e7, 0.0))
    with pytest.raises(ValueError, match=r"from x = 456789 to 456793 m .* the start, x = -0.5 to 0.5 m.*subtract the"):
        field.require_inside("simulate.terrain", "the start", [(-0.5, 0.0), (0.5, 0.0)])
    with pytest.raises(ValueError, match="pad it"):
        field.require_inside("simulate.terrain", "the start", [(456_792.0, 5_432_101.5), (456_794.0, 5_432_101.5)])


DEM = np.full((4, 5), 120.0)
GAP = DEM.copy()
GAP[1, 2] = -9999.0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"slope_x": 3.0}, "slope_x = 3.0 must be >= -2 and <= 2; slopes are rise over run"),
        ({"height": math.nan}, "height = nan is not a finite number"),
        ({"heights": np.zeros(4)}, r"heights has shape \(4,\)"),
        ({"heights": np.zeros((1, 4))}, r"heights has shape \(1, 4\)"),
        ({"heights": [[0.0, math.inf], [0.0, 0.0]]}, r"heights: 1 of 4 values is not finite, the first at \[0, 1\]"),
        ({"heights": np.ma.masked_equal(GAP, -9999.0)}, r"1 of 20 values is masked, the first at \[1, 2\]"),
        ({"heights": GAP}, r"1 of 20 values lie outside -1000 to 9000 m, the first at \[1, 2\] \(-9999\): marks of mi"),
        ({"heights": np.where(GAP < 0.0, -32768.0, GAP)}, r"the first at \[1, 2\] \(-32768\)"),
        ({"heights": np.where(GAP < 0.0, 3.4e38, GAP)}, r"the first at \[1, 2\] \(3.4e\+38\)"),
        ({"heights": np.full((3, 3), -9999.0)}, "9 of 9 values lie outside"),
        (
            {"heights": np.where(GAP < 0.0, 0.0, GAP)},
            r"from 120 m at \[1, 1\] to 0 m .*89.5 deg.*If 0 marks",
        ),
        ({"heights": 1e3 * np.arange(6.0).reshape(2, 3), "spacing": 0.5}, "Terrain.steepest = 5 as at 7 pairs"),
        ({"heights": DEM.astype(object)}, "not numbers"),
        ({"heights": DEM.astype(str)}, "holds texts"),
        ({"heights": DEM > 0.0}, "holds logical values"),
        ({"heights": DEM + 0j}, "holds complex values"),
        ({"heights": np.zeros((3, 3)), "spacing": 0.0}, "spacing = 0.0 m must be > 0 .*give a value within"),
        ({"heights": np.zeros((3, 3)), "spacing": (0.1, -0.1)}, r"spacing\[1\] = -0.1 m must be > 0.*heights\[::-1\]"),
        ({"heights": np.zeros((3, 3)), "spacing": (0.1, 0.1, 0.1)}, "spacing = .* has 3 values; it must have 2"),
        ({"heights": np.zeros((3, 3)), "spacing": 2.8e-4}, "plausible range"),
        ({"origin": (1, 2, 3)}, "origin = .* has 3 values; it must have 2"),
        ({"origin": (math.nan, 0.0)}, r"origin\[0\] = nan is not a finite number"),
    ],
)
def test_bad_input_is_named(arguments, message):
    with pytest.raises(ValueError, match=message):
        Terrain(**arguments)


def test_a_step_that_is_meant_passes():
    kerb = np.zeros((3, 6))
    kerb[:, 3:] = 0.15
    with pytest.raises(ValueError, match=r"to 0.15 m at \[0, 3\] is a slope of 15 .*raise steepest"):
        Terrain(heights=kerb, spacing=0.01)
    assert Terrain(heights=kerb, spacing=0.01, steepest=20.0).heights.max() == 0.15


def test_angle_in_degrees_is_rejected():
    with pytest.raises(ValueError, match="radians"):
        Terrain.slope(20.0)


def test_a_field_that_does_not_fit_into_memory(monkeypatch):
    monkeypatch.setattr("exumob.support.cost.memory_limit", lambda: 1e6)
    with pytest.raises(ValueError, match=r"Terrain\.heights of 100 by 200 points: about .* of memory.*cut out"):
        Terrain(heights=np.zeros((100, 200)))
    assert Terrain(heights=np.zeros((10, 20))).extent == (0.0, 19.0, 0.0, 9.0)
