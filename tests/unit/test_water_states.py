"""States of Eq. (7): angles, wrapping, the start, symmetry."""

import math

import numpy as np
import pytest

from exumob.vehicle.motion import BodyStates
from exumob.water.conditions import Water
from exumob.water.flow_states import FLOW_STATE_UNITS, FLOW_STATES, flow_states


def turn(yaw, pitch=0.0):
    cos, sin = math.cos(yaw), math.sin(yaw)
    about_z = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    cos, sin = math.cos(pitch), math.sin(pitch)
    return about_z @ np.array([[cos, 0.0, sin], [0.0, 1.0, 0.0], [-sin, 0.0, cos]])


def moving(rotation, velocity, n=1):
    """All five bodies alike."""
    zeros = np.zeros((n, 5, 3))
    rotations = np.broadcast_to(rotation, (n, 5, 3, 3))
    velocities = np.broadcast_to(np.asarray(velocity, dtype=float), (n, 5, 3))
    return BodyStates(np.arange(n) * 1e-3, zeros, rotations, velocities, zeros, zeros, zeros, np.zeros((n, 4)))


def state(yaw, velocity, water=None, pitch=0.0):
    return flow_states(moving(turn(yaw, pitch), velocity), water)[0, 0]


def test_columns():
    columns = flow_states(moving(np.eye(3), [1.0, 1.0, 3.0], n=3), Water(0.12, 0.5))
    assert columns.shape == (3, 5, 5)
    assert len(FLOW_STATES) == len(FLOW_STATE_UNITS) == 5
    np.testing.assert_allclose(columns[2, 4], [math.pi / 4, 0.0, math.sqrt(2.0), 0.5, 0.12], atol=1e-15)


@pytest.mark.parametrize(
    ("yaw", "direction", "beta"),
    [
        (0.0, math.pi, 0.0),  # head current
        (0.0, 0.0, math.pi),  # following current
        (math.pi / 2, math.pi, math.pi / 2),  # heading to the left of upstream
        (-math.pi / 2, math.pi, -math.pi / 2),
        (3.0, -3.0, 6.0 - math.pi),
    ],
)
def test_angle_of_attack(yaw, direction, beta):
    for speed in (0.0, 1.0):  # defined by direction even in calm water
        assert state(yaw, [1.0, 0.0, 0.0], Water(0.1, speed, direction))[1] == pytest.approx(beta, abs=1e-12)


def test_angles_stay_in_range():
    for yaw in np.linspace(-20.0, 20.0, 401):
        alpha, beta = state(yaw, [-1.0, 0.3, 0.0], Water(0.1, 1.0, 0.7))[:2]
        assert -math.pi < alpha <= math.pi
        assert -math.pi < beta <= math.pi


def test_no_water_has_no_water_states():
    np.testing.assert_array_equal(state(0.3, [1.0, 0.0, 0.0])[[1, 3, 4]], 0.0)


def test_sideslip_is_zero_at_rest_and_fades_in():
    speeds = np.linspace(0.0, 0.02, 2001)
    alphas = np.array([state(0.0, [0.0, speed, 0.0])[0] for speed in speeds])
    assert np.all(alphas[speeds <= 1e-3] == 0.0)
    np.testing.assert_allclose(alphas[speeds >= 1e-2], math.pi / 2)
    assert np.abs(np.diff(alphas)).max() < 0.01  # no jump: 1e-5 m/s a step


def test_reverse_is_pi():
    assert state(0.4, turn(0.4) @ [-1.0, 0.0, 0.0])[0] == pytest.approx(math.pi, abs=1e-12)


def test_the_same_seen_from_a_turned_world():
    here = state(0.3, [1.0, 0.2, 0.0], Water(0.1, 1.0, 2.0))
    there = state(0.3 + 1.1, turn(1.1) @ [1.0, 0.2, 0.0], Water(0.1, 1.0, 2.0 + 1.1))
    np.testing.assert_allclose(here, there, atol=1e-14)


def test_mirror_flips_the_angles():
    left = state(0.3, [1.0, 0.5, 0.0], Water(0.1, 1.0, 2.0))
    right = state(-0.3, [1.0, -0.5, 0.0], Water(0.1, 1.0, -2.0))
    np.testing.assert_allclose(left * [-1.0, -1.0, 1.0, 1.0, 1.0], right, atol=1e-14)


def test_pitch_and_heave_do_not_count():
    level = state(0.3, [1.0, 0.2, 0.0], Water(0.1, 1.0))
    np.testing.assert_allclose(state(0.3, [1.0, 0.2, 0.7], Water(0.1, 1.0), pitch=0.3), level, atol=1e-14)
