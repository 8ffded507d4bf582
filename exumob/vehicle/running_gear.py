"""Wheels and suspension as data."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from exumob.support.arrays import Array
from exumob.support.checks import require_within
from exumob.support.declared import Declared
from exumob.support.quantities import ImplausibleValue, Quantity, Unusual
from exumob.vehicle.hull import box_inertia


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
            widest = 0.5 * spin + self.mass * (0.5 * self.width) ** 2  # all of the mass at the tyre's two sides
            if transverse > 1.0001 * widest and not isinstance(transverse, Unusual):
                raise ImplausibleValue(
                    f"Wheel.inertia = {self.inertia}: a transverse inertia of more than {widest:.3g} kg m^2 needs mass "
                    f"outside a tyre {self.width:g} m wide; give (spin, transverse); are they swapped? If it is meant: "
                    f"unusual({transverse:g})."
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
