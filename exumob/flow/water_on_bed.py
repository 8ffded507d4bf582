"""Effects of a given bed (`exumob.flow.bed`) on the water: fraction below it, films on it, friction."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import prange
from numpy.typing import NDArray

from exumob.flow.active_rows import WaterCells
from exumob.flow.advection import RESOLVED
from exumob.flow.area_fractions import AreaFractions
from exumob.flow.grid import HALO, Metrics
from exumob.flow.turbulence.wall import friction_velocity
from exumob.support.arrays import Array
from exumob.support.kernels import njit

DEEP = 2
"""Cells below the bed from which the velocity is 0: no flow sees it."""


class RoughBed(NamedTuple):
    """A bed that exerts friction."""

    heights: Array
    """Below the columns of cells [m], shape (ny, nx)"""
    top: int
    """First layer above all of the bed"""
    roughness: float
    """Equivalent sand roughness [m]; 0: smooth"""


@njit(cache=True, error_model="numpy", parallel=True)
def refill(fraction: Array, heights: Array, top: int, nearest: NDArray[np.int8], number: int, metrics: Metrics) -> None:
    """Give cells below the bed the fraction that the water above or beside them has there.

    Full below water; in the ground behind a shore the mean of the open cells beside them, so that the surface seems to
    go on level; elsewhere they keep what they hold.

    Parameters
    ----------
    fraction : array, changed
        [-]
    heights : array, shape (ny, nx)
        Heights of the bed [m].
    top : int
        First layer above all of the bed.
    nearest : array
        `AreaFractions.nearest`; cells nearer to a solid are left to `exumob.flow.surface_at_solids.refill_solids`.
    number : int
        Number of the bed in it.
    metrics : Metrics
    """
    ny, nz, nx = fraction.shape
    for j in prange(HALO, ny - HALO):
        for i in range(HALO, nx - HALO):
            z = heights[j, i]
            first = HALO
            while first < nz - HALO and metrics.zf[first + 1] <= z:
                first += 1
            wet = first < nz - HALO and max(fraction[j, first, i], fraction[j, first + 1, i]) > RESOLVED
            for k in range(HALO, min(first, top)):
                if nearest[j, k, i] != number:
                    continue
                if wet:
                    fraction[j, k, i] = 1.0
                    continue
                total, count = 0.0, 0
                for n in range(4):
                    b, a = j + (n == 0) - (n == 1), i + (n == 2) - (n == 3)
                    if metrics.zf[k + 1] > heights[b, a] and HALO <= b < ny - HALO and HALO <= a < nx - HALO:
                        total += fraction[b, k, a]  # of open cells alone, so the order of the writes does not matter
                        count += 1
                if count > 0:
                    fraction[j, k, i] = total / count


@njit(cache=True, error_model="numpy", parallel=True)
def stop_below(
    velocity: tuple[Array, Array, Array], wet: NDArray[np.uint8], area_fractions: AreaFractions, heights: Array,
    top: int, number: int, metrics: Metrics,
) -> None:  # fmt: skip
    """Set the velocity to 0 more than `DEEP` cells below the bed, and of films: on faces it cuts, away from wet cells.

    A film thinner than half a cell that nothing holds would slide down a shore ever faster.
    """
    u, v, w = velocity
    bx, by, bz = area_fractions.bx, area_fractions.by, area_fractions.bz
    ny, nz, nx = u.shape
    for j in prange(HALO, ny - HALO):
        for k in range(HALO, min(top, nz - HALO)):
            z = metrics.zf[k + 1] + DEEP * metrics.dz[k]
            for i in range(HALO, nx - HALO):
                if z < heights[j, i]:
                    u[j, k, i] = v[j, k, i] = w[j, k, i] = 0.0
                elif wet[j, k, i] == 0 and area_fractions.nearest[j, k, i] == number:
                    if bx[j, k, i] < 1.0 and wet[j, k, i - 1] == 0:
                        u[j, k, i] = 0.0
                    if by[j, k, i] < 1.0 and wet[j - 1, k, i] == 0:
                        v[j, k, i] = 0.0
                    if bz[j, k, i] < 1.0 and wet[j, k - 1, i] == 0:
                        w[j, k, i] = 0.0


def close_sides(carrying: tuple[Array, Array, Array], area_fractions: AreaFractions) -> None:
    """Leave of the current that the far sides carry on full faces what passes above the bed."""
    for axis, q, b in ((2, carrying[0], area_fractions.bx), (0, carrying[1], area_fractions.by)):
        for side in (HALO, q.shape[axis] - HALO):
            at = (slice(None),) * axis + (side,)
            q[at] *= b[at]


@njit(cache=True, error_model="numpy", parallel=True)
def shear(
    out: tuple[Array, Array, Array], velocity: tuple[Array, Array, Array], cells: WaterCells,
    area_fractions: AreaFractions, bed: RoughBed, viscosity: float, dt: float, metrics: Metrics,
) -> None:  # fmt: skip
    """Slow the lowest layer down by the log-law shear of a given bed; see `exumob.flow.turbulence.wall.bed_shear`.

    The speed is the horizontal one of the lowest layer whose centre lies at least a quarter of a cell above the bed;
    the shear acts on that layer and on what is open below it. Meant for slopes up to about 1 in 3.

    Parameters
    ----------
    out : three arrays, changed
        Velocity [m/s].
    velocity : three arrays
        Velocity from which the shear is taken, absolute [m/s].
    cells : WaterCells
    area_fractions : AreaFractions
    bed : RoughBed
    viscosity, dt
        As for `bed_shear` [m^2/s, s].
    metrics : Metrics
    """
    u, v, fraction = velocity[0], velocity[1], cells.fraction
    heights, top, roughness = bed
    ny, nz, nx = u.shape
    bx, by = area_fractions.bx, area_fractions.by
    out_x, out_y = out[0], out[1]
    for j in prange(HALO, ny - HALO + 1):
        for i in range(HALO, nx - HALO + 1):
            for axis in range(2):
                bed = 0.5 * (heights[j, i] + (heights[j, i - 1] if axis == 0 else heights[j - 1, i]))
                b = bx if axis == 0 else by
                k = HALO
                while k < min(top, nz - HALO - 1) and metrics.zc[k] - bed < 0.25 * metrics.dz[k]:
                    k += 1
                c = 0.5 * (fraction[j, k, i] + (fraction[j, k, i - 1] if axis == 0 else fraction[j - 1, k, i]))
                if b[j, k, i] == 0.0 or c < 0.25:
                    continue
                if axis == 0:
                    here = u[j, k, i]
                    across = 0.25 * ((v[j, k, i] + v[j + 1, k, i - 1]) + (v[j + 1, k, i] + v[j, k, i - 1]))
                else:
                    here = v[j, k, i]
                    across = 0.25 * ((u[j, k, i] + u[j - 1, k, i + 1]) + (u[j, k, i + 1] + u[j - 1, k, i]))
                speed = math.sqrt(here * here + across * across)
                if speed <= 1e-9:
                    continue
                depth = metrics.zf[k] - bed + metrics.dz[k] * min(max(c, 0.5), 1.0)
                rate = friction_velocity(speed, metrics.zc[k] - bed, viscosity, roughness) ** 2 / (speed * depth)
                for layer in range(HALO, k + 1):
                    if b[j, layer, i] > 0.0:
                        if axis == 0:
                            out_x[j, layer, i] /= 1.0 + dt * rate
                        else:
                            out_y[j, layer, i] /= 1.0 + dt * rate
