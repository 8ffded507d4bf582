"""What a run takes, estimated and said before it begins: memory of its record, time, and the flow in the loop."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Protocol, runtime_checkable

import numpy as np

from exumob.coupling.strong import Strong
from exumob.driving.maneuver import Maneuver
from exumob.multibody.recorder import HISTORY, RECORD
from exumob.simulation.description import RunDescription, Steps
from exumob.support.cost import announce, expected_time, memory_limit, require_disk, require_memory, spelled_size
from exumob.vehicle.motion import HISTORY_STEP
from exumob.vehicle.parameters import Vehicle
from exumob.vehicle.start_pose import StartPose
from exumob.water.conditions import Water

if TYPE_CHECKING:
    from exumob.flow.cost import FlowCost

# Measured with `simulate` on one idle core, kernels compiled, of the paper's vehicle in D60/U1 with the networks, the
# coefficients and on dry ground, two runs each: 0.16 to 0.18 s, 0.15 to 0.16 s and 0.17 to 0.18 s for a second with the
# setting "fast"; 1.4 to 1.6 s, 1.1 to 1.3 s and 1.1 to 1.4 s with "fine"; to settle 0.8 s, 0.3 s and 0.2 s. They are
# `wall_time` and `settling_wall_time` of runs of 8 s (fast) and 1 s (fine). Whoever makes a run faster measures anew.
TIME_PER_MICRO_STEP = 120e-6
"""Time of a step of the multibody solver that is very short [s]."""
TIME_PER_LENGTH = 0.05
"""Further time of a step over its length [-]: a longer one takes more iterations."""
TIME_PER_MACRO_STEP = 200e-6
"""Time of the water's loads, by networks or coefficients, at a macro step [s]."""
TIME_TO_SETTLE = 0.8
"""Time in which the vehicle comes to rest before a run [s]."""
REPEATED = 5.0
"""Times that the vehicle goes through a macro step until it agrees with the flow in the loop, about."""
COPIES = 4
"""Copies of the record while the result is made of it."""
CHECKPOINT_RATE = 1.5e6
"""Growth of a checkpoint with the time of the run [bytes/s]."""
SAMPLES = 1000
"""Instants at which a maneuver is looked at for its largest wheel speed."""


@runtime_checkable
class FlowInLoop(Protocol):
    """A hydrodynamics model that can say beforehand what it takes (`exumob.coupling.flow_in_loop`)."""

    def expect_steering(self, smallest: float, largest: float) -> None:
        """Take the smallest and the largest angle of a front wheel during the run [rad]."""

    def expect_drive(self, water: Water | None, start: StartPose, reach: float) -> None:
        """Take where the vehicle starts and how far it can come from there [m]; a ValueError: it cannot run this."""

    def cost(
        self, vehicle: Vehicle, water: Water, speed: float, duration: float, macro_step: float, advances: float
    ) -> FlowCost | None:
        """Estimate what it takes at a speed through the water [m/s]; None if that is not known.

        `advances` is how often it is advanced over a macro step, on average.
        """


def driving_time(duration: float, micro_step: float, macro_step: float) -> float:
    """Return the time that a run takes after it has settled, without a flow in the loop, on an idle core [s]."""
    return duration * (TIME_PER_MICRO_STEP / micro_step + TIME_PER_LENGTH + TIME_PER_MACRO_STEP / macro_step)


def require_room(steps: Steps) -> None:
    """Refuse a run whose record cannot fit into memory; nothing is allocated for it.

    Raises
    ------
    ValueError
        Naming duration and record step, and what would fit.
    """
    history = steps.duration / HISTORY_STEP * HISTORY.itemsize
    record = steps.duration / steps.record_step * RECORD.itemsize * COPIES
    limit = memory_limit()
    remedy = f"give a duration of {0.99 * steps.duration * limit / (history + record):.2g} s or less"
    if history < 0.99 * limit:
        remedy += (
            f", or, from Python, a record_step of {1.01 * steps.record_step * record / (limit - history):.2g} s or more"
        )
    require_memory(
        f"simulate: the record of duration = {steps.duration:g} s, every {HISTORY_STEP:g} s for the water and every "
        f"record_step = {steps.record_step:g} s for the result", history + record, f"{remedy}.",
    )  # fmt: skip


def prepare(run: RunDescription, commands: tuple[float, float], checkpoint: Path | None) -> None:
    """Tell the water model what the maneuver will do, refuse what cannot fit, and say what a long run takes.

    Parameters
    ----------
    run : RunDescription
    commands : (float, float)
        Smallest and largest mean angle of the front wheels that the maneuver can ask for [rad].
    checkpoint : Path or None
        Its file.

    Raises
    ------
    ValueError
        If memory or disk cannot hold the run.
    """
    steps, water, model = run.steps, run.water, run.hydrodynamics
    seconds = driving_time(steps.duration, steps.micro_step, steps.longest_macro_step)
    flow: FlowCost | None = None
    if isinstance(model, FlowInLoop):
        angles = [m[0] for command in commands for m in run.vehicle.steering_angles((command, 0.0, 0.0))]
        model.expect_steering(min(0.0, *angles), max(0.0, *angles))
        current = 0.0 if water is None else water.greatest_speed
        speed = _fastest(run.maneuver, steps.duration) * run.vehicle.wheel.radius + current
        model.expect_drive(water, run.start, speed * steps.duration)
        if water is not None:
            advances = 5.0 if isinstance(run.coupling, Strong) else 1.1
            flow = model.cost(run.vehicle, water, speed, steps.duration, steps.longest_macro_step, advances)
    words = f"{steps.duration / steps.micro_step:,.0f} steps of the vehicle"
    saved = CHECKPOINT_RATE * steps.duration
    if flow is not None:
        seconds = REPEATED * seconds + flow.seconds
        saved += flow.saved
        words += (
            f", {flow.cells:,.0f} cells, {spelled_size(flow.memory)} of memory, {flow.steps:,.0f} steps of the flow or "
            f"more on {flow.threads} thread{'s' if flow.threads > 1 else ''}"
        )
    if checkpoint is not None:
        require_disk(
            f"simulate: checkpoint = {checkpoint}", 2.0 * saved, checkpoint.parent, "free some, or leave it out."
        )
        words += f", {spelled_size(saved)} on the disk"
    seconds += TIME_TO_SETTLE
    announce(f"{run.vehicle.name}, {steps.duration:g} s: {words}; {expected_time(seconds)}.", seconds)


def _fastest(maneuver: Maneuver, duration: float) -> float:
    """Largest wheel speed of a maneuver [rad/s]."""
    return max(abs(maneuver.wheel_speed(float(t))[0]) for t in np.linspace(0.0, duration, SAMPLES))
