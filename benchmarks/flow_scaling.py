"""Cost of the flow solver over the number of cells, on one and two threads, against the memory's bandwidth.

Run: `python benchmarks/flow_scaling.py [--quick] [--figure PATH]` (about 15 minutes on an idle machine). The vehicle of
`vehicle_models/amphibious.py` at D60 moves at 1 m/s against 1 m/s; times are medians over the last steps after a start.
Figures are meaningful on an idle machine only: other programs take cores, cache and bandwidth away.
"""

import argparse
import os
import time
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

os.environ.setdefault("NUMBA_NUM_THREADS", "2")
os.environ.setdefault("NUMBA_THREADING_LAYER", "omp")

import numba
import numpy as np
from numba import njit, prange

from exumob.flow import FlowSettings, FlowSolver, Grid, Poses, vehicle_solids
from exumob.flow.pressure import assembly, conjugate_gradients, multigrid
from exumob.water.conditions import Water
from vehicle_models.amphibious import amphibious_vehicle

CELL_SIZES = (0.032, 0.025, 0.018, 0.0145, 0.011, 0.0104)
"""[m]; 100 thousand to 1.6 million cells"""
QUICK_SIZES = (0.036, 0.030)
LOADING_SIZE = 0.06
VEHICLE_SECONDS, VEHICLE_CELLS, VEHICLE_STEP = 8.0, 450_000, 1e-3


def poses(vehicle, t, speed=1.0):
    """Vehicle straight ahead at a constant speed [m/s], wheels turning at 10 rad/s."""
    origins = np.vstack([vehicle.hull_origin, vehicle.wheel_centers]) + np.array([speed * t, 0.0, 0.0])
    velocity = np.tile([speed, 0.0, 0.0], (5, 1))
    return Poses(
        origins, np.tile(np.eye(3), (5, 1, 1)), velocity, np.zeros((5, 3)), np.array([0.0, 10.0, 10.0, 10.0, 10.0])
    )


@njit(parallel=True)
def triad(a, b, c, scale):
    """STREAM's triad a = b + scale c in single precision."""
    for i in prange(len(a)):
        a[i] = b[i] + scale * c[i]


def best_time(run, repeats):
    """Shortest of several times of a function [s]."""
    times = []
    for _ in range(repeats):
        begin = time.perf_counter()
        run()
        times.append(time.perf_counter() - begin)
    return min(times)


def triad_bandwidth(numbers=20_000_000):
    """Bandwidth of the triad over arrays far larger than the caches [GB/s]."""
    a, b, c = (np.ones(numbers, dtype=np.float32) for _ in range(3))
    triad(a, b, c, np.float32(3.0))
    return 12e-9 * numbers / best_time(lambda: triad(a, b, c, np.float32(3.0)), 10)


