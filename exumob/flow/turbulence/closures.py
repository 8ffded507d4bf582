"""Eddy viscosity and the stress it exerts (paper Eq. 2, the term with 1/Re_eff).

A closure is an object whose `update` fills the kinematic viscosity of every wet cell; `Smagorinsky` and `KOmegaSST` are
two, `None` means molecular viscosity alone. Fields that a closure transports belong to the solver's state: `update`
reads those at the begin of a step and writes those at its end, which the solver takes over only if the step succeeds.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, NamedTuple, Protocol

import numpy as np
from numba import prange

from exumob.flow.active_rows import WaterCells
from exumob.flow.area_fractions import AreaFractions
from exumob.flow.grid import HALO, Metrics
from exumob.flow.turbulence import komega
from exumob.flow.turbulence.wall import Walls
from exumob.support.arrays import Array
from exumob.support.declared import Declared
from exumob.support.kernels import njit
from exumob.support.quantities import Quantity

MOLECULAR_VISCOSITY = 1.0e-6
"""Kinematic viscosity of water at 20 degrees Celsius [m^2/s]."""


class ClosureFields(NamedTuple):
    """The fields that a closure fills."""

    viscosity: Array
    """Kinematic, molecular part included, of every cell [m^2/s]; changed"""
    old: Array
    """The closure's own fields at the begin of the step, shape (number, ny, nz, nx)"""
    new: Array
    """... and at its end; changed"""


class WaterMotion(NamedTuple):
    """The water that a closure looks at, at the begin of a step."""

    velocity: tuple[Array, Array, Array]
    """[m/s]"""
    relative: tuple[Array, Array, Array]
    """Velocity relative to the grid on full faces [m/s]"""
    cells: WaterCells


class Closure(Protocol):
    """A turbulence model."""

    @property
    def fields(self) -> tuple[str, ...]:
        """Names of the fields per cell that belong to the solver's state."""

    def start(self, fields: Array, molecular: float) -> None:
        """Set these fields, shape (number, ny, nz, nx), to those of undisturbed water; molecular viscosity [m^2/s]."""

    def update(
        self, fields: ClosureFields, motion: WaterMotion, walls: Walls, dt: float, molecular: float, metrics: Metrics
    ) -> None:
        """Fill the kinematic viscosity, molecular part included, of every cell [m^2/s], and advance the fields.

        Parameters
        ----------
        fields : ClosureFields
        motion : WaterMotion
        walls : Walls
        dt : float
            [s]
        molecular : float
            [m^2/s]
        metrics : Metrics
        """


@dataclass(frozen=True)
class Smagorinsky(Declared):
    """Smagorinsky (1963): nu_t = (C min(cell size, wall distance * 0.41 / C))^2 |S|.

    C = 0.1 suits shear flows (Deardorff 1970), 0.17 isotropic turbulence (Lilly 1967). The bound by the distance to a
    solid is Prandtl's mixing length (van Driest damping is not resolved at these cells).
    """

    constant: Annotated[float, Quantity("1", at_least=0.0, at_most=0.3)] = 0.1
    """C [-]"""

    @property
    def fields(self) -> tuple[str, ...]:
        """None; see `Closure`."""
        return ()

    def start(self, fields: Array, molecular: float) -> None:
        """Nothing to set; see `Closure`."""

    def update(
        self, fields: ClosureFields, motion: WaterMotion, walls: Walls, dt: float, molecular: float, metrics: Metrics
    ) -> None:
        """Fill the viscosity; see `Closure`."""
        smagorinsky(fields.viscosity, motion.velocity, motion.cells, walls.distance, self.constant, molecular, metrics)


