"""Does water in a closed basin rest, slosh and whirl as theory says?

Still water, the first sloshing mode (Lamb, Hydrodynamics, 1932, art. 228), decaying Taylor-Green vortices, and the
iterations of the pressure solver, which must not grow with the number of cells.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numba
import numpy as np

from exumob.flow import Grid
from exumob.flow.settings import SurfaceTransport
from exumob.support.constants import GRAVITY
from exumob.support.declared import checked
from exumob.verification.check import Case, Check, absolute, at_least, relative, reported
from exumob.verification.initial import TANK, centers, hump, started
from exumob.verification.measures import crossing_period, fitted_order
from exumob.verification.options import CellSize, Interval
from exumob.water.conditions import Water


def still_water() -> list[Check]:
    """Water at rest, its surface at three places within a cell: nothing may move."""
    checks = []
    for level in (0.100, 0.107, 0.113):
        solver = started(Grid.uniform((0, 0, 0), (0.4, 0.2, 0.2), 0.02), Water(level))
        for n in range(50):
            solver.advance(0.005 * (n + 1))
        speed = max(float(np.abs(q).max()) for q in solver.velocity)
        where = f"level at {level / 0.02:.2f} cells"
        checks.append(absolute(f"largest speed, {where}", speed, 0.0, 1e-4, "m/s"))
        rise = float(np.abs(solver.surface_height() - level).max())
        checks.append(absolute(f"change of level, {where}", rise, 0.0, 1e-9, "m"))
    return checks


class Sloshing(NamedTuple):
    """Measures of a sloshing run."""

    period: float
    """Period found [s]"""
    theory: float
    """Period of linear theory [s]"""
    kept: float
    """Largest amplitude in the second half over that at the begin [-]"""
    error: float
    """Root mean square of the modal amplitude against the cosine of linear theory, over the amplitude [-]"""
    volume: float
    """Final over initial volume, less 1 [-]"""
    least: float
    most: float
    """Range of the fraction [-]"""


@checked
def slosh(
    level: float,
    cell: CellSize,
    dt: Interval,
    amplitude: float = 0.004,
    periods: float = 2.0,
    surface: SurfaceTransport = "thinc",
) -> Sloshing:
    """First mode of a basin 1 m long from rest (Lamb, Hydrodynamics, art. 228: omega^2 = g k tanh k h)."""
    grid = Grid.uniform((0, 0, 0), (1.0, 4 * cell, max(0.3, 1.2 * level)), cell)
    # the mean of the cosine over a cell, so that the initial surface is the same on every grid
    shape = np.diff(np.sin(math.pi * grid.x_faces)) / (math.pi * np.diff(grid.x_faces))
    solver = started(grid, Water(level), replace(TANK, surface=surface), level + amplitude * shape)
    volume = solver.water_volume()
    theory = 2.0 * math.pi / math.sqrt(GRAVITY * math.pi * math.tanh(math.pi * level))
    modal, times, least, most = [], [], 0.0, 1.0
    for n in range(int(periods * theory / dt) + 1):
        solver.advance(dt * (n + 1))
        modal.append(2.0 * np.mean((solver.surface_height()[0] - level) * shape))
        times.append(solver.time)
        least, most = min(least, float(solver.fraction.min())), max(most, float(solver.fraction.max()))
    a, t = np.array(modal), np.array(times)
    period = crossing_period(t, a, dt)
    kept = float(np.abs(a[len(a) // 2 :]).max()) / amplitude
    error = float(np.sqrt(np.mean((a / amplitude - np.cos(2.0 * math.pi * t / theory)) ** 2)))
    return Sloshing(period, theory, kept, error, solver.water_volume() / volume - 1.0, least, most)


def sloshing(surface: SurfaceTransport = "thinc", name: str = "sloshing") -> list[Check]:
    """Depth about 0.15 of the length, amplitude 0.4 % of it; four places of the level within a cell."""
    checks, runs = [], {}
    for level in (0.150, 0.155, 0.160, 0.165):
        run = runs[level] = slosh(level, cell=0.02, dt=4e-3, surface=surface)
        where = f"level at {level / 0.02:.2f} cells"
        checks.append(relative(f"{name} period, {where}", run.period, run.theory, 3e-3, "s"))
        checks.append(relative(f"{name} amplitude kept over two periods, {where}", run.kept, 1.0, 0.03))
    worst = max((r.volume for r in runs.values()), key=abs)
    checks.append(absolute(f"{name}, change of volume", worst, 0.0, 1e-5))
    checks.append(absolute(f"{name}, fraction below 0", min(r.least for r in runs.values()), 0.0, 1e-6))
    checks.append(absolute(f"{name}, fraction above 1", max(r.most for r in runs.values()) - 1.0, 0.0, 1e-6))
    return checks


def sloshing_order() -> list[Check]:
    """Modal amplitude over two periods, depth half the length, on three grids; steps fall with the square of the cell.

    The amplitude, 2 % of the length, moves the surface through whole cells: below one cell, the error depends more on
    the surface's place in its cell than on the cell's size. Linear theory errs by 0.05 % in the period there.
    """
    cells = (1.0 / 20.0, 1.0 / 30.0, 1.0 / 45.0)
    runs = [slosh(0.5, cell, dt=4e-3 * (cell / 0.025) ** 2, amplitude=0.02) for cell in cells]
    errors = [run.error for run in runs]
    checks = [
        reported(f"sloshing, error of the surface, cell {1e3 * c:.1f} mm", e, 0.0)
        for c, e in zip(cells, errors, strict=True)
    ]
    checks.append(at_least("sloshing, order of convergence", fitted_order(cells, errors), 1.0))
    return checks


def vortices(n: int, viscosity: float, time: float) -> tuple[float, float]:
    """Taylor-Green vortices in a square of n by n cells with slip walls, steps proportional to the cell squared.

    Returns
    -------
    float, float
        Error of the velocity (root mean square) over that of the velocity at the begin, and kinetic energy over theory.
    """
    size = math.pi
    grid = Grid(np.linspace(0, size, n + 1), np.linspace(0, size, n + 1), np.linspace(0, 4 * size / n, 5))
    settings = replace(TANK, closed_top=True, viscosity=viscosity, tolerance=1e-9)
    solver = started(grid, Water(4 * size / n), settings)
    f, c = grid.x_faces, centers(grid.x_faces)
    u = np.sin(f)[None, None, :] * np.cos(c)[:, None, None] * np.ones((1, 4, 1))
    v = -np.cos(c)[None, None, :] * np.sin(f)[:, None, None] * np.ones((1, 4, 1))
    solver.set_flow(velocity=(u, v, np.zeros((n, 5, n))))
    steps = max(round(time * n * n / (3.2 * size)), 1)
    for m in range(steps):
        solver.advance(time * (m + 1) / steps)
    decay = math.exp(-2.0 * viscosity * time)
    now, begin = solver.velocity[0], u[:, :, :-1]
    energy = float(np.sum(now**2) / np.sum(begin**2)) / decay**2
    return float(np.sqrt(np.mean((now - decay * begin) ** 2) / np.mean(begin**2))), energy


def taylor_green() -> list[Check]:
    """Exact decay exp(-2 nu t) of vortices that advection leaves as they are; second order in the cell."""
    counts, checks = (16, 24, 32), []
    for name, viscosity in (("advection", 0.0), ("diffusion", 0.05)):
        runs = [vortices(n, viscosity, 0.5) for n in counts]
        order = fitted_order([1.0 / n for n in counts], [r[0] for r in runs])
        checks.append(at_least(f"Taylor-Green, order of convergence, {name}", order, 1.8))
        checks.append(absolute(f"Taylor-Green, error of the velocity, {name}, 32 cells", runs[-1][0], 0.0, 0.01))
        checks.append(reported(f"Taylor-Green, kinetic energy, {name}, 32 cells", runs[-1][1], 1.0))
    return checks


def pressure_effort() -> list[Check]:
    """Iterations of the pressure solver on a spreading hump, 100k to 800k cells; one against two threads.

    Stretched grids are such as that round the vehicle: their widest cells are four to five times as long as high.
    """
    checks = []
    uniform = {cell: Grid.uniform((-1.5, -1.5, 0), (1.5, 1.5, 0.3), cell) for cell in (0.030, 0.0238, 0.0189, 0.015)}
    low, high = ((-0.7, -0.5, 0.0), (-2.4, -1.8, 0.0)), ((0.7, 0.5, 0.24), (1.8, 1.8, 0.42))
    stretched = {cell: Grid.stretched(low[0], high[0], low[1], high[1], cell) for cell in (0.030, 0.018, 0.0145)}
    for kind, grids in (("", uniform), (", stretched up to 1:5", stretched)):
        counts = []
        for cell, grid in grids.items():
            solver = started(grid, Water(0.12), TANK, hump(grid, 0.12, 0.03, 0.3))
            steps, iterations = 0, 0
            for n in range(4):
                solver.advance(0.2 * cell * (n + 1))
                steps, iterations = steps + solver.report.steps, iterations + solver.report.iterations
            counts.append(iterations / steps)
            name = f"pressure iterations a step, {grid.n_cells // 1000}k cells{kind}"
            checks.append(Check(name, counts[-1], 8.0, max(counts[-1] - 8.0, 0.0), 0.0))
        checks.append(relative(f"pressure iterations, most over least{kind}", max(counts) / min(counts), 1.0, 0.3))
    if numba.config.NUMBA_NUM_THREADS >= 2:
        fields = []
        for threads in (1, 2):
            grid = Grid.uniform((-1.5, -1.5, 0), (1.5, 1.5, 0.3), 0.05)
            solver = started(grid, Water(0.12), replace(TANK, threads=threads), hump(grid, 0.12, 0.03, 0.3))
            for n in range(10):
                solver.advance(0.01 * (n + 1))
            fields.append(solver.velocity[0].copy())
        apart = float(np.abs(fields[1] - fields[0]).max() / np.abs(fields[0]).max())
        checks.append(absolute("one and two threads, velocity apart", apart, 0.0, 1e-4))
    return checks


CASES: tuple[Case, ...] = (
    Case("still-water", "Water at rest stays at rest, wherever its surface lies in a cell", still_water, 0.02),
    Case("sloshing", "First mode of a basin against linear theory (Lamb 1932, art. 228)", sloshing, 0.2),
    Case(
        "sloshing-plic",
        "The same with planes in the cells of the surface (PLIC)",
        lambda: sloshing("plic", "sloshing with PLIC"),
        0.2,
    ),
    Case("sloshing-order", "Convergence of the sloshing surface on three grids", sloshing_order, 0.3),
    Case("taylor-green", "Vortices in a square: exact solution, advection and diffusion", taylor_green, 0.1),
    Case("pressure", "Iterations of the multigrid solver from 100k to 800k cells", pressure_effort, 0.5),
)
