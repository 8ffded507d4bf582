"""Tread of a wheel: lugs that stand out of the tyre and push water round. Off unless a solid is given one.

The spin of a wheel is no part of the solid's velocity in projection and transport, since it is along the surface. What
lugs do is put in explicitly as a body force in the ring that they sweep, so that its size can be stated and varied.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numba import njit
from numpy.typing import NDArray

from exumob.flow.grid import HALO, Metrics
from exumob.support.arrays import Array
from exumob.support.checks import require_within

if TYPE_CHECKING:
    from exumob.flow.solids import AreaFractions, Solid

SMALLEST_BAND = 1.5
"""Least thickness of the ring over which the force is spread [cells]."""
LEAST_OPEN = 0.1
"""Mean area_fractions of a cell's faces below which the lugs do not reach the water in it [-]."""
LARGEST_SHARE = 0.5
"""Most of the relative speed that the lugs may take from the water in one step [-]."""


@dataclass(frozen=True)
class Tread:
    """Lugs across a cylinder's whole width: plates that drag along their direction of motion.

    The force on the water is C_D rho |u| u / 2 times the lugs' area, spread over the ring that they sweep (at least
    one and a half cells thick); u is the water's speed along the circumference relative to the lugs, which move with
    the wheel and its spin. Lugs in each other's wake and the slip stream between them are not resolved: with the lugs
    closer than about five heights apart, this is an upper bound.

    Parameters
    ----------
    lug_height : float
        Above the cylinder's surface [m], 0.5 mm to 0.1 m.
    lug_count : int
        Round the circumference, 1 to 500.
    drag_coefficient : float
        Of one lug [-]; 1.2: plate across the flow with a side ratio of 1 to 5 (Hoerner, Fluid-Dynamic Drag, 1965,
        ch. 3: 1.17 to 1.20).
    """

    lug_height: float
    lug_count: int
    drag_coefficient: float = 1.2

    def __post_init__(self) -> None:
        require_within("Tread", 5.0e-4, 0.1, lug_height=self.lug_height)
        require_within("Tread", 1, 500, lug_count=self.lug_count)
        require_within("Tread", 0.0, 3.0, drag_coefficient=self.drag_coefficient)


def tread_table(solids: Sequence[Solid]) -> Array:
    """Radius, half width and lug height [m] and C_D times the area of all lugs [m^2] per solid; 0 without tread."""
    table = np.zeros((len(solids), 4))
    for n, solid in enumerate(solids):
        if solid.tread is not None:
            radius, half, t = solid.parameters[0], solid.parameters[1], solid.tread
            table[n] = radius, half, t.lug_height, t.drag_coefficient * t.lug_count * t.lug_height * 2.0 * half
    return table


