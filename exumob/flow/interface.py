"""Free surface: fraction of water per cell, its transport, and where the surface cuts the line between two cells.

Conservative volume of fluid by directional sweeps (Weymouth & Yue, J. Comput. Phys. 229 (2010) 2853), with THINC fluxes
weighted by the surface's orientation (Xiao et al. 2005; Yokoi, J. Comput. Phys. 226 (2007) 1985). The fraction lives
on full cells, inside solids too; what solids hold is refilled from the water beside them.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from exumob.flow.body import Openness
from exumob.flow.grid import HALO, Metrics
from exumob.states import Array

SHARPNESS = 3.5
"""Slope of the THINC profile [-] (Yokoi 2007): about 1.5 cells between 5 % and 95 %."""
EMPTY = 1.0e-9
"""Fractions nearer to 0 or 1 than this count as air or water [-]."""
STACK = 3
"""Cells searched on either side for the height of the surface."""


@njit(cache=True, error_model="numpy", parallel=True)
def mark_wet(fraction: Array, wet: NDArray[np.uint8]) -> int:
    """Mark cells at least half full; return the highest layer holding any water."""
    ny, nz, nx = fraction.shape
    tops = np.zeros(ny, dtype=np.int64)
    for j in prange(HALO, ny - HALO):
        for k in range(HALO, nz - HALO):
            any_water = False
            for i in range(HALO, nx - HALO):
                c = fraction[j, k, i]
                wet[j, k, i] = 1 if c >= 0.5 else 0
                any_water = any_water or c > EMPTY
            if any_water:
                tops[j] = k
    top = HALO
    for j in range(ny):
        top = max(top, tops[j])
    return top


@njit(cache=True, error_model="numpy", inline="always")
def gradient(c: Array, p: int, sx: int, sy: int, sz: int) -> tuple[float, float, float]:
    """Gradient of the fraction over the 27 cells about p (Youngs), in fractions per cell."""
    gx, gy, gz = 0.0, 0.0, 0.0
    for a in range(-1, 2):
        for b in range(-1, 2):
            weight = (2.0 - abs(a)) * (2.0 - abs(b))
            gx += weight * (c[p + sx + a * sy + b * sz] - c[p - sx + a * sy + b * sz])
            gy += weight * (c[p + sy + a * sx + b * sz] - c[p - sy + a * sx + b * sz])
            gz += weight * (c[p + sz + a * sx + b * sy] - c[p - sz + a * sx + b * sy])
    return gx / 32.0, gy / 32.0, gz / 32.0


@njit(cache=True, error_model="numpy")
def stack_distance(c: Array, p: int, stride: int, up: int, widths: Array, m: int, floor: int) -> float:
    """Distance from a cell's centre to the surface along an axis [m], > 0 in water (height function).

    Parameters
    ----------
    c : array
        Fractions, flat.
    p, stride : int
        The cell, and the step along the axis.
    up : int
        +1 if the air is at larger coordinates, else -1.
    widths, m
        Cell widths along the axis [m], and the cell's index there.
    floor : int
        First index of the axis that can hold water (the bed; 0 for x and y).
    """
    distance = (c[p] - 0.5) * widths[m]
    before = c[p]
    for n in range(1, STACK + 1):
        index = m + up * n
        if index < 0 or index >= len(widths):
            break
        value = c[p + up * n * stride]
        if value <= EMPTY or value > before + 1e-6:
            break
        distance += value * widths[index]
        before = value
    before = c[p]
    for n in range(1, STACK + 1):
        index = m - up * n
        if index < floor or index >= len(widths):
            break
        value = c[p - up * n * stride]
        if value >= 1.0 - EMPTY or value < before - 1e-6:
            break
        distance -= (1.0 - value) * widths[index]
        before = value
    return distance


@njit(cache=True, error_model="numpy")
def surface_position(
    c: Array, p: int, q: int, j: int, k: int, i: int, mj: int, mk: int, mi: int, shape: tuple[int, int, int],
    metrics: Metrics, closest: float,
) -> float:  # fmt: skip
    """Where the surface lies between wet cell p = (j, k, i) and its dry neighbour q = (mj, mk, mi): 0 at p, 1 at q."""
    sy, sz = shape[1] * shape[2], shape[2]
    gx, gy, gz = gradient(c, p, 1, sy, sz)
    if abs(gz) >= abs(gx) and abs(gz) >= abs(gy):
        up = -1 if gz > 0.0 else 1
        here = stack_distance(c, p, sz, up, metrics.dz, k, HALO)
        there = stack_distance(c, q, sz, up, metrics.dz, mk, HALO)
    elif abs(gx) >= abs(gy):
        up = -1 if gx > 0.0 else 1
        here = stack_distance(c, p, 1, up, metrics.dx, i, 0)
        there = stack_distance(c, q, 1, up, metrics.dx, mi, 0)
    else:
        up = -1 if gy > 0.0 else 1
        here = stack_distance(c, p, sy, up, metrics.dy, j, 0)
        there = stack_distance(c, q, sy, up, metrics.dy, mj, 0)
    if here <= 0.0 or there >= 0.0:  # folded or very thin: interpolate the fraction
        here, there = c[p] - 0.5, c[q] - 0.5
    theta = here / max(here - there, 1e-12)
    return min(max(theta, closest), 1.0)


@njit(cache=True, error_model="numpy", inline="always")
def thinc_flux(c: float, rising: float, courant: float) -> float:
    """Water leaving a cell through one face, as a fraction of the cell.

    Parameters
    ----------
    c : float
        Fraction of the cell.
    rising : float
        +1 if the fraction rises towards larger coordinates, -1 if it falls.
    courant : float
        Signed share of the cell that leaves, > 0 through the high face.
    """
    b = SHARPNESS
    ends = math.exp(b * rising * (2.0 * c - 1.0))
    e = (math.exp(b) - ends) / (ends - math.exp(-b))  # exp(2 b * position of the jump)
    if courant > 0.0:
        s0, s1 = 1.0 - courant, 1.0
    else:
        s0, s1 = 0.0, -courant
    if e > 1e30:  # the jump lies far beyond the high face
        logarithm = 0.0
    else:
        logarithm = math.log((math.exp(2.0 * b * s1) + e) / (math.exp(2.0 * b * s0) + e))
    mean = 0.5 * (s1 - s0) + rising / (2.0 * b) * (logarithm - b * (s1 - s0))
    return math.copysign(min(max(mean, 0.0), min(abs(courant), c)), courant)


@njit(cache=True, error_model="numpy", parallel=True)
def sweep_fluxes(fraction: Array, flow: Array, axis: int, top: int, dt: float, metrics: Metrics, flux: Array) -> None:
    """Volume of water through each low face along one axis, per face area [m].

    Parameters
    ----------
    fraction, flow : array
        Fraction [-] and velocity relative to the grid [m/s].
    axis : int
        0 x, 1 y, 2 z.
    top : int
        Highest layer to visit.
    flux : array, changed
        dt times flow times the fraction that passes [m].
    """
    ny, nz, nx = fraction.shape
    sy, sz = nz * nx, nx
    stride = 1 if axis == 0 else (sy if axis == 1 else sz)
    c, u, f = fraction.ravel(), flow.ravel(), flux.ravel()
    for j in prange(HALO, ny - HALO + 1):
        for k in range(HALO, min(top + 1, nz - HALO) + 1):
            for i in range(HALO, nx - HALO + 1):
                p = j * sy + k * sz + i
                shift = dt * u[p]
                donor = p - stride if shift > 0.0 else p
                value = c[donor]
                if value <= EMPTY:
                    f[p] = 0.0
                    continue
                if value >= 1.0 - EMPTY:
                    f[p] = shift * value
                    continue
                m = i if axis == 0 else (j if axis == 1 else k)
                widths = metrics.dx if axis == 0 else (metrics.dy if axis == 1 else metrics.dz)
                width = widths[m - 1] if shift > 0.0 else widths[m]
                gx, gy, gz = gradient(c, donor, 1, sy, sz)
                slope = gx if axis == 0 else (gy if axis == 1 else gz)
                total = abs(gx) + abs(gy) + abs(gz)
                weight = abs(slope) / total if total > 1e-12 else 0.0
                passed = 0.0
                if weight > 0.0:
                    passed = weight * width * thinc_flux(value, math.copysign(1.0, slope), shift / width)
                f[p] = passed + (1.0 - weight) * value * shift


@njit(cache=True, error_model="numpy", parallel=True)
def sweep_update(
    fraction: Array, begin: Array, flow: Array, flux: Array, axis: int, top: int, dt: float, metrics: Metrics
) -> None:
    """Take the fluxes of one sweep; cells that began more than half full also take the sweep's own dilatation."""
    ny, nz, nx = fraction.shape
    stride = 1 if axis == 0 else (nz * nx if axis == 1 else nx)
    c, b, u, f = fraction.ravel(), begin.ravel(), flow.ravel(), flux.ravel()
    for j in prange(HALO, ny - HALO):
        for k in range(HALO, min(top + 1, nz - HALO - 1) + 1):
            for i in range(HALO, nx - HALO):
                p = (j * nz + k) * nx + i
                width = metrics.dx[i] if axis == 0 else (metrics.dy[j] if axis == 1 else metrics.dz[k])
                change = f[p] - f[p + stride]
                if b[p] >= 0.5:
                    change += dt * (u[p + stride] - u[p])
                c[p] += change / width


