"""simulate(): a maneuver drives a vehicle, soil and water push back, the result is a Dataset."""

from __future__ import annotations

import itertools
import logging
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated

import numpy as np
import xarray as xr

from exumob.coupling.explicit import Explicit
from exumob.coupling.macro_step import FollowFlow
from exumob.coupling.scheme import Coupling, Scheme, checked_wrenches
from exumob.coupling.semi_implicit import SemiImplicit
from exumob.driving.maneuver import Maneuver, lane_change
from exumob.ground.hull_contact import hull_contact
from exumob.ground.soil import Soil
from exumob.ground.terrain import Terrain
from exumob.multibody.applied_loads import vehicle_loads
from exumob.multibody.placing import standing_pose
from exumob.multibody.settling import SETTLING_STEP, Start
from exumob.multibody.system import MultibodyVehicle
from exumob.simulation.checkpoint import Checkpoints, Fingerprint
from exumob.simulation.checks import (
    check_described,
    check_following,
    check_maneuver,
    check_steps,
    check_water_model,
    rolling_start,
)
from exumob.simulation.cost import prepare
from exumob.simulation.description import RunDescription, Steps
from exumob.simulation.over_ground import check_start, warn_of_ground
from exumob.simulation.results import build_dataset
from exumob.simulation.settings import DEFAULT_SETTING, DURATION, RECORD_STEP, setting_named
from exumob.simulation.stop_request import StopRequest
from exumob.simulation.water_models import DEFAULT_MODEL, hydrodynamics_named
from exumob.support import quantities
from exumob.support.arrays import Array
from exumob.support.compiled import compiling_time, computing_clock, say_compilation
from exumob.support.declared import checked
from exumob.support.errors import SimulationError, SimulationInterrupted
from exumob.support.quantities import INITIAL_SPEED, STEP
from exumob.support.small_matrices import on_one_thread
from exumob.vehicle.motion import BodyStates
from exumob.vehicle.parameters import Vehicle
from exumob.vehicle.point_force import PointForce
from exumob.vehicle.start_pose import StartPose
from exumob.water.conditions import Water
from exumob.water.hydrodynamics import Hydrodynamics, SpinUpHydrodynamics
from exumob.water.wetted_surface import hull_triangles

logger = logging.getLogger(__name__)

SLID = 0.02
"""Way to the side while a vehicle settles, over its wheelbase, from which it is said [-]."""


