"""Checks and cases: a number beside its reference with a limit, and the run that gives it."""

from __future__ import annotations

import inspect
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np

from exumob.support.declared import Declared
from exumob.support.quantities import Quantity


@dataclass(frozen=True)
class Check:
    """One number that a case compares.

    Parameters
    ----------
    name : str
        The quantity with its setting: "sloshing period, level at 7.75 cells".
    value, reference : float
        Found and expected, in `unit`; the reference is NaN where there is none.
    error : float
        As the limit means it: relative, absolute, or a value that must stay small.
    limit : float
        Largest |error| allowed; infinite: the value is reported only.
    unit : str
        Unit of value and reference.
    """

    name: str
    value: float
    reference: float
    error: float
    limit: float
    unit: str = "-"

    @property
    def limited(self) -> bool:
        """True if there is a limit to meet, False if the value is reported only."""
        return self.limit != float("inf")

    @property
    def passed(self) -> bool:
        """True if the error is within the limit; without a limit, if the value is a number. NaN never passes."""
        if not self.limited:
            return bool(np.isfinite(self.value))
        return bool(np.isfinite(self.error) and abs(self.error) <= self.limit)


def relative(name: str, value: float, reference: float, limit: float, unit: str = "-") -> Check:
    """Check of value / reference - 1."""
    return Check(name, float(value), float(reference), float(value / reference - 1.0), limit, unit)


def absolute(name: str, value: float, reference: float, limit: float, unit: str = "-") -> Check:
    """Check of value - reference, in `unit`."""
    return Check(name, float(value), float(reference), float(value - reference), limit, unit)


def at_least(name: str, value: float, least: float, unit: str = "-") -> Check:
    """Check that a value does not fall below a bound; the error is how far it does."""
    return Check(name, float(value), float(least), float(max(least - value, 0.0)), 0.0, unit)


def reported(name: str, value: float, reference: float = float("nan"), unit: str = "-") -> Check:
    """A number without a limit, with a reference to read it by if there is one."""
    return Check(name, float(value), float(reference), float(value - reference), float("inf"), unit)


@dataclass(frozen=True)
class Case(Declared):
    """A question to the flow solver: a run, or a few, and the checks that answer it.

    Parameters
    ----------
    name : str
        Short, for the command line: "sloshing".
    about : str
        One line: the physics and the source of the reference.
    run : callable
        Returns the checks. Its parameters have defaults, with which the limits were set.
    minutes : float
        Wall time on one core, roughly, without compiling.
    slow : bool
        Left out unless asked for.
    figure : callable, optional
        Draws the case: takes the same parameters as `run`, returns the figure.
    """

    name: str
    about: str
    run: Callable[..., Sequence[Check]]
    minutes: Annotated[float, Quantity("min", above=0.0)]
    slow: bool = False
    figure: Callable[..., Any] | None = None

    @property
    def question(self) -> str:
        """The question that the case belongs to: the first line of the file that defines its run."""
        return (sys.modules[self.run.__module__].__doc__ or "").split("\n")[0]

    @property
    def options(self) -> tuple[str, ...]:
        """Names of the parameters of `run` that may be chosen: "cell_size", "duration" and so on."""
        return tuple(inspect.signature(self.run).parameters)

    def expected_minutes(self, options: Mapping[str, Any]) -> float:
        """Wall time with other options than the defaults on one core [min], roughly.

        Work grows with the number of cells and of steps: with the third to fourth power of one over the cell size.
        """
        usual = {name: p.default for name, p in inspect.signature(self.run).parameters.items()}
        minutes = self.minutes
        for name, power in (("cell_size", -3.5), ("duration", 1.0), ("interval", -1.0)):
            default = usual.get(name)
            if name in options and isinstance(default, int | float) and default > 0.0:
                minutes *= (options[name] / default) ** power
        return minutes

    def require_options(self, names: Iterable[str]) -> None:
        """Refuse parameters that the case does not have.

        Raises
        ------
        ValueError
            Naming them and those that it has.
        """
        if unknown := [name for name in names if name not in self.options]:
            wrong, known = (
                ", ".join(f"--{name.replace('_', '-')}" for name in part) for part in (unknown, self.options)
            )
            raise ValueError(f"the case {self.name} has no option {wrong}; it has {known or 'none'}, so leave it out.")
