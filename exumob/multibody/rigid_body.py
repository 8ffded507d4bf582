"""Rigid bodies described by Euler parameters, in compiled code.

A node is the seven coordinates of one body: the position of its origin in world axes [m], then four Euler parameters,
the scalar first. Its rate holds the seven time derivatives.
"""

from __future__ import annotations

import numpy as np

from exumob.support.arrays import Array
from exumob.support.kernels import njit


@njit(cache=True, error_model="numpy", inline="always")
def rotation_matrix(node: Array, a: Array) -> None:
    """Write the rotation matrix (body to world) of a node into `a`, shape (3, 3)."""
    e0, e1, e2, e3 = node[3], node[4], node[5], node[6]
    a[0, 0] = 2.0 * (e0 * e0 + e1 * e1) - 1.0
    a[0, 1] = 2.0 * (e1 * e2 - e0 * e3)
    a[0, 2] = 2.0 * (e1 * e3 + e0 * e2)
    a[1, 0] = 2.0 * (e1 * e2 + e0 * e3)
    a[1, 1] = 2.0 * (e0 * e0 + e2 * e2) - 1.0
    a[1, 2] = 2.0 * (e2 * e3 - e0 * e1)
    a[2, 0] = 2.0 * (e1 * e3 - e0 * e2)
    a[2, 1] = 2.0 * (e2 * e3 + e0 * e1)
    a[2, 2] = 2.0 * (e0 * e0 + e3 * e3) - 1.0


@njit(cache=True, error_model="numpy", inline="always")
def angular_velocity(node: Array, rate: Array, w: Array) -> None:
    """Write the angular velocity in world axes [rad/s], w = 2 G(e) e_t, of a node and its rate into `w`, shape (3,)."""
    e0, e1, e2, e3 = node[3], node[4], node[5], node[6]
    d0, d1, d2, d3 = rate[3], rate[4], rate[5], rate[6]
    w[0] = 2.0 * (-e1 * d0 + e0 * d1 - e3 * d2 + e2 * d3)
    w[1] = 2.0 * (-e2 * d0 + e3 * d1 + e0 * d2 - e1 * d3)
    w[2] = 2.0 * (-e3 * d0 - e2 * d1 + e1 * d2 + e0 * d3)


@njit(cache=True, error_model="numpy", inline="always")
def generalized_moment(node: Array, moment: Array, q: Array) -> None:
    """Write the generalised forces Q_e = 2 G^T(e) moment on the four Euler parameters into `q`, shape (4,)."""
    e0, e1, e2, e3 = node[3], node[4], node[5], node[6]
    q[0] = 2.0 * (-e1 * moment[0] - e2 * moment[1] - e3 * moment[2])
    q[1] = 2.0 * (e0 * moment[0] + e3 * moment[1] - e2 * moment[2])
    q[2] = 2.0 * (-e3 * moment[0] + e0 * moment[1] + e1 * moment[2])
    q[3] = 2.0 * (e2 * moment[0] - e1 * moment[1] + e0 * moment[2])


@njit(cache=True, error_model="numpy")
def point_motion(node: Array, rate: Array, place: Array, arm: Array, position: Array, velocity: Array) -> None:
    """Compute the motion of a point that is fixed to a body, in world axes.

    Parameters
    ----------
    node, rate : array, shape (7,)
        The body, see the head of this module.
    place : array, shape (3,)
        The point from the body's origin, body axes [m].
    arm, position, velocity : array, shape (3,), changed
        The point from the body's origin [m], its position [m] and velocity [m/s].
    """
    rotation, turning = np.empty((3, 3)), np.empty(3)
    rotation_matrix(node, rotation)
    angular_velocity(node, rate, turning)
    for k in range(3):
        arm[k] = rotation[k, 0] * place[0] + rotation[k, 1] * place[1] + rotation[k, 2] * place[2]
    cross(turning, arm, velocity)
    for k in range(3):
        position[k] = node[k] + arm[k]
        velocity[k] += rate[k]


@njit(cache=True, error_model="numpy")
def add_force(force: Array, arm: Array, wrench: Array) -> None:
    """Add a force [N] that acts at `arm` [m] from a body's origin to its wrench [N, N m], shape (6,)."""
    moment = np.empty(3)
    cross(arm, force, moment)
    for k in range(3):
        wrench[k] += force[k]
        wrench[3 + k] += moment[k]


@njit(cache=True, error_model="numpy", inline="always")
def cross(a: Array, b: Array, c: Array) -> None:
    """Write the vector product a x b into `c`; all of shape (3,)."""
    c[0] = a[1] * b[2] - a[2] * b[1]
    c[1] = a[2] * b[0] - a[0] * b[2]
    c[2] = a[0] * b[1] - a[1] * b[0]


@njit(cache=True, error_model="numpy", inline="always")
def dot(a: Array, b: Array) -> float:
    """Scalar product of two vectors of shape (3,)."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
