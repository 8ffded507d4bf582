"""Runs to learn from: packed and loaded.

A packed run holds the motion and the water's loads at every millisecond: positions, rotations and their rates, the
states of paper Eq. (7) and the wrenches on the five bodies, raw and smoothed. `exumob.simulation.results.VARIABLES`
describes each variable.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from exumob.learning.compact import DERIVED, MARK, THINNED, filled, jumps
from exumob.simulation import verdict
from exumob.simulation.result_files import load_dataset
from exumob.simulation.results import VARIABLES as RESULTS
from exumob.simulation.results import attributes
from exumob.support.arrays import Array
from exumob.support.constants import GRAVITY
from exumob.support.dimensions import with_described_names
from exumob.support.quantities import unusual
from exumob.support.smoothing import WINDOW, smoothed, window_samples
from exumob.surrogates.memory import filtered
from exumob.surrogates.networks import Architecture
from exumob.surrogates.vehicle_shape import geometry
from exumob.vehicle.motion import BODIES, HISTORY_STEP, WHEELS, WRENCH_COMPONENTS, BodyStates, quaternions
from exumob.vehicle.parameters import Vehicle
from exumob.water.calibrated import CalibratedHydrodynamics
from exumob.water.coefficients import CoefficientHydrodynamics
from exumob.water.conditions import Water
from exumob.water.flow_states import FLOW_STATES, flow_states
from exumob.water.mesh_file import mesh_digest
from exumob.water.wave_loads import WaveCoefficients

LEAST_LOAD = 1e-3
"""Deviation of a load over the vehicle's weight (a moment: times half the wheelbase) below which an error is taken over
this much: the dry hull of shallow water has loads of next to nothing, and errors of many times that do nothing [-]."""
SAMPLING = HISTORY_STEP
"""Interval between the samples of a packed run [s]."""
VARIABLES = (
    "position", "quaternion", "yaw", "pitch", "roll", "velocity", "angular_velocity", "acceleration",
    "angular_acceleration", "forward_velocity", "lateral_velocity", "wheel_speed", "steering_angle", "sinkage",
    "slip_ratio", "slip_angle", "soil_force", "suspension_stroke", "flow_state", "water_wrench",
)  # fmt: skip
"""Variables of a run that are packed at every sample."""
FOR_VERDICT = tuple(name for name in (*verdict.NEEDED, *verdict.FURTHER) if name not in (*VARIABLES, "water_load"))
"""Variables that the verdict on a run depends on besides: packed at every sample, too, if the run holds them.

The water's forces are in the wrenches already."""
SURFACE = ("hydrodynamics_elevation", "hydrodynamics_frame")
"""Variables of the free surface that are packed every `SURFACE_INTERVAL`, if the run holds them."""
SURFACE_INTERVAL = 2.0
"""Interval between the free surfaces kept [s], as in paper Fig. 9."""
EFFORT = ("coupling_iterations", "coupling_residual", "hydrodynamics_iterations", "hydrodynamics_halvings")
"""Effort of a run with the flow in the loop: mean and largest value of each are kept as attributes."""
NEEDED = (
    "time", "position", "quaternion", "velocity", "angular_velocity", "acceleration", "angular_acceleration",
    "water_wrench", "water_wrench_smooth",
)  # fmt: skip
"""Variables that a run to learn from must have."""
DOUBLE = ("position", "hull_contact_center")
"""Variables that are packed in double precision: coordinates of a map are large, and a millimetre counts."""
MOST_LOAD, MOST_JUMP = 10.0, 1000.0
"""Largest loads that are plausible, over the scales of `load_scale` [-]: of 99 % of the instants, and at jumps.

In the runs that come with exumob they are 0.02 to 0.1, and 4 at the largest jump.
"""
MOST_SPEED = 100.0
"""Largest speed of a body that is plausible [m/s]."""
LEAST_MOTION = 1e-3
"""Distance that some body moves at least in a run to learn from [m]."""
JUMP_REACH = 20
"""Number of instants left out on either side of a jump."""


