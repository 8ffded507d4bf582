"""Options that several commands share, and the panels of their help.

A command lists its options in panels, those that a beginner needs first: `RUN`, `WATER`, `GROUND`, `OUTPUT`, `EXPERT`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from enum import StrEnum
from itertools import pairwise
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any

import typer
from typer.core import TyperCommand

from exumob.commands.shared import errors, fail
from exumob.commands.terminal import visible
from exumob.support.quantities import CELL_SIZE, CURRENT_SPEED, DIRECTION, DURATION, STEP, Quantity, Unusual

RUN = "Run"
WATER = "Water"
GROUND = "Ground and start"
OUTPUT = "Output"
EXPERT = "Expert"
GIVEN_BY = ("COMMANDLINE", "ENVIRONMENT", "PROMPT")
"""Sources of a parameter that is not at its default."""
_GIVEN: ContextVar[Mapping[str, str]] = ContextVar("_GIVEN", default=MappingProxyType({}))
"""Flags of the options that the command was given, by the names of its arguments."""


def given(*names: str) -> list[str]:
    """Return the flags of those of these arguments that the command was given, be it with their default value."""
    return [_GIVEN.get()[name] for name in names if name in _GIVEN.get()]


def refuse_without_effect(why: str, remedy: str, *names: str) -> None:
    """Refuse options that were given and change nothing.

    Parameters
    ----------
    why : str
        What keeps them from having an effect, after "has no effect".
    remedy : str
        What to do; ``{it}`` stands for the options.
    names : str
        Names of the command's arguments.

    Raises
    ------
    ValueError
        Naming those that were given.
    """
    if flags := given(*names):
        *first, last = flags
        verb = "have" if first else "has"
        said = remedy.format(it="them" if first else "it")
        raise ValueError(f"{', '.join(first)}{' and ' if first else ''}{last} {verb} no effect {why}; {said}.")


def _flag(parameter: Any) -> str:
    return next((flag for flag in parameter.opts if flag.startswith("--")), parameter.name.upper())


class PanelCommand(TyperCommand):
    """A command whose help shows its options in panels, in plain text."""

    def parse_args(self, ctx: Any, args: list[str]) -> Any:
        """Read the options; what is said of a number that cannot be read shows what was given."""
        words = list(args)
        try:
            return super().parse_args(ctx, args)
        except typer.BadParameter as error:
            flags = getattr(error.param, "opts", [])
            given = next((text for flag in flags if (text := _value_of(flag, words)) is not None), None)
            if given is not None and "unable to parse" in error.message:
                whole = "integer" in error.message
                kind, remedy = ("whole number", "such as 2") if whole else ("number", "without its unit, see --help")
                error.message = f"'{visible(given)}' is not a {kind}; give one {remedy}."
            raise

    def invoke(self, ctx: Any) -> Any:
        """Run the command; where the system refuses a file that nothing else has asked about, say so."""
        sources = ((parameter, ctx.get_parameter_source(parameter.name)) for parameter in self.get_params(ctx))
        _GIVEN.set({p.name: _flag(p) for p, source in sources if source is not None and source.name in GIVEN_BY})
        try:
            return super().invoke(ctx)
        except BrokenPipeError:
            raise
        except OSError as error:
            fail(error)

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Write a section for each panel, in the order in which the panels first appear."""
        panels: dict[str, list[tuple[str, str]]] = {RUN: [], WATER: [], GROUND: [], OUTPUT: [], EXPERT: []}
        for parameter in self.get_params(ctx):
            row = parameter.get_help_record(ctx)
            if row is not None:
                panels.setdefault(getattr(parameter, "rich_help_panel", None) or RUN, []).append(row)
        for panel, rows in panels.items():
            if rows:
                with formatter.section(panel):
                    formatter.write_dl(rows)


def _value_of(flag: str, words: list[str]) -> str | None:
    """Return the last value that the words of a command line give to a flag; None if it is not there."""
    after = [word for before, word in pairwise(words) if before == flag]
    joined = [word.removeprefix(f"{flag}=") for word in words if word.startswith(f"{flag}=")]
    found = after + joined
    return found[-1] if found else None


def option(panel: str, text: str, *flags: str, of: Quantity | None = None) -> Any:
    """Declare an option of a panel.

    Parameters
    ----------
    panel, text : str
        Where it stands in the help, and what that says.
    flags : str
        Its flags, where they are not made from its name.
    of : Quantity, optional
        What it gives; the help says its unit and its limits, angles in degrees.
    """
    return typer.Option(*flags, help=text if of is None else f"{text} [{_limits(of)}]", rich_help_panel=panel)


