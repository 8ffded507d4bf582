"""Finding the best values: Exudyn's optimisers on the same description of a case as sweeps use.

Every evaluation is kept in a file. The optimisers are deterministic for a given seed, so the same call after a stop
finds what it had computed and continues from there.
"""

from __future__ import annotations

import functools
import hashlib
import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from exumob.simulation.result_files import save_dataset
from exumob.support.checks import require_positive, require_within
from exumob.support.errors import SimulationError
from exumob.support.provenance import parameters_json, provenance
from exumob.sweeps.case_store import StorageError, write_text
from exumob.sweeps.experiment import Experiment
from exumob.sweeps.sampling import Case

FAILED = 1e6
"""Objective of a run that breaks down; finite, because the optimisers compute with it."""

Objective = Callable[[xr.Dataset], float]
"""Takes the Dataset of a run, returns the number that is to be small."""
Ranges = Mapping[str, tuple[float, float]]
"""Lowest and highest value by dotted name."""


@dataclass(frozen=True)
class Genetic:
    """Global search with `exudyn.processing.GeneticOptimization`: `population` times `generations` evaluations."""

    population: int = 24
    """Evaluations of a generation"""
    generations: int = 6
    workers: int = 2
    """Number of processes"""
    seed: int = 0

    def __post_init__(self) -> None:
        require_within("Genetic", 4, 1_000_000, population=self.population)
        require_within("Genetic", 1, 1_000_000, generations=self.generations)
        require_within("Genetic", 1, 4096, workers=self.workers)


@dataclass(frozen=True)
class Simplex:
    """Local search with `exudyn.processing.Minimize` (Nelder & Mead, Comput. J. 7 (1965) 308)."""

    start: Case | None = None
    """Where the search begins, by dotted name, such as a `Tuned.best`; None: the middle of the ranges"""
    tolerance: float = 1e-3
    """The search ends when the simplex is smaller than this share of the ranges [-]"""
    evaluations: int = 100
    """The search ends after so many evaluations at the latest"""

    def __post_init__(self) -> None:
        require_positive("Simplex", tolerance=self.tolerance)
        require_within("Simplex", 1, 1_000_000, evaluations=self.evaluations)


@dataclass(frozen=True)
class Tuned:
    """Answer of `tune`."""

    best: Case
    """Values by dotted name"""
    objective: float
    """Objective of the best values"""
    evaluations: xr.Dataset
    """All that was tried, along ``evaluation``: the parameters and ``objective``"""


def tune(
    experiment: Experiment, ranges: Ranges, objective: Objective, folder: str | Path, *,
    cases: Sequence[Case] = ({},), method: Genetic | Simplex = Genetic(),
) -> Tuned:  # fmt: skip
    """Find the values within ranges for which an objective is least.

    Parameters
    ----------
    experiment : Experiment
    ranges : mapping
        Lowest and highest value by dotted name.
    objective : callable
        Takes the Dataset of a run, returns the number that is to be small; a function at the top level of a module.
        Another tuning is recognised by its source, not by that of what it calls.
    folder : path
        Folder that keeps each evaluation, and ``tuning.nc``.
    cases : sequence of dict
        Conditions (values by dotted name) over which the objective is averaged.
    method : Genetic or Simplex
        The optimiser with its settings.

    Returns
    -------
    Tuned

    Raises
    ------
    ValueError
        If a name is not known, a range is empty, a value is refused, or the folder holds another tuning.
    RuntimeError
        If every run breaks down.
    """
    _check(experiment, ranges, cases, method)
    ends = [{name: limits[end] for name, limits in ranges.items()} for end in (0, 1)]
    experiment = experiment.with_one_model([*cases, *ends])
    place = Path(folder)
    (place / "evaluations").mkdir(parents=True, exist_ok=True)
    _check_folder(place / "tuning.json", experiment, objective, cases)
    evaluate = _Evaluation(experiment, objective, tuple(cases), place / "evaluations")
    if isinstance(method, Genetic):
        _genetic(evaluate, ranges, method)
    else:
        _simplex(evaluate, ranges, method)
    result, reasons = _gathered(place, ranges)
    genetic = isinstance(method, Genetic)
    result.attrs |= {
        "random_seed": method.seed if isinstance(method, Genetic) else "none (deterministic)",
        "settings": parameters_json(
            {
                "experiment": experiment, "ranges": dict(ranges), "cases": list(cases),
                "method": "genetic" if genetic else "minimize", "start": getattr(method, "start", None),
            }
        ),
    }  # fmt: skip
    save_dataset(result, place / "tuning.nc")
    best = int(np.argmin(result["objective"].values))
    if float(result["objective"][best]) >= FAILED:
        raise RuntimeError(f"tune: every run broke down; the first: {next(iter(reasons), 'no reason is kept')}")
    return Tuned({n: float(result[n][best]) for n in ranges}, float(result["objective"][best]), result)


