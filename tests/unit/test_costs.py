"""What a run takes is estimated and said before it begins, and refused where it cannot fit; nothing is allocated."""

import importlib.util
import logging
import math
import os
import re
import sys
import time
import tracemalloc
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from exumob.coupling.flow_code import BuiltInFlow
from exumob.coupling.flow_in_loop import CfdHydrodynamics
from exumob.coupling.strong import Strong
from exumob.driving.maneuver import ConstantSteer, lane_change
from exumob.driving.path_following import PathFollowing
from exumob.flow import FlowSettings, FlowSolver, Grid, mesh_solid
from exumob.flow.cost import flow_cost
from exumob.flow.output.vtk import VtkSeries
from exumob.flow.resolution import check_resolution
from exumob.flow.vehicle_window import vehicle_window
from exumob.simulation.cost import TIME_TO_SETTLE, driving_time
from exumob.simulation.run import simulate
from exumob.support import compiled, cost
from exumob.sweeps.experiment import amphibious_lane_change
from exumob.sweeps.run import START, need
from exumob.towing_tank import captive_run
from exumob.vehicle.parameters import Steering
from exumob.water.conditions import Water
from vehicle_models.amphibious import amphibious_vehicle

VEHICLE = amphibious_vehicle()
WATER = Water(0.12, 1.0)
GIB = 2.0**30


@pytest.fixture
def eight_gib(monkeypatch):
    """A machine with 8 GiB and two cores."""
    monkeypatch.setattr(cost, "memory_limit", lambda: 8.0 * GIB)
    monkeypatch.setattr("exumob.flow.grid.memory_limit", lambda: 8.0 * GIB)
    monkeypatch.setattr("exumob.simulation.cost.memory_limit", lambda: 8.0 * GIB)


def cube():
    """Triangles of a box, shape (12, 3, 3)."""
    return np.array(pytest.importorskip("trimesh").creation.box((1.0, 1.0, 1.0)).triangles)


def refused(call, *words):
    """The message with which a call is refused."""
    with pytest.raises(ValueError) as error:
        call()
    for word in words:
        assert word in str(error.value), str(error.value)
    return str(error.value)


# -- memory ------------------------------------------------------------------------------------------------------------


@pytest.mark.usefixtures("eight_gib")
@pytest.mark.parametrize("cell_size", [3e-3, 1e-3, 1e-4, 1e-6])
@pytest.mark.parametrize(
    "make",
    [
        lambda size: vehicle_window(VEHICLE, size, WATER),
        lambda size: captive_run(VEHICLE, WATER, cell_size=size),
        lambda size: BuiltInFlow(size).cost(VEHICLE, WATER, 1.0, 1.0, 1e-3),
    ],
    ids=["window", "captive run", "flow in the loop"],
)
def test_cells_that_cannot_fit_are_refused_with_the_size_that_fits(make, cell_size):
    message = refused(lambda: make(cell_size), f"cell_size = {cell_size:g} m", "GiB of memory", "8 GiB", "would fit")
    fitting = float(message.split("cells of ")[1].split(" m")[0])
    assert vehicle_window(VEHICLE, fitting, WATER).n_cells < 8.0 * GIB / 515.0
    assert vehicle_window(VEHICLE, fitting, WATER).cells_with(0.9 * fitting) > 8.0 * GIB / 515.0


@pytest.mark.parametrize("cell_size", [1e-3, 1e-6])
def test_the_refusal_itself_takes_no_memory(cell_size):
    tracemalloc.start()
    with pytest.raises(ValueError, match="of memory"):
        vehicle_window(VEHICLE, cell_size, WATER)
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert most < 5e6


@pytest.mark.usefixtures("eight_gib")
@pytest.mark.parametrize(
    ("call", "word"),
    [
        (lambda: Grid.uniform((0, 0, 0), (1, 1, 1), 1e-5), "Grid.uniform.cell_size"),
        (lambda: Grid.stretched((0, 0, 0), (1, 1, 1), (-9, -9, 0), (9, 9, 2), 1e-5), "Grid.stretched.cell_size"),
        (lambda: FlowSolver(Grid.uniform((0, 0, 0), (1, 1, 1), 0.003), (), WATER), "FlowSolver"),
        (lambda: captive_run(VEHICLE, WATER, duration=1e6), "duration = 1e+06 s"),
        (lambda: captive_run(VEHICLE, WATER, duration=1.0, interval=1e-7), "interval = 1e-07 s"),
        (lambda: captive_run(VEHICLE, WATER, duration=2e3, interval=0.1, snapshots=0.1, cell_size=4.5e-3), "snapshots"),
        (lambda: mesh_solid(cube(), 1e-5), "mesh_solid: spacing = 1e-05 m"),
    ],
    ids=lambda v: v if isinstance(v, str) else "",
)
def test_what_cannot_fit_is_refused_by_name(call, word):
    refused(call, word, "of memory", "8 GiB")


