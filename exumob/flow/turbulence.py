"""Eddy viscosity and the stress it exerts (paper Eq. 2, the term with 1/Re_eff).

A closure is an object whose `update` fills the kinematic viscosity of every wet cell; `Smagorinsky` and `KOmegaSST` are
two, `None` means molecular viscosity alone. Fields that a closure transports belong to the solver's state: `update`
reads those at the begin of a step and writes those at its end, which the solver takes over only if the step succeeds.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from exumob.checks import require_positive, require_within
from exumob.flow import komega
from exumob.flow.body import Openness
from exumob.flow.grid import HALO, Metrics
from exumob.states import Array

MOLECULAR_VISCOSITY = 1.0e-6
"""Kinematic viscosity of water at 20 degrees Celsius [m^2/s]."""


class Walls(NamedTuple):
    """What bounds the water during a step: openness, and the motion of n surfaces in grid axes."""

    openness: Openness
    position: Array
    """Origins of the solids [m], shape (n, 3)"""
    velocity: Array
    """Of the origins [m/s], shape (n, 3)"""
    angular_velocity: Array
    """Of the surfaces, spin included [rad/s], shape (n, 3)"""
    friction: Array
    """Skin-friction coefficients that act on the water [-], shape (n,)"""
    bed_roughness: float
    """Equivalent sand roughness of the bed [m]; negative: the bed slips"""


class Closure(Protocol):
    """A turbulence model."""

    @property
    def fields(self) -> tuple[str, ...]:
        """Names of the fields per cell that belong to the solver's state."""

    def start(self, fields: Array, molecular: float) -> None:
        """Set these fields, shape (number, ny, nz, nx), to those of undisturbed water; molecular viscosity [m^2/s]."""

    def update(
        self, viscosity: Array, old: Array, new: Array, u: Array, v: Array, w: Array,
        flow: tuple[Array, Array, Array], wet: NDArray[np.uint8], walls: Walls, top: int, dt: float, molecular: float,
        metrics: Metrics,
    ) -> None:  # fmt: skip
        """Fill the kinematic viscosity, molecular part included, of every cell [m^2/s], and advance the fields.

        Parameters
        ----------
        viscosity : array, changed
        old, new : array, shape (number of fields, ny, nz, nx)
            Fields at the begin and, changed, at the end of the step.
        u, v, w : array
            Velocity at the begin [m/s].
        flow : three arrays
            Velocity relative to the grid on full faces [m/s].
        wet : array
            Cells at least half full.
        walls : Walls
        top : int
            Highest layer with water.
        dt : float
            [s]
        molecular : float
            [m^2/s]
        metrics : Metrics
        """


@dataclass(frozen=True)
class Smagorinsky:
    """Smagorinsky (1963): nu_t = (C min(cell size, wall distance * 0.41 / C))^2 |S|.

    C = 0.1 suits shear flows (Deardorff 1970), 0.17 isotropic turbulence (Lilly 1967). The bound by the distance to a
    solid is Prandtl's mixing length (van Driest damping is not resolved at these cells).
    """

    constant: float = 0.1

    def __post_init__(self) -> None:
        require_within("Smagorinsky", 0.0, 0.3, constant=self.constant)

    @property
    def fields(self) -> tuple[str, ...]:
        """None; see `Closure`."""
        return ()

    def start(self, fields: Array, molecular: float) -> None:
        """Nothing to set; see `Closure`."""

    def update(
        self, viscosity: Array, old: Array, new: Array, u: Array, v: Array, w: Array,
        flow: tuple[Array, Array, Array], wet: NDArray[np.uint8], walls: Walls, top: int, dt: float, molecular: float,
        metrics: Metrics,
    ) -> None:  # fmt: skip
        """Fill the viscosity; see `Closure`."""
        smagorinsky(viscosity, u, v, w, wet, walls.openness.distance, top, self.constant, molecular, metrics)


