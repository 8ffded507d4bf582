"""The flow solver: water with a free surface round moving solids, on a grid that follows one of them."""

from __future__ import annotations

import logging
import math
from collections.abc import Sequence
from dataclasses import fields
from typing import Annotated, Any

import numba
import numpy as np
from numpy.typing import NDArray

from exumob.flow.area_fractions import AreaFractions
from exumob.flow.cost import require_room
from exumob.flow.forces import pressure_loads
from exumob.flow.grid import HALO, Grid
from exumob.flow.poses import Poses, interpolate
from exumob.flow.pressure.levels import Levels
from exumob.flow.settings import FlowSettings
from exumob.flow.solids import Solid
from exumob.flow.state import FlowState, Loads, StepReport
from exumob.flow.step import OverTerrain, StepFailed, TimeStep
from exumob.ground.terrain import HEIGHT_RANGE, Terrain
from exumob.support.arrays import Array, checked_array
from exumob.support.compiled import say_compilation
from exumob.support.constants import GRAVITY
from exumob.support.declared import checked
from exumob.support.errors import SimulationError
from exumob.support.quantities import Quantity, shown
from exumob.water.conditions import Water

logger = logging.getLogger(__name__)

INSTANT = Quantity("s", at_least=-1e9, at_most=1e9)
"""Time of the flow"""
HEIGHT = Quantity("m", at_least=HEIGHT_RANGE[0], at_most=HEIGHT_RANGE[1])
CALM_STEPS = 100
"""Steps after which a divided interval is tried undivided again."""
LEAST_STEP = 1e-4
"""Share of sqrt(smallest width / g) below which the Courant number must not press the step."""
MOST_DIVIDED = 16.0
"""Parts of an interval down to which a failing step is halved."""


