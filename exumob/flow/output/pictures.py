"""Pictures and animations of the free surface with the vehicle in it (as in paper Fig. 9)."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.animation import FFMpegWriter, FuncAnimation, PillowWriter
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure, SubFigure
from scipy.ndimage import distance_transform_edt
from scipy.spatial.transform import Rotation

from exumob.flow.output.render import Camera, lit, normals_of, render
from exumob.flow.output.snapshots import SNAPSHOT_VARIABLES
from exumob.flow.output.vehicle_surface import SEGMENTS, body_triangles, placed, stored_vehicle
from exumob.support.arrays import Array
from exumob.support.cost import require_frames
from exumob.support.declared import checked
from exumob.support.figures import STYLE, footnote, trust_notes
from exumob.support.quantities import Quantity

RANGE = Quantity("mm", above=0.0, at_most=1e6)
"""Elevation at the ends of a colour scale"""
FRAME_RATE = Quantity("1/s", at_least=0.01, at_most=1000.0)
"""Frames of an animation a second"""
COLORS = "RdBu_r"
HULL_COLOR = (0.95, 0.72, 0.25)
WHEEL_COLORS = (0.22, 0.22, 0.24), (0.34, 0.34, 0.37)
CUT_COLOR = (0.42, 0.58, 0.70)
BED_COLOR = (0.76, 0.66, 0.50)
LIGHT = (-0.5, 0.55, 1.0)


class SurfaceView:
    """A view of the snapshots of a run in perspective, from behind and above.

    Parameters
    ----------
    dataset : xr.Dataset
        Result of `captive_run` with `snapshots`, or of a coupled run with ``BuiltInFlow(snapshots=...)``.
    range_mm : float, optional
        Elevation at the ends of the colour scale [mm]; default: from the snapshots.
    azimuth, height : float
        Direction of the camera: angle from straight behind, to starboard, and angle above the water [rad].
    extent : (float, float, float), optional
        Water shown ahead, behind and aside of the hull's centre of mass, in hull lengths.
    size : (int, int)
        Width and height of the picture [pixels].
    """

    @checked
    def __init__(
        self,
        dataset: xr.Dataset,
        range_mm: Annotated[float | None, RANGE] = None,
        azimuth: Annotated[float, Quantity("rad", at_least=-2.0 * math.pi, at_most=2.0 * math.pi)] = math.radians(38.0),
        height: Annotated[float, Quantity("rad", at_least=0.02, at_most=1.55)] = math.radians(33.0),
        extent: Annotated[tuple[float, float, float], Quantity("1", above=0.0, at_most=100.0)] = (1.2, 1.6, 1.0),
        size: Annotated[tuple[int, int], Quantity("1", at_least=16, at_most=10_000)] = (810, 540),
    ) -> None:
        """Prepare; see the class."""
        dataset = _with_snapshots(dataset)
        self.vehicle = stored_vehicle(dataset)
        self.bodies = body_triangles(self.vehicle)
        length = self.vehicle.hull.length
        ahead, behind, aside = (part * length for part in extent)
        self.data = dataset.sel(x=slice(-behind, ahead), y=slice(-aside, aside))
        if min(self.data.sizes["x"], self.data.sizes["y"]) < 3:
            raise ValueError(
                f"SurfaceView.extent = {extent} hull lengths holds {self.data.sizes['x']} by {self.data.sizes['y']} "
                "cells; show more of the water."
            )
        self.level = still_level(dataset)
        beds = self.data["bed_elevation"].values + self.level if "bed_elevation" in self.data else np.zeros(1)
        self.lowest = float(beds.min()) - (0.05 * length if "bed_elevation" in self.data else 0.0)
        self.scale = Normalize(*_limits(self.data["elevation"].values, range_mm))
        x, y = self.data["x"].values[[0, -1]], self.data["y"].values[[0, -1]]
        top = max(self.level + 0.5e-3 * float(self.scale.vmax or 0.0), float(beds.max()))
        corners = np.array([[a, b, c] for a in x for b in y for c in (self.lowest, top)])
        middle, away = corners.mean(axis=0), 4.0 * length
        flat = away * math.cos(height)
        eye = middle + np.array([-flat * math.cos(azimuth), -flat * math.sin(azimuth), away * math.sin(height)])
        self.camera = Camera.around(corners, tuple(eye), *size)
        self.colors = plt.get_cmap(COLORS)
        time = np.concatenate([[0.0], dataset["time"].values])
        spin = np.concatenate([np.zeros((1, 4)), dataset["wheel_speed"].values])
        turns = np.concatenate([np.zeros((1, 4)), np.cumsum(np.diff(time)[:, None] * 0.5 * (spin[1:] + spin[:-1]), 0)])
        self.turns = np.stack([np.interp(dataset["snapshot"].values, time, turn) for turn in turns.T], axis=1)

    def image(self, index: int) -> Array:
        """Draw one snapshot, shape (height, width, 3), 0 to 1."""
        parts = [self._water(index), *self._bed(index), *self._cut(index), *self._vehicle(index)]
        return render(np.concatenate([t for t, _ in parts]), np.concatenate([c for _, c in parts]), self.camera)

    def mappable(self) -> ScalarMappable:
        """Return what the colour bar is made from, in mm."""
        return ScalarMappable(self.scale, self.colors)

    def _surface(self, index: int) -> tuple[Array, Array]:
        """Points (ny, nx, 3) of the water, and their elevation [m]; it reaches two cells into what pierces it."""
        elevation = self.data["elevation"].values[index].astype(float)
        filled = fill_masked(elevation, 2)
        x, y = np.meshgrid(self.data["x"].values, self.data["y"].values)
        return np.stack([x, y, filled + self.level], axis=-1), filled

    def _ground(self, index: int) -> Array:
        """Points (ny, nx, 3) of the bed."""
        x, y = np.meshgrid(self.data["x"].values, self.data["y"].values)
        if "bed_elevation" not in self.data:
            return np.stack([x, y, np.zeros_like(x)], axis=-1)
        return np.stack([x, y, self.data["bed_elevation"].values[index] + self.level], axis=-1)

    def _bed(self, index: int) -> list[tuple[Array, Array]]:
        """The surface of a given bed; a flat one is not seen."""
        if "bed_elevation" not in self.data:
            return []
        triangles = _quads(self._ground(index))
        colors = lit(np.array(BED_COLOR), normals_of(triangles), triangles.mean(axis=1), self.camera, LIGHT)
        return [(triangles, np.repeat(colors[:, None], 3, axis=1))]

    def _water(self, index: int) -> tuple[Array, Array]:
        points, elevation = self._surface(index)
        slope_y, slope_x = np.gradient(
            np.where(np.isfinite(elevation), elevation, 0.0), points[:, 0, 1], points[0, :, 0]
        )
        normals = np.stack([-slope_x, -slope_y, np.ones_like(slope_x)], axis=-1)
        normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
        plain = self.colors(self.scale(1e3 * np.nan_to_num(elevation)))[..., :3]
        shaded = lit(plain, normals, points, self.camera, LIGHT, shine=0.35)
        return _quads(points), _quads(shaded)

    def _cut(self, index: int) -> list[tuple[Array, Array]]:
        """The four sides of the block that is shown: water down to the bed, and the ground of a given one."""
        surface, _ = self._surface(index)
        ground = self._ground(index)
        water, soil = [], []
        for side in (np.s_[0], np.s_[:, -1], np.s_[-1, ::-1], np.s_[::-1, 0]):
            top, bed = surface[side], ground[side]
            water.append(_quads(np.stack([bed, np.where(top[:, 2:] >= bed[:, 2:], top, bed)])))
            foot = bed.copy()
            foot[:, 2] = self.lowest
            soil.append(_quads(np.stack([foot, bed])))
        parts = [(water, CUT_COLOR)] + ([(soil, BED_COLOR)] if "bed_elevation" in self.data else [])
        found = []
        for sides, color in parts:
            triangles = np.concatenate(sides)
            normals, middles = normals_of(triangles), triangles.mean(axis=1)
            colors = lit(np.array(color), normals, middles, self.camera, (-1.0, -0.3, 0.4))
            found.append((triangles, np.repeat(colors[:, None], 3, axis=1)))
        return found

    def _vehicle(self, index: int) -> list[tuple[Array, Array]]:
        rotation = Rotation.from_quat(
            self.data["snapshot_quaternion"].values[index], scalar_first=True
        ).as_matrix()  # fmt: skip
        spin = Rotation.from_rotvec(np.outer([0.0, *self.turns[index]], [0.0, 1.0, 0.0])).as_matrix()
        bodies = placed(self.bodies, self.data["snapshot_position"].values[index], rotation @ spin)
        parts = []
        for n, triangles in enumerate(bodies):
            if n == 0:
                plain = np.tile(HULL_COLOR, (len(triangles), 1))
            else:  # sectors in two tones, so that the spin is seen
                middle = self.bodies[n].mean(axis=1)
                sector = np.floor((np.arctan2(middle[:, 2], middle[:, 0]) / (2 * math.pi) + 1.0) * SEGMENTS / 4.0)
                plain = np.array(WHEEL_COLORS)[sector.astype(int) % 2]
            shaded = lit(plain, normals_of(triangles), triangles.mean(axis=1), self.camera, LIGHT)
            parts.append((triangles, np.repeat(shaded[:, None], 3, axis=1)))
        return parts


def fill_masked(values: Array, cells: int) -> Array:
    """Fill masked (NaN) values within some cells of others from the nearest one; the rest stays NaN."""
    masked = ~np.isfinite(values)
    if not masked.any():
        return values
    away, (j, i) = distance_transform_edt(masked, return_indices=True)
    return np.where(away <= cells + 0.5, values[j, i], np.nan)


def still_level(dataset: xr.Dataset) -> float:
    """Return the height of the still water in a run with snapshots [m]; in older files it is the depth."""
    kept = dataset["elevation"].attrs.get("still_level")
    return float(json.loads(dataset.attrs["parameters"])["water"]["Water"]["depth"] if kept is None else kept)


def _quads(values: Array) -> Array:
    """Values at points (m, n, 3) as those at the corners of triangles, shape (2 (m - 1)(n - 1), 3, 3)."""
    a, b, c, d = values[:-1, :-1], values[:-1, 1:], values[1:, 1:], values[1:, :-1]
    return np.concatenate([np.stack(t, axis=-2).reshape(-1, 3, 3) for t in ((a, b, c), (a, c, d))])


def _limits(elevation: Array, range_mm: float | None) -> tuple[float, float]:
    if range_mm is None:
        largest = 1e3 * float(np.nanpercentile(np.abs(elevation), 98.5))
        range_mm = max(5.0 * math.ceil(largest / 5.0), 5.0)
    return -range_mm, range_mm


def _with_snapshots(dataset: xr.Dataset) -> xr.Dataset:
    """A run with the snapshots' variables under the names that captive runs give them."""
    names = {f"hydrodynamics_{name}": name for name in SNAPSHOT_VARIABLES}
    dataset = dataset.rename({name: short for name, short in names.items() if name in dataset and short not in dataset})
    if "elevation" not in dataset:
        raise ValueError(
            "the dataset holds no snapshots of the free surface; give the result of captive_run with snapshots=0.05, "
            "or of a run with the flow in the loop and BuiltInFlow(snapshots=0.05), say."
        )
    return dataset


