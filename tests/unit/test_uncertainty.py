"""Grid-convergence index and statistical uncertainty, on made-up sequences whose answer is known."""

import numpy as np
import pytest

from exumob.verification.uncertainty import deviation_uncertainty, grid_convergence, mean_uncertainty


@pytest.mark.parametrize("order", [0.7, 1.0, 1.6, 2.0])
@pytest.mark.parametrize("sizes", [(0.018, 0.0224, 0.028), (0.01, 0.02, 0.025), (0.04, 0.01, 0.02)])
def test_monotonic_sequence_gives_order_and_limit(order, sizes):
    found = grid_convergence(sizes, [5.0 - 30.0 * h**order for h in sizes])
    assert found.kind == "monotonic"
    assert found.order == pytest.approx(order, rel=1e-6)
    assert found.extrapolated == pytest.approx(5.0, rel=1e-6)
    assert found.gci == pytest.approx(1.25 * 30.0 * min(sizes) ** order, rel=1e-5)


@pytest.mark.parametrize("sizes", [(0.01, 0.0125, 0.015625), (0.01, 0.02, 0.025)])
def test_oscillatory_sequence_gives_order_and_the_range_tripled(sizes):
    values = [5.0 + 30.0 * sign * h**1.5 for sign, h in zip((1, -1, 1), sizes, strict=True)]
    found = grid_convergence(sizes, values)
    assert found.kind == "oscillatory"
    assert found.order == pytest.approx(1.5, rel=1e-6)
    assert found.extrapolated == pytest.approx(5.0, rel=1e-6)
    assert found.gci == pytest.approx(3.0 * np.ptp(values))
    assert found.gci > abs(values[0] - 5.0)


def test_super_convergence_is_not_believed():
    sizes = (1.0, 2.0, 4.0)
    found = grid_convergence(sizes, [h**4 for h in sizes])
    assert found.order == pytest.approx(4.0)
    assert found.gci == pytest.approx(1.25 * 15.0 / 3.0)


@pytest.mark.parametrize("values", [(0.0, 1.0, 1.1), (0.0, 1.0, 0.9)])
def test_divergence_is_called_so(values):
    found = grid_convergence((1.0, 2.0, 4.0), values)
    assert found.kind == "divergent" and found.order < 0.0
    assert np.isnan(found.extrapolated)
    assert found.gci == pytest.approx(3.0 * np.ptp(values))


def test_slow_and_equal_values():
    slow = grid_convergence((1.0, 2.0, 4.0), [h**0.2 for h in (1.0, 2.0, 4.0)])
    assert slow.order == pytest.approx(0.2) and slow.gci == pytest.approx(3.0 * (4.0**0.2 - 1.0))
    assert grid_convergence((1.0, 2.0, 4.0), (3.0, 3.0, 3.0)).gci == 0.0
    assert np.isnan(grid_convergence((1.0, 2.0, 4.0), (3.0, 4.0, 4.0)).order)


def test_bad_input():
    for sizes, values in (
        ((1, 2), (1, 2)),
        ((1, 1, 2), (1, 2, 3)),
        ((0, 1, 2), (1, 2, 3)),
        ((1, 2, 3), (1, 2, np.nan)),
    ):
        with pytest.raises(ValueError, match="grid_convergence"):
            grid_convergence(sizes, values)
    with pytest.raises(ValueError, match="mean_uncertainty"):
        mean_uncertainty(np.zeros(10))


@pytest.mark.parametrize("memory", [0.0, 0.8, 0.95])
def test_standard_error_of_an_autoregressive_series(memory):
    """x' = memory x + noise has the correlation time (1 + memory) / (1 - memory)."""
    noise = np.random.default_rng(3).standard_normal(40000)
    x = np.empty_like(noise)
    x[0] = 0.0
    for n in range(1, len(x)):
        x[n] = memory * x[n - 1] + noise[n]
    found = mean_uncertainty(x)
    assert found.correlation == pytest.approx((1.0 + memory) / (1.0 - memory), rel=0.15)
    assert found.error == pytest.approx(1.0 / (1.0 - memory) / np.sqrt(len(x)), rel=0.12)
    assert 0.5 < found.batch_error / found.error < 2.0
    deviation, error = deviation_uncertainty(x)
    assert abs(deviation - (1.0 - memory**2) ** -0.5) < 4.0 * error
