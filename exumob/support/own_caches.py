"""Folders for what Numba and matplotlib keep, where neither the package's folder nor the user's may be written.

Numba refuses to import a kernel that it is to keep and cannot (containers, clusters, read-only installations). Then it
gets a new folder in the system's temporary one, whose name is drawn at random and which only this user may enter; the
process that made it deletes it when it ends, and processes that it starts share it. Importing this module does so,
before Numba reads its settings: `exumob` imports it first.
"""

from __future__ import annotations

import atexit
import os
import shutil
import sys
import tempfile
from pathlib import Path

from exumob.support.files import PACKAGE

NOT_KEPT = (
    "neither exumob's folder nor the home folder may be written, so nothing that is compiled is kept beyond this "
    "process; set NUMBA_CACHE_DIR to a folder of your own that may be written, and only the first run compiles"
)
"""What is said when a kernel is compiled into such a folder."""

temporary: Path | None = None
"""The folder made for this process; None if there was no need."""


def writable(folder: Path) -> bool:
    """Tell if files can be made in a folder, or the folder can be made, as far as the permissions say."""
    for place in (folder, *folder.parents):
        try:
            if place.is_dir():
                return os.access(place, os.W_OK | os.X_OK)
            if place.exists():
                return False
        except OSError:
            return False
    return False


def kernels_can_be_kept() -> bool:
    """Tell if Numba finds a place for compiled kernels by itself."""
    given = os.environ.get("NUMBA_CACHE_DIR")
    if given and writable(Path(given)):
        return True
    folders = {file.parent for file in PACKAGE.glob("*/*.py")}
    return all(writable(folder / "__pycache__") for folder in folders) or writable(_user_cache() / "numba")


def provide() -> None:
    """Make a temporary folder for Numba, and matplotlib's settings and fonts, if they find no place by themselves."""
    global temporary
    if temporary is not None or kernels_can_be_kept():
        return
    temporary = Path(tempfile.mkdtemp(prefix="exumob-cache-"))  # of a random name, and for this user alone
    atexit.register(_delete, temporary, os.getpid())
    os.environ["NUMBA_CACHE_DIR"] = str(temporary / "numba")
    numba = sys.modules.get("numba")
    if numba is not None:  # it has read its settings already
        numba.config.CACHE_DIR = os.environ["NUMBA_CACHE_DIR"]
    home = os.environ.get("XDG_CONFIG_HOME")
    if "MPLCONFIGDIR" not in os.environ and not writable(
        (Path(home) if home else Path("~").expanduser() / ".config") / "matplotlib"
    ):
        (temporary / "matplotlib").mkdir()
        os.environ["MPLCONFIGDIR"] = str(temporary / "matplotlib")


def _user_cache() -> Path:
    """The user's folder for caches, as Numba finds it."""
    try:
        home = Path("~").expanduser()
    except RuntimeError:  # a user without a home
        return Path(os.devnull)
    if sys.platform == "darwin":
        return home / "Library" / "Caches"
    if os.name == "nt":
        return Path(os.environ.get("LOCALAPPDATA") or home)
    return Path(os.environ.get("XDG_CACHE_HOME") or home / ".cache")


def _delete(folder: Path, maker: int) -> None:
    """Delete the folder, in the process that made it and not in a fork of it."""
    if os.getpid() == maker:
        shutil.rmtree(folder, ignore_errors=True)


provide()
