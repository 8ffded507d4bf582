"""The command `exumob sweep`."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from exumob.commands.options import (
    EXPERT,
    OUTPUT,
    RUN,
    Networks,
    Seed,
    SettingName,
    SettingOption,
    UnusualValues,
    VehicleFile,
    Workers,
    given,
    option,
    option_names,
    refuse_without_effect,
)
from exumob.commands.shared import aspects, console, counting_bar, described_drive, errors, fail
from exumob.support.files import require_folder_name

CAUSES = 3
"""Number of causes of failure that are printed."""


def sweep_command(  # one argument an option of the command line
    study: Annotated[
        Path | None,
        typer.Argument(help="Study file (.toml), in place of the options below; see docs/howto/sweeps.md."),
    ] = None,
    vary: Annotated[
        list[str] | None,
        option(RUN, "name=0,0.5,1 or name=0:1:5 or name~normal(1300,200); repeatable: a full grid."),
    ] = None,
    fixed: Annotated[
        list[str] | None, option(RUN, "name=value for all cases, such as water.depth_ratio=0.5; repeatable.", "--set")
    ] = None,
    samples: Annotated[int, option(RUN, "Number of draws, if some --vary is a distribution.")] = 64,
    vehicle: VehicleFile = None,
    networks: Networks = None,
    output: Annotated[Path, option(OUTPUT, "Folder of the sweep; the same command goes on with it.")] = Path("sweep"),
    keep_runs: Annotated[bool, option(OUTPUT, "Keep the whole result of every case.", "--keep-runs")] = False,
    workers: Workers = 2,
    setting: SettingOption = SettingName.fast,
    seed: Seed = 0,
    time_limit: Annotated[float | None, option(EXPERT, "Time limit of one case [s]. Default: none.")] = None,
    again: Annotated[
        list[str] | None, option(EXPERT, "Run cases of this status again, such as 'killed'; repeatable.")
    ] = None,
    unusual: UnusualValues = False,
    mpi: Annotated[
        bool, option(EXPERT, "Use the ranks of mpiexec -n 4 python -m mpi4py.futures -m exumob sweep ...", "--mpi")
    ] = False,
) -> None:
    """Run the lane change for many values of vehicle, soil, water, maneuver and water model.

    Another vehicle is driven by Froude's law: speed of the tyres, times and duration go with its size, and the water is
    as deep over its tyres. Cases that fail become rows with a reason; finished ones are kept, and the same command goes
    on where it was stopped. Exit code: 0 if all cases were completed, 1 if some were not, 2 if none could be run.

    Example: exumob sweep --vary water.current_speed=0,0.5,1 --vary "soil.cohesion~normal(1300,200)" --samples 32
    """
    from exumob.sweeps.run import Progress, need, sweep
    from exumob.sweeps.study import from_options, read_study

    kept: list[int] = []
    try:
        require_folder_name("--output", output)
        if study is not None:
            refuse_without_effect(
                "beside a study file", "write it into the file, or leave the file out",
                "vary", "fixed", "samples", "vehicle", "networks", "setting", "seed", "unusual",
            )  # fmt: skip
            experiment, cases = read_study(study)
        else:
            if not any("~" in text.partition("=")[0] for text in vary or []):
                remedy = 'vary something by a distribution, as "soil.cohesion~normal(1300,200)", or leave {it} out'
                refuse_without_effect("where nothing is drawn", remedy, "samples", "seed")
            chosen = [f"setting={setting.value}"] if given("setting") else []
            experiment, cases = from_options(vehicle, [*chosen, *(fixed or [])], vary or [], samples, seed, unusual)
            with option_names():
                experiment = experiment.with_networks(networks or [])
        if mpi:
            refuse_without_effect("with --mpi", "mpiexec -n says how many ranks there are; leave {it} out", "workers")
        with counting_bar("sweep", len(cases), "cases") as (bar, task):

            def progress(reached: Progress) -> None:
                if not kept:  # all is checked
                    kept.append(reached.kept)
                    errors.print(f"sweep of {need(experiment, cases, workers, keep_runs)}", soft_wrap=True)
                    drives = described_drive(experiment.vehicle, experiment.maneuver, experiment.duration)
                    errors.print(f"driven, unless varied: {drives}", soft_wrap=True)
                bar.update(task, completed=reached.done)

            result = sweep(
                experiment, cases, output, workers=workers, time_limit=time_limit, keep_runs=keep_runs,
                again=tuple(again or ()), mpi=mpi, progress=progress,
            )  # fmt: skip
    except (ValueError, RuntimeError, OSError) as error:
        fail(error)
    except KeyboardInterrupt:
        errors.print(f"Stopped; the same command goes on with {output}.", soft_wrap=True)
        raise typer.Exit(130) from None
    status = [str(one) for one in result["status"].values]
    console.print(f"{'cases':<12} {len(status)}: {kept[0]} kept, {len(status) - kept[0]} run", soft_wrap=True)
    for name, number in Counter(status).most_common():
        console.print(f"{name:<12} {number} of {len(status)} cases", soft_wrap=True)
    if "verdict" in result:
        for name, number in Counter(str(one) for one in result["verdict"].values if str(one)).most_common():
            console.print(f"{'verdict':<12} {name}: {number}", soft_wrap=True)
    if "trust" in result.attrs:
        console.print(f"{'trust':<12} {aspects(result.attrs['trust'], 13)}", soft_wrap=True)
    _print_causes(status, [str(reason) for reason in result["reason"].values], cases)
    console.print(f"{'result':<12} {output / 'sweep.nc'}", soft_wrap=True)
    if code := exit_code(status):
        raise typer.Exit(code)


def exit_code(status: Sequence[str]) -> int:
    """Exit code of a sweep: 0 if all cases were completed, 2 if none could be run, 1 otherwise."""
    if set(status) == {"completed"}:
        return 0
    return 2 if set(status) <= {"refused", "failed"} else 1


def _print_causes(status: Sequence[str], reasons: Sequence[str], cases: Sequence[dict[str, Any]]) -> None:
    """Print why cases were not completed, with the first case of each cause."""
    causes: dict[tuple[str, str], list[int]] = {}
    for number, (how, reason) in enumerate(zip(status, reasons, strict=True)):
        if how != "completed":
            causes.setdefault((how, reason), []).append(number)
    for (how, reason), numbers in list(causes.items())[:CAUSES]:
        example = ", ".join(f"{name} = {value}" for name, value in cases[numbers[0]].items())
        also = f" and {len(numbers) - 1} more" if len(numbers) > 1 else ""
        errors.print(f"{how}: case {numbers[0]} ({example}){also}: {reason}", style="yellow", soft_wrap=True)
    if len(causes) > CAUSES:
        errors.print(f"and {len(causes) - CAUSES} more causes, in the column `reason` of the result", style="yellow")
