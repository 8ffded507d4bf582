"""Figures of runs: functions that take axes and a result Dataset and return the artists they draw."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from matplotlib.text import OffsetFrom
from scipy.spatial.transform import Rotation

from exumob.ground.terrain import Terrain
from exumob.simulation.water_models import NAMES
from exumob.support.arrays import Array
from exumob.support.figures import BODY_COLOR, STYLE, WATER_COLOR, footnote, legend_above_curves, trust_notes
from exumob.vehicle.motion import WHEELS

MEMBER_COLOR = "0.2"
"""Colour of the members of an ensemble."""
BAND_COLOR = "#f5c04a"
"""Colour of the band between the outermost of them, which stands out from hull, water and soil."""
BAND = "range of these"
"""How a legend names the band between the outermost members, after the members themselves."""


def _parameters(dataset: xr.Dataset, name: str) -> dict[str, Any]:
    stored = json.loads(dataset.attrs["parameters"])[name]
    return {} if stored is None else next(iter(stored.values()))


def scenario_name(dataset: xr.Dataset) -> str:
    """Name of a run's water as in the paper: "D60/U1" (depth in % of the tyre diameter), or "no water".

    Of water that differs from place to place it names the greatest depth and current: "up to D60/U0.3".
    """
    water = _parameters(dataset, "water")
    if not water:
        return "no water"
    diameter = _parameters(dataset, "vehicle")["wheel"]["diameter"]
    if "depth" in water:
        return f"D{100 * water['depth'] / diameter:.0f}/U{water['current_speed']:g}"
    wet = dataset["water_depth"].values > 0.0
    speed = np.hypot(*dataset["current"].values[:, :2].T)[wet].max(initial=0.0)
    return f"up to D{100 * float(dataset['water_depth'].max()) / diameter:.0f}/U{speed:.2g}"


def water_label(dataset: xr.Dataset) -> str:
    """Scenario and model of the water's loads in words: "D60/U1, networks", or "no water"."""
    model = dataset.attrs["hydrodynamics"]
    return ", ".join(dict.fromkeys([scenario_name(dataset), NAMES.get(model, model)]))


def stored_terrain(dataset: xr.Dataset) -> Terrain:
    """Terrain of a run, from its parameters."""
    given = _parameters(dataset, "terrain")
    return Terrain(**(given | {name: tuple(given[name]) for name in ("origin", "spacing") if name in given}))


def vehicle_outlines(dataset: xr.Dataset, index: int) -> list[Array]:
    """Corners of hull and wheels seen from above at one instant, world [m]: five arrays of shape (n, 2)."""
    vehicle = _parameters(dataset, "vehicle")
    hull, wheel = vehicle["hull"], vehicle["wheel"]
    middle = hull["center_x"] - hull["center_of_mass_x"]
    half, bow = 0.5 * hull["length"], 0.35 * hull["bow_length"]
    side = 0.5 * hull["width"]
    starboard = np.array([[-half, -side], [half - bow, -side], [half, -0.6 * side]])
    shapes = [np.concatenate([starboard, starboard[::-1] * np.array([1.0, -1.0])]) + np.array([middle, 0.0])]
    r, w = 0.5 * wheel["diameter"], 0.5 * wheel["width"]
    shapes += [np.array([[-r, -w], [r, -w], [r, w], [-r, w]])] * 4
    position = dataset["position"].values[index, :, :2]
    yaw = dataset["yaw"].values[index]
    outlines = []
    for shape, origin, angle in zip(shapes, position, yaw, strict=True):
        c, s = np.cos(angle), np.sin(angle)
        outlines.append(shape @ np.array([[c, s], [-s, c]]) + origin)
    return outlines


def path_limits(dataset: xr.Dataset, instants: int = 60) -> tuple[float, float, float, float]:
    """Smallest and largest x, smallest and largest y [m] that hull and wheels reach at any time, seen from above."""
    rows = np.unique(np.linspace(0, dataset.sizes["time"] - 1, instants).round().astype(int))
    corners = np.concatenate([outline for row in rows for outline in vehicle_outlines(dataset, int(row))])
    paths = [dataset["position"].sel(body="hull").values[:, :2]]
    if "member_position" in dataset:
        paths += list(dataset["member_position"].values[:, :, :2])
    points = np.concatenate([corners, *paths])
    points = points[np.isfinite(points).all(axis=1)]
    (x_low, y_low), (x_high, y_high) = points.min(axis=0), points.max(axis=0)
    return float(x_low), float(x_high), float(y_low), float(y_high)


