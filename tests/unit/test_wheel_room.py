"""Wheels on all their ways: where suspension and steering take them, and that they never enter the body."""

import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import fsolve
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from exumob.support.rotations import about_z
from exumob.vehicle.body import arch_of
from exumob.vehicle.hull import WheelArches
from exumob.vehicle.parameters import least_wheel_gap
from exumob.vehicle.vehicle_file import load_vehicle
from exumob.vehicle.wheel_motion import Axle, pose_grid, reach_of, rim_points, tyre_poses
from exumob.vehicle.wheel_room import least_gap, wheels_clear
from exumob.water.wetted_surface import hull_triangles
from vehicle_models.amphibious import amphibious_vehicle
from vehicle_models.light_4x4 import light_4x4

FILES = sorted(path for path in (Path(__file__).parents[2] / "vehicle_models").glob("*.py") if path.stem != "__init__")
AMPHIBIOUS, TRUCK = amphibious_vehicle(), light_4x4()


# -- motion ------------------------------------------------------------------------------------------------------------


def rods_solved(arms, angle, travel):
    """Wheel centre and axle direction from the lengths of the four rods, as `exumob.multibody.assembly` makes them."""
    balls = [np.array([0.0, -arms.ball_joint_inset, z]) for z in (arms.upper_height, -arms.lower_height)]
    rods = []
    for ball, length, drop in zip(
        balls, (arms.upper_length, arms.lower_length), (arms.upper_pivot_drop, 0.0), strict=True
    ):
        for x in (-0.5 * arms.pivot_spread, 0.5 * arms.pivot_spread):
            pivot = ball + np.array([x, -math.sqrt(length**2 - drop**2), -drop])
            rods.append((ball, pivot, math.hypot(length, x)))

    def errors(unknown):
        place, rotation = unknown[:3], Rotation.from_rotvec(unknown[3:]).as_matrix()
        lengths = [np.linalg.norm(place + rotation @ ball - pivot) - length for ball, pivot, length in rods]
        return [*lengths, math.atan2(rotation[1, 0], rotation[0, 0]) - angle, place[2] - travel]

    found, _, fine, _ = fsolve(errors, [0.0, 0.0, travel, 0.0, 0.0, angle], full_output=True, xtol=1e-12)
    assert fine == 1
    return found[:3], Rotation.from_rotvec(found[3:]).as_matrix()[:, 1]


@pytest.mark.parametrize("travel", [-0.09, -0.03, 0.0, 0.05, 0.09])
@pytest.mark.parametrize("angle", [-0.48, 0.0, 0.2, 0.65])
def test_wishbones_guide_the_wheel_as_the_rods_do(angle, travel):
    front, _ = TRUCK.axles
    centers, axes = tyre_poses(front, np.array([angle]), np.array([travel]))
    place, axle = rods_solved(TRUCK.suspension.wishbones, angle, travel)
    assert centers[0] == pytest.approx(place, abs=2e-4)
    assert axes[0] == pytest.approx(axle, abs=2e-3)


def test_a_pillar_takes_the_wheel_straight_up():
    front, rear = AMPHIBIOUS.axles
    centers, axes = tyre_poses(front, np.array([0.3, -0.2]), np.array([0.02, -0.01]))
    assert centers == pytest.approx(np.array([[0.0, 0.0, 0.02], [0.0, 0.0, -0.01]]))
    assert axes == pytest.approx(np.array([about_z(0.3)[:, 1], about_z(-0.2)[:, 1]]))
    assert (rear.least_angle, rear.greatest_angle) == (0.0, 0.0)
    assert (front.least_angle, front.greatest_angle) == pytest.approx((-math.radians(35.0), math.radians(35.0)))


def test_axles_steer_as_the_vehicle_does():
    """Left wheel: more to the inside; the right wheel's range is mirrored."""
    front, _ = TRUCK.axles
    left, right = (a[0] for a in TRUCK.steering_angles((TRUCK.steering.limit, 0.0, 0.0)))
    assert (front.least_angle, front.greatest_angle) == pytest.approx((-right, left))


@pytest.mark.parametrize("vehicle", [AMPHIBIOUS, TRUCK], ids=lambda v: v.name)
def test_reach_is_that_of_the_outline(vehicle):
    for axle in vehicle.axles:
        points = rim_points(axle, *tyre_poses(axle, *pose_grid(axle)), 360).reshape(-1, 3)
        reach = reach_of(axle)
        found = (-points[:, 1].min(), np.abs(points[:, 0]).max(), points[:, 2].max(), -points[:, 2].min())
        assert reach == pytest.approx(found, abs=1e-3 * axle.radius)


# -- room --------------------------------------------------------------------------------------------------------------


