"""Progress and exit codes of commands that make many runs."""

import pytest

from exumob.commands import shared
from exumob.commands.sweep import exit_code


def test_lines_take_the_place_of_a_bar(capsys):
    """One at the first word, one at every tenth, however often it is told."""
    with shared.counting_bar("sweep", 200, "cases") as (bar, task):
        for done in range(201):
            bar.update(task, completed=done)
            bar.update(task, completed=done)
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 11
    assert lines[0] == "sweep: 0 % (0 of 200 cases)" and lines[-1] == "sweep: 100 % (200 of 200 cases)"
    assert lines[5].startswith("sweep: 50 % (100 of 200 cases), about 0:00:0")


def test_lines_begin_anew_with_another_total(capsys):
    with shared.counting_bar("map", 1, "runs") as (bar, task):
        bar.update(task, description="level0", completed=0, total=2)
        bar.update(task, description="level0", completed=2, total=2)
        bar.update(task, description="level1", completed=0, total=4)
        bar.update(task, advance=4)
    lines = [line.split(",")[0] for line in capsys.readouterr().err.splitlines()]
    assert lines == [
        "level0: 0 % (0 of 2 runs)", "level0: 100 % (2 of 2 runs)",
        "level1: 0 % (0 of 4 runs)", "level1: 100 % (4 of 4 runs)",
    ]  # fmt: skip


def test_simulated_time_in_lines(capsys):
    with shared.simulated_time_bar(8.0, "settling", "driving", lead=2.0) as reached:
        for n in range(-200, 801):
            reached(n / 100)
    lines = capsys.readouterr().err.splitlines()
    assert (
        len(lines) == 11
        and lines[0] == "spin-up of the water: 0 % (-2.00 of 8 s)"
        and lines[-1] == "driving: 100 % (8.00 of 8 s)"
    )
    assert lines[1].startswith("spin-up of the water: 10 % (-1.00 of 8 s)")


@pytest.mark.parametrize("status, code", [
    (["completed"] * 3, 0), (["completed", "broke down"], 1), (["completed", "refused"], 1), (["broke down"] * 2, 1),
    (["out of time"], 1), (["killed"], 1), (["refused"] * 2, 2), (["failed", "refused"], 2), (["failed", "killed"], 1),
])  # fmt: skip
def test_exit_codes(status, code):
    assert exit_code(status) == code
