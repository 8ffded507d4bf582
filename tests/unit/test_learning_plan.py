"""The plan of a vehicle's runs: ranges by Froude's law, an even fill, what a budget buys, and the folder of runs."""

import itertools
import json
import math
import os
import re
import time
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from made_up_learning import ENVELOPE, states_run
from typer.testing import CliRunner

from exumob.__main__ import app
from exumob.learning import campaign
from exumob.learning.campaign import LearningFolder, captive_histories
from exumob.learning.dataset import check_run
from exumob.learning.drives import DECIMALS, FASTEST, HIGHEST, SOILS, STEERING, maneuver_name, teaching_drive
from exumob.learning.envelope import envelope_key, keep_envelope, stored_envelope
from exumob.learning.plan import (
    APART,
    DRIVES_A_ROUND,
    LEAST_DRIVES,
    LISTED,
    USUAL_BUDGET,
    CaptiveTask,
    FreeTask,
    LearningRange,
    make_plan,
    require_budget,
)
from exumob.simulation.result_files import save_dataset
from exumob.simulation.settings import time_scale, usual_speed
from exumob.support.quantities import ImplausibleValue, unusual
from exumob.towing_tank.excitation import SLOW
from exumob.water.wave_loads import WaveCoefficients
from vehicle_models.amphibious import amphibious_vehicle
from vehicle_models.light_4x4 import light_4x4
from vehicle_models.small_car import small_car

CAR = amphibious_vehicle()
WANTED = LearningRange()


@pytest.fixture(scope="module")
def plan():
    return make_plan(CAR, WANTED, 0.4, 0.045, ENVELOPE)


@pytest.fixture(scope="module")
def short():
    """A few runs, as short as they can be."""
    return make_plan(CAR, WANTED, 0.04, 0.06, ENVELOPE, run_time=0.4)


@pytest.fixture(scope="module")
def captive(short):
    return [task for task in short.tasks if isinstance(task, CaptiveTask)]


# -- ranges ------------------------------------------------------------------------------------------------------------


def test_currents_scale_by_froude_and_depths_with_the_tyre():
    assert WANTED.currents(CAR) == pytest.approx((0.0, 1.5))
    large = light_4x4()
    assert WANTED.currents(large)[1] == pytest.approx(1.5 * math.sqrt(2.40 / 0.714))
    assert WANTED.depths(large) == pytest.approx((0.2 * 0.72, 0.9 * 0.72))


@pytest.mark.parametrize(
    ("directions", "angles"),
    [("ahead", {0}), ("along", {0, 180}), ("all", None)],
)
def test_currents_come_from_the_sides_that_are_wanted(directions, angles):
    wanted = replace(WANTED, directions=directions)
    found = {
        round(abs(math.degrees(math.remainder(wanted.water(CAR, 0.5, 1.0, s).current_direction - math.pi, math.tau))))
        for s in np.linspace(0.0, 0.99, 34)
    }
    assert found == angles if angles else len(found) > 10


def test_ranges_are_filled_evenly_and_to_their_ends(plan):
    """The largest empty circle of a lattice of as many points has 0.7 of its spacing for a radius."""
    drives = [task for task in plan.tasks if isinstance(task, FreeTask) and task.role == "teach"]
    low, high = WANTED.depths(CAR)
    places = np.array([[(t.water.depth - low) / (high - low), t.water.current_speed / 1.5] for t in drives])
    assert places.min(axis=0) == pytest.approx([0.0, 0.0]) and places.max(axis=0) == pytest.approx([1.0, 1.0])
    anywhere = np.random.default_rng(0).uniform(size=(2000, 2))
    distance = np.linalg.norm(anywhere[:, None] - places[None], axis=-1).min(axis=1)
    assert distance.max() < 1.5 / math.sqrt(len(places))
    turned = np.array([t.water.current_direction for t in drives])
    assert np.diff(np.sort(turned)).max() < 4.0 * math.tau / len(drives)


