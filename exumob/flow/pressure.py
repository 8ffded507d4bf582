"""Pressure that makes the flow free of divergence: conjugate gradients with a geometric multigrid preconditioner.

Unknown: dt times the piezometric pressure over density, phi = dt (p / rho + g (z - level)) [m^2/s], at wet cells. The
surface enters by the ghost-fluid method (second order: Gibou et al., J. Comput. Phys. 176 (2002) 205), the openness of
faces as in `exumob.flow.body`. The multigrid (McAdams, Sifakis & Teran 2010 use it likewise) relaxes vertical lines in
checkerboard order and coarsens x and y only: cells are flat seen from far, and columns are short.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from exumob.environment import GRAVITY
from exumob.flow.body import Openness
from exumob.flow.grid import HALO, Metrics
from exumob.flow.interface import surface_position
from exumob.states import Array

Single = NDArray[np.float32]
COARSEST = 4
"""Cells along x or y at which coarsening stops."""


class Level(NamedTuple):
    """One level of the multigrid (single precision)."""

    ax: Single
    ay: Single
    az: Single
    """Couplings through the low faces [m]"""
    extra: Single
    """What else stands on the diagonal: surface, compliance [m]"""
    pivot: Single
    """Inverse pivots of the vertical lines; 0 where there is no unknown"""
    x: Single
    b: Single
    r: Single


class Levels:
    """All levels of a grid, finest first, and the vectors of the conjugate gradients."""

    def __init__(self, padded_shape: tuple[int, int, int]) -> None:
        """Allocate for fields of this shape."""
        ny, nz, nx = (n - 2 * HALO for n in padded_shape)
        self.levels: list[Level] = []
        while True:
            shape = (ny + 2 * HALO, nz + 2 * HALO, nx + 2 * HALO)
            self.levels.append(Level(*(np.zeros(shape, dtype=np.float32) for _ in Level._fields)))
            if min(nx, ny) <= COARSEST:
                break
            nx, ny = (nx + 1) // 2, (ny + 1) // 2
        self.residual, self.direction, self.product = (np.zeros(padded_shape) for _ in range(3))
        self.rhs = np.zeros(padded_shape)

    def prepare(self, top: int) -> None:
        """Coarsen the couplings and factor the vertical lines of all levels."""
        factor_lines(self.levels[0], top)
        for fine, coarse in zip(self.levels[:-1], self.levels[1:], strict=True):
            coarsen(fine, coarse, top)
            factor_lines(coarse, top)

    def cycle(self, top: int, depth: int = 0) -> None:
        """One symmetric V-cycle: x = M^-1 b on a level."""
        level = self.levels[depth]
        if depth == len(self.levels) - 1:
            level.x[:] = 0.0
            for _ in range(6):
                relax_lines(level, 0, top)
                relax_lines(level, 1, top)
            for _ in range(6):
                relax_lines(level, 1, top)
                relax_lines(level, 0, top)
            return
        level.x[:] = 0.0
        relax_lines(level, 0, top)
        relax_lines(level, 1, top)
        coarse = self.levels[depth + 1]
        line_residual(level, top)
        restrict(level, coarse, top)
        self.cycle(top, depth + 1)
        prolong(level, coarse, top)
        relax_lines(level, 1, top)
        relax_lines(level, 0, top)


@njit(cache=True, error_model="numpy")
def _assemble_row(
    j: int, u: Array, v: Array, w: Array, fraction: Array, wet: NDArray[np.uint8], solids: Openness, metrics: Metrics,
    dt: float, level: float, closest: float, stiffness: float, top: int, tx: Array, ty: Array, tz: Array,
    couplings: Level, rhs: Array,
) -> None:  # fmt: skip
    """Row j of `assemble`."""
    ny, nz, nx = fraction.shape
    sy, sz = nz * nx, nx
    shape = (ny, nz, nx)
    c = fraction.ravel()
    for k in range(HALO, top + 1):
        for i in range(HALO, nx - HALO):
            couplings.ax[j, k, i] = 0.0
            couplings.ay[j, k, i] = 0.0
            couplings.az[j, k, i] = 0.0
            couplings.extra[j, k, i] = 0.0
            rhs[j, k, i] = 0.0
            if wet[j, k, i] == 0:
                continue
            p = j * sy + k * sz + i
            areas = (metrics.dy[j] * metrics.dz[k], metrics.dx[i] * metrics.dz[k], metrics.dx[i] * metrics.dy[j])
            extra, source, surface, openings = 0.0, 0.0, 0.0, 0.0
            enclosed = True
            for axis in range(3):
                for side in range(2):
                    jj, kk, ii = j, k, i
                    mj, mk, mi = j, k, i
                    if axis == 0:
                        ii += side
                        mi += 2 * side - 1
                        spacing = metrics.ex[ii]
                        beta, speed, solid = solids.bx[jj, kk, ii], u[jj, kk, ii], solids.sx[jj, kk, ii]
                        outer = (side == 0 and i == HALO) or (side == 1 and i == nx - HALO - 1)
                    elif axis == 1:
                        jj += side
                        mj += 2 * side - 1
                        spacing = metrics.ey[jj]
                        beta, speed, solid = solids.by[jj, kk, ii], v[jj, kk, ii], solids.sy[jj, kk, ii]
                        outer = (side == 0 and j == HALO) or (side == 1 and j == ny - HALO - 1)
                    else:
                        kk += side
                        mk += 2 * side - 1
                        spacing = metrics.ez[kk]
                        beta, speed, solid = solids.bz[jj, kk, ii], w[jj, kk, ii], solids.sz[jj, kk, ii]
                        outer = (side == 0 and k == HALO) or (side == 1 and k == nz - HALO - 1)
                    openings += beta
                    area = areas[axis]
                    if outer:
                        passing = speed
                    else:
                        passing = beta * speed + (1.0 - beta) * solid
                    source += area * passing * (1.0 - 2.0 * side)
                    if outer or beta == 0.0:
                        continue
                    coupling = beta * area / spacing
                    if wet[mj, mk, mi] == 1:
                        if side == 0:
                            if axis == 0:
                                couplings.ax[j, k, i] = coupling
                            elif axis == 1:
                                couplings.ay[j, k, i] = coupling
                            else:
                                couplings.az[j, k, i] = coupling
                        continue
                    enclosed = False
                    q = mj * sy + mk * sz + mi
                    theta = surface_position(c, p, q, j, k, i, mj, mk, mi, shape, metrics, closest)
                    if axis == 0:
                        tx[jj, kk, ii] = theta
                    elif axis == 1:
                        ty[jj, kk, ii] = theta
                    else:
                        tz[jj, kk, ii] = theta
                    height = metrics.zc[k] + theta * (metrics.zc[mk] - metrics.zc[k])
                    extra += coupling / theta
                    surface += coupling / theta * dt * GRAVITY * (height - level)
            if openings == 0.0:
                continue
            volume = metrics.dx[i] * metrics.dy[j] * metrics.dz[k]
            filling = fraction[j, k, i]
            if enclosed and filling < 0.999:
                void = stiffness * (1.0 - filling) ** 2 * volume / dt
                extra += void
                surface += void * dt * GRAVITY * (metrics.zc[k] - level)
            elif filling > 1.0:  # too full: let it out within a few steps
                source += 0.3 * (filling - 1.0) / dt * volume
            couplings.extra[j, k, i] = extra
            rhs[j, k, i] = source + surface


@njit(cache=True, error_model="numpy", parallel=True)
def assemble(
    u: Array, v: Array, w: Array, fraction: Array, wet: NDArray[np.uint8], solids: Openness, metrics: Metrics,
    dt: float, level: float, closest: float, stiffness: float, top: int, tx: Array, ty: Array, tz: Array,
    couplings: Level, rhs: Array,
) -> None:  # fmt: skip
    """Couplings and right-hand side of the pressure equation.

    Parameters
    ----------
    u, v, w : array
        Velocity before the projection [m/s].
    level : float
        Height at which the piezometric pressure of air is 0: still water [m].
    closest : float
        Least distance of the surface from a cell's centre, as a share of the distance between centres [-].
    stiffness : float
        Compliance of enclosed voids, div u = -stiffness (1 - fraction)^2 p / rho [s/m^2].
    tx, ty, tz : array, changed
        Where on the way from the wet to the dry cell the surface lies [-], for faces between such cells.
    couplings : Level, changed
    rhs : array, changed
        [m^3/s]
    """
    for j in prange(HALO, fraction.shape[0] - HALO):
        _assemble_row(
            j, u, v, w, fraction, wet, solids, metrics, dt, level, closest, stiffness, top, tx, ty, tz, couplings, rhs
        )


@njit(cache=True, error_model="numpy", parallel=True)
def factor_lines(level: Level, top: int) -> None:
    """Inverse pivots of the tridiagonal systems along z."""
    ny, _, nx = level.x.shape
    pivot = level.pivot  # Numba drops writes through a tuple inside prange
    for j in prange(HALO, ny - HALO):
        for k in range(HALO, top + 1):
            for i in range(HALO, nx - HALO):
                diagonal = (
                    level.ax[j, k, i] + level.ax[j, k, i + 1] + level.ay[j, k, i] + level.ay[j + 1, k, i]
                    + level.az[j, k, i] + (level.az[j, k + 1, i] if k < top else np.float32(0.0))
                    + level.extra[j, k, i]
                )  # fmt: skip
                below = level.az[j, k, i]
                if k > HALO:
                    reduced = diagonal - below * below * pivot[j, k - 1, i]
                else:
                    reduced = diagonal
                pivot[j, k, i] = (
                    np.float32(1.0) / max(reduced, np.float32(1e-6) * diagonal)
                    if diagonal > np.float32(0.0)
                    else np.float32(0.0)
                )


@njit(cache=True, error_model="numpy", parallel=True)
def coarsen(fine: Level, coarse: Level, top: int) -> None:
    """Rediscretised couplings of a grid twice as coarse in x and y."""
    ny, _, nx = coarse.x.shape
    my, mx = fine.x.shape[0] - 2 * HALO, fine.x.shape[2] - 2 * HALO
    half = np.float32(0.5)
    coarse_ax = coarse.ax  # Numba drops writes through a tuple inside prange
    coarse_ay = coarse.ay
    coarse_az = coarse.az
    coarse_extra = coarse.extra
    for j in prange(HALO, ny - HALO):
        j0 = 2 * (j - HALO) + HALO
        j1 = min(j0 + 1, my + HALO - 1)
        wy = np.float32(1.0) if j1 > j0 else np.float32(0.0)
        for k in range(HALO, top + 1):
            for i in range(HALO, nx - HALO):
                i0 = 2 * (i - HALO) + HALO
                i1 = min(i0 + 1, mx + HALO - 1)
                wx = np.float32(1.0) if i1 > i0 else np.float32(0.0)
                coarse_ax[j, k, i] = half * (fine.ax[j0, k, i0] + wy * fine.ax[j1, k, i0])
                coarse_ay[j, k, i] = half * (fine.ay[j0, k, i0] + wx * fine.ay[j0, k, i1])
                coarse_az[j, k, i] = (
                    fine.az[j0, k, i0] + wx * fine.az[j0, k, i1]
                    + wy * (fine.az[j1, k, i0] + wx * fine.az[j1, k, i1])
                )  # fmt: skip
                coarse_extra[j, k, i] = (
                    fine.extra[j0, k, i0] + wx * fine.extra[j0, k, i1]
                    + wy * (fine.extra[j1, k, i0] + wx * fine.extra[j1, k, i1])
                )  # fmt: skip


@njit(cache=True, error_model="numpy", parallel=True)
def relax_lines(level: Level, color: int, top: int) -> None:
    """Solve the vertical lines of one colour of the checkerboard with the others held."""
    ny, nz, nx = level.x.shape
    sy, sz = np.uintp(nz * nx), np.uintp(nx)
    ax, ay, az = level.ax.ravel(), level.ay.ravel(), level.az.ravel()
    pivot, x, b = level.pivot.ravel(), level.x.ravel(), level.b.ravel()
    for j in prange(HALO, ny - HALO):
        for k in range(HALO, top + 1):
            begin = (j * nz + k) * nx
            first = begin + HALO + (j + color) % 2
            _relax_row(first, begin + nx - HALO, sy, sz, k > HALO, ax, ay, az, pivot, x, b)
        for k in range(top - 1, HALO - 1, -1):
            begin = (j * nz + k) * nx
            first = begin + HALO + (j + color) % 2
            for i in range(first, begin + nx - HALO, 2):
                p = np.uintp(i)
                x[p] += pivot[p] * az[p + sz] * x[p + sz]


@njit(cache=True, error_model="numpy")
def _relax_row(
    first: int, last: int, sy: int, sz: int, above: bool, ax: Single, ay: Single, az: Single, pivot: Single, x: Single,
    b: Single,
) -> None:  # fmt: skip
    """Forward substitution of `relax_lines` for every second cell of a row.

    Flat unsigned indices, here and below: Numba then leaves out its test for negative ones and uses vector
    instructions.
    """
    one = np.uintp(1)
    if above:
        for i in range(first, last, 2):
            p = np.uintp(i)
            value = b[p] + ax[p] * x[p - one] + ax[p + one] * x[p + one] + ay[p] * x[p - sy] + ay[p + sy] * x[p + sy]
            x[p] = (value + az[p] * x[p - sz]) * pivot[p]
    else:
        for i in range(first, last, 2):
            p = np.uintp(i)
            value = b[p] + ax[p] * x[p - one] + ax[p + one] * x[p + one] + ay[p] * x[p - sy] + ay[p + sy] * x[p + sy]
            x[p] = value * pivot[p]


@njit(cache=True, error_model="numpy", parallel=True)
def line_residual(level: Level, top: int) -> None:
    """Residual r = b - A x; 0 where there is no unknown."""
    ny, nz, nx = level.x.shape
    sy, sz = np.uintp(nz * nx), np.uintp(nx)
    ax, ay, az, extra = level.ax.ravel(), level.ay.ravel(), level.az.ravel(), level.extra.ravel()
    pivot, x, b, r = level.pivot.ravel(), level.x.ravel(), level.b.ravel(), level.r.ravel()
    for j in prange(HALO, ny - HALO):
        for k in range(HALO, top + 1):
            begin = (j * nz + k) * nx
            _residual_row(begin + HALO, begin + nx - HALO, sy, sz, ax, ay, az, extra, pivot, x, b, r)


@njit(cache=True, error_model="numpy")
def _residual_row(
    first: int, last: int, sy: int, sz: int, ax: Single, ay: Single, az: Single, extra: Single, pivot: Single,
    x: Single, b: Single, r: Single,
) -> None:  # fmt: skip
    """Row of `line_residual`."""
    one = np.uintp(1)
    for i in range(first, last):
        p = np.uintp(i)
        h = x[p]
        rest = b[p] - extra[p] * h
        rest += ax[p] * (x[p - one] - h) + ax[p + one] * (x[p + one] - h)
        rest += ay[p] * (x[p - sy] - h) + ay[p + sy] * (x[p + sy] - h)
        rest += az[p] * (x[p - sz] - h) + az[p + sz] * (x[p + sz] - h)
        r[p] = rest if pivot[p] > np.float32(0.0) else np.float32(0.0)


@njit(cache=True, error_model="numpy", parallel=True)
def restrict(fine: Level, coarse: Level, top: int) -> None:
    """Sum of the residuals of the (up to) four cells of a coarse cell."""
    ny, _, nx = coarse.x.shape
    my, mx = fine.x.shape[0] - HALO, fine.x.shape[2] - HALO
    coarse_b = coarse.b  # Numba drops writes through a tuple inside prange
    for j in prange(HALO, ny - HALO):
        j0 = 2 * (j - HALO) + HALO
        for k in range(HALO, top + 1):
            for i in range(HALO, nx - HALO):
                i0 = 2 * (i - HALO) + HALO
                total = fine.r[j0, k, i0]
                if i0 + 1 < mx:
                    total += fine.r[j0, k, i0 + 1]
                if j0 + 1 < my:
                    total += fine.r[j0 + 1, k, i0]
                    if i0 + 1 < mx:
                        total += fine.r[j0 + 1, k, i0 + 1]
                coarse_b[j, k, i] = total


@njit(cache=True, error_model="numpy", parallel=True)
def prolong(fine: Level, coarse: Level, top: int) -> None:
    """Add the coarse correction to each cell of a coarse cell."""
    ny, _, nx = fine.x.shape
    fine_x = fine.x  # Numba drops writes through a tuple inside prange
    for j in prange(HALO, ny - HALO):
        jc = (j - HALO) // 2 + HALO
        for k in range(HALO, top + 1):
            for i in range(HALO, nx - HALO):
                if fine.pivot[j, k, i] > np.float32(0.0):
                    fine_x[j, k, i] += coarse.x[jc, k, (i - HALO) // 2 + HALO]


@njit(cache=True, error_model="numpy", parallel=True)
def multiply(level: Level, x: Array, out: Array, top: int, sums: Array) -> None:
    """Product A x in double precision and, per row j, the dot product of x and A x."""
    ny, nz, nx = x.shape
    sy, sz = np.uintp(nz * nx), np.uintp(nx)
    ax, ay, az, extra = level.ax.ravel(), level.ay.ravel(), level.az.ravel(), level.extra.ravel()
    q, product = x.ravel(), out.ravel()
    for j in prange(HALO, ny - HALO):
        total = 0.0
        for k in range(HALO, top + 1):
            begin = (j * nz + k) * nx
            total += _multiply_row(begin + HALO, begin + nx - HALO, sy, sz, ax, ay, az, extra, q, product)
        sums[j] = total


@njit(cache=True, error_model="numpy", fastmath={"reassoc"})
def _multiply_row(
    first: int, last: int, sy: int, sz: int, ax: Single, ay: Single, az: Single, extra: Single, x: Array, out: Array
) -> float:
    """Row of `multiply`."""
    one = np.uintp(1)
    total = 0.0
    for i in range(first, last):
        p = np.uintp(i)
        h = x[p]
        value = extra[p] * h
        value += ax[p] * (h - x[p - one]) + ax[p + one] * (h - x[p + one])
        value += ay[p] * (h - x[p - sy]) + ay[p + sy] * (h - x[p + sy])
        value += az[p] * (h - x[p - sz]) + az[p + sz] * (h - x[p + sz])
        out[p] = value
        total += h * value
    return total


@njit(cache=True, error_model="numpy", parallel=True)
def first_residual(
    level: Level, rhs: Array, x: Array, product: Array, residual: Array, metrics: Metrics, top: int, worst: Array
) -> None:
    """Residual rhs - A x as start of the conjugate gradients; per row j its largest share of a cell's volume [1/s]."""
    ny, nz, nx = x.shape
    pivot, b = level.pivot.ravel(), level.b.ravel()
    right, image, rest = rhs.ravel(), product.ravel(), residual.ravel()
    for j in prange(HALO, ny - HALO):
        for k in range(HALO, top + 1):
            begin = (j * nz + k) * nx
            for i in range(begin + HALO, begin + nx - HALO):
                p = np.uintp(i)
                value = right[p] - image[p] if pivot[p] > 0.0 else 0.0
                rest[p] = value
                b[p] = value
        worst[j] = _largest_share(j, residual, metrics, top)


