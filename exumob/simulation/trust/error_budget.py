"""Of what the error of a run consists: its parts, each measured by itself, a line each.

The error of the final position, over the length of the path: what the model of the water is off beside the flow in the
loop, how far the members of an ensemble disagree, how far the flow repeats, what other cells change; and what is known
of the flow's own loads. All are figures of `exumob.support.measured` or of a report card (`exumob learn`). They come
from different runs and are not added up.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from exumob.simulation.trust.measured_runs import digests_of, measured_vehicle, shipped_name
from exumob.support.measured import flow_load_error, measured_errors
from exumob.support.wording import percent
from exumob.surrogates.model import SurrogateHydrodynamics
from exumob.water.hydrodynamics import Hydrodynamics

Part = tuple[str, str]
"""What a part of the error is of, and how large it is."""


def error_parts(
    model: Hydrodynamics, mean: float, worst: float, straight: bool = False, card: Mapping[str, Any] | None = None
) -> tuple[Part, ...]:
    """Return the parts of the error of a run whose vehicle was compared with the flow in the loop.

    Parameters
    ----------
    model : Hydrodynamics
    mean, worst : float
        What it is off beside the flow in the loop where that was measured [-], straight ahead [m/s].
    straight : bool
        Whether the run goes straight ahead, so that speeds were compared.
    card : mapping, optional
        The card of networks on which it was measured.
    """
    networks = isinstance(model, SurrogateHydrodynamics)
    off = f"{mean:.2g} m/s; at worst {worst:.2g} m/s" if straight else f"{percent(mean)}; at worst {percent(worst)}"
    parts = [("speed beside the flow" if straight else "model beside the flow", off)]
    if networks:
        parts.append(("members of the ensemble", _spread(model, card)))
    other = card is not None and str(card["vehicle"]) != measured_vehicle()
    return (*parts, *flow_parts(str(card["vehicle"]) if card is not None and other else None))


def flow_parts(vehicle: str | None = None) -> tuple[Part, ...]:
    """Return the parts that are the flow's own.

    Parameters
    ----------
    vehicle : str, optional
        Name of a vehicle on which they were not measured.
    """
    flow = measured_errors()["flow"]
    where = "" if vehicle is None else f"not measured on {vehicle}; on the amphibious vehicle "
    again = [f"{percent(off)} {name}" for name, off in flow["ends"].items() if "cells" not in name]
    sizes = [f"{percent(off)} on {name}" for name, off in flow["ends"].items() if "cells" in name]
    return (
        ("flow made again", f"{where}{', '.join(again)} ({flow['scenario']})"),
        ("other cells", f"{where}{', '.join(sizes)} ({flow['scenario']}, made on {1e3 * flow['cell_size']:g} mm)"),
        ("loads of the flow", flow_load_error().rstrip(".")),
    )


def _spread(model: Hydrodynamics, card: Mapping[str, Any] | None) -> str:
    """Say how far the members of an ensemble end from each other."""
    assert isinstance(model, SurrogateHydrodynamics)
    if len(model.networks) < 2:
        return "one alone: no spread"
    if card is not None:
        of = "deviations of the ensemble" if card.get("load_floor") is None else "standard deviations of the error bars"
        return f"two {of} hold {100.0 * float(card['inside']):.0f} % of the loads kept apart"
    rows = [row for row in measured_errors()["runs"] if not row["taught_networks"]]
    name = shipped_name(model) or "networks"
    found = float(np.mean([row[name]["spread"] for row in rows]))
    return f"{percent(found)} (standard deviation of {len(digests_of(name))}, on {len(rows)} runs not seen)"
