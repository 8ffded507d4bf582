"""Hydrostatics: exact integrals of the water's pressure over the wetted part of a closed surface.

Every integral over the part of a surface below the still-water plane is exact for its triangles: those that cross the
plane are clipped, and the pressure rho g (level - z) is linear on what remains. The part of a body below the soil
surface is called buried, the part between it and the water plane exposed. The bed's height is taken at the corners of
each triangle and linear in between: exact over a plane. With pore pressure the total does not depend on the bed at all.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from exumob.ground.terrain import Terrain, terrain_height
from exumob.support.arrays import Array
from exumob.support.constants import GRAVITY
from exumob.support.declared import checked
from exumob.support.kernels import njit
from exumob.support.quantities import Quantity
from exumob.vehicle.motion import BodyStates
from exumob.water.conditions import Water
from exumob.water.wetted_surface import Integers, Surface

ROTATION = Quantity("1", shape=(3, 3))
POSITION = Quantity("m", at_least=-1e9, at_most=1e9, shape=(3,))
LEVEL = Quantity("m", at_least=-1e4, at_most=1e4)
DENSITY = Quantity("kg/m^3", above=0.0, plausible=(700.0, 1500.0))
UNDER_WATER, ABOVE_BED, BELOW_BED, INLAND, OFFSHORE = range(5)
"""Parts of a polygon that `_clip` keeps: what is under water; of that what is above and what is below the bed; of the
latter what is below dry land, and what is below water."""
MOST_NODES = 64.0
"""Cells of a terrain within the square of a body's reach from which on its bed is not bounded beforehand."""

WET_INTEGRALS = np.dtype(
    [
        ("exposed_wrench", float, 6), ("buried_wrench", float, 6), ("submerged_volume", float),
        ("buried_volume", float), ("exposed_area", float), ("draught", float),
    ]
)  # fmt: skip
"""Record of the integrals over the wet part of a surface, body axes about the body's origin.

``exposed_wrench``, ``buried_wrench``: integrals of -depth n [m^3] and of -depth r x n [m^4] over the exposed and the
buried part, which times density and gravity are force and moment; ``submerged_volume``: below the water plane, soil
included; ``buried_volume``: below the soil surface [m^3]; ``exposed_area`` [m^2]; ``draught``: depth of the lowest
exposed point below the water plane [m]."""


@dataclass(frozen=True)
class Wetted:
    """Volumes and areas of a surface under water."""

    submerged_volume: float
    """Volume below the water plane, soil included [m^3]"""
    exposed_volume: float
    """Volume between the soil surface and the water plane [m^3]"""
    wetted_area: float
    """Area of the exposed part [m^2]"""
    draught: float
    """Depth of the lowest exposed point below the water plane [m]"""
    projected_area: Array
    """Half the integral of |n| over the exposed part, for the body's x, y, z [m^2], shape (3,): the frontal and lateral
    area, and the plan area of a fully immersed body (half of it when only the bottom is wet)"""


@checked
def hydrostatic_wrench(
    surface: Surface,
    rotation: Annotated[ArrayLike, ROTATION],
    position: Annotated[ArrayLike, POSITION],
    level: Annotated[float, LEVEL],
    density: Annotated[float, DENSITY] = 1000.0,
    *,
    pore_pressure: bool = True,
    terrain: Terrain | None = None,
) -> Array:
    """Return the force and moment of still water on a body, in the body's own axes about its origin.

    Parameters
    ----------
    surface : Surface
    rotation : array-like, shape (3, 3)
        Rotation matrix, body -> world.
    position : array-like, shape (3,)
        Body's origin, world axes [m].
    level : float
        World z of the water plane [m].
    density : float
        [kg/m^3]
    pore_pressure : bool
        True: the pressure continues below the soil surface, and Archimedes' principle holds for a sunk body. False: no
        pressure acts on the buried part.
    terrain : Terrain, optional
        The bed; default: flat at z = 0.

    Returns
    -------
    array, shape (6,)
        Force [N], moment [N m].

    Raises
    ------
    ValueError
        If a value is not finite or of another shape, or if `rotation` is no rotation.
    """
    total, _ = _integrals(surface, rotation, position, level, terrain)
    wrench = total["exposed_wrench"] + total["buried_wrench"] if pore_pressure else total["exposed_wrench"]
    return np.asarray(density * GRAVITY * wrench)


