"""The water that the vehicle moves through: its depth or level, and its current.

World axes: x and y horizontal, z up. SI units and radians.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from exumob.ground.terrain import HEIGHT_RANGE, Terrain
from exumob.support.arrays import Array
from exumob.support.declared import Declared, checked
from exumob.support.errors import SimulationError
from exumob.support.kernels import njit
from exumob.support.quantities import CURRENT_SPEED, DEPTH, DEPTH_RATIO, DIRECTION, Quantity
from exumob.vehicle.motion import BODIES, BodyStates
from exumob.water.water_field import BEYOND, WATER_RECORD, WaterField, water_at

NO_NODES = np.zeros((0, 0, 3))
"""Nodes of uniform water."""


class WaterOverBed(NamedTuple):
    """Water and the ground under it, as compiled code reads them."""

    water: NDArray[np.void]
    water_nodes: Array
    """As `Water.as_arrays` returns them"""
    bed: NDArray[np.void]
    bed_nodes: Array
    """As `exumob.ground.terrain.Terrain.as_arrays` returns them"""


@dataclass(frozen=True)
class Water(Declared):
    """A body of water, given by its depth, its level or a field; exactly one of them.

    A depth goes with level ground, ``Water(0.12, 1.0)``: the still surface lies so far above it. A level is the world z
    of the still surface over any terrain: the ground above it is dry. A field has level and velocity at each place.

    Raises
    ------
    ValueError
        If none or several of depth, level and field are given, a value is not finite, the depth or density is not
        positive, the speed is negative, or a field is given a current besides its own.
    """

    depth: Annotated[float | None, DEPTH] = None
    """Still-water depth above level ground"""
    current_speed: Annotated[float, CURRENT_SPEED] = 0.0
    """Speed of the undisturbed flow over ground"""
    current_direction: Annotated[float, DIRECTION] = math.pi
    """Where the flow goes, counter-clockwise from world x; pi: a head current (towards -x)"""
    density: Annotated[float, Quantity("kg/m^3", above=0.0, plausible=(700.0, 1500.0))] = 1000.0
    """1000 is fresh water, 1025 sea water"""
    level: Annotated[float | None, Quantity("m", at_least=HEIGHT_RANGE[0], at_most=HEIGHT_RANGE[1])] = None
    """World z of the still surface, over any terrain"""
    field: WaterField | None = None
    """Level and velocity from place to place"""

    def _check(self) -> None:
        given = [name for name in ("depth", "level", "field") if getattr(self, name) is not None]
        if len(given) != 1:
            found = " and ".join(given) if given else "none of them"
            raise ValueError(
                f"Water: {found} given; give one of depth (over level ground), level (world z of the surface, over any "
                "terrain) and field (a WaterField)."
            )
        if self.field is not None and self.current_speed != 0.0:
            raise ValueError(
                f"Water.current_speed = {self.current_speed:g} m/s beside a field, which has the velocity of its own; "
                "leave one of them out."
            )

    @classmethod
    @checked
    def at_ratio(
        cls,
        depth_ratio: Annotated[float, DEPTH_RATIO],
        current_speed: float = 0.0,
        *,
        tyre_diameter: Annotated[float, Quantity("m", above=0.0, plausible=(0.02, 5.0))] = 0.200,
        current_direction: float = math.pi,
        density: float = 1000.0,
    ) -> Water:
        """Water whose depth is a ratio of the tyre diameter (the paper's D60 is 0.60).

        Parameters
        ----------
        depth_ratio : float
            Depth over tyre diameter [-], > 0.
        current_speed, current_direction, density : float
            As for `Water`.
        tyre_diameter : float
            [m]; default 0.200, the tyre of ``vehicle_models/amphibious.py``.
        """
        return cls(depth_ratio * tyre_diameter, current_speed, current_direction, density)

    @property
    def parameters(self) -> dict[str, Any]:
        """What was given, as kept in results: of depth, level and field the one that is there."""
        found: dict[str, Any] = {} if self.depth is None else {"depth": self.depth}
        found |= {
            "current_speed": self.current_speed, "current_direction": self.current_direction, "density": self.density,
        }  # fmt: skip
        if self.level is not None:
            found["level"] = self.level
        return found if self.field is None else found | {"field": self.field}

    @property
    def uniform_depth(self) -> float:
        """The depth [m], for models that know water of one depth and one current only.

        Raises
        ------
        ValueError
            If the water is given by its level or a field.
        """
        if self.depth is None:
            raise ValueError(
                f"Water.{'level' if self.field is None else 'field'}: this needs water of one depth over level ground; "
                "give Water(depth=...), or take a model that knows water over terrain (hydrodynamics='calibrated')."
            )
        return self.depth

    @property
    def velocity(self) -> Array:
        """Velocity of the undisturbed flow, world axes [m/s], shape (3,).

        Raises
        ------
        ValueError
            If it differs from place to place.
        """
        if self.field is not None:
            raise ValueError("Water.velocity: that of a field differs from place to place; ask for it with `at`.")
        return self.current_speed * np.array([math.cos(self.current_direction), math.sin(self.current_direction), 0.0])

    @property
    def greatest_speed(self) -> float:
        """Largest speed of the undisturbed flow anywhere [m/s]."""
        if self.field is None:
            return self.current_speed
        return float(np.hypot(self.field.nodes[..., 1], self.field.nodes[..., 2]).max())

    def require_over(self, terrain: Terrain, name: str = "Water.depth") -> None:
        """Refuse a depth over ground that is not level.

        Raises
        ------
        ValueError
            With the remedy.
        """
        if self.depth is not None and not terrain.is_flat:
            raise ValueError(
                f"{name} = {self.depth:g} m: a depth goes with level ground, and this terrain is none; give the world "
                f"z of the still surface, Water(level=...), which lies above {terrain.height:.6g} m at the world's "
                "origin, or a field."
                if terrain.heights is None
                else f"{name} = {self.depth:g} m: a depth goes with level ground, and this terrain is none; give the "
                "world z of the still surface, Water(level=...), or a field, Water(field=WaterField(...))."
            )

    def as_arrays(self, terrain: Terrain | None = None) -> tuple[np.ndarray, Array]:
        """Return the water as compiled code reads it, see `exumob.water.water_field.water_at`.

        Parameters
        ----------
        terrain : Terrain, optional
            The ground; default: flat at z = 0.

        Returns
        -------
        water : array of dtype `WATER_RECORD`, shape (1,)
            Kernels take its element 0.
        nodes : array, shape (n_y, n_x, 3), or (0, 0, 3) for uniform water
            Level [m] and velocity [m/s]; not to be changed.

        Raises
        ------
        ValueError
            If the water is given by its depth and the ground is not level.
        """
        terrain = Terrain() if terrain is None else terrain
        self.require_over(terrain)
        water = np.zeros(1, WATER_RECORD)
        water["current_speed"], water["current_direction"] = self.current_speed, self.current_direction
        water["spacing_x"] = water["spacing_y"] = water["cos"] = 1.0
        if self.field is not None:
            grid = self.field.grid
            water["level"] = math.nan
            water["origin_x"], water["origin_y"] = grid.origin
            water["spacing_x"], water["spacing_y"] = grid.spacing
            water["cos"], water["sin"] = math.cos(grid.direction), math.sin(grid.direction)
            return water, self.field.nodes
        water["level"] = terrain.height + self.uniform_depth if self.level is None else self.level
        water["velocity_x"], water["velocity_y"] = self.velocity[:2]
        return water, NO_NODES

    def over(self, terrain: Terrain | None = None) -> WaterOverBed:
        """Return the water and the ground as compiled code reads them; arguments and errors as for `as_arrays`."""
        terrain = Terrain() if terrain is None else terrain
        return WaterOverBed(*self.as_arrays(terrain), *terrain.as_arrays())

    def at(self, points: ArrayLike, terrain: Terrain | None = None) -> tuple[Array, Array]:
        """Return level and velocity at places.

        Parameters
        ----------
        points : array_like, shape (..., 2)
            World x, y [m].
        terrain : Terrain, optional
            The ground; default: flat at z = 0.

        Returns
        -------
        level : array, shape (...)
            World z [m].
        velocity : array, shape (..., 2)
            Along world x and y [m/s].
        """
        water, nodes = self.as_arrays(terrain)
        places = np.asarray(points, dtype=float)
        found = np.empty((places.size // 2, 3))
        _fill(water, nodes, places.reshape(-1, 2).copy(), found)
        return found[:, 0].reshape(places.shape[:-1]), found[:, 1:].reshape(places.shape)


@njit(cache=True, error_model="numpy")
def _fill(water: NDArray[np.void], nodes: Array, places: Array, found: Array) -> None:
    """Fill level and velocity at places, shape (n, 2) -> (n, 3)."""
    for n in range(len(places)):
        found[n, 0], found[n, 1], found[n, 2] = water_at(water[0], nodes, places[n, 0], places[n, 1])


def require_within(water: Water, history: BodyStates) -> None:
    """Raise SimulationError if a body has left the field of water in which it moves."""
    if water.field is None or water.field.continued:
        return
    outside = ~water.field.holds(history.position[-1, :, :2])
    if outside.any():
        body = int(np.argmax(outside))
        x, y, _ = history.position[-1, body]
        raise SimulationError(
            f"the {BODIES[body].replace('_', ' ')} has left the field of water at {history.time[-1]:.4f} s, at "
            f"({x:.6g}, {y:.6g}) m; {BEYOND}"
        )
