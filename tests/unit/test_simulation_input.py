"""simulate(): bad input before anything runs, what a water model is given, and runs that break or are stopped."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

import exumob.simulation.run
from exumob.coupling.explicit import Explicit
from exumob.coupling.flow_in_loop import CfdHydrodynamics
from exumob.driving.maneuver import ConstantSteer, LaneChange, Recorded, lane_change, ramp
from exumob.ground.soil import Soil
from exumob.ground.terrain import Terrain
from exumob.simulation.run import simulate
from exumob.simulation.settings import SETTINGS
from exumob.support.errors import SimulationError, SimulationInterrupted
from exumob.support.measured import measured_errors
from exumob.support.quantities import unusual
from exumob.water.coefficients import CoefficientHydrodynamics
from exumob.water.conditions import Water
from exumob.water.hydrodynamics import NoWater
from exumob.water.water_field import WaterField

STEPS = {"duration": 0.2, "micro_step": 5e-4, "macro_step": 20e-3}


class Given:
    """A maneuver from two functions."""

    def __init__(self, steering=lambda t: (0.0, 0.0, 0.0), wheel_speed=lambda t: ramp(t, 1.0, 10.0)):
        self.steering, self.wheel_speed = steering, wheel_speed


@pytest.fixture
def nothing_runs(monkeypatch):
    def build(*_, **__):
        raise AssertionError("a model was built before the input was checked")

    monkeypatch.setattr(exumob.simulation.run, "MultibodyVehicle", build)


# -- bad input ---------------------------------------------------------------------------------------------------------


@pytest.mark.usefixtures("nothing_runs")
@pytest.mark.parametrize(
    ("field", "value"),
    [
        (field, value)
        for field in ("duration", "micro_step", "macro_step", "record_step")
        for value in (0.0, -1.0, math.nan, math.inf, "1", None)
        if not (value is None and field in ("micro_step", "macro_step"))  # None: by the setting
    ],
)
def test_bad_step_or_duration_is_named(vehicle, sand, field, value):
    wanted = r"(must be >|not a finite number).*give|must be a number or a FollowFlow"
    with pytest.raises(ValueError, match=rf"{field} = .*{value}.*({wanted})"):
        simulate(vehicle, sand, **(STEPS | {field: value}))


@pytest.mark.usefixtures("nothing_runs")
@pytest.mark.parametrize(
    ("steps", "message"),
    [
        (
            {"micro_step": 3e-4, "macro_step": 3e-3},
            r"simulate\.micro_step = 0\.0003 s must divide 1 ms.*; choose",
        ),
        ({"micro_step": 2e-3}, r"simulate\.micro_step = 0\.002 s must divide 1 ms.*; choose"),
        (
            {"micro_step": 5e-4, "macro_step": 1.2e-3},
            r"simulate\.macro_step = 0\.0012 s .* micro_step = 0\.0005 s",
        ),
        (
            {"micro_step": 5e-4, "macro_step": 2e-4},
            r"simulate\.macro_step = 0\.0002 s .* micro_step = 0\.0005 s",
        ),
        (
            {"micro_step": 5e-4, "record_step": 1.3e-3},
            r"simulate\.record_step = 0\.0013 s .* micro_step = 0\.0005 s",
        ),
        ({"duration": 0.25, "macro_step": 20e-3}, r"simulate\.duration = 0\.25 s .*macro_step = 0\.02 s; choose"),
        ({"duration": 0.01, "macro_step": 20e-3}, r"simulate\.duration = 0\.01 s .*macro_step = 0\.02 s; choose"),
    ],
)
def test_steps_must_be_whole_multiples(vehicle, sand, steps, message):
    with pytest.raises(ValueError, match=message):
        simulate(vehicle, sand, **(STEPS | steps))


@pytest.mark.usefixtures("nothing_runs")
@pytest.mark.parametrize("amplitude", [math.radians(36.0), -math.radians(36.0)])
def test_steering_beyond_the_limit(vehicle, sand, amplitude):
    with pytest.raises(ValueError, match=r"36\.0 deg, beyond Steering\.limit = 35\.0 deg.*steer less or raise"):
        simulate(vehicle, sand, None, lane_change(amplitude), **(STEPS | {"duration": 4.0}))


@pytest.mark.usefixtures("nothing_runs")
def test_a_peak_between_coarse_samples_is_seen(vehicle, sand):
    """A steering pulse of 6 ms to 57 degrees must not slip through."""
    pulse = Given(steering=lambda t: (1.0 if 0.097 < t < 0.103 else 0.0, 0.0, 0.0))
    with pytest.raises(ValueError, match=r"Steering\.limit"):
        simulate(vehicle, sand, None, pulse, **STEPS)


@pytest.mark.usefixtures("nothing_runs")
@pytest.mark.parametrize(
    ("maneuver", "message"),
    [
        (Given(wheel_speed=lambda t: (10.0 * t, 10.0, 0.0)), r"speed up by 10 rad/s\^2; .*steadily.*Ramp"),
        (
            Given(steering=lambda t: (0.1, 0.0, 0.0)),
            r"starts with steering 0\.1 rad.*must start straight ahead",
        ),
        (Given(steering=lambda t: (0.1 * t, 0.1, 0.0)), r"its rate 0\.1 rad/s.*must start straight ahead"),
        (Recorded([0, 1, 2, 3], [0.1, 0, 0, 0], [0, 1, 2, 3]), r"starts with steering 0\.1 rad"),
        (Given(steering=lambda t: (math.nan if t > 0.1 else 0.0, 0.0, 0.0)), r"maneuver: .*not finite.*mend"),
        (Given(wheel_speed=lambda t: (0.0, 0.0, math.inf if t > 0.1 else 0.0)), r"maneuver: .*not finite"),
    ],
)
def test_maneuver_must_start_steadily_and_be_finite(vehicle, sand, maneuver, message):
    with pytest.raises(ValueError, match=message):
        simulate(vehicle, sand, None, maneuver, **STEPS)


def test_steering_after_the_end_does_not_matter(vehicle, sand):
    late = LaneChange(amplitude=math.radians(60.0), start=1.0, end=2.0)
    assert simulate(vehicle, sand, None, late, **STEPS).attrs["status"] == "completed"


# -- what a water model is given ---------------------------------------------------------------------------------------


class Scripted(NoWater):
    """Keeps the calls of a run, and gives a load that depends on time; settling (the first start) is calm."""

    def __init__(self, load=lambda t: np.zeros((5, 6)), call_predict=False):
        self.load, self.call_predict = load, call_predict
        self.starts, self.times, self.predicted = [], [], []

    def start(self, vehicle, water, macro_step):
        self.starts.append(macro_step)
        self.times, self.predicted = [], []

    def wrenches(self, history, predict):
        if len(self.starts) < 2:
            return np.zeros((5, 6))
        self.times.append(np.array(history.time))
        if self.call_predict:
            self.predicted.append(float(predict().time[0]))
        return self.load(history.time[-1])


def push(force, component=2, begin=0.1):
    def load(time):
        wrench = np.zeros((5, 6))
        wrench[0, component] = force if time >= begin - 1e-9 else 0.0
        return wrench

    return load


@pytest.mark.parametrize("macro_step", [1e-3, 5e-3, 20e-3, 5e-4, 2.5e-3])
def test_history_reaches_up_to_now(vehicle, sand, macro_step):
    """Interface: states every 1 ms up to and including now, the last row."""
    model = Scripted()
    simulate(vehicle, sand, None, None, model, duration=0.02, micro_step=5e-4, macro_step=macro_step)
    assert model.starts[-1] == macro_step
    for n, times in enumerate(model.times):
        assert times[-1] == pytest.approx(n * macro_step, abs=1e-9)
        assert times[0] == 0.0


def test_prediction_is_for_the_end_of_the_macro_step(vehicle, sand):
    model = Scripted(call_predict=True)
    simulate(vehicle, sand, None, None, model, **STEPS)
    assert model.predicted == pytest.approx(20e-3 * np.arange(1, 11), abs=1e-9)


def test_asking_for_the_prediction_changes_nothing(vehicle, sand):
    one, two = (simulate(vehicle, sand, None, None, Scripted(call_predict=asked), **STEPS) for asked in (False, True))
    assert one["position"].values.tobytes() == two["position"].values.tobytes()


def test_load_reaches_the_force_balance(vehicle, sand):
    """100 N to the left on the hull from 0.1 s on, held over macro steps, in the hull's axes."""
    run = simulate(vehicle, sand, None, None, Scripted(push(100.0, 1)), coupling=Explicit(within_step="held"), **STEPS)
    pushed = run["water_wrench"].sel(body="hull", component="Fy").values
    assert (pushed[:11] == 0.0).all()
    assert (pushed[11:] == 100.0).all()
    assert run["water_load"].sel(body="hull", axis="y").values[12:] == pytest.approx(100.0, abs=0.1)
    assert float(run["position"].sel(body="hull", axis="y")[-1]) > 1e-5


