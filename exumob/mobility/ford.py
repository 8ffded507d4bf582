"""Can my vehicle cross here? A ford by its cross-section, the drive through it, and the report on that drive.

The path is the section's own: station along world x, the current across it along y. The vehicle starts with its front
half its length before the water's edge, its driver keeps to the path, and it has crossed once all of it is past the far
edge. One that floats or is swept away has not, even where the run comes out on the other side.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple

import numpy as np
import xarray as xr

from exumob.driving.path_following import PathFollowing
from exumob.ground.soil import Soil
from exumob.mobility.crossing import FOR_GOOD
from exumob.simulation.ensemble import add_members
from exumob.simulation.run import simulate
from exumob.simulation.settings import time_scale, usual_speed
from exumob.simulation.verdict import Flags, Verdict, VerdictLimits, judge, wheel_load_share, wheel_load_shares
from exumob.simulation.water_models import DEFAULT_MODEL
from exumob.support.arrays import Array
from exumob.support.declared import Declared, checked
from exumob.support.quantities import DURATION, Quantity
from exumob.surrogates.model import SurrogateHydrodynamics
from exumob.vehicle.motion import WHEELS
from exumob.vehicle.parameters import Vehicle
from exumob.vehicle.start_pose import StartPose
from exumob.water.conditions import Water
from exumob.water.cross_section import DISCHARGE, HEIGHT, CrossSection
from exumob.water.hydrodynamics import Hydrodynamics
from exumob.water.wetted_surface import hull_triangles

DENSITY = Quantity("kg/m^3", above=0.0, plausible=(700.0, 1500.0))
LOST = (*FOR_GOOD, "swept away", "afloat")
"""Conditions with which a vehicle has not crossed though it came out on the other side: wheels do not hold it."""
NEEDED = ("position", "slip_ratio", "water_depth", "keel_clearance")
"""Variables of a run that a report needs besides those of a verdict."""
GRIPS = 0.05
"""Share of the weight that a wheel bears at least while its slip counts by itself: others spin without a bite [-]."""
PROGRESS_SHARE = 0.5
"""Share of the speed of its tyres at which a vehicle is given time to cross."""
MOST_STEERING = math.radians(30.0)
"""Largest steering angle of the driver, where the vehicle's is not smaller [rad]."""

BEFALLEN = {
    "tipped": "it tips over", "submerged": "it goes under", "sunk": "a wheel sinks into the soil to its centre",
    "swept away": "the water carries it away", "slides": "it slides", "afloat": "it floats",
    "bottomed": "it hangs on its hull", "stuck": "it is stuck", "broke down": "the computation broke down",
    "stopped": "the run was stopped", "too slow": "it is still under way", "too short to tell": "the run is too short",
}  # fmt: skip
"""What keeps a vehicle from crossing, by the kind that a report names, in words."""


