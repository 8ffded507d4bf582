"""The sides of the window: far field or walls across x and y, the bed below, air above.

In the far field the water is drawn towards the undisturbed current and its still level, in zones that absorb waves.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import prange
from numpy.typing import NDArray

from exumob.flow.active_rows import ActiveRows
from exumob.flow.grid import HALO, Grid, GridVelocity, Metrics
from exumob.flow.settings import FlowSettings
from exumob.flow.undisturbed import FarVelocity
from exumob.support.arrays import Array
from exumob.support.constants import GRAVITY
from exumob.support.kernels import njit

ALONG_THE_SIDE = 0.01
"""Least share of a side's rates that acts along it [-]: a perfectly matched layer has none, but then steady currents
along the side, and what they pile up, would stay."""
SLOWEST = 0.25
"""Least speed of waves that leave against the current, over sqrt(g depth), for which a zone's rates are made [-]"""


class Sides(NamedTuple):
    """Kinds of the window's sides."""

    far_x: bool
    far_y: bool
    """The sides across x and across y are far field; walls otherwise"""
    closed_top: bool
    """The top is a wall; air otherwise"""


class Basin(NamedTuple):
    """The undisturbed water between its surface and the bed."""

    level: float
    """Height of the still surface [m]"""
    bed: Array
    """Height of the bed below the columns of cells [m], shape (ny, nx)"""


class FlowAlongY(NamedTuple):
    """The flow along y that brings water to the columns of the zones; fields of shape (ny, nz, nx)."""

    velocity: Array
    """Along y, on the low y faces [m/s]"""
    fraction: Array
    """[-]"""
    open_faces: Array
    """Area fractions of the low y faces [-]"""
    far: Array
    """Undisturbed velocity along y, on the low y faces of the columns [m/s], shape (ny, nx)"""


class Rates(NamedTuple):
    """Rates at which the far field draws the water towards still water or the current [1/s], halo included.

    Velocity components are taken on their faces: a rate half a cell off reflects waves and tells low sides from high.
    """

    x: Array
    """Rate of the sides across x at the cells' centres along x"""
    y: Array
    """The same of the sides across y, along y"""
    x_faces: Array
    y_faces: Array
    """The same at the cells' low faces"""
    along_x: float
    """Share of the rates of the sides across x that acts along these sides [-]"""
    along_y: float


def absorbing_rates(
    metrics: Metrics, far: tuple[bool, bool], flow: Array, celerity: float, width: float, strength: float
) -> Rates:
    """Rates of the zones before the far sides.

    They rise with the cube of the way into the zone, and are less where waves leave against the current and stay in
    the zone for longer. The zones are matched layers (`relax_level`) as long as the flow through the side is slow
    beside the waves; in a current, waves with phase and group velocities of opposite signs would grow in these (Hu,
    J. Comput. Phys. 173 (2001) 455), and everything is damped alike.

    Parameters
    ----------
    far : two bools
        Whether the sides across x and across y are far field.
    flow : array, shape (2,)
        Undisturbed flow relative to the grid [m/s].
    celerity : float
        sqrt(g depth) [m/s].
    width, strength : float
        `FlowSettings.zone_width` [m], `FlowSettings.absorbing_strength` [-].
    """

    def rates(axis: int, places: Array, faces: Array) -> Array:
        low, high = places - faces[HALO], faces[-HALO - 1] - places
        outward = np.where(low < high, -flow[axis], flow[axis])
        speed = np.maximum(celerity + np.minimum(outward, 0.0), SLOWEST * celerity)
        into = np.clip(1.0 - np.minimum(low, high) / width, 0.0, 1.0)
        return far[axis] * strength / width * speed * into**3

    along = ALONG_THE_SIDE + (1.0 - ALONG_THE_SIDE) * np.minimum(np.abs(flow) / celerity, 1.0) ** 2
    return Rates(
        rates(0, metrics.xc, metrics.xf), rates(1, metrics.yc, metrics.yf), rates(0, metrics.xf, metrics.xf),
        rates(1, metrics.yf, metrics.yf), float(along[0]), float(along[1]),
    )  # fmt: skip


