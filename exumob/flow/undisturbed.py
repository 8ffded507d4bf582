"""The undisturbed water of a window: one still level, and a current that may differ from place to place."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numba import prange
from numpy.typing import NDArray

from exumob.flow.grid import Grid, Metrics
from exumob.ground.terrain import Terrain
from exumob.support.arrays import Array
from exumob.support.kernels import njit
from exumob.support.rotations import about_z
from exumob.water.conditions import Water
from exumob.water.water_field import water_at

LEVEL_RANGE = 0.05
"""How far a field's level may lie from its mean, over the greatest depth below it, to count as one level [-]."""
LOOKED_AT = 4000
"""Points of a field whose depth is looked at, about."""


class FarVelocity(NamedTuple):
    """Velocity of the undisturbed water, grid axes, halo included; it is horizontal, the same at all heights."""

    x: Array
    """Along x, on the low x faces of the columns of cells [m/s], shape (ny, nx)"""
    y: Array
    """Along y, on their low y faces [m/s]"""

    @property
    def in_the_middle(self) -> Array:
        """Velocity in the middle of the window [m/s], shape (2,)."""
        ny, nx = self.x.shape
        return np.array([self.x[ny // 2, nx // 2], self.y[ny // 2, nx // 2]])

    @property
    def greatest(self) -> float:
        """Largest of its components anywhere in the window [m/s]."""
        return float(max(np.abs(self.x).max(), np.abs(self.y).max()))


class UndisturbedWater:
    """The water as it would be in the window without any solid.

    Parameters
    ----------
    water : Water
    grid : Grid

    Attributes
    ----------
    level : float
        World z of the still surface [m].
    """

    def __init__(self, water: Water, grid: Grid) -> None:
        self._water, self._metrics = water, grid.metrics
        self.level = still_level(water)
        ny, _, nx = grid.padded_shape
        self._velocity = FarVelocity(np.zeros((ny, nx)), np.zeros((ny, nx)))
        self._arrays = None if water.field is None else water.as_arrays()

    def velocity(self, frame: Array) -> FarVelocity:
        """Return the velocity for a grid at `frame` (origin x, y [m] and yaw [rad]); the next call overwrites it."""
        found = self._velocity
        if self._arrays is None:
            far = about_z(frame[2]).T @ self._water.velocity
            found.x[:], found.y[:] = far[0], far[1]
        else:
            c, s = float(np.cos(frame[2])), float(np.sin(frame[2]))
            take_velocity(*self._arrays, frame, (c, s), self._metrics, found)
        return found


def is_uniform(water: Water, terrain: Terrain) -> bool:
    """Tell whether water and ground are one depth and one current over level ground at z = 0."""
    return (
        water.field is None and terrain.is_flat and terrain.height == 0.0 and (water.level is None or water.level > 0)
    )


def flow_water(water: Water, terrain: Terrain | None) -> Water:
    """Return the water as the flow solver takes it: a depth over level ground elsewhere than at z = 0 is a level."""
    terrain = Terrain() if terrain is None else terrain
    if is_uniform(water, terrain):
        return water if water.level is None else replace(water, depth=water.level, level=None)
    return water if water.depth is None else replace(water, depth=None, level=terrain.height + water.depth)


def still_level(water: Water) -> float:
    """Return the world z of the still surface [m]: a depth counts from z = 0, of a field it is the mean level."""
    if water.level is not None:
        return float(water.level)
    if water.field is None:
        return water.uniform_depth
    levels = np.asarray(water.field.level, dtype=float)
    return float(np.nanmean(levels)) if np.nanmax(levels) > np.nanmin(levels) else float(np.nanmax(levels))


def require_one_level(water: Water, terrain: Terrain) -> None:
    """Refuse a field of water whose level differs more from place to place than one level can stand for.

    Raises
    ------
    ValueError
        With the levels, what is allowed, and the remedy.
    """
    if water.field is None:
        return
    level = np.asarray(water.field.level, dtype=float)
    n_y, n_x = level.shape
    wet = np.argwhere(np.isfinite(level))
    grid = water.field.grid
    c, s = math.cos(grid.direction), math.sin(grid.direction)
    along, aside = wet[:, 1] * grid.spacing[0], wet[:, 0] * grid.spacing[1]
    places = np.stack([grid.origin[0] + c * along - s * aside, grid.origin[1] + s * along + c * aside], axis=-1)
    levels, mean = level[wet[:, 0], wet[:, 1]], still_level(water)
    known = places[terrain.holds(places)]
    some = known[:: max(len(known) // LOOKED_AT, 1)]
    depth = max((mean - terrain.height_and_normal(x, y)[0] for x, y in some), default=0.0)
    away = float(np.abs(levels - mean).max())
    if away > LEVEL_RANGE * max(depth, 0.0) + 1e-9:
        raise ValueError(
            f"Water.field: its level goes from {levels.min():.4g} to {levels.max():.4g} m over {n_x} by {n_y} points, "
            f"{away:.3g} m from the mean; the flow solver takes one level, and {LEVEL_RANGE * max(depth, 0.0):.3g} m "
            f"({100.0 * LEVEL_RANGE:.0f} % of the greatest depth) are bearable. Cut out the part that is driven on, or "
            "take hydrodynamics='calibrated'."
        )


@njit(cache=True, error_model="numpy", parallel=True)
def take_velocity(
    water: NDArray[np.void], nodes: Array, frame: Array, turn: tuple[float, float], metrics: Metrics,
    velocity: FarVelocity,
) -> None:  # fmt: skip
    """Take the velocity of a field of water at the low faces of the columns, in grid axes.

    Parameters
    ----------
    water, nodes : array
        `Water.as_arrays`.
    frame : array, shape (3,)
        Grid origin x, y [m] and yaw [rad] in the world.
    turn : (float, float)
        Cosine and sine of the yaw.
    metrics : Metrics
    velocity : FarVelocity
        Its arrays are changed.
    """
    along_x, along_y = velocity.x, velocity.y  # Numba drops writes through a tuple inside prange
    ny, nx = along_x.shape
    c, s = turn
    for j in prange(ny):
        for i in range(nx):
            x, y = metrics.xf[i], metrics.yc[j]
            _, u, v = water_at(water[0], nodes, frame[0] + c * x - s * y, frame[1] + s * x + c * y)
            along_x[j, i] = c * u + s * v
            x, y = metrics.xc[i], metrics.yf[j]
            _, u, v = water_at(water[0], nodes, frame[0] + c * x - s * y, frame[1] + s * x + c * y)
            along_y[j, i] = c * v - s * u
