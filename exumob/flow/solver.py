"""The flow solver: water with a free surface round moving solids, on a grid that follows one of them."""

from __future__ import annotations

import logging
import math
from collections.abc import Sequence
from dataclasses import fields
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from exumob.flow import (
    active_rows as spans,
)
from exumob.flow import (
    advection,
    bed,
    forces,
    tread,
)
from exumob.flow import (
    far_field as boundary,
)
from exumob.flow import (
    free_surface as interface,
)
from exumob.flow import (
    velocity_extension as extension,
)
from exumob.flow.active_rows import ActiveRows
from exumob.flow.grid import HALO, Grid
from exumob.flow.pressure import assembly as pressure
from exumob.flow.settings import FlowSettings
from exumob.flow.solids import AreaFractions, Poses, Solid, clear, index_region, place_solid
from exumob.flow.state import FlowState, Loads, Placed, StepReport, interpolate
from exumob.flow.turbulence import closures as turbulence
from exumob.flow.turbulence import wall
from exumob.ground.terrain import Terrain
from exumob.support.arrays import Array
from exumob.support.constants import GRAVITY
from exumob.support.errors import SimulationError
from exumob.support.rotations import about_z
from exumob.water.conditions import Water

logger = logging.getLogger(__name__)

SWEEPS = ((0, 1, 2), (2, 1, 0), (1, 2, 0), (0, 2, 1), (2, 0, 1), (1, 0, 2))
"""Orders of the three sweeps that carry the fraction, in turn."""
CALM_STEPS = 100
"""Steps after which a divided interval is tried undivided again."""
LEAST_STEP = 1e-4
"""Share of sqrt(smallest width / g) below which the Courant number must not press the step."""


