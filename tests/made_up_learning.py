"""Runs of a campaign without any flow: the loads are those of the coefficient model, and a bit more."""

import os
import time

import numpy as np

from exumob.flow.revision import solver_revision
from exumob.ground.soil import Soil
from exumob.learning.campaign import prescribed_states
from exumob.learning.dataset import SAMPLING, base_loads, histories, pack
from exumob.learning.plan import CaptiveTask
from exumob.paper.reference_runs import SOIL
from exumob.simulation.run import simulate
from exumob.support.errors import SimulationError
from exumob.support.provenance import parameters_json, provenance
from exumob.towing_tank.excitation import Envelope
from exumob.vehicle.motion import BodyStates
from exumob.water.coefficients import CoefficientHydrodynamics
from exumob.water.mesh_file import mesh_provenance

ENVELOPE = Envelope(
    speed=(-0.67, 1.12), sway=(-0.96, 0.96), yaw_rate=(-0.42, 0.42), slip=(-0.66, 1.26), steering=(-0.6, 0.6),
    heave=(-0.029, 0.033), pitch=(-0.023, 0.024), roll=(-0.01, 0.01), sinkage=(0.0, 0.015), slow=0.5, fast=2.0,
    rates=(2.5, 1.2, 1.6, 3.3, 2.5, 0.018, 0.084, 0.031, 0.035),
)  # fmt: skip
"""About that of the amphibious vehicle. Without rates a hull that heaves fast feels little but its added mass."""
MORE = 1.3
"""Loads over those of the coefficient model [-]."""


class Larger(CoefficientHydrodynamics):
    """Loads of the coefficient model, larger by `MORE`, in drives as in captive runs."""

    def wrenches(self, history, predict):
        return MORE * super().wrenches(history, predict)


def described(task, vehicle):
    return provenance() | mesh_provenance(vehicle.hull) | {
        "status": "completed", "scenario": task.name, "role": task.role, "flow_revision": solver_revision(),
        "cell_size": task.cell_size, "wall_time": 1.0,
        "parameters": parameters_json({"vehicle": vehicle, "water": task.water}),
    }  # fmt: skip


def states_run(task, vehicle):
    """A captive run's motion, with loads that mean nothing."""
    times = SAMPLING * np.arange(1, round(task.duration / SAMPLING) + 1)
    states = prescribed_states(task, vehicle, times)
    wrench = np.ones((len(times), 5, 6))
    return histories(states, wrench, task.water, described(task, vehicle))


def quick(task, vehicle, checkpoint, progress):
    """Motion of the captive runs only; free runs as if towed."""
    progress(0.5 * task.duration)
    checkpoint.touch()
    if "003" in task.name:
        raise SimulationError("it broke down")
    if isinstance(task, CaptiveTask):
        return states_run(task, vehicle)
    times = SAMPLING * np.arange(1, 201)
    n = len(times)
    place = np.vstack([vehicle.hull_origin, vehicle.wheel_centers])
    position = place + np.outer(times, [0.5, 0.0, 0.0])[:, None]
    zero = np.zeros((n, 5, 3))
    states = BodyStates(
        times, position, np.tile(np.eye(3), (n, 5, 1, 1)), zero + np.array([0.5, 0.0, 0.0]), zero, zero, zero,
        np.zeros((n, 4)),
    )  # fmt: skip
    return histories(states, np.ones((n, 5, 6)), task.water, described(task, vehicle))


def killed_once(task, vehicle, checkpoint, progress):
    """The first call writes a checkpoint and dies as a process that is killed; the next one goes on from it."""
    if not checkpoint.exists():
        checkpoint.write_text("half")
        os._exit(9)
    assert checkpoint.read_text() == "half"
    return quick(task, vehicle, checkpoint, progress) if "003" not in task.name else states_run(task, vehicle)


def slow(task, vehicle, checkpoint, progress):
    progress(0.1)
    time.sleep(600.0)


def coefficient_flow(task, vehicle, checkpoint, progress):
    """Loads of the coefficient model, larger by `MORE`."""
    if isinstance(task, CaptiveTask):
        run = states_run(task, vehicle)
        loads = MORE * base_loads(run, vehicle)
        return histories_with(run, loads)
    sand = Soil.published(SOIL)
    result = simulate(
        vehicle, sand, task.water, task.maneuver, Larger(), duration=task.duration, micro_step=1e-3, macro_step=5e-3,
        record_step=1e-3,
    )  # fmt: skip
    return pack(result).assign_attrs(described(task, vehicle) | {"parameters": result.attrs["parameters"]})


def histories_with(run, loads):
    for name in ("water_wrench", "water_wrench_smooth"):
        run[name] = run[name].copy(data=loads.astype(np.float32))
    return run


def of_another_version(task, vehicle, checkpoint, progress):
    """A checkpoint that another version of the program has left is refused, as those of flow runs are."""
    if checkpoint.exists():
        raise ValueError(f"checkpoint {checkpoint} belongs to another run: program differs. Move it away.")
    return quick(task, vehicle, checkpoint, progress)
