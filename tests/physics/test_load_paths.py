"""Loads as one vector of generalised forces, and as user loads of Exudyn on each body: the same motion."""

import json
import math

import numpy as np
import pytest

from exumob.driving.maneuver import LaneChange
from exumob.ground.terrain import Terrain
from exumob.multibody.system import MultibodyVehicle
from exumob.simulation.run import simulate
from exumob.vehicle.point_force import PointForce
from exumob.water.conditions import Water
from vehicle_models.amphibious import amphibious_vehicle
from vehicle_models.light_4x4 import light_4x4

TURN = LaneChange(amplitude=math.radians(20.0), start=0.2, end=0.9, ramp_time=0.3)
SIDE = np.array([[20.0, 60.0, 40.0, 8.0, -5.0, 3.0], *4 * [[2.0, 5.0, 1.0, 0.5, 0.2, 0.1]]])
"""A wrench on each body that leaves no component of the loads at zero."""


@pytest.mark.parametrize("make", [amphibious_vehicle, light_4x4])
def test_both_paths_move_alike(make, sand):
    ends = []
    for user_loads in (False, True):
        model = MultibodyVehicle(make(), sand, TURN, Terrain(), 5e-4, 1.0, user_loads=user_loads)
        model.settle(lambda states: SIDE)
        for n in range(50):
            model.advance((n + 1) * 0.02, SIDE)
        ends.append((model.present(), model.constraint_wrenches()))
    (vector, reactions), (functions, their_reactions) = ends
    assert np.abs(vector.position - functions.position).max() < 1e-8
    assert np.abs(vector.rotation - functions.rotation).max() < 1e-8
    assert np.abs(reactions - their_reactions).max() < 1e-6 * make().mass * 9.81


def rope(time, position, velocity):
    to_post = np.array([4.0, 2.0, 0.4]) - position
    return 200.0 * time * to_post / np.linalg.norm(to_post) - 20.0 * velocity  # slack at the start


def test_both_paths_move_alike_in_water_with_a_rope(vehicle, sand):
    """From the static equilibrium to the end of a run of `simulate`, which says which path it took."""
    ends = []
    for user_loads in (False, True):
        run = simulate(
            vehicle, sand, Water.at_ratio(0.6, 0.3), TURN, "coefficients", duration=0.5, setting="fast",
            forces=[PointForce(rope, (0.5, 0.1, 0.2))], user_loads=user_loads,
        )  # fmt: skip
        described = json.loads(run.attrs["parameters"])
        assert described["user_loads"] is user_loads
        assert described["forces"][0]["PointForce"]["force"].startswith("rope (")
        ends.append(run)
    vector, functions = ends
    assert np.abs(vector["work"].sel(work_kind="point forces")[-1]) > 1.0
    for name, within in {"position": 1e-8, "quaternion": 1e-8, "soil_force": 1e-6 * vehicle.mass * 9.81}.items():
        assert np.abs(vector[name].values - functions[name].values).max() < within, name


def test_reactions_equal_those_of_the_multipliers(vehicle, sand):
    """Q = -C_q^T lambda, and torque = G Q_e / 2 (paper Eq. 6): found from the solver's own Jacobian."""
    model = MultibodyVehicle(vehicle, sand, TURN, Terrain(), 5e-4, 1.0)
    model.settle(lambda states: SIDE)
    for n in range(25):
        model.advance((n + 1) * 0.02, SIDE)
    model._evaluate(model.time)
    constraints = model._constraints
    multipliers = np.array(model._multipliers)
    spin_torque = -multipliers[model._spin_rows]
    multipliers[model._spin_rows] = 0.0
    generalized = (-multipliers @ constraints._derivative(1.0, 0.0)).reshape(9, 7)
    nodes = (np.array(model._q) + model._reference).reshape(9, 7)
    expected = np.zeros((9, 6))
    expected[:, :3] = generalized[:, :3]
    for i, (_, _, _, a, b, c, d) in enumerate(nodes):
        g = np.array([[-b, a, -d, c], [-c, d, a, -b], [-d, -c, b, a]])
        expected[i, 3:] = 0.5 * g @ generalized[i, 3:]
    axles = model.present().rotation[0, 1:, :, 1]
    expected[5:, 3:] += spin_torque[:, None] * axles
    expected[1:5, 3:] -= spin_torque[:, None] * axles
    assert np.abs(model.constraint_wrenches() - expected).max() < 1e-7 * vehicle.mass * 9.81
