"""Dataclasses and functions whose fields and arguments are checked by their declared types.

The type of a field says everything about it: ``mass: Annotated[float, Quantity("kg", above=0.0)]``. A class that
derives from `Declared` is checked when it is made, a function decorated by `checked` when it is called. What is right
but of another kind is made the declared one (an int a float, a list a tuple, a str a Path); all else is refused by a
``ValueError`` that names field, value, limit and remedy.
"""

from __future__ import annotations

import ast
import contextlib
import difflib
import functools
import inspect
import itertools
import os
import re
import textwrap
import types
import typing
from collections.abc import Callable, Mapping, Sequence
from dataclasses import MISSING, fields, is_dataclass
from numbers import Integral, Real
from pathlib import Path
from typing import Annotated, Any, NamedTuple, TypeVar

from exumob.support.quantities import Quantity, shown

F = TypeVar("F", bound=Callable[..., Any])
Check = Callable[[str, Any], Any]
"""Takes the name of a value and the value; returns it, perhaps in its declared kind, or raises ValueError."""


class UnknownField(ValueError, TypeError):
    """A class was given a field that it does not have."""


class MissingField(ValueError, TypeError):
    """A class was not given a field that it needs."""


_make = type.__call__


class _Answering(type):
    """Lets a class that is given unknown fields, or not all, name those that are meant."""

    if not typing.TYPE_CHECKING:  # what a call makes is a matter of the class

        def __call__(cls, *args, **kwargs):
            try:
                return _make(cls, *args, **kwargs)
            except TypeError as error:
                said = str(error).removeprefix(f"{cls.__init__.__qualname__}() ")
                unknown = _unknown_fields(cls, kwargs) if said.startswith("got an unexpected keyword") else ""
                missing = _missing_fields(cls, said) if said.startswith("missing ") else ""
                if not (unknown or missing):
                    raise
            raise UnknownField(unknown) if unknown else MissingField(missing)


def _unknown_fields(owner: type, given: Mapping[str, Any]) -> str:
    """Say which of the names given are no fields, and which fields come nearest; empty if all are."""
    known = [field.name for field in fields(owner) if field.init] if is_dataclass(owner) else []
    unknown = [name for name in given if name not in known]
    if not known or not unknown:
        return ""
    lines = []
    for name in unknown:
        words = {field: re.findall(r"\w+", text) for field, text in _meanings(owner).items()}  # symbols, as phi
        named = [field for field in known if name in words.get(field, ())]
        near = list(dict.fromkeys([*named, *nearest_names(name, known)]))[:3]
        lines.append(f"{name!r} (did you mean {' or '.join(near)}?)" if near else repr(name))
    return f"{owner.__name__} has no field {', no field '.join(lines)}; its fields are {', '.join(known)}."


def _missing_fields(owner: type, said: str) -> str:
    """Say which of the arguments that Python named as missing are fields, with units; empty if not all are."""
    names = re.findall(r"'(\w+)'", said)
    found = [field for field in declared_fields(owner) if field.name in names] if is_dataclass(owner) else []
    if len(found) < len(names):  # arguments of an own __init__
        return ""
    lines = [
        f"{field.name}{f' [{field.quantity.unit}]'.replace('[1]', '[-]') if field.quantity is not None else ''}"
        for field in found
    ]
    return f"{owner.__name__} lacks {', '.join(lines)}; give {'them' if len(lines) > 1 else 'it'}."


def nearest_names(name: str, known: Sequence[str]) -> list[str]:
    """Return the names nearest to one that is not known, three at most: misspelt ones, else those that hold it.

    Parameters
    ----------
    name : str
    known : sequence of str
    """
    asked = name.casefold()
    lowered = {other.casefold(): other for other in known}
    near = [lowered[key] for key in difflib.get_close_matches(asked, lowered, 3, 0.6)]
    return near or [other for key, other in lowered.items() if len(asked) > 1 and asked in key][:3]


