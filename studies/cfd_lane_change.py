"""What does water do to a lane change, with the flow in the loop? (paper, Sec. 4, Figs. 5 to 9)

No water is compared with D60/U0, D60/U1, D40/U0 and D40/U1, and each of the paper's observations with these runs. The
uncertainty of D60/U1 is seen on coarser and finer cells, in a window twice as wide, with the hull on faces of the grid,
mirrored, with macro steps of 1 ms, and beside the coefficient model. Runs of the data set are read; the others are
computed as in `generate_training_data.py`.

Run: python studies/cfd_lane_change.py --present               (a minute, with the runs that there are)
     python studies/cfd_lane_change.py [--jobs 2]              (half an hour and more for each run that is missing)
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from common import CFD_RUNS, save, study_parser
from matplotlib.figure import Figure

from exumob import Soil, lane_change, simulate
from exumob.learning.compact import DRIVEN, thinned
from exumob.learning.dataset import load_run, pack
from exumob.paper.reference_runs import SOIL, FlowRun, compute_all, set_up_log, work_folder
from exumob.paper.scenarios import TRAINING, UNSEEN, Scenario
from exumob.simulation.plotting import plot_lateral_velocity, plot_path, plot_yaw
from exumob.simulation.result_files import load_dataset, save_dataset
from exumob.support.figures import STYLE
from exumob.support.smoothing import smoothed
from exumob.verification.uncertainty import grid_convergence
from vehicle_models.amphibious import amphibious_vehicle

WORST = FlowRun(Scenario.named("D60/U1"))
RUNS = {name: FlowRun(Scenario.named(name)) for name in ("D60/U0", "D60/U1", "D40/U0", "D40/U1")}
VARIANTS = {
    "22 mm cells": dataclasses.replace(WORST, cell_size=0.022),
    "15 mm cells": dataclasses.replace(WORST, cell_size=0.015),
    "window doubled": dataclasses.replace(WORST, doubled=True),
    "hull on faces": dataclasses.replace(WORST, hull_on_faces=True),
    "mirrored": dataclasses.replace(WORST, scenario=Scenario.named("D60/U1/-30deg")),
    "macro step 1 ms": dataclasses.replace(WORST, macro_step=1e-3),
}
"""Variants of D60/U1: their differences show the uncertainty of the run."""
GRIDS = ("15 mm cells", "D60/U1", "22 mm cells")
"""D60/U1 on three grids."""
COLORS = {"no water": "0.4", "D60/U0": "C0", "D60/U1": "C3", "D40/U0": "C2", "D40/U1": "C1"}
LOAD_WINDOW = 0.1
"""Length of the moving average of the loads in figures and claims [s]."""
TURN = slice(2.0, 5.5)
"""Time in which the wheels are steered [s]."""


def simple_runs() -> dict[str, xr.Dataset]:
    """Runs without the flow in the loop: no water, and D60/U1 with the coefficient model."""
    vehicle, soil = amphibious_vehicle(), Soil.published(SOIL)
    return {
        "no water": simulate(vehicle, soil, None, lane_change(), setting="fine", record_step=1e-3),
        "D60/U1, coefficients": simulate(
            vehicle,
            soil,
            WORST.scenario.water(vehicle),
            WORST.scenario.maneuver(),
            "coefficients",
            setting="fine",
            record_step=1e-3,
        ),
    }


def packed_file(run: FlowRun) -> Path:
    """File of a packed run in the data set; the variants have a folder of their own."""
    of_data_set = run.scenario in TRAINING + UNSEEN and run == FlowRun(run.scenario)
    return CFD_RUNS / f"{run.scenario.file_stem}.nc" if of_data_set else CFD_RUNS / "variants" / f"{run.name}.nc"


def flow_runs(runs: Mapping[str, FlowRun], jobs: int, present_only: bool) -> dict[str, xr.Dataset]:
    """Results by name: those that there are, and, unless `present_only`, the others, which are computed."""
    work = work_folder()
    found = {}
    for name, run in runs.items():
        whole, packed = work / f"{run.name}.nc", packed_file(run)
        if whole.exists():
            found[name] = load_dataset(whole)
            if not packed.exists():
                packed.parent.mkdir(parents=True, exist_ok=True)
                kept = None if packed.parent == CFD_RUNS else DRIVEN
                save_dataset(thinned(pack(found[name]), kept), packed)
        elif packed.exists():
            found[name] = load_run(packed)
    missing = {run: name for name, run in runs.items() if name not in found}
    if missing and not present_only:
        for run, result in compute_all(list(missing), amphibious_vehicle(), work, jobs):
            if isinstance(result, xr.Dataset):
                found[missing[run]] = result
    return {name: found[name] for name in runs if name in found}


# -- figures -----------------------------------------------------------------------------------------------------------


def trajectories(runs: Mapping[str, xr.Dataset]) -> Figure:
    """Draw the paths (paper Fig. 6)."""
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(figsize=(9.0, 3.4), layout="constrained")
        for name, run in runs.items():
            style = {"color": COLORS[name], "label": name}
            plot_path(axes, run, every=2.0 if name in ("D60/U0", "D60/U1") else 0.0, **style)
        figure.legend(loc="outside upper center", ncols=len(runs))
    return figure


def hull_loads(runs: Mapping[str, xr.Dataset]) -> Figure:
    """Draw force and moment of the water on the hull in body axes (paper Fig. 7)."""
    with plt.rc_context(STYLE):
        figure, panels = plt.subplots(2, 3, figsize=(11.0, 5.4), sharex=True, layout="constrained")
        for name, run in runs.items():
            if name == "no water":
                continue
            wrench = smoothed(run["water_wrench"].sel(body="hull").values, 1e-3, LOAD_WINDOW)
            for k, axes in enumerate(panels.flat):
                axes.plot(run["time"], wrench[:, k], color=COLORS[name], lw=1.1, label=name)
        for axes, component in zip(panels.flat, ("F_x", "F_y", "F_z", "M_x", "M_y", "M_z"), strict=True):
            axes.set(ylabel=f"${component}$ [{'N' if component[0] == 'F' else 'N m'}]")
        for axes in panels[1]:
            axes.set(xlabel="time [s]")
        figure.legend(*panels[0, 0].get_legend_handles_labels(), loc="outside upper center", ncols=len(runs))
    return figure


def motions(runs: Mapping[str, xr.Dataset]) -> Figure:
    """Draw lateral velocity and yaw (paper Fig. 8)."""
    with plt.rc_context(STYLE):
        figure, (left, right) = plt.subplots(1, 2, figsize=(11.0, 3.6), layout="constrained")
        for name, run in runs.items():
            plot_lateral_velocity(left, run, color=COLORS[name], lw=1.2, label=name)
            plot_yaw(right, run, color=COLORS[name], lw=1.4)
        left.legend(fontsize="small")
    return figure


def uncertainty(runs: Mapping[str, xr.Dataset], coefficients: xr.Dataset) -> Figure:
    """Draw path and yaw of D60/U1 and its variants; the mirrored run is mirrored back."""
    with plt.rc_context(STYLE):
        figure, (left, right) = plt.subplots(
            1, 2, figsize=(11.0, 3.6), layout="constrained", gridspec_kw={"width_ratios": [1.6, 1.0]}
        )
        for k, (name, run) in enumerate({**runs, "coefficient model": coefficients}.items()):
            sign = -1.0 if name == "mirrored" else 1.0
            line = "--" if name == "coefficient model" else "-"
            style = {"color": f"C{k}", "label": name, "lw": 1.8 if k == 0 else 1.1, "ls": line}
            x, y = run["position"].sel(body="hull").values[:, :2].T
            left.plot(x, sign * y, **style)
            right.plot(run["time"], sign * np.degrees(run["yaw"].sel(body="hull")), **style)
        left.set(xlabel="x [m]", ylabel="y [m]")
        right.set(xlabel="time [s]", ylabel="yaw [deg]")
        left.legend(fontsize="small")
    return figure


def surfaces(runs: Mapping[str, xr.Dataset]) -> Figure:
    """Draw the free surface every 2 s (paper Fig. 9)."""
    from exumob.flow.output.pictures import plot_surfaces

    figure = plt.figure(figsize=(11.0, 3.3 * len(runs)), layout="constrained")
    rows = np.atleast_1d(figure.subfigures(len(runs), 1))
    for row, (name, run) in zip(rows, runs.items(), strict=True):
        row.suptitle(name)
        plot_surfaces(row, run, times=(2.0, 4.0, 6.0, 8.0), columns=4)
    return figure


# -- numbers -----------------------------------------------------------------------------------------------------------


def measures(run: xr.Dataset) -> dict[str, float]:
    """Measure the quantities that the paper's observations are about.

    Returns
    -------
    dict
        ``forward``, ``lateral``: displacement [m]; ``straight``: distance until the wheels are steered [m]; ``yaw`` at
        the end [deg]; ``yaw_late``: largest size of the yaw after 5.5 s [deg]; ``lateral_late``: largest lateral speed
        in the last second [m/s]; ``Fx``, ``Fz``: mean force of the water on the hull from 1 s on [N]; ``Fy``, ``Mz``:
        root mean square while the wheels are steered [N, N m]; ``Mx``, ``My``: standard deviation then [N m].
    """
    hull = run.sel(body="hull")
    place, time = hull["position"].values, run["time"]
    yaw = np.degrees(hull["yaw"])
    found = {
        "forward": float(place[-1, 0] - place[0, 0]),
        "lateral": float(place[-1, 1] - place[0, 1]),
        "straight": float(hull["position"].sel(axis="x").sel(time=2.0, method="nearest") - place[0, 0]),
        "yaw": float(yaw[-1]),
        "yaw_late": float(np.abs(yaw.sel(time=slice(5.5, None))).max()),
        "lateral_late": float(np.abs(run["lateral_velocity"].sel(time=slice(float(time[-1]) - 1.0, None))).max()),
    }
    wrench = hull["water_wrench"].copy(data=smoothed(hull["water_wrench"].values, 1e-3, LOAD_WINDOW))
    turn = wrench.sel(time=TURN)
    for component in ("Fx", "Fz"):
        found[component] = float(wrench.sel(component=component, time=slice(1.0, None)).mean())
    for component in ("Fy", "Mz"):
        found[component] = float(np.sqrt((turn.sel(component=component) ** 2).mean()))
    for component in ("Mx", "My"):
        found[component] = float(turn.sel(component=component).std())
    return found


def table(runs: Mapping[str, xr.Dataset]) -> xr.Dataset:
    """Measures of every run, with the effort of those with the flow in the loop."""
    rows = {name: measures(run) for name, run in runs.items()}
    for name, run in runs.items():
        rows[name]["hours"] = (run.attrs["wall_time"] + run.attrs["settling_wall_time"]) / 3600.0
        advances = run.get("coupling_iterations", run.attrs.get("coupling_iterations_mean", np.nan))
        rows[name]["advances"] = float(np.mean(advances))
        late = run["slip_ratio"].sel(time=slice(0.5 * float(run["time"][-1]), None))
        rows[name]["slip"] = float(late.mean())
    names = list(next(iter(rows.values())))
    return xr.Dataset({n: ("run", [row[n] for row in rows.values()]) for n in names}, coords={"run": list(rows)})


DRY, CALM, HEAD, LOW = "no water", "D60/U0", "D60/U1", "D40/U1"
CLAIMS = (
    # claim; measure, unit; run, run that it is compared with; condition under which it holds
    ("calm water: shorter path than on dry ground", "forward", "m", CALM, DRY, lambda a, b: a < b),
    ("calm water: smaller lateral displacement", "lateral", "m", CALM, DRY, lambda a, b: a < b),
    ("calm water: the maneuver succeeds, yaw returns to 3 deg", "yaw", "deg", CALM, DRY, lambda a, b: abs(a) < 3.0),
    ("head current: first straight much shorter (20 %)", "straight", "m", HEAD, CALM, lambda a, b: a < 0.8 * b),
    ("head current: more resistance (20 %)", "Fx", "N", HEAD, CALM, lambda a, b: a < 1.2 * b),
    ("head current: larger lateral force, rms (20 %)", "Fy", "N", HEAD, CALM, lambda a, b: a > 1.2 * b),
    ("head current: larger yaw moment, rms (20 %)", "Mz", "N m", HEAD, CALM, lambda a, b: a > 1.2 * b),
    ("head current: roll moment varies more (20 %)", "Mx", "N m", HEAD, CALM, lambda a, b: a > 1.2 * b),
    ("head current: pitch moment varies more (20 %)", "My", "N m", HEAD, CALM, lambda a, b: a > 1.2 * b),
    ("head current: yaw stays beyond 3 deg", "yaw", "deg", HEAD, CALM, lambda a, b: abs(a) > 3.0),
    ("head current: lateral speed remains (twice)", "lateral_late", "m/s", HEAD, CALM, lambda a, b: a > 2.0 * b),
    ("40 % depth: much less buoyancy (half)", "Fz", "N", LOW, HEAD, lambda a, b: a < 0.5 * b),
    ("40 % depth: much less yaw left (half)", "yaw", "deg", LOW, HEAD, lambda a, b: abs(a) < 0.5 * abs(b)),
)  # fmt: skip
"""The paper's observations (Sec. 4) as numbers; the thresholds in them were chosen by us, the paper gives none."""


