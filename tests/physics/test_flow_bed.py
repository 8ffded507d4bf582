"""A given bed of the flow solver: geometry, bad input, restart, captive runs."""

import logging
import math
from dataclasses import replace

import numpy as np
import pytest

from exumob.flow import FlowSettings, FlowSolver, Grid, KOmegaSST, Poses, box, sphere
from exumob.flow.bed import lowest_bed
from exumob.flow.grid import HALO
from exumob.flow.vehicle_window import vehicle_window
from exumob.ground.terrain import Terrain
from exumob.support.rotations import about_z
from exumob.towing_tank.motion import CaptiveMotion
from exumob.towing_tank.run import captive_run
from exumob.verification.frames import SETTINGS, steady_motion
from exumob.verification.initial import TANK
from exumob.verification.single_body import one_pose
from exumob.water.conditions import Water
from exumob.water.cross_section import CrossSection
from vehicle_models.amphibious import amphibious_vehicle

GRID = Grid.uniform((-0.4, -0.4, -0.08), (0.4, 0.4, 0.2), 0.04)
SLOPE = Terrain(slope_x=0.1, slope_y=-0.05)


def started(terrain, water=None, settings=TANK, solids=(), poses=None, grid=GRID):
    solver = FlowSolver(grid, solids, water or Water(0.1), settings, terrain)
    solver.start(poses)
    return solver


def test_faces_are_open_above_a_plane_and_close_its_area():
    o, h = started(SLOPE).area_fractions, HALO
    size = 0.04
    inner = (slice(h, -h),) * 3
    bx, by, bz = o.bx, o.by, o.bz
    assert np.sum(bx[h + 3, h:-h, h + 5]) * size == pytest.approx(0.2 - SLOPE.height_and_normal(-0.2, -0.26)[0])
    # the bed's area vector in every cell is normal to the plane: what the faces are less open on one side
    closed = [np.diff(q, axis=a)[s] for q, a, s in (
        (bx, 2, np.s_[h:-h, h:-h, h : -h + 1]), (by, 0, np.s_[h : -h + 1, h:-h, h:-h]),
        (bz, 1, np.s_[h:-h, h : -h + 1, h:-h]))]  # fmt: skip
    assert np.abs(closed[0] + 0.1 * closed[2]).max() < 1e-5
    assert np.abs(closed[1] - 0.05 * closed[2]).max() < 1e-5
    assert closed[2].sum(axis=1) == pytest.approx(1.0)
    assert (o.nearest[inner] == 0).any() and (o.distance[inner] < 0.0).any()


def test_a_flat_terrain_on_the_lowest_face_is_the_plain_solver():
    poses = Poses.at_rest([[0.0, 0.0, 0.1]])
    grid = Grid.uniform((-0.4, -0.4, 0.0), (0.4, 0.4, 0.24), 0.04)
    settings = FlowSettings(follow=None, absorbing_width=0.1)
    water = Water(0.1, 0.2)
    one = started(None, water, settings, (box(0.2, 0.2, 0.1),), poses, grid)
    other = started(Terrain(), water, settings, (box(0.2, 0.2, 0.1),), poses, grid)
    assert other.area_fractions is other.bodies and not other.has_given_bed
    for n in range(3):
        assert np.array_equal(one.advance(0.01 * (n + 1)), other.advance(0.01 * (n + 1)))


def test_a_window_may_start_below_a_flat_bed_of_its_own():
    low = Terrain(height=-0.08)
    solver = started(low, Water(0.1))
    assert not solver.has_given_bed
    assert solver.surface_height() == pytest.approx(np.full((20, 20), 0.1))
    with pytest.raises(ValueError, match=r"Water.depth = 0.1 m does not reach the bed"):
        FlowSolver(Grid.uniform((-0.4, -0.4, 0.12), (0.4, 0.4, 0.4), 0.04), (), Water(0.1), TANK, Terrain(height=0.12))


def test_bad_input_names_the_remedy():
    with pytest.raises(ValueError, match=r"z_faces\[0\] = -0.08 m must be 0.*terrain"):
        FlowSolver(GRID, (), Water(0.1), TANK)
    with pytest.raises(ValueError, match=r"comes down to z = -0.24.*let Grid.z_faces start at or below"):
        started(Terrain(slope_x=0.6))
    with pytest.raises(ValueError, match=r"no bed in the window lies below the still level"):
        started(Terrain(height=0.15))
    rough = FlowSettings(follow=None, closure=KOmegaSST(), bed_roughness=1e-3)
    with pytest.raises(ValueError, match=r"bed_roughness: KOmegaSST"):
        FlowSolver(GRID, (), Water(0.1), rough, SLOPE)
    with pytest.raises(ValueError, match=r"solid 0 lies in the bed.*raise the solid"):
        started(Terrain(height=0.06, slope_x=0.01), None, TANK, (sphere(0.05),), Poses.at_rest([[0.0, 0.0, 0.05]]))
    with pytest.raises(ValueError, match=r"below the window"):
        started(SLOPE, None, TANK, (box(0.2, 0.2, 0.2),), Poses.at_rest([[0.0, 0.0, -0.02]]))


