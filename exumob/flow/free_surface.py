"""Free surface: fraction of water per cell, its transport, and where the surface cuts the line between two cells.

Conservative volume of fluid by directional sweeps (Weymouth & Yue, J. Comput. Phys. 229 (2010) 2853), with THINC fluxes
weighted by the surface's orientation (Xiao et al. 2005; Yokoi, J. Comput. Phys. 226 (2007) 1985) or, as a cross-check,
with those of a plane in each cell (PLIC; Scardovelli & Zaleski, J. Comput. Phys. 164 (2000) 228). The fraction lives on
full cells, inside solids too: `exumob.flow.surface_at_solids`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numba import prange
from numpy.typing import NDArray

from exumob.flow.active_rows import ActiveRows
from exumob.flow.grid import HALO, Metrics
from exumob.support.arrays import Array
from exumob.support.kernels import njit

Single = NDArray[np.float32]
SHARPNESS = 3.5
"""Slope of the THINC profile [-] (Yokoi 2007): about 1.5 cells between 5 % and 95 %."""
EMPTY = 1.0e-9
"""Fractions nearer to 0 or 1 than this count as air or water [-]."""
UNKNOWN = np.float32(2.0)
"""Orientation of a cell that the surface did not pass when the step began."""
EXP_ONE, EXP_TWO = math.exp(SHARPNESS), math.exp(2.0 * SHARPNESS)
STACK = 3
"""Cells searched on either side for the height of the surface."""


@njit(cache=True, error_model="numpy", inline="always")
def _plane(c: Array, p: int, a: int, b: int) -> float:
    """Sum over the 3 x 3 cells about p along the strides a and b, weighted 4, 2, 1."""
    sides = (c[p - a] + c[p + a]) + (c[p - b] + c[p + b])
    corners = (c[p - a - b] + c[p + a + b]) + (c[p - a + b] + c[p + a - b])
    return 4.0 * c[p] + 2.0 * sides + corners


@njit(cache=True, error_model="numpy")
def gradient(c: Array, cell: int, sy: int, sz: int) -> tuple[float, float, float]:
    """Gradient of the fraction over the 27 cells about a cell (Youngs), in fractions per cell."""
    p, x, y, z = np.uintp(cell), np.uintp(1), np.uintp(sy), np.uintp(sz)
    gx = _plane(c, p + x, y, z) - _plane(c, p - x, y, z)
    gy = _plane(c, p + y, x, z) - _plane(c, p - y, x, z)
    gz = _plane(c, p + z, x, y) - _plane(c, p - z, x, y)
    return gx / 32.0, gy / 32.0, gz / 32.0


@njit(cache=True, error_model="numpy")
def stack_distance(c: Array, p: int, stride: int, up: int, widths: Array, m: int, floor: int) -> float:
    """Distance from a cell's centre to the surface along an axis [m], > 0 in water (height function).

    Parameters
    ----------
    c : array
        Fractions, flat.
    p, stride : int
        The cell, and the step along the axis.
    up : int
        +1 if the air is at larger coordinates, else -1.
    widths, m
        Cell widths along the axis [m], and the cell's index there.
    floor : int
        First index of the axis that can hold water (the bed; 0 for x and y).
    """
    distance = (c[p] - 0.5) * widths[m]
    before = c[p]
    for n in range(1, STACK + 1):
        index = m + up * n
        if index < 0 or index >= len(widths):
            break
        value = c[p + up * n * stride]
        if value <= EMPTY or value > before + 1e-6:
            break
        distance += value * widths[index]
        before = value
    before = c[p]
    for n in range(1, STACK + 1):
        index = m - up * n
        if index < floor or index >= len(widths):
            break
        value = c[p - up * n * stride]
        if value >= 1.0 - EMPTY or value < before - 1e-6:
            break
        distance -= (1.0 - value) * widths[index]
        before = value
    return distance


@njit(cache=True, error_model="numpy", inline="always")
def thinc_flux(c: float, rising: float, courant: float) -> float:
    """Water leaving a cell through one face, as a fraction of the cell.

    Parameters
    ----------
    c : float
        Fraction of the cell.
    rising : float
        +1 if the fraction rises towards larger coordinates, -1 if it falls.
    courant : float
        Signed share of the cell that leaves, > 0 through the high face.
    """
    size = abs(courant)
    ends = math.exp(SHARPNESS * rising * (2.0 * c - 1.0))
    e = (EXP_ONE - ends) / (ends - 1.0 / EXP_ONE)  # exp(2 b * position of the jump)
    grown = math.exp(2.0 * SHARPNESS * size)
    if e > 1e30:  # the jump lies far beyond the high face
        logarithm = 0.0
    elif courant > 0.0:
        logarithm = math.log((EXP_TWO + e) / (EXP_TWO / grown + e))
    else:
        logarithm = math.log((grown + e) / (1.0 + e))
    mean = 0.5 * size + rising / (2.0 * SHARPNESS) * (logarithm - SHARPNESS * size)
    return math.copysign(min(max(mean, 0.0), min(size, c)), courant)


@njit(cache=True, error_model="numpy")
def volume_below(a: float, b: float, c: float, offset: float) -> float:
    """Share of the unit cube where a x + b y + c z < offset; a <= b <= c, all >= 0, their sum 1."""
    d = min(offset, 1.0 - offset)
    if d <= 0.0:
        part = 0.0
    elif d < a:
        part = d**3 / (6.0 * a * b * c)
    elif d < b:
        part = d * (d - a) / (2.0 * b * c) + a * a / (6.0 * b * c)
    elif d >= a + b:
        part = (2.0 * d - a - b) / (2.0 * c)
    else:
        part = d * d * (3.0 * (a + b) - d) + a * a * (a - 3.0 * d) + b * b * (b - 3.0 * d)
        if d >= c:
            part -= (d - c) ** 3
        part /= 6.0 * a * b * c
    return part if offset <= 0.5 else 1.0 - part


@njit(cache=True, error_model="numpy")
def plane_offset(a: float, b: float, c: float, share: float) -> float:
    """Offset at which `volume_below` is `share`, to 1e-12; by regula falsi (Illinois), which starts near the end."""
    target = min(share, 1.0 - share)
    if target <= 0.0:
        return 0.0 if share < 0.5 else 1.0
    low, high, below, above = 0.0, 0.5, -target, 0.5 - target
    middle = 0.5
    for _ in range(60):
        if above <= 1e-13:
            middle = high
            break
        middle = (low * above - high * below) / (above - below)
        value = volume_below(a, b, c, middle) - target
        if abs(value) < 1e-12:
            break
        if value < 0.0:
            low, below = middle, value
            above *= 0.5
        else:
            high, above = middle, value
            below *= 0.5
    return middle if share <= 0.5 else 1.0 - middle


@njit(cache=True, error_model="numpy")
def _ordered(a: float, b: float, c: float) -> tuple[float, float, float]:
    if a > b:
        a, b = b, a
    if b > c:
        b, c = c, b
    if a > b:
        a, b = b, a
    return a, b, c


@njit(cache=True, error_model="numpy")
def plic_flux(c: float, along: float, other: float, third: float, courant: float) -> float:
    """Water leaving a cell through one face, as a fraction of the cell, below the plane that fits its fraction.

    Parameters
    ----------
    c : float
        Fraction of the cell.
    along, other, third : float
        Gradient of the fraction along the face's normal and across it, in any order; absolute values sum to 1.
    courant : float
        Signed share of the cell that leaves, > 0 through the high face.
    """
    size = abs(courant)
    if size == 0.0:
        return 0.0
    m1, m2, m3 = _ordered(abs(along), abs(other), abs(third))
    offset = plane_offset(m1, m2, m3, c)
    # water lies at low coordinates once every axis points away from it; the slab that leaves is there first or last
    first = (courant > 0.0) == (along > 0.0)
    m = abs(along)
    offset -= 0.0 if first else m * (1.0 - size)
    m1, m2, m3 = _ordered(m * size, abs(other), abs(third))
    total = m1 + m2 + m3
    if total <= 1e-12:
        part = 1.0 if offset > 0.0 else 0.0
    else:
        part = volume_below(m1 / total, m2 / total, m3 / total, min(max(offset / total, 0.0), 1.0))
    return math.copysign(min(part * size, c), courant)


@njit(cache=True, error_model="numpy")
def _orientation(c: Array, p: int, sy: int, sz: int) -> tuple[float, float, float]:
    """Gradient of the fraction over the sum of its absolute components; 0 if there is none."""
    gx, gy, gz = gradient(c, p, sy, sz)
    total = abs(gx) + abs(gy) + abs(gz)
    if total <= 1e-12:
        return 0.0, 0.0, 0.0
    return gx / total, gy / total, gz / total


class Sweeps(NamedTuple):
    """Input and work space of the three sweeps of one step."""

    begin: Array
    """Fraction at the begin of the step [-]"""
    relative: tuple[Array, Array, Array]
    """Velocity relative to the grid on full faces [m/s]"""
    dt: float
    """[s]"""
    planes: bool
    """The surface in a cell is a plane; the THINC profile otherwise"""
    cells: ActiveRows
    """Cells that may change"""
    faces: ActiveRows
    """Cells whose low faces water may pass"""
    orientation: tuple[Single, Single, Single]
    """Work space: normal of the surface at the begin of the step, from `orient`"""
    flux: Array
    """Work space: volume of water through each low face, per face area [m]"""


@njit(cache=True, error_model="numpy", parallel=True)
def orient(fraction: Array, sweeps: Sweeps) -> None:
    """Orientation of the surface in every cell it passes; `UNKNOWN` in others."""
    ny, nz, nx = fraction.shape
    c = fraction.ravel()
    ox, oy, oz = sweeps.orientation[0].ravel(), sweeps.orientation[1].ravel(), sweeps.orientation[2].ravel()
    lo, hi = sweeps.cells
    for j in prange(HALO, ny - HALO):
        for k in range(HALO, nz - HALO):
            start = (j * nz + k) * nx
            for i in range(start + max(lo[j, k], HALO), start + min(hi[j, k], nx - HALO)):
                p = np.uintp(i)
                ox[p] = UNKNOWN
                if EMPTY < c[p] < 1.0 - EMPTY:
                    ox[p], oy[p], oz[p] = _orientation(c, i, nz * nx, nx)


@njit(cache=True, error_model="numpy", parallel=True)
def sweep_fluxes(fraction: Array, sweeps: Sweeps, axis: int, metrics: Metrics) -> None:
    """Volume of water through each low face along one axis (0 x, 1 y, 2 z): dt times velocity times what passes."""
    ny, nz, nx = fraction.shape
    sy, sz = nz * nx, nx
    stride = 1 if axis == 0 else (sy if axis == 1 else sz)
    back = np.uintp(stride)
    widths = metrics.dx if axis == 0 else (metrics.dy if axis == 1 else metrics.dz)
    c, u, f = fraction.ravel(), sweeps.relative[axis].ravel(), sweeps.flux.ravel()
    orientation, dt, planes = sweeps.orientation, sweeps.dt, sweeps.planes
    along, known = orientation[axis].ravel(), orientation[0].ravel()
    other, third = orientation[(axis + 1) % 3].ravel(), orientation[(axis + 2) % 3].ravel()
    lo, hi = sweeps.faces
    for j in prange(HALO, ny - HALO + 1):
        for k in range(HALO, nz - HALO + 1):
            start = (j * nz + k) * nx
            first, last = max(lo[j, k], HALO), min(hi[j, k], nx - HALO + 1)
            cut = 0
            for i in range(start + first, start + last):  # full and empty donors
                p = np.uintp(i)
                value = c[p - back] if u[p] > 0.0 else c[p]
                f[p] = dt * u[p] * (value if value > EMPTY else 0.0)
                cut += 1 if EMPTY < value < 1.0 - EMPTY else 0
            if cut == 0:
                continue
            for i in range(first, last):
                p = np.uintp(start + i)
                donor = p - back if u[p] > 0.0 else p
                value = c[donor]
                if value <= EMPTY or value >= 1.0 - EMPTY:
                    continue
                slope, n2, n3 = np.float64(along[donor]), np.float64(other[donor]), np.float64(third[donor])
                if known[donor] == UNKNOWN:
                    turned = _orientation(c, np.intp(donor), sy, sz)
                    slope, n2, n3 = turned[axis], turned[(axis + 1) % 3], turned[(axis + 2) % 3]
                m = i if axis == 0 else (j if axis == 1 else k)
                width = widths[m - 1] if u[p] > 0.0 else widths[m]
                if planes:
                    if abs(slope) + abs(n2) + abs(n3) > 0.0:
                        f[p] = width * plic_flux(value, slope, n2, n3, dt * u[p] / width)
                    continue
                if slope == 0.0:
                    continue
                passed = width * thinc_flux(value, math.copysign(1.0, slope), dt * u[p] / width)
                f[p] = abs(slope) * passed + (1.0 - abs(slope)) * f[p]


@njit(cache=True, error_model="numpy", parallel=True)
def sweep_update(fraction: Array, sweeps: Sweeps, axis: int, metrics: Metrics) -> None:
    """Take the fluxes of one sweep; cells that began more than half full also take the sweep's own dilatation."""
    ny, nz, nx = fraction.shape
    on = np.uintp(1 if axis == 0 else (nz * nx if axis == 1 else nx))
    c, b, u, f = fraction.ravel(), sweeps.begin.ravel(), sweeps.relative[axis].ravel(), sweeps.flux.ravel()
    dt = sweeps.dt
    lo, hi = sweeps.cells
    for j in prange(HALO, ny - HALO):
        share = 1.0 / metrics.dx
        if axis == 1:
            share[:] = 1.0 / metrics.dy[j]
        for k in range(HALO, nz - HALO):
            if axis == 2:
                share[:] = 1.0 / metrics.dz[k]
            start = (j * nz + k) * nx
            for i in range(max(lo[j, k], HALO), min(hi[j, k], nx - HALO)):
                p = np.uintp(start + i)
                change = f[p] - f[p + on]
                change += dt * (u[p + on] - u[p]) if b[p] >= 0.5 else 0.0
                c[p] += change * share[np.uintp(i)]


