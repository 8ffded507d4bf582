"""A given bed: a terrain at rest in the world, through which the grid moves, as one more thing that closes faces.

Faces are open by the share of their area above the bed, which is taken as straight between the corners of the columns
of cells. A flat bed is then exact wherever it lies in a cell, and a uniform flow along a plane one has no divergence.
"""

from __future__ import annotations

import logging
import math
from typing import NamedTuple

import numpy as np
from numba import prange
from numpy.typing import NDArray

from exumob.flow import water_on_bed
from exumob.flow.active_rows import WaterCells
from exumob.flow.area_fractions import FAR, AreaFractions
from exumob.flow.far_field import FarField
from exumob.flow.grid import HALO, Grid, Metrics
from exumob.flow.undisturbed import FarVelocity, UndisturbedWater
from exumob.flow.water_on_bed import RoughBed
from exumob.ground.terrain import Terrain, terrain_height
from exumob.support.arrays import Array
from exumob.support.constants import GRAVITY
from exumob.support.kernels import njit

logger = logging.getLogger(__name__)

SHUT = 1.0e-6
"""Area fraction below which the bed closes a face [-]."""
STEEP = 1.0e-3
"""Rise of the bed over a face, in cell heights, below which it counts as level [-]."""
UNEVEN = 0.1
"""Largest difference of what the current carries into the window and out of it, over the larger of the two [-]."""
MOST_RISE = 0.05
"""Error of the level in the far field, over the mean depth there, that is bearable [-]."""
ABOVE = 4
"""Cells above the highest bed whose distance from it is kept up."""


class BedShape(NamedTuple):
    """The bed under the grid, halo included."""

    corners: Array
    """Heights at the corners of the columns of cells [m], shape (ny + 1, nx + 1)"""
    heights: Array
    """Their means over the columns [m], shape (ny, nx)"""
    slope_x: Array
    slope_y: Array
    """Slopes of the columns along the grid's axes [-], shape (ny, nx)"""


