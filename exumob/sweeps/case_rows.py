"""What a case of a sweep is, and what is kept of how it ended: names, texts, and the checks of both."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from exumob.support.identity import file_text, spelled
from exumob.support.quantities import shown
from exumob.sweeps.sampling import Case

STATUSES = ("completed", "broke down", "refused", "failed", "out of time", "killed")
"""How a case can end: with a result; with a `SimulationError`; with a ``ValueError`` on its values; with another error;
stopped at its own time limit; with its process, twice."""
FORMAT = 2
"""Number of the layout of a sweep's files."""
OWN_NAMES = ("case", "status", "reason", "case_wall_time")
"""Names in the result of a sweep that are neither parameters nor results."""


def case_text(case: Case) -> str:
    """Values of a case as JSON, files with a digest of their contents."""
    try:
        return json.dumps(case, default=_plain_value)
    except (ValueError, TypeError, RecursionError) as error:
        raise ValueError(f"sweep.cases: {shown(case)} cannot be kept ({error}); give numbers or texts.") from None


def fault_of_result(values: Any, parameters: Sequence[str]) -> str:
    """Say what is wrong with that which a function has returned for a case; empty if nothing is."""
    if not isinstance(values, Mapping):
        return f"it returned {type(values).__name__}; return a Dataset of simulate, or numbers by name"
    for name, value in values.items():
        if not isinstance(name, str) or not name or re.search(r"[/\0]", name):
            return f"the result {name!r} has no proper name; use a text without '/'"
        if name in OWN_NAMES or name in parameters:
            return f"the result {name!r} has a name that is taken by a parameter or a column; rename it"
        if not isinstance(value, str) and not _is_number(value):
            return f"the result {name} = {value!r:.80} is not a number; return one number for each name"
    return ""


def check_names(cases: Sequence[Case]) -> None:
    """Raise ValueError unless cases are dicts with the same proper names."""
    if isinstance(cases, Mapping) or not isinstance(cases, Sequence) or isinstance(cases, str):
        raise ValueError(
            f"sweep.cases is a {type(cases).__name__}; give a list of dicts, such as [{{'hull.mass': 49.0}}], or make "
            "it with grid or sample."
        )
    if not cases:
        raise ValueError("sweep.cases is empty; give one case at least.")
    for n, case in enumerate(cases):
        if not isinstance(case, dict):
            raise ValueError(f"sweep.cases: case {n} is {case!r:.80}; give a dict of values by name.")
        if list(case) != list(cases[0]):
            raise ValueError(f"sweep.cases: case {n} has the names {list(case)}, the first one {list(cases[0])}.")
    for name in cases[0]:
        if not isinstance(name, str) or not name or re.search(r"[/\s\0]", name) or name in OWN_NAMES:
            raise ValueError(
                f"sweep.cases: {name!r} cannot be the name of a parameter; use a text without '/' and blanks, other "
                f"than {', '.join(OWN_NAMES)}."
            )


def fault_of_row(row: Any) -> str:
    """Say what is wrong with the content of a case's file; empty if nothing is."""
    if not isinstance(row, dict):
        return f"it holds a {type(row).__name__}"
    if row.get("format") != FORMAT:
        return "it is in the layout of another version of exumob, or not of exumob at all"
    kinds: dict[str, Any] = {
        "exumob": str, "function": str, "code": str, "parameters": dict, "status": str, "reason": str,
        "wall_time": int | float, "run": bool, "values": dict, "check": str,
    }  # fmt: skip
    for name, kind in kinds.items():
        if not isinstance(row.get(name), kind):
            return f"{name} is {row[name]!r:.60}" if name in row else f"{name} is missing"
    if row["status"] not in STATUSES:
        return f"status is {row['status']!r}"
    bad = [name for name, value in row["values"].items() if not isinstance(value, str) and not _is_number(value)]
    return f"the value of {bad[0]} is {row['values'][bad[0]]!r:.60}" if bad else ""


def _is_number(value: Any) -> bool:
    if isinstance(value, str | bytes) or value is None:
        return False
    try:
        float(value)
    except (TypeError, ValueError, OverflowError):
        return False
    return True


def _plain_value(value: Any) -> Any:
    if isinstance(value, np.generic):
        return value.item()
    return file_text(value) if isinstance(value, Path) else spelled(value)
