"""From a vehicle to networks with a report card: plan, runs, training, validation; each step goes on where it was."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import xarray as xr

from exumob.learning.campaign import LearningFolder
from exumob.learning.plan import LearningPlan
from exumob.learning.report_card import CardContents, report_card
from exumob.learning.training import Progress, train
from exumob.learning.validation import card_figures, compare_drives, compare_loads, load_errors
from exumob.support.files import write_text
from exumob.surrogates.ensemble import save_ensemble
from exumob.surrogates.networks import NetworkSet

NETWORKS, CARD = "networks.safetensors", "report_card.html"
"""Files of the networks and of the report card in a folder."""
LEAST_TAUGHT = 2
"""Runs to learn from that there must be: one of them is for validation while training."""


@dataclass(frozen=True)
class Learnt:
    """What came of it."""

    networks: Path
    card: Path
    figures: dict[str, Any]
    """See `exumob.learning.validation.card_figures`"""


def learn_from(  # each argument is a choice of its own
    plan: LearningPlan, folder: LearningFolder, *, jobs: int = 1, mixed: bool = False,
    failed: Mapping[str, str] | None = None, progress: Callable[[Progress], None] | None = None,
) -> Learnt:  # fmt: skip
    """Train networks from the runs of a folder, try them on those kept apart, and write networks and report card.

    Runs kept apart are those whose attribute ``role`` says so; all others in the folder teach, those of other programs
    too.

    Parameters
    ----------
    plan : LearningPlan
    folder : LearningFolder
    jobs : int
        Processes of the training.
    mixed : bool
        Take runs of several versions of the flow solver.
    failed : mapping, optional
        Errors of runs that broke down, by name.
    progress : callable, optional
        Called after each epoch of each network.

    Raises
    ------
    ValueError
        If there are too few runs, or they are of another vehicle.
    """
    runs = folder.load(mixed, plan.vehicle)
    taught = {name: run for name, run in runs.items() if run.attrs.get("role") != "apart"}
    apart = {name: run for name, run in runs.items() if name not in taught}
    if len(taught) < LEAST_TAUGHT or not apart:
        remedy = "the same command tries those again that broke down" if failed else "give a larger --budget"
        raise ValueError(
            f"--output {folder.path}: {len(taught)} runs to learn from and {len(apart)} kept apart; {LEAST_TAUGHT} and "
            f"one are the least: {remedy}."
        )
    files = train([plan.preset], taught, plan.vehicle, folder.path / "networks", seeds=range(plan.seeds), jobs=jobs,
                  progress=progress)  # fmt: skip
    members = [NetworkSet.load(file) for file in files.values()]
    compared = {name: compare_loads(members, run, plan.vehicle) for name, run in apart.items()}
    errors = load_errors(compared, plan.vehicle)
    drives = compare_drives(members, plan, apart)
    figures = card_figures(plan, members, errors, drives, taught, apart)
    contents = CardContents(
        plan, figures, errors, drives, taught, apart, compared, dict(failed or {}), _spent(runs)
    )  # fmt: skip
    card = folder.path / CARD
    write_text(card, report_card(contents))
    return Learnt(save_ensemble(members, folder.path / NETWORKS, figures), card, figures)


def _spent(runs: Mapping[str, xr.Dataset]) -> float:
    """Wall time of the runs, each in one process [h]."""
    names = ("wall_time", "settling_wall_time")
    return sum(float(run.attrs.get(name, 0.0)) for run in runs.values() for name in names) / 3600.0
