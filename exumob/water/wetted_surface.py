"""Wetted surfaces: closed triangle surfaces of the five bodies and exact hydrostatics on them.

A surface is given in its body's own axes about the body's origin (hull: centre of mass; wheel: its centre). Every
integral over the part of it below the still-water plane is exact for the triangles: those that cross the plane are
clipped, and the pressure rho g (level - z) is linear on what remains. The soil surface is the world's z = 0.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from exumob.support.arrays import Array
from exumob.support.constants import GRAVITY
from exumob.vehicle.parameters import Hull, Vehicle

HULL_STRIPS = 12
"""Strips along the hull; each is split at the centre plane into a port and a starboard cell."""

WHEEL_SEGMENTS = 24
"""Flat faces round a wheel's tread; with 24 the lift of a part-wet wheel is within 0.05 % of the cylinder's."""

Integers = NDArray[np.int64]


@dataclass(frozen=True)
class Surface:
    """A closed surface of triangles, sorted into cells over which wetted areas are summed.

    Parameters
    ----------
    triangles : array, shape (n, 3, 3)
        Corners in the body's axes [m], counter-clockwise seen from outside.
    cells : array of int, shape (n,)
        Cell of each triangle, 0 ... n_cells - 1.
    n_cells : int
    """

    triangles: Array
    cells: Integers
    n_cells: int = 1

    @property
    def volume(self) -> float:
        """Enclosed volume [m^3]."""
        a, b, c = self.triangles[:, 0], self.triangles[:, 1], self.triangles[:, 2]
        return float(np.einsum("ni,ni->", a, np.cross(b, c)) / 6.0)

    @property
    def centroid(self) -> Array:
        """Centre of the enclosed volume in the body's axes [m], shape (3,)."""
        a, b, c = self.triangles[:, 0], self.triangles[:, 1], self.triangles[:, 2]
        six_volumes = np.einsum("ni,ni->n", a, np.cross(b, c))
        return six_volumes @ (a + b + c) / (4.0 * six_volumes.sum())


@dataclass(frozen=True)
class Wetted:
    """What of a surface is under water."""

    submerged_volume: float
    """Below the water plane, soil included [m^3]"""
    exposed_volume: float
    """Between the soil surface and the water plane [m^3]"""
    wetted_area: float
    """Of the exposed part [m^2]"""
    draught: float
    """Depth of its lowest exposed point below the water plane [m]"""
    projected_area: Array
    """Half the integral of |n| over the exposed part, for the body's x, y, z [m^2], shape (3,): the frontal and lateral
    area, and the plan area of a fully immersed body (half of it when only the bottom is wet)"""


def box_surface(length: float, width: float, height: float, center: ArrayLike = (0.0, 0.0, 0.0)) -> Surface:
    """Box with its edges along the body's axes.

    Parameters
    ----------
    length, width, height : float
        Along x, y, z [m].
    center : array-like, shape (3,)
        [m]
    """
    half = 0.5 * length
    outline = np.array([[-half, -0.5 * height], [half, -0.5 * height], [half, 0.5 * height], [-half, 0.5 * height]])
    triangles = _fans(_prism(outline, width)) + np.asarray(center, dtype=float)
    return Surface(triangles, np.zeros(len(triangles), dtype=np.int64))


def cylinder_surface(radius: float, width: float, segments: int = WHEEL_SEGMENTS) -> Surface:
    """Cylinder about the body's y axis: a prism with the cylinder's exact volume.

    Parameters
    ----------
    radius, width : float
        [m]
    segments : int
        Flat faces round the tread; their corners lie outside the circle so that the volume is that of the cylinder.
    """
    step = 2.0 * math.pi / segments
    corner_radius = radius * math.sqrt(step / math.sin(step))
    angles = step * np.arange(segments)
    triangles = _fans(_prism(corner_radius * np.stack([np.cos(angles), np.sin(angles)], axis=1), width))
    return Surface(triangles, np.zeros(len(triangles), dtype=np.int64))


