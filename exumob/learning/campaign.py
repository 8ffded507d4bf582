"""The runs of a plan in one folder: side by side, each resumable; what is finished is never made again.

The folder holds ``learning.json`` (of which vehicle it is, on which cells), ``runs`` (packed runs, netCDF, those of
others too) and ``work`` (checkpoints of unfinished runs). A run that is killed goes on from its checkpoint, with half a
second of simulated time lost at most.
"""

from __future__ import annotations

import json
import logging
import multiprocessing
import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import numpy as np
import xarray as xr

from exumob.coupling.flow_code import BuiltInFlow
from exumob.coupling.flow_in_loop import CfdHydrodynamics
from exumob.coupling.macro_step import FollowFlow
from exumob.flow.revision import solver_revision
from exumob.ground.soil import Soil
from exumob.learning.dataset import SAMPLING, check_geometry, histories, load_run, pack
from exumob.learning.plan import LONGEST_MACRO_STEP, MICRO_STEP, CaptiveTask, Task
from exumob.simulation.result_files import save_dataset
from exumob.simulation.run import simulate
from exumob.support.arrays import Array
from exumob.support.files import require_folder_name, require_writable, write_text
from exumob.support.processes import end_with_parent, stopping
from exumob.support.provenance import parameters_json, provenance
from exumob.surrogates.model import SurrogateHydrodynamics
from exumob.towing_tank.run import captive_run
from exumob.vehicle.motion import BodyStates
from exumob.vehicle.parameters import Vehicle
from exumob.water.calibrated import CalibratedHydrodynamics
from exumob.water.coefficients import CoefficientHydrodynamics
from exumob.water.mesh_file import mesh_digest, mesh_provenance

logger = logging.getLogger(__name__)

POLL = 0.2
"""Interval at which progress is reported [s]."""
DEATHS = 2
"""How often runs go on, with half of the processes, after one of them has died (often for want of memory)."""
ROOM = 50_000_000
"""Room that the folder must have [bytes]."""
TOLD = 0.05
"""Simulated time between two words of a run on how far it is [s]."""
ABOUT = "learning.json"
"""File of a folder that says whose it is."""

WITHOUT_FLOW = tuple(
    model.__name__ for model in (CoefficientHydrodynamics, CalibratedHydrodynamics, SurrogateHydrodynamics)
)
"""Models whose loads there is nothing to learn from."""


