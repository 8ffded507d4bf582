"""Checkpoints: a run that was stopped, killed or broke down goes on with the same bits; others are refused."""

import math
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace

import numpy as np
import pytest
from coupled_runs import QUICK, ROOT, SHORT, STEPS, WATER, StandIn, assert_same, run

import exumob.simulation.checkpoint
from exumob.coupling.explicit import Explicit
from exumob.coupling.flow_code import BuiltInFlow
from exumob.coupling.flow_in_loop import CfdHydrodynamics, FlowSpinUp
from exumob.coupling.semi_implicit import SemiImplicit
from exumob.coupling.strong import Strong
from exumob.ground.soil import Soil
from exumob.simulation.run import simulate
from exumob.support.errors import SimulationError, SimulationInterrupted
from exumob.vehicle.point_force import PointForce
from exumob.water.coefficients import CoefficientHydrodynamics
from exumob.water.conditions import Water


def stopping(at):
    def progress(now):
        if now > at - 1e-9:
            raise KeyboardInterrupt

    return progress


@pytest.mark.parametrize("scheme", [Explicit, SemiImplicit, Strong])
def test_stopped_and_resumed_run_is_the_single_run(vehicle, sand, tmp_path, scheme):
    """Ctrl-C at 0.055 s; explicit with the coefficient model, the others with a flow code that keeps a state."""

    def go(**options):
        water_model = CoefficientHydrodynamics() if scheme is Explicit else CfdHydrodynamics(
            StandIn(), spin_up=SHORT
        )  # fmt: skip
        return simulate(
            vehicle, sand, WATER, QUICK, water_model, duration=0.08, coupling=scheme(), **STEPS, **options
        )  # fmt: skip

    file = tmp_path / "run.npz"
    single = go()
    with pytest.raises(SimulationInterrupted):
        go(checkpoint=file, progress=stopping(0.055))
    times = []
    resumed = go(checkpoint=file, resume=True, progress=times.append)
    assert 0.045 < times[0] <= 0.056
    assert_same(single, resumed)
    assert [path.name for path in tmp_path.iterdir()] == ["run.npz"]


def test_own_flow_solver_resumes_with_the_same_bits(vehicle, sand, tmp_path):
    """Coarse and short; interrupted in the midst of the flow's own state."""
    file = tmp_path / "run.npz"

    def go(**options):
        water_model = CfdHydrodynamics(
            BuiltInFlow(0.06, allow_coarse=True), spin_up=FlowSpinUp(0.05, 0.04, 0.02, 4e-3)
        )  # fmt: skip
        return simulate(vehicle, sand, WATER, QUICK, water_model, duration=0.04, **STEPS, **options)

    single = go()
    with pytest.raises(SimulationInterrupted):
        go(checkpoint=file, progress=stopping(0.025))
    assert_same(single, go(checkpoint=file, resume=True))


def test_run_stopped_before_the_release_goes_on(vehicle, sand, tmp_path, monkeypatch):
    """Stopped while the water develops, and again, later, on the way to the second place of rest."""
    monkeypatch.setattr("exumob.coupling.flow_in_loop.SAVE_INTERVAL", 0.03)
    file = tmp_path / "run.npz"
    single = run(vehicle, sand, duration=0.01)
    begun = []
    for stop in (-0.06, -0.01, math.inf):
        times = []

        def watched(now, stop=stop, times=times):
            times.append(now)
            if now > stop:
                raise KeyboardInterrupt

        water_model = CfdHydrodynamics(StandIn(), spin_up=SHORT, progress=watched)
        given = {"duration": 0.01, "checkpoint": file, "resume": True, **STEPS}
        if math.isfinite(stop):
            with pytest.raises(KeyboardInterrupt):
                simulate(vehicle, sand, WATER, QUICK, water_model, **given)
        else:
            assert_same(single, simulate(vehicle, sand, WATER, QUICK, water_model, **given))
        begun.append(times[0])
    assert begun[0] < -0.19
    assert -0.11 < begun[1] < -0.05
    assert -0.05 < begun[2] < 0.0


def test_fault_leaves_a_checkpoint_to_go_on_from(vehicle, sand, tmp_path):
    file, flow = tmp_path / "run.npz", StandIn()
    flow.fails_at = 0.105
    with pytest.raises(SimulationError, match="licence server") as caught:
        run(vehicle, sand, flow, checkpoint=file)
    assert float(caught.value.result["time"][-1]) == pytest.approx(0.1, abs=0.01)
    times = []
    resumed = run(vehicle, sand, checkpoint=file, resume=True, progress=times.append)
    assert times[0] > 0.09
    assert_same(run(vehicle, sand), resumed)


def test_killed_run_loses_at_most_half_a_second(vehicle, sand, tmp_path):
    """Kill -9 some time after 0.5 s."""
    file, marker = tmp_path / "run.npz", tmp_path / "far"
    program = f"""
from pathlib import Path
from exumob import *
from exumob.driving.maneuver import LaneChange
from vehicle_models.amphibious import amphibious_vehicle
simulate(amphibious_vehicle(), Soil.published("LETE sand"), Water.at_ratio(0.6, 1.0), {QUICK!r}, duration=1.5,
         micro_step=5e-4, macro_step=5e-3, checkpoint={str(file)!r},
         progress=lambda t: Path({str(marker)!r}).touch() if t > 0.8 else None)
"""
    process = subprocess.Popen([sys.executable, "-c", program], cwd=ROOT)
    deadline = time.monotonic() + 120.0
    while not marker.exists() and process.poll() is None and time.monotonic() < deadline:
        time.sleep(0.01)
    process.kill()
    process.wait()
    assert file.exists()
    steps = {"duration": 1.5, "micro_step": 5e-4, "macro_step": 5e-3}
    times = []
    resumed = simulate(vehicle, sand, WATER, QUICK, **steps, checkpoint=file, resume=True, progress=times.append)
    assert times[0] >= 0.5
    assert_same(simulate(vehicle, sand, WATER, QUICK, **steps), resumed)


