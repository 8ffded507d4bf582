"""Driving the vehicle: steering and wheel speed over time, or by a driver who looks."""
