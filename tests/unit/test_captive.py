"""Captive runs: motion, checks before the run, the result, symmetry, runs that break or are stopped. Coarse, short."""

import dataclasses
import json
import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from exumob.driving.maneuver import lane_change
from exumob.flow import FlowSettings, FlowSolver, Grid, KOmegaSST, Tread
from exumob.flow.resolution import check_resolution
from exumob.flow.vehicle_window import vehicle_window
from exumob.simulation.results import load_dataset, save_dataset
from exumob.support.errors import SimulationError, SimulationInterrupted
from exumob.support.smoothing import smoothed, window_samples
from exumob.towing_tank.motion import CaptiveMotion
from exumob.towing_tank.record import VARIABLES, captive_summary
from exumob.towing_tank.run import captive_run
from exumob.vehicle.motion import BODIES
from exumob.water.conditions import Water
from vehicle_models.amphibious import amphibious_vehicle
from vehicle_models.light_4x4 import light_4x4

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
MIRROR_BODIES = [0, 2, 1, 4, 3]
POLAR, AXIAL = np.array([1.0, -1.0, 1.0]), np.array([-1.0, 1.0, -1.0])


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
        ({"ramp_time": 0.0}, r"CaptiveMotion\.ramp_time = 0\.0 must be > 0"),
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
    narrow = dataclasses.replace(VEHICLE, track=0.54)
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
        ({"grid": None, "cell_size": 0.0}, r"cell_size = 0\.0 must be > 0"),
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


class Sudden:
    """Moves at once."""

    parameters = {"speed": 0.5}  # noqa: RUF012

    def poses(self, vehicle, water, time):
        origins = np.vstack([vehicle.hull_origin, vehicle.wheel_centers])
        p = CaptiveMotion().poses(vehicle, water, 0.0)
        return dataclasses.replace(
            p, position=origins + np.array([0.5 * time, 0.0, 0.0]), velocity=np.tile([0.5, 0.0, 0.0], (5, 1))
        )


def test_motion_whose_velocity_is_wrong_is_refused():
    with pytest.raises(ValueError, match=r"velocity of \w+ at .* is 0\.1 off the derivative"):
        captive_run(VEHICLE, WATER, Lying(), **COARSE)


# -- runs --------------------------------------------------------------------------------------------------------------

DRIFTING = CaptiveMotion(speed=1.0, drift_angle=0.35, ramp_time=0.1, yaw_rate=0.3, wheel_speed=10.0)


@pytest.fixture(scope="module")
def drifting():
    return captive_run(VEHICLE, WATER, DRIFTING, snapshots=0.025, **(COARSE | {"duration": 0.15}))


def test_result_holds_what_it_promises(drifting, tmp_path):
    again = load_dataset(save_dataset(drifting, tmp_path / "run.nc"))
    assert again.identical(drifting.assign_attrs(again.attrs))
    for name, (dims, units, _) in VARIABLES.items():
        assert again[name].dims == tuple(dims.split())
        assert again[name].attrs["units"] == units
        assert again[name].attrs["long_name"]
    assert list(again["body"].values) == list(BODIES)
    assert again["time"].values == pytest.approx(5e-3 * np.arange(1, 31))
    for key in ("exumob_version", "exudyn_version", "git_revision", "date", "random_seed"):
        assert again.attrs[key]
    assert again.attrs["status"] == "completed"
    assert again.attrs["smoothing_window"] == pytest.approx(0.015)
    stored = json.loads(again.attrs["parameters"])
    assert stored["motion"]["CaptiveMotion"]["drift_angle"] == 0.35
    assert stored["water"]["Water"]["depth"] == 0.12
    assert stored["settings"]["FlowSettings"]["absorbing_width"] == 0.3
    assert stored["vehicle"]["Vehicle"]["name"] == "amphibious"


def test_parts_add_up_and_smooth_is_smoothed(drifting):
    for name in ("force", "moment"):
        parts = sum(drifting[f"{name}_{part}"] for part in ("pressure", "shear", "exchange"))
        assert parts.values == pytest.approx(drifting[name].values, abs=1e-10)
        assert drifting[f"{name}_smooth"].values == pytest.approx(smoothed(drifting[name].values, 5e-3))


