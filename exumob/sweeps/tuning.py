"""Which values are best: Exudyn's optimisers on the same description of a case as sweeps use.

Every evaluation is kept in a file. The optimisers are deterministic for a given seed, so the same call after a stop
finds what it had computed and goes on from there.
"""

from __future__ import annotations

import functools
import hashlib
import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import xarray as xr

from exumob.simulation.result_files import save_dataset
from exumob.support.errors import SimulationError
from exumob.support.provenance import parameters_json, provenance
from exumob.sweeps.experiment import Experiment
from exumob.sweeps.runner import identity, write_whole
from exumob.sweeps.sampling import Case

FAILED = 1e6
"""Objective of a run that breaks down; finite, because the optimisers compute with it."""

Objective = Callable[[xr.Dataset], float]
Method = Literal["genetic", "minimize"]


@dataclass(frozen=True)
class Tuned:
    """Answer of `tune`."""

    best: Case
    """Values by dotted name"""
    objective: float
    """Of the best"""
    evaluations: xr.Dataset
    """All that was tried, along ``evaluation``: the parameters and ``objective``"""


def tune(
    experiment: Experiment, ranges: Mapping[str, tuple[float, float]], objective: Objective, folder: str | Path, *,
    cases: Sequence[Case] = ({},), method: Method = "genetic", start: Case | None = None, population: int = 24,
    generations: int = 6, tolerance: float = 1e-3, evaluations: int = 100, workers: int = 2, seed: int = 0,
) -> Tuned:  # fmt: skip
    """Find the values within ranges for which an objective is least.

    Parameters
    ----------
    experiment : Experiment
    ranges : mapping
        Lowest and highest value by dotted name.
    objective : callable
        Takes the Dataset of a run, returns what is to be small; a function at the top level of a module. Its own source
        tells the folder of one tuning from another's, not that of what it calls.
    folder : path
        Keeps each evaluation, and ``tuning.nc``.
    cases : sequence of dict
        Conditions (values by dotted name) over which the objective is averaged.
    method : str
        ``"genetic"`` (`exudyn.processing.GeneticOptimization`: global, `population` times `generations` evaluations,
        side by side) or ``"minimize"`` (`exudyn.processing.Minimize`: Nelder & Mead (1965) from `start`, local).
    start : dict, optional
        For ``"minimize"``; default: the middle of the ranges.
    tolerance, evaluations : float, int
        For ``"minimize"``: ends when the simplex is smaller than this share of the ranges, or after so many
        evaluations.
    workers : int
        Processes of ``"genetic"``.
    seed : int
        Of ``"genetic"``.

    Returns
    -------
    Tuned

    Raises
    ------
    ValueError
        If a name is not known, a range is empty, a value is refused, or the folder is of another tuning.
    RuntimeError
        If every run breaks down.
    """
    if not ranges:
        raise ValueError("tune.ranges is empty; give a range (low, high) for one name at least.")
    for name, (low, high) in ranges.items():
        if not (math.isfinite(low) and math.isfinite(high) and low < high):
            raise ValueError(f"tune.ranges: {name} = ({low}, {high}) must be finite, its lower end first.")
    if population < 4 or generations < 1 or workers < 1:
        raise ValueError(f"tune: population = {population} >= 4, generations = {generations} >= 1, workers >= 1.")
    if not cases:
        raise ValueError("tune.cases is empty; leave it out, or give one condition at least.")
    if start is not None and set(start) != set(ranges):
        raise ValueError(
            f"tune.start has the names {', '.join(start)}; it must have those of ranges: {', '.join(ranges)}."
        )
    if method not in ("genetic", "minimize"):
        raise ValueError(f"tune.method = {method!r} is not known; use 'genetic' or 'minimize'.")
    for case in cases:
        for end in (0, 1):
            experiment.with_values({**case, **{name: limits[end] for name, limits in ranges.items()}}).check()
    place = Path(folder)
    (place / "evaluations").mkdir(parents=True, exist_ok=True)
    mine = json.dumps({"experiment": identity(experiment), "objective": identity(objective), "cases": list(cases)})
    said = place / "tuning.json"
    if said.exists() and said.read_text() != mine:
        raise ValueError(f"{place} holds another tuning; give another folder, or remove it.")
    write_whole(said, mine)
    evaluate = _Evaluation(experiment, objective, tuple(cases), place / "evaluations")
    if method == "genetic":
        _genetic(evaluate, ranges, population, generations, workers, seed)
    else:
        first = start or {name: 0.5 * (low + high) for name, (low, high) in ranges.items()}
        _simplex(evaluate, ranges, first, tolerance, evaluations)
    result, reasons = _gathered(place, ranges)
    result.attrs |= {
        "random_seed": seed if method == "genetic" else "none (deterministic)",
        "settings": parameters_json(
            {"experiment": experiment, "ranges": dict(ranges), "cases": list(cases), "method": method, "start": start}
        ),
    }  # fmt: skip
    save_dataset(result, place / "tuning.nc")
    best = int(np.argmin(result["objective"].values))
    if float(result["objective"][best]) >= FAILED:
        raise RuntimeError(f"tune: every run broke down; the first: {next(iter(reasons), 'no reason is kept')}")
    return Tuned({n: float(result[n][best]) for n in ranges}, float(result["objective"][best]), result)


