"""Can the vehicle cross? A verdict on one run, as a planner needs it: go or no go, speed, drift and kind of failure."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
import xarray as xr

from exumob.support.checks import require_positive, require_within
from exumob.support.constants import GRAVITY
from exumob.support.errors import SimulationError
from exumob.sweeps.experiment import Experiment

FAILURES = ("none", "sunk", "afloat", "swept away", "tipped", "stuck", "too slow", "pushed aside", "broke down")
"""Kinds of failure, worst first; of several that apply the first is named."""


@dataclass(frozen=True)
class Limits:
    """Limits of a crossing: a ford of a width, in a time, within the lane, upright and on the wheels."""

    width: float = 12.0
    """Width of the water, along the first heading [m]"""
    time: float = 20.0
    """Time in which it must be crossed at the speed reached [s]"""
    drift: float = 1.0
    """Largest displacement to either side over the width [m]"""
    tilt: float = math.radians(30.0)
    """Largest roll or pitch at any time [rad]"""
    wheel_load: float = 0.05
    """Least share of the weight on the wheels; below it the vehicle is afloat [-]"""
    stuck_speed: float = 0.05
    """Speed below which the vehicle is stuck [m/s]"""
    window: float = 2.0
    """End of the run over which speed, course, slip and loads are averaged [s]"""
    range_share: float = 0.5
    """Share of the window outside the networks' training range beyond which their answer does not count [-]"""

    def __post_init__(self) -> None:
        require_positive(
            "Limits", width=self.width, time=self.time, drift=self.drift, tilt=self.tilt, window=self.window
        )
        require_within("Limits", 0.0, 1.0, wheel_load=self.wheel_load, range_share=self.range_share)
        require_within("Limits", 0.0, self.speed, "a stuck vehicle cannot have crossed.", stuck_speed=self.stuck_speed)

    @property
    def speed(self) -> float:
        """Least speed ahead [m/s]."""
        return self.width / self.time


def judge(run: xr.Dataset, limits: Limits) -> dict[str, float]:
    """Judge a run, made with any model of the water's loads.

    Parameters
    ----------
    run : xarray.Dataset
        Result of `exumob.simulate`, or packed (`exumob.learning.dataset`); longer than `limits.window`.
    limits : Limits

    Returns
    -------
    dict
        ``crossed``: 1 or 0; ``failure``: index of `FAILURES`; ``speed`` ahead along the first heading [m/s]; ``drift``
        to the left over the width [m]; mean ``slip`` ratio [-]; ``power`` at the wheels [W] (nan for packed runs);
        ``wheel_load``: share of the weight on the wheels [-]; ``tilt``: largest roll or pitch [rad]; ``out_of_range``:
        share of the window outside the training range [-] (0 without networks).

    Raises
    ------
    ValueError
        If the run is shorter than the window.
    """
    end = float(run["time"][-1])
    if end < limits.window:
        raise ValueError(f"judge: the run ends at {end:g} s; it must be longer than Limits.window = {limits.window} s.")
    late = run.sel(time=slice(end - limits.window, None))
    hull = late["position"].sel(body="hull").values
    span = float(late["time"][-1] - late["time"][0])
    speed = float(hull[-1, 0] - hull[0, 0]) / span
    sideways = float(hull[-1, 1] - hull[0, 1]) / span
    drift = sideways / speed * limits.width if speed > limits.stuck_speed else math.copysign(math.inf, sideways)
    weight = float(_weight(run))
    found = {
        "speed": speed,
        "drift": drift,
        "slip": float(late["slip_ratio"].mean()),
        "power": float(late["spin_power"].sum("wheel").mean()) if "spin_power" in late else math.nan,
        "wheel_load": float(late["soil_force"].sel(axis="z").sum("wheel").mean()) / weight,
        "tilt": float(max(np.abs(run[name].sel(body="hull")).max() for name in ("roll", "pitch"))),
        "out_of_range": _out_of_range(run, end - limits.window),
    }
    failure = "none"
    if found["tilt"] > limits.tilt:
        failure = "tipped"
    elif found["wheel_load"] < limits.wheel_load:
        failure = "afloat"
    elif speed < limits.stuck_speed:
        failure = "stuck"
    elif speed < limits.speed:
        failure = "too slow"
    elif abs(drift) > limits.drift:
        failure = "pushed aside"
    return {"crossed": float(failure == "none"), "failure": float(FAILURES.index(failure)), **found}


@dataclass(frozen=True)
class Crossing:
    """An experiment that ends with a verdict: a function for `exumob.sweeps.sweep`, of which maps are made."""

    experiment: Experiment
    limits: Limits = field(default_factory=Limits)

    def __post_init__(self) -> None:
        if self.experiment.duration <= self.limits.window:
            raise ValueError(
                f"Crossing: duration = {self.experiment.duration} s must be longer than Limits.window = "
                f"{self.limits.window} s."
            )

    def __call__(self, values: Mapping[str, Any]) -> dict[str, float]:
        """Run with other values and `judge`; a vehicle that cannot even stand there has failed, too."""
        try:
            run = self.experiment(values)
        except SimulationError as error:
            nothing = dict.fromkeys(("speed", "drift", "slip", "power", "wheel_load", "tilt"), math.nan)
            failure = FAILURES.index(error.cause if error.cause in FAILURES else "broke down")
            outside = 0.0 if error.result is None else _out_of_range(error.result, 0.0)
            return {"crossed": 0.0, "failure": float(failure), **nothing, "out_of_range": outside}
        return judge(run, self.limits)

    @property
    def parameters(self) -> dict[str, Any]:
        """Experiment and limits, as kept in results."""
        return asdict(self)


def _weight(run: xr.Dataset) -> float:
    if "mass" in run:
        return GRAVITY * float(run["mass"].sum())
    # packed runs: at the release, all stands still
    start = run.isel(time=0)
    return float(start["soil_force"].sel(axis="z").sum() + start["water_wrench"].sel(component="Fz").sum())


def _out_of_range(run: xr.Dataset, begin: float) -> float:
    if "hydrodynamics_out_of_range" not in run:
        return 0.0
    outside = run["hydrodynamics_out_of_range"].any("body").sel(macro_time=slice(begin, None))
    return float(outside.mean()) if outside.size else 0.0
