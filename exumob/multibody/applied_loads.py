"""All applied loads on the vehicle at one instant: soil, suspension and water, in one compiled call per residual.

The multibody solver asks for them at every Newton iteration, so they are gathered here from the coordinates of nine
rigid bodies (hull, four uprights, four wheels: Euler-parameter nodes of 7 coordinates each) into one record. Power
and stored energy of each kind of load come out alongside: they make the energy balance of a run.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from exumob.ground.hull_contact import HULL_RECORD, HULL_SOIL, HullContact, hull_is_clear, soil_on_hull
from exumob.ground.soil import SOIL_RECORD, Soil
from exumob.ground.terrain import TERRAIN_RECORD, Terrain
from exumob.multibody.rigid_body import angular_velocity, cross, dot, generalized_moment, rotation_matrix
from exumob.multibody.soil_contact import WHEEL_CONTACT, soil_on_wheel
from exumob.support.arrays import Array
from exumob.support.constants import GRAVITY
from exumob.support.kernels import njit
from exumob.vehicle.parameters import Vehicle

LOAD_PARAMETERS = np.dtype(
    [
        ("soil", SOIL_RECORD),
        ("terrain", TERRAIN_RECORD),
        ("hull", HULL_RECORD),  # how it meets the ground, and when it was looked at last
        ("wheel_radius", "f8"),
        ("wheel_width", "f8"),
        ("standstill_rate", "f8"),  # [rad/s]: spin below which shear is regularised, see `contact_patch`
        ("ride_position", "f8", (4, 3)),  # wheel centres at ride height, hull axes from the hull's origin [m]
        ("stiffness", "f8", (4,)),
        ("damping", "f8", (4,)),
        ("preload", "f8", (4,)),  # spring force at ride height [N]
        ("bump_travel", "f8", (4,)),
        ("rebound_travel", "f8", (4,)),
        ("stop_stiffness", "f8", (4,)),
        ("stop_softening", "f8", (4,)),
        ("body_mass", "f8", (9,)),  # hull, uprights, wheels [kg]
        ("body_inertia", "f8", (9, 3)),  # principal, about the origin [kg m^2]
        ("gravity", "f8"),
        ("settling_rate", "f8"),  # [1/s]: mass-proportional damping while the static equilibrium is sought
        ("hold_rate", "f8"),  # [rad/s]: of the springs that hold the hull until the release; 0: it is free
        ("hold_place", "f8", (3,)),  # where they hold the hull's origin, free along the next [m]
        ("hold_normal", "f8", (3,)),  # unit normal of the ground there
    ],
    align=True,
)
"""All that the loads depend on besides the motion; constant during a run."""

LOADS = np.dtype(
    [
        ("water_wrench", "f8", (5, 6)),  # input: on the five bodies, body axes [N, N m]
        ("point_wrench", "f8", (5, 6)),  # input: of the user's forces, world axes, about each body's origin [N, N m]
        ("hull_force", "f8", (3,)),  # all in world axes [N], [N m]
        ("hull_torque", "f8", (3,)),
        ("upright_force", "f8", (4, 3)),
        ("upright_torque", "f8", (4, 3)),
        ("wheel_torque", "f8", (4, 3)),
        ("soil_force", "f8", (4, 3)),
        ("soil_moment", "f8", (4, 3)),  # about the wheel centre
        ("hull_soil", HULL_SOIL),
        ("suspension_force", "f8", (4,)),  # pushes hull and wheel apart [N]
        ("stroke", "f8", (4,)),  # wheel above its ride height relative to the hull [m]
        ("sinkage", "f8", (4,)),
        ("slip_ratio", "f8", (4,)),
        ("slip_angle", "f8", (4,)),  # of the velocity to the wheel's plane, 0 also in straight reverse
        ("soil_power", "f8"),  # on the tyres, into the vehicle [W]
        ("hull_soil_power", "f8"),
        ("damper_power", "f8"),
        ("water_power", "f8"),
        ("settling_power", "f8"),
        ("point_power", "f8"),  # of the user's forces
        ("spring_energy", "f8"),  # stored [J]
        ("kinetic_energy", "f8"),
        ("gravity_energy", "f8"),
        ("deepest", "f8"),  # largest sinkage over wheel radius
    ],
    align=True,
)
"""Loads on nine bodies at one instant, and what they are made of."""


class BodyMotion(NamedTuple):
    """BodyMotion of the nine bodies in compiled code: hull 0, upright of wheel i at 1 + i, wheel i at 5 + i."""

    node: Array
    """Coordinates of each body, shape (9, 7)"""
    rate: Array
    """Their time derivatives, shape (9, 7)"""
    rotation: Array
    """Rotation matrices, body to world, shape (9, 3, 3)"""
    angular_velocity: Array
    """World axes [rad/s], shape (9, 3)"""


def pack_parameters(
    vehicle: Vehicle, soil: Soil, terrain: Terrain, hull: HullContact, standstill_rate: float
) -> np.ndarray:  # fmt: skip
    """Pack what `vehicle_loads` needs into one record.

    Returns
    -------
    array of dtype `LOAD_PARAMETERS`, shape (1,)
    """
    parameters = np.zeros(1, LOAD_PARAMETERS)
    record = parameters[0]
    record["soil"] = soil.as_record()[0]
    record["terrain"] = terrain.as_arrays()[0][0]
    record["hull"] = hull.record[0]
    record["wheel_radius"] = vehicle.wheel.radius
    record["wheel_width"] = vehicle.wheel.width
    record["standstill_rate"] = standstill_rate
    record["ride_position"] = vehicle.wheel_centers - vehicle.hull_origin
    front, rear = vehicle.axle_suspensions
    share = vehicle.front_load_share
    for wheel, suspension in enumerate((front, front, rear, rear)):
        for name in ("stiffness", "damping", "bump_travel", "rebound_travel", "stop_stiffness", "stop_softening"):
            record[name][wheel] = getattr(suspension, name)
        record["preload"][wheel] = 0.5 * vehicle.hull.mass * GRAVITY * (share if wheel < 2 else 1.0 - share)
        record["body_mass"][1 + wheel] = suspension.upright_mass
        record["body_inertia"][1 + wheel] = np.diag(suspension.upright_inertia_tensor)
        record["body_mass"][5 + wheel] = vehicle.wheel.mass
        record["body_inertia"][5 + wheel] = np.diag(vehicle.wheel.inertia_tensor)
    record["body_mass"][0] = vehicle.hull.mass
    record["body_inertia"][0] = np.diag(vehicle.hull.inertia_tensor)
    record["gravity"] = GRAVITY
    return parameters


@njit(cache=True, error_model="numpy")
def stop_force(penetration: float, stiffness: float, softening: float) -> tuple[float, float]:
    """Force [N] and energy [J] of a bump stop compressed by `penetration` [m]; stiffness builds up over `softening`."""
    if penetration <= 0.0:
        return 0.0, 0.0
    if penetration < softening:
        return 0.5 * stiffness * penetration**2 / softening, stiffness * penetration**3 / (6.0 * softening)
    beyond = penetration - softening
    force = stiffness * (beyond + 0.5 * softening)
    energy = stiffness * (softening**2 / 6.0 + 0.5 * softening * beyond + 0.5 * beyond**2)
    return force, energy


@njit(cache=True, error_model="numpy")
def vehicle_loads(
    parameters: np.ndarray, heights: Array, hull_points: np.ndarray, coordinates: Array, velocities: Array,
    reference: Array, loads: np.ndarray, generalized: Array,
) -> None:  # fmt: skip
    """Compute the loads on all bodies for given coordinates.

    Parameters
    ----------
    parameters : array of dtype `LOAD_PARAMETERS`, shape (1,)
    heights : array, shape (ny, nx, 4)
        Field of heights of the terrain (see `Terrain.as_arrays`).
    hull_points : array of dtype `exumob.ground.hull_contact.HULL_POINT`, shape (n,)
    coordinates, velocities, reference : array, shape (63,)
        Node displacements and Euler-parameter increments, their rates, and the reference values.
    loads : array of dtype `LOADS`, shape (1,)
        ``water_wrench`` and ``point_wrench`` are read; everything else is written.
    generalized : array, shape (63,), changed
        The same loads as generalised forces on the coordinates: for each body its force [N] and 2 G^T(e) times its
        torque [N m].
    """
    p = parameters[0]
    out = loads[0]
    motion = _motion(coordinates, velocities, reference)
    contact = np.empty(1, WHEEL_CONTACT)
    _start_sums(p, motion, out)
    _loads_on_hull(p, motion, out)
    for i in range(4):
        _loads_on_wheel(p, motion, i, out)
        _suspension(p, motion, i, out)
        _soil(p, heights, motion, i, contact, out)
    _soil_on_hull(p, heights, hull_points, motion, out)
    _generalize(motion, out, generalized)


@njit(cache=True, error_model="numpy")
def _generalize(motion: BodyMotion, out: Any, generalized: Array) -> None:
    """Write the loads as generalised forces: Q = F for positions, 2 G^T(e) T for Euler parameters."""
    for k in range(3):
        generalized[k] = out.hull_force[k]
    generalized_moment(motion.node[0], out.hull_torque, generalized[3:7])
    for i in range(4):
        upright, wheel = 7 * (1 + i), 7 * (5 + i)
        for k in range(3):
            generalized[upright + k] = out.upright_force[i, k]
            generalized[wheel + k] = 0.0
        generalized_moment(motion.node[1 + i], out.upright_torque[i], generalized[upright + 3 : upright + 7])
        generalized_moment(motion.node[5 + i], out.wheel_torque[i], generalized[wheel + 3 : wheel + 7])


@njit(cache=True, error_model="numpy")
def _motion(coordinates: Array, velocities: Array, reference: Array) -> BodyMotion:
    node, rotation, turning = np.empty((9, 7)), np.empty((9, 3, 3)), np.empty((9, 3))
    rate = velocities.reshape(9, 7)
    for i in range(9):
        for k in range(7):
            node[i, k] = coordinates[7 * i + k] + reference[7 * i + k]
        rotation_matrix(node[i], rotation[i])
        angular_velocity(node[i], rate[i], turning[i])
    return BodyMotion(node, rate, rotation, turning)


@njit(cache=True, error_model="numpy")
def _start_sums(p: Any, motion: BodyMotion, out: Any) -> None:
    """Set the sums over the wheels to zero, and compute the kinetic and the potential energy."""
    out.soil_power = 0.0
    out.damper_power = 0.0
    out.water_power = 0.0
    out.settling_power = 0.0
    out.point_power = 0.0
    out.spring_energy = 0.0
    out.deepest = 0.0
    kinetic = 0.0
    potential = 0.0
    for i in range(9):
        rotation, turning, rate = motion.rotation[i], motion.angular_velocity[i], motion.rate[i]
        for k in range(3):
            local = rotation[0, k] * turning[0] + rotation[1, k] * turning[1] + rotation[2, k] * turning[2]
            kinetic += 0.5 * p.body_inertia[i, k] * local * local + 0.5 * p.body_mass[i] * rate[k] ** 2
        potential += p.body_mass[i] * p.gravity * motion.node[i, 2]
    out.kinetic_energy = kinetic
    out.gravity_energy = potential


@njit(cache=True, error_model="numpy")
def _loads_on_hull(p: Any, motion: BodyMotion, out: Any) -> None:
    """Water and the user's forces on the hull, and the damping of its motion while the vehicle settles."""
    rotation, turning, rate = motion.rotation[0], motion.angular_velocity[0], motion.rate[0]
    for k in range(3):
        f = 0.0
        t = 0.0
        for j in range(3):
            f += rotation[k, j] * out.water_wrench[0, j]
            t += rotation[k, j] * out.water_wrench[0, 3 + j]
        out.water_power += f * rate[k] + t * turning[k]
        f_s = -p.settling_rate * p.body_mass[0] * rate[k]
        t_s = -p.settling_rate * p.body_inertia[0, k] * turning[k]
        out.settling_power += f_s * rate[k] + t_s * turning[k]
        out.point_power += out.point_wrench[0, k] * rate[k] + out.point_wrench[0, 3 + k] * turning[k]
        out.hull_force[k] = f + f_s + out.point_wrench[0, k]
        out.hull_torque[k] = t + t_s + out.point_wrench[0, 3 + k]
    if p.hold_rate > 0.0:
        _hold(p, motion, out)


