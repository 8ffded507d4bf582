"""Processes that training starts end with it, even when it is killed."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from exumob.simulation.result_files import save_dataset

pytest.importorskip("torch")

PROGRAM = """
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


@pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")
def test_killed_training_leaves_no_process_behind(runs, tmp_path):
    for n, run in enumerate(runs.values()):
        save_dataset(run, tmp_path / f"{n}.nc")
    (tmp_path / "training.py").write_text(PROGRAM)
    leader = subprocess.Popen([sys.executable, tmp_path / "training.py", tmp_path])
    deadline = time.monotonic() + 120.0
    while not (tmp_path / "begun").exists() and leader.poll() is None and time.monotonic() < deadline:
        time.sleep(0.05)
    children = below(leader.pid)
    assert len(children) >= 2, "training had not begun"
    os.kill(leader.pid, signal.SIGKILL)
    leader.wait()
    deadline = time.monotonic() + 10.0
    while any(map(lives, children)) and time.monotonic() < deadline:
        time.sleep(0.05)
    left = [child for child in children if lives(child)]
    for child in left:
        os.kill(child, signal.SIGKILL)
    assert not left
