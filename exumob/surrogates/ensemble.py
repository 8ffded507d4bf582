"""Several sets of networks in one file: the members of an ensemble, with what was measured of them together.

The file is a safetensors file as that of one set (`exumob.surrogates.networks`), the arrays of each member under its
number.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from exumob.support.arrays import Array
from exumob.support.declared import checked
from exumob.support.measured import measured_errors
from exumob.surrogates.networks import (
    COME_WITH_IT,
    VERSION,
    NetworkSet,
    _architecture,
    _checked_about,
    _checked_arrays,
    check_version,
    network_file,
    read_arrays,
    write_arrays,
)
from exumob.vehicle.motion import BODIES, WRENCH_COMPONENTS

ENSEMBLE = "exumob ensemble"
CARD = "report_card"
"""Key under which the origin of networks (`NetworkSet.about`) holds what was measured of them."""


@checked
def save_ensemble(members: Sequence[NetworkSet], file: str | Path, card: dict[str, Any] | None = None) -> Path:
    """Write members into one file (.safetensors), whole or not at all; return its path.

    Parameters
    ----------
    members : sequence of NetworkSet
    file : path
    card : dict, optional
        What was measured of them together: plain numbers and text; each member's `about` holds it.

    Raises
    ------
    ValueError
        If there are no members.
    """
    if not members:
        raise ValueError("save_ensemble.members is empty; give one set of networks at least.")
    given = [m if card is None else replace(m, about=m.about | {CARD: card}) for m in members]
    header = {
        "format": ENSEMBLE, "version": VERSION,
        "members": [{"architecture": asdict(m.architecture), "about": m.about} for m in given],
    }  # fmt: skip
    arrays = {f"{n}/{name}": np.array(a, order="C") for n, m in enumerate(given) for name, a in m.arrays.items()}
    path = Path(file)
    write_arrays(path, header, arrays)
    return path


@checked
def load_members(file: str | Path) -> list[NetworkSet]:
    """Read the members of a file of `save_ensemble`, or the one set of a file of `NetworkSet.save`.

    Parameters
    ----------
    file : path
        A name of `exumob.surrogates.networks.NAMED` stands for the networks that come with exumob under it.

    Raises
    ------
    ValueError
        If it is no such file, of another version, incomplete, or damaged; the message names the file.
    """
    path = network_file(file)
    header, arrays = read_arrays(
        path, "a file of networks", f"`exumob train` and `exumob learn` make them, {COME_WITH_IT}."
    )
    if header.get("format") != ENSEMBLE:
        return [NetworkSet.load(path)]
    check_version(header, path)
    said = header.get("members")
    if not isinstance(said, list) or not said or not all(isinstance(one, dict) for one in said):
        raise ValueError(f"{path} does not say what its members are; make it anew with `exumob learn`.")
    members = []
    for n, one in enumerate(said):
        own = {name.partition("/")[2]: a for name, a in arrays.items() if name.partition("/")[0] == str(n)}
        architecture = _architecture(one.get("architecture"), path)
        own = _checked_arrays(architecture, own, path)
        members.append(NetworkSet(architecture, own, _checked_about(one.get("about"), architecture, path)))
    return members


def card_of(members: Sequence[NetworkSet], *, some: bool = False) -> dict[str, Any] | None:
    """Return what was measured of an ensemble, if these are all of its members; else None.

    Members by themselves, or those of several files together, are not what was measured; with `some` that of the whole
    is returned for some of its members, too.
    """
    found = [member.about.get(CARD) for member in members]
    card = found[0] if found else None
    if not isinstance(card, dict) or any(other != card for other in found):
        return None
    if not some and card.get("members") != len(members):
        return None
    return card if _whole(card) else None


def require_different(name: str, files: Sequence[str | Path]) -> None:
    """Refuse files of which one is named twice.

    Raises
    ------
    ValueError
        With `name`, that of the option or argument.
    """
    if len({Path(file).resolve() for file in files}) < len(files):
        raise ValueError(
            f"{name} names a file twice ({', '.join(map(str, files))}); an ensemble of the same network agrees with "
            "itself. Give each once."
        )


def load_floor(members: Sequence[NetworkSet]) -> Array | None:
    """Return what is added to the spread of members for their error bars, squared [N, N m], shape (5, 6).

    It is that part of their error on runs kept apart which all of them share (`exumob.learning.error_bars`), for all
    members of a file with a report card, or of the networks that come with exumob. None: it was never measured.
    """
    card, table = card_of(members), measured_errors()
    if card is not None:
        return None if card.get("load_floor") is None else np.array(card["load_floor"], dtype=float)
    digests = {member.digest() for member in members}
    for name, known in {"networks": table["networks"], **table["named"]}.items():
        if digests == set(known):
            return np.array(table["load_floor"][name], dtype=float)
    return None


def bars_of(spread: Array, floor: Array) -> Array:
    """Return error bars for a spread and a floor: standard deviations, of the shape of the spread."""
    return np.asarray(np.hypot(spread, floor))


NUMBERS = ("load_error", "cell_size", "seconds", "runs", "inside")
PAIRS = ("depth_ratio", "current_speed")


def _whole(card: dict[str, Any]) -> bool:
    """Whether a card holds what the line of trust reads."""

    def number(value: Any) -> bool:
        return isinstance(value, int | float) and json.dumps(value) not in ("NaN", "Infinity", "-Infinity")

    pairs = (card.get(name) for name in PAIRS)
    return (
        all(number(card.get(name)) for name in NUMBERS)
        and all(isinstance(pair, list) and len(pair) == 2 and all(map(number, pair)) for pair in pairs)
        and (card.get("load_floor") is None or _is_table(card["load_floor"], number))
        and isinstance(card.get("drives"), list)
        and all(
            isinstance(one, dict) and number(one.get("end")) and number(one.get("duration")) for one in card["drives"]
        )
        and isinstance(card.get("parameters"), dict)
        and isinstance(card.get("soils"), list)
        and all(isinstance(soil, str) for soil in card["soils"])
        and all(isinstance(card.get(name), str) for name in ("directions", "vehicle", "worst_load"))
    )


def _is_table(value: Any, number: Callable[[Any], bool]) -> bool:
    """Whether a value is a list of numbers for each body."""
    rows = value if isinstance(value, list) and len(value) == len(BODIES) else [None]
    return all(isinstance(r, list) and len(r) == len(WRENCH_COMPONENTS) and all(map(number, r)) for r in rows)
