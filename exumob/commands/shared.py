"""Parts of all commands: consoles, errors, progress bars, checks of the files to write, writing them."""

from __future__ import annotations

import contextlib
import importlib
import os
import re
import shutil
import subprocess
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn, Protocol

import typer
from rich.progress import BarColumn, Progress, TaskID, TimeRemainingColumn

from exumob.commands.terminal import PlainColumn, PlainConsole
from exumob.support.files import (
    ANIMATIONS,
    CHECKPOINTS,
    FIGURES,
    NETCDF,
    atomic_write,
    require_ending,
    require_writable,
)

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

    from exumob.driving.maneuver import Maneuver
    from exumob.vehicle.parameters import Vehicle

console = PlainConsole()
ENDINGS = {
    "--output": NETCDF, "--figure": FIGURES, "--animate": ANIMATIONS, "--checkpoint": CHECKPOINTS, "--csv": (".csv",),
}  # fmt: skip
"""Endings of the files that options name; a file with another one is never written, or replaced."""
errors = PlainConsole(stderr=True)


class Bar(Protocol):
    """What shows progress: a bar of rich, or `ProgressLines`."""

    def update(
        self, task_id: TaskID, *, completed: float | None = None, advance: float | None = None,
        total: float | None = None, description: str | None = None,
    ) -> None:  # fmt: skip
        """Take how far it is."""


class ProgressLines:
    """Progress where no terminal is: a line at the first word of it, and one whenever another tenth is done.

    Parameters
    ----------
    description : str
    total : float
    amount : callable
        Takes what is completed and the total, returns both as text.
    """

    def __init__(self, description: str, total: float, amount: Callable[[float, float], str]) -> None:
        """Say nothing yet: bad input may still be found."""
        self.description, self.total, self.amount = description, total, amount
        self.completed = 0.0
        self._tenths = -1
        self._began: tuple[float, float] | None = None

    def update(
        self, task_id: TaskID, *, completed: float | None = None, advance: float | None = None,
        total: float | None = None, description: str | None = None,
    ) -> None:  # fmt: skip
        """Take how far it is, and say a line if another tenth is done."""
        self.description = self.description if description is None else description
        if total is not None and total != self.total:
            self.total, self.completed, self._tenths, self._began = total, 0.0, -1, None
        self.completed = (self.completed if completed is None else completed) + (advance or 0.0)
        if self._began is None:
            self._began = self.completed, time.monotonic()
        self._say()

    def _say(self) -> None:
        share = min(max(self.completed / self.total, 0.0), 1.0) if self.total > 0.0 else 1.0
        tenths = int(10.0 * share + 1e-9)
        if tenths <= self._tenths:
            return
        self._tenths = tenths
        text = f"{self.description}: {10 * tenths} % ({self.amount(self.completed, self.total)})"
        if self._began is not None and self._began[0] < self.completed < self.total:
            rate = (time.monotonic() - self._began[1]) / (self.completed - self._began[0])
            text += f", about {_clock(rate * (self.total - self.completed))} left"
        errors.print(text, soft_wrap=True)


def _clock(seconds: float) -> str:
    whole = round(seconds)
    return f"{whole // 3600}:{whole // 60 % 60:02d}:{whole % 60:02d}"


def _on_terminal() -> bool:
    return bool(errors.file.isatty())


@contextmanager
def simulated_time_bar(
    duration: float,
    before: str = "preparing",
    during: str = "towing",
    lead: float = 0.0,
    spinning_up: str = "spin-up of the water",
) -> Iterator[Callable[[float], None]]:
    """Bar with the time remaining; yields what takes the simulated time reached [s], from -lead on."""

    def name(time: float) -> str:
        return during if time > 0.0 else spinning_up

    if not _on_terminal():
        lines = ProgressLines(before, duration + lead, lambda done, _: f"{done - lead:.2f} of {duration:g} s")
        yield lambda time: lines.update(TaskID(0), completed=time + lead, description=name(time))
        return
    with Progress(
        PlainColumn("{task.description}"), BarColumn(), PlainColumn("{task.fields[now]:.2f} of {task.fields[end]:g} s"),
        TimeRemainingColumn(), console=errors, transient=True,
    ) as bar:  # fmt: skip
        task = bar.add_task(before, total=duration + lead, now=0.0 - lead, end=duration)

        def reached(time: float) -> None:
            bar.update(task, completed=time + lead, now=time, description=name(time))

        yield reached


@contextmanager
def counting_bar(description: str, total: int, unit: str) -> Iterator[tuple[Bar, TaskID]]:
    """Bar that counts what is finished, with the time remaining; lines where no terminal is."""
    if not _on_terminal():
        yield ProgressLines(description, total, lambda done, of: f"{done:g} of {of:g} {unit}"), TaskID(0)
        return
    with Progress(
        PlainColumn("{task.description}"), BarColumn(), PlainColumn(f"{{task.completed}} of {{task.total}} {unit}"),
        TimeRemainingColumn(), console=errors, transient=True,
    ) as bar:  # fmt: skip
        yield bar, bar.add_task(description, total=total)


def described_drive(vehicle: Vehicle, maneuver: Maneuver, duration: float) -> str:
    """Say who drives, for how long [s], and how fast the tyres turn at the end."""
    turning = float(maneuver.wheel_speed(duration)[0])
    return (
        f"{vehicle.name}, {duration:g} s; tyres at {turning * vehicle.wheel.radius:.3g} m/s ({turning:.3g} rad/s) at "
        "the end"
    )


