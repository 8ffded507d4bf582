"""Maneuvers by name, and as a vehicle of another size drives them by Froude's law."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, cast

from exumob.driving.maneuver import ConstantSteer, LaneChange, Maneuver
from exumob.driving.path_following import PathFollowing
from exumob.vehicle.parameters import Vehicle

MANEUVERS: dict[str, Maneuver] = {
    "lane change": LaneChange(), "straight": ConstantSteer(), "path following": PathFollowing(),
}  # fmt: skip
"""Values of ``maneuver``, with the maneuver that each name stands for."""


def maneuver_named(name: str) -> Maneuver:
    """Maneuver of the paper's vehicle that a name stands for, one of `MANEUVERS`.

    Raises
    ------
    ValueError
        If none has this name.
    """
    if name not in MANEUVERS:
        raise ValueError(f"maneuver = {name!r} is not known; use {', '.join(map(repr, MANEUVERS))}.")
    return MANEUVERS[name]


def driven(maneuver: Maneuver) -> tuple[float, float]:
    """Return the largest steering [rad] and the wheels' speed [rad/s] of a lane change, a circle or a straight run.

    Both are nan of any other maneuver.
    """
    if isinstance(maneuver, LaneChange):
        return abs(maneuver.amplitude), maneuver.speed
    return (abs(maneuver.angle), maneuver.speed) if isinstance(maneuver, ConstantSteer) else (math.nan, math.nan)


def maneuver_for(maneuver: Maneuver, before: Vehicle, vehicle: Vehicle) -> Maneuver:
    """Return the maneuver of one vehicle as another drives it by Froude's law.

    Times of a lane change, of the ramps, and the speed of the tyres' tread go with the root of the wheelbase. Of path
    following the default waypoints go with the wheelbase, and no angle passes what the vehicle can steer; waypoints
    that are given are places, and stay, and so does the driver. A maneuver of any other kind stays.

    Parameters
    ----------
    maneuver : Maneuver
    before : Vehicle
        The vehicle that the maneuver was for.
    vehicle : Vehicle
        The vehicle that is to drive it.

    Returns
    -------
    Maneuver
    """
    unit = math.sqrt(vehicle.wheelbase / before.wheelbase)
    turning = unit * (before.wheel.radius / vehicle.wheel.radius)
    factors = {"speed": turning, "start_speed": turning, "ramp_time": unit}
    if type(maneuver) is LaneChange:
        factors |= {"start": unit, "end": unit}
    elif type(maneuver) not in (ConstantSteer, PathFollowing):
        return maneuver
    changed: dict[str, Any] = {name: factor * getattr(maneuver, name) for name, factor in factors.items()}
    if type(maneuver) is PathFollowing:
        changed["max_steering"] = min(maneuver.max_steering, vehicle.steering.limit)
        if maneuver.waypoints == PathFollowing().waypoints:
            size = vehicle.wheelbase / before.wheelbase
            changed["waypoints"] = tuple((size * x, size * y) for x, y in maneuver.waypoints)
    return cast(Maneuver, replace(cast(Any, maneuver), **changed))
