"""Checks as rows of text, and whole tables in Markdown and CSV."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Sequence
from pathlib import Path

from exumob.support.files import write_text
from exumob.verification.check import Check

COLUMNS = ("case", "check", "value", "reference", "error", "limit", "unit", "result")
"""Headings of the tables."""


def row(case: str, check: Check) -> tuple[str, ...]:
    """Return a check as text, in the order of `COLUMNS`; its result is "pass", "MISS" or "reported"."""
    result = ("pass" if check.limited else "reported") if check.passed else "MISS"
    numbers = (check.value, check.reference, check.error, check.limit)
    return case, check.name, *(f"{n:.4g}" if math.isfinite(n) else "" for n in numbers), check.unit, result


def as_markdown(found: Sequence[tuple[str, Check]]) -> str:
    """Return a table in Markdown of checks with the names of their cases."""
    lines = [COLUMNS, ("---", "---", "---:", "---:", "---:", "---:", "---", "---"), *(row(*each) for each in found)]
    return "".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |\n" for line in lines)


def as_csv(found: Sequence[tuple[str, Check]]) -> str:
    """Return a table of comma-separated values with all digits."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    for case, check in found:
        numbers = (check.value, check.reference, check.error, check.limit)
        writer.writerow((case, check.name, *map(repr, numbers), check.unit, row(case, check)[-1]))
    return text.getvalue()


def write_table(found: Sequence[tuple[str, Check]], output: Path) -> None:
    """Write a table as the file's ending says, whole or not at all: .csv, or else Markdown.

    Raises
    ------
    OSError
        If it cannot be written.
    """
    write_text(output, as_csv(found) if output.suffix == ".csv" else as_markdown(found))
