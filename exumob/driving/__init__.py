"""How the vehicle is driven: steering and wheel speed over time, or by a driver who looks."""
