"""The folder of a sweep: what is run, which cases are under way, and how each ended.

Every case that has ended is a file, so that a sweep that was stopped or killed continues with the others. The file says
for itself what it belongs to: the values of the case, those that the function holds (`exumob.sweeps.identity`) and the
version of exumob. What does not fit is refused, what is torn is computed again.
"""

from __future__ import annotations

import contextlib
import errno
import json
import logging
import math
import os
import pickle
import re
import shutil
import socket
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from exumob.simulation.result_files import save_dataset
from exumob.simulation.summary import FIGURES
from exumob.support.cost import spelled_size
from exumob.support.files import atomic_write
from exumob.support.provenance import package_version, provenance
from exumob.support.quantities import shown
from exumob.sweeps.experiment import Experiment
from exumob.sweeps.handing_over import WithVehicleFiles
from exumob.sweeps.identity import differences, digest, file_text, identity, stable_repr
from exumob.sweeps.sampling import ROW_BYTES, Case

logger = logging.getLogger(__name__)

STATUSES = ("completed", "broke down", "refused", "failed", "out of time", "killed")
"""How a case can end: with a result; with a `SimulationError`; with a ``ValueError`` on its values; with another error;
stopped at its own time limit; with its process, twice."""

Function = Callable[[Case], xr.Dataset | Mapping[str, float | str]]
"""Takes the values of a case by name; returns a Dataset of `exumob.simulate` or numbers by name."""

FORMAT = 2
"""Number of the layout of a sweep's files."""
STEP_BYTES = 3600
"""Room on the disk for an instant of a kept run."""
OWN_NAMES = ("case", "status", "reason", "case_wall_time")
"""Names in the result of a sweep that are neither parameters nor results."""
OWN_VARIABLES = {
    "status": ("1", "how the case ended"),
    "reason": ("1", "why it was not completed"),
    "case_wall_time": ("s", "time of computing the case"),
}


class StorageError(OSError):
    """The folder of a sweep cannot be written; what was computed until then is kept."""


