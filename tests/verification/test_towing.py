"""The vehicle-level measurements run: each for a fraction of a second on the coarsest grid; no number counts yet.

The cases themselves are slow ones of `exumob verify`.
"""

import inspect
import math

import numpy as np
import pytest

from exumob.flow.resolution import check_resolution
from exumob.flow.vehicle_window import doubled_window, vehicle_window
from exumob.verification import load_convergence, runs, squat, towing, worst_case
from exumob.water.conditions import Water

QUICK = {"cell_size": 0.04, "duration": 0.12, "interval": 0.002, "allow_coarse": True}


@pytest.fixture(autouse=True, scope="module")
def folder(tmp_path_factory):
    """Finished runs go to a folder of the test's own."""
    place = tmp_path_factory.mktemp("runs")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(runs.FOLDER, str(place))
        patch.setattr(runs, "_kept", {})
        yield place


def value_of(checks, name):
    return next(check for check in checks if check.name == name)


def test_towed_and_held_agree_from_the_first_steps():
    checks = towing.towed_held(**QUICK)
    assert len(checks) == 5 and all(check.passed for check in checks)


def test_resistance_is_found_and_compared():
    checks = towing.resistance_hump((0.7, 1.0), **QUICK)
    assert value_of(checks, "hull, depth Froude number of the largest coefficient").value in (0.7, 1.0)
    assert all(math.isfinite(check.value) for check in checks)


def test_worst_case_grids_and_finished_runs(folder, monkeypatch):
    checks = worst_case.worst_case(**QUICK)
    assert value_of(checks, "loads that are not numbers").passed
    assert all(math.isfinite(check.value) for check in checks)
    quick = QUICK | {"ratios": (1.1, 1.0, 1.2)}
    found = load_convergence.load_convergence(**quick)
    assert np.all(np.isfinite(found["mean_gci"])) and found.sizes["load"] == len(worst_case.LOADS)
    assert len(load_convergence.check_load_convergence(**quick)) == 8 * len(worst_case.LOADS)
    load_convergence.figure(**quick)

    monkeypatch.setattr(runs, "_kept", {})  # as another process would find it
    monkeypatch.setattr(runs, "captive_run", None)
    again = load_convergence.load_convergence(**quick)
    assert np.array_equal(again["mean"], found["mean"])


def test_window_and_step_comparisons_run():
    checks = worst_case.compared("itself", *[worst_case.worst_run(0.04, 0.12, 0.002, allow_coarse=True)] * 2, limit=0.0)
    assert [check.error for check in checks if math.isfinite(check.limit)] == [0.0] * len(worst_case.LOADS)
    apart = [check for check in checks if "standard error" in check.name]
    assert all(0.0 < check.value < 1e3 for check in apart)
    assert len(apart) == len(worst_case.LOADS)
    vehicle, water = runs.paper_vehicle(), Water(runs.DEPTH)
    normal, wide = vehicle_window(vehicle, 0.04, water), doubled_window(vehicle, 0.04, water)
    for name in ("x_faces", "y_faces"):
        assert np.ptp(getattr(wide, name)) == pytest.approx(2.0 * np.ptp(getattr(normal, name)), rel=0.05)
    assert np.array_equal(wide.z_faces, normal.z_faces)


def test_slender_hull():
    """Its theory is Hooft's formula with 1.43 for 1.46; a few steps give loads without side force."""
    displacement = 2.0 / 3.0 * squat.LENGTH * squat.BREADTH * squat.DRAUGHT
    stiffness = 9810.0 * 2.0 / 3.0 * squat.LENGTH * squat.BREADTH
    sinkage = -squat.slender_body_lift(0.5) / stiffness
    assert sinkage == pytest.approx(1.432 * displacement / squat.LENGTH**2 * 0.25 / math.sqrt(0.75), rel=2e-3)
    loads = squat.squat_loads(0.5, cell_size=0.04, duration=0.1, interval=0.005, ramp_time=0.08)
    assert np.all(np.isfinite(loads))
    assert loads[2] < 0.0


@pytest.mark.parametrize("measure", [towing.towed_held, worst_case.worst_case])
def test_default_cells_are_fine_enough(measure):
    cell_size = inspect.signature(measure).parameters["cell_size"].default
    vehicle, water = runs.paper_vehicle(), Water(runs.DEPTH)
    check_resolution(vehicle, vehicle_window(vehicle, cell_size, water))
