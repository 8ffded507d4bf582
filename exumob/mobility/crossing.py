"""Can the vehicle cross? A verdict on one run, as a planner needs it: go or no go, speed, drift and kind of failure.

What befell the vehicle is the verdict that every run has (`exumob.simulation.verdict`); a ford adds that it must be
crossed in time and within a lane.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Annotated, Any

import numpy as np
import xarray as xr

from exumob.mobility.lattice import MEASURES
from exumob.simulation.verdict import Verdict, VerdictLimits, judge, verdict_of_error, wheel_load_share
from exumob.support.declared import Declared, checked
from exumob.support.errors import SimulationError
from exumob.support.quantities import Quantity
from exumob.sweeps.experiment import Experiment

FAILURES = (
    "none", "sunk", "afloat", "swept away", "tipped", "stuck", "too slow", "pushed aside", "broke down", "submerged",
    "slides", "bottomed",
)  # fmt: skip
"""Kinds of failure, by the number that maps hold; `exumob.simulation.verdict.VERDICTS` has them in order, worst first,
and "too slow" and "pushed aside" count only where none of those applies."""
FOR_GOOD = ("tipped", "submerged", "sunk")
"""Conditions that end a crossing whenever they come about; the others must last into the window."""


@dataclass(frozen=True)
class Limits(Declared):
    """Limits of a crossing: a ford of a width, in a time, within the lane, upright and on the wheels."""

    width: Annotated[float, Quantity("m", above=0.0)] = 12.0
    """Width of the water, along the first heading"""
    time: Annotated[float, Quantity("s", above=0.0)] = 20.0
    """Time in which it must be crossed at the speed reached"""
    drift: Annotated[float, Quantity("m", above=0.0)] = 1.0
    """Largest displacement to either side over the width"""
    window: Annotated[float, Quantity("s", above=0.0)] = 2.0
    """End of the run over which speed, course, slip and loads are averaged"""
    range_share: Annotated[float, Quantity("1", at_least=0.0, at_most=1.0)] = 0.5
    """Share of the window outside the networks' training range beyond which their answer does not count"""
    verdict: VerdictLimits = field(default_factory=VerdictLimits)
    """Limits of the conditions that can befall the vehicle"""

    @property
    def speed(self) -> float:
        """Least speed ahead [m/s]."""
        return self.width / self.time


@checked
def judge_crossing(run: xr.Dataset, limits: Limits) -> dict[str, float]:
    """Judge a run as the crossing of a ford, made with any model of the water's loads.

    Parameters
    ----------
    run : xarray.Dataset
        Result of `exumob.simulate`, or packed (`exumob.learning.dataset`); longer than `limits.window`.
    limits : Limits

    Returns
    -------
    dict
        ``crossed``: 1 or 0; ``failure``: index of `FAILURES`; ``failure_since``: its first onset [s], nan without one;
        ``speed`` ahead along the first heading [m/s]; ``drift`` to the left over the width [m]; mean ``slip`` ratio of
        the wheels in contact [-] (nan without contact); ``power`` at the wheels [W] (nan for packed runs);
        ``wheel_load``: share of the weight on the wheels [-]; ``tilt``: largest roll or pitch [rad]; ``out_of_range``:
        share of the window outside the training range [-], ``wide_range``: share of the networks for the whole range
        in its loads [-] (both 0 without networks).

    Raises
    ------
    ValueError
        If the run is shorter than the window, or lacks what a verdict needs (`exumob.simulation.verdict.judge`).
    """
    verdict = judge(run, limits.verdict)  # refuses what is no run
    end = float(run["time"][-1])
    if end < limits.window:
        raise ValueError(
            f"judge_crossing: the run ends at {end:g} s; it must be longer than Limits.window = {limits.window} s."
        )
    if verdict.kind == "too short to tell":
        raise ValueError(
            f"judge_crossing: {verdict.sentence}; give a longer run, or a shorter VerdictLimits.persistence."
        )
    late = run.sel(time=slice(end - limits.window, None))
    hull = late["position"].sel(body="hull").values
    span = float(late["time"][-1] - late["time"][0])
    speed = float(hull[-1, 0] - hull[0, 0]) / span
    sideways = float(hull[-1, 1] - hull[0, 1]) / span
    drift = sideways / speed * limits.width if speed > 0.0 else math.copysign(math.inf, sideways)
    failure, since = _befallen(verdict, end - limits.window)
    if failure == "none" and speed < limits.speed:
        failure = "too slow"
    elif failure == "none" and abs(drift) > limits.drift:
        failure = "pushed aside"
    return {
        "crossed": float(failure == "none"),
        "failure": float(FAILURES.index(failure)),
        "failure_since": since,
        "speed": speed,
        "drift": drift,
        "slip": float(late["slip_ratio"].mean()),
        "power": float(late["spin_power"].sum("wheel").mean()) if "spin_power" in late else math.nan,
        "wheel_load": float(wheel_load_share(late).mean()),
        "tilt": float(max(np.abs(run[name].sel(body="hull")).max() for name in ("roll", "pitch"))),
        **_ranges(run, end - limits.window),
    }


