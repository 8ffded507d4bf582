"""Mobility maps: where a vehicle can cross, over depth, current and soil, with the chance that it does.

Every node of a map is a small sample (`exumob.mobility.crossing.Crossing` over scatter of soil and water and over the members of
the ensemble); the same draws serve all nodes, so that neighbours differ by what the map shows and not by luck. The grid
is refined where the verdict changes: a level halves the cells that go and no-go share, the others are interpolated.
"""

from __future__ import annotations

import functools
import itertools
import logging
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import xarray as xr
from scipy.stats import binomtest

from exumob.mobility.crossing import FAILURES, Crossing
from exumob.simulation.results import save_dataset
from exumob.support.arrays import Array
from exumob.support.checks import require_within
from exumob.support.provenance import parameters_json, provenance
from exumob.sweeps.run import Progress, sweep
from exumob.sweeps.sampling import Case, Choice, Distribution, LogNormal, Normal, sample

logger = logging.getLogger(__name__)

MEASURES = ("crossed", "speed", "drift", "slip", "power", "wheel_load", "tilt", "out_of_range")
CONFIDENCE = 0.95
"""Of the intervals (Wilson, J. Am. Stat. Assoc. 22 (1927) 209)."""

SCATTER: dict[str, Distribution] = {
    "soil.cohesion": LogNormal(1.0, 0.20),
    "soil.friction_angle": Normal(1.0, 0.05, 0.8, 1.2),
    "soil.k_phi": LogNormal(1.0, 0.20),
    "soil.shear_modulus_x": LogNormal(1.0, 0.20),
    "water.depth": Normal(1.0, 0.03, 0.9, 1.1),
    "water.current_speed": Normal(1.0, 0.10, 0.7, 1.3),
}
"""Factors on the values of a node, by name: what a survey leaves open. Ours; give your own."""


@dataclass(frozen=True)
class Axis:
    """One axis of a map: a parameter over a range, in 2^levels times `cells` steps."""

    name: str
    """Dotted name, as for sweeps"""
    low: float
    high: float
    cells: int = 4
    """Of the first level"""

    def __post_init__(self) -> None:
        if not self.low < self.high:
            raise ValueError(f"Axis {self.name}: low = {self.low} must be below high = {self.high}.")
        require_within(f"Axis {self.name}", 1, 1000, cells=self.cells)

    def values(self, level: int) -> Array:
        """Of the nodes at a level, shape (cells 2^level + 1,)."""
        return np.linspace(self.low, self.high, self.cells * 2**level + 1)


@dataclass(frozen=True)
class MobilityMap:
    """What is mapped and how finely."""

    crossing: Crossing
    x: Axis = Axis("water.current_speed", 0.0, 1.4)
    y: Axis = Axis("water.depth_ratio", 0.3, 0.7)
    panels: Mapping[str, Case] = field(default_factory=lambda: {"LETE sand": {"soil": "LETE sand"}})
    """Maps side by side: values by name of each, such as its soil"""
    scatter: Mapping[str, Distribution] = field(default_factory=lambda: dict(SCATTER))
    """Factors by name; empty: every node is one run"""
    draws: int = 16
    """Runs at a node"""
    members: bool = True
    """Whether each run uses one network of the ensemble, in turn, where networks are the water"""
    levels: int = 2
    """Times that the grid is refined"""
    seed: int = 0

    def __post_init__(self) -> None:
        for name in ("draws", "levels", "seed"):
            if not isinstance(getattr(self, name), int):
                raise ValueError(f"MobilityMap.{name} = {getattr(self, name)} must be a whole number.")
        require_within("MobilityMap", 1, 100_000, draws=self.draws)
        require_within("MobilityMap", 0, 8, "each level halves the cells.", levels=self.levels)
        if not self.panels:
            raise ValueError("MobilityMap.panels is empty; give one at least, such as {'LETE sand': {}}.")
        if self.x.name == self.y.name:
            raise ValueError(f"MobilityMap: x and y are both {self.x.name}; give two different names.")
        names = set(next(iter(self.panels.values())))
        for panel, case in self.panels.items():
            if set(case) != names:
                raise ValueError(
                    f"MobilityMap.panels: {panel!r} sets {', '.join(case) or 'nothing'}, the first one "
                    f"{', '.join(names) or 'nothing'}; set the same names in all."
                )
            for name in (self.x.name, self.y.name):
                if name in case:
                    raise ValueError(f"MobilityMap.panels: {panel!r} sets {name}, which is an axis; leave it out.")
        draws = self._factors()
        for case in self.panels.values():
            for x, y in itertools.product((self.x.low, self.x.high), (self.y.low, self.y.high)):
                for factors in draws:
                    tried = self.crossing.experiment.with_values(self._case(case, x, y, factors))
                    if (x, y) == (self.x.high, self.y.high):
                        tried.check()

    def _factors(self) -> list[Case]:
        """The draws: factors by name, and which network."""
        runs = self.draws if self.scatter else 1
        found = sample(runs, self.scatter, seed=self.seed) if self.scatter else [{}]
        experiment = self.crossing.experiment
        if self.members and self.scatter and experiment.hydrodynamics == "networks":
            members = Choice(tuple(range(experiment.member_count())))
            turn = members.quantile((np.arange(runs) + 0.5) / runs)
            order = np.random.default_rng(self.seed).permutation(runs)
            found = [case | {"hydrodynamics.member": int(turn[k])} for case, k in zip(found, order, strict=True)]
        return found

    def _case(self, panel: Case, x: float, y: float, factors: Case) -> Case:
        """Values of one run; those of the panel, the place on the map, scattered about both."""
        first = next(iter(self.panels.values()))
        values = {**{name: panel[name] for name in first}, self.x.name: float(x), self.y.name: float(y)}
        at = self.crossing.experiment.with_values(values)
        for name, factor in factors.items():
            if name == "hydrodynamics.member":
                values[name] = factor
            elif name == "water.depth" and "water.depth_ratio" in values:
                values["water.depth_ratio"] *= factor
            else:
                values[name] = factor * at.value(name)
        return values


