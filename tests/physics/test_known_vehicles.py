"""Vehicles that people know by class: they settle, float where Archimedes says, drive straight and change the lane."""

import math

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from exumob import CoefficientHydrodynamics, ConstantSteer, LaneChange, NoWater, Soil, Water, simulate
from exumob.vehicle.wheel_motion import tyre_poses
from exumob.water.hydrostatics import wetted
from exumob.water.wetted_surface import hull_surface, wheel_surface
from vehicle_models.large_4x4 import large_4x4
from vehicle_models.light_4x4 import light_4x4
from vehicle_models.small_car import small_car

CARS = [small_car, large_4x4]
LOAM = "Grenville loam 24 %"


def floating_depth(vehicle):
    """Depth of still water that bears the vehicle with its wheels still on the ground [m]."""
    hull, wheel = hull_surface(vehicle), wheel_surface(vehicle)

    def lift(depth):
        volume = wetted(hull, np.eye(3), vehicle.hull_origin, depth).submerged_volume
        volume += sum(wetted(wheel, np.eye(3), c, depth).submerged_volume for c in vehicle.wheel_centers)
        return 1000.0 * volume - vehicle.mass

    return brentq(lift, 0.01, 2.0)


@pytest.mark.parametrize(
    ("make", "mass", "computed", "limit", "measured"),
    [
        (small_car, 1052.0, 0.304, 0.3, 0.60), (large_4x4, 2500.0, 0.528, 0.5, 0.95),
        (light_4x4, 1340.0, 0.483, None, None),
    ],
)  # fmt: skip
def test_floating_depth_beside_published_ones(make, mass, computed, limit, measured):
    """`limit`: deepest still water by Shand et al. (2011); `measured`: afloat in UNSW's tank (Smith et al. 2017).

    The whole body lifts here; that of a real car fills from below, so it floats later than computed.
    """
    vehicle = make()
    assert vehicle.mass == pytest.approx(mass, abs=1.0)
    depth = floating_depth(vehicle)
    assert depth == pytest.approx(computed, abs=1e-3)
    if limit is not None:
        assert abs(depth - limit) < 0.05 and depth < measured


@pytest.mark.parametrize("make", CARS)
@pytest.mark.parametrize(("soil", "depth"), [("LETE sand", 0.0), (LOAM, 0.15)])
def test_drives_straight(make, soil, depth):
    """No side force: the path stays on the x axis; the loads of the wheels are the weight less the water's lift."""
    vehicle = make()
    water = Water(depth) if depth else None
    model = CoefficientHydrodynamics() if depth else NoWater()
    maneuver = ConstantSteer(0.0, 3.0 / vehicle.wheel.radius)
    run = simulate(vehicle, Soil.published(soil), water, maneuver, model, duration=2.0, record_step=0.02)
    assert run.attrs["start"] == "at rest" and run.attrs["verdict"] == "drives"
    position = run["position"].sel(body="hull").values
    assert np.abs(position[:, 1]).max() < 1e-6 and position[-1, 0] > 2.5
    assert float(run["keel_clearance"].min()) > 0.02
    lift = 0.0
    if depth:
        lift = float(run["water_load"].sel(axis="z").sum("body")[0])
        assert lift > 0.02 * 9.81 * vehicle.mass
    borne = float(run["soil_force"].sel(axis="z").sum("wheel")[0])
    assert borne + lift == pytest.approx(9.81 * vehicle.mass, rel=5e-3)
    front = float(run["soil_force"].sel(axis="z", wheel=["front_left", "front_right"]).sum("wheel")[0])
    if not depth:
        share = 0.5 + (vehicle.hull.mass * vehicle.hull.center_of_mass_x / vehicle.mass) / vehicle.wheelbase
        assert front / borne == pytest.approx(share, abs=0.02)


@pytest.mark.parametrize("make", CARS)
def test_changes_the_lane_and_wheels_stay_clear_of_the_arches(make):
    """To the left and back; the wheels move in the hull's frame as `tyre_poses` says, on which the arches rest."""
    vehicle = make()
    spin = 4.0 / vehicle.wheel.radius
    maneuver = LaneChange(math.radians(15.0), 0.3, 2.3, spin, 0.4, start_speed=spin)  # it starts rolling
    run = simulate(vehicle, Soil.published(LOAM), Water(0.15), maneuver, CoefficientHydrodynamics(), duration=2.6)
    assert run.attrs["verdict"] == "drives"
    yaw = np.degrees(run["yaw"].sel(body="hull").values)
    assert run["position"].sel(body="hull", axis="y").values[-1] > 0.5
    assert yaw.max() > 8.0 and yaw[-1] < 0.7 * yaw.max()
    for axle, number in zip(vehicle.axles, (0, 2), strict=True):
        assert -axle.rebound < float(run["suspension_stroke"][:, number].min())
        assert float(run["suspension_stroke"][:, number].max()) < axle.bump


def test_wheels_move_in_the_hull_as_the_arches_expect():
    """Wishbones, steered and at travel: places and axles of a run against `tyre_poses` at its strokes and angles."""
    truck = light_4x4()
    maneuver = LaneChange(math.radians(25.0), 0.3, 2.0, 4.0 / truck.wheel.radius, 0.4)
    run = simulate(truck, Soil.published(LOAM), None, maneuver, duration=1.6)
    position = run["position"].values
    turn = Rotation.from_quat(run["quaternion"].sel(quaternion_component=list("xyzw")).values.reshape(-1, 4))
    rotation = turn.as_matrix().reshape(*position.shape[:2], 3, 3)
    arms = position[:, 1:] - position[:, :1]
    local = np.einsum("tji,twj->twi", rotation[:, 0], arms) + truck.hull_origin - truck.wheel_centers
    axles = np.einsum("tji,twj->twi", rotation[:, 0], rotation[:, 1:, :, 1])
    for wheel in range(4):
        side = 1.0 if wheel % 2 == 0 else -1.0
        angles = run["steering_angle"].values[:, wheel] if wheel < 2 else np.zeros(len(position))
        centers, directions = tyre_poses(truck.axles[wheel // 2], side * angles, local[:, wheel, 2])
        assert np.abs(local[:, wheel] * [1.0, side, 1.0] - centers).max() < 5e-4
        assert np.abs(axles[:, wheel] * [side, 1.0, side] - directions).max() < 2e-3
    assert np.ptp(local[:, 0, 2]) > 0.005 and np.abs(run["steering_angle"].values).max() > 0.4
