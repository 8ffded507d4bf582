"""Does a change of the program leave its numbers alone? Runs of every kind, made before and after, compared bit by bit.

    python benchmarks/golden_runs.py make before   # in the old tree (git worktree add ../old main)
    python benchmarks/golden_runs.py make after    # in the new one
    python benchmarks/golden_runs.py compare before after

About six minutes a tree, half of it compilation. Where a kernel was rewritten, the largest difference
over the scale of each variable is printed; it should stay below 1e-12 over the 0.1 s of the flow.
"""

import argparse
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import xarray as xr
from safetensors.numpy import load_file

STEPS = ["--micro-step", "5e-4", "--macro-step", "0.02"]
FLOW = ["--cell-size", "0.0285", "--coarse"]
TOWED = ["captive", "--speed", "1", "--depth", "0.12", "--wheel-speed", "10", *FLOW]
RUNS = {
    "networks": ["lane-change", "--hydrodynamics", "networks", *STEPS],
    "coefficients": ["lane-change", "--hydrodynamics", "coefficients", "--current-direction", "120", *STEPS],
    "light_4x4": [
        "lane-change", "--hydrodynamics", "coefficients", "--vehicle", "vehicle_models/light_4x4.py", "--depth-ratio",
        "0.3", "--duration", "4", *STEPS,
    ],
    "captive": [*TOWED, "--current", "1", "--duration", "0.1"],
    "captive_sst_plic": [
        *TOWED, "--current", "0.5", "--closure", "k-omega-sst", "--surface", "plic", "--duration", "0.03",
    ],
    "coupled": [
        "lane-change", "--hydrodynamics", "cfd", "--micro-step", "1e-4", "--macro-step", "1e-3", "--duration", "0.1",
        *FLOW,
    ],
    "sweep": [
        "sweep", "--vary", "water.current_speed=0,1", "--vary", "soil.cohesion=900,1300", "--set", "duration=0.5",
        "--keep-runs", "--workers", "1",
    ],
    "map": ["map", "--depth", "0.4:0.6", "--current", "0:1", "--draws", "2", "--cells", "2", "--levels", "0"],
    "train": ["train", "--preset", "residual", "--seeds", "1", "--jobs", "1"],
}  # fmt: skip
"""Runs by name: the arguments of the command line; one that makes a folder gets it as its output."""
FOLDERS = ("sweep", "map", "train")
UNEQUAL = ("case_wall_time",)
"""Variables that differ from run to run."""


def make(folder: Path, names: list[str]) -> None:
    """Make the runs in the present tree; those that are there are kept."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in names or RUNS:
        output = folder / (name if name in FOLDERS else f"{name}.nc")
        if output.exists():
            continue
        begin = time.perf_counter()
        subprocess.run([sys.executable, "-m", "exumob", *RUNS[name], "--output", output], check=True)
        print(f"{name}: {time.perf_counter() - begin:.1f} s", flush=True)


def differences(one: Path, other: Path) -> dict[str, float]:
    """Largest difference of each variable over its scale, where the bits differ; nan where shapes or texts differ."""
    if one.suffix == ".safetensors":
        a, b = load_file(one), load_file(other)
    else:
        sets = (xr.load_dataset(file, engine="h5netcdf") for file in (one, other))
        a, b = ({str(name): found[name].values for name in found.variables} for found in sets)
    found = {name: float("nan") for name in a.keys() ^ b.keys()}
    for name in sorted(a.keys() & b.keys()):
        x, y = a[name], b[name]
        if name in UNEQUAL or (x.dtype.kind == "f" and np.array_equal(x, y, equal_nan=True)):
            continue
        if x.dtype.kind == "f" and x.shape == y.shape:
            found[name] = float(np.nanmax(np.abs(x - y)) / (np.nanmax(np.abs(x)) or 1.0))
        elif not np.array_equal(x, y):
            found[name] = float("nan")
    return found


def compare(before: Path, after: Path) -> bool:
    """Print a line a file; True if all have the same bits."""
    same = True
    for file in sorted([*before.rglob("*.nc"), *before.rglob("*.safetensors")]):
        other = after / file.relative_to(before)
        found = differences(file, other) if other.exists() else {"the whole file": float("nan")}
        same = same and not found
        worst = ", ".join(f"{n} {v:.1e}" for n, v in sorted(found.items(), key=lambda item: -item[1])[:5])
        print(f"{file.relative_to(before)}: {worst or 'the same bits'}")
    return same


def main() -> None:
    """Make or compare, as the command line says."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    maker = commands.add_parser("make")
    maker.add_argument("folder", type=Path)
    maker.add_argument("names", nargs="*", help=", ".join(RUNS))
    comparer = commands.add_parser("compare")
    comparer.add_argument("before", type=Path)
    comparer.add_argument("after", type=Path)
    given = parser.parse_args()
    if given.command == "make":
        make(given.folder, given.names)
    elif not compare(given.before, given.after):
        sys.exit(1)


if __name__ == "__main__":
    main()
