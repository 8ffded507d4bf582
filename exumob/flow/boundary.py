"""What surrounds the wet, open part of the window: far field, tank walls, bed, air and the inside of solids."""

from __future__ import annotations

import math

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from exumob.environment import GRAVITY
from exumob.flow.body import Openness
from exumob.flow.grid import HALO, Metrics
from exumob.states import Array

TRUSTED = 0.5
"""Faces at least this open keep their own velocity and give it to their neighbours [-]."""
BLENDED = 0.7
"""Faces less open than this are drawn towards the slip velocity [-]."""
BLEND_RATE = 50.0
"""... at BLEND_RATE [(BLENDED - openness) / openness]^2 [1/s]."""
LAYERS = 3
"""Faces beyond the water to which the velocity is extended."""
FASTEST_FALL = 3.0
"""Of water too thin to be resolved [m/s]."""


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
def relax_velocity(u: Array, v: Array, w: Array, far: Array, rate_x: Array, rate_y: Array, dt: float, top: int) -> None:
    """Draw the velocity towards the undisturbed flow, implicitly, at the larger of two rates [1/s] per column."""
    ny, nz, nx = u.shape
    for j in prange(HALO, ny - HALO + 1):
        for k in range(HALO, min(top + 2, nz - HALO)):
            for i in range(HALO, nx - HALO + 1):
                rate = max(rate_x[i], rate_y[j])
                if rate > 0.0:
                    share = 1.0 / (1.0 + rate * dt)
                    u[j, k, i] = far[0] + share * (u[j, k, i] - far[0])
                    v[j, k, i] = far[1] + share * (v[j, k, i] - far[1])
                    if k > HALO:
                        w[j, k, i] = share * w[j, k, i]


@njit(cache=True, error_model="numpy", parallel=True)
def relax_level(
    fraction: Array, level: float, rate_x: Array, rate_y: Array, dt: float, metrics: Metrics, added: Array
) -> None:
    """Draw the level of whole columns towards still water: fill the lowest gap or drain the top, cell after cell.

    Parameters
    ----------
    fraction : array, changed
        [-]
    level : float
        Of still water [m].
    rate_x, rate_y : array
        Rates of the columns, the larger counts [1/s].
    added : array, shape (ny,), changed
        Volume added per row j [m^3].
    """
    ny, nz, nx = fraction.shape
    for j in prange(HALO, ny - HALO):
        volume = 0.0
        for i in range(HALO, nx - HALO):
            rate = max(rate_x[i], rate_y[j])
            if rate <= 0.0:
                continue
            height = 0.0
            for k in range(HALO, nz - HALO):
                height += fraction[j, k, i] * metrics.dz[k]
            change = (level - height) * (1.0 - 1.0 / (1.0 + rate * dt))
            volume += change * metrics.dx[i] * metrics.dy[j]
            if change > 0.0:
                for k in range(HALO, nz - HALO):
                    taken = min(change, max(1.0 - fraction[j, k, i], 0.0) * metrics.dz[k])
                    fraction[j, k, i] += taken / metrics.dz[k]
                    change -= taken
                    if change <= 0.0:
                        break
            else:
                for k in range(nz - HALO - 1, HALO - 1, -1):
                    taken = min(-change, fraction[j, k, i] * metrics.dz[k])
                    fraction[j, k, i] -= taken / metrics.dz[k]
                    change += taken
                    if change >= 0.0:
                        break
        added[j] = volume


