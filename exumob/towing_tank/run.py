"""Captive runs: a vehicle on a prescribed path through the water, and the loads on its five bodies."""

from __future__ import annotations

import logging
import math
import time as clock
from collections.abc import Callable

import numpy as np
import xarray as xr

from exumob.flow.bed import lowest_bed
from exumob.flow.grid import Grid
from exumob.flow.output.snapshots import Snapshot, snapshots_dataset
from exumob.flow.poses import Poses
from exumob.flow.settings import FlowSettings
from exumob.flow.solver import FlowSolver
from exumob.flow.tread import Tread
from exumob.ground.terrain import Terrain
from exumob.support.arrays import Array
from exumob.support.checks import require_positive
from exumob.support.errors import SimulationError, SimulationInterrupted
from exumob.support.provenance import parameters_json, provenance
from exumob.support.smoothing import smoothed, window_samples
from exumob.towing_tank.checks import check_motion, checked_solids, front_wheel_angles, whole_multiple
from exumob.towing_tank.motion import CaptiveMotion, PrescribedMotion
from exumob.vehicle.motion import BODIES, WHEELS, quaternions
from exumob.vehicle.parameters import Vehicle
from exumob.water.conditions import Water

logger = logging.getLogger(__name__)

VARIABLES = {
    # name: (dimensions, units, meaning)
    "force": ("time body axis", "N", "force of the water, body axes, mean over the interval that ends at `time`"),
    "moment": ("time body axis", "N m", "moment of the water about the body's origin, body axes, mean as the force"),
    "force_smooth": ("time body axis", "N", "force, centred moving average (attrs: smoothing_window)"),
    "moment_smooth": ("time body axis", "N m", "moment, centred moving average (attrs: smoothing_window)"),
    "force_pressure": ("time body axis", "N", "part of the force: pressure"),
    "force_shear": ("time body axis", "N", "part of the force: wall shear"),
    "force_exchange": ("time body axis", "N", "part of the force: momentum passed by faces hardly open"),
    "moment_pressure": ("time body axis", "N m", "part of the moment: pressure"),
    "moment_shear": ("time body axis", "N m", "part of the moment: wall shear"),
    "moment_exchange": ("time body axis", "N m", "part of the moment: momentum passed by faces hardly open"),
    "position": ("time body axis", "m", "position of the body's origin, world axes"),
    "quaternion": ("time body quaternion_component", "1", "orientation, body to world, scalar first"),
    "yaw": ("time body", "rad", "heading, counter-clockwise from world x"),
    "pitch": ("time body", "rad", "pitch, bow down positive"),
    "velocity": ("time body axis", "m s-1", "velocity of the body's origin, world axes"),
    "angular_velocity": ("time body axis", "rad s-1", "angular velocity, world axes"),
    "wheel_speed": ("time wheel", "rad s-1", "spin of the wheel, positive rolls forward"),
    "steering_angle": ("time front_wheel", "rad", "front-wheel angle to the hull, positive to the left"),
    "sub_steps": ("time", "1", "steps of the flow solver in the interval"),
    "iterations": ("time", "1", "pressure iterations in the interval, all steps together"),
    "residual": ("time", "1", "largest divergence times step that the pressure solution left"),
    "courant": ("time", "1", "largest Courant number"),
    "halvings": ("time", "1", "steps that failed and were halved"),
    "volume_added": ("time", "m3", "water that the far field has added to the window since the start"),
}
"""The variables of a captive run."""
PARTS = ("pressure", "shear", "exchange")