@njit(cache=True, error_model="numpy")
def _hold(p: Any, motion: BodyMotion, out: Any) -> None:
    """Hold the hull above its place on the ground, and its heading along world x, by critically damped springs."""
    rotation, turning, rate = motion.rotation[0], motion.angular_velocity[0], motion.rate[0]
    above = 0.0
    climb = 0.0
    for k in range(3):
        above += p.hold_normal[k] * (motion.node[0, k] - p.hold_place[k])
        climb += p.hold_normal[k] * rate[k]
    for k in range(3):
        away = motion.node[0, k] - p.hold_place[k] - above * p.hold_normal[k]
        speed = rate[k] - climb * p.hold_normal[k]
        pull = -p.body_mass[0] * p.hold_rate * (p.hold_rate * away + 2.0 * speed)
        out.settling_power += pull * rate[k]
        out.hull_force[k] += pull
    yaw_rate = turning[0] * rotation[0, 2] + turning[1] * rotation[1, 2] + turning[2] * rotation[2, 2]
    twist = -p.body_inertia[0, 2] * p.hold_rate * (2.0 * yaw_rate - p.hold_rate * rotation[0, 1])
    out.settling_power += twist * yaw_rate
    for k in range(3):
        out.hull_torque[k] += twist * rotation[k, 2]


