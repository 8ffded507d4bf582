"""Measures that several cases take of a run: orders of convergence, periods, decays."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy.optimize import curve_fit

from exumob.support.arrays import Array


def fitted_order(cells: Sequence[float], errors: Sequence[float]) -> float:
    """Exponent p of errors ~ cells^p by least squares of the logarithms."""
    return float(np.polyfit(np.log(cells), np.log(np.abs(errors)), 1)[0])


def observed_order(values: Sequence[float], ratio: float) -> float:
    """Order of convergence from three grids, coarse to fine, each finer by `ratio`; nan if they do not converge."""
    first, second = values[1] - values[0], values[2] - values[1]
    return math.log(first / second) / math.log(ratio) if first * second > 0.0 else math.nan


def crossing_period(time: Array, values: Array, step: float) -> float:
    """Period of an oscillation [s] from its passages through zero, between samples `step` [s] apart."""
    i = np.nonzero(values[:-1] * values[1:] < 0.0)[0]
    crossings = time[i] - values[i] * step / (values[i + 1] - values[i])
    return 2.0 * float(np.mean(np.diff(crossings)))


def fitted_oscillation(time: Array, values: Array, period: float) -> tuple[float, float]:
    """Period [s] and damping ratio [-] of b + exp(-d t) (a1 cos w t + a2 sin w t) fitted to a decay.

    A bias b of the place of rest, by a fraction of a millimetre, would shift the passages through zero. `period` is the
    fit's first guess [s].
    """

    def model(t: Array, b: float, d: float, w: float, a1: float, a2: float) -> Array:
        return b + np.exp(-d * t) * (a1 * np.cos(w * t) + a2 * np.sin(w * t))

    guess = (0.0, 0.5, 2.0 * math.pi / period, float(values[0]), 0.0)
    (_, d, w, _, _), _ = curve_fit(model, time, values, guess)
    return 2.0 * math.pi / abs(w), d / math.hypot(d, w)


def extremes(values: Array) -> Array:
    """First value and all local extremes, in order."""
    inner = values[1:-1]
    turning = (inner - values[:-2]) * (values[2:] - inner) < 0.0
    return np.concatenate([values[:1], inner[turning]])
