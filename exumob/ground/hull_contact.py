"""Contact of a rigid hull with deformable soil: pressure-sinkage under it and friction along it, in compiled code.

The surface of the hull is represented by points with an area A and an outward normal m. Where the undisturbed soil
surface, of unit normal n, lies above a point, the point has sunk by z (along n) and four things act on it:

- bearing: A b(f) p(z) d along n, where p is Bekker's pressure (`Soil.pressure`, paper Eq. (3)) for a plate as wide as
  the hull's bottom is on its smaller side; f = -m.n says how squarely the face looks at the ground, and b(f) = f but
  within FACING of the upright, from where on it is 0: A f is the area that the face covers on the ground. As for a tyre
  the damping d = max(0, 1 - D v_n) multiplies the pressure; v_n is the speed of the point along n;
- a couple A b'(f) P(z) (m x n), P the integral of p: without it a hull that is rocked in the soil would gain energy;
- compaction: a face that advances along the ground at u = m.v_t > 0 is pushed back by p d A along the part of m in the
  ground's plane. Over a bow that is the width times P at its depth, whatever its rake: Bekker's resistance of
  compaction. A face that draws back is not pushed, as the rear of a tyre without rebound is not;
- shear: A b(f) tau against the sliding velocity v_t, tau = (c a + p d tan(phi)) (1 - exp(-j / K)) after Janosi and
  Hanamoto, paper Eq. (4).

A hull is long beside the shear modulus K, so that in steady sliding the strength is mobilised; what is left is standing
and starting. As for a locked tyre, slow motion mobilises it in proportion to speed: j = |v_t| / w0, w0 the standstill
rate, so that a hull at rest creeps, at a small share of w0 K while the load is a small share of the strength. The
compaction is mobilised alike, by u / w0. K is the geometric mean of K_x and K_y, and the resultant is limited, not each
axis: a hull has no preferred direction. Adhesion builds up with the pressure, a = 1 - exp(-p d / c): the force does not
jump at touch-down, and where the pressure is low beside c the shear is at most 1 + tan(phi) times the normal stress.

Energy: bearing and couple derive from the potential sum of A b(f) P(z), over a plane exactly; damping, compaction and
shear never have positive power. So over a plane the contact gives back at most what was stored in it, and after a
touch-down it has never given energy. Over a field of heights the same holds up to the ground's curvature times z.

For exponents n < 1 Bekker's stiffness is infinite at the surface. Over the first ONSET of the width the power law is
replaced by the parabola that starts at 0 and joins it with its slope; deeper it is as it was.

Known limits: no memory of what was pressed down (no ruts, unloading follows loading, adhesion does not pull); no soil
heaped up ahead of the hull but through compaction; a plate's width that does not shrink where only a strip bears.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from exumob.ground.soil import Soil
from exumob.ground.terrain import Terrain, terrain_height
from exumob.support.arrays import Array, checked_array
from exumob.support.declared import checked
from exumob.support.kernels import njit
from exumob.support.quantities import Quantity

POINTS_ALONG = 40
"""Points along the hull at least; `tests/physics/test_hull_on_ground.py` measures what more would change."""
MOST_ALONG = 100
"""Points along it at most, however fine the terrain is."""
UPRIGHT = 0.3
"""Vertical part of the normal up to which a face is an upright one: a bow, a stern or a side."""
FACING = 0.1
"""Sine of the angle to the upright up to which a face bears less than the area it covers."""
ONSET = 1e-3
"""Depth over the width of the bottom within which a pressure with n < 1 starts as a parabola."""

HULL_POINT = np.dtype([("position", "f8", (3,)), ("normal", "f8", (3,)), ("area", "f8")])
"""A point of the hull's surface: from the hull's origin [m], outward unit normal (hull axes), area [m^2]."""

HULL_RECORD = np.dtype(
    [
        ("width", "f8"),  # smaller side of the bottom [m]
        ("radius", "f8"),  # largest distance of a point from the hull's origin [m]
        ("steepness", "f8"),  # sqrt(1 + largest slope^2) of the terrain
        ("seen_position", "f8", (3,)),  # where the hull was looked at last
        ("seen_rotation", "f8", (3, 3)),
        ("clearance", "f8"),  # its smallest height above the ground there [m]; 0: it must be looked at
    ]
)
"""The hull as a whole; `soil_on_hull` writes what it saw, to know when it need not look, never what it finds."""

HULL_SOIL = np.dtype(
    [
        ("force", "f8", (3,)),  # of the soil on the hull, world axes [N]
        ("moment", "f8", (3,)),  # about the hull's origin, world axes [N m]
        ("center", "f8", (3,)),  # of the pressure, world axes [m]; 0 without contact
        ("sinkage", "f8"),  # of the deepest point [m]; 0 without contact
        ("stored", "f8"),  # energy of compression that a slow release would give back [J]
    ]
)
"""What the soil does to the hull."""


class HullContact(NamedTuple):
    """The hull as the soil meets it; made by `hull_contact`."""

    points: np.ndarray
    """dtype `HULL_POINT`, shape (n,)"""
    record: np.ndarray
    """dtype `HULL_RECORD`, shape (1,)"""


def no_hull_contact() -> HullContact:
    """Return a hull that soil does not touch."""
    record = np.zeros(1, HULL_RECORD)
    record["clearance"] = np.inf
    return HullContact(np.zeros(0, HULL_POINT), record)


@checked
def hull_contact(
    triangles: Annotated[ArrayLike, Quantity("m", at_least=-1e6, at_most=1e6, shape=("n", 3, 3))],
    terrain: Terrain,
    points_along: Annotated[int, Quantity("1", at_least=2, at_most=1000)] = POINTS_ALONG,
) -> HullContact:
    """Spread points over the downward and upright faces of a hull.

    The faces are cut along planes a distance apart that is at most the hull's length over `points_along`, and at most
    that of the terrain's points (but not less than `MOST_ALONG` points along the hull ask for). Upright faces are cut
    at twice the distance, and in height into four layers of a quarter of it above the keel, then into thicker ones. The
    pieces of a cell that face alike are one point, with their area and centre: areas and their first moments are exact,
    and a hull that is its own mirror image gets points that are.

    Parameters
    ----------
    triangles : array_like, shape (n, 3, 3)
        Closed surface of the hull about its origin, hull axes, counter-clockwise seen from outside.
    terrain : Terrain
    points_along : int
        Least number of points along the hull.

    Raises
    ------
    ValueError
        If no face looks down.
    """
    surface = checked_array("hull_contact.triangles", triangles, ("n", 3, 3))
    vectors = 0.5 * np.cross(surface[:, 1] - surface[:, 0], surface[:, 2] - surface[:, 0])
    areas = np.linalg.norm(vectors, axis=1)
    kept = (areas > 0.0) & (vectors[:, 2] <= 1e-9 * areas)
    if not (kept & (vectors[:, 2] < -1e-3 * areas)).any():
        raise ValueError("hull_contact.triangles: no face looks down; give a closed surface, seen from outside.")
    low, high = surface.min(axis=(0, 1)), surface.max(axis=(0, 1))
    extent = high - low
    length = float(max(extent[0], extent[1]))
    spacing = length / points_along
    if terrain.heights is not None:
        assert isinstance(terrain.spacing, tuple)
        spacing = min(spacing, max(min(terrain.spacing), length / MOST_ALONG))
    doublings = math.log2(max(extent[2] / spacing, 1.0))
    layers = low[2] + spacing * np.array([0.25, 0.5, 0.75, *2.0 ** np.arange(0.0, doublings)])
    looks_down = kept & (vectors[:, 2] < -UPRIGHT * areas)
    parts = []
    for faces, apart, levels in ((looks_down, spacing, layers[:0]), (kept & ~looks_down, 2.0 * spacing, layers)):
        planes = (_planes(low[0], high[0], apart), _planes(low[1], high[1], apart), levels)
        pieces = surface[faces]
        for axis, places in enumerate(planes):
            pieces = _cut_along(pieces, axis, places)
        parts.append(_merged(pieces, planes))
    points = np.concatenate(parts)
    record = np.zeros(1, HULL_RECORD)
    bottom = surface[looks_down if looks_down.any() else kept]
    record["width"] = np.ptp(bottom.reshape(-1, 3)[:, :2], axis=0).min()
    record["radius"] = np.linalg.norm(points["position"], axis=1).max()
    record["steepness"] = math.sqrt(1.0 + _steepest(terrain) ** 2)
    return HullContact(points, record)


def _planes(low: float, high: float, spacing: float) -> Array:
    """Places of equally spaced planes between two ends, a whole number of equal intervals apart."""
    count = math.ceil((high - low) / spacing - 1e-9)
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    return np.array([middle + half * (2 * i - count) / count for i in range(1, count)])


def _cut_along(triangles: Array, axis: int, places: Array) -> Array:
    """Cut triangles along parallel planes in ascending order, the middle one first."""
    if len(places) == 0 or len(triangles) == 0:
        return triangles
    middle = len(places) // 2
    pieces = _cut(triangles, axis, places[middle])
    below = pieces[:, :, axis].mean(axis=1) < places[middle]
    return np.concatenate(
        [_cut_along(pieces[below], axis, places[:middle]), _cut_along(pieces[~below], axis, places[middle + 1 :])]
    )


def _cut(triangles: Array, axis: int, place: float) -> Array:
    """Cut triangles along the plane coordinate[axis] = place; the surface stays the same."""
    height = triangles[:, :, axis] - place
    height[np.abs(height) <= 1e-12 * max(1.0, abs(place))] = 0.0
    crossed = (height.min(axis=1) < 0.0) & (height.max(axis=1) > 0.0)
    if not crossed.any():
        return triangles
    corners, h = triangles[crossed], height[crossed]
    # the corner that is alone on its side comes first; with one corner on the plane, any of the others will do
    alone = np.where((h > 0.0).sum(axis=1) == 1, h.argmax(axis=1), h.argmin(axis=1))
    order = (alone[:, None] + np.arange(3)) % 3
    corners, h = np.take_along_axis(corners, order[..., None], axis=1), np.take_along_axis(h, order, axis=1)
    tip = corners[:, 0]
    ends = []
    for k in (1, 2):
        share = np.clip(h[:, 0] / np.where(h[:, 0] == h[:, k], 1.0, h[:, 0] - h[:, k]), 0.0, 1.0)[:, None]
        ends.append(tip + share * (corners[:, k] - tip))
    a, b = ends
    parts = [
        np.stack([tip, a, b], axis=1), np.stack([a, corners[:, 1], corners[:, 2]], axis=1),
        np.stack([a, corners[:, 2], b], axis=1),
    ]  # fmt: skip
    return np.concatenate([triangles[~crossed], *parts])


def _merged(pieces: Array, planes: tuple[Array, Array, Array]) -> np.ndarray:
    """Gather the pieces of each cell that face alike into one point."""
    vectors = 0.5 * np.cross(pieces[:, 1] - pieces[:, 0], pieces[:, 2] - pieces[:, 0])
    areas = np.linalg.norm(vectors, axis=1)
    pieces, vectors, areas = pieces[areas > 0.0], vectors[areas > 0.0], areas[areas > 0.0]
    middles = pieces.mean(axis=1)
    facing = np.round(2.1 * vectors / areas[:, None]).astype(np.int64)  # within about 25 degrees
    key = np.zeros(len(pieces), dtype=np.int64)
    for axis, places in enumerate(planes):
        key = key * (len(places) + 1) + np.searchsorted(places, middles[:, axis])
    for axis in range(3):
        key = 5 * key + facing[:, axis] + 2
    _, cell = np.unique(key, return_inverse=True)
    total = np.bincount(cell, areas)
    points = np.zeros(len(total), HULL_POINT)
    for axis in range(3):
        points["position"][:, axis] = np.bincount(cell, areas * middles[:, axis]) / total
        points["normal"][:, axis] = np.bincount(cell, vectors[:, axis])
    points["area"] = np.linalg.norm(points["normal"], axis=1)
    points["normal"] /= points["area"][:, None]
    return points[points["area"] > 1e-9 * total.max()]


def _steepest(terrain: Terrain) -> float:
    """Bound of the terrain's slope: of the plane, and twice that between neighbours of the field.

    Between its points a monotone cubic is at most 1.5 times as steep as the straight line.
    """
    slopes = [abs(terrain.slope_x), abs(terrain.slope_y)]
    if terrain.heights is not None:
        assert isinstance(terrain.spacing, tuple)
        field = np.asarray(terrain.heights, dtype=float)
        slopes = [
            slope + 2.0 * float(np.abs(np.diff(field, axis=axis)).max()) / step
            for slope, axis, step in zip(slopes, (1, 0), terrain.spacing, strict=True)
        ]
    return math.hypot(*slopes)


@njit(cache=True, error_model="numpy")
def hull_is_clear(hull: Any, position: Array, rotation: Array) -> bool:
    """Tell from where the hull was looked at last that it cannot have reached the ground since.

    A point moves by no more than the origin does and the hull's radius times the change of the rotation; its height
    above the ground changes by no more than that times the steepness.
    """
    moved = 0.0
    turned = 0.0
    for k in range(3):
        moved += (position[k] - hull.seen_position[k]) ** 2
        for j in range(3):
            turned += (rotation[k, j] - hull.seen_rotation[k, j]) ** 2
    return bool(hull.steepness * (math.sqrt(moved) + hull.radius * math.sqrt(turned)) < hull.clearance)


@njit(cache=True, error_model="numpy", inline="always")
def _pressure(depth: float, n: float, factor: float, onset: float) -> tuple[float, float, float]:
    """Bekker's pressure [Pa], its integral over the depth [N/m] and its derivative [Pa/m]."""
    if depth >= onset:
        p = factor * depth**n
        integral = p * depth / (n + 1.0)
        if onset > 0.0:
            integral += factor * onset ** (n + 1.0) * (0.5 * (2.0 - n) + (n - 1.0) / 3.0 - 1.0 / (n + 1.0))
        return p, integral, n * p / depth
    at_onset = factor * onset**n
    s = depth / onset
    p = at_onset * s * (2.0 - n + (n - 1.0) * s)
    integral = at_onset * onset * s * s * (0.5 * (2.0 - n) + (n - 1.0) * s / 3.0)
    return p, integral, at_onset / onset * (2.0 - n + 2.0 * (n - 1.0) * s)


