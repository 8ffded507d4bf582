"""The key figures of a run, and how well its forces and energies balance."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np
import xarray as xr

from exumob.simulation.verdict import verdict_of
from exumob.support.arrays import Array
from exumob.support.declared import checked

FIGURES: dict[str, tuple[str, str]] = {
    # name: (unit, meaning)
    "verdict": ("1", "whether the vehicle drove, and if not, what befell it"),
    "verdict_since": ("s", "first onset of the verdict; nan without one"),
    "distance": ("m", "distance along the path"),
    "forward": ("m", "displacement along the heading of the start, world x by default"),
    "lateral": ("m", "displacement to the left of it"),
    "yaw": ("rad", "final yaw, counter-clockwise from world x"),
    "drift_angle": ("rad", "course less heading at the end"),
    "mean_slip": ("1", "mean slip ratio of the wheels in contact, second half of the run; nan without contact"),
    "buoyed_share": ("1", "mean upward force of the water over the weight"),
    "hull_load_share": ("1", "largest share of the weight that the soil bore under the hull"),
    "least_clearance": ("m", "smallest height of the hull above the soil surface; negative: it sank in"),
    "spin_energy": ("J", "work of the driving torques"),
    "wall_time": ("s", "time of computing"),
    "real_time_factor": ("1", "simulated over wall time"),
    "out_of_range_share": ("1", "share of the time in which some body was outside the training range"),
    "fallback_share": ("1", "share of the calibrated coefficients in the loads, mean over time and bodies"),
    "wide_range_share": ("1", "share of the networks for the whole range in the loads, mean over time and bodies"),
    "members": ("1", "members of the ensemble that arrived"),
    "forward_spread": ("m", "standard deviation of the members' final places along world x"),
    "lateral_spread": ("m", "standard deviation of the members' final places along world y"),
    "yaw_spread": ("rad", "standard deviation of the members' final yaw"),
}
"""Unit and meaning of each figure of `summary`."""


@checked
def summary(dataset: xr.Dataset) -> dict[str, Any]:
    """Compute the key figures of a run; `FIGURES` holds their units.

    Returns
    -------
    dict
        - verdict, a word (`exumob.simulation.verdict.VERDICTS`); verdict_since [s], nan without an onset; neither for
          an old or foreign run that holds too little for a verdict;
        - distance [m] along the path; forward and lateral displacement [m]; final yaw [rad];
        - drift_angle [rad]: course less heading at the end;
        - mean_slip [-]: mean slip ratio of the wheels in contact over the second half of the run; nan if none was;
        - buoyed_share [-]: mean upward force of the water over the weight;
        - hull_load_share [-]: largest share of the weight that the soil bore under the hull; least_clearance [m] of the
          hull above the soil surface; neither for runs that do not hold them;
        - spin_energy [J]: work of the driving torques;
        - wall_time [s]; real_time_factor [-]: simulated over wall time;
        - with networks: out_of_range_share [-], the part of the time in which some body was outside the training
          range; fallback_share [-], the share of the calibrated coefficients in the loads, mean over time and bodies;
          with the default networks wide_range_share [-], that of those for the whole range;
        - with members (`exumob.simulation.ensemble.add_members`): members [-], those that arrived; forward_spread,
          lateral_spread [m] and yaw_spread [rad], standard deviations of their final positions and headings.

    Raises
    ------
    ValueError
        If the dataset is no result of `exumob.simulate`.
    """
    needed = ("position", "velocity", "yaw", "slip_ratio", "gravity_load", "water_load", "work")
    missing = [name for name in needed if name not in dataset] + [n for n in ("wall_time",) if n not in dataset.attrs]
    if missing or dataset["time"].size == 0:
        raise ValueError(f"summary: the dataset has no {', '.join(missing) or 'instants'}; give a result of simulate.")
    hull = dataset.sel(body="hull")
    path = hull["position"].sel(axis=["x", "y"]).values
    end = float(dataset["time"][-1])
    later = dataset.sel(time=slice(0.5 * end, None))
    weight = float(-dataset["gravity_load"].isel(time=0).sel(axis="z").sum())
    lift = float(dataset["water_load"].sel(axis="z").sum("body").mean())
    velocity = hull["velocity"].isel(time=-1).values
    yaw = float(hull["yaw"][-1])
    course = float(np.arctan2(velocity[1], velocity[0])) if np.hypot(*velocity[:2]) > 0.01 else yaw
    wall = float(dataset.attrs["wall_time"])
    verdict = verdict_of(dataset)
    forward, lateral = _along(path[-1] - path[0], _start_heading(dataset))
    return {
        **({} if verdict is None else verdict.figures()),
        "distance": float(np.hypot(*np.diff(path, axis=0).T).sum()),
        "forward": forward,
        "lateral": lateral,
        "yaw": yaw,
        "drift_angle": float((course - yaw + np.pi) % (2 * np.pi) - np.pi),
        "mean_slip": float(later["slip_ratio"].mean()),
        "buoyed_share": lift / weight,
        **_hull_figures(dataset),
        "spin_energy": float(dataset["work"].sel(work_kind="spin")[-1]),
        "wall_time": wall,
        "real_time_factor": end / wall if wall > 0.0 else float("inf"),
        **range_shares(dataset),
        **_member_spreads(dataset),
    }


def _hull_figures(dataset: xr.Dataset) -> dict[str, float]:
    if not {"hull_load_share", "keel_clearance"} <= set(dataset):
        return {}
    return {
        "hull_load_share": float(dataset["hull_load_share"].max()),
        "least_clearance": float(dataset["keel_clearance"].min()),
    }


def _start_heading(dataset: xr.Dataset) -> float:
    """Heading with which a run began [rad]; 0 for results that do not say."""
    try:
        return float(next(iter(json.loads(dataset.attrs["parameters"])["start"].values()))["heading"])
    except (KeyError, TypeError, ValueError, AttributeError, StopIteration):
        return 0.0


def _along(way: Array, heading: float) -> tuple[float, float]:
    """Split a way in the plane [m] along a heading [rad] and to its left."""
    if heading == 0.0:
        return float(way[0]), float(way[1])
    c, s = math.cos(heading), math.sin(heading)
    return float(c * way[0] + s * way[1]), float(c * way[1] - s * way[0])


def range_shares(dataset: xr.Dataset) -> dict[str, float]:
    """Return shares of a run with networks, else nothing (see `summary`)."""
    if "hydrodynamics_out_of_range" not in dataset:
        return {}
    return {
        "out_of_range_share": float(dataset["hydrodynamics_out_of_range"].any("body").mean()),
        "fallback_share": float(dataset["hydrodynamics_fallback_share"].mean()),
    } | (
        {"wide_range_share": float(dataset["hydrodynamics_wide_range_share"].mean())}
        if "hydrodynamics_wide_range_share" in dataset
        else {}
    )


def _member_spreads(dataset: xr.Dataset) -> dict[str, float]:
    if "member_position" not in dataset:
        return {}
    ends = dataset["member_position"].isel(time=-1)
    return {
        "members": float(ends.notnull().all("axis").sum()),
        "forward_spread": float(ends.sel(axis="x").std("member", ddof=1)),
        "lateral_spread": float(ends.sel(axis="y").std("member", ddof=1)),
        "yaw_spread": float(dataset["member_yaw"].isel(time=-1).std("member", ddof=1)),
    }


def force_residual(dataset: xr.Dataset) -> xr.DataArray:
    """Sum all forces on each body less mass times acceleration [N], dimensions (time, body, axis); ideally 0."""
    loads = ("soil_load", "water_load", "gravity_load", "suspension_load", "constraint_load")
    return sum(dataset[name] for name in loads) - dataset["mass"] * dataset["acceleration"]


def energy_residual(dataset: xr.Dataset) -> xr.DataArray:
    """Subtract the change of kinetic and stored energy from the work done on the vehicle [J]; ideally 0."""
    energy = dataset["kinetic_energy"] + dataset["stored_energy"]
    return dataset["work"].sum("work_kind") - (energy - energy.isel(time=0))