def test_water_pushes_a_drifting_vehicle_back_and_aside(drifting):
    """Slipping to its left, it is pushed back to its right; its hull is buoyed (draught 42 mm: 175 N at rest)."""
    hull = drifting["force"].sel(body="hull").isel(time=slice(-10, None)).mean("time").values
    assert hull[0] < 0.0
    assert hull[1] < 0.0
    assert 80.0 < hull[2] < 260.0


@pytest.mark.parametrize(
    "changes",
    [
        {"settings": FlowSettings(absorbing_width=0.3, closure=KOmegaSST())},
        {"settings": FlowSettings(absorbing_width=0.3, surface="plic")},
        {"tread": Tread(lug_height=0.01, lug_count=24)},
    ],
    ids=["k-omega SST", "PLIC", "lugs"],
)
def test_models_of_turbulence_surface_and_tread_run_on_the_vehicle(drifting, changes):
    """Each changes the loads, but not what they are about: 0.15 s from the start, forces on the hull within 15 %."""
    run = captive_run(VEHICLE, WATER, DRIFTING, **(COARSE | {"duration": 0.15} | changes))
    late = slice(-10, None)
    with_it, without = (d["force"].sel(body="hull").isel(time=late).mean("time").values for d in (run, drifting))
    assert np.abs(with_it - without).max() < 0.15 * np.abs(without).max()
    wheels = [d["force"].isel(body=slice(1, 5), time=late).values for d in (run, drifting)]
    assert np.abs(wheels[0] - wheels[1]).max() > 1e-3
    if "tread" in changes:
        assert "lug_height" in run.attrs["parameters"]


def test_states_are_those_of_the_motion(drifting):
    last = drifting.isel(time=-1)
    p = DRIFTING.poses(VEHICLE, WATER, 0.15)
    assert last["position"].values == pytest.approx(p.position)
    assert last["velocity"].values == pytest.approx(p.velocity)
    assert last["wheel_speed"].values == pytest.approx(p.spin[1:])
    assert Rotation.from_quat(last["quaternion"].values, scalar_first=True).as_matrix() == pytest.approx(p.rotation)
    assert float(last["yaw"].sel(body="hull")) == pytest.approx(DRIFTING.heading(0.15)[0])
    assert float(drifting["iterations"].min()) >= 1.0


def test_snapshots_hold_the_surface_and_leave_out_solids(drifting):
    assert drifting["snapshot"].values == pytest.approx(np.arange(0.0, 0.151, 0.025))
    elevation = drifting["elevation"]
    first = elevation.isel(snapshot=0).values
    masked = ~np.isfinite(first)
    assert np.abs(first[~masked]).max() < 1e-6  # undisturbed at the start, hulls and wheels apart
    hull = VEHICLE.hull
    plan = hull.width * (hull.length - hull.bow_length) + 4.0 * VEHICLE.wheel.width * VEHICLE.wheel.diameter
    cell = np.outer(np.diff(GRID.y_faces), np.diff(GRID.x_faces))
    assert cell[masked].sum() == pytest.approx(plan, rel=0.15)
    assert float(np.abs(elevation.isel(snapshot=-1)).max()) > 0.003
    assert drifting["frame"].isel(snapshot=-1).values == pytest.approx(
        [*DRIFTING.poses(VEHICLE, WATER, 0.15).position[0, :2], DRIFTING.heading(0.15)[0]]
    )
    wheel = VEHICLE.wheel_centers[0] - VEHICLE.hull_origin * np.array([1.0, 1.0, 0.0])
    at = drifting["snapshot_position"].sel(body="front_left").values
    assert at == pytest.approx(np.tile(wheel, (7, 1)))  # grid axes turn with the hull


