"""Spin-up: how the flow develops round the held vehicle before its release at time 0."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, replace
from typing import Annotated

import numpy as np

from exumob.driving.maneuver import RAMP_TIME, smooth_step
from exumob.flow.poses import Poses
from exumob.flow.settings import FlowSettings
from exumob.flow.vehicle_window import settings_for_vehicle
from exumob.support.declared import Declared, checked
from exumob.support.quantities import Quantity
from exumob.vehicle.parameters import Vehicle
from exumob.water.conditions import Water


@dataclass(frozen=True)
class FlowSpinUp(Declared):
    """Plan of the spin-up, in the order of its parts: ramp, hold, adjustment.

    The vehicle first drifts with the current, so that the water is undisturbed, and is brought to rest within `ramp`.
    That is a current ramped up about a held vehicle, seen from the undisturbed water: the two differ by a uniform
    acceleration of everything, which a uniform pressure gradient balances and which ends with the ramp (the bed slips;
    one that exerts shear sees the vehicle held in a current that was always there). Nothing is added to the flow solver
    for it, and a uniform current past a moving grid is kept to round-off. Over uneven ground, or in a current that
    differs from place to place, there is nowhere to drift: the vehicle is held in its place from the beginning, and the
    flow develops from the undisturbed one during ramp and hold. Then the vehicle settles anew under the mean
    wrenches found during `hold`, and is moved to its new place of rest during `adjustment`.
    """

    ramp: Annotated[float | None, RAMP_TIME] = None
    """From drifting with the current to rest [s]; left out in calm water. None: as long as suits the vehicle's size,
    by Froude's law: 1 s for the paper's (`for_vehicle`)"""
    hold: Annotated[float | None, RAMP_TIME] = None
    """At rest, after the ramp [s]; the mean wrenches are taken over its second half. None: 0.5 s for the paper's
    vehicle"""
    adjustment: Annotated[float | None, RAMP_TIME] = None
    """From the first to the final place of rest, in the first half, and waiting there, in the second [s]. None: 0.5 s
    for the paper's vehicle"""
    interval: Annotated[float | None, Quantity("s", at_least=1e-6, at_most=1.0)] = None
    """Between the poses given to the flow before the adjustment [s]; the adjustment is made in macro steps. None: 4 ms
    for the paper's vehicle, a quarter of `hold` at most"""

    def _check(self) -> None:
        interval, hold = self.interval, self.hold
        if interval is not None and hold is not None and interval > LONGEST_INTERVAL * hold:
            _refuse_interval(interval, hold)

    def for_vehicle(self, vehicle: Vehicle) -> SpinUpTimes:
        """Return the times for a vehicle: those given, and for the others those of the paper's vehicle, scaled.

        By Froude's law the water round a vehicle some times as large takes the root of that times as long; the size is
        that of the flow's settings (`exumob.flow.FlowSettings.reference_length`).

        Raises
        ------
        ValueError
            If an interval was given that is longer than a quarter of the time at rest.
        """
        scale = math.sqrt(settings_for_vehicle(vehicle, FlowSettings()).size)
        given = asdict(self)
        times = SpinUpTimes(**{
            name: usual * scale if given[name] is None else given[name] for name, usual in asdict(USUAL).items()
        })  # fmt: skip
        if times.interval <= LONGEST_INTERVAL * times.hold:
            return times
        if self.interval is not None:
            _refuse_interval(times.interval, times.hold)
        return replace(times, interval=LONGEST_INTERVAL * times.hold)


@dataclass(frozen=True)
class SpinUpTimes:
    """Times of a vehicle's spin-up [s]; see `FlowSpinUp`, which makes them."""

    ramp: float
    hold: float
    adjustment: float
    interval: float

    def ramp_in(self, water: Water) -> float:
        """Return the duration of the ramp in this water [s]: 0 without a current."""
        return self.ramp if water.greatest_speed > 0.0 else 0.0

    def duration(self, water: Water) -> float:
        """Return the time from the begin of the spin-up to the release in this water [s]."""
        return math.fsum((self.ramp_in(water), self.hold, self.adjustment))


USUAL = SpinUpTimes(ramp=1.0, hold=0.5, adjustment=0.5, interval=4.0e-3)
"""Times of a vehicle of 1 m, as the paper's."""
LONGEST_INTERVAL = 0.25
"""Longest interval between poses, over the time at rest [-]."""


def _refuse_interval(interval: float, hold: float) -> None:
    raise ValueError(
        f"FlowSpinUp.interval = {interval:g} s must be at most a quarter of hold = {hold:g} s; use a shorter interval."
    )


@checked
def poses_during_ramp(
    rest: Poses,
    water: Water,
    elapsed: Annotated[float, Quantity("s", at_least=0.0, at_most=1e9)],
    ramp: Annotated[float, Quantity("s", at_least=0.0, at_most=1e9)],
) -> Poses:
    """Return the poses of bodies that drift with the current at first and come to rest at the end of a ramp.

    Parameters
    ----------
    rest : Poses
        Where the bodies come to rest.
    water : Water
    elapsed : float
        Time since the begin of the ramp [s].
    ramp : float
        Duration of the ramp [s]; 0: the bodies are at rest.
    """
    if ramp == 0.0 or elapsed >= ramp:
        return rest
    x = elapsed / ramp
    share = smooth_step(x)[0]
    way = -ramp * (0.5 - x + x**4 * (2.5 - 3.0 * x + x * x))  # integral of 1 - share from here to the ramp's end
    n = len(rest.position)
    return Poses(
        rest.position + way * water.velocity, rest.rotation, np.tile((1.0 - share) * water.velocity, (n, 1)),
        np.zeros((n, 3)), np.zeros(n),
    )  # fmt: skip


@checked
def poses_between(
    begin: Poses,
    end: Poses,
    part: Annotated[float, Quantity("1", at_least=0.0, at_most=1e9)],
    duration: Annotated[float, Quantity("s", at_least=1e-6, at_most=1e9)],
) -> Poses:
    """Return the poses of bodies that move smoothly from one place of rest to another.

    Parameters
    ----------
    begin, end : Poses
    part : float
        Elapsed share of the duration [-]; from 1 on the bodies are at the end.
    duration : float
        [s]
    """
    from scipy.spatial.transform import Rotation

    if len(begin.position) != len(end.position):
        raise ValueError(
            f"poses_between: {len(begin.position)} poses at the begin and {len(end.position)} at the end; give as many."
        )
    if part >= 1.0:
        return end
    share, growth, _ = smooth_step(part)
    arcs = Rotation.from_matrix(end.rotation @ begin.rotation.mT).as_rotvec()
    way, rate = end.position - begin.position, growth / duration
    turned = Rotation.from_rotvec(share * arcs).as_matrix() @ begin.rotation
    n = len(way)
    return Poses(begin.position + share * way, turned, rate * way, rate * arcs, np.zeros(n))
