"""What is asked of a sweep: arguments, values of cases, results and folders that are refused, by name."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest

from exumob.driving.maneuver import ConstantSteer, Recorded
from exumob.driving.named import MANEUVERS
from exumob.driving.path_following import PathFollowing
from exumob.flow.output.vtk import VtkSeries
from exumob.simulation.settings import usual_speed
from exumob.support.files import require_folder_name
from exumob.sweeps import sweep, tune
from exumob.sweeps.case_rows import fault_of_result
from exumob.sweeps.experiment import amphibious_lane_change
from exumob.sweeps.run import _check_cases
from exumob.sweeps.study import from_options
from exumob.vehicle.vehicle_file import load_vehicle

CASES = [{"x": 1.0}, {"x": 2.0}]


def square(case):
    """Numbers by name."""
    return {"square": case["x"] ** 2}


@pytest.mark.parametrize("change, word", [
    ({"function": 3}, "sweep.function = 3 must be a function"),
    ({"cases": []}, "sweep.cases is empty"), ({"cases": {"x": 1}}, "sweep.cases is a dict; give a list of dicts"),
    ({"cases": [3]}, "case 0 is 3; give a dict"), ({"cases": "abc"}, "sweep.cases is a str"),
    ({"cases": iter(CASES)}, "sweep.cases is a list_iterator"), ({"cases": [{}, {"x": 1}]}, "case 1 has the names"),
    ({"cases": [{"a b": 1}]}, "'a b' cannot be the name"), ({"cases": [{"status": 1}]}, "'status' cannot be the name"),
    ({"cases": [{3: 1}]}, "3 cannot be the name"), ({"folder": None}, "sweep.folder = None"),
    ({"workers": 1.5}, "sweep.workers = 1.5 must be a whole number"), ({"workers": 0}, "sweep.workers = 0"),
    ({"workers": True}, "sweep.workers = True"), ({"workers": 10**400}, "sweep.workers = 10"),
    ({"time_limit": 0.0}, "sweep.time_limit = 0.0"), ({"time_limit": "5"}, "sweep.time_limit = '5'"),
    ({"time_limit": float("nan")}, "sweep.time_limit = nan"), ({"again": "killed"}, "sweep.again = 'killed'"),
    ({"again": ["kiled"]}, "'kiled' is no status"), ({"keep_runs": 1}, "sweep.keep_runs = 1"),
    ({"progress": 3}, "sweep.progress = 3"),
])  # fmt: skip
def test_bad_arguments_are_named(change, word, tmp_path):
    with pytest.raises(ValueError, match=word):
        sweep(**({"function": square, "cases": CASES, "folder": tmp_path / "sweep"} | change))
    assert not (tmp_path / "sweep").exists()


NAN, INF = float("nan"), float("inf")


@pytest.mark.parametrize("name, bad", [
    ("hull.mass", [-1.0, NAN, INF, "heavy", None, True, [49.0], 10**400, 1e6]),
    ("water.current_direction", [180.0, NAN, "west"]),
    ("water.density", [1.0, 0.0]),
    ("water.depth_ratio", [-0.5, NAN, "deep", True]),
    ("soil", ["LETE sandd", 3, None]),
    ("soil.shear_modulus_x", [12.0]),
    ("maneuver", ["slalom", 3]),
    ("maneuver.speed", [NAN, "fast"]),
    ("hydrodynamics", ["magic", 3]),
    ("hydrodynamics.member", [-1, 1.5, "first", True]),
    ("setting", ["slow", 3]),
    ("duration", [0.0, -1.0, NAN, "8 s", 1e9]),
    ("micro_step", [0.0, "small"]),
    ("hull.mesh", ["no_such_file.stl", 3]),
    ("hull.inertia", [(1.0, 2.0), "round"]),
    ("steering.geometry", ["bent", 1.0]),
])  # fmt: skip
def test_every_value_is_checked_before_anything_runs(name, bad, tmp_path):
    """The last of many, whatever the others are; the message names the field."""
    experiment = amphibious_lane_change()
    good = experiment.value(name)
    for value in bad:
        cases = [{name: good}] * 50 + [{name: value}]
        with pytest.raises(ValueError, match=name.rpartition(".")[2].removesuffix("_ratio")):
            sweep(experiment, cases, tmp_path / "sweep")
    assert not (tmp_path / "sweep").exists()


def test_last_of_many_values_is_looked_at():
    cases = [{"hull.mass": 50.0 + 1e-3 * n, "soil.cohesion": 1000.0 + 0.1 * n} for n in range(30_000)]
    _check_cases(amphibious_lane_change(), cases)
    for bad in (-1.0, float("nan")):
        with pytest.raises(ValueError, match=f"mass = {bad}"):
            _check_cases(amphibious_lane_change(), [*cases, {"hull.mass": bad, "soil.cohesion": 1000.0}])


def test_values_that_belong_together_change_together():
    """A wider hull needs a wider track; each alone is refused, and so is a combination: as a row, with a warning."""
    base = amphibious_lane_change()
    both = {"hull.width": 0.6, "track": 0.9}
    assert base.with_values(both).vehicle.track == 0.9
    with pytest.raises(ValueError, match=r"Vehicle\.track"):
        base.with_values({"hull.width": 0.6})


def test_another_vehicle_stands_as_deep_over_its_tyres():
    """The base is D60 for each vehicle, at the command line too; a depth that is given stays."""
    car = load_vehicle("small_car")
    base = amphibious_lane_change().with_vehicle(car)
    assert base.water.depth == pytest.approx(0.6 * car.wheel.diameter) and base.water.current_speed == 1.0
    (found, _), (given, _) = (
        from_options("small_car", [*more, "hydrodynamics=coefficients"], ["hull.mass=900,1000"], 1, 0)
        for more in ([], ["water.depth=0.2"])
    )
    assert found.water == base.water and given.water.depth == 0.2
    assert replace(base, water=None).with_vehicle(car).water is None


@pytest.mark.parametrize("name", ["lane change", "straight", "path following"])
def test_another_vehicle_is_driven_by_froudes_law(name):
    """Speed of the tread, times and duration go with the root of the wheelbase; what is set stays."""
    base, car = amphibious_lane_change(), load_vehicle("small_car")
    base = base.with_values({"maneuver": name})
    assert base.maneuver == MANEUVERS[name] and replace(base.with_vehicle(base.vehicle), sized=None) == base
    root = math.sqrt(car.wheelbase / base.vehicle.wheelbase)
    driven = base.with_vehicle(car)
    assert driven.maneuver.speed * car.wheel.radius == pytest.approx(usual_speed(car)) == pytest.approx(root)
    assert driven.maneuver.ramp_time == pytest.approx(root) and driven.duration == pytest.approx(8.0 * root, abs=0.02)
    assert driven.maneuver == amphibious_lane_change().with_vehicle(car).with_values({"maneuver": name}).maneuver
    assert driven.with_values({"maneuver": name, "maneuver.speed": 3.0, "duration": 5.0}).maneuver.speed == 3.0
    if name == "lane change":
        assert (driven.maneuver.start, driven.maneuver.end) == pytest.approx((2.0 * root, 5.5 * root))
    back = driven.with_vehicle(base.vehicle)
    assert back.maneuver.speed == pytest.approx(10.0) and back.maneuver.ramp_time == pytest.approx(1.0)
    assert back.duration == pytest.approx(8.0, abs=0.021)
    rolling = replace(base, initial_speed=1.0).with_vehicle(car)
    assert rolling.initial_speed == pytest.approx(root) and driven.initial_speed is None


def test_a_field_that_is_varied_does_not_change_the_speed_of_a_maneuver_by_name():
    """Whatever comes first, and whether the maneuver is named or not; of the paper's vehicle and of another."""
    for base in (amphibious_lane_change(), amphibious_lane_change().with_vehicle(load_vehicle("small_car"))):
        named, varied = {"maneuver": "lane change"}, {"wheelbase": 1.03 * base.vehicle.wheelbase}
        both = base.with_values(named | varied)
        assert both == base.with_values(varied).with_values(named) == base.with_values(varied)
        assert both.maneuver == base.maneuver


