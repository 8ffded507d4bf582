"""Captive runs: a vehicle on a prescribed path through the water, and the loads on its five bodies.

`captive_run` goes in three steps: prepare (checks, grid, solver), run (interval by interval), record (the result, whole
or up to where the run was stopped).
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import xarray as xr

from exumob.flow import FlowSettings, FlowSolver, Grid, Poses, Tread
from exumob.flow.bed import require_bed
from exumob.flow.cost import FlowCost, flow_cost, require_room
from exumob.flow.grid import CELL_SIZE
from exumob.flow.resolution import checked_solids
from exumob.flow.vehicle_window import settings_for_vehicle, vehicle_window
from exumob.ground.terrain import Terrain
from exumob.support.arrays import Array
from exumob.support.compiled import compiling_time, computing_clock
from exumob.support.cost import announce, require_memory
from exumob.support.declared import checked
from exumob.support.errors import SimulationError, SimulationInterrupted
from exumob.support.measured import flow_load_error
from exumob.support.provenance import parameters_json, provenance
from exumob.support.quantities import DURATION, Quantity
from exumob.support.smoothing import window_samples
from exumob.towing_tank.checkpoint import CaptiveCheckpoint
from exumob.towing_tank.checks import check_motion, whole_multiple
from exumob.towing_tank.motion import CaptiveMotion, PrescribedMotion
from exumob.towing_tank.record import CaptiveRecord
from exumob.vehicle.parameters import Vehicle
from exumob.water.conditions import Water
from exumob.water.mesh_file import mesh_digest, mesh_provenance

logger = logging.getLogger(__name__)

INTERVAL = Quantity("s", at_least=1e-7, at_most=1e6)
"""Interval of the loads"""
RECORD_SIZE = 6e3
"""Memory of an interval's record, and of its copies in the result [bytes]."""
CHECKPOINT_INTERVAL = 0.5
"""Simulated time between checkpoints [s]."""
SNAPSHOT_SIZE = 8.0
"""Memory of a snapshot, per column of cells [bytes]."""


