"""Training: reproducible, resumed, exact where the loads are a polynomial; the data set that it reads."""

import json
import os
import subprocess
import sys
import time
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
from exumob.simulation.result_files import save_dataset


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


ENDLESS = """
import json, multiprocessing, sys
from multiprocessing import resource_tracker
from pathlib import Path
from exumob.learning.dataset import load_runs
from exumob.learning.presets import Preset
from exumob.learning.training import train
from exumob.surrogates.networks import Architecture
from vehicle_models.amphibious import amphibious_vehicle

def say(step):
    children = [child.pid for child in multiprocessing.active_children()]
    print(json.dumps([*children, resource_tracker._resource_tracker._pid]), flush=True)

if __name__ == "__main__":
    folder = Path(sys.argv[1])
    preset = Preset("endless", Architecture(("forward_flow",), 2, 5, "lstm", 8, 8), epochs=10**6, thinning=50)
    runs = load_runs(sorted(folder.glob("*.nc")))
    train([preset], runs, amphibious_vehicle(), folder / "networks", seeds=[0], jobs=2, progress=say)
"""


def is_there(pid):
    """Whether a process exists and is no zombie that nobody has looked for."""
    try:
        os.kill(pid, 0)
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except (ProcessLookupError, FileNotFoundError):
        return False


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="looks for processes in /proc")
def test_training_that_is_killed_leaves_no_process_behind(runs, tmp_path):
    """kill -9: workers, the manager of their queue and the tracker of resources end within seconds; no half file."""
    for n, run in enumerate(runs.values()):
        save_dataset(run, tmp_path / f"{n}.nc")
    (tmp_path / "endless.py").write_text(ENDLESS)
    leader = subprocess.Popen(
        [sys.executable, str(tmp_path / "endless.py"), str(tmp_path)], stdout=subprocess.PIPE, text=True
    )
    children = json.loads(leader.stdout.readline())
    assert len(children) == 4 and all(map(is_there, children))
    leader.kill()
    leader.wait()
    leader.stdout.close()
    end = time.monotonic() + 10.0
    while any(map(is_there, children)) and time.monotonic() < end:
        time.sleep(0.1)
    assert not any(map(is_there, children))
    assert not list((tmp_path / "networks").rglob("*.partial"))
