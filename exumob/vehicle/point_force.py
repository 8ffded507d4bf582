"""A force of the user's own on the vehicle: a winch, a tow rope, a gust of wind."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np

from exumob.support.arrays import Array
from exumob.support.declared import Declared
from exumob.support.errors import SimulationError
from exumob.support.quantities import Quantity
from exumob.vehicle.motion import BODIES

PLACE = Quantity("m", plausible=(-20.0, 20.0))
"""A coordinate in the design frame."""


@dataclass(frozen=True)
class PointForce(Declared):
    """A force that acts at a point of one body.

    The function is called at every iteration of the multibody solver, some three times a step, and while the vehicle
    settles (at time 0). It must depend on its arguments alone, and smoothly. A rope that pulls the hull to a post::

        def pull(time, position, velocity):
            rope = np.array([6.0, 1.0, 0.4]) - position
            length = np.linalg.norm(rope)
            return 200.0 * max(length - 5.0, 0.0) * rope / length

        simulate(vehicle, soil, forces=[PointForce(pull, point=(0.5, 0.0, 0.2))])

    Checkpoints and sweeps know a function by its source and what it holds (`exumob.support.identity`). A dataclass with
    ``__call__`` in its place has fields that a sweep can vary, ``forces.0.force.stiffness``.
    """

    force: Callable[[float, Array, Array], Sequence[float] | Array]
    """Called with the time [s], the point's position [m] and velocity [m/s]; returns the force [N], shape (3,). All in
    world axes."""
    point: tuple[Annotated[float, PLACE], Annotated[float, PLACE], Annotated[float, PLACE]] = (0.0, 0.0, 0.3)
    """Where it acts, in the vehicle's design frame (at ride height)"""
    body: Literal["hull", "front_left", "front_right", "rear_left", "rear_right"] = "hull"
    """The body that it moves with; a wheel stands for its upright, which steers and does not spin"""

    def at(self, time: float, position: Array, velocity: Array) -> Array:
        """Return the force [N], shape (3,).

        Raises
        ------
        SimulationError
            If the function fails, or returns anything but three finite numbers.
        """
        try:
            force = np.asarray(self.force(time, position, velocity), dtype=float)
        except Exception as error:
            raise SimulationError(
                f"PointForce.force on the {self.body}: {type(error).__name__} at {time:.4f} s: {error}"
            ) from error
        if force.shape != (3,) or not np.isfinite(force).all():
            raise SimulationError(
                f"PointForce.force on the {self.body}: it gave {force.tolist()} at {time:.4f} s; return three finite "
                "numbers, the force in world axes [N]."
            )
        return force

    @property
    def body_number(self) -> int:
        """Number of the body among the five."""
        return BODIES.index(self.body)
