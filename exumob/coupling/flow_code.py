"""What a flow code must offer to be coupled with the vehicle, and the own flow solver behind it.

Five functions, nothing else: a commercial or in-house code that has them drives the same runs as the own one
(`CfdHydrodynamics(flow=...)`). A code in another process or on another machine: `exumob.coupling.remote`.
"""

from __future__ import annotations

from dataclasses import asdict
from typing import Any, Protocol

import xarray as xr

from exumob.flow.grid import Grid
from exumob.flow.output.snapshots import Snapshot, snapshots_dataset
from exumob.flow.resolution import checked_solids
from exumob.flow.settings import FlowSettings
from exumob.flow.solids import Poses
from exumob.flow.solver import FlowSolver
from exumob.flow.vehicle_window import vehicle_window
from exumob.support.arrays import Array
from exumob.support.checks import require_positive
from exumob.vehicle.parameters import Vehicle
from exumob.water.conditions import Water

CELL_SIZE = 0.0115
"""Of the grid round the vehicle [m]: two cells in the gap between the hull and a front wheel at full lock."""


class FlowCode(Protocol):
    """A flow code as the coupling sees it: n moving bodies in, n wrenches out (the vehicle: n = 5).

    `Poses` are world axes (z up, z = 0 the bed) about each body's origin: the hull's centre of mass, the wheels'
    centres; order of `exumob.vehicle.motion.BODIES`. An attribute ``parameters`` (a dict) puts a code's settings into the
    result and into checkpoints.
    """

    def start(self, vehicle: Vehicle, water: Water, poses: Poses, time: float) -> None:
        """Fill the domain with the undisturbed current round the bodies at their poses, at a time [s].

        Called for every new run, and once before anything runs with the vehicle at ride height, so that input that
        cannot be run is refused early (`ValueError`); also before `restore` when a run is resumed.
        """

    def advance(self, time: float, poses: Poses) -> Array:
        """Go on to `time` [s] with the bodies moving to `poses` there; return the mean loads over the interval.

        Returns
        -------
        array, shape (n, 6)
            Force [N] and moment about the body's origin [N m], both in the body's own axes. Means: what they leave out
            of the impulse would be lost to vehicle and water together.

        Raises
        ------
        SimulationError
            If the flow cannot go on.
        """

    def save(self) -> Any:
        """Return all that the next `advance` depends on: dicts, lists, arrays, numbers and text.

        The strongly coupled scheme asks for it every macro step, the semi-implicit one four times a second; a run with
        checkpoints every ten macro steps (less often if it takes long) and every half second. A code with restart files
        of its own may return their names; those of every half second must stay.
        """

    def restore(self, saved: Any) -> None:
        """Return to a state given by `save`: the same `advance` must give the same loads, bit for bit."""

    def report(self) -> dict[str, float]:
        """Figures of the last `advance` for the result, always the same names; may be empty."""


class BuiltInFlow:
    """The own flow solver (`exumob.flow.FlowSolver`) round a vehicle.

    Parameters
    ----------
    cell_size : float
        Of the grid round the vehicle [m].
    grid : Grid, optional
        Default: `exumob.flow.vehicle_window.vehicle_window`, the window of captive runs.
    settings : FlowSettings, optional
        `follow` must be 0: the window follows the hull.
    allow_coarse : bool
        Warn instead of refusing when the cells are too coarse for gaps and wheels.
    snapshots : float, optional
        Interval at which the free surface is kept from the release on [s], for `exumob.flow.output.pictures`.
    """

    def __init__(
        self, cell_size: float = CELL_SIZE, *, grid: Grid | None = None, settings: FlowSettings | None = None,
        allow_coarse: bool = False, snapshots: float | None = None,
    ) -> None:  # fmt: skip
        require_positive("BuiltInFlow", cell_size=cell_size, **({} if snapshots is None else {"snapshots": snapshots}))
        settings = FlowSettings() if settings is None else settings
        if settings.follow != 0:
            raise ValueError(f"BuiltInFlow.settings: FlowSettings.follow = {settings.follow}; it must be 0, the hull.")
        self.cell_size, self.grid, self.settings, self.allow_coarse = cell_size, grid, settings, allow_coarse
        self.parameters = {
            "cell_size": cell_size, "grid": None if grid is None else asdict(grid), "settings": asdict(settings),
            "closure": type(settings.closure).__name__, "allow_coarse": allow_coarse, "snapshots": snapshots,
        }  # fmt: skip
        """What was chosen, as kept in results."""
        self.interval = snapshots
        self.snapshots: list[Snapshot] = []
        self._built: tuple[Vehicle, Water] | None = None

    def start(self, vehicle: Vehicle, water: Water, poses: Poses, time: float) -> None:
        """Build grid and solids, unless they are those of the last start, and fill the window. See `FlowCode`.

        Raises
        ------
        ValueError
            If the cells cannot resolve a gap or a wheel at any angle that the front wheels can take.
        """
        if self._built != (vehicle, water):
            grid = vehicle_window(vehicle, self.cell_size, water) if self.grid is None else self.grid
            limit = vehicle.steering.limit
            angles = [m[0] for command in (-limit, limit) for m in vehicle.steering_angles((command, 0.0, 0.0))]
            solids = checked_solids(vehicle, grid, (min(angles), max(angles)), self.allow_coarse)
            self.solver = FlowSolver(grid, solids, water, self.settings)
            self._built = vehicle, water
        self.solver.start(poses, time)
        self.snapshots = []

    def advance(self, time: float, poses: Poses) -> Array:
        """See `FlowCode`."""
        loads = self.solver.advance(time, poses)
        if self.interval is not None and time >= (len(self.snapshots) * self.interval) - 1e-9:
            self.snapshots.append(Snapshot.of(self.solver, poses))
        return loads

    def save(self) -> dict[str, Any]:
        """See `FlowCode`."""
        return {"solver": self.solver.save(), "snapshots": [dict(vars(s)) for s in self.snapshots]}

    def restore(self, saved: dict[str, Any]) -> None:
        """See `FlowCode`."""
        self.solver.restore(saved["solver"])
        self.snapshots = [Snapshot(**s) for s in saved["snapshots"]]

    def report(self) -> dict[str, float]:
        """Sub-steps, pressure iterations and what they left, Courant number, halvings, water added by the far field."""
        return asdict(self.solver.report) | {"volume_added": self.solver.volume_added}

    def record(self) -> dict[str, xr.DataArray]:
        """The snapshots, as `exumob.flow.output.snapshots.snapshots_dataset` gives them."""
        found = snapshots_dataset(self.solver.grid, self.snapshots) if self.snapshots else xr.Dataset()
        return {str(name): value for name, value in found.data_vars.items()}
