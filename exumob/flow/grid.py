"""Cartesian, mildly stretched grid of the flow solver.

Grid axes: x forward, y left, z up from the world's z = 0, origin below the vehicle's reference point; the grid may
translate and yaw over the bed. Arrays are ordered [j, k, i] (y, z, x; x fastest) and carry `HALO` cells on every side.
A velocity component is stored on the low face of its cell.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from exumob.support.arrays import Array, checked_array
from exumob.support.cost import memory_limit, spelled_size
from exumob.support.declared import checked
from exumob.support.quantities import CELL_SIZE, Quantity
from exumob.vehicle.parameters import Vehicle

HALO = 2
"""Cells beyond the window on every side. Those below it hold saturated soil when forces are summed."""
SMALLEST = 1e-7
"""Least width of a cell [m]."""
LEAST_CELLS = 4
"""Cells along an axis."""
MOST_CELLS = 2**31 - 1
"""Cells of a grid; far beyond any memory."""
LENGTH = Quantity("m", at_least=-1e5, at_most=1e5)
"""Place of a face or a corner"""
REACH = Quantity("m", above=0.0, at_most=1e5)
"""Distance from the hull to a side of the window"""
CORE_TOP = 1.2
"""Height up to which cells round a vehicle are cubes, over the tyre's diameter [-]."""
GROWTH = Quantity("1", at_least=1.0, at_most=1.1, remedy="strong stretching slows the pressure solver.")
"""Ratio of neighbouring widths"""
Span = tuple[float, float, float, float]
"""Low end of a window, low and high end of its core, and high end, along an axis [m]"""
BYTES_PER_CELL = 515.0
"""Memory of the solver, all fields and levels together [bytes] (`benchmarks/flow_scaling.py`)."""


class Metrics(NamedTuple):
    """Coordinates and widths [m], halo included; one array an axis: low faces f (one longer), centres c, widths d,
    distances e from the centre before.
    """

    xf: Array
    xc: Array
    dx: Array
    ex: Array
    yf: Array
    yc: Array
    dy: Array
    ey: Array
    zf: Array
    zc: Array
    dz: Array
    ez: Array


class GridVelocity(NamedTuple):
    """Motion of the grid over the bed during a step, in the grid's own axes."""

    x: float
    y: float
    """Velocity of the origin [m/s]"""
    yaw_rate: float
    """[rad/s]"""


