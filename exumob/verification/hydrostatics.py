"""Does water at rest bear a body as Archimedes says, wherever the body lies in the cells?

A box at several places and headings, a wheel sunk into the bed, and a box as the level passes the middle of a cell.
Limits: 1 % of the lift, 2 % for the wheel; no other loads above 0.2 % of it.
"""

from __future__ import annotations

import math

import numpy as np

from exumob.flow import FlowSettings, FlowSolver, Grid, box, cylinder
from exumob.support.arrays import Array
from exumob.support.constants import GRAVITY
from exumob.support.declared import checked
from exumob.verification.check import Case, Check, absolute, relative
from exumob.verification.options import CellSize
from exumob.verification.single_body import loads_over, one_pose
from exumob.water.conditions import Water


@checked
def hydrostatic_loads(height: float, shift: float, yaw: float, cell_size: CellSize = 0.02) -> tuple[Array, float]:
    """Loads [N, N m] on a box at rest in 0.15 m of water, and its buoyancy after Archimedes [N].

    Parameters
    ----------
    height, shift : float
        Place of the box's centre above the bed and along x [m].
    yaw : float
        Heading [rad].
    cell_size : float
        Cell size of the grid [m].
    """
    length, width, tall, depth = 0.5, 0.3, 0.2, 0.15
    grid = Grid.uniform((-0.5, -0.4, 0), (0.5, 0.4, 0.3), cell_size)
    solver = FlowSolver(
        grid, (box(length, width, tall),), Water(depth), FlowSettings(follow=None, absorbing_width=0.1)
    )  # fmt: skip
    pose = one_pose((shift, 0.003, height), (0.0, 0.0, 0.0), yaw)
    loads = loads_over(solver, lambda t: pose, 0.004, 0.02)[-1]
    return loads, 1000.0 * GRAVITY * length * width * (depth - (height - 0.5 * tall))


@checked
def sunk_wheel_lift(cell_size: CellSize = 0.015, sunk: float = 0.012) -> tuple[float, float]:
    """Lift [N] of a wheel that has sunk by `sunk` [m] into saturated soil, and that of the water it displaces [N]."""
    radius, width, depth = 0.1, 0.08, 0.15
    grid = Grid.uniform((-0.3, -0.24, 0), (0.3, 0.24, 0.3), cell_size)
    solver = FlowSolver(
        grid, (cylinder(radius, width),), Water(depth), FlowSettings(follow=None, absorbing_width=0.1)
    )  # fmt: skip
    pose = one_pose((0.004, 0.002, radius - sunk), (0.0, 0.0, 0.0))
    lift = loads_over(solver, lambda t: pose, 0.002, 0.002)[0, 2]
    return float(lift), wheel_buoyancy(radius, width, depth - radius + sunk)


def wheel_buoyancy(radius: float, width: float, level: float) -> float:
    """Weight of the water that a standing wheel displaces [N]; `level` [m] of the water above its centre, <= radius."""
    angle = math.acos(level / radius)  # half angle of the part above the water
    area = math.pi * radius**2 - radius**2 * (angle - math.sin(angle) * math.cos(angle))
    return 1000.0 * GRAVITY * width * area


@checked
def lift_jump(cell_size: CellSize = 0.02) -> float:
    """Change of a floating box's lift, over the lift, as the level rises from just below to just above mid cell."""
    lifts = []
    for level in (7.5 - 1e-4, 7.5 + 1e-4):
        grid = Grid.uniform((-0.5, -0.4, 0), (0.5, 0.4, 0.3), cell_size)
        solver = FlowSolver(
            grid, (box(0.5, 0.3, 0.2),), Water(level * cell_size), FlowSettings(follow=None, absorbing_width=0.1)
        )  # fmt: skip
        pose = one_pose((0.0, 0.003, 0.165), (0.0, 0.0, 0.0))
        lifts.append(loads_over(solver, lambda t, pose=pose: pose, 0.002, 0.004)[-1, 2])  # type: ignore[misc]
    return float(lifts[1] / lifts[0] - 1.0)


@checked
def check_hydrostatics(cell_size: CellSize = 0.02) -> list[Check]:
    """A box at several places and headings, and a sunk wheel: Archimedes; no other loads."""
    checks = []
    for height, shift, yaw in ((0.160, 0.0, 0.0), (0.165, 0.007, 0.0), (0.173, 0.003, 0.5), (0.168, 0.011, 1.1)):
        loads, buoyancy = hydrostatic_loads(height, shift, yaw, cell_size)
        place = f"box at z {1e3 * height:g} mm, x {1e3 * shift:g} mm, yaw {math.degrees(yaw):.0f} deg"
        checks.append(relative(f"lift, {place}", loads[2], buoyancy, 0.01, "N"))
        rest = np.abs(np.delete(loads, 2)).max() / buoyancy
        checks.append(absolute(f"other loads over lift, {place}", rest, 0.0, 2e-3))
    lift, buoyancy = sunk_wheel_lift()
    checks.append(relative("lift, wheel 12 mm in the bed", lift, buoyancy, 0.02, "N"))
    checks.append(absolute("jump of a box's lift as the level passes mid cell", lift_jump(), 0.0, 0.01))
    return checks


CASES: tuple[Case, ...] = (
    Case("hydrostatics", "A box and a sunk wheel in still water: lift as Archimedes says", check_hydrostatics, 0.1),
)
