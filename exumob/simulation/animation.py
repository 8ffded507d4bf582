"""A run as an animation: the vehicle from above and from the side."""

from __future__ import annotations

import math
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.animation import FFMpegWriter, FuncAnimation, PillowWriter
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon

from exumob.simulation.plotting import (
    _parameters,
    draw_current,
    frame_path,
    member_legend,
    path_limits,
    plot_path,
    stored_terrain,
    vehicle_outlines,
    water_label,
)
from exumob.support.arrays import Array
from exumob.support.cost import require_frames
from exumob.support.figures import BODY_COLOR, SOIL_COLOR, STYLE, WATER_COLOR, footnote, trust_notes
from exumob.vehicle.body import arch_of
from exumob.vehicle.stored import vehicle_from


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
    if not 0.0 < frames_per_second <= 1000.0:
        raise ValueError(f"animate_run.frames_per_second = {frames_per_second} must be > 0 and <= 1000; give 12, say.")
    remedy = "give a shorter run, or fewer frames_per_second."
    require_frames("animate_run", math.ceil(float(times[-1]) * frames_per_second), 720 * 640, remedy)
    frames = np.searchsorted(times, np.arange(0.0, times[-1] + 1e-9, 1.0 / frames_per_second))
    frames = np.unique([*np.minimum(frames, len(times) - 1), len(times) - 1])
    with plt.rc_context(STYLE):
        figure, draw = _scene(dataset)
        figure.canvas.draw()
        figure.set_layout_engine("none")  # laying out every frame anew costs ten times the drawing
        animation = FuncAnimation(figure, draw.frame, frames=frames, blit=False)
        animation.save(path, writer=writer, dpi=80)
    plt.close(figure)


def _scene(dataset: xr.Dataset) -> tuple[Figure, _Scene]:
    """Make the figure, as high as the path is wide, and what moves in it."""
    x_low, x_high, y_low, y_high = path_limits(dataset)
    height = float(np.clip(8.0 * (y_high - y_low) / (x_high - x_low), 1.4, 4.0))  # [inches], of the view from above
    figure, (top, side) = plt.subplots(
        2, 1, figsize=(9.0, height + 3.9), height_ratios=[height, 2.2], layout="constrained"
    )
    footnote(figure, *trust_notes([dataset]))
    return figure, _Scene(figure, top, side, dataset, 8.0 / height)


