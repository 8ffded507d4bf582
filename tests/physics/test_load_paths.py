"""Loads as one vector of generalised forces, and as user loads of Exudyn on each body: the same motion."""

import math

import numpy as np
import pytest

from exumob.driving.maneuver import LaneChange
from exumob.ground.terrain import Terrain
from exumob.multibody.system import MultibodyVehicle
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
