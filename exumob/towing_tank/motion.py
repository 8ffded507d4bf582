"""Prescribed motion of a vehicle: towing-tank and planar-motion tests, as in ship hydrodynamics.

The carriage goes along the tank, world x. Angles and oscillations are those of the tests named in ITTC Recommended
Procedure 7.5-02-06-02 (captive model tests): oblique towing, circular motion, pure sway, pure yaw, and hull heave and
pitch over wheels that stay on the ground.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Protocol

import numpy as np

from exumob.driving.maneuver import (
    RAMP_TIME,
    STEERING_ANGLE,
    WHEEL_SPEED,
    FeedbackManeuver,
    Maneuver,
    smooth_step,
)
from exumob.flow.poses import Poses
from exumob.support.arrays import Array
from exumob.support.declared import Declared
from exumob.support.quantities import Quantity
from exumob.support.rotations import about_y, about_z
from exumob.vehicle.parameters import Motion, Vehicle
from exumob.water.conditions import Water

SPEED = Quantity("m/s", at_least=-20.0, at_most=20.0)
"""Speed of the carriage"""
TURN = Quantity("rad", at_least=-math.pi, at_most=math.pi)
"""Angle of the hull to its course"""
YAW_RATE = Quantity("rad/s", at_least=-20.0, at_most=20.0)
"""Turning of course and heading"""
AMPLITUDE = Quantity("m", at_least=-100.0, at_most=100.0, plausible=(-5.0, 5.0))
"""Sideways or vertical motion"""
FREQUENCY = Quantity("Hz", at_least=1e-4, at_most=100.0)
"""Of an oscillation"""
NODES, WEIGHTS = np.polynomial.legendre.leggauss(24)


class PrescribedMotion(Protocol):
    """A motion as `captive_run` needs it: where the five bodies are at any time, and how they move.

    Velocities must be the derivatives of positions and rotations (they are checked), and the vehicle should start with
    the speed of the current: the water around it is then undisturbed. An attribute ``parameters`` (a dict) or being a
    dataclass puts a motion's numbers into the result.
    """

    def poses(self, vehicle: Vehicle, water: Water, time: float) -> Poses:
        """Poses of the five bodies, order of `exumob.vehicle.motion.BODIES`, world axes, at a time >= 0 [s].

        The hull's origin is its centre of mass; a wheel's frame steers but does not spin, its origin is its centre.
        """


@dataclass(frozen=True)
class CaptiveMotion(Declared):
    """A vehicle towed along the tank, drifting, turning, steering, oscillating; everything starts C2-smoothly.

    The vehicle starts afloat in the current, so that the flow starts undisturbed, and within `ramp_time` a quintic
    takes it to its prescribed motion; oscillations grow with the same quintic. With ``speed = 0`` it ends up held in
    the current. The hull's heading is ``-drift_angle`` from the start, so that the carriage goes along world x.

    Raises
    ------
    ValueError
        If a value is not finite or outside its range, or `driver` and a steering or wheel speed of its own are given.
    """

    speed: Annotated[float, SPEED] = 1.0
    """Speed of the hull's centre of mass over ground [m/s]"""
    drift_angle: Annotated[float, TURN] = 0.0
    """Course less heading [rad]; positive: the vehicle slips to its left, so that the water meets its left side"""
    yaw_rate: Annotated[float, YAW_RATE] = 0.0
    """Yaw rate [rad/s]; positive turns left; the course turns with the heading, so the path becomes a circle"""
    wheel_speed: Annotated[float, WHEEL_SPEED] = 0.0
    """Speed of the four wheels about their axles [rad/s], positive rolls forward"""
    steering: Annotated[float, STEERING_ANGLE] = 0.0
    """Mean front-wheel angle [rad], positive to the left"""
    steering_amplitude: Annotated[float, STEERING_ANGLE] = 0.0
    """Amplitude of the oscillation about `steering` [rad]"""
    steering_frequency: Annotated[float, FREQUENCY] = 0.5
    """Frequency of that oscillation [Hz]"""
    sway_amplitude: Annotated[float, AMPLITUDE] = 0.0
    """Amplitude of the sideways motion, sin(2 pi frequency t) [m]"""
    yaw_amplitude: Annotated[float, STEERING_ANGLE] = 0.0
    """Amplitude of the heading, cos(2 pi frequency t) [rad]. The pure-yaw test, heading along the path, has
    yaw_amplitude = 2 pi frequency sway_amplitude / speed (small angles)"""
    heave_amplitude: Annotated[float, AMPLITUDE] = 0.0
    """Amplitude of the hull's heave over the standing wheels, sin(2 pi frequency t) [m]"""
    pitch_amplitude: Annotated[float, STEERING_ANGLE] = 0.0
    """Amplitude of the hull's pitch about its centre of mass, sin(2 pi frequency t), bow down positive [rad]"""
    frequency: Annotated[float, FREQUENCY] = 0.5
    """Frequency of sway, yaw, heave and pitch [Hz]"""
    heave: Annotated[float, AMPLITUDE] = 0.0
    """Constant rise of the hull over ride height [m]"""
    pitch: Annotated[float, STEERING_ANGLE] = 0.0
    """Constant trim of the hull, bow down positive [rad]"""
    ramp_time: Annotated[float, RAMP_TIME] = 1.0
    """Time from drifting with the current to the prescribed motion [s]"""
    driver: Maneuver | None = None
    """A maneuver that steers and spins the wheels instead of `steering` and `wheel_speed`"""

    def _check(self) -> None:
        if self.driver is not None and not (callable(self.driver.steering) and callable(self.driver.wheel_speed)):
            raise ValueError(
                f"CaptiveMotion.driver = {type(self.driver).__name__} is no maneuver: its steering and wheel_speed "
                "must be functions of time; use lane_change(), say."
            )
        if isinstance(self.driver, FeedbackManeuver):
            raise ValueError(
                f"CaptiveMotion.driver = {type(self.driver).__name__} answers to the motion of a vehicle that drives; "
                "on a prescribed path use a maneuver that is a function of time, as lane_change()."
            )
        if self.driver is not None and (self.steering or self.steering_amplitude or self.wheel_speed):
            raise ValueError(
                "CaptiveMotion.driver steers and spins the wheels; leave steering, steering_amplitude and wheel_speed "
                "at 0, or leave the driver out."
            )

    def poses(self, vehicle: Vehicle, water: Water, time: float) -> Poses:
        """Poses of the five bodies, world axes, at a time [s]; see `PrescribedMotion`."""
        place, velocity = self._path(water, time)
        heading, yaw_rate = self.heading(time)
        rise, rise_rate = self._oscillation(self.heave_amplitude, time)
        tilt, tilt_rate = self._oscillation(self.pitch_amplitude, time)
        turn = about_z(heading)
        hull = np.array([*place, vehicle.hull.center_of_mass_height])
        arms = (vehicle.wheel_centers - vehicle.hull_origin) @ turn.T
        moving, turning = np.array([*velocity, 0.0]), np.array([0.0, 0.0, yaw_rate])
        left, right = self._steering(vehicle, time)
        angles, rates = np.array([left[0], right[0], 0.0, 0.0]), np.array([left[1], right[1], 0.0, 0.0])

        position = np.vstack([hull + np.array([0.0, 0.0, self.heave + rise]), hull + arms])
        rotation = np.array([turn @ about_y(self.pitch + tilt), *(turn @ about_z(angle) for angle in angles)])
        velocities = np.vstack([moving + np.array([0.0, 0.0, rise_rate]), moving + np.cross(turning, arms)])
        angular = np.tile(turning, (5, 1))
        angular[0] += tilt_rate * turn[:, 1]
        angular[1:, 2] += rates
        spin = np.array([0.0, *[self._wheel_speed(time)] * 4])
        return Poses(position, rotation, velocities, angular, spin)

    def heading(self, time: float) -> tuple[float, float]:
        """Angle of the hull to world x [rad], and its rate [rad/s]."""
        course, rate = self._course(time)
        share, growth, _ = self._share(time)
        omega = 2.0 * math.pi * self.frequency
        c, s = math.cos(omega * time), math.sin(omega * time)
        swing, swing_rate = self.yaw_amplitude * share * c, self.yaw_amplitude * (growth * c - share * omega * s)
        return course - self.drift_angle + swing, rate + swing_rate

    def _share(self, time: float) -> Motion:
        """Part of the prescribed motion reached, with its rate and acceleration."""
        s, ds, dds = smooth_step(time / self.ramp_time)
        return s, ds / self.ramp_time, dds / self.ramp_time**2

    def _grown(self, time: float) -> float:
        """Integral of the share [s]."""
        x = min(max(time / self.ramp_time, 0.0), 1.0)
        return self.ramp_time * x**4 * (2.5 - 3.0 * x + x * x) + max(time - self.ramp_time, 0.0)

    def _course(self, time: float) -> tuple[float, float]:
        return self.yaw_rate * self._grown(time), self.yaw_rate * self._share(time)[0]

    def _path(self, water: Water, time: float) -> tuple[Array, Array]:
        """Place of the hull's centre of mass over ground [m] and its velocity [m/s], each of shape (2,)."""
        share, _, _ = self._share(time)
        current = water.velocity[:2]
        course, course_rate = self._course(time)
        ahead, left = np.array([math.cos(course), math.sin(course)]), np.array([-math.sin(course), math.cos(course)])
        sway, sway_rate = self._oscillation(self.sway_amplitude, time)
        place = current * (time - self._grown(time)) + self.speed * self._towed(time) + sway * left
        velocity = (1.0 - share) * current + self.speed * share * ahead + sway_rate * left - sway * course_rate * ahead
        return place, velocity

    def _towed(self, time: float) -> Array:
        """Integral of share times course direction [s], shape (2,): quadrature in the ramp, closed form after it."""
        end = min(max(time, 0.0), self.ramp_time)
        times = 0.5 * end * (NODES + 1.0)
        shares = [self._share(t)[0] for t in times]
        courses = np.array([self._course(t)[0] for t in times])
        way = 0.5 * end * np.array([WEIGHTS @ (shares * np.cos(courses)), WEIGHTS @ (shares * np.sin(courses))])
        if time > end:
            before, now = self._course(end)[0], self._course(time)[0]
            half = 0.5 * (now - before)
            chord = (time - end) * (math.sin(half) / half if abs(half) > 1e-12 else 1.0)
            way = way + chord * np.array([math.cos(before + half), math.sin(before + half)])
        return way

    def _oscillation(self, amplitude: float, time: float) -> tuple[float, float]:
        if amplitude == 0.0:
            return 0.0, 0.0
        share, growth, _ = self._share(time)
        omega = 2.0 * math.pi * self.frequency
        s, c = math.sin(omega * time), math.cos(omega * time)
        return amplitude * share * s, amplitude * (growth * s + share * omega * c)

    def _steering(self, vehicle: Vehicle, time: float) -> tuple[Motion, Motion]:
        if self.driver is not None:
            return vehicle.steering_angles(self.driver.steering(time))
        share, growth, _ = self._share(time)
        omega = 2.0 * math.pi * self.steering_frequency
        s, c = math.sin(omega * time), math.cos(omega * time)
        angle = self.steering + self.steering_amplitude * s
        rate = growth * angle + share * self.steering_amplitude * omega * c
        return vehicle.steering_angles((share * angle, rate, 0.0))

    def _wheel_speed(self, time: float) -> float:
        if self.driver is not None:
            return self.driver.wheel_speed(time)[0]
        return self.wheel_speed * self._share(time)[0]
