"""Tread of a wheel: lugs that stand out of the tyre and push water round. Off unless a solid is given one.

The spin of a wheel is no part of the solid's velocity in projection and transport, since it is along the surface. What
lugs do is put in explicitly as a body force in the ring that they sweep (`exumob.flow.forces.lug_drag`), so that its
size can be stated and varied.
"""

from __future__ import annotations

from dataclasses import dataclass

from exumob.support.checks import require_within


@dataclass(frozen=True)
class Tread:
    """Lugs across a cylinder's whole width: plates that drag along their direction of motion.

    The force on the water is C_D rho |u| u / 2 times the lugs' area, spread over the ring that they sweep (at least
    one and a half cells thick); u is the water's speed along the circumference relative to the lugs, which move with
    the wheel and its spin. Lugs in each other's wake and the slip stream between them are not resolved: with the lugs
    closer than about five heights apart, this is an upper bound.

    Parameters
    ----------
    lug_height : float
        Above the cylinder's surface [m], 0.5 mm to 0.1 m.
    lug_count : int
        Round the circumference, 1 to 500.
    drag_coefficient : float
        Drag coefficient of one lug [-]; 1.2: plate across the flow with a side ratio of 1 to 5 (Hoerner, Fluid-Dynamic
        Drag, 1965, ch. 3: 1.17 to 1.20).
    """

    lug_height: float
    lug_count: int
    drag_coefficient: float = 1.2

    def __post_init__(self) -> None:
        require_within("Tread", 5.0e-4, 0.1, lug_height=self.lug_height)
        require_within("Tread", 1, 500, lug_count=self.lug_count)
        require_within("Tread", 0.0, 3.0, drag_coefficient=self.drag_coefficient)