@dataclass(frozen=True)
class LearningFolder:
    """The folder of one vehicle's runs and networks.

    Raises
    ------
    ValueError
        If it cannot be made or written, or its name is that of a file.
    """

    path: Path

    def __post_init__(self) -> None:
        require_folder_name("--output", self.path)
        try:
            for folder in (self.runs, self.work):
                folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise ValueError(
                f"--output {self.path}: the folder cannot be made ({error.strerror}); give one in which you may write."
            ) from None
        require_writable(self.work / "run.npz", ROOM)

    @property
    def runs(self) -> Path:
        """Folder of the packed runs."""
        return self.path / "runs"

    @property
    def work(self) -> Path:
        """Folder of the checkpoints."""
        return self.path / "work"

    def about(self) -> dict[str, Any]:
        """Return what the folder says of itself; empty if it is new.

        Raises
        ------
        ValueError
            If the file is damaged.
        """
        file = self.path / ABOUT
        if not file.exists():
            return {}
        try:
            found = json.loads(file.read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            raise ValueError(f"{file} cannot be read ({error}); use a whole copy, or another folder.") from None
        if not isinstance(found, dict):
            raise ValueError(f"{file} is not what was written; use a whole copy, or another folder.")
        return found

    def claim(self, vehicle: Vehicle, cell_size: float) -> None:
        """Take the folder for a vehicle and a size of the cells, or refuse it if it is another's (`require_free`)."""
        self.require_free(vehicle, cell_size)
        self.note(_owner(vehicle, cell_size))

    def require_free(self, vehicle: Vehicle, cell_size: float) -> None:
        """Refuse a folder that is another vehicle's or of other cells.

        As long as it holds neither runs nor checkpoints it is nobody's: a plan that was refused binds to nothing.

        Raises
        ------
        ValueError
            Naming what differs.
        """
        mine, found = _owner(vehicle, cell_size), self.about()
        if found and (any(self.runs.glob("*.nc")) or any(self.work.glob("*.npz"))):
            differing = _differences(found.get("vehicle"), mine["vehicle"])
            if found.get("hull") != mine["hull"]:
                differing.append("the contents of Hull.mesh")
            if differing:
                raise ValueError(
                    f"--output {self.path} holds the runs of another vehicle: {'; '.join(differing[:3])}"
                    f"{f'; and {len(differing) - 3} more' if len(differing) > 3 else ''}. Give another folder, or the "
                    "vehicle of this one."
                )
            if found.get("cell_size") != mine["cell_size"]:
                raise ValueError(
                    f"--output {self.path} holds runs on cells of {found.get('cell_size')} m, and --cell-size is "
                    f"{cell_size:g} m; runs on different cells differ by more than networks. Give --cell-size "
                    f"{found.get('cell_size')}, or another folder."
                )

    def note(self, more: Mapping[str, Any]) -> None:
        """Add to what the folder says of itself."""
        write_text(self.path / ABOUT, json.dumps(self.about() | dict(more), indent=1))

    def unfinished(self, tasks: Sequence[Task]) -> list[Task]:
        """Return the tasks whose runs are not there yet."""
        return [task for task in tasks if not self.file(task).exists()]

    def file(self, task: Task) -> Path:
        """Where the finished run of a task is."""
        return self.runs / f"{task.name}.nc"

    def checkpoint(self, task: Task) -> Path:
        """Where the checkpoint of an unfinished one is."""
        return self.work / f"{task.name}.npz"

    def is_begun(self, task: Task) -> bool:
        """Whether the run of a task has left a checkpoint, from which it goes on."""
        return self.checkpoint(task).exists()

    def load(self, mixed: bool = False, vehicle: Vehicle | None = None) -> dict[str, xr.Dataset]:
        """Load all runs by name, with those that others have put there.

        Parameters
        ----------
        vehicle : Vehicle, optional
            That of the runs, which is checked then.
        mixed : bool
            Take runs of several versions of the flow solver.

        Raises
        ------
        ValueError
            If a file is no run to learn from, or runs are of another vehicle or other cells, or were made with several
            versions of the flow solver.
        """
        found: dict[str, xr.Dataset] = {}
        for file in sorted(self.runs.glob("*.nc")):
            run = load_run(file)
            if (model := str(run.attrs.get("hydrodynamics", ""))) in WITHOUT_FLOW:
                raise ValueError(
                    f"{file}: its loads are those of {model}; networks are to learn those of a flow. Move it away."
                )
            found[file.stem] = run
        if vehicle is not None:
            check_geometry(found, vehicle)
        size = self.about().get("cell_size")
        for name, run in found.items():
            if size is not None and float(run.attrs.get("cell_size", size)) != size:
                raise ValueError(
                    f"{self.runs / name}.nc was made on cells of {run.attrs['cell_size']:g} m, and this folder is of "
                    f"runs on {size:g} m; runs on different cells differ by more than networks. Move it away."
                )
        versions = {
            name: str(run.attrs["flow_revision"]) for name, run in found.items() if "flow_revision" in run.attrs
        }
        different = sorted({*versions.values(), *([solver_revision()] if versions else [])})
        if len(different) > 1 and not mixed:
            old = sorted(name for name, version in versions.items() if version != solver_revision())
            raise ValueError(
                f"{self.runs}: {len(old)} of {len(versions)} runs were made with another version of the flow solver "
                f"({', '.join(old[:3])}{' ...' if len(old) > 3 else ''}); loads of two versions may differ. Move them "
                "away, so that they are made anew, or accept them (--mixed)."
            )
        return found


def _owner(vehicle: Vehicle, cell_size: float) -> dict[str, Any]:
    """Whose a folder is: the vehicle with its hull's mesh, and the size of the cells."""
    return {
        "vehicle": json.loads(parameters_json({"vehicle": vehicle}))["vehicle"], "hull": mesh_digest(vehicle.hull),
        "cell_size": float(cell_size),
    }  # fmt: skip


def _differences(kept: Any, mine: Any, before: str = "") -> list[str]:
    """Say in which parameters two vehicles differ."""
    if isinstance(kept, dict) and isinstance(mine, dict):
        names = [name for name in dict.fromkeys([*kept, *mine]) if f"{before}{name}" != "Vehicle.name"]
        return [
            text for name in names for text in _differences(kept.get(name), mine.get(name), f"{before}{name}.")
        ]  # fmt: skip
    if kept == mine:
        return []
    name = before.removeprefix("Vehicle.").removesuffix(".")
    return [f"{name} was {kept}, is {mine}"]


@dataclass(frozen=True)
class RunProgress:
    """How far a run is."""

    name: str
    time: float
    """Simulated time reached [s]; negative: before the release"""
    done: bool = False
    error: str = ""
    """What ended it, if it broke down"""


def run_campaign(  # each argument is a choice of its own
    tasks: Sequence[Task], vehicle: Vehicle, folder: LearningFolder, *, jobs: int = 1, mpi: bool = False,
    progress: Callable[[RunProgress], None] | None = None,
    compute: Callable[[Task, Vehicle, Path, Callable[[float], None]], xr.Dataset] | None = None,
) -> dict[str, str]:  # fmt: skip
    """Make the runs that are missing, side by side, each in a process of its own with one thread.

    Parameters
    ----------
    tasks : sequence of Task
    vehicle : Vehicle
    folder : LearningFolder
    jobs : int
        Number of processes.
    mpi : bool
        Use the ranks of ``mpiexec -n 4 python -m mpi4py.futures script.py`` (one leads, the others work); they see the
        same folder. Progress is then reported when a run ends.
    progress : callable, optional
        Called as runs go on.
    compute : callable, optional
        Makes a run: task, vehicle, file of its checkpoint, and what takes the time reached [s]. Default:
        `compute_task`. It must be a function of a module, as other processes call it.

    Returns
    -------
    dict
        Errors of runs that broke down, by name; the others are in the folder.

    Raises
    ------
    ValueError
        If ranks of MPI are wanted, and there are none.
    """
    failed: dict[str, str] = {}
    left, workers = folder.unfinished(tasks), jobs
    for again in range(DEATHS, -1, -1):
        if not left:
            break
        failed_now, killed = _make(left, vehicle, folder, workers, mpi, progress, compute or compute_task, again > 0)
        failed |= failed_now
        left, workers = [task for task in left if task.name in killed], max(workers // 2, 1)
    return failed


def _make(  # the arguments of `run_campaign`
    tasks: Sequence[Task], vehicle: Vehicle, folder: LearningFolder, jobs: int, mpi: bool,
    progress: Callable[[RunProgress], None] | None, compute: Callable[..., xr.Dataset], again: bool,
) -> tuple[dict[str, str], set[str]]:  # fmt: skip
    """Make runs until all have ended or a process has died; return errors, and names of those to be made `again`."""
    failed: dict[str, str] = {}
    killed: set[str] = set()
    context = multiprocessing.get_context("spawn")
    queue = context.SimpleQueue()
    pool: Executor = (
        _ranks() if mpi
        else ProcessPoolExecutor(max(1, min(jobs, len(tasks))), context, _begin, (queue, os.getpid()))
    )  # fmt: skip
    with stopping(pool):
        pending = {pool.submit(_compute_and_keep, task, vehicle, folder, compute): task for task in tasks}
        left = set(pending)
        while left:
            ended = wait(left, POLL, FIRST_COMPLETED).done
            while not queue.empty():
                reached = queue.get()
                if progress is not None:
                    progress(reached)
            for future in ended:
                left.remove(future)
                error, task = future.exception(), pending[future]
                if isinstance(error, BrokenProcessPool):
                    if again:
                        killed.add(task.name)
                        continue
                    failed[task.name] = "its process, or one beside it, was killed; the same command goes on"
                elif error is not None:
                    failed[task.name] = str(error) or type(error).__name__
                if progress is not None:
                    progress(RunProgress(task.name, task.duration, True, failed.get(task.name, "")))
    return failed, killed


def working_ranks() -> int:
    """Return the number of the ranks of MPI that work; one more leads.

    Raises
    ------
    ValueError
        If this process does not lead any.
    """
    how = "start it as: mpiexec -n 4 python -m mpi4py.futures -m exumob learn ... --mpi (one rank leads, three work)"
    try:
        from mpi4py import MPI
    except (ImportError, RuntimeError) as error:
        raise ValueError(f"--mpi needs mpi4py ({error}); pip install 'exumob[mpi]', and {how}.") from None
    ranks = int(MPI.COMM_WORLD.Get_size())
    if ranks < 2:
        raise ValueError(f"--mpi: this process has no ranks of MPI beside it; {how}.")
    return ranks - 1


def _ranks() -> Executor:
    from mpi4py.futures import MPIPoolExecutor

    working_ranks()
    return cast("Executor", MPIPoolExecutor(initializer=_quieten))


_queue: Any = None
"""What takes the progress, in a process of the pool; None in a rank of MPI."""


def _begin(queue: Any, leader: int) -> None:
    """Begin a process of the pool: it ends with its leader, even if that is killed."""
    global _queue
    _queue = queue
    _quieten()
    end_with_parent(leader)


def _quieten() -> None:
    logging.getLogger("exumob").setLevel(logging.ERROR)  # the plan has said what the cells lose


def _compute_and_keep(task: Task, vehicle: Vehicle, folder: LearningFolder, compute: Callable[..., Any]) -> None:
    told, checkpoint = -np.inf, folder.checkpoint(task)

    def progress(time: float) -> None:
        nonlocal told
        if time >= told + TOLD:
            told = time
            if _queue is not None:
                _queue.put(RunProgress(task.name, time))

    try:
        run = compute(task, vehicle, checkpoint, progress)
    except ValueError as error:
        if "belongs to another run" not in str(error):
            raise
        # The file's name says that it is of this run: another version of the program wrote it, or the vehicle had
        # another name. It cannot be gone on from.
        checkpoint.unlink()
        run = compute(task, vehicle, checkpoint, progress)
    save_dataset(run, folder.file(task), elsewhere=False)
    checkpoint.unlink(missing_ok=True)


def compute_task(task: Task, vehicle: Vehicle, checkpoint: Path, progress: Callable[[float], None]) -> xr.Dataset:
    """Make a run with the built-in flow solver, or continue it from its checkpoint; return it packed.

    Raises
    ------
    SimulationError
        If the run breaks down; its checkpoint is kept.
    """
    more = {
        "scenario": task.name, "role": task.role, "flow_revision": solver_revision(), "cell_size": task.cell_size,
    }  # fmt: skip
    if isinstance(task, CaptiveTask):
        result = captive_run(
            vehicle, task.water, task.motion, cell_size=task.cell_size, duration=task.duration, interval=task.interval,
            allow_coarse=True, progress=progress, checkpoint=checkpoint, resume=True,
        )  # fmt: skip
        return captive_histories(result, task, vehicle).assign_attrs(more)
    flow = BuiltInFlow(task.cell_size, allow_coarse=True)
    result = simulate(
        vehicle, Soil.published(task.soil), task.water, task.maneuver, CfdHydrodynamics(flow, progress=progress),
        duration=task.duration, micro_step=MICRO_STEP, macro_step=FollowFlow(MICRO_STEP, LONGEST_MACRO_STEP),
        record_step=SAMPLING, checkpoint=checkpoint, resume=True, progress=progress,
    )  # fmt: skip
    return pack(result).assign_attrs(more)


def captive_histories(result: xr.Dataset, task: CaptiveTask, vehicle: Vehicle) -> xr.Dataset:
    """Return a captive run as a run to learn from: motion and loads at every millisecond.

    The loads of a captive run are means over intervals: each stands for the middle of its interval, with straight
    lines between. The motion is prescribed, and known at every instant.

    Parameters
    ----------
    result : xarray.Dataset
        Result of `exumob.towing_tank.captive_run`.
    task : CaptiveTask
    vehicle : Vehicle
    """
    ends = result["time"].values
    interval = float(ends[1] - ends[0]) if len(ends) > 1 else float(ends[0])
    first = max(round(interval / SAMPLING), 1)
    time: Array = SAMPLING * np.arange(first, round(float(ends[-1]) / SAMPLING) + 1, dtype=float)
    loads = np.concatenate([result["force"].values, result["moment"].values], axis=-1).reshape(len(ends), -1)
    middles = ends - 0.5 * interval
    wrench = np.stack([np.interp(time, middles, column) for column in loads.T], axis=1).reshape(len(time), 5, 6)
    states = prescribed_states(task, vehicle, time)
    attrs = provenance() | mesh_provenance(vehicle.hull) | {
        "title": f"exumob captive run of {vehicle.name}", "status": result.attrs["status"],
        "parameters": parameters_json({"vehicle": vehicle, "water": task.water, "motion": task.motion}),
        "wall_time": result.attrs["wall_time"], "interval": interval,
    }  # fmt: skip
    return histories(states, wrench, task.water, attrs)


def prescribed_states(task: CaptiveTask, vehicle: Vehicle, time: Array) -> BodyStates:
    """Return the states of the five bodies of a captive run at times a millisecond apart [s]."""
    poses = [task.motion.poses(vehicle, task.water, float(t)) for t in time]
    velocity, angular = (np.array([getattr(p, name) for p in poses]) for name in ("velocity", "angular_velocity"))
    return BodyStates(
        time, np.array([p.position for p in poses]), np.array([p.rotation for p in poses]), velocity, angular,
        np.gradient(velocity, time, axis=0), np.gradient(angular, time, axis=0),
        np.array([p.spin[1:] for p in poses]),
    )  # fmt: skip
