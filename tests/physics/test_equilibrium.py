"""At rest: the soil and the water bear the weight, nothing drifts, creep is bounded, on planes and on waves."""

import math

import numpy as np
import pytest
from multibody_models import QUICK, STILL

from exumob.ground.soil import Soil
from exumob.ground.terrain import Terrain
from exumob.simulation.run import simulate
from exumob.support.constants import GRAVITY
from exumob.water.conditions import Water

WATERS = {
    "dry": None,
    "D60/U0": Water.at_ratio(0.6),
    "D60/U1": Water.at_ratio(0.6, 1.0),
    "D100/U0": Water.at_ratio(1.0),
}


@pytest.fixture(scope="module")
def rest(vehicle):
    """Five seconds at rest on locked wheels, each case made once."""
    made = {}

    def run(soil, water="dry", terrain=None, duration=5.0):
        key = soil, water, str(terrain), duration
        if key not in made:
            made[key] = simulate(
                vehicle, Soil.published(soil), WATERS[water], STILL, "coefficients", duration=duration, micro_step=1e-3,
                macro_step=20e-3, terrain=terrain,
            )  # fmt: skip
        return made[key]

    return run


def imbalance(run):
    """Upward force of soil and water over the weight, less 1, at the start."""
    upward = float((run["soil_load"] + run["water_load"]).isel(time=0).sel(axis="z").sum())
    return upward / -float(run["gravity_load"].isel(time=0).sel(axis="z").sum()) - 1.0


@pytest.mark.parametrize(
    ("soil", "water"),
    [("LETE sand", "dry"), ("Sandy loam 15 %", "dry"), ("LETE sand", "D60/U0"), ("LETE sand", "D100/U0")],
)
def test_reactions_and_lift_sum_to_the_weight(rest, soil, water):
    """Spec: to 1e-6."""
    assert abs(imbalance(rest(soil, water))) < 1e-6


def test_reactions_and_lift_sum_to_the_weight_in_a_current(rest):
    """Spec: to 1e-6, in the default scenario too."""
    assert abs(imbalance(rest("LETE sand", "D60/U1"))) < 1e-6


@pytest.mark.parametrize("water", WATERS)
def test_equilibrium_is_symmetric(rest, water):
    """Left and right reactions agree to Newton's tolerance (2e-9 of the weight each), a head current included."""
    force = rest("LETE sand", water)["soil_force"].isel(time=0).values
    assert force[0::2, 2] == pytest.approx(force[1::2, 2], abs=2e-6)
    assert force[0::2, 1] == pytest.approx(-force[1::2, 1], abs=2e-6)


@pytest.mark.parametrize(
    ("soil", "water"),
    [("LETE sand", "dry"), ("Sandy loam 15 %", "dry"), ("LETE sand", "D60/U0"), ("LETE sand", "D100/U0")],
)
def test_no_drift_at_rest(rest, soil, water):
    """Over 5 s no body moves by more than 1 um: a spring compression of 4 mN, 1e-5 of the weight."""
    position = rest(soil, water)["position"].values
    assert np.abs(position - position[0]).max() < 1e-6
    assert np.abs(rest(soil, water)["yaw"].values).max() < 1e-6


def test_creep_in_a_current_is_bounded(rest):
    """Shear regularised at standstill creeps under the drag; below 1 mm/s it does not matter to an 8 s run (5 m)."""
    x = rest("LETE sand", "D60/U1")["position"].sel(body="hull", axis="x").values
    assert -5e-3 < x[-1] - x[0] < 0.0


@pytest.mark.parametrize("direction", [0.0, math.pi / 2, math.pi])
def test_stands_on_a_slope_with_bounded_creep(rest, direction):
    """On 5 degrees LETE sand holds (friction 31 degrees): it creeps downhill, at a bounded rate below 2 mm/s.

    The wheels carry the component of weight along the slope (2 %: the creep's start).
    """
    run = rest("LETE sand", terrain=Terrain.slope(math.radians(5.0), direction))
    uphill = np.array([math.cos(direction), math.sin(direction), 0.0])
    path = (run["position"].sel(body="hull").values - run["position"].sel(body="hull").values[0]) @ uphill
    assert -10e-3 < path[-1] < 0.0
    rates = np.diff(path[100::100])
    assert rates == pytest.approx(rates[-1], rel=0.05)  # creep, not a growing slide
    normal = run["soil_force"].isel(time=-1).sum("wheel").values
    assert normal == pytest.approx([0.0, 0.0, 57.0 * GRAVITY], abs=1e-3 * 57.0 * GRAVITY)


def test_stands_and_drives_on_a_height_field(vehicle, sand):
    """Waves of 2 cm: the run completes, the wheels follow the ground, wheel loads average to the weight."""
    x, y = np.arange(-2.0, 8.0, 0.25), np.arange(-2.0, 3.0, 0.25)
    hills = Terrain(
        heights=0.02 * np.sin(2 * x)[None, :] + 0.01 * np.cos(3 * y)[:, None], origin=(-2.0, -2.0), spacing=0.25
    )
    run = simulate(vehicle, sand, None, QUICK, duration=2.0, micro_step=5e-4, macro_step=20e-3, terrain=hills)
    assert run.attrs["status"] == "completed"
    assert float(run["position"].sel(body="hull", axis="x")[-1] - run["position"].sel(body="hull", axis="x")[0]) > 1.0
    assert float(run["soil_load"].sel(axis="z").sum("body").mean()) == pytest.approx(57.0 * GRAVITY, rel=0.02)
    for i, wheel in enumerate(run["wheel"].values):
        centers = run["position"].sel(body=wheel).values[::20]
        for center, sinkage in zip(centers, run["sinkage"].values[::20, i], strict=True):
            height, normal = hills.height_and_normal(*center[:2])
            assert 0.1 - (center[2] - height) * normal[2] == pytest.approx(sinkage, abs=1e-9)
