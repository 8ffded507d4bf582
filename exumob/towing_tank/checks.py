"""Checks before a captive run: whole numbers of intervals, and a motion that is possible."""

from __future__ import annotations

import logging
import math

import numpy as np

from exumob.flow import Poses
from exumob.support.arrays import Array
from exumob.support.checks import require_positive
from exumob.towing_tank.motion import PrescribedMotion
from exumob.vehicle.motion import BODIES
from exumob.vehicle.parameters import Vehicle
from exumob.water.conditions import Water

logger = logging.getLogger(__name__)

SHIFT = 1.0e-5
"""Step of the difference quotients that velocities are compared with [s]."""
SUDDEN = 0.05
"""Speed relative to the water above which a start is sudden [m/s]."""


def whole_multiple(name: str, long: float, of: str, short: float) -> int:
    """Return how many times `short` [s] goes into `long` [s].

    Raises
    ------
    ValueError
        If it is not a whole number; the two are called `of` and `name`.
    """
    require_positive("captive_run", **{name: long, of: short})
    ratio = long / short
    if round(ratio) < 1 or abs(ratio - round(ratio)) > 1e-6 * ratio:
        raise ValueError(
            f"captive_run.{name} = {long:g} s must be a whole multiple of {of} = {short:g} s; choose "
            f"{name} = {max(round(ratio), 1) * short:.9g} s, say."
        )
    return round(ratio)


def check_motion(motion: PrescribedMotion, vehicle: Vehicle, water: Water, duration: float) -> tuple[float, float]:
    """Refuse a motion that is impossible, and warn of one that starts suddenly.

    Returns
    -------
    (float, float)
        Smallest and largest angle of the front wheels during the run [rad], 0 included.

    Raises
    ------
    ValueError
        If poses have the wrong shape or are not finite, if velocities are not the derivatives of positions and
        rotations, or if a front wheel is steered beyond its limit.
    """
    low, high = 0.0, 0.0
    for time in np.linspace(SHIFT, max(duration - SHIFT, 2.0 * SHIFT), 201):
        before, now, after = (motion.poses(vehicle, water, time + shift) for shift in (-SHIFT, 0.0, SHIFT))
        _check_values(now, time)
        _check_derivatives(before, now, after, time)
        angles = front_wheel_angles(now.rotation)
        low, high = min(low, float(angles.min())), max(high, float(angles.max()))
    _warn_of_sudden_start(motion.poses(vehicle, water, 0.0), water)
    limit = vehicle.steering.limit
    largest = max(abs(m[0]) for command in (-limit, limit) for m in vehicle.steering_angles((command, 0.0, 0.0)))
    if max(-low, high) > largest + 1e-9:
        raise ValueError(
            f"motion: steers a front wheel {math.degrees(max(-low, high)):.1f} deg, beyond the "
            f"{math.degrees(largest):.1f} deg of {vehicle.name}; steer less or raise Steering.limit."
        )
    return low, high


def _check_values(now: Poses, time: float) -> None:
    if now.position.shape != (5, 3) or now.rotation.shape != (5, 3, 3):
        raise ValueError(
            f"motion.poses returned {now.position.shape} positions and {now.rotation.shape} rotations; it must "
            "give (5, 3) and (5, 3, 3), the order of exumob.vehicle.motion.BODIES."
        )
    values = (now.position, now.rotation, now.velocity, now.angular_velocity, now.spin)
    if not all(np.isfinite(value).all() for value in values):
        raise ValueError(f"motion.poses is not finite at {time:.4f} s; mend its definition.")


def _check_derivatives(before: Poses, now: Poses, after: Poses, time: float) -> None:
    from scipy.spatial.transform import Rotation

    rate = (after.position - before.position) / (2.0 * SHIFT)
    turned = Rotation.from_matrix(after.rotation @ before.rotation.mT).as_rotvec() / (2.0 * SHIFT)
    for name, found, given in (("velocity", rate, now.velocity), ("angular_velocity", turned, now.angular_velocity)):
        apart = np.abs(found - given).max(axis=1)
        k = int(apart.argmax())
        if apart[k] > 1e-3 * (1.0 + float(np.abs(given[k]).max())):
            raise ValueError(
                f"motion.poses: the {name} of {BODIES[k]} at {time:.4f} s is {apart[k]:.3g} off the derivative of "
                "its place; return velocities that belong to the positions and rotations (world axes)."
            )


def _warn_of_sudden_start(start: Poses, water: Water) -> None:
    slip = np.linalg.norm(start.velocity - water.velocity, axis=1).max()
    if slip > SUDDEN:
        logger.warning(
            "motion: starts at %.2f m/s relative to the water; the first second shows the impulse. Start with the "
            "current and ramp the speed, as CaptiveMotion does.", slip,
        )  # fmt: skip


def front_wheel_angles(rotation: Array) -> Array:
    """Angles of the two front wheels to the hull's heading [rad], shape (..., 2), from rotations (..., 5, 3, 3)."""
    yaw = np.arctan2(rotation[..., 1, 0], rotation[..., 0, 0])
    return np.asarray((yaw[..., 1:3] - yaw[..., :1] + math.pi) % (2.0 * math.pi) - math.pi)
