"""Conjugate gradients with the V-cycle of `exumob.flow.pressure.multigrid` as preconditioner.

Vectors are in double precision, ordered as the finest level; the preconditioner works in single precision.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numba
import numpy as np
from numba import prange

from exumob.flow.grid import HALO, Metrics
from exumob.flow.pressure.levels import ZERO, Level, Levels, Store, U, Vectors, beside, level_of
from exumob.flow.pressure.multigrid import cycle, prepare, residual_at
from exumob.support.arrays import Array
from exumob.support.kernels import njit


@njit(cache=True, error_model="numpy")
def _load_row(level: Level, v: Vectors, j: int, phi: Array, rhs: Array) -> None:
    """Row j of `load`."""
    pivot = level.pivot
    for k in range(HALO, level.nz - HALO):
        r = j * level.nz + k
        lo, hi = level.lo[r], level.hi[r]
        values, right = phi[j, k], rhs[j, k]
        for s in range(2):
            first = U((2 * r + s) * level.half + lo)
            for n in range(hi - lo):
                p, i = first + U(n), U(2 * (lo + n) + s)
                v.solution[p] = values[i] if pivot[p] > ZERO else 0.0
                v.residual[p] = right[i] if pivot[p] > ZERO else 0.0
                v.direction[p] = 0.0
                v.product[p] = 0.0


@njit(cache=True, error_model="numpy", parallel=True)
def load(level: Level, v: Vectors, phi: Array, rhs: Array) -> None:
    """Take start and right-hand side from fields; 0 where there is no unknown."""
    for j in prange(HALO, level.ny - HALO):
        _load_row(level, v, j, phi, rhs)


@njit(cache=True, error_model="numpy")
def _unload_row(level: Level, v: Vectors, j: int, phi: Array) -> None:
    """Row j of `unload`."""
    for k in range(level.nz):
        r = j * level.nz + k
        values = phi[j, k]
        values[:] = 0.0
        for s in range(2):
            first = U((2 * r + s) * level.half)
            for n in range(level.lo[r], level.hi[r]):
                values[U(2 * n + s)] = v.solution[first + U(n)]


@njit(cache=True, error_model="numpy", parallel=True)
def unload(level: Level, v: Vectors, phi: Array) -> None:
    """Write the solution to a field; 0 where there is no unknown."""
    for j in prange(level.ny):
        _unload_row(level, v, j, phi)


@njit(cache=True, error_model="numpy", fastmath={"nnan", "nsz"})
def _largest_share(level: Level, residual: Array, j: int, metrics: Metrics) -> float:
    """Largest residual of row j over its cell's volume [1/s]."""
    largest = 0.0
    for k in range(HALO, level.nz - HALO):
        r = j * level.nz + k
        row = 0.0
        for s in range(2):
            first = U((2 * r + s) * level.half)
            for n in range(level.lo[r], level.hi[r]):
                size = abs(residual[first + U(n)]) / metrics.dx[U(2 * n + s)]
                row = size if size > row else row
        row /= metrics.dy[j] * metrics.dz[k]
        largest = row if row > largest else largest
    return largest


@njit(cache=True, error_model="numpy")
def _first_residual_row(level: Level, v: Vectors, j: int) -> float:
    """Row j of `first_residual`; its sum, to find what is not a number."""
    b, x, residual = level.b, v.solution, v.residual
    sz = U(2 * level.half)
    sy = U(level.nz) * sz
    total = 0.0
    for k in range(HALO, level.nz - HALO):
        r = j * level.nz + k
        for s in range(2):
            low, high = beside(level.half, s)
            first = U((2 * r + s) * level.half + level.lo[r])
            for n in range(level.hi[r] - level.lo[r]):
                p = first + U(n)
                value = residual_at(level, x, residual, p, (low, high), (sy, sz))
                residual[p] = value
                b[p] = value
                total += value
    return total


@njit(cache=True, error_model="numpy", parallel=True)
def first_residual(level: Level, v: Vectors, metrics: Metrics, worst: Array) -> None:
    """Residual rhs - A x; per row j its largest share of a cell's volume [1/s], infinite if one is not a number."""
    for j in prange(HALO, level.ny - HALO):
        total = _first_residual_row(level, v, j)
        worst[j] = _largest_share(level, v.residual, j, metrics) if math.isfinite(total) else np.inf


@njit(cache=True, error_model="numpy", fastmath={"reassoc"})
def _dot_row(level: Level, j: int) -> float:
    """Row j of `dot_rows`."""
    x, b = level.x, level.b
    total = 0.0
    for k in range(HALO, level.nz - HALO):
        r = j * level.nz + k
        for s in range(2):
            first = U((2 * r + s) * level.half + level.lo[r])
            for n in range(level.hi[r] - level.lo[r]):
                p = first + U(n)
                total += np.float64(x[p]) * np.float64(b[p])
    return total


@njit(cache=True, error_model="numpy", parallel=True)
def dot_rows(level: Level, sums: Array) -> None:
    """Per row j the dot product of the residual and the preconditioned residual."""
    for j in prange(HALO, level.ny - HALO):
        sums[j] = _dot_row(level, j)


