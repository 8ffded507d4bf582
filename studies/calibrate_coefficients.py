"""Do a few fitted terms mend the coefficient model, and do they carry over to other vehicles?

The published coefficients know no bow wave, suction or trim. `exumob.water.wave_loads` gives these loads a form by
dimensional analysis, `exumob.learning.calibration` fits its coefficients to runs with the flow in the loop: of the
amphibious vehicle the nine lane changes of `data/cfd_mbd` and, as if of another vehicle, the drives over the whole
range of `data/full_range` that teach; and a lane change of each of three other vehicles (`data/cars`: D50/U0.5, speeds
and times by Froude's law, cells of 0.14 of the tyre's diameter). They are written to
`exumob/water/wave_loads.json`. Judges: each of the three other vehicles with coefficients that were fitted without it,
and the amphibious vehicle's four unseen runs, with these coefficients and with those fitted to its own runs alone.

Run: python studies/calibrate_coefficients.py                      (five minutes)
     python studies/calibrate_coefficients.py --anew [--jobs 2]    (makes the three runs of `data/cars` anew first, a
     quarter of an hour of one core each; it goes on where it was stopped)
     python studies/calibrate_coefficients.py --sets    (what the drives over the whole range bring; ten minutes)
     python studies/calibrate_coefficients.py --later   (judges them by drives of a car that were made after the fit:
     `data/cars/across` and `data/light_4x4`; two minutes)
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from common import (
    CAR_RUNS,
    CFD_RUNS,
    FULL_RANGE_RUNS,
    LIGHT_4X4_RUNS,
    full_range_plan,
    save,
    stored_plan,
    study_parser,
)  # fmt: skip
from matplotlib.figure import Figure

from exumob import Soil, simulate
from exumob.driving.maneuver import ConstantSteer, LaneChange, Maneuver
from exumob.flow import FlowSettings
from exumob.flow.cost import flow_cost
from exumob.flow.vehicle_window import vehicle_window
from exumob.learning.calibration import THINNING, Runs, fit_wave_coefficients
from exumob.learning.campaign import LearningFolder, run_campaign
from exumob.learning.compact import thinned
from exumob.learning.dataset import base_loads, body_states, check_geometry, load_run, load_runs, usable, water_of
from exumob.learning.evaluation import FAST, closed_loop
from exumob.learning.examples import training_runs
from exumob.learning.plan import FreeTask
from exumob.paper.reference_runs import SOIL, set_up_log, work_folder
from exumob.paper.scenarios import TRAINING, UNSEEN
from exumob.simulation.result_files import save_dataset
from exumob.simulation.settings import time_scale, usual_speed
from exumob.support.arrays import Array
from exumob.support.figures import STYLE
from exumob.vehicle.parameters import Vehicle
from exumob.water.calibrated import CalibratedHydrodynamics
from exumob.water.coefficients import CoefficientHydrodynamics
from exumob.water.conditions import Water
from exumob.water.hydrodynamics import Hydrodynamics
from exumob.water.wave_loads import FITTED, WaveCoefficients, terms_along, wave_loads_along
from vehicle_models.amphibious import amphibious_vehicle
from vehicle_models.large_4x4 import large_4x4
from vehicle_models.light_4x4 import light_4x4
from vehicle_models.small_car import small_car

OTHERS = {"light_4x4": light_4x4, "large_4x4": large_4x4, "small_car": small_car}
"""Vehicles beside the amphibious one."""
DEPTH, CURRENT = 0.5, 0.5
"""Depth over the tyre's diameter, and head current of the paper's vehicle [m/s], in their runs."""
CELLS = 0.14
"""Size of the cells in their runs over the tyre's diameter."""
WHOLE = "amphibious (whole range)"
"""Name of the amphibious vehicle in its drives over the whole range."""
DRIVES = ("drive",)
"""Kind of the runs over the whole range that teach."""
SETS = {
    "lane changes and cars": (), "the same and drives over the whole range": DRIVES,
    "the same and captive runs": (*DRIVES, "captive"),
}  # fmt: skip
"""What `--sets` compares: kinds of runs over the whole range."""
KEPT = 10
"""One millisecond of so many is kept of them: their times are twice those of the paper's vehicle."""
ACROSS = 0.7, 2.0
"""Depth over the tyre's diameter, and current from the right [m/s], of the drive in `data/cars/across`."""
LIGHT_4X4_PLAN = 2.0, 0.079
"""Budget [h] and width of the cells [m] with which the runs of `data/light_4x4` were planned."""
MODELS = ("coefficients", "calibrated", "without it", "own runs")
"""What is compared with the flow: published coefficients, and those fitted to the runs of all vehicles, to those of all
but the one that is judged, and to those of its own alone."""
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


