"""The interface of all hydrodynamics models: from the motion of five bodies to the wrenches of the water on them.

A vehicle consists of five bodies, the hull and four wheels (`exumob.vehicle.motion.BODIES`). Once in each macro step
the simulation asks a hydrodynamics model which wrench (force and moment) the water exerts on each of them. Published
coefficients, trained networks, a flow solver in the loop and `NoWater` all answer this one question, so that a run with
any of them is the same program. A model of your own needs the five functions of `Hydrodynamics` and no base class; a
flow code of your own needs those of `exumob.coupling.flow_code` instead.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol, runtime_checkable

import numpy as np
import xarray as xr

from exumob.ground.terrain import Terrain
from exumob.support.arrays import Array
from exumob.vehicle.motion import BodyStates
from exumob.vehicle.parameters import Vehicle
from exumob.water.conditions import Water


class Hydrodynamics(Protocol):
    """A model of the water's wrenches on the five bodies.

    The simulation calls the five functions in this order:

    1. `start`, then `wrenches` while the vehicle settles into its place of rest;
    2. `start` again at the release, time 0;
    3. `wrenches` once in each macro step (a strongly coupled scheme repeats it, with `save` and `restore` around);
    4. `save` whenever a checkpoint is written, `restore` when a run is resumed from one;
    5. `record` at the end.

    An attribute ``parameters`` (a dict) is optional: it is kept in the result and compared when a run is resumed. So is
    a function ``set_bed`` (`BedHydrodynamics`), without which a model is given water of one depth over level ground at
    z = 0 only.

    Examples
    --------
    A drag on the hull in proportion to its velocity through the water. It has no memory and records nothing:

    >>> class LinearDrag:
    ...     def start(self, vehicle, water, macro_step):
    ...         self.current = np.zeros(3) if water is None else water.velocity
    ...     def wrenches(self, history, predict):
    ...         wrenches = np.zeros((5, 6))
    ...         relative_velocity = history.velocity[-1, 0] - self.current  # of the hull, now, world axes
    ...         wrenches[0, :3] = -20.0 * history.rotation[-1, 0].T @ relative_velocity  # 20 N s/m, body axes
    ...         return wrenches
    ...     def save(self, histories=True): return {}
    ...     def restore(self, saved): pass
    ...     def record(self): return {}
    """

    def start(self, vehicle: Vehicle, water: Water | None, macro_step: float) -> None:
        """Prepare for a run and forget any earlier one.

        The function is called before the vehicle settles and again at the release; input that the model cannot work
        with is refused here.

        Parameters
        ----------
        vehicle : Vehicle
            Its sizes and masses.
        water : Water or None
            Depth or level, current and density; None: there is no water.
        macro_step : float
            Interval between two calls of `wrenches` [s].

        Raises
        ------
        ValueError
            If the model does not fit the vehicle, the water or the macro step; the text names the remedy.
        """

    def wrenches(self, history: BodyStates, predict: Callable[[], BodyStates]) -> Array:
        """Return the wrenches for the macro step that begins now; called once a macro step.

        Parameters
        ----------
        history : BodyStates
            States of the five bodies every 1 ms from the release up to and including now, which is the last row
            (``history.velocity[-1, 0]`` is the hull's velocity now). While the vehicle settles it has one row. Its
            arrays are views: copy what must be kept.
        predict : callable
            Returns the states at the end of the macro step (n = 1): extrapolated and projected on the constraints, or,
            when the step is repeated from a saved state, as the vehicle reached it. They are computed when it is
            called: models that do not need them do not pay for them.

        Returns
        -------
        array, shape (5, 6)
            For each body, in the order of `BODIES`: force [N] and moment about the body's origin [N m], both in the
            body's own axes (x forward, y left, z up). They act on the vehicle over the whole macro step.
        """

    def save(self, histories: bool = True) -> Any:
        """Return all that later answers of the model depend on, for `restore`.

        Parameters
        ----------
        histories : bool
            True, for checkpoints: include what `record` needs; the state must then fit any equal model that has been
            started, in another process too. False, for a macro step that is repeated: the state may be light and needs
            to fit this object only.

        Returns
        -------
        dict, list, array, number or text
            Nested as needed and of these kinds only, so that it can be written to a file. A model without memory
            returns an empty dict.
        """

    def restore(self, saved: Any) -> None:
        """Return to a state given by `save`: the next answers are the same, bit for bit.

        Whatever was recorded after that state is dropped.
        """

    def record(self) -> dict[str, xr.DataArray]:
        """Return the variables that the model adds to the result, by name.

        Called at the end of a run. The result holds each variable under ``hydrodynamics_<name>``; samples once a macro
        step use the dimension ``macro_time`` [s], and every variable has the attributes ``units`` and ``long_name``.
        """


@runtime_checkable
class BedHydrodynamics(Hydrodynamics, Protocol):
    """A hydrodynamics model that knows water over any terrain, and water that differs from place to place."""

    def set_bed(self, terrain: Terrain) -> None:
        """Take the ground of the runs to come; before the first call it is flat at z = 0.

        Called once a run, before `start`. With it, `exumob.water.conditions.Water.as_arrays` or ``at`` tells level and
        current at each place.
        """


@runtime_checkable
class SpinUpHydrodynamics(Hydrodynamics, Protocol):
    """A hydrodynamics model whose flow must develop round the held vehicle before the vehicle is released."""

    def run_spin_up(
        self, vehicle: Vehicle, water: Water | None, macro_step: float,
        settle: Callable[[Callable[[BodyStates], Array]], BodyStates], keep: Callable[[Any], None], begun: Any = None,
    ) -> None:  # fmt: skip
        """Let the flow develop, and find the vehicle's place of rest in it.

        Called once, in place of `wrenches` while the vehicle settles; `start` follows.

        Parameters
        ----------
        vehicle, water, macro_step
            As for `start`.
        settle : callable
            Takes the water's wrenches, shape (5, 6), as a function of the states (n = 1); lets the vehicle settle under
            them and returns the states at rest (n = 1). The last call leaves the vehicle where it is released.
        keep : callable
            Takes all that is needed to go on from here, of the kinds that `save` returns; to be called every half
            second of the water's time.
        begun : optional
            The last state that `keep` took, from a run that ended before the release.
        """


class NoWater:
    """Dry ground: no wrench on any body."""

    def start(self, vehicle: Vehicle, water: Water | None, macro_step: float) -> None:
        """Prepare nothing."""

    def wrenches(self, history: BodyStates, predict: Callable[[], BodyStates]) -> Array:
        """Return zeros, shape (5, 6)."""
        return np.zeros((5, 6))

    def save(self, histories: bool = True) -> None:
        """Return None: there is no state."""

    def restore(self, saved: None) -> None:
        """Do nothing: there is no state."""

    def record(self) -> dict[str, xr.DataArray]:
        """Return nothing to add."""
        return {}
