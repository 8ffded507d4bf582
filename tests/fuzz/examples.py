"""Valid objects of the package's classes and protocols, from which faulty ones are made."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from exumob import (
    Box,
    CoefficientHydrodynamics,
    ConstantSteer,
    CrossSection,
    Ford,
    Hull,
    Hydrodynamics,
    LaneChange,
    NoWater,
    PathFollowing,
    Recorded,
    Soil,
    StartPose,
    Steering,
    Suspension,
    Terrain,
    Vehicle,
    Water,
    WaterField,
    Wheel,
    WheelArches,
    Wishbones,
)
from exumob.coupling.explicit import Explicit
from exumob.coupling.flow_code import BuiltInFlow, FlowCode
from exumob.coupling.scheme import Coupling
from exumob.coupling.semi_implicit import SemiImplicit
from exumob.coupling.strong import Strong
from exumob.driving.maneuver import Maneuver, smooth_step
from exumob.flow.grid import Grid
from exumob.mobility.crossing import Crossing
from exumob.mobility.map import Axis, MobilityMap
from exumob.surrogates.model import SurrogateHydrodynamics
from exumob.surrogates.networks import NetworkSet
from exumob.sweeps.experiment import Experiment, amphibious_crossing, amphibious_lane_change
from exumob.sweeps.sampling import Choice, Distribution, LogNormal, Normal, Triangular, Uniform
from exumob.towing_tank.motion import CaptiveMotion, PrescribedMotion
from vehicle_models.amphibious import amphibious_vehicle
from vehicle_models.light_4x4 import light_4x4
from vehicle_models.small_car import small_car

from .odd_values import Given
from .strategies import EXAMPLES

VEHICLES = (amphibious_vehicle, light_4x4, small_car)
RAMP = ([0.1 * n for n in range(11)], [0.0] * 11, [10.0 * smooth_step(0.1 * n)[0] for n in range(11)])
"""Times [s], steering angles [rad] and wheel speeds [rad/s] of a recorded maneuver"""


def _examples() -> dict[Any, list[tuple[str, Any]]]:
    rigid, light, car = amphibious_vehicle(), light_4x4(), small_car()
    both = (("amphibious", rigid), ("light 4x4", light), ("small car", car))
    wishbones = [v.suspension.wishbones for _, v in both if v.suspension.wishbones is not None]
    wishbones += [Wishbones(0.15, 0.18, 0.05, 0.06, 0.06, 0.1)]
    maneuvers = [
        ("LaneChange", LaneChange()), ("ConstantSteer", ConstantSteer()), ("PathFollowing", PathFollowing()),
        ("Recorded", Recorded(*RAMP)),
    ]  # fmt: skip
    coefficients = ("CoefficientHydrodynamics", CoefficientHydrodynamics())
    distributions = [
        ("Uniform", Uniform(0.0, 1.0)), ("Normal", Normal(0.0, 1.0)), ("LogNormal", LogNormal(1.0, 0.1)),
        ("Triangular", Triangular(0.0, 0.5, 1.0)), ("Choice", Choice((1.0, 2.0))),
    ]  # fmt: skip
    return {
        Vehicle: list(both),
        Hull: [(f"{n} hull", v.hull) for n, v in both],
        Wheel: [(f"{n} wheel", v.wheel) for n, v in both],
        Suspension: [(f"{n} suspension", v.suspension) for n, v in both],
        Steering: [(f"{n} steering", v.steering) for n, v in both],
        Wishbones: [("wishbones", w) for w in wishbones],
        Box: [("cabin", box) for box in car.hull.boxes],
        WheelArches: [("WheelArches()", WheelArches()), ("square arches", WheelArches(0.02, 0.2, 0.2, 0.4, 2))],
        Soil: [(row.name, row.soil) for row in Soil.published_table()],
        Water: [("D60/U1", Water(0.12, 1.0)), ("still", Water(0.05)), ("sea", Water(1.0, 0.5, 1.0, 1025.0))],
        WaterField: [("field", WaterField(np.full((3, 4), 0.1)))],
        CrossSection: [("ford", CrossSection([0.0, 2.0, 4.0], [0.1, -0.1, 0.1]))],
        Ford: [("ford", Ford(CrossSection([0, 4, 8], [0.1, -0.1, 0.1]), 0.0, rigid, Soil.published("LETE sand")))],
        StartPose: [("origin", StartPose()), ("elsewhere", StartPose(10.0, 20.0, 1.0))],
        Terrain: [("flat", Terrain()), ("slope", Terrain.slope(0.1))],
        Maneuver: maneuvers,
        **{type(m): [(n, m)] for n, m in maneuvers},
        Hydrodynamics: [coefficients, ("NoWater", NoWater())],
        Coupling: [("Explicit", Explicit()), ("SemiImplicit", SemiImplicit()), ("Strong", Strong())],
        PrescribedMotion: [("CaptiveMotion", CaptiveMotion())],
        CaptiveMotion: [("CaptiveMotion", CaptiveMotion())],
        Distribution: distributions,
        **{type(d): [(n, d)] for n, d in distributions},
        Experiment: [("lane change", amphibious_lane_change()), ("crossing", amphibious_crossing())],
        Crossing: [("Crossing", Crossing(amphibious_crossing()))],
        Axis: [("Axis", Axis("water.depth_ratio", 0.3, 0.7))],
        MobilityMap: [("MobilityMap", MobilityMap(Crossing(amphibious_crossing()), draws=1, levels=0))],
        NetworkSet: [("networks", SurrogateHydrodynamics().networks[0])],
        SurrogateHydrodynamics: [("SurrogateHydrodynamics", SurrogateHydrodynamics())],
        FlowCode: [("BuiltInFlow", BuiltInFlow(0.05))],
        Grid: [("Grid", Grid(*(np.linspace(-1.0, 1.0, 9) for _ in range(3))))],
        xr.Dataset: [("a small Dataset", xr.Dataset({"a": ("x", [1.0, 2.0])}))],
        Path: [("Path('x')", Path("x")), ("Path('none/x')", Path("none/x"))],
    }  # fmt: skip


for owner, found in _examples().items():
    EXAMPLES[owner] = [Given(text, lambda thing=thing: thing, "valid") for text, thing in found]
