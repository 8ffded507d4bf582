"""Places of the package's own files, and the writing of files whole or not at all."""

from __future__ import annotations

import errno
import os
import secrets
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

PACKAGE = Path(__file__).parents[1]
"""The folder `exumob` of this installation."""


@contextmanager
def atomic_write(file: str | Path) -> Iterator[Path]:
    """Give a temporary path to write to, which replaces `file` when the block ends without an error.

    A reader sees the old content or the new one, never a part of it, even if the process is killed or the machine
    loses power: the temporary file lies in the same folder, reaches the disk first and is then renamed. Its name cannot
    be guessed and it is made anew, so that nobody can plant a link there; it ends in ``.partial``. After an error
    `file` is as it was, and the temporary file is gone.

    Parameters
    ----------
    file : str or Path
        The file wanted; its folder must exist.

    Yields
    ------
    Path
        The path that the block must write to.

    Raises
    ------
    OSError
        If the folder does not exist, cannot be written or is full, or if the block has written nothing.

    Examples
    --------
    >>> with atomic_write("table.json") as temporary:  # doctest: +SKIP
    ...     temporary.write_text(json.dumps(table))
    """
    path = Path(file)
    temporary = path.with_name(f".{path.name[:200]}.{secrets.token_hex(8)}.partial")
    flags = os.O_CREAT | os.O_EXCL | os.O_WRONLY | getattr(os, "O_NOFOLLOW", 0)
    os.close(os.open(temporary, flags, 0o666))  # less what the user's mask takes away
    try:
        yield temporary
        with temporary.open("r+b") as stream:  # open for writing: some systems flush no other
            if os.fstat(stream.fileno()).st_size == 0:
                raise OSError(errno.EIO, "nothing was written", str(path))
            os.fsync(stream.fileno())
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def require_writable(file: str | Path, size: int = 1 << 16) -> None:
    """Find out before a run that a file cannot be written during it or after it.

    Parameters
    ----------
    file : str or Path
        The file wanted; it is left alone.
    size : int
        So many bytes are written beside it, and removed.

    Raises
    ------
    ValueError
        If its folder does not exist, cannot be written or is full.
    """
    path = Path(file)
    try:
        with tempfile.TemporaryFile(dir=path.parent) as stream:
            stream.write(bytes(size))
            stream.flush()
            os.fsync(stream.fileno())
    except OSError as error:
        raise ValueError(
            f"{path} cannot be written: {error.strerror or error}; give a folder with room in which you may write."
        ) from None
