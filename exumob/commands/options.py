"""Options that several commands share, and the panels of their help.

A command lists its options in panels, those that a beginner needs first: `RUN`, `WATER`, `OUTPUT`, `EXPERT`.
"""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperCommand

RUN = "Run"
WATER = "Water"
OUTPUT = "Output"
EXPERT = "Expert"


class PanelCommand(TyperCommand):
    """A command whose help shows its options in panels, in plain text."""

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Write a section for each panel, in the order in which the panels first appear."""
        panels: dict[str, list[tuple[str, str]]] = {RUN: [], WATER: [], OUTPUT: [], EXPERT: []}
        for parameter in self.get_params(ctx):
            row = parameter.get_help_record(ctx)
            if row is not None:
                panels.setdefault(getattr(parameter, "rich_help_panel", None) or RUN, []).append(row)
        for panel, rows in panels.items():
            if rows:
                with formatter.section(panel):
                    formatter.write_dl(rows)


def option(panel: str, text: str, *flags: str) -> Any:
    """Declare an option of a panel, with its help text and its flags where they are not made from its name."""
    return typer.Option(*flags, help=text, rich_help_panel=panel)


class SettingName(StrEnum):
    """The steps of a run by name."""

    fast = "fast"
    fine = "fine"


VehicleFile = Annotated[
    Path | None, option(RUN, "Vehicle file (Python). Default: the paper's 57 kg amphibious vehicle.")
]  # fmt: skip
SoilName = Annotated[str, option(RUN, "A published soil by its name; `exumob soils` lists them.")]
Duration = Annotated[float, option(EXPERT, "Simulated time [s].")]
Current = Annotated[float, option(RUN, "Speed of the current [m/s].")]
CurrentDirection = Annotated[
    float,
    option(WATER, "Where the current flows to, counter-clockwise from the first heading [deg]; 180: a head current."),
]
Output = Annotated[Path | None, option(RUN, "Write the result here (netCDF).")]
Figure = Annotated[Path | None, option(RUN, "Draw the result here (.png, .pdf, .svg).")]
Animation = Annotated[Path | None, option(OUTPUT, "Animate the run here (.gif or .mp4).")]
SettingOption = Annotated[
    SettingName,
    option(EXPERT, "Steps by name. fast ends within 0.5 % of fine, which takes three to five times as long."),
]
MicroStep = Annotated[float | None, option(EXPERT, "Step of the multibody solver [s]. Default: by the setting.")]
MacroStep = Annotated[
    float | None, option(EXPERT, "Interval at which the water's loads are renewed [s]. Default: by the setting.")
]
CellSize = Annotated[float, option(EXPERT, "Width of the flow solver's cells round the vehicle [m].")]
Coarse = Annotated[
    bool, option(EXPERT, "Accept cells too coarse for gaps and wheels: a quick look.", "--coarse")
]  # fmt: skip
Threads = Annotated[int, option(EXPERT, "Threads of the flow solver.")]
Workers = Annotated[int, option(EXPERT, "Processes that run side by side.")]
Seed = Annotated[int, option(EXPERT, "Seed of the random draws.")]
