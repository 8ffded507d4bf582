"""The constraints of an assembled Exudyn system: residuals, and projection on their manifold.

Exudyn's time integrator does not give these out; a second solver object in dense mode, on the same system, does.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from exumob.multibody.solver_settings import quiet_settings
from exumob.support.arrays import Array
from exumob.support.exudyn import exu


class Constraints:
    """Constraints of nine rigid bodies with Euler parameters (hull, uprights, wheels).

    Parameters
    ----------
    mbs : exudyn.MainSystem
        Assembled system. Making this object resets its state to the initial configuration.
    coordinates, velocities, multipliers : array
        Live views of the system's state, shapes (63,), (63,) and (constraints,).
    spin_rows : array of int, shape (4,)
        Rows of the wheel-spin constraints, which act on velocity level.
    """

    def __init__(
        self,
        mbs: Any,
        coordinates: Array,
        velocities: Array,
        multipliers: Array,
        spin_rows: NDArray[np.int64],
    ) -> None:
        """Prepare the second solver."""
        self._mbs = mbs
        self._q, self._v, self._multipliers = coordinates, velocities, multipliers
        self._spin_rows = spin_rows
        settings = quiet_settings()
        settings.linearSolver.solverType = exu.LinearSolverType.EXUdense
        self._solver = exu.MainSolverImplicitSecondOrder()
        self._solver.InitializeSolver(mbs, settings)
        n = len(coordinates) + len(multipliers)
        self._zeros = np.zeros((n, n))
        self._velocity_level = np.zeros(len(multipliers), dtype=np.bool_)
        self._velocity_level[spin_rows] = True

    def residual(self, velocity_level: bool) -> Array:
        """Return the residual C or, on velocity level, dC/dt; shape (constraints,)."""
        self._solver.ComputeAlgebraicEquations(self._mbs, velocity_level)
        return np.array(self._solver.GetSystemResidual())[len(self._q) :]

    def _derivative(self, position: float, velocity: float) -> Array:
        """Position * dC/dq + velocity * dC/dv, shape (constraints, 63)."""
        self._solver.SetSystemJacobian(self._zeros)
        self._solver.ComputeJacobianAE(self._mbs, position, velocity, 1.0, False)
        return np.array(self._solver.GetSystemJacobian())[len(self._q) :, : len(self._q)]

    def jacobian(self) -> Array:
        """Return dC/dq of position-level rows and dC/dv of velocity-level rows, shape (constraints, 63)."""
        position, velocity = self._derivative(1.0, 0.0), self._derivative(0.0, 1.0)
        return np.where(self._velocity_level[:, None], velocity, position)

    def errors(self) -> tuple[float, float]:
        """Return the largest residual of the position-level [m or rad] and the velocity-level [rad/s] constraints."""
        residual = np.abs(self.residual(False))
        return float(residual[~self._velocity_level].max()), float(residual[self._velocity_level].max())

    def project(self, tolerance: float = 1e-14) -> None:
        """Move the system's coordinates and velocities to the nearest ones that meet the constraints.

        Newton on the positions, then one projection of the velocities, both in the metric of the mass matrix (paper
        Sec. 2.3).
        """
        self._solver.ComputeMassMatrix(self._mbs, 1.0)
        mass = np.array(self._solver.GetSystemMassMatrix())[: len(self._q), : len(self._q)]
        for _ in range(10):
            residual = np.where(self._velocity_level, 0.0, self.residual(False))
            if np.abs(residual).max() < tolerance:
                break
            jacobian = np.where(self._velocity_level[:, None], 0.0, self._derivative(1.0, 0.0))
            self._q[:] = np.array(self._q) - _smallest_correction(mass, jacobian, residual)
        self._v[:] = np.array(self._v) - _smallest_correction(mass, self.jacobian(), self.residual(True))


def _smallest_correction(mass: Array, jacobian: Array, residual: Array) -> Array:
    """Smallest correction in the metric of `mass` with jacobian @ correction = residual.

    The full saddle-point system is solved: with Euler parameters the mass matrix alone is singular.
    """
    rows = np.abs(jacobian).max(axis=1) > 0.0
    active = jacobian[rows]
    n, m = len(mass), len(active)
    system = np.block([[mass, active.T], [active, np.zeros((m, m))]])
    solution: Array = np.linalg.solve(system, np.concatenate([np.zeros(n), residual[rows]]))
    return solution[:n]
