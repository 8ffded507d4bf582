"""Poses and velocities of the solids: in the world's axes, and in the grid's for the kernels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from exumob.flow.grid import HALO
from exumob.support.arrays import Array, checked_array
from exumob.support.kernels import njit
from exumob.vehicle.motion import BodyStates

SHAPES = {"position": (3,), "rotation": (3, 3), "velocity": (3,), "angular_velocity": (3,), "spin": ()}
"""Shape of one row of each field of `Poses`."""
TURNED = 1e-3
"""Largest entry of R R^T - 1 up to which R is a rotation matrix; those of the multibody solver keep 1e-6."""


@dataclass(frozen=True)
class Poses:
    """Positions and velocities of n solids at one instant, world axes.

    Raises
    ------
    ValueError
        If an array has another shape or is not finite, or `rotation` holds other matrices than rotations.
    """

    position: Array
    """Origins [m], shape (n, 3)"""
    rotation: Array
    """Body -> world, shape (n, 3, 3)"""
    velocity: Array
    """Velocity of the origins [m/s], shape (n, 3)"""
    angular_velocity: Array
    """[rad/s], shape (n, 3)"""
    spin: Array
    """Speed of a wheel about the body's own y axis, not part of the angular velocity [rad/s], shape (n,)"""

    def __post_init__(self) -> None:
        n = len(self.position) if np.ndim(self.position) == 2 else None
        for name, shape in SHAPES.items():
            value = getattr(self, name)
            right = type(value) is np.ndarray and value.dtype == np.float64 and value.shape == (n, *shape)
            if not (right and np.isfinite(value).all()):  # most are right, and many are made
                value = checked_array(f"Poses.{name}", value, ("n" if n is None else n, *shape)).copy()
                object.__setattr__(self, name, value)
        off = np.abs(self.rotation @ self.rotation.mT - np.eye(3)).max(axis=(1, 2), initial=0.0)
        if off.max(initial=0.0) > TURNED or (len(off) and np.linalg.det(self.rotation).min() < 0.0):
            raise ValueError(
                f"Poses.rotation[{int(off.argmax())}] is no rotation (R R^T is {off.max():.2g} off the identity, or "
                "its determinant negative); give matrices that turn body axes into world axes."
            )

    @classmethod
    def at_rest(cls, position: Any, rotation: Any = None) -> Poses:
        """Solids that do not move; position [m], shape (n, 3)."""
        single = isinstance(position, np.ndarray | list | tuple) and np.ndim(position) == 1
        position = checked_array("Poses.at_rest.position", [position] if single else position, ("n", 3)).copy()
        n = len(position)
        turned = np.broadcast_to(np.eye(3), (n, 3, 3)).copy() if rotation is None else rotation
        return cls(position, turned, np.zeros((n, 3)), np.zeros((n, 3)), np.zeros(n))

    @classmethod
    def from_states(cls, states: BodyStates) -> Poses:
        """Last instant of the states of the five bodies."""
        spin = np.concatenate([[0.0], states.wheel_speed[-1]])
        return cls(
            states.position[-1], states.rotation[-1], states.velocity[-1], states.angular_velocity[-1], spin
        )  # fmt: skip


def interpolate(begin: Poses, end: Poses, interval: float, part: float) -> Poses:
    """Poses at a part (0 to 1) of an interval [s]: cubic in the positions, rotations along the shortest arc."""
    from scipy.spatial.transform import Rotation

    p = part
    h00, h10, h01, h11 = 2 * p**3 - 3 * p**2 + 1, p**3 - 2 * p**2 + p, 3 * p**2 - 2 * p**3, p**3 - p**2
    position = (
        h00 * begin.position + h10 * interval * begin.velocity + h01 * end.position + h11 * interval * end.velocity
    )
    rotation = begin.rotation.copy()
    for n in range(len(rotation)):
        arc = Rotation.from_matrix(end.rotation[n] @ begin.rotation[n].T).as_rotvec()
        rotation[n] = Rotation.from_rotvec(p * arc).as_matrix() @ begin.rotation[n]
    mean = [(1 - p) * getattr(begin, k) + p * getattr(end, k) for k in ("velocity", "angular_velocity", "spin")]
    return Poses(position, rotation, *mean)


