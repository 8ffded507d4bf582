"""Eddy viscosity and the stress it exerts (paper Eq. 2, the term with 1/Re_eff).

A closure is an object with `update(viscosity, u, v, w, ...)` that fills the kinematic viscosity of every wet cell;
`Smagorinsky` is one, `None` means molecular viscosity alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from exumob.checks import require_within
from exumob.flow.grid import HALO, Metrics
from exumob.flow.spans import Spans
from exumob.states import Array

MOLECULAR_VISCOSITY = 1.0e-6
"""Kinematic viscosity of water at 20 degrees Celsius [m^2/s]."""


class Closure(Protocol):
    """A turbulence model."""

    def update(
        self, viscosity: Array, u: Array, v: Array, w: Array, wet: NDArray[np.uint8], distance: Array, spans: Spans,
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
        spans : Spans
            Of the wet cells, one cell wider.
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
        self, viscosity: Array, u: Array, v: Array, w: Array, wet: NDArray[np.uint8], distance: Array, spans: Spans,
        dt: float, molecular: float, metrics: Metrics,
    ) -> None:  # fmt: skip
        """Fill the viscosity; see `Closure`."""
        smagorinsky(viscosity, u, v, w, wet, distance, spans, self.constant, molecular, metrics)


@njit(cache=True, error_model="numpy", parallel=True)
def smagorinsky(
    viscosity: Array, u: Array, v: Array, w: Array, wet: NDArray[np.uint8], distance: Array, spans: Spans,
    constant: float, molecular: float, metrics: Metrics,
) -> None:  # fmt: skip
    """Kinematic viscosity of every cell [m^2/s]."""
    ny, nz, nx = u.shape
    one, sy, sz = np.uintp(1), np.uintp(nz * nx), np.uintp(nx)
    uf, vf, wf, is_wet, d, nu = u.ravel(), v.ravel(), w.ravel(), wet.ravel(), distance.ravel(), viscosity.ravel()
    sizes = constant * np.cbrt(metrics.dx)
    rdx, rex = 1.0 / metrics.dx, 0.5 / (metrics.ex[:nx] + np.append(metrics.ex[1:nx], metrics.ex[nx - 1]))
    lo, hi = spans
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
    out: Array, viscosity: Array, velocity: tuple[Array, Array, Array], wet: NDArray[np.uint8], open_faces: Array,
    axis: int, dt: float, spans: Spans, metrics: Metrics,
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
    nu, result, is_wet, beta = viscosity.ravel(), out.ravel(), wet.ravel(), open_faces.ravel()
    so, sa, sb = np.uintp(own), np.uintp(a), np.uintp(b)
    lo, hi = spans
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