def pack(run: xr.Dataset) -> xr.Dataset:
    """Select the part of a run that is kept in the data set, in single precision but for the positions.

    Parameters
    ----------
    run : xarray.Dataset
        Result of `exumob.simulate`, recorded every millisecond.

    Returns
    -------
    xarray.Dataset
        `VARIABLES`, `FOR_VERDICT`, ``water_wrench_smooth`` (centred moving average: no phase shift) and the surface at
        a few instants. `exumob.simulation.verdict.judge` says of it what it says of the run.

    Raises
    ------
    ValueError
        If the run is not complete or not recorded every millisecond.
    """
    status = run.attrs.get("status", "")
    if status != "completed":
        raise ValueError(f"pack: the run is not complete ({status or 'no status'}); finish it first.")
    missing = [name for name in VARIABLES if name not in run]
    if missing:
        raise ValueError(f"pack: the run holds no {', no '.join(missing)}; give a result of exumob.simulate.")
    _check_sampling(run["time"].values)
    packed = run[[*VARIABLES, *(name for name in FOR_VERDICT if name in run)]]
    packed["water_wrench_smooth"] = _smooth(run["water_wrench"])
    surface = [name for name in SURFACE if name in run]
    if surface:
        kept = np.arange(0.0, float(run["time"][-1]) + 1e-6, SURFACE_INTERVAL)
        packed = packed.merge(run[surface].sel(snapshot=kept, method="nearest"))
    doubles = {name: v for name, v in packed.data_vars.items() if v.dtype == np.float64 and name not in DOUBLE}
    single = {name: v.astype(np.float32) for name, v in doubles.items()}
    packed = packed.assign({name: v.assign_attrs(packed[name].attrs) for name, v in single.items()})
    effort: dict[str, float] = {}
    for name in EFFORT:
        if name in run:
            effort |= {f"{name}_mean": float(run[name].mean()), f"{name}_max": float(run[name].max())}
    return packed.assign_attrs(run.attrs | effort)


def _smooth(wrench: xr.DataArray) -> xr.DataArray:
    return wrench.copy(data=smoothed(wrench.values, SAMPLING)).assign_attrs(
        long_name=f"{wrench.attrs['long_name']}, centred moving average over {1e3 * WINDOW:g} ms",
        samples=window_samples(SAMPLING),
    )


def complete(run: xr.Dataset) -> xr.Dataset:
    """Give a compact run (`exumob.learning.compact`) what was left out."""
    motion = histories(body_states(run), run["water_wrench"].values, water_of(run), {})
    whole = run.assign({name: motion[name].variable for name in DERIVED})
    order = [name for name in VARIABLES if name in whole]
    return whole[order + [str(name) for name in whole.data_vars if name not in VARIABLES]]


def histories(states: BodyStates, wrench: Array, water: Water, attrs: Mapping[str, Any]) -> xr.Dataset:
    """Return motion and loads as a packed run: what comes of other programs, and of captive runs.

    Parameters
    ----------
    states : BodyStates
        At every millisecond.
    wrench : array, shape (n, 5, 6)
        Force [N] and moment [N m] of the water about the bodies' origins, body axes.
    water : Water
    attrs : mapping
        Attributes: ``parameters`` (with the water), ``status``, ``scenario`` and what else is known.

    Returns
    -------
    xarray.Dataset
        Motion, states of Eq. (7) and wrenches, as `pack` gives them; nothing of the soil.
    """
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
    if np.isfinite(states.wheel_speed).all():
        values["wheel_speed"] = states.wheel_speed
    found = xr.Dataset(
        {name: (RESULTS[name][0].split(), _packed(name, v), attributes(name)) for name, v in values.items()},
        coords={
            "time": ("time", states.time, {"units": "s", "long_name": "time since the first sample"}),
            "body": list(BODIES), "axis": ["x", "y", "z"], "quaternion_component": ["w", "x", "y", "z"],
            "component": list(WRENCH_COMPONENTS), "state": list(FLOW_STATES),
            **({"wheel": list(WHEELS)} if "wheel_speed" in values else {}),
        },
        attrs=dict(attrs),
    )  # fmt: skip
    found["water_wrench_smooth"] = _smooth(found["water_wrench"].copy(data=wrench)).astype(np.float32)
    return with_described_names(found)


def _packed(name: str, values: Array) -> NDArray[Any]:
    """Values in the precision of a packed run."""
    return values.astype(np.float64 if name in DOUBLE else np.float32)