def hull_surface(vehicle: Vehicle) -> Surface:
    """Surface of the hull about its centre of mass, in `HULL_STRIPS` strips of a port and a starboard cell.

    Cell 2 i is the starboard half of strip i counted from the stern, 2 i + 1 its port half.

    Raises
    ------
    ValueError
        If the hull's mesh cannot be used: see `mesh_triangles`.
    """
    hull = vehicle.hull
    faces = _prism(hull.side_profile(), hull.width) if hull.mesh is None else list(mesh_triangles(hull.mesh))
    if hull.mesh is not None:
        _check_extent(hull, np.concatenate(faces))
    faces = [face - vehicle.hull_origin for face in faces]
    edges = strip_edges(np.concatenate(faces))
    for x in edges[1:-1]:
        faces = _sliced(faces, axis=0, position=float(x))
    triangles = _fans(_sliced(faces, axis=1, position=0.0))
    middle = triangles.mean(axis=1)
    strips = np.clip(np.searchsorted(edges, middle[:, 0]) - 1, 0, HULL_STRIPS - 1)
    return Surface(triangles, 2 * strips.astype(np.int64) + (middle[:, 1] > 0.0), 2 * HULL_STRIPS)


def _check_extent(hull: Hull, points: Array) -> None:
    """Refuse a mesh in other units or another frame than the hull that it stands for."""
    low, high = points.min(axis=0), points.max(axis=0)
    middle = np.array([hull.center_x, 0.0, hull.ground_clearance + 0.5 * hull.height])
    for k, name in enumerate(("length", "width", "height")):
        size = getattr(hull, name)
        misplaced = abs(0.5 * (low[k] + high[k]) - middle[k])
        if not 0.5 * size <= high[k] - low[k] <= 2.0 * size or misplaced > 0.5 * size:
            raise ValueError(
                f"Hull.mesh reaches from {low[k]:.4g} to {high[k]:.4g} m along {'xyz'[k]}, but Hull.{name} = {size:g} "
                f"about {middle[k]:.4g} m (allowed: a factor of 2, half a {name} off). Scale the mesh to metres, move "
                "it to the design frame, or mend the hull's sizes."
            )


def wheel_surface(vehicle: Vehicle) -> Surface:
    """Surface of a wheel about its centre."""
    return cylinder_surface(vehicle.wheel.radius, vehicle.wheel.width)


def body_surfaces(vehicle: Vehicle) -> tuple[Surface, Surface, Surface, Surface, Surface]:
    """Surfaces of the five bodies, order of `exumob.vehicle.motion.BODIES`."""
    wheel = wheel_surface(vehicle)
    return hull_surface(vehicle), wheel, wheel, wheel, wheel


def strip_edges(points: Array) -> Array:
    """Return the ends of the hull's strips along x [m], shape (HULL_STRIPS + 1,), for points of shape (..., 3)."""
    return np.linspace(points[..., 0].min(), points[..., 0].max(), HULL_STRIPS + 1)


def mesh_triangles(file: Path) -> Array:
    """Triangles of a watertight mesh file (STL, OBJ ...) in the design frame [m], shape (n, 3, 3).

    Raises
    ------
    ImportError
        If trimesh is not installed.
    FileNotFoundError
        If there is no such file.
    ValueError
        If the mesh is not closed, or its faces do not all point outwards.
    """
    try:
        import trimesh
    except ImportError as error:
        raise ImportError(
            f"Hull.mesh = {file} needs the package trimesh; install it with `pip install 'exumob[mesh]'`, "
            "or leave mesh out to use the box hull."
        ) from error
    if not Path(file).is_file():
        raise FileNotFoundError(f"Hull.mesh = {file} does not exist; give the path of an STL or OBJ file.")
    mesh = trimesh.load_mesh(str(file))
    if not mesh.is_watertight:
        raise ValueError(f"Hull.mesh = {file} is not watertight: close its holes, or the buoyancy has no meaning.")
    if not mesh.is_winding_consistent or mesh.volume <= 0.0:
        raise ValueError(
            f"Hull.mesh = {file} has faces that point inwards (enclosed volume {mesh.volume:.4g} m^3); "
            "orient all of them outwards (counter-clockwise seen from outside)."
        )
    return np.array(mesh.triangles, dtype=float)