@pytest.mark.usefixtures("eight_gib")
@pytest.mark.parametrize("steps", [{"duration": 1e6}, {"duration": 10.0, "record_step": 1e-6, "micro_step": 1e-6}])
def test_records_that_cannot_fit_are_refused_with_what_fits(sand, steps):
    message = refused(lambda: simulate(VEHICLE, sand, **steps), "duration = ", "record_step = ", "8 GiB")
    fitting = float(message.split("give a duration of ")[1].split(" s")[0])
    assert 0.0 < fitting < steps["duration"]


def test_limits_of_control_groups_count(tmp_path, monkeypatch):
    """Containers and batch systems give less than the machine has."""
    monkeypatch.setattr(cost, "CONTROL_GROUPS", tmp_path)
    places = [line.split(":", 2)[2].lstrip("/") for line in Path("/proc/self/cgroup").read_text().splitlines()]
    folder = tmp_path / places[-1]
    folder.mkdir(parents=True, exist_ok=True)
    (tmp_path / "memory.max").write_text("1000000\n")
    (folder / "memory.max").write_text("2000000\n" if folder != tmp_path else "1000000\n")
    if any(line.startswith("0::") for line in Path("/proc/self/cgroup").read_text().splitlines()):
        assert cost.memory_limit() == 1e6
    monkeypatch.setattr(cost, "CONTROL_GROUPS", tmp_path / "absent")
    assert 1e8 < cost.memory_limit() < math.inf


def test_disks_that_cannot_hold_it(tmp_path, sand):
    grid = vehicle_window(VEHICLE, 0.018, WATER)
    series = VtkSeries(tmp_path / "fields", VEHICLE)
    series.require_room(grid, 10)
    with pytest.raises(ValueError, match=r"fields: 1,000,000,000 instants of 407,484 cells: up to .* GiB on"):
        series.require_room(grid, 10**9)
    assert not (tmp_path / "fields").exists()


# -- time --------------------------------------------------------------------------------------------------------------


def test_steps_follow_the_courant_number():
    """Halving the cells doubles the steps once the Courant number decides, and the threads share the work."""
    coarse, fine = (flow_cost(1e6, size, 2.0, 1.0, 1e-3, 0.4) for size in (4e-3, 2e-3))
    assert (coarse.steps, fine.steps) == (4000, 7000)
    assert flow_cost(1e6, 0.02, 2.0, 1.0, 1e-3, 0.4).steps == 1000
    assert flow_cost(1e6, 0.02, 2.0, 1.0, 1e-3, 0.4, threads=2).seconds == pytest.approx(180.0)
    assert coarse.memory == pytest.approx(515e6)
    assert "1,000,000 cells, 0.48 GiB of memory, 4,000 steps" in str(coarse)


@pytest.mark.parametrize(
    ("seconds", "words"),
    [(0.2, "1 s"), (59.0, "59 s"), (90.0, "1.5 min"), (5400.0, "1.5 h"), (2e5, "2.3 days"), (1e10, "317 years")],
)
def test_times_in_words(seconds, words):
    assert cost.spelled_time(seconds) == words


@pytest.mark.parametrize(("seconds", "level"), [(1.0, None), (30.0, "INFO"), (3600.0, "WARNING")])
def test_long_runs_are_said_and_short_ones_are_not(caplog, seconds, level):
    with caplog.at_level(logging.INFO, "exumob.support.cost"):
        cost.announce("8 s of flow", seconds)
    assert [record.levelname for record in caplog.records] == ([level] if level else [])


class Stopped(Exception):
    """Raised in place of what takes long."""


@pytest.fixture
def nothing_is_computed(monkeypatch):
    def stop(*arguments, **options):
        raise Stopped

    monkeypatch.setattr("exumob.simulation.run.MultibodyVehicle", stop)
    monkeypatch.setattr("exumob.towing_tank.run.FlowSolver", stop)


@pytest.mark.usefixtures("nothing_is_computed")
def test_a_long_captive_run_says_what_it_takes(caplog):
    with caplog.at_level(logging.INFO, "exumob.support.cost"), pytest.raises(Stopped):
        captive_run(VEHICLE, WATER, duration=8.0)
    (said,) = [r.message for r in caplog.records if r.name == "exumob.support.cost"]
    assert "captive run of amphibious, 8 s: 407,484 cells, 0.2 GiB of memory, 8,000 steps" in said
    assert "min on 1 thread" in said


