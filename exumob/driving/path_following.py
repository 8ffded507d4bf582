"""Following a path: Stanley's steering law as a maneuver with feedback, whose driver looks where the vehicle is.

Hoffmann, Tomlin, Montemerlo & Thrun, Autonomous automobile trajectory tracking for off-road driving (ACC 2007): the
front wheels are turned by the heading error and by an angle that grows with the distance of the front axle from the
path. Two terms are added to it: damping of the yaw rate (from the same paper) and, for a current from the side, the
integral of the distance.

The steering constraint of the multibody model needs angles with two derivatives. So the driver plans: every
`PathFollowing.control_step` a quintic begins from the angle, rate and acceleration that the wheels have, and ends at
rest at the angle wanted, `response_time` later.
"""

from __future__ import annotations

import logging
import math
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
import xarray as xr

from exumob.driving.maneuver import RAMP_TIME, ramp, smooth_step
from exumob.support.arrays import Array
from exumob.support.declared import Declared, checked
from exumob.support.quantities import WHEEL_SPEED, Quantity
from exumob.vehicle.motion import BodyStates
from exumob.vehicle.parameters import Motion, Vehicle
from exumob.vehicle.start_pose import StartPose

logger = logging.getLogger(__name__)

SHARPEST = math.radians(60.0)
"""Largest turn of a path at a waypoint [rad]."""
REACH = 2.0
"""Length of the path before and behind the last nearest point in which the next one is sought [m]."""
REMOTE = 10.0
"""Distance of the path from the start beyond which it is taken for one in other coordinates [m], [wheelbases]."""
ENDLESS = 50.0
"""Length of a path over the way that a run can drive beyond which it is taken for one in another unit [-]."""
INTEGRAL_LIMIT = math.radians(15.0)
"""Limit of the steering angle that the integral of the distance may ask for [rad] (against wind-up)."""


Point = tuple[float, float]
"""World x, y [m]."""
PLACE = Quantity("m", at_least=-1e8, at_most=1e8)
"""World coordinate"""


@checked
def lane_shift(
    offset: Annotated[float, PLACE] = 0.5,
    start: Annotated[float, Quantity("m", at_least=0.0, at_most=1e6)] = 1.0,
    length: Annotated[float, Quantity("m", above=1e-3, at_most=1e6)] = 2.5,
    end: Annotated[float, PLACE] = 20.0,
) -> tuple[Point, ...]:
    """Return waypoints of a lane change: straight ahead, to the left by `offset` on a quintic, straight on.

    Parameters
    ----------
    offset : float
        Distance between the lanes [m]; negative: to the right.
    start, length : float
        Where the change begins, and its length along x [m].
    end : float
        Where the path ends [m].
    """
    if start + length > end:
        raise ValueError(f"lane_shift.end = {end:g} m must be at least start + length = {start + length:g} m.")
    between = start + length * np.linspace(0.0, 1.0, 41)
    curve = [(float(x), offset * smooth_step((x - start) / length)[0]) for x in between]
    return ((-1.0, 0.0), *curve, (end, offset))