class Bed:
    """Terrain under a moving grid.

    Parameters
    ----------
    terrain : Terrain
    grid : Grid
    number : int
        Number of the bed in `AreaFractions.nearest`: one more than those of the solids.
    deepest : float, optional
        Where the terrain lies below this height, the bed lies at it [m].

    Attributes
    ----------
    heights : array, shape (ny, nx)
        Mean of the bed below the cells, halo included [m].
    region : array of int, shape (6,)
        Index box of all that the bed closes.
    """

    def __init__(self, terrain: Terrain, grid: Grid, number: int, deepest: float | None = None) -> None:
        self.grid, self.number = grid, number
        self.deepest = -math.inf if deepest is None else deepest
        self.terrain, self._terrain = terrain, terrain.as_arrays()
        ny, nz, nx = grid.padded_shape
        self._shape = BedShape(np.zeros((ny + 1, nx + 1)), *(np.zeros((ny, nx)) for _ in range(3)))
        self.heights = self._shape.heights
        self.region = np.array([0, ny, 0, nz, 0, nx], dtype=np.int64)
        self._frame: Array | None = None
        self._warned = False

    def survey(self, frame: Array) -> bool:
        """Take the heights under the grid at `frame` (x, y [m], heading [rad]); False if it stands where it stood.

        Raises
        ------
        ValueError
            If the bed lies below the window's lowest face, or the window reaches beyond the terrain's field of heights.
        """
        if self._frame is not None and np.array_equal(frame, self._frame):
            return False
        require_bed(self.terrain, self.grid, frame[None])
        m, h = self.grid.metrics, HALO
        take_heights(*self._terrain, frame, self.deepest, m, self._shape)
        inner = self._shape.corners[h:-h, h:-h]
        lowest, bottom = float(inner.min()), float(self.grid.z_faces[0])
        if lowest < bottom - 1e-9:
            raise ValueError(
                f"terrain: the bed comes down to z = {lowest:.4g} m in the window, whose lowest face is at "
                f"{bottom:.4g} m; let Grid.z_faces start at or below the lowest bed on the grid's whole way."
            )
        top = min(int(np.searchsorted(m.zf, float(self._shape.corners.max()))) + ABOVE, len(m.zc))
        self._frame, self.region[3] = frame.copy(), top
        return True

    @property
    def top(self) -> int:
        """First layer of cells that the bed does not reach."""
        return int(self.region[3])

    def lay(self, region: NDArray[np.int64], area_fractions: AreaFractions) -> None:
        """Set area fractions, distance and nearest in an index box to those of the bed alone."""
        lay(region, self.top, self.number, self._shape, self.grid.metrics, area_fractions)

    def refill(self, fraction: Array, area_fractions: AreaFractions) -> None:
        """Give cells below the bed the fraction of the water above or beside them."""
        water_on_bed.refill(fraction, self.heights, self.top, area_fractions.nearest, self.number, self.grid.metrics)

    def stop(self, cells: WaterCells, area_fractions: AreaFractions, *velocities: tuple[Array, Array, Array]) -> None:
        """Bring to rest what moves well below the bed, and films on it."""
        for velocity in velocities:
            water_on_bed.stop_below(
                velocity, cells.wet, area_fractions, self.heights, self.top, self.number, self.grid.metrics
            )  # fmt: skip

    def rough(self, roughness: float) -> RoughBed:
        """The bed with an equivalent sand roughness [m], for `exumob.flow.water_on_bed.shear`."""
        return RoughBed(self.heights, self.top, roughness)

    def check_water(
        self, water: UndisturbedWater, far: FarVelocity, sides: FarField, start: bool, may_be_dry: bool
    ) -> None:  # fmt: skip
        """Refuse at the start what cannot be undisturbed: no water at all, or a current that is no flow over the bed.

        The far field draws the water to the given current at the still level. Where that brings more than it takes
        away, the level must make up for it: of a column, by the surplus over the rate at which waves carry it out of
        the absorbing zone; of the whole window, by a flow of its own. A uniform current across the contours of a slope
        is such a flow; one along them is none, and bumps of a few per cent of the depth are bearable.

        Parameters
        ----------
        water : UndisturbedWater
        far : FarVelocity
            Its current.
        sides : FarField
        start : bool
            False: log a warning, once, instead of raising.
        may_be_dry : bool
            The window may begin on dry land.
        """
        h = HALO
        lowest = float(self.heights[h:-h, h:-h].min())
        if start and not may_be_dry and lowest >= water.level:
            raise ValueError(
                f"terrain: no bed in the window lies below the still level at z = {water.level:g} m (the lowest is at "
                f"{lowest:.4g} m); raise the level (Water.depth, from z = 0, or Water.level) or lower the bed."
            )
        zone = sides.zone
        if (self._warned and not start) or far.greatest == 0.0 or not zone.any():
            return
        depths = np.maximum(water.level - self.heights, 0.0)
        surplus = np.abs(self._surplus(far, depths))[zone]
        mean = float(depths[zone].mean())
        if mean == 0.0:
            return
        rise = float(surplus.max()) * sides.settings.zone_width / math.sqrt(GRAVITY * mean)
        brought, taken = self._through_the_sides(far, depths)
        apart = abs(brought - taken) / max(brought, taken, 1e-300)
        if rise <= MOST_RISE * mean and apart <= UNEVEN:
            return
        message = (
            f"terrain: the current crosses depths of {depths[zone].min():.3g} to {depths[zone].max():.3g} m at the far "
            f"sides and is not faster where it is shallower: it brings {brought:.3g} m^3/s and takes {taken:.3g} m^3/s "
            f"({100.0 * UNEVEN:.0f} % of difference are bearable), and its level would be off by "
            f"{100.0 * rise / mean:.2g} % of the depth (bearable: {100.0 * MOST_RISE:.0f} %). Level the terrain "
            "towards the window's sides, turn the current along the contours, take still water and move the vehicle, "
            "or, with the flow in the loop, give water that flows over this bed (CrossSection.water, Water.field)."
        )
        if start:
            raise ValueError(message)
        logger.warning("%s", message)
        self._warned = True

    def _through_the_sides(self, far: FarVelocity, depths: Array) -> tuple[float, float]:
        """What the undisturbed current brings through the window's sides, and what it takes [m^3/s]."""
        m, h = self.grid.metrics, HALO
        rows, columns = slice(h, -h), slice(h, -h)
        flows = np.concatenate([
            far.x[rows, h] * depths[rows, h] * m.dy[rows], -far.x[rows, -h] * depths[rows, -h - 1] * m.dy[rows],
            far.y[h, columns] * depths[h, columns] * m.dx[columns],
            -far.y[-h, columns] * depths[-h - 1, columns] * m.dx[columns],
        ])  # fmt: skip
        return float(flows[flows > 0.0].sum()), float(-flows[flows < 0.0].sum())

    def _surplus(self, far: FarVelocity, depths: Array) -> Array:
        """What the undisturbed current brings to the columns [m/s], shape (ny, nx); 0 in the outermost."""
        m, found = self.grid.metrics, np.zeros_like(depths)
        along_x = far.x[:, 1:] * 0.5 * (depths[:, 1:] + depths[:, :-1])
        along_y = far.y[1:] * 0.5 * (depths[1:] + depths[:-1])
        found[1:-1, 1:-1] = (along_x[1:-1, :-1] - along_x[1:-1, 1:]) / m.dx[1:-1]
        found[1:-1, 1:-1] += (along_y[:-1, 1:-1] - along_y[1:, 1:-1]) / m.dy[1:-1, None]
        return found


