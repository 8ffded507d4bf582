"""Declarations of fields and arguments: what is accepted, converted, refused, and in what words."""

import json
import math
import pickle
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import Annotated, Any, Literal, Protocol

import numpy as np
import pytest
from numpy.typing import ArrayLike

from exumob import ImplausibleValue, Soil, Terrain, Water, Wheel, unusual
from exumob.support.declared import Declared, MissingField, UnknownField, checked, declared_fields
from exumob.support.quantities import Quantity
from vehicle_models.amphibious import amphibious_vehicle


class Engine(Protocol):
    """Anything with a torque and a name."""

    name: str

    def torque(self, speed: float) -> float:
        """Return the torque [N m]."""


class Motor:
    name = "a motor"

    def torque(self, speed):
        return 1.0


@dataclass(frozen=True)
class Part(Declared):
    size: Annotated[float, Quantity("m", above=0.0, at_most=1e3, plausible=(0.01, 10.0))] = 1.0
    """Longest side"""
    angle: Annotated[float, Quantity("rad", at_least=-1.0, below=1.0)] = 0.0
    count: Annotated[int, Quantity("1", at_least=1, at_most=9)] = 1
    closed: bool = False
    kind: Literal["box", "ball"] = "box"
    place: Annotated[tuple[float, float], Quantity("m")] = (0.0, 0.0)
    points: Annotated[tuple[tuple[float, float], ...], Quantity("m")] = ()
    file: Path | None = None
    heights: Annotated[ArrayLike | None, Quantity("m", at_least=-10.0, shape=("n", 2))] = None
    spacing: Annotated[float | tuple[float, float], Quantity("m", above=0.0)] = 1.0
    engine: Engine | None = None
    inner: "Part | None" = None
    high: Annotated[float, Quantity("1", infinite=True)] = math.inf

    def _check(self) -> None:
        if self.angle > self.size:
            raise ValueError(f"Part.angle = {self.angle} must be at most size; give a smaller one.")


@pytest.mark.parametrize(
    ("field", "given", "kept"),
    [
        ("size", 2, 2.0),
        ("size", np.float32(0.5), 0.5),
        ("size", np.int64(3), 3.0),
        ("size", Fraction(1, 2), 0.5),
        ("count", np.int32(4), 4),
        ("closed", np.True_, True),
        ("place", [1, 2], (1.0, 2.0)),
        ("place", np.array([1, 2]), (1.0, 2.0)),
        ("points", [[0, 1], (2, 3)], ((0.0, 1.0), (2.0, 3.0))),
        ("file", "a.stl", Path("a.stl")),
        ("spacing", [1, 2], (1.0, 2.0)),
        ("spacing", 2, 2.0),
        ("kind", np.str_("ball"), "ball"),
        ("high", math.inf, math.inf),
        ("heights", None, None),
    ],
)
def test_values_become_the_declared_kind(field, given, kept):
    found = getattr(Part(**{field: given}), field)
    assert (found == kept and type(found) is type(kept)) or isinstance(found, str)


def test_what_is_right_already_is_kept_as_it_is():
    points = ((0.0, 1.0), (2.0, 3.0))
    assert Part(points=points).points is points


