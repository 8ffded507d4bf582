"""Coefficient model: formulas, symmetries, continuity, dissipation, the stability of the added-mass filter."""

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from exumob.support.constants import GRAVITY
from exumob.vehicle.hull import WheelArches
from exumob.vehicle.motion import BODIES, BodyStates
from exumob.vehicle.vehicle_file import load_vehicle
from exumob.water.coefficient_kernels import FILTER_STEPS, filter_time
from exumob.water.coefficients import CoefficientHydrodynamics, Coefficients, spheroid_added_mass
from exumob.water.conditions import Water
from exumob.water.hydrodynamics import NoWater

WATER = Water(0.12)
HYDROSTATIC, DRAG, ADDED_MASS = range(3)


@pytest.fixture(scope="module")
def vehicle():
    return load_vehicle(Path(__file__).parents[2] / "vehicle_models" / "amphibious.py")


@pytest.fixture(scope="module")
def boxy(vehicle):
    """The vehicle with a plain box for a hull: its wetted areas are exact to the eye."""
    return dataclasses.replace(vehicle, hull=dataclasses.replace(vehicle.hull, bow_length=0.0, bow_height=0.0))


def standing(vehicle, n=1, **changes):
    """At rest in the design position; changes are arrays that broadcast to the field's shape."""
    zeros = np.zeros((n, 5, 3))
    position = np.broadcast_to(np.vstack([vehicle.hull_origin, vehicle.wheel_centers]), (n, 5, 3))
    states = BodyStates(
        1e-3 * np.arange(n), position, np.broadcast_to(np.eye(3), (n, 5, 3, 3)), *[zeros] * 4, np.zeros((n, 4))
    )
    shaped = {name: np.broadcast_to(value, getattr(states, name).shape) for name, value in changes.items()}
    return dataclasses.replace(states, **shaped)


def random_motion(vehicle, seed, speed=1.0):
    rng = np.random.default_rng(seed)
    states = standing(vehicle)
    return standing(
        vehicle,
        position=states.position + rng.normal(scale=0.02, size=(1, 5, 3)),
        rotation=Rotation.from_euler("ZYX", rng.normal(scale=[1.0, 0.1, 0.1], size=(5, 3))).as_matrix(),
        velocity=rng.normal(scale=speed, size=(1, 5, 3)),
        angular_velocity=rng.normal(scale=speed, size=(1, 5, 3)),
    )


def loads(vehicle, water, states, macro_step=1e-3, **options):
    """Hydrostatic, drag and added-mass parts of one call, shape (3, 5, 6)."""
    model = CoefficientHydrodynamics(**options)
    model.start(vehicle, water, macro_step)
    total = model.wrenches(states, lambda: states)
    record = model.record()
    parts = np.stack([record[f"{name}_load"].values[0] for name in ("hydrostatic", "drag", "added_mass")])
    np.testing.assert_allclose(parts.sum(axis=0), total, atol=1e-12)
    return parts


def drag(vehicle, water, states, **options):
    return loads(vehicle, water, states, **options)[DRAG]


# --- drag -------------------------------------------------------------------------------------------------------------


def test_surge_drag_is_that_of_the_frontal_area_with_wheel_arches_or_without(boxy):
    """Square arches high enough to stand out of the water: eight walls that meet no stream; sway and heave stay."""
    straight = dataclasses.replace(boxy.steering, limit=0.0)
    hull = dataclasses.replace(boxy.hull, width=0.7, height=0.4, center_of_mass_height=0.2)
    wide = dataclasses.replace(boxy, hull=hull, steering=straight, track=0.8)
    arched = dataclasses.replace(
        wide, hull=dataclasses.replace(hull, wheel_arches=WheelArches(ahead=0.04, above=0.1, inboard=0.1, corners=2))
    )
    flow = Water(hull.ground_clearance + 0.2)  # up to the middle of the hull
    states = standing(wide, velocity=[0.7, 0.0, 0.0])
    plain, cut = (drag(v, flow, states)[0] for v in (wide, arched))
    assert plain[0] == pytest.approx(-0.5 * 1000.0 * 0.81 * 0.7 * 0.2 * 0.7**2, rel=1e-9)
    assert cut[0] == pytest.approx(plain[0], rel=1e-9)
    aside = standing(wide, velocity=[0.0, 0.7, 0.0])
    assert drag(arched, flow, aside)[0, 1] == pytest.approx(drag(wide, flow, aside)[0, 1], rel=0.05)


