"""Where a run begins, and in which direction the vehicle heads there."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike

from exumob.support.arrays import Array
from exumob.support.declared import Declared
from exumob.support.quantities import DIRECTION, Quantity

PLACE = Quantity("m", at_least=-1e8, at_most=1e8)
"""World coordinate"""


@dataclass(frozen=True)
class StartPose(Declared):
    """Place and heading of the vehicle at the start of a run; by default the world's origin, heading along world x.

    The place is that of the point midway between the four wheels. Height, pitch and roll are found on the ground.
    """

    x: Annotated[float, PLACE] = 0.0
    """World x"""
    y: Annotated[float, PLACE] = 0.0
    """World y"""
    heading: Annotated[float, DIRECTION] = 0.0
    """Direction in which the vehicle heads, counter-clockwise from world x"""

    def to_world(self, points: ArrayLike) -> Array:
        """Return points that are given ahead and to the left of the start as places in the world.

        Parameters
        ----------
        points : array_like, shape (..., 2)
            Distances ahead and to the left [m].

        Returns
        -------
        array, shape (..., 2)
            World x, y [m].
        """
        c, s = math.cos(self.heading), math.sin(self.heading)
        ahead, left = np.moveaxis(np.asarray(points, dtype=float), -1, 0)
        return np.stack([self.x + c * ahead - s * left, self.y + s * ahead + c * left], axis=-1)


AT_ORIGIN = StartPose()
"""At the world's origin, heading along world x."""
