"""From which runs do networks learn most per second of flow: lane changes, other drives, multisines or steps?

Sets of three and six runs of 8 s each on 28 mm cells teach the same networks, in the paper's range (40 to 60 % depth,
head currents of 0 to 1 m/s): lane changes from rest (free runs, of the paper's nine scenarios), and captive runs within
the envelope of cheap drives: multisines about one speed, steps of the speed alone (three of each), and both at once; a
half of lane changes and a half of both; drives as `exumob learn` plans them (steering by multisines, three soils), and
two thirds of them with one third of captive runs. All are judged on the paper's four unseen lane changes and on two
more captive runs, on the same cells, and by where drives with the networks end.

Run: python studies/excitation.py [--jobs 2] [--folder runs/excitation]     (30 runs, an hour and a quarter on two
     cores; it goes on where it was stopped)
"""

from __future__ import annotations

import dataclasses
import math
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from common import save, study_parser
from matplotlib.figure import Figure

from exumob.learning.campaign import LearningFolder, RunProgress, run_campaign
from exumob.learning.dataset import base_loads
from exumob.learning.envelope import keep_envelope, stored_envelope
from exumob.learning.evaluation import FAST, closed_loop, drive, open_loop
from exumob.learning.plan import CaptiveTask, FreeTask, LearningRange, Task, make_plan
from exumob.learning.presets import LANE_CHANGES, PRESETS, Preset
from exumob.learning.training import train
from exumob.paper.scenarios import TRAINING, UNSEEN, Scenario
from exumob.support.figures import STYLE
from exumob.surrogates.model import SurrogateHydrodynamics
from exumob.surrogates.networks import NetworkSet
from exumob.towing_tank.excitation import CHANNELS
from exumob.vehicle.parameters import Vehicle
from exumob.water.calibrated import CalibratedHydrodynamics
from exumob.water.coefficients import CoefficientHydrodynamics
from exumob.water.hydrodynamics import Hydrodynamics
from vehicle_models.amphibious import amphibious_vehicle

WANTED = LearningRange((0.4, 0.6), (0.0, 1.0), "ahead")
"""The range of the paper's scenarios."""
CELL_SIZE = 0.028
"""A run takes two to four minutes on one core [m]."""
DURATION = 8.0
"""Of each run [s]."""
COUNTS = (3, 6)
"""Runs of a set."""
MOST = {"multisines": 3, "steps": 3}
"""Largest number of runs of these sets; the others have all of `COUNTS`."""
MIXED = {"half and half": ("lane changes", 0.5), "drives and captive runs": ("drives", 2.0 / 3.0)}
"""Sets that captive runs complete: what else is in them, and its share."""
ORDER = ("D60/U1", "D40/U0", "D50/U0", "D40/U1", "D60/U0", "D45/U0.75", "D55/U0.25", "D40/U0.5", "D55/U0.75")
"""The nine lane changes, the first ones at the corners of the range."""
SETS = (
    "lane changes", "multisines", "steps", "multisines and steps", "half and half", "drives", "drives and captive runs",
)  # fmt: skip
UNITS = {"load_error": "1", "captive_load_error": "1", "final_mean": "%", "final_worst": "%", "fitted_final": "%"}
"""What is compared."""
APART = 2
"""Captive runs that judge."""
QUIET = 1e-6
"""Rates of the multisines of a run that has none: they vanish [units of the channels a second]."""


def lane_change(scenario: Scenario, vehicle: Vehicle, cell_size: float, duration: float, like: Task) -> FreeTask:
    """A lane change with the flow in the loop."""
    return FreeTask(
        f"lane_change_{scenario.file_stem}", "apart", scenario.water(vehicle), scenario.maneuver(), duration, cell_size,
        like.cost,
    )  # fmt: skip


def captive(task: CaptiveTask, kind: str) -> CaptiveTask:
    """A planned run as it is, or with its multisines or its steps alone."""
    motion = task.motion
    if kind == "multisines":  # about the fastest of its speeds
        fastest = max(motion.speeds, key=abs)
        motion = dataclasses.replace(motion, speeds=(fastest,))
    elif kind == "steps":
        motion = dataclasses.replace(
            motion, envelope=dataclasses.replace(motion.envelope, rates=(QUIET,) * len(CHANNELS))
        )  # fmt: skip
    return dataclasses.replace(task, name=f"{kind.replace(' ', '_')}_{task.name[:11]}", motion=motion)


