"""What tells one function of a user from another: the values that it holds, the files that they name, the code.

Values become texts by dotted name, so that an error can say what differs. Arrays count with all of their elements,
files with their contents. Of the code, that of exumob counts as a whole; of the user's own the function counts, with
every function, class, constant and module of the user that it names, its default arguments and what it closes over.
What neither Python source nor values tell apart (compiled extensions, the state of other processes) does not count.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import inspect
import logging
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

from exumob.support.files import PACKAGE

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
    """Find out what a function is: its name, what it holds or is bound to, its code, and exumob itself."""
    found = users_identity(function)
    found.code["exumob"] = program_digest()[:16]
    return found


def users_identity(thing: Any) -> Identity:
    """Find out what an object of any kind is; of the code that of the user alone."""
    found = Identity()
    _Walk(found).value(thing, "")
    return found


def spelled(value: Any) -> str:
    """Text of a value without addresses; where code of the user belongs to it, with a digest of all that it is."""
    found = users_identity(value)
    if not found.code:
        return stable_repr(value)
    return f"{stable_repr(value)} ({digest(found.values_digest() + found.code_digest())})"


@functools.cache
def program_digest() -> str:
    """Digest of the package's sources, as they were when it was first asked for."""
    found = hashlib.sha256()
    for file in sorted(PACKAGE.rglob("*.py")):
        found.update(file.relative_to(PACKAGE).as_posix().encode() + file.read_bytes())
    return found.hexdigest()


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

    def __init__(self, found: Identity, above: list[Any] | None = None, seen: list[Any] | None = None) -> None:
        self.found = found
        self.above: list[Any] = [] if above is None else above
        self.seen: list[Any] = [] if seen is None else seen
        """Functions, classes and modules whose code is added; several may have the same name"""

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
        elif _is_labelled(thing):
            whole = thing.to_dataset(name="values") if hasattr(thing, "to_dataset") else thing
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
            self._parts(path, (("of", thing.__self__), *_bound_to(thing.__func__)))
        elif isinstance(thing, ModuleType | logging.Logger):  # a logger's state is that of the process
            self._add(path, thing.__name__ if isinstance(thing, ModuleType) else f"Logger {thing.name}")
            self.code(thing)
        elif isinstance(thing, type) or inspect.isroutine(thing):
            self._add(path, getattr(thing, "__qualname__", stable_repr(thing)))
            self.code(thing)
            if _is_users(_module_of(thing)):
                self._parts(path, _bound_to(thing))
        else:
            self._object(thing, path)

    def _object(self, thing: Any, path: str) -> None:
        self._add(path, type(thing).__qualname__)
        self.code(type(thing))
        if callable(beyond := getattr(type(thing), "beyond_its_fields", None)):
            for name, text in beyond(thing).items():
                self._add(f"{path}.{name}".lstrip("."), text)
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
        if not isinstance(thing, FunctionType | type | ModuleType) and callable(thing):
            thing = inspect.unwrap(thing)
        module = _module_of(thing)
        if (module is not None and not _is_users(module)) or any(thing is other for other in self.seen):
            return
        self.seen.append(thing)
        place = Path(getattr(module, "__file__", None) or "").stem
        self._add_code(f"{place}.{thing.__qualname__}" if hasattr(thing, "__qualname__") else place, source(thing))
        for label, other in _named_by(thing):
            if isinstance(other, ModuleType | type) or (inspect.isroutine(other) and not inspect.ismethod(other)):
                self.code(other)
            else:
                inner = Identity(code=self.found.code)
                _Walk(inner, self.above, self.seen).value(other, label)
                self._add_code(f"{place}.{label}", inner.values_digest())

    def _add_code(self, name: str, text: str) -> None:
        """Add a text under its name, with a number if another has that: a wrapper has the name of what it wraps."""
        number, free, wanted = 1, name, digest(text)
        while self.found.code.get(free, wanted) != wanted:
            number += 1
            free = f"{name} ({number})"
        self.found.code[free] = wanted


def _module_of(thing: Any) -> ModuleType | None:
    return thing if isinstance(thing, ModuleType) else sys.modules.get(getattr(thing, "__module__", "") or "")


