"""The command `exumob lane-change`."""

from __future__ import annotations

import math
from collections.abc import Callable
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from exumob.commands.shared import (
    check_targets,
    console,
    errors,
    fail,
    simulated_time_bar,
    vehicle_of,
    whatever_was_computed,
    write_result,
)

if TYPE_CHECKING:
    import xarray as xr

    from exumob.vehicle.parameters import Vehicle
    from exumob.water.hydrodynamics import Hydrodynamics


class WaterModel(StrEnum):
    """What the water does to the vehicle."""

    none = "none"
    coefficients = "coefficients"
    networks = "networks"
    cfd = "cfd"


class Scheme(StrEnum):
    """How vehicle and flow agree within a macro step."""

    explicit = "explicit"
    semi_implicit = "semi-implicit"
    strong = "strong"


def lane_change_command(
    depth_ratio: Annotated[float, typer.Option(help="Water depth over tyre diameter; 0 is dry ground.")] = 0.6,
    current: Annotated[float, typer.Option(help="Speed of the current [m/s].")] = 1.0,
    current_direction: Annotated[
        float, typer.Option(help="Where the flow goes, from the first heading, to the left [deg].")
    ] = 180.0,
    steering: Annotated[float, typer.Option(help="Steering amplitude [deg]; negative mirrors the maneuver.")] = 30.0,
    wheel_speed: Annotated[float, typer.Option(help="Final wheel speed [rad/s].")] = 10.0,
    soil: Annotated[str, typer.Option(help="A published soil; `exumob soils` lists them.")] = "LETE sand",
    hydrodynamics: Annotated[
        WaterModel | None,
        typer.Option(help="Water model; default: networks where they fit the vehicle, else coefficients."),
    ] = None,
    networks: Annotated[
        list[Path] | None,
        typer.Option(help="networks: a file of `exumob train`; several are an ensemble. Default: the shipped ones."),
    ] = None,
    vehicle: Annotated[
        Path | None, typer.Option(help="Vehicle file (Python); default: the paper's 57 kg amphibious vehicle.")
    ] = None,
    duration: Annotated[float, typer.Option(help="Simulated time [s].")] = 8.0,
    micro_step: Annotated[float, typer.Option(help="Step of the multibody solver [s].")] = 1e-4,
    macro_step: Annotated[float, typer.Option(help="Interval at which the water's loads are renewed [s].")] = 1e-3,
    cell_size: Annotated[float, typer.Option(help="cfd: of the grid round the vehicle [m].")] = 0.0115,
    coarse: Annotated[bool, typer.Option("--coarse", help="cfd: accept cells too coarse for gaps and wheels.")] = False,
    coupling: Annotated[Scheme, typer.Option(help="cfd: how vehicle and flow agree.")] = Scheme.semi_implicit,
    threads: Annotated[int, typer.Option(help="cfd: threads of the flow solver.")] = 1,
    checkpoint: Annotated[
        Path | None, typer.Option(help="Keep the whole run in this file, every half second of simulated time.")
    ] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on from the checkpoint, if there is one, with the same bits.")
    ] = False,
    members: Annotated[
        bool, typer.Option("--members", help="Drive with each network alone, too: error bars on the path.")
    ] = False,
    output: Annotated[Path | None, typer.Option(help="Write the result here (netCDF).")] = None,
    figure: Annotated[Path | None, typer.Option(help="Draw the run here (.png, .pdf, .svg).")] = None,
    animate: Annotated[Path | None, typer.Option(help="Animate the run here (.gif or .mp4).")] = None,
) -> None:
    """Drive the single lane change of the paper through water on soft soil.

    Example: exumob lane-change --depth-ratio 0.6 --current 1 --output run.nc --figure run.png

    With the flow solver in the loop: exumob lane-change --hydrodynamics cfd --cell-size 0.018 --coarse --checkpoint
    run.npz --output run.nc; when it was stopped, the same with --resume.
    """
    from exumob.coupling.explicit import Explicit
    from exumob.coupling.flow_code import BuiltInFlow
    from exumob.coupling.flow_in_loop import CfdHydrodynamics
    from exumob.coupling.scheme import Coupling
    from exumob.coupling.semi_implicit import SemiImplicit
    from exumob.coupling.strong import Strong
    from exumob.driving.maneuver import lane_change
    from exumob.ground.soil import Soil
    from exumob.simulation.ensemble import add_members
    from exumob.simulation.run import simulate
    from exumob.surrogates.model import SurrogateHydrodynamics
    from exumob.water.coefficients import CoefficientHydrodynamics
    from exumob.water.conditions import Water
    from exumob.water.hydrodynamics import NoWater

    targets = {"--output": output, "--figure": figure, "--animate": animate}
    try:
        check_targets(targets)
        if (figure or animate) and duration < 0.1:
            raise ValueError(f"--duration {duration} s is too short to draw; give at least 0.1 s, or no --figure.")
        car = vehicle_of(vehicle)
        wet = depth_ratio != 0.0
        water = None
        if wet:
            direction = math.radians(current_direction)
            water = Water.at_ratio(depth_ratio, current, tyre_diameter=car.wheel.diameter, current_direction=direction)
        model: Hydrodynamics = NoWater()
        scheme: Coupling | None = None
        lead = 0.0
        told: list[Callable[[float], None]] = []
        if water is not None and hydrodynamics in (WaterModel.networks, None):
            model = _networks(networks, car, required=hydrodynamics is not None or bool(networks))
        elif water is not None and hydrodynamics is WaterModel.coefficients:
            model = CoefficientHydrodynamics()
        elif water is not None and hydrodynamics is WaterModel.cfd:
            from exumob.flow import FlowSettings

            flow = BuiltInFlow(
                cell_size, settings=FlowSettings(threads=threads), allow_coarse=coarse,
                snapshots=0.05 if animate else None,
            )  # fmt: skip
            model = cfd = CfdHydrodynamics(flow, progress=lambda time: told[0](time))
            lead = cfd.spin_up.duration(water)
            scheme = {"explicit": Explicit, "semi-implicit": SemiImplicit, "strong": Strong}[coupling.value]()
        if networks and hydrodynamics not in (WaterModel.networks, None):
            raise ValueError(f"--networks means nothing with --hydrodynamics {hydrodynamics.value}; leave one out.")
        if members and (not isinstance(model, SurrogateHydrodynamics) or len(model.networks) < 2):
            raise ValueError("--members needs networks of two seeds at least as the water; leave it out.")
        maneuver = lane_change(math.radians(steering), wheel_speed)
        ground = Soil.published(soil)
    except (ValueError, OSError, ImportError) as error:
        fail(error)

    with simulated_time_bar(duration, "settling", "driving", lead) as advance:
        told.append(advance)
        result, code = whatever_was_computed(
            lambda: simulate(
                car, ground, water, maneuver, model, duration=duration, micro_step=micro_step, macro_step=macro_step,
                coupling=scheme, checkpoint=checkpoint, resume=resume, progress=advance,
            ),
            output,
        )  # fmt: skip
    if members and not code:
        assert isinstance(model, SurrogateHydrodynamics)
        try:
            with simulated_time_bar(duration, "settling", "members") as advance:
                result = add_members(
                    result, car, ground, water, maneuver, model, duration=duration, micro_step=micro_step,
                    macro_step=macro_step, progress=advance,
                )  # fmt: skip
        except KeyboardInterrupt:
            errors.print("[yellow]Stopped among the members[/yellow]; the run itself follows.", highlight=False)
            code = 130
    if code and checkpoint is not None and checkpoint.exists():
        errors.print(f"{checkpoint} holds the run: the same command with --resume goes on.", highlight=False)
    _report(result, targets)
    raise typer.Exit(code)


