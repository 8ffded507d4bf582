"""Settings of the Exudyn solvers."""

from __future__ import annotations

from typing import Any

from exumob.support.exudyn import exu


def quiet_settings() -> Any:
    """Return settings of a solver that writes no file and prints nothing."""
    settings = exu.SimulationSettings()
    settings.timeIntegration.verboseMode = 0
    settings.solution.file.write = False
    settings.solution.file.writeInitialValues = False
    settings.solution.sensors.active = False
    return settings


def integration_settings(step: float, duration: float, tolerance: float = 1e-5) -> Any:
    """Return settings of the generalised-alpha time integration with modified Newton iterations.

    Parameters
    ----------
    step, duration : float
        Time step and length of the run [s].
    tolerance : float
        Relative tolerance of Newton's iterations; the absolute one is a hundredth of it.
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
