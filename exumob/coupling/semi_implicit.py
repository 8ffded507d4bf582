"""The semi-implicit coupling scheme: one advance of the water a step, with its measured response to the motion."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Annotated, Any

import numpy as np

from exumob.coupling.scheme import Mechanism, Scheme, checked_wrenches, lasting_history, relative_difference
from exumob.support.arrays import Array
from exumob.support.quantities import Quantity
from exumob.vehicle.motion import BodyStates
from exumob.water.hydrodynamics import Hydrodynamics

SIGN_REVERSALS = 4
"""Successive sign reversals of the residual G* - F after which the water's response is measured again, provided that
the residual has also grown and is larger than `LARGE_RESIDUAL`, or has grown by `LARGE_GROWTH`."""
LARGE_RESIDUAL = 0.2
"""Residual over the wrenches from which any growth counts [-]; sound runs stay below 0.18."""
LARGE_GROWTH = 10.0
"""Growth of the residual over `SIGN_REVERSALS` steps that counts however small the residual is [-]."""
SAME_STEP = 1e-6
"""Rounding of a macro step, over it [-]."""
NEWTON_ITERATIONS = 8
"""Most iterations for F, each an advance of the vehicle alone."""
NEWTON_TOLERANCE = 1.0e-6
"""Residual of the iteration for F, over F, at which it ends [-]."""


@dataclass(kw_only=True, eq=False)
class SemiImplicit(Scheme):
    """One advance of the water a step, with its answer to a change of the motion known beforehand.

    The water goes first, to the predicted y*, and answers G*. The vehicle then feels

        F = G* - D (y - y*) + D (y_n - y*_n),   D = -dG/dy,

    with its own y, so that added mass acts on the true acceleration: stable for any ratio of masses. The last term
    takes back the share of G* with which the water, in this step, makes up for the last step's prediction; with
    constant D the water's impulse on the bodies is then that of their true motion. F is found by Newton's method with
    the vehicle alone, whose cost is small beside the flow's.

    D is measured: from a saved state the flow is advanced once for each direction in which the bodies can move (ten for
    a vehicle). That is done at the start, every `renewal`, and at once when G* - F reverses its sign from step to step
    and grows: this shows that D has become too small, as when a keel gets wet. Where the macro step changes, D changes
    in inverse proportion, as added mass over the step does.
    """

    renewal: Annotated[float, Quantity("s", at_least=1e-4, at_most=1e6)] = 0.25
    """Interval between measurements of D [s]"""
    disturbance: Annotated[float, Quantity("m/s", at_least=1e-8, at_most=10.0)] = 0.01
    """Change of velocity with which D is measured [m/s]; of angular velocity: over `lever`"""
    lever: Annotated[float, Quantity("m", at_least=1e-4, at_most=1e3)] = 0.3
    """Length that makes angular velocities and moments comparable to velocities and forces [m]"""

    def __post_init__(self) -> None:
        super().__post_init__()
        self.response = WaterResponse()

    def start(self) -> None:
        """Forget any earlier run."""
        super().start()
        self.response = WaterResponse()

    def save(self, histories: bool = True) -> dict[str, Any]:
        """See `Coupling`."""
        return super().save(histories) | {"response": dict(vars(self.response))}

    def restore(self, saved: dict[str, Any]) -> None:
        """See `Coupling`."""
        super().restore(saved)
        self.response = WaterResponse(**saved["response"])

    def step(self, bodies: Mechanism, hydrodynamics: Hydrodynamics, end_time: float) -> None:
        """See `Coupling`."""
        begin, trace, response = bodies.time, self.trace, self.response
        step, history = end_time - begin, lasting_history(bodies.history)
        predicted = bodies.predict(step)
        advances = 1
        if response.damping is None or begin >= response.due - 1e-9:
            response.compliance = self._measured_compliance(bodies, predicted, end_time)
            response.damping, trials = self._measured_damping(hydrodynamics, history, predicted, end_time)
            response.due, response.residuals, response.step = begin + self.renewal, [], step
            advances += trials
        response.fit(step)
        assert response.damping is not None and response.compliance is not None
        answer = checked_wrenches(hydrodynamics, history, lambda: predicted)
        target = answer.ravel()
        if response.missed is not None:
            target = target + response.damping @ response.missed
        applied, response.missed = self._solve(bodies, predicted, target, end_time)
        residual = answer - applied
        error = relative_difference(residual, answer)
        if response.has_become_too_small(residual, error):
            response.due = begin
        trace.add(begin, step, applied, advances, error)

    def _solve(
        self, bodies: Mechanism, predicted: BodyStates, target: Array, end_time: float
    ) -> tuple[Array, Array]:  # fmt: skip
        """Find F with F - target + D (y(F) - y*) = 0 by Newton's method, and leave the bodies there.

        Returns
        -------
        array, shape (bodies, 6)
            F [N, N m].
        array, shape (6 bodies,)
            y - y* [m/s, rad/s].
        """
        trace, damping, compliance = self.trace, self.response.damping, self.response.compliance
        assert damping is not None and compliance is not None
        saved, step, shape = bodies.save(histories=False), end_time - bodies.time, (-1, 6)
        wanted = body_velocities(predicted)
        inverse = np.linalg.inv(np.eye(len(target)) + damping @ compliance)

        def missed(wrenches: Array) -> Array:
            bodies.advance(end_time, wrenches, trace.rate(wrenches, step))
            return body_velocities(bodies.present()) - wanted

        values = (target if trace.last_wrenches is None else trace.last_wrenches.ravel()).copy()
        for _ in range(NEWTON_ITERATIONS):
            applied = values.reshape(shape)
            difference = missed(applied)
            gap = target - damping @ difference - values
            if relative_difference(gap, values) < NEWTON_TOLERANCE:
                return applied, difference
            values = values + inverse @ gap
            bodies.restore(saved)
        applied = values.reshape(shape)
        return applied, missed(applied)

    def _measured_compliance(self, bodies: Mechanism, predicted: BodyStates, end_time: float) -> Array:
        """Measure dy/dF of the vehicle, shape (6 bodies, 6 bodies): one advance for each force and moment."""
        n = predicted.position.shape[1]
        saved = bodies.save(histories=False)
        base = np.zeros((n, 6)) if self.trace.last_wrenches is None else self.trace.last_wrenches
        forces = 1.0 * self._scale(n)  # 1 N, and as much moment at the lever

        def reached(wrenches: Array) -> Array:
            bodies.advance(end_time, wrenches)
            velocities = body_velocities(bodies.present())
            bodies.restore(saved)
            return velocities

        undisturbed = reached(base)
        compliance = np.empty((6 * n, 6 * n))
        for k in range(6 * n):
            wrenches = base.ravel().copy()
            wrenches[k] += forces[k]
            compliance[:, k] = (reached(wrenches.reshape(n, 6)) - undisturbed) / forces[k]
        return compliance

    def _measured_damping(
        self, hydrodynamics: Hydrodynamics, history: BodyStates, predicted: BodyStates, end_time: float
    ) -> tuple[Array, int]:  # fmt: skip
        """Measure D = -dG/dy of the water, in the directions in which the bodies can move.

        Returns
        -------
        array, shape (6 bodies, 6 bodies)
            D.
        int
            Advances of the water that it took.
        """
        compliance, scale = self.response.compliance, self._scale(predicted.position.shape[1])
        assert compliance is not None
        step = float(end_time - history.time[-1])
        directions, sizes, _ = np.linalg.svd(scale[:, None] * compliance * scale[None, :])
        directions = directions[:, sizes > 1e-3 * sizes[0]]  # m/s throughout
        saved = hydrodynamics.save(histories=False)

        def answer(states: BodyStates) -> Array:
            wrenches = checked_wrenches(hydrodynamics, history, lambda: states).ravel()
            hydrodynamics.restore(saved)
            return wrenches

        undisturbed = answer(predicted)
        columns = []
        for direction in directions.T:
            size = self.disturbance / float(np.abs(direction).max())
            moved = disturbed(predicted, size * direction / scale, step)
            columns.append((undisturbed - answer(moved)) / size)
        return np.stack(columns, axis=1) @ directions.T * scale[None, :], len(columns) + 1

    def _scale(self, bodies: int) -> Array:
        """Factors that turn rad/s into m/s and N m into N (the inverse), shape (6 bodies,)."""
        return np.tile(np.r_[np.ones(3), np.full(3, self.lever)], bodies)


@dataclass
class WaterResponse:
    """The measured response of vehicle and water that `SemiImplicit` carries from step to step."""

    damping: Array | None = None
    """D = -dG/dy [N s/m and so on], shape (6 bodies, 6 bodies)"""
    compliance: Array | None = None
    """dy/dF [m/(N s) and so on], shape (6 bodies, 6 bodies)"""
    missed: Array | None = None
    """y - y* of the last step [m/s, rad/s], shape (6 bodies,)"""
    step: float = 0.0
    """Macro step to which both belong [s]"""
    due: float = 0.0
    """Time at which D is measured again [s]"""
    residuals: list[Array] = field(default_factory=list)
    """G* - F of the last steps since D was measured [N, N m]"""

    def fit(self, step: float) -> None:
        """Bring D and dy/dF to another macro step [s]: D = A / step with the added mass A, and dy/dF grows with it."""
        assert self.damping is not None and self.compliance is not None
        if abs(step - self.step) > SAME_STEP * step:
            self.damping = self.damping * (self.step / step)
            self.compliance = self.compliance * (step / self.step)
            self.step = step

    def has_become_too_small(self, residual: Array, relative: float) -> bool:
        """Note the residual G* - F of a step; tell whether the last ones show that D is too small.

        That is so when the residual has reversed its sign `SIGN_REVERSALS` times in a row and has grown, so that it
        matters.

        Parameters
        ----------
        residual : array, shape (bodies, 6)
            G* - F [N, N m].
        relative : float
            Its norm over that of G* [-].
        """
        self.residuals = [*self.residuals[-SIGN_REVERSALS:], np.array(residual)]
        if len(self.residuals) <= SIGN_REVERSALS or any(np.vdot(a, b) >= 0.0 for a, b in pairwise(self.residuals)):
            return False
        growth = float(np.linalg.norm(residual)) / max(float(np.linalg.norm(self.residuals[0])), 1e-300)
        return growth > (1.0 if relative > LARGE_RESIDUAL else LARGE_GROWTH)


def body_velocities(states: BodyStates) -> Array:
    """Linear and angular velocities of the last instant in body axes [m/s, rad/s], shape (6 n,)."""
    to_body = states.rotation[-1].mT
    linear = np.einsum("bij,bj->bi", to_body, states.velocity[-1])
    angular = np.einsum("bij,bj->bi", to_body, states.angular_velocity[-1])
    return np.hstack([linear, angular]).ravel()


def disturbed(states: BodyStates, change: Array, step: float) -> BodyStates:
    """Return states whose body velocities differ by a change that was gained evenly over a step.

    Parameters
    ----------
    states : BodyStates
        n = 1.
    change : array, shape (6 bodies,)
        Change of linear and angular velocities, body axes [m/s, rad/s].
    step : float
        [s]; positions and rotations change by half of it times the change.
    """
    from scipy.spatial.transform import Rotation

    in_world = np.einsum("bij,bcj->bci", states.rotation[-1], change.reshape(-1, 2, 3))
    linear, angular = in_world[:, 0], in_world[:, 1]
    turned = Rotation.from_rotvec(0.5 * step * angular).as_matrix() @ states.rotation[-1]
    return replace(
        states, position=states.position + 0.5 * step * linear, rotation=turned[None],
        velocity=states.velocity + linear, angular_velocity=states.angular_velocity + angular,
    )  # fmt: skip
