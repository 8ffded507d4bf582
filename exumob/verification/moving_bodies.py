"""Are the loads on a moving body smooth, symmetric, and those of the water that it displaces?

Limits: volume 1e-5 beside bodies at rest, 0.1 % while a box plunges or a wheel drives; noise of the lift 1 % through
the grid, 0.1 % moving with it, independent of the step within 20 %; mirror symmetry 1e-4.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from exumob.flow import FlowSettings, FlowSolver, Grid, Poses, box, cylinder
from exumob.ground.terrain import Terrain
from exumob.support.arrays import Array
from exumob.support.constants import GRAVITY
from exumob.support.declared import checked
from exumob.support.rotations import about_z
from exumob.verification.check import Case, Check, absolute, relative, reported
from exumob.verification.initial import VISCOUS_TANK, filled_to
from exumob.verification.options import CellSize, Duration, Interval
from exumob.verification.single_body import loads_over, one_pose
from exumob.water.conditions import Water


@checked
def plunge(shift: float = 0.0, dt: Interval = 2e-3, cell_size: CellSize = 0.02) -> tuple[Array, float, float]:
    """Box driven through the surface of a tank at 0.4 m/s for 0.3 s.

    Returns
    -------
    loads : array, shape (n, 6)
        [N, N m]
    error : float
        Largest volume error over the tank's volume.
    buoyancy : float
        Buoyancy of the box at the end, on the mean level [N].
    """
    grid = Grid.uniform((-0.6, -0.5, 0), (0.6, 0.5, 0.4), cell_size)
    solver = FlowSolver(grid, (box(0.4, 0.3, 0.15),), Water(0.2), VISCOUS_TANK)
    top, speed, until = 0.30 + shift, np.array([0.0, 0.0, -0.4]), 0.3

    def pose(t: float) -> Poses:
        return one_pose(np.array([0.003, 0.001, top]) + speed * t, speed)

    solver.start(pose(0.0))
    volume, loads, errors = solver.water_volume(), [], []
    for n in range(round(until / dt)):
        loads.append(solver.advance(dt * (n + 1), pose(dt * (n + 1)))[0])
        errors.append(solver.water_volume() / volume - 1.0)
    draught = float(np.median(solver.surface_height()[0])) - (top - 0.4 * until - 0.075)
    return np.array(loads), float(np.abs(errors).max()), 1000.0 * GRAVITY * 0.4 * 0.3 * draught


@checked
def check_plunge(cell_size: CellSize = 0.02) -> list[Check]:
    """Two places within a cell: volume within 0.1 %, lift near Archimedes (the box still accelerates water: 25 %)."""
    checks = []
    for shift in (0.0, 0.007):
        loads, error, buoyancy = plunge(shift, cell_size=cell_size)
        checks.append(absolute(f"volume error, shift {1e3 * shift:g} mm", error, 0.0, 1e-3))
        lift = loads[-25:, 2].mean()
        checks.append(relative(f"lift after the plunge, shift {1e3 * shift:g} mm", lift, buoyancy, 0.25, "N"))
    return checks


@checked
def slam(void_stiffness: float, cell_size: CellSize = 0.02, dt: Interval = 5e-4) -> tuple[float, float]:
    """Box of 0.4 x 0.4 m that falls flat on 0.6 m of water at 1 m/s: impulse over half its added mass times its speed.

    The impulse is that of the force less the buoyancy of what is below the still level, from the release 30 mm above it
    until 10 ms after the contact. A square plate of side a has an added mass of 0.579 pi / 4 rho a^3 (DNV-RP-C205,
    Table D-2), half of which is on its one side (von Karman 1929); bed and walls of this tank add 1 % to it.

    Parameters
    ----------
    void_stiffness : float
        `FlowSettings.void_stiffness`.

    Returns
    -------
    impulse : float
        [-]
    peak : float
        Largest force [N].
    """
    side, depth, tall, gap, speed = 0.4, 0.6, 0.2, 0.03, np.array([0.0, 0.0, -1.0])
    grid = Grid.stretched((-0.3, -0.3, 0), (0.3, 0.3, 0.75), (-0.8, -0.8, 0), (0.8, 0.8, 1.0), cell_size, 1.1)
    solver = FlowSolver(
        grid, (box(side, side, tall),), Water(depth), replace(VISCOUS_TANK, void_stiffness=void_stiffness)
    )

    def pose(t: float) -> Poses:
        return one_pose(np.array([0.0, 0.001, depth + 0.5 * tall + gap]) + speed * t, speed)

    until = gap + 0.01
    lift = loads_over(solver, pose, dt, until)[:, 2]
    below = np.maximum(dt * np.arange(1, len(lift) + 1) - gap, 0.0)
    impulse = dt * np.sum(lift - 1000.0 * GRAVITY * side**2 * below)
    return float(impulse / (0.5 * 0.579 * math.pi / 4.0 * 1000.0 * side**3)), float(lift.max())


def check_slam() -> list[Check]:
    """Impulse within 20 %, and within 10 % of that without the stiffness of voids; the peak is reported."""
    (soft, soft_peak), (stiff, stiff_peak) = slam(1000.0), slam(0.0)
    return [
        relative("impulse of a flat slam, over that of the added mass", soft, 1.0, 0.2),
        relative("the same, voids close without resistance", stiff, soft, 0.1),
        reported("peak of the force", soft_peak, unit="N"),
        reported("the same, voids close without resistance", stiff_peak, unit="N"),
    ]


@checked
def volume_beside_bodies(kind: str, cell_size: CellSize = 0.02) -> float:
    """Water that breaks over a body at rest in the surface: largest volume error over the tank's volume.

    Parameters
    ----------
    kind : str
        "box" (turned by 30 degrees), "column" (round, upright) or "both".
    """
    grid = Grid.uniform((0.0, -0.2, 0), (0.8, 0.2, 0.4), cell_size)
    upright = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    bodies = {
        "box": (box(0.1, 0.1, 0.5), (0.45, 0.013, 0.246), about_z(0.52)),
        "column": (cylinder(0.06, 0.5, 0.0), (0.57, -0.011, 0.246), upright),
    }
    chosen = list(bodies.values()) if kind == "both" else [bodies[kind]]
    solver = FlowSolver(grid, tuple(solid for solid, _, _ in chosen), Water(0.06), VISCOUS_TANK)
    poses = Poses.at_rest([place for _, place, _ in chosen], np.array([turned for _, _, turned in chosen]))
    solver.start(poses)
    level = np.where(0.5 * (grid.x_faces[1:] + grid.x_faces[:-1]) < 0.25, 0.23, 0.06)
    solver.set_flow(fraction=filled_to(grid, level))
    volume, errors = solver.water_volume(), []
    for n in range(100):
        solver.advance(0.005 * (n + 1), poses)
        errors.append(solver.water_volume() / volume - 1.0)
    return float(np.abs(errors).max())


@checked
def volume_round_wheel(slope: float, duration: Duration = 0.6, cell_size: CellSize = 0.025) -> float:
    """A wheel, 1 cm deep in the bed, drives at 0.5 m/s through 5 to 10 cm of water: volume error over the tank's.

    Parameters
    ----------
    slope : float
        Rise of the bed ahead of it [-]; 0: the flat bed at z = 0, otherwise a terrain.
    """
    radius, speed, sunk, depth = 0.1, 0.5, 0.01, 0.05
    water, terrain = (Water(level=0.0), Terrain(slope_x=slope)) if slope else (Water(depth), None)
    grid = Grid.uniform((-1.2, -0.3, -0.2 if slope else 0.0), (0.6, 0.3, 0.3), cell_size)
    solver = FlowSolver(grid, (cylinder(radius, 0.08, 0.01),), water, VISCOUS_TANK, terrain)
    along = np.array([1.0, 0.0, slope]) / math.hypot(1.0, slope)

    def pose(t: float) -> Poses:
        x = -0.7 + speed * t * along[0]
        return one_pose((x, 0.003, slope * x + (radius - sunk) / along[0]), speed * along)

    solver.start(pose(0.0))
    volume, errors = solver.water_volume(), []
    for n in range(round(duration / 0.005)):
        solver.advance(0.005 * (n + 1), pose(0.005 * (n + 1)))
        errors.append(solver.water_volume() / volume - 1.0)
    return float(np.abs(errors).max())


def check_volume() -> list[Check]:
    """A dam break against bodies at rest: volume to 1e-5; a wheel that drives on a flat bed and a slope: to 0.1 %."""
    return [
        *(
            absolute(f"volume beside {name} at rest in the surface", volume_beside_bodies(kind), 0.0, 1e-5)
            for kind, name in (("box", "a turned box"), ("column", "a round column"), ("both", "both, close together"))
        ),
        absolute("volume round a wheel that drives over a flat bed", volume_round_wheel(0.0), 0.0, 1e-3),
        absolute("volume round a wheel that drives up a slope", volume_round_wheel(0.15), 0.0, 1e-3),
    ]


@checked
def force_noise(follow: int | None, dt: Interval, cell_size: CellSize = 0.02) -> float:
    """Noise of a box's lift over the lift, less a 21 ms average; 0.5 m/s through the grid, or with it (follow = 0)."""
    grid = Grid.uniform((-0.9, -0.4, 0), (0.9, 0.4, 0.3), cell_size)
    settings = FlowSettings(follow=follow, absorbing_width=0.25)
    solver = FlowSolver(grid, (box(0.3, 0.2, 0.15, friction=0.005),), Water(0.16), settings)
    start = 0.0 if follow is not None else -0.3

    def pose(t: float) -> Poses:
        r = min(t / 0.2, 1.0)
        speed = 0.5 * r**3 * (10.0 - 15.0 * r + 6.0 * r * r)
        way = 0.5 * (0.2 * r**4 * (2.5 - 3.0 * r + r * r) + max(t - 0.2, 0.0))
        return one_pose((start + way, 0.001, 0.16), (speed, 0.0, 0.0))

    lift = loads_over(solver, pose, dt, 0.6)[:, 2]
    n = round(0.02 / dt) | 1
    rest = (lift - np.convolve(lift, np.ones(n) / n, "same"))[round(0.3 / dt) : -n]
    return float(rest.std() / lift[round(0.3 / dt) :].mean())


