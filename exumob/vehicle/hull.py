"""The body of a vehicle as data: boxes with wheel arches, or a mesh."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np

from exumob.support.arrays import Array
from exumob.support.checks import require_within
from exumob.support.declared import Declared
from exumob.support.quantities import ImplausibleValue, Quantity, Unusual

LONG = 1.5
"""Length over width and height from which a hull plausibly pitches about a larger inertia than it rolls about [-]."""
LOAD_ABOVE, LOAD_BELOW = 1.0, 0.25
"""How far the centre of mass may plausibly lie above the deck (a load on it) and below the keel [hull heights]."""


SIZE = Quantity("m", above=0.0, at_most=1e3, plausible=(0.02, 30.0))
"""Size of a part of a hull"""
ARCH_CLEARANCE = 0.05
"""Clearance of a wheel arch where it is not given, over the tyre's diameter [-]."""


@dataclass(frozen=True)
class Box(Declared):
    """A box that a hull has besides its first one: a cabin, a bonnet, the bed of a truck.

    It may stand on the others, beside them or reach into them: the hull is what they enclose together.
    """

    length: Annotated[float, SIZE]
    """Length over all"""
    width: Annotated[float, SIZE]
    """Width over all"""
    height: Annotated[float, SIZE]
    """Height from floor to roof"""
    bottom: Annotated[float, Quantity("m", above=0.0, at_most=1e3, plausible=(2e-3, 30.0))]
    """Height of its floor above hard ground"""
    center_x: Annotated[float, Quantity("m", at_least=-1e3, at_most=1e3)] = 0.0
    """Middle of its length ahead of mid wheelbase"""
    bow_length: Annotated[float, Quantity("m", at_least=0.0, at_most=1e3)] = 0.0
    """Length over which its floor rises in front, up to the whole; 0: a plain box"""
    bow_height: Annotated[float, Quantity("m", at_least=0.0, at_most=1e3)] = 0.0
    """Height above its floor where the rake ends, up to the roof"""
    stern_length: Annotated[float, Quantity("m", at_least=0.0, at_most=1e3)] = 0.0
    """Length over which its floor rises at the back; 0: it does not"""
    stern_height: Annotated[float, Quantity("m", at_least=0.0, at_most=1e3)] = 0.0
    """Height above its floor where that ends, up to the roof"""

    def _check(self) -> None:
        _check_rake("Box", self)

    def side_profile(self) -> Array:
        """Return its outline from starboard: corners (x, z) in the design frame [m], shape (n, 2); see `Hull`."""
        return _raked(self, self.bottom)


@dataclass(frozen=True)
class WheelArches(Declared):
    """Room for the wheels, cut out of the sides of all boxes of a hull, open below and outwards.

    Seen from the side an arch is a half circle (lower than that: a half ellipse) on straight legs, with a flat roof
    along the axle; an upright wall closes it inboard. Distances are those from the tyre at ride height, straight ahead,
    alike at both axles. One that is not given leaves `clearance` to the tyre wherever steering and suspension take it:
    front arches are then deeper than rear ones, which need not make room for steering.
    """

    clearance: Annotated[float | None, Quantity("m", at_least=0.0, at_most=100.0, plausible=(1e-3, 1.0))] = None
    """Distance to the tyre where it comes closest; None: a twentieth of its diameter"""
    ahead: Annotated[float | None, Quantity("m", at_least=0.0, at_most=100.0, plausible=(1e-3, 3.0))] = None
    """Legs ahead of the tyre and behind it"""
    above: Annotated[float | None, Quantity("m", at_least=0.0, at_most=100.0, plausible=(1e-3, 3.0))] = None
    """Roof above the tyre"""
    inboard: Annotated[float | None, Quantity("m", at_least=0.0, at_most=100.0, plausible=(1e-3, 3.0))] = None
    """Wall inboard of the tyre"""
    corners: Annotated[int, Quantity("1", at_least=2, at_most=64)] = 6
    """Corners that stand for the round part, outside it: 2 make a rectangle, 3 a trapezium"""


