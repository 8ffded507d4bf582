"""Vehicle and flow together: schemes against each other, repeated steps, checkpoints, a flow code elsewhere."""

import json
import math
import os
import re
import signal
import subprocess
import sys
import time
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import exumob.coupling.semi_implicit
import exumob.simulation.checkpoint
from exumob.coupling.explicit import Explicit
from exumob.coupling.flow_code import BuiltInFlow
from exumob.coupling.flow_in_loop import CfdHydrodynamics
from exumob.coupling.remote import RemoteFlow
from exumob.coupling.semi_implicit import SemiImplicit
from exumob.coupling.spin_up import FlowSpinUp
from exumob.coupling.strong import Strong
from exumob.driving.maneuver import LaneChange
from exumob.ground.soil import Soil
from exumob.ground.terrain import Terrain
from exumob.multibody.system import MultibodyVehicle
from exumob.simulation.run import simulate
from exumob.support.errors import SimulationError, SimulationInterrupted
from exumob.support.provenance import parameters_json
from exumob.water.coefficients import CoefficientHydrodynamics
from exumob.water.conditions import Water

ROOT = Path(__file__).parents[2]
EXAMPLE = ROOT / "examples" / "external_flow"
sys.path.insert(0, str(EXAMPLE))
import stand_in

QUICK = LaneChange(amplitude=math.radians(20.0), start=0.05, end=0.6, ramp_time=0.1)
WATER = Water.at_ratio(0.6, 1.0)
SHORT = FlowSpinUp(ramp=0.1, hold=0.05, adjustment=0.05)
STEPS = {"micro_step": 5e-4, "macro_step": 1e-3}


class StandIn:
    """The example's flow code, in this process."""

    def __init__(self):
        self.parameters = {"code": "stand-in"}
        self.fails_at = math.inf

    def start(self, vehicle, water, poses, time):
        sizes = json.loads(parameters_json({"v": vehicle}))["v"]["Vehicle"]
        given = {"depth": water.depth, "density": water.density, "velocity": water.velocity.tolist()}
        self.boxes = stand_in.BoxFlow(sizes, given)
        self.boxes.start(self._arrays(poses), time)

    def advance(self, time, poses):
        if time > self.fails_at:
            raise SimulationError("the licence server has gone")
        return self.boxes.advance(time, self._arrays(poses))

    def save(self):
        return self.boxes.save()

    def restore(self, saved):
        self.boxes.restore(saved)

    def report(self):
        return {"iterations": 1.0}

    @staticmethod
    def _arrays(poses):
        return {f.name: getattr(poses, f.name) for f in fields(poses)}


def run(vehicle, sand, flow=None, duration=0.12, **options):
    hydrodynamics = CfdHydrodynamics(flow or StandIn(), spin_up=SHORT)
    return simulate(vehicle, sand, WATER, QUICK, hydrodynamics, duration=duration, **(STEPS | options))


def assert_same(one, two):
    """Every variable bit for bit."""
    assert set(one.variables) == set(two.variables)
    for name in one.variables:
        xr.testing.assert_identical(one[name].variable, two[name].variable)


# -- schemes ----------------------------------------------------------------------------------------------------------


def test_explicit_scheme_grows_on_the_vehicle_and_the_others_agree(vehicle, sand):
    """Spec: within 0.1 % of the wheels' way of each other; the explicit one breaks or exceeds 10 g (r = 0.55)."""
    ends = []
    for scheme in (SemiImplicit(), Strong(tolerance=1e-5), Strong(method="aitken", tolerance=1e-5)):
        ends.append(run(vehicle, sand, coupling=scheme, duration=0.2)["position"].values[-1, 0])
    way = ends[1][0]
    assert way > 5e-3
    for end in ends:
        assert end == pytest.approx(ends[1], abs=1e-3 * way)
    try:
        broken = run(vehicle, sand, coupling=Explicit())
    except SimulationError as error:
        broken = error.result
    assert np.abs(broken["acceleration"].values[:, 0, 2]).max() > 98.1


def test_semi_implicit_scheme_notices_that_the_water_answers_more_strongly(vehicle, sand, monkeypatch):
    """Added mass that is hardly there when the response is measured and is all there 20 ms later, long before the next
    measurement: a stale response lets the hull's load swing up (spec: 10 g and more, or it breaks), one that is renewed
    keeps it within 2 g."""

    class KeelGetsWet(StandIn):
        def advance(self, time, poses):
            self.boxes.added = np.array([0.1, 0.5, 1.5]) * (1.0 if time > 0.02 else 0.02)
            return super().advance(time, poses)

    result = run(vehicle, sand, KeelGetsWet(), coupling=SemiImplicit())
    assert np.abs(result["acceleration"].values[:, 0, 2]).max() < 2.0 * 9.81
    measured = np.flatnonzero(result["coupling_iterations"].values > 1)
    assert measured[0] == 0 and 20 <= measured[1] <= 35 and len(measured) <= 4
    monkeypatch.setattr(exumob.coupling.semi_implicit, "SIGN_REVERSALS", 10**6)
    try:
        stale = run(vehicle, sand, KeelGetsWet(), coupling=SemiImplicit())
    except SimulationError as error:
        stale = error.result
    assert np.abs(stale["acceleration"].values[:, 0, 2]).max() > 98.1


