"""Reading of a hull's shape from a mesh file."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np

from exumob.support.arrays import Array
from exumob.vehicle.parameters import Hull


def mesh_digest(hull: Hull) -> str:
    """Return the SHA-256 digest of the contents of a hull's mesh file; an empty text for a hull without one.

    It belongs to the identity of whatever is computed with the hull: the path alone does not say what the file holds.

    Raises
    ------
    FileNotFoundError
        If the file does not exist.
    """
    if hull.mesh is None:
        return ""
    return hashlib.sha256(_existing(hull.mesh).read_bytes()).hexdigest()


def _existing(file: str | Path) -> Path:
    if not Path(file).is_file():
        raise FileNotFoundError(f"Hull.mesh = {file} does not exist; give the path of an STL or OBJ file.")
    return Path(file)


def mesh_triangles(file: Path) -> Array:
    """Read the triangles of a watertight mesh file (STL, OBJ ...) in the design frame [m], shape (n, 3, 3).

    Raises
    ------
    ImportError
        If trimesh is not installed.
    FileNotFoundError
        If there is no such file.
    ValueError
        If the mesh is not closed, or its faces do not all point outwards.
    """
    try:
        import trimesh
    except ImportError as error:
        raise ImportError(
            f"Hull.mesh = {file} needs the package trimesh; install it with `pip install 'exumob[mesh]'`, "
            "or leave mesh out to use the box hull."
        ) from error
    mesh = trimesh.load_mesh(str(_existing(file)))
    if not mesh.is_watertight:
        raise ValueError(f"Hull.mesh = {file} is not watertight: close its holes, or the buoyancy has no meaning.")
    if not mesh.is_winding_consistent or mesh.volume <= 0.0:
        raise ValueError(
            f"Hull.mesh = {file} has faces that point inwards (enclosed volume {mesh.volume:.4g} m^3); "
            "orient all of them outwards (counter-clockwise seen from outside)."
        )
    return np.array(mesh.triangles, dtype=float)


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
        If they do not agree.
    """
    low, high = points.min(axis=0), points.max(axis=0)
    middle = np.array([hull.center_x, 0.0, hull.ground_clearance + 0.5 * hull.height])
    for k, name in enumerate(("length", "width", "height")):
        size = getattr(hull, name)
        misplaced = abs(0.5 * (low[k] + high[k]) - middle[k])
        if not 0.5 * size <= high[k] - low[k] <= 2.0 * size or misplaced > 0.5 * size:
            raise ValueError(
                f"Hull.mesh reaches from {low[k]:.4g} to {high[k]:.4g} m along {'xyz'[k]}, but Hull.{name} = {size:g} "
                f"about {middle[k]:.4g} m (allowed: a factor of 2, half a {name} off). Scale the mesh to metres, move "
                "it to the design frame, or mend the hull's sizes."
            )
