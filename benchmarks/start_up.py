"""How long does the program take to start? CPU and wall time of new processes, as ratios to the past.

Run: python benchmarks/start_up.py [--repeats 7] [--against FOLDER]
Medians of: the help of the command line and of each command, a wrong option, `import exumob`, and the first use of
`exumob.simulate`. Beside them two that the package cannot change: Python alone, and `import numpy`. The past is in
`past.toml`. With another checkout as FOLDER, both are measured in turn, and the ratio is to that one.
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
import time
from pathlib import Path

from past import past, ratio

HERE = Path(__file__).parents[1]
COMMANDS = ("lane-change", "captive", "sweep", "map", "train", "export", "soils", "verify")
RUNS = {
    "python alone": ["-c", "pass"],
    "import numpy": ["-c", "import numpy"],
    "import exumob": ["-c", "import exumob"],
    "exumob.simulate": ["-c", "import exumob; exumob.simulate"],
    "exumob --help": ["-m", "exumob", "--help"],
    **{f"exumob {name} --help": ["-m", "exumob", name, "--help"] for name in COMMANDS},
    "exumob lane-change --wrong": ["-m", "exumob", "lane-change", "--wrong"],
}
"""What is measured, by name: arguments of Python."""


def seconds(arguments: list[str], folder: Path) -> tuple[float, float]:
    """CPU and wall time of a new process that uses the package of a folder [s]."""
    start = time.perf_counter()
    process = subprocess.Popen(
        [sys.executable, *arguments], env=os.environ | {"PYTHONPATH": str(folder)}, stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, cwd=folder,
    )  # fmt: skip
    _, status, usage = os.wait4(process.pid, 0)
    wall = time.perf_counter() - start
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode not in (0, 2):  # 2: the wrong option
        raise RuntimeError(f"python {' '.join(arguments)} ended with {process.returncode} in {folder}.")
    return usage.ru_utime + usage.ru_stime, wall


def medians(repeats: int, folders: list[Path]) -> dict[tuple[Path, str], tuple[float, float]]:
    """Median CPU and wall times of all runs [s], by folder and name; every run in turn, so that all meet the same."""
    found: dict[tuple[Path, str], list[tuple[float, float]]] = {}
    for number in range(repeats + 1):
        for name, arguments in RUNS.items():
            for folder in folders:
                times = seconds(arguments, folder)
                if number:  # the first time Python compiles
                    found.setdefault((folder, name), []).append(times)
    return {
        key: (statistics.median(cpu for cpu, _ in times), statistics.median(wall for _, wall in times))
        for key, times in found.items()
    }


def main() -> None:
    """Print a row a run."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=7)
    parser.add_argument("--against", type=Path, metavar="FOLDER", help="another checkout, measured in turn")
    options = parser.parse_args()
    other = options.against.resolve() if options.against else None
    found = medians(options.repeats, [HERE, other] if other else [HERE])
    table = past("start_up")
    print("| process | CPU [s] | wall [s] | CPU before [s] | ratio | wall before [s] | ratio |\n" + 7 * "|---" + "|")
    for name in RUNS:
        cpu, wall = found[HERE, name]
        before = dict(zip(("cpu_s", "wall_s"), found[other, name], strict=True)) if other else table.get(name, {})
        then = [f"{before[key]:.3f}" if key in before else "-" for key in ("cpu_s", "wall_s")]
        print(
            f"| {name} | {cpu:.3f} | {wall:.3f} | {then[0]} | {ratio(cpu, before, 'cpu_s')} | {then[1]} "
            f"| {ratio(wall, before, 'wall_s')} |"
        )
    if not other and table:
        row = next(iter(table.values()))
        print(f"before: revision {row['revision']}, measured on {row['date']} ({row['machine']})")


if __name__ == "__main__":
    main()