@pytest.mark.usefixtures("nothing_is_computed")
@pytest.mark.parametrize(("scheme", "words"), [(None, "min"), (Strong(), "h")])
def test_the_flow_in_the_loop_says_what_it_takes(caplog, sand, scheme, words):
    model = CfdHydrodynamics(cell_size=0.018, allow_coarse=True)
    with caplog.at_level(logging.INFO, "exumob.support.cost"), pytest.raises(Stopped):
        simulate(VEHICLE, sand, WATER, lane_change(), model, coupling=scheme)
    (said,) = [r.message for r in caplog.records if r.name == "exumob.support.cost"]
    assert "16,000 steps of the vehicle, 407,484 cells" in said
    assert f" {words}, if no other program" in said


@pytest.mark.usefixtures("nothing_is_computed")
def test_a_short_run_says_nothing(caplog, sand):
    with caplog.at_level(logging.INFO, "exumob.support.cost"), pytest.raises(Stopped):
        simulate(VEHICLE, sand, WATER, lane_change(), "coefficients")
    assert "exumob.support.cost" not in [r.name for r in caplog.records]


# -- cells asked for ---------------------------------------------------------------------------------------------------


def test_advice_on_cells_says_what_they_take():
    with pytest.raises(ValueError, match=r"use a cell size of 0\.02 m or less \(about 3\.3e\+05 cells, 0\.16 GiB") as e:
        check_resolution(VEHICLE, vehicle_window(VEHICLE, 0.03, WATER))
    assert "min for a second at 1 m/s on one thread" in str(e.value)


def test_cells_for_a_narrow_gap_are_no_advice():
    """The gap must be opened; what else is too coarse asks for cells of its own."""
    narrow = replace(VEHICLE, track=0.5202, steering=Steering(limit=1e-6))
    with pytest.raises(ValueError, match=r"cells of 5e-05 m for the gap .* too much for this machine") as e:
        check_resolution(narrow, vehicle_window(narrow, 0.03, WATER))
    assert "make it wider (Vehicle.track, Hull.width, " in str(e.value)
    assert "use a cell size of 0.02 m or less for the rest" in str(e.value)


@pytest.mark.usefixtures("nothing_is_computed")
@pytest.mark.parametrize(
    "maneuver",
    [
        ConstantSteer(),
        lane_change(0.0),
        lane_change(math.radians(8.0)),
        PathFollowing(((0.0, 0.0), (5.0, 0.0)), max_steering=math.radians(8.0)),
    ],
    ids=["straight", "no steering", "8 degrees", "path"],
)
def test_the_flow_is_asked_for_the_maneuvers_angles(sand, maneuver):
    """18 mm cells have two in the gap at small angles, and not at the limit of 35 degrees."""
    with pytest.raises(Stopped):
        simulate(VEHICLE, sand, WATER, maneuver, CfdHydrodynamics(cell_size=0.018))


@pytest.mark.usefixtures("nothing_is_computed")
@pytest.mark.parametrize(
    ("maneuver", "angle"),
    [
        (lane_change(math.radians(-30.0)), "30"),
        (PathFollowing(((0.0, 0.0), (5.0, 0.0)), max_steering=math.radians(30.0)), "30"),
    ],
)
def test_the_flow_refuses_angles_that_its_cells_cannot_take(sand, maneuver, angle):
    with pytest.raises(ValueError, match=rf"steered -?{angle} deg of 28\.\d mm has 1\.6 cells"):
        simulate(VEHICLE, sand, WATER, maneuver, CfdHydrodynamics(cell_size=0.018))


def test_without_a_maneuver_the_limit_counts():
    with pytest.raises(ValueError, match=r"steered -?35 deg"):
        BuiltInFlow(0.018, settings=FlowSettings()).cost(VEHICLE, WATER, 1.0, 1.0, 1e-3)


# -- compilation -------------------------------------------------------------------------------------------------------


@pytest.fixture
def kernel(tmp_path, monkeypatch):
    """Makes a kernel anew from its source, as the next process does, and tells if Numba finds it when it is called."""
    monkeypatch.setattr("numba.config.CACHE_DIR", str(tmp_path / "kept"))
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    file = tmp_path / "made_up_kernel.py"

    def make(source):
        if not file.exists() or file.read_text() != source:
            file.write_text(source)
        spec = importlib.util.spec_from_file_location("made_up_kernel", file)
        module = importlib.util.module_from_spec(spec)
        monkeypatch.setitem(sys.modules, "made_up_kernel", module)
        spec.loader.exec_module(module)
        return module.double

    make.file = file
    return make


DOUBLE = "import numba\n@numba.njit(cache=True)\ndef double(x):\n    return 2.0 * x\n"


