"""Turbulence closures and the shear of the bed: exact solutions of the models, symmetries, and a boundary layer."""

import dataclasses
import math

import numpy as np
import pytest

from exumob.flow import FlowSettings, FlowSolver, Grid, KOmegaSST, Poses, Smagorinsky, box, sphere
from exumob.flow.active_rows import ActiveRows, WaterCells
from exumob.flow.area_fractions import AreaFractions
from exumob.flow.pressure import assembly
from exumob.flow.step import StepFailed
from exumob.flow.turbulence.closures import ClosureFields, WaterMotion
from exumob.flow.turbulence.komega import BETA, BETA_STAR, step_up
from exumob.flow.turbulence.wall import bed_shear, friction_velocity
from exumob.water.conditions import Water

TANK = FlowSettings(follow=None, far_x=False, far_y=False, closure=KOmegaSST())
HALO = 2


def run(solver, dt, steps, poses=None):
    for n in range(steps):
        solver.advance(dt * (n + 1), None if poses is None else poses(dt * (n + 1)))
    return solver


def test_step_up_is_a_hyperbolic_tangent():
    x = np.linspace(0.0, 8.0, 400)
    assert max(abs(step_up(a) - math.tanh(a)) for a in x) < 2e-4


@pytest.mark.parametrize("dt", [0.005, 0.0025])
def test_decay_of_homogeneous_turbulence(dt):
    """No mean flow, no wall: omega = omega0 / (1 + beta omega0 t), k = k0 (1 + beta omega0 t)^(-beta*/beta).

    omega's step is exact but for the motion that the pressure's tolerance leaves; k's implicit step errs by
    beta* (beta* - beta) (omega0 dt)^2 / 2 at most, every step.
    """
    solver = FlowSolver(Grid.uniform((0, 0, 0), (0.4, 0.4, 0.3), 0.05), (), Water(0.2), TANK)
    solver.start()
    fields = solver.turbulence
    fields["k"][:], fields["omega"][:] = 0.01, 10.0
    run(solver, dt, round(1.0 / dt))
    wet = np.s_[:, :4, :]
    grown = 1.0 + BETA[1] * 10.0 * 1.0
    assert solver.turbulence["omega"][wet] == pytest.approx(10.0 / grown, rel=1e-5)
    error = 0.5 * BETA_STAR * (BETA_STAR - BETA[1]) * 10.0**2 * dt
    assert solver.turbulence["k"][wet] == pytest.approx(0.01 * grown ** (-BETA_STAR / BETA[1]), rel=error)
    assert solver.turbulence["viscosity"][wet] == pytest.approx(
        1e-6 + (solver.turbulence["k"] / solver.turbulence["omega"])[wet], rel=0.02
    )


def blob(grid_velocity, current, time=0.8, cell=0.025):
    """k at the end, world axes, of a blob carried by `current` seen from a grid that moves at `grid_velocity` [m/s]."""
    grid = Grid.uniform((-1, -0.5, 0), (1, 0.5, 0.2), cell)
    settings = FlowSettings(closure=KOmegaSST(), absorbing_width=0.1)
    solver = FlowSolver(grid, (sphere(0.02),), Water(0.1, current_speed=current, current_direction=0.0), settings)

    def pose(t):
        at_rest = Poses.at_rest([[grid_velocity * t, 0.0, 0.15]])
        return dataclasses.replace(at_rest, velocity=np.array([[grid_velocity, 0.0, 0.0]]))

    solver.start(pose(0.0))
    x, y = (0.5 * (f[1:] + f[:-1]) for f in (grid.x_faces, grid.y_faces))
    hump = np.exp(-(x[None, None, :] ** 2 + y[:, None, None] ** 2) / 0.15**2)
    fields = solver.turbulence
    fields["k"][:], fields["omega"][:] = 0.004 * (0.2 + hump), 5.0
    run(solver, 0.01, round(time / 0.01), pose)
    return solver.turbulence["k"][:, 0, :], solver.turbulence["omega"][:, 0, :]


def test_galilean_invariance():
    """Resting water from a moving grid, and moving water from a resting grid and from one that moves along.

    The latter equals the first to 1e-4 (no advection in either); carried through the grid, the blob (6 cells in radius)
    loses to the limiter: 5 % of its height allowed.
    """
    still, still_omega = blob(0.0, 0.0)
    along, along_omega = blob(0.5, 0.5)
    assert np.abs(along - still)[8:-8, 8:-8].max() < 1e-4 * still.max()
    assert np.abs(along_omega - still_omega)[8:-8, 8:-8].max() < 1e-4 * still_omega.max()
    carried, _ = blob(0.0, 0.5)
    passed, _ = blob(-0.5, 0.0)
    assert np.abs(carried - passed)[8:-8, 8:-8].max() < 1e-4 * still.max()
    shift = 16  # 0.5 m/s over 0.8 s
    assert np.abs(carried[:, shift:] - still[:, :-shift])[8:-8, 8:-8].max() < 0.05 * still.max()


