"""The command `exumob sweep`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from exumob.commands.options import (
    EXPERT,
    OUTPUT,
    RUN,
    Seed,
    SettingName,
    SettingOption,
    VehicleFile,
    Workers,
    option,
)
from exumob.commands.shared import console, counting_bar, errors, fail


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
    output: Annotated[Path, option(OUTPUT, "Folder of the sweep; the same command goes on with it.")] = Path("sweep"),
    keep_runs: Annotated[bool, option(OUTPUT, "Keep the whole result of every case.", "--keep-runs")] = False,
    workers: Workers = 2,
    setting: SettingOption = SettingName.fast,
    seed: Seed = 0,
    time_limit: Annotated[float | None, option(EXPERT, "Time limit of one case [s]. Default: none.")] = None,
    again: Annotated[
        list[str] | None, option(EXPERT, "Run cases of this status again, such as 'killed'; repeatable.")
    ] = None,
    mpi: Annotated[
        bool, option(EXPERT, "Use the ranks of mpiexec -n 4 python -m mpi4py.futures -m exumob sweep ...", "--mpi")
    ] = False,
) -> None:
    """Run the lane change for many values of vehicle, soil, water, maneuver and water model.

    Cases that fail become rows with a reason; finished ones are kept, and the same command goes on where it was
    stopped.

    Example: exumob sweep --vary water.current_speed=0,0.5,1 --vary "soil.cohesion~normal(1300,200)" --samples 32
    """
    from exumob.sweeps.run import Progress, sweep
    from exumob.sweeps.study import from_options, read_study

    try:
        if study is not None and (vary or fixed or vehicle or setting is not SettingName.fast):
            raise ValueError("give a study file, or --vary, --set, --setting and --vehicle; not both.")
        if study is not None:
            experiment, cases = read_study(study)
        else:
            experiment, cases = from_options(
                vehicle, [f"setting={setting.value}", *(fixed or [])], vary or [], samples, seed
            )
        with counting_bar("sweep", len(cases), "cases") as (bar, task):

            def progress(reached: Progress) -> None:
                bar.update(task, completed=reached.done)

            result = sweep(
                experiment, cases, output, workers=workers, time_limit=time_limit, keep_runs=keep_runs,
                again=again or [], mpi=mpi, progress=progress,
            )  # fmt: skip
    except (ValueError, RuntimeError, OSError) as error:
        fail(error)
    except KeyboardInterrupt:
        errors.print(f"Stopped; the same command goes on with {output}.", soft_wrap=True)
        raise typer.Exit(130) from None
    status = result["status"].values
    for name in sorted(set(status)):
        console.print(f"{name:<12} {int((status == name).sum())} of {len(status)} cases", soft_wrap=True)
    for row in range(len(status)):
        if status[row] != "completed":
            example = ", ".join(f"{name} = {value}" for name, value in cases[row].items())
            reason = str(result["reason"].values[row])
            console.print(f"the first that was not completed: {example}: {reason}", soft_wrap=True)
            break
    console.print(f"result       {output / 'sweep.nc'}", soft_wrap=True)
