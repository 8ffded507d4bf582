"""The flow in the loop: a flow code as the hydrodynamics model of the vehicle (CFD-MBD; paper, Sec. 2.3).

In a macro step from t_n to t_{n+1} the flow goes first, with the bodies moving to where they are predicted to be; the
mean wrenches that it returns then act on the vehicle over the same interval. The coupling scheme
(`exumob.coupling.scheme`) decides whether that is repeated until both agree.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable
from dataclasses import asdict, fields, replace
from typing import Any

import numpy as np
import xarray as xr

from exumob.coupling.flow_code import CELL_SIZE, BedFlowCode, BuiltInFlow, FlowCode
from exumob.coupling.reports import checked_loads, checked_report
from exumob.coupling.spin_up import FlowSpinUp, poses_between, poses_during_ramp
from exumob.flow.cost import FlowCost
from exumob.flow.poses import Poses
from exumob.flow.undisturbed import is_uniform
from exumob.ground.terrain import Terrain
from exumob.multibody.placing import standing_pose
from exumob.support.arrays import Array
from exumob.support.checks import require_positive
from exumob.support.declared import checked
from exumob.vehicle.motion import BODIES, WRENCH_COMPONENTS, BodyStates
from exumob.vehicle.parameters import Vehicle
from exumob.vehicle.start_pose import StartPose
from exumob.water.conditions import Water
from exumob.water.hydrostatics import still_water_wrenches
from exumob.water.wetted_surface import body_surfaces

logger = logging.getLogger(__name__)

SAVE_INTERVAL = 0.5
"""Interval at which the state of the flow is saved during the spin-up [s]."""


class CfdHydrodynamics:
    """Wrenches from a flow code that advances with the vehicle, macro step by macro step.

    Parameters
    ----------
    flow : FlowCode, optional
        Any code with the five functions of `FlowCode`; default: the built-in solver, `BuiltInFlow`.
    cell_size : float, optional
        Cell size of the built-in solver's grid round the vehicle [m]; default `CELL_SIZE`.
    allow_coarse : bool
        For the built-in solver: warn of cells too coarse for gaps and wheels instead of refusing them.
    spin_up : FlowSpinUp, optional
        How the flow develops before the release.
    progress : callable, optional
        Called with the time [s], negative before the release, during the spin-up.
    """

    @checked
    def __init__(
        self,
        flow: FlowCode | None = None,
        *,
        cell_size: float | None = None,
        allow_coarse: bool = False,
        spin_up: FlowSpinUp | None = None,
        progress: Callable[[float], None] | None = None,
    ) -> None:
        if flow is not None and (cell_size is not None or allow_coarse):
            raise ValueError(
                "CfdHydrodynamics: cell_size and allow_coarse are those of the own solver; give them to flow, as in "
                "BuiltInFlow(cell_size=0.018), or leave flow out."
            )
        if flow is None:
            flow = BuiltInFlow(CELL_SIZE if cell_size is None else cell_size, allow_coarse=allow_coarse)
        self.flow = flow
        self.spin_up = spin_up or FlowSpinUp()
        self._progress = progress or (lambda time: None)
        self.parameters = {
            "flow": {type(flow).__name__: getattr(flow, "parameters", {})}, "spin_up": asdict(self.spin_up)
        }  # fmt: skip
        """The chosen settings, as kept in results."""
        self._poses: Poses | None = None
        self._spun_up = False  # since the last start
        self._spin_up_times: list[float] = []
        self._spin_up_wrenches: list[Array] = []
        self._terrain, self._start = Terrain(), StartPose()
        self._forget()

    def _forget(self) -> None:
        self._times: list[float] = []
        self._reports: list[dict[str, float]] = []

    # -- before the run ---------------------------------------------------------------------------------------------

    def set_bed(self, terrain: Terrain) -> None:
        """Take the ground of the runs to come; see `exumob.water.hydrodynamics.BedHydrodynamics`."""
        self._terrain = terrain

    def expect_drive(self, water: Water | None, start: StartPose, reach: float) -> None:
        """Take where the vehicle starts and how far it can come from there [m]; `simulate` says both.

        Raises
        ------
        ValueError
            If the flow code knows water of one depth over level ground at z = 0 only, and this is none; if the water
            does not go with the ground.
        """
        self._start, terrain = start, self._terrain
        if isinstance(self.flow, BedFlowCode):
            if water is not None:
                water.require_over(terrain, "simulate.water: Water.depth")
            self.flow.set_bed(terrain, (start.x, start.y), reach)
            return
        name = f"the flow in the loop ({type(self.flow).__name__})"
        remedy = (
            "give the flow code a function set_bed (exumob.coupling.flow_code.BedFlowCode), take the built-in solver, "
            "or hydrodynamics='calibrated'"
        )
        if water is not None and water.depth is None:
            raise ValueError(
                f"simulate.water: {name} knows water of one depth and one current only, Water(depth=...); {remedy}."
            )
        if not (terrain.is_flat and terrain.height == 0.0):
            raise ValueError(f"simulate.terrain: {name} knows water over level ground at z = 0 only; {remedy}.")
        if start != StartPose():
            raise ValueError(
                f"simulate.start: with {name} a run starts at the world's origin, heading along world x; turn the "
                f"current instead (Water.current_direction); or {remedy}."
            )

    def expect_steering(self, smallest: float, largest: float) -> None:
        """Take the smallest and the largest angle of a front wheel during the run [rad]; `simulate` says them.

        The built-in solver checks its cells at these angles, and without them up to the vehicle's steering limit.
        """
        if isinstance(self.flow, BuiltInFlow):
            self.flow.steering_range = smallest, largest

    def cost(
        self, vehicle: Vehicle, water: Water, speed: float, duration: float, macro_step: float, advances: float
    ) -> FlowCost | None:
        """Estimate what a run takes with the built-in solver, spin-up included; None with another flow code.

        Parameters
        ----------
        vehicle : Vehicle
        water : Water
        speed : float
            Largest speed through the water [m/s].
        duration, macro_step : float
            Of the run [s].
        advances : float
            Advances of the flow in a macro step, on average.

        Raises
        ------
        ValueError
            If there is no memory for it.
        """
        if not isinstance(self.flow, BuiltInFlow):
            return None
        plan = self.spin_up.for_vehicle(vehicle)
        held = self.flow.cost(vehicle, water, water.greatest_speed, plan.duration(water), plan.interval)
        run = self.flow.cost(vehicle, water, speed, duration, macro_step)
        return replace(run, steps=held.steps + advances * run.steps, seconds=held.seconds + advances * run.seconds)

    # -- before the release -----------------------------------------------------------------------------------------

    def run_spin_up(
        self, vehicle: Vehicle, water: Water | None, macro_step: float,
        settle: Callable[[Callable[[BodyStates], Array]], BodyStates], keep: Callable[[Any], None], begun: Any = None,
    ) -> None:  # fmt: skip
        """Find vehicle and water in equilibrium: settled, held, settled anew; see `FlowSpinUp`."""
        water = _required(water)
        plan = self.spin_up.for_vehicle(vehicle)
        self._spin_up_times, self._spin_up_wrenches = [], []
        self._keep, self._last_save = keep, -math.inf
        self.flow.start(vehicle, water, self._poses_at_ride_height(vehicle), 0.0)  # refuses what it cannot run
        surfaces = body_surfaces(vehicle)
        plain = is_uniform(water, self._terrain)

        def still(states: BodyStates) -> Array:
            return still_water_wrenches(surfaces, states, water, self._terrain)

        def poses_before(elapsed: float) -> Poses:
            return poses_during_ramp(first_rest, water, elapsed, ramp) if plain else first_rest

        # held where still water lets it settle
        held = settle(still)
        first_rest = _poses_at_rest(held)
        ramp = plan.ramp_in(water)
        begin = -(ramp + plan.hold + plan.adjustment)
        self.flow.start(vehicle, water, poses_before(0.0), begin)
        if begun is not None:
            self.flow.restore(begun["flow"])
            self._spin_up_times = [float(t) for t in begun["times"]]
            self._spin_up_wrenches = list(begun["wrenches"])
        done, self._last_save = len(self._spin_up_times), self._spin_up_times[-1] if begun is not None else begin
        steps = round((ramp + plan.hold) / plan.interval)
        for n in range(1 + done, steps + 1):
            elapsed = n * (ramp + plan.hold) / steps
            self._advance_held(begin + elapsed, poses_before(elapsed))
        times = np.array(self._spin_up_times[:steps])
        late = times > -plan.adjustment - 0.5 * plan.hold
        mean = np.array(self._spin_up_wrenches[:steps])[late].mean(axis=0)

        # moved to where the developed flow lets it settle; still water gives the change with the place
        offset = mean - still(held)
        final_rest = _poses_at_rest(settle(lambda states: still(states) + offset))
        done, steps = max(done - steps, 0), max(round(plan.adjustment / macro_step), 1)
        self._poses = final_rest
        for n in range(1 + done, steps + 1):
            part = n / steps
            time = 0.0 if n == steps else -plan.adjustment * (1.0 - part)
            self._advance_held(time, poses_between(first_rest, final_rest, 2.0 * part, 0.5 * plan.adjustment))
        self._spun_up = True

    def _poses_at_ride_height(self, vehicle: Vehicle) -> Poses:
        """Poses of the bodies as they lie on the ground at the start, in the design position, at rest."""
        place, turn = standing_pose(vehicle, self._terrain, self._start)
        offsets = np.vstack([vehicle.hull_origin, vehicle.wheel_centers])
        return Poses.at_rest(place + offsets @ turn.T, np.tile(turn, (len(offsets), 1, 1)))

    def _advance_held(self, time: float, poses: Poses) -> None:
        """Advance the flow with the held vehicle to a time [s], and save its state if that is due."""
        wrenches = self._advanced(time, poses)
        self._spin_up_times.append(time)
        self._spin_up_wrenches.append(wrenches)
        self._poses = poses
        self._progress(time)
        if time - self._last_save >= SAVE_INTERVAL - 1e-9:
            self._last_save = time
            self._keep(
                {
                    "flow": self.flow.save(), "times": np.array(self._spin_up_times),
                    "wrenches": np.array(self._spin_up_wrenches),
                }
            )  # fmt: skip

    # -- the run ----------------------------------------------------------------------------------------------------

    def start(self, vehicle: Vehicle, water: Water | None, macro_step: float) -> None:
        """Forget any earlier record; the flow is that of `run_spin_up`, or comes with `restore`."""
        require_positive("CfdHydrodynamics", macro_step=macro_step)
        self._vehicle, self._water = vehicle, _required(water)
        if not self._spun_up:  # the flow of an earlier run
            self._poses, self._spin_up_times, self._spin_up_wrenches = None, [], []
        self._spun_up = False
        self._forget()

    def wrenches(self, history: BodyStates, predict: Callable[[], BodyStates]) -> Array:
        """Advance the flow over the macro step that begins now; return its mean wrenches. See `Hydrodynamics`."""
        if self._poses is None:
            raise ValueError(
                "CfdHydrodynamics.wrenches: call run_spin_up or restore first; the water has no state yet."
            )  # fmt: skip
        ahead = predict()
        poses = Poses.from_states(ahead)
        wrenches = self._advanced(float(ahead.time[-1]), poses)
        names = sorted(self._reports[-1]) if self._reports else None
        report = checked_report(type(self.flow).__name__, self.flow.report(), names)
        self._poses = poses
        self._times.append(float(history.time[-1]))
        self._reports.append(report)
        return wrenches

    def courant_numbers(self, count: int) -> list[float]:
        """Return the Courant number of the flow over each of the last `count` macro steps [-]; nan: not reported."""
        last = self._reports[-count:] if count else []
        return [report.get("courant", math.nan) * report.get("steps", 1.0) for report in last]

    def _advanced(self, time: float, poses: Poses) -> Array:
        """Advance the flow to a time [s]; return its loads, checked."""
        return checked_loads(type(self.flow).__name__, self.flow.advance(time, poses), len(poses.position), time)

    def save(self, histories: bool = True) -> dict[str, Any]:
        """Return the state of the flow and the length of the record, or the record itself; see `Hydrodynamics`."""
        assert self._poses is not None
        saved: dict[str, Any] = {"flow": self.flow.save(), "count": len(self._times)}
        if histories:
            names = list(self._reports[0]) if self._reports else []
            saved["poses"] = {f.name: np.array(getattr(self._poses, f.name)) for f in fields(Poses)}
            saved["times"] = np.array(self._times)
            saved["reports"] = {name: np.array([r[name] for r in self._reports], dtype=float) for name in names}
            saved["spin_up_times"] = np.array(self._spin_up_times)
            saved["spin_up_wrenches"] = np.array(self._spin_up_wrenches)
        return saved

    def restore(self, saved: dict[str, Any]) -> None:
        """Return to a state given by `save`; see `Hydrodynamics`."""
        if "poses" in saved:
            poses = Poses(**{name: np.array(value) for name, value in saved["poses"].items()})
            if self._poses is None:  # a new process
                self.flow.start(self._vehicle, self._water, poses, 0.0)
            self._poses = poses
            self._times = [float(t) for t in saved["times"]]
            columns = saved["reports"]
            self._reports = [{name: columns[name][n] for name in columns} for n in range(len(self._times))]
            self._spin_up_times = [float(t) for t in saved["spin_up_times"]]
            self._spin_up_wrenches = list(saved["spin_up_wrenches"])
        self.flow.restore(saved["flow"])
        del self._times[saved["count"] :], self._reports[saved["count"] :]

    def record(self) -> dict[str, xr.DataArray]:
        """Return the figures that the flow reports, one sample a macro step, and the wrenches of the spin-up."""
        found: dict[str, xr.DataArray] = self.flow.record() if isinstance(self.flow, BuiltInFlow) else {}
        if self._times:
            time = xr.Variable("macro_time", self._times, {"units": "s", "long_name": "start of the macro step"})
            for name in self._reports[0]:
                values = np.array([report[name] for report in self._reports], dtype=float)
                attrs = _report_attributes(name)
                found[name] = xr.DataArray(values, {"macro_time": time}, ("macro_time",), attrs=attrs)
        if self._spin_up_times:
            text = {"units": "s", "long_name": "time, negative before the release"}
            coords = {
                "development_time": xr.Variable("development_time", self._spin_up_times, text),
                "body": list(BODIES), "component": list(WRENCH_COMPONENTS),
            }  # fmt: skip
            found["development_load"] = xr.DataArray(  # the name in result files since the first ones
                np.array(self._spin_up_wrenches), coords, tuple(coords),
                attrs={"units": "N, N m", "long_name": "water on the held vehicle, body axes"},
            )  # fmt: skip
        return found


def _report_attributes(name: str) -> dict[str, str]:
    """Unit and long name of a figure that a flow code reports."""
    units = {"volume_added": "m3"}.get(name, "1")
    return {"units": units, "long_name": f"flow, over the macro step: {name.replace('_', ' ')}"}


def _required(water: Water | None) -> Water:
    """Return the water, or refuse that there is none."""
    if water is None:
        raise ValueError("CfdHydrodynamics: there is no water; give simulate a Water, or use NoWater on dry ground.")
    return water


def _poses_at_rest(states: BodyStates) -> Poses:
    """Poses of the bodies taken as at rest: the creep of settling is not a motion of the water's walls."""
    return Poses.at_rest(states.position[-1].copy(), states.rotation[-1].copy())