def test_default_water_model_follows_the_water(vehicle, sand):
    assert simulate(vehicle, sand, **STEPS).attrs["hydrodynamics"] == "NoWater"
    wet = simulate(vehicle, sand, Water.at_ratio(0.6), **STEPS)
    assert wet.attrs["hydrodynamics"] == "SurrogateHydrodynamics"  # the networks fit this vehicle
    assert 190.0 < float(wet["water_load"].sel(axis="z").sum("body").mean()) < 225.0  # of 559 N of weight


@pytest.mark.usefixtures("fresh_warnings")
def test_another_vehicle_gets_the_calibrated_model_and_a_warning(vehicle, sand, caplog):
    wider = replace(vehicle, track=0.70, name="wider")
    wet = simulate(wider, sand, Water.at_ratio(0.6), **STEPS)
    assert wet.attrs["hydrodynamics"] == "CalibratedHydrodynamics"
    assert "wider: no networks know this vehicle (track = 0.7, they were trained with 0.66)" in caplog.text
    assert "come from coefficients that were calibrated on amphibious, light 4x4, large 4x4, small car" in caplog.text
    assert "the result's line of trust says how far they were off. `exumob learn` makes networks" in caplog.text
    for inside in ("residual", "seed", "exumob train", "or use the coefficient model"):  # no user knows or needs them
        assert inside not in caplog.text
    trust = wet.attrs["trust"]
    assert "this vehicle (wider) is not the one that was compared with the flow in the loop" in trust
    assert "each with coefficients fitted without that vehicle (light 4x4, large 4x4, small car; 50 %" in trust
    others = measured_errors()["elsewhere"]
    for low, high in (others["calibrated"], others["later"]["calibrated"]):
        assert f"{100 * low:.2g} to {100 * high:.2g} %" in trust
    with pytest.raises(ValueError, match=r"wider has another shape \(track = 0\.7, they were trained with 0\.66\)"):
        simulate(wider, sand, Water.at_ratio(0.6), hydrodynamics="networks", **STEPS)