@dataclass(frozen=True)
class PathFollowing(Declared):
    """Wheel speed ramped up; steering by Stanley's law along waypoints.

    The steering angle wanted, positive to the left, is
    - psi - arctan(gain e / (v + softening_speed)) - yaw_damping r - integral_gain (integral of e)
    with the heading error psi (heading of the vehicle minus that of the path), the distance e of the front axle to the
    left of the path, its speed v and the yaw rate r.
    """

    waypoints: Annotated[tuple[Point, ...], PLACE] = lane_shift()
    """World x, y, at least two points; the path must pass near the start of the run. Before the first and
    after the last the path goes straight on. The heading wanted turns from the middle of one piece to the middle of the
    next: place points so close that a bend is round"""
    speed: Annotated[float, WHEEL_SPEED] = 10.0
    """Final wheel speed"""
    ramp_time: Annotated[float, RAMP_TIME] = 1.0
    """Time from the first to the final wheel speed"""
    gain: Annotated[float, Quantity("1/s", at_least=0.0, at_most=100.0)] = 1.0
    """Speed of the approach to the path over the distance from it"""
    softening_speed: Annotated[float, Quantity("m/s", above=0.0, at_most=100.0)] = 0.2
    """Added to the speed, it keeps the steering calm at low speed"""
    yaw_damping: Annotated[float, Quantity("s", at_least=0.0, at_most=10.0)] = 0.1
    """Steering angle over yaw rate"""
    integral_gain: Annotated[float, Quantity("rad/(m s)", at_least=0.0, at_most=100.0)] = 0.0
    """Steering angle over the integral of the distance"""
    max_steering: Annotated[float, Quantity("rad", above=0.0, at_most=math.radians(80.0))] = math.radians(30.0)
    """Largest steering angle"""
    max_rate: Annotated[float, Quantity("rad/s", above=0.0, at_most=1e3)] = 2.0
    """Peak rate of a turn of the wheels from rest to rest; one that begins in motion may go half faster"""
    control_step: Annotated[float, Quantity("s", at_least=1e-4, at_most=10.0)] = 0.02
    """Interval at which the driver looks at the vehicle"""
    response_time: Annotated[float, Quantity("s", at_least=1e-3, at_most=10.0)] = 0.15
    """Time from an angle wanted to the angle reached"""
    start_speed: Annotated[float, WHEEL_SPEED] = 0.0
    """Wheel speed at time 0: a vehicle that starts rolling"""

    def _check(self) -> None:
        points = np.asarray(self.waypoints, float)
        if len(points) < 2:
            raise ValueError(f"PathFollowing.waypoints has {len(points)} point(s) (x, y); give two at least.")
        if (np.hypot(*np.diff(points, axis=0).T) < 1e-6).any():
            raise ValueError("PathFollowing.waypoints: two points in a row coincide; leave one of them out.")
        step = np.diff(points, axis=0)
        bend = np.arctan2(step[:-1, 0] * step[1:, 1] - step[:-1, 1] * step[1:, 0], (step[:-1] * step[1:]).sum(axis=1))
        if len(bend) and np.abs(bend).max() > SHARPEST:
            n = int(np.abs(bend).argmax())
            raise ValueError(
                f"PathFollowing.waypoints: a turn of {math.degrees(abs(bend[n])):.0f} degrees at point {n + 2}, "
                f"more than {math.degrees(SHARPEST):.0f}; round the corner with more points."
            )
        if self.control_step > 0.5 * self.response_time:
            raise ValueError(
                f"PathFollowing.control_step = {self.control_step} s must be at most half of response_time = "
                f"{self.response_time} s; look more often."
            )

    def steering(self, time: float) -> Motion:
        """Return the angle without a driver: straight ahead (a run asks for a `driver`)."""
        return 0.0, 0.0, 0.0

    def wheel_speed(self, time: float) -> Motion:
        """Return the spin of all wheels [rad/s] and its two derivatives."""
        return ramp(time, self.ramp_time, self.speed, self.start_speed)

    def driver(self, vehicle: Vehicle) -> StanleyDriver:
        """Return a driver who follows the path with this vehicle, for one run."""
        return StanleyDriver(self)

    def check_start(self, vehicle: Vehicle, start: StartPose | None = None) -> None:
        """Refuse a path that is far from where a run of this vehicle starts, by default at the world's origin.

        Raises
        ------
        ValueError
            If no piece of the path comes near the start.
        """
        pose = StartPose() if start is None else start
        x, y = (float(place) for place in pose.to_world(vehicle.wheel_centers[:2, :2].mean(axis=0)))
        apart, nearest = _Polyline(self.waypoints).distance_of_pieces(x, y)
        most = REMOTE * max(1.0, vehicle.wheelbase)
        if apart > most:
            raise ValueError(
                f"PathFollowing.waypoints: the path comes no nearer to the front axle at the start, ({x:.3g}, {y:.3g}) "
                f"m, than {apart:.6g} m, at ({nearest[0]:.9g}, {nearest[1]:.9g}) m; {most:g} m at most. A run starts "
                f"at ({pose.x:g}, {pose.y:g}) m: subtract the place of the start from map coordinates, give "
                "simulate(start=...), or begin the path there."
            )

    def warn_of_length(self, reach: float) -> None:
        """Warn of a path of which a run reaches so little that its waypoints may be in another unit.

        Parameters
        ----------
        reach : float
            Way that the run can drive at most [m].
        """
        length = float(np.hypot(*np.diff(np.asarray(self.waypoints, float), axis=0).T).sum())
        if length > ENDLESS * max(reach, 1.0):
            logger.warning(
                "PathFollowing.waypoints: the path is %.6g m long, and the run reaches %.2g m of it at most; waypoints "
                "are in metres. If they are in mm, divide them by 1000; if they are right, only their beginning "
                "counts.", length, reach,
            )  # fmt: skip

    def deviation(self, run: xr.Dataset, body: str = "hull") -> xr.DataArray:
        """Compute the distance of a body's origin to the left of the path [m], dims (time,)."""
        places = run["position"].sel(body=body, axis=["x", "y"]).values
        path, arc, found = _Polyline(self.waypoints), None, []
        for x, y in places:
            distance, _, arc = path.nearest(x, y, arc)
            found.append(distance)
        return xr.DataArray(
            found, {"time": run["time"]}, ("time",),
            attrs={"units": "m", "long_name": f"distance of the {body} to the left of the path"},
        )  # fmt: skip


