"""The style of all figures, and how they are saved."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure

from exumob.support.files import atomic_write, require_ending

WATER_COLOR = "#4a90c2"


SOIL_COLOR = "#c8a165"


BODY_COLOR = "#3d4a57"


STYLE: Any = {
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.alpha": 0.3,
    "axes.titlesize": 10,
    "axes.titleweight": "bold",
    "axes.labelsize": 9,
    "xtick.labelsize": 8,
    "ytick.labelsize": 8,
    "legend.fontsize": 8,
    "legend.frameon": False,
    "figure.dpi": 110,
}


FOOTNOTE_SIZE = 7.0
"""Size of the letters of a footnote [points]."""


def footnote(figure: Figure | SubFigure, *texts: str) -> None:
    """Write texts below everything else, wrapped to the figure's width; the figure needs a constrained layout.

    Parameters
    ----------
    figure : Figure or SubFigure
    *texts : str
        One paragraph each; empty ones are left out.
    """
    characters = int(72.0 * figure.bbox.width / figure.dpi / (0.59 * FOOTNOTE_SIZE))
    wrapped = ["\n".join(textwrap.wrap(text, characters)) for text in texts if text]
    if wrapped:
        figure.supxlabel("\n".join(wrapped), x=0.01, ha="left", fontsize=FOOTNOTE_SIZE, color="0.25")


def trust_notes(runs: Iterable[xr.Dataset]) -> list[str]:
    """Return what results are worth, each text once, for the foot of a figure (see `exumob.simulation.trust`)."""
    known = [run.attrs for run in runs if run.attrs.get("trust")]
    several = len(known) > 1  # what is said of one run alone is left out, so that the rest is said once
    found = dict.fromkeys(
        str(attrs["trust"]).replace(str(attrs.get("trust_nearest", "")) if several else "\0", "") for attrs in known
    )
    return [f"Trust. {text}" for text in found]


def legend_above_curves(axes: Axes, ncols: int = 2, least: float = 0.0) -> None:
    """Place a legend within the axes, above what is drawn: the vertical range is made larger for it.

    Parameters
    ----------
    axes : Axes
    ncols : int
        Columns of the legend.
    least : float
        Smallest vertical range that is shown, so that rounding errors do not fill the axes.
    """
    low, high = axes.dataLim.intervaly
    entries = len(axes.get_legend_handles_labels()[1])
    if not np.isfinite([low, high]).all():
        low, high = 0.0, 0.0
    span = max(high - low, least, 1e-9 * max(abs(low), abs(high), 1.0))
    middle = 0.5 * (low + high)
    low, high = min(low, middle - 0.5 * span), max(high, middle + 0.5 * span)
    rows = -(-entries // ncols)
    axes.set_ylim(low - 0.06 * span, high + (0.08 + 0.17 * rows) * span)
    axes.legend(ncols=ncols, loc="upper center", columnspacing=1.2, handlelength=1.6)


def save_figure(figure: Figure, file: str | Path) -> Path:
    """Save a figure, whole or not at all, and close it.

    Raises
    ------
    ValueError
        If the file's ending is that of no format of matplotlib.
    OSError
        If it cannot be written.
    """
    path = Path(file)
    try:
        require_ending("save_figure.file =", path, [f".{kind}" for kind in figure.canvas.get_supported_filetypes()])
        with atomic_write(path) as temporary:
            figure.savefig(temporary, format=path.suffix[1:])
    finally:
        plt.close(figure)
    return path
