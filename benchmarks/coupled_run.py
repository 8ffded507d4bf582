"""Runs with the flow in the loop: what do macro steps that follow the flow save, and are the loads the same?

D60/U1 on the cells of the data set, three repetitions with steps of 1 ms and as many as wanted that follow the flow;
repetitions differ in the hold of the spin-up, so that the release meets the flow in another phase. Printed: steps and
time of each, final positions, and for each load the mean and the rms over the run beside those of the repetitions.

Two standard errors: of the difference between a mean over the runs that follow and one over the repetitions, whose
scatter is estimated from all runs of both kinds about their own means. Of loads whose distribution is the same, about
one in ten to twenty lies outside.

Run: python benchmarks/coupled_run.py [--runs FOLDER] [--jobs 2] [--present]      (half an hour and more a run)
Runs that are finished in the folder are read, the others are computed, or continued; `--present`: only those there are.
"""

from __future__ import annotations

import os

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ[name] = "1"

import argparse
from pathlib import Path

import numpy as np
import xarray as xr

from exumob.coupling.macro_step import FollowFlow
from exumob.paper.reference_runs import FlowRun, compute_all, set_up_log
from exumob.paper.scenarios import Scenario
from exumob.simulation.result_files import load_dataset
from vehicle_models.amphibious import amphibious_vehicle

WORST = Scenario.named("D60/U1")
FIXED = [FlowRun(WORST, hold=hold) for hold in (None, 0.6, 0.7)]
FOLLOWING = [FlowRun(WORST, macro_step=FollowFlow(), hold=hold) for hold in (None, 0.6, 0.7)]
BEGIN = 0.5
"""Time from which loads are compared [s]: the wheels turn."""
SMALLEST = 0.01
"""Loads whose rms is below this share of the largest of their kind are left out: they are zero by symmetry [-]."""


def results(runs: list[FlowRun], folder: Path, present: bool, jobs: int) -> list[xr.Dataset]:
    """Results of the runs, in their order; with `present` of those that are finished."""
    if not present:
        list(compute_all(runs, amphibious_vehicle(), folder, jobs))
    files = [folder / f"{run.name}.nc" for run in runs]
    return [load_dataset(file) for file in files if file.exists()]


def effort(run: xr.Dataset) -> dict[str, float]:
    """Effort of a run after its release: macro steps, advances and steps of the flow, wall time [s]."""
    advances = run["coupling_iterations"].values
    return {
        "macro steps": len(advances),
        "advances": float(advances.sum()),
        "steps of the flow": float((run["hydrodynamics_steps"].values * advances).sum()),
        "iterations": float((run["hydrodynamics_iterations"].values * advances).sum()),
        "wall time": float(run.attrs["wall_time"]),
    }


def moments(run: xr.Dataset) -> np.ndarray:
    """Mean and rms about it of each load, shape (2, 5, 6)."""
    loads = run["water_wrench"].sel(time=slice(BEGIN, None)).values
    return np.stack([loads.mean(axis=0), loads.std(axis=0)])


def compare(fixed: list[xr.Dataset], following: list[xr.Dataset]) -> None:
    """Print the table of loads."""
    one, two = (np.array([moments(run) for run in runs]) for runs in (fixed, following))
    squares = ((one - one.mean(0)) ** 2).sum(0) + ((two - two.mean(0)) ** 2).sum(0)
    scatter = np.sqrt(squares / (len(one) + len(two) - 2))
    error = scatter * np.sqrt(1.0 / len(one) + 1.0 / len(two))
    off = two.mean(0) - one.mean(0)
    rms = np.sqrt((one.mean(0) ** 2).sum(0))
    largest = np.concatenate([np.tile(rms[:, :3].max(), (5, 3)), np.tile(rms[:, 3:].max(), (5, 3))], axis=1)
    matters = rms > SMALLEST * largest
    bodies, components = fixed[0]["body"].values, fixed[0]["component"].values
    print(f"\n{'load':>18s} {'mean':>9s} {'off':>8s} {'2 errors':>8s}    {'rms':>8s} {'off':>8s} {'2 errors':>8s}")
    for b, body in enumerate(bodies):
        for k, component in enumerate(components):
            if matters[b, k]:
                cells = [f"{one[:, q, b, k].mean():9.3f} {off[q, b, k]:8.3f} {2 * error[q, b, k]:8.3f}" for q in (0, 1)]
                print(f"{body + ' ' + component:>18s} {cells[0]}   {cells[1]}")
    inside = np.abs(off) <= 2.0 * error
    print(f"within two standard errors: {inside[:, matters].sum()} of {2 * matters.sum()} means and rms")
    print(f"scatter of the repetitions over their rms, median: {np.median((scatter / rms)[:, matters]):.3f}")
    print(f"off over their rms, median: {np.median((np.abs(off) / rms)[:, matters]):.3f}")


def main() -> None:
    """Compute or read the runs, and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=Path, default=Path("runs"))
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--present", action="store_true")
    given = parser.parse_args()
    set_up_log()
    fixed = results(FIXED, given.runs, given.present, given.jobs)
    following = results(FOLLOWING, given.runs, given.present, given.jobs)
    for kind, runs in (("1 ms", fixed), ("following", following)):
        for run in runs:
            steps = np.diff(run["macro_time"].values)
            print(kind, {name: round(value) for name, value in effort(run).items()},
                  f"steps {1e3 * steps.min():.2f} to {1e3 * steps.max():.2f} ms, mean {1e3 * steps.mean():.2f};",
                  f"residual {float(run['coupling_residual'].mean()):.3f}; ends at",
                  np.round(run["position"].values[-1, 0], 4))  # fmt: skip
    if not fixed or not following:
        return
    ends = [np.mean([run["position"].values[-1, 0] for run in runs], axis=0) for runs in (fixed, following)]
    print(f"final positions {1e3 * np.linalg.norm((ends[1] - ends[0])[:2]):.1f} mm apart (means)")
    efforts = [{k: np.mean([effort(run)[k] for run in runs]) for k in effort(runs[0])} for runs in (fixed, following)]
    print("ratios:", {name: f"{efforts[1][name] / efforts[0][name]:.2f}" for name in efforts[0]})
    if len(fixed) + len(following) > 2:
        compare(fixed, following)


if __name__ == "__main__":
    main()
