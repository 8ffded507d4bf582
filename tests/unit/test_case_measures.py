"""What the cases with solids measure with: orders, arrivals, impulses, fitted decays, published data in the package."""

import math

import numpy as np
import pytest

from exumob.verification.dam_breaks import ARRIVAL, IMPULSE_END, arrival, fitted_faces, impulse, martin_moyce, spheric2
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
