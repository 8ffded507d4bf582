"""The command `exumob map`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from exumob.commands.options import (
    EXPERT,
    OUTPUT,
    RUN,
    WATER,
    CurrentDirection,
    Networks,
    Seed,
    SettingName,
    SettingOption,
    UnusualValues,
    VehicleFile,
    Workers,
    option,
    option_names,
    radians,
    refuse_without_effect,
    span,
)
from exumob.commands.shared import (
    aspects,
    check_targets,
    console,
    counting_bar,
    described_drive,
    errors,
    fail,
    write_or_say,
)
from exumob.simulation.settings import SOIL, time_scale
from exumob.support.files import write_text
from exumob.support.quantities import DIRECTION


def map_command(  # one argument an option of the command line
    depth: Annotated[str, option(RUN, "Depth over tyre diameter, from:to.")] = "0.36:0.64",
    current: Annotated[str, option(RUN, "Speed of the head current [m/s], from:to.")] = "0:1.2",
    soil: Annotated[
        list[str] | None, option(RUN, f"A published soil; repeatable: maps side by side. Default: {SOIL}.")
    ] = None,
    vehicle: VehicleFile = None,
    draws: Annotated[
        int, option(RUN, "Runs at a node, over scatter of soil and water and the networks; 1: no scatter.")
    ] = 10,
    width: Annotated[float, option(WATER, "Width of the water to cross [m].")] = 12.0,
    time: Annotated[float, option(WATER, "Time in which it must be crossed [s].")] = 20.0,
    drift: Annotated[float, option(WATER, "Largest drift to either side over the width [m].")] = 1.0,
    current_direction: CurrentDirection = 180.0,
    hydrodynamics: Annotated[
        str, option(WATER, "Model of the water's loads: auto, networks, calibrated or coefficients.")
    ] = "auto",
    networks: Networks = None,
    output: Annotated[Path, option(OUTPUT, "Folder of the map; the same command goes on with it.")] = Path("map"),
    figure: Annotated[Path | None, option(RUN, "Draw the map here (.png, .pdf, .svg).")] = None,
    csv: Annotated[Path | None, option(OUTPUT, "Write the nodes here as a table (.csv).")] = None,
    workers: Workers = 2,
    setting: SettingOption = SettingName.fast,
    cells: Annotated[int, option(EXPERT, "Cells of the first level along each axis.")] = 4,
    levels: Annotated[int, option(EXPERT, "Times that the border between go and no-go is refined.")] = 1,
    seed: Seed = 0,
    unusual: UnusualValues = False,
) -> None:
    """Map where the vehicle can cross, with the chance that it does, over depth, current and soil.

    The vehicle drives straight ahead and is judged at the end: speed, drift, footing, attitude; on a wheelbase of
    0.714 m at 1 m/s for 4 s, of which the last 1.5 s count, on others by Froude's law. Nodes outside the networks'
    training range are hatched. What is done is kept, and the same command goes on. Exit code: 1 if runs broke down,
    were out of time or killed, 2 if nothing could run.

    Example: exumob map --depth 0.4:0.6 --current 0:1 --draws 10 --levels 1 --figure map.png
    """
    from dataclasses import replace

    from exumob.mobility.crossing import Crossing, Limits
    from exumob.mobility.map import SCATTER, Axis, MobilityMap, compute_map, table, verdict_lines
    from exumob.sweeps.experiment import amphibious_crossing
    from exumob.sweeps.run import Progress
    from exumob.vehicle.vehicle_file import load_vehicle

    try:
        check_targets({"--figure": figure, "--csv": csv})
        if draws == 1:
            refuse_without_effect("with --draws 1, where nothing is drawn", "leave {it} out", "seed")
        if len(set(soil or [])) < len(soil or []):
            raise ValueError(f"--soil names a soil twice ({', '.join(soil or [])}); give each once.")
        experiment = replace(amphibious_crossing(), duration=4.0, setting=setting.value, hydrodynamics=hydrodynamics)
        window = 1.5
        if vehicle is not None:
            experiment = experiment.with_vehicle(load_vehicle(vehicle))
            window *= time_scale(experiment.vehicle)
        with option_names():
            experiment = experiment.with_networks(networks or [])
        direction = radians("--current-direction", current_direction, DIRECTION, unusual)
        experiment = experiment.with_values({"water.current_direction": direction})
        experiment.check()
        wanted = MobilityMap(
            Crossing(experiment, Limits(width=width, time=time, drift=drift, window=window)),
            Axis("water.current_speed", *span("--current", current, unusual), cells),
            Axis("water.depth_ratio", *span("--depth", depth, unusual), cells),
            {name: {"soil": name} for name in soil or [SOIL]},
            scatter=SCATTER if draws > 1 else {}, draws=draws, levels=levels, seed=seed,
        )  # fmt: skip
        with counting_bar("map", 1, "runs") as (bar, task):
            drives = described_drive(experiment.vehicle, experiment.maneuver, experiment.duration)
            said: list[bool] = []

            def progress(level: str, reached: Progress) -> None:
                if not said:  # all is checked
                    said.append(True)
                    errors.print(f"map of {drives}, judged over the last {window:.2g} s", soft_wrap=True)
                bar.update(task, description=level, completed=reached.done, total=reached.total)

            result = compute_map(wanted, output, workers=workers, progress=progress)
    except (ValueError, RuntimeError, OSError) as error:
        fail(error)
    except KeyboardInterrupt:
        errors.print(f"Stopped; the same command goes on with {output}.", soft_wrap=True)
        raise typer.Exit(130) from None
    for text in verdict_lines(result):
        console.print(text, soft_wrap=True)
    console.print(f"trust     {aspects(result.attrs['trust'], 10)}", soft_wrap=True)
    console.print(f"result    {output / 'map.nc'}", soft_wrap=True)
    written = True
    if csv is not None:
        text = table(result).to_csv(index=False)
        if kept := write_or_say("the table", csv, lambda: write_text(csv, text)):
            console.print(f"table     {csv}", soft_wrap=True)
        written &= kept
    if figure is not None:
        import matplotlib

        matplotlib.use("Agg")
        from exumob.mobility.map_figure import plot_map
        from exumob.support.figures import save_figure

        if kept := write_or_say("the figure", figure, lambda: save_figure(plot_map(result), figure)):
            console.print(f"figure    {figure}", soft_wrap=True)
        written &= kept
    lost = {name: int(result.attrs[f"runs_{name.replace(' ', '_')}"]) for name in ("broke down", "lost")}
    if any(lost.values()):
        errors.print(
            f"{lost['broke down']} of {result.attrs['runs_made']} runs broke down, {lost['lost']} were out of time or "
            f"killed (in the folders of {output}: column `reason` of sweep.nc).", style="yellow", soft_wrap=True,
        )  # fmt: skip
        raise typer.Exit(1)
    if not written:
        raise typer.Exit(2)
