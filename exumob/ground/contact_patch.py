"""The contact patch of a rigid wheel on deformable soil, integrated in compiled code: paper Eqs. (3) to (5), Fig. 1.

Frame: the wheel's horizontal heading frame, x along the heading, y left, z up. Angles theta on the rim are measured at
the wheel centre from the downward vertical, positive towards the direction of travel; the rim point at theta lies at
r (sin theta, 0, -cos theta). Sinkage is positive down. Forces act on the wheel; moments are about the wheel centre.
A positive angular velocity rolls the wheel forward.

Contact patch (Wong & Reece, J. Terramechanics 4 (1967) 81), z the sinkage, kappa the rebound ratio:
    theta_f = arccos(1 - z / r)         entry
    theta_r = -arccos(1 - kappa z / r)  exit
    theta_m = (c1 + c2 |s|) theta_f     maximum pressure

Shear displacement: the sliding velocity integrated along the rim from where the soil meets it,
    rim enters in front (omega > 0):   j_x = r (theta_f - theta) - (v_x / omega) (sin theta_f - sin theta)
                                       j_y = -(v_y / omega) (theta_f - theta)
    rim enters behind (omega < 0):     the same from theta_r, with |omega|.
A wheel that also moves vertically (v_z), or whose plane turns (omega_x, omega_z), slides by v_z sin(theta) more in x
and by r (omega_x cos theta + omega_z sin theta) more in y; integrated likewise,
    j_x: - (v_z / omega) (cos theta - cos theta_f)
    j_y: - (r / omega) (omega_x (sin theta_f - sin theta) + omega_z (cos theta - cos theta_f)).
These terms vanish in steady straight rolling. With them every rim element resists along its own sliding direction, so
that the soil's resistance to slow motion is dissipative; without them a standing vehicle with a linkage suspension can
swing itself up.

These hold for a wheel that travels forward (v_x > 0); backward travel is the mirror image. Three small bands of width
set by `standstill_rate` w0 join the branches, and outside them nothing is altered:
    |omega| < w0      1 / |omega| becomes 2 w0 / (omega^2 + w0^2), and the two entries are blended (locked wheel);
    |v_x| < r w0      travel forward and backward are blended (a wheel at rest has a symmetric patch);
    both              the slip ratio fades to 0.
So the force is continuous in all arguments and Lipschitz in the velocities: driving, braking, skid, locked, reverse,
pure side slip and standing still need no cases of their own. At rest, shear resists as a viscous creep: a wheel that
carries a tangential load moves at a small fraction of r w0. Its steepest slope [N s/m], of the order of strength times
patch length over (K w0), is what a time integrator feels at standstill (2.2 kN/m over w0 for a wheel of the paper's
size on LETE sand under 140 N: 220 kN s/m at the default w0); raise w0 if the steps are long.

A wheel that does not move vertically never gains energy (F.v + M.omega <= 0): found without exception for rebound
ratios up to 0.6 in 10^7 random states over all published soils. From 0.8 on, a wheel sunk by more than 0.7 radii may
gain up to 1 % of |F| |v| inside the standstill bands, and nowhere else.

Known limits of the method: it is quasi-static and has no memory (no rut, no multi-pass, unloading follows loading); no
slip sinkage but through the shear's vertical component; no bulldozing at the side wall; flat-plate pressures
overestimate the support of wheels below about 0.5 m diameter (Meirion-Griffith & Spenko, J. Terramechanics 48 (2011)
149).
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from exumob.support.arrays import Array
from exumob.support.kernels import njit

NODES = 16
"""Gauss-Legendre nodes in each of the two regions of Eq. (3)."""

CLUSTERING = 3
"""Nodes at distance t^CLUSTERING from the ends of the patch, t in (0, 1): resolves thin shear layers and z^n there."""


def _clustered_nodes(count: int, power: int) -> tuple[Array, Array]:
    """Nodes and weights on (0, 1), shape (2, count): row 0 clustered at 0 (t^p), row 1 at both ends (quintic step)."""
    t, weight = np.polynomial.legendre.leggauss(count)
    t, weight = 0.5 * (t + 1.0), 0.5 * weight
    positions = np.array([t**power, t**3 * (10.0 - 15.0 * t + 6.0 * t * t)])
    weights = weight * np.array([power * t ** (power - 1), 30.0 * (t * (1.0 - t)) ** 2])
    return positions, weights


_POSITION, _WEIGHT = _clustered_nodes(NODES, CLUSTERING)

PATCH_FORCES = np.dtype(
    [
        ("force", "f8", (3,)),  # of the soil on the wheel, heading frame [N]
        ("moment", "f8", (3,)),  # about the wheel centre, heading frame [N m]
        ("driving_torque", "f8"),  # that the axle must apply to keep the spin [N m]
        ("slip_ratio", "f8"),  # [-]
        ("entry_angle", "f8"),  # theta_f, theta_r, theta_m [rad], positive towards the direction of travel
        ("exit_angle", "f8"),
        ("maximum_pressure_angle", "f8"),
        ("in_contact", "?"),
    ],
    align=True,
)
"""Result of `wheel_soil_kernel`: what the soil does to one wheel."""


class WheelSize(NamedTuple):
    """Size of a rigid wheel."""

    radius: float
    """[m]"""
    width: float
    """[m]"""


class WheelMotion(NamedTuple):
    """Motion of a wheel in its horizontal heading frame."""

    v_x: float
    """Velocity of the wheel centre along the heading [m/s]"""
    v_y: float
    """To the left [m/s]"""
    v_z: float
    """Upwards [m/s]"""
    spin: float
    """Rotation about the axle [rad/s], positive rolls forward; omega in the equations"""
    omega_x: float
    """Rate at which the wheel's plane turns about the heading [rad/s]"""
    omega_z: float
    """Rate at which the wheel's plane turns about the vertical [rad/s]"""


