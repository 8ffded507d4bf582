"""Every command of the command line, with any text as the value of its options."""

from __future__ import annotations

import contextlib
import re
import typing
from enum import StrEnum
from pathlib import Path
from typing import Any

import typer
from hypothesis import strategies as st
from typer.testing import CliRunner

from exumob.__main__ import COMMANDS, app

from .outcome import REMEDY, Outcome, outcome_of
from .targets import BEFORE_FLOW, BEFORE_RUNS, BEFORE_SWEEPS, Target, in_empty_folder, stops

NUMBERS = [
    "0", "1", "-1", "0.5", "2", "1e-3", "1e-9", "100", "1e9", "1e308", "1e400", "-1e400", "5e-324", "nan", "inf",
    "-inf", "1_0",
    "١", "0x10", "1,5", "1e", "--", "9" * 400, "0.0", "-0.0", "360", "90", "1e5", "1e-4",
]  # fmt: skip
TEXTS = [
    "", " ", "[", "[/red]", "[bold]x", "[link=http://x]", ":smile:", "äöü☃𝄞", "a\nb", "\x1b[31mred", "\t", "x" * 5000,
    "-x", "--help",
    "../x", "x.nc", "x.png", "x.gif", "none/x.nc", "/", "/dev/full", "/dev/null", ".", "..", "~", "*", "a=b", "a:b",
    "0:1", "1:0",
    "nan:nan", "0:inf", "0.4:0.6", "LETE sand", "lete sand", "auto", "cfd", "none", "fast", "True", "\u202e", "\udcff",
    "%s", "{0}", "$HOME",
    "water.current_speed=0,0.5", "water.depth=1:2:1e10", "water.depth=0.1:0.2:3", "soil=3", "soil=LETE sand",
    "hull.mass=nan",
    "soil.cohesion~normal(1300,200)", "soil.cohesion~normal()", "soil.cohesion~normal(1,2", "soil.n~uniform(2,1)",
    "x=1", "=", "~", "a=",
    "maneuver=straight", "duration=1e9", "duration=0.1", "hydrodynamics=coefficients", "vehicle=3", "sloshing",
    "paper-lstm",
]  # fmt: skip

BEGINNINGS = stops(
    "exumob.learning.training.ProcessPoolExecutor", "exumob.learning.onnx_export.export_onnx",
    "exumob.learning.envelope.envelope_of",
    "exumob.simulation.ensemble.simulate", "exumob.commands.verify.with_progress",
)  # fmt: skip
NAMED = re.compile(
    r"--[a-z][a-z-]*|\b[A-Za-z_.]+\.[a-z_]+\b|'[A-Z_]+(\.\.\.)?'|'[A-Z]+'|simulate|maneuver|parameter|checkpoint|"
    r"hydrodynamics|(vehicle|study) file"
)
"""How an error says what it speaks of: an option, a field, an argument of the command line"""
FORD = str(Path(__file__).parents[2] / "examples" / "ford.csv")
BASES = {
    "drive": [
        ["--duration", "0.1"],
        ["--depth", "0.1"],
        ["--slope", "5", "--level", "0.1"],
        ["--section", FORD, "--level", "100"],
        ["--depth", "0.1", "--hydrodynamics", "cfd"],
    ],
    "ford": [[FORD, "--level", "100"], [FORD, "--depth", "0.2"], [FORD], ["none.csv"]],
    "lane-change": [
        ["--duration", "0.1"],
        ["--depth-ratio", "0"],
        ["--hydrodynamics", "coefficients"],
        ["--hydrodynamics", "cfd"],
    ],
    "captive": [["--duration", "0.1"], ["--duration", "0.1", "--coarse", "--cell-size", "0.04"]],
    "sweep": [["--vary", "water.current_speed=0,0.5,1"], ["--vary", "soil.cohesion~normal(1300,200)"], []],
    "map": [["--draws", "1"], []],
    "learn": [["--plan"], ["--output", "learnt"], []],
    "train": [[]],
    "export": [["none.safetensors", "--output", "x.onnx"]],
    "soils": [[]],
    "parameters": [[], ["Soil", "wheel"], ["all"], ["--template", "car.py"]],
    "verify": [["--list"], ["sloshing"], ["none"]],
}
"""Arguments to begin with"""


