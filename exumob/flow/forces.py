"""Loads on the solids: pressure on partly open faces, wall friction, the drag of lugs. No surface mesh is needed."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from exumob.flow.active_rows import WaterCells
from exumob.flow.area_fractions import AreaFractions
from exumob.flow.fluid import Fluid
from exumob.flow.grid import HALO, Metrics
from exumob.flow.poses import PlacedSolids, body_velocity, cells_near, surface_velocity
from exumob.support.arrays import Array
from exumob.support.constants import GRAVITY
from exumob.support.kernels import njit

SMALLEST_BAND = 1.5
"""Least thickness of the ring over which the drag of lugs is spread [cells]."""
LEAST_OPEN = 0.1
"""Mean area fraction of a cell's faces below which the lugs do not reach the water in it [-]."""
LARGEST_SHARE = 0.5
"""Most of the relative speed that the lugs may take from the water in one step [-]."""


class Ground(NamedTuple):
    """The bed as the pressure on the solids meets it."""

    heights: Array
    """Height below the columns of cells [m], shape (ny, nx)"""
    saturated: bool
    """The soil is saturated: the pressure goes on below the bed"""


@njit(cache=True, error_model="numpy", inline="always")
def add_wrench(wrench: Array, arm: tuple[float, float, float], force: tuple[float, float, float]) -> None:
    """Add a force [N] at an arm [m] to a force and moment, shape (6,)."""
    (x, y, z), (fx, fy, fz) = arm, force
    wrench[0] += fx
    wrench[1] += fy
    wrench[2] += fz
    wrench[3] += y * fz - z * fy
    wrench[4] += z * fx - x * fz
    wrench[5] += x * fy - y * fx


@njit(cache=True, error_model="numpy")
def pressure_loads(
    phi: Array, cells: WaterCells, bodies: AreaFractions, solids: PlacedSolids, fluid: Fluid, dt: float,
    ground: Ground, metrics: Metrics,
) -> Array:  # fmt: skip
    """Sum over cells of pressure times what the low face is more open than the high face, per solid.

    The piezometric part acts on the faces as the flow sees them, the weight of still water on those whose edges are not
    sharpened: it is then free of the half cell by which sharpening moves walls at edges.

    Cells below the bed, those of the halo below the window too, hold saturated soil with hydrostatic pressure, so that
    a wheel sunk into it floats as Archimedes says.

    Parameters
    ----------
    phi : array
        dt times piezometric pressure over density [m^2/s].
    cells : WaterCells
        With the fraction at which the pressure was solved.
    bodies : AreaFractions
        Area fractions of the solids alone, without a given bed.
    solids : PlacedSolids
    fluid : Fluid
    dt : float
        [s]
    ground : Ground
    metrics : Metrics

    Returns
    -------
    array, shape (n, 6)
        Force [N] and moment about the origins [N m], grid axes.
    """
    fraction, wet, bed, density, level = cells.fraction, cells.wet, ground.heights, fluid.density, fluid.level
    wrenches = np.zeros((len(solids.regions), 6))
    for n in range(len(solids.regions)):
        (j0, j1), (k0, k1), (i0, i1) = cells_near(solids.regions, n, phi.shape)
        k0 = max(solids.regions[n, 2], 0) if ground.saturated else k0
        for j in range(j0, j1):
            for k in range(k0, k1):
                for i in range(i0, i1):
                    if bodies.nearest[j, k, i] != n:
                        continue
                    x_area, y_area = metrics.dy[j] * metrics.dz[k], metrics.dx[i] * metrics.dz[k]
                    z_area = metrics.dx[i] * metrics.dy[j]
                    ax = (bodies.ax[j, k, i + 1] - bodies.ax[j, k, i]) * x_area
                    ay = (bodies.ay[j + 1, k, i] - bodies.ay[j, k, i]) * y_area
                    az = (bodies.az[j, k + 1, i] - bodies.az[j, k, i]) * z_area
                    bx = (bodies.bx[j, k, i + 1] - bodies.bx[j, k, i]) * x_area
                    by = (bodies.by[j + 1, k, i] - bodies.by[j, k, i]) * y_area
                    bz = (bodies.bz[j, k + 1, i] - bodies.bz[j, k, i]) * z_area
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
                        weight *= 1.0 if ground.saturated else above
                    add_wrench(
                        wrenches[n],
                        (metrics.xc[i] - solids.position[n, 0], metrics.yc[j] - solids.position[n, 1],
                         z - solids.position[n, 2]),
                        (-weight * ax - flow * bx, -weight * ay - flow * by, -weight * az - flow * bz),
                    )  # fmt: skip
    return wrenches


@njit(cache=True, error_model="numpy", inline="always")
def _still_pressure(level: float, z: float, dz: float) -> float:
    """Mean head [m] of still water at `level` over a cell at z, `dz` high [m]."""
    c = min(max((level - z) / dz + 0.5, 0.0), 1.0)
    return max(level - z, 0.0) if c == 1.0 else 0.5 * c * c * dz