Coefficients = tuple[float, float, float, float]
"""Factors of 1, theta, sin(theta) and cos(theta)."""


class Patch(NamedTuple):
    """Extent of a contact patch, and how hard the soil presses in it."""

    entry_angle: float
    """theta_f [rad]"""
    exit_angle: float
    """theta_r [rad]"""
    maximum_pressure_angle: float
    """theta_m [rad]"""
    pressure_factor: float
    """Normal stress over (cos theta - cos theta_f)^n, damping included [Pa]"""
    adhesion: float
    """Share of the cohesion that acts [-]; below 1 where the wheel rises faster than the soil can follow"""


@njit(cache=True, error_model="numpy")
def _smooth_step(x: float) -> float:
    """0 for x <= -1, 1 for x >= 1, C2 in between."""
    if x <= -1.0:
        return 0.0
    if x >= 1.0:
        return 1.0
    t = 0.5 * (x + 1.0)
    return t * t * t * (10.0 - 15.0 * t + 6.0 * t * t)


@njit(cache=True, error_model="numpy")
def slip_ratio(rim_speed: float, v_x: float, standstill_speed: float) -> float:
    """Slip ratio: (r omega - v_x) / (r omega) driving, (r omega - v_x) / v_x braking, within [-1, 1].

    Driving means |r omega| > |v_x|. Where rim and wheel move against each other the ratio is clipped to 1 or -1. It is
    0 at standstill and continuous, except for its sign (not its magnitude, on which the stresses depend) where r omega
    = -v_x.

    Parameters
    ----------
    rim_speed : float
        r omega [m/s].
    v_x : float
        Speed of the wheel centre along the heading [m/s].
    standstill_speed : float
        Below it the ratio fades to 0 [m/s].
    """
    faster = max(abs(rim_speed), abs(v_x))
    if faster < standstill_speed:
        denominator = (faster * faster + standstill_speed * standstill_speed) / (2.0 * standstill_speed)
    else:
        denominator = faster
    slip = min(1.0, abs(rim_speed - v_x) / denominator)
    return slip if abs(rim_speed) > abs(v_x) else -slip


@njit(cache=True, error_model="numpy")
def _sign_change(g_0: float, g_1: float, g_2: float, low: float, high: float) -> float:
    """Root of g_0 + g_1 theta + g_2 sin(theta), monotonic in (low, high); NaN if it has none there."""
    g_low = g_0 + g_1 * low + g_2 * math.sin(low)
    g_high = g_0 + g_1 * high + g_2 * math.sin(high)
    noise = 1e-13 * (abs(g_0) + abs(g_1) + abs(g_2))
    if not (low < high and g_low * g_high < 0.0 and min(abs(g_low), abs(g_high)) > noise):
        return math.nan
    theta = 0.5 * (low + high)
    for _ in range(40):
        g = g_0 + g_1 * theta + g_2 * math.sin(theta)
        if g * g_low > 0.0:
            low = theta
        else:
            high = theta
        step = theta - g / (g_1 + g_2 * math.cos(theta))
        if not low < step < high:
            step = 0.5 * (low + high)
        if abs(step - theta) < 1e-7:
            return step
        theta = step
    return theta


