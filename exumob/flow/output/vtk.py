"""Flow fields, free surface and vehicle as VTK XML files for ParaView, written without VTK.

The format is small (https://docs.vtk.org/en/latest/design_documents/VTKFileFormats.html): an XML header, then each
array compressed with zlib. All files are in grid axes, that is in the vehicle's frame; the field data ``frame`` holds
the grid's place in the world, x, y [m] and heading [rad].
"""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np

from exumob.flow.grid import HALO, Grid
from exumob.flow.output.snapshots import in_grid_axes, surface_elevation
from exumob.flow.output.vehicle_surface import body_triangles, placed
from exumob.flow.poses import Poses
from exumob.flow.solver import FlowSolver
from exumob.support.arrays import Array
from exumob.support.cost import require_disk
from exumob.support.declared import checked
from exumob.support.files import atomic_write, require_folder_name
from exumob.vehicle.parameters import Vehicle

BYTES_PER_CELL = 24.0
"""Size of the fields of one instant, before they are compressed [bytes]."""
TYPES = {"f4": "Float32", "f8": "Float64", "i4": "Int32", "i8": "Int64", "u1": "UInt8"}
Fields = Mapping[str, np.ndarray]


class VtkSeries:
    """A folder of files that ParaView opens as one run: ``flow.pvd``.

    Each instant has ``volume_0000.vtr`` (cell data: fraction [-], velocity [m/s], pressure [Pa], distance to the
    nearest solid [m], capped), ``surface_0000.vtp`` (point data: elevation above the still level [m]) and
    ``vehicle_0000.vtp`` (cell data: body, index in `exumob.vehicle.motion.BODIES`).

    Parameters
    ----------
    folder : Path
        Folder of the files; it is made at the first instant if it does not exist.
    vehicle : Vehicle

    Raises
    ------
    ValueError
        If `folder` is a file, or its parent does not exist.
    """

    @checked
    def __init__(self, folder: Path, vehicle: Vehicle) -> None:
        """Check the folder; see the class."""
        self.folder = folder
        require_folder_name("VtkSeries.folder", folder)
        if self.folder.exists() and not self.folder.is_dir():
            raise ValueError(f"VtkSeries.folder = {folder} is a file; give a folder.")
        if not self.folder.parent.is_dir():
            raise ValueError(f"VtkSeries.folder = {folder}: {self.folder.parent} does not exist; create it first.")
        self.file = self.folder / "flow.pvd"
        self._triangles = body_triangles(vehicle)
        self._entries: list[str] = []
        self._count = 0

    def require_room(self, grid: Grid, instants: int) -> None:
        """Refuse what cannot fit on the disk.

        Parameters
        ----------
        grid : Grid
        instants : int
            How many there will be.

        Raises
        ------
        ValueError
            If the files would be larger than what is free there.
        """
        require_disk(
            f"VtkSeries.folder = {self.folder}: {instants:,} instants of {grid.n_cells:,} cells",
            BYTES_PER_CELL * grid.n_cells * instants, self.folder.parent,
            "free some, give larger cells, or keep fewer instants.",
        )  # fmt: skip

    def add(self, solver: FlowSolver, poses: Poses) -> None:
        """Write an instant, and the list of all up to now."""
        self.folder.mkdir(exist_ok=True)
        frame = {"frame": solver.frame}
        names = [f"{part}_{self._count:04d}.{ending}" for part, ending in PIECES]
        write_rectilinear(self.folder / names[0], solver.grid.x_faces, solver.grid.y_faces, solver.grid.z_faces,
                          volume_fields(solver), frame)  # fmt: skip
        points, triangles, elevation = surface_triangles(solver)
        write_triangles(self.folder / names[1], points, triangles, {"elevation": elevation}, {}, frame)
        corners = placed(self._triangles, *in_grid_axes(poses, solver.frame))
        body = np.concatenate([np.full(len(c), n, dtype=np.int32) for n, c in enumerate(corners)])
        corner_points = np.concatenate(corners).reshape(-1, 3)
        write_triangles(self.folder / names[2], corner_points, np.arange(len(corner_points)).reshape(-1, 3), {},
                        {"body": body}, frame)  # fmt: skip
        self._entries += [
            f'<DataSet timestep="{solver.time:.9g}" part="{n}" name="{part}" file="{name}"/>'
            for n, ((part, _), name) in enumerate(zip(PIECES, names, strict=True))
        ]
        self._count += 1
        text = "\n".join(self._entries)
        with atomic_write(self.file) as temporary:
            temporary.write_text(
                f'<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1">\n<Collection>\n{text}\n'
                "</Collection>\n</VTKFile>\n"
            )


PIECES = (("volume", "vtr"), ("surface", "vtp"), ("vehicle", "vtp"))


def volume_fields(solver: FlowSolver) -> dict[str, np.ndarray]:
    """Return fields at the cells' centres, single precision, shape (ny, nz, nx) or (ny, nz, nx, 3), grid axes."""
    u, v, w = solver.velocity  # low faces; at the window's end the low face stands for the centre
    velocity = np.stack([0.5 * (q + np.roll(q, -1, axis)) for q, axis in ((u, 2), (v, 0), (w, 1))], axis=-1)
    velocity[:, :, -1, 0], velocity[-1, :, :, 1], velocity[:, -1, :, 2] = u[:, :, -1], v[-1], w[:, -1]
    distance = solver.area_fractions.distance[HALO:-HALO, HALO:-HALO, HALO:-HALO]
    reach = 6.0 * solver.grid.smallest_width
    fields = {
        "fraction": solver.fraction, "velocity": velocity, "pressure": solver.pressure,
        "distance": np.clip(distance, -reach, reach),
    }  # fmt: skip
    return {name: values.astype(np.float32) for name, values in fields.items()}


