"""Runs of a data set in a quarter of their size: rounded to what they are worth, without what follows from the rest.

Two repetitions of a run differ by a fifth of the loads' deviation, and its positions by millimetres. Motion is rounded
to micrometres and microradians, loads and accelerations to nine bits behind the leading one, 0.1 % (bit rounding:
Kloewer et al., Nature Comput. Sci. 1 (2021) 713). Angles, speeds along the heading, the states of Eq. (7) and smoothed
loads follow from the rest when a run is loaded (`exumob.learning.dataset.load_run`).

A run that only judges is thinned as well: motion and loads every 4 ms, which `filled` brings back to 1 ms.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

MARK = "compact"
"""Attribute of a compact run."""
DERIVED = ("yaw", "pitch", "roll", "forward_velocity", "lateral_velocity", "flow_state", "water_wrench_smooth")
"""Variables that follow from others."""
GRAIN = {
    "position": 2.0**-20, "hull_contact_center": 2.0**-20, "quaternion": 2.0**-20, "velocity": 2.0**-16,
    "angular_velocity": 2.0**-14, "steering_angle": 2.0**-20, "wheel_speed": 2.0**-13, "sinkage": 2.0**-22,
    "slip_ratio": 2.0**-14, "slip_angle": 2.0**-14, "suspension_stroke": 2.0**-22, "water_level": 2.0**-20,
    "water_depth": 2.0**-20, "hydrodynamics_elevation": 2.0**-13, "hydrodynamics_frame": 2.0**-20,
}  # fmt: skip
"""Steps to which variables are rounded, in their units; all others keep `BITS`."""
BITS = 9
"""Bits kept behind the leading one."""
THINNED, EVERY = "thinned", 4
"""Attribute of a thinned run: one sample is kept of so many."""
JUDGED = (
    "position", "quaternion", "velocity", "angular_velocity", "acceleration", "angular_acceleration", "wheel_speed",
    "steering_angle", "slip_ratio", "water_wrench",
)  # fmt: skip
"""Variables of a run that is compared with others, and from which nothing is learnt."""


def compact(run: xr.Dataset) -> xr.Dataset:
    """Round a packed run, and leave out what follows from the rest.

    Parameters
    ----------
    run : xarray.Dataset
        See `exumob.learning.dataset.pack`.
    """
    kept = run.drop_vars([name for name in DERIVED if name in run])
    rounded = {
        str(name): v.copy(data=_rounded(str(name), v.values)) for name, v in kept.data_vars.items()
        if v.dtype.kind == "f"
    }  # fmt: skip
    return kept.assign(rounded).assign_attrs({MARK: "rounded; angles, speeds, flow states, smoothed loads left out"})


def thinned(run: xr.Dataset) -> xr.Dataset:
    """Keep of a packed run what others are compared with, every 4 ms, rounded as by `compact`.

    Accelerations and loads are means over five samples, so that what lies between two kept ones is not lost.

    Parameters
    ----------
    run : xarray.Dataset
        See `exumob.learning.dataset.pack`.
    """
    kept = run[[name for name in JUDGED if name in run]]
    means = {
        name: kept[name].copy(data=uniform_filter1d(kept[name].values, EVERY + 1, axis=0, mode="nearest"))
        for name in ("acceleration", "angular_acceleration", "water_wrench")
    }  # fmt: skip
    return compact(kept.assign(means).isel(time=slice(None, None, EVERY))).assign_attrs({THINNED: EVERY})


def filled(run: xr.Dataset) -> xr.Dataset:
    """Return a thinned run with a sample every millisecond, by straight lines between those that were kept.

    Raises
    ------
    ValueError
        If the attribute that says how many samples were left out is not a whole number of at least 1.
    """
    time = run["time"].values
    try:
        every = int(run.attrs[THINNED])
    except (TypeError, ValueError):
        every = 0
    if every < 1:
        raise ValueError(
            f"the attribute {THINNED} is {str(run.attrs[THINNED])[:40]!r}, and must be a whole number of at least 1; "
            "use a whole copy of the file."
        )
    wanted = np.linspace(time[0], time[-1], every * (len(time) - 1) + 1)
    attrs = {name: text for name, text in run.attrs.items() if name != THINNED}
    found = run.interp(time=wanted, assume_sorted=True).astype({n: v.dtype for n, v in run.data_vars.items()})
    found["quaternion"] = found["quaternion"] / np.sqrt((found["quaternion"] ** 2).sum("quaternion_component"))
    return found.assign_attrs(attrs)


def _rounded(name: str, values: NDArray[Any]) -> NDArray[Any]:
    if name in GRAIN:
        return np.asarray(np.round(values.astype(np.float64) / GRAIN[name]) * GRAIN[name]).astype(values.dtype)
    share, exponent = np.frexp(values.astype(np.float64))  # share: 0.5 to 1
    return np.asarray(np.ldexp(np.round(np.ldexp(share, BITS + 1)), exponent - BITS - 1)).astype(values.dtype)
