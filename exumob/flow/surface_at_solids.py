"""The free surface at solids: what fraction the cells inside and at the wall of solids hold.

The fraction lives on full cells, those inside solids too (`exumob.flow.free_surface`); it is kept there as if the water
went on inside.
"""

from __future__ import annotations

import math

import numpy as np
from numba import prange
from numpy.typing import NDArray

from exumob.flow.area_fractions import AreaFractions, distance_gradient
from exumob.flow.free_surface import EMPTY, Sweeps
from exumob.flow.grid import HALO, GridVelocity, Metrics
from exumob.flow.poses import PlacedSolids, body_velocity, cells_near
from exumob.support.arrays import Array
from exumob.support.kernels import njit

LEAST_SHARE = 1.0e-6
"""Open share of a cell below which it counts as closed [-]."""
SMALL_SHARE, LARGE_SHARE = 0.1, 0.3
"""Open share below which the fraction of a cell follows the water beside it, and from which it is its own [-]."""
ROUND_OFF = 1.0e-13
"""Change of the fraction below which the volume counts as right [-]."""
LARGEST_RETURN = 0.1
"""Most of a cell's water, or air, that is taken in one step for the volume to be right [-]."""
TAKES_PART = 0.5
"""Open share from which a cell takes part in that [-]."""


@njit(cache=True, error_model="numpy")
def sample_outside(
    fraction: Array, distance: Array, point: tuple[float, float, float], cell: tuple[int, int, int], metrics: Metrics
) -> float:
    """Fraction at a point (x, y, z) near a cell (j, k, i), trilinear over the cells outside solids; -1: none there."""
    (x, y, z), (j, k, i) = point, cell
    ny, nz, nx = fraction.shape
    while i > 1 and metrics.xc[i] > x:
        i -= 1
    while i < nx - 3 and metrics.xc[i + 1] <= x:
        i += 1
    while j > 1 and metrics.yc[j] > y:
        j -= 1
    while j < ny - 3 and metrics.yc[j + 1] <= y:
        j += 1
    while k > 1 and metrics.zc[k] > z:
        k -= 1
    while k < nz - 3 and metrics.zc[k + 1] <= z:
        k += 1
    fx = min(max((x - metrics.xc[i]) / metrics.ex[i + 1], 0.0), 1.0)
    fy = min(max((y - metrics.yc[j]) / metrics.ey[j + 1], 0.0), 1.0)
    fz = min(max((z - metrics.zc[k]) / metrics.ez[k + 1], 0.0), 1.0)
    total, weights = 0.0, 0.0
    for a in range(2):
        for b in range(2):
            for c in range(2):
                if distance[j + a, k + b, i + c] > 0.0:
                    weight = (fy if a else 1.0 - fy) * (fz if b else 1.0 - fz) * (fx if c else 1.0 - fx)
                    total += weight * fraction[j + a, k + b, i + c]
                    weights += weight
    return total / weights if weights > 1e-6 else -1.0


@njit(cache=True, error_model="numpy", inline="always")
def open_share(o: AreaFractions, j: int, k: int, i: int) -> float:
    """Mean area fraction of a cell's six faces."""
    return (
        o.bx[j, k, i] + o.bx[j, k, i + 1] + o.by[j, k, i] + o.by[j + 1, k, i] + o.bz[j, k, i] + o.bz[j, k + 1, i]
    ) / 6.0


