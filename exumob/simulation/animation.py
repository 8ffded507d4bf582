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
from matplotlib.patches import Circle, Polygon

from exumob.simulation.plotting import _parameters, draw_current, plot_path, scenario_name, vehicle_outlines
from exumob.support.cost import require_frames
from exumob.support.figures import BODY_COLOR, SOIL_COLOR, STYLE, WATER_COLOR
from exumob.vehicle.parameters import Hull


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
    require_frames("animate_run", math.ceil(float(times[-1]) * frames_per_second), 720 * 384, remedy)
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
        self.hull, self.radius = Hull(**vehicle["hull"]), 0.5 * vehicle["wheel"]["diameter"]
        size = self.hull.length
        plot_path(top, dataset, every=0.0)
        draw_current(top, dataset)
        top.margins(x=0.12)
        y = dataset["position"].sel(body="hull", axis="y")
        top.set_ylim(float(y.min()) - 0.8 * size, float(y.max()) + 0.8 * size)
        self.outlines = [Polygon(np.zeros((3, 2)), fc="C0", ec=BODY_COLOR, alpha=0.8) for _ in range(5)]
        for k, patch in enumerate(self.outlines):
            top.add_patch(patch)
            patch.set_facecolor("C0" if k == 0 else BODY_COLOR)
        depth = water.get("depth", 0.0)
        ceiling = 1.3 * (self.hull.ground_clearance + self.hull.height)
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
        profile = hull.side_profile() - [hull.center_of_mass_x, hull.center_of_mass_height]
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