class Declared(metaclass=_Answering):
    """Mixin of frozen dataclasses: every field is checked by its declared type when an object is made.

    A field that the class does not have is answered by the nearest names of those that it has (`UnknownField`), one
    that is needed and not given by its name and unit (`MissingField`).
    """

    def __post_init__(self) -> None:
        """Check all fields, then their relations."""
        owner, values = type(self), self.__dict__
        for name, label, low, high, check in owner.__dict__.get("_checks_of_fields") or _field_checks(owner):
            value = values[name]
            if type(value) is float and low <= value <= high:
                continue  # most values: nothing to say and nothing to convert
            accepted = check(label, value)
            if accepted is not value:
                object.__setattr__(self, name, accepted)
        self._check()

    def _check(self) -> None:
        """Raise ValueError if values that are right by themselves do not fit each other; classes override this."""


class DeclaredField(NamedTuple):
    """A field of a `Declared` class as its declaration says it."""

    name: str
    kind: Any
    """Its type, without the quantity"""
    quantity: Quantity | None
    """Unit and bounds; None: it is no number"""
    default: Any
    """`dataclasses.MISSING` if it must be given"""
    meaning: str
    """The text that follows it in the source"""


def declared_fields(owner: type) -> list[DeclaredField]:
    """Return the fields of a dataclass, with what their declarations say."""
    hints = typing.get_type_hints(owner, include_extras=True)
    meanings = _meanings(owner)
    found = []
    for field in fields(owner):
        kind, quantity = _taken_apart(hints[field.name])
        default = field.default if field.default_factory is MISSING else field.default_factory()
        found.append(DeclaredField(field.name, kind, quantity, default, meanings.get(field.name, "")))
    return found


def checked(function: F) -> F:
    """Let a function check its arguments by their declared types before it runs.

    Raises
    ------
    ValueError
        When it is called with an argument of another kind, or beyond its bounds; the message names function and
        argument.
    """
    signature = inspect.signature(function)
    owner = function.__qualname__.removesuffix(".__init__").rpartition("<locals>.")[2]

    @functools.cache
    def argument_checks() -> dict[str, Check]:
        hints = typing.get_type_hints(function, include_extras=True)
        hints.pop("return", None)
        return {name: check_of(hint) for name, hint in hints.items()}

    @functools.wraps(function)
    def call(*args: Any, **kwargs: Any) -> Any:
        bound = signature.bind(*args, **kwargs)
        checks = argument_checks()
        for name, value in bound.arguments.items():
            if name not in checks:
                continue
            kind = signature.parameters[name].kind
            if kind is inspect.Parameter.VAR_POSITIONAL:
                bound.arguments[name] = tuple(checks[name](f"{owner}.{name}", part) for part in value)
            elif kind is inspect.Parameter.VAR_KEYWORD:
                bound.arguments[name] = {key: checks[name](f"{owner}.{key}", part) for key, part in value.items()}
            else:
                bound.arguments[name] = checks[name](f"{owner}.{name}", value)
        return function(*bound.args, **bound.kwargs)

    return typing.cast(F, call)


def _field_checks(owner: type) -> tuple[tuple[str, str, float, float, Check], ...]:
    """For each field: name, its name in messages, interval in which a float needs no look, and check."""
    known = owner.__dict__.get("_checks_of_fields")
    if known is None:
        hints = typing.get_type_hints(owner, include_extras=True)
        rows = []
        for field in fields(typing.cast(Any, owner)):
            hint = hints[field.name]
            kind, quantity = _taken_apart(hint)
            several = typing.get_args(kind) if typing.get_origin(kind) in (typing.Union, types.UnionType) else (kind,)
            low, high = quantity.safe if quantity is not None and float in several else (1.0, 0.0)
            rows.append((field.name, f"{owner.__name__}.{field.name}", low, high, check_of(hint)))
        known = tuple(rows)
        type.__setattr__(owner, "_checks_of_fields", known)
    return typing.cast(tuple[tuple[str, str, float, float, Check], ...], known)


def _taken_apart(hint: Any) -> tuple[Any, Quantity | None]:
    """Split a hint into its type and its quantity, wherever in it the quantity stands."""
    if typing.get_origin(hint) is Annotated:
        inner = typing.get_args(hint)
        found = next((extra for extra in inner[1:] if isinstance(extra, Quantity)), None)
        return (inner[0], found) if found is not None else _taken_apart(inner[0])
    for part in typing.get_args(hint):
        found = _taken_apart(part)[1]
        if found is not None:
            return _bare(hint), found
    return hint, None