@dataclass(frozen=True)
class KOmegaSST(Declared):
    """k-omega shear-stress transport (Menter, Kuntz & Langtry 2003), an unsteady RANS model with wall functions.

    Production of k is limited to ten times its destruction. Walls: solids with friction, and the bed if
    `FlowSettings.bed_roughness` is given; the first cells take production and omega from the log law with the shear
    that acts on the water (`exumob.flow.turbulence.komega.apply_wall_law`). The distance to solids is known within
    about six cells; farther off F1 = F2 = 0. At the free surface the gradient is zero: no damping there. The eddy
    viscosity is bounded to what an explicit stress bears, 0.2 / (dt (1/dx^2 + 1/dy^2 + 1/dz^2)).
    """

    intensity: Annotated[float, Quantity("1", at_least=1e-4, at_most=0.5)] = 0.05
    """Turbulence intensity of the undisturbed water, sqrt(2 k / 3) / speed [-]. Five per cent and a viscosity ratio of
    ten are the "medium" choice in use for outer flows; flumes and rivers show 3 to 10 %"""
    speed: Annotated[float, Quantity("m/s", at_least=1e-3, at_most=100.0)] = 1.0
    """To which the intensity refers [m/s]; not that of the grid, so that the model is Galilean invariant"""
    viscosity_ratio: Annotated[float, Quantity("1", at_least=1e-3, at_most=1e5)] = 10.0
    """Eddy over molecular viscosity of the undisturbed water [-]; sets omega"""

    @property
    def fields(self) -> tuple[str, ...]:
        """Names: k [m^2/s^2], omega [1/s], and the blending of the last step; see `Closure`."""
        return "k", "omega", "blend"

    def inflow(self, molecular: float) -> tuple[float, float]:
        """Values of k [m^2/s^2] and omega [1/s] in undisturbed water."""
        k = 1.5 * (self.intensity * self.speed) ** 2
        return k, k / (self.viscosity_ratio * max(molecular, 1e-12))

    def start(self, fields: Array, molecular: float) -> None:
        """Fill with undisturbed water; see `Closure`."""
        fields[0], fields[1] = self.inflow(molecular)
        fields[2] = komega.INACTIVE

    def update(
        self, fields: ClosureFields, motion: WaterMotion, walls: Walls, dt: float, molecular: float, metrics: Metrics
    ) -> None:
        """Advance k and omega and fill the viscosity; see `Closure`."""
        (old_k, old_omega, _), (new_k, new_omega, blend) = fields.old, fields.new
        inflow_k, inflow_omega = self.inflow(molecular)
        komega.fill_sides(old_k, inflow_k, motion.relative)
        komega.fill_sides(old_omega, inflow_omega, motion.relative)  # the blending needs no halo
        model = komega.ModelFields(old_k, old_omega, new_k, new_omega, blend, fields.viscosity)
        komega.sources(model, motion.velocity, motion.cells, walls, dt, molecular, metrics)
        komega.apply_wall_law(model, motion.velocity, motion.cells, walls, walls.solids, molecular, metrics)
        medium = komega.Medium(
            motion.relative, walls.area_fractions, old_omega, blend, fields.viscosity, molecular, motion.cells.near
        )
        of_k = komega.ScalarEquation(
            komega.SIGMA_K, (komega.BETA_STAR, komega.BETA_STAR), False, inflow_k, komega.LEAST_K
        )
        of_omega = komega.ScalarEquation(komega.SIGMA_OMEGA, komega.BETA, True, inflow_omega, komega.LEAST_OMEGA)
        komega.transport(old_k, new_k, medium, of_k, dt, metrics)
        komega.transport(old_omega, new_omega, medium, of_omega, dt, metrics)


@njit(cache=True, error_model="numpy", parallel=True)
def smagorinsky(
    viscosity: Array, velocity: tuple[Array, Array, Array], cells: WaterCells, distance: Array, constant: float,
    molecular: float, metrics: Metrics,
) -> None:  # fmt: skip
    """Kinematic viscosity of every cell [m^2/s]."""
    ny, nz, nx = viscosity.shape
    one, sy, sz = np.uintp(1), np.uintp(nz * nx), np.uintp(nx)
    uf, vf, wf = velocity[0].ravel(), velocity[1].ravel(), velocity[2].ravel()
    is_wet, d, nu = cells.wet.ravel(), distance.ravel(), viscosity.ravel()
    sizes = constant * np.cbrt(metrics.dx)
    rdx, rex = 1.0 / metrics.dx, 0.5 / (metrics.ex[:nx] + np.append(metrics.ex[1:nx], metrics.ex[nx - 1]))
    lo, hi = cells.active
    for j in prange(HALO, ny - HALO):
        rdy, rey = 1.0 / metrics.dy[j], 0.5 / (metrics.ey[j] + metrics.ey[j + 1])
        for k in range(HALO, nz - HALO):
            rdz, rez = 1.0 / metrics.dz[k], 0.5 / (metrics.ez[k] + metrics.ez[k + 1])
            size = (metrics.dy[j] * metrics.dz[k]) ** (1.0 / 3.0)
            start = (j * nz + k) * nx
            for i in range(max(lo[j, k], HALO), min(hi[j, k], nx - HALO)):
                p, m = np.uintp(start + i), np.uintp(i)
                xx = (uf[p + one] - uf[p]) * rdx[m]
                yy = (vf[p + sy] - vf[p]) * rdy
                zz = (wf[p + sz] - wf[p]) * rdz
                xy = (uf[p + sy] + uf[p + sy + one] - uf[p - sy] - uf[p - sy + one]) * rey
                xy += (vf[p + one] + vf[p + one + sy] - vf[p - one] - vf[p - one + sy]) * rex[m]
                xz = (uf[p + sz] + uf[p + sz + one] - uf[p - sz] - uf[p - sz + one]) * rez
                xz += (wf[p + one] + wf[p + one + sz] - wf[p - one] - wf[p - one + sz]) * rex[m]
                yz = (vf[p + sz] + vf[p + sz + sy] - vf[p - sz] - vf[p - sz + sy]) * rez
                yz += (wf[p + sy] + wf[p + sy + sz] - wf[p - sy] - wf[p - sy + sz]) * rey
                strain = np.sqrt(2.0 * (xx * xx + yy * yy + zz * zz) + xy * xy + xz * xz + yz * yz)
                length, wall = size * sizes[m], 0.41 * d[p]
                length = length if length < wall else wall
                length = length if is_wet[p] != 0 and wall > 0.0 else 0.0
                nu[p] = molecular + length * length * strain