@dataclass(frozen=True)
class _Evaluation:
    """The objective as a function of the values, kept in files."""

    experiment: Experiment
    objective: Objective
    cases: tuple[Case, ...]
    folder: Path

    def __call__(self, values: Mapping[str, Any]) -> float:
        named = {name: float(value) for name, value in values.items() if name != "functionData"}
        text = json.dumps(named, sort_keys=True)
        file = self.folder / f"{hashlib.sha256(text.encode()).hexdigest()[:16]}.json"
        if file.exists():
            return float(json.loads(file.read_text())["objective"])
        found = [self._one({**case, **named}) for case in self.cases]
        result = float(np.mean([value for value, _ in found]))
        reason = next((text for _, text in found if text), "")
        of_cases = [value for value, _ in found]
        write_whole(file, json.dumps({"values": named, "objective": result, "of_cases": of_cases, "reason": reason}))
        return result

    def _one(self, values: Case) -> tuple[float, str]:
        """The objective, and why there is none."""
        try:
            run = self.experiment(values)
        except (SimulationError, ValueError) as error:
            return FAILED, str(error)
        found = float(self.objective(run))
        return (found, "") if math.isfinite(found) else (FAILED, f"the objective is {found}")


def _genetic(
    evaluate: _Evaluation, ranges: Mapping[str, tuple[float, float]], population: int, generations: int,
    workers: int, seed: int,
) -> None:  # fmt: skip
    from exudyn.processing import GeneticOptimization

    GeneticOptimization(
        functools.partial(_of_parameters, evaluate), dict(ranges), populationSize=population,
        numberOfGenerations=generations, elitistRatio=max(0.1, 1.0 / population), crossoverProbability=0.25,
        rangeReductionFactor=0.7, distanceFactor=0.0, randomizerInitialization=seed, showProgress=False,
        useMultiProcessing=workers > 1, numberOfThreads=workers,
    )  # fmt: skip


def _simplex(
    evaluate: _Evaluation, ranges: Mapping[str, tuple[float, float]], start: Case, tolerance: float, evaluations: int
) -> None:  # fmt: skip
    """In shares of the ranges, so that one tolerance fits all; the first simplex spans a tenth of each."""
    from exudyn.processing import Minimize

    shares = np.array([(float(start[n]) - low) / (high - low) for n, (low, high) in ranges.items()]).clip(0.0, 1.0)
    first = np.vstack([shares, *(shares + np.where(shares <= 0.5, 0.1, -0.1) * row for row in np.eye(len(shares)))])
    Minimize(
        functools.partial(_of_shares, evaluate, dict(ranges)), dict.fromkeys(ranges, (0.0, 1.0)),
        initialGuess=list(shares), method="Nelder-Mead", tol=tolerance,
        options={"maxfev": evaluations, "maxiter": evaluations, "fatol": FAILED, "initial_simplex": first},
        showProgress=False, storeFunctionValues=False,
    )  # fmt: skip


def _of_shares(
    evaluate: _Evaluation, ranges: Mapping[str, tuple[float, float]], shares: Mapping[str, Any]
) -> float:  # fmt: skip
    return evaluate({name: low + float(shares[name]) * (high - low) for name, (low, high) in ranges.items()})


def _of_parameters(evaluate: _Evaluation, parameters: Mapping[str, Any]) -> float:
    return evaluate(parameters)


def _gathered(folder: Path, ranges: Mapping[str, tuple[float, float]]) -> tuple[xr.Dataset, list[str]]:
    """Evaluations within the ranges, in the order in which they were made, and why some failed."""
    files = sorted((folder / "evaluations").glob("*.json"), key=lambda file: file.stat().st_mtime_ns)
    rows = [json.loads(file.read_text()) for file in files]
    rows = [
        row for row in rows
        if set(row["values"]) == set(ranges)
        and all(low - 1e-9 <= row["values"][name] <= high + 1e-9 for name, (low, high) in ranges.items())
    ]  # fmt: skip
    found = xr.Dataset(
        {"objective": ("evaluation", [row["objective"] for row in rows])},
        coords={name: ("evaluation", [row["values"][name] for row in rows]) for name in ranges},
        attrs=provenance() | {"title": "exumob tuning", "parameters": " ".join(ranges)},
    )
    return found, [row["reason"] for row in rows if row.get("reason")]
