"""The line of trust: what was measured, beyond it by each quantity, other vehicles and models; the table behind it."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import exumob
from exumob.coupling.explicit import Explicit
from exumob.coupling.flow_in_loop import CfdHydrodynamics
from exumob.coupling.semi_implicit import SemiImplicit
from exumob.coupling.strong import Strong
from exumob.driving.maneuver import ConstantSteer, Recorded, lane_change
from exumob.driving.path_following import PathFollowing
from exumob.ground.soil import Soil
from exumob.ground.terrain import Terrain
from exumob.paper.scenarios import TRAINING, UNSEEN
from exumob.simulation.description import RunDescription, Steps
from exumob.simulation.over_water import WaterMet
from exumob.simulation.result_files import load_dataset
from exumob.simulation.run import simulate
from exumob.simulation.trust import trust_of, trust_of_all
from exumob.simulation.trust.departures import driven_in
from exumob.support.measured import measured_errors
from exumob.surrogates.ensemble import card_of, load_members
from exumob.surrogates.model import SurrogateHydrodynamics
from exumob.surrogates.networks import FULL_RANGE, NAMED
from exumob.surrogates.vehicle_shape import shape_differences
from exumob.vehicle.point_force import PointForce
from exumob.vehicle.start_pose import StartPose
from exumob.vehicle.vehicle_file import load_vehicle
from exumob.water.calibrated import CalibratedHydrodynamics
from exumob.water.coefficients import CoefficientHydrodynamics, Coefficients
from exumob.water.conditions import Water
from exumob.water.hydrodynamics import NoWater
from exumob.water.water_field import WaterField
from vehicle_models.amphibious import amphibious_vehicle

ROOT = Path(__file__).parents[2]
CAR = amphibious_vehicle()
OTHER = load_vehicle(ROOT / "vehicle_models" / "light_4x4.py")
NETWORKS = SurrogateHydrodynamics()
CARD = card_of(load_members(FULL_RANGE))
RUN = RunDescription(
    CAR, Soil.published("LETE sand"), Water.at_ratio(0.6, 1.0), Terrain(), lane_change(), NETWORKS, Explicit(),
    Steps(8.0, 1e-3, 20e-3, 1e-2), 0.0,
)  # fmt: skip
SHORT = replace(RUN.steps, duration=6.0)
BEHIND = Water.at_ratio(0.7, 1.05, current_direction=0.0)
"""Water of the drives of the card, and of no lane change of the table."""
COEFFICIENTS = replace(RUN, hydrodynamics=CoefficientHydrodynamics())
STRAIGHT = replace(RUN, maneuver=ConstantSteer(), steps=replace(RUN.steps, duration=4.0))


# -- measured ----------------------------------------------------------------------------------------------------------


def test_networks_on_a_run_like_those_measured():
    """Mean and worst of the unseen runs; those that taught the networks do not count."""
    off = [row["networks"]["end"] for row in measured_errors()["runs"] if not row["taught_networks"]]
    found = trust_of(RUN, 0.0, 0.0)
    assert (found.model, found.status, found.departures) == ("networks", "measured", ())
    assert (found.mean, found.worst) == (pytest.approx(np.mean(off)), max(off))
    assert f"{100 * np.mean(off):.2g} % of its length (at worst {100 * max(off):.2g} %)" in found.line
    assert "4 lane changes that they had not seen; this vehicle, LETE sand" in found.line
    assert "published values (LETE sand), flat" in found.line


def test_both_sets_of_runs_are_named_with_their_ranges():
    """What counts as measured, and what the error was found on: no water lies within one and outside both of them."""
    line = trust_of(RUN, 0.0, 0.0).line
    assert (
        "depth ratio 0.5 to 0.6, current 0.5 to 1 m/s from ahead; 9 that they had seen, depth ratio 0.4 to 0.6" in line
    )
    for water in (Water.at_ratio(0.6), Water.at_ratio(0.42, 0.25)):
        found = trust_of(replace(RUN, water=water), 0.0, 0.0)
        assert found.status == "measured"
        assert "9 that they had seen, depth ratio 0.4 to 0.6, current 0 to 1 m/s from ahead: at worst" in found.line


DRY = replace(RUN, water=None, hydrodynamics=NoWater())


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"terrain": Terrain.slope(0.1)}, "terrain not flat (flat)"),
        ({"soil": Soil.published("Lunar soil")}, "soil Lunar soil (LETE sand)"),
        ({"steps": replace(RUN.steps, duration=2.0)}, "duration 2 s (8 s)"),
        ({"maneuver": replace(lane_change(), speed=30.0)}, "wheel speed 30 rad/s"),
        ({"maneuver": ConstantSteer()}, "maneuver straight ahead (lane change)"),
        ({"initial_speed": 0.5}, "initial speed 0.5 m/s (0 m/s)"),
        ({"forces": (PointForce(lambda t, x, v: (0.0, 0.0, 0.0)),)}, "forces of your own 1 (none)"),
        ({"vehicle": replace(CAR, hull=replace(CAR.hull, mass=60.0))}, "hull.mass 60 (49)"),
    ],
)
def test_dry_runs_say_in_what_they_lie_beyond(change, text):
    found = trust_of(replace(DRY, **change))
    assert found.status == "beyond"
    assert text in found.line


def test_coefficients_are_far_worse_and_the_nearest_run_is_named():
    found = trust_of(COEFFICIENTS)
    assert found.status == "measured"
    assert found.mean > 8.0 * trust_of(RUN, 0.0, 0.0).mean
    assert "46 % in D60/U1, which is nearest" in found.line
    assert "always too far" in found.line
    assert "nearest" not in trust_of(replace(COEFFICIENTS, water=Water.at_ratio(0.6, 3.0))).line


def test_calibrated_coefficients_count_on_all_runs_and_say_to_how_many_they_were_fitted():
    run = replace(COEFFICIENTS, hydrodynamics=CalibratedHydrodynamics())
    off = [row["calibrated"]["end"] for row in measured_errors()["runs"]]
    found = trust_of(run)
    assert (found.model, found.status) == ("calibrated", "measured")
    assert (found.mean, found.worst) == (pytest.approx(np.mean(off)), max(off))
    assert found.mean < 0.5 * trust_of(COEFFICIENTS).mean
    assert (
        "(13 lane changes, to 9 of which it was fitted; this vehicle, LETE sand, depth ratio 0.4 to 0.6" in found.line
    )
    other = trust_of(replace(run, vehicle=OTHER))
    assert other.status == "not validated" and "this vehicle (light 4x4) is not the one that was compared" in other.line
    for name, one in (("calibrated", other), ("coefficients", trust_of(replace(COEFFICIENTS, vehicle=OTHER)))):
        others = measured_errors()["elsewhere"]
        drives = others["later"]["drives"]
        low, high = others[name]
        assert "(light 4x4, large 4x4, small car; 50 % depth, a head" in one.line
        assert (
            f"by Froude's law): {100 * low:.2g} to {100 * high:.2g} % of the path away; {drives} drives of" in one.line
        )
        low, high = others["later"][name]
        assert f"up to 2.8 m/s, also from the side and behind) {100 * low:.2g} to {100 * high:.2g} %" in one.line
        assert ("its lane change is among what they were fitted to" in one.line) == (name == "calibrated")
    own = replace(run, hydrodynamics=CalibratedHydrodynamics(Coefficients(hull_surge_drag=1.0)))
    assert "coefficients of your own" in trust_of(own).line


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"water": Water.at_ratio(0.9, tyre_diameter=0.72)}, "depth ratio 0.9 (0.327 to 0.707)"),
        ({"water": Water(0.36, 2.5)}, "current 2.5 m/s (0 to 1.94 m/s)"),
        ({"water": Water(0.36, 1.5, 0.5 * math.pi)}, "current turned from ahead by 90 deg (0, 36, 162 deg)"),
        ({"water": Water(0.36, 1.5, math.radians(150.0))}, ""),
        ({"maneuver": ConstantSteer(speed=-5.0)}, "reversing at 5 rad/s (forwards)"),
        ({"water": Water(0.36, 1.5)}, ""),
    ],
)
def test_for_another_vehicle_the_water_beyond_what_was_tried_is_named(change, text):
    """Depths over the tyre's diameter, currents by Froude's law: 1 m/s of the paper's vehicle is 1.83 m/s of a 4x4.

    The calibrated coefficients were tried on drives in currents from several sides as well; the published ones, and
    those that were fitted to other runs, were not.
    """
    run = replace(
        COEFFICIENTS, vehicle=OTHER, hydrodynamics=CalibratedHydrodynamics(), **{"water": Water(0.36), **change}
    )
    found = trust_of(run)
    assert found.status == "not validated"
    assert found.attributes()["trust_beyond"] == text
    beyond = f", and beyond all that was tried (in brackets): {text}; " if text else ": "
    assert found.line.startswith(f"calibrated, not validated{beyond}this vehicle")
    ends = [100.0 * one["calibrated_end"] for one in CARD["drives"]]
    told = f"current 0.052 to 1.1 m/s) it ended {min(ends):.2g} to {max(ends):.2g} % of the path away."
    assert (told in found.line) == ("maneuver" not in change)  # straight ahead it is the speed
    other = CalibratedHydrodynamics(waves=SurrogateHydrodynamics(FULL_RANGE).waves)
    for model in (CoefficientHydrodynamics(), other):
        aside = trust_of(replace(run, water=Water(0.36, 1.5, math.radians(150.0)), hydrodynamics=model))
        assert "current turned from ahead by 30 deg (0 deg)" in aside.attributes()["trust_beyond"]
        assert "other drives of that one" not in aside.line


def test_the_papers_networks_have_errors_of_their_own():
    """They come with exumob under a name; the default ensemble's figures are not theirs."""
    found = trust_of(replace(RUN, hydrodynamics=SurrogateHydrodynamics("paper-lstm")), 0.0, 0.0)
    off = [row["paper-lstm"]["end"] for row in measured_errors()["runs"] if not row["taught_networks"]]
    assert (found.model, found.status, found.worst) == ("networks (paper-lstm)", "measured", max(off))
    mixed = SurrogateHydrodynamics(["paper-lstm", *NETWORKS.networks])
    assert trust_of(replace(RUN, hydrodynamics=mixed)).status == "not validated"


