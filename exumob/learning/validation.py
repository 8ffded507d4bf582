"""What networks are worth, on runs that they have not seen: errors of loads and of drives, and of their error bars."""

from __future__ import annotations

import logging
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from exumob.driving.named import driven
from exumob.ground.soil import Soil
from exumob.learning.dataset import base_loads, least_loads, usable, water_of
from exumob.learning.drives import maneuver_name
from exumob.learning.error_bars import error_bars, fitted_floor, share_within
from exumob.learning.evaluation import THINNING, closed_loop, coefficient_loads, predicted_loads
from exumob.learning.plan import FreeTask, LearningPlan
from exumob.simulation.run import simulate
from exumob.simulation.summary import range_shares
from exumob.support.arrays import Array
from exumob.support.errors import SimulationError
from exumob.surrogates.model import SurrogateHydrodynamics
from exumob.surrogates.networks import NetworkSet
from exumob.surrogates.vehicle_shape import card_parameters
from exumob.vehicle.motion import BODIES, WRENCH_COMPONENTS
from exumob.vehicle.parameters import Vehicle
from exumob.water.calibrated import CalibratedHydrodynamics
from exumob.water.hydrodynamics import Hydrodynamics
from exumob.water.wave_loads import fitted_coefficients

logger = logging.getLogger(__name__)

DEVIATIONS = tuple(round(0.25 * n, 2) for n in range(1, 17))
"""Widths of error bars that are looked at, in standard deviations [-]."""
TWO = DEVIATIONS.index(2.0)
BETTER = 0.95
"""Error over that of the coefficients from which networks are called no better than they are [-]."""
LEAST_PATH = 0.05
"""Length of path from which the end of a drive is compared, over the vehicle's wheelbase [-]."""


@dataclass(frozen=True)
class Compared:
    """Loads along one run: of the flow, of the networks with their spread, of the coefficients that they rest on."""

    time: Array
    """[s], shape (n,)"""
    flow: Array
    """Smoothed [N, N m], shape (n, 5, 6)"""
    networks: Array
    spread: Array
    """Standard deviation of the members; 0 for a single one"""
    coefficients: Array


def compare_loads(members: Sequence[NetworkSet], run: xr.Dataset, vehicle: Vehicle) -> Compared:
    """Compare loads along a run's own motion.

    Parameters
    ----------
    members : sequence of NetworkSet
    run : xarray.Dataset
        Packed.
    vehicle : Vehicle
    """
    rows = np.flatnonzero(usable(run))[::THINNING]
    base, waves = base_loads(run, vehicle), members[0].waves or fitted_coefficients()
    loads = np.stack([predicted_loads(member, run, vehicle, rows, base) for member in members])
    spread = loads.std(axis=0, ddof=1) if len(members) > 1 else np.zeros(loads.shape[1:])
    flow = run["water_wrench_smooth"].values[rows].astype(float)
    calibrated = coefficient_loads(waves, run, vehicle, rows, base)
    return Compared(run["time"].values[rows], flow, loads.mean(axis=0), spread, calibrated)


def load_errors(compared: Mapping[str, Compared], vehicle: Vehicle) -> xr.Dataset:
    """Measure the errors of loads over several runs together.

    Parameters
    ----------
    compared : mapping
        Loads along runs, by name.
    vehicle : Vehicle
        Its weight and wheelbase tell which loads are next to nothing (`least_loads`).

    Returns
    -------
    xarray.Dataset
        ``networks``, ``coefficients`` (body, component): root mean square error over the deviation of the flow's loads
        in all runs, or over `least_loads` where that is more [-]; ``by_run`` (run): the mean of it over bodies and
        components, by the deviation in all runs; ``inside``, ``inside_spread`` (deviations): share of the samples that
        lie within so many standard deviations of the error bars, and of the ensemble alone [-]; ``deviation``,
        ``spread``, ``bars``, ``floor`` (body, component): what errors are taken over, root mean squares of the
        ensemble's deviation and of the error bars, and their floor [N, N m]. The error bars of a run have the floor of
        the other ones (`exumob.learning.error_bars`).
    """
    flow, networks, spread, coefficients = (
        np.concatenate([getattr(one, name) for one in compared.values()])
        for name in ("flow", "networks", "spread", "coefficients")
    )
    deviation = np.maximum(flow.std(axis=0), least_loads(vehicle))

    def rms(values: Array) -> Array:
        return np.asarray(np.sqrt(np.mean(values**2, axis=0)))

    errors = [one.networks - one.flow for one in compared.values()]
    spreads = [one.spread for one in compared.values()]
    bars = error_bars(errors, spreads)
    loads, alone = ("body", "component"), "1"
    return xr.Dataset(
        {
            "networks": (loads, rms(networks - flow) / deviation, {"units": alone}),
            "coefficients": (loads, rms(coefficients - flow) / deviation, {"units": alone}),
            "deviation": (loads, deviation, {"units": "N, N m"}),
            "spread": (loads, rms(spread), {"units": "N, N m"}),
            "bars": (loads, rms(np.concatenate(bars)), {"units": "N, N m"}),
            "floor": (loads, fitted_floor(errors, spreads), {"units": "N, N m"}),
            "by_run": (
                "run", [float((rms(c.networks - c.flow) / deviation).mean()) for c in compared.values()],
                {"units": alone},
            ),
            "inside": ("deviations", [share_within(errors, bars, z) for z in DEVIATIONS], {"units": alone}),
            "inside_spread": ("deviations", [share_within(errors, spreads, z) for z in DEVIATIONS], {"units": alone}),
        },
        coords={
            "body": list(BODIES), "component": list(WRENCH_COMPONENTS), "run": list(compared),
            "deviations": list(DEVIATIONS),
        },
    )  # fmt: skip