def tasks_of(
    vehicle: Vehicle, folder: Path, cell_size: float, duration: float, count: int, unseen: Sequence[Scenario]
) -> tuple[dict[str, list[Task]], list[Task]]:
    """Runs that teach, by kind, and those that judge."""
    envelope = stored_envelope(vehicle, WANTED, folder)
    keep_envelope(envelope, vehicle, WANTED, folder)
    plan = make_plan(vehicle, WANTED, None, cell_size, envelope, run_time=duration)
    planned = [task for task in plan.tasks if isinstance(task, CaptiveTask)]
    teachers = [task for task in planned if task.role == "teach"][:count]
    judges: list[Task] = [captive(task, "apart") for task in planned if task.role == "apart"][:APART]
    judges += [lane_change(scenario, vehicle, cell_size, duration, planned[0]) for scenario in unseen]
    kinds: dict[str, list[Task]] = {
        "lane changes": [
            lane_change(Scenario.named(name), vehicle, cell_size, duration, planned[0]) for name in ORDER[:count]
        ],
    }
    for kind in SETS[1:4]:
        kinds[kind] = [captive(task, kind) for task in teachers]
    drives = [task for task in plan.tasks if isinstance(task, FreeTask) and task.role == "teach"]
    drives.sort(key=lambda task: task.name)  # by number: a plan takes them in another order
    kinds["drives"] = [dataclasses.replace(task, name=task.name[:9]) for task in drives[:count]]
    return kinds, judges


def chosen(kinds: Mapping[str, Sequence[Task]], name: str, count: int) -> list[Task]:
    """The runs of a set."""
    if name not in MIXED:
        return list(kinds[name][:count])
    drives, share = MIXED[name]
    first = math.ceil(share * count)
    return [*kinds[drives][:first], *kinds["multisines and steps"][: count - first]]


def final_errors(
    model: Hydrodynamics, runs: Mapping[str, xr.Dataset], judges: Sequence[Task], vehicle: Vehicle
) -> list[float]:
    """Where lane changes kept apart end with a model [% of the path]."""
    found = []
    for task in judges:
        if isinstance(task, FreeTask):
            scenario = Scenario.named(task.name.removeprefix("lane_change_").replace("_", "/"))
            run = drive(scenario, model, vehicle, FAST | {"duration": task.duration})
            found.append(closed_loop(run, runs[task.name])["final"])
    return found


def judged(
    members: Sequence[NetworkSet], runs: Mapping[str, xr.Dataset], judges: Sequence[Task], vehicle: Vehicle,
    base: Mapping[str, np.ndarray],
) -> dict[str, float]:  # fmt: skip
    """Errors of networks on the runs kept apart: of the loads by kind of run [-], and of the final positions [%].

    The last are also those of drives with the coefficients alone that the networks rest on, fitted to the same runs.
    """
    loads: dict[str, list[float]] = {"lane changes": [], "captive runs": []}
    for task in judges:
        error = float(open_loop(members, runs[task.name], vehicle, base[task.name]).mean())
        loads["lane changes" if isinstance(task, FreeTask) else "captive runs"].append(error)
    ends = final_errors(SurrogateHydrodynamics(list(members)), runs, judges, vehicle)
    alone = final_errors(CalibratedHydrodynamics(waves=members[0].waves), runs, judges, vehicle)
    means = {kind: float(np.mean(errors)) for kind, errors in loads.items()}
    return {
        "load_error": means["lane changes"], "captive_load_error": means["captive runs"],
        "final_mean": float(np.mean(ends)), "final_worst": float(np.max(ends)),
        "fitted_final": float(np.mean(alone)),
    }  # fmt: skip


def plot(table: xr.Dataset) -> Figure:
    """Draw errors over the seconds of flow that taught."""
    with plt.rc_context(STYLE):
        figure, panels = plt.subplots(1, 3, figsize=(11.0, 3.4), layout="constrained")
        for axes, name, label in zip(
            panels, ("load_error", "captive_load_error", "final_mean"),
            ("error of the loads, lane changes [-]", "error of the loads, captive runs [-]",
             "final position off [% of the path]"), strict=True,
        ):  # fmt: skip
            for n, kind in enumerate(table["set"].values):
                axes.plot(table["seconds"], table[name].sel(set=kind), f"C{n}o-", label=str(kind))
            axes.set(xlabel="flow that taught [s]", ylabel=label, ylim=(0.0, None))
        published = float(table.attrs["coefficients_final"])
        panels[2].set_ylim(0.0, 1.05 * max(published, float(table["final_mean"].max())))
        panels[2].axhline(published, color="0.5", ls=":", label="published coefficients")
        handles, labels = panels[2].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=len(labels))
    return figure


