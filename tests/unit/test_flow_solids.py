"""Solids of the flow solver: distances, meshes, bad input."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from exumob.flow import box, cylinder, hull_prism, mesh_solid, sphere
from exumob.flow.placement import _bounds
from exumob.flow.solids import PRISM, SAMPLED, vehicle_solids
from exumob.support.rotations import about_y
from exumob.vehicle.body import arch_of
from exumob.vehicle.parameters import Hull
from exumob.water.mesh_lines import signed_distances
from exumob.water.wetted_surface import box_surface, hull_triangles
from vehicle_models.amphibious import amphibious_vehicle
from vehicle_models.small_car import small_car

HULL = Hull(
    mass=49.0, length=1.0, width=0.44, height=0.2, ground_clearance=0.078, center_of_mass_height=0.17, bow_length=0.12,
    bow_height=0.12,
)  # fmt: skip


def test_distances_to_shapes():
    assert sphere(0.1).distance(np.array([[0.3, 0.0, 0.0], [0.0, 0.0, 0.0]])) == pytest.approx([0.2, -0.1])
    assert box(2.0, 1.0, 0.4).distance(np.array([[1.3, 0.9, 0.2], [0.0, 0.0, 0.1]])) == pytest.approx([0.5, -0.1])
    wheel = cylinder(0.1, 0.08, 0.01)
    assert wheel.distance(np.array([[0.0, 0.0, 0.15], [0.0, 0.06, 0.0]])) == pytest.approx([0.05, 0.02])
    corner = np.array([[0.1, 0.04, 0.0]])  # the rounding takes (sqrt 2 - 1) r off the corner
    assert wheel.distance(corner) == pytest.approx([(math.sqrt(2.0) - 1.0) * 0.01])
    hull = hull_prism(HULL)
    points = np.array([[0.0, 0.0, -0.092], [0.44, 0.0, -0.032], [0.0, 0.25, 0.0], [0.6, 0.0, 0.05]])
    assert hull.distance(points) == pytest.approx([0.0, 0.0, 0.03, 0.1], abs=1e-9)


def test_mesh_of_a_box_is_the_box():
    mesh = mesh_solid(box_surface(0.3, 0.2, 0.1).triangles, spacing=0.01)
    points = np.random.default_rng(3).uniform(-0.2, 0.2, (200, 3)) * [1.0, 0.7, 0.5]
    exact = box(0.3, 0.2, 0.1).distance(points)
    assert np.abs(mesh.distance(points) - exact).max() < 0.005


def test_mesh_of_many_triangles_has_the_distances_of_its_shape():
    """A ball of 1,280 triangles: flat faces lie up to 0.3 % of the radius inside it."""
    trimesh = pytest.importorskip("trimesh")
    ball = mesh_solid(trimesh.creation.icosphere(3, 0.2).triangles, spacing=0.02)
    points = np.random.default_rng(4).uniform(-0.25, 0.25, (300, 3))
    exact = np.linalg.norm(points, axis=1) - 0.2
    away = exact > -0.12  # at the centre the distance has a kink
    assert np.abs(ball.distance(points) - exact)[away].max() < 0.002
    assert ((ball.distance(points) < 0.0) == (exact < 0.0))[np.abs(exact) > 0.002].all()


def test_an_unsound_mesh_is_refused():
    triangles = box_surface(0.3, 0.2, 0.1).triangles
    with pytest.raises(ValueError, match="mesh_solid is not watertight"):
        mesh_solid(triangles[1:], spacing=0.01)
    with pytest.raises(ValueError, match="mesh_solid consists of 2 closed bodies"):
        mesh_solid(np.concatenate([triangles, triangles + 0.05]), spacing=0.01)


def test_a_hull_with_arches_is_a_solid_with_room_for_its_wheels():
    """Sampled at half a cell: within a sample's diagonal of the closed surface, and open where the tyres are."""
    vehicle = small_car()
    cell = 0.08
    hull, wheel, *_ = vehicle_solids(vehicle, cell)
    assert hull.shape.kind == SAMPLED and wheel.shape.kind != SAMPLED
    low, high = (end - vehicle.hull_origin for end in vehicle.hull.extent)
    assert hull.low == pytest.approx(low) and hull.high == pytest.approx(high)
    for center, axle in zip(vehicle.wheel_centers, np.repeat([0, 1], 2), strict=True):
        arch = arch_of(vehicle.hull.wheel_arches, vehicle.axles[axle])
        side = math.copysign(1.0, center[1])
        wall = np.array([center[0], side * arch.inner, 0.35])
        aside = np.array([0.0, 0.1 * side, 0.0])
        places = np.array([center, wall + aside, wall - aside]) - vehicle.hull_origin
        at_center, in_arch, in_body = hull.distance(places)
        assert at_center > 0.08 and in_arch == pytest.approx(0.1, abs=cell) and in_body == pytest.approx(-0.1, abs=cell)
    rng = np.random.default_rng(2)
    points = rng.uniform(low - 0.1, high + 0.1, (400, 3))
    found = hull.distance(points)
    exact = signed_distances_at(hull_triangles(vehicle), points)
    assert np.abs(found - exact)[np.abs(exact) < 0.3].max() < 0.5 * cell


def signed_distances_at(triangles, points):
    return np.array([float(signed_distances(triangles, *(np.array([c]) for c in p))[0, 0, 0]) for p in points])


def test_a_plain_hull_stays_a_prism():
    assert vehicle_solids(amphibious_vehicle(), 0.02)[0].shape.kind == PRISM


@pytest.mark.parametrize(
    "solid", [sphere(0.3), cylinder(0.36, 0.2), box(0.9, 0.4, 0.2)], ids=["sphere", "cylinder", "box"]
)
def test_extents_are_those_of_the_turned_solid(solid):
    """Of a wheel that pitches they stay; those of its box would grow, and let it seem to sink into the bed."""
    rng = np.random.default_rng(4)
    points = rng.uniform(solid.low, solid.high, (200_000, 3))
    inside = points[solid.distance(points) < 0.0]
    for rotation in Rotation.random(5, random_state=2).as_matrix():
        center, extent = _bounds(solid, np.array([1.0, 2.0, 3.0]), rotation)
        reach = np.abs(inside @ rotation.T).max(axis=0)
        assert (reach <= extent + 1e-12).all() and (reach > 0.8 * extent).all()
        assert center == pytest.approx([1.0, 2.0, 3.0])
    wheel = cylinder(0.36, 0.2)
    for pitch in (0.0, 0.2, 0.8):
        assert _bounds(wheel, np.zeros(3), about_y(pitch))[1] == pytest.approx([0.36, 0.1, 0.36])
