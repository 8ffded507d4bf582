"""What a run leaves behind in the memory when its result is dropped: nothing, so that sweeps may be of any length."""

import gc
from collections import Counter

import numpy as np
import pytest

from exumob.driving.maneuver import lane_change
from exumob.driving.path_following import PathFollowing
from exumob.simulation.run import simulate
from exumob.support.errors import SimulationError
from exumob.surrogates.model import SurrogateHydrodynamics
from exumob.vehicle.point_force import PointForce
from exumob.water.conditions import Water

WATER = Water.at_ratio(0.6, 1.0)
BROKEN = PointForce(lambda time, position, velocity: (0.0, 0.0, np.nan if time > 0.05 else 0.0), (0.0, 0.0, 0.0))


def alive():
    """Objects of exumob's classes, by class."""
    gc.collect()
    kinds = (type(one) for one in gc.get_objects())
    return Counter(f"{k.__module__}.{k.__qualname__}" for k in kinds if str(k.__module__).startswith("exumob"))


@pytest.mark.parametrize(
    "given",
    [
        {"hydrodynamics": "coefficients"},
        {"hydrodynamics": "coefficients", "user_loads": True},
        {"hydrodynamics": "coefficients", "forces": (BROKEN,)},  # breaks down
        {"hydrodynamics": SurrogateHydrodynamics()},
        {"hydrodynamics": "coefficients", "maneuver": PathFollowing()},
        {"water": None},
    ],
    ids=["coefficients", "user loads", "breaks down", "networks", "driver", "dry"],
)
def test_a_run_leaves_nothing_behind(vehicle, sand, given):
    def run():
        try:
            given_too = {"water": WATER, "maneuver": lane_change(), "duration": 0.1, "micro_step": 1e-3} | given
            simulate(vehicle, sand, **given_too)
        except SimulationError:
            return "forces" in given
        return "forces" not in given

    assert run()
    before = alive()
    assert run()
    assert dict(alive() - before) == {}
