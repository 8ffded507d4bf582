"""The nodes of a mobility map at one level of refinement, and the border of go and no-go along which it is refined.

A level halves the cells of the one before. Nodes that the border needs are computed; the others are interpolated.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

import numpy as np
import xarray as xr
from scipy.stats import binomtest

from exumob.support.arrays import Array

CONFIDENCE = 0.95
"""Confidence of the intervals of the probability (Wilson, J. Am. Stat. Assoc. 22 (1927) 209)."""
MEASURES = {
    "crossed": ("1", "share of runs that crossed"),
    "speed": ("m s-1", "speed ahead"),
    "drift": ("m", "to the left over the width"),
    "slip": ("1", "slip ratio"),
    "power": ("W", "power at the wheels"),
    "wheel_load": ("1", "share of the weight on the wheels"),
    "tilt": ("rad", "largest roll or pitch"),
    "out_of_range": ("1", "share of the time out of range"),
}
"""Numbers of a verdict (`exumob.mobility.crossing.judge_crossing`) that are averaged at a node: unit and meaning."""

Node = tuple[int, int, int]
"""Panel, row (y) and column (x)."""


class Lattice:
    """Nodes of one level, of all panels.

    Parameters
    ----------
    panels : list of str
        Names of the maps side by side.
    x, y : array, shapes (m,), (n,)
        Places of the nodes.
    range_share : float
        Share of the time outside the networks' training range beyond which a verdict does not count [-].
    refined : bool
        The lattice refines a coarser one: nothing is computed but what the border needs.
    """

    def __init__(self, panels: list[str], x: Array, y: Array, range_share: float, refined: bool = False) -> None:
        self.panels, self.x, self.y, self.range_share = panels, x, y, range_share
        self._refined = refined
        shape = (len(panels), len(y), len(x))
        self.values = {name: np.full(shape, math.nan) for name in MEASURES}
        self.failure = np.full(shape, -1)
        self.runs = np.zeros(shape, int)
        self._needed, self._tried = np.full(shape, not refined), np.zeros(shape, bool)

    def pending(self) -> list[Node]:
        """Nodes that are needed and have not been computed."""
        return [(int(p), int(i), int(j)) for p, i, j in np.argwhere(self._needed & ~self._tried)]

    def fill(self, nodes: Sequence[Node], rows: xr.Dataset, draws: int) -> None:
        """Take over the results of a sweep, `draws` rows a node; runs that were lost do not count."""
        ended = rows["status"].values == "completed"
        for n, node in enumerate(nodes):
            of = slice(n * draws, (n + 1) * draws)
            self._tried[node] = True
            self.runs[node] = ended[of].sum()
            for name in MEASURES:
                part = rows[name].values[of] if name in rows else np.full(draws, math.nan)
                part = part[ended[of] & np.isfinite(part)]
                self.values[name][node] = part.mean() if len(part) else math.nan
            failed = rows["failure"].values[of][ended[of]].astype(int) if "failure" in rows else np.zeros(0, int)
            failed = failed[failed > 0]
            self.failure[node] = np.bincount(failed).argmax() if len(failed) else 0

    def follow_border(self) -> None:
        """Need the interpolated corners of cells that turn out to lie on the border."""
        if self._refined:
            self._needed |= _corners_of(self._border())

    def _border(self) -> np.ndarray:
        """Cells whose corners disagree, where a verdict counts, shape (p, n - 1, m - 1)."""
        go = self.values["crossed"] >= 0.5
        counts = self.values["out_of_range"] <= self.range_share
        some, every = (op([go[:, i, j] for i, j in CORNERS], axis=0) for op in (np.any, np.all))
        known = np.any([counts[:, i, j] for i, j in CORNERS], axis=0)
        return np.asarray(some & ~every & known)

    def refined(self) -> Lattice:
        """Halve the cells: computed nodes are kept, cells on the border needed, the others interpolated."""
        x, y = (np.linspace(axis[0], axis[-1], 2 * len(axis) - 1) for axis in (self.x, self.y))
        fine = Lattice(self.panels, x, y, self.range_share, refined=True)
        for name, coarse in self.values.items():
            fine.values[name] = _interpolated(coarse)
        for name in ("failure", "runs", "_tried"):
            getattr(fine, name)[:, ::2, ::2] = getattr(self, name)
        fine._needed |= _corners_of(np.repeat(np.repeat(self._border(), 2, axis=1), 2, axis=2))
        return fine

    def dataset(self) -> xr.Dataset:
        """Probability with its interval, means of the verdicts, failures and numbers of runs; dims (panel, y, x)."""
        dims = ("panel", "y", "x")
        low, high = np.full(self.runs.shape, math.nan), np.full(self.runs.shape, math.nan)
        for node in np.argwhere(self.runs > 0):
            n = tuple(node)
            runs = int(self.runs[n])
            bounds = binomtest(round(self.values["crossed"][n] * runs), runs).proportion_ci(CONFIDENCE, "wilson")
            low[n], high[n] = bounds.low, bounds.high
        interval = {"units": "1", "long_name": f"Wilson's interval, {100.0 * CONFIDENCE:.0f} %"}
        failure = {"long_name": "most frequent failure, see the attribute failures; -1: interpolated"}
        unit, text = MEASURES["crossed"]
        variables = {
            "probability": (dims, self.values["crossed"], {"units": unit, "long_name": text}),
            "probability_low": (dims, low, interval),
            "probability_high": (dims, high, interval),
            "failure": (dims, self.failure, failure),
            "runs": (dims, self.runs, {"long_name": "runs at the node; 0: interpolated"}),
        }
        for name, (unit, text) in MEASURES.items():
            if name != "crossed":
                about = {"units": unit, "long_name": f"{text}, mean of the runs that got so far"}
                variables[name] = (dims, self.values[name], about)
        return xr.Dataset(variables, coords={"panel": self.panels, "y": self.y, "x": self.x})


CORNERS = tuple(itertools.product((slice(None, -1), slice(1, None)), repeat=2))
"""Rows and columns of the nodes at each of the four corners of all cells."""


def _corners_of(cells: np.ndarray) -> np.ndarray:
    """Nodes at the corners of cells, shape (p, n, m) -> (p, n + 1, m + 1)."""
    found = np.zeros((cells.shape[0], cells.shape[1] + 1, cells.shape[2] + 1), bool)
    for i, j in CORNERS:
        found[:, i, j] |= cells
    return found


def _interpolated(coarse: Array) -> Array:
    """Values at half the spacing, bilinear, shape (p, 2 n - 1, 2 m - 1)."""
    found = coarse
    for axis in (1, 2):
        length = found.shape[axis]
        fine = np.linspace(0.0, length - 1.0, 2 * length - 1)
        low = np.floor(fine).astype(int)
        high = np.minimum(low + 1, length - 1)
        share = np.expand_dims(fine - low, tuple(k for k in range(3) if k != axis))
        one, other = np.take(found, low, axis), np.take(found, high, axis)
        mixed = (1.0 - share) * one + share * other
        found = np.where(share == 0.0, one, mixed)  # nan of a neighbour must not spread
    return found
