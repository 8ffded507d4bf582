"""Solids in the flow: shapes, and the signed distance of a point from them.

The flow knows of a solid its signed distance and normal at a point (`measure`, in the solid's own axes) and its
velocity there (a rigid motion, `exumob.flow.poses`). What the solids leave open follows from the distance:
`exumob.flow.area_fractions`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated, NamedTuple

import numpy as np

from exumob.flow.grid import CELL_SIZE
from exumob.flow.tread import Tread
from exumob.support.arrays import Array
from exumob.support.cost import require_memory
from exumob.support.declared import Declared, checked
from exumob.support.kernels import njit
from exumob.support.quantities import Quantity
from exumob.vehicle.body import is_plain
from exumob.vehicle.parameters import Hull, Vehicle
from exumob.water.mesh_file import sound_triangles
from exumob.water.mesh_lines import signed_distances
from exumob.water.wetted_surface import hull_triangles

SPHERE, BOX, CYLINDER, PRISM, SAMPLED = range(5)
BYTES_PER_SAMPLE = 64.0
"""Memory of a sample of a mesh, its place and its distance [bytes]."""
HULL_FRICTION = 0.005
"""Skin-friction coefficient of a hull [-]: turbulent flat plate at Re 3e5 to 2e6 (ITTC 1957: 0.0058 to 0.0041)."""
WHEEL_FRICTION = 0.03
"""Skin-friction coefficient of a treaded tyre [-]: rough plate; a guess, its uncertainty is a factor of two."""
SIZE = Quantity("m", at_least=1e-6, at_most=1e4, plausible=(1e-4, 100.0))
"""Length of a solid"""
FRICTION = Quantity("1", at_least=0.0, at_most=1.0)
"""Skin-friction coefficient on the speed relative to the surface"""


class Shape(NamedTuple):
    """All that `measure` needs of a solid; what the kind does not use stays 0 or empty.

    One flat record for all kinds: the kernels are compiled once, and Numba's parallel loops take no record inside
    another.
    """

    kind: int
    """`SPHERE`, `BOX`, `CYLINDER` (about y), `PRISM` (along y) or `SAMPLED`"""
    half_x: float
    half_y: float
    half_z: float
    """Half the extents [m]: the radius of a sphere; radius, half width, radius of a cylinder"""
    edge_radius: float
    """Rounding of a cylinder's edges [m]"""
    outline: Array
    """Corners x, z of a prism's cross-section, counter-clockwise, the edges from there in x, z [m], and one over their
    squared lengths [1/m^2]; shape (n, 5).

    One array, not five by name: `measure` is called at every point, and a record of many arrays is slow to pass."""
    samples: Array
    """Signed distances at the points of a grid [m], shape (nx, ny, nz)"""
    low_x: float
    low_y: float
    low_z: float
    """Its first point [m]"""
    spacing: float
    """Distance between neighbouring points [m]"""

    @classmethod
    def of(
        cls, kind: int, half_sizes: Array, edge_radius: float = 0.0, outline: Array | None = None,
        samples: Array | None = None, low: tuple[float, float, float] = (0.0, 0.0, 0.0), spacing: float = 1.0,
    ) -> Shape:  # fmt: skip
        """Shape of a kind; see the fields."""
        half_x, half_y, half_z = (float(h) for h in half_sizes)
        return cls(
            kind, half_x, half_y, half_z, float(edge_radius), np.zeros((0, 5)) if outline is None else outline,
            np.zeros((2, 2, 2)) if samples is None else samples, *low, float(spacing),
        )  # fmt: skip


@dataclass(frozen=True)
class Solid(Declared):
    """A rigid shape in its own axes."""

    shape: Shape
    """See there; `sphere`, `box`, `cylinder`, `prism` and `mesh_solid` make it"""
    low: Annotated[Array, Quantity("m", shape=(3,))]
    """Lower corner of its bounding box [m], shape (3,)"""
    high: Annotated[Array, Quantity("m", shape=(3,))]
    """Upper corner [m], shape (3,)"""
    friction: Annotated[float, FRICTION] = 0.0
    """Skin-friction coefficient on the speed relative to the surface [-], 0 to 1"""
    tread: Tread | None = None
    """Lugs of a spinning `CYLINDER`"""

    def _check(self) -> None:
        if self.tread is not None and self.shape.kind != CYLINDER:
            raise ValueError("Solid.tread: only a cylinder can have lugs; leave it None.")

    def distance(self, points: Array) -> Array:
        """Signed distance [m] at points of shape (n, 3) in the solid's axes, < 0 inside."""
        return np.array([measure(self.shape, *p)[0] for p in np.atleast_2d(points)])


