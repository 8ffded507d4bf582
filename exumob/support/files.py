"""Places of the package's own files, and the writing of files whole or not at all."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

PACKAGE = Path(__file__).parents[1]
"""The folder `exumob` of this installation."""


@contextmanager
def atomic_write(file: str | Path) -> Iterator[Path]:
    """Give a temporary path to write to, which replaces `file` when the block ends without an error.

    A reader sees the old content or the new one, never a part of it, even if the process is killed or the machine
    loses power: the temporary file lies in the same folder, reaches the disk first and is then renamed. Its name holds
    the number of the process, so that processes that write the same file do not disturb each other. After an error
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
    temporary = path.with_name(f".{path.name}.{os.getpid()}.partial")
    try:
        yield temporary
        with temporary.open("r+b") as stream:  # open for writing: some systems flush no other
            os.fsync(stream.fileno())
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)