class StanleyDriver:
    """The driver of one run along the path of a `PathFollowing`."""

    def __init__(self, maneuver: PathFollowing) -> None:
        """Begin with the wheels straight."""
        self.maneuver = maneuver
        self._path = _Polyline(maneuver.waypoints)
        self._start = self._end = 0.0  # of the turn planned last [s]
        self._quintic = np.zeros(6)  # angle over the time since its start, lowest power first
        self._wanted = 0.0
        self._integral = 0.0  # of the distance [m s]
        self._seen: float | None = None
        self._arc: float | None = None  # way along the path [m]

    def steering(self, time: float) -> Motion:
        """Return the mean front-wheel angle [rad], its rate and acceleration, as planned last."""
        if time >= self._end:
            return self._wanted, 0.0, 0.0
        c0, c1, c2, c3, c4, c5 = self._quintic
        t = time - self._start
        return (
            c0 + t * (c1 + t * (c2 + t * (c3 + t * (c4 + t * c5)))),
            c1 + t * (2.0 * c2 + t * (3.0 * c3 + t * (4.0 * c4 + t * 5.0 * c5))),
            2.0 * c2 + t * (6.0 * c3 + t * (12.0 * c4 + t * 20.0 * c5)),
        )

    def wheel_speed(self, time: float) -> Motion:
        """Return the spin of all wheels [rad/s] and its two derivatives."""
        return self.maneuver.wheel_speed(time)

    def observe(self, states: BodyStates) -> None:
        """Look at the vehicle (n = 1) and plan anew."""
        law, time = self.maneuver, float(states.time[0])
        x, y = states.position[0, 1:3, :2].mean(axis=0)  # front axle
        ahead = states.rotation[0, 0, :2, 0] / np.hypot(*states.rotation[0, 0, :2, 0])
        distance, direction, self._arc = self._path.nearest(x, y, self._arc)
        heading = math.atan2(ahead[1], ahead[0])
        error = (heading - direction + math.pi) % (2.0 * math.pi) - math.pi
        speed = max(float(states.velocity[0, 1:3, :2].mean(axis=0) @ ahead), 0.0)
        if self._seen is not None:
            self._integral += (time - self._seen) * distance
        self._seen = time
        if law.integral_gain > 0.0:
            most = INTEGRAL_LIMIT / law.integral_gain
            self._integral = min(max(self._integral, -most), most)
        wanted = (
            -error
            - math.atan2(law.gain * distance, speed + law.softening_speed)
            - law.yaw_damping * float(states.angular_velocity[0, 0, 2])
            - law.integral_gain * self._integral
        )
        most = 0.98 * law.max_steering  # a quintic that begins in motion overshoots a little
        self._turn_to(min(max(wanted, -most), most), time)

    def _turn_to(self, wanted: float, time: float) -> None:
        """Quintic from the present motion to rest at the angle wanted."""
        angle, rate, acceleration = self.steering(time)
        span = self.maneuver.response_time
        most = self.maneuver.max_rate * span / 1.875  # peak rate of a quintic from rest to rest
        self._wanted = angle + min(max(wanted - angle, -most), most)
        c0, c1, c2 = angle, rate, 0.5 * acceleration
        rest = self._wanted - (c0 + span * (c1 + span * c2))
        slope, bend = -(c1 + 2.0 * span * c2), -2.0 * c2
        c3 = (10.0 * rest - 4.0 * span * slope + 0.5 * span**2 * bend) / span**3
        c4 = (-15.0 * rest + 7.0 * span * slope - span**2 * bend) / span**4
        c5 = (6.0 * rest - 3.0 * span * slope + 0.5 * span**2 * bend) / span**5
        self._start, self._end = time, time + span
        self._quintic[:] = c0, c1, c2, c3, c4, c5

    def save(self) -> dict[str, Any]:
        """Return all that the next look depends on."""
        return {
            "start": self._start, "end": self._end, "quintic": self._quintic.copy(), "wanted": self._wanted,
            "integral": self._integral, "seen": self._seen, "arc": self._arc,
        }  # fmt: skip

    def restore(self, saved: dict[str, Any]) -> None:
        """Return to a state given by `save`."""
        self._start, self._end = saved["start"], saved["end"]
        self._quintic[:] = saved["quintic"]
        self._wanted, self._integral, self._seen = saved["wanted"], saved["integral"], saved["seen"]
        self._arc = saved["arc"]


