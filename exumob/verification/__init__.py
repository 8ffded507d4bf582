"""Cases that the flow solver must meet: exact, conserved or published, each with a limit written down first.

`exumob verify` runs them and prints value, reference, error and limit; the tests run the same cases.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Check:
    """One number that a case compares.

    Parameters
    ----------
    name : str
        What was measured, with its setting: "sloshing period, level at 7.75 cells".
    value, reference : float
        Found and expected, in `unit`.
    error : float
        As the limit means it: relative, absolute, or a value that must stay small.
    limit : float
        Largest |error| allowed; infinite: reported only.
    unit : str
        Of value and reference.
    """

    name: str
    value: float
    reference: float
    error: float
    limit: float
    unit: str = "-"

    @property
    def passed(self) -> bool:
        """Whether the error is a number within the limit."""
        return self.limit == float("inf") or bool(np.isfinite(self.error) and abs(self.error) <= self.limit)


def relative(name: str, value: float, reference: float, limit: float, unit: str = "-") -> Check:
    """Check of value / reference - 1."""
    return Check(name, float(value), float(reference), float(value / reference - 1.0), limit, unit)


def absolute(name: str, value: float, reference: float, limit: float, unit: str = "-") -> Check:
    """Check of value - reference, in `unit`."""
    return Check(name, float(value), float(reference), float(value - reference), limit, unit)


def at_least(name: str, value: float, least: float, unit: str = "-") -> Check:
    """Check that a value does not fall below a bound: the error is what is missing."""
    return Check(name, float(value), float(least), float(max(least - value, 0.0)), 0.0, unit)


def reported(name: str, value: float, reference: float = float("nan"), unit: str = "-") -> Check:
    """A number without a limit."""
    return Check(name, float(value), float(reference), float(value - reference), float("inf"), unit)


@dataclass(frozen=True)
class Case:
    """A run, or a few, and what it must show.

    Parameters
    ----------
    name : str
        Short, for the command line: "sloshing".
    about : str
        One line: the physics and the source of the reference.
    run : callable
        Takes nothing, returns the checks.
    minutes : float
        Wall time on one core, roughly.
    slow : bool
        Left out unless asked for.
    """

    name: str
    about: str
    run: Callable[[], Sequence[Check]]
    minutes: float
    slow: bool = False
