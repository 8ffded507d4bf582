"""Vehicles from files: a Python file with one function that takes no argument and returns a `Vehicle`.

Loading such a file runs it, with all that it imports: load only files that you trust.
"""

from __future__ import annotations

import hashlib
import importlib.util
import inspect
import re
import sys
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import Any

from exumob.support.declared import MissingField, UnknownField, checked
from exumob.support.quantities import ImplausibleValue
from exumob.vehicle.parameters import Vehicle

WHAT_IT_IS = "a vehicle file is a Python file with one function that returns a Vehicle; vehicle_models/ holds examples"
MODULES = "exumob_vehicle_file_"
"""Begin of the names by which the files are known as modules."""


class _FileError(ValueError):
    """An error about the file as a whole."""


@checked
def load_vehicle(file: str | Path) -> Vehicle:
    """Load a vehicle file: a Python file with one function that takes no argument and returns a `Vehicle`.

    The file is run, with all that it imports; modules that lie beside it can be imported while it is loaded.

    Parameters
    ----------
    file : Path
        Its name ends in ``.py``; or the name of a vehicle that comes with exumob, such as ``small_car``. Functions
        whose names begin with an underscore, functions imported from elsewhere, and classes may stand beside the one
        that makes the vehicle.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If it is not a Python file, if it breaks while it runs (with file, line, kind and text of the error), or if it
        does not hold exactly one such function.
    """
    path = Path(file).expanduser()
    if not path.is_file():  # a folder may have a vehicle's name, such as the one that its runs are kept in
        path = shipped_vehicle_file(path)
    if path.suffix != ".py":
        raise ValueError(f"vehicle file {path} is not a Python file; its name must end in .py ({WHAT_IT_IS}).")
    with _modules_beside(path), _errors_named(path):
        module = _run(path)
        maker = _maker(module, path)
        vehicle = maker()
    if not isinstance(vehicle, Vehicle):
        what = "the class Vehicle itself" if vehicle is Vehicle else type(vehicle).__name__
        raise ValueError(f"{path}: {maker.__name__}() returned {what}; it must return a Vehicle.")
    return vehicle


def shipped_vehicle_file(path: str | Path) -> Path:
    """Return the file of a vehicle that comes with exumob, by its name, such as ``small_car``.

    Raises
    ------
    FileNotFoundError
        If none has this name, with those that there are.
    ValueError
        If the name is that of a folder.
    """
    found = importlib.util.find_spec("vehicle_models")
    folders = list(found.submodule_search_locations or []) if found is not None else []
    known = {file.stem: file for folder in folders for file in sorted(Path(folder).glob("[!_]*.py"))}
    if str(path) in known:
        return known[str(path)]
    if Path(path).is_dir():
        raise ValueError(f"vehicle file {path} is a folder; give a file in it: {WHAT_IT_IS}.")
    raise FileNotFoundError(
        f"vehicle file {path} does not exist; give the path of a file, or the name of a vehicle that comes with exumob"
        f"{': ' + ', '.join(known) if known else ''}."
    )


def _run(path: Path) -> ModuleType:
    """Run the file as a module of its own.

    Its name cannot be that of another module; it stays known by it, as dataclasses and pickle need.
    """
    digest = hashlib.sha256(str(path.resolve()).encode("utf-8", "surrogateescape")).hexdigest()[:12]
    name = f"{MODULES}{re.sub(r'[^0-9A-Za-z]', '_', path.stem)}_{digest}"
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None  # its name ends in .py
    module = importlib.util.module_from_spec(spec)
    try:
        code = compile(path.read_bytes(), str(path), "exec", dont_inherit=True)  # no bytecode is kept beside the file
    except SyntaxError as error:
        where = f", line {error.lineno}" if error.lineno else ""
        raise _FileError(
            f"vehicle file {path} is not Python{where}: {type(error).__name__}: {error.msg}; mend it."
        ) from None
    except (ValueError, RecursionError, MemoryError) as error:  # zero bytes, endless nesting
        raise _FileError(f"vehicle file {path} is not Python: {error or type(error).__name__}; mend it.") from None
    before = sys.modules.get(name)
    sys.modules[name] = module
    try:
        exec(code, vars(module))
    except BaseException:
        if before is None:
            del sys.modules[name]
        else:
            sys.modules[name] = before
        raise
    return module