@dataclass(frozen=True)
class Ford(Declared):
    """A ford, and how it is driven.

    Raises
    ------
    ValueError
        If the level lies below all of the bed, or the section begins or ends under water; if a discharge is given
        beside the section's own current.
    """

    section: CrossSection
    """The ground along the path, and perhaps the current"""
    level: Annotated[float, HEIGHT]
    """World z of the still surface; `CrossSection.level_at_depth` gives that of a depth"""
    vehicle: Vehicle
    soil: Soil
    discharge: Annotated[float | None, DISCHARGE] = None
    """Of the whole river, positive to the left of the path; None: the section's own current, or still water"""
    speed: Annotated[float | None, Quantity("m/s", above=0.0, at_most=100.0, plausible=(0.02, 30.0))] = None
    """Speed of the tyres' tread; None: by Froude's law that of the paper's vehicle, 1 m/s on a wheelbase of 0.714 m"""
    initial_speed: Annotated[float, Quantity("m/s", at_least=0.0, at_most=100.0, plausible=(0.0, 30.0))] = 0.0
    """Speed of the vehicle at time 0; 0: it starts from rest"""
    duration: Annotated[float | None, DURATION] = None
    """Time that it has; None: enough to go all the way at half the speed of its tyres"""
    density: Annotated[float, DENSITY] = 1000.0
    """Of the water; 1025 is sea water"""

    def _check(self) -> None:
        assert isinstance(self.water, Water)  # refuses what is no ford

    @property
    def water(self) -> Water:
        """The water over the section."""
        return self.section.water(self.level, self.discharge, density=self.density)

    @property
    def edges(self) -> tuple[float, float]:
        """Stations of the first and the last edge of the water [m]."""
        return self.section.edges(self.level)

    @property
    def overhangs(self) -> tuple[float, float]:
        """Front and rear end of the vehicle, from the point midway between its wheels [m], both positive."""
        along = (hull_triangles(self.vehicle).reshape(-1, 3) + self.vehicle.hull_origin)[:, 0]
        wheels = 0.5 * self.vehicle.wheelbase + self.vehicle.wheel.radius
        return max(float(along.max()), wheels), max(-float(along.min()), wheels)

    @property
    def start(self) -> StartPose:
        """Where the vehicle starts."""
        front, rear = self.overhangs
        return StartPose(self.edges[0] - front - 0.5 * (front + rear))

    @property
    def way(self) -> float:
        """Way from the start to where all of the vehicle is past the far edge [m]."""
        return self.edges[1] + self.overhangs[1] - self.start.x

    @property
    def tread_speed(self) -> float:
        """Speed of the tyres' tread [m/s]."""
        return usual_speed(self.vehicle) if self.speed is None else self.speed

    @property
    def time(self) -> float:
        """Time that the vehicle has [s]."""
        if self.duration is not None:
            return self.duration
        time = self.way / (PROGRESS_SHARE * self.tread_speed) + time_scale(self.vehicle)
        return math.ceil(10.0 * time - 1e-9) / 10.0

    @property
    def maneuver(self) -> PathFollowing:
        """Wheels that are brought to speed in the time that is 1 s to the paper's vehicle, and a driver on the path."""
        ends = (self.start.x - self.vehicle.wheelbase, self.edges[1] + self.vehicle.wheelbase)
        return PathFollowing(
            tuple((end, 0.0) for end in ends), self.tread_speed / self.vehicle.wheel.radius,
            ramp_time=time_scale(self.vehicle), max_steering=min(MOST_STEERING, self.vehicle.steering.limit),
        )  # fmt: skip

    @property
    def greatest_current(self) -> float:
        """Greatest speed of the water at any point of the section [m/s]."""
        field = self.water.field
        return 0.0 if field is None else float(np.hypot(field.nodes[..., 1], field.nodes[..., 2]).max())

    def drive(
        self,
        hydrodynamics: Hydrodynamics | str = DEFAULT_MODEL,
        progress: Callable[[float], None] | None = None,
        **options: Any,
    ) -> xr.Dataset:
        """Drive the vehicle through it.

        Parameters
        ----------
        hydrodynamics, progress, **options
            As for `exumob.simulate`.

        Raises
        ------
        ValueError, SimulationError, SimulationInterrupted
            As `exumob.simulate`.
        """
        return simulate(hydrodynamics=hydrodynamics, progress=progress, **self._conditions, **options)

    def add_members(
        self,
        run: xr.Dataset,
        hydrodynamics: SurrogateHydrodynamics,
        progress: Callable[[float], None] | None = None,
        **options: Any,
    ) -> xr.Dataset:
        """Drive through it anew with each member of an ensemble of networks alone.

        Parameters
        ----------
        run : xarray.Dataset
            Result of `drive` with these networks and options.
        hydrodynamics, progress, **options
            As for `exumob.simulation.ensemble.add_members`, which says what is added.

        Raises
        ------
        ValueError
            If there is but one member.
        """
        return add_members(run, hydrodynamics=hydrodynamics, progress=progress, **self._conditions, **options)

    @property
    def _conditions(self) -> dict[str, Any]:
        return {
            "vehicle": self.vehicle, "soil": self.soil, "water": self.water, "maneuver": self.maneuver,
            "duration": self.time, "start": self.start, "terrain": self.section.terrain(),
            "initial_speed": self.initial_speed,
        }  # fmt: skip

    def lines(self) -> dict[str, str]:
        """Return what will be driven in words, by what it is about."""
        near, far = self.edges
        stretches = self.section.wetted(self.level)
        depth = self.section.greatest_depth(self.level)
        parted = f" in {len(stretches)} stretches" if len(stretches) > 1 else ""
        tyre = depth / self.vehicle.wheel.diameter
        flow = "still" if self.greatest_current == 0.0 else f"current up to {self.greatest_current:.3g} m/s"
        if self.discharge is not None:
            flow += f" ({abs(self.discharge):.4g} m^3/s to the {'left' if self.discharge > 0.0 else 'right'})"
        begun = f"rolling at {self.initial_speed:.3g} m/s" if self.initial_speed else "standing"
        fall, rise = self.banks
        low, high = self._driven
        first, last = (float(np.asarray(self.section.station, float)[n]) for n in (0, -1))
        beyond = [f"before station {first:.4g} m"] if low < first else []
        beyond += [f"after station {last:.4g} m"] if high > last else []
        level = f"; taken as level {' and '.join(beyond)}, where the section has no points" if beyond else ""
        return {
            "water": f"{self.section.width(self.level):.4g} m wide{parted}, from station {near:.4g} to {far:.4g} m; at "
            f"most {depth:.3g} m deep ({tyre:.2f} diameters of the tyre); {flow}",
            "banks": f"down at most {100.0 * fall:.1f} %, up at most {100.0 * rise:.1f} %{level}",
            "drive": f"{self.vehicle.name} on {self.soil.name or 'soil'}, {begun} at station {self.start.x:.4g} m; its "
            f"tyres at {self.tread_speed:.3g} m/s; {self.way:.4g} m to go, {self.time:.4g} s to do it in",
        }

    @property
    def _driven(self) -> tuple[float, float]:
        """First and last station over which the vehicle comes [m]."""
        return self.start.x - self.overhangs[1], self.start.x + self.way + self.overhangs[0]

    @property
    def banks(self) -> tuple[float, float]:
        """Steepest fall and steepest rise of the ground that the wheels drive over [-], both positive or 0."""
        station, bed = np.asarray(self.section.station, float), np.asarray(self.section.bed, float)
        low, high = self._driven
        driven = (station[1:] > low) & (station[:-1] < high)
        slope = (np.diff(bed) / np.diff(station))[driven]
        return float(max(-slope.min(initial=0.0), 0.0)), float(max(slope.max(initial=0.0), 0.0))


