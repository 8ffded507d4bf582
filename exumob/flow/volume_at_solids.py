"""The volume of water at solids: what their motion adds to it goes back to the surface near them.

The fraction is carried on full cells, of which solids close a part, and cells inside are refilled
(`exumob.flow.surface_at_solids`). Neither keeps the volume in the open parts: a cell at a wall that fills up takes more
from its neighbours than it has room for. What a step adds is summed for each solid, and spread over the surface
near it.
"""

from __future__ import annotations

import math

import numpy as np
from numba import prange
from numpy.typing import NDArray

from exumob.flow.area_fractions import AreaFractions
from exumob.flow.grid import HALO, Metrics
from exumob.flow.poses import cells_near
from exumob.flow.surface_at_solids import open_share
from exumob.support.arrays import Array
from exumob.support.kernels import njit

WALL = 1.5
"""Distance from the wall, over the sum of a cell's widths, beyond which cells are wholly open or closed [-]."""
ROUND_OFF = 1.0e-13
"""Change of the fraction below which the volume counts as right [-]."""
LARGEST_RETURN = 0.1
"""Most of a cell's water, or air, that is taken in one step for the volume to be right [-]."""


class ClosedParts:
    """Share of each full cell that the solids close, now and at the placement before.

    Parameters
    ----------
    shape : three ints
        Of padded fields.
    """

    def __init__(self, shape: tuple[int, int, int]) -> None:
        none = np.zeros((0, 6), dtype=np.int64)
        self.now, self.before = np.zeros(shape), np.zeros(shape)
        self._regions = [none, none]

    def step(self) -> None:
        """What is now becomes what was before; `mark` then sets what is."""
        self.now, self.before = self.before, self.now
        self._regions.reverse()

    def mark(self, bodies: AreaFractions, regions: NDArray[np.int64], metrics: Metrics) -> None:
        """Take what the solids close now."""
        mark_closed(self.now, self._regions[0], bodies, regions, metrics)
        self._regions[0] = regions


@njit(cache=True, error_model="numpy", parallel=True)
def mark_closed(
    closed: Array, last: NDArray[np.int64], bodies: AreaFractions, regions: NDArray[np.int64], metrics: Metrics
) -> None:
    """Set the closed share of the cells in the solids' index boxes, and to 0 in the `last` ones [-]."""
    distance = bodies.distance
    for n in range(len(last)):
        (j0, j1), (k0, k1), (i0, i1) = cells_near(last, n, closed.shape)
        for j in prange(j0, j1):
            closed[j, k0:k1, i0:i1] = 0.0
    for n in range(len(regions)):
        (j0, j1), (k0, k1), (i0, i1) = cells_near(regions, n, closed.shape)
        for j in prange(j0, j1):
            for k in range(k0, k1):
                for i in range(i0, i1):
                    reach = WALL * (metrics.dx[i] + metrics.dy[j] + metrics.dz[k])
                    d = distance[j, k, i]
                    if d <= reach:
                        closed[j, k, i] = 1.0 - open_share(bodies, j, k, i) if d > -reach else 1.0


@njit(cache=True, error_model="numpy", inline="always")
def _above_bed(bed: float, k: int, metrics: Metrics) -> float:
    """Share of a cell above the bed [-]."""
    return min(max((metrics.zf[k + 1] - bed) / metrics.dz[k], 0.0), 1.0)


@njit(cache=True, error_model="numpy", parallel=True)
def gained(
    fractions: tuple[Array, Array, Array], closed: tuple[Array, Array], nearest: NDArray[np.int8],
    regions: NDArray[np.int64], bed_heights: Array, metrics: Metrics,
) -> Array:  # fmt: skip
    """Water that a step has added to the open parts of the cells near each solid.

    What flows from cell to cell adds nothing, whatever part of them is open: so the step has added what it has changed
    before the transport, and what the closed parts held more before the step than after it. They also change with the
    place of a solid in the cells, as its volume there does, by a few per cent of what it displaces; this is left out.

    Parameters
    ----------
    fractions : three arrays
        At the begin of the step, when the transport began, and after it [-].
    closed : two arrays
        Closed share of the cells at the begin of the step, and in it [-].
    nearest : array
        Number of the nearest solid.
    regions : array of int, shape (n, 6)
    bed_heights : array, shape (ny, nx)
        Height of the bed below the columns of cells [m].
    metrics : Metrics

    Returns
    -------
    array, shape (n,)
        [m^3]
    """
    first, begin, last = fractions
    before, now = closed
    rows = np.zeros((len(regions), first.shape[0], 4))
    for n in range(len(regions)):
        (j0, j1), (k0, k1), (i0, i1) = cells_near(regions, n, first.shape)
        for j in prange(j0, j1):
            added, held, volume, change = 0.0, 0.0, 0.0, 0.0
            for k in range(k0, k1):
                for i in range(i0, i1):
                    was, share, c = before[j, k, i], now[j, k, i], first[j, k, i]
                    filled = begin[j, k, i] - c
                    if (was == 0.0 and share == 0.0 and filled == 0.0) or nearest[j, k, i] != n:
                        continue
                    cell = metrics.dx[i] * metrics.dy[j] * metrics.dz[k] * _above_bed(bed_heights[j, i], k, metrics)
                    left = share * last[j, k, i]
                    added += cell * (filled + (was * c - left))
                    held += cell * left
                    volume += cell * share
                    change += cell * (share - was)
            rows[n, j, 0], rows[n, j, 1], rows[n, j, 2], rows[n, j, 3] = added, held, volume, change
    found = np.zeros(len(regions))
    for n in range(len(regions)):
        added, held = _over_rows(rows[n, :, 0]), _over_rows(rows[n, :, 1])
        volume, change = _over_rows(rows[n, :, 2]), _over_rows(rows[n, :, 3])
        found[n] = added + (held / volume * change if volume > 0.0 else 0.0)
    return found


