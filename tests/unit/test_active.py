"""Which scenario an ensemble would compute next: members whose disagreement is known beforehand."""

import math

import numpy as np
import pytest

from exumob.learning import evaluation
from exumob.learning.disagreement import disagreement, load_scale, next_scenario, rank
from exumob.paper.scenarios import Scenario
from exumob.support.errors import SimulationError
from exumob.surrogates.networks import RANGE_STATES, Architecture, NetworkSet
from exumob.surrogates.vehicle_shape import geometry

SHORT = {"micro_step": 5e-4, "macro_step": 20e-3, "duration": 0.1}
WATERS = [Scenario.named(name) for name in ("D60/U0.5", "D60/U1@30/-30deg", "D60/U0")]
SCALE = 2.0


def member(vehicle, loads=0.0, slope=0.0, half_range=50.0):
    """Adds the same load to all components of all bodies: constant, and growing with the flow from ahead [m/s]."""
    arrays = {
        "coefficients": np.tile([[loads / SCALE], [slope / SCALE]], (5, 1, 6)), "input_mean": np.zeros((5, 1)),
        "input_scale": np.ones((5, 1)), "input_low": np.full((5, 1), -half_range),
        "input_high": np.full((5, 1), half_range), "range_states": np.zeros((5, RANGE_STATES, 1)),
        "range_reach": np.full(5, half_range), "output_mean": np.zeros((5, 6)), "output_scale": np.full((5, 6), SCALE),
    }  # fmt: skip
    architecture = Architecture(("forward_flow",), 1, 1, "polynomial", degree=1, base="coefficients")
    about = {"preset": "made up", "seed": 0, "geometry": geometry(vehicle)}
    return NetworkSet(architecture, {n: a.astype(np.float32) for n, a in arrays.items()}, about)


def test_disagreement_is_the_deviation_over_the_scale(vehicle):
    """Constant loads 3 N (N m) apart: deviation 3/sqrt(2), over what 2 and 2 give as a scale."""
    found = disagreement(WATERS[0], [member(vehicle, -1.0), member(vehicle, 2.0)], vehicle, SHORT)
    assert found.by_load == pytest.approx(np.full((5, 6), 3.0 / math.sqrt(2.0) / SCALE))
    assert found.total == pytest.approx(3.0 / math.sqrt(2.0) / SCALE)
    assert found.scenario == WATERS[0] and found.out_of_range == found.fallback == 0.0


def test_scale_is_the_members_root_mean_square(vehicle):
    other = member(vehicle)
    other = NetworkSet(other.architecture, other.arrays | {"output_scale": np.full((5, 6), 4.0, np.float32)}, {})
    assert load_scale([member(vehicle), other]) == pytest.approx(np.full((5, 6), math.sqrt(10.0)))


def test_same_members_agree(vehicle):
    assert disagreement(WATERS[0], [member(vehicle, 1.0)] * 3, vehicle, SHORT).total < 1e-12


def test_ranking_follows_what_members_differ_by(vehicle):
    """It grows with the flow from ahead: 0.87 m/s before 0.5 before none."""
    networks = [member(vehicle, slope=slope) for slope in (-1.0, 0.0, 1.0)]
    ranking = rank(WATERS, networks, vehicle, SHORT)
    assert [one.scenario.current_speed for one in ranking] == [1.0, 0.5, 0.0]
    expected = [math.cos(math.radians(30.0)) / SCALE, 0.5 / SCALE, 0.0]
    assert [one.total for one in ranking] == pytest.approx(expected, abs=0.01)


def test_outside_the_training_range_it_is_said(vehicle):
    """Trained at up to 0.1 m/s: at 0.5 m/s the coefficient model acts, and inputs are held at the edge of the range."""
    networks = [member(vehicle, slope=slope, half_range=0.1) for slope in (-1.0, 1.0)]
    found = disagreement(WATERS[0], networks, vehicle, SHORT)
    assert found.out_of_range == found.fallback == 1.0
    assert found.total == pytest.approx(math.sqrt(2.0) * 0.11 / SCALE, rel=0.01)


def test_next_scenario_is_the_largest_that_can_be_driven(vehicle, monkeypatch, caplog):
    drive = evaluation.drive

    def breaks(scenario, *others):
        if scenario.current_speed == 1.0:
            raise SimulationError("it breaks down")
        return drive(scenario, *others)

    monkeypatch.setattr("exumob.learning.disagreement.drive", breaks)
    networks = [member(vehicle, slope=slope) for slope in (-1.0, 1.0)]
    assert next_scenario(WATERS[::-1], networks, vehicle, SHORT) == Scenario.named("D60/U0.5")
    assert "D60/U1@30/-30deg cannot be driven" in caplog.text
    with pytest.raises(ValueError, match="candidates holds no scenario that these networks can drive"):
        next_scenario(WATERS[1:2], networks, vehicle, SHORT)


def test_one_member_cannot_disagree(vehicle):
    with pytest.raises(ValueError, match="has 1 members, and two at least"):
        disagreement(WATERS[0], [member(vehicle)], vehicle, SHORT)
