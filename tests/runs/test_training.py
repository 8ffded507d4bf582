"""Training: reproducible, resumed, exact where the loads are a polynomial; the data set that it reads."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from exumob.learning.dataset import VARIABLES, body_states, load_runs, water_of
from exumob.paper.scenarios import TRAINING, UNSEEN, Scenario
from exumob.surrogates.inputs import network_inputs
from exumob.surrogates.networks import Architecture, NetworkSet
from vehicle_models.amphibious import amphibious_vehicle

pytest.importorskip("torch")
from exumob.learning.evaluation import open_loop, predicted_loads
from exumob.learning.presets import Preset
from exumob.learning.training import train


def test_training_learns_and_is_reproducible_and_resumed(runs, vehicle, tmp_path):
    inputs = ("forward_flow", "forward_speed", "immersion", "water_depth")
    preset = Preset("tiny", Architecture(inputs, 2, 5, "lstm", 12, 8), batch=16, epochs=30, thinning=4, mirror=True)
    steps = []
    first = train([preset], runs, vehicle, tmp_path / "a", seeds=[1], jobs=2, progress=steps.append)["tiny", 1]
    second = train([preset], runs, vehicle, tmp_path / "b", seeds=[1], jobs=1)["tiny", 1]
    network, again = NetworkSet.load(first), NetworkSet.load(second)
    assert network.digest() == again.digest()
    assert sum(step.done for step in steps) == 5
    losses = network.arrays["training_loss"]
    assert (np.nanmin(losses, axis=1) < 0.3 * losses[:, 0]).all()
    assert network.about["held_back"] == "D50/U0.5" and network.about["provenance"]["torch_version"]

    parts = {p: p.stat().st_mtime_ns for p in (tmp_path / "a" / "parts").iterdir()}
    next(p for p in parts if "hull" in p.name).unlink()
    train([preset], runs, vehicle, tmp_path / "a", seeds=[1], jobs=1, progress=steps.append)
    assert sum(step.done for step in steps) == 6  # the one that was missing, alone
    assert NetworkSet.load(first).digest() == network.digest()


def test_regression_recovers_a_polynomial(runs, vehicle, tmp_path):
    """Loads that are a quadratic of the inputs are met to the ridge's share."""
    inputs = ("forward_flow", "water_depth")
    preset = Preset("poly", Architecture(inputs, 1, 1, "polynomial", degree=2), ridge=1e-9, thinning=1)
    made = {}
    for name, run in runs.items():
        x = network_inputs(body_states(run), water_of(run), inputs)
        made[name] = run.copy()
        made[name]["water_wrench"] = run["water_wrench"].copy(
            data=np.repeat((-3.0 * x[..., :1] ** 2 * (1.0 + 5.0 * x[..., 1:])), 6, axis=-1)
        )
        made[name]["water_wrench_smooth"] = made[name]["water_wrench"]
    cubic = replace(preset, architecture=replace(preset.architecture, degree=3))
    network = NetworkSet.load(train([cubic], made, vehicle, tmp_path, seeds=[0], jobs=1)["poly", 0])
    rows = np.arange(0, 500, 10)
    found = predicted_loads(network, made["D60/U1"], vehicle, rows)
    assert found == pytest.approx(made["D60/U1"]["water_wrench"].values[rows], rel=2e-3, abs=2e-3)
    assert float(open_loop(network, made["D60/U1"], vehicle).max()) < 0.01


def test_runs_of_the_data_set_are_whole():
    runs = load_runs(sorted((Path(__file__).parents[2] / "data" / "cfd_mbd").glob("*.nc")))
    assert set(runs) == {s.name for s in TRAINING + UNSEEN}
    for name, run in runs.items():
        scenario = Scenario.named(name)
        assert run.sizes["time"] == 8001
        assert run.attrs["status"] == "completed"
        assert run.attrs["hydrodynamics"] == "CfdHydrodynamics"
        assert all(np.isfinite(run[variable].values).all() for variable in VARIABLES)
        water = scenario.water(amphibious_vehicle())
        assert run["flow_state"].values[:, :, 3:] == pytest.approx(
            np.broadcast_to([water.current_speed, water.depth], (8001, 5, 2)), abs=1e-6
        )
        assert abs(float(run["steering_angle"].values.max()) - np.radians(abs(scenario.steering))) < 0.02