def claims(found: xr.Dataset) -> list[tuple[str, str, bool]]:
    """Claims of the paper, the numbers found, and whether each holds, as far as the runs are there."""
    answers = []
    for text, name, unit, one, other, holds in CLAIMS:
        if {one, other} <= set(found["run"].values):
            a, b = (float(found[name].sel(run=run)) for run in (one, other))
            answers.append((text, f"{a:.3g} {unit} ({one}), {b:.3g} ({other})", bool(holds(a, b))))
    return answers


def grids(found: xr.Dataset) -> list[str]:
    """Lines of a table: measures of D60/U1 on three grids, observed order and index of the finest grid."""
    if not set(GRIDS) <= set(found["run"].values):
        return []
    sizes = [{"D60/U1": WORST, **VARIANTS}[name].cell_size for name in GRIDS]
    lines = ["| D60/U1 | " + " | ".join(f"{1e3 * h:g} mm" for h in sizes) + " | order | index of the finest |"]
    lines.append("|---" * 6 + "|")
    for name, unit in (("forward", "m"), ("lateral", "m"), ("Fx", "N"), ("Fz", "N")):
        values = [float(found[name].sel(run=run)) for run in GRIDS]
        how = grid_convergence(sizes, values)
        cells = " | ".join(f"{value:.4g}" for value in values)
        share = 100.0 * how.gci / abs(values[0])
        lines.append(
            f"| {name} [{unit}] | {cells} | {how.order:.2g} ({how.kind}) | {how.gci:.2g} {unit} ({share:.0f} %) |"
        )
    return lines


