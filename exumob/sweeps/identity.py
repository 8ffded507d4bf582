"""What distinguishes one sweep from another: the values that its function holds, the files that they name, the code.

Values become texts by dotted name, so that an error can say what differs. Arrays count with all of their elements,
files with their contents. Of the code, that of exumob counts as a whole; of the user's own the function counts, with
every function, class, constant and module of the user that it names.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import inspect
import re
import site
import sys
import sysconfig
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields, is_dataclass
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any

import numpy as np
import xarray as xr

from exumob.simulation.checkpoint import program_digest
from exumob.support.files import PACKAGE
from exumob.sweeps.experiment import Experiment

LONGEST = 80
"""Length of a text beyond which its digest stands for it."""


@dataclass(frozen=True)
class Identity:
    """What a function is, as texts that can be compared and kept."""

    values: dict[str, str] = field(default_factory=dict)
    """What it is bound to and holds, by dotted name, files with a digest of their contents"""
    code: dict[str, str] = field(default_factory=dict)
    """Digests of the code, by name"""

    def values_digest(self) -> str:
        """Short hash of the values."""
        return digest(repr(sorted(self.values.items())))

    def code_digest(self) -> str:
        """Short hash of the code."""
        return digest(repr(sorted(self.code.items())))


def identity(function: Any) -> Identity:
    """Find out what a function is: its name, what it holds or is bound to, its code."""
    found = Identity()
    _Walk(found).value(function, "")
    found.code["exumob"] = _program()
    return found


def digest(text: str) -> str:
    """Short hash of a text."""
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def differences(kept: Mapping[str, str], wanted: Mapping[str, str], most: int = 3) -> str:
    """Say which values differ, with those kept and those wanted."""
    names = [name for name in {**kept, **wanted} if kept.get(name) != wanted.get(name)]
    said = [f"{name or 'the function'} was {kept.get(name, 'not there')}, is {wanted.get(name, 'not there')}"
            for name in names[:most]]  # fmt: skip
    return "; ".join(said) + (f"; and {len(names) - most} more" if len(names) > most else "")


def file_text(file: Path) -> str:
    """Name of a file with a digest of its contents, wherever it lies; the path alone if there is no file."""
    if not file.is_file():
        return str(file)
    about = file.stat()
    return f"{file.name} ({_contents(file, about.st_mtime_ns, about.st_size, about.st_ino)})"


@functools.lru_cache(256)
def _contents(file: Path, *_about: int) -> str:
    return hashlib.sha256(file.read_bytes()).hexdigest()[:16]


class _Walk:
    """Goes through what a function holds."""

    def __init__(self, found: Identity) -> None:
        self.found = found
        self.above: list[Any] = []

    def value(self, thing: Any, path: str) -> None:
        """Add what stands at a path, and all within it."""
        if any(thing is other for other in self.above):
            self._add(path, "itself")
            return
        self.above.append(thing)
        try:
            self._value(thing, path)
        finally:
            self.above.pop()

    def _value(self, thing: Any, path: str) -> None:
        if isinstance(thing, np.generic):
            thing = thing.item()
        if thing is None or isinstance(thing, bool | int | float | complex | str | bytes):
            self._add(path, repr(thing))
        elif isinstance(thing, np.ndarray) and thing.dtype.kind not in "OV":
            mask = np.ma.getmaskarray(thing).tobytes() if isinstance(thing, np.ma.MaskedArray) else b""
            contents = hashlib.sha256(np.ascontiguousarray(thing).tobytes() + mask).hexdigest()[:16]
            self._add(path, f"array {thing.dtype} {thing.shape} {contents}")
        elif isinstance(thing, Path):
            self._add(path, file_text(thing))
        elif isinstance(thing, xr.Dataset | xr.DataArray):
            whole = thing if isinstance(thing, xr.Dataset) else thing.to_dataset(name="values")
            self._add(path, type(thing).__name__)
            self._parts(path, ((f"[{name!r}]", whole[name].values) for name in sorted(whole.variables, key=str)))
        elif isinstance(thing, Mapping):
            self._add(path, type(thing).__name__)
            self._parts(path, sorted(((f"[{key!r}]", part) for key, part in thing.items()), key=lambda item: item[0]))
        elif isinstance(thing, list | tuple):
            self._add(path, f"{type(thing).__name__} of {len(thing)}")
            if len(thing) > 12 and all(type(part) in (bool, int, float, str) for part in thing):
                self._add(f"{path}[:]", digest(repr(thing)))
            else:
                self._parts(path, ((f"[{n}]", part) for n, part in enumerate(thing)))
        elif isinstance(thing, set | frozenset):
            self._add(path, digest(repr(sorted(stable_repr(part) for part in thing))))
        elif isinstance(thing, functools.partial):
            self._add(path, "partial")
            self._parts(path, (("function", thing.func), ("arguments", thing.args), ("keywords", thing.keywords)))
        elif inspect.ismethod(thing):
            self._add(path, f"method {thing.__func__.__qualname__}")
            self.code(thing.__func__)
            self._parts(path, (("of", thing.__self__),))
        elif isinstance(thing, type) or inspect.isroutine(thing):
            self._add(path, getattr(thing, "__qualname__", stable_repr(thing)))
            self.code(thing)
        else:
            self._object(thing, path)

    def _object(self, thing: Any, path: str) -> None:
        self._add(path, type(thing).__qualname__)
        self.code(type(thing))
        if isinstance(thing, Experiment):
            self._add(f"{path}.networks".lstrip("."), thing.network_digests())
        if is_dataclass(thing):
            self._parts(path, ((f.name, getattr(thing, f.name)) for f in fields(thing)))
        elif isinstance(parameters := getattr(thing, "parameters", None), dict):
            self._parts(path, (("parameters", parameters),))
        elif isinstance(held := getattr(thing, "__dict__", None), dict):
            self._parts(path, sorted(held.items()))
        else:
            self._add(path, stable_repr(thing))

    def _parts(self, path: str, parts: Any) -> None:
        for name, part in parts:
            self.value(part, f"{path}{name}" if name.startswith("[") or not path else f"{path}.{name}")

    def _add(self, path: str, text: str) -> None:
        self.found.values[path] = text if len(text) <= LONGEST else f"{text[:24]}... ({digest(text)})"

    def code(self, thing: Any) -> None:
        """Add the code of a function, class or module of the user, and of all of the user's own that it names."""
        thing = inspect.unwrap(thing) if callable(thing) else thing
        module = thing if isinstance(thing, ModuleType) else sys.modules.get(getattr(thing, "__module__", "") or "")
        if module is not None and not _is_users(module):
            return
        place = Path(getattr(module, "__file__", None) or "").stem
        name = f"{place}.{thing.__qualname__}" if hasattr(thing, "__qualname__") else place
        if name in self.found.code:
            return
        self.found.code[name] = digest(source(thing))
        for label, other in _named_by(thing):
            if isinstance(other, ModuleType | type) or inspect.isroutine(other):
                self.code(other)
            elif _is_data(other):
                inner = Identity()
                _Walk(inner).value(other, label)
                self.found.code[f"{place}.{label}"] = inner.values_digest()


