"""The verdict on a run: each condition by itself, its onset, its persistence, order, scaling, and runs cut short."""

import json
import math

import numpy as np
import pytest
import xarray as xr
from made_up_runs import made_up_run, sized_amphibious

from exumob.simulation.results import COMMENTS, VARIABLES
from exumob.simulation.verdict import (
    CONDITIONS,
    VERDICTS,
    VerdictLimits,
    judge,
    verdict_of,
    verdict_of_error,
    with_verdict,
)
from exumob.support.dimensions import DIMENSIONS
from exumob.support.errors import SimulationError

T = 2.0 * math.sqrt(0.714 / 9.81)
"""Persistence of the amphibious vehicle: 0.54 s."""


def after(moment, then, before):
    """A value that changes at a moment."""
    return lambda time: then if time >= moment - 1e-9 else before


def between(begin, end, then, before):
    return lambda time: then if begin - 1e-9 <= time < end - 1e-9 else before


CASES = {
    "drives": {},
    "drives backward": {"tread": -1.0, "forward": -0.7},
    "drives in a bend": {"steering": 0.5, "forward": 0.75, "lateral": 0.2},
    "drives across a current": {"lateral": 0.6, "push": (0.0, 30.0)},
    "drives up a steep slope": {"pitch": -0.6, "forward": 0.3, "depth": 0.0},
    "drives under a bow wave": {"load": 0.06},
    "creeps as commanded": {"tread": 0.03, "forward": 0.025},
    "stands": {"tread": 0.0, "forward": 0.0},
    "stands, creeping": {"tread": 0.0, "forward": 0.001},
    "stands on wheels that hardly turn": {"tread": 0.02, "forward": 0.0},
    "stuck": {"forward": after(3.0, 0.01, 0.8)},
    "stuck backward": {"tread": -1.0, "forward": after(3.0, -0.01, -0.8)},
    "afloat": {"load": after(3.0, 0.03, 0.6)},
    "bottomed": {"belly": after(3.0, 0.3, 0.0), "forward": after(3.0, 0.01, 0.8), "depth": 0.0},
    "bottomed backward": {"tread": -1.0, "belly": after(3.0, 0.3, 0.0), "forward": after(3.0, 0.0, -0.8)},
    "bottomed, half afloat": {
        "load": after(3.0, 0.0, 0.6),
        "belly": after(3.0, 0.2, 0.0),
        "forward": after(3.0, 0.0, 0.8),
    },
    "drives, dragging its belly": {"belly": after(3.0, 0.3, 0.0), "forward": 0.3},
    "stands on its belly": {"tread": 0.0, "forward": 0.0, "belly": 0.4},
    "stuck, hardly touching": {"belly": after(3.0, 0.05, 0.0), "forward": after(3.0, 0.01, 0.8)},
    "swept away sideways": {"lateral": after(3.0, 0.9, 0.0), "push": (0.0, 50.0)},
    "swept away backward": {"forward": after(3.0, -0.2, 0.8), "push": (-60.0, 0.0)},
    "swept away on locked wheels": {"tread": 0.0, "forward": after(3.0, -0.1, 0.0), "push": (-60.0, 0.0)},
    "slides sideways": {"lateral": after(3.0, -0.9, 0.0), "depth": 0.0},
    "slides back": {"forward": after(3.0, -0.2, 0.8), "depth": 0.0},
    "slides in still water": {"lateral": after(3.0, 0.9, 0.0), "push": (0.0, -5.0)},
    "sunk": {"sinkage": after(3.0, 0.95, 0.2)},
    "submerged": {"depth": 0.4, "height": after(3.0, 0.17, 0.3)},
    "tipped to the side": {"roll": after(3.0, 0.9, 0.0)},
    "tipped over the bow": {"pitch": after(3.0, 0.9, 0.0)},
    "tipped upside down": {"roll": after(3.0, 3.1, 0.0)},
}


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("factor", [1.0, 4.0])
def test_each_verdict_with_its_onset_for_similar_vehicles(name, factor):
    """Froude similar vehicles in similar water get the same verdict, its time by the square root of the scale."""
    verdict = judge(made_up_run(factor, **CASES[name]))
    kind = next(kind for kind in VERDICTS if name.startswith(kind) or (kind == "drives" and name.startswith("creeps")))
    assert verdict.kind == kind
    assert verdict.sentence.startswith(kind)
    assert math.isnan(verdict.until)
    if kind in CONDITIONS:
        assert verdict.since == pytest.approx(3.0 * math.sqrt(factor), abs=0.03 * math.sqrt(factor))
        assert verdict.flags[:, list(CONDITIONS).index(kind)].sum() == pytest.approx(301, abs=4)
    else:
        assert math.isnan(verdict.since)
        assert not verdict.flags.any()


