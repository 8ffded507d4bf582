"""Models of two vehicles that tests of the multibody system advance, and comparisons of their states."""

import math
from dataclasses import fields

import numpy as np

from exumob.driving.maneuver import ConstantSteer, LaneChange
from exumob.ground.terrain import Terrain
from exumob.multibody.system import MultibodyVehicle
from vehicle_models.light_4x4 import light_4x4

CALM = np.zeros((5, 6))
STILL = ConstantSteer(speed=0.0)
QUICK = LaneChange(amplitude=math.radians(20.0), start=0.4, end=1.4, ramp_time=0.4)
"""The lane change in a fifth of the time."""
TRUCK_TURN = LaneChange(amplitude=math.radians(20.0), start=0.5, end=2.0, ramp_time=0.5, speed=4.0)
CASES = ["sliding pillars", "double wishbones"]


def prepared(vehicle, soil, maneuver=QUICK, micro_step=5e-4, duration=2.0, load=CALM):
    model = MultibodyVehicle(vehicle, soil, maneuver, Terrain(), micro_step, duration)
    model.settle(lambda states: load)
    return model


def make(case, vehicle, sand):
    return prepared(vehicle, sand) if case == CASES[0] else prepared(light_4x4(), sand, TRUCK_TURN)


def same_bits(a, b):
    """Bit for bit, through the dicts, arrays and numbers of a saved state."""
    for field in fields(a):
        one, two = getattr(a, field.name), getattr(b, field.name)
        pairs = [(one[k], two[k]) for k in one] if isinstance(one, dict) else [(one, two)]
        for x, y in pairs:
            if np.asarray(x).tobytes() != np.asarray(y).tobytes():
                return False
    return True


def matrices(quaternion):
    w, x, y, z = np.moveaxis(quaternion, -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))