def test_coefficients_that_the_networks_rest_on_have_errors_of_their_own():
    """Without the networks they act as calibrated ones; the table knows them."""
    found = trust_of(replace(RUN, hydrodynamics=CalibratedHydrodynamics(waves=NETWORKS.waves)))
    off = [row["fitted"]["end"] for row in measured_errors()["runs"]]
    assert (found.model, found.status) == ("calibrated (for the networks)", "measured")
    assert (found.mean, found.worst) == pytest.approx((np.mean(off), max(off)))
    other = replace(NETWORKS.waves, values=1.1 * NETWORKS.waves.values)
    assert trust_of(replace(RUN, hydrodynamics=CalibratedHydrodynamics(waves=other))).status == "not validated"


@pytest.mark.parametrize("run", [STRAIGHT, replace(COEFFICIENTS, maneuver=ConstantSteer(), steps=STRAIGHT.steps)])
def test_straight_ahead_it_is_the_speed(run):
    name = trust_of(run).model
    rows = [row for row in measured_errors()["runs"] if name == "coefficients" or not row["taught_networks"]]
    found = trust_of(run)
    assert found.status == "measured"
    assert found.worst == max(abs(row[name]["speed"]) for row in rows)
    assert f"at worst {found.worst:.2g} m/s" in found.line