def _bare(hint: Any) -> Any:
    """Strip a hint of its annotations, one level deep."""
    if typing.get_origin(hint) in (typing.Union, types.UnionType):
        return functools.reduce(lambda a, b: a | b, (_taken_apart(part)[0] for part in typing.get_args(hint)))
    return hint


def _meanings(owner: type) -> dict[str, str]:
    """The texts that follow the fields in the source of a class and of those it derives from."""
    found: dict[str, str] = {}
    for cls in reversed(owner.__mro__):
        if not is_dataclass(cls):
            continue
        try:
            body = typing.cast(ast.ClassDef, ast.parse(textwrap.dedent(inspect.getsource(cls))).body[0]).body
        except (OSError, SyntaxError, TypeError):
            continue
        for line, text in itertools.pairwise(body):
            if isinstance(line, ast.AnnAssign) and isinstance(line.target, ast.Name) and isinstance(text, ast.Expr):
                if isinstance(text.value, ast.Constant) and isinstance(text.value.value, str):
                    found[line.target.id] = inspect.cleandoc(text.value.value)
    return found


# -- checks by type ----------------------------------------------------------------------------------------------------


class _Kind(NamedTuple):
    """How values of a type are told from others, and checked."""

    fits: Callable[[Any], bool]
    check: Check
    wanted: str


def check_of(hint: Any) -> Check:
    """Return the check of a declared type.

    Raises
    ------
    TypeError
        If the type is one that nothing is known about; a mistake of the programmer.
    """
    return _kind_of(hint, None).check


@functools.cache
def _no_quantity() -> Quantity:
    return Quantity("1")


def _kind_of(hint: Any, quantity: Quantity | None) -> _Kind:
    origin, inner = typing.get_origin(hint), typing.get_args(hint)
    if origin is Annotated:
        own = next((extra for extra in inner[1:] if isinstance(extra, Quantity)), quantity)
        if own is not None and own.shape is not None:
            optional = type(None) in typing.get_args(inner[0])
            return _either([_array(own), _kind_of(type(None), None)]) if optional else _array(own)
        return _kind_of(inner[0], own)
    if origin in (typing.Union, types.UnionType):
        some = [part for part in inner if not (part is str and Path in inner)]  # a text is the name of a file
        return _either([_kind_of(part, quantity) for part in some]) if len(some) > 1 else _kind_of(some[0], quantity)
    if hint is Any or hint is object or isinstance(hint, TypeVar):
        return _Kind(lambda value: True, lambda name, value: value, "anything")
    if hint is float:
        number = quantity or _no_quantity()
        return _Kind(lambda value: isinstance(value, Real) and not isinstance(value, bool), number.check, "a number")
    if hint is int:
        return _whole_number(quantity)
    if hint is bool:
        return _flag()
    if hint is type(None):
        return _of_class(type(None), "None")
    if hint is Path:
        return _path()
    if origin is typing.Literal:
        return _choice(inner)
    if hint is tuple or origin is tuple:
        return _tuple(inner, quantity)
    if origin in (list, Sequence):
        return _sequence(origin, _kind_of(inner[0], quantity))
    if origin in (dict, Mapping):
        return _of_class(Mapping, "a dict")
    if origin is Callable or hint is Callable:
        return _callable()
    if origin is type:
        return _of_class(type, "a class")
    if isinstance(origin, type):
        hint = origin  # a generic class
    if isinstance(hint, type):
        if getattr(hint, "_is_protocol", False):
            return _protocol(hint)
        return _of_class(hint, f"a {hint.__name__}")
    raise TypeError(f"{hint!r} cannot be checked; use another type, or teach exumob.support.declared this one")


def _refused(name: str, value: Any, wanted: str) -> ValueError:
    return ValueError(f"{name} = {_with_type(value)} must be {wanted}.")


