"""A given bed: a terrain at rest in the world, through which the grid moves, as one more thing that closes faces.

Faces are open by the share of their area above the bed, which is taken as straight between the corners of the columns
of cells. A flat bed is then exact wherever it lies in a cell, and a uniform flow along a plane one has no divergence.
"""

from __future__ import annotations

import logging
import math

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from exumob.flow.advection import RESOLVED
from exumob.flow.grid import HALO, Grid, Metrics
from exumob.flow.solids import FAR, AreaFractions
from exumob.flow.turbulence.wall import friction_velocity
from exumob.ground.terrain import Terrain, terrain_height
from exumob.support.arrays import Array
from exumob.water.conditions import Water

logger = logging.getLogger(__name__)

SHUT = 1.0e-6
"""AreaFractions below which the bed closes a face [-]."""
STEEP = 1.0e-3
"""Rise of the bed over a face, in cell heights, below which it counts as level [-]."""
CONTOUR = 1.0e-3
"""Largest slope along a current that counts as none [-]."""
UNEVEN = 0.1
"""Largest range of the depth along the far sides over its mean that a current may cross [-]."""
DEEP = 2
"""Cells below the bed from which the velocity is 0: no flow sees it."""
ABOVE = 4
"""Cells above the highest bed whose distance from it is kept up."""


