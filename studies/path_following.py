"""Can the vehicle hold a line in the current where the open-loop lane change drifts off?

The three gains of Stanley's steering law (`exumob.driving.path_following`) are tuned for D60/U1 on the ensemble of
networks, with Exudyn's genetic optimisation and then Nelder & Mead's simplex; the objective is the root mean square
distance from the line, and 10 mm for each rad/s of steering rate. The tuned driver is then tried in other water, too.

Run: python studies/path_following.py [--workers 2] [--folder tuning]     (half an hour; continues after a stop)
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from common import add_workers, save, study_parser
from matplotlib.figure import Figure

from exumob import LaneChange, PathFollowing, lane_shift
from exumob.support.figures import STYLE
from exumob.sweeps import Genetic, Simplex, tune
from exumob.sweeps.experiment import Experiment, amphibious_lane_change

LINE = lane_shift(offset=0.5, start=0.5, length=2.5)
PATH = PathFollowing(LINE)
RANGES = {
    "maneuver.gain": (0.2, 6.0), "maneuver.yaw_damping": (0.0, 1.0), "maneuver.integral_gain": (0.0, 1.0),
}  # fmt: skip
RATE_WEIGHT = 0.01
"""Distance that counts as much as a steering rate of 1 rad/s [m]."""
WATER = {
    "D60/U1": {"water.depth_ratio": 0.6, "water.current_speed": 1.0},
    "D60/U0": {"water.depth_ratio": 0.6, "water.current_speed": 0.0},
    "D40/U1": {"water.depth_ratio": 0.4, "water.current_speed": 1.0},
    "D50/U0.5, 30 deg from ahead": {
        "water.depth_ratio": 0.5, "water.current_speed": 0.5, "water.current_direction": np.pi - np.pi / 6,
    },
}  # fmt: skip


def objective(run: xr.Dataset) -> float:
    """Objective of the tuning: distance from the line and weighted steering rate [m]."""
    rate = np.gradient(run["steering_angle"].mean("front_wheel").values, run["time"].values)
    return deviation(run) + RATE_WEIGHT * float(np.sqrt(np.mean(rate**2)))


def deviation(run: xr.Dataset) -> float:
    """Root mean square distance of the hull from the line [m]."""
    return float(np.sqrt((PATH.deviation(run) ** 2).mean()))


def measures(run: xr.Dataset) -> dict[str, float]:
    """Measure how well the line was held: rms and largest distance, and at the end distance, yaw and lateral speed."""
    off = PATH.deviation(run)
    late = run.sel(time=slice(float(run["time"][-1]) - 1.0, None))
    return {
        "rms_mm": 1e3 * deviation(run), "largest_mm": 1e3 * float(np.abs(off).max()),
        "end_mm": 1e3 * float(off[-1]), "end_yaw_deg": float(np.degrees(run["yaw"].sel(body="hull")[-1])),
        "end_sideways_mm_s": 1e3 * float(late["velocity"].sel(body="hull", axis="y").mean()),
        "forward_m": float(np.ptp(run["position"].sel(body="hull", axis="x").values)),
    }  # fmt: skip


def plot(runs: Mapping[str, xr.Dataset]) -> Figure:
    """Draw paths and steering in D60/U1."""
    with plt.rc_context(STYLE):
        figure, (left, right) = plt.subplots(
            1, 2, figsize=(11.0, 3.6), layout="constrained", gridspec_kw={"width_ratios": [1.5, 1.0]}
        )
        points = np.array(LINE)
        left.plot(*points.T, color="0.6", lw=4.0, alpha=0.6, label="line to hold")
        for k, (name, run) in enumerate(runs.items()):
            x, y = run["position"].sel(body="hull", axis=["x", "y"]).values.T
            left.plot(x - x[0], y - y[0], color=f"C{k}", label=name)
            right.plot(run["time"], np.degrees(run["steering_angle"].mean("front_wheel")), color=f"C{k}", label=name)
        left.set(xlabel="x [m]", ylabel="y [m]", xlim=(-0.2, 1.05 * x[-1]))
        right.set(xlabel="time [s]", ylabel="steering angle [deg]")
        left.legend(loc="lower right")
    return figure


def main(quick: bool = False, workers: int = 2, folder: Path = Path("tuning")) -> xr.Dataset:
    """Tune the driver, drive and compare; return the measures, dims (driver, water)."""
    base = replace(amphibious_lane_change(), duration=12.0)
    search = Genetic(population=12, generations=4, workers=workers)
    water = WATER
    if quick:
        base = replace(base, hydrodynamics="coefficients", duration=4.0)
        search = Genetic(population=4, generations=1, workers=workers)
        folder = folder / "quick"
        water = {"D60/U1": WATER["D60/U1"]}
    following: Experiment = replace(base, maneuver=PATH).with_values(WATER["D60/U1"])
    first = tune(following, RANGES, objective, folder / "genetic", method=search)
    best = first
    if not quick:
        polish = Simplex(start=first.best, evaluations=30)
        best = tune(following, RANGES, objective, folder / "simplex", method=polish)
    drivers = {
        "open loop": replace(base, maneuver=LaneChange()),
        "as shipped": replace(base, maneuver=PATH),
        "tuned": replace(base, maneuver=PATH).with_values(best.best),
    }
    rows: dict[str, list[list[float]]] = {}
    shown = {}
    for name, experiment in drivers.items():
        for where, values in water.items():
            run = experiment(values)
            if where == "D60/U1":
                shown[name] = run
            for measure, value in measures(run).items():
                rows.setdefault(measure, [[] for _ in drivers])[list(drivers).index(name)].append(value)
    result = xr.Dataset(
        {name: (("driver", "water"), values) for name, values in rows.items()},
        coords={"driver": list(drivers), "water": list(water)},
        attrs={f"tuned {name}": value for name, value in best.best.items()}
        | {"objective": best.objective, "evaluations": first.evaluations.sizes["evaluation"]},
    )
    figure = plot(shown)
    if quick:
        plt.close(figure)
        return result
    save({"path_following.png": figure, "path_following.nc": result})
    return result


if __name__ == "__main__":
    parser = study_parser(__doc__)
    add_workers(parser, "tuning")
    answer = main(**vars(parser.parse_args()))
    for measure in answer.data_vars:
        print(measure)
        print(answer[measure].to_pandas().round(2).to_string())
    print(answer.attrs)
