"""A hull's shape from a mesh file: read, and refused unless it is one sound surface in the vehicle's frame.

The water acts on all faces of a surface, so a mesh counts for what it encloses only if it encloses each point once: it
must be closed, turned outwards, cut through nothing, have no inner shells and no bodies within one another. Separate
bodies beside each other are as good as one.
"""

from __future__ import annotations

import hashlib
import itertools
from functools import lru_cache
from pathlib import Path

import numpy as np

from exumob.support.arrays import Array, checked_array
from exumob.support.files import why_no_file
from exumob.vehicle.motion import WHEELS
from exumob.vehicle.parameters import Hull, Vehicle, touch_message
from exumob.vehicle.wheel_room import WheelGap, gap_to
from exumob.water.mesh_lines import lines_through

LINES = 200
"""Lines along each side of the mesh on which its winding number is looked at, in all three directions."""
OVERLAP = 1.0e-4
"""Length over the size of the mesh up to which bodies may overlap on a line [-]: rounding of CAD programs."""
MERGED = 1.0e-7
"""Distance over the size of the mesh below which corners are one [-]."""
HOLLOWEST = 0.2
"""Volume enclosed over that of the box round the mesh below which it may be a shell with walls [-]."""
WALL = 0.03
"""Mean thickness over the size of the mesh below which it is one then [-]; the hulls of catamarans are thicker."""
LIKELY_UNITS = ((1000.0, "millimetres", 1e-3), (100.0, "centimetres", 1e-2), (39.37, "inches", 0.0254),
                (3.2808, "feet", 0.3048), (1e-3, "kilometres", 1e3))  # fmt: skip
"""Size of a mesh over that of its hull, the unit that it is then likely in, and that unit in metres."""

Faces = np.ndarray
"""Indices of the corners of triangles, shape (n, 3)."""


def mesh_digest(hull: Hull) -> str:
    """Return the SHA-256 digest of the contents of a hull's mesh file; an empty text for a hull without one.

    It belongs to the identity of whatever is computed with the hull: the path alone does not say what the file holds.

    Raises
    ------
    FileNotFoundError
        If the file does not exist.
    """
    return "" if hull.mesh is None else _digest(_existing(hull.mesh))


def mesh_provenance(hull: Hull) -> dict[str, str]:
    """Return the attribute of results that tells which mesh file a hull had; none for a hull without one."""
    return {} if hull.mesh is None else {"hull_mesh_sha256": mesh_digest(hull)}


def hull_mesh(vehicle: Vehicle) -> Array:
    """Return the triangles of a hull's mesh in the design frame [m], shape (n, 3, 3), after all checks.

    Raises
    ------
    ValueError
        As `mesh_triangles`; or if the mesh does not agree with the hull's sizes and place, or a tyre enters it on its
        way.
    """
    if vehicle.hull.mesh is None:
        raise ValueError(f"{vehicle.name}: Hull.mesh is None; there is no mesh to read.")
    digest = mesh_digest(vehicle.hull)
    try:
        hash(vehicle)
    except TypeError:  # a class of the user's own, with a list in it for instance
        return _checked_mesh.__wrapped__(vehicle, digest)
    return _checked_mesh(vehicle, digest)


def mesh_triangles(file: str | Path) -> Array:
    """Read the triangles of a sound mesh file (STL, OBJ ...) [m], shape (n, 3, 3), read-only.

    Corners that coincide are merged and collapsed triangles left out; nothing else is mended.

    Raises
    ------
    ImportError
        If trimesh is not installed.
    FileNotFoundError
        If there is no such file.
    ValueError
        If the file cannot be read as a mesh; if the mesh is not closed, its faces stand twice, meet by more than two at
        an edge or point inwards; if it cuts through itself, if bodies overlap or lie within each other, or if it is a
        shell with walls. The message says which, where, and what to do.
    """
    path = _existing(file)
    return _read(path, _digest(path))


def _existing(file: str | Path) -> Path:
    if not Path(file).is_file():
        raise FileNotFoundError(f"Hull.mesh = {file} {why_no_file(file)}; give the path of an STL or OBJ file.")
    return Path(file)


def _digest(file: Path) -> str:
    return hashlib.sha256(file.read_bytes()).hexdigest()


