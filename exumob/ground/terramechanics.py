"""Forces and stresses of deformable soil on one rigid wheel, with checked input: paper Eqs. (3) to (5) and Fig. 1.

`exumob.ground.contact_patch` states the method, its frame and its limits, and does the arithmetic.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike

from exumob.ground.contact_patch import PATCH_FORCES, WheelMotion, WheelSize, wheel_soil_kernel
from exumob.ground.soil import Soil
from exumob.support.arrays import Array
from exumob.support.declared import checked
from exumob.support.quantities import Quantity

SIZE = Quantity("m", above=0.0, at_most=100.0, plausible=(5e-3, 5.0))
"""Radius or width of a wheel"""
SPIN = Quantity("rad/s", at_least=-1e4, at_most=1e4)
"""Angular velocity about the axle"""
SPINS = Quantity("rad/s", at_least=-1e4, at_most=1e4, shape=(3,))
"""The whole angular velocity of a wheel"""


@dataclass(frozen=True)
class ContactStresses:
    """Stresses along the contact patch of a rolling wheel, paper Fig. 1."""

    angle: Array
    """theta on the rim [rad], from exit to entry, positive towards the direction of travel, shape (n,)"""
    normal: Array
    """sigma, Eq. (3) [Pa], shape (n,)"""
    shear_x: Array
    """tau_x, Eq. (4), on the wheel, positive towards the direction of travel at the lowest point [Pa], shape (n,)"""
    shear_y: Array
    """tau_y, on the wheel, positive to the left [Pa], shape (n,)"""


@dataclass(frozen=True)
class WheelSoilForces:
    """Force and moment of the soil on one wheel, in the wheel's horizontal heading frame (x heading, y left, z up)."""

    force: Array
    """Force on the wheel [N], shape (3,)"""
    moment: Array
    """Moment about the wheel centre [N m], shape (3,): overturning, -driving_torque, aligning"""
    driving_torque: float
    """Torque that the axle must apply to keep the spin, r^2 b times the integral of tau_x [N m]"""
    slip_ratio: float
    """Slip ratio [-], > 0 driving, < 0 braking, in [-1, 1]"""
    entry_angle: float
    """Angle at which the rim meets the soil [rad], from the downward vertical towards the direction of travel"""
    exit_angle: float
    """Angle at which the rim leaves the soil [rad], <= 0"""
    maximum_pressure_angle: float
    """Angle of the largest normal stress [rad]"""


@checked
def wheel_soil_forces(
    soil: Soil,
    wheel_radius: Annotated[float, SIZE],
    wheel_width: Annotated[float, SIZE],
    sinkage: Annotated[float, Quantity("m", at_least=-1e6, at_most=1e3)],
    velocity: Annotated[ArrayLike, Quantity("m/s", at_least=-1e4, at_most=1e4, shape=(3,))],
    angular_velocity: Annotated[float, SPIN] | Annotated[ArrayLike, SPINS],
    *,
    standstill_rate: Annotated[float, Quantity("rad/s", above=0.0, at_most=1e3)] = 0.01,
) -> WheelSoilForces:
    """Compute force, moment and driving torque of the soil on a rigid wheel, paper Eqs. (3) to (5).

    Parameters
    ----------
    soil : Soil
    wheel_radius, wheel_width : float
        Size of the wheel [m], > 0.
    sinkage : float
        Depth of the lowest rim point below the undisturbed surface [m], < wheel_radius. If it is <= 0, the wheel is
        lifted off and all results are 0.
    velocity : array_like, shape (3,)
        Velocity of the wheel centre in its horizontal heading frame [m/s].
    angular_velocity : float or array_like, shape (3,)
        Spin about +y [rad/s], positive rolls forward; or the whole angular velocity of the wheel in the same frame.
    standstill_rate : float
        Below this spin [rad/s], and below a speed of wheel_radius * standstill_rate, the regimes are joined smoothly.

    Returns
    -------
    WheelSoilForces

    Raises
    ------
    ValueError
        If a value is not finite, a size is not positive, or the wheel is sunk to its centre or deeper.
    """
    spin = np.asarray(angular_velocity)
    omega_x, omega, omega_z = spin if spin.ndim else (0.0, float(spin), 0.0)
    v = np.asarray(velocity)
    if sinkage >= wheel_radius:
        raise ValueError(
            f"sinkage = {sinkage:g} m reaches the wheel centre (radius {wheel_radius:g} m), where Bekker-Wong "
            "ends; use a firmer soil, a larger or wider wheel, or less load."
        )
    result = np.zeros(1, PATCH_FORCES)
    wheel_soil_kernel(
        soil.as_record()[0], WheelSize(float(wheel_radius), float(wheel_width)), float(sinkage),
        WheelMotion(*map(float, (*v, omega, omega_x, omega_z))), float(standstill_rate), result[0],
    )  # fmt: skip
    out = result[0]
    return WheelSoilForces(
        out["force"].copy(), out["moment"].copy(), float(out["driving_torque"]), float(out["slip_ratio"]),
        float(out["entry_angle"]), float(out["exit_angle"]), float(out["maximum_pressure_angle"]),
    )  # fmt: skip


