"""Solids in the water: hydrostatics, added mass, plunging, momentum balance, force noise, symmetry.

Limits: Archimedes 1 % (2 % for a wheel sunk into the bed); added mass 4 % at R / h = 5 and 2 % at 8, spread over places
within a cell 1 %; volume 0.2 % while a box plunges; momentum 1 %; noise of the lift 1 % through the grid, 0.1 % moving
with it, independent of the step within 20 %; mirror symmetry 1e-4.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from exumob.flow import FlowSettings, FlowSolver, Grid, Poses, Solid, box, cylinder, sphere
from exumob.support.arrays import Array
from exumob.support.constants import GRAVITY
from exumob.support.rotations import about_z
from exumob.verification import Case, Check, absolute, at_least, relative, reported
from exumob.water.conditions import Water

PLACES = ((0.0, 0.0, 0.0), (0.25, 0.1, 0.3), (0.5, 0.0, 0.0), (0.5, 0.5, 0.5))
"""Places of a solid's centre within a cell [cells], shape (n, 3)."""
TANK = FlowSettings(follow=None, far_x=False, far_y=False)


def one_pose(position: Sequence[float] | Array, velocity: Sequence[float] | Array, yaw: float = 0.0,
             yaw_rate: float = 0.0) -> Poses:  # fmt: skip
    """Pose of a single solid; position [m], velocity [m/s], yaw [rad], yaw rate [rad/s]."""
    return Poses(
        np.array([position], dtype=float), about_z(yaw)[None], np.array([velocity], dtype=float),
        np.array([[0.0, 0.0, yaw_rate]]), np.zeros(1),
    )  # fmt: skip


def loads_over(solver: FlowSolver, pose: Callable[[float], Poses], dt: float, duration: float) -> Array:
    """Start at pose(0) and go on in intervals of `dt` [s]: loads [N, N m], shape (n, 6)."""
    solver.start(pose(0.0))
    return np.array([solver.advance(dt * (n + 1), pose(dt * (n + 1)))[0] for n in range(round(duration / dt))])


# -- still water ----------------------------------------------------------------------------------------------------


def hydrostatic_loads(height: float, shift: float, yaw: float, cell_size: float = 0.02) -> tuple[Array, float]:
    """Loads [N, N m] on a box at rest in 0.15 m of water, and its buoyancy after Archimedes [N].

    Parameters
    ----------
    height, shift : float
        Of the box's centre above the bed and along x [m].
    yaw : float
        Heading [rad].
    cell_size : float
        [m]
    """
    length, width, tall, depth = 0.5, 0.3, 0.2, 0.15
    grid = Grid.uniform((-0.5, -0.4, 0), (0.5, 0.4, 0.3), cell_size)
    solver = FlowSolver(
        grid, (box(length, width, tall),), Water(depth), FlowSettings(follow=None, absorbing_width=0.1)
    )  # fmt: skip
    pose = one_pose((shift, 0.003, height), (0.0, 0.0, 0.0), yaw)
    loads = loads_over(solver, lambda t: pose, 0.004, 0.02)[-1]
    return loads, 1000.0 * GRAVITY * length * width * (depth - (height - 0.5 * tall))


def sunk_wheel_lift(cell_size: float = 0.015, sunk: float = 0.012) -> tuple[float, float]:
    """Lift [N] of a wheel that has sunk by `sunk` [m] into saturated soil, and that of the water it displaces [N]."""
    radius, width, depth = 0.1, 0.08, 0.15
    grid = Grid.uniform((-0.3, -0.24, 0), (0.3, 0.24, 0.3), cell_size)
    solver = FlowSolver(
        grid, (cylinder(radius, width),), Water(depth), FlowSettings(follow=None, absorbing_width=0.1)
    )  # fmt: skip
    pose = one_pose((0.004, 0.002, radius - sunk), (0.0, 0.0, 0.0))
    lift = loads_over(solver, lambda t: pose, 0.002, 0.002)[0, 2]
    angle = math.acos((depth - radius + sunk) / radius)  # half angle of the part above the water
    area = math.pi * radius**2 - radius**2 * (angle - math.sin(angle) * math.cos(angle))
    return float(lift), 1000.0 * GRAVITY * width * area


