"""The part that all coupling schemes share: the two interfaces, the check of the wrenches, the record of each step.

A coupling scheme takes the vehicle and the water together over one macro step, from t_n to t_{n+1} = t_n + H. The
schemes are `exumob.coupling.explicit.Explicit`, `exumob.coupling.semi_implicit.SemiImplicit` and
`exumob.coupling.strong.Strong`. Their common notation:

- y: velocities of all bodies at the end of the step (linear and angular, body axes), which the vehicle reaches under
  the mean wrenches F;
- G: mean wrenches with which the water answers when the bodies move to these velocities.

The step is solved exactly where F = G. Why it matters how nearly: water answers a change of velocity at once,
G = ... - A (y - y_n) / H with the added mass A. The explicit scheme predicts y from the last acceleration; from step to
step the error of one body of mass m is then multiplied by the roots of z^2 + 2 r z - r = 0 with r = A/m, and it grows
for r > 1/3, whatever the step (with a constant prediction: r > 1). Shorter macro steps do not help (Causin, Gerbeau &
Nobile, Comput. Methods Appl. Mech. Eng. 194 (2005) 4506). A hull that floats over a shallow bed has r of about 2 in
heave.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass, fields
from typing import Any, Literal, Protocol

import numpy as np
import xarray as xr

from exumob.support.arrays import Array, checked_array
from exumob.support.declared import Declared
from exumob.support.errors import SimulationError
from exumob.vehicle.motion import BodyStates
from exumob.water.hydrodynamics import Hydrodynamics

WithinStep = Literal["held", "linear"]
PROVISIONAL_ROW = 0.9e-3
"""Interval of the last two rows of a history [s] below which the last one lies between two samples; samples are 1 ms
apart."""


class Mechanism(Protocol):
    """The moving bodies as a coupling scheme sees them (`exumob.multibody.system.MultibodyVehicle`)."""

    @property
    def time(self) -> float:
        """Time reached [s]."""

    @property
    def history(self) -> BodyStates:
        """States of the bodies up to and including now."""

    def present(self) -> BodyStates:
        """Return the states now, n = 1."""

    def predict(self, step: float) -> BodyStates:
        """Return the states `step` [s] ahead, extrapolated and projected on the constraints, n = 1."""

    def advance(self, end_time: float, wrenches: Array, rate: Array | None = None) -> None:
        """Go on to `end_time` [s] under mean wrenches of the water.

        Parameters
        ----------
        end_time : float
            [s]
        wrenches : array, shape (bodies, 6)
            Means over the interval: force [N] and moment about each body's origin [N m], body axes.
        rate : array, shape (bodies, 6), optional
            Their change in time [N/s, N m/s] about the middle of the interval; None: they are held.
        """

    def save(self, histories: bool = True) -> Any:
        """Return the state for `restore`; without `histories` a light one, for this object only."""

    def restore(self, saved: Any) -> None:
        """Return to a state given by `save`."""


class Coupling(Protocol):
    """A scheme that takes the vehicle and the water over one macro step."""

    def start(self) -> None:
        """Forget any earlier run."""

    def step(self, bodies: Mechanism, hydrodynamics: Hydrodynamics, end_time: float) -> None:
        """Take the bodies and the water from now to `end_time` [s].

        Raises
        ------
        SimulationError
            If either breaks down or they do not agree.
        """

    def save(self, histories: bool = True) -> dict[str, Any]:
        """Return all that the next step depends on and, with `histories`, all that `record` gives."""

    def restore(self, saved: dict[str, Any]) -> None:
        """Return to a state given by `save(histories=True)`."""

    def record(self) -> dict[str, xr.DataArray]:
        """Return the variables that the scheme adds to the result."""


def checked_wrenches(
    hydrodynamics: Hydrodynamics, history: BodyStates, predict: Callable[[], BodyStates]
) -> Array:  # fmt: skip
    """Ask a hydrodynamics model for its wrenches, and check the answer.

    Parameters
    ----------
    hydrodynamics : Hydrodynamics
    history, predict
        As for `Hydrodynamics.wrenches`.

    Returns
    -------
    array, shape (bodies, 6)
        Force [N] and moment about each body's origin [N m], body axes.

    Raises
    ------
    SimulationError
        If the answer has another shape, is not finite, or is no array of numbers.
    """
    wrenches = hydrodynamics.wrenches(history, predict)
    name, time, expected = type(hydrodynamics).__name__, history.time[-1], (history.position.shape[1], 6)
    if type(wrenches) is not np.ndarray or wrenches.dtype != np.float64:  # most are: masks, units, lists ...
        try:
            wrenches = checked_array(f"{name}.wrenches", wrenches, ("bodies", 6), finite=False).copy()
        except ValueError as error:
            raise SimulationError(f"{error} (at {time:.4f} s)") from None
    if wrenches.shape != expected:
        raise SimulationError(
            f"{name}.wrenches returned shape {wrenches.shape} at {time:.4f} s; it must return {expected}."
        )  # fmt: skip
    if not np.isfinite(wrenches).all():
        raise SimulationError(f"{name} gave a load that is not finite at {time:.4f} s; halve macro_step.")
    return wrenches


def relative_difference(difference: Array, values: Array) -> float:
    """Return the norm of a difference over that of the values [-]; forces [N] and moments [N m] together."""
    return float(np.linalg.norm(difference)) / max(float(np.linalg.norm(values)), 1e-300)


def lasting_history(history: BodyStates) -> BodyStates:
    """Return a history that stays as it is while the bodies go on.

    A vehicle's history is a view of its records. Its last row lies between two samples where the macro step is not a
    multiple of 1 ms, and is then overwritten by the next sample: such a history is copied.
    """
    if len(history) < 2 or abs(history.time[-1] - history.time[-2]) > PROVISIONAL_ROW:
        return history
    return BodyStates(*(np.array(getattr(history, field.name)) for field in fields(BodyStates)))


class Trace:
    """Mean wrenches of the last macro step, and for each step the advances of the water and the residual.

    Parameters
    ----------
    within_step : {"held", "linear"}
        See `Scheme.within_step`.

    Raises
    ------
    ValueError
        If `within_step` is neither.
    """

    def __init__(self, within_step: WithinStep) -> None:
        if within_step not in ("held", "linear"):
            raise ValueError(f"coupling.within_step = {within_step!r} is not known; use 'held' or 'linear'.")
        self.within_step = within_step
        self.clear()

    def clear(self) -> None:
        """Forget all steps."""
        self.last_wrenches: Array | None = None
        self.last_step = 0.0
        self.times: list[float] = []
        self.advances: list[float] = []
        self.residuals: list[float] = []

    def rate(self, wrenches: Array, step: float) -> Array | None:
        """Return the wrenches' change in time over a step of which they are the mean [N/s, N m/s]; None: held.

        It is the slope of the line through the last mean and this one, each at the middle of its step.
        """
        if self.within_step == "held" or self.last_wrenches is None:
            return None
        return (wrenches - self.last_wrenches) / (0.5 * (self.last_step + step))

    def add(self, time: float, step: float, wrenches: Array, advances: int, residual: float) -> None:
        """Note a finished step.

        Parameters
        ----------
        time, step : float
            Its begin and its length [s].
        wrenches : array, shape (bodies, 6)
            Their means over it [N, N m].
        advances : int
            How often the water was advanced over it.
        residual : float
            [-]
        """
        self.last_wrenches, self.last_step = np.array(wrenches), step
        self.times.append(time)
        self.advances.append(advances)
        self.residuals.append(residual)

    def save(self, histories: bool) -> dict[str, Any]:
        """See `Coupling.save`."""
        saved: dict[str, Any] = {"last_wrenches": self.last_wrenches, "last_step": self.last_step}
        if histories:
            saved |= {name: np.array(getattr(self, name)) for name in ("times", "advances", "residuals")}
        return saved

    def restore(self, saved: dict[str, Any]) -> None:
        """See `Coupling.restore`."""
        self.last_wrenches = None if saved["last_wrenches"] is None else np.array(saved["last_wrenches"])
        self.last_step = float(saved["last_step"])
        for name in ("times", "advances", "residuals"):
            setattr(self, name, [float(value) for value in saved[name]])

    def record(self) -> dict[str, xr.DataArray]:
        """Return `iterations` and `residual` over the macro steps; empty before the first."""
        if not self.times:
            return {}
        time = xr.Variable("macro_time", self.times, {"units": "s", "long_name": "start of the macro step"})
        found = {}
        for name, values, text in (
            ("iterations", self.advances, "times that the water was advanced over the macro step"),
            ("residual", self.residuals, "wrenches of the water less those that the vehicle felt, over the former"),
        ):
            attrs = {"units": "1", "long_name": text}
            if name == "residual":
                attrs["comment"] = "nan: the explicit scheme does not ask for it"
            found[name] = xr.DataArray(np.array(values), {"macro_time": time}, ("macro_time",), attrs=attrs)
        return found


@dataclass(kw_only=True, eq=False)
class Scheme(Declared):
    """Fields and functions that the schemes share."""

    within_step: WithinStep = "linear"
    """Wrenches within a macro step: "held" at their mean, or "linear", on the line through the last two means about it.
    Either keeps the mean, and with it the momentum; positions are then wrong by H^2 or H^3 (heave at 3 Hz, 1 ms: 1.2e-4
    or 5e-6 of the amplitude)"""

    def __post_init__(self) -> None:
        super().__post_init__()
        self.trace = Trace(self.within_step)

    @property
    def parameters(self) -> dict[str, Any]:
        """The chosen settings, as kept in results."""
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
        """Return the advances of the water and the residual, one sample a macro step."""
        return self.trace.record()
