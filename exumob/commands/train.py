"""The command `exumob train`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from exumob.commands.options import EXPERT, OUTPUT, RUN, VehicleFile, option, option_names
from exumob.commands.shared import console, counting_bar, errors, fail, vehicle_of, write_or_say
from exumob.support.quantities import shown

DATA = Path("data/cfd_mbd")
"""Folder of the runs that come with exumob."""
MOST = 1000
"""Most seeds and processes."""


def train_command(
    preset: Annotated[
        list[str] | None, option(RUN, "What to train, by name; repeatable. Default: all presets.")
    ] = None,
    data: Annotated[
        list[Path] | None,
        option(RUN, "Folder of CFD-MBD runs (packed or imported, netCDF); repeatable. Default: data/cfd_mbd."),
    ] = None,
    seeds: Annotated[int, option(RUN, "Number of networks of each body: seeds 0, 1, ...")] = 5,
    vehicle: VehicleFile = None,
    output: Annotated[Path, option(OUTPUT, "Folder for the networks.")] = Path("networks"),
    jobs: Annotated[int, option(EXPERT, "Processes that run side by side, one thread each.")] = 2,
) -> None:
    """Train networks for the water's loads from runs with the flow in the loop.

    What is finished is kept at once; the same command goes on where it was stopped.

    Example: exumob train --preset paper-lstm --seeds 5 --output networks
    """
    try:
        from exumob.learning.examples import training_runs
        from exumob.learning.presets import PRESETS
        from exumob.learning.training import Progress, train

        wanted = list(dict.fromkeys(preset or PRESETS))
        unknown = [name for name in wanted if name not in PRESETS]
        if unknown:
            raise ValueError(f"--preset {unknown[0]} is not known; use {', '.join(PRESETS)}.")
        for name, number in (("--seeds", seeds), ("--jobs", jobs)):
            if not 1 <= number <= MOST:
                raise ValueError(f"{name} {shown(number)} must be 1 to {MOST}; give a number within.")
        with option_names():
            runs = training_runs(data or [DATA])
        car = vehicle_of(vehicle)
    except (ValueError, OSError) as error:
        fail(error)
    except ImportError as error:
        fail(ImportError(f"{error}; training needs torch: pip install 'exumob[train]'"))

    with counting_bar("training", 5 * seeds * len(wanted), "networks") as (bar, task):

        def progress(step: Progress) -> None:
            name = f"{step.preset}, seed {step.seed}, {step.body}"
            bar.update(task, description=f"{name}: epoch {step.epoch}, {step.loss:.4f}", advance=1 if step.done else 0)
            if step.done:
                console.print(f"{name}: {step.epoch} epochs, validation error {step.loss:.4f}", soft_wrap=True)

        try:
            files = train(
                [PRESETS[n] for n in wanted], runs, car, output, seeds=range(seeds), jobs=jobs, progress=progress
            )
        except (ValueError, RuntimeError, OSError) as error:
            fail(error)
        except KeyboardInterrupt:
            errors.print(f"Stopped; the same command goes on with {output}.", soft_wrap=True)
            raise typer.Exit(130) from None
    import matplotlib

    matplotlib.use("Agg")
    from exumob.learning.curves import plot_learning_curves
    from exumob.support.figures import save_figure
    from exumob.surrogates.networks import NetworkSet

    written = True
    for name in wanted:
        made = [file for (preset_name, _), file in files.items() if preset_name == name]
        curves = output / f"{name}_curves.png"

        def draw(made: list[Path] = made, curves: Path = curves) -> None:
            save_figure(plot_learning_curves([NetworkSet.load(file) for file in made]), curves)

        drawn = write_or_say("the learning curves", curves, draw)
        written &= drawn
        console.print(
            f"{name}: {len(made)} files in {output}{f', learning curves {curves}' if drawn else ''}", soft_wrap=True
        )
    if not written:
        raise typer.Exit(2)
