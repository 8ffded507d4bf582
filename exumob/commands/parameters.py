"""The command `exumob parameters`."""

from __future__ import annotations

from dataclasses import MISSING
from pathlib import Path
from typing import Annotated, Any

import typer

from exumob.commands.options import RUN, option
from exumob.commands.shared import console, fail

VEHICLE = ("Vehicle", "Hull", "Box", "WheelArches", "Wheel", "Suspension", "Wishbones", "Steering")
"""What is listed where nothing is named: all that a vehicle file holds."""


def parameters_command(
    names: Annotated[
        list[str] | None,
        typer.Argument(
            help="Classes, such as Hull, Soil or Water; all: those of vehicle, soil, water and driving. "
            "Default: those of a vehicle file."
        ),
    ] = None,
    template: Annotated[
        Path | None,
        option(
            RUN,
            "Write a vehicle file here to copy from, instead of a list: that of small_car, or of the vehicle named.",
        ),
    ] = None,
) -> None:
    """List fields with their units, limits, defaults and meanings; or write a vehicle file to edit.

    Examples: exumob parameters Soil Water LaneChange; exumob parameters light_4x4 --template my_car.py
    """
    if template is not None:
        try:
            _write_template(template, names or ["small_car"])
        except (ValueError, OSError) as error:
            fail(error)
        return
    from exumob.support.declared import declared_fields, nearest_names
    from exumob.support.quantities import shown

    known = _classes()
    asked = list(names or VEHICLE)
    if asked == ["all"]:
        asked = list(known)
    lowered = {name.casefold(): name for name in known}
    for name in asked:
        if name.casefold() not in lowered:
            near = nearest_names(name, list(known)) or list(known)
            fail(ValueError(f"{shown(name, 60)} has no parameters; use {', '.join(near)}."))
    for name in asked:
        owner = known[lowered[name.casefold()]]
        console.print(f"{owner.__name__}: {(owner.__doc__ or '').partition(chr(10))[0]}", soft_wrap=True)
        for field in declared_fields(owner):
            unit = "" if field.quantity is None or not field.quantity.symbol else f" [{field.quantity.symbol}]"
            console.print(f"  {field.name}{unit}: {_said(field)}", soft_wrap=True)


def _write_template(file: Path, names: list[str]) -> None:
    """Write the file of a vehicle that comes with exumob, to edit.

    Raises
    ------
    ValueError
        If more than one vehicle is named, or the file is there already or does not end in .py.
    OSError
        If no such vehicle comes with exumob, or the file cannot be written.
    """
    from exumob.support.files import require_ending, require_writable, write_text
    from exumob.vehicle.vehicle_file import shipped_vehicle_file

    if len(names) > 1:
        raise ValueError(f"--template takes one vehicle, and {', '.join(names)} are named; give one of them.")
    require_ending("--template", file, (".py",))
    if file.exists():
        raise ValueError(f"--template {file} is there already; give another name, or remove it.")
    source = shipped_vehicle_file(names[0])
    require_writable(file)
    write_text(file, source.read_text(encoding="utf-8"))
    console.print(f"{file}: the vehicle {source.stem}; edit its values, then exumob drive --vehicle {file}")


def _classes() -> dict[str, type]:
    """Return what has fields of its own that a user gives, by name."""
    from exumob.driving.maneuver import ConstantSteer, LaneChange
    from exumob.driving.path_following import PathFollowing
    from exumob.ground.soil import Soil
    from exumob.vehicle import parameters
    from exumob.vehicle.start_pose import StartPose
    from exumob.water.coefficients import Coefficients
    from exumob.water.conditions import Water

    parts = [getattr(parameters, name) for name in VEHICLE]
    return {
        owner.__name__: owner
        for owner in (*parts, Soil, Water, LaneChange, ConstantSteer, PathFollowing, StartPose, Coefficients)
    }


def _said(field: Any) -> str:
    """Say what a field means, its limits and its default."""
    quantity = field.quantity
    limits = quantity.bounds if quantity is not None else ""
    if quantity is not None and quantity.plausible is not None:
        plausible = "plausible {:.6g} to {:.6g}".format(*quantity.plausible)
        limits = f"{limits}, {plausible}" if limits else plausible
    default = "needed" if field.default is MISSING else f"default {_default(field.default)}"
    return f"{' '.join(field.meaning.split()).rstrip('.')} ({'; '.join(part for part in (limits, default) if part)})"


def _default(value: Any) -> str:
    from exumob.support.quantities import shown

    return f"{value:.6g}" if isinstance(value, float) else shown(value, 40)
