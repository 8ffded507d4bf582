"""Wheel on soil: limits, symmetry, regimes and their joints, dissipation, damping, bad input."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numba import njit
from scipy.optimize import brentq

from exumob.ground.contact_patch import PATCH_FORCES, WheelMotion, WheelSize, wheel_soil_kernel
from exumob.ground.soil import Soil
from exumob.ground.terramechanics import contact_stresses, wheel_soil_forces

LETE = Soil.published("LETE sand")
RADIUS, WIDTH = 0.100, 0.080
SINKAGE = 0.012
RATE = 0.01


def forces(velocity, omega, soil=LETE, sinkage=SINKAGE, **options):
    return wheel_soil_forces(soil, RADIUS, WIDTH, sinkage, velocity, omega, **options)


def vector(result):
    return np.concatenate([result.force, result.moment])


@njit
def evaluate(soil, radius, width, sinkage, v_x, v_y, v_z, omega, rate, results):
    for i in range(sinkage.size):
        motion = WheelMotion(v_x[i], v_y[i], v_z[i], omega[i], 0.0, 0.0)
        wheel_soil_kernel(soil[0], WheelSize(radius[i], width[i]), sinkage[i], motion, rate, results[i])


def sweep(v_x, v_y, omega, sinkage=SINKAGE, soil=LETE):
    """Forces and moments, shape (n, 6), for arrays that broadcast."""
    v_x, v_y, omega, sinkage = (
        np.ascontiguousarray(a, dtype=float) for a in np.broadcast_arrays(v_x, v_y, omega, sinkage)
    )
    results = np.empty(v_x.size, PATCH_FORCES)
    one = np.ones(v_x.size)
    evaluate(soil.as_record(), RADIUS * one, WIDTH * one, sinkage, v_x, v_y, 0.0 * one, omega, RATE, results)
    return np.concatenate([results["force"], results["moment"]], axis=1)


# Limits ---------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("sinkage", [0.0, -0.01, -1.0])
def test_lifted_off_feels_nothing(sinkage):
    result = forces((0.8, 0.1, -0.2), 10.0, sinkage=sinkage)
    assert not vector(result).any()
    assert (result.driving_torque, result.slip_ratio, result.entry_angle) == (0.0, 0.0, 0.0)


def test_frictionless_soil_gives_the_integral_of_the_pressure():
    """No strength: compaction resistance b k z^(n+1) / (n+1) (Bekker 1956), whatever theta_m, if theta_m = 0."""
    soil = replace(LETE, cohesion=0.0, friction_angle=0.0, c1=0.0, c2=0.0)
    result = forces((1.0, 0.3, 0.0), 10.0, soil=soil)
    stiffness = soil.pressure(1.0, WIDTH)
    assert result.force[0] == pytest.approx(-WIDTH * stiffness * SINKAGE ** (soil.n + 1.0) / (soil.n + 1.0), rel=1e-6)
    assert result.force[1] == 0.0
    assert not result.moment.any()


def test_saturated_shear_of_a_purely_cohesive_soil():
    """Locked wheel, phi = 0: tau = -c everywhere, so M_y = c r^2 b (theta_f - theta_r)."""
    soil = replace(LETE, cohesion=5.0e3, friction_angle=0.0)
    result = forces((2.0, 0.0, 0.0), 0.0, soil=soil)
    assert result.driving_torque == pytest.approx(-5.0e3 * RADIUS**2 * WIDTH * result.entry_angle, rel=1e-9)
    assert result.moment[1] == -result.driving_torque


def test_angles():
    soil = replace(LETE, rebound_ratio=0.3)
    result = forces((0.8, 0.0, 0.0), 10.0, soil=soil)
    assert result.entry_angle == pytest.approx(math.acos(1.0 - SINKAGE / RADIUS))
    assert result.exit_angle == pytest.approx(-math.acos(1.0 - 0.3 * SINKAGE / RADIUS))
    assert result.slip_ratio == pytest.approx(0.2)
    assert result.maximum_pressure_angle == pytest.approx((0.18 + 0.32 * 0.2) * result.entry_angle)


@pytest.mark.parametrize(
    ("v_x", "omega", "slip"),
    [
        (0.8, 10.0, 0.2), (1.25, 10.0, -0.2), (1.0, 10.0, 0.0), (0.0, 10.0, 1.0), (1.0, 0.0, -1.0), (-0.8, -10.0, 0.2),
        (-1.25, -10.0, -0.2), (0.0, 0.0, 0.0), (-1.0, 2.0, -1.0), (-0.2, 10.0, 1.0),
    ],
)  # fmt: skip
def test_slip_ratio(v_x, omega, slip):
    assert forces((v_x, 0.0, 0.0), omega).slip_ratio == pytest.approx(slip)


def test_forces_are_the_integrals_of_the_stresses():
    for soil in (LETE, replace(LETE, rebound_ratio=0.2, shear_limit="resultant")):
        for v, omega in (
            ((0.8, 0.1, 0.0), 10.0),
            ((1.3, -0.2, 0.0), 10.0),
            ((-0.5, 0.1, 0.0), -7.0),
            ((0.5, 0.1, 0.0), -7.0),
        ):
            result, s = (
                forces(v, omega, soil=soil),
                contact_stresses(soil, RADIUS, WIDTH, SINKAGE, v, omega, points=20001),
            )
            area, sign = RADIUS * WIDTH, math.copysign(1.0, v[0])
            f_x = sign * area * np.trapezoid(s.shear_x * np.cos(s.angle) - s.normal * np.sin(s.angle), s.angle)
            f_z = area * np.trapezoid(s.shear_x * np.sin(s.angle) + s.normal * np.cos(s.angle), s.angle)
            torque = sign * RADIUS * area * np.trapezoid(s.shear_x, s.angle)
            m_z = sign * RADIUS * area * np.trapezoid(s.shear_y * np.sin(s.angle), s.angle)
            expected = (f_x, area * np.trapezoid(s.shear_y, s.angle), f_z)
            assert result.force == pytest.approx(expected, abs=1e-5 * np.linalg.norm(result.force))
            assert result.driving_torque == pytest.approx(torque, abs=1e-5 * RADIUS * np.linalg.norm(result.force))
            assert result.moment[2] == pytest.approx(m_z, abs=1e-5 * RADIUS * np.linalg.norm(result.force))


def test_resultant_shear_stays_within_the_strength():
    soil = replace(LETE, shear_limit="resultant")
    s = contact_stresses(soil, RADIUS, WIDTH, SINKAGE, (0.3, 0.5, 0.0), 10.0)
    strength = soil.cohesion + s.normal * math.tan(soil.friction_angle)
    assert (np.hypot(s.shear_x, s.shear_y) <= strength * (1.0 + 1e-12)).all()
    per_axis = contact_stresses(LETE, RADIUS, WIDTH, SINKAGE, (0.3, 0.5, 0.0), 10.0)
    assert (np.hypot(per_axis.shear_x, per_axis.shear_y) > strength).any()


def test_shear_limits_agree_without_side_slip():
    resultant = forces((0.8, 0.0, 0.0), 10.0, soil=replace(LETE, shear_limit="resultant"))
    assert vector(resultant) == pytest.approx(vector(forces((0.8, 0.0, 0.0), 10.0)), rel=1e-9, abs=1e-9)


# Symmetry -------------------------------------------------------------------------------------------------------------

STATES = [
    (0.8, 0.1, 10.0),
    (1.3, -0.2, 10.0),
    (0.4, 0.3, 0.0),
    (0.3, 0.1, -5.0),
    (5e-4, 0.02, 3.0),
    (2e-4, -1e-4, 4e-3),
]


@pytest.mark.parametrize(("v_x", "v_y", "omega"), STATES)
def test_mirror_left_right(v_x, v_y, omega):
    there, back = vector(forces((v_x, v_y, 0.0), omega)), vector(forces((v_x, -v_y, 0.0), omega))
    assert back == pytest.approx(there * [1, -1, 1, -1, 1, -1], rel=1e-12, abs=1e-12)


@pytest.mark.parametrize(("v_x", "v_y", "omega"), STATES)
def test_mirror_fore_aft(v_x, v_y, omega):
    there, back = vector(forces((v_x, v_y, 0.0), omega)), vector(forces((-v_x, v_y, 0.0), -omega))
    assert back == pytest.approx(there * [-1, 1, 1, 1, -1, -1], rel=1e-9, abs=1e-9)


def test_standing_still_is_symmetric():
    result = forces((0.0, 0.0, 0.0), 0.0)
    assert vector(result)[[0, 1, 3, 4, 5]] == pytest.approx(np.zeros(5), abs=1e-12)
    assert result.force[2] > 100.0


# Regimes and their joints ---------------------------------------------------------------------------------------------


def test_signs_in_every_regime():
    driving, braking = forces((0.5, 0.0, 0.0), 10.0), forces((1.6, 0.0, 0.0), 10.0)
    locked, spinning, reverse = (
        forces((0.5, 0.0, 0.0), 0.0),
        forces((0.0, 0.0, 0.0), 10.0),
        forces((-0.5, 0.0, 0.0), -10.0),
    )
    assert driving.force[0] > 0.0 > braking.force[0]
    assert driving.driving_torque > 0.0 > braking.driving_torque
    assert locked.force[0] < braking.force[0]
    assert spinning.force[0] > 0.0
    assert reverse.force[0] < 0.0 and reverse.driving_torque < 0.0
    sideways = forces((0.0, 0.2, 0.0), 0.0)
    assert sideways.force[1] < 0.0 and sideways.moment[0] < 0.0
    assert sideways.force[0] == pytest.approx(0.0, abs=1e-12)


PATHS = {
    "driving to braking": (lambda t: 1.0, lambda t: 0.0, lambda t: 14.0 - 8.0 * t),
    "braking to locked to counter-rotating": (lambda t: 0.3, lambda t: 0.0, lambda t: 0.2 - 0.4 * t),
    "forward to reverse, rolling": (lambda t: 0.02 - 0.04 * t, lambda t: 0.0, lambda t: 0.2 - 0.4 * t),
    "forward to reverse, locked": (lambda t: 0.02 - 0.04 * t, lambda t: 0.0, lambda t: 0.0),
    "forward to reverse, spinning": (lambda t: 0.02 - 0.04 * t, lambda t: 0.01, lambda t: 4.0),
    "standstill to rolling": (lambda t: 0.008 * t, lambda t: 0.0, lambda t: 0.1 * t),
    "standstill to side slip": (lambda t: 0.0, lambda t: 0.01 * t, lambda t: 0.0),
    "side slip reverses while rolling": (lambda t: 0.5, lambda t: 0.3 - 0.6 * t, lambda t: 5.5),
    "around the origin": (lambda t: 8e-4 * math.sin(6.3 * t), lambda t: 1e-4, lambda t: 8e-3 * math.cos(6.3 * t)),
}


@pytest.mark.parametrize("shear_limit", ["per_axis", "resultant"])
@pytest.mark.parametrize("name", PATHS)
def test_continuous_along(name, shear_limit):
    """Ten times finer steps must give about ten times smaller jumps: a discontinuity would keep its size."""
    soil = replace(LETE, shear_limit=shear_limit)
    largest = []
    for steps in (5_000, 50_000):
        t = np.linspace(0.0, 1.0, steps + 1)
        v_x, v_y, omega = (np.array([f(x) for x in t]) for f in PATHS[name])
        results = sweep(v_x, v_y, omega, soil=soil)
        scale = np.abs(results[:, 2]).max() * np.array([1, 1, 1, RADIUS, RADIUS, RADIUS])
        largest.append((np.abs(np.diff(results, axis=0)) / scale).max())
    assert largest[1] < 0.2 * largest[0]
    assert largest[1] < 1e-2


def test_continuous_at_touch_down():
    """The force vanishes with the sinkage; the cohesive part as its square root."""
    z = np.logspace(-12, -4, 9)
    force = np.linalg.norm(sweep(0.8, 0.1, 10.0, z)[:, :3], axis=1)
    assert (np.diff(force) > 0.0).all()
    assert force[0] < 1e-3


def test_vertical_force_grows_with_sinkage():
    assert (np.diff(sweep(0.8, 0.0, 10.0, np.linspace(1e-4, 0.099, 400))[:, 2]) > 0.0).all()


# Dissipation ----------------------------------------------------------------------------------------------------------


def power_over_scale(soil, count, seed):
    """F.v + M.omega over |F| times the largest speed, for random states of wheels that do not move vertically."""
    rng = np.random.default_rng(seed)
    radius = np.exp(rng.uniform(np.log(0.05), np.log(0.8), count))
    width = radius * rng.uniform(0.3, 1.2, count)
    sinkage = radius * np.exp(rng.uniform(np.log(1e-4), np.log(0.95), count))
    angle, speed = rng.uniform(0.0, 2.0 * np.pi, count), np.exp(rng.uniform(np.log(1e-5), np.log(20.0), count))
    omega, v_x = speed * np.cos(angle) / radius, speed * np.sin(angle)
    near_rolling = rng.random(count) < 0.4
    v_x = np.where(near_rolling, radius * omega * (1.0 + rng.normal(0.0, 0.5, count)), v_x)
    v_y = rng.choice([0.0, 1.0, -1.0], count) * np.exp(rng.uniform(np.log(1e-6), np.log(5.0), count))
    out = np.empty(count, PATCH_FORCES)
    evaluate(soil.as_record(), radius, width, sinkage, v_x, v_y, np.zeros(count), omega, RATE, out)
    power = out["force"][:, 0] * v_x + out["force"][:, 1] * v_y + out["moment"][:, 1] * omega
    fastest = np.maximum(np.maximum(abs(v_x), abs(v_y)), radius * abs(omega))
    assert np.isfinite(power).all()
    return power / (np.linalg.norm(out["force"], axis=1) * fastest)


@pytest.mark.parametrize("shear_limit", ["per_axis", "resultant"])
@pytest.mark.parametrize("rebound_ratio", [0.0, 0.5])
def test_soil_never_gives_energy(shear_limit, rebound_ratio):
    """Over all published soils, sizes, sinkages and regimes."""
    for seed, row in enumerate(Soil.published_table()):
        soil = replace(row.soil, shear_limit=shear_limit, rebound_ratio=rebound_ratio)
        assert power_over_scale(soil, 10_000, seed).max() <= 1e-6, row.name


def test_full_rebound_gives_little_energy_and_only_when_nearly_at_rest():
    """kappa = 1, sunk nearly to the centre: inside the standstill bands up to 2 % of |F| v, as the module states."""
    worst = max(
        power_over_scale(replace(row.soil, rebound_ratio=1.0), 10_000, 1).max() for row in Soil.published_table()
    )
    assert worst < 0.02


# Damping --------------------------------------------------------------------------------------------------------------


def test_damping_raises_the_pressure_while_sinking_and_never_pulls():
    smooth = replace(LETE, friction_angle=0.0, cohesion=0.0)
    standing, sinking, rising = (forces((0.0, 0.0, v_z), 0.0, soil=smooth).force[2] for v_z in (0.0, -0.25, 100.0))
    assert sinking == pytest.approx(standing * (1.0 + LETE.damping * 0.25))
    assert rising == pytest.approx(0.0, abs=1e-9)
    assert forces((0.0, 0.0, 100.0), 0.0).force == pytest.approx(np.zeros(3), abs=1e-9)


def test_resistance_to_slow_motion_is_dissipative():
    """At rest, minus the derivative of force and moment with respect to velocity and angular velocity is positive
    semidefinite, because every rim element resists along its own sliding direction: no slow swinging of a standing
    vehicle can draw energy from the soil. It is symmetric up to the blend of the two entries, terms of theta_f^2 / 12
    (3 % found at this depth, 5 % allowed), which leave the smallest eigenvalue at -1e-4 of the largest (1e-3 is
    allowed)."""
    soil = replace(LETE, damping=0.0)

    def load(u):
        return vector(forces(u[:3], u[3:], soil=soil, sinkage=0.03))

    step = 1e-8
    resistance = np.array([(load(-step * e) - load(step * e)) / (2.0 * step) for e in np.eye(6)]).T
    scale = np.sqrt(np.outer(np.diag(resistance), np.diag(resistance)))
    assert np.abs((resistance - resistance.T) / scale).max() < 0.05
    assert np.linalg.eigvalsh(0.5 * (resistance + resistance.T) / scale).min() > -1e-3
    assert (np.diag(resistance)[:3] > 100.0).all()


def test_turning_on_the_spot_is_resisted():
    """A wheel that turns about the vertical scrubs the soil: its moment opposes the turning."""
    still, turning = forces((0.0, 0.0, 0.0), 0.0), forces((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    assert still.moment[2] == 0.0
    assert turning.moment[2] < -0.1 * turning.force[2] * RADIUS * 0.1


def test_default_damping_is_a_fifth_of_critical_for_the_reference_wheel():
    """2 kg, 140 N, LETE sand: damping ratio c / (2 sqrt(k m)) with c = 140 N * damping."""
    load, mass = 140.0, 2.0

    def support(z):
        return forces((0.0, 0.0, 0.0), 0.0, sinkage=z).force[2]

    z = brentq(lambda z: support(z) - load, 1e-5, 0.09)
    stiffness = (support(z + 1e-6) - support(z - 1e-6)) / 2e-6
    assert LETE.damping * load / (2.0 * math.sqrt(stiffness * mass)) == pytest.approx(0.20, abs=0.02)


# Bad input ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((0.0, WIDTH, 0.01, (1, 0, 0), 10.0), "wheel_radius = 0.0 m must be > 0"),
        ((RADIUS, -0.08, 0.01, (1, 0, 0), 10.0), "wheel_width = -0.08 m must be > 0"),
        ((RADIUS, WIDTH, math.nan, (1, 0, 0), 10.0), "sinkage = nan is not a finite number"),
        ((RADIUS, WIDTH, 0.1, (1, 0, 0), 10.0), r"sinkage = 0.1 m reaches the wheel centre .* firmer soil"),
        ((RADIUS, WIDTH, 0.01, (1, 0), 10.0), r"velocity has shape \(2,\)"),
        ((RADIUS, WIDTH, 0.01, (1, math.inf, 0), 10.0), "velocity.*not finite"),
        ((RADIUS, WIDTH, 0.01, (1, 0, 0), math.nan), "angular_velocity = nan"),
    ],
)
def test_bad_input_is_named(arguments, message):
    with pytest.raises(ValueError, match=message):
        wheel_soil_forces(LETE, *arguments)


def test_stresses_need_a_moving_wheel_that_touches():
    with pytest.raises(ValueError, match="standstill bands"):
        contact_stresses(LETE, RADIUS, WIDTH, SINKAGE, (0.5, 0.0, 0.0), 0.0)
    with pytest.raises(ValueError, match="does not touch"):
        contact_stresses(LETE, RADIUS, WIDTH, 0.0, (0.5, 0.0, 0.0), 5.0)


def test_kernel_saturates_below_the_centre_and_passes_nan_on():
    results = sweep(0.5, 0.1, 5.0, np.array([RADIUS, 3.0 * RADIUS, math.nan]))
    assert np.isfinite(results[:2]).all()
    assert results[1] == pytest.approx(results[0])
    assert np.isnan(results[2]).all()


@pytest.mark.parametrize(("c1", "c2"), [(0.0, 0.0), (1.0, 0.0), (0.5, 0.5)])
def test_degenerate_maximum_pressure_angle(c1, c2):
    soil = replace(LETE, c1=c1, c2=c2)
    for v_x, omega in ((0.5, 5.0), (0.5, 10.0), (0.5, 3.0), (0.5, 0.0), (0.0, 5.0)):
        assert np.isfinite(vector(forces((v_x, 0.1, 0.0), omega, soil=soil))).all()


# -- deep wheels run ahead of their tread ------------------------------------------------------------------------------


def carried(soil, load, slip, radius=0.3, width=0.185, spin=5.0):
    """Forces on a wheel that carries a load [N] at a slip ratio, and its speed [m/s]."""
    speed = radius * spin * (1.0 - slip) if slip >= 0.0 else radius * spin / (1.0 + slip)

    def lacking(sinkage):
        return wheel_soil_forces(soil, radius, width, sinkage, (speed, 0.0, 0.0), spin).force[2] - load

    sinkage = brentq(lacking, 1e-6, 0.99 * radius, xtol=1e-12)
    return wheel_soil_forces(soil, radius, width, sinkage, (speed, 0.0, 0.0), spin), speed


@pytest.mark.parametrize(
    ("name", "expected"), [("Upland sandy loam 51 %", -0.077), ("LETE sand", 0.031), ("Heavy clay 25 %", None)]
)
def test_slip_of_a_wheel_that_pulls_nothing(name, expected):
    """A rim that is longer than the ground it covers may run behind its axle, but never without being driven.

    Without pull the axle still gives power, all of which the soil takes.
    """
    soil = Soil.published(name)
    slip = brentq(lambda s: carried(soil, 2600.0, s)[0].force[0], -0.3, 0.5)
    forces, _ = carried(soil, 2600.0, slip)
    assert forces.driving_torque > 0.0
    if expected is not None:
        assert slip == pytest.approx(expected, abs=2e-3)


@pytest.mark.parametrize("name", ["Upland sandy loam 51 %", "LETE sand", "Heavy clay 25 %"])
def test_rim_that_covers_its_chord_leaves_the_soil_where_it_met_it(name):
    """At that slip the shear displacement is 0 at both ends of the patch, and forward everywhere between."""
    soil, radius, spin = Soil.published(name), 0.3, 5.0
    theta = math.acos(1.0 - 0.2)
    speed = radius * spin * theta / math.sin(theta)
    found = contact_stresses(soil, radius, 0.185, 0.2 * radius, (speed, 0.0, 0.0), spin)
    assert found.shear_x[0] == pytest.approx(0.0, abs=1e-6 * found.shear_x.max())
    assert found.shear_x[-1] == pytest.approx(0.0, abs=1e-6 * found.shear_x.max())
    assert found.shear_x[1:-1].min() > 0.0 and found.shear_x.max() > 0.1 * found.normal.max()
