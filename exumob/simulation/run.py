"""simulate(): a maneuver drives a vehicle, soil and water push back, the result is a Dataset."""

from __future__ import annotations

import logging
import signal
import threading
import time
from collections.abc import Callable
from dataclasses import is_dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from exumob.coupling.explicit import Explicit
from exumob.coupling.scheme import Coupling, checked_wrenches
from exumob.coupling.semi_implicit import SemiImplicit
from exumob.driving.maneuver import FeedbackManeuver, Maneuver, lane_change
from exumob.ground.soil import Soil
from exumob.ground.terrain import Terrain
from exumob.multibody.system import HISTORY_STEP, SETTLING_STEP, MultibodyVehicle
from exumob.simulation.checkpoint import Checkpoints, Fingerprint
from exumob.simulation.results import build_dataset
from exumob.support.arrays import Array
from exumob.support.checks import require_positive
from exumob.support.errors import SimulationError, SimulationInterrupted
from exumob.vehicle.motion import BodyStates
from exumob.vehicle.parameters import Vehicle
from exumob.water.coefficients import CoefficientHydrodynamics
from exumob.water.conditions import Water
from exumob.water.hydrodynamics import Hydrodynamics, NoWater, SpinUpHydrodynamics

logger = logging.getLogger(__name__)