@dataclass(frozen=True)
class Grid:
    """Window of the flow: faces along x, y and z [m], each increasing.

    z starts at the bed, z = 0; with a given bed at or below its lowest point.

    Raises
    ------
    ValueError
        If faces do not increase, neighbouring widths differ by more than 15 %, or an axis has fewer than 4 cells.
    """

    x_faces: Array
    y_faces: Array
    z_faces: Array

    def __post_init__(self) -> None:
        for name in ("x_faces", "y_faces", "z_faces"):
            faces = checked_array(f"Grid.{name}", getattr(self, name), ("faces",)).copy()
            widths = np.diff(faces)
            if len(widths) < LEAST_CELLS:
                raise ValueError(
                    f"Grid.{name} makes {len(widths)} cells; every axis needs at least {LEAST_CELLS}; give more faces."
                )
            if widths.min() <= 0.0:
                n = int(widths.argmin())
                raise ValueError(
                    f"Grid.{name}: face {n + 1} at {faces[n + 1]:g} m follows one at {faces[n]:g} m; faces must "
                    "increase."
                )
            if max(-faces[0], faces[-1]) > LENGTH.at_most or widths.min() < SMALLEST:
                raise ValueError(
                    f"Grid.{name} goes from {faces[0]:g} to {faces[-1]:g} m in widths of {widths.min():g} m or more; "
                    f"faces must lie within {LENGTH.at_most:g} m of the origin, {SMALLEST:g} m apart. Give metres."
                )
            jump = float(np.max(np.abs(np.diff(np.log(widths)))))
            if jump > math.log(1.15):
                raise ValueError(
                    f"Grid.{name}: neighbouring widths differ by {100 * (math.exp(jump) - 1):.0f} %; keep the growth "
                    "below 15 % (better 4 %): the pressure solver slows down and waves reflect."
                )
            object.__setattr__(self, name, faces)

    @classmethod
    @checked
    def uniform(
        cls,
        low: Annotated[ArrayLike, Quantity("m", shape=(3,))],
        high: Annotated[ArrayLike, Quantity("m", shape=(3,))],
        cell_size: Annotated[float | tuple[float, float, float], CELL_SIZE],
    ) -> Grid:
        """Uniform grid between two corners [m], shape (3,); the cell size [m] is rounded so that whole cells fit."""
        low, high = np.asarray(low), np.asarray(high)
        sizes = np.broadcast_to(np.asarray(cell_size), (3,))

        def counts(factor: float) -> list[float]:
            return [max((high[a] - low[a]) / (factor * float(sizes[a])), 1.0) for a in range(3)]

        _require_countable("Grid.uniform", float(sizes.min()), lambda size: counts(size / float(sizes.min())))
        return cls(*(np.linspace(low[a], high[a], round(n) + 1) for a, n in enumerate(counts(1.0))))

    @classmethod
    @checked
    def stretched(
        cls,
        core_low: Annotated[ArrayLike, Quantity("m", shape=(3,))],
        core_high: Annotated[ArrayLike, Quantity("m", shape=(3,))],
        low: Annotated[ArrayLike, Quantity("m", shape=(3,))],
        high: Annotated[ArrayLike, Quantity("m", shape=(3,))],
        cell_size: Annotated[float, CELL_SIZE],
        growth: Annotated[float, GROWTH] = 1.035,
    ) -> Grid:
        """Cubic cells in a core, growing geometrically from there to the window's faces.

        Parameters
        ----------
        core_low, core_high, low, high : array-like, shape (3,)
            Corners of the core and of the window [m].
        cell_size : float
            Edge of the core's cells [m], > 0.
        growth : float
            Ratio of neighbouring widths outside the core, 1 to 1.1.
        """
        corners = [np.asarray(c) for c in (low, core_low, core_high, high)]
        if not (np.diff(corners, axis=0) >= 0.0).all() or not (corners[1] < corners[2]).all():
            raise ValueError(
                f"Grid.stretched: the core from {corners[1]} to {corners[2]} m must lie inside the window from "
                f"{corners[0]} to {corners[3]} m; move their corners."
            )
        outer_low, inner_low, inner_high, outer_high = (corner.tolist() for corner in corners)
        spans = list(zip(outer_low, inner_low, inner_high, outer_high, strict=True))
        _require_countable(
            "Grid.stretched", cell_size, lambda size: [_graded_count(*span, size, growth) for span in spans]
        )
        return cls(*(graded_faces(*span, cell_size, growth) for span in spans))

    @classmethod
    @checked
    def around_vehicle(  # the sides of the window
        cls,
        vehicle: Vehicle,
        cell_size: Annotated[float, CELL_SIZE] = 0.018,
        *,
        ahead: Annotated[float, REACH] = 1.8,
        behind: Annotated[float, REACH] = 2.4,
        aside: Annotated[float, REACH] = 1.8,
        top: Annotated[float, LENGTH] = 0.42,
        growth: Annotated[float, GROWTH] = 1.035,
        bottom: Annotated[float, LENGTH] = 0.0,
        core_top: Annotated[float, LENGTH] | None = None,
        hull_on_faces: bool = False,
    ) -> Grid:
        """Window round a vehicle's hull: cubic cells where its bodies are, growing outwards.

        Parameters
        ----------
        vehicle : Vehicle
        cell_size : float
            In the core [m]; a gap between hull and wheel needs two cells.
        ahead, behind, aside : float
            Distances from the hull's reference point to the window's sides [m].
        top : float
            Height of the window above z = 0 [m]; three times the depth or more.
        growth : float
            Ratio of neighbouring widths outside the core [-].
        bottom : float
            Lowest face [m]: the bed, or the lowest bed on the window's way if that is given.
        core_top : float, optional
            Height up to which cells are cubes [m]; default 1.2 diameters of the tyre.
        hull_on_faces : bool
            Whether bow, stern and sides of the hull lie on faces, for which cells along x and y are a little longer or
            shorter than `cell_size`. An edge that passes through a cell is rounded off by half of it (`exumob verify
            sharp-columns`): without this, loads depend on where the hull happens to lie in its cells.
        """
        hull, wheel = vehicle.hull, vehicle.wheel
        low, high = (end - vehicle.hull_origin for end in hull.extent)
        front = max(float(high[0]), 0.5 * vehicle.wheelbase + wheel.radius) + 0.1
        rear = min(float(low[0]), -0.5 * vehicle.wheelbase - wheel.radius) - 0.15
        side = max(float(high[1]), 0.5 * (vehicle.track + wheel.width) + 0.3 * wheel.diameter) + 0.06
        if ahead < front or behind < -rear or aside < side:
            raise ValueError(
                f"Grid.around_vehicle: the window ({ahead:g} m ahead, {behind:g} m behind, {aside:g} m "
                f"aside) is smaller than {vehicle.name} with its margin ({front:.2f}, {-rear:.2f}, {side:.2f} m); give "
                "at least these."
            )
        if not bottom < top:
            raise ValueError(f"Grid.around_vehicle: top = {top:g} m must lie above bottom = {bottom:g} m; raise it.")
        core_top = CORE_TOP * wheel.diameter if core_top is None else core_top
        core_top = min(max(core_top, bottom + 4.0 * cell_size), top)
        spans = [(-behind, rear, front, ahead), (-aside, -side, side, aside), (bottom, bottom, core_top, top)]
        widths = [cell_size, cell_size, cell_size]
        _require_countable(
            "Grid.around_vehicle", cell_size, lambda size: [_graded_count(*span, size, growth) for span in spans]
        )
        if hull_on_faces:
            for axis in range(2):
                ends = float(low[axis]), float(high[axis])
                spans[axis], widths[axis] = _fitted_span(spans[axis], ends, cell_size)
        return cls(*(graded_faces(*span, width, growth) for span, width in zip(spans, widths, strict=True)))

    @property
    def shape(self) -> tuple[int, int, int]:
        """Numbers of cells (y, z, x) without halo."""
        return len(self.y_faces) - 1, len(self.z_faces) - 1, len(self.x_faces) - 1

    @property
    def padded_shape(self) -> tuple[int, int, int]:
        """Shape of a field, halo included."""
        ny, nz, nx = self.shape
        return ny + 2 * HALO, nz + 2 * HALO, nx + 2 * HALO

    @property
    def n_cells(self) -> int:
        """Number of cells without halo."""
        return math.prod(self.shape)

    @property
    def smallest_width(self) -> float:
        """Least width of a cell along any axis [m]."""
        return float(min(np.diff(f).min() for f in (self.x_faces, self.y_faces, self.z_faces)))

    def cells_with(self, cell_size: float) -> float:
        """Number of cells, about, of a window like this one with another smallest width [m]."""
        number = 1.0
        for faces in (self.x_faces, self.y_faces, self.z_faces):
            widths = np.diff(faces)
            core = np.flatnonzero(widths <= 1.001 * widths.min())
            first, last = int(core[0]), int(core[-1])
            growth = float(np.exp(np.abs(np.diff(np.log(widths))).max()))
            number *= _graded_count(
                float(faces[0]), float(faces[first]), float(faces[last + 1]), float(faces[-1]),
                cell_size * float(widths.min()) / self.smallest_width, growth,
            )  # fmt: skip
        return number

    @cached_property
    def metrics(self) -> Metrics:
        """Coordinates and widths with halo."""
        parts: list[Array] = []
        for faces in (self.x_faces, self.y_faces, self.z_faces):
            first, last = faces[1] - faces[0], faces[-1] - faces[-2]
            before = faces[0] - first * np.arange(HALO, 0, -1)
            after = faces[-1] + last * np.arange(1, HALO + 1)
            f = np.concatenate([before, faces, after])
            centers = 0.5 * (f[:-1] + f[1:])
            parts += [f, centers, np.diff(f), np.concatenate([[first], np.diff(centers)])]
        return Metrics(*parts)

    def zeros(self) -> Array:
        """Field of zeros, halo included."""
        return np.zeros(self.padded_shape)

    def cell_volumes(self) -> Array:
        """Volumes without halo [m^3], shape (y, z, x)."""
        dx, dy, dz = np.diff(self.x_faces), np.diff(self.y_faces), np.diff(self.z_faces)
        return dy[:, None, None] * dz[None, :, None] * dx[None, None, :]


