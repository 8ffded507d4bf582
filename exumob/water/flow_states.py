"""The state of a body in the water, Eq. (7) of the paper: y = [alpha, beta, V, U_w, D_w]."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from exumob.support.arrays import Array
from exumob.support.kernels import njit
from exumob.vehicle.motion import BodyStates
from exumob.water.conditions import Water

FLOW_STATES = ("sideslip_angle", "angle_of_attack", "speed", "current_speed", "water_depth")
"""Names of the five quantities alpha, beta, V, U_w, D_w of Eq. (7)."""

FLOW_STATE_UNITS = ("rad", "rad", "m/s", "m/s", "m")

REST_SPEED = 1.0e-3
"""Below this horizontal speed the sideslip angle is 0 [m/s]."""

MOVING_SPEED = 1.0e-2
"""From this horizontal speed on the sideslip angle is the full angle [m/s]."""


class HorizontalMotion(NamedTuple):
    """Motion of a body over ground in the horizontal plane, split along its heading."""

    heading: float
    """Direction of the body's x axis in the horizontal plane, counter-clockwise from world x [rad]"""
    cos: float
    sin: float
    """Cosine and sine of the heading [-]"""
    forward: float
    """Velocity along the heading [m/s]"""
    lateral: float
    """Velocity to the left of the heading [m/s]"""


@njit(cache=True, error_model="numpy")
def horizontal_motion(rotation: Array, velocity: Array) -> HorizontalMotion:
    """Return the horizontal motion of a body with a rotation matrix, shape (3, 3), and a velocity, shape (3,)."""
    heading = math.atan2(rotation[1, 0], rotation[0, 0])
    cos, sin = math.cos(heading), math.sin(heading)
    x, y = velocity[0], velocity[1]
    return HorizontalMotion(heading, cos, sin, cos * x + sin * y, cos * y - sin * x)


@njit(cache=True, error_model="numpy")
def sideslip_angle(motion: HorizontalMotion, speed: float) -> float:
    """Return alpha of Eq. (7) [rad], faded in; `speed` is the horizontal one."""
    fade = np.minimum(np.maximum((speed - REST_SPEED) / (MOVING_SPEED - REST_SPEED), 0.0), 1.0)
    return fade * fade * (3.0 - 2.0 * fade) * math.atan2(motion.lateral, motion.forward)


@njit(cache=True, error_model="numpy")
def angle_of_attack(heading: float, current_direction: float) -> float:
    """Return beta of Eq. (7), wrapped to (-pi, pi] [rad]."""
    return math.pi - (math.pi - (heading - (current_direction + math.pi))) % (2.0 * math.pi)


def flow_states(states: BodyStates, water: Water | None) -> Array:
    """Return the state of each body relative to ground and water, Eq. (7).

    alpha is the angle from the body's heading to its horizontal velocity (positive: it moves to its own left), where
    the heading is the body's x axis projected on the horizontal. Below `REST_SPEED` it is 0, and between `REST_SPEED`
    and `MOVING_SPEED` it is faded in with a cubic, so that it is continuous through the start. Straight reverse is
    alpha = pi: it then jumps between -pi and pi when the lateral velocity changes its sign, as any such angle must.

    beta is the angle from the upstream direction to the heading: 0 in a head current, pi with the current astern,
    positive when the heading is turned to the left of upstream. It is defined by the current's direction even in calm
    water, and 0 without water.

    Parameters
    ----------
    states : BodyStates
        n instants.
    water : Water or None
        None: no water, beta = U_w = D_w = 0.

    Returns
    -------
    array, shape (n, 5, 5)
        Instant, body, quantity: alpha [rad] and beta [rad] in (-pi, pi], V [m/s], U_w [m/s], D_w [m].
    """
    columns = np.zeros((*states.velocity.shape[:2], 5))
    if water is not None:
        columns[..., 3:] = water.current_speed, water.depth
    direction = math.nan if water is None else float(water.current_direction)
    rotation, velocity = (np.array(values, float, order="C") for values in (states.rotation, states.velocity))
    _fill_motion(rotation, velocity, direction, columns)
    return columns


@njit(cache=True, error_model="numpy")
def _fill_motion(rotation: Array, velocity: Array, current_direction: float, columns: Array) -> None:
    """Fill alpha, beta and V; without a direction (nan) beta stays as it is."""
    for n in range(len(columns)):
        for body in range(columns.shape[1]):
            motion = horizontal_motion(rotation[n, body], velocity[n, body])
            speed = math.hypot(velocity[n, body, 0], velocity[n, body, 1])
            columns[n, body, 0] = sideslip_angle(motion, speed)
            columns[n, body, 2] = speed
            if not math.isnan(current_direction):
                columns[n, body, 1] = angle_of_attack(motion.heading, current_direction)
