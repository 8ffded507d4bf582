"""Sweeps before anything runs: what makes two the same, and which values are refused."""

import functools
import importlib
import itertools
import sys
from types import SimpleNamespace

import pytest

from exumob.sweeps import run
from exumob.sweeps.case_store import CaseStore
from exumob.sweeps.experiment import amphibious_lane_change
from exumob.sweeps.identity import identity
from exumob.sweeps.run import _check_cases


@pytest.fixture
def written(tmp_path, monkeypatch):
    """Writes a module and imports it anew; its functions can be pickled."""
    monkeypatch.syspath_prepend(tmp_path)

    def write(text):
        sys.modules.pop("of_a_user", None)
        (tmp_path / "of_a_user.py").write_text(text)
        importlib.invalidate_caches()
        return importlib.import_module("of_a_user")

    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    yield write
    sys.modules.pop("of_a_user", None)


FUNCTION = "def answer(case, factor=1.0):\n    return {{'y': {} * factor * case['x']}}\n"
CALLABLE = """
from dataclasses import dataclass
@dataclass
class Answer:
    factor: float
    def __call__(self, case):
        return {{'y': {} * self.factor * case['x']}}
    def method(self, case):
        return self(case)
"""
UNREADABLE = 'exec(\'def answer(case):\\n    return {{"y": {} * case["x"]}}\')\n'


def prepare(folder, function, cases=({"x": 1.0},)):
    CaseStore(folder, function, cases, None, False).prepare([])


@pytest.mark.parametrize("text, made", [
    (FUNCTION, lambda m: m.answer),
    (FUNCTION, lambda m: functools.partial(m.answer, factor=2.0)),
    (CALLABLE, lambda m: m.Answer(2.0)),
    (UNREADABLE, lambda m: m.answer),
], ids=["function", "partial", "callable", "no source"])  # fmt: skip
def test_changed_source_is_refused(text, made, written, tmp_path):
    prepare(tmp_path / "sweep", made(written(text.format(1))))
    prepare(tmp_path / "sweep", made(written(text.format(1))))
    with pytest.raises(ValueError, match=r"before its source was changed; give another folder.*sweep\.json alone"):
        prepare(tmp_path / "sweep", made(written(text.format(2))))
    (tmp_path / "sweep" / "sweep.json").unlink()
    prepare(tmp_path / "sweep", made(written(text.format(2))))


@pytest.mark.parametrize("other, what", [
    (lambda m: functools.partial(m.answer, factor=3.0), "another experiment or function"),
    (lambda m: functools.partial(m.answer, 3.0), "another experiment or function"),
    (lambda m: m.answer, "another experiment or function"),
])  # fmt: skip
def test_other_arguments_of_a_partial_are_refused(other, what, written, tmp_path):
    module = written(FUNCTION.format(1))
    prepare(tmp_path / "sweep", functools.partial(module.answer, factor=2.0))
    with pytest.raises(ValueError, match=what):
        prepare(tmp_path / "sweep", other(module))


def test_other_fields_and_cases_are_refused(written, tmp_path):
    module = written(CALLABLE.format(1))
    prepare(tmp_path / "sweep", module.Answer(2.0).method)
    prepare(tmp_path / "sweep", module.Answer(2.0).method)
    with pytest.raises(ValueError, match="another experiment or function"):
        prepare(tmp_path / "sweep", module.Answer(3.0).method)
    with pytest.raises(ValueError, match="other cases"):
        prepare(tmp_path / "sweep", module.Answer(2.0).method, [{"x": 2.0}])


def test_addresses_do_not_count(written, tmp_path):
    """Two objects that are alike, at different addresses."""
    module = written(FUNCTION.format(1))
    one, other = (functools.partial(module.answer, factor=SimpleNamespace(a=object())) for _ in range(2))
    assert identity(one) == identity(other)


def test_last_of_many_values_is_looked_at():
    cases = [{"hull.mass": 50.0 + 1e-3 * n, "soil.cohesion": 1000.0 + n} for n in range(4000)]
    _check_cases(amphibious_lane_change(), cases)
    with pytest.raises(ValueError, match=r"mass = -1\.0"):
        _check_cases(amphibious_lane_change(), [*cases, {"hull.mass": -1.0, "soil.cohesion": 1.0}])
    with pytest.raises(ValueError, match="mass = nan"):
        _check_cases(amphibious_lane_change(), [*cases, {"hull.mass": float("nan"), "soil.cohesion": 1.0}])


def test_smallest_and_largest_of_too_many_are_looked_at(monkeypatch):
    """And every value of a name that has few."""
    monkeypatch.setattr(run, "CHECKED_VALUES", 100)
    cases = [{"soil": "LETE sand", "hull.mass": 50.0 + 1e-3 * n} for n in range(1000)]
    looked = []
    experiment = amphibious_lane_change()
    monkeypatch.setattr(type(experiment), "check_values", lambda self, name, values: looked.append((name, values)))
    _check_cases(experiment, cases)
    (_, soils), (_, masses) = looked
    assert soils == ["LETE sand"]
    assert 90 <= len(masses) <= 100 and masses[0] == 50.0 and masses[-1] == cases[-1]["hull.mass"]
    assert max(b - a for a, b in itertools.pairwise(masses)) < 0.012
