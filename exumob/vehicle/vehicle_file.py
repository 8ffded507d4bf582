"""Vehicles from files: a Python file with one function that takes no argument and returns a `Vehicle`.

A vehicle file is a program: loading it runs what stands in it, with the rights of the user.
"""

from __future__ import annotations

import hashlib
import importlib.util
import inspect
import sys
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import Any

from exumob.support.declared import checked
from exumob.vehicle.parameters import Vehicle


@checked
def load_vehicle(file: Path) -> Vehicle:
    """Load a vehicle file: a Python file with one function that takes no argument and returns a `Vehicle`.

    The file may import modules that lie beside it.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If it cannot be run, with the line and the error; or if it does not hold exactly one such function.
    """
    path = file.expanduser()
    if path.is_dir():
        raise ValueError(f"vehicle file {path} is a folder; give the Python file in it.")
    if not path.is_file():
        raise FileNotFoundError(f"vehicle file {path} does not exist; vehicle_models/ holds examples.")
    path = path.resolve()
    name = f"exumob_vehicle_{hashlib.sha256(str(path).encode()).hexdigest()[:12]}"  # collides with no other module
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise ValueError(f"vehicle file {path} is not a Python file; its name must end in .py.")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # dataclasses look their module up
    with _modules_beside(path):
        try:
            spec.loader.exec_module(module)
        except (Exception, SystemExit) as error:
            del sys.modules[name]
            raise ValueError(f"vehicle file {path} cannot be run: {_where(error, path)}; mend it.") from error
        maker = _maker(module, path)
        try:
            vehicle = maker()
        except (Exception, SystemExit) as error:
            hint = "exumob/vehicle/parameters.py lists the fields" if isinstance(error, TypeError) else "mend it"
            raise ValueError(f"vehicle file {path}: {_where(error, path)}; {hint}.") from error
    if not isinstance(vehicle, Vehicle):
        raise ValueError(f"{path}: {maker.__name__}() returned {type(vehicle).__name__}; it must return a Vehicle.")
    return vehicle


def _maker(module: ModuleType, path: Path) -> Any:
    """The one public function that a file defines itself."""
    makers = [
        value
        for name, value in vars(module).items()
        if not name.startswith("_")
        and callable(value)
        and not inspect.isclass(value)
        and getattr(value, "__module__", None) == module.__name__
        and hasattr(value, "__name__")
    ]
    makers = list({id(maker): maker for maker in makers}.values())  # a second name for one function is no second one
    if len(makers) != 1:
        found = f": {', '.join(maker.__name__ for maker in makers)}" if makers else ""
        raise ValueError(
            f"vehicle file {path} defines {len(makers)} public functions{found}; it must define exactly one (a name "
            "that begins with _ is not public)."
        )
    try:
        needed = [p.name for p in inspect.signature(makers[0]).parameters.values() if _must_be_given(p)]
    except (TypeError, ValueError):  # built in
        needed = []
    if needed:
        raise ValueError(f"{path}: {makers[0].__name__} takes arguments ({', '.join(needed)}); it must need none.")
    return makers[0]


def _must_be_given(parameter: inspect.Parameter) -> bool:
    some = parameter.kind in (inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD)
    return parameter.default is parameter.empty and not some


def _where(error: BaseException, path: Path) -> str:
    """An error with the line of the file at which it came about."""
    if isinstance(error, SyntaxError):
        return f"line {error.lineno}: {type(error).__name__}: {error.msg}"
    lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == str(path)]
    place = f"line {lines[-1]}: " if lines else ""
    text = " ".join(str(error).split())
    return f"{place}{type(error).__name__}: {text}" if text else f"{place}{type(error).__name__}"


@contextmanager
def _modules_beside(path: Path) -> Iterator[None]:
    """Let a file import what lies beside it, after all that is installed; later files have modules of their own."""
    before, folder = set(sys.modules), str(path.parent)
    sys.path.append(folder)
    try:
        yield
    finally:
        sys.path.remove(folder)
        for name in set(sys.modules) - before:
            place = getattr(sys.modules[name], "__file__", None)
            if place is not None and Path(place).parent == path.parent and Path(place) != path:
                del sys.modules[name]