def load_run(file: str | Path) -> xr.Dataset:
    """Load a run to learn from: a packed or compact one, or a whole result of `exumob.simulate`, which is packed.

    Raises
    ------
    ValueError
        If the file cannot be read, or is not a run to learn from (`pack`, `check_run`).
    """
    run = load_dataset(file)
    try:
        if MARK in run.attrs:
            run = complete(filled(run) if THINNED in run.attrs else run)
        elif "water_wrench" in run and "water_wrench_smooth" not in run:
            run = pack(run)
    except ValueError as error:
        raise ValueError(f"{file}: {error}") from None
    check_run(run, str(file))
    return run


def load_runs(files: Iterable[str | Path]) -> dict[str, xr.Dataset]:
    """Load runs (`load_run`), by the name of their scenario.

    Raises
    ------
    ValueError
        If a file cannot be read, is not a run to learn from, or repeats a scenario.
    """
    runs: dict[str, xr.Dataset] = {}
    of: dict[str, str | Path] = {}
    for file in files:
        run = load_run(file)
        name = str(run.attrs.get("scenario", Path(file).stem))
        if name in runs:
            raise ValueError(f"{file}: there is another run of {name} ({of[name]}); keep one of them.")
        runs[name], of[name] = run, file
    return runs


def check_run(run: xr.Dataset, name: str) -> None:
    """Refuse a run from which nothing can be learnt.

    Raises
    ------
    ValueError
        If variables are missing or of another shape, samples do not lie 1 ms apart, a value is not finite, nothing
        moves, or loads are larger than water can exert (`check_loads`); the message begins with the name.
    """
    missing = [variable for variable in NEEDED if variable not in run.variables]
    if missing or "parameters" not in run.attrs:
        raise ValueError(
            f"{name} is not a run to learn from ({', '.join(missing) or 'parameters'} missing); "
            "`exumob.learning.dataset.pack` and `exumob.learning.importing` make such files."
        )
    time = run["time"].values
    if time.ndim != 1 or time.dtype.kind != "f":
        raise ValueError(
            f"{name}: time is an array of {time.dtype} of shape {time.shape}; it must be one row of seconds."
        )
    _check_sampling(time, name)
    shapes = {"quaternion": (5, 4), "water_wrench": (5, 6), "water_wrench_smooth": (5, 6)}
    for variable in NEEDED[1:]:
        values, wanted = run[variable].values, (len(time), *shapes.get(variable, (5, 3)))
        if values.shape != wanted or values.dtype.kind not in "fiu":
            raise ValueError(
                f"{name}: {variable} has shape {values.shape} of {values.dtype}; it must be {wanted} of numbers. Make "
                "the file anew (`exumob.learning.dataset.pack`)."
            )
        bad = ~np.isfinite(values)
        if bad.any():
            raise ValueError(
                f"{name}: {variable} is not finite at {int(bad.sum())} of {bad.size} places, first at "
                f"{time[int(np.argwhere(bad)[0][0])]:.3f} s; leave the run out, or make it anew."
            )
    norm = np.linalg.norm(run["quaternion"].values.astype(float), axis=-1)
    if np.abs(norm - 1.0).max() > 1e-2:
        raise ValueError(f"{name}: quaternions have norms of {norm.min():.3g} to {norm.max():.3g}; they must be 1.")
    check_motion(time, run["position"].values, name)
    check_loads(body_states(run), run["water_wrench"].values, water_of(run), name)


def check_geometry(runs: Mapping[str, xr.Dataset], vehicle: Vehicle) -> None:
    """Raise ValueError if a run that exumob has made was made with a vehicle of another geometry."""
    wanted = geometry(vehicle)
    for name, run in runs.items():
        stored = json.loads(run.attrs["parameters"]).get("vehicle")
        if stored is None:
            continue
        car = next(iter(stored.values()))
        for field, value in wanted.items():
            found: Any = car
            for part in field.split("."):
                found = found[part]
            if isinstance(value, float) and not np.isclose(found, value, rtol=1e-3):
                raise ValueError(
                    f"{name}: this run was made with a vehicle whose {field} is {found}; that of {vehicle.name} is "
                    f"{value}. Networks learn from runs of their own vehicle: leave out what was not made with "
                    f"{vehicle.name}, or give the vehicle of these runs (--vehicle)."
                )
        if run.attrs.get("hull_mesh_sha256", "") != mesh_digest(vehicle.hull):
            raise ValueError(
                f"{name} was made with another Hull.mesh, or another content of that file, than {vehicle.name} has; "
                "give the vehicle and the mesh file of the runs."
            )


