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
from exumob.flow.grid import HALO, GridVelocity, Metrics
from exumob.flow.poses import PlacedSolids, body_velocity, cells_near
from exumob.support.arrays import Array
from exumob.support.kernels import njit


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


@njit(cache=True, error_model="numpy", parallel=True)
def refill_solids(fraction: Array, distance: Array, regions: NDArray[np.int64], metrics: Metrics, depth: float) -> None:
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
    """
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
                        fraction[j, k, i] = value


@njit(cache=True, error_model="numpy", inline="always")
def open_share(o: AreaFractions, j: int, k: int, i: int) -> float:
    """Mean area fraction of a cell's six faces; pairs are added first, so that mirrored cells agree to the last bit."""
    x, y, z = o.bx[j, k, i] + o.bx[j, k, i + 1], o.by[j, k, i] + o.by[j + 1, k, i], o.bz[j, k, i] + o.bz[j, k + 1, i]
    return (x + y + z) / 6.0


@njit(cache=True, error_model="numpy", parallel=True)
def release_surface(
    fraction: Array, changed: Array, area_fractions: AreaFractions, solids: PlacedSolids, grid_velocity: GridVelocity,
    dt: float, metrics: Metrics,
) -> None:  # fmt: skip
    """Correct the fraction of partly closed cells for the motion of the solid along its own wall.

    The transport carries the fraction of a cell with the solid's velocity in the share of the cell that the solid
    closes. Where a wall slides along itself, past a surface that stays, this share would drag the surface along and
    draw water out of the open part. This function takes that part of the transport back: the closed share of the cell
    times the change of the fraction along the wall, upwind. The motion of the wall through itself, which does displace
    water, is left in.

    Parameters
    ----------
    fraction : array, changed
        [-]
    changed : array
        Work space.
    area_fractions : AreaFractions
    solids : PlacedSolids
        Not the bed: it is at rest like the water, whatever the grid does.
    grid_velocity : GridVelocity
    dt : float
        [s]
    metrics : Metrics
    """
    o, regions = area_fractions, solids.regions
    for n in range(len(regions)):
        (j0, j1), (k0, k1), (i0, i1) = cells_near(regions, n, fraction.shape)
        for j in prange(j0, j1):
            for k in range(k0, k1):
                for i in range(i0, i1):
                    if o.nearest[j, k, i] != n:
                        continue
                    share = open_share(o, j, k, i)
                    if not 0.001 <= share <= 0.999:
                        continue
                    c = fraction[j, k, i]
                    changed[j, k, i] = c
                    gx, gy, gz = distance_gradient(o.distance, j, k, i, metrics)
                    norm = math.sqrt(gx * gx + gy * gy + gz * gz)
                    if norm < 1e-6:
                        continue
                    gx, gy, gz = gx / norm, gy / norm, gz / norm
                    x, y = metrics.xc[i], metrics.yc[j]
                    ux, uy, uz = body_velocity(
                        solids, n, x - solids.position[n, 0], y - solids.position[n, 1],
                        metrics.zc[k] - solids.position[n, 2],
                    )  # fmt: skip
                    ux -= grid_velocity.x - grid_velocity.yaw_rate * y
                    uy -= grid_velocity.y + grid_velocity.yaw_rate * x
                    through = ux * gx + uy * gy + uz * gz
                    ux, uy, uz = ux - through * gx, uy - through * gy, uz - through * gz
                    if ux > 0.0:
                        slope = ux * (fraction[j, k, i + 1] - c) / metrics.ex[i + 1]
                    else:
                        slope = ux * (c - fraction[j, k, i - 1]) / metrics.ex[i]
                    if uy > 0.0:
                        slope += uy * (fraction[j + 1, k, i] - c) / metrics.ey[j + 1]
                    else:
                        slope += uy * (c - fraction[j - 1, k, i]) / metrics.ey[j]
                    if uz > 0.0:
                        slope += uz * (fraction[j, k + 1, i] - c) / metrics.ez[k + 1]
                    elif k > HALO:
                        slope += uz * (c - fraction[j, k - 1, i]) / metrics.ez[k]
                    changed[j, k, i] = c + dt * (1.0 - share) * slope
    for n in range(len(regions)):
        (j0, j1), (k0, k1), (i0, i1) = cells_near(regions, n, fraction.shape)
        for j in prange(j0, j1):
            for k in range(k0, k1):
                for i in range(i0, i1):
                    if o.nearest[j, k, i] == n and 0.001 <= open_share(o, j, k, i) <= 0.999:
                        fraction[j, k, i] = changed[j, k, i]