FIGURES: dict[str, tuple[str, str]] = {
    # name: (unit, meaning)
    "crosses": ("1", "whether all of the vehicle came past the far edge, its wheels on the ground all the way"),
    "time": ("s", "time in which it crossed, else that from which it failed"),
    "station": ("m", "station of the middle between the wheels then"),
    "out": ("s", "time at which all of it was past the far edge, whatever had befallen it; nan: it never was"),
    "drift": ("m", "largest displacement of the hull to the left of the path"),
    "depth": ("m", "greatest depth of the undisturbed water below the hull's origin"),
    "wheel_load": ("1", "least share of the weight on the wheels"),
    "slip": ("1", "largest slip ratio, mean of the wheels in contact, once they are at speed"),
    "wheel_slip": ("1", f"largest slip ratio of one wheel at speed that bears {100.0 * GRIPS:.0f} % of the weight"),
    "freeboard": ("m", "least height of the hull's upper edge above the still water"),
    "clearance": ("m", "least height of the hull above the soil"),
    "hull_load": ("1", "largest share of the weight on the hull"),
}
"""Unit and meaning of each figure of `FordReport.figures`."""


class Extreme(NamedTuple):
    """Least or largest value of something on the way, and where it was."""

    value: float
    """nan: there was none"""
    station: float
    """Of the middle between the wheels [m]"""
    time: float
    """[s]"""

    def where(self) -> str:
        """Say where and when."""
        return f"at station {self.station:.2f} m, {self.time:.2f} s"


class MemberCrossings(NamedTuple):
    """What the members of an ensemble did, each driving alone: places alone are known of them, no loads."""

    out: Array
    """Time at which all of the vehicle was past the far edge [s], shape (members,); nan: it never was"""
    drift: Array
    """Largest displacement of the hull to the left of the path until then [m], negative to the right, (members,)"""

    def __str__(self) -> str:
        """Say it in a line."""
        came = self.out[np.isfinite(self.out)]
        text = f"{len(came)} of {len(self.out)} networks, each driving alone, come out past the far edge"
        if len(came):
            text += f", after {came.min():.2f} to {came.max():.2f} s"
        low, high = self.drift.min(), self.drift.max()
        if low < 0.0 < high:
            return f"{text}; drift at most {-low:.2f} m to the right, {high:.2f} m to the left"
        low, high = np.sort(np.abs([low, high]))
        side = "left" if self.drift.max() > 0.0 else "right"
        return f"{text}; drift of {low:.2f} to {high:.2f} m to the {side}"


