"""How well do the networks that come with exumob know the whole range: 20 to 90 % depth, currents from all sides?

They learned from nine lane changes (`data/cfd_mbd`, 18 mm cells) and from the 21 runs of `data/full_range` that teach:
drives over three soils and captive runs that `exumob learn` planned and made for the paper's vehicle, on cells of 22 mm.
Here they are compared with the coefficients that they rest on and with the calibrated ones, on the five drives that were
kept apart, as they were made on 22 mm and made again on 18 mm (`data/full_range/fine`). Then they are asked how much of
a map they know: straight ahead over all published soils, in several depths, currents and directions.

First: exumob train --preset balanced --data data/cfd_mbd --data data/full_range/runs --output networks, and copy the
five files to exumob/surrogates/weights
Run: python studies/full_range.py [--jobs 2]     (a quarter of an hour; with `data/full_range/fine` removed, which is
     made again, an hour of two cores more)
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from common import FULL_RANGE, full_range_plan, save, study_parser
from matplotlib.figure import Figure

from exumob import Soil, simulate
from exumob.driving.maneuver import ConstantSteer
from exumob.learning.campaign import compute_task
from exumob.learning.compact import thinned
from exumob.learning.dataset import load_run, load_runs
from exumob.learning.drives import maneuver_name
from exumob.learning.evaluation import closed_loop
from exumob.learning.plan import FreeTask
from exumob.learning.validation import compare_loads, load_errors
from exumob.mobility.crossing import Limits
from exumob.paper.reference_runs import CELL_SIZE, work_folder
from exumob.simulation.result_files import save_dataset
from exumob.support.errors import SimulationError
from exumob.support.figures import STYLE
from exumob.surrogates.model import SurrogateHydrodynamics
from exumob.vehicle.parameters import Vehicle
from exumob.water.calibrated import CalibratedHydrodynamics
from exumob.water.conditions import Water
from exumob.water.hydrodynamics import Hydrodynamics
from vehicle_models.amphibious import amphibious_vehicle

FINE = FULL_RANGE / "fine"
"""Folder of the drives kept apart as they go on finer cells."""
MODELS = ("networks", "their coefficients", "calibrated", "flow on 22 mm")
"""Networks that come with exumob, the coefficients that they rest on, the calibrated ones, and the flow on the cells of
the runs that taught, beside that on finer ones."""
DEPTHS, CURRENTS, SIDES = (0.2, 0.55, 0.9), (0.0, 0.75, 1.5), (0.0, 90.0, 180.0)
"""Waters of a map: depths over the tyre's diameter, currents [m/s], and where they come from, from ahead to the left
[deg]."""
STRAIGHT, WINDOW = 3.0, 1.5
"""Time for which the vehicle goes straight ahead there, and the last part of it that counts [s], as in a map."""


def judges() -> list[FreeTask]:
    """The drives that were kept apart."""
    return [task for task in full_range_plan().tasks if isinstance(task, FreeTask) and task.role == "apart"]


def fine_run(task: FreeTask) -> xr.Dataset:
    """One of them on the cells of the paper's runs; made if it is missing."""
    file = FINE / f"{task.name}.nc"
    if not file.exists():
        checkpoint = work_folder() / f"{task.name}_fine.npz"
        checkpoint.parent.mkdir(parents=True, exist_ok=True)
        run = compute_task(replace(task, cell_size=CELL_SIZE), amphibious_vehicle(), checkpoint, lambda time: None)
        FINE.mkdir(parents=True, exist_ok=True)
        save_dataset(thinned(run), file)
        checkpoint.unlink(missing_ok=True)
    return load_run(file)


