"""Compiled kernels: say once, before a long silence, that they have yet to be compiled; how long that took."""

from __future__ import annotations

import logging
import pickle
import threading
import time
from collections.abc import Callable
from typing import Any

from numba.core import event

from exumob.support.caches import VARIABLE, is_private

logger = logging.getLogger(__name__)

_said: set[str] = set()


class _Compiling(event.Listener, threading.local):
    """Counts for how long Numba compiles, in each thread by itself: others compute meanwhile."""

    def __init__(self) -> None:
        super().__init__()
        self.depth, self.began, self.total = 0, 0.0, 0.0

    def on_start(self, event: event.Event) -> None:
        """Begin to count, unless this is compiled within another kernel."""
        if self.depth == 0:
            self.began = time.perf_counter()
        self.depth += 1

    def on_end(self, event: event.Event) -> None:
        """Count."""
        self.depth -= 1
        if self.depth == 0:
            self.total += time.perf_counter() - self.began


_compiling = _Compiling()
event.register("numba:compile", _compiling)


def compiling_time() -> float:
    """Return for how long Numba has compiled in this thread [s]."""
    return _compiling.total


def computing_clock() -> float:
    """Return the reading of a clock that stands still while Numba compiles in this thread [s]: differences count."""
    return time.perf_counter() - compiling_time()


def is_compiled(kernel: Callable[..., Any]) -> bool:
    """Return whether a kernel of Numba is compiled in this process, or kept on the disk for its source as it is now."""
    if not hasattr(kernel, "stats") or getattr(kernel, "signatures", None):
        return True  # plain Python (NUMBA_DISABLE_JIT), or compiled here
    try:  # Numba alone knows what it takes for fresh (dates, or digests of the source), and has no public way to ask
        return bool(kernel._cache._cache_file._load_index())  # type: ignore[attr-defined]
    except (AttributeError, OSError, EOFError, pickle.UnpicklingError):  # not kept, or what is kept is damaged
        return False


def say_compilation(what: str, kernel: Callable[..., Any], duration: str) -> None:
    """Say once in a process that kernels must be compiled first, if they are not kept.

    Parameters
    ----------
    what : str
        What they belong to: "the flow solver".
    kernel : callable
        One of them, of those that are compiled late.
    duration : str
        How long it takes: "about two minutes".
    """
    if what in _said:
        return
    _said.add(what)
    if not is_compiled(kernel):
        kept = "what is compiled is kept, later runs start at once"
        if not hasattr(getattr(kernel, "_cache", None), "_cache_file"):  # of Numba's cache that keeps files
            kept = "nothing can be kept here, so every process compiles anew (an earlier warning may say why)"
        elif is_private():
            kept = f"set {VARIABLE} to a folder that you may write, or every run begins like this"
        logger.warning("%s is compiled first, which takes %s; %s.", what, duration, kept)