def level_fractions(metrics: Metrics, level: float) -> Array:
    """Fraction of each layer below a level [m], shape (nz,)."""
    return np.clip((level - metrics.zf[:-1]) / metrics.dz, 0.0, 1.0)


class FarField:
    """The window's sides, and the zones before those that are far field.

    Parameters
    ----------
    grid : Grid
    level : float
        Height of still water [m].
    bed_heights : array, shape (ny, nx)
        Heights of the bed [m]; kept, as a given bed moves below the grid.
    settings : FlowSettings
    """

    def __init__(self, grid: Grid, level: float, bed_heights: Array, settings: FlowSettings) -> None:
        self.metrics, self.settings = grid.metrics, settings
        self.sides = Sides(settings.far_x, settings.far_y, settings.closed_top)
        self.basin = Basin(level, bed_heights)
        self.still = level_fractions(self.metrics, level)
        self._celerity = math.sqrt(GRAVITY * max(level - float(grid.z_faces[0]), grid.smallest_width))
        self._added = np.zeros(grid.padded_shape[0])
        self.set_flow(np.zeros(2))

    @property
    def is_there(self) -> bool:
        """True if any side is far field."""
        return self.sides.far_x or self.sides.far_y

    def set_flow(self, relative: Array) -> None:
        """Make the rates of the zones for an undisturbed flow relative to the grid [m/s], shape (2,)."""
        s = self.settings
        self.rates = absorbing_rates(
            self.metrics, (s.far_x, s.far_y), relative, self._celerity, s.zone_width, s.absorbing_strength
        )  # fmt: skip

    @property
    def zone(self) -> NDArray[np.bool_]:
        """Columns in the absorbing zones, shape (ny, nx)."""
        zone = np.maximum.outer(self.rates.y, self.rates.x) > 0.0
        zone[:HALO], zone[-HALO:], zone[:, :HALO], zone[:, -HALO:] = False, False, False, False
        return zone

    def fill_fraction(self, fraction: Array) -> None:
        """Set the halo of the fraction [-]."""
        fill_fraction(fraction, self.still, self.sides)

    def fill_velocity(self, velocity: tuple[Array, Array, Array], far: FarVelocity) -> None:
        """Set the velocity on the sides and in the halo; `far`: undisturbed."""
        fill_velocity(velocity, far, self.sides)

    def relax_velocity(
        self, velocity: tuple[Array, Array, Array], far: FarVelocity, dt: float, rows: ActiveRows
    ) -> None:  # fmt: skip
        """Draw the velocity in the zones towards the undisturbed flow [m/s]."""
        if self.is_there:
            relax_velocity(velocity[0], velocity[1], far, self.rates, dt, rows)

    def gather_rise(self, eta_y: Array, flow: FlowAlongY, grid_velocity: GridVelocity, dt: float) -> None:
        """Add to `eta_y` [m] what flow along y brings to the columns of the zones."""
        if self.is_there:
            gather_rise(eta_y, flow, grid_velocity, self.basin, self.rates, dt, self.metrics)

    def split_rise(self, fraction: Array, eta_y: Array) -> None:
        """Set `eta_y` [m] of water that was set from outside."""
        split_rise(fraction, self.basin, self.rates, self.metrics, eta_y)

    def relax_level(self, fraction: Array, eta_y: Array, dt: float) -> float:
        """Draw the level in the zones towards still water; volume that this adds to the window [m^3]."""
        if not self.is_there:
            return 0.0
        relax_level(fraction, eta_y, self.basin, self.rates, dt, self.metrics, self._added)
        self.fill_fraction(fraction)
        return float(np.sum(self._added[HALO:-HALO]))