@checked
def captive_run(  # the front door of captive runs: each argument is a choice of its own
    vehicle: Vehicle,
    water: Water,
    motion: PrescribedMotion | None = None,
    *,
    cell_size: Annotated[float, CELL_SIZE] = 0.018,
    duration: Annotated[float, DURATION] = 3.0,
    interval: Annotated[float, INTERVAL] = 1.0e-3,
    grid: Grid | None = None,
    settings: FlowSettings | None = None,
    snapshots: Annotated[float | None, INTERVAL] = None,
    on_snapshot: Callable[[FlowSolver, Poses], None] | None = None,
    allow_coarse: bool = False,
    progress: Callable[[float], None] | None = None,
    terrain: Terrain | None = None,
    tread: Tread | None = None,
    checkpoint: Path | None = None,
    resume: bool = False,
) -> xr.Dataset:
    """Move a vehicle on a prescribed path through water and return the loads on its bodies.

    At the start the whole window holds the undisturbed current and the vehicle should move with it (`CaptiveMotion`
    does): no wave is made until it is towed out of it. A vehicle at rest put into a developed current would instead
    start with an impulse whose wave crosses the window for seconds.

    Parameters
    ----------
    vehicle : Vehicle
        Any vehicle: its hull may be a box, raked or not, or a mesh.
    water : Water
    motion : PrescribedMotion, optional
        Default: `CaptiveMotion`, 1 m/s straight ahead.
    cell_size : float
        Cell size of the grid round the vehicle [m].
    duration : float
        [s]; a whole multiple of `interval`.
    interval : float
        Interval at which loads are recorded [s]; the solver divides it where the Courant number asks for it.
    grid : Grid, optional
        Default: `exumob.flow.vehicle_window.vehicle_window`.
    settings : FlowSettings, optional
        `follow` must be 0: the window follows the hull.
    snapshots : float, optional
        Interval [s] at which the free surface is kept in the result, in grid axes with the grid's place; a whole
        multiple of `interval`.
    on_snapshot : callable, optional
        Called at each snapshot (and the start) with solver and poses, to write volume fields for instance
        (`exumob.flow.output.vtk.VtkSeries`).
    allow_coarse : bool
        Warn instead of refusing when `check_resolution` finds the cells too coarse: for a quick look.
    progress : callable, optional
        Called with the time reached [s] after each interval.
    terrain : Terrain, optional
        The bed below the water; default flat at z = 0. The motion is prescribed and does not follow it:
        `CaptiveMotion` keeps the wheels on z = 0.
    tread : Tread, optional
        Lugs of the wheels (`exumob.flow.tread`); default: smooth wheels, whose spin acts through wall friction alone.
    checkpoint : path, optional
        File (.npz) that holds the whole run but for its snapshots, written every half second of simulated time and when
        it stops or breaks.
    resume : bool
        Go on from `checkpoint`, if there is one, with the same bits as a run that was never stopped; else begin.

    Returns
    -------
    xarray.Dataset
        The variables of `exumob.towing_tank.record.VARIABLES`; with snapshots also ``elevation`` (snapshot, y, x) and
        ``frame`` (snapshot, frame_component).

    Raises
    ------
    ValueError
        On input that cannot be run, before anything runs.
    SimulationError
        If the run breaks; ``error.result`` holds the Dataset up to then, ``error.state`` that of the flow solver.
    SimulationInterrupted
        On Ctrl-C; a KeyboardInterrupt whose ``result`` holds the Dataset up to then.
    """
    motion = CaptiveMotion() if motion is None else motion
    settings = settings_for_vehicle(vehicle, FlowSettings() if settings is None else settings)
    steps = whole_multiple("duration", duration, "interval", interval)
    every = 0 if snapshots is None else whole_multiple("snapshots", snapshots, "interval", interval)
    require_memory(
        f"captive_run: the record of duration = {duration:g} s at interval = {interval:g} s", RECORD_SIZE * steps,
        "give a shorter duration or a longer interval.",
    )  # fmt: skip
    if settings.follow != 0:
        raise ValueError(f"captive_run.settings: FlowSettings.follow = {settings.follow}; it must be 0, the hull.")
    steering_range = check_motion(motion, vehicle, water, duration)
    _warn_of_late_ramp(motion, duration)
    way = _way(motion, vehicle, water, duration)
    if grid is None:
        grid = vehicle_window(vehicle, cell_size, water, terrain, way)
    if terrain is not None:
        require_bed(terrain, grid, way)
    cost = _checked_cost(grid, settings, _fastest(motion, vehicle, water, duration), (steps, every, interval))
    solids = checked_solids(vehicle, grid, steering_range, allow_coarse, tread)
    announce(f"captive run of {vehicle.name}, {duration:g} s: {cost}.", cost.seconds)
    solver = FlowSolver(grid, solids, water, settings, terrain)
    parameters: dict[str, Any] = {
        "vehicle": vehicle, "water": water, "motion": motion, "grid": grid, "settings": settings,
        "steps": {"duration": duration, "interval": interval, "snapshots": snapshots},
    }  # fmt: skip
    parameters |= {name: value for name, value in (("terrain", terrain), ("tread", tread)) if value is not None}
    store = None
    if checkpoint is not None:
        if every:
            raise ValueError("captive_run.checkpoint keeps no snapshots; leave one of checkpoint and snapshots out.")
        store = CaptiveCheckpoint(checkpoint, parameters | {"hull": mesh_digest(vehicle.hull)}, resume)
    elif resume:
        raise ValueError("captive_run.resume: there is nothing to go on from without checkpoint; give its file.")
    run = _Run(vehicle, water, motion, solver, CaptiveRecord(solver, on_snapshot), interval, parameters, store)
    try:
        run.advance(steps, every, progress)
    except KeyboardInterrupt:
        run.keep()
        raise SimulationInterrupted(solver.time, run.result(f"interrupted at {solver.time:.4f} s")) from None
    except Exception as error:  # of solver, motion or callbacks: none of them may cost what was computed
        run.keep()
        cause = str(error) if isinstance(error, SimulationError) else f"{type(error).__name__}: {error}"
        broken = SimulationError(f"{vehicle.name}, captive, at {solver.time:.4f} s: {cause}")
        broken.result, broken.state = run.result(f"broke down at {solver.time:.4f} s: {cause}"), solver.save()
        raise broken from error
    return run.result("completed")


