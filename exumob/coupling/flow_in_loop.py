"""The flow in the loop: a flow code as water model of the vehicle (CFD-MBD; paper, Sec. 2.3).

In a macro step from t_n to t_{n+1} the flow goes first, with the bodies moving to where they are predicted to be; the
mean loads that it returns then act on the vehicle over the same interval. Whether that is repeated until both agree is
the business of `exumob.coupling.schemes`.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable
from dataclasses import asdict, dataclass, fields
from typing import Any

import numpy as np
import xarray as xr

from exumob.coupling.flow_code import CELL_SIZE, BuiltInFlow, FlowCode
from exumob.driving.maneuver import smooth_step
from exumob.flow.poses import Poses
from exumob.support.arrays import Array
from exumob.support.checks import require_positive, require_within
from exumob.vehicle.motion import BODIES, WRENCH_COMPONENTS, BodyStates
from exumob.vehicle.parameters import Vehicle
from exumob.water.conditions import Water
from exumob.water.wetted_surface import body_surfaces, hydrostatic_wrench

logger = logging.getLogger(__name__)


KEPT_EVERY = 0.5
"""Interval at which the developing water is kept [s]."""


@dataclass(frozen=True)
class FlowSpinUp:
    """How the water develops round the held vehicle before its release at time 0.

    The vehicle first drifts with the current, so that the water is undisturbed, and is brought to rest within `ramp`.
    That is a current ramped up about a held vehicle, seen from the undisturbed water: the two differ by a uniform
    acceleration of everything, which a uniform pressure gradient balances and which ends with the ramp (the bed slips;
    one that exerts shear sees the vehicle held in a current that was always there). Nothing is added to the flow solver
    for it, and a uniform current past a moving grid is kept to round-off. Then the vehicle settles anew under the loads
    found, and is moved there.
    """

    ramp: float = 1.0
    """From drifting with the current to rest [s]; left out in calm water"""
    hold: float = 0.5
    """At rest, after the ramp [s]; the mean loads are taken over its second half"""
    adjustment: float = 0.5
    """From the first to the final place of rest, in the first half, and waiting there, in the second [s]"""
    interval: float = 4.0e-3
    """Between the poses given to the flow before the adjustment [s]; the adjustment is made in macro steps"""

    def __post_init__(self) -> None:
        require_positive(
            "FlowSpinUp", ramp=self.ramp, hold=self.hold, adjustment=self.adjustment, interval=self.interval
        )  # fmt: skip
        require_within("FlowSpinUp", 0.0, 0.25 * self.hold, "use a shorter interval.", interval=self.interval)


class CfdHydrodynamics:
    """Loads from a flow code that advances with the vehicle, macro step by macro step.

    Parameters
    ----------
    flow : FlowCode, optional
        Any code with the five functions of `FlowCode`; default: the own solver, `BuiltInFlow`.
    cell_size : float, optional
        Of the own solver's grid round the vehicle [m]; default `CELL_SIZE`.
    allow_coarse : bool
        Of the own solver: warn instead of refusing cells too coarse for gaps and wheels.
    development : FlowSpinUp, optional
        How the water develops before the release.
    progress : callable, optional
        Called with the time [s], negative before the release, as the water develops.
    """

    def __init__(
        self, flow: FlowCode | None = None, *, cell_size: float | None = None, allow_coarse: bool = False,
        development: FlowSpinUp | None = None, progress: Callable[[float], None] | None = None,
    ) -> None:  # fmt: skip
        if flow is not None and (cell_size is not None or allow_coarse):
            raise ValueError(
                "CfdHydrodynamics: cell_size and allow_coarse are those of the own solver; give them to flow, as in "
                "BuiltInFlow(cell_size=0.018), or leave flow out."
            )
        if flow is None:
            flow = BuiltInFlow(CELL_SIZE if cell_size is None else cell_size, allow_coarse=allow_coarse)
        self.flow = flow
        self.development = development or FlowSpinUp()
        self._progress = progress or (lambda time: None)
        self.parameters = {
            "flow": {type(flow).__name__: getattr(flow, "parameters", {})}, "development": asdict(self.development)
        }  # fmt: skip
        """What was chosen, as kept in results."""
        self._poses: Poses | None = None
        self._developed = False  # since the last start
        self._developed_times: list[float] = []
        self._developed_loads: list[Array] = []
        self._forget()

    def _forget(self) -> None:
        self._times: list[float] = []
        self._reports: list[dict[str, float]] = []

    # -- before the release -----------------------------------------------------------------------------------------

    def develop(
        self, vehicle: Vehicle, water: Water | None, macro_step: float,
        settle: Callable[[Callable[[BodyStates], Array]], BodyStates], keep: Callable[[Any], None], begun: Any = None,
    ) -> None:  # fmt: skip
        """Find vehicle and water in equilibrium: settled, held, settled anew; see `FlowSpinUp`."""
        water = _needed(water)
        plan = self.development
        self._developed_times, self._developed_loads = [], []
        self._keep, self._kept_at = keep, -math.inf
        self.flow.start(vehicle, water, _at_ride_height(vehicle), 0.0)  # refuses what it cannot run
        surfaces = body_surfaces(vehicle)

        def still(states: BodyStates) -> Array:
            """Wrenches of still water."""
            return np.array(
                [
                    hydrostatic_wrench(surface, rotation, position, water.depth, water.density)
                    for surface, rotation, position in zip(surfaces, states.rotation[-1], states.position[-1],
                                                           strict=True)
                ]
            )  # fmt: skip

        # held where still water lets it settle
        held = settle(still)
        place = _resting(held)
        ramp = plan.ramp if water.current_speed > 0.0 else 0.0
        begin = -(ramp + plan.hold + plan.adjustment)
        self.flow.start(vehicle, water, _drifting(place, water, 0.0, ramp), begin)
        if begun is not None:
            self.flow.restore(begun["flow"])
            self._developed_times = [float(t) for t in begun["times"]]
            self._developed_loads = list(begun["loads"])
        done, self._kept_at = len(self._developed_times), self._developed_times[-1] if begun is not None else begin
        steps = round((ramp + plan.hold) / plan.interval)
        for n in range(1 + done, steps + 1):
            after = n * (ramp + plan.hold) / steps
            self._hold(begin + after, _drifting(place, water, after, ramp))
        times = np.array(self._developed_times[:steps])
        mean = np.array(self._developed_loads[:steps])[times > -plan.adjustment - 0.5 * plan.hold].mean(axis=0)

        # moved to where the developed water lets it settle; still water gives the change with the place
        offset = mean - still(held)
        final = _resting(settle(lambda states: still(states) + offset))
        done, steps = max(done - steps, 0), max(round(plan.adjustment / macro_step), 1)
        self._poses = final
        for n in range(1 + done, steps + 1):
            part = n / steps
            time = 0.0 if n == steps else -plan.adjustment * (1.0 - part)
            self._hold(time, _between(place, final, 2.0 * part, 0.5 * plan.adjustment))
        self._developed = True

    def _hold(self, time: float, poses: Poses) -> None:
        loads = self.flow.advance(time, poses)
        self._developed_times.append(time)
        self._developed_loads.append(np.array(loads))
        self._poses = poses
        self._progress(time)
        if time - self._kept_at >= KEPT_EVERY - 1e-9:
            self._kept_at = time
            self._keep(
                {
                    "flow": self.flow.save(), "times": np.array(self._developed_times),
                    "loads": np.array(self._developed_loads),
                }
            )  # fmt: skip

    # -- the run ----------------------------------------------------------------------------------------------------

    def start(self, vehicle: Vehicle, water: Water | None, macro_step: float) -> None:
        """Forget any earlier record; the water is that of `develop`, or comes with `restore`."""
        require_positive("CfdHydrodynamics", macro_step=macro_step)
        self._vehicle, self._water = vehicle, _needed(water)
        if not self._developed:  # the water of an earlier run
            self._poses, self._developed_times, self._developed_loads = None, [], []
        self._developed = False
        self._forget()

    def wrenches(self, history: BodyStates, predict: Callable[[], BodyStates]) -> Array:
        """Advance the flow over the macro step that begins now; mean loads over it. See `Hydrodynamics`."""
        if self._poses is None:
            raise ValueError("CfdHydrodynamics.wrenches: call develop or restore first; the water has no state yet.")
        ahead = predict()
        poses = Poses.from_states(ahead)
        loads = self.flow.advance(float(ahead.time[-1]), poses)
        self._poses = poses
        self._times.append(float(history.time[-1]))
        self._reports.append(self.flow.report())
        return loads

    def save(self, histories: bool = True) -> dict[str, Any]:
        """State of the flow and length of the record, or the record itself; see `Hydrodynamics`."""
        assert self._poses is not None
        saved: dict[str, Any] = {"flow": self.flow.save(), "count": len(self._times)}
        if histories:
            names = list(self._reports[0]) if self._reports else []
            saved["poses"] = {f.name: np.array(getattr(self._poses, f.name)) for f in fields(Poses)}
            saved["times"] = np.array(self._times)
            saved["reports"] = {name: np.array([r[name] for r in self._reports], dtype=float) for name in names}
            saved["developed_times"] = np.array(self._developed_times)
            saved["developed_loads"] = np.array(self._developed_loads)
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
            self._developed_times = [float(t) for t in saved["developed_times"]]
            self._developed_loads = list(saved["developed_loads"])
        self.flow.restore(saved["flow"])
        del self._times[saved["count"] :], self._reports[saved["count"] :]

    def record(self) -> dict[str, xr.DataArray]:
        """The flow's own figures, one sample a macro step, and the loads while the water developed."""
        found: dict[str, xr.DataArray] = self.flow.record() if isinstance(self.flow, BuiltInFlow) else {}
        if self._times:
            time = xr.Variable("macro_time", self._times, {"units": "s", "long_name": "start of the macro step"})
            for name in self._reports[0]:
                values = np.array([report[name] for report in self._reports], dtype=float)
                found[name] = xr.DataArray(values, {"macro_time": time}, ("macro_time",), attrs=_described(name))
        if self._developed_times:
            text = {"units": "s", "long_name": "time, negative before the release"}
            coords = {
                "development_time": xr.Variable("development_time", self._developed_times, text),
                "body": list(BODIES), "component": list(WRENCH_COMPONENTS),
            }  # fmt: skip
            found["development_load"] = xr.DataArray(
                np.array(self._developed_loads), coords, tuple(coords),
                attrs={"units": "N, N m", "long_name": "water on the held vehicle, body axes"},
            )  # fmt: skip
        return found


