"""Snapshots: the free surface at instants of a run, from which pictures and animations are made."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from exumob.flow.grid import HALO, Grid
from exumob.flow.poses import Poses
from exumob.flow.solver import FlowSolver
from exumob.support.arrays import Array
from exumob.support.rotations import about_z
from exumob.vehicle.motion import BODIES, quaternions

SNAPSHOT_VARIABLES = ("elevation", "bed_elevation", "frame", "snapshot_position", "snapshot_quaternion")
"""Names of the variables of `snapshots_dataset`."""
FILM = 0.1
"""Depth over a given bed below which it counts as dry, over the smallest width of a cell [-]."""


@dataclass(frozen=True)
class Snapshot:
    """Surface and solids at one instant."""

    time: float
    """[s]"""
    elevation: Array
    """Free surface above the still level [m], shape (ny, nx); see `surface_elevation`"""
    frame: Array
    """Origin x, y [m] and heading [rad] of the grid in world axes"""
    position: Array
    """Positions of the bodies' origins, grid axes [m], shape (n, 3)"""
    rotation: Array
    """Rotation matrices, body to grid axes, shape (n, 3, 3)"""
    level: float = 0.0
    """Height of the still surface, z [m]"""
    bed: NDArray[np.float32] | None = None
    """Height of a given bed above the still level [m], single precision, shape (ny, nx)"""

    @classmethod
    def of(cls, solver: FlowSolver, poses: Poses) -> Snapshot:
        """Take a snapshot of what the solver holds now, with the solids at `poses`."""
        frame, bed = solver.frame, None
        if solver.has_given_bed:
            bed = np.asarray(solver.bed_height() - solver.level, np.float32)
        return cls(solver.time, surface_elevation(solver), frame, *in_grid_axes(poses, frame), solver.level, bed)

    def state(self) -> dict[str, Any]:
        """Return it as plain numbers and arrays."""
        return {name: value for name, value in vars(self).items() if value is not None}


def snapshots_dataset(grid: Grid, snapshots: Sequence[Snapshot]) -> xr.Dataset:
    """Return the snapshots of a vehicle's run as a Dataset of `SNAPSHOT_VARIABLES`."""
    m = grid.metrics
    y, x = m.yc[HALO:-HALO], m.xc[HALO:-HALO]
    text = "free surface above the still level; NaN where a solid pierces it"
    beds = [s.bed for s in snapshots if s.bed is not None]
    found = xr.Dataset(
        {
            "elevation": (
                ("snapshot", "y", "x"), np.stack([s.elevation for s in snapshots]),
                {"units": "m", "long_name": text, "still_level": snapshots[0].level},
            ),
            "frame": (
                ("snapshot", "frame_component"), np.stack([s.frame for s in snapshots]),
                {"units": "m, m, rad", "long_name": "origin and heading of the grid in world axes"},
            ),
            "snapshot_position": (
                ("snapshot", "body", "axis"), np.stack([s.position for s in snapshots]),
                {"units": "m", "long_name": "position of the body's origin, grid axes"},
            ),
            "snapshot_quaternion": (
                ("snapshot", "body", "quaternion_component"), np.stack([quaternions(s.rotation) for s in snapshots]),
                {"units": "1", "long_name": "orientation, body to grid axes, scalar first"},
            ),
        },
        coords={
            "snapshot": (
                "snapshot", np.array([s.time for s in snapshots]), {"units": "s", "long_name": "time of the snapshot"}
            ),
            "y": ("y", y, {"units": "m", "long_name": "cell centres, grid axes, from the hull to the left"}),
            "x": ("x", x, {"units": "m", "long_name": "cell centres, grid axes, from the hull forward"}),
            "body": list(BODIES),
            "axis": ["x", "y", "z"],
            "quaternion_component": ["w", "x", "y", "z"],
            "frame_component": ["x", "y", "yaw"],
        },
    )  # fmt: skip
    if len(beds) == len(snapshots):
        attrs = {"units": "m", "long_name": "bed above the still level; negative where there is water"}
        found["bed_elevation"] = (("snapshot", "y", "x"), np.stack(beds), attrs)
    return found


def in_grid_axes(poses: Poses, frame: Array) -> tuple[Array, Array]:
    """Positions [m], shape (n, 3), and rotations, shape (n, 3, 3), in the axes of a grid at `frame` (x, y, heading)."""
    back = about_z(frame[2]).T
    return (poses.position - np.array([frame[0], frame[1], 0.0])) @ back.T, back @ poses.rotation


def surface_elevation(solver: FlowSolver) -> Array:
    """Free surface above the still level [m], single precision, shape (ny, nx); NaN where a solid pierces it.

    NaN also where a given bed is dry. Under an overhang (a raked bow, a hull out of the water) it is the surface
    beneath; over a solid under water, the surface above.
    """
    widths = np.diff(solver.grid.z_faces)
    fraction = solver.fraction
    solid = solver.bodies.distance[HALO:-HALO, HALO:-HALO, HALO:-HALO] < 0.0
    water = np.where(solid, 0.0, fraction) * widths[:, None]
    nz = len(widths)
    here = solid.any(axis=1)
    lowest, highest = solid.argmax(axis=1), nz - 1 - solid[:, ::-1].argmax(axis=1)
    levels = np.arange(nz)[:, None]
    above = np.where(levels > highest[:, None], water, 0.0).sum(axis=1)
    below = np.where(levels < lowest[:, None], water, 0.0).sum(axis=1)
    beneath = np.take_along_axis(fraction, np.maximum(lowest - 1, 0)[:, None], axis=1)[:, 0]
    dry = (lowest > 0) & (beneath < 0.5)
    surface = solver.surface_height()
    below += float(solver.grid.z_faces[0])
    height = np.where(here, np.where(dry, below, np.nan), surface)
    over = solver.grid.z_faces[np.minimum(highest + 1, nz)] + above
    height = np.where(here & (above > 0.5 * widths[np.minimum(highest + 1, nz - 1)]), over, height)
    if solver.has_given_bed:
        height[height - solver.bed_height() < FILM * widths.min()] = np.nan  # below a wheel on dry land, too
    return (height - solver.level).astype(np.float32)
