"""A small renderer: shaded triangles in perspective with a depth buffer. No display, no graphics library."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike

from exumob.support.arrays import Array
from exumob.support.declared import Declared
from exumob.support.kernels import njit
from exumob.support.quantities import Quantity

PLACE = Quantity("m", at_least=-1e6, at_most=1e6)
"""Point in space"""
PIXELS = Quantity("pixels", at_least=1, at_most=20_000)
"""Size of a picture"""
SAMPLES = 2
"""Samples of a pixel along each side, averaged against jagged edges"""


@dataclass(frozen=True)
class Camera(Declared):
    """A pinhole camera; z is up."""

    eye: Annotated[tuple[float, float, float], PLACE]
    """Where it is [m]"""
    target: Annotated[tuple[float, float, float], PLACE]
    """What it looks at [m]"""
    width: Annotated[int, PIXELS]
    """Width of the picture [pixels]"""
    height: Annotated[int, PIXELS]
    """Height of the picture [pixels]"""
    scale: Annotated[float, Quantity("pixels", above=0.0, at_most=1e9)]
    """Length in the picture [pixels] of a line that is as long as its distance from the camera"""
    middle: Annotated[tuple[float, float], Quantity("pixels", at_least=-1e9, at_most=1e9)]
    """Pixel x, y (down) of the target"""

    def _check(self) -> None:
        if math.hypot(self.target[0] - self.eye[0], self.target[1] - self.eye[1]) < 1e-9:
            raise ValueError(f"Camera.eye = {self.eye} lies straight above or below its target; move it aside.")

    @classmethod
    def around(
        cls, points: Array, eye: tuple[float, float, float], width: int, height: int, margin: float = 0.02
    ) -> Camera:
        """Camera at `eye` [m] whose picture just holds points of shape (n, 3) [m], with a margin [-]."""
        target = tuple(points.mean(axis=0))
        plain = cls(eye, target, width, height, 1.0, (0.0, 0.0))
        seen = plain.project(points)[:, :2]
        low, high = seen.min(axis=0), seen.max(axis=0)
        size = np.array([width, height])
        scale = float(((1.0 - 2.0 * margin) * size / (high - low)).min())
        shift = 0.5 * size - scale * 0.5 * (low + high)
        return cls(eye, target, width, height, scale, (float(shift[0]), float(shift[1])))

    def project(self, points: Array) -> Array:
        """Pixel x, y (down) and 1 / distance [1/m] of points of shape (..., 3); the last is <= 0 behind the camera."""
        eye, target = np.array(self.eye), np.array(self.target)
        ahead = (target - eye) / np.linalg.norm(target - eye)
        right = np.cross(ahead, [0.0, 0.0, 1.0])
        right /= np.linalg.norm(right)
        down = np.cross(ahead, right)
        seen = (points - eye) @ np.stack([right, down, ahead]).T
        inverse = 1.0 / np.where(np.abs(seen[..., 2]) > 1e-9, seen[..., 2], -1e-9)
        pixels = self.scale * seen[..., :2] * inverse[..., None] + np.array(self.middle)
        return np.concatenate([pixels, inverse[..., None]], axis=-1)


def render(triangles: Array, colors: Array, camera: Camera, background: ArrayLike = (1.0, 1.0, 1.0)) -> Array:
    """Draw triangles, the near ones before the far ones.

    Parameters
    ----------
    triangles : array, shape (n, 3, 3)
        Corners [m]. Triangles that reach behind the camera or have a corner that is not finite are left out.
    colors : array, shape (n, 3, 3)
        Red, green, blue of each corner, 0 to 1; shading (`lit`) is up to the caller.
    camera : Camera
    background : array-like, shape (3,)

    Returns
    -------
    array, shape (height, width, 3)
    """
    corners = camera.project(triangles)
    corners[..., :2] *= SAMPLES
    drawn = np.isfinite(corners).all(axis=(1, 2)) & (corners[..., 2] > 1e-6).all(axis=1)
    image = np.empty((camera.height * SAMPLES, camera.width * SAMPLES, 3))
    image[:] = background
    _rasterize(corners[drawn], np.ascontiguousarray(colors[drawn]), image, np.zeros(image.shape[:2]))
    parts = [image[i::SAMPLES, j::SAMPLES] for i in range(SAMPLES) for j in range(SAMPLES)]
    return np.asarray(np.clip(sum(parts) / len(parts), 0.0, 1.0))


def normals_of(triangles: Array) -> Array:
    """Unit normals, shape (n, 3), outward for corners counter-clockwise seen from outside."""
    n = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    return np.asarray(n / np.maximum(np.linalg.norm(n, axis=-1, keepdims=True), 1e-300))


def lit(colors: Array, normals: Array, points: Array, camera: Camera, light: ArrayLike, shine: float = 0.0) -> Array:
    """Colours under a distant light: ambient, diffuse (Lambert) and specular (Blinn-Phong) parts.

    Parameters
    ----------
    colors, normals, points : arrays, shape (..., 3)
        Colour 0 to 1, unit normal and place [m] of each point.
    camera : Camera
    light : array-like, shape (3,)
        Direction towards the light.
    shine : float
        Strength of the highlights [-].
    """
    towards = np.asarray(light, dtype=float) / np.linalg.norm(light)
    diffuse = np.clip(normals @ towards, 0.0, None)[..., None]
    view = np.array(camera.eye) - points
    half = view / np.linalg.norm(view, axis=-1, keepdims=True) + towards
    half /= np.linalg.norm(half, axis=-1, keepdims=True)
    gloss = np.clip((normals * half).sum(axis=-1, keepdims=True), 0.0, None) ** 60
    return np.asarray(np.clip(colors * (0.45 + 0.62 * diffuse) + shine * gloss, 0.0, 1.0))


@njit(cache=True)
def _rasterize(corners: Array, colors: Array, image: Array, nearest: Array) -> None:
    """Fill triangles (n, 3, 3: pixel x, y, 1 / distance) into an image where they are nearer than what is there."""
    rows, columns = nearest.shape
    for n in range(len(corners)):
        x0, y0, x1, y1 = corners[n, 0, 0], corners[n, 0, 1], corners[n, 1, 0], corners[n, 1, 1]
        x2, y2 = corners[n, 2, 0], corners[n, 2, 1]
        area = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)
        if abs(area) < 1e-12:
            continue
        left, right = min(x0, x1, x2), max(x0, x1, x2)
        top, bottom = min(y0, y1, y2), max(y0, y1, y2)
        if right < 0.0 or bottom < 0.0 or left > columns or top > rows:
            continue
        first, last = max(int(left - 0.5), 0), min(int(right + 0.5) + 1, columns)
        for row in range(max(int(top - 0.5), 0), min(int(bottom + 0.5) + 1, rows)):
            y = row + 0.5
            for column in range(first, last):
                x = column + 0.5
                b = ((x - x0) * (y2 - y0) - (x2 - x0) * (y - y0)) / area
                c = ((x1 - x0) * (y - y0) - (x - x0) * (y1 - y0)) / area
                a = 1.0 - b - c
                if a < 0.0 or b < 0.0 or c < 0.0:
                    continue
                near = a * corners[n, 0, 2] + b * corners[n, 1, 2] + c * corners[n, 2, 2]
                if near > nearest[row, column]:
                    nearest[row, column] = near
                    for k in range(3):
                        image[row, column, k] = a * colors[n, 0, k] + b * colors[n, 1, k] + c * colors[n, 2, k]
