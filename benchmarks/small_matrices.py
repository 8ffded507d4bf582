"""What does a system of a vehicle's constraints cost on one thread and on all, on an idle and on a busy machine?

With the flow in the loop such a system is solved for every prediction. Printed: median, mean and largest time of
solutions of 130 unknowns, on one thread and on all in turn, alone and beside one busy process a core.

Run: python benchmarks/small_matrices.py     (half a minute)
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import time

import numpy as np

from exumob.support.small_matrices import on_one_thread

UNKNOWNS, SOLUTIONS = 130, 200


def busy() -> None:
    """Keep a core busy until the process is ended."""
    while True:
        sum(range(10_000))


def times(one_thread: bool) -> np.ndarray:
    """Times of the solutions [ms]."""
    random = np.random.default_rng(0)
    matrix, right = random.standard_normal((UNKNOWNS, UNKNOWNS)), random.standard_normal(UNKNOWNS)
    found = []
    with on_one_thread() if one_thread else contextlib.nullcontext():
        for _ in range(SOLUTIONS):
            begin = time.perf_counter()
            np.linalg.solve(matrix, right)
            found.append(1e3 * (time.perf_counter() - begin))
    return np.array(found)


def main() -> None:
    """Measure and print."""
    cores = os.cpu_count() or 1
    for others in (0, cores):
        processes = [multiprocessing.Process(target=busy, daemon=True) for _ in range(others)]
        for process in processes:
            process.start()
        time.sleep(0.5)
        rows: dict[bool, list[np.ndarray]] = {True: [], False: []}
        for _ in range(5):
            for one_thread in rows:
                rows[one_thread].append(times(one_thread))
        for process in processes:
            process.kill()
        for one_thread, found in rows.items():
            values = np.concatenate(found)
            print(
                f"{others} busy processes on {cores} cores, {'one thread' if one_thread else 'all threads'}: median "
                f"{np.median(values):.2f} ms, mean {values.mean():.2f} ms, largest {values.max():.1f} ms"
            )


if __name__ == "__main__":
    main()
