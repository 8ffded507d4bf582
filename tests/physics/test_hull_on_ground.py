"""Vehicles whose hull meets the ground: rest, friction, hanging on a ridge, sliding off a crest, and the same bits.

Tolerances were written down before the comparison.
"""

import math
from dataclasses import replace

import numpy as np
import pytest
from multibody_models import CALM, same_bits
from scipy.integrate import dblquad
from scipy.spatial.transform import Rotation

from exumob.driving.maneuver import ConstantSteer
from exumob.ground.hull_contact import hull_contact, hull_soil_forces
from exumob.ground.soil import Soil
from exumob.ground.terrain import Terrain
from exumob.multibody.system import MultibodyVehicle
from exumob.simulation.run import simulate
from exumob.simulation.summary import energy_residual, force_residual, summary
from exumob.support.quantities import unusual
from exumob.water.conditions import Water
from exumob.water.wetted_surface import box_surface, hull_triangles

BOX = box_surface(1.0, 0.5, 0.2).triangles
STILL = ConstantSteer(speed=0.0)
SPIN = ConstantSteer(speed=6.0, start_speed=6.0)


def ridge(height, width):
    """A ridge across the way, its crest at x = 0.9 m."""
    x = np.arange(-2.0, 5.001, 0.05)
    heights = np.broadcast_to(height * np.exp(-(((x - 0.9) / width) ** 2)), (2, len(x)))
    return Terrain(heights=heights, origin=(-2.0, -2.0), spacing=(0.05, 4.0))


def spine(angle=0.0):
    """A ridge along the way, 0.2 m high, on which the hull lies with its wheels in the air; it falls at an angle."""
    y = np.arange(-2.0, 2.001, 0.05)
    heights = np.repeat(0.2 * np.clip((0.22 - np.abs(y)) / 0.08, 0.0, 1.0)[:, None], 2, axis=1)
    return Terrain(heights=heights, origin=(-3.0, -2.0), spacing=(15.0, 0.05), slope_x=-math.tan(angle))


def model_on(vehicle, soil, terrain, maneuver, **options):
    hull = hull_contact(hull_triangles(vehicle), terrain)
    return MultibodyVehicle(vehicle, soil, maneuver, terrain, 5e-4, 4.0, hull=hull, **options)


def advance(model, end):
    for n in range(round(model.time / 0.02), round(end / 0.02)):
        model.advance((n + 1) * 0.02, CALM)


# -- closed forms ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["LETE sand", "Heavy clay 25 %", "Snow (Sweden)", "Lunar soil"])
@pytest.mark.parametrize("sinkage", [2e-3, 0.02])
@pytest.mark.parametrize("form", ["bekker", "reece"])
def test_a_flat_belly_sinks_as_a_plate(name, sinkage, form):
    """Area times Bekker's pressure under a plate of 0.5 m, at rest, to 1e-6; no force along the ground, no moment."""
    soil = replace(Soil.published(name), pressure_form=form)
    found = hull_soil_forces(soil, Terrain(), hull_contact(BOX, Terrain()), (0, 0, 0.1 - sinkage), np.eye(3))
    weight = 0.5 * soil.pressure(sinkage, 0.5)
    assert found["force"][2] == pytest.approx(weight, rel=1e-6)
    assert np.abs(found["force"][:2]).max() < 1e-9 * weight
    assert np.abs(found["moment"]).max() < 1e-9 * weight
    assert found["sinkage"] == pytest.approx(sinkage, rel=1e-9)