@checked
def simulate(  # one argument a part of the run; all but two have defaults
    vehicle: Vehicle,
    soil: Soil,
    water: Water | None = None,
    maneuver: Maneuver | None = None,
    hydrodynamics: Hydrodynamics | str = DEFAULT_MODEL,
    *,
    duration: Annotated[float, quantities.DURATION] = DURATION,
    setting: str = DEFAULT_SETTING,
    micro_step: Annotated[float | None, STEP] = None,
    macro_step: Annotated[float | FollowFlow | None, STEP] = None,
    record_step: Annotated[float, STEP] = RECORD_STEP,
    terrain: Terrain | None = None,
    start: StartPose | tuple[float, float, float] | None = None,
    initial_speed: Annotated[float | None, INITIAL_SPEED] = None,
    coupling: Coupling | None = None,
    forces: Sequence[PointForce] = (),
    user_loads: bool = False,
    checkpoint: str | Path | None = None,
    resume: bool = False,
    progress: Callable[[float], None] | None = None,
) -> xr.Dataset:
    """Run one vehicle through one maneuver (paper Fig. 2: macro steps of the water, micro steps of the vehicle).

    Parameters
    ----------
    vehicle : Vehicle
    soil : Soil
    water : Water, optional
        None: dry ground.
    maneuver : Maneuver, optional
        Default: the paper's lane change.
    hydrodynamics : Hydrodynamics or str
        The model of the water's loads, or its name (`exumob.simulation.water_models.hydrodynamics_named`). The default
        ``"auto"`` takes the networks that come with exumob where they fit the vehicle, and calibrated coefficients
        elsewhere, with a warning; on dry ground there is none.
    duration : float
        Simulated time [s].
    setting : str
        The steps by name, ``"fast"`` or ``"fine"``: `exumob.simulation.settings.SETTINGS` states them and their error.
    micro_step : float, optional
        Step of the multibody solver [s]; 1 ms must be a whole multiple of it. Default: that of the setting.
    macro_step : float or FollowFlow, optional
        Interval at which the loads of the water are renewed [s]; a whole multiple of `micro_step`. With a flow solver
        in the loop it can follow the flow (`exumob.coupling.macro_step.FollowFlow`). Default: that of the setting.
    record_step : float
        Interval of the result [s]; a whole multiple of `micro_step`.
    terrain : Terrain, optional
        Default: flat at z = 0. With water over any other ground, give the water by its level or as a field.
    start : StartPose or (float, float, float), optional
        Place [m] and heading [rad] at time 0, ``(x, y, heading)``. Default: the world's origin, heading along world x.
        A maneuver goes from there; a path stays where its waypoints are.
    initial_speed : float, optional
        Speed at time 0 along the heading [m/s], all wheels rolling: the maneuver's wheel speed starts there, its
        ``start_speed`` is set; one that has none must fit. Default: as its wheels turn, so at rest if they do not turn.
        Not with a flow solver in the loop.
    coupling : Coupling, optional
        How vehicle and water agree within a macro step. Default: `SemiImplicit` for a flow code, `Explicit` (the
        paper's) for models that take account of added mass themselves.
    forces : sequence of PointForce
        Forces of your own on the vehicle, such as a tow rope.
    user_loads : bool
        Let the loads enter as user loads of Exudyn, functions in Python on each body, as its users write them, not as
        one vector of generalised forces: the same motion to 1e-8 m, in more time. A check, and a place to start from.
    checkpoint : path, optional
        File (.npz) that holds the whole run, written at the release, every half second and when it stops or breaks.
    resume : bool
        Go on from `checkpoint`, if there is one, with the same bits as a run that was never stopped; else begin.
    progress : callable, optional
        Called with the time reached [s] after each macro step.

    Returns
    -------
    xarray.Dataset
        See `exumob.simulation.results.build_dataset`.

    Raises
    ------
    ValueError
        On input that cannot be run, before anything runs; a checkpoint of another run, or of another version, is such.
    SimulationError
        If the run breaks; ``error.result`` holds the Dataset up to then.
    SimulationInterrupted
        On Ctrl-C; a KeyboardInterrupt whose ``result`` holds the Dataset up to then.
    """
    maneuver = lane_change() if maneuver is None else maneuver
    terrain = Terrain() if terrain is None else terrain
    pose = StartPose() if start is None else StartPose(*start) if isinstance(start, tuple) else start
    if isinstance(hydrodynamics, str):
        hydrodynamics = hydrodynamics_named(hydrodynamics, vehicle, water)
    in_loop = isinstance(hydrodynamics, SpinUpHydrodynamics)
    usual_micro_step, usual_macro_step = setting_named(setting).steps(in_loop)
    steps = Steps(
        duration,
        usual_micro_step if micro_step is None else micro_step,
        usual_macro_step if macro_step is None else macro_step,
        record_step,
    )
    check_steps(steps)
    check_start(vehicle, terrain, water, pose)
    check_water_model(hydrodynamics, water, terrain)
    commands = check_maneuver(vehicle, maneuver, duration, pose)
    maneuver, speed = rolling_start(vehicle, maneuver, initial_speed, in_loop)
    run = RunDescription(
        vehicle, soil, water, terrain, maneuver, hydrodynamics,
        (SemiImplicit() if in_loop else Explicit()) if coupling is None else coupling, steps, speed,
        tuple(forces), user_loads, pose,
    )  # fmt: skip
    check_following(run)
    prepare(run, commands, None if checkpoint is None else Path(checkpoint))
    store = None
    if checkpoint is not None:
        check_described(maneuver)
        store = Checkpoints(Path(checkpoint), Fingerprint.of(run), resume)
    elif resume:
        raise ValueError("simulate.resume: there is nothing to go on from without checkpoint; give its file.")
    with on_one_thread():
        return _drive(run, store, progress)


def _drive(run: RunDescription, store: Checkpoints | None, progress: Callable[[float], None] | None) -> xr.Dataset:
    """Settle the vehicle, or go on from a checkpoint, and take the macro steps (paper Fig. 2)."""
    steps, hydrodynamics, scheme = run.steps, run.hydrodynamics, run.coupling
    began, compiled = computing_clock(), compiling_time()
    say_compilation("the vehicle model", vehicle_loads, "half a minute to a minute")
    model = MultibodyVehicle(
        run.vehicle, run.soil, run.maneuver, run.terrain, steps.micro_step, steps.duration, steps.record_step,
        user_loads=run.user_loads, forces=run.forces, hull=hull_contact(hull_triangles(run.vehicle), run.terrain),
        start=run.start,
    )  # fmt: skip
    scheme.start()
    first = 0
    if store is not None and store.released:
        hydrodynamics.start(run.vehicle, run.water, steps.longest_macro_step)
        first = store.resume(model, hydrodynamics, scheme)
    else:
        _settle(model, run, store)
        hydrodynamics.start(run.vehicle, run.water, steps.longest_macro_step)
    settled = computing_clock()

    def result(status: str, cause: str = "") -> xr.Dataset:
        earlier = 0.0 if store is None else store.elapsed
        walls = {
            "wall_time": earlier + computing_clock() - settled, "settling_wall_time": settled - began,
            "compiling_wall_time": compiling_time() - compiled,
        }  # fmt: skip
        found = build_dataset(model, run, status, walls, cause)
        warn_of_ground(run.vehicle, found)
        return found

    stop = StopRequest()
    try:
        with stop:
            for n in itertools.count(first):
                if round((steps.duration - model.time) / steps.micro_step) < 1:
                    break
                if store is not None:
                    store.before_step(n, model, hydrodynamics, scheme)
                scheme.step(model, hydrodynamics, _end_of_step(run, n, model.time))
                if progress is not None:
                    progress(model.time)
                stop.check()
    except SimulationError as error:
        error.result = result(f"broke down at {model.time:.4f} s: {error}", error.cause)
        _keep(store, model, run)
        raise
    except KeyboardInterrupt:
        stopped = SimulationInterrupted(model.time, result(f"interrupted at {model.time:.4f} s"))
        _keep(store, model, run)
        raise stopped from None
    except Exception as error:  # of a water model, a maneuver or `progress`: none of them may cost what was computed
        broken = SimulationError(f"{run.vehicle.name}: {type(error).__name__} at {model.time:.4f} s: {error}")
        broken.result = result(f"broke down at {model.time:.4f} s: {error}")
        _keep(store, model, run)
        raise broken from error
    model.record_end()
    return result("completed")


