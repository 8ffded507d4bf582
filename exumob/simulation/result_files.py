"""Results as netCDF files: written whole or not at all."""

from __future__ import annotations

import errno
import logging
import math
import os
import shutil
import tempfile
from pathlib import Path

import xarray as xr

from exumob.support.declared import checked
from exumob.support.files import NETCDF, atomic_write, read_netcdf, require_ending, sealed

logger = logging.getLogger(__name__)
CHUNK = 2**22
"""Size of what is compressed as one [B]. The library's own choice, a few kB of two or three components, makes the files
of a run a sixth larger."""


@checked
def save_dataset(dataset: xr.Dataset, file: str | Path, *, elsewhere: bool = True) -> Path:
    """Write netCDF under a temporary name, then rename: a killed run leaves no half file.

    If the disk is full or not writable, the file goes to a new folder in the system's temporary one instead, and a
    warning says so; not with `elsewhere` False, for what can be had again.

    Returns
    -------
    Path
        Where the file is.

    Raises
    ------
    ValueError
        If the file's ending is not .nc: other programs would take it for something else.
    OSError
        If neither place can be written.
    """
    path = Path(file)
    require_ending("save_dataset.file =", path, NETCDF)
    try:
        return _write(dataset, path)
    except OSError as error:
        if not elsewhere:
            raise
        fallback = Path(tempfile.mkdtemp(prefix="exumob-")) / path.name
        reason = os.strerror(error.errno) if error.errno else str(error)
        try:
            _write(dataset, fallback)
        except OSError:
            shutil.rmtree(fallback.parent)
            raise
        logger.warning("could not write %s (%s); the result was saved as %s instead", path, reason, fallback)
        return fallback


def _write(dataset: xr.Dataset, path: Path) -> Path:
    if not path.parent.is_dir():
        raise OSError(errno.ENOENT, f"folder {path.parent} does not exist")
    packed = {
        name: {"zlib": True, "complevel": 4, "shuffle": True, "chunksizes": _chunk(v.shape, v.dtype.itemsize)}
        for name, v in dataset.variables.items() if v.dtype.kind == "f" and v.size
    }  # fmt: skip
    data = dataset.to_netcdf(engine="h5netcdf", encoding=packed)  # in memory: HDF5 on a full disk takes Python down
    with atomic_write(path) as temporary:
        temporary.write_bytes(sealed(bytes(data)))
    return path


def _chunk(shape: tuple[int, ...], itemsize: int) -> tuple[int, ...] | None:
    """Return the shape of what is compressed as one: as many whole rows as `CHUNK` holds; none of a single number."""
    if not shape:
        return None
    row = itemsize * math.prod(shape[1:])
    return (min(shape[0], max(CHUNK // row, 1)), *shape[1:])


@checked
def load_dataset(file: str | Path) -> xr.Dataset:
    """Read a result written by `save_dataset`, or any other netCDF 4 file, into memory.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If it cannot be read, or is not what was written; see `exumob.support.files.read_netcdf`.
    """
    return read_netcdf(file)
