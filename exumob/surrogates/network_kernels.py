"""Evaluation of the networks without torch: LSTM, dense and output layers, and the monomials of the regression.

For one instant, kernels in single precision that read each weight once; for many instants, matrix products. The same
networks as torch modules, for training: `exumob.learning.torch_networks`.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from exumob.support.arrays import Array
from exumob.support.kernels import njit

Single = NDArray[np.float32]


class InputScaling(NamedTuple):
    """Scalers of the inputs and the limits at which they are held, each of shape (networks, k)."""

    mean: Single
    scale: Single
    lowest: Single
    highest: Single


class TrainingRange(NamedTuple):
    """Range of the inputs in training."""

    low: Single
    high: Single
    width: Single
    scale: Single
    """By which states are compared; each of shape (networks, k)"""
    states: Single
    """Inputs of instants in training, less their mean and over that scale, shape (networks, k, n)"""
    reach: Single
    """Distance from them at which the range ends, shape (networks,)"""


class OutputLayers(NamedTuple):
    """The dense layer that follows the first layer, and the linear one, of all networks; matrices transposed."""

    dense_weight: Single
    """Shape (networks, hidden units, dense units)"""
    dense_bias: Single
    """Shape (networks, dense units)"""
    out_weight: Single
    """Shape (networks, dense units, 6)"""
    out_bias: Single
    mean: Single
    scale: Single
    """Bias, and scalers of the wrenches, shape (networks, 6)"""


@njit(cache=True, error_model="numpy")
def _scale(inputs: Array, scaling: InputScaling, net: int, scaled: Single) -> None:
    """Hold the inputs of a network at their limits, take off their mean and divide by their scale; nan stays nan."""
    mean, scale, lowest, highest = scaling.mean[net], scaling.scale[net], scaling.lowest[net], scaling.highest[net]
    for tap in range(len(scaled)):
        for i in range(scaled.shape[1]):
            held = np.minimum(np.maximum(inputs[tap, i], lowest[i]), highest[i])
            scaled[tap, i] = (held - mean[i]) / scale[i]


@njit(cache=True, error_model="numpy")
def measure_excess(inputs: Array, trained: TrainingRange, scaling: InputScaling, excess: Array) -> None:
    """Measure how far inputs lie outside the training range (`exumob.surrogates.networks.NetworkSet.excess`).

    Parameters
    ----------
    inputs : array, shape (bodies, k)
    trained : TrainingRange
    scaling : InputScaling
    excess : array, shape (networks, 2), changed
        Of the worst single input, and of all jointly. Where an input is not a number, neither is.
    """
    z, squares = np.empty(inputs.shape[1]), np.empty(trained.states.shape[2])
    for net in range(len(excess)):
        x = inputs[net % len(inputs)]
        low, high, width, states = trained.low[net], trained.high[net], trained.width[net], trained.states[net]
        single = -np.inf
        for i in range(x.size):
            single = np.maximum(single, np.maximum(low[i] - x[i], x[i] - high[i]) / width[i])
            z[i] = (x[i] - scaling.mean[net, i]) / trained.scale[net, i]
        squares[:] = 0.0
        for i in range(x.size):
            for n in range(squares.size):
                squares[n] += (z[i] - states[i, n]) ** 2
        nearest = np.inf
        for n in range(squares.size):
            nearest = np.minimum(nearest, squares[n])  # nan stays nan
        excess[net, 0] = single
        excess[net, 1] = math.sqrt(nearest) / trained.reach[net] - 1.0


@njit(cache=True, error_model="numpy")
def mean_and_spread(values: Array) -> tuple[Array, Array]:
    """Return mean and standard deviation over the first axis, shape (n, a, b) -> (a, b); 0 if n is 1."""
    n = len(values)
    mean = np.zeros(values.shape[1:])
    for member in range(n):
        mean += values[member]
    mean /= n
    spread = np.zeros_like(mean)
    for member in range(n):
        spread += (values[member] - mean) ** 2
    return mean, np.sqrt(spread / max(n - 1, 1))


@njit(inline="always")
def _tanh(x: np.float32) -> np.float32:
    """Tanh to 3e-7 as a quotient of polynomials, the one of Eigen (MPL 2): without calls, hence vectorised."""
    x = min(max(x, np.float32(-7.9053111)), np.float32(7.9053111))
    s = x * x
    p = np.float32(-2.76076847742355e-16)
    p = p * s + np.float32(2.00018790482477e-13)
    p = p * s + np.float32(-8.60467152213735e-11)
    p = p * s + np.float32(5.12229709037114e-08)
    p = p * s + np.float32(1.48572235717979e-05)
    p = p * s + np.float32(6.37261928875436e-04)
    p = p * s + np.float32(4.89352455891786e-03)
    q = np.float32(1.19825839466702e-06)
    q = q * s + np.float32(1.18534705686654e-04)
    q = q * s + np.float32(2.26843463243900e-03)
    q = q * s + np.float32(4.89352518554385e-03)
    return x * p / q


@njit(inline="always")
def _add_product(transposed: Single, x: Single, out: Single) -> None:
    """Out += transposed.T @ x, four rows at a time: contiguous, vectorised, and out stays in the nearest cache."""
    n = transposed.shape[0]
    whole = n - n % 4
    for k in range(0, whole, 4):
        x0, x1, x2, x3 = x[k], x[k + 1], x[k + 2], x[k + 3]
        r0, r1, r2, r3 = transposed[k], transposed[k + 1], transposed[k + 2], transposed[k + 3]
        for j in range(out.size):
            out[j] += r0[j] * x0 + r1[j] * x1 + r2[j] * x2 + r3[j] * x3
    for k in range(whole, n):
        row, value = transposed[k], x[k]
        for j in range(out.size):
            out[j] += row[j] * value


@njit(cache=True, fastmath=True, error_model="numpy")
def evaluate_lstm(
    inputs: Array, scaling: InputScaling, w: Single, u: Single, b: Single, layers: OutputLayers, wrenches: Array
) -> None:  # fmt: skip
    """Evaluate paper Eqs. (8) and (9), then the output layers, network by network; gates in the order i, f, c, o.

    Parameters
    ----------
    inputs : array, shape (bodies, taps, k)
        Oldest instant first, for the networks of one set after the other.
    scaling : InputScaling
    w, u, b : arrays, shape (networks, k, 4 n), (networks, n, 4 n) and (networks, 4 n)
        Input weights and recurrent weights, transposed (inputs first), and biases of n units.
    layers : OutputLayers
    wrenches : array, shape (networks, 6), changed
        [N, N m]
    """
    n = u.shape[1]
    x = np.empty(inputs.shape[1:], np.float32)
    hidden, cell, gates = np.empty(n, np.float32), np.empty(n, np.float32), np.empty(4 * n, np.float32)
    half = np.float32(0.5)
    for net in range(len(wrenches)):
        _scale(inputs[net % len(inputs)], scaling, net, x)
        cell[:] = 0.0
        for tap in range(len(x)):
            gates[:] = b[net]
            _add_product(w[net], x[tap], gates)
            if tap > 0:  # h = 0 before
                _add_product(u[net], hidden, gates)
            for j in range(n):
                keep = half + half * _tanh(half * gates[n + j])
                take = half + half * _tanh(half * gates[j])
                cell[j] = keep * cell[j] + take * _tanh(gates[2 * n + j])
            for j in range(n):
                hidden[j] = _tanh(cell[j]) * (half + half * _tanh(half * gates[3 * n + j]))
        _unscale(_evaluate_output(hidden, layers, net), layers, net, wrenches[net])


@njit(cache=True, fastmath=True, error_model="numpy")
def evaluate_dense(
    inputs: Array, scaling: InputScaling, w: Single, b: Single, layers: OutputLayers, wrenches: Array
) -> None:  # fmt: skip
    """Evaluate the network of the ablation: a dense layer in the place of the LSTM, then the output layers.

    Parameters
    ----------
    inputs : array, shape (bodies, taps, k)
        Oldest instant first, for the networks of one set after the other.
    scaling : InputScaling
    w, b : arrays, shape (networks, taps k, n) and (networks, n)
        Weights, transposed, and biases of n units.
    layers : OutputLayers
    wrenches : array, shape (networks, 6), changed
        [N, N m]
    """
    x = np.empty(inputs.shape[1:], np.float32)
    hidden = np.empty(w.shape[2], np.float32)
    for net in range(len(wrenches)):
        _scale(inputs[net % len(inputs)], scaling, net, x)
        hidden[:] = b[net]
        _add_product(w[net], x.reshape(x.size), hidden)
        for j in range(hidden.size):
            hidden[j] = _tanh(hidden[j])
        _unscale(_evaluate_output(hidden, layers, net), layers, net, wrenches[net])


@njit(cache=True, fastmath=True, error_model="numpy")
def _evaluate_output(hidden: Single, layers: OutputLayers, net: int) -> Single:
    """Return the answer of a network's dense layer and of its linear one."""
    dense, out = layers.dense_bias[net].copy(), layers.out_bias[net].copy()
    _add_product(layers.dense_weight[net], hidden, dense)
    for j in range(dense.size):
        dense[j] = _tanh(dense[j])
    _add_product(layers.out_weight[net], dense, out)
    return out