def test_mirrored_motion_gives_mirrored_loads(drifting):
    mirrored = captive_run(
        VEHICLE, WATER, dataclasses.replace(DRIFTING, drift_angle=-0.35, yaw_rate=-0.3), **COARSE
    )  # fmt: skip
    some = drifting.isel(time=slice(0, 10))
    for name, sign in (("force", POLAR), ("moment", AXIAL)):
        largest = np.abs(some[name].values).max()
        apart = some[name].values - sign * mirrored[name].values[:, MIRROR_BODIES]
        assert np.abs(apart[1:]).max() < 1e-4 * largest


def test_towed_in_still_water_is_held_in_a_current():
    """Galileo: nothing but the motion relative to the water counts (the bed exerts no friction)."""
    towed = captive_run(VEHICLE, Water(0.12), CaptiveMotion(speed=0.8, ramp_time=0.1), **COARSE)
    held = captive_run(VEHICLE, Water(0.12, 0.8), CaptiveMotion(speed=0.0, ramp_time=0.1), **COARSE)
    assert np.abs(towed["position"] - held["position"]).max() > 0.03
    for name in ("force", "moment"):
        assert np.abs(towed[name] - held[name]).max() < 1e-4 * np.abs(towed[name]).max()


def test_summary_is_that_of_the_second_half(drifting):
    figures = captive_summary(drifting)
    later = drifting["force"].sel(time=slice(0.075, None))
    assert figures["force_mean"].values == pytest.approx(later.mean("time").values)
    assert figures["force_mean"].dims == ("body", "axis")
    smooth = drifting["moment_smooth"].sel(time=slice(0.075, None))
    assert figures["moment_deviation"].values == pytest.approx(smooth.std("time").values)
    assert figures["force_noise"].attrs["units"] == "N"


def test_box_hull_without_steering_at_rest_in_still_water():
    """Archimedes on a plain box that stays where it is: Fz of the displaced water, no horizontal force."""
    box = dataclasses.replace(VEHICLE, hull=dataclasses.replace(VEHICLE.hull, bow_length=0.0, bow_height=0.0))
    seen = []
    run = captive_run(
        box, Water(0.12), CaptiveMotion(speed=0.0), snapshots=0.01,
        on_snapshot=lambda solver, poses: seen.append((solver.time, len(poses.position))),
        **(COARSE | {"duration": 0.02}),
    )  # fmt: skip
    force = run["force"].sel(body="hull").values[-1]
    lift = 1000.0 * 9.81 * 1.0 * 0.44 * (0.12 - 0.078)
    assert force[2] == pytest.approx(lift, rel=0.03)
    assert np.abs(force[:2]).max() < 1e-3 * lift
    assert [round(t, 6) for t, _ in seen] == [0.0, 0.01, 0.02]
    assert {n for _, n in seen} == {5}


def test_users_own_motion_runs_and_its_sudden_start_is_warned_of(caplog):
    run = captive_run(VEHICLE, WATER, Sudden(), **(COARSE | {"duration": 0.01}))
    assert "relative to the water" in caplog.text
    assert json.loads(run.attrs["parameters"])["motion"] == {"Sudden": {"speed": 0.5}}


def test_mesh_hull_of_a_box_gives_the_loads_of_the_box(tmp_path):
    """The sampled distance rounds the edges over half a cell: 5 % of the lift, 10 % of the resistance allowed."""
    trimesh = pytest.importorskip("trimesh")
    mesh = trimesh.creation.box((1.0, 0.44, 0.2))
    mesh.apply_translation((0.0, 0.0, 0.178))
    mesh.export(tmp_path / "hull.stl")
    hull = dataclasses.replace(VEHICLE.hull, bow_length=0.0, bow_height=0.0)
    cars = [dataclasses.replace(VEHICLE, hull=dataclasses.replace(hull, mesh=m)) for m in (None, tmp_path / "hull.stl")]
    motion = CaptiveMotion(speed=0.6, ramp_time=0.05)
    runs = [captive_run(car, Water(0.12), motion, **(COARSE | {"duration": 0.1})) for car in cars]
    box, meshed = (run["force"].sel(body="hull").isel(time=slice(-6, None)).mean("time").values for run in runs)
    assert box[0] < -2.0
    assert meshed[0] == pytest.approx(box[0], rel=0.10)
    assert meshed[2] == pytest.approx(box[2], rel=0.05)


