"""The verdict on a run: whether the vehicle drove, and if not, what befell it, since when.

A run that ended without an error may still have ended stuck, afloat or on its side. `judge` looks for eight conditions,
`CONDITIONS`, in what was recorded. Each counts once it has lasted a while (`VerdictLimits.persistence`): a wheel that
hops or a hull that pitches for an instant is none. The limits scale with the vehicle, so that two vehicles that are
Froude-similar in similar water get the same verdict.
"""

from __future__ import annotations

import json
import math
import re
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np
import xarray as xr

from exumob.simulation.conditions import (
    CONDITIONS,
    Dimensions,
    Flags,
    VerdictLimits,
    find_conditions,
    hull_force,
    when_held,
)
from exumob.support.arrays import Array
from exumob.support.constants import GRAVITY
from exumob.support.declared import checked
from exumob.support.dimensions import DIMENSIONS
from exumob.support.errors import SimulationError
from exumob.vehicle.parameters import Vehicle

VERDICTS: dict[str, str] = CONDITIONS | {
    "broke down": "the computation could not go on, for another reason than the conditions above",
    "too short to tell": "the run is shorter than a condition must last",
    "stands": "no condition holds, and the wheels were never commanded to turn",
    "drives": "no condition holds",
}
"""All verdicts, worst first, with their meaning."""

NEEDED: dict[str, tuple[str, ...]] = {
    "position": ("time", "body", "axis"), "yaw": ("time", "body"), "pitch": ("time", "body"), "roll": ("time", "body"),
    "forward_velocity": ("time",), "lateral_velocity": ("time",), "wheel_speed": ("time", "wheel"),
    "sinkage": ("time", "wheel"), "soil_force": ("time", "wheel", "axis"),
}  # fmt: skip
"""Variables of a run without which there is no verdict, with their dimensions."""
DRIFTING = 0.15
"""Part of the speed that goes aside from which it is named by itself [-]."""
STRAIGHT, CARRIED = 1e-3, (0.25, 0.05)
"""Largest angle of wheels that are steered straight [rad], and the way aside from which it is named then: over the
wheelbase, and over the whole way [-]."""
FURTHER = (
    "water_wrench", "quaternion", "water_load", "water_level", "water_depth", "steering_angle", "hull_soil_force",
    "hull_contact_center",
)  # fmt: skip
"""Variables that a verdict takes account of where the run has them; it needs the first two or the third."""


@dataclass(frozen=True)
class Condition:
    """One condition that held for long enough during a run."""

    kind: str
    """One of `CONDITIONS`"""
    since: float
    """First onset [s]"""
    until: float
    """Last instant at which it held [s]; nan: it held to the end of the run"""
    measured: str
    """What was measured meanwhile, in words"""

    @property
    def lasted(self) -> bool:
        """Whether it held to the end of the run."""
        return math.isnan(self.until)

    def __str__(self) -> str:
        when = f"since {self.since:.2f} s" if self.lasted else f"from {self.since:.2f} to {self.until:.2f} s"
        return f"{self.kind} {when}" + (f": {self.measured}" if self.measured else "")


@dataclass(frozen=True)
class Verdict:
    """The verdict on one run.

    Of several conditions the worst that held to the end is the verdict, and if none did, the worst that came and went.
    """

    kind: str
    """One of `VERDICTS`"""
    since: float
    """Its first onset [s]; nan if there is none"""
    until: float
    """Last instant at which it held [s]; nan if it held to the end of the run or has no onset"""
    sentence: str
    """The verdict in words, with its numbers"""
    conditions: tuple[Condition, ...] = ()
    """All conditions that held for long enough, worst first"""
    flags: Flags | None = None
    """Which of `CONDITIONS` holds when, shape (n, 8)"""
    limits: VerdictLimits = field(default_factory=VerdictLimits)

    def figures(self) -> dict[str, float | str]:
        """Return verdict and onset by name, as rows of sweeps hold them."""
        return {"verdict": self.kind, "verdict_since": self.since}