@njit(cache=True, error_model="numpy", parallel=True)
def add_stress(
    out: Array, viscosity: Array, velocity: tuple[Array, Array, Array], cells: WaterCells,
    area_fractions: AreaFractions, axis: int, dt: float, metrics: Metrics,
) -> None:  # fmt: skip
    """Add dt times the divergence of nu (grad u + grad u^T) to one velocity component on wet, open faces."""
    ny, nz, nx = out.shape
    x, y, z = 1, nz * nx, nx
    m = metrics
    if axis == 0:  # the component, and its two directions across: a is x unless x is its own
        own, a, b = x, y, z
    elif axis == 1:
        own, a, b = y, x, z
    else:
        own, a, b = z, x, y
    q, qa, qb = velocity[axis].ravel(), velocity[1 if axis == 0 else 0].ravel(), velocity[1 if axis == 2 else 2].ravel()
    nu, result, is_wet, o = viscosity.ravel(), out.ravel(), cells.wet.ravel(), area_fractions
    beta = (o.bx if axis == 0 else (o.by if axis == 1 else o.bz)).ravel()
    so, sa, sb = np.uintp(own), np.uintp(a), np.uintp(b)
    lo, hi = cells.active
    ex_high = np.append(1.0 / m.ex[1:nx], 1.0 / m.ex[nx - 1])
    dx_low = np.append(1.0 / m.dx[0], 1.0 / m.dx[: nx - 1])
    for j in prange(HALO, ny - HALO):
        row = np.empty((6, nx))
        own_high, own_low, own_mid, a_high, a_low, a_mid = row[0], row[1], row[2], row[3], row[4], row[5]
        if axis == 0:
            own_high[:], own_low[:], own_mid[:] = 1.0 / m.dx, dx_low, 1.0 / m.ex[:nx]
            a_high[:], a_low[:], a_mid[:] = 1.0 / m.ey[j + 1], 1.0 / m.ey[j], 1.0 / m.dy[j]
        else:
            a_high[:], a_low[:], a_mid[:] = ex_high, 1.0 / m.ex[:nx], 1.0 / m.dx
        if axis == 1:
            own_high[:], own_low[:], own_mid[:] = 1.0 / m.dy[j], 1.0 / m.dy[j - 1], 1.0 / m.ey[j]
        for k in range(HALO, nz - HALO):
            first, last = max(lo[j, k], HALO), min(hi[j, k], nx - HALO)
            if first >= last:
                continue
            if axis == 2:
                own_high[:], own_low[:], own_mid[:] = 1.0 / m.dz[k], 1.0 / m.dz[k - 1], 1.0 / m.ez[k]
                b_high, b_low, b_mid = 1.0 / m.ey[j + 1], 1.0 / m.ey[j], 1.0 / m.dy[j]
            else:
                b_high, b_low, b_mid = 1.0 / m.ez[k + 1], 1.0 / m.ez[k], 1.0 / m.dz[k]
            start = (j * nz + k) * nx
            for i in range(first, last):
                p, n = np.uintp(start + i), np.uintp(i)
                here, to_own, pair = q[p], own_mid[n], nu[p] + nu[p - so]
                rate = 2.0 * to_own * (
                    nu[p] * (q[p + so] - here) * own_high[n] - nu[p - so] * (here - q[p - so]) * own_low[n]
                )  # fmt: skip
                high = (pair + nu[p + sa] + nu[p + sa - so]) * (
                    (q[p + sa] - here) * a_high[n] + (qa[p + sa] - qa[p + sa - so]) * to_own
                )  # fmt: skip
                low = (pair + nu[p - sa] + nu[p - sa - so]) * (
                    (here - q[p - sa]) * a_low[n] + (qa[p] - qa[p - so]) * to_own
                )  # fmt: skip
                rate += 0.25 * (high - low) * a_mid[n]
                high = (pair + nu[p + sb] + nu[p + sb - so]) * (
                    (q[p + sb] - here) * b_high + (qb[p + sb] - qb[p + sb - so]) * to_own
                )  # fmt: skip
                low = (pair + nu[p - sb] + nu[p - sb - so]) * (
                    (here - q[p - sb]) * b_low + (qb[p] - qb[p - so]) * to_own
                )  # fmt: skip
                rate += 0.25 * (high - low) * b_mid
                active = (is_wet[p] | is_wet[p - so]) != 0 and beta[p] > 0.0
                result[p] += dt * rate if active else 0.0
