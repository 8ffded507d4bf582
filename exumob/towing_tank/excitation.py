"""Excitation: prescribed motions in which everything moves at once, from which the loads of the water are learnt.

In an `Excitation` the vehicle stands, starts, stops and reverses (steps of the speed), while speed, sideways speed, yaw
rate, heave, pitch, roll, sinkage of the wheels, slip and steering oscillate as orthogonal multisines
(`exumob.towing_tank.multisine`) within an `Envelope`. Depth, current and its direction over ground are those of the
water of the run and stay: the flow solver knows one level and one uniform current. The heading turns through the
current, and the speed through the water changes with that over ground: over a bed that slips the loads depend on
nothing else.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Annotated, NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from exumob.driving.maneuver import RAMP_TIME, smooth_step
from exumob.flow.poses import Poses
from exumob.support.arrays import Array
from exumob.support.declared import Declared
from exumob.support.quantities import Quantity
from exumob.support.rotations import about_x, about_y, about_z
from exumob.towing_tank.multisine import Multisine, shared_harmonics, small_peak
from exumob.vehicle.parameters import Vehicle
from exumob.water.conditions import Water

CHANNELS = ("speed", "sway", "yaw_rate", "slip", "steering", "heave", "pitch", "roll", "sinkage")
"""What moves, in the order of the signals; the first five are slower than the others."""
SLOW = 5
"""Number of the slower ones."""
MIRRORED = (1.0, -1.0, -1.0, 1.0, -1.0, 1.0, 1.0, -1.0, 1.0)
"""Signs of the channels in the mirrored motion."""
LEAST_MULTIPLES = 2
"""Sines that each channel has at least."""
OFFSET = 0.4
"""Part of half a range that a constant part may take at least; the multisine has the rest, or less where its rates
would be beyond those of the envelope: a hull that heaves by centimetres twice a second feels little but added mass."""
SPEED_SHARE = 0.25
"""Part of the range of speeds that the multisine takes; the steps have the rest."""
STANDING = 0.1
"""Share of the horizontal multisines while the vehicle stands."""
STEP_SHARE = 0.35
"""Part of the time of a level of the speed that the step to it takes."""
TABLE_STEP = 1e-3
"""Interval of the instants between which splines interpolate [s]."""
FREE_STEERING = 0.98
"""Part of the steering's limit that is used."""
FREE_STROKE = 0.8
"""Part of a suspension's travel beyond which the stroke bends towards the stop."""

RANGE_OF_SPEED = Quantity("m/s", at_least=-100.0, at_most=100.0, plausible=(-30.0, 30.0))
RANGE_OF_TURNING = Quantity("rad/s", at_least=-20.0, at_most=20.0)
RANGE_OF_HEIGHT = Quantity("m", at_least=-100.0, at_most=100.0, plausible=(-5.0, 5.0))
RANGE_OF_ANGLE = Quantity("rad", at_least=-1.2, at_most=1.2)
HIGHEST = Quantity("Hz", above=0.0, at_most=100.0)


@dataclass(frozen=True)
class Envelope(Declared):
    """Smallest and largest value of each quantity that an excitation moves, and how fast they change.

    Raises
    ------
    ValueError
        If a smallest value is above the largest.
    """

    speed: Annotated[tuple[float, float], RANGE_OF_SPEED]
    """Speed of the hull over ground along its heading; the smallest is below 0 for a vehicle that reverses"""
    sway: Annotated[tuple[float, float], RANGE_OF_SPEED]
    """Speed over ground to the left of the heading"""
    yaw_rate: Annotated[tuple[float, float], RANGE_OF_TURNING]
    """Turning to the left"""
    slip: Annotated[tuple[float, float], RANGE_OF_SPEED]
    """Speed of the tread less the speed over ground"""
    steering: Annotated[tuple[float, float], RANGE_OF_ANGLE]
    """Mean angle of the front wheels, positive to the left"""
    heave: Annotated[tuple[float, float], RANGE_OF_HEIGHT]
    """Hull's centre of mass above its design height"""
    pitch: Annotated[tuple[float, float], RANGE_OF_ANGLE]
    """Bow down positive"""
    roll: Annotated[tuple[float, float], RANGE_OF_ANGLE]
    """Right side down positive"""
    sinkage: Annotated[tuple[float, float], RANGE_OF_HEIGHT]
    """Wheels below the undisturbed ground; negative: lifted"""
    slow: Annotated[float, HIGHEST] = 1.0
    """Highest frequency of speed, sway, turning, slip and steering [Hz]"""
    fast: Annotated[float, HIGHEST] = 4.0
    """Highest frequency of heave, pitch, roll and sinkage [Hz]"""
    rates: Annotated[tuple[float, ...] | None, Quantity("1", above=0.0, at_most=1e4)] = None
    """Largest rates of the nine quantities, in the order of `CHANNELS`, in their units a second; None: no limit"""

    def _check(self) -> None:
        for name in CHANNELS:
            low, high = getattr(self, name)
            if low > high:
                raise ValueError(
                    f"Envelope.{name} = ({low:g}, {high:g}): the first is above the second; give the smaller one first."
                )
        if self.rates is not None and len(self.rates) != len(CHANNELS):
            raise ValueError(
                f"Envelope.rates has {len(self.rates)} values; give one for each of {', '.join(CHANNELS)}, or none."
            )

    @property
    def ranges(self) -> Array:
        """Smallest and largest value of the channels, shape (9, 2)."""
        return np.array([getattr(self, name) for name in CHANNELS])


