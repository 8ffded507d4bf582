"""How near the wheels come to the body on all their ways: steered from stop to stop, in any place of their travel."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from exumob.support.arrays import Array
from exumob.vehicle.body import BodyShape, body_shape, clears_by_design, faces_of, triangulated
from exumob.vehicle.hull import Hull
from exumob.vehicle.wheel_motion import Axle, pose_grid, reach_of, tyre_poses

COARSE, FINER, LOOKS = 6.0, 4.0, 4
"""Points along a tyre's radius on the body's surface at first, how many times as many in each further look, and looks.
"""
ANGLES, TRAVELS, NEAR = 9, 5, 5
"""Steering angles and places along the travel of the first look, and of each about the closest place of a further one.
"""
MOST_ALONG = 200
"""Points along a side of a triangle at most."""
BLOCK = 500_000
"""Distances that are held at a time."""


class WheelGap(NamedTuple):
    """The place where a tyre comes closest to the body."""

    gap: float
    """Distance [m]; below 0: the tyre is so deep in the body"""
    axle: int
    """0: front, 1: rear"""
    side: int
    """1: left, -1: right"""
    angle: float
    """Steering angle of the wheel there, positive to the left [rad]"""
    travel: float
    """Wheel above its ride height there [m]"""
    point: tuple[float, float, float]
    """Place on the body's surface, design frame [m]"""

    @property
    def wheel(self) -> str:
        """Name of the wheel in words."""
        return f"{('front', 'rear')[self.axle]} {'left' if self.side > 0 else 'right'}"

    def __str__(self) -> str:
        """Where it is, in words."""
        steered = f" steered {math.degrees(self.angle):+.1f} deg" if self.angle else ""
        moved = f"{1e3 * abs(self.travel):.0f} mm {'up' if self.travel > 0.0 else 'down'}" if self.travel else "at rest"
        return (
            f"the {self.wheel} tyre{steered}, {moved}, at ({', '.join(f'{x:.3f}' for x in self.point)}) m of the body"
        )


def least_gap(hull: Hull, axles: tuple[Axle, Axle]) -> WheelGap:
    """Return where a tyre comes closest to a hull of boxes.

    The body's surface is looked at in points, more and more densely where it is nearest; the tyre is a cylinder with
    sharp edges. What is found is the least distance to about a hundredth of the tyre's radius. That a suspension's
    stops give way by some millimetres is left out.

    Parameters
    ----------
    hull : Hull
        Without a mesh.
    axles : (Axle, Axle)
        Front and rear (`Vehicle.axles`).
    """
    return _least_gap(body_shape(hull, axles), axles)


def wheels_clear(hull: Hull, axles: tuple[Axle, Axle]) -> WheelGap | None:
    """Return where a tyre enters a hull of boxes; None if none does.

    Most vehicles are told clear at once: all of the body lies inboard of the tyres, or its arches are large enough on
    all sides. Others are looked at by `least_gap`, once for each shape.
    """
    half = 0.5 * max(part.width for part in hull.parts)
    for axle in axles:
        if axle.y - reach_of(axle).inboard >= half:
            continue
        if hull.wheel_arches is None or not clears_by_design(hull.wheel_arches, axle):
            found = least_gap(hull, axles)
            return found if found.gap < -1e-6 * axle.radius else None
    return None


@lru_cache(maxsize=256)
def _least_gap(shape: BodyShape, axles: tuple[Axle, Axle]) -> WheelGap:
    return gap_to(triangulated(faces_of(shape)), axles, sides=(1,))


def gap_to(triangles: Array, axles: tuple[Axle, Axle], sides: tuple[int, ...] = (1, -1)) -> WheelGap:
    """Return where a tyre comes closest to a surface.

    Parameters
    ----------
    triangles : array, shape (n, 3, 3)
        Design frame [m].
    axles : (Axle, Axle)
        Front and rear.
    sides : tuple of int
        1: the left wheels, -1: the right ones; one side says all of a body that is alike on both.
    """
    found = [
        _closest(triangles * [1.0, float(side), 1.0], axle)._replace(axle=n, side=side)
        for n, axle in enumerate(axles) for side in sides
    ]  # fmt: skip
    closest = min(found, key=lambda gap: gap.gap)
    if closest.side < 0:
        x, y, z = closest.point
        closest = closest._replace(angle=-closest.angle, point=(x, -y, z))
    return closest


