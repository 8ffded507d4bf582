"""Captive runs before they begin: smoothing, motion, checks."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from exumob.driving.maneuver import lane_change
from exumob.flow import FlowSettings, Grid
from exumob.flow.resolution import check_resolution
from exumob.ground.terrain import Terrain
from exumob.support.smoothing import smoothed, window_samples
from exumob.towing_tank.motion import CaptiveMotion
from exumob.towing_tank.run import captive_run
from exumob.water.conditions import Water
from vehicle_models.amphibious import amphibious_vehicle

VEHICLE = amphibious_vehicle()
WATER = Water(0.12, 1.0)
GRID = Grid.around_vehicle(VEHICLE, 0.045, ahead=1.1, behind=1.2, aside=0.9, top=0.3, growth=1.08)
COARSE = {
    "grid": GRID, "settings": FlowSettings(absorbing_width=0.3), "interval": 5e-3, "allow_coarse": True,
    "duration": 0.05,
}  # fmt: skip
EVERYTHING = CaptiveMotion(
    speed=1.2, drift_angle=0.2, yaw_rate=0.7, wheel_speed=9.0, steering=0.1, steering_amplitude=0.2,
    sway_amplitude=0.05, yaw_amplitude=0.1, heave_amplitude=0.01, pitch_amplitude=0.03, heave=0.005, pitch=0.01,
    ramp_time=0.8, frequency=0.6,
)  # fmt: skip


# -- smoothing ---------------------------------------------------------------------------------------------------------


def test_smoothing_is_a_centred_mean_that_keeps_straight_lines():
    t = np.arange(60) * 1e-3
    assert window_samples(1e-3) == 15
    assert smoothed(3.0 + 2.0 * t, 1e-3) == pytest.approx(3.0 + 2.0 * t, abs=1e-12)
    spike = np.zeros((60, 2))
    spike[30, 1] = 15.0
    smooth = smoothed(spike, 1e-3)
    assert smooth[23:38, 1] == pytest.approx(np.ones(15))  # 7 samples either side: no shift
    assert np.abs(smooth[:, 0]).max() == 0.0
    assert np.abs(np.delete(smooth[:, 1], np.arange(23, 38))).max() < 1e-12
    assert smoothed(t, 0.02) == pytest.approx(t)  # coarser than the window: nothing to average
    assert smoothed(np.zeros((0, 3)), 1e-3).shape == (0, 3)


# -- motion ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("time", [0.1, 0.5, 0.79, 0.81, 2.3])
@pytest.mark.parametrize(
    "motion", [EVERYTHING, CaptiveMotion(driver=lane_change(), yaw_rate=-0.4)], ids=["everything", "driver"]
)
def test_velocities_are_derivatives_of_places(motion, time):
    h = 1e-5
    before, now, after = (motion.poses(VEHICLE, WATER, time + d) for d in (-h, 0.0, h))
    assert (after.position - before.position) / (2 * h) == pytest.approx(now.velocity, abs=1e-8)
    turned = Rotation.from_matrix(after.rotation @ before.rotation.mT).as_rotvec() / (2 * h)
    assert turned == pytest.approx(now.angular_velocity, abs=1e-8)


def test_start_is_with_the_current_and_smooth():
    """C2: velocities relative to the water grow with the square of time at least, so that accelerations start at 0."""
    water = Water(0.12, 0.8, 2.0)
    motion = dataclasses.replace(EVERYTHING, heave=0.0, pitch=0.0)
    slips = []
    for t in (0.0, 1e-3, 2e-3):
        p = motion.poses(VEHICLE, water, t)
        slips.append(np.abs(p.velocity - water.velocity).max() + np.abs(p.angular_velocity).max())
    assert slips[0] < 1e-12
    assert slips[2] < 1e-4
    assert slips[2] / slips[1] > 3.95


def test_towing_path_speed_and_drift():
    motion = CaptiveMotion(speed=1.5, drift_angle=0.3, ramp_time=0.5)
    a, b = (motion.poses(VEHICLE, WATER, t) for t in (1.0, 2.0))
    assert b.position - a.position == pytest.approx(np.tile([1.5, 0.0, 0.0], (5, 1)))
    forward, left, _ = b.rotation[0].T @ b.velocity[0]
    assert math.atan2(left, forward) == pytest.approx(0.3)  # course less heading
    assert b.position[1:, 2] == pytest.approx(VEHICLE.wheel.radius)  # wheels on the ground


def test_turning_path_is_a_circle():
    """Radius V / r about a fixed centre, at constant drift angle."""
    motion = CaptiveMotion(speed=1.2, yaw_rate=0.6, drift_angle=0.1, ramp_time=0.5)
    centers = []
    for t in (0.6, 1.5, 4.0):
        p = motion.poses(VEHICLE, WATER, t)
        v = p.velocity[0, :2]
        centers.append(p.position[0, :2] + np.array([-v[1], v[0]]) / 0.6)
        forward, left, _ = p.rotation[0].T @ p.velocity[0]
        assert (math.hypot(*v), math.atan2(left, forward)) == (pytest.approx(1.2), pytest.approx(0.1))
    assert np.ptp(centers, axis=0) == pytest.approx(np.zeros(2), abs=1e-12)


def test_pure_yaw_keeps_the_heading_on_the_path():
    speed, sway, frequency = 1.0, 0.02, 0.5
    motion = CaptiveMotion(
        speed=speed, sway_amplitude=sway, yaw_amplitude=2 * math.pi * frequency * sway / speed, frequency=frequency
    )
    for t in np.linspace(1.0, 3.0, 9):
        p = motion.poses(VEHICLE, WATER, t)
        assert abs((p.rotation[0].T @ p.velocity[0])[1]) < 2e-4  # small angles: cubic rest


def test_driver_steers_and_spins():
    driver = lane_change()
    p = CaptiveMotion(speed=1.0, driver=driver).poses(VEHICLE, WATER, 2.8)
    angle = math.atan2(p.rotation[1, 1, 0], p.rotation[1, 0, 0])
    assert angle == pytest.approx(driver.steering(2.8)[0])
    assert abs(angle) > 0.3
    assert p.spin == pytest.approx([0.0, 10.0, 10.0, 10.0, 10.0])


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"speed": math.nan}, r"CaptiveMotion\.speed"),
        ({"ramp_time": 0.0}, r"CaptiveMotion\.ramp_time = 0\.0 s must be >= 0\.001"),
        ({"drift_angle": 10.0}, r"CaptiveMotion\.drift_angle = 10\.0.*radians"),
        ({"driver": lane_change(), "wheel_speed": 1.0}, "driver steers and spins"),
    ],
)  # fmt: skip
def test_bad_motion_values(values, message):
    with pytest.raises(ValueError, match=message):
        CaptiveMotion(**values)


# -- checks before the run ---------------------------------------------------------------------------------------------


def test_coarse_cells_are_named_with_what_would_do():
    """At 30 degrees a wheel clears the hull by 25 mm with sharp edges, 28 mm with its rounded ones."""
    grid = Grid.around_vehicle(VEHICLE, 0.018)
    check_resolution(VEHICLE, grid)
    angle = math.radians(30.0)
    with pytest.raises(ValueError, match=r"hull and front \w+ wheel steered -?30 deg of 28\.\d mm has 1\.6 cells") as e:
        check_resolution(VEHICLE, grid, (-angle, angle))
    finest = float(str(e.value).split("cell size of ")[1].split(" m")[0])
    assert finest == pytest.approx(0.0141, abs=6e-5)
    check_resolution(VEHICLE, Grid.around_vehicle(VEHICLE, 0.98 * finest), (-angle, angle))


def test_wheel_too_coarse_is_named():
    with pytest.raises(ValueError, match=r"wheel's width of 80\.0 mm has 2\.\d cells.*needs 4; use .* 0\.02 m"):
        check_resolution(VEHICLE, Grid.around_vehicle(VEHICLE, 0.03))


def test_allowed_coarse_cells_are_warned_of(caplog):
    check_resolution(VEHICLE, Grid.around_vehicle(VEHICLE, 0.03), allow_coarse=True)
    assert "wheel's width" in caplog.text


def test_wheel_that_would_cut_the_hull():
    steering = dataclasses.replace(VEHICLE.steering, limit=0.1)  # of the vehicle; a captive run may steer more
    narrow = dataclasses.replace(VEHICLE, track=0.545, steering=steering)
    with pytest.raises(ValueError, match=r"wheel cuts \d+ mm into the hull when steered"):
        check_resolution(narrow, Grid.around_vehicle(narrow, 0.018), (-0.5, 0.5))


def test_vehicle_outside_the_window():
    grid = Grid.uniform((-0.5, -1.0, 0.0), (1.0, 1.0, 0.4), 0.02)
    with pytest.raises(ValueError, match=r"amphibious reaches from -0\.500 to .* m along x.*window only from -0\.5"):
        check_resolution(VEHICLE, grid)


def test_water_deeper_than_the_window():
    with pytest.raises(ValueError, match=r"Water\.depth = 0\.5 m does not fit.*raise Grid\.z_faces"):
        captive_run(VEHICLE, Water(0.5, 1.0), **COARSE)


def test_mesh_with_a_hole(tmp_path):
    trimesh = pytest.importorskip("trimesh")
    mesh = trimesh.creation.box((1.0, 0.44, 0.2))
    mesh.apply_translation((0.0, 0.0, 0.178))
    trimesh.Trimesh(mesh.vertices, mesh.faces[:-1], process=False).export(tmp_path / "hull.stl")
    leaking = dataclasses.replace(VEHICLE, hull=dataclasses.replace(VEHICLE.hull, mesh=tmp_path / "hull.stl"))
    with pytest.raises(ValueError, match="not watertight"):
        check_resolution(leaking, Grid.around_vehicle(VEHICLE, 0.018))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"duration": 0.052}, r"duration = 0\.052 s must be a whole multiple of interval = 0\.005 s"),
        ({"duration": -1.0}, r"captive_run\.duration"),
        ({"snapshots": 0.007}, r"snapshots = 0\.007 s must be a whole multiple"),
        ({"settings": FlowSettings(follow=None)}, r"follow = None; it must be 0"),
        ({"grid": None, "cell_size": 0.0}, r"captive_run\.cell_size = 0\.0 m must be > 0"),
        ({"motion": CaptiveMotion(steering=1.0), "duration": 2.0}, r"57\.3 deg, beyond the 35\.0 deg"),
        ({"allow_coarse": False}, "needs 4"),
    ],
)  # fmt: skip
def test_bad_input_before_the_run(changes, message):
    with pytest.raises(ValueError, match=message):
        captive_run(VEHICLE, WATER, **(COARSE | changes))


class Lying:
    """A motion whose velocity is not the derivative of its place."""

    def poses(self, vehicle, water, time):
        p = CaptiveMotion().poses(vehicle, water, time)
        return dataclasses.replace(p, velocity=p.velocity + np.array([0.0, 0.1, 0.0]))


def test_motion_whose_velocity_is_wrong_is_refused():
    with pytest.raises(ValueError, match=r"velocity of \w+ at .* is 0\.1 off the derivative"):
        captive_run(VEHICLE, WATER, Lying(), **COARSE)


@pytest.mark.parametrize(
    ("terrain", "message"),
    [
        (Terrain(heights=np.zeros((20, 20)), origin=(-1.0, -1.0), spacing=0.1), r"x = -1 to 0\.9 m .*pad it"),
        (Terrain(heights=np.zeros((20, 20)), origin=(456_789.0, 5_432_101.0)), "subtract the place of the start"),
        (Terrain(heights=np.zeros((9, 90)), origin=(-4.0, -0.4), spacing=0.1), "the flow's window on its way"),
    ],
)
def test_a_bed_that_ends_within_the_window(terrain, message):
    with pytest.raises(ValueError, match=message):
        captive_run(VEHICLE, WATER, terrain=terrain, **COARSE)
