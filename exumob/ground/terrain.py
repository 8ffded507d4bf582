"""Shape of the undisturbed soil surface: a plane, and on top of it a field of heights if given.

World axes: z up. Inside compiled code, `terrain_height` takes what `Terrain.as_arrays` returns.

Between its points the field is a bicubic Hermite surface, continuous with its slope. In each cell it is a Bezier patch
of 16 control points: the heights f at the corners and, next to a corner, f + s a, f + t b and f + s a + t b + s t c,
where s, t = +1 or -1 point into the cell, a and b are a third of the rise to the next point as the slopes along x and
y give it, and c is a ninth of the twist. The surface lies within the range of its control points. They lie within the
range of the cell's four corners: a is 0 at a local extremum along x, and at most half of the smaller rise to a
neighbour elsewhere (Fritsch & Carlson, SIAM J. Numer. Anal. 17 (1980) 238, bound a monotone cubic so, and less
strictly); b likewise along y. Then f + s a and f + t b lie between corners, and so does f + s a + t b, the mean of
f + 2 s a and f + 2 t b. And c is cut to what the corners of all cells at the point allow; 0 always is.

So nothing rises above or falls below the heights given, and along the lines of the grid the surface is monotone from
point to point. Where no bound is felt the slopes are central differences and the surface is the Catmull-Rom spline, of
third order; at crests and hollows the bounds leave second order.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from exumob.ground.regular_grid import RegularGrid, both_spacings
from exumob.support.arrays import Array
from exumob.support.checks import require_finite
from exumob.support.declared import Declared, checked
from exumob.support.kernels import njit
from exumob.support.quantities import DIRECTION, Quantity

TERRAIN_RECORD = np.dtype(
    [
        ("height", "f8"),
        ("slope_x", "f8"),
        ("slope_y", "f8"),
        ("origin_x", "f8"),
        ("origin_y", "f8"),
        ("spacing_x", "f8"),
        ("spacing_y", "f8"),
        ("cos", "f8"),
        ("sin", "f8"),
    ]
)
"""A `Terrain` but for its field of heights, as compiled code sees it; units as in `Terrain`."""

HEIGHT_RANGE = (-1000.0, 9000.0)
"""Heights on land [m], with room below the lowest shore; -9999, -32768 and 1e20 stand for missing data."""

BYTES_PER_POINT = 180
"""Memory for a point of a field while its slopes are limited [bytes]; 40 are kept."""

BEYOND = "give a larger field, or pad it (numpy.pad with mode='edge') if the ground goes on as at its edge."
"""What to do about places beyond the field's edge."""
ELSEWHERE = (
    "Terrain.origin is the place of heights[0, 0] in the world, in which a run starts at (0, 0) unless simulate.start "
    "says where: subtract the place of the start from map coordinates, or give it as start."
)
"""What to do about places that are nowhere near the field."""

SLOPE = Quantity("1", at_least=-2.0, at_most=2.0, remedy="slopes are rise over run: math.tan(angle).")


