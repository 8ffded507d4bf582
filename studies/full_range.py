"""How well do the networks that come with exumob know the whole range: 20 to 90 % depth, currents from all sides?

Beyond the range of nine lane changes, which taught the first of them (`data/cfd_mbd`), others take over. These learned
from the 22 runs of `data/full_range` that teach: drives over four soils and captive runs that `exumob learn` planned
and made for the paper's vehicle, on cells of 22 mm. Here they are compared with the coefficients that they rest on and
with the calibrated ones, on the five drives that were kept apart, and each seed by itself on the drives that it kept
for validation. On cells of 18 mm, those of the runs from which the default networks learned, there are two straight
drives across a current, and of the five those that were made so far (`data/full_range/fine`; `--fine` makes all). Then
networks are asked how much of a map they know: straight ahead over all published soils, in several depths, currents and
directions.

First: exumob train --preset balanced --data data/full_range/runs --output networks
Run: python studies/full_range.py --networks networks [--map] [--fine] [--jobs 2]     (five minutes, with --map twenty
     more, with --fine a quarter to half an hour of a core for each run that is missing; without --networks those that
     come with exumob stay)
"""

from __future__ import annotations

import functools
import itertools
import json
import math
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from common import FULL_RANGE_RUNS, full_range_plan, save, study_parser
from matplotlib.figure import Figure
from scipy.spatial.transform import Rotation

from exumob import Soil, simulate
from exumob.driving.maneuver import ConstantSteer
from exumob.learning.campaign import compute_task
from exumob.learning.compact import thinned
from exumob.learning.dataset import load_run, load_runs
from exumob.learning.drives import maneuver_name
from exumob.learning.evaluation import closed_loop
from exumob.learning.plan import FreeTask
from exumob.learning.presets import WHOLE_RANGE
from exumob.learning.validation import card_figures, compare_drives, compare_loads, load_errors
from exumob.mobility.crossing import Limits
from exumob.paper.reference_runs import work_folder
from exumob.simulation.result_files import save_dataset
from exumob.support.errors import SimulationError
from exumob.support.figures import STYLE
from exumob.surrogates.ensemble import save_ensemble
from exumob.surrogates.model import SurrogateHydrodynamics
from exumob.surrogates.networks import FULL_RANGE, NetworkSet, network_file
from exumob.vehicle.parameters import Vehicle
from exumob.water.calibrated import CalibratedHydrodynamics
from exumob.water.conditions import Water
from exumob.water.hydrodynamics import Hydrodynamics
from vehicle_models.amphibious import amphibious_vehicle

MODELS = ("networks", FULL_RANGE, "their coefficients", "calibrated")
"""The default networks, those for the whole range alone, the coefficients that the latter rest on, and the calibrated
ones."""
DEPTHS, CURRENTS, SIDES = (0.2, 0.55, 0.9), (0.0, 0.75, 1.5), (0.0, 90.0, 180.0)
"""Waters of a map: depths over the tyre's diameter, currents [m/s], and where they come from, from ahead to the left
[deg]."""
FINE_RUNS, FINE = FULL_RANGE_RUNS / "fine", 0.018
"""Folder of the runs on finer cells, and their width [m]."""
ACROSS = ((0.6, 0.5), (0.5, 0.75))
"""Waters of drives straight ahead across a current from the right: depth over the tyre's diameter, speed [m/s]."""
STRAIGHT, WINDOW = 3.0, 1.5
"""Time for which the vehicle goes straight ahead there, and the last part of it that counts [s], as in a map."""


