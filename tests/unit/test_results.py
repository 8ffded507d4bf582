"""Results: names and units, provenance, files that are whole or absent, key figures against hand computation."""

import datetime
import errno
import importlib.metadata
import json
import logging
import math
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray as xr

from exumob.driving.maneuver import Recorded
from exumob.ground.terrain import Terrain
from exumob.simulation import result_files
from exumob.simulation.result_files import load_dataset, save_dataset
from exumob.simulation.run import simulate
from exumob.simulation.summary import FIGURES, energy_residual, force_residual, summary
from exumob.water.coefficients import CoefficientHydrodynamics, Coefficients
from exumob.water.conditions import Water

STEPS = {"duration": 0.06, "micro_step": 5e-4, "macro_step": 20e-3}

# -- content -----------------------------------------------------------------------------------------------------------


def test_every_variable_has_units_and_a_name(short_run):
    assert len(short_run.variables) > 50
    lacking = [n for n, v in short_run.variables.items() if not (v.attrs.get("units") and v.attrs.get("long_name"))]
    assert lacking == []


@pytest.mark.parametrize(
    "name",
    [
        "position", "quaternion", "velocity", "yaw", "sinkage", "slip_ratio", "soil_force", "spin_torque", "spin_power",
        "flow_state", "water_wrench", "constraint_load", "soil_load", "water_load", "gravity_load",
        "acceleration", "mass",
    ],
)  # fmt: skip
def test_what_the_specification_asks_for_is_there(short_run, name):
    assert np.isfinite(short_run[name].values).all()


def test_bodies_in_the_order_of_the_design(short_run):
    assert list(short_run["body"].values) == ["hull", "front_left", "front_right", "rear_left", "rear_right"]
    assert short_run["mass"].values == pytest.approx([49.0, 2.0, 2.0, 2.0, 2.0])
    y = short_run["position"].isel(time=0).sel(axis="y").values
    assert y[1] > 0.3
    assert y[2] < -0.3


def test_provenance(short_run):
    attrs = short_run.attrs
    assert attrs["exumob_version"] == importlib.metadata.version("exumob")
    assert attrs["exudyn_version"].startswith(importlib.metadata.version("exudyn"))
    assert attrs["numpy_version"] == np.__version__
    age = datetime.datetime.now(datetime.UTC) - datetime.datetime.fromisoformat(attrs["date"])
    assert datetime.timedelta(0) <= age < datetime.timedelta(hours=1)
    revision = subprocess.run(
        ["git", "rev-parse", "--short", "HEAD"], cwd=Path(__file__).parent, capture_output=True, text=True, check=False
    ).stdout.strip()
    assert attrs["git_revision"]
    if revision:  # others may commit while the tests run: only the form is checked
        assert attrs["git_revision"].removesuffix("-dirty").isalnum()
    assert attrs["status"] == "completed"
    assert "random_seed" in attrs
    assert float(attrs["wall_time"]) > 0.0
    assert float(attrs["compiling_wall_time"]) >= 0.0


def test_parameters_are_json_that_parses(short_run):
    parameters = json.loads(short_run.attrs["parameters"])
    assert parameters["vehicle"]["Vehicle"]["wheelbase"] == 0.714
    assert parameters["soil"]["Soil"]["name"] == "LETE sand"
    assert parameters["water"]["Water"]["depth"] == pytest.approx(0.12)
    assert parameters["maneuver"]["LaneChange"]["amplitude"] == pytest.approx(math.radians(30.0))
    assert parameters["steps"] == {"duration": 0.2, "micro_step": 5e-4, "macro_step": 20e-3, "record_step": 1e-2}


def test_parameters_of_the_water_model_are_kept(vehicle, sand):
    """All parameters: two runs that differ in a drag coefficient or in pore pressure must be told apart."""
    model = CoefficientHydrodynamics(replace(Coefficients(), hull_surge_drag=0.987654), pore_pressure=False)
    run = simulate(vehicle, sand, Water.at_ratio(0.6), None, model, **STEPS)
    assert "0.987654" in run.attrs["parameters"]
    assert "pore_pressure" in run.attrs["parameters"]


def test_recorded_maneuver_is_kept(vehicle, sand):
    samples = [0.0, 0.1234567, 0.2, 0.3]
    run = simulate(vehicle, sand, None, Recorded([0.0, 1.0, 2.0, 3.0], np.zeros(4), samples), **STEPS)
    assert "0.1234567" in run.attrs["parameters"]


def test_height_field_is_kept(vehicle, sand):
    hills = Terrain(heights=0.001 * np.arange(12.0).reshape(3, 4), origin=(-2.0, -2.0), spacing=2.0)
    run = simulate(vehicle, sand, terrain=hills, **STEPS)
    assert json.loads(run.attrs["parameters"])["terrain"]["Terrain"]["heights"] == hills.heights.tolist()