@pytest.mark.parametrize(
    ("pitch", "roll", "slope", "height", "tolerance"),
    [
        (0.02, 0.0, 0.0, 0.08, 1e-3), (0.01, -0.03, 0.0, 0.075, 1e-3), (-0.2, 0.02, 0.2, 0.07, 1e-3),  # all in the soil
        (0.08, 0.0, 0.0, 0.09, 1e-2), (0.05, 0.1, 0.0, 0.09, 1e-2), (-0.1, 0.0, 0.2, 0.09, 1e-2),  # a part of it
    ],
)  # fmt: skip
def test_a_tilted_belly_bears_the_integral_of_the_pressure(sand, pitch, roll, slope, height, tolerance):
    """Bearing along the ground's normal against adaptive quadrature over the bottom; the sides are left out."""
    terrain = Terrain(slope_x=slope)
    matrix = Rotation.from_euler("ZYX", [0.0, pitch, roll]).as_matrix()
    normal = np.array([-slope, 0.0, 1.0]) / math.hypot(1.0, slope)
    down = -matrix[:, 2]
    contact = hull_contact(BOX, terrain)
    contact.points["area"][contact.points["normal"][:, 2] > -0.5] = 0.0

    def load(y, x):
        point = matrix @ [x, y, -0.1] + [0.0, 0.0, height]
        depth = -float(normal @ point)
        return soil.pressure(depth, 0.5) if depth > 0.0 else 0.0

    soil = sand
    whole, _ = dblquad(load, -0.5, 0.5, -0.25, 0.25, epsrel=1e-5, epsabs=1.0)
    found = hull_soil_forces(soil, terrain, contact, (0.0, 0.0, height), matrix)
    assert found["force"] @ normal == pytest.approx(-whole * float(normal @ down), rel=tolerance)


def test_a_bow_is_held_by_the_work_of_compaction(sand):
    """A box that advances level: friction on its bottom, and the width times the integral of the pressure.

    5 %: the lowest layers of an upright face are 6 mm high, and the next ones thicker.
    """
    sinkage, soil = 0.03, replace(sand, cohesion=unusual(0.0))
    found = hull_soil_forces(soil, Terrain(), hull_contact(BOX, Terrain()), (0, 0, 0.1 - sinkage), np.eye(3), (1, 0, 0))
    compaction = 0.5 * soil.pressure(sinkage, 0.5) * sinkage / (soil.n + 1.0)
    friction = 0.5 * soil.pressure(sinkage, 0.5) * math.tan(soil.friction_angle)
    assert -found["force"][0] - friction == pytest.approx(compaction, rel=0.05)


POSES = {
    # terrain, yaw pitch roll, height, tolerance of 40 points along the hull against 120
    "level": (Terrain(), (0, 0, 0), 0.082, 0.02), "pitched": (Terrain(), (0, 0.026, 0), 0.09, 0.02),
    "rolled": (Terrain(), (0.3, 0.087, 0.035), 0.1, 0.02), "bow up": (Terrain(slope_x=0.2), (0, -0.1, 0), 0.1, 0.02),
    "ridge": (ridge(0.1, 0.2), (0, 0, 0), 0.18, 0.03), "skew": (ridge(0.1, 0.2), (0.2, -0.1, 0), 0.19, 0.03),
}  # fmt: skip


@pytest.mark.parametrize("pose", POSES)
def test_more_points_change_little(pose, vehicle, sand):
    """The force on the sliding hull, 40 points along it against 120: 2 % on planes, 3 % on a sharp crest."""
    terrain, angles, height, tolerance = POSES[pose]
    place = (0.95 if terrain.heights is not None else 0.0, 0.0, height)
    matrix = Rotation.from_euler("ZYX", angles).as_matrix()
    forces = [
        hull_soil_forces(
            sand, terrain, hull_contact(hull_triangles(vehicle), terrain, points_along=count), place, matrix,
            (0.5, 0.1, 0.0),
        )["force"]
        for count in (40, 120)
    ]  # fmt: skip
    assert np.linalg.norm(forces[1]) > 100.0
    assert np.linalg.norm(forces[0] - forces[1]) < tolerance * np.linalg.norm(forces[1])


# -- rest and friction -------------------------------------------------------------------------------------------------


def test_it_settles_on_its_belly_in_very_soft_soil(vehicle, sand):
    """Wheels and belly share the weight; the belly bears what Bekker's pressure on its keel is (1 %, it lies askew)."""
    soft = replace(sand, k_phi=unusual(0.03 * sand.k_phi), k_c=0.0)
    low = replace(vehicle, hull=replace(vehicle.hull, ground_clearance=0.05, height=0.228))
    run = simulate(low, soft, maneuver=STILL, duration=0.6)
    weight = 9.81 * low.mass
    assert run.attrs["start"] == "at rest"
    assert run.attrs["verdict"] == "stands"
    share = float(run["hull_load_share"][0])
    assert 0.05 < share < 0.95
    assert float(run["soil_force"][0].sel(axis="z").sum()) / weight + share == pytest.approx(1.0, abs=1e-5)
    assert "the hull first touched the ground at 0.00 s" in run.attrs["verdict_sentence"]
    found = summary(run)
    assert found["hull_load_share"] == pytest.approx(share, abs=1e-3)
    assert found["least_clearance"] < 0.0


