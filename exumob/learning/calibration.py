"""Fit of the waves' coefficients (`exumob.water.wave_loads`) to runs with the flow in the loop of one or more vehicles.

Least squares for what the published coefficients lack. Every load is taken over its deviation in the runs of its
vehicle, so that vehicles of all sizes count alike. A ridge holds coefficients near those of a prior, or near 0, where
runs say little of them.

Side forces and the hull's yaw moment are fitted together: what steers a vehicle are their sums, small differences of
large parts, and so these count `TOGETHER` times as much as a part.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
import xarray as xr
from scipy.linalg import block_diag
from scipy.optimize import lsq_linear

from exumob.learning.dataset import base_loads, body_states, usable, water_of
from exumob.support.arrays import Array
from exumob.support.constants import GRAVITY
from exumob.support.provenance import provenance
from exumob.vehicle.parameters import Vehicle
from exumob.water.wave_loads import (
    COMPONENTS,
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
LEAST_LOAD = 1e-3
"""Deviation of a load over the vehicle's weight below which it counts as this much [-]: smaller ones move nothing."""
STEERING = ((0, "Fy"), (0, "Mz"), (1, "Fy"), (2, "Fy"))
"""Kind of body and component of the loads that are fitted together."""
TOGETHER = 4.0
"""Weight of their sums, the vehicle's side force and yaw moment, over that of a part.

On the nine runs of the amphibious vehicle, each left out once, drives with the coefficients end 1.8, 1.7, 1.6 and 1.4 %
of the path away with weights of 0, 2, 4 and 8. The more sums count, the less are the parts those of another vehicle."""
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
    """
    fitted = [_Group(vehicle, runs) for vehicle, runs in groups]
    start = np.zeros(WaveCoefficients.SHAPE) if prior is None else prior.values
    values = np.zeros(WaveCoefficients.SHAPE)
    for kind, name in enumerate(KINDS):
        bodies = [b for b, k in enumerate(KIND_OF_BODY) if k == kind]
        for component, forms in FORMS[name].items():
            if (kind, component) not in STEERING:
                k, size = COMPONENTS.index(component), len(forms)
                rows = [row for group in fitted for row in group.rows(bodies, k, size)]
                free = np.eye(size), np.zeros(size, bool)
                values[kind, k, :size] = _least_squares(rows, start[kind, k, :size], *free)
    _add_steering(values, start, fitted)
    about = {name: provenance()[name] for name in ("exumob_version", "git_revision", "date")}
    vehicles = {vehicle.name: sorted(runs) for vehicle, runs in groups}
    rounded = np.vectorize(lambda value: float(f"{value:.5g}"))(values)  # as in a file, and on any machine
    return WaveCoefficients(rounded, about | {"runs": vehicles})


class _Group:
    """Terms and lacking loads of the runs of one vehicle."""

    def __init__(self, vehicle: Vehicle, runs: Mapping[str, xr.Dataset]) -> None:
        terms, lacking = [], []
        for run in runs.values():
            rows = np.flatnonzero(usable(run))[::THINNING]
            water = water_of(run)
            terms.append(terms_along(vehicle, water.over(), water.density, body_states(run)[rows]))
            lacking.append((run["water_wrench_smooth"].values - base_loads(run, vehicle))[rows])
        self.vehicle, self.terms, self.lacking = vehicle, np.concatenate(terms), np.concatenate(lacking)
        self.weight = math.sqrt(math.sqrt(len(runs)) / len(self.terms))
        """Of one row"""

    def deviation(self, loads: Array, moment: bool) -> float:
        """Deviation of a load, or `LEAST_LOAD` of the vehicle's weight (a moment: times half the wheelbase)."""
        least = LEAST_LOAD * self.vehicle.mass * GRAVITY * (0.5 * self.vehicle.wheelbase if moment else 1.0)
        return max(float(loads.std()), least)

    def rows(self, bodies: Sequence[int], k: int, size: int) -> list[tuple[Array, Array]]:
        """Rows of the equations of one component of bodies: terms and load, over the load's deviation."""
        factor = self.weight / self.deviation(self.lacking[:, bodies, k], moment=k > 2) / math.sqrt(len(bodies))
        return [(factor * self.terms[:, body, k, :size], factor * self.lacking[:, body, k]) for body in bodies]


