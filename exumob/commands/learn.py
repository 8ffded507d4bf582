"""The command `exumob learn`."""

from __future__ import annotations

import math
import time
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from exumob.commands.options import (
    EXPERT,
    OUTPUT,
    RUN,
    WATER,
    UnusualValues,
    VehicleFile,
    Workers,
    option,
    option_names,
    span,
)
from exumob.commands.shared import console, counting_bar, errors, fail, simulated_time_bar, vehicle_of
from exumob.support.quantities import CELL_SIZE, Unusual, shown

if TYPE_CHECKING:
    from exumob.learning.campaign import LearningFolder, RunProgress
    from exumob.learning.plan import LearningPlan, LearningRange
    from exumob.towing_tank.excitation import Envelope
    from exumob.vehicle.parameters import Vehicle

MOST = 1000
"""Most seeds and workers."""


class Sides(StrEnum):
    """Where currents come from."""

    ahead = "ahead"
    along = "along"
    all = "all"


def learn_command(  # one argument an option of the command line
    vehicle: VehicleFile = None,
    depth: Annotated[str, option(WATER, "Smallest and largest depth over the tyre's diameter, from:to.")] = "0.2:0.9",
    current: Annotated[
        str,
        option(
            WATER,
            "Smallest and largest speed of the current, from:to [m/s], of a vehicle of the paper's size; scaled to "
            "this one by Froude's law.",
        ),
    ] = "0:1.5",
    directions: Annotated[
        Sides, option(WATER, "Where currents come from: ahead, ahead and behind (along), or all sides.")
    ] = Sides.all,
    budget: Annotated[
        float | None,
        option(
            RUN, "Time of a core for runs and training. Default: 12, or what the least runs take if that is more. [h]"
        ),
    ] = None,
    output: Annotated[
        Path | None,
        option(OUTPUT, "Folder for runs, networks and report card; with --plan it keeps what the plan is made from."),
    ] = None,
    plan: Annotated[bool, option(RUN, "Print the plan, and make no runs.", "--plan")] = False,
    jobs: Workers = 2,
    cell_size: Annotated[
        float | None,
        option(EXPERT, "Width of the flow solver's cells. Default: 0.09 of the tyre's diameter.", of=CELL_SIZE),
    ] = None,
    preset: Annotated[
        str | None,
        option(EXPERT, "What to train, by name (`exumob train`). Default: as full-range, which comes with exumob."),
    ] = None,
    seeds: Annotated[int, option(EXPERT, "Networks of each body; their spread is the error bar.")] = 5,
    run_time: Annotated[
        float | None,
        option(
            EXPERT, "Simulated time of a run that teaches. Default: by Froude's law, 8 s on a wheelbase of 0.714 m. [s]"
        ),
    ] = None,
    mpi: Annotated[
        bool, option(EXPERT, "Use the ranks of mpiexec -n 4 python -m mpi4py.futures -m exumob learn ...", "--mpi")
    ] = False,
    unusual: UnusualValues = False,
    mixed: Annotated[
        bool, option(EXPERT, "Learn from runs of several versions of the flow solver, too.", "--mixed")
    ] = False,
) -> None:
    """Teach networks the water's loads on a vehicle, and write what they are worth on a report card.

    Plans flow runs that a budget buys, makes them, trains, and tries the networks on runs kept apart. It can be stopped
    at any time: the same command goes on. A larger budget adds to what is there.

    Example: exumob learn --vehicle car.py --budget 12 --output car_networks --plan
    """
    from exumob.learning.envelope import keep_envelope
    from exumob.learning.plan import CELLS, LearningRange, make_plan, require_budget

    folder: LearningFolder | None = None
    try:
        for name, number in (("--seeds", seeds), ("--jobs", jobs)):
            if not 1 <= number <= MOST:
                raise ValueError(f"{name} {shown(number)} must be 1 to {MOST}; give a number within.")
        side_by_side = jobs
        if mpi and not plan:
            from exumob.learning.campaign import working_ranks

            side_by_side = working_ranks()
        if output is None and not plan:
            raise ValueError("--output is missing; give the folder for runs and networks, or --plan to see the plan.")
        from exumob.learning.presets import PRESETS, WHOLE_RANGE

        if preset is not None and preset not in PRESETS:
            raise ValueError(f"--preset {shown(preset)} is not known; use {', '.join(PRESETS)}.")
        car = vehicle_of(vehicle)
        with option_names():
            depths, currents = span("--depth", depth, unusual), span("--current", current, unusual)
            wanted = LearningRange(depths, currents, directions.value)
            wanted.currents(car)  # refused, by its own name, if it is implausible for this vehicle
            if cell_size is None:
                cell_size = CELLS * car.wheel.diameter
            size = CELL_SIZE.check("--cell-size", Unusual(cell_size) if unusual else cell_size)
            _check_numbers(budget, run_time)
        from exumob.learning.campaign import ABOUT, LearningFolder
        from exumob.support.files import require_possible_folder

        if output is not None:
            require_possible_folder("--output", output)
            if (output / ABOUT).is_file():
                LearningFolder(output).require_free(car, size)
        if not plan:
            from exumob.learning.learn import learn_from  # noqa: F401  (without torch this is said before anything runs)

            assert output is not None
            folder = LearningFolder(output)
            folder.claim(car, size)
            folder.load(mixed, car)  # what others have put there is refused before anything is computed
        with option_names():
            require_budget(car, wanted, budget, size, run_time=run_time)
        envelope = _envelope(car, wanted, Path() if output is None else output)
        if output is not None:
            output.mkdir(parents=True, exist_ok=True)
            keep_envelope(envelope, car, wanted, output)
        with option_names():
            chosen = PRESETS[WHOLE_RANGE if preset is None else preset]
            made = make_plan(car, wanted, budget, size, envelope, seeds=seeds, preset=chosen, run_time=run_time)
        for line in made.lines(side_by_side):
            console.print(line, soft_wrap=True)
        if folder is None:
            return
    except (ValueError, OSError) as error:
        fail(error)
    except ImportError as error:
        fail(ImportError(f"{error}; training needs torch: pip install 'exumob[train]'"))
    try:
        failed = _make_runs(made, folder, jobs, mpi)
        _train(made, folder, jobs, mixed, failed)
    except (ValueError, RuntimeError, OSError) as error:
        fail(error)
    except KeyboardInterrupt:
        errors.print(f"Stopped; the same command goes on with {folder.path}.", soft_wrap=True)
        raise typer.Exit(130) from None
    raise typer.Exit(1 if failed else 0)


