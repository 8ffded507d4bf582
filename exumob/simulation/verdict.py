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
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from typing import Annotated, Any, NamedTuple

import numpy as np
import xarray as xr

from exumob.support.arrays import Array
from exumob.support.constants import GRAVITY
from exumob.support.declared import Declared, checked
from exumob.support.dimensions import DIMENSIONS
from exumob.support.errors import SimulationError
from exumob.support.quantities import Quantity
from exumob.vehicle.parameters import Vehicle

Flags = np.ndarray[Any, np.dtype[np.bool_]]
"""Truth of a condition at each instant, shape (n,)."""

CONDITIONS: dict[str, str] = {
    "tipped": "the weight falls beside the wheels, or the hull is tilted beyond the limit",
    "submerged": "all of the hull is below the still water level",
    "sunk": "a wheel is in the soil to its centre",
    "swept away": "the water moves the vehicle against or aside of the motion that its wheels are commanded",
    "slides": "the vehicle moves against or aside of that motion, and it is not the water that does it",
    "afloat": "in water, the ground bears hardly any weight",
    "bottomed": "the wheels turn, and the vehicle does not advance, for the hull rests on the soil",
    "stuck": "the wheels turn and the vehicle does not advance",
}
"""What can befall a vehicle, worst first, with its meaning."""

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


SHARE = Quantity("1", at_least=0.0, at_most=1.0)
SPEED = Quantity("sqrt(g L)", at_least=0.0, at_most=1.0)
ANGLE = Quantity("rad", above=0.0, below=0.5 * math.pi, remedy="it is in radians.")


@dataclass(frozen=True)
class VerdictLimits(Declared):
    """Limits of the conditions; speeds and times are in units that scale with the vehicle.

    The wheelbase L makes sqrt(g L) a speed and sqrt(L / g) a time: 2.65 m/s and 0.27 s for a wheelbase of 0.714 m.
    """

    persistence: Annotated[float, Quantity("sqrt(L / g)", above=0.0)] = 2.0
    """Time over which a condition must hold on average to count"""
    stuck_share: Annotated[float, SHARE] = 0.05
    """Speed ahead over the speed of the tyres' tread, commanded, below which the vehicle is stuck"""
    standstill_speed: Annotated[float, SPEED] = 0.01
    """Commanded speed of the tread below which standing is what is wanted"""
    swept_speed: Annotated[float, SPEED] = 0.02
    """Least speed against or aside of the commanded motion that counts as being swept away or sliding"""
    swept_angle: Annotated[float, ANGLE] = math.radians(45.0)
    """Least angle between the course and the commanded one that counts as such: by default, more aside than ahead"""
    wheel_load: Annotated[float, SHARE] = 0.05
    """Share of the weight on the ground below which the vehicle is afloat"""
    belly_share: Annotated[float, SHARE] = 0.1
    """Share of the weight on the hull from which it is the hull that holds a stuck vehicle"""
    tilt: Annotated[float, ANGLE] = math.radians(45.0)
    """Largest angle between the hull's upright axis and the vertical; a vehicle with so high a centre of mass that its
    weight falls beside its wheels before has tipped then"""
    sinkage: Annotated[float, SHARE] = 0.9
    """Sinkage of a wheel over its radius from which it is sunk; the run itself ends at 1"""


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
    limits: VerdictLimits = VerdictLimits()

    def figures(self) -> dict[str, float | str]:
        """Return verdict and onset by name, as rows of sweeps hold them."""
        return {"verdict": self.kind, "verdict_since": self.since}


class _Dimensions(NamedTuple):
    """Sizes of a vehicle."""

    weight: float
    """[N]"""
    wheel_radius: float
    wheelbase: float
    half_track: float
    front: float
    """Front axle ahead of the centre of mass [m]"""
    rear: float
    """Rear axle behind it [m]"""
    height: float
    """Centre of mass above hard ground [m]"""
    corners: Array
    """Corners of the hull's box about its centre of mass, body axes [m], shape (8, 3)"""

    @classmethod
    def of(cls, vehicle: Mapping[str, Any]) -> _Dimensions:
        """Take them from the fields of a `Vehicle`."""
        hull, wheel = vehicle["hull"], vehicle["wheel"]
        suspensions = (vehicle["suspension"], vehicle["rear_suspension"] or vehicle["suspension"])
        radius, wheelbase = 0.5 * wheel["diameter"], vehicle["wheelbase"]
        axles = [2.0 * (wheel["mass"] + suspension["upright_mass"]) for suspension in suspensions]
        mass = hull["mass"] + sum(axles)
        ahead = (hull["mass"] * hull["center_of_mass_x"] + 0.5 * wheelbase * (axles[0] - axles[1])) / mass
        keel = hull["ground_clearance"] - hull["center_of_mass_height"]
        middle = hull["center_x"] - hull["center_of_mass_x"]
        corners = [
            [middle + 0.5 * i * hull["length"], 0.5 * j * hull["width"], keel + k * hull["height"]]
            for i in (-1, 1) for j in (-1, 1) for k in (0, 1)
        ]  # fmt: skip
        return cls(
            GRAVITY * mass, radius, wheelbase, 0.5 * vehicle["track"], 0.5 * wheelbase - ahead, 0.5 * wheelbase + ahead,
            (hull["mass"] * hull["center_of_mass_height"] + sum(axles) * radius) / mass, np.array(corners),
        )  # fmt: skip


