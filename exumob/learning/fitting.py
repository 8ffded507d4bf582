"""Fitting the network of one body to its examples: the same bits from the same seed on one machine.

What the paper leaves open was chosen on validation runs alone. Loss: mean square error of the six scaled loads, equal
weights. Optimiser: Adam; gradients are cut off at norm 1. Activation of the dense layers: tanh. Training stops when the
validation error no longer falls, and the weights of the best epoch are kept.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import torch

from exumob.learning.examples import Examples, scalers
from exumob.learning.presets import Preset
from exumob.learning.torch_networks import LoadNetwork
from exumob.surrogates.networks import Single, monomials


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
        errors of scaled loads.
    """
    torch.set_num_threads(1)
    architecture = preset.architecture
    scale = scalers(found, train, architecture)
    scaled = replace(
        found,
        inputs=[(x - scale["input_mean"]) / scale["input_scale"] for x in found.inputs],
        loads=[(y - scale["output_mean"]) / scale["output_scale"] for y in found.loads],
    )
    validation_examples = scaled.gather(scaled.choose(validation, 0, preset.thinning), architecture)
    if architecture.layer == "polynomial":
        return scale | _polynomial(scaled, train, preset, validation_examples)

    generator = torch.Generator().manual_seed(1000 * seed + body)
    network = LoadNetwork(architecture, generator)
    optimizer = torch.optim.Adam(network.parameters(), preset.learning_rate)
    validation_x, validation_y = (torch.from_numpy(a) for a in validation_examples)
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
            error = float(torch.mean((network(validation_x) - validation_y) ** 2))
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
