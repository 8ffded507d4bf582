"""Does the flow depend on the motion of the grid that it is seen from?

A grid that moves with the water must not change anything (round-off and the pressure's tolerance apart), one that moves
through it no more than the truncation error, which falls with the cells.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from scipy.interpolate import RegularGridInterpolator

from exumob.flow import FlowSettings, FlowSolver, Grid, Poses, sphere
from exumob.support.arrays import Array
from exumob.support.declared import checked
from exumob.support.rotations import about_z
from exumob.verification.check import Case, Check, absolute, at_least, reported
from exumob.verification.initial import centers, filled_to, hump
from exumob.verification.measures import fitted_order
from exumob.verification.options import Duration, Interval
from exumob.verification.single_body import one_pose
from exumob.water.conditions import Water

DEPTH, HEIGHT = 0.2, 0.04
"""Depth of the water and height of the hump on it [m]"""
SETTINGS = FlowSettings(follow=0, absorbing_width=0.3, closure=None, viscosity=0.0)
"""The grid follows a small sphere in the air, which touches no water."""


def steady_motion(speed: Sequence[float] | Array, yaw_rate: float, height: float) -> Callable[[float], Poses]:
    """Poses of one sphere at `height` [m] that moves at speed (x, y) [m/s] and yaws [rad/s]."""

    def pose(t: float) -> Poses:
        return one_pose((speed[0] * t, speed[1] * t, height), (speed[0], speed[1], 0.0), yaw_rate * t, yaw_rate)

    return pose


@checked
def spread(
    grid: Grid, water: Water, speed: Sequence[float] | Array, yaw_rate: float, duration: Duration, dt: Interval,
    middle: tuple[float, float] = (0.0, 0.0),
) -> FlowSolver:  # fmt: skip
    """Let a hump of water spread from rest relative to the current, seen from a moving grid."""
    pose = steady_motion(speed, yaw_rate, float(grid.z_faces[-1]) - 0.03)
    solver = FlowSolver(grid, (sphere(0.01),), water, SETTINGS)
    solver.start(pose(0.0))
    solver.set_flow(fraction=filled_to(grid, hump(grid, water.uniform_depth, HEIGHT, 0.25, middle)))
    steps = round(duration / dt)
    for n in range(steps):
        t = duration * (n + 1) / steps
        solver.advance(t, pose(t))
    return solver


def uniform_current() -> list[Check]:
    """A uniform current over a grid that moves at another speed, straight and yawing."""
    checks = []
    water = Water(0.113, current_speed=1.0, current_direction=2.2)
    for yaw_rate in (0.0, 1.2):
        grid = Grid.stretched((-0.3, -0.3, 0), (0.3, 0.3, 0.2), (-0.8, -0.8, 0), (0.8, 0.8, 0.3), 0.04)
        solver = FlowSolver(grid, (sphere(0.02),), water, FlowSettings(follow=0, absorbing_width=0.2))
        pose = steady_motion((0.8, 0.3), yaw_rate, 0.27)
        solver.start(pose(0.0))
        for n in range(60):
            solver.advance(0.005 * (n + 1), pose(0.005 * (n + 1)))
        far = about_z(solver.frame[2]).T @ water.velocity
        apart = max(float(np.abs(q[:, :3] - f).max()) for q, f in zip(solver.velocity, far, strict=True))
        rise = float(np.abs(solver.surface_height() - water.uniform_depth).max())
        where = f"yaw rate {yaw_rate:g} rad/s"
        checks.append(absolute(f"uniform current, change of velocity, {where}", apart, 0.0, 1e-5, "m/s"))
        checks.append(absolute(f"uniform current, change of level, {where}", rise, 0.0, 1e-5, "m"))
    return checks


def galilean() -> list[Check]:
    """Waves seen from a grid that moves along with the current, and from one that moves and yaws through still water.

    Water and grid moving together is the same discrete problem as both at rest: it must agree to round-off and the
    pressure's tolerance. A grid that moves through the water cuts and carries it otherwise: the results may differ by
    the truncation error, hence must approach each other as the cells shrink.
    """
    low, high = (-1.25, -1.25, 0), (1.25, 1.25, 0.42)
    grid = Grid.uniform(low, high, 0.07)
    still = spread(grid, Water(DEPTH), (0.0, 0.0), 0.0, 0.6, 0.01)
    current = Water(DEPTH, current_speed=1.0, current_direction=0.7)
    carried = spread(grid, current, current.velocity[:2], 0.0, 0.6, 0.01)
    wet = still.fraction > 0.5
    size = max(float(np.abs(q[wet]).max()) for q in still.velocity)
    apart = max(
        float(np.abs((q - far - p)[wet]).max())
        for q, p, far in zip(carried.velocity, still.velocity, current.velocity, strict=True)
    )
    wave = float(np.abs(still.surface_height() - DEPTH).max())
    rise = float(np.abs(carried.surface_height() - still.surface_height()).max())
    checks = [
        absolute("grid carried by the current, velocity apart over the largest", apart / size, 0.0, 1e-4),
        absolute("grid carried by the current, level apart over the wave", rise / wave, 0.0, 1e-4),
    ]
    cells, errors = (0.07, 0.05, 0.035), []
    for cell in cells:
        grid = Grid.uniform(low, high, (cell, cell, 0.5 * cell))
        fixed = spread(grid, Water(DEPTH), (0.0, 0.0), 0.0, 0.35, cell / 10.0)
        moved = spread(grid, Water(DEPTH), (0.4, 0.1), 0.6, 0.35, cell / 10.0)
        x, y = centers(grid.x_faces), centers(grid.y_faces)
        seen = RegularGridInterpolator((y, x), moved.surface_height(), method="cubic")
        xw, yw = np.meshgrid(x, y)
        inside = np.hypot(xw, yw) < 0.7
        places = np.stack([xw[inside], yw[inside], np.zeros(inside.sum())], axis=1)
        own = (places - [*moved.frame[:2], 0.0]) @ about_z(moved.frame[2])
        level = fixed.surface_height()[inside]
        difference = seen(own[:, 1::-1]) - level
        errors.append(float(np.sqrt(np.mean(difference**2) / np.mean((level - DEPTH) ** 2))))
        checks.append(reported(f"moving, yawing grid, level apart over the wave (rms), cell {cell:g} m", errors[-1]))
    checks.append(at_least("moving, yawing grid, order of the difference", fitted_order(cells, errors), 1.0))
    return checks


def mirror() -> list[Check]:
    """A hump off the middle in an oblique current on a yawing grid, and all of it mirrored to the other side."""
    grid = Grid.uniform((-1.0, -1.0, 0), (1.0, 1.0, 0.4), 0.05)
    runs = [
        spread(
            grid, Water(DEPTH, current_speed=0.5, current_direction=side * 0.6), (0.4, side * 0.2), side * 0.8,
            duration=0.5, dt=0.01, middle=(0.15, side * 0.1),
        )
        for side in (1.0, -1.0)
    ]  # fmt: skip
    one, other = (run.surface_height() for run in runs)
    rise = float(np.abs(other[::-1] - one).max() / np.abs(one - DEPTH).max())
    u, v = (run.velocity[0] for run in runs)
    wet = runs[0].fraction > 0.5
    apart = float(np.abs(v[::-1] - u)[wet].max() / np.abs(u[wet]).max())
    return [
        absolute("mirrored flow, level apart over the wave", rise, 0.0, 1e-4),
        absolute("mirrored flow, velocity apart over the largest", apart, 0.0, 1e-4),
    ]


CASES: tuple[Case, ...] = (
    Case("uniform-current", "A uniform current stays uniform whatever the grid does", uniform_current, 0.1),
    Case("galilean", "Waves seen from a grid at rest, carried along, moving and yawing", galilean, 0.4),
    Case("mirrored-waves", "Waves on a yawing grid and their mirror image", mirror, 0.1),
)
