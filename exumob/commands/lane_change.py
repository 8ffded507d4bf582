"""The command `exumob lane-change`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from exumob.commands.options import (
    EXPERT,
    OUTPUT,
    RUN,
    WATER,
    Animation,
    CellSize,
    Coarse,
    CurrentDirection,
    Duration,
    Figure,
    MacroStep,
    MicroStep,
    Output,
    SettingName,
    SettingOption,
    SoilName,
    Threads,
    UnusualValues,
    VehicleFile,
    option,
    option_names,
    radians,
    refuse_without_effect,
)
from exumob.commands.report import report_run
from exumob.commands.shared import (
    check_targets,
    errors,
    fail,
    simulated_time_bar,
    vehicle_of,
    whatever_was_computed,
)
from exumob.simulation.settings import DURATION, SETTINGS, SOIL
from exumob.support.quantities import (
    CURRENT_SPEED,
    DEPTH_RATIO,
    DIRECTION,
    INITIAL_SPEED,
    STEERING_ANGLE,
    WHEEL_SPEED,
)

if TYPE_CHECKING:
    import xarray as xr

    from exumob.coupling.flow_in_loop import CfdHydrodynamics
    from exumob.coupling.scheme import Coupling
    from exumob.water.conditions import Water
    from exumob.water.hydrodynamics import Hydrodynamics


class WaterModel(StrEnum):
    """Models of the water's loads by name."""

    auto = "auto"
    networks = "networks"
    coefficients = "coefficients"
    cfd = "cfd"
    none = "none"


class Scheme(StrEnum):
    """Schemes by which vehicle and flow agree within a macro step."""

    explicit = "explicit"
    semi_implicit = "semi-implicit"
    strong = "strong"


def lane_change_command(  # one argument an option of the command line
    depth_ratio: Annotated[
        float, option(RUN, "Water depth over tyre diameter; 0 is dry ground.", of=DEPTH_RATIO)
    ] = 0.6,
    current: Annotated[float, option(RUN, "Speed of the current, against the vehicle.", of=CURRENT_SPEED)] = 1.0,
    soil: SoilName = SOIL,
    vehicle: VehicleFile = None,
    current_direction: CurrentDirection = 180.0,
    hydrodynamics: Annotated[
        WaterModel,
        option(
            WATER,
            "Model of the water's loads. auto: networks where they fit the vehicle, else coefficients; cfd: the flow "
            "solver in the loop (half an hour to an hour on 18 mm cells).",
        ),
    ] = WaterModel.auto,
    networks: Annotated[
        list[Path] | None,
        option(
            WATER, "File of networks that `exumob train` wrote; several are an ensemble. Default: the shipped ones."
        ),
    ] = None,
    members: Annotated[
        bool, option(WATER, "Drive with each network alone, too: error bars on the path.", "--members")
    ] = False,
    output: Output = None,
    figure: Figure = None,
    animate: Animation = None,
    checkpoint: Annotated[
        Path | None, option(OUTPUT, "Keep the whole run in this file (.npz), every half second of simulated time.")
    ] = None,
    resume: Annotated[
        bool, option(OUTPUT, "Go on from the checkpoint, if there is one, with the same bits.", "--resume")
    ] = False,
    steering: Annotated[
        float, option(EXPERT, "Steering amplitude; a negative one mirrors the maneuver.", of=STEERING_ANGLE)
    ] = 30.0,
    wheel_speed: Annotated[float, option(EXPERT, "Final wheel speed.", of=WHEEL_SPEED)] = 10.0,
    initial_speed: Annotated[
        float, option(EXPERT, "Speed of the vehicle at time 0, ahead, its wheels rolling.", of=INITIAL_SPEED)
    ] = 0.0,
    duration: Duration = DURATION,
    setting: SettingOption = SettingName.fast,
    micro_step: MicroStep = None,
    macro_step: MacroStep = None,
    cell_size: CellSize = 0.0115,
    coarse: Coarse = False,
    coupling: Annotated[
        Scheme, option(EXPERT, "Scheme by which vehicle and flow agree within a macro step (cfd).")
    ] = Scheme.semi_implicit,
    threads: Threads = 1,
    unusual: UnusualValues = False,
) -> None:
    """Drive the single lane change of the paper through water on soft soil.

    Example: exumob lane-change --depth-ratio 0.6 --current 1 --output run.nc --figure run.png

    With the flow solver in the loop: exumob lane-change --hydrodynamics cfd --cell-size 0.018 --coarse --checkpoint
    run.npz --output run.nc; when it was stopped, the same with --resume.
    """
    from exumob.driving.maneuver import lane_change
    from exumob.ground.soil import Soil
    from exumob.simulation.ensemble import add_members
    from exumob.simulation.run import simulate
    from exumob.simulation.water_models import hydrodynamics_named
    from exumob.support.quantities import Unusual
    from exumob.surrogates.model import SurrogateHydrodynamics
    from exumob.water.conditions import Water

    targets = {"--output": output, "--figure": figure, "--animate": animate}
    progress: list[Callable[[float], None]] = []
    scheme: Coupling | None = None
    lead = 0.0
    model: Hydrodynamics
    try:
        _check_effects(depth_ratio, current, hydrodynamics, micro_step, macro_step)
        fresh = None if checkpoint is None or checkpoint.exists() else checkpoint
        check_targets({**targets, "--checkpoint": fresh})
        if (figure or animate) and duration < 0.1:
            raise ValueError(f"--duration {duration} s is too short to draw; give at least 0.1 s, or no --figure.")
        car = vehicle_of(vehicle)
        if unusual:
            depth_ratio, current, wheel_speed, cell_size = map(Unusual, (depth_ratio, current, wheel_speed, cell_size))
            initial_speed = Unusual(initial_speed)
        water = None
        if depth_ratio != 0.0:
            direction = radians("--current-direction", current_direction, DIRECTION, unusual)
            with option_names():
                water = Water.at_ratio(
                    depth_ratio, current, tyre_diameter=car.wheel.diameter, current_direction=direction
                )
        if len({file.resolve() for file in networks or []}) < len(networks or []):
            raise ValueError(
                f"--networks names a file twice ({', '.join(map(str, networks or []))}); an ensemble of the same "
                "network agrees with itself. Give each once."
            )
        if water is not None and hydrodynamics is WaterModel.cfd:
            grid = FlowOptions(cell_size, coarse, threads, snapshots=0.05 if animate else None)
            with option_names():
                model, lead = _flow_in_loop(grid, water, lambda time: progress[0](time))
            scheme = _scheme(coupling)
        else:
            name = "none" if hydrodynamics is WaterModel.cfd else hydrodynamics.value
            model = hydrodynamics_named(name, car, water, networks=networks)
        if members and (not isinstance(model, SurrogateHydrodynamics) or len(model.networks) < 2):
            raise ValueError("--members needs networks of two seeds at least as the water; leave it out.")
        with option_names():
            maneuver = lane_change(radians("--steering", steering, STEERING_ANGLE), wheel_speed)
            ground = Soil.published(soil)
    except (ValueError, OSError, ImportError) as error:
        fail(error)
    steps: dict[str, Any] = {
        "duration": duration, "setting": setting.value, "micro_step": micro_step, "macro_step": macro_step,
        "initial_speed": initial_speed,
    }  # fmt: skip

    def run(advance: Callable[[float], None]) -> xr.Dataset:
        with option_names():
            return simulate(
                car, ground, water, maneuver, model, **steps, coupling=scheme, checkpoint=checkpoint, resume=resume,
                progress=advance,
            )  # fmt: skip

    with simulated_time_bar(duration, "settling", "driving", lead) as advance:
        progress.append(advance)
        result, code = whatever_was_computed(lambda: run(advance), output)
    if members and not code:
        assert isinstance(model, SurrogateHydrodynamics)
        try:
            with simulated_time_bar(duration, "settling", "members") as advance:
                result = add_members(result, car, ground, water, maneuver, model, progress=advance, **steps)
        except KeyboardInterrupt:
            errors.print("Stopped among the members; the run itself follows.", style="yellow")
            code = 130
    if code and checkpoint is not None and checkpoint.exists():
        errors.print(f"{checkpoint} holds the run: the same command with --resume goes on.", soft_wrap=True)
    measured = vehicle is None and hydrodynamics is not WaterModel.cfd and micro_step is None and macro_step is None
    written = report_run(result, targets, f"{setting.value}: {SETTINGS[setting.value].error}" if measured else "")
    raise typer.Exit(code or (0 if written else 2))


