"""What is called: every dataclass that users make, and every function that takes their input."""

from __future__ import annotations

import contextlib
import copy
import functools
import importlib
import inspect
import json
import os
import pickle
import pkgutil
import tempfile
import typing
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import MISSING, dataclass, fields, is_dataclass, replace
from pathlib import Path
from types import ModuleType
from typing import Any
from unittest import mock

import numpy as np
from hypothesis import strategies as st

import exumob
from exumob.support.declared import Declared
from exumob.support.provenance import parameters_json
from exumob.vehicle.body import body_faces

from . import examples
from .odd_values import ODD, Given, plain
from .outcome import Outcome, Reached, Silent, finite, outcome_of
from .strategies import EXAMPLES, valid_of, values_of, verify_declared


@dataclass(frozen=True)
class Target:
    """Something that is called with arbitrary input."""

    name: str
    inputs: st.SearchStrategy[Any]
    answer: Callable[[Any], Outcome]
    weight: int = 1
    """Share of all examples"""
    group: str = "functions"


# -- dataclasses -------------------------------------------------------------------------------------------------------


def modules() -> Iterator[ModuleType]:
    """All modules of the package that can be imported here."""
    for found in pkgutil.walk_packages(exumob.__path__, "exumob."):
        if found.name != "exumob.__main__":
            with contextlib.suppress(ImportError):
                yield importlib.import_module(found.name)


NOT_MADE_BY_USERS = ("flow.solids.Solid", "coupling.scheme.Scheme")
"""Declared classes that the package alone makes"""


def declared_classes() -> list[type]:
    """Every public class of the package whose fields are declared."""
    found = {}
    for module in modules():
        for name, owner in vars(module).items():
            if isinstance(owner, type) and is_dataclass(owner) and owner.__module__ == module.__name__:
                path = f"{module.__name__}.{name}".removeprefix("exumob.")
                if issubclass(owner, Declared) and not name.startswith("_") and path not in NOT_MADE_BY_USERS:
                    found[path] = owner
    return [found[name] for name in sorted(found)]


OTHER_CLASSES = (
    "ground.terrain.Terrain", "flow.settings.FlowSettings", "flow.turbulence.closures.Smagorinsky",
    "flow.turbulence.closures.KOmegaSST", "flow.tread.Tread", "flow.output.render.Camera",
    "towing_tank.motion.CaptiveMotion", "coupling.spin_up.FlowSpinUp", "coupling.semi_implicit.SemiImplicit",
    "coupling.strong.Strong", "sweeps.sampling.Uniform", "sweeps.sampling.Normal", "sweeps.sampling.LogNormal",
    "sweeps.sampling.Triangular", "sweeps.sampling.Choice", "sweeps.experiment.Experiment", "sweeps.tuning.Genetic",
    "sweeps.tuning.Simplex", "mobility.crossing.Limits", "mobility.crossing.Crossing", "mobility.map.Axis",
    "mobility.map.MobilityMap", "surrogates.networks.Architecture", "learning.presets.Preset",
)  # fmt: skip
"""Classes that users make and that are not declared everywhere, by module and name; `declared_classes` finds others"""


def user_classes() -> list[type]:
    """Every dataclass that users make."""
    others = []
    for path in OTHER_CLASSES:
        module, _, name = path.rpartition(".")
        with contextlib.suppress(ImportError):
            others.append(getattr(importlib.import_module(f"exumob.{module}"), name))
    return list(dict.fromkeys(declared_classes() + others))


def base_of(owner: type) -> dict[str, Given]:
    """Valid values of all fields that must be given."""
    if owner in EXAMPLES:
        thing = EXAMPLES[owner][0].make()
        return {
            f.name: Given(f.name, functools.partial(getattr, thing, f.name), "valid") for f in fields(thing) if f.init
        }  # fmt: skip
    hints = typing.get_type_hints(owner, include_extras=True)
    found = {}
    for f in fields(owner):
        if f.default is MISSING and f.default_factory is MISSING and f.init:
            options = EXAMPLES.get(hints[f.name])
            found[f.name] = options[0] if options else _first_valid(hints[f.name])
    return found


