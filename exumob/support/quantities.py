"""Physical quantities: the unit of a value, the bounds that it cannot pass, and the range in which it is plausible.

A `Quantity` stands once, in the type of the field or argument that it describes::

    density: Annotated[float, Quantity("kg/m^3", above=0.0, plausible=(700.0, 1500.0))] = 1000.0

Checks, tables of the documentation and the help of the command line read it from there (`exumob.support.declared`).
"""

from __future__ import annotations

import math
import reprlib
from numbers import Real
from typing import Any

OTHER_UNITS = {
    # unit: (what people give in its stead, its size in that unit)
    "m": (("mm", 1e-3), ("cm", 1e-2), ("inches", 0.0254), ("km", 1e3)),
    "rad": (("degrees", math.pi / 180.0),),
    "kg": (("t", 1e3), ("g", 1e-3)),
    "kg/m^3": (("g/cm^3", 1e3),),
    "m/s": (("km/h", 1.0 / 3.6), ("mm/s", 1e-3)),
    "rad/s": (("revolutions a minute", math.pi / 30.0), ("degrees a second", math.pi / 180.0)),
    "s": (("ms", 1e-3),),
    "Pa": (("kPa", 1e3), ("MPa", 1e6)),
    "Pa s": (("mPa s", 1e-3),),
    "N": (("kN", 1e3),),
    "N/m": (("N/mm", 1e3), ("kN/m", 1e3)),
    "N s/m": (("N s/mm", 1e3), ("kN s/m", 1e3)),
    "N/m^(n+1)": (("kN/m^(n+1)", 1e3),),
    "N/m^(n+2)": (("kN/m^(n+2)", 1e3),),
    "kg m^2": (("g m^2", 1e-3), ("t m^2", 1e3)),
    "1": (("per cent", 1e-2),),
}
"""Units that are taken for each other."""


class ImplausibleValue(ValueError):
    """A value is possible, but lies outside its plausible range; `unusual` lets it pass."""


class Unusual(float):
    """A number that may lie outside its plausible range, made by `unusual`."""

    def __repr__(self) -> str:
        return f"unusual({float(self)!r})"

    __str__ = float.__repr__

    def __mul__(self, other: Any) -> Any:
        return _marked(float.__mul__(self, other))

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Any:
        return _marked(float.__truediv__(self, other))

    def __neg__(self) -> Unusual:
        return Unusual(float.__neg__(self))


def _marked(value: Any) -> Any:
    return value if value is NotImplemented else Unusual(value)


def unusual(value: float) -> float:
    """Mark a number as meant, though it lies outside the plausible range of its field.

    The bounds of what is possible still hold. Products and quotients with plain numbers stay marked.

    Examples
    --------
    >>> from exumob import Water, unusual
    >>> mercury = Water(depth=0.1, density=unusual(13_534.0))

    Raises
    ------
    ValueError
        If it is no number.
    """
    try:
        number = float(value) if isinstance(value, Real) and not isinstance(value, bool) else math.nan
    except Exception:  # too large, or a foreign __float__, which may do anything
        number = math.nan
    if math.isnan(number):
        raise ValueError(f"unusual.value = {shown(value)} is not a number; give one, in SI units.")
    return Unusual(number)


