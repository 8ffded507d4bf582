"""Free-surface flow solver: the high-fidelity water model (paper, Sec. 2.1).

solver = FlowSolver(grid, solids, water, settings)
solver.start(poses)
loads = solver.advance(time, poses)

A vehicle on a prescribed path: ``captive_run(vehicle, water, CaptiveMotion(speed=1.0))``.
"""

from exumob.flow.body import Poses, Solid, box, cylinder, hull_prism, mesh_solid, prism, sphere, vehicle_solids
from exumob.flow.captive import captive_run, captive_summary
from exumob.flow.captive_checks import check_resolution
from exumob.flow.grid import Grid
from exumob.flow.motion import CaptiveMotion, PrescribedMotion
from exumob.flow.settings import FlowSettings
from exumob.flow.solver import FlowSolver
from exumob.flow.state import Loads, StepReport
from exumob.flow.tread import Tread
from exumob.flow.turbulence import KOmegaSST, Smagorinsky

__all__ = [
    "CaptiveMotion", "FlowSettings", "FlowSolver", "Grid", "KOmegaSST", "Loads", "Poses", "PrescribedMotion",
    "Smagorinsky", "Solid", "StepReport", "Tread", "box", "captive_run", "captive_summary", "check_resolution",
    "cylinder", "hull_prism", "mesh_solid", "prism", "sphere", "vehicle_solids",
]  # fmt: skip
