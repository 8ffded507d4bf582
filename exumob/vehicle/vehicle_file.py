"""Vehicles from files: a Python file with one function that takes no argument and returns a `Vehicle`."""

from __future__ import annotations

import importlib.util
import inspect
from pathlib import Path

from exumob.vehicle.parameters import Vehicle


def load_vehicle(file: str | Path) -> Vehicle:
    """Load a vehicle file: a Python file with one function that takes no argument and returns a `Vehicle`.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If the file does not hold exactly one such function.
    """
    path = Path(file)
    if not path.is_file():
        raise FileNotFoundError(f"vehicle file {path} does not exist; vehicle_models/ holds examples.")
    spec = importlib.util.spec_from_file_location(path.stem, path)
    if spec is None or spec.loader is None:
        raise ValueError(f"vehicle file {path} is not a Python file; its name must end in .py.")
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except (SyntaxError, ImportError, NameError, TypeError) as error:
        raise ValueError(f"vehicle file {path} cannot be run: {type(error).__name__}: {error}; mend it.") from error
    makers = [
        value
        for name, value in vars(module).items()
        if callable(value) and getattr(value, "__module__", None) == path.stem and not name.startswith("_")
    ]
    if len(makers) != 1:
        raise ValueError(f"vehicle file {path} defines {len(makers)} public functions; it must define exactly one.")
    if any(p.default is p.empty for p in inspect.signature(makers[0]).parameters.values()):
        raise ValueError(f"{path}: {makers[0].__name__} takes arguments; it must need none.")
    try:
        vehicle = makers[0]()
    except TypeError as error:  # a misspelt or missing field
        raise ValueError(f"vehicle file {path}: {error}; exumob/vehicle/parameters.py lists the fields.") from error
    if not isinstance(vehicle, Vehicle):
        raise ValueError(f"{path}: {makers[0].__name__}() returned {type(vehicle).__name__}; it must return a Vehicle.")
    return vehicle