@njit(cache=True, error_model="numpy")
def extend(
    e: Array, wet: NDArray[np.uint8], open_faces: Array, fraction: Array, axis: int, top: int, far: float, dt: float,
    label: NDArray[np.uint8], first: NDArray[np.int64], second: NDArray[np.int64],
) -> None:  # fmt: skip
    """Extend one velocity component `LAYERS` faces into air and solids by averages of known neighbours.

    Faces not reached keep falling if there is water in them and take the undisturbed flow otherwise.

    Parameters
    ----------
    e : array, changed
        The component [m/s].
    open_faces : array
        Its openness [-].
    label : array, changed
        0 unknown, 1 known, 2 and more extended, 255 outside.
    first, second : arrays
        Work space for flat indices.
    """
    ny, nz, nx = e.shape
    sy, sz = nz * nx, nx
    own = 1 if axis == 0 else (sy if axis == 1 else sz)
    q, c, is_wet, beta, mark = e.ravel(), fraction.ravel(), wet.ravel(), open_faces.ravel(), label.ravel()
    last = min(top + 1 + LAYERS, nz - HALO - 1) + 1
    label[:, : last + 1] = 255
    j_low, k_low, i_low = HALO + (axis == 1), HALO + (axis == 2), HALO + (axis == 0)
    for j in range(HALO, ny - HALO + (axis == 1)):
        for k in range(HALO, last):
            for i in range(HALO, nx - HALO + (axis == 0)):
                p = j * sy + k * sz + i
                known = (is_wet[p] or is_wet[p - own]) and beta[p] >= TRUSTED
                if known:
                    mark[p] = 1
                elif j >= j_low and k >= k_low and i >= i_low and j < ny - HALO and i < nx - HALO:
                    mark[p] = 0
    count = 0
    for j in range(j_low, ny - HALO):
        for k in range(k_low, last):
            for i in range(i_low, nx - HALO):
                p = j * sy + k * sz + i
                if mark[p] == 0 and (
                    mark[p - 1] == 1 or mark[p + 1] == 1 or mark[p - sy] == 1 or mark[p + sy] == 1
                    or mark[p - sz] == 1 or mark[p + sz] == 1
                ):  # fmt: skip
                    first[count] = p
                    count += 1
    for layer in range(2, 2 + LAYERS):
        for n in range(count):
            p = first[n]
            total, weight = 0.0, 0.0
            for s in (sz, sy, 1):
                a, b = mark[p - s] < layer and mark[p - s] > 0, mark[p + s] < layer and mark[p + s] > 0
                total += (q[p - s] if a else 0.0) + (q[p + s] if b else 0.0)
                weight += (1.0 if a else 0.0) + (1.0 if b else 0.0)
            q[p] = total / weight
            mark[p] = layer
        following = 0
        for n in range(count):
            p = first[n]
            for s in (1, sy, sz):
                for r in (p - s, p + s):
                    if mark[r] == 0:
                        mark[r] = 254
                        second[following] = r
                        following += 1
        for n in range(following):
            mark[second[n]] = 0
        first, second = second, first
        count = following
    for j in range(j_low, ny - HALO):
        for k in range(k_low, last):
            for i in range(i_low, nx - HALO):
                p = j * sy + k * sz + i
                if mark[p] == 0:
                    if c[p] <= 0.0 and c[p - own] <= 0.0:
                        q[p] = far
                    elif axis == 2:
                        q[p] = max(q[p] - GRAVITY * dt, -FASTEST_FALL)


@njit(cache=True, error_model="numpy", parallel=True)
def take_extended(
    u: Array, e: Array, wet: NDArray[np.uint8], open_faces: Array, axis: int, top: int, label: NDArray[np.uint8]
) -> None:
    """Replace a component by its extension wherever the projection did not set it."""
    ny, nz, nx = u.shape
    own = 1 if axis == 0 else (nz * nx if axis == 1 else nx)
    q, ext, is_wet, beta, mark = u.ravel(), e.ravel(), wet.ravel(), open_faces.ravel(), label.ravel()
    for j in prange(HALO, ny - HALO + 1):
        for k in range(HALO, min(top + 1 + LAYERS, nz - HALO - 1) + 1):
            for i in range(HALO, nx - HALO + 1):
                p = (j * nz + k) * nx + i
                if mark[p] != 255 and not ((is_wet[p] or is_wet[p - own]) and beta[p] > 0.0):
                    q[p] = ext[p]