def _limits(quantity: Quantity) -> str:
    """Unit and range of a quantity as it is given at the command line."""
    size = 180.0 / math.pi if quantity.unit == "rad" else 1.0
    unit = "deg" if quantity.unit == "rad" else "-" if quantity.unit == "1" else quantity.unit
    low, high = quantity.plausible or (quantity.at_least, quantity.at_most)
    return f"{unit}, {size * low:g} to {size * high:g}" if math.isfinite(low) and high < 1e5 else unit


class SettingName(StrEnum):
    """The steps of a run by name."""

    fast = "fast"
    fine = "fine"


Networks = Annotated[
    list[Path] | None,
    option(
        WATER,
        "File of networks that `exumob train` or `learn` wrote; several, each after a --networks of its own, are an "
        "ensemble. With exumob come paper-lstm, the paper's, and full-range, for 20 to 90 % depth. Default: those for "
        "lane changes, and full-range beyond their range. With the "
        "model calibrated: the coefficients that were fitted to the runs of these networks.",
    ),
]
VehicleFile = Annotated[
    Path | None,
    option(
        RUN,
        "Vehicle file (Python), or the name of one that comes with exumob, such as small_car. Default: the paper's "
        "57 kg amphibious vehicle.",
    ),
]
SoilName = Annotated[str, option(RUN, "A published soil by its name; `exumob soils` lists them.")]
Duration = Annotated[float, option(EXPERT, "Simulated time.", of=DURATION)]
Current = Annotated[float, option(RUN, "Speed of the current.", of=CURRENT_SPEED)]
CurrentDirection = Annotated[
    float,
    option(
        WATER,
        "Where the current flows to, counter-clockwise from the first heading; 180: a head current.",
        of=DIRECTION,
    ),
]
Output = Annotated[Path | None, option(RUN, "Write the result here (netCDF).")]
Figure = Annotated[Path | None, option(RUN, "Draw the result here (.png, .pdf, .svg).")]
Animation = Annotated[Path | None, option(OUTPUT, "Animate the run here (.gif or .mp4).")]
SettingOption = Annotated[
    SettingName,
    option(EXPERT, "Steps by name. fast ends within 0.2 % of fine, which takes about eight times as long."),
]
MicroStep = Annotated[float | None, option(EXPERT, "Step of the multibody solver. Default: by the setting.", of=STEP)]
MacroStep = Annotated[
    float | None, option(EXPERT, "Interval at which the water's loads are renewed. Default: by the setting.", of=STEP)
]
CellSize = Annotated[float, option(EXPERT, "Width of the flow solver's cells round the vehicle.", of=CELL_SIZE)]
Coarse = Annotated[
    bool, option(EXPERT, "Accept cells too coarse for gaps and wheels: a quick look.", "--coarse")
]  # fmt: skip
Threads = Annotated[int, option(EXPERT, "Threads of the flow solver.")]
Workers = Annotated[int, option(EXPERT, "Processes that run side by side.")]
UnusualValues = Annotated[
    bool, option(EXPERT, "Accept values that are possible but outside their plausible range.", "--unusual")
]  # fmt: skip
Seed = Annotated[int, option(EXPERT, "Seed of the random draws.")]