def frame_path(axes: Axes, dataset: xr.Dataset, ratio: float = 0.0) -> None:
    """Set the limits of axes seen from above so that the whole vehicle is in them at any time.

    Parameters
    ----------
    axes : Axes
    dataset : xarray.Dataset
    ratio : float
        Least width of the axes over their height [-]: narrow paths get more room to both sides.
    """
    x_low, x_high, y_low, y_high = path_limits(dataset)
    margin = 0.05 * max(x_high - x_low, y_high - y_low)
    height = y_high - y_low + 2.0 * margin
    aside = max(margin, 0.5 * (ratio * height - (x_high - x_low)))
    axes.set(xlim=(x_low - aside, x_high + aside), ylim=(y_low - margin, y_high + margin), aspect="equal")


def plot_path(
    axes: Axes, dataset: xr.Dataset, every: float = 1.0, color: str = "C0", label: str | None = None
) -> list[Artist]:
    """Path of the hull's centre of mass, with the vehicle's outline every `every` seconds (0: never).

    Thin lines and a band between the outermost: the members of an ensemble, if the run has them; the legend then tells
    them apart.
    """
    path = dataset["position"].sel(body="hull").values[:, :2]
    has_members = "member_position" in dataset
    members: Array = dataset["member_position"].values[:, :, :2] if has_members else np.empty((0, 0, 2))
    if len(members) and label is None:
        label = "mean of the networks' loads"
    artists: list[Artist] = list(axes.plot(*path.T, color=color, lw=1.6, label=label, zorder=3))
    for n, member in enumerate(members):
        alone = f"each of the {len(members)} networks alone" if n == 0 else None
        artists += axes.plot(*member.T, color=MEMBER_COLOR, lw=0.6, zorder=4, label=alone)
    if len(members) and np.isfinite(members).any():
        band = Polygon(_band(path, members), fc=BAND_COLOR, ec="none", alpha=0.7, zorder=2.5, label=BAND)
        artists.append(axes.add_patch(band))
    if every > 0.0:
        times = dataset["time"].values
        for t in np.arange(0.0, times[-1] + 1e-9, every):
            for k, outline in enumerate(vehicle_outlines(dataset, int(np.argmin(np.abs(times - t))))):
                face = color if k == 0 else BODY_COLOR
                patch = Polygon(
                    outline, closed=True, fc=face, alpha=0.22 if k == 0 else 0.5, ec=color, lw=0.5, zorder=2
                )
                artists.append(axes.add_patch(patch))
    axes.set(xlabel="x [m]", ylabel="y [m]", aspect="equal")
    return artists


def at_places(place: Array, values: Array, wanted: Array) -> Array:
    """Values at the first arrival at some places.

    Parameters
    ----------
    place : array, shape (n,)
        Places along a way, in the order of time; nan from where a run broke down.
    values : array, shape (n,)
    wanted : array, shape (m,)

    Returns
    -------
    array, shape (m,)
        nan where it never came.
    """
    known = np.isfinite(place)
    place, values = place[known], values[known]
    first = np.r_[True, np.maximum.accumulate(place)[:-1] < place[1:]][: len(place)]
    if not first.any():
        return np.full(len(wanted), np.nan)
    return np.interp(wanted, place[first], values[first], left=np.nan, right=np.nan)


def draw_range(axes: Axes, place: Array, members: Array) -> list[Artist]:
    """Draw values of the members of an ensemble at equal places, shape (members, n), as a band between the outermost.

    Members that never came to a place are left out there.
    """
    there = np.isfinite(members).any(axis=0)
    low, high = np.nanmin(members[:, there], axis=0), np.nanmax(members[:, there], axis=0)
    return [axes.fill_between(place[there], low, high, color=BAND_COLOR, alpha=0.7, lw=0.0, label=BAND, zorder=1.5)]


def member_legend(axes: Axes) -> None:
    """Tell the members of an ensemble apart, below axes seen from above and their label."""
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, 0.0), borderaxespad=3.8, ncols=3)


def _lengths(path: Array) -> Array:
    """Length of a path up to each of its points [m], shape (n, 2) -> (n,)."""
    return np.concatenate([[0.0], np.hypot(*np.diff(path, axis=0).T).cumsum()])


