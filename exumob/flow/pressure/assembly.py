"""Pressure that makes the flow free of divergence: the equation, and what its solution does to the velocity.

Unknown: dt times the piezometric pressure over density, phi = dt (p / rho + g (z - level)) [m^2/s], at wet cells. The
surface enters by the ghost-fluid method (second order: Gibou et al., J. Comput. Phys. 176 (2002) 205), the area_fractions of
faces as in `exumob.flow.solids`. `exumob.flow.pressure.conjugate_gradients` solves it.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from exumob.flow.active_rows import ActiveRows
from exumob.flow.free_surface import gradient, stack_distance
from exumob.flow.grid import HALO, Metrics
from exumob.flow.pressure.conjugate_gradients import Outcome, solve
from exumob.flow.pressure.multigrid import Level, Levels, U, clear_row
from exumob.flow.solids import AreaFractions
from exumob.support.arrays import Array
from exumob.support.constants import GRAVITY

__all__ = ["FULL", "Levels", "Outcome", "assemble", "project", "solve"]

FULL = 0.999
"""Fraction from which a cell without surface is no void [-]."""
EMPTYING = 0.3
"""Share of what is too much in a cell that leaves it in one step [-], ..."""
EMPTYING_RATE = 10.0
"""... at most at this rate times sqrt(g / height of the cell): else the shorter the step the faster the flow."""


@njit(cache=True, error_model="numpy")
def _add_passing(
    source: Array, q: Array, beta: Array, solid: Array, first: np.uintp, step: np.uintp, count: int, area: float,
    outer_low: bool, outer_high: bool,
) -> None:  # fmt: skip
    """Add `area` times what passes the low faces of a row's cells less what passes their high faces.

    `outer_low`, `outer_high`: these are the window's sides, where the velocity is given and nothing closes the face.
    """
    closed_low, closed_high = 0.0 if outer_low else 1.0, 0.0 if outer_high else 1.0
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
    """AreaFractions of a row's low faces between wet cells, times `scale`."""
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
    c: Array, p: int, axis: int, up: int, at: int, sy: int, sz: int, dx: Array, dy: Array, dz: Array
) -> float:  # fmt: skip
    """Distance from a cell's centre to the surface along an axis [m]; `at`: the cell's index there."""
    if axis == 2:
        return stack_distance(c, p, sz, up, dz, at, HALO)
    if axis == 0:
        return stack_distance(c, p, 1, up, dx, at, 0)
    return stack_distance(c, p, sy, up, dy, at, 0)


