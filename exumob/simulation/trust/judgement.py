"""What a result is worth: which model of the water answered, and how far it was off on runs like this one.

The figures are those of `exumob.support.measured`: lane changes and straight lines of one vehicle, beside the same
with the flow in the loop. `trust_of` compares a run with them. Where the run lies beyond what was measured it says by
what (`exumob.simulation.trust.departures`); where the vehicle is another one it says that nothing was validated.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from exumob.coupling.flow_code import BuiltInFlow
from exumob.coupling.flow_in_loop import CfdHydrodynamics
from exumob.simulation.description import RunDescription
from exumob.simulation.over_water import WaterMet
from exumob.simulation.settings import time_scale
from exumob.simulation.trust.departures import (
    OF_WATER,
    OUTSIDE_RANGE,
    Departure,
    departures_by_froude,
    departures_of,
    dry_departures,
    merged,
)
from exumob.simulation.trust.error_budget import Part, error_parts, flow_parts
from exumob.simulation.trust.measured_runs import (
    cards_of,
    elsewhere_off,
    full_range_card,
    full_range_waves,
    is_measured_vehicle,
    is_straight,
    measured_vehicle,
    nearest_row,
    ranges_of,
    shipped_name,
    waves_of_networks,
    whither,
)
from exumob.simulation.trust.soil_line import soil_line
from exumob.support.measured import flow_load_error, measured_errors
from exumob.support.wording import percent, percents, rounded_span
from exumob.surrogates.model import SurrogateHydrodynamics
from exumob.surrogates.vehicle_shape import times_as_large
from exumob.vehicle.parameters import Vehicle
from exumob.water.calibrated import CalibratedHydrodynamics
from exumob.water.coefficients import CoefficientHydrodynamics
from exumob.water.conditions import Water
from exumob.water.hydrodynamics import NoWater
from exumob.water.wave_loads import fitted_coefficients

A_LITTLE = 0.05
"""Share in the loads of networks beyond the range of the first up to which a run is like those of the first [-]."""
MOSTLY = 0.25
"""Share of the calibrated coefficients in the loads from which a drive says little of networks [-]."""
NAMED = 4
"""Number of differences that the line names; it counts the others."""


@dataclass(frozen=True)
class Trust:
    """What a result, or a sweep of runs, is worth."""

    model: str
    """What gave the loads of the water: "networks", "networks (paper-lstm)", "calibrated", "coefficients", "flow in the
    loop", "no water", or a class"""
    status: str
    """"measured": runs like this one were compared with the reference; "beyond": they lie beyond what was; "not
    validated": the vehicle or the model is another one"""
    error: str
    """How far the model was off where it was measured, and on what that was"""
    soil: str
    """What the forces of the soil rest on"""
    departures: tuple[Departure, ...] = ()
    mean: float = math.nan
    """Mean of the error that was measured: of the final position over the length of the path [-]; straight ahead of
    the speed [m/s]; nan where nothing was measured"""
    worst: float = math.nan
    """The largest of the same"""
    advice: str = ""
    """What to believe, and what to do, where nothing was measured"""
    nearest: str = ""
    """The error in the measured run that is nearest; a part of `error`"""
    parts: tuple[Part, ...] = ()
    """Of what the error consists (`exumob.simulation.trust.error_budget`); empty where nothing was measured"""

    @property
    def line(self) -> str:
        """All of it as one line of text."""
        where = {
            "measured": ", measured on runs like this one: ",
            "beyond": f", beyond what was measured (in brackets): {self._beyond}. {self.advice} Where measured, ",
            "not validated": f", not validated{self._untried} {self.advice} ",
        }[self.status]  # fmt: skip
        return f"{self.model}{where}{self.error} {self.soil}".replace("  ", " ")

    @property
    def _beyond(self) -> str:
        more = len(self.departures) - NAMED
        return "; ".join(map(str, self.departures[:NAMED])) + (f"; and {more} more" if more > 0 else "")

    @property
    def _untried(self) -> str:
        """What lies beyond all that was tried comes first: no figure behind it holds there."""
        return f", and beyond all that was tried (in brackets): {self._beyond};" if self.departures else ":"

    def attributes(self) -> dict[str, str | float]:
        """Return the line and its parts, as kept in results."""
        found: dict[str, str | float] = {
            "trust": self.line, "trust_model": self.model, "trust_status": self.status,
            "trust_beyond": "; ".join(map(str, self.departures)),
        }  # fmt: skip
        if math.isfinite(self.mean):
            found |= {"trust_mean_error": self.mean, "trust_worst_error": self.worst}
        if self.parts:
            found["trust_errors"] = "\n".join(f"{name}: {amount}" for name, amount in self.parts)
        return found | ({"trust_nearest": self.nearest} if self.nearest else {})