def tyre_points(vehicle, wheel, steering, travels, spacing):
    """Points on a tyre's tread and both its sides at all poses, design frame, by the vehicle's own angles."""
    radius, half, side = vehicle.wheel.radius, 0.5 * vehicle.wheel.width, 1.0 if wheel % 2 == 0 else -1.0
    axle = vehicle.axles[wheel // 2]
    turn = np.linspace(0.0, 2.0 * math.pi, math.ceil(2.0 * math.pi * radius / spacing), endpoint=False)
    ring = np.stack([np.cos(turn), np.zeros(len(turn)), np.sin(turn)], axis=1)
    across = np.linspace(-half, half, 1 + math.ceil(2.0 * half / spacing))
    local = [radius * ring + [0.0, y, 0.0] for y in across]
    local += [r * ring + [0.0, y, 0.0] for r in np.linspace(0.0, radius, 8)[:-1] for y in (-half, half)]
    local = np.concatenate(local)
    found = []
    for command in steering if wheel < 2 else [0.0]:
        angle = vehicle.steering_angles((command, 0.0, 0.0))[wheel % 2][0] if wheel < 2 else 0.0
        for travel in travels(vehicle.axle_suspensions[wheel // 2]):
            if axle.wishbones is None:
                place, lean = np.array([0.0, 0.0, travel]), np.eye(3)
            else:
                place, direction = rods_solved(axle.wishbones, side * angle, travel)
                camber = math.asin(direction[2] / math.hypot(direction[1], direction[2]))
                place = place * [1.0, side, 1.0]
                s, c = math.sin(side * camber), math.cos(camber)
                lean = np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
            found.append(local @ (lean @ about_z(angle)).T + place + vehicle.wheel_centers[wheel])
    return np.concatenate(found)


def surface_points(triangles, spacing):
    """Points on triangles, `spacing` apart."""
    found = []
    for a, b, c in triangles:
        u, v = (np.linspace(0.0, 1.0, 2 + int(np.linalg.norm(edge) / spacing)) for edge in (b - a, c - a))
        inside = u[:, None] + v <= 1.0 + 1e-9
        found.append((a + u[:, None, None] * (b - a) + v[None, :, None] * (c - a))[inside])
    return np.concatenate(found)


def enclosed(vehicle, points):
    """Whether points are in the body, by its definition: in one of the boxes, and in no arch."""
    x, y, z = points.T
    inside = np.zeros(len(points), bool)
    for part in vehicle.hull.parts:
        inside |= within(part.side_profile(), x, z) & (np.abs(y) < 0.5 * part.width)
    if vehicle.hull.wheel_arches is not None:
        for axle in vehicle.axles:
            arch = arch_of(vehicle.hull.wheel_arches, axle)
            outline = np.maximum(np.array(arch.outline), [-np.inf, -1.0])[::-1]
            inside &= ~(within(outline, x, z) & (np.abs(y) > arch.inner))
    return inside


def within(outline, x, z):
    edges = zip(outline, np.roll(outline, -1, axis=0), strict=True)
    return np.all([(b[0] - a[0]) * (z - a[1]) >= (b[1] - a[1]) * (x - a[0]) for a, b in edges], axis=0)


@pytest.mark.parametrize("file", FILES, ids=lambda path: path.stem)
def test_no_wheel_of_a_shipped_vehicle_ever_touches_its_body(file):
    """By brute force: points of all four tyres at all angles and travels against points of the body's surface."""
    vehicle = load_vehicle(file)
    spacing = vehicle.wheel.radius / 8.0
    body = hull_triangles(vehicle) + vehicle.hull_origin
    near = surface_points(body, 0.5 * spacing)
    tree = cKDTree(near[near[:, 2] < 1.6 * vehicle.wheel.diameter])
    steering = np.linspace(-1.0, 1.0, 9) * vehicle.steering.limit
    nearest = []
    for wheel in range(4):
        points = tyre_points(
            vehicle, wheel, steering, lambda s: np.linspace(-s.rebound_travel, s.bump_travel, 5), spacing
        )
        nearest.append(float(tree.query(points, distance_upper_bound=vehicle.wheel.radius)[0].min()))
        assert not enclosed(vehicle, points).any()
    gap = least_wheel_gap(vehicle)
    assert min(nearest) > 0.01 * vehicle.wheel.diameter
    assert gap.gap == pytest.approx(min(nearest), abs=0.25 * spacing)
    assert nearest[0] == pytest.approx(nearest[1], abs=0.25 * spacing)  # left and right


def test_gap_of_a_box_is_the_formula():
    """A tyre steered beside a flat side: its lower and upper edges lead."""
    angle = math.radians(35.0)
    found = least_wheel_gap(AMPHIBIOUS)
    inward = 0.1 * math.sin(angle) + 0.04 * math.cos(angle)
    assert found.gap == pytest.approx(0.33 - 0.22 - inward, abs=1e-4)
    assert abs(found.angle) == pytest.approx(angle) and found.axle == 0
    assert "front left tyre steered" in str(found) and "35.0 deg" in str(found)
    high = replace(
        AMPHIBIOUS, hull=replace(AMPHIBIOUS.hull, width=0.6, ground_clearance=0.225, center_of_mass_height=0.25)
    )
    found = least_wheel_gap(high)  # the body over the wheels
    assert (found.gap, found.travel) == pytest.approx((0.005, 0.02), abs=1e-4)


def arched(vehicle=TRUCK, **values):
    return replace(vehicle, hull=replace(vehicle.hull, wheel_arches=WheelArches(**values)))


@pytest.mark.parametrize("values", [{}, {"clearance": 0.02}, {"corners": 2}, {"clearance": 0.05, "corners": 12}])
def test_default_arches_leave_what_they_say(values):
    gap = least_wheel_gap(arched(**values))
    assert gap.gap == pytest.approx(values.get("clearance", 0.05 * 0.72), abs=1.5e-3)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"inboard": 0.12}, r"Hull\.wheel_arches: light 4x4 .*front left tyre steered [+-]\d+\.\d deg, .* mm deep.*"
                            r"Give it larger wheel arches.*Steering\.limit = 32 deg"),
        ({"above": 0.06}, r"(front|rear) left tyre.* mm up, at .* mm deep"),
        ({"ahead": 0.005}, r"front left tyre steered"),
    ],
)  # fmt: skip
def test_arches_that_are_too_small_are_refused_with_the_place(values, message):
    with pytest.raises(ValueError, match=message):
        arched(**values)