# -- the free surface --------------------------------------------------------------------------------------------------


def plot_surface(axes: Axes, view: SurfaceView, index: int) -> list[Artist]:
    """Draw one snapshot in perspective."""
    time = float(view.data["snapshot"][index])
    axes.set_axis_off()
    axes.set_title(f"t = {time:.2f} s")
    return [axes.imshow(view.image(index), interpolation="lanczos")]


@checked
def plot_surfaces(
    figure: Figure | SubFigure,
    dataset: xr.Dataset,
    times: Sequence[float] | None = None,
    columns: Annotated[int, Quantity("1", at_least=1, at_most=20)] = 2,
) -> list[Axes]:
    """Draw the free surface at several instants, coloured by elevation, with one colour bar (as paper Fig. 9).

    Parameters
    ----------
    figure : Figure or SubFigure
        It needs a constrained layout.
    dataset : xr.Dataset
        Result of `captive_run` with `snapshots`.
    times : sequence of float, optional
        [s]; the nearest snapshots are drawn. Default: as many as `columns`, evenly spread up to the end.
    columns : int
        Panels beside one another.
    """
    view = SurfaceView(dataset)
    kept = dataset["snapshot"].values
    wanted = np.linspace(kept[-1] / columns, kept[-1], columns) if times is None else np.asarray(times)
    indices = sorted({int(np.abs(kept - t).argmin()) for t in wanted})
    rows = math.ceil(len(indices) / columns)
    panels = figure.subplots(rows, columns, squeeze=False)
    for axes in panels.flat:
        axes.set_axis_off()
    for axes, index in zip(panels.flat, indices, strict=False):
        plot_surface(axes, view, index)
    bar = figure.colorbar(view.mappable(), ax=panels, extend="both", shrink=0.8, aspect=22, pad=0.01)
    bar.set_label("elevation over still water [mm]")
    return list(panels.flat)


