"""A run as data: any of its fields can be set by its dotted name, ``hull.mass``, ``water.depth_ratio``, ``soil.n``."""

from __future__ import annotations

import contextlib
import difflib
import functools
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import MISSING, dataclass, field, fields, is_dataclass, replace
from numbers import Real
from operator import attrgetter
from pathlib import Path
from typing import Annotated, Any, TypeVar, cast, get_args

import numpy as np
import xarray as xr

from exumob.coupling.explicit import Explicit
from exumob.driving.maneuver import ConstantSteer, LaneChange, Maneuver, lane_change
from exumob.driving.named import maneuver_for, maneuver_named
from exumob.ground.soil import Soil
from exumob.ground.terrain import Terrain
from exumob.simulation.checks import check_steps
from exumob.simulation.description import RunDescription, Steps
from exumob.simulation.run import simulate
from exumob.simulation.settings import DEFAULT_SETTING, DURATION, RECORD_STEP, SETTINGS, setting_named
from exumob.simulation.water_models import DEFAULT_MODEL, MODELS, hydrodynamics_named
from exumob.support import quantities
from exumob.support.declared import Declared, DeclaredField, check_of, declared_fields
from exumob.support.files import why_no_file
from exumob.support.quantities import DEPTH_RATIO, STEP, Quantity, shown
from exumob.surrogates.ensemble import require_different
from exumob.surrogates.model import SurrogateHydrodynamics
from exumob.surrogates.networks import NAMED
from exumob.surrogates.vehicle_shape import FURTHER_GEOMETRY, GEOMETRY
from exumob.vehicle.parameters import Vehicle
from exumob.vehicle.point_force import PointForce
from exumob.vehicle.start_pose import AT_ORIGIN, StartPose
from exumob.water.coefficients import Coefficients
from exumob.water.conditions import Water
from exumob.water.hydrodynamics import Hydrodynamics
from exumob.water.wave_loads import fitted_coefficients

T = TypeVar("T")
LEVEL_GROUND = Terrain()
STEPS = ("duration", "micro_step", "macro_step", "record_step", "initial_speed")
"""Fields of the time of a run [s], and the speed with which it begins [m/s]."""
WHOLE = ("setting", "soil", "maneuver", "hydrodynamics", "forces")
"""Names of what is chosen as a whole, mostly by a name of its own."""
PARTS = ("soil", "water", "maneuver", "hydrodynamics", "forces")
"""Owners of fields; the fields of all others are the vehicle's."""
WITHOUT_NETWORKS = ("coefficients", "none")
"""Models of the water to which networks are nothing."""
RATIO, MEMBER = "water.depth_ratio", "hydrodynamics.member"


