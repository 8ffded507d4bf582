"""Results as an xarray.Dataset: built from a run's records, with units, names and provenance; saved as netCDF."""

from __future__ import annotations

import logging

import numpy as np
import xarray as xr

from exumob.coupling.flow_code import BuiltInFlow
from exumob.flow.revision import solver_revision
from exumob.ground.terrain import Terrain
from exumob.multibody.energy_account import WORK_KINDS
from exumob.multibody.system import MultibodyVehicle
from exumob.simulation.description import RunDescription
from exumob.simulation.over_ground import keel_clearance, outside_terrain
from exumob.simulation.over_water import water_met
from exumob.simulation.summary import range_shares
from exumob.simulation.trust import trust_of
from exumob.simulation.verdict import judge, with_verdict
from exumob.support.arrays import Array
from exumob.support.constants import GRAVITY
from exumob.support.dimensions import with_described_names
from exumob.support.provenance import parameters_json, provenance
from exumob.vehicle.motion import BODIES, WHEELS, WRENCH_COMPONENTS, BodyStates, quaternions
from exumob.vehicle.parameters import Vehicle
from exumob.water.conditions import Water
from exumob.water.flow_states import FLOW_STATES, flow_states, local_depths
from exumob.water.mesh_file import mesh_provenance

logger = logging.getLogger(__name__)

VARIABLES = {
    # name: (dimensions, units, meaning)
    "position": ("time body axis", "m", "position of the body's origin, world axes"),
    "quaternion": ("time body quaternion_component", "1", "orientation, body to world, scalar first"),
    "yaw": ("time body", "rad", "heading, counter-clockwise from world x"),
    "pitch": ("time body", "rad", "pitch, bow down positive"),
    "roll": ("time body", "rad", "roll, starboard down positive"),
    "velocity": ("time body axis", "m s-1", "velocity of the body's origin, world axes"),
    "angular_velocity": ("time body axis", "rad s-1", "angular velocity, world axes"),
    "acceleration": ("time body axis", "m s-2", "acceleration of the body's origin, world axes"),
    "angular_acceleration": ("time body axis", "rad s-2", "angular acceleration, world axes"),
    "forward_velocity": ("time", "m s-1", "hull speed along its heading"),
    "lateral_velocity": ("time", "m s-1", "hull speed to the left of its heading"),
    "wheel_speed": ("time wheel", "rad s-1", "spin of the wheel, positive rolls forward"),
    "steering_angle": ("time front_wheel", "rad", "front-wheel angle, positive to the left"),
    "spin_torque": ("time wheel", "N m", "driving torque on the wheel (spin constraint)"),
    "spin_power": ("time wheel", "W", "power of the driving torque"),
    "sinkage": ("time wheel", "m", "sinkage of the tyre below the soil surface"),
    "slip_ratio": ("time wheel", "1", "slip ratio, positive driving, negative braking; nan without contact"),
    "slip_angle": ("time wheel", "rad", "angle of the wheel's velocity to its plane"),
    "soil_force": ("time wheel axis", "N", "force of the soil on the tyre, world axes"),
    "soil_moment": ("time wheel axis", "N m", "moment of the soil about the wheel centre, world axes"),
    "hull_soil_force": ("time axis", "N", "force of the soil on the hull, world axes"),
    "hull_soil_moment": ("time axis", "N m", "moment of the soil about the hull's origin, world axes"),
    "hull_contact_center": (
        "time axis",
        "m",
        "centre of the soil's pressure on the hull, world axes; nan without contact",
    ),
    "hull_load_share": ("time", "1", "share of the weight that the soil bears under the hull"),
    "suspension_force": ("time wheel", "N", "spring, damper and stops, pushing wheel and hull apart"),
    "keel_clearance": (
        "time",
        "m",
        "smallest height of the hull above the undisturbed soil surface; negative: it has sunk in",
    ),
    "outside_terrain": ("time body", "1", "1 where a wheel's centre or a part of the hull is outside the height field"),
    "water_depth": ("time", "m", "depth of the undisturbed water below the hull's origin; 0 on dry land"),
    "water_level": ("time", "m", "level of the undisturbed water there, world z; nan without water"),
    "current": ("time axis", "m s-1", "velocity of the undisturbed water there, world axes"),
    "suspension_stroke": ("time wheel", "m", "wheel above its ride height in the hull"),
    "flow_state": ("time body state", "rad, m s-1, m", "states of paper Eq. 7"),
    "water_wrench": ("time body component", "N, N m", "water about the body's origin, body axes"),
    "soil_load": ("time body axis", "N", "force balance: soil, world axes"),
    "water_load": ("time body axis", "N", "force balance: water, world axes"),
    "gravity_load": ("time body axis", "N", "force balance: weight, world axes"),
    "suspension_load": ("time body axis", "N", "force balance: springs, dampers and stops, world axes"),
    "constraint_load": ("time body axis", "N", "force balance: reactions of all constraints, world axes"),
    "mass": ("body", "kg", "mass of the body (a wheel with its upright)"),
    "work": ("time work_kind", "J", "work done on the vehicle since the start"),
    "kinetic_energy": ("time", "J", "kinetic energy of all bodies"),
    "stored_energy": ("time", "J", "energy of springs and of height"),
    "constraint_error": ("time constraint_level", "m or rad, rad s-1", "largest constraint residual"),
}
"""The variables of a result."""
COMMENTS = {
    "slip_ratio": (
        "(r w - v) / (r w) where the tread is faster than the wheel's centre, (r w - v) / v where it is slower: 1 for "
        "a wheel that spins in place, -1 for a locked one that slides; it fades to 0 where both stand. A wheel that "
        "does not touch the soil has no slip: nan."
    ),
    "flow_state": "units along state: rad, rad, m s-1, m s-1, m",
    "water_wrench": "units along component: N, N, N, N m, N m, N m",
    "constraint_error": "units along constraint_level: m or rad; m s-1 or rad s-1",
}
"""Comments on some variables (attribute ``comment``)."""


