"""What can befall a vehicle on its way, and when it does: the conditions of a verdict, found in what a run recorded.

Each is looked for at every instant, and on average over a span from there on; `when_held` says when it lasted.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple

import numpy as np
import xarray as xr

from exumob.support.arrays import Array
from exumob.support.constants import GRAVITY
from exumob.support.declared import Declared
from exumob.support.quantities import Quantity

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


class Dimensions(NamedTuple):
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
    def of(cls, vehicle: Mapping[str, Any]) -> Dimensions:
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


class Finding(NamedTuple):
    """What the search for one condition found."""

    now: Flags
    """The condition holds at this instant"""
    ahead: Flags
    """It holds on average from this instant on"""
    value: Array
    """What to report of it, shape (n,)"""
    text: str
    """How, with the place for a number"""


def hull_force(run: xr.Dataset) -> Array:
    """Upward force of the soil on the hull [N], shape (n,); 0 in a run that does not know it."""
    if "hull_soil_force" not in run:
        return np.zeros(run.sizes["time"])
    return np.asarray(run["hull_soil_force"].sel(axis="z").values, float)


def find_conditions(
    run: xr.Dataset, limits: VerdictLimits, size: Dimensions, level: Array, span: float
) -> tuple[dict[str, Finding], bool]:
    """Look for all conditions; also say whether the wheels were never commanded to turn."""
    time = run["time"].values.astype(float)

    def mean(values: Array) -> Array:
        return _mean_ahead(time, values, span)

    unit = math.sqrt(GRAVITY * size.wheelbase)
    standstill, least = limits.standstill_speed * unit, limits.swept_speed * unit
    hull = run.sel(body="hull")
    pitch, roll = hull["pitch"].values.astype(float), hull["roll"].values.astype(float)
    on_hull = hull_force(run) / size.weight
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
    tipped = Finding(excess > 1.0, mean(excess) > 1.0, np.degrees(tilt), "tilted by {:.0f} degrees")

    # submerged: the highest corner of the hull
    corner = size.corners
    upward = -down @ corner.T
    wet = np.isfinite(level)
    top = (hull["position"].sel(axis="z").values[:, None] + upward).max(axis=1)
    covered = np.where(wet, level - top, -size.height)
    submerged = Finding(
        wet & (covered > 0.0), wet & (mean(covered) > 0.0), covered, "the hull's top is {:.3g} m under water"
    )

    deepest = run["sinkage"].values.max(axis=1) / size.wheel_radius
    sunk = Finding(
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
    swept = Finding(strays_now, strays & pushed, speed, text)
    slides = Finding(strays_now, strays & ~pushed, speed, text)

    afloat = Finding(
        wet & (load < limits.wheel_load), wet & (mean_load < limits.wheel_load), 100.0 * load,
        "{:.0f} % of the weight on the ground",
    )  # fmt: skip

    ahead = motion.ahead
    share = limits.stuck_share
    stuck = Finding(
        (np.abs(motion.tread) > standstill) & (ahead < share * np.abs(motion.tread)),
        wanted & (mean(ahead) < share * commanded),
        100.0 * np.divide(mean(ahead), commanded, out=np.zeros_like(ahead), where=wanted),
        "{:.0f} % of the speed of its tyres",
    )
    bottomed = Finding(
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
    def of(cls, run: xr.Dataset, size: Dimensions) -> _Motion:
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


# -- persistence -------------------------------------------------------------------------------------------------------


def _mean_ahead(time: Array, values: Array, span: float) -> Array:
    """Mean of a signal over the `span` [s] from each instant on, or over what is left of the run; shape (n,)."""
    integral = np.concatenate([[0.0], np.cumsum(0.5 * (values[1:] + values[:-1]) * np.diff(time))])
    to = np.minimum(time + span, time[-1])
    mean = np.divide(np.interp(to, time, integral) - integral, to - time, out=values.astype(float), where=to > time)
    return np.asarray(mean)


def when_held(time: Array, found: Finding, span: float) -> tuple[Flags, bool]:
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
