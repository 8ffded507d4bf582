"""What the commands that drive a vehicle share: options of the water's model and of the run, and the run itself."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer

from exumob.commands.options import (
    EXPERT,
    GROUND,
    OUTPUT,
    WATER,
    option,
    option_names,
    radians,
    refuse_without_effect,
)
from exumob.commands.report import report_run
from exumob.commands.shared import check_targets, errors, fail, simulated_time_bar, whatever_was_computed
from exumob.simulation.settings import RECORD_STEP, SETTINGS, setting_named

if TYPE_CHECKING:
    import xarray as xr

    from exumob.coupling.flow_in_loop import CfdHydrodynamics
    from exumob.coupling.scheme import Coupling
    from exumob.driving.maneuver import Maneuver
    from exumob.ground.soil import Soil
    from exumob.ground.terrain import Terrain
    from exumob.simulation.second_opinion import Outcome
    from exumob.vehicle.parameters import Vehicle
    from exumob.vehicle.start_pose import StartPose
    from exumob.water.conditions import Water
    from exumob.water.hydrodynamics import Hydrodynamics


class WaterModel(StrEnum):
    """Models of the water's loads by name."""

    auto = "auto"
    networks = "networks"
    calibrated = "calibrated"
    coefficients = "coefficients"
    cfd = "cfd"
    none = "none"


class Scheme(StrEnum):
    """Schemes by which vehicle and flow agree within a macro step."""

    explicit = "explicit"
    semi_implicit = "semi-implicit"
    strong = "strong"


ModelOption = Annotated[
    WaterModel,
    option(
        WATER,
        "Model of the water's loads. auto: networks where they fit the vehicle, else calibrated: published "
        "coefficients and fitted loads of the vehicle's waves; cfd: the flow solver in the loop (half an hour to an "
        "hour on 18 mm cells).",
    ),
]
Members = Annotated[bool, option(WATER, "Drive with each network alone, too: error bars on the path.", "--members")]
CheckpointFile = Annotated[
    Path | None, option(OUTPUT, "Keep the whole run in this file (.npz), every half second of simulated time.")
]
Resume = Annotated[
    bool, option(OUTPUT, "Go on from the checkpoint, if there is one, with the same bits.", "--resume")
]  # fmt: skip
SoilValue = Annotated[
    list[str] | None,
    option(
        GROUND,
        "A value of one's own in place of the soil's: NAME=VALUE in SI units, friction_angle in degrees; again for "
        "others.",
    ),
]
CouplingScheme = Annotated[Scheme, option(EXPERT, "Scheme by which vehicle and flow agree within a macro step (cfd).")]
SYMBOLS = {"phi": "friction_angle", "c": "cohesion", "K": "shear_modulus_x", "K_x": "shear_modulus_x",
           "K_y": "shear_modulus_y", "kc": "k_c", "kphi": "k_phi"}  # fmt: skip
"""Fields of a soil by their symbols."""
CELLS = 0.0575
"""Width of the flow solver's cells over the tyre's diameter: 11.5 mm for the paper's vehicle."""
SNAPSHOTS = 0.05
"""Interval at which the free surface is kept for an animation [s]."""
FLOW = ("cell_size", "coarse", "coupling", "threads")
"""Arguments of a command that belong to the flow in the loop."""


@dataclass(frozen=True)
class Scene:
    """What is driven, and where."""

    vehicle: Vehicle
    soil: Soil
    water: Water | None
    maneuver: Maneuver
    duration: float
    """[s]"""
    initial_speed: float | None
    """[m/s]"""
    terrain: Terrain | None = None
    start: StartPose | None = None


@dataclass(frozen=True)
class FlowOptions:
    """Options of the flow solver in the loop."""

    cell_size: float
    coarse: bool
    threads: int
    coupling: Scheme
    snapshots: float | None