@checked
def plot_surface_map(
    axes: Axes, dataset: xr.Dataset, index: int = -1, range_mm: Annotated[float | None, RANGE] = None
) -> list[Artist]:
    """Draw the free surface from above in the vehicle's frame; cells that a solid pierces are left blank."""
    dataset = _with_snapshots(dataset)
    elevation = 1e3 * dataset["elevation"].values[index]
    limits = _limits(1e-3 * elevation, range_mm)
    mesh = axes.pcolormesh(
        dataset["x"], dataset["y"], elevation, cmap=COLORS, vmin=limits[0], vmax=limits[1], shading="nearest",
        rasterized=True,
    )  # fmt: skip
    axes.set_facecolor("0.75")
    axes.set(aspect="equal", xlabel="x [m]", ylabel="y [m]", title=f"t = {float(dataset['snapshot'][index]):.2f} s")
    axes.grid(visible=False)
    return [mesh]


@checked
def animate_surface(
    dataset: xr.Dataset, file: Path, frames_per_second: Annotated[float | None, FRAME_RATE] = None
) -> None:
    """Write a GIF or MP4 of the free surface with the vehicle in it.

    Parameters
    ----------
    dataset : xr.Dataset
        Result of `captive_run` with `snapshots`; each is a frame.
    file : Path
        Ending in .gif or .mp4.
    frames_per_second : float, optional
        Default: real time.

    Raises
    ------
    ValueError
        If there are no snapshots, the ending is neither .gif nor .mp4, or ffmpeg is missing for .mp4, or the frames
        cannot fit into memory.
    """
    path = file
    if path.suffix not in (".gif", ".mp4"):
        raise ValueError(f"animation {path}: the ending {path.suffix!r} is not known; use .gif or .mp4.")
    if path.suffix == ".mp4" and not FFMpegWriter.isAvailable():
        raise ValueError(f"{path}: writing MP4 needs the program ffmpeg, which is not installed; use .gif.")
    view = SurfaceView(dataset, size=(720, 480))
    times = dataset["snapshot"].values
    require_frames("animate_surface", len(times), 800 * 490, "keep snapshots at longer intervals.")
    rate = frames_per_second or (1.0 / float(np.diff(times).mean()) if len(times) > 1 else 10.0)
    writer = PillowWriter(fps=rate) if path.suffix == ".gif" else FFMpegWriter(fps=rate)  # type: ignore[arg-type]
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(figsize=(8.0, 4.9), layout="constrained")
        axes.set_axis_off()
        picture = axes.imshow(view.image(0))
        title = axes.set_title("t = 0.00 s", loc="left")
        axes.set_title(describe(dataset), loc="right", fontweight="normal", fontsize=9)
        figure.colorbar(view.mappable(), ax=axes, extend="both", shrink=0.8, aspect=22, pad=0.01).set_label(
            "elevation over still water [mm]"
        )
        footnote(figure, *trust_notes([dataset]))
        figure.canvas.draw()
        figure.set_layout_engine("none")  # laying out every frame anew costs more than drawing it

        def frame(index: int) -> list[Artist]:
            picture.set_data(view.image(index))
            title.set_text(f"t = {times[index]:.2f} s")
            return [picture, title]

        FuncAnimation(figure, frame, frames=len(times), blit=False).save(path, writer=writer, dpi=100)
    plt.close(figure)


