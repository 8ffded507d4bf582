"""One time step of the flow: six phases, from the solids' new places to the loads on them (paper Eqs. 1-2).

1. Place solids: they and the grid move on, and what they leave open changes.
2. Predict: velocity under all terms of the momentum equation but the pressure's.
3. Project: the pressure takes the divergence out of it.
4. Extend: velocity in the air and inside solids, and on full faces, which carries water and momentum.
5. Transport: the fraction of water goes with it.
6. Loads: pressure, wall friction and the momentum that passes through small faces.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from exumob.flow import (
    advection,
    forces,
    free_surface,
    surface_at_solids,
    velocity_extension,
    volume_at_solids,
    water_on_bed,
)
from exumob.flow.active_rows import ActiveRows, WaterCells, clear_outside
from exumob.flow.far_field import FarField, FlowAlongY
from exumob.flow.fluid import Fluid
from exumob.flow.grid import Grid, GridVelocity
from exumob.flow.placement import Placement
from exumob.flow.poses import PlacedSolids, Poses
from exumob.flow.pressure import assembly
from exumob.flow.settings import FlowSettings
from exumob.flow.solids import Solid
from exumob.flow.state import FlowState, Loads
from exumob.flow.turbulence import closures, wall
from exumob.flow.undisturbed import FarVelocity, UndisturbedWater
from exumob.ground.terrain import Terrain
from exumob.support.arrays import Array
from exumob.water.conditions import Water

SWEEPS = ((0, 1, 2), (2, 1, 0), (1, 2, 0), (0, 2, 1), (2, 0, 1), (1, 0, 2))
"""Orders of the three sweeps that carry the fraction, in turn."""
TOO_FAR_LEFT = 1.0e3
"""Residual over the tolerance from which an unfinished pressure solution counts as failed."""


class OverTerrain(NamedTuple):
    """The bed of a window."""

    terrain: Terrain | None = None
    """None: flat, the window's lowest face"""
    deepest: float | None = None
    """Where the terrain lies below this height, the bed lies at it [m]; None: nowhere"""
    may_be_dry: bool = False
    """The window may begin on dry land, and come to water later"""


class StepFailed(Exception):
    """The step cannot be used, for the reason given; the state at its begin is as it was."""


@dataclass
class Step:
    """Input of one step, and what its phases hand on."""

    dt: float
    """[s]"""
    old: FlowState
    """At the begin"""
    new: FlowState
    """At the end; filled by the phases"""
    frame: Array
    """Pose of the grid at the end: origin x, y [m] and yaw [rad] in the world, shape (3,)"""
    grid_velocity: GridVelocity
    far: FarVelocity
    """Undisturbed flow at the end"""
    cells: WaterCells
    """Water in the cells before the transport"""
    solids: PlacedSolids
    """At the begin, and from `place_solids` on at the end"""
    shear: Array
    """Wall friction and drag of lugs, from `predict`: wrenches in grid axes [N, N m], shape (n, 6)"""

    @property
    def yaw(self) -> float:
        """Angle by which the grid turns [rad]."""
        return float(self.frame[2] - self.old.frame[2])


class StepResult(NamedTuple):
    """Outcome of a step."""

    loads: Loads
    solved: assembly.Outcome
    courant: float
    """Largest Courant number [-]"""


