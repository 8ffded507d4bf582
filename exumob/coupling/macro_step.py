"""The macro step: of one length, or one that follows the flow and the vehicle."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Protocol, runtime_checkable

from exumob.support.declared import Declared
from exumob.support.quantities import STEP, Quantity

if TYPE_CHECKING:  # the command line takes the settings from here without any numerical package
    from exumob.coupling.scheme import Trace

TOLERANCE = 1e-6
"""Rounding, over the shortest step [-]."""
FEWEST = 5
"""Steps of one length before their residuals tell that it is too long."""


@runtime_checkable
class KnowsCourant(Protocol):
    """A hydrodynamics model that knows the Courant number of its flow."""

    def courant_numbers(self, count: int) -> Sequence[float]:
        """Return that of the flow over each of the last `count` macro steps, or of all if there are fewer [-]."""


@dataclass(frozen=True)
class FollowFlow(Declared):
    """Macro steps as long as the flow and its coupling to the vehicle allow.

    A flow code pays for every macro step at least one step of its own. One that is longer than its Courant number
    allows is divided within the code and saves nothing; a shorter one is paid for in full. So the macro step is kept
    where the flow goes through it in one step of its own, as long as the coupling residual, which shows how far the
    vehicle went elsewhere than predicted (a wheel that touches down, a bow that slams), stays small:

    - it shortens at once to what the Courant number allows;
    - it shortens by `unit` while the mean residual over the last steps is above `residual`;
    - it lengthens by `unit` after `patience` steps of the same length that all left room for it: a change of the step
      makes the flow's loads jump for one step, so it is made seldom, and is small.

    The next step follows from the record of the steps before it alone, so that a resumed run takes the same ones.
    """

    unit: Annotated[float, STEP] = 2.5e-4
    """Length of which every macro step is a whole multiple, and the shortest of them [s]; a whole multiple of the
    vehicle's micro step"""
    longest: Annotated[float, STEP] = 4.0e-3
    """Longest macro step [s]; a whole multiple of `unit`"""
    courant: Annotated[float, Quantity("1", at_least=0.01, at_most=10.0)] = 0.36
    """Courant number of the flow over a macro step beyond which this becomes shorter [-]: nine tenths of that at which
    the built-in solver divides its steps (`FlowSettings.courant`), so that it hardly ever does"""
    residual: Annotated[float, Quantity("1", at_least=1e-6, at_most=1.0)] = 0.15
    """Largest mean coupling residual [-]; a longer step needs two thirds of that. Sound runs have 0.05 or less"""
    patience: Annotated[int, Quantity("1", at_least=1, at_most=100_000)] = 25
    """Steps of one length before a longer one is tried"""

    def _check(self) -> None:
        ratio = self.longest / self.unit
        if round(ratio) < 1 or abs(ratio - round(ratio)) > TOLERANCE * ratio:
            raise ValueError(
                f"FollowFlow.longest = {self.longest:g} s must be a whole multiple of unit = {self.unit:g} s; choose "
                f"longest = {max(round(ratio), 1) * self.unit:g} s, say."
            )

    def next_parts(self, parts: Sequence[int], courant: Sequence[float], residual: Sequence[float]) -> int:
        """Return the length of the next step in units.

        Parameters
        ----------
        parts : sequence of int
            Lengths of the last `patience` steps, or of all if there are fewer, in units; none: the run begins.
        courant : sequence of float
            Courant number of the flow over each of them [-]; nan where it is not known.
        residual : sequence of float
            Coupling residual of each of them [-]; nan where it is not known.
        """
        most = round(self.longest / self.unit)
        if not parts:
            return max(most // 4, 1)
        last = parts[-1]
        alike = next((k for k, n in enumerate(reversed(parts)) if n != last), len(parts))  # steps of this length
        known = [c / n for c, n in zip(courant, parts, strict=True) if math.isfinite(c)]
        residuals = [r for r in residual[-alike:] if math.isfinite(r)]
        mean = math.fsum(residuals) / max(len(residuals), 1)
        allowed = min(most, int(self.courant / max(known[-1], 1e-9) * (1.0 + TOLERANCE)) if known else most)
        if mean > self.residual and alike >= min(self.patience, FEWEST):
            allowed = min(allowed, last - 1)
        if allowed < last:
            return max(allowed, 1)
        room = (last + 1) * max(known, default=0.0) <= self.courant and mean <= 2.0 / 3.0 * self.residual
        return min(last + 1, most) if room and alike >= self.patience else last

    def end_of_step(self, now: float, duration: float, trace: Trace, hydrodynamics: object) -> float:
        """Return the end of the macro step that begins now [s].

        Parameters
        ----------
        now, duration : float
            [s]
        trace : Trace
            Record of the coupling scheme.
        hydrodynamics : Hydrodynamics
            `KnowsCourant`, else the residual alone decides.
        """
        unit, count = self.unit, self.patience
        done, total = round(now / unit), round(duration / unit)
        begins = [round(t / unit) for t in trace.times[-count:]]
        parts = [end - begin for begin, end in zip(begins, [*begins[1:], done], strict=False)]
        unknown = [float("nan")] * len(parts)
        courant = hydrodynamics.courant_numbers(len(parts)) if isinstance(hydrodynamics, KnowsCourant) else unknown
        following = self.next_parts(parts, courant if len(courant) else unknown, trace.residuals[-count:])
        return min(done + following, total) * unit
