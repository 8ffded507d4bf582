"""Where the water is: per row of cells along x, the span that the kernels visit.

Most of the window is air. A row (j, k) has the span lo[j, k] <= i < hi[j, k]; an empty one has lo = hi.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from exumob.flow.grid import HALO
from exumob.states import Array


class Spans(NamedTuple):
    """Bounds of the visited cells of each row, halo included in the indices; shape (ny, nz) of padded fields."""

    lo: NDArray[np.int32]
    hi: NDArray[np.int32]

    @classmethod
    def empty(cls, padded_shape: tuple[int, int, int]) -> Spans:
        """No cells at all."""
        start = np.full(padded_shape[:2], HALO, dtype=np.int32)
        return cls(start, start.copy())

    @classmethod
    def whole(cls, padded_shape: tuple[int, int, int]) -> Spans:
        """Every cell of the window, without halo."""
        ny, nz, nx = padded_shape
        spans = cls.empty(padded_shape)
        spans.hi[HALO : ny - HALO, HALO : nz - HALO] = nx - HALO
        return spans

    @property
    def cells(self) -> int:
        """Number of cells visited."""
        return int(np.sum(self.hi - self.lo))


@njit(cache=True, error_model="numpy", parallel=True)
def mark_wet(fraction: Array, wet: NDArray[np.uint8], least: float, wet_spans: Spans, water_spans: Spans) -> None:
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


def widen(spans: Spans, reach: int, shape: tuple[int, int, int], out: Spans) -> None:
    """Spans that also hold every cell within `reach` cells of those given, along each axis."""
    ny, nz, nx = shape
    lo = np.where(spans.lo < spans.hi, spans.lo, nx)
    hi = np.where(spans.lo < spans.hi, spans.hi, 0)
    for axis in (0, 1):
        low, high = lo.copy(), hi.copy()
        for n in range(1, reach + 1):
            here, there = ((slice(n, None),), (slice(None, -n),)) if axis == 0 else (
                (slice(None), slice(n, None)), (slice(None), slice(None, -n)),
            )  # fmt: skip
            np.minimum(low[here], lo[there], out=low[here])
            np.minimum(low[there], lo[here], out=low[there])
            np.maximum(high[here], hi[there], out=high[here])
            np.maximum(high[there], hi[here], out=high[there])
        lo, hi = low, high
    any_water = lo < hi
    out.lo[:] = np.where(any_water, np.maximum(lo - reach, HALO), HALO)
    out.hi[:] = np.where(any_water, np.minimum(hi + reach, nx - HALO), HALO)
    for edge in (slice(None, HALO), slice(ny - HALO, None)):
        out.hi[edge] = out.lo[edge]
    for edge in (slice(None, HALO), slice(nz - HALO, None)):
        out.hi[:, edge] = out.lo[:, edge]