def test_a_current_across_an_uneven_bed_is_refused_and_one_along_it_is_not(caplog):
    settings = FlowSettings(follow=None, absorbing_width=0.1)
    with pytest.raises(ValueError, match=r"current crosses depths of 0.0\d+ to 0.1\d+ m"):
        started(Terrain(slope_x=0.1), Water(0.1, 0.3, 0.0), settings)
    started(Terrain(slope_x=0.1), Water(0.1, 0.3, 0.5 * math.pi), settings)
    started(Terrain(slope_x=0.005), Water(0.1, 0.3, 0.0), settings)
    # the bed falls off only beyond x = 0.5 m: the window comes upon it later
    x = np.linspace(-2.0, 2.0, 41)
    edge = Terrain(heights=np.tile(np.where(x > 0.5, -0.06, 0.0), (2, 1)), origin=(-2.0, -5.0), spacing=(0.1, 10.0))
    pose = steady_motion((2.0, 0.0), 0.0, 0.17)
    solver = FlowSolver(GRID, (sphere(0.01),), Water(0.1, 0.3), SETTINGS, edge)
    solver.start(pose(0.0))
    with caplog.at_level(logging.WARNING, "exumob.flow.bed"):
        for n in range(10):
            solver.advance(0.02 * (n + 1), pose(0.02 * (n + 1)))
    assert len([r for r in caplog.records if "crosses depths" in r.message]) == 1


def test_restart_over_a_bed_equals_a_single_run():
    def pose(t):
        return one_pose((0.3 * t, 0.0, 0.1), (0.3, 0.0, 0.0), 0.2 * t, 0.2)

    settings = FlowSettings(follow=0, absorbing_width=0.1, bed_roughness=1e-3)
    solver = FlowSolver(GRID, (box(0.2, 0.2, 0.06, friction=0.01),), Water(0.1), settings, SLOPE)
    solver.start(pose(0.0))
    for n in range(4):
        solver.advance(0.01 * (n + 1), pose(0.01 * (n + 1)))
    saved = solver.save()
    one = [solver.advance(0.01 * (n + 1), pose(0.01 * (n + 1))) for n in range(4, 7)]
    other = FlowSolver(GRID, (box(0.2, 0.2, 0.06, friction=0.01),), Water(0.1), settings, SLOPE)
    other.restore(saved)
    again = [other.advance(0.01 * (n + 1), pose(0.01 * (n + 1))) for n in range(4, 7)]
    assert np.array_equal(np.array(one), np.array(again))


def test_rough_bed_slows_a_current():
    water = Water(0.107, 0.3, math.atan2(2.0, 1.0))  # along the contours
    speeds = []
    for roughness in (None, 5e-3):
        settings = FlowSettings(follow=None, absorbing_width=0.1, bed_roughness=roughness)
        solver = started(SLOPE, water, settings)
        for n in range(10):
            solver.advance(0.02 * (n + 1))
        j = i = 10
        k = int(np.searchsorted(GRID.z_faces, solver.bed_height()[j, i])) - 1  # holds the bed
        speeds.append(math.hypot(solver.velocity[0][j, k, i], solver.velocity[1][j, k, i]))
    assert speeds[0] == pytest.approx(0.3, abs=1e-4)
    assert 0.2 < speeds[1] < 0.298


def test_lowest_bed_of_a_way():
    frames = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.5 * math.pi]])
    low = lowest_bed(Terrain(slope_y=0.1), frames, np.array([-2.0, -1.0]), np.array([1.0, 1.0]))
    assert low == pytest.approx(-0.2)
    assert np.allclose(about_z(0.5 * math.pi) @ [-2.0, 0.0, 0.0], [0.0, -2.0, 0.0])


def test_captive_run_over_a_bed():
    """Archimedes does not ask for the bed: over a ditch a vehicle at rest is lifted as over level ground, on one grid.

    The hull's draught is less than one of these cells, which costs it a third of its lift in both; 4 % allowed between
    them (found 2.7), 2 % for the wheels (1).
    """
    vehicle, water = amphibious_vehicle(), Water(0.12)
    x = np.linspace(-4.0, 4.0, 33)
    ditch = Terrain(heights=np.tile(-0.05 * np.exp(-((x - 0.2) ** 2) / 0.2), (2, 1)), origin=(-4.0, -9.0),
                    spacing=(0.25, 18.0))  # fmt: skip
    grid = vehicle_window(vehicle, 0.06, water, ditch)
    assert -0.12 < grid.z_faces[0] < -0.1
    assert vehicle_window(vehicle, 0.06, water, Terrain(height=-0.03)).z_faces[0] == pytest.approx(-0.03)
    run, level = (
        captive_run(
            vehicle, water, CaptiveMotion(0.5), grid=grid, duration=0.02, interval=0.01, snapshots=0.02,
            allow_coarse=True, terrain=terrain,
        )
        for terrain in (ditch, Terrain())
    )  # fmt: skip
    assert run.attrs["status"] == "completed"
    assert "Terrain" in run.attrs["parameters"]
    over_ditch, over_level = (one["force"].isel(time=-1).sel(axis="z").values for one in (run, level))
    assert over_ditch[0] == pytest.approx(over_level[0], rel=0.04)
    assert over_ditch[1:] == pytest.approx(over_level[1:], rel=0.02)
    assert float(np.abs(run["elevation"]).max()) < 5e-4


