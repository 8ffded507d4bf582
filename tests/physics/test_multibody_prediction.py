"""States predicted over a macro step: they meet the constraints, err by the order they promise, change nothing."""

import math

import numpy as np
import pytest
from multibody_models import CALM, CASES, QUICK, TRUCK_TURN, make, prepared, same_bits

from vehicle_models.light_4x4 import light_4x4


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
