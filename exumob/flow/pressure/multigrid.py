"""One V-cycle of geometric multigrid, the preconditioner of `exumob.flow.pressure.conjugate_gradients`.

It solves the symmetric systems of `exumob.flow.pressure.assembly` roughly: it relaxes vertical lines in checkerboard
order (McAdams, Sifakis & Teran 2010 use it likewise) and coarsens x and y only (`exumob.flow.pressure.levels`).
Corrections are constant over a coarse cell, whose couplings are rediscretised.

Every pass is written for one row j. It runs over all rows in parallel or, on levels too small to be worth the launch
of threads, one after the other: hence two short loops round each.
"""

from __future__ import annotations

import numpy as np
from numba import prange

from exumob.flow.grid import HALO
from exumob.flow.pressure.levels import ZERO, Level, Single, Store, U, beside, clear_row, level_of
from exumob.support.arrays import Array
from exumob.support.kernels import njit

COARSEST_SWEEPS = 4
"""Relaxations of the coarsest level, forth and back again."""
SERIAL_ROWS = 400
"""Levels with fewer rows (j, k) are not worth the launch of threads."""
ONE = np.float32(1.0)

# -- couplings -------------------------------------------------------------------------------------------------------


@njit(cache=True, error_model="numpy")
def _factor_row(level: Level, j: int) -> None:
    """Row j of `factor_lines`."""
    ax, ay, az, extra, pivot = level.ax, level.ay, level.az, level.extra, level.pivot
    sz = U(2 * level.half)
    sy = U(level.nz) * sz
    for k in range(HALO, level.nz - HALO):
        r = j * level.nz + k
        for s in range(2):
            first = U((2 * r + s) * level.half + level.lo[r])
            _, high = beside(level.half, s)
            for n in range(level.hi[r] - level.lo[r]):
                p = first + U(n)
                diagonal = ax[p] + ax[p + high] + ay[p] + ay[p + sy] + az[p] + az[p + sz] + extra[p]
                reduced = diagonal - az[p] * az[p] * pivot[p - sz]
                least = np.float32(1e-6) * diagonal
                reduced = reduced if reduced > least else least
                inverse = ONE / (reduced if diagonal > ZERO else ONE)
                pivot[p] = inverse if diagonal > ZERO else ZERO


@njit(cache=True, error_model="numpy", parallel=True)
def factor_lines(level: Level) -> None:
    """Inverse pivots of the tridiagonal systems along z."""
    for j in prange(HALO, level.ny - HALO):
        _factor_row(level, j)


@njit(cache=True, error_model="numpy", inline="always")
def _sum_rows(out: Single, values: Single, level: Level, j: int, k: int, two: bool, lo: int, hi: int) -> None:
    """Sum of the rows j and, if there are `two`, j + 1, their pairs lo to hi, in natural order."""
    r, t = j * level.nz + k, (j + 1) * level.nz + k
    for s in range(2):
        p, q = U((2 * r + s) * level.half + lo), U((2 * t + s) * level.half + lo)
        for n in range(hi - lo):
            value = values[p + U(n)]
            out[U(2 * (lo + n) + s)] = value + values[q + U(n)] if two else value


@njit(cache=True, error_model="numpy")
def _coarsen_row(fine: Level, coarse: Level, j: int) -> None:
    """Row j of `coarsen`."""
    nz = fine.nz
    lo, hi = np.empty(nz, np.int32), np.empty(nz, np.int32)
    j0, two, distance_ratio_y = coarse.first_y[j], coarse.is_pair_y[j] > ZERO, coarse.distance_ratio_y[j]
    first, is_pair, distance_ratio = coarse.first_x, coarse.is_pair_x, coarse.distance_ratio_x
    parent = fine.parent_x
    for k in range(nz):
        begin, end = pairs_of_rows(fine, j0, k, two)
        lo[k] = parent[2 * begin] // 2 if end > begin else HALO // 2
        hi[k] = parent[2 * end - 1] // 2 + 1 if end > begin else HALO // 2
    clear_row(coarse, j, lo, hi)
    length = 2 * fine.half
    ax, ay, az, extra = (
        np.empty(length, np.float32), np.empty(length, np.float32), np.empty(length, np.float32),
        np.empty(length, np.float32),
    )  # fmt: skip
    for k in range(HALO, nz - HALO):
        if hi[k] <= lo[k]:
            continue
        begin, end = first[2 * lo[k]] // 2, (first[2 * hi[k] - 1] + 1) // 2 + 1
        _sum_rows(ax, fine.ax, fine, j0, k, two, begin, end)
        _sum_rows(ay, fine.ay, fine, j0, k, False, begin, end)
        _sum_rows(az, fine.az, fine, j0, k, two, begin, end)
        _sum_rows(extra, fine.extra, fine, j0, k, two, begin, end)
        for s in range(2):
            place = U((2 * (j * nz + k) + s) * coarse.half + lo[k])
            for n in range(hi[k] - lo[k]):
                p, i = place + U(n), U(2 * (lo[k] + n) + s)
                q, other = U(first[i]), is_pair[i]
                coarse.ax[p] = distance_ratio[i] * ax[q]
                coarse.ay[p] = distance_ratio_y * (ay[q] + other * ay[q + U(1)])
                coarse.az[p] = az[q] + other * az[q + U(1)]
                coarse.extra[p] = extra[q] + other * extra[q + U(1)]


