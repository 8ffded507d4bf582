"""The parts of a run, everything that its result depends on, in one record."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

from exumob.coupling.macro_step import FollowFlow
from exumob.coupling.scheme import Coupling
from exumob.driving.maneuver import Maneuver
from exumob.ground.soil import Soil
from exumob.ground.terrain import Terrain
from exumob.vehicle.parameters import Vehicle
from exumob.vehicle.point_force import PointForce
from exumob.vehicle.start_pose import AT_ORIGIN, StartPose
from exumob.water.conditions import Water
from exumob.water.hydrodynamics import Hydrodynamics


@dataclass(frozen=True)
class Steps:
    """Duration and steps of a run [s]."""

    duration: float
    micro_step: float
    macro_step: float | FollowFlow
    record_step: float

    @property
    def longest_macro_step(self) -> float:
        """The macro step, or the longest of those that follow the flow [s]."""
        return self.macro_step.longest if isinstance(self.macro_step, FollowFlow) else self.macro_step

    @property
    def macro_step_unit(self) -> float:
        """Length of which every macro step is a whole multiple [s]."""
        return self.macro_step.unit if isinstance(self.macro_step, FollowFlow) else self.macro_step


@dataclass(frozen=True)
class RunDescription:
    """The parts of a run; its result and its checkpoint keep them all."""

    vehicle: Vehicle
    soil: Soil
    water: Water | None
    terrain: Terrain
    maneuver: Maneuver
    hydrodynamics: Hydrodynamics
    coupling: Coupling
    steps: Steps
    initial_speed: float
    """Speed at time 0 along the heading [m/s]"""
    forces: tuple[PointForce, ...] = ()
    """Forces of the user's own"""
    user_loads: bool = False
    """Whether the loads enter as user loads of Exudyn, not as one vector of generalised forces"""
    start: StartPose = AT_ORIGIN
    """Where the vehicle begins, and its heading there"""

    def parts(self) -> dict[str, Any]:
        """Return the parts by name; the steps as a dict of numbers [s]."""
        found = {f.name: getattr(self, f.name) for f in fields(self)}
        return found | {"steps": {f.name: getattr(self.steps, f.name) for f in fields(Steps)}}
