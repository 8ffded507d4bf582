"""Error bars of networks' loads: the floor below the spread, found again on made-up errors; bars of runs not fitted."""

import numpy as np
import pytest
from made_up_networks import SMALL, made_up

from exumob.learning.error_bars import error_bars, fitted_floor, share_within
from exumob.support.measured import measured_errors
from exumob.surrogates.ensemble import load_floor
from exumob.surrogates.model import shipped_networks
from exumob.surrogates.networks import NetworkSet, network_file
from vehicle_models.amphibious import amphibious_vehicle

FLOOR = np.linspace(0.5, 8.0, 30).reshape(5, 6)


def made_up_runs(number=4, samples=4000, floor=FLOOR, seed=0):
    """Errors whose square is that of a spread and of a floor, of another spread in each run."""
    rng = np.random.default_rng(seed)
    spreads = [np.full((samples, 5, 6), 1.0 + n) for n in range(number)]
    return [rng.normal(size=s.shape) * np.hypot(s, floor) for s in spreads], spreads


def test_the_floor_is_found_again():
    """Four runs of 4,000 samples: a mean square is known to 2 %, the smallest floor below its spread to 0.2."""
    errors, spreads = made_up_runs()
    assert fitted_floor(errors, spreads) == pytest.approx(FLOOR, abs=0.25, rel=0.04)


def test_bars_hold_what_they_should_on_runs_that_have_no_part_in_them():
    errors, spreads = made_up_runs()
    for deviations, share in ((1.0, 0.683), (2.0, 0.954)):
        assert share_within(errors, error_bars(errors, spreads), deviations) == pytest.approx(share, abs=0.01)
    assert share_within(errors, spreads, 2.0) < 0.75  # the spread alone


def test_a_run_does_not_widen_its_own_bars():
    """One of four has ten times the error: its bars do not know, those of the others do."""
    errors, spreads = made_up_runs()
    errors[0] = 10.0 * errors[0]
    bars = error_bars(errors, spreads)
    assert (bars[1] > 3.0 * bars[0]).all()
    assert share_within(errors[:1], bars[:1]) < 0.5 < 0.99 < share_within(errors[1:], bars[1:])


def test_spread_that_is_enough_needs_no_floor():
    errors, spreads = made_up_runs(floor=np.zeros((5, 6)))
    wide = [2.0 * spread for spread in spreads]
    assert not fitted_floor(errors, wide).any()
    assert all(np.array_equal(bar, spread) for bar, spread in zip(error_bars(errors, wide), wide, strict=True))


def test_a_single_run_is_judged_by_itself():
    errors, spreads = made_up_runs(1)
    assert error_bars(errors, spreads)[0] == pytest.approx(np.hypot(spreads[0], fitted_floor(errors, spreads)))


def test_networks_that_come_with_exumob_have_a_floor_together():
    members = [NetworkSet.load(file) for file in shipped_networks()]
    assert load_floor(members) == pytest.approx(np.array(measured_errors()["load_floor"]["networks"]))
    assert load_floor(members[:2]) is None  # it is that of all of them
    assert load_floor([NetworkSet.load(network_file("paper-lstm"))]) is not None
    assert load_floor([made_up(SMALL, amphibious_vehicle())]) is None
