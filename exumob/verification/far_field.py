"""Far field: how much of a wave comes back from the window's sides, and whether the level drifts.

Limits, from the literature on absorbing zones before anything was measured. A zone as wide as the wave is long sends
back some 1 to 5 % of its height, one half as wide up to 10 % (Jacobsen et al., Int. J. Numer. Meth. Fluids 70 (2012)
1073; Peric & Abdel-Maksoud, Ship Technol. Res. 63 (2016) 1, for zones that damp the velocity alone and are tuned to
the wave). Damping velocity and level at the same rate has no change of impedance: in linear theory a wave of group
velocity c is only weakened, to exp(-2 integral of the rate / c) on its way to the side and back, whatever its length.
Hence 5 % is demanded for waves up to twice the zone's width, straight or oblique, and the level must return to still
water to 0.1 % of the depth.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from exumob.environment import GRAVITY, Water
from exumob.flow import FlowSettings, FlowSolver, Grid, Poses, box
from exumob.states import Array
from exumob.verification import Case, Check, absolute, reported
from exumob.verification.basins import hump
from exumob.verification.initial import TANK, centers, filled_to, started

DEPTH = 0.12
"""[m]"""
OPEN = replace(TANK, far_x=True, far_y=True)
"""Far field all round, no friction; the default absorbing zone."""
HEIGHT = 0.004
"""Amplitude of the waves [m]"""


def packet(grid: Grid, length: float, current: float) -> tuple[Array, tuple[Array, Array, Array]]:
    """Fraction and velocity of a packet of waves about x = 0 that runs to larger x (linear theory, exact for it).

    Parameters
    ----------
    length : float
        Of its waves [m]; the envelope is exp(-(x / 0.6 length)^2).
    current : float
        Along x [m/s].
    """
    n, extent = 4096, 40.0 * length
    x = (np.arange(n) / n - 0.5) * extent
    level = HEIGHT * np.exp(-((x / (0.6 * length)) ** 2)) * np.cos(2.0 * math.pi * x / length)
    k = 2.0 * math.pi * np.fft.rfftfreq(n, extent / n)
    keep = slice(1, np.searchsorted(k, 12.0 * math.pi / length))
    spectrum = np.fft.rfft(level)
    k, spectrum = k[keep], spectrum[keep] * (2.0 / n) * np.exp(1j * k[keep] * 0.5 * extent)
    rate = np.sqrt(GRAVITY * k * np.tanh(k * DEPTH))

    def wave(places: Array, amplitudes: Array) -> Array:
        inside = np.abs(places) < 3.0 * length
        return np.where(inside, (amplitudes @ np.exp(1j * np.multiply.outer(k, places))).real, 0.0)

    zf, zc = np.minimum(grid.z_faces, 1.5 * DEPTH), np.minimum(centers(grid.z_faces), 1.5 * DEPTH)
    per_height = spectrum * rate / np.sinh(k * DEPTH)
    u = wave(grid.x_faces, per_height * np.cosh(np.multiply.outer(zc, k))) + current
    w = wave(centers(grid.x_faces), -1j * per_height * np.sinh(np.multiply.outer(zf, k)))
    across = np.ones((grid.shape[0], 1, 1))
    v = np.zeros((grid.shape[0] + 1, *grid.shape[1:]))
    return filled_to(grid, DEPTH + wave(centers(grid.x_faces), spectrum)), (u * across, v, w * across)


def reflection(length: float, current: float = 0.0, settings: FlowSettings = OPEN) -> float:
    """Largest wave that the far sides send back into a channel, over the packet that arrives there [-].

    The channel is run twice, once so long that nothing comes back in time; the difference between the two in front
    of the zones is what the sides do. Waves run with the current if it is positive, against it if negative.
    """
    inner = 1.4 * length
    wave_number = 2.0 * math.pi / length
    tilt = 2.0 * wave_number * DEPTH / math.sinh(2.0 * wave_number * DEPTH)
    group = 0.5 * (1.0 + tilt) * math.sqrt(GRAVITY * math.tanh(wave_number * DEPTH) / wave_number)
    way_back = (settings.absorbing_width + 0.6 * length) / max(group - current, 0.5 * group)
    duration = (inner + settings.absorbing_width) / (group + current) + way_back
    fastest = math.sqrt(GRAVITY * DEPTH) + abs(current)
    more = 0.5 * fastest * duration
    cell = min(length / 20.0, 0.05)
    step = 0.4 * cell / fastest
    steps = math.ceil(duration / step)
    water = Water(DEPTH, current_speed=abs(current), current_direction=0.0 if current >= 0.0 else math.pi)
    levels = []
    for half in (inner + settings.absorbing_width, inner + settings.absorbing_width + more):
        count = round(2.0 * half / cell / 2) * 2
        grid = Grid(
            (np.arange(count + 1) - count // 2) * cell, np.arange(5) * cell, np.linspace(0.0, 0.24, 11)
        )  # fmt: skip
        solver = FlowSolver(grid, (), water, replace(settings, far_y=False))
        solver.start()
        solver.set_flow(*packet(grid, length, current))
        within = np.abs(centers(grid.x_faces)) < inner
        rows = []
        for n in range(steps):
            solver.advance(step * (n + 1))
            rows.append(solver.surface_height()[1, within] - DEPTH)
        levels.append(np.array(rows))
    small, large = levels
    arriving = float(np.abs(large[:, -1]).max())
    return float(np.abs(small - large).max()) / arriving


def ring(current: float, settings: FlowSettings = OPEN, duration: float = 2.5) -> float:
    """As `reflection`, for the rings about a hump of water in a square window: every angle at once [-]."""
    cell, inner = 0.05, 0.6
    fastest = math.sqrt(GRAVITY * DEPTH) + abs(current)
    step, water = 0.4 * cell / fastest, Water(DEPTH, current_speed=current)
    levels = []
    for half in (inner + settings.absorbing_width, inner + settings.absorbing_width + 0.5 * fastest * duration):
        half = round(half / cell) * cell
        grid = Grid.uniform((-half, -half, 0), (half, half, 0.24), (cell, cell, 0.03))
        solver = started(grid, water, settings, hump(grid, DEPTH, 0.02, 0.15))
        within = np.abs(centers(grid.x_faces)) < inner
        rows = []
        for n in range(math.ceil(duration / step)):
            solver.advance(step * (n + 1))
            rows.append(solver.surface_height()[np.ix_(within, within)] - DEPTH)
        levels.append(np.array(rows))
    small, large = levels
    edge = np.abs(large).max(axis=0)
    arriving = float(np.concatenate([edge[0], edge[-1], edge[:, 0], edge[:, -1]]).max())
    return float(np.abs(small - large).max()) / arriving