@njit(cache=True, error_model="numpy", parallel=True)
def remove_dilatation(
    fraction: Array, begin: Array, ax: Array, ay: Array, az: Array, top: int, dt: float, metrics: Metrics
) -> None:
    """Take back the sum of the sweeps' dilatations, which is 0 where the flow has no divergence: volume is exact."""
    ny, nz, nx = fraction.shape
    for j in prange(HALO, ny - HALO):
        for k in range(HALO, min(top + 1, nz - HALO - 1) + 1):
            for i in range(HALO, nx - HALO):
                if begin[j, k, i] >= 0.5:
                    fraction[j, k, i] -= dt * (
                        (ax[j, k, i + 1] - ax[j, k, i]) / metrics.dx[i]
                        + (ay[j + 1, k, i] - ay[j, k, i]) / metrics.dy[j]
                        + (az[j, k + 1, i] - az[j, k, i]) / metrics.dz[k]
                    )
                if fraction[j, k, i] < 0.0 and fraction[j, k, i] > -1e-12:
                    fraction[j, k, i] = 0.0


@njit(cache=True, error_model="numpy")
def sample_outside(
    fraction: Array, distance: Array, x: float, y: float, z: float, j: int, k: int, i: int, metrics: Metrics
) -> float:
    """Fraction at a point near cell (j, k, i), trilinear over the cells outside solids; -1 if there is none."""
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


