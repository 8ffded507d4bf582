"""Level and current of water that differ from place to place, on a regular grid.

Inside compiled code, `water_at` takes what `exumob.water.conditions.Water.as_arrays` returns. Between the points of a
field level and velocity are bilinear.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from exumob.ground.regular_grid import RegularGrid, both_spacings
from exumob.ground.terrain import HEIGHT_RANGE
from exumob.support.arrays import Array
from exumob.support.declared import Declared
from exumob.support.kernels import njit
from exumob.support.quantities import DIRECTION, Quantity

WATER_RECORD = np.dtype(
    [
        (name, "f8")
        for name in (
            "level", "velocity_x", "velocity_y", "current_speed", "current_direction", "origin_x", "origin_y",
            "spacing_x", "spacing_y", "cos", "sin",
        )
    ]
)  # fmt: skip
"""Water but for its field, as compiled code sees it: level [m] and velocity [m/s] of uniform water, the latter also as
speed [m/s] and direction [rad]; place and direction of a field's points."""

BYTES_PER_POINT = 120
"""Memory for a point of a field while its gaps are filled [bytes]; 24 are kept."""
BEYOND = "give a larger field, or WaterField(continued=True) if the water goes on as at its edge."
"""What to do about places beyond the field's edge."""
ELSEWHERE = "WaterField.origin is the place of level[0, 0] in the world: terrain, water and start share its axes."
"""What to do about places that are nowhere near the field."""
LEVELS = Quantity(
    "m", at_least=HEIGHT_RANGE[0], at_most=HEIGHT_RANGE[1], shape=("n_y", "n_x"), gaps=True,
    remedy="where it marks missing data or dry land, give nan.",
)  # fmt: skip
VELOCITIES = Quantity("m/s", at_least=-100.0, at_most=100.0, plausible=(-15.0, 15.0), shape=("n_y", "n_x"), gaps=True)


@dataclass(frozen=True, eq=False)
class WaterField(Declared):
    """Level and horizontal velocity of the undisturbed water on a regular grid.

    Where the level is nan there is dry land: the level of the nearest wet point goes on there, and the water stands
    still. What is above that level is dry; land that lies below it and is dry all the same, as behind a dike, must be
    given a level at or below its bed.

    Raises
    ------
    ValueError
        If shapes differ or are too small, a value is out of bounds, no point is wet, a velocity is missing at a wet
        point, or only one component of the velocity is given.
    """

    level: Annotated[ArrayLike, LEVELS]
    """World z of the still surface, rows towards +y; nan: dry land"""
    velocity_x: Annotated[ArrayLike, VELOCITIES] | None = None
    """Velocity along world x, whatever the direction of the grid; None, with `velocity_y`: still water"""
    velocity_y: Annotated[ArrayLike, VELOCITIES] | None = None
    """Velocity along world y"""
    origin: Annotated[tuple[float, float], Quantity("m", at_least=-1e9, at_most=1e9)] = (0.0, 0.0)
    """World x, y of ``level[0, 0]``"""
    spacing: Annotated[
        float | tuple[float, float],
        Quantity(
            "m", above=0.0, at_most=1e6, plausible=(1e-3, 1e3),
            negative="where rows run south, turn them: level[::-1], and the velocities likewise.",
        ),
    ] = 1.0  # fmt: skip
    """Distance between the points; two values: along the rows and across them"""
    direction: Annotated[float, DIRECTION] = 0.0
    """Direction of the rows, counter-clockwise from world x: the grid is turned about `origin`"""
    continued: bool = False
    """True: beyond its edges the water goes on as at the nearest point of them. False: a vehicle must stay within"""

    def _check(self) -> None:
        object.__setattr__(self, "spacing", both_spacings(self.spacing))
        level = np.asarray(self.level)
        assert isinstance(self.spacing, tuple)
        RegularGrid.of("WaterField.level", level, self.origin, self.spacing, self.direction, BYTES_PER_POINT)
        wet = ~np.isnan(level)
        if not wet.any():
            raise ValueError("WaterField.level is nan everywhere, so all is dry land; give water=None for that.")
        if (self.velocity_x is None) != (self.velocity_y is None):
            missing = "velocity_x" if self.velocity_x is None else "velocity_y"
            raise ValueError(f"WaterField.{missing} is missing; give both components of the velocity, or none.")
        for name in ("velocity_x", "velocity_y"):
            if getattr(self, name) is None:
                continue
            velocity = np.asarray(getattr(self, name))
            if velocity.shape != level.shape:
                raise ValueError(
                    f"WaterField.{name} has shape {velocity.shape} and level {level.shape}; give all on one grid."
                )
            lacking = wet & np.isnan(velocity)
            if lacking.any():
                j, i = np.argwhere(lacking)[0]
                raise ValueError(
                    f"WaterField.{name} is nan at {lacking.sum()} wet points, the first at [{j}, {i}], where the level "
                    f"is {level[j, i]:.6g} m; give the velocity there, 0 in still water."
                )

    @property
    def grid(self) -> RegularGrid:
        """Where its points lie."""
        assert isinstance(self.spacing, tuple)
        n_y, n_x = np.shape(self.level)
        return RegularGrid(self.origin, self.spacing, (n_y, n_x), self.direction)

    def holds(self, points: ArrayLike) -> NDArray[np.bool_]:
        """Tell at which places, world x, y [m], shape (..., 2), the water is given; at all if it is `continued`."""
        return np.ones(np.shape(points)[:-1], dtype=bool) if self.continued else self.grid.holds(points)

    def require_inside(self, name: str, what: str, points: ArrayLike) -> None:
        """Raise ValueError if places, world x, y [m], shape (n, 2), are beyond the field, unless it is `continued`."""
        if not self.continued:
            self.grid.require_inside(name, "the field of water", what, points, BEYOND, ELSEWHERE)

    @cached_property
    def nodes(self) -> Array:
        """Level [m] and velocity [m/s] at the points, gaps filled, shape (n_y, n_x, 3); not to be changed."""
        level = np.array(self.level, dtype=float)
        found = np.zeros((*level.shape, 3))
        dry = np.isnan(level)
        if dry.any():
            from scipy.ndimage import distance_transform_edt  # only where there are gaps: it takes long to import

            dx, dy = self.grid.spacing
            nearest = distance_transform_edt(dry, sampling=(dy, dx), return_distances=False, return_indices=True)
            level = level[tuple(nearest)]
        found[..., 0] = level
        for k, velocity in enumerate((self.velocity_x, self.velocity_y), start=1):
            if velocity is not None:
                found[..., k] = np.where(dry, 0.0, velocity)
        return found