@njit(cache=True, error_model="numpy")
def _over_rows(values: Array) -> float:
    """Sum over the rows, the same to the last bit for mirrored ones."""
    return 0.5 * (values + values[::-1]).sum()


@njit(cache=True, error_model="numpy", inline="always")
def _room(fraction: Array, j: int, k: int, i: int, ground: float, taking: bool) -> float:
    """Water that can be taken from the surface in a cell, or air in it that can be filled [-]; 0 away from the surface.

    The surface is in a cell as far as the cell above is less than half full, for taking, or the one below more than
    half full, for giving; of the one below, `ground` is the bed's share, which counts as the cell itself. Both go to 0
    with the fraction that they depend on: neither the last digits of full cells nor a film or a drop decide who takes
    part.
    """
    c = fraction[j, k, i]
    if taking:
        return min(max(c, 0.0), 1.0) * max(1.0 - 2.0 * fraction[j, k + 1, i], 0.0)
    below = (1.0 - ground) * fraction[j, k - 1, i] + ground * c
    return max(1.0 - c, 0.0) * max(2.0 * min(below, 1.0) - 1.0, 0.0)


@njit(cache=True, error_model="numpy", parallel=True)
def return_volume(
    fraction: Array, room: Array, volumes: Array, closed: Array, bodies: AreaFractions, regions: NDArray[np.int64],
    reach: float, bed_heights: Array, metrics: Metrics,
) -> None:  # fmt: skip
    """Take from the surface near each solid what its motion has added to the water, or give it what that has taken.

    Where there is no surface near, the solid is dry or submerged and nothing is done. It takes nine arguments because
    Numba's parallel loops take no record that holds another.

    Parameters
    ----------
    fraction : array, changed
        [-]
    room : array, changed
        Work space.
    volumes : array, shape (n,)
        Volume added [m^3], of `gained`.
    closed : array
        Closed share of the cells [-].
    bodies : AreaFractions
        Of the solids alone.
    regions : array of int, shape (n, 6)
    reach : float
        Distance from the solid at which the surface is no longer near it [m]; the regions reach so far at least.
    bed_heights : array, shape (ny, nx)
        Height of the bed below the columns of cells [m].
    metrics : Metrics
    """
    distance, nearest = bodies.distance, bodies.nearest
    rows = np.zeros((len(regions), fraction.shape[0]))
    for n in range(len(regions)):
        (j0, j1), (k0, k1), (i0, i1) = cells_near(regions, n, fraction.shape)
        taking = volumes[n] > 0.0
        for j in prange(j0, j1):
            total = 0.0
            for k in range(k0, k1):
                for i in range(i0, i1):
                    if nearest[j, k, i] != n:
                        continue
                    bed = bed_heights[j, i]
                    found = _room(fraction, j, k, i, 1.0 - _above_bed(bed, k - 1, metrics) if k > HALO else 1.0, taking)
                    if found > 0.0:
                        share = (1.0 - closed[j, k, i]) * _above_bed(bed, k, metrics)
                        found *= max(2.0 * share - 1.0, 0.0)  # cells half closed or more take no part
                        found *= min(max(2.0 - 2.0 * distance[j, k, i] / reach, 0.0), 1.0)  # nor do those far away
                        total += found * share * metrics.dx[i] * metrics.dy[j] * metrics.dz[k]
                    room[j, k, i] = found
            rows[n, j] = total
    for n in range(len(regions)):
        whole = _over_rows(rows[n])
        if abs(volumes[n]) <= ROUND_OFF * whole or whole == 0.0:
            continue
        part = math.copysign(min(abs(volumes[n]) / whole, LARGEST_RETURN), volumes[n])
        (j0, j1), (k0, k1), (i0, i1) = cells_near(regions, n, fraction.shape)
        for j in prange(j0, j1):
            for k in range(k0, k1):
                for i in range(i0, i1):
                    if nearest[j, k, i] == n:
                        fraction[j, k, i] -= part * room[j, k, i]