@njit(cache=True, error_model="numpy")
def fill_fraction(fraction: Array, still: Array, sides: Sides) -> None:
    """Set the halo of the fraction: still water at far sides, a mirror at walls, bed and top.

    Parameters
    ----------
    fraction : array, changed
        [-]
    still : array, shape (nz,)
        Fraction of each layer in still water.
    sides : Sides
    """
    far_x, far_y, _ = sides
    ny, nz, nx = fraction.shape
    for n in range(HALO):
        low, low_in, high_n, high_in = HALO - 1 - n, HALO + n, n, -1 - n
        for j in range(ny):
            for k in range(nz):
                a, b = nx - HALO + high_n, nx - HALO + high_in
                fraction[j, k, low] = still[k] if far_x else fraction[j, k, low_in]
                fraction[j, k, a] = still[k] if far_x else fraction[j, k, b]
        for k in range(nz):
            a, b = ny - HALO + high_n, ny - HALO + high_in
            for i in range(nx):
                fraction[low, k, i] = still[k] if far_y else fraction[low_in, k, i]
                fraction[a, k, i] = still[k] if far_y else fraction[b, k, i]
        for j in range(ny):
            a, b = nz - HALO + high_n, nz - HALO + high_in
            for i in range(nx):
                fraction[j, low, i] = fraction[j, low_in, i]
                fraction[j, a, i] = fraction[j, b, i]


@njit(cache=True, error_model="numpy")
def fill_velocity(velocity: tuple[Array, Array, Array], far: FarVelocity, sides: Sides) -> None:
    """Set the velocity on the window's sides and in the halo.

    Far sides carry the undisturbed flow `far`; walls, the bed and a closed top let
    nothing through and slip freely; an open top repeats the layer below.
    """
    (u, v, w), (far_x, far_y, closed_top) = velocity, sides
    along_x, along_y = far
    ny, nz, nx = u.shape
    for j in range(ny):
        for k in range(nz):
            if far_x:
                for n in range(HALO):
                    u[j, k, n], v[j, k, n], w[j, k, n] = along_x[j, n], along_y[j, n], 0.0
                    m = nx - HALO + n
                    u[j, k, m], v[j, k, m], w[j, k, m] = along_x[j, m], along_y[j, m], 0.0
                u[j, k, HALO] = along_x[j, HALO]
            else:
                u[j, k, HALO], u[j, k, nx - HALO] = 0.0, 0.0
                u[j, k, 1], u[j, k, 0] = -u[j, k, HALO + 1], -u[j, k, HALO + 2]
                u[j, k, nx - 1] = -u[j, k, nx - HALO - 1]
                for n in range(HALO):
                    a, b = HALO - 1 - n, HALO + n
                    v[j, k, a], w[j, k, a] = v[j, k, b], w[j, k, b]
                    a, b = nx - HALO + n, nx - HALO - 1 - n
                    v[j, k, a], w[j, k, a] = v[j, k, b], w[j, k, b]
    for k in range(nz):
        for i in range(nx):
            if far_y:
                for n in range(HALO):
                    u[n, k, i], v[n, k, i], w[n, k, i] = along_x[n, i], along_y[n, i], 0.0
                    m = ny - HALO + n
                    u[m, k, i], v[m, k, i], w[m, k, i] = along_x[m, i], along_y[m, i], 0.0
                v[HALO, k, i] = along_y[HALO, i]
            else:
                v[HALO, k, i], v[ny - HALO, k, i] = 0.0, 0.0
                v[1, k, i], v[0, k, i] = -v[HALO + 1, k, i], -v[HALO + 2, k, i]
                v[ny - 1, k, i] = -v[ny - HALO - 1, k, i]
                for n in range(HALO):
                    a, b = HALO - 1 - n, HALO + n
                    u[a, k, i], w[a, k, i] = u[b, k, i], w[b, k, i]
                    a, b = ny - HALO + n, ny - HALO - 1 - n
                    u[a, k, i], w[a, k, i] = u[b, k, i], w[b, k, i]
    sign = -1.0 if closed_top else 1.0
    for j in range(ny):
        for i in range(nx):
            w[j, HALO, i] = 0.0
            w[j, 1, i], w[j, 0, i] = -w[j, HALO + 1, i], -w[j, HALO + 2, i]
            if closed_top:
                w[j, nz - HALO, i] = 0.0
            w[j, nz - 1, i] = sign * w[j, nz - HALO - 1, i]
            for n in range(HALO):
                a, b = HALO - 1 - n, HALO + n
                u[j, a, i], v[j, a, i] = u[j, b, i], v[j, b, i]
                a, b = nz - HALO + n, nz - HALO - 1 - n
                u[j, a, i], v[j, a, i] = u[j, b, i], v[j, b, i]