def _check(experiment: Experiment, ranges: Ranges, cases: Sequence[Case], method: Genetic | Simplex) -> None:
    """Raise ValueError if a request cannot be fulfilled, before anything runs."""
    if not ranges:
        raise ValueError("tune.ranges is empty; give a range (low, high) for one name at least.")
    for name, (low, high) in ranges.items():
        if not (math.isfinite(low) and math.isfinite(high) and low < high):
            raise ValueError(f"tune.ranges: {name} = ({low}, {high}) must be finite, its lower end first.")
    if not cases:
        raise ValueError("tune.cases is empty; leave it out, or give one condition at least.")
    if not isinstance(method, Genetic | Simplex):
        raise ValueError(f"tune.method = {method!r} is not known; use Genetic(...) or Simplex(...).")
    start = method.start if isinstance(method, Simplex) else None
    if start is not None and set(start) != set(ranges):
        raise ValueError(
            f"Simplex.start has the names {', '.join(start)}; it must have those of ranges: {', '.join(ranges)}."
        )
    for case in cases:
        for end in (0, 1):
            experiment.with_values({**case, **{name: limits[end] for name, limits in ranges.items()}}).check()


def _check_folder(file: Path, experiment: Experiment, objective: Objective, cases: Sequence[Case]) -> None:
    """Write the description of a tuning to `file`, or raise ValueError if it holds that of another one."""
    wanted = json.dumps(
        {
            "experiment": function_identity(experiment), "objective": function_identity(objective),
            "cases": list(cases),
        }
    )  # fmt: skip
    if file.exists() and file.read_text() != wanted:
        raise ValueError(f"{file.parent} holds another tuning; give another folder, or remove it.")
    write_text(file, wanted)


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
        write_text(file, json.dumps({"values": named, "objective": result, "of_cases": of_cases, "reason": reason}))
        return result

    def _one(self, values: Case) -> tuple[float, str]:
        """The objective, and the reason if there is none."""
        try:
            run = self.experiment(values)
        except (SimulationError, ValueError) as error:
            return FAILED, str(error)
        found = float(self.objective(run))
        return (found, "") if math.isfinite(found) else (FAILED, f"the objective is {found}")


def _genetic(evaluate: _Evaluation, ranges: Ranges, method: Genetic) -> None:
    from exudyn.processing import GeneticOptimization

    GeneticOptimization(
        functools.partial(_of_parameters, evaluate), dict(ranges), populationSize=method.population,
        numberOfGenerations=method.generations, elitistRatio=max(0.1, 1.0 / method.population),
        crossoverProbability=0.25, rangeReductionFactor=0.7, distanceFactor=0.0,
        randomizerInitialization=method.seed, showProgress=False, useMultiProcessing=method.workers > 1,
        numberOfThreads=method.workers,
    )  # fmt: skip


def _simplex(evaluate: _Evaluation, ranges: Ranges, method: Simplex) -> None:
    """Search in shares of the ranges, so that one tolerance fits all; the first simplex spans a tenth of each."""
    from exudyn.processing import Minimize

    start = method.start or {name: 0.5 * (low + high) for name, (low, high) in ranges.items()}
    shares = np.array([(float(start[n]) - low) / (high - low) for n, (low, high) in ranges.items()]).clip(0.0, 1.0)
    first = np.vstack([shares, *(shares + np.where(shares <= 0.5, 0.1, -0.1) * row for row in np.eye(len(shares)))])
    most = method.evaluations
    Minimize(
        functools.partial(_of_shares, evaluate, dict(ranges)), dict.fromkeys(ranges, (0.0, 1.0)),
        initialGuess=list(shares), method="Nelder-Mead", tol=method.tolerance,
        options={"maxfev": most, "maxiter": most, "fatol": FAILED, "initial_simplex": first},
        showProgress=False, storeFunctionValues=False,
    )  # fmt: skip


def _of_shares(evaluate: _Evaluation, ranges: Ranges, shares: Mapping[str, Any]) -> float:
    return evaluate({name: low + float(shares[name]) * (high - low) for name, (low, high) in ranges.items()})


def _of_parameters(evaluate: _Evaluation, parameters: Mapping[str, Any]) -> float:
    return evaluate(parameters)


def _gathered(folder: Path, ranges: Ranges) -> tuple[xr.Dataset, list[str]]:
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