def test_half_afloat_it_settles_on_its_belly(vehicle, sand):
    """Water, wheels and belly bear the weight together."""
    soft = replace(sand, k_phi=unusual(0.006 * sand.k_phi), k_c=0.0)
    low = replace(vehicle, hull=replace(vehicle.hull, ground_clearance=0.03, height=0.248))
    run = simulate(low, soft, Water(0.06), STILL, "coefficients", duration=0.6)
    weight = 9.81 * low.mass
    shares = [
        float(run[name][0].sel(axis="z").sum()) / weight for name in ("soil_force", "hull_soil_force", "water_load")
    ]
    assert min(shares) > 0.03
    assert sum(shares) == pytest.approx(1.0, abs=1e-4)
    assert run.attrs["verdict"] == "stands"


@pytest.fixture(scope="module")
def frictional(sand):
    return replace(sand, cohesion=unusual(0.0))


def test_it_slides_down_what_is_steeper_than_friction(vehicle, frictional):
    """36 degrees, friction 31.1: g (sin a - tan(phi) cos a) to 0.5 %, wheels in the air."""
    angle = math.radians(36.0)
    model = model_on(vehicle, frictional, spine(angle), STILL)
    assert model.settle(lambda states: CALM).kind == "sliding"
    advance(model, 0.5)
    before = model.present().velocity[0, 0]
    advance(model, 1.0)
    gained = np.linalg.norm(model.present().velocity[0, 0] - before) / 0.5
    expected = 9.81 * (math.sin(angle) - math.tan(frictional.friction_angle) * math.cos(angle))
    assert gained == pytest.approx(expected, rel=0.005)
    assert not model.loads[0]["soil_force"].any()
    assert abs(model.present().position[0, 0, 1]) < 1e-9


def test_it_holds_on_what_is_flatter(vehicle, frictional):
    """20 degrees: it creeps as Janosi's curve says, -K w0 ln(1 - tan(a) / tan(phi)), to 2 %."""
    angle = math.radians(20.0)
    model = model_on(vehicle, frictional, spine(angle), STILL)
    assert model.settle(lambda states: CALM).kind in ("at rest", "creeping")
    advance(model, 0.5)
    share = math.tan(angle) / math.tan(frictional.friction_angle)
    creep = -frictional.shear_modulus_x * 0.05 * math.log(1.0 - share)
    assert np.linalg.norm(model.present().velocity[0, 0]) == pytest.approx(creep, rel=0.02)


# -- driving -----------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def hanging(vehicle, sand):
    """Over a ridge that is higher than its clearance, and sharp."""
    return simulate(vehicle, sand, maneuver=SPIN, duration=3.5, terrain=ridge(0.14, 0.3))


def test_it_hangs_on_a_ridge_with_its_wheels_spinning(hanging):
    late = hanging.sel(time=slice(3.0, None))
    assert hanging.attrs["verdict"] == "bottomed"
    assert "% of the weight on the hull" in hanging.attrs["verdict_sentence"]
    assert "the hull first touched the ground at" in hanging.attrs["verdict_sentence"]
    assert 1.9 < hanging.attrs["verdict_since"] < 2.5
    assert 0.4 < float(late["hull_load_share"].mean()) < 0.8
    assert float(np.abs(late["forward_velocity"]).max()) < 0.01
    assert float(late["slip_ratio"].min()) > 0.97
    center = late["hull_contact_center"].mean("time")
    assert float(center.sel(axis="x")) == pytest.approx(0.9, abs=0.1)
    assert float(center.sel(axis="z")) == pytest.approx(0.14, abs=0.02)