def lines(table: xr.Dataset) -> str:
    """The table as it stands on the page of the study."""
    found = [
        "| taught by | flow | loads, lane changes | loads, captive runs | final position, mean; worst "
        "| their coefficients |"
    ]
    found.append("|---|---|---|---|---|---|")
    for kind in table["set"].values:
        for seconds in table["seconds"].values:
            row = table.sel(set=kind, seconds=seconds)
            if np.isnan(row["load_error"]):
                continue
            found.append(
                f"| {kind} | {seconds:g} s | {float(row['load_error']):.2f} | {float(row['captive_load_error']):.2f} | "
                f"{float(row['final_mean']):.1f}; {float(row['final_worst']):.1f} % | "
                f"{float(row['fitted_final']):.1f} % |"
            )
    found.append(f"| (published coefficients) | | | | {table.attrs['coefficients_final']:.1f} % | |")
    return "\n".join(found)


def study(
    folder: Path, cell_size: float, duration: float, counts: Sequence[int], seeds: int, preset: Preset, jobs: int,
    sets: Sequence[str] = SETS, unseen: Sequence[Scenario] = UNSEEN,
) -> xr.Dataset:  # fmt: skip
    """Make the runs that are missing, train, and compare."""
    vehicle = amphibious_vehicle()
    kept = LearningFolder(folder)
    kept.claim(vehicle, cell_size)
    kinds, judges = tasks_of(vehicle, folder, cell_size, duration, max(counts), unseen)
    taught = {
        (kind, count): chosen(kinds, kind, count)
        for kind in sets for count in counts if count <= MOST.get(kind, count)
    }  # fmt: skip
    every = {task.name: task for task in [*judges, *(task for tasks in taught.values() for task in tasks)]}

    def progress(reached: RunProgress) -> None:
        if reached.done:
            print(f"{reached.name}: {reached.error or 'finished'}", flush=True)

    failed = run_campaign(list(every.values()), vehicle, kept, jobs=jobs, progress=progress)
    if failed:
        raise RuntimeError(f"{len(failed)} runs broke down: {failed}")
    runs = kept.load(vehicle=vehicle)
    base = {task.name: base_loads(runs[task.name], vehicle) for task in judges}
    values = np.full((len(UNITS), len(sets), len(counts)), np.nan)
    for (kind, count), tasks in taught.items():
        output = folder / "networks" / f"{kind.replace(' ', '_')}_{count}"
        files = train([preset], {t.name: runs[t.name] for t in tasks}, vehicle, output, seeds=range(seeds), jobs=jobs)
        found = judged([NetworkSet.load(file) for file in files.values()], runs, judges, vehicle, base)
        values[:, sets.index(kind), counts.index(count)] = [found[name] for name in UNITS]
        print(kind, count, {name: round(value, 3) for name, value in found.items()}, flush=True)
    return xr.Dataset(
        {name: (("set", "seconds"), values[n], {"units": unit}) for n, (name, unit) in enumerate(UNITS.items())},
        {"set": list(sets), "seconds": ("seconds", [count * duration for count in counts], {"units": "s"})},
        {
            "cell_size": cell_size,
            "coefficients_final": float(np.mean(final_errors(CoefficientHydrodynamics(), runs, judges, vehicle))),
        },
    )


def main(quick: bool = False, folder: Path | None = None, jobs: int = 2) -> xr.Dataset:
    """Compare the sets; with `quick` two of them, of two short runs on coarse cells, and one seed."""
    assert set(ORDER) == {scenario.name for scenario in TRAINING}
    if quick:
        with tempfile.TemporaryDirectory() as temporary:
            preset = dataclasses.replace(PRESETS[LANE_CHANGES], epochs=2)
            few = ("lane changes", "multisines and steps")
            return study(folder or Path(temporary), 0.06, 0.4, (2,), 1, preset, jobs, few, UNSEEN[:1])
    table = study(folder or Path("runs") / "excitation", CELL_SIZE, DURATION, COUNTS, 5, PRESETS[LANE_CHANGES], jobs)
    save({"excitation.png": plot(table), "excitation.nc": table})
    print(lines(table))
    return table


if __name__ == "__main__":
    parser = study_parser(__doc__)
    parser.add_argument("--folder", type=Path, default=None, help="what is kept of the work")
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    main(**vars(parser.parse_args()))
