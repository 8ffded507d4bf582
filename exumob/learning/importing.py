"""Import of CFD-MBD time histories of other programs: motion of the five bodies and the water's loads, CSV or netCDF.

One column (CSV) or one variable along time (netCDF) for each quantity of `KINDS`, a body's name before it:

    time [s], hull_x [m], hull_y [m], hull_z [m], hull_roll [deg], hull_pitch [deg], hull_yaw [deg],
    hull_Fx [N], hull_Fy [N], hull_Fz [N], hull_Mx [N m], hull_My [N m], hull_Mz [N m], front_left_x [m], ...

Other names are mapped by the argument `names`. Units stand in brackets behind the name, in the variable's ``units``, or
are given for a whole kind of quantity; none is guessed. Instead of roll, pitch and yaw (in the sequence yaw, pitch,
roll) there may be a quaternion ``qw, qx, qy, qz``. Velocities (``vx, vy, vz``, axes of the positions) are optional and
checked. Loads act on the body about its origin: the hull's centre of mass, the wheels' centres, which do not spin.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, Slerp

from exumob.learning.dataset import DOUBLE, SAMPLING, check_loads, check_motion
from exumob.simulation.results import VARIABLES
from exumob.support.arrays import Array
from exumob.support.declared import checked
from exumob.support.dimensions import with_described_names
from exumob.support.files import read_netcdf, why_no_file
from exumob.support.provenance import parameters_json, provenance
from exumob.support.quantities import Quantity
from exumob.support.smoothing import smoothed
from exumob.support.tables import read_table
from exumob.vehicle.motion import BODIES, WRENCH_COMPONENTS, BodyStates, quaternions
from exumob.water.conditions import Water
from exumob.water.flow_states import FLOW_STATES, flow_states

PLACES = ("x", "y", "z")
ANGLES = ("roll", "pitch", "yaw")
QUATERNION = ("qw", "qx", "qy", "qz")
SPEEDS = ("vx", "vy", "vz")
KINDS = {
    "time": ("time",), "length": PLACES, "angle": ANGLES, "speed": SPEEDS, "force": WRENCH_COMPONENTS[:3],
    "moment": WRENCH_COMPONENTS[3:], "none": QUATERNION,
}  # fmt: skip
"""Quantities by kind, as `units` names them."""
UNITS = {
    "time": {"s": 1.0, "ms": 1e-3},
    "length": {"m": 1.0, "mm": 1e-3, "cm": 1e-2, "in": 0.0254, "ft": 0.3048},
    "angle": {"rad": 1.0, "deg": math.pi / 180.0},
    "speed": {"m/s": 1.0, "m s-1": 1.0, "mm/s": 1e-3, "km/h": 1.0 / 3.6, "ft/s": 0.3048},
    "force": {"N": 1.0, "kN": 1e3, "lbf": 4.4482216152605},
    "moment": {"N m": 1.0, "Nm": 1.0, "N.m": 1.0, "kN m": 1e3, "kNm": 1e3, "N mm": 1e-3, "Nmm": 1e-3},
    "none": {"": 1.0, "1": 1.0, "-": 1.0},
}
"""Known units of each kind, with their factors to SI."""
COARSEST = 0.01
"""Longest interval between samples that still resolves the water's loads [s]."""
SPEED_TOLERANCE = 0.05
"""Largest difference of given speeds from those of the positions, rms over rms [-]."""