def most_cells() -> float:
    """Return the number of cells for which this machine has memory."""
    return min(memory_limit() / BYTES_PER_CELL, MOST_CELLS)


def fitting_size(cell_size: float, cells: Callable[[float], float]) -> float:
    """Return a cell size [m], two digits long, that makes no more cells than fit; `cell_size` makes too many.

    Parameters
    ----------
    cell_size : float
        [m]
    cells : callable
        Number of cells of a cell size [m].
    """
    fine, coarse, most = cell_size, cell_size, most_cells()
    while cells(coarse) > most and coarse < 1e300:
        fine, coarse = coarse, 10.0 * coarse
    while coarse > 1.005 * fine:
        middle = math.sqrt(fine) * math.sqrt(coarse)
        fine, coarse = (middle, coarse) if cells(middle) > most else (fine, middle)
    unit = 10.0 ** (math.floor(math.log10(coarse)) - 1)
    return math.ceil(coarse / unit) * unit


def _require_countable(owner: str, cell_size: float, counts: Callable[[float], list[float]]) -> None:
    """Refuse a cell size that makes too few cells along an axis, or more than any memory holds; nothing is allocated.

    Parameters
    ----------
    owner : str
    cell_size : float
        [m]
    counts : callable
        Number of cells along x, y and z of a cell size [m].
    """
    along = counts(cell_size)
    if min(along) < LEAST_CELLS - 0.5:
        axis = along.index(min(along))
        raise ValueError(
            f"{owner}.cell_size = {cell_size:g} m makes {along[axis]:.1f} cells along {'xyz'[axis]}; every axis needs "
            f"at least {LEAST_CELLS}, so give a smaller one."
        )
    if not math.prod(along) <= MOST_CELLS:
        size = fitting_size(cell_size, lambda size: math.prod(counts(size)))
        raise ValueError(
            f"{owner}.cell_size = {cell_size:g} m makes {math.prod(along):.2g} cells, about "
            f"{spelled_size(BYTES_PER_CELL * math.prod(along))} of memory, and this machine has "
            f"{spelled_size(memory_limit())}; cells of {size:g} m would fit."
        )