def main(quick: bool = False, jobs: int = 2, present_only: bool = False) -> xr.Dataset:
    """Make or load the runs, draw the figures; return the table (see `measures`)."""
    if quick:
        vehicle, soil = amphibious_vehicle(), Soil.published(SOIL)
        steps = {"micro_step": 5e-4, "macro_step": 20e-3, "record_step": 1e-3}
        water = {"no water": None, "D60/U0": 0.0, "D60/U1": 1.0}
        runs = {
            name: simulate(
                vehicle, soil, None if speed is None else Scenario(0.6, speed).water(vehicle), lane_change(),
                "coefficients", **steps
            )
            for name, speed in water.items()
        }  # fmt: skip
        for draw in (trajectories, hull_loads, motions):
            plt.close(draw(runs))
        return table(runs)
    simple = simple_runs()
    flows = flow_runs({**RUNS, **VARIANTS}, jobs, present_only)
    runs = {"no water": simple["no water"], **{name: flows[name] for name in RUNS if name in flows}}
    worst = {name: flows[name] for name in ("D60/U1", *VARIANTS) if name in flows}
    outputs: dict[str, Figure | xr.Dataset] = {
        "cfd_trajectories.png": trajectories(runs),
        "cfd_hull_loads.png": hull_loads(runs),
        "cfd_motions.png": motions(runs),
    }
    wet = {name: run for name, run in runs.items() if name in ("D60/U0", "D60/U1", "D40/U1")}
    if wet and all("hydrodynamics_snapshot_quaternion" in run for run in wet.values()):  # packed runs have none
        outputs["cfd_surfaces.png"] = surfaces(wet)
    if "D60/U1" in worst:
        outputs["cfd_uncertainty.png"] = uncertainty(worst, simple["D60/U1, coefficients"])
    result = table({**runs, **worst, "D60/U1, coefficients": simple["D60/U1, coefficients"]})
    save(outputs | {"cfd_lane_change.nc": result})
    return result


if __name__ == "__main__":
    parser = study_parser(__doc__)
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    parser.add_argument("--present", dest="present_only", action="store_true", help="do not compute what is missing")
    set_up_log()
    answer = main(**vars(parser.parse_args()))
    print(answer.to_pandas().round(3).T.to_string())
    print("\n".join(grids(answer)))
    for text, numbers, holds in claims(answer):
        print(f"| {text} | {numbers} | {'yes' if holds else '**no**'} |")
