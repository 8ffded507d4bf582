"""Do the loads of the worst case converge with the grid, and how uncertain does the grid leave them?

Three grids: the grid-convergence index (`exumob.verification.uncertainty`) of mean and deviation of each load, beside
the statistical error of a turbulent run. Everything is reported, without limits. The case is slow.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from exumob.flow.vehicle_window import vehicle_window
from exumob.support.declared import checked
from exumob.vehicle.motion import BODIES
from exumob.verification.check import Case, Check, reported
from exumob.verification.options import CellSize, Duration, Interval, Threads
from exumob.verification.runs import DEPTH, loads_after, paper_vehicle
from exumob.verification.uncertainty import GridConvergence, deviation_uncertainty, grid_convergence, mean_uncertainty
from exumob.verification.worst_case import LOADS, worst_run
from exumob.water.conditions import Water

RATIOS = (0.028 / 0.018, 0.0224 / 0.018, 1.0)
"""Cell sizes of the three grids over that of the finest [-]."""


@checked
def load_convergence(
    cell_size: CellSize = 0.018, duration: Duration = 8.0, interval: Interval = 1.0e-3, threads: Threads = 1,
    allow_coarse: bool = True, ratios: Sequence[float] = RATIOS, hull_on_faces: bool = True,
) -> xr.Dataset:  # fmt: skip
    """Mean and deviation of the worst case's loads on three grids, with their uncertainties (dims load, cell_size).

    Cell sizes are `cell_size`, that of the finest grid, times `ratios`. The hull's bow, stern and sides lie on faces of
    every grid (`vehicle_window`), or, without `hull_on_faces`, wherever they happen to: then the loads go up and down
    from grid to grid.

    The mean's index of grid convergence is to be read together with the statistical error: differences between grids
    that are not larger than it say nothing of an order.
    """
    rows: dict[str, list[list[float]]] = {"mean": [], "mean_error": [], "deviation": [], "deviation_error": []}
    cell_sizes = [round(cell_size * ratio, 7) for ratio in ratios]
    for cell in cell_sizes:
        grid = vehicle_window(paper_vehicle(), cell, Water(DEPTH), hull_on_faces=hull_on_faces)
        run = worst_run(cell, duration, interval, threads, allow_coarse, grid=grid)
        series = [loads_after(run, 0.25 * duration)[:, BODIES.index(b), c] for b, c, _ in LOADS]
        means, deviations = [mean_uncertainty(s) for s in series], [deviation_uncertainty(s) for s in series]
        rows["mean"].append([m.mean for m in means])
        rows["mean_error"].append([m.error for m in means])
        rows["deviation"].append([d for d, _ in deviations])
        rows["deviation_error"].append([e for _, e in deviations])
    values = {name: np.array(table).T for name, table in rows.items()}
    result = xr.Dataset(
        {name: (("load", "cell_size"), table, {"units": "N or N m"}) for name, table in values.items()},
        coords={"load": [f"{body} {name}" for body, _, name in LOADS], "cell_size": cell_sizes},
    )
    for kind in ("mean", "deviation"):
        found: list[GridConvergence] = [grid_convergence(cell_sizes, row) for row in values[kind]]
        for name in ("order", "extrapolated", "gci"):
            result[f"{kind}_{name}"] = ("load", [float(getattr(g, name)) for g in found])
        result[f"{kind}_convergence"] = ("load", [g.kind for g in found])
    return result


@checked
def check_load_convergence(
    cell_size: CellSize = 0.018, duration: Duration = 8.0, interval: Interval = 1.0e-3, threads: Threads = 1,
    allow_coarse: bool = True, ratios: Sequence[float] = RATIOS, hull_on_faces: bool = True,
) -> list[Check]:  # fmt: skip
    """Report order, extrapolation, index and statistical error of each load."""
    found = load_convergence(cell_size, duration, interval, threads, allow_coarse, ratios, hull_on_faces)
    finest = found["cell_size"].values.argmin()
    checks = []
    for load in found["load"].values:
        row = found.sel(load=load)
        for kind in ("mean", "deviation"):
            unit, about = "N m" if load.endswith("My") else "N", f"{load}, {kind}"
            value, extrapolated = float(row[kind][finest]), float(row[f"{kind}_extrapolated"])
            checks.append(reported(f"{about}, finest against extrapolated", value, extrapolated, unit))
            checks.append(
                reported(f"{about}, order ({row[f'{kind}_convergence'].item()})", row[f"{kind}_order"].item())
            )
            checks.append(reported(f"{about}, grid-convergence index", row[f"{kind}_gci"].item(), unit=unit))
            checks.append(reported(f"{about}, statistical error", float(row[f"{kind}_error"][finest]), unit=unit))
    return checks


def plot_convergence(found: xr.Dataset) -> Figure:
    """Draw mean loads over cell size: statistical errors as bars, the index as a bar at the extrapolated value."""
    figure = Figure(figsize=(10.0, 6.0), layout="constrained")
    axes = figure.subplots(2, (found.sizes["load"] + 1) // 2).ravel()
    for ax, load in zip(axes, found["load"].values, strict=False):
        row, cells = found.sel(load=load), 1e3 * found["cell_size"].values
        ax.errorbar(cells, row["mean"], 2.0 * row["mean_error"], fmt="o-", capsize=3, label="mean, 2 standard errors")
        finest = float(row["mean"][cells.argmin()])
        ax.errorbar([cells.min() - 0.5], [finest], [float(row["mean_gci"])], fmt="none", capsize=5, label="GCI, finest")
        ax.plot([0.0], [float(row["mean_extrapolated"])], "x", label="extrapolated")
        body, component = str(load).replace("_", " ").rsplit(" ", 1)
        unit = "N m" if component.startswith("M") else "N"
        ax.set(title=body, xlabel="cell size [mm]", ylabel=f"${component[0]}_{component[1]}$ [{unit}]")
        ax.set_xlim(left=-1.0)
    for ax in axes[found.sizes["load"] :]:
        ax.set_axis_off()
    axes[-1].legend(*axes[0].get_legend_handles_labels(), fontsize="small", loc="center")
    return figure


def figure(**options: Any) -> Figure:
    """Draw the case with options of `load_convergence`; runs that it has made are not made again."""
    return plot_convergence(load_convergence(**options))


CASES: tuple[Case, ...] = (
    Case(
        "grid-convergence",
        "The worst case on three grids: grid-convergence index (Celik et al. 2008; reported)",
        check_load_convergence,
        40.0,
        slow=True,
        figure=figure,
    ),
)
