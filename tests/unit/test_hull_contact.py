"""Soil under a hull: where its points are, bad input, signs, mirror images, continuity and energy of the contact."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from exumob.ground.hull_contact import HULL_SOIL, hull_contact, hull_is_clear, hull_soil_forces, soil_on_hull
from exumob.ground.soil import Soil
from exumob.ground.terrain import Terrain
from exumob.support.quantities import unusual
from exumob.water.wetted_surface import box_surface, cylinder_surface, hull_triangles

BOX = box_surface(1.0, 0.5, 0.2).triangles
SLOPE = Terrain(slope_x=0.1, slope_y=-0.05)


def turned(*angles):
    """Rotation matrix of yaw, pitch and roll [rad]."""
    return Rotation.from_euler("ZYX", angles).as_matrix()


@pytest.mark.parametrize(("length", "spacing", "columns"), [(1.0, None, 40), (1.0, 0.02, 50), (1.0, 1e-3, 100)])
def test_bottom_of_a_box_is_a_grid(length, spacing, columns):
    """At most a fortieth of the length, or the terrain's spacing, but no more than a hundred columns."""
    ground = Terrain() if spacing is None else Terrain(heights=np.zeros((3, 3)), spacing=spacing)
    points = hull_contact(BOX, ground).points
    bottom = points[points["normal"][:, 2] < -0.5]
    assert len(np.unique(bottom["position"][:, 0].round(9))) == columns
    assert len(bottom) == columns * columns // 2
    assert bottom["area"] == pytest.approx(0.5 / len(bottom), rel=1e-9)
    assert bottom["position"][:, 2] == pytest.approx(-0.1, abs=1e-15)
    assert not (points["normal"][:, 2] > 1e-9).any()


@pytest.mark.parametrize("shape", ["box", "raked", "round"])
def test_points_hold_area_and_first_moment_and_are_their_mirror_image(shape, vehicle):
    triangles = {
        "box": BOX, "raked": hull_triangles(vehicle), "round": cylinder_surface(0.2, 0.6, 64).triangles,
    }[shape]  # fmt: skip
    contact = hull_contact(triangles, Terrain())
    vectors = 0.5 * np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    down = vectors[:, 2] <= 1e-9 * np.linalg.norm(vectors, axis=1)
    points = contact.points
    summed = (points["area"][:, None] * points["normal"]).sum(axis=0)
    assert summed == pytest.approx(vectors[down].sum(axis=0), abs=1e-12)
    moment = (points["area"] * points["normal"][:, 2]) @ points["position"]
    expected = vectors[down, 2] @ triangles[down].mean(axis=1)
    assert moment == pytest.approx(expected, abs=2e-4 if shape == "round" else 1e-12)
    mirrored = points["position"] * [1.0, -1.0, 1.0]
    nearest = np.abs(mirrored[:, None] - points["position"]).sum(axis=-1).min(axis=1)
    assert nearest.max() < 1e-9


@pytest.mark.parametrize(
    ("triangles", "message"),
    [
        (BOX[:, :, :2], "shape"), (np.full((4, 3, 3), np.nan), "finite"),
        (BOX[(BOX[..., 2] > 0.0).all(axis=1)], "no face looks down"),
    ],
)  # fmt: skip
def test_refuses_a_surface_without_a_bottom(triangles, message):
    with pytest.raises(ValueError, match=message):
        hull_contact(triangles, Terrain())


def test_nothing_above_the_ground_and_where_the_motion_is_not_finite(sand):
    contact = hull_contact(BOX, SLOPE)
    assert not hull_soil_forces(sand, SLOPE, contact, (0, 0, 0.3), np.eye(3))["force"].any()
    out = np.zeros(1, HULL_SOIL)
    ground, nodes = SLOPE.as_arrays()
    nowhere = np.full(3, np.nan)
    soil_on_hull(
        sand.as_record()[0], ground[0], nodes, contact.points, contact.record[0], 0.05,
        nowhere, np.eye(3), nowhere, nowhere, out[0],
        np.zeros((0, 0)), 0.0, 0.0,
    )  # fmt: skip
    assert not out["force"].any()
    assert out["sinkage"] == 0.0