def trust_of(
    run: RunDescription,
    out_of_range: float | None = None,
    fallback: float | None = None,
    met: WaterMet | None = None,
    wide: float | None = None,
) -> Trust:
    """Compare one run with those whose errors were measured.

    Parameters
    ----------
    run : RunDescription
    out_of_range : float, optional
        Share of the time for which some body was outside the networks' training range [-]; None: not known yet.
    fallback : float, optional
        Mean share of the calibrated coefficients in the loads [-].
    met : WaterMet, optional
        What the vehicle met of water that is given by its level or a field.
    wide : float, optional
        Mean share in the loads of networks that take over beyond the range of the first ones [-].
    """
    return _together([(run, out_of_range, fallback, met)], wide)


def trust_of_all(
    runs: Sequence[RunDescription], out_of_range: Sequence[float] | None = None, wide: float | None = None
) -> Trust:
    """Compare many runs with one model, those of a sweep or a map, with those whose errors were measured.

    What differs is named once, with its range over all runs. All have the model of the first one.

    Parameters
    ----------
    runs : sequence of RunDescription
    out_of_range : sequence of float, optional
        Share of the time for which some body was outside the networks' training range, of each run [-].
    wide : float, optional
        Largest share in the loads of a run of networks that take over beyond the range of the first ones [-].
    """
    outside = [None] * len(runs) if out_of_range is None else out_of_range
    return _together([(run, share, None, None) for run, share in zip(runs, outside, strict=True)], wide)


_Case = tuple[RunDescription, float | None, float | None, WaterMet | None]


def _together(cases: Sequence[_Case], wide: float | None = None) -> Trust:
    """Judge by the measured runs from which these differ least, first of all in the water.

    What lies as far beyond several sets of them in the water is judged by the last, which reaches farthest; and so are
    runs to whose loads the networks beyond gave more than a little.
    """
    model = cases[0][0].hydrodynamics
    cards = cards_of(model) if isinstance(model, SurrogateHydrodynamics) else [None]
    if wide is not None and wide > A_LITTLE:
        cards = cards[-1:]
    found = [_judged(cases, card) for card in cards]
    if found[0].status == "not validated":
        found = [one for one in found if one.status == "not validated"]

    def differences(place: int) -> tuple[int, int, int]:
        water = sum(one.quantity in OF_WATER for one in found[place].departures)
        return water, -place if water else 0, len(found[place].departures)

    return found[min(range(len(found)), key=differences)]


