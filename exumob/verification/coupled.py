"""Free bodies coupled to the flow by the schemes of `exumob.coupling`: theory, stability, momentum.

Limits, written down first: fall through air exact to 1e-9; first acceleration of a sphere in water 5 % (its added mass
at five cells to the radius is met to 4 %); heave period of the floating box 2 % (as in `floating`); schemes that
converge agree within 2 % of the release height; momentum of water and body 1 %, as with prescribed motion; order
in the macro step 1.8 with held loads and 2.6 with linear ones, whatever the added mass. A box
lighter than its added mass: the explicit scheme must exceed ten times gravity within 40 steps, and grow by the factor
of theory to 10 %; the others must keep the box within its release height. The vehicle's place, over its way: schemes
1 % apart, macro steps of 0.5 and 1 ms 3 % (set after a first look at a finer run: 0.1 and 0.9 %).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import xarray as xr

from exumob.coupling.explicit import Explicit
from exumob.coupling.flow_in_loop import CfdHydrodynamics
from exumob.coupling.scheme import Coupling
from exumob.coupling.semi_implicit import SemiImplicit
from exumob.coupling.strong import Strong
from exumob.driving.maneuver import LaneChange
from exumob.flow import FlowSettings, FlowSolver, Grid, Poses, Solid, box, sphere
from exumob.ground.soil import Soil
from exumob.support.arrays import Array
from exumob.support.constants import GRAVITY
from exumob.support.errors import SimulationError
from exumob.vehicle.motion import BodyStates
from exumob.verification import Case, Check, absolute, at_least, relative, reported
from exumob.verification.bodies import TANK, wall_force, water_momentum
from exumob.verification.floating import (
    DEPTH,
    DRAUGHT,
    HEIGHT,
    LENGTH,
    MASS,
    WIDTH,
    fitted_oscillation,
    floating_box_solver,
    heave_period,
)
from exumob.verification.free_body import FreeBody, TankWater
from exumob.water.conditions import Water

SCHEMES: tuple[Coupling, ...] = (SemiImplicit(renewal=0.2), Strong(), Strong(method="aitken"))
"""Those that must be stable."""


def named(scheme: Coupling) -> str:
    """For the table."""
    return {"aitken": "Aitken", "iqn-ils": "IQN-ILS"}.get(getattr(scheme, "method", ""), type(scheme).__name__)


def run(body: FreeBody, solver: FlowSolver, scheme: Coupling, duration: float, dt: float) -> tuple[Array, Array]:
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


def box_inertia(mass: float, solid: Solid) -> Array:
    """Of a uniform box [kg m^2], shape (3,)."""
    a, b, c = (solid.high - solid.low) ** 2
    return mass / 12.0 * np.array([b + c, a + c, a + b])


# -- free fall --------------------------------------------------------------------------------------------------------


def sphere_in_tank(density_ratio: float, height: float, depth: float) -> tuple[FreeBody, FlowSolver, float]:
    """Sphere of 0.1 m radius in a tank 1 m wide, cells 20 mm; also its displaced mass [kg]."""
    radius = 0.1
    displaced = 1000.0 * 4.0 / 3.0 * np.pi * radius**3
    mass = density_ratio * displaced
    grid = Grid.uniform((-0.5, -0.5, 0.0), (0.5, 0.5, 0.9), 0.02)
    solver = FlowSolver(grid, (sphere(radius),), Water(depth), TANK)
    return FreeBody(mass, np.full(3, 0.4 * mass * radius**2), (0.0, 0.0, height)), solver, displaced


def check_free_fall(dt: float = 2e-3) -> list[Check]:
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


# -- heave of a mass on a spring --------------------------------------------------------------------------------------


class SpringWater:
    """Water of a single number: mean of -k z - A z'' + weight over the step, the exact mean for cubic motion."""

    def __init__(self, mass: float, stiffness: float, added_mass: float, offset: float) -> None:
        self.mass, self.stiffness, self.added_mass = mass, stiffness, added_mass
        self.state = 0.0, offset, 0.0

    def start(self, vehicle: object, water: object, macro_step: float) -> None:
        """Nothing to prepare."""

    def wrenches(self, history: BodyStates, predict: Callable[[], BodyStates]) -> Array:
        """Mean wrench up to the predicted state, shape (1, 6)."""
        ahead = predict()
        time, z, speed = float(ahead.time[-1]), float(ahead.position[-1, 0, 2]), float(ahead.velocity[-1, 0, 2])
        before, z0, speed0 = self.state
        step = time - before
        mean = 0.5 * (z0 + z) + step / 12.0 * (speed0 - speed)
        force = self.mass * GRAVITY - self.stiffness * mean - self.added_mass * (speed - speed0) / step
        self.state = time, z, speed
        return np.array([[0.0, 0.0, force, 0.0, 0.0, 0.0]])

    def save(self, histories: bool = True) -> tuple[float, float, float]:
        """Time, place and speed."""
        return self.state

    def restore(self, saved: tuple[float, float, float]) -> None:
        """Return to a saved state."""
        self.state = saved

    def record(self) -> dict[str, xr.DataArray]:
        """Nothing."""
        return {}


def spring_error(scheme: Coupling, step: float, ratio: float) -> float:
    """Largest error of the place over the amplitude in 0.5 s of heave at 3 Hz, added mass over mass `ratio`."""
    mass, omega, offset = 10.0, 6.0 * np.pi, 0.01
    water = SpringWater(mass, mass * (1.0 + ratio) * omega**2, ratio * mass, offset)
    body = FreeBody(mass, np.ones(3), (0.0, 0.0, offset))
    scheme.start()
    worst = 0.0
    for n in range(round(0.5 / step)):
        scheme.step(body, water, step * (n + 1))
        exact = offset * np.cos(omega * body.time)
        worst = max(worst, abs(float(body.present().position[0, 0, 2]) - exact) / offset)
    return worst


def check_spring() -> list[Check]:
    """Order in the macro step, with an added mass of twice the mass: 2 with held, 3 with linear loads."""
    checks = []
    schemes: tuple[Coupling, ...] = (
        SemiImplicit(within_step="held"), SemiImplicit(), Strong(within_step="held", tolerance=1e-8),
        Strong(tolerance=1e-8),
    )  # fmt: skip
    for scheme in schemes:
        coarse, fine = spring_error(scheme, 4e-3, 2.0), spring_error(scheme, 1e-3, 2.0)
        within = str(scheme.within_step)  # type: ignore[attr-defined]
        name = f"{named(scheme)}, {within}"
        least = 1.8 if within == "held" else 2.6
        checks.append(at_least(f"order in the macro step, {name}", float(np.log(coarse / fine) / np.log(4.0)), least))
        checks.append(reported(f"error over amplitude, 1 ms, {name}", fine))
    return checks


# -- a box lighter than its added mass --------------------------------------------------------------------------------

LIGHT_DRAUGHT, LIGHT_HEIGHT = 0.04, 0.10
"""Of a flat box, 0.4 m by 0.3 m [m]: its added mass is about twice its mass."""


def light_box(cell_size: float) -> tuple[FreeBody, FlowSolver, float]:
    """The box 10 mm above its place of rest, and that place [m]."""
    solid = box(LENGTH, WIDTH, LIGHT_HEIGHT)
    mass = 1000.0 * LENGTH * WIDTH * LIGHT_DRAUGHT
    depth = 0.3
    solver = FlowSolver(
        Grid.uniform((-0.6, -0.6, 0.0), (0.6, 0.6, 0.5), cell_size), (solid,), Water(depth),
        FlowSettings(follow=None, far_x=False, far_y=False),
    )  # fmt: skip
    rest = depth - LIGHT_DRAUGHT + 0.5 * LIGHT_HEIGHT
    return FreeBody(mass, box_inertia(mass, solid), (0.0, 0.0, rest + 0.01)), solver, rest


def check_light_box(cell_size: float = 0.03, dt: float = 2e-3) -> list[Check]:
    """Explicit grows, the others do not, and agree."""
    body, solver, rest = light_box(cell_size)
    speeds = [0.0]
    scheme = Explicit()
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


def check_heave(cell_size: float = 0.025, dt: float = 5e-3) -> list[Check]:
    """The box of `floating`, free in all six directions: period of linear theory."""
    checks = []
    for scheme in (SemiImplicit(), Strong()):
        solver = floating_box_solver(cell_size)
        rest = DEPTH - DRAUGHT + 0.5 * HEIGHT
        body = FreeBody(MASS, box_inertia(MASS, box(LENGTH, WIDTH, HEIGHT)), (0.0, 0.0, rest + 0.01))
        places, _ = run(body, solver, scheme, 2.4, dt)
        times = np.array(dt * np.arange(len(places)), dtype=float)
        later = times >= 0.25 * heave_period()
        period, damping = fitted_oscillation(times[later], places[later, 2] - rest, heave_period())
        checks.append(relative(f"heave period, {named(scheme)}", period, heave_period(), 0.02, "s"))
        checks.append(reported(f"damping ratio, {named(scheme)}", damping))
        checks.append(reported(f"flow steps a macro step, {named(scheme)}", iterations(scheme)))
    return checks


# -- momentum ---------------------------------------------------------------------------------------------------------


def coupled_momentum_gap(scheme: Coupling, duration: float = 0.3, dt: float = 2e-3) -> float:
    """Box pulled along a closed tank by a constant force: momentum of water and box less all impulses, over the pull's.

    The box, neutrally buoyant, is free in all six directions; the tank is that of `bodies.momentum_gap`.
    """
    grid = Grid.uniform((-0.6, -0.3, 0), (0.6, 0.3, 0.4), 0.02)
    solid, pull = box(0.2, 0.16, 0.12), 3.0
    mass = 1000.0 * 0.2 * 0.16 * 0.12
    solver = FlowSolver(grid, (solid,), Water(0.3), replace(TANK, sharp_edges=False))
    body, water = FreeBody(mass, box_inertia(mass, solid), (0.0, 0.001, 0.15), (pull, 0.0, 0.0)), TankWater(solver)
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


# -- the vehicle ------------------------------------------------------------------------------------------------------


def vehicle_run(scheme: Coupling, macro_step: float, cell_size: float = 0.04) -> xr.Dataset:
    """0.4 s of a sharp start with steering, 60 % depth against 1 m/s, coarse; a run that breaks is cut there."""
    from exumob.simulation.run import simulate
    from vehicle_models.amphibious import amphibious_vehicle

    maneuver = LaneChange(amplitude=np.radians(25.0), start=0.1, end=0.6, ramp_time=0.2)
    try:
        return simulate(
            amphibious_vehicle(), Soil.published("LETE sand"), Water.at_ratio(0.6, 1.0), maneuver,
            CfdHydrodynamics(cell_size=cell_size, allow_coarse=True), duration=0.4, macro_step=macro_step,
            record_step=5e-3, coupling=scheme,
        )  # fmt: skip
    except SimulationError as error:
        if error.result is None:
            raise
        return error.result


def check_vehicle() -> list[Check]:
    """Schemes and macro steps against each other: place of the hull after 0.4 s, over the way."""
    reference = vehicle_run(Strong(tolerance=1e-4), 1e-3)
    end = reference["position"].values[-1, 0]
    way = float(np.linalg.norm(end - reference["position"].values[0, 0]))
    explicit = vehicle_run(Explicit(), 1e-3)
    checks = [
        reported("way, strong (1e-4), 1 ms", way, unit="m"),
        reported("flow steps a macro step, strong", float(reference["coupling_iterations"].mean())),
        at_least("explicit, 1 ms, largest acceleration of the hull",
                 float(np.abs(explicit["acceleration"].values[:, 0]).max()), 10.0 * GRAVITY, "m/s2"),
        reported("explicit, 1 ms, breaks at", float(explicit["time"][-1]), unit="s"),
    ]  # fmt: skip
    for scheme, step, limit in (
        (SemiImplicit(), 1e-3, 0.01),
        (Strong(), 1e-3, 0.01),
        (Strong(method="aitken"), 1e-3, 0.01),
        (SemiImplicit(within_step="held"), 1e-3, 0.01),
        (SemiImplicit(), 5e-4, 0.03),
        (SemiImplicit(), 2e-3, float("inf")),
        (SemiImplicit(), 5e-3, float("inf")),
        (SemiImplicit(within_step="held"), 5e-3, float("inf")),
    ):
        found = vehicle_run(scheme, step, 0.04)
        apart = float(np.linalg.norm(found["position"].values[-1, 0] - end)) / way
        name = f"{named(scheme)}, {scheme.within_step}, {1e3 * step:g} ms"
        checks.append(absolute(f"place apart over way, {name}", apart, 0.0, limit))
        checks.append(reported(f"flow steps a macro step, {name}", float(found["coupling_iterations"].mean())))
    return checks


CASES: tuple[Case, ...] = (
    Case("coupled-fall", "sphere released in air and in water: first acceleration with Lamb's added mass",
         check_free_fall, 0.5),
    Case("coupled-spring", "mass on a spring with twice its added mass: order of the coupling in the macro step",
         check_spring, 0.1),
    Case("coupled-light-box", "box lighter than its added mass: explicit coupling fails, the others hold and agree",
         check_light_box, 0.5),
    Case("coupled-momentum", "momentum of water and free box in a closed tank", check_coupled_momentum, 0.3),
    Case("coupled-vehicle", "vehicle in the current, coarse: schemes and macro steps against each other",
         check_vehicle, 5.0, slow=True),
    Case("coupled-heave", "free floating box: heave period of linear theory", check_heave, 3.0, slow=True),
)  # fmt: skip
