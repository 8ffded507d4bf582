"""The command line: files, and runs that break or are stopped."""

import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from exumob.__main__ import app
from exumob.mobility.crossing import FAILURES
from exumob.simulation.result_files import load_dataset

SHORT = ["--duration", "0.2", "--micro-step", "5e-4", "--macro-step", "20e-3"]


def call(*arguments):
    return CliRunner().invoke(app, [str(a) for a in arguments], env={"COLUMNS": "250", "TERM": "dumb"})


def plain(text):
    """Without colours and line breaks."""
    return " ".join(re.sub(r"\x1b\[[0-9;]*m", "", text).split())


def lane_change(*arguments):
    return call("lane-change", *SHORT, *arguments)


# -- runs --------------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    folder = tmp_path_factory.mktemp("run")
    files = {name: folder / name for name in ("run.nc", "run.png", "run.gif")}
    answer = lane_change("--output", files["run.nc"], "--figure", files["run.png"], "--animate", files["run.gif"])
    return answer, files


def test_short_run_writes_its_files_and_names_them(written):
    answer, files = written
    assert answer.exit_code == 0, answer.output
    assert files["run.png"].read_bytes().startswith(b"\x89PNG")
    assert files["run.gif"].read_bytes().startswith(b"GIF8")
    for name, file in files.items():
        assert name in plain(answer.output)
        assert file.stat().st_size > 5000
    assert len(list(files["run.nc"].parent.iterdir())) == 3


def test_written_result_is_the_scenario_asked_for(written):
    run = load_dataset(written[1]["run.nc"])
    assert run.attrs["status"] == "completed"
    assert float(run["time"][-1]) == pytest.approx(0.2)
    assert float(run["flow_state"].sel(state="water_depth").max()) == pytest.approx(0.12)
    assert float(run["flow_state"].sel(state="current_speed").max()) == pytest.approx(1.0)


def test_summary_has_a_dozen_lines_and_the_asked_figures(written):
    """Spec: distance, lateral displacement, final yaw, drift, slip, buoyed weight, wall time, real-time factor."""
    text = plain(written[0].output).lower()
    for name in (
        "distance", "lateral displacement", "final yaw", "drift", "slip", "buoyed weight", "wall time",
        "real-time factor",
    ):  # fmt: skip
        assert name in text
    before = re.split(r"^result", written[0].output, flags=re.MULTILINE)[0]
    skipped = "settling:", "driving:", "parts of the error", " "  # what belongs to trust is indented below it
    lines = [line for line in before.splitlines() if line.strip() and not line.startswith(skipped)]
    assert lines[0].startswith("verdict") and 11 <= len(lines) <= 14


OTHER = """
import dataclasses
from vehicle_models.amphibious import amphibious_vehicle as _base
def car():
    vehicle = _base()
    return dataclasses.replace(vehicle, name="tall", wheel=dataclasses.replace(vehicle.wheel, diameter=0.25))
"""


def test_options_reach_the_run(tmp_path):
    """Depth 0 is dry ground; soil, vehicle, steering (degrees) and wheel speed are those asked for."""
    file, car = tmp_path / "run.nc", tmp_path / "car.py"
    car.write_text(OTHER)
    answer = lane_change(
        "--depth-ratio", "0", "--soil", "Upland sandy loam 51 %", "--vehicle", car,
        "--steering", "-20", "--wheel-speed", "4", "--output", file,
    )  # fmt: skip
    assert answer.exit_code == 0, answer.output
    parameters = load_dataset(file).attrs["parameters"]
    assert '"water": null' in parameters
    assert "Upland sandy loam 51 %" in parameters
    assert '"name": "tall"' in parameters
    assert f'"amplitude": {np.radians(-20.0)}' in parameters
    assert '"speed": 4.0' in parameters
    assert load_dataset(file).attrs["hydrodynamics"] == "NoWater"


def test_depth_ratio_counts_in_the_tyres_of_the_vehicle(tmp_path):
    """60 % of 0.25 m."""
    file, car = tmp_path / "run.nc", tmp_path / "car.py"
    car.write_text(OTHER)
    answer = lane_change("--vehicle", car, "--output", file)
    assert answer.exit_code == 0, answer.output
    assert float(load_dataset(file)["flow_state"].sel(state="water_depth").max()) == pytest.approx(0.15)


HEAVY = """
import dataclasses
from exumob import unusual
from vehicle_models.amphibious import amphibious_vehicle as _base
def car():
    vehicle = _base()
    return dataclasses.replace(vehicle, hull=dataclasses.replace(vehicle.hull, mass=unusual(5000.0)))
"""


def test_vehicle_that_sinks_is_said_without_a_traceback(tmp_path):
    (tmp_path / "heavy.py").write_text(HEAVY)
    answer = lane_change("--depth-ratio", "0", "--vehicle", tmp_path / "heavy.py", "--output", tmp_path / "run.nc")
    assert answer.exit_code in (1, 2)
    assert "sunk" in plain(answer.output)
    assert isinstance(answer.exception, SystemExit)


