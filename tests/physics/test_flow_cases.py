"""Every case of `exumob verify` meets its limits; known misses are named in `tests/flow_case_limits.py`."""

import math

import numpy as np
import pytest
from flow_case_limits import KNOWN_MISSES, LONG, TURBULENT, chosen, complaints

from exumob.flow import Grid
from exumob.support.constants import GRAVITY
from exumob.verification import Case, Check
from exumob.verification.bores import advance
from exumob.verification.cases import CASES
from exumob.verification.initial import started
from exumob.verification.momentum import water_momentum
from exumob.water.conditions import Water


@pytest.mark.parametrize("case", chosen(long=False))
def test_case_meets_its_limits(case):
    bad = complaints(case)
    assert not bad, "\n".join(bad)


def test_momentum_and_push_of_water_in_a_tank_whose_cells_grow():
    """Of water that moves as one, before any step, and of water that rests, on an end wall."""
    grid = Grid.stretched((-1.0, 0.0, 0.0), (0.0, 0.08, 0.2), (-3.0, 0.0, 0.0), (0.0, 0.08, 0.2), 0.02, 1.05)
    solver = started(grid, Water(0.11))
    ny, nz, nx = grid.shape
    still = np.zeros((ny + 1, nz, nx)), np.zeros((ny, nz + 1, nx))
    solver.set_flow(velocity=(np.full((ny, nz, nx + 1), 0.3), *still))
    middle = np.diff(0.5 * (grid.x_faces[1:] + grid.x_faces[:-1])).sum()  # end faces are walls
    assert water_momentum(solver) == pytest.approx(1000.0 * 0.3 * 0.11 * 0.08 * middle)
    resting = started(grid, Water(0.11))
    impulse = advance(resting, 0.1)
    assert impulse == pytest.approx(0.1 * 500.0 * GRAVITY * 0.11**2 * 0.08, rel=0.01)


def test_names_are_unique():
    names = [case.name for case in CASES]
    assert len(set(names)) == len(names)
    assert all(math.isfinite(case.minutes) and case.minutes > 0.0 for case in CASES)


def test_named_cases_are_there():
    assert {*KNOWN_MISSES, *TURBULENT, *LONG} <= {case.name for case in CASES}


def test_what_is_complained_of(monkeypatch):
    """A miss, a known miss that grows or is none any more, a number that is none, and a name that no check has."""
    monkeypatch.setitem(KNOWN_MISSES, "made up", {"grown": (0.3, "-"), "met": (0.3, "-"), "known": (0.3, "-")})
    monkeypatch.setitem(TURBULENT, "made up", {"renamed": (0.3, "-")})
    errors = {"missed": 0.2, "fine": 0.05, "grown": 0.4, "met": 0.05, "known": 0.2, "nan": math.nan}
    checks = [Check(name, 1.0 + error, 1.0, error, 0.1) for name, error in errors.items()]
    bad = complaints(Case("made up", "-", lambda: checks, 0.1))
    assert sorted(line.split(":")[0] for line in bad) == ["grown", "met", "missed", "nan", "renamed"]
