"""Rotation matrices about the axes of a frame: x forward, y left, z up."""

from __future__ import annotations

import math

import numpy as np

from exumob.support.arrays import Array


def about_z(angle: float) -> Array:
    """Rotation matrix about z, body to world, for a yaw `angle` [rad], positive to the left; shape (3, 3)."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def about_y(angle: float) -> Array:
    """Rotation matrix about y, body to world, for a pitch `angle` [rad], positive bow down; shape (3, 3)."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def about_x(angle: float) -> Array:
    """Rotation matrix about x, body to world, for a roll `angle` [rad], right side down positive; shape (3, 3)."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
