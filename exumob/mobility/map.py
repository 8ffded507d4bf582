"""Mobility maps: where a vehicle can cross, over depth, current and soil, with the chance that it does.

Every node of a map is a small sample (`exumob.mobility.crossing.Crossing` over scatter of soil and water and over the
members of the ensemble). The same draws serve all nodes, so that neighbours differ by what the map shows and not by
chance. The grid is refined where the verdict changes (`exumob.mobility.lattice`).
"""

from __future__ import annotations

import functools
import itertools
import json
import logging
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from exumob.mobility.crossing import FAILURES, Crossing
from exumob.mobility.lattice import CONFIDENCE, Lattice, fewest_runs, sides
from exumob.simulation.result_files import save_dataset
from exumob.support.arrays import Array
from exumob.support.cost import require_memory
from exumob.support.declared import Declared, checked
from exumob.support.files import atomic_write, require_folder_name
from exumob.support.provenance import parameters_json, provenance
from exumob.support.quantities import Quantity, Unusual
from exumob.support.wording import whence
from exumob.surrogates.vehicle_shape import FURTHER_GEOMETRY, GEOMETRY
from exumob.sweeps.run import Progress, sweep
from exumob.sweeps.sampling import (
    ANY,
    SEED,
    Case,
    Choice,
    Distribution,
    LogNormal,
    Normal,
    require_room_for,
    sample,
)
from exumob.sweeps.trust_of_sweep import OUTSIDE, WIDE, trust_of_sweep

logger = logging.getLogger(__name__)

TRIED_DRAWS = 64
"""Number of draws up to which each is tried before anything runs; of more the extreme ones."""
NODE_BYTES = 200
"""Memory for a node of the finest level: its sums, and the variables of the result."""
SCATTER: dict[str, Distribution] = {
    "soil.cohesion": LogNormal(1.0, 0.20),
    "soil.friction_angle": Normal(1.0, 0.05, 0.8, 1.2),
    "soil.k_phi": LogNormal(1.0, 0.20),
    "soil.shear_modulus_x": LogNormal(1.0, 0.20),
    "water.depth": Normal(1.0, 0.03, 0.9, 1.1),
    "water.current_speed": Normal(1.0, 0.10, 0.7, 1.3),
}
"""Factors on the values of a node, by name: the uncertainty that a survey leaves. Chosen by us; give your own."""


@dataclass(frozen=True)
class Axis(Declared):
    """One axis of a map: a parameter over a range, in 2^levels times `cells` steps."""

    name: str
    """Dotted name, as for sweeps"""
    low: Annotated[float, ANY]
    """Value at the first node"""
    high: Annotated[float, ANY]
    """Value at the last node"""
    cells: Annotated[int, Quantity("1", at_least=1.0, at_most=1000.0)] = 4
    """Number of steps at the first level"""

    def _check(self) -> None:
        if not self.low < self.high:
            raise ValueError(f"Axis {self.name}: low = {self.low} must be below high = {self.high}.")

    def value(self, place: float) -> float:
        """A value along the axis; it may be unusual where the ends may."""
        return Unusual(place) if isinstance(self.low, Unusual) or isinstance(self.high, Unusual) else float(place)

    def values(self, level: int) -> Array:
        """Values at the nodes of a level, shape (cells 2^level + 1,)."""
        return np.linspace(self.low, self.high, self.cells * 2**level + 1)


