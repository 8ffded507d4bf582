"""A cross-section of a river along the path of a vehicle: the ground, and the water over it."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike

from exumob.ground.terrain import HEIGHT_RANGE, Terrain, terrain_height
from exumob.support.arrays import Array
from exumob.support.declared import Declared, checked, nearest_names
from exumob.support.files import why_no_file
from exumob.support.quantities import DEPTH, DIRECTION, ImplausibleValue, Quantity, Unusual, unusual
from exumob.support.tables import read_table, row_lines
from exumob.water.conditions import Water
from exumob.water.water_field import WaterField

UNITS = {"station": "m", "bed": "m", "current": "m/s", "along": "m/s"}
"""Columns of a file, and their units."""
HALF_WIDTH = 500.0
"""Ground and water go on alike so far to either side of the path [m]."""
RUN_OUT = 100.0
"""Level ground that is added at both ends [m]."""
LEAST_POINTS, MOST_POINTS = 401, 20_000
"""Points along a section at which the current is kept at least, and the ground at most."""

HEIGHT = Quantity("m", at_least=HEIGHT_RANGE[0], at_most=HEIGHT_RANGE[1])
HEIGHTS = Quantity("m", at_least=HEIGHT_RANGE[0], at_most=HEIGHT_RANGE[1], shape=("n",))
SPEEDS = Quantity("m/s", at_least=-100.0, at_most=100.0, plausible=(-15.0, 15.0), shape=("n",))
DISCHARGE = Quantity("m^3/s", at_least=-1e6, at_most=1e6)
PLACE = Quantity("m", at_least=-1e8, at_most=1e8)


@dataclass(frozen=True, eq=False)
class CrossSection(Declared):
    """Height of the ground along a straight path, and the current there if it was measured.

    Raises
    ------
    ValueError
        If there are fewer than two points, stations do not increase, a value is not finite or lengths differ.
    """

    station: Annotated[ArrayLike, Quantity("m", at_least=-1e7, at_most=1e7, shape=("n",))]
    """Distance along the path, increasing"""
    bed: Annotated[ArrayLike, HEIGHTS]
    """World z of the ground; level beyond both ends, straight between the points of stations that are not equally far
    apart"""
    current: Annotated[ArrayLike, SPEEDS] | None = None
    """Velocity of the water across the path, positive to the left"""
    along: Annotated[ArrayLike, SPEEDS] | None = None
    """Velocity of the water along the path; None: 0"""

    def _check(self) -> None:
        station = np.asarray(self.station)
        for name in ("bed", "current", "along"):
            values = getattr(self, name)
            if values is not None and len(values) != len(station):
                raise ValueError(
                    f"CrossSection.{name} has {len(values)} values and station {len(station)}; give one at each."
                )
        if len(station) < 2:
            raise ValueError(f"CrossSection.station has {len(station)} point(s); give two at least.")
        back = np.flatnonzero(np.diff(station) <= 0.0)
        if len(back):
            n = int(back[0]) + 1
            raise ValueError(
                f"CrossSection.station: {station[n]:.9g} m at point {n + 1} follows {station[n - 1]:.9g} m; stations "
                "must increase along the path. Sort the points, and leave out what stands twice."
            )

    @classmethod
    def read(cls, file: str | Path) -> CrossSection:
        """Read a section from a table (CSV) with the columns station, bed and, if known, current and along.

        The first line names them, perhaps with their units: ``station [m], bed [m], current [m/s]``. See
        `exumob.support.tables.read_table` for the format.

        Raises
        ------
        ValueError
            If the file cannot be read, a column is missing, not known or in another unit, a field is empty, stations
            do not increase, or there are fewer than two; with the number of the line.
        """
        path = Path(file)
        if not path.is_file():
            raise ValueError(
                f"CrossSection.read: file {path} {why_no_file(path)}; give a table of stations and bed (CSV)."
            )
        found: dict[str, Array] = {}
        for title, values in read_table(path).items():
            name, unit = _name_and_unit(title)
            if name not in UNITS:
                near = nearest_names(name, list(UNITS))
                hint = f"did you mean {near[0]}?" if near else f"use {', '.join(UNITS)}."
                raise ValueError(f"{path}: column {title!r} is not known; {hint}")
            if unit not in ("", UNITS[name]):
                raise ValueError(
                    f"{path}: column {title!r} is in {unit}; convert it to {UNITS[name]} and write '{name} "
                    f"[{UNITS[name]}]'."
                )
            if name in found:
                raise ValueError(f"{path}: the column {name} stands twice; leave one of them out.")
            found[name] = values
        missing = [name for name in ("station", "bed") if name not in found]
        if missing:
            raise ValueError(
                f"{path} has no column {' and no column '.join(missing)}; a section needs station and bed."
            )
        lines = row_lines(path)
        for name, values in found.items():
            gaps = np.flatnonzero(~np.isfinite(values))
            if len(gaps):
                raise ValueError(
                    f"{path}, line {lines[gaps[0]]}: {name} is missing, as in {len(gaps)} line(s); fill the hole, or "
                    "leave the line out."
                )
        if len(lines) < 2:
            raise ValueError(f"{path}, line {lines[0]} is the only point; a section needs two at least.")
        back = np.flatnonzero(np.diff(found["station"]) <= 0.0)
        if len(back):
            n = int(back[0]) + 1
            raise ValueError(
                f"{path}, line {lines[n]}: station {found['station'][n]:.9g} m follows "
                f"{found['station'][n - 1]:.9g} m; stations must increase along the path. Sort the lines, and "
                "leave out what stands twice."
            )
        try:
            return cls(**found)
        except ValueError as error:  # of a value: a reader of the file looks for its line
            text = re.sub(r"^CrossSection\.(\w+)\[(\d+)\]", lambda m: f"line {lines[int(m[2])]}: {m[1]}", str(error))
            raise type(error)(f"{path}, {text}" if text != str(error) else f"{path}: {text}") from None

    @property
    def length(self) -> float:
        """From the first to the last station [m]."""
        return float(np.asarray(self.station)[-1] - np.asarray(self.station)[0])

    @property
    def slopes(self) -> tuple[float, float]:
        """Steepest fall and steepest rise along the path [-], both positive or 0."""
        slope = np.diff(np.asarray(self.bed)) / np.diff(np.asarray(self.station))
        return float(max(-slope.min(), 0.0)), float(max(slope.max(), 0.0))

    def level_at_depth(self, depth: float) -> float:
        """World z of the still surface at which the greatest depth is `depth` [m]."""
        level = float(np.min(self.bed)) + depth
        return unusual(level) if isinstance(depth, Unusual) else level

    def greatest_depth(self, level: float) -> float:
        """Greatest depth at a level [m]; 0 if all is dry."""
        return max(level - float(np.min(self.bed)), 0.0)

    def wetted(self, level: float) -> list[tuple[float, float]]:
        """Stations between which there is water [m], one pair for each stretch; a shoal parts them."""
        station, depth = np.asarray(self.station, float), level - np.asarray(self.bed, float)
        crossings = []
        for n in np.flatnonzero((depth[:-1] > 0.0) != (depth[1:] > 0.0)):
            part = depth[n] / (depth[n] - depth[n + 1])
            crossings.append(float(station[n] + part * (station[n + 1] - station[n])))
        if depth[0] > 0.0:
            crossings.insert(0, float(station[0]))
        if depth[-1] > 0.0:
            crossings.append(float(station[-1]))
        return list(zip(crossings[::2], crossings[1::2], strict=True))

    def edges(self, level: float) -> tuple[float, float]:
        """Stations of the first and the last edge of the water [m].

        Raises
        ------
        ValueError
            As `check_level`.
        """
        self.check_level(level)
        wet = self.wetted(level)
        return wet[0][0], wet[-1][1]

    def width(self, level: float) -> float:
        """Width of the water along the path [m]; shoals do not count."""
        return sum(far - near for near, far in self.wetted(level))

    def check_level(self, level: float) -> None:
        """Refuse a level that leaves all dry, or under which the section begins or ends.

        Raises
        ------
        ValueError
            With the heights and the remedy.
        ImplausibleValue
            If the water is implausibly deep.
        """
        bed = np.asarray(self.bed)
        if level <= bed.min():
            raise ValueError(
                f"level = {level:.6g} m lies below the bed everywhere (its lowest point is at {bed.min():.6g} m): "
                "there is no water. Raise it, and give both above the same datum."
            )
        deepest = DEPTH.plausible[1] if DEPTH.plausible else math.inf
        if level - bed.min() > deepest and not isinstance(level, Unusual):
            raise ImplausibleValue(
                f"level = {level:.6g} m lies {level - bed.min():.6g} m above the lowest point of the bed "
                f"({bed.min():.6g} m), and no depth beyond {deepest:g} m is plausible: are heights or stations in mm, "
                "or level and bed above different data? Give all in m, above the same datum."
            )
        for what, n, side in (("begins", 0, "first"), ("ends", -1, "last")):
            if bed[n] < level:
                raise ValueError(
                    f"CrossSection: it {what} under water, {level - bed[n]:.4g} m deep at its {side} station "
                    f"({np.asarray(self.station)[n]:.6g} m); add points up to the dry bank, or lower the level."
                )

    @checked
    def terrain(
        self,
        origin: Annotated[tuple[float, float], PLACE] = (0.0, 0.0),
        direction: Annotated[float, DIRECTION] = 0.0,
    ) -> Terrain:  # fmt: skip
        """Return the ground, alike along the river.

        Parameters
        ----------
        origin : (float, float)
            World x, y of station 0 [m].
        direction : float
            Direction of the path, counter-clockwise from world x [rad].
        """
        station, bed = self._evenly(RUN_OUT)
        return Terrain(
            heights=np.tile(bed, (2, 1)), origin=_place(origin, direction, station[0], -HALF_WIDTH),
            spacing=(station[1] - station[0], 2.0 * HALF_WIDTH), direction=direction,
        )  # fmt: skip

    @checked
    def water(
        self,
        level: Annotated[float, HEIGHT],
        discharge: Annotated[float | None, DISCHARGE] = None,
        *,
        density: float = 1000.0,
        origin: Annotated[tuple[float, float], PLACE] = (0.0, 0.0),
        direction: Annotated[float, DIRECTION] = 0.0,
    ) -> Water:
        """Return the water over the section, alike along the river.

        Without a discharge its current is that of the section, and still water if that has none. With one it is that of
        a river in which roughness and fall are the same all over (Manning): in proportion to the local depth to the
        power 2/3, so that the integral of current times depth over the width is the discharge. It is 0 on dry land.

        Parameters
        ----------
        level : float
            World z of the still surface [m].
        discharge : float, optional
            Of the whole river, positive to the left of the path [m^3/s].
        density : float
            [kg/m^3]
        origin, direction
            As for `terrain`.

        Raises
        ------
        ValueError
            As `check_level`; or if there is a discharge and a current.
        """
        self.check_level(level)
        if discharge is not None and (self.current is not None or self.along is not None):
            raise ValueError(
                "CrossSection.water: the section has a current of its own beside discharge; give only one."
            )
        if discharge is None and self.current is None and self.along is None:
            return Water(level=level, density=density)
        coarse, _ = self._evenly(0.0)
        station = np.linspace(coarse[0], coarse[-1], max(len(coarse), LEAST_POINTS))
        ground, nodes = self.terrain().as_arrays()  # the bed that is driven on
        depth = np.array([max(level - terrain_height(ground[0], nodes, x, 0.0)[0], 0.0) for x in station])
        across, along = np.zeros(len(station)), np.zeros(len(station))
        if discharge is not None:
            conveyance = depth ** (2.0 / 3.0)
            through = conveyance * depth
            across = discharge / (np.diff(station) * 0.5 * (through[1:] + through[:-1])).sum() * conveyance
        for values, found in ((self.current, across), (self.along, along)):
            if values is not None:
                found[:] = np.interp(station, np.asarray(self.station), np.asarray(values)) * (depth > 0.0)
        c, s = math.cos(direction), math.sin(direction)
        field = WaterField(
            np.full((2, len(station)), float(level)), np.tile(c * along - s * across, (2, 1)),
            np.tile(s * along + c * across, (2, 1)), _place(origin, direction, station[0], -HALF_WIDTH),
            (station[1] - station[0], 2.0 * HALF_WIDTH), direction, continued=True,
        )  # fmt: skip
        return Water(field=field, density=density)

    def _evenly(self, run_out: float) -> tuple[Array, Array]:
        """Stations at equal distances with the bed there, `run_out` [m] beyond both ends."""
        station, bed = np.asarray(self.station, float), np.asarray(self.bed, float)
        gaps = np.diff(station)
        step = float(gaps.min())
        even = gaps.max() - step <= 1e-6 * step
        if even:
            step = self.length / len(gaps)
        else:
            step = max(0.5 * step, self.length / MOST_POINTS)
        more = math.ceil(run_out / step)
        if 2 * more > MOST_POINTS:
            more = MOST_POINTS // 2
        count = round(self.length / step) if even else math.ceil(self.length / step)
        found = station[0] + step * np.arange(-more, count + more + 1)
        if even:
            return found, np.pad(bed, more, mode="edge")
        return found, np.interp(found, station, bed)


def _place(origin: tuple[float, float], direction: float, along: float, left: float) -> tuple[float, float]:
    """World x, y of a point so far along the path and to its left [m]."""
    c, s = math.cos(direction), math.sin(direction)
    return origin[0] + c * along - s * left, origin[1] + s * along + c * left


def _name_and_unit(title: str) -> tuple[str, str]:
    """Split the title of a column, ``Station [m]``, into its name, in small letters, and its unit, perhaps empty."""
    found = re.fullmatch(r"\s*([^\[(]*?)\s*(?:[\[(]\s*([^\])]*?)\s*[\])])?\s*", title)
    if found is None:
        return title.strip().casefold(), ""
    unit = (found[2] or "").replace(" s-1", "/s").replace(" s^-1", "/s")
    return found[1].casefold(), unit