class CaseStore(WithVehicleFiles):
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
        If there are no cases, their names differ or the function cannot be pickled.
    """

    def __init__(
        self, folder: Path, function: Function, cases: Sequence[Case], time_limit: float | None, keep_runs: bool
    ) -> None:
        check_names(cases)
        try:
            pickle.dumps(function)
        except Exception as error:
            raise ValueError(
                f"sweep.function cannot be given to another process ({error}); use an Experiment or a function at the "
                "top level of a module."
            ) from None
        self.folder, self.function, self.cases, self.names = folder, function, list(cases), list(cases[0])
        self.time_limit, self.keep_runs = time_limit, keep_runs
        self.identity = identity(function)
        self._values, self._code = self.identity.values_digest(), self.identity.code_digest()

    def description(self) -> dict[str, Any]:
        """Describe the function, its code and the cases; sweeps with the same description are the same."""
        cases = digest("\n".join(case_text(case) for case in self.cases))
        return {
            "format": FORMAT, "exumob": package_version(), "number": len(self.cases), "cases": cases,
            "function": self.identity.values, "code": self.identity.code,
        }  # fmt: skip

    # -- before anything runs ------------------------------------------------------------------------------------------

    def prepare(self, again: Sequence[str]) -> None:
        """Make the folders, or check that they hold this sweep, and remove the cases that are to be run again.

        Cases whose file is torn (empty, or cut off) are run again, too, with a warning.

        Parameters
        ----------
        again : sequence of str
            Statuses whose cases are run again.

        Raises
        ------
        ValueError
            If the folder holds another sweep, the code of the function has changed, or a file is not of this sweep.
        StorageError
            If the folder cannot be written, or the disk has no room for what is left.
        """
        self._make_folders()
        file, wanted = self.folder / "sweep.json", self.description()
        kept = self._description_kept(file)
        if kept is not None:
            self._compare(file, kept, wanted)
        self._check_foreign()
        counts: Counter[str] = Counter()
        for number in sorted(self.ended()):
            try:
                row = self.read(number)
            except _Torn as torn:
                logger.warning("%s: the case is run again", torn)
                self._file(number).unlink()
                continue
            if row["status"] in again:
                self._file(number).unlink()
                continue
            counts["other code"] += row["code"] != self._code
            whole = row["status"] == "completed" and self.keep_runs and row["run"]
            counts["no run"] += whole and not (self.folder / "runs" / f"{number}.nc").exists()
        if counts["other code"]:
            logger.warning(
                "%s: %d cases are kept that other code has computed (sweep.json was removed)", self.folder,
                counts["other code"],
            )  # fmt: skip
        if counts["no run"]:
            logger.warning(
                "%s: the whole results of %d cases were not kept when they ran; again=['completed'] (--again "
                "completed) runs them again", self.folder, counts["no run"],
            )  # fmt: skip
        # without MPI the leader distinguishes cases that end their process from those that ended with the sweep
        self.forget_begun(n for n, begun in self.begun().items() if not begun["mpi"])
        self._check_room(len(self.left()))
        if kept is None:
            self._write(file, json.dumps(wanted))

    def _make_folders(self) -> None:
        for name in ("cases", "begun", *(["runs"] if self.keep_runs else [])):
            place = self.folder / name
            with self._writing(place):
                place.mkdir(parents=True, exist_ok=True)
                with tempfile.TemporaryFile(dir=place) as probe:
                    probe.write(bytes(2**16))
                    probe.flush()
                    os.fsync(probe.fileno())
        self.remove_partial_files()

    def remove_partial_files(self) -> None:
        """Remove what killed processes have left of files that they were writing."""
        for place in (self.folder, *(self.folder / name for name in ("cases", "begun", "runs"))):
            for partial in place.glob(".*.partial"):
                partial.unlink(missing_ok=True)
        for mark in (self.folder / "begun").glob("*.json"):
            if _mark(mark) is None:
                mark.unlink(missing_ok=True)

    def _description_kept(self, file: Path) -> dict[str, Any] | None:
        try:
            found = json.loads(file.read_text("utf-8"))
        except FileNotFoundError:
            return None
        except (OSError, ValueError, RecursionError) as error:
            raise ValueError(
                f"{file} cannot be read ({error}); remove it, and the same call goes on: every case that has ended "
                "says itself what it belongs to."
            ) from None
        wanted = {"format": int, "exumob": str, "number": int, "cases": str, "function": dict, "code": dict}
        if not isinstance(found, dict) or found.get("format", FORMAT) != FORMAT:
            raise ValueError(f"{file} was written by another version of exumob; give another folder, or remove it.")
        wrong = [name for name, kind in wanted.items() if not isinstance(found.get(name), kind)]
        if wrong:
            raise ValueError(
                f"{file} is not the description of a sweep of this version of exumob ({wrong[0]} is missing or wrong); "
                "give another folder, or remove this one."
            )
        return found

    def _compare(self, file: Path, kept: dict[str, Any], wanted: dict[str, Any]) -> None:
        remedy = "give another folder, or remove it"
        if kept["function"] != wanted["function"]:
            raise ValueError(
                f"{self.folder} holds another sweep (another experiment or function: "
                f"{differences(kept['function'], wanted['function'])}); {remedy}."
            )
        if (kept["number"], kept["cases"]) != (wanted["number"], wanted["cases"]):
            number = f": {kept['number']} then, {wanted['number']} now" if kept["number"] != wanted["number"] else ""
            raise ValueError(f"{self.folder} holds another sweep (other cases{number}); {remedy}.")
        if kept["exumob"] != wanted["exumob"]:
            raise ValueError(
                f"{self.folder} holds a sweep of exumob {kept['exumob']}, this is {wanted['exumob']}; {remedy}."
            )
        if kept["code"] != wanted["code"]:
            then, now = kept["code"], wanted["code"]
            names = sorted(name for name in {**then, **now} if then.get(name) != now.get(name))
            raise ValueError(
                f"{self.folder} holds results as they were before its source was changed; {remedy}. Changed: "
                f"{', '.join(names)}. If the change moves no result, remove {file} alone: what has ended is kept."
            )

    def _check_foreign(self) -> None:
        """Raise ValueError if a file among the cases is none of this sweep, or the place of the result is taken."""
        if (self.folder / "sweep.nc").is_dir():
            raise ValueError(f"{self.folder / 'sweep.nc'} is a folder, and the result is to go there; move it away.")
        with os.scandir(self.folder / "cases") as entries:
            files = {e.name: e.is_file() for e in entries if e.name.endswith(".json") and not e.name.startswith(".")}
        foreign = sorted(
            name for name, is_file in files.items()
            if not is_file or (number := number_of(name)) is None or number >= len(self.cases)
        )  # fmt: skip
        if foreign:
            more = f" and {len(foreign) - 1} more files" if len(foreign) > 1 else ""
            raise ValueError(
                f"{self.folder / 'cases' / foreign[0]}{more}: no case of this sweep, whose {len(self.cases)} cases are "
                f"files from 0.json to {len(self.cases) - 1}.json; move it out of the folder."
            )

    def _check_room(self, left: int) -> None:
        """Raise StorageError if the disk has no room for so many cases."""
        need = room_needed(self.function, left, self.keep_runs)
        with self._writing(self.folder):
            free = shutil.disk_usage(self.folder).free
        if need > free:
            raise StorageError(
                f"{self.folder}: {left} cases need about {spelled_size(need)}, and the disk has {spelled_size(free)} "
                "left; make room, or give a folder on another disk."
            )
        if hasattr(os, "statvfs"):
            files = os.statvfs(self.folder)
            if files.f_files and left + 8 > files.f_favail:
                raise StorageError(
                    f"{self.folder}: {left} cases need as many files, and the disk has room for {files.f_favail}; "
                    "remove files, or give a folder on another disk."
                )

    # -- cases ---------------------------------------------------------------------------------------------------------

    def ended(self) -> set[int]:
        """Numbers of the cases that have ended."""
        with os.scandir(self.folder / "cases") as entries:
            numbers = {number_of(e.name) for e in entries}
        return {n for n in numbers if n is not None and n < len(self.cases)}

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

        Raises
        ------
        StorageError
            If that cannot be written.
        """
        file = self.folder / "begun" / f"{number}.json"
        found = _mark(file)
        before = 0 if found is None else int(found["attempt"])
        mark = {"pid": os.getpid(), "host": socket.gethostname(), "at": time.time(), "attempt": before + 1, "mpi": mpi}
        with self._writing(file):  # need not outlive a loss of power: not forced to the disk
            try:
                file.write_text(json.dumps(mark), "utf-8")
            except OSError:
                file.unlink(missing_ok=True)
                raise
        return before

    def forget_begun(self, numbers: Iterable[int]) -> None:
        """Remove the marks of cases that did not end their process, but were ended with it."""
        for number in numbers:
            (self.folder / "begun" / f"{number}.json").unlink(missing_ok=True)

    def begun(self) -> dict[int, dict[str, Any]]:
        """Marks of the cases under way, by number: the process (``pid``, ``host``), when (``at``), ``attempt``."""
        found = {}
        for file in (self.folder / "begun").glob("*.json"):
            number, mark = number_of(file.name), _mark(file)
            if number is not None and mark is not None:
                found[number] = mark
        return found

    def end(
        self, number: int, status: str, reason: str, wall: float, values: Mapping[str, Any], run: bool = False
    ) -> None:  # fmt: skip
        """Keep how a case ended: its status, the reason, the wall time [s], the values found, whether as a whole run.

        Raises
        ------
        StorageError
            If that cannot be written.
        """
        row = {
            "format": FORMAT, "exumob": package_version(), "function": self._values, "code": self._code,
            "parameters": json.loads(case_text(self.cases[number])), "status": status, "reason": _clean(reason),
            "wall_time": wall, "run": run,
            "values": {name: value if isinstance(value, str) else float(value) for name, value in values.items()},
        }  # fmt: skip
        self._write(self._file(number), json.dumps(row | {"check": digest(json.dumps(row))}))
        (self.folder / "begun" / f"{number}.json").unlink(missing_ok=True)

    def keep_run(self, number: int, run: xr.Dataset) -> None:
        """Keep the whole Dataset of a case.

        Raises
        ------
        StorageError
            If it cannot be written.
        """
        file = self.folder / "runs" / f"{number}.nc"
        with self._writing(file):
            save_dataset(run, file, elsewhere=False)

    def read(self, number: int) -> dict[str, Any]:
        """Return how a case ended, as `end` has kept it.

        Raises
        ------
        ValueError
            If the file is torn, or is not that of this case of this sweep.
        """
        file = self._file(number)
        try:
            row: dict[str, Any] = json.loads(file.read_bytes())
        except OSError as error:
            raise ValueError(f"{file} cannot be read ({error.strerror}); mend that, or remove the file.") from None
        except (ValueError, RecursionError) as error:
            raise _Torn(f"{file} was not written to its end ({error})") from None
        wrong = _fault_of_row(row)
        if wrong:
            raise ValueError(
                f"{file} is not how a case ended ({wrong}); remove it, and the same call runs the case again."
            )
        if row["exumob"] != package_version():
            wrong = f"was computed by exumob {row['exumob']}, this is {package_version()}"
        elif row["function"] != self._values:
            wrong = "was computed by another experiment or function"
        elif json.dumps(row["parameters"]) != case_text(self.cases[number]):
            case = json.loads(case_text(self.cases[number]))
            then, now = ({n: json.dumps(v) for n, v in values.items()} for values in (row["parameters"], case))
            wrong = f"is another case: {differences(then, now)}"
        elif row["check"] != digest(json.dumps({name: part for name, part in row.items() if name != "check"})):
            wrong = "was changed after it was written"
        if wrong:
            raise ValueError(
                f"{file} {wrong}. Its result is not taken for this case: give another folder, or remove the file to "
                "have the case computed again."
            )
        return row

    def _file(self, number: int) -> Path:
        return self.folder / "cases" / f"{number}.json"

    def _write(self, file: Path, text: str) -> None:
        with self._writing(file):
            write_text(file, text)

    @contextlib.contextmanager
    def _writing(self, file: Path) -> Iterator[None]:
        """Turn an error of the disk into one that says what to do."""
        try:
            yield
        except OSError as error:
            kept = any((self.folder / "cases").glob("[0-9]*.json"))
            raise StorageError(
                f"{file} cannot be written ({error.strerror or error}); {storage_remedy(error)}."
                + (f" What has ended is kept in {self.folder}: the same call goes on with it." if kept else "")
            ) from None

    @contextlib.contextmanager
    def locked(self) -> Iterator[None]:
        """Hold the folder against other sweeps; the lock goes with the process.

        Raises
        ------
        RuntimeError
            If another sweep holds it.
        StorageError
            If the folder cannot be made.
        """
        file = self.folder / ".lock"
        with self._writing(self.folder):
            self.folder.mkdir(parents=True, exist_ok=True)
            lock = os.open(file, os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0), 0o666)
        try:
            if sys.platform != "win32":
                import fcntl

                try:
                    fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                except BlockingIOError:
                    raise RuntimeError(
                        f"another sweep is at work in {self.folder}; wait for it, or end it first."
                    ) from None
                except OSError as error:  # some shared disks have no locks
                    logger.warning(
                        "%s cannot be locked (%s): see to it that no other sweep works there", self.folder,
                        error.strerror,
                    )  # fmt: skip
            yield
        finally:
            os.close(lock)

    def gather(self) -> xr.Dataset:
        """Gather all rows as one Dataset along ``case``; every variable has ``units`` and ``long_name``.

        Raises
        ------
        ValueError
            If the file of a case is torn or of another one.
        """
        try:
            rows = [self.read(number) for number in range(len(self.cases))]
        except _Torn as torn:
            raise ValueError(f"{torn}; the same call runs the case again.") from None
        names = sorted({name for row in rows for name in row["values"]})
        known = _known_variables(self.function, self.cases[0], any(row["run"] for row in rows))
        found = {
            name: ("case", _results([row["values"].get(name) for row in rows]), _attributes(name, known))
            for name in names
        } | {
            name: ("case", [row[key] for row in rows], _attributes(name, OWN_VARIABLES))
            for name, key in (("status", "status"), ("reason", "reason"), ("case_wall_time", "wall_time"))
        }  # fmt: skip
        parameters = {
            name: ("case", _column([case[name] for case in self.cases]), _attributes(name, known))
            for name in self.names
        }  # fmt: skip
        others = sum(row["code"] != self._code for row in rows)
        return xr.Dataset(
            found,
            coords={"case": ("case", np.arange(len(rows)), {"units": "1", "long_name": "number of the case"})}
            | parameters,
            attrs=provenance()
            | {"title": "exumob sweep", "parameters": " ".join(self.names)}
            | ({"cases_of_other_code": others} if others else {}),
        )

    def save(self, result: xr.Dataset) -> Path:
        """Write the gathered rows to ``sweep.nc``.

        Raises
        ------
        StorageError
            If that cannot be written.
        """
        file = self.folder / "sweep.nc"
        with self._writing(file):
            return save_dataset(result, file, elsewhere=False)