@dataclass(frozen=True)
class MobilityMap(Declared):
    """Description of a map: what is mapped, over which range and how finely."""

    crossing: Crossing
    x: Axis = Axis("water.current_speed", 0.0, 1.4)
    y: Axis = Axis("water.depth_ratio", 0.3, 0.7)
    panels: Mapping[str, Case] = field(default_factory=lambda: {"LETE sand": {"soil": "LETE sand"}})
    """Maps side by side: values by name of each, such as its soil"""
    scatter: Mapping[str, Distribution] = field(default_factory=lambda: dict(SCATTER))
    """Factors by name; empty: every node is one run"""
    draws: Annotated[int, Quantity("1", at_least=1.0, at_most=1e5)] = 16
    """Number of runs at a node"""
    members: bool = True
    """Let the runs use one network of the ensemble each, in turn, if networks give the loads of the water"""
    levels: Annotated[int, Quantity("1", at_least=0.0, at_most=8.0, remedy="each level halves the cells.")] = 2
    """Number of times that the grid is refined"""
    seed: Annotated[int, SEED] = 0
    """The same seed gives the same draws"""

    def _check(self) -> None:
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
        cells, fine = (self.x.cells, self.y.cells), 2**self.levels
        runs = len(self.panels) * (self.draws if self.scatter else 1)
        require_room_for("MobilityMap", runs * math.prod(n + 1 for n in cells), len(self.scatter) + 3)
        nodes = len(self.panels) * math.prod(n * fine + 1 for n in cells)
        require_memory(
            f"MobilityMap: {nodes:,} nodes of the finest level", nodes * NODE_BYTES, "give fewer levels or cells."
        )
        ends = [{axis.name: end} for axis in (self.x, self.y) for end in (axis.low, axis.high)]
        one_model = self.crossing.experiment.with_one_model([*self.panels.values(), *ends], self.scatter)
        object.__setattr__(self, "crossing", replace(self.crossing, experiment=one_model))
        draws = _extreme(self.factors())
        shaped = any(name in (*GEOMETRY, *FURTHER_GEOMETRY) for name in self.scatter)
        for case in self.panels.values():
            for x, y in itertools.product((self.x.low, self.x.high), (self.y.low, self.y.high)):
                for n, factors in enumerate(draws):
                    tried = self.crossing.experiment.with_values(self.case(case, x, y, factors))
                    if (x, y) == (self.x.high, self.y.high) and (n == 0 or shaped):
                        tried.check()

    def trust(self, mapped: xr.Dataset) -> dict[str, str | float]:
        """Say what the runs of the map are worth, as attributes (see `trust_of_sweep`).

        Parameters
        ----------
        mapped : xarray.Dataset
            What its nodes found. Of those that are not hatched it counts which networks answered.
        """
        corners = itertools.product((self.x.low, self.x.high), (self.y.low, self.y.high))
        cases = [self.case(panel, x, y, {}) for x, y in corners for panel in self.panels.values()]
        told = mapped.where(mapped["out_of_range"] <= self.crossing.limits.range_share)
        found = {
            name: np.full(len(cases), np.nan_to_num(float(told[variable].max())))
            for name, variable in ((OUTSIDE, "out_of_range"), (WIDE, "wide_range"))
        }
        return trust_of_sweep(self.crossing.experiment, cases, found)

    def current_from(self) -> str:
        """Say from where the current comes; empty if there is none, if that varies, or is that of a field."""
        water, start = self.crossing.experiment.water, self.crossing.experiment.start
        names = {self.x.name, self.y.name, *self.scatter, *(name for panel in self.panels.values() for name in panel)}
        if water is None or water.field is not None or names & {"water.current_direction", "start.heading"}:
            return ""
        if water.current_speed == 0.0 and "water.current_speed" not in names:
            return ""
        return whence(water.current_direction, start.heading)

    def factors(self) -> list[Case]:
        """Draw the runs of a node: factors by name, and the number of the network."""
        runs = self.draws if self.scatter else 1
        found = sample(runs, self.scatter, seed=self.seed) if self.scatter else [{}]
        experiment = self.crossing.experiment
        if self.members and self.scatter and experiment.hydrodynamics == "networks":
            members = Choice(tuple(range(experiment.member_count())))
            turn = members.quantile((np.arange(runs) + 0.5) / runs)
            order = np.random.default_rng(self.seed).permutation(runs)
            found = [case | {"hydrodynamics.member": int(turn[k])} for case, k in zip(found, order, strict=True)]
        return found

    def case(self, panel: Case, x: float, y: float, factors: Case) -> Case:
        """Values of one run: those of a panel and of a place on the map, each times its factor."""
        first = next(iter(self.panels.values()))
        values = {**{name: panel[name] for name in first}, self.x.name: self.x.value(x), self.y.name: self.y.value(y)}
        at = self.crossing.experiment.with_values(values)
        for name, factor in factors.items():
            if name == "hydrodynamics.member":
                values[name] = factor
            elif name == "water.depth" and "water.depth_ratio" in values:
                values["water.depth_ratio"] *= factor
            else:
                values[name] = factor * at.value(name)
        return values


def _extreme(draws: list[Case]) -> list[Case]:
    """Of many draws those with the smallest and the largest factor of each name, and the first."""
    if len(draws) <= TRIED_DRAWS:
        return draws
    chosen = {0}
    for name in draws[0]:
        factors = [draw[name] for draw in draws]
        if all(isinstance(factor, int | float) for factor in factors):
            chosen |= {int(np.argmin(factors)), int(np.argmax(factors))}
    return [draws[n] for n in sorted(chosen)]


