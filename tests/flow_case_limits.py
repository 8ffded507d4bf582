"""Known misses of the cases of `exumob verify`, with how far they may go, and what is complained of."""

import pytest

from exumob.verification.cases import CASES

LONG = {"coupled-light-box", "sloshing-plic", "coupled-momentum", "far-field-waves", "far-field-drift"}
"""Take 7 to 20 s each and are run in tests/runs; the others try the same kernels in tests/physics."""
SMOOTH = "where a smooth wall sheds its boundary layer is not resolved: the wall slips, with friction"
SLOW_FRONT = "the front is a few per cent late on every grid; pressure is read half a cell off the face"
EDGES = "an edge that passes through the grid opens and closes its cells"
SLOSH = "water sloshes between the wall and the front, which runs unevenly"
P3 = "P3 at 101 mm", "P3 at 99 mm"
AMID_CELLS = "its front and back lie amid cells, whose edges are rounded off by half of them"
KNOWN_MISSES = {
    "breaking-tank": {
        f"momentum gap, breaking water, h = {h} mm": (bound, "pressure of impacts is known half a cell from the wall")
        for h, bound in ((20, 0.06), (10, 0.03))
    },
    "momentum-surface": {
        "momentum gap, surface-piercing box, h = 20 mm": (0.03, "pressure in the surface cell is known to half a cell")
    },
    "noise": {f"noise of the lift through the grid, dt {dt} ms": (0.02, EDGES) for dt in (1, 2)},
    "channel-column": {"drag coefficient, b/w 0.1, 6 cells": (0.18, "six cells")},
    "spheric-2": {
        **{f"arrival t sqrt(g/H), {p}, h = 40 mm": (0.3, SLOW_FRONT) for p in P3},
        **{f"impulse, {p}, h = 40 mm": (0.45, SLOW_FRONT) for p in P3},
    },
    "spheric-2-fine": {
        **{f"arrival t sqrt(g/H), {p}, h = 25 mm": (0.13, SLOW_FRONT) for p in P3},
        **{f"impulse, {p}, h = 25 mm": (0.35, SLOW_FRONT) for p in P3},
    },
    "spheric-2-finest": {
        **{f"arrival t sqrt(g/H), {p}, h = 17.5 mm": (0.1, SLOW_FRONT) for p in P3},
        **{f"impulse, {p}, h = 17.5 mm": (0.25, SLOW_FRONT) for p in P3},
    },
    "bore-column": {
        f"force, {part} s, h = 15 mm": (0.35, "what edges impose, fitted to a slow current, holds back a fast one")
        for part in ("0.1 to 0.4", "0.4 to 0.7")
    },
    "sharp-columns": {
        "drag coefficient, square, 0.5 cells from a face": (0.27, AMID_CELLS),
        "drag coefficient, plate, 0 cells from a face": (
            0.25,
            "a plate about a cell thick: both its edges are one cell",
        ),
        "drag coefficient, rectangle 1:2, 0 cells from a face": (0.45, AMID_CELLS),
        "drag coefficient, rectangle 2:1, 0.5 cells from a face": (0.19, AMID_CELLS),
    },
    "round-column": {
        "drag coefficient, round, U 0.3 m/s (Fr 0.30)": (0.53, SMOOTH),
        "drag coefficient, round, U 0.5 m/s (Fr 0.50)": (0.4, SMOOTH),
    },
    "bed-canal": {"canal, volume": (0.003, "films thinner than half a cell at a shore that wets and dries")},
    "resistance-hump": {
        "hull, depth Froude number of the largest coefficient": (
            0.95,
            "a blunt hull's bow wave stands and breaks before it",
        ),
    },
}
"""Case -> check -> (largest |error| it may have, why). Such a check must still miss: an improvement is noticed."""

TURBULENT = {
    "jump-2.25": {"speed of the front, jump, Froude number 2.25": (0.06, SLOSH)},
    "jump-3.6": {
        "speed of the front, jump, Froude number 3.6": (0.07, SLOSH),
        "momentum, jump, Froude number 3.6": (0.03, SLOSH),
    },
    "jump-5": {
        "speed of the front, jump, Froude number 5": (0.2, "the front is not steady after nine depths"),
        "momentum, jump, Froude number 5": (0.05, SLOSH),
    },
    "sharp-columns": {
        "drag coefficient, rectangle 1:2, 0.5 cells from a face": (0.2, "-13 and -17 % in two runs"),
    },
    "domain": {
        "hull Fx, mean, window doubled": (0.1, "-5 +- 4 % over 12 s"),
        "hull My, mean, window doubled": (0.1, "-4 +- 3 %"),
    },
    "time-step": {
        "hull Fx, mean, 2 ms against 1 ms": (0.13, "+8 +- 4 % over 4.5 s"),
        "hull My, mean, 2 ms against 1 ms": (0.2, "+8 +- 8 %"),
    },
    "towed-held": {
        "hull Fz, held against towed, over hull Fx": (0.03, "0.1 % of the lift itself, which is 17 times the drag"),
    },
}
"""The same for differences of means of turbulent flows, which lie about their limit: these may meet it too."""


def complaints(case):
    """Lines on checks that miss their limit or bound, on known misses that meet it, and on names that no check has."""
    misses, turbulent = KNOWN_MISSES.get(case.name, {}), TURBULENT.get(case.name, {})
    checks = case.run()
    bad = [f"{name}: no check of {case.name} is called so" for name in {*misses, *turbulent} - {c.name for c in checks}]
    if not checks:
        bad.append(f"{case.name} checks nothing")
    for check in checks:
        line = f"{check.name}: {check.value:.6g}, reference {check.reference:.6g}, error {check.error:.3g}"
        if check.name in turbulent:
            if not abs(check.error) <= turbulent[check.name][0]:
                bad.append(f"{line}: worse than its bound {turbulent[check.name][0]:.3g}")
            continue
        if check.name not in misses:
            if not check.passed:
                bad.append(f"{line}, limit {check.limit:.3g}")
            continue
        bound, reason = misses[check.name]
        if check.passed:
            bad.append(f"{line}: meets its limit now, take it off KNOWN_MISSES ({reason})")
        elif not abs(check.error) <= bound:
            bad.append(f"{line}: worse than its bound {bound:.3g} ({reason})")
    return bad


def chosen(long):
    """Cases of either tier, as parameters of a test."""
    marks = {case.name: pytest.mark.slow if case.slow else () for case in CASES}
    return [pytest.param(case, id=case.name, marks=marks[case.name]) for case in CASES if (case.name in LONG) == long]