@njit(cache=True, error_model="numpy", inline="always")
def surface_excess(c: float) -> float:
    """Mean over a cell of the pressure below a level inside it, less the value at the centre (not below 0)."""
    return 0.5 * c * c - max(c - 0.5, 0.0)


@njit(cache=True, error_model="numpy", inline="always")
def _open_faces(
    o: AreaFractions, j: int, k: int, i: int
) -> tuple[tuple[float, float], tuple[float, float], tuple[float, float]]:
    """Area fractions of a cell's low and high faces across x, y and z."""
    return (
        (o.bx[j, k, i], o.bx[j, k, i + 1]),
        (o.by[j, k, i], o.by[j + 1, k, i]),
        (o.bz[j, k, i], o.bz[j, k + 1, i]),
    )


@njit(cache=True, error_model="numpy", inline="always")
def _open_mean(b: tuple[float, float], low: float, high: float) -> float:
    """Mean of a velocity component on two faces, weighted with their area fractions b."""
    return (b[0] * low + b[1] * high) / (b[0] + b[1])


@njit(cache=True, error_model="numpy")
def wall_shear(
    change: tuple[Array, Array, Array], velocity: tuple[Array, Array, Array], cells: WaterCells,
    area_fractions: AreaFractions, solids: PlacedSolids, density: float, dt: float, metrics: Metrics,
) -> Array:  # fmt: skip
    """Quadratic wall friction, tau = rho C_f |u_t| u_t / 2 on the speed u_t along the (spinning) wall.

    Parameters
    ----------
    change : three arrays, changed
        Change of the velocity is added here, so that no cell sees what its neighbour has just received [m/s].
    velocity : three arrays
        [m/s]
    cells : WaterCells
    area_fractions : AreaFractions
    solids : PlacedSolids
    density : float
        [kg/m^3]
    dt : float
        [s]
    metrics : Metrics

    Returns
    -------
    array, shape (n, 6)
        Force [N] and moment about the origins [N m] on the solids, grid axes.
    """
    u, v, w = velocity
    fraction, wet = cells.fraction, cells.wet
    wrenches = np.zeros((len(solids.regions), 6))
    for n in range(len(solids.regions)):
        if solids.friction[n] <= 0.0:
            continue
        (j0, j1), (k0, k1), (i0, i1) = cells_near(solids.regions, n, u.shape)
        for j in range(j0, j1):
            for k in range(k0, k1):
                for i in range(i0, i1):
                    if area_fractions.nearest[j, k, i] != n or wet[j, k, i] == 0:
                        continue
                    dx, dy, dz = metrics.dx[i], metrics.dy[j], metrics.dz[k]
                    bx, by, bz = _open_faces(area_fractions, j, k, i)
                    ax, ay, az = (bx[1] - bx[0]) * dy * dz, (by[1] - by[0]) * dx * dz, (bz[1] - bz[0]) * dx * dy
                    area = math.sqrt(ax * ax + ay * ay + az * az)
                    sum_x, sum_y, sum_z = bx[0] + bx[1], by[0] + by[1], bz[0] + bz[1]
                    if area < 1e-3 * dx * dy or sum_x == 0.0 or sum_y == 0.0 or sum_z == 0.0:
                        continue
                    gx, gy, gz = ax / area, ay / area, az / area
                    x = metrics.xc[i] - solids.position[n, 0]
                    y = metrics.yc[j] - solids.position[n, 1]
                    z = metrics.zc[k] - solids.position[n, 2]
                    sx, sy, sz = surface_velocity(solids, n, x, y, z)
                    rx = _open_mean(bx, u[j, k, i], u[j, k, i + 1]) - sx
                    ry = _open_mean(by, v[j, k, i], v[j + 1, k, i]) - sy
                    rz = _open_mean(bz, w[j, k, i], w[j, k + 1, i]) - sz
                    through = rx * gx + ry * gy + rz * gz
                    rx, ry, rz = rx - through * gx, ry - through * gy, rz - through * gz
                    speed = math.sqrt(rx * rx + ry * ry + rz * rz)
                    volume = dx * dy * dz * max((bx[0] + bx[1] + by[0] + by[1] + bz[0] + bz[1]) / 6.0, 0.1)
                    rate = 0.5 * solids.friction[n] * speed * area * min(fraction[j, k, i], 1.0)
                    rate = min(rate, 0.5 * volume / dt)
                    fx, fy, fz = rate * rx, rate * ry, rate * rz  # on the solid, over density
                    add_wrench(wrenches[n], (x, y, z), (density * fx, density * fy, density * fz))
                    change[0][j, k, i] -= dt * fx * bx[0] / sum_x / volume
                    change[0][j, k, i + 1] -= dt * fx * bx[1] / sum_x / volume
                    change[1][j, k, i] -= dt * fy * by[0] / sum_y / volume
                    change[1][j + 1, k, i] -= dt * fy * by[1] / sum_y / volume
                    if k > HALO:
                        change[2][j, k, i] -= dt * fz * bz[0] / sum_z / volume
                    change[2][j, k + 1, i] -= dt * fz * bz[1] / sum_z / volume
    return wrenches