def table(mapped: xr.Dataset) -> Any:
    """Return the nodes of a map as a table (pandas) for people: names with units in the header, failures in words.

    Parameters
    ----------
    mapped : xarray.Dataset
        Result of `compute_map`.
    """
    failures = mapped.attrs["failures"].split(", ")
    words = [failures[k] if k >= 0 else "interpolated" for k in mapped["failure"].values.ravel()]
    named = mapped.assign(failure=(mapped["failure"].dims, np.reshape(words, mapped["failure"].shape)))
    rows = named.to_dataframe().reset_index()
    headers = {name: _header(name, mapped[name].attrs.get("units", "1")) for name in map(str, mapped.variables)}
    headers |= {dim: _header(mapped.attrs[dim], mapped[dim].attrs.get("units", "1")) for dim in ("x", "y")}
    return rows.rename(columns=headers | {"failure": "failure", "panel": "panel"})


def verdict_lines(mapped: xr.Dataset) -> list[str]:
    """Count the verdicts at the nodes that were computed, a line of text for each panel, and say how sure they are.

    Parameters
    ----------
    mapped : xarray.Dataset
        Result of `compute_map`.
    """
    has_range = bool(mapped["out_of_range"].notnull().any())
    lines = []
    for panel in mapped["panel"].values:
        at = mapped.sel(panel=panel)
        computed = at["runs"].values > 0
        outside = computed & (np.nan_to_num(at["out_of_range"].values) > mapped.attrs["range_share"])
        counts = computed & ~outside
        go = counts & (at["probability"].values >= 0.5)
        beyond = f", outside the training range at {int(outside.sum())}" if has_range else ""
        rest = int((~computed).sum())
        lines.append(
            f"{panel}: go at {int(go.sum())}, no go at {int((counts & ~go).sum())}{beyond} of {int(computed.sum())} "
            f"computed nodes{f' ({rest} more are interpolated)' if rest else ''}; {_how_sure(at, counts)}"
        )
    if not has_range:
        lines.append("This model of the water has no training range: it is not hatched where it does not hold.")
    return lines


def _how_sure(at: xr.Dataset, counts: NDArray[np.bool_]) -> str:
    """Say at how many of the nodes that count the runs decide between go and no-go."""
    runs = int(at["runs"].max())
    if runs <= 1:
        return "one run a node, without scatter: no chance is known."
    if runs < fewest_runs():
        return f"{runs} runs decide at none of them, {fewest_runs()} could."
    side = sides(at["probability_low"].values, at["probability_high"].values, 0.5)
    return (
        f"{runs} runs decide at {int((counts & (side > 0)).sum())} and {int((counts & (side < 0)).sum())} of these "
        f"({100.0 * CONFIDENCE:.0f} % interval)."
    )


def _header(name: str, unit: str) -> str:
    return f"{name} [{'-' if unit == '1' else unit.replace('m s-1', 'm/s')}]"


def _claim(place: Path, wanted: MobilityMap) -> None:
    """Note which map the folder holds.

    Raises
    ------
    ValueError
        If it holds another one.
    """
    file = place / "map.json"
    description = json.loads(parameters_json({"map": wanted}))["map"]["MobilityMap"]
    description.pop("levels")  # a map may be refined further
    experiment = wanted.crossing.experiment
    if experiment.networks:  # by their contents, wherever the files lie
        description["crossing"]["experiment"]["networks"] = experiment.beyond_its_fields()["ensemble"]
    if file.is_file():
        try:
            kept = json.loads(file.read_text())
        except ValueError:
            raise ValueError(f"{file} is damaged; remove {place}, or give another folder.") from None
        changed = _differences(kept, description)
        if changed:
            more = f", and {len(changed) - 3} more" if len(changed) > 3 else ""
            raise ValueError(
                f"{place} holds another map: {'; '.join(changed[:3])}{more}. Give another folder, or remove it."
            )
        return
    place.mkdir(parents=True, exist_ok=True)
    with atomic_write(file) as temporary:
        temporary.write_text(json.dumps(description))


def _differences(kept: Any, wanted: Any, name: str = "") -> list[str]:
    if isinstance(kept, dict) and isinstance(wanted, dict):
        parts = [
            _differences(kept.get(k), wanted.get(k), f"{name}.{k}".lstrip(".")) for k in dict.fromkeys([*kept, *wanted])
        ]
        return [text for part in parts for text in part]
    return [] if kept == wanted else [f"{name} was {kept}, and is {wanted}"]