def captive_run(
    vehicle: Vehicle,
    water: Water,
    motion: PrescribedMotion | None = None,
    *,
    cell_size: float = 0.018,
    duration: float = 3.0,
    interval: float = 1.0e-3,
    grid: Grid | None = None,
    settings: FlowSettings | None = None,
    snapshots: float | None = None,
    on_snapshot: Callable[[FlowSolver, Poses], None] | None = None,
    allow_coarse: bool = False,
    progress: Callable[[float], None] | None = None,
    terrain: Terrain | None = None,
    tread: Tread | None = None,
) -> xr.Dataset:
    """Move a vehicle on a prescribed path through water and return the loads on its bodies.

    At the start the whole window holds the undisturbed current and the vehicle should move with it (`CaptiveMotion`
    does): no wave is made until it is towed out of it. A vehicle at rest put into a developed current would instead
    start with an impulse whose wave crosses the window for seconds.

    Parameters
    ----------
    vehicle : Vehicle
        Any: raked or plain box hull, mesh hull.
    water : Water
    motion : PrescribedMotion, optional
        Default: `CaptiveMotion`, 1 m/s straight ahead.
    cell_size : float
        Of the grid round the vehicle [m].
    duration : float
        [s]; a whole multiple of `interval`.
    interval : float
        At which loads are recorded [s]; the solver divides it where the Courant number asks for it.
    grid : Grid, optional
        Default: `captive_grid`.
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

    Returns
    -------
    xarray.Dataset
        `VARIABLES`; with snapshots also ``elevation`` (snapshot, y, x) and ``frame`` (snapshot, frame_component).

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
    settings = FlowSettings() if settings is None else settings
    steps = whole_multiple("duration", duration, "interval", interval)
    every = 0 if snapshots is None else whole_multiple("snapshots", snapshots, "interval", interval)
    if settings.follow != 0:
        raise ValueError(f"captive_run.settings: FlowSettings.follow = {settings.follow}; it must be 0, the hull.")
    steering_range = check_motion(motion, vehicle, water, duration)
    if isinstance(motion, CaptiveMotion) and motion.ramp_time > 0.5 * duration:
        logger.warning(
            "captive_run: the ramp of %g s reaches into the second half of %g s, over which captive_summary averages; "
            "give a longer duration or a shorter ramp_time.", motion.ramp_time, duration,
        )  # fmt: skip
    if grid is None:
        grid = captive_grid(vehicle, cell_size, water, terrain, _way(motion, vehicle, water, duration))
    solids = checked_solids(vehicle, grid, steering_range, allow_coarse, tread)
    solver = FlowSolver(grid, solids, water, settings, terrain)
    began = clock.perf_counter()
    poses = motion.poses(vehicle, water, 0.0)
    solver.start(poses)
    record = _Record(solver, on_snapshot)

    def result(status: str) -> xr.Dataset:
        parameters = {
            "vehicle": vehicle, "water": water, "motion": motion, "grid": grid, "settings": settings,
            "steps": {"duration": duration, "interval": interval, "snapshots": snapshots},
        }  # fmt: skip
        if terrain is not None:
            parameters["terrain"] = terrain
        if tread is not None:
            parameters["tread"] = tread
        return record.dataset(interval) .assign_attrs(
            provenance() | {
                "title": f"exumob captive run of {vehicle.name}",
                "status": status,
                "parameters": parameters_json(parameters),
                "smoothing_window": window_samples(interval) * interval,
                "wall_time": clock.perf_counter() - began,
            }
        )  # fmt: skip

    try:
        if every:
            record.keep_surface(poses)
        for n in range(1, steps + 1):
            poses = motion.poses(vehicle, water, n * interval)
            solver.advance(n * interval, poses)
            record.keep(poses)
            if every and n % every == 0:
                record.keep_surface(poses)
            if progress is not None:
                progress(solver.time)
    except KeyboardInterrupt:
        raise SimulationInterrupted(solver.time, result(f"interrupted at {solver.time:.4f} s")) from None
    except Exception as error:  # of solver, motion or callbacks: none of them may cost what was computed
        said = str(error) if isinstance(error, SimulationError) else f"{type(error).__name__}: {error}"
        broken = SimulationError(f"{vehicle.name}, captive, at {solver.time:.4f} s: {said}")
        broken.result, broken.state = result(f"broke down at {solver.time:.4f} s: {said}"), solver.save()
        raise broken from error
    return result("completed")


def _way(motion: PrescribedMotion, vehicle: Vehicle, water: Water, duration: float) -> Array:
    """Places of the window during a run: hull's x, y [m] and heading [rad], shape (n, 3)."""
    poses = [motion.poses(vehicle, water, time) for time in np.linspace(0.0, duration, 101)]
    return np.array(
        [[*p.position[0, :2], math.atan2(p.rotation[0, 1, 0], p.rotation[0, 0, 0])] for p in poses]
    )  # fmt: skip


def captive_grid(
    vehicle: Vehicle, cell_size: float, water: Water, terrain: Terrain | None = None, frames: Array | None = None
) -> Grid:
    """Window of a captive run: that of `Grid.around_vehicle`, in proportion to the hull's length.

    Parameters
    ----------
    vehicle : Vehicle
    cell_size : float
        Round the vehicle [m].
    water : Water
        The window is at least three and a half times as high as it is deep.
    terrain : Terrain, optional
        The bed: the window starts a cell below the lowest one on its way (at a flat one).
    frames : array, shape (n, 3), optional
        Places on that way: x, y [m] and heading [rad] of the hull. Default: the world's origin.
    """
    require_positive("captive_run", cell_size=cell_size)
    scale = max(vehicle.hull.length, vehicle.wheelbase + vehicle.wheel.diameter)
    ahead, behind, aside = 1.8 * scale, 2.4 * scale, 1.8 * scale
    bottom = 0.0
    if terrain is not None and terrain.is_flat:
        bottom = terrain.height
    elif terrain is not None:
        margin = 0.1 * scale  # of the outermost cells, which may reach beyond these sides
        corners = np.array([-behind - margin, -aside - margin]), np.array([ahead + margin, aside + margin])
        frames = np.zeros((1, 3)) if frames is None else frames
        bottom = lowest_bed(terrain, frames, *corners, spacing=0.1) - cell_size
    return Grid.around_vehicle(
        vehicle, cell_size, ahead=ahead, behind=behind, aside=aside, top=max(0.42 * scale, 3.5 * water.depth),
        bottom=bottom,
    )  # fmt: skip


