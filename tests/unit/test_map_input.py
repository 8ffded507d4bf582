"""Maps before anything runs: axes, levels and draws of wrong kinds, and maps that cannot fit."""

import math
from dataclasses import replace

import pytest

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