@njit(cache=True, error_model="numpy")
def refill_solids(
    fraction: Array, refilled: Array, distance: Array, regions: NDArray[np.int64], metrics: Metrics, depth: float
) -> None:
    """Give cells inside solids, up to `depth` cells below the wall, the fraction of the fluid beside them.

    Parameters
    ----------
    fraction : array, changed
        [-]
    refilled : array
        Work space.
    distance : array
        Signed distance to the nearest solid [m].
    regions : array of int, shape (n, 6)
        Index boxes of the solids.
    depth : float
        [cells]
    """
    ny, nz, nx = fraction.shape
    for write in range(2):
        for n in range(len(regions)):
            for j in range(max(regions[n, 0], HALO), min(regions[n, 1], ny - HALO)):
                for k in range(max(regions[n, 2], HALO), min(regions[n, 3], nz - HALO)):
                    for i in range(max(regions[n, 4], HALO), min(regions[n, 5], nx - HALO)):
                        d = distance[j, k, i]
                        if d >= 0.0:
                            continue
                        gx = (distance[j, k, i + 1] - distance[j, k, i - 1]) / (metrics.ex[i + 1] + metrics.ex[i])
                        gy = (distance[j + 1, k, i] - distance[j - 1, k, i]) / (metrics.ey[j + 1] + metrics.ey[j])
                        gz = (distance[j, k + 1, i] - distance[j, k - 1, i]) / (metrics.ez[k + 1] + metrics.ez[k])
                        norm = math.sqrt(gx * gx + gy * gy + gz * gz)
                        if norm < 1e-6:
                            continue
                        gx, gy, gz = gx / norm, gy / norm, gz / norm
                        h = abs(gx) * metrics.dx[i] + abs(gy) * metrics.dy[j] + abs(gz) * metrics.dz[k]
                        if d > -0.5 * h or d < -depth * h:
                            continue
                        if write:
                            fraction[j, k, i] = refilled[j, k, i]
                            continue
                        step = h - d
                        value = sample_outside(
                            fraction, distance, metrics.xc[i] + step * gx, metrics.yc[j] + step * gy,
                            max(metrics.zc[k] + step * gz, metrics.zc[HALO]), j, k, i, metrics,
                        )  # fmt: skip
                        refilled[j, k, i] = fraction[j, k, i] if value < 0.0 else value


