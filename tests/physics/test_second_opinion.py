"""A second water model beside a run that was never compared with the flow, and a car across a current with the flow."""

import math
import re
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from exumob import ConstantSteer, Soil, Water, simulate
from exumob.__main__ import app
from exumob.learning.dataset import load_run
from exumob.simulation.result_files import load_dataset
from exumob.simulation.second_opinion import Outcome, second_opinion
from exumob.simulation.settings import time_scale, usual_speed
from exumob.support.errors import SimulationError
from vehicle_models.light_4x4 import light_4x4

CAR = light_4x4()
FLOW = Path(__file__).parents[2] / "data" / "cars" / "across" / "light_4x4.nc"
FORD = Path(__file__).parents[2] / "examples" / "ford.csv"
SAND = Soil.published("LETE sand")


def crossing(ratio, current, duration, model="calibrated"):
    """A drive straight ahead through a current from the right, and what it was given."""
    water = Water.at_ratio(
        ratio, current_speed=current, current_direction=math.pi / 2.0, tyre_diameter=CAR.wheel.diameter
    )
    speed, ramp = usual_speed(CAR) / CAR.wheel.radius, time_scale(CAR)
    given = CAR, SAND, water, ConstantSteer(speed=speed, ramp_time=ramp)
    return simulate(*given, model, duration=duration), given


def away(run, flow):
    """Distance of the ends over the path of the flow [-], and yaw at the end [deg]."""
    ends = [one["position"].sel(body="hull").values[-1, :2] for one in (run, flow)]
    path = flow["position"].sel(body="hull").values[:, :2]
    length = np.hypot(*np.diff(path, axis=0).T).sum()
    return np.linalg.norm(ends[0] - ends[1]) / length, float(np.degrees(run["yaw"].sel(body="hull")[-1]))


def test_across_a_strong_current_the_two_disagree_and_the_flow_is_nearer_to_the_calibrated_one():
    """2 m/s from the right at 70 % depth: the flow carries the car 9.3 m aside in 10 s, without turning it.

    Calibrated coefficients turn it a little upstream and carry it aside by less; published ones turn it all the way.
    """
    flow = load_run(FLOW)
    end, _ = away(flow, flow)
    assert end == 0.0
    run, given = crossing(0.7, 2.0, 10.0)
    published, _ = crossing(0.7, 2.0, 10.0, "coefficients")
    (near, turned), (far, around) = away(run, flow), away(published, flow)
    assert near < 0.4 and far > 0.6, (near, far)
    assert -60.0 < turned < -30.0 and around < -90.0, (turned, around)
    assert abs(math.degrees(float(flow["yaw"].sel(body="hull")[-1]))) < 5.0
    told = second_opinion(run, *given, duration=10.0)
    assert told.attrs["second_opinion_disagrees"] == 1
    assert told.attrs["second_opinion_away"] == pytest.approx(
        np.linalg.norm(np.diff([one["position"].sel(body="hull").values[-1, :2] for one in (run, published)], axis=0))
    )
    assert re.search(r"turned \d+ deg further to the right.*believe neither", told.attrs["second_opinion"])
    assert told.drop_attrs().identical(run.drop_attrs())


def test_in_shallow_water_they_agree():
    run, given = crossing(0.2, 0.5, 2.0)
    reached = []
    told = second_opinion(run, *given, duration=2.0, progress=reached.append)
    assert told.attrs["second_opinion_disagrees"] == 0 and "believe" not in told.attrs["second_opinion"]
    assert reached[-1] == pytest.approx(2.0)


@pytest.mark.parametrize(
    ("arguments", "asked"),
    [
        (["--vehicle", "light_4x4", "--depth-ratio", "0.3"], True),
        (["--vehicle", "light_4x4", "--depth-ratio", "0.3", "--hydrodynamics", "coefficients"], False),
        (["--vehicle", "light_4x4"], False),
        (["--depth-ratio", "0.5"], False),
    ],
)
def test_it_is_asked_where_no_run_was_compared(arguments, asked, tmp_path):
    file = tmp_path / "run.nc"
    answer = CliRunner().invoke(app, ["drive", *arguments, "--duration", "0.6", "--output", str(file)])
    assert answer.exit_code == 0, answer.output
    assert ("2nd opinion" in answer.output) == asked == ("second_opinion" in load_dataset(file).attrs)


def answered(monkeypatch, run, **changes):
    """A second opinion from a drive that ended like the run but for some changes."""
    other = run.copy(deep=True)
    for name, value in changes.items():
        if name in other:
            other[name].loc[{"body": "hull"}] += value
        else:
            other.attrs[name] = value
    monkeypatch.setattr("exumob.simulation.second_opinion.simulate", lambda *_, **__: other)
    return second_opinion(run, CAR, SAND, None, None).attrs


@pytest.fixture(scope="module")
def short():
    """A drive of the car through shallow water, 2 s."""
    return crossing(0.2, 0.5, 2.0)[0]


