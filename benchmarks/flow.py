"""Cost of the flow solver: time per cell and step, and pressure iterations, over the number of cells.

Run: `python benchmarks/flow.py [--threads 2] [--quick]`. The vehicle of `vehicle_models/amphibious.py` at D60 moves at
1 m/s against 1 m/s; the figures are means over the last steps after a start.
"""

import argparse
import time

import numpy as np

from exumob.environment import Water
from exumob.flow import FlowSettings, FlowSolver, Grid, Poses, vehicle_solids
from vehicle_models.amphibious import amphibious_vehicle


def poses(vehicle, t, speed=1.0):
    """Vehicle straight ahead at a constant speed [m/s], wheels turning at 10 rad/s."""
    origins = np.vstack([vehicle.hull_origin, vehicle.wheel_centers]) + np.array([speed * t, 0.0, 0.0])
    velocity = np.tile([speed, 0.0, 0.0], (5, 1))
    return Poses(
        origins, np.tile(np.eye(3), (5, 1, 1)), velocity, np.zeros((5, 3)), np.array([0.0, 10.0, 10.0, 10.0, 10.0])
    )


def measure(cell_size, threads, steps=20, dt=1e-3):
    """Cells, milliseconds a step, nanoseconds a cell and step, pressure iterations a step."""
    vehicle = amphibious_vehicle()
    grid = Grid.around_vehicle(vehicle, cell_size)
    solver = FlowSolver(
        grid, vehicle_solids(vehicle, cell_size), Water.at_ratio(0.6, 1.0), FlowSettings(threads=threads)
    )
    solver.start(poses(vehicle, 0.0))
    for n in range(10):
        solver.advance(dt * (n + 1), poses(vehicle, dt * (n + 1)))
    times, iterations = [], 0
    for n in range(10, 10 + steps):
        begin = time.perf_counter()
        solver.advance(dt * (n + 1), poses(vehicle, dt * (n + 1)))
        times.append((time.perf_counter() - begin) / solver.report.steps)
        iterations += solver.report.iterations / solver.report.steps
    each = float(np.median(times))
    return grid.n_cells, 1e3 * each, 1e9 * each / grid.n_cells, iterations / steps


def main():
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--quick", action="store_true")
    arguments = parser.parse_args()
    print("   cells  ms/step  ns/cell/step  iterations/step")
    for cell_size in (0.030, 0.022) if arguments.quick else (0.032, 0.025, 0.020, 0.0165, 0.0145):
        cells, milliseconds, nanoseconds, iterations = measure(cell_size, arguments.threads)
        print(f"{cells:8d} {milliseconds:8.1f} {nanoseconds:13.0f} {iterations:16.1f}", flush=True)


if __name__ == "__main__":
    main()
