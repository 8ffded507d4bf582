"""How vehicle and water agree within a macro step: explicit, semi-implicit, strongly coupled.

Notation: in the macro step from t_n to t_{n+1} of length H the vehicle, under mean wrenches F, reaches velocities y of
its bodies (linear and angular, body axes); the water, with the bodies moving there, answers with mean wrenches G.

Why it matters: water answers a change of velocity at once, G = ... - A (y - y_n) / H with the added mass A. The
explicit scheme predicts y from the last acceleration; from step to step the error of one body of mass m is then
multiplied by the roots of z^2 + 2 r z - r = 0 with r = A/m, and grows for r > 1/3, whatever the step (with a constant
prediction: r > 1). Shorter macro steps do not help (Causin, Gerbeau & Nobile, Comput. Methods Appl. Mech. Eng. 194
(2005) 4506). A hull that floats over a shallow bed has r of about 2 in heave.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import asdict, dataclass, field, replace
from itertools import pairwise
from typing import Any, Literal, Protocol

import numpy as np
import xarray as xr

from exumob.support.arrays import Array
from exumob.support.checks import require_positive, require_within
from exumob.support.errors import SimulationError
from exumob.vehicle.motion import BodyStates
from exumob.water.hydrodynamics import Hydrodynamics

WithinStep = Literal["held", "linear"]
SWINGS = 4
"""Times that the residual of `SemiImplicit` turns round from step to step before the water's response is renewed ..."""
MATTERS = 0.2
"""... if it is then larger than this share of the loads (sound runs stay below 0.18) ..."""
GROWN = 10.0
"""... or has grown by so much meanwhile."""


class Mechanism(Protocol):
    """The moving bodies as a coupling scheme sees them (`exumob.multibody.system.MultibodyVehicle`)."""

    @property
    def time(self) -> float:
        """Time reached [s]."""

    @property
    def history(self) -> BodyStates:
        """States up to and including now."""

    def present(self) -> BodyStates:
        """States now, n = 1."""

    def predict(self, step: float) -> BodyStates:
        """States `step` [s] ahead, extrapolated and projected on the constraints, n = 1."""

    def advance(self, end_time: float, water: Array, rate: Array | None = None) -> None:
        """Go on to `end_time` [s] under mean wrenches that change at `rate` about the middle of the step."""

    def save(self, histories: bool = True) -> Any:
        """State for `restore`."""

    def restore(self, saved: Any) -> None:
        """Return to a saved state."""


class Coupling(Protocol):
    """A scheme that takes vehicle and water over one macro step."""

    def start(self) -> None:
        """Forget any earlier run."""

    def step(self, bodies: Mechanism, water: Hydrodynamics, end_time: float) -> None:
        """Take both from now to `end_time` [s].

        Raises
        ------
        SimulationError
            If either breaks down or they do not agree.
        """

    def save(self, histories: bool = True) -> dict[str, Any]:
        """What the next step depends on and, with `histories`, what `record` gives."""

    def restore(self, saved: dict[str, Any]) -> None:
        """Return to a state given by `save(histories=True)`."""

    def record(self) -> dict[str, xr.DataArray]:
        """What the scheme adds to the result."""


def wrenches(water: Hydrodynamics, history: BodyStates, predict: Callable[[], BodyStates]) -> Array:
    """Ask the water model, and check its answer."""
    loads = np.asarray(water.wrenches(history, predict))
    name, time, expected = type(water).__name__, history.time[-1], (history.position.shape[1], 6)
    if loads.shape != expected:
        raise SimulationError(
            f"{name}.wrenches returned shape {loads.shape} at {time:.4f} s; it must return {expected}."
        )  # fmt: skip
    if not np.isfinite(loads).all():
        raise SimulationError(f"{name} gave a load that is not finite at {time:.4f} s; halve macro_step.")
    return loads


def _size(difference: Array, values: Array) -> float:
    """Of a difference relative to the values; forces [N] and moments [N m] together."""
    return float(np.linalg.norm(difference)) / max(float(np.linalg.norm(values)), 1e-300)


