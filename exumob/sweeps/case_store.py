"""The folder of a sweep: what is run, which cases are under way, and how each ended.

Every case that has ended is a file, so that a sweep that was stopped or killed continues with the others. A description
of the function, its source and the cases distinguishes one sweep from another.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import inspect
import json
import math
import os
import pickle
import re
import socket
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from exumob.support.files import atomic_write
from exumob.support.provenance import provenance
from exumob.sweeps.experiment import Experiment
from exumob.sweeps.sampling import Case

STATUSES = ("completed", "broke down", "refused", "failed", "out of time", "killed")
"""How a case can end: with a result; with a `SimulationError`; with a ``ValueError`` on its values; with another error;
stopped at its own time limit; with its process, twice."""

Function = Callable[[Case], "xr.Dataset | Mapping[str, float | str]"]
"""Takes the values of a case by name; returns a Dataset of `exumob.simulate` or numbers by name."""


class CaseStore:
    """Folder of a sweep.

    ``sweep.json`` describes what is run, ``cases/<number>.json`` how each case ended, ``begun/<number>.json`` which
    process has it under way.

    Parameters
    ----------
    folder : Path
    function : callable
        See `exumob.sweeps.sweep`.
    cases : sequence of dict
        All with the same names.
    time_limit : float, optional
        Longest time that one case may take [s].
    keep_runs : bool
        Keep the whole Dataset of each case, too (``runs/``).

    Raises
    ------
    ValueError
        If there are no cases, their names differ, the time limit is not positive or the function cannot be pickled.
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
        """Describe the function, its source and the cases; sweeps with the same description are the same."""
        name, source = function_identity(self.function)
        cases = json.dumps(self.cases, default=str)
        return {"function": name, "source": _digest(source), "cases": _digest(cases), "number": len(self.cases)}

    def prepare(self, again: Sequence[str]) -> None:
        """Make the folders, or check that they hold this sweep, and remove the cases that are to be run again.

        Parameters
        ----------
        again : sequence of str
            Statuses whose cases are run again.

        Raises
        ------
        ValueError
            If the folder holds another sweep, or the source of the function has changed.
        """
        for name in ("cases", "begun", *(["runs"] if self.keep_runs else [])):
            (self.folder / name).mkdir(parents=True, exist_ok=True)
        file, wanted = self.folder / "sweep.json", self.description()
        kept = json.loads(file.read_text()) if file.exists() else wanted
        changed = [name for name, value in wanted.items() if kept.get(name) != value]
        if changed == ["source"]:
            raise ValueError(
                f"{self.folder} holds results of {wanted['function']} as it was before its source was changed; give "
                f"another folder, or remove it. If the change moves no result, remove {file} alone: what has ended is "
                "kept."
            )
        if changed:
            what = "another experiment or function" if "function" in changed else "other cases"
            raise ValueError(f"{self.folder} holds another sweep ({what}); give another folder, or remove it.")
        write_text(file, json.dumps(wanted))
        for number in sorted(self.ended()) if again else ():
            if self.read(number)["status"] in again:
                self._file(number).unlink()
        # without MPI the leader distinguishes cases that end their process from those that ended with the sweep
        self.forget_begun(n for n, begun in self.begun().items() if not begun["mpi"])

    def ended(self) -> set[int]:
        """Numbers of the cases that have ended."""
        with os.scandir(self.folder / "cases") as entries:
            return {int(e.name[:-5]) for e in entries if e.name.endswith(".json") and not e.name.startswith(".")}

    def left(self) -> list[int]:
        """Numbers of the cases that have not ended, in ascending order."""
        ended = self.ended()
        return [n for n in range(len(self.cases)) if n not in ended]

    def begin(self, number: int, mpi: bool) -> int:
        """Note that this process has a case under way.

        Returns
        -------
        int
            Number of times that the case was begun before and took its process with it.
        """
        file = self.folder / "begun" / f"{number}.json"
        before = 0
        with contextlib.suppress(OSError, ValueError):
            before = int(json.loads(file.read_text())["attempt"])
        mark = {"pid": os.getpid(), "host": socket.gethostname(), "at": time.time(), "attempt": before + 1, "mpi": mpi}
        write_text(file, json.dumps(mark))
        return before

    def forget_begun(self, numbers: Iterable[int]) -> None:
        """Remove the marks of cases that did not end their process, but were ended with it."""
        for number in numbers:
            (self.folder / "begun" / f"{number}.json").unlink(missing_ok=True)

    def begun(self) -> dict[int, dict[str, Any]]:
        """Marks of the cases under way, by number: the process (``pid``, ``host``), when (``at``), ``attempt``."""
        found = {}
        for file in (self.folder / "begun").glob("*.json"):
            with contextlib.suppress(OSError, ValueError):
                found[int(file.stem)] = json.loads(file.read_text())
        return found

    def end(self, number: int, status: str, reason: str, wall: float, values: Mapping[str, Any]) -> None:
        """Keep how a case ended: its status, the reason, the wall time [s] and the values found."""
        row = {
            "parameters": self.cases[number], "status": status, "reason": reason, "wall_time": wall,
            "values": {name: value if isinstance(value, str) else float(value) for name, value in values.items()},
        }  # fmt: skip
        write_text(self._file(number), json.dumps(row, default=str))
        (self.folder / "begun" / f"{number}.json").unlink(missing_ok=True)

    def read(self, number: int) -> dict[str, Any]:
        """Return how a case ended, as `end` has kept it."""
        found: dict[str, Any] = json.loads(self._file(number).read_text())
        return found

    def _file(self, number: int) -> Path:
        return self.folder / "cases" / f"{number}.json"

    @contextlib.contextmanager
    def locked(self) -> Iterator[None]:
        """Hold the folder against other sweeps; the lock goes with the process.

        Raises
        ------
        RuntimeError
            If another sweep holds it.
        """
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
        """Gather all rows as one Dataset along ``case``."""
        rows = [self.read(number) for number in range(len(self.cases))]
        names = sorted({name for row in rows for name in row["values"]})
        columns = {name: _results([row["values"].get(name) for row in rows]) for name in names}
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