def build_dataset(
    model: MultibodyVehicle, run: RunDescription, status: str, wall_times: dict[str, float], cause: str = ""
) -> xr.Dataset:
    """Build the Dataset of a run, complete or not, with its verdict (`exumob.simulation.verdict`).

    Dimensions: ``time``, ``body`` (`exumob.vehicle.motion.BODIES`), ``wheel``, ``axis`` (world x, y, z), ``component``
    (of a wrench), ``state`` (Eq. 7), ``work_kind``, ``condition`` (of the verdict). The forces on each body balance:
    ``soil_load + water_load + gravity_load + suspension_load + constraint_load = mass * acceleration``.

    Parameters
    ----------
    model : MultibodyVehicle
        The vehicle after the run.
    run : RunDescription
    status : str
        How the run ended.
    wall_times : dict of str to float
        Times of computing [s], kept as attributes.
    cause : str
        Cause of a breakdown (`exumob.support.errors.SimulationError.cause`), if it is known.

    Returns
    -------
    xarray.Dataset
        Every variable has ``units`` and ``long_name``; the attributes hold all parameters, versions, the status and the
        verdict.
    """
    vehicle, water = run.vehicle, run.water
    records = model.records
    states = BodyStates(*(records["motion"][name] for name in BodyStates.__dataclass_fields__))
    loads = records["loads"]
    masses = body_masses(vehicle)
    rotation = states.rotation
    yaw = np.unwrap(np.arctan2(rotation[..., 1, 0], rotation[..., 0, 0]), axis=0)
    left = np.stack([-np.sin(yaw[:, 0]), np.cos(yaw[:, 0])], axis=-1)
    ahead = np.stack([np.cos(yaw[:, 0]), np.sin(yaw[:, 0])], axis=-1)
    hull_velocity = states.velocity[:, 0, :2]
    values: dict[str, np.ndarray] = {
        "position": states.position,
        "quaternion": quaternions(rotation),
        "yaw": yaw,
        "pitch": -np.arcsin(np.clip(rotation[..., 2, 0], -1, 1)),
        "roll": np.arctan2(rotation[..., 2, 1], rotation[..., 2, 2]),
        "velocity": states.velocity,
        "angular_velocity": states.angular_velocity,
        "acceleration": states.acceleration,
        "angular_acceleration": states.angular_acceleration,
        "forward_velocity": (hull_velocity * ahead).sum(-1),
        "lateral_velocity": (hull_velocity * left).sum(-1),
        "wheel_speed": states.wheel_speed,
        "steering_angle": records["steering"],
        "spin_torque": records["spin_torque"],
        "spin_power": records["spin_torque"] * states.wheel_speed,
        "sinkage": loads["sinkage"],
        "slip_ratio": np.where(loads["sinkage"] > 0.0, loads["slip_ratio"], np.nan),
        "slip_angle": loads["slip_angle"],
        "soil_force": loads["soil_force"],
        "soil_moment": loads["soil_moment"],
        "hull_soil_force": loads["hull_soil"]["force"],
        "hull_soil_moment": loads["hull_soil"]["moment"],
        "hull_contact_center": np.where(
            loads["hull_soil"]["sinkage"][:, None] > 0.0, loads["hull_soil"]["center"], np.nan
        ),
        "hull_load_share": loads["hull_soil"]["force"][:, 2] / (GRAVITY * masses.sum()),
        "suspension_force": loads["suspension_force"],
        "keel_clearance": keel_clearance(vehicle, run.terrain, states),
        "outside_terrain": outside_terrain(vehicle, run.terrain, states).astype(np.int8),
        **_water_at_hull(states, water, run.terrain),
        "suspension_stroke": loads["stroke"],
        "flow_state": flow_states(states, water, run.terrain),
        "water_wrench": loads["water_wrench"],
        **_force_balance(records, states, masses),
        "mass": masses,
        "work": records["energy_account"]["work"],
        "kinetic_energy": loads["kinetic_energy"],
        "stored_energy": loads["spring_energy"] + loads["gravity_energy"],
        "constraint_error": records["constraint_error"],
    }
    dataset = xr.Dataset(
        {
            name: (dims.split(), np.ascontiguousarray(values[name]), attributes(name))
            for name, (dims, *_) in VARIABLES.items()
        },
        coords={
            "time": ("time", np.array(states.time), {"units": "s", "long_name": "time since release"}),
            "body": list(BODIES),
            "wheel": list(WHEELS),
            "front_wheel": list(WHEELS[:2]),
            "axis": ["x", "y", "z"],
            "quaternion_component": ["w", "x", "y", "z"],
            "component": list(WRENCH_COMPONENTS),
            "state": list(FLOW_STATES),
            "work_kind": list(WORK_KINDS),
            "constraint_level": ["position", "velocity"],
        },
    )
    dataset = dataset.assign({f"hydrodynamics_{k}": v for k, v in run.hydrodynamics.record().items()})
    dataset = dataset.merge({f"coupling_{k}": v for k, v in run.coupling.record().items()}, join="outer")
    dataset.attrs = provenance() | {
        "title": f"exumob run of {vehicle.name}",
        "status": status,
        "start": model.start_kind,
        "hydrodynamics": type(run.hydrodynamics).__name__,
        "coupling": type(run.coupling).__name__,
        "parameters": parameters_json(run.parts()),
        **wall_times,
        **_flow_solver(run),
        **_trust(run, dataset, states),
        **({"cause": cause} if cause else {}),
        **mesh_provenance(vehicle.hull),
    }
    return with_described_names(with_verdict(dataset, judge(dataset, vehicle=vehicle)))


