"""Extension of the velocity to where the projection sets none or a poor one: air, solids, faces hardly open."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import prange
from numpy.typing import NDArray

from exumob.flow.active_rows import WaterCells
from exumob.flow.area_fractions import AreaFractions
from exumob.flow.forces import add_wrench
from exumob.flow.grid import HALO, Metrics
from exumob.flow.poses import PlacedSolids, body_velocity, cells_near
from exumob.support.arrays import Array
from exumob.support.constants import GRAVITY
from exumob.support.kernels import njit

TRUSTED = 0.5
"""Faces at least this open keep their own velocity and give it to their neighbours [-]."""
BLENDED = 0.7
"""Faces less open than this are drawn towards the slip velocity [-]."""
HARDLY_OPEN = 0.05
"""Faces less open than this by the solids' walls count less as closed by an edge [-]."""
BLEND_RATE = 50.0
"""... at BLEND_RATE [(BLENDED - beta) / beta]^2, beta the area fraction, at a reference length of 1 m [1/s]."""
MET = 4.0
"""A wall at an edge is wholly met by water of which one over this of the speed goes through it, partly below [-]."""
LEFT = 10.0
"""A smooth wall is wholly left by water of which one over this of the speed moves away from it, partly below [-]."""
LAYERS = 3
"""Faces beyond the water to which the velocity is extended."""
REACH = LAYERS + 1
"""Cells round the water whose velocity is kept up."""
FASTEST_FALL = 3.0
"""Largest speed at which water too thin to be resolved falls, at a reference length of 1 m [m/s]."""
NO_BED = -2
"""Number of a given bed where there is none; -1 is that of no solid at all."""
OUTSIDE = np.uint8(255)
"""Label of faces that have no velocity of their own: the halo, and what is far from any water."""


@njit(cache=True, error_model="numpy", parallel=True)
def extend(
    e: Array, q: Array, cells: WaterCells, area_fractions: AreaFractions, axis: int, far: Array, dt: float,
    label: NDArray[np.uint8], fastest_fall: float,
) -> None:  # fmt: skip
    """Extend one velocity component `LAYERS` faces into air and solids by averages of known neighbours.

    Faces not reached keep falling if there is water in them and take the undisturbed flow otherwise; their extended
    value is nan, so that nothing takes it for the water's near by.

    Parameters
    ----------
    e : array, changed
        The extended component [m/s].
    q : array, changed
        The component [m/s]; takes the extended values where the projection set none.
    cells : WaterCells
        `near` is `REACH` cells wider than the water.
    area_fractions : AreaFractions
    axis : int
        Axis of the component: 0 x, 1 y, 2 z.
    far : array, shape (ny, nx)
        Undisturbed flow [m/s].
    dt : float
        [s]
    label : array, changed
        0 unknown, 1 known, 2 and more extended, `OUTSIDE`.
    fastest_fall : float
        Largest speed at which water too thin to be resolved falls [m/s].
    """
    ny, nz, nx = e.shape
    sy, sz = np.uintp(nz * nx), np.uintp(nx)
    one = np.uintp(1)
    own = one if axis == 0 else (sy if axis == 1 else sz)
    value, given, c, is_wet = e.ravel(), q.ravel(), cells.fraction.ravel(), cells.wet.ravel()
    o = area_fractions
    beta, mark = (o.bx if axis == 0 else (o.by if axis == 1 else o.bz)).ravel(), label.ravel()
    lo, hi = cells.near
    drop = GRAVITY * dt if axis == 2 else 0.0
    unknown, labelled = np.zeros((ny, nz), dtype=np.int32), np.zeros((ny, nz), dtype=np.int32)
    for j in prange(ny):
        for k in range(nz):
            start = (j * nz + k) * nx
            for i in range(start, start + nx):
                mark[np.uintp(i)] = OUTSIDE
            if j < HALO or k < HALO or j >= ny - HALO + (axis == 1) or k >= nz - HALO + (axis == 2):
                continue
            outer = (axis == 1 and (j == HALO or j == ny - HALO)) or (axis == 2 and (k == HALO or k == nz - HALO))
            other = OUTSIDE if outer else np.uint8(0)
            first, last = max(lo[j, k], HALO), min(hi[j, k], nx - HALO + (axis == 0))
            missing = 0
            for i in range(start + first, start + last):
                p = np.uintp(i)
                value[p] = given[p]
                known = (is_wet[p] | is_wet[p - own]) != 0 and beta[p] >= TRUSTED
                mark[p] = np.uint8(1) if known else other
                missing += 0 if known else 1
            if axis == 0 and first < last:
                for i in (HALO, nx - HALO):
                    p = np.uintp(start + i)
                    if first <= i < last and mark[p] == 0:
                        mark[p] = OUTSIDE
            unknown[j, k], labelled[j, k] = missing, max(last - first, 0) - missing
    for layer in range(2, 2 + LAYERS):
        for j in prange(HALO, ny - HALO):  # labels of this very layer count as unknown: the order does not matter
            averages, labels = np.empty(nx), np.empty(nx, dtype=np.uint8)
            for k in range(HALO, nz - HALO):
                around = labelled[j - 1, k] + labelled[j + 1, k] + labelled[j, k - 1] + labelled[j, k + 1]
                if unknown[j, k] == 0 or around + labelled[j, k] == 0:
                    continue
                first, last = max(lo[j, k], HALO), min(hi[j, k], nx - HALO)
                start = (j * nz + k) * nx + first
                labelled[j, k] += _average_row(value, mark, start, last - first, (sy, sz), layer, (averages, labels))
    for j in prange(HALO, ny - HALO):
        for k in range(HALO, nz - HALO):
            if unknown[j, k] == 0:
                continue
            start = (j * nz + k) * nx
            for i in range(start + max(lo[j, k], HALO), start + min(hi[j, k], nx - HALO)):
                p = np.uintp(i)
                here, label_here = value[p], mark[p]
                fallen = here - drop
                fallen = fallen if fallen > -fastest_fall or axis != 2 else -fastest_fall
                alone = fallen if c[p] > 0.0 or c[p - own] > 0.0 else far[j, i - start]
                value[p] = np.nan if label_here == 0 else here
                projected = (is_wet[p] | is_wet[p - own]) != 0 and beta[p] > 0.0
                here = alone if label_here == 0 else here
                given[p] = given[p] if projected or label_here == OUTSIDE else here