def _befallen(verdict: Verdict, begin: float) -> tuple[str, float]:
    """Worst condition that counts against a crossing judged from `begin` [s] on, and its onset [s]."""
    for found in verdict.conditions:
        if found.kind in FOR_GOOD or found.lasted or found.until > begin:
            return found.kind, found.since
    return ("broke down", verdict.since) if verdict.kind == "broke down" else ("none", math.nan)


@dataclass(frozen=True)
class Crossing(Declared):
    """An experiment that ends with a verdict: a function for `exumob.sweeps.sweep`, of which maps are made."""

    experiment: Experiment
    limits: Limits = field(default_factory=Limits)

    def _check(self) -> None:
        if self.experiment.duration <= self.limits.window:
            raise ValueError(
                f"Crossing: duration = {self.experiment.duration} s must be longer than Limits.window = "
                f"{self.limits.window} s."
            )

    def __call__(self, values: Mapping[str, Any]) -> dict[str, float]:
        """Run with other values and `judge_crossing`; a vehicle that cannot even stand there has failed, too."""
        try:
            run = self.experiment(values)
        except SimulationError as error:
            nothing = dict.fromkeys(("speed", "drift", "slip", "power", "wheel_load", "tilt"), math.nan)
            verdict = verdict_of_error(error)
            kind = verdict.kind if verdict.kind in FAILURES else "broke down"
            return {
                "crossed": 0.0, "failure": float(FAILURES.index(kind)), "failure_since": verdict.since, **nothing,
                **_ranges(error.result, 0.0),
            }  # fmt: skip
        return judge_crossing(run, self.limits)

    @property
    def variables(self) -> dict[str, tuple[str, str]]:
        """Unit and meaning of the numbers of `judge_crossing`, by name, as sweeps keep them."""
        return MEASURES | {
            "crossed": ("1", "1 if the vehicle crossed, else 0"),
            "failure": ("1", f"number of the failure: {', '.join(FAILURES)}, from 0 on"),
            "failure_since": ("s", "first onset of the failure"),
        }

    @property
    def parameters(self) -> dict[str, Any]:
        """Experiment and limits, as kept in results."""
        return asdict(self)


def _ranges(run: xr.Dataset | None, begin: float) -> dict[str, float]:
    """Shares of the time outside the training range, and of the networks for the whole range, from `begin` [s] on."""
    late = None if run is None or "macro_time" not in run.dims else run.sel(macro_time=slice(begin, None))
    if late is None or not late.sizes["macro_time"]:
        return {"out_of_range": 0.0, "wide_range": 0.0}
    outside, wide = late.get("hydrodynamics_out_of_range"), late.get("hydrodynamics_wide_range_share")
    return {
        "out_of_range": 0.0 if outside is None else float(outside.any("body").mean()),
        "wide_range": 0.0 if wide is None else float(wide.mean()),
    }
