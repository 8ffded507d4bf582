"""Figures of runs: functions that take axes and a result Dataset and return the artists they draw."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.animation import FFMpegWriter, FuncAnimation, PillowWriter
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Patch, Polygon

from exumob.hydrodynamics.networks import NetworkSet
from exumob.states import BODIES, WHEELS, Array

WATER_COLOR = "#4a90c2"
SOIL_COLOR = "#c8a165"
BODY_COLOR = "#3d4a57"

STYLE: Any = {
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.alpha": 0.3,
    "axes.titlesize": 10,
    "axes.titleweight": "bold",
    "axes.labelsize": 9,
    "xtick.labelsize": 8,
    "ytick.labelsize": 8,
    "legend.fontsize": 8,
    "legend.frameon": False,
    "figure.dpi": 110,
}


def _parameters(dataset: xr.Dataset, name: str) -> dict[str, Any]:
    stored = json.loads(dataset.attrs["parameters"])[name]
    return {} if stored is None else next(iter(stored.values()))


def scenario_name(dataset: xr.Dataset) -> str:
    """Name of a run's water as in the paper: "D60/U1" (depth in % of the tyre diameter), or "no water"."""
    water = _parameters(dataset, "water")
    if not water:
        return "no water"
    ratio = water["depth"] / _parameters(dataset, "vehicle")["wheel"]["diameter"]
    return f"D{100 * ratio:.0f}/U{water['current_speed']:g}"


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


def plot_path(
    axes: Axes, dataset: xr.Dataset, every: float = 1.0, color: str = "C0", label: str | None = None
) -> list[Artist]:
    """Path of the hull's centre of mass, with the vehicle's outline every `every` seconds (0: never).

    Thin lines: the members of an ensemble, if the run has them.
    """
    x, y = dataset["position"].sel(body="hull").values[:, :2].T
    artists: list[Artist] = list(axes.plot(x, y, color=color, lw=1.6, label=label, zorder=3))
    if "member_position" in dataset:
        for member in dataset["member_position"].values:
            artists += axes.plot(*member[:, :2].T, color="0.2", lw=0.6, zorder=4)
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
    """Upward force of the soil on each wheel."""
    axes.set(xlabel="time [s]", ylabel="soil reaction [N]")
    artists: list[Artist] = []
    for k, wheel in enumerate(WHEELS):
        load = dataset["soil_force"].sel(wheel=wheel, axis="z")
        artists += axes.plot(dataset["time"], load, label=wheel.replace("_", " "), **({"color": f"C{k}"} | style))
    return artists


def plot_water_force(axes: Axes, dataset: xr.Dataset, body: str = "hull", **style: Any) -> list[Artist]:
    """Force of the water on one body in its own axes (paper Fig. 7)."""
    axes.set(xlabel="time [s]", ylabel=f"water on {body.replace('_', ' ')} [N]")
    artists: list[Artist] = []
    for k, component in enumerate(("Fx", "Fy", "Fz")):
        force = dataset["water_wrench"].sel(body=body, component=component)
        artists += axes.plot(dataset["time"], force, label=f"$F_{component[1]}$", **({"color": f"C{k}"} | style))
    return artists