@njit(cache=True, error_model="numpy")
def lug_drag(
    change: tuple[Array, Array, Array], velocity: tuple[Array, Array, Array], cells: WaterCells,
    area_fractions: AreaFractions, solids: PlacedSolids, density: float, dt: float, metrics: Metrics,
) -> Array:  # fmt: skip
    """Drag between the water and the lugs of spinning cylinders (`exumob.flow.tread.Tread`).

    The water gains what momentum the solids lose. Arguments and result are those of `wall_shear`.
    """
    u, v, w = velocity
    fraction, wet = cells.fraction, cells.wet
    wrenches = np.zeros((len(solids.regions), 6))
    for n in range(len(solids.regions)):
        if solids.lug_drag_area[n] <= 0.0:
            continue
        radius, half = solids.lug_radius[n], solids.lug_half_width[n]
        height, area = solids.lug_height[n], solids.lug_drag_area[n]
        ax, ay, az = solids.rotation[n, 0, 1], solids.rotation[n, 1, 1], solids.rotation[n, 2, 1]
        wheel_speed = solids.spin[n, 0] * ax + solids.spin[n, 1] * ay + solids.spin[n, 2] * az
        (j0, j1), (k0, k1), (i0, i1) = cells_near(solids.regions, n, u.shape)
        for j in range(j0, j1):
            for k in range(k0, k1):
                for i in range(i0, i1):
                    if area_fractions.nearest[j, k, i] != n or wet[j, k, i] == 0:
                        continue
                    dx, dy, dz = metrics.dx[i], metrics.dy[j], metrics.dz[k]
                    x = metrics.xc[i] - solids.position[n, 0]
                    y = metrics.yc[j] - solids.position[n, 1]
                    z = metrics.zc[k] - solids.position[n, 2]
                    along = x * ax + y * ay + z * az
                    qx, qy, qz = x - along * ax, y - along * ay, z - along * az
                    r = math.sqrt(qx * qx + qy * qy + qz * qz)
                    band = max(height, SMALLEST_BAND * max(dx, dz))
                    if abs(along) > half or r < radius or r > radius + band:
                        continue
                    bx, by, bz = _open_faces(area_fractions, j, k, i)
                    bz = (bz[0] if k > HALO else 0.0, bz[1])
                    sum_x, sum_y, sum_z = bx[0] + bx[1], by[0] + by[1], bz[0] + bz[1]
                    opened = 0.5 * min(sum_x, sum_y, sum_z)
                    if opened < LEAST_OPEN:
                        continue
                    tx, ty, tz = (ay * qz - az * qy) / r, (az * qx - ax * qz) / r, (ax * qy - ay * qx) / r
                    sx, sy, sz = body_velocity(solids, n, x, y, z)
                    rx = _open_mean(bx, u[j, k, i], u[j, k, i + 1]) - sx
                    ry = _open_mean(by, v[j, k, i], v[j + 1, k, i]) - sy
                    rz = _open_mean(bz, w[j, k, i], w[j, k + 1, i]) - sz
                    relative = rx * tx + ry * ty + rz * tz - wheel_speed * (radius + 0.5 * height)
                    ring = math.pi * ((radius + band) ** 2 - radius**2) * 2.0 * half
                    volume = dx * dy * dz * min(fraction[j, k, i], 1.0)
                    rate = min(0.5 * area / ring * abs(relative), LARGEST_SHARE * opened / dt)
                    force = density * rate * relative * volume  # on the solid, along the circumference
                    fx, fy, fz = force * tx, force * ty, force * tz
                    add_wrench(wrenches[n], (x, y, z), (fx, fy, fz))
                    gain = -dt / (density * dx * dy * dz)
                    change[0][j, k, i] += gain * fx / sum_x * dx / metrics.ex[i]
                    change[0][j, k, i + 1] += gain * fx / sum_x * dx / metrics.ex[i + 1]
                    change[1][j, k, i] += gain * fy / sum_y * dy / metrics.ey[j]
                    change[1][j + 1, k, i] += gain * fy / sum_y * dy / metrics.ey[j + 1]
                    if k > HALO:
                        change[2][j, k, i] += gain * fz / sum_z * dz / metrics.ez[k]
                    change[2][j, k + 1, i] += gain * fz / sum_z * dz / metrics.ez[k + 1]
    return wrenches


@njit(cache=True, error_model="numpy")
def add_and_clear(
    velocity: tuple[Array, Array, Array], change: tuple[Array, Array, Array], regions: NDArray[np.int64]
) -> None:
    """Add the changes gathered in the solids' index boxes to the velocity and set them back to 0."""
    for n in range(len(regions)):
        j0, j1, k0, k1, i0, i1 = regions[n]
        for axis in range(3):
            q = velocity[0] if axis == 0 else (velocity[1] if axis == 1 else velocity[2])
            d = change[0] if axis == 0 else (change[1] if axis == 1 else change[2])
            for j in range(j0, min(j1 + 1, q.shape[0])):  # a cell's high face is the next cell's
                for k in range(k0, min(k1 + 1, q.shape[1])):
                    for i in range(i0, min(i1 + 1, q.shape[2])):
                        q[j, k, i] += d[j, k, i]
                        d[j, k, i] = 0.0
