"""The command `exumob captive` before anything runs: help, bad input."""

import re

import pytest
from typer.testing import CliRunner

from exumob.__main__ import app

SHORT = ["--cell-size", "0.05", "--coarse", "--interval", "5e-3", "--duration", "0.02"]
OPTIONS = {
    "--speed": "1.0", "--current": "1.0", "--depth": "0.12", "--drift-angle": "0", "--yaw-rate": "0",
    "--wheel-speed": "0", "--steering": "0", "--cell-size": "0.018", "--duration": "3", "--threads": "1",
    "--closure": "smagorinsky", "--surface": "thinc",
    "--ramp-time": "1.0", "--vehicle": None, "--output": None, "--figure": None, "--animate": None, "--vtk": None,
}  # fmt: skip


def call(*arguments):
    return CliRunner().invoke(app, ["captive", *map(str, arguments)], env={"COLUMNS": "250", "TERM": "dumb"})


def plain(text):
    """Without colours and line breaks."""
    return " ".join(re.sub(r"\x1b\[[0-9;]*m", "", text).split())


def test_help_explains_every_option_with_its_default():
    answer = call("--help")
    assert answer.exit_code == 0
    text = " " + plain(answer.output.split("Run:")[1])
    for option, default in OPTIONS.items():
        after = text[text.index(f" {option} ") :].split(" --")[1]
        assert len(after.split()) > 4, f"{option} is not explained"
        if default:
            assert f"default: {default}" in after


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--speed", "nan"], r"^--speed = nan"),
        (["--depth", "-1"], r"^--depth = -1"),
        (["--threads", "0"], r"^--threads = 0"),
        (["--cell-size", "0"], r"--cell-size = 0"),
        (["--cell-size", "1e-4"], r"--cell-size = 0\.0001 m makes .* cells.*GiB of memory.*cells of .* m would fit"),
        (["--cell-size", "18"], r"--cell-size = 18.*is it in mm\? Then give 0\.018 m"),
        (["--ramp-time", "5e-324"], r"^--ramp-time = 5e-324"),
        (["--interval", "0"], r"--interval = 0\.0 s"),
        (["--current", "-1"], r"^--current = -1.*--current-direction"),
        (["--drift-angle", "400"], r"^--drift-angle 400 must be -180 to 180 degrees"),
        (["--duration", "1e6"], r"--duration = 1e\+06 s .*GiB of memory"),
        (["--closure", "mule"], r"'mule' is not one of 'smagorinsky', 'k-omega-sst', 'none'"),
        (["--surface", "mule"], r"'mule' is not one of 'thinc', 'plic'"),
        (["--steering", "50", "--ramp-time", "0.01"], r"50\.0 deg, beyond the 35\.0 deg"),
        (["--duration", "0.021"], r"--duration = 0\.021 s must be a whole multiple of --interval = 0\.005 s"),
        (["--vehicle", "absent.py"], r"absent\.py does not exist"),
        (["--output", "absent/run.nc"], r"--output absent/run\.nc.*does not exist"),
        (["--figure", "run.xyz"], r"run\.xyz.*use \.png, \.pdf or \.svg"),
        (["--animate", "run.avi"], r"\.avi.*use \.gif or \.mp4"),
        (["--vtk", "absent/fields"], r"absent does not exist; create it"),
        (["--vtk", "fields", "--depth", "0"], r"--depth = 0"),
    ],
    ids=lambda v: " ".join(v) if isinstance(v, list) else "",
)  # fmt: skip
def test_bad_input_is_said_with_exit_code_2(arguments, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    answer = call(*SHORT, *arguments)
    assert answer.exit_code == 2, answer.output
    assert re.search(message, plain(answer.output)), answer.output
    assert "Traceback" not in answer.output
    assert list(tmp_path.iterdir()) == []


def test_coarse_cells_are_refused_by_default():
    answer = call("--cell-size", "0.03", "--duration", "0.01")
    assert answer.exit_code == 2
    assert "use a cell size of 0.02 m or less" in plain(answer.output)