@dataclass(frozen=True)
class RunOptions:
    """How a run is computed, and what is kept of it."""

    model: WaterModel
    networks: list[Path] | None
    members: bool
    setting: str
    micro_step: float | None
    macro_step: float | None
    checkpoint: Path | None
    resume: bool
    targets: dict[str, Path | None]
    measured: bool
    """Whether the error of the setting was measured for such a run"""

    def check(self, duration: float | None) -> None:
        """Find out before the run what cannot be written or drawn after it.

        Raises
        ------
        ValueError
            With the option.
        """
        fresh = None if self.checkpoint is None or self.checkpoint.exists() else self.checkpoint
        check_targets({**self.targets, "--checkpoint": fresh})
        if (self.targets["--figure"] or self.targets["--animate"]) and duration is not None and duration < 0.1:
            raise ValueError(f"--duration {duration} s is too short to draw; give at least 0.1 s, or no --figure.")

    @property
    def record_step(self) -> float:
        """Interval at which results are recorded [s]: with the flow in the loop one from which networks can learn."""
        if self.model != WaterModel.cfd:
            return RECORD_STEP
        from exumob.learning.dataset import SAMPLING

        micro_step = setting_named(self.setting).flow_micro_step if self.micro_step is None else self.micro_step
        steps = SAMPLING / micro_step if micro_step else math.inf  # a step that cannot be is refused later
        return SAMPLING if math.isfinite(steps) and abs(steps - round(steps)) < 1e-9 else RECORD_STEP


def check_effects(
    water: bool, dry: str, current: float, model: WaterModel, micro_step: float | None, macro_step: float | None
) -> None:
    """Refuse options that were given and change nothing in this run.

    Parameters
    ----------
    water : bool
        Whether there is any.
    dry : str
        How dry ground is asked for, and how water: two texts, parted by a semicolon.
    current : float
        [m/s]
    model : WaterModel
    micro_step, macro_step : float, optional
        [s]

    Raises
    ------
    ValueError
        Naming them, and what would give them an effect.
    """
    if not water:
        wet = [*(("current",) if current != 0.0 else ()), "current_direction", "networks", "members", *FLOW]
        if model not in (WaterModel.auto, WaterModel.none):
            wet.append("hydrodynamics")
        why, give = dry.split(";")
        refuse_without_effect(f"on dry ground{why}", f"leave {{it}} out, or give {give}", *wet)
    if model is WaterModel.none:
        wet = ["current_direction", *(("current",) if current != 0.0 else ())]
        refuse_without_effect("with --hydrodynamics none", "leave {it} out, or choose another --hydrodynamics", *wet)
    if model is not WaterModel.cfd:
        refuse_without_effect(
            f"with --hydrodynamics {model.value}", "add --hydrodynamics cfd, or leave {it} out", *FLOW
        )
    if model not in (WaterModel.networks, WaterModel.auto, WaterModel.calibrated):
        remedy = "leave one out, or choose --hydrodynamics networks"
        refuse_without_effect(f"with --hydrodynamics {model.value}", remedy, "networks", "members")
    if micro_step is not None and macro_step is not None:
        refuse_without_effect("beside --micro-step and --macro-step, which it stands for", "leave {it} out", "setting")


def model_named(
    model: WaterModel, vehicle: Vehicle, water: Water | None, networks: list[Path] | None
) -> Hydrodynamics:  # fmt: skip
    """Make a model of the water's loads, but for the flow in the loop.

    Raises
    ------
    ValueError
        If a file of networks is named twice, or `exumob.simulation.water_models.hydrodynamics_named` refuses it.
    """
    from exumob.simulation.water_models import hydrodynamics_named
    from exumob.surrogates.ensemble import require_different

    require_different("--networks", networks or [])
    name = "none" if model is WaterModel.cfd else model.value
    return hydrodynamics_named(name, vehicle, water, networks=networks)