@dataclass(frozen=True)
class FordReport:
    """What befell a vehicle in a ford."""

    kind: str
    """``"crosses"``, or what kept it from that: one of `BEFALLEN`"""
    sentence: str
    """The answer in words"""
    time: float
    """Time in which it crossed, else that from which it failed [s]"""
    station: float
    """Station of the middle between the wheels then [m]"""
    out: float
    """Time at which all of it was past the far edge, whatever had befallen it [s]; nan: it never was"""
    drift: Extreme
    """Largest displacement of the hull to the left of the path [m], negative to the right"""
    depth: Extreme
    """Greatest depth of the undisturbed water below the hull's origin [m]"""
    wheel_load: Extreme
    """Least share of the weight on the wheels [-]"""
    slip: Extreme
    """Largest slip ratio, mean of the wheels in contact, once they are at speed [-]"""
    wheel_slip: Extreme
    """Largest slip ratio of one wheel at speed that bears `GRIPS` of the weight or more [-]"""
    slipping_wheel: str
    """That wheel, one of `exumob.vehicle.motion.WHEELS`; empty: none"""
    at_speed: float
    """Time from which the wheels are at speed [s]"""
    freeboard: Extreme
    """Least height of the hull's upper edge above the still water [m]; negative: the deck is awash"""
    clearance: Extreme
    """Least height of the hull above the soil [m]; negative: it has sunk in"""
    hull_load: Extreme
    """Largest share of the weight on the hull [-]"""
    trust: str
    """What the result is worth (`exumob.simulation.trust`)"""
    last: int
    """Number of the instant of the run up to which it goes"""
    limits: VerdictLimits
    members: MemberCrossings | None = None
    """None: the run has none (`Ford.add_members`)"""

    @property
    def crosses(self) -> bool:
        """Whether all of the vehicle came past the far edge, its wheels on the ground all the way."""
        return self.kind == "crosses"

    def figures(self) -> dict[str, float]:
        """Return the numbers of `FIGURES` by name, as a sweep keeps them."""
        found = ((name, getattr(self, name)) for name in FIGURES)
        return {name: float(value.value if isinstance(value, Extreme) else value) for name, value in found}

    def lines(self) -> dict[str, str]:
        """Return the report in words, by what it is about."""
        found = {
            "verdict": self.sentence,
            "trust": self.trust,
            "deepest": f"{self.depth.value:.3g} m below the middle of the hull, {self.depth.where()}"
            if self.depth.value > 0.0
            else "the middle of the hull never came over water",
            "wheel load": f"{100.0 * self.wheel_load.value:.0f} % of the weight at least, {self.wheel_load.where()} "
            f"(afloat below {100.0 * self.limits.wheel_load:.0f} %)",
            "slip": self._slip(),
            "freeboard": f"{self.freeboard.value:.3f} m at least, {self.freeboard.where()}"
            + (" (the deck is awash)" if self.freeboard.value < 0.0 else ""),
            "clearance": f"{self.clearance.value:.3f} m at least, {self.clearance.where()}"
            + (
                f"; the hull bore up to {100.0 * self.hull_load.value:.0f} % of the weight"
                if self.hull_load.value > 0.0
                else ""
            ),
            "drift": f"{abs(self.drift.value):.2f} m to the {'left' if self.drift.value > 0.0 else 'right'} of the "
            f"path at most, {self.drift.where()}",
            "members": "" if self.members is None else f"{self.members}",
        }
        return {name: text for name, text in found.items() if text}

    def _slip(self) -> str:
        if math.isnan(self.slip.value):
            return "the wheels never came to speed in contact with the soil"
        text = (
            f"none: the vehicle is at least {-100.0 * self.slip.value:.0f} % faster than the tread of its tyres"
            if self.slip.value < -0.005
            else "none: the vehicle is as fast as the tread of its tyres"
            if self.slip.value <= 0.005
            else f"{100.0 * self.slip.value:.0f} % at most (mean of the wheels in contact, from {self.at_speed:.3g} s "
            f"on, when they are at speed), {self.slip.where()}"
        )
        if self.wheel_slip.value > max(self.slip.value, 0.0) + 0.005:
            text += (
                f"; {100.0 * self.wheel_slip.value:.0f} % at the {self.slipping_wheel.replace('_', ' ')} wheel alone "
                f"(of those that bear {100.0 * GRIPS:.0f} % of the weight), {self.wheel_slip.where()}"
            )
        return text

    def __str__(self) -> str:
        """Return the report, a line each."""
        return "\n".join(f"{name:<11} {text}" for name, text in self.lines().items())