@njit(cache=True, error_model="numpy")
def pairs_of_rows(level: Level, j: int, k: int, two: bool) -> tuple[int, int]:
    """First pair and the one after the last that hold those of row j and, if there are `two`, of j + 1."""
    r, t = j * level.nz + k, (j + 1) * level.nz + k
    if not two or level.lo[t] == level.hi[t]:
        return level.lo[r], level.hi[r]
    if level.lo[r] == level.hi[r]:
        return level.lo[t], level.hi[t]
    return min(level.lo[r], level.lo[t]), max(level.hi[r], level.hi[t])


@njit(cache=True, error_model="numpy", parallel=True)
def coarsen(fine: Level, coarse: Level) -> None:
    """Rediscretised couplings of the next coarser level."""
    for j in prange(HALO, coarse.ny - HALO):
        _coarsen_row(fine, coarse, j)


# -- the cycle -------------------------------------------------------------------------------------------------------


@njit(cache=True, error_model="numpy")
def _relax_row(level: Level, j: int, color: int, from_zero: bool) -> None:
    """Row j of `relax_lines`."""
    ax, ay, az, pivot, x, b = level.ax, level.ay, level.az, level.pivot, level.x, level.b
    nz, half = level.nz, level.half
    sz = U(2 * half)
    sy = U(nz) * sz
    s = (j + color) % 2
    low, high = beside(half, s)
    for k in range(HALO, nz - HALO):
        r = j * nz + k
        first, count = U((2 * r + s) * half + level.lo[r]), level.hi[r] - level.lo[r]
        if from_zero:
            for n in range(count):
                p = first + U(n)
                x[p] = (b[p] + az[p] * x[p - sz]) * pivot[p]
        else:
            for n in range(count):
                p = first + U(n)
                value = b[p] + ax[p] * x[p + low] + ax[p + high] * x[p + high]
                value += ay[p] * x[p - sy] + ay[p + sy] * x[p + sy]
                x[p] = (value + az[p] * x[p - sz]) * pivot[p]
    for k in range(nz - HALO - 2, HALO - 1, -1):
        r = j * nz + k
        first, count = U((2 * r + s) * half + level.lo[r]), level.hi[r] - level.lo[r]
        for n in range(count):
            p = first + U(n)
            x[p] += pivot[p] * az[p + sz] * x[p + sz]


@njit(cache=True, error_model="numpy", parallel=True)
def _relax_parallel(level: Level, color: int, from_zero: bool) -> None:
    for j in prange(HALO, level.ny - HALO):
        _relax_row(level, j, color, from_zero)


@njit(cache=True, error_model="numpy")
def relax_lines(level: Level, color: int, from_zero: bool, threaded: bool) -> None:
    """Solve the vertical lines of one colour of the checkerboard with the others held (`from_zero`: at 0)."""
    if threaded:
        _relax_parallel(level, color, from_zero)
    else:
        for j in range(HALO, level.ny - HALO):
            _relax_row(level, j, color, from_zero)


@njit(cache=True, error_model="numpy", inline="always")
def residual_at(
    level: Level, x: Array, right: Array, p: np.uintp, sides: tuple[np.uintp, np.uintp],
    strides: tuple[np.uintp, np.uintp],
) -> float:  # fmt: skip
    """Right-hand side less A x at cell p; `sides`: steps to its neighbours along x; `strides`: along y and z."""
    (low, high), (sy, sz) = sides, strides
    h = x[p]
    rest = right[p] - level.extra[p] * h
    rest += level.ax[p] * (x[p + low] - h) + level.ax[p + high] * (x[p + high] - h)
    rest += level.ay[p] * (x[p - sy] - h) + level.ay[p + sy] * (x[p + sy] - h)
    rest += level.az[p] * (x[p - sz] - h) + level.az[p + sz] * (x[p + sz] - h)
    return rest


@njit(cache=True, error_model="numpy")
def _restrict_row(fine: Level, coarse: Level, j: int, total: Single) -> None:
    """Row j of `restrict`."""
    pivot, x, b = fine.pivot, fine.x, fine.b
    nz, half = fine.nz, fine.half
    sz = U(2 * half)
    sy = U(nz) * sz
    j0, rows = coarse.first_y[j], 2 if coarse.is_pair_y[j] > ZERO else 1
    child, is_pair = coarse.first_x, coarse.is_pair_x
    for k in range(HALO, nz - HALO):
        r = j * nz + k
        if coarse.hi[r] <= coarse.lo[r]:
            continue
        begin, end = child[2 * coarse.lo[r]] // 2, (child[2 * coarse.hi[r] - 1] + 1) // 2 + 1
        if rows == 1:
            total[2 * begin : 2 * end] = ZERO
        for m in range(j0, j0 + rows):
            s = m % 2
            low, high = beside(half, s)
            first = U((2 * (m * nz + k) + s) * half + begin)
            place = U(2 * begin + s)
            for n in range(end - begin):
                p = first + U(n)
                rest = residual_at(fine, x, b, p, (low, high), (sy, sz))
                total[place + U(2 * n)] = rest if pivot[p] > ZERO else ZERO
        for s in range(2):
            first = U((2 * r + s) * coarse.half + coarse.lo[r])
            for n in range(coarse.hi[r] - coarse.lo[r]):
                i = U(2 * (coarse.lo[r] + n) + s)
                q = U(child[i])
                coarse.b[first + U(n)] = total[q] + is_pair[i] * total[q + U(1)]


