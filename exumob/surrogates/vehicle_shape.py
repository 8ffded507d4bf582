"""The shape of a vehicle: parameters that shape the flow, by which networks know it, and how two vehicles differ."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

from exumob.support.wording import number
from exumob.vehicle.parameters import Vehicle
from exumob.water.mesh_file import mesh_digest

CLOSE = 1.0e-3
"""Relative difference up to which a value counts as the same [-]."""
NAMED_DIFFERENCES = 2
"""Number of differences between a vehicle and that of networks which a message names."""
GEOMETRY = (
    "hull.length", "hull.width", "hull.height", "hull.ground_clearance", "hull.center_of_mass_height",
    "hull.center_of_mass_x", "hull.center_x", "hull.bow_length", "hull.bow_height", "hull.mesh", "wheel.diameter",
    "wheel.width", "wheelbase", "track",
)  # fmt: skip
"""Parameters of a vehicle that shape the flow: networks fit no vehicle that differs in one of them."""
FURTHER_GEOMETRY = ("hull.stern_length", "hull.stern_height", "hull.boxes", "hull.wheel_arches")
"""More of them, which `geometry` tells as one under ``hull.mesh``: no trained vehicle has any."""


def geometry(vehicle: Vehicle) -> dict[str, Any]:
    """Return the parameters of a vehicle that shape the flow, by name (`GEOMETRY`)."""
    found: dict[str, Any] = {}
    for name in GEOMETRY:
        value: Any = vehicle
        for part in name.split("."):
            value = getattr(value, part)
        found[name] = value if value is None or isinstance(value, int | float) else str(value)
    if vehicle.hull.mesh is not None:
        found["hull.mesh"] = f"contents {mesh_digest(vehicle.hull)[:16]}"  # a path does not say which shape
    else:
        found["hull.mesh"] = further_shape(vehicle)
    return found


def times_as_large(vehicle: Vehicle, trained: Mapping[str, Any]) -> float | None:
    """Return the size of a vehicle over that of the training runs, if it has the same form; else None.

    A mesh, and a hull of several boxes, of which files of networks keep a digest, are known in one size only.

    Parameters
    ----------
    vehicle : Vehicle
    trained : mapping
        `geometry` of the vehicle of the training runs.
    """
    present = geometry(vehicle)
    if same_value(present["wheelbase"], trained["wheelbase"]):
        factor = 1.0
    else:
        factor = present["wheelbase"] / trained["wheelbase"]
    for name, value in trained.items():
        number_there = isinstance(value, int | float)
        if not same_value(present[name], factor * value if number_there else value):
            return None
    return factor if factor == 1.0 or trained["hull.mesh"] is None else None


def further_shape(vehicle: Vehicle) -> str | None:
    """Return a text for what a hull of boxes has beyond the first one with its bow (`GEOMETRY`); None if nothing."""
    hull = vehicle.hull
    stern = (hull.stern_length, hull.stern_height)
    if not hull.boxes and hull.wheel_arches is None and 0.0 in stern:
        return None
    more = (hull.boxes, hull.wheel_arches, stern)
    return f"more boxes, wheel arches or a raked stern {hashlib.sha256(repr(more).encode()).hexdigest()[:16]}"


def shape_differences(vehicle: Vehicle, trained: Mapping[str, Any]) -> list[str]:
    """Say in which parameters a vehicle differs in shape from the one of the training runs (`GEOMETRY`)."""
    present = plain_parameters(vehicle)
    found = []
    for name, value in trained.items():
        given = present.get(name)
        if not same_value(given, value):
            found.append(f"{name} = {number(given)}, they were trained with {number(value)}")
    return found


def first_of(differences: Sequence[str]) -> str:
    """Return the first few of several differences as one text, with the number of the others."""
    more = len(differences) - NAMED_DIFFERENCES
    return "; ".join(differences[:NAMED_DIFFERENCES]) + (f"; and {more} more" if more > 0 else "")


def card_parameters(vehicle: Vehicle) -> dict[str, Any]:
    """Return a vehicle's parameters by name, as a report card holds them: another vehicle is beyond the card.

    Name and mesh are left out: networks refuse another shape by themselves.
    """
    return {name: value for name, value in plain_parameters(vehicle).items() if name not in ("name", "hull.mesh")}


def plain_parameters(vehicle: Vehicle) -> dict[str, Any]:
    """Return all parameters of a vehicle by name; under ``hull.mesh`` what else shapes its hull."""
    found = flat(json.loads(json.dumps(asdict(vehicle), default=str)))
    return found | {"hull.mesh": found["hull.mesh"] or further_shape(vehicle)}


def flat(nested: Mapping[str, Any], before: str = "") -> dict[str, Any]:
    """Return what is nested under names of one level, joined by dots."""
    found: dict[str, Any] = {}
    for name, value in nested.items():
        found |= flat(value, f"{before}{name}.") if isinstance(value, Mapping) else {f"{before}{name}": value}
    return found


def same_value(value: Any, other: Any) -> bool:
    """Whether two parameters are the same, numbers up to `CLOSE`."""
    if isinstance(value, list) and isinstance(other, list):
        return len(value) == len(other) and all(map(same_value, value, other))
    numbers = isinstance(value, int | float) and isinstance(other, int | float)
    return math.isclose(value, other, rel_tol=CLOSE, abs_tol=1e-9) if numbers else bool(value == other)
