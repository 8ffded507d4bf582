"""Kernels of the k-omega shear-stress-transport model (Menter, Kuntz & Langtry, Turb. Heat Mass Transf. 4 (2003) 625).

A step takes three passes over the cells: `sources` (eddy viscosity, blending, production, cross-diffusion),
`apply_wall_law` (production and omega next to walls) and `transport`. Active cells are at least half full and outside
solids; all others hold the mean of active neighbours, so that free surface and walls have zero gradient, or else the
inflow.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import prange

from exumob.flow.active_rows import ActiveRows, WaterCells
from exumob.flow.area_fractions import AreaFractions, distance_gradient
from exumob.flow.grid import HALO, Metrics
from exumob.flow.poses import PlacedSolids, surface_velocity
from exumob.flow.turbulence.wall import KARMAN, Walls, friction_velocity
from exumob.support.arrays import Array
from exumob.support.kernels import njit

A1, BETA_STAR = 0.31, 0.09
SIGMA_K, SIGMA_OMEGA, BETA, ALPHA = (0.85, 1.0), (0.5, 0.856), (0.075, 0.0828), (5.0 / 9.0, 0.44)
"""Constants of the k-omega model (F1 = 1) and of the k-epsilon model (F1 = 0)."""
PRODUCTION_LIMIT = 10.0
"""Largest production over destruction of k [-]."""
LEAST_K, LEAST_OMEGA = 1.0e-10, 1.0e-3
"""Floors of k [m^2/s^2] and omega [1/s]."""
MOST_DIFFUSION = 0.2
"""Largest viscosity times step times (1/dx^2 + 1/dy^2 + 1/dz^2) [-]: the explicit stress is stable below 1/4."""
LEAST_DISTANCE, REACH = 1.0e-5, 1.01
"""Active cells are farther from solids [m]; the log law reaches this far [cells]. Off 0 and 1, where many cells lie."""
INACTIVE, AT_WALL = -1.0, 2.0
"""Marks in the blending field (else F1, 0 to 1): cell without turbulence; cell whose omega the wall sets."""


class ModelFields(NamedTuple):
    """The fields of the model, shape (ny, nz, nx)."""

    old_k: Array
    old_omega: Array
    """k [m^2/s^2] and omega [1/s] at the begin of the step"""
    new_k: Array
    new_omega: Array
    """At first the production of k [m^2/s^3] and the source of omega [1/s^2], then the fields at the end of the step"""
    blend: Array
    """F1 [-], `INACTIVE` or `AT_WALL`"""
    viscosity: Array
    """Kinematic, molecular part included [m^2/s]"""


class Medium(NamedTuple):
    """Flow, viscosity and omega that carry, spread and destroy k and omega during a step."""

    relative: tuple[Array, Array, Array]
    """Velocity relative to the grid on full faces [m/s]"""
    area_fractions: AreaFractions
    omega: Array
    """At the begin of the step [1/s]: beta omega is the rate of destruction"""
    blend: Array
    viscosity: Array
    """The fields of `ModelFields`"""
    molecular: float
    """Molecular viscosity [m^2/s]"""
    rows: ActiveRows


class ScalarEquation(NamedTuple):
    """Constants of the equation of k or of omega."""

    sigma: tuple[float, float]
    """Diffusion in the k-omega and the k-epsilon model [-]"""
    beta: tuple[float, float]
    """Destruction [-]"""
    at_wall: bool
    """The source is the value itself where the blending is `AT_WALL`"""
    inflow: float
    """Value in undisturbed water, taken where no water is near"""
    least: float
    """Floor of the value"""


@njit(cache=True, error_model="numpy", inline="always")
def step_up(x: float) -> float:
    """Hyperbolic tangent of x >= 0 to 2e-4, by Lambert's continued fraction (without a call: the loop vectorises)."""
    x = min(x, 4.97)
    s = x * x
    return min(
        x * (135135.0 + s * (17325.0 + s * (378.0 + s))) / (135135.0 + s * (62370.0 + s * (3150.0 + 28.0 * s))), 1.0
    )