@njit(cache=True, error_model="numpy", parallel=True)
def refill_solids(
    fraction: Array, distance: Array, regions: NDArray[np.int64], metrics: Metrics, depth: float
) -> Array:
    """Give cells inside solids, up to `depth` cells below the wall, the fraction of the fluid beside them.

    Parameters
    ----------
    fraction : array, changed
        [-]
    distance : array
        Signed distance to the nearest solid [m].
    regions : array of int, shape (n, 6)
        Index boxes of the solids.
    depth : float
        [cells]

    Returns
    -------
    array, shape (n, ny)
        Volume on full cells given near each solid, by rows [m^3].
    """
    given = np.zeros((len(regions), fraction.shape[0]))
    for n in range(len(regions)):
        (j0, j1), (k0, k1), (i0, i1) = cells_near(regions, n, fraction.shape)
        for j in prange(j0, j1):
            for k in range(k0, k1):
                for i in range(i0, i1):
                    d = distance[j, k, i]
                    if d >= 0.0:
                        continue
                    gx, gy, gz = distance_gradient(distance, j, k, i, metrics)
                    norm = math.sqrt(gx * gx + gy * gy + gz * gz)
                    if norm < 1e-6:
                        continue
                    gx, gy, gz = gx / norm, gy / norm, gz / norm
                    h = abs(gx) * metrics.dx[i] + abs(gy) * metrics.dy[j] + abs(gz) * metrics.dz[k]
                    if d > -0.5 * h or d < -depth * h:
                        continue
                    step = h - d
                    value = sample_outside(  # of cells outside alone, so the order of the writes does not matter
                        fraction, distance,
                        (metrics.xc[i] + step * gx, metrics.yc[j] + step * gy,
                         max(metrics.zc[k] + step * gz, metrics.zc[HALO])),
                        (j, k, i), metrics,
                    )  # fmt: skip
                    if value >= 0.0:
                        given[n, j] += (value - fraction[j, k, i]) * metrics.dx[i] * metrics.dy[j] * metrics.dz[k]
                        fraction[j, k, i] = value
    return given


@njit(cache=True, error_model="numpy", inline="always")
def _own_part(share: float) -> float:
    """How much more the water that passes the wall changes the fraction of a cell than that of a full one [-]."""
    return (1.0 / share - 1.0) * min((share - SMALL_SHARE) / (LARGE_SHARE - SMALL_SHARE), 1.0)


@njit(cache=True, error_model="numpy", inline="always")
def _past_wall(
    passing: float, donor_low: float, donor_high: float, flux: float, wall: float, dt: float
) -> tuple[float, float]:
    """Water that passes a face relative to the wall, per face area [m], and the velocity with which it does [m/s].

    `passing`: velocity on the full face relative to the grid [m/s], `flux` what of water passes with it [m], `wall`:
    velocity of the wall relative to the grid [m/s], `donor_low`, `donor_high`: fractions before and behind the face.
    """
    relative = passing - wall
    if passing * relative > 0.0:
        return flux * (relative / passing), relative
    return dt * relative * (donor_low if relative > 0.0 else donor_high), relative