@checked
def contact_stresses(
    soil: Soil,
    wheel_radius: Annotated[float, SIZE],
    wheel_width: Annotated[float, SIZE],
    sinkage: Annotated[float, Quantity("m", above=0.0, at_most=1e3, remedy="the wheel does not touch; sink it.")],
    velocity: Annotated[ArrayLike, Quantity("m/s", at_least=-1e4, at_most=1e4, shape=(3,))],
    angular_velocity: Annotated[float, SPIN],
    *,
    standstill_rate: Annotated[float, Quantity("rad/s", above=0.0, at_most=1e3)] = 0.01,
    points: Annotated[int, Quantity("1", at_least=2, at_most=1_000_000)] = 181,
) -> ContactStresses:
    """Compute normal and shear stress over the rim, paper Eqs. (3) and (4), for plots and checks.

    Parameters
    ----------
    soil, wheel_radius, wheel_width, sinkage, velocity, angular_velocity, standstill_rate
        As for `wheel_soil_forces`; the wheel must travel and spin faster than the standstill bands, because inside them
        two patches are blended.
    points : int
        Number of angles.

    Raises
    ------
    ValueError
        As `wheel_soil_forces`; or if the wheel does not touch, stands still, or is locked.
    """
    forces = wheel_soil_forces(
        soil, wheel_radius, wheel_width, sinkage, velocity, angular_velocity, standstill_rate=standstill_rate
    )
    v_x, v_y, v_z = np.asarray(velocity, dtype=float)
    if abs(angular_velocity) < standstill_rate or abs(v_x) < wheel_radius * standstill_rate:
        raise ValueError(
            f"contact_stresses.angular_velocity = {angular_velocity:g} rad/s, velocity[0] = {v_x:g} m/s: inside the "
            f"standstill bands ({standstill_rate:g} rad/s, {wheel_radius * standstill_rate:g} m/s) two patches are "
            "blended; give faster ones."
        )
    direction = math.copysign(1.0, v_x)
    v_x, omega = direction * v_x, direction * angular_velocity
    r, theta_f, theta_r = wheel_radius, forces.entry_angle, forces.exit_angle
    theta_m = forces.maximum_pressure_angle
    theta = np.linspace(theta_r, theta_f, points)
    rear = max(theta_m - theta_r, 1e-12)
    equivalent = np.where(theta >= theta_m, theta, theta_f - (theta - theta_r) / rear * (theta_f - theta_m))
    depth = r * np.maximum(np.cos(equivalent) - math.cos(theta_f), 0.0)
    sigma = soil.pressure(1.0, wheel_width) * depth**soil.n * max(0.0, 1.0 - soil.damping * v_z)
    entry = theta_f if omega > 0.0 else theta_r
    time = (entry - theta) / omega
    sine, cosine = math.sin(entry) - np.sin(theta), np.cos(theta) - math.cos(entry)
    x = (r * omega * time - (v_x * sine + v_z * cosine) / omega) / soil.shear_modulus_x
    y = -v_y * time / soil.shear_modulus_y
    strength = soil.cohesion * min(max(0.0, 1.0 - soil.damping * v_z), 1.0) + sigma * math.tan(soil.friction_angle)
    if soil.shear_limit == "resultant":
        total = np.hypot(x, y)
        share = -np.expm1(-total) / np.where(total > 0.0, total, 1.0)
        return ContactStresses(theta, sigma, strength * share * x, strength * share * y)
    return ContactStresses(
        theta, sigma, -np.sign(x) * strength * np.expm1(-np.abs(x)), -np.sign(y) * strength * np.expm1(-np.abs(y))
    )
