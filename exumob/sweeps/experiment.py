"""A run as data: any of its fields can be set by its dotted name, ``hull.mass``, ``water.depth_ratio``, ``soil.n``."""

from __future__ import annotations

import contextlib
import difflib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass, replace
from operator import attrgetter
from typing import Any, TypeVar, cast

import numpy as np
import xarray as xr

from exumob.coupling.explicit import Explicit
from exumob.driving.maneuver import ConstantSteer, LaneChange, Maneuver, lane_change
from exumob.driving.path_following import PathFollowing
from exumob.ground.soil import Soil
from exumob.ground.terrain import Terrain
from exumob.simulation.description import RunDescription, Steps
from exumob.simulation.run import simulate
from exumob.simulation.settings import DEFAULT_SETTING, DURATION, RECORD_STEP, setting_named
from exumob.simulation.trust import trust_of_all
from exumob.simulation.water_models import DEFAULT_MODEL, MODELS, hydrodynamics_named
from exumob.surrogates.model import SurrogateHydrodynamics
from exumob.surrogates.networks import GEOMETRY
from exumob.vehicle.parameters import Vehicle
from exumob.water.coefficients import Coefficients
from exumob.water.conditions import Water
from exumob.water.hydrodynamics import Hydrodynamics

T = TypeVar("T")
MANEUVERS: dict[str, Maneuver] = {
    "lane change": LaneChange(), "straight": ConstantSteer(), "path following": PathFollowing(),
}  # fmt: skip
"""Values of ``maneuver``, with the maneuver that each name stands for."""
COMPARED = 20
"""Number of different values of a name that a sweep's line of trust looks at, unless they are numbers."""
STEPS = ("duration", "micro_step", "macro_step", "record_step")
"""Fields of the time of a run [s]."""


