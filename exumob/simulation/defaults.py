"""What a run uses unless it is told otherwise: the steps, and the model of the water's loads.

The command line, `exumob.simulate`, sweeps and maps all take their defaults from here.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from exumob.surrogates.model import SurrogateHydrodynamics
from exumob.surrogates.networks import NetworkSet
from exumob.vehicle.parameters import Vehicle
from exumob.water.coefficients import CoefficientHydrodynamics, Coefficients
from exumob.water.conditions import Water
from exumob.water.hydrodynamics import DevelopedHydrodynamics, Hydrodynamics, NoWater

logger = logging.getLogger(__name__)

DURATION = 8.0
"""Simulated time of a run [s]: that of the paper's lane change."""
RECORD_STEP = 1.0e-2
"""Interval between the instants of a result [s]."""
SOIL = "LETE sand"
"""The published soil of a run that names none."""


@dataclass(frozen=True)
class Setting:
    """Steps of a run, by name, with what they cost in accuracy."""

    name: str
    micro_step: float
    """Step of the multibody solver [s]."""
    macro_step: float
    """Interval at which the loads of the water are renewed [s], for models that answer at once."""
    flow_macro_step: float
    """The same with a flow solver in the loop [s]: its loads change faster than 20 ms can follow."""
    error: str
    """How far a run with these steps ends from one with the finest, as measured."""

    def steps(self, hydrodynamics: Hydrodynamics) -> tuple[float, float]:
        """Return micro step and macro step [s] for a model of the water's loads."""
        in_loop = isinstance(hydrodynamics, DevelopedHydrodynamics)
        return self.micro_step, self.flow_macro_step if in_loop else self.macro_step


SETTINGS = {
    "fast": Setting(
        "fast", 5.0e-4, 20.0e-3, 2.0e-3,
        "@ERROR@",
    ),
    "fine": Setting("fine", 1.0e-4, 1.0e-3, 1.0e-3, "the reference: the steps of the paper"),
}  # fmt: skip
"""The settings by name. The paper uses both (Sec. 5.3)."""
DEFAULT_SETTING = "fast"
MODELS = ("auto", "networks", "coefficients", "none")
"""Names of the models of the water's loads; ``"auto"`` takes networks where they fit the vehicle."""


def setting_named(name: str) -> Setting:
    """Return one of `SETTINGS`.

    Raises
    ------
    ValueError
        If no setting has this name.
    """
    if name not in SETTINGS:
        raise ValueError(f"setting = {name!r} is not known; use {' or '.join(map(repr, SETTINGS))}.")
    return SETTINGS[name]


def hydrodynamics_named(
    name: str,
    vehicle: Vehicle,
    water: Water | None,
    *,
    networks: Sequence[NetworkSet | str | Path] | None = None,
    coefficients: Coefficients | None = None,
) -> Hydrodynamics:
    """Make a model of the water's loads by its name.

    Parameters
    ----------
    name : str
        One of `MODELS`. ``"auto"``: the networks if they were trained for this vehicle, else the published
        coefficients, and a warning says why; on dry ground `NoWater`.
    vehicle : Vehicle
    water : Water or None
        None: dry ground.
    networks : sequence of NetworkSet or path, optional
        Members of the ensemble. Default: the networks that come with exumob.
    coefficients : Coefficients, optional
        Of the coefficient model. Default: the published ones.

    Raises
    ------
    ValueError
        If the name is not known, a file holds no networks, or ``"networks"`` were asked for and do not fit.
    """
    if name not in MODELS:
        raise ValueError(f"hydrodynamics = {name!r} is not known; use {', '.join(map(repr, MODELS))}.")
    if water is None or name == "none":
        return NoWater()
    if name == "coefficients":
        return CoefficientHydrodynamics(coefficients)
    model = SurrogateHydrodynamics(list(networks) if networks else None)
    try:
        for network in model.networks:
            network.check_vehicle(vehicle)
    except ValueError as error:
        if name == "networks" or networks:
            raise
        logger.warning("%s: the loads of the water come from published coefficients, since %s", vehicle.name, error)
        return CoefficientHydrodynamics(coefficients)
    return model
