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
    pytest.importorskip("trimesh")
    mesh = mesh_solid(box_surface(0.3, 0.2, 0.1).triangles, spacing=0.01)
    points = np.random.default_rng(3).uniform(-0.2, 0.2, (200, 3)) * [1.0, 0.7, 0.5]
    exact = box(0.3, 0.2, 0.1).distance(points)
    assert np.abs(mesh.distance(points) - exact).max() < 0.005
