"""Training of whole ensembles: every body with every preset and seed, side by side, resumable.

Every seed keeps some runs for validation (`exumob.learning.examples.validation_runs`). The networks of five seeds thus
differ in their start and in their data, and their spread is that of a cross-validation.
"""

from __future__ import annotations

import hashlib
import json
import multiprocessing
import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
import torch
import xarray as xr

from exumob.learning.calibration import fit_wave_coefficients
from exumob.learning.cost import announce_training
from exumob.learning.dataset import check_geometry, check_run, water_of
from exumob.learning.examples import Examples, build_examples, validation_runs
from exumob.learning.fitting import fit_body
from exumob.learning.presets import Preset
from exumob.support.declared import checked
from exumob.support.files import atomic_write, require_folder_name, require_writable
from exumob.support.processes import end_with_parent, stopping
from exumob.support.provenance import parameters_json, provenance
from exumob.support.quantities import Quantity
from exumob.surrogates.networks import VERSION, NetworkSet, Single, read_arrays, write_arrays
from exumob.surrogates.vehicle_shape import geometry
from exumob.vehicle.motion import BODIES, BodyStates
from exumob.vehicle.parameters import Vehicle
from exumob.water.mesh_file import mesh_digest
from exumob.water.wave_loads import WaveCoefficients, fitted_coefficients

POLL = 0.2
"""Interval at which progress is reported [s]."""
ROOM = 10_000_000
"""Room that the folder must have [bytes]."""


@dataclass(frozen=True)
class Progress:
    """Progress of the training of one network."""

    preset: str
    seed: int
    body: str
    epoch: int
    loss: float
    """Least validation error so far: mean square error of the scaled loads [-]"""
    done: bool


class _Task(NamedTuple):
    """One network to be trained."""

    preset: Preset
    seed: int
    body: int

    @property
    def name(self) -> str:
        return f"{self.preset.name}, seed {self.seed}, {BODIES[self.body]}"

    def progress(self, epoch: int, loss: float, done: bool = False) -> Progress:
        return Progress(self.preset.name, self.seed, BODIES[self.body], epoch, loss, done)


@checked
def train(
    presets: Sequence[Preset], runs: Mapping[str, xr.Dataset], vehicle: Vehicle, output: Path, *,
    seeds: Sequence[Annotated[int, Quantity("1", at_least=0)]] = range(5),
    jobs: Annotated[int, Quantity("1", at_least=1, at_most=1000)] = 2,
    progress: Callable[[Progress], None] | None = None,
) -> dict[tuple[str, int], Path]:  # fmt: skip
    """Train networks for all five bodies, each preset with each seed; continue where an earlier call was stopped.

    Every network is kept as it is finished (``output/parts``); the five of a seed make one file,
    ``<preset>_seed<seed>.safetensors``. Networks that are there already, made from the same data and preset, are not
    made again.

    Networks whose loads are added to coefficients have ones of their own for that: those of the waves
    (`exumob.water.wave_loads`) are fitted to all of these runs (`exumob.learning.calibration`), also to those that a
    seed keeps for validation.

    Parameters
    ----------
    presets : sequence of Preset
    runs : mapping
        Runs by name, such as those of `exumob.learning.examples.training_runs`.
    vehicle : Vehicle
        The vehicle of the runs.
    output : Path
        Folder for the networks.
    seeds : sequence of int
    jobs : int
        Number of processes, one thread each.
    progress : callable, optional
        Called after each epoch of each network.

    Returns
    -------
    dict
        Files by preset and seed.

    Raises
    ------
    ValueError
        If a run was made with a vehicle of another geometry.
    RuntimeError
        If a network cannot be trained; the others are kept.
    """
    if not presets or not seeds or len(runs) < 2:
        raise ValueError(
            f"train: {len(presets)} presets, {len(seeds)} seeds, {len(runs)} runs; one preset, one seed and two runs "
            "at least are needed."
        )
    for name, run in runs.items():
        check_run(run, name)
    check_geometry(runs, vehicle)
    require_folder_name("train.output", output)
    parts = output / "parts"
    try:
        parts.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ValueError(
            f"train: the folder {parts} cannot be made ({error.strerror}); give a folder in which you may write."
        ) from None
    require_writable(parts / "network.safetensors", ROOM)
    announce_training(presets, runs, len(seeds), jobs)
    data = _data_hash(runs, vehicle)
    based = any(preset.architecture.base == "coefficients" for preset in presets)
    waves = _coefficients(parts, runs, vehicle, data) if based else None
    files: dict[tuple[str, int], Path] = {}
    context = multiprocessing.get_context("spawn")
    queue = context.SimpleQueue()
    with stopping(ProcessPoolExecutor(jobs, context, _begin, (queue, os.getpid()))) as pool:
        pending: dict[Any, _Task] = {}
        for preset in presets:
            names, bodies = build_examples(runs, vehicle, preset, waves)
            for seed in seeds:
                validation = [names.index(name) for name in validation_runs(runs, seed)]
                learn = [r for r in range(len(bodies[0].inputs)) if r % len(names) not in validation]
                for b, body in enumerate(BODIES):
                    part = _part(parts, preset, seed, body, data, waves)
                    if not part.exists():
                        task = _Task(preset, seed, b)
                        future = pool.submit(_fit_and_keep, task, bodies[b], learn, validation, part)
                        pending[future] = task
                files[preset.name, seed] = output / f"{preset.name}_seed{seed}.safetensors"
        _wait(pending, queue, progress)
    for preset in presets:
        for seed in seeds:
            found = [_read(_part(parts, preset, seed, body, data, waves)) for body in BODIES]
            arrays = {name: _stacked([f[name] for f in found]) for name in found[0]}
            about = {
                "preset": preset.name, "training": asdict(preset) | {"architecture": None}, "seed": seed,
                "runs": sorted(runs), "held_back": ", ".join(validation_runs(runs, seed)), "data_hash": data,
                "geometry": geometry(vehicle), "provenance": provenance() | {"torch_version": torch.__version__},
            }  # fmt: skip
            if waves is not None and preset.architecture.base == "coefficients":
                about["waves"] = waves.terms
            NetworkSet(preset.architecture, arrays, about).save(files[preset.name, seed])
    return files


