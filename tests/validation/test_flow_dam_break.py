"""Dam break of Martin & Moyce (1952), n^2 = 2, a = 2.25 inch: front and height of the collapsing column."""

from pathlib import Path

import numpy as np
import pytest

from exumob.environment import GRAVITY, Water
from exumob.flow import FlowSettings, FlowSolver, Grid

A = 0.05715
DATA = Path(__file__).parent / "data" / "martin_moyce.csv"


def published(kind):
    rows = [line.split(",")[1:] for line in DATA.read_text().splitlines() if line.startswith(kind + ",")]
    return np.array(rows, dtype=float).T


@pytest.fixture(scope="module", params=[10, pytest.param(20, marks=pytest.mark.slow)])
def collapse(request):
    """Time T = t sqrt(2 g / a), front Z = x / a along the bed, height H = eta / (2 a) at the wall."""
    cells = request.param
    size = A / cells
    grid = Grid.uniform((0, 0, 0), (5 * A, 4 * size, 2.6 * A), size)
    settings = FlowSettings(follow=None, far_x=False, far_y=False, closure=None)
    solver = FlowSolver(grid, (), Water(1e-6), settings)
    solver.start()
    fraction = np.zeros(grid.shape)
    fraction[:, : 2 * cells, :cells] = 1.0
    solver.set_flow(fraction=fraction)
    volume = solver.water_volume()
    times, fronts, heights = np.arange(0.0, 3.5, 0.1), [1.0], [1.0]
    for time in times[1:] / np.sqrt(2.0 * GRAVITY / A):
        solver.advance(time)
        bed = solver.fraction[2, 0]
        i = np.nonzero(bed >= 0.5)[0][-1]
        fronts.append((i + 0.5 + (bed[i] - 0.5) / (bed[i] - bed[i + 1])) / cells)
        heights.append(solver.surface_height()[2, 0] / (2.0 * A))
    assert solver.water_volume() == pytest.approx(volume, rel=1e-5)
    assert solver.fraction.min() >= -1e-6
    assert solver.fraction.max() <= 1.0 + 1e-6
    return times, np.array(fronts), np.array(heights)


def test_front_speed(collapse):
    """Slope of Z(T) between Z = 1.6 and 4: 1.36 within 8 % (the opening of the gate is unknown: a shift is free)."""
    times, fronts, _ = collapse
    part = (fronts > 1.6) & (fronts < 4.0)
    assert np.polyfit(times[part], fronts[part], 1)[0] == pytest.approx(1.36, rel=0.08)


def test_front_position(collapse):
    """Time at which the front passes: within 0.12 of the measurement once the one shift is taken out."""
    times, fronts, _ = collapse
    t, z = published("T2")
    part = (z > 1.3) & (z < 4.0)
    lag = np.interp(z[part], fronts, times) - t[part]
    assert np.abs(lag - lag.mean()).max() < 0.12
    assert abs(lag.mean()) < 0.4


def test_height_at_the_wall(collapse):
    """H(tau), tau = t sqrt(g / a): within 0.05 (reading error of the film about 0.02)."""
    times, _, heights = collapse
    tau, height = published("T6")
    part = tau * np.sqrt(2.0) < times[-1]
    assert np.abs(np.interp(tau[part] * np.sqrt(2.0), times, heights) - height[part]).max() < 0.05
