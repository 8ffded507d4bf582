"""Results as netCDF files: written whole or not at all."""

from __future__ import annotations

import errno
import logging
import os
import shutil
import tempfile
from pathlib import Path

import xarray as xr

from exumob.support.files import atomic_write

logger = logging.getLogger(__name__)


def save_dataset(dataset: xr.Dataset, file: str | Path) -> Path:
    """Write netCDF under a temporary name, then rename: a killed run leaves no half file.

    If the disk is full or not writable, the file goes to a new folder in the system's temporary one instead, and a
    warning says so.

    Returns
    -------
    Path
        Where the file is.

    Raises
    ------
    OSError
        If neither place can be written.
    """
    path = Path(file)
    try:
        return _write(dataset, path)
    except OSError as error:
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
    packed = {name: {"zlib": True, "complevel": 4} for name, v in dataset.data_vars.items() if v.dtype.kind == "f"}
    data = dataset.to_netcdf(engine="h5netcdf", encoding=packed)  # in memory: HDF5 on a full disk takes Python down
    with atomic_write(path) as temporary:
        temporary.write_bytes(data)
    return path


def load_dataset(file: str | Path) -> xr.Dataset:
    """Read a result written by `save_dataset`, or any other netCDF 4 file, into memory.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If it is no netCDF 4 file, or damaged.
    """
    path = Path(file)
    if not path.exists():
        raise FileNotFoundError(f"{path} does not exist; give the file of a result (netCDF).")
    if path.is_dir():
        raise ValueError(f"{path} is a folder; give the file of a result (netCDF).")
    try:
        with xr.open_dataset(path, engine="h5netcdf") as dataset:
            return dataset.load()
    except MemoryError:
        raise
    except Exception as error:  # h5py and h5netcdf raise whatever they meet
        text = " ".join(str(error).split())[:200]
        raise ValueError(
            f"{path} cannot be read as netCDF ({type(error).__name__}: {text}): it is damaged, cut off, or of another "
            "kind. Take a copy, or make it again."
        ) from None
