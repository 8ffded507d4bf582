"""How much of a wave comes back from the window's sides, and does the level drift?

Limits, from the literature on absorbing zones before anything was measured. A zone as wide as the wave is long sends
back some 1 to 5 % of its height, one half as wide up to 10 % (Jacobsen et al., Int. J. Numer. Meth. Fluids 70 (2012)
1073; Peric & Abdel-Maksoud, Ship Technol. Res. 63 (2016) 1, for zones that damp the velocity alone and are tuned to
the wave). Damping velocity and level at the same rate has no change of impedance: in linear theory a wave of group
velocity c is only weakened, to exp(-2 integral of the rate / c) on its way to the side and back, whatever its length.
Hence 5 % is demanded for waves up to twice the zone's width, straight or oblique, and the level must return to still
water to 0.1 % of the depth.

Oblique waves do see a change of impedance in a zone that damps all alike: linear theory of long waves (an ordinary
equation across the zone) gives, for rates that rise with the square and a strength of 8, and waves one (two) zone
widths long at 30, 45 and 60 degrees, 2, 8 and 23 (8, 19 and 36) %. A matched layer (`exumob.flow.far_field`) has none:
what is left is what the layer does not absorb, exp(-strength cos(angle) / 2), and that these waves are not long.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from exumob.flow import FlowSettings, FlowSolver, Grid, Poses, box
from exumob.support.arrays import Array
from exumob.support.constants import GRAVITY
from exumob.support.declared import checked
from exumob.verification.check import Case, Check, absolute, reported
from exumob.verification.initial import TANK, centers, filled_to, hump, started
from exumob.verification.options import CellSize
from exumob.water.conditions import Water

DEPTH = 0.12
"""[m]"""
OPEN = replace(TANK, far_x=True, far_y=True)
"""Far field all round, no friction; the default absorbing zone."""
HEIGHT = 0.004
"""Amplitude of the waves [m]"""


def packet(grid: Grid, length: float, current: float, angle: float) -> tuple[Array, tuple[Array, Array, Array]]:
    """Fraction and velocity of a packet of waves about x = 0 that runs to larger x, exact in linear theory.

    Parameters
    ----------
    length : float
        Length of its waves [m]; the envelope is exp(-(x cos(angle) / 0.6 length)^2).
    current : float
        Speed of the current along x [m/s].
    angle : float
        Angle between the waves' direction and x [rad]; two oblique trains mirrored in y, which walls at y = 0 and
        length / (2 sin(angle)) do not disturb.
    """
    along, across = 2.0 * math.pi / length * np.array([math.cos(angle), math.sin(angle)])
    n, extent = 4096, 40.0 * length / math.cos(angle)
    x = (np.arange(n) / n - 0.5) * extent
    level = HEIGHT * np.exp(-((x * along / (1.2 * math.pi)) ** 2)) * np.cos(along * x)
    kx = 2.0 * math.pi * np.fft.rfftfreq(n, extent / n)
    keep = slice(1, np.searchsorted(kx, 6.0 * along))
    spectrum = np.fft.rfft(level)[keep] * (2.0 / n)
    kx = kx[keep]
    spectrum = spectrum * np.exp(0.5j * kx * extent)
    k = np.hypot(kx, across)
    rate = np.sqrt(GRAVITY * k * np.tanh(k * DEPTH))

    def wave(places: Array, amplitudes: Array) -> Array:
        inside = np.abs(places) * along < 6.0 * math.pi
        return np.where(inside, (amplitudes @ np.exp(1j * np.multiply.outer(kx, places))).real, 0.0)

    xf, xc, yf, yc = grid.x_faces, centers(grid.x_faces), grid.y_faces, centers(grid.y_faces)
    zf, zc = np.minimum(grid.z_faces, 1.5 * DEPTH), np.minimum(centers(grid.z_faces), 1.5 * DEPTH)
    scaled = spectrum * rate / np.sinh(k * DEPTH)
    rise = np.cosh(np.multiply.outer(zc, k))
    even, odd = np.cos(across * yc)[:, None, None], np.sin(across * yf)[:, None, None]
    u = wave(xf, scaled * kx / k * rise) * even + current
    v = wave(xc, 1j * scaled * across / k * rise) * odd
    w = wave(xc, -1j * scaled * np.sinh(np.multiply.outer(zf, k))) * even
    return filled_to(grid, DEPTH + even[:, 0] * wave(xc, spectrum)), (u, v, w)


def reflection(length: float, current: float = 0.0, angle: float = 0.0, settings: FlowSettings = OPEN) -> float:
    """Largest wave that the far sides send back into a channel, over the packet that arrives there [-].

    The channel is run twice, once so long that nothing comes back in time; the difference between the two in front
    of the zones is what the sides do. Waves run with the current if it is positive, against it if negative. `angle`
    is that between the waves' direction and the channel [rad].
    """
    cosine = math.cos(angle)
    inner = 1.4 * length / cosine
    wave_number = 2.0 * math.pi / length
    tilt = 2.0 * wave_number * DEPTH / math.sinh(2.0 * wave_number * DEPTH)
    group = 0.5 * (1.0 + tilt) * math.sqrt(GRAVITY * math.tanh(wave_number * DEPTH) / wave_number) * cosine
    way_back = (settings.zone_width + 0.6 * length / cosine) / max(group - current, 0.5 * group)
    duration = (inner + settings.zone_width) / (group + current) + way_back
    fastest = math.sqrt(GRAVITY * DEPTH) + abs(current)
    more = 0.5 * fastest * duration
    cell = min(length / 20.0, 0.05)
    across = 0.5 * length / math.sin(angle) if angle else 4.0 * cell
    y = np.linspace(0.0, across, 11 if angle else 5)
    steps = math.ceil(duration * fastest / (0.4 * cell))
    water = Water(DEPTH, current_speed=abs(current), current_direction=0.0 if current >= 0.0 else math.pi)
    levels = []
    for half in (inner + settings.zone_width, inner + settings.zone_width + more):
        count = round(half / cell)
        grid = Grid(np.linspace(-count * cell, count * cell, 2 * count + 1), y, np.linspace(0.0, 0.24, 11))
        solver = FlowSolver(grid, (), water, replace(settings, far_y=False))
        solver.start()
        solver.set_flow(*packet(grid, length, current, angle))
        within = np.abs(centers(grid.x_faces)) < inner
        rows = []
        for n in range(steps):
            solver.advance(duration * (n + 1) / steps)
            rows.append(solver.surface_height()[:, within] - DEPTH)
        levels.append(np.array(rows))
    small, large = levels
    return float(np.abs(small - large).max() / np.abs(large[..., -1]).max())


def waves() -> list[Check]:
    """Packets of waves 3 to 20 depths long in still water."""
    checks = []
    for length in (0.36, 0.6, 1.2, 2.4):
        share = reflection(length)
        name = f"waves sent back, {length / OPEN.zone_width:.1f} zone widths long"
        short = length <= 2.0 * OPEN.zone_width + 1e-9
        checks.append(absolute(name, share, 0.0, 0.05) if short else reported(name, share, 0.0))
    return checks


def waves_in_current() -> list[Check]:
    """Packets of waves with and against a current."""
    return [
        absolute(
            f"waves sent back, {length / OPEN.zone_width:.1f} zone widths long, "
            f"{'with' if current > 0.0 else 'against'} {abs(current):g} m/s",
            reflection(length, current),
            0.0,
            0.05,
        )
        for length, current in ((0.6, 0.5), (0.6, -0.5), (1.2, 0.5), (1.2, -0.5))
    ]


def oblique_waves() -> list[Check]:
    """Waves that meet the side at an angle."""
    return [
        absolute(
            f"waves sent back, {length / OPEN.zone_width:.1f} zone widths long, at {degrees} degrees",
            reflection(length, angle=math.radians(degrees)),
            0.0,
            0.05,
        )
        for length, degrees in ((0.6, 30), (0.6, 45), (0.6, 60), (1.2, 30), (1.2, 45), (1.2, 60))
    ]


def drift() -> list[Check]:
    """Mean level, volume and largest wave 10 s after a hump of water, and after humps inside the zones."""
    checks = []
    for current in (0.0, 1.0):
        grid = Grid.uniform((-1.2, -1.2, 0), (1.2, 1.2, 0.24), (0.06, 0.06, 0.03))
        solver = started(grid, Water(DEPTH, current_speed=current), OPEN)
        volume = solver.water_volume()
        solver.set_flow(filled_to(grid, hump(grid, DEPTH, 0.02, 0.2)))
        for n in range(500):
            solver.advance(0.02 * (n + 1))
        level = solver.surface_height() - DEPTH
        where = f"10 s after a hump, current {current:g} m/s"
        checks.append(absolute(f"mean level over depth, {where}", float(level.mean()) / DEPTH, 0.0, 1e-3))
        checks.append(absolute(f"volume, {where}", solver.water_volume() / volume - 1.0, 0.0, 1e-3))
        checks.append(reported(f"largest wave over depth, {where}", float(np.abs(level).max()) / DEPTH, 0.0))
    for place, middle in (("a side", (0.0, 0.9)), ("a corner", (0.9, 0.9))):
        grid = Grid.uniform((-1.2, -1.2, 0), (1.2, 1.2, 0.24), (0.06, 0.06, 0.03))
        solver = started(grid, Water(DEPTH), OPEN)
        solver.set_flow(filled_to(grid, hump(grid, DEPTH, 0.02, 0.2, middle)))
        for n in range(250):
            solver.advance(0.02 * (n + 1))
        level = solver.surface_height() - DEPTH
        where = f"5 s after a hump in the zone of {place}"
        checks.append(absolute(f"mean level over depth, {where}", float(level.mean()) / DEPTH, 0.0, 1e-3))
        checks.append(reported(f"largest wave over depth, {where}", float(np.abs(level).max()) / DEPTH, 0.0))
    return checks


@checked
def towed_box(speed: float, cell: CellSize = 0.05, ahead: float = 1.8, aside: float = 1.5, top: float = 0.45) -> Array:
    """Box of 0.6 x 0.3 m, 0.06 m deep in the water, held in a current along -x for 8 s; cells half as high as long.

    Returns
    -------
    array, shape (n, 3)
        Time [s]; water in the window over the undisturbed volume, less 1; drag [N].
    """
    low, high = (-ahead - 0.6, -aside, 0.0), (ahead, aside, top)
    plan = Grid.stretched((-0.5, -0.35, 0.0), (0.5, 0.35, 0.2), low, high, cell)
    grid = Grid(plan.x_faces, plan.y_faces, np.linspace(0.0, top, round(2.0 * top / cell) + 1))
    water = Water(DEPTH, current_speed=speed, current_direction=math.pi)
    solver = FlowSolver(grid, (box(0.6, 0.3, 0.2),), water, FlowSettings(follow=None))
    poses = Poses.at_rest([[0.0, 0.0, DEPTH - 0.06 + 0.1]])
    solver.start(poses)
    volume, rows = solver.water_volume(), []
    for n in range(800):
        loads = solver.advance(0.01 * (n + 1), poses)
        rows.append((solver.time, solver.water_volume() / volume - 1.0, -loads[0, 0]))
    return np.array(rows)


def body() -> list[Check]:
    """Water that a box in a current gathers in the window, below and above the critical speed; reported."""
    checks = []
    for speed in (0.5, 1.0, 2.0):
        froude = speed / math.sqrt(GRAVITY * DEPTH)
        rows = towed_box(speed)
        late, middle = rows[600:], rows[400:600]
        where = f"box in a current, depth Froude number {froude:.2f}"
        checks.append(reported(f"water in the window at 6 to 8 s, {where}", float(late[:, 1].mean()), 0.0))
        checks.append(reported(f"change since 4 to 6 s, {where}", float(late[:, 1].mean() - middle[:, 1].mean()), 0.0))
        checks.append(reported(f"drag at 6 to 8 s, {where}", float(late[:, 2].mean()), float("nan"), "N"))
    return checks


CASES: tuple[Case, ...] = (
    Case("far-field-waves", "Waves that the window's sides send back, by length", waves, 0.3),
    Case("far-field-current", "Waves sent back with and against a current", waves_in_current, 0.6, slow=True),
    Case("far-field-angles", "Waves sent back that meet the sides at an angle", oblique_waves, 1.5, slow=True),
    Case("far-field-drift", "Level and volume 10 s after a disturbance", drift, 0.1),
    Case("far-field-body", "Water that a box in a current gathers in the window (reported)", body, 2.0, slow=True),
)
