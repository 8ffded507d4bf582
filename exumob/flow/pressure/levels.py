"""Levels of the multigrid (`exumob.flow.pressure.multigrid`): the cells that they join, and the storage of values.

Only x and y are coarsened: cells are flat seen from far, and columns are short. Neighbours are joined where they are
narrow; cells that stretching has made wide are not, until those of the core have caught up: relaxation does nothing
about errors that alternate along the wider side of a cell, so a coarser level must still show them.

Every row (j, k) is stored as its even cells followed by its odd ones, so that the cells of one colour and their
neighbours of the other are contiguous: cell i is number i // 2 of the half i % 2. Only pairs of cells inside the
rows of wet cells are visited. Outside them couplings and pivots are exact zeros.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from exumob.flow.grid import HALO, Metrics
from exumob.support.arrays import Array
from exumob.support.kernels import njit

Single = NDArray[np.float32]
COARSEST = 4
"""Cells along x or y at which coarsening stops."""
WIDEST = 1.4
"""Width of two joined cells, over that of two of the narrowest ones, up to which they are joined."""
ZERO = np.float32(0.0)
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
    """Share of surface and compliance in the diagonal [m]"""
    pivot: Single
    """Inverse pivots of the vertical lines; 0 where there is no unknown"""
    x: Single
    b: Single
    first_x: NDArray[np.int32]
    first_y: NDArray[np.int32]
    """The cell of the next finer level that a cell begins with, halo included"""
    is_pair_x: Single
    is_pair_y: Single
    """1 if it joins two of these, else 0"""
    distance_ratio_x: Single
    distance_ratio_y: Single
    """Distance of the finer cells on both sides of its low face over the distance of the cells themselves"""
    parent_x: NDArray[np.int32]
    parent_y: NDArray[np.int32]
    """The cell of the next coarser level to which a cell belongs"""


PLACES = np.dtype([(name, np.int64) for name in ("row", "cell", "ny", "nz", "half", "place_x", "place_y")])
"""Place of a level in the arrays of all: its first row, first cell, sizes, and first place along x and along y."""


class Store(NamedTuple):
    """All levels one after the other, for compiled code: a tuple of levels would be compiled anew for each number."""

    places: NDArray[Any]
    """Place of each level, finest first; its type is `PLACES`"""
    whole: Level
    """The arrays of all of them, one behind the other; its sizes are 0"""


class Vectors(NamedTuple):
    """Vectors of the conjugate gradients, flat, ordered as the finest level."""

    solution: Array
    residual: Array
    direction: Array
    product: Array


@njit(cache=True, error_model="numpy")
def level_of(store: Store, depth: int) -> Level:
    """Views of one level, 0 the finest."""
    at, w = store.places[depth], store.whole
    row, cell, place_x, place_y = at.row, at.cell, at.place_x, at.place_y
    rows, cells = row + at.ny * at.nz, cell + 2 * at.ny * at.nz * at.half
    end_x, end_y = place_x + 2 * at.half, place_y + at.ny
    return Level(
        at.ny, at.nz, at.half, w.lo[row:rows], w.hi[row:rows], w.ax[cell:cells], w.ay[cell:cells], w.az[cell:cells],
        w.extra[cell:cells], w.pivot[cell:cells], w.x[cell:cells], w.b[cell:cells], w.first_x[place_x:end_x],
        w.first_y[place_y:end_y], w.is_pair_x[place_x:end_x], w.is_pair_y[place_y:end_y],
        w.distance_ratio_x[place_x:end_x], w.distance_ratio_y[place_y:end_y],
        w.parent_x[place_x:end_x], w.parent_y[place_y:end_y],
    )  # fmt: skip


def join(faces: Array, widest: float) -> NDArray[np.intp]:
    """Numbers of an axis' faces [m] that stay when neighbours up to `widest` [m] together are joined in pairs."""
    kept, n = [0], 0
    while n < len(faces) - 1:
        n += 2 if n + 2 < len(faces) and faces[n + 2] - faces[n] <= widest else 1
        kept.append(n)
    return np.array(kept)


def _joints(size: int, faces: Array, kept: NDArray[np.intp]) -> tuple[NDArray[np.int32], Single, Single]:
    """`first`, `is_pair` and `distance_ratio` of an axis of `size` cells, whose faces are the `kept` finer ones [m]."""
    n = len(kept) - 1
    first = np.full(size, HALO + len(faces) - 1, dtype=np.int32)  # beyond the window the finer level has nothing either
    is_pair, distance_ratio = np.zeros(size, np.float32), np.ones(size, np.float32)
    first[:HALO] = np.arange(HALO)
    first[HALO : HALO + n] = kept[:-1] + HALO
    is_pair[HALO : HALO + n] = np.diff(kept) - 1
    fine, coarse = 0.5 * (faces[1:] + faces[:-1]), 0.5 * (faces[kept][1:] + faces[kept][:-1])
    distance_ratio[HALO + 1 : HALO + n] = np.diff(fine)[kept[1:-1] - 1] / np.diff(coarse)
    return first, is_pair, distance_ratio


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
        places, row, cell, place_x, place_y = [], 0, 0, 0, 0
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
            places.append((row, cell, py, pz, half, place_x, place_y))
            row, cell = row + py * pz, cell + 2 * py * pz * half
            place_x, place_y = place_x + 2 * half, place_y + py
            if min(nx, ny) <= COARSEST:
                break
        start = np.full(row, HALO // 2, dtype=np.int32)
        values: list[NDArray[Any]] = [np.zeros(cell, dtype=np.float32) for _ in range(7)]
        values += [np.concatenate(parts) for parts in zip(*joints, strict=True)]
        self.store = Store(np.array(places, dtype=PLACES), Level(0, 0, 0, start, start.copy(), *values))
        self.levels: list[Level] = [level_of(self.store, d) for d in range(len(places))]
        fine = len(self.levels[0].x)
        self.vectors = Vectors(*(np.zeros(fine) for _ in Vectors._fields))
        self.rhs = np.zeros((len(metrics.dy), pz, len(metrics.dx)))

    def clear(self) -> None:
        """Forget all values: after a solution that is not finite, as 0 times such a value is no 0."""
        whole = self.store.whole
        values = whole.ax, whole.ay, whole.az, whole.extra, whole.pivot, whole.x, whole.b
        for array in (*values, *self.vectors):
            array[:] = 0.0


@njit(cache=True, error_model="numpy", inline="always")
def beside(half: int, s: int) -> tuple[np.uintp, np.uintp]:
    """Steps from a cell of the even (s = 0) or odd (1) half of a row to its neighbours along x, low and high."""
    low = U(half) - U(1) if s == 0 else U(0) - U(half)
    high = U(half) if s == 0 else U(1) - U(half)
    return low, high


@njit(cache=True, error_model="numpy")
def clear_row(level: Level, j: int, lo: NDArray[np.int32], hi: NDArray[np.int32]) -> None:
    """Set what the last step left in row j to 0 and take new bounds of its pairs, one per k."""
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