def check_motion(time: Array, position: Array, name: str) -> None:
    """Raise ValueError if nothing moves, which has nothing to teach, or something faster than a vehicle can.

    Parameters
    ----------
    time : array, shape (n,)
        [s].
    position : array, shape (n, 5, 3)
        [m].
    name : str
        The run, for the message.
    """
    position = position.astype(float)
    moved, speed = float(np.ptp(position, axis=0).max()), 0.0
    with np.errstate(over="ignore"):
        speed = float((np.abs(np.diff(position, axis=0)).max(axis=(1, 2)) / np.diff(time)).max())
    if moved < LEAST_MOTION:
        raise ValueError(
            f"{name}: no body moves by more than {moved:.3g} m in {len(position)} samples, and {LEAST_MOTION:g} m at "
            "least are needed; look at the unit of length and at the columns of the positions."
        )
    if speed > MOST_SPEED:
        raise ValueError(
            f"{name}: a body moves at {speed:.3g} m/s, beyond the limit of {MOST_SPEED:g} m/s; look at the units of "
            "length and time, and for jumps in the positions."
        )


def load_scale(states: BodyStates, water: Water) -> tuple[float, float]:
    """Return the size of the forces [N] and moments [N m] that water can exert on a vehicle of this size, about.

    Its length is the distance between the outermost bodies; the pressure on the square of it is that of the depth, and
    that of the fastest motion through the water.
    """
    position = states.position.astype(float)
    length = float(np.linalg.norm(np.ptp(position[0], axis=0)))
    speed = float(np.linalg.norm(states.velocity - water.velocity, axis=-1).max())
    force = float(water.density * (9.81 * water.uniform_depth + 0.5 * speed**2) * length**2)
    return force, force * length


def check_loads(states: BodyStates, wrench: Array, water: Water, name: str) -> None:
    """Raise ValueError if loads are far beyond what this water can exert at this speed, or all are nothing.

    Parameters
    ----------
    states : BodyStates
    wrench : array, shape (n, 5, 6)
        Forces [N] and moments [N m].
    water : Water
    name : str
        The run, for the message.
    """
    for what, unit, part, scale in zip(
        ("forces", "moments"), ("N", "N m"), (wrench[..., :3], wrench[..., 3:]), load_scale(states, water), strict=True
    ):
        sizes = np.abs(part.astype(float)).max(axis=(1, 2))
        for largest, most in ((float(np.quantile(sizes, 0.99)), MOST_LOAD), (float(sizes.max()), MOST_JUMP)):
            if largest > most * scale:
                raise ValueError(
                    f"{name}: {what} of {largest:.3g} {unit} are {largest / scale:.3g} times what "
                    f"{water.uniform_depth:g} m of water exert on a vehicle of this size at this speed, about "
                    f"{scale:.3g} {unit} (limit: {most:g} times); look at the unit of the loads, and at "
                    "those of length and time."
                )
    if not np.abs(wrench[..., :3]).max() > 0.0:
        raise ValueError(f"{name}: all forces of the water are 0; look at the columns of the loads.")


def _check_sampling(time: np.ndarray, name: str = "the run") -> None:
    steps = np.diff(time)
    if len(steps) == 0 or not np.abs(steps - SAMPLING).max() <= 1e-6:  # nan, too
        found = f"{1e3 * steps.min():.4g} to {1e3 * steps.max():.4g} ms" if len(steps) else "a single sample"
        raise ValueError(
            f"{name} is not sampled every {1e3 * SAMPLING:g} ms ({found}); record it with simulate(record_step=1e-3)."
        )


