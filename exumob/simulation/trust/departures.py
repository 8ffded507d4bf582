"""In what a run lies beyond the runs whose errors were measured."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from exumob.coupling.explicit import Explicit
from exumob.coupling.flow_in_loop import CfdHydrodynamics
from exumob.coupling.semi_implicit import SemiImplicit
from exumob.driving.maneuver import ConstantSteer, LaneChange, Maneuver
from exumob.driving.named import driven
from exumob.simulation.description import RunDescription
from exumob.simulation.over_water import WaterMet
from exumob.simulation.settings import DEFAULT_SETTING, setting_named, time_scale
from exumob.simulation.trust.measured_runs import (
    digests_of,
    is_measured_vehicle,
    is_straight,
    measured_vehicle,
    rows_of,
    shipped_name,
    waves_of_networks,
)
from exumob.simulation.trust.soil_line import is_published_as
from exumob.support.measured import measured_errors
from exumob.support.wording import number, rounded_span, span
from exumob.surrogates.ensemble import card_of
from exumob.surrogates.model import SLOPE_RANGE, SurrogateHydrodynamics
from exumob.surrogates.networks import TRAINED_DENSITY
from exumob.surrogates.vehicle_shape import CLOSE, flat, plain_parameters, same_value
from exumob.vehicle.parameters import Vehicle
from exumob.water.calibrated import CalibratedHydrodynamics
from exumob.water.coefficients import CoefficientHydrodynamics
from exumob.water.hydrodynamics import Hydrodynamics

OUTSIDE_RANGE = "outside the networks' training range for"
"""Quantity of runs that left the range of their networks."""
OF_WATER = (OUTSIDE_RANGE, "depth ratio", "current", "current turned from ahead by")
"""Quantities of the water, and whether networks know it."""
NEAR = {"depth_ratio": 0.05, "current_speed": 0.1}
"""How near the range of a card's drives, which are few, counts as within it [-, m/s]."""
NEAR_ANGLE = 20.0
"""The same of the angle from which one of their currents came [deg]."""
LEVEL_DIFFERENCE = 1e-3
"""Difference of the water's level over half the hull's length from which it is named [m]."""
CURRENT_DIFFERENCE = 0.01
"""Difference of the current over half the hull's length from which it is named [m/s]."""


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


def departures_of(
    run: RunDescription, out_of_range: float | None, met: WaterMet | None, card: Mapping[str, Any] | None = None
) -> Iterator[Departure]:
    """Find in what a run lies beyond those that were measured with its model and vehicle.

    With a card of networks, these are the drives of the card; without, those of the table.
    """
    table, model = measured_errors(), run.hydrodynamics
    if card is not None:
        yield from _card_departures(run, card, out_of_range, met)
        return
    in_loop = isinstance(model, CfdHydrodynamics)
    rows = rows_of(table["flow"]["scenario"]) if in_loop else table["runs"]
    ends = {name: [end(row[name] for row in rows) for end in (min, max)] for name in ("depth_ratio", "current_speed")}
    yield from _water_departures(run, ends, table["density"], met)
    yield from _common_departures(run, rows, table)
    yield from _coupling_departures(run)
    if in_loop:
        if is_straight(run):
            yield Departure("maneuver", ("straight ahead",), "lane change")
        micro_step, macro_step = setting_named(DEFAULT_SETTING).steps(flow_in_loop=True)
        most = {"micro_step": micro_step, "macro_step": macro_step}
        yield from _step_departures(run.steps.micro_step, run.steps.longest_macro_step, most)
        code = getattr(model, "flow", None)
        size = float(getattr(code, "cell_size", math.nan))
        low, high = min(table["flow"]["cell_sizes"]), max(table["flow"]["cell_sizes"])
        if not low * (1.0 - CLOSE) <= size <= high * (1.0 + CLOSE):
            yield Departure("cells of", (1e3 * size,), span(1e3 * low, 1e3 * high), "mm")
        return
    yield from _step_departures(run.steps.micro_step, run.steps.longest_macro_step, table)
    if isinstance(model, SurrogateHydrodynamics):
        name = shipped_name(model) or "networks"
        together = len(digests_of(name))
        if len(model.networks) < together:
            yield Departure("networks", (float(len(model.networks)),), f"{together} together")
        if not model.fallback:
            yield Departure("outside their range", ("networks alone",), "the calibrated coefficients take over")
        longest = max(row[name]["out_of_range"] for row in rows)
        if out_of_range is not None and out_of_range > longest + 0.005:
            yield Departure(OUTSIDE_RANGE, (100.0 * out_of_range,), f"{100.0 * longest:.2g}", "% of the time")
    elif isinstance(model, CoefficientHydrodynamics) and not _measured_coefficients(model):
        yield Departure("coefficients", ("of your own",), "those that come with exumob")