def test_dry_ground_rests_on_soil_and_steps():
    found = trust_of(replace(RUN, water=None, hydrodynamics=NoWater()))
    assert (found.model, found.status) == ("no water", "measured")
    assert "the steps move the end of the path by less than 0.1 %" in found.line
    hills = trust_of(replace(RUN, water=None, hydrodynamics=NoWater(), terrain=Terrain.slope(0.1)))
    assert "given terrain" in hills.line
    assert trust_of(replace(RUN, water=None, vehicle=OTHER, hydrodynamics=NoWater())).status == "beyond"


def test_soil_under_water_says_at_which_moisture_it_was_measured():
    assert "LETE sand was measured dry" in trust_of(RUN).line
    loam = trust_of(replace(RUN, soil=Soil.published("Sandy loam 15 %"))).line
    assert "measured at 15 % moisture; 'Sandy loam 22 %' is the same soil wetter" in loam
    assert "Under water" not in trust_of(replace(RUN, water=None, hydrodynamics=NoWater())).line
    assert "Under water" not in trust_of(replace(RUN, soil=replace(RUN.soil, cohesion=2e3))).line


@pytest.mark.parametrize("make", [
    lambda slope: Terrain.slope(slope, 0.7),
    lambda slope: Terrain(heights=[[0.0, math.tan(slope)]] * 2, spacing=(1.0, 50.0), direction=0.4),
])  # fmt: skip
def test_ground_steeper_than_its_soil_stands_is_named(make):
    """LETE sand has a friction angle of 31.1 degrees (Wong)."""
    dry = replace(RUN, water=None, hydrodynamics=NoWater())
    assert "may slide" not in trust_of(replace(dry, terrain=make(math.radians(31.0)))).line
    steep = trust_of(replace(dry, terrain=make(math.radians(40.0)))).line
    assert "up to 40 deg steep, and LETE sand stands to 31 deg by its friction" in steep


