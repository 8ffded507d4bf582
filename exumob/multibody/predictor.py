"""First guess of Newton's iterations in each step: accelerations and multipliers as they changed in the last step.

Exudyn begins each Newton with accelerations and multipliers of zero. What they were at the last two instants,
extrapolated, is as good as the first one to two iterations. Generalised-alpha (Arnold & Bruels 2007) lets the new
accelerations enter coordinates and velocities by the factors of `NewmarkFactors`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from exumob.support.arrays import Array
from exumob.support.kernels import njit

INSTANTS = 3
"""Number of instants that are remembered: a parabola through them."""


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
        self._times = np.full(INSTANTS, np.nan)
        self._past = np.zeros((INSTANTS, len(accelerations) + len(multipliers)))

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
        self._times[:] = saved[:INSTANTS]
        self._past.ravel()[:] = saved[INSTANTS:]


@njit(cache=True, error_model="numpy")
def _remember(time: float, times: Array, past: Array, accelerations: Array, multipliers: Array) -> None:
    last = INSTANTS - 1
    if time <= times[last]:
        return
    for i in range(last):
        times[i] = times[i + 1]
        past[i] = past[i + 1]
    times[last] = time
    n = len(accelerations)
    for k in range(n):
        past[last, k] = accelerations[k]
    for k in range(len(multipliers)):
        past[last, n + k] = multipliers[k]


@njit(cache=True, error_model="numpy")
def _predict(
    time: float, times: Array, past: Array, coordinates: Array, velocities: Array, accelerations: Array,
    multipliers: Array, by_coordinates: float, by_velocities: float,
) -> None:  # fmt: skip
    step = time - times[INSTANTS - 1]
    if not step > 0.0:
        return  # nothing is remembered yet
    n = len(accelerations)
    for k in range(n):
        if accelerations[k] != 0.0:
            return  # Newton goes on from where it was
    weights = np.zeros(INSTANTS)  # Lagrange's, of the polynomial through the known instants
    for i in range(INSTANTS):
        if np.isnan(times[i]):
            continue
        weights[i] = 1.0
        for m in range(INSTANTS):
            if m != i and not np.isnan(times[m]):
                weights[i] *= (time - times[m]) / (times[i] - times[m])
    for k in range(n):
        acceleration = 0.0
        for i in range(INSTANTS):
            acceleration += weights[i] * past[i, k]
        accelerations[k] = acceleration
        velocities[k] += step * by_velocities * acceleration
        coordinates[k] += step * step * by_coordinates * acceleration
    for k in range(len(multipliers)):
        multiplier = 0.0
        for i in range(INSTANTS):
            multiplier += weights[i] * past[i, n + k]
        multipliers[k] = multiplier