@njit(cache=True, error_model="numpy")
def _loads_on_wheel(p: Any, motion: BodyMotion, i: int, out: Any) -> None:
    """Water and the user's forces on wheel i and its upright, and the damping of their motion while settling."""
    rotation, turning, rate = motion.rotation[1 + i], motion.angular_velocity[1 + i], motion.rate[1 + i]
    for k in range(3):
        f = 0.0
        t = 0.0
        for j in range(3):
            f += rotation[k, j] * out.water_wrench[1 + i, j]
            t += rotation[k, j] * out.water_wrench[1 + i, 3 + j]
        out.water_power += f * rate[k] + t * turning[k]
        f_s = -p.settling_rate * (p.body_mass[1 + i] + p.body_mass[5 + i]) * rate[k]
        out.settling_power += f_s * rate[k]
        out.point_power += out.point_wrench[1 + i, k] * rate[k] + out.point_wrench[1 + i, 3 + k] * turning[k]
        out.upright_force[i, k] = f + f_s + out.point_wrench[1 + i, k]
        out.upright_torque[i, k] = t + out.point_wrench[1 + i, 3 + k]


@njit(cache=True, error_model="numpy")
def _suspension(p: Any, motion: BodyMotion, i: int, out: Any) -> None:
    """Spring, damper and stops of wheel i, along the hull's z axis through the wheel centre."""
    arm, arm_velocity, lift, moment = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    for k in range(3):
        arm[k] = motion.node[1 + i, k] - motion.node[0, k]
        lift[k] = motion.rotation[0, k, 2]
    cross(motion.angular_velocity[0], arm, arm_velocity)
    stroke = dot(lift, arm) - p.ride_position[i, 2]
    stroke_rate = 0.0
    for k in range(3):
        stroke_rate += lift[k] * (motion.rate[1 + i, k] - motion.rate[0, k] - arm_velocity[k])
    bump, bump_energy = stop_force(stroke - p.bump_travel[i], p.stop_stiffness[i], p.stop_softening[i])
    rebound, rebound_energy = stop_force(-stroke - p.rebound_travel[i], p.stop_stiffness[i], p.stop_softening[i])
    damper = p.damping[i] * stroke_rate
    force = p.preload[i] + p.stiffness[i] * stroke + damper + bump - rebound
    out.damper_power -= damper * stroke_rate
    out.spring_energy += p.preload[i] * stroke + 0.5 * p.stiffness[i] * stroke**2 + bump_energy + rebound_energy
    cross(arm, lift, moment)
    for k in range(3):
        out.upright_force[i, k] -= force * lift[k]
        out.hull_force[k] += force * lift[k]
        out.hull_torque[k] += force * moment[k]
    out.stroke[i] = stroke
    out.suspension_force[i] = force


