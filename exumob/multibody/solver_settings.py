"""Settings of the Exudyn solvers."""

from __future__ import annotations

from typing import Any

from exumob.support.exudyn import exu

SPECTRAL_RADIUS = 0.8
"""Of the generalised-alpha method at infinity [-]."""

CONTRACTIVITY = 0.2
"""Factor by which an iteration must shrink the residual; where it does not, the Jacobian is computed anew."""

TOLERANCE = 2e-9
"""Tolerance of Newton's iterations: length of the vector of residuals over the vehicle's weight. How far runs end from
one that is solved further, and what that costs, is measured by `benchmarks/newton_tolerance.py`."""

LOOSER = (1e-8, 1e-7, 1e-6, 1e-5)
"""Tolerances for a macro step in which rounding keeps Newton's iterations from `TOLERANCE`, in turn."""


def quiet_settings() -> Any:
    """Return settings of a solver that writes no file and prints nothing."""
    settings = exu.SimulationSettings()
    settings.timeIntegration.verboseMode = 0
    settings.solution.file.write = False
    settings.solution.file.writeInitialValues = False
    settings.solution.sensors.active = False
    return settings


def integration_settings(step: float, duration: float, absolute_tolerance: float) -> Any:
    """Return settings of the generalised-alpha time integration with modified Newton iterations.

    Parameters
    ----------
    step, duration : float
        Time step and length of the run [s].
    absolute_tolerance : float
        Of Newton's iterations: root mean square of the residuals [N, N m]. A tolerance relative to the first residual
        would mean little: the better the first guess, the smaller that is.
    """
    settings = quiet_settings()
    integration = settings.timeIntegration
    integration.numberOfSteps = max(round(duration / step), 1)
    integration.endTime = integration.numberOfSteps * step
    integration.generalizedAlpha.spectralRadius = SPECTRAL_RADIUS
    newton = integration.newton
    newton.useModifiedNewton = True
    newton.modifiedNewtonContractivity = CONTRACTIVITY
    newton.relativeTolerance, newton.absoluteTolerance = 1e-14, absolute_tolerance
    settings.linearSolver.solverType = exu.LinearSolverType.EigenSparse
    settings.linearSolver.reuseAnalyzedPattern = True
    return settings
