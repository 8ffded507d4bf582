"""Processes that end with the one that started them, even if that is killed."""

from __future__ import annotations

import ctypes
import multiprocessing
import multiprocessing.connection
import os
import signal
import sys
import threading


def end_with_parent() -> None:
    """Let this process of `multiprocessing` end as soon as its parent is gone; called once at its begin.

    A pipe to the parent is watched, on every system; on Linux the system also kills this process at once, even while it
    computes without giving way to other threads.
    """
    parent = multiprocessing.parent_process()
    if parent is None:
        return

    def watch() -> None:
        multiprocessing.connection.wait([parent.sentinel])
        os._exit(1)

    threading.Thread(target=watch, name="end with parent", daemon=True).start()
    if sys.platform == "linux" and os.getppid() == parent.pid:
        ctypes.CDLL(None).prctl(1, signal.SIGKILL)  # PR_SET_PDEATHSIG
        if os.getppid() != parent.pid:  # it has gone in the meantime
            os._exit(1)