def hydrostatic_wrench(
    surface: Surface,
    rotation: ArrayLike,
    position: ArrayLike,
    level: float,
    density: float = 1000.0,
    *,
    pore_pressure: bool = True,
) -> Array:
    """Force and moment of still water on a body, in the body's own axes about its origin.

    Parameters
    ----------
    surface : Surface
    rotation : array-like, shape (3, 3)
        Body -> world.
    position : array-like, shape (3,)
        Body's origin, world axes [m].
    level : float
        Height of the water plane above the soil surface z = 0 [m].
    density : float
        [kg/m^3]
    pore_pressure : bool
        True: the pressure goes on below the soil surface, and Archimedes holds for a sunk body. False: no pressure
        on what lies below the soil surface.

    Returns
    -------
    array, shape (6,)
        Force [N], moment [N m].
    """
    sums, _ = _wet(surface, rotation, position, level)
    return density * GRAVITY * (sums[:6] + sums[6:12] if pore_pressure else sums[:6])


def wetted(surface: Surface, rotation: ArrayLike, position: ArrayLike, level: float) -> Wetted:
    """Measure what of a body's surface is under water; parameters as for `hydrostatic_wrench`."""
    sums, areas = _wet(surface, rotation, position, level)
    return Wetted(sums[12], sums[12] - sums[13], sums[14], sums[15], areas[:, :, 0].sum(axis=0))


def _wet(surface: Surface, rotation: ArrayLike, position: ArrayLike, level: float) -> tuple[Array, Array]:
    up = np.ascontiguousarray(np.asarray(rotation, dtype=float)[2])
    height = float(np.asarray(position, dtype=float)[2])
    sums, areas = np.zeros(N_SUMS), np.zeros((surface.n_cells, 3, 4))
    wet_integrals(surface.triangles, surface.cells, up, height, float(level), sums, areas, np.empty((3, 9, 4)))
    return sums, areas


def _prism(outline: Array, width: float) -> list[Array]:
    """Faces of a prism along y whose convex outline (x, z) is counter-clockwise with x to the right and z up."""
    near = np.insert(outline, 1, -0.5 * width, axis=1)  # starboard end, seen from outside with x to the right
    far = np.insert(outline, 1, 0.5 * width, axis=1)
    sides = [np.array([near[i - 1], far[i - 1], far[i], near[i]]) for i in range(len(outline))]
    return [near, far[::-1], *sides]


def _sliced(faces: list[Array], axis: int, position: float) -> list[Array]:
    """Convex faces split where they cross the plane coordinate[axis] = position; the surface stays the same."""
    pieces = []
    for face in faces:
        distance = face[:, axis] - position
        distance[np.abs(distance) <= 1e-12 * np.abs(face).max()] = 0.0
        if distance.min() >= 0.0 or distance.max() <= 0.0:
            pieces.append(face)
            continue
        for sign in (1.0, -1.0):
            kept = []
            for i in range(len(face)):
                j = (i + 1) % len(face)
                if sign * distance[i] >= 0.0:
                    kept.append(face[i])
                if distance[i] * distance[j] < 0.0:
                    kept.append(face[i] + distance[i] / (distance[i] - distance[j]) * (face[j] - face[i]))
            pieces.append(np.array(kept))
    return pieces


def _fans(faces: list[Array]) -> Array:
    """Triangles of convex faces, shape (n, 3, 3)."""
    return np.array([[face[0], face[i], face[i + 1]] for face in faces for i in range(1, len(face) - 1)])


N_SUMS = 16
"""Entries of the `sums` of `wet_integrals`."""


