"""Hydrostatics against Archimedes: exact bodies, righting moments, floating and grounded equilibria (1 %)."""

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq, root
from scipy.spatial.transform import Rotation

from exumob.support.constants import GRAVITY
from exumob.vehicle.vehicle_file import load_vehicle
from exumob.water.hydrostatics import hydrostatic_wrench, wetted
from exumob.water.wetted_surface import (
    Surface,
    body_surfaces,
    box_surface,
    cylinder_surface,
    hull_surface,
    wheel_surface,
)

DENSITY = 1000.0
LENGTH, WIDTH, HEIGHT = 1.0, 0.44, 0.2


@pytest.fixture(scope="module")
def vehicle():
    return load_vehicle(Path(__file__).parents[2] / "vehicle_models" / "amphibious.py")


def turn(axis, angle):
    return Rotation.from_euler(axis, angle).as_matrix()


def clipped(polygon, normal, offset):
    """Part of a polygon with normal . p <= offset."""
    kept = []
    for p, q in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        here, there = normal @ p - offset, normal @ q - offset
        if here <= 0.0:
            kept.append(p)
        if here * there < 0.0:
            kept.append(p + here / (here - there) * (q - p))
    return np.array(kept)


def area_and_centroid(polygon):
    after = np.roll(polygon, -1, axis=0)
    cross = polygon[:, 0] * after[:, 1] - polygon[:, 1] * after[:, 0]
    area = 0.5 * cross.sum()
    return area, ((polygon + after) * cross[:, None]).sum(axis=0) / (6.0 * area)


def segment(radius, depth):
    """Area of a disk below a chord at `depth` above its lowest point."""
    rise = radius - depth
    return radius**2 * math.acos(rise / radius) - rise * math.sqrt(radius**2 - rise**2)


def test_surfaces_are_closed_and_have_the_exact_volume(vehicle):
    hull = vehicle.hull
    rake = 0.5 * hull.bow_length * hull.bow_height
    assert hull_surface(vehicle).volume == pytest.approx(hull.width * (hull.length * hull.height - rake), rel=1e-12)
    assert wheel_surface(vehicle).volume == pytest.approx(math.pi * 0.1**2 * 0.08, rel=1e-12)
    for surface in (*body_surfaces(vehicle)[:2], box_surface(1.0, 2.0, 3.0, (0.1, 0.2, 0.3))):
        a, b, c = surface.triangles[:, 0], surface.triangles[:, 1], surface.triangles[:, 2]
        np.testing.assert_allclose(np.cross(b - a, c - a).sum(axis=0), 0.0, atol=1e-13)


def test_upright_box_feels_its_displaced_water():
    box = box_surface(LENGTH, WIDTH, HEIGHT)
    wrench = hydrostatic_wrench(box, np.eye(3), [3.0, -2.0, 1.05], 1.0, DENSITY)
    np.testing.assert_allclose(wrench, [0, 0, DENSITY * GRAVITY * LENGTH * WIDTH * 0.05, 0, 0, 0], atol=1e-10)
    wet = wetted(box, np.eye(3), [0.0, 0.0, 1.05], 1.0)
    assert wet.draught == pytest.approx(0.05)
    assert wet.wetted_area == pytest.approx(LENGTH * WIDTH + 2 * 0.05 * (LENGTH + WIDTH))
    np.testing.assert_allclose(wet.projected_area, [WIDTH * 0.05, LENGTH * 0.05, 0.5 * LENGTH * WIDTH])


@pytest.mark.parametrize("angle", [0.02, 0.3, 0.8, 1.4, 2.5, -0.5])
def test_heeled_box_is_exact(angle):
    """Against area and centroid of the submerged section (shoelace formula); 1e-10."""
    corners = 0.5 * np.array([[-WIDTH, -HEIGHT], [WIDTH, -HEIGHT], [WIDTH, HEIGHT], [-WIDTH, HEIGHT]])
    cos, sin = math.cos(angle), math.sin(angle)
    for height in (-0.06, 0.0, 0.05):
        area, centroid = area_and_centroid(clipped(corners, np.array([sin, cos]), -height))
        lift = DENSITY * GRAVITY * LENGTH * area
        up = np.array([0.0, sin, cos])
        expected = np.concatenate([lift * up, np.cross([0.0, *centroid], lift * up)])
        wrench = hydrostatic_wrench(
            box_surface(LENGTH, WIDTH, HEIGHT), turn("x", angle), [0, 0, 1 + height], 1.0, DENSITY
        )
        np.testing.assert_allclose(wrench, expected, atol=1e-10 * lift)