def doubled_grid(vehicle: Vehicle, cell_size: float, water: Water) -> Grid:
    """Twice the window of `captive_grid` ahead, behind and aside; same cells round the vehicle, same top."""
    normal = captive_grid(vehicle, cell_size, water)
    return Grid.around_vehicle(
        vehicle, cell_size, ahead=2.0 * normal.x_faces[-1], behind=-2.0 * normal.x_faces[0],
        aside=2.0 * normal.y_faces[-1], top=float(normal.z_faces[-1]) - 1e-6,
    )  # fmt: skip


# -- the record --------------------------------------------------------------------------------------------------------


class _Record:
    """What a run has computed so far."""

    def __init__(self, solver: FlowSolver, on_snapshot: Callable[[FlowSolver, Poses], None] | None) -> None:
        self.solver, self.on_snapshot = solver, on_snapshot
        self.times: list[float] = []
        self.loads: list[Array] = []
        self.poses: list[Poses] = []
        self.reports: list[tuple[float, ...]] = []
        self.snapshots: list[Snapshot] = []

    def keep(self, poses: Poses) -> None:
        solver = self.solver
        r = solver.report
        self.times.append(solver.time)
        loads = solver.loads  # in the order of PARTS
        self.loads.append(np.stack([loads.pressure, loads.shear, loads.slip_momentum]))
        self.poses.append(poses)
        self.reports.append((r.steps, r.iterations, r.residual, r.courant, r.halvings, solver.volume_added))

    def keep_surface(self, poses: Poses) -> None:
        self.snapshots.append(Snapshot.of(self.solver, poses))
        if self.on_snapshot is not None:
            self.on_snapshot(self.solver, poses)

    def dataset(self, interval: float) -> xr.Dataset:
        """Everything kept: whole instants only, whenever the run ended."""
        n = min(len(self.times), len(self.loads), len(self.poses), len(self.reports))
        loads = np.array(self.loads[:n]).reshape(n, 3, 5, 6)
        total = loads.sum(axis=1)

        def of_poses(name: str, *shape: int) -> Array:
            return np.array([getattr(p, name) for p in self.poses[:n]]).reshape(n, 5, *shape)

        rotation = of_poses("rotation", 3, 3)
        smooth = smoothed(total, interval)
        values: dict[str, Array] = {
            "force": total[..., :3], "moment": total[..., 3:],
            "force_smooth": smooth[..., :3], "moment_smooth": smooth[..., 3:],
            **{f"force_{part}": loads[:, k, :, :3] for k, part in enumerate(PARTS)},
            **{f"moment_{part}": loads[:, k, :, 3:] for k, part in enumerate(PARTS)},
            "position": of_poses("position", 3),
            "quaternion": quaternions(rotation),
            "yaw": np.unwrap(np.arctan2(rotation[..., 1, 0], rotation[..., 0, 0]), axis=0),
            "pitch": -np.arcsin(np.clip(rotation[..., 2, 0], -1.0, 1.0)),
            "velocity": of_poses("velocity", 3),
            "angular_velocity": of_poses("angular_velocity", 3),
            "wheel_speed": of_poses("spin")[:, 1:],
            "steering_angle": front_wheel_angles(rotation),
            **dict(zip(
                ("sub_steps", "iterations", "residual", "courant", "halvings", "volume_added"),
                np.array(self.reports[:n]).reshape(n, 6).T, strict=True,
            )),
        }  # fmt: skip
        dataset = xr.Dataset(
            {
                name: (dims.split(), np.ascontiguousarray(values[name]), {"units": units, "long_name": text})
                for name, (dims, units, text) in VARIABLES.items()
            },
            coords={
                "time": ("time", np.array(self.times[:n]), {"units": "s", "long_name": "time since the start"}),
                "body": list(BODIES),
                "wheel": list(WHEELS),
                "front_wheel": list(WHEELS[:2]),
                "axis": ["x", "y", "z"],
                "quaternion_component": ["w", "x", "y", "z"],
            },
        )
        if not self.snapshots:
            return dataset
        return dataset.merge(snapshots_dataset(self.solver.grid, self.snapshots))


def captive_summary(dataset: xr.Dataset) -> xr.Dataset:
    """Mean and standard deviation of the loads over the second half of a captive run.

    Returns
    -------
    xarray.Dataset
        ``force_mean``, ``moment_mean`` [N, N m] of the raw loads; ``force_deviation``, ``moment_deviation`` of the
        smoothed ones, that is of what the water does; ``force_noise``, ``moment_noise``: standard deviation of the raw
        loads about the smoothed ones. Dims (body, axis).
    """
    end = float(dataset["time"][-1]) if dataset.sizes["time"] else 0.0
    later = dataset.sel(time=slice(0.5 * end, None))
    figures = {}
    for name, units in (("force", "N"), ("moment", "N m")):
        raw, smooth = later[name], later[f"{name}_smooth"]
        for kind, value, text in (
            ("mean", raw.mean("time"), "mean"),
            ("deviation", smooth.std("time"), "standard deviation, smoothed"),
            ("noise", (raw - smooth).std("time"), "standard deviation, raw less smoothed"),
        ):
            figures[f"{name}_{kind}"] = value.assign_attrs(units=units, long_name=f"{text} of the {name}, second half")
    return xr.Dataset(figures, attrs={"from": 0.5 * end, "to": end})