@njit(cache=True, error_model="numpy", parallel=True)
def fill_sides(q: Array, inflow: float, relative: tuple[Array, Array, Array]) -> None:
    """Set the halo of k or omega: the inflow where water enters the window, else what is inside (also at the bed)."""
    ny, nz, nx = q.shape
    east, north = nx - HALO, ny - HALO
    for k in prange(HALO, nz):
        for j in range(ny):
            low = inflow if relative[0][j, k, HALO] > 0.0 else q[j, k, HALO]
            high = inflow if relative[0][j, k, east] < 0.0 else q[j, k, east - 1]
            for n in range(HALO):
                q[j, k, n], q[j, k, east + n] = low, high
        for i in range(nx):
            low = inflow if relative[1][HALO, k, i] > 0.0 else q[HALO, k, i]
            high = inflow if relative[1][north, k, i] < 0.0 else q[north - 1, k, i]
            for n in range(HALO):
                q[n, k, i], q[north + n, k, i] = low, high
    for n in range(HALO):
        q[:, n] = q[:, HALO]


@njit(cache=True, error_model="numpy", parallel=True)
def sources(
    fields: ModelFields, velocity: tuple[Array, Array, Array], cells: WaterCells, walls: Walls, dt: float,
    molecular: float, metrics: Metrics,
) -> None:  # fmt: skip
    """Eddy viscosity, blending function F1, production of k and source of omega of every cell.

    The height above the bed is a wall distance too where the bed exerts friction.

    Parameters
    ----------
    fields : ModelFields
        `viscosity`, `blend`, `new_k` and `new_omega` (the sources) are changed.
    velocity : three arrays
        At the begin of the step [m/s].
    cells : WaterCells
    walls : Walls
    dt : float
        [s]
    molecular : float
        Molecular viscosity [m^2/s].
    metrics : Metrics
    """
    u, v, w = velocity
    bed_is_wall, blend = walls.bed_roughness >= 0.0, fields.blend
    ny, nz, nx = u.shape
    one, sy, sz = np.uintp(1), np.uintp(nz * nx), np.uintp(nx)
    uf, vf, wf, kf, of = u.ravel(), v.ravel(), w.ravel(), fields.old_k.ravel(), fields.old_omega.ravel()
    nu, f1 = fields.viscosity.ravel(), blend.ravel()
    source_k, source_o = fields.new_k.ravel(), fields.new_omega.ravel()
    is_wet, d = cells.wet.ravel(), walls.distance.ravel()
    lo, hi = cells.near
    for j in prange(HALO, ny - HALO):
        dy, two_y = metrics.dy[j], metrics.ey[j] + metrics.ey[j + 1]
        for k in range(HALO, nz - HALO):
            dz, two_z = metrics.dz[k], metrics.ez[k] + metrics.ez[k + 1]
            bed = metrics.zc[k] if bed_is_wall else 1e30
            across = 1.0 / (dy * dy) + 1.0 / (dz * dz)
            blend[j, k] = INACTIVE
            for i in range(max(lo[j, k], HALO), min(hi[j, k], nx - HALO)):
                p = np.uintp((j * nz + k) * nx + i)
                if is_wet[p] == 0 or d[p] <= LEAST_DISTANCE:
                    nu[p], f1[p] = molecular, INACTIVE
                    continue
                dx, two_x = metrics.dx[i], metrics.ex[i] + metrics.ex[i + 1]
                xx, yy, zz = (uf[p + one] - uf[p]) / dx, (vf[p + sy] - vf[p]) / dy, (wf[p + sz] - wf[p]) / dz
                uy = (uf[p + sy] + uf[p + sy + one] - uf[p - sy] - uf[p - sy + one]) / (2.0 * two_y)
                uz = (uf[p + sz] + uf[p + sz + one] - uf[p - sz] - uf[p - sz + one]) / (2.0 * two_z)
                vx = (vf[p + one] + vf[p + sy + one] - vf[p - one] - vf[p + sy - one]) / (2.0 * two_x)
                vz = (vf[p + sz] + vf[p + sy + sz] - vf[p - sz] - vf[p + sy - sz]) / (2.0 * two_z)
                wx = (wf[p + one] + wf[p + sz + one] - wf[p - one] - wf[p + sz - one]) / (2.0 * two_x)
                wy = (wf[p + sy] + wf[p + sz + sy] - wf[p - sy] - wf[p + sz - sy]) / (2.0 * two_y)
                strain2 = 2.0 * (xx * xx + yy * yy + zz * zz) + (uy + vx) ** 2 + (uz + wx) ** 2 + (vz + wy) ** 2
                ke, omega = kf[p], of[p]
                y = min(d[p], bed)
                product = (
                    (kf[p + one] - kf[p - one]) * (of[p + one] - of[p - one]) / (two_x * two_x)
                    + (kf[p + sy] - kf[p - sy]) * (of[p + sy] - of[p - sy]) / (two_y * two_y)
                    + (kf[p + sz] - kf[p - sz]) * (of[p + sz] - of[p - sz]) / (two_z * two_z)
                )
                cross = 2.0 * SIGMA_OMEGA[1] * product / omega
                turbulent = math.sqrt(ke) / (BETA_STAR * omega * y)
                viscous = 500.0 * molecular / (y * y * omega)
                argument = min(max(turbulent, viscous), 4.0 * SIGMA_OMEGA[1] * ke / (max(cross, 1e-10) * y * y))
                argument *= argument
                first = step_up(argument * argument)
                argument = max(2.0 * turbulent, viscous)
                second = step_up(argument * argument)
                eddy = A1 * ke / max(A1 * omega, math.sqrt(strain2) * second)
                most = MOST_DIFFUSION / (dt * (across + 1.0 / (dx * dx)))
                eddy = min(eddy, max(most - molecular, 0.0))
                production = min(eddy * strain2, PRODUCTION_LIMIT * BETA_STAR * ke * omega)
                alpha = ALPHA[1] + first * (ALPHA[0] - ALPHA[1])
                nu[p], f1[p] = molecular + eddy, first
                source_k[p] = production
                source_o[p] = alpha * production / max(eddy, 1e-30) + (1.0 - first) * cross


