"""What surrounds the window: far field, tank walls, bed and air."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit, prange

from exumob.flow.grid import HALO, Metrics
from exumob.flow.spans import Spans
from exumob.states import Array

ALONG_THE_SIDE = 0.25
"""Share of the rate that acts on the velocity along a side [-]. Damping it as fast as the rest sends oblique waves
back (a perfectly matched layer leaves it alone); without any, currents along the side would stay."""


class Rates(NamedTuple):
    """How fast the far field draws the water towards still water or the current [1/s], halo included.

    Velocity components are taken on their faces: a rate half a cell off reflects waves and tells low sides from high.
    """

    x: Array
    """At the cells' centres along x"""
    y: Array
    x_faces: Array
    """At their low faces"""
    y_faces: Array


def level_fractions(metrics: Metrics, level: float) -> Array:
    """Fraction of each layer below a level [m], shape (nz,)."""
    return np.clip((level - metrics.zf[:-1]) / metrics.dz, 0.0, 1.0)


@njit(cache=True, error_model="numpy")
def fill_fraction(fraction: Array, still: Array, far_x: bool, far_y: bool) -> None:
    """Set the halo of the fraction: still water at far sides, a mirror at walls, bed and top.

    Parameters
    ----------
    fraction : array, changed
        [-]
    still : array, shape (nz,)
        Fraction of each layer in still water.
    far_x, far_y : bool
        Whether the sides across x and across y are far field; walls otherwise.
    """
    ny, nz, nx = fraction.shape
    for n in range(HALO):
        low, low_in, high_n, high_in = HALO - 1 - n, HALO + n, n, -1 - n
        for j in range(ny):
            for k in range(nz):
                a, b = nx - HALO + high_n, nx - HALO + high_in
                fraction[j, k, low] = still[k] if far_x else fraction[j, k, low_in]
                fraction[j, k, a] = still[k] if far_x else fraction[j, k, b]
        for k in range(nz):
            a, b = ny - HALO + high_n, ny - HALO + high_in
            for i in range(nx):
                fraction[low, k, i] = still[k] if far_y else fraction[low_in, k, i]
                fraction[a, k, i] = still[k] if far_y else fraction[b, k, i]
        for j in range(ny):
            a, b = nz - HALO + high_n, nz - HALO + high_in
            for i in range(nx):
                fraction[j, low, i] = fraction[j, low_in, i]
                fraction[j, a, i] = fraction[j, b, i]


@njit(cache=True, error_model="numpy")
def fill_velocity(u: Array, v: Array, w: Array, far: Array, far_x: bool, far_y: bool, closed_top: bool) -> None:
    """Set the velocity on the window's sides and in the halo.

    Far sides carry the undisturbed flow `far` (grid axes [m/s], shape (3,)); walls, the bed and a closed top let
    nothing through and slip freely; an open top repeats the layer below.
    """
    ny, nz, nx = u.shape
    for j in range(ny):
        for k in range(nz):
            if far_x:
                for n in range(HALO):
                    u[j, k, n], v[j, k, n], w[j, k, n] = far[0], far[1], far[2]
                    m = nx - HALO + n
                    u[j, k, m], v[j, k, m], w[j, k, m] = far[0], far[1], far[2]
                u[j, k, HALO] = far[0]
            else:
                u[j, k, HALO], u[j, k, nx - HALO] = 0.0, 0.0
                u[j, k, 1], u[j, k, 0] = -u[j, k, HALO + 1], -u[j, k, HALO + 2]
                u[j, k, nx - 1] = -u[j, k, nx - HALO - 1]
                for n in range(HALO):
                    a, b = HALO - 1 - n, HALO + n
                    v[j, k, a], w[j, k, a] = v[j, k, b], w[j, k, b]
                    a, b = nx - HALO + n, nx - HALO - 1 - n
                    v[j, k, a], w[j, k, a] = v[j, k, b], w[j, k, b]
    for k in range(nz):
        for i in range(nx):
            if far_y:
                for n in range(HALO):
                    u[n, k, i], v[n, k, i], w[n, k, i] = far[0], far[1], far[2]
                    m = ny - HALO + n
                    u[m, k, i], v[m, k, i], w[m, k, i] = far[0], far[1], far[2]
                v[HALO, k, i] = far[1]
            else:
                v[HALO, k, i], v[ny - HALO, k, i] = 0.0, 0.0
                v[1, k, i], v[0, k, i] = -v[HALO + 1, k, i], -v[HALO + 2, k, i]
                v[ny - 1, k, i] = -v[ny - HALO - 1, k, i]
                for n in range(HALO):
                    a, b = HALO - 1 - n, HALO + n
                    u[a, k, i], w[a, k, i] = u[b, k, i], w[b, k, i]
                    a, b = ny - HALO + n, ny - HALO - 1 - n
                    u[a, k, i], w[a, k, i] = u[b, k, i], w[b, k, i]
    sign = -1.0 if closed_top else 1.0
    for j in range(ny):
        for i in range(nx):
            w[j, HALO, i] = 0.0
            w[j, 1, i], w[j, 0, i] = -w[j, HALO + 1, i], -w[j, HALO + 2, i]
            if closed_top:
                w[j, nz - HALO, i] = 0.0
            w[j, nz - 1, i] = sign * w[j, nz - HALO - 1, i]
            for n in range(HALO):
                a, b = HALO - 1 - n, HALO + n
                u[j, a, i], v[j, a, i] = u[j, b, i], v[j, b, i]
                a, b = nz - HALO + n, nz - HALO - 1 - n
                u[j, a, i], v[j, a, i] = u[j, b, i], v[j, b, i]