@njit(cache=True, error_model="numpy")
def water_at(water: Any, nodes: Array, x: float, y: float) -> tuple[float, float, float]:
    """Return level [m] and velocity along world x and y [m/s] at a place, for use inside compiled functions.

    Parameters
    ----------
    water : record of dtype `WATER_RECORD`
        Element 0 of the first array of `exumob.water.conditions.Water.as_arrays`; that array must outlive the call.
    nodes : array, shape (n_y, n_x, 3)
        Its second array; (0, 0, 3): the water is uniform.
    x, y : float
        World coordinates [m]; beyond the edges of a field the water is that at the edge.

    Returns
    -------
    tuple of float
        nan where x or y is.
    """
    n_y, n_x, _ = nodes.shape
    if n_x == 0:
        return water.level, water.velocity_x, water.velocity_y
    away_x, away_y = x - water.origin_x, y - water.origin_y
    column = (away_x * water.cos + away_y * water.sin) / water.spacing_x
    row = (away_y * water.cos - away_x * water.sin) / water.spacing_y
    if math.isnan(column) or math.isnan(row):
        return math.nan, math.nan, math.nan  # and no place in the memory
    column = min(max(column, 0.0), n_x - 1.0)
    row = min(max(row, 0.0), n_y - 1.0)
    i, j = min(int(column), n_x - 2), min(int(row), n_y - 2)
    s, t = column - i, row - j
    return _between(nodes, i, j, s, t, 0), _between(nodes, i, j, s, t, 1), _between(nodes, i, j, s, t, 2)


@njit(cache=True, error_model="numpy")
def _between(nodes: Array, i: int, j: int, s: float, t: float, k: int) -> float:
    """Bilinear value of component k in a cell; of four equal values exactly that value."""
    below = nodes[j, i, k] + s * (nodes[j, i + 1, k] - nodes[j, i, k])
    above = nodes[j + 1, i, k] + s * (nodes[j + 1, i + 1, k] - nodes[j + 1, i, k])
    return below + t * (above - below)
