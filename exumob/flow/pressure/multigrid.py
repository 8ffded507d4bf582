"""Geometric multigrid for the symmetric systems of `exumob.flow.pressure.assembly`: levels, and one V-cycle as preconditioner.

It relaxes vertical lines in checkerboard order (McAdams, Sifakis & Teran 2010 use it likewise) and coarsens
x and y only: cells are flat seen from far, and columns are short. Neighbours are joined where they are narrow; cells
that stretching has made wide are not, until those of the core have caught up: relaxation does nothing about errors that
alternate along the wider side of a cell, so a coarser level must still show them. Corrections are constant over a
coarse cell, whose couplings are rediscretised.

Every row (j, k) is stored as its even cells followed by its odd ones, so that the cells of one colour and their
neighbours of the other are contiguous: cell i is number i // 2 of the half i % 2. Only pairs of cells inside the
spans of wet cells are visited. Outside them couplings and pivots are exact zeros.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from exumob.flow.grid import HALO, Metrics
from exumob.support.arrays import Array

Single = NDArray[np.float32]
COARSEST = 4
"""Cells along x or y at which coarsening stops."""
WIDEST = 1.4
"""Width of two joined cells, over that of two of the narrowest ones, up to which they are joined."""
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
    first_x: NDArray[np.int32]
    first_y: NDArray[np.int32]
    """The cell of the next finer level that a cell begins with, halo included"""
    twin_x: Single
    twin_y: Single
    """1 if it joins two of these, else 0"""
    closer_x: Single
    closer_y: Single
    """Distance of the finer cells on both sides of its low face over the distance of the cells themselves"""
    parent_x: NDArray[np.int32]
    parent_y: NDArray[np.int32]
    """The cell of the next coarser level to which a cell belongs"""


class Store(NamedTuple):
    """All levels one after the other, for compiled code."""

    shapes: NDArray[np.int64]
    """Per level: first row, first cell, ny, nz, half, first place along x, along y"""
    lo: NDArray[np.int32]
    hi: NDArray[np.int32]
    ax: Single
    ay: Single
    az: Single
    extra: Single
    pivot: Single
    x: Single
    b: Single
    first_x: NDArray[np.int32]
    first_y: NDArray[np.int32]
    twin_x: Single
    twin_y: Single
    closer_x: Single
    closer_y: Single
    parent_x: NDArray[np.int32]
    parent_y: NDArray[np.int32]


class Vectors(NamedTuple):
    """Vectors of the conjugate gradients, flat, ordered as the finest level."""

    solution: Array
    residual: Array
    direction: Array
    product: Array


@njit(cache=True, error_model="numpy")
def level_of(store: Store, depth: int) -> Level:
    """Views of one level, 0 the finest."""
    row, cell, ny, nz, half, place_x, place_y = store.shapes[depth]
    rows, cells, end_x, end_y = row + ny * nz, cell + 2 * ny * nz * half, place_x + 2 * half, place_y + ny
    return Level(
        ny, nz, half, store.lo[row:rows], store.hi[row:rows], store.ax[cell:cells], store.ay[cell:cells],
        store.az[cell:cells], store.extra[cell:cells], store.pivot[cell:cells], store.x[cell:cells],
        store.b[cell:cells], store.first_x[place_x:end_x], store.first_y[place_y:end_y],
        store.twin_x[place_x:end_x], store.twin_y[place_y:end_y], store.closer_x[place_x:end_x],
        store.closer_y[place_y:end_y], store.parent_x[place_x:end_x], store.parent_y[place_y:end_y],
    )  # fmt: skip


def join(faces: Array, widest: float) -> NDArray[np.intp]:
    """Which faces [m] of an axis stay when neighbours not wider than `widest` [m] together are joined in pairs."""
    kept, n = [0], 0
    while n < len(faces) - 1:
        n += 2 if n + 2 < len(faces) and faces[n + 2] - faces[n] <= widest else 1
        kept.append(n)
    return np.array(kept)


def _joints(size: int, faces: Array, kept: NDArray[np.intp]) -> tuple[NDArray[np.int32], Single, Single]:
    """`first`, `twin` and `closer` of an axis of `size` cells whose faces are those `kept` of the finer ones [m]."""
    n = len(kept) - 1
    first = np.full(size, HALO + len(faces) - 1, dtype=np.int32)  # beyond the window the finer level has nothing either
    twin, closer = np.zeros(size, np.float32), np.ones(size, np.float32)
    first[:HALO] = np.arange(HALO)
    first[HALO : HALO + n] = kept[:-1] + HALO
    twin[HALO : HALO + n] = np.diff(kept) - 1
    fine, coarse = 0.5 * (faces[1:] + faces[:-1]), 0.5 * (faces[kept][1:] + faces[kept][:-1])
    closer[HALO + 1 : HALO + n] = np.diff(fine)[kept[1:-1] - 1] / np.diff(coarse)
    return first, twin, closer


def _parents(size: int, kept: NDArray[np.intp]) -> NDArray[np.int32]:
    """`parent` of an axis of `size` cells, of whose faces those `kept` stay."""
    inside = np.repeat(np.arange(len(kept) - 1), np.diff(kept)) + HALO
    after = np.full(size - HALO - len(inside), len(kept) - 1 + HALO)
    return np.concatenate([np.full(HALO, HALO - 1), inside, after]).astype(np.int32)


class Levels:
    """All levels of a grid, finest first, and the vectors of the conjugate gradients."""

    def __init__(self, metrics: Metrics) -> None:
        """Allocate for fields on a grid with these metrics."""
        x, y = metrics.xf[HALO : len(metrics.xf) - HALO], metrics.yf[HALO : len(metrics.yf) - HALO]
        narrowest, pz = float(min(np.diff(x).min(), np.diff(y).min())), len(metrics.dz)
        kept_x, kept_y = np.arange(len(x)), np.arange(len(y))
        shapes, row, cell, place_x, place_y = [], 0, 0, 0, 0
        joints: list[tuple[NDArray[Any], ...]] = []
        while True:
            finer_x, finer_y = x, y
            x, y = x[kept_x], y[kept_y]
            nx, ny = len(x) - 1, len(y) - 1
            py, half = ny + 2 * HALO, (nx + 2 * HALO) // 2 + 1
            along_x, along_y = _joints(2 * half, finer_x, kept_x), _joints(py, finer_y, kept_y)
            widest = 2.0 * WIDEST * narrowest * (1.0 + 1e-9)
            kept_x, kept_y, narrowest = join(x, widest), join(y, widest), 2.0 * narrowest
            both = (*zip(along_x, along_y, strict=True), (_parents(2 * half, kept_x), _parents(py, kept_y)))
            joints.append(tuple(array for pair in both for array in pair))
            shapes.append((row, cell, py, pz, half, place_x, place_y))
            row, cell = row + py * pz, cell + 2 * py * pz * half
            place_x, place_y = place_x + 2 * half, place_y + py
            if min(nx, ny) <= COARSEST:
                break
        start = np.full(row, HALO // 2, dtype=np.int32)
        values: list[NDArray[Any]] = [np.zeros(cell, dtype=np.float32) for _ in range(7)]
        values += [np.concatenate(parts) for parts in zip(*joints, strict=True)]
        self.store = Store(np.array(shapes), start, start.copy(), *values)
        fine = 2 * shapes[0][2] * shapes[0][3] * shapes[0][4]
        self.vectors = Vectors(*(np.zeros(fine) for _ in Vectors._fields))
        self.levels: list[Level] = [level_of(self.store, d) for d in range(len(shapes))]
        self.rhs = np.zeros((len(metrics.dy), pz, len(metrics.dx)))

    def clear(self) -> None:
        """Forget all values: after a solution that is not finite, as 0 times such a value is no 0."""
        for array in (*self.store[3:10], *self.vectors):
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
    j0, two, closer_y = coarse.first_y[j], coarse.twin_y[j] > ZERO, coarse.closer_y[j]
    first, twin, closer = coarse.first_x, coarse.twin_x, coarse.closer_x
    parent = fine.parent_x
    for k in range(nz):
        begin, end = span_of_rows(fine, j0, k, two)
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
                q, other = U(first[i]), twin[i]
                coarse.ax[p] = closer[i] * ax[q]
                coarse.ay[p] = closer_y * (ay[q] + other * ay[q + U(1)])
                coarse.az[p] = az[q] + other * az[q + U(1)]
                coarse.extra[p] = extra[q] + other * extra[q + U(1)]


@njit(cache=True, error_model="numpy")
def span_of_rows(level: Level, j: int, k: int, two: bool) -> tuple[int, int]:
    """Span of pairs that holds that of row j and, if there are `two`, j + 1."""
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
    j0, rows = coarse.first_y[j], 2 if coarse.twin_y[j] > ZERO else 1
    child, twin = coarse.first_x, coarse.twin_x
    for k in range(HALO, nz - HALO):
        r = j * nz + k
        if coarse.hi[r] <= coarse.lo[r]:
            continue
        begin, end = child[2 * coarse.lo[r]] // 2, (child[2 * coarse.hi[r] - 1] + 1) // 2 + 1
        if rows == 1:
            total[2 * begin : 2 * end] = ZERO
        for m in range(j0, j0 + rows):
            s = m % 2
            low = U(half) - U(1) if s == 0 else U(0) - U(half)
            high = U(half) if s == 0 else U(1) - U(half)
            first = U((2 * (m * nz + k) + s) * half + begin)
            place = U(2 * begin + s)
            for n in range(end - begin):
                p = first + U(n)
                h = x[p]
                rest = b[p] - extra[p] * h
                rest += ax[p] * (x[p + low] - h) + ax[p + high] * (x[p + high] - h)
                rest += ay[p] * (x[p - sy] - h) + ay[p + sy] * (x[p + sy] - h)
                rest += az[p] * (x[p - sz] - h) + az[p + sz] * (x[p + sz] - h)
                total[place + U(2 * n)] = rest if pivot[p] > ZERO else ZERO
        for s in range(2):
            first = U((2 * r + s) * coarse.half + coarse.lo[r])
            for n in range(coarse.hi[r] - coarse.lo[r]):
                i = U(2 * (coarse.lo[r] + n) + s)
                q = U(child[i])
                coarse.b[first + U(n)] = total[q] + twin[i] * total[q + U(1)]


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
