"""Solids of the flow solver: distances, meshes, bad input."""

import math

import numpy as np
import pytest

from exumob.flow import box, cylinder, hull_prism, mesh_solid, sphere
from exumob.vehicle.parameters import Hull
from exumob.water.wetted_surface import box_surface

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