class _Polyline:
    """Straight pieces between waypoints; the heading turns from the middle of one to the middle of the next."""

    def __init__(self, waypoints: tuple[Point, ...]) -> None:
        points = np.array(waypoints, float)
        step = np.diff(points, axis=0)
        self.length = np.hypot(*step.T)
        self.start, self.along = points[:-1], step / self.length[:, None]
        self.arc = np.concatenate([[0.0], np.cumsum(self.length)])
        self.heading: Array = np.unwrap(np.arctan2(step[:, 1], step[:, 0]))
        self.middle = 0.5 * (self.arc[:-1] + self.arc[1:])

    def distance_of_pieces(self, x: float, y: float) -> tuple[float, Array]:
        """Distance from the pieces between waypoints [m], which end at the first and the last, and where it is."""
        offset = np.array([x, y]) - self.start
        feet = self.start + np.clip((offset * self.along).sum(axis=1), 0.0, self.length)[:, None] * self.along
        apart = np.hypot(*(np.array([x, y]) - feet).T)
        n = int(np.argmin(apart))
        return float(apart[n]), feet[n]

    def nearest(self, x: float, y: float, last: float | None = None) -> tuple[float, float, float]:
        """Distance to the left of the path [m], the path's heading there [rad], and the way along the path [m].

        With `last`, the way along the path a moment ago, only `REACH` about it is looked at: a path may cross itself.
        """
        offset = np.array([x, y]) - self.start
        low, high = np.zeros(len(self.length)), self.length.copy()
        low[0], high[-1] = -np.inf, np.inf  # straight on at both ends
        if last is not None:
            low = np.maximum(low, last - REACH - self.arc[:-1])
            high = np.minimum(high, last + REACH - self.arc[:-1])
        foot = np.clip((offset * self.along).sum(axis=1), low, np.maximum(low, high))
        off = offset - foot[:, None] * self.along
        squared = np.where(low <= high, (off**2).sum(axis=1), np.inf)
        n = int(np.argmin(squared))
        left = self.along[n, 0] * offset[n, 1] - self.along[n, 1] * offset[n, 0]
        distance = math.copysign(float(np.hypot(*off[n])), left)
        way = float(self.arc[n] + foot[n])
        return distance, float(np.interp(way, self.middle, self.heading)), way