@dataclass(frozen=True)
class Experiment(Declared):
    """One lane change, or another maneuver, ready to be run; calling it with values by name runs it with them.

    The names are those of `Vehicle` and its parts (``hull.mass``, ``wheelbase``), ``soil`` (a published name) and
    ``soil.<field>``, ``water.<field>`` and ``water.depth_ratio`` (over the tyre's diameter; 0: no water), ``maneuver``
    (one of `exumob.driving.named.MANEUVERS`) and ``maneuver.<field>``, ``hydrodynamics`` (one of `MODELS`; sweeps, maps
    and tuning choose one for all cases where it is ``"auto"``), ``hydrodynamics.member`` (one network of the ensemble,
    by number), ``hydrodynamics.<field>`` of the coefficients, ``forces`` and
    ``forces.<number>.<field>`` (and ``forces.0.force.<field>`` where the function is a dataclass with ``__call__``),
    and ``duration``, ``setting``, ``micro_step``, ``macro_step``, ``record_step``, ``initial_speed``.
    """

    vehicle: Vehicle
    """The vehicle"""
    soil: Soil
    """The ground"""
    water: Water | None = None
    """The water; None: dry ground"""
    maneuver: Maneuver = field(default_factory=lane_change)
    """What the driver does"""
    hydrodynamics: str = DEFAULT_MODEL
    """One of `exumob.simulation.water_models.MODELS`"""
    networks: tuple[Path, ...] = ()
    """Files of networks that are the ensemble (`exumob.surrogates.ensemble`), or names of those that come with exumob
    (`exumob.surrogates.networks.NAMED`); empty: those of `exumob.surrogates.model.SurrogateHydrodynamics`"""
    member: Annotated[int | None, Quantity("1", at_least=0.0)] = None
    """The network that acts alone; None: the whole ensemble"""
    coefficients: Coefficients = field(default_factory=Coefficients)
    """Those of the coefficient model"""
    duration: Annotated[float, quantities.DURATION] = DURATION
    """Simulated time"""
    setting: str = DEFAULT_SETTING
    """One of `exumob.simulation.settings.SETTINGS`: the steps where they are not given"""
    micro_step: Annotated[float | None, STEP] = None
    """Step of the multibody solver; None: by the setting"""
    macro_step: Annotated[float | None, STEP] = None
    """Interval at which the water's loads are renewed; None: by the setting"""
    record_step: Annotated[float, STEP] = RECORD_STEP
    """Interval between the instants of a result"""
    initial_speed: Annotated[float | None, quantities.INITIAL_SPEED] = None
    """Speed at time 0, all wheels rolling; None: as the maneuver's wheels turn then"""
    forces: tuple[PointForce, ...] = ()
    """Forces of the user's own, such as a tow rope"""
    terrain: Terrain = LEVEL_GROUND
    """Shape of the ground"""
    start: StartPose = AT_ORIGIN
    """Where the vehicle begins, and its heading there"""
    sized: Vehicle | None = None
    """The vehicle whose size speed and times of a maneuver chosen by name go with (`maneuver_for`), whatever of it is
    varied; None: the paper's"""

    def _check(self) -> None:
        if self.hydrodynamics not in MODELS:
            raise ValueError(f"hydrodynamics = {self.hydrodynamics!r} is not known; use {', '.join(MODELS)}.")
        setting_named(self.setting)

    def names(self) -> list[str]:
        """Dotted names of everything that can be varied."""
        found = _leaves(self.vehicle) + [f"soil.{n}" for n in _leaves(self.soil)] + ["soil"]
        water = self.water or Water(0.1)
        found += [RATIO] if water.depth is not None else []
        found += [f"water.{n}" for n in water.parameters if n != "field"]
        if is_dataclass(self.maneuver):
            found += ["maneuver", *(f"maneuver.{n}" for n in _leaves(self.maneuver))]
        return [
            *found, "forces", *(f"forces.{n}.{name}" for n, force in enumerate(self.forces) for name in _leaves(force)),
            "hydrodynamics", "hydrodynamics.member", "setting",
            *(f"hydrodynamics.{f.name}" for f in fields(Coefficients)), *STEPS,
        ]  # fmt: skip

    def with_vehicle(self, vehicle: Vehicle) -> Experiment:
        """The experiment with another vehicle, driven by Froude's law, as deep in the water over the size of its tyres.

        Speed of the tyres' tread, times of the maneuver (`maneuver_for`), duration, rounded up to whole macro steps,
        and initial speed go with the root of the wheelbase. Current, a level or a field, waypoints that are given,
        start and forces stay as they are.
        """
        water, unit = self.water, math.sqrt(vehicle.wheelbase / self.vehicle.wheelbase)
        step = self.macro_step or setting_named(self.setting).macro_step
        if water is not None and water.depth is not None:
            water = replace(water, depth=water.depth / self.vehicle.wheel.diameter * vehicle.wheel.diameter)
        return replace(
            self, vehicle=vehicle, water=water, maneuver=maneuver_for(self.maneuver, self.vehicle, vehicle),
            duration=round(math.ceil(unit * self.duration / step - 1e-6) * step, 9),
            initial_speed=None if self.initial_speed is None else unit * self.initial_speed, sized=vehicle,
        )  # fmt: skip

    def with_networks(self, files: Sequence[str | Path], folder: Path | None = None) -> Experiment:
        """The experiment with networks of one's own.

        Parameters
        ----------
        files : sequence of str or path
            See `networks`.
        folder : Path, optional
            Where they lie, unless they come with exumob; default: the current one.

        Raises
        ------
        ValueError
            If a file holds no networks, or is named twice; or networks do not fit the vehicle, or have no effect on
            the model of the water.
        """
        found = tuple(Path(f) if folder is None or str(f) in NAMED else folder / f for f in files)
        if found and self.hydrodynamics in WITHOUT_NETWORKS:
            raise ValueError(
                f"networks ({', '.join(map(str, found))}) have no effect with hydrodynamics = {self.hydrodynamics!r}; "
                "leave them out, or choose 'networks'."
            )
        require_different("networks", found)
        changed = replace(self, networks=found)
        if found:  # what is wrong with them is said before anything runs
            changed._ensemble()
            changed.check()
        return changed

    def with_values(self, values: Mapping[str, Any]) -> Experiment:
        """The experiment with other values; those that belong together change at once.

        Raises
        ------
        ValueError
            If a name is not known, or a value is refused by the field that it belongs to.
        """
        changed = self
        for name in WHOLE:  # their fields may be among the values
            if name in values:
                changed = changed._with_whole(name, values[name])
        changed.check_names(values)
        parts: dict[str, _Changes] = {}
        for name, value in values.items():
            owner, _, rest = name.partition(".")
            if name in WHOLE or name in (RATIO, MEMBER):
                continue
            if name in STEPS:
                parts.setdefault("", _Changes())[name] = value
            elif owner in PARTS:
                parts.setdefault(owner, _Changes()).put(rest, value)
            else:
                parts.setdefault("vehicle", _Changes()).put(name, value)
        fields_of_run: dict[str, Any] = dict(parts.pop("", {}))
        if MEMBER in values:
            fields_of_run |= changed._with_member(values[MEMBER])
        for owner in ("vehicle", "soil", "maneuver"):
            if owner in parts:
                fields_of_run[owner] = _replaced(getattr(changed, owner), parts[owner])
        if "hydrodynamics" in parts:
            fields_of_run["coefficients"] = _replaced(changed.coefficients, parts["hydrodynamics"])
        if "forces" in parts:
            fields_of_run["forces"] = tuple(
                _replaced(force, parts["forces"].get(str(n), _Changes())) for n, force in enumerate(changed.forces)
            )
        vehicle = fields_of_run.get("vehicle", changed.vehicle)
        water = parts.get("water", _Changes())
        if RATIO in values:
            ratio = _depth_ratio(values[RATIO])
            if "depth" in water:
                raise ValueError(f"water.depth and {RATIO} say the same; give one of them.")
            if ratio == 0.0:
                return replace(changed, **fields_of_run | {"water": None})
            water["depth"] = ratio * vehicle.wheel.diameter
        if water:
            fields_of_run["water"] = _replaced(changed._wet(), water)
        return replace(changed, **fields_of_run) if fields_of_run else changed

    def value(self, name: str) -> Any:
        """Value that a name has now; if there is no water, ``water.<field>`` is that of the default water."""
        self.check_names([name])
        if name == "water.depth_ratio":
            return 0.0 if self.water is None else self.water.uniform_depth / self.vehicle.wheel.diameter
        if name in ("micro_step", "macro_step") and getattr(self, name) is None:
            return getattr(setting_named(self.setting), name)
        if name == "initial_speed" and self.initial_speed is None:
            return self.maneuver.wheel_speed(0.0)[0] * self.vehicle.wheel.radius
        if name in (*WHOLE, *STEPS):
            return getattr(self, name)
        if name == "hydrodynamics.member":
            return self.member
        return getattr(self._owner(name), name.rpartition(".")[2])

    def check_names(self, names: Iterable[str]) -> None:
        """Raise ValueError if a name is not known."""
        known = self._known
        for name in names:
            if name in (RATIO, "water.depth") and self.water is not None and self.water.depth is None:
                given = "level" if self.water.field is None else "field"
                raise ValueError(
                    f"{name}: the water of this experiment is given by its {given}, and this needs water of one depth "
                    f"over level ground; give Water(depth=...){', or vary water.level' if given == 'level' else ''}."
                )
            if name not in known:
                near = difflib.get_close_matches(name, known, 3, 0.5) if isinstance(name, str) else []
                groups = dict.fromkeys(one.partition(".")[0] for one in known)
                hint = (
                    f"did you mean {' or '.join(near)}?"
                    if near
                    else f"use one that begins with {', '.join(groups)} (Experiment.names() lists them; "
                    "docs/howto/sweeps.md says what they are)."
                )
                raise ValueError(f"parameter {name!r} is not known; {hint}")

    @functools.cached_property
    def _known(self) -> dict[str, None]:
        return dict.fromkeys(self.names())

    def declaration(self, name: str) -> DeclaredField | None:
        """What is declared of a name: type, unit, bounds and meaning; None if nothing is."""
        self.check_names([name])
        if name == RATIO:
            return DeclaredField(name, float, DEPTH_RATIO, MISSING, "depth of the water over the tyre's diameter")
        return _fields_of(type(self._owner(name))).get(name.rpartition(".")[2])

    def meaning(self, name: str, case: Mapping[str, Any] | None = None) -> tuple[str, str]:
        """Unit, as netCDF writes it, and meaning of a name in the cases of a sweep, of which `case` is one."""
        maneuver = {} if case is None else {"maneuver": case["maneuver"]} if "maneuver" in case else {}
        found = self.with_values(maneuver).declaration(name)
        if found is None:
            return "1", name
        unit = "1" if found.quantity is None else netcdf_unit(found.quantity.unit)
        return unit, found.meaning.split("\n")[0] or name

    def check_values(self, name: str, values: Iterable[Any]) -> None:
        """Raise ValueError if a value is refused by the declaration of its name; fast for many numbers.

        Whether values of several names fit each other is not looked at.
        """
        found, declared = list(values), self.declaration(name)
        if name in WHOLE or name in (RATIO, MEMBER) or declared is None or not isinstance(self._owner(name), Declared):
            for value in _distinct(found):
                self.with_values({name: value})
            return
        quantity = declared.quantity
        hint = declared.kind if quantity is None else Annotated[declared.kind, quantity]
        check = check_of(hint)
        if quantity is not None and quantity.shape is None and {type(value) for value in found} <= {float, int}:
            low, high = quantity.safe
            try:
                numbers = np.array(found, float)
                found = [found[n] for n in np.flatnonzero(~((numbers >= low) & (numbers <= high)))]
            except OverflowError:
                pass
        for value in _distinct(found):
            accepted = check(name, value)
            if isinstance(accepted, Path) and not accepted.is_file():
                raise ValueError(f"{name} = {str(accepted)!r} {why_no_file(accepted)}; give the path of a file.")

    def typed(self, case: Mapping[str, Any]) -> dict[str, Any]:
        """Values of a case, with paths as `Path`, so that the contents of the files count."""
        return {name: self._path(name, value) if isinstance(value, str) else value for name, value in case.items()}

    def _path(self, name: str, text: str) -> Any:
        return Path(text) if name in self._names_of_files else text

    @functools.cached_property
    def _names_of_files(self) -> frozenset[str]:
        found = ((name, self.declaration(name)) for name in self._known)
        return frozenset(n for n, f in found if f is not None and (f.kind is Path or Path in get_args(f.kind)))

    def _owner(self, name: str) -> Any:
        """The object whose field a name is."""
        owner, _, rest = name.partition(".")
        if name in (*STEPS, *WHOLE, MEMBER):
            return self
        parts = {
            "soil": self.soil, "water": self._wet(), "maneuver": self.maneuver, "hydrodynamics": self.coefficients,
        }  # fmt: skip
        if owner == "forces":
            number, _, rest = rest.partition(".")
            thing: Any = self.forces[int(number)]
        else:
            thing, rest = (parts[owner], rest) if owner in parts else (self.vehicle, name)
        above = rest.rpartition(".")[0]
        return attrgetter(above)(thing) if above else thing

    def _with_whole(self, name: str, value: Any) -> Experiment:
        """The experiment with another soil, maneuver, model of the water's loads, setting, or other forces."""
        if name == "soil":
            if not isinstance(value, Soil | str):
                raise ValueError(f"soil = {shown(value)} must be the name of a published soil, or a Soil.")
            return replace(self, soil=value if isinstance(value, Soil) else Soil.published(value))
        if name == "maneuver":
            return replace(self, maneuver=self._driven(value) if isinstance(value, str) else value)
        if name == "forces":
            several = [value] if isinstance(value, PointForce) else value
            if not isinstance(several, list | tuple) or not all(isinstance(one, PointForce) for one in several):
                raise ValueError(f"forces = {shown(value)} must be a list of PointForce; give it in Python.")
            return replace(self, forces=tuple(several))
        known = MODELS if name == "hydrodynamics" else tuple(SETTINGS)
        if not isinstance(value, str) or value not in known:
            raise ValueError(f"{name} = {shown(value)} is not known; use {', '.join(map(repr, known))}.")
        chosen: dict[str, Any] = {name: str(value)}
        return replace(self, **chosen)

    def _driven(self, name: str) -> Maneuver:
        """The maneuver of a name, as `sized` drives it."""
        from vehicle_models.amphibious import amphibious_vehicle

        named = maneuver_named(name)
        return named if self.sized is None else maneuver_for(named, amphibious_vehicle(), self.sized)

    def _with_member(self, value: Any) -> dict[str, Any]:
        if value is None:
            return {"member": None}
        whole = isinstance(value, int | float | np.number) and not isinstance(value, bool) and 0 <= value < 1e6
        if not whole or value != int(value):
            raise ValueError(f"{MEMBER} = {shown(value)} must be the number of a network, a whole number >= 0.")
        chosen = "networks" if self.hydrodynamics == "auto" else self.hydrodynamics
        return {"hydrodynamics": chosen, "member": int(value)}

    def _wet(self) -> Water:
        return self.water or Water(0.5 * self.vehicle.wheel.diameter)

    def water_model(self) -> Hydrodynamics:
        """Make the model of the water's loads, ready for a run.

        Raises
        ------
        ValueError
            If the ensemble has no network with the number `member`, or the networks do not fit the vehicle.
        """
        networks = () if self.hydrodynamics in WITHOUT_NETWORKS else self.networks
        model = hydrodynamics_named(
            self.hydrodynamics, self.vehicle, self.water, networks=networks, coefficients=self.coefficients
        )
        if self.member is None or self.water is None:
            return model
        if not isinstance(model, SurrogateHydrodynamics):
            raise ValueError(
                f"{MEMBER} = {self.member} has no effect with hydrodynamics = {self.hydrodynamics!r}; leave it out, or "
                "choose 'networks'."
            )
        if not 0 <= self.member < len(model.networks):
            raise ValueError(f"hydrodynamics.member = {self.member}: there are {len(model.networks)}, from 0 on.")
        return model.member(self.member)

    def member_count(self) -> int:
        """Number of networks in the ensemble."""
        return len(self._ensemble().networks)

    def _ensemble(self) -> SurrogateHydrodynamics:
        return SurrogateHydrodynamics(self.networks or None)

    def beyond_its_fields(self) -> dict[str, str]:
        """Digests of networks and fitted coefficients that may give the loads, for `exumob.support.identity`."""
        used = self.hydrodynamics in ("auto", "networks") or bool(self.networks)
        fitted = self.hydrodynamics in ("auto", "networks", "calibrated")
        return {
            "ensemble": " ".join(n.digest() for n in self._ensemble().all_networks) if used else "",
            "wave_coefficients": fitted_coefficients().digest() if fitted else "",
        }

    def with_one_model(self, cases: Sequence[Mapping[str, Any]] = (), also: Iterable[str] = ()) -> Experiment:
        """Choose the model of the water's loads for all cases, so that none differs from another by its model.

        ``"auto"`` becomes ``"networks"`` if those that come with exumob fit the vehicle of every case, and
        ``"calibrated"`` otherwise, with a warning; where networks or a member of the ensemble are named, networks are
        asked for, and where a coefficient is or has another value, calibrated ones. `also` are further names that will
        be varied.
        """
        names = {name for case in cases for name in case} | set(also)
        dry = self.water is None and not any(name.startswith("water.") for name in names)
        if self.hydrodynamics != "auto" or dry:
            return self
        if self.member is not None or self.networks or MEMBER in names:
            return replace(self, hydrodynamics="networks")
        if self.coefficients != Coefficients() or any(name.startswith("hydrodynamics.") for name in names):
            return replace(self, hydrodynamics="calibrated")
        places = [name for name in (*GEOMETRY, *FURTHER_GEOMETRY) if name in names]
        for values in {repr(v): v for v in ({n: case[n] for n in places if n in case} for case in cases)}.values():
            try:
                changed = self.with_values(values)
            except ValueError:  # becomes a row
                continue
            if not isinstance(hydrodynamics_named("auto", changed.vehicle, changed._wet()), SurrogateHydrodynamics):
                return replace(self, hydrodynamics="calibrated")
        fits = isinstance(hydrodynamics_named("auto", self.vehicle, self._wet()), SurrogateHydrodynamics)
        return replace(self, hydrodynamics="networks" if fits else "calibrated")

    def description(self, hydrodynamics: Hydrodynamics) -> RunDescription:
        """Describe the run with a model of the water's loads, as its line of trust needs it."""
        usual = setting_named(self.setting)
        steps = Steps(
            self.duration, self.micro_step or usual.micro_step, self.macro_step or usual.macro_step, self.record_step
        )
        rolling = self.maneuver.wheel_speed(0.0)[0] * self.vehicle.wheel.radius
        return RunDescription(
            self.vehicle,
            self.soil,
            self.water,
            self.terrain,
            self.maneuver,
            hydrodynamics,
            Explicit(),
            steps,
            rolling if self.initial_speed is None else self.initial_speed,
            self.forces,
            start=self.start,
        )

    def check(self) -> None:
        """Raise ValueError if steps do not fit each other, or the networks were trained for another vehicle."""
        self.check_steps()
        model = self.water_model()
        for network in getattr(model, "networks", []):
            network.check_vehicle(self.vehicle)

    def check_steps(self) -> None:
        """Raise ValueError if the steps do not fit each other, or the record does not fit into memory."""
        setting = setting_named(self.setting)
        micro = setting.micro_step if self.micro_step is None else self.micro_step
        macro = setting.macro_step if self.macro_step is None else self.macro_step
        steps = Steps(duration=self.duration, micro_step=micro, macro_step=macro, record_step=self.record_step)
        check_steps(steps)

    def run(self) -> xr.Dataset:
        """Simulate the experiment; see `exumob.simulate`."""
        return simulate(
            self.vehicle, self.soil, self.water, self.maneuver, self.water_model(), duration=self.duration,
            setting=self.setting, micro_step=self.micro_step, macro_step=self.macro_step, record_step=self.record_step,
            initial_speed=self.initial_speed, forces=self.forces, terrain=self.terrain, start=self.start,
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


def netcdf_unit(unit: str) -> str:
    """Unit as netCDF writes it: ``kg m-3`` for ``kg/m^3``."""
    above, *below = unit.split("/")
    parts = [above.replace("^", "")]
    for part in below:
        base, _, power = part.partition("^")
        parts.append(f"{base}-{power or 1}")
    return " ".join(parts).removeprefix("1 ") if below else parts[0]


class _Changes(dict[str, Any]):
    """New values of the fields of a dataclass by name, those of a dataclass within it as another of these."""

    def put(self, name: str, value: Any) -> None:
        first, _, rest = name.partition(".")
        if rest:
            self.setdefault(first, _Changes()).put(rest, value)
        else:
            self[first] = value


def _replaced(thing: T, changes: _Changes) -> T:
    values = {
        name: _replaced(getattr(thing, name), value) if isinstance(value, _Changes) else value
        for name, value in changes.items()
    }  # fmt: skip
    return cast(T, replace(cast(Any, thing), **values))


def _depth_ratio(value: Any) -> float:
    if isinstance(value, Real) and not isinstance(value, bool) and value == 0.0:
        return 0.0
    return DEPTH_RATIO.check(RATIO, value)


def _distinct(values: list[Any]) -> list[Any]:
    try:
        return list(dict.fromkeys(values))
    except TypeError:  # lists and the like
        return values


_FIELDS: dict[type, dict[str, DeclaredField]] = {}


def _fields_of(owner: type) -> dict[str, DeclaredField]:
    if owner not in _FIELDS:
        _FIELDS[owner] = {}
        if is_dataclass(owner):
            with contextlib.suppress(NameError):  # a class of the user's whose types are known to type checkers alone
                _FIELDS[owner] = {f.name: f for f in declared_fields(owner)}
    return _FIELDS[owner]
