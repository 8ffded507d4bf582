"""Transport of momentum over the moving grid.

The velocity is absolute, in the grid's axes; what carries it is the velocity relative to the grid, on full faces,
solids
included. In this form -(1/V) sum of flux (u_face - u) a uniform current stays uniform to round-off whatever the
grid does.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from exumob.flow.body import Openness
from exumob.flow.grid import HALO, Metrics
from exumob.states import Array

RESOLVED = 0.01
"""Fraction below which spray does not limit the time step [-]; its transport stays bounded by what the cell holds."""


@njit(cache=True, error_model="numpy", inline="always")
def limited(a: float, b: float) -> float:
    """Monotonized-central slope of two neighbouring differences (van Leer 1977)."""
    if a * b <= 0.0:
        return 0.0
    size = min(2.0 * min(abs(a), abs(b)), 0.5 * abs(a + b))
    return math.copysign(size, a)


@njit(cache=True, error_model="numpy", inline="always")
def face_value(q: Array, p: int, s: int, carry: float, courant: float) -> float:
    """Upwind value between cells p - s and p at half the time step (MUSCL-Hancock)."""
    if carry > 0.0:
        slope = limited(q[p - s] - q[p - s - s], q[p] - q[p - s])
        return q[p - s] + 0.5 * (1.0 - courant) * slope
    slope = limited(q[p] - q[p - s], q[p + s] - q[p])
    return q[p] - 0.5 * (1.0 - courant) * slope


@njit(cache=True, error_model="numpy", parallel=True)
def advect(
    out: Array, u: Array, v: Array, w: Array, flow: tuple[Array, Array, Array], wet: NDArray[np.uint8],
    open_faces: Array, axis: int, turned: float, dt: float, top: int, metrics: Metrics,
) -> None:  # fmt: skip
    """One velocity component after advection, in axes that have turned by `turned` [rad] meanwhile.

    Parameters
    ----------
    out : array, changed
        The component at the end [m/s].
    u, v, w : array
        Velocity at the begin [m/s].
    flow : three arrays
        Velocity relative to the grid on full faces [m/s].
    wet, open_faces : array
        Wet cells; openness of this component's faces. Faces that are dry or closed are turned only.
    axis : int
        0 x, 1 y, 2 z.
    """
    ny, nz, nx = u.shape
    one, sy, sz = np.uintp(1), np.uintp(nz * nx), np.uintp(nx)  # unsigned: no test for negative indices
    fx, fy, fz = flow[0].ravel(), flow[1].ravel(), flow[2].ravel()
    field = u if axis == 0 else (v if axis == 1 else w)
    q, uf, vf = field.ravel(), u.ravel(), v.ravel()
    carrier = fx if axis == 0 else (fy if axis == 1 else fz)
    own = one if axis == 0 else (sy if axis == 1 else sz)
    result, is_wet, beta = out.ravel(), wet.ravel(), open_faces.ravel()
    cosine, sine = math.cos(turned), math.sin(turned)
    last = min(top + 5, nz - HALO) + 1
    for j in prange(HALO, ny - HALO + 1):
        for k in range(HALO, last):
            for i in range(HALO, nx - HALO + 1):
                p = np.uintp((j * nz + k) * nx + i)
                here = q[p]
                value = here
                if turned != 0.0:
                    if axis == 0:
                        across = 0.25 * ((vf[p] + vf[p - one + sy]) + (vf[p + sy] + vf[p - one]))
                        value = cosine * here + sine * across
                    elif axis == 1:
                        across = 0.25 * ((uf[p] + uf[p + one - sy]) + (uf[p + one] + uf[p - sy]))
                        value = cosine * here - sine * across
                if (is_wet[p] or is_wet[p - own]) and beta[p] > 0.0:
                    # along the component itself: between cell centres
                    width = metrics.ex[i] if axis == 0 else (metrics.ey[j] if axis == 1 else metrics.ez[k])
                    low, high = 0.5 * (carrier[p - own] + carrier[p]), 0.5 * (carrier[p] + carrier[p + own])
                    change = high * (face_value(q, p + own, own, high, abs(high) * dt / width) - here)
                    change -= low * (face_value(q, p, own, low, abs(low) * dt / width) - here)
                    rate = change / width
                    if axis != 0:
                        low, high = 0.5 * (fx[p - own] + fx[p]), 0.5 * (fx[p - own + one] + fx[p + one])
                        width = metrics.dx[i]
                        change = high * (face_value(q, p + one, one, high, abs(high) * dt / width) - here)
                        change -= low * (face_value(q, p, one, low, abs(low) * dt / width) - here)
                        rate += change / width
                    if axis != 1:
                        low, high = 0.5 * (fy[p - own] + fy[p]), 0.5 * (fy[p - own + sy] + fy[p + sy])
                        width = metrics.dy[j]
                        change = high * (face_value(q, p + sy, sy, high, abs(high) * dt / width) - here)
                        change -= low * (face_value(q, p, sy, low, abs(low) * dt / width) - here)
                        rate += change / width
                    if axis != 2:
                        low, high = 0.5 * (fz[p - own] + fz[p]), 0.5 * (fz[p - own + sz] + fz[p + sz])
                        width = metrics.dz[k]
                        change = high * (face_value(q, p + sz, sz, high, abs(high) * dt / width) - here)
                        change -= low * (face_value(q, p, sz, low, abs(low) * dt / width) - here)
                        rate += change / width
                    value -= dt * rate
                result[p] = value


@njit(cache=True, error_model="numpy", parallel=True)
def full_velocity(cx: Array, cy: Array, cz: Array, u: Array, v: Array, w: Array, solids: Openness, top: int) -> None:
    """Velocity on full faces: water where they are open, the solid where they are closed [m/s]."""
    ny, nz, nx = u.shape
    for j in prange(1, ny - 1):
        for k in range(1, min(top + 6, nz - 1)):
            for i in range(1, nx - 1):
                b = solids.bx[j, k, i]
                cx[j, k, i] = b * u[j, k, i] + (1.0 - b) * solids.sx[j, k, i]
                b = solids.by[j, k, i]
                cy[j, k, i] = b * v[j, k, i] + (1.0 - b) * solids.sy[j, k, i]
                b = solids.bz[j, k, i]
                cz[j, k, i] = b * w[j, k, i] + (1.0 - b) * solids.sz[j, k, i]


@njit(cache=True, error_model="numpy", parallel=True)
def relative_velocity(
    rx: Array, ry: Array, rz: Array, cx: Array, cy: Array, cz: Array, frame: Array, top: int, metrics: Metrics
) -> None:
    """Velocity relative to the grid, whose origin moves at frame[0:2] [m/s] and which yaws at frame[2] [rad/s]."""
    ny, nz, nx = rx.shape
    for j in prange(1, ny - 1):
        for k in range(1, min(top + 6, nz - 1)):
            for i in range(1, nx - 1):
                rx[j, k, i] = cx[j, k, i] - (frame[0] - frame[2] * metrics.yc[j])
                ry[j, k, i] = cy[j, k, i] - (frame[1] + frame[2] * metrics.xc[i])
                rz[j, k, i] = cz[j, k, i]


@njit(cache=True, error_model="numpy", parallel=True)
def largest_courant(rx: Array, ry: Array, rz: Array, fraction: Array, metrics: Metrics, top: int, rates: Array) -> None:
    """Per row j the largest sum of speed over width in a cell with water [1/s]; infinite if it is not a number."""
    ny, nz, nx = rx.shape
    for j in prange(HALO, ny - HALO):
        largest = 0.0
        for k in range(HALO, min(top + 2, nz - HALO)):
            for i in range(HALO, nx - HALO):
                if fraction[j, k, i] < RESOLVED:
                    continue
                rate = max(abs(rx[j, k, i]), abs(rx[j, k, i + 1])) / metrics.dx[i]
                rate += max(abs(ry[j, k, i]), abs(ry[j + 1, k, i])) / metrics.dy[j]
                rate += max(abs(rz[j, k, i]), abs(rz[j, k + 1, i])) / metrics.dz[k]
                if rate > largest:
                    largest = rate
                elif not rate <= largest:
                    largest = np.inf
        rates[j] = largest
