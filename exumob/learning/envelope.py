"""Ranges within which captive runs move a vehicle, from cheap drives: a second each with calibrated
coefficients for the water.

The vehicle drives over three soils of the table, from firm to soft, in shallow and deep water and in currents from all
sides that are wanted: lane changes, circles, a start and a stop, reversing. What 99 of 100 instants of all drives reach
is the envelope; motions that are possible and not among these drives are not in it.
"""

from __future__ import annotations

import json
import logging
import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from exumob.ground.soil import Soil
from exumob.learning.drives import DURATION, SOILS, showing_drives
from exumob.learning.plan import LearningRange, nameless
from exumob.simulation.run import simulate
from exumob.simulation.settings import time_scale, usual_speed
from exumob.support.arrays import Array
from exumob.support.errors import SimulationError
from exumob.support.files import write_text
from exumob.support.identity import digest
from exumob.support.provenance import parameters_json
from exumob.towing_tank.excitation import CHANNELS, FREE_STEERING, SLOW, Envelope
from exumob.vehicle.parameters import Vehicle
from exumob.water.conditions import Water
from exumob.water.mesh_file import mesh_digest

logger = logging.getLogger(__name__)

RECORD_STEP = 1e-2
"""Interval of the instants that are looked at [s]."""
TAILS = 0.01
"""Part of the instants that may lie below, and above, the envelope [-]."""
MARGIN, WAVES_MARGIN = 0.1, 0.5
"""By how much the ranges are made wider on either side, over their width [-]; the second one of heave, pitch and roll:
coefficients that were calibrated on other vehicles know little of how this one trims and heaves."""
LEAST = {"speed": 0.1, "sway": 0.05, "yaw_rate": 0.1, "slip": 0.05, "steering": 0.1, "pitch": 0.01, "roll": 0.01}
"""Least half widths, over the usual speed, the usual speed over the wheelbase, or as they are [rad]; those of heave and
sinkage are a fiftieth of the tyre's diameter."""
RATE_MARGIN, LEAST_RATE = 2.0, 0.1
"""Largest rates over those of the drives [-]; the least over half the range, times `time_scale` [1/s]."""
FASTER = 2.0
"""Highest frequency excited over the mean one of the drives [-]."""
SLOW_BAND, FAST_BAND = (0.5, 1.5), (2.0, 5.0)
"""Least and greatest value of the highest frequency, times `time_scale` [Hz]."""


