"""Hull and wheels over the soil surface: clearance under the whole hull, and what leaves the field of heights."""

from __future__ import annotations

import logging
import math
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from exumob.ground.terrain import Terrain, terrain_height
from exumob.support.arrays import Array
from exumob.support.kernels import njit
from exumob.support.rotations import about_z
from exumob.vehicle.motion import BODIES, BodyStates
from exumob.vehicle.parameters import Vehicle
from exumob.vehicle.start_pose import StartPose
from exumob.water.conditions import Water
from exumob.water.wetted_surface import Integers, hull_triangles

logger = logging.getLogger(__name__)

POINTS_ALONG = 20
"""Points along the hull's length at least where the clearance is looked at, if those of the terrain are wider apart."""
MOST_ALONG = 400
"""Points along an edge as long as the hull at most."""

BLOCK = 1_000_000
"""Heights of corners that are held at a time."""


def keel_clearance(vehicle: Vehicle, terrain: Terrain, states: BodyStates) -> Array:
    """Compute the smallest height of the hull above the soil surface.

    The whole surface of the hull is looked at, box or mesh: its corners, points along its edges, and all points of the
    terrain's field below it with a grid between them where they are wide apart. Over a plane this is exact; over a
    field it finds every point given, and between them errs by the square of the distance.

    Parameters
    ----------
    vehicle : Vehicle
    terrain : Terrain
    states : BodyStates

    Returns
    -------
    array, shape (n,)
        [m]; negative: the hull reaches so far below the surface.
    """
    corners, faces = _corners_and_faces(hull_triangles(vehicle))
    position, rotation = states.position[:, 0], states.rotation[:, 0]
    found = np.empty(len(states))
    if terrain.heights is None:
        up = np.array([-terrain.slope_x, -terrain.slope_y, 1.0])  # height over the plane is linear: least at a corner
        rows = max(1, BLOCK // len(corners))
        for n in range(0, len(found), rows):
            found[n : n + rows] = ((up @ rotation[n : n + rows]) @ corners.T).min(axis=1)
        return found + position @ up - terrain.height
    if terrain.direction != 0.0:  # the points of the field are gone through by its rows
        back = about_z(-terrain.direction)
        origin = np.array([*terrain.origin, 0.0])
        position, rotation = (position - origin) @ back.T + origin, np.ascontiguousarray(back @ rotation)
    _clearances(*terrain.turned_back(), corners, faces, position, rotation, found)
    return found


def outside_terrain(vehicle: Vehicle, terrain: Terrain, states: BodyStates) -> NDArray[np.bool_]:
    """Tell which bodies are outside the terrain's field: wheels by their centre, the hull by any corner of its extent.

    Returns
    -------
    array of bool, shape (n, 5)
    """
    outside = np.zeros(states.position.shape[:2], dtype=bool)
    if terrain.extent is None:
        return outside
    outside[:, 1:] = ~terrain.holds(states.position[:, 1:, :2])
    corners = states.position[:, 0, None] + _extent_corners(vehicle) @ states.rotation[:, 0].mT
    outside[:, 0] = ~terrain.holds(corners[..., :2]).all(axis=1)
    return outside


def check_start(vehicle: Vehicle, terrain: Terrain, water: Water | None, start: StartPose) -> None:
    """Refuse fields of heights and of water that do not hold the whole vehicle at the start of a run.

    Raises
    ------
    ValueError
        With the extents of the field and of the vehicle; if the water's depth does not go with the terrain.
    """
    hull = _extent_corners(vehicle) + vehicle.hull_origin
    points = start.to_world(np.concatenate([hull[:, :2], vehicle.wheel_centers[:, :2]]))
    terrain.require_inside("simulate.terrain", "the vehicle at its start", points)
    if water is None:
        return
    water.require_over(terrain, "simulate.water: Water.depth")
    if water.field is not None:
        water.field.require_inside("simulate.water", "the vehicle at its start", points)


def warn_of_ground(vehicle: Vehicle, run: xr.Dataset) -> None:
    """Warn if the hull touched the ground, or if a body left the field of heights."""
    if run.sizes["time"] == 0:
        return
    share = run["hull_load_share"].values
    if (share > 0.0).any():
        logger.warning(
            "%s: the hull touched the ground, first at %.2f s; it bore up to %.0f %% of the weight, and sank in by up "
            "to %.1f mm.", vehicle.name, float(run["time"][np.argmax(share > 0.0)]), 100.0 * float(np.nanmax(share)),
            -1e3 * float(run["keel_clearance"].min()),
        )  # fmt: skip
    outside = run["outside_terrain"].values
    if outside.any():
        n = int(np.argmax(outside.any(axis=1)))
        names = ", ".join(name.replace("_", " ") for name, out in zip(BODIES, outside[n], strict=True) if out)
        logger.warning(
            "%s: left the field of heights at %.2f s (%s), and drove on ground that continues its edge from then on; "
            "outside_terrain marks it. Give a larger field, or end the run before.",
            vehicle.name, float(run["time"][n]), names,
        )  # fmt: skip


def _extent_corners(vehicle: Vehicle) -> Array:
    """Corners of the box round the hull, about its centre of mass [m], shape (8, 3)."""
    points = hull_triangles(vehicle).reshape(-1, 3)
    ends = np.stack([points.min(axis=0), points.max(axis=0)])
    return np.array([[ends[i, 0], ends[j, 1], ends[k, 2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)])


def _corners_and_faces(triangles: Array) -> tuple[Array, Integers]:
    corners, faces = np.unique(triangles.reshape(-1, 3), axis=0, return_inverse=True)
    return np.ascontiguousarray(corners), faces.reshape(-1, 3).astype(np.int64)


@njit(cache=True, error_model="numpy")
def _clearances(
    terrain: np.ndarray, nodes: Array, corners: Array, faces: Integers, position: Array, rotation: Array, found: Array
) -> None:
    """Fill `found` with the clearance over a field of heights at each instant."""
    ground = terrain[0]
    placed = np.empty_like(corners)
    low, high = np.empty(3), np.empty(3)
    size = 0.0
    for axis in range(3):
        size = max(size, corners[:, axis].max() - corners[:, axis].min())
    for n in range(len(position)):
        if not np.isfinite(position[n].sum() + rotation[n].sum()):  # a run that broke down
            found[n] = np.nan
            continue
        least = np.inf
        low[:], high[:] = np.inf, -np.inf
        for k in range(len(corners)):
            for axis in range(3):
                x = position[n, axis]
                for m in range(3):
                    x += rotation[n, axis, m] * corners[k, m]
                placed[k, axis] = x
                low[axis], high[axis] = min(low[axis], x), max(high[axis], x)
            z, _, _ = terrain_height(ground, nodes, placed[k, 0], placed[k, 1])
            least = min(least, placed[k, 2] - z)
        found[n] = _under_faces(ground, nodes, placed, faces, low, high, size, least)


@njit(cache=True, error_model="numpy")
def _indices(low: float, high: float, origin: float, spacing: float, count: int) -> tuple[int, int]:
    """First and last of `count` points at which an interval lies, or between which."""
    first = math.floor(min(max((low - origin) / spacing, 0.0), count - 1.0))
    last = math.ceil(min(max((high - origin) / spacing, 0.0), count - 1.0))
    return int(first), int(last)


@njit(cache=True, error_model="numpy")
def _under_faces(  # a kernel: the surface, and what is known of it already
    ground: Any, nodes: Array, placed: Array, faces: Integers, low: Array, high: Array, size: float, least: float
) -> float:
    """Look under faces and along their edges for less than `least`; low, high: extent of the hull in the world."""
    n_y, n_x, _ = nodes.shape
    step_x, step_y = ground.spacing_x, ground.spacing_y
    i0, i1 = _indices(low[0], high[0], ground.origin_x, step_x, n_x)
    j0, j1 = _indices(low[1], high[1], ground.origin_y, step_y, n_y)
    top = nodes[j0 : j1 + 1, i0 : i1 + 1, 0].max() + ground.height  # nothing below the hull is higher
    top += max(ground.slope_x * low[0], ground.slope_x * high[0])
    top += max(ground.slope_y * low[1], ground.slope_y * high[1])
    parts_x = max(1, math.ceil(POINTS_ALONG * step_x / size))
    parts_y = max(1, math.ceil(POINTS_ALONG * step_y / size))
    fine = min(0.5 * min(step_x / parts_x, step_y / parts_y), 0.5 * size / POINTS_ALONG)
    fine = max(fine, size / MOST_ALONG)
    for face in faces:
        a, b, c = placed[face[0]], placed[face[1]], placed[face[2]]
        if min(a[2], b[2], c[2]) - top >= least:
            continue
        for m in range(3):
            p, q = placed[face[m]], placed[face[(m + 1) % 3]]
            if min(p[2], q[2]) - top >= least:
                continue
            count = math.ceil(math.hypot(q[0] - p[0], q[1] - p[1]) / fine)
            for k in range(1, count):
                t = k / count
                x, y = p[0] + t * (q[0] - p[0]), p[1] + t * (q[1] - p[1])
                z, _, _ = terrain_height(ground, nodes, x, y)
                least = min(least, p[2] + t * (q[2] - p[2]) - z)
        area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        if abs(area) < 1e-12 * size * size:
            continue  # upright: its edges say all
        # of the points between those of the field, the ones below this face: a cell of a section is a kilometre wide
        west, east = min(a[0], b[0], c[0]), max(a[0], b[0], c[0])
        south, north = min(a[1], b[1], c[1]), max(a[1], b[1], c[1])
        i0, i1 = _indices(west, east, ground.origin_x, step_x / parts_x, (n_x - 1) * parts_x + 1)
        j0, j1 = _indices(south, north, ground.origin_y, step_y / parts_y, (n_y - 1) * parts_y + 1)
        for j in range(j0, j1 + 1):
            y = ground.origin_y + j * step_y / parts_y
            for i in range(i0, i1 + 1):
                x = ground.origin_x + i * step_x / parts_x
                t = ((x - a[0]) * (c[1] - a[1]) - (y - a[1]) * (c[0] - a[0])) / area
                u = ((b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0])) / area
                if t < 0.0 or u < 0.0 or t + u > 1.0:
                    continue
                bottom = a[2] + t * (b[2] - a[2]) + u * (c[2] - a[2])
                if bottom - top >= least:
                    continue
                if parts_x == 1 and parts_y == 1:
                    z = nodes[j, i, 0] + ground.height + ground.slope_x * x + ground.slope_y * y
                else:
                    z, _, _ = terrain_height(ground, nodes, x, y)
                least = min(least, bottom - z)
    return least
