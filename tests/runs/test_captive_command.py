"""The command `exumob captive`, coarse, a few steps: files, runs that break or are stopped."""

import json
import os
import re
import subprocess
import sys

import numpy as np
import pytest
from typer.testing import CliRunner

import exumob.flow
from exumob.__main__ import app
from exumob.simulation.result_files import load_dataset

SHORT = ["--cell-size", "0.05", "--coarse", "--interval", "5e-3", "--duration", "0.02"]


def call(*arguments):
    return CliRunner().invoke(app, ["captive", *map(str, arguments)], env={"COLUMNS": "250", "TERM": "dumb"})


def plain(text):
    """Without colours and line breaks."""
    return " ".join(re.sub(r"\x1b\[[0-9;]*m", "", text).split())


def test_closure_and_surface_reach_the_solver(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    answer = call(*SHORT, "--closure", "none", "--surface", "plic", "--output", "run.nc")
    assert answer.exit_code == 0, answer.output
    settings = json.loads(load_dataset(tmp_path / "run.nc").attrs["parameters"])["settings"]["FlowSettings"]
    assert settings["closure"] is None
    assert settings["surface"] == "plic"


def test_run_writes_its_files_and_prints_the_loads(tmp_path):
    files = [tmp_path / name for name in ("run.nc", "run.png", "run.gif", "fields")]
    options = ("--output", "--figure", "--animate", "--vtk")
    answer = call(
        *SHORT, "--drift-angle", "10", "--yaw-rate", "-20", "--wheel-speed", "5", "--speed", "0.5",
        "--ramp-time", "0.02",
        *(x for pair in zip(options, files, strict=True) for x in pair),
    )  # fmt: skip
    assert answer.exit_code == 0, answer.output
    assert files[1].read_bytes().startswith(b"\x89PNG")
    assert files[2].read_bytes().startswith(b"GIF8")
    assert (files[3] / "flow.pvd").is_file()
    for name in ("run.nc", "run.png", "run.gif", "flow.pvd", "captive run of amphibious, completed", "rear right"):
        assert name in plain(answer.output)
    run = load_dataset(files[0])
    motion = json.loads(run.attrs["parameters"])["motion"]["CaptiveMotion"]
    assert motion["drift_angle"] == pytest.approx(np.radians(10.0))
    assert motion["yaw_rate"] == pytest.approx(np.radians(-20.0))
    assert (motion["speed"], motion["wheel_speed"]) == (0.5, 5.0)
    assert run["wheel_speed"].values[-1] == pytest.approx(5.0)
    (line,) = [text for text in answer.output.splitlines() if text.strip().startswith("hull")]
    later = run["force"].sel(body="hull", time=slice(0.01, None)).mean("time").values
    assert [float(x) for x in re.findall(r"(-?[\d.]+) ±", line)] == pytest.approx(later, abs=0.006)


def test_broken_run_is_saved_and_said(tmp_path, monkeypatch):
    advance = exumob.flow.FlowSolver.advance

    def fail(self, time, poses):
        if time > 0.012:
            raise RuntimeError("the dam broke")
        return advance(self, time, poses)

    monkeypatch.setattr(exumob.flow.FlowSolver, "advance", fail)
    answer = call(*SHORT, "--output", tmp_path / "run.nc")
    assert answer.exit_code == 1
    assert "the dam broke" in plain(answer.output)
    assert load_dataset(tmp_path / "run.nc").sizes["time"] == 2


INTERRUPTED = """
import os, signal, exumob.flow as flow
from vehicle_models.amphibious import amphibious_vehicle as _base
_original = flow.FlowSolver.advance
def _watched(self, time, poses):
    if time > 0.012:
        os.kill(os.getpid(), signal.SIGINT)
    return _original(self, time, poses)
def car():
    flow.FlowSolver.advance = _watched
    return _base()
"""


@pytest.mark.usefixtures("interruptible")
def test_ctrl_c_saves_what_was_computed(tmp_path):
    (tmp_path / "car.py").write_text(INTERRUPTED)
    answer = subprocess.run(
        [sys.executable, "-m", "exumob", "captive", *SHORT, "--vehicle", "car.py", "--output", "run.nc"], cwd=tmp_path,
        capture_output=True, text=True, timeout=600, check=False,
        env=os.environ | {"COLUMNS": "200", "TERM": "dumb"},
    )  # fmt: skip
    assert answer.returncode == 130, answer.stderr
    assert "interrupted at" in answer.stderr
    assert "Traceback" not in answer.stderr
    run = load_dataset(tmp_path / "run.nc")
    assert 1 <= run.sizes["time"] <= 3
    assert np.isfinite(run["force"].values).all()
