"""Checks of user input: each names the field, the value, the limit and the remedy."""

import math
from numbers import Real


def require_finite(owner: str, **values: float) -> None:
    """Raise ``ValueError`` unless every value is a finite number."""
    for field, value in values.items():
        if not isinstance(value, Real) or isinstance(value, bool) or not math.isfinite(value):
            raise ValueError(f"{owner}.{field} = {value!r} is not a finite number; give a number in SI units.")


def require_positive(owner: str, **values: float) -> None:
    """Raise ``ValueError`` unless every value is finite and > 0."""
    require_finite(owner, **values)
    for field, value in values.items():
        if value <= 0.0:
            raise ValueError(f"{owner}.{field} = {value} must be > 0; give a positive number in SI units.")


def require_within(owner: str, low: float, high: float, remedy: str = "", **values: float) -> None:
    """Raise ``ValueError`` unless every value is finite and in [low, high]."""
    require_finite(owner, **values)
    for field, value in values.items():
        if not low <= value <= high:
            hint = remedy or "give a value inside the range, in SI units and radians."
            raise ValueError(f"{owner}.{field} = {value} is outside [{low:g}, {high:g}]; {hint}")