class _Torn(ValueError):
    """The file of a case was not written to its end."""


def room_needed(function: Any, number: int, keep_runs: bool) -> float:
    """Estimate the room on the disk for so many cases [bytes]."""
    each = float(ROW_BYTES)
    if keep_runs and isinstance(function, Experiment):
        each += STEP_BYTES * function.duration / function.record_step
    return number * each


def case_text(case: Case) -> str:
    """Values of a case as JSON, files with a digest of their contents."""
    try:
        return json.dumps(case, default=_plain_value)
    except (ValueError, TypeError, RecursionError) as error:
        raise ValueError(f"sweep.cases: {shown(case)} cannot be kept ({error}); give numbers or texts.") from None


def write_text(file: Path, text: str) -> None:
    """Write a text file whole or not at all."""
    with atomic_write(file) as temporary:
        temporary.write_text(text, "utf-8")


def number_of(name: str) -> int | None:
    """Number of the case whose file has this name; None for any other file."""
    return int(name[:-5]) if re.fullmatch(r"(0|[1-9][0-9]{0,17})\.json", name, re.ASCII) else None


def fault_of_result(values: Any, parameters: Sequence[str]) -> str:
    """Say what is wrong with that which a function has returned for a case; empty if nothing is."""
    if not isinstance(values, Mapping):
        return f"it returned {type(values).__name__}; return a Dataset of simulate, or numbers by name"
    for name, value in values.items():
        if not isinstance(name, str) or not name or re.search(r"[/\0]", name):
            return f"the result {name!r} has no proper name; use a text without '/'"
        if name in OWN_NAMES or name in parameters:
            return f"the result {name!r} has a name that is taken by a parameter or a column; rename it"
        if not isinstance(value, str) and not _is_number(value):
            return f"the result {name} = {value!r:.80} is not a number; return one number for each name"
    return ""