@pytest.mark.parametrize(
    ("changes", "disagrees", "said"),
    [
        ({}, 0, r"it is 0 m from here \(0 % of the path\) at the end\.$"),
        ({"position": [0.0, 0.1, 0.0]}, 0, r"0\.1 m from here"),
        ({"position": [2.0, 0.0, 0.0]}, 1, "believe neither"),
        ({"yaw": math.radians(15.0)}, 0, "turned 15 deg further to the left"),
        ({"yaw": -math.radians(25.0)}, 1, "turned 25 deg further to the right. The two disagree"),
        ({"verdict": "is stuck", "verdict_sentence": "it is stuck"}, 1, "the verdict is then: it is stuck"),
    ],
)
def test_what_makes_two_models_disagree(changes, disagrees, said, short, monkeypatch):
    found = answered(monkeypatch, short, **changes)
    assert found["second_opinion_disagrees"] == disagrees
    assert re.search(said, found["second_opinion"]), found["second_opinion"]


def test_two_vehicles_that_hardly_move_agree(short, monkeypatch):
    still = short.copy(deep=True)
    still["position"][:] = still["position"][0]
    found = answered(monkeypatch, still, position=[0.1 * CAR.wheelbase, 0.0, 0.0])
    assert found["second_opinion_disagrees"] == 0 and "% of the path" not in found["second_opinion"]
    assert answered(monkeypatch, still, position=[0.2 * CAR.wheelbase, 0.0, 0.0])["second_opinion_disagrees"] == 1


def test_places_are_compared_where_both_runs_count(short, monkeypatch):
    other = short.copy(deep=True)
    other["position"][101:] += 5.0
    monkeypatch.setattr("exumob.simulation.second_opinion.simulate", lambda *_, **__: other)
    lasts = iter([100, 150])
    found = second_opinion(short, CAR, SAND, None, None, outcome=lambda _: Outcome("crosses", "", next(lasts)))
    assert found.attrs["second_opinion_disagrees"] == 0
    assert f"after {float(short['time'][100]):.3g} s" in found.attrs["second_opinion"]


def test_a_drive_that_breaks_down_is_compared_as_far_as_it_counts(short, monkeypatch):
    """After the crossing of a ford it counts no more; before it, it is another outcome."""
    error = SimulationError("it flew away")
    error.result = short.isel(time=slice(151)).assign_attrs(verdict="broke down", verdict_sentence="it broke down")

    def fails(*_, **__):
        raise error

    monkeypatch.setattr("exumob.simulation.second_opinion.simulate", fails)
    found = second_opinion(short, CAR, SAND, None, None).attrs
    assert found["second_opinion_disagrees"] == 1 and "the verdict is then: it broke down" in found["second_opinion"]
    assert f"after {float(short['time'][150]):.3g} s" in found["second_opinion"]
    crossed = second_opinion(short, CAR, SAND, None, None, outcome=lambda _: Outcome("crosses", "", 100)).attrs
    assert crossed["second_opinion_disagrees"] == 0 and crossed["second_opinion_away"] == 0.0


@pytest.mark.parametrize(
    ("error", "code", "said"),
    [
        (SimulationError("it flew away"), 0, "the published coefficients break down: it flew away"),
        (ValueError("nothing holds it."), 0, "No second opinion (ValueError: nothing holds it). The run itself"),
        (RuntimeError("no memory"), 0, "No second opinion (RuntimeError: no memory). The run itself"),
        (KeyError("yaw"), 0, "No second opinion (KeyError: 'yaw'). The run itself"),
        (KeyboardInterrupt(), 130, "Stopped at the second opinion; the run itself"),
    ],
)
def test_a_second_opinion_that_fails_costs_nothing_of_the_run(error, code, said, tmp_path, monkeypatch):
    def fails(*_, **__):
        raise error

    monkeypatch.setattr("exumob.simulation.second_opinion.simulate", fails)
    file = tmp_path / "run.nc"
    given = ["drive", "--vehicle", "light_4x4", "--depth-ratio", "0.3", "--duration", "0.6", "--output", str(file)]
    answer = CliRunner().invoke(app, given)
    assert answer.exit_code == code and said in " ".join(answer.output.split()), answer.output
    assert load_dataset(file).attrs["status"] == "completed"


def test_a_ford_is_judged_as_a_ford_by_both(tmp_path):
    file, given = tmp_path / "ford.nc", ["--level", "99.9", "--vehicle", "small_car"]
    answer = CliRunner().invoke(app, ["ford", str(FORD), *given, "--output", str(file)])
    assert answer.exit_code == 0, answer.output
    run = load_dataset(file)
    assert run.attrs["second_opinion_disagrees"] == 0
    assert re.search(r"% of the path\) after \d", run.attrs["second_opinion"]), run.attrs["second_opinion"]