def test_box_in_any_attitude_against_columns():
    """Against the volume summed over 400 x 400 columns of the box; 1e-3 of the weight of the full volume."""
    x, y = np.meshgrid(
        (np.arange(400) + 0.5) / 400 * LENGTH - LENGTH / 2, (np.arange(400) + 0.5) / 400 * WIDTH - WIDTH / 2
    )
    cell = LENGTH * WIDTH / 160000
    full = DENSITY * GRAVITY * LENGTH * WIDTH * HEIGHT
    for seed in range(5):
        rotation = Rotation.random(rng=np.random.default_rng(seed)).as_matrix()
        up = rotation[2]
        cut = (0.03 - up[0] * x - up[1] * y) / up[2]  # water plane in body axes
        if up[2] > 0.0:
            low, high = np.full_like(cut, -HEIGHT / 2), np.clip(cut, -HEIGHT / 2, HEIGHT / 2)
        else:
            low, high = np.clip(cut, -HEIGHT / 2, HEIGHT / 2), np.full_like(cut, HEIGHT / 2)
        volumes = (high - low) * cell
        first = np.array([(volumes * x).sum(), (volumes * y).sum(), (volumes * 0.5 * (low + high)).sum()])
        expected = DENSITY * GRAVITY * np.concatenate([volumes.sum() * up, np.cross(first, up)])
        wrench = hydrostatic_wrench(box_surface(LENGTH, WIDTH, HEIGHT), rotation, [0, 0, 0.97], 1.0, DENSITY)
        np.testing.assert_allclose(wrench, expected, atol=1e-3 * full)


@pytest.mark.parametrize(("axis", "breadth"), [("x", WIDTH), ("y", LENGTH)])
def test_righting_moment_is_metacentric(axis, breadth):
    """GM = KB + BM - KG with BM = I / V = breadth^2 / (12 draught); heel 0.5 degrees, 0.1 %."""
    draught, center_of_mass = 0.06, 0.09
    box = box_surface(LENGTH, WIDTH, HEIGHT, (0.0, 0.0, 0.5 * HEIGHT - center_of_mass))
    metacentric_height = 0.5 * draught + breadth**2 / (12.0 * draught) - center_of_mass
    angle = math.radians(0.5)
    rotation = turn(axis, angle)
    lift = DENSITY * GRAVITY * LENGTH * WIDTH * draught

    def surplus(height):
        return (rotation @ hydrostatic_wrench(box, rotation, [0, 0, height], 1.0, DENSITY)[:3])[2] - lift

    height = brentq(surplus, 0.9, 1.1, xtol=1e-14)
    moment = hydrostatic_wrench(box, rotation, [0, 0, height], 1.0, DENSITY)[3 if axis == "x" else 4]
    assert moment == pytest.approx(-lift * metacentric_height * math.sin(angle), rel=1e-3)


def test_full_immersion_lifts_at_the_centroid(vehicle):
    """Any attitude: no horizontal force, moment = centroid x lift."""
    for seed, surface in enumerate(body_surfaces(vehicle)[:2]):
        rotation = Rotation.random(rng=np.random.default_rng(seed)).as_matrix()
        wrench = hydrostatic_wrench(surface, rotation, [0.0, 0.0, 2.0], 4.0, DENSITY)
        lift = DENSITY * GRAVITY * surface.volume * rotation[2]
        np.testing.assert_allclose(wrench[:3], lift, atol=1e-9 * np.linalg.norm(lift))
        np.testing.assert_allclose(wrench[3:], np.cross(surface.centroid, lift), atol=1e-9 * np.linalg.norm(lift))


