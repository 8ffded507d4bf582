"""The command `exumob verify`: run the cases, show value, reference, error and limit."""

from __future__ import annotations

import itertools
import logging
import os
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich import box
from rich.progress import BarColumn, Progress, TimeElapsedColumn
from rich.table import Table
from rich.text import Text

from exumob.commands.options import option_names, refuse_without_effect
from exumob.commands.shared import check_targets, console, errors, fail, write_or_say
from exumob.commands.terminal import PlainColumn, log_handler
from exumob.support.cost import spelled_time
from exumob.support.declared import nearest_names
from exumob.support.files import require_writable
from exumob.support.quantities import DURATION

if TYPE_CHECKING:
    from exumob.verification.check import Case, Check


# Many arguments: each is an option of the command line.
def verify_command(
    names: Annotated[list[str] | None, typer.Argument(help="Cases to run, slow or not; all fast ones if none.")] = None,
    slow: Annotated[bool, typer.Option("--slow", help="Run the slow cases too.")] = False,
    list_only: Annotated[bool, typer.Option("--list", help="List the cases and their run times.")] = False,
    output: Annotated[Path | None, typer.Option(help="Write the table here (.md or .csv).")] = None,
    figure: Annotated[
        Path | None, typer.Option(help="Draw the case named here, if it has a figure (.png, .pdf, .svg).")
    ] = None,
    cell_size: Annotated[float | None, typer.Option(help="Cell size of the cases named [m].")] = None,
    duration: Annotated[float | None, typer.Option(help="Simulated time of the cases named [s].")] = None,
    interval: Annotated[float | None, typer.Option(help="Interval of the loads of the cases named [s].")] = None,
    threads: Annotated[int | None, typer.Option(help="Threads of the flow solver in the cases named.")] = None,
    coarse: Annotated[
        bool, typer.Option("--coarse", help="Accept cells too coarse for the vehicle: a quick look.")
    ] = False,
    runs: Annotated[
        Path | None,
        typer.Option(envvar="EXUMOB_RUNS", help="Folder where finished runs of the vehicle are kept and found again."),
    ] = None,
) -> None:
    """Verify the flow solver against exact, conserved and published quantities.

    Exit code 1 if a limit is missed. Limits were set for the default cell sizes and durations.

    Example: exumob verify sloshing still-water --output verification.md
    """
    from exumob.support.errors import SimulationError
    from exumob.verification.cases import CASES
    from exumob.verification.runs import FOLDER
    from exumob.verification.tables import write_table

    try:
        if list_only:
            refuse_without_effect(
                "with --list", "leave {it} out", "names", "slow", "output", "figure", "cell_size", "duration",
                "interval", "threads", "coarse",
            )  # fmt: skip
        if names:
            refuse_without_effect("where cases are named, which run slow or not", "leave {it} out", "slow")
    except ValueError as error:
        fail(error)
    if list_only:
        print_cases(CASES)
        return
    given = {"cell_size": cell_size, "duration": duration, "interval": interval, "threads": threads}
    options: dict[str, Any] = {name: value for name, value in given.items() if value is not None}
    options |= {"allow_coarse": True} if coarse else {}
    try:
        chosen = select(CASES, names or [], slow)
        check_values(options)
        check_options(chosen, bool(names), options, figure)
        check_targets({"--output": output, "--figure": figure}, (".md", ".csv"))
        if runs is not None:
            _make_folder(runs)
    except (ValueError, OSError) as error:
        fail(error)
    if runs is not None:
        os.environ[FOLDER] = str(runs)

    expected = {case.name: case.expected_minutes(options) for case in chosen}
    number, took = len(chosen), spelled_time(60.0 * sum(expected.values()))
    errors.print(f"{number} case{'s' if number > 1 else ''}, about {took} on an idle core, without compiling")
    found: list[tuple[str, Check]] = []
    broken: list[str] = []
    written = True
    for case in with_progress(chosen, expected):
        try:
            found += [(case.name, check) for check in case.run(**options)]
        except (SimulationError, ValueError, OSError) as error:
            broken.append(f"{case.name}: {error}")
        if output and written:  # a run cut short keeps what it found
            written = write_or_say("the table", output, partial(write_table, found, output))
    report(found, broken)
    if output and (written or write_or_say("the table", output, partial(write_table, found, output))):
        written = True
        console.print(f"table     {output}", soft_wrap=True)
    if figure and not broken:
        written &= draw(chosen, options, figure)
    missed = broken or not all(check.passed for _, check in found)
    raise typer.Exit(1 if missed else 0 if written else 2)


def select(cases: Sequence[Case], names: Sequence[str], slow: bool) -> list[Case]:
    """Return the cases of these names, or all; the slow ones only by name or if `slow`.

    Raises
    ------
    ValueError
        If a name is not known.
    """
    known = {case.name: case for case in cases}
    for name in names:
        if name not in known:
            near = nearest_names(name, list(known))
            hint = f"did you mean {' or '.join(near)}? " if near else ""
            raise ValueError(f"there is no case {name!r}; {hint}`exumob verify --list` gives all of them.")
    if names:
        return [case for case in cases if case.name in names]
    return [case for case in cases if slow or not case.slow]