@checked
def import_histories(
    file: Path,
    water: Water,
    *,
    names: Mapping[str, str] | None = None,
    units: Mapping[str, str] | None = None,
    up: Literal["z", "-z"] = "z",
    load_axes: Literal["body", "world"] = "body",
    bed: Annotated[float, Quantity("m", at_least=-1e5, at_most=1e5)] = 0.0,
    scenario: str | None = None,
) -> xr.Dataset:
    """Read time histories of another program as a run to learn from, with a sample every millisecond.

    Parameters
    ----------
    file : path
        CSV (.csv) or netCDF (.nc, .h5).
    water : Water
        Water in which the run was made; its directions count from the x axis of the file.
    names : mapping, optional
        Names in the file by the names above (``hull_Fx``), where they differ.
    units : mapping, optional
        Units by kind (`UNITS`) for columns that carry none: ``{"length": "mm", "force": "kN"}``.
    up : {"z", "-z"}
        ``"z"``: z points up and y to the left; ``"-z"``: z down and y to the right (ships). x points forward in both.
    load_axes : {"body", "world"}
        Axes of forces and moments.
    bed : float
        Coordinate z of the undisturbed bed in the file's axes [m].
    scenario : str, optional
        Name of the run; default: the name of the file.

    Returns
    -------
    xarray.Dataset
        Motion, states of Eq. (7) and wrenches as in a packed run (`exumob.learning.dataset.pack`).

    Raises
    ------
    ValueError
        If columns are missing, units unknown or not given, samples uneven, too far apart or not finite, if motion
        and loads contradict the axes given for them, if nothing moves, or if the loads are far beyond what the water
        can exert.
    """
    path = file
    columns = _Columns(path, dict(names or {}), dict(units or {}))
    time = columns.of("time")
    _check_time(time, path)
    if columns.has(f"hull_{ANGLES[0]}"):
        attitude = Rotation.from_euler("ZYX", _stack(columns, ANGLES)[..., ::-1].reshape(-1, 3))
    else:
        attitude = _from_quaternions(_stack(columns, QUATERNION), path)
    rotation = attitude.as_matrix().reshape(len(time), 5, 3, 3)
    position, loads = _stack(columns, PLACES), _stack(columns, WRENCH_COMPONENTS)
    given = _stack(columns, SPEEDS) if columns.has(f"hull_{SPEEDS[0]}") else None
    position = position - np.array([0.0, 0.0, bed])
    if up == "-z":
        flip = np.array([1.0, -1.0, -1.0])
        position, loads = position * flip, loads * np.tile(flip, 2)
        rotation = flip[:, None] * rotation * flip
        given = None if given is None else given * flip
    if load_axes == "world":
        loads = np.einsum("nbij,nbki->nbkj", rotation, loads.reshape(-1, 5, 2, 3)).reshape(-1, 5, 6)
    check_motion(time, position, str(path))
    _check_places(position, rotation, path)

    states = _resampled(time - time[0], position, rotation)
    if given is not None:
        _check_speeds(time - time[0], given, states, path)
    wrench = np.stack([_line(time - time[0], loads[:, b], states.time) for b in range(5)], axis=1)
    check_loads(states, wrench, water, str(path))
    _check_lift(states, wrench, path)
    return _dataset(states, wrench, water, path, scenario or path.stem)


class _Columns:
    """Columns of a file by the names above, converted to SI."""

    def __init__(self, path: Path, names: dict[str, str], units: dict[str, str]) -> None:
        if not path.is_file():
            raise ValueError(f"import_histories: {path} {why_no_file(path)}; give a file of histories.")
        unknown = sorted(set(units) - set(UNITS))
        if unknown:
            raise ValueError(f"import_histories.units: {', '.join(unknown)} is not a kind; use {', '.join(UNITS)}.")
        self.path, self.names, self.units = path, names, units
        self.values = _read_csv(path) if path.suffix.lower() == ".csv" else _read_netcdf(path)

    def has(self, name: str) -> bool:
        return self.names.get(name, name) in self.values

    def of(self, name: str) -> Array:
        column = self.names.get(name, name)
        if column not in self.values:
            raise ValueError(
                f"{self.path} has no column {column!r} for {name}; it has {', '.join(list(self.values)[:12])} ... "
                "Map other names with names={...}."
            )
        values, unit = self.values[column]
        quantity = name.rsplit("_", 1)[-1]
        kind = next(kind for kind, members in KINDS.items() if quantity in members)
        unit = self.units.get(kind) if unit is None else unit
        if unit is None and kind != "none":
            raise ValueError(
                f"{self.path}: column {column!r} carries no unit; write it as '{column} [unit]' or give "
                f"units={{{kind!r}: ...}} ({', '.join(UNITS[kind])})."
            )
        if (unit or "") not in UNITS[kind]:
            raise ValueError(f"{self.path}: unit {unit!r} of {column!r} is not known; use {', '.join(UNITS[kind])}.")
        if not np.isfinite(values).all():
            bad = int(np.flatnonzero(~np.isfinite(values))[0])
            raise ValueError(f"{self.path}: column {column!r} is not a number in row {bad}; fill or cut the gap.")
        return values * UNITS[kind][unit or ""]