def test_wheels_that_are_steered_into_a_box_are_refused():
    with pytest.raises(
        ValueError, match=r"Hull: light 4x4 with Vehicle\.track = 1\.42 m .*steered \+\d+\.\d deg.*mm deep"
    ):
        replace(TRUCK, hull=replace(TRUCK.hull, width=1.10, wheel_arches=None))
    straight = replace(TRUCK.steering, limit=math.radians(4.5))
    assert replace(TRUCK, hull=replace(TRUCK.hull, width=1.10, wheel_arches=None), steering=straight).hull.width == 1.10


@pytest.mark.parametrize("width", [1.10, 1.20])
def test_a_body_too_wide_is_told_the_width_that_would_do(width):
    with pytest.raises(ValueError, match=r"Hull\.width = ([\d.]+) m, about") as error:
        replace(TRUCK, hull=replace(TRUCK.hull, width=width, wheel_arches=None))
    enough = float(re.search(r"Hull\.width = ([\d.]+) m", str(error.value))[1])
    assert replace(TRUCK, hull=replace(TRUCK.hull, width=enough, wheel_arches=None)).hull.width == enough
    with pytest.raises(ValueError, match="lets a tyre enter"):
        replace(TRUCK, hull=replace(TRUCK.hull, width=enough + 0.02, wheel_arches=None))


def test_what_is_told_clear_at_once_is_clear():
    """Random arches and boxes: the quick answers of `wheels_clear` against the closer look."""
    rng = np.random.default_rng(5)
    quick = close = 0
    for _ in range(40):
        axles = tuple(
            Axle(x, rng.uniform(0.55, 0.75), 0.3, rng.uniform(0.07, 0.13), -turn, turn, rng.uniform(0.03, 0.1),
                 rng.uniform(0.03, 0.1), None)
            for x, turn in ((1.2, rng.uniform(0.0, 0.6)), (-1.2, 0.0))
        )  # fmt: skip
        given = {name: rng.uniform(0.02, 0.3) for name in ("ahead", "above", "inboard") if rng.random() < 0.6}
        hull = replace(TRUCK.hull, wheel_arches=WheelArches(**given, corners=int(rng.integers(2, 9))))
        gap, told = least_gap(hull, axles).gap, wheels_clear(hull, axles)
        assert (told is None) == (gap >= -1e-6 * 0.3)
        quick, close = quick + (told is None), close + (told is not None)
    assert quick > 5 and close > 5


def test_a_tyre_that_enters_the_body_at_full_lock_says_that_the_inner_wheel_turns_further():
    """By Ackermann's law; with parallel wheels there is no further to turn."""
    limit = math.radians(30.0)
    for geometry, said in (("ackermann", True), ("parallel", False)):
        steering = replace(AMPHIBIOUS.steering, geometry=geometry, limit=limit)
        with pytest.raises(ValueError, match=r"or less steering \(Steering\.limit = 30 deg") as error:
            replace(AMPHIBIOUS, steering=steering, hull=replace(AMPHIBIOUS.hull, width=0.535))
        assert ("at which the inner wheel turns" in str(error.value)) == said, str(error.value)