def check_values(options: dict[str, Any]) -> None:
    """Refuse values of the options that no case can run with.

    Raises
    ------
    ValueError
        Naming the option, its value and the bound.
    """
    from exumob.verification.options import CELL_SIZE

    for name, quantity in (("cell_size", CELL_SIZE), ("duration", DURATION), ("interval", DURATION)):
        if name in options:
            quantity.check(f"--{name.replace('_', '-')}", options[name])
    if "threads" in options:
        from exumob.flow import FlowSettings

        with option_names():
            FlowSettings(threads=options["threads"])


def check_options(chosen: Sequence[Case], named: bool, options: dict[str, Any], figure: Path | None) -> None:
    """Refuse options before the run that the chosen cases do not have.

    Raises
    ------
    ValueError
        If no case is named, if one lacks an option, or if not exactly one of them has a figure where one is asked for.
    """
    if options and not named:
        flags = ", ".join(f"--{name.replace('_', '-')}" for name in options)
        raise ValueError(f"{flags}: name the cases that this is for (exumob verify --list).")
    for case in chosen:
        case.require_options(options)
    drawn = [case.name for case in chosen if case.figure is not None]
    if figure is not None and len(drawn) != 1:
        raise ValueError(f"--figure {figure}: {len(drawn)} of the cases have a figure; name one, as grid-convergence.")


def with_progress(chosen: Sequence[Case], expected: Mapping[str, float]) -> Iterator[Case]:
    """Yield the cases under a bar with the time left, by the minutes expected; what long runs log is shown above."""
    total = sum(expected.values())
    with Progress(
        PlainColumn("{task.description}"), BarColumn(), TimeElapsedColumn(), PlainColumn("{task.fields[left]}"),
        console=errors, transient=True,
    ) as bar, logged_to_terminal():  # fmt: skip
        begin, done = time.monotonic(), 0.0
        task = bar.add_task("", total=total, left=f"about {max(total, 0.1):.1f} min left")
        for case in chosen:
            bar.update(task, description=case.name)
            yield case
            done += expected[case.name]
            pace = (time.monotonic() - begin) / done  # [s] of wall time per minute foreseen
            bar.update(task, completed=done, left=f"about {pace * (total - done) / 60.0:.1f} min left")


@contextmanager
def logged_to_terminal() -> Iterator[None]:
    """Show how far the runs of the vehicle have got."""
    logger, handler = logging.getLogger("exumob.verification"), log_handler(errors, show_time=True)
    level = logger.level
    logger.addHandler(handler)
    logger.setLevel(logging.INFO)
    try:
        yield
    finally:
        logger.removeHandler(handler)
        logger.setLevel(level)


def print_cases(cases: Sequence[Case]) -> None:
    """Print questions, and under each the names, run times and subjects of its cases."""
    width = max(len(case.name) for case in cases)
    for question, group in itertools.groupby(cases, key=lambda case: case.question):
        console.print(f"\n{question}", style="bold")
        table = Table.grid(padding=(0, 2, 0, 0))
        for column in ({"width": width}, {"width": 6, "justify": "right"}, {"width": 4}, {}):
            table.add_column(**column)
        for case in group:
            table.add_row(case.name, spelled_time(60.0 * case.minutes), "slow" if case.slow else "", case.about)
        console.print(table)
    console.print("\nTimes are for one idle core and the default options. Slow cases run with --slow, or by name.")
    console.print("They leave out compiling the flow solver, which takes two to four minutes once.")


def report(found: Sequence[tuple[str, Check]], broken: Sequence[str]) -> None:
    """Print the table of checks, cases that stopped, and how many limits are met."""
    console.print(check_table(found))
    for line in broken:
        errors.print(line, style="red", soft_wrap=True)
    limited = [check for _, check in found if check.limited]
    plain = [check for _, check in found if not check.limited]
    words = f"{sum(c.passed for c in limited)} of {len(limited)} limits met, {len(plain)} numbers reported without one"
    if lost := sum(not check.passed for check in plain):
        words += f" ({lost} of them not a number)"
    console.print(words + (f", {len(broken)} cases stopped" if broken else ""), soft_wrap=True)


def check_table(found: Sequence[tuple[str, Check]]) -> Table:
    """Return the table for the terminal, one row a check, under the name of its case."""
    from exumob.verification.tables import COLUMNS, row

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, 1, 0, 0))
    table.add_column("check", overflow="fold")
    for heading in COLUMNS[2:6]:
        table.add_column(heading, justify="right", no_wrap=True)
    table.add_column("result", no_wrap=True)
    before = ""
    for case, check in found:
        if case != before:
            table.add_row(case, style="bold")
        _, name, *numbers, unit, result = row(case, check)
        colour = {"pass": "green", "MISS": "bold red", "reported": "dim"}[result]
        name = name if unit == "-" else f"{name} [{unit}]"
        table.add_row(f"  {name}", *numbers, Text(result, style=colour))
        before = case
    return table


def draw(chosen: Sequence[Case], options: dict[str, Any], file: Path) -> bool:
    """Draw the one case that has a figure, from the runs that it has made; return whether it was written."""
    from exumob.support.figures import save_figure

    (drawn,) = (case.figure for case in chosen if case.figure is not None)
    if not write_or_say("the figure", file, lambda: save_figure(drawn(**options), file)):
        return False
    console.print(f"figure    {file}", soft_wrap=True)
    return True


def _make_folder(folder: Path) -> None:
    """Make the folder of finished runs, or refuse it before anything runs."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        require_writable(folder / "run.nc")
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise ValueError(f"--runs {folder} cannot be made or written ({reason}); give another folder.") from None
