"""Captive runs that several cases and studies share: each is computed once and kept."""

from __future__ import annotations

import hashlib
import inspect
import logging
import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from exumob.flow import FlowSettings
from exumob.flow.revision import solver_revision
from exumob.simulation.result_files import load_dataset, save_dataset
from exumob.support.arrays import Array
from exumob.support.files import PACKAGE
from exumob.support.provenance import parameters_json
from exumob.towing_tank.motion import CaptiveMotion
from exumob.towing_tank.run import captive_run
from exumob.vehicle.parameters import Vehicle
from exumob.water.conditions import Water

logger = logging.getLogger(__name__)

FOLDER = "EXUMOB_RUNS"
"""Environment variable: folder of finished runs as netCDF; unset: they are kept for this process only."""
DEPTH = 0.12
"""Depth of the water in the vehicle's cases [m]: 60 % of the wheels' diameter (D60)."""
DEFAULTS = {
    name: parameter.default
    for name, parameter in inspect.signature(captive_run).parameters.items()
    if parameter.default is not parameter.empty and name not in ("motion", "on_snapshot", "progress", "allow_coarse")
}
"""Options of `captive_run` on which its numbers depend."""
_kept: dict[str, xr.Dataset] = {}


def paper_vehicle() -> Vehicle:
    """Return the vehicle of ``vehicle_models/amphibious.py``."""
    from vehicle_models.amphibious import amphibious_vehicle

    return amphibious_vehicle()


def flow_revision() -> str:
    """Digest of all sources that a captive run depends on: a run of another solver is not taken for one of this.

    These are the folders of the flow solver and of the towing tank; what only draws or writes a flow is left out.
    """
    return solver_revision("towing_tank", package=PACKAGE)


def finished_run(
    vehicle: Vehicle, water: Water, motion: CaptiveMotion, *, label: str = "", **options: Any
) -> xr.Dataset:
    """Give a captive run that has been made, or make it (`captive_run`) and keep it.

    The key is all parameters but the number of threads, and the solver's sources. With the environment variable
    `FOLDER` set, finished runs are netCDF files there: a campaign that was stopped goes on with the runs it lacks.

    Parameters
    ----------
    vehicle, water, motion
        See `captive_run`.
    label : str
        Name of the run in the log, which says at every tenth of the run how far it is.
    options
        Further options of `captive_run`: cell_size, duration, interval and so on.
    """
    options["settings"] = options.get("settings") or FlowSettings()
    asked = {name: options.get(name, default) for name, default in DEFAULTS.items()}
    asked["settings"] = replace(asked["settings"], threads=1)
    text = parameters_json({"vehicle": vehicle, "water": water, "motion": motion, "flow": flow_revision()} | asked)
    key = hashlib.sha256(text.encode()).hexdigest()[:16]
    if key in _kept:
        return _kept[key]
    folder = os.environ.get(FOLDER)
    file = Path(folder) / f"captive-{key}.nc" if folder else None
    if file is not None and file.exists():
        logger.info("%s: taken from %s", label, file)
        _kept[key] = load_dataset(file)
        return _kept[key]
    progress = _log_of_tenths(label, asked["duration"])
    run = captive_run(vehicle, water, motion, progress=progress, **options)
    _kept[key] = run
    if file is not None:
        try:
            file.parent.mkdir(parents=True, exist_ok=True)
            save_dataset(run, file, elsewhere=False)
        except OSError as error:  # it must not cost the run
            reason = os.strerror(error.errno) if error.errno else str(error)
            logger.warning("%s: %s could not be written (%s); make room there, or the next call computes it again.",
                           label, file, reason)  # fmt: skip
    return run


def _log_of_tenths(label: str, duration: float) -> Callable[[float], None]:
    reached = 0

    def progress(time: float) -> None:
        nonlocal reached
        if (tenth := int(10.0 * time / duration + 1e-9)) > reached:
            reached = tenth
            logger.info("%s: %.2f of %.2f s", label, time, duration)

    return progress


def loads_after(run: xr.Dataset, start: float, smooth: bool = True) -> Array:
    """Loads of the five bodies after `start` [s]: force [N], moment [N m], shape (n, 5, 6)."""
    end = "_smooth" if smooth else ""
    late = run.sel(time=slice(start, None))
    return np.concatenate([late[f"force{end}"].values, late[f"moment{end}"].values], axis=2)


def second_half(run: xr.Dataset) -> Array:
    """Mean loads over the second half of a run, shape (5, 6)."""
    return np.asarray(loads_after(run, 0.5 * float(run["time"][-1]), smooth=False).mean(axis=0))
