"""Assembly of the vehicle as an Exudyn system: nine rigid bodies, their joints and the user loads on them.

Joints are algebraic constraints. Steering and wheel spin are prescribed in time by kinematic constraints, whose offsets
are written anew for each step. The loads enter as one vector of generalised forces (`Joints.force_object`), or as user
loads on each body, which read their rows of the record `exumob.multibody.applied_loads.LOADS`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from exumob.support.exudyn import exu  # isort: skip (before anything of exudyn)
from exudyn.itemInterface import (
    LoadForceVector,
    LoadTorqueVector,
    MarkerBodiesRelativeRotationCoordinate,
    MarkerBodyPosition,
    MarkerBodyRigid,
    MarkerNodeCoordinate,
    NodePointGround,
    ObjectConnectorCoordinate,
    ObjectConnectorDistance,
    ObjectGenericODE2,
    ObjectJointGeneric,
    ObjectJointRevoluteZ,
)
from exudyn.utilities import RigidBodyInertia

from exumob.support.arrays import Array
from exumob.support.constants import GRAVITY
from exumob.vehicle.parameters import Vehicle, Wishbones

SPIN_FRAME = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]).T
"""Joint frame in wheel axes: its z axis is the wheel's y axis."""


class DrivingCommand:
    """Steering angles of the front wheels and the wheel speed at one instant."""

    def __init__(self) -> None:
        """Wheels straight and at rest."""
        self.angles = [0.0, 0.0]
        """Front-left and front-right steering angle [rad]"""
        self.rates = np.zeros(3)
        """Rates of the two angles, and the wheel speed [rad/s]"""


class Joints(NamedTuple):
    """Numbers of the objects in the Exudyn system that are written to while it runs."""

    steering: list[int]
    """Rotations of the uprights about the hull's z axis: front wheels first; rear ones only with wishbones"""
    spin: list[int]
    """Rotations of the four wheels about their axles, on velocity level"""
    force_object: int | None
    """Takes the generalised forces of all loads; None where each load is a user function"""


def assemble(
    mbs: Any, vehicle: Vehicle, pose: tuple[Array, Array], command: DrivingCommand, loads: np.void | None
) -> Joints:  # fmt: skip
    """Build the vehicle at ride height in a pose, and assemble the system.

    Parameters
    ----------
    mbs : exudyn.MainSystem
        Empty.
    vehicle : Vehicle
    pose : (array, array)
        Place [m] and rotation of the design frame (`exumob.multibody.placing.standing_pose`).
    command : DrivingCommand
        The steering constraints read their rates from it while the system runs.
    loads : record of dtype `exumob.multibody.applied_loads.LOADS`, optional
        Read by user loads while the system runs. None: one object takes the generalised forces of all loads.
    """
    suspensions = [suspension for suspension in vehicle.axle_suspensions for _ in range(2)]
    hull, uprights, wheels = _add_bodies(mbs, vehicle, pose)
    node = mbs.AddNode(NodePointGround())
    ground = mbs.AddMarker(MarkerNodeCoordinate(nodeNumber=node, coordinate=0))
    steering, spin = [], []
    for i, suspension in enumerate(suspensions):
        steered = i < 2
        center = vehicle.wheel_centers[i] - vehicle.hull_origin
        if suspension.wishbones is None:
            _add_pillar(mbs, (hull, uprights[i]), center, steered)
        else:
            _add_wishbones(mbs, (hull, uprights[i]), center, suspension.wishbones)
        if steered or suspension.wishbones is not None:
            marker = _relative_rotation(mbs, hull, uprights[i], [0.0, 0.0, 1.0])
            rate = (lambda *_, i=i: float(command.rates[i])) if steered else 0  # the projection of velocities needs it
            steering.append(
                mbs.AddObject(ObjectConnectorCoordinate(markerNumbers=[ground, marker], offsetUserFunction_t=rate))
            )
        markers = [
            mbs.AddMarker(MarkerBodyRigid(bodyNumber=b, localHT=exu.HT(rotation=SPIN_FRAME)))
            for b in (uprights[i], wheels[i])
        ]
        mbs.AddObject(ObjectJointRevoluteZ(markerNumbers=markers))
        marker = _relative_rotation(mbs, uprights[i], wheels[i], [0.0, 1.0, 0.0])
        spin.append(mbs.AddObject(ObjectConnectorCoordinate(markerNumbers=[ground, marker], velocityLevel=True)))
    force_object = None
    if loads is None:
        nodes = [mbs.GetObject(body)["nodeNumber"] for body in (hull, *uprights, *wheels)]
        force_object = mbs.AddObject(ObjectGenericODE2(nodeNumbers=nodes, forceVector=np.zeros(7 * len(nodes))))
    else:
        _apply_load(mbs, hull, loads["hull_force"], loads["hull_torque"])
        for i in range(4):
            _apply_load(mbs, uprights[i], loads["upright_force"][i], loads["upright_torque"][i])
            _apply_load(mbs, wheels[i], None, loads["wheel_torque"][i])
    mbs.Assemble()
    return Joints(steering, spin, force_object)


