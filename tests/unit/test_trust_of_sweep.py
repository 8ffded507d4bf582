"""The line of trust of a sweep: what differs is named once, and what its runs found of networks counts."""

import math
from dataclasses import replace

from exumob.sweeps.experiment import amphibious_crossing, amphibious_lane_change
from exumob.sweeps.trust_of_sweep import trust_of_sweep


def test_a_sweep_names_each_quantity_once_with_its_range():
    experiment = replace(amphibious_lane_change(), hydrodynamics="networks")
    cases = [{"water.current_speed": u, "soil": s} for u in (0.5, 1.02, 1.05) for s in ("LETE sand", "Lunar soil")]
    found = trust_of_sweep(experiment, cases)
    soils = "Grenville loam 24 %, LETE sand, North Gower clayey loam 46 %"
    assert found["trust_beyond"] == f"duration 8 s (4 to 6 s); soil Lunar soil ({soils})"
    both = trust_of_sweep(experiment, [{"hydrodynamics": "networks"}, {"hydrodynamics": "coefficients"}])
    assert both["trust"].count("Soil:") == 2
    crossing = replace(amphibious_crossing(), duration=4.0, hydrodynamics="networks")
    assert (
        trust_of_sweep(crossing, [{"water.depth_ratio": 0.4}, {"water.depth_ratio": 0.6}])["trust_status"] == "measured"
    )
    assert (
        trust_of_sweep(experiment, [{"soil.c1": 0.9}, {"soil.c1": 0.1}])["trust_status"] == "beyond"
    )  # 0.9 is refused


def test_a_sweep_is_judged_by_what_its_runs_found_of_networks():
    """The largest share of the networks for the whole range, and every run that left their range, count."""
    experiment = replace(amphibious_lane_change(), hydrodynamics="networks")
    cases = [{"water.current_speed": u} for u in (0.5, 0.6, 0.7)]
    lane = trust_of_sweep(experiment, cases)
    assert lane["trust_status"] == "measured" and "lane changes that they had not seen" in lane["trust"]
    little = trust_of_sweep(experiment, cases, {"wide_range_share": [0.0, 0.04, math.nan], "forward": [3.0, 2.0, 1.0]})
    assert little["trust"] == lane["trust"]
    wide = trust_of_sweep(experiment, cases, {"wide_range_share": [0.0, 0.3, math.nan]})
    assert "5 drives kept apart" in wide["trust"]
    left = trust_of_sweep(experiment, cases, {"out_of_range_share": [0.0, 0.4, 0.0]})
    assert "outside the networks' training range for 40 % of the time" in left["trust_beyond"]


def test_a_sweep_names_what_lies_beyond_in_any_of_its_cases():
    """Coefficients that are swept are not the published ones; a start in motion was not measured."""
    base = replace(amphibious_lane_change(), hydrodynamics="coefficients")
    published = base.coefficients.hull_surge_drag
    cases = [{"hydrodynamics.hull_surge_drag": share * published} for share in (1.0, 0.5)]
    assert trust_of_sweep(base, [{}])["trust_status"] == "measured"
    assert "coefficients" in trust_of_sweep(base, cases)["trust_beyond"]
    assert "initial speed 2 m/s" in trust_of_sweep(replace(base, initial_speed=2.0), [{}])["trust_beyond"]
