"""Where can the vehicle cross, and is the map right?

The map shows the chance to cross a ford 12 m wide within 20 s over current and depth, on LETE sand and on the same sand
with a quarter less shear strength; ten runs a node over scatter of soil and water, two with each network of the
ensemble. It is checked against the verdicts of the thirteen CFD-MBD runs (lane changes, judged over their last two
seconds, straight again), as is the ensemble straight ahead in the same water without scatter; and a map refined along
the border, without scatter, against the full grid.

Run: python studies/mobility_map.py [--workers 2] [--folder maps]     (an hour or two; continues after a stop)
"""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from common import CFD_RUNS, FIGURES, add_workers, save, study_parser
from matplotlib.figure import Figure

from exumob import Soil, load_dataset
from exumob.learning.dataset import load_runs
from exumob.mobility.crossing import FAILURES, Crossing, Limits, judge_crossing
from exumob.mobility.map import Axis, MobilityMap, compute_map
from exumob.mobility.map_figure import plot_map
from exumob.paper.scenarios import UNSEEN, Scenario
from exumob.sweeps import sweep
from exumob.sweeps.experiment import Experiment, amphibious_crossing
from exumob.sweeps.run import Progress

SOIL = Soil.published("LETE sand")
WEAK = 0.75
"""Shear strength of the weaker sand over that of LETE sand [-]."""
PANELS = {
    "LETE sand": {"soil.cohesion": SOIL.cohesion, "soil.friction_angle": SOIL.friction_angle},
    "LETE sand, a quarter weaker": {
        "soil.cohesion": WEAK * SOIL.cohesion, "soil.friction_angle": math.atan(WEAK * math.tan(SOIL.friction_angle)),
    },
}  # fmt: skip
X = Axis("water.current_speed", 0.0, 1.5)
Y = Axis("water.depth_ratio", 0.2, 0.9)
LIMITS = Limits(window=1.5)
SPEEDS = np.arange(0.40, 0.801, 0.02)
"""Least speeds for which map and CFD-MBD are compared [m/s]."""