def compute_map(
    wanted: MobilityMap, folder: str | Path, *, workers: int = 2, time_limit: float | None = 600.0, full: bool = False,
    progress: Callable[[str, Progress], None] | None = None,
) -> xr.Dataset:  # fmt: skip
    """Compute a map level by level; what is done is kept in the folder, and the same call goes on.

    Parameters
    ----------
    wanted : MobilityMap
    folder : path
        One sweep a level, and ``map.nc``.
    workers, time_limit
        As for `exumob.sweeps.sweep`.
    full : bool
        Compute every node of the finest level: to find out what refining costs in accuracy.
    progress : callable, optional
        Is told the level and how far its sweep has got.

    Returns
    -------
    xarray.Dataset
        Dims (panel, y, x): probability, probability_low, probability_high (Wilson); means of what `judge` gives;
        failure (the most frequent of those that failed, index of `FAILURES`; -1: interpolated); runs (0: interpolated).
        Attribute ``computed_share``: of the nodes. Runs out of time or killed do not count (a warning says how many);
        the next call tries them again.

    Raises
    ------
    ValueError
        If a case is refused.
    RuntimeError
        If a case fails for a reason that is not the vehicle's.
    """
    place = Path(folder)
    factors = wanted._factors()
    level, grid = 0, _Lattice(wanted, wanted.levels if full else 0)
    while True:
        pieces = 0
        while nodes := grid.wanted():
            cases = [
                wanted._case(wanted.panels[grid.panels[p]], grid.x[j], grid.y[i], draw)
                for p, i, j in nodes for draw in factors
            ]  # fmt: skip
            name = ("full" if full else f"level{level}") + (f"_{pieces}" if pieces else "")
            told = None if progress is None else functools.partial(progress, name)
            rows = sweep(
                wanted.crossing, cases, place / name, workers=workers, time_limit=time_limit, progress=told,
                again=("out of time", "killed"),
            )  # fmt: skip
            _check_rows(rows)
            grid.fill(nodes, rows, len(factors))
            grid.follow_border()
            pieces += 1
        if full or level == wanted.levels:
            break
        level, grid = level + 1, grid.refined()
    result = grid.dataset()
    result.attrs |= provenance() | {
        "title": "exumob mobility map", "random_seed": wanted.seed, "parameters": parameters_json({"map": wanted}),
        "draws": len(factors), "computed_share": float((grid.runs > 0).mean()), "failures": ", ".join(FAILURES),
        "x": wanted.x.name, "y": wanted.y.name, "least_speed": wanted.crossing.limits.speed,
        "largest_drift": wanted.crossing.limits.drift, "width": wanted.crossing.limits.width,
        "range_share": wanted.crossing.limits.range_share,
    }  # fmt: skip
    save_dataset(result, place / "map.nc")
    return result


def _check_rows(rows: xr.Dataset) -> None:
    """A case that could not be run is no vehicle that could not cross."""
    status = rows["status"].values
    for kind, error in (("refused", ValueError), ("failed", RuntimeError)):
        if kind in status:
            raise error(f"compute_map: a case was {kind}: {rows['reason'].values[np.argmax(status == kind)]}")
    lost = int(np.isin(status, ("out of time", "killed")).sum())
    if lost:
        logger.warning("mobility map: %d of %d runs were out of time or killed; they do not count", lost, len(status))


