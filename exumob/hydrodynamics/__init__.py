"""Models of what the water does to the vehicle; all are exchanged through one interface."""

from exumob.hydrodynamics.coefficients import CoefficientHydrodynamics, Coefficients
from exumob.hydrodynamics.coupled import CfdHydrodynamics, Development
from exumob.hydrodynamics.flow_side import FlowSide, VehicleFlow
from exumob.hydrodynamics.interface import DevelopedHydrodynamics, Hydrodynamics, NoWater
from exumob.hydrodynamics.surrogate import SurrogateHydrodynamics

__all__ = [
    "CfdHydrodynamics", "CoefficientHydrodynamics", "Coefficients", "DevelopedHydrodynamics", "Development", "FlowSide",
    "Hydrodynamics", "NoWater", "SurrogateHydrodynamics", "VehicleFlow",
]  # fmt: skip
