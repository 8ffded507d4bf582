"""Vehicles come back from results, whatever is refused today and whatever an older result does not hold."""

import json
from dataclasses import asdict, replace

import pytest

from exumob.support.quantities import unusual
from exumob.vehicle.stored import vehicle_from
from vehicle_models.amphibious import amphibious_vehicle
from vehicle_models.large_4x4 import large_4x4
from vehicle_models.light_4x4 import light_4x4
from vehicle_models.small_car import small_car


def written(vehicle):
    return json.loads(json.dumps(asdict(vehicle), default=str))


@pytest.mark.parametrize("make", [amphibious_vehicle, light_4x4, small_car, large_4x4], ids=lambda f: f.__name__)
def test_a_vehicle_comes_back(make):
    vehicle = make()
    assert vehicle_from(written(vehicle)) == vehicle
    with_mesh = replace(amphibious_vehicle(), hull=replace(amphibious_vehicle().hull, mesh="hull.stl"))
    assert vehicle_from(written(with_mesh)) == with_mesh


def test_results_from_before_there_were_arches_can_be_drawn():
    """The light 4x4 of old had no arches, and its wheels entered the hull: it is not refused."""
    stored = written(light_4x4())
    for name in ("boxes", "wheel_arches", "stern_length", "stern_height"):
        del stored["hull"][name]
    stored["hull"]["width"] = 1.10
    vehicle = vehicle_from(stored)
    assert (vehicle.hull.width, vehicle.hull.boxes, vehicle.hull.wheel_arches) == (1.10, (), None)


def test_values_that_were_meant_come_back():
    vehicle = amphibious_vehicle()
    stiff = replace(vehicle.suspension, stiffness=unusual(1e4))
    heavy = replace(vehicle, hull=replace(vehicle.hull, mass=unusual(1e4)), suspension=stiff)
    assert vehicle_from(written(heavy)).hull.mass == 1e4


def test_a_field_that_is_missing_is_named():
    stored = written(small_car())
    del stored["hull"]["length"]
    with pytest.raises(ValueError, match=r"Hull\.length is not stored"):
        vehicle_from(stored)
