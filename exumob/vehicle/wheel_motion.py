"""Where a suspension and the steering take the tyres, in the hull's frame.

Both sides of a vehicle are alike: what holds for a left wheel at all its steering angles holds, mirrored, for the right
one.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from exumob.support.arrays import Array
from exumob.vehicle.running_gear import Wishbones

ANGLES, TRAVELS = 13, 7
"""Steering angles and places along the travel at which a tyre is looked at."""
ARM_ANGLES = np.radians(np.linspace(-75.0, 75.0, 301))
"""Turns of a lower arm from level among which its place for a travel is sought [rad]."""


class Axle(NamedTuple):
    """The left wheel of an axle: its tyre, and how it may move."""

    x: float
    """Centre of the wheel at ride height, design frame [m]"""
    y: float
    """[m]"""
    radius: float
    """Of the tyre [m]"""
    half_width: float
    """Half the width of the tyre [m]"""
    least_angle: float
    """Steering angle to the right [rad], at most 0"""
    greatest_angle: float
    """Steering angle to the left [rad], at least 0"""
    bump: float
    """Travel up to the stop [m]"""
    rebound: float
    """Travel down to the stop [m]"""
    wishbones: Wishbones | None
    """Linkage; None: a pillar along the hull's z axis"""


class Reach(NamedTuple):
    """How far a tyre reaches on all its ways, from the centre of the left wheel at ride height [m]."""

    inboard: float
    """Towards the hull's middle"""
    along: float
    """Ahead or behind, whichever is more"""
    above: float
    """Upwards"""
    below: float
    """Downwards"""


def tyre_poses(axle: Axle, angles: Array, travels: Array) -> tuple[Array, Array]:
    """Return where the left tyre is at each pair of a steering angle and a travel.

    A pillar takes the wheel straight up and lets it turn about the hull's z axis. Wishbones guide the two ball joints
    on circles; the wheel leans with the line between them (camber) and turns about it. The angle about that line is
    taken for the one about the hull's z axis: they differ by the camber squared.

    Parameters
    ----------
    axle : Axle
    angles, travels : array, shape (n,)
        Steering angle, positive to the left [rad]; wheel centre above its ride height [m].

    Returns
    -------
    centers : array, shape (n, 3)
        Wheel centre from that at ride height, hull axes [m].
    axles : array, shape (n, 3)
        Unit vector along the wheel's axle, hull axes.
    """
    angles, travels = np.broadcast_arrays(np.asarray(angles, dtype=float), np.asarray(travels, dtype=float))
    sine, cosine, zero = np.sin(angles), np.cos(angles), np.zeros(angles.shape)
    if axle.wishbones is None:
        return np.stack([zero, zero, travels], axis=1), np.stack([-sine, cosine, zero], axis=1)
    arms = axle.wishbones
    lower_y, lower_z, lean = _linkage(arms)
    centers, axes = np.empty((len(angles), 3)), np.empty((len(angles), 3))
    out, up = arms.ball_joint_inset * cosine, arms.lower_height  # from the lower ball joint to the wheel's centre
    heights = np.empty(0)
    for n, travel in enumerate(travels):
        if n == 0 or angles[n] != angles[n - 1]:
            heights = lower_z + out[n] * np.sin(lean) + up * np.cos(lean)
        place = float(np.interp(travel, heights, np.arange(len(heights))))
        k, part = int(place), place - int(place)
        m = min(k + 1, len(heights) - 1)
        y, z, camber = ((1.0 - part) * values[k] + part * values[m] for values in (lower_y, lower_z, lean))
        s, c = math.sin(camber), math.cos(camber)
        centers[n] = -arms.ball_joint_inset * sine[n], y + out[n] * c - up * s, z + out[n] * s + up * c
        axes[n] = -sine[n], cosine[n] * c, cosine[n] * s
    return centers, axes