class PlacedSolids(NamedTuple):
    """The n solids as the kernels need them: one row each, in grid axes.

    A flat record: Numba's parallel loops take no record inside another.
    """

    regions: NDArray[np.int64]
    """Index boxes of the cells near them, shape (n, 6): first and end of j, of k, of i.

    A plain array, so that a box may be the start and end of loops and slices; kernels read it by `cells_near`."""
    position: Array
    """Origins [m], shape (n, 3)"""
    rotation: Array
    """Body -> grid, shape (n, 3, 3); its second column is the axle of a wheel"""
    velocity: Array
    """Velocity of the origins [m/s], shape (n, 3)"""
    angular_velocity: Array
    """Angular velocity of the bodies, spin not included [rad/s], shape (n, 3)"""
    spin: Array
    """Angular velocity of the surface relative to the body [rad/s], shape (n, 3)"""
    friction: Array
    """Skin-friction coefficients that act on the water [-], shape (n,)"""
    lug_radius: Array
    """Radius of the cylinder that lugs stand on [m], shape (n,); this and the next three 0 where there are none"""
    lug_half_width: Array
    """Half the width of the cylinder [m], shape (n,)"""
    lug_height: Array
    """Height of the lugs above the cylinder [m], shape (n,)"""
    lug_drag_area: Array
    """Drag coefficient times the area of all lugs of a cylinder [m^2], shape (n,)"""

    def with_bed(self, region: NDArray[np.int64]) -> PlacedSolids:
        """The same and, in one row more, a given bed: at rest at the origin, without friction or lugs."""
        none = np.zeros((1, 3))
        return PlacedSolids(
            np.vstack([self.regions, region]), np.vstack([self.position, none]),
            np.concatenate([self.rotation, np.eye(3)[None]]), np.vstack([self.velocity, none]),
            np.vstack([self.angular_velocity, none]), np.vstack([self.spin, none]), np.append(self.friction, 0.0),
            *(np.append(q, 0.0) for q in (self.lug_radius, self.lug_half_width, self.lug_height, self.lug_drag_area)),
        )  # fmt: skip

    def in_body_axes(self, wrenches: Array) -> Array:
        """Forces and moments of shape (n, 6) given in grid axes, turned into the solids' own."""
        turned = np.empty_like(wrenches)
        for n, rotation in enumerate(self.rotation):
            turned[n, :3], turned[n, 3:] = wrenches[n, :3] @ rotation, wrenches[n, 3:] @ rotation
        return turned


@njit(cache=True, error_model="numpy")
def cells_near(
    regions: NDArray[np.int64], n: int, shape: tuple[int, int, int]
) -> tuple[tuple[int, int], tuple[int, int], tuple[int, int]]:
    """First and end along y, z and x of the cells near solid n that lie in the window; shape of padded fields."""
    return (
        (max(regions[n, 0], HALO), min(regions[n, 1], shape[0] - HALO)),
        (max(regions[n, 2], HALO), min(regions[n, 3], shape[1] - HALO)),
        (max(regions[n, 4], HALO), min(regions[n, 5], shape[2] - HALO)),
    )


@njit(cache=True, error_model="numpy", inline="always")
def body_velocity(solids: PlacedSolids, n: int, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Velocity of the body of solid n [m/s], spin not included, at a place given from its origin [m], grid axes."""
    v, o = solids.velocity, solids.angular_velocity
    return (
        v[n, 0] + o[n, 1] * z - o[n, 2] * y,
        v[n, 1] + o[n, 2] * x - o[n, 0] * z,
        v[n, 2] + o[n, 0] * y - o[n, 1] * x,
    )


@njit(cache=True, error_model="numpy", inline="always")
def surface_velocity(solids: PlacedSolids, n: int, x: float, y: float, z: float) -> tuple[float, float, float]:
    """The same of its surface: spin included."""
    v, o, s = solids.velocity, solids.angular_velocity, solids.spin
    ox, oy, oz = o[n, 0] + s[n, 0], o[n, 1] + s[n, 1], o[n, 2] + s[n, 2]
    return v[n, 0] + oy * z - oz * y, v[n, 1] + oz * x - ox * z, v[n, 2] + ox * y - oy * x