class Quantity:
    """The unit of a value and what it may be; stands in the type of a field, ``Annotated[float, Quantity("m")]``.

    Parameters
    ----------
    unit : str
        SI unit, ``"1"`` for a plain number; radians for angles.
    above, at_least, at_most, below : float, optional
        Bounds that a value cannot pass: beyond them it has no meaning. Without any it must only be finite.
    plausible : (float, float), optional
        Smallest and largest value that people mean. Beyond, the error names the unit that was probably given in its
        stead; `unusual` lets the value pass. 0 always passes where the bounds allow it: it stands for "none".
    shape : tuple of int or str, optional
        Of an array: the length along each of its dimensions, a name where it is free.
    infinite : bool
        Whether infinite values have a meaning.
    gaps : bool
        Whether nan has a meaning in an array: there is nothing at this place.
    remedy : str, optional
        What to do about a value beyond the bounds; of an angle that is likely in degrees that is said first.
    negative : str, optional
        The same about a value below 0.
    """

    __slots__ = (
        "above",
        "at_least",
        "at_most",
        "below",
        "gaps",
        "infinite",
        "negative",
        "plausible",
        "remedy",
        "shape",
        "unit",
    )

    def __init__(  # one argument a property of the value; all but the unit have defaults
        self,
        unit: str,
        *,
        above: float = -math.inf,
        at_least: float = -math.inf,
        at_most: float = math.inf,
        below: float = math.inf,
        plausible: tuple[float, float] | None = None,
        shape: tuple[int | str, ...] | None = None,
        infinite: bool = False,
        gaps: bool = False,
        remedy: str = "",
        negative: str = "",
    ) -> None:
        """Keep them."""
        self.unit, self.shape, self.infinite, self.gaps = unit, shape, infinite, gaps
        self.remedy, self.negative = remedy, negative
        self.above, self.at_least, self.at_most, self.below = above, at_least, at_most, below
        self.plausible = plausible

    def __repr__(self) -> str:
        return f"[{', '.join(part for part in (self.unit, self.bounds) if part)}]"

    @property
    def symbol(self) -> str:
        """The unit as it follows a number; nothing for a plain number."""
        return "" if self.unit == "1" else self.unit

    @property
    def bounds(self) -> str:
        """What a value must be, in words: ``"> 0 and <= 3"``."""
        limits = (("> ", self.above), (">= ", self.at_least), ("<= ", self.at_most), ("< ", self.below))
        return " and ".join(f"{sign}{limit:.6g}" for sign, limit in limits if math.isfinite(limit))

    @property
    def safe(self) -> tuple[float, float]:
        """Interval inside which no more needs to be looked at; the check of most values ends here."""
        low = math.nextafter(max(self.above, math.nextafter(self.at_least, -math.inf)), math.inf)
        high = math.nextafter(min(self.below, math.nextafter(self.at_most, math.inf)), -math.inf)
        if self.plausible is not None:
            low, high = max(low, self.plausible[0]), min(high, self.plausible[1])
        return max(low, -1.7e308), min(high, 1.7e308)

    def within_bounds(self, value: float) -> bool:
        """Tell if a number is possible."""
        above = value > self.above or self.above == -math.inf
        below = value < self.below or self.below == math.inf
        return above and below and self.at_least <= value <= self.at_most

    def check(self, name: str, value: Any) -> float:
        """Return a value as a number, or refuse it.

        Parameters
        ----------
        name : str
            Owner and field, for the message.
        value : object

        Raises
        ------
        ValueError
            If it is no number, not finite or beyond a bound; the message names field, value, limit and remedy.
        ImplausibleValue
            If it is outside the plausible range and not marked by `unusual`.
        """
        number = math.nan
        if isinstance(value, Real) and not isinstance(value, bool):
            try:
                number = value if isinstance(value, Unusual) else float(value)
            except Exception:  # too large, or a foreign __float__, which may do anything
                number = math.nan
        if not math.isfinite(number) and not (self.infinite and math.isinf(number) and self.within_bounds(number)):
            wanted = f"a number{f' in {self.symbol}' if self.symbol else ''}{f', {self.bounds}' if self.bounds else ''}"
            raise ValueError(f"{name} = {shown(value)} is not a finite number; give {wanted}.")
        if not self.within_bounds(number):
            raise ValueError(f"{name} = {self._exact(number)} must be {self.bounds}; {self._remedy(number)}")
        if self.plausible is not None and not isinstance(number, Unusual) and number != 0.0:
            low, high = self.plausible
            if not low <= number <= high:
                likely = self.likely_unit(number)
                raise ImplausibleValue(
                    f"{name} = {self._exact(number)} is outside the plausible range, {low:.6g} to {self.text(high)}"
                    f"{'; ' + likely if likely else '.'} If it is meant: unusual({number!r}) in Python, --unusual at "
                    "the command line."
                )
        return number

    def likely_unit(self, number: float) -> str:
        """Ask for the units, three at most, in which a number out of range would be within it, or return nothing."""
        low, high = self.plausible or (max(self.above, self.at_least), min(self.below, self.at_most))
        found = []
        for unit, size in OTHER_UNITS.get(self.unit, ()):
            converted = number * size
            if low <= converted <= high and self.within_bounds(converted):
                right = f"math.radians({number:g})" if unit == "degrees" else self.text(converted)
                found.append(f"{unit}? Then give {right}")
        return f"is it in {'; or in '.join(found[:3])}." if found else ""

    def _remedy(self, number: float) -> str:
        """What to do about a number beyond the bounds."""
        likely = self.likely_unit(number)
        own = self.negative if number < 0.0 and self.negative else self.remedy
        if likely and own and self.unit == "rad":  # degrees are nearly certain there; a slope of 3 is hardly 3 per cent
            return f"{likely} {own[0].upper()}{own[1:]}"
        return own or likely or f"give a value within, in {self.symbol or 'no unit'}."

    def _exact(self, number: float) -> str:
        return f"{float(number)!r} {self.symbol}".rstrip()

    def text(self, number: float) -> str:
        """A number with its unit."""
        return f"{number:.6g} {self.symbol}".rstrip()


DEPTH = Quantity("m", above=0.0, at_most=1e4, plausible=(1e-3, 20.0))
"""Depth of water"""
DEPTH_RATIO = Quantity("1", above=0.0, at_most=1e4, plausible=(0.01, 20.0))
"""Depth of water over the tyre's diameter"""
CURRENT_SPEED = Quantity(
    "m/s", at_least=0.0, at_most=100.0, plausible=(0.0, 15.0), negative="turn the flow with its direction."
)  # fmt: skip
"""Speed of a current over ground"""
DIRECTION = Quantity("rad", plausible=(-2.0 * math.pi, 2.0 * math.pi))
"""Direction, counter-clockwise from world x"""
SHORTEST = 1e-9
"""Shortest time that means anything [s]"""
DURATION = Quantity("s", at_least=SHORTEST, at_most=1e6)
"""Simulated time"""
STEP = Quantity("s", at_least=SHORTEST, at_most=1e6)
"""Step of time"""
INITIAL_SPEED = Quantity("m/s", at_least=-100.0, at_most=100.0, plausible=(-30.0, 30.0))
"""Speed of the vehicle at time 0, along its heading"""
CELL_SIZE = Quantity("m", above=0.0, at_most=1e4, plausible=(1e-6, 1.0))
"""Width of the flow solver's cells"""
STEERING_ANGLE = Quantity("rad", at_least=-math.radians(80.0), at_most=math.radians(80.0))
"""Angle of the front wheels, positive to the left"""
WHEEL_SPEED = Quantity("rad/s", at_least=-1e4, at_most=1e4, plausible=(-500.0, 500.0))
"""Spin of the wheels, positive forward"""


def shown(value: object, length: int = 60) -> str:
    """Return a value as text for a message: short, on one line, whatever it is."""
    writer = reprlib.Repr()
    writer.maxstring = writer.maxother = length
    try:
        text = writer.repr(value)
    except Exception:  # a foreign __repr__ may do anything
        text = f"({type(value).__name__})"
    text = " ".join(text.split())
    return text if len(text) <= 2 * length else text[:length] + "..."