@njit(cache=True, error_model="numpy", inline="always")
def _add_surface(
    cells: NDArray[np.int64], cell_count: int, j: int, k: int, shape: tuple[int, int, int], c: Array,
    wet: NDArray[np.uint8], area_fractions: tuple[Array, Array, Array], theta: tuple[Array, Array, Array],
    widths: tuple[Array, Array, Array], spacings: tuple[Array, Array, Array], heights: Array, dt: float, level: float,
    closest: float, stiffness: float, begin: int, extra: Array, rhs: Array,
) -> None:  # fmt: skip
    """Add what surface and voids give to the diagonal [m] and to the right-hand side [m^3/s] of some cells of a row.

    The surface lies where the distances to it of the wet and of the dry cell say so, both along the axis nearest to
    its normal at the wet one.
    """
    ny, nz, nx = shape
    sy, sz = nz * nx, nx
    bx, by, bz = area_fractions
    tx, ty, tz = theta
    dx, dy, dz = widths
    ex, ey, ez = spacings
    for n in range(cell_count):
        i = cells[n]
        p = (j * nz + k) * nx + i
        gx, gy, gz = gradient(c, p, sy, sz)
        steepest = 2 if abs(gz) >= abs(gx) and abs(gz) >= abs(gy) else (0 if abs(gx) >= abs(gy) else 1)
        up = -1 if (gz if steepest == 2 else (gx if steepest == 0 else gy)) > 0.0 else 1
        place = k if steepest == 2 else (i if steepest == 0 else j)
        here = _distance(c, p, steepest, up, place, sy, sz, dx, dy, dz)
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
                there = _distance(c, q, steepest, up, m if axis == steepest else place, sy, sz, dx, dy, dz)
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
    j: int, u: Array, v: Array, w: Array, fraction: Array, wet: NDArray[np.uint8], solids: AreaFractions, given_bed: bool,
    metrics: Metrics, dt: float, level: float, closest: float, stiffness: float, spans: ActiveRows, tx: Array, ty: Array,
    tz: Array, couplings: Level, rhs: Array,
) -> None:  # fmt: skip
    """Row j of `assemble`."""
    ny, nz, nx = fraction.shape
    one, sz, sy = U(1), U(nx), U(nz * nx)
    clear_row(couplings, j, spans.lo[j] // 2, (spans.hi[j] + 1) // 2)
    c, full, right = fraction.ravel(), wet.ravel(), rhs.ravel()
    bx, by, bz = solids.bx.ravel(), solids.by.ravel(), solids.bz.ravel()
    # one cell more on either side: a pair may reach beyond the span
    ax, ay, az, extra, source = np.zeros(nx), np.zeros(nx), np.zeros(nx), np.zeros(nx), np.zeros(nx)
    cells = np.empty(nx, np.int64)
    theta, widths = (tx.ravel(), ty.ravel(), tz.ravel()), (metrics.dx, metrics.dy, metrics.dz)
    spacings = metrics.ex, metrics.ey, metrics.ez
    for k in range(HALO, nz - HALO):
        lo, hi = int(spans.lo[j, k]), int(spans.hi[j, k])
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
        _add_passing(
            s1, v.ravel(), by, solids.sy.ravel(), first, sy, count, dz, front and not given_bed, back and not given_bed
        )
        _add_passing(s1, w.ravel(), bz, solids.sz.ravel(), first, sz, count, dy, bed, roof)
        for n in range(count):
            m = U(n)
            a1[m] /= ex[m]
            a2[m] *= dx[m]
            a3[m] *= dx[m]
            s1[m] *= dx[m]
            e1[m] = 0.0
        _add_passing(s1, u.ravel(), bx, solids.sx.ravel(), first, one, count, dy * dz, False, False)
        if lo == HALO and not given_bed:
            s1[0] += dy * dz * (1.0 - solids.bx[j, k, lo]) * (u[j, k, lo] - solids.sx[j, k, lo])
        if hi == nx - HALO and not given_bed:
            s1[count - 1] -= dy * dz * (1.0 - solids.bx[j, k, hi]) * (u[j, k, hi] - solids.sx[j, k, hi])
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
            cells[found] = lo + n
            found += full[p] & (1 - (inside & (c[p] >= FULL)))
        _add_surface(
            cells, found, j, k, (ny, nz, nx), c, full, (bx, by, bz), theta, widths, spacings, metrics.zc, dt, level,
            closest, stiffness, lo - 1, extra, right,
        )  # fmt: skip

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
    u: Array, v: Array, w: Array, fraction: Array, wet: NDArray[np.uint8], solids: AreaFractions, given_bed: bool,
    metrics: Metrics, dt: float, level: float, closest: float, stiffness: float, spans: ActiveRows, tx: Array, ty: Array,
    tz: Array, couplings: Level, rhs: Array,
) -> None:  # fmt: skip
    """Couplings and right-hand side of the pressure equation.

    Parameters
    ----------
    u, v, w : array
        Velocity before the projection [m/s].
    given_bed : bool
        Whether a bed closes part of the window's sides; solids stay away from them.
    level : float
        Height at which the piezometric pressure of air is 0: still water [m].
    closest : float
        Least distance of the surface from a cell's centre, as a share of the distance between centres [-].
    stiffness : float
        Compliance of enclosed voids, div u = -stiffness (1 - fraction)^2 p / rho [s/m^2].
    spans : ActiveRows
        Of the wet cells.
    tx, ty, tz : array, changed
        Where on the way from the wet to the dry cell the surface lies [-], for faces between such cells.
    couplings : Level, changed
        Finest level of the multigrid.
    rhs : array, changed
        Inside the spans [m^3/s].
    """
    for j in prange(HALO, fraction.shape[0] - HALO):
        _assemble_row(
            j, u, v, w, fraction, wet, solids, given_bed, metrics, dt, level, closest, stiffness, spans, tx, ty, tz,
            couplings, rhs,
        )  # fmt: skip


