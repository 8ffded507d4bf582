"""Closed triangle surfaces of the five bodies, on which water can act.

A surface is given in its body's own axes about the body's origin (hull: centre of mass; wheel: its centre).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike, NDArray

from exumob.support.arrays import Array, checked_array
from exumob.support.declared import checked
from exumob.support.quantities import Quantity
from exumob.vehicle.body import body_faces, is_plain, triangulated, with_shared_corners
from exumob.vehicle.parameters import Vehicle
from exumob.water.mesh_file import LINES, hull_mesh
from exumob.water.mesh_lines import lines_through

HULL_STRIPS = 12
"""Strips along the hull; each is split at the centre plane into a port and a starboard cell."""

WHEEL_SEGMENTS = 24
"""Flat faces round a wheel's tread; with 24 the lift of a part-wet wheel is within 0.05 % of the cylinder's."""

SIZE = Quantity("m", above=0.0, at_most=1e6)

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

    Raises
    ------
    ValueError
        If shapes do not agree, a corner is not finite, or a cell is none of 0 ... n_cells - 1.
    """

    triangles: Array
    cells: Integers
    n_cells: int = 1

    def __post_init__(self) -> None:
        triangles = checked_array("Surface.triangles", self.triangles, ("n", 3, 3))
        cells = checked_array("Surface.cells", self.cells, (len(triangles),))
        if len(cells) and not (cells.min() >= 0 and cells.max() < self.n_cells and (cells == np.floor(cells)).all()):
            raise ValueError(f"Surface.cells must be whole numbers from 0 to n_cells - 1 = {self.n_cells - 1}.")
        object.__setattr__(self, "triangles", triangles.copy())  # kernels are compiled for arrays that can be written
        object.__setattr__(self, "cells", cells.astype(np.int64))

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


@checked
def box_surface(
    length: Annotated[float, SIZE],
    width: Annotated[float, SIZE],
    height: Annotated[float, SIZE],
    center: Annotated[ArrayLike, Quantity("m", at_least=-1e9, at_most=1e9, shape=(3,))] = (0.0, 0.0, 0.0),
) -> Surface:
    """Return a box with its edges along the body's axes.

    Parameters
    ----------
    length, width, height : float
        Along x, y, z [m].
    center : array-like, shape (3,)
        [m]
    """
    half = 0.5 * length
    outline = np.array([[-half, -0.5 * height], [half, -0.5 * height], [half, 0.5 * height], [-half, 0.5 * height]])
    triangles = _triangulated(_prism_faces(outline, width)) + np.asarray(center, dtype=float)
    return Surface(triangles, np.zeros(len(triangles), dtype=np.int64))


