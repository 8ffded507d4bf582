"""Fields of heights from files: Esri ASCII grids, which geographic information systems export."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from exumob.ground.terrain import Terrain

HEADER = ("ncols", "nrows", "cellsize", "nodata_value")
LARGEST = 2**30
"""Largest file that is read [bytes]."""
MOST_POINTS = 100_000_000


def read_heights(file: str | Path) -> Terrain:
    """Read a field of heights from an Esri ASCII grid (.asc), in the coordinates of the map, in metres.

    The format: ``ncols``, ``nrows``, ``xllcorner`` and ``yllcorner`` (or ``xllcenter`` and ``yllcenter``), ``cellsize``
    and perhaps ``NODATA_value``, a line each, then the rows from north to south. A height is that of its cell's middle.

    Raises
    ------
    ValueError
        If the file cannot be read, is no such grid, or has missing heights; as `Terrain`.
    """
    path = Path(file)
    try:
        if path.stat().st_size > LARGEST:
            raise ValueError(f"{path} is larger than {LARGEST / 2**30:g} GiB; cut out the part that is driven on.")
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except UnicodeDecodeError:
        raise ValueError(f"{path} is no text; give an Esri ASCII grid (.asc).") from None
    except OSError as error:
        raise ValueError(f"{path} cannot be read ({error.strerror}); give an Esri ASCII grid (.asc).") from None
    header: dict[str, float] = {}
    rows = 0
    for line in lines:
        words = line.split()
        if len(words) != 2 or not words[0][:1].isalpha() or words[0].casefold() in ("nan", "inf"):
            break
        header[words[0].casefold()] = _number(path, rows + 1, words[1])
        rows += 1
    corner = "xllcorner" in header
    places = ("xllcorner", "yllcorner") if corner else ("xllcenter", "yllcenter")
    missing = [name for name in (*HEADER[:3], *places) if name not in header]
    if missing:
        raise ValueError(
            f"{path} does not say {', '.join(missing)}; give an Esri ASCII grid, whose first lines are ncols, nrows, "
            "xllcorner, yllcorner and cellsize."
        )
    n_x, n_y, step = header["ncols"], header["nrows"], header["cellsize"]
    if n_x != int(n_x) or n_y != int(n_y) or min(n_x, n_y) < 2 or n_x * n_y > MOST_POINTS or not step > 0.0:
        raise ValueError(
            f"{path}: ncols = {n_x:g}, nrows = {n_y:g}, cellsize = {step:g}; give whole numbers of at least 2 columns "
            "and rows, and a positive size."
        )
    words = " ".join(lines[rows:]).split()
    if len(words) != n_x * n_y:
        raise ValueError(
            f"{path} holds {len(words)} heights, and ncols times nrows is {n_x * n_y:g}; export it anew, whole."
        )
    try:
        heights = np.array(words, dtype=float).reshape(int(n_y), int(n_x))
    except ValueError:
        for n, word in enumerate(lines[rows:], rows + 1):
            for text in word.split():
                _number(path, n, text)
        raise
    holes = ~np.isfinite(heights) | (heights == header.get("nodata_value", np.nan))
    if holes.any():
        j, i = (int(k) for k in np.argwhere(holes)[0])
        raise ValueError(
            f"{path}: {int(holes.sum())} heights are missing, the first in row {j + 1}, column {i + 1}; fill the "
            "holes, or cut out a part without any."
        )
    shift = 0.5 * step if corner else 0.0
    origin = (header[places[0]] + shift, header[places[1]] + shift)
    try:
        return Terrain(heights=heights[::-1].copy(), origin=origin, spacing=step)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def _number(path: Path, line: int, word: str) -> float:
    try:
        return float(word)
    except ValueError:
        raise ValueError(f"{path}, line {line}: {word!r:.40} is not a number; write one.") from None