@dataclass(frozen=True)
class Drive:
    """A drive with networks, with their coefficients and with exumob's own, beside that with the flow in the loop."""

    name: str
    maneuver: str
    soil: str
    depth_ratio: float
    current: float
    """[m/s]"""
    turned: float
    """Angle between the current and one from ahead, 0 to pi [rad]"""
    duration: float
    """[s]"""
    steering: float
    """Largest steering [rad]"""
    wheel_speed: float
    """[rad/s]"""
    networks: dict[str, float] | None
    """Measures of `exumob.learning.evaluation.closed_loop`; None: it broke down"""
    coefficients: dict[str, float] | None
    """The same with the coefficients that the networks rest on"""
    calibrated: dict[str, float] | None
    """The same with the calibrated coefficients that come with exumob"""
    outside: float
    """Share of the time outside the range of the networks [-]"""
    fallback: float
    """Share of the calibrated coefficients in the loads [-]"""
    paths: dict[str, Array]
    """Way of the hull from its start, by model [m], shape (2, n)"""


def compare_drives(members: Sequence[NetworkSet], plan: LearningPlan, runs: Mapping[str, xr.Dataset]) -> list[Drive]:
    """Drive those runs again that are kept apart: with networks, their coefficients, and exumob's own.

    Parameters
    ----------
    members : sequence of NetworkSet
    plan : LearningPlan
    runs : mapping
        Runs by name; drives whose runs are missing are left out.
    """
    found = []
    for task in plan.tasks:
        if isinstance(task, FreeTask) and task.role == "apart" and task.name in runs:
            found.append(_drive(members, task, plan.vehicle, runs[task.name]))
    return found


def _drive(members: Sequence[NetworkSet], task: FreeTask, vehicle: Vehicle, reference: xr.Dataset) -> Drive:
    paths = {"flow in the loop": _path(reference)}
    length = float(np.hypot(*np.diff(paths["flow in the loop"], axis=1)).sum())
    models: dict[str, Hydrodynamics] = {
        "networks": SurrogateHydrodynamics(list(members)),
        "coefficients": CalibratedHydrodynamics(waves=members[0].waves),
        **({} if members[0].waves is None else {"calibrated": CalibratedHydrodynamics()}),
    }  # fmt: skip
    measures: dict[str, dict[str, float] | None] = {}
    shares: dict[str, float] = {}
    for name, model in models.items():
        try:
            run = simulate(
                vehicle, Soil.published(task.soil), task.water, task.maneuver, model, duration=task.duration,
                record_step=10e-3,
            )  # fmt: skip
        except SimulationError as error:
            logger.warning("%s with %s: %s", task.name, name, error)
            measures[name] = None
            continue
        paths[name] = _path(run)
        measures[name] = closed_loop(run, reference) if length > LEAST_PATH * vehicle.wheelbase else None
        if name == "networks":
            shares = range_shares(run)
    return Drive(
        task.name, maneuver_name(task.maneuver), task.soil, task.water.uniform_depth / vehicle.wheel.diameter,
        task.water.current_speed, abs(math.remainder(task.water.current_direction - math.pi, math.tau)),
        task.duration, *driven(task.maneuver), measures["networks"], measures["coefficients"],
        measures.get("calibrated"), shares.get("out_of_range_share", math.nan),
        shares.get("fallback_share", math.nan), paths,
    )  # fmt: skip


def _path(run: xr.Dataset) -> Array:
    path = run["position"].sel(body="hull").values[:, :2].astype(float)
    return np.asarray((path - path[0]).T)