def body_states(run: xr.Dataset) -> BodyStates:
    """Motion of the five bodies of a packed or imported run."""
    q = run["quaternion"].values.astype(float)
    rotation = Rotation.from_quat(q.reshape(-1, 4), scalar_first=True).as_matrix().reshape(*q.shape[:2], 3, 3)
    wheel_speed = run["wheel_speed"].values if "wheel_speed" in run else np.full((len(q), 4), np.nan)
    moved = (run[name].values.astype(float) for name in ("position", "velocity", "angular_velocity", "acceleration"))
    position, velocity, angular_velocity, acceleration = moved
    return BodyStates(
        run["time"].values.astype(float), position, rotation, velocity, angular_velocity, acceleration,
        run["angular_acceleration"].values.astype(float), wheel_speed.astype(float),
    )  # fmt: skip


def water_of(run: xr.Dataset) -> Water:
    """Water in which a run was made.

    Raises
    ------
    ValueError
        If it was made without water, or does not say in which.
    """
    name = run.attrs.get("scenario", "the run")
    try:
        stored = json.loads(run.attrs["parameters"])["water"]
        if stored is not None:
            ((_, fields),) = stored.items()
            given: dict[str, Any] = {key: unusual(value) for key, value in fields.items()}
            return Water(**given)
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise ValueError(
            f"{name}: its parameters do not say in which water it was made ({type(error).__name__}: {error}); make the "
            "file anew."
        ) from None
    raise ValueError(f"{name}: made without water; there is nothing to learn.")


def windows(
    inputs: NDArray[Any], rows: NDArray[np.intp], architecture: Architecture, past: NDArray[Any] | None = None
) -> NDArray[Any]:
    """Windows of inputs as a network sees them.

    Parameters
    ----------
    inputs : array, shape (n, ...)
        Inputs at every millisecond of a run.
    rows : array of int, shape (m,)
        Instants at which the windows end; before the beginning of the run its first instant is repeated.
    architecture : Architecture
    past : array, shape (n, filters, ...), optional
        The filtered inputs (`exumob.surrogates.memory.filtered`), if they are known already.

    Returns
    -------
    array, shape (m, window, ...)
        Filtered inputs, then the instants, oldest first.
    """
    back = architecture.stride * np.arange(architecture.taps - 1, -1, -1)
    instants = inputs[np.maximum(rows[:, None] - back, 0)]
    if not architecture.filters:
        return instants
    past = filtered(inputs, architecture.filters, SAMPLING) if past is None else past
    return np.concatenate([past[rows], instants], axis=1)


def usable(run: xr.Dataset) -> NDArray[np.bool_]:
    """Mark the instants whose loads are the water's, which those near a jump are not (`exumob.learning.compact.jumps`).

    Returns
    -------
    array of bool, shape (n,)
        False near a jump.
    """
    time = run["time"].values
    good = np.ones(len(time), bool)
    at = jumps(run)
    for jump in np.searchsorted(time, at[(at > time[0] - SAMPLING) & (at < time[-1] + SAMPLING)] - 0.5 * SAMPLING):
        good[max(jump - JUMP_REACH, 0) : jump + JUMP_REACH + 1] = False
    return good


def least_loads(vehicle: Vehicle) -> Array:
    """Loads that a vehicle hardly feels: `LEAST_LOAD` of its weight [N], times half the wheelbase [N m]; shape (6,)."""
    least = LEAST_LOAD * vehicle.mass * GRAVITY
    return np.repeat([least, 0.5 * vehicle.wheelbase * least], 3)


def base_loads(run: xr.Dataset, vehicle: Vehicle, waves: WaveCoefficients | None = None) -> Array:
    """Loads of the coefficients along a run [N, N m], as in the loop with macro steps of 1 ms; shape (n, 5, 6).

    Parameters
    ----------
    run : xarray.Dataset
        Packed or imported.
    vehicle : Vehicle
    waves : WaveCoefficients, optional
        Those of the calibrated model; None: the published coefficients alone.
    """
    model = CoefficientHydrodynamics() if waves is None else CalibratedHydrodynamics(waves=waves)
    states = body_states(run)
    model.start(vehicle, water_of(run), SAMPLING)

    def never() -> BodyStates:
        raise AssertionError("the coefficient model needs no prediction")

    return np.stack([model.wrenches(states[max(n - 1, 0) : n + 1], never) for n in range(len(states))])
