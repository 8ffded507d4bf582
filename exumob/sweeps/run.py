"""Running many cases: side by side, each kept as it ends, none lost to the failure of another.

The cases go through `exudyn.processing.ProcessParameterList`, with processes on one machine or with MPI on many. What
that does not do is done here: a case that raises, breaks down, runs out of time or takes its process with it becomes a
row with a status and a reason (`exumob.sweeps.processes`); finished cases are files, and are not run again; results
keep their parameters (`exumob.sweeps.case_store`).
"""

from __future__ import annotations

import contextlib
import copy
import logging
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, is_dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import xarray as xr

from exumob.simulation.cost import TIME_TO_SETTLE, driving_time
from exumob.simulation.settings import setting_named
from exumob.support.cost import cores, expected_time, require_memory, spelled_size
from exumob.support.declared import checked
from exumob.support.files import require_folder_name
from exumob.support.quantities import Quantity
from exumob.sweeps.case_rows import STATUSES, check_names
from exumob.sweeps.case_store import CaseStore, Function, room_needed
from exumob.sweeps.experiment import STEPS, Experiment
from exumob.sweeps.processes import run_in_processes, run_with_mpi
from exumob.sweeps.sampling import Case
from exumob.sweeps.trust_of_sweep import trust_of_sweep

TRIED_CASES = 20_000
"""Number of cases up to which it is tried beforehand whether their values fit each other; this takes about a second."""
WORKER_BYTES = 2e8
"""Memory of a process of a sweep beside what it shares with the others."""
START = 2.0
"""Time in which the processes start, import everything and load their kernels [s]."""
WorkerCount = Annotated[int, Quantity("1", at_least=1.0, at_most=4096.0)]
"""Number of processes that run side by side."""
TIME_LIMIT = Quantity("s", above=0.0, at_most=1e9)
"""Longest time that one case may take"""

logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class Progress:
    """Progress of a sweep."""

    done: int
    """Number of cases that have ended with any status, those of earlier calls included"""
    total: int
    """Number of all cases"""
    left: float
    """Estimated time to the end [s]; nan until a case has ended"""
    kept: int = 0
    """Number of cases that had ended before this call"""


# nine arguments: the first three say what is run and where it is kept, the others are independent options
@checked
def sweep(
    function: Function, cases: Any, folder: str | Path, *, workers: WorkerCount = 2,
    time_limit: Annotated[float | None, TIME_LIMIT] = None, keep_runs: bool = False,
    again: tuple[str, ...] = (), mpi: bool = False, progress: Callable[[Progress], None] | None = None,
) -> xr.Dataset:  # fmt: skip
    """Run all cases that have not ended yet, and gather the results.

    Parameters
    ----------
    function : callable
        Takes the values of a case by name; returns a Dataset of `simulate` (its `summary` is gathered) or numbers by
        name. An `Experiment`, or any function that can be pickled, of an importable module. When its source has
        changed, that of exumob or of your own functions that it calls, or a file that it holds the path of, the
        folder's results are not mixed with new ones. What it means by the numbers that it returns it may say in an
        attribute ``variables``: unit and meaning by name.
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
    StorageError
        If the folder cannot be written or has no room; what has ended is kept, and the same call goes on.
    """
    check_names(cases)
    require_folder_name("sweep.folder", folder)
    unknown = [status for status in again if status not in STATUSES]
    if unknown:
        raise ValueError(f"sweep.again: {unknown[0]!r} is no status; use {', '.join(STATUSES)}.")
    if not mpi and min(workers, len(cases)) > cores():
        require_memory(f"sweep.workers = {workers}", min(workers, len(cases)) * WORKER_BYTES, "give fewer.")
    experiment = function if isinstance(function, Experiment) else getattr(function, "experiment", None)
    if isinstance(experiment, Experiment):
        cases = [experiment.typed(case) for case in cases]
        fitting = _check_cases(experiment, cases)
        experiment = experiment.with_one_model(cases)
        experiment.with_values(fitting).check()
        function = _with_experiment(function, experiment)
    store = CaseStore(Path(folder), function, cases, time_limit, keep_runs)
    with store.locked():
        store.prepare(again)
        began, before = time.monotonic(), len(store.ended())

        def report_progress() -> None:
            if progress is not None:
                done = len(store.ended())
                fresh = done - before
                rate = (time.monotonic() - began) / fresh if fresh else math.nan
                progress(Progress(done, len(cases), rate * (len(cases) - done), before))

        report_progress()
        if mpi:
            run_with_mpi(store)
        else:
            run_in_processes(store, workers, report_progress)
        report_progress()
        result = store.gather()
        if isinstance(experiment, Experiment):
            ended = {str(name): row.values for name, row in result.items() if row.dtype.kind == "f"}
            result.attrs |= trust_of_sweep(experiment, cases, ended)
        store.save(result)
    return result


