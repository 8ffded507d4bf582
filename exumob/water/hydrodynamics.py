"""The one seam of the program: given the motion of five bodies, what does the water do to each?

`NoWater`, coefficients, CFD and networks all answer the same question once a macro step, so CFD-MBD and
LSTM-MBD are the same program. Anyone's own model enters through the same five functions; anyone's own flow code through
`exumob.coupling.flow_code`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol, runtime_checkable

import numpy as np
import xarray as xr

from exumob.support.arrays import Array
from exumob.vehicle.motion import BodyStates
from exumob.vehicle.parameters import Vehicle
from exumob.water.conditions import Water


class Hydrodynamics(Protocol):
    """A model of the water's load on the five bodies (`exumob.vehicle.motion.BODIES`)."""

    def start(self, vehicle: Vehicle, water: Water | None, macro_step: float) -> None:
        """Prepare for a run: called once before the first macro step, and again for every new run.

        Parameters
        ----------
        vehicle : Vehicle
        water : Water or None
            None: no water.
        macro_step : float
            Interval between calls of `wrenches` [s].
        """

    def wrenches(self, history: BodyStates, predict: Callable[[], BodyStates]) -> Array:
        """Loads for the macro step that begins now.

        Parameters
        ----------
        history : BodyStates
            States sampled every 1 ms up to and including now (the last row).
        predict : callable
            Returns the state at the end of the macro step (n = 1): extrapolated and projected on the constraints, or,
            when the step is repeated from a saved state, as the vehicle reached it. Computed when called: models that
            do not need it do not pay for it.

        Returns
        -------
        array, shape (5, 6)
            Force [N] and moment about the body's origin [N m] in each body's own axes.
        """

    def save(self, histories: bool = True) -> Any:
        """Return the model's internal state: dicts, lists, arrays, numbers and text only, so that it can be written.

        Without `histories` it is light and fits this object only (repeated macro steps); with them it holds what
        `record` needs and fits any equal model that has been started (checkpoints).
        """

    def restore(self, saved: Any) -> None:
        """Return to a state given by `save`, bit for bit; what was recorded after it is dropped."""

    def record(self) -> dict[str, xr.DataArray]:
        """What the model adds to the result (range flags, error bars, coupling iterations)."""


@runtime_checkable
class DevelopedHydrodynamics(Hydrodynamics, Protocol):
    """A model whose water must develop round the held vehicle before the vehicle is released."""

    def develop(
        self, vehicle: Vehicle, water: Water | None, macro_step: float,
        settle: Callable[[Callable[[BodyStates], Array]], BodyStates], keep: Callable[[Any], None], begun: Any = None,
    ) -> None:  # fmt: skip
        """Find vehicle and water in equilibrium; called once, instead of `wrenches` while the vehicle settles.

        Parameters
        ----------
        vehicle, water, macro_step
            As for `start`, which follows.
        settle : callable
            Takes the water's wrenches, shape (5, 6), as a function of the states (n = 1); lets the vehicle settle under
            them and returns the states at rest (n = 1). The last call leaves the vehicle where it is released.
        keep : callable
            Takes what is needed to go on from here, as `save` gives it, to be called every half second of the water's
            time.
        begun : optional
            What `keep` was given last, by a run that ended before the release.
        """


class NoWater:
    """Dry ground: no load on any body."""

    def start(self, vehicle: Vehicle, water: Water | None, macro_step: float) -> None:
        """Nothing to prepare."""

    def wrenches(self, history: BodyStates, predict: Callable[[], BodyStates]) -> Array:
        """Zeros, shape (5, 6)."""
        return np.zeros((5, 6))

    def save(self, histories: bool = True) -> None:
        """No internal state."""

    def restore(self, saved: None) -> None:
        """No internal state."""

    def record(self) -> dict[str, xr.DataArray]:
        """Nothing to add."""
        return {}