def drive(
    options: RunOptions,
    scene_of: Callable[[], Scene],
    flow_of: Callable[[Scene], FlowOptions],
    say: Callable[[Scene], None] = lambda scene: None,
    report: Callable[[xr.Dataset], bool] | None = None,
    outcome: Callable[[xr.Dataset], Outcome] | None = None,
) -> NoReturn:
    """Make a scene, run it, say what came of it, write its files and leave with an exit code.

    Parameters
    ----------
    options : RunOptions
    scene_of : callable
        Makes the scene; a ValueError, OSError or ImportError is the user's to mend.
    flow_of : callable
        Options of the flow solver for this scene; only asked for where it is in the loop.
    say : callable
        Says before the run what was chosen.
    report : callable, optional
        Says what came of it and writes its files, True if all of them were written; default: the summary of a run.
    outcome : callable, optional
        What counts of a run when models are compared; default: its verdict, at its end.
    """
    from exumob.simulation.ensemble import add_members
    from exumob.simulation.run import simulate
    from exumob.simulation.second_opinion import second_opinion, verdict_outcome
    from exumob.surrogates.model import SurrogateHydrodynamics

    outcome = outcome or verdict_outcome
    progress: list[Callable[[float], None]] = []
    scheme: Coupling | None = None
    lead = 0.0
    model: Hydrodynamics
    try:
        scene = scene_of()
        if scene.water is not None and options.model is WaterModel.cfd:
            flow = flow_of(scene)
            with option_names():
                model, lead = _flow_in_loop(flow, scene.vehicle, scene.water, lambda time: progress[0](time))
            scheme = _scheme(flow.coupling)
        else:
            model = model_named(options.model, scene.vehicle, scene.water, options.networks)
        if options.members and (not isinstance(model, SurrogateHydrodynamics) or len(model.networks) < 2):
            raise ValueError("--members needs networks of two seeds at least as the water; leave it out.")
        say(scene)
    except (ValueError, OSError, ImportError) as error:
        fail(error)
    steps: dict[str, Any] = {
        "duration": scene.duration, "setting": options.setting, "micro_step": options.micro_step,
        "macro_step": options.macro_step, "initial_speed": scene.initial_speed, "terrain": scene.terrain,
        "start": scene.start, "record_step": options.record_step,
    }  # fmt: skip

    def run(advance: Callable[[float], None]) -> xr.Dataset:
        with option_names():
            return simulate(
                scene.vehicle, scene.soil, scene.water, scene.maneuver, model, **steps, coupling=scheme,
                checkpoint=options.checkpoint, resume=options.resume, progress=advance,
            )  # fmt: skip

    with simulated_time_bar(scene.duration, "settling", "driving", lead) as advance:
        progress.append(advance)
        result, code = whatever_was_computed(lambda: run(advance), options.targets["--output"])
    given = scene.vehicle, scene.soil, scene.water, scene.maneuver
    if options.members and not code:
        assert isinstance(model, SurrogateHydrodynamics)
        result, code = _beside(
            result, "members", scene, 1, lambda advance: add_members(result, *given, model, progress=advance, **steps)
        )
    if not code and _is_doubtful(result, model):
        result, code = _beside(
            result, "second opinion", scene, 0,
            lambda advance: second_opinion(result, *given, outcome=outcome, progress=advance, **steps),
        )  # fmt: skip
    if code and options.checkpoint is not None and options.checkpoint.exists():
        errors.print(f"{options.checkpoint} holds the run: the same command with --resume goes on.", soft_wrap=True)
    setting = f"{options.setting}: {SETTINGS[options.setting].error}" if options.measured else ""
    written = report_run(result, options.targets, setting) if report is None else report(result)
    raise typer.Exit(code or (0 if written else 2))


