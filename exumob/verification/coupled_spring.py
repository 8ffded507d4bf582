"""With which order do the coupling schemes converge as the macro step shrinks?

A mass on a spring whose water is a single number, its added mass: the exact solution is known and nothing else errs.
Limits, written down first: order 1.8 with loads held over a step and 2.6 with linear ones, at twice the mass of water.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated

import numpy as np
import xarray as xr

from exumob.coupling.scheme import Coupling
from exumob.coupling.semi_implicit import SemiImplicit
from exumob.coupling.strong import Strong
from exumob.support.arrays import Array
from exumob.support.constants import GRAVITY
from exumob.support.declared import checked
from exumob.support.quantities import Quantity
from exumob.vehicle.motion import BodyStates
from exumob.verification.check import Case, Check, at_least, reported
from exumob.verification.coupled import named
from exumob.verification.free_body import FreeBody
from exumob.verification.options import Interval


class SpringWater:
    """Water that is a single number, its added mass A.

    Its force is the mean of -k z - A z'' + weight over the step, which is exact for cubic motion.
    """

    @checked
    def __init__(
        self,
        mass: Annotated[float, Quantity("kg", above=0.0)],
        stiffness: Annotated[float, Quantity("N/m", above=0.0)],
        added_mass: Annotated[float, Quantity("kg", at_least=0.0)],
        offset: Annotated[float, Quantity("m")],
    ) -> None:
        self.mass, self.stiffness, self.added_mass = mass, stiffness, added_mass
        self.state = 0.0, offset, 0.0

    def start(self, vehicle: object, water: object, macro_step: float) -> None:
        """Do nothing: there is nothing to prepare."""

    def wrenches(self, history: BodyStates, predict: Callable[[], BodyStates]) -> Array:
        """Return the mean wrench up to the predicted state, shape (1, 6)."""
        ahead = predict()
        time, z, speed = float(ahead.time[-1]), float(ahead.position[-1, 0, 2]), float(ahead.velocity[-1, 0, 2])
        before, z0, speed0 = self.state
        step = time - before
        mean = 0.5 * (z0 + z) + step / 12.0 * (speed0 - speed)
        force = self.mass * GRAVITY - self.stiffness * mean - self.added_mass * (speed - speed0) / step
        self.state = time, z, speed
        return np.array([[0.0, 0.0, force, 0.0, 0.0, 0.0]])

    def save(self, histories: bool = True) -> tuple[float, float, float]:
        """Return time, place and speed."""
        return self.state

    def restore(self, saved: tuple[float, float, float]) -> None:
        """Return to a saved state."""
        self.state = saved

    def record(self) -> dict[str, xr.DataArray]:
        """Return nothing to record."""
        return {}


UNEVEN = (1.0, 1.0, 1.0, 1.25, 1.25, 1.0, 1.0, 0.5, 0.5, 1.5)
"""Lengths of macro steps that change as those that follow a flow, over their mean; repeated."""


@checked
def spring_error(
    scheme: Coupling,
    step: Interval,
    ratio: Annotated[float, Quantity("1", at_least=0.0)],
    lengths: tuple[float, ...] = (1.0,),
) -> float:
    """Largest error of the place over the amplitude in 0.5 s of heave at 3 Hz, added mass over mass `ratio`.

    `lengths`: those of successive steps over `step`, repeated.
    """
    mass, omega, offset = 10.0, 6.0 * np.pi, 0.01
    water = SpringWater(mass, mass * (1.0 + ratio) * omega**2, ratio * mass, offset)
    body = FreeBody(mass, np.ones(3), (0.0, 0.0, offset))
    scheme.start()
    worst = 0.0
    ends = step * np.cumsum(np.resize(np.array(lengths), round(0.5 / step)))
    for end in ends:
        scheme.step(body, water, float(end))
        exact = offset * np.cos(omega * body.time)
        worst = max(worst, abs(float(body.present().position[0, 0, 2]) - exact) / offset)
    return worst


def check_spring() -> list[Check]:
    """Order in the macro step, with an added mass of twice the mass: 2 with held, 3 with linear loads."""
    checks = []
    schemes: tuple[Coupling, ...] = (
        SemiImplicit(within_step="held"), SemiImplicit(), Strong(within_step="held", tolerance=1e-8),
        Strong(tolerance=1e-8),
    )  # fmt: skip
    for scheme in schemes:
        coarse, fine = spring_error(scheme, 4e-3, 2.0), spring_error(scheme, 1e-3, 2.0)
        within = str(scheme.within_step)  # type: ignore[attr-defined]
        name = f"{named(scheme)}, {within}"
        least = 1.8 if within == "held" else 2.6
        checks.append(at_least(f"order in the macro step, {name}", float(np.log(coarse / fine) / np.log(4.0)), least))
        checks.append(reported(f"error over amplitude, 1 ms, {name}", fine))
        coarse, fine = (spring_error(scheme, step, 2.0, UNEVEN) for step in (4e-3, 1e-3))
        order = float(np.log(coarse / fine) / np.log(4.0))
        checks.append(at_least(f"order with steps that change, {name}", order, least))
        checks.append(reported(f"error over amplitude, 1 ms, steps that change, {name}", fine))
    return checks


CASES: tuple[Case, ...] = (
    Case(
        "coupled-spring",
        "A mass on a spring with twice its added mass: order of the coupling in the macro step",
        check_spring,
        0.1,
    ),
)
