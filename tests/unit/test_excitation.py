"""Multisines that can be told apart, and the prescribed motions made of them."""

from dataclasses import replace

import numpy as np
import pytest

from exumob.towing_tank.checks import check_motion
from exumob.towing_tank.excitation import CHANNELS, MIRRORED, STANDING, Envelope, Excitation
from exumob.towing_tank.multisine import relative_peak_factor, shared_harmonics, small_peak
from exumob.water.conditions import Water
from vehicle_models.amphibious import amphibious_vehicle
from vehicle_models.light_4x4 import light_4x4
from vehicle_models.small_car import small_car

ENVELOPE = Envelope(
    speed=(-0.6, 1.0), sway=(-0.2, 0.2), yaw_rate=(-0.6, 0.6), slip=(-0.1, 0.5), steering=(-0.5, 0.5),
    heave=(-0.02, 0.01), pitch=(-0.03, 0.05), roll=(-0.03, 0.03), sinkage=(0.0, 0.02),
)  # fmt: skip
OFFSETS = (0.0, 0.5, -1.0, 0.3, 0.0, 1.0, -0.4, 0.2, 0.7)
MOTION = Excitation(ENVELOPE, (0.8, 0.0, -0.5), offsets=OFFSETS, seed=3)
WATER = Water(0.1, 0.7, 2.5)


# -- multisines --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("turn", range(4))
def test_signals_are_orthogonal_over_the_period(turn):
    signals = replace(MOTION, turn=turn).multisines()
    cycles = np.arange(4000) / 4000
    x = np.stack([signal.at(cycles) for signal in signals])
    correlation = np.corrcoef(x)
    assert np.abs(correlation - np.eye(len(CHANNELS))).max() < 1e-12
    assert np.abs(x.mean(axis=1)).max() < 1e-12


def test_each_harmonic_belongs_to_one_signal_and_places_turn():
    first, second = (shared_harmonics(7.0, [1.0, 1.0, 4.0], turn) for turn in (0, 1))
    used = [multiple for own in first for multiple in own]
    assert sorted(used) == list(range(1, 29))
    assert max(first[0] + first[1]) == 7 and min(first[2]) == 8
    assert first[0] == second[1] or first[1] == second[0]
    with pytest.raises(ValueError, match=r"period = 1 s is too short to tell 3 signals"):
        shared_harmonics(1.0, [1.0, 1.0, 1.0])


@pytest.mark.parametrize("harmonics", [(3,), (1, 6), (2, 5, 9), (1, 2, 3, 4, 5, 6, 7, 8), tuple(range(4, 40, 3))])
def test_peaks_are_small(harmonics):
    """Random phases give 1.5 to 2 for eight sines, equal phases 2.5 and more."""
    signal = small_peak(harmonics, 0).at(np.arange(20_000) / 20_000)
    assert np.abs(signal).max() == pytest.approx(1.0, abs=3e-3)
    assert relative_peak_factor(signal) < {1: 1.0 + 1e-5, 2: 1.415}.get(len(harmonics), 1.31)
    alike = sum(np.sin(2.0 * np.pi * h * np.arange(20_000) / 20_000) for h in harmonics)
    assert relative_peak_factor(signal) <= relative_peak_factor(alike) + 1e-5


def test_peak_factor_is_that_of_a_sine_and_of_nothing():
    assert relative_peak_factor(3.0 * np.sin(np.linspace(0.0, 2.0 * np.pi, 1001)[:-1])) == pytest.approx(1.0, abs=1e-5)
    for nothing in (np.zeros(5), np.array([])):
        with pytest.raises(ValueError, match="is 0 everywhere"):
            relative_peak_factor(nothing)


# -- motions -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("speeds", [(1.0,), (0.8, 0.0, -0.5), (0.0, 0.9), (-0.6, 0.4)])
@pytest.mark.parametrize("seed", [0, 5])
def test_all_stays_within_the_envelope(speeds, seed):
    motion = replace(MOTION, speeds=speeds, seed=seed, turn=seed)
    values = motion.values(np.linspace(motion.ramp_time, motion.duration, 5001))
    low, high = ENVELOPE.ranges.T
    assert (values >= low - 2e-3 * (high - low)).all() and (values <= high + 2e-3 * (high - low)).all()
    used = np.ptp(values, axis=0) / (high - low)
    assert (used[3:] > 0.5).all()  # slip, steering and all that is vertical move over half of their ranges at least


def test_rates_stay_within_the_envelope_and_constant_parts_take_the_rest():
    """Root mean square over the largest rate: below 1 for sines that reach it; offsets of 1 reach the ends."""
    rates = (0.5, 0.5, 1.0, 0.5, 0.9, 0.02, 0.03, 0.03, 0.02)
    motion = replace(MOTION, envelope=replace(ENVELOPE, rates=rates), speeds=(0.8,), offsets=(0.0, *[1.0] * 8))
    time = np.linspace(motion.ramp_time, motion.duration, 7001)
    values = motion.values(time)
    found = np.gradient(values, time, axis=0)
    assert (np.sqrt(np.mean(found**2, axis=0)) < rates).all()
    assert (np.sqrt(np.mean(found**2, axis=0))[5:] > 0.4 * np.array(rates[5:])).all()
    low, high = ENVELOPE.ranges.T
    assert (values[:, 5:].max(axis=0) > (high - 0.02 * (high - low))[5:]).all()
    assert (values <= high + 2e-3 * (high - low)).all()
    with pytest.raises(ValueError, match=r"Envelope.rates has 2 values; give one for each of speed"):
        replace(ENVELOPE, rates=(1.0, 2.0))