@njit(cache=True, error_model="numpy", parallel=True)
def relax_velocity(u: Array, v: Array, w: Array, far: Array, rates: Rates, dt: float, spans: Spans) -> None:
    """Draw the velocity towards the undisturbed flow, implicitly, at the larger of the two sides' rates."""
    ny, nz, nx = u.shape
    lo, hi = spans
    x, y, x_faces, y_faces = rates
    for j in prange(HALO, ny - HALO + 1):
        for k in range(HALO, nz - HALO):
            for i in range(max(lo[j, k], HALO), min(hi[j, k], nx - HALO + 1)):
                if max(x[i], y[j], x_faces[i], y_faces[j]) > 0.0:
                    across_x = max(x_faces[i], ALONG_THE_SIDE * y[j])
                    across_y = max(ALONG_THE_SIDE * x[i], y_faces[j])
                    u[j, k, i] = far[0] + (u[j, k, i] - far[0]) / (1.0 + dt * across_x)
                    v[j, k, i] = far[1] + (v[j, k, i] - far[1]) / (1.0 + dt * across_y)
                    if k > HALO:
                        w[j, k, i] = w[j, k, i] / (1.0 + dt * max(x[i], y[j]))


@njit(cache=True, error_model="numpy", parallel=True)
def relax_level(
    fraction: Array, level: float, bed: Array, rates: Rates, dt: float, metrics: Metrics, added: Array
) -> None:
    """Draw the level of whole columns towards still water: fill the lowest gap or drain the top, cell after cell.

    A column begins with the cell that holds the bed; where this lies above still water, the column is drained.

    Parameters
    ----------
    fraction : array, changed
        [-]
    level : float
        Of still water [m].
    bed : array, shape (ny, nx)
        Height of the bed [m].
    rates : Rates
        The larger of the two sides' counts.
    added : array, shape (ny,), changed
        Volume added per row j [m^3].
    """
    ny, nz, nx = fraction.shape
    for j in prange(HALO, ny - HALO):
        volume = 0.0
        for i in range(HALO, nx - HALO):
            rate = max(rates.x[i], rates.y[j])
            if rate <= 0.0:
                continue
            lowest = HALO
            while lowest < nz - HALO - 1 and metrics.zf[lowest + 1] <= bed[j, i]:
                lowest += 1
            height = metrics.zf[lowest]
            for k in range(lowest, nz - HALO):
                height += fraction[j, k, i] * metrics.dz[k]
            change = (max(level, metrics.zf[lowest]) - height) * (1.0 - 1.0 / (1.0 + rate * dt))
            volume += change * metrics.dx[i] * metrics.dy[j]
            if change > 0.0:
                for k in range(lowest, nz - HALO):
                    taken = min(change, max(1.0 - fraction[j, k, i], 0.0) * metrics.dz[k])
                    fraction[j, k, i] += taken / metrics.dz[k]
                    change -= taken
                    if change <= 0.0:
                        break
            else:
                for k in range(nz - HALO - 1, lowest - 1, -1):
                    taken = min(-change, fraction[j, k, i] * metrics.dz[k])
                    fraction[j, k, i] -= taken / metrics.dz[k]
                    change += taken
                    if change >= 0.0:
                        break
        added[j] = volume
