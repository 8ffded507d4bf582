"""Equation of the pressure that frees the flow of divergence, and the projection of the velocity with its solution.

Unknown: dt times the piezometric pressure over density, phi = dt (p / rho + g (z - level)) [m^2/s], at wet cells. The
surface enters by the ghost-fluid method (second order: Gibou et al., J. Comput. Phys. 176 (2002) 205), the area
fractions of faces as in `exumob.flow.area_fractions`. `exumob.flow.pressure.conjugate_gradients` solves it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import prange
from numpy.typing import NDArray

from exumob.flow.active_rows import ActiveRows, WaterCells, WetCells
from exumob.flow.area_fractions import AreaFractions
from exumob.flow.free_surface import gradient, stack_distance
from exumob.flow.grid import HALO, Metrics
from exumob.flow.pressure.conjugate_gradients import Outcome, solve
from exumob.flow.pressure.levels import Level, Levels, U, clear_row
from exumob.support.arrays import Array
from exumob.support.constants import GRAVITY
from exumob.support.kernels import njit

__all__ = ["FULL", "Conditions", "Levels", "Outcome", "assemble", "project", "solve"]

FULL = 0.999
"""Fraction from which a cell without surface is no void [-]."""
EMPTYING = 0.3
"""Share of what is too much in a cell that leaves it in one step [-], ..."""
EMPTYING_RATE = 10.0
"""... at most at this rate times sqrt(g / height of the cell): else the shorter the step the faster the flow."""


class Conditions(NamedTuple):
    """Conditions on the pressure at the surface, in voids and at the window's sides."""

    dt: float
    """[s]"""
    level: float
    """Height at which the piezometric pressure of air is 0: still water [m]"""
    closest: float
    """Least distance of the surface from a cell's centre over the distance between centres [-]"""
    stiffness: float
    """Compliance of enclosed voids, div u = -stiffness (1 - fraction)^2 p / rho [s/m^2]"""
    given_bed: bool
    """A bed closes part of the window's sides; solids stay away from them"""


class Equation(NamedTuple):
    """The equation that `assemble` fills; see there."""

    couplings: Level
    rhs: Array
    theta: tuple[Array, Array, Array]


class _Flat(NamedTuple):
    """Flat views of the fields that `_add_surface` reads and writes."""

    fraction: Array
    wet: NDArray[np.uint8]
    open_faces: tuple[Array, Array, Array]
    theta: tuple[Array, Array, Array]
    rhs: Array


class _FaceRow(NamedTuple):
    """The faces of one row across one axis, from which the gradient of the pressure is subtracted; flat views."""

    velocity: Array
    phi: Array
    wet: NDArray[np.uint8]
    open_faces: Array
    theta: Array
    spacing: Array
    """Between the cells' centres [m], one per face"""
    first: np.uintp
    step: np.uintp
    """Place of the first face, and from a cell to the one before it"""


@njit(cache=True, error_model="numpy")
def _add_passing(
    source: Array, faces: tuple[Array, Array, Array], first: np.uintp, step: np.uintp, count: int, area: float,
    outer: tuple[bool, bool],
) -> None:  # fmt: skip
    """Add `area` times what passes the low faces of a row's cells less what passes their high faces.

    `faces`: velocity of the water, area fraction and velocity of the solid. `outer`: whether the low and the high
    faces are the window's sides, where the velocity is given and nothing closes the face.
    """
    q, beta, solid = faces
    closed_low, closed_high = 0.0 if outer[0] else 1.0, 0.0 if outer[1] else 1.0
    for n in range(count):
        m = U(n)
        p = first + m
        r = p + step
        low = q[p] + closed_low * (1.0 - beta[p]) * (solid[p] - q[p])
        high = q[r] + closed_high * (1.0 - beta[r]) * (solid[r] - q[r])
        source[m] += area * (low - high)


