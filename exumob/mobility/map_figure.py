"""Figure of a mobility map: it draws no line that the runs at the nodes do not support."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from contourpy import contour_generator
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import BoundaryNorm
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray
from scipy.interpolate import griddata

from exumob.mobility.lattice import CONFIDENCE, fewest_runs, separated_cells
from exumob.support.arrays import Array
from exumob.support.figures import STYLE, footnote, trust_notes

AXIS_NAMES = {
    "water.current_speed": "current [m/s]", "water.depth_ratio": "depth over tyre diameter [-]",
    "water.depth": "depth [m]",
}  # fmt: skip
"""Labels of the axes, by dotted name; others are labelled by their name and unit."""
FAILURE_COLORS = ("none", "0.25", "C0", "C4", "C5", "C3", "C1", "C6", "0.6", "C9", "C8", "C2")
"""Colours of failures, by index of `exumob.mobility.crossing.FAILURES`."""
LEVELS: dict[float, Any] = {
    0.1: {"lw": 1.0, "ls": (0, (5, 1.5, 1, 1.5))}, 0.5: {"lw": 2.0, "ls": "-"}, 0.9: {"lw": 1.0, "ls": (0, (5, 1.5))},
}  # fmt: skip
"""Chances of which lines are drawn where the runs support them [-], and how."""
NEAR_EDGE = 0.06
"""Distance from the edge of a panel, over its size, within which a line has no label."""
SHADES = np.linspace(0.0, 1.0, 11)
"""Bounds of the colours of the chance."""
GO, NO_GO = "#92b8d8", "#e8906a"
"""Colours of a map with one run a node."""


def plot_map(mapped: xr.Dataset, checks: xr.Dataset | None = None) -> Figure:
    """Draw a map: chance to cross (colours), speed ahead (dotted lines), kind of failure (dots), what is not known.

    A line of equal chance is drawn only between nodes whose intervals lie on either side of it. Where the interval
    holds 50 %, dots are drawn over the colours: there go and no-go are not decided. With one run a node there
    is no chance: go and no-go are coloured, with the border between them.

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
    single = int(mapped["runs"].max()) <= 1
    found: dict[str, Artist] = {}
    with plt.rc_context(STYLE | {"axes.grid": False}):
        figure, rows = plt.subplots(
            1,
            len(panels),
            figsize=(max(7.5, 1.6 + 4.4 * len(panels)), 5.8),
            sharey=True,
            layout="constrained",
            squeeze=False,
        )
        for axes, panel in zip(rows[0], panels, strict=True):
            of = mapped.sel(panel=panel)
            found |= _draw_panel(axes, of, mapped.attrs["range_share"], failures, single)
            axes.set(title=panel, xlabel=_label(mapped, "x"))
        rows[0, 0].set(ylabel=_label(mapped, "y"))
        if checks is not None:
            found |= _draw_checks(rows[0, 0], checks)
        keys = list(found.values())
        figure.legend(handles=keys, loc="outside upper center", ncols=3 if len(panels) == 1 else 4)
        if not single:
            bar = figure.colorbar(
                ScalarMappable(BoundaryNorm(SHADES, 256), "RdYlBu"), ax=list(rows[0]), shrink=0.9, alpha=0.85,
                ticks=SHADES[::2],
            )  # fmt: skip
            bar.set_label("share of the runs that cross [-]")
        footnote(figure, _about(mapped, single), *trust_notes([mapped]))
    return figure


def _about(mapped: xr.Dataset, single: bool) -> str:
    """What the colours and lines stand for."""
    runs = int(mapped["runs"].max())
    who = f"{mapped.attrs['vehicle']}. " if "vehicle" in mapped.attrs else ""  # maps of before do not say it
    whence = f"Current {mapped.attrs['current_from']}. " if mapped.attrs.get("current_from") else ""
    aside = f", at most {mapped.attrs['largest_drift']:g} m aside" if "largest_drift" in mapped.attrs else ""
    least = f"{mapped.attrs['least_speed']:.2g} m/s at least"
    goal = f"{who}{whence}Go: the width of {mapped.attrs['width']:g} m at {least}{aside}."
    if single:
        return f"{goal} One run a node: go or no-go, and no chance; between nodes the border is interpolated."
    confidence = f"{100.0 * CONFIDENCE:.0f} %"
    lines = f"A line is drawn only between nodes whose {confidence} intervals lie on either side of it"
    if runs < fewest_runs():
        lines = f"No line is drawn: with {runs} runs a node no chance can be told from 50 %, {fewest_runs()} are needed"
    return f"{goal} {runs} runs a node. {lines} (Wilson's interval)."


