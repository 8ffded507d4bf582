"""The multibody model stopped, saved, restored, repeated and paused: the same bits, or the same motion."""

from dataclasses import fields

import numpy as np
import pytest
from multibody_models import CALM, CASES, QUICK, make, prepared, same_bits

from exumob.ground.terrain import Terrain
from exumob.multibody.system import MultibodyVehicle
from exumob.simulation.run import simulate
from exumob.water.conditions import Water


def flat(states):
    return np.concatenate([np.ravel(getattr(states, field.name)) for field in fields(states)])


@pytest.mark.parametrize("case", CASES)
def test_restored_run_is_bit_identical(case, vehicle, sand):
    """Saved at 0.5 s (steering), run to 0.8 s; repeated from the saved state in the same and in another model."""
    model = make(case, vehicle, sand)
    model.advance(0.5, CALM)
    saved = model.save()
    model.advance(0.8, CALM)
    first = model.save()
    model.restore(saved)
    assert same_bits(model.save(), saved)
    model.advance(0.8, CALM)
    assert same_bits(model.save(), first)
    other = make(case, vehicle, sand)
    other.advance(0.1, CALM)  # somewhere else
    other.restore(saved)
    other.advance(0.8, CALM)
    assert same_bits(other.save(), first)


@pytest.mark.parametrize("case", CASES)
def test_restores_into_a_model_that_never_settled(case, vehicle, sand):
    """save(): "any equal model"; a checkpoint is of no use if it first needs the equilibrium."""
    model = make(case, vehicle, sand)
    model.advance(0.5, CALM)
    saved = model.save()
    fresh = MultibodyVehicle(model.vehicle, sand, model.maneuver, Terrain(), 5e-4, 2.0)
    fresh.restore(saved)
    fresh.advance(0.6, CALM)
    model.restore(saved)
    model.advance(0.6, CALM)
    assert same_bits(fresh.save(), model.save())


def test_run_saved_and_restored_half_way_equals_a_single_run(vehicle, sand):
    single = prepared(vehicle, sand)
    single.advance(0.8, CALM)
    broken = prepared(vehicle, sand)
    broken.advance(0.5, CALM)
    saved = broken.save()
    broken.restore(saved)
    broken.advance(0.8, CALM)
    one, two = single.present(), broken.present()
    for name in ("position", "rotation", "velocity"):
        assert getattr(two, name) == pytest.approx(getattr(one, name), abs=1e-8), name


def test_light_save_repeats_a_macro_step(vehicle, sand):
    """Without histories, for a strongly coupled macro step: the second try forgets the first."""
    model = prepared(vehicle, sand)
    model.advance(0.5, CALM)
    saved = model.save(histories=False)
    push = CALM.copy()
    push[0, 1] = 50.0
    model.advance(0.52, CALM)
    first = model.save()
    model.restore(saved)
    model.advance(0.52, push)
    assert not same_bits(model.save(), first)
    model.restore(saved)
    model.advance(0.52, CALM)
    assert same_bits(model.save(), first)


def test_repeated_runs_are_bit_identical(vehicle, sand):
    steps = {"duration": 0.6, "micro_step": 5e-4, "macro_step": 20e-3}
    one, two = (simulate(vehicle, sand, Water.at_ratio(0.6, 1.0), QUICK, **steps) for _ in range(2))
    for name in one.data_vars:
        assert one[name].values.tobytes() == two[name].values.tobytes(), name


@pytest.mark.parametrize("macro_step", [20e-3, 1e-3])
def test_macro_steps_equal_a_single_advance(vehicle, sand, macro_step):
    """Without water a macro step is only a pause: Newton's tolerance of 1e-5 leaves about 2e-8 m.

    Allowed: 1e-7 m and rad, 1e-6 m/s; a loop that loses a step or a load is off by 1e-4 and more.
    """
    single, paused = prepared(vehicle, sand), prepared(vehicle, sand)
    single.advance(0.6, CALM)
    for n in range(round(0.6 / macro_step)):
        paused.advance((n + 1) * macro_step, CALM)
    one, two = single.present(), paused.present()
    for name in ("position", "rotation", "velocity"):
        allowed = 1e-6 if name == "velocity" else 1e-7
        assert getattr(two, name) == pytest.approx(getattr(one, name), abs=allowed), name
    assert paused.time == pytest.approx(0.6, abs=1e-12)


def test_history_is_sampled_every_millisecond(vehicle, sand):
    model = prepared(vehicle, sand, micro_step=2.5e-4)
    model.advance(0.05, CALM)
    assert model.history.time == pytest.approx(np.arange(51) * 1e-3, abs=1e-12)
    assert flat(model.history[-1:]) == pytest.approx(flat(model.present()), abs=0.0)