@pytest.mark.parametrize("speed", [0.3, 1.0])
def test_head_current_on_a_held_vehicle(boxy, speed):
    """C/2 rho A U^2 on the wetted frontal areas; exact for the box, 1 % for the faceted wheels."""
    drags = drag(boxy, Water(0.12, speed), standing(boxy))
    pressure = 0.5 * 1000.0 * speed**2
    assert drags[0, 0] == pytest.approx(-0.81 * pressure * 0.44 * 0.042, rel=1e-9)
    assert drags[0, 4] == pytest.approx(drags[0, 0] * (0.5 * (0.078 + 0.12) - 0.17), rel=1e-9)
    np.testing.assert_allclose(drags[1:, 0], -0.58 * pressure * 0.08 * 0.12, rtol=1e-2)
    np.testing.assert_allclose(drags[:, [1, 2, 3, 5]], 0.0, atol=1e-12)


def test_side_current_on_a_held_vehicle(boxy):
    drags = drag(boxy, Water(0.12, 0.8, current_direction=math.pi / 2), standing(boxy))
    coefficient = np.interp(0.44 / 0.084, [3.0, 6.0], [1.3, 0.9])
    assert drags[0, 1] == pytest.approx(0.5 * 1000.0 * 0.8**2 * coefficient * 1.0 * 0.042, rel=1e-9)
    rise = 0.1 - 0.12
    disk = 0.01 * math.acos(rise / 0.1) - rise * math.sqrt(0.01 - rise**2)
    np.testing.assert_allclose(drags[1:, 1], 0.5 * 1000.0 * 0.8**2 * 1.1 * disk, rtol=1e-2)
    assert drags[0, 3] == pytest.approx((0.17 - 0.099) * drags[0, 1], rel=1e-9)  # acts below the centre of mass
    np.testing.assert_allclose(drags[0, [0, 2, 4, 5]], 0.0, atol=1e-12)


def test_yaw_rate_is_resisted_by_cross_flow(boxy):
    """Integral of C/2 rho T |r x| r x^2 over the length = C rho T r^2 L^4 / 64; 2 % with twelve strips."""
    states = standing(boxy, angular_velocity=[0.0, 0.0, 2.0])
    drags = drag(boxy, WATER, states, coefficients=Coefficients(hull_surge_drag=0.0))
    coefficient = np.interp(0.44 / 0.084, [3.0, 6.0], [1.3, 0.9])
    assert drags[0, 5] == pytest.approx(-coefficient * 1000.0 * 0.042 * 2.0**2 / 64.0, rel=2e-2)


def test_yaw_rate_is_resisted_by_the_end_faces(boxy):
    """Surge drag alone: the two halves of bow and stern at y = +-B/4 each see the speed r B/4."""
    states = standing(boxy, angular_velocity=[0.0, 0.0, 2.0])
    drags = drag(boxy, WATER, states, coefficients=Coefficients(hull_sway_drag=((0.1, 0.0), (1.0, 0.0))))
    assert drags[0, 5] == pytest.approx(-0.5 * 0.81 * 1000.0 * 0.44 * 0.042 * 2.0**2 * 0.11**3, rel=1e-9)


def test_roll_and_pitch_rates_are_resisted_by_the_bottom(boxy):
    """Heave drag alone: half breadths at y = +-B/4 in roll; C/4 rho B q^2 L^4 / 32 in pitch, 2 % with twelve strips."""
    only_heave = Coefficients(hull_surge_drag=0.0, hull_sway_drag=((0.1, 0.0), (1.0, 0.0)))
    rolling = standing(boxy, angular_velocity=[2.0, 0.0, 0.0])
    drags = drag(boxy, WATER, rolling, coefficients=only_heave, macro_step=1e-9)
    assert drags[0, 3] == pytest.approx(-0.25 * 1.17 * 1000.0 * 0.44 * 2.0**2 * 0.11**3, rel=1e-6)
    pitching = standing(boxy, angular_velocity=[0.0, 2.0, 0.0])
    drags = drag(boxy, WATER, pitching, coefficients=only_heave, macro_step=1e-9)
    assert drags[0, 4] == pytest.approx(-0.25 * 1.17 * 1000.0 * 0.44 * 2.0**2 / 32.0, rel=2e-2)