def still_water_wrenches(
    surfaces: Sequence[Surface], states: BodyStates, water: Water, terrain: Terrain | None = None
) -> Array:  # fmt: skip
    """Return the wrenches of still water on all bodies at the last instant of their states [N, N m], shape (n, 6).

    Parameters
    ----------
    surfaces : sequence of Surface
        One for each body.
    states : BodyStates
    water : Water
        Its current is not felt; its level is that below each body's origin.
    terrain : Terrain, optional
        The bed; default: flat at z = 0.
    """
    levels, _ = water.at(states.position[-1, :, :2], terrain)
    poses = zip(surfaces, states.rotation[-1], states.position[-1], levels, strict=True)
    return np.array([hydrostatic_wrench(*pose, water.density, terrain=terrain) for pose in poses])


@checked
def wetted(
    surface: Surface,
    rotation: Annotated[ArrayLike, ROTATION],
    position: Annotated[ArrayLike, POSITION],
    level: Annotated[float, LEVEL],
    terrain: Terrain | None = None,
) -> Wetted:
    """Measure the part of a body's surface under water; parameters as for `hydrostatic_wrench`."""
    total, area_moments = _integrals(surface, rotation, position, level, terrain)
    submerged, buried = float(total["submerged_volume"]), float(total["buried_volume"])
    return Wetted(
        submerged, submerged - buried, float(total["exposed_area"]), float(total["draught"]),
        area_moments[:, :, 0].sum(axis=0),
    )  # fmt: skip


def _integrals(
    surface: Surface, rotation: ArrayLike, position: ArrayLike, level: float, terrain: Terrain | None
) -> tuple[np.record, Array]:  # fmt: skip
    """Return the record and the area moments of `wet_integrals` for a body at a position."""
    turn = np.array(rotation, dtype=float, order="C")
    if np.abs(turn @ turn.T - np.eye(3)).max() > 1e-6 or np.linalg.det(turn) < 0.0:
        raise ValueError("rotation is no rotation matrix: its rows must be orthogonal unit vectors, right-handed.")
    place = np.array(position, dtype=float)
    total, area_moments = np.zeros(1, WET_INTEGRALS), np.zeros((surface.n_cells, 3, 4))
    bed = (Terrain() if terrain is None else terrain).as_arrays()
    wet_integrals(
        surface.triangles, surface.cells, turn, place, float(level), *bed, total, area_moments, clipping_space()
    )  # fmt: skip
    return total[0], area_moments


def clipping_space() -> Array:
    """Return the work space of `wet_integrals`: three polygons of up to nine corners (x, y, z, depth, cover)."""
    return np.empty((3, 9, 5))


