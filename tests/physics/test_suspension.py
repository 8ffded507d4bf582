"""Double wishbones and bump stops against their own geometry and force laws."""

import math

import numpy as np
import pytest
from multibody_models import CALM, STILL, TRUCK_TURN, matrices, prepared
from scipy.optimize import fsolve

from exumob.multibody.applied_loads import stop_force
from exumob.simulation.run import simulate
from vehicle_models.light_4x4 import light_4x4

# -- double wishbone ---------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def truck_run(sand):
    truck = light_4x4()
    return simulate(truck, sand, None, TRUCK_TURN, duration=2.5, micro_step=5e-4, macro_step=20e-3)


def test_wishbone_vehicle_stands_at_ride_height(truck_run):
    """The springs are preloaded for the static load: stroke 0 to 1e-3 of the travel (90 mm), level to 1e-4 rad."""
    assert np.abs(truck_run["suspension_stroke"].isel(time=0)).max() < 9e-5
    assert np.abs(truck_run["pitch"].isel(time=0)).max() < 2e-3  # the wheels of the heavier axle sink in deeper
    assert np.abs(truck_run["roll"].isel(time=0).sel(body="hull")).max() < 1e-6


def test_wishbone_constraint_errors(truck_run):
    error = truck_run["constraint_error"]
    assert float(error.sel(constraint_level="position").max()) < 1e-6
    assert float(error.sel(constraint_level="velocity").max()) < 1e-4


def test_ackermann_angles_reach_the_wheels(truck_run):
    """Heading of each front wheel in the hull against the vehicle's own function: camber changes it by 1e-3 at most."""
    truck = light_4x4()
    n = int(np.argmin(np.abs(truck_run["time"].values - 0.875)))  # the first peak
    expected = [a[0] for a in truck.steering_angles(TRUCK_TURN.steering(float(truck_run["time"][n])))]
    assert expected[0] - expected[1] > 0.02
    assert truck_run["steering_angle"].values[n] == pytest.approx(expected, abs=1e-9)
    rotation = matrices(truck_run["quaternion"].values[n])
    for i in range(2):
        relative = rotation[0].T @ rotation[1 + i]
        assert math.atan2(relative[1, 0], relative[0, 0]) == pytest.approx(expected[i], abs=2e-3)


@pytest.mark.parametrize("push", [2000.0, -2000.0])
def test_camber_follows_the_linkage(sand, push):
    """Pressed down (bump) the wheel's top leans inboard, in rebound outboard; 1e-4 rad of the planar linkage."""
    truck = light_4x4()
    load = CALM.copy()
    load[0, 2] = -push
    model = prepared(truck, sand, STILL, load=load)
    states = model.present()
    stroke = float((states.rotation[0, 0].T @ (states.position[0, 1] - states.position[0, 0]))[2]) - float(
        (truck.wheel_centers - truck.hull_origin)[0, 2]
    )
    assert stroke * push > 0.0
    assert abs(stroke) > 0.01
    arms = truck.suspension.wishbones
    reach = math.sqrt(arms.upper_length**2 - arms.upper_pivot_drop**2)

    def closure(unknown):
        y, lean = unknown  # of the wheel centre, and of the upright (top outward)
        c, s = math.cos(lean), math.sin(lean)
        residuals = []
        for length, height, pivot_y, pivot_z in (
            (arms.upper_length, arms.upper_height, -reach, arms.upper_height - arms.upper_pivot_drop),
            (arms.lower_length, -arms.lower_height, -arms.lower_length, -arms.lower_height),
        ):
            inset = -arms.ball_joint_inset
            ball_y, ball_z = y + c * inset + s * height, stroke - s * inset + c * height
            residuals.append(math.hypot(ball_y - inset - pivot_y, ball_z - pivot_z) - length)
        return residuals

    expected = fsolve(closure, [0.0, 0.0])[1]
    lean = math.asin((states.rotation[0, 0].T @ states.rotation[0, 1])[1, 2])
    assert lean == pytest.approx(expected, abs=1e-4)
    assert lean * push < 0.0


# -- bump stops --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("penetration", [-1e-3, 0.0, 5e-4, 2e-3, 2.5e-3, 1e-2])
def test_energy_of_a_stop_is_the_integral_of_its_force(penetration):
    """Gauss-Legendre over both pieces is exact for quadratics: relative 1e-12."""
    stiffness, softening = 5e4, 2e-3
    x, w = np.polynomial.legendre.leggauss(3)
    energy = 0.0
    for low, high in ((0.0, min(max(penetration, 0.0), softening)), (softening, max(penetration, softening))):
        half = 0.5 * (high - low)
        energy += half * sum(w[i] * stop_force(low + half * (1 + x[i]), stiffness, softening)[0] for i in range(3))
    assert stop_force(penetration, stiffness, softening)[1] == pytest.approx(energy, rel=1e-12, abs=1e-15)


def test_stop_force_is_smooth_and_reaches_its_stiffness():
    force = [stop_force(x, 5e4, 2e-3)[0] for x in (2e-3 - 1e-9, 2e-3 + 1e-9, 5e-3, 6e-3)]
    assert force[1] - force[0] == pytest.approx(5e4 * 2e-9, rel=1e-2)
    assert force[3] - force[2] == pytest.approx(5e4 * 1e-3, rel=1e-9)
    assert stop_force(-1.0, 5e4, 2e-3) == (0.0, 0.0)


def test_stops_limit_the_travel(vehicle, sand):
    """1.5 kN pressed on the hull: beyond the springs' 20 mm the stops carry the rest, some 5 mm in."""
    load = CALM.copy()
    load[0, 2] = -1500.0
    stroke = prepared(vehicle, sand, STILL, load=load).loads["stroke"][0]
    for value in stroke:
        force = 4350.0 * value + stop_force(value - 0.020, 5e4, 2e-3)[0]
        assert force == pytest.approx(375.0, rel=1e-3)
        assert 0.020 < value < 0.030