def test_settings_choose_the_steps(vehicle, sand):
    for name, setting in SETTINGS.items():
        run = simulate(vehicle, sand, duration=0.02, setting=name)
        steps = json.loads(run.attrs["parameters"])["steps"]
        assert (steps["micro_step"], steps["macro_step"]) == (setting.micro_step, setting.macro_step)
    one = simulate(vehicle, sand, duration=0.02, micro_step=2e-4)
    steps = json.loads(one.attrs["parameters"])["steps"]
    assert (steps["micro_step"], steps["macro_step"]) == (2e-4, SETTINGS["fast"].macro_step)


@pytest.mark.usefixtures("nothing_runs")
@pytest.mark.parametrize(("name", "value"), [("setting", "quick"), ("hydrodynamics", "lstm")])
def test_unknown_setting_and_water_model_are_named(vehicle, sand, name, value):
    with pytest.raises(ValueError, match=rf"{name} = '{value}' is not known; use '"):
        simulate(vehicle, sand, Water.at_ratio(0.6), **{name: value})


def test_water_model_without_water_is_dry_ground(vehicle, sand):
    dry = simulate(vehicle, sand, **STEPS)
    idle = simulate(vehicle, sand, None, None, CoefficientHydrodynamics(), **STEPS)
    assert idle["position"].values.tobytes() == dry["position"].values.tobytes()