def _is_users(module: ModuleType) -> bool:
    """Whether a module is a file outside of the package, of Python and of what is installed."""
    file = getattr(module, "__file__", None)
    if file is None:
        return module.__name__ == "__main__"
    path = Path(file).resolve()
    return not any(path.is_relative_to(folder) for folder in _installed())


@functools.cache
def _installed() -> tuple[Path, ...]:
    known = [sysconfig.get_path(name) for name in ("stdlib", "platstdlib", "purelib", "platlib")]
    known += [*site.getsitepackages(), site.getusersitepackages(), str(PACKAGE)]
    return tuple(Path(folder).resolve() for folder in known)


def _named_by(thing: Any) -> Iterator[tuple[str, Any]]:
    """What a function, the methods of a class or a module name, of what stands at the top level of their module."""
    if isinstance(thing, ModuleType):
        yield from ((name, part) for name, part in sorted(vars(thing).items()) if not name.startswith("__"))
    elif isinstance(thing, type):
        for part in vars(thing).values():
            inner = getattr(part, "__func__", getattr(part, "fget", part))
            if isinstance(inner, FunctionType):
                yield from _named_by(inspect.unwrap(inner))
        yield from ((base.__qualname__, base) for base in thing.__bases__)
    elif isinstance(thing, FunctionType):
        for name in sorted(set(_names(thing.__code__))):
            if name in thing.__globals__:
                yield name, thing.__globals__[name]


def _names(code: CodeType) -> Iterator[str]:
    yield from code.co_names
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _names(constant)


def _is_data(thing: Any) -> bool:
    return isinstance(
        thing, bool | int | float | complex | str | bytes | list | tuple | dict | Path | np.ndarray | np.generic
    ) or (is_dataclass(thing) and not isinstance(thing, type))  # fmt: skip


def source(thing: Any) -> str:
    """Source of a function, class or module, or of its whole module where Python does not find it; else empty."""
    with contextlib.suppress(OSError, TypeError):
        return inspect.getsource(thing)
    with contextlib.suppress(OSError, TypeError):
        return Path(inspect.getfile(sys.modules.get(getattr(thing, "__module__", ""), thing))).read_text("utf-8")
    return ""


def stable_repr(thing: Any) -> str:
    """The repr of an object without addresses, which change from run to run."""
    return re.sub(r" at 0x[0-9a-fA-F]+", "", repr(thing))


@functools.cache
def _program() -> str:
    return program_digest()[:16]