def _label(mapped: xr.Dataset, dim: str) -> str:
    """Label of an axis: name and unit."""
    name = str(mapped.attrs[dim])
    unit = mapped[dim].attrs.get("units", "1").replace("m s-1", "m/s")
    return AXIS_NAMES.get(name, f"{mapped[dim].attrs.get('long_name', name)} [{'-' if unit == '1' else unit}]")


def _draw_panel(
    axes: Axes, panel: xr.Dataset, range_share: float, failures: list[str], single: bool
) -> dict[str, Artist]:
    """Draw one panel; return the keys of the legend by their texts."""
    x, y, chance = (panel[name].values for name in ("x", "y", "probability"))
    outside = np.nan_to_num(panel["out_of_range"].values)  # nan: there is no training range
    outside = np.where(np.isfinite(chance), outside, 1.0 + range_share)  # every run was lost: no answer
    known = np.nan_to_num(chance)
    counts = _corner_mean(outside) <= range_share  # cells
    keys: dict[str, Artist] = {}
    if single:
        axes.contourf(x, y, known, [-0.01, 0.5, 1.01], colors=[NO_GO, GO])
        keys |= {text: Patch(color=color, label=text) for text, color in (("go", GO), ("no go", NO_GO))}
        text = "border of go and no-go, one run a node"
        keys |= _draw_line(axes, x, y, known, 0.5, counts, text)
    else:
        axes.contourf(x, y, known, SHADES, cmap="RdYlBu", alpha=0.85)
        low, high = (panel[f"probability_{side}"].values for side in ("low", "high"))
        inside_low, inside_high = (np.where(outside <= range_share, bound, np.nan) for bound in (low, high))
        for level in LEVELS:
            cells = separated_cells(inside_low, inside_high, level) & counts
            keys |= _draw_line(axes, x, y, known, level, cells, f"chance {100.0 * level:.0f} %")
        keys |= _draw_undecided(axes, x, y, low, high)
    keys |= _draw_speed(axes, x, y, np.where(outside <= range_share, panel["speed"].values, np.nan))
    computed = panel["runs"].values > 0
    failed = computed & (known < 0.5) & (outside <= range_share)
    for kind in sorted({int(kind) for kind in panel["failure"].values[failed]}):
        i, j = np.nonzero(failed & (panel["failure"].values == kind))
        line = axes.plot(x[j], y[i], ".", color=FAILURE_COLORS[kind], mec="w", mew=0.4, ms=7, clip_on=False, zorder=4)
        line[0].set_label(f"no go: {failures[kind]}")
        keys[str(line[0].get_label())] = line[0]
    if outside.max() > range_share:
        ends = [range_share, 3.0]
        axes.contourf(x, y, outside, ends, colors="w", zorder=3)
        axes.contourf(x, y, outside, ends, colors="none", hatches=["////"], zorder=3)
        text = "outside the training range" if np.isfinite(chance).all() else "no answer"
        keys[text] = Patch(facecolor="w", edgecolor="k", hatch="////", label=text)
    return keys


def _draw_line(
    axes: Axes, x: Array, y: Array, chance: Array, level: float, cells: NDArray[np.bool_], text: str
) -> dict[str, Artist]:
    """Draw the line of one chance, in some cells only; return its key, if anything is drawn."""
    if not chance.min() < level < chance.max():
        return {}
    pieces = []
    for line in contour_generator(x, y, chance).lines(level):
        points = np.asarray(line)
        for one, other in itertools.pairwise(points):
            middle = 0.5 * (one + other)
            j = min(int(np.searchsorted(x, middle[0], "right")) - 1, len(x) - 2)
            i = min(int(np.searchsorted(y, middle[1], "right")) - 1, len(y) - 2)
            if cells[i, j]:
                pieces.append(np.stack([one, other]))
    if not pieces:
        return {}
    look = LEVELS[level]
    for run in _joined(pieces):
        axes.plot(*run.T, color="k", **look)
    return {text: Line2D([], [], color="k", label=text, **look)}


def _joined(pieces: list[Array]) -> list[Array]:
    """Join pieces of a line that follow each other."""
    found: list[list[Array]] = []
    for one, other in pieces:
        if found and np.array_equal(found[-1][-1], one):
            found[-1].append(other)
        else:
            found.append([one, other])
    return [np.array(points) for points in found]