def _first_valid(hint: Any) -> Given:
    """The simplest valid value of a type."""
    from hypothesis import find, settings

    quick = settings(database=None, derandomize=True, max_examples=300)
    return find(valid_of(hint), lambda given: given.label in ("valid", "any"), settings=quick)


@st.composite
def changes(draw: Any, hints: Mapping[str, Any]) -> dict[str, Given]:
    """Values for one to three of the names."""
    names = draw(st.lists(st.sampled_from(list(hints)), min_size=1, max_size=3, unique=True))
    if draw(st.booleans()):
        names = names[:1]
    return {name: draw(named_values() if hints[name] is Values else values_of(hints[name])) for name in names}


def names_of(given: Mapping[str, Given], all_names: list[str]) -> tuple[list[str], bool]:
    """Names of which an error must hold one, and whether the input must be refused."""
    wrong = [name for name, value in given.items() if value.label == "refused"]
    return (list(given) if wrong else all_names), bool(wrong)


def class_target(owner: type) -> Target:
    """A dataclass whose fields are given anything."""
    hints = typing.get_type_hints(owner, include_extras=True)
    hints = {f.name: hints[f.name] for f in fields(owner) if f.init}
    base = base_of(owner)

    def answer(given: Mapping[str, Given]) -> Outcome:
        values = {name: value.make() for name, value in ({**base, **given}).items()}
        names, refused = names_of(given, list(hints))
        return outcome_of(lambda: owner(**values), names, refused=refused, verify=verify_object)

    module = owner.__module__.removeprefix("exumob.")
    return Target(f"{module}.{owner.__name__}", changes(hints), answer, group="dataclasses")


TIMES = (0.0, 1e-9, 0.3, 1.0, 2.0, 3.7, 5.5, 8.0, 1e6)


def verify_object(thing: Any) -> None:
    """Raise `Silent` unless an object obeys its declarations, can be copied, described and used."""
    verify_declared(thing)
    repr(thing)
    copied = pickle.loads(pickle.dumps(thing))
    if type(copied) is not type(thing):
        raise Silent("is another object when it comes back from a file")
    json.loads(parameters_json({"it": thing}))
    replace(thing)
    owner = type(thing).__name__
    for name, value in inspect.getmembers(type(thing), lambda member: isinstance(member, property)):
        del value
        _finite_if_number(f"{owner}.{name}", getattr(thing, name))
    if isinstance(thing, exumob.Soil):
        for sinkage in (0.0, 1e-6, 0.01, 0.5):
            finite("Soil.pressure", thing.pressure(sinkage, 0.1))
        if not all(np.isfinite(thing.as_record()[n]).all() for n in thing.as_record().dtype.names):
            raise Silent("Soil.as_record is not finite")
    if hasattr(thing, "steering") and hasattr(thing, "wheel_speed") and callable(thing.steering):
        for time in TIMES:
            finite(f"{owner}.steering({time})", thing.steering(time))
            finite(f"{owner}.wheel_speed({time})", thing.wheel_speed(time))
    if isinstance(thing, exumob.Vehicle):
        finite("Vehicle.steering_angles", thing.steering_angles((thing.steering.limit, 0.1, 0.1)))
        finite("Hull.side_profile", thing.hull.side_profile())
        if thing.hull.mesh is None:
            finite("body_faces", np.concatenate(body_faces(thing.hull, thing.axles)))
    if hasattr(thing, "quantile"):
        found = np.asarray(thing.quantile(np.array([1e-12, 0.1, 0.5, 0.9, 1.0 - 1e-12])))
        if found.dtype.kind == "f":
            finite(f"{owner}.quantile", found)


def _finite_if_number(name: str, value: Any) -> None:
    if isinstance(value, int | float) or (isinstance(value, np.ndarray) and value.dtype.kind == "f"):
        finite(name, value)


