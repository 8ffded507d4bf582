"""States that stand for those of the training runs, and how far runs lie from each other.

Networks know what is like something that they have seen. Ranges of single inputs do not tell: a lane change in a fast
current from ahead has the sideslip of a current from the side, but not with the speeds of one. So a file of networks
keeps some states of its training runs, as far from each other as possible, and a state counts as known if it is no
further from the nearest of them than states of one training run lie from those of the others.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from exumob.support.arrays import Array

REACHED = 99.0
"""Share of the states in training that lie within the reach of states of other runs [%]."""
AT_ONCE = 4096
"""States whose distances are computed at once."""


def covering(states: Array, number: int) -> NDArray[np.intp]:
    """Choose states one after the other, each the furthest from those before (Gonzalez 1985).

    Parameters
    ----------
    states : array, shape (n, k)
    number : int
        States that are wanted. If there are fewer different ones, some are repeated.

    Returns
    -------
    array of int, shape (number,)
        Their rows; the first is row 0.
    """
    chosen = np.zeros(number, np.intp)
    nearest = np.full(len(states), np.inf)
    for n in range(1, number):
        np.minimum(nearest, ((states - states[chosen[n - 1]]) ** 2).sum(axis=1), out=nearest)
        chosen[n] = nearest.argmax()
    return chosen


def reach(states: Array, runs: NDArray[np.intp], chosen: NDArray[np.intp]) -> float:
    """Return how far states of a run lie from the chosen ones of the other runs: `REACHED` of them lie within.

    Parameters
    ----------
    states : array, shape (n, k)
        Scaled.
    runs : array of int, shape (n,)
        The run of each.
    chosen : array of int
        Rows of those that stand for all.

    Returns
    -------
    float
        If the chosen ones are all of one run, the distance within which all states lie from them. Never 0.
    """
    several = len(np.unique(runs[chosen])) > 1
    found = []
    for first in range(0, len(states), AT_ONCE):
        part = slice(first, first + AT_ONCE)
        square = ((states[part, None, :] - states[None, chosen, :]) ** 2).sum(axis=2)
        if several:
            square[runs[part, None] == runs[None, chosen]] = np.inf
        found.append(np.sqrt(square.min(axis=1)))
    distance = np.concatenate(found)
    return max(float(np.percentile(distance, REACHED)) if several else float(distance.max()), 1e-6)