def ship(folder: Path) -> None:
    """Write networks of `exumob train`, with their report card, as those that come with exumob for the whole range."""
    members = [NetworkSet.load(file) for file in sorted(folder.glob(f"{WHOLE_RANGE}_seed*.safetensors"))]
    if not members:
        raise ValueError(f"--networks {folder} holds no networks of {WHOLE_RANGE}; first: exumob train, as above.")
    save_ensemble(members, network_file(FULL_RANGE))  # lines of trust of the drives look there
    plan, runs = full_range_plan(), load_runs(FULL_RANGE_RUNS.glob("runs/*.nc"))
    apart = {name: run for name, run in runs.items() if run.attrs["role"] == "apart"}
    taught = {name: run for name, run in runs.items() if name not in apart}
    errors = load_errors({n: compare_loads(members, run, plan.vehicle) for n, run in apart.items()}, plan.vehicle)
    drives = compare_drives(members, plan, apart)
    card = card_figures(plan, members, errors, drives, taught, apart)
    save_ensemble(members, network_file(FULL_RANGE), card)
    tasks, default = {task.name: task for task in judges()}, SurrogateHydrodynamics()
    for one in card["drives"]:  # with the networks for lane changes within their range
        one["default_end"] = 0.01 * _end(tasks[one["name"]], default, apart[one["name"]])
    save_ensemble(members, network_file(FULL_RANGE), card)
    print("report card:", json.dumps(card | {"parameters": "...", "load_floor": "..."}, indent=1))


def judges() -> list[FreeTask]:
    """The drives that were kept apart."""
    return [task for task in full_range_plan().tasks if isinstance(task, FreeTask) and task.role == "apart"]


def fine_tasks() -> list[FreeTask]:
    """The same drives on finer cells, and straight ahead across a current."""
    tasks = [replace(task, cell_size=FINE) for task in judges()]
    for ratio, current in ACROSS:
        water = Water(ratio * amphibious_vehicle().wheel.diameter, current, 0.5 * math.pi)
        tasks.append(
            replace(
                tasks[0], name=f"across_D{100.0 * ratio:.0f}_U{current:g}", soil="LETE sand", water=water,
                maneuver=ConstantSteer(), duration=5.0,
            )
        )  # fmt: skip
    return tasks


def make_fine(task: FreeTask) -> None:
    """Make a run on finer cells, unless it is there; it goes on where it was stopped."""
    file = FINE_RUNS / f"{task.name}.nc"
    if not file.exists():
        checkpoint = work_folder() / "full_range_fine" / f"{task.name}.npz"
        for folder in (checkpoint.parent, FINE_RUNS):
            folder.mkdir(parents=True, exist_ok=True)
        run = compute_task(task, amphibious_vehicle(), checkpoint, lambda time: None)
        save_dataset(thinned(run, every=10), file)
        checkpoint.unlink()


def compared(tasks: Sequence[FreeTask], folder: Path = FULL_RANGE_RUNS / "runs") -> xr.Dataset:
    """Where models end beside the flow, and how far the loads are off along its runs."""
    vehicle, networks = amphibious_vehicle(), SurrogateHydrodynamics(FULL_RANGE)
    models: dict[str, Hydrodynamics] = {
        "networks": SurrogateHydrodynamics(), FULL_RANGE: networks,
        "their coefficients": CalibratedHydrodynamics(waves=networks.waves), "calibrated": CalibratedHydrodynamics(),
    }  # fmt: skip
    runs = load_runs(folder / f"{task.name}.nc" for task in tasks)
    driven = [[_drive(task, model) for task in tasks] for model in models.values()]
    ends = [[closed_loop(run, runs[task.name])["final"] for run, task in zip(of, tasks, strict=True)] for of in driven]
    along = {name: compare_loads(networks.networks, run, vehicle) for name, run in runs.items()}
    found = load_errors(along, vehicle)
    return xr.Dataset(
        {
            "final": (("model", "run"), ends, {"units": "%"}),
            "at_end": (
                ("model", "run", "what"),
                [[_at_end(run) for run in of] for of in driven],
                {"units": "m, m, deg"},
            ),
            "flow_at_end": (("run", "what"), [_at_end(runs[task.name]) for task in tasks], {"units": "m, m, deg"}),
            "load_error": ("loads", [float(found[n].mean()) for n in ("networks", "coefficients")], {"units": "1"}),
            "about": ("run", [_about(task, vehicle) for task in tasks]),
        },
        {
            "model": list(MODELS),
            "run": [task.name for task in tasks],
            "loads": [FULL_RANGE, "their coefficients"],
            "what": ["x", "y", "yaw"],
        },
    )


def _drive(task: FreeTask, model: Hydrodynamics) -> xr.Dataset:
    return simulate(
        amphibious_vehicle(), Soil.published(task.soil), task.water, task.maneuver, model, duration=task.duration,
        record_step=10e-3,
    )  # fmt: skip


