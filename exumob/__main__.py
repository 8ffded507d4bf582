"""The command line: `exumob lane-change`, `exumob captive`, `exumob train`, `exumob soils`, `exumob verify`."""

from __future__ import annotations

import importlib
import logging
import math
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NoReturn

import typer
from rich import box
from rich.console import Console
from rich.logging import RichHandler
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

from exumob.verification.command import verify_command

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

    from exumob.hydrodynamics import Hydrodynamics
    from exumob.vehicle import Vehicle

app = typer.Typer(
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_show_locals=False,
    help="Predict how an off-road vehicle moves through shallow water on soft soil.",
)
console = Console()
errors = Console(stderr=True)


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


@app.callback()
def main() -> None:
    """Predict how an off-road vehicle moves through shallow water on soft soil."""
    logging.basicConfig(
        level=logging.WARNING, format="%(message)s", handlers=[RichHandler(console=errors, show_time=False)]
    )


@app.command("lane-change")
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
    from exumob.coupling import Coupling, Explicit, SemiImplicit, Strong
    from exumob.ensemble import add_members
    from exumob.environment import Soil, Water
    from exumob.hydrodynamics import (
        CfdHydrodynamics,
        CoefficientHydrodynamics,
        NoWater,
        SurrogateHydrodynamics,
        VehicleFlow,
    )
    from exumob.hydrodynamics.coupled import development_span
    from exumob.maneuver import lane_change
    from exumob.simulation import simulate

    targets = {"--output": output, "--figure": figure, "--animate": animate}
    try:
        _check_targets(targets)
        if (figure or animate) and duration < 0.1:
            raise ValueError(f"--duration {duration} s is too short to draw; give at least 0.1 s, or no --figure.")
        car = _vehicle(vehicle)
        wet = depth_ratio != 0.0
        water = None
        if wet:
            direction = math.radians(current_direction)
            water = Water.at_ratio(depth_ratio, current, tire_diameter=car.wheel.diameter, current_direction=direction)
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

            flow = VehicleFlow(
                cell_size, settings=FlowSettings(threads=threads), allow_coarse=coarse,
                snapshots=0.05 if animate else None,
            )  # fmt: skip
            model = developed = CfdHydrodynamics(flow, progress=lambda time: told[0](time))
            lead = development_span(developed.development, water)
            scheme = {"explicit": Explicit, "semi-implicit": SemiImplicit, "strong": Strong}[coupling.value]()
        if networks and hydrodynamics not in (WaterModel.networks, None):
            raise ValueError(f"--networks means nothing with --hydrodynamics {hydrodynamics.value}; leave one out.")
        if members and (not isinstance(model, SurrogateHydrodynamics) or len(model.networks) < 2):
            raise ValueError("--members needs networks of two seeds at least as the water; leave it out.")
        maneuver = lane_change(math.radians(steering), wheel_speed)
        ground = Soil.published(soil)
    except (ValueError, OSError, ImportError) as error:
        _fail(error)

    with _progress(duration, "settling", "driving", lead) as advance:
        told.append(advance)
        result, code = _whatever_was_computed(
            lambda: simulate(
                car, ground, water, maneuver, model, duration=duration, micro_step=micro_step, macro_step=macro_step,
                coupling=scheme, checkpoint=checkpoint, resume=resume, progress=advance,
            ),
            output,
        )  # fmt: skip
    if members and not code:
        assert isinstance(model, SurrogateHydrodynamics)
        try:
            with _progress(duration, "settling", "members") as advance:
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