class _Trace:
    """Mean loads of the last steps, and what each step took."""

    def __init__(self, within_step: WithinStep) -> None:
        if within_step not in ("held", "linear"):
            raise ValueError(f"coupling.within_step = {within_step!r} is not known; use 'held' or 'linear'.")
        self.within_step = within_step
        self.clear()

    def clear(self) -> None:
        self.last: Array | None = None
        self.times: list[float] = []
        self.solves: list[float] = []
        self.residuals: list[float] = []

    def rate(self, loads: Array, step: float) -> Array | None:
        """Change of the loads in time for the step whose mean they are: the line through the last two means."""
        if self.within_step == "held" or self.last is None:
            return None
        return (loads - self.last) / step

    def add(self, time: float, loads: Array, solves: int, residual: float) -> None:
        self.last = np.array(loads)
        self.times.append(time)
        self.solves.append(solves)
        self.residuals.append(residual)

    def save(self, histories: bool) -> dict[str, Any]:
        saved: dict[str, Any] = {"last": self.last}
        if histories:
            saved |= {name: np.array(getattr(self, name)) for name in ("times", "solves", "residuals")}
        return saved

    def restore(self, saved: dict[str, Any]) -> None:
        self.last = None if saved["last"] is None else np.array(saved["last"])
        for name in ("times", "solves", "residuals"):
            setattr(self, name, [float(value) for value in saved[name]])

    def record(self) -> dict[str, xr.DataArray]:
        if not self.times:
            return {}
        time = xr.Variable("macro_time", self.times, {"units": "s", "long_name": "start of the macro step"})
        found = {}
        for name, values, text in (
            ("iterations", self.solves, "times that the water was advanced over the macro step"),
            ("residual", self.residuals, "wrenches of the water less those that the vehicle felt, over the former"),
        ):
            attrs = {"units": "1", "long_name": text}
            found[name] = xr.DataArray(np.array(values), {"macro_time": time}, ("macro_time",), attrs=attrs)
        return found


@dataclass(kw_only=True, eq=False)
class _Scheme:
    """Fields and functions that the schemes share."""

    within_step: WithinStep = "linear"
    """Wrenches within a macro step: "held" at their mean, or "linear", on the line through the last two means about it.
    Either keeps the mean, and with it the momentum; places are then wrong by H^2 or H^3 (heave at 3 Hz, 1 ms: 1.2e-4 or
    5e-6 of the amplitude)"""

    def __post_init__(self) -> None:
        self.trace = _Trace(self.within_step)

    @property
    def parameters(self) -> dict[str, Any]:
        """What was chosen, as kept in results."""
        return asdict(self)

    def start(self) -> None:
        """Forget any earlier run."""
        self.trace.clear()

    def save(self, histories: bool = True) -> dict[str, Any]:
        """See `Coupling`."""
        return self.trace.save(histories)

    def restore(self, saved: dict[str, Any]) -> None:
        """See `Coupling`."""
        self.trace.restore(saved)

    def record(self) -> dict[str, xr.DataArray]:
        """Advances of the water and the residual, one sample a macro step."""
        return self.trace.record()


@dataclass(kw_only=True, eq=False)
class Explicit(_Scheme):
    """The paper's scheme (Sec. 2.3): predict, advance the water there, advance the vehicle under its loads.

    One advance of the water a step; unstable where the added mass is more than a third of the mass (see the module).
    For water models whose load does not follow the acceleration at once (`CoefficientHydrodynamics`) it is all that is
    needed; what they give is not a mean over the step to come, and is held.
    """

    within_step: WithinStep = "held"

    def step(self, bodies: Mechanism, water: Hydrodynamics, end_time: float) -> None:
        """See `Coupling`."""
        begin = bodies.time
        step = end_time - begin
        loads = wrenches(water, bodies.history, lambda: bodies.predict(step))
        bodies.advance(end_time, loads, self.trace.rate(loads, step))
        self.trace.add(begin, loads, 1, float("nan"))


