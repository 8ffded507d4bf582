"""The multibody model against exact motions: equilibrium, free flight, constraints, restart, projection, order."""

import itertools
import math
from dataclasses import fields, replace

import numpy as np
import pytest
from scipy.optimize import fsolve

import exumob.multibody.system
from exumob.driving.maneuver import ConstantSteer, LaneChange
from exumob.ground.soil import Soil
from exumob.ground.terrain import Terrain
from exumob.multibody.applied_loads import stop_force
from exumob.multibody.system import MultibodyVehicle
from exumob.simulation.run import simulate
from exumob.support.constants import GRAVITY
from exumob.water.conditions import Water
from vehicle_models.light_4x4 import light_4x4

CALM = np.zeros((5, 6))
STILL = ConstantSteer(speed=0.0)
QUICK = LaneChange(amplitude=math.radians(20.0), start=0.4, end=1.4, ramp_time=0.4)
"""The lane change in a fifth of the time."""
TRUCK_TURN = LaneChange(amplitude=math.radians(20.0), start=0.5, end=2.0, ramp_time=0.5, speed=4.0)


def prepared(vehicle, soil, maneuver=QUICK, micro_step=5e-4, duration=2.0, load=CALM):
    model = MultibodyVehicle(vehicle, soil, maneuver, Terrain(), micro_step, duration)
    model.settle(lambda states: load)
    return model


def flat(states):
    return np.concatenate([np.ravel(getattr(states, field.name)) for field in fields(states)])


def same_bits(a, b):
    """Bit for bit, through the dicts, arrays and numbers of a saved state."""
    for field in fields(a):
        one, two = getattr(a, field.name), getattr(b, field.name)
        pairs = [(one[k], two[k]) for k in one] if isinstance(one, dict) else [(one, two)]
        for x, y in pairs:
            if np.asarray(x).tobytes() != np.asarray(y).tobytes():
                return False
    return True


# -- static equilibrium ------------------------------------------------------------------------------------------------

WATERS = {
    "dry": None,
    "D60/U0": Water.at_ratio(0.6),
    "D60/U1": Water.at_ratio(0.6, 1.0),
    "D100/U0": Water.at_ratio(1.0),
}


@pytest.fixture(scope="module")
def rest(vehicle):
    """Five seconds at rest on locked wheels, each case made once."""
    made = {}

    def run(soil, water="dry", terrain=None, duration=5.0):
        key = soil, water, str(terrain), duration
        if key not in made:
            made[key] = simulate(
                vehicle, Soil.published(soil), WATERS[water], STILL, "coefficients", duration=duration, micro_step=1e-3,
                macro_step=20e-3, terrain=terrain,
            )  # fmt: skip
        return made[key]

    return run


def imbalance(run):
    """Upward force of soil and water over the weight, less 1, at the start."""
    upward = float((run["soil_load"] + run["water_load"]).isel(time=0).sel(axis="z").sum())
    return upward / -float(run["gravity_load"].isel(time=0).sel(axis="z").sum()) - 1.0


@pytest.mark.parametrize(
    ("soil", "water"),
    [("LETE sand", "dry"), ("Sandy loam 15 %", "dry"), ("LETE sand", "D60/U0"), ("LETE sand", "D100/U0")],
)
def test_reactions_and_lift_sum_to_the_weight(rest, soil, water):
    """Spec: to 1e-6."""
    assert abs(imbalance(rest(soil, water))) < 1e-6


def test_reactions_and_lift_sum_to_the_weight_in_a_current(rest):
    """Spec: to 1e-6, in the default scenario too."""
    assert abs(imbalance(rest("LETE sand", "D60/U1"))) < 1e-6


@pytest.mark.parametrize("water", WATERS)
def test_equilibrium_is_symmetric(rest, water):
    """Left and right reactions agree to Newton's tolerance (1e-6 N of 140 N on a wheel), a head current included."""
    force = rest("LETE sand", water)["soil_force"].isel(time=0).values
    assert force[0::2, 2] == pytest.approx(force[1::2, 2], abs=1e-6)
    assert force[0::2, 1] == pytest.approx(-force[1::2, 1], abs=1e-6)


