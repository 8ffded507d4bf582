"""Values made from declared types: inside the bounds, at them, next to them, beyond, and of other kinds.

Whether a value is right is judged here from the declaration anew (`label_of`), not by the code under test.
"""

from __future__ import annotations

import functools
import math
import types
import typing
from collections.abc import Callable, Mapping, Sequence
from dataclasses import MISSING, fields, is_dataclass
from numbers import Integral, Real
from os import PathLike
from typing import Annotated, Any

import numpy as np
from hypothesis import strategies as st

from exumob import unusual
from exumob.support.declared import Declared
from exumob.support.quantities import OTHER_UNITS, Quantity, Unusual

from .odd_values import ODD, Given, plain
from .outcome import Silent

EXAMPLES: dict[Any, list[Given]] = {}
"""Valid objects of classes and protocols; `examples` fills it"""
PLAIN = Quantity("1")


def judge_number(quantity: Quantity | None, number: float) -> str:
    """``"valid"`` or ``"refused"``, by the declaration alone; ``"any"`` where an infinite number has none."""
    if quantity is None and math.isinf(number):
        return "any"
    q = quantity or PLAIN
    if math.isnan(number) or (math.isinf(number) and not q.infinite):
        return "refused"
    if not (q.at_least <= number <= q.at_most):
        return "refused"
    if (math.isfinite(q.above) and number <= q.above) or (math.isfinite(q.below) and number >= q.below):
        return "refused"
    if q.plausible is not None and number != 0.0 and not isinstance(number, Unusual):
        return "valid" if q.plausible[0] <= number <= q.plausible[1] else "refused"
    return "valid"


def label_of(hint: Any, value: Any, quantity: Quantity | None = None) -> str:
    """``"valid"``, ``"refused"`` or ``"any"`` (not known) for a value of a declared type."""
    origin, inner = typing.get_origin(hint), typing.get_args(hint)
    if origin is Annotated:
        own = next((extra for extra in inner[1:] if isinstance(extra, Quantity)), quantity)
        return label_of(inner[0], value, own)
    if origin in (typing.Union, types.UnionType):
        found = {label_of(part, value, quantity) for part in inner}
        return next(label for label in ("valid", "any", "refused") if label in found)
    if hint is type(None):
        return "valid" if value is None else "refused"
    if quantity is not None and quantity.shape is not None:
        return "refused" if value is None or isinstance(value, str | bytes | bool | Mapping) else "any"
    if hint is float:
        return _label_of_number(value, quantity)
    if hint is int:
        if isinstance(value, bool | np.timedelta64) or not isinstance(value, Integral):
            return "any" if _is_single_array(value) else "refused"
        return judge_number(quantity, float(value)) if abs(int(value)) <= 2**62 else "refused"
    if hint is bool:
        return "valid" if isinstance(value, bool | np.bool_) else "refused"
    if hint is str:
        return "any" if isinstance(value, str) else "refused"
    if origin is typing.Literal:
        return "valid" if any(isinstance(value, type(one)) and value == one for one in inner) else "refused"
    if isinstance(hint, type) and issubclass(hint, PathLike):
        return "any" if isinstance(value, str | PathLike) else "refused"
    if hint is tuple or origin is tuple:
        return _label_of_tuple(inner, value, quantity)
    if origin in (dict, Mapping) or hint in (dict, Mapping):
        return "any" if isinstance(value, Mapping) else "refused"
    if origin in (list, Sequence):
        return "any" if hasattr(type(value), "__len__") and not isinstance(value, str | bytes) else "refused"
    if origin is Callable or hint is Callable:
        return "any" if callable(value) else "refused"
    owner = origin if isinstance(origin, type) else hint
    if isinstance(owner, type) and owner is not Any and not getattr(owner, "_is_protocol", False):
        return "valid" if isinstance(value, owner) else "refused"
    return "any"


