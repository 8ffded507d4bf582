"""From which runs do the networks learn? (the data set; paper Sec. 5.1, Fig. 10)

Nine training and four unseen lane changes are run with the flow in the loop, each in a process of its own with one
thread and a checkpoint every half second: stop the study whenever you like and start it again. Finished runs go to
``data/cfd_mbd`` (packed and rounded, see its README) and, whole, to the folder that EXUMOB_RUNS names (see `common`).

Run: python studies/generate_training_data.py [--jobs 2] [--cell-size 0.018] [D60/U1 ...]     (six hours on two cores)
"""

from __future__ import annotations

import logging
import tempfile
from collections.abc import Sequence
from pathlib import Path

import xarray as xr
from common import CFD_RUNS, study_parser

from exumob.learning.compact import thinned
from exumob.learning.dataset import pack
from exumob.paper.reference_runs import CELL_SIZE, FlowRun, compute_all, set_up_log, work_folder
from exumob.paper.scenarios import TRAINING, UNSEEN, Scenario
from exumob.simulation.result_files import load_dataset, save_dataset
from vehicle_models.amphibious import amphibious_vehicle

logger = logging.getLogger(__name__)


def generate(
    scenarios: Sequence[Scenario], cell_size: float = CELL_SIZE, duration: float = 8.0, jobs: int = 2,
    data: Path = CFD_RUNS, work: Path | None = None,
) -> xr.Dataset:  # fmt: skip
    """Compute the runs that are missing; return size [MB] and cost [core hours] of every run that there is."""
    data.mkdir(parents=True, exist_ok=True)
    files = {s: data / f"{s.file_stem}.nc" for s in scenarios}
    wanted = [FlowRun(s, cell_size, duration=duration) for s, file in files.items() if not file.exists()]
    for run, result in compute_all(wanted, amphibious_vehicle(), work or work_folder(), jobs) if wanted else ():
        if isinstance(result, xr.Dataset):
            logger.info("%s: %s", run.name, save_dataset(thinned(pack(result), None), files[run.scenario]))
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


def main(
    quick: bool = False, scenarios: Sequence[str] = (), jobs: int = 2, cell_size: float = CELL_SIZE,
    data: Path = CFD_RUNS,
) -> xr.Dataset:  # fmt: skip
    """Make the data set, or some of its scenarios by name; with `quick` a hundredth of a second of one run."""
    if not quick:
        return generate(tuple(map(Scenario.named, scenarios)) or TRAINING + UNSEEN, cell_size, jobs=jobs, data=data)
    with tempfile.TemporaryDirectory() as folder:
        return generate(TRAINING[:1], 0.045, 0.01, 1, Path(folder), Path(folder) / "work")


if __name__ == "__main__":
    parser = study_parser(__doc__)
    parser.add_argument("scenarios", nargs="*", help="default: all thirteen")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--cell-size", type=float, default=CELL_SIZE)
    parser.add_argument("--data", type=Path, default=CFD_RUNS)
    set_up_log()
    print(main(**vars(parser.parse_args())).to_pandas().round(2).to_string())
