"""Transport of momentum over the moving grid.

The velocity is absolute, in the grid's axes; what carries it is the velocity relative to the grid, on full faces,
solids included. In this form -(1/V) sum of flux (u_face - u) a uniform current stays uniform to round-off whatever the
grid does.
"""

from __future__ import annotations

import math

import numpy as np
from numba import prange

from exumob.flow.active_rows import ActiveRows, WaterCells
from exumob.flow.area_fractions import AreaFractions
from exumob.flow.grid import HALO, GridVelocity, Metrics
from exumob.support.arrays import Array
from exumob.support.kernels import njit

RESOLVED = 0.01
"""Fraction below which spray does not limit the time step [-]; its transport stays bounded by what the cell holds."""


@njit(cache=True, error_model="numpy")
def _edges(
    q: Array, flow: Array, strides: tuple[int, int], first: int, n: int, ratio: Array, carry: Array, value: Array
) -> None:
    """Carrying velocity and upwind value between p - s and p, for n neighbours along x from p = first.

    MUSCL-Hancock with the monotonized-central slope (van Leer 1977); `ratio` is the time step over the width [s/m];
    `strides`: to the next face along the component's own axis, and s.
    Flat unsigned indices and selections instead of branches: the loop then uses vector instructions.
    """
    o, t = np.uintp(strides[0]), np.uintp(strides[1])
    for m in range(n):
        p = np.uintp(first + m)
        c = 0.5 * (flow[p - o] + flow[p])
        up = c > 0.0
        low, high = q[p - t], q[p]
        middle = high - low
        outer = low - q[p - t - t] if up else q[p + t] - high
        two, mean = 2.0 * abs(middle), 0.5 * abs(middle + outer)
        size = 2.0 * abs(outer)
        size = two if two < size else size
        size = mean if mean < size else size
        size = size if middle * outer > 0.0 else 0.0
        slope = size if (middle > 0.0) == up else -size  # towards the face, from the upwind side
        carry[m] = c
        value[m] = (low if up else high) + 0.5 * (1.0 - abs(c) * ratio[m]) * slope


@njit(cache=True, error_model="numpy", parallel=True)
def turn(velocity: tuple[Array, Array, Array], out: tuple[Array, Array, Array], angle: float, rows: ActiveRows) -> None:
    """Velocity in axes that have turned by `angle` [rad] about z since."""
    ny, nz, nx = velocity[0].shape
    one, sy = np.uintp(1), np.uintp(nz * nx)
    uf, vf, wf = velocity[0].ravel(), velocity[1].ravel(), velocity[2].ravel()
    new_u, new_v, new_w = out[0].ravel(), out[1].ravel(), out[2].ravel()
    cosine, sine = math.cos(angle), math.sin(angle)
    lo, hi = rows
    for j in prange(1, ny - 1):
        for k in range(1, nz - 1):
            start = (j * nz + k) * nx
            for i in range(start + lo[j, k], start + hi[j, k]):
                p = np.uintp(i)
                new_u[p] = cosine * uf[p] + sine * (0.25 * ((vf[p] + vf[p - one + sy]) + (vf[p + sy] + vf[p - one])))
                new_v[p] = cosine * vf[p] - sine * (0.25 * ((uf[p] + uf[p + one - sy]) + (uf[p + one] + uf[p - sy])))
                new_w[p] = wf[p]


@njit(cache=True, error_model="numpy", parallel=True)
def advect(
    out: Array, velocity: tuple[Array, Array, Array], relative: tuple[Array, Array, Array], cells: WaterCells,
    area_fractions: AreaFractions, axis: int, dt: float, metrics: Metrics,
) -> None:  # fmt: skip
    """Add to one velocity component its advection over one step; faces that are dry or closed are left alone.

    Parameters
    ----------
    out : array, changed
        The component at the end [m/s].
    velocity : three arrays
        At the begin [m/s].
    relative : three arrays
        Velocity relative to the grid on full faces [m/s].
    cells : WaterCells
    area_fractions : AreaFractions
    axis : int
        Axis of the component: 0 x, 1 y, 2 z.
    dt : float
        [s]
    metrics : Metrics
    """
    ny, nz, nx = out.shape
    own = 1 if axis == 0 else (nz * nx if axis == 1 else nx)
    flat, result, is_wet = velocity[axis].ravel(), out.ravel(), cells.wet.ravel()
    o = area_fractions
    beta = (o.bx if axis == 0 else (o.by if axis == 1 else o.bz)).ravel()
    fx, fy, fz = relative[0].ravel(), relative[1].ravel(), relative[2].ravel()
    rx = dt / (metrics.ex if axis == 0 else metrics.dx)
    ry = dt / (metrics.ey if axis == 1 else metrics.dy)
    rz = dt / (metrics.ez if axis == 2 else metrics.dz)
    lo, hi = cells.active
    back = np.uintp(own)
    for j in prange(HALO, ny - HALO):
        carry, value, even = np.empty((5, nx)), np.empty((5, nx)), np.empty(nx)
        xc, xq, ya, yb, za, zb = carry[0], value[0], carry[1], carry[2], carry[3], carry[4]
        qa, qb, sa, sb = value[1], value[2], value[3], value[4]
        for k in range(HALO, nz - HALO):
            start = max(lo[j, k], HALO)
            n = min(hi[j, k], nx - HALO) - start
            if n <= 0:
                continue
            first = (j * nz + k) * nx + start
            _edges(flat, fx, (own, 1), first, n + 1, rx[start:], xc, xq)
            even[:n] = ry[j]
            _edges(flat, fy, (own, nz * nx), first, n, even, ya, qa)
            _edges(flat, fy, (own, nz * nx), first + nz * nx, n, even, yb, qb)
            even[:n] = rz[k]
            _edges(flat, fz, (own, nx), first, n, even, za, sa)
            _edges(flat, fz, (own, nx), first + nx, n, even, zb, sb)
            for m in range(n):
                p = np.uintp(first + m)
                here = flat[p]
                change = (xc[m + 1] * (xq[m + 1] - here) - xc[m] * (xq[m] - here)) * rx[start + m]
                change += (yb[m] * (qb[m] - here) - ya[m] * (qa[m] - here)) * ry[j]
                change += (zb[m] * (sb[m] - here) - za[m] * (sa[m] - here)) * rz[k]
                active = (is_wet[p] | is_wet[p - back]) != 0 and beta[p] > 0.0
                result[p] -= change if active else 0.0


