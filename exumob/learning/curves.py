"""Learning curves as a figure."""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from exumob.surrogates.networks import NetworkSet
from exumob.vehicle.motion import BODIES


def plot_learning_curves(networks: Sequence[NetworkSet]) -> Figure:
    """Draw the error of the scaled loads over the epochs: training runs (dashed) and validation runs (solid)."""
    figure, rows = plt.subplots(1, len(BODIES), figsize=(13.0, 2.9), sharey=True, layout="constrained")
    for body, (axes, name) in enumerate(zip(rows, BODIES, strict=True)):
        for n, network in enumerate(networks):
            train, validation = (network.arrays[f"{kind}_loss"][body] for kind in ("training", "held_back"))
            epochs = np.arange(1, train.size + 1)
            marker = "o" if train.size == 1 else None
            axes.semilogy(epochs, train, ls="--", lw=0.9, color=f"C{n}", marker=marker, mfc="none")
            axes.semilogy(epochs, validation, lw=1.3, color=f"C{n}", marker=marker, label=network.about["held_back"])
        axes.set(title=name.replace("_", " "), xlabel="epoch")
    rows[0].set_ylabel("mean square error, scaled loads [-]")
    figure.legend(
        *rows[0].get_legend_handles_labels(), title="held back for\nvalidation (solid)", loc="outside right center",
        fontsize="small", title_fontsize="small",
    )  # fmt: skip
    return figure