class _Finding(NamedTuple):
    """What the search for one condition found."""

    now: Flags
    """The condition holds at this instant"""
    ahead: Flags
    """It holds on average from this instant on"""
    value: Array
    """What to report of it, shape (n,)"""
    text: str
    """How, with the place for a number"""


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
    borne = run["soil_force"].sel(axis="z").sum("wheel").values.astype(float)
    return np.asarray(borne / _dimensions(run, vehicle).weight)


def _hull_force(run: xr.Dataset) -> Array:
    """Upward force of the soil on the hull [N], shape (n,); 0 in a run that does not know it."""
    if "hull_soil_force" not in run:
        return np.zeros(run.sizes["time"])
    return np.asarray(run["hull_soil_force"].sel(axis="z").values, float)


def _touch(run: xr.Dataset, size: _Dimensions) -> str:
    """Say when and where the hull first touched the ground, and what it bore; empty if it never did."""
    borne = _hull_force(run)
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


def _dimensions(run: xr.Dataset, vehicle: Vehicle | None) -> _Dimensions:
    if vehicle is not None:
        return _Dimensions.of(asdict(vehicle))
    stored = _parameters(run).get("vehicle")
    if stored is None:
        raise ValueError("judge: the run does not hold its vehicle; give vehicle=...")
    try:
        return _Dimensions.of(next(iter(stored.values())))
    except (KeyError, TypeError, AttributeError, StopIteration, ZeroDivisionError):
        raise ValueError(
            "judge: the run's attribute parameters does not describe its vehicle; give vehicle=..."
        ) from None


def _judged(run: xr.Dataset, limits: VerdictLimits, size: _Dimensions, level: Array) -> Verdict:
    time = run["time"].values.astype(float)
    span = limits.persistence * math.sqrt(size.wheelbase / GRAVITY)
    finite = _finite(run)
    flags = np.zeros((len(time), len(CONDITIONS)), bool)
    conditions = []
    still = True
    whole = bool(finite) and time[finite - 1] - time[0] >= span * (1.0 - 1e-9)
    if whole:
        findings, commanded = _findings(run.isel(time=slice(finite)), limits, size, level[:finite], span)
        still = commanded
        for n, (kind, found) in enumerate(findings.items()):
            flags[:finite, n], lasted = _held(time[:finite], found, span)
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
    speed = float(np.hypot(late["forward_velocity"].mean(), late["lateral_velocity"].mean()))
    tread = size.wheel_radius * abs(float(late["wheel_speed"].mean()))
    share = f", {100.0 * speed / tread:.0f} % of the speed of its tyres" if not still and tread > 0.0 else ""
    text = "stands: its wheels are not commanded to turn" if still else f"drives: {speed:.2f} m/s{share} at the end"
    return Verdict(at_end, math.nan, math.nan, _joined(text, ended), (), flags, limits)


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


# -- the conditions ----------------------------------------------------------------------------------------------------


