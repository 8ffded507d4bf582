"""Checkpoints: the whole of a run in one file, from which it goes on with the same bits.

A file is an uncompressed numpy archive (.npz): every array under its own name, and one text, JSON, that says how they
hang together and what run they belong to, with a digest of all. No pickle: a file from elsewhere can do no harm. It is
written under another name and then renamed, so that a killed run leaves the last whole one. What is damaged is refused.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import logging
import os
import time
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from exumob.coupling.scheme import Coupling
from exumob.multibody.system import MultibodyVehicle, SavedState
from exumob.simulation.description import RunDescription
from exumob.support.files import CHECKPOINTS, atomic_write, require_ending, require_writable
from exumob.support.identity import differences, program_digest, users_identity
from exumob.support.provenance import parameters_json, versions
from exumob.vehicle.motion import HISTORY_STEP
from exumob.water.hydrodynamics import Hydrodynamics
from exumob.water.mesh_file import mesh_digest

logger = logging.getLogger(__name__)

INTERVAL = 0.5
"""Simulated time between checkpoints [s]."""
RESCUE_STEPS = 10
"""Macro steps after which the state is noted in memory, for a checkpoint when a run breaks in the midst of a step."""
SLOW = 0.5
"""Time for a flow code's save [s] beyond which its state is noted less often."""
HEAD = "contents"
"""Name of the JSON text in the archive."""
ROOM = 4_000_000
"""Room that a folder must have for a first checkpoint [bytes]; those of the flow are larger, which only shows later."""


@dataclass(frozen=True)
class Fingerprint:
    """Texts that tell one run from another, by part: a checkpoint fits only a run with the same."""

    parts: dict[str, str]

    @classmethod
    def of(cls, run: RunDescription) -> Fingerprint:
        """Return the fingerprint of a run: parameters, maneuver's course, hull mesh, own forces, versions, sources."""
        parts = {name: parameters_json({name: value}) for name, value in run.parts().items()}
        times = np.arange(0.0, run.steps.duration + HISTORY_STEP, HISTORY_STEP)
        maneuver = run.maneuver
        course = np.array([(*maneuver.steering(t), *maneuver.wheel_speed(t)) for t in times], dtype=float)
        parts["maneuver"] += hashlib.sha256(course.tobytes()).hexdigest()
        parts["vehicle"] += mesh_digest(run.vehicle.hull)
        found = users_identity(run.forces)
        parts["forces"] = json.dumps(found.values | {f"source of {name}": text for name, text in found.code.items()})
        parts["versions"] = json.dumps(versions())
        parts["program"] = program_digest()
        return cls(parts)

    def differences(self, other: dict[str, str]) -> list[str]:
        """Names of the parts that differ; of forces also what of them."""
        found = [name for name in self.parts if self.parts[name] != other.get(name)]
        if "forces" in found:
            with contextlib.suppress(KeyError, TypeError, ValueError, AttributeError):  # of a damaged file
                said = differences(json.loads(other["forces"]), json.loads(self.parts["forces"]))
                found[found.index("forces")] = f"forces ({said})"
        return found