OPTION_NAMES = {
    "LearningRange.depth": "--depth",
    "LearningRange.current": "--current",
    "make_plan.budget": "--budget",
    "make_plan.seeds": "--seeds",
    "make_plan.run_time": "--run-time",
    "make_plan.cell_size": "--cell-size",
    "Excitation.duration": "--run-time",
    "Water.current_speed": "--current",
    "Water.at_ratio.current_speed": "--current",
    "Water.at_ratio.depth_ratio": "--depth-ratio",
    "Water.depth": "--depth",
    "turn the flow with its direction": "turn the flow with --current-direction",
    "Soil.published.name": "--soil",
    "Soil.published": "--soil",
    "FlowSettings.threads": "--threads",
    "BuiltInFlow.cell_size": "--cell-size",
    "captive_run.cell_size": "--cell-size",
    "Grid.stretched.cell_size": "--cell-size",
    "Grid.around_vehicle.cell_size": "--cell-size",
    "VtkSeries.folder": "--vtk",
    "keep fewer instants": "give a shorter --duration",
    "cell_size": "--cell-size",
    "allow_coarse, --coarse": "--coarse",
    "captive_run.duration": "--duration",
    "simulate.duration": "--duration",
    "duration =": "--duration =",
    "shorter duration": "shorter --duration",
    "longer duration": "longer --duration",
    "a duration": "a --duration",
    "captive_run.interval": "--interval",
    "interval =": "--interval =",
    "longer interval": "longer --interval",
    "simulate.micro_step": "--micro-step",
    "micro_step": "--micro-step",
    "simulate.macro_step": "--macro-step",
    "macro_step": "--macro-step",
    "simulate.initial_speed": "--initial-speed",
    "simulate.checkpoint": "--checkpoint",
    "without checkpoint": "without --checkpoint",
    "simulate.resume": "--resume",
    "resume, --resume": "--resume",
    "CaptiveMotion.speed": "--speed",
    "CaptiveMotion.wheel_speed": "--wheel-speed",
    "CaptiveMotion.ramp_time": "--ramp-time",
    "ramp_time": "--ramp-time",
    "LaneChange.speed": "--wheel-speed",
    "StartPose.x": "--start-x",
    "StartPose.y": "--start-y",
    "PathFollowing.waypoints": "--path",
    "read_river.source =": "--river",
    "networks names a file": "--networks names a file",
    "training_runs.folder =": "--data",
    "Water.level": "--level",
    "CrossSection.read: file": "file",
    "CrossSection.water.level": "--level",
    "Ford.level": "--level",
    "level =": "--level =",
    "Ford.discharge": "--discharge",
    "CrossSection.water": "--discharge",
    "Ford.speed": "--speed",
    "Ford.initial_speed": "--initial-speed",
    "Ford.duration": "--duration",
    "Ford.density": "--density",
    "hydrodynamics='calibrated'": "--hydrodynamics calibrated",
    "hydrodynamics = 'networks'": "--hydrodynamics networks",
    "hydrodynamics = 'calibrated'": "--hydrodynamics calibrated",
    "hydrodynamics = 'auto'": "--hydrodynamics auto",
}
"""What errors call a value in Python, and the option that gives it at the command line."""
_NAMES = re.compile(
    r"(?<![\w.-])(" + "|".join(re.escape(name) for name in sorted(OPTION_NAMES, key=len, reverse=True)) + r")(?!\w)"
)  # fmt: skip


def with_option_names(text: str) -> str:
    """Return a message with the options of the command line in place of Python's names."""
    return _NAMES.sub(lambda found: OPTION_NAMES[found[1]], text)


@contextmanager
def option_names() -> Iterator[None]:
    """Let errors inside the block name the options of the command line in place of Python's arguments."""
    try:
        yield
    except (ValueError, RuntimeError) as error:
        if error.args and isinstance(error.args[0], str):
            error.args = (with_option_names(error.args[0]), *error.args[1:])
        raise


def span(option: str, text: str, unusual: bool = False) -> tuple[float, float]:
    """Read two numbers, from:to, which may lie outside their plausible range if `unusual`."""
    low, _, high = text.partition(":")
    try:
        ends = float(low), float(high)
    except ValueError:
        raise ValueError(f"{option} {text}: write from:to, such as 0.4:0.6.") from None
    return (Unusual(ends[0]), Unusual(ends[1])) if unusual else ends


def radians(option: str, degrees: float, quantity: Quantity, unusual: bool = False) -> float:
    """Return an angle or a turning given in degrees in radians, or refuse it in degrees.

    Raises
    ------
    ValueError
        If it is not finite, or outside the bounds or, unless it may be `unusual`, the plausible range of the quantity.
    """
    bounds = (quantity.at_least, quantity.at_most)
    if quantity.plausible is not None and not unusual:
        bounds = quantity.plausible
    if unusual and math.isfinite(degrees):
        return Unusual(quantity.check(option, Unusual(math.radians(degrees))))
    low, high = (math.degrees(bound) for bound in bounds)
    if not low - 1e-9 <= degrees <= high + 1e-9:
        raise ValueError(f"{option} {degrees:g} must be {low:.6g} to {high:.6g} degrees; give an angle within.")
    if taken_for_radians(degrees):
        errors.print(
            f"{option} {degrees:g} was understood in degrees; in radians it would be {math.degrees(degrees):.4g} deg.",
            style="yellow", soft_wrap=True,
        )  # fmt: skip
    return min(max(math.radians(degrees), bounds[0]), bounds[1])


COMMON_ANGLES = (15, 30, 45, 60, 90, 120, 135, 150, 180, 270, 360)
"""Angles [deg] that in radians have four digits, none of them 0 at the end."""


def taken_for_radians(degrees: float) -> bool:
    """Tell whether a number of degrees is to four digits one of `COMMON_ANGLES` in radians, with either sign."""
    return f"{abs(degrees):.4g}" in {f"{math.radians(angle):.4g}" for angle in COMMON_ANGLES}