@checked
def cylinder_surface(
    radius: Annotated[float, SIZE],
    width: Annotated[float, SIZE],
    segments: Annotated[int, Quantity("1", at_least=3, at_most=100_000)] = WHEEL_SEGMENTS,
) -> Surface:
    """Return a cylinder about the body's y axis: a prism with the cylinder's exact volume.

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
    triangles = _triangulated(_prism_faces(corner_radius * np.stack([np.cos(angles), np.sin(angles)], axis=1), width))
    return Surface(triangles, np.zeros(len(triangles), dtype=np.int64))


def hull_triangles(vehicle: Vehicle) -> Array:
    """Return the surface of the hull, boxes or mesh, about its centre of mass: triangles [m], shape (n, 3, 3).

    It is closed: neighbouring triangles share their corners to the last bit.

    Raises
    ------
    ValueError
        If the hull's mesh cannot be used: see `exumob.water.mesh_file`.
    """
    faces = _hull_faces(vehicle, shared_corners=True)
    return _triangulated(faces) if vehicle.hull.mesh is not None else triangulated(faces)


def hull_surface(vehicle: Vehicle) -> Surface:
    """Return the surface of the hull about its centre of mass, in `HULL_STRIPS` strips of a port and a starboard cell.

    Cell 2 i is the starboard half of strip i counted from the stern, 2 i + 1 its port half.

    Raises
    ------
    ValueError
        If the hull's mesh cannot be used: see `exumob.water.mesh_file`.
    """
    faces = _hull_faces(vehicle)
    edges = strip_edges(np.concatenate(faces))
    for x in edges[1:-1]:
        faces = _split_at_plane(faces, axis=0, position=float(x))
    triangles = _triangulated(_split_at_plane(faces, axis=1, position=0.0))
    middle = triangles.mean(axis=1)
    strips = np.clip(np.searchsorted(edges, middle[:, 0]) - 1, 0, HULL_STRIPS - 1)
    return Surface(triangles, 2 * strips.astype(np.int64) + (middle[:, 1] > 0.0), 2 * HULL_STRIPS)


def _hull_faces(vehicle: Vehicle, shared_corners: bool = False) -> list[Array]:
    """Convex faces of the hull about its centre of mass [m]; neighbours share all their corners only if asked for."""
    hull = vehicle.hull
    if hull.mesh is not None:
        faces = list(hull_mesh(vehicle))
    elif is_plain(hull):
        faces = _prism_faces(hull.side_profile(), hull.width)
    else:
        faces = list(body_faces(hull, vehicle.axles))
        faces = with_shared_corners(faces) if shared_corners else faces
    return [face - vehicle.hull_origin for face in faces]


def wheel_surface(vehicle: Vehicle) -> Surface:
    """Return the surface of a wheel about its centre."""
    return cylinder_surface(vehicle.wheel.radius, vehicle.wheel.width)


def body_surfaces(vehicle: Vehicle) -> tuple[Surface, Surface, Surface, Surface, Surface]:
    """Return the surfaces of the five bodies, order of `exumob.vehicle.motion.BODIES`."""
    wheel = wheel_surface(vehicle)
    return hull_surface(vehicle), wheel, wheel, wheel, wheel


def frontal_share(surface: Surface) -> float:
    """Return the frontal area of a surface over half of all areas across its x axis [-], both of its lower half.

    It is 1 for a box, and less where parts lie in the shade of others, such as the front and rear walls of wheel
    arches: these count for the pressure of still water, but the stream does not meet them. The frontal area is measured
    on a grid of lines; that of a surface of upright and level edges is exact but for half of their spacing.
    """
    corners = surface.triangles.reshape(-1, 3)
    low, high = corners.min(axis=0), corners.max(axis=0)
    high[2] = 0.5 * (low[2] + high[2])
    y, z = (low[k] + (high[k] - low[k]) * (np.arange(LINES) + 0.5137) / LINES for k in (1, 2))
    seen = lines_through(surface.triangles, 0, y, z, -np.inf, np.inf).enclosed > 0.0
    pieces = _triangulated(_split_at_plane(list(surface.triangles), axis=2, position=float(high[2])))
    pieces = pieces[pieces.mean(axis=1)[:, 2] < high[2]]
    edges = pieces[:, 1:] - pieces[:, :1]
    facing = 0.25 * float(np.abs(np.cross(edges[:, 0], edges[:, 1])[:, 0]).sum())
    return min(1.0, float(seen.mean() * np.prod(high[1:] - low[1:])) / facing)


def strip_edges(points: Array) -> Array:
    """Return the ends of the hull's strips along x [m], shape (HULL_STRIPS + 1,), for points of shape (..., 3)."""
    return np.linspace(points[..., 0].min(), points[..., 0].max(), HULL_STRIPS + 1)


def _prism_faces(outline: Array, width: float) -> list[Array]:
    """Return the faces of a prism along y; its convex outline (x, z) is counter-clockwise, x to the right and z up."""
    near = np.insert(outline, 1, -0.5 * width, axis=1)  # starboard end, seen from outside with x to the right
    far = np.insert(outline, 1, 0.5 * width, axis=1)
    sides = [np.array([near[i - 1], far[i - 1], far[i], near[i]]) for i in range(len(outline))]
    return [near, far[::-1], *sides]


def _split_at_plane(faces: list[Array], axis: int, position: float) -> list[Array]:
    """Split convex faces where they cross the plane coordinate[axis] = position; the surface stays the same."""
    pieces = []
    for face in faces:
        distance = face[:, axis] - position
        distance[np.abs(distance) <= 1e-12 * np.abs(face).max()] = 0.0
        if distance.min() >= 0.0 or distance.max() <= 0.0:
            pieces.append(face)
            continue
        for sign in (1.0, -1.0):
            piece = []
            for i in range(len(face)):
                j = (i + 1) % len(face)
                if sign * distance[i] >= 0.0:
                    piece.append(face[i])
                if distance[i] * distance[j] < 0.0:
                    piece.append(face[i] + distance[i] / (distance[i] - distance[j]) * (face[j] - face[i]))
            pieces.append(np.array(piece))
    return pieces


def _triangulated(faces: list[Array]) -> Array:
    """Cut convex faces into triangles, each face as a fan from its first corner; shape (n, 3, 3)."""
    return np.array([[face[0], face[i], face[i + 1]] for face in faces for i in range(1, len(face) - 1)])
