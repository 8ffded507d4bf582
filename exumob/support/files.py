"""Places of the package's own files, the writing of files whole or not at all, and the reading of netCDF."""

from __future__ import annotations

import contextlib
import errno
import hashlib
import os
import secrets
import stat
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import xarray as xr

PACKAGE = Path(__file__).parents[1]
"""The folder `exumob` of this installation."""
NETCDF = (".nc",)
"""Endings of netCDF files."""
FIGURES = (".png", ".pdf", ".svg")
"""Endings of figures."""
ANIMATIONS = (".gif", ".mp4")
"""Endings of animations."""
CHECKPOINTS = (".npz",)
"""Endings of checkpoints."""
FILES = (*NETCDF, *FIGURES, *ANIMATIONS, *CHECKPOINTS, ".toml", ".json", ".csv", ".txt", ".py", ".log", ".zip", ".onnx")
"""Endings of files that nobody means for a folder."""
SEAL = b"\nexumob sha256 "
"""Begin of the last line of a sealed file; the digest of all bytes before it follows, in hexadecimal digits."""
SEAL_LENGTH = len(SEAL) + 64
"""Length of that line [bytes]."""


@contextmanager
def atomic_write(file: str | Path) -> Iterator[Path]:
    """Give a temporary path to write to, which replaces `file` when the block ends without an error.

    A reader sees the old content or the new one, never a part of it, even if the process is killed or the machine
    loses power: the temporary file lies in the same folder, reaches the disk first and is then renamed. It is new, and
    its name, ``.NAME.RANDOM.partial``, is drawn at random: nobody can put a link in its place beforehand, and processes
    that write the same file do not disturb each other. After an error `file` is as it was, and the temporary file is
    gone; only a process that is killed leaves one behind, which may be deleted.

    Parameters
    ----------
    file : str or Path
        The file wanted; its folder must exist.

    Yields
    ------
    Path
        The path that the block must write to; an empty file is there already.

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
    temporary = path.with_name(f".{path.name[:40]}.{secrets.token_hex(8)}.partial")
    flags = os.O_CREAT | os.O_EXCL | os.O_WRONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_CLOEXEC", 0)
    try:
        os.close(os.open(temporary, flags, 0o666))  # less what the umask takes away
    except FileNotFoundError:
        raise FileNotFoundError(errno.ENOENT, "the folder does not exist; create it first", str(path)) from None
    try:
        yield temporary
        with temporary.open("r+b") as stream:  # open for writing: some systems flush no other
            if os.fstat(stream.fileno()).st_size == 0:
                raise FileNotFoundError(errno.ENODATA, "nothing was written", str(path))
            os.fsync(stream.fileno())
        temporary.replace(path)
    finally:
        with contextlib.suppress(OSError):  # it must not hide the first error
            temporary.unlink(missing_ok=True)


def write_text(file: str | Path, text: str) -> None:
    """Write a text as UTF-8, whole or not at all.

    Raises
    ------
    OSError
        As `atomic_write`.
    """
    with atomic_write(file) as temporary:
        temporary.write_text(text, encoding="utf-8")


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
        If its folder does not exist, cannot be written or is full, its name is too long, or there is something else
        than a file by that name (a folder, a device).
    """
    path = Path(file)
    try:
        mode = path.stat().st_mode
    except FileNotFoundError:
        mode = stat.S_IFREG
    except OSError as error:  # a name that is too long, a file in place of the folder, a circle of links
        raise ValueError(f"{path} cannot be written: {error.strerror or error}; give another name.") from None
    if not path.parent.is_dir():
        raise ValueError(f"{path} cannot be written: the folder {path.parent} does not exist; create it first.")
    if stat.S_ISDIR(mode):
        raise ValueError(f"{path} cannot be written: this is a folder; give a file name.")
    if not stat.S_ISREG(mode):
        raise ValueError(f"{path} cannot be written: it is a device, and no file; give another name.")
    try:
        probe_folder(path.parent, size)
    except OSError as error:
        raise ValueError(
            f"{path} cannot be written: {error.strerror or error}; give a folder with room in which you may write."
        ) from None


def why_no_file(file: str | Path) -> str:
    """Say why there is no file of this name: "is a folder", or "does not exist"."""
    return "is a folder" if Path(file).is_dir() else "does not exist"


def probe_folder(folder: Path, size: int = 1 << 16) -> None:
    """Write so many bytes to the disk of a folder, and remove them.

    Raises
    ------
    OSError
        If it cannot be written, or is full.
    """
    with tempfile.TemporaryFile(dir=folder) as stream:
        stream.write(bytes(size))
        stream.flush()
        os.fsync(stream.fileno())