def is_found(kernel):
    """Whether Numba finds it on the disk."""
    assert kernel(2.0) == 4.0
    return bool(kernel.stats.cache_hits)


def test_kernels_that_are_kept_are_told_from_those_that_are_not(kernel):
    assert compiled.is_compiled(refused)  # plain Python
    new = kernel(DOUBLE)
    assert not compiled.is_compiled(new) and not is_found(new)
    assert compiled.is_compiled(new)
    again = kernel(DOUBLE)
    assert compiled.is_compiled(again) and is_found(again)
    later = time.time() + 10.0
    os.utime(kernel.file, (later, later))  # installed again, the same as before
    installed = kernel(DOUBLE)
    assert compiled.is_compiled(installed) == is_found(installed)
    changed = kernel(DOUBLE.replace("2.0 * x", "x + x"))
    assert not compiled.is_compiled(changed) and not is_found(changed)
    assert not compiled.is_compiled(kernel(DOUBLE.replace("(cache=True)", "")))  # never kept
    for index in kernel.file.parent.rglob("*.nbi"):
        index.write_bytes(b"")
    assert not compiled.is_compiled(kernel(DOUBLE.replace("2.0 * x", "x + x")))


def test_what_cannot_be_kept_is_not_said_to_be(kernel, caplog, monkeypatch):
    monkeypatch.setattr(compiled, "_said", set())
    compiled.say_compilation("the flow solver", kernel(DOUBLE.replace("(cache=True)", "")), "two minutes")
    monkeypatch.setenv(compiled.VARIABLE, "/tmp/exumob-kernels-abc")
    compiled.say_compilation("the vehicle model", kernel(DOUBLE), "half a minute")
    unkept, private = (record.message for record in caplog.records)
    assert "every process compiles anew" in unkept and "set NUMBA_CACHE_DIR" in private
    assert "is kept, later runs" not in unkept + private


def test_compilation_is_said_once(kernel, caplog, monkeypatch):
    monkeypatch.setattr(compiled, "_said", set())
    for _ in range(2):
        compiled.say_compilation("the flow solver", kernel(DOUBLE), "two minutes")
        compiled.say_compilation("the vehicle model", refused, "half a minute")
    assert [r.message for r in caplog.records] == [
        "the flow solver is compiled first, which takes two minutes; what is compiled is kept, "
        "later runs start at once."
    ]


def test_training_takes_as_long_as_measured():
    """Three minutes a seed for the paper's LSTMs, ten seconds for the others; nine runs of 8 s."""
    presets = pytest.importorskip("exumob.learning.presets").PRESETS
    from exumob.learning.cost import training_time

    runs = {str(n): xr.Dataset(coords={"time": [0.0, 8.0]}) for n in range(9)}
    assert training_time([presets["paper-lstm"]], runs, 1) == pytest.approx(180.0)
    assert training_time([presets["residual"]], runs, 5) == pytest.approx(50.0)


def test_a_run_takes_as_long_as_measured():
    """With the networks 1.28 and 1.38 s for 8 s with the setting fast, 1.37 and 1.62 s for a second with fine."""
    assert driving_time(8.0, 1e-3, 0.02) == pytest.approx(1.33, rel=0.1)
    assert driving_time(1.0, 1e-4, 1e-3) == pytest.approx(1.5, rel=0.1)


@pytest.mark.parametrize(("load", "processes", "words"), [
    (0.1, 1, "about 20 s, if no other program takes its share of the 2 cores"),
    (5.0, 2, r"the 2 cores \(about 1.2 min beside those at work now\)"), (3.0, 1, r"\(about 40 s beside"),
])  # fmt: skip
def test_other_programs_are_reckoned_with(load, processes, words, monkeypatch):
    monkeypatch.setattr(cost, "cores", lambda: 2)
    monkeypatch.setattr(cost, "_busy", lambda: load)
    assert re.search(words + ("$" if load < 1.0 else ""), cost.expected_time(20.0, processes))


def test_a_sweep_says_what_its_runs_and_processes_take(monkeypatch):
    monkeypatch.setattr("exumob.sweeps.run.cores", lambda: 2)
    cases = [{"hull.mass": mass} for mass in (49.0, 50.0, 51.0, 52.0, 53.0, 54.0)]
    one = driving_time(8.0, 1e-3, 0.02) + TIME_TO_SETTLE
    assert need(amphibious_lane_change(), cases).time == pytest.approx(3.0 * one + START)
    assert need(amphibious_lane_change(), cases[:1]).time == pytest.approx(one + START)
    fine = [case | {"setting": "fine", "duration": 1.0} for case in cases]
    assert need(amphibious_lane_change(), fine, 1).time == pytest.approx(6.0 * (1.45 + TIME_TO_SETTLE) + START)
