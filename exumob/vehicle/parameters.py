"""The vehicle as data: one frozen dataclass a component, one value a field.

Design frame: origin on the ground below the middle of the wheelbase, x forward, y left, z up, with the tyres just
touching hard ground at the static ride height. SI units and radians. Vehicle files (``vehicle_models/``) fill these in.
"""

from __future__ import annotations

import copy
import math
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np

from exumob.support.arrays import Array
from exumob.support.declared import Declared
from exumob.support.quantities import ImplausibleValue, Quantity, Unusual
from exumob.vehicle.body import is_plain
from exumob.vehicle.hull import Box, Hull, WheelArches, box_inertia
from exumob.vehicle.running_gear import Suspension, Wheel, Wishbones
from exumob.vehicle.wheel_motion import Axle
from exumob.vehicle.wheel_room import WheelGap, least_gap, wheels_clear

__all__ = [
    "Box",
    "Hull",
    "Motion",
    "Steering",
    "Suspension",
    "Vehicle",
    "Wheel",
    "WheelArches",
    "WheelGap",
    "Wishbones",
    "box_inertia",
    "least_wheel_gap",
]  # fmt: skip

LEAST_DAMPING = 0.005
"""Least plausible damping of a hull on its springs, over the critical one [-]; cars have 0.2 to 0.4. 0 is none."""
WIDEST_TRACK = 1.5
"""Largest plausible track over the wheelbase [-]."""
SLOWEST_HEAVE = 0.2
"""Slowest plausible heave of a hull on its springs [Hz]; cars have 1 to 2, small models 3 to 10."""
Motion = tuple[float, float, float]
"""A value and its first and second time derivatives."""


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
        self._check_tyres_beside_hull()
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
            critical = 2.0 * math.sqrt(suspension.stiffness * 0.25 * self.hull.mass)
            damping = suspension.damping
            if 0.0 < damping < LEAST_DAMPING * critical and not isinstance(damping, Unusual):
                raise ImplausibleValue(
                    f"Suspension.damping = {damping:g} N s/m is {100.0 * damping / critical:.2g} % of the critical one "
                    f"({critical:.3g} N s/m); is it in N s/mm? Then give {1e3 * damping:g} N s/m; 0 is none. If it is "
                    f"meant: damping=unusual({damping:g})."
                )
        if self.track > WIDEST_TRACK * self.wheelbase and not isinstance(self.track, Unusual):
            raise ImplausibleValue(
                f"Vehicle.track = {self.track:g} m is {self.track / self.wheelbase:.3g} times the wheelbase, "
                f"{self.wheelbase:g} m, and up to {WIDEST_TRACK:g} is plausible; are they swapped? If it is meant: "
                f"track=unusual({self.track:g})."
            )
        front = self.front_load_share
        if not 0.05 <= front <= 0.95:
            raise ValueError(
                f"Hull.center_of_mass_x = {self.hull.center_of_mass_x} m puts {100 * front:.0f} % of the hull's weight "
                "on the front axle; it must lie between the axles (5 % to 95 %)."
            )
        if self.hull.mesh is None:  # `exumob.water.mesh_file` looks at a mesh, once it is read
            self._check_wheel_room()

    def _check_tyres_beside_hull(self) -> None:
        """Refuse a box of which the tyres are a part straight ahead: the commonest mistake, told by its numbers."""
        gap = 0.5 * (self.track - self.wheel.width - self.hull.width)
        if is_plain(self.hull) and gap < 0.0 and self.hull.ground_clearance < self.wheel.diameter:
            raise ValueError(
                f"Vehicle.track = {self.track} m puts the tyres {-gap:.3f} m inside the hull, a box; it must be at "
                f"least hull.width + wheel.width = {self.hull.width + self.wheel.width:.3f} m. A body over the wheels "
                "needs Hull.wheel_arches, or Hull.mesh, a surface with wheel arches; or give the width between the "
                "tyres as Hull.width."
            )

    def _check_wheel_room(self) -> None:
        """Refuse a hull of boxes that a tyre enters on its way."""
        turning = math.hypot(self.wheel.radius, 0.5 * self.wheel.width)  # a tyre on pillars reaches no further
        upright = all(suspension.wishbones is None for suspension in self.axle_suspensions)
        if upright and not self.hull.boxes and 0.5 * (self.track - self.hull.width) >= turning:
            return
        touch = wheels_clear(self.hull, self.axles)
        if touch is not None:
            raise ValueError(touch_message(self, "Hull.wheel_arches" if self.hull.wheel_arches else "Hull", touch))

    @property
    def mass(self) -> float:
        """Total mass [kg]."""
        return self.hull.mass + 4.0 * self.wheel.mass + sum(2.0 * s.upright_mass for s in self.axle_suspensions)

    @property
    def axle_suspensions(self) -> tuple[Suspension, Suspension]:
        """Suspensions of the front and of the rear axle."""
        return self.suspension, self.rear_suspension or self.suspension

    @property
    def axles(self) -> tuple[Axle, Axle]:
        """Front and rear axle: the left tyre of each, and how far it steers and moves."""
        low, high = 0.0, 0.0
        if self.steering.limit > 0.0:
            low, high = (self.steering_angles((s * self.steering.limit, 0.0, 0.0))[0][0] for s in (-1.0, 1.0))
        half, y = 0.5 * self.wheelbase, 0.5 * self.track
        front, rear = (
            Axle(x, y, self.wheel.radius, 0.5 * self.wheel.width, *angles, s.bump_travel, s.rebound_travel, s.wishbones)
            for x, angles, s in zip((half, -half), ((low, high), (0.0, 0.0)), self.axle_suspensions, strict=True)
        )
        return front, rear

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


