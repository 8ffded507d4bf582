"""A vehicle from what a result holds of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import MISSING, fields
from pathlib import Path
from typing import Any, TypeVar

from exumob.vehicle.hull import Box, Hull, WheelArches
from exumob.vehicle.parameters import Steering, Vehicle
from exumob.vehicle.running_gear import Suspension, Wheel, Wishbones

T = TypeVar("T")


def vehicle_from(stored: Mapping[str, Any]) -> Vehicle:
    """Make a vehicle again from the values of its fields, as ``dataclasses.asdict`` and JSON leave them.

    Nothing is checked: what was run once can be drawn, whatever is refused today. Fields that the result does not have
    get their defaults.
    """
    hull, wheel = dict(stored["hull"]), dict(stored["wheel"])
    for name, make in (("mesh", Path), ("inertia", tuple), ("wheel_arches", lambda v: _made(WheelArches, v))):
        hull[name] = None if hull.get(name) is None else make(hull[name])
    hull["boxes"] = tuple(_made(Box, box) for box in hull.get("boxes", ()))
    wheel["inertia"] = None if wheel.get("inertia") is None else tuple(wheel["inertia"])
    parts = {"hull": _made(Hull, hull), "wheel": _made(Wheel, wheel), "steering": _made(Steering, stored["steering"])}
    for axle in ("suspension", "rear_suspension"):
        if (values := stored.get(axle)) is not None:
            arms = values.get("wishbones")
            parts[axle] = _made(Suspension, {**values, "wishbones": None if arms is None else _made(Wishbones, arms)})
    return _made(Vehicle, {**stored, **parts})


def _made(owner: type[T], values: Mapping[str, Any]) -> T:
    """An object of a frozen dataclass, made without its checks."""
    made = object.__new__(owner)
    for field in fields(owner):  # type: ignore[arg-type]
        if field.name not in values and field.default is MISSING:
            raise ValueError(f"{owner.__name__}.{field.name} is not stored; the result is damaged, make it again.")
        object.__setattr__(made, field.name, values.get(field.name, field.default))
    return made
