"""Where can the vehicle cross, and is the map right?

Chance to cross a ford 12 m wide within 20 s, over current and depth, on LETE sand and on the same sand with a quarter
less shear strength: ten runs a node over scatter of soil and water, two with each network of the ensemble. Then what
refining along the border costs in accuracy, without scatter, against the full grid; and the verdicts of the thirteen
CFD-MBD runs (lane changes, judged over their last two seconds, straight again) against the map's, and against the
ensemble's straight ahead in the same water without scatter.

Run: python studies/mobility_map.py [--workers 2] [--folder maps]     (an hour or two; goes on where it was stopped)
"""

from __future__ import annotations

import argparse
import math
from dataclasses import replace
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from exumob import Soil, load_dataset
from exumob.mobility.crossing import FAILURES, Crossing, Limits, judge
from exumob.mobility.map import Axis, MobilityMap, compute_map
from exumob.mobility.map_figure import plot_map
from exumob.paper.scenarios import Scenario
from exumob.simulation.results import save_dataset
from exumob.support.figures import save_figure
from exumob.sweeps import sweep
from exumob.sweeps.experiment import Experiment, amphibious_crossing
from exumob.sweeps.run import Progress

FIGURES = Path(__file__).parent / "figures"
DATA = Path(__file__).parents[1] / "data" / "cfd_mbd"
UNSEEN = ("D50/U0.5", "D60/U0.5", "D50/U1", "D50/U0.5/15deg")
SOIL = Soil.published("LETE sand")
WEAK = 0.75
"""Share of the shear strength."""
PANELS = {
    "LETE sand": {"soil.cohesion": SOIL.cohesion, "soil.friction_angle": SOIL.friction_angle},
    "LETE sand, a quarter weaker": {
        "soil.cohesion": WEAK * SOIL.cohesion, "soil.friction_angle": math.atan(WEAK * math.tan(SOIL.friction_angle)),
    },
}  # fmt: skip
X = Axis("water.current_speed", 0.0, 1.2)
Y = Axis("water.depth_ratio", 0.36, 0.64)
LIMITS = Limits(window=1.5)
SPEEDS = np.arange(0.40, 0.801, 0.02)
"""Least speeds for which map and CFD-MBD are compared [m/s]."""


