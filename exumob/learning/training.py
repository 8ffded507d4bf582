"""Training of the networks from CFD-MBD runs: split by run, stopped early, resumable, the same from the same seed.

What the paper leaves open was chosen on held-back training runs alone. Scaling: inputs and loads to zero mean and unit
deviation over the training examples. Loss: mean square error of the six scaled loads, equal weights. Activation of the
dense layers: tanh. Gradients are cut off at norm 1. Every seed holds back another run of those inside the range of the
others (`held_back`): training stops when its error no longer falls, and the weights of the best epoch are kept. The
networks of five seeds thus differ in their start and in their data, and their spread is that of a cross-validation.
"""

from __future__ import annotations

import hashlib
import json
import logging
import multiprocessing
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from queue import Empty
from typing import Any

import numpy as np
import torch
import xarray as xr
from numpy.typing import NDArray
from scipy.optimize import nnls

from exumob.learning.dataset import base_loads, body_states, load_runs, usable, water_of
from exumob.learning.presets import Preset
from exumob.learning.torch_networks import LoadNetwork
from exumob.paper.scenarios import UNSEEN
from exumob.support.provenance import parameters_json, provenance
from exumob.surrogates.inputs import MIRRORED_BODIES, MIRRORED_LOADS, mirror_signs, network_inputs
from exumob.surrogates.networks import TRAINED_DENSITY, Architecture, NetworkSet, Single, geometry, monomials
from exumob.vehicle.motion import BODIES, BodyStates
from exumob.vehicle.parameters import Vehicle

logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class Examples:
    """Inputs and loads of one body along several runs; the mirrored ones, if any, come last."""

    inputs: list[Single]
    """(n, k) each"""
    loads: list[Single]
    """(n, 6) each, smoothed, less the base model's"""
    usable: list[NDArray[np.bool_]]

    def windows(self, run: int, rows: NDArray[np.intp], architecture: Architecture) -> Single:
        """Windows of inputs that end at `rows`, oldest first; shape (m, taps, k)."""
        back = architecture.stride * np.arange(architecture.taps - 1, -1, -1)
        return self.inputs[run][np.maximum(rows[:, None] - back, 0)]

    def choose(self, runs: Sequence[int], offset: int, thinning: int) -> list[tuple[int, NDArray[np.intp]]]:
        """Usable rows of some runs, every `thinning`-th."""
        rows = [np.arange(offset, len(self.inputs[r]), thinning) for r in runs]
        return [(r, n[self.usable[r][n]]) for r, n in zip(runs, rows, strict=True)]

    def gather(
        self, chosen: Sequence[tuple[int, NDArray[np.intp]]], architecture: Architecture
    ) -> tuple[Single, Single]:
        """Windows and loads of chosen rows."""
        x = np.concatenate([self.windows(run, rows, architecture) for run, rows in chosen])
        return x, np.concatenate([self.loads[run][rows] for run, rows in chosen])


def training_runs(folder: str | Path) -> dict[str, xr.Dataset]:
    """Runs of a folder, without those kept for the final evaluation (`exumob.paper.scenarios.UNSEEN`).

    Raises
    ------
    ValueError
        If there are fewer than two.
    """
    files = sorted(Path(folder).glob("*.nc"))
    kept = {scenario.file_stem for scenario in UNSEEN}
    found = load_runs(file for file in files if file.stem not in kept)
    runs = {name: run for name, run in found.items() if name not in {scenario.name for scenario in UNSEEN}}
    if len(runs) < 2:
        raise ValueError(
            f"{folder}: holds {len(runs)} runs to learn from, and two at least are needed (one is held back); "
            "studies/generate_training_data.py makes them, exumob.learning.importing reads yours."
        )
    return runs


def held_back(runs: Mapping[str, xr.Dataset], seed: int) -> str:
    """Name of the run that a seed holds back: one whose depth and current lie within those of the others."""
    names = sorted(runs)
    points = np.array([[1.0, (w := water_of(runs[name])).depth, w.current_speed] for name in names])
    scaled = points / np.maximum(np.abs(points).max(axis=0), 1e-12)
    inside = [
        name for n, name in enumerate(names) if nnls(np.delete(scaled, n, axis=0).T, scaled[n])[1] < 1e-6
    ] or names  # fmt: skip
    return inside[seed % len(inside)]


