"""Checkpoints: the whole of a run in one file, from which it goes on with the same bits.

A file is an uncompressed numpy archive (.npz): every array under its own name, and one text, JSON, that says how they
hang together and what run they belong to. No pickle: a file from elsewhere can do no harm. It is written under another
name and then renamed, so that a killed run leaves the last whole one.
"""

from __future__ import annotations

import hashlib
import json
import logging
import struct
import time
import zipfile
import zlib
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from exumob.coupling.scheme import Coupling
from exumob.multibody.system import MultibodyVehicle, SavedState
from exumob.simulation.description import RunDescription
from exumob.support.files import PACKAGE, atomic_write, require_writable
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


@dataclass(frozen=True)
class Fingerprint:
    """Texts that tell one run from another, by part: a checkpoint fits only a run with the same."""

    parts: dict[str, str]

    @classmethod
    def of(cls, run: RunDescription) -> Fingerprint:
        """Return the fingerprint of a run: parameters, the maneuver's course, a hull mesh, versions and sources."""
        parts = {name: parameters_json({name: value}) for name, value in run.parts().items()}
        times = np.arange(0.0, run.steps.duration + HISTORY_STEP, HISTORY_STEP)
        maneuver = run.maneuver
        course = np.array([(*maneuver.steering(t), *maneuver.wheel_speed(t)) for t in times], dtype=float)
        parts["maneuver"] += hashlib.sha256(course.tobytes()).hexdigest()
        parts["vehicle"] += mesh_digest(run.vehicle.hull)
        parts["versions"] = json.dumps(versions())
        parts["program"] = program_digest()
        return cls(parts)

    def differences(self, other: dict[str, str]) -> list[str]:
        """Names of the parts that differ."""
        return [name for name in self.parts if self.parts[name] != other.get(name)]


