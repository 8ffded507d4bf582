"""The state of a body in the water, Eq. (7) of the paper: y = [alpha, beta, V, U_w, D_w]."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from exumob.support.arrays import Array
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
    """Motion of the bodies over ground in the horizontal plane, split along their headings."""

    heading: Array
    """Direction of the body's x axis in the horizontal plane, counter-clockwise from world x [rad]"""
    cos: Array
    sin: Array
    """Cosine and sine of the heading [-]"""
    forward: Array
    """Velocity along the heading [m/s]"""
    lateral: Array
    """Velocity to the left of the heading [m/s]"""


def horizontal_motion(states: BodyStates) -> HorizontalMotion:
    """Return headings and horizontal velocities of the bodies; all arrays have the shape (n, bodies)."""
    heading = np.arctan2(states.rotation[..., 1, 0], states.rotation[..., 0, 0])
    cos, sin = np.cos(heading), np.sin(heading)
    x, y = states.velocity[..., 0], states.velocity[..., 1]
    return HorizontalMotion(heading, cos, sin, cos * x + sin * y, cos * y - sin * x)


def flow_states(states: BodyStates, water: Water | None, motion: HorizontalMotion | None = None) -> Array:
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
    motion : HorizontalMotion, optional
        That of the states, where it has been computed already.

    Returns
    -------
    array, shape (n, 5, 5)
        Instant, body, quantity: alpha [rad] and beta [rad] in (-pi, pi], V [m/s], U_w [m/s], D_w [m].
    """
    motion = horizontal_motion(states) if motion is None else motion
    speed = np.hypot(states.velocity[..., 0], states.velocity[..., 1])
    sideslip = np.arctan2(motion.lateral, motion.forward)
    fade = np.clip((speed - REST_SPEED) / (MOVING_SPEED - REST_SPEED), 0.0, 1.0)

    columns = np.zeros((*speed.shape, 5))
    columns[..., 0] = fade * fade * (3.0 - 2.0 * fade) * sideslip
    columns[..., 2] = speed
    if water is not None:
        columns[..., 1] = _wrapped(motion.heading - (water.current_direction + math.pi))
        columns[..., 3] = water.current_speed
        columns[..., 4] = water.depth
    return columns


def _wrapped(angle: Array) -> Array:
    """Wrap an angle to (-pi, pi]."""
    return math.pi - np.mod(math.pi - angle, 2.0 * math.pi)