def test_progress_is_called_every_macro_step(vehicle, sand):
    seen = []
    simulate(vehicle, sand, progress=seen.append, **STEPS)
    assert seen == pytest.approx(20e-3 * np.arange(1, 11), abs=1e-9)


def test_result_has_the_asked_times(vehicle, sand):
    run = simulate(vehicle, sand, record_step=5e-3, **STEPS)
    assert run["time"].values == pytest.approx(5e-3 * np.arange(41), abs=1e-9)


def test_record_step_does_not_change_the_motion(vehicle, sand):
    fine, coarse = (simulate(vehicle, sand, record_step=step, **STEPS) for step in (5e-3, 20e-3))
    assert fine["position"].values[::4].tobytes() == coarse["position"].values.tobytes()


# -- runs that break ---------------------------------------------------------------------------------------------------


def check_partial(error, vehicle, until):
    """The vehicle is named, and what was computed until the time given is kept, with a status."""
    result = error.result
    assert result is not None
    assert "completed" not in result.attrs["status"]
    assert float(result["time"][-1]) == pytest.approx(until, abs=0.021)
    assert np.isfinite(result["position"].values).all()
    assert result["position"].dims == ("time", "body", "axis")


def test_a_wheel_that_sinks_ends_the_run(vehicle, sand):
    """The hull is pressed down ever harder, until its belly sinks, too."""
    model = Scripted(lambda t: push(-3e5 * max(t - 0.1, 0.0))(t))
    with pytest.raises(SimulationError, match=r"amphibious: a wheel has sunk.*\d s .*firmer soil") as raised:
        simulate(vehicle, sand, None, None, model, duration=2.0, micro_step=5e-4, macro_step=20e-3)
    result = raised.value.result
    assert 0.15 < float(result["time"][-1]) < 2.0
    assert "sunk" in result.attrs["status"]
    check_partial(raised.value, vehicle, float(result["time"][-1]))


def test_soil_that_does_not_carry_the_vehicle(vehicle, sand):
    """It sinks while the equilibrium is sought: said as such, with vehicle and remedy."""
    mud = replace(sand, k_c=10.0, k_phi=unusual(1000.0))
    with pytest.raises(SimulationError, match=r"amphibious: .*sunk.*firmer soil"):
        simulate(vehicle, mud, **STEPS)


TOO_SOFT = {"Snow (US)", "Snow (Harrison)", "Snow (Sweden)"}
"""On which the wheels sink to their centres under the vehicle's weight, and the hull does not hold them."""
ON_ITS_BELLY = "Sandy loam 32 %"
"""On which the hull bears a part of the weight."""


@pytest.mark.parametrize("name", [row.name for row in Soil.published_table()])
def test_every_published_soil_carries_the_vehicle_or_is_too_soft(vehicle, name):
    """All 23 are selectable (design): a run of 60 ms completes, or ends in a SimulationError with a remedy."""
    soil, steps = Soil.published(name), {"duration": 0.06, "micro_step": 1e-3, "macro_step": 20e-3}
    if name in TOO_SOFT:
        with pytest.raises(SimulationError, match=r"sunk to its centre.*firmer soil"):
            simulate(vehicle, soil, **steps)
        return
    run = simulate(vehicle, soil, **steps)
    assert run.attrs["status"] == "completed"
    on_belly = name == ON_ITS_BELLY
    assert float(run["sinkage"].max()) < (0.1 if on_belly else 0.08)
    assert (float(run["hull_load_share"].max()) > 0.1) == on_belly


def test_load_that_is_not_finite(vehicle, sand):
    with pytest.raises(SimulationError, match=r"Scripted.*not finite at 0\.1000 s.*halve") as raised:
        simulate(vehicle, sand, None, None, Scripted(push(math.nan)), **STEPS)
    check_partial(raised.value, vehicle, 0.1)
    assert "not finite" in raised.value.result.attrs["status"]


class NanAtOnce(NoWater):
    def wrenches(self, history, predict):
        return np.full((5, 6), math.nan)