@njit(cache=True, error_model="numpy")
def _largest_share(j: int, residual: Array, metrics: Metrics, top: int) -> float:
    """Largest residual of row j over its cell's volume [1/s]; infinite if one is not a number."""
    nx = residual.shape[2]
    largest, total = 0.0, 0.0
    for k in range(HALO, top + 1):
        row, widths = residual[j, k, HALO : nx - HALO], metrics.dx[HALO : nx - HALO]
        share = 1.0 / (metrics.dy[j] * metrics.dz[k])
        for i in range(len(row)):
            size = abs(row[i]) * share / widths[i]
            largest = size if size > largest else largest
            total += size
    return largest if total < np.inf else np.inf


@njit(cache=True, error_model="numpy", parallel=True)
def advance_solution(
    level: Level, x: Array, direction: Array, product: Array, residual: Array, alpha: float, metrics: Metrics,
    top: int, worst: Array,
) -> None:  # fmt: skip
    """Step x += alpha direction, residual -= alpha product; per row j the largest residual share of a volume [1/s]."""
    ny, nz, nx = x.shape
    b, q, along, image, rest = level.b.ravel(), x.ravel(), direction.ravel(), product.ravel(), residual.ravel()
    for j in prange(HALO, ny - HALO):
        for k in range(HALO, top + 1):
            begin = (j * nz + k) * nx
            for i in range(begin + HALO, begin + nx - HALO):
                p = np.uintp(i)
                q[p] += alpha * along[p]
                value = rest[p] - alpha * image[p]
                rest[p] = value
                b[p] = value
        worst[j] = _largest_share(j, residual, metrics, top)


