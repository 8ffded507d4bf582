"""Area fractions: the share of every cell face that the solids leave open, and the distance to the nearest solid.

Faces are partly open (FAVOR: Hirt & Sicilian 1985; Batty, Bertails & Bridson, ACM Trans. Graph. 26 (2007) 100): the
area fraction of a face is a smooth ramp of the signed distance (`exumob.flow.solids.measure`) about it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import prange
from numpy.typing import NDArray

from exumob.flow.grid import Metrics
from exumob.flow.poses import PlacedSolids, body_velocity
from exumob.flow.solids import Shape, measure
from exumob.support.arrays import Array
from exumob.support.kernels import njit

SHARP = 0.5
"""Change of the distance's slopes over a cell (sum over the axes) from which its edge counts as sharp, fully at twice
that [-]; on a sphere it is 2 cells over the radius."""
EDGE = 0.4
"""Share of a cell with a sharp edge that is closed where the edge passes through its centre; 0.1 more for each tenth of
a cell by which the centre is further inside, 0.1 less outside [-]. Fitted to one case, the drag of a square column that
fills a fifth of a channel, six cells a side, so that it depends little on where the column lies in the cells."""
NARROWEST = 1e-6
"""Smallest area fraction that counts as open [-]: less is round-off (the ramps are kept in single precision)."""
FAR = 1.0e3
"""Signed distance stored where no solid is near [m]."""


class AreaFractions(NamedTuple):
    """Open share of the faces and velocity of the solid there; for each cell, the nearest solid and its distance."""

    bx: Array
    by: Array
    bz: Array
    """Area fractions of the low x, y, z faces, 0 closed to 1 open to the flow [-]"""
    ax: Array
    ay: Array
    az: Array
    """The same before edges are sharpened: unbiased, so that the weight of still water acts on these [-]"""
    sx: Array
    sy: Array
    sz: Array
    """Solid velocity on them, normal component, grid axes [m/s]; spin not included"""
    distance: Array
    """Signed distance of the cell's centre to the nearest solid [m]"""
    nearest: NDArray[np.int8]
    """Its number, -1 if none is near"""

    @classmethod
    def open(cls, shape: tuple[int, int, int]) -> AreaFractions:
        """No solids."""
        bx, by, bz, ax, ay, az = (np.ones(shape) for _ in range(6))
        sx, sy, sz = (np.zeros(shape) for _ in range(3))
        nearest = np.full(shape, -1, dtype=np.int8)
        return cls(bx, by, bz, ax, ay, az, sx, sy, sz, np.full(shape, FAR), nearest)

    @property
    def faces(self) -> tuple[Array, Array, Array]:
        """Area fractions of the low x, y and z faces [-]."""
        return self.bx, self.by, self.bz


def clear(area_fractions: AreaFractions, region: NDArray[np.int64]) -> None:
    """Remove all solids from an index box (`PlacedSolids.regions`)."""
    j0, j1, k0, k1, i0, i1 = region
    for name, value in zip(AreaFractions._fields, (*6 * (1.0,), 0.0, 0.0, 0.0, FAR, -1), strict=True):
        getattr(area_fractions, name)[j0:j1, k0:k1, i0:i1] = value


@njit(cache=True, error_model="numpy", inline="always")
def distance_gradient(d: Array, j: int, k: int, i: int, metrics: Metrics) -> tuple[float, float, float]:
    """Gradient of the distance `d` at the centre of a cell [-]: it points away from the nearest solid."""
    gx = (d[j, k, i + 1] - d[j, k, i - 1]) / (metrics.ex[i + 1] + metrics.ex[i])
    gy = (d[j + 1, k, i] - d[j - 1, k, i]) / (metrics.ey[j + 1] + metrics.ey[j])
    gz = (d[j, k + 1, i] - d[j, k - 1, i]) / (metrics.ez[k + 1] + metrics.ez[k])
    return gx, gy, gz


@njit(cache=True, error_model="numpy", inline="always")
def _distance_in_widths(
    shape: Shape, r: Array, point: tuple[float, float, float], widths: tuple[float, float, float]
) -> tuple[float, float]:
    """Signed distance of a point in metres and in widths of the cell along the normal.

    Parameters
    ----------
    shape : Shape
    r : array, shape (3, 3)
        Body -> grid.
    point : three floats
        Vector from the solid's origin, grid axes [m].
    widths : three floats
        Widths of the cell [m].
    """
    x, y, z = point
    d, nx, ny, nz = measure(
        shape, r[0, 0] * x + r[1, 0] * y + r[2, 0] * z, r[0, 1] * x + r[1, 1] * y + r[2, 1] * z,
        r[0, 2] * x + r[1, 2] * y + r[2, 2] * z,
    )  # fmt: skip
    gx = abs(r[0, 0] * nx + r[0, 1] * ny + r[0, 2] * nz)
    gy = abs(r[1, 0] * nx + r[1, 1] * ny + r[1, 2] * nz)
    gz = abs(r[2, 0] * nx + r[2, 1] * ny + r[2, 2] * nz)
    return d, d / (gx * widths[0] + gy * widths[1] + gz * widths[2])