@contextlib.contextmanager
def nothing_computed() -> Any:
    """No command gets further than its checks."""
    with BEFORE_RUNS(), BEFORE_FLOW(), BEFORE_SWEEPS(), BEGINNINGS():
        yield


@st.composite
def arguments(draw: Any, name: str) -> list[str]:
    """Arguments of a command."""
    options = typer.main.get_command(app).commands[name].params  # type: ignore[attr-defined]
    kinds = typing.get_type_hints(COMMANDS[name])
    given = list(draw(st.sampled_from(BASES[name])))
    for option in draw(st.lists(st.sampled_from(options), max_size=3)) if options else []:
        flag = next((text for text in option.opts if text.startswith("-")), None)
        value = draw(_values(kinds[option.name]))
        if flag is None:
            given.append(value)
        elif getattr(option, "is_flag", False):
            given.append(flag)
        else:
            given += [flag, value] if draw(st.integers(0, 9)) else [f"{flag}={value}"]
    if draw(st.integers(0, 19)) == 0:
        given.append(draw(st.sampled_from(["--unknown", "--", "-", "extra", "--help"])))
    return given


def _values(kind: Any) -> st.SearchStrategy[str]:
    anything = st.one_of(st.sampled_from(TEXTS), st.text(max_size=20))
    kinds = {kind, *typing.get_args(kind)}
    for one in kinds:
        if isinstance(one, type) and issubclass(one, StrEnum):
            return st.one_of(st.sampled_from([str(choice.value) for choice in one]), anything)
    if kinds & {float, int}:
        drawn = st.one_of(st.floats().map(repr), st.floats(0.0, 3.0).map(repr), st.integers(-5, 5000).map(str))
        return st.one_of(st.sampled_from(NUMBERS), drawn, anything)
    return st.one_of(anything, st.sampled_from(NUMBERS))


def command_target(name: str) -> Target:
    """A command with any arguments."""
    return Target(f"exumob {name}", arguments(name), lambda given: answer_of(name, given), group="commands")


def answer_of(name: str, given: list[str]) -> Outcome:
    """Call a command in this process, up to where it would compute."""
    said: list[Any] = []

    def call() -> Any:
        with in_empty_folder(), nothing_computed():
            found = CliRunner().invoke(app, [name, *given], env={"COLUMNS": "200", "TERM": "dumb"})
        said.append(found)
        if found.exception is not None and not isinstance(found.exception, SystemExit):
            raise found.exception
        return found

    outcome = outcome_of(call, ["\0"], verify=lambda found: _verify_answer(found, given), clear=())
    if outcome.kind == "accepted" and said:
        code, text = said[-1].exit_code, said[-1].output
        if code:
            return Outcome("clear", f"exit code {code}: {text[-300:]}")
    return outcome


class Unclear(Exception):
    """An answer that helps nobody."""


def _verify_answer(found: Any, given: list[str]) -> None:
    text = found.output
    if "Traceback" in text:
        raise Unclear(f"a traceback: {text[-400:]}")
    if found.exit_code == 0:
        return
    if found.exit_code not in (1, 2):
        raise Unclear(f"exit code {found.exit_code}")
    values = [part for text in given for part in (text, text.partition("=")[2]) if len(part.strip()) > 1]
    if not (NAMED.search(text) or any(value in text for value in values)):
        raise Unclear(f"names nothing: {text[-400:]}")
    if not (REMEDY.search(text) or "Try '" in text):
        raise Unclear(f"no remedy: {text[-400:]}")


def command_targets() -> list[Target]:
    """All commands."""
    commands = typer.main.get_command(app).commands  # type: ignore[attr-defined]
    return [command_target(name) for name in commands]