def plot_run(dataset: xr.Dataset) -> Figure:
    """One run on one page: path, speeds, yaw and steering, wheel loads, slip, water."""
    with plt.rc_context(STYLE):
        figure, grid = plt.subplot_mosaic(
            [["path"] * 3, ["speed", "yaw", "slip"], ["load", "water", "power"]],
            figsize=(11.0, 8.0),
            height_ratios=[1.0, 1.0, 1.0],
            layout="constrained",
        )
        plot_path(grid["path"], dataset)
        vehicle = _parameters(dataset, "vehicle")["name"]
        soil = _parameters(dataset, "soil")["name"] or "soil"
        grid["path"].set_title(
            f"{vehicle} on {soil}, {scenario_name(dataset)}, {dataset.attrs['hydrodynamics']} "
            "(outline every second; circle: start)"
        )
        grid["path"].plot(*dataset["position"].values[0, 0, :2], "o", color="C0", ms=4)
        _draw_current(grid["path"], dataset)
        grid["path"].margins(x=0.03, y=0.25)
        plot_forward_velocity(grid["speed"], dataset, label="forward")
        plot_lateral_velocity(grid["speed"], dataset, label="lateral")
        grid["speed"].set(ylabel="velocity of the hull [m/s]", title="Speed")
        plot_yaw(grid["yaw"], dataset, label="yaw")
        steering = np.degrees(dataset["steering_angle"].values)
        for k, side in enumerate(("left", "right") if np.ptp(steering, axis=1).max() > 0.0 else ("",)):
            grid["yaw"].plot(dataset["time"], steering[:, k], "--", lw=0.9, color=f"C{k + 1}", label=f"steering {side}")
        grid["yaw"].set(ylabel="angle [deg]", title="Heading and steering")
        for k, wheel in enumerate(WHEELS):
            slip = 100.0 * dataset["slip_ratio"].sel(wheel=wheel)
            grid["slip"].plot(dataset["time"], slip, color=f"C{k}", lw=1.0, label=wheel.replace("_", " "))
        grid["slip"].set(xlabel="time [s]", ylabel="slip ratio [%]", title="Slip")
        plot_wheel_loads(grid["load"], dataset, lw=1.0)
        grid["load"].set_title("Soil reaction on the wheels")
        plot_water_force(grid["water"], dataset, lw=1.0)
        grid["water"].set_title("Water on the hull, body axes")
        grid["power"].plot(dataset["time"], dataset["spin_power"].sum("wheel"), color="C3", label="all wheels")
        grid["power"].set(xlabel="time [s]", ylabel="driving power [W]", title="Power")
        for name in ("speed", "yaw", "slip", "load", "water"):
            grid[name].margins(y=0.15)
            grid[name].legend(ncols=2)
    return figure


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
        grid["path"].legend(loc="upper left", ncols=len(runs))
        grid["path"].margins(y=0.25)
    return figure


def _draw_current(axes: Axes, dataset: xr.Dataset) -> None:
    water = _parameters(dataset, "water")
    if water and water["current_speed"] > 0.0:
        direction = np.array([np.cos(water["current_direction"]), np.sin(water["current_direction"])])
        tip = 0.08 * direction
        axes.annotate(
            "",
            xy=(0.93 + tip[0], 0.85 + tip[1]),
            xytext=(0.93, 0.85),
            xycoords="axes fraction",
            arrowprops={"arrowstyle": "-|>", "color": WATER_COLOR, "lw": 2},
        )
        axes.text(
            0.93, 0.92, f"current {water['current_speed']:g} m/s", transform=axes.transAxes, color=WATER_COLOR,
            ha="center", fontsize=8,
        )  # fmt: skip


def animate_run(dataset: xr.Dataset, file: str | Path, frames_per_second: int = 12) -> None:
    """Write a GIF or MP4 of a run: from above, and from the side, where soil and water are seen.

    Raises
    ------
    ValueError
        If the file's ending is neither .gif nor .mp4, or ffmpeg is missing for .mp4.
    """
    path = Path(file)
    writer: PillowWriter | FFMpegWriter
    if path.suffix == ".gif":
        writer = PillowWriter(fps=frames_per_second)
    elif path.suffix == ".mp4":
        if not FFMpegWriter.isAvailable():
            raise ValueError(f"{path}: writing MP4 needs the program ffmpeg, which is not installed; use .gif.")
        writer = FFMpegWriter(fps=frames_per_second)
    else:
        raise ValueError(f"animation {path}: the ending {path.suffix!r} is not known; use .gif or .mp4.")
    times = dataset["time"].values
    frames = np.searchsorted(times, np.arange(0.0, times[-1] + 1e-9, 1.0 / frames_per_second))
    frames = np.minimum(frames, len(times) - 1)
    with plt.rc_context(STYLE):
        figure, (top, side) = plt.subplots(2, 1, figsize=(9.0, 4.8), height_ratios=[1.3, 1.0], layout="constrained")
        draw = _Scene(top, side, dataset)
        figure.canvas.draw()
        figure.set_layout_engine("none")  # laying out every frame anew costs ten times the drawing
        animation = FuncAnimation(figure, draw.frame, frames=frames, blit=False)
        animation.save(path, writer=writer, dpi=80)
    plt.close(figure)