def program_digest() -> str:
    """Digest of the package's sources: the same bits come only from the same program."""
    folder = PACKAGE
    digest = hashlib.sha256()
    for file in sorted(folder.rglob("*.py")):
        digest.update(file.relative_to(folder).as_posix().encode() + file.read_bytes())
    return digest.hexdigest()


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
        If the folder does not exist, the file is there but not to be resumed, or is of another run.
    """

    def __init__(self, file: Path, fingerprint: Fingerprint, resume: bool) -> None:
        """Check the file before anything runs."""
        self.file, self.fingerprint = file, fingerprint
        self._noted: tuple[int, Any, Any, Any] | None = None
        self._written = -1
        self._passed = 0  # whole intervals
        self._patience = 0.0
        self._warned = False
        self._began = time.perf_counter()
        self.elapsed = 0.0
        """Wall time of earlier processes until the checkpoint from which this one goes on [s]."""
        if not file.parent.is_dir():
            raise ValueError(f"checkpoint {file}: the folder {file.parent} does not exist; create it first.")
        if file.is_dir():
            raise ValueError(f"checkpoint {file} is a folder; give the name of a file (.npz) in it.")
        self.found = file.exists()
        if self.found and not resume:
            raise ValueError(f"checkpoint {file} exists already; resume from it (resume, --resume) or move it away.")
        require_writable(file)
        step, self._tree = -1, None
        if self.found:
            head, self._tree = _read(file)
            step, self.elapsed = int(head["step"]), float(head["elapsed"])
            wrong = fingerprint.differences(head["fingerprint"])
            if wrong:
                raise ValueError(
                    f"checkpoint {file} belongs to another run: {', '.join(wrong)} differ"
                    f"{'s' if len(wrong) == 1 else ''}. Resume with what it was made with, or move it away and begin "
                    "anew."
                )
        self._step = step
        self.released = self.found and step >= 0
        self.spin_up: Any = self._tree["spin_up"] if self._tree is not None and not self.released else None

    def resume(self, model: MultibodyVehicle, hydrodynamics: Hydrodynamics, coupling: Coupling) -> int:
        """Bring all to the state of the file; return the number of macro steps done.

        Raises
        ------
        ValueError
            If the file is damaged.
        """
        saved, self._tree = self._tree, None
        assert saved is not None
        try:
            model.restore(SavedState(**saved["model"]))
            hydrodynamics.restore(saved["hydrodynamics"])
            coupling.restore(saved["coupling"])
        except (KeyError, TypeError, ValueError, IndexError, AttributeError, RuntimeError) as error:
            raise _damaged(self.file, error) from error
        self._written, self._passed = self._step, int(model.time / INTERVAL + 1e-6)
        logger.info("%s: goes on from %.3f s", self.file, model.time)
        return self._step

    def keep_spin_up(self, saved: Any) -> None:
        """Write the state of the water before the release."""
        write(self.file, -1, {"spin_up": saved}, self.fingerprint, self._elapsed())

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
        try:
            write(self.file, step, tree, self.fingerprint, self._elapsed())
        except OSError as error:
            if not self._warned:
                logger.warning(
                    "checkpoint %s could not be written (%s); the run goes on, and tries again at the next one",
                    self.file, error.strerror or error,
                )  # fmt: skip
            self._warned = True
            return
        self._written, self._warned = step, False

    def _elapsed(self) -> float:
        return self.elapsed + time.perf_counter() - self._began


def write(file: Path, step: int, tree: dict[str, Any], fingerprint: Fingerprint, elapsed: float = 0.0) -> None:
    """Write a tree of dicts, lists, arrays, numbers and text, whole or not at all; `elapsed` [s] is what it took."""
    arrays: dict[str, np.ndarray] = {}
    head = {"step": step, "fingerprint": fingerprint.parts, "elapsed": elapsed, "tree": _taken_apart(tree, "", arrays)}
    with atomic_write(file) as temporary, temporary.open("wb") as stream:
        np.savez(stream, allow_pickle=False, **{HEAD: np.array(json.dumps(head))}, **arrays)


def read(file: Path) -> tuple[int, dict[str, Any]]:
    """Return the number of macro steps done (-1: not released yet), and the tree given to `write`.

    Raises
    ------
    ValueError
        If the file is no checkpoint, or damaged.
    """
    head, tree = _read(file)
    return int(head["step"]), tree


def _read(file: Path) -> tuple[dict[str, Any], dict[str, Any]]:
    """Read a whole file: its head (step, fingerprint, elapsed) and the tree."""
    try:
        with file.open("rb") as stream:
            archive = np.load(stream, allow_pickle=False)
            if not hasattr(archive, "files") or HEAD not in archive.files:
                raise ValueError(f"checkpoint {file} is not one of exumob; give another file.")
            head = json.loads(str(archive[HEAD]))
            right = (
                isinstance(head["step"], int)
                and isinstance(head["elapsed"], int | float)
                and isinstance(head["fingerprint"], dict)
            )
            tree = _put_together(head["tree"], archive)
            if not right or not isinstance(tree, dict):
                raise ValueError("its head is incomplete")
            wanted = ("model", "hydrodynamics", "coupling") if head["step"] >= 0 else ("spin_up",)
            for name in wanted:
                if name not in tree:
                    raise ValueError(f"{name} is missing")
    except ValueError as error:
        if "is not one of exumob" in str(error):
            raise
        raise _damaged(file, error) from error
    except (OSError, EOFError, KeyError, TypeError, IndexError, AttributeError, NotImplementedError, struct.error,
            zipfile.BadZipFile, zlib.error, RecursionError, MemoryError, RuntimeError) as error:  # fmt: skip
        raise _damaged(file, error) from error
    return head, tree


def _damaged(file: Path, error: BaseException) -> ValueError:
    text = " ".join(str(error).split())[:200]
    return ValueError(
        f"checkpoint {file} cannot be read ({type(error).__name__}: {text}): it is damaged or cut off; move it away "
        "and begin anew."
    )


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


def _put_together(node: Any, archive: Any) -> Any:
    ((kind, value),) = node.items()
    if kind == "array":
        return archive[value]
    if kind == "dict":
        return {key: _put_together(part, archive) for key, part in value.items()}
    if kind == "list":
        return [_put_together(part, archive) for part in value]
    return value
