"""Laying the vehicle on its four contacts, wherever on a terrain it starts."""

from __future__ import annotations

import math

import numpy as np

from exumob.ground.terrain import Terrain
from exumob.support.arrays import Array
from exumob.vehicle.parameters import Vehicle
from exumob.vehicle.start_pose import StartPose

ROUNDS = 50
"""Most rounds of fitting the pose to the ground under the wheels."""


def standing_pose(
    vehicle: Vehicle, terrain: Terrain, start: StartPose | None = None, hull_points: Array | None = None
) -> tuple[Array, Array]:  # fmt: skip
    """Return the pose of the design frame in which the vehicle, as it is at ride height, lies on the terrain.

    The frame lies over the start and heads as that says, by default over the world's origin and along world x. Its
    height, pitch and roll are those of the plane that fits the ground under the four wheel centres best (least
    squares); then it is raised until no tyre reaches below the surface, and no point of the hull. On a plane all four
    tyres touch; elsewhere the springs do the rest while the vehicle settles.

    Parameters
    ----------
    vehicle : Vehicle
    terrain : Terrain
    start : StartPose, optional
    hull_points : array, shape (n, 3), optional
        Points of the hull that must not start in the soil, design frame [m].

    Returns
    -------
    position : array, shape (3,)
        Origin of the design frame, world axes [m].
    rotation : array, shape (3, 3)
        Rotation matrix, design frame to world.
    """
    start = StartPose() if start is None else start
    place = np.array([start.x, start.y])
    height, normal = terrain.height_and_normal(start.x, start.y)
    slopes = -normal[:2] / normal[2]
    for _ in range(ROUNDS):
        rotation = _frame_on(slopes, start.heading)
        centers = np.array([*place, height]) + vehicle.wheel_centers @ rotation.T
        gaps = np.array([_above_contact(vehicle.wheel.radius, terrain, center) for center in centers])
        fit = np.column_stack([np.ones(4), centers[:, :2] - place])
        raised, *turned = np.linalg.lstsq(fit, -gaps, rcond=None)[0]
        if max(abs(raised), *np.abs(turned)) < 1e-12:
            break
        height, slopes = height + raised, np.clip(slopes + turned, -2.0, 2.0)
    else:  # no pose fits better and better; the last one, raised, is as good as any
        rotation = _frame_on(slopes, start.heading)
        centers = np.array([*place, height]) + vehicle.wheel_centers @ rotation.T
        gaps = np.array([_above_contact(vehicle.wheel.radius, terrain, center) for center in centers])
    lowest = min(gaps.min(), 0.0)
    if hull_points is not None and terrain.heights is not None:  # at ride height it is clear of a plane
        placed = np.array([*place, height]) + hull_points @ rotation.T
        lowest = min([lowest, *(z - terrain.height_and_normal(x, y)[0] for x, y, z in placed)])
    return np.array([*place, height - lowest]), rotation


def _above_contact(radius: float, terrain: Terrain, center: Array) -> float:
    """Height of a wheel centre above the one at which its tyre just touches [m]."""
    ground, normal = terrain.height_and_normal(center[0], center[1])
    return float(center[2] - ground - radius / normal[2])


def _frame_on(slopes: Array, heading: float) -> Array:
    """Rotation matrix whose z axis is the normal of a plane of these slopes, and with x along a heading."""
    normal = np.array([-slopes[0], -slopes[1], 1.0])
    normal /= np.linalg.norm(normal)
    left = np.cross(normal, [math.cos(heading), math.sin(heading), 0.0])
    left /= np.linalg.norm(left)
    return np.column_stack([np.cross(left, normal), left, normal])