@njit(cache=True, error_model="numpy", parallel=True)
def _restrict_parallel(fine: Level, coarse: Level) -> None:
    for j in prange(HALO, coarse.ny - HALO):
        _restrict_row(fine, coarse, j, np.empty(2 * fine.half, np.float32))


@njit(cache=True, error_model="numpy")
def restrict(fine: Level, coarse: Level, threaded: bool) -> None:
    """Sum the residual of the first colour over each coarse cell; that of the second has just become 0."""
    if threaded:
        _restrict_parallel(fine, coarse)
    else:
        total = np.empty(2 * fine.half, np.float32)
        for j in range(HALO, coarse.ny - HALO):
            _restrict_row(fine, coarse, j, total)


@njit(cache=True, error_model="numpy")
def _prolong_row(fine: Level, coarse: Level, j: int, values: Single) -> None:
    """Row j of `prolong`."""
    x, nz = fine.x, fine.nz
    half, s = fine.half, j % 2
    above, parent = fine.parent_y[j], fine.parent_x
    for k in range(HALO, nz - HALO):
        r, c = j * nz + k, above * nz + k
        if fine.lo[r] == fine.hi[r]:
            continue
        for t in range(2):
            first = U((2 * c + t) * coarse.half + coarse.lo[c])
            for n in range(coarse.hi[c] - coarse.lo[c]):
                values[U(2 * (coarse.lo[c] + n) + t)] = coarse.x[first + U(n)]
        first, place = U((2 * r + s) * half + fine.lo[r]), U(2 * fine.lo[r] + s)
        for n in range(fine.hi[r] - fine.lo[r]):
            x[first + U(n)] += values[U(parent[place + U(2 * n)])]


@njit(cache=True, error_model="numpy", parallel=True)
def _prolong_parallel(fine: Level, coarse: Level) -> None:
    for j in prange(HALO, fine.ny - HALO):
        _prolong_row(fine, coarse, j, np.empty(2 * coarse.half, np.float32))


@njit(cache=True, error_model="numpy")
def prolong(fine: Level, coarse: Level, threaded: bool) -> None:
    """Add the coarse correction to the first colour; the second is relaxed next and needs none."""
    if threaded:
        _prolong_parallel(fine, coarse)
    else:
        values = np.empty(2 * coarse.half, np.float32)
        for j in range(HALO, fine.ny - HALO):
            _prolong_row(fine, coarse, j, values)


@njit(cache=True, error_model="numpy")
def _is_large(level: Level) -> bool:
    return level.ny * level.nz > SERIAL_ROWS


@njit(cache=True, error_model="numpy")
def prepare(store: Store, threads: int) -> None:
    """Coarsen the couplings and factor the vertical lines of all levels."""
    fine = level_of(store, 0)
    factor_lines(fine)
    for depth in range(1, len(store.places)):
        coarse = level_of(store, depth)
        if threads > 1 and _is_large(coarse):
            coarsen(fine, coarse)
            factor_lines(coarse)
        else:
            for j in range(HALO, coarse.ny - HALO):
                _coarsen_row(fine, coarse, j)
            for j in range(HALO, coarse.ny - HALO):
                _factor_row(coarse, j)
        fine = coarse


@njit(cache=True, error_model="numpy")
def cycle(store: Store, threads: int) -> None:
    """One symmetric V-cycle, x = M^-1 b on the finest level."""
    last = len(store.places) - 1
    for depth in range(last):
        fine, coarse = level_of(store, depth), level_of(store, depth + 1)
        threaded = threads > 1 and _is_large(fine)
        relax_lines(fine, 0, True, threaded)
        relax_lines(fine, 1, False, threaded)
        restrict(fine, coarse, threaded)
    coarse = level_of(store, last)
    for n in range(COARSEST_SWEEPS):
        relax_lines(coarse, 0, n == 0, False)
        relax_lines(coarse, 1, False, False)
    for _ in range(COARSEST_SWEEPS):
        relax_lines(coarse, 1, False, False)
        relax_lines(coarse, 0, False, False)
    for depth in range(last - 1, -1, -1):
        fine, coarse = level_of(store, depth), level_of(store, depth + 1)
        threaded = threads > 1 and _is_large(fine)
        prolong(fine, coarse, threaded)
        relax_lines(fine, 1, False, threaded)
        relax_lines(fine, 0, False, threaded)