@app.command("captive")
def captive_command(
    speed: Annotated[float, typer.Option(help="Speed over ground, along the tank [m/s].")] = 1.0,
    current: Annotated[float, typer.Option(help="Speed of the current [m/s].")] = 1.0,
    current_direction: Annotated[
        float, typer.Option(help="Where the flow goes, from the tank's axis, to the left [deg].")
    ] = 180.0,
    depth: Annotated[float, typer.Option(help="Depth of the water [m].")] = 0.12,
    drift_angle: Annotated[
        float, typer.Option(help="Course less heading [deg]; positive: the water meets the left side.")
    ] = 0.0,
    yaw_rate: Annotated[float, typer.Option(help="Turning of course and heading, to the left [deg/s].")] = 0.0,
    steering: Annotated[float, typer.Option(help="Angle of the front wheels, to the left [deg].")] = 0.0,
    wheel_speed: Annotated[float, typer.Option(help="Spin of the wheels [rad/s].")] = 0.0,
    ramp_time: Annotated[
        float, typer.Option(help="Time from drifting with the current to the prescribed motion [s].")
    ] = 1.0,
    vehicle: Annotated[
        Path | None, typer.Option(help="Vehicle file (Python); default: the paper's 57 kg amphibious vehicle.")
    ] = None,
    cell_size: Annotated[float, typer.Option(help="Of the grid round the vehicle [m].")] = 0.018,
    coarse: Annotated[
        bool, typer.Option("--coarse", help="Accept cells too coarse for gaps and wheels: a quick look.")
    ] = False,
    duration: Annotated[float, typer.Option(help="Simulated time [s].")] = 3.0,
    interval: Annotated[float, typer.Option(help="At which loads are recorded [s].")] = 1e-3,
    threads: Annotated[int, typer.Option(help="Threads of the flow solver.")] = 1,
    output: Annotated[Path | None, typer.Option(help="Write the result here (netCDF).")] = None,
    figure: Annotated[Path | None, typer.Option(help="Draw loads and free surface here (.png, .pdf, .svg).")] = None,
    animate: Annotated[Path | None, typer.Option(help="Animate the free surface here (.gif or .mp4).")] = None,
    vtk: Annotated[
        Path | None, typer.Option(help="Write fields for ParaView to this folder, 20 times a second.")
    ] = None,
) -> None:
    """Tow a vehicle through water on a prescribed path and find the loads on its five bodies.

    Example: exumob captive --speed 1 --current 1 --depth 0.12 --output run.nc --figure run.png
    """
    targets = {"--output": output, "--figure": figure, "--animate": animate}
    try:
        _check_targets(targets)
        from exumob.environment import Water
        from exumob.flow import CaptiveMotion, FlowSettings, captive_run
        from exumob.flow.vtk_files import VtkSeries

        car = _vehicle(vehicle)
        water = Water(depth, current, math.radians(current_direction))
        motion = CaptiveMotion(
            speed=speed, drift_angle=math.radians(drift_angle), yaw_rate=math.radians(yaw_rate),
            steering=math.radians(steering), wheel_speed=wheel_speed, ramp_time=ramp_time,
        )  # fmt: skip
        settings = FlowSettings(threads=threads)
        series = VtkSeries(vtk, car) if vtk else None
    except (ValueError, OSError, ImportError) as error:
        _fail(error)

    with _progress(duration) as advance:
        result, code = _whatever_was_computed(
            lambda: captive_run(
                car, water, motion, cell_size=cell_size, duration=duration, interval=interval, settings=settings,
                snapshots=max(round(0.05 / interval), 1) * interval if figure or animate or vtk else None,
                on_snapshot=series.add if series else None, allow_coarse=coarse, progress=advance,
            ),
            output,
        )  # fmt: skip
    _report_captive(result, targets)
    if series:
        console.print(f"ParaView  {series.file}", highlight=False)
    raise typer.Exit(code)