def test_forces_and_energy_balance_while_it_hangs(hanging):
    weight = -float(hanging["gravity_load"].isel(time=0).sel(axis="z").sum())
    assert float(np.abs(force_residual(hanging)).max()) < 1e-3 * weight
    work = hanging["work"]
    assert float(np.abs(energy_residual(hanging)).max()) < 0.01 * float(work.sel(work_kind="spin")[-1])
    on_hull = work.sel(work_kind="soil on hull").values
    assert on_hull[-1] < -5.0
    assert on_hull.max() < 1e-3 * -on_hull[-1]
    power = (hanging["hull_soil_force"] * hanging["velocity"].sel(body="hull")).sum("axis")
    power += (hanging["hull_soil_moment"] * hanging["angular_velocity"].sel(body="hull")).sum("axis")
    assert float(power.integrate("time")) == pytest.approx(on_hull[-1], rel=0.1)


def test_it_slides_over_a_rounded_crest(vehicle, sand):
    """It loses speed on its belly and goes on: not bottomed, but the sentence says that it touched."""
    run = simulate(vehicle, sand, maneuver=SPIN, duration=3.2, terrain=ridge(0.15, 0.4))
    assert float(run["hull_load_share"].max()) > 0.2
    assert run.attrs["verdict"] == "drives"
    assert "first touched the ground" in run.attrs["verdict_sentence"]
    assert float(run["position"].sel(body="hull", axis="x")[-1]) > 1.1
    assert float(run["hull_soil_force"][-1].sel(axis="z")) == 0.0


def test_a_run_restarts_and_repeats_with_the_same_bits_on_its_belly(vehicle, sand):
    """Saved before, while and after it touches; in the same model and in another."""
    terrain = ridge(0.14, 0.3)
    model = model_on(vehicle, sand, terrain, SPIN)
    model.settle(lambda states: CALM)
    loads = []
    for start in (1.9, 2.04, 2.3):
        advance(model, start)
        saved = model.save()
        loads.append(float(model.loads[0]["hull_soil"]["force"][2]))
        advance(model, start + 0.1)
        once = model.save()
        other = model_on(vehicle, sand, terrain, SPIN)
        for again in (model, other):
            again.restore(saved)
            assert same_bits(again.save(), saved)
            advance(again, start + 0.1)
            assert same_bits(again.save(), once)
        model.restore(saved)
    assert loads[0] == 0.0
    assert max(loads) > 100.0


def test_both_load_paths_agree_on_its_belly(vehicle, sand):
    """As one vector of generalised forces and as user loads: 1e-8 m after it has come to hang."""
    ends = []
    for user_loads in (False, True):
        model = model_on(vehicle, sand, ridge(0.14, 0.3), SPIN, user_loads=user_loads)
        model.settle(lambda states: CALM)
        advance(model, 2.3)
        assert model.loads[0]["hull_soil"]["force"][2] > 20.0
        ends.append(model.present())
    assert np.abs(ends[0].position - ends[1].position).max() < 1e-8


def test_mirrored_ground_mirrors_the_way(vehicle, sand):
    """A ridge at 30 degrees to the way, and its mirror image: the paths mirror to 1e-6 m."""
    x, y = np.arange(-2.0, 4.001, 0.05), np.arange(-2.0, 2.001, 0.05)
    places = []
    for side in (1.0, -1.0):
        across = (x[None, :] - 1.1) * math.cos(0.5) + side * y[:, None] * math.sin(0.5)
        ground = Terrain(heights=0.15 * np.exp(-((across / 0.25) ** 2)), origin=(-2.0, -2.0), spacing=0.05)
        model = model_on(vehicle, sand, ground, SPIN)
        model.settle(lambda states: CALM)
        advance(model, 2.6)
        places.append(model.present().position[0, 0])
        assert model.energy_account[0]["work"][-1] < -1.0
    assert places[0] * [1.0, -1.0, 1.0] == pytest.approx(places[1], abs=1e-6)
    assert abs(places[0][1]) > 0.01


def test_without_contact_the_bits_are_those_of_a_hull_that_soil_cannot_touch(vehicle, sand):
    ends = []
    for contact in (True, False):
        hull = hull_contact(hull_triangles(vehicle), Terrain()) if contact else None
        model = MultibodyVehicle(vehicle, sand, SPIN, Terrain(), 5e-4, 4.0, hull=hull)
        model.settle(lambda states: CALM)
        advance(model, 0.3)
        ends.append(model.save())
    assert same_bits(*ends)