def _is_single_array(value: Any) -> bool:
    return type(value).__module__.startswith(("numpy", "xarray")) and getattr(value, "ndim", 1) == 0


def _label_of_number(value: Any, quantity: Quantity | None) -> str:
    if isinstance(value, bool | np.bool_ | np.timedelta64) or not isinstance(value, Real):
        return "any" if _is_single_array(value) else "refused"
    try:
        number = value if isinstance(value, Unusual) else float(value)
    except OverflowError:
        return "refused"
    except RuntimeError:
        return "any"
    return judge_number(quantity, number)


def _label_of_tuple(inner: tuple[Any, ...], value: Any, quantity: Quantity | None) -> str:
    if not isinstance(value, list | tuple):
        return "any" if type(value).__module__.startswith(("numpy", "xarray")) else "refused"
    if not inner:
        return "any"
    if inner[-1] is Ellipsis:
        kinds = [inner[0]] * min(len(value), 100)
    elif len(value) != len(inner):
        return "refused"
    else:
        kinds = list(inner)
    labels = {label_of(kind, part, quantity) for kind, part in zip(kinds, value, strict=False)}
    return next((label for label in ("refused", "any", "valid") if label in labels), "any")


@functools.lru_cache(maxsize=2000)
def _labelled(hint: Any) -> list[Given]:
    return [odd._replace(label=label_of(hint, odd.make())) for odd in ODD]


# -- strategies --------------------------------------------------------------------------------------------------------


@functools.lru_cache(maxsize=2000)
def values_of(hint: Any) -> st.SearchStrategy[Given]:
    """Values for a declared type, half of them right or nearly so, half of any kind."""
    return st.one_of(_of_kind(hint), _of_kind(hint), st.sampled_from(_labelled(hint)))


def valid_of(hint: Any) -> st.SearchStrategy[Given]:
    """Values for a declared type that are right by themselves."""
    return _of_kind(hint).filter(lambda given: given.label in ("valid", "any"))


def _numbered(quantity: Quantity | None, number: float) -> Given:
    return plain(number, judge_number(quantity, number))


def numbers(quantity: Quantity | None) -> st.SearchStrategy[Given]:
    """Numbers about the bounds of a quantity."""
    q = quantity or PLAIN
    ends = [q.above, q.at_least, q.at_most, q.below, *(q.plausible or ()), 0.0]
    ends = [float(end) for end in ends if math.isfinite(end)]
    near = [
        f(end)
        for end in ends
        for f in (float, lambda e: math.nextafter(e, -math.inf), lambda e: math.nextafter(e, math.inf))
    ]
    low, high = q.plausible or (max(q.above, q.at_least, -1e6), min(q.below, q.at_most, 1e6))
    inside = st.floats(low, high, allow_nan=False)
    units = [size for _, size in OTHER_UNITS.get(q.unit, ())]
    scales = [*units, *(1.0 / size for size in units), -1.0, 10.0, 1e3, 1e6, 1e30, 1e-3, 1e-9]

    def marked(number: float) -> Given:
        return Given(f"unusual({number!r})", lambda: unusual(number), judge_number(q, unusual(number)))

    return st.one_of(
        inside.map(functools.partial(_numbered, q)),
        st.sampled_from(near).map(functools.partial(_numbered, q)),
        st.builds(lambda x, s: _numbered(q, x * s), inside, st.sampled_from(scales)),
        st.floats().map(functools.partial(_numbered, q)),
        st.builds(lambda x, s: marked(x * s), inside, st.sampled_from(scales)),
    )


