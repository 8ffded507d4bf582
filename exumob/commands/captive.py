"""The command `exumob captive`."""

from __future__ import annotations

import math
from collections.abc import Callable
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich import box
from rich.table import Table

from exumob.commands.options import (
    EXPERT,
    OUTPUT,
    RUN,
    WATER,
    CellSize,
    Coarse,
    Current,
    Duration,
    Output,
    Threads,
    UnusualValues,
    VehicleFile,
    option,
    option_names,
    radians,
)
from exumob.commands.shared import (
    check_targets,
    console,
    fail,
    simulated_time_bar,
    vehicle_of,
    whatever_was_computed,
    write_or_say,
    write_result,
)
from exumob.support.quantities import DEPTH, DIRECTION, STEERING_ANGLE, WHEEL_SPEED

if TYPE_CHECKING:
    import xarray as xr


class Closure(StrEnum):
    """Turbulence models by name."""

    SMAGORINSKY = "smagorinsky"
    K_OMEGA_SST = "k-omega-sst"
    NONE = "none"


class Surface(StrEnum):
    """Transports of the free surface by name."""

    thinc = "thinc"
    plic = "plic"


def captive_command(  # one argument an option of the command line
    speed: Annotated[float, option(RUN, "Speed over ground, along the tank [m/s].")] = 1.0,
    depth: Annotated[float, option(RUN, "Depth of the water.", of=DEPTH)] = 0.12,
    current: Current = 1.0,
    vehicle: VehicleFile = None,
    current_direction: Annotated[
        float, option(WATER, "Where the current flows to, counter-clockwise from the tank's axis.", of=DIRECTION)
    ] = 180.0,
    output: Output = None,
    figure: Annotated[Path | None, option(RUN, "Draw loads and free surface here (.png, .pdf, .svg).")] = None,
    animate: Annotated[Path | None, option(OUTPUT, "Animate the free surface here (.gif or .mp4).")] = None,
    vtk: Annotated[Path | None, option(OUTPUT, "Write fields for ParaView to this folder, 20 times a second.")] = None,
    duration: Duration = 3.0,
    drift_angle: Annotated[
        float, option(EXPERT, "Course less heading [deg]; positive: the water meets the left side.")
    ] = 0.0,
    yaw_rate: Annotated[float, option(EXPERT, "Turning of course and heading, to the left [deg/s].")] = 0.0,
    steering: Annotated[float, option(EXPERT, "Angle of the front wheels, to the left.", of=STEERING_ANGLE)] = 0.0,
    wheel_speed: Annotated[float, option(EXPERT, "Spin of the wheels.", of=WHEEL_SPEED)] = 0.0,
    ramp_time: Annotated[
        float, option(EXPERT, "Time from drifting with the current to the prescribed motion [s].")
    ] = 1.0,
    cell_size: CellSize = 0.018,
    coarse: Coarse = False,
    interval: Annotated[float, option(EXPERT, "Interval at which loads are recorded [s].")] = 1e-3,
    closure: Annotated[
        Closure, option(EXPERT, "Turbulence model: Smagorinsky, k-omega SST, or none (laminar).")
    ] = Closure.SMAGORINSKY,
    surface: Annotated[
        Surface, option(EXPERT, "Transport of the free surface: thinc, or plic as a cross-check.")
    ] = Surface.thinc,
    threads: Threads = 1,
    unusual: UnusualValues = False,
) -> None:
    """Tow a vehicle through water on a prescribed path and find the loads on its five bodies.

    Example: exumob captive --speed 1 --current 1 --depth 0.12 --output run.nc --figure run.png
    """
    targets = {"--output": output, "--figure": figure, "--animate": animate}
    try:
        check_targets(targets)
        from exumob.flow import FlowSettings, KOmegaSST, Smagorinsky
        from exumob.flow.output.vtk import VtkSeries
        from exumob.flow.settings import SurfaceTransport
        from exumob.flow.vehicle_window import vehicle_window
        from exumob.support.quantities import Unusual
        from exumob.towing_tank.motion import TURN, YAW_RATE, CaptiveMotion
        from exumob.towing_tank.run import captive_run
        from exumob.water.conditions import Water

        car = vehicle_of(vehicle)
        if unusual:
            depth, current, wheel_speed, cell_size = map(Unusual, (depth, current, wheel_speed, cell_size))
        with option_names():
            water = Water(depth, current, radians("--current-direction", current_direction, DIRECTION, unusual))
            motion = CaptiveMotion(
                speed=speed, drift_angle=radians("--drift-angle", drift_angle, TURN),
                yaw_rate=radians("--yaw-rate", yaw_rate, YAW_RATE),
                steering=radians("--steering", steering, STEERING_ANGLE), wheel_speed=wheel_speed, ramp_time=ramp_time,
            )  # fmt: skip
        models: dict[Closure, Smagorinsky | KOmegaSST | None] = {
            Closure.SMAGORINSKY: Smagorinsky(), Closure.K_OMEGA_SST: KOmegaSST(), Closure.NONE: None
        }  # fmt: skip
        transport: SurfaceTransport = "plic" if surface is Surface.plic else "thinc"
        with option_names():
            settings = FlowSettings(threads=threads, closure=models[closure], surface=transport)
        snapshots = max(round(0.05 / interval), 1) * interval if (figure or animate or vtk) and interval > 0.0 else None
        series = VtkSeries(vtk, car) if vtk else None
        if series is not None and snapshots is not None:
            with option_names():
                series.require_room(vehicle_window(car, cell_size, water), 1 + int(duration / snapshots))
    except (ValueError, OSError, ImportError) as error:
        fail(error)

    lost: list[bool] = []

    def add(*instant: Any) -> None:  # a disk that is full must not cost the run
        if series is not None and not lost:
            if not write_or_say("further fields", series.folder, lambda: series.add(*instant)):
                lost.append(True)

    def run(advance: Callable[[float], None]) -> xr.Dataset:
        with option_names():
            return captive_run(
                car, water, motion, cell_size=cell_size, duration=duration, interval=interval, settings=settings,
                snapshots=snapshots, on_snapshot=add if series else None, allow_coarse=coarse, progress=advance,
            )  # fmt: skip

    with simulated_time_bar(duration) as advance:
        result, code = whatever_was_computed(lambda: run(advance), output)
    written = _report(result, targets) and not lost
    if series and series.file.exists():
        console.print(f"ParaView  {series.file}", soft_wrap=True)
    raise typer.Exit(code or (0 if written else 2))


