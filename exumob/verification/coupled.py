"""Do free bodies coupled to the flow move as theory says, and stay stable?

They are coupled by the schemes of `exumob.coupling.scheme`.

Limits, written down first: fall through air exact to 1e-9; first acceleration of a sphere in water 5 % (its added mass
at five cells to the radius is met to 4 %); heave period of the floating box 2 % (as in `floating`); schemes that
converge agree within 2 % of the release height; momentum of water and body 1 %, as with prescribed motion. A box
lighter than its added mass: the explicit scheme must exceed ten times gravity within 40 steps, and grow by the factor
of theory to 10 %; the others must keep the box within its release height.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from exumob.coupling.explicit import Explicit
from exumob.coupling.scheme import Coupling
from exumob.coupling.semi_implicit import SemiImplicit
from exumob.coupling.strong import Strong
from exumob.flow import FlowSolver, Grid, Poses, box, sphere
from exumob.support.arrays import Array
from exumob.support.constants import GRAVITY
from exumob.support.declared import checked
from exumob.support.errors import SimulationError
from exumob.verification.check import Case, Check, absolute, at_least, relative, reported
from exumob.verification.floating import (
    DEPTH,
    DRAUGHT,
    HEIGHT,
    LENGTH,
    MASS,
    WIDTH,
    floating_box_solver,
    heave_period,
)
from exumob.verification.free_body import FreeBody, TankWater, uniform_box_inertia
from exumob.verification.initial import VISCOUS_TANK
from exumob.verification.measures import fitted_oscillation
from exumob.verification.momentum import wall_force, water_momentum
from exumob.verification.options import CellSize, Duration, Interval
from exumob.water.conditions import Water

SCHEMES: tuple[Coupling, ...] = (SemiImplicit(renewal=0.2), Strong(), Strong(method="aitken"))
"""The schemes that must be stable."""


def named(scheme: Coupling) -> str:
    """Name of a scheme in the table."""
    return {"aitken": "Aitken", "iqn-ils": "IQN-ILS"}.get(getattr(scheme, "method", ""), type(scheme).__name__)


@checked
def run(body: FreeBody, solver: FlowSolver, scheme: Coupling, duration: Duration, dt: Interval) -> tuple[Array, Array]:
    """Positions [m] and velocities [m/s] of a body after every macro step, shape (n + 1, 3) each."""
    water = TankWater(solver)
    scheme.start()
    solver.start(Poses.from_states(body.present()))
    places, speeds = [body.present().position[0, 0]], [body.present().velocity[0, 0]]
    for n in range(round(duration / dt)):
        scheme.step(body, water, dt * (n + 1))
        places.append(body.present().position[0, 0])
        speeds.append(body.present().velocity[0, 0])
    return np.array(places), np.array(speeds)


def iterations(scheme: Coupling) -> float:
    """Mean number of flow steps a macro step in the last run."""
    return float(scheme.record()["iterations"].mean())


# -- free fall --------------------------------------------------------------------------------------------------------


def sphere_in_tank(density_ratio: float, height: float, depth: float) -> tuple[FreeBody, FlowSolver, float]:
    """Sphere of 0.1 m radius in a tank 1 m wide, cells 20 mm; also its displaced mass [kg]."""
    radius = 0.1
    displaced = 1000.0 * 4.0 / 3.0 * np.pi * radius**3
    mass = density_ratio * displaced
    grid = Grid.uniform((-0.5, -0.5, 0.0), (0.5, 0.5, 0.9), 0.02)
    solver = FlowSolver(grid, (sphere(radius),), Water(depth), VISCOUS_TANK)
    return FreeBody(mass, np.full(3, 0.4 * mass * radius**2), (0.0, 0.0, height)), solver, displaced


@checked
def check_free_fall(dt: Interval = 2e-3) -> list[Check]:
    """A sphere in air, then two in water: one three times lighter, one twice as heavy as what it displaces."""
    checks = []
    body, solver, _ = sphere_in_tank(0.5, 0.6, 0.2)
    places, _ = run(body, solver, SemiImplicit(), 0.1, dt)
    checks.append(absolute("fall through air, place after 0.1 s", places[-1, 2], 0.6 - 0.5 * GRAVITY * 0.01, 1e-9, "m"))
    for ratio in (1.0 / 3.0, 2.0):
        expected = GRAVITY * (1.0 - ratio) / (ratio + 0.5)
        for scheme in SCHEMES:
            body, solver, _ = sphere_in_tank(ratio, 0.45, 0.9 - 0.04)
            _, speeds = run(body, solver, scheme, 0.03, dt)
            found = float(speeds[-1, 2] / (dt * (len(speeds) - 1)))
            name = f"density ratio {ratio:.2f}, {named(scheme)}"
            checks.append(relative(f"first acceleration of a sphere, {name}", found, expected, 0.05, "m/s2"))
            checks.append(reported(f"flow steps a macro step, {name}", iterations(scheme)))
    return checks


# -- a box lighter than its added mass --------------------------------------------------------------------------------

LIGHT_DRAUGHT, LIGHT_HEIGHT = 0.04, 0.10
"""Draught and height of a flat box, 0.4 m by 0.3 m [m]: its added mass is about twice its mass."""


@checked
def light_box(cell_size: CellSize) -> tuple[FreeBody, FlowSolver, float]:
    """The box 10 mm above its place of rest, and that place [m]."""
    solid = box(LENGTH, WIDTH, LIGHT_HEIGHT)
    mass = 1000.0 * LENGTH * WIDTH * LIGHT_DRAUGHT
    depth = 0.3
    solver = FlowSolver(
        Grid.uniform((-0.6, -0.6, 0.0), (0.6, 0.6, 0.5), cell_size), (solid,), Water(depth), VISCOUS_TANK
    )  # fmt: skip
    rest = depth - LIGHT_DRAUGHT + 0.5 * LIGHT_HEIGHT
    return FreeBody(mass, uniform_box_inertia(mass, solid), (0.0, 0.0, rest + 0.01)), solver, rest


@checked
def check_light_box(cell_size: CellSize = 0.03, dt: Interval = 2e-3) -> list[Check]:
    """Explicit grows, the others do not, and agree."""
    body, solver, rest = light_box(cell_size)
    speeds = [0.0]
    scheme = Explicit(within_step="held")
    water = TankWater(solver)
    solver.start(Poses.from_states(body.present()))
    try:
        for n in range(40):
            scheme.step(body, water, dt * (n + 1))
            speeds.append(float(body.present().velocity[0, 0, 2]))
    except (SimulationError, ValueError):  # the solver refuses the motion, or the box has left the window
        pass
    changes = np.diff(speeds)
    largest = float(np.abs(changes).max() / dt)
    early = np.flatnonzero(np.abs(changes) > 2.0 * GRAVITY * dt)
    growth = float(changes[early[1]] / changes[early[0]]) if len(early) > 1 else float("nan")
    body, solver, rest = light_box(cell_size)
    measuring = SemiImplicit()
    run(body, solver, measuring, dt, dt)
    assert measuring.response.damping is not None
    r = float(measuring.response.damping[2, 2]) * dt / body.mass  # added mass over mass
    checks = [
        at_least("explicit, largest acceleration within 40 steps", largest, 10.0 * GRAVITY, "m/s2"),
        reported("added mass over mass", r),
        relative("explicit, factor from step to step (z^2 + 2 r z - r = 0)", growth, -r - np.sqrt(r * r + r), 0.1),
    ]
    ends = []
    for scheme_ in SCHEMES:
        body, solver, rest = light_box(cell_size)
        places, _ = run(body, solver, scheme_, 0.4, dt)
        away = np.abs(places[:, 2] - rest)
        name = named(scheme_)
        checks.append(absolute(f"{name}, largest distance from rest less 10 mm, if above 0",
                               max(float(away.max()) - 0.01, 0.0), 0.0, 1e-9, "m"))  # fmt: skip
        checks.append(reported(f"{name}, flow steps a macro step", iterations(scheme_)))
        ends.append(places[:, 2])
    for other, name in ((0, "SemiImplicit"), (2, "Aitken")):
        apart = float(np.abs(ends[other] - ends[1]).max())
        checks.append(absolute(f"{name} against IQN-ILS, largest difference over 10 mm", apart / 0.01, 0.0, 0.02))
    return checks


# -- heave of the floating box ----------------------------------------------------------------------------------------


@checked
def check_heave(cell_size: CellSize = 0.025, dt: Interval = 5e-3) -> list[Check]:
    """The box of `floating`, free in all six directions: period of linear theory."""
    checks = []
    for scheme in (SemiImplicit(), Strong()):
        solver = floating_box_solver(cell_size)
        rest = DEPTH - DRAUGHT + 0.5 * HEIGHT
        body = FreeBody(MASS, uniform_box_inertia(MASS, box(LENGTH, WIDTH, HEIGHT)), (0.0, 0.0, rest + 0.01))
        places, _ = run(body, solver, scheme, 2.4, dt)
        times = np.array(dt * np.arange(len(places)), dtype=float)
        later = times >= 0.25 * heave_period()
        period, damping = fitted_oscillation(times[later], places[later, 2] - rest, heave_period())
        checks.append(relative(f"heave period, {named(scheme)}", period, heave_period(), 0.02, "s"))
        checks.append(reported(f"damping ratio, {named(scheme)}", damping))
        checks.append(reported(f"flow steps a macro step, {named(scheme)}", iterations(scheme)))
    return checks


# -- momentum ---------------------------------------------------------------------------------------------------------


@checked
def coupled_momentum_gap(scheme: Coupling, duration: Duration = 0.3, dt: Interval = 2e-3) -> float:
    """Box pulled along a closed tank by a constant force: momentum of water and box less all impulses, over the pull's.

    The box, neutrally buoyant, is free in all six directions; the tank is that of `momentum.momentum_gap`.
    """
    grid = Grid.uniform((-0.6, -0.3, 0), (0.6, 0.3, 0.4), 0.02)
    solid, pull = box(0.2, 0.16, 0.12), 3.0
    mass = 1000.0 * 0.2 * 0.16 * 0.12
    solver = FlowSolver(grid, (solid,), Water(0.3), replace(VISCOUS_TANK, sharp_edges=False))
    body, water = (
        FreeBody(mass, uniform_box_inertia(mass, solid), (0.0, 0.001, 0.15), (pull, 0.0, 0.0)),
        TankWater(solver),
    )
    scheme.start()
    solver.start(Poses.from_states(body.present()))
    first, of_walls = water_momentum(solver), 0.0
    for n in range(round(duration / dt)):
        scheme.step(body, water, dt * (n + 1))
        of_walls += dt * wall_force(solver)
    gained = water_momentum(solver) - first + mass * float(body.present().velocity[0, 0, 0])
    of_pull = mass * pull * duration
    return (gained - of_walls - of_pull) / of_pull


def check_coupled_momentum() -> list[Check]:
    """Momentum of water and free body."""
    return [absolute(f"momentum gap, {named(s)}", coupled_momentum_gap(s), 0.0, 0.01) for s in SCHEMES[:2]]


CASES: tuple[Case, ...] = (
    Case(
        "coupled-fall",
        "A sphere released in air and in water: first acceleration with Lamb's added mass",
        check_free_fall,
        0.5,
    ),
    Case(
        "coupled-light-box",
        "A box lighter than its added mass: explicit coupling fails, the other schemes agree",
        check_light_box,
        0.5,
    ),
    Case(
        "coupled-momentum",
        "A box pulled along a closed tank: momentum of water and box is conserved",
        check_coupled_momentum,
        0.3,
    ),
    Case(
        "coupled-heave",
        "A floating box free in six directions: heave period of linear theory",
        check_heave,
        3.0,
        slow=True,
    ),
)