def test_flow_in_the_loop_says_how_well_it_repeats():
    found = trust_of(LOOP)
    assert (found.model, found.status) == ("flow in the loop", "measured")
    assert f"D60/U1 ended within {100 * measured_errors()['flow']['end']:.2g} % of the path" in found.line
    assert "no vehicle was measured in water" in found.line
    coarse = trust_of(replace(RUN, hydrodynamics=CfdHydrodynamics(cell_size=0.03, allow_coarse=True)))
    assert coarse.status == "beyond"
    assert "cells of 30 mm (15 to 22 mm)" in coarse.line


# -- beyond ------------------------------------------------------------------------------------------------------------

OTHER_LOADS = "held" if Explicit().within_step == "linear" else "linear"
FINE_HULL = replace(CAR, hull=replace(CAR.hull, mass=60.0))


def test_a_head_current_is_one_wherever_the_vehicle_heads():
    water = Water.at_ratio(0.6, 1.0, current_direction=math.radians(-150.0))
    assert trust_of(replace(RUN, water=water, start=StartPose(50.0, 60.0, math.radians(30.0)))).status == "measured"


MET = WaterMet((0.02, 0.11), (0.2, 0.9), 0.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({}, "water a level over terrain (one depth)"),
        ({"current": (0.2, 1.7)}, "current 0.2 to 1.7 m/s (0.0524 to 1.06 m/s)"),
        ({"depth": (0.02, 0.3)}, "depth ratio 1.5 (0.327 to 0.707)"),
        ({"level_difference": 0.012}, "level, taken as horizontal, over half the hull by 12 mm"),
        ({"current_difference": 0.15}, "current, taken at the bodies' origins, over half the hull by 0.15 m/s"),
        ({"slope": 0.15}, "networks of level beds on a slope of 0.15"),
    ],
)
def test_what_a_model_assumes_of_the_water_is_said(change, text):
    run = replace(RUN, water=Water(level=0.0))
    assert text in "; ".join(map(str, trust_of(run, 0.0, 0.0, MET._replace(**change)).departures))
    coefficients = trust_of(replace(run, hydrodynamics=CoefficientHydrodynamics()), met=MET._replace(**change))
    named = "; ".join(map(str, coefficients.departures))
    assert ("slope" in named, "strip by strip" in named) == (False, "current_difference" in change)
    aside = trust_of(replace(run, hydrodynamics=CoefficientHydrodynamics()), met=MET._replace(aside=0.5 * math.pi))
    assert "turned from ahead by 90 deg" in "; ".join(map(str, aside.departures))


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"water": Water.at_ratio(1.2, 1.0), "steps": SHORT}, "depth ratio 1.2 (0.327 to 0.707)"),
        ({"water": Water.at_ratio(0.1, 1.0), "steps": SHORT}, "depth ratio 0.1 (0.327 to 0.707)"),
        ({"water": Water.at_ratio(0.6, 1.7), "steps": SHORT}, "current 1.7 m/s (0.0524 to 1.06 m/s)"),
        ({"water": Water.at_ratio(0.6, 1.0, density=1100.0)}, "density 1.1e+03 kg/m³ (1000 kg/m³)"),
        ({"water": Water(level=0.12, current_speed=1.0)}, "water a level over terrain (one depth)"),
        ({"water": Water(field=WaterField(np.ones((2, 2))))}, "water a field (one depth)"),
        ({"steps": replace(RUN.steps, duration=0.2)}, "duration 0.2 s (8 s)"),
        ({"soil": Soil.published("Sandy loam 11 %")}, "soil Sandy loam 11 % (LETE sand)"),
        ({"soil": replace(RUN.soil, n=0.9)}, "soil LETE sand with other values (LETE sand)"),
        ({"vehicle": FINE_HULL}, "hull.mass 60 (49)"),
        ({"maneuver": lane_change(math.radians(35.0))}, "steering 35 deg (15 to 30 deg)"),
        ({"maneuver": lane_change(speed=15.0)}, "wheel speed 15 rad/s (10 rad/s)"),
        ({"maneuver": ConstantSteer(angle=0.3)}, "constant steering 17.2 deg (0 deg)"),
        ({"maneuver": PathFollowing()}, "maneuver PathFollowing (lane change, straight ahead)"),
        ({"maneuver": Recorded([0, 1, 2, 3], np.zeros(4), [0, 1, 2, 3])}, "maneuver Recorded"),
        ({"initial_speed": 1.0}, "initial speed 1 m/s (0 m/s)"),
        ({"terrain": Terrain.slope(math.radians(20.0))}, "terrain not flat (flat)"),
        ({"maneuver": replace(lane_change(), start_speed=10.0)}, "wheel speed at the start 10 rad/s (0 rad/s)"),
        ({"maneuver": replace(lane_change(), ramp_time=0.2)}, "ramp time 0.2 s (1 s)"),
        ({"maneuver": ConstantSteer(ramp_time=7.0)}, "ramp time 7 s (1 s)"),
        ({"vehicle": replace(CAR, rear_suspension=replace(CAR.suspension, stiffness=9e3))},
         "rear_suspension of its own (none)"),
        ({"coupling": Strong()}, "coupling Strong (Explicit)"),
        ({"coupling": Explicit(within_step=OTHER_LOADS)}, f"loads within a step {OTHER_LOADS} ("),
        ({"steps": replace(RUN.steps, duration=20.0)}, "duration 20 s (8 s)"),
        ({"steps": replace(RUN.steps, macro_step=0.05)}, "macro step 50 ms (20 ms)"),
        ({"steps": replace(RUN.steps, micro_step=2e-3)}, "micro step 2 ms (1 ms)"),
        ({"hydrodynamics": SurrogateHydrodynamics(NETWORKS.networks[0])}, "networks 1 (5 together)"),
        ({"hydrodynamics": SurrogateHydrodynamics(fallback=False)}, "networks alone"),
    ],
)  # fmt: skip
def test_what_lies_beyond_is_named_with_what_was_measured(change, text):
    found = trust_of(replace(RUN, **change), 0.0, 0.0)
    assert found.status == "beyond"
    assert len(found.departures) == 1
    assert text in str(found.departures[0])
    assert f"beyond what was measured (in brackets): {found.departures[0]}. The error here is not known" in found.line


