"""How far can a computed number be trusted: grid-convergence index, and statistical uncertainty of a mean?

Celik et al., "Procedure for estimation and reporting of uncertainty due to discretization in CFD applications",
J. Fluids Eng. 130 (2008) 078001; Roache, J. Fluids Eng. 116 (1994) 405; Eca & Hoekstra, J. Comput. Phys. 262 (2014)
104, for what to do where the grids do not converge monotonically.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

FORMAL_ORDER = 2.0
"""Order of the scheme; an observed order beyond it is chance and is not used for the index."""
LEAST_ORDER = 0.5
"""Below it the grids are too far from convergence for an extrapolation to mean anything."""
SAFETY, CAUTIOUS = 1.25, 3.0
"""Factors of safety [-]: three grids that converge monotonically; anything else (then on the range of the values)."""
STEEPEST = 20.0


class GridConvergence(NamedTuple):
    """Convergence of a number over three grids."""

    order: float
    """Observed order [-]; negative: the values diverge; NaN: the two finest or the two coarsest values are equal"""
    extrapolated: float
    """Value at cell size 0, in the unit of the values; NaN if they diverge"""
    gci: float
    """Grid-convergence index of the finest grid, as a half width in the unit of the values"""
    kind: str
    """"monotonic", "oscillatory", "divergent" or "equal\""""


def grid_convergence(sizes: Sequence[float], values: Sequence[float]) -> GridConvergence:
    """Observed order, Richardson value and grid-convergence index of three grids.

    The order p solves |e32 / e21| = r21^p (r32^p - s) / (r21^p - s) with e32, e21 the differences of values between
    the coarse pair and the fine pair of grids, r the ratios of cell sizes, and s the sign of e32 / e21 (Celik et al.,
    Eqs. 5a to 5c, without the absolute value that would give diverging values an order). The index is absolute, not
    over the value: a load may be near 0.

    Parameters
    ----------
    sizes : sequence of 3 float
        Cell sizes [m], in any order, all different.
    values : sequence of 3 float
        Values found on them.

    Returns
    -------
    GridConvergence
        Index 1.25 |e21| / (r21^p - 1) for monotonic convergence of order >= 0.5 (p limited to 2), else 3 times the
        range of the values.

    Raises
    ------
    ValueError
        If there are not three different positive sizes or three finite values.
    """
    h, f = np.asarray(sizes, dtype=float), np.asarray(values, dtype=float)
    if h.shape != (3,) or f.shape != (3,):
        raise ValueError(f"grid_convergence needs 3 sizes and 3 values, not {h.size} and {f.size}.")
    if not np.all(np.isfinite(f)) or not np.all(np.isfinite(h)) or h.min() <= 0.0 or len(set(h.tolist())) < 3:
        raise ValueError(f"grid_convergence: sizes {h} must be positive and different, values {f} finite.")
    rank = np.argsort(h)
    h, f = h[rank], f[rank]
    fine, coarse = float(f[1] - f[0]), float(f[2] - f[1])
    spread = CAUTIOUS * float(np.ptp(f))
    if fine == 0.0 or coarse == 0.0:
        return GridConvergence(math.nan, float(f[0]) if fine == 0.0 else math.nan, spread, "equal")
    r21, r32 = float(h[1] / h[0]), float(h[2] / h[1])
    s = math.copysign(1.0, coarse / fine)
    wanted = math.log(abs(coarse / fine))

    def excess(p: float) -> float:
        if p == 0.0:
            return (math.log(math.log(r32) / math.log(r21)) if s > 0.0 else 0.0) - wanted
        return p * math.log(r21) + math.log((r32**p - s) / (r21**p - s)) - wanted

    low, high = excess(-STEEPEST), excess(STEEPEST)
    order = math.copysign(STEEPEST, -low) if low * high > 0.0 else float(brentq(excess, -STEEPEST, STEEPEST))
    if order <= 0.0:
        return GridConvergence(order, math.nan, spread, "divergent")
    weight = r21**order
    extrapolated = float((weight * f[0] - s * f[1]) / (weight - s))
    if s < 0.0:
        return GridConvergence(order, extrapolated, spread, "oscillatory")
    if order < LEAST_ORDER:
        return GridConvergence(order, extrapolated, spread, "monotonic")
    gci = SAFETY * abs(fine) / (r21 ** min(order, FORMAL_ORDER) - 1.0)
    return GridConvergence(order, extrapolated, gci, "monotonic")


class MeanUncertainty(NamedTuple):
    """Mean of a correlated series, and how uncertain it is."""

    mean: float
    error: float
    """Standard error of the mean, in the unit of the series"""
    correlation: float
    """Samples per independent one [-]"""
    batch_error: float
    """The same standard error from batch means, as a cross-check"""


def mean_uncertainty(series: ArrayLike, batches: int = 10) -> MeanUncertainty:
    """Standard error of the mean of equally spaced, correlated samples.

    error = deviation sqrt(tau / n) with tau = 1 + 2 sum of the autocorrelation, summed up to the first lag that is
    five times tau (Sokal, "Monte Carlo methods in statistical mechanics", 1989). A series of fewer than some twenty
    tau is too short for it: the two estimates then differ.

    Parameters
    ----------
    series : array-like, shape (n,)
        Samples at equal intervals, at least 4 a batch.
    batches : int
        Number of batches of the cross-check, at least 2.

    Raises
    ------
    ValueError
        If the series is too short or not finite.
    """
    x = np.asarray(series, dtype=float)
    n = x.size
    if x.ndim != 1 or batches < 2 or n < 4 * batches or not np.all(np.isfinite(x)):
        raise ValueError(f"mean_uncertainty: {n} samples; give a finite series of at least 4 for each batch.")
    d = x - x.mean()
    variance = float(np.mean(d**2))
    means = x[: n // batches * batches].reshape(batches, -1).mean(axis=1)
    batch = float(means.std(ddof=1) / math.sqrt(batches))
    if variance == 0.0:
        return MeanUncertainty(float(x.mean()), 0.0, 1.0, 0.0)
    power = np.abs(np.fft.rfft(d, 2 * n)) ** 2
    correlation = np.fft.irfft(power)[:n] / (n * variance)
    tau = 2.0 * np.cumsum(correlation) - 1.0
    enough = np.flatnonzero(np.arange(n) >= 5.0 * tau)
    found = max(float(tau[enough[0]] if enough.size else tau.max()), 1.0 / n)
    return MeanUncertainty(float(x.mean()), math.sqrt(variance * found / n), found, batch)


def deviation_uncertainty(series: ArrayLike) -> tuple[float, float]:
    """Standard deviation of a series and its standard error: that of the mean square, halved over the deviation."""
    x = np.asarray(series, dtype=float)
    squares = mean_uncertainty((x - x.mean()) ** 2)
    deviation = math.sqrt(squares.mean)
    return deviation, squares.error / (2.0 * deviation) if deviation > 0.0 else 0.0
