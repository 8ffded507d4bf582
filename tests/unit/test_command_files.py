"""Files that commands cannot write: refused before the run, or said after it, with all else kept that was computed."""

import errno
import os
import re
from pathlib import Path

import matplotlib.pyplot as plt
import pytest
import typer
from made_up_runs import made_up_run
from typer.testing import CliRunner

from exumob.__main__ import app
from exumob.commands import shared
from exumob.commands.report import report_run
from exumob.support import files
from exumob.support.errors import SimulationError
from exumob.support.figures import save_figure

FULL = OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def call(*arguments):
    return CliRunner().invoke(app, [str(a) for a in arguments], env={"COLUMNS": "250", "TERM": "dumb"})


def full(*_, **__):
    raise FULL


@pytest.mark.parametrize("command, option, suffix", [
    (["lane-change"], "--output", ".nc"), (["lane-change"], "--figure", ".png"), (["captive"], "--animate", ".gif"),
    (["map"], "--csv", ".csv"), (["map"], "--figure", ".pdf"), (["verify", "sloshing"], "--output", ".md"),
    (["export", "n.safetensors"], "--output", ".onnx"),
])  # fmt: skip
def test_places_that_cannot_be_written_are_refused_before_the_run(command, option, suffix, tmp_path, monkeypatch):
    """One probe for all: whatever is wrong with the place, option, file and remedy are named."""
    monkeypatch.chdir(tmp_path)
    Path("file").write_text("kept")
    Path("folder" + suffix).mkdir()
    Path("circle" + suffix).symlink_to("circle" + suffix)
    device = Path("device" + suffix)
    device.symlink_to("/dev/full")
    for place in (f"absent/x{suffix}", f"file/x{suffix}", "folder" + suffix, "y" * 300 + suffix, "circle" + suffix,
                  str(device), ""):  # fmt: skip
        answer = call(*command, option, place)
        text = " ".join(answer.output.split())
        assert answer.exit_code == 2, text
        assert re.search(rf"{option}.*(cannot be written|is empty).*(give|create)", text), text
        assert place in text
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(
        ["file", "folder" + suffix, "circle" + suffix, "device" + suffix]
    )


def test_every_file_of_a_run_is_tried_though_others_cannot_be_written(short_run, tmp_path, monkeypatch, capsys):
    targets = {f"--{name}": tmp_path / f"run{end}" for name, end in
               (("output", ".nc"), ("figure", ".png"), ("animate", ".gif"))}  # fmt: skip
    monkeypatch.setattr("exumob.simulation.plotting.plot_run", lambda run: plt.figure())
    monkeypatch.setattr("exumob.support.figures.atomic_write", full)
    monkeypatch.setattr("exumob.simulation.animation.animate_run", full)
    assert not report_run(short_run, targets)
    said = " ".join(capsys.readouterr().err.split())
    for name, what in (("run.png", "the figure"), ("run.gif", "the animation")):
        assert re.search(rf"{name}: {what} could not be written \(No space left on device\); make room", said), said
    assert [path.name for path in tmp_path.iterdir()] == ["run.nc"]
    monkeypatch.setattr("exumob.simulation.result_files.save_dataset", full)
    assert not report_run(short_run, targets | {"--figure": None, "--animate": None})
    assert "run.nc: the result could not be written" in " ".join(capsys.readouterr().err.split())


@pytest.mark.parametrize("error", [
    OSError(errno.ENOSPC, "No space left on device"), PermissionError(errno.EACCES, "Permission denied"),
    FileNotFoundError(errno.ENOENT, "gone", "x"), OSError("of a library"), MemoryError(), ValueError("too many frames"),
])  # fmt: skip
def test_whatever_stops_a_file_is_said(error, tmp_path, capsys):
    def write():
        raise error

    assert not shared.write_or_say("the table", tmp_path / "t.csv", write)
    said = " ".join(capsys.readouterr().err.split())
    assert "t.csv: the table could not be written (" in said and "()" not in said


def test_a_state_that_cannot_be_kept_costs_no_result(short_run, tmp_path, monkeypatch, capsys):
    def run():
        error = SimulationError("broke down")
        error.result, error.state = short_run, {"volume": short_run["time"].values}
        raise error

    assert shared.whatever_was_computed(run, tmp_path / "a.nc") == (short_run, 1)
    assert [path.name for path in tmp_path.iterdir()] == ["a.state.npz"]
    monkeypatch.setattr(shared, "atomic_write", full)
    assert shared.whatever_was_computed(run, tmp_path / "b.nc") == (short_run, 1)
    assert "b.state.npz: the flow before the failed step could not be written" in " ".join(
        capsys.readouterr().err.split()
    )
    assert [path.name for path in tmp_path.iterdir()] == ["a.state.npz"]


def test_a_figure_is_written_whole_or_not_at_all(tmp_path):
    for ending in (".png", ".pdf", ".svg"):
        file = tmp_path / f"f{ending}"
        assert save_figure(plt.figure(), file) == file and file.stat().st_size > 100
    before = file.read_bytes()
    figure = plt.figure()
    figure.savefig = full
    with pytest.raises(OSError):
        save_figure(figure, file)
    assert file.read_bytes() == before and not plt.get_fignums()
    assert len(list(tmp_path.iterdir())) == 3