def test_load_that_is_not_finite_from_the_beginning(vehicle, sand):
    """The cause is the water model, not the step: it must be named."""
    with pytest.raises(SimulationError, match=r"NanAtOnce.*not finite"):
        simulate(vehicle, sand, None, None, NanAtOnce(), **STEPS)


@pytest.mark.parametrize("force", [1e200, 1e12, -1e8])
def test_absurd_loads_break_the_run_and_keep_it(vehicle, sand, force):
    with pytest.raises(SimulationError, match=r"amphibious.* at 0\.1\d* s") as raised:
        simulate(vehicle, sand, None, None, Scripted(push(force, 0)), **STEPS)
    check_partial(raised.value, vehicle, 0.1)


def test_error_in_a_water_model_keeps_what_was_computed(vehicle, sand):
    """Anyone's own flow code may fail: a SimulationError with the result, the original as its cause."""

    def fail(time):
        if time > 0.1:
            raise RuntimeError("pressure solver diverged")
        return np.zeros((5, 6))

    with pytest.raises(SimulationError, match="pressure solver diverged") as raised:
        simulate(vehicle, sand, None, None, Scripted(fail), **STEPS)
    check_partial(raised.value, vehicle, 0.1)


@pytest.mark.parametrize("shape", [(4, 6), (5, 3), (30,), (6,), (1, 6)])
def test_load_of_a_wrong_shape_is_named(vehicle, sand, shape):
    with pytest.raises((SimulationError, ValueError), match=r"Scripted.*shape|shape.*Scripted"):
        simulate(vehicle, sand, None, None, Scripted(lambda t: np.zeros(shape)), **STEPS)


# -- Ctrl-C ------------------------------------------------------------------------------------------------------------


def interrupt_after(limit):
    calls = []

    def report(time):
        calls.append(time)
        if time > limit:
            raise KeyboardInterrupt

    return report


def test_interrupt_between_macro_steps_keeps_the_result(vehicle, sand):
    with pytest.raises(KeyboardInterrupt) as raised:
        simulate(vehicle, sand, progress=interrupt_after(0.09), **STEPS)
    assert isinstance(raised.value, SimulationInterrupted)
    assert raised.value.time == pytest.approx(0.10, abs=1e-9)
    check_partial(raised.value, vehicle, 0.10)
    assert "interrupted at 0.1000 s" in raised.value.result.attrs["status"]


class Interrupting(Given):
    """Ctrl-C while Exudyn solves: it arrives in whatever Python runs then, here the maneuver."""

    def __init__(self, calls):
        super().__init__(self.steer)
        self.left = calls

    def steer(self, time):
        self.left -= 1
        if self.left == 0:
            raise KeyboardInterrupt
        return 0.0, 0.0, 0.0


def calls_until(vehicle, sand, time):
    """How often the maneuver is asked before a time of the run is reached: found, not assumed."""
    counted = []
    done = []

    def steer(t):
        if not done:
            counted.append(t)
        return 0.0, 0.0, 0.0

    def report(t):
        if t >= time - 1e-9:
            done.append(t)

    simulate(vehicle, sand, None, Given(steer), progress=report, **STEPS)
    return len(counted)


def test_interrupt_within_a_macro_step_keeps_the_result(vehicle, sand):
    calls = calls_until(vehicle, sand, 0.1)
    with pytest.raises(SimulationInterrupted) as raised:
        simulate(vehicle, sand, None, Interrupting(calls + 5), **STEPS)
    check_partial(raised.value, vehicle, 0.1)


def test_interrupt_while_settling_is_a_keyboard_interrupt(vehicle, sand):
    """Nothing is computed yet, so nothing is kept; but it must not look like an error of the model."""
    with pytest.raises(KeyboardInterrupt):
        simulate(vehicle, sand, None, Interrupting(60), **STEPS)


def test_a_run_after_a_broken_one_is_as_good_as_new(vehicle, sand):
    before = simulate(vehicle, sand, **STEPS)
    with pytest.raises(SimulationError):
        simulate(vehicle, sand, None, None, Scripted(push(1e200)), **STEPS)
    after = simulate(vehicle, sand, **STEPS)
    assert before["position"].values.tobytes() == after["position"].values.tobytes()


