"""Reactions of the constraints on the nine bodies, by the laws of Newton and Euler."""

from __future__ import annotations

import numpy as np

from exumob.multibody.rigid_body import angular_velocity, cross, rotation_matrix
from exumob.support.arrays import Array
from exumob.support.kernels import njit


@njit(cache=True, error_model="numpy")
def constraint_wrenches(
    parameters: np.ndarray, loads: np.ndarray, coordinates: Array, velocities: Array, accelerations: Array,
    reference: Array, wrenches: Array,
) -> None:  # fmt: skip
    """Compute what the constraints must do for the bodies to move as they do under the loads (paper Eq. 6).

    Force m a - F and moment J alpha + omega x J omega - T about each body's centre of mass, its origin. They equal the
    reactions of the Lagrange multipliers up to the tolerance of Newton's iterations.

    Parameters
    ----------
    parameters : array of dtype `exumob.multibody.applied_loads.LOAD_PARAMETERS`, shape (1,)
    loads : array of dtype `exumob.multibody.applied_loads.LOADS`, shape (1,)
        At the same instant.
    coordinates, velocities, accelerations, reference : array, shape (63,)
        Node displacements and Euler-parameter increments, their rates, and the reference values.
    wrenches : array, shape (9, 6), changed
        Force [N] and moment [N m] on hull, uprights and wheels, world axes.
    """
    p, out = parameters[0], loads[0]
    node, rotation = np.empty(7), np.empty((3, 3))
    turning, change, spin, gyroscopic = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    for i in range(9):
        first = 7 * i
        for k in range(7):
            node[k] = coordinates[first + k] + reference[first + k]
        rotation_matrix(node, rotation)
        angular_velocity(node, velocities[first : first + 7], turning)
        angular_velocity(node, accelerations[first : first + 7], change)  # G(e_t) e_t = 0
        for k in range(3):
            spin[k] = 0.0  # angular momentum, world axes
            wrenches[i, k] = p.body_mass[i] * accelerations[first + k]
            wrenches[i, 3 + k] = 0.0
        wrenches[i, 2] += p.body_mass[i] * p.gravity
        for j in range(3):
            local, local_change = 0.0, 0.0
            for k in range(3):
                local += rotation[k, j] * turning[k]
                local_change += rotation[k, j] * change[k]
            for k in range(3):
                spin[k] += rotation[k, j] * p.body_inertia[i, j] * local
                wrenches[i, 3 + k] += rotation[k, j] * p.body_inertia[i, j] * local_change
        cross(turning, spin, gyroscopic)
        for k in range(3):
            wrenches[i, 3 + k] += gyroscopic[k]
            if i == 0:
                wrenches[i, k] -= out.hull_force[k]
                wrenches[i, 3 + k] -= out.hull_torque[k]
            elif i < 5:
                wrenches[i, k] -= out.upright_force[i - 1, k]
                wrenches[i, 3 + k] -= out.upright_torque[i - 1, k]
            else:
                wrenches[i, 3 + k] -= out.wheel_torque[i - 5, k]