@njit(cache=True, error_model="numpy")
def _couple(
    out: Array, beta: Array, wet: NDArray[np.uint8], first: np.uintp, step: np.uintp, count: int, scale: float
) -> None:
    """Area fractions of a row's low faces between wet cells, times `scale`."""
    for n in range(count):
        p = first + U(n)
        value = scale * beta[p]
        out[U(n)] = value if wet[p] & wet[p - step] else 0.0


@njit(cache=True, error_model="numpy")
def _split(row: Array, lo: int, out: NDArray[np.float32], level: Level, r: int) -> None:
    """Store a row that begins at cell `lo` as its even and its odd cells."""
    shift = 2 * level.lo[r] - lo + 1
    for s in range(2):
        first = U((2 * r + s) * level.half + level.lo[r])
        for n in range(level.hi[r] - level.lo[r]):
            out[first + U(n)] = row[U(2 * n + s + shift)]


@njit(cache=True, error_model="numpy", inline="always")
def _distance(
    c: Array, p: int, axis: int, up: int, at: int, strides: tuple[int, int], widths: tuple[Array, Array, Array]
) -> float:
    """Distance from a cell's centre to the surface along an axis [m].

    `at`: the cell's index there; `strides`: from a cell to the next along y and along z.
    """
    if axis == 2:
        return stack_distance(c, p, strides[1], up, widths[2], at, HALO)
    if axis == 0:
        return stack_distance(c, p, 1, up, widths[0], at, 0)
    return stack_distance(c, p, strides[0], up, widths[1], at, 0)


@njit(cache=True, error_model="numpy", inline="always")
def _add_surface(
    row: tuple[int, int], cells: NDArray[np.int64], shape: tuple[int, int, int], flat: _Flat, conditions: Conditions,
    metrics: Metrics, begin: int, extra: Array,
) -> None:  # fmt: skip
    """Add what surface and voids give to the diagonal [m] and to the right-hand side [m^3/s] of some cells of a row.

    The surface lies where the distances to it of the wet and of the dry cell say so, both along the axis nearest to
    its normal at the wet one.

    Parameters
    ----------
    row : two ints
        The row, j and k.
    cells : array of int
        The cells i.
    shape : three ints
        Shape of the fields.
    flat : _Flat
        `theta` and `rhs` are changed.
    conditions, metrics
    begin : int
        Cell that `extra` begins with.
    extra : array, changed
        The diagonal's share of the row [m].
    """
    (j, k), (ny, nz, nx) = row, shape
    sy, sz = nz * nx, nx
    c, wet, rhs = flat.fraction, flat.wet, flat.rhs
    bx, by, bz = flat.open_faces
    tx, ty, tz = flat.theta
    dt, level, closest, stiffness, _ = conditions
    dx, dy, dz, heights = metrics.dx, metrics.dy, metrics.dz, metrics.zc
    widths = dx, dy, dz
    ex, ey, ez = metrics.ex, metrics.ey, metrics.ez
    for n in range(len(cells)):
        i = cells[n]
        p = (j * nz + k) * nx + i
        gx, gy, gz = gradient(c, p, sy, sz)
        steepest = 2 if abs(gz) >= abs(gx) and abs(gz) >= abs(gy) else (0 if abs(gx) >= abs(gy) else 1)
        up = -1 if (gz if steepest == 2 else (gx if steepest == 0 else gy)) > 0.0 else 1
        place = k if steepest == 2 else (i if steepest == 0 else j)
        here = _distance(c, p, steepest, up, place, (sy, sz), widths)
        diagonal, surface, openings = 0.0, 0.0, 0.0
        enclosed = True
        for axis in range(3):
            stride = 1 if axis == 0 else (sy if axis == 1 else sz)
            at = i if axis == 0 else (j if axis == 1 else k)
            end = nx if axis == 0 else (ny if axis == 1 else nz)
            for side in range(2):
                f, q, m = p + side * stride, p + (2 * side - 1) * stride, at + 2 * side - 1
                beta = bx[f] if axis == 0 else (by[f] if axis == 1 else bz[f])
                openings += beta
                if beta == 0.0 or wet[q] == 1 or m < HALO or m >= end - HALO:
                    continue
                enclosed = False
                there = _distance(c, q, steepest, up, m if axis == steepest else place, (sy, sz), widths)
                if here <= 0.0 or there >= 0.0:  # folded or very thin: interpolate the fraction
                    share = (c[p] - 0.5) / max(c[p] - c[q], 1e-12)
                else:
                    share = here / max(here - there, 1e-12)
                share = min(max(share, closest), 1.0)
                height = heights[k]
                if axis == 0:
                    tx[f] = share
                    coupling = beta * (dy[j] * dz[k]) / ex[i + side]
                elif axis == 1:
                    ty[f] = share
                    coupling = beta * (dx[i] * dz[k]) / ey[j + side]
                else:
                    tz[f] = share
                    coupling = beta * (dx[i] * dy[j]) / ez[k + side]
                    height += share * (heights[m] - height)
                diagonal += coupling / share
                surface += coupling / share * dt * GRAVITY * (height - level)
        if openings > 0.0 and enclosed and c[p] < FULL:
            void = stiffness * (1.0 - c[p]) ** 2 * dx[i] * dy[j] * dz[k] / dt
            diagonal += void
            surface += void * dt * GRAVITY * (heights[k] - level)
        extra[i - begin] = diagonal
        rhs[p] += surface


