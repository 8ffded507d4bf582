"""Reference lane changes with the flow in the loop: named, resumable, several side by side.

A run takes half an hour and more; `compute_all` gives each a process of its own. Every run keeps a checkpoint (half a
second of simulated time is the most that is ever lost) and, when it is finished, its whole result in one folder.
"""

from __future__ import annotations

import logging
import multiprocessing
import os
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path

import xarray as xr

from exumob.coupling.flow_code import BuiltInFlow
from exumob.coupling.flow_in_loop import CfdHydrodynamics
from exumob.flow import FlowSettings
from exumob.flow.vehicle_window import doubled_window, vehicle_window
from exumob.ground.soil import Soil
from exumob.paper.scenarios import Scenario
from exumob.simulation.results import load_dataset, save_dataset
from exumob.simulation.run import simulate
from exumob.vehicle.parameters import Vehicle

logger = logging.getLogger(__name__)

CELL_SIZE = 0.018
"""Of the production runs [m]; the gap beside a wheel at full lock has 1.3 cells, where two are wanted."""
SOIL = "LETE sand"
SNAPSHOTS = 0.1
"""Interval at which the free surface is kept [s]."""
TOLD = 0.25
"""Simulated time between two words on how far a run has got [s]."""


@dataclass(frozen=True)
class FlowRun:
    """One lane change with the flow in the loop."""

    scenario: Scenario
    cell_size: float = CELL_SIZE
    """Round the vehicle [m]"""
    doubled: bool = False
    """Whether the window reaches twice as far"""
    macro_step: float = 1e-3
    """[s]"""
    duration: float = 8.0
    """[s]"""

    @property
    def name(self) -> str:
        """As part of a file's name."""
        window = "_doubled" if self.doubled else ""
        step = f"_{1e3 * self.macro_step:g}ms" if self.macro_step != 1e-3 else ""
        return f"{self.scenario.file_stem}_{1e3 * self.cell_size:g}mm{window}{step}"

    def compute(self, vehicle: Vehicle, work: Path) -> Path:
        """Make the run, or go on with it; return the file of the whole result, in the folder `work`.

        Raises
        ------
        SimulationError
            If the run breaks down; its checkpoint stays.
        """
        whole = work / f"{self.name}.nc"
        if whole.exists():
            return whole
        work.mkdir(parents=True, exist_ok=True)
        began, told = time.perf_counter(), float("-inf")

        def progress(reached: float) -> None:
            nonlocal told
            if reached >= told + TOLD:
                told = reached
                logger.info(
                    "%s: %.2f of %g s after %.0f s", self.name, reached, self.duration, time.perf_counter() - began
                )

        water = self.scenario.water(vehicle)
        grid = (doubled_window if self.doubled else vehicle_window)(vehicle, self.cell_size, water)
        flow = BuiltInFlow(
            self.cell_size, grid=grid, settings=FlowSettings(threads=1), allow_coarse=True, snapshots=SNAPSHOTS
        )  # fmt: skip
        result = simulate(
            vehicle, Soil.published(SOIL), water, self.scenario.maneuver(), CfdHydrodynamics(flow, progress=progress),
            duration=self.duration, macro_step=self.macro_step, record_step=1e-3, checkpoint=work / f"{self.name}.npz",
            resume=True, progress=progress,
        )  # fmt: skip
        return save_dataset(result.assign_attrs(scenario=self.scenario.name), whole)


def compute_all(
    runs: Sequence[FlowRun], vehicle: Vehicle, work: Path, jobs: int = 2
) -> Iterator[tuple[FlowRun, xr.Dataset | Exception]]:
    """Compute runs side by side, one thread each; yield each as it is finished, or why it was not."""
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(max(1, min(jobs, len(runs))), context, set_up_log) as pool:
        pending = {pool.submit(run.compute, vehicle, work): run for run in runs}
        for done in as_completed(pending):
            run = pending[done]
            try:
                yield run, load_dataset(done.result())
            except Exception as error:  # of whatever kind: the others go on
                logger.error("%s: %s", run.name, error)
                yield run, error


def set_up_log() -> None:
    """Progress goes to standard error, with the time of day."""
    logging.basicConfig(level=logging.INFO, format="%(asctime)s %(message)s")


def work_folder() -> Path:
    """Where runs are kept: the folder that EXUMOB_RUNS names, or ``runs``."""
    return Path(os.environ.get("EXUMOB_RUNS", "runs"))
