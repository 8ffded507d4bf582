"""Pictures and files of captive runs: the free surface, the loads, GIF, VTK files read back."""

import dataclasses
import re
import xml.etree.ElementTree as ET
import zlib

import matplotlib
import numpy as np
import pytest

matplotlib.use("Agg")

import matplotlib.pyplot as plt
from PIL import Image

from exumob.flow import FlowSettings, FlowSolver, Grid, vehicle_solids
from exumob.flow.output.pictures import (
    SurfaceView,
    animate_surface,
    describe,
    plot_surface_map,
    plot_surfaces,
)
from exumob.flow.output.snapshots import surface_elevation
from exumob.flow.output.vehicle_surface import body_triangles, stored_vehicle
from exumob.flow.output.vtk import VtkSeries, surface_triangles, volume_fields
from exumob.support.figures import save_figure
from exumob.towing_tank.motion import CaptiveMotion
from exumob.towing_tank.plots import plot_captive
from exumob.towing_tank.run import captive_run
from exumob.water.conditions import Water
from vehicle_models.amphibious import amphibious_vehicle
from vehicle_models.light_4x4 import light_4x4

VEHICLE = amphibious_vehicle()
GRID = Grid.around_vehicle(VEHICLE, 0.045, ahead=1.1, behind=1.2, aside=0.9, top=0.3, growth=1.08)
MOTION = CaptiveMotion(speed=1.0, ramp_time=0.1, drift_angle=0.2, yaw_rate=0.5, wheel_speed=10.0)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("fields") / "vtk"


@pytest.fixture(scope="module")
def run(folder):
    """0.1 s with the fields of three instants in `folder`."""
    return captive_run(
        VEHICLE, Water(0.12, 1.0), MOTION, grid=GRID, settings=FlowSettings(absorbing_width=0.3), interval=5e-3,
        duration=0.1, snapshots=0.05, on_snapshot=VtkSeries(folder, VEHICLE).add, allow_coarse=True,
    )  # fmt: skip


# -- the surface -------------------------------------------------------------------------------------------------------