@checked
def compute_map(
    wanted: MobilityMap, folder: str | Path, *, workers: int = 2, time_limit: float | None = 600.0, full: bool = False,
    progress: Callable[[str, Progress], None] | None = None,
) -> xr.Dataset:  # fmt: skip
    """Compute a map level by level; finished runs are kept in the folder, and the same call continues after a stop.

    Parameters
    ----------
    wanted : MobilityMap
    folder : path
        Folder that keeps a sweep for each level, and ``map.nc``.
    workers, time_limit
        As for `exumob.sweeps.sweep`.
    full : bool
        Compute every node of the finest level, to find out what refining costs in accuracy.
    progress : callable, optional
        Called with the name of the level and how far its sweep has got.

    Returns
    -------
    xarray.Dataset
        Dims (panel, y, x): probability, probability_low, probability_high (Wilson); means of the numbers of
        `exumob.mobility.crossing.judge_crossing`; failure (the most frequent of those that failed, index of `FAILURES`;
        -1: interpolated); runs (0: interpolated). Attributes: ``computed_share``, the share of the nodes that were
        computed; ``runs_made``, ``runs_broke_down``, ``runs_lost``, numbers of runs. Runs out of time or killed do not
        count (a warning counts them); the next call tries them again.

    Raises
    ------
    ValueError
        If a case is refused.
    RuntimeError
        If a case fails with another error than a breakdown of the simulation.
    """
    require_folder_name("compute_map.folder", folder)
    place = Path(folder)
    _claim(place, wanted)
    factors = wanted.factors()
    limits = wanted.crossing.limits
    level = wanted.levels if full else 0
    lattice = Lattice(list(wanted.panels), wanted.x.values(level), wanted.y.values(level), limits.range_share)
    counts = {"runs_made": 0, "runs_broke_down": 0, "runs_lost": 0}
    while True:
        pieces = 0
        while nodes := lattice.pending():
            cases = [
                wanted.case(wanted.panels[lattice.panels[p]], lattice.x[j], lattice.y[i], draw)
                for p, i, j in nodes for draw in factors
            ]  # fmt: skip
            name = ("full" if full else f"level{level}") + (f"_{pieces}" if pieces else "")
            report = None if progress is None else functools.partial(progress, name)
            rows = sweep(
                wanted.crossing, cases, place / name, workers=workers, time_limit=time_limit, progress=report,
                again=("out of time", "killed"),
            )  # fmt: skip
            _check_rows(rows)
            counts["runs_made"] += rows.sizes["case"]
            counts["runs_broke_down"] += int((rows["failure"] == FAILURES.index("broke down")).sum())
            counts["runs_lost"] += int(np.isin(rows["status"].values, ("out of time", "killed")).sum())
            lattice.fill(nodes, rows, len(factors))
            lattice.follow_border()
            pieces += 1
        if level == wanted.levels:
            break
        level, lattice = level + 1, lattice.refined()
    has_range = wanted.crossing.experiment.hydrodynamics == "networks"
    result = lattice.dataset(has_range)
    for dim, axis in (("x", wanted.x), ("y", wanted.y)):
        unit, text = wanted.crossing.experiment.meaning(axis.name)
        result[dim].attrs |= {"units": unit, "long_name": text}
    result["panel"].attrs |= {"units": "1", "long_name": "name of the map"}
    result.attrs |= provenance() | wanted.trust(result) | counts | {
        "title": "exumob mobility map", "random_seed": wanted.seed, "parameters": parameters_json({"map": wanted}),
        "draws": len(factors), "computed_share": float((lattice.runs > 0).mean()), "failures": ", ".join(FAILURES),
        "vehicle": wanted.crossing.experiment.vehicle.name, "current_from": wanted.current_from(),
        "x": wanted.x.name, "y": wanted.y.name, "least_speed": limits.speed, "largest_drift": limits.drift,
        "width": limits.width, "range_share": limits.range_share,
        "training_range": "of the networks" if has_range else "none: this model of the water has none",
    }  # fmt: skip
    save_dataset(result, place / "map.nc")
    return result


def _check_rows(rows: xr.Dataset) -> None:
    """Raise an error if a case could not be run: it must not count as a vehicle that could not cross."""
    status = rows["status"].values
    for kind, error in (("refused", ValueError), ("failed", RuntimeError)):
        if kind in status:
            raise error(f"compute_map: a case was {kind}: {rows['reason'].values[np.argmax(status == kind)]}")
    lost = int(np.isin(status, ("out of time", "killed")).sum())
    if lost:
        logger.warning("mobility map: %d of %d runs were out of time or killed; they do not count", lost, len(status))