@lru_cache(maxsize=64)
def _linkage(arms: Wishbones) -> tuple[Array, Array, Array]:
    """Lower ball joint y, z from the wheel's centre at ride height [m], and lean [rad], over the lower arm's turns."""
    lower = np.stack(
        [
            -arms.ball_joint_inset + arms.lower_length * (np.cos(ARM_ANGLES) - 1.0),
            -arms.lower_height + arms.lower_length * np.sin(ARM_ANGLES),
        ]
    )
    reach = math.sqrt(arms.upper_length**2 - arms.upper_pivot_drop**2)
    pivot = np.array([[-arms.ball_joint_inset - reach], [arms.upper_height - arms.upper_pivot_drop]])
    apart = pivot - lower
    distance = np.hypot(*apart)
    between = arms.lower_height + arms.upper_height
    along = (between**2 - arms.upper_length**2 + distance**2) / (2.0 * distance)
    across = between**2 - along**2
    away = apart / distance
    normal = np.stack([-away[1], away[0]])
    middle = len(ARM_ANGLES) // 2
    ride = np.array([0.0, between]) @ normal[:, middle]  # on which side of the line to the pivot the upper joint lies
    joint = along * away + math.copysign(1.0, ride) * np.sqrt(np.maximum(across, 0.0)) * normal
    lean = np.arctan2(-joint[0], joint[1])
    heights = lower[1] + arms.ball_joint_inset * np.sin(lean) + arms.lower_height * np.cos(lean)
    first = last = middle  # as far as the linkage moves, and its wheel rises with the arm
    while first > 0 and across[first - 1] > 0.0 and heights[first - 1] < heights[first]:
        first -= 1
    while last < len(heights) - 1 and across[last + 1] > 0.0 and heights[last + 1] > heights[last]:
        last += 1
    part = slice(first, last + 1)
    return lower[0, part], lower[1, part], lean[part]


def pose_grid(axle: Axle, angles: int = ANGLES, travels: int = TRAVELS) -> tuple[Array, Array]:
    """Return steering angles [rad] and travels [m] over the whole range, each of shape (n,); both hold 0."""
    low, high = axle.least_angle, axle.greatest_angle
    steered = np.unique([0.0, *np.linspace(low, high, angles if high > low else 1)])
    moved = np.unique([0.0, *np.linspace(-axle.rebound, axle.bump, travels)])
    grid = np.meshgrid(steered, moved, indexing="ij")
    return grid[0].ravel(), grid[1].ravel()


def reach_of(axle: Axle) -> Reach:
    """Return how far the tyre reaches; wherever the axle is (x, y), that is looked at once."""
    return _reach(axle._replace(x=0.0, y=0.0))


@lru_cache(maxsize=512)
def _reach(axle: Axle) -> Reach:
    centers, axes = tyre_poses(axle, *pose_grid(axle))
    extent = axle.half_width * np.abs(axes) + axle.radius * np.sqrt(np.maximum(1.0 - axes**2, 0.0))
    low, high = (centers - extent).min(axis=0), (centers + extent).max(axis=0)
    return Reach(float(-low[1]), float(max(high[0], -low[0])), float(high[2]), float(-low[2]))


def rim_points(axle: Axle, centers: Array, axes: Array, around: int = 48) -> Array:
    """Return points on the two edges of the tread at given poses, from the centre at ride height [m].

    Returns
    -------
    array, shape (poses, 2 * around, 3)
    """
    turn = 2.0 * math.pi / around * np.arange(around)
    level = np.cross(axes, [0.0, 0.0, 1.0])
    level /= np.linalg.norm(level, axis=1, keepdims=True)
    upright = np.cross(level, axes)
    ring = axle.radius * (np.cos(turn)[:, None] * level[:, None] + np.sin(turn)[:, None] * upright[:, None])
    side = axle.half_width * axes[:, None]
    return centers[:, None] + np.concatenate([ring - side, ring + side], axis=1)
