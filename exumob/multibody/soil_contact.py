"""The soil on a moving vehicle: forces on its wheels in world axes, and what Newton's iterations know of the soil."""

from __future__ import annotations

from typing import Any

import numpy as np

from exumob.ground.contact_patch import PATCH_FORCES, WheelMotion, WheelSize, wheel_soil_kernel
from exumob.ground.hull_contact import HULL_SOIL, hull_is_clear, soil_on_hull
from exumob.ground.terrain import terrain_height
from exumob.multibody.rigid_body import angular_velocity, cross, dot, generalized_moment, rotation_matrix
from exumob.support.arrays import Array
from exumob.support.kernels import njit

WHEEL_CONTACT = np.dtype(
    [
        ("patch", PATCH_FORCES),  # in the wheel's heading frame
        ("force", "f8", (3,)),  # of the soil on the wheel, world axes [N]
        ("moment", "f8", (3,)),  # about the wheel centre, world axes [N m]
        ("sinkage", "f8"),  # of the lowest rim point below the undisturbed surface [m]; negative: above it
        ("slip_angle", "f8"),  # of the velocity to the wheel's plane [rad], 0 also in straight reverse
    ],
    align=True,
)
"""Contact of one wheel with the soil."""

DAMPING_ENTRIES = 132
"""Entries of the sparse matrix of `soil_damping`: 4 wheels, 3 velocities, 3 forces and 2 times 4 moments each."""

HULL_ENTRIES = 49
"""Entries of the sparse matrix of `hull_tangent`: 7 coordinates of the hull by 7."""

VELOCITY_STEP = 1e-7
"""Step of the finite differences in `soil_damping` [m/s]."""


@njit(cache=True, error_model="numpy")
def soil_on_wheel(
    p: Any, heights: Array, center: Array, velocity: Array, axle: Array, spin: float, plane_rate: Array,
    contact: np.ndarray,
) -> None:  # fmt: skip
    """Compute the Bekker-Wong force and moment on one wheel, in the frame of the terrain below the wheel.

    Parameters
    ----------
    p : record of dtype `exumob.multibody.applied_loads.LOAD_PARAMETERS`
    heights : array, shape (ny, nx, 4)
        Field of heights of the terrain (see `Terrain.as_arrays`).
    center, velocity : array, shape (3,) or longer
        Wheel centre [m] and its velocity [m/s], world axes.
    axle : array, shape (3,)
        Unit vector along the axle, to the left.
    spin : float
        Rotation about the axle [rad/s], positive rolls forward.
    plane_rate : array, shape (3,)
        Angular velocity of the wheel's plane (of the upright), world axes [rad/s].
    contact : array of dtype `WHEEL_CONTACT`, shape (1,), changed
    """
    out = contact[0]
    heading, left, normal = np.empty(3), np.empty(3), np.empty(3)
    ground, slope_x, slope_y = terrain_height(p.terrain, heights, center[0], center[1])
    norm = 1.0 / np.sqrt(1.0 + slope_x * slope_x + slope_y * slope_y)
    normal[0], normal[1], normal[2] = -slope_x * norm, -slope_y * norm, norm
    cross(axle, normal, heading)
    norm = 1.0 / np.sqrt(dot(heading, heading))
    for k in range(3):
        heading[k] *= norm
    cross(normal, heading, left)
    sinkage = p.wheel_radius - (center[2] - ground) * normal[2]
    v_x, v_y, v_z = dot(velocity, heading), dot(velocity, left), dot(velocity, normal)
    motion = WheelMotion(v_x, v_y, v_z, spin, dot(plane_rate, heading), dot(plane_rate, normal))
    patch = out.patch
    wheel_soil_kernel(p.soil, WheelSize(p.wheel_radius, p.wheel_width), sinkage, motion, p.standstill_rate, patch)
    force, moment = patch.force, patch.moment
    for k in range(3):
        out.force[k] = force[0] * heading[k] + force[1] * left[k] + force[2] * normal[k]
        out.moment[k] = moment[0] * heading[k] + moment[1] * left[k] + moment[2] * normal[k]
    out.sinkage = sinkage
    out.slip_angle = np.arctan2(v_y, abs(v_x)) if v_x * v_x + v_y * v_y > 1e-6 else 0.0


