"""Froude's law: a vehicle of the same form in another size, on soil scaled like it, does the same in its own time."""

from dataclasses import replace

import numpy as np
import pytest
from made_up_networks import SMALL, made_up

from exumob.driving.maneuver import LaneChange
from exumob.flow import FlowSettings, Grid
from exumob.flow.vehicle_window import vehicle_window
from exumob.ground.soil import Soil
from exumob.simulation.run import simulate
from exumob.simulation.water_models import hydrodynamics_named
from exumob.surrogates.model import SurrogateHydrodynamics
from exumob.surrogates.vehicle_shape import times_as_large
from exumob.towing_tank.motion import CaptiveMotion
from exumob.towing_tank.run import captive_run
from exumob.vehicle.scaled import scaled_vehicle
from exumob.vehicle.vehicle_file import load_vehicle
from exumob.water.conditions import Water
from vehicle_models.amphibious import amphibious_vehicle

SIZE = 4.0
ROOT = SIZE**0.5
LOADS = SIZE ** np.array([3.0, 3.0, 3.0, 4.0, 4.0, 4.0])
CAR = amphibious_vehicle()
LARGE = scaled_vehicle(CAR, SIZE)
WATER, DEEP = Water.at_ratio(0.55, 0.6), Water(SIZE * 0.11, ROOT * 0.6)


def scaled_soil(soil):
    """A soil whose pressures at scaled sinkages are `SIZE` times as large."""
    return replace(
        soil, k_c=soil.k_c * SIZE ** (2.0 - soil.n), k_phi=soil.k_phi * SIZE ** (1.0 - soil.n),
        cohesion=soil.cohesion * SIZE, shear_modulus_x=soil.shear_modulus_x * SIZE,
        shear_modulus_y=soil.shear_modulus_y * SIZE, damping=soil.damping / ROOT,
    )  # fmt: skip


def driven(car, soil, water, model, time):
    """A lane change of 2.4 s of the small vehicle; `time`: what is 1 s to it."""
    maneuver = LaneChange(np.radians(20.0), 1.0 * time, 2.4 * time, 10.0 / time, 0.5 * time)
    return simulate(
        car, soil, water, maneuver, model, duration=2.4 * time, micro_step=5e-4 * time, macro_step=20e-3 * time,
        record_step=20e-3 * time,
    )  # fmt: skip


@pytest.mark.parametrize("model", ["networks", "calibrated", "coefficients"])
def test_a_drive_is_the_same_in_another_size(sand, model):
    """Vehicle, soil, coefficients and networks with their memory; what creeps at rest is no part of the law."""
    small = driven(CAR, sand, WATER, model, 1.0)
    large = driven(LARGE, scaled_soil(sand), DEEP, model, ROOT)
    hull = [
        run["position"].sel(body="hull").values - run["position"].sel(body="hull").values[0] for run in (small, large)
    ]
    assert np.abs(hull[1] / SIZE - hull[0]).max() < 2e-3 * np.linalg.norm(hull[0][-1])
    assert hull[0][-1, 0] > 0.8
    loads = [run["water_wrench"].values[5:] for run in (small, large)]
    off = np.sqrt(np.mean((loads[1] / LOADS - loads[0]) ** 2, axis=0))
    assert (off < 0.02 * np.sqrt(np.mean(loads[0] ** 2, axis=0)).max(axis=0)).all()
    if model == "networks":
        shares = [run["hydrodynamics_fallback_share"].values for run in (small, large)]
        assert shares[0].mean() < 0.05 and np.abs(shares[1] - shares[0]).mean() < 1e-3
        bars = [run["hydrodynamics_load_error_bar"].values[5:] for run in (small, large)]
        known = np.isfinite(bars[0]) & np.isfinite(bars[1])
        assert known.mean() > 0.9
        np.testing.assert_allclose((bars[1] / LOADS)[known], bars[0][known], rtol=0.1)