def check_names(cases: Sequence[Case]) -> None:
    """Raise ValueError unless cases are dicts with the same proper names."""
    if isinstance(cases, Mapping) or not isinstance(cases, Sequence) or isinstance(cases, str):
        raise ValueError(
            f"sweep.cases is a {type(cases).__name__}; give a list of dicts, such as [{{'hull.mass': 49.0}}], or make "
            "it with grid or sample."
        )
    if not cases:
        raise ValueError("sweep.cases is empty; give one case at least.")
    for n, case in enumerate(cases):
        if not isinstance(case, dict):
            raise ValueError(f"sweep.cases: case {n} is {case!r:.80}; give a dict of values by name.")
        if list(case) != list(cases[0]):
            raise ValueError(f"sweep.cases: case {n} has the names {list(case)}, the first one {list(cases[0])}.")
    for name in cases[0]:
        if not isinstance(name, str) or not name or re.search(r"[/\s\0]", name) or name in OWN_NAMES:
            raise ValueError(
                f"sweep.cases: {name!r} cannot be the name of a parameter; use a text without '/' and blanks, other "
                f"than {', '.join(OWN_NAMES)}."
            )


def _fault_of_row(row: Any) -> str:
    """Say what is wrong with the content of a case's file; empty if nothing is."""
    if not isinstance(row, dict):
        return f"it holds a {type(row).__name__}"
    if row.get("format") != FORMAT:
        return "it is in the layout of another version of exumob, or not of exumob at all"
    kinds: dict[str, Any] = {
        "exumob": str, "function": str, "code": str, "parameters": dict, "status": str, "reason": str,
        "wall_time": int | float, "run": bool, "values": dict, "check": str,
    }  # fmt: skip
    for name, kind in kinds.items():
        if not isinstance(row.get(name), kind):
            return f"{name} is {row[name]!r:.60}" if name in row else f"{name} is missing"
    if row["status"] not in STATUSES:
        return f"status is {row['status']!r}"
    bad = [name for name, value in row["values"].items() if not isinstance(value, str) and not _is_number(value)]
    return f"the value of {bad[0]} is {row['values'][bad[0]]!r:.60}" if bad else ""


