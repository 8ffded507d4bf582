"""Maneuvers: steering angle and wheel speed over time, with two derivatives each.

The multibody model prescribes both as kinematic constraints (paper Eq. 6), so they must be smooth: C2, starting with
zero angular acceleration (a sudden start means spin torques of hundreds of N m in the first step).
"""

from __future__ import annotations

import hashlib
import logging
import math
from dataclasses import dataclass
from typing import Annotated, Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import BSpline, make_interp_spline

from exumob.support.declared import Declared, checked
from exumob.support.quantities import STEERING_ANGLE, WHEEL_SPEED, Quantity
from exumob.vehicle.motion import BodyStates
from exumob.vehicle.parameters import Motion, Vehicle

logger = logging.getLogger(__name__)

SHORTEST = 1e-3
"""Shortest time of a ramp or of a steering period [s]: what is faster is a blow, not a maneuver."""
STEER = Quantity(
    "rad", at_least=STEERING_ANGLE.at_least, at_most=STEERING_ANGLE.at_most,
    remedy="the angle comes first; a wheel speed [rad/s] goes into the field `speed`.",
)  # fmt: skip
"""Angle of the front wheels that a maneuver asks for, beside a wheel speed for which it may be taken"""
RAMP_TIME = Quantity("s", at_least=SHORTEST, at_most=1e6)
"""Time of a ramp"""


class Maneuver(Protocol):
    """Steering and wheel speed as functions of time."""

    def steering(self, time: float) -> Motion:
        """Return the mean front-wheel angle [rad] (positive: left), its rate [rad/s] and acceleration [rad/s^2]."""

    def wheel_speed(self, time: float) -> Motion:
        """Return the spin of all four wheels [rad/s] (positive: forward) and its two derivatives."""


class Driver(Maneuver, Protocol):
    """A driver of one run, who looks at the vehicle as it goes."""

    def observe(self, states: BodyStates) -> None:
        """Look at the present state of the vehicle (n = 1).

        Steering and wheel speed may change from here on, without a jump.
        """

    def save(self) -> dict[str, Any]:
        """Return all that the next steps depend on: arrays, numbers and text by name, so that a file can hold it."""

    def restore(self, saved: dict[str, Any]) -> None:
        """Return to a state given by `save`."""


@runtime_checkable
class FeedbackManeuver(Maneuver, Protocol):
    """A maneuver whose steering answers to the motion of the vehicle (`exumob.driving.path_following`).

    To be resumed from a checkpoint it must be a dataclass, or hold its parameters in a dict `parameters`.
    """

    control_step: float
    """Interval at which the driver looks at the vehicle [s]"""
    max_steering: float
    """Largest steering angle that is ever asked for [rad]"""

    def driver(self, vehicle: Vehicle) -> Driver:
        """Return a driver for one run, who first looks at time 0."""


def smooth_step(x: float) -> Motion:
    """Return a quintic step from 0 (x <= 0) to 1 (x >= 1) and its two derivatives, which are 0 at both ends."""
    if x <= 0.0:
        return 0.0, 0.0, 0.0
    if x >= 1.0:
        return 1.0, 0.0, 0.0
    return (
        x**3 * (10.0 - 15.0 * x + 6.0 * x * x),
        30.0 * x * x * (1.0 - x) ** 2,
        60.0 * x * (1.0 - x) * (1.0 - 2.0 * x),
    )


def ramp(time: float, duration: float, final: float, start: float = 0.0) -> Motion:
    """Return a quintic ramp from `start` at time 0 to `final` at `duration` [s], with its two time derivatives."""
    s, d, dd = smooth_step(time / duration)
    rise = final - start
    return start + rise * s, rise * d / duration, rise * dd / duration**2


@dataclass(frozen=True)
class LaneChange(Declared):
    """The paper's single lane change (Fig. 5): wheel speed ramped up, then one sine period of steering.

    The sine is faded in and out by a quintic step over the first and last tenth of its period, so that the angle is C2
    everywhere; its peaks are untouched.
    """

    amplitude: Annotated[float, STEER] = math.radians(30.0)
    """Steering amplitude; positive turns left first, negative is the mirror case"""
    start: Annotated[float, Quantity("s", at_least=0.0, at_most=1e6)] = 2.0
    """Time at which the steering begins"""
    end: Annotated[float, Quantity("s", above=0.0, at_most=1e6)] = 5.5
    """Time at which the steering ends"""
    speed: Annotated[float, WHEEL_SPEED] = 10.0
    """Final wheel speed"""
    ramp_time: Annotated[float, RAMP_TIME] = 1.0
    """Time from the first to the final wheel speed"""
    start_speed: Annotated[float, WHEEL_SPEED] = 0.0
    """Wheel speed at time 0: a vehicle that starts rolling"""

    def _check(self) -> None:
        if self.end - self.start < SHORTEST:
            raise ValueError(
                f"LaneChange.start = {self.start:g} s must be {SHORTEST:g} s at least before end = {self.end:g} s; "
                "move one of them."
            )

    def steering(self, time: float) -> Motion:
        """Return the mean front-wheel angle [rad], its rate and acceleration."""
        period = self.end - self.start
        x = (time - self.start) / period
        if x <= 0.0 or x >= 1.0:
            return 0.0, 0.0, 0.0
        fade = 10.0
        w, dw, ddw = smooth_step(fade * min(x, 1.0 - x))
        side = 1.0 if x <= 0.5 else -1.0
        dw, ddw = side * fade * dw, fade**2 * ddw
        s, c = math.sin(2.0 * math.pi * x), math.cos(2.0 * math.pi * x)
        ds, dds = 2.0 * math.pi * c, -4.0 * math.pi**2 * s
        return (
            self.amplitude * w * s,
            self.amplitude * (dw * s + w * ds) / period,
            self.amplitude * (ddw * s + 2.0 * dw * ds + w * dds) / period**2,
        )

    def wheel_speed(self, time: float) -> Motion:
        """Return the spin of all wheels [rad/s] and its two derivatives."""
        return ramp(time, self.ramp_time, self.speed, self.start_speed)


