"""Where the time of a step of the flow goes: each kernel in nanoseconds a cell of the grid, on one thread.

Run: `python benchmarks/flow_step.py [--cell-size 0.018] [--steps 60]` (half a minute). The vehicle of
`vehicle_models/amphibious.py` at D60 moves at 1 m/s against 1 m/s. Times are processor times of the calls from Python,
so that a kernel holds those that it calls; what is left is Python, numpy and what is not named.
"""

import argparse
import os
import time
from collections import Counter

os.environ.setdefault("NUMBA_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")

from flow_scaling import poses

from exumob.flow import (
    FlowSettings,
    FlowSolver,
    Grid,
    advection,
    forces,
    free_surface,
    placement,
    step,
    surface_at_solids,
    vehicle_solids,
    velocity_extension,
    volume_at_solids,
)
from exumob.flow.active_rows import WaterCells
from exumob.flow.far_field import FarField
from exumob.flow.pressure import assembly
from exumob.flow.turbulence import closures, wall
from exumob.water.conditions import Water
from vehicle_models.amphibious import amphibious_vehicle

STARTING = 20
"""Steps before those that count."""
STEP = 1e-3
"""[s]"""
PHASES = {
    "place solids": (
        (placement, "clear"), (placement, "place_solid"), (volume_at_solids.ClosedParts, "mark"),
        (velocity_extension, "blend"), (surface_at_solids, "release_surface"), (surface_at_solids, "refill_solids"),
        (FarField, "fill_fraction"), (WaterCells, "find_rows"), (step, "clear_outside"),
    ),
    "predict": (
        (advection, "turn"), (advection, "relative_velocity"), (advection, "advect"), (closures, "smagorinsky"),
        (closures, "add_stress"), (wall, "bed_shear"), (forces, "wall_shear"), (forces, "lug_drag"),
        (forces, "add_and_clear"), (FarField, "relax_velocity"), (FarField, "fill_velocity"),
    ),
    "project": ((assembly, "assemble"), (assembly, "solve"), (assembly, "project")),
    "extend": (
        (velocity_extension, "extend"), (advection, "full_velocity"), (advection, "largest_courant"),
    ),
    "transport": (
        (FarField, "gather_rise"), (free_surface, "transport"), (volume_at_solids, "gained"),
        (volume_at_solids, "return_volume"), (FarField, "relax_level"),
    ),
    "loads": ((forces, "pressure_loads"),),
}  # fmt: skip
"""Kernels by the phase of a step (`exumob.flow.step`) in which they are called first."""


def timed(name, call, spent):
    """`call`, the processor time of which is added to `spent` under a name [ns]; calls within calls do not count."""

    def run(*arguments, **options):
        begin = time.process_time_ns()
        running, spent["within"] = spent["within"], 1
        try:
            return call(*arguments, **options)
        finally:
            spent["within"] = running
            if not running:
                spent[name] += time.process_time_ns() - begin

    return run


def main(cell_size=0.018, steps=60):
    """Print a table."""
    vehicle = amphibious_vehicle()
    grid = Grid.around_vehicle(vehicle, cell_size)
    solver = FlowSolver(grid, vehicle_solids(vehicle, cell_size), Water.at_ratio(0.6, 1.0), FlowSettings())
    solver.start(poses(vehicle, 0.0))
    spent = Counter(within=0)
    parts = iterations = begin = 0
    for n in range(STARTING + steps):
        if n == STARTING:
            for owner, name in (kernel for phase in PHASES.values() for kernel in phase):
                setattr(owner, name, timed(name, getattr(owner, name), spent))
            begin = time.process_time_ns()
        solver.advance(STEP * (n + 1), poses(vehicle, STEP * (n + 1)))
        if n >= STARTING:
            parts, iterations = parts + solver.report.steps, iterations + solver.report.iterations
    total = time.process_time_ns() - begin
    water = int((solver.fraction > 0.0).sum())
    print(
        f"{grid.n_cells:,} cells, {water:,} of them with water; {total / parts / 1e6:.1f} ms a step, "
        f"{iterations / parts:.1f} iterations of the pressure\n"
    )
    print("| phase | kernel | ns a cell | share |\n|---|---|---:|---:|")
    for phase, kernels in PHASES.items():
        for name in sorted((name for _, name in kernels), key=lambda name: -spent[name]):
            if spent[name]:
                print(f"| {phase} | {name} | {_each(spent[name], parts, grid)} | {100.0 * spent[name] / total:.0f} % |")
    rest = total - sum(spent.values())
    print(f"| | all else | {_each(rest, parts, grid)} | {100.0 * rest / total:.0f} % |")
    print(f"| | **all** | {_each(total, parts, grid)} | |")


def _each(nanoseconds, parts, grid):
    return f"{nanoseconds / parts / grid.n_cells:.1f}"


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cell-size", type=float, default=0.018, help="[m]")
    parser.add_argument("--steps", type=int, default=60)
    main(**vars(parser.parse_args()))
