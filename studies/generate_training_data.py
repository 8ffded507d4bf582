"""The data set: nine training and four unseen lane changes with the flow in the loop (several hours on two cores).

Each scenario is run in a process of its own, `--jobs` of them side by side with one thread each, and keeps a checkpoint
every half second: stop the study whenever you like and start it again. Finished runs go to ``data/cfd_mbd`` (packed,
see its README) and, whole, to the folder of the checkpoints: ``runs``, or what EXUMOB_RUNS names.

Run: python studies/generate_training_data.py [--jobs 2] [--cell-size 0.018] [D60/U1 ...]
"""

from __future__ import annotations

import argparse
import logging
import multiprocessing
import os
import time
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path

import xarray as xr

from exumob import Soil, simulate
from exumob.errors import SimulationError
from exumob.flow import FlowSettings
from exumob.hydrodynamics import CfdHydrodynamics, VehicleFlow
from exumob.learning.dataset import pack
from exumob.results import load_dataset, save_dataset
from exumob.scenarios import TRAINING, UNSEEN, Scenario
from vehicle_models.amphibious import amphibious_vehicle

log = logging.getLogger(__name__)

ROOT = Path(__file__).parents[1]
DATA = ROOT / "data" / "cfd_mbd"
WORK = Path(os.environ.get("EXUMOB_RUNS", ROOT / "runs"))
CELL_SIZE = 0.018
"""Of the production runs [m]: 1.6 cells in the gap beside a wheel at full lock, where two are wanted."""
SNAPSHOTS = 0.1
"""Interval at which the free surface is kept [s]."""


def run(scenario: Scenario, cell_size: float = CELL_SIZE, duration: float = 8.0, work: Path = WORK) -> Path:
    """Run one scenario, or go on with it; return the file of the whole result."""
    name = f"{scenario.file_stem}_{1e3 * cell_size:g}mm"
    whole = work / f"{name}.nc"
    if whole.exists():
        return whole
    work.mkdir(parents=True, exist_ok=True)
    vehicle = amphibious_vehicle()
    began, told = time.perf_counter(), -1e9

    def progress(reached: float) -> None:
        nonlocal told
        if reached >= told + 0.25:
            told = reached
            log.info("%s: %.2f of %g s after %.0f s", scenario.name, reached, duration, time.perf_counter() - began)

    flow = VehicleFlow(cell_size, settings=FlowSettings(threads=1), allow_coarse=True, snapshots=SNAPSHOTS)
    result = simulate(
        vehicle, Soil.published("LETE sand"), scenario.water(vehicle), scenario.maneuver(),
        CfdHydrodynamics(flow, progress=progress), duration=duration, record_step=1e-3,
        checkpoint=work / f"{name}.npz", resume=True, progress=progress,
    )  # fmt: skip
    return save_dataset(result.assign_attrs(scenario=scenario.name), whole)


def generate(
    scenarios: tuple[Scenario, ...], cell_size: float = CELL_SIZE, duration: float = 8.0, jobs: int = 2,
    data: Path = DATA, work: Path = WORK,
) -> dict[str, Path]:  # fmt: skip
    """Run what is not there yet; return the packed file of each scenario that was finished."""
    data.mkdir(parents=True, exist_ok=True)
    files = {s.name: data / f"{s.file_stem}.nc" for s in scenarios}
    wanted = [s for s in scenarios if not files[s.name].exists()]
    context = multiprocessing.get_context("spawn")
    failed = set()
    with ProcessPoolExecutor(max(1, min(jobs, len(wanted))), context, _set_up) as pool:
        runs = {pool.submit(run, scenario, cell_size, duration, work): scenario for scenario in wanted}
        for done in as_completed(runs):
            name = runs[done].name
            try:
                save_dataset(pack(load_dataset(done.result())), files[name])
                log.info("%s: finished, %s", name, files[name])
            except (SimulationError, ValueError, OSError) as error:  # the others go on
                failed.add(name)
                log.error("%s: %s", name, error)
    return {name: file for name, file in files.items() if name not in failed}


def _set_up() -> None:
    logging.basicConfig(level=logging.INFO, format="%(asctime)s %(message)s")


def main(quick: bool = False) -> xr.Dataset:
    """Make the data set; return size [MB] and cost [core hours] of every run."""
    scenarios = TRAINING + UNSEEN
    if quick:
        import tempfile

        with tempfile.TemporaryDirectory() as folder:
            files = generate(scenarios[:1], 0.04, 0.02, 1, Path(folder), Path(folder) / "work")
            return _table(files)
    return _table(generate(scenarios))


def _table(files: dict[str, Path]) -> xr.Dataset:
    sizes = [file.stat().st_size / 1e6 for file in files.values()]
    runs = [load_dataset(file) for file in files.values()]
    hours = [(r.attrs["wall_time"] + r.attrs["settling_wall_time"]) / 3600.0 for r in runs]
    return xr.Dataset(
        {"size": ("scenario", sizes, {"units": "MB"}), "cost": ("scenario", hours, {"units": "h"})},
        coords={"scenario": list(files)},
    )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenarios", nargs="*", help="default: all thirteen")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--cell-size", type=float, default=CELL_SIZE)
    parser.add_argument("--data", type=Path, default=DATA)
    given = parser.parse_args()
    _set_up()
    chosen = tuple(map(Scenario.named, given.scenarios)) or TRAINING + UNSEEN
    print(_table(generate(chosen, given.cell_size, jobs=given.jobs, data=given.data)).to_pandas().round(2).to_string())
