"""Figures of the past, to which benchmarks print ratios; `past.toml` holds them."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

FILE = Path(__file__).with_name("past.toml")


def past(benchmark: str) -> dict[str, dict[str, Any]]:
    """Return the rows of a benchmark by name; empty if there are none.

    Each row holds figures by name and unit, such as ``wall_s``, and ``date``, ``revision`` and ``machine``.
    """
    table: dict[str, dict[str, Any]] = tomllib.loads(FILE.read_text()).get(benchmark, {})
    common = {name: value for name, value in table.items() if not isinstance(value, dict)}
    return {name: common | row for name, row in table.items() if isinstance(row, dict)}


def ratio(now: float, then: dict[str, Any], figure: str) -> str:
    """Return a figure over that of the past, as text; a dash if there is none."""
    return f"{now / then[figure]:.2f}" if figure in then else "-"