@dataclass(frozen=True)
class Experiment:
    """One lane change, or another maneuver, ready to be run; calling it with values by name runs it with them.

    The names are those of `Vehicle` and its parts (``hull.mass``, ``wheelbase``), ``soil`` (a published name) and
    ``soil.<field>``, ``water.<field>`` and ``water.depth_ratio`` (over the tyre's diameter; 0: no water), ``maneuver``
    (one of `MANEUVERS`) and ``maneuver.<field>``, ``hydrodynamics`` (one of `MODELS`; sweeps, maps and
    tuning choose one for all cases where it is ``"auto"``), ``hydrodynamics.member`` (one
    network of the ensemble, by number), ``hydrodynamics.<field>`` of the coefficients, and ``duration``,
    ``setting``, ``micro_step``, ``macro_step``, ``record_step``.
    """

    vehicle: Vehicle
    soil: Soil
    water: Water | None = None
    maneuver: Maneuver = field(default_factory=lane_change)
    hydrodynamics: str = DEFAULT_MODEL
    """One of `exumob.simulation.water_models.MODELS`"""
    member: int | None = None
    """The network that acts alone; None: the whole ensemble"""
    coefficients: Coefficients = field(default_factory=Coefficients)
    duration: float = DURATION
    """[s]"""
    setting: str = DEFAULT_SETTING
    """One of `exumob.simulation.settings.SETTINGS`: the steps where they are not given"""
    micro_step: float | None = None
    """[s]; None: by the setting"""
    macro_step: float | None = None
    """[s]; None: by the setting"""
    record_step: float = RECORD_STEP
    """[s]"""

    def __post_init__(self) -> None:
        if self.hydrodynamics not in MODELS:
            raise ValueError(f"hydrodynamics = {self.hydrodynamics!r} is not known; use {', '.join(MODELS)}.")
        setting_named(self.setting)

    def names(self) -> list[str]:
        """Dotted names of everything that can be varied."""
        found = _leaves(self.vehicle) + [f"soil.{n}" for n in _leaves(self.soil)] + ["soil"]
        found += ["water.depth_ratio", *(f"water.{n}" for n in _leaves(self.water or Water(0.1)))]
        if is_dataclass(self.maneuver):
            found += ["maneuver", *(f"maneuver.{n}" for n in _leaves(self.maneuver))]
        return [
            *found, "hydrodynamics", "hydrodynamics.member", "setting",
            *(f"hydrodynamics.{f.name}" for f in fields(Coefficients)), *STEPS,
        ]  # fmt: skip

    def with_values(self, values: Mapping[str, Any]) -> Experiment:
        """The experiment with other values.

        Raises
        ------
        ValueError
            If a name is not known, or a value is refused by the field that it belongs to.
        """
        changed = self._with("maneuver", values["maneuver"]) if "maneuver" in values else self  # its fields are names
        changed.check_names(values)
        for name in sorted(values, key=lambda n: (n.count("."), n == "water.depth_ratio", n)):
            changed = changed._with(name, values[name])
        return changed

    def value(self, name: str) -> Any:
        """Value that a name has now; if there is no water, ``water.<field>`` is that of the default water."""
        self.check_names([name])
        owner, _, rest = name.partition(".")
        if name == "water.depth_ratio":
            return 0.0 if self.water is None else self.water.depth / self.vehicle.wheel.diameter
        if name in ("micro_step", "macro_step") and getattr(self, name) is None:
            return getattr(setting_named(self.setting), name)
        if name in ("soil", "maneuver", "hydrodynamics", "setting", *STEPS):
            return getattr(self, name)
        if name == "hydrodynamics.member":
            return self.member
        owners = {
            "soil": self.soil, "water": self._wet(), "maneuver": self.maneuver, "hydrodynamics": self.coefficients,
        }  # fmt: skip
        return attrgetter(rest)(owners[owner]) if owner in owners else attrgetter(name)(self.vehicle)

    def check_names(self, names: Iterable[str]) -> None:
        """Raise ValueError if a name is not known."""
        known = self.names()
        for name in names:
            if name not in known:
                near = difflib.get_close_matches(name, known, 3, 0.5)
                hint = f"did you mean {' or '.join(near)}?" if near else f"use one of {', '.join(known)}."
                raise ValueError(f"parameter {name!r} is not known; {hint}")

    def check_values(self, name: str, values: Iterable[Any]) -> None:
        """Raise ValueError if a value, set by itself, is refused; for many values faster than `with_values`."""
        self.check_names([name])
        for value in values:
            self._with(name, value)

    def _with(self, name: str, value: Any) -> Experiment:
        owner, _, rest = name.partition(".")
        if name in STEPS:
            return _replaced(self, name, float(value))
        if name == "soil":
            return replace(self, soil=value if isinstance(value, Soil) else Soil.published(value))
        if name == "maneuver":
            return replace(self, maneuver=maneuver_named(value) if isinstance(value, str) else value)
        if name in ("hydrodynamics", "setting"):
            return replace(self, **{name: value})
        if name == "hydrodynamics.member":
            chosen = "networks" if self.hydrodynamics == "auto" and value is not None else self.hydrodynamics
            return replace(self, hydrodynamics=chosen, member=None if value is None else int(value))
        if owner == "hydrodynamics":
            return replace(self, coefficients=_replaced(self.coefficients, rest, value))
        if name == "water.depth_ratio":
            if value == 0.0:
                return replace(self, water=None)
            return replace(self, water=_replaced(self._wet(), "depth", value * self.vehicle.wheel.diameter))
        if owner == "water":
            return replace(self, water=_replaced(self._wet(), rest, value))
        if owner == "soil":
            return replace(self, soil=_replaced(self.soil, rest, value))
        if owner == "maneuver":
            return replace(self, maneuver=_replaced(self.maneuver, rest, value))
        return replace(self, vehicle=_replaced(self.vehicle, name, value))

    def _wet(self) -> Water:
        return self.water or Water(0.5 * self.vehicle.wheel.diameter)

    def water_model(self) -> Hydrodynamics:
        """Make the model of the water's loads, ready for a run.

        Raises
        ------
        ValueError
            If the ensemble has no network with the number `member`, or the networks do not fit the vehicle.
        """
        model = hydrodynamics_named(self.hydrodynamics, self.vehicle, self.water, coefficients=self.coefficients)
        if self.member is None or not isinstance(model, SurrogateHydrodynamics):
            return model
        if not 0 <= self.member < len(model.networks):
            raise ValueError(f"hydrodynamics.member = {self.member}: there are {len(model.networks)}, from 0 on.")
        return SurrogateHydrodynamics(model.networks[self.member])

    def member_count(self) -> int:
        """Number of networks in the ensemble that comes with exumob."""
        return len(SurrogateHydrodynamics().networks)

    def network_digests(self) -> str:
        """Digests of the networks that give the water's loads, as text; empty if none do."""
        if self.hydrodynamics not in ("auto", "networks"):
            return ""
        return " ".join(network.digest() for network in SurrogateHydrodynamics().networks)

    def with_one_model(self, cases: Sequence[Mapping[str, Any]] = ()) -> Experiment:
        """Choose the model of the water's loads for all cases, so that none differs from another by its model.

        ``"auto"`` becomes ``"networks"`` if those that come with exumob fit the vehicle of every case, and
        ``"coefficients"`` otherwise, with a warning; where a member of the ensemble is named, networks are asked for.
        """
        names = {name for case in cases for name in case}
        dry = self.water is None and not any(name.startswith("water.") for name in names)
        if self.hydrodynamics != "auto" or dry:
            return self
        if self.member is not None or "hydrodynamics.member" in names:
            return replace(self, hydrodynamics="networks")
        for name in GEOMETRY:
            for value in {repr(case[name]): case[name] for case in cases if name in case}.values():
                changed = self._with(name, value)
                model = hydrodynamics_named("auto", changed.vehicle, changed._wet())
                if not isinstance(model, SurrogateHydrodynamics):
                    return replace(self, hydrodynamics="coefficients")
        fits = isinstance(hydrodynamics_named("auto", self.vehicle, self._wet()), SurrogateHydrodynamics)
        return replace(self, hydrodynamics="networks" if fits else "coefficients")

    def description(self, hydrodynamics: Hydrodynamics) -> RunDescription:
        """Describe the run with a model of the water's loads, as its line of trust needs it."""
        usual_micro_step, usual_macro_step = setting_named(self.setting).steps(flow_in_loop=False)
        steps = Steps(
            self.duration, self.micro_step or usual_micro_step, self.macro_step or usual_macro_step, self.record_step
        )
        rolling = self.maneuver.wheel_speed(0.0)[0] * self.vehicle.wheel.radius
        return RunDescription(
            self.vehicle, self.soil, self.water, Terrain(), self.maneuver, hydrodynamics, Explicit(), steps, rolling
        )

    def trust(self, cases: Sequence[Mapping[str, Any]]) -> dict[str, str | float]:
        """Say what the runs of a sweep are worth, as attributes (see `exumob.simulation.trust.trust_of_all`).

        Of numbers the smallest and the largest of each name are compared, of other values each. Where cases choose
        their model of the water by themselves, each model has a line of its own.
        """
        chosen: set[int] = set()
        for name in cases[0] if cases else ():
            values = [case[name] for case in cases]
            if all(isinstance(value, int | float) for value in values):
                chosen |= {int(np.argmin(values)), int(np.argmax(values))}
            else:
                chosen |= set(list({repr(value): n for n, value in enumerate(values)}.values())[:COMPARED])
        found: dict[str, list[Experiment]] = {}
        for case in [cases[n] for n in sorted(chosen)] or [{}]:
            with contextlib.suppress(ValueError):  # values that do not go together have become rows
                run = self.with_values(case)
                found.setdefault(run.hydrodynamics, []).append(run)
        attributes: dict[str, str | float] = {}
        for runs in found.values():
            wet = next((run for run in runs if run.water is not None), runs[0])
            with contextlib.suppress(ValueError):
                model = wet.water_model()
                more = trust_of_all([run.description(model) for run in runs]).attributes()
                attributes = more if not attributes else {"trust": f"{attributes['trust']} {more['trust']}"}
        return attributes

    def check(self) -> None:
        """Raise ValueError if the networks were trained for another vehicle."""
        model = self.water_model()
        for network in getattr(model, "networks", []):
            network.check_vehicle(self.vehicle)

    def run(self) -> xr.Dataset:
        """Simulate the experiment; see `exumob.simulate`."""
        return simulate(
            self.vehicle, self.soil, self.water, self.maneuver, self.water_model(), duration=self.duration,
            setting=self.setting, micro_step=self.micro_step, macro_step=self.macro_step, record_step=self.record_step,
        )  # fmt: skip

    def __call__(self, values: Mapping[str, Any]) -> xr.Dataset:
        """Simulate the experiment with other values."""
        return self.with_values(values).run()