BIG = 10**400
WRONG = [
    *[
        ("size", value, "finite number")
        for value in (math.nan, math.inf, BIG, -BIG, 10**5000, "1", None, True, [1.0], {}, 1j, Part)
    ],
    ("size", 0.0, "must be > 0"),
    ("size", -1.0, "must be > 0"),
    ("size", 2e3, "must be > 0 and <= 1000"),
    ("angle", 1.0, ">= -1 and < 1"),
    ("angle", 45.0, r"degrees\? Then give math.radians\(45\)"),
    ("count", 1.5, "whole number"),
    ("count", 1.0, "whole number"),
    ("count", True, "whole number"),
    ("count", 0, ">= 1"),
    ("count", BIG, "too large"),
    ("count", "2", "whole number"),
    ("count", math.nan, "whole number"),
    ("closed", 1, "True or False"),
    ("closed", "yes", "True or False"),
    ("closed", None, "True or False"),
    ("kind", "boxx", "use 'box' or 'ball'"),
    ("kind", 3, "use 'box' or 'ball'"),
    ("kind", ["box"], "use 'box' or 'ball'"),
    ("place", (1.0, 2.0, 3.0), "has 3 values; it must have 2"),
    ("place", 1.0, "tuple of 2"),
    ("place", "ab", "tuple of 2"),
    ("place", (1.0, "b"), r"place\[1\] = 'b'"),
    ("place", np.ma.masked_equal([1.0, 9.0], 9.0), "masked"),
    ("points", ((1.0, 2.0), (1.0,)), r"points\[1\] = \(1.0,\) has 1 values"),
    ("points", 3, "tuple of any number"),
    ("file", 3, "path of a file"),
    ("file", "", "path of a file"),
    ("file", "a\0b", "path of a file"),
    ("file", b"a", "path"),
    ("heights", np.zeros(3), "shape"),
    ("heights", np.full((2, 2), math.nan), "not finite"),
    ("heights", "ab", "array"),
    ("heights", np.full((2, 2), -9999.0), "must be >= -10"),
    ("heights", np.ma.masked_equal(np.ones((2, 2)), 1.0), "mask"),
    ("spacing", (1.0, 0.0), r"spacing\[1\] = 0.0"),
    ("spacing", "a", "a number or a tuple"),
    ("engine", 3, "has no name and no torque"),
    ("engine", Motor, "is a class; give an object"),
    ("inner", {}, "must be a Part"),
    ("inner", 3, "must be a Part"),
    ("high", math.nan, "finite number"),
]


@pytest.mark.parametrize(("field", "value", "message"), WRONG, ids=range(len(WRONG)))
def test_what_is_wrong_is_refused_by_name(field, value, message):
    with pytest.raises(ValueError, match=message) as raised:
        Part(**{field: value})
    text = str(raised.value)
    assert text.startswith(f"Part.{field}") and len(text) < 400
    assert re.search("must|give|use|fill", text), "no remedy"


def test_relations_come_after_the_fields():
    with pytest.raises(ValueError, match="must be at most size"):
        Part(size=0.02, angle=0.5)
    assert Part(engine=Motor(), inner=Part()).inner == Part()


@pytest.mark.parametrize(
    ("make", "unit"),
    [
        (lambda: Water(0.1, density=1.0), r"g/cm\^3\? Then give 1000 kg/m\^3"),
        (lambda: Water(120.0), "mm"),
        (lambda: Water(0.1, 0.5, 180.0), r"degrees\? Then give math.radians\(180\)"),
        (lambda: Water(0.1, current_direction=-90.0), "degrees"),
        (lambda: Water(0.1, 18.0), "km/h"),
        (lambda: replace(Soil.published("LETE sand"), k_phi=5301.0), "kN"),
        (lambda: replace(Soil.published("LETE sand"), cohesion=1.3), "kPa"),
        (lambda: replace(Soil.published("LETE sand"), shear_modulus_x=12.0), "mm"),
        (lambda: replace(Soil.published("LETE sand"), friction_angle=31.1), "degrees"),
        (lambda: replace(amphibious_vehicle().hull, length=1000.0), "mm"),
        (lambda: replace(amphibious_vehicle().wheel, diameter=200.0), "mm"),
        (lambda: replace(amphibious_vehicle(), track=660.0), "mm"),
    ],
)
def test_the_likely_unit_is_named(make, unit):
    with pytest.raises(ValueError, match=unit):
        make()


def test_possible_values_pass_where_they_are_meant():
    mercury = Water(0.1, density=unusual(13_534.0))
    assert mercury.density == 13_534.0 and replace(mercury, depth=0.2).density == 13_534.0
    assert pickle.loads(pickle.dumps(mercury)) == mercury
    assert json.loads(json.dumps(mercury.density)) == 13_534.0
    assert Water.at_ratio(unusual(400.0)).depth == pytest.approx(80.0)  # the mark survives a product
    with pytest.raises(ImplausibleValue, match=r"unusual\(13534.0\)"):
        Water(0.1, density=13_534.0)
    with pytest.raises(ValueError, match="must be > 0"):  # what is impossible stays so
        Water(0.1, density=unusual(-1.0))


def test_a_small_model_passes_where_it_is_meant():
    """A model of 1:18: its spring of 3 N/m is an unusual one."""
    soft = replace(amphibious_vehicle().suspension, stiffness=unusual(3.0))
    assert soft.stiffness == 3.0