def check_hydrostatics(cell_size: float = 0.02) -> list[Check]:
    """A box at several places and headings, and a sunk wheel: Archimedes; no other loads."""
    checks = []
    for height, shift, yaw in ((0.160, 0.0, 0.0), (0.165, 0.007, 0.0), (0.173, 0.003, 0.5), (0.168, 0.011, 1.1)):
        loads, buoyancy = hydrostatic_loads(height, shift, yaw, cell_size)
        place = f"box at z {1e3 * height:g} mm, x {1e3 * shift:g} mm, yaw {math.degrees(yaw):.0f} deg"
        checks.append(relative(f"lift, {place}", loads[2], buoyancy, 0.01, "N"))
        rest = np.abs(np.delete(loads, 2)).max() / buoyancy
        checks.append(absolute(f"other loads over lift, {place}", rest, 0.0, 2e-3))
    lift, buoyancy = sunk_wheel_lift()
    checks.append(relative("lift, wheel 12 mm in the bed", lift, buoyancy, 0.02, "N"))
    checks.append(absolute("jump of a box's lift as the level passes mid cell", lift_jump(), 0.0, 0.01))
    return checks


# -- added mass -----------------------------------------------------------------------------------------------------


def sphere_added_mass(cells: float, place: Sequence[float] = (0.0, 0.0, 0.0)) -> float:
    """Added mass of an accelerated sphere over the mass of its volume of water; 0.5 in unbounded water.

    The basin's walls are nine radii away, which adds about 0.2 %.

    Parameters
    ----------
    cells : float
        Cells to the radius [-].
    place : sequence of 3 float
        Of the centre within a cell [cells].
    """
    radius, reach = 0.1, 0.9
    size = radius / cells
    grid = Grid.stretched((-0.2, -0.2, 0.0), (0.2, 0.2, 0.4), (-reach, -reach, 0.0), (reach, reach, 1.2), size, 1.08)
    z = grid.z_faces[-1] - grid.z_faces[::-1]  # fine cells at the top, mirrored below
    z = np.concatenate([z, z[-1] + grid.z_faces[1:]])
    grid = Grid(grid.x_faces, grid.y_faces, z)
    settings = FlowSettings(
        follow=None, far_x=False, far_y=False, closed_top=True, closure=None, viscosity=0.0, wall_shear=False
    )
    solver = FlowSolver(grid, (sphere(radius),), Water(float(z[-1])), settings)
    center = np.array([0.0, 0.0, 0.5 * z[-1]]) + size * np.asarray(place)
    ahead = np.array([1.0, 0.0, 0.0])
    loads = loads_over(solver, lambda t: one_pose(center + 0.5 * t * t * ahead, t * ahead), 1e-3, 3e-3)
    return float(-loads[-1, 0] / (1000.0 * 4.0 / 3.0 * math.pi * radius**3))


def check_sphere_added_mass() -> list[Check]:
    """Three grids a factor of sqrt(2) apart at four places within a cell each."""
    checks, means = [], []
    for cells, limit in ((4.0, math.inf), (4.0 * math.sqrt(2.0), math.inf), (5.0, 0.04), (8.0, 0.02)):
        values = [sphere_added_mass(cells, place) for place in PLACES]
        worst = max(values, key=lambda value: abs(value - 0.5))
        checks.append(relative(f"added mass, R/h = {cells:.3g}, worst of four places", worst, 0.5, limit))
        if limit < math.inf:
            spread = (max(values) - min(values)) / 0.5
            checks.append(absolute(f"spread over places, R/h = {cells:.3g}", spread, 0.0, 0.01))
        if cells != 5.0:
            means.append(float(np.mean(values)))
    order = observed_order(means, math.sqrt(2.0))
    checks.append(at_least("order of the mean over places, R/h = 4, 5.66, 8", order, 1.0))
    gain = math.sqrt(2.0) ** order - 1.0
    checks.append(reported("added mass extrapolated to h = 0", means[2] + (means[2] - means[1]) / gain, 0.5))
    return checks


def observed_order(values: Sequence[float], ratio: float) -> float:
    """Order of convergence from three grids, coarse to fine, each finer by `ratio`; nan if they do not converge."""
    first, second = values[1] - values[0], values[2] - values[1]
    return math.log(first / second) / math.log(ratio) if first * second > 0.0 else math.nan