@njit(cache=True, error_model="numpy", parallel=True)
def fill_open_part(
    fraction: Array, changed: Array, sweeps: Sweeps, axis: int, bodies: AreaFractions, solids: PlacedSolids,
    grid_velocity: GridVelocity, metrics: Metrics, given: Array,
) -> None:  # fmt: skip
    """After one sweep: what passed the walls filled or emptied the open part of a partly closed cell, not all of it.

    The sweeps carry the fraction on full cells with the velocity beta u + (1 - beta) u_s. Of it the wall's own u_s
    shifts the fraction as it stands, while the water that passes the wall, beta (u - u_s), has only the open share of
    the cell for its own. This function adds the difference, 1 / share - 1 times the change by the latter. Then solids
    at rest leave the sum of open share times fraction as it is, and a wall that slides along itself leaves the surface
    where it is. Cells hardly open would overflow in a step; they are left to `refill_solids` and `return_volume`.

    Parameters
    ----------
    fraction : array, changed
        [-]
    changed : array
        Work space, 0.
    sweeps : Sweeps
        With the fluxes of this sweep.
    axis : int
        Of the sweep: 0 x, 1 y, 2 z.
    bodies : AreaFractions
        Of the solids alone: a given bed is at rest like the water, whatever the grid does.
    solids : PlacedSolids
    grid_velocity : GridVelocity
    metrics : Metrics
    given : array, shape (n, ny), changed
        Volume on full cells that this adds near each solid, by rows [m^3].
    """
    o, regions, dt = bodies, solids.regions, sweeps.dt
    begin, flux, passing = sweeps.begin, sweeps.flux, sweeps.relative[axis]
    a, b, c = axis == 1, axis == 2, axis == 0
    for n in range(len(regions)):
        (j0, j1), (k0, k1), (i0, i1) = cells_near(regions, n, fraction.shape)
        for j in prange(j0, j1):
            for k in range(k0, k1):
                for i in range(i0, i1):
                    if o.nearest[j, k, i] != n:
                        continue
                    changed[j, k, i] = 0.0
                    share = open_share(o, j, k, i)
                    if share >= 1.0 or share <= SMALL_SHARE:
                        continue
                    ux, uy, uz = body_velocity(  # a component does not depend on the place along its own axis
                        solids, n, metrics.xc[i] - solids.position[n, 0], metrics.yc[j] - solids.position[n, 1],
                        metrics.zc[k] - solids.position[n, 2],
                    )  # fmt: skip
                    if axis == 0:
                        wall, width = ux - (grid_velocity.x - grid_velocity.yaw_rate * metrics.yc[j]), metrics.dx[i]
                    elif axis == 1:
                        wall, width = uy - (grid_velocity.y + grid_velocity.yaw_rate * metrics.xc[i]), metrics.dy[j]
                    else:
                        wall, width = uz, metrics.dz[k]
                    here = fraction[j, k, i]
                    before, after = fraction[j - a, k - b, i - c], fraction[j + a, k + b, i + c]
                    low, slow = _past_wall(passing[j, k, i], before, here, flux[j, k, i], wall, dt)
                    high, fast = _past_wall(
                        passing[j + a, k + b, i + c], here, after, flux[j + a, k + b, i + c], wall, dt
                    )
                    change = low - high + (dt * (fast - slow) if begin[j, k, i] >= 0.5 else 0.0)
                    changed[j, k, i] = _own_part(share) * change / width
    for n in range(len(regions)):
        (j0, j1), (k0, k1), (i0, i1) = cells_near(regions, n, fraction.shape)
        for j in prange(j0, j1):
            for k in range(k0, k1):
                for i in range(i0, i1):
                    if o.nearest[j, k, i] == n:
                        fraction[j, k, i] += changed[j, k, i]
                        given[n, j] += changed[j, k, i] * metrics.dx[i] * metrics.dy[j] * metrics.dz[k]
                        changed[j, k, i] = 0.0


@njit(cache=True, error_model="numpy", parallel=True)
def settle_open_part(
    fraction: Array, sweeps: Sweeps, bodies: AreaFractions, solids: PlacedSolids, metrics: Metrics, given: Array
) -> None:
    """Take the sum of the sweeps' dilatations back from the open part, too; see `fill_open_part`."""
    o, regions, dt = bodies, solids.regions, sweeps.dt
    begin, fx, fy, fz = sweeps.begin, sweeps.relative[0], sweeps.relative[1], sweeps.relative[2]
    for n in range(len(regions)):
        (j0, j1), (k0, k1), (i0, i1) = cells_near(regions, n, fraction.shape)
        for j in prange(j0, j1):
            for k in range(k0, k1):
                for i in range(i0, i1):
                    if o.nearest[j, k, i] != n or begin[j, k, i] < 0.5:
                        continue
                    share = open_share(o, j, k, i)
                    if share >= 1.0 or share <= SMALL_SHARE:
                        continue
                    rate = (fx[j, k, i + 1] - fx[j, k, i]) / metrics.dx[i]  # that of the walls is 0: they are rigid
                    rate += (fy[j + 1, k, i] - fy[j, k, i]) / metrics.dy[j]
                    rate += (fz[j, k + 1, i] - fz[j, k, i]) / metrics.dz[k]
                    change = _own_part(share) * dt * rate
                    fraction[j, k, i] -= change
                    given[n, j] -= change * metrics.dx[i] * metrics.dy[j] * metrics.dz[k]


