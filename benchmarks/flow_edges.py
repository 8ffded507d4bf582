"""What does it cost that the flow separates at sharp edges (`FlowSettings.sharp_edges`)?

Run: `python benchmarks/flow_edges.py [--cell-size 0.028] [--blocks 20]` (three minutes). The vehicle of
`vehicle_models/amphibious.py` at D60 moves at 1 m/s against 1 m/s, once with and once without, ten steps of each in
turn; processor times of one thread, so that what else the machine does cancels out of their ratio.
"""

import argparse
import os
import statistics
import time

os.environ.setdefault("NUMBA_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")

from flow_scaling import poses

from exumob.flow import FlowSettings, FlowSolver, Grid, vehicle_solids
from exumob.water.conditions import Water
from vehicle_models.amphibious import amphibious_vehicle

STARTING, BLOCK, STEP = 300, 10, 1e-3
"""Steps before those that count, steps of a block, and their length [s]."""


def main(cell_size=0.028, blocks=20):
    """Print the times of a step, and their ratio."""
    vehicle = amphibious_vehicle()
    solvers = []
    for sharp in (True, False):
        solver = FlowSolver(
            Grid.around_vehicle(vehicle, cell_size), vehicle_solids(vehicle, cell_size), Water.at_ratio(0.6, 1.0),
            FlowSettings(sharp_edges=sharp),
        )  # fmt: skip
        solver.start(poses(vehicle, 0.0))
        for n in range(1, STARTING + 1):
            solver.advance(STEP * n, poses(vehicle, STEP * n))
        solvers.append(solver)
    ratios, times = [], []
    for block in range(blocks):
        spent = []
        for solver in solvers:
            begin = time.process_time()
            for n in range(1, BLOCK + 1):
                at = STEP * (STARTING + block * BLOCK + n)
                solver.advance(at, poses(vehicle, at))
            spent.append((time.process_time() - begin) / BLOCK)
        ratios.append(spent[0] / spent[1])
        times.append(spent)
    sharp, round_ = (1e9 * statistics.median(t) / solvers[0].grid.n_cells for t in zip(*times, strict=True))
    low, middle, high = min(ratios), statistics.median(ratios), max(ratios)
    print(f"{solvers[0].grid.n_cells:,} cells; sharp {sharp:.0f}, without {round_:.0f} ns a cell and step")
    print(f"with over without: {middle:.2f} ({low:.2f} to {high:.2f} in {blocks} pairs of {BLOCK} steps)")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cell-size", type=float, default=0.028, help="[m]")
    parser.add_argument("--blocks", type=int, default=20, help="pairs")
    main(**vars(parser.parse_args()))