def surface_added_mass(solid: Solid, half_width: float, draught: float, displaced: float, cell_size: float,
                       depth: float, shift: float = 0.0) -> float:  # fmt: skip
    """Added mass in heave at infinite frequency (p = 0 on the surface) over the mass of water displaced.

    The acceleration is 10 m/s^2, that a jump of the buoyancy by 0.2 %, when the level passes the middle of a cell, does
    not weigh in (measured by `lift_jump`).

    Parameters
    ----------
    solid : Solid
        Its origin lies in the water's surface.
    half_width : float
        Largest horizontal extent from the origin [m].
    draught : float
        [m]
    displaced : float
        Volume [m^3].
    cell_size : float
        [m]
    depth : float
        Of the basin [m]; its walls are six half widths away.
    shift : float
        Of the level and the solid within a cell [cells].
    """
    reach, near = 6.0 * half_width, 1.5 * half_width
    air = 0.8 * half_width
    fine = Grid.stretched(
        (-near, -near, 0.0), (near, near, draught + near), (-reach, -reach, 0.0), (reach, reach, depth), cell_size, 1.08
    )
    below = fine.z_faces[-1] - fine.z_faces[::-1]
    step = below[-1] - below[-2]
    z = np.concatenate([below, below[-1] + step * np.arange(1, math.ceil(air / step) + 1)])
    level = float(below[-1]) + shift * cell_size
    settings = FlowSettings(follow=None, far_x=False, far_y=False, closure=None, viscosity=0.0, wall_shear=False)
    solver = FlowSolver(Grid(fine.x_faces, fine.y_faces, z), (solid,), Water(level), settings)
    origin, down = np.array([0.0, 0.0, level]), np.array([0.0, 0.0, -1.0])
    still = one_pose(origin, 0.0 * down)
    buoyancy = loads_over(solver, lambda t: still, 1e-3, 1e-3)[-1, 2]
    loads = loads_over(solver, lambda t: one_pose(origin + 5.0 * t * t * down, 10.0 * t * down), 1e-3, 3e-3)
    return float((loads[-1, 2] - buoyancy) / (10.0 * 1000.0 * displaced))


def floating_sphere_added_mass(cells: float, shift: float = 0.0) -> float:
    """Heave of a half submerged sphere at infinite frequency: 0.5 (Hulme, J. Fluid Mech. 121 (1982) 443)."""
    radius = 0.1
    volume = 2.0 / 3.0 * math.pi * radius**3
    return surface_added_mass(sphere(radius), radius, radius, volume, radius / cells, 0.7, shift)


def check_floating_added_mass(cells: float = 6.0) -> list[Check]:
    """A half submerged sphere at four places of the level within a cell; limit as for the sphere in the depth."""
    values = [floating_sphere_added_mass(cells, shift) for shift in (0.0, 0.25, 0.5, 0.75)]
    worst = max(values, key=lambda value: abs(value - 0.5))
    return [
        relative(f"added mass in heave at the surface, R/h = {cells:g}, worst of four levels", worst, 0.5, 0.04),
        absolute("spread over levels", (max(values) - min(values)) / 0.5, 0.0, 0.01),
    ]


def lift_jump(cell_size: float = 0.02) -> float:
    """Change of a floating box's lift, over the lift, as the level rises from just below to just above mid cell."""
    lifts = []
    for level in (7.5 - 1e-4, 7.5 + 1e-4):
        grid = Grid.uniform((-0.5, -0.4, 0), (0.5, 0.4, 0.3), cell_size)
        solver = FlowSolver(
            grid, (box(0.5, 0.3, 0.2),), Water(level * cell_size), FlowSettings(follow=None, absorbing_width=0.1)
        )  # fmt: skip
        pose = one_pose((0.0, 0.003, 0.165), (0.0, 0.0, 0.0))
        lifts.append(loads_over(solver, lambda t, pose=pose: pose, 0.002, 0.004)[-1, 2])  # type: ignore[misc]
    return float(lifts[1] / lifts[0] - 1.0)


# -- plunging, momentum, noise, symmetry ----------------------------------------------------------------------------


def plunge(shift: float = 0.0, dt: float = 2e-3, cell_size: float = 0.02) -> tuple[Array, float, float]:
    """Box driven through the surface of a tank at 0.4 m/s for 0.3 s.

    Returns
    -------
    loads : array, shape (n, 6)
        [N, N m]
    error : float
        Largest volume error over the tank's volume.
    buoyancy : float
        At the end, on the mean level [N].
    """
    grid = Grid.uniform((-0.6, -0.5, 0), (0.6, 0.5, 0.4), cell_size)
    solver = FlowSolver(grid, (box(0.4, 0.3, 0.15),), Water(0.2), TANK)
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


def check_plunge(cell_size: float = 0.02) -> list[Check]:
    """Two places within a cell: volume within 0.2 %, lift near Archimedes (the box still accelerates water: 25 %)."""
    checks = []
    for shift in (0.0, 0.007):
        loads, error, buoyancy = plunge(shift, cell_size=cell_size)
        checks.append(absolute(f"volume error, shift {1e3 * shift:g} mm", error, 0.0, 2e-3))
        lift = loads[-25:, 2].mean()
        checks.append(relative(f"lift after the plunge, shift {1e3 * shift:g} mm", lift, buoyancy, 0.25, "N"))
    return checks


