"""The provenance of a result: versions, git revision, date, and all parameters as one JSON text."""

from __future__ import annotations

import datetime
import functools
import inspect
import json
import shutil
import subprocess
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

from exumob.support.files import PACKAGE
from exumob.support.identity import digest, source


def _exumob_version() -> str:
    try:
        return metadata.version("exumob")
    except metadata.PackageNotFoundError:
        return "not installed"


EXUMOB_VERSION = _exumob_version()
"""Version of exumob; "not installed" where only its folder is on the path."""


def provenance() -> dict[str, str]:
    """Return the versions, the git revision and the date of this computation."""
    return {
        "exumob_version": EXUMOB_VERSION,
        "exudyn_version": _version("exudyn"),
        "numpy_version": np.__version__,
        "git_revision": _git_revision(),
        "date": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        "random_seed": "none (deterministic)",
    }


@functools.cache
def _version(package: str) -> str:
    return metadata.version(package)


def versions() -> dict[str, str]:
    """Return the versions of the packages on which the bits of a result depend."""
    return {name: _version(name) for name in ("exudyn", "numpy", "scipy", "numba")}


def parameters_json(parameters: dict[str, Any]) -> str:
    """Return all parameters of a run as one JSON text.

    Dataclasses and objects with a dict `parameters` become ``{class name: fields}``, arrays lists, functions their name
    with a digest of their source, other objects the name of their class.
    """
    return json.dumps(parameters, default=_plain)


@functools.cache  # the code of a process is that of its start
def _git_revision() -> str:
    git = shutil.which("git")
    root = PACKAGE.parent
    if git is None or not (root / ".git").exists():  # installed: no repository, or somebody else's around it
        return "unknown"
    answer = subprocess.run(
        [git, "describe", "--always", "--dirty"], cwd=root, capture_output=True, text=True, check=False
    )
    return answer.stdout.strip() or "unknown"


def _plain(value: Any) -> Any:
    """Turn what `json` cannot write into something that it can."""
    if isinstance(parameters := getattr(value, "parameters", None), dict):
        return {type(value).__name__: parameters}
    if is_dataclass(value) and not isinstance(value, type):
        return {type(value).__name__: _unfolded(value)}
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, np.generic):
        return value.item()
    if inspect.isroutine(value):
        return f"{getattr(value, '__qualname__', type(value).__name__)} ({digest(source(value))})"
    return str(value) if isinstance(value, Path) else type(value).__name__


def _unfolded(value: Any) -> Any:
    """Fields of a dataclass and of those within it as dicts; nothing is copied, as a user's object may not allow it."""
    if is_dataclass(value) and not isinstance(value, type):
        return {f.name: _unfolded(getattr(value, f.name)) for f in fields(value)}
    if isinstance(value, Mapping):
        return {key: _unfolded(part) for key, part in value.items()}
    return [_unfolded(part) for part in value] if isinstance(value, list | tuple) else value