def _band(path: Array, members: Array) -> Array:
    """Outline of the range of the members' paths, shape (members, n, 2), across `path` at equal length, (k, 2)."""
    length = _lengths(path)
    reached = [_lengths(member) for member in members]
    place = np.linspace(0.0, min(length[-1], np.nanmax(reached)), 200)
    middle = np.stack([at_places(length, axis, place) for axis in path.T], axis=1)
    along = np.gradient(middle, axis=0)
    across = np.stack([-along[:, 1], along[:, 0]], axis=1) / np.maximum(np.hypot(*along.T), 1e-12)[:, None]
    offset = np.stack([
        sum(across[:, k] * (at_places(one, member[:, k], place) - middle[:, k]) for k in (0, 1))
        for one, member in zip(reached, members, strict=True)
    ])  # fmt: skip
    low, high = (middle + pick(offset, axis=0)[:, None] * across for pick in (np.nanmin, np.nanmax))
    return np.concatenate([low, high[::-1]])


def plot_lateral_velocity(axes: Axes, dataset: xr.Dataset, **style: Any) -> list[Artist]:
    """Velocity of the hull to the left of its heading (paper Fig. 8a)."""
    axes.set(xlabel="time [s]", ylabel="lateral velocity [m/s]")
    return list(axes.plot(dataset["time"], dataset["lateral_velocity"], **style))


def plot_forward_velocity(axes: Axes, dataset: xr.Dataset, **style: Any) -> list[Artist]:
    """Velocity of the hull along its heading."""
    axes.set(xlabel="time [s]", ylabel="forward velocity [m/s]")
    return list(axes.plot(dataset["time"], dataset["forward_velocity"], **style))


def plot_yaw(axes: Axes, dataset: xr.Dataset, **style: Any) -> list[Artist]:
    """Heading of the hull (paper Fig. 8b)."""
    axes.set(xlabel="time [s]", ylabel="yaw [deg]")
    return list(axes.plot(dataset["time"], np.degrees(dataset["yaw"].sel(body="hull")), **style))


def plot_wheel_loads(axes: Axes, dataset: xr.Dataset, **style: Any) -> list[Artist]:
    """Upward force of the soil on each wheel, and on the hull if it touched the ground."""
    axes.set(xlabel="time [s]", ylabel="soil reaction [N]")
    artists: list[Artist] = []
    for k, wheel in enumerate(WHEELS):
        load = dataset["soil_force"].sel(wheel=wheel, axis="z")
        artists += axes.plot(dataset["time"], load, label=wheel.replace("_", " "), **({"color": f"C{k}"} | style))
    if "hull_soil_force" in dataset and bool((dataset["hull_soil_force"] != 0.0).any()):
        load = dataset["hull_soil_force"].sel(axis="z")
        artists += axes.plot(dataset["time"], load, label="hull", **({"color": "k", "ls": "--"} | style))
    return artists


def plot_sinkage(axes: Axes, dataset: xr.Dataset, **style: Any) -> list[Artist]:
    """Sinkage of each wheel in the soil."""
    axes.set(xlabel="time [s]", ylabel="sinkage [mm]")
    artists: list[Artist] = []
    for k, wheel in enumerate(WHEELS):
        depth = 1e3 * dataset["sinkage"].sel(wheel=wheel)
        artists += axes.plot(dataset["time"], depth, label=wheel.replace("_", " "), **({"color": f"C{k}"} | style))
    return artists


def plot_water_force(axes: Axes, dataset: xr.Dataset, body: str = "hull", **style: Any) -> list[Artist]:
    """Force of the water on one body in its own axes (paper Fig. 7)."""
    axes.set(xlabel="time [s]", ylabel=f"water on {body.replace('_', ' ')} [N]")
    artists: list[Artist] = []
    for k, component in enumerate(("Fx", "Fy", "Fz")):
        force = dataset["water_wrench"].sel(body=body, component=component)
        artists += axes.plot(dataset["time"], force, label=f"$F_{component[1]}$", **({"color": f"C{k}"} | style))
    return artists


