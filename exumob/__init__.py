"""Vehicle mobility in shallow water on soft soil.

vehicle, soil, water -> simulate(...) -> xarray.Dataset -> plotting
"""

from exumob.environment import Soil, Water
from exumob.errors import SimulationError, SimulationInterrupted
from exumob.hydrodynamics import CoefficientHydrodynamics, Hydrodynamics, NoWater
from exumob.maneuver import ConstantSteer, LaneChange, Recorded, lane_change
from exumob.path_following import PathFollowing, lane_shift
from exumob.results import load_dataset, save_dataset, summary
from exumob.simulation import simulate
from exumob.terrain import Terrain
from exumob.terramechanics import wheel_soil_forces
from exumob.vehicle import Hull, Steering, Suspension, Vehicle, Wheel, Wishbones, load_vehicle

__all__ = [
    "CoefficientHydrodynamics",
    "ConstantSteer",
    "Hull",
    "Hydrodynamics",
    "LaneChange",
    "NoWater",
    "PathFollowing",
    "Recorded",
    "SimulationError",
    "SimulationInterrupted",
    "Soil",
    "Steering",
    "Suspension",
    "Terrain",
    "Vehicle",
    "Water",
    "Wheel",
    "Wishbones",
    "lane_change",
    "lane_shift",
    "load_dataset",
    "load_vehicle",
    "save_dataset",
    "simulate",
    "summary",
    "wheel_soil_forces",
]