def test_ramp_into_the_averaged_half_is_warned_of(caplog):
    captive_run(VEHICLE, WATER, CaptiveMotion(ramp_time=0.01), **(COARSE | {"duration": 0.02}))
    assert "reaches into the second half" not in caplog.text
    captive_run(VEHICLE, WATER, CaptiveMotion(ramp_time=0.02), **(COARSE | {"duration": 0.02}))
    assert "reaches into the second half" in caplog.text


def test_forced_heave_is_resisted_by_more_than_buoyancy_and_takes_energy():
    """At 4 Hz the water squeezed between keel and bed pushes against the acceleration, against buoyancy and beyond it.

    It also takes energy, over whole periods: the force has a part against the velocity.
    """
    rise, frequency = 0.005, 4.0
    motion = CaptiveMotion(speed=0.0, heave_amplitude=rise, frequency=frequency, ramp_time=0.25)
    run = captive_run(VEHICLE, Water(0.12), motion, **(COARSE | {"duration": 0.75}))
    time, force = run["time"].values, run["force"].sel(body="hull", axis="z").values
    phase = 2.0 * math.pi * frequency * (time - 0.5 * COARSE["interval"])[time > 0.2501]  # loads: means over intervals
    basis = np.stack([np.ones_like(phase), np.sin(phase), np.cos(phase)], axis=1)
    _, in_phase, out_of_phase = np.linalg.lstsq(basis, force[time > 0.2501])[0]
    assert in_phase > 1000.0 * 9.81 * 0.44 * rise
    assert out_of_phase < 0.0


def test_default_window_grows_with_the_vehicle():
    truck = light_4x4()
    grid = vehicle_window(truck, 0.1, Water(0.5))
    assert grid.x_faces[-1] > 1.7 * truck.hull.length
    assert grid.z_faces[-1] >= 1.5


# -- runs that end early -----------------------------------------------------------------------------------------------


def test_run_that_breaks_keeps_what_it_has():
    def stop(time):
        if time > 0.012:
            raise RuntimeError("no more")

    with pytest.raises(SimulationError, match=r"amphibious, captive, at 0\.0150 s: RuntimeError: no more") as caught:
        captive_run(VEHICLE, WATER, progress=stop, snapshots=0.01, **COARSE)
    run = caught.value.result
    assert run["time"].values == pytest.approx([0.005, 0.01, 0.015])
    assert run.sizes["snapshot"] == 2
    assert run.attrs["status"].startswith("broke down at 0.0150 s")
    assert caught.value.state["time"] == pytest.approx(0.015)


def test_flow_that_stops_hands_over_its_state_before_the_failed_step():
    grid = Grid.uniform((0.0, 0.0, 0.0), (0.4, 0.2, 0.2), 0.02)
    solver = FlowSolver(grid, (), Water(0.1), FlowSettings(far_x=False, far_y=False, follow=None))
    solver.start()
    solver.advance(0.01)
    before = solver.save()
    fast = np.zeros((10, 10, 21))
    fast[4:6, 2:4, 8:12] = np.nan
    solver.set_flow(velocity=(fast, np.zeros((11, 10, 20)), np.zeros((10, 11, 20))))
    with pytest.raises(SimulationError, match=r"SimulationError\.state") as caught:
        solver.advance(0.02)
    assert caught.value.state["time"] == before["time"]
    solver.restore(before)
    assert np.all(np.isfinite(solver.advance(0.02)))
    assert all(np.all(np.isfinite(q)) for q in solver.velocity)


def test_ctrl_c_keeps_what_it_has():
    def stop(time):
        if time > 0.007:
            raise KeyboardInterrupt

    with pytest.raises(SimulationInterrupted) as caught:
        captive_run(VEHICLE, WATER, progress=stop, **COARSE)
    assert caught.value.result.sizes["time"] == 2
    assert caught.value.result.attrs["status"] == "interrupted at 0.0100 s"
