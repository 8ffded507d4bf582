"""What a result is worth: which model of the water answered, and how far it was off on runs like this one.

The figures are those of `exumob.support.measured`: lane changes and straight lines of one vehicle, beside the same
with the flow in the loop. `trust_of` compares a run with them. Where the run lies beyond what was measured it says by
what; where the vehicle is another one it says that nothing was validated.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from exumob.coupling.explicit import Explicit
from exumob.coupling.flow_code import BuiltInFlow
from exumob.coupling.flow_in_loop import CfdHydrodynamics
from exumob.coupling.semi_implicit import SemiImplicit
from exumob.driving.maneuver import ConstantSteer, LaneChange
from exumob.ground.soil import Soil
from exumob.simulation.description import RunDescription
from exumob.simulation.over_water import WaterMet
from exumob.simulation.settings import DEFAULT_SETTING, setting_named, time_scale
from exumob.support.measured import flow_load_error, measured_errors
from exumob.surrogates.ensemble import card_of
from exumob.surrogates.model import SLOPE_RANGE, SurrogateHydrodynamics
from exumob.surrogates.networks import GEOMETRY, TRAINED_DENSITY, further_shape
from exumob.vehicle.parameters import Vehicle
from exumob.water.calibrated import CalibratedHydrodynamics
from exumob.water.coefficients import CoefficientHydrodynamics
from exumob.water.conditions import Water
from exumob.water.hydrodynamics import Hydrodynamics, NoWater
from exumob.water.wave_loads import fitted_coefficients

CLOSE = 1.0e-3
"""Relative difference up to which a value counts as the one that was measured [-]."""
LEVEL_DIFFERENCE = 1e-3
"""Difference of the water's level over half the hull's length from which the line names it [m]."""
CURRENT_DIFFERENCE = 0.01
"""Difference of the current over half the hull's length from which the line names it [m/s]."""
MOSTLY = 0.25
"""Share of the calibrated coefficients in the loads from which a drive says little of networks [-]."""
NAMED = 4
"""Number of differences that the line names; it counts the others."""


@dataclass(frozen=True)
class Departure:
    """One respect in which runs lie beyond what was measured."""

    quantity: str
    values: tuple[float | str, ...]
    measured: str
    unit: str = ""

    def __str__(self) -> str:
        numbers = [v for v in self.values if not isinstance(v, str)]
        if len(numbers) == len(self.values):
            ends = dict.fromkeys(f"{v:.3g}" for v in (min(numbers), max(numbers)))
            found = " to ".join(ends)
        else:
            words = list(dict.fromkeys(map(str, self.values)))
            found = ", ".join(words[:3]) + (f" and {len(words) - 3} more" if len(words) > 3 else "")
        unit = f" {self.unit}" if self.unit else ""
        return f"{self.quantity} {found}{unit} ({self.measured}{unit})"


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

    @property
    def line(self) -> str:
        """All of it as one line of text."""
        where = {
            "measured": ", measured on runs like this one: ",
            "beyond": f", beyond what was measured: {self._beyond}. {self.advice} Where measured, ",
            "not validated": f", not validated: {self.advice} ",
        }[self.status]  # fmt: skip
        untried = self._untried if self.status == "not validated" else ""
        return f"{self.model}{where}{self.error} {untried}{self.soil}".replace("  ", " ")

    @property
    def _beyond(self) -> str:
        more = len(self.departures) - NAMED
        return "; ".join(map(str, self.departures[:NAMED])) + (f"; and {more} more" if more > 0 else "")

    @property
    def _untried(self) -> str:
        return f"Beyond what was tried anywhere: {self._beyond}. " if self.departures else ""

    def attributes(self) -> dict[str, str | float]:
        """Return the line and its parts, as kept in results."""
        found: dict[str, str | float] = {
            "trust": self.line, "trust_model": self.model, "trust_status": self.status,
            "trust_beyond": "; ".join(map(str, self.departures)),
        }  # fmt: skip
        if math.isfinite(self.mean):
            found |= {"trust_mean_error": self.mean, "trust_worst_error": self.worst}
        return found | ({"trust_nearest": self.nearest} if self.nearest else {})


