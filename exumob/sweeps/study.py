"""Sweeps as text: study files (TOML) and the options ``--set`` and ``--vary`` of ``exumob sweep``.

[base]                              # values of all cases, by dotted name
vehicle = "my_vehicle.py"           # default: the paper's vehicle
soil = "LETE sand"
water.depth_ratio = 0.6
duration = 8.0

[vary]                              # a full grid
water.current_speed = [0.0, 0.5, 1.0]
maneuver.amplitude = { from = 0.2, to = 0.6, number = 5 }

[sample]                            # random draws, combined with each point of the grid
number = 64
method = "sobol"                    # or "halton", "lhs", "random"
seed = 1

[sample.distributions]
soil.cohesion = { normal = [1300.0, 200.0] }
soil.friction_angle = { uniform = [0.45, 0.60] }

[sample.correlations]
"soil.cohesion, soil.friction_angle" = -0.5
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from exumob.sweeps.experiment import Experiment, amphibious_lane_change
from exumob.sweeps.sampling import DISTRIBUTIONS, Case, Choice, Distribution, grid, sample
from exumob.vehicle.vehicle_file import load_vehicle

SECTIONS = ("base", "vary", "sample")
"""Tables of a study file."""
SAMPLE = ("number", "method", "seed", "distributions", "correlations")
"""Keys of the table ``sample``."""


def read_study(file: str | Path) -> tuple[Experiment, list[Case]]:
    """Read the experiment and the cases of a study file.

    Raises
    ------
    ValueError
        If the file cannot be read, or a name or value in it is not known.
    """
    path = Path(file)
    try:
        text = tomllib.loads(path.read_text())
    except FileNotFoundError:
        raise ValueError(f"study file {path} does not exist.") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ValueError(f"study file {path} is not TOML: {error}") from None
    try:
        return _study(text, path.parent)
    except (ValueError, TypeError, FileNotFoundError) as error:
        raise ValueError(f"study file {path}: {error}") from None


def from_options(
    vehicle: Path | None, settings: Sequence[str], varied: Sequence[str], number: int, seed: int
) -> tuple[Experiment, list[Case]]:
    """Experiment and cases of the options ``--set name=value`` and ``--vary name=...`` (`parse_variation`).

    Raises
    ------
    ValueError
        If an option cannot be read, or a name or value is not known.
    """
    base = amphibious_lane_change()
    if vehicle is not None:
        base = replace(base, vehicle=load_vehicle(vehicle))
    values = {}
    for text in settings:
        name, sign, value = text.partition("=")
        if not sign:
            raise ValueError(f"--set {text}: write name=value, such as water.depth_ratio=0.5.")
        values[name.strip()] = _value(value)
    found = dict(parse_variation(text) for text in varied)
    lists = {name: v for name, v in found.items() if isinstance(v, list)}
    drawn = {name: v for name, v in found.items() if not isinstance(v, list)}
    return _checked(base.with_values(values), _cases(lists, drawn, {"number": number, "seed": seed}, {}))


def parse_variation(text: str) -> tuple[str, list[Any] | Distribution]:
    """Read ``name=0,0.5,1`` (values), ``name=0:1:5`` (five from 0 to 1) or ``name~normal(1300, 200)`` (a distribution).

    Raises
    ------
    ValueError
        If the text is none of these.
    """
    hint = f"--vary {text}: write name=0,0.5,1 or name=0:1:5 (five values) or name~normal(1300,200)"
    at = min((i for i in (text.find("="), text.find("~")) if i > 0), default=-1)
    if at < 0:
        raise ValueError(f"{hint}.")
    name, sign, rest = text[:at].strip(), text[at], text[at + 1 :].strip()
    if sign == "~":
        kind, _, inner = rest.partition("(")
        if not inner.endswith(")"):
            raise ValueError(f"{hint}.")
        values = [_value(v) for v in inner[:-1].split(",")]
        return name, _distribution(name, {kind.strip(): values})
    if rest.count(":") == 2:
        begin, end, number = (_value(v) for v in rest.split(":"))
        return name, _range(name, begin, end, number)
    return name, [_value(v) for v in rest.split(",")]


def _study(text: Mapping[str, Any], folder: Path) -> tuple[Experiment, list[Case]]:
    _known("section", text, SECTIONS)
    base = dict(_flat(text.get("base", {})))
    experiment = amphibious_lane_change()
    if "vehicle" in base:
        experiment = replace(experiment, vehicle=load_vehicle(folder / base.pop("vehicle")))
    lists = {}
    for name, value in _flat(text.get("vary", {})):
        if isinstance(value, dict):
            _known(name, value, ("from", "to", "number"))
            value = _range(name, *(value.get(key) for key in ("from", "to", "number")))
        lists[name] = value if isinstance(value, list) else [value]
    drawn = text.get("sample", {})
    _known("sample", drawn, SAMPLE)
    distributions = {name: _distribution(name, value) for name, value in _flat(drawn.get("distributions", {}))}
    correlations = {}
    for pair, value in drawn.get("correlations", {}).items():
        names = tuple(name.strip() for name in pair.split(","))
        if len(names) != 2:
            raise ValueError(f'sample.correlations: {pair!r} must name two, such as "soil.cohesion, soil.n".')
        correlations[names[0], names[1]] = float(value)
    options = {name: drawn[name] for name in ("number", "method", "seed") if name in drawn}
    return _checked(experiment.with_values(base), _cases(lists, distributions, options, correlations))


def _checked(experiment: Experiment, cases: list[Case]) -> tuple[Experiment, list[Case]]:
    experiment.with_values(cases[0])
    return experiment, cases


def _cases(
    lists: Mapping[str, Sequence[Any]], distributions: Mapping[str, Distribution], options: Mapping[str, Any],
    correlations: Mapping[tuple[str, str], float],
) -> list[Case]:  # fmt: skip
    """Cases of the grid, each of its points with each drawn sample."""
    if not lists and not distributions:
        raise ValueError("nothing varies; give --vary, or [vary] or [sample.distributions] in a study file.")
    points = grid(lists) if lists else [{}]
    if not distributions:
        return points
    drawn = sample(**({"number": 64} | dict(options)), distributions=distributions, correlations=correlations)
    return [point | values for point in points for values in drawn]


def _range(name: str, begin: Any, end: Any, number: Any) -> list[float]:
    if not all(isinstance(v, int | float) for v in (begin, end)) or not isinstance(number, int) or number < 1:
        raise ValueError(f"{name}: a range needs two numbers and how many values, not {begin}, {end}, {number}.")
    return [float(v) for v in np.linspace(begin, end, number)]


def _distribution(name: str, value: Any) -> Distribution:
    if isinstance(value, list):
        return Choice(tuple(value))
    if not isinstance(value, dict) or len(value) != 1:
        raise ValueError(f"{name}: a distribution is a list of values, or one of {', '.join(DISTRIBUTIONS)}.")
    ((kind, parameters),) = value.items()
    if kind == "choice":
        return Choice(tuple(parameters))
    _known(name, value, tuple(DISTRIBUTIONS))
    try:
        found: Distribution = DISTRIBUTIONS[kind](*parameters)
    except TypeError:
        raise ValueError(f"{name}: {kind} takes other parameters than {parameters}.") from None
    return found


def _flat(table: Mapping[str, Any], above: str = "") -> list[tuple[str, Any]]:
    """Leaves of nested tables by dotted name; the table of a range or a distribution is a leaf."""
    found: list[tuple[str, Any]] = []
    leaves = {*DISTRIBUTIONS, "choice", "from", "to", "number"}
    for name, value in table.items():
        if isinstance(value, dict) and not set(value) <= leaves:
            found += _flat(value, f"{above}{name}.")
        else:
            found.append((above + name, value))
    return found


def _known(where: str, given: Mapping[str, Any], known: Sequence[str]) -> None:
    for name in given:
        if name not in known:
            raise ValueError(f"{where}: {name!r} is not known; use {', '.join(known)}.")


def _value(text: str) -> Any:
    """Number that a text stands for, or the text itself."""
    text = text.strip()
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text