@njit(cache=True, error_model="numpy", parallel=True, fastmath={"reassoc"})
def dot_rows(level: Level, residual: Array, top: int, sums: Array) -> None:
    """Per row j the dot product of the residual and the preconditioned residual."""
    ny, nz, nx = residual.shape
    x, rest = level.x.ravel(), residual.ravel()
    for j in prange(HALO, ny - HALO):
        total = 0.0
        for k in range(HALO, top + 1):
            begin = (j * nz + k) * nx
            for i in range(begin + HALO, begin + nx - HALO):
                p = np.uintp(i)
                total += rest[p] * x[p]
        sums[j] = total


@njit(cache=True, error_model="numpy", parallel=True)
def new_direction(level: Level, direction: Array, beta: float, top: int) -> None:
    """Conjugate direction: preconditioned residual plus beta times the last direction."""
    ny, nz, nx = direction.shape
    x, along = level.x.ravel(), direction.ravel()
    for j in prange(HALO, ny - HALO):
        for k in range(HALO, top + 1):
            begin = (j * nz + k) * nx
            for i in range(begin + HALO, begin + nx - HALO):
                p = np.uintp(i)
                along[p] = x[p] + beta * along[p]


class Outcome(NamedTuple):
    """How a pressure solution ended."""

    iterations: int
    residual: float
    """Largest divergence left, times the time step [-]"""
    converged: bool