def _maker(module: ModuleType, path: Path) -> Any:
    """Return the one public function of the file."""
    makers = {
        id(value): value  # a second name for one function is no second one
        for name, value in vars(module).items()
        if not name.startswith("_")
        and callable(value)
        and not inspect.isclass(value)
        and getattr(value, "__module__", None) == module.__name__
        and hasattr(value, "__name__")  # functions, also decorated ones
    }
    if len(makers) != 1:
        names = f": {', '.join(sorted(maker.__name__ for maker in makers.values()))}" if makers else ""
        remedy = "Begin the names of others with an underscore."
        if not makers:
            remedy = _instead_of_a_maker(module)
        raise _FileError(
            f"vehicle file {path} defines {len(makers)} public functions{names}; it must define exactly one, which "
            f"returns the vehicle. {remedy}".rstrip()
        )
    (maker,) = makers.values()
    several = (inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD)
    needed = [
        p.name for p in inspect.signature(maker).parameters.values() if p.default is p.empty and p.kind not in several
    ]
    if needed:
        raise _FileError(f"{path}: {maker.__name__} takes arguments ({', '.join(needed)}); it must need none.")
    return maker


def _instead_of_a_maker(module: ModuleType) -> str:
    """Say what of a file without a public function may have been meant for one."""
    public = {name: value for name, value in vars(module).items() if not name.startswith("_")}
    for name, value in public.items():
        if isinstance(value, Vehicle):
            return f"{name} is a Vehicle: let a function return it."
    several = (inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD)
    makers = [
        name
        for name, value in public.items()
        if inspect.isfunction(value)
        and all(p.default is not p.empty or p.kind in several for p in inspect.signature(value).parameters.values())
    ]
    return f"Imported ones ({', '.join(makers)}) do not count: call them in it." if makers else ""


@contextmanager
def _modules_beside(path: Path) -> Iterator[None]:
    """Let the file import modules that lie beside it while it is loaded.

    They come last, so that they cannot take the place of an installed package, and are forgotten afterwards: another
    vehicle file, in another folder, may have helpers of the same names.
    """
    folder = path.resolve().parent
    paths, known = list(sys.path), {name.partition(".")[0] for name in sys.modules}
    sys.path.append(str(folder))
    importlib.invalidate_caches()
    try:
        yield
    finally:
        sys.path[:] = paths
        if str(folder) not in paths:
            for name, module in list(sys.modules.items()):
                if name.partition(".")[0] not in known and not name.startswith(MODULES) and _lies_in(module, folder):
                    del sys.modules[name]


def _lies_in(module: ModuleType, folder: Path) -> bool:
    places = [getattr(module, "__file__", None), *getattr(module, "__path__", [])]
    return any(Path(place).resolve().is_relative_to(folder) for place in places if isinstance(place, str))


@contextmanager
def _errors_named(path: Path) -> Iterator[None]:
    """Turn whatever goes wrong while the file runs into a ValueError that says where."""
    try:
        yield
    except (KeyboardInterrupt, _FileError):
        raise
    except BaseException as error:  # SystemExit, too: a file may do anything
        frames = traceback.extract_tb(error.__traceback__)
        lines = [frame.lineno for frame in frames if frame.filename == str(path)]
        where = f", line {lines[-1]}" if lines else ""
        beside = [f for f in frames if f.filename != str(path) and Path(f.filename).parent == path.resolve().parent]
        where += f" ({Path(beside[-1].filename).name}, line {beside[-1].lineno})" if beside else ""
        text = " ".join(str(error).split())[:2000]
        says_all = type(error) in (ValueError, ImplausibleValue, UnknownField, MissingField)
        kind = "" if says_all and text else f"{type(error).__name__}{': ' if text else ''}"
        hint = "`exumob parameters` lists the fields." if isinstance(error, MissingField) else "mend it."
        end = "" if text.endswith(".") and not isinstance(error, MissingField) else f"; {hint}"
        refusal = ImplausibleValue if isinstance(error, ImplausibleValue) else ValueError
        raise refusal(f"vehicle file {path}{where}: {kind}{text.removesuffix('.') if end else text}{end}") from error
