"""LSTM-MBD: trained networks as the water of the vehicle (paper Secs. 3 and 5), with error bars and known limits.

What the vehicle feels is the mean of an ensemble's members; their spread is the error bar. Outside the range of the
training runs networks say anything: there the loads are blended into those of the coefficient model, and the result
says where and how far. In macro steps of more than 2 ms the networks' part goes half way to each new answer
(`HALFWAY`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from exumob.support.arrays import Array
from exumob.surrogates.inputs import network_inputs
from exumob.surrogates.networks import SAMPLING, TRAINED_DENSITY, Architecture, NetworkSet, window_rows
from exumob.vehicle.motion import BODIES, WRENCH_COMPONENTS, BodyStates
from exumob.vehicle.parameters import Vehicle
from exumob.water.coefficients import CoefficientHydrodynamics
from exumob.water.conditions import Water

OUTSIDE = 0.02
"""Excess (`NetworkSet.excess`) from which a state counts as outside the training range."""
BLEND = (0.1, 0.5)
"""Excess at which the coefficient model begins to take over, and from which it acts alone."""
HALFWAY = 2.0e-3
"""Macro step above which the networks' part of the loads goes half of the way to their new answer [s].

Networks answer to velocities; held over 20 ms that answer is a delayed damper, and one that is strong for a wheel's
mass chatters from step to step: +-1 N of 110 N in D60/U1."""
MOVING = 0.05
"""Speed below which a body counts as at rest where the training range is looked at [m/s]: the sideslip angle of a
vehicle that hardly moves is arbitrary."""


class SurrogateHydrodynamics:
    """Networks that give the water's loads on the five bodies.

    Parameters
    ----------
    networks : NetworkSet, path, or a sequence of them, optional
        Members of an ensemble. Default: those that come with exumob (`shipped_networks`).
    fallback : bool
        False: the networks alone act, however far outside their range.

    Raises
    ------
    ValueError
        If a file is not one of networks; at `start`, if they were trained for another vehicle.
    """

    def __init__(
        self, networks: NetworkSet | str | Path | Sequence[NetworkSet | str | Path] | None = None, *,
        fallback: bool = True,
    ) -> None:  # fmt: skip
        given = shipped_networks() if networks is None else networks
        if isinstance(given, NetworkSet | str | Path):
            given = [given]
        self.networks = [n if isinstance(n, NetworkSet) else NetworkSet.load(n) for n in given]
        if not self.networks:
            raise ValueError("SurrogateHydrodynamics.networks is empty; give files that `exumob train` wrote.")
        self.fallback = fallback
        self.parameters = {
            "networks": [{"name": n.name, "digest": n.digest()} for n in self.networks], "fallback": fallback
        }  # fmt: skip
        """What was chosen, as kept in results."""
        groups: dict[Architecture, list[NetworkSet]] = {}
        for network in self.networks:
            groups.setdefault(network.architecture, []).append(network)
        self._groups = [(NetworkSet.together(group), len(group)) for group in groups.values()]
        self._water: Water | None = None
        self._last: Array | None = None

    def start(self, vehicle: Vehicle, water: Water | None, macro_step: float) -> None:
        """Check that the networks fit the vehicle, and forget any earlier run."""
        self._water = water
        self._times: list[float] = []
        self._spread: list[Array] = []
        self._excess: list[Array] = []
        self._fallback: list[Array] = []
        self._halfway, self._last = macro_step > HALFWAY, None
        if water is None:
            return
        for network in self.networks:
            network.check_vehicle(vehicle)
            steps = macro_step / SAMPLING
            if network.architecture.taps > 1 and abs(steps - round(steps)) > 1e-6:
                raise ValueError(
                    f"networks ({network.name}) see the past every {1e3 * SAMPLING:g} ms; macro_step = "
                    f"{1e3 * macro_step:g} ms must be a whole multiple of it."
                )
        based = any(n.architecture.base == "coefficients" for n in self.networks)
        self._coefficients = CoefficientHydrodynamics() if based or self.fallback else None
        if self._coefficients is not None:
            self._coefficients.start(vehicle, water, macro_step)

    def wrenches(self, history: BodyStates, predict: Callable[[], BodyStates]) -> Array:
        """Loads for the macro step that begins now; `predict` is not called. See `Hydrodynamics`."""
        water = self._water
        if water is None:
            return np.zeros((5, 6))
        base = None if self._coefficients is None else self._coefficients.wrenches(history, predict)
        if len(history) == 1:  # no past: it settles, or is about to be released
            history = _at_rest(history)
        resting = np.hypot(history.velocity[-1, 0, 0], history.velocity[-1, 0, 1]) < MOVING
        members, excess = [], []
        for networks, count in self._groups:
            seen = networks.architecture
            rows = window_rows(history.time, seen.taps, seen.stride)
            inputs = np.moveaxis(network_inputs(_rows(history, rows), water, seen.inputs), 0, 1)
            window = np.tile(inputs, (count, 1, 1))
            loads = networks.loads(window).reshape(count, 5, 6) * (water.density / TRAINED_DENSITY)
            if seen.base == "coefficients":
                assert base is not None
                loads = loads + base
            members.append(loads)
            present = window[:, -1]
            if resting:
                still = network_inputs(_at_rest(_rows(history, np.array([-1]))), water, seen.inputs)
                present = np.tile(still[0], (count, 1))
            excess.append(networks.excess(present).reshape(count, 5, 2))
        found = np.concatenate(members)
        outside = np.concatenate(excess).mean(axis=0)
        learnt = found.mean(axis=0) if base is None else found.mean(axis=0) - base
        if self._halfway and self._last is not None and len(history) > 1:
            learnt = 0.5 * (learnt + self._last)
        self._last = learnt
        loads = learnt if base is None else learnt + base
        share = np.zeros(5)
        if self.fallback:
            assert base is not None
            share = np.clip((outside.max(axis=-1) - BLEND[0]) / (BLEND[1] - BLEND[0]), 0.0, 1.0)
            share = share * share * (3.0 - 2.0 * share)
            loads = (1.0 - share[:, None]) * loads + share[:, None] * base
        self._times.append(float(history.time[-1]))
        self._spread.append(found.std(axis=0, ddof=1) if len(found) > 1 else np.zeros((5, 6)))
        self._excess.append(outside)
        self._fallback.append(share)
        return loads

    def save(self, histories: bool = True) -> dict[str, Any]:
        """Return the coefficient model's state and the record, or its length only."""
        saved: dict[str, Any] = {"count": len(self._times), "last": self._last}
        if self._water is not None and self._coefficients is not None:
            saved["coefficients"] = self._coefficients.save(histories)
        if histories:
            saved["times"] = np.array(self._times)
            saved["spread"] = np.array(self._spread).reshape(-1, 5, 6)
            saved["excess"] = np.array(self._excess).reshape(-1, 5, 2)
            saved["fallback"] = np.array(self._fallback).reshape(-1, 5)
        return saved

    def restore(self, saved: dict[str, Any]) -> None:
        """Return to a state given by `save`; a record kept after it is dropped."""
        if self._water is not None and self._coefficients is not None:
            self._coefficients.restore(saved["coefficients"])
        self._last = None if saved["last"] is None else np.array(saved["last"])
        if "times" in saved:
            self._times = [float(t) for t in saved["times"]]
            self._spread, self._excess = list(saved["spread"]), list(saved["excess"])
            self._fallback = list(saved["fallback"])
        for kept in (self._times, self._spread, self._excess, self._fallback):
            del kept[saved["count"] :]

    def record(self) -> dict[str, xr.DataArray]:
        """Error bars of the loads, distance from the training range and share of the coefficient model."""
        if not self._times:
            return {}
        time = xr.Variable("macro_time", self._times, {"units": "s", "long_name": "start of the macro step"})
        coords = {"macro_time": time, "body": list(BODIES)}
        excess = np.array(self._excess)
        found = {
            "load_spread": xr.DataArray(
                np.array(self._spread), coords | {"component": list(WRENCH_COMPONENTS)},
                ("macro_time", "body", "component"),
                attrs={"units": "N, N m", "long_name": "standard deviation of the members' loads, body axes"},
            ),
            "range_excess": xr.DataArray(
                excess, coords | {"range_kind": ["single", "joint"]}, ("macro_time", "body", "range_kind"),
                attrs={"units": "1", "long_name": "distance outside the training range, over its width"},
            ),
            "out_of_range": xr.DataArray(
                excess.max(axis=-1) > OUTSIDE, coords, ("macro_time", "body"),
                attrs={
                    "units": "1",
                    "long_name": f"whether the body's state lies outside the training range by {OUTSIDE:g}",
                },
            ),
            "fallback_share": xr.DataArray(
                np.array(self._fallback), coords, ("macro_time", "body"),
                attrs={"units": "1", "long_name": "share of the coefficient model in the loads"},
            ),
        }  # fmt: skip
        return found


def shipped_networks() -> list[Path]:
    """Files of the networks that come with exumob: for the amphibious vehicle, 40 to 60 % depth, 0 to 1 m/s ahead."""
    folder = Path(str(resources.files("exumob") / "surrogates" / "weights"))
    return sorted(folder.glob("*.safetensors"))


def _at_rest(states: BodyStates) -> BodyStates:
    """Without the small motions of settling, whose directions would be taken for sideslip angles."""
    still = np.zeros_like(states.velocity)
    return replace(states, velocity=still, angular_velocity=still)


def _rows(history: BodyStates, rows: np.ndarray) -> BodyStates:
    return BodyStates(*(getattr(history, name)[rows] for name in history.__dataclass_fields__))