def test_it_stands_starts_stops_and_reverses():
    time = np.array([0.3, 0.6, 0.98]) * MOTION.duration
    values = MOTION.values(np.concatenate([t + np.linspace(-0.1, 0.1, 51) for t in time]))[:, 0].reshape(3, -1)
    ahead, standing, back = values.mean(axis=1)
    assert ahead > 0.4 and abs(standing) < 0.05 and back < -0.2
    moving = MOTION._levels(np.array([1.5, 4.5]))[1]
    assert moving == pytest.approx([1.0, STANDING])


@pytest.mark.parametrize("car", [amphibious_vehicle(), light_4x4(), small_car()], ids=lambda car: car.name)
def test_velocities_belong_to_places_and_the_start_is_smooth(car, caplog):
    check_motion(MOTION, car, WATER, MOTION.duration)
    assert not caplog.records  # no sudden start
    first, soon = (MOTION.poses(car, WATER, t) for t in (0.0, 1e-3))
    assert first.velocity == pytest.approx(np.tile(WATER.velocity, (5, 1)), abs=1e-7)
    design = np.vstack([car.hull_origin, car.wheel_centers]) - [car.hull.center_of_mass_x, 0.0, 0.0]
    assert first.position == pytest.approx(design, abs=1e-9)
    assert np.abs(soon.velocity - first.velocity).max() < 1e-3 * 1e-2  # acceleration begins at 0
    assert np.abs(soon.spin).max() < 1e-4


def test_steering_up_to_the_limit_is_no_error():
    car = amphibious_vehicle()
    wide = replace(MOTION, envelope=replace(ENVELOPE, steering=(-1.0, 1.0)))
    low, high = check_motion(wide, car, WATER, wide.duration)
    limit = car.steering.limit  # looked at 200 times
    assert 0.95 * limit < -low < limit and 0.95 * limit < high < limit


def test_wheels_stand_on_the_ground_and_keep_within_the_travel():
    car = amphibious_vehicle()
    for time in np.linspace(1.0, 8.0, 57):
        p = MOTION.poses(car, WATER, float(time))
        sinkage = MOTION.values(np.array([time]))[0, 8]
        seen = (p.position[1:] - p.position[0]) @ p.rotation[0]
        stroke = seen - (car.wheel_centers - car.hull_origin)
        assert np.abs(stroke[:, :2]).max() < 1e-9  # along the pillar
        assert (stroke[:, 2] < car.suspension.bump_travel).all()
        assert (stroke[:, 2] > -car.suspension.rebound_travel).all()
        free = np.abs(stroke[:, 2]) < 0.8 * car.suspension.bump_travel
        assert p.position[1:, 2][free] == pytest.approx(car.wheel.radius - sinkage, abs=1e-5)
        assert p.rotation[1:, :, 2] == pytest.approx(np.tile(p.rotation[0, :, 2], (4, 1)), abs=1e-12)


def test_mirrored_motion_is_the_mirror_image():
    car, flip = amphibious_vehicle(), np.array([1.0, -1.0, 1.0])
    other_side = replace(WATER, current_direction=-WATER.current_direction)
    for time in (0.5, 2.0, 5.3, 8.0):
        p, q = MOTION.poses(car, WATER, time), MOTION.mirrored().poses(car, other_side, time)
        order = [0, 2, 1, 4, 3]
        assert q.position[order] == pytest.approx(p.position * flip, abs=1e-9)
        assert q.velocity[order] == pytest.approx(p.velocity * flip, abs=1e-9)
        assert q.angular_velocity[order] == pytest.approx(p.angular_velocity * -flip, abs=1e-9)
        assert q.rotation[order] == pytest.approx(flip[:, None] * p.rotation * flip, abs=1e-9)
    assert MOTION.mirrored().mirrored() == MOTION and len(MIRRORED) == len(CHANNELS)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"speeds": (2.0,)}, r"Excitation.speeds = \(2.0,\) must be one or more, all of -0.6 to 1 m/s"),
        ({"speeds": ()}, r"Excitation.speeds = \(\) must be one or more"),
        ({"offsets": (0.0,)}, r"Excitation.offsets has 1 values; give one for each of speed"),
        ({"ramp_time": 7.9}, r"ramp_time = 7.9 s leaves nothing of duration = 8 s"),
        (
            {"envelope": replace(ENVELOPE, fast=100.0), "duration": 1e3},
            r"Excitation.duration = 1000 s: .*shorter one, or lower",
        ),
    ],
)
def test_bad_input_is_refused(change, message):
    with pytest.raises(ValueError, match=message):
        replace(MOTION, **change)
    with pytest.raises(ValueError, match=r"Envelope.heave = \(1, 0\)"):
        replace(ENVELOPE, heave=(1.0, 0.0))