@pytest.mark.parametrize(
    ("soil", "water"),
    [("LETE sand", "dry"), ("Sandy loam 15 %", "dry"), ("LETE sand", "D60/U0"), ("LETE sand", "D100/U0")],
)
def test_no_drift_at_rest(rest, soil, water):
    """Over 5 s no body moves by more than 1 um: a spring compression of 4 mN, 1e-5 of the weight."""
    position = rest(soil, water)["position"].values
    assert np.abs(position - position[0]).max() < 1e-6
    assert np.abs(rest(soil, water)["yaw"].values).max() < 1e-6


def test_creep_in_a_current_is_bounded(rest):
    """Shear regularised at standstill creeps under the drag; below 1 mm/s it does not matter to an 8 s run (5 m)."""
    x = rest("LETE sand", "D60/U1")["position"].sel(body="hull", axis="x").values
    assert -5e-3 < x[-1] - x[0] < 0.0


@pytest.mark.parametrize("direction", [0.0, math.pi / 2, math.pi])
def test_stands_on_a_slope_with_bounded_creep(rest, direction):
    """On 5 degrees LETE sand holds (friction 31 degrees): it creeps downhill, at a bounded rate below 2 mm/s.

    The wheels carry the component of weight along the slope (2 %: the creep's start).
    """
    run = rest("LETE sand", terrain=Terrain.slope(math.radians(5.0), direction))
    uphill = np.array([math.cos(direction), math.sin(direction), 0.0])
    path = (run["position"].sel(body="hull").values - run["position"].sel(body="hull").values[0]) @ uphill
    assert -10e-3 < path[-1] < 0.0
    rates = np.diff(path[100::100])
    assert rates == pytest.approx(rates[-1], rel=0.05)  # creep, not a growing slide
    normal = run["soil_force"].isel(time=-1).sum("wheel").values
    assert normal == pytest.approx([0.0, 0.0, 57.0 * GRAVITY], abs=1e-3 * 57.0 * GRAVITY)


def test_stands_and_drives_on_a_height_field(vehicle, sand):
    """Waves of 2 cm: the run completes, the wheels follow the ground, wheel loads average to the weight."""
    x, y = np.arange(-2.0, 8.0, 0.25), np.arange(-2.0, 3.0, 0.25)
    hills = Terrain(
        heights=0.02 * np.sin(2 * x)[None, :] + 0.01 * np.cos(3 * y)[:, None], origin=(-2.0, -2.0), spacing=0.25
    )
    run = simulate(vehicle, sand, None, QUICK, duration=2.0, micro_step=5e-4, macro_step=20e-3, terrain=hills)
    assert run.attrs["status"] == "completed"
    assert float(run["position"].sel(body="hull", axis="x")[-1] - run["position"].sel(body="hull", axis="x")[0]) > 1.0
    assert float(run["soil_load"].sel(axis="z").sum("body").mean()) == pytest.approx(57.0 * GRAVITY, rel=0.02)
    for i, wheel in enumerate(run["wheel"].values):
        centers = run["position"].sel(body=wheel).values[::20]
        for center, sinkage in zip(centers, run["sinkage"].values[::20, i], strict=True):
            height, normal = hills.height_and_normal(*center[:2])
            assert 0.1 - (center[2] - height) * normal[2] == pytest.approx(sinkage, abs=1e-9)


# -- ballistics --------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def flight(vehicle, sand):
    """Lifted 0.5 m above the ground and thrown forward at 1 m/s: no contact for 0.3 s. Records of the model."""
    model = prepared(vehicle, sand, STILL, duration=0.3)
    saved = model.save()
    coordinates = {k: v.copy() for k, v in saved.coordinates.items()}
    coordinates["ODE2Coords"].reshape(9, 7)[:, 2] += 0.5
    coordinates["ODE2Coords_t"].reshape(9, 7)[:, 0] = 1.0
    model.restore(replace(saved, coordinates=coordinates, samples=0, rows=0))
    start = model.present()
    model.advance(0.3, CALM)
    return start, model.records.copy()


BODY_MASS = np.array([49.0, 2.0, 2.0, 2.0, 2.0])


