"""Numbers in sentences: a value, a range, a share in per cent."""

from __future__ import annotations

import math
from typing import Any


def number(value: Any) -> str:
    """Write a value with four figures; None as "none", text as it is."""
    if value is None:
        return "none"
    return f"{value:.4g}" if isinstance(value, int | float) else str(value)


def span(low: float, high: float) -> str:
    """Write a range; a single value if both ends are the same."""
    return f"{low:g}" if low == high else f"{low:g} to {high:g}"


def rounded_span(low: float, high: float) -> str:
    """Write a range whose ends are rounded to three figures."""
    return span(float(f"{low:.3g}"), float(f"{high:.3g}"))


def percent(share: float) -> str:
    """Write a share in per cent."""
    return f"{100.0 * share:.2g} %" if share >= 1e-3 else "less than 0.1 %"


def percents(low: float, high: float) -> str:
    """Write a range of shares in per cent."""
    return f"{100.0 * low:.2g} to {100.0 * high:.2g} %"


def whence(direction: float, heading: float = 0.0) -> str:
    """Say from where a current comes that flows in a direction [rad], seen by a vehicle with a heading [rad]."""
    angle = math.degrees(math.remainder(direction - heading - math.pi, 2.0 * math.pi))
    if abs(angle) < 0.5:
        return "from ahead"
    return "from behind" if abs(angle) > 179.5 else f"from {abs(angle):.0f} deg {'left' if angle > 0.0 else 'right'}"