@pytest.mark.usefixtures("interruptible")
def test_interrupt_waits_for_the_end_of_the_macro_step(vehicle, sand):
    """A signal in the midst of the water's turn: the step is finished, then the run stops."""

    driven = []

    class Interrupted(CoefficientHydrodynamics):
        def wrenches(self, history, predict):
            if len(driven) == 5:
                os.kill(os.getpid(), signal.SIGINT)
            return super().wrenches(history, predict)

    with pytest.raises(SimulationInterrupted) as caught:
        simulate(
            vehicle, sand, WATER, QUICK, Interrupted(), duration=0.3, micro_step=5e-4, macro_step=20e-3,
            progress=driven.append,
        )  # fmt: skip
    assert caught.value.time == pytest.approx(0.12, abs=1e-6)


def test_checkpoint_of_another_run_is_refused(vehicle, sand, tmp_path, monkeypatch):
    file = tmp_path / "run.npz"
    given = {"duration": 0.02, "micro_step": 5e-4, "macro_step": 1e-2, "checkpoint": file}
    simulate(vehicle, sand, WATER, QUICK, **given)
    with pytest.raises(ValueError, match=r"run\.npz exists already; resume"):
        simulate(vehicle, sand, WATER, QUICK, **given)
    heavier = replace(vehicle, hull=replace(vehicle.hull, mass=50.0))
    for other, part in (
        ((heavier, sand, WATER, QUICK), "vehicle"),
        ((vehicle, Soil.published("Lean clay 22 %"), WATER, QUICK), "soil"),
        ((vehicle, sand, Water(0.1), QUICK), "water"),
        ((vehicle, sand, WATER, replace(QUICK, speed=9.0)), "maneuver"),
    ):
        with pytest.raises(ValueError, match=rf"belongs to another run: {part} differs\. Resume with"):
            simulate(*other, **given, resume=True)
    with pytest.raises(ValueError, match=r"another run: coupling, steps differ\."):
        changed = given | {"micro_step": 2.5e-4}
        simulate(vehicle, sand, WATER, QUICK, **changed, resume=True, coupling=Explicit(within_step="held"))
    monkeypatch.setattr(exumob.simulation.checkpoint, "program_digest", lambda: "another")
    with pytest.raises(ValueError, match=r"another run: program differs"):
        simulate(vehicle, sand, WATER, QUICK, **given, resume=True)


def tow(time, position, velocity):
    return 30.0 * (np.array([3.0, 1.0, 0.4]) - position) - 5.0 * velocity


def push(time, position, velocity):
    return 0.0, 0.0, -20.0


@pytest.mark.parametrize("user_loads", [False, True])
def test_a_run_with_forces_goes_on_with_the_same_bits(vehicle, sand, tmp_path, user_loads):
    """Stopped at 0.06 s; with another function, or the other path of the loads, it is another run."""
    file = tmp_path / "run.npz"

    def go(force=tow, **options):
        given = {"forces": [PointForce(force, (0.5, 0.1, 0.2))], "user_loads": user_loads} | options
        return simulate(
            vehicle, sand, WATER, QUICK, "coefficients", duration=0.1, micro_step=5e-4, macro_step=1e-2, **given
        )  # fmt: skip

    single = go()
    with pytest.raises(SimulationInterrupted):
        go(checkpoint=file, progress=stopping(0.06))
    with pytest.raises(ValueError, match=r"another run: forces \(.*was tow, is push.*Resume with what"):
        go(push, checkpoint=file, resume=True)
    with pytest.raises(ValueError, match=r"another run: user_loads differs"):
        go(checkpoint=file, resume=True, user_loads=not user_loads)
    assert_same(single, go(checkpoint=file, resume=True))


def test_unusable_checkpoints_are_named(vehicle, sand, tmp_path):
    given = {"duration": 0.02, "micro_step": 5e-4, "macro_step": 1e-2}
    with pytest.raises(ValueError, match=r"the folder .* does not exist; create it first"):
        simulate(vehicle, sand, WATER, QUICK, **given, checkpoint=tmp_path / "no" / "run.npz")
    with pytest.raises(ValueError, match=r"simulate\.resume: .*checkpoint; give its file"):
        simulate(vehicle, sand, WATER, QUICK, **given, resume=True)
    torn = tmp_path / "torn.npz"
    torn.write_bytes(b"PK\x03\x04 half a file")
    with pytest.raises(ValueError, match=r"torn\.npz cannot be read"):
        simulate(vehicle, sand, WATER, QUICK, **given, checkpoint=torn, resume=True)
    other = tmp_path / "other.npz"
    np.savez(other, a=np.zeros(3))
    with pytest.raises(ValueError, match=r"other\.npz is not one of exumob"):
        simulate(vehicle, sand, WATER, QUICK, **given, checkpoint=other, resume=True)