def test_heave_drag_is_that_of_a_plate_half_when_only_the_bottom_is_wet(boxy):
    states = standing(boxy, velocity=[0.0, 0.0, -0.5])
    lift = drag(boxy, WATER, states, macro_step=1e-9)[0, 2]
    assert lift == pytest.approx(0.5 * 1.17 * 0.5 * 1000.0 * 0.5**2 * 0.44, rel=1e-6)


def test_galilean_invariance(vehicle):
    """Moving at -U through still water is being held in the current U."""
    for seed in range(3):
        states = random_motion(vehicle, seed)
        water = Water(0.12, 0.7, current_direction=2.0)
        moved = dataclasses.replace(states, velocity=states.velocity - water.velocity)
        np.testing.assert_allclose(drag(vehicle, water, states), drag(vehicle, WATER, moved), rtol=1e-9, atol=1e-12)


def test_drag_never_feeds_a_body_in_still_water(vehicle):
    """Power of the drag on each body over random motions; every one negative."""
    for seed in range(40):
        states = random_motion(vehicle, seed)
        drags = drag(vehicle, WATER, states)
        turn = states.rotation[0]
        power = np.einsum("bij,bj,bi->b", turn, drags[:, :3], states.velocity[0])
        power += np.einsum("bij,bj,bi->b", turn, drags[:, 3:], states.angular_velocity[0])
        assert np.all(power <= 0.0)
        assert power.sum() < 0.0


# --- symmetry and continuity ------------------------------------------------------------------------------------------


def test_port_and_starboard_mirror(vehicle):
    """Mirrored motion and current: mirrored loads, left and right wheels exchanged."""
    mirror, swap = np.diag([1.0, -1.0, 1.0]), [0, 2, 1, 4, 3]
    for seed in range(3):
        states = random_motion(vehicle, seed)
        other = BodyStates(
            states.time,
            states.position[:, swap] @ mirror,
            mirror @ states.rotation[:, swap] @ mirror,
            states.velocity[:, swap] @ mirror,
            -states.angular_velocity[:, swap] @ mirror,
            states.acceleration,
            states.angular_acceleration,
            states.wheel_speed,
        )
        here = loads(vehicle, Water(0.12, 0.7, 2.0), states)
        there = loads(vehicle, Water(0.12, 0.7, -2.0), other)
        sign = np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])
        np.testing.assert_allclose(there, here[:, swap] * sign, rtol=1e-9, atol=1e-9)


def test_the_same_in_a_turned_world(vehicle):
    """World, motion, acceleration and current turned by 1.1 rad: the same loads in body axes, added mass included."""
    turn = Rotation.from_euler("z", 1.1).as_matrix()
    results = []
    for rotation, direction in ((np.eye(3), 2.0), (turn, 3.1)):
        states = random_motion(vehicle, 0)
        pushes = np.random.default_rng(1).normal(size=(2, 1, 5, 3))
        history = standing(
            vehicle,
            n=20,
            position=states.position @ rotation.T,
            rotation=rotation @ states.rotation,
            velocity=states.velocity @ rotation.T,
            angular_velocity=states.angular_velocity @ rotation.T,
            acceleration=pushes[0] @ rotation.T,
            angular_acceleration=pushes[1] @ rotation.T,
        )
        model = CoefficientHydrodynamics()
        model.start(vehicle, Water(0.12, 0.7, direction), 1e-2)
        model.wrenches(history[:1], None)
        results.append(model.wrenches(history, None))
        assert np.abs(model.record()["added_mass_load"].values[1]).max() > 1.0
    np.testing.assert_allclose(*results, rtol=1e-9, atol=1e-9)