def _networks(files: list[Path] | None, car: Vehicle, required: bool) -> Hydrodynamics:
    """Networks, or the coefficient model where none fit the vehicle and nobody asked for them."""
    from exumob.surrogates.model import SurrogateHydrodynamics
    from exumob.water.coefficients import CoefficientHydrodynamics

    try:
        model = SurrogateHydrodynamics(files or None)
        for network in model.networks:
            network.check_vehicle(car)
    except ValueError as error:
        if required:
            raise
        errors.print(f"[yellow]coefficient model of the water:[/yellow] {error}", highlight=False, soft_wrap=True)
        return CoefficientHydrodynamics()
    return model


def _report(result: xr.Dataset, targets: dict[str, Path | None]) -> None:
    from exumob.simulation.animation import animate_run
    from exumob.simulation.plotting import plot_run
    from exumob.simulation.results import summary

    if result.sizes["time"] > 1:
        _print_summary(result, summary(result))
    animate: Callable[[xr.Dataset, Path], None] = animate_run
    if "hydrodynamics_elevation" in result:
        from exumob.flow.output.pictures import animate_surface as animate
    write_result(result, targets, plot_run, animate)


def _print_summary(result: xr.Dataset, figures: dict[str, float]) -> None:
    from exumob.simulation.plotting import scenario_name

    lines = {
        "run": f"{result.attrs['title'].removeprefix('exumob run of ')}, {scenario_name(result)}, "
        f"{result.attrs['hydrodynamics']}; {result.attrs['status'].split(':')[0]}",
        "distance": f"{figures['distance']:.3f} m along the path, {figures['forward']:.3f} m forward",
        "lateral displacement": f"{figures['lateral']:+.3f} m",
        "final yaw": f"{math.degrees(figures['yaw']):+.2f} deg",
        "drift angle": f"{math.degrees(figures['drift_angle']):+.2f} deg (course less heading, at the end)",
        "slip": f"{100 * figures['mean_slip']:.1f} % (mean of the wheels, second half)",
        "buoyed weight": f"{100 * figures['buoyed_share']:.1f} % carried by the water (mean)",
        "driving energy": f"{figures['spin_energy']:.1f} J",
        **_range_lines(figures),
        **_member_lines(figures),
        "wall time": f"{figures['wall_time']:.2f} s, and {float(result.attrs['settling_wall_time']):.2f} s to settle",
        "real-time factor": f"{figures['real_time_factor']:.2f} (simulated over wall time)",
    }
    for name, text in lines.items():
        console.print(f"[bold]{name:<21}[/bold] {text}", highlight=False)


def _range_lines(figures: dict[str, float]) -> dict[str, str]:
    """What networks say of their own limits."""
    if "out_of_range_share" not in figures:
        return {}
    return {
        "training range": f"left for {100 * figures['out_of_range_share']:.1f} % of the time; coefficient model's "
        f"share of the loads {100 * figures['fallback_share']:.1f} %"
    }


def _member_lines(figures: dict[str, float]) -> dict[str, str]:
    """How far the networks' own runs end from each other."""
    if "forward_spread" not in figures:
        return {}
    return {
        "members' spread": f"of {figures['members']:.0f}: {1e3 * figures['forward_spread']:.0f} mm forward, "
        f"{1e3 * figures['lateral_spread']:.0f} mm lateral, "
        f"{math.degrees(figures['yaw_spread']):.2f} deg (standard deviations at the end)"
    }
