"""Captive runs that several cases and studies share: each is computed once and kept."""

from __future__ import annotations

import hashlib
import logging
import os
from dataclasses import replace
from pathlib import Path

import xarray as xr

from exumob.flow.grid import Grid
from exumob.flow.settings import FlowSettings
from exumob.flow.tread import Tread
from exumob.simulation.result_files import load_dataset, save_dataset
from exumob.support.files import PACKAGE
from exumob.support.provenance import parameters_json
from exumob.towing_tank.motion import CaptiveMotion
from exumob.towing_tank.run import captive_run
from exumob.vehicle.parameters import Vehicle
from exumob.water.conditions import Water

logger = logging.getLogger(__name__)

FOLDER = "EXUMOB_RUNS"
"""Environment variable: folder of finished runs as netCDF; unset: they are kept for this process only."""
PICTURES = ("pictures.py", "render.py", "vtk_files.py", "vehicle_surface.py")
_kept: dict[str, xr.Dataset] = {}


def flow_revision() -> str:
    """Digest of the flow solver's sources: a run of another solver is not taken for one of this."""
    folder = PACKAGE / "flow"
    digest = hashlib.sha256()
    for file in sorted(folder.glob("*.py")):
        if file.name not in PICTURES:
            digest.update(file.read_bytes())
    return digest.hexdigest()[:12]


def finished_run(
    vehicle: Vehicle,
    water: Water,
    motion: CaptiveMotion,
    *,
    cell_size: float,
    duration: float,
    interval: float = 1.0e-3,
    grid: Grid | None = None,
    settings: FlowSettings | None = None,
    snapshots: float | None = None,
    allow_coarse: bool = False,
    tread: Tread | None = None,
    label: str = "",
) -> xr.Dataset:
    """Give a captive run that has been made, or make it (`captive_run`) and keep it.

    The key is all parameters but the number of threads, and the solver's sources. With the environment variable
    `FOLDER` set, finished runs are netCDF files there: a campaign that was stopped goes on with the runs it lacks.

    Parameters
    ----------
    label : str
        For the log, which tells at every tenth of the run how far it is.
    """
    settings = FlowSettings() if settings is None else settings
    key = hashlib.sha256(
        parameters_json(
            {
                "vehicle": vehicle, "water": water, "motion": motion, "cell_size": cell_size, "duration": duration,
                "interval": interval, "grid": grid, "settings": replace(settings, threads=1), "snapshots": snapshots,
                "tread": tread, "flow": flow_revision(),
            }
        ).encode()
    ).hexdigest()[:16]  # fmt: skip
    if key in _kept:
        return _kept[key]
    folder = os.environ.get(FOLDER)
    file = Path(folder) / f"captive-{key}.nc" if folder else None
    if file is not None and file.exists():
        logger.info("%s: taken from %s", label, file)
        _kept[key] = load_dataset(file)
        return _kept[key]
    tenth = [0]

    def progress(time: float) -> None:
        if (reached := int(10.0 * time / duration + 1e-9)) > tenth[0]:
            tenth[0] = reached
            logger.info("%s: %.2f of %.2f s", label, time, duration)

    run = captive_run(
        vehicle, water, motion, cell_size=cell_size, duration=duration, interval=interval, grid=grid,
        settings=settings, snapshots=snapshots, allow_coarse=allow_coarse, progress=progress, tread=tread,
    )  # fmt: skip
    if file is not None:
        file.parent.mkdir(parents=True, exist_ok=True)
        save_dataset(run, file)
    _kept[key] = run
    return run