@njit(cache=True, error_model="numpy")
def soil_on_hull(  # a kernel: soil and ground, the hull's motion, and two results
    soil: Any, terrain: Any, nodes: Array, points: np.ndarray, hull: Any, standstill_rate: float, position: Array,
    rotation: Array, velocity: Array, turning: Array, out: Any, tangent: Array, stiffly: float, damped: float,
) -> None:  # fmt: skip
    """Compute force and moment of the soil on the hull, and if asked for their derivative by its motion.

    This function checks nothing; NaN in the motion is no contact.

    Parameters
    ----------
    soil : record of dtype `exumob.ground.soil.SOIL_RECORD`
    terrain, nodes
        As for `terrain_height`.
    points : array of dtype `HULL_POINT`, shape (n,)
    hull : record of dtype `HULL_RECORD`, changed
    standstill_rate : float
        w0 [rad/s], > 0.
    position, velocity, turning : array, shape (3,) or longer
        Of the hull's origin [m], [m/s], and angular velocity [rad/s], world axes.
    rotation : array, shape (3, 3)
        Hull axes to world.
    out : record of dtype `HULL_SOIL`, changed
    tangent : array, shape (6, 6) or (0, 0), changed
        `stiffly` times the derivative of force and moment by displacement and rotation of the hull, plus `damped` times
        that by its velocity and angular velocity.
    stiffly, damped : float
    """
    wanted = tangent.shape[0] > 0
    n, cohesion, tan_phi = soil.n, soil.cohesion, soil.tan_friction_angle
    if soil.reece_pressure:
        factor = (soil.k_c + soil.k_phi * hull.width) / hull.width**n
    else:
        factor = soil.k_c / hull.width + soil.k_phi
    onset = ONSET * hull.width if n < 1.0 else 0.0
    creep = standstill_rate * math.sqrt(soil.shear_modulus_x * soil.shear_modulus_y)
    force, moment, center = np.zeros(3), np.zeros(3), np.zeros(3)
    r, outward, normal, v_t, ahead, f, v = (
        np.empty(3), np.empty(3), np.empty(3), np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    )  # fmt: skip
    t = np.empty((3, 3))
    tangent[:] = 0.0
    clearance = np.inf
    deepest = 0.0
    weight = 0.0
    stored = 0.0
    for point in points:
        for k in range(3):
            r[k] = (
                rotation[k, 0] * point.position[0] + rotation[k, 1] * point.position[1]
                + rotation[k, 2] * point.position[2]
            )  # fmt: skip
        ground, slope_x, slope_y = terrain_height(terrain, nodes, position[0] + r[0], position[1] + r[1])
        gap = position[2] + r[2] - ground
        clearance = min(clearance, gap)
        if not gap < 0.0:
            continue
        norm = 1.0 / math.sqrt(1.0 + slope_x * slope_x + slope_y * slope_y)
        normal[0], normal[1], normal[2] = -slope_x * norm, -slope_y * norm, norm
        facing = 0.0
        for k in range(3):
            outward[k] = (
                rotation[k, 0] * point.normal[0] + rotation[k, 1] * point.normal[1] + rotation[k, 2] * point.normal[2]
            )
            facing -= outward[k] * normal[k]
        if facing <= -FACING:
            continue
        share = facing / FACING
        if share >= 1.0:
            bearing, bearing_rate, pushed = facing, 1.0, 1.0
        elif share > 0.0:
            bearing, bearing_rate, pushed = FACING * share * share * (2.0 - share), share * (4.0 - 3.0 * share), 1.0
        else:
            bearing, bearing_rate, pushed = 0.0, 0.0, (1.0 + share) ** 2 * (1.0 - 2.0 * share)
        v[0] = velocity[0] + turning[1] * r[2] - turning[2] * r[1]
        v[1] = velocity[1] + turning[2] * r[0] - turning[0] * r[2]
        v[2] = velocity[2] + turning[0] * r[1] - turning[1] * r[0]
        v_n = v[0] * normal[0] + v[1] * normal[1] + v[2] * normal[2]
        speed = 0.0
        advance = 0.0
        for k in range(3):
            v_t[k] = v[k] - v_n * normal[k]
            ahead[k] = outward[k] + facing * normal[k]
            speed += v_t[k] * v_t[k]
            advance += outward[k] * v_t[k]
        speed = math.sqrt(speed)
        depth = -gap * norm
        pressure, integral, steepness = _pressure(depth, n, factor, onset)
        damping = max(0.0, 1.0 - soil.damping * v_n)
        normal_stress = pressure * damping
        adhesion = cohesion * -math.expm1(-normal_stress / cohesion) if cohesion > 0.0 else 0.0
        strength = adhesion + normal_stress * tan_phi
        kept = math.exp(-speed / creep)
        rate = -math.expm1(-speed / creep) / speed if speed > 1e-12 * creep else 1.0 / creep
        area = point.area * bearing
        press = area * normal_stress
        resist = 0.0
        if advance > 0.0:
            resist = point.area * pushed * normal_stress * -math.expm1(-advance / creep)
        for k in range(3):
            f[k] = press * normal[k] - area * strength * rate * v_t[k] - resist * ahead[k]
            force[k] += f[k]
            center[k] += press * (position[k] + r[k])
        couple = point.area * bearing_rate * integral
        moment[0] += r[1] * f[2] - r[2] * f[1] + couple * (outward[1] * normal[2] - outward[2] * normal[1])
        moment[1] += r[2] * f[0] - r[0] * f[2] + couple * (outward[2] * normal[0] - outward[0] * normal[2])
        moment[2] += r[0] * f[1] - r[1] * f[0] + couple * (outward[0] * normal[1] - outward[1] * normal[0])
        deepest = max(deepest, depth)
        weight += press
        stored += area * integral
        if wanted:
            softer = steepness * damping
            mobilised = (tan_phi + (math.exp(-normal_stress / cohesion) if cohesion > 0.0 else 0.0)) * rate
            along = (kept / creep - rate) / (speed * speed) if speed > 1e-6 * creep else 0.0
            push = 0.0
            if advance > 0.0:
                push = point.area * pushed * normal_stress * math.exp(-advance / creep) / creep
            damp = soil.damping * pressure if damping > 0.0 else 0.0
            for i in range(3):
                for j in range(3):
                    level = (1.0 if i == j else 0.0) - normal[i] * normal[j]
                    t[i, j] = (
                        -area * (stiffly * softer + damped * damp) * normal[i] * normal[j]
                        + stiffly * area * softer * mobilised * v_t[i] * normal[j]
                        - damped * area * strength * (rate * level + along * v_t[i] * v_t[j])
                        - damped * push * ahead[i] * ahead[j]
                    )  # fmt: skip
            _add_tangent(t, r, tangent)
    hull.clearance = max(clearance, 0.0)
    for k in range(3):
        hull.seen_position[k] = position[k]
        out.force[k] = force[k]
        out.moment[k] = moment[k]
        out.center[k] = center[k] / weight if weight > 0.0 else 0.0
        for j in range(3):
            hull.seen_rotation[k, j] = rotation[k, j]
    out.sinkage = deepest
    out.stored = stored


