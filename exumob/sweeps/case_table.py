"""The result of a sweep: a row a case as a Dataset with units and meanings."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from exumob.simulation.summary import FIGURES
from exumob.support.identity import spelled
from exumob.support.provenance import provenance
from exumob.sweeps.experiment import Experiment
from exumob.sweeps.sampling import Case

OWN_VARIABLES = {
    "status": ("1", "how the case ended"),
    "reason": ("1", "why it was not completed"),
    "case_wall_time": ("s", "time of computing the case, without compiling"),
}


def table_of(rows: Sequence[Mapping[str, Any]], cases: Sequence[Case], function: Any, code: str) -> xr.Dataset:
    """Return all rows as one Dataset along ``case``; every variable has ``units`` and ``long_name``.

    Parameters
    ----------
    rows : sequence of dict
        How the cases ended, as `exumob.sweeps.case_store.CaseStore.read` returns it.
    cases : sequence of dict
        Their values by name.
    function : callable
        An `Experiment`, or one with ``experiment`` or ``variables``, knows units and meanings.
    code : str
        Digest of the present code; rows that other code has computed are counted.
    """
    names = sorted({name for row in rows for name in row["values"]})
    known = _known_variables(function, cases[0], any(row["run"] for row in rows))
    found = {
        name: ("case", _results([row["values"].get(name) for row in rows]), _attributes(name, known))
        for name in names
    } | {
        name: ("case", [row[key] for row in rows], _attributes(name, OWN_VARIABLES))
        for name, key in (("status", "status"), ("reason", "reason"), ("case_wall_time", "wall_time"))
    }  # fmt: skip
    parameters = {
        name: ("case", _column([case[name] for case in cases]), _attributes(name, known))
        for name in cases[0]
    }  # fmt: skip
    others = sum(row["code"] != code for row in rows)
    return xr.Dataset(
        found,
        coords={"case": ("case", np.arange(len(rows)), {"units": "1", "long_name": "number of the case"})} | parameters,
        attrs=provenance()
        | {"title": "exumob sweep", "parameters": " ".join(cases[0])}
        | ({"cases_of_other_code": others} if others else {}),
    )


def _known_variables(function: Any, case: Case, runs: bool) -> dict[str, tuple[str, str]]:
    """Unit and meaning by name: of key figures of runs, of the parameters of an `Experiment`, of what is stated."""
    known = dict(FIGURES) if runs else {}
    experiment = function if isinstance(function, Experiment) else getattr(function, "experiment", None)
    if isinstance(experiment, Experiment):
        known |= {name: experiment.meaning(name, case) for name in case}
    stated = getattr(function, "variables", None)
    if isinstance(stated, Mapping):
        known |= {str(name): (str(unit), str(meaning)) for name, (unit, meaning) in stated.items()}
    return known


def _attributes(name: str, known: Mapping[str, tuple[str, str]]) -> dict[str, str]:
    units, meaning = known.get(name, ("unknown", name))
    return {"units": units, "long_name": meaning}


def _results(values: list[Any]) -> np.ndarray:
    """Column of results; nan, or an empty text, where a case has none."""
    if any(isinstance(value, str) for value in values):
        return np.array(["" if value is None else clean_text(str(value)) for value in values])
    return np.array([math.nan if value is None else value for value in values], float)


def _column(values: list[Any]) -> np.ndarray:
    if all(isinstance(value, bool | int | float | np.generic) for value in values):
        found = np.array(values)
        if found.dtype.kind in "bifu":
            return found
    return np.array([clean_text(str(value) if isinstance(value, str | Path) else spelled(value)) for value in values])


def clean_text(text: str) -> str:
    """Text as netCDF can hold it."""
    return text.replace("\0", "?").encode("utf-8", "replace").decode("utf-8")
