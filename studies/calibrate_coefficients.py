"""Do a few fitted terms mend the coefficient model, and do they carry over to other vehicles?

The published coefficients know no bow wave, suction or trim. `exumob.water.wave_loads` gives these loads a form by
dimensional analysis; here its coefficients are fitted to the nine training runs of the amphibious vehicle
(`data/cfd_mbd`) and written to `exumob/water/wave_loads.json`. Judges are its four unseen runs, and lane changes of
three other vehicles with the flow in the loop, to which nothing was fitted: D50/U0.5, speeds and times by Froude's law,
cells of 0.14 of the tyre's diameter.

Run: python studies/calibrate_coefficients.py [--jobs 2]     (the three flow runs take ten minutes of a core each, once)
     python studies/calibrate_coefficients.py --present      (two minutes, with the flow runs that there are)
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from common import CFD_RUNS, save, study_parser
from matplotlib.figure import Figure
from scipy.optimize import lsq_linear

from exumob import Soil, simulate
from exumob.driving.maneuver import LaneChange
from exumob.flow import FlowSettings
from exumob.flow.cost import flow_cost
from exumob.flow.vehicle_window import vehicle_window
from exumob.learning.campaign import LearningFolder, run_campaign
from exumob.learning.dataset import base_loads, body_states, load_runs, usable, water_of
from exumob.learning.evaluation import FAST, closed_loop
from exumob.learning.plan import FreeTask
from exumob.paper.reference_runs import SOIL, set_up_log, work_folder
from exumob.paper.scenarios import TRAINING, UNSEEN
from exumob.simulation.settings import time_scale, usual_speed
from exumob.support.arrays import Array
from exumob.support.figures import STYLE
from exumob.support.provenance import provenance
from exumob.vehicle.parameters import Vehicle
from exumob.water.calibrated import CalibratedHydrodynamics
from exumob.water.coefficients import CoefficientHydrodynamics
from exumob.water.conditions import Water
from exumob.water.wave_loads import (
    COMPONENTS,
    FITTED,
    FORMS,
    KIND_OF_BODY,
    KINDS,
    RESISTING,
    TERMS,
    WaveCoefficients,
    terms_along,
)
from vehicle_models.amphibious import amphibious_vehicle
from vehicle_models.large_4x4 import large_4x4
from vehicle_models.light_4x4 import light_4x4
from vehicle_models.small_car import small_car

OTHERS = {"light_4x4": light_4x4, "large_4x4": large_4x4, "small_car": small_car}
"""Vehicles to which nothing is fitted."""
DEPTH, CURRENT = 0.5, 0.5
"""Depth over the tyre's diameter, and head current of the paper's vehicle [m/s], in their runs."""
CELLS = 0.14
"""Size of the cells in their runs over the tyre's diameter."""
THINNING = 8
"""Interval of the instants that are fitted [ms]."""
RIDGE = 1e-3
"""Penalty on the coefficients, of terms of size 1 [-]."""
MODELS = ("coefficients", "calibrated")
"""The models that are compared with the flow."""
ERRORS = ("hull_error", "axle_error")
"""Errors of loads over their deviation [-]: mean of the hull's six, and of the side force of the front axle."""
LATE = 1.0
"""Time from which on means are taken, times `time_scale`: the wheels have their speed [s]."""


def other_task(name: str, vehicle: Vehicle) -> FreeTask:
    """The lane change of another vehicle, by Froude's law."""
    unit, diameter = time_scale(vehicle), vehicle.wheel.diameter
    angle = min(math.radians(30.0), vehicle.steering.limit)
    maneuver = LaneChange(angle, 2.0 * unit, 5.5 * unit, usual_speed(vehicle) / vehicle.wheel.radius, 1.0 * unit)
    water = Water.at_ratio(DEPTH, CURRENT * unit, tyre_diameter=diameter)
    size, duration = round(CELLS * diameter, 4), round(8.0 * unit, 1)
    grid = vehicle_window(vehicle, size, water)
    speed = usual_speed(vehicle) + water.current_speed
    cost = flow_cost(grid.n_cells, grid.smallest_width, speed, duration, 4e-3, FlowSettings().courant)
    return FreeTask(f"{name}_D50_U0.5", "apart", water, maneuver, duration, size, cost)