def test_semi_implicit_scheme_is_not_disturbed_by_rough_loads(vehicle, sand):
    """Loads rough by 3 % from step to step, as those of the flow solver: the response is measured at the start only."""

    class Rough(StandIn):
        def advance(self, time, poses):
            loads = super().advance(time, poses)
            return loads * (1.0 + 0.03 * np.random.default_rng(round(1e6 * (time + 10.0))).standard_normal(loads.shape))

    result = run(vehicle, sand, Rough(), coupling=SemiImplicit(), duration=0.2)
    assert list(np.flatnonzero(result["coupling_iterations"].values > 1)) == [0]
    assert float(result["coupling_residual"].median()) > 0.005  # rough they are


def test_strong_scheme_records_iterations_and_residuals(vehicle, sand):
    result = run(vehicle, sand, coupling=Strong(tolerance=1e-4), duration=0.05)
    assert result["coupling_iterations"].sizes == {"macro_time": 50}
    assert float(result["coupling_residual"].max()) <= 1e-4
    assert 1.0 <= float(result["coupling_iterations"].mean()) < 5.0
    assert result["hydrodynamics_iterations"].sizes == {"macro_time": 50}  # trials that were taken back are not kept
    assert np.isfinite(result["hydrodynamics_development_load"]).all()


def test_strong_scheme_that_does_not_converge_says_so(vehicle, sand):
    with pytest.raises(SimulationError, match=r"did not agree within 2 iterations at 0\.0000 s.*halve macro_step"):
        run(vehicle, sand, coupling=Strong(tolerance=1e-8, iterations=2), duration=0.01)


@pytest.mark.parametrize("scheme", [SemiImplicit, Strong])
def test_linear_loads_keep_the_mean(vehicle, sand, scheme):
    """Held and linear loads have the same impulse: the ends agree to 0.1 % of the way."""
    held, linear = (run(vehicle, sand, coupling=scheme(within_step=kind)) for kind in ("held", "linear"))
    gap = np.abs(held["position"].values[-1, 0] - linear["position"].values[-1, 0]).max()
    assert 0.0 < gap < 1e-3 * float(held["position"].values[-1, 0, 0])


def test_vehicle_and_water_at_rest_stay_at_rest(vehicle, sand):
    """The start: settled under the water's own loads, nothing moves when it is released (spec: 0.05 mm in 0.1 s)."""
    still = replace(QUICK, start=5.0, end=6.0, ramp_time=50.0)
    hydrodynamics = CfdHydrodynamics(StandIn(), spin_up=SHORT)
    result = simulate(vehicle, sand, Water.at_ratio(0.6), still, hydrodynamics, duration=0.1, **STEPS)
    assert np.abs(result["position"].values - result["position"].values[0]).max() < 5e-5


# -- extrapolation ----------------------------------------------------------------------------------------------------


def test_prediction_converges_with_the_second_order(vehicle, sand):
    """Velocities with H^2, places with H^3, less what a rate of the acceleration leaves (spec: 1.8 and 2.7)."""
    model = MultibodyVehicle(vehicle, sand, QUICK, Terrain(), 1e-4, 1.0)
    model.settle(lambda states: np.zeros((5, 6)))
    model.advance(0.45, np.zeros((5, 6)))
    saved = model.save(histories=False)
    errors = []
    for step in (8e-3, 4e-3, 2e-3):
        ahead = model.predict(step)
        model.advance(0.45 + step, np.zeros((5, 6)))
        reached = model.present()
        errors.append([np.abs(getattr(ahead, k) - getattr(reached, k)).max() for k in ("velocity", "position")])
        model.restore(saved)
    orders = np.log2(np.array(errors)[:-1] / np.array(errors)[1:]).mean(axis=0)
    assert orders[0] > 1.8
    assert orders[1] > 2.7


def test_projection_leaves_round_off(vehicle, sand):
    """Spec: 1e-11 on both levels, from 1e-9 and more before it."""
    model = MultibodyVehicle(vehicle, sand, QUICK, Terrain(), 5e-4, 1.0)
    model.settle(lambda states: np.zeros((5, 6)))
    model.advance(0.45, np.zeros((5, 6)))
    found = []
    project = model._constraints.project

    def watched():
        before = model._constraints.errors()
        project()
        found.append((before, model._constraints.errors(), np.abs(model._constraints.residual(True)).max()))

    model._constraints.project = watched
    model.predict(5e-3)
    (before, after, rate) = found[0]
    assert before[0] > 1e-9
    assert after[0] < 1e-11
    assert rate < 1e-11


# -- checkpoints ------------------------------------------------------------------------------------------------------


def stopping(at):
    def progress(now):
        if now > at - 1e-9:
            raise KeyboardInterrupt

    return progress