LOOP = replace(
    RUN, hydrodynamics=CfdHydrodynamics(cell_size=0.018), coupling=SemiImplicit(),
    steps=replace(RUN.steps, micro_step=5e-4, macro_step=2e-3),
)  # fmt: skip


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"maneuver": lane_change(math.radians(40.0))}, "steering 40 deg (30 deg)"),
        ({"maneuver": lane_change(speed=20.0)}, "wheel speed 20 rad/s (10 rad/s)"),
        ({"maneuver": ConstantSteer(speed=-5.0)}, "wheel speed -5 rad/s (10 rad/s)"),
        ({"maneuver": replace(lane_change(), start_speed=10.0)}, "wheel speed at the start 10 rad/s (0 rad/s)"),
        ({"steps": replace(RUN.steps, duration=0.2)}, "duration 0.2 s (4 to 6 s)"),
        ({"hydrodynamics": NETWORKS.member(1)}, "networks 1 (5 together)"),
    ],
)
def test_drives_of_a_card_count_as_they_were_driven(change, text):
    """In water that only drives over the whole range were in: what is driven harder than these is named."""
    run = replace(RUN, water=BEHIND, steps=SHORT)
    assert trust_of(run, 0.0, 0.0).status == "measured"
    assert text in map(str, trust_of(replace(run, **change), 0.0, 0.0).departures)


def test_runs_that_other_networks_drove_are_judged_by_theirs():
    """In the water of lane changes, but beyond their range: on soft soil, say."""
    within, beyond = trust_of(RUN, 0.0, 0.0, wide=0.04), trust_of(RUN, 0.0, 0.0, wide=0.06)
    assert within.status == "measured" and "lane changes that they had not seen" in within.error
    assert beyond.status == "beyond" and "5 drives kept apart" in beyond.error


def test_coefficients_of_the_whole_range_quote_their_drives():
    waves = SurrogateHydrodynamics(FULL_RANGE).waves
    found = trust_of(replace(RUN, hydrodynamics=CalibratedHydrodynamics(waves=waves)))
    ends = [one["coefficients_end"] for one in CARD["drives"]]
    assert found.status == "not validated" and f"ended {100 * min(ends):.2g} to {100 * max(ends):.2g} %" in found.line