@pytest.mark.parametrize(
    ("velocity", "turning", "opposed"),
    [
        ((0.3, 0, 0), (0, 0, 0), 0), ((-0.3, 0, 0), (0, 0, 0), 0), ((0, 0.3, 0), (0, 0, 0), 1),
        ((0, -0.3, 0), (0, 0, 0), 1), ((0, 0, 0), (0, 0, 1.0), 5), ((0, 0, 0), (0, 0, -1.0), 5),
    ],
)  # fmt: skip
def test_sliding_is_opposed_and_nothing_else_is(sand, velocity, turning, opposed):
    soil = hull_soil_forces(sand, Terrain(), hull_contact(BOX, Terrain()), (0, 0, 0.09), np.eye(3), velocity, turning)
    wrench = np.concatenate([soil["force"], soil["moment"]])
    sign = np.sign(np.concatenate([velocity, turning])[opposed])
    assert wrench[opposed] * sign < -0.05 * wrench[2]
    others = [k for k in (0, 1, 5) if k != opposed]
    assert np.abs(wrench[others]).max() < 1e-9 * wrench[2]


def test_a_mirrored_motion_gives_the_mirrored_force(vehicle, sand):
    contact = hull_contact(hull_triangles(vehicle), SLOPE)
    flip = np.diag([1.0, -1.0, 1.0])
    rng = np.random.default_rng(1)
    for _ in range(20):
        rotation = turned(*rng.uniform(-0.3, 0.3, 3))
        position, velocity, turning = rng.uniform(-0.1, 0.1, (3, 3)) + np.diag([0.0, 0.0, 0.1])[[2, 0, 1]]
        one = hull_soil_forces(sand, SLOPE, contact, position, rotation, velocity, turning)
        two = hull_soil_forces(
            sand, Terrain(slope_x=0.1, slope_y=0.05), contact, flip @ position, flip @ rotation @ flip,
            flip @ velocity, -flip @ turning,
        )  # fmt: skip
        size = np.abs(one["force"]).max() + 1.0
        assert flip @ one["force"] == pytest.approx(two["force"], abs=1e-9 * size)
        assert -flip @ one["moment"] == pytest.approx(two["moment"], abs=1e-9 * size)


@pytest.mark.parametrize("name", ["LETE sand", "Heavy clay 25 %", "Snow (Sweden)"])
def test_no_jump_at_touch_down_nor_where_faces_turn_away(name):
    """A nanometre of sinkage and a millionth of a degree change the force by next to nothing."""
    soil, contact = Soil.published(name), hull_contact(BOX, Terrain())
    motion = ((0.5, 0.2, -0.3), (0.1, 0.1, 0.1))
    touching = hull_soil_forces(soil, Terrain(), contact, (0, 0, 0.1 - 1e-9), np.eye(3), *motion)
    deep = hull_soil_forces(soil, Terrain(), contact, (0, 0, 0.095), np.eye(3), *motion)
    assert np.linalg.norm(touching["force"]) < 1e-4 * np.linalg.norm(deep["force"])
    for angle in np.radians([-90.0, -5.8, -1.0, 0.0, 5.7, 10.0]):
        one, two = (
            hull_soil_forces(soil, Terrain(), contact, (0, 0, 0.05), turned(0, angle + step, 0), *motion)
            for step in (-1e-8, 1e-8)
        )
        for part in ("force", "moment"):
            assert one[part] == pytest.approx(two[part], abs=1e-5 * np.abs(one["force"]).max())


def test_derivative_by_the_motion(sand):
    """Newton's matrix against central differences, for a hull that slides and sinks on a slope (damping apart)."""
    contact = hull_contact(BOX, SLOPE)
    ground, nodes = SLOPE.as_arrays()
    soil = replace(sand, damping=0.0).as_record()
    motion = np.array([3e-4, 1e-4, -0.01, 1e-3, 2e-3, 1e-3])
    rotation, position = turned(0.3, 0.05, -0.04), np.array([0.1, 0.2, 0.09])

    def wrench(step, rates, tangent=None, factors=(0.0, 0.0)):
        out = np.zeros(1, HULL_SOIL)
        placed = Rotation.from_rotvec(step[3:]).as_matrix() @ rotation
        soil_on_hull(
            soil[0], ground[0], nodes, contact.points, contact.record[0], 0.05,
            position + step[:3], placed, rates[:3].copy(), rates[3:].copy(),
            out[0], np.zeros((0, 0)) if tangent is None else tangent, *factors,
        )  # fmt: skip
        return np.concatenate([out[0]["force"], out[0]["moment"]])

    still = np.zeros(6)
    for factors in ((0.0, 1.0), (1.0, 0.0)):
        tangent, expected = np.zeros((6, 6)), np.zeros((6, 6))
        wrench(still, motion, tangent, factors)
        for k, step in enumerate(1e-8 * np.eye(6)):
            ahead, back = (
                wrench(still, motion + sign * step) if factors[1] else wrench(sign * step, motion) for sign in (1, -1)
            )
            expected[:, k] = (ahead - back) / 2e-8
        assert np.abs(tangent - expected).max() < (0.01 if factors[1] else 0.1) * np.abs(expected).max()