@njit(cache=True, error_model="numpy")
def slip(
    out: tuple[Array, Array, Array], ext: tuple[Array, Array, Array], wet: NDArray[np.uint8], solids: Openness,
    regions: NDArray[np.int64], position: Array, velocity: Array, angular_velocity: Array, density: float, dt: float,
    metrics: Metrics, exchange: Array,
) -> None:  # fmt: skip
    """Draw small open faces towards the extended velocity without its part through the wall; set closed ones to it.

    u = (u + rate dt u_slip) / (1 + rate dt) with rate = 50 [(0.7 - beta) / beta]^2 1/s: a face that is hardly open has
    hardly any water of its own. What momentum this takes is given to the solid.

    Parameters
    ----------
    out : three arrays, changed
        Velocity [m/s].
    ext : three arrays
        Extended velocity [m/s].
    regions : array of int, shape (n, 6)
        Index boxes of the solids.
    position, velocity, angular_velocity : array, shape (n, 3)
        Of the solids, grid axes.
    exchange : array, shape (n, 6), changed
        Force [N] and moment [N m] about the solids' origins, grid axes.
    """
    ny, nz, nx = wet.shape
    d = solids.distance
    for n in range(len(regions)):
        for j in range(max(regions[n, 0], HALO), min(regions[n, 1], ny - HALO)):
            for k in range(max(regions[n, 2], HALO), min(regions[n, 3], nz - HALO)):
                for i in range(max(regions[n, 4], HALO), min(regions[n, 5], nx - HALO)):
                    for axis in range(3):
                        beta = (
                            solids.bx[j, k, i]
                            if axis == 0
                            else (solids.by[j, k, i] if axis == 1 else solids.bz[j, k, i])
                        )
                        if beta >= BLENDED or (axis == 2 and k == HALO):
                            continue
                        jb, kb, ib = j - (axis == 1), k - (axis == 2), i - (axis == 0)
                        owner = solids.nearest[j, k, i] if d[j, k, i] <= d[jb, kb, ib] else solids.nearest[jb, kb, ib]
                        if owner != n:
                            continue
                        gx = _slope(d, j, k, i, jb, kb, ib, 0, metrics)
                        gy = _slope(d, j, k, i, jb, kb, ib, 1, metrics)
                        gz = _slope(d, j, k, i, jb, kb, ib, 2, metrics)
                        norm = math.sqrt(gx * gx + gy * gy + gz * gz)
                        if not 1e-3 < norm < 1e2:
                            continue
                        gx, gy, gz = gx / norm, gy / norm, gz / norm
                        x = (metrics.xf[i] if axis == 0 else metrics.xc[i]) - position[n, 0]
                        y = (metrics.yf[j] if axis == 1 else metrics.yc[j]) - position[n, 1]
                        z = (metrics.zf[k] if axis == 2 else metrics.zc[k]) - position[n, 2]
                        o = angular_velocity[n]
                        through = (
                            gx * (_at(ext[0], 0, axis, j, k, i) - (velocity[n, 0] + o[1] * z - o[2] * y))
                            + gy * (_at(ext[1], 1, axis, j, k, i) - (velocity[n, 1] + o[2] * x - o[0] * z))
                            + gz * (_at(ext[2], 2, axis, j, k, i) - (velocity[n, 2] + o[0] * y - o[1] * x))
                        )
                        along = gx if axis == 0 else (gy if axis == 1 else gz)
                        if axis == 0:
                            here, target = out[0][j, k, i], ext[0][j, k, i]
                        elif axis == 1:
                            here, target = out[1][j, k, i], ext[1][j, k, i]
                        else:
                            here, target = out[2][j, k, i], ext[2][j, k, i]
                        target -= along * through
                        if (wet[j, k, i] or wet[jb, kb, ib]) and beta > 0.0:
                            strength = dt * BLEND_RATE * ((BLENDED - beta) / beta) ** 2
                            change = strength / (1.0 + strength) * (target - here)
                            volume = (
                                (metrics.ex[i] if axis == 0 else metrics.dx[i])
                                * (metrics.ey[j] if axis == 1 else metrics.dy[j])
                                * (metrics.ez[k] if axis == 2 else metrics.dz[k])
                            )
                            force = -density * beta * volume * change / dt
                            exchange[n, axis] += force
                            if axis == 0:
                                exchange[n, 4] += z * force
                                exchange[n, 5] -= y * force
                            elif axis == 1:
                                exchange[n, 3] -= z * force
                                exchange[n, 5] += x * force
                            else:
                                exchange[n, 3] += y * force
                                exchange[n, 4] -= x * force
                            target = here + change
                        if axis == 0:
                            out[0][j, k, i] = target
                        elif axis == 1:
                            out[1][j, k, i] = target
                        else:
                            out[2][j, k, i] = target


@njit(cache=True, error_model="numpy", inline="always")
def _slope(d: Array, j: int, k: int, i: int, jb: int, kb: int, ib: int, axis: int, m: Metrics) -> float:
    """Gradient of the distance along `axis` at the face between cells (j, k, i) and (jb, kb, ib)."""
    if axis == 0:
        if ib != i:
            return (d[j, k, i] - d[j, k, ib]) / m.ex[i]
        here, there = d[j, k, i + 1] - d[j, k, i - 1], d[jb, kb, i + 1] - d[jb, kb, i - 1]
        return 0.5 * (here + there) / (m.ex[i] + m.ex[i + 1])
    if axis == 1:
        if jb != j:
            return (d[j, k, i] - d[jb, k, i]) / m.ey[j]
        here, there = d[j + 1, k, i] - d[j - 1, k, i], d[j + 1, kb, ib] - d[j - 1, kb, ib]
        return 0.5 * (here + there) / (m.ey[j] + m.ey[j + 1])
    if kb != k:
        return (d[j, k, i] - d[j, kb, i]) / m.ez[k]
    here, there = d[j, k + 1, i] - d[j, k - 1, i], d[jb, k + 1, ib] - d[jb, k - 1, ib]
    return 0.5 * (here + there) / (m.ez[k] + m.ez[k + 1])


@njit(cache=True, error_model="numpy", inline="always")
def _at(q: Array, component: int, axis: int, j: int, k: int, i: int) -> float:
    """Value of a velocity component at the face (axis; j, k, i): its own, or the mean of the four around it."""
    if component == axis:
        return q[j, k, i]
    jb, kb, ib = j - (axis == 1), k - (axis == 2), i - (axis == 0)
    ja, ka, ia = component == 1, component == 2, component == 0
    return 0.25 * ((q[j, k, i] + q[jb + ja, kb + ka, ib + ia]) + (q[jb, kb, ib] + q[j + ja, k + ka, i + ia]))
