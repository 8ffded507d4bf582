"""Captive runs, coarse and short: the result, warnings, runs that break or are stopped."""

import dataclasses
import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from exumob.flow import FlowSettings, Grid
from exumob.flow.vehicle_window import vehicle_window
from exumob.simulation.result_files import load_dataset, save_dataset
from exumob.support.errors import SimulationError, SimulationInterrupted
from exumob.support.smoothing import smoothed
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


class Sudden:
    """Moves at once."""

    parameters = {"speed": 0.5}  # noqa: RUF012

    def poses(self, vehicle, water, time):
        origins = np.vstack([vehicle.hull_origin, vehicle.wheel_centers])
        p = CaptiveMotion().poses(vehicle, water, 0.0)
        return dataclasses.replace(
            p, position=origins + np.array([0.5 * time, 0.0, 0.0]), velocity=np.tile([0.5, 0.0, 0.0], (5, 1))
        )


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


def test_summary_is_that_of_the_second_half(drifting):
    figures = captive_summary(drifting)
    later = drifting["force"].sel(time=slice(0.075, None))
    assert figures["force_mean"].values == pytest.approx(later.mean("time").values)
    assert figures["force_mean"].dims == ("body", "axis")
    smooth = drifting["moment_smooth"].sel(time=slice(0.075, None))
    assert figures["moment_deviation"].values == pytest.approx(smooth.std("time").values)
    assert figures["force_noise"].attrs["units"] == "N"


def test_users_own_motion_runs_and_its_sudden_start_is_warned_of(caplog):
    run = captive_run(VEHICLE, WATER, Sudden(), **(COARSE | {"duration": 0.01}))
    assert "relative to the water" in caplog.text
    assert json.loads(run.attrs["parameters"])["motion"] == {"Sudden": {"speed": 0.5}}


def test_ramp_into_the_averaged_half_is_warned_of(caplog):
    captive_run(VEHICLE, WATER, CaptiveMotion(ramp_time=0.01), **(COARSE | {"duration": 0.02}))
    assert "reaches into the second half" not in caplog.text
    captive_run(VEHICLE, WATER, CaptiveMotion(ramp_time=0.02), **(COARSE | {"duration": 0.02}))
    assert "reaches into the second half" in caplog.text


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


def test_ctrl_c_keeps_what_it_has():
    def stop(time):
        if time > 0.007:
            raise KeyboardInterrupt

    with pytest.raises(SimulationInterrupted) as caught:
        captive_run(VEHICLE, WATER, progress=stop, **COARSE)
    assert caught.value.result.sizes["time"] == 2
    assert caught.value.result.attrs["status"] == "interrupted at 0.0100 s"


# -- checkpoints -------------------------------------------------------------------------------------------------------


def test_a_run_that_was_stopped_goes_on_with_the_same_bits(tmp_path, monkeypatch):
    monkeypatch.setattr("exumob.towing_tank.run.CHECKPOINT_INTERVAL", 0.02)
    whole = captive_run(VEHICLE, WATER, DRIFTING, **COARSE)
    file, reached = tmp_path / "run.npz", []

    def stop(time):
        reached.append(time)
        if time > 0.032:
            raise KeyboardInterrupt

    with pytest.raises(SimulationInterrupted):
        captive_run(VEHICLE, WATER, DRIFTING, checkpoint=file, progress=stop, **COARSE)
    with pytest.raises(ValueError, match="exists already; resume from it"):
        captive_run(VEHICLE, WATER, DRIFTING, checkpoint=file, **COARSE)
    with pytest.raises(ValueError, match="belongs to another run: motion differs"):
        other = dataclasses.replace(DRIFTING, speed=0.9)
        captive_run(VEHICLE, WATER, other, checkpoint=file, resume=True, **COARSE)
    times = []
    found = captive_run(VEHICLE, WATER, DRIFTING, checkpoint=file, resume=True, progress=times.append, **COARSE)
    assert times[0] == pytest.approx(0.04)  # the interval in which it was stopped is not made again
    for name in VARIABLES:
        assert np.array_equal(found[name].values, whole[name].values), name
    with pytest.raises(ValueError, match="nothing to go on from without checkpoint"):
        captive_run(VEHICLE, WATER, DRIFTING, resume=True, **COARSE)
    with pytest.raises(ValueError, match="keeps no snapshots"):
        captive_run(VEHICLE, WATER, DRIFTING, checkpoint=tmp_path / "b.npz", snapshots=0.05, **COARSE)
