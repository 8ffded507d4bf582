"""Models of what the water does to the vehicle; all are exchanged through one interface."""

from exumob.hydrodynamics.coefficients import CoefficientHydrodynamics, Coefficients
from exumob.hydrodynamics.interface import Hydrodynamics, NoWater

__all__ = ["CoefficientHydrodynamics", "Coefficients", "Hydrodynamics", "NoWater"]