class Bed:
    """Terrain under a moving grid.

    Parameters
    ----------
    terrain : Terrain
    grid : Grid
    number : int
        That stands for the bed in `AreaFractions.nearest`: one more than those of the solids.

    Attributes
    ----------
    heights : array, shape (ny, nx)
        Mean of the bed below the cells, halo included [m].
    region : array of int, shape (6,)
        Index box of all that the bed closes.
    """

    def __init__(self, terrain: Terrain, grid: Grid, number: int) -> None:
        self.grid, self.number = grid, number
        self._terrain = terrain.as_arrays()
        ny, nz, nx = grid.padded_shape
        self.heights = np.zeros((ny, nx))
        self.region = np.array([0, ny, 0, nz, 0, nx], dtype=np.int64)
        self._corners = np.zeros((ny + 1, nx + 1))
        self._slopes = np.zeros((ny, nx)), np.zeros((ny, nx))
        self._frame: Array | None = None
        self._warned = False

    def survey(self, frame: Array) -> bool:
        """Take the heights under the grid at `frame` (x, y [m], heading [rad]); False if it stands where it stood.

        Raises
        ------
        ValueError
            If the bed lies below the window's lowest face.
        """
        if self._frame is not None and np.array_equal(frame, self._frame):
            return False
        m, h = self.grid.metrics, HALO
        take_heights(*self._terrain, frame, m, self._corners, self.heights, *self._slopes)
        inner = self._corners[h:-h, h:-h]
        lowest, bottom = float(inner.min()), float(self.grid.z_faces[0])
        if lowest < bottom - 1e-9:
            raise ValueError(
                f"terrain: the bed comes down to z = {lowest:.4g} m in the window, whose lowest face is at "
                f"{bottom:.4g} m; let Grid.z_faces start at or below the lowest bed on the grid's whole way."
            )
        top = min(int(np.searchsorted(m.zf, float(self._corners.max()))) + ABOVE, len(m.zc))
        self._frame, self.region[3] = frame.copy(), top
        return True

    def lay(self, region: NDArray[np.int64], area_fractions: AreaFractions) -> None:
        """Set area_fractions, distance and nearest in an index box to those of the bed alone."""
        lay(
            region, int(self.region[3]), self.number, self._corners, self.heights, *self._slopes, self.grid.metrics,
            area_fractions,
        )  # fmt: skip

    def refill(self, fraction: Array, area_fractions: AreaFractions) -> None:
        """Give cells below the bed the fraction of the water above or beside them."""
        refill(fraction, self.heights, self.region, area_fractions.nearest, self.number, self.grid.metrics)

    def stop(
        self, wet: NDArray[np.uint8], area_fractions: AreaFractions, *velocities: tuple[Array, Array, Array]
    ) -> None:
        """Bring to rest what moves well below the bed, and films on it."""
        for velocity in velocities:
            stop_below(velocity, wet, area_fractions, self.heights, int(self.region[3]), self.number, self.grid.metrics)

    def check_water(self, water: Water, far: Array, zone: NDArray[np.bool_], start: bool) -> None:
        """Refuse at the start what cannot be undisturbed: no water at all, or a current across an uneven bed.

        A uniform current is a flow over a bed only if it runs along the depth contours. Elsewhere the far field asks
        for as much speed in deep water as in shallow, and its level makes up for the difference of the discharges:
        bearable over bumps of a few per cent of the depth, not on a slope.

        Parameters
        ----------
        water : Water
        far : array, shape (3,)
            Current in grid axes [m/s].
        zone : array of bool, shape (ny, nx)
            Columns in the far field.
        start : bool
            False: log a warning, once, instead of raising.
        """
        h = HALO
        if start and self.heights[h:-h, h:-h].min() >= water.depth:
            raise ValueError(
                f"terrain: no bed in the window lies below the still level, Water.depth = {water.depth:g} m above "
                f"z = 0 (the lowest is at {self.heights[h:-h, h:-h].min():.4g} m); raise the level or lower the bed."
            )
        speed = math.hypot(far[0], far[1])
        if speed == 0.0 or not zone.any():
            return
        uphill = np.abs(far[0] * self._slopes[0][zone] + far[1] * self._slopes[1][zone]).max() / speed
        depths = np.maximum(water.depth - self.heights[zone], 0.0)
        uneven = (depths.max() - depths.min()) / max(float(depths.mean()), 1e-9)
        if uphill <= CONTOUR or uneven <= UNEVEN:
            return
        message = (
            f"terrain: the current crosses depths of {depths.min():.3g} to {depths.max():.3g} m at the far sides, and "
            f"a uniform current needs an even bed there (within {100 * UNEVEN:.0f} % of the depth) or one that is "
            "level along it; level the terrain towards the window's sides, turn the current along the contours, or "
            "take still water and move the vehicle."
        )
        if start:
            raise ValueError(message)
        if not self._warned:
            logger.warning("%s", message)
            self._warned = True


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
        Of the points looked at [m].
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
    terrain: np.ndarray, field: Array, frame: Array, metrics: Metrics, corners: Array, centers: Array, slope_x: Array,
    slope_y: Array,
) -> None:  # fmt: skip
    """Heights of the bed [m] at the columns' corners; their means, and slopes along the grid's axes, for the columns.

    Parameters
    ----------
    terrain, field : array
        `Terrain.as_arrays`.
    frame : array, shape (3,)
        Grid origin x, y [m] and yaw [rad] in the world.
    corners : array, shape (ny + 1, nx + 1), changed
        [m]
    centers, slope_x, slope_y : array, shape (ny, nx), changed
        [m], [-]
    """
    ny, nx = centers.shape
    c, s = math.cos(frame[2]), math.sin(frame[2])
    for j in prange(ny + 1):
        y = metrics.yf[j]
        for i in range(nx + 1):
            x = metrics.xf[i]
            corners[j, i], _, _ = terrain_height(terrain[0], field, frame[0] + c * x - s * y, frame[1] + s * x + c * y)
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
        Of the face's centre above the bed [m].
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
    region: NDArray[np.int64], top: int, number: int, corners: Array, centers: Array, slope_x: Array, slope_y: Array,
    metrics: Metrics, area_fractions: AreaFractions,
) -> None:  # fmt: skip
    """Set what the bed leaves open in an index box; from layer `top` on all is open.

    The area_fractions before sharpening (`ax`, `ay`, `az`) belongs to the solids alone and is left as it is.
    """
    j0, j1, k0, k1, i0, i1 = region
    bx, by, bz = (
        area_fractions.bx,
        area_fractions.by,
        area_fractions.bz,
    )  # Numba drops writes through a tuple inside prange
    sx, sy, sz = area_fractions.sx, area_fractions.sy, area_fractions.sz
    distance, nearest = area_fractions.distance, area_fractions.nearest
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
        Of the solids alone.
    area_fractions : AreaFractions, changed
        Of the bed alone; then of both.
    """
    bx, by, bz = (
        area_fractions.bx,
        area_fractions.by,
        area_fractions.bz,
    )  # Numba drops writes through a tuple inside prange
    sx, sy, sz = area_fractions.sx, area_fractions.sy, area_fractions.sz
    distance, nearest = area_fractions.distance, area_fractions.nearest
    for n in range(len(regions)):
        for j in prange(regions[n, 0], regions[n, 1]):
            for k in range(regions[n, 2], regions[n, 3]):
                for i in range(regions[n, 4], regions[n, 5]):
                    if bodies.bx[j, k, i] < bx[j, k, i]:
                        bx[j, k, i], sx[j, k, i] = bodies.bx[j, k, i], bodies.sx[j, k, i]
                    if bodies.by[j, k, i] < by[j, k, i]:
                        by[j, k, i], sy[j, k, i] = bodies.by[j, k, i], bodies.sy[j, k, i]
                    if bodies.bz[j, k, i] < bz[j, k, i]:
                        bz[j, k, i], sz[j, k, i] = bodies.bz[j, k, i], bodies.sz[j, k, i]
                    if bodies.distance[j, k, i] < distance[j, k, i]:
                        distance[j, k, i], nearest[j, k, i] = bodies.distance[j, k, i], bodies.nearest[j, k, i]


@njit(cache=True, error_model="numpy", parallel=True)
def refill(fraction: Array, heights: Array, region: NDArray[np.int64], nearest: NDArray[np.int8], number: int,
           metrics: Metrics) -> None:  # fmt: skip
    """Give cells below the bed the fraction that the water above or beside them has there.

    Full below water; in the ground behind a shore the mean of the open cells beside them, so that the surface seems to
    go on level; elsewhere they keep what they hold.

    Parameters
    ----------
    fraction : array, changed
        [-]
    heights : array, shape (ny, nx)
        Of the bed [m].
    region : array of int, shape (6,)
        Index box of the bed.
    nearest : array
        `AreaFractions.nearest`; cells nearer to a solid are left to `exumob.flow.free_surface.refill_solids`.
    number : int
        Of the bed in it.
    """
    ny, nz, nx = fraction.shape
    for j in prange(HALO, ny - HALO):
        for i in range(HALO, nx - HALO):
            z = heights[j, i]
            first = HALO
            while first < nz - HALO and metrics.zf[first + 1] <= z:
                first += 1
            wet = first < nz - HALO and max(fraction[j, first, i], fraction[j, first + 1, i]) > RESOLVED
            for k in range(HALO, min(first, region[3])):
                if nearest[j, k, i] != number:
                    continue
                if wet:
                    fraction[j, k, i] = 1.0
                    continue
                total, count = 0.0, 0
                for n in range(4):
                    b, a = j + (n == 0) - (n == 1), i + (n == 2) - (n == 3)
                    if metrics.zf[k + 1] > heights[b, a] and HALO <= b < ny - HALO and HALO <= a < nx - HALO:
                        total += fraction[b, k, a]  # of open cells alone, so the order of the writes does not matter
                        count += 1
                if count > 0:
                    fraction[j, k, i] = total / count


@njit(cache=True, error_model="numpy", parallel=True)
def stop_below(
    velocity: tuple[Array, Array, Array], wet: NDArray[np.uint8], area_fractions: AreaFractions, heights: Array, top: int,
    number: int, metrics: Metrics,
) -> None:  # fmt: skip
    """Set the velocity to 0 more than `DEEP` cells below the bed, and of films: on faces it cuts, away from wet cells.

    A film thinner than half a cell that nothing holds would slide down a shore ever faster.
    """
    u, v, w = velocity
    bx, by, bz = area_fractions.bx, area_fractions.by, area_fractions.bz
    ny, nz, nx = u.shape
    for j in prange(HALO, ny - HALO):
        for k in range(HALO, min(top, nz - HALO)):
            z = metrics.zf[k + 1] + DEEP * metrics.dz[k]
            for i in range(HALO, nx - HALO):
                if z < heights[j, i]:
                    u[j, k, i] = v[j, k, i] = w[j, k, i] = 0.0
                elif wet[j, k, i] == 0 and area_fractions.nearest[j, k, i] == number:
                    if bx[j, k, i] < 1.0 and wet[j, k, i - 1] == 0:
                        u[j, k, i] = 0.0
                    if by[j, k, i] < 1.0 and wet[j - 1, k, i] == 0:
                        v[j, k, i] = 0.0
                    if bz[j, k, i] < 1.0 and wet[j, k - 1, i] == 0:
                        w[j, k, i] = 0.0


def close_sides(carrying: tuple[Array, Array, Array], area_fractions: AreaFractions) -> None:
    """Leave of the current that the far sides carry on full faces what passes above the bed."""
    for axis, q, b in ((2, carrying[0], area_fractions.bx), (0, carrying[1], area_fractions.by)):
        for side in (HALO, q.shape[axis] - HALO):
            at = (slice(None),) * axis + (side,)
            q[at] *= b[at]


@njit(cache=True, error_model="numpy", parallel=True)
def shear(
    out: tuple[Array, Array, Array], u: Array, v: Array, fraction: Array, open_faces: tuple[Array, Array],
    heights: Array, top: int, roughness: float, viscosity: float, dt: float, metrics: Metrics,
) -> None:  # fmt: skip
    """Slow the lowest layer down by the log-law shear of a given bed; see `exumob.flow.turbulence.wall.bed_shear`.

    The speed is the horizontal one of the lowest layer whose centre lies at least a quarter of a cell above the bed;
    the shear acts on that layer and on what is open below it. Meant for slopes up to about 1 in 3.

    Parameters
    ----------
    out : three arrays, changed
        Velocity [m/s].
    u, v : array
        Velocity from which the shear is taken, absolute [m/s].
    fraction : array
        [-]
    open_faces : two arrays
        AreaFractions of the x and y faces [-].
    heights : array, shape (ny, nx)
        Of the bed [m].
    top : int
        First layer above all of the bed.
    roughness, viscosity, dt
        As for `bed_shear` [m, m^2/s, s].
    """
    ny, nz, nx = u.shape
    bx, by = open_faces
    for j in prange(HALO, ny - HALO + 1):
        for i in range(HALO, nx - HALO + 1):
            for axis in range(2):
                bed = 0.5 * (heights[j, i] + (heights[j, i - 1] if axis == 0 else heights[j - 1, i]))
                b = bx if axis == 0 else by
                k = HALO
                while k < min(top, nz - HALO - 1) and metrics.zc[k] - bed < 0.25 * metrics.dz[k]:
                    k += 1
                c = 0.5 * (fraction[j, k, i] + (fraction[j, k, i - 1] if axis == 0 else fraction[j - 1, k, i]))
                if b[j, k, i] == 0.0 or c < 0.25:
                    continue
                if axis == 0:
                    here = u[j, k, i]
                    across = 0.25 * ((v[j, k, i] + v[j + 1, k, i - 1]) + (v[j + 1, k, i] + v[j, k, i - 1]))
                else:
                    here = v[j, k, i]
                    across = 0.25 * ((u[j, k, i] + u[j - 1, k, i + 1]) + (u[j, k, i + 1] + u[j - 1, k, i]))
                speed = math.sqrt(here * here + across * across)
                if speed <= 1e-9:
                    continue
                depth = metrics.zf[k] - bed + metrics.dz[k] * min(max(c, 0.5), 1.0)
                rate = friction_velocity(speed, metrics.zc[k] - bed, viscosity, roughness) ** 2 / (speed * depth)
                for layer in range(HALO, k + 1):
                    if b[j, layer, i] > 0.0:
                        if axis == 0:
                            out[0][j, layer, i] /= 1.0 + dt * rate
                        else:
                            out[1][j, layer, i] /= 1.0 + dt * rate
