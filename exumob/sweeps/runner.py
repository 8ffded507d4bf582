"""Running many cases: side by side, each kept as it ends, none lost to the failure of another.

The cases go through `exudyn.processing.ProcessParameterList`, with processes on one machine or with MPI on many. What
that does not do is done here: a case that raises, breaks down, runs out of time or takes its process with it becomes a
row with a status and a reason; finished cases are files, and are not run again; results keep their parameters.

A case ends as one of `STATUSES`. A process that dies (or hangs beyond its time) is noticed from outside: the pool is
ended and begun anew with what is left. A case that was under way in another process then starts again.
"""

from __future__ import annotations

import contextlib
import ctypes
import functools
import hashlib
import inspect
import json
import math
import multiprocessing
import os
import pickle
import re
import signal
import socket
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from numbers import Real
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from exumob.simulation.result_files import save_dataset
from exumob.simulation.summary import summary
from exumob.support.errors import SimulationError
from exumob.support.provenance import provenance
from exumob.sweeps.experiment import Experiment
from exumob.sweeps.sampling import Case

STATUSES = ("completed", "broke down", "refused", "failed", "out of time", "killed")
"""The last but one by its own time limit, the last with its process."""
GRACE = 10.0
"""What a case may take beyond its time limit until its process is killed [s]."""
ATTEMPTS = 2
"""Times that a case may take its process with it until it is given up as ``killed``."""
POLL = 0.2
"""Interval at which the pool is looked at [s]."""
LOOKED_AT = 50_000
"""Values of the cases that are looked at before anything runs; about a second."""

Function = Callable[[Case], "xr.Dataset | Mapping[str, float]"]


@dataclass(frozen=True)
class Progress:
    """How far a sweep has got."""

    done: int
    """Cases that have ended, of whatever status, earlier calls' included"""
    total: int
    left: float
    """Estimated time to the end [s]; nan until a case has ended"""