def _judged(cases: Sequence[_Case], card: Mapping[str, Any] | None) -> Trust:
    """Judge by the drives of a card of networks, or by the runs of the table."""
    first = cases[0][0]
    water = next((run.water for run, *_ in cases if run.water is not None), None)
    soil = soil_line([run for run, *_ in cases])
    model = first.hydrodynamics
    if water is None:
        return _dry([run for run, *_ in cases], soil)
    if isinstance(model, NoWater):
        return Trust("no water", "not validated", "", soil, advice="there is water, and its loads are left out.")
    if isinstance(model, CfdHydrodynamics):
        trust = _flow(first, soil)
    elif isinstance(model, SurrogateHydrodynamics | CoefficientHydrodynamics):
        trust = _cheap(first, soil, water, card)
    else:
        advice = "a model of your own, which exumob has compared with nothing."
        return Trust(type(model).__name__, "not validated", "", soil, advice=advice)
    if trust.status == "not validated":
        scaled = isinstance(model, SurrogateHydrodynamics) and shipped_name(model) is not None
        if not isinstance(model, CoefficientHydrodynamics) and not scaled:
            return trust
        wide = full_range_card()
        known = isinstance(model, CalibratedHydrodynamics) and model.waves.digest() == fitted_coefficients().digest()
        tried = wide if card is None and known and wide["drives"] else card
        beyond = [d for run, _, _, met in cases for d in departures_by_froude(run, met, tried)]
        left = [outside for _, outside, _, _ in cases if outside is not None and outside > 0.005]
        if scaled and left:
            beyond.append(Departure(OUTSIDE_RANGE, tuple(100.0 * outside for outside in left), "0", "% of the time"))
        return replace(trust, departures=tuple(merged(beyond)))
    if len(cases) > 1 and trust.nearest:  # the nearest run is that of one case only
        trust = replace(trust, error=trust.error.replace(trust.nearest, ""), nearest="")
    departures = merged(d for run, outside, _, met in cases for d in departures_of(run, outside, met, card))
    if not departures:
        return trust
    advice = "The error here is not known; compare with the flow in the loop."
    if isinstance(model, CfdHydrodynamics):
        advice = "The spread here is not known; repeat one run on finer cells."
    shares = [(outside, share) for _, outside, share, _ in cases if outside is not None and share is not None]
    if len(shares) == 1 and any(d.quantity == OUTSIDE_RANGE for d in departures):
        advice = f"{_what_to_believe(*shares[0], card)} {advice}"
    return replace(trust, status="beyond", departures=tuple(departures), advice=advice)


def _dry(runs: Sequence[RunDescription], soil: str) -> Trust:
    table = measured_errors()
    off = table["dry"]["end"]
    departures = merged(d for run in runs for d in dry_departures(run, table))
    error = (
        f"the steps move the end of the path by {percent(off)}; no vehicle that was driven on soil has been compared."
    )
    status, advice = ("beyond", "The error of the steps is not known.") if departures else ("measured", "")
    return Trust("no water", status, error, soil, tuple(departures), off, off, advice)


def _flow(run: RunDescription, soil: str) -> Trust:
    flow = measured_errors()["flow"]
    code = getattr(run.hydrodynamics, "flow", None)
    if not isinstance(code, BuiltInFlow):
        advice = f"{type(code).__name__} is a flow code of your own, which exumob has compared with nothing."
        return Trust("flow in the loop", "not validated", "", soil, advice=advice)
    if not is_measured_vehicle(run.vehicle):
        advice = f"no run of this vehicle ({run.vehicle.name}) was repeated."
        return Trust("flow in the loop", "not validated", flow_load_error(), soil, advice=advice)
    error = (
        f"made again ({', '.join(flow['variants'])}), {flow['scenario']} ended within {percent(flow['end'])} of the "
        f"path; {flow_load_error()}"
    )
    return Trust("flow in the loop", "measured", error, soil, (), flow["end"], flow["end"], parts=flow_parts())