def other_runs() -> dict[str, tuple[Vehicle, FreeTask, xr.Dataset]]:
    """Flow runs of the other vehicles, those of `data/cars`."""
    found = {}
    for name, make in OTHERS.items():
        vehicle = make()
        found[name] = vehicle, other_task(name, vehicle), load_run(CAR_RUNS / f"{name}.nc")
        check_geometry({name: found[name][2]}, vehicle)
    return found


def make_other_runs(jobs: int) -> None:
    """Make the flow runs of the other vehicles, and put them, thinned, into `data/cars`."""
    for name, make in OTHERS.items():
        vehicle = make()
        task, folder = other_task(name, vehicle), LearningFolder(work_folder() / "other_vehicles" / name)
        folder.claim(vehicle, task.cell_size)
        if failed := run_campaign([task], vehicle, folder, jobs=jobs):
            raise RuntimeError(f"{name}: {failed}")
        CAR_RUNS.mkdir(parents=True, exist_ok=True)
        save_dataset(thinned(folder.load(vehicle=vehicle)[task.name], every=KEPT), CAR_RUNS / f"{name}.nc")


def _relative(loads: Array, true: Array) -> float:
    """Root mean square error over the deviation."""
    return float(np.sqrt(np.mean((loads - true) ** 2)) / true.std())


def compared(
    run: xr.Dataset, vehicle: Vehicle, water: Water, maneuver: Maneuver, fitted: Mapping[str, WaveCoefficients],
    soil: str = SOIL,
) -> dict[str, dict[str, float]]:  # fmt: skip
    """Mean loads of the flow and of the models along a run, errors of their loads, and where their drives end."""
    rows = np.flatnonzero(usable(run))[::THINNING]
    late = run["time"].values[rows] >= LATE * time_scale(vehicle)
    true = run["water_wrench_smooth"].values[rows].astype(float)
    base = base_loads(run, vehicle)[rows]
    deviation = np.maximum(true.std(axis=0), 1e-9)
    terms = terms_along(vehicle, water.over(), water.density, body_states(run)[rows])
    loads = {"flow": true, "coefficients": base}
    loads |= {name: base + (terms * waves.by_body).sum(axis=-1) for name, waves in fitted.items()}
    models: dict[str, Hydrodynamics] = {"coefficients": CoefficientHydrodynamics()}
    models |= {name: CalibratedHydrodynamics(waves=waves) for name, waves in fitted.items()}
    found = {}
    for name, one in loads.items():
        found[name] = {
            "drag": -float(one[late, :, 0].sum(axis=1).mean()), "lift": float(one[late, 0, 2].mean()),
            "trim": float(one[late, 0, 4].mean()), "side": float(one[late, :, 1].sum(axis=1).mean()),
            "hull_error": float((np.sqrt(np.mean((one - true) ** 2, axis=0)) / deviation)[0].mean()),
            "axle_error": _relative(one[:, 1:3, 1].sum(axis=1), true[:, 1:3, 1].sum(axis=1)),
        }  # fmt: skip
        if name in models:
            found[name]["final"] = _end(vehicle, soil, water, maneuver, models[name], run)
    return found


