"""LSTM-MBD: trained networks as a hydrodynamics model (paper Secs. 3 and 5), with error bars and known limits.

The wrenches on the vehicle are the mean of an ensemble's members. Their spread, with what all members lack on runs kept
apart (`exumob.surrogates.ensemble.load_floor`), is the error bar. Networks do not extrapolate: outside the range of
their training runs their wrenches are blended into those of networks of a wider range, if there are any, and then into
those of the coefficients that they rest on (`exumob.water.calibrated`), and the result records where and how far. In
macro steps of more than 2 ms the networks' part moves half way to each new answer (`RELAXED_STEP`).

A vehicle of the same form in another size (`exumob.vehicle.scaled`) has the same answers by Froude's law: inputs are
scaled to the vehicle that the networks know, the time constants of their memory go with the root of the size, forces
with its cube, and moments with its fourth power.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from exumob.ground.terrain import Terrain
from exumob.support.arrays import Array
from exumob.support.declared import checked
from exumob.support.kernels import njit
from exumob.surrogates.ensemble import bars_of, load_floor, load_members
from exumob.surrogates.inputs import SAMPLING, bed_below, network_inputs, size_factors, window_rows
from exumob.surrogates.memory import InputMemory
from exumob.surrogates.network_kernels import mean_and_spread
from exumob.surrogates.networks import FULL_RANGE, TRAINED_DENSITY, WEIGHTS, Architecture, NetworkSet
from exumob.surrogates.vehicle_shape import CLOSE, times_as_large
from exumob.vehicle.motion import BODIES, WRENCH_COMPONENTS, BodyStates
from exumob.vehicle.parameters import Vehicle
from exumob.water.calibrated import CalibratedHydrodynamics
from exumob.water.conditions import Water, require_within
from exumob.water.wave_loads import fitted_coefficients

OUTSIDE = 0.02
"""Excess (`NetworkSet.excess`) from which a state counts as outside the training range [-]."""
BLEND = (0.1, 0.5)
"""Excess at which the calibrated coefficients begin to take over, and from which they act alone [-]."""
HANDOVER = (OUTSIDE, 0.2)
"""The same of networks that know a wider range [-]: they know the border, and take over there."""
RELAXED_STEP = 2.0e-3
"""Macro step above which the networks' part of the wrenches moves half way to their new answer [s].

