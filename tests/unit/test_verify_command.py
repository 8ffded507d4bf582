"""The command `exumob verify`: choice of cases, tables, exit codes."""

import csv
import math

import pytest
from matplotlib.figure import Figure
from typer.testing import CliRunner

from exumob.__main__ import app
from exumob.support.errors import SimulationError
from exumob.verification import Case, Check, absolute, at_least, cases, relative, reported, runs


def broken():
    raise SimulationError("the step failed")


def sized(cell_size=0.02, threads=1):
    return [reported("cell size", cell_size), reported("threads", threads)]


SAMPLES = (
    Case("good", "Two that pass", lambda: [relative("period", 1.01, 1.0, 0.02, "s"), reported("kept", 0.9)], 0.1),
    Case("bad", "One that misses", lambda: [absolute("level | drift", 0.3, 0.0, 0.1, "m")], 0.1),
    Case("long", "Takes time", lambda: [at_least("order", 2.0, 1.8)], 9.0, slow=True),
    Case("broken", "Does not finish", broken, 9.0, slow=True),
    Case("lost", "Reports no number", lambda: [reported("order", math.nan)], 9.0, slow=True),
    Case("sized", "Has options and a figure", sized, 9.0, slow=True, figure=lambda **options: Figure()),
)


@pytest.fixture
def verify(monkeypatch):
    monkeypatch.setattr(cases, "CASES", SAMPLES)
    return lambda *arguments: CliRunner().invoke(app, ["verify", *map(str, arguments)], env={"COLUMNS": "200"})


def test_passing_case_exits_0(verify):
    result = verify("good")
    assert result.exit_code == 0
    assert "period" in result.output
    assert "1 of 1 limits met, 1 numbers reported" in result.output


def test_missed_limit_exits_1(verify):
    result = verify()
    assert result.exit_code == 1
    assert "MISS" in result.output
    assert "1 of 2 limits met" in result.output


def test_slow_cases_run_when_named_or_asked_for(verify):
    assert "order" not in verify().output
    assert "order" in verify("long").output
    assert "order" in verify("--slow").output


def test_a_case_that_stops_does_not_stop_the_others(verify):
    result = verify("broken", "good")
    assert result.exit_code == 1
    assert "period" in result.output
    assert "the step failed" in result.output


def test_number_that_is_none_fails_with_or_without_a_limit(verify):
    assert not Check("order", math.nan, 1.0, math.nan, 0.1).passed
    assert not Check("order", 1.0, 1.0, 0.0, math.nan).passed
    assert not reported("order", math.nan).passed
    assert not at_least("order", math.nan, 1.8).passed
    assert reported("no reference", 2.0).passed
    result = verify("lost", "good")
    assert result.exit_code == 1
    assert "1 of 1 limits met, 2 numbers reported without one (1 of them not a number)" in result.output


def test_options_reach_the_case(verify, tmp_path):
    result = verify("sized", "--cell-size", 0.5, "--threads", 1, "--figure", tmp_path / "sized.png")
    assert result.exit_code == 0
    assert "0.5" in result.output and "threads" in result.output
    assert (tmp_path / "sized.png").exists()


def test_folder_of_runs_is_passed_on(verify, tmp_path, monkeypatch):
    monkeypatch.setenv(runs.FOLDER, "elsewhere")
    assert verify("good", "--runs", tmp_path).exit_code == 0
    assert runs.os.environ[runs.FOLDER] == str(tmp_path)


def test_kept_runs_are_those_of_these_sources(tmp_path, monkeypatch):
    """Any kernel counts, in whatever folder; what draws does not."""
    for name in ("flow/solver.py", "flow/pressure/multigrid.py", "flow/output/vtk.py", "towing_tank/motion.py"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("1")
    monkeypatch.setattr(runs, "PACKAGE", tmp_path)
    seen = [runs.flow_revision()]
    for name in ("flow/output/vtk.py", "flow/pressure/multigrid.py", "towing_tank/motion.py"):
        (tmp_path / name).write_text("2")
        seen.append(runs.flow_revision())
    assert seen[0] == seen[1]
    assert len(set(seen)) == 3


def test_list(verify):
    result = verify("--list")
    assert result.exit_code == 0
    assert all(case.name in result.output for case in SAMPLES)


def test_markdown_and_csv(verify, tmp_path):
    verify("good", "bad", "--output", tmp_path / "table.md")
    lines = (tmp_path / "table.md").read_text().splitlines()
    assert len(lines) == 5
    assert lines[2] == "| good | period | 1.01 | 1 | 0.01 | 0.02 | s | pass |"
    assert "level \\| drift" in lines[4]
    verify("good", "bad", "--output", tmp_path / "table.csv")
    with open(tmp_path / "table.csv") as file:
        rows = list(csv.DictReader(file))
    assert [row["result"] for row in rows] == ["pass", "reported", "MISS"]
    assert float(rows[0]["value"]) == 1.01


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("nothing",), "no case 'nothing'"),
        (("good", "--output", "table.txt"), "use .md or .csv"),
        (("good", "--output", "/nowhere/table.md"), "create it first"),
        (("good", "--cell-size", 0.1), "the case good has no option --cell-size; it has none"),
        (("sized", "--duration", 0.1), "no option --duration; it has --cell-size, --threads"),
        (("--threads", 2), "name the cases"),
        (("good", "--figure", "good.png"), "0 of the cases have a figure"),
    ],
)
def test_bad_input_exits_2(verify, arguments, words):
    result = verify(*arguments)
    assert result.exit_code == 2
    assert words in " ".join(result.output.split())
