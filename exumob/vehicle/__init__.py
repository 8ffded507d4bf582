"""The vehicle as data: its parameters, and the motion of its five bodies."""
