"""A free rigid body as the moving side of a coupling (`exumob.coupling.scheme.Mechanism`), in place of a vehicle."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
import xarray as xr

from exumob.flow import FlowSolver, Poses, Solid
from exumob.support.arrays import Array
from exumob.support.constants import GRAVITY
from exumob.support.declared import checked
from exumob.support.quantities import Quantity
from exumob.vehicle.motion import BodyStates

MICRO_STEPS = 10
"""Number of steps of the body in a macro step."""


def uniform_box_inertia(mass: float, solid: Solid) -> Array:
    """Principal moments of inertia of a uniform box [kg m^2], shape (3,); `mass` [kg]."""
    a, b, c = (solid.high - solid.low) ** 2
    return mass / 12.0 * np.array([b + c, a + c, a + b])


@dataclass(frozen=True)
class _Instant:
    time: float
    position: Array
    rotation: Array
    velocity: Array
    rate: Array
    acceleration: Array
    angular_acceleration: Array


class FreeBody:
    """Newton's and Euler's equations of one body under gravity and the water, in midpoint steps.

    Parameters
    ----------
    mass : float
        [kg]
    inertia : array-like, shape (3,)
        Principal moments of inertia about the centre of mass, body axes [kg m^2].
    position : array-like, shape (3,)
        Position of the centre of mass at the start, at rest [m].
    pull : array-like, shape (3,)
        Acceleration by outer forces other than the weight, world axes [m/s^2].
    """

    @checked
    def __init__(
        self,
        mass: Annotated[float, Quantity("kg", above=0.0)],
        inertia: Annotated[Any, Quantity("kg m^2", above=0.0, shape=(3,))],
        position: Annotated[Any, Quantity("m", shape=(3,))],
        pull: Annotated[Any, Quantity("m/s^2", shape=(3,))] = (0.0, 0.0, 0.0),
    ) -> None:
        self.mass, self.inertia = mass, np.asarray(inertia, dtype=float)
        self.outside = np.asarray(pull, dtype=float) - np.array([0.0, 0.0, GRAVITY])
        zero = np.zeros(3)
        self._now = _Instant(0.0, np.asarray(position, dtype=float), np.eye(3), zero, zero, zero, zero)

    @property
    def time(self) -> float:
        """Time reached [s]."""
        return self._now.time

    @property
    def history(self) -> BodyStates:
        """The states kept: the present only."""
        return self.present()

    def present(self) -> BodyStates:
        """Return the states now, one instant of one body."""
        return _states(self._now)

    def predict(self, step: float) -> BodyStates:
        """Return the states `step` [s] ahead: q + h v + h^2/2 a and v + h a, as `MultibodyVehicle.predict`."""
        now = self._now
        return _states(
            _Instant(
                now.time + step, now.position + step * now.velocity + 0.5 * step**2 * now.acceleration,
                _turned(step * now.rate + 0.5 * step**2 * now.angular_acceleration) @ now.rotation,
                now.velocity + step * now.acceleration, now.rate + step * now.angular_acceleration,
                now.acceleration, now.angular_acceleration,
            )
        )  # fmt: skip

    def advance(self, end_time: float, wrenches: Array, rate: Array | None = None) -> None:
        """Go on to `end_time` [s] under mean wrenches, shape (1, 6), that change at `rate`."""
        now = self._now
        h = (end_time - now.time) / MICRO_STEPS
        middle = 0.5 * (end_time + now.time)
        time, x, r, v, w = now.time, now.position, now.rotation, now.velocity, now.rate
        for _ in range(MICRO_STEPS):
            wrench = wrenches[0] if rate is None else wrenches[0] + (time + 0.5 * h - middle) * rate[0]
            half = _turned(0.5 * h * w) @ r
            body_rate = half.T @ w
            turning = half @ ((wrench[3:] - np.cross(body_rate, self.inertia * body_rate)) / self.inertia)
            a = self.outside + half @ wrench[:3] / self.mass
            x = x + h * v + 0.5 * h * h * a
            r = _turned(h * w + 0.5 * h * h * turning) @ r
            v, w, time = v + h * a, w + h * turning, time + h
        self._now = _Instant(end_time, x, r, v, w, a, turning)

    def save(self, histories: bool = True) -> _Instant:
        """Return the present, which is never changed."""
        return self._now

    def restore(self, saved: _Instant) -> None:
        """Return to a saved state."""
        self._now = saved


class TankWater:
    """The flow solver round free bodies as a water model (`exumob.water.hydrodynamics.Hydrodynamics`)."""

    def __init__(self, solver: FlowSolver) -> None:
        self.solver = solver

    def start(self, vehicle: object, water: object, macro_step: float) -> None:
        """Do nothing: the solver has been started."""

    def wrenches(self, history: BodyStates, predict: Any) -> Array:
        """Advance the flow to the states that `predict` gives; mean loads over the step."""
        ahead = predict()
        return self.solver.advance(float(ahead.time[-1]), Poses.from_states(ahead))

    def save(self, histories: bool = True) -> dict[str, Any]:
        """Return the state of the flow."""
        return self.solver.save()

    def restore(self, saved: dict[str, Any]) -> None:
        """Return to a saved state."""
        self.solver.restore(saved)

    def record(self) -> dict[str, xr.DataArray]:
        """Return nothing to record."""
        return {}


def _states(now: _Instant) -> BodyStates:
    rows = (now.position, now.rotation, now.velocity, now.rate, now.acceleration, now.angular_acceleration)
    x, r, v, w, a, turning = (np.array(row)[None, None] for row in rows)
    return BodyStates(np.array([now.time]), x, r, v, w, a, turning, np.zeros((1, 0)))


def _turned(arc: Array) -> Array:
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_rotvec(arc).as_matrix())
