"""The checkpoint of a captive run: the flow and the record in one file, from which it goes on with the same bits."""

from __future__ import annotations

import json
import logging
import os
from pathlib import Path
from typing import Any

from exumob.support.compiled import computing_clock
from exumob.support.identity import program_digest
from exumob.support.provenance import parameters_json, versions
from exumob.support.saved_state import Fingerprint, head_of, opened, read, refuse, require_place, write

logger = logging.getLogger(__name__)


class CaptiveCheckpoint:
    """The checkpoint file of one captive run.

    Parameters
    ----------
    file : Path
    parameters : dict
        All that the run depends on.
    resume : bool
        Whether to go on from the file, if it is there.

    Raises
    ------
    ValueError
        If the folder does not exist or cannot be written, or the file is there but not to be resumed, is of another
        run, or damaged.
    """

    def __init__(self, file: Path, parameters: dict[str, Any], resume: bool) -> None:
        """Check the file before anything runs."""
        self.file, self._began, self._failed = file, computing_clock(), False
        self.elapsed = 0.0
        """Wall time of earlier processes until the checkpoint from which this one goes on [s]."""
        parts = {name: parameters_json({name: value}) for name, value in parameters.items()}
        self.fingerprint = Fingerprint(parts | {"versions": json.dumps(versions()), "program": program_digest()})
        require_place(file)
        self.found = file.exists()
        if not self.found:
            return
        if not resume:
            raise ValueError(f"checkpoint {file} exists already; resume from it (resume) or move it away.")
        with opened(file) as archive:
            head = head_of(file, archive)
        if wrong := self.fingerprint.differences(head["fingerprint"]):
            raise ValueError(
                f"checkpoint {file} belongs to another run: {', '.join(wrong)} differ{'s' if len(wrong) == 1 else ''}. "
                "Resume with what it was made with, or move it away and begin anew."
            )
        self.elapsed = float(head["elapsed"])

    def read(self) -> tuple[int, dict[str, Any]]:
        """Return the number of intervals done and the state after them."""
        done, tree = read(self.file)
        if set(tree) != {"solver", "record"} or done != len(tree["record"]["times"]):
            refuse(self.file, "it is not that of a captive run")
        return done, tree

    def write(self, done: int, tree: dict[str, Any]) -> None:
        """Write the state after so many intervals; where that fails, say so once and let the run go on."""
        try:
            write(self.file, done, tree, self.fingerprint, self.elapsed + computing_clock() - self._began)
        except OSError as error:
            if not self._failed:
                reason = os.strerror(error.errno) if error.errno else str(error)
                logger.warning(
                    "checkpoint %s could not be written (%s); the run goes on. Make room, or let the folder be "
                    "written: the next one is tried.", self.file, reason,
                )  # fmt: skip
            self._failed = True
