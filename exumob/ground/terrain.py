"""Shape of the undisturbed soil surface: a plane, and on top of it a field of heights if given.

World axes: z up. Inside compiled code, `terrain_height` takes what `Terrain.as_arrays` returns.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import ArrayLike

from exumob.support.arrays import Array
from exumob.support.checks import require_finite, require_positive, require_within

TERRAIN_RECORD = np.dtype(
    [
        ("height", "f8"),
        ("slope_x", "f8"),
        ("slope_y", "f8"),
        ("origin_x", "f8"),
        ("origin_y", "f8"),
        ("spacing_x", "f8"),
        ("spacing_y", "f8"),
    ]
)
"""A `Terrain` but for its field of heights, as compiled code sees it; units as in `Terrain`."""


@dataclass(frozen=True, eq=False)
class Terrain:
    """Soil surface z = height + slope_x x + slope_y y + field(x, y); flat at z = 0 by default.

    Parameters
    ----------
    height : float
        Height of the plane at the world's origin [m].
    slope_x, slope_y : float
        Slopes dz/dx and dz/dy of the plane [-], -2 to 2.
    heights : array_like, shape (n_y, n_x), optional
        Field added to the plane [m]; at least 2 by 2. Between its points it is interpolated by bicubic (Catmull-Rom)
        splines, continuous with its slope; outside, the values at its edge continue.
    origin : tuple of float
        World coordinates x, y of ``heights[0, 0]`` [m].
    spacing : float or tuple of float
        Distance between the points of the field along x and y [m], > 0.

    Raises
    ------
    ValueError
        If a value is not finite, a slope exceeds 2 (63 degrees), or the field's shape or spacing is unusable.
    """

    height: float = 0.0
    slope_x: float = 0.0
    slope_y: float = 0.0
    heights: ArrayLike | None = None
    origin: tuple[float, float] = (0.0, 0.0)
    spacing: float | tuple[float, float] = 1.0

    def __post_init__(self) -> None:
        require_finite("Terrain", height=self.height, origin_x=self.origin[0], origin_y=self.origin[1])
        require_within(
            "Terrain",
            -2.0,
            2.0,
            "slopes are rise over run: math.tan(angle).",
            slope_x=self.slope_x,
            slope_y=self.slope_y,
        )
        dx, dy = self.spacing if isinstance(self.spacing, tuple) else (self.spacing, self.spacing)
        require_positive("Terrain", spacing_x=dx, spacing_y=dy)
        if self.heights is not None:
            field = np.array(self.heights, dtype=float)
            if field.ndim != 2 or min(field.shape) < 2:
                raise ValueError(
                    f"Terrain.heights has shape {field.shape}; give a 2-D array (n_y, n_x), 2 by 2 or larger."
                )
            if not np.isfinite(field).all():
                where = tuple(int(i) for i in np.argwhere(~np.isfinite(field))[0])
                raise ValueError(f"Terrain.heights{list(where)} is not finite; fill gaps before the run.")
            field.setflags(write=False)
            object.__setattr__(self, "heights", field)
        object.__setattr__(self, "spacing", (float(dx), float(dy)))

    @classmethod
    def slope(cls, angle: float, direction: float = 0.0) -> Terrain:
        """Make a plane through the world's origin.

        Parameters
        ----------
        angle : float
            Inclination [rad], 0 to 63 degrees; negative goes down.
        direction : float
            Direction in which it rises, counter-clockwise from world x [rad].
        """
        require_within("Terrain", -1.1, 1.1, "give the angle in radians.", slope_angle=angle)
        require_finite("Terrain", slope_direction=direction)
        steepness = math.tan(angle)
        return cls(slope_x=steepness * math.cos(direction), slope_y=steepness * math.sin(direction))

    @property
    def is_flat(self) -> bool:
        """Tell if the terrain is a horizontal plane."""
        return self.slope_x == 0.0 and self.slope_y == 0.0 and self.heights is None

    def as_arrays(self) -> tuple[np.ndarray, Array]:
        """Return the terrain as compiled code reads it, see `terrain_height`.

        Returns
        -------
        terrain : array of dtype `TERRAIN_RECORD`, shape (1,)
            Kernels take its element 0.
        heights : array, shape (n_y, n_x), or (0, 0) for a plane
            Field added to the plane [m].
        """
        dx, dy = self.spacing if isinstance(self.spacing, tuple) else (self.spacing, self.spacing)
        terrain = np.zeros(1, TERRAIN_RECORD)
        terrain[0] = self.height, self.slope_x, self.slope_y, self.origin[0], self.origin[1], dx, dy
        heights = np.zeros((0, 0)) if self.heights is None else np.array(self.heights, dtype=float)
        return terrain, heights

    def height_and_normal(self, x: float, y: float) -> tuple[float, Array]:
        """Return the height [m] and the unit normal, world axes, shape (3,), at a point x, y [m]."""
        require_finite("Terrain", x=x, y=y)
        terrain, heights = self.as_arrays()
        z, dz_dx, dz_dy = terrain_height(terrain[0], heights, float(x), float(y))
        normal = np.array([-dz_dx, -dz_dy, 1.0])
        return z, normal / np.linalg.norm(normal)


@njit(cache=True, error_model="numpy")
def _spline_weights(t: float) -> tuple[float, float, float, float]:
    """Catmull-Rom weights of four neighbours at t in (0, 1) between the second and the third."""
    return (
        0.5 * t * (-1.0 + t * (2.0 - t)),
        1.0 + 0.5 * t * t * (3.0 * t - 5.0),
        0.5 * t * (1.0 + t * (4.0 - 3.0 * t)),
        0.5 * t * t * (t - 1.0),
    )


@njit(cache=True, error_model="numpy")
def _spline_slopes(t: float) -> tuple[float, float, float, float]:
    """Derivatives of `_spline_weights` by t."""
    return (
        0.5 * (-1.0 + t * (4.0 - 3.0 * t)),
        0.5 * t * (9.0 * t - 10.0),
        0.5 * (1.0 + t * (8.0 - 9.0 * t)),
        0.5 * t * (3.0 * t - 2.0),
    )


@njit(cache=True, error_model="numpy")
def terrain_height(terrain: Any, heights: Array, x: float, y: float) -> tuple[float, float, float]:
    """Compute height and slopes of the terrain, for use inside compiled functions.

    Parameters
    ----------
    terrain : record of dtype `TERRAIN_RECORD`
        Element 0 of the first array of `Terrain.as_arrays`; that array must outlive the call.
    heights : array, shape (n_y, n_x)
        Second array of `Terrain.as_arrays`.
    x, y : float
        World coordinates [m].

    Returns
    -------
    tuple of float
        z [m], dz/dx [-], dz/dy [-].
    """
    slope_x, slope_y = terrain.slope_x, terrain.slope_y
    z = terrain.height + slope_x * x + slope_y * y
    if heights.size == 0:
        return z, slope_x, slope_y
    n_y, n_x = heights.shape
    column = (x - terrain.origin_x) / terrain.spacing_x
    row = (y - terrain.origin_y) / terrain.spacing_y
    inside_x = 0.0 <= column <= n_x - 1.0
    inside_y = 0.0 <= row <= n_y - 1.0
    column = min(max(column, 0.0), n_x - 1.0)
    row = min(max(row, 0.0), n_y - 1.0)
    i = min(int(column), n_x - 2)
    j = min(int(row), n_y - 2)
    along_x, along_y = _spline_weights(column - i), _spline_weights(row - j)
    rate_x, rate_y = _spline_slopes(column - i), _spline_slopes(row - j)
    dz_dx = dz_dy = 0.0
    for b in range(4):
        line = min(max(j + b - 1, 0), n_y - 1)
        value = slope = 0.0
        for a in range(4):
            h = heights[line, min(max(i + a - 1, 0), n_x - 1)]
            value += along_x[a] * h
            slope += rate_x[a] * h
        z += along_y[b] * value
        dz_dx += along_y[b] * slope
        dz_dy += rate_y[b] * value
    if inside_x:
        slope_x += dz_dx / terrain.spacing_x
    if inside_y:
        slope_y += dz_dy / terrain.spacing_y
    return z, slope_x, slope_y
