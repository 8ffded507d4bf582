"""Solids in the flow: signed distance, and from it how far each cell face is open.

The flow knows of a solid its signed distance and normal at a point (`measure`, in the solid's own axes) and its
velocity there (a rigid motion). Faces are partly open (FAVOR: Hirt & Sicilian 1985; Batty, Bertails & Bridson, ACM
Trans. Graph. 26 (2007) 100): the area_fractions is a smooth ramp of the signed distance at the face's centre.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from exumob.flow.grid import Metrics
from exumob.flow.tread import Tread
from exumob.support.arrays import Array
from exumob.support.checks import require_positive, require_within
from exumob.vehicle.motion import BodyStates
from exumob.vehicle.parameters import Hull, Vehicle

SPHERE, BOX, CYLINDER, PRISM, SAMPLED = range(5)
HULL_FRICTION = 0.005
"""Skin-friction coefficient of a hull [-]: turbulent flat plate at Re 3e5 to 2e6 (ITTC 1957: 0.0058 to 0.0041)."""
WHEEL_FRICTION = 0.03
"""Skin-friction coefficient of a treaded tyre [-]: rough plate; a guess, its uncertainty is a factor of two."""
SHARP = 0.5
"""Change of the distance's slopes over a cell (sum over the axes) from which its edge counts as sharp, fully at twice
that [-]; on a sphere it is 2 cells over the radius."""
FAR = 1.0e3
"""Signed distance stored where no solid is near [m]."""


@dataclass(frozen=True)
class Solid:
    """A rigid shape in its own axes.

    Parameters
    ----------
    kind : int
        Which branch of `measure` evaluates it.
    parameters : array
        Of that branch [m].
    low, high : array, shape (3,)
        Bounding box [m].
    friction : float
        Skin-friction coefficient on the speed relative to the surface [-], 0 to 1.
    samples : array, shape (nx, ny, nz)
        Signed distances [m] of a `SAMPLED` solid.
    tread : Tread or None
        Lugs of a spinning `CYLINDER`.
    """

    kind: int
    parameters: Array
    low: Array
    high: Array
    friction: float = 0.0
    samples: Array = field(default_factory=lambda: np.zeros((2, 2, 2)))
    tread: Tread | None = None

    def __post_init__(self) -> None:
        require_within("Solid", 0.0, 1.0, friction=self.friction)
        if self.tread is not None and self.kind != CYLINDER:
            raise ValueError("Solid.tread: only a cylinder can have lugs; leave it None.")

    def distance(self, points: Array) -> Array:
        """Signed distance [m] at points of shape (n, 3) in the solid's axes, < 0 inside."""
        return np.array([measure(self.kind, self.parameters, self.samples, *p)[0] for p in np.atleast_2d(points)])


def sphere(radius: float, friction: float = 0.0) -> Solid:
    """Sphere about the origin; radius [m]."""
    require_positive("sphere", radius=radius)
    corner = np.full(3, radius)
    return Solid(SPHERE, np.array([radius]), -corner, corner, friction)


def box(length: float, width: float, height: float, friction: float = 0.0) -> Solid:
    """Box about the origin with edges along the axes [m]."""
    require_positive("box", length=length, width=width, height=height)
    half = 0.5 * np.array([length, width, height])
    return Solid(BOX, half, -half, half, friction)


def cylinder(radius: float, width: float, edge_radius: float = 0.0, friction: float = WHEEL_FRICTION) -> Solid:
    """Cylinder about the y axis (a wheel) with rounded edges [m]."""
    require_positive("cylinder", radius=radius, width=width)
    require_within(
        "cylinder", 0.0, min(radius, 0.5 * width), "an edge cannot be rounder than the cylinder.",
        edge_radius=edge_radius,
    )  # fmt: skip
    corner = np.array([radius, 0.5 * width, radius])
    return Solid(CYLINDER, np.array([radius, 0.5 * width, edge_radius]), -corner, corner, friction)