def _add_bodies(mbs: Any, vehicle: Vehicle, pose: tuple[Array, Array]) -> tuple[int, list[int], list[int]]:
    """Hull, uprights and wheels at ride height; returns their numbers."""
    origin, tilt = pose

    def add_body(name: str, mass: float, inertia: Array, position: Array) -> int:
        body: int = mbs.CreateRigidBody(
            name=name,
            referencePosition=origin + tilt @ position,
            referenceRotationMatrix=tilt,
            inertia=RigidBodyInertia(mass, inertia),
            gravity=[0.0, 0.0, -GRAVITY],
        )
        return body

    hull = add_body("hull", vehicle.hull.mass, vehicle.hull.inertia_tensor, vehicle.hull_origin)
    suspensions = [suspension for suspension in vehicle.axle_suspensions for _ in range(2)]
    uprights = [
        add_body(f"upright {i}", s.upright_mass, s.upright_inertia_tensor, c)
        for i, (s, c) in enumerate(zip(suspensions, vehicle.wheel_centers, strict=True))
    ]
    wheels = [
        add_body(f"wheel {i}", vehicle.wheel.mass, vehicle.wheel.inertia_tensor, c)
        for i, c in enumerate(vehicle.wheel_centers)
    ]
    return hull, uprights, wheels


def _add_pillar(mbs: Any, bodies: tuple[int, int], center: Array, steered: bool) -> None:
    """Let the upright (the second body) slide along the hull's z axis; a steered one also turns about it."""
    hull, upright = bodies
    markers = [
        mbs.AddMarker(MarkerBodyRigid(bodyNumber=hull, localPosition=center)),
        mbs.AddMarker(MarkerBodyRigid(bodyNumber=upright)),
    ]
    axes = [1, 1, 0, 1, 1, 0 if steered else 1]
    mbs.AddObject(ObjectJointGeneric(markerNumbers=markers, constrainedAxes=axes))


def _add_wishbones(mbs: Any, bodies: tuple[int, int], center: Array, arms: Wishbones) -> None:
    """Guide the upright by four rigid rods: fore and aft of the upper and of the lower arm."""
    hull, upright = bodies
    side = 1.0 if center[1] > 0.0 else -1.0
    for length, joint_height, drop in (
        (arms.upper_length, arms.upper_height, arms.upper_pivot_drop),
        (arms.lower_length, -arms.lower_height, 0.0),
    ):
        ball = np.array([0.0, -side * arms.ball_joint_inset, joint_height])
        reach = np.sqrt(length**2 - drop**2)
        for x in (0.5 * arms.pivot_spread, -0.5 * arms.pivot_spread):
            pivot = center + ball + np.array([x, -side * reach, -drop])
            markers = [
                mbs.AddMarker(MarkerBodyPosition(bodyNumber=hull, localPosition=pivot)),
                mbs.AddMarker(MarkerBodyPosition(bodyNumber=upright, localPosition=ball)),
            ]
            mbs.AddObject(ObjectConnectorDistance(markerNumbers=markers, distance=float(np.hypot(length, x))))


def _relative_rotation(mbs: Any, first: int, second: int, axis: list[float]) -> int:
    """Return a marker of the rotation of the second body relative to the first about an axis."""
    marker: int = mbs.AddMarker(MarkerBodiesRelativeRotationCoordinate(bodyNumbers=[first, second], axis0=axis))
    return marker


def _apply_load(mbs: Any, body: int, force: Array | None, torque: Array) -> None:
    """Apply a force and a torque that are read anew whenever the solver asks for them."""
    marker = mbs.AddMarker(MarkerBodyRigid(bodyNumber=body))
    if force is not None:
        mbs.AddLoad(LoadForceVector(markerNumber=marker, loadVectorUserFunction=lambda *_: force))
    mbs.AddLoad(LoadTorqueVector(markerNumber=marker, loadVectorUserFunction=lambda *_: torque))