@dataclass(kw_only=True, eq=False)
class Strong(_Scheme):
    """Repeat the macro step from saved states of both sides until the wrenches agree, |G - F| <= tolerance |G|.

    The first F of a step is the line through the last two; then either Aitken's relaxation (Kuettler & Wall, Comput.
    Mech. 43 (2008) 61: one factor for all bodies) or the interface quasi-Newton method with an inverse Jacobian from
    least squares (Degroote, Bathe & Vierendeels, Comput. Struct. 87 (2009) 793), which learns one for each direction
    and remembers the differences of the last steps.
    """

    method: Literal["iqn-ils", "aitken"] = "iqn-ils"
    tolerance: float = 1.0e-3
    """Largest |G - F| over |G|; forces in N and moments in N m together [-]"""
    iterations: int = 30
    """Most advances of the water in one step"""
    relaxation: float = 0.3
    """First factor, before anything is learnt [-]"""
    reused: int = 8
    """Steps whose differences the quasi-Newton method remembers"""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.method not in ("iqn-ils", "aitken"):
            raise ValueError(f"Strong.method = {self.method!r} is not known; use 'iqn-ils' or 'aitken'.")
        require_within("Strong", 1e-8, 0.5, tolerance=self.tolerance)
        require_within("Strong", 2, 1000, iterations=self.iterations)
        require_within("Strong", 1e-3, 1.0, relaxation=self.relaxation)
        require_within("Strong", 0, 100, reused=self.reused)
        self.memory = _Memory(self.reused)

    def start(self) -> None:
        """Forget any earlier run."""
        super().start()
        self.memory.clear()

    def save(self, histories: bool = True) -> dict[str, Any]:
        """See `Coupling`."""
        return super().save(histories) | {"memory": self.memory.save()}

    def restore(self, saved: dict[str, Any]) -> None:
        """See `Coupling`."""
        super().restore(saved)
        self.memory.restore(saved["memory"])

    def step(self, bodies: Mechanism, water: Hydrodynamics, end_time: float) -> None:
        """See `Coupling`."""
        begin, trace, memory = bodies.time, self.trace, self.memory
        step = end_time - begin
        history = _kept(bodies.history)
        saved_bodies, saved_water = bodies.save(histories=False), water.save(histories=False)
        solves = 0
        if trace.last is None or memory.before is None:
            loads = wrenches(water, history, lambda: bodies.predict(step))
            water.restore(saved_water)
            solves = 1
        else:
            loads = 2.0 * trace.last - memory.before
        memory.new_step()
        factor = self.relaxation
        residual_before: Array | None = None
        while True:
            bodies.advance(end_time, loads, trace.rate(loads, step))
            reached = bodies.present()
            answer = wrenches(water, history, lambda reached=reached: reached)  # type: ignore[misc]
            solves += 1
            residual = answer - loads
            size = _size(residual, answer)
            if size <= self.tolerance:
                break
            if solves >= self.iterations:
                raise SimulationError(
                    f"vehicle and water did not agree within {self.iterations} iterations at {begin:.4f} s (residual "
                    f"{size:.2g}, tolerance {self.tolerance:g}); halve macro_step, or raise Strong.tolerance or "
                    "Strong.iterations."
                )
            if self.method == "aitken":
                if residual_before is not None:
                    change = residual - residual_before
                    factor *= -float(np.vdot(residual_before, change) / np.vdot(change, change))
                    factor = float(np.clip(factor, 1e-3, 1.0))
                loads = loads + factor * residual
                residual_before = residual
            else:
                loads = loads + memory.correction(residual, answer, self.relaxation)
            bodies.restore(saved_bodies)
            water.restore(saved_water)
        memory.before = trace.last
        trace.add(begin, loads, solves, size)


class _Memory:
    """Differences of residuals and answers of the last steps, for IQN-ILS."""

    def __init__(self, reused: int) -> None:
        self.steps: deque[list[tuple[Array, Array]]] = deque(maxlen=reused + 1)
        self.clear()

    def clear(self) -> None:
        self.steps.clear()
        self.before: Array | None = None
        self._last: tuple[Array, Array] | None = None

    def new_step(self) -> None:
        self._last = None
        if not self.steps or self.steps[0]:
            self.steps.appendleft([])

    def correction(self, residual: Array, answer: Array, relaxation: float) -> Array:
        """Change of the loads that the remembered differences promise to take the residual away."""
        if self._last is not None:
            self.steps[0].insert(0, (residual - self._last[0], answer - self._last[1]))
        self._last = residual.copy(), answer.copy()
        differences = [pair for step in self.steps for pair in step]
        basis: list[Array] = []
        kept: list[tuple[Array, Array]] = []
        for change, difference in differences:  # newest first; those that add no direction of their own are left out
            rest = change.ravel().copy()
            for direction in basis:
                rest -= (direction @ rest) * direction
            if np.linalg.norm(rest) > 1e-2 * np.linalg.norm(change) and len(kept) < residual.size:
                basis.append(rest / np.linalg.norm(rest))
                kept.append((change, difference))
        if not kept:
            return relaxation * residual
        v = np.stack([change.ravel() for change, _ in kept], axis=1)
        w = np.stack([difference.ravel() for _, difference in kept], axis=1)
        share = np.linalg.lstsq(v, -residual.ravel(), rcond=None)[0]
        left = residual.ravel() + v @ share  # of the residual, in directions not known yet
        changed = w @ share + (residual.ravel() - left) + relaxation * left
        return np.asarray(changed.reshape(residual.shape))

    def save(self) -> dict[str, Any]:
        return {"before": self.before, "steps": [[list(pair) for pair in step] for step in self.steps]}

    def restore(self, saved: dict[str, Any]) -> None:
        self.clear()
        self.before = None if saved["before"] is None else np.array(saved["before"])
        self.steps.extend([(np.array(a), np.array(b)) for a, b in step] for step in saved["steps"])


