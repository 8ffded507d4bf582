"""Fitting the network of one body to its examples: the same bits from the same seed on one machine.

What the paper leaves open was chosen on validation runs alone. Loss: mean square error of the six scaled loads, equal
weights, or those of `run_weights`. Optimiser: Adam; gradients are cut off at norm 1. Activation of the dense layers:
tanh. Training stops when the validation error no longer falls, and the weights of the best epoch are kept.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
import torch
from numpy.typing import NDArray

from exumob.learning.examples import Examples, scalers
from exumob.learning.presets import Preset
from exumob.learning.torch_networks import LoadNetwork
from exumob.surrogates.networks import Single, monomials

HEAVIEST = 10.0
"""Largest weight of a run, over that of the median one [-]."""


def fit_body(
    found: Examples, train: Sequence[int], validation: Sequence[int], preset: Preset, seed: int, body: int,
    progress: Callable[[int, float], None] | None = None,
) -> dict[str, Single]:  # fmt: skip
    """Fit the network of one body to its examples.

    Parameters
    ----------
    found : Examples
    train, validation : sequence of int
        Numbers of the runs to learn from, and of those whose error stops the training.
    preset : Preset
    seed, body : int
        Seed of the ensemble's member and number of the body; both choose the random numbers.
    progress : callable, optional
        Called after each epoch with its number and the least validation error so far.

    Returns
    -------
    dict
        Weights, scalers, and by epoch ``training_loss`` and ``held_back_loss`` (the validation error): mean square
        errors of scaled loads, weighted as in training.
    """
    torch.set_num_threads(1)
    architecture = preset.architecture
    scale = scalers(found, train, architecture.inputs)
    scaled = replace(
        found,
        inputs=[(x - scale["input_mean"]) / scale["input_scale"] for x in found.inputs],
        loads=[(y - scale["output_mean"]) / scale["output_scale"] for y in found.loads],
    )
    chosen = scaled.choose(validation, 0, preset.thinning)
    validation_examples = scaled.gather(chosen, architecture)
    if architecture.layer == "polynomial":
        return scale | _polynomial(scaled, train, preset, validation_examples)

    generator = torch.Generator().manual_seed(1000 * seed + body)
    network = LoadNetwork(architecture, generator)
    optimizer = torch.optim.Adam(network.parameters(), preset.learning_rate)
    validation_x, validation_y = (torch.from_numpy(a) for a in validation_examples)
    weights = run_weights(scaled, train, validation) if preset.equal_runs else None
    validation_weights = _along(weights, chosen)
    curves: list[tuple[float, float]] = []
    best, best_epoch, kept = float("inf"), 0, {}
    for epoch in range(preset.epochs):
        offset = int(torch.randint(preset.thinning, (1,), generator=generator))
        chosen = scaled.choose(train, offset, preset.thinning)
        x, y = (torch.from_numpy(a) for a in scaled.gather(chosen, architecture))
        weight = _along(weights, chosen)
        losses = []
        for rows in torch.randperm(len(x), generator=generator).split(preset.batch):
            window = x[rows]
            if preset.noise > 0.0:  # one offset for the whole window: an error of the state lasts
                shape = (len(rows), 1, window.shape[2])
                window = window + preset.noise * torch.randn(shape, generator=generator)
            loss = torch.mean(weight[rows] * (network(window) - y[rows]) ** 2)
            optimizer.zero_grad()
            loss.backward()
            torch.nn.utils.clip_grad_norm_(network.parameters(), 1.0)
            optimizer.step()
            losses.append(float(loss.detach()))
        with torch.no_grad():
            error = float(torch.mean(validation_weights * (network(validation_x) - validation_y) ** 2))
        curves.append((float(np.mean(losses)), error))
        if error < best:
            best, best_epoch = error, epoch
            kept = {name: p.detach().numpy().copy() for name, p in network.named_parameters()}
        if progress is not None:
            progress(epoch, best)
        if epoch - best_epoch >= preset.patience:
            break
    training_loss, validation_loss = np.array(curves, np.float32).T
    return scale | kept | {"training_loss": training_loss, "held_back_loss": validation_loss}


def run_weights(found: Examples, train: Sequence[int], validation: Sequence[int]) -> dict[int, Single]:
    """Return the weights of the errors of each run, shape (6,), by the number of the run [-].

    A run weighs by the inverse variance of its loads, over that of the median of the runs to learn from, and at most
    `HEAVIEST` times as much: where water is violent, most of the loads' variance is what no network can know, and it
    would drown what calm water teaches (weighted least squares).
    """
    variance = {r: found.loads[r][found.usable[r]].var(axis=0) for r in {*train, *validation}}
    median = np.maximum(np.median([variance[r] for r in train], axis=0), 1e-12)
    return {r: np.asarray(median / np.maximum(v, median / HEAVIEST), np.float32) for r, v in variance.items()}


def _along(weights: Mapping[int, Single] | None, chosen: Sequence[tuple[int, NDArray[np.intp]]]) -> torch.Tensor:
    """Weights of chosen rows, shape (m, 6), of mean 1; without weights 1 for all."""
    if weights is None:
        return torch.ones(sum(len(rows) for _, rows in chosen), 1)
    found = np.concatenate([np.repeat(weights[r][None], len(rows), axis=0) for r, rows in chosen])
    return torch.from_numpy(found / found.mean(axis=0))


def _polynomial(
    scaled: Examples, train: Sequence[int], preset: Preset, validation_examples: tuple[Single, Single]
) -> dict[str, Single]:
    """Ridge regression on all monomials of the states up to a degree (the coefficient models of the paper's Sec. 1)."""
    x, y = scaled.gather(scaled.choose(train, 0, preset.thinning), preset.architecture)
    terms = monomials(x[:, 0].astype(float), preset.architecture.degree)
    normal = terms.T @ terms + preset.ridge * len(terms) * np.eye(terms.shape[1])
    coefficients = np.linalg.solve(normal, terms.T @ y)
    errors = []
    for inputs, loads in ((x, y), validation_examples):
        off = monomials(inputs[:, 0].astype(float), preset.architecture.degree) @ coefficients - loads
        errors.append(np.array([np.mean(off**2)], np.float32))
    return {
        "coefficients": coefficients.astype(np.float32), "training_loss": errors[0], "held_back_loss": errors[1]
    }  # fmt: skip
