"""Drives of a vehicle: those that show how it moves, those that teach, and those that judge.

Teachers are made to say much in a short time, and yet to be drives: the hull floats, sinks and trims as it does when it
is driven, as nothing but steering and wheels is prescribed. The wheels have several speeds one after the other
(starting, standing, reversing among them); the steering is a multisine with a small peak
(`exumob.towing_tank.multisine`) about a constant angle, over the whole drive or in one half of it, so that there is
straight driving, too, in which the bow wave has time to build up.
"""

from __future__ import annotations

import math

import numpy as np

from exumob.driving.maneuver import ConstantSteer, LaneChange, Maneuver, Recorded, smooth_step
from exumob.simulation.settings import time_scale, usual_speed
from exumob.towing_tank.multisine import small_peak
from exumob.vehicle.parameters import Vehicle

SOILS = ("Grenville loam 24 %", "LETE sand", "North Gower clayey loam 46 %")
"""Published soils of the drives, from firm to soft."""
SOFT_GROUND = "Dry sand (Land Locomotion Lab)"
"""Published soil of a few drives: the wheels sink deeper than on those, and no deeper than the flow's grid can see, as
they do on lunar soil."""
DURATION = 6.0
"""Of a drive that shows how a vehicle moves, times `time_scale` [s]."""
REVERSING = -0.5
"""Speed of the tread in reverse, over the usual one [-]."""
STEERING = math.radians(30.0)
"""Largest angle of the front wheels, if the vehicle can steer as far [rad]."""
LEVELS = ((1.0, 1.0, 1.0), (0.6, 1.0, 1.0), (1.0, 1.0, 0.0), (1.0, 0.5, 1.0), (1.0, 1.0, REVERSING), (0.4, 1.0, 0.7))
"""Speeds of the wheels in the thirds of a drive that teaches, over its largest one; one row a drive."""
SLOWEST, FASTEST = 0.7, 1.2
"""Largest speed of the wheels in a drive that teaches, over the usual one [-]."""
HIGHEST, SINES, PERIOD = 0.6, 8, 32.0
"""Highest frequency of its steering, times `time_scale` [Hz], most sines in it, and the time after which they repeat
themselves, over `time_scale` [s]."""
DECIMALS = 6
"""To which times, angles and speeds of its maneuver are rounded: the last digits of sines differ from one processor to
another, and a run, which has its name from all that it is made from, would be made anew there."""
PHASES = 24
"""Sets of phases that are drawn; drives of other numbers take them again."""
TURNING = 0.4
"""Largest constant part of its steering, over the largest angle [-]."""
SAMPLE, LEAST_SAMPLES = 0.1, 80
"""Interval between the samples of its maneuver, times `time_scale` [s], and how many there are at least."""
DRAW = 20261130
"""Seed from which the random parts of all drives that teach are drawn, with the number of the drive."""


def showing_drives(vehicle: Vehicle) -> list[Maneuver]:
    """Return the maneuvers that show how a vehicle moves: lane change, start and stop, circle, reversing."""
    unit, spin, angle = _scales(vehicle)
    times = np.linspace(0.0, DURATION, 61)
    going = np.array([smooth_step(t)[0] - smooth_step(t - 0.5 * DURATION)[0] for t in times])
    return [
        LaneChange(angle, 1.5 * unit, 5.0 * unit, spin, unit),
        Recorded(unit * times, 0.0 * times, spin * going),
        ConstantSteer(-0.7 * angle, spin, unit),
        ConstantSteer(0.3 * angle, REVERSING * spin, unit),
    ]


def teaching_drive(vehicle: Vehicle, number: int, duration: float) -> Recorded:
    """Return the maneuver of a drive that teaches.

    Parameters
    ----------
    vehicle : Vehicle
    number : int
        Which one: the same number gives the same drive.
    duration : float
        [s]
    """
    unit, spin, angle = _scales(vehicle)
    random = np.random.default_rng([DRAW, number])
    fastest, share, turning = random.uniform([SLOWEST, 0.5, -TURNING], [FASTEST, 1.0, TURNING])
    count = max(round(duration / (SAMPLE * unit)), LEAST_SAMPLES)
    time = np.linspace(0.0, duration, count + 1)
    part = time / duration
    ramp = min(unit / duration, 0.2)
    speed, before = np.zeros(count + 1), 0.0
    for third, level in enumerate(LEVELS[number % len(LEVELS)]):
        speed += (level - before) * _rising(part, third / 3.0, ramp)
        before = level
    half = (_rising(part, 0.0, ramp), _rising(part, 0.5, ramp), 1.0 - _rising(part, 0.5, ramp))[number % 3]
    period = min(duration, PERIOD * unit)
    highest = max(int(HIGHEST * period / unit + 1e-9), 2)
    harmonics = tuple(sorted({round(k) for k in np.linspace(1, highest, min(highest, SINES))}))
    sines = small_peak(harmonics, number % PHASES).at(time / period)
    begun = _rising(part, ramp, ramp)
    steering = angle * half * begun * (turning + (1.0 - abs(turning)) * share * sines)
    return Recorded(*(np.round(values, DECIMALS) + 0.0 for values in (time, steering, fastest * spin * speed)))


def judging_drives(vehicle: Vehicle, part: float) -> list[tuple[Maneuver, float]]:
    """Return the maneuvers of drives that are kept apart, with the duration of each.

    Parameters
    ----------
    vehicle : Vehicle
    part : float
        Duration over the usual one [-].
    """
    unit, spin, angle = _scales(vehicle)
    time = unit * part
    return [
        (LaneChange(angle, 1.5 * time, 5.0 * time, spin, time), 6.0 * time),
        (ConstantSteer(-0.6 * angle, spin, time), 5.0 * time),
        (ConstantSteer(0.0, spin, time), 4.0 * time),
    ]


def _scales(vehicle: Vehicle) -> tuple[float, float, float]:
    """Return what 1 s is to this vehicle [s], its usual speed of the wheels [rad/s] and largest steering [rad]."""
    return (
        time_scale(vehicle), usual_speed(vehicle) / vehicle.wheel.radius, min(STEERING, vehicle.steering.limit)
    )  # fmt: skip


def _rising(part: np.ndarray, begin: float, length: float) -> np.ndarray:
    """Return a smooth step from 0 to 1 that begins at a part of the drive and takes a `length` of it [-]."""
    return np.array([smooth_step((p - begin) / length)[0] for p in part])


def maneuver_name(maneuver: Maneuver) -> str:
    """Return a name of a drive's maneuver."""
    if isinstance(maneuver, LaneChange):
        return "lane change"
    if isinstance(maneuver, Recorded):
        return "multisine of the steering"
    return "straight" if isinstance(maneuver, ConstantSteer) and maneuver.angle == 0.0 else "circle"