@pytest.mark.parametrize("ending", [".md", ".csv"])
def test_a_table_that_cannot_be_written_does_not_stop_the_cases(ending, tmp_path, monkeypatch):
    from exumob.verification import cases, tables
    from exumob.verification.check import Case, absolute

    made = []

    def case(name):
        return Case(name, "about", lambda: made.append(name) or [absolute("x", 1.0, 1.0, 0.1)], 0.1)

    monkeypatch.setattr(cases, "CASES", (case("one"), case("two")))
    monkeypatch.setattr(tables, "write_text", full)
    answer = call("verify", "--output", tmp_path / f"t{ending}")
    assert answer.exit_code == 2, answer.output
    assert made == ["one", "two"] and "2 of 2 limits met" in answer.output
    assert "the table could not be written (No space left on device)" in " ".join(answer.output.split())


@pytest.mark.parametrize("error", [FULL, PermissionError(13, "Permission denied", "place"), OSError("of a library")])
def test_errors_of_the_system_that_nothing_else_catches_are_no_tracebacks(error, monkeypatch):
    def table():
        raise error

    monkeypatch.setattr("exumob.ground.soil.Soil.published_table", table)
    answer = call("soils")
    assert answer.exit_code == 2 and isinstance(answer.exception, SystemExit)
    assert answer.output.strip()


def test_texts_are_written_whole_or_not_at_all(tmp_path, monkeypatch):
    files.write_text(tmp_path / "t.csv", "ä,b\n")
    assert (tmp_path / "t.csv").read_bytes() == "ä,b\n".encode()
    monkeypatch.setattr(Path, "write_text", full)
    with pytest.raises(OSError, match="No space"):
        files.write_text(tmp_path / "t.csv", "new")
    assert [path.read_text("utf-8") for path in tmp_path.iterdir()] == ["ä,b\n"]


@pytest.mark.parametrize("options, code", [
    (["--current-direction", "1000"], "--current-direction 1000 must be -360 to 360 degrees"),
    (["--current-direction", "nan", "--unusual"], "--current-direction nan"),
    (["--current", "0:50"], "plausible"), (["--depth", "0.001:0.5"], "plausible"),
    (["--current", "0:500", "--unusual"], "must be"),
])  # fmt: skip
def test_maps_refuse_angles_in_degrees_and_take_unusual_values(options, code, tmp_path):
    answer = call("map", "--output", tmp_path / "map", "--draws", "1", "--hydrodynamics", "coefficients", *options)
    assert answer.exit_code == 2 and code in " ".join(answer.output.split()), answer.output
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("option", [["--current", "0:50"], ["--depth", "0.001:0.5"], ["--current-direction", "1000"]])
def test_unusual_maps_get_as_far_as_their_runs(option, tmp_path, monkeypatch):
    seen = []

    def compute(wanted, *_, **__):
        seen.append(wanted)
        raise KeyboardInterrupt

    monkeypatch.setattr("exumob.mobility.map.compute_map", compute)
    answer = call("map", "--output", tmp_path / "map", "--hydrodynamics", "coefficients", "--unusual", *option)
    assert answer.exit_code == 130 and len(seen) == 1, answer.output


def test_every_command_with_a_current_takes_unusual_values():
    for name, command in typer.main.get_command(app).commands.items():
        options = {option for parameter in command.params for option in parameter.opts}
        if "--current" in options:
            assert "--unusual" in options and options & {"--current-direction", "--directions"}, name


@pytest.mark.parametrize(
    ("option", "reached"),
    [
        (("--current", "0:16"), "7 waters"),
        (("--depth", "0.005:0.5"), "7 waters"),
        (("--cell-size", "1.5"), "makes 1.0 cells along z"),
    ],
)
def test_unusual_ranges_to_learn_get_as_far_as_their_grid_and_drives(option, reached, monkeypatch):
    def drives(vehicle, waters, progress=None):
        raise ValueError(f"{len(waters)} waters")

    monkeypatch.setattr("exumob.learning.envelope.envelope_of", drives)
    answer = call("learn", "--plan", "--unusual", *option)
    assert answer.exit_code == 2 and reached in answer.output, answer.output
    answer = call("learn", "--plan", *option)
    assert answer.exit_code == 2 and option[0] in answer.output and "outside the plausible range" in answer.output


@pytest.mark.parametrize("fails, code, tried", [(False, 0, 2), (True, 2, 1)])
def test_fields_that_cannot_be_written_do_not_cost_the_run(fails, code, tried, tmp_path, monkeypatch):
    from exumob.flow.output.vtk import VtkSeries

    seen = []

    def add(self, *instant):
        seen.append(instant)
        if fails:
            raise FULL

    def run(*_, on_snapshot, **__):
        on_snapshot(1, 2)
        on_snapshot(3, 4)
        return "result"

    monkeypatch.setattr(VtkSeries, "add", add)
    monkeypatch.setattr("exumob.towing_tank.run.captive_run", run)
    monkeypatch.setattr("exumob.commands.captive._report", lambda result, targets: result == "result")
    answer = call("captive", "--vtk", tmp_path / "fields", "--coarse", "--cell-size", "0.04")
    assert answer.exit_code == code and len(seen) == tried, answer.output
    assert fails == ("fields: further fields could not be written (No space" in " ".join(answer.output.split()))


def test_training_is_refused_before_its_cost_is_said(tmp_path, monkeypatch, caplog):
    """Runs of a vehicle of another size; and nothing is made."""
    pytest.importorskip("torch")
    runs = {name: made_up_run(1.5, end=0.1) for name in "ab"}
    monkeypatch.setattr("exumob.learning.training.check_run", lambda run, name: None)
    monkeypatch.setattr("exumob.learning.examples.training_runs", lambda folder: runs)
    answer = call("train", "--output", tmp_path / "new", "--preset", "paper-lstm", "--seeds", "1000")
    assert answer.exit_code == 2 and "Networks learn from runs of their own vehicle" in " ".join(answer.output.split())
    assert "training of" not in answer.output + caplog.text
    assert list(tmp_path.iterdir()) == []