def _measured_coefficients(model: CoefficientHydrodynamics) -> bool:
    """Whether coefficients are those that come with exumob, or those that its networks rest on."""
    if model.parameters == type(model)().parameters:
        return True
    if not isinstance(model, CalibratedHydrodynamics) or model.waves.digest() != waves_of_networks():
        return False
    return bool(model.parameters == CalibratedHydrodynamics(waves=model.waves).parameters)


def dry_departures(run: RunDescription, table: Mapping[str, Any]) -> Iterator[Departure]:
    """Find in what a run on dry ground lies beyond the one that was measured."""
    if not is_measured_vehicle(run.vehicle):
        yield Departure("vehicle", (run.vehicle.name,), measured_vehicle())
    if is_straight(run):
        yield Departure("maneuver", ("straight ahead",), "lane change")
    yield from _common_departures(run, rows_of("D60/U1"), table)
    yield from _step_departures(run.steps.micro_step, math.nan, table)


def departures_by_froude(
    run: RunDescription, met: WaterMet | None, card: Mapping[str, Any] | None = None
) -> Iterator[Departure]:
    """Find in what the water of another vehicle lies beyond that of the measured runs, by Froude's law.

    With a card of networks these are its drives; of coefficients, those and the runs of the table.
    """
    table, scale = measured_errors(), time_scale(run.vehicle)
    ends, sides = {}, "ahead" if card is None else str(card["directions"])
    for name, factor in (("depth_ratio", 1.0), ("current_speed", scale)):
        known: list[float] = [] if card is None else driven_in(card)[name]
        if card is None or isinstance(run.hydrodynamics, CoefficientHydrodynamics):
            known = [*known, *(row[name] for row in table["runs"])]
        ends[name] = [factor * end(known) for end in (min, max)]
    if card is not None:
        ends["current_turned"] = driven_in(card)["current_turned"]
    yield from _water_departures(run, ends, table["density"], met, sides)
    lowest = min(run.maneuver.wheel_speed(time)[0] for time in np.linspace(0.0, run.steps.duration, 50))
    if lowest < 0.0:
        yield Departure("reversing", (f"at {-lowest:.3g} rad/s",), "forwards")


def driven_in(card: Mapping[str, Any]) -> dict[str, list[float]]:
    """Waters of the drives of a card: ranges of depth ratio and current, and angles from which currents came [deg].

    Where the drives do not say it, the ranges are those of the runs that taught, and there are no angles.
    """
    found = {}
    for name in ("depth_ratio", "current_speed", "current_turned"):
        found[name] = [float(one[name]) for one in card["drives"] if isinstance(one.get(name), int | float)]
    for name in ("depth_ratio", "current_speed"):
        values = found[name] or card[name]
        found[name] = [min(values), max(values)]
    return found


def merged(departures: Iterable[Departure]) -> list[Departure]:
    """Name every quantity once, with the values of all runs."""
    found: dict[str, Departure] = {}
    for one in departures:
        known = found.get(one.quantity)
        found[one.quantity] = one if known is None else replace(known, values=(*known.values, *one.values))
    return list(found.values())


def _card_departures(
    run: RunDescription, card: Mapping[str, Any], out_of_range: float | None, met: WaterMet | None
) -> Iterator[Departure]:
    """Find in what a run lies beyond what the card of its networks holds."""
    model = run.hydrodynamics
    yield from _water_departures(run, driven_in(card), TRAINED_DENSITY, met, str(card["directions"]))
    yield from _coupling_departures(run)
    if not any(is_published_as(run.soil, soil) for soil in card["soils"]):
        yield Departure("soil", (run.soil.name or "of your own",), ", ".join(card["soils"]))
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
    times = [float(one["duration"]) for one in card["drives"]]
    if not min(times) * (1.0 - CLOSE) <= run.steps.duration <= max(times) * (1.0 + CLOSE):
        yield Departure("duration", (run.steps.duration,), span(min(times), max(times)), "s")
    yield from _driving_departures(maneuver, card["drives"])
    if abs(run.initial_speed) > 1e-6:
        yield Departure("initial speed", (run.initial_speed,), "0", "m/s")
    if run.forces:
        yield Departure("forces of your own", (f"{len(run.forces)}",), "none")
    micro_step, macro_step = setting_named(DEFAULT_SETTING).steps(flow_in_loop=False)
    most = {"micro_step": micro_step, "macro_step": macro_step}
    yield from _step_departures(run.steps.micro_step, run.steps.longest_macro_step, most)
    assert isinstance(model, SurrogateHydrodynamics)
    beyond = model.beyond if card_of(model.networks, some=True) is None else None  # whose card it is
    count = len((beyond or model).networks)
    if count < card["members"]:
        yield Departure("networks", (float(count),), f"{card['members']} together")
    if not model.fallback:
        yield Departure("outside their range", ("networks alone",), "coefficients take over")
    outside = [one["outside"] for one in card["drives"] if isinstance(one.get("outside"), int | float)]
    most_outside = max(outside, default=0.0)
    if out_of_range is not None and out_of_range > most_outside + 0.005:
        yield Departure(OUTSIDE_RANGE, (100.0 * out_of_range,), f"{100.0 * most_outside:.2g}", "% of the time")


