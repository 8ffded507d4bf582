"""Paths and recorded maneuvers from tables (CSV)."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np

from exumob.driving.maneuver import Recorded
from exumob.driving.path_following import Point
from exumob.support.arrays import Array
from exumob.support.files import why_no_file
from exumob.support.quantities import STEERING_ANGLE
from exumob.support.tables import read_table, row_lines

DEGREES = math.radians(1.0)


def read_path(file: str | Path) -> tuple[Point, ...]:
    """Read waypoints from a table with the columns ``x [m]`` and ``y [m]``, world coordinates.

    Raises
    ------
    ValueError
        If the file cannot be read, a column is missing, unknown or in another unit, or a field is empty.
    """
    found = _columns(Path(file), {"x": {"m": 1.0}, "y": {"m": 1.0}})
    return tuple(zip(found["x"].tolist(), found["y"].tolist(), strict=True))


def read_recorded(file: str | Path) -> Recorded:
    """Read a recorded maneuver from a table with ``time [s]``, ``steering [deg]`` and ``wheel speed [rad/s]``.

    The steering is the mean angle of the front wheels, positive to the left; ``steering [rad]`` is understood, too.

    Raises
    ------
    ValueError
        As `read_path`, or as `exumob.driving.maneuver.Recorded`.
    """
    path = Path(file)
    units = {"time": {"s": 1.0}, "steering": {"deg": DEGREES, "rad": 1.0}, "wheel speed": {"rad/s": 1.0}}
    found = _columns(path, units)
    if len(beyond := np.flatnonzero(np.abs(found["steering"]) > STEERING_ANGLE.at_most)):
        degrees, limit = math.degrees(found["steering"][beyond[0]]), math.degrees(STEERING_ANGLE.at_most)
        raise ValueError(
            f"{path}, line {row_lines(path)[beyond[0]]}: the steering is {degrees:.6g} degrees, and must be {-limit:g} "
            f"to {limit:g}; give an angle within, and its unit as the column's."
        )
    try:
        return Recorded(found["time"], found["steering"], found["wheel speed"])
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def _columns(path: Path, units: dict[str, dict[str, float]]) -> dict[str, Array]:
    """Columns by name, in the base unit; each needs its unit in brackets, one of those in `units`."""
    wanted = ", ".join(f"{name} [{' or '.join(known)}]" for name, known in units.items())
    if not path.is_file():
        raise ValueError(f"{path} {why_no_file(path)}; give a table (CSV) with the columns {wanted}.")
    found: dict[str, Array] = {}
    for title, values in read_table(path).items():
        split = re.fullmatch(r"\s*([^\[]*?)\s*\[\s*([^\]]*?)\s*\]\s*", title)
        name, unit = (split[1].casefold().replace("_", " "), split[2]) if split else (title.strip().casefold(), "")
        if name not in units or name in found:
            raise ValueError(f"{path}: column {title!r} is not known here, or stands twice; give {wanted}.")
        if unit not in units[name]:
            raise ValueError(
                f"{path}: column {title!r} {f'is in {unit}' if unit else 'names no unit'}; write '{name} "
                f"[{next(iter(units[name]))}]', and its values so."
            )
        gaps = np.flatnonzero(~np.isfinite(values))
        if len(gaps):
            raise ValueError(
                f"{path}, line {row_lines(path)[gaps[0]]}: {name} is missing; fill the hole, or cut the line."
            )
        found[name] = values * units[name][unit]
    if missing := [name for name in units if name not in found]:
        raise ValueError(f"{path} has no column {' and no column '.join(missing)}; give {wanted}.")
    return found