def test_floating_hull_meets_archimedes(vehicle):
    """Free equilibrium in heave and trim: displaced mass and centre of buoyancy from the profile's polygon; 1 %."""
    hull, surface = vehicle.hull, hull_surface(vehicle)

    def balance(unknowns):
        height, trim = unknowns
        rotation = turn("y", trim)
        wrench = hydrostatic_wrench(surface, rotation, [0, 0, 1.0 + height], 1.0, DENSITY)
        return (rotation @ wrench[:3])[2] / (hull.mass * GRAVITY) - 1.0, wrench[4]

    solution = root(balance, [0.0, 0.0], tol=1e-12)
    assert solution.success
    height, trim = solution.x
    keel, deck = hull.ground_clearance - 0.17, hull.ground_clearance - 0.17 + hull.height
    profile = np.array([[-0.5, keel], [0.38, keel], [0.5, keel + 0.12], [0.5, deck], [-0.5, deck]])
    area, centroid = area_and_centroid(clipped(profile, np.array([-math.sin(trim), math.cos(trim)]), -height))
    assert DENSITY * area * hull.width == pytest.approx(hull.mass, rel=1e-2)
    along = math.cos(trim) * centroid[0] + math.sin(trim) * centroid[1]  # horizontal lever of the lift
    assert abs(along) < 1e-3  # [m]
    assert trim > 0.0  # bow down: the rake takes buoyancy from it
    assert 0.10 < wetted(surface, turn("y", trim), [0, 0, 1 + height], 1.0).draught < 0.15


def test_grounded_vehicle_is_relieved_by_archimedes(vehicle):
    """Standing at ride height in 60 % of the tyre diameter: hull prism and wheel segments; 1 %."""
    depth, radius = 0.12, vehicle.wheel.radius
    draught = depth - vehicle.hull.ground_clearance
    hull_volume = vehicle.hull.width * (draught * (vehicle.hull.length - vehicle.hull.bow_length) + 0.5 * draught**2)
    wheel_volume = vehicle.wheel.width * segment(radius, depth)
    origins = [vehicle.hull_origin, *vehicle.wheel_centers]
    wrenches = [
        hydrostatic_wrench(surface, np.eye(3), origin, depth, DENSITY)
        for surface, origin in zip(body_surfaces(vehicle), origins, strict=True)
    ]
    assert wrenches[0][2] == pytest.approx(DENSITY * GRAVITY * hull_volume, rel=1e-2)
    for wrench in wrenches[1:]:
        assert wrench[2] == pytest.approx(DENSITY * GRAVITY * wheel_volume, rel=1e-2)
    buoyed = sum(wrench[2] for wrench in wrenches) / (vehicle.mass * GRAVITY)
    assert 0.3 < buoyed < 0.5


@pytest.mark.parametrize("center", [0.08, 0.06])
def test_sunk_wheel(vehicle, center):
    """Archimedes for the whole wheel with pore pressure; without it the pressure on the cut is missing; 1 %."""
    depth, radius, width = 0.12, vehicle.wheel.radius, vehicle.wheel.width
    surface, sinkage = wheel_surface(vehicle), radius - center
    under_water, under_soil = width * segment(radius, depth + sinkage), width * segment(radius, sinkage)
    cut = 2.0 * math.sqrt(radius**2 - center**2) * width
    whole = hydrostatic_wrench(surface, np.eye(3), [0, 0, center], depth, DENSITY)
    assert whole[2] == pytest.approx(DENSITY * GRAVITY * under_water, rel=1e-2)
    dry_sole = hydrostatic_wrench(surface, np.eye(3), [0, 0, center], depth, DENSITY, pore_pressure=False)
    scale = DENSITY * GRAVITY * cut * depth
    assert dry_sole[2] == pytest.approx(DENSITY * GRAVITY * (under_water - under_soil - cut * depth), abs=1e-2 * scale)
    wet = wetted(surface, np.eye(3), [0, 0, center], depth)
    assert wet.submerged_volume == pytest.approx(under_water, rel=1e-2)
    assert wet.exposed_volume == pytest.approx(under_water - under_soil, rel=1e-2)
    assert wet.draught == pytest.approx(depth)


def test_box_sunk_into_the_soil_is_exact():
    """Sides reach 3 cm below the soil, water 10 cm deep: the whole draught lifts, or only the sides are pressed."""
    box = box_surface(LENGTH, WIDTH, HEIGHT)
    lift = DENSITY * GRAVITY * LENGTH * WIDTH * 0.13
    arguments = (box, np.eye(3), [0.0, 0.0, 0.07], 0.1, DENSITY)
    np.testing.assert_allclose(hydrostatic_wrench(*arguments), [0, 0, lift, 0, 0, 0], atol=1e-10)
    np.testing.assert_allclose(hydrostatic_wrench(*arguments, pore_pressure=False), 0.0, atol=1e-10)