def test_drives_teach_with_a_captive_run_for_every_three_and_some_of_both_are_kept_apart(plan):
    drives, captive = ([t for t in plan.tasks if isinstance(t, kind)] for kind in (FreeTask, CaptiveTask))
    taught, moved = ([t for t in some if t.role == "teach"] for some in (drives, captive))
    assert len(moved) >= 3 and 0 <= len(taught) - LEAST_DRIVES - DRIVES_A_ROUND * (len(moved) - 1) <= DRIVES_A_ROUND
    judges, kept = ([t for t in some if t.role == "apart"] for some in (drives, captive))
    assert len(kept) == 1 + (len(moved) - 1) // (APART - 1) and abs(len(judges) - len(moved)) <= 1
    assert [maneuver_name(task.maneuver) for task in judges[:3]] == ["lane change", "circle", "straight"]
    assert {maneuver_name(task.maneuver) for task in taught} == {"multisine of the steering"}
    assert {task.soil for task in taught[:3]} == {task.soil for task in judges[:3]} == set(SOILS)
    ahead, behind = (
        [t for t in taught[:7] if t.water.current_speed > 1.4 and abs(math.cos(t.water.current_direction) - c) < 1e-9]
        for c in (-1.0, 1.0)
    )
    assert ahead and behind  # the fastest current, and among the first four runs some within the ranges
    low, high = WANTED.depths(CAR)
    assert sum(low + 1e-6 < task.water.depth < high - 1e-6 for task in taught[:LEAST_DRIVES]) == 2


@pytest.mark.parametrize("car", [CAR, light_4x4()], ids=["amphibious", "car"])
def test_drives_that_teach_stay_within_what_the_vehicle_can(car):
    """All speeds occur, standing and reversing among them; no drive is like another; some are straight in one half."""
    unit = time_scale(car)
    usual, limit = usual_speed(car) / car.wheel.radius, min(STEERING, car.steering.limit)
    instants = np.linspace(0.0, 8.0 * unit, 801)
    met, steered = [], []
    for number in range(12):
        drive = teaching_drive(car, number, 8.0 * unit)
        speed = np.array([drive.wheel_speed(t)[0] for t in instants]) / usual
        angle = np.array([drive.steering(t)[0] for t in instants]) / limit
        assert speed[0] == 0.0 and abs(speed).max() <= 1.05 * FASTEST and angle[0] == 0.0 and abs(angle).max() <= 1.02
        assert max(abs(drive.steering(t)[1]) for t in instants) < 2.0 * math.tau * HIGHEST / unit * limit
        met.append(speed[-1])
        steered.append([float(np.abs(part).max()) for part in np.array_split(angle, 8)])
    assert min(met) < -0.3 and any(abs(speed) < 1e-6 for speed in met) and max(met) > 0.9
    whole, late, early = (np.array(steered[kind::3]) for kind in range(3))
    assert late[:, :4].max() < 1e-3 < 0.2 < late[:, 5:].max(axis=1).min()
    assert early[:, 6:].max() < 1e-3 < 0.2 < early[:, 1:5].max(axis=1).min()
    assert min(whole[:, 1:4].max(axis=1).min(), whole[:, 4:].max(axis=1).min()) > 0.2
    assert len({round(speed, 3) for speed in met}) > 6


@pytest.mark.parametrize("duration", [0.05, 8.0, 1e3, 1e4])
def test_drives_of_any_length_are_made_in_a_moment(duration):
    begin = time.process_time()
    drive = teaching_drive(CAR, 24, duration)
    assert time.process_time() - begin < 20.0
    steepest = max(abs(drive.steering(t)[0]) for t in np.linspace(0.0, min(duration, 40.0), 400))
    assert 0.1 * STEERING < steepest < 1.05 * STEERING


# -- budget ------------------------------------------------------------------------------------------------------------


def test_a_larger_budget_adds_runs_to_those_of_a_smaller_one(plan):
    plans = [make_plan(CAR, WANTED, budget, 0.045, ENVELOPE) for budget in np.linspace(0.15, 0.4, 11)]
    names = [[task.name for task in made.tasks] for made in plans]
    assert all(more[: len(less)] == less for less, more in itertools.pairwise(names)) and len(names[0]) < len(names[-1])
    for made in plans:
        assert made.core_hours + made.training_hours <= made.budget
        cheapest = min(task.cost.seconds for task in made.tasks) / 3600.0
        assert made.core_hours + made.training_hours > made.budget - 4.0 * cheapest


def test_a_budget_too_small_is_refused_with_what_it_buys():
    with pytest.raises(ValueError, match=r"budget = 0.01 h buys about .* s of flow on cells of 45 mm, and .* 0\.\d+ h"):
        make_plan(CAR, WANTED, 0.01, 0.045, ENVELOPE)


def test_a_hopeless_budget_is_refused_before_any_drive_and_no_other():
    """What the drives alone cost is known without the envelope; a budget that buys a plan passes."""
    with pytest.raises(ValueError, match=r"budget = 0.01 h buys about .* \(7 runs\) are the least") as refused:
        require_budget(CAR, WANTED, 0.01, 0.045)
    advised = re.search(r"give about (0\.\d+) h", str(refused.value))
    make_plan(CAR, WANTED, float(advised[1]), 0.045, ENVELOPE)  # buys a plan
    require_budget(CAR, WANTED, None, 0.045)
    for budget in np.geomspace(0.02, 0.4, 12):
        try:
            make_plan(CAR, WANTED, budget, 0.045, ENVELOPE)
        except ValueError:
            continue
        require_budget(CAR, WANTED, budget, 0.045)