def check_noise() -> list[Check]:
    """The lift's noise moving with the grid, through it, and through it at half the step."""
    with_grid, coarse, fine = force_noise(0, 2e-3), force_noise(None, 2e-3), force_noise(None, 1e-3)
    return [
        absolute("noise of the lift moving with the grid, dt 2 ms", with_grid, 0.0, 1e-3),
        absolute("noise of the lift through the grid, dt 2 ms", coarse, 0.0, 0.01),
        absolute("noise of the lift through the grid, dt 1 ms", fine, 0.0, 0.01),
        relative("noise at dt 1 ms over dt 2 ms", fine / coarse, 1.0, 0.2),
    ]


@checked
def mirror_loads(side: float, cell_size: CellSize = 0.03) -> Array:
    """Loads [N, N m], shape (n, 6), on a box that drifts, yaws and meets a current from port (1) or starboard (-1)."""
    grid = Grid.stretched((-0.3, -0.3, 0), (0.3, 0.3, 0.2), (-0.8, -0.8, 0), (0.8, 0.8, 0.3), cell_size)
    solver = FlowSolver(
        grid, (box(0.3, 0.2, 0.2, friction=0.01),), Water(0.12, 0.5, side * 2.5), FlowSettings(absorbing_width=0.2)
    )

    def pose(t: float) -> Poses:
        return one_pose((0.3 * t, side * 0.2 * t, 0.15), (0.3, side * 0.2, 0.0), side * (0.3 + 0.5 * t), side * 0.5)

    return loads_over(solver, pose, 0.004, 0.16)


def check_symmetry() -> list[Check]:
    """Mirrored motion and current: mirrored loads."""
    port, starboard = mirror_loads(1.0), mirror_loads(-1.0)
    sign = np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])
    error = np.abs(port[1:] - sign * starboard[1:]).max() / np.abs(port).max()
    return [absolute("loads on a box and its mirror image, over the largest", float(error), 0.0, 1e-4)]


CASES: tuple[Case, ...] = (
    Case("mirror", "A drifting, yawing box and its mirror image: mirrored loads", check_symmetry, 0.1),
    Case(
        "volume", "Water that breaks over bodies at rest, and round a wheel that drives: its volume", check_volume, 0.1
    ),
    Case(
        "plunge", "A box driven through the surface: volume of the water, lift of the box", check_plunge, 0.5, slow=True
    ),
    Case(
        "slam",
        "A box that falls flat on the water: its impulse, with caught air and without",
        check_slam,
        0.3,
        slow=True,
    ),
    Case("noise", "A box passing through the grid, or moving with it: noise of its lift", check_noise, 1.0, slow=True),
)
