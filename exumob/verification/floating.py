"""Does a floating box bob with the period of linear theory, and settle at its draught?

The flow gives loads for a motion; here the motion follows from the loads. The box is lighter than the water that it
carries along, so a step is repeated from a saved state until its acceleration and the loads agree (secant steps: with
one degree of freedom the same as Aitken's relaxation).

Reference: linear theory at the damped natural frequency, (m + A) z'' + B z' + rho g L W z = 0. Added mass A and
damping B of this box in this depth come from a boundary-element code (capytaine 3.0: Ancellin & Dias, J. Open Source
Softw. 4 (2019) 1341), as 3-D boxes have no published table; the code gave 0.434 and 0.248 for the half submerged sphere
at k R = 1, where Hulme (J. Fluid Mech. 121 (1982) 443) has the exact solution.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from exumob.flow import FlowSettings, FlowSolver, Grid, Poses, box
from exumob.support.arrays import Array
from exumob.support.constants import GRAVITY
from exumob.support.declared import checked
from exumob.verification.check import Case, Check, absolute, relative, reported
from exumob.verification.measures import extremes, fitted_oscillation
from exumob.verification.options import CellSize, Duration, Interval
from exumob.verification.single_body import one_pose
from exumob.water.conditions import Water

LENGTH, WIDTH, HEIGHT, DRAUGHT, DEPTH = 0.4, 0.3, 0.2, 0.13, 0.35
"""Sizes of the box and depth of the water [m]."""
MASS = 1000.0 * LENGTH * WIDTH * DRAUGHT
"""Mass of the box [kg]."""
ADDED_MASS = 0.740
"""A over the mass of the box at the natural frequency [-]: 0.761 with 360 panels, 0.753 with 930; extrapolated."""
DAMPING_RATIO = 0.070
"""B over its critical value [-]."""


@dataclass(frozen=True)
class Heave:
    """Motion of the box, arrays of shape (n,)."""

    time: Array
    """[s]"""
    offset: Array
    """Height of the box above its place of rest [m]"""
    trials: float
    """Mean number of flow steps for each step of the coupled motion [-]"""


def heave_period() -> float:
    """Damped natural period of linear theory [s]."""
    stiffness = 1000.0 * GRAVITY * LENGTH * WIDTH
    undamped = math.sqrt(stiffness / (MASS * (1.0 + ADDED_MASS)))
    return 2.0 * math.pi / (undamped * math.sqrt(1.0 - DAMPING_RATIO**2))


@checked
def floating_box_solver(cell_size: CellSize, reach: float = 1.8) -> FlowSolver:
    """The box in water with absorbing sides; see `released_box`."""
    core = np.array([0.5 * LENGTH + 0.1, 0.5 * WIDTH + 0.1])
    grid = Grid.stretched(
        (*-core, 0.0), (*core, 0.6), (-reach, -reach, 0.0), (reach, reach, 0.6), cell_size, 1.05
    )  # fmt: skip
    return FlowSolver(
        grid, (box(LENGTH, WIDTH, HEIGHT),), Water(DEPTH), FlowSettings(follow=None, absorbing_width=0.9)
    )  # fmt: skip


@checked
def released_box(
    offset: float, duration: Duration, cell_size: CellSize = 0.025, dt: Interval = 5e-3, reach: float = 1.8
) -> Heave:
    """Box released at rest at `offset` [m] above its place of rest, in water with absorbing sides.

    Parameters
    ----------
    duration, dt : float
        [s]
    cell_size : float
        [m]
    reach : float
        Half width of the basin [m]; its outer 0.9 m absorb waves (1.3 m long at the natural frequency).
    """
    solver = floating_box_solver(cell_size, reach)
    rest = DEPTH - DRAUGHT + 0.5 * HEIGHT

    def pose(z: float, speed: float) -> Poses:
        return one_pose((0.0, 0.0, rest + z), (0.0, 0.0, speed))

    z, speed, acceleration = offset, 0.0, 0.0
    slope = -MASS * (1.0 + ADDED_MASS)  # of the force's error over the acceleration, to begin with
    offsets, trials = [z], 0
    steps = round(duration / dt)
    solver.start(pose(z, 0.0))
    for n in range(steps):
        saved = solver.save()

        def error(a: float, n: int = n, z: float = z, speed: float = speed) -> float:
            loads = solver.advance(dt * (n + 1), pose(z + dt * speed + 0.5 * dt * dt * a, speed + dt * a))
            return float(loads[0, 2]) - MASS * (GRAVITY + a)

        found = error(acceleration)
        trials += 1
        for _ in range(8):
            if abs(found) < 1e-4 * MASS * GRAVITY:
                break
            change = -found / slope
            solver.restore(saved)
            following = error(acceleration + change)
            trials += 1
            measured = (following - found) / change
            if -4.0 * MASS * (1.0 + ADDED_MASS) < measured < -MASS:
                slope = measured
            acceleration, found = acceleration + change, following
        z, speed = z + dt * speed + 0.5 * dt * dt * acceleration, speed + dt * acceleration
        offsets.append(z)
    return Heave(np.array(dt * np.arange(steps + 1), dtype=float), np.array(offsets), trials / steps)


@checked
def check_decay(cell_size: CellSize = 0.025, dt: Interval = 5e-3) -> list[Check]:
    """Released 10 mm too high: period within 2 % of linear theory, every swing smaller than the one before."""
    run = released_box(0.01, 2.4, cell_size, dt)
    later = run.time >= 0.25 * heave_period()  # the waves that the release makes are another matter
    period, damping = fitted_oscillation(run.time[later], run.offset[later], heave_period())
    swings = np.abs(np.diff(extremes(run.offset)))  # from turn to turn: free of a bias of the place of rest
    growth = float((swings[1:] / swings[:-1]).max())
    name = f"h = {1e3 * cell_size:g} mm"
    return [
        relative(f"heave period, {name}", period, heave_period(), 0.02, "s"),
        absolute(f"largest ratio of a swing to the one before less 1, if above 0, {name}", max(growth - 1.0, 0.0), 0.0,
                 0.0),
        reported(f"damping ratio, {name}", damping, DAMPING_RATIO),
        reported(f"flow steps for each coupled step, {name}", run.trials),
    ]  # fmt: skip


@checked
def check_settling(cell_size: CellSize = 0.025, dt: Interval = 5e-3) -> list[Check]:
    """Released half submerged, 30 mm above its place of rest: the mean draught of the last period within 1 %."""
    run = released_box(DRAUGHT - 0.5 * HEIGHT, 5.0, cell_size, dt)
    last = run.offset[-round(heave_period() / dt) :]
    return [
        relative(f"draught, h = {1e3 * cell_size:g} mm", DRAUGHT - float(last.mean()), DRAUGHT, 0.01, "m"),
        reported("half the last period's range", 0.5 * float(np.ptp(last)), 0.0, "m"),
    ]


CASES: tuple[Case, ...] = (
    Case(
        "heave-decay",
        "A floating box coupled to the flow: heave period of linear theory, no growth of energy",
        check_decay,
        1.5,
        slow=True,
    ),
    Case("settling", "A box released half submerged settles at its draught", check_settling, 3.0, slow=True),
)