def _cheap(run: RunDescription, soil: str, water: Water, card: Mapping[str, Any] | None) -> Trust:
    """Networks or coefficients, as if the run were like those that were measured."""
    table, model = measured_errors(), run.hydrodynamics
    name = "calibrated" if isinstance(model, CalibratedHydrodynamics) else "coefficients"
    if isinstance(model, SurrogateHydrodynamics):
        if card is not None:
            return _learnt(model, card, run.vehicle, soil)
        shipped = shipped_name(model)
        if shipped is None:
            advice = "networks of your own; compare them with runs that they have not learnt."
            return Trust("networks", "not validated", "", soil, advice=advice)
        name = shipped
    waves = model.waves.digest() if isinstance(model, CalibratedHydrodynamics) else None
    others = waves not in (None, fitted_coefficients().digest())
    if others and is_measured_vehicle(run.vehicle) and waves == waves_of_networks():
        name = "fitted"
    elif others:
        ends = [one["coefficients_end"] for one in full_range_card()["drives"]] if waves == full_range_waves() else []
        advice = "coefficients fitted to other runs than those of exumob; a report card says how far they were off."
        if ends:
            advice = (
                f"those of the networks for the whole range; on {len(ends)} drives kept apart they ended "
                f"{percents(min(ends), max(ends))} of the path from the flow."
            )
        return Trust(name, "not validated", "", soil, advice=advice)
    same, straight = is_measured_vehicle(run.vehicle), is_straight(run)
    networks = isinstance(model, SurrogateHydrodynamics)
    rows = [row for row in table["runs"] if not (networks and row["taught_networks"])]
    scale = time_scale(run.vehicle) if straight and not same else 1.0  # speeds go with times, by Froude's law
    off = [scale * abs(row[name]["speed" if straight else "end"]) for row in rows]
    mean, worst = float(np.mean(off)), float(np.max(off))
    if straight:
        amount = f"the speed straight ahead is {mean:.2g} m/s (at worst {worst:.2g} m/s) from that with"
    else:
        amount = f"the path ends {percent(mean)} of its length (at worst {percent(worst)}) from that with"
    side, near = "", ""
    if not networks:
        side = whither([row[name]["forward"] for row in rows], *(("fast", "slow") if straight else ("far", "short")))
        nearest = nearest_row(run.vehicle, water, rows)
        if nearest is not None and same:
            at = nearest[name]
            number = f"{abs(at['speed']):.2g} m/s" if straight else percent(at["end"])
            near = f"; {number} in {nearest['scenario']}, which is nearest"
    on = f"{len(rows)} {'runs' if straight else 'lane changes'}{' that they had not seen' if networks else ''}"
    taught = [row for row in table["runs"] if row["taught_networks"]]
    if name in ("calibrated", "fitted"):
        on += f", to {len(taught)} of which it was fitted"
    which = "this vehicle" if same else f"the {measured_vehicle()} vehicle"
    which += ", speeds by Froude's law" if straight and not same else ""
    seen = ""
    if networks:
        ends = [abs(row[name]["speed" if straight else "end"]) for row in taught]
        worst_seen = f"{max(ends):.2g} m/s" if straight else percent(max(ends))
        seen = f"; {len(taught)} that they had seen, {ranges_of(taught)}: at worst {worst_seen}"
    error = f"{amount} the flow in the loop{side}{near} ({on}; {which}, {table['soil']}, {ranges_of(rows)}{seen})."
    drives = full_range_card()["drives"]
    if name == "calibrated" and not straight and drives:
        ends = [float(one["calibrated_end"]) for one in drives]
        most = percents(min(ends), max(ends))
        error += f" On {len(ends)} other drives of that one{_waters(drives)} it ended {most} of the path away."
    label = f"networks ({name})" if name in table["named"] else name
    label = "calibrated (for the networks)" if name == "fitted" else label
    if same:
        parts = error_parts(model, mean, worst, straight)
        return Trust(label, "measured", error, soil, (), mean, worst, nearest=near, parts=parts)
    if isinstance(model, SurrogateHydrodynamics):
        size = times_as_large(run.vehicle, model.networks[0].about["geometry"])
        form = (
            "It has not the form of the one that the networks know, and they refuse it"
            if size is None
            else f"It has the form of the one that the networks know, {size:.3g} times as large: loads, speeds and "
            "times are scaled by Froude's law, which water follows and soil does not"
        )
        advice = (
            f"this vehicle ({run.vehicle.name}) was never compared with the flow in the loop. {form}. For the other one"
        )
    else:
        advice = (
            f"this vehicle ({run.vehicle.name}) is not the one that was compared with the flow in the loop; "
            f"{elsewhere_off(name)}. For the {measured_vehicle()} vehicle"
        )
    return Trust(label, "not validated", error, soil, advice=advice)