def compared(tasks: Sequence[FreeTask], jobs: int) -> xr.Dataset:
    """Where models end beside the flow on 22 and on 18 mm, and how far the networks' loads are off along its runs."""
    vehicle, networks = amphibious_vehicle(), SurrogateHydrodynamics()
    models: dict[str, Hydrodynamics] = {
        "networks": networks, "their coefficients": CalibratedHydrodynamics(waves=networks.waves),
        "calibrated": CalibratedHydrodynamics(),
    }  # fmt: skip
    with ProcessPoolExecutor(jobs) as pool:
        fine = dict(zip([task.name for task in tasks], pool.map(fine_run, tasks), strict=True))
    flows = {"22 mm": load_runs(FULL_RANGE / "runs" / f"{task.name}.nc" for task in tasks), "18 mm": fine}
    ends = np.full((len(flows), len(MODELS), len(tasks)), np.nan)
    for r, task in enumerate(tasks):
        for m, model in enumerate(models.values()):
            run = simulate(
                vehicle, Soil.published(task.soil), task.water, task.maneuver, model, duration=task.duration,
                record_step=10e-3,
            )  # fmt: skip
            for f, known in enumerate(flows.values()):
                ends[f, m, r] = closed_loop(run, known[task.name])["final"]
        ends[1, -1, r] = closed_loop(flows["22 mm"][task.name], fine[task.name])["final"]
    loads = []
    for runs in flows.values():
        along = {name: compare_loads(networks.networks, run, vehicle) for name, run in runs.items()}
        found = load_errors(along, vehicle)
        loads.append([float(found[name].mean()) for name in ("networks", "coefficients")])
    return xr.Dataset(
        {
            "final": (("cells", "model", "run"), ends, {"units": "%"}),
            "load_error": (("cells", "loads"), loads, {"units": "1"}),
            "about": ("run", [_about(task, vehicle) for task in tasks]),
        },
        {"cells": list(flows), "model": list(MODELS), "run": [task.name for task in tasks],
         "loads": ["networks", "their coefficients"]},
    )  # fmt: skip


def _about(task: FreeTask, vehicle: Vehicle) -> str:
    water = task.water
    angle = math.degrees(math.remainder(water.current_direction - math.pi, 2.0 * math.pi))
    ratio = water.uniform_depth / vehicle.wheel.diameter
    kind = maneuver_name(task.maneuver)
    return f"{kind} on {task.soil}, {100.0 * ratio:.0f} %, {water.current_speed:.2f} m/s from {angle:.0f} deg"


@functools.cache
def _networks() -> Hydrodynamics:
    return SurrogateHydrodynamics()


def outside(case: tuple[str, float, float, float]) -> float:
    """Share of the end of a run straight ahead that lies outside the networks' range; nan: the run breaks down."""
    soil, depth, current, side = case
    vehicle = amphibious_vehicle()
    depth *= vehicle.wheel.diameter
    water = Water(depth, current, math.remainder(math.pi + math.radians(side), 2.0 * math.pi))
    try:
        run = simulate(
            vehicle, Soil.published(soil), water, ConstantSteer(), _networks(), duration=STRAIGHT, micro_step=1e-3
        )
    except SimulationError:
        return math.nan
    late = run["hydrodynamics_out_of_range"].sel(macro_time=slice(STRAIGHT - WINDOW, None))
    return float(late.any("body").mean())


def known(jobs: int, quick: bool) -> xr.Dataset:
    """How much of a map over all published soils networks know: share of the window outside their range."""
    soils = [row.name for row in Soil.published_table()][:: 12 if quick else 1]
    depths, flows = DEPTHS[:: 2 if quick else 1], [(0.0, 0.0), *itertools.product(CURRENTS[1:], SIDES)]
    flows = flows[:2] if quick else flows
    cases = [(soil, depth, *flow) for soil, depth, flow in itertools.product(soils, depths, flows)]
    with ProcessPoolExecutor(jobs) as pool:
        found = np.array(list(pool.map(outside, cases, chunksize=4)))
    return xr.Dataset(
        {"outside": (("soil", "depth_ratio", "flow"), found.reshape(len(soils), len(depths), len(flows)),
                     {"units": "1"})},
        {"soil": soils, "depth_ratio": list(depths),
         "flow": [f"{current:g} m/s from {side:.0f} deg" if current else "still" for current, side in flows]},
    )  # fmt: skip