@checked
def tow(
    part: Part,
    force: Annotated[float, Quantity("N", at_least=0.0)],
    *names: str,
    report: Callable[[float], None] | None = None,
    parts: Sequence[Part] = (),
    extra: Any = None,
) -> float:
    return force


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: tow(3, 1.0), r"tow.part = 3 must be a Part"),
        (lambda: tow(Part(), -1.0), "tow.force = -1.0 N must be >= 0"),
        (lambda: tow(Part(), 1.0, "a", 3), "tow.names = 3 must be a text"),
        (lambda: tow(Part(), 1.0, report=3), "tow.report = 3 must be a function"),
        (lambda: tow(Part(), 1.0, parts=[Part(), 3]), r"tow.parts\[1\] = 3 must be a Part"),
        (lambda: tow(Part(), 1.0, parts=3), "tow.parts = 3 must be a list"),
    ],
)
def test_arguments_of_functions_are_checked(call, message):
    with pytest.raises(ValueError, match=message):
        call()


def test_a_checked_function_gets_converted_values():
    assert tow(Part(), 2, "a", report=print, parts=(Part(),)) == 2.0
    assert tow.__name__ == "tow"
    with pytest.raises(TypeError, match="missing"):
        tow(Part())


def test_fields_can_be_listed_with_unit_bounds_default_and_meaning():
    size, *_, high = declared_fields(Part)
    assert (size.name, size.kind, size.quantity.unit, size.default, size.meaning) == (
        "size",
        float,
        "m",
        1.0,
        "Longest side",
    )
    assert size.quantity.bounds == "> 0 and <= 1000" and size.quantity.plausible == (0.01, 10.0)
    assert high.quantity.infinite
    depth = declared_fields(Water)[0]
    assert depth.quantity.unit == "m" and depth.meaning.startswith("Still-water depth")


@pytest.mark.parametrize(("make", "message"), [
    (lambda: Soil(phi=0.5, k_c=1.0), r"Soil has no field 'phi' \(did you mean friction_angle or k_phi\?\)"),
    (lambda: replace(Soil.published("LETE sand"), cohesoin=1e3), "'cohesoin' .did you mean cohesion"),
    (lambda: Soil(c=1.0, mu=2.0), r"'c' \(did you mean cohesion or .*\?\), no field 'mu'; its fields are k_c, k_phi"),
    (lambda: Water(dept=0.1), "Water has no field 'dept' .did you mean depth"),
    (lambda: Water(speed=0.1), "did you mean current_speed"),
    (lambda: replace(amphibious_vehicle().hull, weight=3.0), "Hull has no field 'weight' .did you mean height"),
    (lambda: Part(sizes=1.0), "Part has no field 'sizes' .did you mean size"),
])  # fmt: skip
def test_a_field_that_is_not_there_is_answered_by_the_nearest(make, message):
    for kind in (ValueError, TypeError):  # for the command line, and for whoever expects what Python raises
        with pytest.raises(kind, match=message):
            make()


@pytest.mark.parametrize("make", [lambda: Terrain.slope(), lambda: Water(*range(7)), lambda: Water(0.1, depth=0.1)])
def test_other_mistakes_of_a_call_stay_what_python_says(make):
    with pytest.raises(TypeError, match="argument"):
        make()


def test_a_field_that_is_needed_is_asked_for_by_name_and_unit():
    """Of whatever class, given by place or by name; an unknown field beside it is answered first."""
    with pytest.raises(MissingField, match=r"^Wheel lacks mass \[kg\], diameter \[m\], width \[m\]; give them\.$"):
        Wheel()
    with pytest.raises(MissingField, match=r"^Soil lacks n \[-\]"):
        Soil("clay", k_phi=1e5)
    with pytest.raises(UnknownField, match="no field 'radious'"):
        Wheel(radious=0.3)
    with pytest.raises(TypeError, match="takes"):  # too many are no missing ones
        Wheel(*range(40))
    with pytest.raises(TypeError, match="multiple values for argument 'mass'"):
        Wheel(0.3, mass=3.0)

    class Clay(Soil):
        def __init__(self, hardness):
            len(hardness)

    with pytest.raises(TypeError, match="missing 1 required positional argument: 'hardness'"):
        Clay()
    for error in (lambda: Clay(3), lambda: Clay(hardness=3)):
        with pytest.raises(TypeError, match="has no len"):
            error()