@pytest.mark.parametrize("cell_size", [0.045, 0.008], ids=["usual", "more"])
def test_without_a_budget_the_least_runs_can_be_made(cell_size):
    """Twelve hours, or what the least runs take where that is more."""
    made = make_plan(CAR, WANTED, None, cell_size, ENVELOPE)
    least = make_plan(CAR, WANTED, made.budget, cell_size, ENVELOPE, run_time=made.tasks[0].duration)
    assert made.budget >= USUAL_BUDGET and [t.name for t in least.tasks] == [t.name for t in made.tasks]
    if cell_size < 0.02:
        assert made.budget > USUAL_BUDGET and len(made.tasks) == LEAST_DRIVES + 3


def test_the_plan_says_what_cells_lose_and_what_it_takes(plan):
    text = "\n".join(plan.lines(2))
    assert (
        "lost: the gap between keel and bed of 78.0 mm has 1.7 cells of 44.6 mm and needs 2 (0.039 m would do)" in text
    )
    assert "depth 0.2 to 0.9 of the tyre's diameter (0.04 to 0.18 m)" in text
    assert f"of a budget of {plan.budget:g}" in text and "of memory" in text and "kept apart" in text
    assert all((task.name in text) == (n < LISTED) for n, task in enumerate(plan.tasks))
    fine = make_plan(CAR, WANTED, 12.0, 0.0115, ENVELOPE)
    assert not fine.lost and len(fine.resolved) == 3


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("depth", (0.9, 0.2), r"LearningRange.depth = \(0.9, 0.2\)"),
        ("current", (1.0, 0.5), r"LearningRange.current = \(1, 0.5\)"),
        ("depth", (0.0, 0.5), r"LearningRange.depth\[0\] = 0"),
        ("current", (-1.0, 0.5), r"LearningRange.current\[0\] = -1"),
        ("directions", "left", r"LearningRange.directions = 'left'"),
    ],
)
def test_bad_ranges_are_refused(field, value, message):
    with pytest.raises(ValueError, match=message):
        replace(WANTED, **{field: value})


def test_a_current_that_is_implausible_for_a_vehicle_is_refused_by_its_own_name_or_taken_as_meant():
    car = small_car()
    message = r"LearningRange.current = 9 m/s .* 16.7 m/s of small car by Froude's law, .* give at most 8.08 m/s, or"
    with pytest.raises(ImplausibleValue, match=message):
        LearningRange(current=(0.0, 9.0)).currents(car)
    assert LearningRange(current=(0.0, 9.0)).currents(CAR) == (0.0, 9.0)  # of the paper's size
    assert 14.9 < LearningRange(current=(0.0, 8.08)).currents(car)[1] <= 15.0
    assert LearningRange(current=(0.0, unusual(9.0))).currents(car)[1] > 15.0


# -- folder and runs ---------------------------------------------------------------------------------------------------


def test_a_folder_belongs_to_one_vehicle_and_one_size_of_cells(tmp_path):
    folder = LearningFolder(tmp_path)
    folder.claim(CAR, 0.04)
    (folder.runs / "captive_000.nc").touch()
    folder.claim(replace(CAR, name="another name"), 0.04)
    heavier = replace(CAR, hull=replace(CAR.hull, mass=60.0))
    with pytest.raises(ValueError, match=r"runs of another vehicle: hull.mass was 49.0, is 60.0"):
        folder.claim(heavier, 0.04)
    with pytest.raises(ValueError, match=r"runs on cells of 0.04 m, and --cell-size is 0.05 m"):
        folder.claim(CAR, 0.05)
    (tmp_path / campaign.ABOUT).write_text("{")
    with pytest.raises(ValueError, match="cannot be read"):
        folder.claim(CAR, 0.04)


def test_a_folder_knows_what_is_finished_and_what_has_begun(tmp_path):
    folder = LearningFolder(tmp_path)
    finished, begun, waiting = make_plan(CAR, WANTED, 0.4, 0.045, ENVELOPE).tasks[:3]
    (folder.runs / f"{finished.name}.nc").touch()
    (folder.work / f"{begun.name}.npz").touch()
    assert folder.unfinished([finished, begun, waiting]) == [begun, waiting]
    assert [folder.is_begun(task) for task in (finished, begun, waiting)] == [False, True, False]


