"""Rivers from 2-D flow models: bed, level and velocity on a regular grid, read by xarray from netCDF.

Known are the names that exports of HEC-RAS (Water Surface, Depth, Velocity X), TELEMAC-2D (BOTTOM, FREE SURFACE, WATER
DEPTH, VELOCITY U, and their one-letter names in Serafin files), Delft3D FM (mesh2d_s1, mesh2d_waterdepth, mesh2d_ucx)
and the CF conventions give; any others are told by `names`. Results on a mesh are to be put on a regular grid before.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from exumob.ground.terrain import HEIGHT_RANGE, Terrain
from exumob.support.arrays import Array
from exumob.support.declared import checked
from exumob.support.files import why_no_file
from exumob.support.quantities import Quantity
from exumob.water.conditions import Water
from exumob.water.water_field import WaterField

NAMES: dict[str, tuple[str, ...]] = {
    # small letters without blanks and signs, and standard names of CF
    "bed": (
        "bed", "bottom", "bedlevel", "bedelevation", "bottomelevation", "zb", "b", "fond", "mesh2dflowelembl",
        "flowelembl", "groundlevelaltitude", "terrain", "topography", "elevation", "altitude",
    ),
    "level": (
        "level", "waterlevel", "watersurface", "watersurfaceelevation", "wse", "wsel", "freesurface", "s",
        "surfacelibre", "mesh2ds1", "s1", "watersurfaceheightabovereferencedatum",
    ),
    "depth": ("depth", "waterdepth", "h", "hauteurdeau", "mesh2dwaterdepth"),
    "velocity_x": (
        "velocityx", "velocityu", "u", "ucx", "mesh2ducx", "vx", "xvelocity", "vitesseu", "seawaterxvelocity",
        "eastwardseawatervelocity",
    ),
    "velocity_y": (
        "velocityy", "velocityv", "v", "ucy", "mesh2ducy", "vy", "yvelocity", "vitessev", "seawateryvelocity",
        "northwardseawatervelocity",
    ),
    "x": ("x", "easting", "projectionxcoordinate", "lon", "longitude"),
    "y": ("y", "northing", "projectionycoordinate", "lat", "latitude"),
}  # fmt: skip
"""Names by which each variable is found, in the order in which they are looked for."""
METRES = ("m", "meter", "meters", "metre", "metres")
SPEEDS = ("m/s", "m s-1", "ms-1", "m.s-1", "m s^-1", "meter/second", "metre/second", "meters/second")
UNITS = {"velocity_x": SPEEDS, "velocity_y": SPEEDS}
"""Spellings of the units that are read; metres where nothing is said."""
RIVER = "of bed, level and velocity on a regular grid (docs/howto/soil_and_terrain.md)"
"""What a file of a river is, in words."""
UNEVEN = 0.01
"""Largest difference of the distance between neighbouring points, over it; single precision of map coordinates."""
APART = 0.05
"""Largest difference of a level and of bed plus depth [m]."""


@checked
def read_river(
    source: str | Path | xr.Dataset,
    names: Mapping[str, str | None] | None = None,
    *,
    time: int | None = None,
    least_depth: Annotated[float, Quantity("m", at_least=0.0, at_most=10.0)] = 1e-3,
    density: float = 1000.0,
) -> tuple[Terrain, Water]:
    """Read the bed and the water of a river on a regular grid.

    Map coordinates are kept: give `exumob.simulate` the start in them. What is shallower than `least_depth`, or missing
    over a known bed, is dry; there the level of the nearest water goes on, but never above a bed that lies below it, as
    behind a dike.

    Parameters
    ----------
    source : path or xarray.Dataset
        NetCDF file, or an open dataset, with bed, level or depth, and velocity over axes x and y.
    names : mapping of str to str, optional
        Names of the variables ``bed``, ``level``, ``depth``, ``velocity_x``, ``velocity_y``, ``x`` and ``y`` where they
        are not found by themselves (`NAMES`). ``None`` for both components of the velocity: still water.
    time : int, optional
        Number of the instant, from 0 on; -1 is the last. Needed where there are several.
    least_depth : float
        [m]
    density : float
        [kg/m^3]

    Returns
    -------
    terrain : Terrain
    water : Water

    Raises
    ------
    ValueError
        If the file cannot be read, a variable is missing or in another unit, the grid is not regular, the bed has
        holes, or level, depth and bed contradict each other; the message names the variable and the remedy.
    """
    if isinstance(source, xr.Dataset):
        return _river(source, "read_river", names or {}, time, least_depth, density)
    path = Path(source)
    if not path.is_file():
        raise ValueError(f"read_river.source = {path} {why_no_file(path)}; give a netCDF file {RIVER}.")
    try:
        with path.open("rb") as stream:
            begin = stream.read(8)
    except OSError as error:
        raise ValueError(f"{path} cannot be read ({error.strerror}); give a netCDF file {RIVER}.") from None
    if not begin.startswith((b"CDF\x01", b"CDF\x02", b"CDF\x05", b"\x89HDF\r\n\x1a\n")):
        what = "is empty" if not begin else "is not a netCDF file"
        raise ValueError(f"{path} {what}; give a netCDF file {RIVER}.")
    try:
        with xr.open_dataset(path, decode_times=False) as opened:
            data = opened.load()
    except (OSError, RuntimeError, ValueError, TypeError, KeyError, AttributeError):
        raise ValueError(
            f"{path} begins as a netCDF file does, but cannot be read: it is cut off, damaged, or of a kind that is "
            "not known here; export it anew, as netCDF-4."
        ) from None
    if not data.variables:
        raise ValueError(
            f"{path} holds no variables outside its groups, or none at all; give a netCDF file {RIVER}, as variables "
            "of the file itself."
        )
    return _river(data, str(path), names or {}, time, least_depth, density)


def _river(
    data: xr.Dataset, what: str, names: Mapping[str, str | None], time: int | None, least_depth: float, density: float
) -> tuple[Terrain, Water]:
    unknown = [name for name in names if name not in NAMES]
    if unknown:
        raise ValueError(f"read_river.names: {unknown[0]!r} is not known; use {', '.join(NAMES)}.")
    found = {role: _find(data, role, names, what) for role in NAMES}
    for role in ("x", "y", "bed"):
        if found[role] is None:
            raise ValueError(_missing(data, role, what))
    if found["level"] is None and found["depth"] is None:
        raise ValueError(_missing(data, "level", what))
    still = "velocity_x" in names and names["velocity_x"] is None and names.get("velocity_y", "") is None
    for role in ("velocity_x", "velocity_y"):
        if found[role] is None and not still:
            raise ValueError(
                f"{_missing(data, role, what)} For still water add two variables of 0, or give names={{'velocity_x': "
                "None, 'velocity_y': None}."
            )
    axes = {role: data[found[role]] for role in ("x", "y")}
    x, y = (_axis(axes[role], role, what) for role in ("x", "y"))
    dims = str(axes["y"].dims[0]), str(axes["x"].dims[0])
    fields = {
        role: _field(data[name], role, dims, time, what) for role, name in found.items() if name and role not in "xy"
    }
    for values in fields.values():
        if x[1] < x[0]:
            values[:] = values[:, ::-1].copy()
        if y[1] < y[0]:
            values[:] = values[::-1].copy()
    origin, spacing = (float(x.min()), float(y.min())), (_step(x), _step(y))
    bed = fields["bed"]
    holes = np.isnan(bed)
    if holes.any():
        j, i = np.argwhere(holes)[0]
        raise ValueError(
            f"{what}: {found['bed']} has holes at {holes.sum()} of {bed.size} points, the first at x = "
            f"{origin[0] + i * spacing[0]:.9g}, y = {origin[1] + j * spacing[1]:.9g} m; fill them, or cut out a part "
            "without."
        )
    level, dry = _level(fields, found, least_depth, what)
    velocity = {role: np.where(dry, 0.0, fields[role]) for role in ("velocity_x", "velocity_y") if role in fields}
    for role, values in velocity.items():
        lacking = np.isnan(values)
        if lacking.any():
            raise ValueError(
                f"{what}: {found[role]} is missing at {lacking.sum()} points under water; fill it, 0 where the water "
                "stands, or raise least_depth if it is the shore."
            )
    terrain = Terrain(heights=bed, origin=origin, spacing=spacing)
    field = WaterField(
        level, velocity.get("velocity_x"), velocity.get("velocity_y"), origin=origin, spacing=spacing
    )  # fmt: skip
    return terrain, Water(field=field, density=density)


def _level(
    fields: Mapping[str, Array], found: Mapping[str, str | None], least_depth: float, what: str
) -> tuple[Array, NDArray[np.bool_]]:
    """Level at each point, and which are dry."""
    bed = fields["bed"]
    depth = fields["level"] - bed if "level" in fields else fields["depth"]
    if "level" in fields and "depth" in fields:
        wet = (fields["depth"] > least_depth) & (depth > least_depth)
        apart = np.abs(depth - fields["depth"])[wet]
        if apart.size and apart.max() > APART:
            raise ValueError(
                f"{what}: {found['level']} differs from {found['bed']} plus {found['depth']} by up to "
                f"{apart.max():.4g} m ({APART:g} m at most); they are of different instants, grids or datums. Export "
                "them together, or leave one out: names={'depth': None}."
            )
    elif "depth" in fields and (depth < -APART).any():
        raise ValueError(
            f"{what}: {found['depth']} falls to {np.nanmin(depth):.4g} m, and a depth is 0 or more; is it a level?"
        )
    dry = ~(depth > least_depth)  # nan, too
    if dry.all():
        raise ValueError(
            f"{what}: the water lies at or below the bed everywhere; look at the datum of both, and at the instant."
        )
    level = bed + depth if "level" not in fields else fields["level"].copy()
    from scipy.ndimage import distance_transform_edt

    nearest = distance_transform_edt(dry, return_distances=False, return_indices=True)
    level = level[tuple(nearest)]
    return np.where(dry, np.minimum(level, bed), level), dry


def _find(data: xr.Dataset, role: str, names: Mapping[str, str | None], what: str) -> str | None:
    """Name of the variable that has a role; None if there is none."""
    if role in names:
        name = names[role]
        if name is not None and name not in data.variables:
            raise ValueError(f"{what}: names[{role!r}] = {name!r} is no variable; there are {_listed(data)}.")
        return name
    plain = {_plain(str(name)): str(name) for name in reversed(list(data.variables))}
    standard = {_plain(str(data[name].attrs.get("standard_name", ""))): str(name) for name in data.variables}
    return next((table[name] for name in NAMES[role] for table in (plain, standard) if name in table), None)


def _plain(name: str) -> str:
    return re.sub(r"[^a-z0-9]", "", name.casefold())


def _listed(data: xr.Dataset) -> str:
    return ", ".join(map(str, data.variables)) or "none"


def _missing(data: xr.Dataset, role: str, what: str) -> str:
    also = " (or depth)" if role == "level" else ""
    return (
        f"{what}: no variable is known as the {role}{also}; there are {_listed(data)}. Rename the right one to "
        f"{role!r}, or say in Python which it is: read_river(..., names={{{role!r}: ...}})."
    )


def _check_unit(values: xr.DataArray, role: str, what: str) -> None:
    unit = " ".join(str(values.attrs.get("units", "")).casefold().split())
    known = UNITS.get(role, METRES)
    if unit in ("", *known):
        return
    remedy = f"convert it to {known[0]}"
    if unit in ("ft", "feet", "foot", "us survey foot", "ft/s"):
        remedy = f"multiply it by 0.3048 and set its units to {known[0]!r}"
    elif unit.startswith("degree"):
        remedy = "project the grid to metres"
    raise ValueError(f"{what}: {values.name} is in {values.attrs['units']!r} and must be in {known[0]}; {remedy}.")


def _axis(axis: xr.DataArray, role: str, what: str) -> Array:
    if axis.ndim != 1 or axis.size < 2:
        raise ValueError(
            f"{what}: {axis.name}, the axis {role}, has the shape {axis.shape}; two points at least along one "
            "dimension are needed. Put the results on a regular grid whose axes are x and y."
        )
    _check_unit(axis, role, what)
    values = np.asarray(axis.values, dtype=float)
    steps = np.diff(values)
    middle = (values[-1] - values[0]) / len(steps)
    if not np.isfinite(values).all() or middle == 0.0 or np.abs(steps / middle - 1.0).max() > UNEVEN:
        raise ValueError(
            f"{what}: the points of {axis.name} are {np.abs(steps).min():.6g} to {np.abs(steps).max():.6g} m apart; "
            "they must be equally far apart. Put the results on a regular grid."
        )
    return values


def _step(axis: Array) -> float:
    return float(abs(axis[-1] - axis[0]) / (len(axis) - 1))


def _field(values: xr.DataArray, role: str, dims: tuple[str, str], time: int | None, what: str) -> Array:
    """Values of a variable, rows along y, nan where they are missing."""
    _check_unit(values, role, what)
    for dim in [d for d in values.dims if d not in dims]:
        size = values.sizes[dim]
        if size > 1 and time is None:
            raise ValueError(
                f"{what}: {values.name} has {size} values along {dim}; choose the instant, in Python "
                "read_river(..., time=-1) for the last, or export that instant alone."
            )
        if time is not None and not -size <= time < size and size > 1:
            raise ValueError(f"{what}: time = {time}, and {values.name} has {size} values along {dim}.")
        values = values.isel({dim: 0 if size == 1 or time is None else time})
    if set(values.dims) != set(dims):
        raise ValueError(
            f"{what}: {values.name} has the dimensions ({', '.join(map(str, values.dims))}), and the axes are "
            f"{' and '.join(dims)}; results on a mesh must be put on a regular grid before."
        )
    numbers = values.transpose(*dims).values
    if numbers.dtype.kind not in "fiu":
        raise ValueError(f"{what}: {values.name} holds no numbers but {numbers.dtype}; name the right variable.")
    numbers = numbers.astype(float)
    if role == "bed" and str(values.attrs.get("positive", "")).casefold() == "down":
        numbers = -numbers
    low, high = HEIGHT_RANGE if role in ("bed", "level") else (-100.0, 1e4 if role == "depth" else 100.0)
    numbers[~((numbers >= low) & (numbers <= high))] = np.nan  # marks of missing data: -9999, 1e20
    return numbers
