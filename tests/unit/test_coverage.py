"""States that stand for the training runs, and how far from them a state still counts as known."""

import numpy as np
import pytest

from exumob.learning import training
from exumob.learning.coverage import covering, reach
from exumob.learning.presets import PRESETS
from exumob.surrogates.ensemble import load_members
from exumob.surrogates.model import HANDOVER, shipped_networks
from exumob.surrogates.networks import FULL_RANGE, RANGE_STATES, NetworkSet, range_scale


def test_each_chosen_state_is_the_furthest_from_those_before():
    line = np.array([[0.0], [1.0], [4.0], [9.0], [10.0]])
    assert covering(line, 5).tolist() == [0, 4, 2, 1, 3]  # the first of equals
    assert covering(line[:2], 4).tolist()[:2] == [0, 1]  # repeated if there are fewer


def test_chosen_states_leave_no_hole():
    """No choice of as many covers with less than half of the radius (Gonzalez 1985); the square has a known one."""
    x = np.linspace(0.0, 1.0, 101)
    square = np.stack(np.meshgrid(x, x), axis=-1).reshape(-1, 2)
    chosen = square[covering(square, 16)]
    radius = np.sqrt(((square[:, None] - chosen) ** 2).sum(axis=2)).min(axis=1).max()
    assert radius <= 2.0 * 0.125 * np.sqrt(2.0) * 1.05  # 4 x 4 places cover with 0.125 sqrt(2)


@pytest.mark.parametrize("apart", [0.1, 1.0])
def test_reach_is_how_far_runs_lie_from_each_other(apart):
    along = np.linspace(0.0, 5.0, 501)
    states = np.concatenate([np.stack([along, np.full_like(along, apart * n)], axis=1) for n in range(3)])
    runs = np.repeat(np.arange(3), len(along))
    assert reach(states, runs, np.arange(len(states))) == pytest.approx(apart, rel=1e-9)
    few = covering(states, RANGE_STATES)
    assert apart <= reach(states, runs, few) < apart + 0.1  # with what the chosen ones miss


def test_a_single_run_reaches_to_its_furthest_state():
    line = np.linspace(0.0, 8.0, 9)[:, None]
    assert reach(line, np.zeros(9, int), np.array([0, 8])) == pytest.approx(4.0)
    assert reach(np.zeros((3, 1)), np.zeros(3, int), np.array([0])) > 0.0


def state(network, **values):
    """Inputs of a steady motion: the means in training, but for what is given; shape (5, k)."""
    inputs = network.arrays["input_mean"].astype(float).copy()
    for name, value in values.items():
        inputs[:, network.architecture.inputs.index(name)] = value
    return inputs


STRAIGHT = {"forward_speed": 0.7, "yaw_rate": 0.0, "steering": 0.0, "heave_rate": 0.0, "roll": 0.0}


@pytest.mark.parametrize("lateral", [-0.35, 0.35])
def test_a_current_from_the_side_is_unlike_lane_changes_in_a_current_from_ahead(lateral):
    """Sideslip of a fast current from ahead with the speeds of a slow one: each in its range, never both."""
    head = STRAIGHT | {"forward_flow": 1.5, "lateral_flow": 0.0}
    aside = STRAIGHT | {"forward_flow": 0.4, "lateral_flow": lateral, "forward_speed": 0.4}
    lane = [NetworkSet.load(file) for file in shipped_networks()]
    assert all(one.excess(state(one, **head)).max() <= 0.0 for one in lane)
    single, joint = np.mean([one.excess(state(one, **aside)) for one in lane], axis=0).max(axis=0)
    assert single <= 0.0 and joint > HANDOVER[1]
    assert all(one.excess(state(one, **aside)).max() <= 0.0 for one in load_members(FULL_RANGE))


def test_slight_differences_do_not_leave_the_range():
    """In D40/U1 driven with the networks wheels go up and down by 8 mm/s, in training by 1 mm/s."""
    for file in shipped_networks():
        lane = NetworkSet.load(file)
        still = state(lane, **STRAIGHT, forward_flow=1.5, lateral_flow=0.0)
        shaken = state(lane, **STRAIGHT | {"heave_rate": 0.008}, forward_flow=1.5, lateral_flow=0.0)
        assert lane.excess(shaken).max() <= 0.0
        assert lane.excess(shaken)[:, 1] == pytest.approx(lane.excess(still)[:, 1], abs=0.1)
        assert lane.excess(state(lane, **STRAIGHT | {"heave_rate": 0.3}, forward_flow=1.5))[:, 1].min() > 1.0


def test_scales_of_comparison_are_not_less_than_what_is_slight():
    names = ("forward_flow", "heave_rate", "roll", "yaw_rate", "immersion")
    scale = np.array([[0.4, 0.001, 0.001, 0.0001, 0.0002], [0.4, 0.3, 0.1, 2.0, 0.1]], np.float32)
    compared, wider = range_scale(names, scale, np.ones_like(scale, bool))
    np.testing.assert_allclose(compared, [[0.4, 0.02, 0.005, 0.0001, 0.0002], scale[1]], rtol=1e-6)
    np.testing.assert_allclose(wider, [[0.0, 0.019, 0.004, 0.0, 0.0], [0.0] * 5], atol=1e-8)


def test_what_never_changed_in_training_may_change_by_what_is_slight():
    """Its scale is 1 for want of a deviation, which is no velocity beside which another one is slight."""
    names = ("forward_flow", "current_speed", "heave_rate", "roll", "immersion")
    scale = np.array([0.4, 1.0, 0.001, 1.0, 1.0], np.float32)
    compared, wider = range_scale(names, scale, np.array([True, False, True, False, False]))
    np.testing.assert_allclose(compared, [0.4, 0.02, 0.02, 0.005, 1.0], rtol=1e-6)
    np.testing.assert_allclose(wider, [0.0, 0.02, 0.019, 0.005, 0.0], atol=1e-8)


def test_networks_of_another_version_of_the_file_are_trained_again(tmp_path, monkeypatch):
    """A folder of before holds parts without what the files of today need."""
    wanted = tmp_path, PRESETS["memory"], 0, "hull", "data", None
    today = training._part(*wanted)
    assert training._part(*wanted) == today
    monkeypatch.setattr(training, "VERSION", training.VERSION - 1)
    assert training._part(*wanted) != today