def ledger(soil, seed, standstill_rate):
    """Work of the soil on a hull that rocks in and out of it, and what is stored, over the work of pressing it in."""
    rng = np.random.default_rng(seed)
    contact = hull_contact(BOX, SLOPE, points_along=10)
    waves, phase = rng.uniform(-1.0, 1.0, (6, 3)), rng.uniform(0.0, 2.0 * math.pi, (6, 3))
    size = np.array([0.1, 0.1, 0.03, 0.1, 0.1, 0.2])[:, None] * waves
    time = np.linspace(0.0, 2.0 * math.pi, 4001)
    order = np.arange(1, 4)[:, None]
    motion = np.einsum("kj,kjn->kn", size, np.sin(order * time + phase[..., None]))
    motion[2] += 0.12 + 0.12 * np.cos(time)  # clear of the ground at first and at last
    power, stored = np.zeros(len(time)), np.zeros(len(time))
    step = time[1]
    rotation = Rotation.from_rotvec(motion[3:].T)
    velocity = np.gradient(motion[:3], step, axis=1, edge_order=2).T
    between = (rotation[1:] * rotation[:-1].inv()).as_rotvec() / step
    turning = np.concatenate([between[:1], 0.5 * (between[1:] + between[:-1]), between[-1:]])
    for n, (matrix, place) in enumerate(zip(rotation.as_matrix(), motion[:3].T, strict=True)):
        found = hull_soil_forces(
            soil, SLOPE, contact, place, matrix, velocity[n], turning[n], standstill_rate=standstill_rate
        )
        power[n] = found["force"] @ velocity[n] + found["moment"] @ turning[n]
        stored[n] = found["stored"]
    work = np.concatenate([[0.0], np.cumsum(0.5 * step * (power[1:] + power[:-1]))])
    scale = stored.max()
    assert scale > 0.0
    assert stored[0] == stored[-1] == 0.0
    return work / scale, stored / scale


@pytest.mark.parametrize("seed", [0, 1])
def test_without_friction_the_contact_gives_back_what_it_took(sand, seed):
    """Bearing and its couple have a potential: work + stored energy = 0 at all times (but for the steps: 0.05 %)."""
    soil = replace(
        sand, cohesion=unusual(0.0), friction_angle=0.0, damping=0.0, shear_modulus_x=0.5, shear_modulus_y=0.5
    )
    work, stored = ledger(soil, seed, 1e3)  # so fast a creep mobilises no compaction
    assert np.abs(work + stored).max() < 5e-4


@pytest.mark.parametrize("seed", [0, 1, 2])
@pytest.mark.parametrize("name", ["LETE sand", "Heavy clay 25 %"])
def test_the_contact_never_gives_energy(name, seed):
    """What it took less what is stored only grows, and after lift-off it has taken."""
    work, stored = ledger(Soil.published(name), seed, 0.05)
    taken = -(work + stored)
    assert np.diff(taken).min() > -1e-3
    assert taken.min() > -1e-3
    assert taken[-1] > 0.1


def test_a_hull_that_was_looked_at_is_not_overlooked(sand):
    """Wherever it moves, the hull gets the same force whether it remembers its last look at the ground or not."""
    rng = np.random.default_rng(3)
    ground = Terrain(heights=rng.uniform(0.0, 0.1, (41, 41)), origin=(-2.0, -2.0), spacing=0.1)
    contact = hull_contact(BOX, ground, points_along=10)
    record, nodes = ground.as_arrays()
    soil, out = sand.as_record(), np.zeros((2, 1), HULL_SOIL)
    place, angles = np.array([0.0, 0.0, 0.25]), np.zeros(3)
    cleared = touched = 0
    for _ in range(3000):
        place = place + rng.normal(0.0, 0.004, 3) + [0.0, 0.0, 0.05 * (0.215 - place[2])]
        angles = 0.95 * angles + rng.normal(0.0, 0.005, 3)
        rotation = turned(*angles)
        clear = hull_is_clear(contact.record[0], place, rotation)
        if not clear:
            soil_on_hull(
                soil[0], record[0], nodes, contact.points, contact.record[0], 0.05,
                place, rotation, np.zeros(3), np.zeros(3), out[0, 0],
                np.zeros((0, 0)), 0.0, 0.0,
            )  # fmt: skip
            touched += bool(out[0, 0]["sinkage"] > 0.0)
            continue
        cleared += 1
        fresh = contact._replace(record=contact.record.copy())
        fresh.record["clearance"] = 0.0
        assert hull_soil_forces(sand, ground, fresh, place, rotation)["sinkage"] == 0.0
    assert cleared > 300
    assert touched > 30