def _findings(
    run: xr.Dataset, limits: VerdictLimits, size: _Dimensions, level: Array, span: float
) -> tuple[dict[str, _Finding], bool]:
    """Look for all conditions; also say whether the wheels were never commanded to turn."""
    time = run["time"].values.astype(float)

    def mean(values: Array) -> Array:
        return _mean_ahead(time, values, span)

    unit = math.sqrt(GRAVITY * size.wheelbase)
    standstill, least = limits.standstill_speed * unit, limits.swept_speed * unit
    hull = run.sel(body="hull")
    pitch, roll = hull["pitch"].values.astype(float), hull["roll"].values.astype(float)
    on_hull = _hull_force(run) / size.weight
    load = run["soil_force"].sel(axis="z").sum("wheel").values / size.weight + on_hull
    mean_load = mean(load)

    # tipped: the plumb line through the centre of mass, in the hull's axes, meets the ground beside the wheels
    down = np.stack([np.sin(pitch), -np.cos(pitch) * np.sin(roll), -np.cos(pitch) * np.cos(roll)], axis=-1)
    tilt = np.arccos(np.clip(-down[:, 2], -1.0, 1.0))
    beside = np.maximum(
        size.height * np.maximum(down[:, 0] / size.front, -down[:, 0] / size.rear),
        size.height * np.abs(down[:, 1]) / size.half_track,
    )  # over the share of gravity along the hull's upright axis: 1 is the edge
    excess = np.maximum(np.arctan2(beside, -down[:, 2]) / (0.25 * math.pi), tilt / limits.tilt)
    tipped = _Finding(excess > 1.0, mean(excess) > 1.0, np.degrees(tilt), "tilted by {:.0f} degrees")

    # submerged: the highest corner of the hull
    corner = size.corners
    upward = -down @ corner.T
    wet = np.isfinite(level)
    top = (hull["position"].sel(axis="z").values[:, None] + upward).max(axis=1)
    covered = np.where(wet, level - top, -size.height)
    submerged = _Finding(
        wet & (covered > 0.0), wet & (mean(covered) > 0.0), covered, "the hull's top is {:.3g} m under water"
    )

    deepest = run["sinkage"].values.max(axis=1) / size.wheel_radius
    sunk = _Finding(
        deepest > limits.sinkage, mean(deepest) > limits.sinkage, 100.0 * deepest,
        "a wheel is {:.0f} % of its radius in the soil",
    )  # fmt: skip

    motion = _Motion.of(run, size)
    average = _Motion(*map(mean, motion))
    commanded = mean(np.abs(motion.tread))
    wanted = commanded > standstill
    strays, against = average.strays(wanted, limits.swept_angle, least)
    strays_now, _ = motion.strays(np.abs(motion.tread) > standstill, limits.swept_angle, least)
    pushed = average.pushed(wanted, against) | (wet & (mean_load < limits.wheel_load))
    speed = motion.stray_speed(wanted, against)
    text = "{:.2g} m/s against or aside of the motion that its wheels are commanded"
    swept = _Finding(strays_now, strays & pushed, speed, text)
    slides = _Finding(strays_now, strays & ~pushed, speed, text)

    afloat = _Finding(
        wet & (load < limits.wheel_load), wet & (mean_load < limits.wheel_load), 100.0 * load,
        "{:.0f} % of the weight on the ground",
    )  # fmt: skip

    ahead = motion.ahead
    share = limits.stuck_share
    stuck = _Finding(
        (np.abs(motion.tread) > standstill) & (ahead < share * np.abs(motion.tread)),
        wanted & (mean(ahead) < share * commanded),
        100.0 * np.divide(mean(ahead), commanded, out=np.zeros_like(ahead), where=wanted),
        "{:.0f} % of the speed of its tyres",
    )
    bottomed = _Finding(
        stuck.now & (on_hull > limits.belly_share), stuck.ahead & (mean(on_hull) > limits.belly_share),
        100.0 * on_hull, "{:.0f} % of the weight on the hull",
    )  # fmt: skip
    found = (tipped, submerged, sunk, swept, slides, afloat, bottomed, stuck)
    findings = dict(zip(CONDITIONS, found, strict=True))
    return findings, not bool(wanted.any())