class _OutOfTime(BaseException):
    """Raised within a case by its alarm."""


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
        Of `grid`, `sample` or your own; all with the same names.
    folder : path
        Keeps a file for each case, ``sweep.nc`` and what is needed to go on.
    workers : int
        Processes. Not used with MPI.
    time_limit : float, optional
        Of one case [s].
    keep_runs : bool
        Whether the whole Dataset of each case is kept, too (``runs/``).
    again : sequence of str
        Statuses (`STATUSES`) whose cases are run again.
    mpi : bool
        Use the ranks of ``mpiexec -n 4 python -m mpi4py.futures script.py`` (one leads, the others work).
    progress : callable, optional
        Is told every now and then.

    Returns
    -------
    xarray.Dataset
        Along ``case``: the parameters as coordinates, the results, ``status``, ``reason`` and ``case_wall_time`` [s].
        Written to ``folder/sweep.nc`` as well.

    Raises
    ------
    ValueError
        On cases that do not match each other, the experiment or what the folder holds; before anything runs.
    RuntimeError
        If another sweep is at work in the folder.
    """
    store = _Store(Path(folder), function, cases, time_limit, keep_runs)
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

        def told() -> None:
            if progress is not None:
                done = len(store.ended())
                fresh = done - before
                rate = (time.monotonic() - began) / fresh if fresh else math.nan
                progress(Progress(done, len(cases), rate * (len(cases) - done)))

        told()
        if mpi:
            _run_with_mpi(store)
        else:
            _run_in_processes(store, workers, told)
        told()
        result = store.gather()
        save_dataset(result, store.folder / "sweep.nc")
    return result


def _check_cases(experiment: Experiment, cases: Sequence[Case]) -> None:
    """Every name and every distinct value by itself; what only some combinations forbid becomes a row.

    Of more than `LOOKED_AT` values evenly chosen ones, the smallest and the largest number of each name among them.
    """
    for maneuver in {str(case["maneuver"]): case["maneuver"] for case in cases if "maneuver" in case}.values():
        experiment = experiment.with_values({"maneuver": maneuver})  # its fields are names
    distinct = {name: _sorted_numbers(dict.fromkeys(case[name] for case in cases)) for name in cases[0]}
    number = sum(map(len, distinct.values()))
    for name, values in distinct.items():
        share = len(values) if number <= LOOKED_AT else max(2, LOOKED_AT * len(values) // number)
        chosen = np.unique(np.linspace(0, len(values) - 1, share).round().astype(int))
        experiment.check_values(name, [values[n] for n in chosen])
    experiment.with_values(cases[0]).check()


def _sorted_numbers(values: Iterable[Any]) -> list[Any]:
    """Sorted, nan first, if all are numbers; as they are, if not."""
    found = list(values)
    numbers = all(isinstance(value, Real) for value in found)
    return sorted(found, key=lambda value: (value == value, value)) if numbers else found


# -- what is kept ------------------------------------------------------------------------------------------------------


class _Store:
    """Folder of a sweep.

    ``sweep.json`` says what is run, ``cases/<number>.json`` how each case ended, ``begun/<number>.json`` which process
    has it in hand.
    """

    def __init__(
        self, folder: Path, function: Function, cases: Sequence[Case], time_limit: float | None, keep_runs: bool
    ) -> None:
        if not cases:
            raise ValueError("sweep.cases is empty; give one case at least.")
        names = list(cases[0])
        for n, case in enumerate(cases):
            if list(case) != names:
                raise ValueError(f"sweep.cases: case {n} has the names {list(case)}, the first one {names}.")
        if time_limit is not None and not time_limit > 0.0:
            raise ValueError(f"sweep.time_limit = {time_limit} s must be > 0, or None.")
        try:
            pickle.dumps(function)
        except Exception as error:
            raise ValueError(
                f"sweep.function cannot be given to another process ({error}); use an Experiment or a function at the "
                "top level of a module."
            ) from None
        self.folder, self.function, self.cases, self.names = folder, function, list(cases), names
        self.time_limit, self.keep_runs = time_limit, keep_runs

    def description(self) -> dict[str, Any]:
        """What makes two sweeps the same: the function, its source and the cases."""
        name, source = identity(self.function)
        cases = json.dumps(self.cases, default=str)
        return {"function": name, "source": _digest(source), "cases": _digest(cases), "number": len(self.cases)}

    def prepare(self, again: Sequence[str]) -> None:
        """Make the folders, or check that they hold this sweep; forget what is to be run again."""
        for name in ("cases", "begun", *(["runs"] if self.keep_runs else [])):
            (self.folder / name).mkdir(parents=True, exist_ok=True)
        said, mine = self.folder / "sweep.json", self.description()
        theirs = json.loads(said.read_text()) if said.exists() else mine
        changed = [name for name, value in mine.items() if theirs.get(name) != value]
        if changed == ["source"]:
            raise ValueError(
                f"{self.folder} holds results of {mine['function']} as it was before its source was changed; give "
                f"another folder, or remove it. If the change moves no result, remove {said} alone: what has ended is "
                "kept."
            )
        if changed:
            what = "another experiment or function" if "function" in changed else "other cases"
            raise ValueError(f"{self.folder} holds another sweep ({what}); give another folder, or remove it.")
        write_whole(said, json.dumps(mine))
        for number in sorted(self.ended()) if again else ():
            if self.read(number)["status"] in again:
                self._file(number).unlink()
        # without MPI the leader tells cases that end their process from those that ended with the sweep
        self.forget_begun(n for n, begun in self.begun().items() if not begun["mpi"])

    def ended(self) -> set[int]:
        """Numbers of the cases that have ended."""
        with os.scandir(self.folder / "cases") as entries:
            return {int(e.name[:-5]) for e in entries if e.name.endswith(".json") and not e.name.startswith(".")}

    def left(self) -> list[int]:
        """Numbers of those that have not."""
        ended = self.ended()
        return [n for n in range(len(self.cases)) if n not in ended]

    def begin(self, number: int, mpi: bool) -> int:
        """Note that this process has the case in hand; how often it was begun before and took its process with it."""
        file = self.folder / "begun" / f"{number}.json"
        before = 0
        with contextlib.suppress(OSError, ValueError):
            before = int(json.loads(file.read_text())["attempt"])
        mine = {"pid": os.getpid(), "host": socket.gethostname(), "at": time.time(), "attempt": before + 1, "mpi": mpi}
        write_whole(file, json.dumps(mine))
        return before

    def forget_begun(self, numbers: Iterable[int]) -> None:
        """Of cases that did not end their process, but were ended with it."""
        for number in numbers:
            (self.folder / "begun" / f"{number}.json").unlink(missing_ok=True)

    def begun(self) -> dict[int, dict[str, Any]]:
        """Cases in hand."""
        found = {}
        for file in (self.folder / "begun").glob("*.json"):
            with contextlib.suppress(OSError, ValueError):
                found[int(file.stem)] = json.loads(file.read_text())
        return found

    def end(self, number: int, status: str, reason: str, wall: float, values: Mapping[str, Any]) -> None:
        """Keep how a case ended."""
        row = {
            "parameters": self.cases[number], "status": status, "reason": reason, "wall_time": wall,
            "values": {name: float(value) for name, value in values.items()},
        }  # fmt: skip
        write_whole(self._file(number), json.dumps(row, default=str))
        (self.folder / "begun" / f"{number}.json").unlink(missing_ok=True)

    def read(self, number: int) -> dict[str, Any]:
        """How a case ended."""
        found: dict[str, Any] = json.loads(self._file(number).read_text())
        return found

    def _file(self, number: int) -> Path:
        return self.folder / "cases" / f"{number}.json"

    @contextlib.contextmanager
    def locked(self) -> Iterator[None]:
        """Hold the folder; the lock goes with the process."""
        self.folder.mkdir(parents=True, exist_ok=True)
        with (self.folder / ".lock").open("w") as file:
            if sys.platform != "win32":
                import fcntl

                try:
                    fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                except OSError:
                    raise RuntimeError(
                        f"another sweep is at work in {self.folder}; wait for it, or end it first."
                    ) from None
            yield

    def gather(self) -> xr.Dataset:
        """All rows as one Dataset."""
        rows = [self.read(number) for number in range(len(self.cases))]
        names = sorted({name for row in rows for name in row["values"]})
        columns = {name: np.array([row["values"].get(name, math.nan) for row in rows], float) for name in names}
        parameters = {name: ("case", _column([case[name] for case in self.cases])) for name in self.names}
        return xr.Dataset(
            {name: ("case", values) for name, values in columns.items()}
            | {
                "status": ("case", [row["status"] for row in rows]),
                "reason": ("case", [row["reason"] for row in rows]),
                "case_wall_time": ("case", [row["wall_time"] for row in rows], {"units": "s"}),
            },
            coords={"case": np.arange(len(rows))} | parameters,
            attrs=provenance() | {"title": "exumob sweep", "parameters": " ".join(self.names)},
        )


def identity(function: Any) -> tuple[str, str]:
    """Name of a function with what it is bound to, and its source; what it calls is not looked at.

    Where networks are the water, the digests of those that come with the package belong to the name.
    """
    name, source = _identity(function)
    experiment = function if isinstance(function, Experiment) else getattr(function, "experiment", None)
    if isinstance(experiment, Experiment):
        name = f"{name} {experiment.network_digests()}".rstrip()
    return name, source


def _identity(function: Any) -> tuple[str, str]:
    if isinstance(function, Experiment):
        return _said(function), ""
    if isinstance(function, functools.partial):
        name, source = _identity(function.func)
        return f"partial({name}, {_said(function.args)}, {_said(function.keywords)})", source
    if inspect.ismethod(function):
        return f"{function.__qualname__} of {_said(function.__self__)}", _source(function)
    if hasattr(function, "__qualname__"):
        return function.__qualname__, _source(function)
    return f"{_said(function)} {_said(getattr(function, '__dict__', ''))}", _source(type(function))


def _source(thing: Any) -> str:
    """Of a function or class; of its whole module where Python does not find it; empty if there is none."""
    with contextlib.suppress(OSError, TypeError):
        return inspect.getsource(thing)
    with contextlib.suppress(OSError, TypeError):
        return Path(inspect.getfile(sys.modules.get(getattr(thing, "__module__", ""), thing))).read_text("utf-8")
    return ""


def _said(thing: Any) -> str:
    """Its repr, without addresses: those change from run to run."""
    return re.sub(r" at 0x[0-9a-fA-F]+", "", repr(thing))


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def write_whole(file: Path, text: str) -> None:
    """Whole or not at all."""
    partial = file.with_name(f".{file.name}.{os.getpid()}")
    partial.write_text(text)
    partial.replace(file)


def _column(values: list[Any]) -> np.ndarray:
    numbers = all(isinstance(value, int | float) for value in values)
    return np.array(values if numbers else [str(value) for value in values])


def _alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    with contextlib.suppress(OSError):  # a zombie has done its last work
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    return True


# -- one case ----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Worker:
    """What a process does with a case; given to `exudyn.processing`."""

    store: _Store
    parent: int | None = None
    """Pool's process, with which it dies; None: MPI's business"""

    def __call__(self, item: Mapping[str, int]) -> int:
        number = int(item["case"])
        store = self.store
        if self.parent is not None and os.getpid() != self.parent:
            _die_with_parent()
        attempts = store.begin(number, self.parent is None)
        began = time.perf_counter()

        def end(status: str, reason: str = "", values: Mapping[str, Any] | None = None) -> int:
            store.end(number, status, reason, time.perf_counter() - began, values or {})
            return number

        if attempts >= ATTEMPTS:
            return end("killed", f"its process ended {attempts} times while this case was under way")
        alarm = _Alarm(store.time_limit)
        try:
            with alarm:
                found = store.function(store.cases[number])
                values = summary(found) if isinstance(found, xr.Dataset) else found
            if store.keep_runs and isinstance(found, xr.Dataset):
                save_dataset(found, store.folder / "runs" / f"{number}.nc")
            return end("completed", "", values)
        except (Exception, _OutOfTime) as error:
            reached = error.result if isinstance(error, SimulationError) else None
            values = summary(reached) if isinstance(reached, xr.Dataset) and reached.sizes["time"] > 1 else {}
            if alarm.rang:  # it may come out of the solver as another error
                return end("out of time", f"it had not ended after {store.time_limit:g} s", values)
            if isinstance(error, SimulationError):
                return end("broke down", str(error), values)
            if isinstance(error, ValueError):
                return end("refused", str(error))
            return end("failed", f"{type(error).__name__}: {error}")


class _Alarm:
    """Raises `_OutOfTime` in the main thread after `limit` seconds, where the system has such an alarm."""

    def __init__(self, limit: float | None) -> None:
        self.limit = limit if hasattr(signal, "setitimer") else None
        self.rang = False

    def _ring(self, *_: Any) -> None:
        self.rang = True
        raise _OutOfTime

    def __enter__(self) -> None:
        if self.limit is not None:
            self._old = signal.signal(signal.SIGALRM, self._ring)
            signal.setitimer(signal.ITIMER_REAL, self.limit)

    def __exit__(self, *_: object) -> None:
        if self.limit is not None:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
            signal.signal(signal.SIGALRM, self._old)


# -- many cases --------------------------------------------------------------------------------------------------------


def _run_in_processes(store: _Store, workers: int, told: Callable[[], None]) -> None:
    """A pool of processes under watch, begun anew after each death, until every case has ended."""
    # a server that has imported everything starts a pool in no time
    context: Any = multiprocessing.get_context("forkserver" if sys.platform == "linux" else "spawn")
    if sys.platform == "linux":
        context.set_forkserver_preload(["__main__", "exumob.sweeps.runner", "exudyn.processing"])
    while left := store.left():
        since = time.time()
        pool = context.Process(target=_pool, args=(store, left, min(workers, len(left)), os.getpid()))
        pool.start()
        lost: set[int] = set()
        try:
            while pool.is_alive():
                pool.join(POLL)
                told()
                if lost := _lost(store, since):
                    break
        finally:
            _kill(pool)
            store.forget_begun(n for n, begun in store.begun().items() if begun["at"] >= since and n not in lost)
        if pool.exitcode not in (0, None, -signal.SIGKILL) and store.left() == left and not lost:
            raise RuntimeError(
                f"sweep: the processes could not be started (exit code {pool.exitcode}); is the script's own work "
                "under `if __name__ == '__main__':`?"
            )


def _lost(store: _Store, since: float) -> set[int]:
    """Cases begun since then that will never end: their process is gone, or is far beyond its time."""
    found = set()
    for number, begun in store.begun().items():
        if begun["at"] < since:  # by an earlier pool
            continue
        if not _alive(begun["pid"]):
            if number not in store.ended():
                found.add(number)
        elif store.time_limit is not None and time.time() > begun["at"] + store.time_limit + GRACE:
            store.end(number, "out of time", "it did not heed its time limit: killed", store.time_limit + GRACE, {})
            found.add(number)
    return found


def _kill(pool: Any) -> None:
    """End the pool and its processes at once."""
    if pool.is_alive():
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(pool.pid, signal.SIGKILL)
        pool.kill()  # it may not have its group yet
    pool.join()


def _pool(store: _Store, numbers: list[int], workers: int, leader: int) -> None:
    """In a process group of its own: `exudyn.processing` with its processes."""
    if hasattr(os, "setpgrp"):
        os.setpgrp()
    threading.Thread(target=_end_with, args=(leader,), daemon=True).start()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the leader ends us
    if sys.platform == "linux":  # forked: no second start-up, and no named semaphores that a kill would leave behind
        multiprocessing.set_start_method("fork", force=True)
    from exudyn.processing import ProcessParameterList

    ProcessParameterList(
        _Worker(store, os.getpid()), [{"case": n} for n in numbers], workers > 1, numberOfThreads=workers
    )


def _end_with(leader: int) -> None:
    """Nothing goes on when the leader was killed."""
    while _alive(leader):
        time.sleep(POLL)
    if hasattr(os, "killpg"):
        os.killpg(0, signal.SIGKILL)
    os._exit(1)


def _die_with_parent() -> None:
    """A process ends with its pool (Linux)."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(1, signal.SIGKILL)  # PR_SET_PDEATHSIG
        if os.getppid() == 1:
            os._exit(1)


def _run_with_mpi(store: _Store) -> None:
    from exudyn.processing import ProcessParameterList

    left = store.left()
    if left:
        ProcessParameterList(_Worker(store), [{"case": n} for n in left], True, useMPI=True)
