"""A ford as a figure: the section with the vehicle on its way, and below it what befell it along the station."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon

from exumob.mobility.ford import Ford, FordReport, member_stations, stations
from exumob.simulation.plotting import MEMBER_COLOR, at_places, draw_range, water_label
from exumob.simulation.verdict import wheel_load_share
from exumob.support.figures import (
    BODY_COLOR,
    SOIL_COLOR,
    STYLE,
    WATER_COLOR,
    footnote,
    legend_above_curves,
    trust_notes,
)
from exumob.vehicle.motion import WHEELS

INSTANTS = 5
"""Times at which the vehicle is drawn, at most."""
LEAST_DRIFT = 0.02
"""Smallest vertical range of the panel of the drift [m], so that rounding errors do not fill it."""
APART = 1.15
"""Least distance between two of them, in lengths of the vehicle."""


def plot_ford(run: xr.Dataset, ford: Ford, report: FordReport) -> Figure:
    """Draw one drive through a ford on one page.

    Above, the section from the side, true to scale, with bed, still water and the vehicle at some instants. Below,
    along the station of the middle between its wheels: depth and speed, share of the weight on the wheels, slip, drift
    from the path, this with the range of an ensemble's members if the run has them.

    Parameters
    ----------
    run : xarray.Dataset
        Result of `Ford.drive`.
    ford : Ford
    report : FordReport
        The report on it (`exumob.mobility.ford.ford_report`).
    """
    end = report.last + 1
    driven = run.isel(time=slice(end))
    place = stations(driven)
    front, rear = ford.overhangs
    low = min(ford.start.x, float(place.min())) - 1.2 * rear
    high = max(ford.edges[1] + 2.0 * rear, float(place.max())) + 1.2 * front
    with plt.rc_context(STYLE):
        heights = _heights(driven, ford, low, high)
        # [inches]: a little more than its share, so that its width is that of the panels below
        tall = float(np.clip(11.0 * (heights[1] - heights[0]) / (high - low), 1.5, 4.0))
        figure, (side, depth, load, slip, drift) = plt.subplots(
            5, 1, figsize=(11.0, tall + 8.3), height_ratios=[tall, 1.7, 1.7, 1.5, 1.5], sharex=True,
            layout="constrained",
        )  # fmt: skip
        figure.suptitle(
            f"{ford.vehicle.name} on {ford.soil.name or 'soil'}, {water_label(driven)}: "
            + ("crosses" if report.crosses else f"does not cross ({report.kind})"),
            fontsize=10, fontweight="bold", color="C2" if report.crosses else "C3",
        )  # fmt: skip
        side.set_xlim(low, high)
        side.set_ylim(*heights)
        side.set_aspect("equal", adjustable="box")
        side.set(ylabel="height [m]")
        side.set_title("The section, true to scale, and the vehicle on its way", loc="left")
        _draw_section(side, ford, low, high)
        for k in _instants(place, APART * (front + rear)):
            _draw_vehicle(side, driven, ford, k)
        _below(depth, load, slip, driven, ford, place)
        _draw_drift(drift, driven, run, ford, place)
        for axes in (depth, load, slip, drift):
            for edge in ford.edges:
                axes.axvline(edge, color=WATER_COLOR, lw=0.8, ls=":")
            if not report.crosses:
                axes.axvline(report.station, color="C3", lw=0.9, ls="--")
        drift.set_xlabel("station [m]")
        footnote(figure, _wrapped(report), *trust_notes([run]))
    return figure


def _wrapped(report: FordReport) -> str:
    return report.sentence[0].upper() + report.sentence[1:] + "."


def _ground(ford: Ford, station: np.ndarray) -> np.ndarray:
    return np.interp(station, np.asarray(ford.section.station, float), np.asarray(ford.section.bed, float))


def _heights(run: xr.Dataset, ford: Ford, low: float, high: float) -> tuple[float, float]:
    """Lowest and highest world z that is shown [m]."""
    bed = _ground(ford, np.linspace(low, high, 400))
    hull = ford.vehicle.hull
    top = float(np.nanmax(run["position"].sel(body="hull", axis="z").values))
    top += float(hull.extent[1][2]) - hull.center_of_mass_height
    steepest = float(np.nanmax(np.abs(np.sin(run["pitch"].sel(body="hull").values))))
    top += 0.5 * float(np.ptp(hull.extent, axis=0)[0]) * steepest
    room = 0.12 * (max(top, bed.max()) - bed.min())
    return float(bed.min()) - room, float(max(top, bed.max(), ford.level)) + room


def _draw_section(axes: Axes, ford: Ford, low: float, high: float) -> None:
    station = np.unique([*np.linspace(low, high, 400), *np.asarray(ford.section.station, float)])
    bed = _ground(ford, station)
    axes.fill_between(station, bed, bed.min() - 1e3, color=SOIL_COLOR, lw=0.0, zorder=1)
    wet = np.maximum(bed, ford.level)
    axes.fill_between(station, bed, wet, where=bed < ford.level, color=WATER_COLOR, alpha=0.45, lw=0.0, zorder=5)
    for near, far in ford.section.wetted(ford.level):
        axes.plot([near, far], [ford.level] * 2, color=WATER_COLOR, lw=1.4, zorder=6)


def _instants(place: np.ndarray, apart: float) -> list[int]:
    """Instants at which the vehicle is drawn: the first, the last and some between, none on top of another."""
    wanted = np.linspace(place[0], place[-1], INSTANTS)
    found: list[int] = []
    for n in [0, len(place) - 1, *(int(np.argmin(np.abs(place - x))) for x in wanted[1:-1])]:
        if all(abs(place[n] - place[k]) >= apart for k in found):
            found.append(n)
    return sorted(found)


def _draw_vehicle(axes: Axes, run: xr.Dataset, ford: Ford, index: int) -> None:
    """Draw hull and right-hand wheels from starboard at one instant, with its time above."""
    hull = ford.vehicle.hull
    place = run["position"].values[index]
    pitch = float(run["pitch"].values[index, 0])
    c, s = np.cos(pitch), np.sin(pitch)
    highest = -np.inf
    for part in hull.parts:
        profile = part.side_profile() - [hull.center_of_mass_x, hull.center_of_mass_height]
        outline = profile @ np.array([[c, -s], [s, c]]) + place[0, [0, 2]]
        highest = max(highest, float(outline[:, 1].max()))
        axes.add_patch(Polygon(outline, closed=True, fc="C0", ec=BODY_COLOR, lw=0.7, alpha=0.75, zorder=3))
    for k, name in enumerate(WHEELS):
        if name.endswith("right"):
            axes.add_patch(
                Circle(tuple(place[1 + k, [0, 2]]), ford.vehicle.wheel.radius, fc="0.3", ec="k", lw=0.6, zorder=4)
            )
    axes.annotate(
        f"{float(run['time'][index]):.1f} s", (place[0, 0], highest), (0.0, 2.0), textcoords="offset points",
        ha="center", fontsize=7, zorder=7,
    )  # fmt: skip


def _below(depth: Axes, load: Axes, slip: Axes, run: xr.Dataset, ford: Ford, place: np.ndarray) -> None:
    """Draw depth and speed, wheel loads and slip along the station."""
    depth.plot(place, run["water_depth"], color=WATER_COLOR, label="depth below the hull [m]")
    speed = depth.twinx()
    speed.spines["right"].set_visible(True)
    speed.grid(visible=False)
    speed.plot(place, run["forward_velocity"], color="C1", label="speed [m/s]")
    speed.axhline(ford.tread_speed, color="C1", lw=0.7, ls=":", label="speed of the tyres' tread [m/s]")
    depth.set(ylabel="depth [m]", ylim=(0.0, 1.35 * max(ford.section.greatest_depth(ford.level), 1e-3)))
    top = max(ford.tread_speed, float(np.nanmax(run["forward_velocity"].values)))
    speed.set(ylabel="speed [m/s]", ylim=(min(0.0, float(np.nanmin(run["forward_velocity"].values))), 1.35 * top))
    lines = [*depth.get_lines()[:1], *speed.get_lines()]
    depth.legend(lines, [str(line.get_label()) for line in lines], ncols=3, loc="upper right")

    load.plot(place, 100.0 * wheel_load_share(run, ford.vehicle), color=BODY_COLOR, lw=1.6, label="all wheels")
    weight = -float(run["gravity_load"].isel(time=0).sel(axis="z").sum())
    for k, name in enumerate(WHEELS):
        share = 100.0 * run["soil_force"].sel(wheel=name, axis="z") / weight
        load.plot(place, share, color=f"C{k}", lw=0.8, label=name.replace("_", " "))
    if float(run["hull_load_share"].max()) > 0.0:
        load.plot(place, 100.0 * run["hull_load_share"], color="k", ls="--", lw=1.0, label="hull")
    load.set(ylabel="share of weight [%]", ylim=(min(0.0, load.get_ylim()[0]), 1.3 * load.get_ylim()[1]))
    load.legend(ncols=6, loc="upper right")

    at_speed = run["time"].values >= ford.maneuver.ramp_time
    for k, name in enumerate(WHEELS):
        ratio = np.where(at_speed, 100.0 * run["slip_ratio"].sel(wheel=name).values, np.nan)
        slip.plot(place, ratio, color=f"C{k}", lw=0.8)
    slip.set(ylabel="slip [%]")


def _draw_drift(axes: Axes, driven: xr.Dataset, run: xr.Dataset, ford: Ford, place: np.ndarray) -> None:
    """Draw the hull's displacement to the left of the path, and the range of the members where there are any.

    These are taken from the whole run: those behind are still under way when the others are out.
    """
    axes.plot(place, driven["position"].sel(body="hull", axis="y"), color="C0", lw=1.6)
    axes.set(ylabel="drift to the left [m]")
    if "member_position" not in run:
        low, high = axes.get_ylim()
        middle, half = 0.5 * (low + high), max(0.5 * (high - low), 0.5 * LEAST_DRIFT)
        axes.set_ylim(middle - half, middle + half)
        return
    axes.get_lines()[0].set_label("mean of the networks' loads")
    wanted = np.linspace(place.min(), place.max(), 300)
    members = run["member_position"].sel(axis="y").values
    alone = [
        at_places(station, member, wanted)
        for station, member in zip(member_stations(run, ford), members, strict=True)
    ]  # fmt: skip
    for n, member in enumerate(alone):
        label = f"each of the {len(alone)} networks alone" if n == 0 else None
        axes.plot(wanted, member, color=MEMBER_COLOR, lw=0.6, label=label)
    draw_range(axes, wanted, np.array(alone))
    legend_above_curves(axes, 3, LEAST_DRIFT)