@dataclass(frozen=True)
class ConstantSteer(Declared):
    """Wheel speed ramped up, then a steering angle ramped up and held: straight driving, circles, standing still."""

    angle: Annotated[float, STEER] = 0.0
    """Final steering angle"""
    speed: Annotated[float, WHEEL_SPEED] = 10.0
    """Final wheel speed; 0: the vehicle stands on locked wheels"""
    ramp_time: Annotated[float, RAMP_TIME] = 1.0
    """Time of the ramp of the wheel speed, and then of the ramp of the steering"""
    start_speed: Annotated[float, WHEEL_SPEED] = 0.0
    """Wheel speed at time 0: a vehicle that starts rolling"""

    def steering(self, time: float) -> Motion:
        """Return the mean front-wheel angle [rad], its rate and acceleration."""
        return ramp(time - self.ramp_time, self.ramp_time, self.angle)

    def wheel_speed(self, time: float) -> Motion:
        """Return the spin of all wheels [rad/s] and its two derivatives."""
        return ramp(time, self.ramp_time, self.speed, self.start_speed)


class Recorded:
    """Steering and wheel speed interpolated from recorded samples: quintic splines that start and end steady.

    At both ends the first and second derivatives are zero, so that the vehicle starts without a jolt.

    Parameters
    ----------
    time : array, shape (n,), n >= 4
        Instants of the samples [s], increasing from 0.
    steering : array, shape (n,)
        Mean front-wheel angle [rad].
    wheel_speed : array, shape (n,)
        Spin of the wheels [rad/s]; where it does not start at 0, the vehicle starts rolling.

    Raises
    ------
    ValueError
        If shapes differ, or times do not increase from 0.
    """

    @checked
    def __init__(
        self,
        time: Annotated[ArrayLike, Quantity("s", at_least=0.0, at_most=1e6, shape=("n",))],
        steering: Annotated[
            ArrayLike, Quantity("rad", at_least=-math.radians(80.0), at_most=math.radians(80.0), shape=("n",))
        ],
        wheel_speed: Annotated[ArrayLike, Quantity("rad/s", at_least=-1e4, at_most=1e4, shape=("n",))],
    ) -> None:
        """Fit the splines."""
        t, angle, speed = np.asarray(time), np.asarray(steering), np.asarray(wheel_speed)
        if len(t) < 4 or t.shape != angle.shape or t.shape != speed.shape:
            raise ValueError(
                f"Recorded: time {t.shape}, steering {angle.shape} and wheel_speed {speed.shape} must be equally long "
                "series of at least 4 samples."
            )
        if t[0] != 0.0 or (np.diff(t) <= 0.0).any():
            raise ValueError("Recorded.time must increase from 0 s; shift or sort the samples.")
        self._end = float(t[-1])
        self.parameters = {"time": t.tolist(), "steering": angle.tolist(), "wheel_speed": speed.tolist()}
        """The samples, as kept in results."""
        steady = [(1, 0.0), (2, 0.0)]
        self._angle, self._speed = (make_interp_spline(t, a, 5, bc_type=(steady, steady)) for a in (angle, speed))

        fine = np.linspace(0.0, self._end, 20 * len(t))
        for name, samples, spline in (("steering", angle, self._angle), ("wheel_speed", speed, self._speed)):
            between = spline(fine)
            overshoot = max(between.max() - samples.max(), samples.min() - between.min())
            if overshoot > 0.05 * np.ptp(samples):
                logger.warning(
                    "Recorded.%s: the smooth curve through the samples overshoots them by %.3g, over 5 %% of their "
                    "range; give more samples where they bend.", name, overshoot,
                )  # fmt: skip

    def __repr__(self) -> str:
        digest = hashlib.sha256(repr(self.parameters).encode()).hexdigest()[:16]
        return f"Recorded({len(self.parameters['time'])} samples, {digest})"

    def _motion(self, spline: BSpline, time: float) -> Motion:
        t = min(max(time, 0.0), self._end)
        inside = 0.0 <= time <= self._end
        return float(spline(t)), inside * float(spline(t, 1)), inside * float(spline(t, 2))

    def steering(self, time: float) -> Motion:
        """Return the mean front-wheel angle [rad], its rate and acceleration."""
        return self._motion(self._angle, time)

    def wheel_speed(self, time: float) -> Motion:
        """Return the spin of all wheels [rad/s] and its two derivatives."""
        return self._motion(self._speed, time)


def lane_change(
    amplitude: Annotated[float, STEERING_ANGLE] = math.radians(30.0), speed: Annotated[float, WHEEL_SPEED] = 10.0
) -> LaneChange:
    """Return the reference maneuver: 10 rad/s, one sine of 30 deg from 2.0 to 5.5 s (paper Fig. 5)."""
    return LaneChange(amplitude=amplitude, speed=speed)
