"""The style of all figures, and how they are saved."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
from matplotlib.figure import Figure

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


def save_figure(figure: Figure, file: str | Path) -> Path:
    """Save a figure and close it."""
    path = Path(file)
    figure.savefig(path)
    plt.close(figure)
    return path