@checked
def judge(run: xr.Dataset, limits: VerdictLimits | None = None, vehicle: Vehicle | None = None) -> Verdict:
    """Judge a run of any length, made with any model of the water's loads.

    Parameters
    ----------
    run : xarray.Dataset
        Result of `exumob.simulate`, whole or up to where it broke, or packed (`exumob.learning.dataset`).
    limits : VerdictLimits, optional
    vehicle : Vehicle, optional
        Default: the vehicle that the run's attribute ``parameters`` holds.

    Returns
    -------
    Verdict

    Raises
    ------
    ValueError
        If the run lacks a variable of `NEEDED`, or does not hold its vehicle and none is given.
    """
    limits = VerdictLimits() if limits is None else limits
    missing = [name for name in NEEDED if name not in run]
    if "water_load" not in run and not {"water_wrench", "quaternion"} <= set(run.variables):
        missing.append("water_load")
    if missing:
        raise ValueError(f"judge: the run has no {', '.join(missing)}; a verdict needs what `simulate` records.")
    for name, dims in NEEDED.items():
        if run[name].dims != dims:
            raise ValueError(f"judge: {name} has the dimensions {run[name].dims}; `simulate` gives it {dims}.")
    time = run["time"].values
    if len(time) == 0 or "time" not in run.coords or not (np.diff(time) > 0.0).all():
        raise ValueError("judge: the times of the run must increase, from one instant at least.")
    if "hull" not in run["body"].values or not {"x", "y", "z"} <= set(run["axis"].values.tolist()):
        raise ValueError("judge: the run must name its bodies (hull, front_left, ...) and axes (x, y, z).")
    size = _dimensions(run, vehicle)
    verdict = _judged(run, limits, size, _level_at_hull(run))
    return replace(verdict, sentence=_joined(verdict.sentence, _touch(run, size)))


def wheel_load_share(run: xr.Dataset, vehicle: Vehicle | None = None) -> Array:
    """Return the share of the weight that the wheels bear [-], shape (n,).

    Parameters
    ----------
    run : xarray.Dataset
        As for `judge`.
    vehicle : Vehicle, optional
        Default: the vehicle that the run's attribute ``parameters`` holds.
    """
    return np.asarray(wheel_load_shares(run, vehicle).sum(axis=1))


def wheel_load_shares(run: xr.Dataset, vehicle: Vehicle | None = None) -> Array:
    """Return the share of the weight that each wheel bears [-], shape (n, 4); arguments as of `wheel_load_share`."""
    borne = run["soil_force"].sel(axis="z").transpose("time", "wheel").values.astype(float)
    return np.asarray(borne / _dimensions(run, vehicle).weight)


def _touch(run: xr.Dataset, size: Dimensions) -> str:
    """Say when and where the hull first touched the ground, and what it bore; empty if it never did."""
    borne = hull_force(run)
    touching = np.flatnonzero(borne > 0.0)
    if len(touching) == 0:
        return ""
    first = int(touching[0])
    where = ""
    if "hull_contact_center" in run:
        x, y, _ = run["hull_contact_center"].values[first]
        where = f" at x = {x:.2f} m, y = {y:.2f} m"
    most = 100.0 * float(np.nanmax(borne)) / size.weight
    return (
        f"the hull first touched the ground at {float(run['time'][first]):.2f} s{where} and bore up to "
        f"{most:.0f} % of the weight"
    )


def _parameters(run: xr.Dataset) -> dict[str, Any]:
    try:
        found = json.loads(run.attrs.get("parameters", "{}"))
    except (ValueError, TypeError):
        found = None
    if not isinstance(found, dict):
        raise ValueError("judge: the run's attribute parameters is no JSON text of its parts; it was changed.")
    return found


def _level_at_hull(run: xr.Dataset) -> Array:
    """Level of the water at the hull, world z [m], shape (n,); nan where there is none.

    Results hold it as ``water_level`` and ``water_depth``; older ones tell one depth above z = 0.
    """
    if {"water_level", "water_depth"} <= set(run.variables):
        return np.where(run["water_depth"].values > 0.0, run["water_level"].values, np.nan).astype(float)
    try:
        water = next(iter((_parameters(run).get("water") or {"": None}).values()))
        depth = np.nan if water is None else float(water["depth"])
    except (KeyError, TypeError, AttributeError):
        raise ValueError("judge: the run's attribute parameters does not describe its water.") from None
    return np.full(run.sizes["time"], depth)