BREAKING = """
import numpy as np
import exumob.water.coefficients as c
from vehicle_models.amphibious import amphibious_vehicle as _base
_original = c.CoefficientHydrodynamics.wrenches
def _broken(self, history, predict):
    loads = _original(self, history, predict)
    return loads * np.nan if len(self._times) > 5 and self._macro_step == 20e-3 else loads
def car():
    c.CoefficientHydrodynamics.wrenches = _broken
    return _base()
"""


def test_broken_run_is_saved_and_said(tmp_path, monkeypatch):
    import exumob.water.coefficients as module

    monkeypatch.setattr(module.CoefficientHydrodynamics, "wrenches", module.CoefficientHydrodynamics.wrenches)
    (tmp_path / "car.py").write_text(BREAKING)
    file = tmp_path / "run.nc"
    answer = lane_change("--vehicle", tmp_path / "car.py", "--output", file)
    assert answer.exit_code == 1
    assert "not finite at 0.1000 s" in plain(answer.output)
    run = load_dataset(file)
    assert float(run["time"][-1]) == pytest.approx(0.1)
    assert "broke down" in run.attrs["status"]


def test_full_disk_is_said_and_the_result_is_elsewhere(tmp_path, monkeypatch):
    target, spare = tmp_path / "target", tmp_path / "spare"
    target.mkdir()
    spare.mkdir()
    write = Path.write_bytes

    def refuse(self, data):
        if target in self.parents:
            raise OSError(28, "No space left on device")
        return write(self, data)

    monkeypatch.setattr(Path, "write_bytes", refuse)
    real_check = sys.modules["exumob.commands.driving"].check_targets

    def check(targets):
        real_check(targets)
        monkeypatch.setattr("tempfile.tempdir", str(spare))

    monkeypatch.setattr("exumob.commands.driving.check_targets", check)
    answer = lane_change("--output", target / "run.nc")
    assert answer.exit_code == 0, answer.output
    (file,) = spare.glob("*/run.nc")
    assert str(file).replace(" ", "") in plain(answer.output).replace(" ", "")
    assert load_dataset(file).sizes["time"] == 21


# -- as a program ------------------------------------------------------------------------------------------------------


def program(*arguments, cwd):
    return subprocess.run(
        [sys.executable, "-m", "exumob", *map(str, arguments)], cwd=cwd, capture_output=True, text=True, timeout=600,
        check=False, env=os.environ | {"COLUMNS": "200", "TERM": "dumb"},
    )  # fmt: skip


def test_program_runs_anywhere_and_leaves_nothing_behind(tmp_path):
    """From a folder that is not the checkout, without files: no solution folder, no log, nothing but the summary."""
    answer = program("lane-change", *SHORT, "--depth-ratio", "0", cwd=tmp_path)
    assert answer.returncode == 0, answer.stderr
    assert "distance" in answer.stdout
    assert "Traceback" not in answer.stderr
    assert list(tmp_path.iterdir()) == []


INTERRUPTED = """
import os, signal, threading, exumob.multibody.system as m
from vehicle_models.amphibious import amphibious_vehicle as _base
_original, _started = m.MultibodyVehicle.{method}, []
def _interrupt():
    os.kill(os.getpid(), signal.{signal})
def _watched(self, *arguments):
    if not _started and {condition}:
        _started.append(threading.Timer({delay}, _interrupt))
        _started[0].daemon = True
        _started[0].start()
    return _original(self, *arguments)
def car():
    m.MultibodyVehicle.{method} = _watched
    return _base()
"""
"""A vehicle file that sends a real Ctrl-C some time after a method was first called."""


@pytest.mark.usefixtures("interruptible")
@pytest.mark.parametrize(
    ("delay", "sent", "ignored"),
    [(0.0, "SIGINT", False), (0.0137, "SIGINT", False), (0.0137, "SIGTERM", False), (0.0137, "SIGTERM", True)],
)
def test_ctrl_c_and_kill_save_what_was_computed(tmp_path, delay, sent, ignored):
    """Also `kill` of a job in the background of a script, which ignores Ctrl-C."""
    if ignored:
        signal.signal(signal.SIGINT, signal.SIG_IGN)
    text = INTERRUPTED.format(method="advance", condition="arguments[0] > 0.15", delay=delay, signal=sent)
    (tmp_path / "car.py").write_text(text)
    arguments = ["--duration", "60", "--micro-step", "5e-4", "--macro-step", "20e-3", "--vehicle", tmp_path / "car.py"]
    answer = program("lane-change", *arguments, "--output", tmp_path / "run.nc", cwd=tmp_path)
    assert answer.returncode == 130, answer.stderr
    assert "interrupted at" in answer.stderr
    assert "Traceback" not in answer.stderr
    run = load_dataset(tmp_path / "run.nc")
    assert "interrupted" in run.attrs["status"]
    end = float(run["time"][-1])
    assert 0.1 < end < 10.0 and end / 0.02 == pytest.approx(round(end / 0.02))  # a whole macro step
    assert np.isfinite(run["position"].values).all()