class Checkpoints:
    """The checkpoint file of one run.

    Parameters
    ----------
    file : Path
    fingerprint : Fingerprint
    resume : bool
        Whether to go on from the file, if it is there.

    Raises
    ------
    ValueError
        If the folder does not exist, cannot be written or is full, or the file is there but not to be resumed, is of
        another run, or damaged.
    """

    def __init__(self, file: Path, fingerprint: Fingerprint, resume: bool) -> None:
        """Check the file before anything runs."""
        self.file, self.fingerprint = file, fingerprint
        self._noted: tuple[int, Any, Any, Any] | None = None
        self._written = -1
        self._passed = 0  # whole intervals
        self._patience = 0.0
        self._began = time.perf_counter()
        self.elapsed = 0.0
        """Wall time of earlier processes until the checkpoint from which this one goes on [s]."""
        self._failed = False
        _check_folder(file)
        self.found = file.exists()
        if self.found and not resume:
            raise ValueError(f"checkpoint {file} exists already; resume from it (resume, --resume) or move it away.")
        self.released, self.spin_up = False, None
        self._read: tuple[int, dict[str, Any]] | None = None
        if self.found:
            with _opened(file) as archive:
                head = _head(file, archive)
            self.elapsed = head["elapsed"]
            wrong = fingerprint.differences(head["fingerprint"])
            if wrong:
                raise ValueError(
                    f"checkpoint {file} belongs to another run: {', '.join(wrong)} differ"
                    f"{'s' if len(wrong) == 1 else ''}. Resume with what it was made with, or move it away and begin "
                    "anew."
                )
            self._read = read(file)
            steps, tree = self._read
            self.released = steps >= 0
            parts = {"model", "hydrodynamics", "coupling"} if self.released else {"spin_up"}
            if set(tree) != parts:
                _refuse(file, f"it holds {', '.join(sorted(tree)) or 'nothing'} instead of {', '.join(sorted(parts))}")
            self.spin_up = tree.get("spin_up")

    def resume(self, model: MultibodyVehicle, hydrodynamics: Hydrodynamics, coupling: Coupling) -> int:
        """Bring all to the state of the file; return the number of macro steps done."""
        steps, saved = read(self.file) if self._read is None else self._read
        self._read = None  # it may be large
        try:
            model.restore(SavedState(**saved["model"]))
            hydrodynamics.restore(saved["hydrodynamics"])
            coupling.restore(saved["coupling"])
        except (KeyError, TypeError, ValueError, AttributeError, IndexError, RuntimeError) as error:
            _refuse(self.file, f"{type(error).__name__}: {error}")
        self._written, self._passed = steps, int(model.time / INTERVAL + 1e-6)
        logger.info("%s: goes on from %.3f s", self.file, model.time)
        return steps

    def keep_spin_up(self, saved: Any) -> None:
        """Write the state of the water before the release."""
        self._keep(-1, {"spin_up": saved}, "before the release")

    def before_step(
        self, step: int, model: MultibodyVehicle, hydrodynamics: Hydrodynamics, coupling: Coupling
    ) -> None:  # fmt: skip
        """Write or note the state before macro step number `step`, if it is time to."""
        passed = int(model.time / INTERVAL + 1e-6)
        if (step == 0 or passed > self._passed) and step != self._written:
            self._passed = passed
            self._write(step, model, hydrodynamics, coupling)
        if step % RESCUE_STEPS == 0 and time.monotonic() > self._patience:
            begin = time.monotonic()
            self._noted = (
                step, model.save(histories=False), hydrodynamics.save(histories=False), coupling.save(histories=True)
            )  # fmt: skip
            took = time.monotonic() - begin
            if took > SLOW:
                self._patience = begin + 20.0 * took

    def rescue(self, model: MultibodyVehicle, hydrodynamics: Hydrodynamics, coupling: Coupling) -> None:
        """Write the state noted last, after a run was stopped or broke wherever it was."""
        if self._noted is None or self._noted[0] <= self._written:
            return
        step, bodies, water, scheme = self._noted
        model.restore(bodies)
        hydrodynamics.restore(water)
        coupling.restore(scheme)
        self._write(step, model, hydrodynamics, coupling)

    def _write(
        self, step: int, model: MultibodyVehicle, hydrodynamics: Hydrodynamics, coupling: Coupling
    ) -> None:  # fmt: skip
        saved = model.save()
        tree = {
            "model": {f.name: getattr(saved, f.name) for f in fields(saved)},
            "hydrodynamics": hydrodynamics.save(),
            "coupling": coupling.save(),
        }
        if self._keep(step, tree, f"at {model.time:.3f} s"):
            self._written = step

    def _keep(self, step: int, tree: dict[str, Any], when: str) -> bool:
        """Write a checkpoint; where that fails, say so once and let the run go on."""
        try:
            write(self.file, step, tree, self.fingerprint, self._elapsed())
        except OSError as error:
            if not self._failed:
                kept = f"{self.file} holds an earlier state" if self.file.exists() else "there is none yet"
                reason = os.strerror(error.errno) if error.errno else str(error)
                logger.warning(
                    "checkpoint %s could not be written %s (%s); the run goes on, and %s. Make room, or let the folder "
                    "be written: the next one is tried.", self.file, when, reason, kept,
                )  # fmt: skip
            self._failed = True
            return False
        if self._failed:
            logger.warning("checkpoint %s could be written again %s.", self.file, when)
        self._failed = False
        return True

    def _elapsed(self) -> float:
        return self.elapsed + time.perf_counter() - self._began


def write(file: Path, step: int, tree: dict[str, Any], fingerprint: Fingerprint, elapsed: float = 0.0) -> None:
    """Write a tree of dicts, lists, arrays, numbers and text, whole or not at all; `elapsed` [s] is what it took."""
    arrays: dict[str, np.ndarray] = {}
    head = {"step": step, "fingerprint": fingerprint.parts, "elapsed": elapsed, "tree": _taken_apart(tree, "", arrays)}
    head["digest"] = _digest(json.loads(json.dumps(head)), arrays)
    with atomic_write(file) as temporary, temporary.open("wb") as stream:
        np.savez(stream, allow_pickle=False, **{HEAD: np.array(json.dumps(head))}, **arrays)


def read(file: Path) -> tuple[int, dict[str, Any]]:
    """Return the number of macro steps done (-1: not released yet), and the tree given to `write`.

    Raises
    ------
    ValueError
        If the file is damaged, or not what `write` has written.
    """
    with _opened(file) as archive:
        head = _head(file, archive)
        arrays = {name: archive[name] for name in archive.files if name != HEAD}
        if head.pop("digest", None) != _digest(head, arrays):
            _refuse(file, "it is not what was written: its digest differs")
        tree: dict[str, Any] = _put_together(head["tree"], arrays)
    return head["step"], tree