def test_orientation_angles_agree_with_the_quaternion(wet_run):
    """Turns about world z, body y, body x: rebuilt from yaw, pitch (bow down), roll: 1e-11."""
    w, x, y, z = np.moveaxis(wet_run["quaternion"].values, -1, 0)
    assert np.abs(w**2 + x**2 + y**2 + z**2 - 1.0).max() < 1e-12
    yaw, pitch, roll = (wet_run[name].values for name in ("yaw", "pitch", "roll"))
    assert 2 * (x * y + w * z) == pytest.approx(np.sin(yaw) * np.cos(pitch), abs=1e-11)
    assert 1 - 2 * (y * y + z * z) == pytest.approx(np.cos(yaw) * np.cos(pitch), abs=1e-11)
    assert 2 * (w * y - x * z) == pytest.approx(np.sin(pitch), abs=1e-11)
    assert 2 * (y * z + w * x) == pytest.approx(np.sin(roll) * np.cos(pitch), abs=1e-11)


def test_body_velocities_and_power_agree(wet_run):
    velocity, yaw = wet_run["velocity"].sel(body="hull").values, wet_run["yaw"].sel(body="hull").values
    ahead = velocity[:, 0] * np.cos(yaw) + velocity[:, 1] * np.sin(yaw)
    left = velocity[:, 1] * np.cos(yaw) - velocity[:, 0] * np.sin(yaw)
    assert wet_run["forward_velocity"].values == pytest.approx(ahead, abs=1e-12)
    assert wet_run["lateral_velocity"].values == pytest.approx(left, abs=1e-12)
    power = wet_run["spin_torque"] * wet_run["wheel_speed"]
    assert wet_run["spin_power"].values == pytest.approx(power.values, abs=1e-12)


def test_water_load_is_the_wrench_turned_to_world_axes(wet_run):
    w, x, y, z = np.moveaxis(wet_run["quaternion"].values, -1, 0)
    force = wet_run["water_wrench"].sel(component=["Fx", "Fy", "Fz"]).values
    upward = (
        2 * (x * z - w * y) * force[..., 0] + 2 * (y * z + w * x) * force[..., 1]
        + (1 - 2 * (x * x + y * y)) * force[..., 2]
    )  # fmt: skip
    assert wet_run["water_load"].sel(axis="z").values == pytest.approx(upward, abs=1e-9)


def test_flow_states_know_the_scenario(wet_run):
    state = wet_run["flow_state"].isel(time=-1).sel(body="hull").values
    speed = math.hypot(*wet_run["velocity"].isel(time=-1).sel(body="hull").values[:2])
    assert state[2:] == pytest.approx([speed, 1.0, 0.12])
    assert state[1] == pytest.approx(float(wet_run["yaw"].isel(time=-1).sel(body="hull")), abs=1e-9)  # head current


# -- key figures -------------------------------------------------------------------------------------------------------


def circle(frames=201):
    """A quarter circle to the left of radius 2 m in 4 s, on a slope of known forces: every figure by hand."""
    time = np.linspace(0.0, 4.0, frames)
    angle = 0.5 * np.pi * time / 4.0
    position, velocity, load = np.zeros((frames, 2, 3)), np.zeros((frames, 2, 3)), np.zeros((frames, 2, 3))
    position[:, 0] = np.stack([2 * np.sin(angle), 2 * (1 - np.cos(angle)), 0 * angle], axis=-1)
    rate = 0.5 * np.pi / 4.0
    velocity[:, 0] = 2 * rate * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=-1)
    gravity = load.copy()
    gravity[..., 2] = -50.0
    water = load.copy()
    water[..., 2] = 10.0
    slip = np.where(time < 2.0, 0.9, 0.2)[:, None] * np.ones(4)
    work = np.zeros((frames, 2))
    work[:, 1] = 3.0 * time
    vector = ("time", "body", "axis")
    return xr.Dataset(
        {
            "position": (vector, position), "velocity": (vector, velocity), "gravity_load": (vector, gravity),
            "water_load": (vector, water), "yaw": (("time", "body"), np.repeat(angle[:, None] - 0.1, 2, axis=1)),
            "slip_ratio": (("time", "wheel"), slip), "work": (("time", "work_kind"), work),
        },
        coords={"time": time, "body": ["hull", "rest"], "axis": ["x", "y", "z"], "work_kind": ["soil", "spin"]},
        attrs={"wall_time": 8.0},
    )  # fmt: skip