def _dimensions(run: xr.Dataset, vehicle: Vehicle | None) -> Dimensions:
    if vehicle is not None:
        return Dimensions.of(asdict(vehicle))
    stored = _parameters(run).get("vehicle")
    if stored is None:
        raise ValueError("judge: the run does not hold its vehicle; give vehicle=...")
    try:
        return Dimensions.of(next(iter(stored.values())))
    except (KeyError, TypeError, AttributeError, StopIteration, ZeroDivisionError):
        raise ValueError(
            "judge: the run's attribute parameters does not describe its vehicle; give vehicle=..."
        ) from None


def _judged(run: xr.Dataset, limits: VerdictLimits, size: Dimensions, level: Array) -> Verdict:
    time = run["time"].values.astype(float)
    span = limits.persistence * math.sqrt(size.wheelbase / GRAVITY)
    finite = _finite(run)
    flags = np.zeros((len(time), len(CONDITIONS)), bool)
    conditions = []
    still = True
    whole = bool(finite) and time[finite - 1] - time[0] >= span * (1.0 - 1e-9)
    if whole:
        findings, commanded = find_conditions(run.isel(time=slice(finite)), limits, size, level[:finite], span)
        still = commanded
        for n, (kind, found) in enumerate(findings.items()):
            flags[:finite, n], lasted = when_held(time[:finite], found, span)
            held = np.flatnonzero(flags[:, n])
            if len(held):
                until = math.nan if lasted else round(float(time[held[-1]]), 6)
                text = found.text.format(_reported(kind, found.value[held]))
                conditions.append(Condition(kind, round(float(time[held[0]]), 6), until, text))
    status, cause = str(run.attrs.get("status", "")), str(run.attrs.get("cause", ""))
    broke = status.startswith("broke down")
    if cause in CONDITIONS and cause not in [found.kind for found in conditions if found.lasted]:
        conditions.append(Condition(cause, _end_of(status, time), math.nan, ""))
        conditions.sort(key=lambda found: list(CONDITIONS).index(found.kind))
    ended = ""
    if broke or status.startswith("interrupted"):
        ended = f"the run {'' if broke else 'was '}{status.split(':')[0]}"
    worst = next((found for found in conditions if found.lasted), None)
    if worst is None and broke:
        before = [str(found) for found in conditions]
        since = _end_of(status, time)
        return Verdict(
            "broke down", since, math.nan, "; ".join([f"broke down at {since:.2f} s", *before]), tuple(conditions),
            flags, limits,
        )  # fmt: skip
    if worst is None and not whole:
        text = f"too short to tell: {time[-1] - time[0]:.2f} s, and {span:.2f} s at least are needed"
        return Verdict("too short to tell", math.nan, math.nan, _joined(text, ended), (), flags, limits)
    at_end = "stands" if still else "drives"
    if worst is None and conditions:
        worst, ended = conditions[0], ended or f"{at_end} at the end"
    if worst is not None:
        before = [str(found) for found in conditions if found is not worst and found.since < worst.since]
        return Verdict(
            worst.kind, worst.since, worst.until, _joined(str(worst), *before, ended), tuple(conditions), flags, limits
        )
    late = run.isel(time=slice(finite)).sel(time=slice(time[finite - 1] - span, None))
    ahead, aside = (abs(float(late[name].mean())) for name in ("forward_velocity", "lateral_velocity"))
    speed = math.hypot(ahead, aside)
    said = f"{speed:.2f} m/s"
    if aside > DRIFTING * speed:
        said, speed = f"{ahead:.2f} m/s along its heading and {aside:.2f} m/s aside", ahead
    tread = size.wheel_radius * abs(float(late["wheel_speed"].mean()))
    share = f", {100.0 * speed / tread:.0f} % of the speed of its tyres" if not still and tread > 0.0 else ""
    text = "stands: its wheels are not commanded to turn" if still else f"drives: {said}{share} at the end"
    aside_too = "" if still else _carried(run.isel(time=slice(finite)), size)
    return Verdict(at_end, math.nan, math.nan, _joined(text, aside_too, ended), (), flags, limits)