@njit(cache=True, error_model="numpy", parallel=True)
def relax_velocity(u: Array, v: Array, far: FarVelocity, rates: Rates, dt: float, rows: ActiveRows) -> None:
    """Draw the horizontal velocity towards the undisturbed flow, implicitly; the vertical one follows the pressure."""
    ny, nz, nx = u.shape
    lo, hi = rows
    far_u, far_v = far
    x, y, x_faces, y_faces, along_x, along_y = rates
    for j in prange(HALO, ny - HALO + 1):
        for k in range(HALO, nz - HALO):
            for i in range(max(lo[j, k], HALO), min(hi[j, k], nx - HALO + 1)):
                if max(x[i], y[j], x_faces[i], y_faces[j]) > 0.0:
                    a, b = far_u[j, i], far_v[j, i]
                    u[j, k, i] = a + (u[j, k, i] - a) / (1.0 + dt * (x_faces[i] + along_y * y[j]))
                    v[j, k, i] = b + (v[j, k, i] - b) / (1.0 + dt * (y_faces[j] + along_x * x[i]))


@njit(cache=True, error_model="numpy", inline="always")
def _rise(fraction: Array, basin: Basin, j: int, i: int, metrics: Metrics) -> tuple[int, float]:
    """First cell of a column that counts, the one that holds the bed, and the rise above still water [m]."""
    level, bed = basin.level, basin.bed[j, i]
    nz = fraction.shape[1]
    lowest = HALO
    while lowest < nz - HALO - 1 and metrics.zf[lowest + 1] <= bed:
        lowest += 1
    height = metrics.zf[lowest]
    for k in range(lowest, nz - HALO):
        height += fraction[j, k, i] * metrics.dz[k]
    return lowest, height - max(level, metrics.zf[lowest])


@njit(cache=True, error_model="numpy", parallel=True)
def gather_rise(
    eta_y: Array, flow: FlowAlongY, grid_velocity: GridVelocity, basin: Basin, rates: Rates, dt: float, metrics: Metrics
) -> None:
    """Add what flow along y brings to the columns of the zones in one step: disturbances alone.

    The undisturbed current brings nothing, though over a sloping bed it flows in along one axis and out along the
    other; it carries the disturbed level along.

    Parameters
    ----------
    eta_y : array, shape (ny, nx), changed
        Part of the level's rise above still water that flow along y brought [m].
    flow : FlowAlongY
    grid_velocity : GridVelocity
    basin : Basin
    rates : Rates
    dt : float
        [s]
    metrics : Metrics
    """
    v, fraction, open_faces, far = flow
    ny, nz, nx = v.shape
    for j in prange(HALO, ny - HALO):
        brought = np.zeros(nx)
        for k in range(HALO, nz - HALO):
            if not np.any(fraction[j, k] > 0.0):
                continue
            share = 0.5 * dt * metrics.dz[k] / metrics.dy[j]
            c, low, high = fraction[j, k], fraction[j - 1, k], fraction[j + 1, k]
            v_low, v_high, open_low, open_high = v[j, k], v[j + 1, k], open_faces[j, k], open_faces[j + 1, k]
            for i in range(HALO, nx - HALO):
                gain = (low[i] + c[i]) * open_low[i] * (v_low[i] - far[j, i])
                brought[i] += share * (gain - (high[i] + c[i]) * open_high[i] * (v_high[i] - far[j + 1, i]))
        for i in range(HALO, nx - HALO):
            if max(rates.x[i], rates.y[j]) <= 0.0:
                continue
            eta_y[j, i] += brought[i]
            along = 0.5 * (far[j, i] + far[j + 1, i]) - grid_velocity.y - grid_velocity.yaw_rate * metrics.xc[i]
            if along != 0.0:
                before = j - 1 if along > 0.0 else j + 1
                here = _rise(fraction, basin, j, i, metrics)[1]
                there = _rise(fraction, basin, before, i, metrics)[1]
                eta_y[j, i] -= dt * abs(along) * (here - there) / metrics.ey[max(j, before)]


