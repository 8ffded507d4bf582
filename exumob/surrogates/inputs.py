"""Input features of the networks: quantities by name, the same in training and in the loop.

`PAPER_INPUTS` are the five states of paper Eq. (7). The others add quantities on which the water's wrenches depend
besides: velocities through the water, rates of rotation, immersion and tilt.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from exumob.ground.terrain import terrain_height
from exumob.support.arrays import Array
from exumob.support.kernels import njit
from exumob.vehicle.motion import HISTORY_STEP, BodyStates
from exumob.water.conditions import Water, WaterOverBed
from exumob.water.flow_states import (
    FLOW_STATE_UNITS,
    FLOW_STATES,
    angle_of_attack,
    horizontal_motion,
    local_current,
    local_depth,
    sideslip_angle,
)


class Input(NamedTuple):
    """One input feature of a network."""

    unit: str
    mirror: int
    """-1: the feature changes its sign when the motion is mirrored in the plane of symmetry; 1: it does not"""
    meaning: str


INPUTS = {
    **{
        name: Input(unit, -1 if name in ("sideslip_angle", "angle_of_attack") else 1, "paper Eq. (7)")
        for name, unit in zip(FLOW_STATES, FLOW_STATE_UNITS, strict=True)
    },
    "forward_flow": Input("m/s", 1, "speed through the water, along the body's heading"),
    "lateral_flow": Input("m/s", -1, "speed through the water, to the left of the heading"),
    "forward_speed": Input("m/s", 1, "speed over ground, along the heading"),
    "lateral_speed": Input("m/s", -1, "speed over ground, to the left of the heading"),
    "yaw_rate": Input("rad/s", -1, "of the body"),
    "roll_rate": Input("rad/s", -1, "about the body's x axis"),
    "pitch_rate": Input("rad/s", 1, "about the body's y axis"),
    "heave_rate": Input("m/s", 1, "upward speed of the body's origin"),
    "immersion": Input("m", 1, "still level above the body's origin"),
    "roll": Input("1", -1, "world z component of the body's y axis"),
    "pitch": Input("1", 1, "world z component of the body's x axis, reversed: bow down positive"),
    "steering": Input("rad", -1, "mean heading of the front wheels less the hull's"),
    "hull_yaw_rate": Input("rad/s", -1, "of the hull"),
    "hull_attack": Input("rad", -1, "angle of attack of the hull"),
}
"""All input features, by name."""
FEATURES = len(INPUTS)
SIZE_POWERS = {"1": 0.0, "rad": 0.0, "m": 1.0, "m/s": 0.5, "rad/s": -0.5}
"""Power of a vehicle's size with which a feature goes, by its unit (Froude's law)."""
SAMPLING = HISTORY_STEP
"""Interval of the instants from which an input window is taken [s]."""
PAPER_INPUTS = FLOW_STATES
"""Input features of the paper, Eq. (7)."""
MIRRORED_BODIES = (0, 2, 1, 4, 3)
"""Index of the body that takes each body's place in the mirrored motion."""
MIRRORED_LOADS = np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])
"""Signs of a wrench (Fx, Fy, Fz, Mx, My, Mz) in the mirrored motion."""


def network_inputs(
    states: BodyStates, water: Water | WaterOverBed, names: Sequence[str], rows: NDArray[np.intp] | None = None, *,
    still: bool = False,
) -> Array:  # fmt: skip
    """Return the input features of the five networks.

    Level and current are those at each body's place, the depth is that below the hull's origin.

    Parameters
    ----------
    states : BodyStates
    water : Water or WaterOverBed
        A `Water` is taken over level ground at z = 0.
    names : sequence of str
        Names from `INPUTS`.
    rows : array of int, optional
        The n instants of `states` that are wanted; default: all.
    still : bool
        True: all velocities are taken as 0.

    Returns
    -------
    array, shape (n, 5, len(names))
        Instant, body, feature, in the units of `INPUTS`.

    Raises
    ------
    ValueError
        If a name is not known.
    """
    columns = _columns(tuple(names))
    rows = np.arange(len(states)) if rows is None else rows
    return _features(
        states.position, states.rotation, states.velocity, states.angular_velocity, rows, still,
        water.over() if isinstance(water, Water) else water, columns,
    )  # fmt: skip