def _carried(run: xr.Dataset, size: Dimensions) -> str:
    """Say how far aside a vehicle went that was steered straight; empty if that is little, or if it was steered."""
    if "steering_angle" not in run or float(np.abs(run["steering_angle"]).max()) > STRAIGHT:
        return ""
    way = run["position"].sel(body="hull", axis=["x", "y"]).values[[0, -1]].astype(float)
    first, last = run["yaw"].sel(body="hull").values[[0, -1]].astype(float)
    x, y = way[1] - way[0]
    aside = math.cos(first) * y - math.sin(first) * x
    if abs(aside) < max(CARRIED[0] * size.wheelbase, CARRIED[1] * math.hypot(x, y)):
        return ""
    turned = math.degrees(math.remainder(last - first, math.tau))
    side = "left" if aside > 0.0 else "right"
    return f"steered straight, it went {abs(aside):.2f} m to its {side} and turned by {turned:+.0f} deg"


def with_verdict(run: xr.Dataset, verdict: Verdict) -> xr.Dataset:
    """Add a verdict to a run: attributes, and the variable ``verdict_flag`` (time, condition).

    The attributes are ``verdict`` (one of `VERDICTS`), ``verdict_since`` and ``verdict_until`` [s], nan where there is
    no such instant, ``verdict_sentence``, and ``verdict_limits``, the limits as JSON.

    Returns
    -------
    xarray.Dataset
        A copy; an earlier verdict is replaced.
    """
    attributes = {
        "verdict": verdict.kind, "verdict_since": verdict.since, "verdict_until": verdict.until,
        "verdict_sentence": verdict.sentence, "verdict_limits": json.dumps(asdict(verdict.limits)),
    }  # fmt: skip
    run = run.drop_vars(["verdict_flag", "condition"], errors="ignore").assign_attrs(attributes)
    if verdict.flags is None:
        return run
    about = {
        "units": "1", "long_name": "condition holds",
        "comment": "; ".join(f"{kind}: {text}" for kind, text in CONDITIONS.items()),
    }  # fmt: skip
    names = ("condition", list(CONDITIONS), {"units": "1", "long_name": DIMENSIONS["condition"]})
    return run.assign_coords(condition=names).assign(verdict_flag=(("time", "condition"), verdict.flags, about))


def verdict_of(run: xr.Dataset) -> Verdict | None:
    """Return the verdict that a run carries, or judge it; None if it holds too little for a verdict."""
    attrs = run.attrs
    if {"verdict", "verdict_since", "verdict_until", "verdict_sentence"} <= set(attrs):
        return Verdict(
            attrs["verdict"], float(attrs["verdict_since"]), float(attrs["verdict_until"]), attrs["verdict_sentence"]
        )
    try:
        return judge(run)
    except ValueError:
        return None


def verdict_of_error(error: SimulationError) -> Verdict:
    """Return the verdict on a run that broke down; without any result the error's cause says why it did not start."""
    found = None if error.result is None else verdict_of(error.result)
    if found is not None:
        return found
    kind = error.cause if error.cause in CONDITIONS else "broke down"
    return Verdict(kind, 0.0, math.nan, f"{kind} before the start")


def _finite(run: xr.Dataset) -> int:
    """Number of instants until something is not finite: a run may break with that."""
    good = np.ones(run.sizes["time"], bool)
    for name in NEEDED:
        values = run[name].values
        good &= np.isfinite(values).reshape(len(good), -1).all(axis=1)
    return len(good) if good.all() else int(np.argmin(good))


def _reported(kind: str, values: Array) -> float:
    """Largest or mean value while a condition held."""
    number = float(values.max() if kind in ("tipped", "submerged", "sunk") else values.mean())
    return 0.0 if abs(number) < 0.5 and kind in ("afloat", "stuck") else number  # no "-0 %"


def _end_of(status: str, time: Array) -> float:
    """Time at which a run broke down [s]: as its status says, else that of the last record."""
    match = re.search(r" at ([0-9.]+) s", status)
    return float(match[1]) if match else float(time[-1])


def _joined(*texts: str) -> str:
    return "; ".join(filter(None, texts))