def around_a_box(side, steps=10):
    grid = Grid.uniform((-0.6, -0.5, 0), (0.8, 0.5, 0.24), 0.04)
    settings = FlowSettings(follow=None, closure=KOmegaSST(), absorbing_width=0.2, bed_roughness=1e-3, tolerance=1e-9)
    water = Water(0.13, current_speed=1.0, current_direction=0.0)
    solver = FlowSolver(grid, (box(0.31, 0.21, 0.2, friction=0.005),), water, settings)
    pose = Poses.at_rest([[0.0, 0.06 * side, 0.14]])
    solver.start(pose)
    return run(solver, 0.01, steps)


def test_fields_stay_positive_behind_a_box():
    """Impulsive start at 1 m/s over a rough bed: finite, positive, and more turbulent than the inflow."""
    fields = around_a_box(1.0, steps=40).turbulence
    for name, values in fields.items():
        assert np.all(np.isfinite(values)), name
        if name != "blend":
            assert values.min() > 0.0, name
    assert fields["viscosity"].max() > 2e-5


def mirrored(q, across=False):
    """Field mirrored in y; `across`: on the y faces."""
    return np.concatenate([q[:1], q[:0:-1]]) if across else q[::-1].copy()


def test_one_step_of_the_closure_mirrors():
    """The same flow and its mirror image, given to the closure: to round-off, 1e-10 of the largest value."""
    solver = around_a_box(1.0)
    state, m, o = solver._state, solver.metrics, solver.area_fractions
    old = state.turbulence
    walls = solver._step.walls(solver._step.placement.solids)
    other = o._replace(
        bx=mirrored(o.bx), by=mirrored(o.by, True), bz=mirrored(o.bz), distance=mirrored(o.distance),
        nearest=mirrored(o.nearest),
    )  # fmt: skip
    reverse_walls = walls._replace(
        area_fractions=other, distance=other.distance, nearest=other.nearest,
        solids=walls.solids._replace(position=walls.solids.position * [1, -1, 1]),
    )  # fmt: skip
    u, v, w = state.velocity
    fx, fy, fz = solver._step.relative
    given = state.velocity, (fx, fy, fz), state.wet, walls, old
    reverse = (
        (mirrored(u), -mirrored(v, True), mirrored(w)), (mirrored(fx), -mirrored(fy, True), mirrored(fz)),
        mirrored(state.wet), reverse_walls, np.stack([mirrored(q) for q in old]),
    )  # fmt: skip
    results, whole = [], ActiveRows.padded(old.shape[1:])
    for velocity, relative, wet, bounds, fields in (given, reverse):
        new, viscosity = np.zeros_like(old), np.zeros_like(fx)
        cells = WaterCells.empty(wet.shape)._replace(wet=wet, active=whole, near=whole)
        KOmegaSST().update(
            ClosureFields(viscosity, fields.copy(), new), WaterMotion(velocity, relative, cells), bounds, 0.01, 1e-6, m
        )
        results.append([*new[:2], viscosity])
    inner = np.s_[HALO:-HALO, HALO:7, HALO:-HALO]
    for one, two in zip(*results, strict=True):
        assert np.abs(one - mirrored(two))[inner].max() < 1e-10 * one[inner].max()


def test_save_and_restore_bit_for_bit():
    one = around_a_box(1.0, steps=10)
    saved = one.save()
    other = around_a_box(1.0, steps=3)
    other.restore(saved)
    for solver in (one, other):
        for n in range(10, 20):
            solver.advance(0.01 * (n + 1))
    a, b = one.save(), other.save()
    for name in a:
        np.testing.assert_array_equal(a[name], b[name], name)


def test_failed_step_leaves_the_fields(monkeypatch):
    """A step that fails after the closure has run, then done again: as if it had never been tried."""
    solver = around_a_box(1.0, steps=5)
    before = {name: values.copy() for name, values in solver.turbulence.items() if name != "viscosity"}

    solve = assembly.solve
    monkeypatch.setattr(assembly, "solve", lambda *a: assembly.Outcome(1, math.nan, False))
    with pytest.raises(StepFailed, match="did not converge"):
        solver._step.take(solver._state, solver._next, 0.01, solver._poses)
    for name, values in before.items():
        assert np.array_equal(solver.turbulence[name], values), name
    monkeypatch.setattr(assembly, "solve", solve)
    solver.advance(0.06)
    assert not np.array_equal(before["k"], solver.turbulence["k"])
    assert np.array_equal(solver.turbulence["k"], around_a_box(1.0, steps=6).turbulence["k"])


