"""Forces of the user's own act where they say, do the work that they say, and are named when they fail."""

import math

import numpy as np
import pytest

from exumob.driving.maneuver import ConstantSteer
from exumob.ground.terrain import Terrain
from exumob.multibody.system import MultibodyVehicle
from exumob.simulation.run import simulate
from exumob.simulation.summary import energy_residual
from exumob.support.errors import SimulationError
from exumob.vehicle.point_force import PointForce

STILL = ConstantSteer(speed=0.0)
LIFT = 100.0


def pull(time, position, velocity):
    rope = np.array([6.0, 1.0, 0.4]) - position
    length = np.linalg.norm(rope)
    return 100.0 * max(length - 4.0, 0.0) * rope / length - 20.0 * velocity


def lifted(time, position, velocity):
    return 0.0, 0.0, LIFT


@pytest.mark.parametrize("body", ["hull", "rear_left"])
def test_a_steady_lift_takes_weight_off_the_wheels(body, vehicle, sand):
    """Vertical forces balance, and so do the moments about the point under the lift."""
    place = vehicle.hull_origin if body == "hull" else vehicle.wheel_centers[2]
    run = simulate(
        vehicle, sand, None, STILL, duration=0.1, forces=[PointForce(lifted, tuple(place), body)], record_step=0.02
    )
    carried = run["soil_force"].sel(axis="z").isel(time=0).values
    assert carried.sum() == pytest.approx(vehicle.mass * 9.81 - LIFT, abs=1e-3)
    bare = simulate(vehicle, sand, None, STILL, duration=0.1, record_step=0.02)["soil_force"].sel(axis="z").isel(time=0)
    relief = bare.values - carried
    if body == "hull":
        assert relief[0] == pytest.approx(relief[1], abs=1e-3)
        assert relief[2] == pytest.approx(relief[3], abs=1e-3)
    else:
        assert relief.argmax() == 2


def towed(vehicle, sand, forces, user_loads=False):
    model = MultibodyVehicle(vehicle, sand, STILL, Terrain(), 1e-3, 0.5, user_loads=user_loads, forces=forces)
    model.settle(lambda states: np.zeros((5, 6)))
    model.advance(0.5, np.zeros((5, 6)))
    return model


def test_a_rope_acts_alike_on_both_paths(vehicle, sand):
    """Each carries the rope's force at its point, leans on it by the same, and neither is a run without it."""
    rope = [PointForce(pull, (0.5, 0.1, 0.2))]
    bare = towed(vehicle, sand, ()).present().position
    both = [towed(vehicle, sand, rope, user_loads) for user_loads in (False, True)]
    for model in both:
        position, rotation = model.present().position[0, 0], model.present().rotation[0, 0]
        arm = rotation @ (np.array([0.5, 0.1, 0.2]) - vehicle.hull_origin)
        velocity = model.present().velocity[0, 0] + np.cross(model.present().angular_velocity[0, 0], arm)
        wrench = model.loads[0]["point_wrench"][0]
        assert wrench[:3] == pytest.approx(pull(0.5, position + arm, velocity), abs=1e-6)
        assert wrench[3:] == pytest.approx(np.cross(arm, wrench[:3]), abs=1e-6)
        assert np.abs(model.present().position - bare).max() > 1e-4
    assert np.abs(both[0].present().position - both[1].present().position).max() < 1e-8


def test_work_of_a_tow_is_accounted(vehicle, sand):
    """The energy account closes with the rope's work in it, and the rope does a good part of the work."""
    run = simulate(
        vehicle, sand, None, ConstantSteer(speed=1.0), duration=1.5, forces=[PointForce(pull, (0.5, 0.1, 0.2))]
    )
    work = float(run["work"].sel(work_kind="point forces")[-1])
    assert abs(work) > 5.0
    assert np.abs(energy_residual(run)).max() < 1e-2 * abs(work)


def broken(time, position, velocity):
    raise RuntimeError("no rope")


@pytest.mark.parametrize(
    ("force", "message"),
    [
        (broken, "PointForce.force on the hull: RuntimeError at 0.0000 s: no rope"),
        (lambda t, x, v: (1.0, 2.0), "return three finite numbers"),
        (lambda t, x, v: (1.0, math.nan, 2.0), "return three finite numbers"),
        (lambda t, x, v: "up", "could not convert"),
    ],
)
def test_failing_functions_are_named(force, message, vehicle, sand):
    with pytest.raises(SimulationError, match=message):
        simulate(vehicle, sand, None, STILL, duration=0.02, forces=[PointForce(force)])


def test_bad_descriptions_are_refused(vehicle, sand):
    with pytest.raises(ValueError, match="body"):
        PointForce(lifted, body="roof")
    with pytest.raises(ValueError, match="point"):
        PointForce(lifted, point=(1.0, 2.0))
    with pytest.raises((TypeError, ValueError), match="force"):
        PointForce("up")
    with pytest.raises((TypeError, ValueError), match="forces"):
        simulate(vehicle, sand, forces=[lifted])