def test_water_that_networks_learnt_but_no_drive_was_in_is_beyond_what_was_measured():
    deep = replace(RUN, water=Water.at_ratio(0.85, 1.3, current_direction=0.0), steps=SHORT)
    found = trust_of(deep, 0.0, 0.0)
    assert found.status == "beyond"
    assert [str(d) for d in found.departures] == [
        "depth ratio 0.85 (0.327 to 0.707)", "current 1.3 m/s (0.0524 to 1.06 m/s)",
    ]  # fmt: skip
    assert "of flow at depth ratios of 0.2 to 0.9, currents of 0 to 1.5 m/s" in found.line
    before = {**CARD, "drives": [{"end": 0.01, "maneuver": "lane change"}]}
    told = {name: CARD[name] for name in ("depth_ratio", "current_speed")}
    assert driven_in(before) == told | {"current_turned": []}
    for near in (Water.at_ratio(0.3, 0.0), Water.at_ratio(0.73, 1.1, current_direction=math.radians(55.0 - 180.0))):
        assert trust_of(replace(deep, water=near), 0.0, 0.0).status == "measured", near
    aside = trust_of(replace(deep, water=Water.at_ratio(0.7, 1.0, current_direction=0.5 * math.pi)), 0.0, 0.0)
    assert [str(d) for d in aside.departures] == ["current turned from ahead by 90 deg (0, 36, 162 deg)"]


def test_networks_are_judged_by_the_runs_that_are_most_like():
    """Lane changes like the paper's by those, other waters by drives over the whole range; the water counts first."""
    short = SHORT
    lane = trust_of(replace(RUN, water=Water.at_ratio(0.45, 0.3)), 0.0, 0.0)
    assert lane.status == "measured" and "lane changes that they had not seen" in lane.error
    ends = [one["default_end"] for one in CARD["drives"]]
    assert max(ends) != max(one["end"] for one in CARD["drives"])  # of the networks for the whole range alone
    behind = BEHIND
    loam = Soil.published("Grenville loam 24 %")
    for change in ({"water": behind}, {"soil": loam}, {"water": behind, "soil": loam}):
        found = trust_of(replace(RUN, steps=short, **change), 0.0, 0.0)
        assert found.model == "networks" and found.status == "measured", change
        assert (found.mean, found.worst) == (pytest.approx(np.mean(ends)), max(ends)) and found.worst > lane.worst
        assert "5 drives kept apart (depth ratio 0.33 to 0.71, current 0.052 to 1.1 m/s) ended" in found.line
    longer = trust_of(replace(RUN, water=behind), 0.0, 0.0)
    assert longer.status == "beyond" and [str(d) for d in longer.departures] == ["duration 8 s (4 to 6 s)"]
    neither = trust_of(replace(RUN, water=Water.at_ratio(1.2, 1.2, current_direction=0.0)), 0.9, 0.5)
    assert "depth ratio 1.2 (0.327 to 0.707)" in map(str, neither.departures)
    twice = replace(RUN, vehicle=exumob.scaled_vehicle(CAR, 2.0), water=Water(0.28, 1.2, current_direction=0.0))
    large = trust_of(twice)
    assert large.status == "not validated" and not large.departures and "2 times as large" in large.advice


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"water": Water.at_ratio(0.4, 1.0)}, "depth ratio 0.4 (0.6)"),
        ({"water": Water.at_ratio(0.6, 0.0)}, "current 0 m/s (1 m/s)"),
        ({"maneuver": lane_change(math.radians(15.0))}, "steering 15 deg (30 deg)"),
        ({"maneuver": ConstantSteer()}, "maneuver straight ahead (lane change)"),
        ({"coupling": Explicit()}, "coupling Explicit (SemiImplicit)"),
        ({"steps": replace(LOOP.steps, macro_step=0.02)}, "macro step 20 ms (2 ms)"),
    ],
)  # fmt: skip
def test_flow_in_the_loop_was_repeated_in_one_run_only(change, text):
    assert trust_of(LOOP).status == "measured"
    found = trust_of(replace(LOOP, **change))
    assert (found.status, [str(d) for d in found.departures]) == ("beyond", [text])


def test_a_dry_run_among_wet_ones_is_named():
    found = trust_of_all([RUN, replace(RUN, water=None)])
    assert [str(d) for d in found.departures] == ["duration 8 s (4 to 6 s)", "depth ratio 0 (0.327 to 0.707)"]


def test_the_edges_of_what_was_measured_are_within():
    for scenario in (*TRAINING, *UNSEEN):
        run = replace(RUN, water=scenario.water(CAR), maneuver=scenario.maneuver())
        assert trust_of(run, 0.0, 0.0).status == "measured", scenario.name
    mirrored = replace(RUN, maneuver=lane_change(-math.radians(30.0)))
    assert trust_of(mirrored, 0.0, 0.0).status == "measured"
    calm = replace(RUN, water=Water.at_ratio(0.5, 0.0, current_direction=1.0))  # no current: no direction
    assert trust_of(calm, 0.0, 0.0).status == "measured"


