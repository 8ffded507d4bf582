"""Sweeps of vehicles some of whose classes stand in the vehicle file itself."""

import functools
import pickle
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from exumob.mobility.crossing import Crossing
from exumob.sweeps import Genetic, sweep, tune
from exumob.sweeps.case_store import CaseStore
from exumob.sweeps.experiment import amphibious_crossing
from exumob.vehicle.vehicle_file import load_vehicle

VEHICLE = """
from dataclasses import dataclass, replace
from exumob.vehicle.parameters import {kind}
from vehicle_models.amphibious import amphibious_vehicle

@dataclass(frozen=True)
class Mine({kind}):
    label: float = 1.0

def my_vehicle():
    found = amphibious_vehicle()
    fields = {{name: getattr({thing}, name) for name in {kind}.__dataclass_fields__}}
    return {made}
"""
KINDS = {
    "Vehicle": ("found", "Mine(**fields)"),
    "Hull": ("found.hull", "replace(found, hull=Mine(**fields))"),
    "Wheel": ("found.wheel", "replace(found, wheel=Mine(**fields))"),
}


def short_run(folder, kind):
    """An experiment on land with a vehicle whose part of this kind is of a class of the vehicle file."""
    thing, made = KINDS[kind]
    file = folder / f"{kind}.py"
    file.write_text(VEHICLE.format(kind=kind, thing=thing, made=made))
    return replace(amphibious_crossing(), vehicle=load_vehicle(file), water=None, duration=0.02)


def test_another_process_can_have_them(tmp_path):
    base = amphibious_crossing().duration
    for kind in KINDS:
        run = replace(short_run(tmp_path, kind), duration=base)
        for n, function in enumerate((run, Crossing(run), functools.partial(run))):
            store = CaseStore(tmp_path / "sweep", function, [{"hull.mass": 45.0}], None, False)
            (tmp_path / f"{kind}{n}.pickle").write_bytes(pickle.dumps(store))
    text = "import pickle, sys\nfor f in sys.argv[1:]: print(pickle.load(open(f, 'rb')).names)"
    files = sorted(tmp_path.glob("*.pickle"))
    found = subprocess.run([sys.executable, "-c", text, *files], capture_output=True, text=True)
    assert found.stdout.splitlines() == ["['hull.mass']"] * 9, found.stderr


@pytest.mark.parametrize("workers", [1, 2])
def test_sweep(workers, tmp_path):
    cases = [{"hull.mass": mass} for mass in (42.0, 45.0)]
    result = sweep(short_run(tmp_path, "Hull"), cases, tmp_path / "sweep", workers=workers)
    assert list(result["status"].values) == ["completed"] * 2, result["reason"].values


def first_height(run):
    """An objective."""
    return float(np.abs(run["position"].values).max())


def test_tuning(tmp_path):
    method = Genetic(population=4, generations=1, workers=2)
    found = tune(
        short_run(tmp_path, "Wheel"), {"hull.mass": (40.0, 45.0)}, first_height, tmp_path / "tuning", method=method
    )
    assert found.evaluations.sizes["evaluation"] == 4