@njit(cache=True, error_model="numpy", parallel=True)
def closed_content(fraction: Array, bodies: AreaFractions, regions: NDArray[np.int64], metrics: Metrics) -> Array:
    """Volume that the fraction on full cells has in the closed part of the cells near each solid, by rows [m^3]."""
    o = bodies
    content = np.zeros((len(regions), fraction.shape[0]))
    for n in range(len(regions)):
        (j0, j1), (k0, k1), (i0, i1) = cells_near(regions, n, fraction.shape)
        for j in prange(j0, j1):
            for k in range(k0, k1):
                for i in range(i0, i1):
                    if o.nearest[j, k, i] != n:
                        continue
                    share = open_share(o, j, k, i)
                    if share < 1.0:
                        closed = 1.0 if share < LEAST_SHARE else 1.0 - share
                        content[n, j] += closed * fraction[j, k, i] * metrics.dx[i] * metrics.dy[j] * metrics.dz[k]
    return content


@njit(cache=True, error_model="numpy", inline="always")
def _surface_weight(fraction: Array, o: AreaFractions, j: int, k: int, i: int, taking: bool) -> float:
    """Weight of a cell of the surface, 0 for others [-]: what it holds of water, or of air if it is given some."""
    c = fraction[j, k, i]
    if c <= EMPTY or (c >= 1.0 - EMPTY and fraction[j, k + 1, i] >= 0.5):
        return 0.0
    share = open_share(o, j, k, i)
    return 0.0 if share < TAKES_PART else share * _movable(c, taking)


@njit(cache=True, error_model="numpy", inline="always")
def _movable(c: float, taking: bool) -> float:
    """Water that can be taken from a surface cell, or the air that it has room for: full ones have a little, too."""
    return min(c, 1.0) if taking else max(1.0 - c, 0.01)


@njit(cache=True, error_model="numpy")
def return_volume(
    fraction: Array, gained: Array, bodies: AreaFractions, regions: NDArray[np.int64], metrics: Metrics
) -> None:
    """Give the surface near each solid what its motion has taken from the water, or take what it has added.

    A wall that moves through the grid closes and opens cells by its place, and displaces water by its velocity: near
    the surface the two agree to a few per cent of the displaced water. Cells inside solids are refilled, too. What this
    adds or takes is spread over the cells of the surface near the solid. Where there are none, the solid is dry or
    submerged and nothing is done.

    Parameters
    ----------
    fraction : array, changed
        [-]
    gained : array, shape (n,)
        Volume that the motion of each solid has added to the water [m^3].
    bodies : AreaFractions
    regions : array of int, shape (n, 6)
    metrics : Metrics
    """
    o = bodies
    for n in range(len(regions)):
        (j0, j1), (k0, k1), (i0, i1) = cells_near(regions, n, fraction.shape)
        taking = gained[n] > 0.0
        weights = 0.0
        for j in range(j0, j1):
            for k in range(k0, k1):
                for i in range(i0, i1):
                    if o.nearest[j, k, i] == n:
                        weight = _surface_weight(fraction, o, j, k, i, taking)
                        weights += weight * metrics.dx[i] * metrics.dy[j] * metrics.dz[k]
        if abs(gained[n]) <= ROUND_OFF * weights or weights == 0.0:
            continue
        part = min(abs(gained[n]) / weights, LARGEST_RETURN)
        for k in range(k0, k1):  # upwards: a cell's weight depends on the one above it
            for j in range(j0, j1):
                for i in range(i0, i1):
                    if o.nearest[j, k, i] == n and _surface_weight(fraction, o, j, k, i, taking) > 0.0:
                        change = part * _movable(fraction[j, k, i], taking)
                        fraction[j, k, i] -= change if taking else -change
