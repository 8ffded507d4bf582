"""The command `exumob sweep`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from exumob.commands.shared import console, counting_bar, errors, fail


def sweep_command(
    study: Annotated[Path | None, typer.Argument(help="Study file (.toml); see exumob/sweeps/study.py.")] = None,
    vary: Annotated[
        list[str] | None,
        typer.Option(help="name=0,0.5,1 or name=0:1:5 or name~normal(1300,200); repeatable: a full grid."),
    ] = None,
    setting: Annotated[
        list[str] | None, typer.Option("--set", help="name=value for all cases, such as water.depth_ratio=0.5.")
    ] = None,
    samples: Annotated[int, typer.Option(help="Draws, if some --vary is a distribution.")] = 64,
    seed: Annotated[int, typer.Option(help="Of the draws.")] = 0,
    vehicle: Annotated[
        Path | None, typer.Option(help="Vehicle file (Python); default: the paper's 57 kg amphibious vehicle.")
    ] = None,
    output: Annotated[Path, typer.Option(help="Folder of the sweep; the same command goes on with it.")] = Path(
        "sweep"
    ),
    workers: Annotated[int, typer.Option(help="Processes.")] = 2,
    time_limit: Annotated[float | None, typer.Option(help="Of one case [s]. Default: none.")] = None,
    keep_runs: Annotated[bool, typer.Option("--keep-runs", help="Keep the whole result of every case.")] = False,
    again: Annotated[
        list[str] | None, typer.Option(help="Run cases of this status again, such as 'killed'; repeatable.")
    ] = None,
    mpi: Annotated[
        bool, typer.Option("--mpi", help="Use the ranks of mpiexec -n 4 python -m mpi4py.futures -m exumob sweep ...")
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
        if study is not None and (vary or setting or vehicle):
            raise ValueError("give a study file, or --vary, --set and --vehicle; not both.")
        if study is not None:
            experiment, cases = read_study(study)
        else:
            experiment, cases = from_options(vehicle, setting or [], vary or [], samples, seed)
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
        errors.print(f"Stopped; the same command goes on with {output}.", highlight=False)
        raise typer.Exit(130) from None
    status = result["status"].values
    for name in sorted(set(status)):
        console.print(f"{name:<12} {int((status == name).sum())} of {len(status)} cases", highlight=False)
    for row in range(len(status)):
        if status[row] != "completed":
            example = ", ".join(f"{name} = {value}" for name, value in cases[row].items())
            reason = str(result["reason"].values[row])
            console.print(f"the first that was not completed: {example}: {reason}", highlight=False, soft_wrap=True)
            break
    console.print(f"result       {output / 'sweep.nc'}", highlight=False)
