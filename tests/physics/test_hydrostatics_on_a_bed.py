"""Hydrostatics over a bed that is not level: floating, grounded and half-grounded bodies against Archimedes.

The independent integrals are midpoint sums over the faces and the volume of a box, which know nothing of triangles.
"""

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from exumob.ground.terrain import Terrain
from exumob.support.constants import GRAVITY
from exumob.vehicle.vehicle_file import load_vehicle
from exumob.water.hydrostatics import hydrostatic_wrench, wetted
from exumob.water.wetted_surface import box_surface, hull_surface

SIZE = np.array([1.0, 0.44, 0.2])
SPECIFIC_WEIGHT = 1000.0 * GRAVITY
TURNS = {
    "upright": np.eye(3),
    "on the slope": Rotation.from_euler("ZY", [0.4, math.atan(0.15)]).as_matrix(),
    "askew": Rotation.from_euler("ZYX", [-1.1, 0.2, 0.15]).as_matrix(),
}
SLOPE = Terrain(height=0.3, slope_x=0.12, slope_y=-0.09)
PLACE, LEVEL = np.array([2.0, 3.0, 0.35]), 0.4
# height of the bed below the box's origin: 0.27
BEDS = {
    "floating": SLOPE.height - 0.4,
    "half-grounded": SLOPE.height,
    "grounded": SLOPE.height + 0.12,
    "on dry land": SLOPE.height + 0.5,
}


def midpoints(n):
    return (np.arange(n) + 0.5) / n - 0.5


def pressure_wrench(rotation, bed, n=300):
    """Sum of -p n dA and r x (-p n dA) over the wet faces above the bed, body axes about the origin."""
    wrench = np.zeros(6)
    for axis in range(3):
        others = [k for k in range(3) if k != axis]
        a, b = np.meshgrid(midpoints(n) * SIZE[others[0]], midpoints(n) * SIZE[others[1]])
        for side in (-1.0, 1.0):
            arm = np.empty((n * n, 3))
            arm[:, axis], arm[:, others[0]], arm[:, others[1]] = 0.5 * side * SIZE[axis], a.ravel(), b.ravel()
            x, y, z = PLACE[:, None] + rotation @ arm.T
            ground = bed + SLOPE.slope_x * x + SLOPE.slope_y * y
            pressure = SPECIFIC_WEIGHT * np.where(z > ground, np.maximum(LEVEL - z, 0.0), 0.0)
            force = np.zeros((n * n, 3))
            force[:, axis] = -side * pressure * SIZE[others[0]] * SIZE[others[1]] / n**2
            wrench += np.concatenate([force.sum(axis=0), np.cross(arm, force).sum(axis=0)])
    return wrench


def volumes(rotation, bed, n=120):
    """Volume below the level, and the part of it above the bed [m^3]."""
    points = np.stack(np.meshgrid(*(midpoints(n) * size for size in SIZE), indexing="ij"), axis=-1).reshape(-1, 3)
    x, y, z = PLACE[:, None] + rotation @ points.T
    wet, above = z < LEVEL, z > bed + SLOPE.slope_x * x + SLOPE.slope_y * y
    return wet.mean() * SIZE.prod(), (wet & above).mean() * SIZE.prod()


@pytest.mark.parametrize("turn", TURNS)
@pytest.mark.parametrize("bed", BEDS)
def test_pressure_acts_on_what_is_above_the_bed(bed, turn):
    """Without pore pressure: forces to 0.3 % of the box's buoyancy, moments to as much times its half length."""
    terrain = Terrain(height=BEDS[bed], slope_x=SLOPE.slope_x, slope_y=SLOPE.slope_y)
    rotation = TURNS[turn]
    arguments = box_surface(*SIZE), rotation, PLACE, LEVEL, 1000.0
    found = hydrostatic_wrench(*arguments, pore_pressure=False, terrain=terrain)
    scale = 3e-3 * SPECIFIC_WEIGHT * SIZE.prod()
    expected = pressure_wrench(rotation, BEDS[bed])
    np.testing.assert_allclose(found[:3], expected[:3], atol=scale)
    np.testing.assert_allclose(found[3:], expected[3:], atol=0.5 * scale)
    assert (np.abs(found).max() == 0.0) == (bed == "on dry land")