@dataclass(frozen=True)
class Excitation(Declared):
    """A captive motion in which everything moves at once; it starts afloat in the current and C2-smoothly.

    Within `ramp_time` a quintic takes the vehicle from drifting with the current to its prescribed motion. Hull and
    wheels are prescribed: the wheels stand on the ground, deeper by the sinkage, and turn, lean and pitch with the hull
    as on pillars (those of wishbones lean a little less). Where a suspension would go beyond its stops the wheel leaves
    the ground.

    Raises
    ------
    ValueError
        If the run is too long for its frequencies, a level of the speed is outside the envelope, or there are
        not nine offsets.
    """

    envelope: Envelope
    """Ranges within which it moves"""
    speeds: tuple[Annotated[float, RANGE_OF_SPEED], ...]
    """Speeds over ground, one after the other, each for the same time [m/s]; 0: it stands"""
    duration: Annotated[float, Quantity("s", at_least=1e-2, at_most=1e4)] = 8.0
    """Of the whole motion [s]"""
    ramp_time: Annotated[float, RAMP_TIME] = 1.0
    """From drifting with the current to the prescribed motion [s]"""
    offsets: tuple[Annotated[float, Quantity("1", at_least=-1.0, at_most=1.0)], ...] = (0.0,) * len(CHANNELS)
    """Constant parts of the channels, over the largest that there may be [-]; that of the speed is not used"""
    turn: Annotated[int, Quantity("1", at_least=0, at_most=10**6)] = 0
    """Which channels have which harmonics (`exumob.towing_tank.multisine.shared_harmonics`)"""
    seed: Annotated[int, Quantity("1", at_least=0, at_most=2**31)] = 0
    """Draws the phases"""
    mirror: bool = False
    """Mirrored in the vehicle's plane of symmetry; the water is to be mirrored, too"""

    def _check(self) -> None:
        if len(self.offsets) != len(CHANNELS):
            raise ValueError(
                f"Excitation.offsets has {len(self.offsets)} values; give one for each of {', '.join(CHANNELS)}."
            )
        low, high = self.envelope.speed
        beyond = [speed for speed in self.speeds if not low - 1e-9 <= speed <= high + 1e-9]
        if beyond or not self.speeds:
            raise ValueError(
                f"Excitation.speeds = {self.speeds} must be one or more, all of {low:g} to {high:g} m/s "
                "(Envelope.speed); give others."
            )
        if self.ramp_time >= 0.9 * self.duration:
            raise ValueError(
                f"Excitation.ramp_time = {self.ramp_time:g} s leaves nothing of duration = {self.duration:g} s; give a "
                "longer one."
            )
        try:
            _harmonics(self.period, self.envelope.slow, self.envelope.fast, self.turn)
        except ValueError as error:
            raise ValueError(f"Excitation.duration = {self.duration:g} s: {error}") from None

    @property
    def period(self) -> float:
        """Time over which the multisines are orthogonal: all after the ramp [s]."""
        return self.duration - self.ramp_time

    def mirrored(self) -> Excitation:
        """Return the motion mirrored in the vehicle's plane of symmetry."""
        return replace(self, mirror=not self.mirror)

    def multisines(self) -> tuple[Multisine, ...]:
        """Return the signals of the channels, in the order of `CHANNELS`, each within -1 to 1."""
        return _signals(self.period, self.envelope.slow, self.envelope.fast, self.turn, self.seed)

    def highest_frequencies(self) -> tuple[float, float]:
        """Return the highest frequency of the slower channels, and that of the others [Hz].

        They are above those of the envelope where the run is too short to give each channel its own sines within.
        """
        highest = [max(one.harmonics) / self.period for one in self.multisines()]
        return max(highest[:SLOW]), max(highest[SLOW:])

    def values(self, time: Array) -> Array:
        """Return the channels as prescribed, whatever the ramp makes of them; shape (n,) -> (n, 9), SI units."""
        low, high = self.envelope.ranges.T
        middle, half = 0.5 * (low + high), 0.5 * (high - low)
        share = (1.0 - OFFSET) * half
        share[0] = SPEED_SHARE * half[0]
        if self.envelope.rates is not None:  # what is slow in a drive covers its range by its constant part
            mean = [math.sqrt(float(np.mean(np.square(one.harmonics)))) / self.period for one in self.multisines()]
            share = np.minimum(share, np.array(self.envelope.rates) / (2.0 * math.pi * np.array(mean)))
        offset = (half - share) * np.array(self.offsets)
        level, moving = self._levels(time)
        constant = np.tile(middle + offset, (len(time), 1))
        constant[:, 0] = np.clip(level, low[0] + share[0], high[0] - share[0])
        constant[:, 0] = np.where(moving > STANDING, constant[:, 0], level)
        cycles = (time - self.ramp_time) / self.period
        signals = np.stack([signal.at(cycles) for signal in self.multisines()], axis=1)
        quiet = np.ones((len(time), len(CHANNELS)))
        quiet[:, :3] = moving[:, None]
        constant[:, 1:3] *= moving[:, None]
        signs = np.array(MIRRORED) if self.mirror else np.ones(len(CHANNELS))
        return np.asarray((constant + quiet * share * signals) * signs)

    def _levels(self, time: Array) -> tuple[Array, Array]:
        """Speed that the steps ask for [m/s], and how much the horizontal multisines move, from `STANDING` to 1 [-]."""
        low, high = self.envelope.speed
        room = SPEED_SHARE * 0.5 * (high - low)
        inside = [v if v == 0.0 else min(max(v, low + room), high - room) for v in self.speeds]
        shares = [STANDING if v == 0.0 else 1.0 for v in inside]
        each = self.duration / len(inside)
        level, moving = np.full(len(time), inside[0]), np.full(len(time), shares[0])
        for n in range(1, len(inside)):
            risen = _smooth((time - n * each) / (STEP_SHARE * each))
            level += risen * (inside[n] - inside[n - 1])
            moving += risen * (shares[n] - shares[n - 1])
        return level, moving

    def poses(self, vehicle: Vehicle, water: Water, time: float) -> Poses:
        """Poses of the five bodies, world axes, at a time [s]; see `exumob.towing_tank.motion.PrescribedMotion`."""
        return _course(self, vehicle, water).poses(time)