def aspects(text: str, indent: int) -> str:
    """Return the line of trust with each of its sentences on a line of its own, below the first one."""
    return re.sub(r"(?<=[.;]) +(?=[A-Z])", "\n" + " " * indent, text)


def whatever_was_computed(run: Callable[[], xr.Dataset], output: Path | None) -> tuple[xr.Dataset, int]:
    """Result of a run, whole or up to where it broke or was stopped, and the exit code that says which."""
    from exumob.support.errors import SimulationError, SimulationInterrupted

    try:
        return run(), 0
    except (ValueError, OSError, ImportError) as error:
        fail(error)
    except SimulationError as error:
        if error.result is None:
            fail(error)
        errors.print(str(error), style="red", soft_wrap=True)
        errors.print("What was computed until then follows.")
        if output is not None and error.state is not None:
            target = output.with_suffix(".state.npz")
            state = error.state
            if write_or_say("the flow before the failed step", target, lambda: _keep_state(target, state)):
                errors.print(f"Flow before the failed step (FlowSolver.restore): {target}", soft_wrap=True)
        return error.result, 1
    except SimulationInterrupted as stop:
        errors.print(f"{stop}; what was computed until then follows.", style="yellow", soft_wrap=True)
        return stop.result, 130


def vehicle_of(file: Path | None) -> Vehicle:
    """Load the vehicle of a file; without a file, make the one of the paper."""
    from exumob.vehicle.vehicle_file import load_vehicle

    if file is not None:
        return load_vehicle(file)
    paper: Vehicle = importlib.import_module("vehicle_models.amphibious").amphibious_vehicle()
    return paper


def fail(error: Exception) -> NoReturn:
    """Say the error and leave with exit code 2."""
    text = str(error)
    if isinstance(error, OSError) and error.strerror:  # of the system, not ours
        place = "a file" if error.filename is None else error.filename
        text = f"{place} cannot be read or written ({error.strerror}); make room, or give another place."
    errors.print(text, style="red", soft_wrap=True)
    raise typer.Exit(2)


def write_or_say(what: str, file: Path, write: Callable[[], object]) -> bool:
    """Write a file after the computing; if that fails, say why and let all else be written that was computed.

    Parameters
    ----------
    what : str
        What the file holds, for the message.
    file : Path
    write : callable
        Writes it.

    Returns
    -------
    bool
        Whether it was written; if not, the command ends with exit code 2.
    """
    try:
        write()
    except (OSError, ValueError, MemoryError, subprocess.SubprocessError) as error:
        reason = (os.strerror(error.errno) if isinstance(error, OSError) and error.errno else str(error)) or "no memory"
        remedy = "" if isinstance(error, ValueError) else "; make room, or give another place"
        errors.print(f"{file}: {what} could not be written ({reason}){remedy}.", style="red", soft_wrap=True)
        return False
    return True


def _keep_state(file: Path, state: dict[str, Any]) -> None:
    import numpy as np

    with atomic_write(file) as temporary, temporary.open("wb") as stream:
        np.savez(stream, **state)


def check_targets(targets: dict[str, Path | None], endings: Sequence[str] = NETCDF) -> None:
    """Find out before the run that a file cannot be written after it.

    Parameters
    ----------
    targets : dict of str to path or None
        Files by option.
    endings : sequence of str
        Endings that ``--output`` may have.

    Raises
    ------
    ValueError
        If a file cannot be written (`exumob.support.files.require_writable`), its ending does not fit what will be in
        it, or the program that an animation needs is missing. A file that exists is replaced when the run has ended,
        which is said.
    """
    for option, path in targets.items():
        if path is None:
            continue
        try:
            require_writable(path)
        except ValueError as error:
            raise ValueError(f"{option} {error}") from None
        require_ending(option, path, endings if option == "--output" else ENDINGS[option])
        if path.suffix == ".mp4" and shutil.which("ffmpeg") is None:
            raise ValueError(f"{option} {path}: MP4 needs the program ffmpeg, which is not installed; use .gif.")
    if there := [str(path) for path in targets.values() if path is not None and path.exists()]:
        are = " and are" if len(there) > 1 else "s and is"
        errors.print(f"{', '.join(there)} exist{are} replaced at the end", style="yellow", soft_wrap=True)


def write_result(
    result: xr.Dataset, targets: dict[str, Path | None], plot: Callable[[xr.Dataset], Figure],
    animate: Callable[[xr.Dataset, Path], None],
) -> bool:  # fmt: skip
    """Write the result, and draw it where that was asked for; return whether all was written."""
    from exumob.simulation.result_files import save_dataset

    output, figure, animation = (targets[option] for option in ("--output", "--figure", "--animate"))
    written = True
    if output:

        def save() -> None:
            console.print(f"result    {save_dataset(result, output)}", soft_wrap=True)

        written &= write_or_say("the result", output, save)
    if not (figure or animation):
        return written
    if result.sizes["time"] < 3:
        errors.print("too little was computed to draw it", style="yellow")
        return written
    import matplotlib

    matplotlib.use("Agg")
    from exumob.support.figures import save_figure

    if figure:
        if drawn := write_or_say("the figure", figure, lambda: save_figure(plot(result), figure)):
            console.print(f"figure    {figure}", soft_wrap=True)
        written &= drawn
    if animation:
        with errors.status("drawing the animation"):
            drawn = write_or_say("the animation", animation, lambda: animate(result, animation))
        if drawn:
            console.print(f"animation {animation}", soft_wrap=True)
        else:
            with contextlib.suppress(OSError):
                animation.unlink(missing_ok=True)  # a part of it
        written &= drawn
    return written