@njit(cache=True, error_model="numpy")
def wet_integrals(  # a kernel: a surface, its pose, the water, the bed, and what is filled
    triangles: Array, cells: Integers, rotation: Array, position: Array, level: float, bed: NDArray[np.void],
    bed_nodes: Array, totals: NDArray[np.void], area_moments: Array, scratch: Array,
) -> None:  # fmt: skip
    """Add the integrals over the wet part of a surface; body axes about the body's origin.

    Parameters
    ----------
    triangles, cells
        As in `Surface`.
    rotation : array, shape (3, 3)
        Body -> world.
    position : array, shape (3,)
        World coordinates of the body's origin [m].
    level : float
        World z of the water plane [m].
    bed, bed_nodes : array
        `Terrain.as_arrays`.
    totals : array of `WET_INTEGRALS`, shape (1,), changed
    area_moments : array, shape (n_cells, 3, 4), changed
        Per cell and body axis, over the exposed part: integral of |n| / 2 [m^2], then that of r |n| / 2, three
        components [m^3].
    scratch : array, shape (3, 9, 5)
        Work space, `clipping_space`.
    """
    total, ground, up, height = totals[0], bed[0], rotation[2], position[2]
    even = bed_nodes.shape[1] == 0 and ground.slope_x == 0.0 and ground.slope_y == 0.0
    highest_bed = ground.height if even else _highest_bed(triangles, position, ground, bed_nodes)
    cover = level - highest_bed  # depth of the bed below the water plane
    for t in range(triangles.shape[0]):
        highest, lowest = -np.inf, np.inf  # depths
        for i in range(3):
            depth = level - height
            for k in range(3):
                scratch[0, i, k] = triangles[t, i, k]
                depth -= up[k] * triangles[t, i, k]
            scratch[0, i, 3], scratch[0, i, 4] = depth, cover
            highest, lowest = max(highest, depth), min(lowest, depth)
        if highest <= 0.0:
            continue
        buried = highest > cover  # at its lowest corner
        if buried and not even:
            buried = False
            for i in range(3):
                x, y = position[0], position[1]
                for k in range(3):
                    x += rotation[0, k] * triangles[t, i, k]
                    y += rotation[1, k] * triangles[t, i, k]
                scratch[0, i, 4] = level - terrain_height(ground, bed_nodes, x, y)[0]
                buried = buried or scratch[0, i, 3] > scratch[0, i, 4]
        wet, n_wet = 0, 3
        if lowest < 0.0:
            wet, n_wet = 1, _clip(scratch[0], 3, UNDER_WATER, scratch[1])
        if buried:
            n_exposed = _clip(scratch[wet], n_wet, ABOVE_BED, scratch[2])
            _add_polygon(scratch[2], n_exposed, cells[t], up, True, total, area_moments)
            other = 1 - wet
            n_below = _clip(scratch[wet], n_wet, BELOW_BED, scratch[other])
            if not _on_shore(scratch[other], n_below):
                _add_polygon(scratch[other], n_below, cells[t], up, False, total, area_moments)
                continue
            n_inland = _clip(scratch[other], n_below, INLAND, scratch[2])
            for i in range(n_inland):
                scratch[2, i, 4] = 0.0  # all that is under water is buried
            _add_polygon(scratch[2], n_inland, cells[t], up, False, total, area_moments)
            n_offshore = _clip(scratch[other], n_below, OFFSHORE, scratch[2])
            _add_polygon(scratch[2], n_offshore, cells[t], up, False, total, area_moments)
        else:
            _add_polygon(scratch[wet], n_wet, cells[t], up, True, total, area_moments)


@njit(cache=True, error_model="numpy")
def _highest_bed(triangles: Array, position: Array, ground: Any, nodes: Array) -> float:
    """Bound the height of the bed below a body from above [m]; inf where that takes longer than to look."""
    reach = 0.0
    for t in range(triangles.shape[0]):
        for i in range(3):
            x, y, z = triangles[t, i, 0], triangles[t, i, 1], triangles[t, i, 2]
            reach = max(reach, x * x + y * y + z * z)
    reach = math.sqrt(reach)
    plane = ground.height + ground.slope_x * position[0] + ground.slope_y * position[1]
    plane += reach * math.hypot(ground.slope_x, ground.slope_y)
    n_y, n_x, _ = nodes.shape
    if n_x == 0:
        return plane
    away_x, away_y = position[0] - ground.origin_x, position[1] - ground.origin_y
    column = (away_x * ground.cos + away_y * ground.sin) / ground.spacing_x
    row = (away_y * ground.cos - away_x * ground.sin) / ground.spacing_y
    columns, rows = reach / ground.spacing_x, reach / ground.spacing_y
    if not columns * rows < MOST_NODES or math.isnan(column) or math.isnan(row):
        return np.inf
    i0, i1 = int(min(max(column - columns, 0.0), n_x - 1.0)), int(min(max(column + columns, 0.0), n_x - 2.0)) + 1
    j0, j1 = int(min(max(row - rows, 0.0), n_y - 1.0)), int(min(max(row + rows, 0.0), n_y - 2.0)) + 1
    top = -np.inf
    for j in range(j0, j1 + 1):
        for i in range(i0, i1 + 1):
            top = max(top, nodes[j, i, 0])
    return plane + top


@njit(cache=True, error_model="numpy")
def _on_shore(polygon: Array, n: int) -> bool:
    """Tell if the bed above some corner of a polygon is dry land."""
    for i in range(n):
        if polygon[i, 4] < 0.0:
            return True
    return False


