"""Is momentum conserved: do the loads on an accelerated body give the water what it gains?

A box is pulled along a closed tank; the change of the water's momentum, less the impulses of box and end walls, must be
within 1 % of the box's impulse. In a closed tank in which water breaks against a wall and falls back, the change of
momentum must be the impulse of the walls to 0.5 % of its largest value, the energy never above the first by more than
0.1 %, the volume the same to 1e-5.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from exumob.flow import FlowSolver, Grid, Poses, box
from exumob.support.constants import GRAVITY
from exumob.support.declared import checked
from exumob.support.quantities import unusual
from exumob.verification.check import Case, Check, absolute, at_least, reported
from exumob.verification.initial import VISCOUS_TANK, centers, filled_to
from exumob.verification.options import CellSize, Duration, Interval
from exumob.verification.single_body import one_pose
from exumob.water.conditions import Water


@checked
def momentum_gap(
    height: float, cell_size: CellSize = 0.02, duration: Duration = 0.3, dt: Interval = 2e-3, sharp_edges: bool = False
) -> float:
    """Box accelerated along a tank: change of the water's momentum less impulses of box and walls, over the box's.

    Parameters
    ----------
    height : float
        Height of the box's centre [m]; the water is 0.2 m deep, the box 0.12 m tall.
    sharp_edges : bool
        `FlowSettings.sharp_edges`.
    """
    grid = Grid.uniform((-0.6, -0.3, 0), (0.6, 0.3, 0.4), cell_size)
    solver = FlowSolver(
        grid, (box(0.2, 0.16, 0.12, friction=0.01),), Water(0.2), replace(VISCOUS_TANK, sharp_edges=sharp_edges)
    )
    ahead = np.array([2.0, 0.0, 0.0])

    def pose(t: float) -> Poses:
        return one_pose(np.array([0.0, 0.001, height]) + 0.5 * t * t * ahead, t * ahead)

    solver.start(pose(0.0))
    first, of_box, of_walls = water_momentum(solver), 0.0, 0.0
    for n in range(round(duration / dt)):
        of_box -= dt * solver.advance(dt * (n + 1), pose(dt * (n + 1)))[0, 0]
        of_walls += dt * wall_force(solver)
    return float((water_momentum(solver) - first - of_box - of_walls) / of_box)


def water_momentum(solver: FlowSolver) -> float:
    """Momentum of the water in a tank, along x [kg m/s]."""
    grid, fraction, area_fractions = solver.grid, solver.fraction, solver.area_fractions.bx[2:-2, 2:-2, 3:-2]
    mean = 0.5 * (fraction[:, :, 1:] + fraction[:, :, :-1])
    volume = np.diff(grid.y_faces)[:, None, None] * np.diff(grid.z_faces)[:, None] * np.diff(centers(grid.x_faces))
    return 1000.0 * float(np.sum(mean * area_fractions * solver.velocity[0][:, :, 1:] * volume))


def wall_force(solver: FlowSolver) -> float:
    """Force of the two end walls of a tank with cubic cells on the water, along x [N]."""
    return push(solver, 0) - push(solver, -1)


def push(solver: FlowSolver, column: int) -> float:
    """Force of the water on an end wall, beside whose column of cells, the first or the last, cells are cubes [N]."""
    size = float(np.diff(solver.grid.z_faces)[0])
    pressure, level = solver.pressure[:, :, column], solver.surface_height()[:, column]
    top = np.floor(level / size)  # in the surface cell the pressure is hydrostatic below the level
    inside = centers(solver.grid.z_faces) < size * top[:, None]
    force = np.sum(np.where(inside, pressure, 0.0), axis=1) * size + 500.0 * GRAVITY * (level - size * top) ** 2
    return size * float(np.sum(force))


class Breaking(NamedTuple):
    """Measures of water that breaks in a closed tank."""

    gap: float
    """Largest difference between the momentum along x and the impulse of the walls, over the largest momentum [-]"""
    energy: float
    """Largest energy over the first, less 1 [-]"""
    volume: float
    """Final over initial volume, less 1 [-]"""


@checked
def breaking_tank(cell_size: CellSize, until: Duration = 1.2, dt: Interval = 2e-3) -> Breaking:
    """Let a column of water collapse in a closed two-dimensional tank 1.2 m long.

    It is 0.4 m wide and tall, over 40 mm of water; it hits the end wall after 0.45 s, runs up, and falls back. The
    pressure at the walls is taken as that half a cell from them (`wall_force`): what water that hits them has more of
    it is missing, which is of the first order in the cell.
    """
    grid = Grid.uniform((0, 0, 0), (1.2, 4 * cell_size, 0.8), cell_size)
    solver = FlowSolver(grid, (), Water(unusual(1e-6)), VISCOUS_TANK)
    solver.start()
    column = filled_to(grid, np.where(centers(grid.x_faces) < 0.4, 0.4, 0.04))
    solver.set_flow(fraction=column)
    volume, energy = solver.water_volume(), _energy(solver)
    impulse, momenta, gaps, energies = 0.0, [], [], []
    for n in range(round(until / dt)):
        solver.advance((n + 1) * dt)
        impulse += dt * wall_force(solver)
        momenta.append(water_momentum(solver))
        gaps.append(momenta[-1] - impulse)
        energies.append(_energy(solver))
    return Breaking(
        float(np.abs(gaps).max() / np.abs(momenta).max()), max(energies) / energy - 1.0,
        solver.water_volume() / volume - 1.0,
    )  # fmt: skip


def _energy(solver: FlowSolver) -> float:
    """Kinetic and potential energy over density, in a tank with cubic cells [m^5/s^2]."""
    c, (u, v, w) = solver.fraction, solver.velocity
    total = GRAVITY * float(np.sum(c * centers(solver.grid.z_faces)[None, :, None]))
    for q, axis in ((u, 2), (v, 0), (w, 1)):
        inner = np.moveaxis(q, axis, 0)[1:]
        water = np.moveaxis(c, axis, 0)
        total += 0.25 * float(np.sum((water[1:] + water[:-1]) * inner**2))
    return total * float(np.diff(solver.grid.x_faces)[0]) ** 3


def check_breaking_tank() -> list[Check]:
    """On two grids: momentum to 0.5 %, which it misses, and that the gap closes with the cell; energy; volume."""
    sizes = (0.02, 0.01)
    coarse, fine = (breaking_tank(size) for size in sizes)
    checks = []
    for size, run in zip(sizes, (coarse, fine), strict=True):
        where = f"breaking water, h = {1e3 * size:g} mm"
        checks += [
            absolute(f"momentum gap, {where}", run.gap, 0.0, 0.005),
            absolute(f"energy above the first, {where}", max(run.energy, 0.0), 0.0, 1e-3),
            absolute(f"volume, {where}", run.volume, 0.0, 1e-5),
        ]
    order = math.log(coarse.gap / fine.gap) / math.log(sizes[0] / sizes[1])
    return [*checks, at_least("order of the momentum gap", order, 0.8)]


def check_momentum() -> list[Check]:
    """A box under the surface: without sharpened edges to 1 %; what sharpening them costs is reported."""
    return [
        absolute("momentum gap, submerged box, h = 20 mm", momentum_gap(0.10), 0.0, 0.01),
        reported("momentum gap with sharp edges, h = 20 mm", momentum_gap(0.10, sharp_edges=True), 0.0),
    ]


def check_momentum_at_the_surface() -> list[Check]:
    """A box through the surface, on two grids."""
    sizes = (0.02, 0.0125)
    return [
        absolute(f"momentum gap, surface-piercing box, h = {1e3 * h:g} mm", momentum_gap(0.20, h), 0.0, 0.01)
        for h in sizes
    ]


CASES: tuple[Case, ...] = (
    Case("momentum", "A box accelerated under the surface: momentum is conserved", check_momentum, 0.1),
    Case(
        "breaking-tank",
        "Water that breaks in a closed tank: momentum, energy, volume",
        check_breaking_tank,
        0.4,
        slow=True,
    ),
    Case(
        "momentum-surface",
        "A box accelerated through the surface: momentum is conserved",
        check_momentum_at_the_surface,
        0.5,
        slow=True,
    ),
)