def test_summary_of_a_quarter_circle():
    """Chords of 200 pieces are shorter than the arc by 3e-6; slip jumps at half time, sampled there."""
    figures = summary(circle())
    assert figures["distance"] == pytest.approx(math.pi, rel=1e-5)
    assert figures["forward"] == pytest.approx(2.0, abs=1e-12)
    assert figures["lateral"] == pytest.approx(2.0, abs=1e-12)
    assert figures["yaw"] == pytest.approx(0.5 * math.pi - 0.1)
    assert figures["drift_angle"] == pytest.approx(0.1)  # course 90 degrees, heading 0.1 rad less
    assert figures["mean_slip"] == pytest.approx(0.2, abs=1e-12)
    assert figures["buoyed_share"] == pytest.approx(0.2)
    assert figures["spin_energy"] == pytest.approx(12.0)
    assert figures["wall_time"] == 8.0
    assert figures["real_time_factor"] == pytest.approx(0.5)


def test_summary_of_a_real_run(dry_run):
    figures = summary(dry_run)
    assert figures["buoyed_share"] == 0.0
    speed = np.hypot(*dry_run["velocity"].sel(body="hull").values[:, :2].T)
    assert figures["distance"] == pytest.approx(float((0.5 * (speed[1:] + speed[:-1]) * 0.01).sum()), rel=1e-4)
    power = dry_run["spin_power"].sum("wheel").values
    assert figures["spin_energy"] == pytest.approx(float((0.5 * (power[1:] + power[:-1]) * 0.01).sum()), rel=5e-3)
    assert figures["real_time_factor"] == pytest.approx(8.0 / figures["wall_time"])


def test_runs_carry_their_verdict(dry_run, wet_run, short_run):
    for run, verdict in ((dry_run, "drives"), (wet_run, "drives"), (short_run, "too short to tell")):
        assert run.attrs["verdict"] == summary(run)["verdict"] == verdict
        assert np.isnan(summary(run)["verdict_since"])
        assert not run["verdict_flag"].any()
    assert wet_run.attrs["verdict_sentence"] == "drives: 0.57 m/s, 57 % of the speed of its tyres at the end"


def test_units_of_all_key_figures_are_known(wet_run):
    assert set(summary(wet_run)) <= set(FIGURES)
    assert "verdict" not in summary(circle())  # it holds too little for one
    with pytest.raises(ValueError, match="has no slip_ratio, wall_time; give a result"):
        summary(circle().drop_vars("slip_ratio").drop_attrs())
    with pytest.raises(ValueError, match=r"summary\.dataset"):
        summary("run.nc")


def test_force_and_energy_residuals_see_an_error(short_run):
    """Checks that can fail: a force or a work left out shows up in full."""
    broken = short_run.assign(soil_load=short_run["soil_load"] * 0.9, work=short_run["work"] + 1.0)
    assert float(np.abs(force_residual(broken)).max()) > 5.0
    difference = energy_residual(broken) - energy_residual(short_run)
    assert difference.values == pytest.approx(float(short_run.sizes["work_kind"]))


# -- files -------------------------------------------------------------------------------------------------------------


def test_round_trip(short_run, tmp_path):
    file = save_dataset(short_run, tmp_path / "run.nc")
    assert file == tmp_path / "run.nc"
    loaded = load_dataset(file)
    xr.testing.assert_identical(loaded, short_run)
    assert list(tmp_path.iterdir()) == [file]
    file.unlink()
    assert float(loaded["position"].sum()) == float(short_run["position"].sum())  # in memory, file closed


def test_figures_of_a_loaded_run_are_the_same(short_run, tmp_path):
    np.testing.assert_equal(summary(load_dataset(save_dataset(short_run, tmp_path / "run.nc"))), summary(short_run))


def test_a_variable_is_compressed_as_one_unless_it_is_large(short_run, tmp_path, monkeypatch):
    with h5py.File(save_dataset(short_run, tmp_path / "run.nc")) as file:
        assert file["position"].chunks == file["position"].shape
    monkeypatch.setattr(result_files, "CHUNK", 10 * short_run["position"].isel(time=0).nbytes)
    with h5py.File(save_dataset(short_run, tmp_path / "run.nc")) as file:
        assert file["position"].chunks == (10, *file["position"].shape[1:])


def test_saving_over_an_older_result_replaces_it(short_run, tmp_path):
    file = tmp_path / "run.nc"
    save_dataset(short_run.isel(time=slice(0, 5)), file)
    save_dataset(short_run, str(file))
    assert load_dataset(file).sizes["time"] == 21


@pytest.mark.parametrize("error", [KeyboardInterrupt, MemoryError])
def test_interrupted_writing_leaves_the_older_result(short_run, tmp_path, monkeypatch, error):
    file = save_dataset(short_run, tmp_path / "run.nc")
    before = file.read_bytes()
    write = Path.write_bytes

    def break_off(self, data):
        write(self, data)
        raise error

    monkeypatch.setattr(Path, "write_bytes", break_off)
    with pytest.raises(error):
        save_dataset(short_run.isel(time=slice(0, 5)), file)
    assert file.read_bytes() == before
    assert list(tmp_path.iterdir()) == [file]


