"""Where the points of a regular grid lie on the map, and which places it holds."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from exumob.support.arrays import Array
from exumob.support.cost import require_memory


def both_spacings(spacing: float | tuple[float, float]) -> tuple[float, float]:
    """Distance of points along x and along y [m]; one number stands for both."""
    return spacing if isinstance(spacing, tuple) else (spacing, spacing)


class RegularGrid(NamedTuple):
    """Points at equal distances, the axes of the grid turned about its first point."""

    origin: tuple[float, float]
    """World x, y of the first point [m]"""
    spacing: tuple[float, float]
    """Distance between the points along the grid's own x and y [m]"""
    shape: tuple[int, int]
    """Number of points along its y and along its x"""
    direction: float = 0.0
    """Direction of the grid's x axis, counter-clockwise from world x [rad]"""

    @classmethod
    def of(  # where the points lie, what is there, and how a message names it
        cls, name: str, values: ArrayLike, origin: tuple[float, float], spacing: tuple[float, float], direction: float,
        bytes_per_point: int,
    ) -> RegularGrid:  # fmt: skip
        """Make the grid of a field, or refuse one that is too small, or too large for the memory.

        Parameters
        ----------
        name : str
            The field in messages, as in ``"Terrain.heights"``.
        values : array_like, shape (n_y, n_x)
            One value at each point.
        origin, spacing, direction
            As the fields of the class.
        bytes_per_point : int
            Memory that a point takes while the field is prepared [bytes].

        Raises
        ------
        ValueError
            If there are fewer than 2 by 2 points, or more than fit into the memory.
        """
        shape = np.shape(values)
        if min(shape) < 2:
            raise ValueError(f"{name} has shape {shape}; give an array (n_y, n_x), 2 by 2 or larger.")
        require_memory(
            f"{name} of {shape[0]} by {shape[1]} points", bytes_per_point * shape[0] * shape[1],
            "cut out what the run drives over, or take every second point.",
        )  # fmt: skip
        return cls(origin, spacing, (shape[0], shape[1]), direction)

    @property
    def lengths(self) -> tuple[float, float]:
        """Extent along the grid's own x and y [m]."""
        return self.spacing[0] * (self.shape[1] - 1), self.spacing[1] * (self.shape[0] - 1)

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """Smallest x, largest x, smallest y and largest y of its corners in the world [m]."""
        (x, y), (length, width) = self.origin, self.lengths
        if self.direction == 0.0:
            return x, x + length, y, y + width
        c, s = math.cos(self.direction), math.sin(self.direction)
        corners = [(x + c * a - s * b, y + s * a + c * b) for a in (0.0, length) for b in (0.0, width)]
        (low_x, low_y), (high_x, high_y) = np.min(corners, axis=0), np.max(corners, axis=0)
        return float(low_x), float(high_x), float(low_y), float(high_y)

    def own(self, points: ArrayLike) -> Array:
        """World x, y [m] as distances from the first point along the grid's own axes [m]; shape (..., 2)."""
        away = np.asarray(points, dtype=float) - np.array(self.origin)
        if self.direction == 0.0:
            return np.asarray(away)
        c, s = math.cos(self.direction), math.sin(self.direction)
        return np.stack([c * away[..., 0] + s * away[..., 1], c * away[..., 1] - s * away[..., 0]], axis=-1)

    def holds(self, points: ArrayLike) -> NDArray[np.bool_]:
        """Tell which points, world x, y [m], shape (..., 2), lie within the grid."""
        u, v = np.moveaxis(self.own(points), -1, 0)
        (length, width), (dx, dy) = self.lengths, self.spacing
        off_x, off_y = 1e-6 * dx, 1e-6 * dy  # rounding, in map coordinates above all
        inside_x = (u >= -off_x) & (u <= length + off_x)
        return np.asarray(inside_x & (v >= -off_y) & (v <= width + off_y))

    def require_inside(self, name: str, field: str, what: str, points: ArrayLike, remedy: str, shift: str) -> None:
        """Refuse points that lie outside.

        Parameters
        ----------
        name : str
            What the grid belongs to in the message, as in ``"simulate.terrain"``.
        field : str
            What it is the grid of, as in ``"the field of heights"``.
        what : str
            What the points are, as in ``"the vehicle at its start"``.
        points : array_like, shape (n, 2)
            World x, y [m].
        remedy, shift : str
            What to do about points beyond its edge, and about points that are nowhere near it.

        Raises
        ------
        ValueError
            With the extents of the grid and of the points, and the likely cause.
        """
        places = np.asarray(points, dtype=float)
        if self.holds(places).all():
            return
        x_low, x_high, y_low, y_high = self.extent
        (low_x, low_y), (high_x, high_y) = places.min(axis=0), places.max(axis=0)
        away = max(x_low - high_x, low_x - x_high, y_low - high_y, low_y - y_high)
        turned = f", turned by {math.degrees(self.direction):.4g} degrees" if self.direction != 0.0 else ""
        raise ValueError(
            f"{name}: {field} reaches from x = {x_low:.9g} to {x_high:.9g} m and from y = {y_low:.9g} to "
            f"{y_high:.9g} m{turned}, which does not hold {what}, x = {low_x:.9g} to {high_x:.9g} m, y = {low_y:.9g} "
            f"to {high_y:.9g} m; {shift if away > 0.0 else remedy}"
        )