@njit(cache=True, error_model="numpy", parallel=True)
def apply_wall_law(
    fields: ModelFields, velocity: tuple[Array, Array, Array], cells: WaterCells, walls: Walls, solids: PlacedSolids,
    molecular: float, metrics: Metrics,
) -> None:  # fmt: skip
    """Production and omega in cells next to a wall with friction, from the log law.

    The cells reach far into the logarithmic layer (y+ from about 50): production u_*^3 / (0.41 y) with the very
    u_* of the shear that acts on the water, omega = sqrt(viscous^2 + log^2) with 6 nu / (0.075 y^2) and
    sqrt(k) / (0.09^(1/4) 0.41 y) (automatic wall treatment of Menter et al. 2003).

    Parameters
    ----------
    fields : ModelFields
        Changed: `new_k` (production of k) and `new_omega` (omega itself) where `blend` is then `AT_WALL`.
    velocity : three arrays
        At the begin of the step [m/s].
    cells : WaterCells
    walls : Walls
    solids : PlacedSolids
        Those of `walls`: parallel loops take no record out of another.
    molecular : float
        Molecular viscosity [m^2/s].
    metrics : Metrics
    """
    u, v, w = velocity
    old_k, new_k, new_omega, blend = fields.old_k, fields.new_k, fields.new_omega, fields.blend
    distance, nearest, bed_roughness = walls.distance, walls.nearest, walls.bed_roughness
    ny, nz, nx = u.shape
    lo, hi = cells.active
    for j in prange(HALO, ny - HALO):
        for k in range(HALO, nz - HALO):
            for i in range(max(lo[j, k], HALO), min(hi[j, k], nx - HALO)):
                if blend[j, k, i] < 0.0:
                    continue
                on_bed = k == HALO and bed_roughness >= 0.0
                d, n = distance[j, k, i], nearest[j, k, i]
                size = (metrics.dx[i] * metrics.dy[j] * metrics.dz[k]) ** (1.0 / 3.0) if d < 1.0 else 0.0
                at_solid = d < REACH * size and n >= 0 and solids.friction[n] > 0.0
                if not (on_bed or at_solid):
                    continue
                x = 0.5 * (u[j, k, i] + u[j, k, i + 1])
                y = 0.5 * (v[j, k, i] + v[j + 1, k, i])
                z = 0.5 * (w[j, k, i] + w[j, k + 1, i])
                height, shear = 0.5 * metrics.dz[k], 0.0
                if on_bed:
                    shear = friction_velocity(math.sqrt(x * x + y * y), height, molecular, bed_roughness)
                if at_solid and not (on_bed and height < d):
                    height = max(d, 0.5 * size)
                    sx, sy, sz = surface_velocity(
                        solids, n, metrics.xc[i] - solids.position[n, 0], metrics.yc[j] - solids.position[n, 1],
                        metrics.zc[k] - solids.position[n, 2],
                    )  # fmt: skip
                    x, y, z = x - sx, y - sy, z - sz
                    gx, gy, gz = distance_gradient(distance, j, k, i, metrics)
                    square = gx * gx + gy * gy + gz * gz
                    through = (x * gx + y * gy + z * gz) ** 2 / square if 1e-6 < square < 1e4 else 0.0
                    shear = math.sqrt(0.5 * solids.friction[n] * max(x * x + y * y + z * z - through, 0.0))
                new_k[j, k, i] = shear**3 / (KARMAN * height)
                viscous = 6.0 * molecular / (BETA[0] * height * height)
                log = math.sqrt(old_k[j, k, i]) / (BETA_STAR**0.25 * KARMAN * height)
                new_omega[j, k, i] = math.sqrt(viscous * viscous + log * log)
                blend[j, k, i] = AT_WALL