_queue: Any = None
"""What takes the progress, in a process of the pool."""


def _begin(queue: Any, leader: int) -> None:
    """Begin a process of the pool: it ends with its leader, even if that is killed."""
    global _queue
    _queue = queue
    end_with_parent(leader)


def _fit_and_keep(task: _Task, found: Examples, learn: list[int], validation: list[int], part: Path) -> None:
    queue = _queue

    def progress(epoch: int, loss: float) -> None:
        queue.put(task.progress(epoch, loss))

    arrays = fit_body(found, learn, validation, task.preset, task.seed, task.body, progress)
    write_arrays(part, {"network": task.name}, {n: np.array(a, order="C") for n, a in arrays.items()})
    loss = arrays["held_back_loss"]
    queue.put(task.progress(len(loss), float(loss.min()), done=True))


def _wait(pending: Mapping[Any, _Task], queue: Any, progress: Callable[[Progress], None] | None) -> None:
    """Wait until all networks are made; what fails is raised after the others are kept."""
    failed: list[str] = []
    left = set(pending)
    while left:
        ended = wait(left, POLL, FIRST_COMPLETED).done
        while not queue.empty():  # also what those that have ended have said
            reached = queue.get()
            if progress is not None:
                progress(reached)
        for future in ended:
            left.remove(future)
            if future.exception() is not None:
                failed.append(f"{pending[future].name}: {future.exception()}")
    if failed:
        raise RuntimeError("training failed for " + "; ".join(failed))


def _coefficients(parts: Path, runs: Mapping[str, xr.Dataset], vehicle: Vehicle, data: str) -> WaveCoefficients:
    """Coefficients fitted to the runs; once for a folder, so that networks trained elsewhere later have the same."""
    prior = fitted_coefficients()
    kept = parts / f"coefficients_{data}_{prior.digest()}.json"
    if not kept.exists():
        fitted = fit_wave_coefficients([(vehicle, runs)], prior)
        with atomic_write(kept) as temporary:
            fitted.save(temporary)
    return WaveCoefficients.load(kept)


def _read(part: Path) -> dict[str, Single]:
    return read_arrays(part, "a network that was trained here", "delete it, and the same command makes it again.")[1]


def _stacked(arrays: Sequence[Single]) -> Single:
    """Arrays of the five bodies as one, bodies first; learning curves of different lengths are filled up with nan."""
    longest = max(a.shape[0] if a.ndim else 0 for a in arrays)
    if any(a.ndim and a.shape[0] != longest for a in arrays):
        arrays = [np.concatenate([a, np.full(longest - len(a), np.nan, np.float32)]) for a in arrays]
    return np.stack(arrays)


def _part(parts: Path, preset: Preset, seed: int, body: str, data: str, waves: WaveCoefficients | None) -> Path:
    """File of one network; its name holds a digest of the preset, the data, the base and the version of the file."""
    base = [waves.digest()] if waves is not None and preset.architecture.base == "coefficients" else []
    made = hashlib.sha256(json.dumps([asdict(preset), data, *base, VERSION]).encode()).hexdigest()[:12]
    return parts / f"{preset.name}_seed{seed}_{body}_{made}.safetensors"


def _data_hash(runs: Mapping[str, xr.Dataset], vehicle: Vehicle) -> str:
    """Digest of everything that the networks are made from."""
    found = hashlib.sha256((parameters_json({"vehicle": vehicle}) + mesh_digest(vehicle.hull)).encode())
    for name in sorted(runs):
        found.update((name + parameters_json({"water": water_of(runs[name])})).encode())
        for variable in (*BodyStates.__dataclass_fields__, "quaternion", "water_wrench", "water_wrench_smooth"):
            if variable in runs[name]:
                found.update(np.ascontiguousarray(runs[name][variable].values).tobytes())
    return found.hexdigest()[:16]
