"""Fitted loads of the vehicle's own waves: similarity, symmetry, limits, their file, and as a model in a run."""

import math
from dataclasses import replace

import numpy as np
import pytest

from exumob.driving.maneuver import lane_change
from exumob.ground.soil import Soil
from exumob.ground.terrain import Terrain
from exumob.simulation.run import simulate
from exumob.simulation.water_models import hydrodynamics_named
from exumob.support.errors import SimulationError
from exumob.support.rotations import about_x, about_y, about_z
from exumob.vehicle.motion import WRENCH_COMPONENTS
from exumob.water.calibrated import CalibratedHydrodynamics
from exumob.water.coefficients import CoefficientHydrodynamics
from exumob.water.conditions import Water
from exumob.water.wave_loads import (
    FORMS,
    KINDS,
    WaveCoefficients,
    fitted_coefficients,
    vehicle_lengths,
    wave_loads,
)
from vehicle_models.amphibious import amphibious_vehicle
from vehicle_models.light_4x4 import light_4x4
from vehicle_models.small_car import small_car

WATER = Water(0.12, 0.8, math.pi)
MIRRORED = np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])
SWAPPED = [0, 2, 1, 4, 3]


def loads(vehicle, water, position, rotation, velocity, spin, lengths=None):
    return wave_loads(
        lengths or vehicle_lengths(vehicle), water.density, water.over(), position, rotation, velocity, spin,
        fitted_coefficients().by_body,
    )  # fmt: skip


def motion(vehicle, scale=1.0):
    """A vehicle that goes ahead and a little aside, turns, leans and pitches; lengths times a scale."""
    arms = np.vstack([np.zeros(3), vehicle.wheel_centers - vehicle.hull_origin])
    turn = about_z(0.2) @ about_y(0.01) @ about_x(-0.02)
    spin = np.tile([0.02, 0.03, 0.4], (5, 1)) / math.sqrt(scale)
    position = scale * (np.array([1.0, 2.0, vehicle.hull_origin[2]]) + arms @ turn.T)
    velocity = math.sqrt(scale) * (np.array([0.9, 0.1, 0.0]) + np.cross([0.02, 0.03, 0.4], arms @ turn.T))
    rotations = np.array([turn, turn @ about_z(0.3), turn @ about_z(0.3), turn, turn])
    return position, rotations, velocity, spin


def test_they_follow_froudes_law(vehicle):
    """Three times as large, at the same Froude number: forces 27 times, moments 81 times; to round-off."""
    small = loads(vehicle, WATER, *motion(vehicle))
    larger = Water(3.0 * WATER.depth, math.sqrt(3.0) * WATER.current_speed, math.pi)
    lengths = vehicle_lengths(vehicle)
    grown = lengths._replace(**{
        name: 3.0 * getattr(lengths, name) for name in lengths._fields if name != "rear_exposed"
    })  # fmt: skip
    large = loads(vehicle, larger, *motion(vehicle, 3.0), grown)
    np.testing.assert_allclose(large[:, :3], 27.0 * small[:, :3], rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(large[:, 3:], 81.0 * small[:, 3:], rtol=1e-9, atol=1e-9)
    assert np.abs(small[0]).min() > 1e-3  # no load is left out


def test_they_are_mirrored_with_the_motion(vehicle):
    position, rotation, velocity, spin = motion(vehicle)
    flip = np.array([1.0, -1.0, 1.0])
    found = loads(
        vehicle, WATER, (position * flip)[SWAPPED], (flip[:, None] * rotation * flip)[SWAPPED],
        (velocity * flip)[SWAPPED], (-spin * flip)[SWAPPED],
    )  # fmt: skip
    expected = loads(vehicle, WATER, position, rotation, velocity, spin)[SWAPPED] * MIRRORED
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-12)


def test_drag_resists_and_grows_with_the_speed(vehicle):
    """In reverse it turns round, and so does the trim; the lift stays."""
    position, _, _, spin = motion(vehicle)
    level = np.tile(np.eye(3), (5, 1, 1))
    drags = []
    for speed in (0.3, 0.8, 1.6, -0.8):
        velocity = np.tile([speed, 0.0, 0.0], (5, 1))
        drags.append(loads(vehicle, Water(0.12), position, level, velocity, 0.0 * spin))
    force = np.array([each[:, 0] for each in drags])
    assert (force[:3, :3] < 0.0).all() and (np.diff(force[:3], axis=0) < 0.0).all()
    np.testing.assert_allclose(force[3], -force[1])
    assert drags[3][0, 2] == drags[1][0, 2] and drags[3][0, 4] == -drags[1][0, 4]


def test_at_rest_on_land_and_above_the_water_there_are_none(vehicle):
    position, rotation, velocity, spin = motion(vehicle)
    assert not loads(vehicle, Water(0.12), position, rotation, 0.0 * velocity, 0.0 * spin).any()
    thin = Water(0.03, 0.8, math.pi)  # the keel is 78 mm above ground: a heap as high as the water does not reach it
    assert not loads(vehicle, thin, position, rotation, velocity, spin)[0].any()
    above = position + np.array([0.0, 0.0, 1.0])
    assert not loads(vehicle, WATER, above, rotation, velocity, spin).any()
    hill = Water(None, 0.0, level=-0.05)
    over = hill.over(Terrain())
    dry = wave_loads(
        vehicle_lengths(vehicle), 1000.0, over, position, rotation, velocity, spin, fitted_coefficients().by_body
    )
    assert not dry.any()