@app.command("train")
def train_command(
    preset: Annotated[list[str] | None, typer.Option(help="What to train, by name; repeatable. Default: all.")] = None,
    data: Annotated[Path, typer.Option(help="Folder of CFD-MBD runs (packed or imported, netCDF).")] = Path(
        "data/cfd_mbd"
    ),
    seeds: Annotated[int, typer.Option(help="Networks of each body: seeds 0, 1, ...")] = 5,
    output: Annotated[Path, typer.Option(help="Folder for the networks.")] = Path("networks"),
    vehicle: Annotated[
        Path | None, typer.Option(help="Vehicle file of the runs; default: the paper's 57 kg amphibious vehicle.")
    ] = None,
    jobs: Annotated[int, typer.Option(help="Processes, one thread each.")] = 2,
) -> None:
    """Train networks for the water's loads from runs with the flow in the loop.

    What is finished is kept at once; the same command goes on where it was stopped.

    Example: exumob train --preset paper-lstm --seeds 5 --output networks
    """
    try:
        from exumob.learning.presets import PRESETS
        from exumob.learning.training import Progress as Step
        from exumob.learning.training import train, training_runs

        wanted = list(dict.fromkeys(preset or PRESETS))
        unknown = [name for name in wanted if name not in PRESETS]
        if unknown:
            raise ValueError(f"--preset {unknown[0]} is not known; use {', '.join(PRESETS)}.")
        if seeds < 1 or jobs < 1:
            raise ValueError(f"--seeds {seeds} and --jobs {jobs} must be at least 1.")
        runs = training_runs(data)
        car = _vehicle(vehicle)
        output.mkdir(parents=True, exist_ok=True)
    except (ValueError, OSError) as error:
        _fail(error)
    except ImportError as error:
        _fail(ImportError(f"{error}; training needs torch: pip install 'exumob[train]'"))

    with Progress(
        TextColumn("{task.description}"), BarColumn(), TextColumn("{task.completed} of {task.total} networks"),
        TimeRemainingColumn(), console=errors, transient=True,
    ) as bar:  # fmt: skip
        task = bar.add_task("training", total=5 * seeds * len(wanted))

        def told(step: Step) -> None:
            name = f"{step.preset}, seed {step.seed}, {step.body}"
            bar.update(task, description=f"{name}: epoch {step.epoch}, {step.loss:.4f}", advance=1 if step.done else 0)
            if step.done:
                console.print(f"{name}: {step.epoch} epochs, held-back error {step.loss:.4f}", highlight=False)

        try:
            files = train([PRESETS[n] for n in wanted], runs, car, output, seeds=range(seeds), jobs=jobs, told=told)
        except (ValueError, RuntimeError) as error:
            _fail(error)
        except KeyboardInterrupt:
            errors.print(f"Stopped; the same command goes on with {output}.", highlight=False)
            raise typer.Exit(130) from None
    import matplotlib

    matplotlib.use("Agg")
    from exumob.hydrodynamics.networks import NetworkSet
    from exumob.plotting import plot_learning_curves, save_figure

    for name in wanted:
        sets = [NetworkSet.load(file) for (preset_name, _), file in files.items() if preset_name == name]
        curves = save_figure(plot_learning_curves(sets), output / f"{name}_curves.png")
        console.print(f"{name}: {len(sets)} files in {output}, learning curves {curves}", highlight=False)


@app.command("sweep")
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
    from exumob.sweeps.runner import Progress as Reached
    from exumob.sweeps.runner import sweep
    from exumob.sweeps.study import from_options, read_study

    try:
        if study is not None and (vary or setting or vehicle):
            raise ValueError("give a study file, or --vary, --set and --vehicle; not both.")
        if study is not None:
            experiment, cases = read_study(study)
        else:
            experiment, cases = from_options(vehicle, setting or [], vary or [], samples, seed)
        with Progress(
            TextColumn("{task.description}"), BarColumn(), TextColumn("{task.completed} of {task.total} cases"),
            TimeRemainingColumn(), console=errors, transient=True,
        ) as bar:  # fmt: skip
            task = bar.add_task("sweep", total=len(cases))

            def told(reached: Reached) -> None:
                bar.update(task, completed=reached.done)

            result = sweep(
                experiment, cases, output, workers=workers, time_limit=time_limit, keep_runs=keep_runs,
                again=again or [], mpi=mpi, progress=told,
            )  # fmt: skip
    except (ValueError, RuntimeError, OSError) as error:
        _fail(error)
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


