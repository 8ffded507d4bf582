"""Fit of the waves' coefficients (`exumob.water.wave_loads`) to runs with the flow in the loop of one or more vehicles.

Least squares for what the published coefficients lack. Every load is taken over its deviation in the runs of its
vehicle, so that vehicles of all sizes count alike. A ridge holds coefficients near those of a prior, or near 0, where
runs say little of them.

Each load is fitted by itself. To let the sums of side forces and yaw moments, which steer a vehicle, count 2 or 4 times
as much as their parts was tried on the nine runs of the amphibious vehicle, each left out once: drives end as far away
(1.7 % of the path; 1.8 % with the sums).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from exumob.learning.dataset import base_loads, body_states, least_loads, usable, water_of
from exumob.support.arrays import Array
from exumob.support.provenance import provenance
from exumob.vehicle.motion import WRENCH_COMPONENTS
from exumob.vehicle.parameters import Vehicle
from exumob.water.wave_loads import (
    FORMS,
    KIND_OF_BODY,
    KINDS,
    MOST_DRAUGHT,
    MOST_FROUDE,
    WaveCoefficients,
    terms_along,
)

THINNING = 8
"""Interval of the instants that are fitted, in samples of 1 ms."""
RIDGE = 1e-3
"""Penalty on the distance from the prior, of terms of size 1 [-]."""
LEAST = 1e-7
"""Size of a coefficient below which it is rounding, and 0 [-]; others are kept to five digits."""
Runs = tuple[Vehicle, Mapping[str, xr.Dataset]]
"""A vehicle and its runs by name, packed or imported"""


def fit_wave_coefficients(groups: Sequence[Runs], prior: WaveCoefficients | None = None) -> WaveCoefficients:
    """Fit the coefficients of the waves to runs with the flow in the loop.

    Parameters
    ----------
    groups : sequence of (Vehicle, mapping)
        Vehicles with their runs by name. A vehicle counts as the root of the number of its runs.
    prior : WaveCoefficients, optional
        Coefficients that hold where the runs say little. Default: 0.

    Returns
    -------
    WaveCoefficients
        Their `about` names the program, the vehicles and their runs.

    Raises
    ------
    ValueError
        If there is no vehicle, one without runs, two of one name, or a run without usable instants.
    """
    names = [vehicle.name for vehicle, _ in groups]
    empty = [vehicle.name for vehicle, runs in groups if not runs]
    if not groups or empty or len(set(names)) < len(names):
        what = f"{', '.join(empty)} has no runs" if empty else f"vehicles are {', '.join(names) or 'none'}"
        raise ValueError(f"fit_wave_coefficients.groups: {what}; give vehicles of different names, each with its runs.")
    fitted = [_Group(vehicle, runs) for vehicle, runs in groups]
    start = np.zeros(WaveCoefficients.SHAPE) if prior is None else prior.values
    values = np.zeros(WaveCoefficients.SHAPE)
    for kind, name in enumerate(KINDS):
        bodies = [b for b, k in enumerate(KIND_OF_BODY) if k == kind]
        for component, forms in FORMS[name].items():
            k, size = WRENCH_COMPONENTS.index(component), len(forms)
            rows = [row for group in fitted for row in group.rows(bodies, k, size)]
            base, held = _resisting(forms) if component == "Fy" else (np.eye(size), np.zeros(size, bool))
            values[kind, k, :size] = _least_squares(rows, start[kind, k, :size], base, held)
    about = {name: provenance()[name] for name in ("exumob_version", "git_revision", "date")}
    vehicles = {vehicle.name: sorted(runs) for vehicle, runs in groups}
    rounded = [float(f"{value:.5g}") if abs(value) >= LEAST else 0.0 for value in values.flat]
    return WaveCoefficients(np.reshape(rounded, values.shape), about | {"runs": vehicles})


class _Group:
    """Terms and lacking loads of the runs of one vehicle."""

    def __init__(self, vehicle: Vehicle, runs: Mapping[str, xr.Dataset]) -> None:
        terms, lacking = [], []
        for name, run in runs.items():
            rows = np.flatnonzero(usable(run))[::THINNING]
            if not len(rows):
                raise ValueError(f"fit_wave_coefficients.groups: run {name} has no usable instant; leave it out.")
            water, states = water_of(run), body_states(run)[rows]
            terms.append(terms_along(vehicle, water.over(), water.density, states))
            lacking.append((run["water_wrench_smooth"].values - base_loads(run, vehicle))[rows])
        self.vehicle, self.terms, self.lacking = vehicle, np.concatenate(terms), np.concatenate(lacking)
        self.weight = math.sqrt(math.sqrt(len(runs)) / len(self.terms))
        """Of one row"""

    def rows(self, bodies: Sequence[int], k: int, size: int) -> list[tuple[Array, Array]]:
        """Rows of the equations of one component of bodies: terms and load, over its deviation or `least_loads`."""
        deviation = max(float(self.lacking[:, bodies, k].std()), least_loads(self.vehicle)[k])
        factor = self.weight / deviation / math.sqrt(len(bodies))
        return [(factor * self.terms[:, body, k, :size], factor * self.lacking[:, body, k]) for body in bodies]


def _resisting(forms: Sequence[str]) -> tuple[Array, NDArray[np.bool_]]:
    """Directions of the coefficients of a side force that resists a side speed, if those that are marked weigh <= 0.

    A linear function of Froude's number F and the draught t is nowhere positive in a rectangle of both if, and only if,
    it is a sum of F, `MOST_FROUDE` - F, t and `MOST_DRAUGHT` - t with weights none of which is positive (Farkas). A
    wheel that is not steered has one side speed only: with the coefficient of the wash the sum is not positive either.
    """
    size, wash = len(forms), "wash" in forms
    columns = [
        [0.0, 1.0, 0.0], [MOST_FROUDE, -1.0, 0.0], [0.0, 0.0, 1.0], [MOST_DRAUGHT, 0.0, -1.0],
    ]  # fmt: skip
    held = np.zeros((size, 6 if wash else 4))
    held[:3, :4] = np.transpose(columns)
    if wash:
        held[0, 4], held[3, 4], held[3, 5] = 1.0, -1.0, 1.0
    free = np.eye(size)[:, 4 if wash else 3 :]
    return np.hstack([held, free]), np.arange(held.shape[1] + free.shape[1]) < held.shape[1]


def _least_squares(rows: Sequence[tuple[Array, Array]], near: Array, base: Array, held: NDArray[np.bool_]) -> Array:
    """Coefficients x = `base` w that fit rows (a, y), a x = y, and lie near others; those w that are held are <= 0."""
    square = sum((a.T @ a for a, _ in rows), np.zeros((len(near), len(near))))
    right = sum((a.T @ y for a, y in rows), np.zeros(len(near)))
    scale = np.where(np.diag(square) > 1e-18, np.sqrt(np.diag(square)), 1.0)  # of terms that are nowhere, any
    ridge = RIDGE * np.eye(len(near))
    root = np.linalg.cholesky(square / np.outer(scale, scale) + ridge).T
    aim = np.linalg.solve(root.T, right / scale + ridge @ (scale * near))
    limits = (-np.inf, np.where(held, 0.0, np.inf))
    weights = lsq_linear(root @ (scale[:, None] * base), aim, limits, method="bvls").x
    return np.asarray(base @ weights)
