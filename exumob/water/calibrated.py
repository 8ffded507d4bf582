"""The coefficient model with the loads of the waves that a vehicle makes, fitted to runs of the flow solver."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import xarray as xr

from exumob.support.arrays import Array
from exumob.support.declared import checked
from exumob.vehicle.motion import BODIES, WRENCH_COMPONENTS, BodyStates
from exumob.vehicle.parameters import Vehicle
from exumob.water.coefficients import CoefficientHydrodynamics, Coefficients
from exumob.water.conditions import Water
from exumob.water.wave_loads import WaveCoefficients, fitted_coefficients, vehicle_lengths, wave_loads


class CalibratedHydrodynamics(CoefficientHydrodynamics):
    """Hydrostatics, drag and added mass with published coefficients, and the fitted loads of the vehicle's own waves.

    The waves' loads are quasi-steady: they follow the speed at once, while a bow wave takes a second or two to build
    up. For a vehicle of another size they hold as far as Froude's law does (`exumob.water.wave_loads`).

    Parameters
    ----------
    coefficients : Coefficients, optional
        Default: the published values; the waves' coefficients were fitted with these.
    waves : WaveCoefficients, optional
        Default: those that come with exumob.
    """

    @checked
    def __init__(self, coefficients: Coefficients | None = None, waves: WaveCoefficients | None = None) -> None:
        super().__init__(coefficients)
        self.waves = fitted_coefficients() if waves is None else waves
        self.parameters |= {"waves": self.waves.values.tolist()}

    def start(self, vehicle: Vehicle, water: Water | None, macro_step: float) -> None:
        """Build the surfaces and forget any earlier run."""
        super().start(vehicle, water, macro_step)
        self._wave_loads: list[Array] = []
        if water is not None:
            self._lengths = vehicle_lengths(vehicle)
            self._around = water.over(self._bed)
            self._by_body = self.waves.by_body

    def wrenches(self, history: BodyStates, predict: Callable[[], BodyStates]) -> Array:
        """Return the wrenches for the macro step that begins now; `predict` is not called. See `Hydrodynamics`."""
        wrenches = super().wrenches(history, predict)
        if self._water is None:
            return wrenches
        last = (
            np.ascontiguousarray(getattr(history, name)[-1])
            for name in ("position", "rotation", "velocity", "angular_velocity")
        )
        loads = wave_loads(self._lengths, float(self._water.density), self._around, *last, self._by_body)
        self._wave_loads.append(loads)
        return np.asarray(wrenches + loads)

    def save(self, histories: bool = True) -> dict[str, Any]:
        """Return the coefficient model's state and the record, or its length only."""
        saved = super().save(histories)
        return saved | ({"waves": np.array(self._wave_loads).reshape(-1, 5, 6)} if histories else {})

    def restore(self, saved: dict[str, Any]) -> None:
        """Return to a state given by `save`; a record kept after it is dropped."""
        super().restore(saved)
        if "waves" in saved:
            self._wave_loads = list(saved["waves"])
        del self._wave_loads[saved["count"] :]

    def record(self) -> dict[str, xr.DataArray]:
        """Return the parts of the wrenches, those of the waves among them; empty without water."""
        found = super().record()
        if found:
            coords = dict(found["drag_load"].coords) | {"body": list(BODIES), "component": list(WRENCH_COMPONENTS)}
            found["wave_load"] = xr.DataArray(
                np.array(self._wave_loads), coords, found["drag_load"].dims,
                attrs={"units": "N, N m", "long_name": "part of the water load by the vehicle's own waves, body axes"},
            )  # fmt: skip
        return found