def later_runs() -> dict[str, tuple[FreeTask, xr.Dataset]]:
    """Drives of `light_4x4` with the flow in the loop that were made after the fit, and what was asked of them."""
    vehicle = light_4x4()
    water = Water.at_ratio(
        ACROSS[0], ACROSS[1], current_direction=0.5 * math.pi, tyre_diameter=vehicle.wheel.diameter
    )  # fmt: skip
    straight = ConstantSteer(speed=usual_speed(vehicle) / vehicle.wheel.radius, ramp_time=time_scale(vehicle))
    plan = stored_plan(vehicle, LIGHT_4X4_RUNS, *LIGHT_4X4_PLAN)
    across = FreeTask("straight across", "apart", water, straight, 10.0, plan.cell_size, plan.tasks[0].cost)
    planned = {task.name: task for task in plan.tasks if isinstance(task, FreeTask)}
    files = {path.stem: path for path in sorted((LIGHT_4X4_RUNS / "runs").glob("*.nc"))}
    return {"straight across": (across, load_run(CAR_RUNS / "across" / "light_4x4.nc"))} | {
        name: (planned[name], load_run(path)) for name, path in files.items() if name in planned
    }


def later() -> xr.Dataset:
    """Loads and ends of those drives by the flow, the published and the calibrated coefficients."""
    vehicle, models = light_4x4(), {"calibrated": WaveCoefficients.load(FITTED)}
    runs = later_runs()
    check_geometry({name: run for name, (_, run) in runs.items()}, vehicle)
    found = {
        name: compared(run, vehicle, task.water, task.maneuver, models, task.soil)
        for name, (task, run) in runs.items()
    }  # fmt: skip
    result = table(found).drop_sel(model=["without it", "own runs"])
    tasks = [task for task, _ in runs.values()]
    angles = [math.remainder(180.0 - math.degrees(task.water.current_direction), 360.0) for task in tasks]
    result = result.assign(
        depth_ratio=("run", [task.water.depth / vehicle.wheel.diameter for task in tasks], {"units": "1"}),
        current=("run", [task.water.current_speed for task in tasks], {"units": "m s-1"}),
        origin=(
            "run",
            angles,
            {"units": "degree", "long_name": "whence the current comes, from ahead on to the right"},
        ),
    )
    save({"calibrated_later.nc": result})
    return result


def later_lines(found: xr.Dataset) -> str:
    """Those drives as they stand on the page of the study."""
    models = [str(name) for name in found["model"].values]
    rows = [f"| depth, current, from | {' | '.join(models)} |", "|---" * (1 + len(models)) + "|"]
    for name in found["run"].values:
        one = found.sel(run=name)
        cells = []
        for model in models:
            drag, side, final = (float(one[kind].sel(model=model)) for kind in ("drag", "side", "final"))
            end = "" if math.isnan(final) else f", {float(f'{final:.2g}'):g} %"
            cells.append(f"{round(drag)} N, {round(side)} N{end}")
        current = (
            f"{float(one['current']):.3g} m/s, {_whence(float(one['origin']))}" if one["current"] > 0.0 else "still"
        )
        rows.append(f"| {100.0 * float(one['depth_ratio']):.0f} %, {current} | {' | '.join(cells)} |")
    return "\n".join(rows)


def _whence(angle: float) -> str:
    """Whence a current comes: an angle from ahead on to the right [deg]."""
    if abs(angle) < 1.0 or abs(angle) > 179.0:
        return "ahead" if abs(angle) < 1.0 else "behind"
    side = "right" if angle > 0.0 else "left"
    return side if abs(abs(angle) - 90.0) < 1.0 else f"{abs(angle):.0f} deg {side} of ahead"


def table(found: Mapping[str, Mapping[str, Mapping[str, float]]]) -> xr.Dataset:
    """All figures, by run and model."""
    models = ("flow", *MODELS)
    units = {"drag": "N", "lift": "N", "trim": "N m", "side": "N", "hull_error": "1", "axle_error": "1", "final": "%"}
    return xr.Dataset(
        {
            name: (
                ("run", "model"),
                [[row.get(model, {}).get(name, np.nan) for model in models] for row in found.values()],
                {"units": unit},
            )
            for name, unit in units.items()
        },
        {"run": list(found), "model": list(models)},
    )  # fmt: skip