def _read_csv(path: Path) -> dict[str, tuple[Array, str | None]]:
    found: dict[str, tuple[Array, str | None]] = {}
    for header, values in read_table(path).items():
        match = re.fullmatch(r"(.*?)\s*\[(.*)\]\s*", header)
        name, unit = (match[1], match[2].strip()) if match else (header.strip(), None)
        found[name] = (values, unit)
    return found


def _read_netcdf(path: Path) -> dict[str, tuple[Array, str | None]]:
    return {
        str(name): (np.asarray(v.values, float), v.attrs.get("units"))
        for name, v in read_netcdf(path, decode_times=False).variables.items()
        if v.ndim == 1 and v.dtype.kind in "fiu"
    }


def _stack(columns: _Columns, quantities: tuple[str, ...]) -> Array:
    """Values of all bodies, shape (n, 5, k)."""
    return np.stack([np.stack([columns.of(f"{b}_{q}") for q in quantities], axis=-1) for b in BODIES], axis=1)


def _from_quaternions(values: Array, path: Path) -> Rotation:
    norm = np.linalg.norm(values, axis=-1)
    if np.abs(norm - 1.0).max() > 1e-2:
        raise ValueError(f"{path}: quaternions have norms of {norm.min():.3g} to {norm.max():.3g}; they must be 1.")
    return Rotation.from_quat(values.reshape(-1, 4), scalar_first=True)


def _check_time(time: Array, path: Path) -> None:
    steps = np.diff(time)
    if len(steps) < 10 or not (steps > 0.0).all():
        raise ValueError(f"{path}: time must rise over at least ten samples; sort the rows, or look at its unit.")
    mean = float(steps.mean())
    if mean > COARSEST:
        raise ValueError(
            f"{path}: samples lie {1e3 * mean:.3g} ms apart and may lie {1e3 * COARSEST:g} ms; write more of them, or "
            "look at the unit of time."
        )
    if np.abs(steps - mean).max() > 0.05 * mean:
        raise ValueError(f"{path}: samples are uneven ({1e3 * steps.min():.3g} to {1e3 * steps.max():.3g} ms).")


def _check_places(position: Array, rotation: Array, path: Path) -> None:
    """Raise ValueError unless the wheels stay at the four corners of the hull, seen from it."""
    seen = np.einsum("nij,nbi->nbj", rotation[:, 0], position[:, 1:] - position[:, :1])
    for wheel, name in enumerate(BODIES[1:]):
        x, y = seen[:, wheel, 0], seen[:, wheel, 1]
        right = ("front" in name) == bool(np.median(x) > 0.0) and ("left" in name) == bool(np.median(y) > 0.0)
        if not right:
            raise ValueError(
                f"{path}: {name} lies at x = {np.median(x):.3g}, y = {np.median(y):.3g} m in the hull's axes; x must "
                "point forward and y to the left. Look at `up` (y to the right goes with '-z') and at the names."
            )
        spread = float(np.hypot(x.std(), y.std())) / float(np.hypot(np.median(x), np.median(y)))
        if spread > 0.1:
            raise ValueError(
                f"{path}: {name} wanders by {100 * spread:.0f} % of its distance in the hull's axes; positions and "
                "angles contradict each other. Look at the unit and the sequence of the angles (yaw, pitch, roll)."
            )


def _check_speeds(time: Array, given: Array, states: BodyStates, path: Path) -> None:
    found = np.stack([_line(time, given[:, b], states.time) for b in range(5)], axis=1)
    size = float(np.sqrt((found**2).sum(-1).mean()))
    apart = float(np.sqrt(((found - states.velocity) ** 2).sum(-1).mean()))
    if size > 1e-3 and apart > SPEED_TOLERANCE * size:
        raise ValueError(
            f"{path}: given speeds differ from those of the positions by {100 * apart / size:.0f} % (limit "
            f"{100 * SPEED_TOLERANCE:.0f} %); look at their unit and axes (those of the positions), or leave them out."
        )