def test_what_water_carries_aside_is_said_of_a_vehicle_that_is_steered_straight():
    """6 s at 0.3 m/s to the left while 4.8 m go ahead; not of a little, nor of one that is steered."""
    told = "; steered straight, it went 1.80 m to its left and turned by +0 deg"
    assert judge(made_up_run(lateral=0.3)).sentence.endswith(told)
    turning = made_up_run(lateral=-0.1)
    turning["yaw"][-1] = math.radians(-12.0)
    assert "it went 0.60 m to its right and turned by -12 deg" in judge(turning).sentence
    for little in ({"lateral": 0.03}, {"lateral": 0.3, "steering": 0.015}, {"lateral": 0.02, "forward": 0.2}):
        assert "it went" not in judge(made_up_run(**little)).sentence


def test_sentences_name_what_was_measured():
    def sentence(name):
        return judge(made_up_run(**CASES[name])).sentence

    assert sentence("stuck") == "stuck since 3.00 s: 1 % of the speed of its tyres"
    assert sentence("bottomed") == (
        "bottomed since 3.00 s: 30 % of the weight on the hull; the hull first touched the ground at 3.00 s at x = "
        "2.50 m, y = 0.00 m and bore up to 30 % of the weight"
    )
    assert sentence("drives, dragging its belly").startswith("drives: 0.30 m/s, 30 % of the speed of its tyres at ")
    assert sentence("afloat") == "afloat since 3.00 s: 3 % of the weight on the ground"
    assert sentence("tipped to the side") == "tipped since 3.00 s: tilted by 52 degrees"
    assert sentence("submerged") == "submerged since 3.00 s: the hull's top is 0.122 m under water"
    assert sentence("sunk") == "sunk since 3.00 s: a wheel is 95 % of its radius in the soil"
    assert sentence("drives") == "drives: 0.80 m/s, 80 % of the speed of its tyres at the end"
    drifting = judge(made_up_run(lateral=0.3)).sentence
    assert drifting.startswith(
        "drives: 0.80 m/s along its heading and 0.30 m/s aside, 80 % of the speed of its tyres at the end; steered"
    )
    assert "0.2 m/s against" in sentence("swept away backward")


@pytest.mark.parametrize(
    ("given", "kind"),
    [
        ({"load": 0.03}, "afloat"), ({"roll": 0.9}, "tipped"), ({"sinkage": 0.95}, "sunk"), ({"forward": 0.0}, "stuck"),
        ({"lateral": 0.9, "push": (0.0, 9.0)}, "swept away"), ({"depth": 0.4}, "submerged"),
    ],
)  # fmt: skip
def test_what_holds_from_the_start_has_its_onset_there(given, kind):
    verdict = judge(made_up_run(end=1.0, **given))
    assert (verdict.kind, verdict.since) == (kind, 0.0)


TRANSIENTS = {
    "load": (0.0, 0.6), "roll": (1.0, 0.0), "sinkage": (0.95, 0.2), "forward": (0.0, 0.8), "lateral": (0.9, 0.0),
}  # fmt: skip
"""Value during the transient, and otherwise."""


@pytest.mark.parametrize("name", TRANSIENTS)
def test_a_transient_is_no_onset_and_a_condition_that_ends_says_so(name):
    """Three tenths of the persistence: nothing. Three times it: from when to when, and that it drives again."""
    hop = judge(made_up_run(push=(0.0, 20.0), **{name: between(2.0, 2.0 + 0.3 * T, *TRANSIENTS[name])}))
    assert hop.kind == "drives"
    long = judge(made_up_run(push=(0.0, 20.0), **{name: between(2.0, 4.0, *TRANSIENTS[name])}))
    assert long.kind in CONDITIONS
    assert long.since == pytest.approx(2.0, abs=0.02)
    assert long.until == pytest.approx(4.0, abs=0.02)
    assert long.sentence.startswith(f"{long.kind} from 2.00 to ")
    assert long.sentence.endswith("; drives at the end")


def test_trembling_about_a_limit_does_not_hide_the_condition():
    """Wheels that touch now and then: 3 % on average, between 0 and 6 %; the first onset is kept."""
    verdict = judge(made_up_run(load=lambda t: 0.03 + 0.03 * math.sin(40.0 * t) if t > 1.0 else 0.6))
    assert verdict.kind == "afloat"
    assert verdict.since == pytest.approx(1.0, abs=0.15)
    rolling = judge(made_up_run(lateral=lambda t: 1.5 * math.sin(12.0 * t)))  # to and fro: nobody is swept away
    assert rolling.kind == "drives"