def momentum_gap(
    height: float, cell_size: float = 0.02, duration: float = 0.3, dt: float = 2e-3, sharp_edges: bool = False
) -> float:
    """Box accelerated along a tank: change of the water's momentum less impulses of box and walls, over the box's.

    Parameters
    ----------
    height : float
        Of the box's centre [m]; the water is 0.2 m deep, the box 0.12 m tall.
    sharp_edges : bool
        `FlowSettings.sharp_edges`.
    """
    grid = Grid.uniform((-0.6, -0.3, 0), (0.6, 0.3, 0.4), cell_size)
    solver = FlowSolver(
        grid, (box(0.2, 0.16, 0.12, friction=0.01),), Water(0.2), replace(TANK, sharp_edges=sharp_edges)
    )
    ahead = np.array([2.0, 0.0, 0.0])

    def pose(t: float) -> Poses:
        return one_pose(np.array([0.0, 0.001, height]) + 0.5 * t * t * ahead, t * ahead)

    solver.start(pose(0.0))
    first, of_box, of_walls = water_momentum(solver), 0.0, 0.0
    for n in range(round(duration / dt)):
        of_box -= dt * solver.advance(dt * (n + 1), pose(dt * (n + 1)))[0, 0]
        of_walls += dt * wall_force(solver)
    return float((water_momentum(solver) - first - of_box - of_walls) / of_box)


def water_momentum(solver: FlowSolver) -> float:
    """Of the water in a tank with cubic cells, along x [kg m/s]."""
    size = np.diff(solver.grid.x_faces)[0]
    fraction, area_fractions = solver.fraction, solver.area_fractions.bx[2:-2, 2:-2, 3:-2]
    mean = 0.5 * (fraction[:, :, 1:] + fraction[:, :, :-1])
    return 1000.0 * float(np.sum(mean * area_fractions * solver.velocity[0][:, :, 1:])) * float(size) ** 3


def wall_force(solver: FlowSolver) -> float:
    """Of the two end walls of a tank with cubic cells on the water, along x [N]."""
    size, z_faces = np.diff(solver.grid.x_faces)[0], solver.grid.z_faces
    z = 0.5 * (z_faces[1:] + z_faces[:-1])
    at_walls, level = solver.pressure[:, :, [0, -1]], solver.surface_height()[:, [0, -1]]
    top = np.floor(level / size)  # in the surface cell the pressure is hydrostatic below the level
    inside = z[None, :, None] < size * top[:, None, :]
    force = np.sum(np.where(inside, at_walls, 0.0), axis=1) * size
    force += 0.5 * 1000.0 * GRAVITY * (level - size * top) ** 2
    return float(size * np.sum(force[:, 0] - force[:, 1]))


def check_momentum() -> list[Check]:
    """A box under the surface: without sharpened edges to 1 %; what sharpening them costs is reported."""
    return [
        absolute("momentum gap, submerged box, h = 20 mm", momentum_gap(0.10), 0.0, 0.01),
        reported("momentum gap with sharp edges, h = 20 mm", momentum_gap(0.10, sharp_edges=True), 0.0),
    ]


def check_momentum_at_the_surface() -> list[Check]:
    """A box through the surface, on two grids."""
    sizes = (0.02, 0.0125)
    return [
        absolute(f"momentum gap, surface-piercing box, h = {1e3 * h:g} mm", momentum_gap(0.20, h), 0.0, 0.01)
        for h in sizes
    ]


def force_noise(follow: int | None, dt: float, cell_size: float = 0.02) -> float:
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


def mirror_loads(side: float, cell_size: float = 0.03) -> Array:
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
    Case("hydrostatics", "box and sunk wheel in still water: Archimedes", check_hydrostatics, 0.1),
    Case(
        "floating-added-mass", "heave of a half submerged sphere at infinite frequency: 1/2 (Hulme 1982)",
        check_floating_added_mass, 0.2,
    ),
    Case("momentum", "accelerated submerged box in a tank: momentum is conserved", check_momentum, 0.1),
    Case("mirror", "drifting, yawing box and its mirror image", check_symmetry, 0.1),
    Case("added-mass", "accelerated sphere in unbounded water: 1/2 (Lamb 1932, art. 92)", check_sphere_added_mass, 2.0,
         slow=True),
    Case("plunge", "box driven through the surface: volume and buoyancy", check_plunge, 0.5, slow=True),
    Case("momentum-surface", "accelerated surface-piercing box: momentum is conserved", check_momentum_at_the_surface,
         0.5, slow=True),
    Case("noise", "box passing through the grid or moving with it: noise of the lift", check_noise, 1.0, slow=True),
)  # fmt: skip
