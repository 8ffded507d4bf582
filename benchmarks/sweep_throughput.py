"""How many lane changes a minute does a sweep make, how much do two workers gain, and does its memory grow?

Run: python benchmarks/sweep_throughput.py [--cases 24] [--cheap 10000] [--macro-step 0.02] [--micro-step 0.0005]
Lane changes of 8 s in D60/U1 and its neighbours, driven by the ensemble; one worker and two on the same cases, in turn,
so that both meet the same machine. Then cheap cases (a square), and the memory of the leader and its processes.
"""

from __future__ import annotations

import os

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ[name] = "1"

import argparse
import resource
import tempfile
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from exumob.sweeps import sweep
from exumob.sweeps.experiment import amphibious_lane_change


def square(case: dict[str, float]) -> dict[str, float]:
    """A case that costs nothing."""
    return {"square": case["x"] ** 2}


def timed(run: Callable[[], object]) -> float:
    """Wall time [s]."""
    start = time.perf_counter()
    run()
    return time.perf_counter() - start


def lane_changes(number: int, micro_step: float, macro_step: float) -> None:
    """Print the rates of one worker and of two, and their ratio; each in two halves, in turn."""
    experiment = replace(amphibious_lane_change(), micro_step=micro_step, macro_step=macro_step)
    cases = [{"water.current_speed": float(u)} for u in np.linspace(0.4, 1.0, number)]
    with tempfile.TemporaryDirectory() as place:
        sweep(experiment, cases[:2], Path(place) / "compiled", workers=2)
        half = number // 2
        walls = {1: 0.0, 2: 0.0}
        for part in range(2):
            for workers in walls:
                chosen = cases[part * half : (part + 1) * half]
                folder = Path(place) / f"{workers}_{part}"
                walls[workers] += timed(lambda c=chosen, f=folder, w=workers: sweep(experiment, c, f, workers=w))
    for workers, wall in walls.items():
        print(f"{workers} worker(s): {2 * half} lane changes in {wall:.1f} s, {60.0 * 2 * half / wall:.1f} a minute")
    print(f"two workers bring {walls[1] / walls[2]:.2f} times one")


def cheap_cases(number: int) -> None:
    """Print the time of a case, and the resident memory of all processes after a tenth of the cases and at the end."""
    seen: list[tuple[int, float]] = []
    over = threading.Event()

    def watch(folder: Path) -> None:
        while not over.wait(0.5):
            cases = folder / "cases"
            seen.append((len(os.listdir(cases)) if cases.exists() else 0, _family_megabytes()))

    with tempfile.TemporaryDirectory() as place:
        folder = Path(place) / "cheap"
        watcher = threading.Thread(target=watch, args=(folder,))
        watcher.start()
        wall = timed(lambda: sweep(square, [{"x": float(n)} for n in range(number)], folder, workers=2))
        over.set()
        watcher.join()
    early = [memory for done, memory in seen if 0.1 * number <= done < 0.3 * number]
    late = [memory for done, memory in seen if done >= 0.8 * number]
    print(f"{number} cheap cases in {wall:.1f} s, {1e3 * wall / number:.2f} ms each")
    if early and late:
        print(f"memory of all processes: {np.median(early):.0f} MB after a tenth, {np.median(late):.0f} MB at the end")
    print(f"largest process ever: {resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024:.0f} MB")


def _family_megabytes() -> float:
    """Resident memory of this process and its descendants (Linux) [MB]."""
    parents, sizes = {}, {}
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                fields = (entry / "stat").read_text().rsplit(")", 1)[1].split()
                sizes[int(entry.name)] = int((entry / "statm").read_text().split()[1]) * resource.getpagesize() / 1e6
            except (OSError, IndexError):
                continue
            parents[int(entry.name)] = int(fields[1])

    def is_descendant(pid: int) -> bool:
        while pid > 1:
            if pid == os.getpid():
                return True
            pid = parents.get(pid, 0)
        return False

    return sum(size for pid, size in sizes.items() if is_descendant(pid))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, default=24)
    parser.add_argument("--cheap", type=int, default=10_000)
    parser.add_argument("--micro-step", type=float, default=5e-4)
    parser.add_argument("--macro-step", type=float, default=20e-3)
    given = parser.parse_args()
    lane_changes(given.cases, given.micro_step, given.macro_step)
    cheap_cases(given.cheap)