def lines(found: xr.Dataset) -> str:
    """The tables as they stand on the page of the study."""
    loads = ["| run | drag [N] | lift of the hull [N] | trim moment of the hull [N m] |", "|---" * 4 + "|"]
    errors = ["| run | loads of the hull | side force, front axle | final position [%] |", "|---" * 4 + "|"]

    def row(run: str, names: Sequence[str], models: Sequence[str], digits: int) -> str:
        one = found.sel(run=run)
        cells = (
            "; ".join(
                f"{float(f'{v:.{digits}g}'):,g}".replace("nan", "-") for v in one[name].sel(model=list(models)).values
            )
            for name in names
        )
        return f"| {run} | {' | '.join(cells)} |"

    for run in found["run"].values:
        loads.append(row(run, ("drag", "lift", "trim"), ("flow", *MODELS), 3))
        errors.append(row(run, (*ERRORS, "final"), MODELS, 2))
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
                axes.bar(places + 0.2 * (n - 1.5), values, 0.19, color=f"C{n}", label=model)
        labels = ("drag, over the flow's [-]", "hull's lift, over the flow's [-]", "final position off [%]")
        for axes, label in zip(panels, labels, strict=True):
            axes.set_xticks(places, [str(run) for run in found["run"].values], rotation=40, ha="right")
            axes.set(ylabel=label)
        for axes in panels[:2]:
            axes.axhline(1.0, color="0.4", lw=0.8)
        figure.legend(*panels[0].get_legend_handles_labels(), loc="outside upper center", ncols=4)
    return figure


def side_error(waves: WaveCoefficients | None) -> float:
    """Error of the wheels' side force in the drives over the whole range that teach, over its size [-]."""
    vehicle, found = amphibious_vehicle(), []
    for run in whole_range(DRIVES).values():
        water, rows = water_of(run), np.flatnonzero(usable(run))[::THINNING]
        loads = base_loads(run, vehicle)[rows]
        if waves is not None:
            loads = loads + wave_loads_along(vehicle, water.over(), water.density, body_states(run)[rows], waves)
        true = run["water_wrench_smooth"].values[rows].astype(float)
        found.append([np.mean((loads - true)[:, 1:, 1].sum(axis=1) ** 2), np.mean(true[:, 1:, 1].sum(axis=1) ** 2)])
    off, size = np.mean(found, axis=0)
    return float(np.sqrt(off / size))


def whole_range(kinds: Sequence[str]) -> dict[str, xr.Dataset]:
    """The runs over the whole range that teach, of some kinds."""
    return {
        name: run for name, run in training_runs(FULL_RANGE_RUNS / "runs").items() if name.startswith(tuple(kinds))
    }  # fmt: skip


def compare_sets() -> str:
    """What the runs over the whole range bring: where drives end [%] with coefficients fitted without and with them."""
    vehicle, others = amphibious_vehicle(), other_runs()
    lanes = load_runs(CFD_RUNS / f"{scenario.file_stem}.nc" for scenario in TRAINING)
    cars = {name: (other, {task.name: run}) for name, (other, task, run) in others.items()}
    unseen = load_runs(CFD_RUNS / f"{scenario.file_stem}.nc" for scenario in UNSEEN)
    apart = [task for task in full_range_plan().tasks if isinstance(task, FreeTask) and task.role == "apart"]
    drives = load_runs(FULL_RANGE_RUNS / "runs" / f"{task.name}.nc" for task in apart)
    rows = [
        "| fitted to | unseen runs | cars, each without it | drives kept apart | side force of wheels |",
        "|---" * 5 + "|",
    ]
    for text, kinds in SETS.items():
        amphibious: list[Runs] = [(vehicle, lanes)]
        if kinds:
            amphibious.append((replace(vehicle, name=WHOLE), whole_range(kinds)))
        fitted = fit_wave_coefficients([*amphibious, *cars.values()])
        model = CalibratedHydrodynamics(waves=fitted)
        of_unseen = [
            _end(vehicle, SOIL, s.water(vehicle), s.maneuver(), model, unseen[s.name]) for s in UNSEEN
        ]  # fmt: skip
        of_drives = [_end(vehicle, t.soil, t.water, t.maneuver, model, drives[t.name]) for t in apart]
        of_cars = []
        for name, (other, task, run) in others.items():
            without = fit_wave_coefficients([*amphibious, *(group for key, group in cars.items() if key != name)])
            of_cars.append(
                _end(other, SOIL, task.water, task.maneuver, CalibratedHydrodynamics(waves=without), run)
            )  # fmt: skip
        cells = [f"{np.mean(ends):.1f} ({np.max(ends):.1f}) %" for ends in (of_unseen, of_cars, of_drives)]
        rows.append(f"| {text} | {' | '.join(cells)} | {side_error(fitted):.2f} |")
        print(rows[-1], flush=True)
    return "\n".join([*rows, f"Side force of wheels with the published coefficients: {side_error(None):.2f}"])


