"""The wheel-soil kernel against adaptive quadrature of Eqs. (3) to (5), written a second time here.

Error: the largest difference of a force component over |F|, or of a moment component over r |F|, |F| the magnitude of
the reference force. Required: 1e-4 anywhere. The sampled states of the moving regimes must stay below 1e-5; at
rest, where the shear of a moving patch flips within 0.1 degrees, the bound is the required 1e-4.
"""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad_vec
from scipy.optimize import brentq

from exumob.ground import contact_patch
from exumob.ground.contact_patch import PATCH_FORCES, WheelMotion, WheelSize, wheel_soil_kernel
from exumob.ground.soil import Soil

RATE = 0.01
REGIMES = ("driving", "braking", "any slip", "counter-rotating", "locked", "nearly locked", "nearly at rest", "at rest")


def smooth_step(x):
    t = min(max(0.5 * (x + 1.0), 0.0), 1.0)
    return t**3 * (10.0 - 15.0 * t + 6.0 * t * t)


def patch_reference(soil, r, b, z, v_x, v_y, v_z, omega, omega_x, omega_z, slip):
    """Force and moment of the forward-travel patch by adaptive quadrature between all kinks."""
    cos_f = 1.0 - z / r
    theta_f, theta_r = math.acos(cos_f), -math.acos(1.0 - soil.rebound_ratio * z / r)
    theta_m = (soil.c1 + soil.c2 * abs(slip)) * theta_f
    damping = max(0.0, 1.0 - soil.damping * v_z)
    stiffness, cohesion = soil.pressure(1.0, b) * damping, soil.cohesion * min(damping, 1.0)
    spin = abs(omega) if abs(omega) >= RATE else (omega**2 + RATE**2) / (2.0 * RATE)
    w = smooth_step(omega / RATE)

    def displacement(theta):
        front = r * omega * (theta_f - theta) - v_x * (math.sin(theta_f) - math.sin(theta))
        front -= v_z * (math.cos(theta) - math.cos(theta_f))
        behind = r * omega * (theta - theta_r) - v_x * (math.sin(theta) - math.sin(theta_r))
        behind -= v_z * (math.cos(theta_r) - math.cos(theta))
        front_y = v_y * (theta_f - theta) + r * omega_x * (math.sin(theta_f) - math.sin(theta))
        front_y += r * omega_z * (math.cos(theta) - math.cos(theta_f))
        behind_y = v_y * (theta - theta_r) + r * omega_x * (math.sin(theta) - math.sin(theta_r))
        behind_y += r * omega_z * (math.cos(theta_r) - math.cos(theta))
        return (w * front + (1.0 - w) * behind) / spin, -(w * front_y + (1.0 - w) * behind_y) / spin

    def integrand(theta):
        equal = theta if theta >= theta_m else theta_f - (theta - theta_r) / (theta_m - theta_r) * (theta_f - theta_m)
        sigma = stiffness * (r * max(math.cos(equal) - cos_f, 0.0)) ** soil.n
        strength = cohesion + sigma * math.tan(soil.friction_angle)
        x, y = (j / k for j, k in zip(displacement(theta), (soil.shear_modulus_x, soil.shear_modulus_y), strict=True))
        if soil.shear_limit == "per_axis":
            t_x = math.copysign(-strength * math.expm1(-abs(x)), x)
            t_y = math.copysign(-strength * math.expm1(-abs(y)), y)
        else:
            total = math.hypot(x, y)
            share = 0.0 if total == 0.0 else -strength * math.expm1(-total) / total
            t_x, t_y = share * x, share * y
        c, s = math.cos(theta), math.sin(theta)
        return np.array([t_x * c - sigma * s, t_y, t_x * s + sigma * c, r * t_y * c, -r * t_x, r * t_y * s])

    ladder = np.array([0.0, 1e-9, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 0.1, 0.5])
    kinks = []
    scan = np.linspace(theta_r, theta_f, 400)
    j = np.array([displacement(theta) for theta in scan])
    for i, axis in zip(*np.nonzero(j[:-1] * j[1:] < 0.0), strict=True):
        kinks.append(brentq(lambda theta, axis=axis: displacement(theta)[axis], scan[i], scan[i + 1]))
    ends = np.unique(
        [*(theta_f - (theta_f - theta_m) * ladder), theta_m, *(theta_r + (theta_m - theta_r) * ladder), *kinks]
    )
    tolerance = 1e-10 * (stiffness * r**soil.n + cohesion)
    total = np.zeros(6)
    for low, high in pairwise(ends):
        total += quad_vec(integrand, low, high, epsrel=1e-8, epsabs=tolerance, norm="max", limit=200)[0]
    return r * b * total


