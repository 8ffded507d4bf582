"""Maps before anything runs: axes, levels and draws of wrong kinds, and maps that cannot fit."""

import math
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr

from exumob.mobility.crossing import Crossing, Limits
from exumob.mobility.map import Axis, MobilityMap, compute_map
from exumob.sweeps.experiment import amphibious_crossing

CROSSING = Crossing(replace(amphibious_crossing(), hydrodynamics="coefficients"), Limits())


@pytest.mark.parametrize("make, word", [
    (lambda: Axis("hull.mass", -math.inf, math.inf), r"Axis\.low = -inf"),
    (lambda: Axis("hull.mass", 40.0, math.nan), r"Axis\.high = nan"),
    (lambda: Axis("hull.mass", "40", 50.0), r"Axis\.low = '40'"), (lambda: Axis(3, 40.0, 50.0), r"Axis\.name = 3"),
    (lambda: Axis("hull.mass", 40.0, 50.0, 1.5), r"Axis\.cells = 1\.5"),
    (lambda: Axis("hull.mass", 40.0, 50.0, 0), r"Axis\.cells = 0"),
    (lambda: MobilityMap(CROSSING, seed=-1), r"MobilityMap\.seed = -1"),
    (lambda: MobilityMap(CROSSING, draws=True), r"MobilityMap\.draws = True"),
    (lambda: MobilityMap(CROSSING, levels=9), r"MobilityMap\.levels = 9"),
    (lambda: MobilityMap(3), r"MobilityMap\.crossing = 3"),
    (lambda: MobilityMap(CROSSING, x=Axis("hull.mass", 40.0, 50.0, 1000), y=Axis("soil.n", 0.6, 0.9, 1000), draws=1000),
     "1,002,001,000 cases are too many"),
    (lambda: MobilityMap(CROSSING, x=Axis("hull.mass", 40.0, 50.0, 1000), y=Axis("soil.n", 0.6, 0.9, 1000), draws=1,
                         scatter={}, levels=8), "nodes of the finest level.*of memory"),
    (lambda: compute_map(3, "map"), r"compute_map\.wanted = 3"),
])  # fmt: skip
def test_bad_maps_are_named(make, word):
    with pytest.raises(ValueError, match=word):
        make()


def test_a_crossing_says_what_its_numbers_mean():
    """Every number that it returns has a unit."""
    assert {"crossed", "failure", "failure_since", "speed", "drift", "tilt"} <= set(CROSSING.variables)
    assert CROSSING.variables["tilt"][0] == "rad"


@pytest.mark.parametrize(
    ("wide", "outside", "networks"), [(0.0, 0.0, "lane"), (0.6, 0.0, "whole range"), (0.6, 1.0, "lane")]
)
def test_the_line_of_trust_names_the_networks_that_answered_where_the_map_is_not_hatched(wide, outside, networks):
    wanted = MobilityMap(
        Crossing(amphibious_crossing(), Limits()), Axis("water.current_speed", 0.0, 1.0),
        Axis("water.depth_ratio", 0.4, 0.6), scatter={},
    )  # fmt: skip
    shape = ("panel", "y", "x"), np.zeros((1, 2, 2))
    mapped = xr.Dataset({"wide_range": shape, "out_of_range": shape}).copy(deep=True)
    mapped["wide_range"][0, 1, 1], mapped["out_of_range"][0, 1, 1] = wide, outside
    line = wanted.trust(mapped)["trust"]
    assert ("learnt from" in line) == (networks == "whole range"), line