@lru_cache(maxsize=4)
def _read(file: Path, digest: str) -> Array:
    """Triangles of a file with this digest of its contents."""
    name = f"Hull.mesh = {file}"
    return _sound(name, *_loaded(name, file))


def sound_triangles(name: str, triangles: Array) -> Array:
    """Return triangles after the checks of `mesh_triangles`, in whose errors they are called `name`.

    Parameters
    ----------
    name : str
    triangles : array, shape (n, 3, 3)
        [m]
    """
    return _sound(name, triangles.reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3))


def _sound(name: str, corners: Array, faces: Faces) -> Array:
    corners, faces = _merged(corners, faces)
    if len(faces) == 0:
        raise ValueError(f"{name} holds no triangles; give the closed surface of the hull (STL, OBJ ...).")
    _require_closed(name, corners, faces)
    triangles = corners[faces]
    _require_outward(name, triangles, _bodies(faces))
    triangles.setflags(write=False)
    return triangles


def _loaded(name: str, file: Path) -> tuple[Array, Faces]:
    try:
        import trimesh
    except ImportError as error:
        raise ImportError(
            f"{name} needs the package trimesh; install it with `pip install 'exumob[mesh]'`, or leave mesh out to use "
            "the box hull."
        ) from error
    if file.suffix.lower() == ".gltf":
        raise ValueError(f"{name} keeps its shape in other files; give one file that holds all (STL, OBJ, GLB ...).")
    try:
        mesh = trimesh.load_mesh(str(file), process=False)
        vertices, faces = mesh.vertices, np.array(mesh.faces, dtype=np.int64).reshape(-1, 3)
    except Exception as error:  # readers of a dozen formats: they raise whatever they like
        raise ValueError(
            f"{name} cannot be read as a mesh ({type(error).__name__}: {error}); give the closed surface of the hull "
            "as STL, OBJ, PLY or another format of trimesh."
        ) from error
    corners = checked_array(f"{name}, its corners", vertices, ("n", 3))
    if len(faces) and not (faces.min() >= 0 and faces.max() < len(corners)):
        raise ValueError(f"{name} has triangles between corners that it does not hold; export it anew.")
    return corners, faces


def _merged(corners: Array, faces: Faces) -> tuple[Array, Faces]:
    """Merge corners that coincide, and leave out triangles that have collapsed."""
    if len(corners) == 0:
        return corners, faces
    size = max(float(np.ptp(corners, axis=0).max()), 1e-300)
    grid = np.round((corners - corners.min(axis=0)) / (MERGED * size)).astype(np.int64)
    _, first, merged = np.unique(grid, axis=0, return_index=True, return_inverse=True)
    faces = merged.reshape(-1)[faces]
    whole = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    return corners[first], faces[whole]


def _edges(faces: Faces) -> Faces:
    """Directed edges, shape (3 n, 2), those of a face at rows n, n + len(faces) and n + 2 len(faces)."""
    return np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])


def _require_closed(name: str, corners: Array, faces: Faces) -> None:
    """Refuse surfaces at one of whose edges other than two faces of one sense meet."""

    def at(place: Array) -> str:
        return "(" + ", ".join(f"{x:.4g}" for x in place) + ") m"

    same, times = np.unique(np.sort(faces, axis=1), axis=0, return_counts=True)
    if (times > 1).any():
        where = at(corners[same[np.argmax(times > 1)]].mean(axis=0))
        raise ValueError(
            f"{name}: {int((times - 1).sum())} of {len(faces)} faces stand twice, one at {where}; remove the copies, "
            "and inner walls between bodies that touch (unite them)."
        )
    directed = _edges(faces)
    edges, which, meeting = np.unique(np.sort(directed, axis=1), axis=0, return_inverse=True, return_counts=True)
    if (meeting == 1).any():
        where = at(corners[edges[np.argmax(meeting == 1)]].mean(axis=0))
        raise ValueError(
            f"{name} is not watertight: {int((meeting == 1).sum())} edges have a face on one side only, one at "
            f"{where}; close its holes, or the buoyancy has no meaning."
        )
    if (meeting > 2).any():
        where = at(corners[edges[np.argmax(meeting > 2)]].mean(axis=0))
        raise ValueError(
            f"{name}: more than two faces meet at {int((meeting > 2).sum())} edges, one at {where}; unite bodies that "
            "touch, and remove walls inside."
        )
    sense = np.bincount(which.reshape(-1), weights=np.where(directed[:, 0] < directed[:, 1], 1.0, -1.0))
    if (sense != 0.0).any():
        where = at(corners[edges[np.argmax(sense != 0.0)]].mean(axis=0))
        raise ValueError(
            f"{name}: faces point inwards beside others that point outwards, as at {where}; orient all of them "
            "outwards (counter-clockwise seen from outside)."
        )


