"""Do water, waves and bodies behave over a given bed as theory says?

Limits: speed in still water 1e-4 m/s, 1e-3 m/s where the bed emerges, volume 1e-5; a current along the contours 1e-5;
periods 0.5 % over a level bed within a cell and 1 % over a slope; reflection from a step 3 % of the incident wave; dip
of a current over a hump 5 %; Archimedes 1 % near a slope, 2 % sunk into it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.linalg import eigh
from scipy.optimize import brentq

from exumob.flow import FlowSettings, FlowSolver, Grid, Poses, box, cylinder, sphere
from exumob.flow.grid import HALO
from exumob.ground.terrain import Terrain
from exumob.support.arrays import Array
from exumob.support.constants import GRAVITY
from exumob.support.rotations import about_z
from exumob.verification.check import Case, Check, absolute, relative, reported
from exumob.verification.frames import SETTINGS, steady_motion
from exumob.verification.hydrostatics import wheel_buoyancy
from exumob.verification.initial import TANK, centers, filled_to
from exumob.verification.measures import crossing_period
from exumob.verification.single_body import one_pose
from exumob.water.conditions import Water
from exumob.water.cross_section import CrossSection

LEVEL = 0.107
"""Height of the still water [m]."""


def bumps() -> Terrain:
    """Two crossing trains of bumps, up to 5 cm high, on a field of 6 by 6 m."""
    x = np.linspace(-3.0, 3.0, 121)
    xx, yy = np.meshgrid(x, x)
    heights = 0.03 * np.sin(4.0 * xx) * np.cos(5.0 * yy + 1.0) + 0.02 * np.sin(11.0 * xx - 3.0 * yy)
    return Terrain(heights=heights, origin=(-3.0, -3.0), spacing=0.05)


def across(height: Callable[[Array], Array], low: float, high: float, spacing: float) -> Terrain:
    """Bed that varies along x alone: `height` [m] between `low` and `high` [m]."""
    x = np.arange(low, high + 0.5 * spacing, spacing)
    return Terrain(heights=np.tile(height(x), (2, 1)), origin=(low, -50.0), spacing=(spacing, 100.0))


def fastest(solver: FlowSolver) -> float:
    """Largest speed on open faces of wet cells [m/s]."""
    h, o, found = HALO, solver.area_fractions, []
    wet = np.pad(solver.fraction >= 0.5, h)
    for q, b, axis in zip(solver.velocity, (o.bx, o.by, o.bz), (2, 0, 1), strict=True):
        counts = (b > 0.0) & (wet | np.roll(wet, 1, axis))
        found.append(np.abs(q)[counts[h:-h, h:-h, h:-h]].max(initial=0.0))
    return float(max(found))


# -- still water and a current ---------------------------------------------------------------------------------------


def still_over(terrain: Terrain, lowest: float, moving: bool) -> tuple[float, float, float]:
    """Still water over a bed for 1 s, in a tank or seen from a grid that moves and yaws over it.

    Returns
    -------
    float, float, float
        Largest speed [m/s]; largest change of the level where there is water [m]; volume of water in the window at the
        end over that between bed and level, less 1 [-].
    """
    grid = Grid.uniform((-0.6, -0.5, lowest), (0.6, 0.5, 0.3), 0.04)
    pose = steady_motion((0.4, 0.2), 0.5, 0.27)
    if moving:
        solver = FlowSolver(grid, (sphere(0.01),), Water(LEVEL), SETTINGS, terrain)
        solver.start(pose(0.0))
    else:
        solver = FlowSolver(grid, (), Water(LEVEL), TANK, terrain)
        solver.start()
    speed = 0.0
    for n in range(100):
        t = 0.01 * (n + 1)
        solver.advance(t, pose(t) if moving else None)
        speed = max(speed, fastest(solver))
    depth = LEVEL - solver.bed_height()
    change = float(np.abs(solver.surface_height() - LEVEL)[depth > 0.0].max())
    area = np.diff(grid.y_faces)[:, None] * np.diff(grid.x_faces)
    return speed, change, float(solver.water_volume() / np.sum(np.maximum(depth, 0.0) * area)) - 1.0


def still_water() -> list[Check]:
    """A slope and bumps under water, and a shore of 1 in 5."""
    checks = []
    for name, terrain, lowest, limit in (
        ("slope", Terrain(slope_x=0.06, slope_y=-0.03), -0.12, 1e-4),
        ("bumps", bumps(), -0.12, 1e-4),
        ("shore", Terrain(slope_x=0.2, slope_y=0.05), -0.4, 1e-3),
    ):
        for moving in (False, True):
            speed, change, volume = still_over(terrain, lowest, moving)
            where = f"{name}, {'moving, yawing grid' if moving else 'tank'}"
            checks.append(absolute(f"still water over {where}, largest speed", speed, 0.0, limit, "m/s"))
            checks.append(absolute(f"still water over {where}, change of level", change, 0.0, 1e-5, "m"))
            if name == "shore":  # cells at the shoreline hold water up to half a cell deep or none
                checks.append(reported(f"still water over {where}, volume", volume, 0.0))
            else:
                checks.append(absolute(f"still water over {where}, volume", volume, 0.0, 1e-5))
    return checks


def current_along() -> list[Check]:
    """A uniform current along the contours of a slope, on a grid that moves at another speed and yaws."""
    water = Water(0.113, current_speed=0.6, current_direction=0.7)
    s, c = math.sin(0.7), math.cos(0.7)
    terrain = Terrain(slope_x=-0.05 * s, slope_y=0.05 * c)
    grid = Grid.stretched((-0.3, -0.3, -0.1), (0.3, 0.3, 0.2), (-0.8, -0.8, -0.1), (0.8, 0.8, 0.3), 0.04)
    solver = FlowSolver(grid, (sphere(0.02),), water, FlowSettings(follow=0, absorbing_width=0.2), terrain)
    pose = steady_motion((0.8, 0.3), 0.8, 0.27)
    solver.start(pose(0.0))
    for n in range(60):
        solver.advance(0.005 * (n + 1), pose(0.005 * (n + 1)))
    far, h, o = about_z(solver.frame[2]).T @ water.velocity, HALO, solver.area_fractions
    apart = 0.0
    for q, f, b in zip(solver.velocity, far, (o.bx, o.by, o.bz), strict=True):
        counts = (b[h:-h, h:-h, h:-h] > 0.0) & (centers(grid.z_faces) < water.uniform_depth)[:, None]
        apart = max(apart, float(np.abs(q - f)[counts].max()))
    rise = float(np.abs(solver.surface_height() - water.uniform_depth).max())
    return [
        absolute("current along the contours, change of velocity", apart, 0.0, 1e-5, "m/s"),
        absolute("current along the contours, change of level", rise, 0.0, 1e-5, "m"),
    ]


def river_current() -> list[Check]:
    """A current that varies across a river between its shores, seen from a grid that moves over it and yaws.

    A parallel flow along the contours is an exact flow over this bed. Cells of 4 cm see it and the turning of their own
    axes to second order, and the shore within a cell.
    """
    section = CrossSection(
        station=(-3.0, -0.9, -0.3, 0.4, 1.0, 3.0), bed=(0.05, 0.05, -0.12, -0.12, 0.05, 0.05),
        current=(0.0, 0.0, 0.4, 0.6, 0.0, 0.0),
    )  # fmt: skip
    grid = Grid.uniform((-0.8, -0.8, -0.14), (0.8, 0.8, 0.2), 0.04)
    water, settings = section.water(0.0), FlowSettings(follow=0, absorbing_width=0.2)
    solver = FlowSolver(grid, (sphere(0.02),), water, settings, section.terrain())
    pose = steady_motion((0.3, 0.2), 0.6, 0.1)
    solver.start(pose(0.0))
    for n in range(200):
        solver.advance(0.005 * (n + 1), pose(0.005 * (n + 1)))
    frame = solver.frame
    turn = about_z(frame[2])[:2, :2]
    x, y = np.meshgrid(centers(grid.x_faces), centers(grid.y_faces))
    places = np.stack([x, y], axis=-1) @ turn.T + frame[:2]
    _, current = water.at(places, section.terrain())
    far = current @ turn
    k = int(np.searchsorted(grid.z_faces, -0.001)) - 1  # the highest full layer
    u, v, _ = (q[:, k] for q in solver.velocity)
    found = np.stack([0.5 * (u[:-1, :-1] + u[:-1, 1:]), 0.5 * (v[:-1, :-1] + v[1:, :-1])], axis=-1)
    deep = (-solver.bed_height() > 0.08)[:-1, :-1]
    apart = float(np.abs(found - far[:-1, :-1])[deep].max()) / 0.6
    rise = float(np.abs(solver.surface_height())[solver.bed_height() < -0.08].max()) / 0.12
    return [
        absolute("current of a river after 1 s, change of velocity over the fastest", apart, 0.0, 0.03),
        absolute("current of a river after 1 s, change of level over the depth", rise, 0.0, 0.01),
    ]


def swinging_canal() -> list[Check]:
    """Water that swings in a parabolic canal and wets and dries its shores: an exact plane surface (Thacker 1981).

    Shallow-water theory: the surface stays plane, the velocity is the same everywhere, the shores run `swing` to and
    fro; omega = sqrt(2 g depth) / length. Vertical acceleration takes some 2 % off omega (k depth = 0.2).
    """
    depth, length, swing = 0.1, 1.0, 0.2
    omega = math.sqrt(2.0 * GRAVITY * depth) / length
    terrain = across(lambda x: depth * (np.square(x / length) - 1.0), -1.6, 1.6, 0.02)
    grid = Grid.uniform((-1.5, 0.0, -0.11), (1.5, 0.12, 0.13), (0.02, 0.03, 0.01))
    solver = FlowSolver(grid, (), Water(level=0.0), TANK, terrain)
    solver.start()

    def plane(phase: float, x: Array) -> Array:
        s = swing * math.cos(phase)
        return np.asarray(depth / length**2 * s * (2.0 * x - s))

    x = centers(grid.x_faces)
    shares = (plane(0.0, x)[:, None] - grid.z_faces[None, :-1]) / np.diff(grid.z_faces)
    solver.set_flow(fraction=np.tile(np.clip(shares, 0.0, 1.0).T[None], (grid.shape[0], 1, 1)))
    volume, times, means, shores = solver.water_volume(), [], [], []
    while solver.time < 1.3 * 2.0 * math.pi / omega:
        solver.advance(solver.time + 0.01)
        height, bed = solver.surface_height()[1], solver.bed_height()[1]
        wet = np.flatnonzero(height - bed > 0.005)
        times.append(solver.time)
        means.append(float(np.sum(x * np.maximum(height - bed, 0.0)) / np.sum(np.maximum(height - bed, 0.0))))
        shores.append(0.5 * float(x[wet[0]] + x[wet[-1]]))  # the canal's water moves to and fro as one
    centre, time = np.array(means), np.array(times)
    period = crossing_period(time, centre, 0.01)
    late = time > 0.75 * period
    return [
        relative("canal, period of the swing", period, 2.0 * math.pi / omega, 0.03),
        relative("canal, water's middle when it is back, from its first place", centre[late].max(), swing, 0.10),
        relative("canal, middle between the shores then", np.array(shores)[late].max(), swing, 0.15),
        absolute("canal, volume", solver.water_volume() / volume - 1.0, 0.0, 1e-3),
    ]


def hump_dip() -> list[Check]:
    """Steady subcritical current over a long hump: dip of the surface from Bernoulli and continuity (shallow water).

    u^2 / 2 + g (bed + depth) and u depth are the same everywhere; at k depth = 0.3 the vertical acceleration takes
    about 2 % off the dip (Lamb, art. 246).
    """
    speed, depth, height, length = 0.42, 0.2, 0.02, 4.0
    terrain = across(lambda x: height * np.cos(math.pi * np.clip(x / length, -0.5, 0.5)) ** 2, -5.0, 5.0, 0.1)
    grid = Grid.uniform((-5.0, 0.0, -0.02), (5.0, 0.32, 0.32), (0.08, 0.08, 0.02))
    settings = replace(TANK, far_x=True, absorbing_width=2.0)
    solver = FlowSolver(grid, (), Water(depth, speed, 0.0), settings, terrain)
    solver.start()
    dips = []
    for n in range(1000):
        solver.advance(0.02 * (n + 1))
        if n >= 800:
            middle = solver.surface_height()[1]
            dips.append(depth - float(middle[np.abs(centers(grid.x_faces)) < 0.1].mean()))
    head = 0.5 * speed**2 / GRAVITY + depth
    above = brentq(lambda d: 0.5 * (speed * depth / d) ** 2 / GRAVITY + height + d - head, 0.5 * depth, depth)
    return [
        relative("dip of a current over a hump, Froude 0.3", float(np.mean(dips)), depth - height - above, 0.05, "m"),
        reported("its unsteadiness (standard deviation over the dip)", float(np.std(dips) / np.mean(dips)), 0.0),
    ]


# -- waves -----------------------------------------------------------------------------------------------------------


def wave_number(omega: float, depth: Array) -> Array:
    """Wave number of linear waves [1/m]: omega^2 = g k tanh(k depth)."""
    k = omega / np.sqrt(GRAVITY * depth)
    for _ in range(50):
        t = np.tanh(k * depth)
        k = k - (GRAVITY * k * t - omega**2) / (GRAVITY * (t + k * depth * (1.0 - t * t)))
    return k


def seiche_period(depth: Array, length: float) -> tuple[float, Array]:
    """Period [s] and shape of the first mode of a basin by the mild-slope equation (Berkhoff 1972).

    (c c_g eta')' + k^2 c c_g eta = 0 with eta' = 0 at the walls, by finite volumes; `depth` [m] at the cells' centres.
    """
    n = len(depth)
    size, omega = length / n, math.pi / length * math.sqrt(GRAVITY * float(depth.mean()))
    shape = np.zeros(n)
    for _ in range(8):
        k = wave_number(omega, depth)
        group = 0.5 * (1.0 + 2.0 * k * depth / np.sinh(2.0 * k * depth))
        flux = (omega / k) ** 2 * group
        between = 0.5 * (flux[1:] + flux[:-1]) / size**2
        matrix = np.diag(np.append(between, 0.0) + np.append(0.0, between)) - np.diag(between, 1) - np.diag(between, -1)
        values, vectors = eigh(matrix, np.diag(omega**2 * group), subset_by_index=[1, 1])  # of (omega' / omega)^2
        omega, shape = omega * float(values[0]) ** 0.25, vectors[:, 0]
    return 2.0 * math.pi / omega, shape / np.abs(shape).max()


def seiche(bed: Callable[[Array], Array], level: float, length: float = 2.0) -> tuple[float, float, float]:
    """First mode of a basin over a bed: period measured and of linear theory [s], and change of volume [-]."""
    grid = Grid.uniform((0.0, 0.0, -0.02), (length, 0.16, 0.3), (0.04, 0.04, 0.02))
    solver = FlowSolver(grid, (), Water(level), TANK, across(bed, 0.0, length, 0.02))
    x = centers(np.linspace(0.0, length, 101))
    period, shape = seiche_period(level - bed(x), length)
    mode = np.interp(centers(grid.x_faces), x, shape)
    solver.start()
    solver.set_flow(fraction=filled_to(grid, level + 0.004 * mode))
    volume, step, modal, times = solver.water_volume(), period / 200.0, [], []
    for n in range(420):
        solver.advance(step * (n + 1))
        modal.append(float(np.mean((solver.surface_height()[1] - level) * mode)))
        times.append(solver.time)
    a, t = np.array(modal), np.array(times)
    return crossing_period(t, a, step), period, solver.water_volume() / volume - 1.0


def seiches() -> list[Check]:
    """First modes of basins over level beds, at several places in a cell, and over a slope (0.17 to 0.05 m deep)."""
    checks, level = [], 0.187
    for cells in (0.3, 0.5, 0.8):
        height = 0.02 * (1.0 + cells)
        found, theory, _ = seiche(lambda x, z=height: np.full(len(x), z), level)  # type: ignore[misc]
        checks.append(relative(f"seiche, level bed {cells:g} cells into a cell", found, theory, 0.005, "s"))
    found, theory, volume = seiche(lambda x: 0.017 + 0.06 * x, level)
    checks.append(relative("seiche over a slope, period", found, theory, 0.01, "s"))
    checks.append(absolute("seiche over a slope, change of volume", volume, 0.0, 1e-5))
    return checks


def step_reflection() -> list[Check]:
    """A long wave comes upon a step from 0.16 to 0.04 m of water (Lamb, art. 176).

    The reflected wave is (c1 - c2) / (c1 + c2) of the incident one: its volume in the limit of long waves, whatever
    dispersion does to its shape.
    """
    deep, shallow, size = 0.16, 0.04, 0.5
    rise = deep - shallow

    def bed(x: Array) -> Array:
        return rise * (0.5 + 0.5 * np.sin(math.pi * np.clip(x / 0.2, -0.5, 0.5)))

    grid = Grid.uniform((-4.4, 0.0, -0.02), (2.4, 0.16, 0.24), (0.04, 0.04, 0.02))
    solver = FlowSolver(grid, (), Water(deep), TANK, across(bed, -4.4, 2.4, 0.02))
    solver.start()
    c1, c2 = math.sqrt(GRAVITY * deep), math.sqrt(GRAVITY * shallow)
    x, xf = centers(grid.x_faces), grid.x_faces
    wave = 0.002 * np.exp(-(((x + 1.7) / size) ** 2))
    u = np.tile(0.002 * np.exp(-(((xf + 1.7) / size) ** 2)) * c1 / deep, (*grid.shape[:2], 1))
    ny, nz, nx = grid.shape
    solver.set_flow(filled_to(grid, deep + wave), (u, np.zeros((ny + 1, nz, nx)), np.zeros((ny, nz + 1, nx))))
    steps = 280
    for n in range(steps):
        solver.advance(2.8 * (n + 1) / steps)
    left = solver.surface_height()[1] - deep
    reflected = float(left[x < 0.0].sum() / wave.sum())
    crest = float(left[x > 0.0].max() / wave.max())
    return [
        absolute("wave sent back by a step, over the incident one", reflected, (c1 - c2) / (c1 + c2), 0.03),
        reported("crest passed by the step, over the incident one", crest, 2.0 * c1 / (c1 + c2)),
    ]


# -- bodies ----------------------------------------------------------------------------------------------------------


def lift_over(terrain: Terrain, lowest: float, height: float, yaw: float) -> tuple[float, float]:
    """Lift of a box at rest over a bed, and that of the water it displaces [N]; `height` of its centre [m]."""
    length, width, tall, level = 0.5, 0.3, 0.1, 0.15
    grid = Grid.uniform((-0.5, -0.4, lowest), (0.5, 0.4, 0.3), 0.02)
    solver = FlowSolver(grid, (box(length, width, tall),), Water(level), TANK, terrain)
    pose = one_pose((0.003, 0.002, height), (0.0, 0.0, 0.0), yaw)
    solver.start(pose)
    for n in range(5):
        loads = solver.advance(0.004 * (n + 1), pose)[0]
    return float(loads[2]), 1000.0 * GRAVITY * length * width * min(level - height + 0.5 * tall, tall)


def sunk_lift(terrain: Terrain, lowest: float, sunk: float, x: float = 0.004) -> tuple[Array, float]:
    """Force on a wheel sunk by `sunk` [m] below the bed at its place, and lift of the water it displaces [N]."""
    radius, width, level = 0.1, 0.08, 0.15
    grid = Grid.uniform((-0.3, -0.24, lowest), (0.3, 0.24, 0.3), 0.015)
    solver = FlowSolver(grid, (cylinder(radius, width),), Water(level), TANK, terrain)
    z = terrain.height_and_normal(x, 0.002)[0] + radius - sunk
    pose: Poses = one_pose((x, 0.002, z), (0.0, 0.0, 0.0))
    solver.start(pose)
    force = solver.advance(0.002, pose)[0, :3]
    return force, wheel_buoyancy(radius, width, level - z)


def bodies_near() -> list[Check]:
    """A box over a slope, clear of it and close above it, and wheels sunk into level and sloping beds.

    The box's draught is two cells or more: a cell and a half costs 1.1 % over a flat bed too.
    """
    checks = []
    slope = Terrain(height=0.01, slope_x=0.1, slope_y=0.05)
    for height, yaw in ((0.16, 0.0), (0.15, 0.5), (0.125, 0.3)):
        lift, expected = lift_over(slope, -0.08, height, yaw)
        place = f"box at z {1e3 * height:g} mm over a slope"
        checks.append(relative(f"lift, {place}", lift, expected, 0.01, "N"))
    for name, terrain, sunk in (
        ("level bed at 0.4 cells", Terrain(height=0.006), 0.012),
        ("level bed at 0.7 cells", Terrain(height=0.0105), 0.03),
        ("slope of 1 in 10", Terrain(height=0.006, slope_x=0.1), 0.012),
        ("slope of 1 in 4", Terrain(height=0.006, slope_x=0.25), 0.02),
    ):
        force, expected = sunk_lift(terrain, -0.105, sunk)
        checks.append(relative(f"lift, wheel {1e3 * sunk:g} mm in a {name}", force[2], expected, 0.02, "N"))
        aside = float(np.abs(force[:2]).max() / expected)
        checks.append(absolute(f"other forces over lift, wheel in a {name}", aside, 0.0, 5e-3))
    return checks


CASES: tuple[Case, ...] = (
    Case(
        "bed-still",
        "Still water over slope, bumps and shore stays still, also seen from a moving grid",
        still_water,
        0.4,
    ),
    Case("bed-current", "A uniform current along the contours of a slope stays uniform", current_along, 0.05),
    Case("bed-river", "A current that varies across a river stays as it is, shores and all", river_current, 0.2),
    Case("bed-canal", "Water swings in a parabolic canal, wetting and drying (Thacker 1981)", swinging_canal, 0.5),
    Case("bed-hump", "Dip of a subcritical current over a hump (Bernoulli, shallow water)", hump_dip, 0.3),
    Case("bed-seiche", "First mode of a basin over level beds and a slope (mild-slope equation)", seiches, 0.3),
    Case("bed-step", "A long wave reflected by a step (Lamb 1932, art. 176)", step_reflection, 0.1),
    Case("bed-bodies", "A box over a slope and wheels sunk into a given bed: Archimedes", bodies_near, 0.2),
)
