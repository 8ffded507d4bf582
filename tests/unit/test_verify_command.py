"""The command `exumob verify`: choice of cases, tables, exit codes."""

import csv

import pytest
from typer.testing import CliRunner

from exumob.__main__ import app
from exumob.support.errors import SimulationError
from exumob.verification import Case, absolute, at_least, cases, relative, reported


def broken():
    raise SimulationError("the step failed")


SAMPLES = (
    Case("good", "Two that pass", lambda: [relative("period", 1.01, 1.0, 0.02, "s"), reported("kept", 0.9)], 0.1),
    Case("bad", "One that misses", lambda: [absolute("level | drift", 0.3, 0.0, 0.1, "m")], 0.1),
    Case("long", "Takes time", lambda: [at_least("order", 2.0, 1.8)], 9.0, slow=True),
    Case("broken", "Does not finish", broken, 9.0, slow=True),
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
    ],
)
def test_bad_input_exits_2(verify, arguments, words):
    result = verify(*arguments)
    assert result.exit_code == 2
    assert words in " ".join(result.output.split())
