"""What networks remember of their inputs: exponential filters, which run along with the vehicle.

The loads on the hull lag the motion by a second, as the bow wave builds up. A filter with time constant tau forgets its
input x with that constant, tau dz/dt = x - z, and with several of them a network sees the past in a few numbers: the
indicial functions of unsteady aerodynamics are approximated by such lags (R. T. Jones, NACA Report 681, 1940).
Between two instants the input is taken as a straight line, for which the step is exact whatever its length.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from exumob.support.arrays import Array


class FilterStep(NamedTuple):
    """Factors of one step of the filters, each of shape (filters,): new = keep old + before x_0 + now x_1."""

    keep: Array
    before: Array
    now: Array


def filter_step(time_constants: Sequence[float], step: float) -> FilterStep:
    """Return the factors of the exact step for an input that changes linearly.

    Parameters
    ----------
    time_constants : sequence of float
        [s], > 0.
    step : float
        [s], > 0.
    """
    tau = np.asarray(time_constants, float)
    keep = np.exp(-step / tau)
    share = tau / step * -np.expm1(-step / tau)
    return FilterStep(keep, share - keep, 1.0 - share)


def filtered(inputs: NDArray[Any], time_constants: Sequence[float], step: float) -> NDArray[Any]:
    """Filter inputs along a run; before its beginning they are taken as its first ones.

    Parameters
    ----------
    inputs : array, shape (n, ...)
    time_constants : sequence of float
        [s]
    step : float
        Interval between the instants [s].

    Returns
    -------
    array, shape (n, filters, ...)
        Of the inputs' type.
    """
    found = np.empty((len(inputs), len(time_constants), *inputs.shape[1:]), inputs.dtype)
    away = np.asarray(inputs, float) - inputs[:1]
    for n, (keep, before, now) in enumerate(zip(*filter_step(time_constants, step), strict=True)):
        found[:, n] = inputs[:1] + lfilter([now, before], [1.0, -keep], away, axis=0)
    return found


class InputMemory:
    """The filtered inputs of networks in a run.

    Parameters
    ----------
    time_constants : sequence of float
        [s]
    """

    def __init__(self, time_constants: Sequence[float]) -> None:
        self.time_constants = tuple(time_constants)
        self._time = 0.0
        self._last: Array | None = None
        self._past = np.empty(0)

    def filtered(self, time: float, inputs: Array, still: bool = False) -> Array:
        """Take the inputs of an instant, and return the filtered ones.

        Parameters
        ----------
        time : float
            [s]; not before that of the last call.
        inputs : array, shape (...)
        still : bool
            True: the vehicle has no past yet; it is as if these had been the inputs for ever, and the next ones, too.

        Returns
        -------
        array, shape (filters, ...)
        """
        if still or self._last is None:
            self._past = np.repeat(inputs[None], len(self.time_constants), axis=0)
        elif time > self._time:
            step = filter_step(self.time_constants, time - self._time)
            keep, before, now = (f.reshape(-1, *(1,) * inputs.ndim) for f in step)
            self._past = keep * self._past + before * self._last + now * inputs
        self._time, self._last = time, None if still else inputs.copy()
        return self._past

    def save(self) -> dict[str, Any]:
        """Return the state."""
        return {"time": self._time, "last": self._last, "past": self._past}

    def restore(self, saved: dict[str, Any]) -> None:
        """Return to a state of `save`."""
        self._time = float(saved["time"])
        self._last = None if saved["last"] is None else np.array(saved["last"])
        self._past = np.array(saved["past"])
