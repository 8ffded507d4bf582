"""Runs to learn from: packed, loaded, and imported from anyone's CFD-MBD time histories.

A packed run holds, every millisecond, what moves and what the water does: positions, rotations and their rates, the
states of paper Eq. (7) and the wrenches on the five bodies, raw and smoothed. `VARIABLES` says what each is.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np
import xarray as xr

from exumob.results import load_dataset
from exumob.smoothing import WINDOW, smoothed, window_samples

SAMPLING = 1.0e-3
"""Interval of a packed run [s]."""
VARIABLES = (
    "position", "quaternion", "yaw", "pitch", "roll", "velocity", "angular_velocity", "acceleration",
    "angular_acceleration", "forward_velocity", "lateral_velocity", "wheel_speed", "steering_angle", "sinkage",
    "slip_ratio", "slip_angle", "soil_force", "suspension_stroke", "flow_state", "water_wrench",
)  # fmt: skip
"""Taken over from a run (`exumob.results.VARIABLES`)."""
SURFACE = ("hydrodynamics_elevation", "hydrodynamics_frame")
"""... and thinned out, if the run holds them."""
SURFACE_INTERVAL = 2.0
"""Between the free surfaces kept [s], as paper Fig. 9."""
EFFORT = ("coupling_iterations", "coupling_residual", "hydrodynamics_iterations", "hydrodynamics_halvings")
"""What a run with the flow in the loop says of its own making: mean and largest value are kept as attributes."""


def pack(run: xr.Dataset) -> xr.Dataset:
    """What of a run is kept in the data set, in single precision.

    Parameters
    ----------
    run : xarray.Dataset
        Of `exumob.simulate`, recorded every millisecond.

    Returns
    -------
    xarray.Dataset
        `VARIABLES`, ``water_wrench_smooth`` (centred moving average: no phase shift) and the surface at a few instants.

    Raises
    ------
    ValueError
        If the run is not complete or not recorded every millisecond.
    """
    status = run.attrs.get("status", "")
    if status != "completed":
        raise ValueError(f"pack: the run is not complete ({status or 'no status'}); finish it first.")
    _check_sampling(run["time"].values)
    packed = run[list(VARIABLES)]
    wrench = run["water_wrench"]
    packed["water_wrench_smooth"] = wrench.copy(data=smoothed(wrench.values, SAMPLING)).assign_attrs(
        long_name=f"{wrench.attrs['long_name']}, centred moving average over {1e3 * WINDOW:g} ms",
        samples=window_samples(SAMPLING),
    )
    surface = [name for name in SURFACE if name in run]
    if surface:
        kept = np.arange(0.0, float(run["time"][-1]) + 1e-6, SURFACE_INTERVAL)
        packed = packed.merge(run[surface].sel(snapshot=kept, method="nearest"))
    single = {name: v.astype(np.float32) for name, v in packed.data_vars.items() if v.dtype == np.float64}
    packed = packed.assign({name: v.assign_attrs(packed[name].attrs) for name, v in single.items()})
    effort: dict[str, float] = {}
    for name in EFFORT:
        if name in run:
            effort |= {f"{name}_mean": float(run[name].mean()), f"{name}_max": float(run[name].max())}
    return packed.assign_attrs(run.attrs | effort)


def load_runs(files: Iterable[str | Path]) -> dict[str, xr.Dataset]:
    """Packed runs by the name of their scenario."""
    runs = {}
    for file in files:
        run = load_dataset(file)
        _check_sampling(run["time"].values, str(file))
        runs[str(run.attrs.get("scenario", Path(file).stem))] = run
    return runs


def _check_sampling(time: np.ndarray, name: str = "the run") -> None:
    steps = np.diff(time)
    if len(steps) == 0 or np.abs(steps - SAMPLING).max() > 1e-6:
        found = f"{1e3 * steps.min():.4g} to {1e3 * steps.max():.4g} ms" if len(steps) else "a single sample"
        raise ValueError(
            f"{name} is not sampled every {1e3 * SAMPLING:g} ms ({found}); record it with simulate(record_step=1e-3)."
        )