@pytest.mark.parametrize("make", [amphibious_vehicle, light_4x4, small_car], ids=lambda f: f.__name__)
def test_beyond_the_fitted_runs_they_go_on_as_at_their_edge(make):
    """In fast and deep water: the load over the square of the speed does not depend on the speed any more, and the lift
    of the hull is below a tenth of the stagnation pressure. At a bank each wheel has the depth at its place."""
    vehicle = make()
    level = np.tile(np.eye(3), (5, 1, 1))
    arms = np.vstack([np.zeros(3), vehicle.wheel_centers - vehicle.hull_origin])
    position = arms + np.array([0.0, 0.0, vehicle.hull_origin[2]])
    depth = 1.2 * vehicle.wheel.diameter
    of_speed = []
    for froude in (1.6, 2.4, 5.0):
        speed = froude * math.sqrt(9.81 * depth)
        velocity = np.tile([speed, 0.0, 0.0], (5, 1))
        of_speed.append(loads(vehicle, Water(depth), position, level, velocity, 0.0 * velocity) / speed**2)
    np.testing.assert_allclose(of_speed[1:], [of_speed[0]] * 2, rtol=1e-9, atol=1e-12)
    lengths = vehicle_lengths(vehicle)
    assert of_speed[0][0, 0] < 0.0
    assert abs(of_speed[0][0, 2]) < 0.1 * 500.0 * lengths.hull_length * lengths.hull_beam
    bank = Water(None, level=0.5 * vehicle.wheel.diameter).over(Terrain.slope(-0.2))
    velocity = np.tile([1.0, 0.0, 0.0], (5, 1))
    found = wave_loads(
        lengths, 1000.0, bank, position - [0.4 * vehicle.wheelbase, 0.0, 0.0], level, velocity,
        0.0 * velocity, fitted_coefficients().by_body,
    )  # fmt: skip
    assert np.isfinite(found).all() and (found[1:3, 0] < 0.0).all()


def test_rear_wheels_within_the_beam_are_in_the_wake(vehicle):
    """Those of the amphibious vehicle stand beside its hull, those of a 4x4 in arches of a body that covers them."""
    assert vehicle_lengths(vehicle).rear_exposed == 1.0 and vehicle_lengths(light_4x4()).rear_exposed == 0.0
    wider = replace(light_4x4(), track=light_4x4().track + 0.2)  # by 78 mm a side beyond the hull's
    assert vehicle_lengths(wider).rear_exposed == pytest.approx(0.0775 / wider.wheel.width)


def test_file_round_trip(tmp_path):
    found = fitted_coefficients()
    found.save(tmp_path / "waves.json")
    again = WaveCoefficients.load(tmp_path / "waves.json")
    np.testing.assert_allclose(again.values, found.values, rtol=1e-12)
    assert again.about == found.about
    for n, kind in enumerate(KINDS):
        for k, name in enumerate(WRENCH_COMPONENTS):
            assert not found.values[n, k, len(FORMS[kind].get(name, ())) :].any()
            assert found.values[n, k].any() == (name in FORMS[kind])


@pytest.mark.parametrize("ratio", [0.4, 0.6])
def test_parts_of_a_run_add_up_and_a_restart_has_its_bits(vehicle, sand, tmp_path, ratio):
    water = Water.at_ratio(ratio, 1.0)
    given = vehicle, sand, water, lane_change(), "calibrated"
    steps = {"duration": 0.5, "micro_step": 1e-3, "macro_step": 20e-3}
    whole = simulate(*given, **steps)
    assert whole.attrs["hydrodynamics"] == "CalibratedHydrodynamics"
    assert np.abs(whole["hydrodynamics_wave_load"].sel(body="hull", component="Fx")).max() > 0.5

    def stop(time):
        if time > 0.3:
            raise RuntimeError("power cut")

    with pytest.raises(SimulationError):
        simulate(*given, **steps, checkpoint=tmp_path / "run.npz", progress=stop)
    resumed = simulate(*given, **steps, checkpoint=tmp_path / "run.npz", resume=True)
    for name in ("position", "water_wrench", "hydrodynamics_wave_load"):
        np.testing.assert_array_equal(whole[name], resumed[name])


def test_without_coefficients_it_is_the_published_model(vehicle, sand):
    none = WaveCoefficients(0.0 * fitted_coefficients().values, {})
    steps = {"duration": 0.3, "micro_step": 1e-3, "macro_step": 20e-3}
    a, b = (
        simulate(vehicle, sand, WATER, lane_change(), model, **steps)
        for model in (CalibratedHydrodynamics(waves=none), CoefficientHydrodynamics())
    )
    np.testing.assert_array_equal(a["position"], b["position"])


def test_it_is_known_by_name_for_any_vehicle(vehicle):
    assert isinstance(hydrodynamics_named("calibrated", light_4x4(), WATER), CalibratedHydrodynamics)
    run = simulate(vehicle, Soil.published("LETE sand"), Water.at_ratio(0.5, 0.5), None, "calibrated", duration=0.1)
    assert run.attrs["trust_model"] == "calibrated"
