"""The water that the vehicle moves through: its depth and its current.

World axes: x initial heading, y left, z up; z = 0 is the undisturbed soil surface. SI units and radians.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from exumob.support.arrays import Array
from exumob.support.checks import require_finite, require_positive, require_within


@dataclass(frozen=True)
class Water:
    """A body of water of uniform depth with a uniform current.

    Parameters
    ----------
    depth : float
        Still-water depth above z = 0 [m], > 0: the still level is z = depth, wherever a given bed lies.
    current_speed : float
        Speed of the undisturbed flow over ground [m/s], >= 0.
    current_direction : float
        Where the flow goes, counter-clockwise from world x [rad]; default pi: a head current (towards -x).
    density : float
        [kg/m^3]; 1000 is fresh water.

    Raises
    ------
    ValueError
        If a value is not finite, the depth or density is not positive, or the speed is negative.
    """

    depth: float
    current_speed: float = 0.0
    current_direction: float = math.pi
    density: float = 1000.0

    def __post_init__(self) -> None:
        require_positive("Water", depth=self.depth, density=self.density)
        require_within("Water", 0.0, 20.0, "turn the flow with current_direction.", current_speed=self.current_speed)
        require_finite("Water", current_direction=self.current_direction)

    @classmethod
    def at_ratio(
        cls,
        depth_ratio: float,
        current_speed: float = 0.0,
        *,
        tyre_diameter: float = 0.200,
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
        require_positive("Water", depth_ratio=depth_ratio, tyre_diameter=tyre_diameter)
        return cls(depth_ratio * tyre_diameter, current_speed, current_direction, density)

    @property
    def velocity(self) -> Array:
        """Velocity of the undisturbed flow, world axes [m/s], shape (3,)."""
        return self.current_speed * np.array([math.cos(self.current_direction), math.sin(self.current_direction), 0.0])
