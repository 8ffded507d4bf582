"""Assembly of the vehicle as an Exudyn system: nine rigid bodies, their joints and the user loads on them.

Joints are algebraic constraints. Steering and wheel spin are prescribed in time by kinematic constraints, which read a
`DrivingCommand`; every user load reads its row of the record `exumob.multibody.applied_loads.LOADS`.
"""

from __future__ import annotations

from collections.abc import Callable
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
    ObjectJointGeneric,
    ObjectJointRevoluteZ,
)
from exudyn.utilities import RigidBodyInertia

from exumob.ground.terrain import Terrain
from exumob.multibody.placing import standing_pose
from exumob.support.arrays import Array
from exumob.support.constants import GRAVITY
from exumob.vehicle.parameters import Motion, Vehicle, Wishbones

SPIN_FRAME = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]).T
"""Joint frame in wheel axes: its z axis is the wheel's y axis."""


class DrivingCommand:
    """Steering angles of the front wheels and the wheel speed at one instant, as the constraints read them."""

    def __init__(self) -> None:
        """Wheels straight and at rest."""
        self.angles = [0.0, 0.0]
        """Front-left and front-right steering angle [rad]"""
        self.wheel_speed = 0.0
        """Spin of all wheels [rad/s]"""
        self.rates = np.zeros(3)
        """Rates of the two angles, and the wheel speed again [rad/s]"""

    def set(self, left: Motion, right: Motion, wheel_speed: float) -> None:
        """Prescribe the motion of the front wheels' angles and the wheel speed [rad/s]."""
        self.angles[:] = left[0], right[0]
        self.wheel_speed = wheel_speed
        self.rates[:] = left[1], right[1], wheel_speed


class Joints(NamedTuple):
    """Numbers of the constraint objects in the Exudyn system."""

    steering: list[int]
    """Rotations of the uprights about the hull's z axis: front wheels first; rear ones only with wishbones"""
    spin: list[int]
    """Rotations of the four wheels about their axles, on velocity level"""


def assemble(mbs: Any, vehicle: Vehicle, terrain: Terrain, command: DrivingCommand, loads: np.void) -> Joints:
    """Build the vehicle at ride height on the terrain, and assemble the system.

    Parameters
    ----------
    mbs : exudyn.MainSystem
        Empty.
    vehicle : Vehicle
    terrain : Terrain
        The vehicle stands at the world's origin, laid on the ground under its wheels.
    command : DrivingCommand
        Read by the steering and spin constraints while the system runs.
    loads : record of dtype `exumob.multibody.applied_loads.LOADS`
        Read by the user loads while the system runs.
    """
    suspensions = [suspension for suspension in vehicle.axle_suspensions for _ in range(2)]
    hull, uprights, wheels = _add_bodies(mbs, vehicle, terrain)
    node = mbs.AddNode(NodePointGround())
    ground = mbs.AddMarker(MarkerNodeCoordinate(nodeNumber=node, coordinate=0))
    joints = Joints([], [])
    for i, suspension in enumerate(suspensions):
        steered = i < 2
        center = vehicle.wheel_centers[i] - vehicle.hull_origin
        if suspension.wishbones is None:
            _add_pillar(mbs, (hull, uprights[i]), center, steered)
        else:
            _add_wishbones(mbs, (hull, uprights[i]), center, suspension.wishbones)
        if steered or suspension.wishbones is not None:
            joints.steering.append(
                _prescribe_rotation(
                    mbs, ground, (hull, uprights[i]), [0.0, 0.0, 1.0],
                    rate=(lambda *_, i=i: float(command.rates[i])) if steered else (lambda *_: 0.0),
                    angle=(lambda *_, i=i: command.angles[i]) if steered else (lambda *_: 0.0),
                )
            )  # fmt: skip
        markers = [
            mbs.AddMarker(MarkerBodyRigid(bodyNumber=b, localHT=exu.HT(rotation=SPIN_FRAME)))
            for b in (uprights[i], wheels[i])
        ]
        mbs.AddObject(ObjectJointRevoluteZ(markerNumbers=markers))
        joints.spin.append(
            _prescribe_rotation(
                mbs, ground, (uprights[i], wheels[i]), [0.0, 1.0, 0.0], rate=lambda *_: command.wheel_speed
            )
        )
    _apply_load(mbs, hull, loads["hull_force"], loads["hull_torque"])
    for i in range(4):
        _apply_load(mbs, uprights[i], loads["upright_force"][i], loads["upright_torque"][i])
        _apply_load(mbs, wheels[i], None, loads["wheel_torque"][i])
    mbs.Assemble()
    return joints


def _add_bodies(mbs: Any, vehicle: Vehicle, terrain: Terrain) -> tuple[int, list[int], list[int]]:
    """Hull, uprights and wheels at ride height; returns their numbers."""
    origin, tilt = standing_pose(vehicle, terrain)

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


def _prescribe_rotation(
    mbs: Any,
    ground: int,
    bodies: tuple[int, int],
    axis: list[float],
    rate: Callable[..., float],
    angle: Callable[..., float] | None = None,
) -> int:
    """Prescribe the rotation of the second body relative to the first about an axis; without an angle, its rate."""
    marker = mbs.AddMarker(MarkerBodiesRelativeRotationCoordinate(bodyNumbers=list(bodies), axis0=axis))
    joint: int = mbs.AddObject(
        ObjectConnectorCoordinate(
            markerNumbers=[ground, marker],
            velocityLevel=angle is None,
            offsetUserFunction=angle or 0,
            offsetUserFunction_t=rate,
        )
    )
    return joint


def _apply_load(mbs: Any, body: int, force: Array | None, torque: Array) -> None:
    """Apply a force and a torque that are read anew whenever the solver asks for them."""
    marker = mbs.AddMarker(MarkerBodyRigid(bodyNumber=body))
    if force is not None:
        mbs.AddLoad(LoadForceVector(markerNumber=marker, loadVectorUserFunction=lambda *_: force))
    mbs.AddLoad(LoadTorqueVector(markerNumber=marker, loadVectorUserFunction=lambda *_: torque))
