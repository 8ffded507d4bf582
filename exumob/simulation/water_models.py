"""The models of the water's loads by name, the same for the command line, `exumob.simulate`, sweeps and maps."""

from __future__ import annotations

import functools
import logging
from collections.abc import Sequence
from pathlib import Path

from exumob.simulation.trust.measured_runs import measured_vehicle
from exumob.support.declared import checked
from exumob.surrogates.model import SurrogateHydrodynamics
from exumob.surrogates.networks import NetworkSet
from exumob.surrogates.vehicle_shape import first_of, shape_differences, times_as_large
from exumob.vehicle.parameters import Vehicle
from exumob.water.calibrated import CalibratedHydrodynamics
from exumob.water.coefficients import CoefficientHydrodynamics, Coefficients
from exumob.water.conditions import Water
from exumob.water.hydrodynamics import Hydrodynamics, NoWater
from exumob.water.mesh_file import hull_mesh
from exumob.water.wave_loads import fitted_coefficients

logger = logging.getLogger(__name__)

MODELS = ("auto", "networks", "calibrated", "coefficients", "none")
"""Names of the models; ``"auto"`` takes networks where they fit the vehicle."""
DEFAULT_MODEL = "auto"
NAMES = {
    "SurrogateHydrodynamics": "networks",
    "CalibratedHydrodynamics": "calibrated",
    "CoefficientHydrodynamics": "coefficients",
    "CfdHydrodynamics": "flow in the loop",
    "NoWater": "no water",
}
"""Names of the classes of models for people; a result keeps the name of the class."""


@checked
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
        One of `MODELS`. ``"auto"``: the networks if they were trained for this vehicle, else ``"calibrated"``, and a
        warning says why; on dry ground `NoWater`. ``"calibrated"``: published coefficients with fitted loads of the
        vehicle's own waves, those that were fitted to the runs of `networks` if these are given;
        ``"coefficients"``: without these.
    vehicle : Vehicle
    water : Water or None
        None: dry ground.
    networks : sequence of NetworkSet or path, optional
        Members of the ensemble, or files of one or several (`exumob.surrogates.ensemble`); ``"paper-lstm"`` and
        ``"full-range"`` come with exumob (`exumob.surrogates.networks.NAMED`). Default: those for lane changes, and
        ``"full-range"`` beyond their range.
    coefficients : Coefficients, optional
        Coefficients of the coefficient model. Default: the published ones. With others ``"auto"`` is ``"calibrated"``,
        as networks know nothing of them.

    Raises
    ------
    ValueError
        If the name is not known, a file holds no networks, or ``"networks"`` were asked for and do not fit, or with
        coefficients other than the published ones.
    """
    if name not in MODELS:
        raise ValueError(f"hydrodynamics = {name!r} is not known; use {', '.join(map(repr, MODELS))}.")
    if water is None or name == "none":
        return NoWater()
    if name == "coefficients":
        return CoefficientHydrodynamics(coefficients)
    if name == "calibrated" and not networks:
        return CalibratedHydrodynamics(coefficients)
    if coefficients is not None and coefficients != Coefficients():
        if name == "networks" or networks:
            raise ValueError(
                f"hydrodynamics = {name!r}: coefficients of your own have no effect on networks, which learned beside "
                "the published ones; leave them out, or the networks, and take hydrodynamics='calibrated'."
            )
        return CalibratedHydrodynamics(coefficients)
    model = SurrogateHydrodynamics(list(networks) if networks else None)
    if networks:
        for network in model.networks:
            network.check_vehicle(vehicle)
        if name == "networks" or name == "auto":
            return model
        if not any("waves" in network.about for network in model.networks):
            raise ValueError(
                f"hydrodynamics='calibrated': the networks ({model.networks[0].name}) rest on no coefficients that "
                "were fitted to their runs; give some of the preset 'memory' or of `exumob learn`, or leave them out."
            )
        return CalibratedHydrodynamics(waves=model.waves)
    trained = model.networks[0].about["geometry"]
    if times_as_large(vehicle, trained) is not None:
        return model
    differences = shape_differences(vehicle, trained)
    if vehicle.hull.mesh is not None:
        hull_mesh(vehicle)  # what is wrong with it is said before what the networks lack
    shown = first_of(differences)
    if name == "networks":
        raise ValueError(
            f"hydrodynamics = 'networks': the networks that come with exumob were trained for the {measured_vehicle()} "
            f"vehicle, and {vehicle.name} has another shape ({shown}). Give networks made for it (`exumob learn`), or "
            "take 'calibrated' or the flow in the loop."
        )
    vehicles = dict.fromkeys(name.split(" (")[0] for name in fitted_coefficients().about["runs"])
    _warn_once(
        f"{vehicle.name}: no networks know this vehicle ({shown}), so the loads of the water come from coefficients "
        f"that were calibrated on {', '.join(vehicles)}; the result's line of trust says how far they were off. "
        "`exumob learn` makes networks for a vehicle."
    )
    return CalibratedHydrodynamics(coefficients)


@functools.cache
def _warn_once(text: str) -> None:
    """Warn, but not once more for every case of a sweep."""
    logger.warning("%s", text)
