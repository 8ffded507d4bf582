"""Eddy viscosity and the stress it exerts (paper Eq. 2, the term with 1/Re_eff).

A closure is an object with `update(viscosity, u, v, w, ...)` that fills the kinematic viscosity of every wet cell;
`Smagorinsky` is one, `None` means molecular viscosity alone.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from exumob.checks import require_within
from exumob.flow.grid import HALO, Metrics
from exumob.states import Array

MOLECULAR_VISCOSITY = 1.0e-6
"""Kinematic viscosity of water at 20 degrees Celsius [m^2/s]."""


class Closure(Protocol):
    """A turbulence model."""

    def update(
        self, viscosity: Array, u: Array, v: Array, w: Array, wet: NDArray[np.uint8], distance: Array, top: int,
        dt: float, molecular: float, metrics: Metrics,
    ) -> None:  # fmt: skip
        """Fill the kinematic viscosity, molecular part included, of every cell [m^2/s].

        Parameters
        ----------
        viscosity : array, changed
        u, v, w : array
            Velocity [m/s].
        wet : array
            Cells at least half full.
        distance : array
            Signed distance to the nearest solid [m].
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

    def update(
        self, viscosity: Array, u: Array, v: Array, w: Array, wet: NDArray[np.uint8], distance: Array, top: int,
        dt: float, molecular: float, metrics: Metrics,
    ) -> None:  # fmt: skip
        """Fill the viscosity; see `Closure`."""
        smagorinsky(viscosity, u, v, w, wet, distance, top, self.constant, molecular, metrics)


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
