"""Is momentum conserved: do the loads on an accelerated body give the water what it gains?

A box is pulled along a closed tank; the change of the water's momentum, less the impulses of box and end walls, must be
within 1 % of the box's impulse.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from exumob.flow import FlowSolver, Grid, Poses, box
from exumob.support.constants import GRAVITY
from exumob.support.declared import checked
from exumob.verification.check import Case, Check, absolute, reported
from exumob.verification.initial import VISCOUS_TANK, centers
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
    """Momentum of the water in a tank with cubic cells, along x [kg m/s]."""
    size = np.diff(solver.grid.x_faces)[0]
    fraction, area_fractions = solver.fraction, solver.area_fractions.bx[2:-2, 2:-2, 3:-2]
    mean = 0.5 * (fraction[:, :, 1:] + fraction[:, :, :-1])
    return 1000.0 * float(np.sum(mean * area_fractions * solver.velocity[0][:, :, 1:])) * float(size) ** 3


def wall_force(solver: FlowSolver) -> float:
    """Force of the two end walls of a tank with cubic cells on the water, along x [N]."""
    size, z_faces = np.diff(solver.grid.x_faces)[0], solver.grid.z_faces
    z = centers(z_faces)
    at_walls, level = solver.pressure[:, :, [0, -1]], solver.surface_height()[:, [0, -1]]
    top = np.floor(level / size)  # in the surface cell the pressure is hydrostatic below the level
    inside = z[None, :, None] < size * top[:, None, :]
    force = np.sum(np.where(inside, at_walls, 0.0), axis=1) * size
    force += 0.5 * 1000.0 * GRAVITY * (level - size * top) ** 2
    return float(size * np.sum(force[:, 0] - force[:, 1]))


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
        "momentum-surface",
        "A box accelerated through the surface: momentum is conserved",
        check_momentum_at_the_surface,
        0.5,
        slow=True,
    ),
)