class _Lattice:
    """Nodes of one level, of all panels."""

    def __init__(self, wanted: MobilityMap, level: int) -> None:
        self.map, self.level = wanted, level
        self.panels = list(wanted.panels)
        self.x, self.y = wanted.x.values(level), wanted.y.values(level)
        shape = (len(self.panels), len(self.y), len(self.x))
        self.values = {name: np.full(shape, math.nan) for name in MEASURES}
        self.failure = np.full(shape, -1)
        self.runs = np.zeros(shape, int)
        self._wanted, self._tried = np.ones(shape, bool), np.zeros(shape, bool)

    def wanted(self) -> list[tuple[int, int, int]]:
        """Nodes to be computed."""
        return [(int(p), int(i), int(j)) for p, i, j in np.argwhere(self._wanted & ~self._tried)]

    def fill(self, nodes: Sequence[tuple[int, int, int]], rows: xr.Dataset, draws: int) -> None:
        """Take over the results, `draws` rows a node; runs that were lost do not count."""
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
        """Want the interpolated corners of cells that go and no-go turn out to share."""
        if self.level:
            self._wanted |= _corners_of(self._border())

    def _border(self) -> np.ndarray:
        """Cells whose corners disagree, where the answer counts, shape (p, n - 1, m - 1)."""
        go = self.values["crossed"] >= 0.5
        counts = self.values["out_of_range"] <= self.map.crossing.limits.range_share
        at = [(slice(None, -1), slice(None, -1)), (slice(None, -1), slice(1, None)),
              (slice(1, None), slice(None, -1)), (slice(1, None), slice(1, None))]  # fmt: skip
        some, every = (op([go[:, i, j] for i, j in at], axis=0) for op in (np.any, np.all))
        known = np.any([counts[:, i, j] for i, j in at], axis=0)
        return np.asarray(some & ~every & known)

    def refined(self) -> _Lattice:
        """Half the cell size: old nodes kept, cells on a border wanted, the rest interpolated."""
        fine = _Lattice(self.map, self.level + 1)
        for name, coarse in self.values.items():
            fine.values[name] = _between(coarse)
        for name in ("failure", "runs", "_tried"):
            getattr(fine, name)[:, ::2, ::2] = getattr(self, name)
        fine._wanted[:] = False
        fine._wanted |= _corners_of(np.repeat(np.repeat(self._border(), 2, axis=1), 2, axis=2))
        return fine

    def dataset(self) -> xr.Dataset:
        """As a Dataset."""
        dims = ("panel", "y", "x")
        low, high = np.full(self.runs.shape, math.nan), np.full(self.runs.shape, math.nan)
        for node in np.argwhere(self.runs > 0):
            n = tuple(node)
            runs = int(self.runs[n])
            bounds = binomtest(round(self.values["crossed"][n] * runs), runs).proportion_ci(CONFIDENCE, "wilson")
            low[n], high[n] = bounds.low, bounds.high
        interval = f"Wilson's interval, {100.0 * CONFIDENCE:.0f} %"
        texts = {
            "speed": ("m s-1", "speed ahead"), "drift": ("m", "to the left over the width"),
            "slip": ("1", "slip ratio"),
            "power": ("W", "power at the wheels"), "wheel_load": ("1", "share of the weight on the wheels"),
            "tilt": ("rad", "largest roll or pitch"), "out_of_range": ("1", "share of the time out of range"),
        }  # fmt: skip
        found = {
            name: (dims, self.values[name], {"units": unit, "long_name": f"{text}, mean of the runs that got so far"})
            for name, (unit, text) in texts.items()
        }
        return xr.Dataset(
            {
                "probability": (
                    dims,
                    self.values["crossed"],
                    {"units": "1", "long_name": "share of runs that crossed"},
                ),
                "probability_low": (dims, low, {"units": "1", "long_name": interval}),
                "probability_high": (dims, high, {"units": "1", "long_name": interval}),
                "failure": (
                    dims,
                    self.failure,
                    {"long_name": "most frequent failure, see the attribute failures; -1: interpolated"},
                ),
                "runs": (dims, self.runs, {"long_name": "runs at the node; 0: interpolated"}),
                **found,
            },
            coords={"panel": self.panels, "y": self.y, "x": self.x},
        )


def _corners_of(cells: np.ndarray) -> np.ndarray:
    """Nodes at the corners of cells, shape (p, n, m) -> (p, n + 1, m + 1)."""
    found = np.zeros((cells.shape[0], cells.shape[1] + 1, cells.shape[2] + 1), bool)
    for i, j in itertools.product((slice(None, -1), slice(1, None)), repeat=2):
        found[:, i, j] |= cells
    return found


def _between(coarse: Array) -> Array:
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