@njit(cache=True, error_model="numpy")
def _assemble_row(
    j: int, velocity: tuple[Array, Array, Array], water: WetCells, area_fractions: AreaFractions,
    conditions: Conditions, metrics: Metrics, equation: Equation,
) -> None:  # fmt: skip
    """Row j of `assemble`."""
    fraction, o = water.fraction, area_fractions
    couplings, given_bed, dt = equation.couplings, conditions.given_bed, conditions.dt
    u, v, w = velocity
    ny, nz, nx = fraction.shape
    one, sz, sy = U(1), U(nx), U(nz * nx)
    clear_row(couplings, j, water.lo[j] // 2, (water.hi[j] + 1) // 2)
    c, full, right = fraction.ravel(), water.wet.ravel(), equation.rhs.ravel()
    bx, by, bz = o.bx.ravel(), o.by.ravel(), o.bz.ravel()
    along_x, along_y, along_z = (
        (u.ravel(), bx, o.sx.ravel()), (v.ravel(), by, o.sy.ravel()), (w.ravel(), bz, o.sz.ravel()),
    )  # fmt: skip
    tx, ty, tz = equation.theta
    flat = _Flat(c, full, (bx, by, bz), (tx.ravel(), ty.ravel(), tz.ravel()), right)
    # one cell more on either side: a pair may reach beyond the span
    ax, ay, az, extra, source = np.zeros(nx), np.zeros(nx), np.zeros(nx), np.zeros(nx), np.zeros(nx)
    at_surface = np.empty(nx, np.int64)
    for k in range(HALO, nz - HALO):
        lo, hi = int(water.lo[j, k]), int(water.hi[j, k])
        count = hi - lo
        if count <= 0:
            continue
        first = U((j * nz + k) * nx + lo)
        dx, ex, dy, dz = metrics.dx[lo:hi], metrics.ex[lo:hi], metrics.dy[j], metrics.dz[k]
        bed, roof, front, back = k == HALO, k == nz - HALO - 1, j == HALO, j == ny - HALO - 1
        a1, a2, a3, e1, s1 = ax[1:], ay[1:], az[1:], extra[1:], source[1:]

        _couple(a1, bx, full, first, one, count, dy * dz)
        _couple(a2, by, full, first, sy, count, dz / metrics.ey[j])
        _couple(a3, bz, full, first, sz, count, dy / metrics.ez[k])
        s1[:count] = 0.0
        _add_passing(s1, along_y, first, sy, count, dz, (front and not given_bed, back and not given_bed))
        _add_passing(s1, along_z, first, sz, count, dy, (bed, roof))
        for n in range(count):
            m = U(n)
            a1[m] /= ex[m]
            a2[m] *= dx[m]
            a3[m] *= dx[m]
            s1[m] *= dx[m]
            e1[m] = 0.0
        _add_passing(s1, along_x, first, one, count, dy * dz, (False, False))
        if lo == HALO and not given_bed:
            s1[0] += dy * dz * (1.0 - o.bx[j, k, lo]) * (u[j, k, lo] - o.sx[j, k, lo])
        if hi == nx - HALO and not given_bed:
            s1[count - 1] -= dy * dz * (1.0 - o.bx[j, k, hi]) * (u[j, k, hi] - o.sx[j, k, hi])
        emptying = min(EMPTYING / dt, EMPTYING_RATE * math.sqrt(GRAVITY / dz)) * dy * dz
        for n in range(count):
            m = U(n)
            p = first + m
            openings = bx[p] + bx[p + one] + by[p] + by[p + sy] + bz[p] + bz[p + sz]
            excess = c[p] - 1.0
            excess *= openings if openings < 1.0 else 1.0
            value = s1[m] + emptying * dx[m] * (excess if excess > 0.0 else 0.0)
            right[p] = value if (full[p] == 1) & (openings > 0.0) else 0.0
        found = 0
        for n in range(count):
            p = first + U(n)
            inside = full[p - one] & full[p + one] & (full[p - sz] | bed) & (full[p + sz] | roof)
            inside &= (full[p - sy] | front) & (full[p + sy] | back)
            at_surface[found] = lo + n
            found += full[p] & (1 - (inside & (c[p] >= FULL)))
        _add_surface((j, k), at_surface[:found], (ny, nz, nx), flat, conditions, metrics, lo - 1, extra)

        r = j * nz + k
        for row in (ax, ay, az, extra):
            row[0] = 0.0
            row[count + 1] = 0.0
        _split(ax, lo, couplings.ax, couplings, r)
        _split(ay, lo, couplings.ay, couplings, r)
        _split(az, lo, couplings.az, couplings, r)
        _split(extra, lo, couplings.extra, couplings, r)


@njit(cache=True, error_model="numpy", parallel=True)
def assemble(
    velocity: tuple[Array, Array, Array], cells: WaterCells, area_fractions: AreaFractions, conditions: Conditions,
    metrics: Metrics, couplings: Level, rhs: Array, theta: tuple[Array, Array, Array],
) -> None:  # fmt: skip
    """Couplings and right-hand side of the pressure equation.

    Parameters
    ----------
    velocity : three arrays
        Before the projection [m/s].
    cells : WaterCells
    area_fractions : AreaFractions
    conditions : Conditions
    metrics : Metrics
    couplings : Level, changed
        Finest level of the multigrid.
    rhs : array, changed
        Right-hand side, inside the rows of wet cells [m^3/s].
    theta : three arrays, changed
        Place of the surface on the way from the wet to the dry cell [-], for x, y, z faces between such cells.
    """
    water = WetCells(cells.fraction, cells.wet, cells.wet_rows.lo, cells.wet_rows.hi)
    for j in prange(HALO, cells.fraction.shape[0] - HALO):
        equation = Equation(couplings, rhs, theta)  # put together here: parallel loops take no record in another
        _assemble_row(j, velocity, water, area_fractions, conditions, metrics, equation)


@njit(cache=True, error_model="numpy")
def _hull(rows: ActiveRows, j: int, k: int, jj: int, kk: int) -> tuple[int, int]:
    """Begin and end of the cells that hold those of two rows (j, k) and (jj, kk)."""
    lo, hi = int(rows.lo[j, k]), int(rows.hi[j, k])
    low, high = int(rows.lo[jj, kk]), int(rows.hi[jj, kk])
    if low == high:
        return lo, hi
    if lo == hi:
        return low, high
    return min(lo, low), max(hi, high)


@njit(cache=True, error_model="numpy")
def _project_faces(faces: _FaceRow, heights: tuple[float, float], level: float, g: float) -> None:
    """Subtract the gradient on a row's open faces: between wet cells, and between water and air.

    Parameters
    ----------
    faces : _FaceRow
        The velocity is changed.
    heights : two floats
        Heights of the centres of the cells before and behind the faces [m].
    level : float
        Height of still water [m].
    g : float
        Gravity times the step [m/s].
    """
    q, phi, wet, beta, theta, spacing, first, step = faces
    z_low, z_high = heights
    for n in range(len(spacing)):
        m = U(n)
        p = first + m
        change = (phi[p] - phi[p - step]) / spacing[m]
        q[p] -= change if ((wet[p] & wet[p - step]) == 1) & (beta[p] > 0.0) else 0.0
    for n in range(len(spacing)):
        p = first + U(n)
        if wet[p] == wet[p - step] or beta[p] == 0.0:
            continue
        t = theta[p]
        if wet[p]:
            q[p] -= (phi[p] - g * (z_high + t * (z_low - z_high) - level)) / (t * spacing[n])
        else:
            q[p] -= (g * (z_low + t * (z_high - z_low) - level) - phi[p - step]) / (t * spacing[n])


@njit(cache=True, error_model="numpy")
def _project_row(
    j: int, velocity: tuple[Array, Array, Array], phi: Array, water: WetCells, area_fractions: AreaFractions,
    conditions: Conditions, metrics: Metrics, theta: tuple[Array, Array, Array],
) -> None:  # fmt: skip
    """Row j of `project`."""
    _, nz, nx = phi.shape
    g, level = conditions.dt * GRAVITY, conditions.level
    f, wet, o, rows = phi.ravel(), water.wet.ravel(), area_fractions, ActiveRows(water.lo, water.hi)
    even = np.empty(nx)
    for k in range(HALO, nz - HALO):
        z, begin = metrics.zc[k], (j * nz + k) * nx
        lo, hi = int(rows.lo[j, k]), int(rows.hi[j, k])
        if lo < hi:
            lo, hi = max(lo, HALO + 1), min(hi + 1, nx - HALO)
            q, beta, t = velocity[0].ravel(), o.bx.ravel(), theta[0].ravel()
            _project_faces(_FaceRow(q, f, wet, beta, t, metrics.ex[lo:hi], U(begin + lo), U(1)), (z, z), level, g)
        lo, hi = _hull(rows, j, k, j - 1, k)
        if j > HALO and lo < hi:
            even[lo:hi] = metrics.ey[j]
            q, beta, t = velocity[1].ravel(), o.by.ravel(), theta[1].ravel()
            _project_faces(_FaceRow(q, f, wet, beta, t, even[lo:hi], U(begin + lo), U(nz * nx)), (z, z), level, g)
        lo, hi = _hull(rows, j, k, j, k - 1)
        if k > HALO and lo < hi:
            even[lo:hi] = metrics.ez[k]
            q, beta, t = velocity[2].ravel(), o.bz.ravel(), theta[2].ravel()
            heights = metrics.zc[k - 1], z
            _project_faces(_FaceRow(q, f, wet, beta, t, even[lo:hi], U(begin + lo), U(nx)), heights, level, g)


@njit(cache=True, error_model="numpy", parallel=True)
def project(
    velocity: tuple[Array, Array, Array], phi: Array, cells: WaterCells, area_fractions: AreaFractions,
    conditions: Conditions, metrics: Metrics, theta: tuple[Array, Array, Array],
) -> None:  # fmt: skip
    """Subtract the gradient of phi from the velocity on every open face of a wet cell.

    Parameters
    ----------
    velocity : three arrays, changed
        [m/s]
    phi : array
        dt times piezometric pressure over density [m^2/s].
    cells, area_fractions, conditions, metrics
        As given to `assemble`.
    theta : three arrays
        As `assemble` left them.
    """
    water = WetCells(cells.fraction, cells.wet, cells.wet_rows.lo, cells.wet_rows.hi)
    for j in prange(HALO, phi.shape[0] - HALO):
        _project_row(j, velocity, phi, water, area_fractions, conditions, metrics, theta)
