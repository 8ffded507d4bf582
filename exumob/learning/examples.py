"""Examples to learn from: inputs and loads of the five bodies along the runs, split by run, with their scalers.

What the paper leaves open: inputs and loads are scaled to zero mean and unit deviation over the training examples, and
every seed keeps some runs for validation, a tenth of those there are (`validation_runs`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.optimize import nnls

from exumob.learning.coverage import covering, reach
from exumob.learning.dataset import base_loads, body_states, load_runs, usable, water_of, windows
from exumob.learning.presets import Preset
from exumob.paper.scenarios import UNSEEN
from exumob.support.declared import checked
from exumob.surrogates.inputs import MIRRORED_BODIES, MIRRORED_LOADS, SAMPLING, mirror_signs, network_inputs
from exumob.surrogates.memory import filtered
from exumob.surrogates.networks import RANGE_STATES, TRAINED_DENSITY, Architecture, Single, range_scale
from exumob.vehicle.parameters import Vehicle
from exumob.water.wave_loads import WaveCoefficients

RANGE_INTERVAL = 10
"""Instants from one to the next of those that may stand for the training range."""


@dataclass(frozen=True)
class Examples:
    """Inputs and loads of one body along several runs; the mirrored ones, if any, come last."""

    inputs: list[Single]
    """Inputs of each run, shape (n, k)"""
    loads: list[Single]
    """Loads of each run [N, N m], shape (n, 6): smoothed, less the base model's"""
    usable: list[NDArray[np.bool_]]
    """Instants of each run from which the network may learn, shape (n,)"""
    filters: tuple[float, ...]
    """Time constants of the filtered inputs [s]"""
    count: int
    """Runs before the mirrored ones: run n is mirrored in run n + count"""

    @cached_property
    def filtered(self) -> list[Single]:
        """Filtered inputs of each run, shape (n, filters, k)."""
        return [filtered(x, self.filters, SAMPLING) for x in self.inputs]

    def choose(self, runs: Sequence[int], offset: int, thinning: int) -> list[tuple[int, NDArray[np.intp]]]:
        """Choose every `thinning`-th row of some runs, from `offset` on, where it is usable."""
        rows = [np.arange(offset, len(self.inputs[r]), thinning) for r in runs]
        return [(r, n[self.usable[r][n]]) for r, n in zip(runs, rows, strict=True)]

    def gather(
        self, chosen: Sequence[tuple[int, NDArray[np.intp]]], architecture: Architecture
    ) -> tuple[Single, Single]:
        """Windows, shape (m, window, k), and loads, shape (m, 6), of chosen rows."""
        past = self.filtered
        x = np.concatenate([windows(self.inputs[run], rows, architecture, past[run]) for run, rows in chosen])
        return x, np.concatenate([self.loads[run][rows] for run, rows in chosen])


@checked
def training_runs(folder: str | Path | Sequence[str | Path]) -> dict[str, xr.Dataset]:
    """Runs to learn from in one or several folders, by name.

    Runs that are kept for evaluation are left out: those of the paper (`exumob.paper.scenarios.UNSEEN`), and those
    whose attribute ``role`` is "apart" (`exumob.learning.plan`).

    Raises
    ------
    ValueError
        If there is no such folder, they hold fewer than two, or two runs of the same name.
    """
    folders = [folder] if isinstance(folder, str | Path) else list(folder)
    files: list[Path] = []
    for one in map(Path, folders):
        if not one.is_dir():
            what = "is a file" if one.exists() else "does not exist"
            raise ValueError(f"training_runs.folder = {one} {what}; give a folder of runs (netCDF).")
        files += sorted(one.glob("*.nc"))
    unseen = {scenario.file_stem for scenario in UNSEEN}
    found = load_runs(file for file in files if file.stem not in unseen)
    apart = {scenario.name for scenario in UNSEEN}
    runs = {name: run for name, run in found.items() if name not in apart and run.attrs.get("role") != "apart"}
    if len(runs) < 2:
        where = f"the folder {folders[0]} holds" if len(folders) == 1 else f"{len(folders)} folders hold"
        raise ValueError(
            f"training_runs: {where} {len(runs)} runs to learn from, and two at "
            "least are needed (one is for validation); "
            "studies/generate_training_data.py makes them, exumob.learning.importing reads yours."
        )
    return runs


