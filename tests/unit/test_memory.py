"""Filtered inputs of networks: exact answers, the same in a run as along a recorded one, and what is refused."""

import math
from dataclasses import replace

import numpy as np
import pytest
from made_up_networks import SMALL, made_up

from exumob.learning.dataset import body_states, water_of, windows
from exumob.surrogates.inputs import network_inputs
from exumob.surrogates.memory import InputMemory, filtered
from exumob.surrogates.model import SurrogateHydrodynamics
from exumob.surrogates.networks import Architecture, NetworkSet
from exumob.vehicle.motion import BodyStates

TAUS = (0.05, 0.4, 3.0)


@pytest.mark.parametrize("step", [1e-3, 0.02, 0.7])
def test_a_ramp_is_followed_exactly(step):
    """z = s (t - tau (1 - exp(-t / tau))) behind an input s t, for any step; to round-off."""
    time = step * np.arange(40)
    found = filtered(np.c_[2.0 * time, np.full(40, 5.0)], TAUS, step)
    for n, tau in enumerate(TAUS):
        np.testing.assert_allclose(found[:, n, 0], 2.0 * (time + tau * np.expm1(-time / tau)), rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(found[..., 1], 5.0, rtol=1e-14)


def test_a_sine_lags_as_it_should():
    """After a long time amplitude 1/sqrt(1 + (w tau)^2) and phase atan(w tau); steps of 1 ms."""
    tau, omega, time = 0.4, 3.0, 1e-3 * np.arange(10_000)
    found = filtered(np.sin(omega * time), [tau], 1e-3)[:, 0]
    expected = np.sin(omega * time - math.atan(omega * tau)) / math.hypot(1.0, omega * tau)
    np.testing.assert_allclose(found[6000:], expected[6000:], atol=2e-6)


def test_step_by_step_is_as_along_a_run():
    """Steps of unequal lengths: exact between instants joined by straight lines."""
    rng = np.random.default_rng(0)
    nodes = np.cumsum(rng.integers(1, 40, 60))
    values = rng.standard_normal((60, 5, 3))
    memory = InputMemory(TAUS)
    one_by_one = np.stack([memory.filtered(1e-3 * t, x) for t, x in zip(nodes, values, strict=True)])
    every = np.arange(nodes[0], nodes[-1] + 1)
    lines = np.stack([np.interp(every, nodes, v) for v in values.reshape(60, -1).T], -1).reshape(-1, 5, 3)
    np.testing.assert_allclose(one_by_one, filtered(lines, TAUS, 1e-3)[nodes - nodes[0]], atol=1e-12)


def test_without_a_past_the_present_is_all_there_was():
    memory = InputMemory(TAUS)
    for value in (1.0, 4.0):  # settling: the level of the hull moves
        assert (memory.filtered(0.0, np.full(2, value), still=True) == value).all()
    assert (memory.filtered(0.02, np.full(2, 7.0)) == 7.0).all()  # a run may begin at speed
    expected = [8.0 - tau / 0.02 * (1.0 - math.exp(-0.02 / tau)) for tau in TAUS]
    assert memory.filtered(0.04, np.full(2, 8.0))[:, 0] == pytest.approx(expected)
    kept = memory.save()
    after = memory.filtered(0.06, np.full(2, 9.0)).copy()
    memory.restore(kept)
    assert (memory.filtered(0.06, np.full(2, 9.0)) == after).all()


def test_in_the_loop_networks_see_what_they_learnt_from(runs, vehicle):
    """The loads of a model that follows a run, as those of the windows along that run; instants of 1 and 20 ms."""
    network = made_up(replace(SMALL, taps=2, layer="dense", filters=(0.1, 1.0)), vehicle)
    run = runs["D60/U1"]
    states, water = body_states(run), water_of(run)
    inputs = network_inputs(states, water, SMALL.inputs)
    rows = np.arange(0, 400, 20)
    expected = network.batch_wrenches(np.moveaxis(windows(inputs, rows, network.architecture), 2, 1))
    for step, tolerance in ((1, 1e-4), (20, 0.02)):
        model = SurrogateHydrodynamics(network, fallback=False)
        model.start(vehicle, water, 1e-3)
        answers = {n: model.wrenches(_until(states, n), lambda: states) for n in range(step, 400, step)}
        found = np.stack([answers[n] for n in rows[1:]])
        scale = expected.std(axis=0).max()
        assert np.abs(found - expected[1:]).max() < tolerance * scale


def _until(states, row):
    return BodyStates(*(getattr(states, name)[: row + 1] for name in states.__dataclass_fields__))


def test_files_keep_the_filters_and_older_files_have_none(vehicle, tmp_path):
    network = made_up(replace(SMALL, layer="dense", filters=TAUS), vehicle)
    again = NetworkSet.load(network.save(tmp_path / "a.safetensors"))
    assert again.architecture.filters == TAUS and again.architecture.memory == 3.0 and again.architecture.window == 7
    assert Architecture(taps=11, stride=2).memory == pytest.approx(0.02)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"layer": "lstm", "filters": (0.1,)}, "have no place in a layer 'lstm'; use 'dense'"),
        ({"layer": "dense", "filters": (0.0,)}, "filters"),
        ({"layer": "dense", "filters": (math.nan,)}, "filters"),
    ],
)
def test_wrong_filters_are_refused(wrong, said):
    with pytest.raises(ValueError, match=said):
        Architecture(**wrong)