@njit(cache=True, error_model="numpy", parallel=True)
def full_velocity(
    carrying: tuple[Array, Array, Array], velocity: tuple[Array, Array, Array], area_fractions: AreaFractions,
    rows: ActiveRows,
) -> None:  # fmt: skip
    """Velocity on full faces: water where they are open, the solid where they are closed [m/s]."""
    ny, nz, nx = velocity[0].shape
    cx, cy, cz = carrying[0].ravel(), carrying[1].ravel(), carrying[2].ravel()
    u, v, w = velocity[0].ravel(), velocity[1].ravel(), velocity[2].ravel()
    o = area_fractions
    bx, by, bz = o.bx.ravel(), o.by.ravel(), o.bz.ravel()
    sx, sy, sz = o.sx.ravel(), o.sy.ravel(), o.sz.ravel()
    lo, hi = rows
    for j in prange(1, ny - 1):
        for k in range(1, nz - 1):
            start = (j * nz + k) * nx
            for i in range(start + lo[j, k], start + hi[j, k]):
                p = np.uintp(i)
                cx[p] = bx[p] * u[p] + (1.0 - bx[p]) * sx[p]
                cy[p] = by[p] * v[p] + (1.0 - by[p]) * sy[p]
                cz[p] = bz[p] * w[p] + (1.0 - bz[p]) * sz[p]


@njit(cache=True, error_model="numpy", parallel=True)
def relative_velocity(
    relative: tuple[Array, Array, Array], carrying: tuple[Array, Array, Array], grid_velocity: GridVelocity,
    rows: ActiveRows, metrics: Metrics,
) -> None:  # fmt: skip
    """Velocity on full faces [m/s] relative to a grid that translates and yaws."""
    ny, nz, nx = carrying[0].shape
    rx, ry, rz = relative[0].ravel(), relative[1].ravel(), relative[2].ravel()
    cx, cy, cz = carrying[0].ravel(), carrying[1].ravel(), carrying[2].ravel()
    lo, hi = rows
    xc = metrics.xc
    for j in prange(1, ny - 1):
        along = grid_velocity.x - grid_velocity.yaw_rate * metrics.yc[j]
        for k in range(1, nz - 1):
            start = (j * nz + k) * nx
            for i in range(lo[j, k], hi[j, k]):
                p = np.uintp(start + i)
                rx[p] = cx[p] - along
                ry[p] = cy[p] - (grid_velocity.y + grid_velocity.yaw_rate * xc[np.uintp(i)])
                rz[p] = cz[p]


@njit(cache=True, error_model="numpy", parallel=True)
def largest_courant(
    relative: tuple[Array, Array, Array], fraction: Array, metrics: Metrics, rows: ActiveRows, rates: Array
) -> None:
    """Per row j the largest sum of speed over width in a cell with water [1/s]; infinite if it is not a number."""
    ny, nz, nx = fraction.shape
    one, sy, sz = np.uintp(1), np.uintp(nz * nx), np.uintp(nx)
    rx, ry, rz, c = relative[0].ravel(), relative[1].ravel(), relative[2].ravel(), fraction.ravel()
    widths = 1.0 / metrics.dx
    lo, hi = rows
    for j in prange(HALO, ny - HALO):
        largest, total = 0.0, 0.0
        for k in range(HALO, nz - HALO):
            start = (j * nz + k) * nx
            for i in range(max(lo[j, k], HALO), min(hi[j, k], nx - HALO)):
                p = np.uintp(start + i)
                x0, x1 = abs(rx[p]), abs(rx[p + one])
                y0, y1 = abs(ry[p]), abs(ry[p + sy])
                z0, z1 = abs(rz[p]), abs(rz[p + sz])
                rate = (x0 if x0 > x1 else x1) * widths[np.uintp(i)]
                rate += (y0 if y0 > y1 else y1) / metrics.dy[j] + (z0 if z0 > z1 else z1) / metrics.dz[k]
                rate = rate if c[p] >= RESOLVED else 0.0
                largest = rate if rate > largest else largest
                total += rate
        rates[j] = largest if total < np.inf else np.inf
