"""The water that a vehicle has met: how deep, how fast, and how far from what the models of its loads assume."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from exumob.simulation.description import RunDescription
from exumob.support.arrays import Array
from exumob.vehicle.motion import BodyStates

LOOKED_AT = 400
"""Instants at which the water is looked at, at most."""


class WaterMet(NamedTuple):
    """Ranges over the time in which there was water below the hull's origin."""

    depth: tuple[float, float]
    """Least and greatest depth below the hull's origin [m]"""
    current: tuple[float, float]
    """Least and greatest speed of the current there [m/s]"""
    aside: float
    """Largest angle between that current and one from ahead of the heading at the start [rad]; 0 in still water"""
    current_difference: float
    """Largest difference of the current between the hull's middle and its ends [m/s]"""
    level_difference: float
    """Largest difference of the level between them [m]"""
    slope: float
    """Steepest slope of the bed there [-]"""


def water_met(run: RunDescription, states: BodyStates) -> WaterMet | None:
    """Look at the water of a run by its level or a field; None if it is given by a depth, or none was met."""
    water, terrain = run.water, run.terrain
    if water is None or water.depth is not None or len(states) == 0:
        return None
    some = slice(None, None, math.ceil(len(states) / LOOKED_AT))
    middle, ahead = states.position[some, 0], states.rotation[some, 0, :2, 0]
    level, velocity = water.at(middle[:, :2], terrain)
    ground = [terrain.height_and_normal(x, y) if math.isfinite(x + y) else (math.nan, None) for x, y, _ in middle]
    depth = level - np.array([height for height, _ in ground])
    wet = np.flatnonzero(depth > 0.0)
    if not len(wet):
        return None
    depth, level, velocity, ahead = depth[wet], level[wet], velocity[wet], ahead[wet]
    slopes = [math.hypot(n[0], n[1]) / n[2] for n in (ground[k][1] for k in wet) if n is not None]
    speed = np.hypot(*velocity.T)
    aside = 0.0
    for x, y in velocity[speed > 0.0]:
        aside = max(aside, abs(math.remainder(math.atan2(y, x) - run.start.heading - math.pi, 2.0 * math.pi)))
    current_difference, level_difference = 0.0, 0.0
    for end in (-0.5, 0.5):
        there, flow = water.at(middle[wet, :2] + end * run.vehicle.hull.length * ahead, terrain)
        level_difference = max(level_difference, float(np.abs(there - level).max()))
        current_difference = max(current_difference, float(np.hypot(*(flow - velocity).T).max()))
    return WaterMet(_ends(depth), _ends(speed), aside, current_difference, level_difference, max(slopes))


def _ends(values: Array) -> tuple[float, float]:
    return float(values.min()), float(values.max())