def _flow_solver(run: RunDescription) -> dict[str, str | float]:
    """Cells [m] and version of the built-in flow solver, if it is in the loop: runs of two of them are not alike."""
    code = getattr(run.hydrodynamics, "flow", None)
    return {"cell_size": code.cell_size, "flow_revision": solver_revision()} if isinstance(code, BuiltInFlow) else {}


def _trust(run: RunDescription, dataset: xr.Dataset, states: BodyStates) -> dict[str, str | float]:
    """Line of trust of a run, with what it met of the water."""
    shares = range_shares(dataset)
    found = trust_of(
        run, shares.get("out_of_range_share"), shares.get("fallback_share"), water_met(run, states),
        shares.get("wide_range_share"),
    )  # fmt: skip
    return found.attributes()


def _water_at_hull(states: BodyStates, water: Water | None, terrain: Terrain) -> dict[str, Array]:
    """Depth, level and current of the undisturbed water at the hull's origin."""
    n = len(states)
    if water is None:
        return {"water_depth": np.zeros(n), "water_level": np.full(n, np.nan), "current": np.zeros((n, 3))}
    places = states.position[:, 0, :2].copy()
    level, velocity = water.at(places, terrain)
    return {
        "water_depth": local_depths(water.over(terrain), places),
        "water_level": level,
        "current": np.column_stack([velocity, np.zeros(n)]),
    }


def attributes(name: str) -> dict[str, str]:
    """Return ``units``, ``long_name`` and, where there is one, ``comment`` of a variable of `VARIABLES`."""
    _, units, text = VARIABLES[name]
    about = {"units": units, "long_name": text}
    return about | ({"comment": COMMENTS[name]} if name in COMMENTS else {})


def body_masses(vehicle: Vehicle) -> Array:
    """Masses of the five bodies [kg], shape (5,): a wheel counts with its upright."""
    front, rear = vehicle.axle_suspensions
    wheels = [vehicle.wheel.mass + s.upright_mass for s in (front, front, rear, rear)]
    return np.array([vehicle.hull.mass, *wheels])


def _force_balance(records: np.ndarray, states: BodyStates, masses: Array) -> dict[str, Array]:
    loads = records["loads"]
    shape = states.position.shape
    soil, gravity, suspension, constraint = (np.zeros(shape) for _ in range(4))
    soil[:, 0], soil[:, 1:] = loads["hull_soil"]["force"], loads["soil_force"]
    water = np.einsum("nbij,nbj->nbi", states.rotation, loads["water_wrench"][..., :3])
    gravity[:, :, 2] = -GRAVITY * masses
    spring = loads["suspension_force"][..., None] * states.rotation[:, 0, None, :, 2]
    suspension[:, 0], suspension[:, 1:] = spring.sum(axis=1), -spring
    reaction = records["constraint_wrench"][..., :3]
    constraint[:, 0] = reaction[:, 0]
    constraint[:, 1:] = reaction[:, 1:5] + reaction[:, 5:]
    return {
        "soil_load": soil,
        "water_load": water,
        "gravity_load": gravity,
        "suspension_load": suspension,
        "constraint_load": constraint,
    }