def test_dry_body_feels_nothing(vehicle):
    for surface in body_surfaces(vehicle)[:2]:
        np.testing.assert_array_equal(hydrostatic_wrench(surface, np.eye(3), [0, 0, 1.0], 0.1), 0.0)


def test_faceted_wheel_lifts_like_a_cylinder():
    """Any immersion and any turn of the facets: 0.1 % of the exact segment."""
    surface = cylinder_surface(0.1, 0.08)
    for immersion in (0.02, 0.06, 0.1, 0.16):
        exact = DENSITY * GRAVITY * 0.08 * segment(0.1, immersion)
        for angle in np.linspace(0.0, 0.3, 7):
            wrench = hydrostatic_wrench(surface, turn("y", angle), [0, 0, 1.1 - immersion], 1.0, DENSITY)
            assert np.linalg.norm(wrench[:3]) == pytest.approx(exact, rel=1e-3)


def test_mesh_hull_equals_the_box_hull(vehicle, tmp_path):
    trimesh = pytest.importorskip("trimesh")
    design = hull_surface(vehicle).triangles + vehicle.hull_origin
    mesh = trimesh.Trimesh(design.reshape(-1, 3), np.arange(3 * len(design)).reshape(-1, 3))
    # the strips' cuts leave hanging corners: take the convex hull of the same corners
    file = tmp_path / "hull.stl"
    mesh.convex_hull.export(file)
    meshed = dataclasses.replace(vehicle, hull=dataclasses.replace(vehicle.hull, mesh=file))
    rotation = Rotation.from_euler("xyz", [0.1, 0.05, 0.3]).as_matrix()
    expected = hydrostatic_wrench(hull_surface(vehicle), rotation, [0, 0, 0.15], 0.12)
    actual = hydrostatic_wrench(hull_surface(meshed), rotation, [0, 0, 0.15], 0.12)
    np.testing.assert_allclose(actual, expected, atol=1e-4)  # STL holds single precision


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"position": np.ma.masked_greater([0.0, 0.0, 1.0], 0.5)}, "position: 1 of 3 values is masked"),
        ({"position": [0.0, math.nan, 1.0]}, "position: 1 of 3 values is not finite"),
        ({"position": [0.0, 1.0]}, r"position has shape \(2,\)"),
        ({"rotation": np.eye(2)}, r"rotation has shape \(2, 2\)"),
        ({"rotation": 2.0 * np.eye(3)}, "rotation is no rotation matrix"),
        ({"rotation": np.diag([1.0, 1.0, -1.0])}, "rotation is no rotation matrix"),
        ({"level": math.inf}, "level = inf is not a finite number"),
        ({"density": 1.0}, "density = 1.0 kg/m.3 is outside the plausible range"),
        ({"surface": None}, "surface = None"),
    ],
)
def test_bad_input_is_named(changes, message):
    arguments = {"surface": box_surface(1.0, 1.0, 1.0), "rotation": np.eye(3), "position": [0, 0, 1], "level": 1.0}
    with pytest.raises(ValueError, match=message):
        hydrostatic_wrench(**(arguments | changes))


def test_bad_surfaces_are_named():
    triangles = box_surface(1.0, 1.0, 1.0).triangles
    with pytest.raises(ValueError, match=r"Surface\.cells has shape \(3,\)"):
        Surface(triangles, np.zeros(3, np.int64))
    with pytest.raises(ValueError, match=r"from 0 to n_cells - 1 = 0"):
        Surface(triangles, np.ones(len(triangles), np.int64))
    with pytest.raises(ValueError, match=r"Surface\.triangles: 1 of 108 values is masked"):
        Surface(np.ma.array(triangles, mask=np.arange(108).reshape(12, 3, 3) == 5), np.zeros(12, np.int64))
    with pytest.raises(ValueError, match=r"length = -1\.0 m must be > 0"):
        box_surface(-1.0, 1.0, 1.0)
