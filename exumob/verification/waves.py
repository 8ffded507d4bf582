"""Do waves of permanent form keep their speed and their height?

A Stokes wave and a solitary wave in a long tank, against the exact waves of Rienecker & Fenton (J. Fluid Mech. 104
(1981) 119): speed within 1 %, order at least 1; the loss of height is reported.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from scipy.optimize import root

from exumob.flow import FlowSolver, Grid
from exumob.support.arrays import Array
from exumob.support.constants import GRAVITY
from exumob.support.declared import Declared, checked
from exumob.support.quantities import Quantity
from exumob.verification.check import Case, Check, at_least, relative, reported
from exumob.verification.initial import TANK, centers, filled_to
from exumob.verification.measures import fitted_order
from exumob.verification.options import WholeCells
from exumob.water.conditions import Water

LENGTH = Quantity("m", above=0.0, at_most=1e6)
"""Height, length and depth of a wave"""


@dataclass(frozen=True)
class SteadyWave(Declared):
    """Exact wave of permanent form on a flat bed by Fourier series (Rienecker & Fenton, J. Fluid Mech. 104 (1981)).

    Parameters
    ----------
    wave_number : float
        [1/m]
    speed : float
        Where the mean velocity at a fixed point below the troughs vanishes [m/s].
    level : array
        Cosine coefficients of the surface's height above the bed [m], the mean first.
    velocity : array
        Coefficients of the horizontal velocity at the height `reference` [m/s], one for each harmonic from the first.
    reference : float
        [m]
    """

    wave_number: Annotated[float, Quantity("1/m", above=0.0)]
    speed: Annotated[float, Quantity("m/s")]
    level: Annotated[Array, Quantity("m", shape=("harmonics + 1",))]
    velocity: Annotated[Array, Quantity("m/s", shape=("harmonics",))]
    reference: Annotated[float, Quantity("m", above=0.0)]

    @classmethod
    @checked
    def solve(
        cls,
        height: Annotated[float, LENGTH],
        length: Annotated[float, LENGTH],
        depth: Annotated[float, LENGTH],
        harmonics: Annotated[int, Quantity("1", at_least=2, at_most=1000)],
        crest: Annotated[Array | None, Quantity("1", above=0.0, shape=("harmonics + 1",))] = None,
    ) -> SteadyWave:
        """Solve for a wave of given height from trough to crest, length and mean depth [m].

        Parameters
        ----------
        crest : array, shape (harmonics + 1,), optional
            Guess of the surface from crest to trough over the depth [-]; a cosine if left out.

        Raises
        ------
        ValueError
            If the equations have no solution near the guess.
        """
        n, k = harmonics, 2.0 * math.pi * depth / length  # below: lengths over depth, speeds over sqrt(g depth)
        j, m = np.arange(1, n + 1), np.arange(n + 1)
        phase = np.pi * np.outer(m, j) / n
        mean = np.full(n + 1, 1.0 / n)
        mean[[0, -1]] *= 0.5

        def equations(unknown: Array) -> Array:
            eta, b, (c, flow, energy) = unknown[: n + 1], unknown[n + 1 : -3], unknown[-3:]
            up, down = np.exp(k * np.outer(eta - 1.0, j)), np.exp(-k * np.outer(eta + 1.0, j))
            base = 1.0 + np.exp(-2.0 * k * j)
            cosh, sinh = (up + down) / base, (up - down) / base
            u, w = (b * cosh * np.cos(phase)).sum(1) - c, (b * sinh * np.sin(phase)).sum(1)
            stream = (b / (k * j) * sinh * np.cos(phase)).sum(1) - c * eta + flow
            return np.concatenate(
                [stream, 0.5 * (u**2 + w**2) + eta - energy, [mean @ eta - 1.0, eta[0] - eta[-1] - height / depth]]
            )

        c = math.sqrt(math.tanh(k) / k)
        eta = 1.0 + 0.5 * height / depth * np.cos(np.pi * m / n) if crest is None else crest
        current = (2.0 * mean * c * (1.0 - 1.0 / eta)) @ np.cos(phase)
        found = root(equations, [*eta, *(current * k * j / np.tanh(k * j)), c, c, 0.5 * c**2 + 1.0], tol=1e-12)
        if not np.abs(equations(found.x)).max() < 1e-9:
            raise ValueError(
                f"SteadyWave.solve: no wave of height {height} m, length {length} m in {depth} m of water; "
                "waves break at 0.14 of their length or 0.8 of the depth, so give a lower one."
            )
        eta, b, c = found.x[: n + 1], found.x[n + 1 : -3], float(found.x[-3])
        level = np.array([mean @ eta, *(2.0 * (mean * eta) @ np.cos(phase))])
        level[-1] *= 0.5
        unit = math.sqrt(GRAVITY * depth)
        return cls(k / depth, unit * c, depth * level, unit * b, depth)

    def surface(self, x: Array) -> Array:
        """Height above the bed [m] at distances x from a crest [m]."""
        j = np.arange(len(self.level))
        return np.cos(self.wave_number * np.multiply.outer(x, j)) @ self.level

    def horizontal(self, x: Array, z: Array) -> Array:
        """Horizontal velocity [m/s], shape (z, x), at heights z over the bed [m]."""
        k = self.wave_number * np.arange(1, len(self.level))
        rise = np.cosh(np.multiply.outer(z, k)) / np.cosh(k * self.reference)
        return (rise * self.velocity) @ np.cos(np.multiply.outer(k, x))

    def vertical(self, x: Array, z: Array) -> Array:
        """Vertical velocity [m/s], shape (z, x)."""
        k = self.wave_number * np.arange(1, len(self.level))
        rise = np.sinh(np.multiply.outer(z, k)) / np.cosh(k * self.reference)
        return (rise * self.velocity) @ np.sin(np.multiply.outer(k, x))


@checked
def solitary_wave(height: Annotated[float, LENGTH], depth: Annotated[float, LENGTH]) -> tuple[SteadyWave, float]:
    """Exact solitary wave as a periodic one so long, 32 depths, that its trough is flat, and the trough's velocity.

    The depth [m] is that of the trough; the guess is the wave of Boussinesq.
    """
    length, harmonics, mean = 32.0 * depth, 48, depth
    for _ in range(20):  # the mean depth that leaves `depth` below the trough
        x = np.linspace(0.0, 0.5 * length, harmonics + 1) / depth
        hump = height / depth / np.cosh(math.sqrt(0.75 * height / depth) * x) ** 2
        wave = SteadyWave.solve(height, length, mean, harmonics, (depth / mean) * (1.0 + hump))
        trough = float(wave.surface(np.array(0.5 * length)))
        if abs(trough / depth - 1.0) < 1e-10:
            break
        mean += depth - trough
    return wave, float(wave.horizontal(np.array([0.5 * length]), np.array([0.0]))[0, 0])


def launched(
    wave: SteadyWave, grid: Grid, depth: float, crest: float, reach: float = math.inf, still: float = 0.0
) -> FlowSolver:
    """Tank with the wave in it, a crest at x = `crest` [m]; beyond `reach` from it the wave's value there goes on.

    `still` is a velocity of the water taken off everywhere [m/s].
    """
    solver = FlowSolver(grid, (), Water(depth), TANK)
    solver.start()

    def place(x: Array) -> Array:
        return np.clip(x - crest, -reach, reach)

    xf, xc, zf, zc = grid.x_faces, centers(grid.x_faces), grid.z_faces, centers(grid.z_faces)
    highest = float(wave.surface(np.array(0.0))) + 2.0 * grid.smallest_width
    u = wave.horizontal(place(xf), np.minimum(zc, highest)) - still
    w = wave.vertical(place(xc), np.minimum(zf, highest))
    across = np.ones((grid.shape[0], 1, 1))
    v = np.zeros((grid.shape[0] + 1, *grid.shape[1:]))
    fine = np.linspace(grid.x_faces[0], grid.x_faces[-1], 10 * grid.shape[2] + 1)
    level = wave.surface(place(0.5 * (fine[1:] + fine[:-1]))).reshape(-1, 10).mean(1)
    solver.set_flow(filled_to(grid, level), (u * across, v, w * across))
    return solver


@checked
def stokes_run(cells_per_depth: WholeCells) -> tuple[SteadyWave, float, float]:
    """Stokes wave, k depth = 1.31, k height / 2 = 0.15, seven lengths of it between walls.

    Followed over one length round a crest as long as nothing can have come from the walls, about 2.4 wavelengths.

    Returns
    -------
    SteadyWave, float, float
        The exact wave; speed of the first harmonic [m/s]; share of its height that it loses per wavelength [-].
    """
    depth, length = 0.25, 1.2
    wave = SteadyWave.solve(0.3 * length / (2.0 * math.pi), length, depth, 12)
    cell = depth / cells_per_depth
    grid = Grid.uniform((0, 0, 0), (7.0 * length, 4 * cell, 1.5 * depth), cell)
    begin = 1.1 * length
    solver = launched(wave, grid, depth, begin)
    longest = 5.4 * length / (wave.speed + math.sqrt(GRAVITY * depth))
    period, step = length / wave.speed, 0.24 * cell
    x, angle = centers(grid.x_faces), np.linspace(-math.pi, math.pi, 401)[:-1]
    times, phases, sizes = [], [], []
    for n in range(int(longest / step)):
        t = step * (n + 1)
        solver.advance(t)
        if t < 0.5 * period:
            continue
        here = np.interp(begin + wave.speed * t + angle / wave.wave_number, x, solver.surface_height()[1])
        harmonic = np.mean(here * np.exp(-1j * angle))
        times.append(t)
        phases.append(-np.angle(harmonic))
        sizes.append(abs(harmonic))
    slip = np.polyfit(times, np.unwrap(phases), 1)[0] / wave.wave_number
    return wave, wave.speed + float(slip), -float(np.polyfit(times, np.log(sizes), 1)[0]) * period


@checked
def solitary_run(cells_per_depth: WholeCells) -> tuple[float, float, float]:
    """Solitary wave, height 0.2 of the depth, over 14 depths in the middle of a tank.

    Returns
    -------
    float, float, float
        Speed of the crest and of the exact wave [m/s]; share of its height that it loses per 10 depths [-].
    """
    depth = 0.2
    wave, trough = solitary_wave(0.2 * depth, depth)
    cell = depth / cells_per_depth
    grid = Grid.uniform((0, 0, 0), (40.0 * depth, 4 * cell, 1.6 * depth), cell)
    solver = launched(wave, grid, depth, 12.0 * depth, 16.0 * depth, trough)
    exact, step, x = wave.speed - trough, 0.24 * cell, centers(grid.x_faces)
    times, places, heights = [], [], []
    for n in range(int(16.0 * depth / exact / step)):
        t = step * (n + 1)
        solver.advance(t)
        if exact * t < 2.0 * depth:
            continue
        level = solver.surface_height()[1] - depth
        near = np.abs(x - x[np.argmax(level)]) < 0.8 * depth
        a, b, c = np.polyfit(x[near] - x[np.argmax(level)], level[near], 2)
        times.append(t)
        places.append(x[np.argmax(level)] - 0.5 * b / a)
        heights.append(c - 0.25 * b * b / a)
    loss = -np.polyfit(times, np.log(heights), 1)[0] * 10.0 * depth / exact
    return float(np.polyfit(times, places, 1)[0]), exact, float(loss)


def stokes() -> list[Check]:
    """Stokes wave at 12 cells per depth."""
    wave, speed, loss = stokes_run(12)
    return [
        relative("Stokes wave, speed, 12 cells per depth", speed, wave.speed, 0.01, "m/s"),
        reported("Stokes wave, loss of height per wavelength, 12 cells per depth", loss, 0.0),
    ]


def solitary() -> list[Check]:
    """Solitary wave at 8 cells per depth."""
    speed, exact, loss = solitary_run(8)
    return [
        relative("solitary wave, speed, 8 cells per depth", speed, exact, 0.01, "m/s"),
        reported("solitary wave, loss of height per 10 depths, 8 cells per depth", loss, 0.0),
    ]


def waves_order() -> list[Check]:
    """Both waves on three grids; the order is that of the Stokes wave's speed.

    The solitary wave's speed is too near the exact one on all of them to fit an order, and so are the losses of height.
    """
    counts, checks, errors = (6, 9, 14), [], []
    for n in counts:
        wave, speed, loss = stokes_run(n)
        errors.append(speed / wave.speed - 1.0)
        checks.append(reported(f"Stokes wave, speed, {n} cells per depth", speed, wave.speed, "m/s"))
        checks.append(reported(f"Stokes wave, loss of height per wavelength, {n} cells per depth", loss, 0.0))
    order = fitted_order([1.0 / n for n in counts], errors)
    checks.append(at_least("Stokes wave, order of convergence of the speed", order, 1.0))
    for n in counts:
        speed, exact, loss = solitary_run(n)
        checks.append(relative(f"solitary wave, speed, {n} cells per depth", speed, exact, 0.01, "m/s"))
        checks.append(reported(f"solitary wave, loss of height per 10 depths, {n} cells per depth", loss, 0.0))
    return checks


CASES: tuple[Case, ...] = (
    Case("stokes-wave", "Stokes wave against the exact wave (Rienecker & Fenton 1981)", stokes, 0.2),
    Case("solitary-wave", "Solitary wave against the exact wave (Rienecker & Fenton 1981)", solitary, 0.15),
    Case("waves-order", "Both waves on three grids: speed, loss of height, order", waves_order, 0.8, slow=True),
)