def validation_runs(runs: Mapping[str, xr.Dataset], seed: int) -> list[str]:
    """Names of the runs that a seed keeps for validation, a tenth of all, but one at least.

    Their depth and current lie within those of the others.
    """
    names = sorted(runs)
    points = np.array([[1.0, (w := water_of(runs[name])).uniform_depth, w.current_speed] for name in names])
    scaled = points / np.maximum(np.abs(points).max(axis=0), 1e-12)
    inside = [
        name for n, name in enumerate(names) if nnls(np.delete(scaled, n, axis=0).T, scaled[n])[1] < 1e-6
    ] or names  # fmt: skip
    number = min(max(len(names) // 10, 1), len(inside))
    return [inside[(seed + n * len(inside) // number) % len(inside)] for n in range(number)]


def build_examples(
    runs: Mapping[str, xr.Dataset], vehicle: Vehicle, preset: Preset, waves: WaveCoefficients | None = None
) -> tuple[list[str], list[Examples]]:
    """Names of the runs in the order of the examples, and the examples of each of the five bodies.

    `waves` are those of the coefficients to which the networks' loads are added, if they are; None: there are none.
    """
    names = sorted(runs)
    architecture = preset.architecture
    inputs = [network_inputs(body_states(runs[n]), water_of(runs[n]), architecture.inputs) for n in names]
    loads = [runs[n]["water_wrench_smooth"].values.astype(float) for n in names]
    if architecture.base == "coefficients":
        loads = [load - base_loads(runs[n], vehicle, waves) for n, load in zip(names, loads, strict=True)]
    loads = [load * (TRAINED_DENSITY / water_of(runs[n]).density) for n, load in zip(names, loads, strict=True)]
    good = [usable(runs[n]) for n in names]
    if preset.mirror:
        order, signs = list(MIRRORED_BODIES), mirror_signs(architecture.inputs)
        inputs += [x[:, order] * signs for x in inputs]
        loads += [y[:, order] * MIRRORED_LOADS for y in loads]
        good += good
    return names, [
        Examples(
            [x[:, b].astype(np.float32) for x in inputs],
            [y[:, b].astype(np.float32) for y in loads],
            good,
            architecture.filters,
            len(names),
        )
        for b in range(5)
    ]


def scalers(found: Examples, runs: Sequence[int], inputs: Sequence[str]) -> dict[str, Single]:
    """Scalers and training range of one body, by the names of `exumob.surrogates.networks.NetworkSet.arrays`.

    `inputs` are the names of the inputs.
    """
    chosen = found.choose(runs, 0, 1)
    x = np.concatenate([found.inputs[r][rows] for r, rows in chosen]).astype(float)
    y = np.concatenate([found.loads[r][rows] for r, rows in chosen]).astype(float)
    scale = x.std(axis=0)
    scale = np.where(scale > 1e-6, scale, 1.0)
    compared = range_scale(inputs, np.asarray(scale, np.float32), x.max(axis=0) > x.min(axis=0))[0]
    some = found.choose(runs, 0, RANGE_INTERVAL)
    scaled = (np.concatenate([found.inputs[r][rows] for r, rows in some]) - x.mean(axis=0)) / compared
    of = np.concatenate([np.full(len(rows), r % found.count) for r, rows in some])
    states = covering(scaled, RANGE_STATES)
    return {
        name: np.asarray(value, np.float32)
        for name, value in {
            "input_mean": x.mean(axis=0), "input_scale": scale, "input_low": x.min(axis=0), "input_high": x.max(axis=0),
            "range_states": scaled[states], "range_reach": reach(scaled, of, states), "output_mean": y.mean(axis=0),
            "output_scale": np.maximum(y.std(axis=0), 1e-6),
        }.items()
    }  # fmt: skip
