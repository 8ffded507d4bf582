"""Settings of the Exudyn solvers."""

from __future__ import annotations

from typing import Any

from exumob.support.exudyn import exu

TOLERANCE = 1e-8
"""Relative tolerance of Newton's iterations. A run of 8 s ends within 3e-8 m of one at 1e-9 then; at 1e-5, which takes
0.75 of the time, 3e-4 m off (`benchmarks/newton_tolerance.py`)."""

LOOSER = (1e-7, 1e-6, 1e-5)
"""Tolerances for a macro step in which rounding keeps Newton's iterations from `TOLERANCE`, in turn."""


def quiet_settings() -> Any:
    """Return settings of a solver that writes no file and prints nothing."""
    settings = exu.SimulationSettings()
    settings.timeIntegration.verboseMode = 0
    settings.solution.file.write = False
    settings.solution.file.writeInitialValues = False
    settings.solution.sensors.active = False
    return settings


def integration_settings(step: float, duration: float, tolerance: float = TOLERANCE) -> Any:
    """Return settings of the generalised-alpha time integration with modified Newton iterations.

    Parameters
    ----------
    step, duration : float
        Time step and length of the run [s].
    tolerance : float
        Relative tolerance of Newton's iterations; the absolute one is a hundredth of it [N, N m].
    """
    settings = quiet_settings()
    integration = settings.timeIntegration
    integration.numberOfSteps = max(round(duration / step), 1)
    integration.endTime = integration.numberOfSteps * step
    integration.generalizedAlpha.spectralRadius = 0.8
    newton = integration.newton
    newton.useModifiedNewton = True
    newton.modifiedNewtonContractivity = 0.05
    newton.relativeTolerance, newton.absoluteTolerance = tolerance, 1e-2 * tolerance
    settings.linearSolver.solverType = exu.LinearSolverType.EigenSparse
    settings.linearSolver.reuseAnalyzedPattern = True
    return settings
