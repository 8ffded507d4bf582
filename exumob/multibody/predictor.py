"""First guess of Newton's iterations in each step: accelerations and multipliers as they changed in the last step.

Exudyn begins each Newton with accelerations and multipliers of zero. What they were at the last two instants,
extrapolated, is as good as the first one to two iterations. Generalised-alpha (Arnold & Bruels 2007) lets the new
accelerations enter coordinates and velocities by the factors of `NewmarkFactors`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from exumob.support.arrays import Array


class NewmarkFactors(NamedTuple):
    """What a change of the accelerations does to the coordinates (times step squared) and velocities (times step)."""

    coordinates: float
    velocities: float

    @classmethod
    def of(cls, spectral_radius: float) -> NewmarkFactors:
        """Return those of generalised-alpha with this spectral radius at infinity [-]."""
        alpha_m = (2.0 * spectral_radius - 1.0) / (spectral_radius + 1.0)
        alpha_f = spectral_radius / (spectral_radius + 1.0)
        gamma = 0.5 + alpha_f - alpha_m
        beta = 0.25 * (gamma + 0.5) ** 2
        share = (1.0 - alpha_f) / (1.0 - alpha_m)
        return cls(share * beta, share * gamma)


class Predictor:
    """Remembers two instants of a system's accelerations and multipliers, and begins Newton with what follows.

    Parameters
    ----------
    coordinates, velocities, accelerations, multipliers : array
        Live views of the system's state, shapes (n,), (n,), (n,) and (m,).
    factors : NewmarkFactors
    """

    def __init__(
        self, coordinates: Array, velocities: Array, accelerations: Array, multipliers: Array, factors: NewmarkFactors
    ) -> None:
        """Begin without memory."""
        self._state = coordinates, velocities, accelerations, multipliers
        self._factors = factors
        self._times = np.full(2, np.nan)
        self._past = np.zeros((2, len(accelerations) + len(multipliers)))

    def forget(self) -> None:
        """Begin anew."""
        self._times[:] = np.nan

    def remember(self, time: float) -> None:
        """Keep the state at the end of a step, at `time` [s]; an instant that is known already changes nothing."""
        _remember(time, self._times, self._past, self._state[2], self._state[3])

    def predict(self, time: float) -> None:
        """Write the guess for the step that ends at `time` [s] into the state, if Newton begins from zero."""
        _predict(time, self._times, self._past, *self._state, *self._factors)

    def save(self) -> Array:
        """Return the memory, to be given to `restore`."""
        return np.concatenate([self._times, self._past.ravel()])

    def restore(self, saved: Array) -> None:
        """Return to what `save` gave."""
        self._times[:] = saved[:2]
        self._past.ravel()[:] = saved[2:]


@njit(cache=True, error_model="numpy")
def _remember(time: float, times: Array, past: Array, accelerations: Array, multipliers: Array) -> None:
    if time <= times[1]:
        return
    n = len(accelerations)
    times[0] = times[1]
    times[1] = time
    for i in range(past.shape[1]):
        past[0, i] = past[1, i]
        past[1, i] = accelerations[i] if i < n else multipliers[i - n]


@njit(cache=True, error_model="numpy")
def _predict(
    time: float, times: Array, past: Array, coordinates: Array, velocities: Array, accelerations: Array,
    multipliers: Array, by_coordinates: float, by_velocities: float,
) -> None:  # fmt: skip
    step = time - times[1]
    if not step > 0.0:
        return  # nothing is remembered yet
    last = times[1] - times[0]
    ratio = step / last if last > 0.0 else 0.0
    n = len(accelerations)
    for i in range(n):
        if accelerations[i] != 0.0:
            return  # Newton goes on from where it was
    for i in range(n):
        acceleration = past[1, i] + ratio * (past[1, i] - past[0, i])
        accelerations[i] = acceleration
        velocities[i] += step * by_velocities * acceleration
        coordinates[i] += step * step * by_coordinates * acceleration
    for i in range(len(multipliers)):
        multipliers[i] = past[1, n + i] + ratio * (past[1, n + i] - past[0, n + i])