def examples(runs: Mapping[str, xr.Dataset], vehicle: Vehicle, preset: Preset) -> tuple[list[str], list[Examples]]:
    """Examples of the five bodies, and the names of the runs in their order."""
    names = sorted(runs)
    architecture = preset.architecture
    inputs = [network_inputs(body_states(runs[n]), water_of(runs[n]), architecture.inputs) for n in names]
    loads = [runs[n]["water_wrench_smooth"].values.astype(float) for n in names]
    if architecture.base == "coefficients":
        loads = [load - base_loads(runs[n], vehicle) for n, load in zip(names, loads, strict=True)]
    loads = [load * (TRAINED_DENSITY / water_of(runs[n]).density) for n, load in zip(names, loads, strict=True)]
    good = [usable(runs[n]) for n in names]
    if preset.mirror:
        order, signs = list(MIRRORED_BODIES), mirror_signs(architecture.inputs)
        inputs += [x[:, order] * signs for x in inputs]
        loads += [y[:, order] * MIRRORED_LOADS for y in loads]
        good += good
    return names, [
        Examples([x[:, b].astype(np.float32) for x in inputs], [y[:, b].astype(np.float32) for y in loads], good)
        for b in range(5)
    ]


def scalers(found: Examples, runs: Sequence[int], architecture: Architecture) -> dict[str, Single]:
    """Scalers and training range of one body."""
    chosen = found.choose(runs, 0, 1)
    x = np.concatenate([found.inputs[r][rows] for r, rows in chosen]).astype(float)
    y = np.concatenate([found.loads[r][rows] for r, rows in chosen]).astype(float)
    scale = x.std(axis=0)
    scale = np.where(scale > 1e-6, scale, 1.0)
    scaled = (x - x.mean(axis=0)) / scale
    inverse = np.linalg.inv(scaled.T @ scaled / len(x) + 1e-4 * np.eye(x.shape[1]))
    distance = np.sqrt(np.einsum("ni,ij,nj->n", scaled, inverse, scaled))
    return {
        name: np.asarray(value, np.float32)
        for name, value in {
            "input_mean": x.mean(axis=0), "input_scale": scale, "input_low": x.min(axis=0), "input_high": x.max(axis=0),
            "joint_inverse": inverse, "joint_limit": distance.max(), "output_mean": y.mean(axis=0),
            "output_scale": np.maximum(y.std(axis=0), 1e-6),
        }.items()
    }  # fmt: skip


def fit_body(
    found: Examples, train: Sequence[int], test: Sequence[int], preset: Preset, seed: int, body: int,
    told: Callable[[int, float], None] | None = None,
) -> dict[str, Single]:  # fmt: skip
    """Train the network of one body; the same bits from the same seed on one machine.

    Returns
    -------
    dict
        Weights, scalers, and ``training_loss``, ``held_back_loss`` by epoch (mean square error of scaled loads).
    """
    torch.set_num_threads(1)
    architecture = preset.architecture
    scale = scalers(found, train, architecture)
    scaled = replace(
        found,
        inputs=[(x - scale["input_mean"]) / scale["input_scale"] for x in found.inputs],
        loads=[(y - scale["output_mean"]) / scale["output_scale"] for y in found.loads],
    )
    test_x, test_y = scaled.gather(scaled.choose(test, 0, preset.thinning), architecture)
    if architecture.layer == "polynomial":
        return scale | _polynomial(scaled, train, preset, test_x, test_y)

    generator = torch.Generator().manual_seed(1000 * seed + body)
    network = LoadNetwork(architecture, generator)
    optimizer = torch.optim.Adam(network.parameters(), preset.learning_rate)
    held_x, held_y = torch.from_numpy(test_x), torch.from_numpy(test_y)
    curves: list[tuple[float, float]] = []
    best, best_epoch, kept = float("inf"), 0, {}
    for epoch in range(preset.epochs):
        offset = int(torch.randint(preset.thinning, (1,), generator=generator))
        x, y = (torch.from_numpy(a) for a in scaled.gather(scaled.choose(train, offset, preset.thinning), architecture))
        losses = []
        for rows in torch.randperm(len(x), generator=generator).split(preset.batch):
            window = x[rows]
            if preset.noise > 0.0:  # one offset for the whole window: an error of the state lasts
                shape = (len(rows), 1, window.shape[2])
                window = window + preset.noise * torch.randn(shape, generator=generator)
            loss = torch.mean((network(window) - y[rows]) ** 2)
            optimizer.zero_grad()
            loss.backward()
            torch.nn.utils.clip_grad_norm_(network.parameters(), 1.0)
            optimizer.step()
            losses.append(float(loss.detach()))
        with torch.no_grad():
            error = float(torch.mean((network(held_x) - held_y) ** 2))
        curves.append((float(np.mean(losses)), error))
        if error < best:
            best, best_epoch = error, epoch
            kept = {name: p.detach().numpy().copy() for name, p in network.named_parameters()}
        if told is not None:
            told(epoch, best)
        if epoch - best_epoch >= preset.patience:
            break
    training_loss, held_loss = np.array(curves, np.float32).T
    return scale | kept | {"training_loss": training_loss, "held_back_loss": held_loss}