@njit(cache=True, error_model="numpy")
def ramp(s: float) -> float:
    """Area fraction for a signed distance over its range: 0 below -1, 1 above 1, smooth between.

    The mean of two such ramps, each half a cell wide either way and a quarter of a cell off centre, sums over
    equidistant faces to a value that does not depend on where between them the wall is.
    """
    if s <= -1.0:
        return 0.0
    if s >= 1.0:
        return 1.0
    return 0.5 * (1.0 + s) ** 2 if s < 0.0 else 1.0 - 0.5 * (1.0 - s) ** 2


@njit(cache=True, error_model="numpy", parallel=True)
def place_solid(
    n: int, shape: Shape, solids: PlacedSolids, metrics: Metrics, area_fractions: AreaFractions, sharpness: float
) -> None:
    """Close what solid n closes.

    The area fraction of a face is the mean over the eight octants of cells that touch it (their centres lie a quarter
    of a cell off the face's): the ramp is then about 1.5 half cells wide either way, and edges of the solid keep their
    volume. Cells at a sharp edge are then closed further (`EDGE`, times `sharpness`): half open on two sides, they
    would let the flow cut the corner, and it would separate too late.
    """
    j0, j1, k0, k1, i0, i1 = solids.regions[n]
    halves = np.ones((j1 - j0, k1 - k0, i1 - i0, 7), dtype=np.float32)
    for j in prange(j0, j1):
        _measure_row(j, n, shape, solids, metrics, area_fractions)
    for j in prange(j0, j1):
        _octants_row(j, n, shape, solids, metrics, area_fractions, halves[j - j0], sharpness)
    for j in prange(j0, j1):
        _close_row(j, n, solids, metrics, area_fractions, halves)


@njit(cache=True, error_model="numpy")
def _measure_row(
    j: int, n: int, shape: Shape, solids: PlacedSolids, metrics: Metrics, area_fractions: AreaFractions
) -> None:
    """Row j of `place_solid`: distances of the cells' centres."""
    _, _, k0, k1, i0, i1 = solids.regions[n]
    r, position = solids.rotation[n], solids.position[n]
    y = metrics.yc[j] - position[1]
    for k in range(k0, k1):
        z = metrics.zc[k] - position[2]
        for i in range(i0, i1):
            x = metrics.xc[i] - position[0]
            d, _, _, _ = measure(
                shape, r[0, 0] * x + r[1, 0] * y + r[2, 0] * z, r[0, 1] * x + r[1, 1] * y + r[2, 1] * z,
                r[0, 2] * x + r[1, 2] * y + r[2, 2] * z,
            )  # fmt: skip
            if d < area_fractions.distance[j, k, i]:
                area_fractions.distance[j, k, i] = d
                area_fractions.nearest[j, k, i] = n