def _end_of_step(run: RunDescription, n: int, now: float) -> float:
    """Return the end of macro step number `n`, which begins now [s]."""
    choice = run.steps.macro_step
    if not isinstance(choice, FollowFlow):
        return (n + 1) * choice
    assert isinstance(run.coupling, Scheme)
    return choice.end_of_step(now, run.steps.duration, run.coupling.trace, run.hydrodynamics)


def _settle(model: MultibodyVehicle, run: RunDescription, store: Checkpoints | None) -> None:
    """Find the static equilibrium of the vehicle with the loads of the water; it is the state at time 0."""
    hydrodynamics = run.hydrodynamics
    if isinstance(hydrodynamics, SpinUpHydrodynamics):
        found: list[Start] = []

        def settle(load: Callable[[BodyStates], Array]) -> BodyStates:
            found.append(model.settle(load))
            return model.present()

        keep = (lambda saved: None) if store is None else store.keep_spin_up
        begun = None if store is None else store.spin_up
        hydrodynamics.run_spin_up(run.vehicle, run.water, run.steps.longest_macro_step, settle, keep, begun)
        if found:
            _say_start(run, model, found[-1])
        return

    def load(states: BodyStates) -> Array:
        if states.time[-1] == 0.0:  # the search begins, or begins anew
            hydrodynamics.start(run.vehicle, run.water, SETTLING_STEP)
        return checked_wrenches(hydrodynamics, states, lambda: states)

    start = model.settle(load, run.initial_speed)
    _say_start(run, model, start)


def _say_start(run: RunDescription, model: MultibodyVehicle, start: Start) -> None:
    """Warn of a vehicle that does not stand where it starts."""
    name, speed = run.vehicle.name, start.speed
    place, turn = standing_pose(run.vehicle, run.terrain, run.start)
    laid = place + run.vehicle.wheel_centers.mean(axis=0) @ turn.T
    slid = float(np.hypot(*(model.present().position[-1, 1:].mean(axis=0) - laid)[:2]))
    if slid > SLID * run.vehicle.wheelbase:
        logger.warning(
            "%s: while it settled it slid by %.2g m; its path begins there, not where it was put.",
            name, slid,
        )  # fmt: skip
    if start.kind == "creeping":
        logger.warning(
            "%s: the soil holds the vehicle only by creep (about %.1f mm/s; from %.1f mm/s on it slides); it is "
            "released as it creeps.", name, 1e3 * speed, 1e3 * model.slowest_slide,
        )  # fmt: skip
    elif start.kind == "sliding":
        logger.warning(
            "%s: soil and water do not hold the vehicle (its locked wheels slide); it is held until it is released at "
            "rest, and moves off at once.", name,
        )  # fmt: skip
    elif start.kind == "afloat":
        logger.warning("%s: it is afloat; it is held in its place until it is released at rest.", name)
    elif start.kind == "out of balance":
        logger.warning(
            "%s: no equilibrium of height and attitude was found (%.2g m/s^2 are left); it is released all the same. "
            "Look at its first second with care.", name, start.acceleration,
        )  # fmt: skip


def _keep(store: Checkpoints | None, model: MultibodyVehicle, run: RunDescription) -> None:
    """Write a checkpoint of a run that was stopped; what goes wrong there must not hide why it was."""
    if store is None:
        return
    try:
        store.rescue(model, run.hydrodynamics, run.coupling)
    except Exception as error:
        logger.warning("no further checkpoint could be written (%s); %s is the last one", error, store.file)