class _Scene:
    """Two views of a run that are moved from frame to frame."""

    def __init__(self, top: Axes, side: Axes, dataset: xr.Dataset) -> None:
        self.data, self.top, self.side = dataset, top, side
        vehicle, water = _parameters(dataset, "vehicle"), _parameters(dataset, "water")
        self.hull, self.radius = vehicle["hull"], 0.5 * vehicle["wheel"]["diameter"]
        size = self.hull["length"]
        plot_path(top, dataset, every=0.0)
        _draw_current(top, dataset)
        top.margins(x=0.12)
        y = dataset["position"].sel(body="hull", axis="y")
        top.set_ylim(float(y.min()) - 0.8 * size, float(y.max()) + 0.8 * size)
        self.outlines = [Polygon(np.zeros((3, 2)), fc="C0", ec=BODY_COLOR, alpha=0.8) for _ in range(5)]
        for k, patch in enumerate(self.outlines):
            top.add_patch(patch)
            patch.set_facecolor("C0" if k == 0 else BODY_COLOR)
        depth = water.get("depth", 0.0)
        ceiling = 1.3 * (self.hull["ground_clearance"] + self.hull["height"])
        side.axhspan(-1.0, 0.0, color=SOIL_COLOR, zorder=0)
        if depth:
            side.axhspan(0.0, depth, color=WATER_COLOR, alpha=0.35, zorder=4)
        side.set(ylim=(-0.25 * ceiling, ceiling), ylabel="z [m]", aspect="equal", xlabel="along the heading [m]")
        side.set_xlim(-1.1 * size, 1.1 * size)
        side.grid(visible=False)
        self.profile = Polygon(np.zeros((3, 2)), fc="C0", ec=BODY_COLOR, zorder=3)
        near = (2.0, 3.5, 2.0, 3.5)  # seen from starboard: the right-hand wheels stand before the hull
        self.rims = [Circle((0, 0), self.radius, fc="0.35", ec="k", zorder=z) for z in near]
        for part in (self.profile, *self.rims):
            side.add_patch(part)
        self.spokes = [side.plot([], [], color="0.85", lw=1.2, zorder=z + 0.2)[0] for z in near]
        self.turn = np.concatenate([np.zeros((1, 4)), np.cumsum(
            0.5 * np.diff(dataset["time"].values)[:, None]
            * (dataset["wheel_speed"].values[1:] + dataset["wheel_speed"].values[:-1]), axis=0)])  # fmt: skip
        self.title = top.set_title("")

    def frame(self, index: int) -> list[Artist]:
        data, hull = self.data, self.hull
        for patch, outline in zip(self.outlines, vehicle_outlines(data, index), strict=True):
            patch.set_xy(outline)
        yaw, pitch = (float(data[name].values[index, 0]) for name in ("yaw", "pitch"))
        heading = np.array([np.cos(yaw), np.sin(yaw)])
        origin = data["position"].values[index, 0]
        keel = hull["ground_clearance"] - hull["center_of_mass_height"]
        deck = keel + hull["height"]
        middle, half = hull["center_x"] - hull["center_of_mass_x"], 0.5 * hull["length"]
        stern, stem = middle - half, middle + half
        keel_end, bow = stem - hull["bow_length"], keel + hull["bow_height"]
        profile = np.array([[stern, keel], [keel_end, keel], [stem, bow], [stem, deck], [stern, deck]])
        c, s = np.cos(pitch), np.sin(pitch)
        self.profile.set_xy(profile @ np.array([[c, -s], [s, c]]) + [0.0, origin[2]])
        for k in range(4):
            center = data["position"].values[index, 1 + k]
            x = float((center[:2] - origin[:2]) @ heading)
            self.rims[k].center = (x, center[2])
            angle = self.turn[index, k]
            tip = 0.9 * self.radius * np.array([np.sin(angle), np.cos(angle)])
            self.spokes[k].set_data([x - tip[0], x + tip[0]], [center[2] - tip[1], center[2] + tip[1]])
        speed = float(data["forward_velocity"].values[index])
        self.title.set_text(
            f"{scenario_name(data)}   t = {float(data['time'].values[index]):.2f} s   speed {speed:.2f} m/s   "
            f"yaw {np.degrees(yaw):.0f}°"
        )
        return [*self.outlines, self.profile, *self.rims, *self.spokes, self.title]


def plot_learning_curves(networks: Sequence[NetworkSet]) -> Figure:
    """Error of the scaled loads over the epochs: training runs (dashed) and the run held back; a colour a seed."""
    figure, rows = plt.subplots(1, len(BODIES), figsize=(13.0, 2.9), sharey=True, layout="constrained")
    for body, (axes, name) in enumerate(zip(rows, BODIES, strict=True)):
        for n, network in enumerate(networks):
            train, held = (network.arrays[f"{kind}_loss"][body] for kind in ("training", "held_back"))
            epochs = np.arange(1, train.size + 1)
            marker = "o" if train.size == 1 else None
            axes.semilogy(epochs, train, ls="--", lw=0.9, color=f"C{n}", marker=marker, mfc="none")
            axes.semilogy(epochs, held, lw=1.3, color=f"C{n}", marker=marker, label=f"{network.about['held_back']}")
        axes.set(title=name.replace("_", " "), xlabel="epoch")
    rows[0].set_ylabel("mean square error, scaled loads [-]")
    rows[-1].legend(title="held back", fontsize="x-small", title_fontsize="x-small")
    return figure


