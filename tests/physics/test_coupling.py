"""Vehicle and flow together: schemes against each other, extrapolation of the vehicle, bad input."""

from dataclasses import replace

import numpy as np
import pytest
from coupled_runs import QUICK, SHORT, STEPS, WATER, StandIn, assert_same, run

import exumob.coupling.semi_implicit
import exumob.simulation.checkpoint
from exumob.coupling.explicit import Explicit
from exumob.coupling.flow_in_loop import CfdHydrodynamics, FlowSpinUp
from exumob.coupling.macro_step import FollowFlow
from exumob.coupling.semi_implicit import SemiImplicit
from exumob.coupling.strong import Strong
from exumob.driving.maneuver import lane_change
from exumob.ground.terrain import Terrain
from exumob.multibody.system import MultibodyVehicle
from exumob.simulation.run import simulate
from exumob.support.errors import SimulationError, SimulationInterrupted
from exumob.water.conditions import Water

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
        broken = run(vehicle, sand, coupling=Explicit(within_step="held"))
    except SimulationError as error:
        broken = error.result
    assert np.abs(broken["acceleration"].values[:, 0, 2]).max() > 98.1


def test_semi_implicit_scheme_notices_that_the_water_answers_more_strongly(vehicle, sand, monkeypatch):
    """Added mass that is hardly there when the response is measured and is all there 20 ms later, long before the next
    measurement: a stale response lets the hull's load swing up (spec: 10 g and more, or it breaks), one that is renewed
    keeps it within 2 g."""

    class KeelGetsWet(StandIn):
        def advance(self, time, poses):
            self.water.added = np.array([0.1, 0.5, 1.5]) * (1.0 if time > 0.02 else 0.02)
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


class Hastening(StandIn):
    """A flow that gets faster until 0.1 s and then calms down: Courant numbers of 100 to 400 and to 100 a second."""

    def advance(self, time, poses):
        self.rate = 100.0 + 300.0 * max(1.0 - abs(time - 0.1) / 0.1, 0.0)
        self.interval, self.time = time - getattr(self, "time", time - 1e-3), time
        return super().advance(time, poses)

    def report(self):
        return {"courant": self.rate * self.interval, "steps": 1.0}

    def save(self):
        return {"water": super().save(), "until": self.time}

    def restore(self, saved):
        self.time = saved["until"]
        super().restore(saved["water"])


FOLLOWING = FollowFlow(unit=5e-4, longest=4e-3, courant=0.4, patience=5)


def test_macro_step_follows_the_flow(vehicle, sand):
    """It keeps to the Courant number, gets longer and shorter, and ends where steps of 1 ms end (spec: 0.2 %)."""
    result = run(vehicle, sand, Hastening(), duration=0.25, macro_step=FOLLOWING)
    begins = result["macro_time"].values
    steps = np.diff(np.append(begins, 0.25))
    courant = result["hydrodynamics_courant"].values
    assert np.allclose(steps / 5e-4, np.round(steps / 5e-4), atol=1e-6)
    assert steps.sum() == pytest.approx(0.25 - begins[0])
    assert courant.max() < 1.1 * 0.4  # what the flow gains within a step
    assert steps.min() <= 1.0001e-3 and steps.max() >= 1.9999e-3
    assert len(steps) < 0.25 / 1.2e-3
    fixed = run(vehicle, sand, Hastening(), duration=0.25)
    way = fixed["position"].values[-1, 0, 0]
    assert np.abs(result["position"].values[-1, 0] - fixed["position"].values[-1, 0]).max() < 2e-3 * way
    assert "FollowFlow" in result.attrs["parameters"]


def test_run_with_steps_that_follow_the_flow_resumes_with_the_same_bits(vehicle, sand, tmp_path):
    file = tmp_path / "run.npz"

    def go(**options):
        return run(vehicle, sand, Hastening(), duration=0.12, macro_step=FOLLOWING, **options)

    def stop(now):
        if now > 0.06:
            raise KeyboardInterrupt

    single = go()
    with pytest.raises(SimulationInterrupted):
        go(checkpoint=file, progress=stop)
    assert_same(single, go(checkpoint=file, resume=True))


def test_macro_steps_that_cannot_follow_are_refused(vehicle, sand):
    with pytest.raises(ValueError, match=r"FollowFlow.*needs a flow solver in the loop.*CoefficientHydrodynamics"):
        simulate(vehicle, sand, WATER, QUICK, "coefficients", macro_step=FollowFlow(unit=1e-3))
    with pytest.raises(ValueError, match=r"macro_step\.unit = 0\.00025 s must be a whole multiple of micro_step"):
        run(vehicle, sand, macro_step=FollowFlow())

    class NoRecord:
        """A scheme of one's own: it has the functions of `Coupling`."""

        start = step = save = restore = record = None

    with pytest.raises(ValueError, match=r"follows the record of a `Scheme`.*NoRecord is none"):
        run(vehicle, sand, macro_step=FOLLOWING, coupling=NoRecord())


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
    water_model = CfdHydrodynamics(StandIn(), spin_up=SHORT)
    result = simulate(vehicle, sand, Water.at_ratio(0.6), still, water_model, duration=0.1, **STEPS)
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


# -- input ------------------------------------------------------------------------------------------------------------


def test_cells_too_coarse_for_the_gaps_are_refused(vehicle, sand):
    with pytest.raises(ValueError, match=r"gap between hull and .* steered .* use a cell size of 0\.01\d* m or less"):
        simulate(vehicle, sand, WATER, lane_change(), CfdHydrodynamics(cell_size=0.05), duration=4.0, **STEPS)


def test_bad_input_is_named(vehicle, sand):
    with pytest.raises(ValueError, match="there is no water; give simulate a Water"):
        simulate(vehicle, sand, None, QUICK, CfdHydrodynamics(StandIn()), duration=0.01, **STEPS)
    with pytest.raises(ValueError, match="cell_size and allow_coarse are those of the own solver"):
        CfdHydrodynamics(StandIn(), cell_size=0.02)
    with pytest.raises(ValueError, match=r"FlowSpinUp\.interval = 0\.3 s must be at most a quarter of hold"):
        FlowSpinUp(interval=0.3, hold=0.5)
    with pytest.raises(ValueError, match=r"Strong\.tolerance = 2\.0 must be >= 1e-08 and <= 0\.5"):
        Strong(tolerance=2.0)
    with pytest.raises(ValueError, match=r"Strong\.method = 'newton' is not known"):
        Strong(method="newton")
    with pytest.raises(ValueError, match=r"within_step = 'cubic' is not known"):
        Explicit(within_step="cubic")
    with pytest.raises(ValueError, match=r"SemiImplicit\.renewal = 0\.0 s must be >= 0\.0001"):
        SemiImplicit(renewal=0)