@pytest.mark.usefixtures("interruptible")
def test_ctrl_c_while_settling_ends_without_a_traceback(tmp_path):
    text = INTERRUPTED.format(method="settle", condition="True", delay=0.05, signal="SIGINT")
    (tmp_path / "car.py").write_text(text)
    answer = program("lane-change", *SHORT, "--vehicle", tmp_path / "car.py", "--output", "run.nc", cwd=tmp_path)
    assert answer.returncode == 130, answer.stderr[-1500:]
    assert "Traceback" not in answer.stderr
    assert not (tmp_path / "run.nc").exists()


def test_flow_in_the_loop_with_a_checkpoint(tmp_path):
    """Very coarse and short: the run completes, its checkpoint is refused without --resume and taken with it."""
    file, output = tmp_path / "run.npz", tmp_path / "run.nc"
    options = [
        "--hydrodynamics", "cfd", "--cell-size", "0.08", "--coarse", "--duration", "0.004", "--current", "0",
        "--micro-step", "1e-3", "--macro-step", "2e-3", "--checkpoint", file, "--output", output,
    ]  # fmt: skip
    answer = call("lane-change", *options)
    assert answer.exit_code == 0, answer.output
    result = load_dataset(output)
    assert result.attrs["hydrodynamics"] == "CfdHydrodynamics"
    assert result.attrs["coupling"] == "SemiImplicit"
    answer = call("lane-change", *options)
    assert answer.exit_code == 2
    assert "exists already; resume" in plain(answer.output)
    answer = call("lane-change", *options, "--resume")
    assert answer.exit_code == 0, answer.output
    for name in ("position", "water_wrench", "hydrodynamics_iterations", "coupling_iterations"):
        np.testing.assert_array_equal(load_dataset(output)[name], result[name])


def test_flow_in_the_loop_is_animated_with_its_surface(tmp_path):
    options = ["--hydrodynamics", "cfd", "--cell-size", "0.08", "--coarse", "--duration", "0.1", "--current", "0"]
    steps = ["--micro-step", "1e-3", "--macro-step", "5e-3"]
    animation, output = tmp_path / "run.gif", tmp_path / "run.nc"
    answer = call("lane-change", *options, *steps, "--animate", animation, "--output", output)
    assert answer.exit_code == 0, answer.output
    assert animation.stat().st_size > 1000
    result = load_dataset(output)
    assert np.diff(result["time"].values) == pytest.approx(1e-3)  # from which networks can learn
    surface = result["hydrodynamics_elevation"]
    assert surface["snapshot"].values == pytest.approx([0.0, 0.05, 0.1], abs=1e-9)
    assert 0.0 < float(np.abs(surface).max()) < 0.05


def test_networks_are_the_default(tmp_path):
    answer = lane_change("--members", "--output", tmp_path / "run.nc")
    assert answer.exit_code == 0, answer.output
    assert "networks" in answer.output and "members' spread" in answer.output
    with load_dataset(tmp_path / "run.nc") as run:
        assert run["member_position"].sizes["member"] == 5


@pytest.mark.usefixtures("fresh_warnings")
def test_vehicle_that_the_networks_do_not_know_gets_the_calibrated_model(tmp_path, caplog):
    car = Path(__file__).parents[2] / "vehicle_models" / "light_4x4.py"
    answer = lane_change("--vehicle", car, "--output", tmp_path / "run.nc")
    assert answer.exit_code == 0, answer.output
    assert "trust                 calibrated, not validated: this vehicle (light 4x4) is not" in answer.output
    assert re.search(
        "light 4x4: no networks know this vehicle .*trained with.*coefficients that were calibrated", caplog.text
    )
    assert load_dataset(tmp_path / "run.nc").attrs["hydrodynamics"] == "CalibratedHydrodynamics"


# -- maps --------------------------------------------------------------------------------------------------------------


def test_map_is_computed_drawn_and_written_as_a_table(tmp_path):
    options = "--hydrodynamics", "coefficients", "--cells", 1, "--levels", 0, "--draws", 1, "--workers", 2
    files = "--output", tmp_path / "map", "--figure", tmp_path / "map.png", "--csv", tmp_path / "map.csv"
    answer = call("map", *options, *files)
    assert answer.exit_code == 0, answer.output
    assert "of 4 computed nodes; one run a node, without scatter: no chance is known." in answer.output
    assert "outside the training range" not in answer.output  # coefficients have none
    assert (
        "trust     coefficients, beyond what was measured (in brackets): depth ratio 0.36 to 0.64 (0.4 to 0.6)"
        in answer.output
    )
    result = load_dataset(tmp_path / "map" / "map.nc").squeeze("panel")
    assert float(result["speed"].sel(y=0.36, x=0.0)) > float(result["speed"].sel(y=0.64, x=1.2)) > 0.0
    assert (tmp_path / "map.png").stat().st_size > 10_000
    header, *rows = (tmp_path / "map.csv").read_text().splitlines()
    assert header.startswith("panel,water.depth_ratio [-],water.current_speed [m/s],probability [-]")
    assert len(rows) == 4
    assert all(any(name in row for name in FAILURES) for row in rows)
    other = call("map", *options, "--width", 8, "--output", tmp_path / "map")
    assert other.exit_code == 2
    assert "another map: crossing.limits.width was 12.0, and is 8.0" in " ".join(other.output.split())
