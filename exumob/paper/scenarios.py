"""The scenarios of the paper's lane change (Sec. 4 and 5), by name.

D60/U1 stands for water of 60 % of the tyre diameter with a current of 1 m/s from ahead. An amplitude of steering other
than 30 degrees follows in degrees, D50/U0.5/15deg, and the angle of a current from the side after an @, D50/U0.5@20.
`TRAINING` are the runs that networks learn from, `UNSEEN` those of the final evaluation; `DRAWN` were drawn by chance
when all was frozen.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Annotated

from exumob.driving.maneuver import LaneChange, lane_change
from exumob.support.declared import Declared, checked
from exumob.support.quantities import Quantity
from exumob.vehicle.parameters import Vehicle
from exumob.water.conditions import Water

NAME_PATTERN = re.compile(
    r"D(?P<depth>\d+(\.\d+)?)/U(?P<current>\d+(\.\d+)?)(@(?P<angle>-?\d+(\.\d+)?))?(/(?P<steering>-?\d+(\.\d+)?)deg)?"
)
REFERENCE_STEERING = 30.0
"""Amplitude of the steering in the paper, which a name does not mention [deg]."""


@dataclass(frozen=True)
class Scenario(Declared):
    """Water and steering of one lane change, in the units of its name."""

    depth_ratio: Annotated[float, Quantity("1", at_least=0.0, at_most=2.0)]
    """Water depth over tyre diameter"""
    current_speed: Annotated[float, Quantity("m/s", at_least=0.0, at_most=5.0)]
    """Speed of the current over ground"""
    steering: Annotated[float, Quantity("degrees", at_least=-80.0, at_most=80.0)] = REFERENCE_STEERING
    """Amplitude of the steering angle; negative: the mirrored maneuver"""
    current_angle: Annotated[float, Quantity("degrees", at_least=-180.0, at_most=180.0)] = 0.0
    """Angle of the current; 0: from ahead; positive: from the left of the first heading"""

    @classmethod
    @checked
    def named(cls, name: str) -> Scenario:
        """Make the scenario of a name: D60/U1, D50/U0.5/15deg (steering), D50/U0.5@20 (current 20 deg from the left).

        Raises
        ------
        ValueError
            If the name is not of that form.
        """
        found = NAME_PATTERN.fullmatch(name)
        if found is None:
            raise ValueError(
                f"scenario {name!r} is not of the form D60/U1, D50/U0.5/15deg or D50/U0.5@20: depth in % of the tyre's "
                "diameter, current in m/s, steering and angle of the current in degrees."
            )
        return cls(
            float(found["depth"]) / 100.0, float(found["current"]), float(found["steering"] or REFERENCE_STEERING),
            float(found["angle"] or 0.0),
        )  # fmt: skip

    @property
    def name(self) -> str:
        """Name of the scenario, as `named` takes it."""
        steering = "" if self.steering == REFERENCE_STEERING else f"/{self.steering:g}deg"
        angle = f"@{self.current_angle:g}" if self.current_angle else ""
        return f"D{100.0 * self.depth_ratio:g}/U{self.current_speed:g}{angle}{steering}"

    @property
    def file_stem(self) -> str:
        """Name of the scenario as part of a file's name."""
        return self.name.replace("/", "_")

    def water(self, vehicle: Vehicle) -> Water:
        """Water of the scenario for the tyres of a vehicle."""
        return Water.at_ratio(
            self.depth_ratio, self.current_speed, tyre_diameter=vehicle.wheel.diameter,
            current_direction=math.pi + math.radians(self.current_angle),
        )  # fmt: skip

    def maneuver(self) -> LaneChange:
        """Lane change with the scenario's amplitude of steering."""
        return lane_change(math.radians(self.steering))


TRAINING = tuple(
    Scenario.named(name)
    for name in (
        "D40/U0", "D40/U0.5", "D40/U1", "D45/U0.75", "D50/U0", "D55/U0.25", "D55/U0.75", "D60/U0", "D60/U1",
    )
)  # fmt: skip
"""Nine scenarios whose runs networks learn from (paper Fig. 10)."""
UNSEEN = tuple(Scenario.named(name) for name in ("D50/U0.5", "D60/U0.5", "D50/U1", "D50/U0.5/15deg"))
"""Four scenarios for the final evaluation: neither training nor any choice about a network uses their runs."""
DRAWN = tuple(Scenario.named(name) for name in ("D44/U0.64", "D49/U0.37", "D47/U0.79", "D58/U0.18"))
"""Four scenarios that were drawn, evenly in depth and current, when networks and coefficients were frozen.

``numpy.random.default_rng(2026)`` drew depth (0.4 to 0.6) and current (0 to 1 m/s) in turn, rounded to two digits."""
