"""The result of a captive run: what is recorded at each interval, the Dataset made of it, and its summary."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields
from typing import Any

import numpy as np
import xarray as xr

from exumob.flow import FlowSolver, Poses
from exumob.flow.output.snapshots import Snapshot, snapshots_dataset
from exumob.support.arrays import Array
from exumob.support.declared import checked
from exumob.support.dimensions import with_described_names
from exumob.support.smoothing import smoothed
from exumob.towing_tank.checks import front_wheel_angles
from exumob.vehicle.motion import BODIES, WHEELS, quaternions

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
"""Parts of the loads, which add up to them."""
FLOW_FIGURES = ("sub_steps", "iterations", "residual", "courant", "halvings", "volume_added")


class CaptiveRecord:
    """Everything that a captive run has computed so far.

    Parameters
    ----------
    solver : FlowSolver
        The solver of the run.
    on_snapshot : callable, optional
        Called with solver and poses whenever the free surface is kept.
    """

    def __init__(self, solver: FlowSolver, on_snapshot: Callable[[FlowSolver, Poses], None] | None = None) -> None:
        self.solver, self.on_snapshot = solver, on_snapshot
        self.times: list[float] = []
        self.loads: list[Array] = []
        self.poses: list[Poses] = []
        self.reports: list[tuple[float, ...]] = []
        self.snapshots: list[Snapshot] = []

    def keep(self, poses: Poses) -> None:
        """Keep loads, poses and figures of the solver's last interval."""
        solver = self.solver
        r = solver.report
        self.times.append(solver.time)
        self.loads.append(np.stack([solver.loads.pressure, solver.loads.shear, solver.loads.slip_momentum]))
        self.poses.append(poses)
        self.reports.append((r.steps, r.iterations, r.residual, r.courant, r.halvings, solver.volume_added))

    def keep_surface(self, poses: Poses) -> None:
        """Keep the free surface as it is now."""
        self.snapshots.append(Snapshot.of(self.solver, poses))
        if self.on_snapshot is not None:
            self.on_snapshot(self.solver, poses)

    def save(self, count: int) -> dict[str, Any]:
        """Return what was kept of the first `count` intervals, as arrays; snapshots are left out."""
        poses = {f.name: np.array([getattr(p, f.name) for p in self.poses[:count]]) for f in fields(Poses)}
        return {
            "times": np.array(self.times[:count]), "loads": np.array(self.loads[:count]), "poses": poses,
            "reports": np.array(self.reports[:count], dtype=float),
        }  # fmt: skip

    def restore(self, saved: dict[str, Any]) -> None:
        """Return to what `save` gave."""
        self.times = [float(time) for time in saved["times"]]
        self.loads = list(saved["loads"])
        columns = saved["poses"]
        self.poses = [Poses(**{name: columns[name][n] for name in columns}) for n in range(len(self.times))]
        self.reports = [tuple(row) for row in saved["reports"].tolist()]

    def dataset(self, interval: float) -> xr.Dataset:
        """Return everything kept, at whole instants only, whenever the run ended."""
        n = min(len(self.times), len(self.loads), len(self.poses), len(self.reports))
        values = self._loads(n, interval) | self._motion(n)
        values |= dict(zip(FLOW_FIGURES, np.array(self.reports[:n]).reshape(n, len(FLOW_FIGURES)).T, strict=True))
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
        if self.snapshots:
            dataset = dataset.merge(snapshots_dataset(self.solver.grid, self.snapshots))
        return with_described_names(dataset)

    def _loads(self, n: int, interval: float) -> dict[str, Array]:
        loads = np.array(self.loads[:n]).reshape(n, len(PARTS), 5, 6)
        total = loads.sum(axis=1)
        smooth = smoothed(total, interval)
        return {
            "force": total[..., :3], "moment": total[..., 3:],
            "force_smooth": smooth[..., :3], "moment_smooth": smooth[..., 3:],
            **{f"force_{part}": loads[:, k, :, :3] for k, part in enumerate(PARTS)},
            **{f"moment_{part}": loads[:, k, :, 3:] for k, part in enumerate(PARTS)},
        }  # fmt: skip

    def _motion(self, n: int) -> dict[str, Array]:
        def of_poses(name: str, *shape: int) -> Array:
            return np.array([getattr(p, name) for p in self.poses[:n]]).reshape(n, 5, *shape)

        rotation = of_poses("rotation", 3, 3)
        return {
            "position": of_poses("position", 3),
            "quaternion": quaternions(rotation),
            "yaw": np.unwrap(np.arctan2(rotation[..., 1, 0], rotation[..., 0, 0]), axis=0),
            "pitch": -np.arcsin(np.clip(rotation[..., 2, 0], -1.0, 1.0)),
            "velocity": of_poses("velocity", 3),
            "angular_velocity": of_poses("angular_velocity", 3),
            "wheel_speed": of_poses("spin")[:, 1:],
            "steering_angle": front_wheel_angles(rotation),
        }


def require_captive(dataset: xr.Dataset, function: str) -> None:
    """Raise ValueError unless a Dataset is the result of a captive run."""
    missing = [name for name in ("force", "moment_smooth", "position") if name not in dataset]
    if missing or "parameters" not in dataset.attrs:
        raise ValueError(
            f"{function}.dataset has no {missing[0] if missing else 'parameters'}; give the result of captive_run (a "
            "file that exumob captive --output wrote)."
        )


@checked
def captive_summary(dataset: xr.Dataset) -> xr.Dataset:
    """Mean and standard deviation of the loads over the second half of a captive run.

    Returns
    -------
    xarray.Dataset
        ``force_mean``, ``moment_mean`` [N, N m] of the raw loads; ``force_deviation``, ``moment_deviation`` of the
        smoothed ones, that is of what the water does; ``force_noise``, ``moment_noise``: standard deviation of the raw
        loads about the smoothed ones. Dims (body, axis).
    """
    require_captive(dataset, "captive_summary")
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