def largest_step(vehicle, make_states, values, **options):
    model = CoefficientHydrodynamics(**options)
    model.start(vehicle, Water(0.12, 0.5, 2.0), 1e-6)
    series = np.array([model.wrenches(make_states(value), None) for value in values])
    return np.abs(np.diff(series, axis=0)).max(), np.abs(series).max()


@pytest.mark.parametrize("pitch", [0.0, 0.02])
def test_water_entry_is_continuous(vehicle, pitch):
    """A moving, accelerating vehicle lowered into the water: ten times smaller steps change the load ten times less."""
    rotation = Rotation.from_euler("y", pitch).as_matrix()

    def at_height(height):
        states = standing(vehicle, rotation=rotation, velocity=[0.3, 0.4, -0.5], angular_velocity=[0.1, 0.2, 0.3])
        return dataclasses.replace(states, position=states.position + np.array([0.0, 0.0, height]))

    coarse, _ = largest_step(vehicle, at_height, np.linspace(0.13, 0.0, 131))
    fine, scale = largest_step(vehicle, at_height, np.linspace(0.13, 0.0, 1301))
    assert fine < 0.15 * coarse
    assert fine < 1e-2 * scale


def test_zero_speed_is_passed_smoothly(vehicle):
    """From 5 mm/s ahead to 5 mm/s astern relative to the water."""

    def at_speed(speed):
        return standing(vehicle, velocity=speed + Water(0.12, 0.5, 2.0).velocity)

    coarse, scale = largest_step(vehicle, at_speed, np.linspace(-5e-3, 5e-3, 41))
    assert coarse < 1e-3 * scale


# --- added mass -------------------------------------------------------------------------------------------------------


def matrices(vehicle, water, states):
    model = CoefficientHydrodynamics()
    model.start(vehicle, water, 1e-3)
    model.wrenches(states, lambda: states)
    return model.added_mass_matrices


def test_added_mass_is_the_published_one(boxy):
    """Box hull of draught T: strips of the double body; wheel: spheroid of its proportions on the displaced water."""
    added = matrices(boxy, WATER, standing(boxy))
    draught, beam, length = 0.042, 0.44, 1.0
    sway = np.interp(0.5 * beam / draught, [5.0, 10.0], [1.98, 2.23])
    heave = np.interp(2.0 * draught / beam, [0.1, 0.2], [1.14, 1.21])
    ends = np.interp(length / beam, [2.0, 2.5], [0.757, 0.801])
    assert added[0, 1, 1] == pytest.approx(0.5 * 1000.0 * sway * math.pi * draught**2 * length, rel=1e-9)
    heave_mass = 0.5 * 1000.0 * heave * ends * math.pi * (beam / 2) ** 2 * length
    assert added[0, 2, 2] == pytest.approx(heave_mass, rel=1e-9)
    assert added[0, 4, 4] == pytest.approx(heave_mass * length**2 / 12.0, rel=2e-2)  # twelve strips
    lever = 0.17 - 0.099
    assert added[0, 3, 3] == pytest.approx(heave_mass * 0.22**2 / 8.0 + added[0, 1, 1] * lever**2, rel=1e-9)
    rise = 0.1 - 0.12
    displaced = 1000.0 * 0.08 * (0.01 * math.acos(rise / 0.1) - rise * math.sqrt(0.01 - rise**2))
    in_plane, axial = spheroid_added_mass(0.4)
    np.testing.assert_allclose(
        added[1:, range(3), range(3)], [[displaced * k for k in (in_plane, axial, in_plane)]] * 4, rtol=1e-2
    )


def test_added_mass_is_symmetric_and_positive(vehicle):
    for seed in range(5):
        for matrix in matrices(vehicle, WATER, random_motion(vehicle, seed)):
            np.testing.assert_allclose(matrix, matrix.T, atol=1e-12)
            assert np.linalg.eigvalsh(matrix).min() > -1e-12


