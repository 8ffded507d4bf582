"""Free-surface flow solver: the high-fidelity water model (paper, Sec. 2.1).

solver = FlowSolver(grid, solids, water, settings)
solver.start(poses)
loads = solver.advance(time, poses)

The step reads like the method in `exumob.flow.step`. A vehicle on a prescribed path: `exumob.towing_tank`.
"""

from typing import TYPE_CHECKING

from exumob.support.lazy import on_first_use

if TYPE_CHECKING:
    from exumob.flow.grid import Grid
    from exumob.flow.poses import Poses
    from exumob.flow.settings import FlowSettings
    from exumob.flow.solids import Solid, box, cylinder, hull_prism, mesh_solid, prism, sphere, vehicle_solids
    from exumob.flow.solver import FlowSolver
    from exumob.flow.state import Loads, StepReport
    from exumob.flow.tread import Tread
    from exumob.flow.turbulence.closures import KOmegaSST, Smagorinsky
else:
    __getattr__, __dir__ = on_first_use(__name__)

__all__ = [
    "FlowSettings", "FlowSolver", "Grid", "KOmegaSST", "Loads", "Poses", "Smagorinsky", "Solid", "StepReport", "Tread",
    "box", "cylinder", "hull_prism", "mesh_solid", "prism", "sphere", "vehicle_solids",
]  # fmt: skip
