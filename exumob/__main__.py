"""The command line: `exumob drive`, `ford`, `lane-change`, `captive`, `learn`, `sweep` and others of `COMMANDS`."""

import logging
from collections.abc import Callable
from typing import Annotated

import typer

from exumob.commands.captive import captive_command
from exumob.commands.drive import drive_command
from exumob.commands.export import export_command
from exumob.commands.ford import ford_command
from exumob.commands.lane_change import lane_change_command
from exumob.commands.learn import learn_command
from exumob.commands.map import map_command
from exumob.commands.options import PanelCommand
from exumob.commands.parameters import parameters_command
from exumob.commands.shared import console, errors
from exumob.commands.soils import soils_command
from exumob.commands.sweep import sweep_command
from exumob.commands.terminal import log_handler
from exumob.commands.train import train_command
from exumob.commands.verify import verify_command
from exumob.support.processes import terminate_as_interrupted

app = typer.Typer(
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_show_locals=False,
    help="Predict how an off-road vehicle moves through shallow water on soft soil.",
)


def _show_version(wanted: bool) -> None:
    if wanted:
        from exumob import __version__

        console.print(f"exumob {__version__}")
        raise typer.Exit


@app.callback()
def main(
    version: Annotated[
        bool, typer.Option("--version", help="Show the version and leave.", is_eager=True, callback=_show_version)
    ] = False,
) -> None:
    """Predict how an off-road vehicle moves through shallow water on soft soil."""
    terminate_as_interrupted()
    logging.basicConfig(level=logging.WARNING, handlers=[log_handler(errors)])
    logging.getLogger("exumob.support.cost").setLevel(logging.INFO)  # what a run will take


COMMANDS: dict[str, Callable[..., None]] = {
    "drive": drive_command, "ford": ford_command, "lane-change": lane_change_command, "captive": captive_command,
    "sweep": sweep_command, "map": map_command, "learn": learn_command, "train": train_command,
    "export": export_command, "soils": soils_command, "parameters": parameters_command, "verify": verify_command,
}  # fmt: skip
for name, command in COMMANDS.items():
    app.command(name, cls=PanelCommand)(command)

if __name__ == "__main__":
    app()