class FlowSolver:
    """Incompressible flow with a free surface round n solids (paper Eqs. 1-2), over a flat or a given bed.

    Call `start` once with the solids' poses, then `advance` with the poses at the end of each interval.

    Parameters
    ----------
    grid : Grid
        Window in the axes of the followed solid (or of the world).
    solids : sequence of Solid
    water : Water
        A depth counts from z = 0, wherever the bed lies; a field has one level, and a current from place to place.
    settings : FlowSettings
    terrain : Terrain, optional
        The bed, in the world's axes; left out, it is flat at z = 0. It may lie below and above z = 0, and emerge; the
        grid must start at or below the lowest bed on its way. The current must be a flow over this bed at the far sides
        (`exumob.flow.bed.Bed.check_water`).
    deepest : float, optional
        Where the terrain lies lower, the bed is taken at this height [m].
    may_be_dry : bool
        The window may begin on dry land, and come to water later.
    """

    @checked
    def __init__(
        self,
        grid: Grid,
        solids: Sequence[Solid],
        water: Water,
        settings: FlowSettings | None = None,
        terrain: Terrain | None = None,
        deepest: Annotated[float | None, HEIGHT] = None,
        may_be_dry: bool = False,
    ) -> None:
        """Allocate; see the class."""
        self.grid, self.solids, self.water = grid, tuple(solids), water
        self.settings = settings = settings or FlowSettings()
        require_room("FlowSolver: the grid", grid)
        self.metrics = grid.metrics
        top, bottom = float(grid.z_faces[-1]), float(grid.z_faces[0])
        self._step = TimeStep(grid, self.solids, water, settings, OverTerrain(terrain, deepest, may_be_dry))
        self.level = self._step.undisturbed.level
        name = "Water.depth" if water.depth is not None else "Water.level" if water.field is None else "Water.field"
        if not self.has_given_bed and self.level <= bottom:
            raise ValueError(f"{name} = {self.level:g} m does not reach the bed at z = {bottom:g} m; raise it.")
        if self.level > top - (0.0 if settings.closed_top else 2.0 * grid.smallest_width):
            raise ValueError(
                f"{name} = {self.level:g} m does not fit a window {top:g} m high; raise Grid.z_faces to at "
                f"least {bottom + 2.0 * (self.level - bottom):g} m (three times the depth for bow waves)."
            )
        if settings.follow is not None and settings.follow >= len(self.solids):
            raise ValueError(
                f"FlowSettings.follow = {settings.follow}, but there are {len(self.solids)} solids; use None to keep "
                "the grid in place."
            )
        count = len(settings.closure.fields) if settings.closure is not None else 0
        self._state, self._next = (FlowState.zeros(grid.padded_shape, count) for _ in range(2))
        self._start_closure()
        self._poses: Poses | None = None
        say_compilation("the flow solver", pressure_loads, "two to three minutes")

    # -- the interval ---------------------------------------------------------------------------------------------

    def start(self, poses: Poses | None = None, time: float = 0.0) -> None:
        """Fill the window with still or uniformly flowing water round the solids at their poses."""
        poses = self._checked_poses("start", poses if poses is not None else Poses.at_rest(np.zeros((0, 3))))
        time = INSTANT.check("FlowSolver.start.time", time)
        state, step = self._state, self._step
        state.time, state.steps, state.phi_dt, state.step, state.calm = time, 0, 1.0, 0.0, 0
        state.courant_rate = state.volume_added = 0.0
        state.frame[:] = step.frame(poses)
        state.fraction[:] = step.far_field.still[None, :, None]
        far = step.far(state.frame)
        state.u[:], state.v[:], state.w[:] = far.x[:, None, :], far.y[:, None, :], 0.0
        state.phi[:] = 0.0
        state.eta_y[:] = 0.0
        self._start_closure()
        self._poses = poses
        step.place(poses, state.frame, state.steps)
        step.check_water(far, start=True)
        step.complete(state)
        self.loads = Loads.zeros(len(self.solids))

    def set_flow(self, fraction: Array | None = None, velocity: tuple[Array, Array, Array] | None = None) -> None:
        """Replace the water after `start`: fraction [-] and face velocities [m/s], without halo.

        Parameters
        ----------
        fraction : array, shape (ny, nz, nx)
        velocity : three arrays
            Low faces of every cell and the window's high face: (ny, nz, nx + 1), (ny + 1, nz, nx), (ny, nz + 1, nx).
        """
        state, h = self._state, HALO
        ny, nz, nx = self.grid.shape
        if fraction is not None:
            given = checked_array("FlowSolver.set_flow.fraction", fraction, (ny, nz, nx))
            if given.min() < 0.0 or given.max() > 1.0:
                raise ValueError(
                    f"FlowSolver.set_flow.fraction goes from {given.min():g} to {given.max():g}; it must be 0 (air) to "
                    "1 (water)."
                )
            state.fraction[h:-h, h:-h, h:-h] = given
        if velocity is not None:
            if not isinstance(velocity, tuple | list) or len(velocity) != 3:
                raise ValueError("FlowSolver.set_flow.velocity must be three arrays: along x, along y and along z.")
            shapes = (ny, nz, nx + 1), (ny + 1, nz, nx), (ny, nz + 1, nx)
            for axis, q, values, n in zip("xyz", state.velocity, velocity, shapes, strict=True):
                q[h : h + n[0], h : h + n[1], h : h + n[2]] = checked_array(
                    f"FlowSolver.set_flow.velocity along {axis}", values, n
                )
        self._step.complete(state)
        self._step.far_field.split_rise(state.fraction, state.eta_y)

    def advance(self, time: float, poses: Poses | None = None) -> Array:
        """Go on to `time` with the solids moving to `poses`; return the mean loads over the interval.

        Parameters
        ----------
        time : float
            [s], after the present time.
        poses : Poses
            Poses of the solids at `time`; may be left out without solids or with all at rest.

        Returns
        -------
        array, shape (n, 6)
            Force [N], moment [N m] about each solid's origin in its own axes; parts in `loads`, effort in `report`.

        Raises
        ------
        SimulationError
            If a step fails even when divided by 16, or the Courant number asks for ever shorter ones; ``error.state``
            is what `save` gave before the failed step.
        """
        if self._poses is None:
            raise ValueError("FlowSolver.advance: call start(poses) first.")
        begin, t0 = self._poses, self._state.time
        poses = begin if poses is None else self._checked_poses("advance", poses)
        time = INSTANT.check("FlowSolver.advance.time", time)
        interval = time - t0
        if not interval > 0.0:
            raise ValueError(
                f"FlowSolver.advance.time = {time} s is not after the present {t0} s; give a later one, or restore an "
                "earlier state first."
            )
        sums = Loads.zeros(len(self.solids))
        parts, iterations, residual, courant, halvings = 0, 0, 0.0, 0.0, 0
        state, done = self._state, 0.0
        least = min(LEAST_STEP * math.sqrt(self.grid.smallest_width / GRAVITY), interval)
        # a change of the step makes the loads jump for one step (by the slip momentum of small faces): change it seldom
        pieces = math.ceil(interval / state.step - 1e-9) if state.calm < CALM_STEPS and state.step > 0.0 else 1
        numba.set_num_threads(self.settings.threads)
        while done < 1.0 - 1e-12:
            if not self._state.courant_rate * least < self.settings.courant:
                raise self._stopped(f"the flow is too fast for steps of {least:.2e} s")
            wanted = math.ceil(interval * self._state.courant_rate / self.settings.courant - 1e-9)
            self._state.calm = 0 if wanted >= pieces and wanted > 1 else self._state.calm + 1
            pieces = max(pieces, wanted)
            share = min((1.0 - done) / max(1, round((1.0 - done) * pieces)), 1.0 - done)
            end = done + share if done + share < 1.0 - 1e-9 else 1.0
            there = poses if end == 1.0 else interpolate(begin, poses, interval, end)
            dt = (end - done) * interval
            try:
                result = self._step.take(self._state, self._next, dt, there)
            except StepFailed as reason:
                halvings += 1
                pieces = 2 * max(pieces, round(1.0 / share))
                if dt < interval / MOST_DIVIDED * 1.001 and halvings > 4:
                    raise self._stopped(f"{reason} even with a step of {dt:.2e} s") from None
                logger.warning("t = %.4f s: %s; the step is halved", self._state.time, reason)
                self._step.place(self._poses, self._state.frame, self._state.steps)
                continue
            self._state, self._next, self._poses = self._next, self._state, there
            sums = sums.plus(result.loads, end - done)
            parts, iterations = parts + 1, iterations + result.solved.iterations
            residual, courant = max(residual, result.solved.residual), max(courant, result.courant)
            done = end
        self._state.time = time
        self._state.step = interval / pieces
        self.loads = sums
        self.report = StepReport(parts, iterations, residual, courant, halvings)
        return self.loads.total

    def _checked_poses(self, function: str, poses: Poses) -> Poses:
        if not isinstance(poses, Poses):
            raise ValueError(f"FlowSolver.{function}.poses = {shown(poses)} must be Poses, one row for each solid.")
        if len(poses.position) != len(self.solids):
            raise ValueError(
                f"FlowSolver.{function}.poses: {len(poses.position)} poses for {len(self.solids)} solids; give one for "
                "each."
            )
        return poses

    def _stopped(self, reason: str) -> SimulationError:
        failed = SimulationError(
            f"flow solver stopped at t = {self._state.time:.4f} s: {reason}. The state before the step is kept "
            "(SimulationError.state). Look for a solid that jumps or leaves the window; use smaller cells, a smaller "
            "interval, or a larger window."
        )
        failed.state = self.save()
        return failed

    def _start_closure(self) -> None:
        if self.settings.closure is not None:
            for state in (self._state, self._next):
                self.settings.closure.start(state.turbulence, self.settings.viscosity)

    # -- results --------------------------------------------------------------------------------------------------

    @property
    def area_fractions(self) -> AreaFractions:
        """Area fractions that bed and solids together leave open, and the distance to them."""
        return self._step.placement.area_fractions

    @property
    def bodies(self) -> AreaFractions:
        """The same for the solids alone (the same object without a given bed)."""
        return self._step.placement.bodies

    @property
    def levels(self) -> Levels:
        """Multigrid levels of the pressure."""
        return self._step.levels

    @property
    def time(self) -> float:
        """Time reached [s]."""
        return self._state.time

    @property
    def volume_added(self) -> float:
        """Water that the far field has added to the window [m^3]."""
        return self._state.volume_added

    @property
    def frame(self) -> Array:
        """Grid origin x, y [m] and yaw [rad] in the world, shape (3,)."""
        return self._state.frame.copy()

    @property
    def fraction(self) -> Array:
        """Water per full cell [-], shape (ny, nz, nx), a view."""
        return self._state.fraction[HALO:-HALO, HALO:-HALO, HALO:-HALO]

    @property
    def velocity(self) -> tuple[Array, Array, Array]:
        """Velocity on the low x, y, z faces of the cells, grid axes [m/s], each of shape (ny, nz, nx), views."""
        s = self._state
        h = HALO
        return s.u[h:-h, h:-h, h:-h], s.v[h:-h, h:-h, h:-h], s.w[h:-h, h:-h, h:-h]

    @property
    def turbulence(self) -> dict[str, Array]:
        """Fields of the closure by name, and the viscosity [m^2/s] of the last step, shape (ny, nz, nx), views."""
        h, closure = HALO, self.settings.closure
        names = closure.fields if closure is not None else ()
        found = dict(zip(names, self._state.turbulence[:, h:-h, h:-h, h:-h], strict=True))
        return {**found, "viscosity": self._step.viscosity[h:-h, h:-h, h:-h]}

    @property
    def pressure(self) -> Array:
        """Pressure above that of air [Pa], shape (ny, nz, nx); 0 in dry cells."""
        h, s = HALO, self._state
        z = self.metrics.zc[None, h:-h, None]
        gauge = s.phi[h:-h, h:-h, h:-h] / s.phi_dt - GRAVITY * (z - self.level)
        return np.where(s.wet[h:-h, h:-h, h:-h] == 1, self.water.density * gauge, 0.0)

    def surface_height(self) -> Array:
        """Height of the water's surface above z = 0 in each column [m], shape (ny, nx).

        Where a given bed is dry it is the height of the bed; in solids it has no meaning.
        """
        if not self.has_given_bed:
            return float(self.grid.z_faces[0]) + np.einsum("jki,k->ji", self.fraction, np.diff(self.grid.z_faces))
        heights, z = self.bed_height(), self.grid.z_faces
        lowest = np.clip(np.searchsorted(z, heights, side="right") - 1, 0, len(z) - 2)
        counted = np.arange(len(z) - 1)[:, None] >= lowest[:, None]
        level = z[lowest] + np.einsum("jki,k->ji", np.where(counted, self.fraction, 0.0), np.diff(z))
        return np.maximum(level, heights)

    @property
    def has_given_bed(self) -> bool:
        """True if the bed is other than the window's lowest face."""
        return self._step.placement.bed is not None

    def bed_height(self) -> Array:
        """Height of the bed below the middle of each column [m], shape (ny, nx)."""
        return self._step.placement.bed_heights[HALO:-HALO, HALO:-HALO].copy()

    def water_volume(self) -> float:
        """Water in the window outside solids [m^3]."""
        h, o = HALO, self.bodies
        share = (o.bx[:, :, :-1] + o.bx[:, :, 1:])[h:-h, h:-h, h : -h + 1]
        share = share + (o.by[:-1] + o.by[1:])[h : -h + 1, h:-h, h:-h]
        share = share + (o.bz[:, :-1] + o.bz[:, 1:])[h:-h, h : -h + 1, h:-h]
        if self.has_given_bed:
            z = self.grid.z_faces[:, None]
            share *= np.clip((z[1:] - self.bed_height()[:, None]) / np.diff(z, axis=0), 0.0, 1.0)
        return float(np.sum(self.fraction * share / 6.0 * self.grid.cell_volumes()))

    # -- save and restore -----------------------------------------------------------------------------------------

    def save(self) -> dict[str, Any]:
        """Everything needed to go on from here bit for bit: plain numbers and arrays (copies)."""
        state = {f.name: getattr(self._state, f.name) for f in fields(FlowState)}
        saved = {name: value.copy() if isinstance(value, np.ndarray) else value for name, value in state.items()}
        if self._poses is not None:
            for f in fields(Poses):
                saved[f"poses_{f.name}"] = getattr(self._poses, f.name).copy()
        return saved

    def restore(self, saved: dict[str, Any]) -> None:
        """Return to a state given by `save` (of a solver with the same grid, solids, water and settings)."""
        shape: NDArray[Any] = saved["fraction"]
        if shape.shape != self.grid.padded_shape:
            raise ValueError(
                f"FlowSolver.restore: the state is of shape {shape.shape}, the grid {self.grid.padded_shape}; restore "
                "it to a solver with the grid that it was saved with."
            )
        self._state.copy_from(FlowState(**{f.name: saved[f.name] for f in fields(FlowState)}))
        self._poses = Poses(**{f.name: saved[f"poses_{f.name}"].copy() for f in fields(Poses)})
        self._step.place(self._poses, self._state.frame, self._state.steps)