def _beside(
    result: xr.Dataset, what: str, scene: Scene, failed: int, more: Callable[[Callable[[float], None]], xr.Dataset]
) -> tuple[xr.Dataset, int]:
    """Add to a finished run what further drives say; return it, or if they fail the run as it was, and an exit code."""
    try:
        with simulated_time_bar(scene.duration, "settling", what) as advance, option_names():
            return more(advance), 0
    except KeyboardInterrupt:
        errors.print(f"Stopped at the {what}; the run itself, which is whole, follows.", style="yellow")
        return result, 130
    except Exception as error:  # whatever it is: what was computed is not lost by what is added to it
        said = f"{type(error).__name__}: {error}".rstrip(". ")
        errors.print(f"No {what} ({said}). The run itself, which is whole, follows.", style="yellow", soft_wrap=True)
        return result, failed


def _is_doubtful(result: xr.Dataset, model: Hydrodynamics) -> bool:
    """Tell if no run like this one was compared with the flow, and published coefficients are another opinion."""
    from exumob.coupling.flow_in_loop import CfdHydrodynamics
    from exumob.water.coefficients import CoefficientHydrodynamics
    from exumob.water.hydrodynamics import NoWater

    asked = isinstance(model, CfdHydrodynamics | NoWater) or type(model) is CoefficientHydrodynamics
    return not asked and result.attrs.get("trust_status") == "not validated"


def cells_of(vehicle: Vehicle) -> float:
    """Return the usual width of the flow solver's cells round a vehicle [m]."""
    return CELLS * vehicle.wheel.diameter


def soil_with(name: str, values: list[str]) -> Soil:
    """Return a published soil, with values of one's own (`SoilValue`).

    Raises
    ------
    ValueError
        If a name is not known or stands twice, or a value is no number or out of bounds.
    """
    from exumob.ground.soil import Soil
    from exumob.support.declared import declared_fields, nearest_names

    soil = Soil.published(name)
    names = {field.name: field.quantity for field in declared_fields(Soil) if field.quantity is not None}
    changed: dict[str, float] = {}
    for text in values:
        key, _, number = text.partition("=")
        if key not in names:
            near = [SYMBOLS[key]] if key in SYMBOLS else nearest_names(key, list(names))
            raise ValueError(
                f"--soil-value {text!r:.60} is not known; use {near[0] if near else ', '.join(names)}=VALUE."
            )
        if key in changed:
            raise ValueError(f"--soil-value {key} stands twice; give it once.")
        try:
            changed[key] = float(number)
        except ValueError:
            raise ValueError(f"--soil-value {text!r:.60} holds no number; give {key}=VALUE.") from None
        if names[key].unit == "rad":
            changed[key] = radians(f"--soil-value {key}", changed[key], names[key])
    try:
        return replace(soil, **changed, name=f"{soil.name}, changed") if changed else soil  # type: ignore[arg-type]
    except ValueError as error:
        raise ValueError(str(error).replace("Soil.", "--soil-value ")) from None


def _flow_in_loop(
    flow: FlowOptions, vehicle: Vehicle, water: Water, progress: Callable[[float], None]
) -> tuple[CfdHydrodynamics, float]:
    """Make the flow solver in the loop; the time before the release [s] comes with it."""
    from exumob.coupling.flow_code import BuiltInFlow
    from exumob.coupling.flow_in_loop import CfdHydrodynamics
    from exumob.flow import FlowSettings

    code = BuiltInFlow(
        flow.cell_size, settings=FlowSettings(threads=flow.threads), allow_coarse=flow.coarse, snapshots=flow.snapshots
    )
    model = CfdHydrodynamics(code, progress=progress)
    return model, model.spin_up.for_vehicle(vehicle).duration(water)


def _scheme(name: Scheme) -> Coupling:
    from exumob.coupling.explicit import Explicit
    from exumob.coupling.semi_implicit import SemiImplicit
    from exumob.coupling.strong import Strong

    return {Scheme.explicit: Explicit, Scheme.semi_implicit: SemiImplicit, Scheme.strong: Strong}[name]()