class PrintedProgress:
    """Prints how far a map has got, every 20 runs."""

    def __init__(self) -> None:
        self.printed: tuple[str, int] | None = None

    def __call__(self, name: str, reached: Progress) -> None:
        """Print a line, if 20 runs more have ended."""
        if (name, reached.done // 20) != self.printed:
            self.printed = (name, reached.done // 20)
            left = "" if math.isnan(reached.left) else f", {reached.left / 60.0:.0f} minutes left"
            print(f"{name}: {reached.done} of {reached.total}{left}", flush=True)


def refinement(crossing: Crossing, folder: Path, levels: int, workers: int) -> dict[str, float]:
    """Compare a refined map without scatter with the full grid: nodes computed, wrong verdicts, errors of the speed."""
    plain = MobilityMap(crossing, X, Y, {"LETE sand": PANELS["LETE sand"]}, scatter={}, levels=levels)
    full = compute_map(plain, folder / "full", workers=workers, full=True, progress=PrintedProgress())
    refined = compute_map(plain, folder / "refined", workers=workers, progress=PrintedProgress())
    counts = full["out_of_range"] <= crossing.limits.range_share
    wrong = ((full["probability"] >= 0.5) != (refined["probability"] >= 0.5)) & counts
    off = np.abs(full["speed"] - refined["speed"]).where(counts)
    return {
        "nodes_full": float((full["runs"] > 0).sum()), "nodes_refined": float((refined["runs"] > 0).sum()),
        "nodes_wrong": float(wrong.sum()), "nodes_in_range": float(counts.sum()),
        "speed_off_max": float(off.max()), "speed_off_mean": float(off.mean()),
    }  # fmt: skip


def against_flow(experiment: Experiment, folder: Path, workers: int) -> xr.Dataset:
    """Judge the CFD-MBD runs, and the ensemble straight ahead in the same water."""
    files = sorted(CFD_RUNS.glob("*.nc"))
    runs = load_runs(files)
    scenarios = [Scenario.named(name) for name in runs]
    cases = [{"water.depth_ratio": s.depth_ratio, "water.current_speed": s.current_speed} for s in scenarios]
    swept = sweep(Crossing(experiment, LIMITS), cases, folder, workers=workers)
    true = [judge_crossing(run, Limits()) for run in runs.values()]
    found = xr.Dataset(
        {
            "speed_flow": ("scenario", [t["speed"] for t in true], {"units": "m s-1"}),
            "failure_flow": ("scenario", [int(t["failure"]) for t in true]),
            "speed_map": ("scenario", swept["speed"].values, {"units": "m s-1"}),
            "failure_map": ("scenario", swept["failure"].values.astype(int)),
            "depth_ratio": ("scenario", [s.depth_ratio for s in scenarios]),
            "current_speed": ("scenario", [s.current_speed for s in scenarios], {"units": "m s-1"}),
            "unseen": ("scenario", [scenario in UNSEEN for scenario in scenarios]),
        },
        coords={"scenario": list(runs), "least_speed": ("least_speed", SPEEDS, {"units": "m s-1"})},
    )
    agree = (found["speed_flow"] >= found["least_speed"]) == (found["speed_map"] >= found["least_speed"])
    return found.assign(agree=agree.transpose("scenario", "least_speed"))


def read_off(mapped: xr.Dataset, checked: xr.Dataset) -> xr.DataArray:
    """Compare the first panel of the map, as drawn, with each CFD-MBD run; hatched: the map gives no answer."""
    panel = mapped.isel(panel=0)
    at = panel[["probability", "out_of_range"]].interp(x=checked["current_speed"], y=checked["depth_ratio"])
    known = at["out_of_range"] <= mapped.attrs["range_share"]
    right = (at["probability"] >= 0.5) == (checked["failure_flow"] == 0)
    return xr.where(known, xr.where(right, "right", "wrong"), xr.where(right, "hatched, right", "hatched, wrong"))


def plot(mapped: xr.Dataset, checked: xr.Dataset) -> Figure:
    """Draw the map, with the verdicts of the CFD-MBD runs on its first panel."""
    verdicts = xr.Dataset(
        {"x": checked["current_speed"], "y": checked["depth_ratio"], "crossed": checked["failure_flow"] == 0}
    )
    return plot_map(mapped, verdicts)


def main(quick: bool = False, workers: int = 2, folder: Path = Path("maps")) -> xr.Dataset:
    """Compute the map, check it and its refinement; return the map, with numbers of the refinement as attributes."""
    experiment = replace(amphibious_crossing(), duration=4.0, micro_step=1e-3)  # 0.1 mm/s from 0.5 ms
    if quick:
        experiment = replace(experiment, hydrodynamics="coefficients", duration=2.0)
        axes = Axis(X.name, 0.0, 1.2, 1), Axis(Y.name, 0.4, 0.6, 1)
        wanted = MobilityMap(
            Crossing(experiment, Limits(window=0.5)), *axes, {"LETE sand": {}}, draws=2, members=False, levels=1
        )
        result = compute_map(wanted, folder / "quick", workers=workers)
        plt.close(plot_map(result))
        return result
    crossing = Crossing(experiment, LIMITS)
    checked = against_flow(experiment, folder / "flow", workers)
    save({"mobility_check.nc": checked})
    wanted = MobilityMap(crossing, X, Y, PANELS, draws=10, levels=1)
    result = compute_map(wanted, folder / "chance", workers=workers, progress=PrintedProgress())
    save({"mobility_map.png": plot(result, checked), "mobility_map.nc": result})
    result.attrs |= refinement(crossing, folder / "refinement", 2, workers)
    save({"mobility_map.nc": result})
    return result


def report(mapped: xr.Dataset, checked: xr.Dataset) -> str:
    """Speeds and verdicts of every CFD-MBD run, how often the map is right, and the numbers of its refinement."""
    lines = [
        "| run | speed, CFD-MBD [m/s] | speed, ensemble | failure, CFD-MBD | failure, ensemble |",
        "|---" * 5 + "|",
    ]
    for name in checked["scenario"].values:
        row = checked.sel(scenario=name)
        lines.append(
            f"| {name} | {float(row['speed_flow']):.3f} | {float(row['speed_map']):.3f} | "
            f"{FAILURES[int(row['failure_flow'])]} | {FAILURES[int(row['failure_map'])]} |"
        )
    answers = read_off(mapped, checked)
    lines += [f"{text}: {int((answers == text).sum())}" for text in np.unique(answers)]
    lines.append(", ".join(f"{n}: {a}" for n, a in zip(answers["scenario"].values, answers.values, strict=True)))
    share = checked["agree"].mean("scenario")
    unseen = checked["agree"].sel(scenario=checked["unseen"]).mean("scenario")
    at_limit = share.sel(least_speed=LIMITS.speed, method="nearest")
    lines.append(f"right at {LIMITS.speed} m/s: {float(at_limit):.2f}")
    lines.append(
        f"right from {SPEEDS[0]} to {SPEEDS[-1]:.1f} m/s: {float(share.mean()):.3f}, unseen {float(unseen.mean()):.3f}"
    )
    numbers = {name: mapped.attrs[name] for name in mapped.attrs if name.startswith(("nodes", "speed_off", "computed"))}
    return "\n".join([*lines, str(numbers)])


if __name__ == "__main__":
    parser = study_parser(__doc__)
    add_workers(parser, "maps")
    given = parser.parse_args()
    answer = main(**vars(given))
    print(answer["probability"] if given.quick else report(answer, load_dataset(FIGURES / "mobility_check.nc")))
