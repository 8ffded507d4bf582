"""Geometric multigrid for the symmetric systems of `exumob.flow.pressure`: levels, and one V-cycle as preconditioner.

It relaxes vertical lines in checkerboard order (McAdams, Sifakis & Teran 2010 use it likewise) and coarsens
x and y only: cells are flat seen from far, and columns are short. Corrections are constant over a coarse cell, whose
couplings are rediscretised.

Every row (j, k) is stored as its even cells followed by its odd ones, so that the cells of one colour and their
neighbours of the other are contiguous: cell i is number i // 2 of the half i % 2. Only pairs of cells inside the
spans of wet cells are visited. Outside them couplings and pivots are exact zeros.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from exumob.flow.grid import HALO
from exumob.states import Array

Single = NDArray[np.float32]
COARSEST = 4
"""Cells along x or y at which coarsening stops."""
COARSEST_SWEEPS = 4
"""Relaxations of the coarsest level, forth and back again."""
SERIAL_ROWS = 400
"""Levels with fewer rows (j, k) are not worth the launch of threads."""
ZERO = np.float32(0.0)
ONE = np.float32(1.0)
U = np.uintp
"""Unsigned indices: Numba then leaves out its test for negative ones and uses vector instructions."""


class Level(NamedTuple):
    """One level of the multigrid: flat arrays in single precision, and per row the pairs of cells visited."""

    ny: int
    nz: int
    half: int
    """Cells in half a row"""
    lo: NDArray[np.int32]
    hi: NDArray[np.int32]
    """First pair and the one after the last, of row j nz + k"""
    ax: Single
    ay: Single
    az: Single
    """Couplings through the low faces [m]"""
    extra: Single
    """What else stands on the diagonal: surface, compliance [m]"""
    pivot: Single
    """Inverse pivots of the vertical lines; 0 where there is no unknown"""
    x: Single
    b: Single


class Store(NamedTuple):
    """All levels one after the other, for compiled code."""

    shapes: NDArray[np.int64]
    """Per level: first row, first cell, ny, nz, half"""
    lo: NDArray[np.int32]
    hi: NDArray[np.int32]
    ax: Single
    ay: Single
    az: Single
    extra: Single
    pivot: Single
    x: Single
    b: Single


class Vectors(NamedTuple):
    """Vectors of the conjugate gradients, flat, ordered as the finest level."""

    solution: Array
    residual: Array
    direction: Array
    product: Array


@njit(cache=True, error_model="numpy")
def level_of(store: Store, depth: int) -> Level:
    """Views of one level, 0 the finest."""
    row, cell, ny, nz, half = store.shapes[depth]
    rows, cells = row + ny * nz, cell + 2 * ny * nz * half
    return Level(
        ny, nz, half, store.lo[row:rows], store.hi[row:rows], store.ax[cell:cells], store.ay[cell:cells],
        store.az[cell:cells], store.extra[cell:cells], store.pivot[cell:cells], store.x[cell:cells],
        store.b[cell:cells],
    )  # fmt: skip


class Levels:
    """All levels of a grid, finest first, and the vectors of the conjugate gradients."""

    def __init__(self, padded_shape: tuple[int, int, int]) -> None:
        """Allocate for fields of this shape."""
        ny, nz, nx = (n - 2 * HALO for n in padded_shape)
        shapes, row, cell = [], 0, 0
        while True:
            py, pz, half = ny + 2 * HALO, nz + 2 * HALO, (nx + 2 * HALO) // 2 + 1
            shapes.append((row, cell, py, pz, half))
            row, cell = row + py * pz, cell + 2 * py * pz * half
            if min(nx, ny) <= COARSEST:
                break
            nx, ny = (nx + 1) // 2, (ny + 1) // 2
        start = np.full(row, HALO // 2, dtype=np.int32)
        self.store = Store(
            np.array(shapes), start, start.copy(), *(np.zeros(cell, dtype=np.float32) for _ in Store._fields[3:])
        )
        fine = 2 * shapes[0][2] * shapes[0][3] * shapes[0][4]
        self.vectors = Vectors(*(np.zeros(fine) for _ in Vectors._fields))
        self.levels: list[Level] = [level_of(self.store, d) for d in range(len(shapes))]
        self.rhs = np.zeros(padded_shape)

    def clear(self) -> None:
        """Forget all values: after a solution that is not finite, as 0 times such a value is no 0."""
        for array in (*self.store[3:], *self.vectors):
            array[:] = 0.0


# -- couplings -------------------------------------------------------------------------------------------------------


@njit(cache=True, error_model="numpy")
def clear_row(level: Level, j: int, lo: NDArray[np.int32], hi: NDArray[np.int32]) -> None:
    """Set what the last step left in row j to 0 and take new spans of pairs, one per k."""
    for k in range(level.nz):
        r = j * level.nz + k
        if level.hi[r] > level.lo[r]:
            for s in range(2):
                first = U((2 * r + s) * level.half + level.lo[r])
                last = U((2 * r + s) * level.half + level.hi[r])
                for array in (level.ax, level.ay, level.az, level.extra, level.pivot, level.x):
                    array[first:last] = ZERO
        level.lo[r] = lo[k]
        level.hi[r] = hi[k]


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
            high = U(level.half) if s == 0 else U(1) - U(level.half)
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


@njit(cache=True, error_model="numpy")
def _coarsen_row(fine: Level, coarse: Level, j: int) -> None:
    """Row j of `coarsen`."""
    nz, row = fine.nz, 2 * fine.half
    lo, hi = np.empty(nz, np.int32), np.empty(nz, np.int32)
    j0 = 2 * (j - HALO) + HALO
    for k in range(nz):
        first, last = span_of_two(fine, j0, k)
        lo[k], hi[k] = (first + 1) // 2, (last // 2 + 1 if last > first else (first + 1) // 2)
    clear_row(coarse, j, lo, hi)
    ax, ay, az, extra = coarse.ax, coarse.ay, coarse.az, coarse.extra
    half = np.float32(0.5)
    one = U(fine.half)
    for k in range(HALO, nz - HALO):
        low, high = U((j0 * nz + k) * row), U(((j0 + 1) * nz + k) * row)
        for s in range(2):
            first = U((2 * (j * nz + k) + s) * coarse.half + lo[k])
            m0, m1 = low + U(2 * lo[k] + s - 1), high + U(2 * lo[k] + s - 1)
            for n in range(hi[k] - lo[k]):
                p, q0, q1 = first + U(n), m0 + U(2 * n), m1 + U(2 * n)
                ax[p] = half * (fine.ax[q0] + fine.ax[q1])
                ay[p] = half * (fine.ay[q0] + fine.ay[q0 + one])
                az[p] = fine.az[q0] + fine.az[q0 + one] + fine.az[q1] + fine.az[q1 + one]
                extra[p] = fine.extra[q0] + fine.extra[q0 + one] + fine.extra[q1] + fine.extra[q1 + one]


@njit(cache=True, error_model="numpy")
def span_of_two(level: Level, j: int, k: int) -> tuple[int, int]:
    """Span of pairs that holds those of rows j and j + 1."""
    r, t = j * level.nz + k, (j + 1) * level.nz + k
    if level.lo[t] == level.hi[t]:
        return level.lo[r], level.hi[r]
    if level.lo[r] == level.hi[r]:
        return level.lo[t], level.hi[t]
    return min(level.lo[r], level.lo[t]), max(level.hi[r], level.hi[t])


@njit(cache=True, error_model="numpy", parallel=True)
def coarsen(fine: Level, coarse: Level) -> None:
    """Rediscretised couplings of a grid twice as coarse in x and y."""
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
    low = U(half) - U(1) if s == 0 else U(0) - U(half)
    high = U(half) if s == 0 else U(1) - U(half)
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


@njit(cache=True, error_model="numpy")
def _restrict_row(fine: Level, coarse: Level, j: int, total: Single) -> None:
    """Row j of `restrict`."""
    ax, ay, az, extra = fine.ax, fine.ay, fine.az, fine.extra
    pivot, x, b = fine.pivot, fine.x, fine.b
    nz, half = fine.nz, fine.half
    sz = U(2 * half)
    sy = U(nz) * sz
    for k in range(HALO, nz - HALO):
        r = j * nz + k
        begin, count = 2 * coarse.lo[r] - 1, 2 * (coarse.hi[r] - coarse.lo[r])
        for side in range(2):
            m = 2 * (j - HALO) + HALO + side
            s = m % 2
            low = U(half) - U(1) if s == 0 else U(0) - U(half)
            high = U(half) if s == 0 else U(1) - U(half)
            first = U((2 * (m * nz + k) + s) * half + begin)
            for n in range(count):
                p = first + U(n)
                h = x[p]
                rest = b[p] - extra[p] * h
                rest += ax[p] * (x[p + low] - h) + ax[p + high] * (x[p + high] - h)
                rest += ay[p] * (x[p - sy] - h) + ay[p + sy] * (x[p + sy] - h)
                rest += az[p] * (x[p - sz] - h) + az[p + sz] * (x[p + sz] - h)
                rest = rest if pivot[p] > ZERO else ZERO
                total[U(n)] = rest if side == 0 else total[U(n)] + rest
        for s in range(2):
            first = U((2 * r + s) * coarse.half + coarse.lo[r])
            for n in range(coarse.hi[r] - coarse.lo[r]):
                coarse.b[first + U(n)] = total[U(2 * n + s)]


@njit(cache=True, error_model="numpy", parallel=True)
def _restrict_parallel(fine: Level, coarse: Level) -> None:
    for j in prange(HALO, coarse.ny - HALO):
        _restrict_row(fine, coarse, j, np.empty(2 * coarse.half, np.float32))


@njit(cache=True, error_model="numpy")
def restrict(fine: Level, coarse: Level, threaded: bool) -> None:
    """Sum the residual of the first colour over each coarse cell; that of the second has just become 0."""
    if threaded:
        _restrict_parallel(fine, coarse)
    else:
        total = np.empty(2 * coarse.half, np.float32)
        for j in range(HALO, coarse.ny - HALO):
            _restrict_row(fine, coarse, j, total)


@njit(cache=True, error_model="numpy")
def _prolong_row(fine: Level, coarse: Level, j: int, values: Single) -> None:
    """Row j of `prolong`."""
    x, nz = fine.x, fine.nz
    half, s = fine.half, j % 2
    above = (j - HALO) // 2 + HALO
    for k in range(HALO, nz - HALO):
        r, c = j * nz + k, above * nz + k
        if fine.lo[r] == fine.hi[r]:
            continue
        for t in range(2):
            first = U((2 * c + t) * coarse.half + coarse.lo[c])
            for n in range(coarse.hi[c] - coarse.lo[c]):
                values[U(2 * n + t)] = coarse.x[first + U(n)]
        first = U((2 * r + s) * half + fine.lo[r])
        shift = U(fine.lo[r] - (2 * coarse.lo[c] - 1))
        for n in range(fine.hi[r] - fine.lo[r]):
            x[first + U(n)] += values[shift + U(n)]


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
    for depth in range(1, len(store.shapes)):
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
    last = len(store.shapes) - 1
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
