"""The command line: `exumob lane-change`, `captive`, `train`, `sweep`, `map`, `export`, `soils` and `verify`."""

import logging

import typer
from rich.logging import RichHandler

from exumob.commands.captive import captive_command
from exumob.commands.export import export_command
from exumob.commands.lane_change import lane_change_command
from exumob.commands.map import map_command
from exumob.commands.shared import errors
from exumob.commands.soils import soils_command
from exumob.commands.sweep import sweep_command
from exumob.commands.train import train_command
from exumob.commands.verify import verify_command

app = typer.Typer(
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_show_locals=False,
    help="Predict how an off-road vehicle moves through shallow water on soft soil.",
)


@app.callback()
def main() -> None:
    """Predict how an off-road vehicle moves through shallow water on soft soil."""
    logging.basicConfig(
        level=logging.WARNING, format="%(message)s", handlers=[RichHandler(console=errors, show_time=False)]
    )


app.command("lane-change")(lane_change_command)
app.command("captive")(captive_command)
app.command("train")(train_command)
app.command("sweep")(sweep_command)
app.command("map")(map_command)
app.command("export")(export_command)
app.command("soils")(soils_command)
app.command("verify")(verify_command)

if __name__ == "__main__":
    app()
