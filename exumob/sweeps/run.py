"""Running many cases: side by side, each kept as it ends, none lost to the failure of another.

The cases go through `exudyn.processing.ProcessParameterList`, with processes on one machine or with MPI on many. What
that does not do is done here: a case that raises, breaks down, runs out of time or takes its process with it becomes a
row with a status and a reason (`exumob.sweeps.processes`); finished cases are files, and are not run again; results
keep their parameters (`exumob.sweeps.case_store`).
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from numbers import Real
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from exumob.simulation.result_files import save_dataset
from exumob.sweeps.case_store import STATUSES, CaseStore, Function
from exumob.sweeps.experiment import Experiment
from exumob.sweeps.processes import run_in_processes, run_with_mpi
from exumob.sweeps.sampling import Case

CHECKED_VALUES = 50_000
"""Number of values of the cases that are checked before anything runs; this takes about a second."""


@dataclass(frozen=True)
class Progress:
    """Progress of a sweep."""

    done: int
    """Number of cases that have ended with any status, those of earlier calls included"""
    total: int
    """Number of all cases"""
    left: float
    """Estimated time to the end [s]; nan until a case has ended"""


# nine arguments: the first three say what is run and where it is kept, the others are independent options
def sweep(
    function: Function, cases: Sequence[Case], folder: str | Path, *, workers: int = 2, time_limit: float | None = None,
    keep_runs: bool = False, again: Sequence[str] = (), mpi: bool = False,
    progress: Callable[[Progress], None] | None = None,
) -> xr.Dataset:  # fmt: skip
    """Run all cases that have not ended yet, and gather the results.

    Parameters
    ----------
    function : callable
        Takes the values of a case by name; returns a Dataset of `simulate` (its `summary` is gathered) or numbers by
        name. An `Experiment`, or any function that can be pickled, of an importable module. When its source has
        changed (its own, not that of what it calls), the folder's results are not mixed with new ones.
    cases : sequence of dict
        Cases made by `grid`, `sample` or yourself; all have the same names.
    folder : path
        Folder that keeps a file for each case, ``sweep.nc`` and what is needed to continue after a stop.
    workers : int
        Number of processes. Not used with MPI.
    time_limit : float, optional
        Longest time that one case may take [s].
    keep_runs : bool
        Keep the whole Dataset of each case, too (``runs/``).
    again : sequence of str
        Statuses (`STATUSES`) whose cases are run again.
    mpi : bool
        Use the ranks of ``mpiexec -n 4 python -m mpi4py.futures script.py`` (one leads, the others work).
    progress : callable, optional
        Called at the beginning, several times a second and at the end.

    Returns
    -------
    xarray.Dataset
        Along ``case``: the parameters as coordinates, the results, ``status``, ``reason`` and ``case_wall_time`` [s].
        Written to ``folder/sweep.nc`` as well.

    Raises
    ------
    ValueError
        If the cases do not match each other, the experiment or what the folder holds; before anything runs.
    RuntimeError
        If another sweep is at work in the folder.
    """
    if isinstance(function, Experiment):
        function = function.with_one_model(cases)
    store = CaseStore(Path(folder), function, cases, time_limit, keep_runs)
    if isinstance(function, Experiment):
        _check_cases(function, cases)
    unknown = [status for status in again if status not in STATUSES]
    if unknown:
        raise ValueError(f"sweep.again: {unknown[0]!r} is no status; use {', '.join(STATUSES)}.")
    if not 1 <= workers <= 4096:
        raise ValueError(f"sweep.workers = {workers} must lie between 1 and 4096.")
    with store.locked():
        store.prepare(again)
        began, before = time.monotonic(), len(store.ended())

        def report_progress() -> None:
            if progress is not None:
                done = len(store.ended())
                fresh = done - before
                rate = (time.monotonic() - began) / fresh if fresh else math.nan
                progress(Progress(done, len(cases), rate * (len(cases) - done)))

        report_progress()
        if mpi:
            run_with_mpi(store)
        else:
            run_in_processes(store, workers, report_progress)
        report_progress()
        result = store.gather()
        if isinstance(function, Experiment):
            result.attrs |= function.trust(cases)
        save_dataset(result, store.folder / "sweep.nc")
    return result


def _check_cases(experiment: Experiment, cases: Sequence[Case]) -> None:
    """Check every name and every distinct value by itself; what only some combinations forbid becomes a row.

    Of more than `CHECKED_VALUES` values evenly spaced ones are checked, with the smallest and the largest of each name.
    """
    for maneuver in {str(case["maneuver"]): case["maneuver"] for case in cases if "maneuver" in case}.values():
        experiment = experiment.with_values({"maneuver": maneuver})  # its fields are names
    distinct = {name: _sorted_numbers(dict.fromkeys(case[name] for case in cases)) for name in cases[0]}
    number = sum(map(len, distinct.values()))
    for name, values in distinct.items():
        share = len(values) if number <= CHECKED_VALUES else max(2, CHECKED_VALUES * len(values) // number)
        chosen = np.unique(np.linspace(0, len(values) - 1, share).round().astype(int))
        experiment.check_values(name, [values[n] for n in chosen])
    experiment.with_values(cases[0]).check()


def _sorted_numbers(values: Iterable[Any]) -> list[Any]:
    """Values in ascending order, nan first, if all are numbers; in the given order otherwise."""
    found = list(values)
    numbers = all(isinstance(value, Real) for value in found)
    return sorted(found, key=lambda value: (value == value, value)) if numbers else found