def _polynomial(
    scaled: Examples, train: Sequence[int], preset: Preset, test_x: Single, test_y: Single
) -> dict[str, Single]:
    """Ridge regression on all monomials of the states up to a degree (the coefficient models of the paper's Sec. 1)."""
    x, y = scaled.gather(scaled.choose(train, 0, preset.thinning), preset.architecture)
    terms = monomials(x[:, 0].astype(float), preset.architecture.degree)
    normal = terms.T @ terms + preset.ridge * len(terms) * np.eye(terms.shape[1])
    coefficients = np.linalg.solve(normal, terms.T @ y)
    errors = []
    for inputs, loads in ((x, y), (test_x, test_y)):
        off = monomials(inputs[:, 0].astype(float), preset.architecture.degree) @ coefficients - loads
        errors.append(np.array([np.mean(off**2)], np.float32))
    return {
        "coefficients": coefficients.astype(np.float32), "training_loss": errors[0], "held_back_loss": errors[1]
    }  # fmt: skip


@dataclass(frozen=True)
class Progress:
    """How far the training of one network has got."""

    preset: str
    seed: int
    body: str
    epoch: int
    loss: float
    """Least error on the held-back run so far"""
    done: bool


def train(
    presets: Sequence[Preset], runs: Mapping[str, xr.Dataset], vehicle: Vehicle, output: Path, *,
    seeds: Sequence[int] = range(5), jobs: int = 2, told: Callable[[Progress], None] | None = None,
) -> dict[tuple[str, int], Path]:  # fmt: skip
    """Train networks for all five bodies, each preset with each seed; go on where an earlier call was stopped.

    Every network is kept as it is finished (``output/parts``); the five of a seed make one file,
    ``<preset>_seed<seed>.safetensors``. What is there and made from the same data and preset is not made again.

    Parameters
    ----------
    presets : sequence of Preset
    runs : mapping
        Of `training_runs`.
    vehicle : Vehicle
        Of the runs.
    output : Path
        Folder.
    seeds : sequence of int
    jobs : int
        Processes, one thread each.
    told : callable, optional
        Is told after each epoch.

    Returns
    -------
    dict
        Files by preset and seed.
    """
    parts = output / "parts"
    parts.mkdir(parents=True, exist_ok=True)
    _check_geometry(runs, vehicle)
    data = _data_hash(runs, vehicle)
    files: dict[tuple[str, int], Path] = {}
    context = multiprocessing.get_context("spawn")
    with context.Manager() as manager, _stopping(ProcessPoolExecutor(max(jobs, 1), context)) as pool:
        queue = manager.Queue()
        pending: dict[Any, tuple[Preset, int, int]] = {}
        for preset in presets:
            names, bodies = examples(runs, vehicle, preset)
            for seed in seeds:
                held = names.index(held_back(runs, seed))
                learn = [r for r in range(len(bodies[0].inputs)) if r % len(names) != held]
                for b, body in enumerate(BODIES):
                    part = _part(parts, preset, seed, body, data)
                    if not part.exists():
                        task = pool.submit(_fit_and_keep, bodies[b], learn, [held], preset, seed, b, part, queue)
                        pending[task] = preset, seed, b
                files[preset.name, seed] = output / f"{preset.name}_seed{seed}.safetensors"
        _wait(pending, queue, told)
    for preset in presets:
        for seed in seeds:
            found = [_read(_part(parts, preset, seed, body, data)) for body in BODIES]
            arrays = {name: _stacked([f[name] for f in found]) for name in found[0]}
            about = {
                "preset": preset.name, "training": asdict(preset) | {"architecture": None}, "seed": seed,
                "runs": sorted(runs), "held_back": held_back(runs, seed), "data_hash": data,
                "geometry": geometry(vehicle), "provenance": provenance() | {"torch_version": torch.__version__},
            }  # fmt: skip
            NetworkSet(preset.architecture, arrays, about).save(files[preset.name, seed])
    return files