def solve(
    levels: Levels, phi: Array, metrics: Metrics, dt: float, top: int, tolerance: float, most: int, closed: bool
) -> Outcome:
    """Solve for phi [m^2/s], starting from what it holds.

    Parameters
    ----------
    levels : Levels
        With couplings and right-hand side from `assemble`.
    phi : array, changed
    top : int
        Highest layer with wet cells.
    tolerance : float
        Divergence left times dt [-].
    most : int
        Iterations before giving up.
    closed : bool
        Whether there may be no surface at all: phi is then defined up to a constant and the sources must sum to 0.
    """
    for level in levels.levels:  # nothing couples upwards from the highest wet layer
        level.az[:, top + 1] = 0.0
        level.x[:, top + 1] = 0.0
    phi[:, top + 1] = 0.0
    levels.direction[:, top + 1] = 0.0
    levels.prepare(top)
    fine = levels.levels[0]
    if closed and not fine.extra.any():
        unknown = fine.pivot > 0.0
        levels.rhs[unknown] -= levels.rhs[unknown].mean()
    sums = np.zeros(phi.shape[0])
    mask_unknowns(fine, phi, top)
    multiply(fine, phi, levels.product, top, sums)
    worst = np.zeros(phi.shape[0])
    first_residual(fine, levels.rhs, phi, levels.product, levels.residual, metrics, top, worst)
    left = float(worst.max()) * dt
    rho = 0.0
    for iteration in range(most):
        if left <= tolerance or not math.isfinite(left):
            return Outcome(iteration, left, left <= tolerance)
        levels.cycle(top)
        dot_rows(fine, levels.residual, top, sums)
        last, rho = rho, float(np.sum(sums))
        new_direction(fine, levels.direction, rho / last if iteration else 0.0, top)
        multiply(fine, levels.direction, levels.product, top, sums)
        curvature = float(np.sum(sums))
        if not curvature > 0.0:
            return Outcome(iteration, left, False)
        advance_solution(
            fine, phi, levels.direction, levels.product, levels.residual, rho / curvature, metrics, top, worst
        )
        left = float(worst.max()) * dt
    return Outcome(most, left, left <= tolerance)