def describe(dataset: xr.Dataset) -> str:
    """Return one line on a captive run: vehicle, its motion at the end, water."""
    stored = json.loads(dataset.attrs["parameters"])
    water = stored["water"]["Water"]
    name = next(iter(stored["vehicle"].values()))["name"]
    hull = dataset.sel(body="hull").isel(time=-1)
    vx, vy, _ = hull["velocity"].values
    speed = math.hypot(vx, vy)
    words = [f"{name}: {speed:.2g} m/s"]
    drift = math.degrees(math.remainder(math.atan2(vy, vx) - float(hull["yaw"]), 2.0 * math.pi))
    rate = math.degrees(float(hull["angular_velocity"].sel(axis="z")))
    words += [f"drift angle {drift:.3g}°"] if speed > 0.01 and abs(drift) > 0.1 else []
    words += [f"yaw rate {rate:.3g}°/s"] if abs(rate) > 0.1 else []
    if "depth" in water:
        return ", ".join([*words, f"current {water['current_speed']:g} m/s", f"depth {1e3 * water['depth']:.0f} mm"])
    deep, fast = float(dataset["water_depth"].max()), float(np.hypot(*dataset["current"].values[:, :2].T).max())
    return ", ".join([*words, f"current up to {fast:.2g} m/s", f"depth up to {1e3 * deep:.0f} mm"])
