"""The interface of flow codes that are coupled with the vehicle, and the built-in flow solver behind it.

A flow code advances in time with the moving bodies. Any commercial or in-house code that offers the five functions of
`FlowCode` drives the same runs as the built-in solver: ``CfdHydrodynamics(flow=...)`` does everything else (spin-up,
coupling, checkpoints). A code in another process or on another machine is reached by `exumob.coupling.remote`.
"""

from __future__ import annotations

from dataclasses import asdict
from typing import Annotated, Any, Protocol, runtime_checkable

import xarray as xr

from exumob.flow.cost import FlowCost, flow_cost, require_room
from exumob.flow.grid import CELL_SIZE as CELL_WIDTH
from exumob.flow.grid import Grid
from exumob.flow.output.snapshots import Snapshot, snapshots_dataset
from exumob.flow.poses import Poses
from exumob.flow.resolution import checked_solids
from exumob.flow.settings import FlowSettings
from exumob.flow.solids import Solid
from exumob.flow.solver import FlowSolver
from exumob.flow.step import OverTerrain
from exumob.flow.undisturbed import flow_water, is_uniform, require_one_level
from exumob.flow.vehicle_window import settings_for_vehicle, vehicle_window, window_over_terrain
from exumob.ground.terrain import Terrain
from exumob.support.arrays import Array
from exumob.support.declared import checked
from exumob.support.quantities import Quantity
from exumob.vehicle.parameters import Vehicle
from exumob.water.conditions import Water

CELL_SIZE = 0.0115
"""Default cell size round the vehicle [m]: two cells in the gap between the hull and a front wheel at full lock."""