def require_bed(terrain: Terrain, grid: Grid, frames: Array) -> None:
    """Refuse a field of heights that does not reach to the sides of a window at all its places.

    Parameters
    ----------
    terrain : Terrain
    grid : Grid
        The window.
    frames : array, shape (n, 3)
        Places of the window: origin x, y [m] and heading [rad].

    Raises
    ------
    ValueError
        With the extents of the field and of the window.
    """
    corners = np.array([(x, y) for x in grid.x_faces[[0, -1]] for y in grid.y_faces[[0, -1]]])
    c, s = np.cos(frames[:, 2, None]), np.sin(frames[:, 2, None])
    x, y = corners.T
    points = np.stack([frames[:, 0, None] + c * x - s * y, frames[:, 1, None] + s * x + c * y], axis=-1)
    terrain.require_inside("terrain", "the flow's window on its way", points.reshape(-1, 2))


def lowest_bed(terrain: Terrain, frames: Array, grid_low: Array, grid_high: Array, spacing: float = 0.1) -> float:
    """Lowest bed [m] below a window on its way.

    Parameters
    ----------
    terrain : Terrain
    frames : array, shape (n, 3)
        Places of the window: origin x, y [m] and heading [rad].
    grid_low, grid_high : array, shape (2,)
        Its corners in its own axes [m].
    spacing : float
        Spacing of the points looked at [m].
    """
    axes = [
        np.linspace(low, high, max(math.ceil((high - low) / spacing), 1) + 1)
        for low, high in zip(grid_low, grid_high, strict=True)
    ]
    return float(_lowest(*terrain.as_arrays(), np.atleast_2d(np.asarray(frames, dtype=float)), *axes))


@njit(cache=True, error_model="numpy")
def _lowest(terrain: np.ndarray, field: Array, frames: Array, x: Array, y: Array) -> float:
    """Lowest height at the points x, y of all frames."""
    lowest = np.inf
    for frame in frames:
        c, s = math.cos(frame[2]), math.sin(frame[2])
        for a in x:
            for b in y:
                z, _, _ = terrain_height(terrain[0], field, frame[0] + c * a - s * b, frame[1] + s * a + c * b)
                lowest = min(lowest, z)
    return lowest


@njit(cache=True, error_model="numpy", parallel=True)
def take_heights(
    terrain: np.ndarray, field: Array, frame: Array, deepest: float, metrics: Metrics, shape: BedShape
) -> None:  # fmt: skip
    """Take the heights of the bed at the columns' corners, and from these their means and slopes.

    Parameters
    ----------
    terrain, field : array
        `Terrain.as_arrays`.
    frame : array, shape (3,)
        Grid origin x, y [m] and yaw [rad] in the world.
    deepest : float
        Least height of the bed [m].
    metrics : Metrics
    shape : BedShape
        Its arrays are changed.
    """
    corners, centers = shape.corners, shape.heights  # Numba drops writes through a tuple inside prange
    slope_x, slope_y = shape.slope_x, shape.slope_y
    ny, nx = centers.shape
    c, s = math.cos(frame[2]), math.sin(frame[2])
    for j in prange(ny + 1):
        y = metrics.yf[j]
        for i in range(nx + 1):
            x = metrics.xf[i]
            z, _, _ = terrain_height(terrain[0], field, frame[0] + c * x - s * y, frame[1] + s * x + c * y)
            corners[j, i] = max(z, deepest)
    for j in prange(ny):
        for i in range(nx):
            a, b, d, e = corners[j, i], corners[j, i + 1], corners[j + 1, i], corners[j + 1, i + 1]
            centers[j, i] = 0.25 * ((a + e) + (b + d))
            slope_x[j, i] = 0.5 * ((b - a) + (e - d)) / metrics.dx[i]
            slope_y[j, i] = 0.5 * ((d - a) + (e - b)) / metrics.dy[j]


@njit(cache=True, error_model="numpy", inline="always")
def _upright_share(low: float, high: float) -> float:
    """Share of an upright face above a straight bed; low, high: its upper edge above the bed's ends, over its height.

    Mean of min(max(s, 0), 1) for s from `low` to `high`.
    """
    if min(low, high) >= 1.0:
        return 1.0
    if max(low, high) <= 0.0:
        return 0.0
    if abs(high - low) < STEEP:
        share = min(max(0.5 * (low + high), 0.0), 1.0)
    else:
        inner_low, inner_high = min(max(low, 0.0), 1.0), min(max(high, 0.0), 1.0)
        area = 0.5 * (inner_high * inner_high - inner_low * inner_low) + max(high - 1.0, 0.0) - max(low - 1.0, 0.0)
        share = area / (high - low)
    return share if share >= SHUT else 0.0