def test_spheroid_limits():
    """Sphere 1/2; disk 8/3 rho a^3 along its axis; needle 1 across and 0 along; 2:1 by Osborn (1945)."""
    assert spheroid_added_mass(1.0) == (0.5, 0.5)
    np.testing.assert_allclose(spheroid_added_mass(0.99), 0.5, atol=0.01)
    np.testing.assert_allclose(spheroid_added_mass(1.01), 0.5, atol=0.01)
    across, along = spheroid_added_mass(1e-4)
    assert along * 4.0 / 3.0 * math.pi * 1e-4 == pytest.approx(8.0 / 3.0, rel=1e-3)
    assert across < 1e-3
    across, along = spheroid_added_mass(100.0)
    assert across == pytest.approx(1.0, abs=2e-3)
    assert along < 2e-3
    demagnetizing = np.array([0.41322, 0.17356])  # the same integrals: k = N / (1 - N)
    np.testing.assert_allclose(spheroid_added_mass(2.0), demagnetizing / (1.0 - demagnetizing), atol=1e-4)


@pytest.mark.parametrize("ratio", [0.1, 1.0, 3.0, 10.0])
@pytest.mark.parametrize("macro_step", [1e-3, 2e-2])
def test_filter_is_stable_for_any_mass_ratio(ratio, macro_step):
    """m a = F - m_a a_f held over H: monotone to F / (m + m_a), the error falls as exp(-n / FILTER_STEPS) or faster."""
    decay = 1.0 - math.exp(-macro_step / filter_time(macro_step, ratio, 1.0))
    filtered, steps = 0.0, 20
    for _ in range(steps):
        acceleration = 1.0 - ratio * filtered
        before, filtered = filtered, filtered + decay * (acceleration - filtered)
        assert before < filtered <= 1.0 / (1.0 + ratio) + 1e-15
    error = 1.0 - filtered * (1.0 + ratio)
    assert 0.0 < error < math.exp(-steps / FILTER_STEPS)


def test_without_the_filter_a_heavy_added_mass_diverges():
    accelerations = [1.0]
    for _ in range(20):
        accelerations.append(1.0 - 3.0 * accelerations[-1])
    assert abs(accelerations[-1]) > 1e6


def test_filter_converges_with_the_first_order():
    """Speed gained by m = 1, m_a = 3 under F = sin(2 pi t) in 0.7 s, against F's impulse over m + m_a."""
    errors = []
    for macro_step in (4e-3, 2e-3, 1e-3):
        decay = 1.0 - math.exp(-macro_step / filter_time(macro_step, 3.0, 1.0))
        speed = filtered = 0.0
        for step in range(round(0.7 / macro_step)):
            acceleration = math.sin(2.0 * math.pi * (step + 0.5) * macro_step) - 3.0 * filtered
            speed += macro_step * acceleration
            filtered += decay * (acceleration - filtered)
        errors.append(abs(speed - (1.0 - math.cos(1.4 * math.pi)) / (2.0 * math.pi) / 4.0))
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all(orders > 0.85)
    assert np.all(orders < 1.15)


@pytest.mark.parametrize("macro_step", [1e-3, 2e-2])
def test_every_body_settles_at_its_total_mass(vehicle, macro_step):
    """All six components of the model itself, coupled: constant loads on five free bodies; 1e-3 of the largest."""
    model = CoefficientHydrodynamics()
    model.start(vehicle, WATER, macro_step)
    samples = round(macro_step / 1e-3)
    rest = standing(vehicle, n=samples + 1)
    at_rest = model.wrenches(rest[:1], None)
    added = model.added_mass_matrices
    hull, wheel, upright = vehicle.hull, vehicle.wheel, vehicle.suspension
    masses = np.empty((5, 6))
    masses[0] = [hull.mass] * 3 + list(np.diag(hull.inertia_tensor))
    masses[1:] = [wheel.mass + upright.upright_mass] * 3 + list(
        np.diag(wheel.inertia_tensor + upright.upright_inertia_tensor)
    )
    pushes = np.random.default_rng(0).normal(size=(5, 6)) * masses
    exact = np.array([np.linalg.solve(np.diag(m) + a, f) for m, a, f in zip(masses, added, pushes, strict=True)])
    acceleration = pushes / masses
    largest = 0.0
    for step in range(80):
        history = dataclasses.replace(
            rest,
            time=rest.time + step * macro_step,
            acceleration=np.broadcast_to(acceleration[:, :3], rest.acceleration.shape),
            angular_acceleration=np.broadcast_to(acceleration[:, 3:], rest.acceleration.shape),
        )
        acceleration = (pushes + model.wrenches(history, None) - at_rest) / masses
        largest = max(largest, np.abs(acceleration).max())
    np.testing.assert_allclose(acceleration, exact, atol=1e-3 * np.abs(exact).max())
    assert largest < 3.0 * np.abs(pushes / masses).max()