@njit(cache=True, error_model="numpy")
def _hull(spans: ActiveRows, j: int, k: int, jj: int, kk: int) -> tuple[int, int]:
    """Span that holds those of two rows."""
    lo, hi = int(spans.lo[j, k]), int(spans.hi[j, k])
    low, high = int(spans.lo[jj, kk]), int(spans.hi[jj, kk])
    if low == high:
        return lo, hi
    if lo == hi:
        return low, high
    return min(lo, low), max(hi, high)


@njit(cache=True, error_model="numpy")
def _project_inside(
    q: Array, phi: Array, wet: NDArray[np.uint8], beta: Array, spacing: Array, first: np.uintp, step: np.uintp
) -> None:
    """Subtract the gradient on a row's open faces between wet cells; spacing [m], one per face."""
    for n in range(len(spacing)):
        m = U(n)
        p = first + m
        change = (phi[p] - phi[p - step]) / spacing[m]
        q[p] -= change if ((wet[p] & wet[p - step]) == 1) & (beta[p] > 0.0) else 0.0


@njit(cache=True, error_model="numpy")
def _project_surface(
    q: Array, phi: Array, wet: NDArray[np.uint8], beta: Array, theta: Array, spacing: Array, first: np.uintp,
    step: np.uintp, z_low: float, z_high: float, level: float, g: float,
) -> None:  # fmt: skip
    """The same on open faces between water and air; z_low, z_high: centres of the cells before and behind [m]."""
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
    j: int, u: Array, v: Array, w: Array, phi: Array, wet: NDArray[np.uint8], solids: AreaFractions, metrics: Metrics,
    dt: float, level: float, spans: ActiveRows, tx: Array, ty: Array, tz: Array,
) -> None:  # fmt: skip
    """Row j of `project`."""
    _, nz, nx = phi.shape
    g = dt * GRAVITY
    f, full = phi.ravel(), wet.ravel()
    even = np.empty(nx)
    for k in range(HALO, nz - HALO):
        z, begin = metrics.zc[k], (j * nz + k) * nx
        lo, hi = int(spans.lo[j, k]), int(spans.hi[j, k])
        if lo < hi:
            lo, hi = max(lo, HALO + 1), min(hi + 1, nx - HALO)
            spacing, first, step = metrics.ex[lo:hi], U(begin + lo), U(1)
            q, beta = u.ravel(), solids.bx.ravel()
            _project_inside(q, f, full, beta, spacing, first, step)
            _project_surface(q, f, full, beta, tx.ravel(), spacing, first, step, z, z, level, g)
        lo, hi = _hull(spans, j, k, j - 1, k)
        if j > HALO and lo < hi:
            spacing, first, step = even[lo:hi], U(begin + lo), U(nz * nx)
            spacing[:] = metrics.ey[j]
            q, beta = v.ravel(), solids.by.ravel()
            _project_inside(q, f, full, beta, spacing, first, step)
            _project_surface(q, f, full, beta, ty.ravel(), spacing, first, step, z, z, level, g)
        lo, hi = _hull(spans, j, k, j, k - 1)
        if k > HALO and lo < hi:
            spacing, first, step = even[lo:hi], U(begin + lo), U(nx)
            spacing[:] = metrics.ez[k]
            q, beta = w.ravel(), solids.bz.ravel()
            _project_inside(q, f, full, beta, spacing, first, step)
            _project_surface(q, f, full, beta, tz.ravel(), spacing, first, step, metrics.zc[k - 1], z, level, g)


@njit(cache=True, error_model="numpy", parallel=True)
def project(
    u: Array, v: Array, w: Array, phi: Array, wet: NDArray[np.uint8], solids: AreaFractions, metrics: Metrics, dt: float,
    level: float, spans: ActiveRows, tx: Array, ty: Array, tz: Array,
) -> None:  # fmt: skip
    """Subtract the gradient of phi from the velocity on every open face of a wet cell."""
    for j in prange(HALO, phi.shape[0] - HALO):
        _project_row(j, u, v, w, phi, wet, solids, metrics, dt, level, spans, tx, ty, tz)