@njit(cache=True, error_model="numpy")
def push(
    du: tuple[Array, Array, Array], u: Array, v: Array, w: Array, fraction: Array, wet: NDArray[np.uint8],
    solids: AreaFractions, regions: NDArray[np.int64], position: Array, velocity: Array, angular_velocity: Array,
    axle: Array, spin: Array, treads: Array, density: float, dt: float, metrics: Metrics, loads: Array,
) -> None:  # fmt: skip
    """Drag between the water and the lugs of spinning cylinders; what the water gains, the solids lose.

    Parameters
    ----------
    du : three arrays, changed
        Change of the velocity is added here [m/s].
    u, v, w : array
        Velocity [m/s].
    regions : array of int, shape (n, 6)
        Index boxes of the solids.
    position, velocity, angular_velocity, axle : array, shape (n, 3)
        Of the solids (without spin) and their y axes, grid axes.
    spin : array, shape (n, 3)
        Angular velocity of the surface relative to the solid's body, grid axes [rad/s].
    treads : array, shape (n, 4)
        `tread_table`.
    loads : array, shape (n, 6), changed
        Force [N] and moment about the origins [N m] on the solids, grid axes.
    """
    ny, nz, nx = u.shape
    for n in range(len(regions)):
        radius, half, height, area = treads[n]
        if area <= 0.0:
            continue
        ax, ay, az = axle[n]
        turning = spin[n, 0] * ax + spin[n, 1] * ay + spin[n, 2] * az
        o = angular_velocity[n]
        for j in range(max(regions[n, 0], HALO), min(regions[n, 1], ny - HALO)):
            for k in range(max(regions[n, 2], HALO), min(regions[n, 3], nz - HALO)):
                for i in range(max(regions[n, 4], HALO), min(regions[n, 5], nx - HALO)):
                    if solids.nearest[j, k, i] != n or wet[j, k, i] == 0:
                        continue
                    dx, dy, dz = metrics.dx[i], metrics.dy[j], metrics.dz[k]
                    x, y = metrics.xc[i] - position[n, 0], metrics.yc[j] - position[n, 1]
                    z = metrics.zc[k] - position[n, 2]
                    along = x * ax + y * ay + z * az
                    qx, qy, qz = x - along * ax, y - along * ay, z - along * az
                    r = math.sqrt(qx * qx + qy * qy + qz * qz)
                    band = max(height, SMALLEST_BAND * max(dx, dz))
                    if abs(along) > half or r < radius or r > radius + band:
                        continue
                    b0, b1 = solids.bx[j, k, i], solids.bx[j, k, i + 1]
                    b2, b3 = solids.by[j, k, i], solids.by[j + 1, k, i]
                    b4, b5 = solids.bz[j, k, i] if k > HALO else 0.0, solids.bz[j, k + 1, i]
                    opened = 0.5 * min(b0 + b1, b2 + b3, b4 + b5)
                    if opened < LEAST_OPEN:
                        continue
                    tx, ty, tz = (ay * qz - az * qy) / r, (az * qx - ax * qz) / r, (ax * qy - ay * qx) / r
                    rx = (b0 * u[j, k, i] + b1 * u[j, k, i + 1]) / (b0 + b1) - (velocity[n, 0] + o[1] * z - o[2] * y)
                    ry = (b2 * v[j, k, i] + b3 * v[j + 1, k, i]) / (b2 + b3) - (velocity[n, 1] + o[2] * x - o[0] * z)
                    rz = (b4 * w[j, k, i] + b5 * w[j, k + 1, i]) / (b4 + b5) - (velocity[n, 2] + o[0] * y - o[1] * x)
                    relative = rx * tx + ry * ty + rz * tz - turning * (radius + 0.5 * height)
                    ring = math.pi * ((radius + band) ** 2 - radius**2) * 2.0 * half
                    volume = dx * dy * dz * min(fraction[j, k, i], 1.0)
                    rate = min(0.5 * area / ring * abs(relative), LARGEST_SHARE * opened / dt)
                    force = density * rate * relative * volume  # on the solid, along the circumference
                    fx, fy, fz = force * tx, force * ty, force * tz
                    loads[n, 0] += fx
                    loads[n, 1] += fy
                    loads[n, 2] += fz
                    loads[n, 3] += y * fz - z * fy
                    loads[n, 4] += z * fx - x * fz
                    loads[n, 5] += x * fy - y * fx
                    gain = -dt / (density * dx * dy * dz)
                    du[0][j, k, i] += gain * fx / (b0 + b1) * dx / metrics.ex[i]
                    du[0][j, k, i + 1] += gain * fx / (b0 + b1) * dx / metrics.ex[i + 1]
                    du[1][j, k, i] += gain * fy / (b2 + b3) * dy / metrics.ey[j]
                    du[1][j + 1, k, i] += gain * fy / (b2 + b3) * dy / metrics.ey[j + 1]
                    if k > HALO:
                        du[2][j, k, i] += gain * fz / (b4 + b5) * dz / metrics.ez[k]
                    du[2][j, k + 1, i] += gain * fz / (b4 + b5) * dz / metrics.ez[k + 1]
