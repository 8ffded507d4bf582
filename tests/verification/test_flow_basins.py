"""Water without solids: still, sloshing, carried by a moving grid, decaying vortices."""

import math

import numba
import numpy as np
import pytest

from exumob.environment import GRAVITY, Water
from exumob.flow import FlowSettings, FlowSolver, Grid, Poses, sphere

TANK = FlowSettings(follow=None, far_x=False, far_y=False, closure=None, viscosity=0.0)


def heading(yaw):
    c, s = math.cos(yaw), math.sin(yaw)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


@pytest.mark.parametrize("level", [0.100, 0.107, 0.113])
def test_still_water_stays_still(level):
    solver = FlowSolver(Grid.uniform((0, 0, 0), (0.4, 0.2, 0.2), 0.02), (), Water(level), TANK)
    solver.start()
    for n in range(50):
        solver.advance(0.005 * (n + 1))
    assert max(float(np.abs(q).max()) for q in solver.velocity) < 1e-4
    assert np.abs(solver.surface_height() - level).max() < 1e-9


def sloshing(level, cell=0.02, amplitude=0.004, periods=2.0, dt=2e-3):
    """Period [s] over theory, amplitude kept, volume error, and the range of the fraction."""
    grid = Grid.uniform((0, 0, 0), (1.0, 4 * cell, 0.3), cell)
    solver = FlowSolver(grid, (), Water(level), TANK)
    solver.start()
    x = 0.5 * (grid.x_faces[1:] + grid.x_faces[:-1])
    shape = np.cos(math.pi * x)
    fraction = np.clip((level + amplitude * shape[None, None] - grid.z_faces[None, :-1, None]) / cell, 0.0, 1.0)
    solver.set_flow(fraction=fraction * np.ones((grid.shape[0], 1, 1)))
    volume = solver.water_volume()
    theory = 2.0 * math.pi / math.sqrt(GRAVITY * math.pi * math.tanh(math.pi * level))
    modal, times = [], []
    for n in range(int(periods * theory / dt) + 1):
        solver.advance(dt * (n + 1))
        modal.append(2.0 * np.mean((solver.surface_height()[0] - level) * shape))
        times.append(solver.time)
    modal, times = np.array(modal), np.array(times)
    i = np.nonzero(modal[:-1] * modal[1:] < 0.0)[0]
    crossings = times[i] - modal[i] * dt / (modal[i + 1] - modal[i])
    kept = np.abs(modal[len(modal) // 2 :]).max() / amplitude
    limits = solver.fraction.min(), solver.fraction.max()
    return 2.0 * np.mean(np.diff(crossings)) / theory, kept, abs(solver.water_volume() / volume - 1.0), limits


@pytest.mark.parametrize("level", [0.150, 0.155, 0.160, 0.165])
def test_sloshing_period_amplitude_and_volume(level):
    """Linear theory, depth 0.15 L, amplitude 0.4 % L; four places of the level within a cell."""
    period, kept, volume, (least, most) = sloshing(level)
    assert period == pytest.approx(1.0, abs=3e-3)
    assert 0.97 < kept < 1.02
    assert volume < 1e-5
    assert least >= -1e-6
    assert most <= 1.0 + 1e-6


@pytest.mark.slow
def test_sloshing_error_falls_with_the_cell():
    errors = [abs(sloshing(0.155, cell, dt=0.1 * cell)[0] - 1.0) for cell in (0.05, 0.0125)]
    assert errors[1] < 0.5 * errors[0] or errors[0] < 5e-4


@pytest.mark.parametrize("yaw_rate", [0.0, 1.2])
def test_uniform_current_stays_uniform_under_a_moving_grid(yaw_rate):
    grid = Grid.stretched((-0.3, -0.3, 0), (0.3, 0.3, 0.2), (-0.8, -0.8, 0), (0.8, 0.8, 0.3), 0.04)
    water = Water(0.113, current_speed=1.0, current_direction=2.2)
    solver = FlowSolver(grid, (sphere(0.02),), water, FlowSettings(follow=0, absorbing_width=0.2))

    def pose(t):
        return Poses(
            np.array([[0.8 * t, 0.3 * math.sin(t), 0.27]]), heading(yaw_rate * t)[None],
            np.array([[0.8, 0.3 * math.cos(t), 0.0]]), np.array([[0.0, 0.0, yaw_rate]]), np.zeros(1),
        )  # fmt: skip

    solver.start(pose(0.0))
    for n in range(60):
        solver.advance(0.005 * (n + 1), pose(0.005 * (n + 1)))
    far = heading(solver.frame[2]).T @ water.velocity
    wet = slice(0, 3)
    for q, value in zip(solver.velocity, far, strict=True):
        assert np.abs(q[:, wet] - value).max() < 1e-5
    assert np.abs(solver.surface_height() - water.depth).max() < 1e-5


def taylor_green(n, viscosity, time, cfl=0.2):
    """Largest error of the vortices' velocity in a square basin with slip walls [m/s]."""
    size = math.pi
    grid = Grid(np.linspace(0, size, n + 1), np.linspace(0, size, n + 1), np.linspace(0, 4 * size / n, 5))
    settings = FlowSettings(
        follow=None, far_x=False, far_y=False, closed_top=True, closure=None, viscosity=viscosity, tolerance=1e-9,
    )  # fmt: skip
    solver = FlowSolver(grid, (), Water(4 * size / n), settings)
    solver.start()
    f, c = grid.x_faces, 0.5 * (grid.x_faces[1:] + grid.x_faces[:-1])
    u = np.sin(f)[None, None, :] * np.cos(c)[:, None, None] * np.ones((1, 4, 1))
    v = -np.cos(c)[None, None, :] * np.sin(f)[:, None, None] * np.ones((1, 4, 1))
    solver.set_flow(velocity=(u, v, np.zeros((n, 5, n))))
    steps = max(round(time * n / (size * cfl)), 1)
    for m in range(steps):
        solver.advance(time * (m + 1) / steps)
    decay = math.exp(-2.0 * viscosity * time)
    return float(np.sqrt(np.mean((solver.velocity[0] - decay * u[:, :, :-1]) ** 2)))


@pytest.mark.parametrize(("viscosity", "least_order"), [(0.0, 1.8), (0.05, 1.8)])
def test_taylor_green_order(viscosity, least_order):
    """Vortices in a square: advection keeps them, viscosity damps them; second order in the cell, first in the step."""
    errors = [taylor_green(n, viscosity, 0.5, cfl=3.2 / n) for n in (16, 32)]
    assert math.log2(errors[0] / errors[1]) > least_order
    assert errors[1] < 0.01


def test_save_and_restore_bit_for_bit():
    grid = Grid.uniform((0, 0, 0), (0.6, 0.16, 0.3), 0.02)

    def fresh():
        solver = FlowSolver(grid, (), Water(0.1), FlowSettings(follow=None, far_x=False, far_y=False))
        solver.start()
        fraction = np.zeros(grid.shape)
        fraction[:, :10, :10] = 1.0
        solver.set_flow(fraction=fraction)
        return solver

    one = fresh()
    for n in range(10):
        one.advance(0.004 * (n + 1))
    saved = one.save()
    for n in range(10, 20):
        one.advance(0.004 * (n + 1))
    other = fresh()
    other.restore(saved)
    for n in range(10, 20):
        other.advance(0.004 * (n + 1))
    a, b = one.save(), other.save()
    for name in a:
        assert np.array_equal(a[name], b[name]), name


def test_two_threads_give_the_same_bits():
    """Sums are taken per row and then in order, so the number of threads changes nothing."""
    if numba.config.NUMBA_NUM_THREADS < 2:
        pytest.skip("one core only")
    states = []
    for threads in (1, 2):
        grid = Grid.uniform((0, 0, 0), (0.6, 0.16, 0.3), 0.02)
        solver = FlowSolver(grid, (), Water(0.1), FlowSettings(follow=None, far_x=False, far_y=False, threads=threads))
        solver.start()
        fraction = np.zeros(grid.shape)
        fraction[:, :10, :10] = 1.0
        solver.set_flow(fraction=fraction)
        for n in range(10):
            solver.advance(0.004 * (n + 1))
        states.append(solver.save())
    for name in states[0]:
        assert np.array_equal(states[0][name], states[1][name]), name


def test_far_sides_absorb_waves_and_keep_the_level():
    """A hump runs out of a 4 m channel; 3 s later less than 10 % of its waves is left and the level is the old one."""
    cell = 0.025
    grid = Grid.uniform((-2, 0, 0), (2, 4 * cell, 0.25), cell)
    settings = FlowSettings(follow=None, far_y=False, closure=None, viscosity=0.0)
    solver = FlowSolver(grid, (), Water(0.12), settings)
    solver.start()
    x = 0.5 * (grid.x_faces[1:] + grid.x_faces[:-1])
    level = 0.12 + 0.006 * np.exp(-((x / 0.4) ** 2))
    solver.set_flow(
        fraction=np.clip((level[None, None] - grid.z_faces[None, :-1, None]) / cell, 0, 1) * np.ones((4, 1, 1))
    )
    inner = np.abs(x) < 1.4
    heights = []
    for n in range(400):
        solver.advance(0.01 * (n + 1))
        heights.append(solver.surface_height()[1, inner] - 0.12)
    outgoing = np.abs(heights[50]).max()
    assert outgoing > 0.002
    assert np.abs(heights[300:]).max() < 0.1 * outgoing
    assert abs(np.mean(heights[-1])) < 1e-4