@njit(cache=True, error_model="numpy")
def soil_damping(
    parameters: np.ndarray, heights: Array, coordinates: Array, velocities: Array, reference: Array, factor: float,
    entries: Array,
) -> None:  # fmt: skip
    """Compute the derivative of the soil's generalised forces by the velocities of the wheel centres.

    The Newton iterations of the multibody solver need it, because soil at standstill is stiff in velocity.

    Parameters
    ----------
    parameters, heights, coordinates, velocities, reference
        As for `exumob.multibody.applied_loads.vehicle_loads`.
    factor : float
        Multiplies the derivatives.
    entries : array, shape (DAMPING_ENTRIES, 3), changed
        Row, column and value of a sparse matrix; rows are the coordinates of uprights and wheels, columns the
        velocities of the uprights' origins.
    """
    p = parameters[0]
    upright, plane_rate, wheel_rate = np.empty((3, 3)), np.empty(3), np.empty(3)
    speed, axle, bearing, generalized = np.empty(3), np.empty(3), np.empty(3), np.empty(4)
    present, changed = np.empty(1, WHEEL_CONTACT), np.empty(1, WHEEL_CONTACT)
    entry = 0
    for i in range(4):
        first, rim = 7 * (1 + i), 7 * (5 + i)
        body = coordinates[first : first + 7] + reference[first : first + 7]
        rim_node = coordinates[rim : rim + 7] + reference[rim : rim + 7]
        rotation_matrix(body, upright)
        angular_velocity(body, velocities[first : first + 7], plane_rate)
        angular_velocity(rim_node, velocities[rim : rim + 7], wheel_rate)
        for k in range(3):
            axle[k] = upright[k, 1]
            speed[k] = velocities[first + k]
        spin = dot(wheel_rate, axle)
        soil_on_wheel(p, heights, body, speed, axle, spin, plane_rate, present)
        for k in range(3):
            speed[k] += VELOCITY_STEP
            soil_on_wheel(p, heights, body, speed, axle, spin, plane_rate, changed)
            speed[k] -= VELOCITY_STEP
            for j in range(3):
                entries[entry, 0], entries[entry, 1] = first + j, first + k
                entries[entry, 2] = factor * (changed[0].force[j] - present[0].force[j]) / VELOCITY_STEP
                entry += 1
                bearing[j] = factor * (changed[0].moment[j] - present[0].moment[j]) / VELOCITY_STEP
            torque = dot(bearing, axle)
            for j in range(3):
                bearing[j] -= torque * axle[j]
            for row, node, part in ((first, body, bearing), (rim, rim_node, torque * axle)):
                generalized_moment(node, part, generalized)
                for j in range(4):
                    entries[entry, 0], entries[entry, 1], entries[entry, 2] = row + 3 + j, first + k, generalized[j]
                    entry += 1


@njit(cache=True, error_model="numpy")
def hull_tangent(  # a kernel: the arguments of the loads, two factors and the result
    parameters: np.ndarray, heights: Array, hull_points: np.ndarray, coordinates: Array, velocities: Array,
    reference: Array, factor: float, factor_velocity: float, entries: Array,
) -> bool:  # fmt: skip
    """Compute the derivative of the soil's generalised forces on the hull by the hull's motion.

    Soil under a wide belly is stiff in the sinkage, and at standstill in the velocity.

    Parameters
    ----------
    parameters, heights, hull_points, coordinates, velocities, reference
        As for `exumob.multibody.applied_loads.vehicle_loads`.
    factor, factor_velocity : float
        Multiply the derivatives by coordinates and by velocities.
    entries : array, shape (HULL_ENTRIES, 3), changed
        Row, column and value of a sparse matrix; nothing is written without contact.

    Returns
    -------
    bool
        Whether the hull touches the ground.
    """
    p = parameters[0]
    node = coordinates[:7] + reference[:7]
    rotation, turning = np.empty((3, 3)), np.empty(3)
    rotation_matrix(node, rotation)
    if hull_is_clear(p.hull, node, rotation):
        return False
    angular_velocity(node, velocities[:7], turning)
    found, tangent = np.empty(1, HULL_SOIL), np.empty((6, 6))
    soil_on_hull(
        p.soil, p.terrain, heights, hull_points, p.hull, p.standstill_rate, node, rotation, velocities[:3], turning,
        found[0], tangent, factor, factor_velocity,
    )  # fmt: skip
    if not found[0].sinkage > 0.0:
        return False
    turn, row = np.empty((7, 6)), np.empty(4)  # generalised forces per force and moment
    turn[:] = 0.0
    for k in range(3):
        unit = np.zeros(3)
        unit[k] = 1.0
        turn[k, k] = 1.0
        generalized_moment(node, unit, row)
        for i in range(4):
            turn[3 + i, 3 + k] = row[i]
    entry = 0
    for i in range(7):
        for j in range(7):
            value = 0.0
            for k in range(6):
                for m in range(6):
                    value += turn[i, k] * tangent[k, m] * turn[j, m]
            entries[entry, 0], entries[entry, 1], entries[entry, 2] = i, j, value
            entry += 1
    return True