Networks answer to velocities. Held over 20 ms that answer is a delayed damper, which is strong for a wheel's mass and
makes the wrench alternate from step to step: by 1 N of 110 N in D60/U1."""
SLOPE_RANGE = 0.2
"""Slope of the bed that counts as an excess of 1 [-], chosen by us. The networks have seen level beds only, and most
are not told of a slope: from 0.02 on the coefficients begin to take over, from 0.1 on they act alone."""
MOVING_SPEED = 0.05
"""Speed of the hull below which a state is compared with the training range as one at rest [m/s]: the sideslip angle of
a vehicle that hardly moves is arbitrary."""


class SurrogateHydrodynamics:
    """Trained networks that give the water's wrenches on the five bodies.

    Parameters
    ----------
    networks : NetworkSet, path, or a sequence of them, optional
        Members of an ensemble, or files of one or several (`exumob.surrogates.ensemble`); names such as
        ``"paper-lstm"`` stand for some that come with exumob (`exumob.surrogates.networks.NAMED`). Default:
        `shipped_networks`, those for lane changes.
    fallback : bool
        True: other networks (`beyond`), if there are any, and coefficients take over outside the networks' range.
        False: the networks alone act.
    beyond : NetworkSet, path, or a sequence of them, optional
        Networks of a wider range, which take over outside that of `networks`, before the coefficients that they rest on
        take over from them. Default: for the default networks, which know lane changes, those for the whole range
        (`exumob.surrogates.networks.FULL_RANGE`); for others none.

    Raises
    ------
    ValueError
        If a file holds no networks, or members rest on different coefficients; at `start`, if they were
        trained for a vehicle of another form.
    """

    @checked
    def __init__(
        self,
        networks: NetworkSet | str | Path | Sequence[NetworkSet | str | Path] | None = None,
        *,
        fallback: bool = True,
        beyond: NetworkSet | str | Path | Sequence[NetworkSet | str | Path] | None = None,
    ) -> None:
        if beyond is None and networks is None and fallback:
            beyond = FULL_RANGE
        if beyond is not None and not fallback:
            raise ValueError(
                "SurrogateHydrodynamics.beyond has no effect with fallback = False, with which the networks act alone; "
                "leave one of them out."
            )
        self.beyond = None if beyond is None else SurrogateHydrodynamics(beyond)
        """Networks that take over outside the range of these; None: coefficients do."""
        given = shipped_networks() if networks is None else networks
        if isinstance(given, NetworkSet | str | Path):
            given = [given]
        self.networks = [m for n in given for m in ([n] if isinstance(n, NetworkSet) else load_members(n))]
        if not self.networks:
            raise ValueError("SurrogateHydrodynamics.networks is empty; give files that `exumob train` wrote.")
        self.fallback = fallback
        groups: dict[Architecture, list[NetworkSet]] = {}
        for network in self.networks:
            groups.setdefault(network.architecture, []).append(network)
        bases = {waves.digest(): waves for n in self.networks if (waves := n.waves) is not None}
        if len(bases) > 1:
            raise ValueError(
                f"SurrogateHydrodynamics.networks: {', '.join(n.name for n in self.networks)} rest on {len(bases)} "
                "different sets of coefficients; use networks that were trained together (`exumob train`)."
            )
        self.waves = next(iter(bases.values()), None)
        """Coefficients of the waves that the networks rest on, fitted to their runs; None: they rest on none."""
        beside = (self.waves or fitted_coefficients()).digest() if fallback or self.waves is not None else None
        self.parameters = {
            "networks": [{"name": n.name, "digest": n.digest()} for n in self.networks], "fallback": fallback,
            "wave_coefficients": beside,
        }  # fmt: skip
        """The chosen settings, as kept in results."""
        if self.beyond is not None:
            self.parameters["beyond"] = self.beyond.parameters
        self._groups = [(NetworkSet.stacked(group), len(group)) for group in groups.values()]
        self._water: Water | None = None
        self._floor = load_floor(self.networks)
        self._bed = Terrain()
        self._size = 1.0
        self._last_learnt: Array | None = None

    @property
    def all_networks(self) -> list[NetworkSet]:
        """These networks, and those that take over beyond their range."""
        return self.networks if self.beyond is None else [*self.networks, *self.beyond.networks]

    def member(self, number: int) -> SurrogateHydrodynamics:
        """Return one member alone, with one of those that take over beyond its range."""
        beyond = None if self.beyond is None else self.beyond.networks[number % len(self.beyond.networks)]
        return SurrogateHydrodynamics(self.networks[number], fallback=self.fallback, beyond=beyond)

    def set_bed(self, terrain: Terrain) -> None:
        """Take the ground of the runs to come. See `exumob.water.hydrodynamics.BedHydrodynamics`."""
        self._bed = terrain
        if self.beyond is not None:
            self.beyond.set_bed(terrain)

    def start(self, vehicle: Vehicle, water: Water | None, macro_step: float) -> None:
        """Check that the networks fit the vehicle, and forget any earlier run."""
        self._water = water
        self._times: list[float] = []
        self._memories: list[InputMemory] = []
        self._spread: list[Array] = []
        self._excess: list[Array] = []
        self._fallback: list[Array] = []
        self._wide: list[Array] = []
        if self.beyond is not None:
            self.beyond.start(vehicle, water, macro_step)
        self._relaxed, self._last_learnt = macro_step > RELAXED_STEP, None
        if water is None:
            return
        self._set_size(vehicle)
        self._around = water.over(self._bed)
        for network in self.networks:
            steps = macro_step / SAMPLING
            if network.architecture.taps > 1 and abs(steps - round(steps)) > 1e-6:
                raise ValueError(
                    f"networks ({network.name}) sample the past every {1e3 * SAMPLING:g} ms; macro_step = "
                    f"{1e3 * macro_step:g} ms must be a whole multiple of it."
                )
        based = self.waves is not None
        self._coefficients = CalibratedHydrodynamics(waves=self.waves) if based or self.fallback else None
        if self._coefficients is not None:
            self._coefficients.set_bed(self._bed)
            self._coefficients.start(vehicle, water, macro_step)

    def _set_size(self, vehicle: Vehicle) -> None:
        """Find how many times as large as in training the vehicle is, and what follows from it."""
        for network in self.networks:
            network.check_vehicle(vehicle)
        sizes = [times_as_large(vehicle, network.about["geometry"]) or 1.0 for network in self.networks]
        size = sizes[0]
        if any(not math.isclose(other, size, rel_tol=CLOSE) for other in sizes):
            raise ValueError(
                f"networks ({', '.join(n.name for n in self.networks)}) were trained for vehicles of several sizes: "
                f"{vehicle.name} is {', '.join(f'{s:.4g}' for s in sizes)} times as large; use those of one vehicle."
            )
        if size != 1.0 and (past := [n.name for n in self.networks if n.architecture.taps > 1]):
            raise ValueError(
                f"networks ({past[0]}) sample the past at intervals of the vehicle in training, and {vehicle.name} is "
                f"{size:.4g} times as large; take networks that remember by filters or not at all, such as those that "
                "come with exumob."
            )
        self._size = size
        self._factors = [size_factors(group.architecture.inputs, size) for group, _ in self._groups]
        self._load_factors = size ** np.array([3.0, 3.0, 3.0, 4.0, 4.0, 4.0])
        """Of forces and moments"""
        self._memories = [
            InputMemory([math.sqrt(size) * tau for tau in group.architecture.filters]) for group, _ in self._groups
        ]

    def wrenches(self, history: BodyStates, predict: Callable[[], BodyStates]) -> Array:
        """Return the wrenches for the macro step that begins now; `predict` is not called. See `Hydrodynamics`."""
        water = self._water
        if water is None:
            return np.zeros((5, 6))
        require_within(water, history)
        base = None if self._coefficients is None else self._coefficients.wrenches(history, predict)
        members, excess = self._answers(history, water, base)
        mean, spread = mean_and_spread(members)
        learnt = mean if base is None else mean - base
        wide = np.zeros(5)
        if self.beyond is not None:  # for all bodies at once: it is one flow, and none of them knows of slopes
            wide[:] = _share_of_others(excess, HANDOVER).max()
        if not self._bed.is_flat or water.depth is None:
            slope, dry = bed_below(self._around, np.ascontiguousarray(history.position[-1]))
            if slope > 0.0:
                excess[:, 0] = np.maximum(excess[:, 0], slope / SLOPE_RANGE)
            learnt = np.where(dry[:, None], 0.0, learnt)
        if self._relaxed and self._last_learnt is not None and len(history) > 1:
            learnt = 0.5 * (learnt + self._last_learnt)
        self._last_learnt = learnt
        share = _share_of_others(excess, BLEND) if self.fallback else np.zeros(5)
        wrenches = learnt if base is None else base + (1.0 - share)[:, None] * learnt
        if self.beyond is not None:
            if wide.any():
                others = self.beyond.wrenches(history, predict)
                wrenches = (1.0 - wide)[:, None] * wrenches + wide[:, None] * others
            else:
                self.beyond.remember(history, predict)
        self._times.append(float(history.time[-1]))
        self._spread.append(spread)
        self._excess.append(excess)
        self._fallback.append(share)
        self._wide.append(wide)
        return wrenches

    def remember(self, history: BodyStates, predict: Callable[[], BodyStates]) -> None:
        """Take note of a macro step for which nobody asks: only what later answers depend on."""
        if self._water is None:
            return
        if self._coefficients is not None:
            self._coefficients.wrenches(history, predict)
        for (networks, _), memory, factors in zip(self._groups, self._memories, self._factors, strict=True):
            if networks.architecture.filters:
                now, still = np.array([len(history) - 1]), len(history) == 1
                inputs = network_inputs(history, self._around, networks.architecture.inputs, now, still=still)[0]
                memory.filtered(float(history.time[-1]), inputs * factors, still)
        self._last_learnt = None
        self._times.append(float(history.time[-1]))
        self._spread.append(np.zeros((5, 6)))
        self._excess.append(np.zeros((5, 2)))
        self._fallback.append(np.zeros(5))
        self._wide.append(np.zeros(5))

    def _answers(self, history: BodyStates, water: Water, base: Array | None) -> tuple[Array, Array]:
        """Ask all members.

        Returns
        -------
        array, shape (members, 5, 6)
            Wrenches, with those of the base model [N, N m].
        array, shape (5, 2)
            Excess over the training range (`NetworkSet.excess`), mean of the members [-].
        """
        still = len(history) == 1  # no past: it settles, or is about to be released
        at_rest = still or math.hypot(*history.velocity[-1, 0, :2]) < MOVING_SPEED * math.sqrt(self._size)
        members, excess = np.empty((len(self.networks), 5, 6)), np.empty((len(self.networks), 5, 2))
        first = 0
        for (networks, count), memory, factors in zip(self._groups, self._memories, self._factors, strict=True):
            group, architecture = slice(first, first + count), networks.architecture
            rows = window_rows(history.time, architecture.taps, architecture.stride)
            window = network_inputs(history, self._around, architecture.inputs, rows, still=still).transpose(1, 0, 2)
            window *= factors
            if architecture.filters:
                past = memory.filtered(float(history.time[-1]), window[:, -1], still).transpose(1, 0, 2)
                window = np.concatenate([past, window], axis=1)
            loads = networks.wrenches(window).reshape(count, 5, 6) * (water.density / TRAINED_DENSITY)
            loads *= self._load_factors
            if architecture.base == "coefficients":
                assert base is not None
                loads += base
            members[group] = loads
            present = window[:, -1]
            if at_rest and not still:
                present = network_inputs(history, self._around, architecture.inputs, rows[-1:], still=True)[0]
                present *= factors
            excess[group] = networks.excess(present).reshape(count, 5, 2)
            first += count
        return members, mean_and_spread(excess)[0]

    def save(self, histories: bool = True) -> dict[str, Any]:
        """Return the state of the coefficients, what the networks remember, and the record, or its length only."""
        saved: dict[str, Any] = {"count": len(self._times), "last_learnt": self._last_learnt}
        saved["memories"] = [memory.save() for memory in self._memories]
        if self._water is not None and self._coefficients is not None:
            saved["coefficients"] = self._coefficients.save(histories)
        if self.beyond is not None:
            saved["beyond"] = self.beyond.save(histories)
        if histories:
            saved["times"] = np.array(self._times)
            saved["spread"] = np.array(self._spread).reshape(-1, 5, 6)
            saved["excess"] = np.array(self._excess).reshape(-1, 5, 2)
            saved["fallback"] = np.array(self._fallback).reshape(-1, 5)
            saved["wide"] = np.array(self._wide).reshape(-1, 5)
        return saved

    def restore(self, saved: dict[str, Any]) -> None:
        """Return to a state given by `save`; a record kept after it is dropped."""
        if self._water is not None and self._coefficients is not None:
            self._coefficients.restore(saved["coefficients"])
        self._last_learnt = None if saved["last_learnt"] is None else np.array(saved["last_learnt"])
        for memory, kept in zip(self._memories, saved["memories"], strict=True):
            memory.restore(kept)
        if "times" in saved:
            self._times = [float(t) for t in saved["times"]]
            self._spread, self._excess = list(saved["spread"]), list(saved["excess"])
            self._fallback, self._wide = list(saved["fallback"]), list(saved["wide"])
        for series in (self._times, self._spread, self._excess, self._fallback, self._wide):
            del series[saved["count"] :]
        if self.beyond is not None:
            self.beyond.restore(saved["beyond"])

    def record(self) -> dict[str, xr.DataArray]:
        """Return error bars of the wrenches, distance from the training range and share of the coefficients."""
        if not self._times:
            return {}
        time = xr.Variable("macro_time", self._times, {"units": "s", "long_name": "start of the macro step"})
        coords = {"macro_time": time, "body": list(BODIES)}
        loads = self._recorded()
        found = {
            "load_spread": xr.DataArray(
                loads.spread, coords | {"component": list(WRENCH_COMPONENTS)},
                ("macro_time", "body", "component"),
                attrs={"units": "N, N m", "long_name": "standard deviation of the members' loads, body axes"},
            ),
            "range_excess": xr.DataArray(
                loads.excess, coords | {"range_kind": ["single", "joint"]}, ("macro_time", "body", "range_kind"),
                attrs={"units": "1", "long_name": "distance outside the training range, over its width or its reach"},
            ),
            "out_of_range": xr.DataArray(
                loads.outside, coords, ("macro_time", "body"),
                attrs={
                    "units": "1",
                    "long_name": f"whether the body's state lies outside the training range by {OUTSIDE:g}",
                },
            ),
            "fallback_share": xr.DataArray(
                loads.fallback, coords, ("macro_time", "body"),
                attrs={"units": "1", "long_name": "share of the calibrated coefficients in the loads"},
            ),
        }  # fmt: skip
        if loads.bars is not None:
            bars = np.where((loads.outside | (loads.fallback > 0.0))[..., None], np.nan, loads.bars)
            found["load_error_bar"] = xr.DataArray(
                bars, coords | {"component": list(WRENCH_COMPONENTS)}, ("macro_time", "body", "component"),
                attrs={
                    "units": "N, N m",
                    "long_name": "standard deviation of the loads' error beside the flow, body axes",
                    "comment": "nan outside the training range, where it was not measured",
                },
            )  # fmt: skip
        if self.beyond is not None:
            found["wide_range_share"] = xr.DataArray(
                np.array(self._wide), coords, ("macro_time", "body"),
                attrs={"units": "1", "long_name": "share of the networks of a wider range, and what they rest on"},
            )  # fmt: skip
        return found

    def _recorded(self) -> _Recorded:
        """Return what was recorded, of these networks and of those beyond their range together."""
        spread, excess, fallback = (np.array(series) for series in (self._spread, self._excess, self._fallback))
        bars = None
        if self._floor is not None and self._water is not None:
            floor = self._water.density / TRAINED_DENSITY * self._load_factors * self._floor
            bars = bars_of(spread, floor)
        if self.beyond is None:
            return _Recorded(spread, excess, fallback, bars)
        others, wide = self.beyond._recorded(), np.array(self._wide)
        part = wide[..., None]
        bars = None if bars is None or others.bars is None else (1.0 - part) * bars + part * others.bars
        return _Recorded(
            (1.0 - part) * spread + part * others.spread, np.where(part > 0.0, others.excess, excess),
            (1.0 - wide) * fallback + wide * others.fallback, bars,
        )  # fmt: skip


class _Recorded(NamedTuple):
    """What is recorded in a run of n macro steps."""

    spread: Array
    """Shape (n, 5, 6)"""
    excess: Array
    """Shape (n, 5, 2)"""
    fallback: Array
    """Share of the coefficients, shape (n, 5)"""
    bars: Array | None
    """Error bars; None: they were never measured"""

    @property
    def outside(self) -> NDArray[np.bool_]:
        """Where the state lies outside the training range."""
        return np.asarray(self.excess.max(axis=-1) > OUTSIDE)


def shipped_networks() -> list[Path]:
    """Return the files of the shipped networks: for lane changes of the amphibious vehicle, 40 to 60 % depth."""
    return sorted(WEIGHTS.glob("*.safetensors"))


@njit(cache=True, error_model="numpy")
def _share_of_others(excess: Array, blend: tuple[float, float]) -> Array:
    """Return the share of what takes over [-], shape (5,), for an excess of shape (5, 2)."""
    worst = np.maximum(excess[:, 0], excess[:, 1])
    share = np.minimum(np.maximum((worst - blend[0]) / (blend[1] - blend[0]), 0.0), 1.0)
    return share * share * (3.0 - 2.0 * share)