def test_still_water_at_rest_has_no_drag_and_no_added_mass(vehicle):
    parts = loads(vehicle, WATER, standing(vehicle, n=20))
    np.testing.assert_array_equal(parts[[DRAG, ADDED_MASS]], 0.0)
    assert parts[HYDROSTATIC, 0, 2] > 100.0


def test_steady_current_has_no_inertia_force(vehicle):
    parts = loads(vehicle, Water(0.12, 1.0), standing(vehicle, n=20))
    np.testing.assert_array_equal(parts[ADDED_MASS], 0.0)


# --- coupling ---------------------------------------------------------------------------------------------------------


def test_held_hydrostatics_do_not_pump_up_a_heaving_hull(boxy):
    """60 s of free heave at a 20 ms macro step, drag and added mass off: the amplitude stays within 1 %."""
    idle = Coefficients(hull_heave_drag=0.0)
    model = CoefficientHydrodynamics(idle, added_mass=False)
    macro_step, mass, water = 2e-2, boxy.hull.mass, Water(1.0)
    model.start(boxy, water, macro_step)
    afloat = 1.0 - mass / (1000.0 * 0.44) + (0.17 - 0.078)  # height of the centre of mass
    height, speed, heights = afloat + 0.02, 0.0, []
    for step in range(3000):
        states = standing(boxy, velocity=[0.0, 0.0, speed])
        position = states.position.copy()
        position[0, 0, 2] = height
        states = dataclasses.replace(states, position=position, time=states.time + step * macro_step)
        acceleration = model.wrenches(states, None)[0, 2] / mass - GRAVITY
        height += macro_step * speed + 0.5 * macro_step**2 * acceleration
        speed += macro_step * acceleration
        heights.append(height - afloat)
    assert max(np.abs(heights[-100:])) == pytest.approx(0.02, rel=1e-2)


def test_hydrostatics_are_those_half_a_step_ahead(vehicle):
    """Against the model's own hydrostatics at the state moved on by half of 2 ms; second order: 0.2 % of the change."""
    macro_step = 2e-3
    for seed in range(5):
        states = random_motion(vehicle, seed, speed=0.3)
        spin = Rotation.from_rotvec(0.5 * macro_step * states.angular_velocity[0]).as_matrix()
        ahead = standing(
            vehicle,
            position=states.position + 0.5 * macro_step * states.velocity,
            rotation=spin @ states.rotation[0],
        )
        now = loads(vehicle, WATER, dataclasses.replace(states, velocity=0 * states.velocity), 1e-9)[HYDROSTATIC]
        actual = loads(vehicle, WATER, states, macro_step)[HYDROSTATIC]
        expected = loads(vehicle, WATER, ahead, 1e-9)[HYDROSTATIC]
        assert np.abs(expected - now).max() > 0.1
        np.testing.assert_allclose(actual, expected, atol=2e-3 * np.abs(expected - now).max())


def driven(model, vehicle, steps, first=0):
    """Macro steps of 5 ms along a prescribed motion."""
    results = []
    for step in range(first, first + steps):
        time = 5e-3 * step + 1e-3 * np.arange(-5, 1)
        wave = np.sin(20.0 * time)[:, None, None]
        states = standing(
            vehicle,
            n=6,
            time=time,
            velocity=0.3 * wave,
            acceleration=wave * [1.0, 2.0, 3.0],
            angular_acceleration=wave * [3.0, 2.0, 1.0],
        )
        results.append(model.wrenches(states, None))
    return np.array(results)


