"""The defaults of a run: duration, soil, and the steps by name.

The command line, `exumob.simulate`, sweeps and maps all take them from here.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from exumob.support.constants import GRAVITY
from exumob.support.declared import checked
from exumob.support.quantities import shown

if TYPE_CHECKING:
    from exumob.vehicle.parameters import Vehicle

DURATION = 8.0
"""Simulated time of a run [s]: that of the paper's lane change."""
RECORD_STEP = 1.0e-2
"""Interval between the instants of a result [s]."""
SOIL = "LETE sand"
"""The published soil of a run that names none."""
FROUDE_NUMBER = 1.0 / math.sqrt(GRAVITY * 0.714)
"""Speed over sqrt(g L) of the paper's vehicle: 1 m/s of the tyres' tread on a wheelbase L of 0.714 m."""


def usual_speed(vehicle: Vehicle) -> float:
    """Return the speed of the tyres' tread at which a vehicle is driven where none is named [m/s]: `FROUDE_NUMBER`."""
    return FROUDE_NUMBER * math.sqrt(GRAVITY * vehicle.wheelbase)


def time_scale(vehicle: Vehicle) -> float:
    """Return the time that is to this vehicle what 1 s is to the paper's, by Froude's law [s]."""
    return usual_speed(vehicle)  # both go with the root of the wheelbase, and the paper's speed is 1 m/s


@dataclass(frozen=True)
class Setting:
    """Steps of a run, by name, with what they cost in accuracy."""

    name: str
    micro_step: float
    """Step of the multibody solver [s]."""
    macro_step: float
    """Interval at which the loads of the water are renewed [s], for models that answer at once."""
    flow_micro_step: float
    flow_macro_step: float
    """The same two with a flow solver in the loop [s]: its loads change faster than 20 ms can follow."""
    error: str
    """How far a run with these steps ends from one with the finest, as measured."""

    def steps(self, flow_in_loop: bool) -> tuple[float, float]:
        """Return micro step and macro step [s], with or without a flow solver in the loop."""
        return (self.flow_micro_step, self.flow_macro_step) if flow_in_loop else (self.micro_step, self.macro_step)


SETTINGS = {
    "fast": Setting(
        "fast", 1.0e-3, 20.0e-3, 5.0e-4, 2.0e-3,
        "the lane change of the paper ends within 6 mm (0.2 % of the path) and 0.02 deg of fine",
    ),
    "fine": Setting("fine", 1.0e-4, 1.0e-3, 1.0e-4, 1.0e-3, "the steps of the paper, against which fast is measured"),
}  # fmt: skip
"""The settings by name; the paper uses both (Sec. 5.3).

Measured by `benchmarks/settings.py`, fast against fine: 0.0 mm on dry ground, 1 to 2 mm in D60 with coefficients,
2.6 mm (D60/U0) and 5.7 mm (D60/U1, 0.19 % of the path) with the networks; fine takes about eight times as long. With
the flow solver in the loop, D60/U1 on 18 mm cells ends 2 mm ahead and 10 mm beside the run with macro steps of 1 ms;
two runs at 1 ms that differ in the spin-up end 24 mm apart.
"""
DEFAULT_SETTING = "fast"


@checked
def setting_named(name: str) -> Setting:
    """Return one of `SETTINGS`.

    Raises
    ------
    ValueError
        If no setting has this name.
    """
    if name not in SETTINGS:
        raise ValueError(f"setting = {shown(name)} is not known; use {' or '.join(map(repr, SETTINGS))}.")
    return SETTINGS[name]
