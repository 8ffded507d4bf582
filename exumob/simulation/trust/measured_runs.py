"""The runs whose errors were measured (`exumob.support.measured`), and what another run has in common with them."""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from exumob.driving.maneuver import ConstantSteer
from exumob.simulation.description import RunDescription
from exumob.support.measured import measured_errors
from exumob.support.wording import percents, span
from exumob.surrogates.ensemble import card_of
from exumob.surrogates.model import SurrogateHydrodynamics
from exumob.surrogates.networks import FULL_RANGE
from exumob.surrogates.vehicle_shape import GEOMETRY, flat, plain_parameters, same_value
from exumob.vehicle.parameters import Vehicle
from exumob.water.conditions import Water


def measured_vehicle() -> str:
    """Return the name of the vehicle on which the errors were measured."""
    return str(measured_errors()["vehicle"]["name"])


def is_measured_vehicle(vehicle: Vehicle) -> bool:
    """Whether a vehicle has the shape of the one that was measured; its mass, say, may differ."""
    measured, present = flat(measured_errors()["vehicle"]), plain_parameters(vehicle)
    return all(same_value(present.get(name), measured.get(name)) for name in GEOMETRY)


def rows_of(scenario: str) -> list[Mapping[str, Any]]:
    """Return the row of a scenario, if it was measured."""
    return [row for row in measured_errors()["runs"] if row["scenario"] == scenario]


def nearest_row(vehicle: Vehicle, water: Water, rows: Sequence[Mapping[str, Any]]) -> Mapping[str, Any] | None:
    """Find the measured run whose water is nearest, if it is near: within half the spacing of the measured ones."""
    if water.depth is None:
        return None
    depth = water.depth / vehicle.wheel.diameter
    away = [math.hypot((row["depth_ratio"] - depth) / 0.1, (row["current_speed"] - water.current_speed) / 0.5)
            for row in rows]  # fmt: skip
    nearest = int(np.argmin(away))
    return rows[nearest] if away[nearest] <= 0.5 else None


def shipped_name(model: SurrogateHydrodynamics) -> str | None:
    """Name under which the table holds the errors of networks; None if it does not: they are the user's own."""
    found = {network.digest() for network in model.networks}
    return next((name for name in ("networks", *measured_errors()["named"]) if found <= digests_of(name)), None)


def digests_of(name: str) -> set[str]:
    """Digests of the networks that come with exumob: ``"networks"``, the default ensemble, or those with a name."""
    table = measured_errors()
    return set(table["networks"] if name == "networks" else table["named"][name])


def cards_of(model: SurrogateHydrodynamics) -> list[Mapping[str, Any] | None]:
    """What was measured of networks: their cards; None stands for the rows of the table.

    The default networks have both: lane changes like the paper's in the rows, and beyond the range of these the card of
    the networks that take over there.
    """
    own = card_of(model.networks, some=True)
    beyond = None if model.beyond is None else card_of(model.beyond.networks, some=True)
    return [own] if beyond is None else [own, beyond]


@functools.cache
def waves_of_networks() -> str | None:
    """Digest of the coefficients that the default networks rest on: the table holds their errors, too."""
    waves = SurrogateHydrodynamics().waves
    return None if waves is None else waves.digest()


@functools.cache
def _full_range() -> SurrogateHydrodynamics:
    return SurrogateHydrodynamics(FULL_RANGE)


def full_range_waves() -> str | None:
    """Digest of the coefficients that the networks for the whole range rest on."""
    waves = _full_range().waves
    return None if waves is None else waves.digest()


def full_range_card() -> Mapping[str, Any]:
    """Report card of the networks for the whole range."""
    return card_of(_full_range().networks) or {"drives": []}


def elsewhere_off(name: str) -> str:
    """Say how far lane changes of other vehicles ended from the flow with a model: "calibrated" or "coefficients"."""
    others = measured_errors()["elsewhere"]
    later = others["later"]
    how = ", each with coefficients fitted without that vehicle" if name == "calibrated" else ""
    shipped = " (its lane change is among what they were fitted to)" if name == "calibrated" else ""
    return (
        f"of other vehicles one lane change each was compared{how} ({', '.join(others['vehicles'])}; "
        f"{100.0 * others['depth_ratio']:.0f} % depth, a head current of {others['current_speed']:g} m/s of the "
        f"{measured_vehicle()} vehicle by Froude's law): {percents(*others[name])} of the path away; "
        f"{later['drives']} drives of the {later['vehicle']} in other water (depth ratio "
        f"{span(*later['depth_ratio'])}, currents of up to {later['current'][1]:g} m/s, also from the side and behind) "
        f"{percents(*later[name])}{shipped}"
    )


def is_straight(run: RunDescription) -> bool:
    """Whether a run goes straight ahead all the time."""
    return isinstance(run.maneuver, ConstantSteer) and run.maneuver.angle == 0.0


def whither(errors: Sequence[float], more: str = "far", less: str = "short") -> str:
    """Say to which side errors lie, if all lie to one."""
    if all(e > 0.0 for e in errors):
        return f", always too {more}"
    return f", always too {less}" if all(e < 0.0 for e in errors) else ""


def ranges_of(rows: Sequence[Mapping[str, Any]]) -> str:
    """Say over which depths and currents runs reach."""
    depth, current = ([row[name] for row in rows] for name in ("depth_ratio", "current_speed"))
    return f"depth ratio {span(min(depth), max(depth))}, current {span(min(current), max(current))} m/s from ahead"