def _whole_numbers(quantity: Quantity | None) -> st.SearchStrategy[Given]:
    q = quantity or PLAIN
    ends = [int(end) for end in (q.above, q.at_least, q.at_most, q.below, 0.0) if math.isfinite(end)]
    low, high = max(q.above, q.at_least, -100), min(q.below, q.at_most, 1000)

    def labelled(number: int) -> Given:
        return plain(number, label_of(int, number, q))

    return st.one_of(
        st.integers(math.ceil(low), math.floor(high)).map(labelled),
        st.sampled_from([end + step for end in ends for step in (-1, 0, 1)]).map(labelled),
        st.integers().map(labelled),
        st.integers(-(2**70), 2**70).map(labelled),
    )


def _arrays(quantity: Quantity) -> st.SearchStrategy[Given]:
    q = quantity
    low, high = q.plausible or (max(q.above, q.at_least, -1e3), min(q.below, q.at_most, 1e3))

    @st.composite
    def build(draw: Any) -> Given:
        free: dict[str, int] = {}
        shape = [n if isinstance(n, int) else free.setdefault(n, draw(st.integers(0, 6))) for n in q.shape]
        if draw(st.integers(0, 5)) == 0:
            shape = draw(st.lists(st.integers(0, 4), max_size=4))
        array = np.random.default_rng(draw(st.integers(0, 99))).uniform(low, high, shape)
        way = draw(
            st.sampled_from(
                ["as it is", "as it is", "single", "list", "hole", "mask", "huge", "whole", "texts", "order"]
            )
        )
        if array.size and way in ("hole", "huge"):
            array.flat[draw(st.integers(0, array.size - 1))] = draw(
                st.sampled_from([math.nan, math.inf, -math.inf, 1e300])
            )
        ways: dict[str, Callable[[], Any]] = {
            "single": lambda: array.astype(np.float32), "list": array.tolist, "whole": lambda: array.astype(int),
            "mask": lambda: np.ma.masked_greater(array, 0.5 * (low + high)), "texts": lambda: array.astype(str),
            "order": lambda: np.asfortranarray(array)[..., ::-1] if array.ndim else array,
        }  # fmt: skip
        return Given(f"array {tuple(shape)} {way}", ways.get(way, lambda: array), "any")

    return build()


@st.composite
def _tuples(draw: Any, inner: tuple[Any, ...], quantity: Quantity | None) -> Given:
    hints = [Annotated[part, quantity] if quantity is not None else part for part in inner if part is not Ellipsis]
    if inner and inner[-1] is Ellipsis:
        hints = hints * draw(st.integers(0, 4))
    if draw(st.integers(0, 9)) == 0:
        hints = hints[1:] if draw(st.booleans()) else [*hints, float]
    parts = [draw(values_of(hint) if draw(st.integers(0, 7)) == 0 else _of_kind(hint)) for hint in hints]
    kind = draw(st.sampled_from([tuple, tuple, list, np.array]))
    if kind is np.array:
        if not all(type(part.make()) in (float, int) for part in parts):
            kind = tuple
    label = _label_of_tuple(inner, tuple(part.make() for part in parts), quantity)
    return Given(f"{kind.__name__}({list(parts)!r})", lambda: kind([part.make() for part in parts]), label)


