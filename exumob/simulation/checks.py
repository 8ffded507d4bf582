"""Checks of a run's input, before anything runs."""

from __future__ import annotations

from dataclasses import is_dataclass, replace
from typing import Any, cast

import numpy as np

from exumob.coupling.macro_step import FollowFlow
from exumob.coupling.scheme import Scheme
from exumob.driving.maneuver import FeedbackManeuver, Maneuver
from exumob.driving.path_following import PathFollowing
from exumob.ground.terrain import Terrain
from exumob.simulation.cost import require_room
from exumob.simulation.description import RunDescription, Steps
from exumob.support.checks import require_positive
from exumob.vehicle.motion import HISTORY_STEP
from exumob.vehicle.parameters import Vehicle
from exumob.vehicle.start_pose import StartPose
from exumob.water.conditions import Water
from exumob.water.hydrodynamics import BedHydrodynamics, Hydrodynamics, NoWater, SpinUpHydrodynamics

MOST_SAMPLES = 100_000
"""Instants at which a maneuver is looked at; of a longer one than 100 s not every millisecond."""

ROLLING = 0.01
"""How far wheels may turn from rolling at time 0, over the speed."""


def check_steps(steps: Steps) -> None:
    """Raise ValueError unless every step, positive by its declaration, is a whole multiple of the one below it [s]."""
    macro_step = "macro_step.unit" if isinstance(steps.macro_step, FollowFlow) else "macro_step"
    for name, coarse, fine_name, fine in (
        ("", HISTORY_STEP, "micro_step", steps.micro_step),
        (macro_step, steps.macro_step_unit, "micro_step", steps.micro_step),
        ("record_step", steps.record_step, "micro_step", steps.micro_step),
        ("duration", steps.duration, macro_step, steps.macro_step_unit),
    ):
        ratio = coarse / fine
        if round(ratio) < 1 or abs(ratio - round(ratio)) > 1e-6 * ratio:
            if not name:
                raise ValueError(
                    f"simulate.micro_step = {fine:g} s must divide 1 ms, the interval at which the water's models see "
                    "the motion, into whole parts; choose 1e-3, 5e-4, 2.5e-4, 2e-4 or 1e-4 s, say."
                )
            raise ValueError(
                f"simulate.{name} = {coarse:g} s must be a whole multiple of {fine_name} = {fine:g} s; choose {name} = "
                f"{max(round(ratio), 1) * fine:.9g} s, say."
            )
    require_room(steps)


def check_water_model(hydrodynamics: Hydrodynamics, water: Water | None, terrain: Terrain) -> None:
    """Refuse water that a model does not know, and tell one that knows terrain of it.

    Raises
    ------
    ValueError
        If there is water, the model has no `set_bed`, and the water is none of one depth over level ground at z = 0.
    """
    if isinstance(hydrodynamics, BedHydrodynamics):
        hydrodynamics.set_bed(terrain)
        return
    if water is None or type(hydrodynamics) is NoWater:
        return
    name = type(hydrodynamics).__name__
    remedy = "give the model a function set_bed (exumob.water.hydrodynamics.BedHydrodynamics), or level ground"
    if water.depth is None:
        raise ValueError(
            f"simulate.water: {name} knows water of one depth and one current only, Water(depth=...); {remedy}."
        )
    if not (terrain.is_flat and terrain.height == 0.0):
        raise ValueError(f"simulate.terrain: {name} knows water over level ground at z = 0 only; {remedy}.")


def check_following(run: RunDescription) -> None:
    """Raise ValueError if the macro step is to follow a flow that there is not, or by a scheme without a record."""
    if not isinstance(run.steps.macro_step, FollowFlow):
        return
    if not isinstance(run.hydrodynamics, SpinUpHydrodynamics):
        raise ValueError(
            f"simulate.macro_step = FollowFlow(...) needs a flow solver in the loop, and the water's model is "
            f"{type(run.hydrodynamics).__name__}; give a number of seconds, such as 20e-3."
        )
    if not isinstance(run.coupling, Scheme):
        raise ValueError(
            f"simulate.macro_step = FollowFlow(...) follows the record of a `Scheme` (SemiImplicit, Strong, Explicit); "
            f"{type(run.coupling).__name__} is none. Give a number of seconds, such as 2e-3."
        )


def check_described(maneuver: Maneuver) -> None:
    """Raise ValueError if a driver has no parameters by which a checkpoint tells it from another one."""
    described = is_dataclass(maneuver) or isinstance(getattr(maneuver, "parameters", None), dict)
    if isinstance(maneuver, FeedbackManeuver) and not described:
        raise ValueError(
            f"simulate.checkpoint: {type(maneuver).__name__} cannot be told from another one; make it a dataclass, or "
            "give it a dict `parameters`."
        )