def hatched(found: xr.Dataset) -> xr.DataArray:
    """Whether a map is hatched: more of the window is outside than a map allows, or the run broke down."""
    return ~(found["outside"] <= Limits().range_share)


def plot(ends: xr.Dataset, share: xr.Dataset) -> Figure:
    """Draw where drives end with each model, and what share of the map is hatched over soils."""
    with plt.rc_context(STYLE):
        figure, panels = plt.subplots(1, 3, figsize=(11.0, 4.6), width_ratios=(1.0, 1.0, 0.8), layout="constrained")
        places = np.arange(ends.sizes["run"])
        for axes, cells in zip(panels, ends["cells"].values, strict=False):
            for n, model in enumerate(MODELS):
                axes.barh(places + 0.2 * (n - 1.5), ends["final"].sel(cells=cells, model=model), 0.19, color=f"C{n}",
                          label=model)  # fmt: skip
            axes.set(xlabel="final position off [% of the path]", title=f"beside the flow on {cells}")
            axes.set_yticks(places, [])
            axes.invert_yaxis()
        panels[0].set_yticks(places, [str(a).replace(", ", "\n", 1) for a in ends["about"].values], fontsize="x-small")
        panels[1].legend(fontsize="x-small")
        of = hatched(share).mean(["depth_ratio", "flow"])
        order = np.argsort(of.values)
        panels[2].barh(np.arange(len(order)), 100.0 * of[order], 0.7, color="C0")
        panels[2].set_yticks(np.arange(len(order)), of["soil"].values[order], fontsize="xx-small")
        panels[2].set(xlabel="outside the range [% of the waters]", title="all published soils")
    return figure


def lines(ends: xr.Dataset, share: xr.Dataset) -> str:
    """The tables as they stand on the page of the study."""
    columns = [(cells, model) for cells in ends["cells"].values for model in MODELS]
    columns = [c for c in columns if np.isfinite(ends["final"].sel(cells=c[0], model=c[1])).all()]
    rows = [f"| final position [% of the path] | {' | '.join(f'{m}, beside {c}' for c, m in columns)} |"]
    rows.append("|---" * (len(columns) + 1) + "|")
    final = {c: ends["final"].sel(cells=c[0], model=c[1]).values for c in columns}
    for n, about in enumerate(ends["about"].values):
        rows.append(f"| {about} | {' | '.join(f'{v[n]:.2g}' for v in final.values())} |")
    rows.append(f"| **mean (worst)** | {' | '.join(f'{v.mean():.2g} ({v.max():.2g})' for v in final.values())} |")
    for cells in ends["cells"].values:
        off = [f"{one} {float(ends['load_error'].sel(cells=cells, loads=one)):.2f}" for one in ends["loads"].values]
        rows.append(f"\nLoad error beside the flow on {cells}: {', '.join(off)}")
    of = hatched(share)
    for name in ("depth_ratio", "flow"):
        each = [f"{100.0 * float(of.sel({name: v}).mean()):.0f} % at {v}" for v in share[name].values]
        rows.append(f"\nOutside the range, by {name}: {', '.join(each)}")
    soils = of.mean(["depth_ratio", "flow"]).to_series().sort_values()
    rows.append(f"\nAll waters and soils: {100.0 * float(of.mean()):.1f} %; worst: {soils.tail(4).to_dict()}")
    return "\n".join(rows)


def main(quick: bool = False, jobs: int = 2) -> tuple[xr.Dataset, xr.Dataset]:
    """Compare and ask; with `quick` the first drive, a few soils, and nothing is written."""
    ends, share = compared(judges()[: 1 if quick else None], jobs), known(jobs, quick)
    if not quick:
        save({"full_range.png": plot(ends, share), "full_range.nc": ends, "full_range_known.nc": share})
    print(lines(ends, share))
    return ends, share


if __name__ == "__main__":
    parser = study_parser(__doc__)
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    main(**vars(parser.parse_args()))
