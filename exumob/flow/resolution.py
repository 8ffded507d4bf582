"""Can a grid carry a vehicle? Checks before a run: cells in the gaps, cells across a wheel, room in the window."""

from __future__ import annotations

import logging
import math
from typing import Annotated, NamedTuple

import numpy as np

from exumob.flow.cost import flow_cost
from exumob.flow.grid import BYTES_PER_CELL, Grid, most_cells
from exumob.flow.solids import Solid, vehicle_solids
from exumob.flow.tread import Tread
from exumob.support.cost import spelled_size, spelled_time
from exumob.support.declared import checked
from exumob.support.quantities import Quantity
from exumob.support.rotations import about_z
from exumob.vehicle.motion import WHEELS
from exumob.vehicle.parameters import Vehicle

logger = logging.getLogger(__name__)

ROUNDING = 0.02
"""Part by which a grid's cells may be larger than asked for, since whole cells must fit [-]."""
STEERING = Quantity("rad", at_least=-math.pi / 2.0, at_most=math.pi / 2.0)
"""Angle of a front wheel"""
LEAST_CELLS_IN_GAP = 2.0
LEAST_CELLS_ACROSS_WHEEL = 4.0
TOO_LONG = 86400.0
"""Computing time for a second above which a cell size is no advice [s]."""


@checked
def check_resolution(
    vehicle: Vehicle,
    grid: Grid,
    steering_range: Annotated[tuple[float, float], STEERING] = (0.0, 0.0),
    *,
    allow_coarse: bool = False,
) -> None:
    """Find out before a run whether a grid can carry a vehicle.

    Gaps between hull and wheels and under the keel need two cells, a wheel's width four; hull and wheels must stay
    inside the window.

    Parameters
    ----------
    vehicle : Vehicle
    grid : Grid
        In the hull's frame.
    steering_range : (float, float)
        Smallest and largest angle of a front wheel during the run [rad].
    allow_coarse : bool
        Log a warning where cells are too coarse. A vehicle outside the window or a bad mesh is always an error.

    Raises
    ------
    ValueError
        Naming the gap or the wheel, its size, and the cell size that would do; or the window that would do; or if the
        hull's mesh is not watertight or not in the vehicle's frame.
    """
    checked_solids(vehicle, grid, steering_range, allow_coarse)


def checked_solids(
    vehicle: Vehicle, grid: Grid, steering_range: tuple[float, float], allow_coarse: bool, tread: Tread | None = None
) -> tuple[Solid, ...]:
    """Return the solids of the five bodies for a grid, after the checks of `check_resolution`.

    Checks and solids come from one function because a hull's mesh is costly to sample and is sampled once here.
    """
    if vehicle.hull.mesh is not None:
        from exumob.water.wetted_surface import hull_surface

        hull_surface(vehicle)  # raises for a mesh that leaks, is turned inside out, or is in other units
    cell = _largest_cell(vehicle, grid)
    solids = vehicle_solids(vehicle, grid.smallest_width, tread)
    needs = _needs(vehicle, solids, steering_range)
    too_coarse = [need for need in needs if need.lacks(cell)]
    if not too_coarse:
        return solids
    message = "; ".join(need.said(cell) for need in too_coarse)
    if not allow_coarse:
        raise ValueError(
            f"{vehicle.name}: {message}; {_remedy(too_coarse, grid)}, or accept coarse cells (allow_coarse, --coarse) "
            "for a quick look."
        )
    finest = min(need.finest for need in too_coarse)
    logger.warning("%s: %s; loads of this run are rough (%g m would do).", vehicle.name, message, finest)
    return solids


def lengths_in_cells(
    vehicle: Vehicle, grid: Grid, steering_range: tuple[float, float] = (0.0, 0.0)
) -> tuple[list[str], list[str]]:
    """Say of which lengths of a vehicle a grid has enough cells, and of which it has not.

    Parameters
    ----------
    vehicle, grid, steering_range
        As for `check_resolution`.

    Returns
    -------
    resolved, lost : list of str
        A line for each gap and for the width of a wheel: its size, the cells that it has and those that it needs.

    Raises
    ------
    ValueError
        As `check_resolution` does whatever the cells are.
    """
    cell = _largest_cell(vehicle, grid)
    needs = _needs(vehicle, vehicle_solids(vehicle, grid.smallest_width), steering_range)
    resolved = [need.said(cell) for need in needs if not need.lacks(cell)]
    return resolved, [f"{need.said(cell)} ({need.finest:g} m would do)" for need in needs if need.lacks(cell)]


def _remedy(too_coarse: list[_Need], grid: Grid) -> str:
    """Say which cells would do and what they take, and how to do without where they would take too much."""
    costs = {need: _cost_of(need.finest, grid) for need in too_coarse}
    possible = [need for need, (cells, seconds) in costs.items() if cells <= most_cells() and seconds <= TOO_LONG]
    words = []
    for need, (cells, seconds) in costs.items():
        if need not in possible:
            words.append(
                f"cells of {need.finest:g} m for {need.what} would take {_spelled(cells, seconds)}, too much for this "
                f"machine: {need.remedy}"
            )
    if possible:
        finest = min(need.finest for need in possible)
        taken = _spelled(*_cost_of(finest, grid))
        words.append(f"use a cell size of {finest:g} m or less{' for the rest' if words else ''} ({taken})")
    return "; ".join(words)


def _cost_of(cell_size: float, grid: Grid) -> tuple[float, float]:
    """Cells of the window, and time [s] for a second at 1 m/s on one thread, about."""
    cells = grid.cells_with(cell_size)
    return cells, flow_cost(cells, cell_size, 1.0, 1.0, 1e-3, 0.4).seconds


