"""Lugs of a spinning wheel: sign, size, momentum, and nothing at all unless they are asked for."""

import dataclasses
import math

import numpy as np
import pytest

from exumob.flow import FlowSettings, FlowSolver, Grid, Poses, Tread, box, cylinder
from exumob.flow.active_rows import WaterCells
from exumob.flow.forces import lug_drag
from exumob.water.conditions import Water

RADIUS, WIDTH, DEPTH = 0.12, 0.08, 0.2
HALO = 2
TREAD = Tread(lug_height=0.015, lug_count=12)
ROUND = cylinder(RADIUS, WIDTH, 0.0, friction=0.0)


def wheel(spin, tread=TREAD, steps=0, settings=None, cell=0.02):
    """Solver with a wheel whose axle is at the water's level, well above the bed, after some steps of 5 ms."""
    grid = Grid.uniform((-0.4, -0.3, 0), (0.4, 0.3, 0.44), cell)
    solid = dataclasses.replace(ROUND, tread=tread)
    solver = FlowSolver(grid, (solid,), Water(DEPTH), settings or FlowSettings(follow=None, absorbing_width=0.1))
    pose = dataclasses.replace(Poses.at_rest([[0.0, 0.0, DEPTH]]), spin=np.array([spin]))
    solver.start(pose)
    for n in range(steps):
        solver.advance(0.005 * (n + 1), pose)
    return solver


def pushed(spin):
    """Load on the wheel [N, N m] when water at rest is pushed, and momentum the water gains per second [N]."""
    solver, dt = wheel(spin), 1e-3
    fraction = solver._state.fraction
    cells = WaterCells.empty(fraction.shape)._replace(fraction=fraction, wet=(fraction >= 0.5).astype(np.uint8))
    change, still = (tuple(np.zeros(fraction.shape) for _ in range(3)) for _ in range(2))
    o, solids = solver.area_fractions, solver._step.placement.solids
    loads = lug_drag(change, still, cells, o, solids, 1000.0, dt, solver.metrics)
    gained = [1000.0 / dt * np.sum(b * q) * 0.02**3 for b, q in zip(o.faces, change, strict=True)]
    return loads[0], np.array(gained)


def test_momentum_is_exchanged():
    """What the water gains on open faces is what the wheel loses: round-off, 1e-10."""
    load, gained = pushed(10.0)
    assert np.abs(load[:3] + gained).max() < 1e-10 * np.abs(load[:3]).max()


def test_sign_and_size():
    """At rest, half submerged: the lugs feel rho C_D A (spin (R + h/2))^2 / 2, of which 1/2 is wet, 2/pi forward.

    The ring is one and a half cells thick and cut by the level and the tyre, so its wet part errs: 4 % and 6 % too
    little on these cells, 8 % allowed.
    """
    load, _ = pushed(10.0)
    area = 12 * 0.015 * WIDTH
    drag = 0.5 * 1000.0 * 1.2 * area * (10.0 * (RADIUS + 0.0075)) ** 2
    assert load[0] == pytest.approx(0.5 * drag * 2.0 / math.pi, rel=0.08)
    assert abs(load[1]) < 1e-9 * load[0]
    assert load[4] < 0.0  # about y: it brakes the spin
    assert load[4] == pytest.approx(-0.5 * drag * (RADIUS + 0.015), rel=0.08)
    backward, _ = pushed(-10.0)
    assert backward == pytest.approx(-load, abs=1e-9 * drag)


def test_nothing_without_motion():
    load, gained = pushed(0.0)
    assert not load.any()
    assert not gained.any()


def test_paddle_wheel_drives_forward():
    """The water is set going: the thrust falls to 47 % of its first value within 0.1 s and to 35 % within 0.2 s.

    The braking moment falls to 50 and 40 %. From then on lugs and water keep pace (0.4 s: 34 and 41 %).
    """
    first, _ = pushed(10.0)
    for steps, thrust, moment in ((20, 0.474, 0.496), (40, 0.347, 0.398)):
        loads = wheel(10.0, steps=steps).loads.shear[0]
        assert loads[0] / first[0] == pytest.approx(thrust, abs=0.02)
        assert loads[4] / first[4] == pytest.approx(moment, abs=0.02)


def test_no_tread_changes_nothing():
    """A tread without drag and none at all: the same bits."""
    one, two = wheel(10.0, None, steps=5).save(), wheel(10.0, Tread(0.015, 12, 0.0), steps=5).save()
    for name in one:
        np.testing.assert_array_equal(one[name], two[name], name)


def test_bad_input():
    with pytest.raises(ValueError, match="lug_height"):
        Tread(0.0, 12)
    with pytest.raises(ValueError, match="only a cylinder"):
        dataclasses.replace(box(0.1, 0.1, 0.1), tread=TREAD)