@njit(cache=True, error_model="numpy", inline="always")
def _pair(q: Array, mark: NDArray[np.uint8], low: int, high: int, lowest: int) -> tuple[float, float]:
    """Sum and number of the two faces that carry labels 1 to `lowest`."""
    a = np.uint8(mark[low] - np.uint8(1)) < lowest
    b = np.uint8(mark[high] - np.uint8(1)) < lowest
    total = (q[low] if a else 0.0) + (q[high] if b else 0.0)  # not a product: nan where nothing reached
    return total, (1.0 if a else 0.0) + (1.0 if b else 0.0)


@njit(cache=True, error_model="numpy")
def _average_row(
    q: Array, mark: NDArray[np.uint8], start: int, n: int, strides: tuple[np.uintp, np.uintp], layer: int,
    work: tuple[Array, NDArray[np.uint8]],
) -> int:  # fmt: skip
    """Give unknown faces of a row the mean of their neighbours of lower layers, if there are any, and a label.

    Returns how many got one. Pairs are added first, so that mirrored flows stay mirrored to the last bit.
    """
    (sy, sz), (averages, labels) = strides, work
    one, lowest, count = np.uintp(1), np.uint8(layer - 1), 0
    for m in range(n):
        p = np.uintp(start + m)
        z_sum, z_weight = _pair(q, mark, p - sz, p + sz, lowest)
        y_sum, y_weight = _pair(q, mark, p - sy, p + sy, lowest)
        x_sum, x_weight = _pair(q, mark, p - one, p + one, lowest)
        total, weight = (z_sum + y_sum) + x_sum, (z_weight + y_weight) + x_weight
        reached = mark[p] == 0 and weight > 0.0
        averages[m] = total / (weight if reached else 1.0) if reached else q[p]
        labels[m] = np.uint8(layer) if reached else mark[p]
        count += 1 if reached else 0
    for m in range(n):
        p = np.uintp(start + m)
        q[p] = averages[m]
        mark[p] = labels[m]
    return count