AXIS_NAMES = {
    "water.current_speed": "current [m/s]", "water.depth_ratio": "depth over tyre diameter", "water.depth": "depth [m]",
}  # fmt: skip
"""Of maps, in words."""
FAILURE_COLORS = ("none", "0.25", "C0", "C4", "C5", "C3", "C1", "C6", "0.6")
"""By index of `exumob.crossing.FAILURES`."""


def plot_map(mapped: xr.Dataset, checks: xr.Dataset | None = None) -> Figure:
    """Chance to cross (colours, border lines), speed ahead (dotted lines), why not (dots) of a mobility map.

    Parameters
    ----------
    mapped : xarray.Dataset
        Of `exumob.mobility.compute_map`. Where the networks' answer does not count the map is hatched, not coloured.
    checks : xarray.Dataset, optional
        Runs with the flow in the loop, for the first panel: x, y, crossed (1 or 0) along one dimension.
    """
    panels = mapped["panel"].values
    failures = mapped.attrs["failures"].split(", ")
    share = mapped.attrs["range_share"]
    keys: list[Artist] = []
    with plt.rc_context(STYLE | {"axes.grid": False}):
        figure, rows = plt.subplots(
            1, len(panels), figsize=(1.0 + 4.2 * len(panels), 4.2), sharey=True, layout="constrained", squeeze=False
        )
        named: set[int] = set()
        for axes, panel in zip(rows[0], panels, strict=True):
            at = mapped.sel(panel=panel)
            x, y, chance, outside = (at[name].values for name in ("x", "y", "probability", "out_of_range"))
            outside = np.where(np.isfinite(chance), outside, 1.0)  # every run was lost: no answer
            chance = np.nan_to_num(chance)
            drawn = axes.contourf(x, y, chance, np.linspace(0.0, 1.0, 11), cmap="RdYlBu", alpha=0.85)
            if chance.min() < 0.5 < chance.max():
                lines = axes.contour(x, y, chance, [0.1, 0.5, 0.9], colors="k", linewidths=[0.8, 2.0, 0.8])
                axes.clabel(lines, fmt=lambda p: f"{100.0 * p:.0f} %", fontsize=8)
            speed = np.ma.masked_invalid(at["speed"].values)
            thin = axes.contour(x, y, speed, colors="0.35", linewidths=0.6, linestyles=":")
            axes.clabel(thin, fmt="%.1f m/s", fontsize=7)
            failed = (at["runs"].values > 0) & (chance < 0.5) & (outside <= share)
            for kind in np.unique(at["failure"].values[failed]):
                i, j = np.nonzero(failed & (at["failure"].values == kind))
                named.add(int(kind))
                axes.plot(x[j], y[i], ".", color=FAILURE_COLORS[kind], ms=5)
            if outside.max() > share:
                axes.contourf(x, y, outside, [share, 2.0], colors="w", zorder=3)
                axes.contourf(x, y, outside, [share, 2.0], colors="none", hatches=["////"], zorder=3)
            axes.set(title=panel, xlabel=AXIS_NAMES.get(mapped.attrs["x"], mapped.attrs["x"]))
        rows[0, 0].set(ylabel=AXIS_NAMES.get(mapped.attrs["y"], mapped.attrs["y"]))
        if checks is not None:
            for crossed, marker, face, edge, text in ((1, "o", "w", "k", "crosses"), (0, "X", "k", "w", "does not")):
                of = checks["crossed"].values == crossed
                keys += rows[0, 0].plot(
                    checks["x"].values[of], checks["y"].values[of], marker, mfc=face, mec=edge, ms=8, clip_on=False,
                    zorder=5, label=f"with the flow in the loop: {text}",
                )  # fmt: skip
        keys += [Line2D([], [], color=FAILURE_COLORS[k], marker=".", ls="", label=failures[k]) for k in sorted(named)]
        keys.append(Patch(facecolor="w", edgecolor="k", hatch="////", label="outside the training range"))
        figure.legend(handles=keys, loc="outside lower center", ncols=len(keys))
        bar = figure.colorbar(drawn, ax=list(rows[0]), shrink=0.9)  # the same levels in all
        bar.set_label(f"chance to cross ({mapped.attrs['least_speed']:.2g} m/s at least)")
    return figure


def save_figure(figure: Figure, file: str | Path) -> Path:
    """Save a figure and close it."""
    path = Path(file)
    figure.savefig(path)
    plt.close(figure)
    return path