def _with_type(value: Any) -> str:
    plain = value is None or isinstance(value, str | Real | type)
    return shown(value) if plain else f"{shown(value)} ({type(value).__name__})"


def _either(kinds: list[_Kind]) -> _Kind:
    wanted = " or ".join(dict.fromkeys(kind.wanted for kind in kinds))

    def check(name: str, value: Any) -> Any:
        for kind in kinds:
            if kind.fits(value):
                return kind.check(name, value)
        raise _refused(name, value, wanted)

    def fits(value: Any) -> bool:
        return any(kind.fits(value) for kind in kinds)

    others = [kind for kind in kinds if kind.wanted != "None"]
    if len(others) == 1 and len(kinds) == 2:  # its own message says more

        def check_given(name: str, value: Any) -> Any:
            return None if value is None else others[0].check(name, value)

        return _Kind(fits, check_given, wanted)
    return _Kind(fits, check, wanted)


def _whole_number(quantity: Quantity | None) -> _Kind:
    bounds = f", {quantity.bounds}" if quantity is not None and quantity.bounds else ""

    def fits(value: Any) -> bool:  # time spans of numpy count as whole numbers, but are no index
        return isinstance(value, Integral) and not isinstance(value, bool) and hasattr(type(value), "__index__")

    def check(name: str, value: Any) -> Any:
        if not fits(value):
            raise _refused(name, value, f"a whole number{bounds}")
        number = int(value)
        if abs(number) > 2**62:
            raise ValueError(f"{name} = {shown(number)} is too large; give a whole number{bounds}.")
        if quantity is not None:
            quantity.check(name, number)
        return number

    return _Kind(fits, check, "a whole number")


def _flag() -> _Kind:
    def fits(value: Any) -> bool:
        return isinstance(value, bool) or (type(value).__name__ == "bool" and type(value).__module__ == "numpy")

    def check(name: str, value: Any) -> bool:
        if not fits(value):
            raise _refused(name, value, "True or False")
        return bool(value)

    return _Kind(fits, check, "True or False")


def _of_class(owner: type, wanted: str) -> _Kind:
    wanted = "a text" if owner is str else wanted

    def check(name: str, value: Any) -> Any:
        if not isinstance(value, owner):
            raise _refused(name, value, wanted)
        return value

    return _Kind(lambda value: isinstance(value, owner), check, wanted)


def _path() -> _Kind:
    def fits(value: Any) -> bool:
        return isinstance(value, str | os.PathLike)

    def check(name: str, value: Any) -> Path:
        try:
            text = os.fspath(value) if fits(value) else b""
        except Exception:  # a foreign __fspath__ may do anything
            text = b""
        if isinstance(text, bytes):
            raise _refused(name, value, "the path of a file")
        try:
            usable = bool(text) and b"\0" not in os.fsencode(text)
        except UnicodeEncodeError:
            usable = False
        if not usable:
            raise ValueError(f"{name} = {shown(value)} is not the path of a file; give its name.")
        return Path(text)

    return _Kind(fits, check, "the path of a file")


def _choice(values: tuple[Any, ...]) -> _Kind:
    names = [repr(value) for value in values]
    wanted = (", ".join(names[:-1]) + " or " if names[:-1] else "") + names[-1]

    def found(value: Any) -> list[Any]:
        plain = str(value) if isinstance(value, str) else value  # a text of numpy, or of an enumeration
        return [known for known in values if type(plain) is type(known) and plain == known]

    def fits(value: Any) -> bool:
        return bool(found(value))

    def check(name: str, value: Any) -> Any:
        if type(value) is str and value in values:
            return value
        if not fits(value):
            raise ValueError(f"{name} = {shown(value)} is not known; use {wanted}.")
        return found(value)[0]

    return _Kind(fits, check, wanted)