def simulate(
    vehicle: Vehicle,
    soil: Soil,
    water: Water | None = None,
    maneuver: Maneuver | None = None,
    hydrodynamics: Hydrodynamics | None = None,
    *,
    duration: float = 8.0,
    micro_step: float = 1.0e-4,
    macro_step: float = 1.0e-3,
    record_step: float = 1.0e-2,
    terrain: Terrain | None = None,
    coupling: Coupling | None = None,
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
    hydrodynamics : Hydrodynamics, optional
        Default: `CoefficientHydrodynamics` in water, `NoWater` on dry ground.
    duration : float
        [s]
    micro_step : float
        Step of the multibody solver [s]; 1 ms must be a whole multiple of it.
    macro_step : float
        Interval at which the water's loads are renewed [s]; a whole multiple of `micro_step`.
    record_step : float
        Interval of the result [s]; a whole multiple of `micro_step`.
    terrain : Terrain, optional
        Default: flat at z = 0.
    coupling : Coupling, optional
        How vehicle and water agree within a macro step. Default: `SemiImplicit` for a flow code, `Explicit` (the
        paper's) for models that take account of added mass themselves.
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
    maneuver = maneuver or lane_change()
    terrain = terrain or Terrain()
    if hydrodynamics is None:
        hydrodynamics = NoWater() if water is None else CoefficientHydrodynamics()
    _check_steps(duration, micro_step, macro_step, record_step)
    if water is not None and not (terrain.is_flat and terrain.height == 0.0):
        raise ValueError(
            "simulate.terrain: the water models know a flat bed at z = 0 only; leave out the water, or use the default "
            "terrain."
        )
    _check_maneuver(vehicle, maneuver, duration)
    steps = {"duration": duration, "micro_step": micro_step, "macro_step": macro_step, "record_step": record_step}
    active = hydrodynamics
    scheme = coupling or (SemiImplicit() if isinstance(active, SpinUpHydrodynamics) else Explicit())
    store = None
    if checkpoint is not None:
        _check_described(maneuver)
        fingerprint = Fingerprint.of(
            {
                "vehicle": vehicle, "soil": soil, "water": water, "terrain": terrain, "maneuver": maneuver,
                "hydrodynamics": hydrodynamics, "coupling": scheme, "steps": steps,
            },
            maneuver, duration,
        )  # fmt: skip
        store = Checkpoints(Path(checkpoint), fingerprint, resume)
    elif resume:
        raise ValueError("simulate.resume: there is nothing to go on from without checkpoint; give its file.")
    began = time.perf_counter()
    model = MultibodyVehicle(vehicle, soil, maneuver, terrain, micro_step, duration, record_step)
    scheme.start()
    first = 0
    if store is not None and store.released:
        active.start(vehicle, water, macro_step)
        first = store.resume(model, active, scheme)
    else:
        _settle(model, active, vehicle, water, macro_step, store)
        active.start(vehicle, water, macro_step)
    settled = time.perf_counter()

    def result(status: str) -> xr.Dataset:
        earlier = 0.0 if store is None else store.elapsed
        walls = {"wall_time": earlier + time.perf_counter() - settled, "settling_wall_time": settled - began}
        return build_dataset(
            model, vehicle, soil, water, terrain, maneuver, active, scheme, status, steps, walls
        )  # fmt: skip

    stop = _StopRequest()
    try:
        with stop:
            for n in range(first, round(duration / macro_step)):
                if store is not None:
                    store.before_step(n, model, active, scheme)
                scheme.step(model, active, (n + 1) * macro_step)
                if progress is not None:
                    progress(model.time)
                stop.check()
    except SimulationError as error:
        error.result = result(f"broke down at {model.time:.4f} s: {error}")
        _keep(store, model, active, scheme)
        raise
    except KeyboardInterrupt:
        stopped = SimulationInterrupted(model.time, result(f"interrupted at {model.time:.4f} s"))
        _keep(store, model, active, scheme)
        raise stopped from None
    except Exception as error:  # of a water model, a maneuver or `progress`: none of them may cost what was computed
        broken = SimulationError(f"{vehicle.name}: {type(error).__name__} at {model.time:.4f} s: {error}")
        broken.result = result(f"broke down at {model.time:.4f} s: {error}")
        _keep(store, model, active, scheme)
        raise broken from error
    model.record_end()
    finished = result("completed")
    lowest = float(finished["keel_clearance"].min())
    if lowest < 0.0:
        logger.warning(
            "%s: the keel came %.3f m below the soil surface; contact of hull and soil is not modelled, so the run is "
            "too favourable from then on. Use a firmer soil or a higher ground_clearance.", vehicle.name, -lowest,
        )  # fmt: skip
    return finished


def _settle(
    model: MultibodyVehicle, hydrodynamics: Hydrodynamics, vehicle: Vehicle, water: Water | None, macro_step: float,
    store: Checkpoints | None,
) -> None:  # fmt: skip
    """Static equilibrium of the vehicle with the water's loads, the state at time 0."""
    if isinstance(hydrodynamics, SpinUpHydrodynamics):

        def settle(load: Callable[[BodyStates], Array]) -> BodyStates:
            model.settle(load)
            return model.present()

        keep = (lambda saved: None) if store is None else store.keep_spin_up
        begun = None if store is None else store.spin_up
        hydrodynamics.run_spin_up(vehicle, water, macro_step, settle, keep, begun)
        return
    hydrodynamics.start(vehicle, water, SETTLING_STEP)
    model.settle(lambda states: checked_wrenches(hydrodynamics, states, lambda: states))


def _keep(store: Checkpoints | None, model: MultibodyVehicle, hydrodynamics: Hydrodynamics, coupling: Coupling) -> None:
    """Write a checkpoint of a run that was stopped; what goes wrong there must not hide why."""
    if store is None:
        return
    try:
        store.rescue(model, hydrodynamics, coupling)
    except Exception as error:
        logger.warning("no further checkpoint could be written (%s); %s is the last one", error, store.file)


class _StopRequest:
    """Ctrl-C waits for the end of the macro step, so that nothing is left half done; a second one does not."""

    def __init__(self) -> None:
        self._asked = False
        self._before: Any = None

    def __enter__(self) -> None:
        if threading.current_thread() is threading.main_thread():
            self._before = signal.getsignal(signal.SIGINT)
            if self._before is signal.default_int_handler:
                signal.signal(signal.SIGINT, self._ask)

    def __exit__(self, *_: object) -> None:
        if self._before is signal.default_int_handler:
            signal.signal(signal.SIGINT, self._before)

    def _ask(self, number: int, frame: Any) -> None:
        if self._asked:
            raise KeyboardInterrupt
        self._asked = True

    def check(self) -> None:
        """Stop now if asked to."""
        if self._asked:
            raise KeyboardInterrupt


def _check_steps(duration: float, micro_step: float, macro_step: float, record_step: float) -> None:
    require_positive(
        "simulate", duration=duration, micro_step=micro_step, macro_step=macro_step, record_step=record_step
    )
    for name, coarse, fine_name, fine in (
        ("the history step of 1 ms", HISTORY_STEP, "micro_step", micro_step),
        ("macro_step", macro_step, "micro_step", micro_step),
        ("record_step", record_step, "micro_step", micro_step),
        ("duration", duration, "macro_step", macro_step),
    ):
        ratio = coarse / fine
        if round(ratio) < 1 or abs(ratio - round(ratio)) > 1e-6 * ratio:
            choice, advice = name, f"{max(round(ratio), 1) * fine:.9g}"
            if name.startswith("the history"):
                choice, advice = "micro_step", "1e-3, 5e-4, 2.5e-4, 2e-4 or 1e-4"
            raise ValueError(
                f"simulate: {name} ({coarse:g} s) must be a whole multiple of {fine_name} = {fine:g} s; "
                f"choose {choice} = {advice} s, say."
            )


def _check_described(maneuver: Maneuver) -> None:
    """Two drivers with other gains must not pass for the same."""
    described = is_dataclass(maneuver) or isinstance(getattr(maneuver, "parameters", None), dict)
    if isinstance(maneuver, FeedbackManeuver) and not described:
        raise ValueError(
            f"simulate.checkpoint: {type(maneuver).__name__} cannot be told from another one; make it a dataclass, or "
            "give it a dict `parameters`."
        )


def _check_maneuver(vehicle: Vehicle, maneuver: Maneuver, duration: float) -> None:
    times = np.arange(0.0, duration + HISTORY_STEP, HISTORY_STEP)
    steering = np.array([maneuver.steering(t) for t in times])
    speed = np.array([maneuver.wheel_speed(t) for t in times])
    if not (np.isfinite(steering).all() and np.isfinite(speed).all()):
        raise ValueError("maneuver: steering or wheel_speed is not finite within the duration; mend its definition.")
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
    if np.abs(steering[0, :2]).max() > 1e-12 or np.abs(speed[0, :2]).max() > 1e-9:
        raise ValueError(
            f"maneuver: starts with steering {steering[0, 0]:.3g} rad and wheel speed {speed[0, 0]:.3g} rad/s; it must "
            "start at rest, straight ahead, with zero rates (the vehicle starts in static equilibrium). Ramp them up."
        )
