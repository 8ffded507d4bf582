"""Lines through a triangle mesh: how often each stretch of them is enclosed.

Along a line the winding number of a closed mesh rises by 1 where it enters through a face and falls by 1 where it
leaves. A surface that neither cuts itself nor another one encloses each point once or not at all; where bodies overlap
the number is 2, in a body turned inside out it is -1, and both occur where a surface cuts through itself.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from exumob.support.arrays import Array


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
    low_ends, high_ends = turned.min(axis=1), turned.max(axis=1)
    spans = [
        np.searchsorted(places, low_ends[:, k]) if first else np.searchsorted(places, high_ends[:, k], side="right")
        for k, places in ((0, u), (1, v)) for first in (True, False)
    ]  # fmt: skip
    _measure(turned, np.stack(spans, axis=1), np.ascontiguousarray(u), np.ascontiguousarray(v), *ends, found)
    return found


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
def _measure(
    triangles: Array, spans: NDArray[np.intp], u: Array, v: Array, low: Array, high: Array, found: Lines
) -> None:
    """Fill `found`; spans: the lines that a triangle can meet, the first and the one after the last along u, then v."""
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
    for i in range(len(u)):
        for j in range(n_v):
            start, end = first[i * n_v + j], first[i * n_v + j + 1]
            total = 0
            for k in range(start, end):
                total += changes[k]
            if total != 0:
                continue
            winding = 0
            for k in range(start, end - 1):
                winding += changes[k]
                length = min(places[k + 1], high[i, j]) - max(places[k], low[i, j])
                if length > 0.0:
                    if winding >= 1:
                        found.enclosed[i, j] += length
                    if winding < 0 or winding > 1:
                        found.wrong[i, j] += length
