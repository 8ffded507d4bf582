"""The state in which a run starts: the static equilibrium of the vehicle, sought by dynamic relaxation.

Wheels are locked. First every body is damped in proportion to its mass, on slippery and then on the true soil; then the
vehicle stands free until its largest acceleration is below 3e-7 g. What is left is the slow creep with which soil at
standstill resists (`exumob.ground.contact_patch`).

Not every vehicle can stand where it is put. What the soil holds only by creep, on a slope or in a current, is brought
to the true soil in gentle steps, each from the equilibrium of the last; where sticking and slipping keep it from the
next, it starts from the last one, as it creeps. What slides or is carried away is held in its place by springs in the
plane of the ground while it finds its height, pitch and roll; at time 0 it is let go, at rest. `Start.kind` says
which it was.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from exumob.multibody.solver_settings import TOLERANCE
from exumob.support.arrays import Array
from exumob.support.errors import SimulationError
from exumob.vehicle.motion import BodyStates
from exumob.vehicle.parameters import Vehicle

SETTLING_STEP = 10.0e-3
"""Macro step while the static equilibrium is sought [s]."""
SETTLING_MICRO_STEP = 2.5e-3
"""Step of the time integration meanwhile [s]."""
SHORT_MICRO_STEP = 1.0e-3
"""The same where the soil may stick and slip [s]."""
ROUGH = 1.0e-6
"""Tolerance of Newton's iterations until the last stage, which is solved as the run itself is."""
SLIPPERY = 20.0
"""How much faster than the true soil the slippery one creeps."""
FIRM_CREEP = 0.1
"""Speed of creep over radius times standstill rate, up to which the true soil may follow the slippery one at once."""
GENTLE = 1.4
"""Ratio of the rates of two gentle steps; at 2 the vehicle falls into stick and slip on LETE sand at 14 degrees."""
PATIENCE = 6.0
"""Longest simulated time of a stage [s]."""
LONG_STEPS_PATIENCE = 2.0
"""Simulated time after which a stage goes on in short steps [s]: in long ones, wheels may go on to stick and slip."""
HOLD_RATE = 100.0
"""Natural frequency of the hold [rad/s]: a load of a third of the weight moves the hull by 0.3 mm."""
HOLD_TIME = 15.0
"""Longest simulated time for which a vehicle is held [s]."""
AFLOAT_SHARE = 0.05
"""Share of the weight on the ground below which a vehicle is afloat."""
TIPPED = 60.0
"""Tilt of the hull beyond which a vehicle cannot start [deg]."""


class Stage(NamedTuple):
    """A stage of the relaxation."""

    softness: float
    """Standstill rate over that of the run"""
    damping: float
    """Damping in proportion to mass [1/s]"""
    target: float
    """Largest acceleration at which the stage ends, over gravity"""
    tolerance: float = ROUGH
    """Of Newton's iterations"""
    micro_step: float = SETTLING_MICRO_STEP
    """[s]"""


@dataclass(frozen=True)
class Start:
    """How a run starts."""

    kind: str
    """``"at rest"``; ``"creeping"``: the soil holds the vehicle by creep alone, unsteadily; ``"sliding"`` and
    ``"afloat"``: neither soil nor water holds it, it was held until time 0; ``"out of balance"``: the same, and no
    equilibrium of height and attitude was found"""
    coordinates: Array
    velocities: Array
    speed: float
    """Horizontal speed at which the vehicle crept or slid, damped, before it was held [m/s]"""
    acceleration: float
    """Largest acceleration then [m/s^2]"""


def relax(
    vehicle: Vehicle,
    parameters: np.void,
    loads: np.void,
    water_wrenches: Callable[[BodyStates], Array],
    advance: Callable[[float, float, float], BodyStates],
    begin: Callable[[], BodyStates],
    state: Callable[[], tuple[Array, Array]],
) -> Start:
    """Advance the vehicle until it stands still, or until it is clear that it will not.

    Parameters
    ----------
    vehicle : Vehicle
    parameters : record of dtype `exumob.multibody.applied_loads.LOAD_PARAMETERS`
        Its standstill, settling and hold rates are changed meanwhile, and as before in the end.
    loads : record of dtype `exumob.multibody.applied_loads.LOADS`
    water_wrenches : callable
        Wrenches of the water for given states, shape (5, 6), asked for every `SETTLING_STEP`.
    advance : callable
        Integrates to a time [s] with a micro step [s] and a tolerance, and returns the states reached.
    begin : callable
        Puts the vehicle where it was laid, at time 0, and returns its states, n = 1.
    state : callable
        Returns copies of the present coordinates and velocities of the whole system.

    Raises
    ------
    SimulationError
        If it tips over.
    """
    search = _Search(vehicle, parameters, loads, water_wrenches, advance, state)
    try:
        start = search.free(begin())
        return start if start.kind in ("at rest", "creeping") else search.held(begin(), start)
    finally:
        parameters["settling_rate"] = parameters["hold_rate"] = 0.0
        parameters["standstill_rate"] = search.standstill_rate