def prism(outline: Array, width: float, friction: float = 0.0) -> Solid:
    """Polygon in x, z (counter-clockwise with x to the right and z up; shape (n, 2) [m]), extruded along y [m]."""
    outline = np.asarray(outline, dtype=float)
    require_positive("prism", width=width)
    x, z = outline[:, 0], outline[:, 1]
    area = 0.5 * float(np.sum(x * np.roll(z, -1) - np.roll(x, -1) * z))
    if area <= 0.0:
        raise ValueError(f"prism outline encloses {area:g} m^2; give its corners counter-clockwise in (x, z).")
    low, high = outline.min(axis=0), outline.max(axis=0)
    edges = np.roll(outline, -1, axis=0) - outline
    lengths = np.sum(edges**2, axis=1, keepdims=True)
    if lengths.min() <= 0.0:
        raise ValueError("prism outline has two equal corners in a row; leave one out.")
    parameters = np.concatenate([[0.5 * width], np.hstack([outline, edges, 1.0 / lengths]).ravel()])
    corners = np.array([low[0], -0.5 * width, low[1]]), np.array([high[0], 0.5 * width, high[1]])
    return Solid(PRISM, parameters, *corners, friction)


def hull_prism(hull: Hull, friction: float = HULL_FRICTION) -> Solid:
    """Raked-bow box of a `Hull` about its centre of mass."""
    return prism(hull.side_profile() - [hull.center_of_mass_x, hull.center_of_mass_height], hull.width, friction)


