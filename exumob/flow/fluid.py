"""The numbers of the water that kernels need."""

from __future__ import annotations

from typing import NamedTuple


class Fluid(NamedTuple):
    """Water as the kernels know it."""

    density: float
    """[kg/m^3]"""
    level: float
    """Height of its still surface above z = 0 [m]"""
    viscosity: float
    """Kinematic, molecular [m^2/s]"""