@dataclass(kw_only=True, eq=False)
class SemiImplicit(_Scheme):
    """One advance of the water a step, with its answer to a change of the motion known beforehand.

    The water goes first, to the predicted y*, and answers G*. The vehicle then feels

        F = G* - D (y - y*) + D (y_n - y*_n),   D = -dG/dy,

    with its own y, so that added mass acts on the true acceleration: stable for any ratio of masses. The last term
    takes back the share of G* with which the water, in this step, makes up for the last step's prediction; with
    constant D the water's impulse on the bodies is then that of their true motion. F is found by Newton's method with
    the vehicle alone, whose cost is small beside the flow's.

    D is measured: from a saved state the flow is advanced once for each direction in which the bodies can move (ten for
    a vehicle), at the start, every `renewal`, and at once when G* - F swings from step to step and grows: the sign of a
    D that has become too small, as when a keel gets wet.
    """

    renewal: float = 0.25
    """Interval between measurements of D [s]"""
    disturbance: float = 0.01
    """Change of velocity with which D is measured [m/s]; of angular velocity: over `lever`"""
    lever: float = 0.3
    """By which angular velocities and moments are made comparable to velocities and forces [m]"""

    def __post_init__(self) -> None:
        super().__post_init__()
        require_positive("SemiImplicit", renewal=self.renewal, disturbance=self.disturbance, lever=self.lever)
        self.response = _Response()

    def start(self) -> None:
        """Forget any earlier run."""
        super().start()
        self.response = _Response()

    def save(self, histories: bool = True) -> dict[str, Any]:
        """See `Coupling`."""
        return super().save(histories) | {"response": dict(vars(self.response))}

    def restore(self, saved: dict[str, Any]) -> None:
        """See `Coupling`."""
        super().restore(saved)
        self.response = _Response(**saved["response"])

    def step(self, bodies: Mechanism, water: Hydrodynamics, end_time: float) -> None:
        """See `Coupling`."""
        begin, trace, response = bodies.time, self.trace, self.response
        step, history = end_time - begin, _kept(bodies.history)
        predicted = bodies.predict(step)
        aim = body_velocities(predicted)
        saved = bodies.save(histories=False)
        solves = 1
        if response.damping is None or begin >= response.due - 1e-9:
            solves += self._measure(bodies, water, history, predicted, trace.last, saved, end_time)
            response.due, response.residuals = begin + self.renewal, []
        damping, compliance = response.damping, response.compliance
        assert damping is not None and compliance is not None
        answer = wrenches(water, history, lambda: predicted)
        target = answer.ravel() + damping @ response.missed if response.missed is not None else answer.ravel()

        # Newton: F - target + D (y(F) - y*) = 0
        loads = (target if trace.last is None else trace.last.ravel()).copy()
        newton = np.linalg.inv(np.eye(len(loads)) + damping @ compliance)
        for _ in range(8):
            wrench = loads.reshape(answer.shape)
            bodies.advance(end_time, wrench, trace.rate(wrench, step))
            reached = body_velocities(bodies.present())
            gap = target - damping @ (reached - aim) - loads
            size = _size(gap, loads)
            if size < 1e-6:
                break
            loads = loads + newton @ gap
            bodies.restore(saved)
        else:
            wrench = loads.reshape(answer.shape)
            bodies.advance(end_time, wrench, trace.rate(wrench, step))
            reached = body_velocities(bodies.present())
        response.missed = reached - aim
        if response.swings(answer - wrench, _size(answer - wrench, answer)):
            response.due = begin
        trace.add(begin, wrench, solves, _size(answer - wrench, answer))

    def _measure(
        self, bodies: Mechanism, water: Hydrodynamics, history: BodyStates, predicted: BodyStates, last: Array | None,
        saved_bodies: Any, end_time: float,
    ) -> int:  # fmt: skip
        """Measure dy/dF of the vehicle and -dG/dy of the water; return how often the water was advanced."""
        response, n = self.response, predicted.position.shape[1]
        step = end_time - history.time[-1]
        scale = np.tile(np.r_[np.ones(3), np.full(3, self.lever)], n)  # rad/s -> m/s, and N m -> N
        base = np.zeros((n, 6)) if last is None else last
        forces = 1.0 * scale  # 1 N, and as much moment at the lever

        def reached(loads: Array) -> Array:
            bodies.advance(end_time, loads)
            found = body_velocities(bodies.present())
            bodies.restore(saved_bodies)
            return found

        undisturbed = reached(base)
        compliance = np.empty((6 * n, 6 * n))
        for k in range(6 * n):
            loads = base.ravel().copy()
            loads[k] += forces[k]
            compliance[:, k] = (reached(loads.reshape(n, 6)) - undisturbed) / forces[k]
        response.compliance = compliance

        # directions in which the bodies can move, m/s throughout
        directions, sizes, _ = np.linalg.svd(scale[:, None] * compliance * scale[None, :])
        directions = directions[:, sizes > 1e-3 * sizes[0]]
        saved_water = water.save(histories=False)
        aim = wrenches(water, history, lambda: predicted).ravel()
        water.restore(saved_water)
        columns = []
        for direction in directions.T:
            size = self.disturbance / float(np.abs(direction).max())
            shift = size * direction / scale
            moved = disturbed(predicted, shift, step)
            answer = wrenches(water, history, lambda moved=moved: moved).ravel()  # type: ignore[misc]
            water.restore(saved_water)
            columns.append((aim - answer) / size)
        response.damping = np.stack(columns, axis=1) @ directions.T * scale[None, :]
        return len(columns) + 1