class Told:
    """Says how far it has got, every 20 runs."""

    def __init__(self) -> None:
        self.said: tuple[str, int] | None = None

    def __call__(self, name: str, reached: Progress) -> None:
        """Called all the time."""
        if (name, reached.done // 20) != self.said:
            self.said = (name, reached.done // 20)
            print(f"{name}: {reached.done} of {reached.total}, {reached.left / 60.0:.0f} minutes left", flush=True)


def refinement(crossing: Crossing, folder: Path, levels: int, workers: int) -> dict[str, float]:
    """Nodes computed and wrong verdicts of a refined map without scatter, against the full grid."""
    plain = MobilityMap(crossing, X, Y, {"LETE sand": PANELS["LETE sand"]}, scatter={}, levels=levels)
    full = compute_map(plain, folder / "full", workers=workers, full=True, progress=Told())
    quick = compute_map(plain, folder / "refined", workers=workers, progress=Told())
    counts = full["out_of_range"] <= crossing.limits.range_share
    wrong = ((full["probability"] >= 0.5) != (quick["probability"] >= 0.5)) & counts
    off = np.abs(full["speed"] - quick["speed"]).where(counts)
    return {
        "nodes_full": float((full["runs"] > 0).sum()), "nodes_refined": float((quick["runs"] > 0).sum()),
        "nodes_wrong": float(wrong.sum()), "nodes_in_range": float(counts.sum()),
        "speed_off_max": float(off.max()), "speed_off_mean": float(off.mean()),
    }  # fmt: skip


def against_flow(experiment: Experiment, folder: Path, workers: int) -> xr.Dataset:
    """Speeds and verdicts of the CFD-MBD runs, and of the ensemble straight ahead in the same water."""
    files = sorted(DATA.glob("*.nc"))
    runs = {str(run.attrs["scenario"]): run for run in map(load_dataset, files)}
    scenarios = [Scenario.named(name) for name in runs]
    cases = [{"water.depth_ratio": s.depth_ratio, "water.current_speed": s.current_speed} for s in scenarios]
    mine = sweep(Crossing(experiment, LIMITS), cases, folder, workers=workers)
    true = [judge(run, Limits()) for run in runs.values()]
    found = xr.Dataset(
        {
            "speed_flow": ("scenario", [t["speed"] for t in true], {"units": "m s-1"}),
            "failure_flow": ("scenario", [int(t["failure"]) for t in true]),
            "speed_map": ("scenario", mine["speed"].values, {"units": "m s-1"}),
            "failure_map": ("scenario", mine["failure"].values.astype(int)),
            "depth_ratio": ("scenario", [s.depth_ratio for s in scenarios]),
            "current_speed": ("scenario", [s.current_speed for s in scenarios], {"units": "m s-1"}),
            "unseen": ("scenario", [name in UNSEEN for name in runs]),
        },
        coords={"scenario": list(runs), "least_speed": ("least_speed", SPEEDS, {"units": "m s-1"})},
    )
    agree = (found["speed_flow"] >= found["least_speed"]) == (found["speed_map"] >= found["least_speed"])
    return found.assign(agree=agree.transpose("scenario", "least_speed"))


def read_off(mapped: xr.Dataset, checked: xr.Dataset) -> xr.DataArray:
    """What the first panel of the map, as drawn, says of each CFD-MBD run: right, wrong, or that it does not know."""
    panel = mapped.isel(panel=0)
    at = panel[["probability", "out_of_range"]].interp(x=checked["current_speed"], y=checked["depth_ratio"])
    known = at["out_of_range"] <= mapped.attrs["range_share"]
    right = (at["probability"] >= 0.5) == (checked["failure_flow"] == 0)
    return xr.where(known, xr.where(right, "right", "wrong"), xr.where(right, "hatched, right", "hatched, wrong"))


def plot(mapped: xr.Dataset, checked: xr.Dataset) -> Figure:
    """The map, with the verdicts of the CFD-MBD runs on its first panel."""
    verdicts = xr.Dataset(
        {"x": checked["current_speed"], "y": checked["depth_ratio"], "crossed": checked["failure_flow"] == 0}
    )
    return plot_map(mapped, verdicts)


def main(quick: bool = False, workers: int = 2, folder: Path | None = None) -> xr.Dataset:
    """Map, refinement and check; return the map, with the other two's numbers as attributes."""
    experiment = replace(amphibious_crossing(), duration=4.0, micro_step=1e-3)  # 0.1 mm/s from 0.5 ms
    if quick:
        experiment = replace(experiment, hydrodynamics="coefficients", duration=2.0)
        axes = Axis(X.name, 0.0, 1.2, 1), Axis(Y.name, 0.4, 0.6, 1)
        wanted = MobilityMap(
            Crossing(experiment, Limits(window=0.5)), *axes, {"LETE sand": {}}, draws=2, members=False, levels=1
        )
        assert folder is not None
        result = compute_map(wanted, folder, workers=workers)
        plt.close(plot_map(result))
        return result
    place = folder or Path("maps")
    crossing = Crossing(experiment, LIMITS)
    checked = against_flow(experiment, place / "flow", workers)
    save_dataset(checked, FIGURES / "mobility_check.nc")
    wanted = MobilityMap(crossing, X, Y, PANELS, draws=10, levels=1)
    result = compute_map(wanted, place / "chance", workers=workers, progress=Told())
    save_figure(plot(result, checked), FIGURES / "mobility_map.png")
    save_dataset(result, FIGURES / "mobility_map.nc")
    result.attrs |= refinement(crossing, place / "refinement", 2, workers)
    save_dataset(result, FIGURES / "mobility_map.nc")
    return result


if __name__ == "__main__":
    import matplotlib

    matplotlib.use("Agg")
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--folder", type=Path, default=Path("maps"))
    given = parser.parse_args()
    answer = main(workers=given.workers, folder=given.folder)
    table = xr.load_dataset(FIGURES / "mobility_check.nc", engine="h5netcdf")
    for name in table["scenario"].values:
        row = table.sel(scenario=name)
        print(
            f"| {name} | {float(row['speed_flow']):.3f} | {float(row['speed_map']):.3f} | "
            f"{FAILURES[int(row['failure_flow'])]} | {FAILURES[int(row['failure_map'])]} |"
        )
    said = read_off(answer, table)
    print(
        {text: int((said == text).sum()) for text in np.unique(said)},
        dict(zip(said["scenario"].values, said.values, strict=True)),
    )
    share = table["agree"].mean("scenario")
    unseen = table["agree"].sel(scenario=table["unseen"]).mean("scenario")
    print(f"right at {LIMITS.speed} m/s: {float(share.sel(least_speed=LIMITS.speed, method='nearest')):.2f}")
    print(
        f"right from {SPEEDS[0]} to {SPEEDS[-1]:.1f} m/s: {float(share.mean()):.3f}, unseen {float(unseen.mean()):.3f}"
    )
    print({name: answer.attrs[name] for name in answer.attrs if name.startswith(("nodes", "speed_off", "computed"))})
