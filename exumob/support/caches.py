"""Where compiled kernels are kept when neither the installation nor the user's home can be written."""

from __future__ import annotations

import atexit
import os
import sys
from pathlib import Path

VARIABLE = "NUMBA_CACHE_DIR"
PACKAGE = Path(__file__).parents[1]  # as in `exumob.support.files`, which imports more


def provide_cache() -> None:
    """Give Numba a private folder for this process and those that it starts, if it would find none.

    Numba keeps compiled kernels beside the sources, or else in the user's cache, and refuses to work without a place:
    containers and clusters often have neither. The folder is made anew, for this user alone, and removed at the end;
    set ``NUMBA_CACHE_DIR`` to keep the kernels from run to run.
    """
    given = os.environ.get(VARIABLE)
    if (given and _writable(Path(given))) or _sources_writable() or _home_writable():
        return
    import shutil
    import tempfile  # seldom needed, and slow to import

    folder = tempfile.mkdtemp(prefix="exumob-kernels-")  # mode 0700
    os.environ[VARIABLE] = folder
    numba = sys.modules.get("numba")
    if numba is not None:  # it has read its settings already
        numba.config.CACHE_DIR = folder
    settings = os.environ.get("XDG_CONFIG_HOME") or os.path.expanduser("~/.config")
    if "MPLCONFIGDIR" not in os.environ and not (os.path.isabs(settings) and _writable(Path(settings) / "matplotlib")):
        os.environ["MPLCONFIGDIR"] = tempfile.mkdtemp(dir=folder)  # matplotlib would warn at each start
    owner = os.getpid()

    def remove() -> None:
        if os.getpid() == owner:
            shutil.rmtree(folder, ignore_errors=True)

    atexit.register(remove)


def is_private() -> bool:
    """Tell if kernels compiled now are lost at the end."""
    return Path(os.environ.get(VARIABLE, "")).name.startswith("exumob-kernels-")


def _sources_writable() -> bool:
    folders = {file.parent for file in PACKAGE.rglob("*.py")}
    return all(_writable(folder / "__pycache__") for folder in folders)


def _home_writable() -> bool:
    cache = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    return os.path.isabs(cache) and _writable(Path(cache) / "numba")


def _writable(folder: Path) -> bool:
    """Tell if a folder can be written, or made."""
    for place in (folder, *folder.parents):
        try:
            if place.exists():
                return place.is_dir() and os.access(place, os.W_OK | os.X_OK)
        except OSError:  # within a folder that may not be entered
            return False
    return False