@dataclass
class _Run:
    """A captive run that has been prepared."""

    vehicle: Vehicle
    water: Water
    motion: PrescribedMotion
    solver: FlowSolver
    record: CaptiveRecord
    interval: float
    parameters: dict[str, Any]
    store: CaptiveCheckpoint | None = None

    def __post_init__(self) -> None:
        self.began, self.compiled = computing_clock(), compiling_time()
        self.solver.start(self.motion.poses(self.vehicle, self.water, 0.0))
        self.done = 0
        if self.store is not None and self.store.found:
            self.done, saved = self.store.read()
            self.solver.restore(saved["solver"])
            self.record.restore(saved["record"])
            logger.info("%s: goes on from %.3f s", self.store.file, self.solver.time)

    def keep(self) -> None:
        """Write a checkpoint of the whole intervals done, if there is to be one; a failed write does not end the run.

        In the midst of an interval the solver is elsewhere than the record: then the one before stays the last.
        """
        if self.store is not None and self.done and abs(self.solver.time - self.done * self.interval) < 1e-9:
            self.store.write(self.done, {"solver": self.solver.save(), "record": self.record.save(self.done)})

    def advance(self, steps: int, every: int, progress: Callable[[float], None] | None) -> None:
        """Go through all intervals; the surface is kept at the start and after `every` of them (0: never)."""
        if every:
            self.record.keep_surface(self.motion.poses(self.vehicle, self.water, 0.0))
        between = max(round(CHECKPOINT_INTERVAL / self.interval), 1)
        for n in range(self.done + 1, steps + 1):
            poses = self.motion.poses(self.vehicle, self.water, n * self.interval)
            self.solver.advance(n * self.interval, poses)
            self.record.keep(poses)
            self.done = n
            if n % between == 0:
                self.keep()
            if every and n % every == 0:
                self.record.keep_surface(poses)
            if progress is not None:
                progress(self.solver.time)

    def result(self, status: str) -> xr.Dataset:
        """Return the record with all that it takes to understand and repeat the run."""
        earlier = 0.0 if self.store is None else self.store.elapsed
        return self.record.dataset(self.interval).assign_attrs(
            provenance() | mesh_provenance(self.vehicle.hull) | {
                "title": f"exumob captive run of {self.vehicle.name}",
                "status": status,
                "parameters": parameters_json(self.parameters),
                "smoothing_window": window_samples(self.interval) * self.interval,
                "wall_time": earlier + computing_clock() - self.began,
                "compiling_wall_time": compiling_time() - self.compiled,
                "trust": f"flow solver: {flow_load_error()}",
            }
        )  # fmt: skip


def _warn_of_late_ramp(motion: PrescribedMotion, duration: float) -> None:
    if isinstance(motion, CaptiveMotion) and motion.ramp_time > 0.5 * duration:
        logger.warning(
            "captive_run: the ramp of %g s reaches into the second half of %g s, over which captive_summary averages; "
            "give a longer duration or a shorter ramp_time.", motion.ramp_time, duration,
        )  # fmt: skip


def _checked_cost(grid: Grid, settings: FlowSettings, speed: float, numbers: tuple[int, int, float]) -> FlowCost:
    """Estimate what a run takes, and refuse what cannot fit into memory."""
    steps, every, interval = numbers
    require_room("captive_run: the grid", grid)
    cost = flow_cost(
        grid.n_cells, grid.smallest_width, speed, steps * interval, interval, settings.courant, settings.threads
    )
    surfaces = (1 + steps // every if every else 0) * SNAPSHOT_SIZE * grid.shape[0] * grid.shape[2]
    require_memory(
        f"captive_run: {grid.n_cells:,} cells, the record of {steps:,} intervals and snapshots every "
        f"{every * interval:g} s", cost.memory + RECORD_SIZE * steps + surfaces,
        "give larger cells, a shorter duration, or snapshots at longer intervals.",
    )  # fmt: skip
    return cost


def _fastest(motion: PrescribedMotion, vehicle: Vehicle, water: Water, duration: float) -> float:
    """Largest speed of the hull through the water [m/s]."""
    poses = (motion.poses(vehicle, water, float(time)) for time in np.linspace(0.0, duration, 101))
    return max(float(np.linalg.norm(p.velocity[0] - water.velocity)) for p in poses)


def _way(motion: PrescribedMotion, vehicle: Vehicle, water: Water, duration: float) -> Array:
    """Places of the window during a run: hull's x, y [m] and heading [rad], shape (n, 3)."""
    poses = [motion.poses(vehicle, water, time) for time in np.linspace(0.0, duration, 101)]
    return np.array(
        [[*p.position[0, :2], math.atan2(p.rotation[0, 1, 0], p.rotation[0, 0, 0])] for p in poses]
    )  # fmt: skip