@dataclass(frozen=True)
class KOmegaSST:
    """k-omega shear-stress transport (Menter, Kuntz & Langtry 2003), an unsteady RANS model with wall functions.

    Production of k is limited to ten times its destruction. Walls: solids with friction, and the bed if
    `FlowSettings.bed_roughness` is given; the first cells take production and omega from the log law with the shear
    that acts on the water (`exumob.flow.komega.walls`). The distance to solids is known within about six cells; farther
    off F1 = F2 = 0. At the free surface the gradient is zero: no damping there. The eddy viscosity is bounded to what
    an explicit stress bears, 0.2 / (dt (1/dx^2 + 1/dy^2 + 1/dz^2)).

    Parameters
    ----------
    intensity : float
        Turbulence intensity of the undisturbed water, sqrt(2 k / 3) / speed [-]. Five per cent and a viscosity ratio
        of ten are the "medium" choice in use for outer flows; flumes and rivers show 3 to 10 %.
    speed : float
        To which the intensity refers [m/s]; not that of the grid, so that the model is Galilean invariant.
    viscosity_ratio : float
        Eddy over molecular viscosity of the undisturbed water [-]; sets omega.
    """

    intensity: float = 0.05
    speed: float = 1.0
    viscosity_ratio: float = 10.0

    def __post_init__(self) -> None:
        require_within("KOmegaSST", 1.0e-4, 0.5, intensity=self.intensity)
        require_positive("KOmegaSST", speed=self.speed)
        require_within("KOmegaSST", 1.0e-3, 1.0e5, viscosity_ratio=self.viscosity_ratio)

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
        self, viscosity: Array, old: Array, new: Array, u: Array, v: Array, w: Array,
        flow: tuple[Array, Array, Array], wet: NDArray[np.uint8], walls: Walls, top: int, dt: float, molecular: float,
        metrics: Metrics,
    ) -> None:  # fmt: skip
        """Advance k and omega and fill the viscosity; see `Closure`."""
        o = walls.openness
        (old_k, old_omega, _), (new_k, new_omega, blend) = old, new
        inflow = self.inflow(molecular)
        for field, value in zip(old, inflow, strict=False):  # the blending needs no halo
            komega.fill_sides(field, value, flow, top)
        komega.sources(
            viscosity, old_k, old_omega, new_k, new_omega, blend, u, v, w, wet, o.distance, walls.bed_roughness >= 0.0,
            top, dt, molecular, metrics,
        )  # fmt: skip
        komega.walls(
            old_k, new_k, new_omega, blend, u, v, w, o.distance, o.nearest, *walls[1:], top, molecular, metrics
        )
        carried = (blend, viscosity, flow, (o.bx, o.by, o.bz))
        komega.transport(
            old_k, new_k, old_omega, *carried, komega.SIGMA_K, (komega.BETA_STAR, komega.BETA_STAR), False, inflow[0],
            komega.LEAST_K, top, dt, molecular, metrics,
        )  # fmt: skip
        komega.transport(
            old_omega, new_omega, old_omega, *carried, komega.SIGMA_OMEGA, komega.BETA, True, inflow[1],
            komega.LEAST_OMEGA, top, dt, molecular, metrics,
        )  # fmt: skip


@njit(cache=True, error_model="numpy", parallel=True)
def smagorinsky(
    viscosity: Array, u: Array, v: Array, w: Array, wet: NDArray[np.uint8], distance: Array, top: int, constant: float,
    molecular: float, metrics: Metrics,
) -> None:  # fmt: skip
    """Kinematic viscosity of every cell [m^2/s]."""
    ny, nz, nx = u.shape
    for j in prange(HALO, ny - HALO):
        dy, two_y = metrics.dy[j], metrics.ey[j] + metrics.ey[j + 1]
        for k in range(HALO, min(top + 2, nz - HALO)):
            dz, two_z = metrics.dz[k], metrics.ez[k] + metrics.ez[k + 1]
            for i in range(HALO, nx - HALO):
                if wet[j, k, i] == 0 or distance[j, k, i] <= 0.0:
                    viscosity[j, k, i] = molecular
                    continue
                dx, two_x = metrics.dx[i], metrics.ex[i] + metrics.ex[i + 1]
                xx = (u[j, k, i + 1] - u[j, k, i]) / dx
                yy = (v[j + 1, k, i] - v[j, k, i]) / dy
                zz = (w[j, k + 1, i] - w[j, k, i]) / dz
                uy = (u[j + 1, k, i] + u[j + 1, k, i + 1] - u[j - 1, k, i] - u[j - 1, k, i + 1]) / (2.0 * two_y)
                uz = (u[j, k + 1, i] + u[j, k + 1, i + 1] - u[j, k - 1, i] - u[j, k - 1, i + 1]) / (2.0 * two_z)
                vx = (v[j, k, i + 1] + v[j + 1, k, i + 1] - v[j, k, i - 1] - v[j + 1, k, i - 1]) / (2.0 * two_x)
                vz = (v[j, k + 1, i] + v[j + 1, k + 1, i] - v[j, k - 1, i] - v[j + 1, k - 1, i]) / (2.0 * two_z)
                wx = (w[j, k, i + 1] + w[j, k + 1, i + 1] - w[j, k, i - 1] - w[j, k + 1, i - 1]) / (2.0 * two_x)
                wy = (w[j + 1, k, i] + w[j + 1, k + 1, i] - w[j - 1, k, i] - w[j - 1, k + 1, i]) / (2.0 * two_y)
                strain = math.sqrt(
                    2.0 * (xx * xx + yy * yy + zz * zz) + (uy + vx) ** 2 + (uz + wx) ** 2 + (vz + wy) ** 2
                )
                length = min(constant * (dx * dy * dz) ** (1.0 / 3.0), 0.41 * distance[j, k, i])
                viscosity[j, k, i] = molecular + length * length * strain