def _tuple(inner: tuple[Any, ...], quantity: Quantity | None) -> _Kind:
    any_length = len(inner) == 2 and inner[1] is Ellipsis
    parts = [_kind_of(part, quantity) for part in inner if part is not Ellipsis]

    def fits(value: Any) -> bool:
        with contextlib.suppress(Exception):  # whatever an object's own attributes raise: it is no tuple
            return isinstance(value, list | tuple) or (hasattr(value, "tolist") and getattr(value, "ndim", 0) > 0)
        return False

    wanted = f"a tuple of {'any number of values' if any_length else f'{len(parts)} values'}"
    if parts:
        wanted += f", each {parts[0].wanted}"

    def check(name: str, value: Any) -> Any:
        if not fits(value):
            raise _refused(name, value, wanted)
        mask: Any = getattr(value, "mask", False)
        if mask is True or (hasattr(mask, "any") and mask.any()):
            raise ValueError(f"{name} is a masked array; give numbers alone.")
        given = value.tolist() if hasattr(value, "tolist") else value
        if parts and not any_length and len(given) != len(parts):
            raise ValueError(f"{name} = {shown(value)} has {len(given)} values; it must have {len(parts)}.")
        kinds = parts * len(given) if any_length else parts or [_kind_of(Any, None)] * len(given)
        accepted = tuple(
            kind.check(f"{name}[{n}]", part) for n, (kind, part) in enumerate(zip(kinds, given, strict=True))
        )
        unchanged = type(value) is tuple and all(a is b for a, b in zip(accepted, value, strict=True))
        return value if unchanged else accepted

    return _Kind(fits, check, wanted)


def _sequence(owner: Any, part: _Kind) -> _Kind:
    def fits(value: Any) -> bool:
        return isinstance(value, owner) and not isinstance(value, str | bytes)

    def check(name: str, value: Any) -> Any:
        if not fits(value):
            raise _refused(name, value, f"a list, each of its values {part.wanted}")
        return [part.check(f"{name}[{n}]", one) for n, one in enumerate(value)]

    return _Kind(fits, check, "a list")


def _callable() -> _Kind:
    def check(name: str, value: Any) -> Any:
        if not callable(value):
            raise _refused(name, value, "a function")
        return value

    return _Kind(callable, check, "a function")


def _protocol(owner: type) -> _Kind:
    """Objects that have all that a protocol asks for, whatever their class."""
    members = sorted(name for base in owner.__mro__ for name in _members(base))

    def missing(value: Any) -> list[str]:
        return [name for name in members if not _has(value, name)]

    def check(name: str, value: Any) -> Any:
        if isinstance(value, type) and not missing(value):
            raise ValueError(f"{name} = {value.__name__} is a class; give an object of it: {value.__name__}(...).")
        lacking = missing(value)
        if lacking:
            raise ValueError(
                f"{name} = {_with_type(value)} has no {' and no '.join(lacking[:3])}; it must be a "
                f"{owner.__name__} ({owner.__module__}.{owner.__name__} says what that is)."
            )
        return value

    return _Kind(lambda value: not isinstance(value, type) and not missing(value), check, f"a {owner.__name__}")


def _has(value: Any, name: str) -> bool:
    try:
        return hasattr(value, name)
    except Exception:  # a property that cannot be read yet, or a foreign __getattr__, which may do anything
        return inspect.getattr_static(value, name, None) is not None


def _members(base: type) -> set[str]:
    if not getattr(base, "_is_protocol", False):
        return set()
    own = {name for name, value in vars(base).items() if callable(value) or isinstance(value, property)}
    return {name for name in own | set(base.__annotations__) if not name.startswith("_")}


def _array(quantity: Quantity) -> _Kind:
    assert quantity.shape is not None
    shape = quantity.shape

    def fits(value: Any) -> bool:
        return value is not None and not isinstance(value, str | bytes | bool | Mapping)

    def check(name: str, value: Any) -> Any:
        from exumob.support.arrays import checked_array

        array = checked_array(name, value, shape, finite=not quantity.gaps)
        if array.size and (quantity.bounds or quantity.plausible):
            flat = array.reshape(-1)
            if quantity.gaps:
                flat = flat[flat == flat]  # without nan
            if not flat.size:
                return array
            for place in (int(flat.argmin()), int(flat.argmax())):
                quantity.check(f"{name}[{place}]" if array.ndim == 1 else name, float(flat[place]))
        return array

    return _Kind(fits, check, f"an array of shape ({', '.join(map(str, shape))})")