def _mark(file: Path) -> dict[str, Any] | None:
    """Mark of a case under way; None if there is none that can be read."""
    try:
        found = json.loads(file.read_bytes())
        return {
            "pid": int(found["pid"]), "at": float(found["at"]), "attempt": int(found["attempt"]),
            "mpi": bool(found["mpi"]),
        }  # fmt: skip
    except (OSError, ValueError, TypeError, KeyError, OverflowError, RecursionError):
        return None


def storage_remedy(error: OSError) -> str:
    """What to do about a disk that cannot be written."""
    if error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG):
        return "make room on the disk"
    if error.errno in (errno.EACCES, errno.EPERM, errno.EROFS):
        return "give a folder that can be written"
    if error.errno in (errno.EEXIST, errno.ENOTDIR):
        return "a file is in the place of the folder; give another folder"
    return "look after the disk, or give another folder"


def _is_number(value: Any) -> bool:
    if isinstance(value, str | bytes) or value is None:
        return False
    try:
        float(value)
    except (TypeError, ValueError, OverflowError):
        return False
    return True


def _clean(text: str) -> str:
    """Text as netCDF can hold it."""
    return text.replace("\0", "?").encode("utf-8", "replace").decode("utf-8")


def _plain_value(value: Any) -> Any:
    if isinstance(value, np.generic):
        return value.item()
    return file_text(value) if isinstance(value, Path) else stable_repr(value)


