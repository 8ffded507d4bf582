"""Runs to learn from: packed and loaded.

A packed run holds the motion and the water's loads at every millisecond: positions, rotations and their rates, the
states of paper Eq. (7) and the wrenches on the five bodies, raw and smoothed. `exumob.simulation.results.VARIABLES`
describes each variable.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from exumob.simulation.result_files import load_dataset
from exumob.support.arrays import Array
from exumob.support.smoothing import WINDOW, smoothed, window_samples
from exumob.surrogates.networks import Architecture
from exumob.vehicle.motion import HISTORY_STEP, BodyStates
from exumob.vehicle.parameters import Vehicle
from exumob.water.coefficients import CoefficientHydrodynamics
from exumob.water.conditions import Water

SAMPLING = HISTORY_STEP
"""Interval between the samples of a packed run [s]."""
VARIABLES = (
    "position", "quaternion", "yaw", "pitch", "roll", "velocity", "angular_velocity", "acceleration",
    "angular_acceleration", "forward_velocity", "lateral_velocity", "wheel_speed", "steering_angle", "sinkage",
    "slip_ratio", "slip_angle", "soil_force", "suspension_stroke", "flow_state", "water_wrench",
)  # fmt: skip
"""Variables of a run that are packed at every sample."""
SURFACE = ("hydrodynamics_elevation", "hydrodynamics_frame")
"""Variables of the free surface that are packed every `SURFACE_INTERVAL`, if the run holds them."""
SURFACE_INTERVAL = 2.0
"""Interval between the free surfaces kept [s], as in paper Fig. 9."""
EFFORT = ("coupling_iterations", "coupling_residual", "hydrodynamics_iterations", "hydrodynamics_halvings")
"""Effort of a run with the flow in the loop: mean and largest value of each are kept as attributes."""
NEEDED = (
    "time", "position", "quaternion", "velocity", "angular_velocity", "acceleration", "angular_acceleration",
    "water_wrench", "water_wrench_smooth",
)  # fmt: skip
"""Variables that a run to learn from must have."""
JUMP = 10.0
"""Limit beyond which raw loads count as a jump, see `usable` [-]."""
JUMP_REACH = 20
"""Number of instants left out on either side of a jump."""


def pack(run: xr.Dataset) -> xr.Dataset:
    """Select the part of a run that is kept in the data set, in single precision.

    Parameters
    ----------
    run : xarray.Dataset
        Result of `exumob.simulate`, recorded every millisecond.

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
    single = {
        name: v.astype(np.float32)
        for name, v in packed.data_vars.items()
        if v.dtype == np.float64 and name != "position"  # in map coordinates, single precision is half a metre
    }
    packed = packed.assign({name: v.assign_attrs(packed[name].attrs) for name, v in single.items()})
    effort: dict[str, float] = {}
    for name in EFFORT:
        if name in run:
            effort |= {f"{name}_mean": float(run[name].mean()), f"{name}_max": float(run[name].max())}
    return packed.assign_attrs(run.attrs | effort)


def load_runs(files: Iterable[str | Path]) -> dict[str, xr.Dataset]:
    """Load packed runs, by the name of their scenario.

    Raises
    ------
    ValueError
        If a file is not a run to learn from, is not sampled every millisecond, or repeats a scenario.
    """
    runs = {}
    for file in files:
        run = load_dataset(file)
        missing = [name for name in NEEDED if name not in run.variables]
        if missing or "parameters" not in run.attrs:
            raise ValueError(
                f"{file} is not a run to learn from ({', '.join(missing) or 'parameters'} missing); "
                "`exumob.learning.dataset.pack` and `exumob.learning.importing` make such files."
            )
        _check_sampling(run["time"].values, str(file))
        gaps = [name for name in NEEDED if run[name].dtype.kind == "f" and not np.isfinite(run[name].values).all()]
        if gaps:
            raise ValueError(
                f"{file}: {', '.join(gaps)} is not finite everywhere; leave this run out, or make it again."
            )
        name = str(run.attrs.get("scenario", Path(file).stem))
        if name in runs:
            raise ValueError(f"{file}: there is another run of {name} in the folder; keep one of them.")
        runs[name] = run
    return runs


