"""Should violent and calm runs weigh alike when networks learn, and should one set learn lane changes and all the rest?

The nine lane changes of `data/cfd_mbd` (18 mm cells) and the 21 runs of `data/full_range` that teach (22 mm; without
the drive on dry sand, which came later) are cut into four parts. Each part is left out once: from the rest, both sets
together or one of them alone, networks of one seed learn with the errors of all runs alike (preset `memory`) and with
each run weighed by the inverse variance of its loads (`balanced`), on coefficients fitted to the same rest. Judged by
the loads along the runs that were left out.

Run: python studies/weighing_runs.py [--workers 2] [--folder runs/weighing]     (half an hour of one core; it goes on
     where it was stopped)
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from common import CFD_RUNS, FULL_RANGE_RUNS, add_workers, save, study_parser
from matplotlib.figure import Figure

from exumob.learning.examples import training_runs
from exumob.learning.presets import LANE_CHANGES, PRESETS, WHOLE_RANGE, Preset
from exumob.learning.training import train
from exumob.learning.validation import compare_loads, load_errors
from exumob.support.figures import STYLE
from exumob.surrogates.networks import NetworkSet
from vehicle_models.amphibious import amphibious_vehicle

Runs = Mapping[str, xr.Dataset]

SETS = ("lane changes", "whole range")
"""Kinds of runs, of `data/cfd_mbd` and of `data/full_range`."""
TAUGHT = {"lane changes": SETS[:1], "whole range": SETS[1:], "both": SETS}
"""What teaches."""
LATER = "drive_100"
"""The drive on dry sand."""
PARTS = 4
"""Every fourth run of each kind is left out at a time."""
WEIGHED = {"alike": LANE_CHANGES, "by variance": WHOLE_RANGE}
"""Presets: errors of all runs alike, or over the variance of each."""


def part_of(runs: Runs, part: int) -> dict[str, xr.Dataset]:
    """The runs of one kind that are left out."""
    return {name: run for n, (name, run) in enumerate(runs.items()) if n % PARTS == part}


def error_on(members: Sequence[NetworkSet], apart: Runs) -> tuple[float, float]:
    """Load errors of networks, and of the coefficients below them, over the loads' deviation [-]."""
    vehicle = amphibious_vehicle()
    found = load_errors({name: compare_loads(members, run, vehicle) for name, run in apart.items()}, vehicle)
    return float(found["networks"].mean()), float(found["coefficients"].mean())


def compared(
    kinds: Mapping[str, Runs], presets: Mapping[str, Preset], parts: Sequence[int], folder: Path, jobs: int
) -> xr.Dataset:
    """Load errors on runs left out, by what taught, how it was weighed, and the kind of the runs left out."""
    vehicle = amphibious_vehicle()
    shape = (len(TAUGHT), len(presets), len(SETS), len(parts))
    networks, coefficients = np.full(shape, np.nan), np.full(shape, np.nan)
    for n, part in enumerate(parts):
        apart = {kind: part_of(runs, part) for kind, runs in kinds.items()}
        for t, (name, sets) in enumerate(TAUGHT.items()):
            rest = {
                run: found for kind in sets for run, found in kinds[kind].items() if run not in apart[kind]
            }  # fmt: skip
            files = train(
                list(presets.values()), rest, vehicle, folder / f"{name.replace(' ', '_')}_{part}", seeds=[0], jobs=jobs
            )
            for p, preset in enumerate(presets.values()):
                member = NetworkSet.load(files[preset.name, 0])
                for k, kind in enumerate(SETS):
                    networks[t, p, k, n], coefficients[t, p, k, n] = error_on([member], apart[kind])
            print(part, name, networks[t, :, :, n].round(3).tolist(), flush=True)
    of, unit = ("taught_by", "weighed", "judged_on", "part"), {"units": "1"}
    return xr.Dataset(
        {"networks": (of, networks, unit), "coefficients": (of, coefficients, unit)},
        {"taught_by": list(TAUGHT), "weighed": list(presets), "judged_on": list(SETS), "part": list(parts)},
    )


def plot(found: xr.Dataset) -> Figure:
    """Draw the load errors on runs left out."""
    with plt.rc_context(STYLE):
        figure, panels = plt.subplots(1, 2, figsize=(8.6, 3.2), layout="constrained", sharey=True)
        places = np.arange(found.sizes["taught_by"])
        for axes, kind in zip(panels, SETS, strict=True):
            one = found.sel(judged_on=kind)
            for n, weighed in enumerate(found["weighed"].values):
                each = one["networks"].sel(weighed=weighed)
                axes.bar(places + 0.27 * (n - 1), each.mean("part"), 0.25, color=f"C{n}", label=f"runs weigh {weighed}")
                for place, values in zip(places, each.values, strict=True):
                    axes.plot(np.full(len(values), place + 0.27 * (n - 1)), values, "k.", ms=3)
            below = one["coefficients"].isel(weighed=0).mean("part")
            axes.bar(places + 0.27, below, 0.25, color="0.7", label="coefficients alone")
            axes.set(title=f"{kind}, left out", xlabel="taught by")
            axes.set_xticks(places, [str(name) for name in found["taught_by"].values])
        panels[0].set_ylabel("load error [-]")
        figure.legend(*panels[0].get_legend_handles_labels(), loc="outside upper center", ncols=3)
    return figure


def lines(found: xr.Dataset) -> str:
    """The table as it stands on the page of the study."""
    rows = [
        "| taught by | runs weigh | " + " | ".join(f"load error, {kind}" for kind in SETS) + " |", "|---|---|---|---|"
    ]  # fmt: skip
    for name in found["taught_by"].values:
        one = found.sel(taught_by=name)
        for weighed in found["weighed"].values:
            errors = one["networks"].sel(weighed=weighed)
            cells = [f"{float(errors.sel(judged_on=kind).mean()):.2f}" for kind in SETS]
            rows.append(f"| {name} | {weighed} | {' | '.join(cells)} |")
        below = one["coefficients"].isel(weighed=0)
        cells = [f"{float(below.sel(judged_on=kind).mean()):.2f}" for kind in SETS]
        rows.append(f"| {name} | (coefficients alone) | {' | '.join(cells)} |")
    return "\n".join(rows)


def main(quick: bool = False, workers: int = 2, folder: Path = Path("runs") / "weighing") -> xr.Dataset:
    """Compare; with `quick` three runs of each kind, one part and two epochs. Returns the load errors."""
    kinds: dict[str, Runs] = {
        SETS[0]: training_runs(CFD_RUNS),
        SETS[1]: {n: r for n, r in training_runs(FULL_RANGE_RUNS / "runs").items() if not n.startswith(LATER)},
    }
    presets = {weighed: PRESETS[name] for weighed, name in WEIGHED.items()}
    if quick:
        kinds = {kind: dict(list(runs.items())[:3]) for kind, runs in kinds.items()}
        presets = {weighed: replace(preset, epochs=2) for weighed, preset in presets.items()}
        with tempfile.TemporaryDirectory() as temporary:
            return compared(kinds, presets, [0], Path(temporary), workers)
    found = compared(kinds, presets, range(PARTS), folder, workers)
    save({"weighing_runs.png": plot(found), "weighing_runs.nc": found})
    print(lines(found))
    return found


if __name__ == "__main__":
    parser = study_parser(__doc__)
    add_workers(parser, "runs/weighing")
    main(**vars(parser.parse_args()))