def other_runs(jobs: int, present_only: bool) -> dict[str, tuple[Vehicle, FreeTask, xr.Dataset]]:
    """Flow runs of the other vehicles: those that there are, and, unless `present_only`, the others, which are made."""
    found = {}
    for name, make in OTHERS.items():
        vehicle = make()
        task, folder = other_task(name, vehicle), LearningFolder(work_folder() / "other_vehicles" / name)
        folder.claim(vehicle, task.cell_size)
        if not present_only and (failed := run_campaign([task], vehicle, folder, jobs=jobs)):
            raise RuntimeError(f"{name}: {failed}")
        if not folder.unfinished([task]):
            found[name] = vehicle, task, folder.load(mixed=True, vehicle=vehicle)[task.name]
    return found


def fit(runs: Mapping[str, xr.Dataset], vehicle: Vehicle) -> Array:
    """Coefficients of all loads, shape (3, 6, 5): least squares with a ridge."""
    terms, missing = [], []
    for run in runs.values():
        rows = np.flatnonzero(usable(run))[::THINNING]
        water = water_of(run)
        terms.append(terms_along(vehicle, water.over(), water.density, body_states(run)[rows]))
        missing.append((run["water_wrench_smooth"].values - base_loads(run, vehicle))[rows])
    every, lacking = np.concatenate(terms), np.concatenate(missing)
    values = np.zeros((len(KINDS), len(COMPONENTS), TERMS))
    for kind, name in enumerate(KINDS):
        bodies = [b for b, k in enumerate(KIND_OF_BODY) if k == kind]
        for k, component in enumerate(COMPONENTS):
            forms = FORMS[name].get(component, ())
            if not forms:
                continue
            a = np.concatenate([every[:, b, k, : len(forms)] for b in bodies])
            y = np.concatenate([lacking[:, b, k] for b in bodies])
            scale = np.sqrt(np.mean(a**2, axis=0))
            normal = (a / scale).T @ (a / scale) / len(y) + RIDGE * np.eye(len(forms))
            upper = np.where(np.arange(len(forms)) < RESISTING.get(component, 0), 0.0, np.inf)
            root = np.linalg.cholesky(normal).T
            right = np.linalg.solve(root.T, (a / scale).T @ y / len(y))
            values[kind, k, : len(forms)] = lsq_linear(root, right, (-np.inf, upper)).x / scale
    return values


def without_side_forces(waves: WaveCoefficients) -> WaveCoefficients:
    """The form that was tried blind on two vehicles: wheels have no side forces of waves."""
    values = waves.values.copy()
    for name in ("Fy", "Mx"):
        values[1:, COMPONENTS.index(name)] = 0.0
    return WaveCoefficients(values, waves.about)


def _relative(loads: Array, true: Array) -> float:
    """Root mean square error over the deviation."""
    return float(np.sqrt(np.mean((loads - true) ** 2)) / true.std())


def compared(
    run: xr.Dataset, vehicle: Vehicle, water: Water, maneuver: LaneChange, waves: WaveCoefficients
) -> dict[str, dict[str, float]]:
    """Mean loads of the flow and of both models along a run, errors of their loads, and where their drives end."""
    rows = np.flatnonzero(usable(run))[::THINNING]
    late = run["time"].values[rows] >= LATE * time_scale(vehicle)
    true = run["water_wrench_smooth"].values[rows].astype(float)
    base = base_loads(run, vehicle)[rows]
    extra = terms_along(vehicle, water.over(), water.density, body_states(run)[rows])
    first = without_side_forces(waves)
    found = {}
    for name, loads, model in (
        ("flow", true, None), ("coefficients", base, CoefficientHydrodynamics()),
        ("calibrated", base + (extra * waves.by_body).sum(axis=-1), CalibratedHydrodynamics(waves=waves)),
        ("first form", base + (extra * first.by_body).sum(axis=-1), CalibratedHydrodynamics(waves=first)),
    ):  # fmt: skip
        deviation = np.maximum(true.std(axis=0), 1e-9)
        row = {
            "drag": -float(loads[late, :, 0].sum(axis=1).mean()), "lift": float(loads[late, 0, 2].mean()),
            "trim": float(loads[late, 0, 4].mean()),
            "hull_error": float((np.sqrt(np.mean((loads - true) ** 2, axis=0)) / deviation)[0].mean()),
            "axle_error": _relative(loads[:, 1:3, 1].sum(axis=1), true[:, 1:3, 1].sum(axis=1)),
        }  # fmt: skip
        if model is not None:
            drive = simulate(
                vehicle, Soil.published(SOIL), water, maneuver, model, duration=float(round(run["time"].values[-1], 3)),
                record_step=10e-3, **FAST,
            )  # fmt: skip
            row["final"] = closed_loop(drive, run)["final"]
        found[name] = row
    return found