def _check_effects(
    depth_ratio: float, current: float, model: WaterModel, micro_step: float | None, macro_step: float | None
) -> None:
    """Refuse options that were given and change nothing in this run.

    Raises
    ------
    ValueError
        Naming them, and what would give them an effect.
    """
    flow = ("cell_size", "coarse", "coupling", "threads")
    if depth_ratio == 0.0:
        wet = [*(("current",) if current != 0.0 else ()), "current_direction", "networks", "members", *flow]
        if model not in (WaterModel.auto, WaterModel.none):
            wet.append("hydrodynamics")
        refuse_without_effect("on dry ground (--depth-ratio 0)", "leave {it} out, or give a --depth-ratio", *wet)
    if model is WaterModel.none:
        wet = ["current_direction", *(("current",) if current != 0.0 else ())]
        refuse_without_effect("with --hydrodynamics none", "leave {it} out, or choose another --hydrodynamics", *wet)
    if model is not WaterModel.cfd:
        refuse_without_effect(
            f"with --hydrodynamics {model.value}", "add --hydrodynamics cfd, or leave {it} out", *flow
        )
    if model not in (WaterModel.networks, WaterModel.auto):
        remedy = "leave one out, or choose --hydrodynamics networks"
        refuse_without_effect(f"with --hydrodynamics {model.value}", remedy, "networks", "members")
    if micro_step is not None and macro_step is not None:
        refuse_without_effect("beside --micro-step and --macro-step, which it stands for", "leave {it} out", "setting")


@dataclass(frozen=True)
class FlowOptions:
    """Options of the flow solver in the loop."""

    cell_size: float
    coarse: bool
    threads: int
    snapshots: float | None


def _flow_in_loop(grid: FlowOptions, water: Water, progress: Callable[[float], None]) -> tuple[CfdHydrodynamics, float]:
    """Make the flow solver in the loop; the time before the release [s] comes with it."""
    from exumob.coupling.flow_code import BuiltInFlow
    from exumob.coupling.flow_in_loop import CfdHydrodynamics
    from exumob.flow import FlowSettings

    flow = BuiltInFlow(
        grid.cell_size, settings=FlowSettings(threads=grid.threads), allow_coarse=grid.coarse, snapshots=grid.snapshots
    )
    model = CfdHydrodynamics(flow, progress=progress)
    return model, model.spin_up.duration(water)


def _scheme(name: Scheme) -> Coupling:
    from exumob.coupling.explicit import Explicit
    from exumob.coupling.semi_implicit import SemiImplicit
    from exumob.coupling.strong import Strong

    return {Scheme.explicit: Explicit, Scheme.semi_implicit: SemiImplicit, Scheme.strong: Strong}[name]()