def test_smagorinsky_is_molecular_in_uniform_flow():
    """No strain, no eddy viscosity: to 1e-9 m^2/s, a thousandth of the molecular."""
    grid = Grid.uniform((-0.5, -0.3, 0), (0.5, 0.3, 0.2), 0.05)
    settings = FlowSettings(follow=None, closure=Smagorinsky(), absorbing_width=0.2)
    solver = FlowSolver(grid, (), Water(0.1, current_speed=1.0, current_direction=0.7), settings)
    solver.start()
    run(solver, 0.01, 10)
    assert solver.turbulence["viscosity"][:, :2] == pytest.approx(1e-6, abs=1e-9)


def test_friction_velocity():
    """Both limits, and the log law as printed: U+ = ln(9.8 y+) / 0.41 and ln(y / k_s) / 0.41 + 8.5."""
    smooth = friction_velocity(1.0, 0.01, 1e-6, 0.0)
    assert 1.0 / smooth == pytest.approx(math.log(9.8 * 0.01 * smooth / 1e-6) / 0.41, rel=1e-5)
    rough = friction_velocity(1.0, 0.01, 1e-9, 1e-3)
    assert 1.0 / rough == pytest.approx(math.log(10.0) / 0.41 + 8.5, rel=1e-3)
    laminar = friction_velocity(1e-3, 1e-3, 1e-6, 0.0)
    assert laminar**2 == pytest.approx(1e-6 * 1e-3 / 1e-3, rel=1e-9)
    assert friction_velocity(0.0, 0.01, 1e-6, 0.0) == 0.0


def test_bed_takes_the_momentum_that_the_log_law_says():
    """One layer of water, oblique: d<U>/dt = -u_*^2 / h, along the flow."""
    grid = Grid.uniform((0, 0, 0), (0.5, 0.5, 0.5), 0.1)
    u, v, w = grid.zeros() + 0.8, grid.zeros() + 0.6, grid.zeros()
    wet = np.zeros(grid.padded_shape, dtype=np.uint8)
    fraction = grid.zeros()
    wet[:, HALO], fraction[:, HALO] = 1, 1.0
    cells = WaterCells.empty(grid.padded_shape)._replace(fraction=fraction, wet=wet)
    out = (u.copy(), v.copy(), w.copy())
    dt = 1e-4
    bed_shear(out, (u, v, w), cells, AreaFractions.open(grid.padded_shape), 1e-3, 1e-6, dt, grid.metrics)
    inner = np.s_[HALO:-HALO, HALO, HALO:-HALO]
    expected = dt * friction_velocity(1.0, 0.05, 1e-6, 1e-3) ** 2 / 0.1
    assert (u - out[0])[inner] == pytest.approx(0.8 * expected, rel=1e-3)
    assert (v - out[1])[inner] == pytest.approx(0.6 * expected, rel=1e-3)
    assert np.array_equal(out[0][:, HALO + 1], u[:, HALO + 1])


def boundary_layer(cell=0.0125, speed=0.5, depth=0.2, time=12.0):
    """Profile [m/s] over z [m] at 3 m in a channel with a smooth bed, and friction coefficient there."""
    grid = Grid.uniform((0, 0, 0), (4, 4 * cell, 0.3), (2 * cell, cell, cell))
    settings = FlowSettings(
        follow=None, far_y=False, closure=KOmegaSST(intensity=0.01), absorbing_width=0.4, bed_roughness=0.0
    )
    solver = FlowSolver(grid, (), Water(depth, current_speed=speed, current_direction=0.0), settings)
    solver.start()
    run(solver, 0.015, round(time / 0.015))
    profile = solver.velocity[0][1, :, round(3.0 / (2 * cell))]
    z = 0.5 * (grid.z_faces[1:] + grid.z_faces[:-1])
    wet = z < 0.95 * depth
    shear = friction_velocity(profile[0], z[0], 1e-6, 0.0)
    return z[wet], profile[wet], shear


@pytest.mark.slow
def test_boundary_layer_on_the_bed():
    """Turbulent boundary layer without pressure gradient: C_f(Re_theta) of Coles-Fernholz within 10 %, log law 5 %.

    C_f = 2 (ln(Re_theta) / 0.384 + 4.127)^-2 (Nagib, Chauhan & Monkewitz, Phil. Trans. R. Soc. A 365 (2007) 755).
    """
    z, u, shear = boundary_layer()
    outer = u.max()
    theta = float(np.sum(u / outer * (1.0 - u / outer)) * (z[1] - z[0]))
    friction = 2.0 * (shear / outer) ** 2
    expected = 2.0 * (math.log(outer * theta / 1e-6) / 0.384 + 4.127) ** -2
    assert friction == pytest.approx(expected, rel=0.10)
    log_law = shear / 0.41 * np.log(9.8 * z * shear / 1e-6)
    assert u[1] == pytest.approx(log_law[1], rel=0.05)


def test_bad_input():
    with pytest.raises(ValueError, match="intensity"):
        KOmegaSST(intensity=0.0)
    with pytest.raises(ValueError, match="bed_roughness"):
        FlowSettings(bed_roughness=-1.0)