@njit(cache=True, error_model="numpy", inline="always")
def _inside(polygon: Array, i: int, part: int) -> float:
    """How far corner i lies within a part [m]: below the water plane, say."""
    if part == UNDER_WATER:
        return polygon[i, 3]
    if part == INLAND or part == OFFSHORE:
        return polygon[i, 4] if part == OFFSHORE else -polygon[i, 4]
    return polygon[i, 4] - polygon[i, 3] if part == ABOVE_BED else polygon[i, 3] - polygon[i, 4]


@njit(cache=True, error_model="numpy")
def _clip(polygon: Array, n: int, part: int, kept: Array) -> int:
    """Copy a part of a polygon (x, y, z, depth, cover), see `_inside`; return its number of corners."""
    count = 0
    for i in range(n):
        j = i + 1 if i + 1 < n else 0
        here, there = _inside(polygon, i, part), _inside(polygon, j, part)
        if here >= 0.0:
            for k in range(5):
                kept[count, k] = polygon[i, k]
            count += 1
        if (here > 0.0 and there < 0.0) or (here < 0.0 and there > 0.0):
            way = here / (here - there)
            for k in range(5):
                kept[count, k] = polygon[i, k] + way * (polygon[j, k] - polygon[i, k])
            if part == UNDER_WATER:
                kept[count, 3] = 0.0
            elif part == ABOVE_BED or part == BELOW_BED:
                kept[count, 3] = kept[count, 4]
            count += 1
    return count


@njit(cache=True, error_model="numpy")
def _add_polygon(
    polygon: Array, n: int, cell: int, up: Array, exposed: bool, total: np.record, area_moments: Array
) -> None:
    """Add a convex polygon, as a fan of triangles, to the integrals; `total` is a record of `WET_INTEGRALS`."""
    wrench = total.exposed_wrench if exposed else total.buried_wrench
    x0, y0, z0, d0 = polygon[0, 0], polygon[0, 1], polygon[0, 2], polygon[0, 3]
    for i in range(1, n - 1):
        x1, y1, z1, d1 = polygon[i, 0], polygon[i, 1], polygon[i, 2], polygon[i, 3]
        x2, y2, z2, d2 = polygon[i + 1, 0], polygon[i + 1, 1], polygon[i + 1, 2], polygon[i + 1, 3]
        ax = 0.5 * ((y1 - y0) * (z2 - z0) - (z1 - z0) * (y2 - y0))  # area vector
        ay = 0.5 * ((z1 - z0) * (x2 - x0) - (x1 - x0) * (z2 - z0))
        az = 0.5 * ((x1 - x0) * (y2 - y0) - (y1 - y0) * (x2 - x0))
        depth = (d0 + d1 + d2) / 3.0
        x, y, z = (x0 + x1 + x2) / 3.0, (y0 + y1 + y2) / 3.0, (z0 + z1 + z2) / 3.0
        mx = 0.75 * depth * x + (d0 * x0 + d1 * x1 + d2 * x2) / 12.0  # mean of depth * r
        my = 0.75 * depth * y + (d0 * y0 + d1 * y1 + d2 * y2) / 12.0
        mz = 0.75 * depth * z + (d0 * z0 + d1 * z1 + d2 * z2) / 12.0
        wrench[0] -= depth * ax
        wrench[1] -= depth * ay
        wrench[2] -= depth * az
        wrench[3] -= my * az - mz * ay
        wrench[4] -= mz * ax - mx * az
        wrench[5] -= mx * ay - my * ax
        upward = up[0] * ax + up[1] * ay + up[2] * az
        total.submerged_volume -= depth * upward
        if not exposed:
            c0 = polygon[0, 4]
            cover = c0 + ((polygon[i, 4] - c0) + (polygon[i + 1, 4] - c0)) / 3.0
            total.buried_volume -= (depth - cover) * upward
            continue
        total.exposed_area += math.sqrt(ax * ax + ay * ay + az * az)
        total.draught = max(total.draught, d0, d1, d2)
        for k in range(3):
            area = 0.5 * abs(ax if k == 0 else (ay if k == 1 else az))
            area_moments[cell, k, 0] += area
            area_moments[cell, k, 1] += area * x
            area_moments[cell, k, 2] += area * y
            area_moments[cell, k, 3] += area * z
