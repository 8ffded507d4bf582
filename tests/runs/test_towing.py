"""The vehicle-level measurements, each for a fraction of a second on the coarsest grid.

The cases themselves are slow ones of `exumob verify`. Loads are those found on these cells with a band of 3 %, which a
change of the solver or of what is averaged leaves, and round-off does not.
"""

import inspect
import math

import numpy as np
import pytest

from exumob.flow.resolution import check_resolution
from exumob.flow.vehicle_window import doubled_window, vehicle_window
from exumob.verification import load_convergence, runs, squat, towing, worst_case
from exumob.verification.uncertainty import grid_convergence, mean_uncertainty
from exumob.water.conditions import Water

QUICK = {"cell_size": 0.04, "duration": 0.12, "interval": 0.002, "allow_coarse": True}
BAND = 0.03


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
    """The grid goes with the vehicle, so that both are the same sum: equal to round-off, which has no time to grow."""
    checks = towing.towed_held(**QUICK)
    assert value_of(checks, "hull Fx, towed").value == pytest.approx(-11.52, rel=BAND)
    against = [check for check in checks if "held against towed" in check.name]
    assert len(against) == 4 and max(abs(check.error) for check in against) < 1e-6
    assert value_of(checks, "hull Fz, held against towed, over hull Fx").value == pytest.approx(171.9, rel=BAND)


def test_resistance_is_found_and_compared():
    checks = towing.resistance_hump((0.7, 1.0), **QUICK)
    found = {(part, froude): value_of(checks, f"{part}, resistance coefficient at depth Froude number {froude}").value
             for part in ("hull", "vehicle", "front wheel", "rear wheel") for froude in ("0.7", "1")}  # fmt: skip
    assert found == pytest.approx(
        {
            ("hull", "0.7"): 2.087, ("hull", "1"): 1.695, ("vehicle", "0.7"): 1.766, ("vehicle", "1"): 1.489,
            ("front wheel", "0.7"): 1.596, ("front wheel", "1"): 1.394, ("rear wheel", "0.7"): 1.627,
            ("rear wheel", "1"): 1.387,
        },
        rel=BAND,
    )  # fmt: skip
    assert value_of(checks, "hull, depth Froude number of the largest coefficient").value == 0.7  # it still speeds up


def test_worst_case_grids_and_finished_runs(folder, monkeypatch):
    checks = worst_case.worst_case(**QUICK)
    assert value_of(checks, "loads that are not numbers").passed
    assert value_of(checks, "level ahead of the bow wave, largest").passed
    means = {load: value_of(checks, f"{load}, mean").value for load in ("hull Fx", "hull Fz", "hull My")}
    assert means == pytest.approx({"hull Fx": -59.7, "hull Fz": 216.8, "hull My": -7.04}, rel=BAND)
    left, right = (value_of(checks, f"front_{side} Fx, mean").value for side in ("left", "right"))
    assert left == pytest.approx(-25.3, rel=BAND) and right == pytest.approx(left, rel=1e-6)  # straight on
    quick = QUICK | {"ratios": (1.1, 1.0, 1.2)}
    found = load_convergence.load_convergence(**quick)
    assert found["load"].values.tolist() == [f"{body} {name}" for body, _, name in worst_case.LOADS]
    for load, row in zip(found["load"].values, found["mean"].values, strict=True):
        expected = grid_convergence((0.044, 0.04, 0.048), row)
        assert float(found["mean_gci"].sel(load=load)) == expected.gci
        assert found["mean_convergence"].sel(load=load) == expected.kind
    assert found["mean"].sel(load="hull Fx").values == pytest.approx([-67.7, -59.3, -84.6], rel=BAND)  # hull on faces
    assert len(load_convergence.check_load_convergence(**quick)) == 8 * len(worst_case.LOADS)
    load_convergence.plot_convergence(found)

    monkeypatch.setattr(runs, "_kept", {})  # as another process would find it
    monkeypatch.setattr(runs, "captive_run", None)
    again = load_convergence.load_convergence(**quick)
    assert np.array_equal(again["mean"], found["mean"])


def test_window_and_step_comparisons_run():
    checks = worst_case.compared("itself", *[worst_case.worst_run(0.04, 0.12, 0.002, allow_coarse=True)] * 2, limit=0.0)
    assert [check.error for check in checks if math.isfinite(check.limit)] == [0.0] * len(worst_case.LOADS)
    apart = [check for check in checks if "standard error" in check.name]
    alone = mean_uncertainty(
        runs.loads_after(worst_case.worst_run(0.04, 0.12, 0.002, allow_coarse=True), 0.03)[:, 0, 0]
    )
    assert apart[0].value == pytest.approx(math.sqrt(2.0) * alone.error) and len(apart) == len(worst_case.LOADS)
    vehicle, water = runs.paper_vehicle(), Water(runs.DEPTH)
    normal, wide = vehicle_window(vehicle, 0.04, water), doubled_window(vehicle, 0.04, water)
    for name in ("x_faces", "y_faces"):
        assert np.ptp(getattr(wide, name)) == pytest.approx(2.0 * np.ptp(getattr(normal, name)), rel=0.05)
    assert np.array_equal(wide.z_faces, normal.z_faces)


def test_slender_hull():
    """Its theory is Hooft's formula with 1.43 for 1.46; speeding up it is sucked down and held back from the start."""
    displacement = 2.0 / 3.0 * squat.LENGTH * squat.BREADTH * squat.DRAUGHT
    stiffness = 9810.0 * 2.0 / 3.0 * squat.LENGTH * squat.BREADTH
    sinkage = -squat.slender_body_lift(0.5) / stiffness
    assert sinkage == pytest.approx(1.432 * displacement / squat.LENGTH**2 * 0.25 / math.sqrt(0.75), rel=2e-3)
    loads = squat.squat_loads(0.5, cell_size=0.04, duration=0.1, interval=0.005, ramp_time=0.08)
    assert loads == pytest.approx((-0.252, -1.207, -0.913), rel=BAND)


@pytest.mark.parametrize("measure", [towing.towed_held, worst_case.worst_case])
def test_default_cells_are_fine_enough(measure):
    cell_size = inspect.signature(measure).parameters["cell_size"].default
    vehicle, water = runs.paper_vehicle(), Water(runs.DEPTH)
    check_resolution(vehicle, vehicle_window(vehicle, cell_size, water))