def check_maneuver(
    vehicle: Vehicle, maneuver: Maneuver, duration: float, start: StartPose | None = None
) -> tuple[float, float]:  # fmt: skip
    """Raise ValueError unless a maneuver is finite, starts steadily and where the vehicle does, and can be steered.

    Returns
    -------
    (float, float)
        Smallest and largest mean angle of the front wheels that it can ask for [rad].
    """
    times = np.arange(0.0, duration + HISTORY_STEP, max(HISTORY_STEP, duration / MOST_SAMPLES))
    steering = np.array([maneuver.steering(t) for t in times])
    speed = np.array([maneuver.wheel_speed(t) for t in times])
    if not (np.isfinite(steering).all() and np.isfinite(speed).all()):
        raise ValueError("maneuver: steering or wheel_speed is not finite within the duration; mend its definition.")
    if isinstance(maneuver, PathFollowing):
        maneuver.check_start(vehicle, start)
        maneuver.warn_of_length(vehicle.wheel.radius * float(np.abs(speed[:, 0]).max()) * duration)
    largest = np.abs(steering[:, 0]).max()
    if isinstance(maneuver, FeedbackManeuver):
        largest = max(largest, maneuver.max_steering)
        require_positive("maneuver", control_step=maneuver.control_step)
    elif hasattr(maneuver, "driver"):
        missing = [name for name in ("control_step", "max_steering") if not hasattr(maneuver, name)]
        raise ValueError(
            f"maneuver: {type(maneuver).__name__} has a driver, but no {' and no '.join(missing)}; see "
            "exumob.driving.maneuver.FeedbackManeuver."
        )
    if largest > vehicle.steering.limit:
        raise ValueError(
            f"maneuver: steers {np.degrees(largest):.1f} deg, beyond Steering.limit = "
            f"{np.degrees(vehicle.steering.limit):.1f} deg of {vehicle.name}; steer less or raise the limit."
        )
    if np.abs(steering[0, :2]).max() > 1e-12 or abs(speed[0, 1]) > 1e-9:
        raise ValueError(
            f"maneuver: starts with steering {steering[0, 0]:.3g} rad, its rate {steering[0, 1]:.3g} rad/s and wheels "
            f"that speed up by {speed[0, 1]:.3g} rad/s^2; it must start straight ahead and steadily. Ramp them up."
        )
    if isinstance(maneuver, FeedbackManeuver):
        return -largest, largest
    return float(steering[:, 0].min()), float(steering[:, 0].max())


def rolling_start(
    vehicle: Vehicle, maneuver: Maneuver, initial_speed: float | None, flow_in_loop: bool
) -> tuple[Maneuver, float]:  # fmt: skip
    """Bring the wheel speed at time 0 and the speed of the vehicle together: its wheels roll.

    Parameters
    ----------
    vehicle : Vehicle
    maneuver : Maneuver
    initial_speed : float or None
        Speed of the vehicle at time 0 [m/s]. None: as the maneuver's wheels turn.
    flow_in_loop : bool

    Returns
    -------
    (Maneuver, float)
        The maneuver, its `start_speed` that of rolling wheels where it has one that was 0; and the speed [m/s].

    Raises
    ------
    ValueError
        If the maneuver's wheels turn otherwise at time 0; or if the vehicle is to start in motion with a flow solver in
        the loop, round which the flow cannot be developed.
    """
    radius = vehicle.wheel.radius
    own = float(maneuver.wheel_speed(0.0)[0])
    speed = own * radius if initial_speed is None else initial_speed
    if flow_in_loop and speed != 0.0:
        raise ValueError(
            f"simulate.initial_speed = {speed:g} m/s: with a flow solver in the loop the water develops round a "
            "vehicle at rest; start at rest (no initial_speed, a maneuver with start_speed = 0) and ramp the wheels up."
        )
    if own == 0.0 and speed != 0.0 and "start_speed" in getattr(maneuver, "__dataclass_fields__", {}):
        return cast(Maneuver, replace(cast(Any, maneuver), start_speed=speed / radius)), speed
    if abs(own * radius - speed) > ROLLING * max(abs(speed), abs(own * radius)):
        raise ValueError(
            f"maneuver: its wheels turn at {own:.4g} rad/s at time 0 and would roll at {own * radius:.4g} m/s, but "
            f"simulate.initial_speed = {speed:.4g} m/s; let it start at {speed / radius:.4g} rad/s, or leave "
            "initial_speed out: the vehicle then moves as its wheels roll."
        )
    return maneuver, speed