@checked
def sphere(radius: Annotated[float, SIZE], friction: float = 0.0) -> Solid:
    """Sphere about the origin; radius [m]."""
    corner = np.full(3, radius)
    return Solid(Shape.of(SPHERE, corner), -corner, corner, friction)


@checked
def box(
    length: Annotated[float, SIZE], width: Annotated[float, SIZE], height: Annotated[float, SIZE], friction: float = 0.0
) -> Solid:
    """Box about the origin with edges along the axes [m]."""
    half = 0.5 * np.array([length, width, height])
    return Solid(Shape.of(BOX, half), -half, half, friction)


@checked
def cylinder(
    radius: Annotated[float, SIZE],
    width: Annotated[float, SIZE],
    edge_radius: Annotated[float, Quantity("m", at_least=0.0)] = 0.0,
    friction: float = WHEEL_FRICTION,
) -> Solid:
    """Cylinder about the y axis (a wheel) with rounded edges [m]."""
    if edge_radius > min(radius, 0.5 * width):
        raise ValueError(
            f"cylinder.edge_radius = {edge_radius:g} m must be >= 0 and <= {min(radius, 0.5 * width):g} m; an edge "
            "cannot be rounder than the cylinder."
        )
    corner = np.array([radius, 0.5 * width, radius])
    return Solid(Shape.of(CYLINDER, corner, edge_radius), -corner, corner, friction)


@checked
def prism(
    outline: Annotated[Array, Quantity("m", shape=("corners", 2))], width: Annotated[float, SIZE], friction: float = 0.0
) -> Solid:
    """Polygon in x, z (counter-clockwise with x to the right and z up; shape (n, 2) [m]), extruded along y [m]."""
    if len(outline) < 3:
        raise ValueError(f"prism.outline has {len(outline)} corners; give at least 3.")
    x, z = outline[:, 0], outline[:, 1]
    area = 0.5 * float(np.sum(x * np.roll(z, -1) - np.roll(x, -1) * z))
    if area <= 0.0:
        raise ValueError(f"prism.outline encloses {area:g} m^2; give its corners counter-clockwise in (x, z).")
    low, high = outline.min(axis=0), outline.max(axis=0)
    edges = np.roll(outline, -1, axis=0) - outline
    lengths = np.sum(edges**2, axis=1, keepdims=True)
    if lengths.min() <= 0.0:
        n = int(lengths.argmin())
        raise ValueError(f"prism.outline: corners {n} and {(n + 1) % len(outline)} are the same; leave one out.")
    corners = np.array([low[0], -0.5 * width, low[1]]), np.array([high[0], 0.5 * width, high[1]])
    shape = Shape.of(PRISM, 0.5 * (corners[1] - corners[0]), outline=np.hstack([outline, edges, 1.0 / lengths]))
    return Solid(shape, *corners, friction)


@checked
def hull_prism(hull: Hull, friction: float = HULL_FRICTION) -> Solid:
    """First box of a `Hull`, raked, about its centre of mass; without wheel arches."""
    return prism(hull.side_profile() - [hull.center_of_mass_x, hull.center_of_mass_height], hull.width, friction)


@checked
def mesh_solid(
    triangles: Annotated[Array, Quantity("m", shape=("triangles", 3, 3))],
    spacing: Annotated[float, CELL_SIZE],
    friction: float = HULL_FRICTION,
) -> Solid:
    """Watertight triangle mesh, sampled once to a grid of signed distances.

    Parameters
    ----------
    triangles : array, shape (n, 3, 3)
        Corners in the solid's axes [m], counter-clockwise from outside (`exumob.water.mesh_file.mesh_triangles`
        reads a file); checked as that does.
    spacing : float
        Spacing of the samples [m]; half a cell of the flow's grid or less.
    friction : float
        Skin-friction coefficient [-].
    """
    triangles = sound_triangles("mesh_solid", triangles)
    low, high = triangles.min(axis=(0, 1)), triangles.max(axis=(0, 1))
    start = low - 6.0 * spacing
    counts = np.ceil((high + 6.0 * spacing - start) / spacing) + 1
    require_memory(
        f"mesh_solid: spacing = {spacing:g} m makes {np.prod(counts):.2g} samples of the mesh",
        BYTES_PER_SAMPLE * float(np.prod(counts)), "give larger cells.",
    )  # fmt: skip
    counts = counts.astype(int)
    axes = [start[a] + spacing * np.arange(counts[a]) for a in range(3)]
    shape = Shape.of(
        SAMPLED, 0.5 * (high - low), samples=signed_distances(triangles, *axes),
        low=(float(start[0]), float(start[1]), float(start[2])), spacing=spacing,
    )  # fmt: skip
    return Solid(shape, low, high, friction)