@njit(cache=True, error_model="numpy", parallel=True)
def remove_dilatation(fraction: Array, sweeps: Sweeps, metrics: Metrics) -> None:
    """Take back the sum of the sweeps' dilatations, which is 0 where the flow has no divergence: volume is exact."""
    ny, nz, nx = fraction.shape
    one, sy, sz = np.uintp(1), np.uintp(nz * nx), np.uintp(nx)
    c, b, dt = fraction.ravel(), sweeps.begin.ravel(), sweeps.dt
    fx, fy, fz = sweeps.relative[0].ravel(), sweeps.relative[1].ravel(), sweeps.relative[2].ravel()
    share = 1.0 / metrics.dx
    lo, hi = sweeps.cells
    for j in prange(HALO, ny - HALO):
        share_y = 1.0 / metrics.dy[j]
        for k in range(HALO, nz - HALO):
            share_z = 1.0 / metrics.dz[k]
            start = (j * nz + k) * nx
            for i in range(max(lo[j, k], HALO), min(hi[j, k], nx - HALO)):
                p = np.uintp(start + i)
                rate = (fx[p + one] - fx[p]) * share[np.uintp(i)]
                rate += (fy[p + sy] - fy[p]) * share_y + (fz[p + sz] - fz[p]) * share_z
                value = c[p] - (dt * rate if b[p] >= 0.5 else 0.0)
                c[p] = 0.0 if -1e-12 < value < 0.0 else value


def transport(
    fraction: Array, sweeps: Sweeps, order: tuple[int, int, int], metrics: Metrics, fill: Callable[[Array], None]
) -> None:
    """Carry the fraction over one step.

    Parameters
    ----------
    fraction : array, changed
        [-]; on entry equal to `Sweeps.begin`.
    sweeps : Sweeps
    order : three ints
        Axes of the sweeps in turn (changed from step to step).
    metrics : Metrics
    fill : callable
        ``fill(fraction)`` sets the halo after each sweep.
    """
    orient(fraction, sweeps)
    for axis in order:
        sweep_fluxes(fraction, sweeps, axis, metrics)
        sweep_update(fraction, sweeps, axis, metrics)
        fill(fraction)
    remove_dilatation(fraction, sweeps, metrics)
    fill(fraction)
