"""Cases of a sweep: full grids, and random or quasi-random samples of stated, possibly correlated distributions."""

from __future__ import annotations

import itertools
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, dataclass
from numbers import Real
from typing import Annotated, Any, Literal, Protocol

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy import stats
from scipy.stats import qmc

from exumob.support.arrays import Array
from exumob.support.checks import require_within
from exumob.support.cost import require_memory, spelled_size, spelled_time
from exumob.support.declared import Declared, checked, declared_fields
from exumob.support.quantities import Quantity, Unusual, shown

ANY = Quantity("1", at_least=-1e300, at_most=1e300)
"""A number of any size."""
POSITIVE = Quantity("1", above=0.0, at_most=1e300)
"""A number of any size above 0."""
SEED = Quantity("1", at_least=0.0)
"""Seed of random numbers"""
MOST_CASES = 10_000_000
"""Largest number of cases: each becomes a file."""
CASE_BYTES, VALUE_BYTES = 1000, 250
"""Memory for a case of a sweep, and for each of its values, with its row and what gathering takes."""
ROW_BYTES = 4096 + 512
"""Room on the disk for a case: a block of its own, and its part of ``sweep.nc``."""

Case = dict[str, Any]
"""Values by dotted name."""
Method = Literal["sobol", "halton", "lhs", "random"]
"""How `sample` fills the space of the parameters."""


class Distribution(Protocol):
    """Distribution of one parameter, given by its quantiles."""

    def quantile(self, share: Array) -> NDArray[Any]:
        """Values below which a parameter lies with the probabilities `share` (0 to 1)."""


@dataclass(frozen=True)
class Uniform(Declared):
    """Uniform distribution from `low` to `high`."""

    low: Annotated[float, ANY]
    """Lower end"""
    high: Annotated[float, ANY]
    """Upper end"""

    def _check(self) -> None:
        _ordered("Uniform", low=self.low, high=self.high)

    def quantile(self, share: Array) -> NDArray[Any]:
        """See `Distribution`."""
        return self.low + (self.high - self.low) * share


@dataclass(frozen=True)
class Normal(Declared):
    """Gaussian distribution, cut off at `low` and `high`."""

    mean: Annotated[float, ANY]
    """Mean, of the whole bell"""
    deviation: Annotated[float, POSITIVE]
    """Standard deviation, of the whole bell"""
    low: Annotated[float, Quantity("1", infinite=True)] = -math.inf
    """Lower end"""
    high: Annotated[float, Quantity("1", infinite=True)] = math.inf
    """Upper end"""

    def _check(self) -> None:
        _ordered("Normal", low=self.low, high=self.high)
        far = max((self.low - self.mean) / self.deviation, (self.mean - self.high) / self.deviation)
        if far > 30.0:
            raise ValueError(
                f"Normal.low = {self.low}, high = {self.high} cut off all but the farthest end of the bell about mean "
                f"= {self.mean}, {far:.3g} deviations away; move the ends, or use another distribution."
            )

    def quantile(self, share: Array) -> NDArray[Any]:
        """See `Distribution`."""
        ends = ((end - self.mean) / self.deviation for end in (self.low, self.high))
        return np.asarray(stats.truncnorm.ppf(share, *ends, loc=self.mean, scale=self.deviation))


@dataclass(frozen=True)
class LogNormal(Declared):
    """Log-normal distribution; `spread` is the standard deviation of the logarithm (0.1: about 10 %)."""

    median: Annotated[float, POSITIVE]
    """Median"""
    spread: Annotated[float, Quantity("1", above=0.0, at_most=10.0)]
    """Standard deviation of the logarithm"""

    def quantile(self, share: Array) -> NDArray[Any]:
        """See `Distribution`."""
        return np.asarray(self.median * np.exp(self.spread * stats.norm.ppf(share)))


