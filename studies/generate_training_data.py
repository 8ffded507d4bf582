"""The data set: nine training and four unseen lane changes with the flow in the loop (six hours on two cores).

Each scenario is run in a process of its own, `--jobs` of them side by side with one thread each, and keeps a checkpoint
every half second: stop the study whenever you like and start it again. Finished runs go to ``data/cfd_mbd`` (packed,
see its README) and, whole, to the folder of the checkpoints: ``runs``, or what EXUMOB_RUNS names.

Run: python studies/generate_training_data.py [--jobs 2] [--cell-size 0.018] [D60/U1 ...]
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import xarray as xr

from exumob.learning.dataset import pack
from exumob.paper.reference_runs import CELL_SIZE, FlowRun, compute_all, log, set_up_log, work_folder
from exumob.paper.scenarios import TRAINING, UNSEEN, Scenario
from exumob.simulation.result_files import load_dataset, save_dataset
from vehicle_models.amphibious import amphibious_vehicle

DATA = Path(__file__).parents[1] / "data" / "cfd_mbd"


def generate(
    scenarios: Sequence[Scenario], cell_size: float = CELL_SIZE, duration: float = 8.0, jobs: int = 2,
    data: Path = DATA, work: Path | None = None,
) -> xr.Dataset:  # fmt: skip
    """Run what is not there yet; return size [MB] and cost [core hours] of every run that there is."""
    data.mkdir(parents=True, exist_ok=True)
    files = {s: data / f"{s.file_stem}.nc" for s in scenarios}
    wanted = [FlowRun(s, cell_size, duration=duration) for s, file in files.items() if not file.exists()]
    for run, result in compute_all(wanted, amphibious_vehicle(), work or work_folder(), jobs) if wanted else ():
        if isinstance(result, xr.Dataset):
            log.info("%s: %s", run.name, save_dataset(pack(result), files[run.scenario]))
    there = {s.name: file for s, file in files.items() if file.exists()}
    runs = [load_dataset(file) for file in there.values()]
    hours = [(r.attrs["wall_time"] + r.attrs["settling_wall_time"]) / 3600.0 for r in runs]
    return xr.Dataset(
        {
            "size": ("scenario", [file.stat().st_size / 1e6 for file in there.values()], {"units": "MB"}),
            "cost": ("scenario", hours, {"units": "h"}),
        },
        coords={"scenario": list(there)},
    )


def main(quick: bool = False) -> xr.Dataset:
    """Make the data set, or, quickly, a hundredth of a second of one run."""
    if not quick:
        return generate(TRAINING + UNSEEN)
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        return generate(TRAINING[:1], 0.045, 0.01, 1, Path(folder), Path(folder) / "work")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenarios", nargs="*", help="default: all thirteen")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--cell-size", type=float, default=CELL_SIZE)
    parser.add_argument("--data", type=Path, default=DATA)
    given = parser.parse_args()
    set_up_log()
    chosen = tuple(map(Scenario.named, given.scenarios)) or TRAINING + UNSEEN
    print(generate(chosen, given.cell_size, jobs=given.jobs, data=given.data).to_pandas().round(2).to_string())
