"""The paper's lane changes with the flow in the loop (CFD-MBD runs): named, resumable, several side by side.

A run takes half an hour and more; `compute_all` gives each a process of its own. In one folder (`work_folder`: the
environment variable EXUMOB_RUNS, else ``runs``) every run keeps a checkpoint, from which it continues after a stop with
at most half a second of simulated time lost, and, when it is finished, its whole result.
"""

from __future__ import annotations

import json
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
from exumob.coupling.macro_step import FollowFlow
from exumob.coupling.spin_up import FlowSpinUp
from exumob.flow import FlowSettings
from exumob.flow.vehicle_window import doubled_window, vehicle_window
from exumob.ground.soil import Soil
from exumob.paper.scenarios import Scenario
from exumob.simulation.result_files import load_dataset, save_dataset
from exumob.simulation.run import simulate
from exumob.vehicle.parameters import Vehicle

logger = logging.getLogger(__name__)

CELL_SIZE = 0.018
"""Size of the cells round the vehicle in the runs of the data set [m].

The gap beside a wheel at full lock has 1.3 cells; two would be needed to resolve it."""
MACRO_STEP = 2e-3
"""Interval at which vehicle and water exchange motion and loads [s]; the flow divides it where its Courant number asks
for it."""
SOIL = "LETE sand"
"""Published soil on which the vehicle drives."""
SNAPSHOT_INTERVAL = 0.1
"""Simulated time between the free surfaces that are kept [s]."""
LOG_INTERVAL = 0.25
"""Simulated time between the lines of the log [s]."""
RUNS_VARIABLE = "EXUMOB_RUNS"
"""Environment variable that names the folder of runs, see `work_folder`."""


@dataclass(frozen=True)
class FlowRun:
    """One lane change with the flow in the loop.

    Raises
    ------
    ValueError
        If `hull_on_faces` is asked for in the doubled window, which knows none.
    """

    scenario: Scenario
    cell_size: float = CELL_SIZE
    """Size of the cells round the vehicle [m]"""
    doubled: bool = False
    """The window of the flow reaches twice as far from the vehicle"""
    macro_step: float | FollowFlow = MACRO_STEP
    """Interval at which vehicle and water exchange motion and loads [s]"""
    duration: float = 8.0
    """Simulated time [s]"""
    hold: float | None = None
    """Time at rest during the spin-up [s], None as usual: runs that differ in it alone are repetitions, with the flow
    in another phase at the release"""
    hull_on_faces: bool = False
    """Bow, stern and sides of the hull lie on faces of the grid (`Grid.around_vehicle`)"""

    def __post_init__(self) -> None:
        if self.doubled and self.hull_on_faces:
            raise ValueError(
                "FlowRun.hull_on_faces = True has no effect with doubled = True, whose window is not fitted; set one."
            )

    @property
    def name(self) -> str:
        """Name of the run as part of a file's name: the scenario, and settings other than the default."""
        window = ("_doubled" if self.doubled else "") + ("_on_faces" if self.hull_on_faces else "")
        step = "_following" if isinstance(self.macro_step, FollowFlow) else f"_{1e3 * self.macro_step:g}ms"
        step = "" if self.macro_step == MACRO_STEP else step
        hold = f"_hold{self.hold:g}s" if self.hold is not None else ""
        return f"{self.scenario.file_stem}_{1e3 * self.cell_size:g}mm{window}{step}{hold}"

    def compute(self, vehicle: Vehicle, work: Path) -> Path:
        """Make the run, or continue it from its checkpoint, unless it is finished already.

        Parameters
        ----------
        vehicle : Vehicle
        work : Path
            Folder of the checkpoint (``<name>.npz``) and the result (``<name>.nc``).

        Returns
        -------
        Path
            File of the whole result.

        Raises
        ------
        ValueError
            If the result that is there was made with another macro step.
        SimulationError
            If the run breaks down; its checkpoint is kept.
        """
        whole = work / f"{self.name}.nc"
        if whole.exists():
            self._check(whole)
            return whole
        work.mkdir(parents=True, exist_ok=True)
        began, logged = time.perf_counter(), float("-inf")

        def progress(reached: float) -> None:
            nonlocal logged
            if reached >= logged + LOG_INTERVAL:
                logged = reached
                logger.info(
                    "%s: %.2f of %g s after %.0f s", self.name, reached, self.duration, time.perf_counter() - began
                )

        water = self.scenario.water(vehicle)
        if self.doubled:
            grid = doubled_window(vehicle, self.cell_size, water)
        else:
            grid = vehicle_window(vehicle, self.cell_size, water, hull_on_faces=self.hull_on_faces)
        flow = BuiltInFlow(
            self.cell_size, grid=grid, settings=FlowSettings(threads=1), allow_coarse=True, snapshots=SNAPSHOT_INTERVAL
        )  # fmt: skip
        result = simulate(
            vehicle, Soil.published(SOIL), water, self.scenario.maneuver(),
            CfdHydrodynamics(flow, spin_up=FlowSpinUp(hold=self.hold), progress=progress), duration=self.duration,
            setting="fine", micro_step=self.macro_step.unit if isinstance(self.macro_step, FollowFlow) else None,
            macro_step=self.macro_step, record_step=1e-3, checkpoint=work / f"{self.name}.npz",
            resume=True, progress=progress,
        )  # fmt: skip
        return save_dataset(result.assign_attrs(scenario=self.scenario.name), whole)

    def _check(self, whole: Path) -> None:
        """Refuse a result of the same name that another macro step has made: the name's default was another once."""
        with xr.open_dataset(whole) as found:
            made = json.loads(found.attrs["parameters"])["steps"]["macro_step"]
        if isinstance(made, float) and isinstance(self.macro_step, float) and made != self.macro_step:
            raise ValueError(
                f"{whole} was made with a macro step of {1e3 * made:g} ms, and this run has {1e3 * self.macro_step:g} "
                "ms; move it away, or name another folder by EXUMOB_RUNS."
            )


def compute_all(
    runs: Sequence[FlowRun], vehicle: Vehicle, work: Path, jobs: int = 2
) -> Iterator[tuple[FlowRun, xr.Dataset | Exception]]:
    """Compute runs side by side, each in a process of its own with one thread.

    Parameters
    ----------
    runs : sequence of FlowRun
    vehicle : Vehicle
    work : Path
        Folder of checkpoints and results, see `FlowRun.compute`.
    jobs : int
        Number of processes.

    Yields
    ------
    FlowRun
        A run, as soon as it has ended.
    xarray.Dataset or Exception
        Its result, or the error that ended it; the other runs go on.
    """
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
    """Log the progress of runs to standard error, with the time of day."""
    logging.basicConfig(level=logging.INFO, format="%(asctime)s %(message)s")


def work_folder() -> Path:
    """Folder of the runs: the one that the environment variable EXUMOB_RUNS names, else ``runs``."""
    return Path(os.environ.get(RUNS_VARIABLE, "runs"))
