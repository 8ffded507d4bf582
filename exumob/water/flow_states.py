"""The state of a body in the water, Eq. (7) of the paper: y = [alpha, beta, V, U_w, D_w]."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from exumob.ground.terrain import Terrain, terrain_height
from exumob.support.arrays import Array
from exumob.support.kernels import njit
from exumob.vehicle.motion import BodyStates
from exumob.water.conditions import Water, WaterOverBed
from exumob.water.water_field import water_at

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


@njit(cache=True, error_model="numpy")
def local_current(water: Any, nodes: Array, x: float, y: float) -> tuple[float, float, float, float, float]:
    """Return level [m], current along x and y [m/s], its speed [m/s] and direction [rad] at a place.

    Where the water of a field stands still, its direction is `Water.current_direction`. Parameters as for `water_at`.
    """
    level, velocity_x, velocity_y = water_at(water, nodes, x, y)
    if nodes.shape[1] == 0:
        return level, velocity_x, velocity_y, water.current_speed, water.current_direction
    speed, direction = math.hypot(velocity_x, velocity_y), water.current_direction
    if speed > 0.0:
        direction = math.atan2(velocity_y, velocity_x)
    return level, velocity_x, velocity_y, speed, direction


@njit(cache=True, error_model="numpy")
def local_depth(around: WaterOverBed, x: float, y: float) -> float:
    """Return the depth of the undisturbed water at a place [m]; 0 on dry land."""
    level, _, _ = water_at(around.water[0], around.water_nodes, x, y)
    return max(level - terrain_height(around.bed[0], around.bed_nodes, x, y)[0], 0.0)


@njit(cache=True, error_model="numpy")
def local_depths(around: WaterOverBed, places: Array) -> Array:
    """Return `local_depth` at places, world x, y [m], shape (n, 2) -> (n,) [m]."""
    found = np.empty(len(places))
    for n in range(len(places)):
        found[n] = local_depth(around, places[n, 0], places[n, 1])
    return found


def flow_states(states: BodyStates, water: Water | None, terrain: Terrain | None = None) -> Array:
    """Return the state of each body relative to ground and water, Eq. (7).

    alpha is the angle from the body's heading to its horizontal velocity (positive: it moves to its own left), where
    the heading is the body's x axis projected on the horizontal. Below `REST_SPEED` it is 0, and between `REST_SPEED`
    and `MOVING_SPEED` it is faded in with a cubic, so that it is continuous through the start. Straight reverse is
    alpha = pi: it then jumps between -pi and pi when the lateral velocity changes its sign, as any such angle must.

    beta is the angle from the upstream direction to the heading: 0 in a head current, pi with the current astern,
    positive when the heading is turned to the left of upstream. It is defined by the current's direction even in calm
    water, and 0 without water.

    U_w is the current at the body's place, D_w the depth below the hull's origin.

    Parameters
    ----------
    states : BodyStates
        n instants.
    water : Water or None
        None: no water, beta = U_w = D_w = 0.
    terrain : Terrain, optional
        The ground; default: flat at z = 0.

    Returns
    -------
    array, shape (n, 5, 5)
        Instant, body, quantity: alpha [rad] and beta [rad] in (-pi, pi], V [m/s], U_w [m/s], D_w [m].
    """
    columns = np.zeros((*states.velocity.shape[:2], 5))
    around = Water(1.0).over() if water is None else water.over(terrain)
    position, rotation, velocity = (
        np.array(values, float, order="C") for values in (states.position, states.rotation, states.velocity)
    )
    _fill_states(position, rotation, velocity, around, water is not None, columns)
    return columns


@njit(cache=True, error_model="numpy")
def _fill_states(
    position: Array, rotation: Array, velocity: Array, around: WaterOverBed, wet: bool, columns: Array
) -> None:
    """Fill the five states; without water beta, U_w and D_w stay as they are."""
    for n in range(len(columns)):
        depth = local_depth(around, position[n, 0, 0], position[n, 0, 1])
        for body in range(columns.shape[1]):
            motion = horizontal_motion(rotation[n, body], velocity[n, body])
            speed = math.hypot(velocity[n, body, 0], velocity[n, body, 1])
            columns[n, body, 0] = sideslip_angle(motion, speed)
            columns[n, body, 2] = speed
            if wet:
                x, y = position[n, body, 0], position[n, body, 1]
                _, _, _, current, direction = local_current(around.water[0], around.water_nodes, x, y)
                columns[n, body, 1] = angle_of_attack(motion.heading, direction)
                columns[n, body, 3], columns[n, body, 4] = current, depth
