"""The processes of a sweep: a case in its process, a pool under watch, ranks of MPI.

A case ends as one of `exumob.sweeps.case_rows.STATUSES`. A process that dies, or hangs beyond its time limit, is
noticed from outside: the pool is killed and a new one begins with the cases that are left. A case that was under way in
another process of that pool then starts again.
"""

from __future__ import annotations

import contextlib
import logging
import multiprocessing
import multiprocessing.connection
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import xarray as xr

from exumob.simulation.summary import summary
from exumob.simulation.verdict import verdict_of_error
from exumob.support.compiled import computing_clock
from exumob.support.errors import SimulationError
from exumob.support.processes import end_with_parent, lives
from exumob.support.quantities import shown
from exumob.sweeps.case_rows import fault_of_result
from exumob.sweeps.case_store import CaseStore, StorageError

GRACE = 10.0
"""Time that a case may take beyond its time limit until its process is killed [s]."""
ATTEMPTS = 2
"""Number of processes that a case may take with it until it is given up as ``killed``."""
FRUITLESS = 3
"""Number of times that the whole pool may be killed from outside without any case that ended in between."""
ENDING = 1.0
"""Time that a pool whose process is gone has to say that it ends by itself [s]."""
NAMED = 3
"""Number of values of a case that its messages name."""
POLL = 0.2
"""Interval at which the pool is watched [s]."""


class _OutOfTime(BaseException):
    """Raised within a case by its alarm."""


# -- one case ----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Worker:
    """The function that `exudyn.processing` calls with each case: runs it and keeps how it ended."""

    store: CaseStore
    parent: int | None = None
    """Number of the pool's process, with which the worker must die; None: with MPI, which sees to that itself"""

    def __call__(self, item: Mapping[str, int]) -> int:
        number = int(item["case"])
        store = self.store
        if self.parent is not None and os.getpid() != self.parent:
            end_with_parent(self.parent)
        attempts = store.begin(number, self.parent is None)
        began = computing_clock()
        if attempts >= ATTEMPTS:
            outcome = _Outcome("killed", f"its process ended {attempts} times while this case was under way")
        else:
            outcome = _run_case(store, number)
        is_run = isinstance(outcome.found, xr.Dataset)
        if store.keep_runs and isinstance(outcome.found, xr.Dataset):
            try:
                store.keep_run(number, outcome.found)
            except StorageError:
                raise
            except Exception as error:  # of a function of the user: netCDF cannot hold all that a Dataset can
                outcome = _Outcome("failed", f"its Dataset cannot be kept as netCDF: {type(error).__name__}: {error}")
        store.end(number, outcome.status, outcome.reason, computing_clock() - began, outcome.values, is_run)
        return number


@dataclass(frozen=True)
class _Outcome:
    """How a case ended."""

    status: str
    reason: str = ""
    values: Mapping[str, Any] = field(default_factory=dict)
    found: Any = None
    """What the function returned, if the case was completed"""


def _run_case(store: CaseStore, number: int) -> _Outcome:
    alarm = _Alarm(store.time_limit)
    try:
        with alarm, _messages_named(number, store.cases[number]):
            found = store.function(store.cases[number])
            values = _summary(found) if isinstance(found, xr.Dataset) else found
    except (Exception, SystemExit, _OutOfTime) as error:
        values = _until_then(error)
        if alarm.rang:  # it may come out of the solver as another error
            values = {name: value for name, value in values.items() if not name.startswith("verdict")}
            return _Outcome("out of time", f"it had not ended after {store.time_limit:g} s", values)
        if isinstance(error, SimulationError):
            return _Outcome("broke down", str(error), values)
        if isinstance(error, ValueError):
            return _Outcome("refused", str(error))
        return _Outcome("failed", f"{type(error).__name__}: {error}")
    fault = fault_of_result(values, store.names)
    return _Outcome("failed", fault) if fault else _Outcome("completed", "", values, found)


@contextmanager
def _messages_named(number: int, case: Mapping[str, Any]) -> Iterator[None]:
    """Let exumob's messages say of which case they are, with three of its values."""
    values = ", ".join(f"{name} = {shown(value)}" for name, value in list(case.items())[:NAMED])
    make = logging.getLogRecordFactory()

    def named(*arguments: Any, **more: Any) -> logging.LogRecord:
        record = make(*arguments, **more)
        if record.name.startswith("exumob."):
            with contextlib.suppress(TypeError, ValueError):  # of a message that does not fit its values: as it is
                record.msg, record.args = f"case {number} ({values}): {record.getMessage()}", None
        return record

    logging.setLogRecordFactory(named)
    try:
        yield
    finally:
        logging.setLogRecordFactory(make)


def _until_then(error: BaseException) -> dict[str, Any]:
    """Key figures of what was computed until an error; none if it was next to nothing."""
    if not isinstance(error, SimulationError):
        return {}
    reached = error.result
    try:
        values = summary(reached) if reached is not None and reached.sizes.get("time", 0) > 1 else {}
        return values | verdict_of_error(error).figures()
    except (KeyError, AttributeError, ValueError):  # a result of the user's own kind
        return {}


def _summary(found: xr.Dataset) -> dict[str, Any]:
    try:
        return summary(found)
    except (KeyError, AttributeError, ValueError) as error:
        raise TypeError(f"it returned a Dataset that is none of simulate ({error}); return numbers by name") from None


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


# -- a pool on one machine ---------------------------------------------------------------------------------------------