@njit(cache=True, error_model="numpy")
def _shear_reversals(displacement: Coefficients, theta_r: float, theta_f: float, kinks: Array) -> int:
    """Fill `kinks` with the angles at which a shear displacement changes its sign; returns their number."""
    x_0, x_1, x_2, x_3 = displacement
    # x_2 sin(theta) + x_3 cos(theta) = g_2 sin(theta + phase)
    g_2 = math.copysign(math.sqrt(x_2 * x_2 + x_3 * x_3), x_2)
    phase = math.atan2(math.copysign(x_3, x_3 * g_2), abs(x_2)) if g_2 != 0.0 else 0.0
    g_0, g_1 = x_0 - x_1 * phase, x_1
    low, high = theta_r + phase, theta_f + phase
    turn = math.pi if abs(g_1) >= abs(g_2) else math.acos(-g_1 / g_2)
    count = 0
    for start, end in ((low, min(high, -turn)), (max(low, -turn), min(high, turn)), (max(low, turn), high)):
        theta = _sign_change(g_0, g_1, g_2, start, end)
        if not math.isnan(theta):
            kinks[count] = theta - phase
            count += 1
    return count


@njit(cache=True, error_model="numpy", fastmath={"contract", "nsz", "arcp", "reassoc"}, inline="always")
def _sine(x: float) -> float:
    """Taylor series of the sine, error below 1e-11 for |x| <= pi/2.

    It calls no function, so that the loop over the patch vectorises.
    """
    y = x * x
    s = 1.0 - y / 210.0 * (1.0 - y / 272.0)
    s = 1.0 - y / 42.0 * (1.0 - y / 72.0 * (1.0 - y / 110.0 * (1.0 - y / 156.0 * s)))
    return x * (1.0 - y / 6.0 * (1.0 - y / 20.0 * s))


@njit(cache=True, error_model="numpy", fastmath={"contract", "nsz", "arcp", "reassoc"}, inline="always")
def _cosine(x: float) -> float:
    """Taylor series of the cosine, error and range as for `_sine`."""
    y = x * x
    s = 1.0 - y / 182.0 * (1.0 - y / 240.0 * (1.0 - y / 306.0))
    s = 1.0 - y / 30.0 * (1.0 - y / 56.0 * (1.0 - y / 90.0 * (1.0 - y / 132.0 * s)))
    return 1.0 - y / 2.0 * (1.0 - y / 12.0 * s)


@njit(cache=True, error_model="numpy", fastmath={"contract", "nsz", "arcp", "reassoc"}, inline="always")
def _mobilised(x: float) -> float:
    """Shear stress over strength, sign(x) (1 - exp(-|x|)) of Eq. (4), error below 1e-10; vectorises as `_sine`."""
    a = abs(x)
    y = (40.0 if a > 40.0 else a) / -64.0
    e = 1.0 + y / 6.0 * (1.0 + y / 7.0 * (1.0 + y / 8.0 * (1.0 + y / 9.0)))
    e = 1.0 + y * (1.0 + y / 2.0 * (1.0 + y / 3.0 * (1.0 + y / 4.0 * (1.0 + y / 5.0 * e))))
    e = e * e
    e = e * e
    e = e * e
    e = e * e
    e = e * e
    e = e * e
    return math.copysign(1.0 - e, x)