@njit(cache=True, error_model="numpy", inline="always")
def _level_share(height: float, a: float, b: float) -> float:
    """Share of a level face above a plane bed.

    Parameters
    ----------
    height : float
        Height of the face's centre above the bed [m].
    a, b : float
        Rise of the bed over the face's two widths, > 0 [m].
    """
    if height >= 0.5 * (a + b):
        return 1.0
    if height <= -0.5 * (a + b):
        return 0.0
    area = 0.0
    for n in range(4):
        s = max(height + (0.5 if n < 2 else -0.5) * a + (0.5 if n % 2 == 0 else -0.5) * b, 0.0)
        area += (0.5 if n == 0 or n == 3 else -0.5) * s * s
    share = min(area / (a * b), 1.0)
    return share if share >= SHUT else 0.0


@njit(cache=True, error_model="numpy", parallel=True)
def lay(
    region: NDArray[np.int64], top: int, number: int, shape: BedShape, metrics: Metrics, area_fractions: AreaFractions
) -> None:
    """Set what the bed leaves open in an index box; from layer `top` on all is open.

    The area fractions before sharpening (`ax`, `ay`, `az`) belong to the solids alone and are left as they are.
    """
    j0, j1, k0, k1, i0, i1 = region
    o, corners, centers, slope_x, slope_y = area_fractions, shape.corners, shape.heights, shape.slope_x, shape.slope_y
    bx, by, bz = o.bx, o.by, o.bz  # Numba drops writes through a tuple inside prange
    sx, sy, sz, distance, nearest = o.sx, o.sy, o.sz, o.distance, o.nearest
    for j in prange(j0, j1):
        for k in range(k0, k1):
            low, high, dz = metrics.zf[k], metrics.zf[k + 1], metrics.dz[k]
            for i in range(i0, i1):
                sx[j, k, i] = sy[j, k, i] = sz[j, k, i] = 0.0
                if k >= top:
                    bx[j, k, i] = by[j, k, i] = bz[j, k, i] = 1.0
                    distance[j, k, i], nearest[j, k, i] = FAR, -1
                    continue
                gx, gy, z, corner = slope_x[j, i], slope_y[j, i], centers[j, i], (high - corners[j, i]) / dz
                bx[j, k, i] = _upright_share(corner, (high - corners[j + 1, i]) / dz)
                by[j, k, i] = _upright_share(corner, (high - corners[j, i + 1]) / dz)
                a, b = max(abs(gx) * metrics.dx[i], STEEP * dz), max(abs(gy) * metrics.dy[j], STEEP * dz)
                bz[j, k, i] = _level_share(low - z, a, b)
                distance[j, k, i] = (metrics.zc[k] - z) / math.sqrt(1.0 + gx * gx + gy * gy)
                nearest[j, k, i] = number


@njit(cache=True, error_model="numpy", parallel=True)
def join(regions: NDArray[np.int64], bodies: AreaFractions, area_fractions: AreaFractions) -> None:
    """Add solids to the bed in their index boxes: the less open and the nearer of the two counts.

    Parameters
    ----------
    regions : array of int, shape (n, 6)
        Index boxes of the solids.
    bodies : AreaFractions
        Area fractions of the solids alone.
    area_fractions : AreaFractions, changed
        Area fractions of the bed alone; then of both.
    """
    o = area_fractions
    bx, by, bz = o.bx, o.by, o.bz  # Numba drops writes through a tuple inside prange
    sx, sy, sz, distance, nearest = o.sx, o.sy, o.sz, o.distance, o.nearest
    for n in range(len(regions)):
        j0, j1, k0, k1, i0, i1 = regions[n]
        for j in prange(j0, j1):
            for k in range(k0, k1):
                for i in range(i0, i1):
                    if bodies.bx[j, k, i] < bx[j, k, i]:
                        bx[j, k, i], sx[j, k, i] = bodies.bx[j, k, i], bodies.sx[j, k, i]
                    if bodies.by[j, k, i] < by[j, k, i]:
                        by[j, k, i], sy[j, k, i] = bodies.by[j, k, i], bodies.sy[j, k, i]
                    if bodies.bz[j, k, i] < bz[j, k, i]:
                        bz[j, k, i], sz[j, k, i] = bodies.bz[j, k, i], bodies.sz[j, k, i]
                    if bodies.distance[j, k, i] < distance[j, k, i]:
                        distance[j, k, i], nearest[j, k, i] = bodies.distance[j, k, i], bodies.nearest[j, k, i]