@checked
def ford_report(run: xr.Dataset, ford: Ford, limits: VerdictLimits | None = None) -> FordReport:
    """Report on a run through a ford, up to the instant at which the vehicle has crossed.

    Parameters
    ----------
    run : xarray.Dataset
        Result of `Ford.drive`, whole or up to where it broke or was stopped.
    ford : Ford
    limits : VerdictLimits, optional

    Raises
    ------
    ValueError
        If the run is no result of `Ford.drive`: it lacks what a verdict (`exumob.simulation.verdict.judge`) or this
        report needs.
    """
    limits = VerdictLimits() if limits is None else limits
    if missing := [name for name in NEEDED if name not in run]:
        raise ValueError(f"ford_report: the run has no {', '.join(missing)}; give the result of Ford.drive.")
    verdict = judge(run, limits, ford.vehicle)
    station = stations(run)
    members = _members(run, ford) if "member_position" in run else None
    across = np.flatnonzero(station - ford.overhangs[1] >= ford.edges[1])
    status = str(run.attrs.get("status", ""))
    if len(across):
        run = run.isel(time=slice(int(across[0]) + 1)).assign_attrs(status="completed")
        run.attrs.pop("cause", None)  # of a breakdown after it had crossed
        station = station[: int(across[0]) + 1]
        verdict = judge(run, limits, ford.vehicle)
    time = run["time"].values.astype(float)
    kind, since = _outcome(verdict, bool(len(across)), status, float(time[-1]))
    where = float(np.interp(since, time, station))

    def extreme(values: Array, pick: Callable[[Array], Any], counts: Flags | None = None) -> Extreme:
        values = np.where(np.isfinite(values) & (True if counts is None else counts), values, np.nan)
        if np.isnan(values).all():
            return Extreme(math.nan, math.nan, math.nan)
        n = int(pick(values))
        return Extreme(float(values[n]), float(station[n]), float(time[n]))

    with np.errstate(invalid="ignore"):
        slip = run["slip_ratio"].mean("wheel").values
    at_speed = time >= ford.maneuver.ramp_time
    of_wheels = run["slip_ratio"].sel(wheel=list(WHEELS)).transpose("time", "wheel").values.astype(float)
    grips = (wheel_load_shares(run, ford.vehicle) >= GRIPS) & np.isfinite(of_wheels)
    gripping = np.where(grips, of_wheels, -np.inf)
    wheel_slip = extreme(gripping.max(axis=1), np.nanargmax, at_speed)
    on_hull = run["hull_load_share"].values if "hull_load_share" in run else np.zeros(len(time))
    return FordReport(
        kind,
        _sentence(kind, since, where, verdict, ford, run, station, bool(len(across))),
        since,
        where,
        float(time[-1]) if len(across) else math.nan,
        extreme(run["position"].sel(body="hull", axis="y").values, lambda values: np.nanargmax(np.abs(values))),
        extreme(run["water_depth"].values, np.nanargmax),
        extreme(wheel_load_share(run, ford.vehicle), np.nanargmin),
        extreme(slip, np.nanargmax, at_speed),
        wheel_slip,
        "" if math.isnan(wheel_slip.value) else WHEELS[int(gripping[time == wheel_slip.time][0].argmax())],
        ford.maneuver.ramp_time,
        extreme(_freeboard(run, ford), np.nanargmin),
        extreme(run["keel_clearance"].values, np.nanargmin),
        extreme(on_hull, np.nanargmax),
        str(run.attrs.get("trust", "")),
        len(time) - 1,
        limits,
        members,
    )