class Blending(NamedTuple):
    """The velocity that `blend` changes, and the water that had it after the last step."""

    velocity: tuple[Array, Array, Array]
    """Changed [m/s]"""
    extended: tuple[Array, Array, Array]
    """Extended velocity [m/s]; nan where the extension does not reach"""
    wet: NDArray[np.uint8]
    """1 in cells that were wet"""
    density: float
    """[kg/m^3]"""
    dt: float
    """Step to come [s]"""
    rate: float
    """`BLEND_RATE` at the reference length [1/s]"""
    left: float
    """`LEFT`; 0 if water slips along smooth walls wherever it moves [-]"""


@njit(cache=True, error_model="numpy", parallel=True)
def blend(
    blending: Blending, area_fractions: AreaFractions, bodies: AreaFractions, solids: PlacedSolids, bed: int,
    metrics: Metrics,
) -> Array:  # fmt: skip
    """Draw small open faces towards the extended velocity without its part through the wall; set closed ones to it.

    u = (u + rate dt u_slip) / (1 + rate dt) with rate = `Blending.rate` [(0.7 - beta) / beta]^2, beta the area
    fraction: a face that is hardly open has hardly any water of its own. What momentum this takes is given to the
    solid. Where the extension does not reach, nothing changes: fed by its own result, step by step, spray beside a
    curved wall would gather speed. Only in the wedge between a given bed and what rolls over it, which water leaves by
    faces hardly open alone, is it drawn towards the walls' own velocity instead: a film that is squeezed sticks to
    them.

    Faces that a sharp edge closes take what its walls impose, but for the part along the edge: on a wall the solid's
    velocity, half a cell behind it the slip velocity mirrored at that, 2 u_solid - u_slip, as without slip, and
    mirrored on walls, too, which water meets from outside. What the advection carries past the edge then has the
    solid's velocity at the wall, and the flow separates there; with the slip velocity momentum would leak round the
    edge, the shear layer into the wake with it, and water would rise behind a transom.

    With `Blending.left` smooth walls that water moves away from impose the same. Along such a wall the water becomes
    slower (what moves away must come from somewhere), which a boundary layer does not follow far: it leaves the wall
    soon after the place of the lowest pressure (Schlichting & Gersten, Boundary-Layer Theory).

    Parameters
    ----------
    blending : Blending
    area_fractions, bodies : AreaFractions
        Of solids and a given bed, and of the solids alone.
    solids : PlacedSolids
        The solids and, last, a given bed.
    bed : int
        Number of a given bed among them, or `NO_BED`.
    metrics : Metrics

    Returns
    -------
    array, shape (n, 6)
        The slip momentum per second: force [N] and moment [N m] about the solids' origins, grid axes.
    """
    velocity, extended, wet, density, dt, rate, left = blending  # parallel loops take no record inside another
    ny = wet.shape[0]
    wrenches = np.zeros((len(solids.regions), 6))
    for n in range(len(solids.regions)):
        rows = np.zeros((ny, 6))
        (j0, j1), _, _ = cells_near(solids.regions, n, wet.shape)
        for j in prange(j0, j1):
            here = Blending(velocity, extended, wet, density, dt, rate, left)
            _blend_row(j, n, here, area_fractions, bodies, solids, bed, metrics, rows[j])
        for j in range(ny):
            for m in range(6):
                wrenches[n, m] += rows[j, m]
    return wrenches


