"""Smoothing of load histories."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from exumob.support.arrays import Array, checked_array
from exumob.support.checks import require_positive

WINDOW = 0.015
"""Default window [s]. Windows of 10 to 20 ms keep the physics of a vehicle's loads (waves at its bow last 0.1 s and
more) and remove the steps that arise when the computed surface crosses cells."""


def smoothed(values: ArrayLike, interval: float, window: float = WINDOW) -> Array:
    """Return the centred moving average along the first axis; it shifts no phase.

    Towards both ends the window shrinks evenly on either side: no value is repeated or invented, and a straight line
    stays one up to its ends.

    Parameters
    ----------
    values : array-like, shape (n, ...)
        Samples at equal intervals, all finite.
    interval : float
        Time between two samples [s].
    window : float
        Length of the average [s], rounded to an odd number of samples (`window_samples`).

    Returns
    -------
    array, shape (n, ...)

    Raises
    ------
    ValueError
        If values are masked or no numbers.
    """
    dimensions = ["n", *(f"n_{k}" for k in range(1, np.ndim(values)))]
    samples = checked_array("smoothed.values", values, tuple(dimensions), finite=False)
    n, half = len(samples), window_samples(interval, window) // 2
    index = np.arange(n)
    reach = np.minimum(half, np.minimum(index, n - 1 - index))
    sums = np.concatenate([np.zeros((1, *samples.shape[1:])), np.cumsum(samples, axis=0)])
    counts = (2 * reach + 1).reshape(-1, *[1] * (samples.ndim - 1))
    return np.asarray((sums[index + reach + 1] - sums[index - reach]) / counts)


def window_samples(interval: float, window: float = WINDOW) -> int:
    """Return the odd number of samples nearest to a window [s], at least 1."""
    require_positive("smoothed", interval=interval, window=window)
    return 2 * max(round(0.5 * (window / interval - 1.0)), 0) + 1