@njit(cache=True, error_model="numpy")
def _octants_row(
    j: int, n: int, shape: Shape, solids: PlacedSolids, metrics: Metrics, area_fractions: AreaFractions,
    halves: NDArray[np.float32], sharpness: float,
) -> None:  # fmt: skip
    """Row j of `place_solid`: mean ramps of the cells' low and high halves along x, y, z, and what edges leave open.

    Where the distance is linear from each neighbour to the opposite one, the wall is flat throughout the cell and the
    octants follow from the slopes.
    """
    _, _, k0, k1, i0, i1 = solids.regions[n]
    d, nearest = area_fractions.distance, area_fractions.nearest
    rotation = solids.rotation[n]
    ox, oy, oz = solids.position[n]
    ny, nz, nx = d.shape
    dy = metrics.dy[j]
    for k in range(k0, k1):
        dz = metrics.dz[k]
        for i in range(i0, i1):
            dx = metrics.dx[i]
            reach = 0.9 * (dx + dy + dz)
            here = d[j, k, i]
            if here > reach:
                continue
            half = halves[k - k0, i - i0]
            if nearest[j, k, i] == n and here < -reach:
                half[:6] = 0.0
                continue
            kink, gx, gy, gz = FAR, 0.0, 0.0, 0.0
            if nearest[j, k, i] == n and 0 < i < nx - 1 and 0 < j < ny - 1 and 0 < k < nz - 1:
                gx, gx_low = (d[j, k, i + 1] - here) / metrics.ex[i + 1], (here - d[j, k, i - 1]) / metrics.ex[i]
                gy, gy_low = (d[j + 1, k, i] - here) / metrics.ey[j + 1], (here - d[j - 1, k, i]) / metrics.ey[j]
                gz, gz_low = (d[j, k + 1, i] - here) / metrics.ez[k + 1], (here - d[j, k - 1, i]) / metrics.ez[k]
                kink = abs(gx - gx_low) + abs(gy - gy_low) + abs(gz - gz_low)
            flat = kink < 1e-6
            x, y, z = metrics.xc[i] - ox, metrics.yc[j] - oy, metrics.zc[k] - oz
            if flat:
                scale = 1.0 / (abs(gx) * dx + abs(gy) * dy + abs(gz) * dz)
                widths = here * scale
            else:
                scale = 0.0
                _, widths = _distance_in_widths(shape, rotation, (x, y, z), (dx, dy, dz))
            if widths > 0.9:  # a quarter of a cell to the octant, half for the ramp, and something for curvature
                continue
            half[:6] = 0.0
            sharp = sharpness * min(max((kink - SHARP) / SHARP, 0.0), 1.0) if kink < FAR else 0.0
            half[6] = 1.0 - sharp * min(max(EDGE - widths, 0.0), 1.0)
            if widths < -0.9:
                continue
            for octant in range(8):
                a, b, c = octant & 1, (octant >> 1) & 1, octant >> 2
                px, py, pz = (0.5 * a - 0.25) * dx, (0.5 * b - 0.25) * dy, (0.5 * c - 0.25) * dz
                if flat:
                    part = (here + gx * px + gy * py + gz * pz) * scale
                else:
                    _, part = _distance_in_widths(shape, rotation, (x + px, y + py, z + pz), (dx, dy, dz))
                value = np.float32(0.25 * ramp(2.0 * part))
                half[a] += value
                half[2 + b] += value
                half[4 + c] += value


@njit(cache=True, error_model="numpy", inline="always")
def _close_face(
    unsharpened: Array, sharpened: Array, cell: tuple[int, int, int], before: NDArray[np.float32],
    here: NDArray[np.float32], axis: int,
) -> bool:  # fmt: skip
    """Close the low face of a cell along an axis (0 x, 1 y, 2 z) by the ramps on both of its sides; True if it did.

    `before`, `here`: ramps of the cell before the face and of the cell itself, as `_octants_row` leaves them: mean
    over the low and the high half along x, y, z, and last what an edge leaves open.
    """
    share = 0.5 * (np.float64(before[2 * axis + 1]) + here[2 * axis])
    share = share if share > NARROWEST else 0.0
    unsharpened[cell] = min(share, unsharpened[cell])
    share *= min(before[6], here[6])
    share = share if share > NARROWEST else 0.0
    if share < sharpened[cell]:
        sharpened[cell] = share
        return True
    return False


@njit(cache=True, error_model="numpy")
def _close_row(
    j: int, n: int, solids: PlacedSolids, metrics: Metrics, area_fractions: AreaFractions, halves: NDArray[np.float32]
) -> None:
    """Row j of `place_solid`: area fractions of the low faces and the solid's velocity on them."""
    j0, _, k0, k1, i0, i1 = solids.regions[n]
    b, position, o = j - j0, solids.position[n], area_fractions
    beyond = np.ones(7, dtype=np.float32)  # all is open outside the region
    for k in range(k0, k1):
        for i in range(i0, i1):
            cell, here = (j, k, i), halves[b, k - k0, i - i0]
            x = _close_face(o.ax, o.bx, cell, halves[b, k - k0, i - i0 - 1] if i > i0 else beyond, here, 0)
            y = _close_face(o.ay, o.by, cell, halves[b - 1, k - k0, i - i0] if b > 0 else beyond, here, 1)
            z = _close_face(o.az, o.bz, cell, halves[b, k - k0 - 1, i - i0] if k > k0 else beyond, here, 2)
            if not (x or y or z):
                continue
            ux, uy, uz = body_velocity(  # a component does not depend on the place along its own axis
                solids, n, metrics.xc[i] - position[0], metrics.yc[j] - position[1], metrics.zc[k] - position[2]
            )
            if x:
                o.sx[cell] = ux
            if y:
                o.sy[cell] = uy
            if z:
                o.sz[cell] = uz