# -- a level, a river, dry land ----------------------------------------------------------------------------------------

RIVER = CrossSection(
    station=(-3.0, -0.9, -0.3, 0.4, 1.0, 3.0), bed=(0.05, 0.05, -0.12, -0.12, 0.05, 0.05),
    current=(0.0, 0.0, 0.4, 0.6, 0.0, 0.0),
)  # fmt: skip


def crossing(place=(0.0, 0.0, 0.0), turn=0.0):
    """A ball towed across the river, seen from the window that follows it: loads of six intervals, body axes."""
    origin, level = (place[0], place[1]), place[2]
    section = replace(RIVER, bed=tuple(z + level for z in RIVER.bed))
    terrain = section.terrain(origin=origin, direction=turn)
    water = section.water(level, origin=origin, direction=turn)
    grid = Grid.uniform((-0.4, -0.4, -0.173 + level), (0.4, 0.4, 0.147 + level), 0.04)  # no surface on a face
    solver = FlowSolver(grid, (sphere(0.06, friction=0.01),), water, SETTINGS, terrain)
    about = about_z(turn)

    def pose(t):
        here = np.array(place) + about @ [-0.3 + 0.8 * t, 0.0, -0.03]
        return one_pose(tuple(here), tuple(about @ [0.8, 0.0, 0.0]), turn, 0.0)

    solver.start(pose(0.0))
    return np.array([solver.advance(0.01 * (n + 1), pose(0.01 * (n + 1))) for n in range(6)])


def test_a_river_elsewhere_and_turned_is_the_same_river():
    here = crossing()
    assert np.abs(here[:, 0, 1]).max() > 0.05  # the current pushes to the left
    # area fractions are kept in single precision, and an edge's cells pass that on to the flow that leaves it
    assert crossing((1000.0, 2000.0, 7.0), math.radians(37.0)) == pytest.approx(here, abs=1e-4)


def test_restart_in_a_river_equals_a_single_run():
    def made():
        grid = Grid.uniform((-0.4, -0.4, -0.16), (0.4, 0.4, 0.16), 0.04)
        return FlowSolver(grid, (sphere(0.06, friction=0.01),), RIVER.water(0.0), SETTINGS, RIVER.terrain())

    def pose(t):
        return one_pose((0.8 * t, 0.0, -0.03), (0.8, 0.0, 0.0), 0.5 * t, 0.5)

    solver = made()
    solver.start(pose(0.0))
    for n in range(3):
        solver.advance(0.01 * (n + 1), pose(0.01 * (n + 1)))
    saved = solver.save()
    one = [solver.advance(0.01 * (n + 1), pose(0.01 * (n + 1))) for n in range(3, 6)]
    other = made()
    other.restore(saved)
    assert np.array_equal(one, [other.advance(0.01 * (n + 1), pose(0.01 * (n + 1))) for n in range(3, 6)])


def test_a_window_on_dry_land_has_no_loads_and_comes_to_water():
    """Half submerged in the end: a ball that was moved in air over the bank."""
    x = np.linspace(-6.0, 6.0, 21)
    bank = Terrain(heights=np.tile(np.where(x < 0.1, 0.2, -0.1), (2, 1)), origin=(-6.0, -9.0), spacing=(0.6, 18.0))
    grid = Grid.uniform((-0.4, -0.4, -0.14), (0.4, 0.4, 0.3), 0.04)

    def pose(t):
        return one_pose((-1.2 + 3.0 * t, 0.0, 0.27 if t < 0.6 else 0.27 - 0.9 * (t - 0.6)), (3.0, 0.0, 0.0))

    with pytest.raises(ValueError, match=r"no bed in the window lies below the still level at z = 0 m"):
        FlowSolver(grid, (sphere(0.05),), Water(level=0.0), SETTINGS, bank).start(pose(0.0))
    solver = FlowSolver(grid, (sphere(0.05),), Water(level=0.0), SETTINGS, bank, may_be_dry=True)
    solver.start(pose(0.0))
    drag = np.array([solver.advance(0.01 * (n + 1), pose(0.01 * (n + 1)))[0, 0] for n in range(90)])
    assert np.abs(drag[:60]).max() == 0.0
    assert solver.surface_height()[:, -3:] == pytest.approx(0.0, abs=0.01)
    assert drag[-1] < -1.0


def test_deep_water_ends_at_a_depth_of_its_own():
    grid = Grid.uniform((-0.4, -0.4, -0.2), (0.4, 0.4, 0.2), 0.04)
    solver = FlowSolver(grid, (), Water(level=0.0), TANK, Terrain(slope_x=1.0), deepest=-0.18)
    solver.start()
    assert solver.bed_height().min() == pytest.approx(-0.18)
    for n in range(3):
        solver.advance(0.01 * (n + 1))
    assert np.abs(solver.surface_height()[solver.bed_height() < -0.05]).max() < 1e-3