def test_time_outside_the_training_range_says_what_to_believe():
    slightly, far = trust_of(RUN, 0.495, 0.0), trust_of(RUN, 0.495, 0.32)
    for found in (slightly, far):
        assert "outside the networks' training range for 49.5 % of the time (0 % of the time)" in found.line
    assert "the networks answered alone" in slightly.line
    assert "The coefficients that they rest on gave 32 % of the loads; alone, in what was measured, they" in far.line
    ends = [one["coefficients_end"] for one in CARD["drives"]]
    assert f"they ended {100 * min(ends):.2g} to {100 * max(ends):.2g} % of the path away" in far.line
    assert trust_of(RUN, 0.004, 0.0).status == "measured"


def test_own_coefficients_are_not_those_measured():
    own = replace(RUN, hydrodynamics=CoefficientHydrodynamics(replace(Coefficients(), hull_surge_drag=1.0)))
    assert "coefficients of your own (those that come with exumob)" in trust_of(own).line


# -- not validated -----------------------------------------------------------------------------------------------------


def test_another_vehicle_was_not_validated():
    found = trust_of(replace(COEFFICIENTS, vehicle=OTHER))
    assert found.status == "not validated"
    assert math.isnan(found.mean)
    assert "this vehicle (light 4x4) is not the one that was compared with the flow in the loop" in found.line
    assert "the amphibious vehicle, LETE sand" in found.line
    assert "trust_mean_error" not in found.attributes()
    loop = trust_of(replace(RUN, vehicle=OTHER, hydrodynamics=CfdHydrodynamics(cell_size=0.1)))
    assert loop.status == "not validated"


class OwnModel:
    """A model of the water that nobody knows."""


class OwnFlow:
    """A flow code that nobody knows."""

    start = advance = save = restore = report = lambda *given: None


def test_networks_and_a_vehicle_of_another_form_or_size():
    """Networks refuse another form, and the line says so; in another size it says how far they left their range."""
    wide = replace(RUN, vehicle=replace(CAR, track=1.1 * CAR.track))
    assert "It has not the form of the one that the networks know" in trust_of(wide).line
    large = replace(RUN, vehicle=exumob.scaled_vehicle(CAR, 4.0))
    assert "4 times as large" in trust_of(large).line and "outside the networks" not in trust_of(large).line
    assert (
        "outside the networks' training range for 90 % of the time (0 % of the time)" in trust_of(large, 0.9, 0.8).line
    )


@pytest.mark.parametrize(
    ("model", "text"),
    [
        (OwnModel(), "OwnModel, not validated: a model of your own"),
        (CfdHydrodynamics(OwnFlow()), "OwnFlow is a flow code of your own"),
        (SurrogateHydrodynamics(replace(NETWORKS.networks[0], arrays={
            name: 1.01 * array for name, array in NETWORKS.networks[0].arrays.items()})), "networks of your own"),
        (NoWater(), "there is water, and its loads are left out"),
    ],
)  # fmt: skip
def test_models_that_were_not_measured(model, text):
    found = trust_of(replace(RUN, hydrodynamics=model))
    assert found.status == "not validated"
    assert text in found.line


def test_differences_in_shape_are_named():
    trained = NETWORKS.networks[0].about["geometry"]
    assert shape_differences(CAR, trained) == []
    assert shape_differences(FINE_HULL, trained) == []  # mass is no shape
    assert shape_differences(replace(CAR, track=0.7), trained) == ["track = 0.7, they were trained with 0.66"]


# -- where it is kept --------------------------------------------------------------------------------------------------


def test_parts_of_the_error_stand_each_on_a_line():
    """Networks and coefficients have that of the model, all have those of the flow; what was not compared has none."""
    flow = measured_errors()["flow"]
    names = {"networks": RUN, "coefficients": COEFFICIENTS, "flow": LOOP}
    found = {name: str(trust_of(run).attributes()["trust_errors"]).splitlines() for name, run in names.items()}
    flows = ["flow made again", "other cells", "loads of the flow"]
    assert [line.split(":")[0] for line in found["flow"]] == flows
    assert [line.split(":")[0] for line in found["coefficients"]] == ["model beside the flow", *flows]
    assert [line.split(":")[0] for line in found["networks"]] == [
        "model beside the flow", "members of the ensemble", *flows
    ]  # fmt: skip
    assert f"{100.0 * flow['ends']['15 mm cells']:.2g} % on 15 mm cells (D60/U1, made on 18 mm)" in found["flow"][1]
    assert "standard deviation of 5, on 4 runs not seen" in found["networks"][1]
    assert max(flow["ends"].values()) == flow["end"]
    straight = trust_of(replace(RUN, maneuver=ConstantSteer(), steps=replace(RUN.steps, duration=4.0))).parts
    assert straight[0][0] == "speed beside the flow" and "m/s" in straight[0][1]
    two = replace(RUN, hydrodynamics=SurrogateHydrodynamics(NETWORKS.networks[:2]))
    assert "standard deviation of 5" in dict(trust_of(two).parts)["members of the ensemble"]
    assert "trust_errors" not in trust_of(replace(COEFFICIENTS, vehicle=OTHER)).attributes()