def _check_sampling(time: np.ndarray, name: str = "the run") -> None:
    steps = np.diff(time)
    if len(steps) == 0 or np.abs(steps - SAMPLING).max() > 1e-6:
        found = f"{1e3 * steps.min():.4g} to {1e3 * steps.max():.4g} ms" if len(steps) else "a single sample"
        raise ValueError(
            f"{name} is not sampled every {1e3 * SAMPLING:g} ms ({found}); record it with simulate(record_step=1e-3)."
        )


def body_states(run: xr.Dataset) -> BodyStates:
    """Motion of the five bodies of a packed or imported run."""
    q = run["quaternion"].values.astype(float)
    rotation = Rotation.from_quat(q.reshape(-1, 4), scalar_first=True).as_matrix().reshape(*q.shape[:2], 3, 3)
    wheel_speed = run["wheel_speed"].values if "wheel_speed" in run else np.full((len(q), 4), np.nan)
    moved = (run[name].values.astype(float) for name in ("position", "velocity", "angular_velocity", "acceleration"))
    position, velocity, angular_velocity, acceleration = moved
    return BodyStates(
        run["time"].values.astype(float), position, rotation, velocity, angular_velocity, acceleration,
        run["angular_acceleration"].values.astype(float), wheel_speed.astype(float),
    )  # fmt: skip


def water_of(run: xr.Dataset) -> Water:
    """Water in which a run was made.

    Raises
    ------
    ValueError
        If it was made without water.
    """
    stored = json.loads(run.attrs["parameters"])["water"]
    if stored is None:
        raise ValueError(f"{run.attrs.get('scenario', 'the run')}: made without water; there is nothing to learn.")
    return Water(**next(iter(stored.values())))


def windows(inputs: NDArray[Any], rows: NDArray[np.intp], architecture: Architecture) -> NDArray[Any]:
    """Windows of inputs as a network sees them.

    Parameters
    ----------
    inputs : array, shape (n, ...)
        Inputs at every millisecond of a run.
    rows : array of int, shape (m,)
        Instants at which the windows end; before the beginning of the run its first instant is repeated.
    architecture : Architecture

    Returns
    -------
    array, shape (m, taps, ...)
        Oldest first.
    """
    back = architecture.stride * np.arange(architecture.taps - 1, -1, -1)
    return inputs[np.maximum(rows[:, None] - back, 0)]


def usable(run: xr.Dataset) -> NDArray[np.bool_]:
    """Mark the instants whose loads are the water's, which those near a jump of the coupling are not.

    At a jump the raw loads of some body differ from the smoothed ones by more than `JUMP` times the difference that
    99 % of the instants stay below, and by 1 N or N m at least.

    Returns
    -------
    array of bool, shape (n,)
        False near a jump.
    """
    off = np.abs(run["water_wrench"].values - run["water_wrench_smooth"].values)
    limit = np.maximum(JUMP * np.quantile(off, 0.99, axis=0), 1.0)
    jumps = np.flatnonzero((off > limit).any(axis=(1, 2)))
    good = np.ones(len(off), bool)
    for jump in jumps:
        good[max(jump - JUMP_REACH, 0) : jump + JUMP_REACH + 1] = False
    return good


def base_loads(run: xr.Dataset, vehicle: Vehicle) -> Array:
    """Loads of the coefficient model along a run [N, N m], as in the loop with macro steps of 1 ms; shape (n, 5, 6)."""
    model, states = CoefficientHydrodynamics(), body_states(run)
    model.start(vehicle, water_of(run), SAMPLING)

    def never() -> BodyStates:
        raise AssertionError("the coefficient model needs no prediction")

    return np.stack([model.wrenches(states[max(n - 1, 0) : n + 1], never) for n in range(len(states))])
