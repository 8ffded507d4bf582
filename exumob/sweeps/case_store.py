"""The folder of a sweep: what is run, which cases are under way, and how each ended.

Every case that has ended is a file, so that a sweep that was stopped or killed continues with the others. The file says
for itself what it belongs to: the values of the case, those that the function holds (`exumob.support.identity`) and the
version of exumob. What does not fit is refused, what is torn is computed again.
"""

from __future__ import annotations

import contextlib
import errno
import json
import logging
import os
import pickle
import re
import shutil
import socket
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import xarray as xr

from exumob.simulation.result_files import save_dataset
from exumob.support.cost import spelled_size
from exumob.support.files import probe_folder, write_text
from exumob.support.identity import differences, digest, identity
from exumob.support.provenance import EXUMOB_VERSION
from exumob.sweeps.case_rows import FORMAT, case_text, check_names, fault_of_row
from exumob.sweeps.case_table import clean_text, table_of
from exumob.sweeps.experiment import Experiment
from exumob.sweeps.handing_over import WithVehicleFiles
from exumob.sweeps.sampling import ROW_BYTES, Case

logger = logging.getLogger(__name__)

Function = Callable[[Case], xr.Dataset | Mapping[str, float | str]]
"""Takes the values of a case by name; returns a Dataset of `exumob.simulate` or numbers by name."""

STEP_BYTES = 3600
"""Room on the disk for an instant of a kept run."""


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
        If there are no cases, their names differ, or function or cases cannot be pickled.
    """

    def __init__(
        self, folder: Path, function: Function, cases: Sequence[Case], time_limit: float | None, keep_runs: bool
    ) -> None:
        check_names(cases)
        _check_handed_over(function, cases)
        self.folder, self.function, self.cases, self.names = folder, function, list(cases), list(cases[0])
        self.time_limit, self.keep_runs = time_limit, keep_runs
        self.identity = identity(function)
        self._values, self._code = self.identity.values_digest(), self.identity.code_digest()

    def description(self) -> dict[str, Any]:
        """Describe the function, its code and the cases; sweeps with the same description are the same."""
        cases = digest("\n".join(case_text(case) for case in self.cases))
        return {
            "format": FORMAT, "exumob": EXUMOB_VERSION, "number": len(self.cases), "cases": cases,
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
                probe_folder(place)
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
            "format": FORMAT, "exumob": EXUMOB_VERSION, "function": self._values, "code": self._code,
            "parameters": json.loads(case_text(self.cases[number])), "status": status, "reason": clean_text(reason),
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
        wrong = fault_of_row(row)
        if wrong:
            raise ValueError(
                f"{file} is not how a case ended ({wrong}); remove it, and the same call runs the case again."
            )
        if row["exumob"] != EXUMOB_VERSION:
            wrong = f"was computed by exumob {row['exumob']}, this is {EXUMOB_VERSION}"
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
        """Gather all rows as one Dataset along ``case``, see `exumob.sweeps.case_table.table_of`.

        Raises
        ------
        ValueError
            If the file of a case is torn or of another one.
        """
        try:
            rows = [self.read(number) for number in range(len(self.cases))]
        except _Torn as torn:
            raise ValueError(f"{torn}; the same call runs the case again.") from None
        return table_of(rows, self.cases, self.function, self._code)

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


def _check_handed_over(function: Function, cases: Sequence[Case]) -> None:
    """Raise ValueError if other processes cannot be given the function, or a value of a case."""
    plain = str, bool, int, float, type(None), Path
    objects = {
        id(value): (f"sweep.cases: {name} of case {number}", value)
        for number, case in enumerate(cases) for name, value in case.items() if not isinstance(value, plain)
    }  # fmt: skip
    for what, thing in (("sweep.function", function), *objects.values()):
        try:
            pickle.dumps(thing)
        except Exception as error:
            raise ValueError(
                f"{what} cannot be given to another process ({error}); use an Experiment or a function at the top "
                "level of a module, and such functions within them."
            ) from None


def room_needed(function: Any, number: int, keep_runs: bool) -> float:
    """Estimate the room on the disk for so many cases [bytes]."""
    each = float(ROW_BYTES)
    if keep_runs and isinstance(function, Experiment):
        each += STEP_BYTES * function.duration / function.record_step
    return number * each


def number_of(name: str) -> int | None:
    """Number of the case whose file has this name; None for any other file."""
    return int(name[:-5]) if re.fullmatch(r"(0|[1-9][0-9]{0,17})\.json", name, re.ASCII) else None


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