@njit(cache=True, error_model="numpy")
def window_rows(time: Array, taps: int, stride: int) -> NDArray[np.intp]:
    """Return the rows of a history that form the input window, oldest first.

    The rows are found by their time, whatever the steps; for instants before the first row the first one is taken.

    Parameters
    ----------
    time : array, shape (n,)
        Times of the rows [s].
    taps : int
        Instants in the window.
    stride : int
        Interval between them [ms].
    """
    rows = np.empty(taps, np.intp)
    row = len(time) - 1
    for tap in range(taps - 1, -1, -1):  # from the end: a long history is not touched
        wanted = time[-1] - SAMPLING * stride * (taps - 1 - tap)
        while row > 0 and time[row - 1] >= wanted - 1e-7:  # the first row at or after: exact on the history's grid
            row -= 1
        rows[tap] = row
    return rows


def size_factors(names: Sequence[str], times_as_large: float) -> Array:
    """Return what input features of a vehicle in another size are multiplied by, by Froude's law.

    Parameters
    ----------
    names : sequence of str
        Names from `INPUTS`.
    times_as_large : float
        Size of the vehicle over that of the one in training [-].

    Returns
    -------
    array, shape (len(names),)
        They make the features those of the vehicle in training.
    """
    return np.array([times_as_large ** -SIZE_POWERS[INPUTS[name].unit] for name in names])


def mirror_signs(names: Sequence[str]) -> Array:
    """Return the signs of input features in the mirrored motion, shape (len(names),)."""
    return np.array([float(INPUTS[name].mirror) for name in names])


@cache
def _columns(names: tuple[str, ...]) -> NDArray[np.intp]:
    """Return the places of features in `INPUTS`."""
    known = list(INPUTS)
    unknown = [name for name in names if name not in known]
    if unknown:
        raise ValueError(f"network input {unknown[0]!r} is not known; use {', '.join(known)}.")
    return np.array([known.index(name) for name in names], np.intp)


@njit(cache=True, error_model="numpy")
def _features(
    position: Array, rotation: Array, velocity: Array, angular_velocity: Array, rows: NDArray[np.intp], still: bool,
    around: WaterOverBed, columns: NDArray[np.intp],
) -> Array:  # fmt: skip
    """Return features by their places in `INPUTS`."""
    water, nodes = around.water[0], around.water_nodes
    bodies, share = rotation.shape[1], 0.0 if still else 1.0
    chosen, every = np.empty((len(rows), bodies, len(columns))), np.empty(FEATURES)
    for n, row in enumerate(rows):
        headings = np.arctan2(rotation[row, :, 1, 0], rotation[row, :, 0, 0])
        turned = headings[1:3] - headings[0]
        every[16] = np.arctan2(np.sin(turned), np.cos(turned)).mean()
        every[17] = share * angular_velocity[row, 0, 2]
        depth = local_depth(around, position[row, 0, 0], position[row, 0, 1])
        for body in range(bodies):
            x, y = position[row, body, 0], position[row, body, 1]
            level, current_x, current_y, current, direction = local_current(water, nodes, x, y)
            if body == 0:
                every[18] = angle_of_attack(headings[0], direction)
            turn, v, w = rotation[row, body], share * velocity[row, body], share * angular_velocity[row, body]
            motion, speed = horizontal_motion(turn, v), math.hypot(v[0], v[1])
            every[0], every[1] = sideslip_angle(motion, speed), angle_of_attack(motion.heading, direction)
            every[2], every[3], every[4] = speed, current, depth
            every[5] = motion.forward - motion.cos * current_x - motion.sin * current_y
            every[6] = motion.lateral - motion.cos * current_y + motion.sin * current_x
            every[7], every[8] = motion.forward, motion.lateral
            every[9] = w[2]
            every[10] = turn[0, 0] * w[0] + turn[1, 0] * w[1] + turn[2, 0] * w[2]
            every[11] = turn[0, 1] * w[0] + turn[1, 1] * w[1] + turn[2, 1] * w[2]
            every[12] = v[2]
            every[13] = level - position[row, body, 2]
            every[14], every[15] = turn[2, 1], -turn[2, 0]
            for place, column in enumerate(columns):
                chosen[n, body, place] = every[column]
    return chosen


@njit(cache=True, error_model="numpy")
def bed_below(around: WaterOverBed, position: Array) -> tuple[float, NDArray[np.bool_]]:
    """Return the slope of the bed below the hull [-], and which of the bodies are over dry land.

    Parameters
    ----------
    around : WaterOverBed
    position : array, shape (5, 3)
        Origins of the bodies, world axes [m].
    """
    _, slope_x, slope_y = terrain_height(around.bed[0], around.bed_nodes, position[0, 0], position[0, 1])
    dry = np.zeros(len(position), np.bool_)
    for body in range(len(position)):
        dry[body] = local_depth(around, position[body, 0], position[body, 1]) <= 0.0
    return math.hypot(slope_x, slope_y), dry