@njit(cache=True, error_model="numpy")
def wet_integrals(
    triangles: Array, cells: Integers, up: Array, height: float, level: float, sums: Array, areas: Array, scratch: Array
) -> None:
    """Add the integrals over the wet part of a surface to `sums` and `areas`; body axes about the body's origin.

    Parameters
    ----------
    triangles, cells
        As in `Surface`.
    up : array, shape (3,)
        World z in body axes.
    height, level : float
        Of the body's origin and of the water plane above the soil surface [m].
    sums : array, shape (16,), changed
        0:3 and 3:6: integral of -depth n and of -depth r x n over the exposed part (between soil surface and water
        plane) [m^3, m^4]; 6:12 the same below the soil surface; 12: volume below the water plane; 13: volume below
        the soil surface [m^3]; 14: exposed area [m^2]; 15: depth of the lowest exposed point [m].
    areas : array, shape (n_cells, 3, 4), changed
        Per cell and body axis, over the exposed part: integral of |n| / 2 [m^2], and of r |n| / 2 [m^3].
    scratch : array, shape (3, 9, 4)
        Work space.
    """
    for t in range(triangles.shape[0]):
        highest, lowest = -np.inf, np.inf
        for i in range(3):
            depth = level - height
            for k in range(3):
                scratch[0, i, k] = triangles[t, i, k]
                depth -= up[k] * triangles[t, i, k]
            scratch[0, i, 3] = depth
            highest, lowest = max(highest, depth), min(lowest, depth)
        if highest <= 0.0:
            continue
        wet, n_wet = 0, 3
        if lowest < 0.0:
            wet, n_wet = 1, _clip(scratch[0], 3, 1.0, 0.0, scratch[1])
        if highest > level:  # reaches below the soil surface
            n_exposed = _clip(scratch[wet], n_wet, -1.0, level, scratch[2])
            _add_polygon(scratch[2], n_exposed, cells[t], up, level, True, sums, areas)
            other = 1 - wet
            n_below = _clip(scratch[wet], n_wet, 1.0, -level, scratch[other])
            _add_polygon(scratch[other], n_below, cells[t], up, level, False, sums, areas)
        else:
            _add_polygon(scratch[wet], n_wet, cells[t], up, level, True, sums, areas)


@njit(cache=True, error_model="numpy")
def _clip(polygon: Array, n: int, sign: float, offset: float, kept: Array) -> int:
    """Part of a polygon (x, y, z, depth) with sign * depth + offset >= 0; returns its number of corners."""
    count = 0
    for i in range(n):
        j = i + 1 if i + 1 < n else 0
        here, there = sign * polygon[i, 3] + offset, sign * polygon[j, 3] + offset
        if here >= 0.0:
            for k in range(4):
                kept[count, k] = polygon[i, k]
            count += 1
        if (here > 0.0 and there < 0.0) or (here < 0.0 and there > 0.0):
            part = here / (here - there)
            for k in range(3):
                kept[count, k] = polygon[i, k] + part * (polygon[j, k] - polygon[i, k])
            kept[count, 3] = -sign * offset
            count += 1
    return count


@njit(cache=True, error_model="numpy")
def _add_polygon(
    polygon: Array, n: int, cell: int, up: Array, level: float, exposed: bool, sums: Array, areas: Array
) -> None:
    """Add a convex polygon, as a fan of triangles, to the integrals."""
    first = 0 if exposed else 6
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
        sums[first] -= depth * ax
        sums[first + 1] -= depth * ay
        sums[first + 2] -= depth * az
        sums[first + 3] -= my * az - mz * ay
        sums[first + 4] -= mz * ax - mx * az
        sums[first + 5] -= mx * ay - my * ax
        upward = up[0] * ax + up[1] * ay + up[2] * az
        sums[12] -= depth * upward
        if not exposed:
            sums[13] -= (depth - level) * upward
            continue
        sums[14] += math.sqrt(ax * ax + ay * ay + az * az)
        sums[15] = max(sums[15], d0, d1, d2)
        for k in range(3):
            area = 0.5 * abs(ax if k == 0 else (ay if k == 1 else az))
            areas[cell, k, 0] += area
            areas[cell, k, 1] += area * x
            areas[cell, k, 2] += area * y
            areas[cell, k, 3] += area * z