def _report(result: xr.Dataset, targets: dict[str, Path | None]) -> bool:
    from exumob.flow.output.pictures import animate_surface
    from exumob.towing_tank.plots import plot_captive

    if result.sizes["time"] > 1:
        _print_loads(result)
    return write_result(result, targets, plot_captive, animate_surface)


def _print_loads(result: xr.Dataset) -> None:
    from exumob.towing_tank.record import captive_summary

    loads = captive_summary(result)
    table = Table(
        title=f"{result.attrs['title'].removeprefix('exumob ')}, {result.attrs['status'].split(':')[0]}",
        caption=f"mean ± standard deviation of the smoothed loads from {loads.attrs['from']:.2f} to "
        f"{loads.attrs['to']:.2f} s, body axes [N, N m]; noise: of the raw about the smoothed loads; "
        f"{result.attrs['wall_time']:.0f} s of computing",
        box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, 1, 0, 0),
    )  # fmt: skip
    for column in ("body", "load"):
        table.add_column(column, no_wrap=True)
    for column in ("x", "y", "z", "noise"):
        table.add_column(column, justify="right", no_wrap=True)
    for body in result["body"].values:
        of = loads.sel(body=body)
        for kind, name in (("force", body.replace("_", " ")), ("moment", "")):
            mean, deviation, noise = (of[f"{kind}_{what}"].values for what in ("mean", "deviation", "noise"))
            cells = [f"{m:.2f} ± {d:.2f}" for m, d in zip(mean, deviation, strict=True)]
            table.add_row(name, kind, *cells, f"{math.hypot(*noise):.2f}")
    console.print(table)
