"""Exudyn as this package uses it: the fast build, no settings from the home folder, no announcement on import."""

import contextlib
import io
import os
import sys

os.environ.setdefault("EXUDYN_NO_USER_SETTINGS", "1")  # a file in the home folder must not change results
if "exudyn" not in sys.modules:
    sys.exudynFast = True  # type: ignore[attr-defined]
with contextlib.redirect_stdout(io.StringIO()):
    import exudyn as exu

__all__ = ["exu"]