def test_elevation_over_a_sunk_solid_and_under_a_high_hull():
    """Water over a deeply sunk vehicle, and under a hull out of the water, is not masked; at the wheels it is."""
    solids = vehicle_solids(VEHICLE, 0.045)
    deep = FlowSolver(
        Grid.around_vehicle(VEHICLE, 0.045, ahead=1.1, behind=1.2, aside=0.9, top=0.6), solids, Water(0.4)
    )
    deep.start(MOTION.poses(VEHICLE, Water(0.4), 0.0))
    assert np.abs(surface_elevation(deep)).max() < 1e-6
    shallow = FlowSolver(GRID, solids, Water(0.05))
    shallow.start(MOTION.poses(VEHICLE, Water(0.05), 0.0))
    elevation = surface_elevation(shallow)
    assert np.isfinite(elevation[elevation.shape[0] // 2]).all()  # under the keel, 28 mm above the water
    assert np.isnan(elevation).any()
    assert np.nanmax(np.abs(elevation)) < 1e-6


def test_picture_shows_water_vehicle_and_background(run):
    view = SurfaceView(run, range_mm=30.0, size=(300, 200))
    image = view.image(-1)
    assert image.shape == (200, 300, 3)
    assert (image[0, 0] == 1.0).all()
    brightness = image.sum(axis=2)
    assert (brightness < 1.2).sum() > 50  # wheels
    amber = (image[..., 0] > 1.8 * image[..., 2]) & (image[..., 1] > 1.5 * image[..., 2])
    assert amber.sum() > 0.02 * amber.size  # hull
    assert view.mappable().get_clim() == (-30.0, 30.0)
    assert np.abs(image - view.image(0)).max() > 0.1


def test_figures_are_drawn(run, tmp_path):
    figure = plot_captive(run)
    labels = [axes.get_ylabel() for axes in figure.axes]
    for label in ("$F_x$ [N]", "$F_z$ [N]", "$M_y$ [N m]", "elevation over still water [mm]"):
        assert label in labels
    assert save_figure(figure, tmp_path / "run.png").stat().st_size > 20000
    without = plot_captive(run.drop_dims("snapshot"))
    assert len(without.axes) == 12
    plt.close(without)
    panels = plt.figure(layout="constrained")
    shown = plot_surfaces(panels, run, times=[0.0, 0.04, 0.1])
    assert [a.get_title() for a in shown if a.get_title()] == ["t = 0.00 s", "t = 0.05 s", "t = 0.10 s"]
    plt.close(panels)


def test_map_leaves_solids_blank(run):
    figure, axes = plt.subplots()
    (mesh,) = plot_surface_map(axes, run, 0)
    assert np.ma.getmaskarray(mesh.get_array()).sum() == int(np.isnan(run["elevation"].isel(snapshot=0)).sum()) > 10
    plt.close(figure)


def test_line_on_a_run(run):
    assert describe(run) == "amphibious: 1 m/s, drift angle 11.5°, yaw rate 28.6°/s, current 1 m/s, depth 120 mm"


def test_gif_has_a_frame_for_each_snapshot(run, tmp_path):
    animate_surface(run, tmp_path / "run.gif")
    with Image.open(tmp_path / "run.gif") as gif:
        assert gif.n_frames == run.sizes["snapshot"] == 3
        assert gif.info["duration"] == 50  # real time


@pytest.mark.parametrize(
    ("name", "message"), [("run.avi", r"\.avi.*use \.gif or \.mp4"), ("run.gif", "holds no snapshots.*snapshots=")]
)
def test_animation_that_cannot_be_made(run, tmp_path, name, message):
    data = run if name == "run.avi" else run.drop_dims("snapshot")
    with pytest.raises(ValueError, match=message):
        animate_surface(data, tmp_path / name)


@pytest.mark.parametrize("vehicle", [VEHICLE, light_4x4()], ids=lambda v: v.name)
def test_vehicle_comes_back_from_a_result(run, vehicle):
    from exumob.support.provenance import parameters_json

    stored = run.assign_attrs(parameters=parameters_json({"vehicle": vehicle}))
    assert stored_vehicle(stored) == vehicle


# -- VTK files ---------------------------------------------------------------------------------------------------------


def array_of(file, name):
    """One array of a VTK XML file by the format's definition, without VTK."""
    text = file.read_bytes()
    head, data = text.split(b'<AppendedData encoding="raw">\n_', 1)
    tag = re.search(rb'<DataArray type="(\w+)" Name="%b".*?offset="(\d+)"' % name.encode(), head)
    offset = int(tag[2])
    count, size, partial, packed = np.frombuffer(data, "<u8", 4, offset)
    assert (count, partial) == (1, 0)
    raw = zlib.decompress(data[offset + 32 : offset + 32 + int(packed)])
    assert len(raw) == size
    return np.frombuffer(raw, {b"Float32": "<f4", b"Float64": "<f8", b"Int32": "<i4", b"Int64": "<i8"}[tag[1]])


def test_files_hold_the_fields_of_the_solver(tmp_path):
    water = Water(0.12, 1.0)
    solver = FlowSolver(GRID, vehicle_solids(VEHICLE, 0.045), water, FlowSettings(absorbing_width=0.3))
    poses = MOTION.poses(VEHICLE, water, 0.0)
    solver.start(poses)
    solver.advance(5e-3, MOTION.poses(VEHICLE, water, 5e-3))
    VtkSeries(tmp_path / "new", VEHICLE).add(solver, MOTION.poses(VEHICLE, water, 5e-3))
    volume = tmp_path / "new" / "volume_0000.vtr"
    ny, nz, nx = GRID.shape
    fraction = array_of(volume, "fraction").reshape(nz, ny, nx)
    assert fraction == pytest.approx(np.moveaxis(solver.fraction, 1, 0), abs=1e-6)
    assert array_of(volume, "x") == pytest.approx(GRID.x_faces)
    assert array_of(volume, "frame") == pytest.approx(solver.frame)
    velocity = array_of(volume, "velocity").reshape(nz, ny, nx, 3)
    inner = 0.5 * (solver.velocity[0][..., :-1] + solver.velocity[0][..., 1:])
    assert velocity[..., :-1, 0] == pytest.approx(np.moveaxis(inner, 1, 0), abs=1e-6)
    assert volume_fields(solver)["pressure"].max() > 0.8 * 9810.0 * 0.12 * (1 - 0.5 / 3)
    points, triangles, elevation = surface_triangles(solver)
    surface = tmp_path / "new" / "surface_0000.vtp"
    assert array_of(surface, "connectivity") == pytest.approx(triangles.ravel())
    assert array_of(surface, "elevation") == pytest.approx(elevation, abs=1e-6)
    assert points[:, 2] == pytest.approx(elevation + 0.12)
    normals = np.cross(
        points[triangles[:, 1]] - points[triangles[:, 0]], points[triangles[:, 2]] - points[triangles[:, 0]]
    )
    assert (normals[:, 2] > 0.0).all()
    bodies = array_of(tmp_path / "new" / "vehicle_0000.vtp", "body")
    assert np.bincount(bodies).tolist() == [len(t) for t in body_triangles(VEHICLE)]


def test_series_lists_every_file_with_its_time(run, folder):
    entries = ET.parse(folder / "flow.pvd").getroot().findall("Collection/DataSet")
    times = sorted({float(e.get("timestep")) for e in entries})
    assert times == pytest.approx(run["snapshot"].values)
    assert len(entries) == 9
    assert {e.get("file") for e in entries} | {"flow.pvd"} == {file.name for file in folder.iterdir()}


def test_vtk_reads_the_files(run, folder):
    pyvista = pytest.importorskip("pyvista")
    reader = pyvista.get_reader(folder / "flow.pvd")
    reader.set_active_time_value(reader.time_values[-1])
    volume, surface, vehicle = reader.read()
    assert volume.n_cells == GRID.n_cells
    assert volume.cell_data["velocity"].shape == (GRID.n_cells, 3)
    assert float(surface.point_data["elevation"].max()) == pytest.approx(
        float(run["elevation"].isel(snapshot=-1).max())
    )
    assert vehicle.bounds[5] == pytest.approx(VEHICLE.hull.ground_clearance + VEHICLE.hull.height, abs=1e-6)
    assert volume.field_data["frame"] == pytest.approx(run["frame"].isel(snapshot=-1).values)


def test_vtk_folder_that_cannot_be(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(ValueError, match="is a file; give a folder"):
        VtkSeries(tmp_path / "file", VEHICLE)
    with pytest.raises(ValueError, match="does not exist; create it"):
        VtkSeries(tmp_path / "absent" / "vtk", VEHICLE)
    VtkSeries(tmp_path / "later", dataclasses.replace(VEHICLE))
    assert not (tmp_path / "later").exists()  # nothing is left by a run that is refused