def _digest(head: dict[str, Any], arrays: dict[str, np.ndarray]) -> str:
    """Digest of all that a checkpoint holds."""
    found = hashlib.sha256(json.dumps(head, sort_keys=True).encode())
    for name in sorted(arrays):
        array = np.ascontiguousarray(arrays[name])
        found.update(f"{name} {array.dtype.str} {array.shape}".encode())
        found.update(array.reshape(-1).view(np.uint8).data if array.size else b"")
    return found.hexdigest()


def _check_folder(file: Path) -> None:
    """Raise ValueError if the file cannot be written, before anything runs."""
    require_ending("checkpoint", file, CHECKPOINTS)
    if not file.parent.is_dir():
        raise ValueError(f"checkpoint {file}: the folder {file.parent} does not exist; create it first.")
    if file.is_dir():
        raise ValueError(f"checkpoint {file}: this is a folder; give a file name.")
    try:
        require_writable(file, max(ROOM, file.stat().st_size if file.exists() else 0))
    except (OSError, ValueError) as error:
        raise ValueError(f"checkpoint {error}") from None


@contextmanager
def _opened(file: Path) -> Iterator[Any]:
    """Open an archive whose members are whole; whatever goes wrong in it is a ValueError that names the file."""
    try:
        with file.open("rb") as stream:
            archive = np.load(stream, allow_pickle=False)
            if not isinstance(archive, np.lib.npyio.NpzFile) or archive.zip is None:
                raise _Damaged("it is no numpy archive")
            if any(member.compress_type != zipfile.ZIP_STORED for member in archive.zip.infolist()):
                raise _Damaged("it is compressed, which ours are not")
            bad = archive.zip.testzip()  # before any array is made of what may be damaged
            if bad is not None:
                raise _Damaged(f"the checksum of its part {bad} is wrong")
            yield archive
    except OSError as error:
        if isinstance(error, FileNotFoundError | PermissionError):
            raise ValueError(f"checkpoint {file} cannot be opened ({error.strerror}); give another file.") from None
        _refuse(file, str(error))
    except _Refused:
        raise
    except Exception as error:  # of zipfile, zlib and numpy: a dozen kinds, for whatever is wrong inside
        if "pickle" in str(error):  # numpy's advice, to load it all the same, is bad advice for a file from elsewhere
            error = _Damaged("it holds Python objects, or is no numpy archive")
        _refuse(file, str(error) if isinstance(error, _Damaged) else f"{type(error).__name__}: {error}")


class _Damaged(Exception):
    """What is wrong with a file."""


class _Refused(ValueError):
    """A file is refused, and the message says why."""


def _refuse(file: Path, why: str) -> NoReturn:
    raise _Refused(
        f"checkpoint {file} cannot be read ({' '.join(why.split())[:300]}); it is damaged, cut off or of another kind; "
        "move it away and begin anew."
    ) from None


def _head(file: Path, archive: Any) -> dict[str, Any]:
    """Return what the archive says of itself, its kinds checked."""
    if HEAD not in archive.files:
        raise _Refused(f"checkpoint {file} is not one of exumob; give another file.")
    head = json.loads(str(archive[HEAD]))
    kinds = {"step": int, "fingerprint": dict, "elapsed": float, "tree": dict}
    wrong = [name for name, kind in kinds.items() if not isinstance(head, dict) or not isinstance(head.get(name), kind)]
    if wrong:
        _refuse(file, f"its head has no right {', no right '.join(wrong)}")
    return dict(head)


def _taken_apart(value: Any, name: str, arrays: dict[str, np.ndarray]) -> Any:
    """JSON of a tree, its arrays put aside under names of their own."""
    if isinstance(value, np.ndarray):
        arrays[name] = value
        return {"array": name}
    if isinstance(value, dict):
        return {"dict": {key: _taken_apart(part, f"{name}/{key}", arrays) for key, part in value.items()}}
    if isinstance(value, list | tuple):
        return {"list": [_taken_apart(part, f"{name}/{n}", arrays) for n, part in enumerate(value)]}
    if isinstance(value, np.generic):
        value = value.item()
    if value is None or isinstance(value, bool | int | float | str):
        return {"plain": value}
    raise TypeError(f"checkpoint: {name} is a {type(value).__name__}; save() must give dicts, lists, arrays, numbers.")


def _put_together(node: Any, arrays: dict[str, np.ndarray]) -> Any:
    ((kind, value),) = node.items()
    if kind == "array":
        return arrays[value]
    if kind == "dict":
        return {key: _put_together(part, arrays) for key, part in value.items()}
    if kind == "list":
        return [_put_together(part, arrays) for part in value]
    return value