NAMED = {
    "hull.mass": 40.0, "wheelbase": 0.8, "soil": "LETE sand", "soil.cohesion": 1e3, "soil.n": 0.7, "water.depth": 0.1,
    "water.depth_ratio": 0.5, "water.current_speed": 1.0, "maneuver": "straight", "maneuver.speed": 5.0,
    "duration": 1.0,
    "hydrodynamics": "coefficients", "hydrodynamics.member": 1, "hydrodynamics.hull_surge_drag": 1.0, "setting": "fine",
    "micro_step": 5e-4, "suspension.stiffness": 4e3, "wheel.diameter": 0.21, "hull": 3, "unknown.name": 1.0, "": 1.0,
}  # fmt: skip
"""Names of values of an experiment, and values that fit"""


@st.composite
def named_values(draw: Any) -> Given:
    """Values by dotted name, as sweeps give them."""
    names = draw(st.lists(st.sampled_from(list(NAMED)), min_size=1, max_size=3, unique=True))
    parts = {
        name: draw(st.one_of(st.just(plain(NAMED[name])), values_of(float), st.sampled_from(ODD))) for name in names
    }
    return Given(repr(parts), lambda: {name: part.make() for name, part in parts.items()})


class Values:
    """Stands for values by dotted name."""


# -- functions ---------------------------------------------------------------------------------------------------------


def stops(*places: str) -> Callable[[], contextlib.AbstractContextManager[Any]]:
    """Replace what would begin to compute by a word that it was reached."""

    def reached(*args: Any, **kwargs: Any) -> Any:
        raise Reached

    @contextmanager
    def stopped() -> Iterator[None]:
        with contextlib.ExitStack() as stack:
            for place in places:
                module, _, name = place.rpartition(".")
                stack.enter_context(mock.patch.object(importlib.import_module(module), name, reached))
            yield

    return stopped


BEFORE_RUNS = stops("exumob.simulation.run.MultibodyVehicle")
BEFORE_FLOW = stops("exumob.towing_tank.run.FlowSolver", "exumob.coupling.flow_code.FlowSolver")
BEFORE_SWEEPS = stops("exumob.sweeps.run.run_in_processes", "exumob.sweeps.run.run_with_mpi")
BEFORE_TUNING = stops("exumob.sweeps.tuning._genetic", "exumob.sweeps.tuning._simplex")


@contextmanager
def in_empty_folder() -> Iterator[Path]:
    """Work in a new folder, which holds nothing that could be overwritten."""
    before = Path.cwd()
    with tempfile.TemporaryDirectory(prefix="exumob-fuzz-") as folder:
        os.chdir(folder)
        try:
            yield Path(folder)
        finally:
            os.chdir(before)


def function_target(
    name: str, function: Callable[..., Any], base: Mapping[str, Any], *, around: Any = contextlib.nullcontext,
    verify: Callable[[Any], None] | None = None, leave: tuple[str, ...] = (), also: tuple[str, ...] = (),
    weight: int = 1,
    clear: tuple[type[BaseException], ...] = (ValueError, exumob.SimulationError), files: bool = False,
    hints: Mapping[str, Any] | None = None, inputs: st.SearchStrategy[dict[str, Given]] | None = None,
) -> Target:  # fmt: skip
    """A function whose arguments are given anything.

    Parameters
    ----------
    base : mapping
        Valid arguments; those not given keep their defaults.
    around : context manager
        Entered about the call.
    verify : callable, optional
        Takes the answer.
    leave : tuple of str
        Arguments that are not varied.
    also : tuple of str
        Names that an error may give instead of the argument's.
    clear : tuple of exceptions
        Those that may refuse.
    files : bool
        The call may write files: it works in an empty folder.
    hints : mapping, optional
        Types of arguments that the function does not declare.
    inputs : strategy, optional
        Arguments, instead of those made from the declared types.
    """
    known = _hints_of(function) | dict(hints or {})
    parameters = inspect.signature(function).parameters
    varied = {
        n: known.get(n, Any) | None if p.default is None else known.get(n, Any) for n, p in parameters.items()
        if n not in leave and p.kind in (p.POSITIONAL_OR_KEYWORD, p.KEYWORD_ONLY) and n != "self"
    }  # fmt: skip

    def answer(given: Mapping[str, Given]) -> Outcome:
        values = {**{n: copy.copy(v) for n, v in base.items()}, **{n: g.make() for n, g in given.items()}}
        positional = [values.pop(n) for n, p in parameters.items() if p.kind is p.POSITIONAL_ONLY and n in values]
        names, refused = names_of(given, list(parameters))
        names += [text for g in values.values() if isinstance(g, str | Path) and len(text := str(g)) > 1]
        names += [name.partition(",")[0]] if len(varied) == 1 else []
        with in_empty_folder() if files else contextlib.nullcontext(), around():
            return outcome_of(
                lambda: function(*positional, **values), [*names, *also], refused=refused, verify=verify, clear=clear
            )

    return Target(name, changes(varied) if inputs is None else inputs, answer, weight)