def require_folder_name(name: str, folder: str | Path) -> None:
    """Refuse the name of a folder that says that it is a file; a folder that is there already may have any.

    Parameters
    ----------
    name : str
        What names the folder, for the message: an argument or an option.
    folder : str or Path

    Raises
    ------
    ValueError
        Naming folder, ending and remedy.
    """
    path = Path(folder)
    if path.suffix.lower() in FILES and not path.is_dir():
        raise ValueError(
            f"{name} {path}: this is to be a folder, and {path.suffix} is the ending of a file; leave the ending out."
        )


def require_possible_folder(name: str, folder: str | Path) -> None:
    """Refuse a folder that cannot be made, or not written, without making it.

    Parameters
    ----------
    name, folder
        As in `require_folder_name`.

    Raises
    ------
    ValueError
        As there; if it is a file or below one, or may not be written.
    """
    require_folder_name(name, folder)
    path = Path(folder)
    there = next(place for place in (path, *path.absolute().parents) if place.exists())
    try:
        probe_folder(there, 1)
    except OSError as error:
        raise ValueError(
            f"{name} {path}: the folder cannot be made or written ({error.strerror or error}); give one in which you "
            "may write."
        ) from None


def require_ending(name: str, file: str | Path, endings: Sequence[str]) -> None:
    """Refuse the name of a file whose ending does not say what will be in it.

    Parameters
    ----------
    name : str
        What names the file, for the message: an argument or an option.
    file : str or Path
    endings : sequence of str
        Those that fit, such as ``".nc"``.

    Raises
    ------
    ValueError
        Naming file and endings.
    """
    path = Path(file)
    if path.suffix not in endings:
        known = ", ".join(endings[:-1]) + (" or " if endings[:-1] else "") + endings[-1]
        what = f"the ending {path.suffix!r} does not fit" if path.suffix else "the name has no ending"
        raise ValueError(f"{name} {path}: {what}; use {known}.")


# -- netCDF ------------------------------------------------------------------------------------------------------------


def sealed(data: bytes) -> bytes:
    """Return the content of a file with its seal: a last line that holds the digest of what precedes it.

    The readers of HDF5 and netCDF do not look beyond the end that the file itself states, and so do not see the line.
    """
    return data + SEAL + hashlib.sha256(data).hexdigest().encode()


def read_netcdf(file: str | Path, needed: Iterable[str] = (), *, decode_times: bool = True) -> xr.Dataset:
    """Read a netCDF-4 file into memory: the one reader for all of exumob.

    Parameters
    ----------
    file : path
    needed : iterable of str
        Names of variables, coordinates or attributes that the file must hold.
    decode_times : bool
        Whether variables with a unit such as "days since 2000-01-01" become dates.

    Returns
    -------
    xarray.Dataset

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If it is not a netCDF-4 file, is cut off, was damaged since it was written, or lacks what is needed; the message
        names the file.
    OSError
        If the file may not be read.
    """
    import h5py
    import xarray as xr

    path = Path(file)
    if path.is_dir():
        raise ValueError(f"{path} is a folder; give a netCDF file (.nc).")
    if not path.exists():
        raise FileNotFoundError(f"{path} does not exist; give the name of a netCDF file (.nc).")
    _check_seal(path)
    try:
        with h5py.File(path, "r"):  # a file that h5netcdf cannot open makes it complain when it is deleted
            pass
        with xr.open_dataset(path, engine="h5netcdf", decode_times=decode_times) as opened:
            found = opened.load()
    except PermissionError:
        raise
    except Exception as error:  # h5py, h5netcdf and xarray raise a dozen kinds, for whatever is wrong inside
        what = str(error).strip().splitlines() or [type(error).__name__]
        raise ValueError(
            f"{path} cannot be read as netCDF-4 ({type(error).__name__}: {what[0][:200]}); it is cut off, damaged or "
            "of another kind. Use a whole copy, or make it anew."
        ) from None
    missing = [name for name in needed if name not in found.variables and name not in found.attrs]
    if missing:
        raise ValueError(
            f"{path} holds no {', no '.join(missing)}; it is not the file that is needed here, or was written by "
            "another program. Look at its name."
        )
    return found


def _check_seal(path: Path) -> None:
    """Raise ValueError if a file is not what was sealed; files without a seal pass."""
    with path.open("rb") as stream:
        stream.seek(0, os.SEEK_END)
        length = stream.tell() - SEAL_LENGTH
        if length < 0:
            return
        stream.seek(length)
        line = stream.read()
        if not line.startswith(SEAL):
            return
        stream.seek(0)
        digest = hashlib.sha256()
        while length > 0 and (part := stream.read(min(length, 1 << 20))):
            digest.update(part)
            length -= len(part)
    if digest.hexdigest().encode() != line[len(SEAL) :]:
        raise ValueError(
            f"{path} is damaged, or was edited in place: it is not what was written (the checksum in its last line "
            "differs). Use a whole copy, or make it anew; what was edited on purpose must be written anew with xarray."
        )