def shortfall(figures: Mapping[str, Any]) -> str:
    """Say where networks are no better than the coefficients that they are compared with; empty if they are better.

    Parameters
    ----------
    figures : mapping
        See `card_figures`.
    """
    worse = []
    if figures["load_error"] >= BETTER * figures["coefficients_load_error"]:
        worse.append("in the loads")
    if _no_better(figures["drives"], "coefficients_end"):
        worse.append("in where drives end")
    own = figures["rests"] and _no_better(figures["drives"], "calibrated_end")
    if own and _no_better(figures["drives"], "calibrated_end", "coefficients_end"):
        return (
            "Drives with these networks end no nearer to those with the flow than with the calibrated coefficients "
            "that come with exumob: drive with --hydrodynamics calibrated and without --networks, or give the same "
            "command a larger --budget, which adds runs to those there are."
        )
    if not worse:
        return ""
    instead = "add" if figures["rests"] else "without --networks:"
    return (
        f"These networks are no better {' and '.join(worse)} than the {compared_with(figures)}: drive with these "
        f"({instead} --hydrodynamics calibrated), or give the same command a larger --budget, which adds runs to those "
        "there are."
    )


def _no_better(drives: Sequence[Mapping[str, Any]], other: str, one: str = "end") -> bool:
    """Whether drives with networks (or `one`) end no nearer to those with the flow than others do."""
    both = [(drive[one], drive[other]) for drive in drives if None not in (drive.get(one), drive.get(other))]
    return bool(both) and sum(end for end, _ in both) >= BETTER * sum(end for _, end in both)


def compared_with(figures: Mapping[str, Any]) -> str:
    """Name the coefficients that networks are compared with: those that they rest on, or the calibrated ones."""
    if figures["rests"]:
        return "coefficients fitted to the same runs, which their file holds as well"
    return "calibrated coefficients"


def card_figures(
    plan: LearningPlan, members: Sequence[NetworkSet], errors: xr.Dataset, drives: Sequence[Drive],
    taught: Mapping[str, xr.Dataset], apart: Mapping[str, xr.Dataset],
) -> dict[str, Any]:  # fmt: skip
    """Return the figures that the line of trust quotes (`exumob.surrogates.ensemble.card_of`): plain numbers and text.

    Parameters
    ----------
    plan : LearningPlan
    members : sequence of NetworkSet
    errors : xarray.Dataset
        See `load_errors`.
    drives : sequence of Drive
    taught, apart : mapping
        Runs that networks have learnt from, and those kept apart, by name.
    """
    waters = [water_of(run) for run in taught.values()]
    ratios = [water.uniform_depth / plan.vehicle.wheel.diameter for water in waters]
    speeds = [water.current_speed for water in waters]
    worst = errors["networks"].stack(load=("body", "component"))
    body, component = worst["load"].values[int(worst.values.argmax())]
    measured = [
        {
            "name": one.name, "maneuver": one.maneuver, "end": one.networks["final"] / 100.0,
            "coefficients_end": one.coefficients["final"] / 100.0 if one.coefficients else None,
            "calibrated_end": one.calibrated["final"] / 100.0 if one.calibrated else None,
            "depth_ratio": one.depth_ratio, "current_speed": one.current,
            "current_turned": round(math.degrees(one.turned), 1), "duration": one.duration,
            "steering": one.steering, "wheel_speed": one.wheel_speed,
            "outside": one.outside, "fallback": one.fallback,
        }
        for one in drives if one.networks is not None
    ]  # fmt: skip
    return {
        "vehicle": plan.vehicle.name, "parameters": card_parameters(plan.vehicle), "members": len(members),
        "cell_size": plan.cell_size,
        "runs": len(apart), "seconds": float(sum(float(run["time"][-1]) for run in taught.values())),
        "rests": members[0].waves is not None,
        "load_error": float(errors["networks"].mean()), "coefficients_load_error": float(errors["coefficients"].mean()),
        "worst_load": f"{str(body).replace('_', ' ')} {component} {float(worst.max()):.2f}",
        "inside": float(errors["inside"][TWO]), "inside_spread": float(errors["inside_spread"][TWO]),
        "width": float((errors["bars"] / errors["deviation"]).mean()),
        "load_floor": [[float(f"{value:.4g}") for value in row] for row in errors["floor"].values],
        "depth_ratio": [min(ratios), max(ratios)],
        "current_speed": [min(speeds), max(speeds)], "directions": plan.range.directions,
        "soils": sorted({one.soil for one in drives if one.networks is not None}),
        "drives": measured, "drives_failed": len(drives) - len(measured), "lost": list(plan.lost),
    }  # fmt: skip