def surface_triangles(solver: FlowSolver) -> tuple[Array, np.ndarray, Array]:
    """Return the free surface between the cells' centres: points [m] (n, 3), triangles (m, 3), elevation [m] (n,).

    Cells that a solid pierces are left out.
    """
    elevation = surface_elevation(solver).astype(float)
    m = solver.metrics
    x, y = np.meshgrid(m.xc[HALO:-HALO], m.yc[HALO:-HALO])
    ny, nx = elevation.shape
    known = np.isfinite(elevation)
    number = np.where(known, np.cumsum(known.ravel()).reshape(ny, nx) - 1, -1)
    a, b, c, d = number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]
    triangles = np.concatenate([np.stack(t, axis=-1).reshape(-1, 3) for t in ((a, b, c), (a, c, d))])
    triangles = triangles[(triangles >= 0).all(axis=1)]
    height = elevation[known]
    return np.stack([x[known], y[known], height + solver.level], axis=1), triangles, height


def write_rectilinear(file: Path, x: Array, y: Array, z: Array, cell_data: Fields, field_data: Fields) -> None:
    """Write a .vtr file: faces x, y, z [m]; cell data of shape (ny, nz, nx), vectors with a last axis of 3."""
    ordered = {name: np.moveaxis(values, 1, 0) for name, values in cell_data.items()}  # VTK: z, y, x with x fastest
    flat = {name: v.reshape(-1, 3) if v.ndim == 4 else v.ravel() for name, v in ordered.items()}
    extent = f"0 {len(x) - 1} 0 {len(y) - 1} 0 {len(z) - 1}"
    with _File("RectilinearGrid", file, field_data, f'WholeExtent="{extent}"') as f:
        f.open(f'Piece Extent="{extent}"')
        f.section("CellData", flat)
        f.section("Coordinates", {"x": x, "y": y, "z": z})
        f.close("Piece")


def write_triangles(
    file: Path, points: Array, triangles: np.ndarray, point_data: Fields, cell_data: Fields, field_data: Fields
) -> None:
    """Write a .vtp file of triangles: points [m] (n, 3), corners (m, 3), data of n points and m cells."""
    count = len(triangles)
    with _File("PolyData", file, field_data) as f:
        f.open(f'Piece NumberOfPoints="{len(points)}" NumberOfPolys="{count}"')
        f.section("PointData", {name: np.asarray(v, dtype=np.float32) for name, v in point_data.items()})
        f.section("CellData", cell_data)
        f.section("Points", {"points": np.asarray(points, dtype=np.float32)})
        offsets = 3 * np.arange(1, count + 1)
        f.section("Polys", {"connectivity": triangles.ravel().astype(np.int64), "offsets": offsets.astype(np.int64)})
        f.close("Piece")


class _File:
    """A VTK XML file with compressed arrays appended; written whole under a temporary name, then renamed."""

    def __init__(self, kind: str, file: Path, field_data: Fields, attributes: str = "") -> None:
        self.kind, self.file = kind, file
        self.lines = [
            '<?xml version="1.0"?>',
            f'<VTKFile type="{kind}" version="1.0" byte_order="LittleEndian" header_type="UInt64" '
            'compressor="vtkZLibDataCompressor">',
            f"<{kind} {attributes}>",
        ]
        self.data = bytearray()
        self.section("FieldData", field_data, "NumberOfTuples")

    def open(self, tag: str) -> None:
        self.lines.append(f"<{tag}>")

    def close(self, tag: str) -> None:
        self.lines.append(f"</{tag}>")

    def section(self, name: str, arrays: Fields, count: str = "") -> None:
        self.open(name)
        for label, values in arrays.items():
            raw = np.ascontiguousarray(values, dtype=values.dtype.newbyteorder("<"))
            packed = zlib.compress(raw.tobytes(), 1)
            components = raw.shape[1] if raw.ndim == 2 else 1
            tuples = f' {count}="{raw.shape[0]}"' if count else ""
            self.lines.append(
                f'<DataArray type="{TYPES[raw.dtype.str[1:]]}" Name={quoteattr(label)} '
                f'NumberOfComponents="{components}"{tuples} format="appended" offset="{len(self.data)}"/>'
            )
            # one block: its number, size, size of a last partial block (none), compressed size
            self.data += np.array([1, raw.nbytes, 0, len(packed)], dtype="<u8").tobytes() + packed
        self.close(name)

    def __enter__(self) -> _File:
        return self

    def __exit__(self, kind: Any, *_: Any) -> None:
        if kind is not None:
            return
        self.lines += [f"</{self.kind}>", '<AppendedData encoding="raw">', "_"]
        text = "\n".join(self.lines).encode() + bytes(self.data) + b"\n</AppendedData>\n</VTKFile>\n"
        with atomic_write(self.file) as temporary:
            temporary.write_bytes(text)