@pytest.mark.parametrize("scheme", [Explicit, SemiImplicit, Strong])
def test_stopped_and_resumed_run_is_the_single_run(vehicle, sand, tmp_path, scheme):
    """Ctrl-C at 0.055 s; explicit with the coefficient model, the others with a flow code that keeps a state."""

    def go(**options):
        hydrodynamics = CoefficientHydrodynamics() if scheme is Explicit else CfdHydrodynamics(
            StandIn(), spin_up=SHORT
        )  # fmt: skip
        return simulate(
            vehicle, sand, WATER, QUICK, hydrodynamics, duration=0.08, coupling=scheme(), **STEPS, **options
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
        hydrodynamics = CfdHydrodynamics(
            BuiltInFlow(0.06, allow_coarse=True), spin_up=FlowSpinUp(0.05, 0.04, 0.02, 4e-3)
        )  # fmt: skip
        return simulate(vehicle, sand, WATER, QUICK, hydrodynamics, duration=0.04, **STEPS, **options)

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

        hydrodynamics = CfdHydrodynamics(StandIn(), spin_up=SHORT, progress=watched)
        given = {"duration": 0.01, "checkpoint": file, "resume": True, **STEPS}
        if math.isfinite(stop):
            with pytest.raises(KeyboardInterrupt):
                simulate(vehicle, sand, WATER, QUICK, hydrodynamics, **given)
        else:
            assert_same(single, simulate(vehicle, sand, WATER, QUICK, hydrodynamics, **given))
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
        simulate(vehicle, sand, WATER, QUICK, **changed, resume=True, coupling=Explicit(within_step="linear"))
    monkeypatch.setattr(exumob.simulation.checkpoint, "program_digest", lambda: "another")
    with pytest.raises(ValueError, match=r"another run: program differs"):
        simulate(vehicle, sand, WATER, QUICK, **given, resume=True)


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


# -- another flow code ------------------------------------------------------------------------------------------------


@pytest.fixture
def served():
    """The stand-in in a process of its own; its port."""
    process = subprocess.Popen(
        [sys.executable, str(EXAMPLE / "stand_in.py"), "--port", "0"], stdout=subprocess.PIPE, text=True
    )
    try:
        yield int(re.search(r"\d+", process.stdout.readline()).group())
    finally:
        process.kill()
        process.wait()
        process.stdout.close()


@pytest.mark.parametrize("scheme", [SemiImplicit, Strong])
def test_flow_code_in_another_process_gives_the_same_run(vehicle, sand, served, scheme):
    flow = RemoteFlow(port=served)
    remote = run(vehicle, sand, flow, duration=0.05, coupling=scheme())
    flow.close()
    assert_same(run(vehicle, sand, duration=0.05, coupling=scheme()), remote)


def test_flow_code_that_dies_is_named(vehicle, sand, served):
    flow = RemoteFlow(port=served)

    def kill(now):
        if now > 0.02 and flow._socket is not None:
            flow._socket.shutdown(2)

    with pytest.raises(SimulationError, match="the flow code was lost during 'advance'") as caught:
        run(vehicle, sand, flow, duration=0.05, progress=kill)
    assert caught.value.result.sizes["time"] > 1
    flow._socket.close()


def test_flow_code_that_does_not_answer_is_named(vehicle, sand):
    with pytest.raises(ValueError, match=r"no flow code answers at localhost:1 .*start it first"):
        run(vehicle, sand, RemoteFlow(port=1))


# -- input ------------------------------------------------------------------------------------------------------------


def test_cells_too_coarse_for_the_gaps_are_refused(vehicle, sand):
    with pytest.raises(ValueError, match=r"gap between hull and .* steered .* use a cell size of 0\.01\d* m or less"):
        simulate(vehicle, sand, WATER, QUICK, CfdHydrodynamics(cell_size=0.05), duration=0.01, **STEPS)


def test_bad_input_is_named(vehicle, sand):
    with pytest.raises(ValueError, match="there is no water; give simulate a Water"):
        simulate(vehicle, sand, None, QUICK, CfdHydrodynamics(StandIn()), duration=0.01, **STEPS)
    with pytest.raises(ValueError, match="cell_size and allow_coarse are those of the own solver"):
        CfdHydrodynamics(StandIn(), cell_size=0.02)
    with pytest.raises(ValueError, match=r"FlowSpinUp\.interval = 0\.3 is outside"):
        FlowSpinUp(interval=0.3)
    with pytest.raises(ValueError, match=r"Strong\.tolerance = 2\.0 is outside"):
        Strong(tolerance=2.0)
    with pytest.raises(ValueError, match=r"Strong\.method = 'newton' is not known"):
        Strong(method="newton")
    with pytest.raises(ValueError, match=r"within_step = 'cubic' is not known"):
        Explicit(within_step="cubic")
    with pytest.raises(ValueError, match=r"SemiImplicit\.renewal = 0 must be > 0"):
        SemiImplicit(renewal=0)