def test_the_worst_that_lasts_is_the_verdict_and_what_came_before_is_said():
    verdict = judge(made_up_run(load=after(1.0, 0.02, 0.6), forward=after(0.5, 0.0, 0.8), roll=after(4.0, 1.0, 0.0)))
    assert [found.kind for found in verdict.conditions] == ["tipped", "afloat", "stuck"]
    assert (verdict.kind, round(verdict.since, 2)) == ("tipped", 4.0)
    assert "; afloat since 1.00 s" in verdict.sentence
    recovered = judge(made_up_run(roll=between(1.0, 2.0, 1.0, 0.0), forward=after(3.0, 0.0, 0.8)))
    assert (recovered.kind, round(recovered.since, 2)) == ("stuck", 3.0)
    assert "tipped from 1.00 to" in recovered.sentence
    assert list(CONDITIONS) == sorted(CONDITIONS, key=list(VERDICTS).index)


def test_the_start_of_a_drive_is_not_stuck():
    """Wheels ramp up within a second, the vehicle follows late; and a stop at the end is none either."""
    verdict = judge(
        made_up_run(tread=lambda t: min(t, 1.0, max(5.0 - t, 0.0)), forward=lambda t: 0.8 * min(max(t - 0.2, 0.0), 1.0)
                    if t < 4.5 else max(0.0, 0.8 * (5.2 - t) / 0.7))
    )  # fmt: skip
    assert verdict.kind == "drives"


def test_static_stability_counts_where_it_ends_before_the_tilt():
    """A centre of mass 0.5 m up: its weight falls beside the wheels, 0.33 m out, from 33 degrees on."""
    from dataclasses import replace

    car = sized_amphibious(1.0)
    tall = replace(car, hull=replace(car.hull, center_of_mass_height=0.568, ground_clearance=0.3))
    height = (49.0 * 0.568 + 8.0 * 0.1) / 57.0
    edge = math.atan(0.33 / height)
    for roll, kind in ((edge - 0.01, "drives"), (edge + 0.01, "tipped"), (-edge - 0.01, "tipped")):
        assert judge(made_up_run(roll=roll), vehicle=tall).kind == kind
    assert judge(made_up_run(roll=edge + 0.01)).kind == "drives"
    edge = math.atan(0.357 / height)
    assert judge(made_up_run(pitch=edge + 0.01), vehicle=tall).kind == "tipped"
    assert judge(made_up_run(pitch=edge - 0.01), vehicle=tall).kind == "drives"


def test_a_run_too_short_to_tell_says_so():
    verdict = judge(made_up_run(end=0.5, load=0.0))
    assert verdict.kind == "too short to tell"
    assert verdict.sentence == "too short to tell: 0.50 s, and 0.54 s at least are needed"
    assert judge(made_up_run(end=0.6, load=0.0)).kind == "afloat"
    assert judge(made_up_run(end=0.6, load=0.0), VerdictLimits(persistence=3.0)).kind == "too short to tell"
    assert judge(made_up_run().isel(time=[0])).kind == "too short to tell"


def test_a_breakdown_is_the_verdict_unless_something_explains_it():
    status = "broke down at 6.0040 s: Newton did not converge"
    verdict = judge(made_up_run(status=status))
    assert (verdict.kind, verdict.since) == ("broke down", pytest.approx(6.004))
    assert verdict.sentence == "broke down at 6.00 s"
    short = judge(made_up_run(end=0.02, status="broke down at 0.0200 s: nan"))
    assert (short.kind, short.since) == ("broke down", pytest.approx(0.02))
    afloat = judge(made_up_run(status=status, load=after(2.0, 0.0, 0.6)))
    assert afloat.kind == "afloat"
    assert afloat.sentence.endswith("; the run broke down at 6.0040 s")
    sunk = judge(made_up_run(status=status, cause="sunk"))
    assert (sunk.kind, sunk.since) == ("sunk", pytest.approx(6.004))
    stopped = judge(made_up_run(status="interrupted at 6.0000 s"))
    assert stopped.kind == "drives"
    assert stopped.sentence.endswith("; the run was interrupted at 6.0000 s")


def test_values_that_are_not_finite_end_the_judgement():
    run = made_up_run(forward=0.0, status="broke down at 6.0000 s: not finite")
    run["soil_force"][-3:] = np.nan
    assert judge(run).kind == "stuck"
    run["soil_force"][:] = np.nan
    assert judge(run).kind == "broke down"


def test_coarse_and_fine_records_agree():
    for step in (0.001, 0.05, 0.3):
        verdict = judge(made_up_run(step=step, load=after(3.0, 0.0, 0.6)))
        assert verdict.kind == "afloat"
        assert verdict.since == pytest.approx(3.0, abs=step)