def test_center_of_mass_flies_a_parabola(flight):
    """Internal forces cancel, so the centre of mass falls by g t^2/2 whatever springs and dampers do.

    The integration starts from the acceleration at rest and needs a few steps to find g: an error of the velocity of
    about g times one micro step, 5e-3 m/s, and 1.5e-3 m after 0.3 s.
    """
    start, records = flight
    time = records["motion"]["time"]
    center = np.einsum("b,nbk->nk", BODY_MASS, records["motion"]["position"]) / 57.0
    origin = np.einsum("b,bk->k", BODY_MASS, start.position[0]) / 57.0
    assert center[:, 0] == pytest.approx(origin[0] + time, abs=1e-6)
    assert center[:, 1] == pytest.approx(0.0, abs=1e-9)
    assert center[:, 2] == pytest.approx(origin[2] - 0.5 * GRAVITY * time**2, abs=1.5e-3)
    acceleration = np.einsum("b,nbk->nk", BODY_MASS, records["motion"]["acceleration"]) / 57.0
    assert acceleration[2:] == pytest.approx(np.tile([0.0, 0.0, -GRAVITY], (len(time) - 2, 1)), abs=1e-3 * GRAVITY)


def test_no_soil_force_in_the_air(flight):
    _, records = flight
    assert not records["loads"]["soil_force"].any()
    assert not records["loads"]["soil_moment"].any()


def test_flight_loses_only_what_the_dampers_take(flight):
    """Kinetic and stored energy change by the dampers' work: 0.05 J, 1 % of what is set free."""
    _, records = flight
    loads = records["loads"]
    energy = loads["kinetic_energy"] + loads["spring_energy"] + loads["gravity_energy"]
    damper = records["energy_account"]["work"][:, 1]
    assert damper[-1] < -1.0
    assert (energy - energy[2]) == pytest.approx(damper - damper[2], abs=0.05)


def test_straight_flight_does_not_turn(flight):
    _, records = flight
    assert np.abs(records["motion"]["rotation"][..., 1, 0]).max() < 1e-9


# -- constraints -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("run", ["dry_run", "wet_run"])
def test_constraint_errors_over_the_whole_run(run, request):
    """1e-6 m or rad at position level, 1e-4 rad/s at velocity level (1e-5 of the wheel speed)."""
    error = request.getfixturevalue(run)["constraint_error"]
    assert float(error.sel(constraint_level="position").max()) < 1e-6
    assert float(error.sel(constraint_level="velocity").max()) < 1e-4


def test_steering_and_spin_follow_the_command(dry_run):
    """Measured on the bodies themselves, not on the solver's residuals: angle 1e-6 rad, speed 1e-4 rad/s."""
    maneuver = LaneChange()
    rotation = matrices(dry_run["quaternion"].values)
    for n, t in enumerate(dry_run["time"].values):
        angle, speed = maneuver.steering(t)[0], maneuver.wheel_speed(t)[0]
        for i in range(4):
            relative = rotation[n, 0].T @ rotation[n, 1 + i]
            assert math.atan2(relative[1, 0], relative[0, 0]) == pytest.approx(angle if i < 2 else 0.0, abs=1e-6)
            assert relative[2, 2] == pytest.approx(1.0, abs=1e-9)
        assert dry_run["wheel_speed"].values[n] == pytest.approx(speed, abs=1e-4)


def test_pillars_keep_the_wheels_in_place(dry_run, vehicle):
    """In the hull's axes a wheel centre moves along z only: 1e-6 m."""
    rotation, position = matrices(dry_run["quaternion"].values)[:, 0], dry_run["position"].values
    arms = np.einsum("nji,nbj->nbi", rotation, position[:, 1:] - position[:, :1])
    expected = vehicle.wheel_centers - vehicle.hull_origin
    assert np.abs(arms - expected)[..., :2].max() < 1e-6
    assert arms[..., 2] - expected[:, 2] == pytest.approx(dry_run["suspension_stroke"].values, abs=1e-9)