def _end(
    vehicle: Vehicle, soil: str, water: Water, maneuver: Maneuver, model: Hydrodynamics, run: xr.Dataset
) -> float:  # fmt: skip
    """Distance between the ends of a drive with a model and of a run with the flow, over the path [%]."""
    drive = simulate(
        vehicle, Soil.published(soil), water, maneuver, model, duration=float(round(run["time"].values[-1], 3)),
        record_step=10e-3, **FAST,
    )  # fmt: skip
    return closed_loop(drive, run)["final"]


def main(quick: bool = False, jobs: int = 2, anew: bool = False) -> xr.Dataset:
    """Fit, write the coefficients, compare; with `quick` three runs are fitted, one judged, and nothing is written."""
    vehicle = amphibious_vehicle()
    taught = TRAINING[::4] if quick else TRAINING
    runs = load_runs(CFD_RUNS / f"{scenario.file_stem}.nc" for scenario in taught)
    groups: dict[str, Runs] = {vehicle.name: (vehicle, runs)}
    if anew and not quick:
        make_other_runs(jobs)
    if not quick:
        groups[WHOLE] = replace(vehicle, name=WHOLE), whole_range(DRIVES)
    others = {} if quick else other_runs()
    groups |= {name: (other, {task.name: run}) for name, (other, task, run) in others.items()}
    fitted = fit_wave_coefficients(list(groups.values()))
    own = fit_wave_coefficients([groups[vehicle.name]], fitted)
    models = {"calibrated": fitted, "own runs": own}
    if others:
        models["without it"] = fit_wave_coefficients([groups[name] for name in others])
    found = {}
    for scenario in UNSEEN[:1] if quick else UNSEEN:
        run = load_runs([CFD_RUNS / f"{scenario.file_stem}.nc"])[scenario.name]
        found[scenario.name] = compared(run, vehicle, scenario.water(vehicle), scenario.maneuver(), models)
    if quick:
        return table(found)
    replace(fitted, about={"command": "python studies/calibrate_coefficients.py"} | fitted.about).save(FITTED)
    for name, (other, task, run) in others.items():
        assert isinstance(task.maneuver, LaneChange)
        without = fit_wave_coefficients([group for key, group in groups.items() if key != name])
        models = {"calibrated": fitted, "without it": without}
        found[name.replace("_", " ")] = compared(run, other, task.water, task.maneuver, models)
    result = table(found)
    save({"calibrated.png": plot(result), "calibrate_coefficients.nc": result})
    return result


if __name__ == "__main__":
    parser = study_parser(__doc__)
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    parser.add_argument("--anew", action="store_true", help="make the flow runs of the cars anew first")
    parser.add_argument("--sets", action="store_true", help="compare what the runs over the whole range bring")
    parser.add_argument("--later", action="store_true", help="judge what was fitted by drives that were made later")
    set_up_log()
    given = vars(parser.parse_args())
    asked = {name: given.pop(name) for name in ("sets", "later")}
    if asked["later"]:
        print(later_lines(later()))
    else:
        print(compare_sets() if asked["sets"] else lines(main(**given)))