def function_identity(function: Any) -> tuple[str, str]:
    """Name of a function with the arguments that it is bound to, and its source; what it calls is not looked at.

    If networks give the loads of the water, the digests of those that come with the package belong to the name.
    """
    name, source = _name_and_source(function)
    experiment = function if isinstance(function, Experiment) else getattr(function, "experiment", None)
    if isinstance(experiment, Experiment):
        name = f"{name} {experiment.network_digests()}".rstrip()
    return name, source


def _name_and_source(function: Any) -> tuple[str, str]:
    if isinstance(function, Experiment):
        return stable_repr(function), ""
    if isinstance(function, functools.partial):
        name, source = _name_and_source(function.func)
        return f"partial({name}, {stable_repr(function.args)}, {stable_repr(function.keywords)})", source
    if inspect.ismethod(function):
        return f"{function.__qualname__} of {stable_repr(function.__self__)}", _source(function)
    if hasattr(function, "__qualname__"):
        return function.__qualname__, _source(function)
    return f"{stable_repr(function)} {stable_repr(getattr(function, '__dict__', ''))}", _source(type(function))


def _source(thing: Any) -> str:
    """Source of a function or class, or of its whole module where Python does not find it; empty if there is none."""
    with contextlib.suppress(OSError, TypeError):
        return inspect.getsource(thing)
    with contextlib.suppress(OSError, TypeError):
        return Path(inspect.getfile(sys.modules.get(getattr(thing, "__module__", ""), thing))).read_text("utf-8")
    return ""


def stable_repr(thing: Any) -> str:
    """The repr of an object without addresses, which change from run to run."""
    return re.sub(r" at 0x[0-9a-fA-F]+", "", repr(thing))


def write_text(file: Path, text: str) -> None:
    """Write a text file whole or not at all."""
    with atomic_write(file) as temporary:
        temporary.write_text(text)


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _results(values: list[Any]) -> np.ndarray:
    """Column of results; nan, or an empty text, where a case has none."""
    if any(isinstance(value, str) for value in values):
        return np.array(["" if value is None else str(value) for value in values])
    return np.array([math.nan if value is None else value for value in values], float)


def _column(values: list[Any]) -> np.ndarray:
    numbers = all(isinstance(value, int | float) for value in values)
    return np.array(values if numbers else [str(value) for value in values])
