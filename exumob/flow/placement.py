"""Solids and bed in the grid: where they are at the end of a step, and what they leave open there."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from exumob.flow import bed
from exumob.flow.area_fractions import AreaFractions, clear, place_solid
from exumob.flow.grid import Grid, Metrics
from exumob.flow.poses import PlacedSolids, Poses
from exumob.flow.settings import FlowSettings
from exumob.flow.solids import CYLINDER, SPHERE, Solid, lugs_of
from exumob.flow.turbulence.closures import KOmegaSST
from exumob.ground.terrain import Terrain
from exumob.support.arrays import Array
from exumob.support.rotations import about_z

MARGIN = 4.0
"""Cells round a solid in which the distance from it is kept."""
CLEAR_SIDE = 3.0
"""Cells that a solid must keep from the window's sides."""


class Placement:
    """Places the solids and a given bed in the grid.

    Parameters
    ----------
    grid : Grid
    solids : sequence of Solid
    terrain : Terrain or None
        The bed, in the world's axes; None: flat, the window's lowest face.
    settings : FlowSettings
    deepest : float, optional
        Least height of a given bed [m], see `exumob.flow.bed.Bed`.

    Attributes
    ----------
    area_fractions, bodies : AreaFractions
        What bed and solids leave open, and what the solids alone do (the same object without a given bed).
    bed : Bed or None
        None if it is the window's lowest face.
    bed_heights : array, shape (ny, nx)
        Height of the bed below the columns of cells [m].
    solids : PlacedSolids
        As `place` left them.
    margin : float
        Distance from a solid within which it is known [m].
    """

    def __init__(
        self, grid: Grid, solids: Sequence[Solid], terrain: Terrain | None, settings: FlowSettings,
        deepest: float | None = None,
    ) -> None:  # fmt: skip
        self.grid, self.metrics, self.shapes = grid, grid.metrics, tuple(solids)
        self.margin = MARGIN * grid.smallest_width
        self.sharpness = 1.0 if settings.sharp_edges else 0.0
        self.bed = _given_bed(grid, terrain, len(self.shapes), settings, deepest)
        shape = grid.padded_shape
        self.area_fractions = self.bodies = AreaFractions.open(shape)
        if self.bed is not None:
            alone = self.bodies
            self.area_fractions = AreaFractions.open(shape)._replace(ax=alone.ax, ay=alone.ay, az=alone.az)
        bottom = float(grid.z_faces[0])
        self.bed_heights = np.full((shape[0], shape[2]), bottom) if self.bed is None else self.bed.heights
        n = len(self.shapes)
        friction = np.array([s.friction for s in self.shapes]) * settings.wall_shear
        none = np.zeros((n, 3))
        self.solids = PlacedSolids(
            np.zeros((n, 6), dtype=np.int64), none, np.zeros((n, 3, 3)), none, none, none, friction,
            *lugs_of(self.shapes),
        )  # fmt: skip

    def place(self, poses: Poses, frame: Array) -> bool:
        """Put the solids at their poses and the grid at its own; True if it came upon another part of a given bed.

        Parameters
        ----------
        poses : Poses
        frame : array, shape (3,)
            Grid origin x, y [m] and yaw [rad] in the world.

        Raises
        ------
        ValueError
            If a solid comes too near to the window's sides, sinks below the bed, or the bed below the window.
        """
        before = self.solids.regions.copy()
        for region in before:
            clear(self.bodies, region)
        solids = self.solids = self._in_grid_axes(poses, frame)
        for n, solid in enumerate(self.shapes):
            self._check_inside(n, solid, solids)
        for n, solid in enumerate(self.shapes):
            place_solid(n, solid.shape, solids, self.metrics, self.bodies, self.sharpness)
        return self.bed is not None and self._place_bed(self.bed, before, frame)

    def _in_grid_axes(self, poses: Poses, frame: Array) -> PlacedSolids:
        back = about_z(frame[2]).T
        position = (poses.position - np.array([frame[0], frame[1], 0.0])) @ back.T
        rotation = back @ poses.rotation
        regions = [
            index_region(self.metrics, solid, position[n], rotation[n], self.margin)
            for n, solid in enumerate(self.shapes)
        ]
        return self.solids._replace(
            regions=np.array(regions, dtype=np.int64).reshape(-1, 6), position=position, rotation=rotation,
            velocity=poses.velocity @ back.T, angular_velocity=poses.angular_velocity @ back.T,
            spin=rotation[:, :, 1] * poses.spin[:, None],
        )  # fmt: skip

    def _place_bed(self, given: bed.Bed, before: NDArray[np.int64], frame: Array) -> bool:
        """Lay the bed below the grid, once the solids are in place, and join them; `before`: their last boxes."""
        last = given.region.copy()
        moved = given.survey(frame)
        self._check_above()
        for region in before:
            given.lay(region, self.area_fractions)
        if moved:
            last[3] = max(last[3], given.region[3])
            given.lay(last, self.area_fractions)
        bed.join(self.solids.regions, self.bodies, self.area_fractions)
        return moved

    @property
    def surfaces(self) -> PlacedSolids:
        """The solids and, last, a given bed."""
        return self.solids if self.bed is None else self.solids.with_bed(self.bed.region)

    @property
    def box(self) -> tuple[slice, ...]:
        """Index box round all solids and a given bed, for slicing fields."""
        regions = self.surfaces.regions
        if not len(regions):
            return (slice(0, 0),) * 3
        low, high = regions[:, ::2].min(axis=0), regions[:, 1::2].max(axis=0)
        return tuple(slice(a, b) for a, b in zip(low, high, strict=True))

    def _check_inside(self, n: int, solid: Solid, solids: PlacedSolids) -> None:
        center, extent = _bounds(solid, solids.position[n], solids.rotation[n])
        for axis, faces in enumerate((self.grid.x_faces, self.grid.y_faces)):
            gap = min(center[axis] - extent[axis] - faces[0], faces[-1] - center[axis] - extent[axis])
            if gap < CLEAR_SIDE * self.grid.smallest_width:
                raise ValueError(
                    f"solid {n} comes within {gap:.3g} m of the window's {'xy'[axis]} side; widen "
                    f"Grid.{'xy'[axis]}_faces."
                )
        lowest = center[2] - extent[2]
        bottom = float(self.grid.z_faces[0])
        if lowest < self.metrics.zf[1]:
            raise ValueError(
                f"solid {n} reaches {bottom - lowest:.3g} m below {'the bed' if self.bed is None else 'the window'}, "
                f"more than the grid can see ({bottom - self.metrics.zf[1]:.3g} m, "
                "one and a half cells); use larger cells, or a firmer soil into which it sinks less."
            )

    def _check_above(self) -> None:
        """Refuse a solid whose origin has sunk into a given bed."""
        m = self.metrics
        for n, x in enumerate(self.solids.position):
            i, j = int(np.searchsorted(m.xf, x[0])) - 1, int(np.searchsorted(m.yf, x[1])) - 1
            if x[2] < self.bed_heights[j, i]:
                raise ValueError(
                    f"solid {n} lies in the bed: its origin is at z = {x[2]:.4g} m, the bed below it at "
                    f"{self.bed_heights[j, i]:.4g} m; raise the solid, or lower the terrain there."
                )