@dataclass(frozen=True)
class Hull(Declared):
    """The sprung body: a box with a raked bow and perhaps more boxes and wheel arches, or any watertight mesh.

    The keel is flat from the stern to `bow_length` behind the foremost point, then rises straight to `bow_height`
    above the keel; from there the stem is vertical up to the deck. The stern may be raked in the same way.
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
    stern_length: Annotated[float, Quantity("m", at_least=0.0, at_most=1e3)] = 0.0
    """Length over which the keel rises at the stern, up to what the bow leaves; 0: it does not"""
    stern_height: Annotated[float, Quantity("m", at_least=0.0, at_most=1e3)] = 0.0
    """Height above the keel where that ends, up to the deck"""
    inertia: Annotated[tuple[float, float, float] | None, Quantity("kg m^2", above=0.0, at_most=1e12)] = None
    """(I_xx, I_yy, I_zz) about the centre of mass; None: a uniform box of this size and mass"""
    mesh: Path | None = None
    """Watertight surface (STL, OBJ ...) in the design frame [m] that replaces the box, with its wheel arches; needs
    trimesh. `length`, `width` and `height` stay its overall sizes; `exumob.water.mesh_file` says what is refused"""
    boxes: tuple[Box, ...] = ()
    """More boxes; the sizes above are those of the first one alone"""
    wheel_arches: WheelArches | None = None
    """Room for the wheels in the sides of the boxes; None: they are whole"""

    def _check(self) -> None:
        require_within(
            "Hull", -self.length, self.length, "give a place within Hull.length.",
            center_of_mass_x=self.center_of_mass_x, center_x=self.center_x,
        )  # fmt: skip
        _check_rake("Hull", self)
        if self.mesh is not None and (self.boxes or self.wheel_arches):
            given = "boxes" if self.boxes else "wheel_arches"
            raise ValueError(
                f"Hull.{given} and Hull.mesh are both given, and a mesh is the whole body; leave one of them out."
            )
        self._check_sizes()
        self._check_joined()
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
            roll, *others = self.inertia
            long = self.length > LONG * max(self.width, self.height)
            if long and roll > min(others) and not isinstance(roll, Unusual):
                raise ImplausibleValue(
                    f"Hull.inertia = {self.inertia}: the first one, about the roll axis, is not the smallest in a hull "
                    f"{self.length:g} m long and {self.width:g} m wide; give (roll, pitch, yaw); are they swapped? If "
                    f"it is meant: unusual({roll:g})."
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

    def _check_joined(self) -> None:
        """Refuse boxes that hang in the air beside the rest of the hull; rakes are left out of account."""
        ends = [(profile.min(axis=0), profile.max(axis=0)) for profile in (part.side_profile() for part in self.parts)]
        joined, left = [0], list(range(1, len(ends)))
        size = 1e-3 * self.length
        while near := [n for n in left if any(_touch(ends[n], ends[m], size) for m in joined)]:
            joined += near
            left = [n for n in left if n not in near]
        for n in left:
            box = self.boxes[n - 1]
            if not isinstance(box.bottom, Unusual):
                (x_low, z_low), (x_high, z_high) = ends[n]
                raise ImplausibleValue(
                    f"Hull.boxes[{n - 1}] hangs in the air: it reaches from {x_low:.4g} to {x_high:.4g} m ahead of mid "
                    f"wheelbase and from {z_low:.4g} to {z_high:.4g} m above the ground, and touches nothing of the "
                    f"hull (its first box ends {ends[0][1][1]:.4g} m above the ground); mend its bottom, which counts "
                    f"from the ground, or its center_x. If it is meant: bottom=unusual({box.bottom:g})."
                )

    @property
    def inertia_tensor(self) -> Array:
        """Inertia tensor about the centre of mass, hull axes [kg m^2], shape (3, 3)."""
        if self.inertia is not None:
            return np.diag(np.array(self.inertia, dtype=float))
        return box_inertia(self.mass, self.length, self.width, self.height)

    def side_profile(self) -> Array:
        """Return the outline of the raked box from starboard: corners (x, z) in the design frame [m], shape (n, 2).

        Counter-clockwise with x to the right and z up, from the stern's lowest point; three to six corners, no two in a
        row equal.
        """
        return _raked(self, self.ground_clearance)

    @property
    def parts(self) -> tuple[Hull | Box, ...]:
        """All boxes of the hull, the first one first."""
        return (self, *self.boxes)

    @property
    def extent(self) -> tuple[Array, Array]:
        """Lowest and highest x, y, z of the boxes in the design frame [m], each of shape (3,)."""
        outlines = [part.side_profile() for part in self.parts]
        half = 0.5 * max(part.width for part in self.parts)
        (x_low, z_low), (x_high, z_high) = (f([f(o, axis=0) for o in outlines], axis=0) for f in (np.min, np.max))
        return np.array([x_low, -half, z_low]), np.array([x_high, half, z_high])


def _touch(one: tuple[Array, Array], other: tuple[Array, Array], size: float) -> bool:
    """Whether two rectangles, given by their corners, overlap or touch to within a size [m]."""
    return bool((one[0] <= other[1] + size).all() and (other[0] <= one[1] + size).all())


def _check_rake(owner: str, box: Hull | Box) -> None:
    if box.bow_length > box.length:
        require_within(owner, 0.0, box.length, f"give a part of {owner}.length.", bow_length=box.bow_length)
    left = box.length - box.bow_length
    if box.stern_length > left:
        require_within(
            owner, 0.0, left, f"give a part of {owner}.length less bow_length.", stern_length=box.stern_length
        )
    if box.bow_height > box.height:
        require_within(owner, 0.0, box.height, f"give a part of {owner}.height.", bow_height=box.bow_height)
    if box.stern_height > box.height:
        require_within(owner, 0.0, box.height, f"give a part of {owner}.height.", stern_height=box.stern_height)


def _raked(box: Hull | Box, keel: float) -> Array:
    """Corners of a box with a raked bow and stern above a keel."""
    stern, bow = box.center_x - 0.5 * box.length, box.center_x + 0.5 * box.length
    deck = keel + box.height
    corners = np.array(
        [
            [stern, keel + box.stern_height], [stern + box.stern_length, keel], [bow - box.bow_length, keel],
            [bow, keel + box.bow_height], [bow, deck], [stern, deck],
        ]
    )  # fmt: skip
    apart = np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1) > 0.0
    return np.asarray(corners[apart])


def box_inertia(mass: float, length: float, width: float, height: float) -> Array:
    """Return the inertia tensor of a uniform box about its centre [kg m^2], shape (3, 3)."""
    x2, y2, z2 = length**2, width**2, height**2
    return mass / 12.0 * np.diag([y2 + z2, x2 + z2, x2 + y2])
