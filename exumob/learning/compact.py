"""Runs of a data set in a tenth of their size: rounded to what they are worth, without what follows from the rest.

Two repetitions of a run differ by a fifth of the loads' deviation, and its positions by millimetres. Motion is rounded
to micrometres and microradians, loads and accelerations to nine bits behind the leading one, 0.1 % (bit rounding:
Kloewer et al., Nature Comput. Sci. 1 (2021) 713). Angles, speeds along the heading, the states of Eq. (7) and smoothed
loads follow from the rest when a run is loaded (`exumob.learning.dataset.load_run`).

Of the samples, too, one in four is enough (`thinned`); `filled` brings them back to 1 ms. Networks that learn from
thinned runs are as good: of five seeds, each on the run that it had kept back, the loads' error over their deviation is
0.331 in the mean, and 0.333 of networks that learnt from every sample.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from exumob.support.arrays import Array

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
"""Attribute of a thinned run: one sample is kept of so many; how many in the data set."""
DRIVEN = (
    "position", "quaternion", "velocity", "angular_velocity", "acceleration", "angular_acceleration", "wheel_speed",
    "steering_angle", "slip_ratio", "water_wrench",
)  # fmt: skip
"""Variables of a run that teach networks, and by which it is compared with others."""
AVERAGED = ("acceleration", "angular_acceleration", "water_wrench", "soil_force", "hull_soil_force")
"""Variables of which a thinned run keeps means over five samples (`every`, or one more), so that what lies between two
kept ones is not lost."""
JUMPS, NONE = "jumps", "none"
"""Attribute of a thinned run: times of the jumps of its loads (`jumps`), which cannot be seen in it any more [s]; and
its text where there are none."""
JUMP = 10.0
"""Limit beyond which raw loads count as a jump, see `jumps` [-]."""


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


def thinned(run: xr.Dataset, variables: Collection[str] | None = DRIVEN, every: int = EVERY) -> xr.Dataset:
    """Keep of a packed run one sample of several, rounded as by `compact`.

    Parameters
    ----------
    run : xarray.Dataset
        See `exumob.learning.dataset.pack`.
    variables : collection of str, optional
        Those that are kept; None: all.
    every : int
        Number of samples of which one is kept; more for a larger vehicle, whose motion is slower.

    Raises
    ------
    ValueError
        If it is less than 1, or the last sample would be left out (the usual 4 leave out at most 3 ms).
    """
    if every < 1 or (every != EVERY and (run.sizes["time"] - 1) % every):
        raise ValueError(
            f"thinned.every = {every} leaves out the last of {run.sizes['time']} samples; give a divisor of "
            f"{run.sizes['time'] - 1}."
        )
    found = jumps(run)
    kept = run if variables is None else run[[name for name in variables if name in run]]
    means = {
        name: kept[name].copy(data=uniform_filter1d(kept[name].values, 2 * (every // 2) + 1, axis=0, mode="nearest"))
        for name in AVERAGED if name in kept
    }  # fmt: skip
    said = " ".join(f"{time:.3f}" for time in found) or NONE
    few = compact(kept.assign(means).isel(time=slice(None, None, every)))
    return few.assign_attrs({THINNED: every, JUMPS: said})


def jumps(run: xr.Dataset) -> Array:
    """Find the instants at which the loads jump with the coupling [s].

    The raw loads of some body differ there from the smoothed ones by more than `JUMP` times the difference that 99 % of
    the instants stay below, and by 1 N or N m at least. A thinned run says where that was.

    Raises
    ------
    ValueError
        If a thinned run does not say it in numbers.
    """
    if JUMPS in run.attrs:
        try:
            return np.array([float(time) for time in str(run.attrs[JUMPS]).split() if time != NONE])
        except ValueError:
            raise ValueError(
                f"the attribute {JUMPS} is {str(run.attrs[JUMPS])[:40]!r}, and must be times in seconds; use a whole "
                "copy of the file."
            ) from None
    off = np.abs(run["water_wrench"].values - run["water_wrench_smooth"].values)
    limit = np.maximum(JUMP * np.quantile(off, 0.99, axis=0), 1.0)
    return np.asarray(run["time"].values[(off > limit).any(axis=(1, 2))], dtype=float)


def filled(run: xr.Dataset) -> xr.Dataset:
    """Return a thinned run with a sample every millisecond, by straight lines between those that were kept.

    Raises
    ------
    ValueError
        If the attribute that says how many samples were left out is not a whole number of at least 1, or that with the
        jumps holds no times.
    """
    time = run["time"].values
    if JUMPS in run.attrs:
        jumps(run)
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