@njit(cache=True, error_model="numpy")
def split_rise(fraction: Array, basin: Basin, rates: Rates, metrics: Metrics, eta_y: Array) -> None:
    """Ascribe the level's rise to flow along x and along y, in proportion to the rates of the sides across them.

    For water that was set from outside: nothing is known of the flow that raised it.
    """
    ny, _, nx = fraction.shape
    for j in range(HALO, ny - HALO):
        for i in range(HALO, nx - HALO):
            both = rates.x[i] + rates.y[j]
            eta_y[j, i] = 0.0
            if both > 0.0:
                eta_y[j, i] = rates.y[j] / both * _rise(fraction, basin, j, i, metrics)[1]


@njit(cache=True, error_model="numpy", parallel=True)
def relax_level(
    fraction: Array, eta_y: Array, basin: Basin, rates: Rates, dt: float, metrics: Metrics, added: Array
) -> None:
    """Draw the level of whole columns towards still water: fill the lowest gap or drain the top, cell after cell.

    What flow along x brought falls at the rate of the sides across x, what flow along y brought at that of the others.
    So are the velocities drawn (`relax_velocity`): the matched layer of Berenger (J. Comput. Phys. 114 (1994) 185) for
    long waves, which sends nothing back at any angle. A column begins with the cell that holds the bed; where this
    lies above still water, the column is drained.

    Parameters
    ----------
    fraction : array, changed
        [-]
    eta_y : array, shape (ny, nx), changed
        Part of the level's rise that flow along y brought [m].
    basin : Basin
    rates : Rates
    dt : float
        [s]
    metrics : Metrics
    added : array, shape (ny,), changed
        Volume added per row j [m^3].
    """
    ny, nz, nx = fraction.shape
    x, y, along_x, along_y = rates.x, rates.y, rates.along_x, rates.along_y
    for j in prange(HALO, ny - HALO):
        volume = 0.0
        for i in range(HALO, nx - HALO):
            if max(x[i], y[j]) <= 0.0:
                continue
            lowest, rise = _rise(fraction, basin, j, i, metrics)
            by_x = (rise - eta_y[j, i]) / (1.0 + dt * (x[i] + along_y * y[j]))
            by_y = eta_y[j, i] / (1.0 + dt * (y[j] + along_x * x[i]))
            eta_y[j, i] = by_y
            change = by_x + by_y - rise
            volume += change * metrics.dx[i] * metrics.dy[j]
            if change > 0.0:
                for k in range(lowest, nz - HALO):
                    taken = min(change, max(1.0 - fraction[j, k, i], 0.0) * metrics.dz[k])
                    fraction[j, k, i] += taken / metrics.dz[k]
                    change -= taken
                    if change <= 0.0:
                        break
            else:
                for k in range(nz - HALO - 1, lowest - 1, -1):
                    taken = min(-change, fraction[j, k, i] * metrics.dz[k])
                    fraction[j, k, i] -= taken / metrics.dz[k]
                    change += taken
                    if change >= 0.0:
                        break
        added[j] = volume
