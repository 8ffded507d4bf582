"""Physical constants."""

GRAVITY = 9.81
"""Acceleration of gravity [m/s^2], the same everywhere in the package; it acts along -z of the world."""