def test_the_default_path_of_another_vehicle_is_as_long_for_it_and_no_sharper_than_it_can_steer():
    car = load_vehicle("small_car")
    base = replace(amphibious_lane_change(), maneuver=PathFollowing())
    stiff = replace(car, steering=replace(car.steering, limit=0.4))
    path = base.with_vehicle(stiff).maneuver
    ratio = car.wheelbase / base.vehicle.wheelbase
    np.testing.assert_allclose(path.waypoints, ratio * np.array(PathFollowing().waypoints), rtol=1e-12)
    assert path.max_steering == 0.4
    own = ((0.0, 0.0), (30.0, 1.0))
    assert replace(base, maneuver=PathFollowing(own)).with_vehicle(car).maneuver.waypoints == own


def test_a_maneuver_of_ones_own_stays_as_it_is():
    """Recorded, and of classes that derive from exumob's, whose fields nobody knows."""

    class Mine(ConstantSteer):
        def __init__(self):
            super().__init__(0.1, 5.0)

    for maneuver in (Recorded(np.linspace(0.0, 4.0, 9), np.zeros(9), np.full(9, 5.0)), Mine()):
        base = replace(amphibious_lane_change(), maneuver=maneuver)
        assert base.with_vehicle(load_vehicle("small_car")).maneuver is maneuver