@njit(cache=True, error_model="numpy")
def _unscale(out: Single, layers: OutputLayers, net: int, wrench: Array) -> None:
    """Bring a network's answer to its units."""
    for i in range(wrench.size):
        wrench[i] = out[i] * layers.scale[net, i] + layers.mean[net, i]


def evaluate_batch(scaled: Single, weights: Mapping[str, Single], recurrent: bool) -> Single:
    """Evaluate networks for n instants at once.

    Parameters
    ----------
    scaled : array, shape (n, bodies, taps, k)
        Scaled inputs, oldest instant first.
    weights : mapping of arrays
        By name, as in `exumob.surrogates.networks.Architecture.shapes`, body first, not transposed.
    recurrent : bool
        True: the first layer is an LSTM; False: a dense one.

    Returns
    -------
    array, shape (n, bodies, 6)
        Scaled wrenches.
    """
    x = np.moveaxis(scaled, 1, 0)  # body, instant, tap, input
    w, b = weights["W"].mT, weights["b"][:, None]
    if recurrent:
        u = weights["U"].mT
        hidden = cell = np.zeros((len(x), len(scaled), u.shape[1]), np.float32)
        for tap in range(x.shape[2]):
            gates = x[:, :, tap] @ w + hidden @ u + b
            i, f, g, o = np.split(gates, 4, axis=-1)
            cell = _sigmoid(f) * cell + _sigmoid(i) * np.tanh(g)
            hidden = _sigmoid(o) * np.tanh(cell)
    else:
        hidden = np.tanh(x.reshape(len(x), len(scaled), -1) @ w + b)
    dense = np.tanh(hidden @ weights["dense_weight"].mT + weights["dense_bias"][:, None])
    return np.moveaxis(dense @ weights["out_weight"].mT + weights["out_bias"][:, None], 0, 1)


def _sigmoid(x: Single) -> Single:
    return np.asarray(1.0 / (1.0 + np.exp(-x)), np.float32)


@cache
def exponents(k: int, degree: int) -> list[tuple[int, ...]]:
    """Return the factors of each monomial of k variables up to a degree, as indices of the variables."""
    return [c for d in range(degree + 1) for c in itertools.combinations_with_replacement(range(k), d)]


def monomials(x: NDArray[Any], degree: int) -> NDArray[Any]:
    """Return all monomials of variables up to a degree; shape (..., k) -> (..., terms)."""
    columns = [
        np.prod(x[..., list(c)], axis=-1) if c else np.ones(x.shape[:-1]) for c in exponents(x.shape[-1], degree)
    ]
    return np.stack(columns, axis=-1)
