"""Tables and figures of an evaluation (`exumob.learning.evaluation.compare`), shared by the studies."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from exumob.learning.presets import LANE_CHANGES, PRESETS, WHOLE_RANGE
from exumob.support.arrays import Array
from exumob.support.figures import STYLE
from exumob.surrogates.model import SurrogateHydrodynamics, shipped_networks
from exumob.water.calibrated import CalibratedHydrodynamics
from exumob.water.coefficients import CoefficientHydrodynamics
from exumob.water.hydrodynamics import Hydrodynamics

ENSEMBLE = f"{LANE_CHANGES}, ensemble"
"""The networks for lane changes that come with exumob, all together."""
OF_LANE_CHANGES = tuple(name for name in PRESETS if name != WHOLE_RANGE)
"""Presets that are compared on the runs of the paper's range."""
PUBLISHED = "published coefficients"
"""`CoefficientHydrodynamics`, none of whose coefficients is fitted to the runs."""
FITTED = "fitted coefficients"
"""`CalibratedHydrodynamics` with the coefficients that the shipped networks rest on, fitted to the same runs."""
MEASURES = (("path", 1.0, "%"), ("final", 1.0, "%"), ("yaw", 1.0, "deg"), ("lateral_velocity", 1e3, "mm/s"))
"""Columns of a table: measure, factor, unit."""


def load_models(folder: Path, presets: Sequence[str] = OF_LANE_CHANGES) -> dict[str, list[Hydrodynamics]]:
    """Load the members of each model: coefficients, networks trained into a folder, shipped ensemble.

    Parameters
    ----------
    folder : Path
        Folder of `exumob train`.
    presets : sequence of str
        Names of the presets whose networks are loaded.

    Returns
    -------
    dict
        Models of the water's loads by name: one for each seed.

    Raises
    ------
    ValueError
        If the folder holds no networks of a preset.
    """
    shipped = SurrogateHydrodynamics(shipped_networks())
    found: dict[str, list[Hydrodynamics]] = {
        PUBLISHED: [CoefficientHydrodynamics()], FITTED: [CalibratedHydrodynamics(waves=shipped.waves)]
    }  # fmt: skip
    for preset in presets:
        files = sorted(folder.glob(f"{preset}_seed*.safetensors"))
        if not files:
            raise ValueError(f"{folder} holds no networks of {preset}; first: exumob train --output {folder}")
        found[preset] = [SurrogateHydrodynamics(file) for file in files]
    return found | {ENSEMBLE: [shipped]}


def plot_paths(
    runs: Mapping[tuple[str, str], Sequence[xr.Dataset]], references: Mapping[str, xr.Dataset], models: Sequence[str]
) -> Figure:
    """Draw the paths, a panel for each model (paper Figs. 11, 12, 15): CFD-MBD dashed, a solid line for each member."""
    with plt.rc_context(STYLE):
        figure, panels = plt.subplots(
            len(models), 1, figsize=(9.0, 0.4 + 3.2 * len(models)), sharex=True, squeeze=False, layout="constrained"
        )
        for axes, model in zip(panels.flat, models, strict=True):
            for n, (scenario, reference) in enumerate(references.items()):
                axes.plot(*_path(reference), color=f"C{n}", ls="--", lw=1.6)
                for k, run in enumerate(runs[model, scenario]):
                    axes.plot(*_path(run), color=f"C{n}", lw=1.0, alpha=0.8, label=None if k else scenario)
            axes.set(xlabel="x [m]", ylabel="y [m]", title=f"{model} (dashed: CFD-MBD)")
            axes.set_ylim(-0.15, 1.05)
            axes.legend(loc="upper left", ncols=2 if len(references) < 6 else 3, fontsize="small")
    return figure


def markdown(table: xr.Dataset) -> str:
    """Table of means over the scenarios, +- the spread of the members' means; in brackets the worst scenario's mean."""
    lines = [
        "| model | load error | path | final position (worst) | yaw | lateral velocity |",
        "|---|---|---|---|---|---|",
    ]
    for model in table["model"].values:
        one = table.sel(model=model)
        loads = float(one["load_error"].mean())
        cells = [str(model), f"{loads:.2f}" if np.isfinite(loads) else "-"]
        for name, factor, unit in MEASURES:
            members = factor * one[name].mean("scenario", skipna=False)
            spread = f" +- {float(members.std(ddof=1)):.2f}" if int(members.notnull().sum()) > 1 else ""
            worst = f" ({float(one[name].mean('member').max()):.1f} %)" if name == "final" else ""
            cells.append(f"{float(members.mean()):.2f}{spread} {unit}{worst}")
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def by_scenario(table: xr.Dataset, measure: str = "final", unit: str = "%") -> str:
    """Table with a row for each model and a column for each scenario: mean of the members, +- their spread."""
    names = [str(s) for s in table["scenario"].values]
    lines = [f"| {measure} [{unit}] | {' | '.join(names)} |", "|---" * (len(names) + 1) + "|"]
    for model in table["model"].values:
        cells = [str(model)]
        for name in names:
            values = table[measure].sel(model=model, scenario=name).dropna("member")
            spread = f" +- {float(values.std(ddof=1)):.1f}" if values.size > 1 else ""
            cells.append(f"{float(values.mean()):.1f}{spread}")
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def _path(run: xr.Dataset) -> Array:
    """Path of the hull from where it started [m]; shape (2, n)."""
    path = run["position"].sel(body="hull").values[:, :2].astype(float)
    return np.asarray((path - path[0]).T)
