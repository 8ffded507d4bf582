"""The command `exumob ford`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from exumob.commands.driving import (
    SNAPSHOTS,
    CheckpointFile,
    CouplingScheme,
    FlowOptions,
    Members,
    ModelOption,
    Resume,
    RunOptions,
    Scene,
    Scheme,
    SoilValue,
    WaterModel,
    cells_of,
    check_effects,
    drive,
    soil_with,
)
from exumob.commands.options import (
    EXPERT,
    RUN,
    WATER,
    Animation,
    Coarse,
    Figure,
    MacroStep,
    MicroStep,
    Networks,
    Output,
    SettingName,
    SettingOption,
    SoilName,
    Threads,
    UnusualValues,
    VehicleFile,
    option,
    option_names,
)
from exumob.commands.report import report_ford
from exumob.commands.shared import console, fail, vehicle_of
from exumob.simulation.settings import SOIL
from exumob.support.quantities import CELL_SIZE, DEPTH, DURATION, INITIAL_SPEED, Unusual

if TYPE_CHECKING:
    import xarray as xr

    from exumob.ground.soil import Soil
    from exumob.mobility.ford import Ford


def ford_command(  # one argument an option of the command line
    section: Annotated[
        Path,
        typer.Argument(
            metavar="SECTION.csv",
            help="Cross-section along the path: columns station [m], bed [m] and, if measured, current [m/s] across "
            "the path, positive to the left, and along [m/s].",
        ),
    ],
    level: Annotated[
        float | None, option(RUN, "Height of the still water, above the same datum as the bed. [m]")
    ] = None,
    depth: Annotated[float | None, option(RUN, "Greatest depth, in place of --level.", of=DEPTH)] = None,
    discharge: Annotated[
        float | None, option(RUN, "Discharge of the river, positive to the left, in place of a current. [m^3/s]")
    ] = None,
    vehicle: VehicleFile = None,
    speed: Annotated[
        float | None,
        option(RUN, "Speed of the tyres' tread. Default: by Froude's law, 1 m/s on a wheelbase of 0.714 m. [m/s]"),
    ] = None,
    soil: SoilName = SOIL,
    soil_value: SoilValue = None,
    output: Output = None,
    figure: Figure = None,
    animate: Animation = None,
    hydrodynamics: ModelOption = WaterModel.auto,
    networks: Networks = None,
    members: Members = False,
    density: Annotated[float, option(WATER, "Density of the water. [kg/m^3]")] = 1000.0,
    initial_speed: Annotated[
        float, option(EXPERT, "Speed of the vehicle at time 0, its wheels rolling; 0: from rest.", of=INITIAL_SPEED)
    ] = 0.0,
    duration: Annotated[
        float | None,
        option(EXPERT, "Time in which it must cross. Default: enough at half the speed of its tyres.", of=DURATION),
    ] = None,
    checkpoint: CheckpointFile = None,
    resume: Resume = False,
    cell_size: Annotated[
        float | None,
        option(EXPERT, "Cells of the flow solver (cfd). Default: 0.0575 of the tyre's diameter.", of=CELL_SIZE),
    ] = None,
    coarse: Coarse = False,
    coupling: CouplingScheme = Scheme.semi_implicit,
    threads: Threads = 1,
    setting: SettingOption = SettingName.fast,
    micro_step: MicroStep = None,
    macro_step: MacroStep = None,
    unusual: UnusualValues = False,
) -> None:
    """Can my vehicle cross here? Drive it through a ford that is known by its cross-section, and report.

    The vehicle starts with its bow half its length before the water's edge; its driver keeps to the path. It has
    crossed once all of it is past the far edge. With networks or calibrated coefficients, where no run like it was
    compared with the flow in the loop, it is driven once more with the published coefficients, and the line "2nd
    opinion" says how far the two are apart.

    Example: exumob ford section.csv --depth 0.3 --vehicle car.py --figure ford.png
    """
    from exumob.mobility.ford import ford_report
    from exumob.mobility.ford_figure import plot_ford
    from exumob.simulation.second_opinion import Outcome

    targets = {"--output": output, "--figure": figure, "--animate": animate}
    options = RunOptions(
        hydrodynamics, networks, members, setting.value, micro_step, macro_step, checkpoint, resume, targets, False
    )  # fmt: skip
    try:
        if (level is None) == (depth is None):
            given = "neither --level nor --depth is" if level is None else "--level and --depth are both"
            raise ValueError(f"{given} given; give the height of the water's surface, or its greatest depth.")
        check_effects(True, "", 0.0, hydrodynamics, micro_step, macro_step)
        options.check(duration)
    except (ValueError, OSError) as error:
        fail(error)
    crossed: list[Ford] = []

    def scene() -> Scene:
        with option_names():
            ford = _ford(
                section, level, depth, discharge, density, vehicle, soil_with(soil, soil_value or []), speed,
                initial_speed, duration, unusual,
            )  # fmt: skip
            crossed.append(ford)
            return Scene(
                ford.vehicle, ford.soil, ford.water, ford.maneuver, ford.time, ford.initial_speed,
                ford.section.terrain(), ford.start,
            )  # fmt: skip

    def flow_of(scene: Scene) -> FlowOptions:
        size = cells_of(scene.vehicle) if cell_size is None else Unusual(cell_size) if unusual else cell_size
        return FlowOptions(size, coarse, threads, coupling, SNAPSHOTS if animate else None)

    def say(scene: Scene) -> None:
        for name, text in crossed[0].lines().items():
            console.print(f"{name:<12} {text}", soft_wrap=True)

    def reported(result: xr.Dataset) -> bool:
        try:
            found = ford_report(result, crossed[0])
        except ValueError as error:
            fail(error)
        return report_ford(result, found, targets, lambda run: plot_ford(run, crossed[0], found))

    def outcome(run: xr.Dataset) -> Outcome:
        found = ford_report(run, crossed[0])
        return Outcome(found.kind, found.sentence, found.last)

    drive(options, scene, flow_of, say, reported, outcome)


def _ford(  # what the options give
    file: Path, level: float | None, depth: float | None, discharge: float | None, density: float,
    vehicle: Path | None, soil: Soil, speed: float | None, initial_speed: float, duration: float | None, unusual: bool,
) -> Ford:  # fmt: skip
    from exumob.mobility.ford import Ford
    from exumob.water.cross_section import CrossSection

    if unusual:
        speed = None if speed is None else Unusual(speed)
        depth = None if depth is None else Unusual(depth)
        level = None if level is None else Unusual(level)
        initial_speed, density = Unusual(initial_speed), Unusual(density)
    section = CrossSection.read(file)
    if level is None:
        level = section.level_at_depth(DEPTH.check("--depth", depth))
    try:
        return Ford(section, level, vehicle_of(vehicle), soil, discharge, speed, initial_speed, duration, density)
    except ValueError as error:
        text = str(error)
        if depth is not None:
            text = text.replace("lower the level", "give a smaller --depth")
        raise ValueError(text.replace("CrossSection: it", f"{file}: the section")) from None
