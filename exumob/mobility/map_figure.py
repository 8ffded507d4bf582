"""Figure of a mobility map."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.contour import QuadContourSet
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from exumob.support.figures import STYLE

AXIS_NAMES = {
    "water.current_speed": "current [m/s]", "water.depth_ratio": "depth over tyre diameter", "water.depth": "depth [m]",
}  # fmt: skip
"""Labels of the axes, by dotted name."""
FAILURE_COLORS = ("none", "0.25", "C0", "C4", "C5", "C3", "C1", "C6", "0.6", "C9", "C8")
"""Colours of failures, by index of `exumob.mobility.crossing.FAILURES`."""


def plot_map(mapped: xr.Dataset, checks: xr.Dataset | None = None) -> Figure:
    """Draw a map: chance to cross (colours, border lines), speed ahead (dotted lines), kind of failure (dots).

    Parameters
    ----------
    mapped : xarray.Dataset
        Result of `exumob.mobility.map.compute_map`. Where the networks' answer does not count, it is hatched instead
        of coloured.
    checks : xarray.Dataset, optional
        Verdicts on runs with the flow in the loop, for the first panel: x, y, crossed (1 or 0) along one dimension.
    """
    panels = mapped["panel"].values
    failures = mapped.attrs["failures"].split(", ")
    keys: list[Artist] = []
    with plt.rc_context(STYLE | {"axes.grid": False}):
        figure, rows = plt.subplots(
            1, len(panels), figsize=(1.0 + 4.2 * len(panels), 4.2), sharey=True, layout="constrained", squeeze=False
        )
        found: set[int] = set()
        for axes, panel in zip(rows[0], panels, strict=True):
            colours, kinds = _draw_panel(axes, mapped.sel(panel=panel), mapped.attrs["range_share"])
            found |= kinds
            axes.set(title=panel, xlabel=AXIS_NAMES.get(mapped.attrs["x"], mapped.attrs["x"]))
        rows[0, 0].set(ylabel=AXIS_NAMES.get(mapped.attrs["y"], mapped.attrs["y"]))
        if checks is not None:
            keys += _draw_checks(rows[0, 0], checks)
        keys += [Line2D([], [], color=FAILURE_COLORS[k], marker=".", ls="", label=failures[k]) for k in sorted(found)]
        keys.append(Patch(facecolor="w", edgecolor="k", hatch="////", label="outside the training range"))
        figure.legend(handles=keys, loc="outside lower center", ncols=len(keys))
        bar = figure.colorbar(colours, ax=list(rows[0]), shrink=0.9)  # the same levels in all
        bar.set_label(f"chance to cross ({mapped.attrs['least_speed']:.2g} m/s at least)")
    return figure


def _draw_panel(axes: Axes, panel: xr.Dataset, range_share: float) -> tuple[QuadContourSet, set[int]]:
    """Draw one panel; return the colours, for their bar, and the kinds of failure that are marked."""
    x, y, chance, outside = (panel[name].values for name in ("x", "y", "probability", "out_of_range"))
    outside = np.where(np.isfinite(chance), outside, 1.0)  # every run was lost: no answer
    chance = np.nan_to_num(chance)
    colours = axes.contourf(x, y, chance, np.linspace(0.0, 1.0, 11), cmap="RdYlBu", alpha=0.85)
    if chance.min() < 0.5 < chance.max():
        border = axes.contour(x, y, chance, [0.1, 0.5, 0.9], colors="k", linewidths=[0.8, 2.0, 0.8])
        axes.clabel(border, fmt=lambda p: f"{100.0 * p:.0f} %", fontsize=8)
    speed = axes.contour(
        x, y, np.ma.masked_invalid(panel["speed"].values), colors="0.35", linewidths=0.6, linestyles=":"
    )
    axes.clabel(speed, fmt="%.1f m/s", fontsize=7)
    failed = (panel["runs"].values > 0) & (chance < 0.5) & (outside <= range_share)
    kinds = {int(kind) for kind in panel["failure"].values[failed]}
    for kind in sorted(kinds):
        i, j = np.nonzero(failed & (panel["failure"].values == kind))
        axes.plot(x[j], y[i], ".", color=FAILURE_COLORS[kind], ms=5)
    if outside.max() > range_share:
        axes.contourf(x, y, outside, [range_share, 2.0], colors="w", zorder=3)
        axes.contourf(x, y, outside, [range_share, 2.0], colors="none", hatches=["////"], zorder=3)
    return colours, kinds


def _draw_checks(axes: Axes, checks: xr.Dataset) -> list[Line2D]:
    """Mark the verdicts of runs with the flow in the loop; return the lines for the legend."""
    lines = []
    for crossed, marker, face, edge, text in ((1, "o", "w", "k", "crosses"), (0, "X", "k", "w", "does not")):
        of = checks["crossed"].values == crossed
        lines += axes.plot(
            checks["x"].values[of], checks["y"].values[of], marker, mfc=face, mec=edge, ms=8, clip_on=False,
            zorder=5, label=f"with the flow in the loop: {text}",
        )  # fmt: skip
    return lines