def _fitted_span(span: Span, body: tuple[float, float], size: float) -> tuple[Span, float]:
    """Widen the core of a span so that the ends of a body in it lie on faces; return it with the width that does so.

    Parameters
    ----------
    span : Span
        Low end, core's low and high end, high end [m].
    body : two floats
        Ends of the body, within the core [m].
    size : float
        Width of the cells that is wanted [m].
    """
    count = round((body[1] - body[0]) / size)
    if count < 1:  # the body is lost in a cell
        return span, size
    width = (body[1] - body[0]) / count
    core_low = body[0] - math.ceil((body[0] - span[1]) / width - 1e-9) * width
    core_high = body[1] + math.ceil((span[2] - body[1]) / width - 1e-9) * width
    return (min(span[0], core_low), core_low, core_high, max(span[3], core_high)), width


def _graded_count(low: float, core_low: float, core_high: float, high: float, size: float, growth: float) -> float:
    """Number of cells, about, that `graded_faces` makes."""

    def outward(extent: float) -> float:
        cells = extent / size
        return cells if growth <= 1.0 else math.log1p(cells * (growth - 1.0) / growth) / math.log(growth)

    return max((core_high - core_low) / size, 1.0) + outward(core_low - low) + outward(high - core_high)


def graded_faces(low: float, core_low: float, core_high: float, high: float, size: float, growth: float) -> Array:
    """Faces [m] of equal width in [core_low, core_high], growing by `growth` outwards to `low` and `high`.

    The core's cells are rounded to fit; the outermost cells may reach up to one width beyond `low` and `high`.
    """
    if not low <= core_low < core_high <= high:
        raise ValueError(f"the core [{core_low:g}, {core_high:g}] m must lie inside the window [{low:g}, {high:g}] m.")
    count = max(round((core_high - core_low) / size), 1)
    core = np.linspace(core_low, core_high, count + 1)
    size = (core_high - core_low) / count

    def outward(extent: float) -> Array:
        ends: list[float] = []
        width = size
        while (ends[-1] if ends else 0.0) < extent - 1e-9:
            width *= growth
            ends.append((ends[-1] if ends else 0.0) + width)
        return np.array(ends)

    below, above = outward(core_low - low), outward(high - core_high)
    return np.concatenate([core[0] - below[::-1], core, core[-1] + above])