def trust_of(
    run: RunDescription,
    out_of_range: float | None = None,
    fallback: float | None = None,
    met: WaterMet | None = None,
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
    """
    return _together([(run, out_of_range, fallback, met)])


def trust_of_all(runs: Iterable[RunDescription]) -> Trust:
    """Compare many runs with one model, those of a sweep or a map, with those whose errors were measured.

    What differs is named once, with its range over all runs. All have the model of the first one.
    """
    return _together([(run, None, None, None) for run in runs])


def fitted_off() -> str:
    """Say how far runs with the coefficients that the networks rest on ended from those with the flow in the loop."""
    rows = [row["fitted"] for row in measured_errors()["runs"]]
    amount = _percents(min(row["end"] for row in rows), max(row["end"] for row in rows))
    return f"{amount} of the path away{_whither([row['forward'] for row in rows])}"


def elsewhere_off(name: str) -> str:
    """Say how far lane changes of other vehicles ended from the flow with a model: "calibrated" or "coefficients"."""
    others = measured_errors()["elsewhere"]
    how = ", each with coefficients fitted without that vehicle," if name == "calibrated" else ""
    return (
        f"of other vehicles one lane change each was compared{how} ({', '.join(others['vehicles'])}; "
        f"{100.0 * others['depth_ratio']:.0f} % depth, a head current of {others['current_speed']:g} m/s of the "
        f"{measured_vehicle()} vehicle by Froude's law): {_percents(*others[name])} of the path away"
    )


def measured_vehicle() -> str:
    """Return the name of the vehicle on which the errors were measured."""
    return str(measured_errors()["vehicle"]["name"])


def shape_differences(vehicle: Vehicle, trained: Mapping[str, Any]) -> list[str]:
    """Say in which parameters a vehicle differs in shape from the one of the training runs (`GEOMETRY`)."""
    present = _plain(vehicle)
    found = []
    for name, value in trained.items():
        given = present.get(name)
        if not _same(given, value):
            found.append(f"{name} = {_number(given)}, they were trained with {_number(value)}")
    return found


def card_parameters(vehicle: Vehicle) -> dict[str, Any]:
    """Return a vehicle's parameters by name, as a report card holds them: another vehicle is beyond the card.

    Name and mesh are left out: networks refuse another shape by themselves.
    """
    return {name: value for name, value in _plain(vehicle).items() if name not in ("name", "hull.mesh")}


# -- comparison --------------------------------------------------------------------------------------------------------

_Case = tuple[RunDescription, float | None, float | None, WaterMet | None]


def _together(cases: Sequence[_Case]) -> Trust:
    first = cases[0][0]
    water = next((run.water for run, *_ in cases if run.water is not None), None)
    soil = _soil_line([run for run, *_ in cases])
    model = first.hydrodynamics
    if water is None:
        return _dry([run for run, *_ in cases], soil)
    if isinstance(model, NoWater):
        return Trust("no water", "not validated", "", soil, advice="there is water, and its loads are left out.")
    if isinstance(model, CfdHydrodynamics):
        trust = _flow(first, soil)
    elif isinstance(model, SurrogateHydrodynamics | CoefficientHydrodynamics):
        trust = _cheap(first, soil, water)
    else:
        advice = "a model of your own, which exumob has compared with nothing."
        return Trust(type(model).__name__, "not validated", "", soil, advice=advice)
    if trust.status == "not validated":
        if not isinstance(model, CoefficientHydrodynamics):
            return trust
        return replace(trust, departures=tuple(_merged(d for case in cases for d in _beyond_froude(case[0], case[3]))))
    if len(cases) > 1 and trust.nearest:  # the nearest run is that of one case only
        trust = replace(trust, error=trust.error.replace(trust.nearest, ""), nearest="")
    departures = _merged(d for case in cases for d in _departures(*case))
    if not departures:
        return trust
    advice = "The error here is not known; compare with the flow in the loop."
    if isinstance(model, CfdHydrodynamics):
        advice = "The spread here is not known; repeat one run on finer cells."
    shares = [(outside, share) for _, outside, share, _ in cases if outside is not None and share is not None]
    if len(shares) == 1 and any(d.quantity == _RANGE for d in departures):
        own = isinstance(model, SurrogateHydrodynamics) and _shipped(model) == "networks"
        advice = f"{_what_to_believe(*shares[0], own)} {advice}"
    return replace(trust, status="beyond", departures=tuple(departures), advice=advice)


def _dry(runs: Sequence[RunDescription], soil: str) -> Trust:
    table = measured_errors()
    off = table["dry"]["end"]
    departures = _merged(d for run in runs for d in _dry_departures(run, table))
    error = (
        f"the steps move the end of the path by {_percent(off)}; no vehicle that was driven on soil has been compared."
    )
    status, advice = ("beyond", "The error of the steps is not known.") if departures else ("measured", "")
    return Trust("no water", status, error, soil, tuple(departures), off, off, advice)


def _dry_departures(run: RunDescription, table: Mapping[str, Any]) -> Iterator[Departure]:
    if not _same_vehicle(run.vehicle):
        yield Departure("vehicle", (run.vehicle.name,), measured_vehicle())
    if _is_straight(run):
        yield Departure("maneuver", ("straight ahead",), "lane change")
    yield from _common_departures(run, _rows_of("D60/U1"), table)
    yield from _step_departures(run.steps.micro_step, math.nan, table)


def _flow(run: RunDescription, soil: str) -> Trust:
    flow = measured_errors()["flow"]
    code = getattr(run.hydrodynamics, "flow", None)
    if not isinstance(code, BuiltInFlow):
        advice = f"{type(code).__name__} is a flow code of your own, which exumob has compared with nothing."
        return Trust("flow in the loop", "not validated", "", soil, advice=advice)
    if not _same_vehicle(run.vehicle):
        advice = f"no run of this vehicle ({run.vehicle.name}) was repeated."
        return Trust("flow in the loop", "not validated", flow_load_error(), soil, advice=advice)
    error = (
        f"made again ({', '.join(flow['variants'])}), {flow['scenario']} ended within {_percent(flow['end'])} of the "
        f"path; {flow_load_error()}"
    )
    return Trust("flow in the loop", "measured", error, soil, (), flow["end"], flow["end"])


def _cheap(run: RunDescription, soil: str, water: Water) -> Trust:
    """Networks or coefficients, as if the run were like those that were measured."""
    table, model = measured_errors(), run.hydrodynamics
    name = "calibrated" if isinstance(model, CalibratedHydrodynamics) else "coefficients"
    if isinstance(model, SurrogateHydrodynamics):
        if (card := card_of(model.networks)) is not None:
            return _learnt(card, soil)
        shipped = _shipped(model)
        if shipped is None:
            advice = "networks of your own; compare them with runs that they have not learnt."
            return Trust("networks", "not validated", "", soil, advice=advice)
        name = shipped
    if isinstance(model, CalibratedHydrodynamics) and model.waves.digest() != fitted_coefficients().digest():
        advice = "coefficients fitted to other runs than those of exumob; a report card says how far they were off."
        return Trust(name, "not validated", "", soil, advice=advice)
    same, straight = _same_vehicle(run.vehicle), _is_straight(run)
    networks = isinstance(model, SurrogateHydrodynamics)
    rows = [row for row in table["runs"] if not (networks and row["taught_networks"])]
    scale = time_scale(run.vehicle) if straight and not same else 1.0  # speeds go with times, by Froude's law
    off = [scale * abs(row[name]["speed" if straight else "end"]) for row in rows]
    mean, worst = float(np.mean(off)), float(np.max(off))
    if straight:
        amount = f"the speed straight ahead is {mean:.2g} m/s (at worst {worst:.2g} m/s) from that with"
    else:
        amount = f"the path ends {_percent(mean)} of its length (at worst {_percent(worst)}) from that with"
    side, near = "", ""
    if not networks:
        side = _whither([row[name]["forward"] for row in rows], *(("fast", "slow") if straight else ("far", "short")))
        nearest = _nearest(run.vehicle, water, rows)
        if nearest is not None and same:
            at = nearest[name]
            number = f"{abs(at['speed']):.2g} m/s" if straight else _percent(at["end"])
            near = f"; {number} in {nearest['scenario']}, which is nearest"
    on = f"{len(rows)} {'runs' if straight else 'lane changes'}{' that they had not seen' if networks else ''}"
    taught = [row for row in table["runs"] if row["taught_networks"]]
    if name == "calibrated":
        on += f", to {len(taught)} of which it was fitted"
    which = "this vehicle" if same else f"the {measured_vehicle()} vehicle"
    which += ", speeds by Froude's law" if straight and not same else ""
    seen = ""
    if networks:
        ends = [abs(row[name]["speed" if straight else "end"]) for row in taught]
        worst_seen = f"{max(ends):.2g} m/s" if straight else _percent(max(ends))
        seen = f"; {len(taught)} that they had seen, {_ranges(taught)}: at worst {worst_seen}"
    error = f"{amount} the flow in the loop{side}{near} ({on}; {which}, {table['soil']}, {_ranges(rows)}{seen})."
    label = f"networks ({name})" if name in table["named"] else name
    if same:
        return Trust(label, "measured", error, soil, (), mean, worst, nearest=near)
    if networks:
        advice = f"this vehicle ({run.vehicle.name}) was never compared with the flow in the loop. Elsewhere"
    else:
        advice = (
            f"this vehicle ({run.vehicle.name}) is not the one that was compared with the flow in the loop; "
            f"{elsewhere_off(name)}. For the {measured_vehicle()} vehicle"
        )
    return Trust(label, "not validated", error, soil, advice=advice)


def _learnt(card: Mapping[str, Any], soil: str) -> Trust:
    """Networks that carry a report card (`exumob learn`), as if the run were like those of the card."""
    ends = [abs(float(one["end"])) for one in card["drives"]]
    drives = (
        f"{len(ends)} drive{'s' if len(ends) > 1 else ''} kept apart ended {_percent(float(np.mean(ends)))} of the "
        f"path (at worst {_percent(max(ends))}) from that with the flow in the loop"
        if ends
        else "no drive was compared with the flow in the loop"
    )
    inside = (
        f"{100.0 * card['inside']:.0f} % of them within two deviations of the ensemble"
        if card["members"] > 1
        else "without error bars, as one seed has none"
    )
    error = (
        f"{drives}; on {card['runs']} runs kept apart the loads were off by {card['load_error']:.2g} of their "
        f"deviation (worst {card['worst_load']}), {inside} ({card['vehicle']}, learnt from {card['seconds']:.0f} s of "
        f"flow on cells of {1e3 * card['cell_size']:.3g} mm, whose own error comes on top)."
    )
    if not ends:
        return Trust("networks", "not validated", error, soil, advice="their drives were never compared. Where known,")
    shares = [float(one["fallback"]) for one in card["drives"] if isinstance(one.get("fallback"), int | float)]
    share = float(np.mean(shares)) if shares else 0.0
    if share > MOSTLY:
        advice = f"the coefficients gave {100.0 * share:.0f} % of the loads in drives that were compared. In them,"
        return Trust("networks", "not validated", error, soil, advice=advice)
    return Trust("networks", "measured", error, soil, (), float(np.mean(ends)), max(ends))


def _card_departures(
    run: RunDescription, card: Mapping[str, Any], out_of_range: float | None, met: WaterMet | None
) -> Iterator[Departure]:
    """Find in what a run lies beyond what the card of its networks holds."""
    model = run.hydrodynamics
    yield from _water_departures(run, card, TRAINED_DENSITY, met, str(card["directions"]))
    yield from _coupling_departures(run)
    if not _published(run.soil, card["soil"]):
        yield Departure("soil", (run.soil.name or "of your own",), card["soil"])
    if not run.terrain.is_flat:
        yield Departure("terrain", ("not flat",), "flat")
    yield from _vehicle_departures(run.vehicle, card["parameters"])
    kinds = sorted({str(one.get("maneuver", "")) for one in card["drives"]})
    maneuver = run.maneuver
    kind = "lane change" if isinstance(maneuver, LaneChange) else type(maneuver).__name__
    if isinstance(maneuver, ConstantSteer):
        kind = "straight" if maneuver.angle == 0.0 else "circle"
    if kind not in kinds:
        yield Departure("maneuver", (kind,), ", ".join(kinds))
    longest = max(float(one["duration"]) for one in card["drives"])
    if run.steps.duration > longest * (1.0 + CLOSE):
        yield Departure("duration", (run.steps.duration,), f"{longest:g}", "s")
    if abs(run.initial_speed) > 1e-6:
        yield Departure("initial speed", (run.initial_speed,), "0", "m/s")
    if run.forces:
        yield Departure("forces of your own", (f"{len(run.forces)}",), "none")
    micro_step, macro_step = setting_named(DEFAULT_SETTING).steps(flow_in_loop=False)
    most = {"micro_step": micro_step, "macro_step": macro_step}
    yield from _step_departures(run.steps.micro_step, run.steps.longest_macro_step, most)
    if isinstance(model, SurrogateHydrodynamics) and not model.fallback:
        yield Departure("outside their range", ("networks alone",), "the calibrated coefficients take over")
    outside = [one["outside"] for one in card["drives"] if isinstance(one.get("outside"), int | float)]
    most_outside = max(outside, default=0.0)
    if out_of_range is not None and out_of_range > most_outside + 0.005:
        yield Departure(_RANGE, (100.0 * out_of_range,), f"{100.0 * most_outside:.2g}", "% of the time")


def _departures(
    run: RunDescription, out_of_range: float | None, fallback: float | None, met: WaterMet | None
) -> Iterator[Departure]:
    """Find in what a run lies beyond those that were measured with its model and vehicle."""
    table, model = measured_errors(), run.hydrodynamics
    if isinstance(model, SurrogateHydrodynamics) and (card := card_of(model.networks)) is not None:
        yield from _card_departures(run, card, out_of_range, met)
        return
    in_loop = isinstance(model, CfdHydrodynamics)
    rows = _rows_of(table["flow"]["scenario"]) if in_loop else table["runs"]
    ends = {name: [end(row[name] for row in rows) for end in (min, max)] for name in ("depth_ratio", "current_speed")}
    yield from _water_departures(run, ends, table["density"], met)
    yield from _common_departures(run, rows, table)
    yield from _coupling_departures(run)
    if in_loop:
        if _is_straight(run):
            yield Departure("maneuver", ("straight ahead",), "lane change")
        micro_step, macro_step = setting_named(DEFAULT_SETTING).steps(flow_in_loop=True)
        most = {"micro_step": micro_step, "macro_step": macro_step}
        yield from _step_departures(run.steps.micro_step, run.steps.longest_macro_step, most)
        code = getattr(model, "flow", None)
        size = float(getattr(code, "cell_size", math.nan))
        low, high = min(table["flow"]["cell_sizes"]), max(table["flow"]["cell_sizes"])
        if not low * (1.0 - CLOSE) <= size <= high * (1.0 + CLOSE):
            yield Departure("cells of", (1e3 * size,), _span(1e3 * low, 1e3 * high), "mm")
        return
    yield from _step_departures(run.steps.micro_step, run.steps.longest_macro_step, table)
    if isinstance(model, SurrogateHydrodynamics):
        name = _shipped(model) or "networks"
        together = len(_digests(name))
        if len(model.networks) < together:
            yield Departure("networks", (float(len(model.networks)),), f"{together} together")
        if not model.fallback:
            yield Departure("outside their range", ("networks alone",), "the calibrated coefficients take over")
        longest = max(row[name]["out_of_range"] for row in rows)
        if out_of_range is not None and out_of_range > longest + 0.005:
            yield Departure(_RANGE, (100.0 * out_of_range,), f"{100.0 * longest:.2g}", "% of the time")
    elif isinstance(model, CoefficientHydrodynamics) and model.parameters != type(model)().parameters:
        yield Departure("coefficients", ("of your own",), "those that come with exumob")


def _beyond_froude(run: RunDescription, met: WaterMet | None) -> Iterator[Departure]:
    """Find in what the water of another vehicle lies beyond that of the measured runs, by Froude's law."""
    table, scale = measured_errors(), time_scale(run.vehicle)
    ends = {
        name: [factor * end(row[name] for row in table["runs"]) for end in (min, max)]
        for name, factor in (("depth_ratio", 1.0), ("current_speed", scale))
    }
    yield from _water_departures(run, ends, table["density"], met)
    lowest = min(run.maneuver.wheel_speed(time)[0] for time in np.linspace(0.0, run.steps.duration, 50))
    if lowest < 0.0:
        yield Departure("reversing", (f"at {-lowest:.3g} rad/s",), "forwards")


def _common_departures(
    run: RunDescription, rows: Sequence[Mapping[str, Any]], table: Mapping[str, Any]
) -> Iterator[Departure]:
    """Find in what a run lies beyond those that were measured, in water or on dry ground."""
    if not _published(run.soil, table["soil"]):
        own = f"{run.soil.name} with other values" if run.soil.name == table["soil"] else run.soil.name
        yield Departure("soil", (own or "of your own",), table["soil"])
    if not run.terrain.is_flat:
        yield Departure("terrain", ("not flat",), "flat")
    yield from _vehicle_departures(run.vehicle, table["vehicle"])
    yield from _maneuver_departures(run, rows, table)
    if abs(run.initial_speed) > 1e-6:
        yield Departure("initial speed", (run.initial_speed,), "0", "m/s")
    if run.forces:
        yield Departure("forces of your own", (f"{len(run.forces)}",), "none")


_RANGE = "outside the networks' training range for"


def _coupling_departures(run: RunDescription) -> Iterator[Departure]:
    """Find in what the coupling with the water's loads differs from the usual one of its model."""
    usual = SemiImplicit if isinstance(run.hydrodynamics, CfdHydrodynamics) else Explicit
    if run.water is not None and type(run.coupling) is not usual:
        yield Departure("coupling", (type(run.coupling).__name__,), usual.__name__)
    if isinstance(run.hydrodynamics, SurrogateHydrodynamics | CoefficientHydrodynamics):
        held, measured = getattr(run.coupling, "within_step", None), Explicit().within_step
        if isinstance(run.coupling, Explicit) and run.water is not None and held != measured:
            yield Departure("loads within a step", (str(held),), measured)


def _water_departures(
    run: RunDescription, ranges: Mapping[str, Any], density: float, met: WaterMet | None, sides: str = "ahead"
) -> Iterator[Departure]:
    """Find in what the water lies beyond ranges of ``depth_ratio`` and ``current_speed``, and sides of the current."""
    water, diameter = run.water, run.vehicle.wheel.diameter
    if water is None:  # a dry run among wet ones
        yield Departure("depth ratio", (0.0,), _rounded(*ranges["depth_ratio"]))
        return
    depth: tuple[float, ...] = () if water.depth is None else (water.depth,)
    current: tuple[float, ...] = () if water.field is not None else (water.current_speed,)
    aside = abs(math.remainder(water.current_direction - run.start.heading - math.pi, 2.0 * math.pi))
    if water.depth is None:
        yield Departure("water", ("a level over terrain" if water.field is None else "a field",), "one depth")
    if met is not None:
        depth, current, aside = met.depth, met.current, met.aside
        yield from _assumed(run.hydrodynamics, met)
    for quantity, values, name, unit in (
        ("depth ratio", tuple(d / diameter for d in depth), "depth_ratio", ""),
        ("current", current, "current_speed", "m/s"),
    ):
        low, high = ranges[name]
        if any(not low - 1e-6 <= value <= high + 1e-6 for value in values):
            yield Departure(quantity, values, _rounded(low, high), unit)
    turned = min(aside, math.pi - aside) if sides == "along" else aside
    if max(current, default=0.0) > 0.0 and sides != "all" and math.degrees(turned) > 0.5:
        measured = "0" if sides == "ahead" else "0 or 180"
        yield Departure("current turned from ahead by", (math.degrees(aside),), measured, "deg")
    if not math.isclose(water.density, density, rel_tol=0.03):
        yield Departure("density", (water.density,), f"{density:g}", "kg/m³")


def _assumed(model: Hydrodynamics, met: WaterMet) -> Iterator[Departure]:
    """Find where a model assumes more of the water and the bed than it knows."""
    if met.level_difference > LEVEL_DIFFERENCE:
        yield Departure("level, taken as horizontal, over half the hull by", (1e3 * met.level_difference,), "0", "mm")
    if met.current_difference > CURRENT_DIFFERENCE and not isinstance(model, CfdHydrodynamics):
        how = "at the bodies' origins" if isinstance(model, SurrogateHydrodynamics) else "strip by strip"
        yield Departure(f"current, taken {how}, over half the hull by", (met.current_difference,), "0", "m/s")
    if isinstance(model, SurrogateHydrodynamics) and met.slope > 0.1 * SLOPE_RANGE:
        yield Departure("networks of level beds on a slope of", (met.slope,), "0")


def _vehicle_departures(vehicle: Vehicle, measured: Mapping[str, Any]) -> Iterator[Departure]:
    trained, present = _flat(measured), _plain(vehicle)
    for name, value in trained.items():
        if name != "name" and not (name in present and _same(present[name], value)):
            yield Departure(name, (_number(present[name]) if name in present else "of its own",), _number(value))


def _maneuver_departures(
    run: RunDescription, rows: Sequence[Mapping[str, Any]], table: Mapping[str, Any]
) -> Iterator[Departure]:
    maneuver = run.maneuver
    if isinstance(maneuver, LaneChange):
        angle = abs(math.degrees(maneuver.amplitude))
        low, high = (end(abs(row["steering_deg"]) for row in rows) for end in (min, max))
        if not low * (1.0 - CLOSE) <= angle <= high * (1.0 + CLOSE):
            yield Departure("steering", (angle,), _span(low, high), "deg")
        if not maneuver.end <= run.steps.duration <= table["duration"] * (1.0 + CLOSE):
            yield Departure("duration", (run.steps.duration,), f"{table['duration']:g}", "s")
        reference = LaneChange()
        if not math.isclose(maneuver.ramp_time, reference.ramp_time, rel_tol=0.05):
            yield Departure("ramp time", (maneuver.ramp_time,), f"{reference.ramp_time:g}", "s")
        if not np.allclose((maneuver.start, maneuver.end), (reference.start, reference.end), rtol=0.05):
            yield Departure("lane change", (f"from {maneuver.start:g} to {maneuver.end:g} s",), "2 to 5.5 s")
    elif isinstance(maneuver, ConstantSteer):
        if maneuver.angle != 0.0:
            yield Departure("constant steering", (math.degrees(maneuver.angle),), "0", "deg")
        ramp_time = ConstantSteer().ramp_time
        if not math.isclose(maneuver.ramp_time, ramp_time, rel_tol=0.05):
            yield Departure("ramp time", (maneuver.ramp_time,), f"{ramp_time:g}", "s")
        if run.steps.duration < table["straight_duration"] * (1.0 - CLOSE):
            yield Departure("duration", (run.steps.duration,), f"{table['straight_duration']:g}", "s")
    else:
        yield Departure("maneuver", (type(maneuver).__name__,), "lane change, straight ahead")
        return
    if not math.isclose(maneuver.speed, table["wheel_speed"], rel_tol=0.05):
        yield Departure("wheel speed", (maneuver.speed,), f"{table['wheel_speed']:g}", "rad/s")
    if maneuver.start_speed != 0.0:
        yield Departure("wheel speed at the start", (maneuver.start_speed,), "0", "rad/s")


def _step_departures(micro_step: float, macro_step: float, table: Mapping[str, Any]) -> Iterator[Departure]:
    for quantity, value in (("micro_step", micro_step), ("macro_step", macro_step)):
        if value > table[quantity] * (1.0 + CLOSE):
            yield Departure(quantity.replace("_", " "), (1e3 * value,), f"{1e3 * table[quantity]:g}", "ms")


def _merged(departures: Iterable[Departure]) -> list[Departure]:
    found: dict[str, Departure] = {}
    for one in departures:
        known = found.get(one.quantity)
        found[one.quantity] = one if known is None else replace(known, values=(*known.values, *one.values))
    return list(found.values())


def _what_to_believe(out_of_range: float, fallback: float, shipped: bool) -> str:
    """Say what to make of a run that was outside the networks' training range for a part of the time."""
    if fallback < 0.005:
        return (
            "It left the range so little that the networks answered alone, extrapolating by less than a tenth of it: "
            "expect more than the measured error."
        )
    alone = f"; alone, in what was measured, they ended {fitted_off()}" if shipped else ""
    return f"The coefficients that they rest on gave {100.0 * fallback:.0f} % of the loads{alone}. Expect more."


# -- what a run is -----------------------------------------------------------------------------------------------------


def _rows_of(scenario: str) -> list[Mapping[str, Any]]:
    return [row for row in measured_errors()["runs"] if row["scenario"] == scenario]


def _is_straight(run: RunDescription) -> bool:
    return isinstance(run.maneuver, ConstantSteer) and run.maneuver.angle == 0.0


def _shipped(model: SurrogateHydrodynamics) -> str | None:
    """Name under which the table holds the errors of networks; None if it does not: they are the user's own."""
    found = {network.digest() for network in model.networks}
    return next((name for name in ("networks", *measured_errors()["named"]) if found <= _digests(name)), None)


def _digests(name: str) -> set[str]:
    """Digests of the networks that come with exumob: ``"networks"``, the default ensemble, or those with a name."""
    table = measured_errors()
    return set(table["networks"] if name == "networks" else table["named"][name])


def _same_vehicle(vehicle: Vehicle) -> bool:
    """Whether a vehicle has the shape of the one that was measured; its mass, say, may differ."""
    measured, present = _flat(measured_errors()["vehicle"]), _plain(vehicle)
    return all(_same(present.get(name), measured.get(name)) for name in GEOMETRY)


def _published(soil: Soil, name: str) -> bool:
    return soil.name == name and soil == Soil.published(name)


def _soil_line(runs: Sequence[RunDescription]) -> str:
    """Say what the forces of the soil rest on."""
    wheel = measured_errors()["soil_forces"]
    names = list(dict.fromkeys(run.soil.name or "soil" for run in runs))
    named = ", ".join(names[:2]) + (f" and {len(names) - 2} more" if len(names) > 2 else "")
    own = any(not _is_published(run.soil) for run in runs)
    flat = all(run.terrain.is_flat for run in runs)
    return (
        f"Soil: {'your own' if own else 'published'} values ({named}), {'flat' if flat else 'given terrain'}; "
        f"{_percents(wheel['error_low'], wheel['error_high'])} of the load off on one measured wheel, up to "
        f"{wheel['side_slip_deg']:g} deg of side slip.{_soil_under_water(runs)}"
    )


def _soil_under_water(runs: Sequence[RunDescription]) -> str:
    """Say at which moisture a published soil that is under water was measured."""
    wet = {run.soil.name for run in runs if run.water is not None and _is_published(run.soil)}
    said = [f"{row.name} {row.under_water}" for row in Soil.published_table() if row.name in wet]
    if not said:
        return ""
    more = f", and {len(said) - 1} more likewise" if len(said) > 1 else ""
    return f" Under water soil is saturated: {said[0]}{more}."


def _is_published(soil: Soil) -> bool:
    try:
        return soil == Soil.published(soil.name)
    except ValueError:
        return False


def _nearest(vehicle: Vehicle, water: Water, rows: Sequence[Mapping[str, Any]]) -> Mapping[str, Any] | None:
    """Find the measured run whose water is nearest, if it is near: within half the spacing of the measured ones."""
    if water.depth is None:
        return None
    depth = water.depth / vehicle.wheel.diameter
    away = [math.hypot((row["depth_ratio"] - depth) / 0.1, (row["current_speed"] - water.current_speed) / 0.5)
            for row in rows]  # fmt: skip
    nearest = int(np.argmin(away))
    return rows[nearest] if away[nearest] <= 0.5 else None


def _plain(vehicle: Vehicle) -> dict[str, Any]:
    found = _flat(json.loads(json.dumps(asdict(vehicle), default=str)))
    return found | {"hull.mesh": found["hull.mesh"] or further_shape(vehicle)}


def _flat(nested: Mapping[str, Any], before: str = "") -> dict[str, Any]:
    found: dict[str, Any] = {}
    for name, value in nested.items():
        found |= _flat(value, f"{before}{name}.") if isinstance(value, Mapping) else {f"{before}{name}": value}
    return found


def _same(value: Any, other: Any) -> bool:
    if isinstance(value, list) and isinstance(other, list):
        return len(value) == len(other) and all(map(_same, value, other))
    numbers = isinstance(value, int | float) and isinstance(other, int | float)
    return math.isclose(value, other, rel_tol=CLOSE, abs_tol=1e-9) if numbers else bool(value == other)


# -- words -------------------------------------------------------------------------------------------------------------


def _number(value: Any) -> str:
    if value is None:
        return "none"
    return f"{value:.4g}" if isinstance(value, int | float) else str(value)


def _span(low: float, high: float) -> str:
    return f"{low:g}" if low == high else f"{low:g} to {high:g}"


def _rounded(low: float, high: float) -> str:
    return _span(float(f"{low:.3g}"), float(f"{high:.3g}"))


def _percent(share: float) -> str:
    return f"{100.0 * share:.2g} %" if share >= 1e-3 else "less than 0.1 %"


def _percents(low: float, high: float) -> str:
    return f"{100.0 * low:.2g} to {100.0 * high:.2g} %"


def _whither(errors: Sequence[float], more: str = "far", less: str = "short") -> str:
    """Say to which side errors lie, if all lie to one."""
    if all(e > 0.0 for e in errors):
        return f", always too {more}"
    return f", always too {less}" if all(e < 0.0 for e in errors) else ""


def _ranges(rows: Sequence[Mapping[str, Any]]) -> str:
    depth, current = ([row[name] for row in rows] for name in ("depth_ratio", "current_speed"))
    return f"depth ratio {_span(min(depth), max(depth))}, current {_span(min(current), max(current))} m/s from ahead"