@checked
def vehicle_solids(
    vehicle: Vehicle, cell_size: Annotated[float, CELL_SIZE], tread: Tread | None = None
) -> tuple[Solid, ...]:
    """Solids of the five bodies, order of `exumob.vehicle.motion.BODIES`, each about its body's origin.

    Parameters
    ----------
    vehicle : Vehicle
    cell_size : float
        Cell size of the flow's grid [m]; a hull with wheel arches or more boxes, and a mesh, are sampled at half of it.
    tread : Tread or None
        Lugs of the wheels.
    """
    if is_plain(vehicle.hull):
        hull = hull_prism(vehicle.hull)
    else:
        hull = mesh_solid(hull_triangles(vehicle), 0.5 * cell_size)
    wheel = replace(cylinder(vehicle.wheel.radius, vehicle.wheel.width, 0.1 * vehicle.wheel.width), tread=tread)
    return hull, wheel, wheel, wheel, wheel


def lugs_of(solids: Sequence[Solid]) -> tuple[Array, Array, Array, Array]:
    """Radius, half width, height [m] and drag area [m^2] of the solids' lugs (`exumob.flow.poses.PlacedSolids`)."""
    radius, half, height, area = (np.zeros(len(solids)) for _ in range(4))
    for n, solid in enumerate(solids):
        if solid.tread is not None:
            tread = solid.tread
            radius[n], half[n], height[n] = solid.shape.half_x, solid.shape.half_y, tread.lug_height
            area[n] = tread.drag_coefficient * tread.lug_count * tread.lug_height * 2.0 * half[n]
    return radius, half, height, area


@njit(cache=True, error_model="numpy")
def measure(shape: Shape, x: float, y: float, z: float) -> tuple[float, float, float, float]:
    """Signed distance [m] (< 0 inside) and outward unit normal of a solid at a point of its own axes [m]."""
    if shape.kind == SPHERE:
        r = math.sqrt(x * x + y * y + z * z)
        s = 1.0 / max(r, 1e-300)
        return r - shape.half_x, x * s, y * s, z * s
    if shape.kind == BOX:
        d, nx, ny, nz = _corner(abs(x) - shape.half_x, abs(y) - shape.half_y, abs(z) - shape.half_z)
        return d, math.copysign(nx, x), math.copysign(ny, y), math.copysign(nz, z)
    if shape.kind == CYLINDER:
        r = math.sqrt(x * x + z * z)
        edge = shape.edge_radius
        d, nr, ny, _ = _corner(r - shape.half_x + edge, abs(y) - shape.half_y + edge, -1e30)
        s = nr / max(r, 1e-300)
        return d - edge, s * x, math.copysign(ny, y), s * z
    if shape.kind == PRISM:
        d, nx, nz = _polygon(shape.outline, x, z)
        d, n2, ny, _ = _corner(d, abs(y) - shape.half_y, -1e30)
        return d, n2 * nx, math.copysign(ny, y), n2 * nz
    return _sampled(shape, x, y, z)


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
def _polygon(outline: Array, x: float, z: float) -> tuple[float, float, float]:
    """Signed distance and outward normal of a counter-clockwise polygon."""
    best, bx, bz, inside = 1e300, 0.0, 0.0, False
    ex, ez = 0.0, 0.0
    for m in range(len(outline)):
        tx, tz = outline[m, 2], outline[m, 3]
        px, pz = x - outline[m, 0], z - outline[m, 1]
        part = (px * tx + pz * tz) * outline[m, 4]
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
def _sampled(shape: Shape, x: float, y: float, z: float) -> tuple[float, float, float, float]:
    """Trilinear interpolation of sampled distances; beyond the samples, the distance to them is added."""
    h, samples = shape.spacing, shape.samples
    n0, n1, n2 = samples.shape
    px, py, pz = (x - shape.low_x) / h, (y - shape.low_y) / h, (z - shape.low_z) / h
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