def test_packed_runs_are_judged_by_the_wrench_of_the_water():
    """Heading to the left by 90 degrees, water on the hull pushes to its own left: along -x of the world."""
    run = made_up_run(lateral=0.9, push=(0.0, 50.0))
    half = math.sqrt(0.5)
    wrench = np.zeros((run.sizes["time"], 5, 6))
    wrench[:, 0, 1] = 50.0
    turned = np.broadcast_to([half, 0, 0, half], (*wrench.shape[:2], 4))
    packed = run.drop_vars(["water_load", "spin_power"]).assign(
        yaw=run["yaw"] + 0.5 * math.pi, water_wrench=(("time", "body", "component"), wrench),
        quaternion=(("time", "body", "quaternion_component"), turned),
    )  # fmt: skip
    assert judge(packed).kind == "swept away"
    assert judge(packed.assign(water_wrench=-packed["water_wrench"])).kind == "slides"


def test_a_run_that_holds_too_little_is_refused_by_name():
    with pytest.raises(ValueError, match="no wheel_speed, soil_force; a verdict needs"):
        judge(made_up_run().drop_vars(["soil_force", "wheel_speed"]))
    with pytest.raises(ValueError, match="no water_load"):
        judge(made_up_run().drop_vars("water_load"))
    bare = made_up_run()
    bare.attrs = {}
    with pytest.raises(ValueError, match="vehicle"):
        judge(bare)
    assert judge(bare, vehicle=sized_amphibious(1.0)).kind == "drives"
    for text in ("{", "3", '{"vehicle": 3}', '{"vehicle": {}}', '{"vehicle": {"Vehicle": {"hull": 3}}}', "[]"):
        with pytest.raises(ValueError, match="parameters"):
            judge(made_up_run().assign_attrs(parameters=text))
    for water in (3, {"Water": 3}, {"Water": {}}):
        with pytest.raises(ValueError, match="water"):
            judge(made_up_run().assign_attrs(parameters=json.dumps({"water": water})), vehicle=sized_amphibious(1.0))
    with pytest.raises(ValueError, match="yaw has the dimensions"):
        judge(made_up_run().assign(yaw=made_up_run()["forward_velocity"]))
    with pytest.raises(ValueError, match="times"):
        judge(made_up_run().isel(time=[]))
    with pytest.raises(ValueError, match="times"):
        judge(made_up_run().isel(time=slice(None, None, -1)))
    with pytest.raises(ValueError, match="name its bodies"):
        judge(made_up_run().assign_coords(body=list("abcde")))
    with pytest.raises(ValueError, match=r"judge\.run"):
        judge("run.nc")
    with pytest.raises(ValueError, match=r"VerdictLimits\.tilt"):
        VerdictLimits(tilt=30.0)
    with pytest.raises(ValueError, match=r"VerdictLimits\.stuck_share"):
        VerdictLimits(stuck_share=1.5)


def test_limits_can_be_changed_and_are_kept():
    run = made_up_run(load=0.2)
    assert judge(run).kind == "drives"
    judged = with_verdict(run, judge(run, VerdictLimits(wheel_load=0.3)))
    assert judged.attrs["verdict"] == "afloat"
    assert '"wheel_load": 0.3' in judged.attrs["verdict_limits"]


def test_a_dataset_carries_its_verdict():
    run = made_up_run(load=after(3.0, 0.0, 0.6))
    judged = with_verdict(run, judge(run))
    assert judged.attrs["verdict"] == "afloat"
    assert judged.attrs["verdict_since"] == pytest.approx(3.0)
    assert math.isnan(judged.attrs["verdict_until"])
    flags = judged["verdict_flag"]
    assert flags.dtype == bool
    assert list(flags["condition"].values) == list(CONDITIONS)
    assert flags.sel(condition="afloat", time=slice(3.0, None)).all()
    assert not flags.sel(condition="afloat", time=slice(0.0, 2.98)).any()
    assert verdict_of(judged).sentence == judged.attrs["verdict_sentence"]
    assert verdict_of(run).kind == "afloat"
    assert verdict_of(xr.Dataset()) is None
    again = with_verdict(judged, judge(judged, VerdictLimits(wheel_load=0.0)))
    assert again.attrs["verdict"] == "drives"
    assert not again["verdict_flag"].any()


def test_an_error_without_a_result_says_why_it_did_not_start():
    for cause, kind in (("sunk", "sunk"), ("swept away", "swept away"), ("", "broke down"), ("else", "broke down")):
        verdict = verdict_of_error(SimulationError("no", cause=cause))
        assert verdict.figures() == {"verdict": kind, "verdict_since": 0.0}
    error = SimulationError("Newton did not converge")
    error.result = made_up_run(load=0.0, status="broke down at 6.0000 s: Newton")
    assert verdict_of_error(error).kind == "afloat"


def test_every_variable_and_name_of_a_result_is_described():
    dims = {dim for dimensions, *_ in VARIABLES.values() for dim in dimensions.split()} - {"time"}
    assert dims <= set(DIMENSIONS)
    assert set(COMMENTS) <= set(VARIABLES)
