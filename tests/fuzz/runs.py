"""Whole short runs of vehicles, soils, waters, maneuvers and terrains of any plausible kind."""

from __future__ import annotations

import math
import re
from dataclasses import is_dataclass, replace
from typing import Any

import numpy as np
import xarray as xr
from hypothesis import strategies as st

import exumob
from exumob import ConstantSteer, LaneChange, PathFollowing, Recorded, Soil, Terrain, Water, lane_shift
from exumob.driving.maneuver import smooth_step
from exumob.simulation.summary import energy_residual, force_residual
from exumob.support.constants import GRAVITY
from exumob.support.declared import declared_fields

from .examples import VEHICLES
from .outcome import Outcome, Silent, outcome_of
from .targets import Target

FORCE_LIMIT = 1e-3
"""Largest sum of the forces on a body that is not balanced, over the weight of the vehicle [-]"""
ENERGY_LIMIT = 0.02
"""Largest energy that is not accounted for, over the energy that moved: work, kinetic and stored energy [-]"""
ENERGY_FLOOR = 1e-4
"""Energy below which a residual is noise, over the weight times the tyre's radius [-]"""
TIME_LIMIT = 120.0
"""Of one run [s]; the first compiles"""


def varied(rng: np.random.Generator, thing: Any, share: float = 0.2, spread: float = 1.6) -> Any:
    """An object some of whose numbers are multiplied, within their plausible ranges and bounds."""
    new: dict[str, Any] = {}
    for f in declared_fields(type(thing)):
        value = getattr(thing, f.name)
        if is_dataclass(value) and not isinstance(value, type):
            new[f.name] = varied(rng, value, share, spread)
        elif type(value) is float and f.quantity is not None and value != 0.0 and rng.random() < share:
            low, high = f.quantity.safe
            new[f.name] = float(np.clip(value * spread ** rng.uniform(-1.0, 1.0), low, high))
    try:
        return replace(thing, **new)
    except ValueError:
        return thing


def maneuver(rng: np.random.Generator) -> Any:
    """A driver."""
    kind = rng.choice(["lane change", "constant", "path", "recorded", "standing", "backward"])
    speed, ramp, angle = rng.uniform(1.0, 30.0), float(rng.choice([0.05, 0.3, 1.0])), rng.uniform(-0.5, 0.5)
    if kind == "lane change":
        return LaneChange(angle, 0.0, rng.uniform(0.5, 4.0), speed, ramp)
    if kind == "path":
        return PathFollowing(lane_shift(rng.uniform(-1.0, 1.0)), speed, ramp, max_steering=0.3)
    if kind == "recorded":
        time = np.linspace(0.0, 1.0, 21)
        rise = np.array([smooth_step(t)[0] for t in time])
        return Recorded(time, angle * rise, speed * rise)
    if kind == "standing":
        return ConstantSteer(0.0, 0.0)
    return ConstantSteer(angle, -speed if kind == "backward" else speed, ramp)


def terrain(rng: np.random.Generator, size: float) -> Terrain:
    """A slope, or bumps on it."""
    plane = Terrain.slope(rng.uniform(-0.2, 0.2), rng.uniform(-math.pi, math.pi))
    if rng.random() < 0.5:
        return plane
    spacing = float(rng.choice([0.5, 1.0, 2.0])) * size
    heights = rng.normal(0.0, rng.uniform(0.001, 0.1) * size, (40, 40))
    return replace(plane, heights=heights, origin=(-20.0 * spacing, -20.0 * spacing), spacing=spacing)


def scene(number: int) -> dict[str, Any]:
    """Arguments of `simulate`; each number gives others."""
    rng = np.random.default_rng(number)
    vehicle = varied(rng, VEHICLES[number % len(VEHICLES)]())
    soil = SOILS[rng.integers(len(SOILS))]
    if rng.random() < 0.5:
        soil = varied(rng, soil, 0.4, 2.0)
    soil = replace(
        soil, pressure_form=rng.choice(["bekker", "bekker", "reece"]), shear_limit=rng.choice(["per_axis",
        "resultant"]),
        rebound_ratio=rng.choice([0.0, 0.1, 0.5]),
    )  # fmt: skip
    found: dict[str, Any] = {"vehicle": vehicle, "soil": soil, "maneuver": maneuver(rng)}
    kind = rng.random()
    if kind < 0.6:
        depth, speed = rng.uniform(0.02, 1.2) * vehicle.wheel.diameter, float(rng.choice([0.0, rng.uniform(0.01, 2.0)]))
        found["water"] = Water(depth, speed, rng.uniform(-math.pi, math.pi), float(rng.choice([1000.0, 1025.0, 800.0])))
        found["hydrodynamics"] = str(rng.choice(["coefficients", "calibrated", "auto", "none"]))
    elif kind < 0.85:
        found["terrain"] = terrain(rng, vehicle.wheel.diameter)
    return found | {
        "duration": float(rng.choice([0.06, 0.1])), "macro_step": float(rng.choice([20e-3, 10e-3, 5e-3])),
        "micro_step": float(rng.choice([5e-4, 5e-4, 1e-3])), "record_step": float(rng.choice([1e-2, 5e-3])),
    }  # fmt: skip


def verify_run(run: xr.Dataset) -> None:
    """Raise `Silent` unless a result is finite, or says why not, and forces and energies balance."""
    broken = [str(name) for name, v in run.variables.items() if v.dtype.kind == "f" and not _finite_or_documented(v)]
    if broken:
        raise Silent(f"not finite, and no word why: {', '.join(broken)}")
    weight = float(run["mass"].sum()) * GRAVITY
    off = float(np.abs(force_residual(run)).max()) / weight
    if off > FORCE_LIMIT:
        raise Silent(f"forces are off by {off:.2g} of the weight")
    moved = float(np.abs(run["work"]).sum("work_kind").max() + run["kinetic_energy"].max())
    stored = run["stored_energy"]
    moved += float(np.abs(stored - stored[0]).max())
    floor = ENERGY_FLOOR * weight * 0.1
    lost = float(np.abs(energy_residual(run)).max())
    if lost > ENERGY_LIMIT * moved + floor:
        raise Silent(f"{lost:.3g} J of {moved:.3g} J are not accounted for")


def _finite_or_documented(variable: xr.Variable) -> bool:
    said = f"{variable.attrs.get('long_name', '')} {variable.attrs.get('comment', '')}"
    return re.search(r"\bnan\b", said) is not None or bool(np.isfinite(variable.values).all())


SOILS = [row.soil for row in Soil.published_table()]
NAMES = (
    "run",
    "vehicle",
    "maneuver",
    "terrain",
    "soil",
    "water",
    "simulate",
    "settle",
    "s:",
    "hydrodynamics",
    "wheel",
    "CoefficientHydrodynamics",
)
"""Words of which an error of a run holds one, beside the vehicle's name"""


def answer(number: int) -> Outcome:
    """Run it."""
    given = scene(number)
    return outcome_of(
        lambda: exumob.simulate(**given), [*NAMES, given["vehicle"].name], verify=verify_run, time_limit=TIME_LIMIT
    )


def run_targets() -> list[Target]:
    """Runs, by the number of their scene (`scene`)."""
    return [Target("simulate", st.integers(0, 10**6), answer, group="runs")]
