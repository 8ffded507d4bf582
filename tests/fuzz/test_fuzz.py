"""Any input is right, or refused: a few inputs of each kind always, thousands with ``pytest -m slow tests/fuzz``."""

import warnings

import pytest
from hypothesis import HealthCheck, Phase, given, settings

from exumob.support.declared import Declared

from . import commands, files, runs, targets
from .odd_values import given as of_source
from .outcome import Outcome, Reached, Silent, outcome_of
from .strategies import label_of

FEW, MANY = 8, 400
"""Inputs of each target: always, and by the marker slow"""
EITHER = [pytest.param(FEW, id="few"), pytest.param(MANY, id="many", marks=pytest.mark.slow)]
CLASSES = targets.user_classes()


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
@pytest.mark.parametrize("owner", CLASSES, ids=lambda owner: owner.__name__)
def test_dataclasses(owner, number):
    try_inputs(targets.class_target(owner), number * (2 if issubclass(owner, Declared) else 1))


@pytest.mark.parametrize("number", EITHER)
@pytest.mark.parametrize("target", targets.function_targets(), ids=lambda target: target.name)
def test_functions(target, number):
    try_inputs(target, number)


@pytest.mark.parametrize("number", EITHER)
@pytest.mark.parametrize("target", commands.command_targets(), ids=lambda target: target.name)
def test_commands(target, number):
    try_inputs(target, number)


@pytest.mark.parametrize("number", EITHER)
@pytest.mark.parametrize("target", files.file_targets(), ids=lambda target: target.name)
def test_files(target, number):
    try_inputs(target, number)


@pytest.mark.parametrize("number", [*range(8), *(pytest.param(n, marks=pytest.mark.slow) for n in range(8, 300))])
def test_runs(number):
    outcome = runs.answer(number)
    assert outcome.fine, f"scene {number}: {runs.scene(number)}: {outcome.kind}: {outcome.detail}"
