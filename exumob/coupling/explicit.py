"""The explicit coupling scheme of the paper (Sec. 2.3)."""

from __future__ import annotations

from dataclasses import dataclass

from exumob.coupling.scheme import Mechanism, Scheme, WithinStep, checked_wrenches
from exumob.water.hydrodynamics import Hydrodynamics


@dataclass(kw_only=True, eq=False)
class Explicit(Scheme):
    """The paper's scheme (Sec. 2.3): predict, advance the water there, advance the vehicle under its wrenches.

    It advances the water once a step, and is unstable where the added mass is more than a third of the mass (see
    `exumob.coupling.scheme`). Hydrodynamics models whose wrenches do not follow the acceleration at once
    (`CoefficientHydrodynamics`, `SurrogateHydrodynamics`) need no other scheme. Their answer changes linearly about its
    value within the step: held, it would jump between steps, and the time integration of the vehicle lose an order
    (1 ms against 0.25 ms: 6e-5 m after 8 s, in place of 9e-7 m). With a flow code it is included for comparison.
    """

    within_step: WithinStep = "linear"

    def step(self, bodies: Mechanism, hydrodynamics: Hydrodynamics, end_time: float) -> None:
        """See `Coupling`."""
        begin = bodies.time
        step = end_time - begin
        wrenches = checked_wrenches(hydrodynamics, bodies.history, lambda: bodies.predict(step))
        bodies.advance(end_time, wrenches, self.trace.rate(wrenches, step))
        self.trace.add(begin, step, wrenches, 1, float("nan"))
