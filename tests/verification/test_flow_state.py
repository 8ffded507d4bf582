"""The state of a run: saved and restored, and the same for any number of threads. Measurements: exumob/verification."""

import numba
import numpy as np
import pytest

from exumob.environment import Water
from exumob.flow import FlowSettings, FlowSolver, Grid


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