class FlowSolver:
    """Incompressible flow with a free surface round n solids (paper Eqs. 1-2), over a flat or a given bed.

    Call `start` once with the solids' poses, then `advance` with the poses at the end of each interval.

    Parameters
    ----------
    grid : Grid
        Window in the axes of the followed solid (or of the world).
    solids : sequence of Solid
    water : Water
        Depth above z = 0 (that is the still level, wherever the bed lies), current and density.
    settings : FlowSettings
    terrain : Terrain, optional
        The bed, in the world's axes; left out, it is flat at z = 0. It may lie below and above z = 0, and emerge; the
        grid must start at or below the lowest bed on its way. With a current the bed must be level at the far sides,
        or level along the current (`exumob.flow.bed.Bed.check_water`).

    Attributes
    ----------
    area_fractions, bodies : AreaFractions
        What bed and solids leave open, and what the solids alone do (the same object without a given bed).
    """

    def __init__(
        self,
        grid: Grid,
        solids: Sequence[Solid],
        water: Water,
        settings: FlowSettings | None = None,
        terrain: Terrain | None = None,
    ) -> None:
        """Allocate; see the class."""
        self.grid, self.solids, self.water = grid, tuple(solids), water
        self.settings = settings = settings or FlowSettings()
        self.metrics = grid.metrics
        top, bottom = float(grid.z_faces[-1]), float(grid.z_faces[0])
        self._bed = _given_bed(grid, terrain, len(self.solids), settings)
        if self._bed is None and water.depth <= bottom:
            raise ValueError(f"Water.depth = {water.depth} m does not reach the bed at z = {bottom:g} m; raise it.")
        if water.depth > top - (0.0 if settings.closed_top else 2.0 * grid.smallest_width):
            raise ValueError(
                f"Water.depth = {water.depth} m does not fit a window {top:g} m high; raise Grid.z_faces to at least "
                f"{2.0 * water.depth:g} m (three times the depth for bow waves)."
            )
        if settings.follow is not None and settings.follow >= len(self.solids):
            raise ValueError(
                f"FlowSettings.follow = {settings.follow}, but there are {len(self.solids)} solids; use "
                f"None to keep the "
                "grid in place."
            )
        shape = grid.padded_shape
        count = len(settings.closure.fields) if settings.closure is not None else 0
        self._state, self._next = FlowState.zeros(shape, count), FlowState.zeros(shape, count)
        self._start_closure()
        self.area_fractions = self.bodies = AreaFractions.open(shape)
        if self._bed is not None:
            alone = self.bodies
            self.area_fractions = AreaFractions.open(shape)._replace(ax=alone.ax, ay=alone.ay, az=alone.az)
        self._bed_heights = np.full((shape[0], shape[2]), bottom) if self._bed is None else self._bed.heights
        self.levels = pressure.Levels(self.metrics)
        self._flow = np.zeros(shape), np.zeros(shape), np.zeros(shape)
        self._change = np.zeros(shape), np.zeros(shape), np.zeros(shape)
        self._theta = tuple(np.ones(shape) for _ in range(3))
        unknown = np.full(shape, interface.UNKNOWN)
        self._orientation = unknown, unknown.copy(), unknown.copy()
        self._label = np.zeros(shape, dtype=np.uint8)
        # spans of the wet cells, of these one cell wider, and of all water 1, 2 and 4 cells wider
        self._wet, self._active, self._cells, self._faces, self._near = (ActiveRows.empty(shape) for _ in range(5))
        self._water = ActiveRows.empty(shape)
        self._scratch = np.zeros(shape)
        self._viscosity = np.full(shape, settings.viscosity)
        self._rows = np.zeros(shape[0])
        self._still = boundary.level_fractions(self.metrics, water.depth)
        self._rates = self._absorbing_rates(np.zeros(2))
        self._friction = np.array([s.friction for s in self.solids])
        self._treads = tread.tread_table(self.solids)
        self._regions = np.zeros((len(self.solids), 6), dtype=np.int64)
        self._walls = self._regions  # with a given bed: one row more
        self._box: tuple[slice, ...] = (slice(0, 0),) * 3  # round all solids and a given bed
        self._poses: Poses | None = None

    def _absorbing_rates(self, flow: Array) -> boundary.Rates:
        """Rates of the far field's zones; `flow`: undisturbed, relative to the grid [m/s]."""
        s = self.settings
        depth = max(self.water.depth - float(self.grid.z_faces[0]), self.water.depth)
        return boundary.absorbing_rates(
            self.metrics, (s.far_x, s.far_y), flow, math.sqrt(GRAVITY * depth), s.absorbing_width, s.absorbing_strength
        )  # fmt: skip

    # -- the interval ---------------------------------------------------------------------------------------------

    def start(self, poses: Poses | None = None, time: float = 0.0) -> None:
        """Fill the window with still or uniformly flowing water round the solids at their poses."""
        poses = poses if poses is not None else Poses.at_rest(np.zeros((0, 3)))
        if len(poses.position) != len(self.solids):
            raise ValueError(f"start: {len(poses.position)} poses for {len(self.solids)} solids; give one for each.")
        state = self._state
        state.time, state.steps, state.phi_dt, state.step, state.calm = time, 0, 1.0, 0.0, 0
        state.courant_rate = state.volume_added = 0.0
        state.frame[:] = self._frame(poses)
        state.fraction[:] = self._still[None, :, None]
        far = self._far(state.frame[2])
        for q, value in zip((state.u, state.v, state.w), far, strict=True):
            q[:] = value
        state.phi[:] = 0.0
        state.eta_y[:] = 0.0
        self._start_closure()
        self._poses = poses
        self._place(poses, state.frame)
        if self._bed is not None:
            self._bed.check_water(self.water, far, self._far_zone(), start=True)
        self._fill(state, far)
        self._complete_velocity(state)
        self.loads = Loads(*(np.zeros((len(self.solids), 6)) for _ in range(3)))

    def set_flow(self, fraction: Array | None = None, velocity: tuple[Array, Array, Array] | None = None) -> None:
        """Replace the water after `start`: fraction [-] and face velocities [m/s], without halo.

        Parameters
        ----------
        fraction : array, shape (ny, nz, nx)
        velocity : three arrays
            Low faces of every cell and the window's high face: (ny, nz, nx + 1), (ny + 1, nz, nx), (ny, nz + 1, nx).
        """
        state, h = self._state, HALO
        if fraction is not None:
            state.fraction[h:-h, h:-h, h:-h] = fraction
        if velocity is not None:
            for q, values in zip((state.u, state.v, state.w), velocity, strict=True):
                n = values.shape
                q[h : h + n[0], h : h + n[1], h : h + n[2]] = values
        self._fill(state, self._far(state.frame[2]))
        self._complete_velocity(state)
        boundary.split_rise(
            state.fraction, self.water.depth, self._bed_heights, self._rates, self.metrics, state.eta_y
        )  # fmt: skip

    def advance(self, time: float, poses: Poses | None = None) -> Array:
        """Go on to `time` with the solids moving to `poses`; return the mean loads over the interval.

        Parameters
        ----------
        time : float
            [s], after the present time.
        poses : Poses
            Of the solids at `time`; may be left out without solids or with all at rest.

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
        poses = poses if poses is not None else begin
        interval = time - t0
        if not interval > 0.0:
            raise ValueError(f"FlowSolver.advance: time {time} s is not after the present {t0} s.")
        sums = np.zeros((3, len(self.solids), 6))
        parts, iterations, residual, courant, halvings = 0, 0, 0.0, 0.0, 0
        state, done = self._state, 0.0
        least = min(LEAST_STEP * math.sqrt(self.grid.smallest_width / GRAVITY), interval)
        # a change of the step makes the loads jump for one step (by what small faces exchange): change it seldom
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
            outcome = self._step(dt, there)
            if isinstance(outcome, str):
                halvings += 1
                pieces = 2 * max(pieces, round(1.0 / share))
                if dt < interval / 16.0 * 1.001 and halvings > 4:
                    raise self._stopped(f"{outcome} even with a step of {dt:.2e} s")
                logger.warning("t = %.4f s: %s; the step is halved", self._state.time, outcome)
                self._place(self._poses, self._state.frame)
                continue
            loads, solved, number = outcome
            sums += (end - done) * loads
            parts, iterations = parts + 1, iterations + solved.iterations
            residual, courant = max(residual, solved.residual), max(courant, number)
            done = end
        self._state.time = time
        self._state.step = interval / pieces
        self.loads = Loads(sums[0], sums[1], sums[2])
        self.report = StepReport(parts, iterations, residual, courant, halvings)
        return self.loads.total

    def _stopped(self, reason: str) -> SimulationError:
        failed = SimulationError(
            f"flow solver stopped at t = {self._state.time:.4f} s: {reason}. The state before the step is kept "
            "(SimulationError.state). Look for a solid that jumps or leaves the window; use smaller cells, a smaller "
            "interval, or a larger window."
        )
        failed.state = self.save()
        return failed

    # -- one step -------------------------------------------------------------------------------------------------

    def _step(self, dt: float, poses: Poses) -> tuple[Array, pressure.Outcome, float] | str:
        """One time step; loads (3, n, 6), pressure outcome and Courant number, or why it failed."""
        old, new, m, s = self._state, self._next, self.metrics, self.settings
        frame = self._frame(poses)
        frame[2] = old.frame[2] + math.remainder(frame[2] - old.frame[2], 2.0 * math.pi)
        drift = self._drift(old.frame, frame, dt)
        far = self._far(frame[2])
        velocity, out, carrying = old.velocity, new.velocity, new.carrying
        loads = np.zeros((3, len(self.solids), 6))

        # faces hardly open have hardly any velocity of their own (solids still where the last step left them)
        kept = [q[self._box].copy() for q in velocity]
        loads[2] = self._blend(dt)

        def fail(reason: str) -> str:
            for q, values in zip(velocity, kept, strict=True):
                q[self._box] = values
            return reason

        # solids and water where they are now
        placed = self._place(poses, frame)
        area_fractions, regions = self.area_fractions, self._regions
        faces = (area_fractions.bx, area_fractions.by, area_fractions.bz)
        fraction = new.fraction
        fraction[:] = old.fraction
        new.eta_y[:] = old.eta_y
        self._rates = self._absorbing_rates(far[:2] - drift[:2])
        interface.release_surface(  # not of the bed: it is at rest like the water, whatever the grid does
            fraction, self._scratch, area_fractions, regions, placed.position, placed.velocity, placed.rate, drift, dt, m
        )  # fmt: skip
        interface.refill_solids(fraction, area_fractions.distance, regions, m, s.refill_depth)
        if self._bed is not None:
            self._bed.refill(fraction, area_fractions)
        self._fill_fraction(fraction)
        self._find_water(new)

        # momentum: turning axes, advection, eddy stress, wall shear, far field
        advection.turn(*velocity, out, frame[2] - old.frame[2], self._near)
        advection.relative_velocity(self._flow, old.carrying, drift, self._near, m)
        for axis in range(3):
            advection.advect(
                out[axis], velocity[axis], self._flow, new.wet, faces[axis], axis, dt, self._active, m
            )  # fmt: skip
        if s.closure is not None:
            bounds = turbulence.Walls(
                area_fractions._replace(distance=self.bodies.distance, nearest=self.bodies.nearest), placed.position,
                placed.velocity, placed.rate + placed.spin, self._friction * s.wall_shear,
                -1.0 if s.bed_roughness is None else s.bed_roughness,
            )  # fmt: skip
            s.closure.update(
                self._viscosity, old.turbulence, new.turbulence, *velocity, self._flow, new.wet, bounds, self._active,
                self._near, dt, s.viscosity, m,
            )  # fmt: skip
        if s.closure is not None or s.viscosity > 0.0:
            for axis in range(3):
                turbulence.add_stress(
                    out[axis], self._viscosity, velocity, new.wet, faces[axis], axis, dt, self._active, m
                )  # fmt: skip
        if s.wall_shear and len(self.solids):
            forces.wall_shear(
                self._change, *out, fraction, new.wet, area_fractions, regions, placed.position, placed.velocity,
                placed.rate, placed.spin, self._friction, self.water.density, dt, m, loads[1],
            )  # fmt: skip
            forces.add_and_clear(out, self._change, regions)
        if self._treads.any():
            tread.push(
                self._change, *out, fraction, new.wet, area_fractions, regions, placed.position, placed.velocity,
                placed.rate, np.ascontiguousarray(placed.rotation[:, :, 1]), placed.spin, self._treads,
                self.water.density, dt, m, loads[1],
            )  # fmt: skip
            forces.add_and_clear(out, self._change, regions)
        if s.bed_roughness is not None and self._bed is not None:
            bed.shear(
                out, old.u, old.v, fraction, faces[:2], self._bed.heights, int(self._bed.region[3]), s.bed_roughness,
                s.viscosity, dt, m,
            )  # fmt: skip
        elif s.bed_roughness is not None:
            wall.bed_shear(
                out, old.u, old.v, fraction, new.wet, faces[:2], s.bed_roughness, s.viscosity, dt, m
            )  # fmt: skip
        if s.far_x or s.far_y:
            boundary.relax_velocity(*out[:2], far, self._rates, dt, self._near)
        boundary.fill_velocity(*out, far, s.far_x, s.far_y, s.closed_top)

        # pressure
        np.multiply(old.phi, dt / old.phi_dt, out=new.phi)
        pressure.assemble(
            *out, fraction, new.wet, area_fractions, self._bed is not None, m, dt, self.water.depth, s.closest_surface,
            s.void_stiffness, self._wet, *self._theta, self.levels.levels[0], self.levels.rhs,
        )  # fmt: skip
        solved = pressure.solve(self.levels, new.phi, m, dt, self._wet, s.tolerance, s.iterations, s.closed_top)
        if not solved.converged and not solved.residual < 1e3 * s.tolerance:
            return fail(f"the pressure did not converge (divergence times step {solved.residual:.1e})")
        pressure.project(*out, new.phi, new.wet, area_fractions, m, dt, self.water.depth, self._wet, *self._theta)

        # free surface: extended velocity, transport, far field
        for axis in range(3):
            extension.extend(
                new.extended[axis], out[axis], new.wet, faces[axis], fraction, axis, far[axis], dt, self._near,
                self._label,
            )  # fmt: skip
        if self._bed is not None:
            self._bed.stop(new.wet, area_fractions, out, new.extended)
        boundary.fill_velocity(*out, far, s.far_x, s.far_y, s.closed_top)
        advection.full_velocity(carrying, out, area_fractions, self._near)
        self._fill_carrying(carrying, far)
        advection.relative_velocity(self._flow, carrying, drift, self._near, m)
        advection.largest_courant(self._flow, fraction, m, self._near, self._rows)
        new.courant_rate = float(self._rows.max())
        if not new.courant_rate * dt < 2.0 * s.courant:
            return fail(f"the Courant number reached {new.courant_rate * dt:.2g}")
        begin = self.levels.rhs  # free by now
        begin[:] = fraction
        if s.far_x or s.far_y:
            boundary.gather_rise(
                new.eta_y, new.v, fraction, area_fractions.by, far[1], drift, self.water.depth, self._bed_heights,
                self._rates, dt, m,
            )  # fmt: skip
        interface.transport(
            fraction, begin, self._flow, SWEEPS[old.steps % len(SWEEPS)], dt,
            self._orientation, s.surface == "plic", self._faces, self._cells, m, self._scratch, self._fill_fraction,
        )  # fmt: skip
        if s.far_x or s.far_y:
            boundary.relax_level(
                fraction, new.eta_y, self.water.depth, self._bed_heights, self._rates, dt, m, self._rows
            )  # fmt: skip
            new.volume_added = old.volume_added + float(np.sum(self._rows[HALO:-HALO]))
            self._fill_fraction(fraction)

        if len(self.solids):
            forces.pressure_loads(
                new.phi, begin, new.wet, self.bodies, regions, placed.position, self.water.density,
                self.water.depth, dt, s.pore_pressure, self._bed_heights, m, loads[0],
            )  # fmt: skip
            for n in range(len(self.solids)):
                loads[:2, n, :3] = loads[:2, n, :3] @ placed.rotation[n]
                loads[:2, n, 3:] = loads[:2, n, 3:] @ placed.rotation[n]

        new.time, new.frame[:], new.phi_dt, new.steps = old.time + dt, frame, dt, old.steps + 1
        new.step, new.calm = old.step, old.calm
        self._state, self._next, self._poses = new, old, poses
        return loads, solved, new.courant_rate * dt

    # -- pieces ---------------------------------------------------------------------------------------------------

    def _start_closure(self) -> None:
        if self.settings.closure is not None:
            for state in (self._state, self._next):
                self.settings.closure.start(state.turbulence, self.settings.viscosity)

    def _frame(self, poses: Poses) -> Array:
        """Grid origin and yaw for given poses."""
        if self.settings.follow is None:
            return np.zeros(3)
        r, x = poses.rotation[self.settings.follow], poses.position[self.settings.follow]
        return np.array([x[0], x[1], math.atan2(r[1, 0], r[0, 0])])

    @staticmethod
    def _drift(before: Array, after: Array, dt: float) -> Array:
        """Mean velocity of the grid's origin in its own axes [m/s] and yaw rate [rad/s]."""
        yaw = 0.5 * (before[2] + after[2])
        vx, vy = (after[:2] - before[:2]) / dt
        c, s = math.cos(yaw), math.sin(yaw)
        return np.array([c * vx + s * vy, c * vy - s * vx, (after[2] - before[2]) / dt])

    def _far(self, yaw: float) -> Array:
        """Undisturbed flow in grid axes [m/s]."""
        return about_z(yaw).T @ self.water.velocity

    def _place(self, poses: Poses, frame: Array) -> Placed:
        """Put the solids at their poses."""
        back = about_z(frame[2]).T
        position = (poses.position - np.array([frame[0], frame[1], 0.0])) @ back.T
        rotation = back @ poses.rotation
        velocity, rate = poses.velocity @ back.T, poses.angular_velocity @ back.T
        spin = rotation[:, :, 1] * poses.spin[:, None]
        margin = 4.0 * self.grid.smallest_width
        before = self._regions.copy()
        for region in before:
            clear(self.bodies, region)
        for n, solid in enumerate(self.solids):
            self._regions[n] = index_region(self.metrics, solid, position[n], rotation[n], margin)
            self._check_inside(n, position[n], rotation[n])
        for n, solid in enumerate(self.solids):
            place_solid(
                n, solid.kind, solid.parameters, solid.samples, position[n], np.ascontiguousarray(rotation[n]),
                velocity[n], rate[n], self._regions[n], self.metrics, self.bodies,
                1.0 if self.settings.sharp_edges else 0.0,
            )  # fmt: skip
        if len(self.solids):
            low, high = self._regions[:, ::2].min(axis=0), self._regions[:, 1::2].max(axis=0)
            self._box = tuple(slice(a, b) for a, b in zip(low, high, strict=True))
        if self._bed is not None:
            self._place_bed(self._bed, before, position, frame)
        self._placed = Placed(position, rotation, velocity, rate, spin)
        return self._placed

    def _place_bed(self, given: bed.Bed, before: NDArray[np.int64], position: Array, frame: Array) -> None:
        """Lay the bed below the grid, once the solids are in place, and join them; `before`: their last boxes."""
        last = given.region.copy()
        moved = given.survey(frame)
        self._check_above(position)
        for region in before:
            given.lay(region, self.area_fractions)
        if moved:
            last[3] = max(last[3], given.region[3])
            given.lay(last, self.area_fractions)
            if self._state.steps > 0 and self.water.current_speed > 0.0:
                given.check_water(self.water, self._far(frame[2]), self._far_zone(), start=False)
        bed.join(self._regions, self.bodies, self.area_fractions)
        self._walls = np.vstack([self._regions, given.region])
        low, high = self._walls[:, ::2].min(axis=0), self._walls[:, 1::2].max(axis=0)
        self._box = tuple(slice(a, b) for a, b in zip(low, high, strict=True))

    def _surfaces(self) -> tuple[NDArray[np.int64], Array, Array, Array]:
        """Index boxes, origins, velocities and rates of the solids and, last, of a given bed, which is at rest."""
        placed = self._placed
        motion = placed.position, placed.velocity, placed.rate
        if self._bed is None:
            return (self._regions, *motion)
        position, velocity, rate = (np.vstack([q, np.zeros(3)]) for q in motion)
        return self._walls, position, velocity, rate

    def _far_zone(self) -> NDArray[np.bool_]:
        """Columns of the far field's absorbing zones."""
        zone = np.maximum.outer(self._rates.y, self._rates.x) > 0.0
        zone[:HALO], zone[-HALO:], zone[:, :HALO], zone[:, -HALO:] = False, False, False, False
        return zone

    def _fill_carrying(self, carrying: tuple[Array, Array, Array], far: Array) -> None:
        s = self.settings
        boundary.fill_velocity(*carrying, far, s.far_x, s.far_y, s.closed_top)
        if self._bed is not None:
            bed.close_sides(carrying, self.area_fractions)

    def _blend(self, dt: float) -> Array:
        """Bring the faces hardly open of the present state to the slip velocity; loads on the solids, their axes."""
        old, placed = self._state, self._placed
        walls, position, velocity, rate = self._surfaces()
        loads = np.zeros((len(walls), 6))
        if len(walls):
            extension.blend(
                old.velocity, old.extended, old.wet, self.area_fractions, walls, position, velocity, rate,
                self.water.density, dt, self.metrics, loads,
            )  # fmt: skip
        loads = loads[: len(self.solids)]
        for load, rotation in zip(loads, placed.rotation, strict=True):
            load[:3], load[3:] = load[:3] @ rotation, load[3:] @ rotation
        return loads

    def _find_water(self, state: FlowState) -> None:
        """Mark wet cells, find the spans, and clear what the state's arrays hold outside them."""
        spans.mark_wet(state.fraction, state.wet, interface.EMPTY, self._wet, self._water)
        width = state.fraction.shape[2]
        spans.widen(self._wet, 1, self._active, width)
        spans.widen(self._water, 1, self._cells, width)
        spans.widen(self._water, 2, self._faces, width)
        spans.widen(self._water, extension.REACH, self._near, width)
        moving = (*state.velocity, *state.extended, *state.carrying)
        spans.clear_outside(moving, state.lo, state.hi, self._near)

    def _check_inside(self, n: int, position: Array, rotation: Array) -> None:
        solid = self.solids[n]
        center = position + rotation @ (0.5 * (solid.low + solid.high))
        extent = np.abs(rotation) @ (0.5 * (solid.high - solid.low))
        for axis, faces in enumerate((self.grid.x_faces, self.grid.y_faces)):
            gap = min(center[axis] - extent[axis] - faces[0], faces[-1] - center[axis] - extent[axis])
            if gap < 3.0 * self.grid.smallest_width:
                raise ValueError(
                    f"solid {n} comes within {gap:.3g} m of the window's {'xy'[axis]} side; widen "
                    f"Grid.{'xy'[axis]}_faces."
                )
        lowest = center[2] - extent[2]
        bottom = float(self.grid.z_faces[0])
        if lowest < self.metrics.zf[1]:
            raise ValueError(
                f"solid {n} reaches {bottom - lowest:.3g} m below {'the bed' if self._bed is None else 'the window'}, "
                f"more than the grid can see ({bottom - self.metrics.zf[1]:.3g} m, "
                "one and a half cells); sinkage is too large or the cells too small."
            )

    def _check_above(self, position: Array) -> None:
        """Refuse a solid whose origin has sunk into a given bed."""
        m = self.metrics
        for n, x in enumerate(position):
            i, j = int(np.searchsorted(m.xf, x[0])) - 1, int(np.searchsorted(m.yf, x[1])) - 1
            if x[2] < self._bed_heights[j, i]:
                raise ValueError(
                    f"solid {n} lies in the bed: its origin is at z = {x[2]:.4g} m, the bed below it at "
                    f"{self._bed_heights[j, i]:.4g} m; raise the solid, or lower the terrain there."
                )

    def _fill_fraction(self, fraction: Array) -> None:
        boundary.fill_fraction(fraction, self._still, self.settings.far_x, self.settings.far_y)

    def _fill(self, state: FlowState, far: Array) -> None:
        s = self.settings
        self._fill_fraction(state.fraction)
        boundary.fill_velocity(state.u, state.v, state.w, far, s.far_x, s.far_y, s.closed_top)

    def _complete_velocity(self, state: FlowState) -> None:
        """Extended and carrying velocity of a state that was set from outside."""
        far = self._far(state.frame[2])
        whole = ActiveRows.padded(state.fraction.shape)
        state.lo[:], state.hi[:] = whole
        spans.mark_wet(state.fraction, state.wet, interface.EMPTY, self._wet, self._water)
        for e, q in zip(state.extended, state.velocity, strict=True):
            e[:] = q
        advection.full_velocity(state.carrying, state.velocity, self.area_fractions, whole)
        self._fill_carrying(state.carrying, far)
        advection.largest_courant(state.carrying, state.fraction, self.metrics, whole, self._rows)
        state.courant_rate = float(self._rows.max())

    # -- results --------------------------------------------------------------------------------------------------

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
        return {**found, "viscosity": self._viscosity[h:-h, h:-h, h:-h]}

    @property
    def pressure(self) -> Array:
        """Pressure above that of air [Pa], shape (ny, nz, nx); 0 in dry cells."""
        h, s = HALO, self._state
        z = self.metrics.zc[None, h:-h, None]
        gauge = s.phi[h:-h, h:-h, h:-h] / s.phi_dt - GRAVITY * (z - self.water.depth)
        return np.where(s.wet[h:-h, h:-h, h:-h] == 1, self.water.density * gauge, 0.0)

    def surface_height(self) -> Array:
        """Height of the water's surface above z = 0 in each column [m], shape (ny, nx); in solids without meaning.

        That of the bed where a given bed is dry.
        """
        if self._bed is None:
            return float(self.grid.z_faces[0]) + np.einsum("jki,k->ji", self.fraction, np.diff(self.grid.z_faces))
        heights, z = self.bed_height(), self.grid.z_faces
        lowest = np.clip(np.searchsorted(z, heights, side="right") - 1, 0, len(z) - 2)
        counted = np.arange(len(z) - 1)[:, None] >= lowest[:, None]
        level = z[lowest] + np.einsum("jki,k->ji", np.where(counted, self.fraction, 0.0), np.diff(z))
        return np.maximum(level, heights)

    @property
    def has_given_bed(self) -> bool:
        """Whether the bed is other than the window's lowest face."""
        return self._bed is not None

    def bed_height(self) -> Array:
        """Height of the bed below the middle of each column [m], shape (ny, nx)."""
        return self._bed_heights[HALO:-HALO, HALO:-HALO].copy()

    def water_volume(self) -> float:
        """Water in the window outside solids [m^3]."""
        h, o = HALO, self.bodies
        share = (o.bx[:, :, :-1] + o.bx[:, :, 1:])[h:-h, h:-h, h : -h + 1] + (o.by[:-1] + o.by[1:])[
            h : -h + 1, h:-h, h:-h
        ]
        share = share + (o.bz[:, :-1] + o.bz[:, 1:])[h:-h, h : -h + 1, h:-h]
        if self._bed is not None:
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
            raise ValueError(f"restore: the state is of shape {shape.shape}, the grid {self.grid.padded_shape}.")
        self._state.copy_from(FlowState(**{f.name: saved[f.name] for f in fields(FlowState)}))
        self._poses = Poses(**{f.name: saved[f"poses_{f.name}"].copy() for f in fields(Poses)})
        self._place(self._poses, self._state.frame)


def _given_bed(grid: Grid, terrain: Terrain | None, number: int, settings: FlowSettings) -> bed.Bed | None:
    """Bed of a terrain; None if it is the window's lowest face."""
    bottom = float(grid.z_faces[0])
    if terrain is None:
        if abs(bottom) > 1e-9:
            raise ValueError(
                f"Grid.z_faces[0] = {bottom} m must be 0: the lowest face is the bed unless FlowSolver is given a "
                "terrain."
            )
        return None
    if terrain.is_flat and abs(terrain.height - bottom) <= 1e-9:
        return None
    if isinstance(settings.closure, turbulence.KOmegaSST) and settings.bed_roughness is not None:
        raise ValueError(
            "FlowSettings.bed_roughness: KOmegaSST knows the wall of a flat bed only; with a terrain let the bed slip "
            "(bed_roughness=None), or use Smagorinsky."
        )
    return bed.Bed(terrain, grid, number)
