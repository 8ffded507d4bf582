"""The vehicle as data: one frozen dataclass a component, one value a field.

Design frame: origin on the ground below the middle of the wheelbase, x forward, y left, z up, with the tyres just
touching hard ground at the static ride height. SI units and radians. Vehicle files (``vehicle_models/``) fill these in.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from exumob.support.arrays import Array
from exumob.support.checks import require_finite, require_positive, require_within

Motion = tuple[float, float, float]
"""A value and its first and second time derivatives."""


@dataclass(frozen=True)
class Hull:
    """The sprung body: a box with a raked bow, or any watertight mesh.

    The keel is flat from the stern to `bow_length` behind the foremost point, then rises straight to `bow_height`
    above the keel; from there the stem is vertical up to the deck.
    """

    mass: float
    """[kg]"""
    length: float
    """Length over all [m]"""
    width: float
    """[m]"""
    height: float
    """Keel to deck [m]"""
    ground_clearance: float
    """Keel above hard ground [m]"""
    center_of_mass_height: float
    """Centre of mass above hard ground [m]"""
    center_of_mass_x: float = 0.0
    """Centre of mass ahead of mid wheelbase [m]"""
    center_x: float = 0.0
    """Middle of the hull's length ahead of mid wheelbase [m]"""
    bow_length: float = 0.0
    """Length over which the keel rises at the bow [m]; 0: a plain box"""
    bow_height: float = 0.0
    """Height above the keel where the rake ends [m]"""
    inertia: tuple[float, float, float] | None = None
    """(I_xx, I_yy, I_zz) about the centre of mass [kg m^2]; None: a uniform box of this size and mass"""
    mesh: Path | None = None
    """Watertight surface (STL, OBJ ...) in the design frame [m] that replaces the box for the water; needs trimesh"""

    def __post_init__(self) -> None:
        require_positive(
            "Hull", mass=self.mass, length=self.length, width=self.width, height=self.height,
            ground_clearance=self.ground_clearance, center_of_mass_height=self.center_of_mass_height,
        )  # fmt: skip
        require_within(
            "Hull", -self.length, self.length, center_of_mass_x=self.center_of_mass_x, center_x=self.center_x
        )
        require_within("Hull", 0.0, self.length, bow_length=self.bow_length)
        require_within("Hull", 0.0, self.height, bow_height=self.bow_height)
        if self.inertia is not None:
            i_xx, i_yy, i_zz = self.inertia
            require_positive("Hull", inertia_xx=i_xx, inertia_yy=i_yy, inertia_zz=i_zz)
            if 2.0 * max(self.inertia) > sum(self.inertia):
                raise ValueError(
                    f"Hull.inertia = {self.inertia} breaks the triangle inequality I_a <= I_b + I_c; "
                    "no rigid body has it. Check the three values about the centre of mass."
                )

    @property
    def inertia_tensor(self) -> Array:
        """Inertia tensor about the centre of mass, hull axes [kg m^2], shape (3, 3)."""
        if self.inertia is not None:
            return np.diag(np.array(self.inertia, dtype=float))
        return box_inertia(self.mass, self.length, self.width, self.height)

    def side_profile(self) -> Array:
        """Return the outline of the raked box from starboard: corners (x, z) in the design frame [m], shape (n, 2).

        Counter-clockwise with x to the right and z up, from the stern's keel; three to five corners, no two in a row
        equal.
        """
        stern, bow = self.center_x - 0.5 * self.length, self.center_x + 0.5 * self.length
        keel, deck = self.ground_clearance, self.ground_clearance + self.height
        corners = np.array(
            [[stern, keel], [bow - self.bow_length, keel], [bow, keel + self.bow_height], [bow, deck], [stern, deck]]
        )
        apart = np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1) > 0.0
        return np.asarray(corners[apart])


