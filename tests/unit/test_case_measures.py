"""What the cases with solids measure with: orders, arrivals, impulses, fitted decays, published data in the package."""

import math

import numpy as np
import pytest

from exumob.support.constants import GRAVITY
from exumob.verification.bores import DURATIONS, belanger, front_of, moving_jump, stoker
from exumob.verification.dam_breaks import (
    ARRIVAL,
    IMPULSE_END,
    Blow,
    arrival,
    fitted_faces,
    impulse,
    martin_moyce,
    measured_blow,
    spheric2,
)
from exumob.verification.measures import extremes, fitted_oscillation, observed_order


def test_observed_order_of_a_known_error():
    values = [1.0 + 0.3 * h**1.7 for h in (1.0, 0.5, 0.25)]
    assert observed_order(values, 2.0) == pytest.approx(1.7)
    assert math.isnan(observed_order([1.0, 2.0, 1.5], 2.0))


def test_arrival_and_impulse_of_a_step():
    time = np.linspace(0.0, 6.0, 601)
    pressure = np.where(time < 2.0, 0.0, 1.0)
    assert arrival(time, pressure) == pytest.approx(2.0, abs=0.01)
    assert impulse(time, pressure) == pytest.approx(IMPULSE_END - 2.0, abs=0.01)
    assert math.isnan(arrival(time, 0.9 * ARRIVAL * pressure))


def test_peak_and_means_of_a_blow():
    """A spike counts by its mean over 20 ms; a run that ends before a mean's end gives none."""
    time = np.arange(-0.1, 0.5, 0.001)
    force = np.where((time > 0.05) & (time < 0.054), 100.0, np.where(time > 0.0, 10.0, 0.0))
    blow = Blow(time, force)
    assert blow.peak == pytest.approx((0.004 * 100.0 + 0.016 * 10.0) / 0.02, rel=0.07)
    assert blow.rise == pytest.approx(0.051, abs=1e-3)
    assert blow.mean(0.1, 0.4) == pytest.approx(10.0)
    assert math.isnan(blow.mean(0.3, 0.6))


def test_fitted_decay():
    time = np.linspace(0.0, 3.0, 301)
    values = 0.1 + np.exp(-0.5 * time) * np.cos(6.0 * time)
    period, damping = fitted_oscillation(time, values, 0.95)
    assert period == pytest.approx(2.0 * math.pi / 6.0)
    assert damping == pytest.approx(0.5 / math.hypot(0.5, 6.0))
    assert len(extremes(values)) == 6


def test_faces_include_the_knots():
    faces = fitted_faces([0.0, 0.31, 0.4, 1.0], 0.05)
    assert np.isin([0.0, 0.31, 0.4, 1.0], faces).all()
    assert np.diff(faces).min() > 0.04


def test_published_data_comes_with_the_package():
    assert martin_moyce("T2").shape[0] == martin_moyce("T6").shape[0] == 2
    for probe in ("P1", "P3"):
        time, pressure = spheric2(probe)
        assert np.all(np.diff(time) > 0.0)
        assert 1.0 < pressure.max() < 2.5
        assert arrival(time, pressure) == pytest.approx(1.7, abs=0.1)
    blow = measured_blow()
    assert blow.peak == pytest.approx(32.4, abs=1.0)
    assert blow.mean(0.1, 0.4) == pytest.approx(18.5, abs=0.5)


@pytest.mark.parametrize("froude", [1.5, 3.6, 5.0])
def test_a_jump_keeps_mass_and_momentum(froude):
    front, deep, speed = belanger(froude, 0.1)
    assert (speed + front) / math.sqrt(GRAVITY * 0.1) == pytest.approx(froude)
    assert speed * 0.1 == pytest.approx(front * (deep - 0.1))
    assert 0.5 * GRAVITY * (deep**2 - 0.01) == pytest.approx(0.1 * (speed + front) * speed)


def test_a_dam_break_over_water_joins_bore_and_rarefaction():
    """The same laws across the bore, and Riemann's invariant u + 2 sqrt(g h) of the reservoir behind it."""
    speed, depth, behind = stoker(0.4, 0.04)
    assert speed * 0.04 == pytest.approx((speed - behind) * depth)
    assert 0.5 * GRAVITY * (depth**2 - 0.04**2) == pytest.approx(0.04 * speed * behind)
    assert behind + 2.0 * math.sqrt(GRAVITY * depth) == pytest.approx(2.0 * math.sqrt(GRAVITY * 0.4))


@pytest.mark.parametrize("froude", DURATIONS)
def test_a_jump_that_is_followed_too_shortly_is_refused(froude):
    with pytest.raises(ValueError, match=r"moving_jump\.duration = 0\.5 s is too short.* give \d"):
        moving_jump(froude, duration=0.5)
    front, deep, _ = belanger(froude, 0.1)
    assert DURATIONS[froude] > 8.0 * deep / front


def test_front_is_the_last_place_as_high():
    assert front_of(np.arange(5.0), np.array([1.0, 0.2, 1.0, 0.6, 0.1]), 0.5) == pytest.approx(3.2)
