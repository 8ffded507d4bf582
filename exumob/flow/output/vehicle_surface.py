"""The vehicle's surface for pictures and files: triangles of the five bodies, moved to where they are."""

from __future__ import annotations

import json
import logging
from collections.abc import Sequence

import xarray as xr

from exumob.support.arrays import Array
from exumob.vehicle.parameters import Vehicle
from exumob.vehicle.stored import vehicle_from
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
    vehicle = vehicle_from(next(iter(json.loads(dataset.attrs["parameters"])["vehicle"].values())))
    mesh = vehicle.hull.mesh
    if mesh is not None and not mesh.is_file():
        logger.warning("the hull's mesh %s is not there any more; its box is drawn", mesh)
        object.__setattr__(vehicle.hull, "mesh", None)  # not `replace`: nothing is checked anew
    return vehicle