@njit(cache=True, error_model="numpy", fastmath={"reassoc"})
def _turn_row(level: Level, v: Vectors, j: int, beta: float) -> float:
    """Row j of `new_direction`."""
    ax, ay, az, extra, x = level.ax, level.ay, level.az, level.extra, level.x
    direction, product = v.direction, v.product
    sz = U(2 * level.half)
    sy = U(level.nz) * sz
    total = 0.0
    for k in range(HALO, level.nz - HALO):
        r = j * level.nz + k
        for s in range(2):
            low, high = beside(level.half, s)
            first = U((2 * r + s) * level.half + level.lo[r])
            for n in range(level.hi[r] - level.lo[r]):
                p = first + U(n)
                h = np.float64(x[p])
                value = extra[p] * h
                value += ax[p] * (h - x[p + low]) + ax[p + high] * (h - x[p + high])
                value += ay[p] * (h - x[p - sy]) + ay[p + sy] * (h - x[p + sy])
                value += az[p] * (h - x[p - sz]) + az[p + sz] * (h - x[p + sz])
                along = h + beta * direction[p]
                image = value + beta * product[p]
                direction[p] = along
                product[p] = image
                total += along * image
    return total


@njit(cache=True, error_model="numpy", parallel=True)
def new_direction(level: Level, v: Vectors, beta: float, sums: Array) -> None:
    """Conjugate direction p = z + beta p with its product A p = A z + beta A p; per row j the dot product of both."""
    for j in prange(HALO, level.ny - HALO):
        sums[j] = _turn_row(level, v, j, beta)


@njit(cache=True, error_model="numpy")
def _advance_row(level: Level, v: Vectors, j: int, alpha: float) -> None:
    """Row j of `advance_solution`."""
    b = level.b
    solution, residual, direction, product = v.solution, v.residual, v.direction, v.product
    for k in range(HALO, level.nz - HALO):
        r = j * level.nz + k
        for s in range(2):
            first = U((2 * r + s) * level.half + level.lo[r])
            for n in range(level.hi[r] - level.lo[r]):
                p = first + U(n)
                solution[p] += alpha * direction[p]
                value = residual[p] - alpha * product[p]
                residual[p] = value
                b[p] = value


@njit(cache=True, error_model="numpy", parallel=True)
def advance_solution(level: Level, v: Vectors, alpha: float, metrics: Metrics, worst: Array) -> None:
    """Step x += alpha direction, residual -= alpha product; per row j the largest residual share of a volume [1/s]."""
    for j in prange(HALO, level.ny - HALO):
        _advance_row(level, v, j, alpha)
        worst[j] = _largest_share(level, v.residual, j, metrics)


@njit(cache=True, error_model="numpy")
def conjugate_gradients(
    store: Store, v: Vectors, metrics: Metrics, dt: float, tolerance: float, most: int, threads: int
) -> tuple[int, float]:
    """Iterate from what `load` has left; iterations and the largest divergence times dt left."""
    fine = level_of(store, 0)
    sums, worst = np.zeros(fine.ny), np.zeros(fine.ny)
    first_residual(fine, v, metrics, worst)
    left = np.max(worst) * dt
    rho = 0.0
    for iteration in range(most):
        if left <= tolerance or not math.isfinite(left):
            return iteration, left
        cycle(store, threads)
        dot_rows(fine, sums)
        last, rho = rho, np.sum(sums)
        new_direction(fine, v, rho / last if iteration > 0 else 0.0, sums)
        curvature = np.sum(sums)
        if not curvature > 0.0:
            return iteration, left
        advance_solution(fine, v, rho / curvature, metrics, worst)
        left = np.max(worst) * dt
    return most, left


class Outcome(NamedTuple):
    """Outcome of a pressure solution."""

    iterations: int
    residual: float
    """Largest divergence left, times the time step [-]"""
    converged: bool


def solve(
    levels: Levels, phi: Array, metrics: Metrics, dt: float, tolerance: float, most: int, closed: bool
) -> Outcome:
    """Solve for phi [m^2/s], starting from what it holds.

    Parameters
    ----------
    levels : Levels
        With couplings and right-hand side from `exumob.flow.pressure.assembly.assemble`.
    phi : array, changed
        0 outside wet cells afterwards.
    metrics : Metrics
    dt : float
        [s]
    tolerance : float
        Divergence left times dt [-].
    most : int
        Iterations before giving up.
    closed : bool
        Whether there may be no surface at all: phi is then defined up to a constant and the sources must sum to 0.
    """
    threads = numba.get_num_threads()
    fine, v = levels.levels[0], levels.vectors
    prepare(levels.store, threads)
    load(fine, v, phi, levels.rhs)
    if closed and not fine.extra.any():
        unknown = fine.pivot > 0.0
        v.residual[unknown] -= v.residual[unknown].mean()
    iterations, left = conjugate_gradients(levels.store, v, metrics, dt, tolerance, most, threads)
    unload(fine, v, phi)
    if not math.isfinite(left):
        levels.clear()
    return Outcome(iterations, left, left <= tolerance)