def test_save_and_restore_repeat_the_run(vehicle):
    model = CoefficientHydrodynamics()
    model.start(vehicle, Water(0.12, 0.5), 5e-3)
    driven(model, vehicle, 10)
    saved = model.save()
    once = driven(model, vehicle, 10, first=10)
    model.restore(saved)
    np.testing.assert_array_equal(driven(model, vehicle, 10, first=10), once)
    assert len(model.record()["drag_load"].macro_time) == 20
    fresh = CoefficientHydrodynamics()
    fresh.start(vehicle, Water(0.12, 0.5), 5e-3)
    fresh.restore(saved)
    np.testing.assert_array_equal(driven(fresh, vehicle, 10, first=10), once)


def test_start_forgets_the_earlier_run(vehicle):
    model = CoefficientHydrodynamics()
    runs = []
    for _ in range(2):
        model.start(vehicle, Water(0.12, 0.5), 5e-3)
        runs.append(driven(model, vehicle, 10))
    np.testing.assert_array_equal(*runs)
    assert len(model.record()["drag_load"].macro_time) == 10


def test_samples_already_seen_are_not_used_twice(vehicle):
    short, long = CoefficientHydrodynamics(), CoefficientHydrodynamics()
    history = standing(vehicle, n=50, acceleration=np.linspace(0.0, 1.0, 50)[:, None, None])
    results = []
    for model, cut in ((short, 10), (long, 0)):
        model.start(vehicle, WATER, 1e-2)
        model.wrenches(history[:40], None)
        results.append(model.wrenches(history[40 - cut :], None))
    np.testing.assert_allclose(results[0], results[1], rtol=1e-12)
    assert np.abs(results[0][0, :2]).max() > 0.1


def test_record(vehicle):
    model = CoefficientHydrodynamics()
    model.start(vehicle, WATER, 5e-3)
    driven(model, vehicle, 3)
    record = model.record()
    assert set(record) == {"hydrostatic_load", "drag_load", "added_mass_load", "added_mass_filter_time"}
    for values in record.values():
        assert values.dims == ("macro_time", "body", "component")
        assert list(values.body.values) == list(BODIES)
        assert values.attrs["units"]
        assert values.attrs["long_name"]
    tau = record["added_mass_filter_time"].sel(body="hull", component="Fz").values[-1]
    assert tau == pytest.approx(FILTER_STEPS * 5e-3 * (1.0 + model.added_mass_matrices[0, 2, 2] / vehicle.hull.mass))


def test_options(vehicle):
    sunk = standing(vehicle)
    sunk = dataclasses.replace(sunk, position=sunk.position - [0.0, 0.0, 0.02])
    with_pores = loads(vehicle, WATER, sunk)[HYDROSTATIC]
    without = loads(vehicle, WATER, sunk, pore_pressure=False)[HYDROSTATIC]
    assert np.all(without[1:, 2] < with_pores[1:, 2])
    np.testing.assert_array_equal(without[0], with_pores[0])  # the hull hangs clear of the soil
    model = CoefficientHydrodynamics(added_mass=False)
    model.start(vehicle, WATER, 5e-3)
    driven(model, vehicle, 5)
    np.testing.assert_array_equal(model.record()["added_mass_load"], 0.0)


def test_dry_ground(vehicle):
    model = CoefficientHydrodynamics()
    model.start(vehicle, None, 1e-3)
    states = random_motion(vehicle, 0)
    np.testing.assert_array_equal(model.wrenches(states, None), NoWater().wrenches(states, None))
    assert model.record() == {}


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"hull_surge_drag": -1.0}, "hull_surge_drag"),
        ({"hull_heave_drag": math.nan}, "hull_heave_drag"),
        ({"hull_sway_drag": ((1.0, 2.0), (0.5, 1.0))}, "hull_sway_drag"),
        ({"section_added_mass": ((0.0, 1.0), (1.0, -1.0))}, "section_added_mass"),
        ({"wheel_added_mass": (0.2, -0.1)}, "wheel_added_mass"),
        ({"entry_draught": 0.0}, "entry_draught"),
    ],
)
def test_bad_coefficients_are_named(arguments, message):
    with pytest.raises(ValueError, match=message):
        Coefficients(**arguments)


def test_bad_macro_step_is_named(vehicle):
    with pytest.raises(ValueError, match="macro_step"):
        CoefficientHydrodynamics().start(vehicle, WATER, 0.0)
