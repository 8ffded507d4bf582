"""What is added to the spread of an ensemble for the error bars of its loads: errors that all of its members share.

Networks with a report card, and the paper's, have one floor, measured on runs kept apart (`exumob.learning.error_bars`).
The default networks have two: in water and motion like those of the paper's lane changes their errors are a third of
those in the rest of their range, and a floor for both would be too wide for the one or too narrow for the other.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from exumob.support.arrays import Array
from exumob.support.measured import measured_errors
from exumob.surrogates.ensemble import card_of
from exumob.surrogates.networks import NetworkSet

LANE_CHANGE_INPUTS = ("water_depth", "current_speed", "hull_attack", "forward_speed")
"""Inputs of the hull (`exumob.surrogates.inputs`) that tell whether a state is like those of the lane changes."""
AHEAD = 0.55
"""Largest angle between the hull and a current from ahead in the lane changes [rad]"""
BACKING = 0.05
"""Speed in reverse from which a state is not like those of lane changes, and that of a current that has no direction
[m/s]."""


@dataclass(frozen=True)
class ErrorFloor:
    """Standard deviations of errors that all members share [N, N m], shape (5, 6)."""

    usual: Array
    beyond: Array | None = None
    """Those beyond the lane changes, if `usual` is that of lane changes alone"""
    depth: tuple[float, float] = (0.0, 0.0)
    """Depth of the water in the lane changes [m]"""
    current: float = 0.0
    """Fastest current of the lane changes [m/s]"""

    def is_usual(self, inputs: Array) -> bool:
        """Whether `usual` holds in a state.

        Parameters
        ----------
        inputs : array, shape (4,)
            `LANE_CHANGE_INPUTS` of the hull, as of the vehicle in training.
        """
        if self.beyond is None:
            return True
        depth, current, attack, forward = inputs
        return bool(
            self.depth[0] - 1e-6 <= depth <= self.depth[1] + 1e-6 and current <= self.current + 1e-6
            and (abs(attack) <= AHEAD or current < BACKING) and forward >= -BACKING
        )  # fmt: skip

    def along(self, usual: Sequence[bool]) -> Array:
        """Return the floor of each instant, shape (n, 5, 6)."""
        beyond = self.usual if self.beyond is None else self.beyond
        return np.where(np.asarray(usual, bool)[:, None, None], self.usual, beyond)


def error_floor(members: Sequence[NetworkSet]) -> ErrorFloor | None:
    """Return the floor of all members of a file with a report card, or of networks that come with exumob.

    None: it was never measured.
    """
    card, table = card_of(members), measured_errors()
    if card is not None:
        return None if card.get("load_floor") is None else ErrorFloor(np.array(card["load_floor"], dtype=float))
    digests = {member.digest() for member in members}
    for name, known in {"networks": table["networks"], **table["named"]}.items():
        if digests == set(known):
            usual = np.array(table["load_floor"][name], dtype=float)
            if name != "networks":
                return ErrorFloor(usual)
            depths = [float(row["depth_ratio"]) * table["vehicle"]["wheel"]["diameter"] for row in table["runs"]]
            return ErrorFloor(
                usual, np.array(table["full_range"]["load_floor"], dtype=float), (min(depths), max(depths)),
                max(float(row["current_speed"]) for row in table["runs"]),
            )  # fmt: skip
    return None
