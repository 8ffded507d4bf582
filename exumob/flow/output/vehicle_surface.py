"""The vehicle's surface for pictures and files: triangles of the five bodies, moved to where they are."""

from __future__ import annotations

import json
import logging
from collections.abc import Sequence
from pathlib import Path

import xarray as xr

from exumob.support.arrays import Array
from exumob.vehicle.parameters import Hull, Steering, Suspension, Vehicle, Wheel, Wishbones
from exumob.water.wetted_surface import cylinder_surface, hull_surface

logger = logging.getLogger(__name__)

SEGMENTS = 40
"""Number of flat faces round a drawn wheel."""


def body_triangles(vehicle: Vehicle) -> tuple[Array, ...]:
    """Return the triangles of the five bodies in their own axes [m], each of shape (n, 3, 3).

    The order is that of `exumob.vehicle.motion.BODIES`.
    """
    wheel = cylinder_surface(vehicle.wheel.radius, vehicle.wheel.width, SEGMENTS).triangles
    return hull_surface(vehicle).triangles, wheel, wheel, wheel, wheel


def placed(triangles: Sequence[Array], position: Array, rotation: Array) -> list[Array]:
    """Move the bodies' triangles to positions [m], shape (n, 3), and rotations, shape (n, 3, 3)."""
    return [t @ r.T + p for t, r, p in zip(triangles, rotation, position, strict=True)]


def stored_vehicle(dataset: xr.Dataset) -> Vehicle:
    """Rebuild the vehicle of a result from its attribute ``parameters``; its box, if the hull's mesh is missing."""
    stored = dict(next(iter(json.loads(dataset.attrs["parameters"])["vehicle"].values())))
    hull = stored["hull"]
    for name, make in (("mesh", Path), ("inertia", tuple)):
        hull[name] = None if hull[name] is None else make(hull[name])
    if hull["mesh"] is not None and not hull["mesh"].is_file():
        logger.warning("the hull's mesh %s is not there any more; its box is drawn", hull["mesh"])
        hull["mesh"] = None
    wheel = stored["wheel"]
    wheel["inertia"] = None if wheel["inertia"] is None else tuple(wheel["inertia"])
    stored |= {"hull": Hull(**hull), "wheel": Wheel(**wheel), "steering": Steering(**stored["steering"])}
    for axle in ("suspension", "rear_suspension"):
        if (values := stored[axle]) is not None:
            arms = values["wishbones"]
            stored[axle] = Suspension(**{**values, "wishbones": None if arms is None else Wishbones(**arms)})
    return Vehicle(**stored)