@dataclass(frozen=True)
class Triangular(Declared):
    """Triangular distribution from `low` to `high` with its peak at `mode`."""

    low: Annotated[float, ANY]
    """Lower end"""
    mode: Annotated[float, ANY]
    """Most likely value"""
    high: Annotated[float, ANY]
    """Upper end"""

    def _check(self) -> None:
        _ordered("Triangular", low=self.low, high=self.high)
        require_within("Triangular", self.low, self.high, "put the peak between the ends.", mode=self.mode)

    def quantile(self, share: Array) -> NDArray[Any]:
        """See `Distribution`."""
        width = self.high - self.low
        return np.asarray(stats.triang.ppf(share, (self.mode - self.low) / width, loc=self.low, scale=width))


@dataclass(frozen=True)
class Choice(Declared):
    """Choice among several values, numbers or names."""

    values: tuple[Any, ...]
    """The values"""
    weights: Annotated[tuple[float, ...] | None, Quantity("1", at_least=0.0)] = None
    """Weight of each value; None: all alike"""

    def _check(self) -> None:
        if not self.values:
            raise ValueError("Choice.values is empty; give one value at least.")
        try:
            json.dumps(self.values, default=repr)
        except Exception as error:  # a foreign __repr__ may do anything
            raise ValueError(f"Choice.values cannot be kept ({error}); give numbers or texts.") from None
        weights = self.weights or (1.0,) * len(self.values)
        if len(weights) != len(self.values) or not 0.0 < sum(weights) < math.inf:
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


def spelled_distribution(kind: str) -> str:
    """Return how a distribution is written, as ``normal(mean, deviation)``, without what may be left out."""
    needed = [f.name for f in declared_fields(DISTRIBUTIONS[kind]) if f.default is MISSING]
    return f"{kind}({', '.join(needed)})"


@dataclass(frozen=True)
class Range(Sequence[float]):
    """Evenly spaced values from `begin` to `end`, made only when they are asked for.

    A million million of them take no memory until somebody goes through them.
    """

    begin: float
    end: float
    number: int

    def __len__(self) -> int:
        return self.number

    def __getitem__(self, n: Any) -> Any:
        if isinstance(n, slice):
            return [self[k] for k in range(*n.indices(self.number))]
        if not -self.number <= n < self.number:
            raise IndexError(n)
        return self._value(n % self.number)

    def _value(self, n: int) -> float:
        if n == self.number - 1 and n > 0:
            return self.end
        return self.begin + n * ((self.end - self.begin) / max(self.number - 1, 1))


def require_room_for(owner: str, number: int, names: int) -> None:
    """Raise ValueError if so many cases are beyond `MOST_CASES`, or do not fit into memory; nothing is made for it."""
    needed = float(number) * (CASE_BYTES + names * VALUE_BYTES) if number < 10**18 else math.inf
    if number > MOST_CASES:
        raise ValueError(
            f"{owner}: {_spelled(number)} cases are too many (about {spelled_size(needed)} of memory, "
            f"{spelled_size(float(min(number, 10**18)) * ROW_BYTES)} on the disk, and one case a second takes "
            f"{spelled_time(float(min(number, 10**18)))}); give {MOST_CASES:,} at most, or draw samples instead of a "
            "full grid."
        )
    require_memory(f"{owner}: {number:,} cases of {names} values", needed, "give fewer.")


def _spelled(number: int) -> str:
    return f"{number:,}" if number < 10**15 else f"more than 10^{min(len(str(min(number, 10**300))) - 1, 300)}"


def _require_distinct(name: str, values: Any) -> None:
    """Raise ValueError if a value stands twice: its cases would be run twice and say the same."""
    if isinstance(values, Range):
        return  # they differ
    seen: set[Any] = set()
    for value in map(_plain, values):
        try:
            if value in seen:
                raise ValueError(f"{name} = {shown(value)} stands twice among its values; give it once.")
            seen.add(value)
        except TypeError:  # lists and the like
            return