def _spelled(cells: float, seconds: float) -> str:
    return (
        f"about {cells:.2g} cells, {spelled_size(BYTES_PER_CELL * cells)} of memory, {spelled_time(seconds)} for a "
        "second at 1 m/s on one thread"
    )


class _Need(NamedTuple):
    """A length that must hold some cells."""

    what: str
    size: float  # [m]
    least: float  # [cells]
    remedy: str  # other than smaller cells

    @property
    def finest(self) -> float:
        """Cell size that would do [m], three digits long."""
        exact = self.size / self.least
        unit = 10.0 ** (math.floor(math.log10(exact)) - 2)
        return math.floor(exact / unit + 1e-9) * unit

    def said(self, cell: float) -> str:
        """Say how many cells it has, and how many it needs."""
        return (
            f"{self.what} of {1e3 * self.size:.1f} mm has {self.size / cell:.1f} cells of {1e3 * cell:.1f} mm and "
            f"needs {self.least:g}"
        )

    def lacks(self, cell: float) -> bool:
        return self.size > 0.0 and self.size / cell < self.least * (1.0 - ROUNDING)


def _needs(vehicle: Vehicle, solids: tuple[Solid, ...], steering_range: tuple[float, float]) -> list[_Need]:
    """Lengths of a vehicle that a grid must resolve; raises if a wheel cuts into the hull."""
    hull, *_, wheel = solids
    angles = sorted({0.0, *np.linspace(*steering_range, 13)})
    gaps = [(_gap(vehicle, hull, wheel, angle, k), angle, k) for angle in angles for k in (0, 1)]
    gaps += [(_gap(vehicle, hull, wheel, 0.0, k), 0.0, k) for k in (2, 3)]
    gap, angle, k = min(gaps)
    name = WHEELS[k].replace("_", " ")
    if gap <= 0.0:
        raise ValueError(
            f"{vehicle.name}: the {name} wheel cuts {-1e3 * gap:.0f} mm into the hull when steered "
            f"{math.degrees(angle):.0f} deg; steer less, widen Vehicle.track, narrow Hull.width, or give "
            "Hull.wheel_arches, or a Hull.mesh with them."
        )
    keel = float(vehicle.hull.center_of_mass_height + hull.low[2])
    steered = f" steered {math.degrees(angle):.0f} deg" if abs(angle) > 0.005 else ""
    return [
        _Need(
            f"the gap between hull and {name} wheel{steered}", gap, LEAST_CELLS_IN_GAP,
            "make it wider (Vehicle.track, Hull.width, Hull.wheel_arches"
            f"{', less steering' if steered else ''})",
        ),
        _Need("the gap between keel and bed", keel, LEAST_CELLS_IN_GAP, "raise Hull.ground_clearance"),
        _Need("a wheel's width", vehicle.wheel.width, LEAST_CELLS_ACROSS_WHEEL, "widen Wheel.width"),
    ]  # fmt: skip


def _largest_cell(vehicle: Vehicle, grid: Grid) -> float:
    """Largest horizontal width of the cells that the vehicle overlaps [m]; raises if it leaves the window."""
    largest = []
    for faces, (low, high) in zip((grid.x_faces, grid.y_faces), _extents(vehicle, grid), strict=True):
        overlap = (faces[1:] > low) & (faces[:-1] < high)
        largest.append(np.diff(faces).max(initial=0.0, where=overlap))
    return float(max(largest))


def _extents(vehicle: Vehicle, grid: Grid) -> list[tuple[float, float]]:
    """Extents of the five bodies along the grid's x and y [m]; raises if they leave the window."""
    hull, radius = vehicle.hull, vehicle.wheel.radius
    turning = math.hypot(radius, 0.5 * vehicle.wheel.width)
    stern, bow = (end - vehicle.hull_origin for end in hull.extent)
    axles = np.array([0.5, -0.5]) * vehicle.wheelbase - hull.center_of_mass_x
    extents = [
        (min(float(stern[0]), axles[1] - radius), max(float(bow[0]), axles[0] + turning)),
        (-max(float(bow[1]), 0.5 * vehicle.track + turning), max(float(bow[1]), 0.5 * vehicle.track + turning)),
    ]
    margin = 3.0 * grid.smallest_width
    for axis, faces, (low, high) in zip("xy", (grid.x_faces, grid.y_faces), extents, strict=True):
        if low - margin < faces[0] or high + margin > faces[-1]:
            raise ValueError(
                f"{vehicle.name} reaches from {low:.3f} to {high:.3f} m along {axis} (from the hull's centre of mass), "
                f"the window only from {faces[0]:.3f} to {faces[-1]:.3f} m; Grid.{axis}_faces must reach three cells "
                f"({1e3 * margin:.0f} mm) beyond it on both sides, and some hull lengths for the waves."
            )
    return extents


def _gap(vehicle: Vehicle, hull: Solid, wheel: Solid, angle: float, k: int) -> float:
    """Least distance [m] between the hull and wheel k turned by `angle` [rad], from points on the wheel's surface."""
    radius, half, edge = wheel.shape.half_x, wheel.shape.half_y, wheel.shape.edge_radius
    around = np.linspace(0.0, 2.0 * math.pi, 37)[:-1]
    corner = np.linspace(0.0, 0.5 * math.pi, 7)
    rings = [(radius - edge * (1.0 - math.cos(a)), half - edge * (1.0 - math.sin(a))) for a in corner]
    rings += [(part * (radius - edge), half) for part in (0.5, 0.0)]
    rings += [(r, -y) for r, y in rings]
    points = np.array([[r * math.cos(a), y, r * math.sin(a)] for r, y in rings for a in around])
    turned = points @ about_z(angle).T
    return float(hull.distance(turned + vehicle.wheel_centers[k] - vehicle.hull_origin).min())