def _end(task: FreeTask, model: Hydrodynamics, reference: xr.Dataset) -> float:
    """Distance of the final positions over the length of the path [%]."""
    return float(closed_loop(_drive(task, model), reference)["final"])


def _at_end(run: xr.Dataset) -> list[float]:
    """Way along world x and y [m], and heading [deg], at the end of a run that began at the origin along x."""
    last = run.isel(time=-1).sel(body="hull")
    x, y = (last["position"] - run["position"].isel(time=0).sel(body="hull")).values[:2]
    heading = Rotation.from_quat(last["quaternion"].values, scalar_first=True).as_euler("ZYX", degrees=True)[0]
    return [float(x), float(y), float(heading)]


def held_back() -> xr.Dataset:
    """Where each seed's network alone ends the drives that it kept for validation, and the coefficients below it."""
    vehicle, tasks = amphibious_vehicle(), {task.name: task for task in full_range_plan().tasks}
    found = []
    for member in SurrogateHydrodynamics(FULL_RANGE).networks:
        for name in member.about["held_back"].split(", "):
            task = tasks.get(name)
            if not isinstance(task, FreeTask):
                continue
            reference = load_run(FULL_RANGE_RUNS / "runs" / f"{name}.nc")
            models: list[Hydrodynamics] = [
                SurrogateHydrodynamics(member), CalibratedHydrodynamics(waves=member.waves), CalibratedHydrodynamics()
            ]  # fmt: skip
            ends = [_end(task, model, reference) for model in models]
            found.append(
                (_about(task, vehicle).replace("multisine of the steering", f"seed {member.about['seed']}"), ends)
            )
    return xr.Dataset(
        {"final": (("run", "model"), [ends for _, ends in found], {"units": "%"})},
        {"run": [name for name, _ in found], "model": ["one network", *MODELS[2:4]]},
    )


def _about(task: FreeTask, vehicle: Vehicle) -> str:
    water = task.water
    angle = math.degrees(math.remainder(water.current_direction - math.pi, 2.0 * math.pi))
    ratio = water.uniform_depth / vehicle.wheel.diameter
    kind = maneuver_name(task.maneuver)
    return f"{kind} on {task.soil}, {100.0 * ratio:.0f} %, {water.current_speed:.2f} m/s from {round(angle)} deg"


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


def plot(ends: xr.Dataset, held: xr.Dataset) -> Figure:
    """Draw where drives end with each model."""
    with plt.rc_context(STYLE):
        figure, panels = plt.subplots(1, 2, figsize=(11.0, 4.6), layout="constrained")
        apart, own = (
            (ends["final"], ends["about"].values, "kept apart"),
            (held["final"].T, held["run"].values, "of one seed alone"),
        )
        for axes, (final, about, title) in zip(panels, (apart, own), strict=True):
            places, models = np.arange(final.sizes["run"]), final["model"].values
            for n, model in enumerate(models):
                color = f"C{list(MODELS).index(model)}" if model in MODELS else "C4"
                height = 0.8 / len(models)
                axes.barh(places + height * (n - 0.5 * (len(models) - 1)), final.sel(model=model), 0.95 * height,
                          color=color, label=model)  # fmt: skip
            axes.set(xlabel="off [% of the path]", title=f"drives {title}")
            axes.set_yticks(places, [str(a).replace(", ", "\n", 1) for a in about], fontsize="x-small")
            axes.invert_yaxis()
        handles = {**dict(zip(*_legend(panels[0]), strict=True)), **dict(zip(*_legend(panels[1]), strict=True))}
        figure.legend(list(handles.values()), list(handles), loc="outside lower center", ncols=5, fontsize="small")
    return figure


def _legend(axes: Any) -> tuple[list[str], list[Any]]:
    """Labels of a panel, and what they are of."""
    handles, labels = axes.get_legend_handles_labels()
    return labels, handles


def end_rows(ends: xr.Dataset) -> list[str]:
    """The table of drives beside the flow, as it stands on the page of the study."""
    rows = [f"| final position [% of the path] | {' | '.join(MODELS)} |", "|---" * (len(MODELS) + 1) + "|"]
    for n, about in enumerate(ends["about"].values):
        rows.append(f"| {about} | {' | '.join(f'{v:.2g}' for v in ends['final'].values[:, n])} |")
    means = [f"{v.mean():.2g} ({v.max():.2g})" for v in ends["final"].values]
    rows.append(f"| **mean (worst)** | {' | '.join(means)} |")
    off = [f"{one} {float(ends['load_error'].sel(loads=one)):.2f}" for one in ends["loads"].values]
    return [*rows, "", f"Load error on these drives: {', '.join(off)}"]