class _Scene:
    """Two views of a run that are moved from frame to frame."""

    def __init__(self, figure: Figure, top: Axes, side: Axes, dataset: xr.Dataset, ratio: float) -> None:
        self.data, self.top, self.side = dataset, top, side
        vehicle, water = _parameters(dataset, "vehicle"), _parameters(dataset, "water")
        self.vehicle = vehicle_from(vehicle)
        self.hull = self.vehicle.hull  # its boxes alone are drawn
        self.radius = 0.5 * vehicle["wheel"]["diameter"]
        self.terrain = stored_terrain(dataset)
        size = float(np.ptp(self.hull.extent, axis=0)[0])
        plot_path(top, dataset, every=0.0)
        draw_current(top, dataset)
        frame_path(top, dataset, ratio)
        top.set_title("from above", loc="left", fontweight="normal")
        if "member_position" in dataset:
            member_legend(top)
        self.outlines = [Polygon(np.zeros((3, 2)), fc="C0", ec=BODY_COLOR, alpha=0.8) for _ in range(5)]
        for k, patch in enumerate(self.outlines):
            top.add_patch(patch)
            patch.set_facecolor("C0" if k == 0 else BODY_COLOR)
        depth = float(dataset["water_depth"].max()) if "water_depth" in dataset else water.get("depth", 0.0)
        self.level = np.full(dataset.sizes["time"], self.terrain.height + depth)
        if "water_level" in dataset:
            self.level = dataset["water_level"].values
        places = dataset["position"].values
        height = places[..., 2] - self._ground(places[:, 0])[:, None]  # above the soil below the hull's centre
        above_hull = float(self.hull.extent[1][2]) - self.hull.center_of_mass_height
        above_hull += 0.5 * size * float(np.abs(np.sin(dataset["pitch"].values[:, 0])).max())
        high = max(float(height[:, 0].max()) + above_hull, 1.1 * depth)
        low = min(float(height[:, 1:].min()) - self.radius, 0.0)
        self.heights = low - 0.2 * (high - low), high + 0.1 * (high - low)
        self.soil = Polygon(np.zeros((3, 2)), fc=SOIL_COLOR, ec="none", zorder=0)
        side.add_patch(self.soil)
        self.water = Polygon(np.zeros((3, 2)), color=WATER_COLOR, alpha=0.35, zorder=4)
        if depth:
            side.add_patch(self.water)
        side.set(
            ylim=self.heights, ylabel="z [m]", aspect="equal", xlabel="along the heading, from the hull's centre [m]"
        )
        side.set_xlim(-1.1 * size, 1.1 * size)
        side.grid(visible=False)
        self.profile = [Polygon(np.zeros((3, 2)), fc="C0", ec=BODY_COLOR, zorder=3) for _ in self.hull.parts]
        self.outline = [part.side_profile() for part in self.hull.parts]
        for arch in self._arches():
            self.profile.append(Polygon(np.zeros((3, 2)), fc="0.25", ec="none", zorder=3.2))
            self.outline.append(arch)
        near = (2.0, 3.5, 2.0, 3.5)  # seen from starboard: the right-hand wheels stand before the hull
        self.rims = [Circle((0, 0), self.radius, fc="0.35", ec="k", zorder=z) for z in near]
        for part in (*self.profile, *self.rims):
            side.add_patch(part)
        self.spokes = [side.plot([], [], color="0.85", lw=1.2, zorder=z + 0.2)[0] for z in near]
        self.turn = np.concatenate([np.zeros((1, 4)), np.cumsum(
            0.5 * np.diff(dataset["time"].values)[:, None]
            * (dataset["wheel_speed"].values[1:] + dataset["wheel_speed"].values[:-1]), axis=0)])  # fmt: skip
        side.set_title("from starboard", loc="left", fontweight="normal")
        self.title = figure.suptitle(" ", fontsize=10, fontweight="bold")

    def _arches(self) -> list[Array]:
        """Outlines of the wheel arches seen from the side, down to the keel."""
        hull = self.hull
        if hull.wheel_arches is None or hull.mesh is not None:
            return []
        arches = [arch_of(hull.wheel_arches, axle).outline for axle in self.vehicle.axles]
        return [np.maximum(np.array(outline), [-np.inf, hull.ground_clearance]) for outline in arches]

    def _ground(self, places: Array) -> Array:
        """Height of the soil's surface below places, shape (..., 2 or 3) -> (...) [m]."""
        if self.terrain.is_flat:
            return np.full(places.shape[:-1], self.terrain.height)
        flat = places.reshape(-1, places.shape[-1])
        heights = [self.terrain.height_and_normal(float(place[0]), float(place[1]))[0] for place in flat]
        return np.array(heights).reshape(places.shape[:-1])

    def _move_soil(self, origin: Array, heading: Array, level: float) -> None:
        """Draw soil and water below the heading, and keep the vehicle in the picture where it goes up or down."""
        along = np.linspace(*self.side.get_xlim(), 81)
        surface = self._ground(origin[:2] + along[:, None] * heading)
        here = float(self._ground(origin[:2]))
        bottom = here + self.heights[0] - 1.0
        self.soil.set_xy([(along[0], bottom), *zip(along, surface, strict=True), (along[-1], bottom)])
        top = np.maximum(surface, level) if math.isfinite(level) else surface
        self.water.set_xy([*zip(along, surface, strict=True), *zip(along[::-1], top[::-1], strict=True)])
        self.side.set_ylim(here + self.heights[0], here + self.heights[1])

    def frame(self, index: int) -> list[Artist]:
        data, hull = self.data, self.hull
        for patch, outline in zip(self.outlines, vehicle_outlines(data, index), strict=True):
            patch.set_xy(outline)
        yaw, pitch = (float(data[name].values[index, 0]) for name in ("yaw", "pitch"))
        heading = np.array([np.cos(yaw), np.sin(yaw)])
        origin = data["position"].values[index, 0]
        self._move_soil(origin, heading, float(self.level[index]))
        c, s = np.cos(pitch), np.sin(pitch)
        for patch, outline in zip(self.profile, self.outline, strict=True):
            profile = outline - [hull.center_of_mass_x, hull.center_of_mass_height]
            patch.set_xy(profile @ np.array([[c, -s], [s, c]]) + [0.0, origin[2]])
        for k in range(4):
            center = data["position"].values[index, 1 + k]
            x = float((center[:2] - origin[:2]) @ heading)
            self.rims[k].center = (x, center[2])
            angle = self.turn[index, k]
            tip = 0.9 * self.radius * np.array([np.sin(angle), np.cos(angle)])
            self.spokes[k].set_data([x - tip[0], x + tip[0]], [center[2] - tip[1], center[2] + tip[1]])
        speed = round(float(data["forward_velocity"].values[index]), 2) + 0.0  # no -0.00
        self.title.set_text(
            f"{water_label(data)}   t = {float(data['time'].values[index]):.2f} s   speed {speed:.2f} m/s   "
            f"yaw {round(math.degrees(yaw)) + 0}°"
        )
        return [*self.outlines, self.soil, self.water, *self.profile, *self.rims, *self.spokes, self.title]
