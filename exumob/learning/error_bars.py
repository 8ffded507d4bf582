"""Error bars of networks' loads: the spread of an ensemble, and what all of its members lack.

The members of an ensemble agree on what none of them knows. On runs kept apart their error is larger than their spread,
by body and component; what must be added to the spread for both to agree there is the floor of their error bars
(`exumob.surrogates.ensemble.load_floor`). Whether the bars hold is asked on runs that have no part in the floor.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from exumob.support.arrays import Array
from exumob.surrogates.ensemble import bars_of


def fitted_floor(errors: Sequence[Array], spreads: Sequence[Array]) -> Array:
    """Return the floor of error bars, the same weight for each run.

    Parameters
    ----------
    errors : sequence of array, shape (n, 5, 6)
        Loads of the ensemble less those of the flow along runs [N, N m].
    spreads : sequence of array, shape (n, 5, 6)
        Standard deviations of the members there [N, N m]; 0 for a single one.

    Returns
    -------
    array, shape (5, 6)
        Standard deviation whose square, added to that of the spread, is the mean square of the errors [N, N m]; 0 where
        the spread alone is more.
    """
    lacking = [np.mean(error**2 - spread**2, axis=0) for error, spread in zip(errors, spreads, strict=True)]
    return np.asarray(np.sqrt(np.maximum(np.mean(lacking, axis=0), 0.0)))


def error_bars(errors: Sequence[Array], spreads: Sequence[Array]) -> list[Array]:
    """Return the error bars along runs, each with the floor of the other runs; of a single one with its own.

    Parameters
    ----------
    errors, spreads
        See `fitted_floor`.

    Returns
    -------
    list of array, shape (n, 5, 6)
        Standard deviations [N, N m].
    """
    found = []
    for n, spread in enumerate(spreads):
        others = [k for k in range(len(spreads)) if k != n] or [n]
        floor = fitted_floor([errors[k] for k in others], [spreads[k] for k in others])
        found.append(bars_of(spread, floor))
    return found


def share_within(errors: Sequence[Array], bars: Sequence[Array], deviations: float = 2.0) -> float:
    """Return the share of all samples whose error lies within so many standard deviations [-]."""
    within = [np.abs(error) <= deviations * bar for error, bar in zip(errors, bars, strict=True)]
    return float(np.mean(np.concatenate(within)))
