"""What two remedies would save in the flow solver that it has not: single precision, and a second level of the grid.

Run: `python benchmarks/flow_savings.py [--cell-size 0.028] [--time 1.5]` (a quarter of an hour, as the kernels are
compiled a second time). The multigrid of the pressure is in single precision already; this is about all else.

- **Saved**: each kernel is called with the arguments of a real step (the vehicle at D60 moves at 1 m/s against 1 m/s),
  and with the same in single precision, in turn; those that numba does not compile for it are named.
- **Lost**: the same drive, and water that breaks in a closed tank, with all fields rounded to single precision after
  each step. Beside it the drive a nanometre further on, which a turbulent flow answers with other eddies.
- **A second level**: cells that are left at 18 mm if those further than some margin from the vehicle may be twice as
  wide; counted, not computed.
"""

import argparse
import os
import statistics
import time

os.environ.setdefault("NUMBA_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np
from flow_scaling import poses
from flow_step import PHASES, STEP
from numba.core.errors import NumbaError

from exumob.flow import FlowSettings, FlowSolver, Grid, vehicle_solids
from exumob.verification import momentum
from exumob.water.conditions import Water
from vehicle_models.amphibious import amphibious_vehicle

FIELDS = ("u", "v", "w", "ex", "ey", "ez", "cx", "cy", "cz", "fraction", "phi", "eta_y", "turbulence")
"""Of the state of the flow."""
REPEATS = 7
"""Pairs of calls of each kernel."""
PUSH = 1e-9
"""Time by which the vehicle is ahead of itself [s]: at 1 m/s a nanometre."""


def single(value):
    """The same with all numbers in single precision, through tuples of whatever kind."""
    if isinstance(value, np.ndarray):
        return value.astype(np.float32) if value.dtype == np.float64 else value.copy()
    if isinstance(value, tuple):
        parts = [single(one) for one in value]
        return type(value)(*parts) if hasattr(value, "_fields") else tuple(parts)
    return np.float32(value) if isinstance(value, float) else value


def double(value):
    """A copy, so that a kernel that is called again finds what it found the first time."""
    if isinstance(value, np.ndarray):
        return value.copy()
    if isinstance(value, tuple):
        parts = [double(one) for one in value]
        return type(value)(*parts) if hasattr(value, "_fields") else tuple(parts)
    return value


def captured(solver, until):
    """Arguments of each compiled kernel in one step of the flow, by name."""
    found, owners = {}, []

    def watched(name, call):
        def run(*arguments):
            found.setdefault(name, (call, double(arguments)))
            return call(*arguments)

        return run

    for owner, name in (kernel for phase in PHASES.values() for kernel in phase):
        call = getattr(owner, name)
        if hasattr(call, "py_func"):  # compiled; the others are methods that call such
            owners.append((owner, name, call))
            setattr(owner, name, watched(name, call))
    solver.advance(until, poses(amphibious_vehicle(), until))
    for owner, name, call in owners:
        setattr(owner, name, call)
    return found


def timed(call, arguments):
    """Time of a call [s]."""
    begin = time.perf_counter()
    call(*arguments)
    return time.perf_counter() - begin


def saved(solver, until):
    """Print the time of each kernel in both precisions."""
    print("| kernel | double [ms] | single over double |\n|---|---:|---:|")
    both = [0.0, 0.0]
    for name, (call, arguments) in captured(solver, until).items():
        try:
            call(*single(arguments))
        except (NumbaError, TypeError, ZeroDivisionError) as error:
            print(f"| {name} | | not compiled ({type(error).__name__}) |")
            continue
        pairs = [(timed(call, double(arguments)), timed(call, single(arguments))) for _ in range(REPEATS)]
        one, ratio = statistics.median(a for a, _ in pairs), statistics.median(b / a for a, b in pairs)
        both = [both[0] + one, both[1] + ratio * one]  # ratios of pairs: the machine's speed changes
        print(f"| {name} | {1e3 * one:.2f} | {ratio:.2f} |", flush=True)
    print(f"| **all of these** | {1e3 * both[0]:.1f} | {both[1] / both[0]:.2f} |\n")


def rounded(solver):
    """Round the fields of a solver's state to single precision."""
    state = solver._state
    for name in FIELDS:
        values = getattr(state, name)
        values[...] = values.astype(np.float32)


class Rounded(FlowSolver):
    """Rounds its fields to single precision after each interval."""

    def advance(self, time, poses=None):
        """As that of the flow solver."""
        loads = super().advance(time, poses)
        rounded(self)
        return loads


def towed(cell_size, duration, solver_of, push=0.0):
    """Loads on the hull over time [N, N m], and the solver at the end."""
    vehicle = amphibious_vehicle()
    solver = solver_of(
        Grid.around_vehicle(vehicle, cell_size), vehicle_solids(vehicle, cell_size), Water.at_ratio(0.6, 1.0),
        FlowSettings(),
    )  # fmt: skip
    solver.start(poses(vehicle, push))
    return np.array([
        solver.advance(STEP * n, poses(vehicle, STEP * n + push))[0] for n in range(1, round(duration / STEP) + 1)
    ]), solver  # fmt: skip


def levels(cell_size=0.018):
    """Print how many cells a second level would leave."""
    vehicle = amphibious_vehicle()
    grid = Grid.around_vehicle(vehicle, cell_size)
    faces = (grid.x_faces, grid.y_faces, grid.z_faces)
    half = 0.5 * vehicle.hull.length, 0.5 * (vehicle.track + vehicle.wheel.width)
    coarse = [np.diff(f) / np.maximum(np.diff(f), 2.0 * cell_size) for f in faces]
    count = coarse[0][:, None, None] * coarse[1][None, :, None] * coarse[2][None, None, :]
    print("| fine up to | cells left |\n|---|---:|")
    for ahead, aside in ((0.1, 0.1), (0.3, 0.3), (0.7, 0.3)):
        x, y = (0.5 * (f[1:] + f[:-1]) for f in faces[:2])
        along = (x > -half[0] - aside) & (x < half[0] + ahead)
        fine = (along[:, None] & (np.abs(y) < half[1] + aside)[None, :])[:, :, None]
        left = np.where(fine, 1.0, count).sum() / grid.n_cells
        print(f"| {ahead:g} m ahead, {aside:g} m elsewhere | {100.0 * left:.0f} % |")
    print(flush=True)


def main(cell_size=0.028, duration=1.5):
    """Print what is saved, and what is lost."""
    levels()
    loads, solver = towed(cell_size, duration, FlowSolver)
    others = {
        "rounded to single precision": towed(cell_size, duration, Rounded)[0],
        "a nanometre further on": towed(cell_size, duration, FlowSolver, PUSH)[0],
    }
    late = len(loads) // 3
    scale = np.abs(loads[late:].mean(axis=0))
    print("| drive | largest difference in the first 0.1 s | of the mean, later: $F_x$ | $F_z$ | $M_y$ |")
    print("|---|---:|---:|---:|---:|")
    for name, other in others.items():
        first = np.abs(other[:100] - loads[:100]).max(axis=0)[[0, 2, 4]] / scale[[0, 2, 4]]
        mean = ((other[late:] - loads[late:]).mean(axis=0) / loads[late:].mean(axis=0))[[0, 2, 4]]
        print(f"| {name} | {first.max():.1e} | " + " | ".join(f"{100.0 * value:+.2f} %" for value in mean) + " |")
    print("\n| closed tank, breaking water, 20 mm | volume | energy over the first, at most |\n|---|---:|---:|")
    for name, solver_of in (("double", FlowSolver), ("rounded to single precision", Rounded)):
        momentum.FlowSolver = solver_of
        tank = momentum.breaking_tank(0.02)
        print(f"| {name} | {tank.volume:.1e} | {100.0 * tank.energy:+.3f} % |")
    print(flush=True)
    saved(solver, duration + STEP)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cell-size", type=float, default=0.028, help="[m]")
    parser.add_argument("--time", type=float, default=1.5, dest="duration", help="simulated time [s]")
    main(**vars(parser.parse_args()))