def test_combinations_that_do_not_fit_become_rows_with_a_warning(caplog):
    base = amphibious_lane_change()
    cases = [{"hull.width": width, "track": 0.66} for width in (0.6, 0.44, 0.4)]
    assert _check_cases(base, cases) == cases[1]
    assert "1 of 3 cases cannot be run" in caplog.text and "hull.width = 0.6" in caplog.text
    with pytest.raises(ValueError, match=r"Vehicle\.track"):
        _check_cases(base, cases[:1])
    with pytest.raises(ValueError, match="say the same"):
        _check_cases(base, [{"water.depth": 0.1, "water.depth_ratio": 0.5}])
    with pytest.raises(ValueError, match="must be a whole multiple"):
        _check_cases(base, [{"macro_step": 0.0103}])


@pytest.mark.parametrize("found, word", [
    (None, "returned NoneType"), (3.0, "returned float"), ({3: 1.0}, "3 has no proper name"),
    ({"a/b": 1.0}, "no proper name"), ({"x": 1.0}, "taken by a parameter"), ({"status": 1.0}, "taken by"),
    ({"y": [1.0, 2.0]}, "is not a number"), ({"y": None}, "is not a number"), ({"y": 10**400}, "is not a number"),
    ({"y": 1j}, "is not a number"),
])  # fmt: skip
def test_results_of_a_wrong_kind_are_named(found, word):
    assert word in fault_of_result(found, ["x"])
    assert not fault_of_result({"y": np.float32(1.0), "word": "drives", "z": float("nan")}, ["x"])


# -- names of folders --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["sweep.nc", "sweep.NC", "sweep.csv", "run.npz", "map.png", "study.toml"])
def test_a_folder_with_the_name_of_a_file_is_refused(name, tmp_path):
    calls = {
        "sweep.folder": lambda: sweep(square, [{"x": 1.0}], tmp_path / name),
        "tune.folder": lambda: tune(
            amphibious_lane_change(), {"hull.mass": (45.0, 50.0)}, square, tmp_path / name
        ),
        "VtkSeries.folder": lambda: VtkSeries(tmp_path / name, amphibious_lane_change().vehicle),
    }  # fmt: skip
    for said, call in calls.items():
        with pytest.raises(ValueError, match=rf"{said} .*{re.escape(name)}: this is to be a folder, and"):
            call()
    assert not list(tmp_path.iterdir())
    require_folder_name("folder", tmp_path / "cohesion_0.5")
    (tmp_path / "old.nc").mkdir()
    require_folder_name("folder", tmp_path / "old.nc")  # it goes on there
