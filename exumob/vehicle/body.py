"""The surface of a hull made of boxes with wheel arches: one closed surface without inner faces.

All boxes and arches are prisms along y, alike to port and starboard. Between two neighbouring ones of their sides the
body has one and the same section in x, z; that is cut at the abscissae of all corners and crossings into columns, in
each of which it is a few stretches between straight lines. What bounds the stretches of a section are floors and roofs,
what differs between neighbouring columns upright faces across, and what differs between neighbouring sections upright
faces along the body.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Mapping
from functools import lru_cache
from typing import NamedTuple, TypeVar

import numpy as np

from exumob.support.arrays import Array
from exumob.vehicle.hull import ARCH_CLEARANCE, Hull, WheelArches
from exumob.vehicle.wheel_motion import Axle, pose_grid, reach_of, rim_points, tyre_poses

SAME = 1.0e-9
"""Distance over the size of a body below which places are one [-]."""


class Arch(NamedTuple):
    """Room that is cut out round the left wheel of an axle, and mirrored round the right one."""

    inner: float
    """y of its wall; it is open from there outwards [m]"""
    outline: tuple[tuple[float, float], ...]
    """Corners (x, z) from the rear leg's foot over the roof to the front leg's; open below [m]"""
    distances: tuple[float, float, float]
    """From the tyre at ride height: ahead and behind, above, inboard [m]"""


def arch_of(arches: WheelArches, axle: Axle) -> Arch:
    """Return the arch of an axle, with distances that are not given chosen so that the tyre stays clear.

    Raises
    ------
    ValueError
        If it reaches beyond the middle of the body.
    """
    clearance = ARCH_CLEARANCE * 2.0 * axle.radius if arches.clearance is None else arches.clearance
    least = _least_distances(axle._replace(x=0.0, y=0.0), clearance, arches.ahead)
    ahead, above, inboard = (
        wanted if given is None else given
        for wanted, given in zip(least, (arches.ahead, arches.above, arches.inboard), strict=True)
    )
    half, rise = axle.radius + ahead, axle.radius + above
    height = min(half, rise)  # of the round part
    z = axle.radius + rise - height
    turn = (np.arange(arches.corners) + 0.5) * math.pi / arches.corners
    out = 1.0 / math.cos(0.5 * math.pi / arches.corners)  # its faces touch the ellipse
    across, upward = -half * out * np.cos(turn), height * out * np.sin(turn)
    across[0], across[-1] = -half, half
    inner = axle.y - axle.half_width - inboard
    if inner <= 0.0:
        raise ValueError(
            f"WheelArches.inboard = {inboard:.3g} m lets the arches of both sides meet in the middle of the body: the "
            f"tyres are {2.0 * (axle.y - axle.half_width):.3g} m apart; give less, steer less (Steering.limit), or "
            "move the wheels apart (Vehicle.track)."
        )
    corners = [(-half, -math.inf), *zip(across, z + upward, strict=True), (half, -math.inf)]
    return Arch(inner, tuple((float(axle.x + a), float(b)) for a, b in corners), (ahead, above, inboard))


@lru_cache(maxsize=256)
def _least_distances(axle: Axle, clearance: float, ahead: float | None) -> tuple[float, float, float]:
    """Distances ahead, above and inboard that leave a clearance on all ways of the tyre [m]; `ahead` may be given."""
    reach = reach_of(axle)
    along = reach.along + clearance - axle.radius
    half = axle.radius + (along if ahead is None else ahead)
    points = rim_points(axle, *tyre_poses(axle, *pose_grid(axle))).reshape(-1, 3)
    round_top = np.sqrt(np.maximum((half - clearance) ** 2 - points[:, 0] ** 2, 0.0))  # over the arc's middle
    middle = max(0.0, float((points[:, 2] - round_top).max()))
    return along, middle + half - axle.radius, reach.inboard + clearance - axle.half_width


@lru_cache(maxsize=512)
def clears_by_design(arches: WheelArches, axle: Axle) -> bool:
    """Tell if an arch is wide, high and deep enough for all ways of the tyre without a closer look."""
    ahead, above, inboard = arch_of(arches, axle).distances
    least = _least_distances(axle._replace(x=0.0, y=0.0), 0.0, ahead)
    return ahead >= least[0] and above >= least[1] and inboard >= least[2]


# -- the surface -------------------------------------------------------------------------------------------------------


class _Line(NamedTuple):
    """A straight line of an outline, from left to right."""

    x0: float
    z0: float
    x1: float
    z1: float


class _Cover(NamedTuple):
    """What a box fills, or an arch leaves open, of each column: from a line, or from far below, up to another."""

    lower: tuple[_Line, ...]
    upper: tuple[_Line, ...]


Key = TypeVar("Key", bound=float)
Outline = tuple[tuple[float, float], ...]


class BodyShape(NamedTuple):
    """Outlines of boxes and arches: all that shapes a body, as a key of what is computed of it once."""

    boxes: tuple[tuple[float, Outline], ...]
    """Width [m] and outline (x, z) [m] of each box"""
    arches: tuple[tuple[float, Outline], ...]
    """y of the wall [m] and outline of each arch of the port side"""


Stretch = tuple[int, int]
"""Numbers of the lines that bound a stretch of a column from below and above."""


def body_faces(hull: Hull, axles: tuple[Axle, Axle]) -> tuple[Array, ...]:
    """Return the outer faces of a hull of boxes with wheel arches, in the design frame.

    Parameters
    ----------
    hull : Hull
        Without a mesh.
    axles : (Axle, Axle)

    Returns
    -------
    tuple of arrays, each of shape (corners, 3)
        Convex polygons, corners counter-clockwise from outside [m]. A corner of one may lie on an edge of another:
        `with_shared_corners` inserts it there.

    Raises
    ------
    ValueError
        If the arches of both sides meet.
    """
    return faces_of(body_shape(hull, axles))


def body_shape(hull: Hull, axles: tuple[Axle, Axle]) -> BodyShape:
    """Return what shapes a hull of boxes: parameters as `body_faces`."""
    arches = () if hull.wheel_arches is None else tuple(arch_of(hull.wheel_arches, axle) for axle in axles)
    boxes = tuple((part.width, tuple((float(x), float(z)) for x, z in part.side_profile())) for part in hull.parts)
    return BodyShape(boxes, tuple((arch.inner, arch.outline) for arch in arches))


@lru_cache(maxsize=16)
def faces_of(shape: BodyShape) -> tuple[Array, ...]:
    """Return the outer faces of a body; see `body_faces`."""
    boxes, arches = shape
    half_widths = [0.5 * width for width, _ in boxes]
    size = max(*half_widths, *(abs(c) for _, outline in boxes for corner in outline for c in corner))
    same = SAME * size
    covers = [_chains(outline) for _, outline in boxes]
    holes = [_Cover((), tuple(_Line(*a, *b) for a, b in itertools.pairwise(o[1:-1]))) for _, o in arches]
    lines = [line for cover in (*covers, *holes) for line in (*cover.lower, *cover.upper)]
    places = _abscissae(lines, same)
    heights = _heights(lines, places, same)
    sides = _distinct([0.0, *half_widths, *(y for y, _ in arches if y < max(half_widths))], same)
    sections = []
    for low, high in itertools.pairwise(sides):
        filled = [c for c, half in zip(covers, half_widths, strict=True) if half >= high - same]
        opened = [c for c, (inner, _) in zip(holes, arches, strict=True) if inner <= low + same]
        sections.append(_columns(filled, opened, lines, places, heights, same))
    faces = _Builder(places, sides, heights, same).faces([*sections, [[] for _ in places[1:]]])
    for face in faces:
        face.setflags(write=False)
    return tuple(faces)


def _chains(outline: Outline) -> _Cover:
    """Lower and upper lines of a convex outline, counter-clockwise with x to the right and z up."""
    edges = list(itertools.pairwise([*outline, outline[0]]))
    lower = sorted(_Line(*a, *b) for a, b in edges if a[0] < b[0])
    return _Cover(tuple(lower), tuple(sorted(_Line(*b, *a) for a, b in edges if a[0] > b[0])))


def _distinct(values: Iterable[float], same: float) -> list[float]:
    """Values in order; of those that are nearly the same the one that was given first."""
    found: list[float] = []
    for value in values:
        if all(abs(value - other) > same for other in found):
            found.append(value)
    return sorted(found)


def _abscissae(lines: list[_Line], same: float) -> list[float]:
    """Abscissae of all ends and crossings of lines."""
    places = [x for line in lines for x in (line.x0, line.x1)]
    for a, b in itertools.combinations(lines, 2):
        rise_a, rise_b = (a.z1 - a.z0) / (a.x1 - a.x0), (b.z1 - b.z0) / (b.x1 - b.x0)
        if rise_a != rise_b:
            x = (b.z0 - a.z0 + rise_a * a.x0 - rise_b * b.x0) / (rise_a - rise_b)
            if max(a.x0, b.x0) < x < min(a.x1, b.x1):
                places.append(x)
    return _distinct(places, same)


def _heights(lines: list[_Line], places: list[float], same: float) -> list[dict[int, float]]:
    """Height of each line at each abscissa it reaches; heights that are nearly the same become one."""
    found: list[dict[int, float]] = []
    for x in places:
        here: dict[int, float] = {}
        known: list[float] = []
        for n, line in enumerate(lines):
            if not line.x0 - same <= x <= line.x1 + same:
                continue
            z = line.z0 if abs(x - line.x0) <= same else line.z1
            if line.x0 + same < x < line.x1 - same:
                z = line.z0 + (x - line.x0) / (line.x1 - line.x0) * (line.z1 - line.z0)
            here[n] = next((other for other in known if abs(other - z) <= same), z)
            known.append(here[n])
        found.append(here)
    return found


def _columns(  # the covers, and what is known of all lines
    filled: list[_Cover], opened: list[_Cover], lines: list[_Line], places: list[float],
    heights: list[dict[int, float]], same: float,
) -> list[list[Stretch]]:  # fmt: skip
    """Return the stretches of each column of a section, from below upwards."""
    number = {line: n for n, line in reversed(list(enumerate(lines)))}

    def at(cover: tuple[_Line, ...], i: int) -> int | None:
        middle = 0.5 * (places[i] + places[i + 1])
        return next((number[line] for line in cover if line.x0 < middle < line.x1), None)

    columns = []
    for i in range(len(places) - 1):
        middle = {n: 0.5 * (heights[i][n] + heights[i + 1][n]) for n in heights[i] if n in heights[i + 1]}
        found: list[Stretch] = []
        whole = [(at(cover.lower, i), at(cover.upper, i)) for cover in filled]
        there = [(low, high) for low, high in whole if low is not None and high is not None]
        for low, high in sorted(there, key=lambda stretch: middle[stretch[0]]):
            if found and middle[low] <= middle[found[-1][1]] + same:
                if middle[high] > middle[found[-1][1]]:
                    found[-1] = (found[-1][0], high)
            else:
                found.append((low, high))
        for cover in opened:
            roof = at(cover.upper, i)
            if roof is not None:
                found = [
                    (low if middle[roof] <= middle[low] + same else roof, high)
                    for low, high in found if middle[roof] < middle[high] - same
                ]  # fmt: skip
        columns.append(found)
    return columns


def _without(
    stretches: list[tuple[Key, Key]], others: list[tuple[Key, Key]], z: Mapping[Key, float], same: float
) -> list[tuple[Key, Key]]:
    """Parts of stretches that the others do not hold; all between keys whose heights are `z`."""
    found: list[tuple[Key, Key]] = []
    for low, high in stretches:
        ends: dict[Key, float] = {
            key: z[key] for pair in others for key in pair if z[low] + same < z[key] < z[high] - same
        }
        cuts = [low]
        cuts += sorted(ends, key=ends.__getitem__)
        for a, b in itertools.pairwise([*cuts, high]):
            middle = 0.5 * (z[a] + z[b])
            if z[b] - z[a] > same and not any(z[p] < middle < z[q] for p, q in others):
                if found and found[-1][1] == a:
                    found[-1] = (found[-1][0], b)
                else:
                    found.append((a, b))
    return found


class _Builder:
    """Makes the faces of a body from its sections."""

    def __init__(self, places: list[float], sides: list[float], heights: list[dict[int, float]], same: float) -> None:
        self.places, self.sides, self.heights, self.same = places, sides, heights, same

    def faces(self, sections: list[list[list[Stretch]]]) -> list[Array]:
        """Faces of both halves; the last section is empty."""
        level: dict[tuple[int, bool, int, int], list[int]] = {}  # line, roof or floor, columns -> sections
        across: dict[tuple[int, float, float, bool], list[int]] = {}
        found: list[Array] = []
        for k, columns in enumerate(sections[:-1]):
            for line, roof, first, last in self._runs(columns):
                level.setdefault((line, roof, first, last), []).append(k)
            for i, height in enumerate(self.heights):
                behind, ahead = (
                    [(height[a], height[b]) for a, b in column]
                    for column in (columns[i - 1] if i > 0 else [], columns[i] if i < len(columns) else [])
                )
                heights = {end: end for pair in (*behind, *ahead) for end in pair}
                for forward, one, other in ((True, behind, ahead), (False, ahead, behind)):
                    for low, high in _without(one, other, heights, self.same):
                        across.setdefault((i, low, high, forward), []).append(k)
            found += self._along(columns, sections[k + 1], self.sides[k + 1])
        for (line, roof, first, last), where in level.items():
            x, z = [self.places[first], self.places[last]], [self.heights[i][line] for i in (first, last)]
            for y0, y1 in self._merged(where):
                corners = [(x[0], y0, z[0]), (x[1], y0, z[1]), (x[1], y1, z[1]), (x[0], y1, z[0])]
                found += self._mirrored(np.array(corners if roof else corners[::-1]))
        for (i, bottom, top, forward), where in across.items():
            for y0, y1 in self._merged(where):
                corners = [(self.places[i], y, h) for y, h in ((y0, bottom), (y1, bottom), (y1, top), (y0, top))]
                found += self._mirrored(np.array(corners if forward else corners[::-1]))
        return found

    def _runs(self, columns: list[list[Stretch]]) -> list[tuple[int, bool, int, int]]:
        """Lines that bound a section, as roof or floor, each with its first and last abscissa."""
        runs: dict[tuple[int, bool], list[list[int]]] = {}
        for i, stretches in enumerate(columns):
            for low, high in stretches:
                for line, roof in ((low, False), (high, True)):
                    own = runs.setdefault((line, roof), [])
                    if own and own[-1][1] == i:
                        own[-1][1] = i + 1
                    else:
                        own.append([i, i + 1])
        return [(line, roof, first, last) for (line, roof), own in runs.items() for first, last in own]

    def _along(self, inner: list[list[Stretch]], outer: list[list[Stretch]], y: float) -> list[Array]:
        """Upright faces between two neighbouring sections, at y and mirrored."""
        runs: dict[tuple[int, int, bool], list[list[int]]] = {}
        for i, (one, other) in enumerate(zip(inner, outer, strict=True)):
            lines = {n for pair in (*one, *other) for n in pair}
            middle = {n: 0.5 * (self.heights[i][n] + self.heights[i + 1][n]) for n in lines}
            for port, a, b in ((True, one, other), (False, other, one)):
                for low, high in _without(a, b, middle, self.same):
                    own = runs.setdefault((low, high, port), [])
                    if own and own[-1][1] == i:
                        own[-1][1] = i + 1
                    else:
                        own.append([i, i + 1])
        found = []
        for (low, high, port), own in runs.items():
            for first, last in own:
                corners = [(self.places[i], y, self.heights[i][n]) for i, n in (
                    (first, low), (first, high), (last, high), (last, low))]  # fmt: skip
                corners = list(dict.fromkeys(corners))
                found += self._mirrored(np.array(corners if port else corners[::-1]))
        return found

    def _merged(self, sections: list[int]) -> list[tuple[float, float]]:
        """Ends along y of neighbouring sections taken together."""
        found: list[tuple[float, float]] = []
        for k in sections:
            low, high = self.sides[k], self.sides[k + 1]
            if found and found[-1][1] == low:
                found[-1] = (found[-1][0], high)
            else:
                found.append((low, high))
        return found

    def _mirrored(self, face: Array) -> list[Array]:
        """A face of the port half, and its mirror image; one face if it reaches the middle."""
        other = face * [1.0, -1.0, 1.0]
        if face[:, 1].min() > 0.0 or np.ptp(face[:, 1]) == 0.0:
            return [face, other[::-1]]
        return [np.where((face[:, 1] == 0.0)[:, None], [1.0, -1.0, 1.0] * _opposite(face), face)]


def _opposite(face: Array) -> Array:
    """The corners of a rectangle along y, each at the other end's y."""
    return np.stack([face[:, 0], face[:, 1].max() - face[:, 1], face[:, 2]], axis=1)