class _Motion(NamedTuple):
    """Motion of the hull in its heading frame beside what the wheels are commanded; all of shape (n,)."""

    tread: Array
    """Mean speed of the tyres' tread, positive rolls forward [m/s]"""
    forward: Array
    lateral: Array
    """Velocity along the heading and to its left [m/s]"""
    aside: Array
    """Velocity to the left beyond what lies between the heading and the commanded course [m/s]"""
    push_forward: Array
    push_lateral: Array
    """Force of the water along the heading and to its left [N]"""

    @classmethod
    def of(cls, run: xr.Dataset, size: _Dimensions) -> _Motion:
        """Take it from a run."""
        forward, lateral = (run[f"{name}_velocity"].values.astype(float) for name in ("forward", "lateral"))
        tread = size.wheel_radius * run["wheel_speed"].values.mean(axis=1)
        angle = run["steering_angle"].values.mean(axis=1) if "steering_angle" in run else np.zeros(len(forward))
        # without slip the rear axle moves straight ahead, the centre of mass at this slope to the heading
        course = lateral - forward * size.rear / size.wheelbase * np.tan(angle)
        aside = np.where(lateral * course > 0.0, np.sign(lateral) * np.minimum(abs(lateral), abs(course)), 0.0)
        yaw = run["yaw"].sel(body="hull").values.astype(float)
        force = _water_force(run)
        return cls(
            tread, forward, lateral, aside, np.cos(yaw) * force[:, 0] + np.sin(yaw) * force[:, 1],
            np.cos(yaw) * force[:, 1] - np.sin(yaw) * force[:, 0],
        )  # fmt: skip

    @property
    def ahead(self) -> Array:
        """Speed in the direction in which the wheels roll [m/s]."""
        return np.asarray(self.forward * np.where(self.tread < 0.0, -1.0, 1.0))

    def strays(self, wanted: Flags, angle: float, least: float) -> tuple[Flags, Flags]:
        """Say when the vehicle moves otherwise than commanded, and when it moves against that.

        Parameters
        ----------
        wanted : array of bool, shape (n,)
            The wheels are commanded to turn.
        angle : float
            Least angle to the commanded course [rad].
        least : float
            Least speed [m/s].
        """
        aside = np.abs(self.aside)
        against = wanted & (self.ahead < -least)
        across = (aside > least) & (aside > math.tan(angle) * self.ahead)
        return np.where(wanted, against | across, np.hypot(self.forward, self.lateral) > least), against

    def pushed(self, wanted: Flags, against: Flags) -> Flags:
        """Say when the water pushes in the direction of that motion."""
        forward, lateral = self.push_forward * self.forward, self.push_lateral * self.lateral
        return np.asarray(np.where(wanted, np.where(against, forward, lateral), forward + lateral) > 0.0)

    def stray_speed(self, wanted: Flags, against: Flags) -> Array:
        """Speed of that motion [m/s]; negative where it is the other way."""
        speed = np.hypot(self.forward, self.lateral)
        return np.asarray(np.where(wanted, np.where(against, -self.ahead, np.abs(self.aside)), speed))


def _water_force(run: xr.Dataset) -> Array:
    """Force of the water on the whole vehicle, world axes [N], shape (n, 3)."""
    if "water_load" in run:
        return np.asarray(run["water_load"].sum("body").values, float)
    from scipy.spatial.transform import Rotation

    force = run["water_wrench"].values[..., :3].astype(float)
    turned = Rotation.from_quat(run["quaternion"].values.reshape(-1, 4), scalar_first=True).apply(force.reshape(-1, 3))
    return np.asarray(turned.reshape(force.shape).sum(axis=1))


def _finite(run: xr.Dataset) -> int:
    """Number of instants until something is not finite: a run may break with that."""
    good = np.ones(run.sizes["time"], bool)
    for name in NEEDED:
        values = run[name].values
        good &= np.isfinite(values).reshape(len(good), -1).all(axis=1)
    return len(good) if good.all() else int(np.argmin(good))


# -- persistence -------------------------------------------------------------------------------------------------------


def _mean_ahead(time: Array, values: Array, span: float) -> Array:
    """Mean of a signal over the `span` [s] from each instant on, or over what is left of the run; shape (n,)."""
    integral = np.concatenate([[0.0], np.cumsum(0.5 * (values[1:] + values[:-1]) * np.diff(time))])
    to = np.minimum(time + span, time[-1])
    mean = np.divide(np.interp(to, time, integral) - integral, to - time, out=values.astype(float), where=to > time)
    return np.asarray(mean)


def _held(time: Array, found: _Finding, span: float) -> tuple[Flags, bool]:
    """Say when a condition held that lasted for `span` [s], and whether it held to the end.

    It lasts over a span if it holds on average and for half of the instants at least: a short jolt of any strength is
    none. It is then said to hold from the first to the last instant therein at which it does by itself.
    """
    full = time + span <= time[-1] + 1e-9
    lasting = found.ahead & full & (_mean_ahead(time, found.now.astype(float), span) > 0.5 - 1e-9)
    last = int(np.flatnonzero(full)[-1])
    held = np.zeros(len(time), bool)
    lasts = False
    for first, end in _stretches(lasting):
        covered = np.flatnonzero((time >= time[first]) & (time <= time[end] + span + 1e-9))
        covered = covered[found.now[covered]]
        begin, stop = covered[0], covered[-1]
        if end == last:
            lasts, stop = True, len(time) - 1
        held[begin : stop + 1] = True
    return held, lasts


def _stretches(flags: Flags) -> Iterator[tuple[int, int]]:
    """First and last index of each stretch of true values."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(np.int8)))
    yield from zip(edges[::2].tolist(), (edges[1::2] - 1).tolist(), strict=True)


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