def matrices(quaternion):
    w, x, y, z = np.moveaxis(quaternion, -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


# -- restart, repetition, macro steps ----------------------------------------------------------------------------------

CASES = ["sliding pillars", "double wishbones"]


def make(case, vehicle, sand):
    return prepared(vehicle, sand) if case == CASES[0] else prepared(light_4x4(), sand, TRUCK_TURN)


@pytest.mark.parametrize("case", CASES)
def test_restored_run_is_bit_identical(case, vehicle, sand):
    """Saved at 0.5 s (steering), run to 0.8 s; repeated from the saved state in the same and in another model."""
    model = make(case, vehicle, sand)
    model.advance(0.5, CALM)
    saved = model.save()
    model.advance(0.8, CALM)
    first = model.save()
    model.restore(saved)
    assert same_bits(model.save(), saved)
    model.advance(0.8, CALM)
    assert same_bits(model.save(), first)
    other = make(case, vehicle, sand)
    other.advance(0.1, CALM)  # somewhere else
    other.restore(saved)
    other.advance(0.8, CALM)
    assert same_bits(other.save(), first)


@pytest.mark.parametrize("case", CASES)
def test_restores_into_a_model_that_never_settled(case, vehicle, sand):
    """save(): "any equal model"; a checkpoint is of no use if it first needs the equilibrium."""
    model = make(case, vehicle, sand)
    model.advance(0.5, CALM)
    saved = model.save()
    fresh = MultibodyVehicle(model.vehicle, sand, model.maneuver, Terrain(), 5e-4, 2.0)
    fresh.restore(saved)
    fresh.advance(0.6, CALM)
    model.restore(saved)
    model.advance(0.6, CALM)
    assert same_bits(fresh.save(), model.save())


def test_run_saved_and_restored_half_way_equals_a_single_run(vehicle, sand):
    single = prepared(vehicle, sand)
    single.advance(0.8, CALM)
    broken = prepared(vehicle, sand)
    broken.advance(0.5, CALM)
    saved = broken.save()
    broken.restore(saved)
    broken.advance(0.8, CALM)
    one, two = single.present(), broken.present()
    for name in ("position", "rotation", "velocity"):
        assert getattr(two, name) == pytest.approx(getattr(one, name), abs=1e-8), name


def test_light_save_repeats_a_macro_step(vehicle, sand):
    """Without histories, for a strongly coupled macro step: the second try forgets the first."""
    model = prepared(vehicle, sand)
    model.advance(0.5, CALM)
    saved = model.save(histories=False)
    push = CALM.copy()
    push[0, 1] = 50.0
    model.advance(0.52, CALM)
    first = model.save()
    model.restore(saved)
    model.advance(0.52, push)
    assert not same_bits(model.save(), first)
    model.restore(saved)
    model.advance(0.52, CALM)
    assert same_bits(model.save(), first)


def test_repeated_runs_are_bit_identical(vehicle, sand):
    steps = {"duration": 0.6, "micro_step": 5e-4, "macro_step": 20e-3}
    one, two = (simulate(vehicle, sand, Water.at_ratio(0.6, 1.0), QUICK, **steps) for _ in range(2))
    for name in one.data_vars:
        assert one[name].values.tobytes() == two[name].values.tobytes(), name


@pytest.mark.parametrize("macro_step", [20e-3, 1e-3])
def test_macro_steps_equal_a_single_advance(vehicle, sand, macro_step):
    """Without water a macro step is only a pause: Newton's tolerance of 1e-5 leaves about 2e-8 m.

    Allowed: 1e-7 m and rad, 1e-6 m/s; a loop that loses a step or a load is off by 1e-4 and more.
    """
    single, paused = prepared(vehicle, sand), prepared(vehicle, sand)
    single.advance(0.6, CALM)
    for n in range(round(0.6 / macro_step)):
        paused.advance((n + 1) * macro_step, CALM)
    one, two = single.present(), paused.present()
    for name in ("position", "rotation", "velocity"):
        allowed = 1e-6 if name == "velocity" else 1e-7
        assert getattr(two, name) == pytest.approx(getattr(one, name), abs=allowed), name
    assert paused.time == pytest.approx(0.6, abs=1e-12)


def test_history_is_sampled_every_millisecond(vehicle, sand):
    model = prepared(vehicle, sand, micro_step=2.5e-4)
    model.advance(0.05, CALM)
    assert model.history.time == pytest.approx(np.arange(51) * 1e-3, abs=1e-12)
    assert flat(model.history[-1:]) == pytest.approx(flat(model.present()), abs=0.0)


# -- order of convergence ----------------------------------------------------------------------------------------------


def test_order_of_convergence_in_the_micro_step(vehicle, sand, monkeypatch):
    """Generalized-alpha is of order 2: differences of successive halvings shrink fourfold (order >= 1.7 asked).

    Newton's tolerances are tightened so that they do not hide it: as shipped they leave 1e-6 m, see the next test.
    """
    settings = exumob.multibody.system.integration_settings

    def tight(*arguments, **options):
        chosen = settings(*arguments, **options)
        newton = chosen.timeIntegration.newton
        newton.relativeTolerance, newton.absoluteTolerance = 1e-9, 1e-10
        return chosen

    monkeypatch.setattr(exumob.multibody.system, "integration_settings", tight)
    brisk = LaneChange(start=0.1, end=0.4, ramp_time=0.15)
    ends = []
    for step in (1e-3, 5e-4, 2.5e-4, 1.25e-4):
        model = prepared(vehicle, sand, brisk, step, 0.5)
        model.advance(0.5, CALM)
        ends.append(model.present())
    for name in ("position", "rotation", "velocity"):
        values = [getattr(end, name) for end in ends]
        changes = [np.abs(b - a).max() for a, b in itertools.pairwise(values)]
        orders = np.log2(np.array(changes[:-1]) / changes[1:])
        assert orders.min() >= 1.7, f"{name}: {orders}"


def test_path_does_not_depend_on_the_micro_step(vehicle, sand):
    """As shipped, 1 ms and 0.25 ms agree to 1e-5 m after 1 m (QUICK): far below what soil parameters are known to."""
    ends = []
    for step in (1e-3, 2.5e-4):
        model = prepared(vehicle, sand, QUICK, step, 1.5)
        model.advance(1.5, CALM)
        ends.append(model.present().position)
    assert ends[0] == pytest.approx(ends[1], abs=1e-5)


# -- extrapolation and projection --------------------------------------------------------------------------------------


@pytest.mark.parametrize(("case", "step"), [(CASES[0], 1e-3), (CASES[1], 20e-3)])
def test_predict_leaves_the_state_alone(case, step, vehicle, sand):
    model = make(case, vehicle, sand)
    model.advance(0.7, CALM)
    before = model.save()
    model.predict(step)
    assert same_bits(model.save(), before)
    model.advance(0.75, CALM)
    after = model.save()
    model.restore(before)
    model.advance(0.75, CALM)
    assert same_bits(model.save(), after)


@pytest.mark.parametrize("step", [1e-3, 20e-3])
def test_predicted_positions_and_spin_meet_the_constraints(vehicle, sand, step):
    """Before the steering begins (0.35 s), from the bodies' own motion, at round-off (1e-11)."""
    model = prepared(vehicle, sand)
    model.advance(0.35, CALM)
    check_constraints(vehicle, model.predict(step), 0.35 + step)


@pytest.mark.parametrize("step", [1e-3, 20e-3])
def test_predicted_state_meets_the_constraints(vehicle, sand, step):
    """From the bodies' own motion: pillars, steering angle and spin, positions and velocities, at round-off (1e-11)."""
    model = prepared(vehicle, sand)
    model.advance(0.7, CALM)
    check_constraints(vehicle, model.predict(step), 0.7 + step)


def check_constraints(vehicle, state, time):
    assert state.time == pytest.approx([time], abs=1e-12)
    angle, rate, _ = QUICK.steering(time)
    hull, origin = state.rotation[0, 0], state.position[0, 0]
    spin = state.angular_velocity[0, 0]
    for i in range(4):
        arm = state.position[0, 1 + i] - origin
        local = hull.T @ arm - (vehicle.wheel_centers - vehicle.hull_origin)[i]
        assert local[:2] == pytest.approx([0.0, 0.0], abs=1e-11)
        relative = hull.T @ state.rotation[0, 1 + i]
        assert math.atan2(relative[1, 0], relative[0, 0]) == pytest.approx(angle if i < 2 else 0.0, abs=1e-11)
        sliding = hull.T @ (state.velocity[0, 1 + i] - state.velocity[0, 0] - np.cross(spin, arm))
        assert sliding[:2] == pytest.approx([0.0, 0.0], abs=1e-10)
        turning = hull.T @ (state.angular_velocity[0, 1 + i] - spin)
        assert turning == pytest.approx([0.0, 0.0, rate if i < 2 else 0.0], abs=1e-10)
    assert state.wheel_speed[0] == pytest.approx(QUICK.wheel_speed(time)[0], abs=1e-10)


@pytest.mark.parametrize("step", [1e-3, 20e-3])
def test_predicted_wishbones_keep_their_rods(sand, step):
    """Lengths of all sixteen rods, rebuilt from the predicted bodies, at round-off (1e-11 m)."""
    truck = light_4x4()
    model = prepared(truck, sand, TRUCK_TURN)
    model.advance(0.9, CALM)
    assert rod_errors(truck, model.predict(step)).max() < 1e-11


def rod_errors(vehicle, states):
    """Distance of ball joint and pivot less the rod's length [m], for all rods and instants."""
    arms = vehicle.suspension.wishbones
    errors = []
    for i, center in enumerate(vehicle.wheel_centers - vehicle.hull_origin):
        side = math.copysign(1.0, center[1])
        for length, height, drop in (
            (arms.upper_length, arms.upper_height, arms.upper_pivot_drop), (arms.lower_length, -arms.lower_height, 0.0)
        ):  # fmt: skip
            ball = np.array([0.0, -side * arms.ball_joint_inset, height])
            for x in (0.5 * arms.pivot_spread, -0.5 * arms.pivot_spread):
                pivot = center + ball + [x, -side * math.sqrt(length**2 - drop**2), -drop]
                outer = states.position[:, 1 + i] + states.rotation[:, 1 + i] @ ball
                inner = states.position[:, 0] + states.rotation[:, 0] @ pivot
                errors.append(np.linalg.norm(outer - inner, axis=-1) - math.hypot(length, x))
    return np.abs(errors)


def test_extrapolation_error_while_steering(vehicle, sand):
    check_extrapolation(prepared(vehicle, sand, micro_step=2.5e-4), 0.7)


def test_extrapolation_error_falls_with_its_order(vehicle, sand):
    """q + h v + h^2/2 a is of order 3, v + h a of order 2 in a smooth motion; at least 2 asked of both."""
    check_extrapolation(prepared(vehicle, sand, micro_step=2.5e-4), 0.2)


def check_extrapolation(model, now):
    model.advance(now, CALM)
    steps = (4e-3, 8e-3, 16e-3)
    predicted = [model.predict(step) for step in steps]
    errors = {"position": [], "velocity": []}
    for step, guess in zip(steps, predicted, strict=True):
        model.advance(now + step, CALM)
        true = model.present()
        for name, series in errors.items():
            series.append(np.abs(getattr(guess, name) - getattr(true, name)).max())
    for name, asked in (("position", 2.0), ("velocity", 1.7)):
        orders = np.log2(np.array(errors[name][1:]) / errors[name][:-1])
        assert orders.min() >= asked, f"{name}: orders {orders}, errors {errors[name]}"


# -- double wishbone ---------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def truck_run(sand):
    truck = light_4x4()
    return simulate(truck, sand, None, TRUCK_TURN, duration=2.5, micro_step=5e-4, macro_step=20e-3)


def test_wishbone_vehicle_stands_at_ride_height(truck_run):
    """The springs are preloaded for the static load: stroke 0 to 1e-3 of the travel (90 mm), level to 1e-4 rad."""
    assert np.abs(truck_run["suspension_stroke"].isel(time=0)).max() < 9e-5
    assert np.abs(truck_run["pitch"].isel(time=0)).max() < 2e-3  # the wheels of the heavier axle sink in deeper
    assert np.abs(truck_run["roll"].isel(time=0).sel(body="hull")).max() < 1e-6


def test_wishbone_constraint_errors(truck_run):
    error = truck_run["constraint_error"]
    assert float(error.sel(constraint_level="position").max()) < 1e-6
    assert float(error.sel(constraint_level="velocity").max()) < 1e-4


def test_ackermann_angles_reach_the_wheels(truck_run):
    """Heading of each front wheel in the hull against the vehicle's own function: camber changes it by 1e-3 at most."""
    truck = light_4x4()
    n = int(np.argmin(np.abs(truck_run["time"].values - 0.875)))  # the first peak
    expected = [a[0] for a in truck.steering_angles(TRUCK_TURN.steering(float(truck_run["time"][n])))]
    assert expected[0] - expected[1] > 0.02
    assert truck_run["steering_angle"].values[n] == pytest.approx(expected, abs=1e-9)
    rotation = matrices(truck_run["quaternion"].values[n])
    for i in range(2):
        relative = rotation[0].T @ rotation[1 + i]
        assert math.atan2(relative[1, 0], relative[0, 0]) == pytest.approx(expected[i], abs=2e-3)


@pytest.mark.parametrize("push", [2000.0, -2000.0])
def test_camber_follows_the_linkage(sand, push):
    """Pressed down (bump) the wheel's top leans inboard, in rebound outboard; 1e-4 rad of the planar linkage."""
    truck = light_4x4()
    load = CALM.copy()
    load[0, 2] = -push
    model = prepared(truck, sand, STILL, load=load)
    states = model.present()
    stroke = float((states.rotation[0, 0].T @ (states.position[0, 1] - states.position[0, 0]))[2]) - float(
        (truck.wheel_centers - truck.hull_origin)[0, 2]
    )
    assert stroke * push > 0.0
    assert abs(stroke) > 0.01
    arms = truck.suspension.wishbones
    reach = math.sqrt(arms.upper_length**2 - arms.upper_pivot_drop**2)

    def closure(unknown):
        y, lean = unknown  # of the wheel centre, and of the upright (top outward)
        c, s = math.cos(lean), math.sin(lean)
        residuals = []
        for length, height, pivot_y, pivot_z in (
            (arms.upper_length, arms.upper_height, -reach, arms.upper_height - arms.upper_pivot_drop),
            (arms.lower_length, -arms.lower_height, -arms.lower_length, -arms.lower_height),
        ):
            inset = -arms.ball_joint_inset
            ball_y, ball_z = y + c * inset + s * height, stroke - s * inset + c * height
            residuals.append(math.hypot(ball_y - inset - pivot_y, ball_z - pivot_z) - length)
        return residuals

    expected = fsolve(closure, [0.0, 0.0])[1]
    lean = math.asin((states.rotation[0, 0].T @ states.rotation[0, 1])[1, 2])
    assert lean == pytest.approx(expected, abs=1e-4)
    assert lean * push < 0.0


# -- bump stops --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("penetration", [-1e-3, 0.0, 5e-4, 2e-3, 2.5e-3, 1e-2])
def test_energy_of_a_stop_is_the_integral_of_its_force(penetration):
    """Gauss-Legendre over both pieces is exact for quadratics: relative 1e-12."""
    stiffness, softening = 5e4, 2e-3
    x, w = np.polynomial.legendre.leggauss(3)
    energy = 0.0
    for low, high in ((0.0, min(max(penetration, 0.0), softening)), (softening, max(penetration, softening))):
        half = 0.5 * (high - low)
        energy += half * sum(w[i] * stop_force(low + half * (1 + x[i]), stiffness, softening)[0] for i in range(3))
    assert stop_force(penetration, stiffness, softening)[1] == pytest.approx(energy, rel=1e-12, abs=1e-15)


def test_stop_force_is_smooth_and_reaches_its_stiffness():
    force = [stop_force(x, 5e4, 2e-3)[0] for x in (2e-3 - 1e-9, 2e-3 + 1e-9, 5e-3, 6e-3)]
    assert force[1] - force[0] == pytest.approx(5e4 * 2e-9, rel=1e-2)
    assert force[3] - force[2] == pytest.approx(5e4 * 1e-3, rel=1e-9)
    assert stop_force(-1.0, 5e4, 2e-3) == (0.0, 0.0)


def test_stops_limit_the_travel(vehicle, sand):
    """1.5 kN pressed on the hull: beyond the springs' 20 mm the stops carry the rest, some 5 mm in."""
    load = CALM.copy()
    load[0, 2] = -1500.0
    stroke = prepared(vehicle, sand, STILL, load=load).loads["stroke"][0]
    for value in stroke:
        force = 4350.0 * value + stop_force(value - 0.020, 5e4, 2e-3)[0]
        assert force == pytest.approx(375.0, rel=1e-3)
        assert 0.020 < value < 0.030