@njit(cache=True, error_model="numpy", parallel=True)
def add_stress(
    out: Array, viscosity: Array, u: Array, v: Array, w: Array, wet: NDArray[np.uint8], open_faces: Array, axis: int,
    dt: float, top: int, metrics: Metrics,
) -> None:  # fmt: skip
    """Add dt times the divergence of nu (grad u + grad u^T) to one velocity component on wet, open faces."""
    ny, nz, nx = u.shape
    one, sy, sz = np.uintp(1), np.uintp(nz * nx), np.uintp(nx)
    uf, vf, wf, nu = u.ravel(), v.ravel(), w.ravel(), viscosity.ravel()
    result, is_wet, beta = out.ravel(), wet.ravel(), open_faces.ravel()
    m = metrics
    if axis == 0:  # the component, and its two directions across: stride, other component, widths, distances
        own, q, own_d, own_e = one, uf, m.dx, m.ex
        sa, other_a, da, ea, sb, other_b, db, eb = sy, vf, m.dy, m.ey, sz, wf, m.dz, m.ez
    elif axis == 1:
        own, q, own_d, own_e = sy, vf, m.dy, m.ey
        sa, other_a, da, ea, sb, other_b, db, eb = one, uf, m.dx, m.ex, sz, wf, m.dz, m.ez
    else:
        own, q, own_d, own_e = sz, wf, m.dz, m.ez
        sa, other_a, da, ea, sb, other_b, db, eb = one, uf, m.dx, m.ex, sy, vf, m.dy, m.ey
    for j in prange(HALO, ny - HALO + 1):
        for k in range(HALO, min(top + 1, nz - HALO) + 1):
            for i in range(HALO, nx - HALO + 1):
                p = np.uintp((j * nz + k) * nx + i)
                if not ((is_wet[p] or is_wet[p - own]) and beta[p] > 0.0):
                    continue
                o = i if axis == 0 else (j if axis == 1 else k)
                a = j if axis == 0 else i
                b = j if axis == 2 else k
                high = 2.0 * nu[p] * (q[p + own] - q[p]) / own_d[o]
                low = 2.0 * nu[p - own] * (q[p] - q[p - own]) / own_d[o - 1]
                rate = (high - low) / own_e[o]
                pair, to_own = nu[p] + nu[p - own], 1.0 / own_e[o]
                mean = 0.25 * (pair + nu[p + sa] + nu[p + sa - own])
                high = mean * ((q[p + sa] - q[p]) / ea[a + 1] + (other_a[p + sa] - other_a[p + sa - own]) * to_own)
                mean = 0.25 * (pair + nu[p - sa] + nu[p - sa - own])
                low = mean * ((q[p] - q[p - sa]) / ea[a] + (other_a[p] - other_a[p - own]) * to_own)
                rate += (high - low) / da[a]
                mean = 0.25 * (pair + nu[p + sb] + nu[p + sb - own])
                high = mean * ((q[p + sb] - q[p]) / eb[b + 1] + (other_b[p + sb] - other_b[p + sb - own]) * to_own)
                mean = 0.25 * (pair + nu[p - sb] + nu[p - sb - own])
                low = mean * ((q[p] - q[p - sb]) / eb[b] + (other_b[p] - other_b[p - own]) * to_own)
                result[p] += dt * (rate + (high - low) / db[b])