def across_rows(fine: xr.Dataset) -> list[str]:
    """Where drives straight across a current end, by the flow and by models: along, aside [m], yaw [deg]."""
    across = fine.sel(run=[name for name in fine["run"].values if name.startswith("across")])
    rows = [f"| {' | '.join(['drive', 'flow in the loop', *across['model'].values])} |"]
    rows.append("|---" * (across.sizes["model"] + 2) + "|")
    for name in across["run"].values:
        of = across.sel(run=name)
        ends = [of["flow_at_end"].values, *of["at_end"].values]
        rows.append(f"| {name} | {' | '.join('{:.2f}, {:.2f}; {:.1f}'.format(*end) for end in ends)} |")
    return rows


def held_rows(held: xr.Dataset) -> list[str]:
    """The table of each seed on the drives that it kept for validation."""
    rows = [f"| drives that a seed kept for validation | {' | '.join(held['model'].values)} |"]
    rows.append("|---" * (held.sizes["model"] + 1) + "|")
    for n, about in enumerate(held["run"].values):
        rows.append(f"| {about} | {' | '.join(f'{v:.2g}' for v in held['final'].values[n])} |")
    means = zip(held["final"].mean("run").values, held["final"].max("run").values, strict=True)
    rows.append(f"| **mean (worst)** | {' | '.join(f'{m:.2g} ({w:.2g})' for m, w in means)} |")
    return rows


def map_lines(share: xr.Dataset) -> str:
    """How much of a map lies outside the networks' range."""
    of, rows = hatched(share), []
    for name in ("depth_ratio", "flow"):
        each = [f"{100.0 * float(of.sel({name: v}).mean()):.0f} % at {v}" for v in share[name].values]
        rows.append(f"\nOutside the range, by {name}: {', '.join(each)}")
    soils = of.mean(["depth_ratio", "flow"]).to_series().sort_values()
    sunk = share["outside"].isnull()
    rows.append(
        f"\nAll waters and soils: {100.0 * float(of.mean()):.1f} % (runs that broke down: "
        f"{100.0 * float(sunk.mean()):.1f} %); worst: {soils.tail(4).to_dict()}"
    )
    return "\n".join(rows)


def main(
    quick: bool = False, jobs: int = 2, networks: Path | None = None, ask_map: bool = False, make_all: bool = False
) -> xr.Dataset:  # fmt: skip
    """Compare; return where drives end. With `quick` the first drive and a few waters of the map; writes nothing."""
    if quick:
        print(map_lines(known(jobs, quick)))
        return compared(judges()[:1])
    if networks is not None:
        ship(networks)
    if make_all:
        with ProcessPoolExecutor(jobs) as pool:
            list(pool.map(make_fine, fine_tasks()))
    there = [task for task in fine_tasks() if (FINE_RUNS / f"{task.name}.nc").exists()]
    ends, held, fine = compared(judges()), held_back(), compared(there, FINE_RUNS)
    save({
        "full_range.png": plot(ends, held), "full_range.nc": ends, "full_range_held_back.nc": held,
        "full_range_fine.nc": fine,
    })  # fmt: skip
    on_fine = [f"on cells of {1e3 * FINE:g} mm", *end_rows(fine), "", *across_rows(fine)]
    print("\n".join([*end_rows(ends), "", *held_rows(held), "", *on_fine]))
    if ask_map:
        save({"full_range_known.nc": (share := known(jobs, quick))})
        print(map_lines(share))
    return ends


if __name__ == "__main__":
    parser = study_parser(__doc__)
    parser.add_argument("--networks", type=Path, help="folder of `exumob train` with the networks to come with exumob")
    parser.add_argument("--map", action="store_true", dest="ask_map", help="ask how much of a map the networks know")
    parser.add_argument(
        "--fine", action="store_true", dest="make_all", help="make the drives on 18 mm that are missing"
    )
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    main(**vars(parser.parse_args()))