@njit(cache=True, error_model="numpy", parallel=True)
def mask_unknowns(level: Level, phi: Array, top: int) -> None:
    """Set phi to 0 where it is no unknown."""
    ny, nz, nx = phi.shape
    for j in prange(HALO, ny - HALO):
        for k in range(HALO, nz - HALO):
            for i in range(HALO, nx - HALO):
                if k > top or level.pivot[j, k, i] == 0.0:
                    phi[j, k, i] = 0.0


@njit(cache=True, error_model="numpy", parallel=True)
def project(
    u: Array, v: Array, w: Array, phi: Array, wet: NDArray[np.uint8], solids: Openness, metrics: Metrics, dt: float,
    level: float, top: int, tx: Array, ty: Array, tz: Array,
) -> None:  # fmt: skip
    """Subtract the gradient of phi from the velocity on every open face of a wet cell."""
    ny, nz, nx = phi.shape
    g = dt * GRAVITY
    for j in prange(HALO, ny - HALO):
        for k in range(HALO, min(top + 1, nz - HALO - 1) + 1):
            for i in range(HALO, nx - HALO):
                here = wet[j, k, i]
                z = metrics.zc[k]
                if i > HALO and solids.bx[j, k, i] > 0.0:
                    there = wet[j, k, i - 1]
                    if here and there:
                        u[j, k, i] -= (phi[j, k, i] - phi[j, k, i - 1]) / metrics.ex[i]
                    elif here:
                        u[j, k, i] -= (phi[j, k, i] - g * (z - level)) / (tx[j, k, i] * metrics.ex[i])
                    elif there:
                        u[j, k, i] -= (g * (z - level) - phi[j, k, i - 1]) / (tx[j, k, i] * metrics.ex[i])
                if j > HALO and solids.by[j, k, i] > 0.0:
                    there = wet[j - 1, k, i]
                    if here and there:
                        v[j, k, i] -= (phi[j, k, i] - phi[j - 1, k, i]) / metrics.ey[j]
                    elif here:
                        v[j, k, i] -= (phi[j, k, i] - g * (z - level)) / (ty[j, k, i] * metrics.ey[j])
                    elif there:
                        v[j, k, i] -= (g * (z - level) - phi[j - 1, k, i]) / (ty[j, k, i] * metrics.ey[j])
                if k > HALO and solids.bz[j, k, i] > 0.0:
                    there = wet[j, k - 1, i]
                    if here and there:
                        w[j, k, i] -= (phi[j, k, i] - phi[j, k - 1, i]) / metrics.ez[k]
                    elif here:  # water above air
                        height = z - tz[j, k, i] * metrics.ez[k]
                        w[j, k, i] -= (phi[j, k, i] - g * (height - level)) / (tz[j, k, i] * metrics.ez[k])
                    elif there:
                        height = metrics.zc[k - 1] + tz[j, k, i] * metrics.ez[k]
                        w[j, k, i] -= (g * (height - level) - phi[j, k - 1, i]) / (tz[j, k, i] * metrics.ez[k])
