"""The static equilibrium of a vehicle, sought by dynamic relaxation.

Wheels are locked. First every body is damped in proportion to its mass, on slippery and then on the true soil; then the
vehicle stands free until its largest acceleration is below 3e-7 g. What is left is the slow creep with which soil at
standstill resists.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from exumob.support.arrays import Array
from exumob.support.errors import SimulationError
from exumob.vehicle.motion import BodyStates
from exumob.vehicle.parameters import Vehicle

SETTLING_STEP = 5.0e-3
"""Macro step while the static equilibrium is sought [s]."""
SETTLING_MICRO_STEP = 1.0e-3
"""Step of the time integration meanwhile [s]."""


def relax(
    vehicle: Vehicle,
    parameters: np.void,
    loads: np.void,
    water_wrenches: Callable[[BodyStates], Array],
    advance: Callable[[float], BodyStates],
    present: BodyStates,
    limit: float,
) -> None:
    """Advance the vehicle until it stands still.

    Parameters
    ----------
    vehicle : Vehicle
    parameters : record of dtype `exumob.multibody.applied_loads.LOAD_PARAMETERS`
        Its standstill and settling rate are changed meanwhile, and as before in the end.
    loads : record of dtype `exumob.multibody.applied_loads.LOADS`
    water_wrenches : callable
        Wrenches of the water for given states, shape (5, 6), asked for every `SETTLING_STEP`.
    advance : callable
        Integrates to a time [s] and returns the states reached.
    present : BodyStates
        States at time 0, n = 1.
    limit : float
        Longest simulated time [s].

    Raises
    ------
    SimulationError
        If no equilibrium is found (the vehicle sinks in, floats or slides).
    """
    damping = 2.0 * float(np.sqrt(parameters["stiffness"].sum() / vehicle.mass))  # about critical for heave
    standstill_rate = float(parameters["standstill_rate"])
    # slippery soil first: friction at the tyres would hold a linkage suspension back
    stages = [
        (20.0 * standstill_rate, damping, 1e-5),
        (standstill_rate, damping, 1e-6),
        (standstill_rate, 0.0, 3e-7),
    ]
    try:
        for n in range(round(limit / SETTLING_STEP)):
            parameters["standstill_rate"], parameters["settling_rate"], target = stages[0]
            loads["water_wrench"] = water_wrenches(present)
            present = advance((n + 1) * SETTLING_STEP)
            acceleration = max(np.abs(present.acceleration).max(), 0.1 * np.abs(present.angular_acceleration).max())
            if acceleration < target * parameters["gravity"] and n * SETTLING_STEP > 0.2:
                stages.pop(0)
                if not stages:
                    break
        speed = float(np.hypot(*present.velocity[0, 0, :2]))
        if stages or speed > parameters["wheel_radius"] * standstill_rate:
            raise SimulationError(
                f"{vehicle.name}: no static equilibrium within {limit} s (largest acceleration "
                f"{acceleration:.2g} m/s^2, speed {speed:.2g} m/s); the vehicle floats, slides or trembles on its "
                "tyres. Lower the water depth or the current, choose a firmer soil or a gentler slope.",
                cause=_cause(vehicle, parameters, loads, speed),
            )
    finally:
        parameters["settling_rate"] = 0.0
        parameters["standstill_rate"] = standstill_rate


def _cause(vehicle: Vehicle, parameters: np.void, loads: np.void, speed: float) -> str:
    """Why the vehicle cannot stand, as `SimulationError.cause`."""
    borne = float(loads["soil_force"][:, 2].sum())
    if borne < 0.05 * vehicle.mass * float(parameters["gravity"]):
        return "afloat"
    return "swept away" if speed > parameters["wheel_radius"] * parameters["standstill_rate"] else ""