@lru_cache(maxsize=64)
def _harmonics(period: float, slow: float, fast: float, turn: int) -> tuple[tuple[int, ...], ...]:
    """Harmonics of the channels. Bands that are too narrow for `LEAST_MULTIPLES` sines each are made wider."""
    slower = max(slow, (LEAST_MULTIPLES * SLOW + 0.5) / period)
    faster = max(fast, slower + (LEAST_MULTIPLES * (len(CHANNELS) - SLOW) + 0.5) / period)
    return tuple(shared_harmonics(period, [slower] * SLOW + [faster] * (len(CHANNELS) - SLOW), turn))


@lru_cache(maxsize=64)
def _signals(period: float, slow: float, fast: float, turn: int, seed: int) -> tuple[Multisine, ...]:
    """Signals of the channels."""
    return tuple(
        small_peak(harmonics, seed * len(CHANNELS) + n)
        for n, harmonics in enumerate(_harmonics(period, slow, fast, turn))
    )


def _smooth(x: Array) -> Array:
    """Quintic step, see `exumob.driving.maneuver.smooth_step`."""
    return np.array([smooth_step(float(value))[0] for value in x])


class _Course(NamedTuple):
    """A motion as splines over time: what `poses` reads at one instant."""

    path: CubicSpline
    """Place of the hull's centre of mass, x and y [m]"""
    heading: CubicSpline
    others: CubicSpline
    """Heave [m], pitch, roll [rad], strokes of the four wheels [m], angles of the front wheels [rad], spin [rad/s]"""
    end: float
    height: float
    """Design height of the hull's centre of mass [m]"""
    arms: Array
    """Wheel centres from there, hull axes [m], shape (4, 3)"""

    def poses(self, time: float) -> Poses:
        """Poses at a time; beyond the end the vehicle stays where it is."""
        t, going = min(max(time, 0.0), self.end), 0.0 <= time <= self.end
        x, y = self.path(t)
        v = going * self.path(t, 1)
        psi, turning = float(self.heading(t)), going * float(self.heading(t, 1))
        now, rate = self.others(t), going * self.others(t, 1)
        yawed = about_z(psi)
        leaning = yawed @ about_y(now[1])
        turned = leaning @ about_x(now[2])
        angular = np.array([0.0, 0.0, turning]) + rate[1] * yawed[:, 1] + rate[2] * leaning[:, 0]
        up = turned[:, 2]
        arms = (self.arms + np.outer(now[3:7], [0.0, 0.0, 1.0])) @ turned.T
        hull = np.array([x, y, self.height + now[0]])
        velocity = np.array([v[0], v[1], rate[0]])
        angles, rates = np.array([now[7], now[8], 0.0, 0.0]), np.array([rate[7], rate[8], 0.0, 0.0])
        return Poses(
            np.vstack([hull, hull + arms]),
            np.array([turned, *(turned @ about_z(angle) for angle in angles)]),
            np.vstack([velocity, velocity + np.cross(angular, arms) + np.outer(rate[3:7], up)]),
            np.vstack([angular, angular + np.outer(rates, up)]),
            np.array([0.0, *[now[9]] * 4]),
        )