@njit(cache=True, error_model="numpy")
def release_surface(
    fraction: Array, changed: Array, solids: Openness, regions: NDArray[np.int64], position: Array, velocity: Array,
    angular_velocity: Array, frame: Array, dt: float, metrics: Metrics,
) -> None:  # fmt: skip
    """Undo what the closed part of cut cells carried along the wall.

    The fraction moves with the solid where a cell is closed; a wall that slides through the surface would drag it
    along by that share of the cell and take water out of the open part. Only the motion through the wall moves water.

    Parameters
    ----------
    fraction : array, changed
        [-]
    changed : array
        Work space.
    position, velocity, angular_velocity : array, shape (n, 3)
        Of the solids, grid axes.
    frame : array, shape (3,)
        Velocity of the grid's origin [m/s] and its yaw rate [rad/s].
    """
    ny, nz, nx = fraction.shape
    d = solids.distance
    for write in range(2):
        for n in range(len(regions)):
            for j in range(max(regions[n, 0], HALO), min(regions[n, 1], ny - HALO)):
                for k in range(max(regions[n, 2], HALO), min(regions[n, 3], nz - HALO)):
                    for i in range(max(regions[n, 4], HALO), min(regions[n, 5], nx - HALO)):
                        if solids.nearest[j, k, i] != n:
                            continue
                        share = (
                            solids.bx[j, k, i] + solids.bx[j, k, i + 1] + solids.by[j, k, i] + solids.by[j + 1, k, i]
                            + solids.bz[j, k, i] + solids.bz[j, k + 1, i]
                        ) / 6.0  # fmt: skip
                        if share > 0.999 or share < 0.001:
                            continue
                        if write:
                            fraction[j, k, i] = changed[j, k, i]
                            continue
                        c = fraction[j, k, i]
                        changed[j, k, i] = c
                        gx = (d[j, k, i + 1] - d[j, k, i - 1]) / (metrics.ex[i + 1] + metrics.ex[i])
                        gy = (d[j + 1, k, i] - d[j - 1, k, i]) / (metrics.ey[j + 1] + metrics.ey[j])
                        gz = (d[j, k + 1, i] - d[j, k - 1, i]) / (metrics.ez[k + 1] + metrics.ez[k])
                        norm = math.sqrt(gx * gx + gy * gy + gz * gz)
                        if norm < 1e-6:
                            continue
                        gx, gy, gz = gx / norm, gy / norm, gz / norm
                        x, y, z = metrics.xc[i], metrics.yc[j], metrics.zc[k]
                        px, py, pz = x - position[n, 0], y - position[n, 1], z - position[n, 2]
                        o = angular_velocity[n]
                        ux = velocity[n, 0] + o[1] * pz - o[2] * py - (frame[0] - frame[2] * y)
                        uy = velocity[n, 1] + o[2] * px - o[0] * pz - (frame[1] + frame[2] * x)
                        uz = velocity[n, 2] + o[0] * py - o[1] * px
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


def transport(
    fraction: Array, begin: Array, flow: tuple[Array, Array, Array], order: tuple[int, int, int], top: int, dt: float,
    metrics: Metrics, flux: Array, fill: object,
) -> None:  # fmt: skip
    """Carry the fraction over one step; `fill(fraction)` sets the halo after each sweep.

    Parameters
    ----------
    fraction : array, changed
        [-]; on entry equal to `begin`.
    begin : array
        Fraction at the begin of the step.
    flow : three arrays
        Velocity relative to the grid on full faces [m/s].
    order : three ints
        Order of the sweeps (changed from step to step).
    top : int
        Highest layer that water can reach in this step.
    dt : float
        [s]
    """
    for axis in order:
        sweep_fluxes(fraction, flow[axis], axis, top, dt, metrics, flux)
        sweep_update(fraction, begin, flow[axis], flux, axis, top, dt, metrics)
        fill(fraction)  # type: ignore[operator]
    remove_dilatation(fraction, begin, *flow, top, dt, metrics)
    fill(fraction)  # type: ignore[operator]
