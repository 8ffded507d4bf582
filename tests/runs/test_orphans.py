"""Processes that training, sweeps and tunings start end with them, even when they are killed."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from exumob.simulation.result_files import save_dataset

TRAINING = """
import sys
from pathlib import Path
from exumob.learning.dataset import load_runs
from exumob.learning.presets import Preset
from exumob.learning.training import train
from exumob.surrogates.networks import Architecture
from vehicle_models.amphibious import amphibious_vehicle

if __name__ == "__main__":
    folder = Path(sys.argv[1])
    architecture = Architecture(("forward_flow", "water_depth"), 2, 5, "lstm", 64, 8)
    slow = Preset("slow", architecture, epochs=100_000, patience=100_000)
    begun = lambda step: (folder / "begun").touch()
    train([slow], load_runs(sorted(folder.glob("*.nc"))), amphibious_vehicle(), folder / "networks", progress=begun)
"""


def below(number):
    """Processes that descend from one, as far as they live."""
    parents = {}
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                state, parent = (entry / "stat").read_text().rsplit(")", 1)[1].split()[:2]
            except OSError:
                continue
            if state != "Z":
                parents[int(entry.name)] = int(parent)
    found, new = set(), {number}
    while new:
        new = {child for child, parent in parents.items() if parent in new} - found
        found |= new
    return found


def lives(number):
    try:
        return Path(f"/proc/{number}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False


def check_that_all_end(program, folder, least):
    """Start a program, kill it when it has begun, and see its processes end."""
    (folder / "program.py").write_text(program)
    leader = subprocess.Popen([sys.executable, folder / "program.py", folder])
    deadline = time.monotonic() + 120.0
    while not (folder / "begun").exists() and leader.poll() is None and time.monotonic() < deadline:
        time.sleep(0.05)
    children = below(leader.pid)
    os.kill(leader.pid, signal.SIGKILL)
    leader.wait()
    assert len(children) >= least, "it had not begun"
    deadline = time.monotonic() + 10.0
    while any(map(lives, children)) and time.monotonic() < deadline:
        time.sleep(0.05)
    left = [child for child in children if lives(child)]
    for child in left:
        os.kill(child, signal.SIGKILL)
    assert not left


@pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")
def test_killed_training_leaves_no_process_behind(runs, tmp_path):
    pytest.importorskip("torch")
    for n, run in enumerate(runs.values()):
        save_dataset(run, tmp_path / f"{n}.nc")
    check_that_all_end(TRAINING, tmp_path, 2)


SWEEP = """
import sys, time
from pathlib import Path
from exumob.sweeps import sweep

def endless(case):
    (Path(sys.argv[1]) / "begun").touch()
    while True:
        time.sleep(0.1) if case["x"] else sum(range(10**6))

if __name__ == "__main__":
    sweep(endless, [{"x": 0.0}, {"x": 1.0}], Path(sys.argv[1]) / "sweep", workers=2)
"""
TUNING = """
import sys, time
from dataclasses import replace
from pathlib import Path
from exumob.sweeps import Genetic, tune
from exumob.sweeps.experiment import amphibious_lane_change

def endless(run):
    (Path(sys.argv[1]) / "begun").touch()
    while True:
        time.sleep(0.1)

if __name__ == "__main__":
    experiment = replace(amphibious_lane_change(), water=None, duration=0.02)
    tune(experiment, {"hull.mass": (40.0, 45.0)}, endless, Path(sys.argv[1]) / "tuning", method=Genetic(workers=2))
"""


@pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")
@pytest.mark.parametrize("program, least", [(SWEEP, 3), (TUNING, 2)], ids=["sweep", "tuning"])
def test_killed_leader_leaves_no_process_behind(program, least, tmp_path):
    check_that_all_end(program, tmp_path, least)