def _described(name: str) -> dict[str, str]:
    units = {"volume_added": "m3"}.get(name, "1")
    return {"units": units, "long_name": f"flow, over the macro step: {name.replace('_', ' ')}"}


def _needed(water: Water | None) -> Water:
    if water is None:
        raise ValueError("CfdHydrodynamics: there is no water; give simulate a Water, or use NoWater on dry ground.")
    return water


def _at_ride_height(vehicle: Vehicle) -> Poses:
    return Poses.at_rest(np.vstack([vehicle.hull_origin, vehicle.wheel_centers]))


def _resting(states: BodyStates) -> Poses:
    """Where the bodies are, taken as at rest: the creep of settling is not a motion of the water's walls."""
    return Poses.at_rest(states.position[-1].copy(), states.rotation[-1].copy())


def _drifting(place: Poses, water: Water, after: float, ramp: float) -> Poses:
    """Bodies `after` seconds into the ramp [s] that takes them from drifting with the current to rest at `place`."""
    if ramp == 0.0 or after >= ramp:
        return place
    x = after / ramp
    share = smooth_step(x)[0]
    way = -ramp * (0.5 - x + x**4 * (2.5 - 3.0 * x + x * x))  # integral of 1 - share from here to the ramp's end
    n = len(place.position)
    return Poses(
        place.position + way * water.velocity, place.rotation, np.tile((1.0 - share) * water.velocity, (n, 1)),
        np.zeros((n, 3)), np.zeros(n),
    )  # fmt: skip


def _between(begin: Poses, end: Poses, part: float, duration: float) -> Poses:
    """Smooth motion from one rest to another: `part` (0 to 1, beyond: there) of `duration` [s]."""
    from scipy.spatial.transform import Rotation

    if part >= 1.0:
        return end
    share, growth, _ = smooth_step(part)
    arcs = Rotation.from_matrix(end.rotation @ begin.rotation.mT).as_rotvec()
    way, rate = end.position - begin.position, growth / duration
    turned = Rotation.from_rotvec(share * arcs).as_matrix() @ begin.rotation
    n = len(way)
    return Poses(begin.position + share * way, turned, rate * way, rate * arcs, np.zeros(n))


def development_span(development: FlowSpinUp, water: Water) -> float:
    """How long the water develops before the release [s]."""
    ramp = development.ramp if water.current_speed > 0.0 else 0.0
    return math.fsum((ramp, development.hold, development.adjustment))
