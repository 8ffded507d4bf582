"""Finding the best values: Exudyn's optimisers on the same description of a case as sweeps use.

Every evaluation is kept in a file. The optimisers are deterministic for a given seed, so the same call after a stop
finds what it had computed and continues from there.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import json
import logging
import math
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from numbers import Real
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import xarray as xr

from exumob.simulation.result_files import save_dataset
from exumob.support.declared import Declared, checked
from exumob.support.errors import SimulationError
from exumob.support.files import require_folder_name, write_text
from exumob.support.identity import differences, digest, identity
from exumob.support.processes import end_with_parent
from exumob.support.provenance import EXUMOB_VERSION, parameters_json, provenance
from exumob.support.quantities import Quantity, shown
from exumob.sweeps.case_rows import case_text
from exumob.sweeps.case_store import StorageError, storage_remedy
from exumob.sweeps.experiment import Experiment
from exumob.sweeps.handing_over import WithVehicleFiles
from exumob.sweeps.sampling import SEED, Case

logger = logging.getLogger(__name__)

FAILED = 1e6
"""Objective of a run that breaks down; finite, because the optimisers compute with it."""

Objective = Callable[[xr.Dataset], float]
"""Takes the Dataset of a run, returns the number that is to be small."""
Ranges = Mapping[str, tuple[float, float]]
"""Lowest and highest value by dotted name."""


@dataclass(frozen=True)
class Genetic(Declared):
    """Global search with `exudyn.processing.GeneticOptimization`: `population` times `generations` evaluations."""

    population: Annotated[int, Quantity("1", at_least=4.0, at_most=1e6)] = 24
    """Evaluations of a generation"""
    generations: Annotated[int, Quantity("1", at_least=1.0, at_most=1e6)] = 6
    """Number of generations"""
    workers: Annotated[int, Quantity("1", at_least=1.0, at_most=4096.0)] = 2
    """Number of processes"""
    seed: Annotated[int, SEED] = 0
    """The same seed searches the same way"""


@dataclass(frozen=True)
class Simplex(Declared):
    """Local search with `exudyn.processing.Minimize` (Nelder & Mead, Comput. J. 7 (1965) 308)."""

    start: Case | None = None
    """Where the search begins, by dotted name, such as a `Tuned.best`; None: the middle of the ranges"""
    tolerance: Annotated[float, Quantity("1", above=0.0, at_most=1.0)] = 1e-3
    """The search ends when the simplex is smaller than this share of the ranges"""
    evaluations: Annotated[int, Quantity("1", at_least=1.0, at_most=1e6)] = 100
    """The search ends after so many evaluations at the latest"""


@dataclass(frozen=True)
class Tuned:
    """Answer of `tune`."""

    best: Case
    """Values by dotted name"""
    objective: float
    """Objective of the best values"""
    evaluations: xr.Dataset
    """All that was tried, along ``evaluation``: the parameters and ``objective``"""


@checked
def tune(
    experiment: Experiment, ranges: Any, objective: Objective, folder: str | Path, *,
    cases: Sequence[Any] = ({},), method: Genetic | Simplex = Genetic(),
) -> Tuned:  # fmt: skip
    """Find the values within ranges for which an objective is least.

    Parameters
    ----------
    experiment : Experiment
    ranges : mapping
        Lowest and highest value by dotted name.
    objective : callable
        Takes the Dataset of a run, returns the number that is to be small; a function at the top level of a module.
        Another tuning is recognised by its source and that of your own functions that it calls.
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
    StorageError
        If the folder cannot be written; the evaluations until then are kept.
    """
    _check(experiment, ranges, cases, method)
    require_folder_name("tune.folder", folder)
    cases = [experiment.typed(case) for case in cases]
    ends = [{name: limits[end] for name, limits in ranges.items()} for end in (0, 1)]
    experiment = experiment.with_one_model([*cases, *ends])
    place = Path(folder)
    with _writing(place):
        (place / "evaluations").mkdir(parents=True, exist_ok=True)
    of = _check_folder(place / "tuning.json", experiment, objective, cases)
    evaluate = _Evaluation(experiment, objective, tuple(cases), place / "evaluations", of)
    if isinstance(method, Genetic):
        _genetic(evaluate, ranges, method)
    else:
        _simplex(evaluate, ranges, method)
    result, reasons = _gathered(place, ranges, of)
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
    with _writing(place / "tuning.nc"):
        save_dataset(result, place / "tuning.nc", elsewhere=False)
    best = int(np.argmin(result["objective"].values))
    if float(result["objective"][best]) >= FAILED:
        raise RuntimeError(f"tune: every run broke down; the first: {next(iter(reasons), 'no reason is kept')}")
    return Tuned({n: float(result[n][best]) for n in ranges}, float(result["objective"][best]), result)


def _check(experiment: Experiment, ranges: Ranges, cases: Sequence[Case], method: Genetic | Simplex) -> None:
    """Raise ValueError if a request cannot be fulfilled, before anything runs."""
    if not isinstance(ranges, Mapping) or not ranges:
        raise ValueError(
            f"tune.ranges = {shown(ranges)} is empty or no dict; give a range (low, high) for one name at least."
        )
    for name, limits in ranges.items():
        two = isinstance(limits, list | tuple) and len(limits) == 2
        numbers = two and all(isinstance(end, Real) and not isinstance(end, bool) for end in limits)
        if not numbers or not (math.isfinite(limits[0]) and math.isfinite(limits[1]) and limits[0] < limits[1]):
            raise ValueError(
                f"tune.ranges: {name} = {shown(limits)} must be two finite numbers (low, high), its lower end first."
            )
    if isinstance(cases, Mapping) or not all(isinstance(case, Mapping) for case in cases):
        raise ValueError(f"tune.cases = {shown(cases)} must be a list of dicts, values by dotted name.")
    if not cases:
        raise ValueError("tune.cases is empty; leave it out, or give one condition at least.")
    start = method.start if isinstance(method, Simplex) else None
    if start is not None and set(start) != set(ranges):
        raise ValueError(
            f"Simplex.start has the names {', '.join(start)}; it must have those of ranges: {', '.join(ranges)}."
        )
    for case in cases:
        for end in (0, 1):
            experiment.with_values({**case, **{name: limits[end] for name, limits in ranges.items()}}).check()


def _check_folder(file: Path, experiment: Experiment, objective: Objective, cases: Sequence[Case]) -> str:
    """Write the description of a tuning to `file`, or raise ValueError if it holds that of another one.

    Returns a digest of the description, which every evaluation holds.
    """
    found = {"experiment": identity(experiment), "objective": identity(objective)}
    wanted: dict[str, Any] = {name: one.values for name, one in found.items()}
    wanted |= {"cases": [case_text(case) for case in cases], "exumob": EXUMOB_VERSION}
    wanted["code"] = found["objective"].code | found["experiment"].code
    text = json.dumps(wanted)
    if not file.exists():
        with _writing(file):
            write_text(file, text)
    try:
        kept = json.loads(file.read_text("utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise ValueError(
            f"{file} cannot be read ({error}); remove it, and the same call goes on: every evaluation says itself what "
            "it belongs to."
        ) from None
    if not isinstance(kept, dict) or set(kept) != set(wanted):
        raise ValueError(f"{file} is not of this version of exumob; give another folder, or remove {file.parent}.")
    changed = [name for name in wanted if kept[name] != wanted[name]]
    if changed:
        what = ", ".join(changed)
        both = kept[changed[0]], wanted[changed[0]]
        if all(isinstance(part, dict) for part in both):
            what += f": {differences(*both)}"
        raise ValueError(f"{file.parent} holds another tuning ({what}); give another folder, or remove it.")
    return digest(text)


@contextlib.contextmanager
def _writing(file: Path) -> Iterator[None]:
    """Turn an error of the disk into one that says what to do."""
    try:
        yield
    except OSError as error:
        raise StorageError(
            f"{file} cannot be written ({error.strerror or error}); {storage_remedy(error)}. The evaluations until "
            "then are kept: the same call goes on with them."
        ) from None


@dataclass(frozen=True)
class _Evaluation(WithVehicleFiles):
    """The objective as a function of the values, kept in files."""

    experiment: Experiment
    objective: Objective
    cases: tuple[Case, ...]
    folder: Path
    of: str
    """Digest of the tuning"""

    def __call__(self, values: Mapping[str, Any]) -> float:
        named = {name: float(value) for name, value in values.items() if name != "functionData"}
        text = json.dumps(named, sort_keys=True)
        file = self.folder / f"{hashlib.sha256(text.encode()).hexdigest()[:16]}.json"
        kept = _read(file, self.of)
        if kept is not None and kept["values"] == named:
            return float(kept["objective"])
        found = [self._one({**case, **named}) for case in self.cases]
        result = float(np.mean([value for value, _ in found]))
        reason = next((text for _, text in found if text), "")
        of_cases = [value for value, _ in found]
        row = {"of": self.of, "values": named, "objective": result, "of_cases": of_cases, "reason": reason}
        with _writing(file):
            write_text(file, json.dumps(row))
        return result

    def _one(self, values: Case) -> tuple[float, str]:
        """The objective, and the reason if there is none."""
        try:
            run = self.experiment(values)
        except (SimulationError, ValueError) as error:
            return FAILED, str(error)
        try:
            found = float(self.objective(run))
        except (TypeError, OverflowError) as error:
            raise ValueError(f"tune.objective must return a number ({error}); mend the function.") from None
        return (found, "") if math.isfinite(found) else (FAILED, f"the objective is {found}")


def _genetic(evaluate: _Evaluation, ranges: Ranges, method: Genetic) -> None:
    from exudyn.processing import GeneticOptimization

    GeneticOptimization(
        functools.partial(_of_parameters, evaluate, os.getpid()), dict(ranges), populationSize=method.population,
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


def _of_parameters(evaluate: _Evaluation, leader: int, parameters: Mapping[str, Any]) -> float:
    if os.getpid() != leader:
        end_with_parent(leader)
    return evaluate(parameters)


def _read(file: Path, of: str) -> dict[str, Any] | None:
    """The evaluation in a file; None if there is none, or it is torn (it is then made again).

    Raises
    ------
    ValueError
        If it is that of another tuning, or none at all.
    """
    try:
        row: dict[str, Any] = json.loads(file.read_bytes())
    except FileNotFoundError:
        return None
    except OSError as error:
        raise ValueError(f"{file} cannot be read ({error.strerror}); mend that, or remove the file.") from None
    except (ValueError, RecursionError):
        logger.warning("%s was not written to its end: the evaluation is made again", file)
        return None
    kinds = {"of": str, "values": dict, "objective": int | float, "of_cases": list, "reason": str}
    if not isinstance(row, dict) or any(not isinstance(row.get(name), kind) for name, kind in kinds.items()):
        raise ValueError(f"{file} is no evaluation of this version of exumob; move it out of the folder.")
    if row["of"] != of:
        raise ValueError(f"{file} is an evaluation of another tuning; give another folder, or remove {file.parent}.")
    return row


def _gathered(folder: Path, ranges: Ranges, of: str) -> tuple[xr.Dataset, list[str]]:
    """Evaluations within the ranges, in the order in which they were made, and why some failed."""
    files = [file for file in (folder / "evaluations").glob("*.json") if not file.name.startswith(".")]
    files.sort(key=lambda file: file.stat().st_mtime_ns)
    rows = [row for row in (_read(file, of) for file in files) if row is not None]
    rows = [
        row for row in rows
        if set(row["values"]) == set(ranges)
        and all(low - 1e-9 <= row["values"][name] <= high + 1e-9 for name, (low, high) in ranges.items())
    ]  # fmt: skip
    found = xr.Dataset(
        {
            "objective": (
                "evaluation", [row["objective"] for row in rows],
                {"units": "1", "long_name": "objective, averaged over the cases"},
            )
        },
        coords={name: ("evaluation", [row["values"][name] for row in rows]) for name in ranges},
        attrs=provenance() | {"title": "exumob tuning", "parameters": " ".join(ranges)},
    )  # fmt: skip
    return found, [row["reason"] for row in rows if row.get("reason")]