@runtime_checkable
class FlowCode(Protocol):
    """A flow code as the coupling sees it: the motion of n bodies in, n wrenches out (the vehicle: n = 5).

    `Poses` hold positions and velocities of all bodies at one instant, in world axes (z up, z = 0 the bed) about each
    body's origin (the hull's centre of mass, the wheels' centres), in the order of `exumob.vehicle.motion.BODIES`. An
    attribute ``parameters`` (a dict) is optional: it is kept in the result and compared when a run is resumed.

    Examples
    --------
    The smallest flow code exerts no wrench at all:

    >>> class NoFlow:
    ...     def start(self, vehicle, water, poses, time): pass
    ...     def advance(self, time, poses): return np.zeros((len(poses.position), 6))
    ...     def save(self): return {}
    ...     def restore(self, saved): pass
    ...     def report(self): return {}

    `examples/external_flow/stand_in.py` is one with buoyancy, drag and added mass.
    """

    def start(self, vehicle: Vehicle, water: Water, poses: Poses, time: float) -> None:
        """Fill the domain with the undisturbed current round the bodies.

        The function is called once before anything runs, with the vehicle at ride height, so that input that cannot be
        run is refused early; then at the begin of every spin-up; and before `restore` when a run is resumed.

        Parameters
        ----------
        vehicle : Vehicle
            Its shapes and sizes.
        water : Water
            Depth, current and density.
        poses : Poses
            Where the bodies are, and how they move.
        time : float
            Time at which the flow begins [s]; negative: before the release at 0.

        Raises
        ------
        ValueError
            If the code cannot run this; the text names the remedy.
        """

    def advance(self, time: float, poses: Poses) -> Array:
        """Go on to a time with the bodies moving to new poses; called at least once a macro step.

        Parameters
        ----------
        time : float
            End of the interval [s]; it begins where the last call ended.
        poses : Poses
            Poses and velocities at that time. The code chooses its own time steps and the motion in between.

        Returns
        -------
        array, shape (n, 6)
            Mean wrench over the interval on each body: force [N] and moment about the body's origin [N m], both in the
            body's own axes. It must be a mean: impulse that it leaves out is lost to vehicle and water
            together.

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
        """Return to a state given by `save`: the same `advance` must give the same wrenches, bit for bit."""

    def report(self) -> dict[str, float]:
        """Return figures of the last `advance` for the result, such as iterations and residual.

        The names must always be the same, the values finite; the dict may be empty. The result holds them under
        ``hydrodynamics_<name>``. Two are made use of: ``courant``, the largest Courant number of the code's own steps,
        and ``steps``, the number of these; macro steps that follow the flow
        (`exumob.coupling.macro_step.FollowFlow`) are chosen by their product.
        """


@runtime_checkable
class BedFlowCode(FlowCode, Protocol):
    """A flow code that knows water over uneven ground, and a current that differs from place to place."""

    def set_bed(self, terrain: Terrain, place: tuple[float, float], reach: float) -> None:
        """Take the ground of the run to come; before the first call it is level at z = 0.

        Called before the first `start`. Level and current at each place are told by
        `exumob.water.conditions.Water.at` with this ground.

        Parameters
        ----------
        terrain : Terrain
        place : (float, float)
            Where the vehicle starts, world x and y [m].
        reach : float
            How far it can come from there [m], about.
        """


class BuiltInFlow:
    """The built-in flow solver (`exumob.flow.FlowSolver`) round a vehicle.

    Parameters
    ----------
    cell_size : float
        Cell size of the grid round the vehicle [m].
    grid : Grid, optional
        Default: `exumob.flow.vehicle_window.vehicle_window`, the window of captive runs.
    settings : FlowSettings, optional
        `follow` must be 0: the window follows the hull.
    allow_coarse : bool
        Warn instead of refusing when the cells are too coarse for gaps and wheels.
    snapshots : float, optional
        Interval at which the free surface is kept from the release on [s], for `exumob.flow.output.pictures`.
    """

    @checked
    def __init__(
        self,
        cell_size: Annotated[float, CELL_WIDTH] = CELL_SIZE,
        *,
        grid: Grid | None = None,
        settings: FlowSettings | None = None,
        allow_coarse: bool = False,
        snapshots: Annotated[float | None, Quantity("s", at_least=1e-6, at_most=1e6)] = None,
    ) -> None:
        settings = FlowSettings() if settings is None else settings
        if settings.follow != 0:
            raise ValueError(f"BuiltInFlow.settings: FlowSettings.follow = {settings.follow}; it must be 0, the hull.")
        self.cell_size, self.grid, self.settings, self.allow_coarse = cell_size, grid, settings, allow_coarse
        self.parameters = {
            "cell_size": cell_size, "grid": None if grid is None else asdict(grid), "settings": asdict(settings),
            "closure": type(settings.closure).__name__, "allow_coarse": allow_coarse, "snapshots": snapshots,
        }  # fmt: skip
        """The chosen settings, as kept in results."""
        self.interval = snapshots
        self.snapshots: list[Snapshot] = []
        self.steering_range: tuple[float, float] | None = None
        """Smallest and largest angle of a front wheel during the run [rad]; None: up to the vehicle's limit"""
        self._ground: tuple[Terrain, tuple[float, float], float] | None = None
        self._checked_for: tuple[Any, ...] | None = None
        self._solver_of: tuple[Any, ...] | None = None

    def set_bed(self, terrain: Terrain, place: tuple[float, float], reach: float) -> None:
        """See `BedFlowCode`."""
        self._ground = terrain, place, reach

    def start(self, vehicle: Vehicle, water: Water, poses: Poses, time: float) -> None:
        """Build grid and solids, unless they are those of the last start, and fill the window. See `FlowCode`.

        Raises
        ------
        ValueError
            If the cells cannot resolve a gap or a wheel at any angle that the front wheels take during the run.
        """
        grid, solids, bed = self._checked_solids(vehicle, water)
        if self._solver_of != self._checked_for:
            settings = settings_for_vehicle(vehicle, self.settings)
            self.solver = FlowSolver(grid, solids, flow_water(water, bed.terrain), settings, *bed)
            self._solver_of = self._checked_for
        self.solver.start(poses, time)
        self.snapshots = []

    def cost(self, vehicle: Vehicle, water: Water, speed: float, duration: float, interval: float) -> FlowCost:
        """Estimate what a run takes; see `exumob.flow.cost.flow_cost`.

        Raises
        ------
        ValueError
            If there is no memory for it, or as `start`.
        """
        grid, *_ = self._checked_solids(vehicle, water)
        settings = self.settings
        return flow_cost(
            grid.n_cells, grid.smallest_width, speed, duration, interval, settings.courant, settings.threads
        )

    def _checked_solids(self, vehicle: Vehicle, water: Water) -> tuple[Grid, tuple[Solid, ...], OverTerrain]:
        """Return grid, solids and bed after all checks, made anew if vehicle, water, ground or angles have changed."""
        angles = self.steering_range
        if angles is None:
            limit = vehicle.steering.limit
            largest = [m[0] for command in (-limit, limit) for m in vehicle.steering_angles((command, 0.0, 0.0))]
            angles = min(largest), max(largest)
        if self._checked_for != (vehicle, water, angles, self._ground):
            grid, bed = self._window(vehicle, water)
            require_room("BuiltInFlow.grid", grid)
            self._built = grid, checked_solids(vehicle, grid, angles, self.allow_coarse), bed
            self._checked_for = vehicle, water, angles, self._ground
        return self._built

    def _window(self, vehicle: Vehicle, water: Water) -> tuple[Grid, OverTerrain]:
        """Grid and bed."""
        terrain, place, reach = self._ground or (Terrain(), (0.0, 0.0), 0.0)
        if is_uniform(water, terrain):
            water = flow_water(water, terrain)
            return vehicle_window(vehicle, self.cell_size, water) if self.grid is None else self.grid, OverTerrain()
        require_one_level(water, terrain)
        water = flow_water(water, terrain)
        if self.grid is not None:
            return self.grid, OverTerrain(terrain, may_be_dry=True)
        grid, deepest = window_over_terrain(vehicle, self.cell_size, water, terrain, place, reach)
        return grid, OverTerrain(terrain, deepest, True)

    def advance(self, time: float, poses: Poses) -> Array:
        """See `FlowCode`."""
        wrenches = self.solver.advance(time, poses)
        if self.interval is not None and time >= (len(self.snapshots) * self.interval) - 1e-9:
            self.snapshots.append(Snapshot.of(self.solver, poses))
        return wrenches

    def save(self) -> dict[str, Any]:
        """See `FlowCode`."""
        return {"solver": self.solver.save(), "snapshots": [s.state() for s in self.snapshots]}

    def restore(self, saved: dict[str, Any]) -> None:
        """See `FlowCode`."""
        self.solver.restore(saved["solver"])
        self.snapshots = [Snapshot(**s) for s in saved["snapshots"]]

    def report(self) -> dict[str, float]:
        """Return sub-steps, pressure iterations, residual, Courant number, halvings, water that the far field added."""
        return asdict(self.solver.report) | {"volume_added": self.solver.volume_added}

    def record(self) -> dict[str, xr.DataArray]:
        """Return the snapshots, as `exumob.flow.output.snapshots.snapshots_dataset` gives them."""
        found = snapshots_dataset(self.solver.grid, self.snapshots) if self.snapshots else xr.Dataset()
        return {str(name): value for name, value in found.data_vars.items()}
