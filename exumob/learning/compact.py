"""Runs of a data set in a quarter of their size: rounded to what they are worth, without what follows from the rest.

Two repetitions of a run differ by a fifth of the loads' deviation, and its positions by millimetres. Motion is rounded
to micrometres and microradians, loads and accelerations to nine bits behind the leading one, 0.1 % (bit rounding:
Kloewer et al., Nature Comput. Sci. 1 (2021) 713). Angles, speeds along the heading, the states of Eq. (7) and smoothed
loads follow from the rest when a run is loaded (`exumob.learning.dataset.load_run`).
"""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

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


def _rounded(name: str, values: NDArray[Any]) -> NDArray[Any]:
    if name in GRAIN:
        return np.asarray(np.round(values.astype(np.float64) / GRAIN[name]) * GRAIN[name]).astype(values.dtype)
    share, exponent = np.frexp(values.astype(np.float64))  # share: 0.5 to 1
    return np.asarray(np.ldexp(np.round(np.ldexp(share, BITS + 1)), exponent - BITS - 1)).astype(values.dtype)