@njit(cache=True, error_model="numpy", fastmath={"contract", "nsz", "arcp", "reassoc"})
def _shear_displacement(
    soil: Any, wheel: WheelSize, patch: Patch, motion: WheelMotion, rate: float
) -> tuple[Coefficients, Coefficients]:
    """Shear displacements over the shear moduli, as functions of the angle (module docstring).

    j_x / K_x = x_0 + x_1 theta + x_2 sin(theta) + x_3 cos(theta), and j_y / K_y likewise with y.
    """
    radius, v_x, v_y, v_z, omega = wheel.radius, motion.v_x, motion.v_y, motion.v_z, motion.spin
    theta_f, theta_r = patch.entry_angle, patch.exit_angle
    speed = abs(omega)
    if speed < rate:
        speed = (speed * speed + rate * rate) / (2.0 * rate)
    enters_front = _smooth_step(omega / rate)
    enters_behind = 1.0 - enters_front
    sin_f, sin_r, cos_f, cos_r = math.sin(theta_f), math.sin(theta_r), math.cos(theta_f), math.cos(theta_r)
    arc = enters_front * theta_f - enters_behind * theta_r
    turn = enters_behind - enters_front
    arc_sin = enters_front * sin_f - enters_behind * sin_r
    arc_cos = enters_front * cos_f - enters_behind * cos_r
    per_x, per_y = 1.0 / (speed * soil.shear_modulus_x), 1.0 / (speed * soil.shear_modulus_y)
    x_0 = (radius * omega * arc - v_x * arc_sin + v_z * arc_cos) * per_x
    x_1, x_2, x_3 = turn * radius * omega * per_x, -turn * v_x * per_x, turn * v_z * per_x
    roll, yaw = radius * motion.omega_x, radius * motion.omega_z
    y_0 = (-v_y * arc - roll * arc_sin + yaw * arc_cos) * per_y
    y_1, y_2, y_3 = -turn * v_y * per_y, -turn * roll * per_y, turn * yaw * per_y
    return (x_0, x_1, x_2, x_3), (y_0, y_1, y_2, y_3)


@njit(cache=True, error_model="numpy", fastmath={"contract", "nsz", "arcp", "reassoc"})
def _interval_ends(x: Coefficients, y: Coefficients, patch: Patch, plane_turns: bool, ends: Array) -> int:
    """Fill `ends` with the reversals of the shear, then 1; returns the number of reversals.

    A kink of the shear stress (reversal of j_x or j_y) must be an end of an integration interval. Ends are given as u
    in (0, 1), which runs from either end of the patch to theta_m.
    """
    theta_f, theta_r, theta_m = patch.entry_angle, patch.exit_angle, patch.maximum_pressure_angle
    count = _shear_reversals(x, theta_r, theta_f, ends)
    if plane_turns:
        count += _shear_reversals(y, theta_r, theta_f, ends[count:])
    for k in range(count):
        kink = ends[k]
        ends[k] = (theta_f - kink) / (theta_f - theta_m) if kink > theta_m else (kink - theta_r) / (theta_m - theta_r)
    ends[:count].sort()
    ends[count] = 1.0
    return count


@njit(cache=True, error_model="numpy", fastmath={"contract", "nsz", "arcp", "reassoc"})
def _add_patch_forces(
    soil: Any, wheel: WheelSize, patch: Patch, motion: WheelMotion, rate: float, share: float, mirror: float, out: Any
) -> None:
    """Add `share` of the patch forces of a wheel in forward travel; mirror = -1: of its fore-aft mirror image."""
    n, cohesion, tan_phi = soil.n, soil.cohesion * patch.adhesion, soil.tan_friction_angle
    resultant = soil.shear_resultant
    theta_f, theta_r, theta_m = patch.entry_angle, patch.exit_angle, patch.maximum_pressure_angle
    cos_f = math.cos(theta_f)
    x, y = _shear_displacement(soil, wheel, patch, motion, rate)
    (x_0, x_1, x_2, x_3), (y_0, y_1, y_2, y_3) = x, y

    # Eq. (3) gives the regions before and behind theta_m the same pressure at equal u (see `_interval_ends`).
    front, rear = theta_f - theta_m, theta_m - theta_r
    ends = np.empty(7)
    count = _interval_ends(x, y, patch, motion.omega_x != 0.0 or motion.omega_z != 0.0, ends)
    kind = 1 if count > 0 else 0
    force_x = force_y = force_z = torque = moment_x = moment_z = 0.0
    pressures = np.empty(NODES)
    for part in range(count + 1):
        start = 0.0 if part == 0 else ends[part - 1]
        extent = ends[part] - start
        for k in range(NODES):
            pressures[k] = (
                patch.pressure_factor
                * max(_cosine(theta_f - front * (start + extent * _POSITION[kind, k])) - cos_f, 0.0) ** n
            )
        for region in range(2):
            theta_0 = theta_f - front * start if region == 0 else theta_r + rear * start
            span = (-front if region == 0 else rear) * extent
            for k in range(NODES):
                theta = theta_0 + span * _POSITION[kind, k]
                length = abs(span) * _WEIGHT[kind, k]
                sin_t, cos_t = _sine(theta), _cosine(theta)
                pressure = pressures[k]
                strength = cohesion + tan_phi * pressure
                displacement_x = x_0 + x_1 * theta + x_2 * sin_t + x_3 * cos_t
                displacement_y = y_0 + y_1 * theta + y_2 * sin_t + y_3 * cos_t
                if resultant:
                    total = math.sqrt(displacement_x * displacement_x + displacement_y * displacement_y) + 1e-300
                    shear = strength * _mobilised(total) / total
                    shear_x, shear_y = shear * displacement_x, shear * displacement_y
                else:
                    shear_x, shear_y = strength * _mobilised(displacement_x), strength * _mobilised(displacement_y)
                force_x += length * (shear_x * cos_t - pressure * sin_t)
                force_y += length * shear_y
                force_z += length * (shear_x * sin_t + pressure * cos_t)
                torque += length * shear_x
                moment_x += length * shear_y * cos_t
                moment_z += length * shear_y * sin_t

    radius = wheel.radius
    area = share * radius * wheel.width
    out.force[0] += mirror * area * force_x
    out.force[1] += area * force_y
    out.force[2] += area * force_z
    out.moment[0] += area * radius * moment_x
    out.moment[1] -= mirror * area * radius * torque
    out.moment[2] += mirror * area * radius * moment_z