@app.command("export")
def export_command(
    networks: Annotated[Path, typer.Argument(help="File of networks (.safetensors).")],
    output: Annotated[Path, typer.Option(help="Write the ONNX graph here (.onnx).")],
) -> None:
    """Write networks as an ONNX graph, for other programs.

    Example: exumob export networks/residual_seed0.safetensors --output residual.onnx
    """
    from exumob.hydrodynamics.networks import NetworkSet

    try:
        _check_targets({"--output": output})
        if output.suffix != ".onnx":
            raise ValueError(f"--output {output} must end in .onnx.")
        found = NetworkSet.load(networks)
        from exumob.learning.onnx_export import export_onnx

        file = export_onnx(found, output)
    except (ValueError, OSError) as error:
        _fail(error)
    except ImportError as error:
        _fail(ImportError(f"{error}; the export needs onnx: pip install 'exumob[onnx]'"))
    base = found.architecture.base
    added = "" if base == "none" else f"; to its loads those of the model '{base}' are to be added"
    console.print(f"{file}: {found.name}{added}", highlight=False)


@app.command()
def soils() -> None:
    """List the published soils with their Bekker-Wong parameters."""
    from exumob.environment import Soil

    table = Table(
        title="Published soils (Wong, Theory of Ground Vehicles)",
        caption="k_c in kN/m^(n+1), k_phi in kN/m^(n+2), c in kPa, phi in deg, K in mm\n"
        "* and all c1, c2: chosen by class of soil",
        box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, 1, 0, 0),
    )  # fmt: skip
    table.add_column("soil", no_wrap=True)
    for column in ("n", "k_c", "k_phi", "c", "phi", "K", "c1", "c2"):
        table.add_column(column, justify="right", no_wrap=True)
    for row in Soil.published_table():
        soil = row.soil
        shear = f"{1e3 * soil.shear_modulus_x:.0f}{'' if row.shear_modulus_published else '*'}"
        stiffness = f"{soil.k_c / 1e3:.4g}", f"{soil.k_phi / 1e3:.4g}"
        strength = f"{soil.cohesion / 1e3:.3g}", f"{math.degrees(soil.friction_angle):.1f}"
        table.add_row(
            row.name, f"{soil.n:g}", *stiffness, *strength, shear, *(f"{c:.2f}"[1:] for c in (soil.c1, soil.c2))
        )
    console.print(table)


app.command("verify")(verify_command)


@contextmanager
def _progress(
    duration: float, before: str = "preparing", during: str = "towing", lead: float = 0.0
) -> Iterator[Callable[[float], None]]:
    """Bar with the time remaining; yields what takes the simulated time reached [s], from -lead on."""
    with Progress(
        TextColumn("{task.description}"), BarColumn(), TextColumn("{task.fields[now]:.2f} of {task.fields[end]:g} s"),
        TimeRemainingColumn(), console=errors, transient=True,
    ) as bar:  # fmt: skip
        task = bar.add_task(before, total=duration + lead, now=-lead, end=duration)

        def reached(time: float) -> None:
            bar.update(
                task, completed=time + lead, now=time, description=during if time > 0.0 else "developing the water"
            )  # fmt: skip

        yield reached


def _whatever_was_computed(run: Callable[[], xr.Dataset], output: Path | None) -> tuple[xr.Dataset, int]:
    """Result of a run, whole or up to where it broke or was stopped, and the exit code that says which."""
    from exumob.errors import SimulationError, SimulationInterrupted

    try:
        return run(), 0
    except (ValueError, OSError, ImportError) as error:
        _fail(error)
    except SimulationError as error:
        if error.result is None:
            _fail(error)
        errors.print(f"[red]{error}[/red]\nWhat was computed until then follows.", highlight=False)
        if output is not None and error.state is not None:
            import numpy as np

            target = output.with_suffix(".state.npz")
            np.savez(target, **error.state)
            errors.print(f"Flow before the failed step (FlowSolver.restore): {target}", highlight=False, soft_wrap=True)
        return error.result, 1
    except SimulationInterrupted as stop:
        errors.print(f"[yellow]{stop}[/yellow]; what was computed until then follows.", highlight=False)
        return stop.result, 130


