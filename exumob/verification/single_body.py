"""A single body that is moved through the water: its pose, and the loads on the way."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from exumob.flow import FlowSolver, Poses
from exumob.support.arrays import Array
from exumob.support.declared import checked
from exumob.support.rotations import about_z
from exumob.verification.options import Duration, Interval


def one_pose(position: Sequence[float] | Array, velocity: Sequence[float] | Array, yaw: float = 0.0,
             yaw_rate: float = 0.0) -> Poses:  # fmt: skip
    """Pose of a single solid; position [m], velocity [m/s], yaw [rad], yaw rate [rad/s]."""
    return Poses(
        np.array([position], dtype=float), about_z(yaw)[None], np.array([velocity], dtype=float),
        np.array([[0.0, 0.0, yaw_rate]]), np.zeros(1),
    )  # fmt: skip


@checked
def loads_over(solver: FlowSolver, pose: Callable[[float], Poses], dt: Interval, duration: Duration) -> Array:
    """Start at pose(0) and go on in intervals of `dt` [s]: loads [N, N m], shape (n, 6)."""
    solver.start(pose(0.0))
    return np.array([solver.advance(dt * (n + 1), pose(dt * (n + 1)))[0] for n in range(round(duration / dt))])
