"""Values that nobody should give, and somebody will.

Each is made anew for each use (`Given.make`) and shown by a text of its own: some have a broken ``__repr__``.
"""

from __future__ import annotations

import datetime
import decimal
import enum
import math
import pathlib
import sys
from collections.abc import Callable
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np
import xarray as xr


class Given(NamedTuple):
    """A value that is to be given, and what is known of it."""

    text: str
    make: Callable[[], Any]
    label: str = "any"
    """``"valid"``: right by itself; ``"refused"``: impossible; ``"unusual"``: beyond what is plausible, and marked;
    ``"any"``: not known, whatever is accepted is looked at"""

    def __repr__(self) -> str:
        return self.text


class BrokenRepr:
    def __repr__(self):
        raise RuntimeError("no repr")


class BrokenFloat:
    def __float__(self):
        raise RuntimeError("no float")

    __int__ = __index__ = __float__


class BrokenLength:
    def __len__(self):
        raise RuntimeError("no length")

    def __iter__(self):
        raise RuntimeError("no parts")


class BrokenArray:
    def __array__(self, dtype=None, copy=None):
        raise RuntimeError("no array")


class BrokenComparison:
    def __eq__(self, other):
        raise RuntimeError("not equal, nor unequal")

    __lt__ = __le__ = __gt__ = __ge__ = __ne__ = __eq__
    __hash__ = None


class BrokenTruth:
    def __bool__(self):
        raise RuntimeError("neither true nor false")


class BrokenAttributes:
    def __getattr__(self, name):
        raise RuntimeError(f"no {name}")


class BrokenPath:
    def __fspath__(self):
        raise RuntimeError("no path")


class NumberOfSorts(float):
    def __float__(self):
        raise RuntimeError("no float")

    def __repr__(self):
        raise RuntimeError("no repr")


class Text(str):
    pass


class Level(enum.IntEnum):
    low = 1


class WithUnit:
    """As the quantities of unit packages are."""

    magnitude = 3.0
    units = "mm"

    def __float__(self):
        return 3.0


def _loop():
    found = [1.0]
    found.append(found)
    return found


def _deep(depth=5000):
    found = []
    for _ in range(depth):
        found = [found]
    return found


def _ends():
    yield 1.0


NUMBERS = [
    "0", "1", "-1", "2", "3", "1.5", "0.0", "-0.0", "1e308", "-1e308", "5e-324", "1e-300", "1e9", "1e18", "2**63",
    "2**64",
    "-2**63", "10**400", "-10**400", "10**5000", "math.nan", "math.inf", "-math.inf", "sys.float_info.max",
    "np.float16(1.5)", "np.float32(0.1)", "np.float32(3e38)", "np.float64(1.5)", "np.float64('nan')",
    "np.longdouble('1e4000')", "np.longdouble(1)", "np.int8(3)", "np.uint8(3)", "np.int16(3)", "np.uint16(3)",
    "np.int32(3)", "np.uint32(3)", "np.int64(3)", "np.uint64(2**64 - 1)", "np.float16('inf')", "Fraction(1, 3)",
    "Fraction(10**400, 3)", "Fraction(1, 10**400)", "Level.low", "NumberOfSorts(1.0)",
]  # fmt: skip
"""Numbers, some of them beyond double precision"""
OTHERS = [
    "True", "False", "np.True_", "np.False_", "None", "...", "NotImplemented",
    "''", "' '", "'3'", "'1e3'", "'nan'", "'[/red]'", "'[bold]x'", "':smile:'", "'äöü☃𝄞'", "'\\x00'", "'a\\nb'",
    "'\\x1b[31m'",
    "'x' * 10**5", "'../../x'", "'-1'", "'{0}'", "'%s'", "'\\ud800'", "'water.depth'", "Text('ab')", "np.str_('box')",
    "b''", "b'3'", "bytearray(b'3')", "memoryview(b'3')", "1j", "complex('nan')", "np.complex64(1)",
    "np.complex128(1j)",
    "[]", "[1.0]", "[None]", "['a']", "[1.0, 'a']", "[[1.0], [1.0, 2.0]]", "[[]]", "(1.0,)", "(1.0, 2.0)",
    "(1.0, 2.0, 3.0)",
    "(math.nan, 1.0)", "(10**400, 1)", "{}", "{'a': 1}", "{1: 2}", "{'mass': math.nan}", "set()", "{1.0, 2.0}",
    "frozenset({1})",
    "range(3)", "_ends()", "iter([1.0])", "map(float, 'ab')", "_loop()", "_deep()",
    "np.array(1.0)", "np.array(math.nan)", "np.array([1.0])", "np.array([1.0, 2.0])", "np.array([1.0, 2.0, 3.0])",
    "np.zeros(0)", "np.zeros((0, 3))", "np.zeros((2, 3))", "np.ones((4, 4))", "np.array([True, False])",
    "np.array(['a', 'b'])",
    "np.array([1.0, None], dtype=object)", "np.array([10**400, 1], dtype=object)", "np.array([1j])",
    "np.array(['2020-01-01'], 'M8[D]')", "np.zeros(2, 'i4,f8')", "np.full((3, 3), math.nan)",
    "np.ma.masked", "np.ma.array([1.0, 2.0], mask=[0, 1])", "np.ma.array([1.0, 2.0])", "np.ma.array(1.0, mask=True)",
    "np.ma.masked_equal(np.ones((3, 3)), 1.0)", "np.datetime64('2020-01-01')", "np.timedelta64(3, 's')",
    "np.void(b'abc')",
    "xr.DataArray(1.0)", "xr.DataArray([1.0, 2.0])", "xr.Dataset()", "xr.Dataset({'a': 1.0})",
    "decimal.Decimal('1.5')", "decimal.Decimal('nan')", "decimal.Decimal('sNaN')", "decimal.Decimal('1e999999')",
    "datetime.datetime(2020, 1, 1)", "datetime.date(2020, 1, 1)", "datetime.timedelta(1)",
    "pathlib.Path('x')", "pathlib.Path()", "pathlib.Path('/')", "pathlib.Path('/dev/null')",
    "object()", "object", "float", "int", "type", "math", "len", "(lambda: 1.0)", "(lambda *a, **k: None)",
    "ValueError('x')",
    "BrokenRepr()", "BrokenFloat()", "BrokenLength()", "BrokenArray()", "BrokenComparison()", "BrokenTruth()",
    "BrokenAttributes()",
    "BrokenPath()", "BrokenRepr", "WithUnit()", "[BrokenRepr()]", "[BrokenFloat()]", "(BrokenComparison(), 1.0)",
    "{'a': BrokenRepr()}",
]  # fmt: skip
"""All that is no number"""


def given(source: str, label: str = "any") -> Given:
    """Return the value that an expression stands for, made anew each time."""
    code = compile(source, "<value>", "eval")
    return Given(source, lambda: eval(code, globals()), label)


def shown(value: Any) -> str:
    """Return a source text of a plain value."""
    if isinstance(value, float) and not math.isfinite(value):
        return f"float('{value}')"
    return repr(value)


def plain(value: Any, label: str = "any") -> Given:
    """A value that can be shared."""
    return Given(shown(value), lambda: value, label)


ODD = [given(source) for source in NUMBERS + OTHERS]
__all__ = [
    "NUMBERS",
    "ODD",
    "OTHERS",
    "Fraction",
    "Given",
    "datetime",
    "decimal",
    "given",
    "np",
    "pathlib",
    "sys",
    "xr",
]