@dataclass(frozen=True, eq=False)
class Terrain(Declared):
    """Soil surface z = height + slope_x x + slope_y y + field(x, y); flat at z = 0 by default.

    Raises
    ------
    ValueError
        If a value is not finite, a slope exceeds 2 (63 degrees), or the field's shape or spacing is unusable; if
        heights are masked, not finite, outside `HEIGHT_RANGE` or steeper than `steepest`.
    """

    height: Annotated[float, Quantity("m", at_least=-1e4, at_most=1e4)] = 0.0
    """Height of the plane at the world's origin"""
    slope_x: Annotated[float, SLOPE] = 0.0
    """Slope dz/dx of the plane"""
    slope_y: Annotated[float, SLOPE] = 0.0
    """Slope dz/dy of the plane"""
    heights: Annotated[ArrayLike, Quantity("m", shape=("n_y", "n_x"))] | None = None
    """Field added to the plane, at least 2 by 2 points, rows towards +y. Between its points it is interpolated smoothly
    within their range (module docstring); outside, the values at its edge continue"""
    origin: Annotated[tuple[float, float], Quantity("m", at_least=-1e9, at_most=1e9)] = (0.0, 0.0)
    """World x, y of ``heights[0, 0]``. A run starts at the world's origin unless it is given a start"""
    spacing: Annotated[
        float | tuple[float, float],
        Quantity(
            "m",
            above=0.0,
            at_most=1e6,
            plausible=(1e-3, 1e3),
            negative="where rows run south, turn them: heights[::-1].",
        ),
    ] = 1.0
    """Distance between the points of the field; two values: along x and along y"""
    steepest: Annotated[float, Quantity("1", above=0.0, at_most=1e6)] = 5.0
    """Largest slope between neighbouring points of the field; a steeper one is taken for a mark of missing data"""
    direction: Annotated[float, DIRECTION] = 0.0
    """Direction of the field's rows, counter-clockwise from world x: the field is turned about `origin`, the plane is
    not"""

    def _check(self) -> None:
        object.__setattr__(self, "spacing", both_spacings(self.spacing))
        if self.heights is None:
            return
        field = np.asarray(self.heights)
        dx, dy = self._steps
        RegularGrid.of("Terrain.heights", field, self.origin, (dx, dy), self.direction, BYTES_PER_POINT)
        low, high = HEIGHT_RANGE
        beyond = (field < low) | (field > high)
        if beyond.any():
            j, i = np.argwhere(beyond)[0]
            raise ValueError(
                f"Terrain.heights: {beyond.sum()} of {field.size} values lie outside {low:g} to {high:g} m, the first "
                f"at [{j}, {i}] ({field[j, i]:.9g}): marks of missing data, or another unit? Fill the gaps, and give "
                "metres above the place where the run starts."
            )
        slopes = [np.abs(np.diff(field, axis=axis)) / step for axis, step in ((1, dx), (0, dy))]
        most = self.steepest * (1.0 + 1e-9)  # rounding
        if max(slope.max() for slope in slopes) <= most:
            return
        along = int(slopes[1].max() > slopes[0].max())
        j, i = (int(k) for k in np.unravel_index(int(slopes[along].argmax()), slopes[along].shape))
        next_j, next_i = (j + 1, i) if along else (j, i + 1)
        heights, slope = (float(field[j, i]), float(field[next_j, next_i])), float(slopes[along][j, i])
        likely = max(heights, key=lambda z: abs(z - float(np.median(field))))
        pairs = sum(int((s > most).sum()) for s in slopes)
        raise ValueError(
            f"Terrain.heights: from {heights[0]:.6g} m at [{j}, {i}] to {heights[1]:.6g} m at [{next_j}, {next_i}] is "
            f"a slope of {slope:.4g} ({math.degrees(math.atan(slope)):.1f} degrees), beyond Terrain.steepest = "
            f"{self.steepest:g} as at {pairs} pairs of neighbours. If {likely:.6g} marks missing data, fill the gaps; "
            "if spacing is in another unit, give metres; if the step is real, raise steepest."
        )

    @classmethod
    @checked
    def slope(
        cls,
        angle: Annotated[
            float, Quantity("rad", at_least=-1.1, at_most=1.1)
        ],
        direction: Annotated[float, DIRECTION] = 0.0,
    ) -> Terrain:  # fmt: skip
        """Make a plane through the world's origin.

        Parameters
        ----------
        angle : float
            Inclination [rad], 0 to 63 degrees; negative goes down.
        direction : float
            Direction in which it rises, counter-clockwise from world x [rad].
        """
        steepness = math.tan(angle)
        return cls(slope_x=steepness * math.cos(direction), slope_y=steepness * math.sin(direction))

    @property
    def is_flat(self) -> bool:
        """Tell if the terrain is a horizontal plane."""
        return self.slope_x == 0.0 and self.slope_y == 0.0 and self.heights is None

    @property
    def _steps(self) -> tuple[float, float]:
        assert isinstance(self.spacing, tuple)
        return self.spacing

    @property
    def _grid(self) -> RegularGrid | None:
        """Where the points of the field lie; None for a plane."""
        if self.heights is None:
            return None
        n_y, n_x = np.shape(self.heights)
        return RegularGrid(self.origin, self._steps, (n_y, n_x), self.direction)

    @property
    def extent(self) -> tuple[float, float, float, float] | None:
        """Smallest x, largest x, smallest y and largest y of the field [m]; None for a plane, which has no end."""
        return None if self._grid is None else self._grid.extent

    def holds(self, points: ArrayLike) -> NDArray[np.bool_]:
        """Tell which points lie within the field; all do for a plane.

        Parameters
        ----------
        points : array_like, shape (..., 2)
            World x, y [m].

        Returns
        -------
        array of bool, shape (...)
        """
        if self._grid is None:
            return np.ones(np.shape(points)[:-1], dtype=bool)
        return self._grid.holds(points)

    def require_inside(self, name: str, what: str, points: ArrayLike, remedy: str = "") -> None:
        """Refuse points that lie outside the field of heights.

        Parameters
        ----------
        name : str
            What the terrain is called in the message, as in ``"simulate.terrain"``.
        what : str
            What the points are, as in ``"the vehicle at its start"``.
        points : array_like, shape (n, 2)
            World x, y [m].
        remedy : str, optional
            What to do about it.

        Raises
        ------
        ValueError
            With the extents of the field and of the points, and the likely cause.
        """
        if self._grid is not None:
            self._grid.require_inside(name, "the field of heights", what, points, remedy or BEYOND, remedy or ELSEWHERE)

    @cached_property
    def _nodes(self) -> Array:
        return np.zeros((0, 0, 4)) if self.heights is None else hermite_nodes(np.asarray(self.heights, dtype=float))

    @cached_property
    def largest_slope(self) -> float:
        """Largest slope of plane and field together, in the middles of the squares between four points [rad]."""
        rise_x, rise_y = self.slope_x, self.slope_y
        if self.heights is not None:
            field, (dx, dy) = np.asarray(self.heights, dtype=float), self._steps
            along = 0.5 * (np.diff(field[1:], axis=1) + np.diff(field[:-1], axis=1)) / dx
            across = 0.5 * (np.diff(field[:, 1:], axis=0) + np.diff(field[:, :-1], axis=0)) / dy
            c, s = math.cos(self.direction), math.sin(self.direction)
            return math.atan(float(np.hypot(rise_x + c * along - s * across, rise_y + s * along + c * across).max()))
        return math.atan(math.hypot(rise_x, rise_y))

    def as_arrays(self, about: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> tuple[np.ndarray, Array]:
        """Return the terrain as compiled code reads it, see `terrain_height`.

        Parameters
        ----------
        about : tuple of float, optional
            World x, y, z from which coordinates and heights count [m]; near the vehicle they keep all their digits.

        Returns
        -------
        terrain : array of dtype `TERRAIN_RECORD`, shape (1,)
            Kernels take its element 0.
        nodes : array, shape (n_y, n_x, 4), or (0, 0, 4) for a plane
            Field added to the plane, as `hermite_nodes` gives it [m]; not to be changed.
        """
        terrain = np.zeros(1, TERRAIN_RECORD)
        x, y, z = about
        height = self.height + self.slope_x * x + self.slope_y * y - z
        place = self.origin[0] - x, self.origin[1] - y
        turn = math.cos(self.direction), math.sin(self.direction)
        terrain[0] = height, self.slope_x, self.slope_y, *place, *self._steps, *turn
        return terrain, self._nodes

    def turned_back(self) -> tuple[np.ndarray, Array]:
        """Return `as_arrays` of the terrain as it is in axes that are turned with the field, about its origin."""
        (terrain, nodes), (x, y) = self.as_arrays(), self.origin
        c, s = math.cos(self.direction), math.sin(self.direction)
        along, across = c * self.slope_x + s * self.slope_y, c * self.slope_y - s * self.slope_x
        height = self.height + (self.slope_x - along) * x + (self.slope_y - across) * y
        terrain["height"], terrain["slope_x"], terrain["slope_y"] = height, along, across
        terrain["cos"], terrain["sin"] = 1.0, 0.0
        return terrain, nodes

    def height_and_normal(self, x: float, y: float) -> tuple[float, Array]:
        """Return the height [m] and the unit normal, world axes, shape (3,), at a point x, y [m]."""
        require_finite("Terrain", x=x, y=y)
        terrain, nodes = self.as_arrays()
        z, dz_dx, dz_dy = terrain_height(terrain[0], nodes, float(x), float(y))
        normal = np.array([-dz_dx, -dz_dy, 1.0])
        return z, normal / np.linalg.norm(normal)


def hermite_nodes(heights: Array) -> Array:
    """Compute f, a, b and c of the module docstring at the points of a field.

    Parameters
    ----------
    heights : array, shape (n_y, n_x)
        [m]

    Returns
    -------
    array, shape (n_y, n_x, 4)
        [m]
    """
    rise_x, rise_y = _rises(heights, 1), _rises(heights, 0)
    a, b = _limited(rise_x, heights, 1) / 3.0, _limited(rise_y, heights, 0) / 3.0
    corners = np.stack([heights[:-1, :-1], heights[:-1, 1:], heights[1:, :-1], heights[1:, 1:]])
    low = np.pad(corners.min(axis=0), 1, constant_values=-np.inf)
    high = np.pad(corners.max(axis=0), 1, constant_values=np.inf)
    least, most = np.full(heights.shape, -np.inf), np.full(heights.shape, np.inf)
    for t, rows in ((-1.0, slice(None, -1)), (1.0, slice(1, None))):
        for s, columns in ((-1.0, slice(None, -1)), (1.0, slice(1, None))):
            point = heights + s * a + t * b
            down, up = np.minimum(low[rows, columns] - point, 0.0), np.maximum(high[rows, columns] - point, 0.0)
            if s * t < 0.0:
                down, up = -up, -down
            least, most = np.maximum(least, down), np.minimum(most, up)
    c = np.clip(_rises(rise_x, 0) / 9.0, least, most)
    return np.stack([heights, a, b, c], axis=-1)


def _rises(values: Array, axis: int) -> Array:
    """Rise to the next point by central differences, one-sided ones of second order at the ends."""
    f = np.moveaxis(values, axis, 0)
    rises = np.empty_like(f)
    if len(f) == 2:
        rises[:] = f[1] - f[0]
    else:
        rises[1:-1] = 0.5 * (f[2:] - f[:-2])
        rises[0] = 0.5 * (4.0 * f[1] - 3.0 * f[0] - f[2])
        rises[-1] = 0.5 * (3.0 * f[-1] - 4.0 * f[-2] + f[-3])
    return np.moveaxis(rises, 0, axis)


def _limited(rises: Array, values: Array, axis: int) -> Array:
    """Cut rises to 1.5 times the smaller one to a neighbour, and to 0 where the neighbours lie on one side."""
    step = np.diff(values, axis=axis)
    ends = [(0, 0), (0, 0)]
    ends[axis] = (1, 1)
    both = np.pad(step, ends, mode="edge")
    before, after = np.moveaxis(both, axis, 0)[:-1], np.moveaxis(both, axis, 0)[1:]
    before, after = np.moveaxis(before, 0, axis), np.moveaxis(after, 0, axis)
    most = 1.5 * np.minimum(np.abs(before), np.abs(after))
    kept = np.clip(rises, -most, most)
    return np.where((before * after > 0.0) & (kept * after > 0.0), kept, 0.0)


@njit(cache=True, error_model="numpy")
def _bernstein(t: float) -> tuple[float, float, float, float, float, float, float, float]:
    """Weights of f and of its neighbouring control point at both ends of (0, 1), then their derivatives by t.

    A control point next to an end is f + a or f - a; its weight counts for f, too.
    """
    u = 1.0 - t
    near, far = 3.0 * u * u * t, 3.0 * u * t * t
    near_rate, far_rate = 3.0 * u * (u - 2.0 * t), 3.0 * t * (2.0 * u - t)
    return (
        u * u * u + near, near, t * t * t + far, -far,
        near_rate - 3.0 * u * u, near_rate, 3.0 * t * t + far_rate, -far_rate,
    )  # fmt: skip


@njit(cache=True, error_model="numpy")
def terrain_height(terrain: Any, nodes: Array, x: float, y: float) -> tuple[float, float, float]:
    """Compute height and slopes of the terrain, for use inside compiled functions.

    Parameters
    ----------
    terrain : record of dtype `TERRAIN_RECORD`
        Element 0 of the first array of `Terrain.as_arrays`; that array must outlive the call.
    nodes : array, shape (n_y, n_x, 4)
        Second array of `Terrain.as_arrays`.
    x, y : float
        World coordinates [m].

    Returns
    -------
    tuple of float
        z [m], dz/dx [-], dz/dy [-]; nan where x or y is.
    """
    slope_x, slope_y = terrain.slope_x, terrain.slope_y
    z = terrain.height + slope_x * x + slope_y * y
    n_y, n_x, _ = nodes.shape
    if n_x == 0:
        return z, slope_x, slope_y
    away_x, away_y = x - terrain.origin_x, y - terrain.origin_y
    column = (away_x * terrain.cos + away_y * terrain.sin) / terrain.spacing_x
    row = (away_y * terrain.cos - away_x * terrain.sin) / terrain.spacing_y
    if math.isnan(column) or math.isnan(row):
        return math.nan, math.nan, math.nan  # and no place in the memory
    inside_x = 0.0 <= column <= n_x - 1.0
    inside_y = 0.0 <= row <= n_y - 1.0
    column = min(max(column, 0.0), n_x - 1.0)
    row = min(max(row, 0.0), n_y - 1.0)
    i = min(int(column), n_x - 2)
    j = min(int(row), n_y - 2)
    f_0, a_0, f_1, a_1, df_0, da_0, df_1, da_1 = _bernstein(column - i)
    g_0, b_0, g_1, b_1, dg_0, db_0, dg_1, db_1 = _bernstein(row - j)
    p, q, r, s = nodes[j, i], nodes[j, i + 1], nodes[j + 1, i], nodes[j + 1, i + 1]
    below = f_0 * p[0] + a_0 * p[1] + f_1 * q[0] + a_1 * q[1]
    below_rise = f_0 * p[2] + a_0 * p[3] + f_1 * q[2] + a_1 * q[3]
    above = f_0 * r[0] + a_0 * r[1] + f_1 * s[0] + a_1 * s[1]
    above_rise = f_0 * r[2] + a_0 * r[3] + f_1 * s[2] + a_1 * s[3]
    z += g_0 * below + b_0 * below_rise + g_1 * above + b_1 * above_rise
    along, across = 0.0, 0.0
    if inside_x:
        along = (
            g_0 * (df_0 * p[0] + da_0 * p[1] + df_1 * q[0] + da_1 * q[1])
            + b_0 * (df_0 * p[2] + da_0 * p[3] + df_1 * q[2] + da_1 * q[3])
            + g_1 * (df_0 * r[0] + da_0 * r[1] + df_1 * s[0] + da_1 * s[1])
            + b_1 * (df_0 * r[2] + da_0 * r[3] + df_1 * s[2] + da_1 * s[3])
        ) / terrain.spacing_x
    if inside_y:
        across = (dg_0 * below + db_0 * below_rise + dg_1 * above + db_1 * above_rise) / terrain.spacing_y
    slope_x += along * terrain.cos - across * terrain.sin
    slope_y += along * terrain.sin + across * terrain.cos
    return z, slope_x, slope_y