def resident_memory():
    """Resident set of this process [MB]."""
    with open("/proc/self/statm") as statm:
        return int(statm.read().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6


def smoother_bandwidth(levels, threads):
    """Bandwidth of the finest level's relaxation, from the bytes of the arrays that it must touch [GB/s].

    Per cell, single precision: ax, ay, az, pivot, b read; x read and written, for each of both colours, which share
    nothing but the x and the couplings of their faces: these are read twice.
    """
    fine = levels.levels[0]
    cells = 2 * int(np.sum(fine.hi - fine.lo))
    bytes_moved = 4 * cells * (2 * 2 + 1 + 1 + 1 + 2 + 1)  # ax, ay twice; az, pivot, b; x twice; x written

    def run():
        for color in (0, 1):
            multigrid.relax_lines(fine, color, False, threads > 1)

    run()
    return 1e-9 * bytes_moved / best_time(run, 20)


def gradients_bandwidth(levels, metrics):
    """The same of the vector kernels of the conjugate gradients [GB/s]."""
    fine, v = levels.levels[0], levels.vectors
    cells = 2 * int(np.sum(fine.hi - fine.lo))
    turn = 4 * 5 + 8 * 4  # couplings and x; direction and product read and written
    advance = 8 * 6 + 4  # four vectors read, two written; b
    rows = np.zeros(fine.ny)

    def run():
        conjugate_gradients.new_direction(fine, v, 0.5, rows)
        conjugate_gradients.advance_solution(fine, v, 1e-9, metrics, rows)

    run()
    return 1e-9 * cells * (turn + advance) / best_time(run, 20)


def measure(cell_size, threads, steps=15, start=10, dt=VEHICLE_STEP):
    """One row of the table, a dictionary."""
    numba.set_num_threads(threads)
    before = resident_memory()
    vehicle = amphibious_vehicle()
    grid = Grid.around_vehicle(vehicle, cell_size)
    solver = FlowSolver(
        grid, vehicle_solids(vehicle, cell_size), Water.at_ratio(0.6, 1.0), FlowSettings(threads=threads)
    )
    solver.start(poses(vehicle, 0.0))
    solving, solve = [0.0], assembly.solve

    def timed(*arguments):
        begin = time.perf_counter()
        outcome = solve(*arguments)
        solving[0] += time.perf_counter() - begin
        return outcome

    times, shares, iterations = [], [], 0.0
    assembly.solve = timed
    try:
        for n in range(start + steps):
            solving[0], begin = 0.0, time.perf_counter()
            solver.advance(dt * (n + 1), poses(vehicle, dt * (n + 1)))
            elapsed = time.perf_counter() - begin
            if n >= start:
                times.append(elapsed / solver.report.steps)
                shares.append(solving[0] / elapsed)
                iterations += solver.report.iterations / solver.report.steps / steps
    finally:
        assembly.solve = solve
    each, cells = float(np.median(times)), grid.n_cells
    memory = (resident_memory() - before) / (1e-6 * cells)
    peak = triad_bandwidth()
    return {
        "cells": cells, "ms": 1e3 * each, "ns": 1e9 * each / cells, "iterations": iterations,
        "share": float(np.median(shares)), "memory": memory, "triad": peak,
        "smoother": smoother_bandwidth(solver.levels, threads) / peak,
        "gradients": gradients_bandwidth(solver.levels, solver.metrics) / peak,
    }  # fmt: skip


def measure_apart(*arguments):
    """`measure` in a process of its own, so that memory freed before does not count; kernels are loaded first."""
    with ProcessPoolExecutor(1, get_context("spawn")) as pool:
        pool.submit(measure, LOADING_SIZE, arguments[1], 1, 0).result()
        return pool.submit(measure, *arguments).result()


def plot(rows, path):
    """Time and iterations over the number of cells."""
    import matplotlib.pyplot as plt

    figure, (left, right) = plt.subplots(1, 2, figsize=(9.0, 3.6), layout="constrained")
    for threads, table in rows.items():
        cells = [r["cells"] for r in table]
        left.loglog(cells, [r["ms"] for r in table], "o-", label=f"{threads} thread{'s' if threads > 1 else ''}")
        right.semilogx(cells, [r["iterations"] for r in table], "o-")
    left.set(xlabel="cells", ylabel="time per step [ms]")
    left.legend()
    right.set(xlabel="cells", ylabel="pressure iterations per step", ylim=(0, None))
    figure.savefig(path)


def main(quick=False, figure=None):
    """Print the table; return its rows by number of threads."""
    counts = [n for n in (1, 2) if n <= numba.config.NUMBA_NUM_THREADS]
    rows = {n: [] for n in counts}
    print("threads    cells  ms/step  ns/cell/step  iterations  pressure  MB/Mcell  triad GB/s  smoother  CG  speed-up")
    for cell_size in QUICK_SIZES if quick else CELL_SIZES:
        for threads in counts:
            r = measure_apart(cell_size, threads, *((3, 2) if quick else ()))
            rows[threads].append(r)
            speedup = rows[counts[0]][-1]["ms"] / r["ms"]
            print(
                f"{threads:7d} {r['cells']:8d} {r['ms']:8.1f} {r['ns']:13.0f} {r['iterations']:11.1f} "
                f"{100 * r['share']:7.0f} % {r['memory']:9.0f} {r['triad']:11.1f} {100 * r['smoother']:7.0f} % "
                f"{100 * r['gradients']:3.0f} % {speedup:6.2f}",
                flush=True,
            )
    for threads, table in rows.items():
        nanoseconds = np.interp(VEHICLE_CELLS, [r["cells"] for r in table], [r["ns"] for r in table])
        minutes = 1e-9 * nanoseconds * VEHICLE_CELLS * VEHICLE_SECONDS / VEHICLE_STEP / 60.0
        case = f"{VEHICLE_SECONDS:g} s at {VEHICLE_CELLS} cells and {1e3 * VEHICLE_STEP:g} ms"
        print(f"{case}, {threads} threads: {minutes:.1f} min (interpolated from the table)")
    if figure:
        plot(rows, figure)
    return rows


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--figure", metavar="PATH")
    arguments = parser.parse_args()
    main(arguments.quick, arguments.figure)