@dataclass(frozen=True)
class Wheel:
    """A rigid tyre and rim; all four wheels are alike."""

    mass: float
    """[kg]"""
    diameter: float
    """[m]"""
    width: float
    """[m]"""
    inertia: tuple[float, float] | None = None
    """(spin, transverse) about the centre [kg m^2]; None: a uniform solid cylinder"""

    def __post_init__(self) -> None:
        require_positive("Wheel", mass=self.mass, diameter=self.diameter, width=self.width)
        if self.inertia is not None:
            require_positive("Wheel", inertia_spin=self.inertia[0], inertia_transverse=self.inertia[1])
            if self.inertia[0] > 2.0 * self.inertia[1]:
                raise ValueError(
                    f"Wheel.inertia = {self.inertia}: the spin inertia must not exceed twice the transverse one; no "
                    "rigid body has that. Give (spin, transverse) about the centre."
                )

    @property
    def radius(self) -> float:
        """Half the diameter [m]."""
        return 0.5 * self.diameter

    @property
    def inertia_tensor(self) -> Array:
        """Inertia tensor about the centre, wheel axes (y is the spin axis) [kg m^2], shape (3, 3)."""
        if self.inertia is not None:
            spin, transverse = self.inertia
        else:
            spin = 0.5 * self.mass * self.radius**2
            transverse = self.mass * (3.0 * self.radius**2 + self.width**2) / 12.0
        return np.diag([transverse, spin, transverse])


@dataclass(frozen=True)
class Wishbones:
    """Front view of a double wishbone: two parallel-axis A-arms, each as two rigid rods (fore and aft)."""

    upper_length: float
    """Upper arm, hull pivot to ball joint [m]"""
    lower_length: float
    """Lower arm [m]"""
    ball_joint_inset: float
    """Ball joints inboard of the wheel centre [m]"""
    upper_height: float
    """Upper ball joint above the wheel centre [m]"""
    lower_height: float
    """Lower ball joint below the wheel centre [m]"""
    pivot_spread: float
    """Distance of the two hull pivots of an arm along x [m]"""
    upper_pivot_drop: float = 0.0
    """Hull pivot of the upper arm below its ball joint at ride height [m]: camber gain"""

    def __post_init__(self) -> None:
        require_positive(
            "Wishbones", upper_length=self.upper_length, lower_length=self.lower_length,
            upper_height=self.upper_height, lower_height=self.lower_height, pivot_spread=self.pivot_spread,
        )  # fmt: skip
        require_finite("Wishbones", ball_joint_inset=self.ball_joint_inset)
        steepest = 0.9 * self.upper_length
        hint = "use a longer arm or a smaller drop."
        require_within("Wishbones", -steepest, steepest, hint, upper_pivot_drop=self.upper_pivot_drop)


@dataclass(frozen=True)
class Suspension:
    """Independent suspension of one wheel, rates as felt at the wheel along the hull's z axis.

    Without `wishbones` the upright slides on a pillar along the hull's z axis. The spring carries the static load of
    the hull at ride height, so stiffness can be edited without changing the ride height.
    """

    stiffness: float
    """Rate of the spring [N/m]"""
    damping: float
    """Rate of the damper [N s/m]"""
    upright_mass: float
    """[kg]"""
    upright_size: float
    """Edge of the cube whose inertia the upright has [m]"""
    bump_travel: float
    """Travel from ride height to the bump stop [m]"""
    rebound_travel: float
    """Travel from ride height to the rebound stop [m]"""
    stop_stiffness: float
    """Stiffness of either stop [N/m]"""
    stop_softening: float = 2.0e-3
    """Compression over which a stop's stiffness builds up [m]"""
    wishbones: Wishbones | None = None

    def __post_init__(self) -> None:
        require_positive(
            "Suspension", stiffness=self.stiffness, upright_mass=self.upright_mass, upright_size=self.upright_size,
            bump_travel=self.bump_travel, rebound_travel=self.rebound_travel, stop_stiffness=self.stop_stiffness,
            stop_softening=self.stop_softening,
        )  # fmt: skip
        require_within("Suspension", 0.0, 1.0e7, damping=self.damping)

    @property
    def upright_inertia_tensor(self) -> Array:
        """Inertia tensor of the upright about the wheel centre, upright axes [kg m^2], shape (3, 3)."""
        return box_inertia(self.upright_mass, self.upright_size, self.upright_size, self.upright_size)


@dataclass(frozen=True)
class Steering:
    """Front-wheel steering; the commanded angle is that of the middle of the front axle."""

    geometry: Literal["parallel", "ackermann"] = "parallel"
    """parallel: both wheels turn by the command (the paper); ackermann: both axes meet on the rear axle's line"""
    limit: float = math.radians(35.0)
    """Largest commanded angle [rad]"""

    def __post_init__(self) -> None:
        if self.geometry not in ("parallel", "ackermann"):
            raise ValueError(f"Steering.geometry = {self.geometry!r} is not known; use 'parallel' or 'ackermann'.")
        require_within("Steering", 0.0, math.radians(80.0), limit=self.limit)


