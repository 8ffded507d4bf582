"""Whole short runs of vehicles, soils, waters, maneuvers and terrains of any plausible kind."""

from __future__ import annotations

import logging
import math
from collections.abc import Mapping
from dataclasses import fields, is_dataclass, replace
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
from exumob.support.quantities import ImplausibleValue

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
logger = logging.getLogger(__name__)


@st.composite
def varied(draw: Any, thing: Any, chance: int = 4, spread: float = 1.6) -> Any:
    """An object some of whose numbers are multiplied, within their plausible ranges and bounds."""
    new: dict[str, Any] = {}
    for f in declared_fields(type(thing)):
        value = getattr(thing, f.name)
        if is_dataclass(value) and not isinstance(value, type):
            new[f.name] = draw(varied(value, chance, spread))
        elif type(value) is float and f.quantity is not None and value != 0.0 and draw(st.integers(0, chance)) == 0:
            low, high = f.quantity.safe
            factor = math.exp(draw(st.floats(-1.0, 1.0)) * math.log(spread))
            new[f.name] = min(max(value * factor, low), high)
    try:
        return replace(thing, **new)
    except ValueError:
        return thing


@st.composite
def maneuvers(draw: Any) -> Any:
    """A driver."""
    kind = draw(st.sampled_from(["lane change", "constant", "path", "recorded", "standing", "backward"]))
    speed = draw(st.floats(1.0, 30.0))
    ramp = draw(st.sampled_from([0.05, 0.3, 1.0]))
    if kind == "lane change":
        return LaneChange(draw(st.floats(-0.5, 0.5)), 0.0, draw(st.floats(0.5, 4.0)), speed, ramp)
    if kind == "path":
        return PathFollowing(lane_shift(draw(st.floats(-1.0, 1.0))), speed, ramp)
    if kind == "recorded":
        time = np.linspace(0.0, 1.0, 21)
        rise = np.array([smooth_step(t)[0] for t in time])
        return Recorded(time, draw(st.floats(-0.4, 0.4)) * rise, speed * rise)
    if kind == "standing":
        return ConstantSteer(0.0, 0.0)
    return ConstantSteer(draw(st.floats(-0.5, 0.5)), -speed if kind == "backward" else speed, ramp)


@st.composite
def scenes(draw: Any) -> dict[str, Any]:
    """Arguments of `simulate`."""
    vehicle = draw(varied(draw(st.sampled_from(VEHICLES))()))
    soil = draw(st.sampled_from(Soil.published_table())).soil
    if draw(st.booleans()):
        soil = draw(varied(soil, 2, 2.0))
    soil = replace(
        soil, pressure_form=draw(st.sampled_from(["bekker", "bekker", "reece"])) if soil.n > 0.3 else "bekker",
        shear_limit=draw(st.sampled_from(["per_axis", "resultant"])), rebound_ratio=draw(st.sampled_from([0.0, 0.1, 0.5])),
    )  # fmt: skip
    scene: dict[str, Any] = {"vehicle": vehicle, "soil": soil, "maneuver": draw(maneuvers())}
    if draw(st.integers(0, 2)):
        ratio, speed = draw(st.floats(0.02, 1.2)), draw(st.floats(0.0, 2.0))
        water = Water(
            max(ratio * vehicle.wheel.diameter, 1e-3), speed if speed > 1e-3 else 0.0, draw(st.floats(-math.pi, math.pi)),
            draw(st.sampled_from([1000.0, 1025.0, 800.0])),
        )  # fmt: skip
        scene |= {"water": water, "hydrodynamics": draw(st.sampled_from(["coefficients", "coefficients", "auto", "none"]))}
    elif draw(st.booleans()):
        scene["terrain"] = draw(terrains(vehicle.wheel.diameter))
    macro = draw(st.sampled_from([20e-3, 10e-3, 5e-3]))
    return scene | {
        "duration": draw(st.sampled_from([0.06, 0.1])), "macro_step": macro, "micro_step": draw(st.sampled_from([5e-4, 5e-4, 1e-3])),
        "record_step": draw(st.sampled_from([1e-2, 5e-3])),
    }  # fmt: skip


@st.composite
def terrains(draw: Any, size: float) -> Terrain:
    """A slope, or bumps on it."""
    angle, direction = draw(st.floats(-0.2, 0.2)), draw(st.floats(-math.pi, math.pi))
    plane = Terrain.slope(angle, direction)
    if draw(st.booleans()):
        return plane
    rng = np.random.default_rng(draw(st.integers(0, 999)))
    heights = rng.normal(0.0, draw(st.floats(0.001, 0.1)) * size, (40, 40))
    spacing = draw(st.sampled_from([0.5, 1.0, 2.0])) * size
    return replace(plane, heights=heights, origin=(-20 * spacing, -20 * spacing), spacing=spacing)


def verify_run(run: xr.Dataset) -> None:
    """Raise `Silent` unless a result is finite, or says why not, and forces and energies balance."""
    for name, variable in run.variables.items():
        if variable.dtype.kind != "f":
            continue
        bad = ~np.isfinite(variable.values)
        if bad.any() and not _documented(str(name), variable.attrs):
            raise Silent(f"{name}: {int(bad.sum())} of {bad.size} values are not finite")
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


def _documented(name: str, attributes: Mapping[str, Any]) -> bool:
    return "nan" in str(attributes.get("long_name", "")).lower() or "nan" in str(attributes.get("comment", "")).lower()


NAMES = ("run", "vehicle", "maneuver", "terrain", "soil", "water", "simulate", "settle", "s:", "hydrodynamics", "wheel")
"""Words of which an error of a run holds one, beside the vehicle's name"""


def answer(scene: dict[str, Any]) -> Outcome:
    """Run it."""
    return outcome_of(
        lambda: exumob.simulate(**scene), [*NAMES, scene["vehicle"].name], verify=verify_run, time_limit=TIME_LIMIT
    )


def run_targets() -> list[Target]:
    """Runs."""
    return [Target("simulate", scenes(), answer, group="runs")]


_ = (fields, ImplausibleValue)