@njit(cache=True, error_model="numpy")
def _blend_row(
    j: int, n: int, blending: Blending, area_fractions: AreaFractions, bodies: AreaFractions, solids: PlacedSolids,
    bed: int, metrics: Metrics, wrench: Array,
) -> None:  # fmt: skip
    """Row j of `blend` for solid n."""
    velocity, extended, wet, density, dt, rate, left = blending
    o, position = area_fractions, solids.position[n]
    d = o.distance
    _, (k0, k1), (i0, i1) = cells_near(solids.regions, n, wet.shape)
    for k in range(k0, k1):
        for i in range(i0, i1):
            widest = max(metrics.dx[i], metrics.dy[j], metrics.dz[k])
            if not -4.0 * widest < d[j, k, i] < 2.0 * widest:
                continue
            for axis in range(3):
                beta = o.bx[j, k, i] if axis == 0 else (o.by[j, k, i] if axis == 1 else o.bz[j, k, i])
                if beta >= BLENDED or (axis == 2 and k == HALO):
                    continue
                jb, kb, ib = j - (axis == 1), k - (axis == 2), i - (axis == 0)
                owner = o.nearest[j, k, i] if d[j, k, i] <= d[jb, kb, ib] else o.nearest[jb, kb, ib]
                if owner != n:
                    continue
                gx = _slope(d, (j, k, i), (jb, kb, ib), 0, metrics)
                gy = _slope(d, (j, k, i), (jb, kb, ib), 1, metrics)
                gz = _slope(d, (j, k, i), (jb, kb, ib), 2, metrics)
                norm = math.sqrt(gx * gx + gy * gy + gz * gz)
                if not 1e-3 < norm < 1e2:
                    continue
                gx, gy, gz = gx / norm, gy / norm, gz / norm
                x = (metrics.xf[i] if axis == 0 else metrics.xc[i]) - position[0]
                y = (metrics.yf[j] if axis == 1 else metrics.yc[j]) - position[1]
                z = (metrics.zf[k] if axis == 2 else metrics.zc[k]) - position[2]
                ux, uy, uz = body_velocity(solids, n, x, y, z)
                vx = _at(extended[0], 0, axis, j, k, i) - ux
                vy = _at(extended[1], 1, axis, j, k, i) - uy
                vz = _at(extended[2], 2, axis, j, k, i) - uz
                through = gx * vx + gy * vy + gz * vz
                along = gx if axis == 0 else (gy if axis == 1 else gz)
                target = extended[axis][j, k, i] - along * through
                closed = _closed_by_edge(bodies, axis, j, k, i) if n != bed else 0.0
                leaves = left * through if n != bed else 0.0
                if closed > 0.0 or leaves > 0.0:
                    own = ux if axis == 0 else (uy if axis == 1 else uz)
                    speed = math.sqrt(vx * vx + vy * vy + vz * vz)
                    wide = abs(gx) * metrics.dx[i] + abs(gy) * metrics.dy[j] + abs(gz) * metrics.dz[k]
                    behind = min(max(-(d[j, k, i] + d[jb, kb, ib]) / wide, 0.0), 1.0)
                    if leaves > 0.0:
                        target += (1.0 - closed) * min(leaves / speed, 1.0) * (1.0 + behind) * (own - target)
                    if closed > 0.0:
                        turns = max(_bend(d, axis, (j, k, i), metrics), _bend(d, axis, (jb, kb, ib), metrics))
                        meets = -along * (vx if axis == 0 else (vy if axis == 1 else vz))
                        if meets > 0.0:
                            behind = max(behind, min(MET * meets / speed, 1.0))
                        target += turns * closed * (1.0 + behind) * (own - target)
                if not math.isfinite(target):
                    on_bed = o.nearest[j, k, i] == bed or o.nearest[jb, kb, ib] == bed
                    if not (on_bed or o.nearest[j, k - 1, i] == bed or o.nearest[jb, kb - 1, ib] == bed):
                        continue
                    target = ux if axis == 0 else (uy if axis == 1 else uz)
                if (wet[j, k, i] or wet[jb, kb, ib]) and beta > 0.0:
                    here = velocity[axis][j, k, i]
                    strength = dt * rate * ((BLENDED - beta) / beta) ** 2
                    change = strength / (1.0 + strength) * (target - here)
                    volume = (
                        (metrics.ex[i] if axis == 0 else metrics.dx[i])
                        * (metrics.ey[j] if axis == 1 else metrics.dy[j])
                        * (metrics.ez[k] if axis == 2 else metrics.dz[k])
                    )
                    force = -density * beta * volume * change / dt
                    fx, fy = (force if axis == 0 else 0.0), (force if axis == 1 else 0.0)
                    add_wrench(wrench, (x, y, z), (fx, fy, force if axis == 2 else 0.0))
                    target = here + change
                velocity[axis][j, k, i] = target


