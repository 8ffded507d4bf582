"""Processes that end with the one that started them."""

from __future__ import annotations

import contextlib
import ctypes
import functools
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from contextlib import contextmanager
from pathlib import Path
from typing import Any

asked_to_stop: list[Callable[[int, Any], None]] = []
"""What takes a request to stop this process in stead of a KeyboardInterrupt, the last one first."""
INTERVAL = 0.5
"""How often a process looks for its parent [s]."""


@functools.cache
def end_with_parent(parent: int) -> None:
    """Let this process end soon after its parent has, however that ended; in the processes of pools.

    On Linux the system kills it, whatever it is at; elsewhere it looks for its parent. Further calls do nothing.

    Parameters
    ----------
    parent : int
        Process id of the parent.
    """
    above = os.getppid()  # not the parent itself where a server starts the processes, which ends with the parent
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(1, signal.SIGKILL)  # PR_SET_PDEATHSIG
        if os.getppid() != above or not lives(parent):  # it ended before that call; a subreaper may have taken over
            os._exit(1)
        return

    def watch() -> None:
        while os.getppid() == above:
            time.sleep(INTERVAL)
        os._exit(1)

    threading.Thread(target=watch, name="end with parent", daemon=True).start()


def terminate_as_interrupted() -> None:
    """Let `kill PID` stop this process as Ctrl-C does: what was computed is kept. Processes that it forks just end.

    A job that a script began with `&` ignores Ctrl-C and `kill -INT`: long runs are often started so. What waits for a
    good moment to stop says so in `asked_to_stop`.
    """
    owner = os.getpid()

    def stop(number: int, frame: Any) -> None:
        if os.getpid() != owner:
            os._exit(128 + number)
        if not asked_to_stop:
            raise KeyboardInterrupt
        asked_to_stop[-1](number, frame)

    if threading.current_thread() is threading.main_thread() and signal.getsignal(signal.SIGTERM) is signal.SIG_DFL:
        signal.signal(signal.SIGTERM, stop)


def lives(pid: int) -> bool:
    """Whether there is a process of this number that has not ended; a zombie has."""
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    with contextlib.suppress(OSError):
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    return True


@contextmanager
def stopping(pool: Executor) -> Iterator[Executor]:
    """Give a pool that begins nothing more when its leader is stopped, and whose processes, if it has any, end then."""
    try:
        yield pool
    except BaseException:
        processes = list((getattr(pool, "_processes", None) or {}).values())  # the pool forgets them when it shuts down
        pool.shutdown(wait=False, cancel_futures=True)
        for process in processes:
            process.terminate()
        raise
    pool.shutdown()
