"""Where the water is: per row of cells along x, the span that the kernels visit.

Most of the window is air. A row (j, k) has the span lo[j, k] <= i < hi[j, k]; an empty one has lo = hi.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from exumob.flow.grid import HALO
from exumob.support.arrays import Array


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
        spans = cls.empty(padded_shape)
        spans.lo[:], spans.hi[:] = 1, 1
        spans.hi[1:-1, 1:-1] = padded_shape[2] - 1
        return spans

    @property
    def cells(self) -> int:
        """Number of cells visited."""
        return int(np.sum(self.hi - self.lo))


@njit(cache=True, error_model="numpy", parallel=True)
def mark_wet(
    fraction: Array, wet: NDArray[np.uint8], least: float, wet_spans: ActiveRows, water_spans: ActiveRows
) -> None:
    """Mark cells at least half full, and find the spans of these and of all cells holding more than `least` water."""
    ny, nz, nx = fraction.shape
    wet_lo = wet_spans.lo  # Numba drops writes through a tuple inside prange
    wet_hi = wet_spans.hi
    water_lo = water_spans.lo
    water_hi = water_spans.hi
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
def widen(spans: ActiveRows, reach: int, out: ActiveRows, width: int) -> None:
    """ActiveRows that also hold every cell within `reach` of those given along each axis, one cell of the halo included.

    Parameters
    ----------
    spans : ActiveRows
    reach : int
        [cells]
    out : ActiveRows, changed
    width : int
        Cells of a padded row.
    """
    ny, nz = spans.lo.shape
    for j in range(ny):
        for k in range(nz):
            out.lo[j, k], out.hi[j, k] = 1, 1
    for j in range(1, ny - 1):
        for k in range(1, nz - 1):
            low, high = width, 0
            for a in range(max(j - reach, 0), min(j + reach, ny - 1) + 1):
                for b in range(max(k - reach, 0), min(k + reach, nz - 1) + 1):
                    if spans.lo[a, b] < spans.hi[a, b]:
                        low, high = min(low, spans.lo[a, b]), max(high, spans.hi[a, b])
            if low < high:
                out.lo[j, k], out.hi[j, k] = max(low - reach, 1), min(high + reach, width - 1)


@njit(cache=True, error_model="numpy", parallel=True)
def clear_outside(fields: tuple[Array, ...], lo: NDArray[np.int32], hi: NDArray[np.int32], spans: ActiveRows) -> None:
    """Set fields to 0 in the cells of the old spans `lo`, `hi` that `spans` does not hold; the old become the new."""
    ny, nz = lo.shape
    new_lo, new_hi = spans
    for j in prange(ny):
        for k in range(nz):
            for q in fields:
                row = q[j, k]
                row[lo[j, k] : max(min(new_lo[j, k], hi[j, k]), lo[j, k])] = 0.0
                row[min(max(new_hi[j, k], lo[j, k]), hi[j, k]) : hi[j, k]] = 0.0
            lo[j, k], hi[j, k] = new_lo[j, k], new_hi[j, k]
