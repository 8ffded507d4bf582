"""Checkpoints: the whole of a run in one file, from which it goes on with the same bits.

The file is that of `exumob.support.saved_state`: arrays and one text, no pickle, written whole or not at all.
"""

from __future__ import annotations

import hashlib
import json
import logging
import os
import time
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from exumob.coupling.scheme import Coupling
from exumob.multibody.system import MultibodyVehicle, SavedState
from exumob.simulation.description import RunDescription
from exumob.support import saved_state
from exumob.support.compiled import computing_clock
from exumob.support.identity import program_digest, users_identity
from exumob.support.provenance import parameters_json, versions
from exumob.support.saved_state import HEAD, head_of, opened, read, refuse, require_place, write
from exumob.vehicle.motion import HISTORY_STEP
from exumob.water.hydrodynamics import Hydrodynamics
from exumob.water.mesh_file import mesh_digest

__all__ = ["HEAD", "Checkpoints", "Fingerprint", "read", "write"]

logger = logging.getLogger(__name__)

INTERVAL = 0.5
"""Simulated time between checkpoints [s]."""
RESCUE_STEPS = 10
"""Macro steps after which the state is noted in memory, for a checkpoint when a run breaks in the midst of a step."""
SLOW = 0.5
"""Time for a flow code's save [s] beyond which its state is noted less often."""


class Fingerprint(saved_state.Fingerprint):
    """Texts that tell one run with a vehicle that drives from another."""

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
        self._began = computing_clock()
        self.elapsed = 0.0
        """Wall time of earlier processes until the checkpoint from which this one goes on [s]."""
        self._failed = False
        require_place(file)
        self.found = file.exists()
        if self.found and not resume:
            raise ValueError(f"checkpoint {file} exists already; resume from it (resume, --resume) or move it away.")
        self.released, self.spin_up = False, None
        self._read: tuple[int, dict[str, Any]] | None = None
        if self.found:
            with opened(file) as archive:
                head = head_of(file, archive)
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
                refuse(file, f"it holds {', '.join(sorted(tree)) or 'nothing'} instead of {', '.join(sorted(parts))}")
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
            refuse(self.file, f"{type(error).__name__}: {error}")
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
        return self.elapsed + computing_clock() - self._began