def _bodies(faces: Faces) -> np.ndarray:
    """Number of the body, connected across edges, that each face belongs to."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    _, which = np.unique(np.sort(_edges(faces), axis=1), axis=0, return_inverse=True)
    owner = np.tile(np.arange(len(faces)), 3)[np.argsort(which.reshape(-1), kind="stable")].reshape(-1, 2)
    links = coo_array((np.ones(len(owner)), (owner[:, 0], owner[:, 1])), shape=(len(faces), len(faces)))
    return np.asarray(connected_components(links, directed=False)[1])


def _require_outward(name: str, triangles: Array, bodies: np.ndarray) -> None:
    """Refuse surfaces that enclose any point otherwise than once."""
    low, high = triangles.min(axis=(0, 1)), triangles.max(axis=(0, 1))
    size = float((high - low).max())
    a, b, c = np.moveaxis(triangles - 0.5 * (low + high), 1, 0)
    volumes = np.bincount(bodies, weights=np.einsum("ni,ni->n", a, np.cross(b, c)) / 6.0)
    several = f"consists of {len(volumes)} closed bodies of {_listed(volumes)} m^3"
    if len(volumes) == 1 and abs(volumes[0]) < 1e-6 * np.prod(high - low):
        raise ValueError(
            f"{name} encloses nothing on balance: it cuts through itself; mend its faces in the CAD program."
        )
    if volumes.max() <= 0.0:
        raise ValueError(
            f"{name} has faces that point inwards (enclosed volume {volumes.sum():.4g} m^3); orient all of them "
            "outwards (counter-clockwise seen from outside)."
        )
    if volumes.min() <= 0.0:
        raise ValueError(
            f"{name} {several}: those below 0 are inner shells of a hollow body, or turned inside out. Water reaches "
            "the outer surface only: delete the inner shells, and orient all faces outwards."
        )
    wrong = 0.0
    enclosed = 0.0
    for axis in range(3):
        k, m = (axis + 1) % 3, (axis + 2) % 3
        u, v = (low[i] + (high[i] - low[i]) * (np.arange(LINES) + 0.5137) / LINES for i in (k, m))
        lines = lines_through(triangles, axis, u, v, -np.inf, np.inf)
        cell = (high[k] - low[k]) * (high[m] - low[m]) / LINES**2
        enclosed = float(lines.enclosed.sum() * cell)
        if lines.wrong.max() > OVERLAP * size:
            wrong = max(wrong, float(lines.wrong.sum() * cell))
    if wrong > 0.0:
        fault = f"{several} that overlap or lie within each other" if len(volumes) > 1 else "cuts through itself"
        raise ValueError(
            f"{name} {fault}: about {wrong:.3g} m^3 count more than once, or the wrong way round, of {enclosed:.4g} "
            "m^3 enclosed. Unite the bodies into one outer surface (boolean union in the CAD program or in Blender; "
            "trimesh.boolean.union with the package manifold3d)."
        )
    share = float(volumes.sum() / np.prod(high - low))
    thickness = 4.0 * float(volumes.sum() / np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())
    if share < HOLLOWEST and thickness < WALL * size:
        raise ValueError(
            f"{name} encloses {volumes.sum():.3g} m^3, {100 * share:.1f} % of the box round it (at least "
            f"{100 * HOLLOWEST:.0f} %), and is {1e3 * thickness:.3g} mm thick in the mean (or at least "
            f"{1e3 * WALL * size:.3g} mm): a shell with walls, open on top? The mesh counts for what it encloses; "
            "close it over the deck, and leave the inside out."
        )


def _listed(values: np.ndarray, most: int = 6) -> str:
    texts = [f"{value:.4g}" for value in values]
    if len(texts) > most:
        texts = [*texts[:most], f"{len(values) - most} more"]
    return " and ".join([", ".join(texts[:-1]), texts[-1]] if len(texts) > 1 else texts)


@lru_cache(maxsize=8)
def _checked_mesh(vehicle: Vehicle, digest: str) -> Array:
    """The hull's mesh with this digest, in agreement with the vehicle."""
    assert vehicle.hull.mesh is not None
    triangles = _read(vehicle.hull.mesh, digest)
    check_extent(vehicle.hull, triangles.reshape(-1, 3))
    _require_free_tyres(vehicle, triangles)
    touch = gap_to(triangles, vehicle.axles)
    if touch.gap < 0.0:
        raise ValueError(touch_message(vehicle, f"Hull.mesh = {vehicle.hull.mesh}", touch))
    return triangles


