"""What the runs of a sweep are worth together: one line of trust for each model of the water's loads."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from exumob.simulation.trust import Trust, trust_of_all
from exumob.sweeps.experiment import Experiment

COMPARED = 20
"""Number of different values of a name that are looked at, unless they are numbers."""
OUTSIDE, WIDE = "out_of_range_share", "wide_range_share"
"""What runs with networks found on which their trust depends (`exumob.simulation.summary.range_shares`)."""


def trust_of_sweep(
    experiment: Experiment, cases: Sequence[Mapping[str, Any]], ended: Mapping[str, ArrayLike] | None = None
) -> dict[str, str | float]:
    """Say what the runs of a sweep are worth, as attributes (see `exumob.simulation.trust.trust_of_all`).

    Of numbers the smallest and the largest of each name are compared, of other values each. Where cases choose their
    model of the water by themselves, each model has a line of its own.

    Parameters
    ----------
    experiment : Experiment
    cases : sequence of mapping
    ended : mapping, optional
        What the runs found (`exumob.simulation.summary.summary`), a value for each case; nan where a run broke down.
        Of these, the shares of networks and of the time outside their range count.
    """
    known = {} if ended is None else ended
    shares = {name: np.nan_to_num(np.asarray(known[name], float)) for name in (OUTSIDE, WIDE) if name in known}
    found: dict[str, list[tuple[int, Experiment]]] = {}
    most = {int(np.argmax(values)) for values in shares.values() if values.size and values.max() > 0.0}
    for n in sorted(_telling(cases) | most) or [-1]:
        with contextlib.suppress(ValueError):  # values that do not go together have become rows
            run = experiment.with_values(cases[n] if cases else {})
            found.setdefault(run.hydrodynamics, []).append((n, run))
    attributes: dict[str, str | float] = {}
    for model, of in found.items():
        places = [n for n, _ in of]
        own = {name: values[places] for name, values in shares.items()} if model == "networks" else {}
        with contextlib.suppress(ValueError):
            more = _together([run for _, run in of], own.get(OUTSIDE), own.get(WIDE)).attributes()
            attributes = more if not attributes else {"trust": f"{attributes['trust']} {more['trust']}"}
    return attributes


def _telling(cases: Sequence[Mapping[str, Any]]) -> set[int]:
    """Numbers of the cases that stand for all."""
    chosen: set[int] = set()
    for name in cases[0] if cases else ():
        values = [case[name] for case in cases]
        if all(isinstance(value, int | float) for value in values):
            chosen |= {int(np.argmin(values)), int(np.argmax(values))}
        else:
            chosen |= set(list({repr(value): n for n, value in enumerate(values)}.values())[:COMPARED])
    return chosen


def _together(runs: Sequence[Experiment], outside: np.ndarray | None, wide: np.ndarray | None) -> Trust:
    """Trust in runs with one model of the water's loads."""
    model = next((run for run in runs if run.water is not None), runs[0]).water_model()
    own = [
        run.water_model() if run.hydrodynamics in ("coefficients", "calibrated") and run.water else model
        for run in runs
    ]  # fmt: skip
    described = [run.description(its) for run, its in zip(runs, own, strict=True)]
    return trust_of_all(
        described, None if outside is None else outside.tolist(), None if wide is None else float(wide.max())
    )
