"""Parts of all studies: their command line, their folders, and how figures and tables are saved.

A study is a question, answered by a script: ``python studies/<name>.py`` computes the answer, saves its figures and
tables in ``studies/figures`` and prints it. Its function `main` does the same from Python; with ``quick=True`` (or
``--quick``) a small version shows within a minute or two that everything works, and saves no figures.

Runs with the flow in the loop take half an hour and more. They and their checkpoints are kept in the folder that the
environment variable EXUMOB_RUNS names (default: ``runs``), and the same command continues after a stop
(`exumob.paper.reference_runs.work_folder`).
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path

import matplotlib
import xarray as xr
from matplotlib.figure import Figure

from exumob.learning.envelope import stored_envelope
from exumob.learning.plan import LearningPlan, LearningRange, make_plan
from exumob.simulation.result_files import save_dataset
from exumob.support.figures import save_figure
from exumob.vehicle.parameters import Vehicle
from vehicle_models.amphibious import amphibious_vehicle

FIGURES = Path(__file__).parent / "figures"
"""Folder of the committed figures and tables."""
CFD_RUNS = Path(__file__).parents[1] / "data" / "cfd_mbd"
"""Folder of the data set: the thirteen packed runs with the flow in the loop."""
FULL_RANGE_RUNS = CFD_RUNS.parent / "full_range"
"""Folder of the runs that `exumob learn` made for the whole range, thinned."""
CAR_RUNS = CFD_RUNS.parent / "cars"
"""Folder of a lane change of each of the other vehicles with the flow in the loop, thinned."""
LIGHT_4X4_RUNS = CFD_RUNS.parent / "light_4x4"
"""Folder of those that it made so far of another vehicle."""
FULL_RANGE_CELLS, FULL_RANGE_BUDGET = 0.022, 4.2
"""Width of their cells [m], and the budget that they were planned with [h]."""


def study_parser(description: str | None) -> argparse.ArgumentParser:
    """Parser of a study's command line; its options are parameters of the study's `main`.

    Figures are drawn without a display from here on.

    Parameters
    ----------
    description : str
        Docstring of the study.
    """
    matplotlib.use("Agg")
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="a small version, to see that it works; saves no figures")
    return parser


def add_networks(parser: argparse.ArgumentParser) -> None:
    """Add the option ``--networks``, the folder of the networks that the study compares."""
    parser.add_argument("--networks", type=Path, default=Path("networks"), help="folder of `exumob train`")


def add_workers(parser: argparse.ArgumentParser, folder: str) -> None:
    """Add the options ``--workers``, processes of a sweep, and ``--folder``, where it is kept."""
    parser.add_argument("--workers", type=int, default=2, help="processes")
    parser.add_argument("--folder", type=Path, default=Path(folder), help="what is kept of the work")


def full_range_plan() -> LearningPlan:
    """The plan of the runs in `FULL_RANGE_RUNS`, as `exumob learn` makes it."""
    return stored_plan(amphibious_vehicle(), FULL_RANGE_RUNS, FULL_RANGE_BUDGET, FULL_RANGE_CELLS)


def stored_plan(vehicle: Vehicle, folder: Path, budget: float, cells: float) -> LearningPlan:
    """The plan of a folder of runs, as `exumob learn` makes it from the envelope that is kept there.

    Parameters
    ----------
    vehicle : Vehicle
        Whose runs they are.
    folder : Path
        Where they are.
    budget, cells : float
        Time of a core [h] and width of the cells [m] that they were planned with.
    """
    wanted = LearningRange()
    return make_plan(vehicle, wanted, budget, cells, stored_envelope(vehicle, wanted, folder))


def save(outputs: Mapping[str, Figure | xr.Dataset], folder: Path = FIGURES) -> None:
    """Save the figures (.png) and tables (.nc) of a study under the names of their files, and close the figures."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, output in outputs.items():
        if isinstance(output, Figure):
            save_figure(output, folder / name)
        else:
            save_dataset(output, folder / name)