@checked
def grid(values: Mapping[str, Any]) -> list[Case]:
    """Cases with all combinations of values, the last name varying fastest.

    Raises
    ------
    ValueError
        If a name has no values, or one of them twice, or there are more combinations than fit into memory.
    """
    for name, found in values.items():
        listed = isinstance(found, Sequence) and not isinstance(found, str | bytes)
        if not listed and getattr(found, "ndim", 0) != 1:  # of a set the order would change from run to run
            raise ValueError(f"grid: {name} = {shown(found)} must be a list of values, in their order.")
        if np.ma.is_masked(found):
            raise ValueError(f"grid: {name} has masked values; leave them out.")
        if not len(found):
            raise ValueError(f"grid: {name} has no values; give one at least.")
        _require_distinct(name, found)
    require_room_for("grid", math.prod(len(found) for found in values.values()), len(values))
    return [dict(zip(values, map(_plain, row), strict=True)) for row in itertools.product(*values.values())]


@checked
def sample(
    number: Annotated[int, Quantity("1", at_least=1.0)], distributions: Mapping[str, Distribution], *,
    method: Method = "sobol", seed: Annotated[int, SEED] = 0,
    correlations: Mapping[tuple[str, str], float] | None = None, unusual: bool = False,
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
    unusual : bool
        Let draws lie outside the plausible ranges of their fields, as `exumob.unusual` lets a number; the tails of a
        distribution may need it. At the command line they pass wherever the median is plausible.

    Raises
    ------
    ValueError
        If a correlation names an unknown parameter, the correlations contradict each other, or the cases do not fit
        into memory.
    """
    names, n = list(distributions), len(distributions)
    if not n:
        raise ValueError("sample: there are no distributions; give one at least.")
    for name, distribution in distributions.items():
        if not callable(getattr(distribution, "quantile", None)):
            raise ValueError(
                f"sample.distributions: {name} = {shown(distribution)} is no distribution; use Uniform, Normal, "
                "LogNormal, Triangular or Choice."
            )
    require_room_for("sample", number, n)
    rng = np.random.default_rng(seed)
    if method == "random":
        shares = rng.random((number, n))
    elif method == "sobol":
        if n > qmc.Sobol.MAXDIM:
            raise ValueError(f"sample.method = 'sobol' knows {qmc.Sobol.MAXDIM} names at most, not {n}; use 'lhs'.")
        shares = qmc.Sobol(n, rng=rng).random_base2(math.ceil(math.log2(number)))[:number]
    else:
        shares = (qmc.Halton if method == "halton" else qmc.LatinHypercube)(n, rng=rng).random(number)
    if correlations:
        shares = _correlated(shares, names, correlations)
    shares = np.clip(shares, 1e-12, 1.0 - 1e-12)
    columns = [distributions[name].quantile(shares[:, k]) for k, name in enumerate(names)]
    for name, column in zip(names, columns, strict=True):
        if column.dtype.kind == "f" and not np.isfinite(column).all():
            raise ValueError(f"sample: {name} = {distributions[name]} gives values that are not finite; narrow it.")
    plain = _unusual if unusual else _plain
    return [{name: plain(c[row]) for name, c in zip(names, columns, strict=True)} for row in range(number)]


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
    for pair, value in correlations.items():
        if not isinstance(pair, tuple) or len(pair) != 2 or pair[0] == pair[1]:
            raise ValueError(f"sample.correlations: {shown(pair)} must be two different names.")
        one, other = pair
        if not isinstance(value, Real) or isinstance(value, bool):
            raise ValueError(f"sample.correlations: {one}, {other}: {shown(value)} must be a number between -1 and 1.")
        for name in pair:
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


def _unusual(value: Any) -> Any:
    """A value that may lie outside its plausible range if it is a float; whole numbers must stay what they are."""
    return Unusual(value) if isinstance(value, float) else _plain(value)


def _plain(value: Any) -> Any:
    return value.item() if isinstance(value, np.generic) else value