def test_standing_still_is_a_run(vehicle, sand):
    run = simulate(vehicle, sand, None, ConstantSteer(speed=0.0), **STEPS)
    assert float(np.abs(run["velocity"]).max()) < 1e-5


# -- water over terrain, and the start ---------------------------------------------------------------------------------


FIELD = Terrain(heights=np.zeros((3, 3)), origin=(-4.0, -4.0), spacing=4.0)
OWN = Scripted()


class NoFlow:
    """The smallest flow code."""

    def start(self, vehicle, water, poses, time): ...

    def advance(self, time, poses):
        return np.zeros((len(poses.position), 6))

    def save(self):
        return {}

    def restore(self, saved): ...

    def report(self):
        return {}


WATER_FIELD = Water(field=WaterField(np.zeros((3, 3)), origin=(-4.0, -4.0), spacing=4.0))


@pytest.mark.usefixtures("nothing_runs")
@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"water": Water(0.1), "terrain": FIELD}, r"simulate.water: Water.depth = 0.1 m: .*Water\(level="),
        ({"water": Water(0.1), "terrain": Terrain.slope(0.1)}, r"Water\(level=...\), which lies above 0 m"),
        ({"water": Water(level=0.1), "hydrodynamics": OWN}, "Scripted knows water of one depth.*set_bed"),
        ({"water": Water(0.1), "terrain": Terrain(2.0), "hydrodynamics": OWN}, "level ground at z = 0 only.*set_bed"),
        ({"water": Water(level=0.1), "terrain": FIELD, "hydrodynamics": CfdHydrodynamics(NoFlow())},
         r"the flow in the loop \(NoFlow\) knows water of one depth.*set_bed"),
        ({"water": Water(0.1), "terrain": Terrain(2.0), "hydrodynamics": CfdHydrodynamics(NoFlow())},
         r"simulate.terrain: the flow in the loop \(NoFlow\) knows water over level ground.*set_bed"),
        ({"water": Water(0.1), "start": (5.0, 0.0, 0.0), "hydrodynamics": CfdHydrodynamics(NoFlow())},
         "simulate.start: .*NoFlow.*world's origin"),
        ({"water": WATER_FIELD, "start": (3.8, 0.0, 0.0)}, "field of water reaches from x = -4 to 4 m.*WaterField"),
        ({"water": WATER_FIELD, "start": (900.0, 0.0, 0.0)}, "WaterField.origin is the place"),
        ({"terrain": FIELD, "start": (0.0, 3.9, 1.6)}, "field of heights reaches.*the vehicle at its start"),
        ({"start": (0.0, 0.0, 90.0)}, "StartPose.heading = 90.0 rad.*degrees"),
        ({"start": (0.0, 0.0)}, "simulate.start"),
        ({"start": 3.0}, "simulate.start"),
    ],
)  # fmt: skip
def test_water_terrain_and_start_that_do_not_go_together(vehicle, sand, given, message):
    with pytest.raises(ValueError, match=message):
        simulate(vehicle, sand, maneuver=ConstantSteer(), **({"hydrodynamics": "coefficients"} | given))


def test_a_model_of_ones_own_is_told_of_the_bed(vehicle, sand):
    """`set_bed` comes before `start`; without it level ground at z = 0 is fine."""

    class Told(Scripted):
        def set_bed(self, terrain):
            self.terrain = terrain

    model = Told()
    simulate(vehicle, sand, Water(level=-1.0), ConstantSteer(), model, terrain=Terrain.slope(0.05), duration=0.02)
    assert model.terrain.slope_x == pytest.approx(math.tan(0.05))
    run = simulate(vehicle, sand, Water(0.1), ConstantSteer(), Scripted(), start=(3.0, 4.0, 1.0), duration=0.02)
    assert run["position"].values[0, 0, :2] == pytest.approx((3.0, 4.0), abs=0.05)
    assert float(run["yaw"][0, 0]) == pytest.approx(1.0, abs=1e-6)