def envelope_of(
    vehicle: Vehicle, waters: Sequence[Water], progress: Callable[[int, int], None] | None = None
) -> Envelope:
    """Drive a vehicle through waters with the calibrated coefficients and return the envelope of its motion.

    Parameters
    ----------
    vehicle : Vehicle
    waters : sequence of Water
    progress : callable, optional
        Called after each drive with the number of those done and of all.

    Raises
    ------
    ValueError
        If no drive of the vehicle gave any motion.
    """
    cases = [(soil, water) for soil in SOILS for water in waters]
    found: list[tuple[Array, Array]] = []
    choice = showing_drives(vehicle)
    for n, (soil, water) in enumerate(cases):
        maneuver = choice[(n + n // len(choice)) % len(choice)]
        try:
            with _quiet():  # how these drives start and end is no matter
                run: xr.Dataset | None = simulate(
                    vehicle, Soil.published(soil), water, maneuver, "calibrated",
                    duration=math.ceil(10.0 * DURATION * time_scale(vehicle)) / 10.0, record_step=RECORD_STEP,
                )  # fmt: skip
        except SimulationError as error:  # until it sank, say, it drove as vehicles do
            logger.info("%s", error)
            run = error.result
        if run is not None and run.sizes["time"] > 10:
            found.append(channels_of(run, vehicle))
        if progress is not None:
            progress(n + 1, len(cases))
    if not found:
        raise ValueError(f"envelope_of.vehicle: no drive of {vehicle.name} gave any motion; look at its parameters.")
    return _envelope(vehicle, found)


@contextmanager
def _quiet() -> Iterator[None]:
    """Let the package say nothing below an error."""
    package = logging.getLogger("exumob")
    before = package.level
    package.setLevel(logging.ERROR)
    try:
        yield
    finally:
        package.setLevel(before)


def channels_of(run: xr.Dataset, vehicle: Vehicle) -> tuple[Array, Array]:
    """Return the channels of `exumob.towing_tank.excitation.CHANNELS` along a run, and their rates.

    Returns
    -------
    values : array, shape (n, 9)
        SI units; of the sinkage the mean of the wheels.
    rates : array, shape (n, 9)
        Per second.
    """
    hull = run.sel(body="hull")
    forward = run["forward_velocity"].values
    heights = run["position"].values[:, 1:, 2]
    values = np.column_stack([
        forward, run["lateral_velocity"].values, hull["angular_velocity"].values[:, 2],
        run["wheel_speed"].values.mean(axis=1) * vehicle.wheel.radius - forward,
        run["steering_angle"].values.mean(axis=1),
        hull["position"].values[:, 2] - vehicle.hull.center_of_mass_height, hull["pitch"].values, hull["roll"].values,
        vehicle.wheel.radius - heights.mean(axis=1),
    ])  # fmt: skip
    return values, np.gradient(values, run["time"].values, axis=0)


def _envelope(vehicle: Vehicle, found: Sequence[tuple[Array, Array]]) -> Envelope:
    values, rates = (np.concatenate([one[k] for one in found]) for k in range(2))
    low, high = np.quantile(values, [TAILS, 1.0 - TAILS], axis=0)
    speed, size = usual_speed(vehicle), 0.02 * vehicle.wheel.diameter
    unit = {"speed": speed, "sway": speed, "slip": speed, "yaw_rate": speed / vehicle.wheelbase}
    least = np.array([LEAST.get(name, size) * unit.get(name, 1.0) for name in CHANNELS])
    waves = np.isin(CHANNELS, ("heave", "pitch", "roll"))
    margin = np.where(waves, WAVES_MARGIN, MARGIN) * (high - low)
    low, high = low - margin, high + margin
    for name in ("sway", "yaw_rate", "steering", "roll"):  # to the left as to the right
        k = CHANNELS.index(name)
        low[k], high[k] = -max(-low[k], high[k]), max(-low[k], high[k])
    middle, half = 0.5 * (low + high), np.maximum(0.5 * (high - low), least)
    limit = FREE_STEERING * vehicle.steering.limit
    ranges = {name: (float(m - h), float(m + h)) for name, m, h in zip(CHANNELS, middle, half, strict=True)}
    ranges["steering"] = (max(ranges["steering"][0], -limit), min(ranges["steering"][1], limit))
    frequency = FASTER * rates.std(axis=0) / np.maximum(values.std(axis=0), 1e-9) / (2.0 * math.pi)
    scale = time_scale(vehicle)
    slow, fast = (
        min(max(float(np.median(part)), band[0] / scale), band[1] / scale)
        for part, band in ((frequency[:SLOW], SLOW_BAND), (frequency[SLOW:], FAST_BAND))
    )
    least_rates = LEAST_RATE * half / scale
    largest = np.maximum(RATE_MARGIN * np.quantile(np.abs(rates), 1.0 - TAILS, axis=0), least_rates)
    return Envelope(**ranges, slow=slow, fast=fast, rates=tuple(float(rate) for rate in largest))


def stored_envelope(
    vehicle: Vehicle, wanted: LearningRange, folder: Path, progress: Callable[[int, int], None] | None = None
) -> Envelope:
    """Return the envelope of a vehicle for a range: that of the folder, if there is one, else that of new drives.

    Parameters
    ----------
    vehicle : Vehicle
    wanted : LearningRange
    folder : Path
        Of `exumob.learning.campaign.LearningFolder`; it need not be there, and nothing is written.
    progress : callable, optional
        See `exumob.learning.envelope.envelope_of`.
    """
    key = envelope_key(vehicle, wanted)
    try:
        text = (folder / f"envelope_{key}.json").read_text(encoding="utf-8")
        kept: Any = {name: tuple(v) if isinstance(v, list) else v for name, v in json.loads(text).items()}
        return Envelope(**kept)
    except (OSError, ValueError, TypeError, AttributeError):  # not there, or of another version
        return envelope_of(vehicle, wanted.samples(vehicle), progress)


def keep_envelope(envelope: Envelope, vehicle: Vehicle, wanted: LearningRange, folder: Path) -> None:
    """Keep an envelope, so that the runs of a folder stay those that were planned."""
    write_text(folder / f"envelope_{envelope_key(vehicle, wanted)}.json", json.dumps(asdict(envelope)))


def envelope_key(vehicle: Vehicle, wanted: LearningRange) -> str:
    """Return a short hash of the vehicle, but for its name, and of the range.

    The coefficients with which the drives were made have no part in it: a folder keeps the envelope of its first plan,
    so that its runs stay those that were planned when a later version of exumob has other coefficients.
    """
    return digest(parameters_json({"vehicle": nameless(vehicle), "range": wanted}) + mesh_digest(vehicle.hull))
