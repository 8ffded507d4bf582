"""What was measured of the models' errors: the table that every result's line of trust is made from."""

from __future__ import annotations

import functools
import json
from typing import Any

from exumob.support.files import PACKAGE

MEASURED_FILE = PACKAGE / "support" / "measured_errors.json"
"""The table; `studies/measured_errors.py` writes it, and it names the command and the source of each figure."""


@functools.cache
def measured_errors() -> dict[str, Any]:
    """Return the table (see `studies/measured_errors.py` for its entries)."""
    found: dict[str, Any] = json.loads(MEASURED_FILE.read_text())
    return found


def flow_load_error() -> str:
    """Say how far the loads of the flow solver are known to be off."""
    loads = measured_errors()["flow_loads"]
    return (
        f"the flow's drag of plain bodies is between {-100.0 * loads['drag_low']:.2g} % below and "
        f"{100.0 * loads['drag_high']:.2g} % above that of another solver; no vehicle was measured in water."
    )