def _known_variables(function: Any, case: Case, runs: bool) -> dict[str, tuple[str, str]]:
    """Unit and meaning by name: of key figures of runs, of the parameters of an `Experiment`, of what is stated."""
    known = dict(FIGURES) if runs else {}
    experiment = function if isinstance(function, Experiment) else getattr(function, "experiment", None)
    if isinstance(experiment, Experiment):
        known |= {name: experiment.meaning(name, case) for name in case}
    stated = getattr(function, "variables", None)
    if isinstance(stated, Mapping):
        known |= {str(name): (str(unit), str(meaning)) for name, (unit, meaning) in stated.items()}
    return known


def _attributes(name: str, known: Mapping[str, tuple[str, str]]) -> dict[str, str]:
    units, meaning = known.get(name, ("unknown", name))
    return {"units": units, "long_name": meaning}


def _results(values: list[Any]) -> np.ndarray:
    """Column of results; nan, or an empty text, where a case has none."""
    if any(isinstance(value, str) for value in values):
        return np.array(["" if value is None else _clean(str(value)) for value in values])
    return np.array([math.nan if value is None else value for value in values], float)


def _column(values: list[Any]) -> np.ndarray:
    if all(isinstance(value, bool | int | float | np.generic) for value in values):
        found = np.array(values)
        if found.dtype.kind in "bifu":
            return found
    return np.array([_clean(str(value)) for value in values])
