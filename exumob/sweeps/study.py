"""Sweeps as text: study files (TOML) and the options ``--set`` and ``--vary`` of ``exumob sweep``.

[base]                              # values of all cases, by dotted name
vehicle = "my_vehicle.py"           # default: the paper's vehicle
networks = "paper-lstm"             # or files; default: those that come with exumob, if they fit
soil = "LETE sand"
water.depth_ratio = 0.6

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

import difflib
import math
import re
import tomllib
from collections.abc import Mapping, Sequence
from numbers import Real
from pathlib import Path
from typing import Any, cast, get_args

import numpy as np

from exumob.support.declared import checked
from exumob.support.quantities import shown, unusual
from exumob.sweeps.experiment import PARTS, Experiment, amphibious_lane_change
from exumob.sweeps.sampling import (
    DISTRIBUTIONS,
    SEED,
    Case,
    Choice,
    Distribution,
    Range,
    grid,
    require_room_for,
    sample,
    spelled_distribution,
)
from exumob.vehicle.vehicle_file import load_vehicle

SECTIONS = ("base", "vary", "sample", "unusual")
"""Tables and keys of a study file."""
SAMPLE = ("number", "method", "seed", "distributions", "correlations")
"""Keys of the table ``sample``."""
RANGE = ("from", "to", "number")
"""Keys of a range."""
LARGEST = 2**24
"""Largest study file [bytes]."""


@checked
def read_study(file: str | Path) -> tuple[Experiment, list[Case]]:
    """Read the experiment and the cases of a study file.

    Raises
    ------
    ValueError
        If the file cannot be read, or a name or value in it is not known.
    """
    path = Path(file)
    text = _text(path)
    try:
        found = _parsed(text)
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        what = "it is nested too deeply" if isinstance(error, RecursionError) else str(error)
        raise ValueError(f"study file {path} is not TOML: {what}{_hint(error)}") from None
    try:
        return _study(found, path.parent)
    except (ValueError, OSError) as error:
        raise ValueError(f"study file {path}: {error}") from None


@checked
def from_options(
    vehicle: Path | None, settings: Sequence[str], varied: Sequence[str], number: int, seed: int,
    unusual_values: bool = False,
) -> tuple[Experiment, list[Case]]:  # fmt: skip
    """Experiment and cases of the options ``--set name=value`` and ``--vary name=...`` (`parse_variation`).

    With `unusual_values` numbers may lie outside their plausible ranges.

    Raises
    ------
    ValueError
        If an option cannot be read, or a name or value is not known.
    """
    SEED.check("--seed", seed)
    base = amphibious_lane_change()
    if vehicle is not None:
        try:
            base = base.with_vehicle(load_vehicle(vehicle))
        except OSError as error:
            raise ValueError(str(error)) from None
    values: dict[str, Any] = {}
    for text in settings:
        name, sign, value = text.partition("=")
        if not sign or not name.strip():
            raise ValueError(f"--set {text}: write name=value, such as water.depth_ratio=0.5.")
        if name.strip() in values:
            raise ValueError(f"--set {text}: {name.strip()} is set already; give it once.")
        values[name.strip()] = _value(value)
    lists: dict[str, Sequence[Any]] = {}
    drawn: dict[str, Distribution] = {}
    for text in varied:
        name, variation = parse_variation(text)
        if name in lists or name in drawn:
            raise ValueError(f"--vary {text}: {name} is varied twice; give all of its values at once.")
        if isinstance(variation, Sequence):
            lists[name] = variation
        else:
            drawn[name] = variation
    cases = lambda: _cases(lists, drawn, {"number": number, "seed": seed}, {})  # noqa: E731
    return _checked(base, values, (lists, drawn), cases, unusual_values)


@checked
def parse_variation(text: str) -> tuple[str, Sequence[Any] | Distribution]:
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
    ends = [_value(v) for v in rest.split(":")]
    if len(ends) == 3:
        return name, _range(name, *ends)
    if len(ends) > 1 and not any(isinstance(v, str) and v for v in ends):
        raise ValueError(f"--vary {text}: a range needs from:to:number, such as {name}=0:1:5 (five values).")
    values = [_value(v) for v in rest.split(",")]
    if "" in values:
        raise ValueError(f"{hint}; a value is missing.")
    return name, values


def _text(path: Path) -> str:
    try:
        if path.stat().st_size > LARGEST:
            raise ValueError(f"study file {path} is larger than {LARGEST // 2**20} MiB; give a study file.")
        return path.read_bytes().decode("utf-8-sig").replace("\r\n", "\n")
    except FileNotFoundError:
        raise ValueError(f"study file {path} does not exist.") from None
    except OSError as error:
        raise ValueError(f"study file {path} cannot be read ({error.strerror}); give a file.") from None
    except UnicodeDecodeError as error:
        line = error.object[: error.start].count(b"\n") + 1
        raise ValueError(f"study file {path} is not TOML: line {line} is not UTF-8 text; save it as UTF-8.") from None


def _parsed(text: str) -> dict[str, Any]:
    """The tables of a study file.

    ``soil = "..."`` beside ``soil.cohesion = ...`` is not TOML, but what everybody writes: if a text cannot be read
    otherwise, dotted names are taken as a whole.
    """
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        whole = re.sub(
            rf"(?m)^([ \t]*)((?:base\.|vary\.)?(?:{'|'.join(PARTS)}))\.([A-Za-z0-9_]+)([ \t]*=)",
            lambda m: f"{m[1]}{_quoted(m[2], m[3])}{m[4]}", text,
        )  # fmt: skip
        try:
            return tomllib.loads(whole)
        except tomllib.TOMLDecodeError:
            pass
        raise


def _quoted(owner: str, field: str) -> str:
    above, _, last = owner.rpartition(".")
    return f'{above}."{last}.{field}"' if above else f'"{last}.{field}"'


def _hint(error: Exception) -> str:
    if "overwrite" not in str(error):
        return "; mend it there (docs/howto/sweeps.md shows a whole file)."
    return (
        '; a name stands twice, or as a value and as a table: write soil = "..." and "soil.cohesion" = ... (in '
        "quotation marks) side by side."
    )


def _study(text: Mapping[str, Any], folder: Path) -> tuple[Experiment, list[Case]]:
    _known("the file", text, SECTIONS)
    unusual_values = text.get("unusual", False)
    if not isinstance(unusual_values, bool):
        raise ValueError(f"unusual = {shown(unusual_values)} must be true or false.")
    experiment = amphibious_lane_change()
    names = frozenset(experiment.names()) - {*PARTS}
    base = _flat("base", _table("base", text.get("base", {})), names)
    if "vehicle" in base:
        vehicle = base.pop("vehicle")
        if not isinstance(vehicle, str):
            raise ValueError(f'base.vehicle = {shown(vehicle)} must be the name of a file, such as "my_vehicle.py".')
        file = folder / vehicle
        experiment = experiment.with_vehicle(load_vehicle(file if file.suffix or file.is_file() else vehicle))
    for name in base.keys() - names - {"networks"}:
        if near := difflib.get_close_matches(name, ("vehicle", "networks"), 1, 0.8):
            raise ValueError(f"base.{name} is not known; did you mean {near[0]}?")
    networks = base.pop("networks", [])
    files = networks if isinstance(networks, list) else [networks]
    if not all(isinstance(one, str) for one in files):
        raise ValueError(
            f'base.networks = {shown(networks)} must be the name of a file of networks, such as "mine.safetensors", or '
            "a list of names."
        )
    lists: dict[str, Sequence[Any]] = {}
    for name, value in _flat("vary", _table("vary", text.get("vary", {})), names).items():
        if isinstance(value, dict):
            _known(f"vary.{name}", value, RANGE)
            lists[name] = _range(f"vary.{name}", *(value.get(key) for key in RANGE))
        else:
            several = value if isinstance(value, list) else [value]
            lists[name] = [tuple(v) if isinstance(v, list) else v for v in several]
    drawn = _table("sample", text.get("sample", {}))
    _known("sample", drawn, SAMPLE)
    given = _flat("sample.distributions", _table("sample.distributions", drawn.get("distributions", {})), names)
    distributions = {name: _distribution(name, value) for name, value in given.items()}
    for name in lists:
        if name in distributions:
            raise ValueError(f"{name} stands in vary and in sample.distributions; keep one of them.")
    correlations = _correlations(_table("sample.correlations", drawn.get("correlations", {})))
    if drawn and not distributions:
        raise ValueError("sample without distributions draws nothing; add [sample.distributions], or leave it out.")
    options = {name: drawn[name] for name in ("number", "method", "seed") if name in drawn}
    base = {name: _beside(experiment, folder, name, value) for name, value in base.items()}
    lists = {
        name: values if isinstance(values, Range) else [_beside(experiment, folder, name, v) for v in values]
        for name, values in lists.items()
    }  # fmt: skip
    cases = lambda: _cases(lists, distributions, options, correlations)  # noqa: E731
    experiment, found = _checked(experiment, base, (lists, distributions), cases, unusual_values)
    return experiment.with_networks(files, folder), found


def _beside(experiment: Experiment, folder: Path, name: str, value: Any) -> Any:
    """A value of a study file; paths count from its folder."""
    typed = experiment.typed({name: value})[name]
    return folder / typed if isinstance(typed, Path) else value


def _correlations(table: Mapping[str, Any]) -> dict[tuple[str, str], float]:
    found = {}
    for pair, value in table.items():
        names = tuple(name.strip() for name in pair.split(","))
        if len(names) != 2:
            raise ValueError(
                f'sample.correlations: {pair!r} must name two in one pair of quotation marks, such as "soil.cohesion, '
                'soil.n".'
            )
        found[names[0], names[1]] = value
    return found


def _checked(
    experiment: Experiment, base: Mapping[str, Any], varied: Sequence[Mapping[str, Any]], cases: Any,
    unusual_values: bool,
) -> tuple[Experiment, list[Case]]:  # fmt: skip
    """The experiment with its base, and the cases; names are checked before the cases are made."""
    maneuver = {"maneuver": base["maneuver"]} if "maneuver" in base else {}
    named = experiment.with_values(maneuver)  # its fields are names
    experiment = experiment.with_values(_marked(named, base) if unusual_values else base)
    names = [name for table in varied for name in table]
    known = experiment
    for table in varied:
        for one in table.get("maneuver", ()) if isinstance(table.get("maneuver"), Sequence) else ():
            known = experiment.with_values({"maneuver": one})
    known.check_names(names)
    if twice := [name for name in names if name in base]:
        raise ValueError(f"{twice[0]} is both varied and set for all cases; give it once.")
    if unusual_values:
        found = [_marked(known, case) for case in cases()]
    else:
        drawn = _check_medians(known, varied[1])
        found = [case | _marked(known, {name: case[name] for name in drawn}) for case in cases()]
    experiment.with_values(found[0])
    return experiment, found


def _check_medians(experiment: Experiment, distributions: Mapping[str, Distribution]) -> list[str]:
    """Names whose draws may lie outside their plausible ranges: the tails of distributions with a plausible median.

    Raises
    ------
    ValueError
        If the median of a distribution is refused.
    """
    found = [name for name, distribution in distributions.items() if not isinstance(distribution, Choice)]
    for name in found:
        try:
            experiment.check_values(name, [float(distributions[name].quantile(np.array([0.5]))[0])])
        except ValueError as error:
            raise ValueError(f"the median of what {name} is drawn from: {error}") from None
    return found


def _marked(experiment: Experiment, values: Mapping[str, Any]) -> dict[str, Any]:
    """Values that may lie outside their plausible ranges."""
    return {name: value if _is_count(experiment, name) else _marked_value(value) for name, value in values.items()}


def _marked_value(value: Any) -> Any:
    """A value all of whose numbers are marked, those within lists and tuples, too."""
    if isinstance(value, list | tuple):
        return type(value)(_marked_value(part) for part in value)
    return unusual(cast(float, value)) if isinstance(value, Real) and not isinstance(value, bool) else value


def _is_count(experiment: Experiment, name: str) -> bool:
    """Whether a name takes whole numbers, which have no plausible range and must stay what they are."""
    declared = experiment.declaration(name)
    kinds = () if declared is None else (declared.kind, *get_args(declared.kind))
    return int in kinds and float not in kinds


def _cases(
    lists: Mapping[str, Sequence[Any]], distributions: Mapping[str, Distribution], options: Mapping[str, Any],
    correlations: Mapping[tuple[str, str], float],
) -> list[Case]:  # fmt: skip
    """Cases of the grid, each of its points with each drawn sample."""
    if not lists and not distributions:
        raise ValueError("nothing varies; give --vary, or [vary] or [sample.distributions] in a study file.")
    for name, values in lists.items():
        if not len(values):
            raise ValueError(f"{name} has no values; give one at least.")
    options = {"number": 64} | dict(options)
    number = math.prod(len(values) for values in lists.values())
    if distributions and isinstance(options["number"], int):
        number *= max(options["number"], 1)
    require_room_for("sweep", number, len(lists) + len(distributions))
    points = grid(lists) if lists else [{}]
    if not distributions:
        return points
    drawn = sample(**options, distributions=distributions, correlations=correlations)
    return [point | values for point in points for values in drawn]


def _range(name: str, begin: Any, end: Any, number: Any) -> Range:
    numbers = all(isinstance(v, int | float) and not isinstance(v, bool) for v in (begin, end, number))
    if numbers and math.isfinite(number) and number == int(number):
        number = int(number)
    if not numbers or not isinstance(number, int) or number < 1:
        raise ValueError(
            f"{name}: a range needs two numbers and how many values (from, to, number), not {shown(begin)}, "
            f"{shown(end)}, {shown(number)}."
        )
    require_room_for(name, number, 1)
    if max(abs(begin), abs(end)) > 1e300 or not math.isfinite(begin + end):
        raise ValueError(f"{name}: the ends of a range, {shown(begin)} and {shown(end)}, must be finite numbers.")
    if number > 1 and begin == end:
        raise ValueError(f"{name}: {number} values from {begin} to {end} are all the same; give another end, or 1.")
    return Range(float(begin), float(end), number)


def _distribution(name: str, value: Any) -> Distribution:
    if isinstance(value, list):
        return Choice(tuple(value))
    if not isinstance(value, dict) or len(value) != 1:
        raise ValueError(
            f"{name} = {shown(value)}: a distribution is a list of values, or one of {', '.join(DISTRIBUTIONS)}, such "
            "as { uniform = [0.4, 0.6] }."
        )
    ((kind, parameters),) = value.items()
    _known(name, value, (*DISTRIBUTIONS, "choice"))
    if not isinstance(parameters, list):
        raise ValueError(f"{name}: {kind} = {shown(parameters)} must be a list of its parameters.")
    if kind == "choice":
        return Choice(tuple(parameters))
    try:
        found: Distribution = DISTRIBUTIONS[kind](*parameters)
    except TypeError:
        raise ValueError(
            f"{name}: {kind} takes other parameters than {shown(parameters)}; give {spelled_distribution(kind)}."
        ) from None
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from None
    return found


def _table(name: str, value: Any) -> Mapping[str, Any]:
    if not isinstance(value, dict):
        raise ValueError(f"{name} = {shown(value)} must be a table, [{name}] with names below it.")
    return value


def _flat(where: str, table: Mapping[str, Any], names: frozenset[str], above: str = "") -> dict[str, Any]:
    """Leaves of nested tables by dotted name; the table of a range or a distribution, below one of `names`, is one."""
    found: dict[str, Any] = {}
    leaves = {*DISTRIBUTIONS, "choice", *RANGE}
    for name, value in table.items():
        inner = {above + name: value}
        if isinstance(value, dict) and value and not set(value) <= leaves and above + name not in names:
            inner = _flat(where, value, names, f"{above}{name}.")
        for leaf in inner:
            if leaf in found:
                raise ValueError(f"{where}: {leaf} is given twice; keep one of them.")
        found |= inner
    return found


def _known(where: str, given: Mapping[str, Any], known: Sequence[str]) -> None:
    for name in given:
        if name not in known:
            near = difflib.get_close_matches(name, known, 1, 0.6)
            hint = f"did you mean {near[0]}?" if near else f"use {', '.join(known)}."
            raise ValueError(f"{where}: {name!r} is not known; {hint}")


def _value(text: str) -> Any:
    """Number that a text stands for, or the text itself."""
    text = text.strip()
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text