def _with_experiment(function: Any, experiment: Experiment) -> Any:
    """The function with an experiment whose model of the water's loads is settled, so that no case chooses its own."""
    if isinstance(function, Experiment) or function.experiment == experiment:
        return experiment if isinstance(function, Experiment) else function
    if is_dataclass(function) and not isinstance(function, type):
        return replace(function, experiment=experiment)
    changed = copy.copy(function)
    if changed is not function:  # as copies of plain functions are
        with contextlib.suppress(AttributeError, TypeError):
            changed.experiment = experiment
            return changed
    raise ValueError(
        "sweep.function: its experiment has hydrodynamics = 'auto', so that each case would choose, and it cannot "
        f"be replaced; give it hydrodynamics = {experiment.hydrodynamics!r}."
    )


@dataclass(frozen=True)
class Need:
    """What a sweep will take."""

    cases: int
    time: float
    """Wall time with all processes [s]; nan if nothing is known of the function"""
    disk: float
    """Room in its folder [bytes]"""
    workers: int = 1
    """Number of processes"""

    def __str__(self) -> str:
        time = "" if math.isnan(self.time) else f", {expected_time(self.time, self.workers)}"
        return f"{self.cases} case{'' if self.cases == 1 else 's'}{time}, {spelled_size(self.disk)} on the disk"


def need(function: Function, cases: Sequence[Case], workers: int = 2, keep_runs: bool = False) -> Need:
    """Estimate what a sweep will take, from what the runs of an `Experiment` were measured to take."""
    time = math.nan
    if isinstance(function, Experiment):
        usual: Case = {"duration": function.duration, "setting": function.setting}
        usual |= {"micro_step": function.micro_step, "macro_step": function.macro_step}
        try:
            time = sum(_time_of(usual | case) for case in cases) / max(1, min(workers, cores(), len(cases))) + START
        except (TypeError, ValueError, OverflowError, ZeroDivisionError):  # refused later
            time = math.nan
    return Need(len(cases), time, room_needed(function, len(cases), keep_runs), max(1, min(workers, len(cases))))


def _time_of(case: Case) -> float:
    """Time that a run takes [s]."""
    setting = setting_named(case["setting"])
    micro_step, macro_step = case["micro_step"] or setting.micro_step, case["macro_step"] or setting.macro_step
    return TIME_TO_SETTLE + driving_time(case["duration"], micro_step, macro_step)


def _check_cases(experiment: Experiment, cases: Sequence[Case]) -> Case:
    """Check every name and every value by itself; what only some combinations forbid becomes a row, with a warning.

    Returns
    -------
    dict
        The first case whose values fit each other.

    Raises
    ------
    ValueError
        If a name is not known, a value is refused, or no case fits together.
    """
    for maneuver in {str(case["maneuver"]): case["maneuver"] for case in cases if "maneuver" in case}.values():
        experiment = experiment.with_values({"maneuver": maneuver})  # its fields are names
    experiment.check_names(cases[0])
    if "water.depth" in cases[0] and "water.depth_ratio" in cases[0]:
        raise ValueError("sweep.cases: water.depth and water.depth_ratio say the same; give one of them.")
    for name in cases[0]:
        experiment.check_values(name, [case[name] for case in cases])
    refused: list[tuple[Case, ValueError]] = []
    fitting: Case | None = None
    steps = [name for name in (*STEPS, "setting") if name in cases[0]]
    tried: set[Any] = set()
    for case in cases if len(cases) <= TRIED_CASES else cases[:1]:
        try:
            changed = experiment.with_values(case)
            if (key := tuple(case[name] for name in steps)) not in tried:
                changed.check_steps()
            tried.add(key)
            fitting = case if fitting is None else fitting
        except ValueError as error:
            refused.append((case, error))
    if fitting is None:
        raise refused[0][1]
    if refused:
        example = ", ".join(f"{name} = {value}" for name, value in refused[0][0].items())
        logger.warning(
            "sweep: %d of %d cases cannot be run, their values do not fit each other; the first, %s: %s", len(refused),
            len(cases), example, refused[0][1],
        )  # fmt: skip
    return fitting