@njit(cache=True, error_model="numpy", inline="always")
def _face(q: Array, p: int, s: int, carry: float, courant: float) -> float:
    """Upwind value between cells p - s and p at half the time step (as in `exumob.flow.advection`)."""
    up = carry > 0.0
    low, high = q[p - s], q[p]
    middle = high - low
    outer = low - q[p - s - s] if up else q[p + s] - high
    size = min(min(2.0 * abs(outer), 2.0 * abs(middle)), 0.5 * abs(middle + outer))
    size = size if middle * outer > 0.0 else 0.0
    slope = size if (middle > 0.0) == up else -size  # towards the face, from the upwind side
    return (low if up else high) + 0.5 * (1.0 - courant) * slope


@njit(cache=True, error_model="numpy", inline="always")
def _mixed(mark: float, first: float, second: float) -> float:
    """Blend of a coefficient of the two models by F1, or 1 next to a wall."""
    return second + min(max(mark, 0.0), 1.0) * (first - second)


@njit(cache=True, error_model="numpy", inline="always")
def _into(
    q: Array, around: tuple[Array, Array, float], beta: float, p: int, s: int, own: float, sigma: tuple[float, float],
    scale: float,
) -> float:  # fmt: skip
    """Rate at which q diffuses into cell p, of diffusivity `own`, from its neighbour s.

    `around`: viscosity, F1 and molecular viscosity; `beta`: area fraction of the face between the two cells; `scale`:
    width of the cell times the distance of the centres [m^2].
    """
    nu, f1, molecular = around
    other = molecular + (nu[s] - molecular) * _mixed(f1[s], sigma[0], sigma[1])
    return (beta if f1[s] >= 0.0 else 0.0) * 0.5 * (own + other) * (q[s] - q[p]) / scale


