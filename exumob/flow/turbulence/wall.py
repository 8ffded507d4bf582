"""Wall law: friction velocity of a turbulent boundary layer that the cells do not resolve, and the shear of the bed."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import prange
from numpy.typing import NDArray

from exumob.flow.active_rows import WaterCells
from exumob.flow.area_fractions import AreaFractions
from exumob.flow.grid import HALO, Metrics
from exumob.flow.poses import PlacedSolids
from exumob.support.arrays import Array
from exumob.support.kernels import njit

KARMAN = 0.41
"""Von Karman's constant [-]."""
SMOOTH_WALL = 9.8
"""E of the smooth log law U+ = ln(E y+) / KARMAN [-]."""


class Walls(NamedTuple):
    """The walls that bound the water during a step."""

    area_fractions: AreaFractions
    """Area fractions that bed and solids leave open"""
    distance: Array
    """Signed distance of the cells' centres to the nearest solid, a given bed left out [m]"""
    nearest: NDArray[np.int8]
    """Its number, -1 if none is near"""
    solids: PlacedSolids
    bed_roughness: float
    """Equivalent sand roughness of the bed [m]; negative: the bed slips"""


@njit(cache=True, error_model="numpy")
def friction_velocity(speed: float, distance: float, viscosity: float, roughness: float) -> float:
    """Friction velocity [m/s] for a speed at a distance from a smooth or rough wall.

    U/u_* = ln(E y+ / (1 + 0.3 k_s+)) / 0.41, E = 9.8 (smooth wall; rough: Nikuradse's ln(y / k_s) / 0.41 + 8.5;
    Cebeci & Bradshaw 1977), or U+ = y+ where that asks for more (the viscous sublayer).

    Parameters
    ----------
    speed : float
        Along the wall, relative to it [m/s], >= 0.
    distance : float
        Distance from the wall [m], > 0.
    viscosity : float
        Kinematic, molecular [m^2/s].
    roughness : float
        Equivalent sand roughness k_s [m]; 0: smooth.
    """
    nu = max(viscosity, 1e-12)
    result = 0.05 * speed
    for _ in range(8):  # contracts by about 1 / ln(E y+) each time
        grown = SMOOTH_WALL * distance * result / (nu + 0.3 * roughness * result)
        result = KARMAN * speed / math.log(max(grown, 3.0))
    return max(result, math.sqrt(nu * speed / distance))


@njit(cache=True, error_model="numpy", parallel=True)
def bed_shear(
    out: tuple[Array, Array, Array], velocity: tuple[Array, Array, Array], cells: WaterCells,
    area_fractions: AreaFractions, roughness: float, viscosity: float, dt: float, metrics: Metrics,
) -> None:  # fmt: skip
    """Slow the lowest layer down by the log-law shear of the bed, which is at rest in the world: velocities absolute.

    Implicit in the speed, so that it never reverses the flow.

    Parameters
    ----------
    out : three arrays, changed
        Velocity [m/s].
    velocity : three arrays
        Velocity from which the shear is taken [m/s].
    cells : WaterCells
    area_fractions : AreaFractions
    roughness : float
        Equivalent sand roughness of the bed [m].
    viscosity : float
        Kinematic, molecular [m^2/s].
    dt : float
        [s]
    metrics : Metrics
    """
    u, v, fraction, wet = velocity[0], velocity[1], cells.fraction, cells.wet
    out_x, out_y = out[0], out[1]
    ny, _, nx = u.shape
    k = HALO
    height = 0.5 * metrics.dz[k]
    bx, by = area_fractions.bx, area_fractions.by
    for j in prange(HALO, ny - HALO + 1):
        for i in range(HALO, nx - HALO + 1):
            if bx[j, k, i] > 0.0 and (wet[j, k, i] or wet[j, k, i - 1]):
                across = 0.25 * ((v[j, k, i] + v[j + 1, k, i - 1]) + (v[j + 1, k, i] + v[j, k, i - 1]))
                speed = math.sqrt(u[j, k, i] ** 2 + across**2)
                if speed > 1e-9:
                    depth = metrics.dz[k] * max(0.5 * (fraction[j, k, i] + fraction[j, k, i - 1]), 0.5)
                    rate = friction_velocity(speed, height, viscosity, roughness) ** 2 / (speed * depth)
                    out_x[j, k, i] /= 1.0 + dt * rate
            if by[j, k, i] > 0.0 and (wet[j, k, i] or wet[j - 1, k, i]):
                across = 0.25 * ((u[j, k, i] + u[j - 1, k, i + 1]) + (u[j, k, i + 1] + u[j - 1, k, i]))
                speed = math.sqrt(v[j, k, i] ** 2 + across**2)
                if speed > 1e-9:
                    depth = metrics.dz[k] * max(0.5 * (fraction[j, k, i] + fraction[j - 1, k, i]), 0.5)
                    rate = friction_velocity(speed, height, viscosity, roughness) ** 2 / (speed * depth)
                    out_y[j, k, i] /= 1.0 + dt * rate
