"""The vehicle in its worst case: 1 m/s against 1 m/s at 60 % depth, front wheels steering."""

import math

import numpy as np
import pytest

from exumob.flow import FlowSettings, FlowSolver, Grid, Poses, vehicle_solids
from exumob.water.conditions import Water
from vehicle_models.amphibious import amphibious_vehicle

VEHICLE = amphibious_vehicle()


def turned(angle):
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def poses(t, side=1.0, ramp=0.5):
    """Speed to 1 m/s by a quintic over 0.5 s; steering 15 degrees, one sine period in 2 s."""
    r = min(t / ramp, 1.0)
    share = r**3 * (10.0 - 15.0 * r + 6.0 * r * r)
    way = ramp * r**4 * (2.5 - 3.0 * r + r * r) + max(t - ramp, 0.0)
    angle, rate = 0.26 * side * math.sin(math.pi * t), 0.26 * side * math.pi * math.cos(math.pi * t)
    origins = np.vstack([VEHICLE.hull_origin, VEHICLE.wheel_centers]) + np.array([way, 0.0, 0.0])
    rotation = np.array([np.eye(3), turned(angle), turned(angle), np.eye(3), np.eye(3)])
    spin = np.array([0.0, 10.0, 10.0, 10.0, 10.0]) * share
    omega = np.zeros((5, 3))
    omega[1:3, 2] = rate
    return Poses(origins, rotation, np.tile([share, 0.0, 0.0], (5, 1)), omega, spin)


def run(cell_size, duration, dt=1e-3, side=1.0):
    solver = FlowSolver(
        Grid.around_vehicle(VEHICLE, cell_size), vehicle_solids(VEHICLE, cell_size), Water.at_ratio(0.6, 1.0),
        FlowSettings(),
    )  # fmt: skip
    solver.start(poses(0.0, side))
    loads = [solver.advance(dt * (n + 1), poses(dt * (n + 1), side)) for n in range(round(duration / dt))]
    return solver, np.array(loads)


def test_vehicle_starts_and_mirrors():
    """Coarse and short: loads of a floating, dragged vehicle, which mirror with the steering to the solver's tolerance.

    At rest a draught of 42 mm gives the hull 175 N, a wheel 15.5 N; at 0.1 m/s the lift may miss them by 6 %. The
    current of 1 m/s pushes the hull back, with 20 N on these cells.
    """
    _, loads = run(0.04, 0.12, dt=4e-3)
    _, mirrored = run(0.04, 0.12, dt=4e-3, side=-1.0)
    swap = [0, 2, 1, 4, 3]
    sign = np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])
    assert np.abs(loads[1:] - sign * mirrored[1:, swap]).max() < 1e-4 * np.abs(loads[1:]).max()
    hull = loads[-10:, 0].mean(axis=0)
    assert hull[0] == pytest.approx(-20.0, abs=1.0)
    assert hull[2] == pytest.approx(175.0, rel=0.06)
    assert loads[-10:, 1:, 2].mean(axis=0) == pytest.approx(np.full(4, 15.5), rel=0.06)


@pytest.mark.slow
def test_vehicle_runs_two_seconds_without_noise():
    """Noise: what a moving average over 21 ms leaves in the second half; spikes apart (at most 1 % of the steps)."""
    solver, loads = run(0.025, 2.0)
    assert np.all(np.isfinite(loads))
    hull = loads[:, 0]
    smooth = np.stack([np.convolve(hull[:, c], np.ones(21) / 21.0, "same") for c in range(6)], axis=1)
    mean, rest = hull[1000:1950].mean(axis=0), np.abs(hull - smooth)[1000:1950]
    assert 1.48 * np.median(rest[:, 0]) < 0.01 * abs(mean[0])
    assert 1.48 * np.median(rest[:, 2]) < 0.03 * abs(mean[2])
    assert np.mean(rest[:, 2] > 0.1 * abs(mean[2])) < 0.01
    far = solver.surface_height()[:, -12:-4]  # ahead of the bow wave the level has not drifted
    assert np.abs(far - 0.12).max() < 0.002