class _Search:
    """The search for one vehicle's start; arguments as for `relax`."""

    def __init__(
        self,
        vehicle: Vehicle,
        parameters: np.void,
        loads: np.void,
        water_wrenches: Callable[[BodyStates], Array],
        advance: Callable[[float, float, float], BodyStates],
        state: Callable[[], tuple[Array, Array]],
    ) -> None:
        self.vehicle, self.parameters, self.loads, self.state = vehicle, parameters, loads, state
        self.water_wrenches, self.advance = water_wrenches, advance
        self.damping = 2.0 * float(np.sqrt(parameters["stiffness"].sum() / vehicle.mass))  # about critical for heave
        self.standstill_rate = float(parameters["standstill_rate"])
        self.slowest = float(parameters["wheel_radius"]) * self.standstill_rate
        self.last_acceleration = np.inf

    def _step(self, number: int, stage: Stage, present: BodyStates) -> tuple[BodyStates, float]:
        """Take a macro step of a stage; return the states reached and their largest acceleration [m/s^2]."""
        self.parameters["standstill_rate"] = stage.softness * self.standstill_rate
        self.parameters["settling_rate"] = stage.damping
        self.loads["water_wrench"] = self.water_wrenches(present)
        present = self.advance((number + 1) * SETTLING_STEP, stage.micro_step, stage.tolerance)
        acceleration = max(np.abs(present.acceleration).max(), 0.1 * np.abs(present.angular_acceleration).max())
        # of two instants: an oscillation passes through zero
        self.last_acceleration, largest = acceleration, max(acceleration, self.last_acceleration)
        return present, largest

    def free(self, present: BodyStates) -> Start:
        """Let the vehicle find its rest, or see that it slides."""
        # slippery soil first: friction at the tyres would hold a linkage suspension back
        stages = [Stage(SLIPPERY, self.damping, 1e-5), Stage(1.0, self.damping, 1e-6), Stage(1.0, 0.0, 3e-7, TOLERANCE)]
        last: Start | None = None
        begin = step = 0
        while stages and (step - begin) * SETTLING_STEP < PATIENCE:
            stage = stages[0]
            present, acceleration = self._step(step, stage, present)
            speed = float(np.hypot(*present.velocity[0, 0, :2]))
            rested = step * SETTLING_STEP > 0.2
            if rested and acceleration < stage.target * self.parameters["gravity"]:
                creep = speed / (stage.softness * self.slowest)
                coordinates, velocities = self.state()
                held = creep <= 1.0
                last = Start(
                    "creeping" if held else "sliding", coordinates, held / stage.softness * velocities,
                    speed / stage.softness if held else speed, float(acceleration),
                )  # fmt: skip
                if not held:
                    break
                if creep > FIRM_CREEP and stage.softness == SLIPPERY:
                    stages[1:1] = _gentle_steps(self.damping)
                stages.pop(0)
                begin = step + 1
            elif step * SETTLING_STEP > 1.0 and speed > SLIPPERY * self.slowest:
                last = None
                break
            elif (step - begin) * SETTLING_STEP > LONG_STEPS_PATIENCE and stage.micro_step > SHORT_MICRO_STEP:
                stages[0] = stage._replace(micro_step=SHORT_MICRO_STEP)
                begin = step + 1
            step += 1
        if last is None:
            coordinates, velocities = self.state()
            return Start("sliding", coordinates, np.zeros_like(velocities), speed, float(acceleration))
        return last if stages else replace(last, kind="at rest")

    def held(self, present: BodyStates, free: Start) -> Start:
        """Hold the vehicle above its place on the ground, while it finds height and attitude.

        Raises
        ------
        SimulationError
            If it tips over.
        """
        self.parameters["hold_rate"] = HOLD_RATE
        stages = [Stage(SLIPPERY, self.damping, 1e-4), Stage(1.0, self.damping, 1e-4)]
        weight = self.vehicle.mass * float(self.parameters["gravity"])
        borne = 1.0
        step = 0
        while stages and step * SETTLING_STEP < HOLD_TIME:
            damping = self.damping * (0.25 + 0.75 * min(borne, 1.0))  # water is a softer spring than the suspension
            present, acceleration = self._step(step, stages[0]._replace(damping=damping), present)
            borne = float(self.loads["soil_force"][:, 2].sum() + self.loads["hull_soil"]["force"][2]) / weight
            if step * SETTLING_STEP > 0.2 and acceleration < stages[0].target * self.parameters["gravity"]:
                stages.pop(0)
            step += 1
        tilt = float(np.degrees(np.arccos(np.clip(present.rotation[0, 0, 2, 2], -1.0, 1.0))))
        if tilt > TIPPED:
            raise SimulationError(
                f"{self.vehicle.name}: it tips over before the start, tilted by {tilt:.0f} deg (limit {TIPPED:.0f} "
                "deg). Choose gentler ground, less water, or a lower centre of mass.",
                cause="tipped",
            )
        coordinates, velocities = self.state()
        kind = "out of balance" if stages else "afloat" if borne < AFLOAT_SHARE else "sliding"
        return Start(kind, coordinates, np.zeros_like(velocities), free.speed, float(acceleration))


def _gentle_steps(damping: float) -> list[Stage]:
    """Stages between the slippery and the true soil."""
    count = int(np.log(SLIPPERY) / np.log(GENTLE))
    return [Stage(SLIPPERY / GENTLE**n, damping, 1e-5, ROUGH, SHORT_MICRO_STEP) for n in range(1, count + 1)]