@dataclass(frozen=True)
class Vehicle:
    """A four-wheeled vehicle with front steering and prescribed wheel speeds."""

    name: str
    hull: Hull
    wheel: Wheel
    suspension: Suspension
    """Suspension of the front wheels, and of the rear ones unless `rear_suspension` is given"""
    wheelbase: float
    """Distance between the axles [m]"""
    track: float
    """Distance between the middles of the left and the right tyre [m]"""
    steering: Steering = Steering()
    rear_suspension: Suspension | None = None

    def __post_init__(self) -> None:
        require_positive("Vehicle", wheelbase=self.wheelbase, track=self.track)
        gap = 0.5 * (self.track - self.wheel.width - self.hull.width)
        if gap < 0.0 and self.hull.ground_clearance < self.wheel.diameter:
            raise ValueError(
                f"Vehicle.track = {self.track} m puts the tyres {-gap:.3f} m inside the hull; it must be at least "
                f"hull.width + wheel.width = {self.hull.width + self.wheel.width:.3f} m."
            )
        front = self.front_load_share
        if not 0.05 <= front <= 0.95:
            raise ValueError(
                f"Hull.center_of_mass_x = {self.hull.center_of_mass_x} m puts {100 * front:.0f} % of the hull's weight "
                "on the front axle; it must lie between the axles (5 % to 95 %)."
            )

    @property
    def mass(self) -> float:
        """Total mass [kg]."""
        return self.hull.mass + 4.0 * self.wheel.mass + sum(2.0 * s.upright_mass for s in self.axle_suspensions)

    @property
    def axle_suspensions(self) -> tuple[Suspension, Suspension]:
        """Suspensions of the front and of the rear axle."""
        return self.suspension, self.rear_suspension or self.suspension

    @property
    def front_load_share(self) -> float:
        """Share of the hull's weight on the front axle [-]."""
        return 0.5 + self.hull.center_of_mass_x / self.wheelbase

    @property
    def hull_origin(self) -> Array:
        """Centre of mass of the hull in the design frame [m], shape (3,)."""
        return np.array([self.hull.center_of_mass_x, 0.0, self.hull.center_of_mass_height])

    @property
    def wheel_centers(self) -> Array:
        """Wheel centres in the design frame, order of `exumob.vehicle.motion.WHEELS` [m], shape (4, 3)."""
        x, y, z = 0.5 * self.wheelbase, 0.5 * self.track, self.wheel.radius
        return np.array([[x, y, z], [x, -y, z], [-x, y, z], [-x, -y, z]])

    def steering_angles(self, command: Motion) -> tuple[Motion, Motion]:
        """Return the angles of the front-left and front-right wheel for a command, with their time derivatives.

        Parameters
        ----------
        command : (float, float, float)
            Mean front-wheel angle [rad], its rate [rad/s] and acceleration [rad/s^2].

        Returns
        -------
        two times (float, float, float)
            The same three for the left and the right wheel; positive turns to the left.
        """
        if self.steering.geometry == "parallel":
            return command, command
        ratio = 0.5 * self.track / self.wheelbase
        return _ackermann(command, ratio), _ackermann(command, -ratio)


def _ackermann(command: Motion, ratio: float) -> Motion:
    """Motion of a front wheel at y = ratio * wheelbase: cot(wheel) = cot(command) - ratio."""
    angle, rate, acceleration = command
    s, c = math.sin(angle), math.cos(angle)
    x = c - ratio * s
    norm = s * s + x * x
    slope = 1.0 / norm  # d wheel / d command
    curvature = -2.0 * (s * c - x * (s + ratio * c)) / norm**2
    return math.atan2(s, x), slope * rate, slope * acceleration + curvature * rate**2


def box_inertia(mass: float, length: float, width: float, height: float) -> Array:
    """Return the inertia tensor of a uniform box about its centre [kg m^2], shape (3, 3)."""
    x2, y2, z2 = length**2, width**2, height**2
    return mass / 12.0 * np.diag([y2 + z2, x2 + z2, x2 + y2])