@njit(cache=True, error_model="numpy")
def _soil(p: Any, heights: Array, motion: BodyMotion, i: int, contact: np.ndarray, out: Any) -> None:
    """Soil on wheel i; the moment about the axle acts on the wheel, the rest on the upright."""
    plane_rate, wheel_rate = motion.angular_velocity[1 + i], motion.angular_velocity[5 + i]
    velocity = motion.rate[1 + i]
    axle = np.empty(3)
    for k in range(3):
        axle[k] = motion.rotation[1 + i, k, 1]
    spin = dot(wheel_rate, axle)
    soil_on_wheel(p, heights, motion.node[1 + i], velocity, axle, spin, plane_rate, contact)
    force, moment = contact[0].force, contact[0].moment
    torque = dot(moment, axle)
    for k in range(3):
        out.soil_power += force[k] * velocity[k] + moment[k] * plane_rate[k]
        out.soil_power += torque * axle[k] * (wheel_rate[k] - plane_rate[k])
        out.upright_force[i, k] += force[k]
        out.upright_torque[i, k] += moment[k] - torque * axle[k]
        out.wheel_torque[i, k] = torque * axle[k]
        out.soil_force[i, k] = force[k]
        out.soil_moment[i, k] = moment[k]
    out.sinkage[i] = contact[0].sinkage
    out.slip_ratio[i] = contact[0].patch.slip_ratio
    out.slip_angle[i] = contact[0].slip_angle
    out.deepest = max(out.deepest, contact[0].sinkage / p.wheel_radius)


@njit(cache=True, error_model="numpy")
def _soil_on_hull(p: Any, heights: Array, points: np.ndarray, motion: BodyMotion, out: Any) -> None:
    """Soil on the hull, where the hull may have reached the ground."""
    soil = out.hull_soil
    rotation, turning, rate = motion.rotation[0], motion.angular_velocity[0], motion.rate[0]
    out.hull_soil_power = 0.0
    if hull_is_clear(p.hull, motion.node[0], rotation):
        for k in range(3):
            soil.force[k] = 0.0
            soil.moment[k] = 0.0
            soil.center[k] = 0.0
        soil.sinkage = 0.0
        soil.stored = 0.0
        return
    soil_on_hull(
        p.soil, p.terrain, heights, points, p.hull, p.standstill_rate, motion.node[0], rotation, rate, turning, soil,
        np.zeros((0, 0)), 0.0, 0.0,
    )  # fmt: skip
    if not soil.sinkage > 0.0:
        return
    for k in range(3):
        out.hull_soil_power += soil.force[k] * rate[k] + soil.moment[k] * turning[k]
        out.hull_force[k] += soil.force[k]
        out.hull_torque[k] += soil.moment[k]
