"""The command `exumob ford`."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from exumob.commands.driving import ModelOption, Networks, WaterModel, model_named, refuse_flow_over_terrain
from exumob.commands.options import (
    EXPERT,
    RUN,
    WATER,
    Animation,
    Figure,
    MacroStep,
    MicroStep,
    Output,
    SettingName,
    SettingOption,
    SoilName,
    UnusualValues,
    VehicleFile,
    option,
    option_names,
    refuse_without_effect,
)
from exumob.commands.report import report_ford
from exumob.commands.shared import (
    check_targets,
    console,
    fail,
    simulated_time_bar,
    vehicle_of,
    whatever_was_computed,
)
from exumob.simulation.settings import SOIL
from exumob.support.quantities import DEPTH, DURATION, INITIAL_SPEED

if TYPE_CHECKING:
    import xarray as xr

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
    output: Output = None,
    figure: Figure = None,
    animate: Animation = None,
    hydrodynamics: ModelOption = WaterModel.auto,
    networks: Networks = None,
    density: Annotated[float, option(WATER, "Density of the water. [kg/m^3]")] = 1000.0,
    initial_speed: Annotated[
        float, option(EXPERT, "Speed of the vehicle at time 0, its wheels rolling; 0: from rest.", of=INITIAL_SPEED)
    ] = 0.0,
    duration: Annotated[
        float | None,
        option(EXPERT, "Time in which it must cross. Default: enough at half the speed of its tyres.", of=DURATION),
    ] = None,
    setting: SettingOption = SettingName.fast,
    micro_step: MicroStep = None,
    macro_step: MacroStep = None,
    unusual: UnusualValues = False,
) -> None:
    """Can my vehicle cross here? Drive it through a ford that is known by its cross-section, and report.

    The vehicle starts half its length before the water's edge; its driver keeps to the path. It has crossed once all of
    it is past the far edge.

    Example: exumob ford section.csv --depth 0.3 --vehicle car.py --figure ford.png
    """
    from exumob.mobility.ford import ford_report
    from exumob.mobility.ford_figure import plot_ford

    targets = {"--output": output, "--figure": figure, "--animate": animate}
    try:
        if hydrodynamics not in (WaterModel.auto, WaterModel.networks):
            refuse_without_effect(
                f"with --hydrodynamics {hydrodynamics.value}", "leave it out, or choose --hydrodynamics networks",
                "networks",
            )  # fmt: skip
        if micro_step is not None and macro_step is not None:
            refuse_without_effect("beside --micro-step and --macro-step", "leave {it} out", "setting")
        if (level is None) == (depth is None):
            given = "neither --level nor --depth is" if level is None else "--level and --depth are both"
            raise ValueError(f"{given} given; give the height of the water's surface, or its greatest depth.")
        check_targets(targets)
        with option_names():
            ford = _ford(
                section, level, depth, discharge, density, vehicle, soil, speed, initial_speed, duration, unusual
            )
            if hydrodynamics is WaterModel.cfd:
                refuse_flow_over_terrain(ford.water, ford.section.terrain(), ford.start)
            model = model_named(hydrodynamics, ford.vehicle, ford.water, networks)
    except (ValueError, OSError, ImportError) as error:
        fail(error)
    steps = {"setting": setting.value, "micro_step": micro_step, "macro_step": macro_step}
    for name, text in ford.lines().items():
        console.print(f"{name:<12} {text}", soft_wrap=True)

    def run(advance: Callable[[float], None]) -> xr.Dataset:
        with option_names():  # inside: whatever_was_computed says errors at once
            return ford.drive(model, advance, **steps)

    with simulated_time_bar(ford.time, "settling", "driving") as advance:
        result, code = whatever_was_computed(lambda: run(advance), output)
    try:
        report = ford_report(result, ford)
    except ValueError as error:
        fail(error)
    written = report_ford(result, report, targets, lambda run: plot_ford(run, ford, report))
    raise typer.Exit(code or (0 if written else 2))


def _ford(  # what the options give
    file: Path, level: float | None, depth: float | None, discharge: float | None, density: float,
    vehicle: Path | None, soil: str, speed: float | None, initial_speed: float, duration: float | None, unusual: bool,
) -> Ford:  # fmt: skip
    from exumob.ground.soil import Soil
    from exumob.mobility.ford import Ford
    from exumob.support.quantities import Unusual
    from exumob.water.cross_section import CrossSection

    if unusual:
        speed = None if speed is None else Unusual(speed)
        depth = None if depth is None else Unusual(depth)
        initial_speed, density = Unusual(initial_speed), Unusual(density)
    section = CrossSection.read(file)
    if level is None:
        level = section.level_at_depth(DEPTH.check("--depth", depth))
    try:
        car, ground = vehicle_of(vehicle), Soil.published(soil)
        return Ford(section, level, car, ground, discharge, speed, initial_speed, duration, density)
    except ValueError as error:
        text = str(error)
        if depth is not None:
            text = text.replace("lower the level", "give a smaller --depth")
        raise ValueError(text.replace("CrossSection: it", f"{file}: the section")) from None
