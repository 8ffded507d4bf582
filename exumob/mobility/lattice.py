"""The nodes of a mobility map at one level of refinement, and the border of go and no-go along which it is refined.

A level halves the cells of the one before. Nodes that the border needs are computed; the others are interpolated.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

import numpy as np
import xarray as xr
from numpy.typing import NDArray
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
    "wide_range": ("1", "share of the networks for the whole range in the loads"),
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

    def dataset(self, has_range: bool = True) -> xr.Dataset:
        """Probability with its interval, means of the verdicts, failures and numbers of runs; dims (panel, y, x).

        Parameters
        ----------
        has_range : bool
            Whether the model of the water has a training range; if not, ``out_of_range`` and ``wide_range`` are nan.
        """
        dims = ("panel", "y", "x")
        low, high = np.full(self.runs.shape, math.nan), np.full(self.runs.shape, math.nan)
        for node in np.argwhere(self.runs > 0):
            n = tuple(node)
            runs = int(self.runs[n])
            low[n], high[n] = wilson_interval(round(self.values["crossed"][n] * runs), runs)
        bound = f"bound of the chance to cross: Wilson's interval, {100.0 * CONFIDENCE:.0f} %"
        failure = "most frequent failure, index of the attribute failures; -1: interpolated"
        unit, text = MEASURES["crossed"]
        variables = {
            "probability": (dims, self.values["crossed"], {"units": unit, "long_name": text}),
            "probability_low": (dims, low, {"units": "1", "long_name": f"lower {bound}"}),
            "probability_high": (dims, high, {"units": "1", "long_name": f"upper {bound}"}),
            "failure": (dims, self.failure, {"units": "1", "long_name": failure}),
            "runs": (dims, self.runs, {"units": "1", "long_name": "runs at the node; 0: interpolated"}),
        }
        for name, (unit, text) in MEASURES.items():
            if name != "crossed":
                about = {"units": unit, "long_name": f"{text}, mean of the runs that got so far"}
                variables[name] = (dims, self.values[name], about)
        if not has_range:
            text = "nan: the model of the water has no training range"
            nothing = (dims, np.full(self.runs.shape, math.nan), {"units": "1", "long_name": text})
            variables |= {"out_of_range": nothing, "wide_range": nothing}
        return xr.Dataset(variables, coords={"panel": self.panels, "y": self.y, "x": self.x})


def wilson_interval(crossed: int, runs: int) -> tuple[float, float]:
    """Return Wilson's interval of the chance to cross, if so many of so many runs did [-]."""
    bounds = binomtest(crossed, runs).proportion_ci(CONFIDENCE, "wilson")
    return float(bounds.low), float(bounds.high)


def fewest_runs(level: float = 0.5) -> int:
    """Return the smallest number of runs a node that can tell a chance from `level`: all of them end the same."""
    return next(runs for runs in range(1, 1000) if wilson_interval(runs, runs)[0] > level)


def sides(low: Array, high: Array, level: float) -> NDArray[np.int8]:
    """Return on which side of a level the chance is for sure at each node: 1 above, -1 below, 0 not decided."""
    return np.where(low > level, 1, np.where(high < level, -1, 0)).astype(np.int8)


def separated_cells(low: Array, high: Array, level: float) -> NDArray[np.bool_]:
    """Find the cells in which a line of equal chance is supported by the nodes' intervals.

    Along each row and column of nodes the line passes between two nodes that lie for sure on either side of it, with
    none between them that is decided. The cells along that stretch are those that count.

    Parameters
    ----------
    low, high : array, shape (n, m)
        Bounds of the chance at the nodes; nan where a node was not computed.
    level : float
        The chance of the line.

    Returns
    -------
    array of bool, shape (n - 1, m - 1)
    """
    side = sides(low, high, level)
    found = np.zeros((side.shape[0] - 1, side.shape[1] - 1), bool)
    for nodes, cells in ((side, found), (side.T, found.T)):
        for i, row in enumerate(nodes):
            decided = np.flatnonzero(row)
            for one, other in itertools.pairwise(decided):
                if row[one] != row[other]:
                    cells[max(i - 1, 0) : i + 1, one:other] = True
    return found


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