def _of_kind(hint: Any, quantity: Quantity | None = None) -> st.SearchStrategy[Given]:
    """Values of the declared kind itself."""
    origin, inner = typing.get_origin(hint), typing.get_args(hint)
    if origin is Annotated:
        own = next((extra for extra in inner[1:] if isinstance(extra, Quantity)), quantity)
        return _of_kind(inner[0], own)
    if hint in EXAMPLES:
        return st.sampled_from(EXAMPLES[hint])
    if origin in (typing.Union, types.UnionType):
        if quantity is not None and quantity.shape is not None:
            none = [st.just(plain(None, "valid"))] if type(None) in inner else []
            return st.one_of(_arrays(quantity), *none)
        return st.one_of([_of_kind(part, quantity) for part in inner])
    if quantity is not None and quantity.shape is not None:
        return _arrays(quantity)
    if hint is float:
        return numbers(quantity)
    if hint is int:
        return _whole_numbers(quantity)
    if hint is bool:
        return st.booleans().map(lambda value: plain(value, "valid"))
    if hint is type(None):
        return st.just(plain(None, "valid"))
    if hint is str:
        return st.one_of(st.text(max_size=30), st.sampled_from(["LETE sand", "fast", "auto", "none", "x"])).map(plain)
    if origin is typing.Literal:
        return st.sampled_from(inner).map(lambda value: plain(value, "valid"))
    if isinstance(hint, type) and issubclass(hint, PathLike):
        return st.one_of(st.text(max_size=30), st.sampled_from(["x.nc", "none/x.nc", ".", "/dev/full", "x" * 300])).map(
            plain
        )
    if hint is tuple or origin is tuple:
        return _tuples(inner, quantity)
    if origin in (list, Sequence):
        part = inner[0] if quantity is None else Annotated[inner[0], quantity]
        return st.lists(values_of(part), max_size=3).map(
            lambda parts: Given(repr(parts), lambda: [part.make() for part in parts])
        )
    owner = origin if isinstance(origin, type) else hint
    if owner in EXAMPLES:
        return st.sampled_from(EXAMPLES[owner])
    if isinstance(owner, type) and is_dataclass(owner) and _needs_nothing(owner):
        return st.just(Given(f"{owner.__name__}()", owner, "any"))
    return st.sampled_from(_labelled(hint))


def _needs_nothing(owner: type) -> bool:
    return all(f.default is not MISSING or f.default_factory is not MISSING for f in fields(owner) if f.init)


# -- what was accepted -------------------------------------------------------------------------------------------------


def verify_declared(thing: Any, owner: str = "") -> None:
    """Raise `Silent` if a field of an object, at whatever depth, breaks its declaration."""
    hints = typing.get_type_hints(type(thing), include_extras=True)
    for field in fields(thing):
        value, name = getattr(thing, field.name), f"{owner or type(thing).__name__}.{field.name}"
        hint = hints[field.name]
        if label_of(hint, value) == "refused":
            raise Silent(f"{name} = {value!r:.100} breaks its declaration")
        if isinstance(thing, Declared):
            _verify_kind(name, hint, value)
        if isinstance(value, Declared):
            verify_declared(value, name)


def _verify_kind(name: str, hint: Any, value: Any) -> None:
    """Raise `Silent` unless numbers are of the declared kind itself, and arrays finite doubles."""
    origin, inner = typing.get_origin(hint), typing.get_args(hint)
    if origin is Annotated:
        quantity = next((extra for extra in inner[1:] if isinstance(extra, Quantity)), None)
        if quantity is not None and quantity.shape is not None:
            if value is not None and not (isinstance(value, np.ndarray) and value.dtype == float):
                raise Silent(f"{name} is kept as {type(value).__name__}, not as an array of doubles")
            if value is not None:
                low, high = (float(f(value)) for f in (np.min, np.max)) if value.size else (0.0, 0.0)
                if value.size and "refused" in (judge_number(quantity, low), judge_number(quantity, high)):
                    raise Silent(f"{name} holds {low} to {high}")
            return
        hint, origin, inner = inner[0], typing.get_origin(inner[0]), typing.get_args(inner[0])
    kinds = inner if origin in (typing.Union, types.UnionType) else (hint,)
    if float in kinds and isinstance(value, Real) and int not in kinds and type(value) not in (float, Unusual):
        raise Silent(f"{name} = {value!r} is kept as {type(value).__name__}")
    if (
        int in kinds
        and float not in kinds
        and isinstance(value, Integral)
        and type(value) is not int
        and bool not in kinds
    ):
        raise Silent(f"{name} = {value!r} is kept as {type(value).__name__}")
    if any(kind is tuple or typing.get_origin(kind) is tuple for kind in kinds) and isinstance(
        value, list | np.ndarray
    ):
        raise Silent(f"{name} is kept as a {type(value).__name__}")
