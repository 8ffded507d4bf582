"""Initial states that the cases share: tanks, levels, humps of water."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from exumob.flow import FlowSettings, FlowSolver, Grid
from exumob.support.arrays import Array
from exumob.water.conditions import Water

TANK = FlowSettings(follow=None, far_x=False, far_y=False, closure=None, viscosity=0.0)
"""Walls all round, no friction."""
VISCOUS_TANK = FlowSettings(follow=None, far_x=False, far_y=False)
"""Walls all round, viscosity and turbulence as by default."""


def centers(faces: Array) -> Array:
    """Centres of the cells between faces [m]."""
    return 0.5 * (faces[1:] + faces[:-1])


def filled_to(grid: Grid, level: ArrayLike) -> Array:
    """Return the fraction of each cell, shape (ny, nz, nx), below a level [m] per column, shape (ny, nx) or (nx,)."""
    columns = np.broadcast_to(np.asarray(level, dtype=float), (grid.shape[0], grid.shape[2]))
    z = grid.z_faces[None, :, None]
    return np.clip((columns[:, None, :] - z[:, :-1]) / np.diff(z, axis=1), 0.0, 1.0)


def started(grid: Grid, water: Water, settings: FlowSettings = TANK, level: ArrayLike | None = None) -> FlowSolver:
    """Start a solver without solids, its surface at `level` [m] per column."""
    solver = FlowSolver(grid, (), water, settings)
    solver.start()
    if level is not None:
        solver.set_flow(fraction=filled_to(grid, level))
    return solver


def hump(grid: Grid, depth: float, height: float, width: float, middle: tuple[float, float] = (0.0, 0.0)) -> Array:
    """Level of a Gaussian hump of water [m], shape (ny, nx)."""
    x, y = centers(grid.x_faces) - middle[0], centers(grid.y_faces) - middle[1]
    return depth + height * np.exp(-(x[None, :] ** 2 + y[:, None] ** 2) / width**2)
