"""How far is a slender hull sucked down in shallow water (squat)?

Tuck, "Shallow-water flows past slender bodies", J. Fluid Mech. 26 (1966) 81: below the critical speed the vertical
force on a hull of waterline breadth B(x) and section area S(x) is

    F = rho U^2 / (2 pi h sqrt(1 - Fr^2)) double integral of B'(x) S'(xi) ln|x - xi|.

For a wall-sided hull of draught T with the parabolic waterline B (1 - (2 x / L)^2) the integral is -4 B^2 T, hence
F = -(2 / pi) rho U^2 B^2 T / (h sqrt(1 - Fr^2)), and the trim moment is 0 by symmetry. As sinkage this is
1.43 displacement / L^2 Fr^2 / sqrt(1 - Fr^2): the mean sinkage of Hooft's formula (1974; 1.46), to which ICORELS's
and Huuska's formulae (2.4 at the bow) add the trim. Measured sinkages scatter by some 20 to 30 % about it, and theory
leaves out friction, the breadth (here L / 8) and the sides of the window: hence a limit of 30 %.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Sequence

import numpy as np

from exumob.driving.maneuver import smooth_step
from exumob.flow import FlowSettings, FlowSolver, Grid, Poses
from exumob.flow.solids import prism
from exumob.support.arrays import Array
from exumob.support.constants import GRAVITY
from exumob.support.declared import checked
from exumob.verification.check import Case, Check, absolute, relative, reported
from exumob.verification.options import CellSize, Duration, Interval, Threads
from exumob.water.conditions import Water

logger = logging.getLogger(__name__)

LENGTH, BREADTH, DRAUGHT, DEPTH, TALL = 1.6, 0.2, 0.04, 0.12, 0.12
"""Sizes of the hull, depth of the water, and height of the hull [m]"""
UPRIGHT = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""The prism is extruded along its y axis, which points up."""


def waterline(points: int = 12) -> Array:
    """Corners of the parabolic waterline in the prism's (x, z) [m], counter-clockwise, shape (2 points, 2)."""
    x = np.linspace(-0.5 * LENGTH, 0.5 * LENGTH, points + 1)
    half = 0.5 * BREADTH * (1.0 - (2.0 * x / LENGTH) ** 2)
    return np.concatenate([np.stack([x, -half], axis=1)[:-1], np.stack([x, half], axis=1)[:0:-1]])


def slender_body_lift(froude: float) -> float:
    """Vertical force of Tuck's theory [N], negative: downwards."""
    speed_squared = froude**2 * GRAVITY * DEPTH
    return -2.0 / math.pi * 1000.0 * speed_squared * BREADTH**2 * DRAUGHT / (DEPTH * math.sqrt(1.0 - froude**2))


@checked
def squat_loads(
    froude: float, cell_size: CellSize = 0.02, duration: Duration = 3.0, interval: Interval = 2.0e-3,
    threads: Threads = 1,
    ramp_time: Interval = 1.0, aside: float = 1.6,
) -> tuple[float, float, float]:  # fmt: skip
    """Change of lift [N], of trim moment (bow down positive) [N m], and drag [N] of the hull under way.

    It is towed from rest through still water; before the start it bears its buoyancy alone. Means over the second
    half of the run.
    """
    speed = froude * math.sqrt(GRAVITY * DEPTH)
    grid = Grid.stretched(
        (-0.5 * LENGTH - 0.1, -0.5 * BREADTH - 0.06, 0.0), (0.5 * LENGTH + 0.1, 0.5 * BREADTH + 0.06, 0.16),
        (-2.2, -aside, 0.0), (2.2, aside, 0.26), cell_size,
    )  # fmt: skip
    solver = FlowSolver(
        grid, (prism(waterline(), TALL, friction=0.004),), Water(DEPTH), FlowSettings(follow=0, threads=threads)
    )
    height = DEPTH - DRAUGHT + 0.5 * TALL

    def pose(time: float) -> Poses:
        share = min(time / ramp_time, 1.0)
        way = speed * (ramp_time * share**4 * (2.5 - 3.0 * share + share**2) + max(time - ramp_time, 0.0))
        now = speed * smooth_step(share)[0]
        return Poses(
            np.array([[way, 0.0, height]]), UPRIGHT[None], np.array([[now, 0.0, 0.0]]), np.zeros((1, 3)), np.zeros(1)
        )

    solver.start(pose(0.0))
    rest = solver.advance(1e-4, pose(1e-4))[0].copy()
    steps = round(duration / interval)
    loads = []
    for n in range(1, steps + 1):
        loads.append(solver.advance(n * interval, pose(n * interval))[0].copy())
        if n % max(steps // 10, 1) == 0:
            logger.info("squat, Fr %.2g: %.2f of %.2f s", froude, n * interval, duration)
    mean = np.mean(loads[len(loads) // 2 :], axis=0) - rest
    return float(mean[1]), float(-mean[5]), float(mean[0])  # axes of the prism: y up, z to the right


@checked
def squat(
    froude_numbers: Sequence[float] = (0.3, 0.45, 0.6),
    cell_size: CellSize = 0.02,
    duration: Duration = 3.0,
    threads: Threads = 1,
) -> list[Check]:
    """Lift of the hull under way against Tuck; trim reported."""
    checks = []
    for froude in froude_numbers:
        lift, trim, drag = squat_loads(froude, cell_size, duration, threads=threads)
        at = f"depth Froude number {froude:g}"
        checks.append(relative(f"change of lift under way, {at}", lift, slender_body_lift(froude), 0.30, "N"))
        lever = abs(trim / lift) / LENGTH if lift else math.nan
        checks.append(absolute(f"trim moment over lift and length, {at}", lever, 0.0, 0.30))
        checks.append(reported(f"drag, {at}", drag, unit="N"))
    return checks


CASES: tuple[Case, ...] = (
    Case(
        "squat",
        "A slender hull towed in shallow water is sucked down: slender-body theory (Tuck 1966)",
        squat,
        12.0,
        slow=True,
    ),
)