def _add_steering(values: Array, start: Array, groups: Sequence[_Group]) -> None:
    """Fill in the coefficients of `STEERING`, fitted together; those of all other loads are known."""
    sizes = [len(FORMS[KINDS[kind]][component]) for kind, component in STEERING]
    ends = np.cumsum(sizes)
    places = {
        (kind, COMPONENTS.index(component)): slice(end - size, end)
        for (kind, component), size, end in zip(STEERING, sizes, ends, strict=True)
    }
    rows = [row for group in groups for row in _steering_rows(group, values, places, int(ends[-1]))]
    sideways = [component == "Fy" for _, component in STEERING]
    bases = [_resisting(size) if side else np.eye(size) for side, size in zip(sideways, sizes, strict=True)]
    held = np.concatenate([np.arange(base.shape[1]) < 4 * side for side, base in zip(sideways, bases, strict=True)])
    near = np.concatenate([start[kind, k, : place.stop - place.start] for (kind, k), place in places.items()])
    found = _least_squares(rows, near, block_diag(*bases), held)
    for (kind, k), place in places.items():
        values[kind, k, : place.stop - place.start] = found[place]


def _steering_rows(
    group: _Group, values: Array, places: Mapping[tuple[int, int], slice], size: int
) -> list[tuple[Array, Array]]:
    """Rows of the parts' equations, and of those of the vehicle's side force and yaw moment."""
    vehicle, terms, lacking = group.vehicle, group.terms, group.lacking
    ahead = 0.5 * vehicle.wheelbase * np.array([0.0, 1.0, 1.0, -1.0, -1.0])
    aside = 0.5 * vehicle.track * np.array([0.0, 1.0, -1.0, 1.0, -1.0])
    drags = lacking[:, :, 0] - (terms[:, :, 0] * values[list(KIND_OF_BODY), 0]).sum(axis=2)
    total = lacking[:, 0, 5] + lacking[:, :, 1] @ ahead - drags @ aside  # that side forces and the hull are to give

    def row(
        parts: Mapping[tuple[int, int], float], load: Array, weight: float, moment: bool = False
    ) -> tuple[Array, Array]:
        found = np.zeros((len(terms), size))
        for (body, k), factor in parts.items():
            place = places[KIND_OF_BODY[body], k]
            found[:, place] += factor * terms[:, body, k, : place.stop - place.start]
        factor = weight * group.weight / group.deviation(load, moment)
        return factor * found, factor * load

    wheels, half = range(1, 5), math.sqrt(0.5)
    return [
        row({(0, 1): 1.0}, lacking[:, 0, 1], 1.0),
        row({(0, 5): 1.0}, lacking[:, 0, 5], 1.0, moment=True),
        *(row({(wheel, 1): 1.0}, lacking[:, wheel, 1], half) for wheel in wheels),
        row({(body, 1): 1.0 for body in range(5)}, lacking[:, :, 1].sum(axis=1), TOGETHER),
        row({(0, 5): 1.0} | {(wheel, 1): ahead[wheel] for wheel in wheels}, total, TOGETHER, moment=True),
    ]


def _resisting(size: int) -> Array:
    """Directions of the coefficients of a side force, of which the first four, weighted <= 0, resist a side speed.

    A linear function of Froude's number F and the draught t is nowhere positive in a rectangle of both if, and only if,
    it is a sum of F, `MOST_FROUDE` - F, t and `MOST_DRAUGHT` - t with weights none of which is positive (Farkas).
    """
    base = np.zeros((size, size + 1))
    base[:3, :4] = [[0.0, MOST_FROUDE, 0.0, MOST_DRAUGHT], [1.0, -1.0, 0.0, 0.0], [0.0, 0.0, 1.0, -1.0]]
    base[3:, 4:] = np.eye(size - 3)
    return base


def _least_squares(rows: Sequence[tuple[Array, Array]], near: Array, base: Array, held: Array) -> Array:
    """Coefficients x = `base` w that fit rows (a, y), a x = y, and lie near others; those w that are held are <= 0."""
    square = sum((a.T @ a for a, _ in rows), np.zeros((len(near), len(near))))
    right = sum((a.T @ y for a, y in rows), np.zeros(len(near)))
    scale = np.where(np.diag(square) > 1e-18, np.sqrt(np.diag(square)), 1.0)  # of terms that are nowhere, any
    ridge = RIDGE * np.eye(len(near))
    root = np.linalg.cholesky(square / np.outer(scale, scale) + ridge).T
    aim = np.linalg.solve(root.T, right / scale + ridge @ (scale * near))
    weights = lsq_linear(root @ (scale[:, None] * base), aim, (-np.inf, np.where(held, 0.0, np.inf))).x
    return np.asarray(base @ weights)