def plot_water_on_wheels(axes: Axes, dataset: xr.Dataset, **style: Any) -> list[Artist]:
    """Force of the water on the four wheels together, in the axes of the hull; nothing if the run does not hold it."""
    if "water_load" not in dataset or "quaternion" not in dataset:
        return []
    force = dataset["water_load"].sel(body=list(WHEELS)).sum("body").values
    hull = Rotation.from_quat(dataset["quaternion"].sel(body="hull").values, scalar_first=True)
    artists: list[Artist] = []
    for k, values in enumerate(hull.apply(force, inverse=True).T):
        look: dict[str, Any] = {"color": f"C{k}", "ls": "--", "lw": 0.9} | style
        artists += axes.plot(dataset["time"], values, label=f"wheels $F_{'xyz'[k]}$", **look)
    return artists


def plot_run(dataset: xr.Dataset) -> Figure:
    """One run on one page: path, speeds, yaw and steering, slip, wheel loads, water, power; below, what it is worth.

    Without water the sinkage of the wheels takes the place of the water's forces.
    """
    dry = not _parameters(dataset, "water")
    x_low, x_high, y_low, y_high = path_limits(dataset)
    with plt.rc_context(STYLE):
        wide = (y_high - y_low) / (x_high - x_low)
        path_height = float(np.clip(9.5 * wide, 1.6, 4.0))  # [inches]: a long path is flat, a circle is not
        figure, grid = plt.subplot_mosaic(
            [["path"] * 3, ["speed", "yaw", "slip"], ["load", "water", "power"]],
            figsize=(11.0, 7.2 + path_height),
            height_ratios=[path_height, 2.6, 2.6],
            layout="constrained",
        )
        plot_path(grid["path"], dataset)
        vehicle = _parameters(dataset, "vehicle")["name"]
        soil = _parameters(dataset, "soil")["name"] or "soil"
        figure.suptitle(f"{vehicle} on {soil}, {water_label(dataset)}", fontsize=10, fontweight="bold")
        grid["path"].set_title("Path; outline every second, circle: start", loc="left")
        grid["path"].plot(*dataset["position"].values[0, 0, :2], "o", color="C0", ms=4)
        draw_current(grid["path"], dataset)
        frame_path(grid["path"], dataset, 9.8 / path_height)
        if "member_position" in dataset:
            member_legend(grid["path"])
        plot_forward_velocity(grid["speed"], dataset, label="forward")
        plot_lateral_velocity(grid["speed"], dataset, label="lateral")
        grid["speed"].set(ylabel="velocity of the hull [m/s]", title="Speed")
        plot_yaw(grid["yaw"], dataset, label="yaw")
        if "member_yaw" in dataset:
            draw_range(grid["yaw"], dataset["time"].values, np.degrees(dataset["member_yaw"].values))[0].set_label(
                "the networks alone"
            )
        steering = np.degrees(dataset["steering_angle"].values)
        for k, side in enumerate(("left", "right") if np.ptp(steering, axis=1).max() > 0.0 else ("",)):
            label = f"steering {side}".rstrip()
            grid["yaw"].plot(dataset["time"], steering[:, k], "--", lw=0.9, color=f"C{k + 1}", label=label)
        grid["yaw"].set(ylabel="angle [deg]", title="Heading and steering")
        for k, wheel in enumerate(WHEELS):
            slip = 100.0 * dataset["slip_ratio"].sel(wheel=wheel)
            grid["slip"].plot(dataset["time"], slip, color=f"C{k}", lw=1.0, label=wheel.replace("_", " "))
        grid["slip"].set(xlabel="time [s]", ylabel="slip ratio [%]", title="Slip")
        plot_wheel_loads(grid["load"], dataset, lw=1.0)
        grid["load"].set_title("Soil reaction on the wheels")
        afloat = not bool(np.isfinite(dataset["slip_ratio"]).any())
        if afloat:
            grid["slip"].set(xlim=grid["load"].get_xlim(), ylim=(-5.0, 5.0))
            grid["slip"].text(0.5, 0.5, "no contact with the soil", transform=grid["slip"].transAxes, ha="center")
        if dry:
            plot_sinkage(grid["water"], dataset, lw=1.0)
            grid["water"].set_title("Sinkage of the wheels")
        else:
            for line in plot_water_force(grid["water"], dataset, lw=1.0):
                line.set_label(f"hull {line.get_label()}")
            of = "hull and wheels" if plot_water_on_wheels(grid["water"], dataset) else "the hull"
            grid["water"].set(ylabel="force of the water [N]", title=f"Water on {of}, axes of the hull")
        grid["power"].plot(dataset["time"], dataset["spin_power"].sum("wheel"), color="C3", label="all wheels")
        grid["power"].set(xlabel="time [s]", ylabel="driving power [W]", title="Power")
        columns_of_yaw = 2 if "member_yaw" in dataset else 3
        for name, columns in (
            ("speed", 2), ("yaw", columns_of_yaw), ("slip", 2), ("load", 2), ("water", 2 if dry else 3), ("power", 1),
        ):  # fmt: skip
            if not (afloat and name == "slip"):
                legend_above_curves(grid[name], columns, LEAST_RANGES["sinkage" if dry and name == "water" else name])
        footnote(figure, *trust_notes([dataset]))
    return figure


