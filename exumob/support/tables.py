"""Tables of numbers in text files (CSV): one reader for all, whatever program has written them.

The first line holds the names of the columns, perhaps with units, ``x [m]``. Commas, semicolons or tabs part the
columns; with semicolons or tabs a comma may stand for the decimal point. Text is UTF-8, with or without a mark at its
begin (BOM), or UTF-16 with one. Empty lines and those that begin with ``#`` are left out.
"""

from __future__ import annotations

import csv
import io
import math
import os
from pathlib import Path

import numpy as np

from exumob.support.arrays import Array

LARGEST = 2 * 2**30
"""Largest file that is read [bytes]."""
SEPARATORS = {";": "semicolons", "\t": "tabs", ",": "commas"}
"""What may part the columns; where several stand in the first line, the earlier here does."""


def read_table(file: str | Path) -> dict[str, Array]:
    """Read a table of numbers with a line of names.

    Returns
    -------
    dict
        Columns by their names as they stand in the file, each of shape (rows,); nan where a field is empty.

    Raises
    ------
    ValueError
        If the file does not exist, is empty, too large, not text, has no line of names, twice the same name, rows of
        different lengths, or a field that is no number; file and line are named.
    """
    path = Path(file)
    text = _text(path)
    rows = _rows(path, text)
    names = [name.strip() for name in rows[0][1]]
    if all(_number(name, True) is not None for name in names):
        raise ValueError(f"{path} begins with numbers; its first line must name the columns, such as 'x [m], y [m]'.")
    for n, name in enumerate(names):
        if not name:
            raise ValueError(f"{path}: column {n + 1} has no name; name all columns in the first line.")
        if name in names[:n]:
            raise ValueError(f"{path}: two columns are named {name!r}; rename or cut one of them.")
    if len(rows) == 1:
        raise ValueError(f"{path} has names of columns, but no rows; give one at least.")
    decimal_comma = "," not in _separator(rows[0][2])
    found = np.empty((len(rows) - 1, len(names)))
    for n, (line, fields, _) in enumerate(rows[1:]):
        if len(fields) != len(names):
            raise ValueError(
                f"{path}, line {line} has {len(fields)} fields, and there are {len(names)} columns; mend the line "
                f"(columns are parted by {SEPARATORS[_separator(rows[0][2])]})."
            )
        for k, field in enumerate(fields):
            number = _number(field, decimal_comma)
            if number is None:
                raise ValueError(
                    f"{path}, line {line}, column {names[k]!r}: {field.strip()!r:.60} is not a number; write one."
                )
            found[n, k] = number
    return dict(zip(names, np.ascontiguousarray(found.T), strict=True))


def row_lines(file: str | Path) -> list[int]:
    """Return the number of the line of each row of a table that `read_table` reads, for messages."""
    path = Path(file)
    return [line for line, _, _ in _rows(path, _text(path))[1:]]


def _text(path: Path) -> str:
    try:
        if os.path.getsize(path) > LARGEST:
            raise ValueError(f"{path} is larger than {LARGEST / 2**30:g} GiB; thin it out.")
        data = path.read_bytes()
    except FileNotFoundError:
        raise ValueError(f"{path} does not exist.") from None
    except OSError as error:
        raise ValueError(f"{path} cannot be read ({error.strerror}); give a file.") from None
    if not data.strip():
        raise ValueError(f"{path} is empty; give a table with a line of names and rows of numbers.")
    encoding = "utf-16" if data[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig"
    try:
        text = data.decode(encoding)
    except UnicodeDecodeError as error:
        line = data[: error.start].count(b"\n") + 1
        raise ValueError(
            f"{path}, line {line} is not UTF-8 text (Latin-1, or no text at all); save the file as UTF-8."
        ) from None
    if "\0" in text:
        raise ValueError(f"{path} is not a text file; give a table of numbers (CSV).")
    return text


def _rows(path: Path, text: str) -> list[tuple[int, list[str], str]]:
    """Number, fields and text of each line that holds something."""
    lines = text.splitlines()
    kept = [(n, line) for n, line in enumerate(lines, 1) if line.strip() and not line.lstrip().startswith("#")]
    if not kept:
        raise ValueError(f"{path} holds comments only; give a line of names and rows of numbers.")
    separator = _separator(kept[0][1])
    try:
        fields = csv.reader(
            io.StringIO("\n".join(line for _, line in kept)), delimiter=separator, skipinitialspace=True, strict=True
        )
        rows = list(fields)
    except csv.Error as error:
        raise ValueError(f"{path} is not a table ({error}); mend it.") from None
    if len(rows) != len(kept):
        raise ValueError(f"{path} is not a table: a quotation mark is not closed, or spans lines; mend it.")
    return [(n, row, line) for (n, line), row in zip(kept, rows, strict=True)]


def _separator(line: str) -> str:
    return next((sign for sign in SEPARATORS if sign in line), ",")


def _number(field: str, decimal_comma: bool) -> float | None:
    """The number of a field, nan if it is empty; None if it is no number."""
    text = field.strip()
    if not text:
        return math.nan
    if decimal_comma and text.count(",") == 1 and "." not in text:
        text = text.replace(",", ".")
    if "_" in text:
        return None
    try:
        return float(text)
    except ValueError:
        return None