def _closest(triangles: Array, axle: Axle) -> WheelGap:
    """Where the left tyre of an axle comes closest; what is further away than a radius is infinitely far."""
    reach, radius = reach_of(axle), axle.radius
    center = np.array([axle.x, axle.y, radius])
    outboard = 2.0 * radius + axle.half_width
    low = center - np.array([reach.along, reach.inboard, reach.below]) - radius
    high = center + np.array([reach.along + radius, outboard, reach.above + radius])
    angles, travels = pose_grid(axle, ANGLES, TRAVELS)
    step_angle = (axle.greatest_angle - axle.least_angle) / (ANGLES - 1)
    step_travel = (axle.bump + axle.rebound) / (TRAVELS - 1)
    spacing = radius / COARSE
    best = WheelGap(math.inf, 0, 1, 0.0, 0.0, (math.nan, math.nan, math.nan))
    for _ in range(LOOKS):
        points = _points_on(triangles, low, high, spacing)
        if len(points) == 0:
            return best
        gap, pose, point = _least_distance(points - center, axle, angles, travels)
        if gap < best.gap:
            x, y, z = (float(c) for c in points[point])
            best = WheelGap(gap, 0, 1, float(angles[pose]), float(travels[pose]), (x, y, z))
        near = np.linspace(-1.0, 1.0, NEAR)
        steered = np.clip(best.angle + step_angle * near, axle.least_angle, axle.greatest_angle)
        moved = np.clip(best.travel + step_travel * near, -axle.rebound, axle.bump)
        grid = np.meshgrid(np.unique(steered), np.unique(moved), indexing="ij")
        angles, travels = grid[0].ravel(), grid[1].ravel()
        low, high = np.array(best.point) - 2.0 * spacing, np.array(best.point) + 2.0 * spacing
        step_angle, step_travel, spacing = 0.5 * step_angle, 0.5 * step_travel, spacing / FINER
    return best


def _least_distance(points: Array, axle: Axle, angles: Array, travels: Array) -> tuple[float, int, int]:
    """Least distance of points from the tyre at all poses [m], and the numbers of pose and point."""
    centers, axes = tyre_poses(axle, angles, travels)
    best = (math.inf, 0, 0)
    rows = max(1, BLOCK // len(points))
    for first in range(0, len(centers), rows):
        part = slice(first, first + rows)
        away = points[None] - centers[part, None]
        along = np.einsum("pni,pi->pn", away, axes[part])
        outward = np.sqrt(np.maximum(np.einsum("pni,pni->pn", away, away) - along**2, 0.0)) - axle.radius
        aside = np.abs(along) - axle.half_width
        distance = np.hypot(np.maximum(outward, 0.0), np.maximum(aside, 0.0))
        distance += np.minimum(np.maximum(outward, aside), 0.0)
        n = int(distance.argmin())
        pose, point = divmod(n, len(points))
        best = min(best, (float(distance[pose, point]), first + pose, point))
    return best


def _points_on(triangles: Array, low: Array, high: Array, spacing: float) -> Array:
    """Points on the triangles at most about `spacing` apart, those within a box [m]; shape (n, 3)."""
    near = triangles[((triangles.max(axis=1) >= low) & (triangles.min(axis=1) <= high)).all(axis=1)]
    small = np.linalg.norm(near - np.roll(near, 1, axis=1), axis=2).max(axis=1) <= spacing
    found = [near[small].reshape(-1, 3)]
    for a, b, c in near[~small]:
        corners = _clipped(np.array([[*a, 0.0, 0.0], [*b, 1.0, 0.0], [*c, 0.0, 1.0]]), low, high)
        if len(corners) == 0:
            continue
        u, v = (
            np.linspace(part.min(), part.max(), 1 + min(MOST_ALONG, math.ceil(np.ptp(part) * length / spacing)))
            for part, length in zip(corners[:, 3:].T, (np.linalg.norm(b - a), np.linalg.norm(c - a)), strict=True)
        )
        places = (a + u[:, None, None] * (b - a) + v[None, :, None] * (c - a))[u[:, None] + v <= 1.0 + 1e-12]
        found += [places, corners[:, :3]]
    points = np.concatenate(found)
    return points[((points >= low) & (points <= high)).all(axis=1)]


def _clipped(polygon: Array, low: Array, high: Array) -> Array:
    """The part of a convex polygon within a box; further columns are interpolated."""
    for axis in range(3):
        for sign, limit in ((1.0, low[axis]), (-1.0, -high[axis])):
            distance = sign * polygon[:, axis] - limit
            kept = []
            for i, here in enumerate(distance):
                there = distance[i - 1]
                if here * there < 0.0:
                    kept.append(polygon[i - 1] + there / (there - here) * (polygon[i] - polygon[i - 1]))
                if here >= 0.0:
                    kept.append(polygon[i])
            if not kept:
                return np.empty((0, polygon.shape[1]))
            polygon = np.array(kept)
    return polygon
