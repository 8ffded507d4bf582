"""The example's flow code in this process, and a short run with it: what tests of coupling and restart share."""

import json
import math
import sys
from dataclasses import fields
from pathlib import Path

import xarray as xr

from exumob.coupling.flow_in_loop import CfdHydrodynamics, FlowSpinUp
from exumob.driving.maneuver import LaneChange
from exumob.simulation.run import simulate
from exumob.support.errors import SimulationError
from exumob.support.provenance import parameters_json
from exumob.water.conditions import Water

ROOT = Path(__file__).parents[1]
EXAMPLE = ROOT / "examples" / "external_flow"
sys.path.insert(0, str(EXAMPLE))
import stand_in

QUICK = LaneChange(amplitude=math.radians(20.0), start=0.05, end=0.6, ramp_time=0.1)
WATER = Water.at_ratio(0.6, 1.0)
SHORT = FlowSpinUp(ramp=0.1, hold=0.05, adjustment=0.05)
STEPS = {"micro_step": 5e-4, "macro_step": 1e-3}


class StandIn:
    """The example's flow code, in this process."""

    def __init__(self):
        self.parameters = {"code": "stand-in"}
        self.fails_at = math.inf

    def start(self, vehicle, water, poses, time):
        sizes = json.loads(parameters_json({"v": vehicle}))["v"]["Vehicle"]
        given = {"depth": water.depth, "density": water.density, "velocity": water.velocity.tolist()}
        self.water = stand_in.BoxFlow(sizes, given)
        self.water.start(self._arrays(poses), time)

    def advance(self, time, poses):
        if time > self.fails_at:
            raise SimulationError("the licence server has gone")
        return self.water.advance(time, self._arrays(poses))

    def save(self):
        return self.water.save()

    def restore(self, saved):
        self.water.restore(saved)

    def report(self):
        return {"iterations": 1.0}

    @staticmethod
    def _arrays(poses):
        return {f.name: getattr(poses, f.name) for f in fields(poses)}


def run(vehicle, sand, flow=None, duration=0.12, **options):
    water_model = CfdHydrodynamics(flow or StandIn(), spin_up=SHORT)
    return simulate(vehicle, sand, WATER, QUICK, water_model, duration=duration, **(STEPS | options))


def assert_same(one, two):
    """Every variable bit for bit."""
    assert set(one.variables) == set(two.variables)
    for name in one.variables:
        xr.testing.assert_identical(one[name].variable, two[name].variable)