@pytest.mark.parametrize("turn", TURNS)
@pytest.mark.parametrize("bed", BEDS)
def test_volumes_between_bed_and_level(bed, turn):
    """0.5 % of the box; the whole of the buoyancy is that of the submerged volume."""
    terrain = Terrain(height=BEDS[bed], slope_x=SLOPE.slope_x, slope_y=SLOPE.slope_y)
    wet = wetted(box_surface(*SIZE), TURNS[turn], PLACE, LEVEL, terrain)
    expected = volumes(TURNS[turn], BEDS[bed])
    assert (wet.submerged_volume, wet.exposed_volume) == pytest.approx(expected, abs=5e-3 * SIZE.prod())


@pytest.mark.parametrize("turn", TURNS)
@pytest.mark.parametrize("bed", BEDS)
def test_with_pore_pressure_the_bed_does_not_matter(bed, turn):
    """Force straight up, of the displaced weight, whatever the bed: 1e-10 of it."""
    terrain = Terrain(height=BEDS[bed], slope_x=SLOPE.slope_x, slope_y=SLOPE.slope_y)
    arguments = box_surface(*SIZE), TURNS[turn], PLACE, LEVEL, 1000.0
    wrench = hydrostatic_wrench(*arguments, terrain=terrain)
    lift = SPECIFIC_WEIGHT * wetted(*arguments[:4]).submerged_volume
    np.testing.assert_allclose(TURNS[turn] @ wrench[:3], [0.0, 0.0, lift], atol=1e-10 * lift)
    np.testing.assert_allclose(wrench, hydrostatic_wrench(*arguments), atol=1e-10 * lift)


def test_a_hull_on_a_bank_of_a_field_of_heights():
    """The hull's strips see a bank whose slope changes below the hull; midpoint sums over its bottom to 3 %."""
    vehicle = load_vehicle(Path(__file__).parents[2] / "vehicle_models" / "amphibious.py")
    surface = hull_surface(vehicle)
    x = np.arange(-2.0, 2.01, 0.1)
    terrain = Terrain(heights=np.tile(np.interp(x, [-2.0, -0.2, 2.0], [0.2, 0.2, -0.13]), (3, 1)), origin=(-2.0, -1.0),
                      spacing=(0.1, 1.0))  # fmt: skip
    place, level = np.array([0.1, 0.0, 0.2]), 0.25
    found = hydrostatic_wrench(surface, np.eye(3), place, level, pore_pressure=False, terrain=terrain)
    lift, pitch = 0.0, 0.0
    for triangle in surface.triangles:  # cut into 400 small ones each
        a, b, c = triangle
        normal = 0.5 * np.cross(b - a, c - a)
        grid = [(i, j) for i in range(20) for j in range(20 - i)]
        middles = [(i + 1 / 3, j + 1 / 3) for i, j in grid] + [(i + 2 / 3, j + 2 / 3) for i, j in grid if i + j < 19]
        points = a + np.array(middles) / 20.0 @ np.stack([b - a, c - a])
        if points[:, 2].min() + place[2] > level:
            continue
        z = points[:, 2] + place[2]
        ground = np.array([terrain.height_and_normal(p[0] + place[0], p[1])[0] for p in points])
        force = SPECIFIC_WEIGHT * np.where(z > ground, np.maximum(level - z, 0.0), 0.0)[:, None] * -normal / 400.0
        lift += force[:, 2].sum()
        pitch += np.cross(points, force)[:, 1].sum()
    assert found[2] == pytest.approx(lift, rel=0.03)
    assert found[4] == pytest.approx(pitch, rel=0.03)
    whole = hydrostatic_wrench(surface, np.eye(3), place, level)[2]
    assert 0.1 * whole < lift < 0.5 * whole
