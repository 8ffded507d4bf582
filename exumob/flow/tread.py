"""Tread of a wheel: lugs that stand out of the tyre and push water round. Off unless a solid is given one.

The spin of a wheel is no part of the solid's velocity in projection and transport, since it is along the surface. What
lugs do is put in explicitly as a body force in the ring that they sweep (`exumob.flow.forces.lug_drag`), so that its
size can be stated and varied.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from exumob.support.declared import Declared
from exumob.support.quantities import Quantity


@dataclass(frozen=True)
class Tread(Declared):
    """Lugs across a cylinder's whole width: plates that drag along their direction of motion.

    The force on the water is C_D rho |u| u / 2 times the lugs' area, spread over the ring that they sweep (at least
    one and a half cells thick); u is the water's speed along the circumference relative to the lugs, which move with
    the wheel and its spin. Lugs in each other's wake and the slip stream between them are not resolved: with the lugs
    closer than about five heights apart, this is an upper bound.
    """

    lug_height: Annotated[float, Quantity("m", at_least=5e-4, at_most=0.1)]
    """Above the cylinder's surface [m]"""
    lug_count: Annotated[int, Quantity("1", at_least=1, at_most=500)]
    """Round the circumference"""
    drag_coefficient: Annotated[float, Quantity("1", at_least=0.0, at_most=3.0)] = 1.2
    """Drag coefficient of one lug [-]; 1.2: plate across the flow with a side ratio of 1 to 5 (Hoerner, Fluid-Dynamic
    Drag, 1965, ch. 3: 1.17 to 1.20)"""
