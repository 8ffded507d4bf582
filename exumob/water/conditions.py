"""The water that the vehicle moves through: its depth and its current.

World axes: x initial heading, y left, z up; z = 0 is the undisturbed soil surface. SI units and radians.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from exumob.support.arrays import Array
from exumob.support.declared import Declared, checked
from exumob.support.quantities import CURRENT_SPEED, DEPTH, DEPTH_RATIO, DIRECTION, Quantity


@dataclass(frozen=True)
class Water(Declared):
    """A body of water of uniform depth with a uniform current.

    Raises
    ------
    ValueError
        If a value is not finite, the depth or density is not positive, or the speed is negative.
    """

    depth: Annotated[float, DEPTH]
    """Still-water depth above z = 0: the still level is z = depth, wherever a given bed lies"""
    current_speed: Annotated[float, CURRENT_SPEED] = 0.0
    """Speed of the undisturbed flow over ground"""
    current_direction: Annotated[float, DIRECTION] = math.pi
    """Where the flow goes, counter-clockwise from world x; pi: a head current (towards -x)"""
    density: Annotated[float, Quantity("kg/m^3", above=0.0, plausible=(700.0, 1500.0))] = 1000.0
    """1000 is fresh water, 1025 sea water"""

    @classmethod
    @checked
    def at_ratio(
        cls,
        depth_ratio: Annotated[float, DEPTH_RATIO],
        current_speed: float = 0.0,
        *,
        tyre_diameter: Annotated[float, Quantity("m", above=0.0, plausible=(0.02, 5.0))] = 0.200,
        current_direction: float = math.pi,
        density: float = 1000.0,
    ) -> Water:
        """Water whose depth is a ratio of the tyre diameter (the paper's D60 is 0.60).

        Parameters
        ----------
        depth_ratio : float
            Depth over tyre diameter [-], > 0.
        current_speed, current_direction, density : float
            As for `Water`.
        tyre_diameter : float
            [m]; default 0.200, the tyre of ``vehicle_models/amphibious.py``.
        """
        return cls(depth_ratio * tyre_diameter, current_speed, current_direction, density)

    @property
    def velocity(self) -> Array:
        """Velocity of the undisturbed flow, world axes [m/s], shape (3,)."""
        return self.current_speed * np.array([math.cos(self.current_direction), math.sin(self.current_direction), 0.0])