KILLED = """
import os, signal, sys
from pathlib import Path
import xarray as xr
from exumob.simulation.result_files import load_dataset, save_dataset
Path.replace = os.replace = os.rename = lambda *_: os.kill(os.getpid(), signal.SIGKILL)
save_dataset(load_dataset(sys.argv[1]), sys.argv[2])
"""


def test_killed_writing_leaves_no_half_file(short_run, tmp_path):
    """kill -9 in the moment before the file gets its name."""
    source = save_dataset(short_run, tmp_path / "source.nc")
    target = tmp_path / "target.nc"
    process = subprocess.run([sys.executable, "-c", KILLED, source, target], check=False, capture_output=True)
    assert process.returncode == -9
    assert not target.exists()


def full(folder, monkeypatch, code=errno.ENOSPC):
    """Writing netCDF below `folder` fails as on a full disk."""
    write = Path.write_bytes

    def refuse(self, data):
        if folder in self.parents:
            write(self, data[:100])
            raise OSError(code, "No space left on device")
        return write(self, data)

    monkeypatch.setattr(Path, "write_bytes", refuse)


def test_full_disk_saves_elsewhere_and_says_so(short_run, tmp_path, monkeypatch, caplog):
    target, spare = tmp_path / "target", tmp_path / "spare"
    target.mkdir()
    spare.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(spare))
    full(target, monkeypatch)
    with caplog.at_level(logging.WARNING):
        file = save_dataset(short_run, target / "run.nc")
    assert file.name == "run.nc"
    assert file.parent.parent == spare
    assert list(target.iterdir()) == []
    assert "No space left on device" in caplog.text
    assert str(file) in caplog.text
    xr.testing.assert_identical(load_dataset(file), short_run)


def test_fallback_does_not_overwrite_another_result(short_run, tmp_path, monkeypatch):
    """A file of this name may lie in the temporary folder already: someone's only copy."""
    target, spare = tmp_path / "target", tmp_path / "spare"
    target.mkdir()
    spare.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(spare))
    (spare / "run.nc").write_text("saved there before")
    full(target, monkeypatch)
    save_dataset(short_run, target / "run.nc")
    assert (spare / "run.nc").read_bytes() == b"saved there before"


def test_full_disk_everywhere_is_an_error(short_run, tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    (tmp_path / "deep").mkdir()
    full(tmp_path, monkeypatch)
    with pytest.raises(OSError, match="No space"):
        save_dataset(short_run, tmp_path / "deep" / "run.nc")
    assert list(tmp_path.iterdir()) == [tmp_path / "deep"]
    assert list((tmp_path / "deep").iterdir()) == []


def test_missing_folder_saves_elsewhere(short_run, tmp_path, monkeypatch, caplog):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    file = save_dataset(short_run, tmp_path / "absent" / "run.nc")
    assert file.parent.parent == tmp_path
    assert "absent" in caplog.text


LIMITED = """
import resource, sys, signal
from exumob.simulation.result_files import load_dataset, save_dataset
run = load_dataset(sys.argv[1])
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (30000, 30000))
try:
    save_dataset(run, sys.argv[2])
except OSError as error:
    print("OSError", error.errno)
"""


def test_a_real_write_that_fails_is_an_os_error(short_run, tmp_path):
    """What HDF5 itself raises when the file system refuses (file size limited to 30 kB): an OSError, no half file."""
    source = save_dataset(short_run, tmp_path / "source.nc")
    assert source.stat().st_size > 60000
    process = subprocess.run(
        [sys.executable, "-c", LIMITED, source, tmp_path / "target.nc"], check=False, capture_output=True, text=True,
        env={"TMPDIR": str(tmp_path), "PATH": ""},
    )  # fmt: skip
    assert process.returncode == 0, process.stderr[-2000:]
    assert process.stdout.startswith("OSError")
    assert not (tmp_path / "target.nc").exists()


def test_what_the_water_model_adds_reaches_the_result(short_run):
    """The parts of the load are there, with the components of the whole, and sum to it at the macro ticks."""
    parts = sum(short_run[f"hydrodynamics_{part}_load"] for part in ("hydrostatic", "drag", "added_mass"))
    assert np.isfinite(parts).all()
    whole = short_run["water_wrench"].sel(time=0.02)  # held from the tick before
    np.testing.assert_allclose(whole, parts.sel(macro_time=0.0), rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("name", ["run.csv", "run.txt", "run", "run.h5", "run.nc.bak"])
def test_a_result_is_written_to_netcdf_alone(short_run, tmp_path, name):
    (tmp_path / name).write_text("precious")
    with pytest.raises(ValueError, match=r"save_dataset\.file = .*use \.nc"):
        save_dataset(short_run, tmp_path / name)
    assert (tmp_path / name).read_text() == "precious"