def least_wheel_gap(vehicle: Vehicle) -> WheelGap:
    """Return where a tyre comes closest to a hull of boxes, on all ways that steering and suspension allow.

    Its `gap` is infinite if that is further away than the tyre's radius. See `exumob.vehicle.wheel_room.least_gap`; of
    a mesh `exumob.water.mesh_file.mesh_wheel_gap` tells it.

    Raises
    ------
    ValueError
        If the hull is a mesh.
    """
    if vehicle.hull.mesh is not None:
        raise ValueError(f"{vehicle.name}: Hull.mesh is given; ask exumob.water.mesh_file.mesh_wheel_gap.")
    return least_gap(vehicle.hull, vehicle.axles)


def touch_message(vehicle: Vehicle, what: str, touch: WheelGap) -> str:
    """Return the error about a tyre that enters the body, which `what` names."""
    widest = _widest_body(vehicle)
    narrow = f"Hull.width = {widest:g} m, about" if widest > 0.0 else "Hull.width"
    remedy = f"move the wheels out (Vehicle.track), give a narrower body ({narrow}), less travel"
    if touch.angle:
        inner = abs(touch.angle) > 1.001 * vehicle.steering.limit
        further = f", at which the inner wheel turns {math.degrees(abs(touch.angle)):.3g} deg" if inner else ""
        remedy += f", or less steering (Steering.limit = {math.degrees(vehicle.steering.limit):.3g} deg{further})"
    arches = "larger wheel arches" if vehicle.hull.mesh or vehicle.hull.wheel_arches else "Hull.wheel_arches"
    return (
        f"{what}: {vehicle.name} with Vehicle.track = {vehicle.track:g} m lets a tyre enter the body: {touch}, "
        f"{-1e3 * touch.gap:.1f} mm deep. Give it {arches}, or {remedy}."
    )


def _widest_body(vehicle: Vehicle) -> float:
    """Largest width of a hull of boxes without arches that the tyres clear, to a hundredth of it [m]; 0: none is."""
    hull, axles = copy.copy(vehicle.hull), vehicle.axles
    if hull.mesh is not None or hull.wheel_arches is not None:
        return 0.0
    low, high = 0.0, hull.width
    while high - low > 0.01 * hull.width:
        middle = 0.5 * (low + high)
        object.__setattr__(hull, "width", middle)  # by its form alone, whatever else such a hull would need
        low, high = (middle, high) if wheels_clear(hull, axles) is None else (low, middle)
    return math.floor(1e3 * low) / 1e3


def _ackermann(command: Motion, ratio: float) -> Motion:
    """Motion of a front wheel at y = ratio * wheelbase: cot(wheel) = cot(command) - ratio."""
    angle, rate, acceleration = command
    s, c = math.sin(angle), math.cos(angle)
    x = c - ratio * s
    norm = s * s + x * x
    slope = 1.0 / norm  # d wheel / d command
    curvature = -2.0 * (s * c - x * (s + ratio * c)) / norm**2
    return math.atan2(s, x), slope * rate, slope * acceleration + curvature * rate**2