def _is_users(module: ModuleType | None) -> bool:
    """Whether a module is a file outside of the package, of Python and of what is installed."""
    if module is None:
        return True
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
    """What counts of what a function, a class or a module names, and of what a function or class holds."""
    if isinstance(thing, ModuleType):
        found = ((name, part) for name, part in sorted(vars(thing).items()) if not name.startswith("__"))
        yield from ((name, part) for name, part in found if _counts(part))
    elif isinstance(thing, type):
        for name, part in vars(thing).items():
            if isinstance(part, property):
                inner: list[Any] = [part.fget, part.fset, part.fdel]
            else:  # of a staticmethod, a classmethod; of a cached_property, a partialmethod
                inner = [getattr(part, "__func__", getattr(part, "func", part))]
            for one in inner:
                if isinstance(one, FunctionType):
                    yield from _named_by(one)
            if isinstance(part, functools.partialmethod):
                yield f"{thing.__qualname__}.{name}", [part.args, part.keywords]
            elif not name.startswith("__") and (_is_data(part) or isinstance(part, type)):
                yield f"{thing.__qualname__}.{name}", part
        yield from ((base.__qualname__, base) for base in thing.__bases__)
    elif isinstance(thing, FunctionType):
        for name in sorted(set(_names(thing.__code__))):
            if name in thing.__globals__ and _counts(thing.__globals__[name]):
                yield name, thing.__globals__[name]
        yield from ((f"{thing.__qualname__}.{name}", part) for name, part in _bound_to(thing))


def _bound_to(thing: Any) -> Iterator[tuple[str, Any]]:
    """What a function holds: its default arguments, what it closes over, what it wraps; by name."""
    if isinstance(thing, FunctionType):
        code = thing.__code__
        defaults = thing.__defaults__ or ()
        positional = code.co_varnames[: code.co_argcount]
        yield from zip(positional[len(positional) - len(defaults) :], defaults, strict=True)
        yield from sorted((thing.__kwdefaults__ or {}).items())
        for name, cell in zip(code.co_freevars, thing.__closure__ or (), strict=True):
            with contextlib.suppress(ValueError):  # nothing is in it yet
                yield name, cell.cell_contents
    wrapped = getattr(thing, "__wrapped__", None)
    if wrapped is not None and not isinstance(thing, type):
        yield "wrapped", wrapped


def _counts(thing: Any) -> bool:
    """Whether something at the top level of a module tells one sweep from another."""
    if isinstance(thing, ModuleType | type | functools.partial | set | frozenset) or _is_labelled(thing):
        return True
    return inspect.isroutine(thing) or _is_data(thing) or _is_users_own(type(thing))


def _is_users_own(kind: type) -> bool:
    module = _module_of(kind)
    return module is not None and _is_users(module)


def _names(code: CodeType) -> Iterator[str]:
    yield from code.co_names
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _names(constant)


def _is_labelled(thing: Any) -> bool:
    """Whether something is a Dataset or DataArray; nothing is before xarray is loaded, which takes its time."""
    xarray = sys.modules.get("xarray")
    return xarray is not None and isinstance(thing, xarray.Dataset | xarray.DataArray)


def _is_data(thing: Any) -> bool:
    return isinstance(
        thing, bool | int | float | complex | str | bytes | list | tuple | dict | Path | np.ndarray | np.generic
    ) or (is_dataclass(thing) and not isinstance(thing, type))  # fmt: skip


def source(thing: Any) -> str:
    """Source of a function, class or module, or of its whole module where Python does not find it; else empty.

    Of a function that shares its lines with others (a lambda), or whose own lines are not found, the instructions, too.
    """
    with contextlib.suppress(OSError, TypeError):  # that of a wrapper, not of what it wraps
        found = inspect.getsource(thing.__code__ if isinstance(thing, FunctionType) else thing)
        return found + _instructions(thing) if getattr(thing, "__name__", "") == "<lambda>" else found
    with contextlib.suppress(OSError, TypeError):
        module = sys.modules.get(getattr(thing, "__module__", None) or "", thing)
        return Path(inspect.getfile(module)).read_text("utf-8") + _instructions(thing)
    return _instructions(thing)


def _instructions(thing: Any) -> str:
    """What a function does, as this version of Python has compiled it; empty if it is no function."""
    code = thing.__code__ if isinstance(thing, FunctionType) else thing
    if not isinstance(code, CodeType):
        return ""
    held = [
        repr(sorted(map(repr, part))) if isinstance(part, frozenset) else _instructions(part) or repr(part)
        for part in code.co_consts
    ]
    return f"{code.co_code.hex()} {code.co_names} {held}"


def stable_repr(thing: Any) -> str:
    """The repr of an object without addresses, which change from run to run."""
    return re.sub(r" at 0x[0-9a-fA-F]+", "", repr(thing))