def _check_numbers(budget: float | None, run_time: float | None) -> None:
    """Refuse a budget or a time of which no plan can be made."""
    from exumob.learning.plan import BUDGET
    from exumob.support.quantities import DURATION

    if budget is not None:
        BUDGET.check("--budget", budget)
    if run_time is not None:
        DURATION.check("--run-time", run_time)


def _envelope(car: Vehicle, wanted: LearningRange, folder: Path) -> Envelope:
    """Find the ranges of the motion, by cheap drives if they are not known yet."""
    from exumob.learning.envelope import stored_envelope

    with counting_bar("drives with coefficients, for the ranges of the motion", 1, "drives") as (bar, task):
        return stored_envelope(car, wanted, folder, lambda done, of: bar.update(task, completed=done, total=of))


def _make_runs(made: LearningPlan, folder: LearningFolder, jobs: int, mpi: bool) -> dict[str, str]:
    """Make the runs that are missing; say what broke down."""
    from exumob.flow.forces import pressure_loads
    from exumob.learning.campaign import run_campaign
    from exumob.support.compiled import say_compilation
    from exumob.support.cost import spelled_time

    missing = folder.unfinished(made.tasks)
    if there := len(made.tasks) - len(missing):
        console.print(f"{there} of {len(made.tasks)} runs are there already")
    if not missing:
        return {}
    if begun := sum(folder.is_begun(task) for task in missing):
        console.print(f"{begun} of {len(missing)} missing runs {'has' if begun == 1 else 'have'} begun and will go on")
    total = sum(task.duration for task in missing)
    reached = {task.name: 0.0 for task in missing}
    planned = {task.name: task.cost.seconds for task in missing}
    began, ended = {name: math.nan for name in planned}, 0
    say_compilation("the flow solver", pressure_loads, "about four minutes in each worker")
    with simulated_time_bar(
        total, "preparing", "flow runs", spinning_up="flow runs, the water spins up first"
    ) as advance:

        def progress(step: RunProgress) -> None:
            nonlocal ended
            if math.isnan(began[step.name]):
                began[step.name] = time.monotonic()
            reached[step.name] = max(step.time, 0.0)
            advance(min(sum(reached.values()), total))
            if step.done:
                ended, took = ended + 1, time.monotonic() - began[step.name]
                how = step.error or f"finished after {spelled_time(took)} (planned: {spelled_time(planned[step.name])})"
                console.print(f"run {ended} of {len(missing)}, {step.name}: {how}", soft_wrap=True)

        return run_campaign(missing, made.vehicle, folder, jobs=jobs, mpi=mpi, progress=progress)


def _train(
    made: LearningPlan, folder: LearningFolder, jobs: int, mixed: bool, failed: dict[str, str]
) -> None:  # fmt: skip
    """Train, validate, and say what came of it."""
    import matplotlib

    matplotlib.use("Agg")
    from exumob.learning.learn import learn_from
    from exumob.learning.training import Progress
    from exumob.learning.validation import shortfall

    with counting_bar("training", 5 * made.seeds, "networks") as (bar, task):

        def progress(step: Progress) -> None:
            bar.update(task, description=f"training, seed {step.seed}, {step.body}", advance=1 if step.done else 0)

        found = learn_from(made, folder, jobs=jobs, mixed=mixed, failed=failed, progress=progress)
    figures = found.figures
    ends = [100.0 * one["end"] for one in figures["drives"]]
    console.print(
        f"loads     off by {figures['load_error']:.2f} of their deviation on {figures['runs']} runs kept apart "
        f"(coefficients alone: {figures['coefficients_load_error']:.2f}; worst: {figures['worst_load']})",
        soft_wrap=True,
    )
    console.print(
        f"drives    end {sum(ends) / len(ends):.2g} % of the path (at worst {max(ends):.2g} %) from those with the "
        f"flow in the loop ({len(ends)} drives)"
        if ends
        else "drives    none could be compared with the flow in the loop",
        soft_wrap=True,
    )
    if text := shortfall(figures):
        console.print(f"beware    {text}", soft_wrap=True)
    console.print(f"networks  {found.networks}: exumob drive --networks {found.networks}", soft_wrap=True)
    console.print(f"card      {found.card}", soft_wrap=True)
