"""Physical constants."""

GRAVITY = 9.81
"""Standard gravity used everywhere [m/s^2]; acts along -z of the world."""