@lru_cache(maxsize=4)
def _course(motion: Excitation, vehicle: Vehicle, water: Water) -> _Course:
    """Lay down the course: integrate speed and turning, and find the strokes that keep the wheels on the ground."""
    steps = max(math.ceil(motion.duration / TABLE_STEP), 8)
    time = np.linspace(0.0, motion.duration, steps + 1)
    share = _smooth(time / motion.ramp_time)
    speed, sway, yaw_rate, slip, steering, heave, pitch, roll, sinkage = (share[:, None] * motion.values(time)).T
    heading = CubicSpline(time, yaw_rate).antiderivative()
    c, s = np.cos(heading(time)), np.sin(heading(time))
    drifting = (1.0 - share)[:, None] * water.velocity[:2]
    path = CubicSpline(time, drifting + np.stack([c * speed - s * sway, s * speed + c * sway], axis=1)).antiderivative()
    arms = vehicle.wheel_centers - vehicle.hull_origin
    strokes = _strokes(vehicle, arms, np.stack([heave, pitch, roll, sinkage]))
    limit = vehicle.steering.limit
    command = np.clip(steering, -FREE_STEERING * limit, FREE_STEERING * limit)  # the splines overshoot a bend a little
    left, right = np.array([[m[0] for m in vehicle.steering_angles((angle, 0.0, 0.0))] for angle in command]).T
    spin = (c * path(time, 1)[:, 0] + s * path(time, 1)[:, 1]) * share + slip
    others = np.column_stack([heave, pitch, roll, strokes, left, right, spin / vehicle.wheel.radius])
    return _Course(
        path, heading, CubicSpline(time, others), motion.duration, vehicle.hull.center_of_mass_height, arms
    )  # fmt: skip


def _strokes(vehicle: Vehicle, arms: Array, attitude: Array) -> Array:
    """Wheels above their ride height in the hull [m], shape (n, 4), for heave, pitch, roll and sinkage, shape (4, n).

    They keep the wheels at the height that the sinkage asks for, up to `FREE_STROKE` of the travel; from there on they
    bend smoothly towards the stop.
    """
    heave, pitch, roll, sinkage = attitude
    above = -np.sin(pitch)[:, None] * arms[:, 0] + (np.cos(pitch) * np.sin(roll))[:, None] * arms[:, 1]
    height = vehicle.wheel.radius - sinkage - vehicle.hull.center_of_mass_height - heave
    stroke = (height[:, None] - above) / (np.cos(pitch) * np.cos(roll))[:, None] - arms[:, 2]
    front, rear = vehicle.axle_suspensions
    for wheel, suspension in enumerate((front, front, rear, rear)):
        for sign, travel in ((1.0, suspension.bump_travel), (-1.0, suspension.rebound_travel)):
            free, bend = FREE_STROKE * travel, (1.0 - FREE_STROKE) * travel
            beyond = sign * stroke[:, wheel] - free
            bent = free + bend * np.tanh(beyond / bend) if bend > 0.0 else np.full_like(beyond, free)
            stroke[:, wheel] = np.where(beyond > 0.0, sign * bent, stroke[:, wheel])
    return np.asarray(stroke)
