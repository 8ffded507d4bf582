"""Any input is right, or refused: a few inputs of each kind always, thousands with ``pytest -m slow tests/fuzz``."""

import math
from typing import Annotated

import pytest
from hypothesis import HealthCheck, Phase, given, settings

from exumob import unusual
from exumob.support.declared import Declared
from exumob.support.quantities import Quantity

from . import commands, files, runs, targets
from .outcome import Reached, Silent, outcome_of
from .strategies import judge_number, label_of

FEW, MANY = 8, 400
"""Inputs of each target: always, and by the marker slow"""
AWAITED: set[str] = set()
"""What is known to answer some inputs badly; nothing may be added, and what is mended is to be taken out"""
EITHER = [pytest.param(FEW, id="few"), pytest.param(MANY, id="many", marks=pytest.mark.slow)]
CLASSES = targets.user_classes()


def some(things):
    """Those that are tried; those known to be faulty are named and left out."""
    known = pytest.mark.xfail(run=False, reason="known to answer some inputs badly", strict=False)
    names = [thing.__name__ if isinstance(thing, type) else thing.name for thing in things]
    return [
        pytest.param(thing, id=name, marks=known if name in AWAITED else ())
        for thing, name in zip(things, names, strict=True)
    ]


def try_inputs(target: targets.Target, number: int) -> None:
    """Fail with the simplest input that is not answered by a result or a clear word."""

    @settings(
        max_examples=number,
        derandomize=True,
        database=None,
        deadline=None,
        suppress_health_check=list(HealthCheck),
        phases=[Phase.generate, Phase.shrink],
    )
    @given(target.inputs)
    def attempt(values):
        outcome = target.answer(values)
        assert outcome.fine, f"{target.name} with {values!r:.500}: {outcome.kind}: {outcome.detail}"

    attempt()


@pytest.mark.parametrize("number", EITHER)
@pytest.mark.parametrize("owner", some(CLASSES))
def test_dataclasses(owner, number):
    try_inputs(targets.class_target(owner), number * (2 if issubclass(owner, Declared) else 1))


@pytest.mark.parametrize("number", EITHER)
@pytest.mark.parametrize("target", some(targets.function_targets()))
def test_functions(target, number):
    try_inputs(target, number)


@pytest.mark.parametrize("number", EITHER)
@pytest.mark.parametrize("target", some(commands.command_targets()))
def test_commands(target, number):
    try_inputs(target, number)


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")  # h5netcdf closes what it could not open
@pytest.mark.parametrize("number", EITHER)
@pytest.mark.parametrize("target", some(files.file_targets()))
def test_files(target, number):
    try_inputs(target, number)


@pytest.mark.parametrize("number", [*range(6), *(pytest.param(n, marks=pytest.mark.slow) for n in range(6, 300))])
def test_runs(number):
    outcome = runs.answer(number)
    assert outcome.fine, f"scene {number}: {runs.scene(number)}: {outcome.kind}: {outcome.detail}"


# -- the classification itself -----------------------------------------------------------------------------------------


def raises(error):
    def call():
        raise error

    return call


def refuse(text):
    from exumob.support.checks import require_finite

    return lambda: require_finite(text, mass="x")


def raises_silent(found):
    raise Silent(f"{found} is wrong")


def endless():
    while True:
        pass


@pytest.mark.parametrize(
    ("call", "options", "kind"),
    [
        (lambda: 3, {}, "accepted"),
        (lambda: 3, {"refused": True}, "silent"),
        (raises(Reached()), {}, "accepted"),
        (raises(Reached()), {"refused": True}, "silent"),
        (refuse("Hull"), {}, "clear"),
        (refuse("Hull"), {"refused": True}, "clear"),
        (refuse("Hull"), {"names": ["width"]}, "unclear"),
        (raises(ValueError("mass must be > 0")), {}, "unclear"),  # not from the package
        (raises(KeyError("mass")), {}, "unclear"),
        (raises(SystemExit(2)), {}, "unclear"),
        (lambda: [0] * 10**12, {}, "unclear"),  # out of memory
        (lambda: 3, {"verify": raises_silent}, "silent"),
        (endless, {"time_limit": 0.2}, "hang"),
    ],
)  # fmt: skip
def test_answers_are_told_apart(call, options, kind):
    options = {"names": ["mass"]} | options
    assert outcome_of(call, options.pop("names"), **options).kind == kind


@pytest.mark.parametrize(
    ("number", "label"),
    [(1.0, "valid"), (0.0, "refused"), (100.0, "refused"), (5.0, "valid"), (50.0, "refused"),
     (unusual(50.0), "valid"), (unusual(-1.0), "refused"), (math.nan, "refused"), (math.inf, "refused")],
)  # fmt: skip
def test_numbers_are_judged_by_their_declaration(number, label):
    quantity = Quantity("m", above=0.0, at_most=100.0, plausible=(0.1, 10.0))
    assert judge_number(quantity, number) == label
    assert label_of(Annotated[float, quantity], number) == label


def test_all_that_is_public_is_tried():
    import exumob
    from exumob.__main__ import COMMANDS

    tried = {t.name.partition(",")[0] for t in targets.function_targets()} | {owner.__name__ for owner in CLASSES}
    no_input = {
        "__version__",
        "Hydrodynamics",
        "NoWater",
        "ImplausibleValue",
        "SimulationError",
        "SimulationInterrupted",
    }
    assert set(exumob.__all__) - tried - no_input == set()
    assert {f"exumob {name}" for name in COMMANDS} == {t.name for t in commands.command_targets()}