def stations(run: xr.Dataset) -> Array:
    """Station of the middle between the wheels at each instant [m], shape (n,)."""
    return np.asarray(run["position"].sel(axis="x").values[:, 1:].mean(axis=1), float)


def member_stations(run: xr.Dataset, ford: Ford) -> Array:
    """Station of the middle between the wheels of each member at each instant [m], shape (members, n)."""
    ahead = ford.vehicle.hull_origin[0] * np.cos(run["member_yaw"].values)
    return np.asarray(run["member_position"].sel(axis="x").values - ahead, float)


def _members(run: xr.Dataset, ford: Ford) -> MemberCrossings:
    time, drift = run["time"].values.astype(float), run["member_position"].sel(axis="y").values
    out, most = np.full(len(drift), np.nan), np.zeros(len(drift))
    for n, station in enumerate(member_stations(run, ford)):
        across = np.flatnonzero(station - ford.overhangs[1] >= ford.edges[1])
        until = int(across[0]) + 1 if len(across) else len(time)
        if len(across):
            out[n] = time[across[0]]
        known = drift[n, :until][np.isfinite(drift[n, :until])]
        if len(known):
            most[n] = known[np.argmax(np.abs(known))]
    return MemberCrossings(out, most)


def _outcome(verdict: Verdict, across: bool, status: str, end: float) -> tuple[str, float]:
    """Kind of a report, and its time [s]."""
    for found in verdict.conditions:
        if found.kind in LOST or (found.lasted and not across):
            return found.kind, found.since
    if across:
        return "crosses", end
    if verdict.kind in ("broke down", "too short to tell"):
        return verdict.kind, end
    return ("stopped" if status.startswith("interrupted") else "too slow"), end


def _sentence(
    kind: str, since: float, where: float, verdict: Verdict, ford: Ford, run: xr.Dataset, station: Array, out: bool
) -> str:  # fmt: skip
    """Write the answer in words."""
    time = run["time"].values.astype(float)

    def at(instant: float) -> float:
        return float(np.interp(instant, time, station))

    meanwhile = []
    for found in verdict.conditions:
        if found.kind == kind:
            continue
        until = float(time[-1]) if found.lasted else found.until
        measured = f" ({found.measured})" if found.measured else ""
        meanwhile.append(
            f"{found.kind} from station {at(found.since):.2f} to {at(until):.2f} m, {found.since:.2f} to {until:.2f} s"
            f"{measured}"
        )
    if kind == "crosses":
        text = f"crosses: all of it is past the far edge after {since:.2f} s"
        speed = ford.way / since if since > 0.0 else 0.0
        text += f", at {speed:.2f} m/s on average ({100.0 * speed / ford.tread_speed:.0f} % of the speed of its tyres)"
        return "; ".join([text, *(f"on the way {one}" for one in meanwhile)])
    text = f"does not cross: {BEFALLEN[kind]}"
    if kind == "too slow":
        speed = float(run["forward_velocity"].values[-1])
        text += f" at {speed:.2f} m/s when its {since:.4g} s are over, at station {where:.2f} m; give it more time"
    else:
        text += f" at station {where:.2f} m, from {since:.2f} s on"
        measured = next((found.measured for found in verdict.conditions if found.kind == kind), "")
        text += f" ({measured})" if measured else ""
    if out:
        text += f"; the run came out on the far bank all the same, after {time[-1]:.2f} s"
    return "; ".join([text, *(f"also {one}" for one in meanwhile)])


def _freeboard(run: xr.Dataset, ford: Ford) -> Array:
    """Height of the lowest corner of the hull's upper edge above the still water [m], shape (n,)."""
    hull = ford.vehicle.hull
    middle, top = hull.center_x - hull.center_of_mass_x, hull.height + hull.ground_clearance
    x = middle + 0.5 * hull.length * np.array([1.0, 1.0, -1.0, -1.0])
    y = 0.5 * hull.width * np.array([1.0, -1.0, 1.0, -1.0])
    z = top - hull.center_of_mass_height
    pitch, roll = (run[name].sel(body="hull").values[:, None].astype(float) for name in ("pitch", "roll"))
    upward = -np.sin(pitch) * x + np.cos(pitch) * (np.sin(roll) * y + np.cos(roll) * z)
    height = run["position"].sel(body="hull", axis="z").values[:, None] + upward
    return np.asarray(height.min(axis=1) - ford.level)
