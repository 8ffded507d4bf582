"""Cases of a sweep: full grids, and random or quasi-random samples of stated, possibly correlated distributions."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, Protocol

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy import stats
from scipy.stats import qmc

from exumob.support.arrays import Array
from exumob.support.checks import require_finite, require_positive, require_within

Case = dict[str, Any]
"""Values by dotted name."""
Method = Literal["sobol", "halton", "lhs", "random"]
"""How `sample` fills the space of the parameters."""


class Distribution(Protocol):
    """Distribution of one parameter, given by its quantiles."""

    def quantile(self, share: Array) -> NDArray[Any]:
        """Values below which a parameter lies with the probabilities `share` (0 to 1)."""


@dataclass(frozen=True)
class Uniform:
    """Uniform distribution from `low` to `high`."""

    low: float
    high: float

    def __post_init__(self) -> None:
        require_finite("Uniform", low=self.low, high=self.high)
        _ordered("Uniform", low=self.low, high=self.high)

    def quantile(self, share: Array) -> NDArray[Any]:
        """See `Distribution`."""
        return self.low + (self.high - self.low) * share


@dataclass(frozen=True)
class Normal:
    """Gaussian distribution, cut off at `low` and `high`."""

    mean: float
    deviation: float
    low: float = -math.inf
    high: float = math.inf

    def __post_init__(self) -> None:
        require_finite("Normal", mean=self.mean)
        require_positive("Normal", deviation=self.deviation)
        _ordered("Normal", low=self.low, high=self.high)

    def quantile(self, share: Array) -> NDArray[Any]:
        """See `Distribution`."""
        ends = ((end - self.mean) / self.deviation for end in (self.low, self.high))
        return np.asarray(stats.truncnorm.ppf(share, *ends, loc=self.mean, scale=self.deviation))


@dataclass(frozen=True)
class LogNormal:
    """Log-normal distribution; `spread` is the standard deviation of the logarithm (0.1: about 10 %)."""

    median: float
    spread: float

    def __post_init__(self) -> None:
        require_positive("LogNormal", median=self.median, spread=self.spread)

    def quantile(self, share: Array) -> NDArray[Any]:
        """See `Distribution`."""
        return np.asarray(self.median * np.exp(self.spread * stats.norm.ppf(share)))


@dataclass(frozen=True)
class Triangular:
    """Triangular distribution from `low` to `high` with its peak at `mode`."""

    low: float
    mode: float
    high: float

    def __post_init__(self) -> None:
        require_finite("Triangular", low=self.low, high=self.high)
        _ordered("Triangular", low=self.low, high=self.high)
        require_within("Triangular", self.low, self.high, mode=self.mode)

    def quantile(self, share: Array) -> NDArray[Any]:
        """See `Distribution`."""
        width = self.high - self.low
        return np.asarray(stats.triang.ppf(share, (self.mode - self.low) / width, loc=self.low, scale=width))


@dataclass(frozen=True)
class Choice:
    """Choice among several values, numbers or names."""

    values: tuple[Any, ...]
    weights: tuple[float, ...] | None = None
    """Weight of each value; None: all alike"""

    def __post_init__(self) -> None:
        if not self.values:
            raise ValueError("Choice.values is empty; give one value at least.")
        weights = self.weights or (1.0,) * len(self.values)
        if len(weights) != len(self.values) or min(weights) < 0.0 or not sum(weights) > 0.0:
            raise ValueError(f"Choice.weights = {self.weights}: give one weight >= 0 for each of {self.values}.")

    def quantile(self, share: Array) -> NDArray[Any]:
        """See `Distribution`."""
        weights = np.asarray(self.weights or np.ones(len(self.values)), float)
        which = np.searchsorted(np.cumsum(weights) / weights.sum(), share, side="right")
        values = np.empty(len(self.values), object)
        values[:] = self.values
        return values[np.minimum(which, len(values) - 1)]


DISTRIBUTIONS = {
    "uniform": Uniform, "normal": Normal, "lognormal": LogNormal, "triangular": Triangular,
}  # fmt: skip
"""Distributions by their names in study files; a `Choice` is written as the list of its values."""


def grid(values: Mapping[str, Sequence[Any]]) -> list[Case]:
    """Cases with all combinations of values, the last name varying fastest.

    Raises
    ------
    ValueError
        If a name has no values.
    """
    for name, found in values.items():
        if not len(found):
            raise ValueError(f"grid: {name} has no values; give one at least.")
    return [dict(zip(values, row, strict=True)) for row in itertools.product(*values.values())]


def sample(
    number: int, distributions: Mapping[str, Distribution], *, method: Method = "sobol", seed: int = 0,
    correlations: Mapping[tuple[str, str], float] | None = None,
) -> list[Case]:  # fmt: skip
    """Draw cases from distributions.

    Parameters
    ----------
    number : int
        Number of cases; for ``"sobol"`` a power of 2 is best.
    distributions : mapping
        Distributions by dotted name.
    method : str
        Quasi-random (``"sobol"``, ``"halton"``), Latin hypercube (``"lhs"``) or ``"random"``.
    seed : int
        The same seed gives the same cases.
    correlations : mapping, optional
        Correlations by pairs of names: those of the Gaussian variables behind them (a Gaussian copula; Iman & Conover,
        Commun. Stat. B 11 (1982) 311, use the same where only ranks are to be correlated).

    Raises
    ------
    ValueError
        If a correlation names an unknown parameter or the correlations contradict each other.
    """
    require_within("sample", 1, 10_000_000, number=number)
    names, n = list(distributions), len(distributions)
    if not n:
        raise ValueError("sample: there are no distributions; give one at least.")
    rng = np.random.default_rng(seed)
    if method == "random":
        shares = rng.random((number, n))
    elif method == "sobol":
        shares = qmc.Sobol(n, rng=rng).random_base2(math.ceil(math.log2(number)))[:number]
    elif method in ("halton", "lhs"):
        shares = (qmc.Halton if method == "halton" else qmc.LatinHypercube)(n, rng=rng).random(number)
    else:
        raise ValueError(f"sample.method = {method!r} is not known; use 'sobol', 'halton', 'lhs' or 'random'.")
    if correlations:
        shares = _correlated(shares, names, correlations)
    shares = np.clip(shares, 1e-12, 1.0 - 1e-12)
    columns = [distributions[name].quantile(shares[:, k]) for k, name in enumerate(names)]
    return [{name: _plain(c[row]) for name, c in zip(names, columns, strict=True)} for row in range(number)]


def as_grid(result: xr.Dataset) -> xr.Dataset:
    """Result of a sweep over a full grid, with the parameters as dimensions instead of ``case``.

    Raises
    ------
    ValueError
        If the cases are not a full grid.
    """
    names = list(result.attrs["parameters"].split())
    stacked = result.set_index(case=names) if len(names) > 1 else result.swap_dims(case=names[0])
    if len(names) > 1 and not stacked.indexes["case"].is_unique:
        raise ValueError("as_grid: some cases have the same parameters; look at them one by one.")
    full = stacked.unstack("case") if len(names) > 1 else stacked
    if math.prod(full.sizes[name] for name in names) != result.sizes["case"]:
        raise ValueError(f"as_grid: {result.sizes['case']} cases are not a full grid of {', '.join(names)}.")
    return full


def _correlated(shares: Array, names: list[str], correlations: Mapping[tuple[str, str], float]) -> Array:
    matrix = np.eye(len(names))
    for (one, other), value in correlations.items():
        for name in (one, other):
            if name not in names:
                raise ValueError(f"sample.correlations: {name!r} has no distribution; use {', '.join(names)}.")
        if not -1.0 < value < 1.0:
            raise ValueError(f"sample.correlations: {one}, {other}: {value} must lie between -1 and 1.")
        i, j = names.index(one), names.index(other)
        matrix[i, j] = matrix[j, i] = value
    try:
        lower = np.linalg.cholesky(matrix)
    except np.linalg.LinAlgError:
        raise ValueError(
            "sample.correlations contradict each other (no such distribution); make them smaller."
        ) from None
    gauss = stats.norm.ppf(np.clip(shares, 1e-12, 1.0 - 1e-12))
    return np.asarray(stats.norm.cdf(gauss @ lower.T))


def _ordered(owner: str, low: float, high: float) -> None:
    if not low < high:
        raise ValueError(f"{owner}.low = {low} must be below {owner}.high = {high}; exchange them or widen the range.")


def _plain(value: Any) -> Any:
    return value.item() if isinstance(value, np.generic) else value
