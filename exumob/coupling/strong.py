"""The strong coupling scheme: a macro step is repeated until the vehicle and the water agree."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np

from exumob.coupling.scheme import Mechanism, Scheme, checked_wrenches, lasting_history, relative_difference
from exumob.support.arrays import Array
from exumob.support.errors import SimulationError
from exumob.support.quantities import Quantity
from exumob.water.hydrodynamics import Hydrodynamics


@dataclass(kw_only=True, eq=False)
class Strong(Scheme):
    """Repeat the macro step from saved states of both sides until the wrenches agree, |G - F| <= tolerance |G|.

    The first F of a step is extrapolated from the last two steps. Each further F is found either by Aitken's relaxation
    (Kuettler & Wall, Comput. Mech. 43 (2008) 61), one factor for all bodies, or by the interface quasi-Newton method
    with an inverse Jacobian from least squares (IQN-ILS: Degroote, Bathe & Vierendeels, Comput. Struct. 87 (2009) 793),
    which adapts to each direction and remembers the differences of the last steps.
    """

    method: Literal["iqn-ils", "aitken"] = "iqn-ils"
    tolerance: Annotated[float, Quantity("1", at_least=1e-8, at_most=0.5)] = 1.0e-3
    """Largest |G - F| over |G|; forces in N and moments in N m together [-]"""
    iterations: Annotated[int, Quantity("1", at_least=2, at_most=1000)] = 30
    """Most advances of the water in one step"""
    relaxation: Annotated[float, Quantity("1", at_least=1e-3, at_most=1.0)] = 0.3
    """Relaxation factor of the first iteration, before anything is learnt [-]"""
    reused: Annotated[int, Quantity("1", at_least=0, at_most=100)] = 8
    """Steps whose differences the quasi-Newton method remembers"""

    def __post_init__(self) -> None:
        super().__post_init__()
        self.memory = DifferenceMemory(self.reused)

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

    def step(self, bodies: Mechanism, hydrodynamics: Hydrodynamics, end_time: float) -> None:
        """See `Coupling`."""
        begin, trace, memory = bodies.time, self.trace, self.memory
        step = end_time - begin
        history = lasting_history(bodies.history)
        saved_bodies, saved_water = bodies.save(histories=False), hydrodynamics.save(histories=False)
        advances = 0
        if trace.last_wrenches is None or memory.wrenches_before_last is None:
            applied = checked_wrenches(hydrodynamics, history, lambda: bodies.predict(step))
            hydrodynamics.restore(saved_water)
            advances = 1
        else:
            applied = 2.0 * trace.last_wrenches - memory.wrenches_before_last
        memory.begin_step()
        aitken = AitkenRelaxation(self.relaxation)
        while True:
            bodies.advance(end_time, applied, trace.rate(applied, step))
            reached = bodies.present()
            answer = checked_wrenches(hydrodynamics, history, lambda reached=reached: reached)  # type: ignore[misc]
            advances += 1
            residual = answer - applied
            error = relative_difference(residual, answer)
            if error <= self.tolerance:
                break
            if advances >= self.iterations:
                raise SimulationError(
                    f"vehicle and water did not agree within {self.iterations} iterations at {begin:.4f} s (residual "
                    f"{error:.2g}, tolerance {self.tolerance:g}); halve macro_step, or raise Strong.tolerance or "
                    "Strong.iterations."
                )
            if self.method == "aitken":
                applied = applied + aitken.correction(residual)
            else:
                applied = applied + memory.correction(residual, answer, self.relaxation)
            bodies.restore(saved_bodies)
            hydrodynamics.restore(saved_water)
        memory.wrenches_before_last = trace.last_wrenches
        trace.add(begin, step, applied, advances, error)


class AitkenRelaxation:
    """Aitken's relaxation within one macro step (Kuettler & Wall 2008).

    Parameters
    ----------
    factor : float
        Relaxation factor of the first iteration [-].
    """

    def __init__(self, factor: float) -> None:
        self.factor = factor
        self._last_residual: Array | None = None

    def correction(self, residual: Array) -> Array:
        """Return the change of the wrenches for a residual G - F, and adapt the factor to its change."""
        if self._last_residual is not None:
            change = residual - self._last_residual
            self.factor *= -float(np.vdot(self._last_residual, change) / np.vdot(change, change))
            self.factor = float(np.clip(self.factor, 1e-3, 1.0))
        self._last_residual = residual
        return self.factor * residual


class DifferenceMemory:
    """Differences of residuals and answers of this macro step and the last ones, for IQN-ILS.

    Parameters
    ----------
    reused : int
        Earlier steps that are remembered.
    """

    def __init__(self, reused: int) -> None:
        self.steps: deque[list[tuple[Array, Array]]] = deque(maxlen=reused + 1)
        self.clear()

    def clear(self) -> None:
        """Forget all steps."""
        self.steps.clear()
        self.wrenches_before_last: Array | None = None
        self._last: tuple[Array, Array] | None = None

    def begin_step(self) -> None:
        """Open a new step; one without differences is not kept."""
        self._last = None
        if not self.steps or self.steps[0]:
            self.steps.appendleft([])

    def correction(self, residual: Array, answer: Array, relaxation: float) -> Array:
        """Return the change of the wrenches which, by the remembered differences, takes the residual away.

        Parameters
        ----------
        residual, answer : array, shape (bodies, 6)
            G - F and G of this iteration [N, N m].
        relaxation : float
            Factor on the part of the residual in directions of which nothing is known yet [-].
        """
        if self._last is not None:
            self.steps[0].insert(0, (residual - self._last[0], answer - self._last[1]))
        self._last = residual.copy(), answer.copy()
        differences = [pair for step in self.steps for pair in step]
        basis: list[Array] = []
        independent: list[tuple[Array, Array]] = []
        for change, difference in differences:  # newest first; those that add no direction of their own are left out
            rest = change.ravel().copy()
            for direction in basis:
                rest -= (direction @ rest) * direction
            if np.linalg.norm(rest) > 1e-2 * np.linalg.norm(change) and len(independent) < residual.size:
                basis.append(rest / np.linalg.norm(rest))
                independent.append((change, difference))
        if not independent:
            return relaxation * residual
        v = np.stack([change.ravel() for change, _ in independent], axis=1)
        w = np.stack([difference.ravel() for _, difference in independent], axis=1)
        share = np.linalg.lstsq(v, -residual.ravel(), rcond=None)[0]
        unexplained = residual.ravel() + v @ share  # part of the residual in directions not known yet
        changed = w @ share + (residual.ravel() - unexplained) + relaxation * unexplained
        return np.asarray(changed.reshape(residual.shape))

    def save(self) -> dict[str, Any]:
        """Return the remembered differences."""
        steps = [[list(pair) for pair in step] for step in self.steps]
        return {"wrenches_before_last": self.wrenches_before_last, "steps": steps}

    def restore(self, saved: dict[str, Any]) -> None:
        """Return to a state given by `save`."""
        self.clear()
        before = saved["wrenches_before_last"]
        self.wrenches_before_last = None if before is None else np.array(before)
        self.steps.extend([(np.array(a), np.array(b)) for a, b in step] for step in saved["steps"])