def run_in_processes(store: CaseStore, workers: int, report_progress: Callable[[], None]) -> None:
    """Run every case that is left in a pool of processes, begun anew after each death.

    Parameters
    ----------
    store : CaseStore
        The cases and the folder that keeps them; locked by the caller.
    workers : int
        Number of processes.
    report_progress : callable
        Called every `POLL` seconds.

    Raises
    ------
    RuntimeError
        If the processes cannot be started.
    StorageError
        If the folder cannot be written any more; what has ended is kept.
    """
    # a server that has imported everything starts a pool in no time
    context: Any = multiprocessing.get_context("forkserver" if sys.platform == "linux" else "spawn")
    if sys.platform == "linux":
        context.set_forkserver_preload(["__main__", __name__, "exudyn.processing"])
    fruitless = 0
    while left := store.left():
        since = time.time()
        receiver, sender = context.Pipe(duplex=False)
        pool = context.Process(target=_pool, args=(store, left, min(workers, len(left)), os.getpid(), sender))
        pool.start()
        sender.close()
        lost: set[int] = set()
        try:
            while pool.is_alive():
                looked = time.monotonic()
                report_progress()
                if lost := _lost(store, since):
                    if multiprocessing.connection.wait([receiver, pool.sentinel], ENDING):  # it ends them itself
                        pool.join(GRACE)
                    break
                # a look at many files takes long: leave nine tenths of the time to the cases
                pool.join(max(POLL, 9.0 * (time.monotonic() - looked)))
        finally:
            _kill(pool)
            failure = _received(receiver)
            counted = set() if failure else lost - store.ended()
            store.forget_begun(n for n, begun in store.begun().items() if begun["at"] >= since and n not in counted)
            store.remove_partial_files()
        if isinstance(failure, StorageError):
            raise failure
        fruitless = fruitless + 1 if pool.exitcode == -signal.SIGKILL and not lost and store.left() == left else 0
        if fruitless >= FRUITLESS:
            raise RuntimeError(
                f"sweep: its processes were killed from outside {fruitless} times before a case ended, perhaps for "
                "want of memory; use fewer workers. The same call goes on with what has ended."
            )
        if pool.exitcode not in (0, None, -signal.SIGKILL) and store.left() == left and (failure or not lost):
            raise RuntimeError(
                f"sweep: the processes could not be started (exit code {pool.exitcode}); "
                + (failure or "is the script's own work under `if __name__ == '__main__':`?")
            )


def _received(receiver: Any) -> StorageError | str:
    """Why the pool has failed, as it has said; empty if it has not."""
    with receiver, contextlib.suppress(EOFError, OSError):
        if receiver.poll():
            kind, text = receiver.recv()
            return StorageError(text) if kind == "storage" else str(text)
    return ""


def _lost(store: CaseStore, since: float) -> set[int]:
    """Cases begun since then whose process is gone, or was far beyond its time limit and is killed here.

    A case that ended at the last moment is among them, too: the pool waits for its process.
    """
    found = set()
    for number, begun in store.begun().items():
        if begun["at"] < since:  # by an earlier pool
            continue
        if not lives(begun["pid"]):
            found.add(number)
        elif store.time_limit is not None and time.time() > begun["at"] + store.time_limit + GRACE:
            if number in store.ended():  # about to remove its mark
                continue
            _kill_process(begun["pid"])
            found.add(number)
            if number not in store.ended():  # nobody can write it now
                store.end(number, "out of time", "it did not heed its time limit: killed", store.time_limit + GRACE, {})
    return found


def _kill_process(pid: int) -> None:
    """Kill a process, and wait until it has ended."""
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.kill(pid, getattr(signal, "SIGKILL", signal.SIGTERM))
    until = time.monotonic() + GRACE
    while lives(pid) and time.monotonic() < until:
        time.sleep(0.01)


def _kill(pool: Any) -> None:
    """Kill the pool and its processes at once."""
    if pool.is_alive():
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(pool.pid, signal.SIGKILL)
        pool.kill()  # it may not have its group yet
    pool.join()


def _pool(store: CaseStore, numbers: list[int], workers: int, leader: int, sender: Any) -> None:
    """Run cases with `exudyn.processing`, in a process group that the leader can kill as a whole.

    Cases run in processes of their own even if one at a time: this one lives on when a case takes its process with it.
    An error that is none of a case goes to the leader, and ends the process with exit code 1.
    """
    if hasattr(os, "setpgrp"):
        os.setpgrp()
    threading.Thread(target=_end_with, args=(leader,), daemon=True).start()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the leader ends the pool
    if sys.platform == "linux":  # forked: no second start-up, and no named semaphores that a kill would leave behind
        multiprocessing.set_start_method("fork", force=True)
    from exudyn.processing import ProcessParameterList

    try:
        ProcessParameterList(_Worker(store, os.getpid()), [{"case": n} for n in numbers], True, numberOfThreads=workers)
    except StorageError as error:
        sender.send(("storage", str(error)))
        sys.exit(1)
    except Exception as error:
        sender.send(("other", f"{type(error).__name__}: {error}"))
        sys.exit(1)


def _end_with(leader: int) -> None:
    """Kill the pool's processes as soon as the leader is gone."""
    while lives(leader):
        time.sleep(POLL)
    if hasattr(os, "killpg"):
        os.killpg(0, signal.SIGKILL)
    os._exit(1)


# -- ranks of MPI ------------------------------------------------------------------------------------------------------


def run_with_mpi(store: CaseStore) -> None:
    """Run every case that is left on the ranks of ``mpiexec -n ... python -m mpi4py.futures``."""
    from exudyn.processing import ProcessParameterList

    left = store.left()
    if left:
        ProcessParameterList(_Worker(store), [{"case": n} for n in left], True, useMPI=True)
