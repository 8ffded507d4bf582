"""Compiled kernels: say once, before a long silence, that they have yet to be compiled."""

from __future__ import annotations

import inspect
import logging
from collections.abc import Callable
from pathlib import Path
from typing import Any

from exumob.support.caches import VARIABLE, is_private

logger = logging.getLogger(__name__)

_said: set[str] = set()


def is_compiled(kernel: Callable[..., Any]) -> bool:
    """Return whether a kernel of Numba is compiled in this process, or kept on the disk newer than its source."""
    if not hasattr(kernel, "stats") or getattr(kernel, "signatures", None):
        return True  # plain Python (NUMBA_DISABLE_JIT), or compiled here
    folder = kernel.stats.cache_path
    if folder is None:
        return False
    function = kernel.py_func  # type: ignore[attr-defined]
    try:
        changed = Path(inspect.getfile(function)).stat().st_mtime
        kept = Path(folder).glob(f"{Path(inspect.getfile(function)).stem}.{function.__qualname__}-*.nbi")
        return any(file.stat().st_mtime >= changed for file in kept)
    except OSError:
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
        if is_private():
            kept = f"set {VARIABLE} to a folder that you may write, or every run begins like this"
        logger.warning("%s is compiled first, which takes %s; %s.", what, duration, kept)