def table(found: Mapping[str, Mapping[str, Mapping[str, float]]]) -> xr.Dataset:
    """All figures, by run and model."""
    models = ("flow", "coefficients", "calibrated", "first form")
    units = {"drag": "N", "lift": "N", "trim": "N m", "hull_error": "1", "axle_error": "1", "final": "%"}
    return xr.Dataset(
        {
            name: (
                ("run", "model"), [[row[model].get(name, np.nan) for model in models] for row in found.values()],
                {"units": unit},
            )
            for name, unit in units.items()
        },
        {"run": list(found), "model": list(models)},
    )  # fmt: skip


def lines(found: xr.Dataset) -> str:
    """The tables as they stand on the page of the study."""
    loads = ["| run | drag [N] | lift of the hull [N] | trim moment of the hull [N m] |", "|---" * 4 + "|"]
    errors = ["| run | loads of the hull | side force, front axle | final position | first form |", "|---" * 5 + "|"]
    for run in found["run"].values:
        one = found.sel(run=run)
        three = [
            "; ".join(f"{v:.3g}" for v in one[name].sel(model=["flow", *MODELS]).values)
            for name in ("drag", "lift", "trim")
        ]
        loads.append(f"| {run} | {' | '.join(three)} |")
        two = ["; ".join(f"{v:.2f}" for v in one[name].sel(model=list(MODELS)).values) for name in ERRORS]
        ends = "; ".join(f"{v:.1f}" for v in one["final"].sel(model=list(MODELS)).values)
        first = float(one["final"].sel(model="first form"))
        errors.append(f"| {run} | {' | '.join(two)} | {ends} % | {first:.1f} % |")
    return "\n".join([*loads, "", *errors])


def plot(found: xr.Dataset) -> Figure:
    """Draw the models' drag, lift and final positions over those of the flow."""
    with plt.rc_context(STYLE):
        figure, panels = plt.subplots(1, 3, figsize=(11.0, 3.4), layout="constrained")
        places = np.arange(found.sizes["run"])
        flow = found.sel(model="flow")
        for n, model in enumerate(MODELS):
            one = found.sel(model=model)
            shares = (one["drag"] / flow["drag"], one["lift"] / flow["lift"], one["final"])
            for axes, values in zip(panels, shares, strict=True):
                axes.bar(places + 0.36 * (n - 0.5), values, 0.34, color=f"C{n}", label=model)
        labels = ("drag, over the flow's [-]", "hull's lift, over the flow's [-]", "final position off [%]")
        for axes, label in zip(panels, labels, strict=True):
            axes.set_xticks(places, [str(run) for run in found["run"].values], rotation=40, ha="right")
            axes.set(ylabel=label)
        for axes in panels[:2]:
            axes.axhline(1.0, color="0.4", lw=0.8)
        figure.legend(*panels[0].get_legend_handles_labels(), loc="outside upper center", ncols=2)
    return figure


def origin(scenarios: Sequence[Any]) -> dict[str, Any]:
    """What the file of the coefficients says of them."""
    return {
        "command": "python studies/calibrate_coefficients.py",
        **{name: provenance()[name] for name in ("exumob_version", "git_revision", "date")},
        "vehicle": "amphibious", "runs": [scenario.name for scenario in scenarios],
        "depth_ratio": [0.4, 0.6], "current_speed": [0.0, 1.0],
    }  # fmt: skip


def main(quick: bool = False, jobs: int = 2, present_only: bool = False) -> xr.Dataset:
    """Fit, write the coefficients, compare; with `quick` three runs are fitted, one judged, and nothing is written."""
    vehicle = amphibious_vehicle()
    taught = TRAINING[::4] if quick else TRAINING
    runs = load_runs(CFD_RUNS / f"{scenario.file_stem}.nc" for scenario in taught)
    waves = WaveCoefficients(fit(runs, vehicle), origin(taught))
    found = {}
    for scenario in UNSEEN[:1] if quick else UNSEEN:
        run = load_runs([CFD_RUNS / f"{scenario.file_stem}.nc"])[scenario.name]
        found[scenario.name] = compared(run, vehicle, scenario.water(vehicle), scenario.maneuver(), waves)
    if quick:
        return table(found)
    waves.save(FITTED)
    for name, (other, task, run) in other_runs(jobs, present_only).items():
        assert isinstance(task.maneuver, LaneChange)
        found[name.replace("_", " ")] = compared(run, other, task.water, task.maneuver, waves)
    result = table(found)
    save({"calibrated.png": plot(result), "calibrate_coefficients.nc": result})
    return result


if __name__ == "__main__":
    parser = study_parser(__doc__)
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    parser.add_argument("--present", dest="present_only", action="store_true", help="do not compute what is missing")
    set_up_log()
    print(lines(main(**vars(parser.parse_args()))))