def _driving_departures(maneuver: Maneuver, drives: Sequence[Mapping[str, Any]]) -> Iterator[Departure]:
    """Find in what a maneuver is driven harder than those of a card; cards of before do not say how theirs were."""
    if not isinstance(maneuver, LaneChange | ConstantSteer) or not all("wheel_speed" in one for one in drives):
        return
    angle, wheels = driven(maneuver)
    most, speeds = max(float(one["steering"]) for one in drives), [float(one["wheel_speed"]) for one in drives]
    if angle > most * (1.0 + CLOSE):
        yield Departure("steering", (math.degrees(angle),), f"{math.degrees(most):.3g}", "deg")
    if not any(math.isclose(wheels, speed, rel_tol=0.05) for speed in speeds):
        yield Departure("wheel speed", (wheels,), span(min(speeds), max(speeds)), "rad/s")
    if maneuver.start_speed != 0.0:
        yield Departure("wheel speed at the start", (maneuver.start_speed,), "0", "rad/s")


def _common_departures(
    run: RunDescription, rows: Sequence[Mapping[str, Any]], table: Mapping[str, Any]
) -> Iterator[Departure]:
    """Find in what a run lies beyond those that were measured, in water or on dry ground."""
    if not is_published_as(run.soil, table["soil"]):
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
        yield Departure("depth ratio", (0.0,), rounded_span(*ranges["depth_ratio"]))
        return
    depth: tuple[float, ...] = () if water.depth is None else (water.depth,)
    current: tuple[float, ...] = () if water.field is not None else (water.current_speed,)
    aside = abs(math.remainder(water.current_direction - run.start.heading - math.pi, 2.0 * math.pi))
    if water.depth is None:
        yield Departure("water", ("a level over terrain" if water.field is None else "a field",), "one depth")
    if met is not None:
        depth, current, aside = (max(met.depth),), met.current, met.aside  # at a shore there is none
        yield from _assumed(run.hydrodynamics, met)
    for quantity, values, name, unit in (
        ("depth ratio", tuple(d / diameter for d in depth), "depth_ratio", ""),
        ("current", current, "current_speed", "m/s"),
    ):
        low, high = ranges[name]
        near = 1e-6 if ranges.get("current_turned") is None else NEAR[name]  # drives of a card are few
        if any(not low - near <= value <= high + near for value in values):
            yield Departure(quantity, values, rounded_span(low, high), unit)
    angles = ranges.get("current_turned")
    flows = max(current, default=0.0) > 0.0
    turned = min(aside, math.pi - aside) if sides == "along" else aside
    if flows and angles:
        if min(abs(math.degrees(aside) - angle) for angle in angles) > NEAR_ANGLE:
            tried = ", ".join(f"{angle:g}" for angle in sorted({round(angle) for angle in angles}))
            yield Departure("current turned from ahead by", (math.degrees(aside),), tried, "deg")
    elif flows and sides != "all" and math.degrees(turned) > 0.5:
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
    trained, present = flat(measured), plain_parameters(vehicle)
    for name, value in trained.items():
        if name != "name" and not (name in present and same_value(present[name], value)):
            yield Departure(name, (number(present[name]) if name in present else "of its own",), number(value))


def _maneuver_departures(
    run: RunDescription, rows: Sequence[Mapping[str, Any]], table: Mapping[str, Any]
) -> Iterator[Departure]:
    maneuver = run.maneuver
    if isinstance(maneuver, LaneChange):
        angle = abs(math.degrees(maneuver.amplitude))
        low, high = (end(abs(row["steering_deg"]) for row in rows) for end in (min, max))
        if not low * (1.0 - CLOSE) <= angle <= high * (1.0 + CLOSE):
            yield Departure("steering", (angle,), span(low, high), "deg")
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
