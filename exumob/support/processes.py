"""Processes that end with the one that started them."""

from __future__ import annotations

import os
import threading
import time

INTERVAL = 0.5
"""How often a process looks for its parent [s]."""


def end_with_parent(parent: int) -> None:
    """Let this process end soon after its parent has, however that ended; for the initializers of pools.

    Parameters
    ----------
    parent : int
        Process id of the parent.
    """

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(INTERVAL)
        os._exit(1)

    threading.Thread(target=watch, name="end with parent", daemon=True).start()