@dataclass
class _Response:
    """What `SemiImplicit` carries from step to step."""

    damping: Array | None = None
    """D = -dG/dy [N s/m and so on]"""
    compliance: Array | None = None
    """dy/dF [m/(N s) and so on]"""
    missed: Array | None = None
    """y - y* of the last step"""
    due: float = 0.0
    """When D is measured again [s]"""
    residuals: list[Array] = field(default_factory=list)
    """G* - F of the last steps, since D was measured"""

    def swings(self, residual: Array, relative: float) -> bool:
        """Take note of a step's G* - F; whether it has swung `SWINGS` times, and grown, so that it matters."""
        self.residuals = [*self.residuals[-SWINGS:], np.array(residual)]
        if len(self.residuals) <= SWINGS or any(np.vdot(a, b) >= 0.0 for a, b in pairwise(self.residuals)):
            return False
        growth = float(np.linalg.norm(residual)) / max(float(np.linalg.norm(self.residuals[0])), 1e-300)
        return growth > (1.0 if relative > MATTERS else GROWN)


def body_velocities(states: BodyStates) -> Array:
    """Linear and angular velocities of the last instant in body axes [m/s, rad/s], shape (6 n,)."""
    back = states.rotation[-1].mT
    linear = np.einsum("bij,bj->bi", back, states.velocity[-1])
    angular = np.einsum("bij,bj->bi", back, states.angular_velocity[-1])
    return np.hstack([linear, angular]).ravel()


def disturbed(states: BodyStates, shift: Array, step: float) -> BodyStates:
    """States (n = 1) whose body velocities differ by `shift`, shape (6 n,), gained evenly over `step` [s]."""
    from scipy.spatial.transform import Rotation

    change = np.einsum("bij,bcj->bci", states.rotation[-1], shift.reshape(-1, 2, 3))
    linear, angular = change[:, 0], change[:, 1]
    turned = Rotation.from_rotvec(0.5 * step * angular).as_matrix() @ states.rotation[-1]
    return replace(
        states, position=states.position + 0.5 * step * linear, rotation=turned[None],
        velocity=states.velocity + linear, angular_velocity=states.angular_velocity + angular,
    )  # fmt: skip


def _kept(history: BodyStates) -> BodyStates:
    """A history that the vehicle does not overwrite as it goes on: its last row may be lent."""
    if len(history) < 2 or abs(history.time[-1] - history.time[-2]) > 0.9e-3:
        return history
    return BodyStates(*(np.array(getattr(history, name)) for name in history.__dataclass_fields__))
