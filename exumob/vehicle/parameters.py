"""The vehicle as data: one frozen dataclass a component, one value a field.

Design frame: origin on the ground below the middle of the wheelbase, x forward, y left, z up, with the tyres just
touching hard ground at the static ride height. SI units and radians. Vehicle files (``vehicle_models/``) fill these in.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import numpy as np

from exumob.support.arrays import Array
from exumob.support.checks import require_within
from exumob.support.declared import Declared
from exumob.support.quantities import ImplausibleValue, Quantity, Unusual

SLOWEST_HEAVE = 0.2
"""Slowest plausible heave of a hull on its springs [Hz]; cars have 1 to 2, small models 3 to 10."""
LOAD_ABOVE, LOAD_BELOW = 1.0, 0.25
"""How far the centre of mass may plausibly lie above the deck (a load on it) and below the keel [hull heights]."""
Motion = tuple[float, float, float]
"""A value and its first and second time derivatives."""


@dataclass(frozen=True)
class Hull(Declared):
    """The sprung body: a box with a raked bow, or any watertight mesh.

    The keel is flat from the stern to `bow_length` behind the foremost point, then rises straight to `bow_height`
    above the keel; from there the stem is vertical up to the deck.
    """

    mass: Annotated[float, Quantity("kg", above=0.0, at_most=1e9, plausible=(0.5, 1e5))]
    """Mass of all that is sprung"""
    length: Annotated[float, Quantity("m", above=0.0, at_most=1e3, plausible=(0.1, 30.0))]
    """Length over all"""
    width: Annotated[float, Quantity("m", above=0.0, at_most=1e3, plausible=(0.04, 10.0))]
    """Width over all"""
    height: Annotated[float, Quantity("m", above=0.0, at_most=1e3, plausible=(0.02, 10.0))]
    """Height from keel to deck"""
    ground_clearance: Annotated[float, Quantity("m", above=0.0, at_most=1e3, plausible=(2e-3, 3.0))]
    """Height of the keel above hard ground"""
    center_of_mass_height: Annotated[float, Quantity("m", above=0.0, at_most=1e3, plausible=(5e-3, 5.0))]
    """Height of the centre of mass above hard ground"""
    center_of_mass_x: Annotated[float, Quantity("m", at_least=-1e3, at_most=1e3)] = 0.0
    """Centre of mass ahead of mid wheelbase; within the hull's length"""
    center_x: Annotated[float, Quantity("m", at_least=-1e3, at_most=1e3)] = 0.0
    """Middle of the hull's length ahead of mid wheelbase; less than the length"""
    bow_length: Annotated[float, Quantity("m", at_least=0.0, at_most=1e3)] = 0.0
    """Length over which the keel rises at the bow, up to the whole; 0: a plain box"""
    bow_height: Annotated[float, Quantity("m", at_least=0.0, at_most=1e3)] = 0.0
    """Height above the keel where the rake ends, up to the deck"""
    inertia: Annotated[tuple[float, float, float] | None, Quantity("kg m^2", above=0.0, at_most=1e12)] = None
    """(I_xx, I_yy, I_zz) about the centre of mass; None: a uniform box of this size and mass"""
    mesh: Path | None = None
    """Watertight surface (STL, OBJ ...) in the design frame [m] that replaces the box, with its wheel arches; needs
    trimesh. `length`, `width` and `height` stay its overall sizes; `exumob.water.mesh_file` says what is refused"""

    def _check(self) -> None:
        require_within(
            "Hull", -self.length, self.length, "give a place within Hull.length.",
            center_of_mass_x=self.center_of_mass_x, center_x=self.center_x,
        )  # fmt: skip
        if self.bow_length > self.length:
            require_within("Hull", 0.0, self.length, "give a part of Hull.length.", bow_length=self.bow_length)
        if self.bow_height > self.height:
            require_within("Hull", 0.0, self.height, "give a part of Hull.height.", bow_height=self.bow_height)
        self._check_sizes()
        density = self.mass / (self.length * self.width * self.height)
        if not 5.0 <= density <= 5000.0 and not isinstance(self.mass, Unusual):
            raise ImplausibleValue(
                f"Hull.mass = {self.mass:g} kg in a box of {self.length:g} x {self.width:g} x {self.height:g} m is "
                f"{density:.3g} kg/m^3 (plausible: 5 to 5000); give kilograms and metres. If it is meant: "
                f"mass=unusual({self.mass:g})."
            )
        if self.inertia is not None:
            if 2.0 * max(self.inertia) > sum(self.inertia):
                raise ValueError(
                    f"Hull.inertia = {self.inertia} breaks the triangle inequality I_a <= I_b + I_c; "
                    "no rigid body has it. Check the three values about the centre of mass."
                )
            widest = 2.0 * math.sqrt(max(self.inertia) / self.mass)
            largest = math.hypot(self.length, self.width, self.height)
            if not 0.05 * largest <= widest <= 3.0 * largest and not isinstance(max(self.inertia), Unusual):
                raise ImplausibleValue(
                    f"Hull.inertia = {self.inertia} kg m^2 means that the mass lies {0.5 * widest:.3g} m from its "
                    f"centre, in a hull of {largest:.3g} m; give kg m^2 about the centre of mass, or unusual(...) for "
                    "the largest."
                )

    def _check_sizes(self) -> None:
        """Refuse a hull that is wider than long, and a centre of mass that is nowhere near the hull."""
        if self.width > self.length and not (isinstance(self.width, Unusual) or isinstance(self.length, Unusual)):
            raise ImplausibleValue(
                f"Hull.width = {self.width:g} m is more than Hull.length = {self.length:g} m; are they swapped? If it "
                f"is meant: width=unusual({self.width:g}), or --unusual in a sweep."
            )
        place, keel, deck = self.center_of_mass_height, self.ground_clearance, self.ground_clearance + self.height
        low, high = keel - LOAD_BELOW * self.height, deck + LOAD_ABOVE * self.height
        if not low <= place <= high and not isinstance(place, Unusual):
            raise ImplausibleValue(
                f"Hull.center_of_mass_height = {place:g} m above hard ground, and the hull reaches from "
                f"ground_clearance = {keel:g} m to ground_clearance + height = {deck:.6g} m (plausible: "
                f"{max(low, 0.0):.3g} to {high:.6g} m, with a load on deck); give the height above the ground, or mend "
                f"Hull.height. If it is meant: center_of_mass_height=unusual({place:g}), or --unusual in a "
                "sweep."
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
class Wheel(Declared):
    """A rigid tyre and rim; all four wheels are alike."""

    mass: Annotated[float, Quantity("kg", above=0.0, at_most=1e6, plausible=(0.01, 3e3))]
    """Mass of tyre and rim"""
    diameter: Annotated[float, Quantity("m", above=0.0, at_most=100.0, plausible=(0.02, 5.0))]
    """Outer diameter of the tyre"""
    width: Annotated[float, Quantity("m", above=0.0, at_most=100.0, plausible=(5e-3, 3.0))]
    """Width of the tyre"""
    inertia: Annotated[tuple[float, float] | None, Quantity("kg m^2", above=0.0, at_most=1e9)] = None
    """(spin, transverse) about the centre; None: a uniform solid cylinder"""

    def _check(self) -> None:
        if self.width > self.diameter and not (isinstance(self.width, Unusual) or isinstance(self.diameter, Unusual)):
            raise ImplausibleValue(
                f"Wheel.width = {self.width:g} m is more than Wheel.diameter = {self.diameter:g} m; are they swapped? "
                f"If it is meant, a roller: width=unusual({self.width:g}), or --unusual in a sweep."
            )
        if self.inertia is not None:
            spin, transverse = self.inertia
            if spin > 2.0 * transverse:
                raise ValueError(
                    f"Wheel.inertia = {self.inertia}: the spin inertia must not exceed twice the transverse one; no "
                    "rigid body has that. Give (spin, transverse) about the centre."
                )
            largest = self.mass * self.radius**2  # all of the mass at the tread
            if not 0.05 * largest <= spin <= 1.0001 * largest and not isinstance(spin, Unusual):
                raise ImplausibleValue(
                    f"Wheel.inertia = {self.inertia}: a wheel of {self.mass:g} kg and {self.diameter:g} m has a spin "
                    f"inertia of {0.5 * largest:.3g} (solid) to {largest:.3g} kg m^2 (a hoop); give kg m^2, or "
                    f"unusual({spin:g})."
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
class Wishbones(Declared):
    """Front view of a double wishbone: two parallel-axis A-arms, each as two rigid rods (fore and aft)."""

    upper_length: Annotated[float, Quantity("m", above=0.0, at_most=100.0, plausible=(5e-3, 3.0))]
    """Upper arm, hull pivot to ball joint"""
    lower_length: Annotated[float, Quantity("m", above=0.0, at_most=100.0, plausible=(5e-3, 3.0))]
    """Lower arm, hull pivot to ball joint"""
    ball_joint_inset: Annotated[float, Quantity("m", at_least=-100.0, at_most=100.0)]
    """Ball joints inboard of the wheel centre"""
    upper_height: Annotated[float, Quantity("m", above=0.0, at_most=100.0, plausible=(2e-3, 3.0))]
    """Upper ball joint above the wheel centre"""
    lower_height: Annotated[float, Quantity("m", above=0.0, at_most=100.0, plausible=(2e-3, 3.0))]
    """Lower ball joint below the wheel centre"""
    pivot_spread: Annotated[float, Quantity("m", above=0.0, at_most=100.0, plausible=(2e-3, 3.0))]
    """Distance of the two hull pivots of an arm along x"""
    upper_pivot_drop: Annotated[float, Quantity("m", at_least=-100.0, at_most=100.0)] = 0.0
    """Hull pivot of the upper arm below its ball joint at ride height: camber gain"""

    def _check(self) -> None:
        steepest = 0.9 * self.upper_length
        hint = "use a longer arm or a smaller drop."
        require_within("Wishbones", -steepest, steepest, hint, upper_pivot_drop=self.upper_pivot_drop)


@dataclass(frozen=True)
class Suspension(Declared):
    """Independent suspension of one wheel, rates as felt at the wheel along the hull's z axis.

    Without `wishbones` the upright slides on a pillar along the hull's z axis. The spring carries the static load of
    the hull at ride height, so stiffness can be edited without changing the ride height.
    """

    stiffness: Annotated[float, Quantity("N/m", above=0.0, at_most=1e12, plausible=(5.0, 1e8))]
    """Rate of the spring"""
    damping: Annotated[float, Quantity("N s/m", at_least=0.0, at_most=1e7, plausible=(0.0, 1e6))]
    """Rate of the damper"""
    upright_mass: Annotated[float, Quantity("kg", above=0.0, at_most=1e6, plausible=(2e-3, 2e3))]
    """Mass of the upright, which steers and does not spin"""
    upright_size: Annotated[float, Quantity("m", above=0.0, at_most=100.0, plausible=(2e-3, 3.0))]
    """Edge of the cube whose inertia the upright has"""
    bump_travel: Annotated[float, Quantity("m", above=0.0, at_most=100.0, plausible=(5e-4, 1.0))]
    """Travel from ride height to the bump stop"""
    rebound_travel: Annotated[float, Quantity("m", above=0.0, at_most=100.0, plausible=(5e-4, 1.0))]
    """Travel from ride height to the rebound stop"""
    stop_stiffness: Annotated[float, Quantity("N/m", above=0.0, at_most=1e12, plausible=(5.0, 1e9))]
    """Stiffness of either stop"""
    stop_softening: Annotated[float, Quantity("m", above=0.0, at_most=100.0, plausible=(1e-5, 0.5))] = 2.0e-3
    """Compression over which a stop's stiffness builds up"""
    wishbones: Wishbones | None = None
    """Linkage of the upright; None: it slides on a pillar"""

    def _check(self) -> None:
        stop, spring = self.stop_stiffness, self.stiffness
        if stop < spring and not (isinstance(stop, Unusual) or isinstance(spring, Unusual)):
            raise ImplausibleValue(
                f"Suspension.stop_stiffness = {stop:g} N/m is less than Suspension.stiffness = {spring:g} N/m; are "
                f"they swapped? If it is meant: stop_stiffness=unusual({stop:g}), or --unusual in a sweep."
            )

    @property
    def upright_inertia_tensor(self) -> Array:
        """Inertia tensor of the upright about the wheel centre, upright axes [kg m^2], shape (3, 3)."""
        return box_inertia(self.upright_mass, self.upright_size, self.upright_size, self.upright_size)


@dataclass(frozen=True)
class Steering(Declared):
    """Front-wheel steering; the commanded angle is that of the middle of the front axle."""

    geometry: Literal["parallel", "ackermann"] = "parallel"
    """parallel: both wheels turn by the command (the paper); ackermann: both axes meet on the rear axle's line"""
    limit: Annotated[float, Quantity("rad", at_least=0.0, at_most=math.radians(80.0))] = math.radians(35.0)
    """Largest commanded angle"""


@dataclass(frozen=True)
class Vehicle(Declared):
    """A four-wheeled vehicle with front steering and prescribed wheel speeds."""

    name: str
    """Name in messages and results"""
    hull: Hull
    """The sprung body"""
    wheel: Wheel
    """Each of the four wheels"""
    suspension: Suspension
    """Suspension of the front wheels, and of the rear ones unless `rear_suspension` is given"""
    wheelbase: Annotated[float, Quantity("m", above=0.0, at_most=1e3, plausible=(0.05, 20.0))]
    """Distance between the axles"""
    track: Annotated[float, Quantity("m", above=0.0, at_most=1e3, plausible=(0.04, 10.0))]
    """Distance between the middles of the left and the right tyre"""
    steering: Steering = Steering()
    """Steering of the front wheels"""
    rear_suspension: Suspension | None = None
    """Suspension of the rear wheels; None: as in front"""

    def _check(self) -> None:
        gap = 0.5 * (self.track - self.wheel.width - self.hull.width)
        is_box = self.hull.mesh is None  # a mesh has its wheel arches: `exumob.water.mesh_file` looks at it
        if is_box and gap < 0.0 and self.hull.ground_clearance < self.wheel.diameter:
            raise ValueError(
                f"Vehicle.track = {self.track} m puts the tyres {-gap:.3f} m inside the hull, a box; it must be at "
                f"least hull.width + wheel.width = {self.hull.width + self.wheel.width:.3f} m. A body over the wheels "
                "needs Hull.mesh, a surface with wheel arches; or give the width between the tyres as Hull.width."
            )
        if self.wheelbase <= self.wheel.diameter or self.track <= self.wheel.width:
            raise ValueError(
                f"Vehicle.wheelbase = {self.wheelbase:g} m and track = {self.track:g} m must be larger than the tyre's "
                f"diameter ({self.wheel.diameter:g} m) and width ({self.wheel.width:g} m): its wheels would overlap. "
                "Move the axles apart or give smaller wheels."
            )
        for suspension in self.axle_suspensions:
            frequency = math.sqrt(4.0 * suspension.stiffness / self.hull.mass) / (2.0 * math.pi)
            if frequency < SLOWEST_HEAVE and not isinstance(suspension.stiffness, Unusual):
                raise ImplausibleValue(
                    f"Suspension.stiffness = {suspension.stiffness:g} N/m lets {self.hull.mass:g} kg heave at "
                    f"{frequency:.2g} Hz; is it in N/mm? Then give {1e3 * suspension.stiffness:g} N/m. If it is meant: "
                    f"stiffness=unusual({suspension.stiffness:g})."
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
