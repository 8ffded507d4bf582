"""What training takes, about, said before it begins."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import xarray as xr

from exumob.learning.presets import Preset
from exumob.support.cost import announce, cores, spelled_time

MEASURED_TIME = 72.0
"""Simulated time of the runs with which the times were measured: nine of 8 s [s]."""
LSTM_TIME, OTHER_TIME = 180.0, 10.0
"""Time for a seed (five networks) on one core: LSTMs with the paper's window of the past, and all others [s]."""
PAPER_TAPS = 3
"""Samples in that window."""


def seed_time(preset: Preset, simulated: float) -> float:
    """Return the time that one seed takes on one core [s], from runs of so many simulated seconds."""
    kind = preset.architecture
    usual = LSTM_TIME * kind.taps / PAPER_TAPS if kind.layer == "lstm" else OTHER_TIME
    return max(usual, OTHER_TIME) * preset.epochs / 100.0 * simulated / MEASURED_TIME


def training_time(presets: Sequence[Preset], runs: Mapping[str, xr.Dataset], seeds: int) -> float:
    """Return the time that training takes on one core [s], if nothing of it is there yet."""
    simulated = sum(float(run["time"][-1]) for run in runs.values())
    return seeds * sum(seed_time(preset, simulated) for preset in presets)


def announce_training(presets: Sequence[Preset], runs: Mapping[str, xr.Dataset], seeds: int, jobs: int) -> None:
    """Say what training takes, if that is long."""
    seconds = training_time(presets, runs, seeds) / max(min(jobs, cores()), 1)
    announce(
        f"training of {5 * seeds * len(presets)} networks with {jobs} processes: about {spelled_time(seconds)}, less "
        "what is finished already.", seconds,
    )  # fmt: skip