LEAST_RANGES = {"speed": 0.1, "yaw": 2.0, "slip": 5.0, "load": 10.0, "water": 5.0, "sinkage": 1.0, "power": 2.0}
"""Smallest vertical range of the panels of `plot_run`, in their units: of a vehicle that stands nothing is shown large.
"""


def compare_runs(runs: Mapping[str, xr.Dataset]) -> Figure:
    """Several runs side by side: paths (paper Fig. 6), lateral velocity and yaw (Fig. 8), wheel loads, water."""
    with plt.rc_context(STYLE):
        figure, grid = plt.subplot_mosaic(
            [["path", "path"], ["lateral", "yaw"], ["load", "water"]],
            figsize=(11.0, 8.5),
            height_ratios=[1.2, 1.0, 1.0],
            layout="constrained",
        )
        for k, (name, dataset) in enumerate(runs.items()):
            style: dict[str, Any] = {
                "color": f"C{k}",
                "ls": "--" if name == "no water" else "-",
                "lw": 1.4,
                "label": name,
            }
            plot_path(grid["path"], dataset, every=0.0, color=f"C{k}", label=name)[0].set(linestyle=style["ls"])
            hull, *_ = vehicle_outlines(dataset, -1)
            grid["path"].add_patch(Polygon(hull, closed=True, fc="none", ec=f"C{k}", lw=0.9, ls=style["ls"]))
            plot_lateral_velocity(grid["lateral"], dataset, **style)
            plot_yaw(grid["yaw"], dataset, **style)
            total = dataset["soil_force"].sel(axis="z").sum("wheel")
            grid["load"].plot(dataset["time"], total, **style)
            drag = dataset["water_load"].sel(body="hull")
            grid["water"].plot(dataset["time"], np.hypot(drag.sel(axis="x"), drag.sel(axis="y")), **style)
        grid["path"].set_title("Path, and the hull at the end")
        grid["lateral"].set_title("Lateral velocity")
        grid["yaw"].set_title("Yaw")
        grid["load"].set(title="Wheel load", xlabel="time [s]", ylabel="soil reaction, four wheels [N]")
        grid["water"].set(title="Water on the hull", xlabel="time [s]", ylabel="horizontal force [N]")
        grid["path"].margins(x=0.03, y=0.1)
        grid["path"].autoscale_view()
        handles, labels = grid["lateral"].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=min(len(runs), 6))
        footnote(figure, *trust_notes(runs.values()))
    return figure


def draw_current(axes: Axes, dataset: xr.Dataset) -> None:
    """Draw an arrow where the current flows to, with its speed, above the right end of the axes.

    Nothing is drawn in still water. The axes lie in the world's x and y.
    """
    water = _parameters(dataset, "water")
    if water and water["current_speed"] > 0.0:
        tip = 11.0 * np.array([np.cos(water["current_direction"]), np.sin(water["current_direction"])])  # [points]
        middle = np.array([-13.0, 13.0])
        corner = OffsetFrom(axes.patch, (1.0, 1.0), "points")
        axes.annotate(
            "", xy=tuple(middle + tip), xytext=tuple(middle - tip), xycoords=corner, textcoords=corner,
            arrowprops={"arrowstyle": "-|>", "color": WATER_COLOR, "lw": 2, "shrinkA": 0, "shrinkB": 0},
            annotation_clip=False,
        )  # fmt: skip
        axes.annotate(
            f"current {water['current_speed']:g} m/s", xy=(1.0, 1.0), xycoords="axes fraction", xytext=(-29.0, 13.0),
            textcoords="offset points", color=WATER_COLOR, ha="right", va="center", fontsize=8,
        )  # fmt: skip
