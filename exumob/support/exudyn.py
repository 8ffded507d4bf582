"""Exudyn as this package uses it: the fast build, no settings from the home folder, no announcement on import."""

import contextlib
import io
import os
import sys
import weakref
from collections.abc import Callable
from typing import Any

os.environ.setdefault("EXUDYN_NO_USER_SETTINGS", "1")  # a file in the home folder must not change results
if "exudyn" not in sys.modules:
    sys.exudynFast = True  # type: ignore[attr-defined]
with contextlib.redirect_stdout(io.StringIO()):
    import exudyn as exu

__all__ = ["exu", "held_weakly"]


def held_weakly(method: Any) -> Callable[..., Any]:
    """Return a function that calls a method of an object without keeping the object alive.

    A system of Exudyn holds its user functions out of sight of Python's collector: a method of the system's owner would
    keep both, and all that they recorded, until the process ends.

    Parameters
    ----------
    method : method
        Its object lives at least as long as it is called.
    """
    owner, function = weakref.ref(method.__self__), method.__func__

    def call(*arguments: Any) -> Any:
        return function(owner(), *arguments)

    return call