def _hints_of(function: Callable[..., Any]) -> dict[str, Any]:
    """Declared types; anything where a name in them cannot be found."""
    found = {}
    for name, hint in inspect.get_annotations(inspect.unwrap(function)).items():
        owner = type("owner", (), {"__annotations__": {name: hint}, "__module__": function.__module__})
        try:
            found |= typing.get_type_hints(owner, include_extras=True)
        except NameError:
            found[name] = Any
    return found


def _verify_forces(forces: Any) -> None:
    for f in fields(forces):
        value = getattr(forces, f.name)
        if isinstance(value, float | np.ndarray):
            finite(f"WheelSoilForces.{f.name}", value)


def _verify_points(contact: Any) -> None:
    for name in ("position", "normal", "area"):
        finite(f"HullContact.points.{name}", contact.points[name])
    finite("HullContact.record.width", contact.record["width"])


def _verify_cases(cases: Any) -> None:
    for case in cases[:50]:
        for name, value in case.items():
            if isinstance(value, float):
                finite(name, value)


def _objective(run: Any) -> float:
    return float(run["position"][-1, 0, 0])


def _numbers(values: Mapping[str, Any]) -> dict[str, float]:
    return {"number": 1.0}


def function_targets() -> list[Target]:
    """Every public function that takes input, up to where it begins to compute for long."""
    from exumob.coupling.flow_code import BuiltInFlow
    from exumob.coupling.flow_in_loop import CfdHydrodynamics
    from exumob.driving.named import maneuver_named
    from exumob.driving.path_following import lane_shift
    from exumob.flow.grid import Grid
    from exumob.flow.vehicle_window import vehicle_window
    from exumob.ground.hull_contact import hull_contact
    from exumob.learning.examples import training_runs
    from exumob.learning.plan import LearningRange, make_plan, require_budget
    from exumob.mobility.crossing import Limits, judge_crossing
    from exumob.mobility.map import compute_map
    from exumob.simulation.settings import setting_named
    from exumob.simulation.verdict import judge
    from exumob.simulation.water_models import hydrodynamics_named
    from exumob.surrogates.ensemble import load_members, save_ensemble
    from exumob.surrogates.model import SurrogateHydrodynamics
    from exumob.sweeps.run import sweep
    from exumob.sweeps.sampling import Normal, grid, sample
    from exumob.sweeps.study import from_options, parse_variation
    from exumob.sweeps.tuning import tune
    from exumob.towing_tank.multisine import relative_peak_factor, shared_harmonics
    from exumob.towing_tank.run import captive_run
    from exumob.water.wetted_surface import box_surface

    vehicle, sand, water = (EXAMPLES[c][0].make() for c in (exumob.Vehicle, exumob.Soil, exumob.Water))
    experiment = EXAMPLES[examples.Experiment][0].make()
    scene = {"vehicle": vehicle, "soil": sand, "water": water, "hydrodynamics": "coefficients"}
    contact = {
        "soil": sand, "wheel_radius": 0.1, "wheel_width": 0.08, "sinkage": 0.01, "velocity": (1.0, 0.1, 0.0),
        "angular_velocity": (0.0, 11.0, 0.0),
    }  # fmt: skip
    cases = [{"water.current_speed": 0.5}, {"water.current_speed": 1.0}]
    small_map = EXAMPLES[examples.MobilityMap][0].make()
    f = function_target
    return [
        f("simulate, before the run", exumob.simulate, scene, around=BEFORE_RUNS, files=True, weight=4,
        also=("maneuver",)),
        f("lane_change", exumob.lane_change, {}, verify=verify_object),
        f("lane_shift", lane_shift, {}),
        f("scaled_vehicle", exumob.scaled_vehicle, {"vehicle": vehicle, "factor": 2.0}),
        f("unusual", exumob.unusual, {"value": 1.0}),
        f("wheel_soil_forces", exumob.wheel_soil_forces, contact, verify=_verify_forces, weight=2),
        f("hull_contact", hull_contact, {
            "triangles": box_surface(1.0, 0.5, 0.2).triangles, "terrain": exumob.Terrain(),
        }, verify=_verify_points),
        f("load_dataset", exumob.load_dataset, {"file": "none.nc"}, files=True, clear=(ValueError, FileNotFoundError)),
        f("load_vehicle", exumob.load_vehicle, {"file": "none.py"}, files=True, clear=(ValueError, FileNotFoundError)),
        f("save_dataset", exumob.save_dataset, {"dataset": EXAMPLES[examples.xr.Dataset][0].make(), "file": "x.nc"},
        files=True,
          clear=(ValueError, OSError)),
        f("ford_report", exumob.ford_report, {
            "run": EXAMPLES[examples.xr.Dataset][0].make(), "ford": EXAMPLES[exumob.Ford][0].make(),
        }),
        f("summary", exumob.summary, {"dataset": EXAMPLES[examples.xr.Dataset][0].make()}),
        f("Recorded", exumob.Recorded, dict(zip(("time", "steering", "wheel_speed"), examples.RAMP, strict=True)),
          verify=_verify_recorded, weight=2),
        f("Recorded, series", exumob.Recorded, {}, inputs=series(), verify=_verify_recorded, weight=2),
        f("CoefficientHydrodynamics", exumob.CoefficientHydrodynamics, {}),
        f("CalibratedHydrodynamics", exumob.CalibratedHydrodynamics, {}),
        f("Soil.published", exumob.Soil.published, {"name": "LETE sand"}),
        f("Soil.pressure", sand.pressure, {"sinkage": 0.01, "width": 0.1}, verify=lambda p: finite("pressure", p)),
        f("Water.at_ratio", exumob.Water.at_ratio, {"depth_ratio": 0.6}, verify=verify_object,
          also=("depth", "current_speed", "density"), weight=2),
        f("read_river", exumob.read_river, {"source": "none.nc"}, files=True),
        f("CrossSection.read", exumob.CrossSection.read, {"file": "none.csv"}, files=True),
        f("CrossSection.water", EXAMPLES[exumob.CrossSection][0].make().water, {"level": 0.0, "discharge": 0.1},
          verify=verify_object),
        f("Terrain.slope", exumob.Terrain.slope, {"angle": 0.1}),
        f("Terrain.height_and_normal", exumob.Terrain.slope(0.1).height_and_normal, {"x": 1.0, "y": 2.0}),
        f("setting_named", setting_named, {"name": "fast"}, also=("setting",)),
        f("maneuver_named", maneuver_named, {"name": "straight"}, also=("maneuver",)),
        f("hydrodynamics_named", hydrodynamics_named, {"name": "coefficients", "vehicle": vehicle, "water": water},
        files=True,
          also=("hydrodynamics",)),
        f("SurrogateHydrodynamics", SurrogateHydrodynamics, {}, files=True),
        f("CfdHydrodynamics", CfdHydrodynamics, {}),
        f("BuiltInFlow", BuiltInFlow, {}),
        f("Grid", Grid, dict.fromkeys(("x_faces", "y_faces", "z_faces"), np.linspace(0.0, 1.0, 9))),
        f("vehicle_window", vehicle_window, {"vehicle": vehicle, "cell_size": 0.05, "water": water}),
        f("captive_run, before the flow", captive_run, {"vehicle": vehicle, "water": water, "cell_size": 0.018,
        "allow_coarse": True},
          around=BEFORE_FLOW, files=True, also=("motion", "Grid", "window"), weight=2),
        f("Experiment.with_values", experiment.with_values, {"values": {}}, also=tuple(NAMED),
        hints={"values": Values}, verify=lambda e: verify_object(e.vehicle)),
        f("sweep, before the runs", sweep, {"function": experiment, "cases": cases, "folder": "sweep"},
        around=BEFORE_SWEEPS,
          files=True, weight=2, hints={"cases": typing.Any}),
        f("sweep of a function, before the runs", sweep, {"function": _numbers, "cases": cases, "folder": "sweep"},
          around=BEFORE_SWEEPS, files=True, hints={"cases": typing.Any}),
        f("sample", sample, {"number": 8, "distributions": {"a": Normal(0.0, 1.0)}}, verify=_verify_cases,
          weight=2, also=("sample",)),
        f("grid", grid, {"values": {"a": [1.0, 2.0]}}, also=("grid",)),
        f("tune, before the runs", tune,
          {"experiment": experiment, "ranges": {"soil.cohesion": (1e3, 2e3)}, "objective": _objective,
          "folder": "tuning"},
          around=BEFORE_TUNING, files=True),
        f("compute_map, before the runs", compute_map, {"wanted": small_map, "folder": "map"}, around=BEFORE_SWEEPS,
        files=True),
        f("judge", judge, {"run": EXAMPLES[examples.xr.Dataset][0].make()}),
        f("judge_crossing", judge_crossing, {"run": EXAMPLES[examples.xr.Dataset][0].make(), "limits": Limits()}),
        f("from_options", from_options,
          {"vehicle": None, "settings": [], "varied": ["water.current_speed=0,1"], "number": 4, "seed": 0},
          also=("--vary", "--set", "--samples", "--seed", "--vehicle", "vary", "set"), files=True),
        f("parse_variation", parse_variation, {"text": "a=0:1:3"}, also=("--vary",)),
        f("relative_peak_factor", relative_peak_factor, {"signal": [0.0, 1.0, -1.0]},
          verify=lambda p: finite("relative_peak_factor", p)),
        f("shared_harmonics", shared_harmonics, {"period": 7.0, "highest": [1.0, 2.0]}, also=("period", "highest")),
        f("make_plan", make_plan, {
            "vehicle": vehicle, "wanted": LearningRange(), "budget": 1.0, "cell_size": 0.05,
            "envelope": EXAMPLES[examples.Envelope][0].make(),
        }, also=("Excitation", "Envelope", "cell_size", "Grid", "window", "Water", "Hull")),
        f("require_budget", require_budget,
          {"vehicle": vehicle, "wanted": LearningRange(), "budget": 9.0, "cell_size": 0.05},
          also=("make_plan", "cell_size", "Grid", "window", "Water", "Hull")),
        f("load_members", load_members, {"file": "none.safetensors"}, files=True),
        f("save_ensemble", save_ensemble, {
            "members": [EXAMPLES[examples.NetworkSet][0].make()], "file": "x.safetensors",
        }, files=True, clear=(ValueError, OSError)),
        f("training_runs", training_runs, {"folder": "none"}, files=True, clear=(ValueError, FileNotFoundError)),
    ]  # fmt: skip


@st.composite
def series(draw: Any) -> dict[str, Given]:
    """A recorded maneuver, equally long series some values of which are odd."""
    n = draw(st.integers(3, 30))
    rng = np.random.default_rng(draw(st.integers(0, 999)))
    time = np.concatenate([[0.0], np.cumsum(rng.uniform(1e-3, 1.0, n - 1))]) * draw(st.sampled_from([1.0, 1e-6, 1e3]))
    parts = {
        "time": time,
        "steering": rng.uniform(-0.5, 0.5, n),
        "wheel_speed": np.concatenate([[0.0], rng.uniform(-30.0, 30.0, n - 1)]),
    }
    for name in draw(st.lists(st.sampled_from(list(parts)), max_size=2)):
        at = draw(st.integers(0, n - 1))
        parts[name][at] = draw(st.one_of(st.floats(), st.floats(-2.0, 2.0), st.just(parts[name][at - 1])))
    return {name: Given(repr(part.tolist()), lambda part=part: part) for name, part in parts.items()}


def _verify_recorded(recorded: exumob.Recorded) -> None:
    for time in TIMES:
        finite(f"Recorded.steering({time})", recorded.steering(time))
        finite(f"Recorded.wheel_speed({time})", recorded.wheel_speed(time))
