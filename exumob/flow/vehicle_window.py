"""The window of the flow round a vehicle: how far its grid reaches, in proportion to the hull, and how low."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Annotated, NamedTuple

import numpy as np

from exumob.flow.bed import lowest_bed
from exumob.flow.cost import require_room
from exumob.flow.grid import CELL_SIZE, Grid
from exumob.flow.settings import FlowSettings
from exumob.flow.undisturbed import still_level
from exumob.ground.terrain import Terrain
from exumob.support.arrays import Array
from exumob.support.declared import checked
from exumob.support.quantities import Quantity
from exumob.vehicle.parameters import Vehicle
from exumob.vehicle.start_pose import PLACE
from exumob.water.conditions import Water

AHEAD, BEHIND, ASIDE, TOP = 1.8, 2.4, 1.8, 0.42
"""Reach of the window from the hull's centre of mass, over the vehicle's length [-]."""
DEEPEST = 0.75
"""Depth beyond which no vehicle that stands on the ground feels how deep the water is, over its length [-]."""
SPACING = 0.05
"""Spacing of the points at which a bed is looked at for its lowest, over the vehicle's length [-]."""
CORE_ABOVE = 0.6
"""Height above still water up to which cells are cubes, over the tyre's diameter [-]."""
FINEST = 2000
"""Points along a side of the area that is looked at, at most."""


@checked
def vehicle_window(
    vehicle: Vehicle,
    cell_size: Annotated[float, CELL_SIZE],
    water: Water,
    terrain: Terrain | None = None,
    frames: Annotated[Array | None, Quantity("m, m, rad", shape=("places", 3))] = None,
    hull_on_faces: bool = False,
) -> Grid:
    """Return the default grid round a vehicle, for captive runs and for the flow in the loop.

    It is `Grid.around_vehicle` with a window in proportion to the hull's length.

    Parameters
    ----------
    vehicle : Vehicle
    cell_size : float
        Cell size round the vehicle [m].
    water : Water
        The window is at least three and a half times as high as it is deep.
    terrain : Terrain, optional
        The bed. The window begins at a flat bed, and a cell below the lowest point on its way of any other.
    frames : array, shape (n, 3), optional
        Places on that way: x, y [m] and heading [rad] of the hull. Default: the world's origin.
    hull_on_faces : bool
        Whether bow, stern and sides of the hull lie on faces (`Grid.around_vehicle`).

    Raises
    ------
    ValueError
        If `cell_size` is not positive, or makes more cells than there is memory for; the text names one that fits.
    """
    scale = _length(vehicle)
    ahead, behind, aside = AHEAD * scale, BEHIND * scale, ASIDE * scale
    bottom = 0.0
    if terrain is not None and terrain.is_flat:
        bottom = terrain.height
    elif terrain is not None:
        margin = 0.1 * scale  # of the outermost cells, which may reach beyond these sides
        corners = np.array([-behind - margin, -aside - margin]), np.array([ahead + margin, aside + margin])
        frames = np.zeros((1, 3)) if frames is None else frames
        bottom = lowest_bed(terrain, frames, *corners, spacing=0.1) - cell_size
    grid = Grid.around_vehicle(
        vehicle, cell_size, ahead=ahead, behind=behind, aside=aside, top=max(TOP * scale, 3.5 * water.uniform_depth),
        bottom=bottom, hull_on_faces=hull_on_faces,
    )  # fmt: skip
    require_room(f"{vehicle.name}: cell_size = {cell_size:g} m", grid)
    return grid


class WindowOverTerrain(NamedTuple):
    """A window of the flow over uneven ground."""

    grid: Grid
    deepest: float
    """Where the ground lies below this height, the bed is taken at it [m]"""


@checked
def window_over_terrain(
    vehicle: Vehicle,
    cell_size: Annotated[float, CELL_SIZE],
    water: Water,
    terrain: Terrain,
    place: Annotated[tuple[float, float], PLACE] = (0.0, 0.0),
    reach: Annotated[float, Quantity("m", at_least=0.0, at_most=1e6)] = 0.0,
) -> WindowOverTerrain:
    """Return the default grid round a vehicle that drives over uneven ground, wherever it goes within a circle.

    It begins a cell below the lowest bed on its way, or below `DEEPEST` vehicle lengths of water; its cells are cubes
    up to three fifths of a tyre's diameter above the still level.

    Parameters
    ----------
    vehicle : Vehicle
    cell_size : float
        Cell size round the vehicle [m].
    water : Water
    terrain : Terrain
        The ground.
    place : (float, float)
        Where the vehicle starts, world x and y [m].
    reach : float
        How far it comes from there [m].

    Raises
    ------
    ValueError
        As `vehicle_window`; or if the level of a field is not one (`exumob.flow.undisturbed.still_level`).
    """
    scale = _length(vehicle)
    ahead, behind, aside = AHEAD * scale, BEHIND * scale, ASIDE * scale
    level = still_level(water)
    around = reach + 1.1 * math.hypot(behind, aside)
    spacing = max(SPACING * scale, 2.0 * around / FINEST)
    corner = np.array([around, around])
    lowest = lowest_bed(terrain, np.array([[*place, 0.0]]), -corner, corner, spacing)
    deepest = max(lowest, level - DEEPEST * scale)
    depth = max(level - deepest, 0.0)
    bottom, ground = deepest - cell_size, max(level, lowest)
    grid = Grid.around_vehicle(
        vehicle, cell_size, ahead=ahead, behind=behind, aside=aside, bottom=bottom,
        top=ground + min(max(TOP * scale - depth, 2.5 * depth), TOP * scale),
        core_top=ground + CORE_ABOVE * vehicle.wheel.diameter,
    )  # fmt: skip
    require_room(f"{vehicle.name}: cell_size = {cell_size:g} m", grid)
    return WindowOverTerrain(grid, deepest)


def settings_for_vehicle(vehicle: Vehicle, settings: FlowSettings) -> FlowSettings:
    """Return settings whose reference length is that of a vehicle, unless they give one themselves.

    By Froude's law the waves of a vehicle are as long as it is large, and a zone absorbs waves of up to about two of
    its widths (`exumob verify far-field-waves`): 0.6 m, right for the paper's vehicle of 1 m, would send back those of
    a car. In proportion to it, and with the rates that follow from it, the flow round a vehicle some times as large is
    the same in its own time.
    """
    if settings.reference_length is not None:
        return settings
    return replace(settings, reference_length=_length(vehicle))


def _length(vehicle: Vehicle) -> float:
    """Length to which the window is in proportion [m]."""
    return max(vehicle.hull.length, vehicle.wheelbase + vehicle.wheel.diameter)


@checked
def doubled_window(vehicle: Vehicle, cell_size: Annotated[float, CELL_SIZE], water: Water) -> Grid:
    """Return a grid that reaches twice as far ahead, behind and aside as `vehicle_window`.

    Cells round the vehicle and the top stay as they are: runs in both windows show what the sides do to the loads.
    """
    normal = vehicle_window(vehicle, cell_size, water)
    return Grid.around_vehicle(
        vehicle, cell_size, ahead=2.0 * normal.x_faces[-1], behind=-2.0 * normal.x_faces[0],
        aside=2.0 * normal.y_faces[-1], top=float(normal.z_faces[-1]) - 1e-6,
    )  # fmt: skip
