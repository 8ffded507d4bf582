"""What the verification cases share: tanks, initial surfaces and orders of convergence."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from exumob.flow import FlowSettings, FlowSolver, Grid
from exumob.support.arrays import Array
from exumob.water.conditions import Water

TANK = FlowSettings(follow=None, far_x=False, far_y=False, closure=None, viscosity=0.0)
"""Walls all round, no friction."""


def centers(faces: Array) -> Array:
    """Centres of the cells between faces [m]."""
    return 0.5 * (faces[1:] + faces[:-1])


def filled_to(grid: Grid, level: ArrayLike) -> Array:
    """Fraction of each cell below a level [m] given per column, shape (ny, nx) or (nx,); result (ny, nz, nx)."""
    columns = np.broadcast_to(np.asarray(level, dtype=float), (grid.shape[0], grid.shape[2]))
    z = grid.z_faces[None, :, None]
    return np.clip((columns[:, None, :] - z[:, :-1]) / np.diff(z, axis=1), 0.0, 1.0)


def started(grid: Grid, water: Water, settings: FlowSettings = TANK, level: ArrayLike | None = None) -> FlowSolver:
    """Solver without solids, started, its surface at `level` [m] per column."""
    solver = FlowSolver(grid, (), water, settings)
    solver.start()
    if level is not None:
        solver.set_flow(fraction=filled_to(grid, level))
    return solver


def fitted_order(cells: Sequence[float], errors: Sequence[float]) -> float:
    """Exponent p of errors ~ cells^p by least squares of the logarithms."""
    return float(np.polyfit(np.log(cells), np.log(np.abs(errors)), 1)[0])