def _check_lift(states: BodyStates, wrench: Array, path: Path) -> None:
    lift = np.einsum("nbj,nbj->nb", states.rotation[..., 2, :], wrench[..., :3]).sum(axis=1).mean()
    if lift < 0.0:
        raise ValueError(
            f"{path}: the water pulls the vehicle down by {-lift:.4g} N on average; it must carry it. Look at `up`, "
            "`load_axes`, and whether these are the loads on the vehicle and not on the water."
        )


def _line(time: Array, values: Array, wanted: Array) -> Array:
    return np.stack([np.interp(wanted, time, column) for column in values.T], axis=-1)


def _resampled(time: Array, position: Array, rotation: Array) -> BodyStates:
    """Motion every millisecond and its rates: cubic splines of the positions, arcs between the attitudes."""
    wanted = SAMPLING * np.arange(math.floor(time[-1] / SAMPLING + 1e-6) + 1)
    inside = np.clip(wanted, time[0], time[-1])
    spline = CubicSpline(time, position)
    turned = np.stack(
        [Slerp(time, Rotation.from_matrix(rotation[:, b]))(inside).as_matrix() for b in range(5)], axis=1
    )  # fmt: skip
    index = np.arange(len(wanted))
    after, before = np.minimum(index + 1, index[-1]), np.maximum(index - 1, 0)
    arcs = Rotation.from_matrix((turned[after] @ turned[before].mT).reshape(-1, 3, 3)).as_rotvec().reshape(-1, 5, 3)
    rates = arcs / (wanted[after] - wanted[before])[:, None, None]
    rates = smoothed(rates, SAMPLING, 2.0 * float(time[1] - time[0]))
    return BodyStates(
        time=wanted, position=spline(inside), rotation=turned, velocity=spline(inside, 1), angular_velocity=rates,
        acceleration=spline(inside, 2), angular_acceleration=np.asarray(np.gradient(rates, SAMPLING, axis=0)),
        wheel_speed=np.full((len(wanted), 4), np.nan),
    )  # fmt: skip


def _packed(name: str, values: Array) -> NDArray[Any]:
    """Values in the precision of a packed run."""
    return values.astype(np.float64 if name in DOUBLE else np.float32)


def _dataset(states: BodyStates, wrench: Array, water: Water, path: Path, scenario: str) -> xr.Dataset:
    rotation = states.rotation
    yaw = np.unwrap(np.arctan2(rotation[..., 1, 0], rotation[..., 0, 0]), axis=0)
    speed = states.velocity[:, 0, :2]
    values = {
        "position": states.position,
        "quaternion": quaternions(rotation),
        "yaw": yaw,
        "pitch": -np.arcsin(np.clip(rotation[..., 2, 0], -1.0, 1.0)),
        "roll": np.arctan2(rotation[..., 2, 1], rotation[..., 2, 2]),
        "velocity": states.velocity,
        "angular_velocity": states.angular_velocity,
        "acceleration": states.acceleration,
        "angular_acceleration": states.angular_acceleration,
        "forward_velocity": np.cos(yaw[:, 0]) * speed[:, 0] + np.sin(yaw[:, 0]) * speed[:, 1],
        "lateral_velocity": np.cos(yaw[:, 0]) * speed[:, 1] - np.sin(yaw[:, 0]) * speed[:, 0],
        "flow_state": flow_states(states, water),
        "water_wrench": wrench,
    }
    described = {name: VARIABLES[name] for name in values} | {
        "water_wrench_smooth": ("time body component", "N, N m", "water_wrench, centred moving average")
    }
    values["water_wrench_smooth"] = smoothed(wrench, SAMPLING)
    found = xr.Dataset(
        {
            name: (dims.split(), _packed(name, values[name]), {"units": unit, "long_name": text})
            for name, (dims, unit, text) in described.items()
        },
        coords={
            "time": ("time", states.time, {"units": "s", "long_name": "time since the first sample"}),
            "body": list(BODIES), "axis": list(PLACES), "quaternion_component": ["w", "x", "y", "z"],
            "component": list(WRENCH_COMPONENTS), "state": list(FLOW_STATES),
        },
        attrs=provenance()
        | {
            "title": f"imported from {path.name}", "status": "completed", "scenario": scenario,
            "parameters": parameters_json({"water": water}),
        },
    )  # fmt: skip
    return with_described_names(found)