class TimeStep:
    """The phases of a step, and the fields that they share.

    Parameters
    ----------
    grid : Grid
    solids : sequence of Solid
    water : Water
    settings : FlowSettings
    over : OverTerrain
        The bed.

    Attributes
    ----------
    undisturbed : UndisturbedWater
        The water as it would be without solids.
    placement : Placement
        Solids and bed in the grid.
    far_field : FarField
        The window's sides.
    levels : Levels
        Levels of the pressure's multigrid.
    relative : three arrays
        Velocity relative to the grid on full faces [m/s].
    viscosity : array
        Kinematic, molecular part included [m^2/s].
    """

    def __init__(
        self, grid: Grid, solids: Sequence[Solid], water: Water, settings: FlowSettings, over: OverTerrain
    ) -> None:  # fmt: skip
        """Allocate; see the class."""
        self.may_be_dry = over.may_be_dry
        self.metrics, self.water, self.settings = grid.metrics, water, settings
        self.undisturbed = UndisturbedWater(water, grid)
        self.fluid = Fluid(float(water.density), self.undisturbed.level, float(settings.viscosity))
        self.placement = Placement(grid, solids, over.terrain, settings, over.deepest)
        self.far_field = FarField(grid, self.fluid.level, self.placement.bed_heights, settings)
        self.levels = assembly.Levels(self.metrics)
        shape = grid.padded_shape
        self.relative = np.zeros(shape), np.zeros(shape), np.zeros(shape)
        self.viscosity = np.full(shape, settings.viscosity)
        self._cells = WaterCells.empty(shape)
        self._closed = volume_at_solids.ClosedParts(shape)
        self._change = np.zeros(shape), np.zeros(shape), np.zeros(shape)
        self._theta = np.ones(shape), np.ones(shape), np.ones(shape)
        unknown = np.full(shape, free_surface.UNKNOWN)
        self._orientation = unknown, unknown.copy(), unknown.copy()
        self._label = np.zeros(shape, dtype=np.uint8)
        self._scratch, self._rates = np.zeros(shape), np.zeros(shape[0])
        self._at_rest = np.zeros((shape[0], shape[2]))

    def take(self, old: FlowState, new: FlowState, dt: float, poses: Poses) -> StepResult:
        """Fill `new` with the state `dt` [s] after `old`, when the solids are at `poses`.

        Raises
        ------
        StepFailed
            If the pressure does not converge or the water gets too fast.
        """
        step = self._begin(old, new, dt, poses)
        box = self.placement.box
        kept = [q[box].copy() for q in old.velocity]
        slip_momentum = self.draw_to_slip(step)  # solids still where the last step left them
        self.place_solids(step, poses)
        try:
            self.predict(step)
            solved = self.project(step)
            self.extend(step)
        except StepFailed:
            for q, values in zip(old.velocity, kept, strict=True):
                q[box] = values
            raise
        self.transport(step)
        loads = self.loads(step, slip_momentum)
        new.time, new.frame[:], new.phi_dt, new.steps = old.time + dt, step.frame, dt, old.steps + 1
        new.step, new.calm = old.step, old.calm
        return StepResult(loads, solved, new.courant_rate * dt)

    def _begin(self, old: FlowState, new: FlowState, dt: float, poses: Poses) -> Step:
        frame = self.frame(poses)
        frame[2] = old.frame[2] + math.remainder(frame[2] - old.frame[2], 2.0 * math.pi)
        return Step(
            dt, old, new, frame, mean_grid_velocity(old.frame, frame, dt), self.far(frame),
            self._cells._replace(fraction=new.fraction, wet=new.wet), self.placement.solids, np.zeros(0),
        )  # fmt: skip

    # -- the phases -----------------------------------------------------------------------------------------------

    def draw_to_slip(self, step: Step) -> Array:
        """Draw faces hardly open to the slip velocity, as they have hardly any of their own; the loads that this is.

        Done before the first phase: the extended velocity and the solids are those of the step before.
        """
        old, walls = step.old, self.placement.surfaces
        if not len(walls.regions):
            return np.zeros((0, 6))
        blending = velocity_extension.Blending(
            old.velocity, old.extended, old.wet, self.fluid.density, step.dt,
            velocity_extension.BLEND_RATE / math.sqrt(self.settings.size),
            velocity_extension.LEFT if self.settings.smooth_separation else 0.0,
        )  # fmt: skip
        given = self.placement.bed
        bed = velocity_extension.NO_BED if given is None else given.number
        o, bodies = self.placement.area_fractions, self.placement.bodies
        wrenches = velocity_extension.blend(blending, o, bodies, walls, bed, self.metrics)
        return step.solids.in_body_axes(wrenches[: len(step.solids.position)])

    def place_solids(self, step: Step, poses: Poses) -> None:
        """Solids and bed to where they are at the end, with the fraction in and at them and the wet cells."""
        new, bed = step.new, self.placement.bed
        self._closed.step()
        self.place(poses, step.frame, step.old.steps)
        step.solids = solids = self.placement.solids
        o = self.placement.area_fractions
        new.fraction[:], new.eta_y[:] = step.old.fraction, step.old.eta_y
        surface_at_solids.release_surface(
            new.fraction, self._scratch, o, solids, step.grid_velocity, step.dt, self.metrics
        )
        surface_at_solids.refill_solids(
            new.fraction, o.distance, solids.regions, self.metrics, self.settings.refill_depth
        )
        if bed is not None:
            bed.refill(new.fraction, o)
        self.far_field.fill_fraction(new.fraction)
        step.cells.find_rows(free_surface.EMPTY, velocity_extension.REACH)
        clear_outside((*new.velocity, *new.extended, *new.carrying), new.lo, new.hi, step.cells.near)

    def predict(self, step: Step) -> None:
        """Velocity before the projection: the momentum equation without the pressure."""
        g = step.grid_velocity
        self.far_field.set_flow(step.far.in_the_middle - np.array([g.x, g.y]))
        advection.turn(step.old.velocity, step.new.velocity, step.yaw, step.cells.near)
        self._add_advection(step)
        self._add_eddy_stress(step)
        step.shear = self._add_friction(step)
        self._add_bed_shear(step)
        self.far_field.relax_velocity(step.new.velocity, step.far, step.dt, step.cells.near)
        self.far_field.fill_velocity(step.new.velocity, step.far)

    def project(self, step: Step) -> assembly.Outcome:
        """Subtract the gradient of the pressure that frees the velocity of divergence."""
        s, new, o, m = self.settings, step.new, self.placement.area_fractions, self.metrics
        conditions = assembly.Conditions(
            step.dt, self.fluid.level, s.closest_surface, s.void_stiffness / s.size**1.5, self.placement.bed is not None
        )
        np.multiply(step.old.phi, step.dt / step.old.phi_dt, out=new.phi)
        assembly.assemble(
            new.velocity, step.cells, o, conditions, m, self.levels.levels[0], self.levels.rhs, self._theta
        )
        solved = assembly.solve(self.levels, new.phi, m, step.dt, s.tolerance, s.iterations, s.closed_top)
        if not solved.converged and not solved.residual < TOO_FAR_LEFT * s.tolerance:
            raise StepFailed(f"the pressure did not converge (divergence times step {solved.residual:.1e})")
        assembly.project(new.velocity, new.phi, step.cells, o, conditions, m, self._theta)
        return solved

    def extend(self, step: Step) -> None:
        """Velocity in the air and inside solids, and relative to the grid on full faces."""
        new, o = step.new, self.placement.area_fractions
        far = (*step.far, self._at_rest)
        fastest_fall = velocity_extension.FASTEST_FALL * math.sqrt(self.settings.size)
        for axis in range(3):
            velocity_extension.extend(
                new.extended[axis], new.velocity[axis], step.cells, o, axis, far[axis], step.dt, self._label,
                fastest_fall,
            )  # fmt: skip
        if self.placement.bed is not None:
            self.placement.bed.stop(step.cells, o, new.velocity, new.extended)
        self.far_field.fill_velocity(new.velocity, step.far)
        self._carry(new, step.far, step.cells.near)
        advection.relative_velocity(self.relative, new.carrying, step.grid_velocity, step.cells.near, self.metrics)
        new.courant_rate = self._courant_rate(self.relative, new.fraction, step.cells.near)
        if not new.courant_rate * step.dt < 2.0 * self.settings.courant:
            raise StepFailed(f"the Courant number reached {new.courant_rate * step.dt:.2g}")

    def transport(self, step: Step) -> None:
        """Carry the fraction, and draw the level in the far field to still water."""
        new, cells, far_field = step.new, step.cells, self.far_field
        begin = self.levels.rhs  # free by now
        begin[:] = new.fraction
        step.cells = cells._replace(fraction=begin)
        along_y = FlowAlongY(new.v, new.fraction, self.placement.area_fractions.by, step.far.y)
        far_field.gather_rise(new.eta_y, along_y, step.grid_velocity, step.dt)
        sweeps = free_surface.Sweeps(
            begin, self.relative, step.dt, self.settings.surface == "plic", cells.swept, cells.swept_faces,
            self._orientation, self._scratch,
        )  # fmt: skip
        order = SWEEPS[step.old.steps % len(SWEEPS)]
        free_surface.transport(new.fraction, sweeps, order, self.metrics, far_field.fill_fraction)
        self._return_volume(step)
        added = far_field.relax_level(new.fraction, new.eta_y, step.dt)
        new.volume_added = step.old.volume_added + added

    def _return_volume(self, step: Step) -> None:
        """Take from the surface near the solids what their motion has added to the water in this step."""
        placement, closed, regions, m = self.placement, self._closed, step.solids.regions, self.metrics
        if not len(regions):
            return
        fraction, bodies, heights = step.new.fraction, placement.bodies, placement.bed_heights
        fractions = step.old.fraction, step.cells.fraction, fraction
        volumes = volume_at_solids.gained(
            fractions, (closed.before, closed.now), bodies.nearest, regions, heights, m
        )  # fmt: skip
        volume_at_solids.return_volume(
            fraction, self._scratch, volumes, closed.now, bodies, regions, placement.margin, heights, m
        )

    def loads(self, step: Step, slip_momentum: Array) -> Loads:
        """Loads on the solids in their own axes."""
        solids = step.solids
        if not len(solids.regions):
            return Loads.zeros(0)
        ground = forces.Ground(self.placement.bed_heights, self.settings.pore_pressure)
        pressure = forces.pressure_loads(
            step.new.phi, step.cells, self.placement.bodies, solids, self.fluid, step.dt, ground, self.metrics
        )
        return Loads(solids.in_body_axes(pressure), solids.in_body_axes(step.shear), slip_momentum)

    # -- terms of the momentum equation ---------------------------------------------------------------------------

    def _add_advection(self, step: Step) -> None:
        m, o = self.metrics, self.placement.area_fractions
        advection.relative_velocity(self.relative, step.old.carrying, step.grid_velocity, step.cells.near, m)
        for axis in range(3):
            advection.advect(step.new.velocity[axis], step.old.velocity, self.relative, step.cells, o, axis, step.dt, m)

    def _add_eddy_stress(self, step: Step) -> None:
        s, old, new, m = self.settings, step.old, step.new, self.metrics
        if s.closure is not None:
            s.closure.update(
                closures.ClosureFields(self.viscosity, old.turbulence, new.turbulence),
                closures.WaterMotion(old.velocity, self.relative, step.cells), self.walls(step.solids), step.dt,
                self.fluid.viscosity, m,
            )  # fmt: skip
        if s.closure is not None or s.viscosity > 0.0:
            o = self.placement.area_fractions
            for axis in range(3):
                closures.add_stress(new.velocity[axis], self.viscosity, old.velocity, step.cells, o, axis, step.dt, m)

    def walls(self, solids: PlacedSolids) -> wall.Walls:
        """Walls that bound the water, as a closure takes them."""
        roughness, bodies = self.settings.bed_roughness, self.placement.bodies
        return wall.Walls(
            self.placement.area_fractions, bodies.distance, bodies.nearest, solids,
            -1.0 if roughness is None else float(roughness),
        )  # fmt: skip

    def _add_friction(self, step: Step) -> Array:
        """Friction of the solids' walls and drag of their lugs; the wrenches on them in grid axes, shape (n, 6)."""
        solids, wrenches = step.solids, np.zeros((len(step.solids.position), 6))
        for exists, kernel in ((solids.friction, forces.wall_shear), (solids.lug_drag_area, forces.lug_drag)):
            if exists.any():
                wrenches += kernel(
                    self._change, step.new.velocity, step.cells, self.placement.area_fractions, solids,
                    self.fluid.density, step.dt, self.metrics,
                )  # fmt: skip
                forces.add_and_clear(step.new.velocity, self._change, solids.regions)
        return wrenches

    def _add_bed_shear(self, step: Step) -> None:
        roughness, bed, o = self.settings.bed_roughness, self.placement.bed, self.placement.area_fractions
        if roughness is None:
            return
        out, velocity, nu = step.new.velocity, step.old.velocity, self.fluid.viscosity
        if bed is None:
            wall.bed_shear(out, velocity, step.cells, o, float(roughness), nu, step.dt, self.metrics)
        else:
            water_on_bed.shear(out, velocity, step.cells, o, bed.rough(float(roughness)), nu, step.dt, self.metrics)

    # -- pieces ---------------------------------------------------------------------------------------------------

    def frame(self, poses: Poses) -> Array:
        """Pose of the grid for given poses of the solids: origin x, y [m] and yaw [rad] in the world, shape (3,)."""
        if self.settings.follow is None:
            return np.zeros(3)
        r, x = poses.rotation[self.settings.follow], poses.position[self.settings.follow]
        return np.array([x[0], x[1], math.atan2(r[1, 0], r[0, 0])])

    def far(self, frame: Array) -> FarVelocity:
        """Undisturbed flow of a grid at `frame`; the next call overwrites it."""
        return self.undisturbed.velocity(frame)

    def place(self, poses: Poses, frame: Array, steps: int) -> None:
        """Put solids and grid at their poses; after the first of the steps done, warn of an uneven bed underway."""
        moved = self.placement.place(poses, frame)
        self._closed.mark(self.placement.bodies, self.placement.solids.regions, self.metrics)
        if moved and steps > 0:
            self.check_water(self.far(frame), start=False)

    def check_water(self, far: FarVelocity, start: bool) -> None:
        """Check that the current can be undisturbed over a given bed (`exumob.flow.bed.Bed.check_water`)."""
        if self.placement.bed is not None:
            self.placement.bed.check_water(self.undisturbed, far, self.far_field, start, self.may_be_dry)

    def complete(self, state: FlowState) -> None:
        """Fill in what follows from fraction and velocity of a state that was set from outside."""
        far = self.far(state.frame)
        self.far_field.fill_fraction(state.fraction)
        self.far_field.fill_velocity(state.velocity, far)
        whole = ActiveRows.padded(state.fraction.shape)
        state.lo[:], state.hi[:] = whole
        self._cells._replace(fraction=state.fraction, wet=state.wet).find_rows(
            free_surface.EMPTY, velocity_extension.REACH
        )
        for e, q in zip(state.extended, state.velocity, strict=True):
            e[:] = q
        self._carry(state, far, whole)
        state.courant_rate = self._courant_rate(state.carrying, state.fraction, whole)

    def _carry(self, state: FlowState, far: FarVelocity, rows: ActiveRows) -> None:
        """Velocity on full faces, which carries fraction and momentum."""
        o = self.placement.area_fractions
        advection.full_velocity(state.carrying, state.velocity, o, rows)
        self.far_field.fill_velocity(state.carrying, far)
        if self.placement.bed is not None:
            water_on_bed.close_sides(state.carrying, o)

    def _courant_rate(self, relative: tuple[Array, Array, Array], fraction: Array, rows: ActiveRows) -> float:
        """Largest rate at which water crosses cells [1/s]."""
        advection.largest_courant(relative, fraction, self.metrics, rows, self._rates)
        return float(self._rates.max())


def mean_grid_velocity(before: Array, after: Array, dt: float) -> GridVelocity:
    """Mean velocity of the grid between two poses (x, y [m], yaw [rad]), in its own axes halfway."""
    yaw = 0.5 * (before[2] + after[2])
    vx, vy = (after[:2] - before[:2]) / dt
    c, s = math.cos(yaw), math.sin(yaw)
    return GridVelocity(float(c * vx + s * vy), float(c * vy - s * vx), float((after[2] - before[2]) / dt))
