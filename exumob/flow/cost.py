"""Cost of the flow solver, estimated before it allocates anything: memory, steps and time of a run.

The figures were measured by `benchmarks/flow_scaling.py` (`docs/speed.md`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from exumob.flow.grid import BYTES_PER_CELL, Grid, fitting_size, most_cells
from exumob.support.cost import cores, require_memory, spelled_size, spelled_time

TIME_PER_CELL = 300e-9
"""Time of a step, per cell, on one thread [s]: 300 in whole runs, solids and loads included; 190 of them the step."""
SERIAL_SHARE = 0.2
"""Share of that time which further threads do not shorten [-]: a step takes 78 ms on one thread, 46 ms on two."""
COURANT_FACTOR = 2.5
"""Largest rate at which water crosses cells, times their width, over the speed of the vehicle through the water [-]:
2.3 to 2.7 for the model vehicle at 1 m/s against 1 m/s."""
SAVED_BYTES_PER_CELL = 110.0
"""Size of a saved state, compressed [bytes]."""


@dataclass(frozen=True)
class FlowCost:
    """What a run of the flow solver takes, about."""

    cells: float
    memory: float
    """[bytes]"""
    steps: float
    """Steps of the solver"""
    seconds: float
    """[s]"""
    threads: int

    @property
    def saved(self) -> float:
        """Size of a saved state [bytes]."""
        return SAVED_BYTES_PER_CELL * self.cells

    def __str__(self) -> str:
        """Describe it in one line."""
        return (
            f"{self.cells:,.0f} cells, {spelled_size(self.memory)} of memory, {self.steps:,.0f} steps of the flow or "
            f"more; about {spelled_time(self.seconds)} on {self.threads} thread{'s' if self.threads > 1 else ''} "
            f"of {cores()} core{'s' if cores() > 1 else ''}, if no other program takes them"
        )


def flow_cost(
    cells: float, cell_size: float, speed: float, duration: float, interval: float, courant: float, threads: int = 1
) -> FlowCost:
    """Estimate what the flow solver takes for a run.

    Parameters
    ----------
    cells : float
        Cells of the grid.
    cell_size : float
        Smallest width of a cell [m].
    speed : float
        Largest speed of the vehicle through the water [m/s].
    duration : float
        Simulated time [s].
    interval : float
        Interval of the loads [s], which the solver divides where the Courant number asks for it.
    courant : float
        Courant number allowed [-].
    threads : int
        Threads of the kernels.
    """
    parts = max(math.ceil(interval * COURANT_FACTOR * speed / (courant * cell_size) - 1e-9), 1)
    steps = parts * duration / interval
    step = cells * TIME_PER_CELL * (SERIAL_SHARE + (1.0 - SERIAL_SHARE) / threads)
    return FlowCost(cells, BYTES_PER_CELL * cells, steps, steps * step, threads)


def require_room(owner: str, grid: Grid) -> None:
    """Refuse a grid for which there is no memory, with the cell size that would fit.

    Parameters
    ----------
    owner : str
        Where the grid comes from, with the value that decides.
    grid : Grid

    Raises
    ------
    ValueError
        If the solver would not fit.
    """
    if grid.n_cells > most_cells():
        size = fitting_size(grid.smallest_width, grid.cells_with)
        require_memory(
            f"{owner} makes {grid.n_cells:.2g} cells", BYTES_PER_CELL * grid.n_cells, f"cells of {size:g} m would fit."
        )
