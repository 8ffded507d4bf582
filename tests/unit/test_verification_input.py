"""Cases of the flow solver with cells, times and waves that mean nothing: refused by name before anything runs."""

import importlib
import inspect
import math
import pkgutil

import pytest

import exumob.verification
from exumob.verification.cases import CASES
from exumob.verification.check import Case
from exumob.verification.coupled_spring import SpringWater
from exumob.verification.free_body import FreeBody
from exumob.verification.waves import SteadyWave, solitary_wave

NUMBERS = ("cell_size", "cell", "cells", "cells_per_depth", "duration", "interval", "dt", "macro_step", "threads")


def functions():
    for module in pkgutil.iter_modules(exumob.verification.__path__):
        if module.name == "measures":
            continue  # arithmetic on results
        found = importlib.import_module(f"exumob.verification.{module.name}")
        for name, function in vars(found).items():
            if inspect.isfunction(function) and function.__module__ == found.__name__ and not name.startswith("_"):
                yield pytest.param(function, id=f"{module.name}.{name}")


@pytest.mark.parametrize("function", list(functions()))
def test_numbers_of_all_cases_are_declared(function):
    """Whatever a case takes of these is checked before it runs."""
    parameters = inspect.signature(function).parameters
    for name in set(NUMBERS) & set(parameters):
        assert hasattr(function, "__wrapped__"), f"{name} of {function.__qualname__} is not checked"
        if [p.name for p in parameters.values() if p.default is p.empty and p.name != name]:
            continue
        for value in (-1, 0, math.nan, math.inf, "x", 10**400, True):
            with pytest.raises(ValueError, match=rf"\.{name} = "):
                function(**{name: value})


@pytest.mark.parametrize("case", [case for case in CASES if case.options], ids=lambda case: case.name)
def test_options_of_all_cases_are_refused_by_name(case):
    for name in set(NUMBERS) & set(case.options):
        with pytest.raises(ValueError, match=rf"{name} = -1"):
            case.run(**{name: -1})


@pytest.mark.parametrize("make, word", [
    (lambda: FreeBody(-1.0, (1, 1, 1), (0, 0, 0)), r"FreeBody\.mass = -1"),
    (lambda: FreeBody(1.0, (1, 0, 1), (0, 0, 0)), r"FreeBody\.inertia\[1\] = 0"),
    (lambda: FreeBody(1.0, (1, 1, 1), (0, 0)), r"FreeBody\.position"),
    (lambda: FreeBody(1.0, (1, 1, 1), (0, math.nan, 0)), r"FreeBody\.position"),
    (lambda: SpringWater(0.0, 1.0, 1.0, 0.0), r"SpringWater\.mass = 0"),
    (lambda: SpringWater(1.0, 1.0, -1.0, 0.0), r"SpringWater\.added_mass = -1"),
    (lambda: SteadyWave.solve(0.0, 1.0, 1.0, 8), r"SteadyWave\.solve\.height = 0"),
    (lambda: SteadyWave.solve(0.1, 1.0, 1.0, 0), r"SteadyWave\.solve\.harmonics = 0"),
    (lambda: solitary_wave(0.1, -1.0), r"solitary_wave\.depth = -1"),
    (lambda: Case("a", "b", lambda: [], 0.0), r"Case\.minutes = 0"),
    (lambda: Case("a", "b", 3, 1.0), r"Case\.run = 3"),
])  # fmt: skip
def test_classes_refuse_by_name(make, word):
    with pytest.raises(ValueError, match=word):
        make()