@contextmanager
def _stopping(pool: ProcessPoolExecutor) -> Iterator[ProcessPoolExecutor]:
    """A pool that begins nothing more when its leader is stopped."""
    try:
        yield pool
    except BaseException:
        pool.shutdown(wait=False, cancel_futures=True)
        for process in list((pool._processes or {}).values()):
            process.terminate()
        raise
    pool.shutdown()


def _fit_and_keep(
    found: Examples, learn: list[int], test: list[int], preset: Preset, seed: int, body: int, part: Path, queue: Any
) -> float:
    from safetensors.numpy import save_file

    began = time.perf_counter()

    def told(epoch: int, loss: float) -> None:
        queue.put(Progress(preset.name, seed, BODIES[body], epoch, loss, False))

    arrays = fit_body(found, learn, test, preset, seed, body, told)
    partial = part.with_suffix(".partial")
    save_file({n: np.array(a, order="C") for n, a in arrays.items()}, partial)
    partial.replace(part)
    loss = float(arrays["held_back_loss"].min())
    queue.put(Progress(preset.name, seed, BODIES[body], len(arrays["held_back_loss"]), loss, True))
    return time.perf_counter() - began


def _wait(pending: Mapping[Any, tuple[Preset, int, int]], queue: Any, told: Callable[[Progress], None] | None) -> None:
    """Until all are done; what fails is raised after the others are kept."""
    failed: list[str] = []
    left = set(pending)
    while left:
        try:
            while True:
                progress = queue.get(timeout=0.2)
                if told is not None:
                    told(progress)
        except Empty:
            pass
        for task in [task for task in left if task.done()]:
            left.remove(task)
            preset, seed, body = pending[task]
            if task.exception() is not None:
                failed.append(f"{preset.name}, seed {seed}, {BODIES[body]}: {task.exception()}")
    if failed:
        raise RuntimeError("training failed for " + "; ".join(failed))


def _read(part: Path) -> dict[str, Single]:
    from safetensors.numpy import load_file

    found: dict[str, Single] = load_file(part)
    return found


def _stacked(arrays: Sequence[Single]) -> Single:
    """Bodies first; learning curves of different lengths are filled up with nan."""
    longest = max(a.shape[0] if a.ndim else 0 for a in arrays)
    if any(a.ndim and a.shape[0] != longest for a in arrays):
        arrays = [np.concatenate([a, np.full(longest - len(a), np.nan, np.float32)]) for a in arrays]
    return np.stack(arrays)


def _part(parts: Path, preset: Preset, seed: int, body: str, data: str) -> Path:
    """File of one network; its name holds what it was made from."""
    made = hashlib.sha256(json.dumps([asdict(preset), data]).encode()).hexdigest()[:12]
    return parts / f"{preset.name}_seed{seed}_{body}_{made}.safetensors"


def _data_hash(runs: Mapping[str, xr.Dataset], vehicle: Vehicle) -> str:
    """Of all that networks are made from."""
    found = hashlib.sha256(parameters_json({"vehicle": vehicle}).encode())
    for name in sorted(runs):
        found.update((name + parameters_json({"water": water_of(runs[name])})).encode())
        for variable in (*BodyStates.__dataclass_fields__, "quaternion", "water_wrench", "water_wrench_smooth"):
            if variable in runs[name]:
                found.update(np.ascontiguousarray(runs[name][variable].values).tobytes())
    return found.hexdigest()[:16]


def _check_geometry(runs: Mapping[str, xr.Dataset], vehicle: Vehicle) -> None:
    """Runs made by exumob must have been made with this vehicle."""
    wanted = geometry(vehicle)
    for name, run in runs.items():
        stored = json.loads(run.attrs["parameters"]).get("vehicle")
        if stored is None:
            continue
        car = next(iter(stored.values()))
        for field, value in wanted.items():
            found: Any = car
            for part in field.split("."):
                found = found[part]
            if isinstance(value, float) and not np.isclose(found, value, rtol=1e-3):
                raise ValueError(f"{name} was made with {field} = {found}, {vehicle.name} has {value}; give --vehicle.")