def with_shared_corners(faces: Iterable[Array]) -> list[Array]:
    """Insert the corners of other faces that lie on the edges of a face: neighbours then share all of theirs.

    Parameters
    ----------
    faces : iterable of arrays, each of shape (corners, 3)
        Convex polygons [m].
    """
    faces = list(faces)
    corners = np.unique(np.concatenate(faces), axis=0)
    same = SAME * float(np.ptp(corners, axis=0).max())
    starts = np.concatenate(faces)
    ends = np.concatenate([np.roll(face, -1, axis=0) for face in faces])
    edges = ends - starts
    squared = np.einsum("ei,ei->e", edges, edges)
    away = corners[None] - starts[:, None]
    part = np.einsum("eci,ei->ec", away, edges) / squared[:, None]
    off = away - part[..., None] * edges[:, None]
    margin = same / np.sqrt(squared)[:, None]
    on = (np.einsum("eci,eci->ec", off, off) < same**2) & (part > margin) & (part < 1.0 - margin)
    found, edge = [], 0
    for face in faces:
        whole: list[Array] = []
        for corner in face:
            whole.append(corner)
            inserted = np.flatnonzero(on[edge])
            whole += list(corners[inserted[np.argsort(part[edge, inserted])]])
            edge += 1
        found.append(np.array(whole))
    return found


def triangulated(faces: Iterable[Array]) -> Array:
    """Cut convex faces, on whose edges more corners may lie, into triangles; shape (n, 3, 3)."""
    found = []
    for face in faces:
        after, before = np.roll(face, -1, axis=0) - face, face - np.roll(face, 1, axis=0)
        straight = np.linalg.norm(np.cross(before, after), axis=1) <= SAME * np.abs(after).max() ** 2
        if straight.any():
            middle = face[~straight].mean(axis=0)
            found += [[middle, face[i - 1], face[i]] for i in range(len(face))]
        else:
            found += [[face[0], face[i], face[i + 1]] for i in range(1, len(face) - 1)]
    return np.array(found)


def is_plain(hull: Hull) -> bool:
    """Tell if a hull is one whole box: nothing but its side profile and width."""
    return hull.mesh is None and not hull.boxes and hull.wheel_arches is None