def _bounds(solid: Solid, position: Array, rotation: Array) -> tuple[Array, Array]:
    """Centre and half extents along the grid's axes [m] of a sphere, a cylinder, or another's box."""
    middle, half = 0.5 * (solid.low + solid.high), 0.5 * (solid.high - solid.low)
    if solid.shape.kind == SPHERE:
        extent = half
    elif solid.shape.kind == CYLINDER:  # its box would reach lower the more it pitches
        along = np.abs(rotation[:, 1])
        extent = half[1] * along + half[0] * np.sqrt(np.maximum(1.0 - along**2, 0.0))
    else:
        extent = np.abs(rotation) @ half
    return position + rotation @ middle, extent


def index_region(metrics: Metrics, solid: Solid, position: Array, rotation: Array, margin: float) -> list[int]:
    """Index box (`PlacedSolids.regions`) of the cells within `margin` [m] of a solid's bounding box."""
    center, extent = _bounds(solid, position, rotation)
    extent = extent + margin
    bounds = []
    for axis, faces in ((1, metrics.yf), (2, metrics.zf), (0, metrics.xf)):
        first = int(np.searchsorted(faces, center[axis] - extent[axis])) - 1
        last = int(np.searchsorted(faces, center[axis] + extent[axis])) + 1
        bounds += [min(max(first, 0), len(faces) - 1), min(max(last, 0), len(faces) - 1)]
    return bounds


def _given_bed(
    grid: Grid, terrain: Terrain | None, number: int, settings: FlowSettings, deepest: float | None
) -> bed.Bed | None:  # fmt: skip
    """Bed of a terrain; None if it is the window's lowest face."""
    bottom = float(grid.z_faces[0])
    if terrain is None:
        if abs(bottom) > 1e-9:
            raise ValueError(
                f"Grid.z_faces[0] = {bottom} m must be 0: the lowest face is the bed unless FlowSolver is given a "
                "terrain."
            )
        return None
    if terrain.is_flat and abs(terrain.height - bottom) <= 1e-9:
        return None
    if isinstance(settings.closure, KOmegaSST) and settings.bed_roughness is not None:
        raise ValueError(
            "FlowSettings.bed_roughness: KOmegaSST knows the wall of a flat bed only; with a terrain let the bed slip "
            "(bed_roughness=None), or use Smagorinsky."
        )
    return bed.Bed(terrain, grid, number, deepest)
