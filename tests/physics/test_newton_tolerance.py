"""Where rounding keeps Newton's iterations from their tolerance, a macro step is solved to a looser one, and said."""

import logging

import numpy as np
import pytest

import exumob.multibody.settling
import exumob.multibody.system
from exumob.driving.maneuver import LaneChange
from exumob.ground.terrain import Terrain
from exumob.multibody.system import MultibodyVehicle
from exumob.support.errors import SimulationError

CALM = np.zeros((5, 6))
DURATION, MACRO_STEP = 0.1, 0.02


def driven(vehicle, soil):
    model = MultibodyVehicle(vehicle, soil, LaneChange(start=0.02, end=0.1, ramp_time=0.05), Terrain(), 5e-4, DURATION)
    model.settle(lambda states: CALM)
    for end in np.arange(1, round(DURATION / MACRO_STEP) + 1) * MACRO_STEP:
        model.advance(end, CALM)
    return model


@pytest.mark.parametrize("phase", ["settling", "driving"])
def test_unreachable_tolerance(phase, vehicle, sand, monkeypatch, caplog):
    usual = driven(vehicle, sand)
    module = exumob.multibody.settling if phase == "settling" else exumob.multibody.system
    monkeypatch.setattr(module, "TOLERANCE", 1e-22)
    with caplog.at_level(logging.WARNING):
        loosened = driven(vehicle, sand)
    said = [record.getMessage() for record in caplog.records if "stopped short" in record.getMessage()]
    assert said and all(("while settling" in text) == (phase == "settling") for text in said)
    assert np.abs(loosened.present().position - usual.present().position).max() < 1e-7


@pytest.mark.parametrize("phase", ["settling", "driving"])
def test_break_down_names_a_remedy_of_its_phase(phase, vehicle, sand, monkeypatch):
    monkeypatch.setattr(exumob.multibody.system, "LOOSER", ())
    model = MultibodyVehicle(vehicle, sand, LaneChange(), Terrain(), 5e-4, DURATION)
    solve = model._solve
    monkeypatch.setattr(
        model, "_solve", lambda s, end: False if (phase == "driving") == model._driving else solve(s, end)
    )
    with pytest.raises(SimulationError, match="Newton did not converge") as error:
        model.settle(lambda states: CALM)
        model.advance(MACRO_STEP, CALM)
    assert ("Halve micro_step" in str(error.value)) == (phase == "driving")
    assert ("while settling" in str(error.value)) == (phase == "settling")
