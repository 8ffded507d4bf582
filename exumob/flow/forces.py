"""Loads on the solids: pressure on partly open faces, and wall shear. No surface mesh is needed."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from exumob.flow.grid import HALO, Metrics
from exumob.flow.solids import AreaFractions
from exumob.support.arrays import Array
from exumob.support.constants import GRAVITY


@njit(cache=True, error_model="numpy", inline="always")
def _add(load: Array, x: float, y: float, z: float, fx: float, fy: float, fz: float) -> None:
    """Add a force at an arm to a load (force, moment)."""
    load[0] += fx
    load[1] += fy
    load[2] += fz
    load[3] += y * fz - z * fy
    load[4] += z * fx - x * fz
    load[5] += x * fy - y * fx


@njit(cache=True, error_model="numpy")
def pressure_loads(
    phi: Array, fraction: Array, wet: NDArray[np.uint8], solids: AreaFractions, regions: NDArray[np.int64],
    position: Array, density: float, level: float, dt: float, soil: bool, bed: Array, metrics: Metrics,
    loads: Array,
) -> None:  # fmt: skip
    """Sum over cells of pressure times what the low face is more open than the high face, per solid.

    The piezometric part acts on the faces as the flow sees them, the weight of still water on those whose edges are not
    sharpened: it is then free of the half cell by which sharpening moves walls at edges.

    Cells below the bed, those of the halo below the window too, hold saturated soil with hydrostatic pressure, so that
    a wheel sunk into it floats as Archimedes says.

    Parameters
    ----------
    phi : array
        dt times piezometric pressure over density [m^2/s].
    solids : AreaFractions
        Of the solids alone, without a given bed.
    regions : array of int, shape (n, 6)
        Index boxes of the solids.
    position : array, shape (n, 3)
        Their origins, grid axes [m].
    soil : bool
        Whether the pressure goes on below the bed.
    bed : array, shape (ny, nx)
        Height of the bed [m].
    loads : array, shape (n, 6), changed
        Force [N] and moment about the origins [N m], grid axes.
    """
    ny, nz, nx = phi.shape
    for n in range(len(regions)):
        for j in range(max(regions[n, 0], HALO), min(regions[n, 1], ny - HALO)):
            for k in range(max(regions[n, 2], 0 if soil else HALO), min(regions[n, 3], nz - HALO)):
                for i in range(max(regions[n, 4], HALO), min(regions[n, 5], nx - HALO)):
                    if solids.nearest[j, k, i] != n:
                        continue
                    x_area, y_area = metrics.dy[j] * metrics.dz[k], metrics.dx[i] * metrics.dz[k]
                    z_area = metrics.dx[i] * metrics.dy[j]
                    ax = (solids.ax[j, k, i + 1] - solids.ax[j, k, i]) * x_area
                    ay = (solids.ay[j + 1, k, i] - solids.ay[j, k, i]) * y_area
                    az = (solids.az[j, k + 1, i] - solids.az[j, k, i]) * z_area
                    bx = (solids.bx[j, k, i + 1] - solids.bx[j, k, i]) * x_area
                    by = (solids.by[j + 1, k, i] - solids.by[j, k, i]) * y_area
                    bz = (solids.bz[j, k + 1, i] - solids.bz[j, k, i]) * z_area
                    if ax == 0.0 and ay == 0.0 and az == 0.0 and bx == 0.0 and by == 0.0 and bz == 0.0:
                        continue
                    z = metrics.zc[k]
                    weight, flow = density * GRAVITY * (level - z), 0.0  # of still water, and what moves it
                    above = min(max((metrics.zf[k + 1] - bed[j, i]) / metrics.dz[k], 0.0), 1.0)
                    if above < 0.5 and k >= HALO:
                        weight = density * GRAVITY * _still_pressure(level, z, metrics.dz[k])
                        flow = density * phi[j, k, i] / dt if wet[j, k, i] else 0.0
                    elif k >= HALO:
                        if wet[j, k, i]:
                            flow = density * phi[j, k, i] / dt
                            if wet[j, k + 1, i] == 0 and fraction[j, k, i] < 1.0:
                                weight += surface_excess(fraction[j, k, i]) * density * GRAVITY * metrics.dz[k]
                        elif fraction[j, k, i] > 0.0 and wet[j, k - 1, i]:
                            weight = surface_excess(fraction[j, k, i]) * density * GRAVITY * metrics.dz[k]
                        else:
                            continue
                    if k >= HALO and above < 1.0:
                        flow *= above
                        weight *= 1.0 if soil else above
                    _add(
                        loads[n], metrics.xc[i] - position[n, 0], metrics.yc[j] - position[n, 1], z - position[n, 2],
                        -weight * ax - flow * bx, -weight * ay - flow * by, -weight * az - flow * bz,
                    )  # fmt: skip


@njit(cache=True, error_model="numpy", inline="always")
def _still_pressure(level: float, z: float, dz: float) -> float:
    """Mean head [m] of still water at `level` over a cell at z, `dz` high [m]."""
    c = min(max((level - z) / dz + 0.5, 0.0), 1.0)
    return max(level - z, 0.0) if c == 1.0 else 0.5 * c * c * dz


@njit(cache=True, error_model="numpy", inline="always")
def surface_excess(c: float) -> float:
    """Mean over a cell of the pressure below a level inside it, less the value at the centre (not below 0)."""
    return 0.5 * c * c - max(c - 0.5, 0.0)


@njit(cache=True, error_model="numpy")
def wall_shear(
    du: tuple[Array, Array, Array], u: Array, v: Array, w: Array, fraction: Array, wet: NDArray[np.uint8],
    solids: AreaFractions, regions: NDArray[np.int64], position: Array, velocity: Array, angular_velocity: Array,
    spin_velocity: Array, friction: Array, density: float, dt: float, metrics: Metrics, loads: Array,
) -> None:  # fmt: skip
    """Quadratic wall friction, tau = rho C_f |u_t| u_t / 2 on the speed u_t along the (spinning) wall.

    Parameters
    ----------
    du : three arrays, changed
        Change of the velocity is added here, so that no cell sees what its neighbour has just received [m/s].
    u, v, w : array
        Velocity [m/s].
    spin_velocity : array, shape (n, 3)
        Angular velocity of the surface relative to the solid's body, grid axes [rad/s].
    friction : array, shape (n,)
        C_f [-].
    loads : array, shape (n, 6), changed
        Force [N] and moment about the origins [N m] on the solids, grid axes.
    """
    ny, nz, nx = u.shape
    for n in range(len(regions)):
        if friction[n] <= 0.0:
            continue
        for j in range(max(regions[n, 0], HALO), min(regions[n, 1], ny - HALO)):
            for k in range(max(regions[n, 2], HALO), min(regions[n, 3], nz - HALO)):
                for i in range(max(regions[n, 4], HALO), min(regions[n, 5], nx - HALO)):
                    if solids.nearest[j, k, i] != n or wet[j, k, i] == 0:
                        continue
                    dx, dy, dz = metrics.dx[i], metrics.dy[j], metrics.dz[k]
                    b0, b1 = solids.bx[j, k, i], solids.bx[j, k, i + 1]
                    b2, b3 = solids.by[j, k, i], solids.by[j + 1, k, i]
                    b4, b5 = solids.bz[j, k, i], solids.bz[j, k + 1, i]
                    ax, ay, az = (b1 - b0) * dy * dz, (b3 - b2) * dx * dz, (b5 - b4) * dx * dy
                    area = math.sqrt(ax * ax + ay * ay + az * az)
                    if area < 1e-3 * dx * dy or b0 + b1 == 0.0 or b2 + b3 == 0.0 or b4 + b5 == 0.0:
                        continue
                    gx, gy, gz = ax / area, ay / area, az / area
                    x, y, z = (
                        metrics.xc[i] - position[n, 0],
                        metrics.yc[j] - position[n, 1],
                        metrics.zc[k] - position[n, 2],
                    )
                    ox = angular_velocity[n, 0] + spin_velocity[n, 0]
                    oy = angular_velocity[n, 1] + spin_velocity[n, 1]
                    oz = angular_velocity[n, 2] + spin_velocity[n, 2]
                    rx = (b0 * u[j, k, i] + b1 * u[j, k, i + 1]) / (b0 + b1) - (velocity[n, 0] + oy * z - oz * y)
                    ry = (b2 * v[j, k, i] + b3 * v[j + 1, k, i]) / (b2 + b3) - (velocity[n, 1] + oz * x - ox * z)
                    rz = (b4 * w[j, k, i] + b5 * w[j, k + 1, i]) / (b4 + b5) - (velocity[n, 2] + ox * y - oy * x)
                    through = rx * gx + ry * gy + rz * gz
                    rx, ry, rz = rx - through * gx, ry - through * gy, rz - through * gz
                    speed = math.sqrt(rx * rx + ry * ry + rz * rz)
                    volume = dx * dy * dz * max((b0 + b1 + b2 + b3 + b4 + b5) / 6.0, 0.1)
                    rate = 0.5 * friction[n] * speed * area * min(fraction[j, k, i], 1.0)
                    rate = min(rate, 0.5 * volume / dt)
                    fx, fy, fz = rate * rx, rate * ry, rate * rz  # on the solid, over density
                    _add(loads[n], x, y, z, density * fx, density * fy, density * fz)
                    du[0][j, k, i] -= dt * fx * b0 / (b0 + b1) / volume
                    du[0][j, k, i + 1] -= dt * fx * b1 / (b0 + b1) / volume
                    du[1][j, k, i] -= dt * fy * b2 / (b2 + b3) / volume
                    du[1][j + 1, k, i] -= dt * fy * b3 / (b2 + b3) / volume
                    if k > HALO:
                        du[2][j, k, i] -= dt * fz * b4 / (b4 + b5) / volume
                    du[2][j, k + 1, i] -= dt * fz * b5 / (b4 + b5) / volume


@njit(cache=True, error_model="numpy")
def add_and_clear(out: tuple[Array, Array, Array], du: tuple[Array, Array, Array], regions: NDArray[np.int64]) -> None:
    """Add the changes gathered in the solids' index boxes to the velocity and set them back to 0."""
    for n in range(len(regions)):
        for axis in range(3):
            q = out[0] if axis == 0 else (out[1] if axis == 1 else out[2])
            d = du[0] if axis == 0 else (du[1] if axis == 1 else du[2])
            for j in range(regions[n, 0], min(regions[n, 1] + 1, q.shape[0])):
                for k in range(regions[n, 2], min(regions[n, 3] + 1, q.shape[1])):
                    for i in range(regions[n, 4], min(regions[n, 5] + 1, q.shape[2])):
                        q[j, k, i] += d[j, k, i]
                        d[j, k, i] = 0.0