def test_a_plan_looks_whose_the_folder_is(tmp_path):
    folder = LearningFolder(tmp_path)
    folder.claim(CAR, 0.05)
    (folder.runs / "captive_000.nc").touch()
    answer = CliRunner().invoke(app, ["learn", "--cell-size", "0.04", "--plan", "--output", str(tmp_path)])
    assert answer.exit_code == 2 and "holds runs on cells of 0.05 m, and --cell-size is 0.04 m" in answer.output
    assert folder.about()["cell_size"] == 0.05


def test_a_plan_refuses_a_folder_that_cannot_be_one_before_any_drive(tmp_path, monkeypatch):
    monkeypatch.setattr("exumob.learning.envelope.envelope_of", lambda *_, **__: pytest.fail("drives were made"))
    (tmp_path / "taken").touch()
    for name, said in (("plan.csv", "this is to be a folder"), ("taken", "cannot be made"), ("taken/in", "cannot be")):
        answer = CliRunner().invoke(app, ["learn", "--plan", "--output", str(tmp_path / name)])
        assert answer.exit_code == 2 and said in answer.output, answer.output
    answer = CliRunner().invoke(app, ["learn", "--plan", "--output", str(tmp_path / "new"), "--budget", "0.01"])
    assert answer.exit_code == 2 and "--budget = 0.01 h" in answer.output, answer.output
    assert not (tmp_path / "new").exists()


def test_drives_that_teach_are_the_same_on_every_processor():
    """Whatever the last digits of its sines: else a folder of runs would begin anew on another machine."""
    for number in range(8):
        drive = teaching_drive(CAR, number, 8.0)
        for name in ("time", "steering", "wheel_speed"):
            values = np.array(drive.parameters[name])
            assert (values == np.round(values, DECIMALS)).all() and not np.signbit(values[values == 0.0]).any()


def test_runs_of_two_solvers_are_refused_unless_said_and_runs_of_others_join(captive, tmp_path):
    folder = LearningFolder(tmp_path)
    for n, task in enumerate(captive[:3]):
        run = states_run(task, CAR)
        if n == 1:
            run.attrs["flow_revision"] = "another"
        if n == 2:  # of another program
            run.attrs = {k: v for k, v in run.attrs.items() if k not in ("flow_revision", "role")}
        save_dataset(run, folder.runs / f"run{n}.nc")
    with pytest.raises(ValueError, match=r"1 of 2 runs were made with another version .* \(run1\).*--mixed"):
        folder.load()
    assert set(folder.load(mixed=True)) == {"run0", "run1", "run2"}


@pytest.mark.skipif(os.name != "posix" or os.geteuid() == 0, reason="root may write anywhere")
def test_a_folder_that_cannot_be_written_is_refused(tmp_path):
    tmp_path.chmod(0o500)
    with pytest.raises(ValueError, match="cannot be made"):
        LearningFolder(tmp_path / "x")


def test_a_folder_without_runs_binds_to_nothing(tmp_path):
    """A budget that was too small made the folder; larger cells, as its message says, may have it."""
    folder = LearningFolder(tmp_path)
    folder.claim(CAR, 0.02)
    folder.claim(CAR, 0.05)
    folder.claim(light_4x4(), 0.06)
    (folder.work / "captive_000.npz").touch()  # of a run that was begun
    with pytest.raises(ValueError, match="runs of another vehicle"):
        folder.claim(CAR, 0.06)


def test_another_name_of_the_vehicle_keeps_its_runs(plan):
    renamed = replace(CAR, name="another")
    assert [task.name for task in make_plan(renamed, WANTED, 0.4, 0.045, ENVELOPE).tasks] == [
        task.name for task in plan.tasks
    ]
    heavier = replace(CAR, hull=replace(CAR.hull, mass=60.0))
    others = {task.name for task in make_plan(heavier, WANTED, 0.4, 0.045, ENVELOPE).tasks}
    assert others.isdisjoint(task.name for task in plan.tasks)
    assert envelope_key(renamed, WANTED) == envelope_key(CAR, WANTED) != envelope_key(heavier, WANTED)


def test_a_folder_keeps_the_envelope_of_its_first_plan(tmp_path, monkeypatch):
    """Other coefficients, as a later version has them, would make other drives, and other captive runs."""
    keep_envelope(ENVELOPE, CAR, WANTED, tmp_path)
    monkeypatch.setattr(WaveCoefficients, "digest", lambda self: "others")
    monkeypatch.setattr("exumob.learning.envelope.envelope_of", lambda *args: "made anew")
    assert stored_envelope(replace(CAR, name="another"), WANTED, tmp_path) == ENVELOPE
    assert stored_envelope(CAR, replace(WANTED, directions="ahead"), tmp_path) == "made anew"


