"""Lines through a triangle mesh: how often each stretch of them is enclosed; and distances from it.

Along a line the winding number of a closed mesh rises by 1 where it enters through a face and falls by 1 where it
leaves. A surface that neither cuts itself nor another one encloses each point once or not at all; where bodies overlap
the number is 2, in a body turned inside out it is -1, and both occur where a surface cuts through itself.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from exumob.support.arrays import Array
from exumob.support.kernels import njit


class Lines(NamedTuple):
    """What lies on parallel lines through a mesh; all arrays of shape (n_u, n_v)."""

    enclosed: Array
    """Length that is enclosed once or more often [m]"""
    wrong: Array
    """Length whose winding number is neither 0 nor 1 [m]"""


def lines_through(triangles: Array, axis: int, u: Array, v: Array, low: Array | float, high: Array | float) -> Lines:
    """Measure what a closed mesh encloses of straight lines.

    A line that does not end outside, because it runs along a face within rounding, counts as outside all the way.

    Parameters
    ----------
    triangles : array, shape (n, 3, 3)
        Corners [m]; neighbours share theirs to the last bit.
    axis : int
        Direction of the lines: 0, 1 or 2 for x, y, z.
    u, v : array, shape (n_u,) and (n_v,)
        Places of the lines along the next two axes in cyclic order, increasing [m].
    low, high : array or float, shape (n_u, n_v)
        Only what lies between these places along the lines counts [m].
    """
    turned = np.ascontiguousarray(triangles[:, :, [(axis + 1) % 3, (axis + 2) % 3, axis]])
    shape = len(u), len(v)
    found = Lines(np.zeros(shape), np.zeros(shape))
    ends = [np.ascontiguousarray(np.broadcast_to(np.asarray(end, dtype=float), shape)) for end in (low, high)]
    _measure(turned, _spans(turned, u, v), np.ascontiguousarray(u), np.ascontiguousarray(v), *ends, found)
    return found


def _spans(triangles: Array, u: Array, v: Array) -> NDArray[np.intp]:
    """Lines that a triangle can meet: the first and the one after the last along u, then v; shape (n, 4)."""
    low, high = triangles.min(axis=1), triangles.max(axis=1)
    ends = [
        np.searchsorted(places, low[:, k]) if first else np.searchsorted(places, high[:, k], side="right")
        for k, places in ((0, u), (1, v)) for first in (True, False)
    ]  # fmt: skip
    return np.stack(ends, axis=1)


@njit(cache=True, error_model="numpy")
def _left(p: Array, q: Array, x: float, y: float) -> bool:
    """Tell if x, y lies to the left of the edge from p to q; the edge from q to p gives the opposite, ties included."""
    if p[0] < q[0] or (p[0] == q[0] and p[1] < q[1]):
        return (q[0] - p[0]) * (y - p[1]) - (q[1] - p[1]) * (x - p[0]) >= 0.0
    return not (p[0] - q[0]) * (y - q[1]) - (p[1] - q[1]) * (x - q[0]) >= 0.0


@njit(cache=True, error_model="numpy")
def _crossing(corners: Array, x: float, y: float) -> tuple[int, float]:
    """Change of the winding number at a triangle on the way up a line, and the place; 0 if they do not meet."""
    a, b, c = corners[0], corners[1], corners[2]
    area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    if area == 0.0:
        return 0, 0.0
    left = _left(a, b, x, y)
    if _left(b, c, x, y) != left or _left(c, a, x, y) != left:
        return 0, 0.0
    t = ((x - a[0]) * (c[1] - a[1]) - (y - a[1]) * (c[0] - a[0])) / area
    s = ((b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0])) / area
    place = a[2] + t * (b[2] - a[2]) + s * (c[2] - a[2])
    place = min(max(place, min(a[2], b[2], c[2])), max(a[2], b[2], c[2]))
    return (-1 if left else 1), place


@njit(cache=True, error_model="numpy")
def _crossings(
    triangles: Array, spans: NDArray[np.intp], u: Array, v: Array
) -> tuple[NDArray[np.int64], Array, NDArray[np.int64]]:
    """Where each line enters and leaves, in order along it.

    Parameters
    ----------
    triangles : array, shape (n, 3, 3)
        The lines run along the last axis.
    spans : array of int, shape (n, 4)
        The lines that a triangle can meet: the first and the one after the last along u, then v.

    Returns
    -------
    first : array of int, shape (n_u * n_v + 1,)
        Line i * n_v + j has the crossings from this number to the next; none if they do not add up to nought.
    places : array
        [m]
    changes : array of int
        Changes of the winding number.
    """
    n_v = len(v)
    first = np.zeros(len(u) * n_v + 1, np.int64)
    filled = np.zeros(len(u) * n_v, np.int64)
    for n in range(len(triangles)):
        for i in range(spans[n, 0], spans[n, 1]):
            for j in range(spans[n, 2], spans[n, 3]):
                if _crossing(triangles[n], u[i], v[j])[0] != 0:
                    first[i * n_v + j + 1] += 1
    for line in range(len(u) * n_v):
        first[line + 1] += first[line]
    places = np.empty(first[-1])
    changes = np.empty(first[-1], np.int64)
    for n in range(len(triangles)):
        for i in range(spans[n, 0], spans[n, 1]):
            for j in range(spans[n, 2], spans[n, 3]):
                change, place = _crossing(triangles[n], u[i], v[j])
                if change == 0:
                    continue
                line = i * n_v + j
                k = first[line] + filled[line]
                while k > first[line] and places[k - 1] > place:
                    places[k], changes[k] = places[k - 1], changes[k - 1]
                    k -= 1
                places[k], changes[k] = place, change
                filled[line] += 1
    for line in range(len(u) * n_v):
        total = 0
        for k in range(first[line], first[line + 1]):
            total += changes[k]
        if total != 0:
            changes[first[line] : first[line + 1]] = 0
    return first, places, changes


@njit(cache=True, error_model="numpy")
def _measure(
    triangles: Array, spans: NDArray[np.intp], u: Array, v: Array, low: Array, high: Array, found: Lines
) -> None:
    """Fill `found`."""
    first, places, changes = _crossings(triangles, spans, u, v)
    for i in range(len(u)):
        for j in range(len(v)):
            winding = 0
            for k in range(first[i * len(v) + j], first[i * len(v) + j + 1] - 1):
                winding += changes[k]
                length = min(places[k + 1], high[i, j]) - max(places[k], low[i, j])
                if length > 0.0:
                    if winding >= 1:
                        found.enclosed[i, j] += length
                    if winding < 0 or winding > 1:
                        found.wrong[i, j] += length


@njit(cache=True, error_model="numpy")
def _sign(triangles: Array, spans: NDArray[np.intp], x: Array, y: Array, z: Array, distances: Array) -> None:
    """Turn the sign of the distances of enclosed points of a grid."""
    first, places, changes = _crossings(triangles, spans, x, y)
    for i in range(len(x)):
        for j in range(len(y)):
            k, end, winding = first[i * len(y) + j], first[i * len(y) + j + 1], 0
            for m in range(len(z)):
                while k < end and places[k] <= z[m]:
                    winding += changes[k]
                    k += 1
                if winding > 0:
                    distances[i, j, m] = -distances[i, j, m]


def signed_distances(triangles: Array, x: Array, y: Array, z: Array) -> Array:
    """Compute the distances of the points of a grid from a closed mesh, negative inside.

    Parameters
    ----------
    triangles : array, shape (n, 3, 3)
        Corners [m]; neighbours share theirs to the last bit.
    x, y, z : array, shape (n_x,), (n_y,) and (n_z,)
        Places of the grid's planes, increasing [m].

    Returns
    -------
    array, shape (n_x, n_y, n_z)
        [m]
    """
    found = np.empty((len(x), len(y), len(z)))
    corners = np.array(triangles)
    centers = corners.mean(axis=1)
    radii = np.linalg.norm(corners - centers[:, None], axis=2).max(axis=1)
    _nearest(corners, centers, radii, x, y, z, found)
    _sign(corners, _spans(corners, x, y), x, y, z, found)
    return found


@njit(cache=True, error_model="numpy")
def _nearest(triangles: Array, centers: Array, radii: Array, x: Array, y: Array, z: Array, found: Array) -> None:
    """Fill `found` with distances, without sign; triangles whose surrounding sphere is further away are passed over."""
    point = np.empty(3)
    for i in range(len(x)):
        for j in range(len(y)):
            last = 0  # nearest to the point before: seldom far from the nearest now
            for m in range(len(z)):
                point[0], point[1], point[2] = x[i], y[j], z[m]
                best = math.sqrt(_squared_distance(point, triangles[last]))
                for n in range(len(triangles)):
                    dx, dy, dz = x[i] - centers[n, 0], y[j] - centers[n, 1], z[m] - centers[n, 2]
                    reach = best + radii[n]
                    if dx * dx + dy * dy + dz * dz < reach * reach:
                        apart = math.sqrt(_squared_distance(point, triangles[n]))
                        if apart < best:
                            best, last = apart, n
                found[i, j, m] = best


@njit(cache=True, error_model="numpy")
def _squared_distance(p: Array, triangle: Array) -> float:
    """Squared distance of a point from a triangle (Ericson, Real-Time Collision Detection, 2005, sec. 5.1.5)."""
    a, b, c = triangle[0], triangle[1], triangle[2]
    d1 = d2 = d3 = d4 = d5 = d6 = 0.0
    for k in range(3):
        ab, ac = b[k] - a[k], c[k] - a[k]
        d1, d2 = d1 + ab * (p[k] - a[k]), d2 + ac * (p[k] - a[k])
        d3, d4 = d3 + ab * (p[k] - b[k]), d4 + ac * (p[k] - b[k])
        d5, d6 = d5 + ab * (p[k] - c[k]), d6 + ac * (p[k] - c[k])
    in_a, in_b, in_c = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2
    t = s = 0.0  # nearest point: a + t (b - a) + s (c - a)
    if d1 <= 0.0 and d2 <= 0.0:
        t = s = 0.0
    elif d3 >= 0.0 and d4 <= d3:
        t, s = 1.0, 0.0
    elif d6 >= 0.0 and d5 <= d6:
        t, s = 0.0, 1.0
    elif in_c <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        t, s = d1 / (d1 - d3), 0.0
    elif in_b <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        t, s = 0.0, d2 / (d2 - d6)
    elif in_a <= 0.0 and d4 >= d3 and d5 >= d6:
        s = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        t = 1.0 - s
    else:
        t, s = in_b / (in_a + in_b + in_c), in_c / (in_a + in_b + in_c)
    total = 0.0
    for k in range(3):
        off = a[k] + t * (b[k] - a[k]) + s * (c[k] - a[k]) - p[k]
        total += off * off
    return total