def amphibious_lane_change() -> Experiment:
    """Experiment with the paper's vehicle and maneuver in D60/U1 on LETE sand."""
    from vehicle_models.amphibious import amphibious_vehicle

    return Experiment(amphibious_vehicle(), Soil.published("LETE sand"), Water.at_ratio(0.6, 1.0), LaneChange())


def amphibious_crossing() -> Experiment:
    """Experiment for mobility maps: the paper's vehicle straight ahead for 5 s in D60/U1 on LETE sand."""
    return replace(amphibious_lane_change(), maneuver=ConstantSteer(), duration=5.0)


def maneuver_named(name: str) -> Maneuver:
    """Maneuver that a name stands for, one of `MANEUVERS`.

    Raises
    ------
    ValueError
        If none has this name.
    """
    if name not in MANEUVERS:
        raise ValueError(f"maneuver = {name!r} is not known; use {', '.join(map(repr, MANEUVERS))}.")
    return MANEUVERS[name]


def _leaves(thing: Any) -> list[str]:
    """Dotted names of the fields of a dataclass and of those within it."""
    found = []
    for f in fields(thing):
        value = getattr(thing, f.name)
        if is_dataclass(value):
            found += [f"{f.name}.{inner}" for inner in _leaves(value)]
        else:
            found.append(f.name)
    return found


def _replaced(thing: T, name: str, value: Any) -> T:
    first, _, rest = name.partition(".")
    if rest:
        value = _replaced(getattr(thing, first), rest, value)
    return cast(T, replace(cast(Any, thing), **{first: value}))