def _corner_mean(values: Array) -> Array:
    """Mean over the four corners of each cell, shape (n, m) -> (n - 1, m - 1)."""
    return np.asarray(0.25 * (values[:-1, :-1] + values[1:, :-1] + values[:-1, 1:] + values[1:, 1:]))


def _draw_undecided(axes: Axes, x: Array, y: Array, low: Array, high: Array) -> dict[str, Artist]:
    """Mark where the intervals hold 50 %, that of interpolated nodes interpolated."""
    fine_x, fine_y = (np.linspace(axis[0], axis[-1], 8 * len(axis) - 7) for axis in (x, y))
    low, high = (_bilinear(x, y, _filled(bound), fine_x, fine_y) for bound in (low, high))
    undecided = np.minimum(0.5 - low, high - 0.5)  # finely: between two decided nodes there is a place that is not
    if undecided.max() <= 0.0:
        return {}
    dots = axes.contourf(fine_x, fine_y, undecided, [0.0, 1.0], colors="none", hatches=["..."])
    dots.set(edgecolor="0.2", linewidth=0.0)
    text = f"not decided: the {100.0 * CONFIDENCE:.0f} % interval holds 50 %"
    return {text: Patch(facecolor="w", edgecolor="0.2", lw=0.0, hatch="...", label=text)}


def _bilinear(x: Array, y: Array, values: Array, fine_x: Array, fine_y: Array) -> Array:
    """Values on a finer grid, shape (len(y), len(x)) -> (len(fine_y), len(fine_x))."""
    along = np.array([np.interp(fine_x, x, row) for row in values])
    return np.array([np.interp(fine_y, y, column) for column in along.T]).T


def _filled(values: Array) -> Array:
    """Fill nan by linear interpolation between the other nodes; 0 where there is none to both sides."""
    known = np.isfinite(values)
    if known.all() or known.sum() < 4:
        return np.nan_to_num(values)
    places = np.argwhere(known)
    try:
        found = griddata(places, values[known], np.argwhere(np.ones_like(known)), "linear")
    except Exception:  # all in one row: Qhull's error has no public name of its own
        return np.nan_to_num(values)
    return np.nan_to_num(found.reshape(values.shape))


def _draw_speed(axes: Axes, x: Array, y: Array, speed: Array) -> dict[str, Artist]:
    """Draw lines of equal speed ahead; return their key, if there are any."""
    finite = speed[np.isfinite(speed)]
    if finite.size == 0 or np.ptp(finite) < 0.02:
        return {}
    style: dict[str, Any] = {"colors": "0.35", "linewidths": 0.6, "linestyles": ":"}
    lines = axes.contour(x, y, np.ma.masked_invalid(speed), **style)
    places = [place for segments in lines.allsegs if (place := _place_of_label(axes, segments)) is not None]
    if places:  # none would be as many as there are
        axes.clabel(lines, fmt=lambda speed: f"{speed:.3g} m/s", fontsize=7, manual=places)
    return {"speed": Line2D([], [], color="0.35", lw=0.8, ls=":", label="mean speed ahead")}


def _place_of_label(axes: Axes, segments: Sequence[NDArray[Any]]) -> tuple[float, float] | None:
    """Place on the pieces of a line that is nearest to the middle of the axes; None: a label there would be cut."""
    best, least = None, 0.5 - NEAR_EDGE
    for segment in (one for one in segments if len(one)):
        parts = np.linspace(0.0, len(segment) - 1.0, 20 * len(segment))
        fine = np.stack([np.interp(parts, np.arange(len(segment)), column) for column in segment.T], axis=1)
        away = np.abs(axes.transAxes.inverted().transform(axes.transData.transform(fine)) - 0.5).max(axis=1)
        if away.min() < least:
            best, least = fine[int(away.argmin())], float(away.min())
    return None if best is None else (float(best[0]), float(best[1]))


def _draw_checks(axes: Axes, checks: xr.Dataset) -> dict[str, Artist]:
    """Mark the verdicts of runs with the flow in the loop; return their keys."""
    keys: dict[str, Artist] = {}
    for crossed, marker, face, edge, text in ((1, "o", "w", "k", "crosses"), (0, "X", "k", "w", "does not")):
        of = checks["crossed"].values == crossed
        label = f"with the flow in the loop: {text}"
        keys[label] = axes.plot(
            checks["x"].values[of], checks["y"].values[of], marker, mfc=face, mec=edge, ms=8, clip_on=False,
            zorder=5, label=label,
        )[0]  # fmt: skip
    return keys
