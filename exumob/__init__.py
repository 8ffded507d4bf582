"""Vehicle mobility in shallow water on soft soil.

vehicle, soil, water -> simulate(...) -> xarray.Dataset -> plotting
"""

from typing import TYPE_CHECKING

from exumob.support.caches import provide_cache
from exumob.support.lazy import on_first_use

provide_cache()  # before anything that Numba compiles is imported

if TYPE_CHECKING:
    from exumob.driving.maneuver import ConstantSteer, LaneChange, Recorded, lane_change
    from exumob.driving.path_following import PathFollowing, lane_shift
    from exumob.ground.soil import Soil
    from exumob.ground.terrain import Terrain
    from exumob.ground.terramechanics import wheel_soil_forces
    from exumob.mobility.ford import Ford, ford_report
    from exumob.simulation.result_files import load_dataset, save_dataset
    from exumob.simulation.run import simulate
    from exumob.simulation.summary import summary
    from exumob.support.errors import SimulationError, SimulationInterrupted
    from exumob.support.provenance import EXUMOB_VERSION as __version__
    from exumob.support.quantities import ImplausibleValue, unusual
    from exumob.surrogates.model import SurrogateHydrodynamics
    from exumob.vehicle.parameters import Box, Hull, Steering, Suspension, Vehicle, Wheel, WheelArches, Wishbones
    from exumob.vehicle.point_force import PointForce
    from exumob.vehicle.scaled import scaled_vehicle
    from exumob.vehicle.start_pose import StartPose
    from exumob.vehicle.vehicle_file import load_vehicle
    from exumob.water.calibrated import CalibratedHydrodynamics
    from exumob.water.coefficients import CoefficientHydrodynamics
    from exumob.water.conditions import Water
    from exumob.water.cross_section import CrossSection
    from exumob.water.hydrodynamics import Hydrodynamics, NoWater
    from exumob.water.river_file import read_river
    from exumob.water.water_field import WaterField
else:
    __getattr__, __dir__ = on_first_use(__name__)

__all__ = [
    "Box",
    "CalibratedHydrodynamics",
    "CoefficientHydrodynamics",
    "ConstantSteer",
    "CrossSection",
    "Ford",
    "Hull",
    "Hydrodynamics",
    "ImplausibleValue",
    "LaneChange",
    "NoWater",
    "PathFollowing",
    "PointForce",
    "Recorded",
    "SimulationError",
    "SimulationInterrupted",
    "Soil",
    "StartPose",
    "Steering",
    "SurrogateHydrodynamics",
    "Suspension",
    "Terrain",
    "Vehicle",
    "Water",
    "WaterField",
    "Wheel",
    "WheelArches",
    "Wishbones",
    "__version__",
    "ford_report",
    "lane_change",
    "lane_shift",
    "load_dataset",
    "load_vehicle",
    "read_river",
    "save_dataset",
    "scaled_vehicle",
    "simulate",
    "summary",
    "unusual",
    "wheel_soil_forces",
]