def _learnt(model: SurrogateHydrodynamics, card: Mapping[str, Any], vehicle: Vehicle, soil: str) -> Trust:
    """Networks that carry a report card (`exumob learn`), as if the run were like those of the card."""
    shipped = shipped_name(model)
    label = "networks" if shipped in (None, "networks") else f"networks ({shipped})"
    end = "default_end" if shipped == "networks" else "end"  # with the networks for lane changes before these
    ends = [abs(float(one.get(end, one["end"]))) for one in card["drives"]]
    apart = f"{len(ends)} drive{'s' if len(ends) > 1 else ''} kept apart{_waters(card['drives'])}"
    off = percent(float(np.mean(ends))) if ends else ""
    drives = (
        f"{apart} ended {off} of the path (at worst {percent(max(ends))}) from that with the flow in the loop"
        if ends
        else "no drive was compared with the flow in the loop"
    )
    inside = f"{100.0 * card['inside']:.0f} % of them within two standard deviations of their error bars"
    if card.get("load_floor") is None:  # an older file: the spread alone
        inside = f"{100.0 * card['inside']:.0f} % of them within two deviations of the ensemble"
        inside = inside if card["members"] > 1 else "without error bars, as one seed has none"
    error = (
        f"{drives}; on {card['runs']} runs kept apart the loads were off by {card['load_error']:.2g} of their "
        f"deviation (worst {card['worst_load']}), {inside} ({card['vehicle']}, learnt from {card['seconds']:.0f} s of "
        f"flow at depth ratios of {rounded_span(*card['depth_ratio'])}, currents of "
        f"{rounded_span(*card['current_speed'])} m/s, on cells of {1e3 * card['cell_size']:.3g} mm, whose own error "
        "comes on top)."
    )
    if not ends:
        return Trust(label, "not validated", error, soil, advice="their drives were never compared. Where known,")
    size = times_as_large(vehicle, model.networks[0].about["geometry"])
    if size is not None and size != 1.0:
        advice = (
            f"{vehicle.name} has the form of the vehicle of the card, {size:.3g} times as large: loads, speeds and "
            "times are scaled by Froude's law, which water follows and soil does not. For the other one,"
        )
        return Trust(label, "not validated", error, soil, advice=advice)
    shares = [float(one["fallback"]) for one in card["drives"] if isinstance(one.get("fallback"), int | float)]
    share = float(np.mean(shares)) if shares else 0.0
    if share > MOSTLY:
        advice = f"the coefficients gave {100.0 * share:.0f} % of the loads in drives that were compared. In them,"
        return Trust(label, "not validated", error, soil, advice=advice)
    mean, worst = float(np.mean(ends)), max(ends)
    return Trust(label, "measured", error, soil, (), mean, worst, parts=error_parts(model, mean, worst, card=card))


def _waters(drives: Sequence[Mapping[str, Any]]) -> str:
    """Say in which waters the drives of a card were, if the card does."""
    found = []
    for name, what, unit in (("depth_ratio", "depth ratio", ""), ("current_speed", "current", " m/s")):
        values = [one[name] for one in drives if isinstance(one.get(name), int | float)]
        ends = dict.fromkeys(f"{value:.2g}" for value in (min(values), max(values))) if values else ()
        found += [f"{what} {' to '.join(ends)}{unit}"] if ends else []
    return f" ({', '.join(found)})" if found else ""


def _what_to_believe(out_of_range: float, fallback: float, card: Mapping[str, Any] | None) -> str:
    """Say what to make of a run that was outside the networks' training range for a part of the time."""
    if fallback < 0.005:
        return (
            "It left the range so little that the networks answered alone, extrapolating by less than a tenth of it: "
            "expect more than the measured error."
        )
    drives = [] if card is None else [one.get("coefficients_end") for one in card["drives"]]
    ends = [float(end) for end in drives if isinstance(end, int | float)]
    alone = (
        f"; alone, in what was measured, they ended {percents(min(ends), max(ends))} of the path away" if ends else ""
    )
    return f"The coefficients that they rest on gave {100.0 * fallback:.0f} % of the loads{alone}. Expect more."