@njit(cache=True, error_model="numpy")
def wheel_soil_kernel(
    soil: Any, wheel: WheelSize, sinkage: float, motion: WheelMotion, standstill_rate: float, out: Any
) -> None:
    """Compute the forces on one wheel, for use inside other compiled functions.

    `exumob.ground.terramechanics.wheel_soil_forces` explains them and checks its arguments. This function checks
    nothing: a sinkage of a radius or more is treated as one radius, NaN gives NaN, and the caller must look. Records
    are bare pointers in compiled code: the arrays that hold `soil` and `out` must outlive the call.

    Parameters
    ----------
    soil : record of dtype `exumob.ground.soil.SOIL_RECORD`
        ``Soil.as_record()[0]``.
    wheel : WheelSize
    sinkage : float
        [m]; sinkage <= 0: no contact, all results 0.
    motion : WheelMotion
    standstill_rate : float
        w0 [rad/s], > 0.
    out : record of dtype `PATCH_FORCES`, changed
    """
    for k in range(3):
        out.force[k] = 0.0
        out.moment[k] = 0.0
    out.driving_torque = 0.0
    out.slip_ratio = 0.0
    out.entry_angle = 0.0
    out.exit_angle = 0.0
    out.maximum_pressure_angle = 0.0
    out.in_contact = False
    if sinkage <= 0.0:
        return
    radius, width = wheel.radius, wheel.width
    depth = min(sinkage / radius, 1.0)
    if math.isnan(sinkage):
        depth = sinkage
    slip = slip_ratio(radius * motion.spin, motion.v_x, radius * standstill_rate)
    theta_f = 2.0 * math.asin(math.sqrt(0.5 * depth))
    theta_r = -2.0 * math.asin(math.sqrt(0.5 * soil.rebound_ratio * depth))
    theta_m = (soil.c1 + soil.c2 * abs(slip)) * theta_f
    if soil.reece_pressure:
        pressure_factor = (soil.k_c + soil.k_phi * width) * (radius / width) ** soil.n
    else:
        pressure_factor = (soil.k_c / width + soil.k_phi) * radius**soil.n
    damping = max(0.0, 1.0 - soil.damping * motion.v_z)
    pressure_factor *= damping
    adhesion = min(damping, 1.0)  # a wheel that rises too fast for the soil to follow loses its adhesion too
    patch = Patch(theta_f, theta_r, theta_m, pressure_factor, adhesion)

    forward = _smooth_step(motion.v_x / (radius * standstill_rate))
    if forward > 0.0:
        _add_patch_forces(soil, wheel, patch, motion, standstill_rate, forward, 1.0, out)
    if forward < 1.0:
        mirrored = WheelMotion(
            -motion.v_x, motion.v_y, motion.v_z, -motion.spin, motion.omega_x, -motion.omega_z
        )  # fmt: skip
        _add_patch_forces(soil, wheel, patch, mirrored, standstill_rate, 1.0 - forward, -1.0, out)
    out.driving_torque = -out.moment[1]
    out.slip_ratio = slip
    out.entry_angle = theta_f
    out.exit_angle = theta_r
    out.maximum_pressure_angle = theta_m
    out.in_contact = True