@njit(cache=True, error_model="numpy", parallel=True)
def transport(old: Array, new: Array, medium: Medium, equation: ScalarEquation, dt: float, metrics: Metrics) -> None:
    """Advance k or omega: advection (MUSCL) and diffusion explicit, destruction implicit, so that it stays positive.

    Parameters
    ----------
    old : array
        The field at the begin of the step.
    new : array, changed
        Source at the begin, the field at the end.
    medium : Medium
    equation : ScalarEquation
    dt : float
        [s]
    metrics : Metrics
    """
    ny, nz, nx = old.shape
    one, sy, sz = np.uintp(1), np.uintp(nz * nx), np.uintp(nx)
    fx, fy, fz = medium.relative[0].ravel(), medium.relative[1].ravel(), medium.relative[2].ravel()
    bx, by, bz = medium.area_fractions.bx.ravel(), medium.area_fractions.by.ravel(), medium.area_fractions.bz.ravel()
    q, out, rates = old.ravel(), new.ravel(), medium.omega.ravel()
    f1, nu, nu0 = medium.blend.ravel(), medium.viscosity.ravel(), medium.molecular
    around = (nu, f1, nu0)
    sigma, (b1, b2), at_wall, inflow, least = equation
    lo, hi = medium.rows
    for j in prange(HALO, ny - HALO):
        dy, ey0, ey1 = metrics.dy[j], metrics.ey[j], metrics.ey[j + 1]
        for k in range(HALO, nz - HALO):
            dz, ez0, ez1 = metrics.dz[k], metrics.ez[k], metrics.ez[k + 1]
            first, end = max(lo[j, k], HALO), min(hi[j, k], nx - HALO)
            new[j, k, HALO:first] = inflow
            new[j, k, max(end, HALO) : nx - HALO] = inflow
            for i in range(first, end):
                p = np.uintp((j * nz + k) * nx + i)
                mark = f1[p]
                if mark < 0.0:
                    count, total = 0.0, 0.0
                    for s in (one, sy, sz):
                        a, b = (1.0 if f1[p - s] >= 0.0 else 0.0), (1.0 if f1[p + s] >= 0.0 else 0.0)
                        count, total = count + (a + b), total + (a * q[p - s] + b * q[p + s])
                    out[p] = total / count if count > 0.0 else inflow
                    continue
                if at_wall and mark > 1.0:
                    out[p] = max(out[p], least)
                    continue
                dx, ex0, ex1, here = metrics.dx[i], metrics.ex[i], metrics.ex[i + 1], q[p]
                low, high = fx[p], fx[p + one]
                change = low * (_face(q, p, one, low, abs(low) * dt / dx) - here) / dx
                change -= high * (_face(q, p + one, one, high, abs(high) * dt / dx) - here) / dx
                low, high = fy[p], fy[p + sy]
                across = low * (_face(q, p, sy, low, abs(low) * dt / dy) - here) / dy
                across -= high * (_face(q, p + sy, sy, high, abs(high) * dt / dy) - here) / dy
                low, high = fz[p], fz[p + sz]
                change += low * (_face(q, p, sz, low, abs(low) * dt / dz) - here) / dz
                change -= high * (_face(q, p + sz, sz, high, abs(high) * dt / dz) - here) / dz
                own = nu0 + (nu[p] - nu0) * _mixed(mark, sigma[0], sigma[1])
                change += _into(q, around, bx[p], p, p - one, own, sigma, dx * ex0)
                change += _into(q, around, bx[p + one], p, p + one, own, sigma, dx * ex1)
                across += _into(q, around, by[p], p, p - sy, own, sigma, dy * ey0)
                across += _into(q, around, by[p + sy], p, p + sy, own, sigma, dy * ey1)
                change += _into(q, around, bz[p], p, p - sz, own, sigma, dz * ez0)
                change += _into(q, around, bz[p + sz], p, p + sz, own, sigma, dz * ez1)
                source = out[p]
                value = max(here + dt * (change + across + max(source, 0.0)), least)
                value /= 1.0 + dt * (_mixed(mark, b1, b2) * rates[p] + max(-source, 0.0) / here)
                out[p] = max(value, least)
