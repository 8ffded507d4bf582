"""Orthogonal multisines with small peaks: signals that excite several quantities at once and can still be told apart.

Each signal is a sum of sines of equal amplitude whose frequencies are whole multiples of one fundamental. Two signals
that share no multiple are orthogonal over the period (Morelli, Multiple input design for real-time parameter estimation
in the frequency domain, IFAC 2003; Grauer & Boucher, Aircraft system identification from multisine inputs and frequency
responses, AIAA 2018). The phases are chosen for a small peak: more of the signal's power stays within the range that it
may use.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import Annotated, NamedTuple

import numpy as np
from scipy.optimize import minimize

from exumob.support.arrays import Array
from exumob.support.declared import checked
from exumob.support.quantities import Quantity

SAMPLES_A_CYCLE = 24
"""Samples in a cycle of the highest harmonic at which a peak is looked for."""
STARTS = 4
"""Sets of phases from which the search for a small peak begins: Schroeder's, and random ones."""
MOST_MULTIPLES = 2000
"""Largest multiple of the fundamental."""
POWER = 24
"""Norm of the signal that stands for its peak while the phases are sought: it can be differentiated."""


class Multisine(NamedTuple):
    """A sum of sines of equal amplitude whose largest value is 1."""

    harmonics: tuple[int, ...]
    """Cycles of each sine in a period"""
    phases: tuple[float, ...]
    """Phase of each [rad]"""
    amplitude: float
    """Amplitude of each [-]"""

    def at(self, cycles: Array) -> Array:
        """Return the signal [-] at times over the period [-]; shape (n,) -> (n,)."""
        angles = 2.0 * math.pi * np.outer(cycles, self.harmonics) + np.array(self.phases)
        return self.amplitude * np.sin(angles).sum(axis=1)


@checked
def relative_peak_factor(signal: Annotated[Array, Quantity("1", shape=("n",))]) -> float:
    """Return the range of a signal over 2 sqrt(2) times its root mean square [-]: 1 for one sine.

    Raises
    ------
    ValueError
        If the signal has no values, or all are 0.
    """
    size = float(np.abs(signal).max(initial=0.0))
    signal = signal / size if size > 0.0 else signal
    deviation = float(np.sqrt(np.mean(signal**2))) if len(signal) else 0.0
    if not deviation > 0.0:
        raise ValueError("relative_peak_factor.signal is 0 everywhere; give one that varies.")
    return float(np.ptp(signal)) / (2.0 * math.sqrt(2.0) * deviation)


@checked
def shared_harmonics(
    period: Annotated[float, Quantity("s", above=0.0, at_most=1e6)],
    highest: Sequence[Annotated[float, Quantity("Hz", above=0.0, at_most=1e3)]],
    turn: Annotated[int, Quantity("1", at_least=0)] = 0,
) -> list[tuple[int, ...]]:
    """Divide the multiples of 1 / `period` among signals, none of which gets one that another has.

    Each multiple goes to the signal that has the fewest so far, out of those whose band it lies in; signals of narrow
    bands come first, as others can have higher ones. With another `turn` equal signals change places: over several
    periods each is excited over its whole band.

    Parameters
    ----------
    period : float
        [s]
    highest : sequence of float
        Upper end of the band of each signal [Hz]; the lower one is 1 / `period`.
    turn : int

    Returns
    -------
    list of tuple of int
        Multiples of each signal, at least one.

    Raises
    ------
    ValueError
        If the period is too short to give each signal one.
    """
    bands = [int(period * upper + 1e-9) for upper in highest]
    if max(bands, default=0) > MOST_MULTIPLES:
        raise ValueError(
            f"shared_harmonics.period = {period:g} s holds {max(bands)} cycles of the highest frequency; give a "
            "shorter one, or lower frequencies."
        )
    found: list[list[int]] = [[] for _ in bands]
    for multiple in range(1, max(bands, default=0) + 1):
        open_ones = [n for n, band in enumerate(bands) if band >= multiple]
        narrowest = min(bands[n] for n in open_ones)
        first = [n for n in open_ones if bands[n] == narrowest]
        least = min(first, key=lambda n: (len(found[n]), (first.index(n) + turn) % len(first)))
        found[least].append(multiple)
    if not all(found):
        raise ValueError(
            f"shared_harmonics.period = {period:g} s is too short to tell {len(bands)} signals of up to "
            f"{', '.join(f'{upper:.3g}' for upper in highest)} Hz apart; give a longer one, or higher frequencies."
        )
    return [tuple(multiples) for multiples in found]


@lru_cache(maxsize=1024)
def small_peak(harmonics: tuple[int, ...], seed: int) -> Multisine:
    """Return the multisine of some harmonics with phases that make its peak small; `seed` draws where they begin.

    The search begins at the phases of Schroeder (IEEE Trans. Inf. Theory 16 (1970) 85) and at random ones, and goes
    downhill in a high norm of the signal; what it finds is a small peak, not the smallest.
    """
    count, most = len(harmonics), max(harmonics)
    cycles = np.arange(SAMPLES_A_CYCLE * most) / (SAMPLES_A_CYCLE * most)
    turns = 2.0 * math.pi * np.outer(cycles, harmonics)
    scale = math.sqrt(0.5 * count)

    def norm(phases: Array) -> tuple[float, Array]:
        angles = turns + phases
        signal = np.sin(angles).sum(axis=1) / scale
        powers = np.abs(signal) ** (POWER - 1) * np.sign(signal)
        mean = float(np.mean(powers * signal))
        value = mean ** (1.0 / POWER)
        slope = (powers[:, None] * np.cos(angles)).mean(axis=0) / scale
        return value, value / mean * slope

    random = np.random.default_rng([seed, *harmonics])
    order = np.arange(1, count + 1)
    starts = [-math.pi * order * (order - 1) / count + random.uniform(0.0, 2.0 * math.pi) * np.array(harmonics)]
    starts += [random.uniform(0.0, 2.0 * math.pi, count) for _ in range(STARTS - 1)]
    if count == 1:
        best = starts[-1]
    else:
        found = [minimize(norm, start, jac=True, method="L-BFGS-B", options={"maxiter": 200}) for start in starts]
        best = min(found, key=lambda result: result.fun).x
    fine = np.arange(4 * len(cycles)) / (4 * len(cycles))
    signal = np.sin(2.0 * math.pi * np.outer(fine, harmonics) + best).sum(axis=1)
    phases = tuple(float(phase) for phase in np.mod(best, 2.0 * math.pi))
    return Multisine(harmonics, phases, 1.0 / float(np.abs(signal).max()))