def mesh_wheel_gap(vehicle: Vehicle) -> WheelGap:
    """Return where a tyre comes closest to a hull's mesh, on all ways that steering and suspension allow.

    Raises
    ------
    ValueError
        As `hull_mesh`: also if a tyre enters the mesh.
    """
    return gap_to(hull_mesh(vehicle), vehicle.axles)


def check_extent(hull: Hull, points: Array) -> None:
    """Refuse a mesh in other units or in another frame than the hull that it stands for.

    Parameters
    ----------
    hull : Hull
        Its sizes and position, with which the mesh must agree to a factor of two and half a size.
    points : array, shape (n, 3)
        Corners of the mesh in the design frame [m].

    Raises
    ------
    ValueError
        If they do not agree; the message names the likely unit or order of axes.
    """
    low, high = points.min(axis=0), points.max(axis=0)
    names = ("length", "width", "height")
    sizes = np.array([getattr(hull, name) for name in names])
    middle = np.array([hull.center_x, 0.0, hull.ground_clearance + 0.5 * hull.height])
    apart = np.abs(0.5 * (low + high) - middle)
    fits = _agree(high - low, sizes) & (apart <= 0.5 * sizes)
    if fits.all():
        return
    k = int(np.argmin(fits))
    raise ValueError(
        f"Hull.mesh reaches from {low[k]:.4g} to {high[k]:.4g} m along {'xyz'[k]}, but Hull.{names[k]} = {sizes[k]:g} "
        f"about {middle[k]:.4g} m (allowed: a factor of 2, half a {names[k]} off). {_likely_cause(high - low, sizes)}"
    )


def _agree(found: Array, wanted: Array) -> np.ndarray:
    return np.asarray((found >= 0.5 * wanted) & (found <= 2.0 * wanted))


def _likely_cause(found: Array, wanted: Array) -> str:
    if _agree(found, wanted).all():
        return (
            "Move it to the design frame: origin on the ground below the middle of the wheelbase, x forward, y left, z "
            "up; or mend the hull's place."
        )
    for size, unit, metres in LIKELY_UNITS:
        if np.allclose(np.log(found / wanted), np.log(size), atol=np.log(1.8)):
            return f"It is likely in {unit}: scale it by {metres:g}."
    for order in itertools.permutations(range(3)):
        if _agree(found[list(order)], wanted).all():
            return f"Its axes likely stand in another order: its {', '.join('xyz'[k] for k in order)} for x, y, z."
    return "Scale the mesh to metres, move it to the design frame, or mend the hull's sizes."


def _require_free_tyres(vehicle: Vehicle, triangles: Array) -> None:
    """Refuse a mesh that encloses a part of a tyre, at ride height and straight ahead."""
    radius, half = vehicle.wheel.radius, 0.5 * vehicle.wheel.width
    along, across = np.linspace(-0.999, 0.999, 61) * radius, np.linspace(-0.999, 0.999, 31) * half
    reach = np.sqrt(radius**2 - along**2)[:, None]
    for name, (x, y, z) in zip(WHEELS, vehicle.wheel_centers, strict=True):
        inside = lines_through(triangles, 2, x + along, y + across, z - reach, z + reach).enclosed
        if inside.max() > 1e-3 * radius:
            share = float(inside.sum() / (2.0 * reach.sum() * len(across)))
            raise ValueError(
                f"Hull.mesh = {vehicle.hull.mesh}: Vehicle.track = {vehicle.track:g} m and wheelbase = "
                f"{vehicle.wheelbase:g} m put {100 * share:.3g} % of the {name.replace('_', ' ')} tyre inside the "
                "hull, at ride height and straight ahead; cut wheel arches into the mesh, or move the wheels."
            )