def mesh_solid(triangles: Array, spacing: float, friction: float = HULL_FRICTION) -> Solid:
    """Watertight triangle mesh, sampled once to a grid of signed distances; needs trimesh.

    Parameters
    ----------
    triangles : array, shape (n, 3, 3)
        Corners in the solid's axes [m], counter-clockwise from outside (`exumob.water.mesh_file.mesh_triangles`
        reads and checks a file).
    spacing : float
        Of the samples [m]; half a cell of the flow's grid or less.
    friction : float
        Skin-friction coefficient [-].
    """
    try:
        import trimesh
    except ImportError as error:
        raise ImportError("a mesh in the flow needs the package trimesh: pip install 'exumob[mesh]'.") from error
    require_positive("mesh_solid", spacing=spacing)
    mesh = trimesh.Trimesh(triangles.reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3))
    mesh.merge_vertices()
    if not mesh.is_watertight or mesh.volume <= 0.0:
        raise ValueError("mesh_solid: the mesh is not closed or its faces point inwards; repair it first.")
    low, high = mesh.bounds[0].copy(), mesh.bounds[1].copy()
    start = low - 6.0 * spacing
    counts = np.ceil((high + 6.0 * spacing - start) / spacing).astype(int) + 1
    axes = [start[a] + spacing * np.arange(counts[a]) for a in range(3)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    distances = np.empty(len(points))
    for first in range(0, len(points), 20000):
        part = points[first : first + 20000]
        _, apart, _ = trimesh.proximity.closest_point_naive(mesh, part) if len(triangles) < 200 else (
            trimesh.proximity.closest_point(mesh, part)
        )  # fmt: skip
        distances[first : first + 20000] = np.where(_inside(triangles, part), -apart, apart)
    return Solid(
        SAMPLED, np.concatenate([start, [spacing]]), low, high, friction, distances.reshape(tuple(counts)).copy()
    )


def _inside(triangles: Array, points: Array) -> NDArray[np.bool_]:
    """Whether points lie inside a closed mesh: winding number from solid angles (Van Oosterom & Strackee 1983)."""
    total = np.zeros(len(points))
    for a, b, c in triangles:
        ra, rb, rc = a - points, b - points, c - points
        la, lb, lc = (np.linalg.norm(r, axis=1) for r in (ra, rb, rc))
        volume = np.einsum("ni,ni->n", ra, np.cross(rb, rc))
        dots = [np.einsum("ni,ni->n", p, q) for p, q in ((ra, rb), (rb, rc), (rc, ra))]
        total += 2.0 * np.arctan2(volume, la * lb * lc + dots[0] * lc + dots[1] * la + dots[2] * lb)
    return np.abs(total) > 2.0 * math.pi


def vehicle_solids(vehicle: Vehicle, cell_size: float, tread: Tread | None = None) -> tuple[Solid, ...]:
    """Solids of the five bodies, order of `exumob.vehicle.motion.BODIES`, each about its body's origin.

    Parameters
    ----------
    vehicle : Vehicle
    cell_size : float
        Of the flow's grid [m]; a hull mesh is sampled at half of it.
    tread : Tread or None
        Lugs of the wheels.
    """
    if vehicle.hull.mesh is None:
        hull = hull_prism(vehicle.hull)
    else:
        from exumob.water.mesh_file import mesh_triangles

        hull = mesh_solid(mesh_triangles(vehicle.hull.mesh) - vehicle.hull_origin, 0.5 * cell_size)
    wheel = replace(cylinder(vehicle.wheel.radius, vehicle.wheel.width, 0.1 * vehicle.wheel.width), tread=tread)
    return hull, wheel, wheel, wheel, wheel


@dataclass(frozen=True)
class Poses:
    """Positions and velocities of n solids at one instant, world axes."""

    position: Array
    """Origins [m], shape (n, 3)"""
    rotation: Array
    """Body -> world, shape (n, 3, 3)"""
    velocity: Array
    """Of the origins [m/s], shape (n, 3)"""
    angular_velocity: Array
    """[rad/s], shape (n, 3)"""
    spin: Array
    """Of the surface about the body's own y axis, not part of the angular velocity (a wheel) [rad/s], shape (n,)"""

    @classmethod
    def at_rest(cls, position: Any, rotation: Any = None) -> Poses:
        """Solids that do not move; position [m], shape (n, 3)."""
        position = np.atleast_2d(np.asarray(position, dtype=float))
        n = len(position)
        turned = np.broadcast_to(np.eye(3), (n, 3, 3)).copy() if rotation is None else np.asarray(rotation, dtype=float)
        return cls(position, turned, np.zeros((n, 3)), np.zeros((n, 3)), np.zeros(n))

    @classmethod
    def from_states(cls, states: BodyStates) -> Poses:
        """Last instant of the states of the five bodies."""
        spin = np.concatenate([[0.0], states.wheel_speed[-1]])
        return cls(
            states.position[-1], states.rotation[-1], states.velocity[-1], states.angular_velocity[-1], spin
        )  # fmt: skip


class AreaFractions(NamedTuple):
    """What the solids leave open: per face area_fractions 0 to 1 and solid velocity, per cell distance and nearest solid."""

    bx: Array
    by: Array
    bz: Array
    """AreaFractions of the low x, y, z faces to the flow [-]"""
    ax: Array
    ay: Array
    az: Array
    """The same before edges are sharpened: unbiased, what the weight of still water acts on [-]"""
    sx: Array
    sy: Array
    sz: Array
    """Solid velocity on them, normal component, grid axes [m/s]; spin not included"""
    distance: Array
    """Signed distance of the cell's centre to the nearest solid [m]"""
    nearest: NDArray[np.int8]
    """Its number, -1 if none is near"""

    @classmethod
    def open(cls, shape: tuple[int, int, int]) -> AreaFractions:
        """No solids."""
        bx, by, bz, ax, ay, az = (np.ones(shape) for _ in range(6))
        sx, sy, sz = (np.zeros(shape) for _ in range(3))
        nearest = np.full(shape, -1, dtype=np.int8)
        return cls(bx, by, bz, ax, ay, az, sx, sy, sz, np.full(shape, FAR), nearest)


def clear(area_fractions: AreaFractions, region: NDArray[np.int64]) -> None:
    """Remove all solids from an index box (j0, j1, k0, k1, i0, i1)."""
    j0, j1, k0, k1, i0, i1 = region
    for name, value in zip(AreaFractions._fields, (*6 * (1.0,), 0.0, 0.0, 0.0, FAR, -1), strict=True):
        getattr(area_fractions, name)[j0:j1, k0:k1, i0:i1] = value


def index_region(metrics: Metrics, solid: Solid, position: Array, rotation: Array, margin: float) -> NDArray[np.int64]:
    """Index box (j0, j1, k0, k1, i0, i1; ends exclusive) of the cells within `margin` [m] of a solid's bounding box."""
    middle, half = 0.5 * (solid.low + solid.high), 0.5 * (solid.high - solid.low)
    center = position + rotation @ middle
    extent = np.abs(rotation) @ half + margin
    bounds = []
    for axis, faces in ((1, metrics.yf), (2, metrics.zf), (0, metrics.xf)):
        first = int(np.searchsorted(faces, center[axis] - extent[axis])) - 1
        last = int(np.searchsorted(faces, center[axis] + extent[axis])) + 1
        bounds += [min(max(first, 0), len(faces) - 1), min(max(last, 0), len(faces) - 1)]
    return np.array(bounds, dtype=np.int64)


@njit(cache=True, error_model="numpy")
def measure(
    kind: int, parameters: Array, samples: Array, x: float, y: float, z: float
) -> tuple[float, float, float, float]:
    """Signed distance [m] (< 0 inside) and outward unit normal of a solid at a point of its own axes [m]."""
    if kind == SPHERE:
        r = math.sqrt(x * x + y * y + z * z)
        s = 1.0 / max(r, 1e-300)
        return r - parameters[0], x * s, y * s, z * s
    if kind == BOX:
        ax, ay, az = abs(x) - parameters[0], abs(y) - parameters[1], abs(z) - parameters[2]
        d, nx, ny, nz = _corner(ax, ay, az)
        return d, math.copysign(nx, x), math.copysign(ny, y), math.copysign(nz, z)
    if kind == CYLINDER:
        r = math.sqrt(x * x + z * z)
        edge = parameters[2]
        d, nr, ny, _ = _corner(r - parameters[0] + edge, abs(y) - parameters[1] + edge, -1e30)
        s = nr / max(r, 1e-300)
        return d - edge, s * x, math.copysign(ny, y), s * z
    if kind == PRISM:
        d, nx, nz = _polygon(parameters, x, z)
        d, n2, ny, _ = _corner(d, abs(y) - parameters[0], -1e30)
        return d, n2 * nx, math.copysign(ny, y), n2 * nz
    return _sampled(parameters, samples, x, y, z)


@njit(cache=True, error_model="numpy")
def _corner(a: float, b: float, c: float) -> tuple[float, float, float, float]:
    """Distance and normal (absolute) of the intersection of three half spaces at signed distances a, b, c."""
    pa, pb, pc = max(a, 0.0), max(b, 0.0), max(c, 0.0)
    d = math.sqrt(pa * pa + pb * pb + pc * pc)
    if d > 0.0:
        return d, pa / d, pb / d, pc / d
    if a >= b and a >= c:
        return a, 1.0, 0.0, 0.0
    if b >= c:
        return b, 0.0, 1.0, 0.0
    return c, 0.0, 0.0, 1.0


@njit(cache=True, error_model="numpy")
def _polygon(parameters: Array, x: float, z: float) -> tuple[float, float, float]:
    """Signed distance and outward normal of a counter-clockwise polygon."""
    best, bx, bz, inside = 1e300, 0.0, 0.0, False
    ex, ez = 0.0, 0.0
    for m in range(1, len(parameters), 5):  # corner, edge, inverse square of its length
        x0, z0, tx, tz = parameters[m], parameters[m + 1], parameters[m + 2], parameters[m + 3]
        px, pz = x - x0, z - z0
        part = (px * tx + pz * tz) * parameters[m + 4]
        part = min(max(part, 0.0), 1.0)
        if (pz >= 0.0) != (pz >= tz) and (px * tz < pz * tx) == (tz > 0.0):
            inside = not inside
        px, pz = px - part * tx, pz - part * tz
        d2 = px * px + pz * pz
        if d2 < best:
            best, bx, bz, ex, ez = d2, px, pz, tz, -tx
    d = math.sqrt(best)
    if d < 1e-12:
        s = 1.0 / math.sqrt(ex * ex + ez * ez)
        return 0.0, s * ex, s * ez
    if inside:
        return -d, -bx / d, -bz / d
    return d, bx / d, bz / d


@njit(cache=True, error_model="numpy")
def _sampled(parameters: Array, samples: Array, x: float, y: float, z: float) -> tuple[float, float, float, float]:
    """Trilinear interpolation of sampled distances; beyond the samples, the distance to them is added."""
    h = parameters[3]
    n0, n1, n2 = samples.shape
    px, py, pz = (x - parameters[0]) / h, (y - parameters[1]) / h, (z - parameters[2]) / h
    qx, qy, qz = min(max(px, 0.0), n0 - 1.001), min(max(py, 0.0), n1 - 1.001), min(max(pz, 0.0), n2 - 1.001)
    a, b, c = int(qx), int(qy), int(qz)
    fx, fy, fz = qx - a, qy - b, qz - c
    d, gx, gy, gz = 0.0, 0.0, 0.0, 0.0
    for l in range(2):  # noqa: E741
        wx, sx = (fx, 1.0) if l else (1.0 - fx, -1.0)
        for m in range(2):
            wy, sy = (fy, 1.0) if m else (1.0 - fy, -1.0)
            for n in range(2):
                wz, sz = (fz, 1.0) if n else (1.0 - fz, -1.0)
                value = samples[a + l, b + m, c + n]
                d += wx * wy * wz * value
                gx += sx * wy * wz * value
                gy += wx * sy * wz * value
                gz += wx * wy * sz * value
    norm = max(math.sqrt(gx * gx + gy * gy + gz * gz), 1e-300)
    away = h * math.sqrt((px - qx) ** 2 + (py - qy) ** 2 + (pz - qz) ** 2)
    return d + away, gx / norm, gy / norm, gz / norm


@njit(cache=True, error_model="numpy", inline="always")
def _distance_in_widths(
    kind: int,
    parameters: Array,
    samples: Array,
    r: Array,
    x: float,
    y: float,
    z: float,
    dx: float,
    dy: float,
    dz: float,
) -> tuple[float, float]:
    """Signed distance of a point (grid axes, from the solid's origin) in metres and in cell widths along the normal."""
    d, nx, ny, nz = measure(
        kind, parameters, samples, r[0, 0] * x + r[1, 0] * y + r[2, 0] * z,
        r[0, 1] * x + r[1, 1] * y + r[2, 1] * z, r[0, 2] * x + r[1, 2] * y + r[2, 2] * z,
    )  # fmt: skip
    gx = abs(r[0, 0] * nx + r[0, 1] * ny + r[0, 2] * nz)
    gy = abs(r[1, 0] * nx + r[1, 1] * ny + r[1, 2] * nz)
    gz = abs(r[2, 0] * nx + r[2, 1] * ny + r[2, 2] * nz)
    return d, d / (gx * dx + gy * dy + gz * dz)


@njit(cache=True, error_model="numpy")
def ramp(s: float) -> float:
    """AreaFractions for a signed distance over its range: 0 below -1, 1 above 1, smooth between.

    The mean of two such ramps, each half a cell wide either way and a quarter of a cell off centre, sums over
    equidistant faces to a value that does not depend on where between them the wall is.
    """
    if s <= -1.0:
        return 0.0
    if s >= 1.0:
        return 1.0
    return 0.5 * (1.0 + s) ** 2 if s < 0.0 else 1.0 - 0.5 * (1.0 - s) ** 2


@njit(cache=True, error_model="numpy", parallel=True)
def place_solid(
    number: int, kind: int, parameters: Array, samples: Array, position: Array, rotation: Array, velocity: Array,
    angular_velocity: Array, region: NDArray[np.int64], metrics: Metrics, area_fractions: AreaFractions, sharpness: float,
) -> None:  # fmt: skip
    """Close what a solid closes; pose and velocity in grid axes [m, m/s, rad/s].

    The area_fractions of a face is the mean over the eight octants of cells that touch it (their centres lie a quarter of a
    cell off the face's): the ramp is then about 1.5 half cells wide either way, and edges of the solid keep their
    volume. Cells whose centre is inside, at a sharp edge, are then closed by the share `sharpness`: half open on two
    sides, they would let the flow cut the corner, and it would separate too late.
    """
    j0, j1, k0, k1, i0, i1 = region
    halves = np.ones((j1 - j0, k1 - k0, i1 - i0, 7), dtype=np.float32)
    for j in prange(j0, j1):
        _measure_row(j, number, kind, parameters, samples, position, rotation, region, metrics, area_fractions)
    for j in prange(j0, j1):
        _octants_row(
            j,
            number,
            kind,
            parameters,
            samples,
            position,
            rotation,
            region,
            metrics,
            area_fractions,
            halves[j - j0],
            sharpness,
        )
    for j in prange(j0, j1):
        _close_row(j, position, velocity, angular_velocity, region, metrics, area_fractions, halves)


@njit(cache=True, error_model="numpy")
def _measure_row(
    j: int, number: int, kind: int, parameters: Array, samples: Array, position: Array, rotation: Array,
    region: NDArray[np.int64], metrics: Metrics, area_fractions: AreaFractions,
) -> None:  # fmt: skip
    """Row j of `place_solid`: distances of the cells' centres."""
    r, y = rotation, metrics.yc[j] - position[1]
    for k in range(region[2], region[3]):
        z = metrics.zc[k] - position[2]
        for i in range(region[4], region[5]):
            x = metrics.xc[i] - position[0]
            d, _, _, _ = measure(
                kind, parameters, samples, r[0, 0] * x + r[1, 0] * y + r[2, 0] * z,
                r[0, 1] * x + r[1, 1] * y + r[2, 1] * z, r[0, 2] * x + r[1, 2] * y + r[2, 2] * z,
            )  # fmt: skip
            if d < area_fractions.distance[j, k, i]:
                area_fractions.distance[j, k, i] = d
                area_fractions.nearest[j, k, i] = number


@njit(cache=True, error_model="numpy")
def _octants_row(
    j: int, number: int, kind: int, parameters: Array, samples: Array, position: Array, rotation: Array,
    region: NDArray[np.int64], metrics: Metrics, area_fractions: AreaFractions, halves: NDArray[np.float32], sharpness: float,
) -> None:  # fmt: skip
    """Row j of `place_solid`: mean ramps of the cells' low and high halves along x, y, z, and what edges leave open.

    Where the distance is linear from each neighbour to the opposite one, the wall is flat throughout the cell and the
    octants follow from the slopes.
    """
    d, nearest = area_fractions.distance, area_fractions.nearest
    ny, nz, nx = d.shape
    dy = metrics.dy[j]
    for k in range(region[2], region[3]):
        dz = metrics.dz[k]
        for i in range(region[4], region[5]):
            dx = metrics.dx[i]
            reach = 0.9 * (dx + dy + dz)
            here = d[j, k, i]
            if here > reach:
                continue
            half = halves[k - region[2], i - region[4]]
            if nearest[j, k, i] == number and here < -reach:
                half[:6] = 0.0
                continue
            kink, gx, gy, gz = FAR, 0.0, 0.0, 0.0
            if nearest[j, k, i] == number and 0 < i < nx - 1 and 0 < j < ny - 1 and 0 < k < nz - 1:
                gx, gx_low = (d[j, k, i + 1] - here) / metrics.ex[i + 1], (here - d[j, k, i - 1]) / metrics.ex[i]
                gy, gy_low = (d[j + 1, k, i] - here) / metrics.ey[j + 1], (here - d[j - 1, k, i]) / metrics.ey[j]
                gz, gz_low = (d[j, k + 1, i] - here) / metrics.ez[k + 1], (here - d[j, k - 1, i]) / metrics.ez[k]
                kink = abs(gx - gx_low) + abs(gy - gy_low) + abs(gz - gz_low)
            flat = kink < 1e-6
            x, y, z = metrics.xc[i] - position[0], metrics.yc[j] - position[1], metrics.zc[k] - position[2]
            if flat:
                scale = 1.0 / (abs(gx) * dx + abs(gy) * dy + abs(gz) * dz)
                widths = here * scale
            else:
                scale = 0.0
                _, widths = _distance_in_widths(kind, parameters, samples, rotation, x, y, z, dx, dy, dz)
            if widths > 0.9:  # a quarter of a cell to the octant, half for the ramp, and something for curvature
                continue
            half[:6] = 0.0
            sharp = sharpness * min(max((kink - SHARP) / SHARP, 0.0), 1.0) if kink < FAR else 0.0
            half[6] = 1.0 - sharp * min(max(-4.0 * widths - 1.0, 0.0), 1.0)
            if widths < -0.9:
                continue
            for n in range(8):
                a, b, c = n & 1, (n >> 1) & 1, n >> 2
                ox, oy, oz = (0.5 * a - 0.25) * dx, (0.5 * b - 0.25) * dy, (0.5 * c - 0.25) * dz
                if flat:
                    part = (here + gx * ox + gy * oy + gz * oz) * scale
                else:
                    _, part = _distance_in_widths(
                        kind, parameters, samples, rotation, x + ox, y + oy, z + oz, dx, dy, dz
                    )  # fmt: skip
                value = np.float32(0.25 * ramp(2.0 * part))
                half[a] += value
                half[2 + b] += value
                half[4 + c] += value


@njit(cache=True, error_model="numpy")
def _close_row(
    j: int, position: Array, velocity: Array, angular_velocity: Array, region: NDArray[np.int64], metrics: Metrics,
    area_fractions: AreaFractions, halves: NDArray[np.float32],
) -> None:  # fmt: skip
    """Row j of `place_solid`: area_fractions of the low faces and the solid's velocity on them."""
    b, k0, i0 = j - region[0], region[2], region[4]
    o = angular_velocity
    beyond = np.ones(7, dtype=np.float32)  # all is open outside the region
    for k in range(k0, region[3]):
        for i in range(i0, region[5]):
            here = halves[b, k - k0, i - i0]
            before = halves[b, k - k0, i - i0 - 1] if i > i0 else beyond
            share = 0.5 * (np.float64(before[1]) + here[0])
            area_fractions.ax[j, k, i] = min(share, area_fractions.ax[j, k, i])
            share *= min(before[6], here[6])
            if share < area_fractions.bx[j, k, i]:
                y, z = metrics.yc[j] - position[1], metrics.zc[k] - position[2]
                area_fractions.bx[j, k, i] = share
                area_fractions.sx[j, k, i] = velocity[0] + o[1] * z - o[2] * y
            before = halves[b - 1, k - k0, i - i0] if b > 0 else beyond
            share = 0.5 * (np.float64(before[3]) + here[2])
            area_fractions.ay[j, k, i] = min(share, area_fractions.ay[j, k, i])
            share *= min(before[6], here[6])
            if share < area_fractions.by[j, k, i]:
                x, z = metrics.xc[i] - position[0], metrics.zc[k] - position[2]
                area_fractions.by[j, k, i] = share
                area_fractions.sy[j, k, i] = velocity[1] + o[2] * x - o[0] * z
            before = halves[b, k - k0 - 1, i - i0] if k > k0 else beyond
            share = 0.5 * (np.float64(before[5]) + here[4])
            area_fractions.az[j, k, i] = min(share, area_fractions.az[j, k, i])
            share *= min(before[6], here[6])
            if share < area_fractions.bz[j, k, i]:
                x, y = metrics.xc[i] - position[0], metrics.yc[j] - position[1]
                area_fractions.bz[j, k, i] = share
                area_fractions.sz[j, k, i] = velocity[2] + o[0] * y - o[1] * x