def _vehicle(file: Path | None) -> Vehicle:
    """Of a vehicle file; the paper's without one."""
    from exumob.vehicle import load_vehicle

    if file is not None:
        return load_vehicle(file)
    paper: Vehicle = importlib.import_module("vehicle_models.amphibious").amphibious_vehicle()
    return paper


def _networks(files: list[Path] | None, car: Vehicle, required: bool) -> Hydrodynamics:
    """Networks, or the coefficient model where none fit the vehicle and nobody asked for them."""
    from exumob.hydrodynamics import CoefficientHydrodynamics, SurrogateHydrodynamics

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


def _fail(error: Exception) -> NoReturn:
    errors.print(f"[red]{error}[/red]", highlight=False, soft_wrap=True)
    raise typer.Exit(2)


def _check_targets(targets: dict[str, Path | None]) -> None:
    """Find out before the run that a file cannot be written after it."""
    for option, path in targets.items():
        if path is None:
            continue
        if not path.parent.is_dir():
            raise ValueError(f"{option} {path}: the folder {path.parent} does not exist; create it first.")
        if path.is_dir():
            raise ValueError(f"{option} {path}: this is a folder; give a file name.")
        try:
            with tempfile.TemporaryFile(dir=path.parent):
                pass
        except OSError as error:
            raise ValueError(f"{option} {path}: the folder cannot be written ({error.strerror}).") from None
    for option, endings in (("--figure", (".png", ".pdf", ".svg")), ("--animate", (".gif", ".mp4"))):
        path = targets.get(option)
        if path is not None and path.suffix not in endings:
            known = ", ".join(endings[:-1]) + f" or {endings[-1]}"
            raise ValueError(f"{option} {path}: the ending {path.suffix!r} is not known; use {known}.")


def _report(result: xr.Dataset, targets: dict[str, Path | None]) -> None:
    from exumob.plotting import animate_run, plot_run
    from exumob.results import summary

    if result.sizes["time"] > 1:
        _print_summary(result, summary(result))
    animate: Callable[[xr.Dataset, Path], None] = animate_run
    if "hydrodynamics_elevation" in result:
        from exumob.flow.pictures import animate_surface as animate
    _write(result, targets, plot_run, animate)


def _report_captive(result: xr.Dataset, targets: dict[str, Path | None]) -> None:
    from exumob.flow.pictures import animate_surface, plot_captive

    if result.sizes["time"] > 1:
        _print_loads(result)
    _write(result, targets, plot_captive, animate_surface)


def _write(
    result: xr.Dataset, targets: dict[str, Path | None], plot: Callable[[xr.Dataset], Figure],
    animate: Callable[[xr.Dataset, Path], None],
) -> None:  # fmt: skip
    """Write the result, and draw it where that was asked for."""
    from exumob.results import save_dataset

    if targets["--output"]:
        console.print(f"result    {save_dataset(result, targets['--output'])}", highlight=False)
    if not (targets["--figure"] or targets["--animate"]):
        return
    if result.sizes["time"] < 3:
        errors.print("[yellow]too little was computed to draw it[/yellow]")
        return
    import matplotlib

    matplotlib.use("Agg")
    from exumob.plotting import save_figure

    if targets["--figure"]:
        console.print(f"figure    {save_figure(plot(result), targets['--figure'])}", highlight=False)
    if targets["--animate"]:
        with errors.status("drawing the animation"):
            animate(result, targets["--animate"])
        console.print(f"animation {targets['--animate']}", highlight=False)


def _print_loads(result: xr.Dataset) -> None:
    from exumob.flow import captive_summary

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


def _print_summary(result: xr.Dataset, figures: dict[str, float]) -> None:
    from exumob.plotting import scenario_name

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


if __name__ == "__main__":
    app()