def reference(soil, r, b, z, v, spin):
    omega, omega_x, omega_z = spin
    rim, slow = r * omega, r * RATE
    faster = max(abs(rim), abs(v[0]))
    slip = min(1.0, abs(rim - v[0]) / (faster if faster >= slow else (faster**2 + slow**2) / (2.0 * slow)))
    forward = smooth_step(v[0] / slow)
    total = np.zeros(6)
    if forward > 0.0:
        total += forward * patch_reference(soil, r, b, z, *v, *spin, slip)
    if forward < 1.0:
        mirror = np.array([-1.0, 1.0, 1.0, 1.0, -1.0, -1.0])
        total += (
            (1.0 - forward)
            * mirror
            * patch_reference(soil, r, b, z, -v[0], v[1], v[2], -omega, omega_x, -omega_z, slip)
        )
    return total


def error(soil, r, b, z, v, spin):
    result = np.zeros(1, PATCH_FORCES)
    omega, omega_x, omega_z = spin
    motion = WheelMotion(*map(float, (*v, omega, omega_x, omega_z)))
    wheel_soil_kernel(soil.as_record()[0], WheelSize(r, b), z, motion, RATE, result[0])
    computed = np.concatenate([result["force"][0], result["moment"][0]])
    exact = reference(soil, r, b, z, v, spin)
    scale = np.linalg.norm(exact[:3]) * np.array([1.0, 1.0, 1.0, r, r, r])
    return (np.abs(computed - exact) / scale).max()


def random_state(rng, regime):
    """Wheel size, sinkage (0.1 to 95 % of the radius), velocity, spin and turning rates of the wheel's plane."""
    r = math.exp(rng.uniform(math.log(0.05), math.log(0.8)))
    b, z = r * rng.uniform(0.3, 1.2), r * math.exp(rng.uniform(math.log(1e-3), math.log(0.95)))
    omega = rng.choice([-1.0, 1.0]) * math.exp(rng.uniform(math.log(0.02), math.log(100.0)))
    creep, turn = rng.uniform(-2.0, 2.0) * RATE * r, rng.uniform(-2.0, 2.0) * RATE
    v_x, omega = {
        "driving": (r * omega * rng.uniform(0.0, 1.0), omega),
        "braking": (r * omega * rng.uniform(1.0, 2.0), omega),
        "any slip": (r * omega * math.exp(rng.uniform(-5.0, 5.0)), omega),
        "counter-rotating": (-r * omega * math.exp(rng.uniform(-5.0, 5.0)), omega),
        "locked": (r * omega, 0.0),
        "nearly locked": (r * omega, turn),
        "nearly at rest": (creep, omega),
        "at rest": (creep, turn),
    }[regime]
    v_y = rng.choice([0.0, 1.0, -1.0]) * math.exp(rng.uniform(math.log(1e-4), math.log(3.0)))
    turning = rng.choice([0.0, 1.0]) * rng.uniform(-1.0, 1.0, 2)
    return r, b, z, (v_x, v_y, rng.uniform(-0.5, 0.5)), (omega, *turning)


@pytest.mark.parametrize("regime", REGIMES)
def test_kernel_agrees_with_adaptive_quadrature(regime):
    rng = np.random.default_rng(REGIMES.index(regime))
    errors = []
    for row in Soil.published_table():
        soil = replace(
            row.soil, rebound_ratio=rng.choice([0.0, 0.0, 0.1, 0.5]), shear_limit=rng.choice(["per_axis", "resultant"])
        )
        errors.append(error(soil, *random_state(rng, regime)))
    # with moving patches at standstill the shear flips within 0.1 degrees: the limit there is the method's 1e-4
    assert max(errors) < (1e-4 if "rest" in regime else 1e-5)


def test_sharp_reversal_of_the_shear():
    """Braked, deep, stiff in shear: the shear flips within a few degrees (6e-3 off without a split at the reversal)."""
    soil = replace(Soil.published("Lean clay 22 %"), rebound_ratio=0.1)
    assert error(soil, 0.46, 0.3, 0.368, (4.1206, -0.042, 0.0), (5.5918, 0.0, 0.0)) < 2e-5


def test_reece_form():
    soil = replace(Soil.published("LETE sand"), k_c=1.4e5, k_phi=6.8e5, n=0.47, pressure_form="reece")
    assert error(soil, 0.627, 0.152, 0.12, (0.5, 0.05, 0.0), (1.0, 0.0, 0.0)) < 1e-6


@pytest.mark.parametrize("clustering", ["one end", "both ends"])
def test_error_falls_with_the_number_of_nodes(clustering):
    """At the most singular exponent of the table (n = 0.11), where the end of the patch limits the order."""
    worst = []
    for count in (6, 10, 14, 18):
        positions, weights = contact_patch._clustered_nodes(count, contact_patch.CLUSTERING)
        position, weight = (a[int(clustering == "both ends")] for a in (positions, weights))
        exact = 1.0 / (0.11 + 1.0)
        worst.append(abs(float(weight @ position**0.11) - exact) / exact)
    assert all(b < a for a, b in pairwise(worst))
    assert worst[-1] < 1e-6
    assert weight.sum() == pytest.approx(1.0)
