"""The state in which a run starts: the static equilibrium of the vehicle, sought by dynamic relaxation.

Wheels are locked. First every body is damped in proportion to its mass, on slippery and then on the true soil; then the
vehicle stands free until its largest acceleration is below 3e-7 g. What is left is the slow creep with which soil at
standstill resists (`exumob.ground.contact_patch`).

Not every vehicle can stand where it is put. What the soil holds only by creep, on a slope or in a current, is brought
to the true soil in gentle steps, each from the equilibrium of the last. Where none is reached any more the vehicle
starts from the last one: it lies on its springs and in the water as it should, and it moves off at the release, as the
soil and the water let it. `Start.kind` says which it was.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from exumob.support.arrays import Array
from exumob.vehicle.motion import BodyStates
from exumob.vehicle.parameters import Vehicle

SETTLING_STEP = 5.0e-3
"""Macro step while the static equilibrium is sought [s]."""
SETTLING_MICRO_STEP = 1.0e-3
"""Step of the time integration meanwhile [s]."""
SLIPPERY = 20.0
"""How much faster than the true soil the slippery one creeps."""
FIRM_CREEP = 0.1
"""Speed of creep over radius times standstill rate, up to which the true soil may follow the slippery one at once."""
GENTLE = 1.4
"""Ratio of the rates of two gentle steps; at 2 the vehicle falls into stick and slip on LETE sand at 14 degrees."""
PATIENCE = 6.0
"""Longest simulated time of a stage [s]."""


class Stage(NamedTuple):
    """A stage of the relaxation."""

    softness: float
    """Standstill rate over that of the run"""
    damping: float
    """Damping in proportion to mass [1/s]"""
    target: float
    """Largest acceleration at which the stage ends, over gravity"""


@dataclass(frozen=True)
class Start:
    """How a run starts."""

    kind: str
    """``"at rest"``; ``"creeping"``: the soil holds the vehicle by creep alone, unsteadily; ``"sliding"``: soil and
    water do not hold it; ``"out of balance"``: no equilibrium of height and attitude was found"""
    coordinates: Array
    velocities: Array
    speed: float
    """Horizontal speed at which the vehicle crept or slid, damped, when it was left [m/s]"""
    acceleration: float
    """Largest acceleration then [m/s^2]"""


def relax(
    vehicle: Vehicle,
    parameters: np.void,
    loads: np.void,
    water_wrenches: Callable[[BodyStates], Array],
    advance: Callable[[float], BodyStates],
    present: BodyStates,
    state: Callable[[], tuple[Array, Array]],
) -> Start:
    """Advance the vehicle until it stands still, or until it is clear that it will not.

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
    state : callable
        Returns copies of the present coordinates and velocities of the whole system.
    """
    damping = 2.0 * float(np.sqrt(parameters["stiffness"].sum() / vehicle.mass))  # about critical for heave
    standstill_rate = float(parameters["standstill_rate"])
    slowest = float(parameters["wheel_radius"]) * standstill_rate
    # slippery soil first: friction at the tyres would hold a linkage suspension back
    stages = [Stage(SLIPPERY, damping, 1e-5), Stage(1.0, damping, 1e-6), Stage(1.0, 0.0, 3e-7)]
    last: Start | None = None
    begin = step = 0
    try:
        while stages and (step - begin) * SETTLING_STEP < PATIENCE:
            stage = stages[0]
            parameters["standstill_rate"], parameters["settling_rate"] = stage.softness * standstill_rate, stage.damping
            loads["water_wrench"] = water_wrenches(present)
            present = advance((step + 1) * SETTLING_STEP)
            acceleration = max(np.abs(present.acceleration).max(), 0.1 * np.abs(present.angular_acceleration).max())
            speed = float(np.hypot(*present.velocity[0, 0, :2]))
            if acceleration < stage.target * parameters["gravity"] and step * SETTLING_STEP > 0.2:
                creep = speed / (stage.softness * slowest)
                coordinates, velocities = state()
                held = creep <= 1.0
                last = Start(
                    "creeping" if held else "sliding", coordinates, held / stage.softness * velocities, speed,
                    float(acceleration),
                )  # fmt: skip
                if not held and stage.softness == 1.0:
                    break
                if creep > FIRM_CREEP and stage.softness == SLIPPERY:
                    stages[1:1] = _gentle_steps(damping)
                stages.pop(0)
                begin = step + 1
            step += 1
    finally:
        parameters["settling_rate"] = 0.0
        parameters["standstill_rate"] = standstill_rate
    if last is None:
        coordinates, velocities = state()
        return Start("out of balance", coordinates, np.zeros_like(velocities), speed, float(acceleration))
    return last if stages else Start("at rest", last.coordinates, last.velocities, last.speed, last.acceleration)


def _gentle_steps(damping: float) -> list[Stage]:
    """Stages between the slippery and the true soil."""
    count = int(np.log(SLIPPERY) / np.log(GENTLE))
    return [Stage(SLIPPERY / GENTLE**n, damping, 1e-5) for n in range(1, count + 1)]