@njit(cache=True, error_model="numpy")
def _add_tangent(t: Array, r: Array, tangent: Array) -> None:
    """Add the derivative `t` of the force at `r` by the motion of its point to that of the whole hull."""
    columns = np.empty((3, 6))
    for i in range(3):
        for j in range(3):
            columns[i, j] = t[i, j]
        # the point moves by rotation x r
        columns[i, 3] = t[i, 2] * r[1] - t[i, 1] * r[2]
        columns[i, 4] = t[i, 0] * r[2] - t[i, 2] * r[0]
        columns[i, 5] = t[i, 1] * r[0] - t[i, 0] * r[1]
    for j in range(6):
        a, b, c = columns[0, j], columns[1, j], columns[2, j]
        tangent[0, j] += a
        tangent[1, j] += b
        tangent[2, j] += c
        tangent[3, j] += r[1] * c - r[2] * b
        tangent[4, j] += r[2] * a - r[0] * c
        tangent[5, j] += r[0] * b - r[1] * a


POSE = Quantity("m", at_least=-1e9, at_most=1e9, shape=(3,))
VELOCITY = Quantity("m/s", at_least=-1e4, at_most=1e4, shape=(3,))


@checked
def hull_soil_forces(  # soil, ground and hull, and the hull's motion
    soil: Soil,
    terrain: Terrain,
    contact: HullContact,
    position: Annotated[ArrayLike, POSE],
    rotation: Annotated[ArrayLike, Quantity("1", at_least=-1.001, at_most=1.001, shape=(3, 3))],
    velocity: Annotated[ArrayLike, VELOCITY] = (0.0, 0.0, 0.0),
    angular_velocity: Annotated[ArrayLike, Quantity("rad/s", at_least=-1e4, at_most=1e4, shape=(3,))] = (0.0, 0.0, 0.0),
    *,
    standstill_rate: Annotated[float, Quantity("rad/s", above=0.0, at_most=1e3)] = 0.01,
) -> np.void:
    """Compute what the soil does to a hull, for plots, checks and uses outside a run.

    Parameters
    ----------
    soil : Soil
    terrain : Terrain
    contact : HullContact
    position, velocity : array_like, shape (3,)
        Of the hull's origin, world axes [m], [m/s].
    rotation : array_like, shape (3, 3)
        Hull axes to world.
    angular_velocity : array_like, shape (3,)
        World axes [rad/s].
    standstill_rate : float
        Rate that with the shear modulus makes the speed of creep [rad/s].

    Returns
    -------
    record of dtype `HULL_SOIL`
        World axes; the moment about the hull's origin.
    """
    record, nodes = terrain.as_arrays()
    out = np.zeros(1, HULL_SOIL)
    soil_on_hull(
        soil.as_record()[0], record[0], nodes, contact.points, contact.record[0], float(standstill_rate),
        *(np.array(given, dtype=float) for given in (position, rotation, velocity, angular_velocity)),
        out[0], np.zeros((0, 0)), 0.0, 0.0,
    )  # fmt: skip
    found: np.void = out[0]
    return found
