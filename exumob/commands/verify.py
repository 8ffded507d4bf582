"""The command `exumob verify`: run the cases, show value, reference, error and limit."""

from __future__ import annotations

import csv
import io
import math
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich import box
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

if TYPE_CHECKING:
    from exumob.verification import Case, Check

console = Console()
errors = Console(stderr=True)

HEADINGS = ("case", "check", "value", "reference", "error", "limit", "unit", "result")


def verify_command(
    names: Annotated[list[str] | None, typer.Argument(help="Cases to run, slow or not; all fast ones if none.")] = None,
    slow: Annotated[bool, typer.Option("--slow", help="Run the slow cases too.")] = False,
    list_only: Annotated[bool, typer.Option("--list", help="List the cases and their run times.")] = False,
    output: Annotated[Path | None, typer.Option(help="Write the table here (.md or .csv).")] = None,
) -> None:
    """Verify the flow solver against exact, conserved and published quantities.

    Exit code 1 if a limit is missed. Example: exumob verify sloshing still-water --output verification.md
    """
    from exumob.support.errors import SimulationError
    from exumob.verification.cases import CASES

    if list_only:
        console.print(case_table(CASES))
        return
    try:
        chosen = select(CASES, names or [], slow)
        check_target(output)
    except ValueError as error:
        errors.print(f"[red]{error}[/red]", highlight=False, soft_wrap=True)
        raise typer.Exit(2) from None

    found: list[tuple[str, Check]] = []
    broken: list[str] = []
    total = sum(case.minutes for case in chosen)
    with Progress(
        TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn(), TextColumn("{task.fields[left]}"),
        console=errors, transient=True,
    ) as bar:  # fmt: skip
        begin, done = time.monotonic(), 0.0
        task = bar.add_task("", total=total, left=f"about {max(total, 0.1):.1f} min left")
        for case in chosen:
            bar.update(task, description=case.name)
            try:
                found += [(case.name, check) for check in case.run()]
            except (SimulationError, ValueError) as error:
                broken.append(f"{case.name}: {error}")
            if output:  # a run cut short keeps what it found
                write_table(found, output)
            done += case.minutes
            pace = (time.monotonic() - begin) / done  # [s] of wall time per minute foreseen
            bar.update(task, completed=done, left=f"about {pace * (total - done) / 60.0:.1f} min left")
    console.print(check_table(found))
    for line in broken:
        errors.print(f"[red]{line}[/red]", highlight=False, soft_wrap=True)
    missed = sum(not check.passed for _, check in found)
    limited = sum(math.isfinite(check.limit) for _, check in found)
    console.print(
        f"{limited - missed} of {limited} limits met, {len(found) - limited} numbers reported without one"
        + (f", {len(broken)} cases stopped" if broken else ""),
        highlight=False,
    )
    if output:
        console.print(f"table     {output}", highlight=False)
    raise typer.Exit(1 if missed or broken else 0)


def select(cases: Sequence[Case], names: Sequence[str], slow: bool) -> list[Case]:
    """Cases of these names, or all; the slow ones only by name or if `slow`.

    Raises
    ------
    ValueError
        If a name is not known.
    """
    known = {case.name: case for case in cases}
    for name in names:
        if name not in known:
            raise ValueError(f"there is no case {name!r}; choose of {', '.join(known)} (exumob verify --list).")
    if names:
        return [case for case in cases if case.name in names]
    return [case for case in cases if slow or not case.slow]


def check_target(output: Path | None) -> None:
    """Find out before the run that the table cannot be written.

    Raises
    ------
    ValueError
        If the ending is neither .md nor .csv or the folder does not exist.
    """
    if output is None:
        return
    if output.suffix not in (".md", ".csv"):
        raise ValueError(f"--output {output}: the ending {output.suffix!r} is not known; use .md or .csv.")
    if not output.parent.is_dir():
        raise ValueError(f"--output {output}: the folder {output.parent} does not exist; create it first.")
    if output.is_dir():
        raise ValueError(f"--output {output}: this is a folder; give a file name.")


def case_table(cases: Sequence[Case]) -> Table:
    """Names, run times and subjects."""
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, 1, 0, 0))
    table.add_column("case", no_wrap=True)
    table.add_column("minutes", justify="right")
    table.add_column("slow")
    table.add_column("about")
    for case in cases:
        table.add_row(case.name, f"{case.minutes:g}", "slow" if case.slow else "", case.about)
    return table


def check_table(found: Sequence[tuple[str, Check]]) -> Table:
    """Table of the terminal, one row a check, under the name of its case."""
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, 1, 0, 0))
    table.add_column("check", overflow="fold")
    for heading in HEADINGS[2:6]:
        table.add_column(heading, justify="right", no_wrap=True)
    table.add_column("result", no_wrap=True)
    before = ""
    for case, check in found:
        if case != before:
            table.add_row(f"[bold]{case}[/bold]")
        _, name, *numbers, unit, result = row(case, check)
        colour = {"pass": "green", "MISS": "bold red", "reported": "dim"}[result]
        name = name if unit == "-" else f"{name} \\[{unit}]"
        table.add_row(f"  {name}", *numbers, f"[{colour}]{result}[/{colour}]")
        before = case
    return table


def row(case: str, check: Check) -> tuple[str, ...]:
    """A check as text, in the order of `HEADINGS`."""
    limited = math.isfinite(check.limit)
    result = ("pass" if check.passed else "MISS") if limited else "reported"
    numbers = (check.value, check.reference, check.error, check.limit)
    return case, check.name, *(f"{n:.4g}" if math.isfinite(n) else "" for n in numbers), check.unit, result


def write_table(found: Sequence[tuple[str, Check]], output: Path) -> None:
    """Write the table as the file's ending says."""
    output.write_text(as_csv(found) if output.suffix == ".csv" else as_markdown(found), encoding="utf-8")


def as_markdown(found: Sequence[tuple[str, Check]]) -> str:
    """The table in Markdown."""
    lines = [HEADINGS, ("---", "---", "---:", "---:", "---:", "---:", "---", "---"), *(row(*each) for each in found)]
    return "".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |\n" for line in lines)


def as_csv(found: Sequence[tuple[str, Check]]) -> str:
    """The table as comma-separated values with all digits."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(HEADINGS)
    for case, check in found:
        numbers = (check.value, check.reference, check.error, check.limit)
        writer.writerow((case, check.name, *map(repr, numbers), check.unit, row(case, check)[-1]))
    return text.getvalue()