@njit(cache=True, error_model="numpy", inline="always")
def _bend(d: Array, axis: int, cell: tuple[int, int, int], m: Metrics) -> float:
    """Change of the distance's slope along `axis` over a cell, at most 1 [-]: 0 where an edge runs along the axis."""
    j, k, i = cell
    here = d[j, k, i]
    if axis == 0:
        return min(abs((d[j, k, i + 1] - here) / m.ex[i + 1] - (here - d[j, k, i - 1]) / m.ex[i]), 1.0)
    if axis == 1:
        return min(abs((d[j + 1, k, i] - here) / m.ey[j + 1] - (here - d[j - 1, k, i]) / m.ey[j]), 1.0)
    return min(abs((d[j, k + 1, i] - here) / m.ez[k + 1] - (here - d[j, k - 1, i]) / m.ez[k]), 1.0)


@njit(cache=True, error_model="numpy", inline="always")
def _closed_by_edge(bodies: AreaFractions, axis: int, j: int, k: int, i: int) -> float:
    """Share of the face (axis; j, k, i) left open by the solids' walls that their sharp edges close [-].

    It goes to nothing with what the walls leave open, so that it does not jump.
    """
    b, a = bodies.bx[j, k, i], bodies.ax[j, k, i]
    if axis == 1:
        b, a = bodies.by[j, k, i], bodies.ay[j, k, i]
    elif axis == 2:
        b, a = bodies.bz[j, k, i], bodies.az[j, k, i]
    return (a - b) / max(a, HARDLY_OPEN)


@njit(cache=True, error_model="numpy", inline="always")
def _slope(d: Array, cell: tuple[int, int, int], before: tuple[int, int, int], axis: int, m: Metrics) -> float:
    """Gradient of the distance along `axis` at the face between a cell (j, k, i) and the one before it."""
    (j, k, i), (jb, kb, ib) = cell, before
    if axis == 0:
        if ib != i:
            return (d[j, k, i] - d[j, k, ib]) / m.ex[i]
        here, there = d[j, k, i + 1] - d[j, k, i - 1], d[jb, kb, i + 1] - d[jb, kb, i - 1]
        return 0.5 * (here + there) / (m.ex[i] + m.ex[i + 1])
    if axis == 1:
        if jb != j:
            return (d[j, k, i] - d[jb, k, i]) / m.ey[j]
        here, there = d[j + 1, k, i] - d[j - 1, k, i], d[j + 1, kb, ib] - d[j - 1, kb, ib]
        return 0.5 * (here + there) / (m.ey[j] + m.ey[j + 1])
    if kb != k:
        return (d[j, k, i] - d[j, kb, i]) / m.ez[k]
    here, there = d[j, k + 1, i] - d[j, k - 1, i], d[jb, k + 1, ib] - d[jb, k - 1, ib]
    return 0.5 * (here + there) / (m.ez[k] + m.ez[k + 1])


@njit(cache=True, error_model="numpy", inline="always")
def _at(q: Array, component: int, axis: int, j: int, k: int, i: int) -> float:
    """Value of a velocity component at the face (axis; j, k, i): its own, or the mean of the four around it.

    Faces that the extension did not reach do not count; nan if it reached none of them.
    """
    if component == axis:
        return q[j, k, i]
    jb, kb, ib = j - (axis == 1), k - (axis == 2), i - (axis == 0)
    ja, ka, ia = component == 1, component == 2, component == 0
    a, b, c, d = q[j, k, i], q[jb + ja, kb + ka, ib + ia], q[jb, kb, ib], q[j + ja, k + ka, i + ia]
    reached_a, reached_b, reached_c, reached_d = a == a, b == b, c == c, d == d
    total = ((a if reached_a else 0.0) + (b if reached_b else 0.0)) + (
        (c if reached_c else 0.0) + (d if reached_d else 0.0)
    )
    return total / (reached_a + reached_b + reached_c + reached_d)
