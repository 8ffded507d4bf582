"""What the command line says of a run: the verdict first, in its colour; users' texts are never markup."""

import re

import numpy as np
import pytest
from rich.console import Console

from exumob.commands import report
from exumob.simulation.verdict import VERDICTS

TARGETS = {"--output": None, "--figure": None, "--animate": None}


@pytest.fixture
def printed(monkeypatch):
    """Run the report and return what a terminal would get, line by line, without the further aspects of trust."""
    console = Console(markup=False, highlight=False, force_terminal=True, color_system="standard", width=200)
    monkeypatch.setattr(report, "console", console)

    def call(run):
        with console.capture() as capture:
            report.report_run(run, TARGETS)
        lines = capture.get().splitlines()  # but for the sentences of trust and the parts of the error
        return [line for line in lines if not re.match(r"(\x1b\[\d+m)? {22}|  \w|parts of the error", line)]

    return call


GREEN, YELLOW, RED = "\x1b[32m", "\x1b[33m", "\x1b[31m"


@pytest.mark.parametrize(
    ("verdict", "colour"), [("drives", GREEN), ("stuck", YELLOW), ("swept away", RED), ("broke down", RED)]
)
def test_the_verdict_comes_first_in_its_colour(short_run, printed, verdict, colour):
    run = short_run.assign_attrs(
        trust_status="measured", verdict=verdict, verdict_sentence=f"{verdict} since 3.20 s [red]: [/x]"
    )
    first, _, second, *_ = printed(run)  # between them: how far the water model can be trusted
    assert first == f"{colour}verdict               {verdict} since 3.20 s [red]: [/x]\x1b[0m"
    assert second.startswith("run                   amphibious, D60/U1, coefficients; completed")


@pytest.mark.parametrize("status", ["beyond", "not validated"])
def test_good_news_is_green_only_where_runs_like_it_were_measured(short_run, printed, status):
    run = short_run.assign_attrs(trust_status=status, verdict="drives", verdict_sentence="drives at the end")
    assert printed(run)[0].startswith(f"{YELLOW}verdict")


def test_every_verdict_has_a_colour():
    assert {*report.DOUBTFUL, "drives"} <= set(VERDICTS)


def test_slip_without_contact_is_said(short_run, printed):
    aloft = short_run.assign(slip_ratio=short_run["slip_ratio"] * np.nan)
    assert "slip                  no contact with the soil (second half)" in printed(aloft)


def test_a_run_of_one_instant_has_a_verdict_and_no_figures(short_run, printed):
    lines = printed(short_run.isel(time=[0]))
    assert len(lines) == 2
    assert "too short to tell" in lines[0]