@pytest.mark.parametrize("run_time", [1.2345678, 0.3333, 0.0505])
def test_runs_of_no_whole_milliseconds_are_refused_before_any_is_made(run_time):
    with pytest.raises(ValueError, match=r"make_plan.run_time = .* s must be a whole number of milliseconds; give"):
        make_plan(CAR, WANTED, 0.4, 0.06, ENVELOPE, run_time=run_time)


def test_the_plan_says_how_fast_its_runs_move(plan, short):
    """Short runs have no room for slow sines of their own for each channel."""
    for made, hurried in ((plan, False), (short, True)):
        motion = next(task for task in made.tasks if isinstance(task, CaptiveTask)).motion
        slow, fast = (max(max(s.harmonics) / motion.period for s in some)
                      for some in (motion.multisines()[:SLOW], motion.multisines()[SLOW:]))  # fmt: skip
        text = "\n".join(made.lines(1))
        assert f"up to {slow:.2g} Hz (speeds, steering) and {fast:.2g} Hz (" in text
        assert ("drives have up to 0.5 and 2 Hz: in runs as short as these" in text) == hurried


def test_runs_of_other_vehicles_and_other_cells_are_refused_before_any_is_made(captive, tmp_path):
    folder = LearningFolder(tmp_path)
    folder.claim(CAR, 0.06)
    run = states_run(captive[0], CAR)
    save_dataset(run, folder.runs / "own.nc")
    assert set(folder.load(vehicle=CAR)) == {"own"}
    with pytest.raises(ValueError, match=r"own: this run was made with a vehicle whose hull.length is 1.0"):
        folder.load(vehicle=light_4x4())
    save_dataset(run.assign_attrs(role="apart", cell_size=0.05), folder.runs / "coarse.nc")
    with pytest.raises(ValueError, match=r"coarse\.nc was made on cells of 0.05 m, and this folder is of .* 0.06 m"):
        folder.load(vehicle=CAR)


@pytest.mark.parametrize("model", ["CoefficientHydrodynamics", "SurrogateHydrodynamics"])
def test_runs_whose_loads_no_flow_gave_are_refused(captive, tmp_path, model):
    folder = LearningFolder(tmp_path)
    save_dataset(states_run(captive[0], CAR).assign_attrs(hydrodynamics=model), folder.runs / "drive.nc")
    with pytest.raises(ValueError, match=rf"drive\.nc: its loads are those of {model}"):
        folder.load()


def test_a_file_is_no_folder(tmp_path):
    with pytest.raises(ValueError, match=r"--output .*\.nc: this is to be a folder"):
        LearningFolder(tmp_path / "x.nc")


@pytest.mark.parametrize("interval", [5e-3, 2.5e-3, 1.25e-3])
def test_captive_runs_teach_as_free_ones_do(captive, interval):
    """Loads are means over intervals: a straight line in time comes out as it is, without a shift."""
    task = replace(captive[0], interval=interval)
    ends = interval * np.arange(1, round(task.duration / interval) + 1)
    middle = ends - 0.5 * interval
    result = xr.Dataset(
        {
            "force": (("time", "body", "axis"), np.ones((len(ends), 5, 3)) * (40.0 + 8.0 * middle)[:, None, None]),
            "moment": (("time", "body", "axis"), np.ones((len(ends), 5, 3))),
        },
        {"time": ends}, {"status": "completed", "wall_time": 2.0},
    )  # fmt: skip
    run = captive_histories(result, task, CAR).assign_attrs(scenario=task.name)
    check_run(run, task.name)
    inside = (run["time"].values > middle[0]) & (run["time"].values < middle[-1])
    wanted = 40.0 + 8.0 * run["time"].values[inside]
    assert run["water_wrench"].values[inside, 2, 1] == pytest.approx(wanted, rel=1e-5)
    assert run["time"].values[[0, -1]] == pytest.approx([1e-3 * round(1e3 * interval), task.duration])
    place = task.motion.poses(CAR, task.water, 0.1).position
    assert run["position"].sel(time=0.1, method="nearest").values == pytest.approx(place, abs=1e-6)
    speed = np.gradient(run["velocity"].values[:, 0, 0].astype(float), run["time"].values)
    assert run["acceleration"].values[5:-5, 0, 0] == pytest.approx(speed[5:-5], abs=2e-3)
    assert json.loads(run.attrs["parameters"])["vehicle"]["Vehicle"]["name"] == CAR.name
