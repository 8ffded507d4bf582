"""Checks of what a flow code answers, whether it runs in this process or in another."""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np

from exumob.support.arrays import Array, checked_array
from exumob.support.errors import SimulationError
from exumob.support.quantities import shown

MOST_FIGURES = 1000
"""Most figures in a report."""
_NAME = re.compile(r"[A-Za-z]\w{0,99}", re.ASCII)
"""Names that a result file can hold."""


def checked_report(code: str, found: Any, names: list[str] | None) -> dict[str, float]:
    """Return the figures that a flow code reports, as numbers.

    Parameters
    ----------
    code : str
        What the code is called in errors.
    found : object
        What it answered.
    names : list of str, optional
        Names of the report before, sorted; None if there was none.

    Raises
    ------
    SimulationError
        If it is no dict of finite numbers, has names that a result file cannot hold, or other names than before.
    """
    if not isinstance(found, dict) or len(found) > MOST_FIGURES:
        raise SimulationError(
            f"{code}: the report {shown(found)} came back; it must be an object of at most {MOST_FIGURES} numbers by "
            "name."
        )
    figures: dict[str, float] = {}
    for name, value in found.items():
        if not isinstance(name, str) or _NAME.fullmatch(name) is None:
            raise SimulationError(
                f"{code}: the report names a figure {shown(name)}; a name is a letter, then letters, digits and _, up "
                "to 100 of them."
            )
        try:
            if isinstance(value, bool | str | bytes):
                raise TypeError
            figures[name] = float(value)
        except (TypeError, ValueError, OverflowError):
            raise SimulationError(f"{code}: the report's {name} is {shown(value)}; it must be a number.") from None
        if not math.isfinite(figures[name]):
            raise SimulationError(
                f"{code}: the report's {name} is {shown(value)}; it must be finite. A flow that is not is broken: look "
                "into the flow code, or leave the figure out of all reports."
            )
    if names is not None and sorted(figures) != names:
        other = sorted(set(figures) ^ set(names))
        raise SimulationError(
            f"{code}: the names of the report have changed ({', '.join(other[:5])}); they must always be those of the "
            "first one."
        )
    return figures


def checked_loads(code: str, found: Any, bodies: int, time: float) -> Array:
    """Return the loads that a flow code gave for a time [s] as an array, shape (bodies, 6).

    Raises
    ------
    SimulationError
        If they are no such array, or not finite.
    """
    try:
        loads = checked_array(f"{code}: loads", found, (bodies, 6), finite=False).copy()
    except ValueError as error:
        raise SimulationError(f"{error} They came back for {time:.4f} s.") from None
    if not np.isfinite(loads).all():
        n = int((~np.isfinite(loads)).sum())
        raise SimulationError(
            f"{code}: {n} of {loads.size} loads are not finite for {time:.4f} s; halve macro_step, or look into the "
            "flow code."
        )
    return loads
