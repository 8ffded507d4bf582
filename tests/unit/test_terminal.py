"""Texts of users, files and other programs reach the terminal as they are, and never act on it."""

import io
import logging
import re
from pathlib import Path

import pytest
from rich.progress import Progress
from rich.table import Table
from typer.testing import CliRunner

import exumob.commands
from exumob.__main__ import COMMANDS, app
from exumob.commands.shared import console, errors
from exumob.commands.terminal import PlainColumn, PlainConsole, log_handler, visible

AS_THEY_ARE = ["[/red]", "[bold]x[/bold]", "run[old].nc", "a:b", ":smile:", "\\[red]", "one\ntwo", "é±°", "x" * 5000]
ACTING = {
    "\x1b[2J": "\\x1b[2J", "\x1b]0;title\x07": "\\x1b]0;title\\x07", "a\rb": "a\\rb", "\x08": "\\x08",
    "\x9b31m": "\\x9b31m", "\u202egpj": "\\u202egpj", "\udcff": "\\udcff", "\x00": "\\x00", "\u2028": "\\u2028",
}  # fmt: skip
TEXTS = {text: text for text in AS_THEY_ARE} | ACTING


@pytest.mark.parametrize("text", TEXTS)
def test_texts_are_printed_as_they_are(text, monkeypatch):
    """Printed, in a table's cells and titles, in a progress bar and in the log."""
    wanted = TEXTS[text].replace("\n", "")
    for print_it in (
        lambda to: to.print(text, soft_wrap=True),
        lambda to: to.print(table_of(text), soft_wrap=True),
        lambda to: log(to, text),
        lambda to: bar(to, text),
    ):
        to = PlainConsole()
        to.file, to.width = io.StringIO(), 20_000
        print_it(to)
        found = to.file.getvalue()
        assert re.sub(r"\s*\n\s*", "", found).count(wanted) >= 1
        assert not set(found) & set("\x1b\r\x08\x07\x00\x9b\u202e\u2028")
    assert visible(visible(text)) == TEXTS[text]


def table_of(text):
    table = Table(title=text)
    table.add_column("a", no_wrap=True)
    table.add_row(text)
    return table


def log(to, text):
    handler = log_handler(to)
    handler.handle(logging.LogRecord("exumob", logging.WARNING, "", 0, "it says %s", (text,), None))


def bar(to, text):
    progress = Progress(PlainColumn("{task.description}"), console=to)
    progress.add_task(text, total=1)
    to.print(progress.get_renderable())


def test_there_is_no_other_way_to_the_terminal():
    """Nothing in the command line makes a console, a column of text or a handler of its own, or prints by itself."""
    assert isinstance(console, PlainConsole) and isinstance(errors, PlainConsole)
    for file in Path(exumob.commands.__file__).parent.glob("*.py"):
        if file.name != "terminal.py":
            text = file.read_text()
            assert not re.search(
                r"(?<!Plain)\bConsole\(|\bTextColumn\(|RichHandler\(|(?<![.\w])print\(|typer\.echo", text
            )


WRONG = {
    "drive": ["--soil-value"], "ford": ["--depth", "0.2"], "lane-change": ["--soil"], "captive": ["--figure"],
    "sweep": ["--vary"], "map": ["--current"],
    "train": ["--preset"], "learn": ["--plan", "--preset"], "export": ["--output", "run.onnx"],
    "parameters": [], "verify": [],
}  # fmt: skip
"""For each command, what stands before a text of the user that it refuses."""


def test_every_command_is_tried():
    assert set(WRONG) | {"soils"} == set(COMMANDS)  # soils takes no text


@pytest.mark.parametrize("command", WRONG)
@pytest.mark.parametrize("text", ["[/red]", "run[old].nc", "a:b", ":smile:", "\x1b[31mred", "two\nlines", "y" * 3000])
def test_every_command_says_the_text_that_it_refuses(command, text):
    answer = CliRunner().invoke(app, [command, *WRONG[command], text], env={"COLUMNS": "250"})
    assert answer.exit_code == 2, answer.output
    assert answer.exception is None or isinstance(answer.exception, SystemExit)
    found = answer.output.replace("\\n", "\n")
    assert text.replace("\x1b", "\\x1b") in found or text[:20] in found
    assert "\x1b[31m" not in found


@pytest.mark.parametrize("command", [["map", "--output"], ["sweep", "--vary", "water.current_speed=0,1", "--output"]])
def test_a_place_that_cannot_be_written_is_named(command, tmp_path):
    (tmp_path / "file").write_text("")
    answer = CliRunner().invoke(app, [*command, str(tmp_path / "file" / "out")], env={"COLUMNS": "250"})
    assert answer.exit_code == 2 and isinstance(answer.exception, SystemExit)
    assert "file" in answer.output and "Errno" not in answer.output
