"""Figures of captive runs: the loads on the five bodies over time, and the free surface beside them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure

from exumob.flow.output.pictures import describe, plot_surfaces
from exumob.support.declared import checked
from exumob.support.figures import STYLE, footnote, trust_notes
from exumob.towing_tank.record import require_captive
from exumob.vehicle.motion import BODIES

BODY_COLORS = dict(zip(BODIES, ("C0", "C1", "C3", "C2", "C4"), strict=True))


def plot_load(
    axes: Axes, dataset: xr.Dataset, name: str, axis: str, bodies: Sequence[str], **style: Any
) -> list[Artist]:
    """Draw one component of "force" or "moment" on some bodies over time: raw thin, smoothed thick, body axes."""
    artists: list[Artist] = []
    for body in bodies:
        one = dataset.sel(body=body, axis=axis)
        look: dict[str, Any] = {"color": BODY_COLORS[body]} | style
        artists += axes.plot(dataset["time"], one[name], lw=0.4, alpha=0.45, **look)
        artists += axes.plot(dataset["time"], one[f"{name}_smooth"], lw=1.5, label=body.replace("_", " "), **look)
    return artists


@checked
def plot_captive_loads(figure: Figure | SubFigure, dataset: xr.Dataset) -> list[Axes]:
    """Draw forces and moments of the hull, and the same of the wheels; dashed: means of the second half."""
    require_captive(dataset, "plot_captive_loads")
    panels = figure.subplots(4, 3, sharex=True)
    later = dataset.sel(time=slice(0.5 * float(dataset["time"][-1]), None))
    for row, (bodies, name) in enumerate((b, n) for b in (BODIES[:1], BODIES[1:]) for n in ("force", "moment")):
        smooth = dataset[f"{name}_smooth"].sel(body=list(bodies))
        whole = float(np.abs(smooth).max()) or 1.0
        for axes, axis in zip(panels[row], "xyz", strict=True):
            plot_load(axes, dataset, name, axis, bodies)
            for body in bodies:
                mean = float(later[name].sel(body=body, axis=axis).mean())
                start = float(later["time"][0])
                axes.plot([start, float(later["time"][-1])], [mean, mean], "--", color=BODY_COLORS[body], lw=0.9)
            values = smooth.sel(axis=axis).values
            low, high = float(values.min()), float(values.max())
            half = max(0.65 * (high - low), 0.04 * whole)  # what is nearly nothing must not fill its panel
            axes.set_ylim(0.5 * (low + high) - half, 0.5 * (low + high) + half)
            unit = "N" if name == "force" else "N m"
            axes.set_ylabel(f"${'F' if name == 'force' else 'M'}_{axis}$ [{unit}]")
            if row == 3:
                axes.set_xlabel("time [s]")
        who = "hull" if row < 2 else "wheels"
        panels[row][0].set_title(f"{name} on the {who}", loc="left")
    legend = panels[2][1].legend(ncols=4, loc="lower left", bbox_to_anchor=(-0.1, 1.0), borderaxespad=0.2)
    legend.set_in_layout(False)  # it may reach over its neighbours' empty titles
    return list(panels.flat)


@checked
def plot_captive(dataset: xr.Dataset) -> Figure:
    """Draw a captive run on one page: the free surface at two instants if snapshots were kept, and the loads."""
    require_captive(dataset, "plot_captive")
    if dataset.sizes["time"] < 3:
        raise ValueError(
            f"plot_captive.dataset holds {dataset.sizes['time']} instants; it takes three to draw them, so run longer."
        )
    with plt.rc_context(STYLE):
        window = 1e3 * float(dataset.attrs["smoothing_window"])
        about = f"water on the vehicle, body axes; thin: raw, thick: mean over {window:.0f} ms, dashed: mean"
        if "elevation" not in dataset:
            figure = plt.figure(figsize=(11.0, 8.5), layout="constrained")
            plot_captive_loads(figure, dataset)
            figure.suptitle(f"{describe(dataset)}\n{about}", fontsize=10)
            footnote(figure, *trust_notes([dataset]))
            return figure
        figure = plt.figure(figsize=(11.0, 12.0), layout="constrained")
        parts: Any = figure.subfigures(2, 1, height_ratios=[1.0, 2.3])
        above, below = parts
        plot_surfaces(above, dataset)
        above.suptitle(describe(dataset), fontsize=11, fontweight="bold")
        plot_captive_loads(below, dataset)
        below.suptitle(about, fontsize=9)
        footnote(below, *trust_notes([dataset]))
    return figure
