"""Macro steps that follow the flow: the rule, without a flow."""

import math

import pytest

from exumob.coupling.macro_step import FollowFlow

RULE = FollowFlow(unit=1e-3, longest=8e-3, courant=0.4, residual=0.1, patience=10)
NAN = math.nan


def following(parts, rate, residual=0.01, rule=RULE):
    """The next step after steps of these lengths, at a Courant number of `rate` a unit."""
    return rule.next_parts(parts, [rate * n for n in parts], [residual] * len(parts))


def test_first_step_is_short():
    assert RULE.next_parts([], [], []) == 2


@pytest.mark.parametrize(("rate", "next_length"), [(0.1, 4), (0.15, 2), (0.3, 1), (0.9, 1), (0.0, 6)])
def test_step_shortens_at_once_to_what_the_courant_number_allows(rate, next_length):
    assert following([6] * 3, rate) == next_length


def test_step_lengthens_by_one_unit_after_the_patience():
    assert following([3] * 9, 0.05) == 3
    assert following([3] * 10, 0.05) == 4
    assert following([2, *[3] * 9], 0.05) == 3
    assert following([8] * 10, 0.0) == 8


def test_one_step_of_the_last_ones_without_room_keeps_the_length():
    courant = [0.2] * 10
    assert RULE.next_parts([3] * 10, courant, [0.01] * 10) == 4
    courant[4] = 0.38  # 4 units would have needed 0.51
    assert RULE.next_parts([3] * 10, courant, [0.01] * 10) == 3


def test_mean_residual_shortens_and_a_single_peak_does_not():
    assert following([4] * 10, 0.01, residual=0.11) == 3
    assert following([4] * 10, 0.01, residual=0.08) == 4  # no room for a longer one
    assert following([1] * 10, 0.01, residual=0.5) == 1
    assert RULE.next_parts([4] * 10, [0.04] * 10, [0.01] * 9 + [0.5]) == 5
    assert RULE.next_parts([5, 4], [0.05, 0.04], [0.01, 0.9]) == 4  # one step tells nothing


def test_flow_that_reports_no_courant_number_is_led_by_the_residual():
    assert RULE.next_parts([4] * 10, [NAN] * 10, [0.01] * 10) == 5
    assert RULE.next_parts([4] * 10, [NAN] * 10, [0.2] * 10) == 3
    assert RULE.next_parts([4] * 10, [NAN] * 10, [NAN] * 10) == 5


def test_bad_input_is_named():
    with pytest.raises(ValueError, match=r"longest = 0\.003 s must be a whole multiple of unit = 0\.002 s"):
        FollowFlow(unit=2e-3, longest=3e-3)
    with pytest.raises(ValueError, match=r"FollowFlow\.courant = 0\.0 must be >= 0\.01"):
        FollowFlow(courant=0.0)
    with pytest.raises(ValueError, match=r"FollowFlow\.patience"):
        FollowFlow(patience=0)
