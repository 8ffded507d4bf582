"""Motion of the five bodies, as the multibody solver reports it and every water model reads it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from exumob.support.arrays import Array

BODIES = ("hull", "front_left", "front_right", "rear_left", "rear_right")
"""The five composite bodies, always in this order: the hull, then each wheel with its upright."""

WHEELS = BODIES[1:]

HISTORY_STEP = 1.0e-3
"""Interval of the samples of the motion that every water model sees [s]; the paper's networks were trained at it."""

WRENCH_COMPONENTS = ("Fx", "Fy", "Fz", "Mx", "My", "Mz")
"""Force [N] and moment about the body's origin [N m], body axes."""


@dataclass(frozen=True)
class BodyStates:
    """States of the five bodies at n instants (a history or a single predicted state, n = 1).

    A wheel body's frame is its upright's: it steers but does not spin; its origin is the wheel centre.
    The hull's origin is its centre of mass. Body axes: x forward, y left, z up.
    """

    time: Array
    """Instants [s], shape (n,), increasing."""
    position: Array
    """Position of the origin of each body frame, world axes [m], shape (n, 5, 3)."""
    rotation: Array
    """Rotation matrices body -> world, shape (n, 5, 3, 3)."""
    velocity: Array
    """Velocity of the origin, world axes [m/s], shape (n, 5, 3)."""
    angular_velocity: Array
    """Angular velocity of the body frame, world axes [rad/s], shape (n, 5, 3)."""
    acceleration: Array
    """Acceleration of the origin, world axes [m/s^2], shape (n, 5, 3)."""
    angular_acceleration: Array
    """Angular acceleration of the body frame, world axes [rad/s^2], shape (n, 5, 3)."""
    wheel_speed: Array
    """Spin of each wheel about its own +y axis (positive rolls forward) [rad/s], shape (n, 4)."""

    def __len__(self) -> int:
        """Return the number of instants n."""
        return len(self.time)

    def __getitem__(self, index: slice | NDArray[np.intp]) -> BodyStates:
        """Return the states of a slice of instants (views, not copies), or of chosen ones."""
        return BodyStates(*(getattr(self, name)[index] for name in self.__dataclass_fields__))


def quaternions(rotation: Array) -> Array:
    """Convert rotation matrices to unit quaternions (w, x, y, z), w >= 0; shape (..., 3, 3) -> (..., 4)."""
    from scipy.spatial.transform import Rotation

    q = Rotation.from_matrix(rotation.reshape(-1, 3, 3)).as_quat(canonical=True, scalar_first=True)
    return np.asarray(q).reshape(*rotation.shape[:-2], 4)