def test_the_flow_follows_froudes_law():
    """A captive run of 0.1 s on coarse cells, the same grid in both sizes, first impact and all; 4 and 2 are exact.

    What has dimensions follows the reference length; viscosity does not, which is too little to be seen here.
    """
    found = []
    grid = vehicle_window(CAR, 0.05, WATER)
    for car, water, size in ((CAR, WATER, 1.0), (LARGE, DEEP, SIZE)):
        time = size**0.5
        motion = CaptiveMotion(0.8 * time, wheel_speed=10.0 / time, ramp_time=0.04 * time)
        run = captive_run(
            car, water, motion, cell_size=0.05 * size, duration=0.1 * time, interval=5e-3 * time, allow_coarse=True,
            settings=FlowSettings(threads=1),
            grid=Grid(size * grid.x_faces, size * grid.y_faces, size * grid.z_faces),
        )  # fmt: skip
        found.append(run["force"].sel(body="hull").values / size**3)
    assert np.abs(found[1] - found[0]).max() < 1e-3 * np.abs(found[0]).max()


def test_all_of_a_vehicle_is_scaled():
    assert LARGE.mass == pytest.approx(SIZE**3 * CAR.mass)
    assert LARGE.hull.height == SIZE * CAR.hull.height and LARGE.wheelbase == SIZE * CAR.wheelbase
    assert LARGE.suspension.stop_softening == SIZE * CAR.suspension.stop_softening
    back = scaled_vehicle(LARGE, 1.0 / SIZE, name=CAR.name)
    assert times_as_large(back, {"wheelbase": CAR.wheelbase, "hull.mesh": None}) == 1.0
    for name in ("stiffness", "damping", "upright_mass"):
        assert getattr(back.suspension, name) == pytest.approx(getattr(CAR.suspension, name))
    car = load_vehicle("vehicle_models/light_4x4.py")
    half = scaled_vehicle(car, 0.5)
    assert half.suspension.wishbones.upper_length == 0.5 * car.suspension.wishbones.upper_length
    assert [box.length for box in half.hull.boxes] == [0.5 * box.length for box in car.hull.boxes]
    assert half.hull.inertia == pytest.approx([value * 0.5**5 for value in car.hull.inertia])


def test_what_has_another_form_or_cannot_be_scaled_is_refused():
    trained = SurrogateHydrodynamics().networks[0].about["geometry"]
    assert times_as_large(LARGE, trained) == pytest.approx(SIZE)
    wide = replace(LARGE, track=1.05 * LARGE.track)
    assert times_as_large(wide, trained) is None
    with pytest.raises(ValueError, match="has another shape"):
        hydrodynamics_named("networks", wide, DEEP)
    with pytest.raises(ValueError, match=r"networks \(paper-lstm.*\) sample the past at .* is 4 times as large"):
        SurrogateHydrodynamics("paper-lstm").start(LARGE, DEEP, 20e-3)
    mixed = SurrogateHydrodynamics([made_up(SMALL, CAR), made_up(SMALL, LARGE)])
    with pytest.raises(ValueError, match=r"for vehicles of several sizes: amphibious is 1, 0\.25 times as large"):
        mixed.start(CAR, WATER, 20e-3)
    with pytest.raises(ValueError, match=r"Hull\.mass = 0\.006.* kg is outside the plausible range"):
        scaled_vehicle(CAR, 0.05)
    meshed = replace(CAR, hull=replace(CAR.hull, mesh="hull.stl"))
    with pytest.raises(ValueError, match=r"scaled_vehicle\.vehicle: Hull\.mesh = hull\.stl keeps its size"):
        scaled_vehicle(meshed, 2.0)


def test_the_line_of_trust_flags_it(sand):
    run = simulate(LARGE, Soil.published("LETE sand"), DEEP, None, duration=0.1, micro_step=1e-3, macro_step=20e-3)
    assert run.attrs["hydrodynamics"] == "SurrogateHydrodynamics" and run.attrs["trust_status"] == "not validated"
    assert "the form of the one that the networks know, 4 times as large" in run.attrs["trust"]