def test_every_result_carries_it(short_run, sand):
    attrs = short_run.attrs
    assert attrs["trust"].startswith("coefficients, beyond what was measured (in brackets): duration 0.2 s")
    assert attrs["trust_model"] == "coefficients"
    assert attrs["trust_status"] == "beyond"
    assert attrs["trust_beyond"] == "duration 0.2 s (8 s)"
    assert attrs["trust_mean_error"] < attrs["trust_worst_error"]
    deep = simulate(CAR, sand, Water.at_ratio(1.2, 1.2), duration=0.06, micro_step=5e-4, macro_step=20e-3)
    assert "outside the networks' training range for 100 % of the time" in deep.attrs["trust"]


def test_runs_together_have_the_range_of_all():
    runs = [replace(RUN, water=Water.at_ratio(ratio, 0.5)) for ratio in (0.35, 0.5, 0.7)]
    assert [str(d) for d in trust_of_all(runs).departures] == ["duration 8 s (4 to 6 s)"]
    runs = [replace(run, water=Water.at_ratio(ratio, 0.5)) for run, ratio in zip(runs, (0.1, 0.5, 0.7), strict=True)]
    assert [str(d) for d in trust_of_all(runs).departures] == [
        "depth ratio 0.1 (0.327 to 0.707)",
        "duration 8 s (4 to 6 s)",
    ]
    cheap = [replace(run, hydrodynamics=COEFFICIENTS.hydrodynamics) for run in runs[:2]]
    assert "nearest" in trust_of_all(cheap[1:]).line
    assert "nearest" not in trust_of_all(cheap).line  # each has another one


# -- the table ---------------------------------------------------------------------------------------------------------


def test_table_is_of_the_shipped_networks_and_the_paper_vehicle():
    table = measured_errors()
    assert table["networks"] == [network.digest() for network in NETWORKS.networks]
    assert table["named"] == {name: [network.digest() for network in load_members(name)] for name in NAMED}
    assert [row["scenario"] for row in table["runs"]] == [s.name for s in (*TRAINING, *UNSEEN)]
    assert table["vehicle"]["hull"]["length"] == CAR.hull.length


def test_table_agrees_with_what_other_studies_found():
    """Final positions of the studies of the networks: they were made by other runs, of another day, in steps of 0.5 ms
    with loads held within each macro step."""
    table = {row["scenario"]: row for row in measured_errors()["runs"]}
    for file in ("predict_unseen.nc", "reproduce_training.nc"):
        study = load_dataset(ROOT / "studies" / "figures" / file)
        for model, name in (("published coefficients", "coefficients"), ("memory, ensemble", "networks")):
            for scenario in study["scenario"].values:
                final = 0.01 * float(study["final"].sel(model=model, scenario=scenario)[0])
                assert table[str(scenario)][name]["end"] == pytest.approx(final, abs=3e-3), (model, scenario)


def test_page_of_the_study_gives_the_figures_of_the_table():
    page = (ROOT / "docs" / "studies" / "measured_errors.md").read_text()
    rows = measured_errors()["runs"]
    names = ("networks", "paper-lstm", "fitted")
    unseen = [[row[name] for row in rows if not row["taught_networks"]] for name in names]
    for found in (*unseen, *([row[name] for row in rows] for name in ("full-range", "calibrated", "coefficients"))):
        ends, speeds = ([abs(one[kind]) for one in found] for kind in ("end", "speed"))
        for text in (f"{100 * np.mean(ends):.2g} %", f"{100 * max(ends):.2g} %", f"{np.mean(speeds):.2g} m/s",
                     f"{max(speeds):.2g} m/s"):  # fmt: skip
            assert f"| {text}" in page, text
    left = [row for row in rows if row["networks"]["out_of_range"] > 0.0]
    assert not left and "In none of the thirteen runs did exumob's own leave it" in page
    assert f"repeats to {100 * measured_errors()['flow']['end']:.2g} % of the path" in page
