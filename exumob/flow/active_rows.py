"""The rows of cells that kernels visit: most of the window is air.

Of a row (j, k) along x they visit the cells lo[j, k] <= i < hi[j, k]; where lo = hi, none.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import prange
from numpy.typing import NDArray

from exumob.flow.grid import HALO
from exumob.support.arrays import Array
from exumob.support.kernels import njit


class ActiveRows(NamedTuple):
    """Bounds of the visited cells of each row, halo included in the indices; shape (ny, nz) of padded fields."""

    lo: NDArray[np.int32]
    hi: NDArray[np.int32]

    @classmethod
    def empty(cls, padded_shape: tuple[int, int, int]) -> ActiveRows:
        """No cells at all."""
        start = np.full(padded_shape[:2], HALO, dtype=np.int32)
        return cls(start, start.copy())

    @classmethod
    def padded(cls, padded_shape: tuple[int, int, int]) -> ActiveRows:
        """Every cell, the outermost layer of the halo apart."""
        rows = cls.empty(padded_shape)
        rows.lo[:], rows.hi[:] = 1, 1
        rows.hi[1:-1, 1:-1] = padded_shape[2] - 1
        return rows

    @property
    def cells(self) -> int:
        """Number of cells visited."""
        return int(np.sum(self.hi - self.lo))


class WetCells(NamedTuple):
    """The water as the rows of the pressure's kernels take it (parallel loops take no record inside another)."""

    fraction: Array
    wet: NDArray[np.uint8]
    lo: NDArray[np.int32]
    hi: NDArray[np.int32]
    """Bounds of the rows of wet cells"""


class WaterCells(NamedTuple):
    """The water of one step: how full the cells are, and the rows that the kernels visit."""

    fraction: Array
    """Water per full cell [-]"""
    wet: NDArray[np.uint8]
    """1 in wet cells, those at least half full: the pressure is solved there"""
    wet_rows: ActiveRows
    """Rows of the wet cells"""
    active: ActiveRows
    """Rows one cell wider: all faces of wet cells"""
    water_rows: ActiveRows
    """Rows of the cells with any water"""
    swept: ActiveRows
    """One cell wider: the cells that the transport of the fraction may change, ..."""
    swept_faces: ActiveRows
    """... two cells: the faces it passes; its three sweeps together wet no cell that does not touch water"""
    near: ActiveRows
    """Some cells wider: where the velocity is kept up"""

    @classmethod
    def empty(cls, padded_shape: tuple[int, int, int]) -> WaterCells:
        """No water."""
        rows = (ActiveRows.empty(padded_shape) for _ in range(6))
        return cls(np.zeros(padded_shape), np.zeros(padded_shape, dtype=np.uint8), *rows)

    def find_rows(self, least: float, reach: int) -> None:
        """Mark the wet cells and find the rows.

        Parameters
        ----------
        least : float
            Fraction above which a cell counts as holding water [-].
        reach : int
            Cells round the water in `near`.
        """
        width = self.fraction.shape[2]
        mark_wet(self.fraction, self.wet, least, self.wet_rows, self.water_rows)
        widen(self.wet_rows, 1, self.active, width)
        widen(self.water_rows, 1, self.swept, width)
        widen(self.water_rows, 2, self.swept_faces, width)
        widen(self.water_rows, reach, self.near, width)


@njit(cache=True, error_model="numpy", parallel=True)
def mark_wet(
    fraction: Array, wet: NDArray[np.uint8], least: float, wet_rows: ActiveRows, water_rows: ActiveRows
) -> None:
    """Mark cells at least half full, and find the rows of these and of all cells holding more than `least` water."""
    ny, nz, nx = fraction.shape
    wet_lo = wet_rows.lo  # Numba drops writes through a tuple inside prange
    wet_hi = wet_rows.hi
    water_lo = water_rows.lo
    water_hi = water_rows.hi
    for j in prange(HALO, ny - HALO):
        for k in range(HALO, nz - HALO):
            c, w = fraction[j, k], wet[j, k]
            for i in range(HALO, nx - HALO):
                w[i] = 1 if c[i] >= 0.5 else 0
            first, last = HALO, nx - HALO
            while first < last and c[first] <= least:
                first += 1
            while last > first and c[last - 1] <= least:
                last -= 1
            water_lo[j, k], water_hi[j, k] = first, last
            while first < last and w[first] == 0:
                first += 1
            while last > first and w[last - 1] == 0:
                last -= 1
            wet_lo[j, k], wet_hi[j, k] = first, last


@njit(cache=True, error_model="numpy")
def widen(rows: ActiveRows, reach: int, out: ActiveRows, width: int) -> None:
    """Rows that also hold every cell within `reach` of those given along each axis, one cell of the halo included.

    Parameters
    ----------
    rows : ActiveRows
    reach : int
        [cells]
    out : ActiveRows, changed
    width : int
        Cells of a padded row.
    """
    ny, nz = rows.lo.shape
    for j in range(ny):
        for k in range(nz):
            out.lo[j, k], out.hi[j, k] = 1, 1
    for j in range(1, ny - 1):
        for k in range(1, nz - 1):
            low, high = width, 0
            for a in range(max(j - reach, 0), min(j + reach, ny - 1) + 1):
                for b in range(max(k - reach, 0), min(k + reach, nz - 1) + 1):
                    if rows.lo[a, b] < rows.hi[a, b]:
                        low, high = min(low, rows.lo[a, b]), max(high, rows.hi[a, b])
            if low < high:
                out.lo[j, k], out.hi[j, k] = max(low - reach, 1), min(high + reach, width - 1)


@njit(cache=True, error_model="numpy", parallel=True)
def clear_outside(fields: tuple[Array, ...], lo: NDArray[np.int32], hi: NDArray[np.int32], rows: ActiveRows) -> None:
    """Set fields to 0 in the cells of the old rows `lo`, `hi` that `rows` does not hold; the new become the old."""
    ny, nz = lo.shape
    new_lo, new_hi = rows
    for j in prange(ny):
        for k in range(nz):
            for q in fields:
                row = q[j, k]
                row[lo[j, k] : max(min(new_lo[j, k], hi[j, k]), lo[j, k])] = 0.0
                row[min(max(new_hi[j, k], lo[j, k]), hi[j, k]) : hi[j, k]] = 0.0
            lo[j, k], hi[j, k] = new_lo[j, k], new_hi[j, k]
