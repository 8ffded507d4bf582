"""Every study runs, and gives the numbers that it is about (quick settings)."""

import importlib.util
import json
import shutil
import sys
from dataclasses import replace
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pytest
import xarray as xr
from made_up_learning import ENVELOPE

from exumob import ConstantSteer, Soil, load_vehicle, simulate
from exumob.learning.dataset import load_run
from exumob.simulation.result_files import load_dataset, save_dataset
from exumob.support.measured import measured_errors
from exumob.surrogates.model import shipped_networks
from exumob.surrogates.networks import Architecture, NetworkSet

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "studies"))  # as for `python studies/<name>.py`: they import `common`


def load_study(name):
    spec = importlib.util.spec_from_file_location(f"study_{name}", ROOT / "studies" / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def test_lane_change_study_shows_what_water_does():
    """Paper Sec. 4: shorter path and smaller lateral displacement in calm water; the current shortens it further."""
    result = load_study("lane_change").main(quick=True)
    dry, calm, current = (result.sel(scenario=name) for name in ("no water", "D60/U0", "D60/U1"))
    assert 0.97 * dry["forward"] > calm["forward"] > 1.2 * current["forward"] > 2.0
    assert calm["lateral"] < dry["lateral"]
    assert abs(np.degrees(dry["yaw"])) < 0.1 < 1.0 < np.degrees(current["yaw"])
    assert calm["buoyed_share"] == pytest.approx(0.37, abs=0.03)  # displaced 16.6 kg upright at ride height, of 57 kg


def test_captive_resistance_study_grows_with_speed():
    """Twice the speed, 2.7 times the resistance after 0.4 s on coarse cells, of the hull and of the wheels."""
    study = load_study("captive_resistance")
    result = study.main(quick=True)
    drag = result["resistance"]
    for part, found in (("hull", (9.09, 24.3)), ("front wheel", (3.27, 9.16)), ("rear wheel", (3.45, 8.60))):
        assert drag.sel(part=part, froude=[0.5, 1.0]).values == pytest.approx(found, rel=0.03), part
    parts = drag.sel(part="hull") + 2.0 * (drag.sel(part="front wheel") + drag.sel(part="rear wheel"))
    assert drag.sel(part="vehicle").values == pytest.approx(parts.values)
    assert study.plot(result).axes


@pytest.mark.parametrize("file", sorted((ROOT / "vehicle_models").glob("[!_]*.py")), ids=lambda p: p.stem)
def test_vehicle_file_drives_straight_on_firm_soil(file):
    """A vehicle file is all it takes: it settles, drives off and reaches the speed of its wheels less some slip."""
    vehicle = load_vehicle(file)
    result = simulate(
        vehicle, Soil.published("LETE sand"), maneuver=ConstantSteer(), duration=3.0, micro_step=5e-4, macro_step=20e-3
    )
    rim_speed = 10.0 * vehicle.wheel.radius
    assert 0.75 * rim_speed < float(result["forward_velocity"][-1]) < rim_speed
    assert abs(float(result["position"].sel(body="hull", axis="y")[-1])) < 1e-6
    weight = float(result["soil_force"].sel(axis="z").sum("wheel")[0])
    assert weight == pytest.approx(vehicle.mass * 9.81, rel=1e-6)


def test_cfd_lane_change_study_measures_and_judges():
    """With the coefficient model in the flow's place: what is measured, and claims that hold and do not."""
    study = load_study("cfd_lane_change")
    result = study.main(quick=True)
    dry, calm, current = (result.sel(run=name) for name in ("no water", "D60/U0", "D60/U1"))
    assert float(dry["straight"]) > float(calm["straight"]) > float(current["straight"]) > 0.5
    assert float(current["Fx"]) < 2.0 * float(calm["Fx"]) < 0.0
    answers = {text: holds for text, _, holds in study.claims(result)}
    assert len(answers) == 11  # without D40/U1
    assert answers["calm water: shorter path than on dry ground"]
    assert not answers["head current: pitch moment varies more (20 %)"]


def test_measured_errors_study_finds_what_the_table_holds():
    """One of its thirteen scenarios, driven anew: the figures that results state, to 0.1 % of the path and 1 mm/s."""
    found = load_study("measured_errors").main(quick=True)
    (row,) = found["runs"]
    kept = next(one for one in measured_errors()["runs"] if one["scenario"] == row["scenario"])
    for model in ("networks", "coefficients"):
        assert row[model]["end"] == pytest.approx(kept[model]["end"], abs=1e-3)
        assert row[model]["speed"] == pytest.approx(kept[model]["speed"], abs=1e-3)
    assert found["networks"] == measured_errors()["networks"]


def test_figures_of_other_pages_are_still_those_of_the_table():
    study, table, figures = load_study("measured_errors"), measured_errors(), ROOT / "studies" / "figures"
    found = study.validated((ROOT / "docs" / "validation.md").read_text())
    assert {name: table[name] for name in found} == json.loads(json.dumps(found))
    assert table["flow"] == study.repeatability(load_dataset(figures / "cfd_lane_change.nc"))
    assert table["elsewhere"] == study.elsewhere(
        *(load_dataset(figures / f"{name}.nc") for name in ("calibrate_coefficients", "calibrated_later"))
    )
    with pytest.raises(ValueError, match="no longer holds"):
        study.validated("nothing")


def test_training_data_study_packs_a_run():
    """A hundredth of a second with the flow in the loop, in a process of its own."""
    result = load_study("generate_training_data").main(quick=True)
    assert list(result["scenario"].values) == ["D40/U0"]
    assert float(result["size"][0]) > 0.05


def test_committed_runs_are_those_of_their_plans():
    """Named by all that they are made from, to 1e-6; those of the 4x4 are not all made yet."""
    study = load_study("calibrate_coefficients")
    folder = study.FULL_RANGE_RUNS / "runs"
    assert {file.stem for file in folder.glob("*.nc")} == {task.name for task in study.full_range_plan().tasks}
    assert len(study.later_runs()) == 8  # each has a task of its plan


def test_page_gives_the_drives_that_were_made_after_the_fit():
    study = load_study("calibrate_coefficients")
    rows = study.later_lines(load_dataset(ROOT / "studies" / "figures" / "calibrated_later.nc")).splitlines()[2:]
    page = (ROOT / "docs" / "studies" / "calibrate_coefficients.md").read_text()
    assert len(rows) == 8 and all(row in page for row in rows)


def test_networks_of_the_whole_range_end_near_a_drive_kept_apart():
    found = load_study("full_range").main(quick=True)
    final = found["final"].squeeze("run").to_series()
    assert final["full-range"] < 4.0 and final["full-range"] < final["calibrated"]
    assert (
        0.1
        < float(found["load_error"].sel(loads="full-range"))
        < float(found["load_error"].sel(loads="their coefficients"))
    )


def test_weighing_study_leaves_runs_out():
    """Three runs of each kind, one of which is left out: coefficients are the same whatever the weights."""
    found = load_study("weighing_runs").main(quick=True, workers=1)
    assert found.sizes == {"taught_by": 3, "weighed": 2, "judged_on": 2, "part": 1}
    assert float(found["coefficients"].std("weighed").max()) < 1e-12 and bool((found["networks"] > 0.1).all())
    lanes = found.sel(judged_on="lane changes")
    assert float(lanes["networks"].sel(taught_by="lane changes").max()) < 1.0  # from two lane changes, in two epochs


def test_shipped_networks_predict_an_unseen_run():
    """D50/U0.5, which no network saw: 0.6 % of the path and 0.4 degrees (the aims were 2 % and 2 degrees)."""
    result = load_study("predict_unseen").main(quick=True).squeeze()
    assert str(result["scenario"].item()) == "D50/U0.5"
    assert float(result["final"]) < 1.0 and float(result["yaw"]) < 0.8


def test_networks_predict_a_run_that_was_drawn_and_their_bars_hold():
    """The first of four that were drawn when all was frozen."""
    study = load_study("blind_runs")
    found = study.main(quick=True)
    final = {model: float(found["final"].sel(model=model)[0]) for model in study.MODELS}
    assert final["networks"] < 1.0 < 5.0 < final["published coefficients"]
    assert float(found["load_error"].mean()) < 0.45
    assert 0.95 < float(found["within"].sel(deviations=2.0)) <= 1.0
    assert float(found["within_spread"].sel(deviations=2.0)) < float(found["within"].sel(deviations=2.0))
    assert "| networks |" in study.lines(found)


def test_shipped_networks_reproduce_a_training_run():
    """D40/U0: the aims are 2 % of the path and 2 degrees."""
    result = load_study("reproduce_training").main(quick=True)[0].squeeze()
    assert float(result["final"]) < 2.0 and float(result["yaw"]) < 2.0


def test_calibration_study_mends_drag_and_lift():
    """Three runs are enough to halve the errors of drag and lift on a fourth: D50/U0.5, drag 38 N, lift 35 N."""
    study = load_study("calibrate_coefficients")
    result = study.main(quick=True).squeeze("run")
    flow, published, fitted = (result.sel(model=name) for name in ("flow", "coefficients", "own runs"))
    for name in ("drag", "lift"):
        assert abs(fitted[name] - flow[name]) < 0.5 * abs(published[name] - flow[name]), name
    assert float(fitted["final"]) < 0.5 * float(published["final"])
    assert float(fitted["axle_error"]) < 0.4 < 0.8 < float(published["axle_error"])  # a wheel that is turned is lifted
    assert study.plot(result.expand_dims("run")).axes and "| D50/U0.5 | 38.3;" in study.lines(result.expand_dims("run"))


def test_computational_time_study_measures_time_and_error():
    """50 ms instead of 20 ms moves the end by 21 mm of 2.8 m; 30 mm allowed."""
    result = load_study("computational_time").main(quick=True).squeeze()
    assert result.sizes == {"macro": 2}
    assert float(result["wall_time"].min()) > 0.0
    assert float(result["step_error"][0]) == 0.0 and 0.0 < float(result["step_error"][1]) < 30.0


def test_ablation_study_pairs_seeds_and_measures_memory():
    """A made-up table with a gap of -1 in every seed but one; an LSTM whose recurrent weights decide."""
    study = load_study("ablation")
    dims = ("model", "scenario", "member")
    values = np.array([[[1.0, 2.0, 3.0, 4.5]], [[2.0, 3.0, 4.0, 4.0]]])
    table = xr.Dataset({name: (dims, values) for name, _, _ in study.MEASURES}, {"model": list(study.PAIR)})
    lines = study.paired(table).splitlines()
    assert lines[2].startswith("| path [%] | -0.62 | 0.38 |") and lines[2].endswith("| 3 of 4 |")

    run = load_run(ROOT / "data" / "cfd_mbd" / "D50_U0.5.nc").isel(time=slice(2500, 3500))
    architecture = Architecture(("forward_speed", "yaw_rate"), taps=3, stride=100, width=4, dense=3)
    rng = np.random.default_rng(0)
    arrays = {name: rng.standard_normal((5, *shape)) for name, shape in architecture.shapes().items()}
    arrays |= {"input_mean": np.zeros((5, 2)), "input_scale": np.full((5, 2), 0.2), "input_low": np.full((5, 2), -5.0)}
    arrays |= {"input_high": np.full((5, 2), 5.0)}
    arrays |= {"output_mean": np.zeros((5, 6)), "output_scale": np.ones((5, 6))}
    single = {name: value.astype(np.float32) for name, value in arrays.items()}
    share = study.memory_share(NetworkSet(architecture, single, {}), run)
    assert share.shape == (5,) and share.min() > 0.02  # its samples lie 100 ms apart
    near = study.memory_share(NetworkSet(replace(architecture, stride=1), single, {}), run)
    assert (near < 0.1 * share).all()


def test_ablation_study_compares_what_it_is_given(tmp_path):
    """The same networks under both names: no difference; and their filters are the past that they remember."""
    for name in ("paper-lstm", "paper-dense", "present-lstm"):
        shutil.copy(shipped_networks()[0], tmp_path / f"{name}_seed0.safetensors")
    table, share = load_study("ablation").main(quick=True, networks=tmp_path)
    lstm, dense, present = table["final"].values.ravel()
    assert lstm == dense == present < 5.0
    assert share.shape == (1, 5) and (share > 0.0).all()


def test_mobility_map_study_goes_in_calm_and_not_in_fast_water(tmp_path):
    result = load_study("mobility_map").main(quick=True, folder=tmp_path).squeeze("panel")
    speed = result["speed"]
    assert float(speed.sel(y=0.4, x=0.0)) > 0.6 > float(speed.sel(y=0.6, x=1.2))
    assert float(result["probability"].sel(y=0.4, x=0.0)) == 1.0
    assert float(result["probability"].sel(y=0.6, x=1.2)) == 0.0


def test_fording_study_finds_the_published_limits():
    """A small car crosses 0.3 m of still water, as the limits allow, and floats off in 0.5 m, as they forbid.

    In 0.3 m at 2 m/s they forbid it, and it crosses here all the same, 0.67 m off the line.
    """
    study = load_study("fording")
    result = study.main(quick=True).squeeze("car")
    still, side = result.sel(flow="still"), result.sel(flow="2 m/s from the side")
    assert still["kind"].values.tolist() == ["crosses", "afloat"] and still["allowed"].values.tolist() == [True, False]
    assert side["kind"].values.tolist() == ["crosses", "swept away"] and not side["allowed"].any()
    assert float(still["wheel_load"][0]) == pytest.approx(0.37, abs=0.03)
    assert abs(float(still["drift"][0])) < 0.01
    assert float(side["drift"][0]) == pytest.approx(0.67, abs=0.1)
    assert study.allowed("large 4x4", 0.3, 2.0) and not study.allowed("large 4x4", 0.1, 3.5)
    assert "| small car | 0.5 | still | afloat | 13." in study.report_lines(result.expand_dims("car"))


def test_fording_study_compares_the_models(tmp_path, monkeypatch):
    """The lift of the networks is six tenths that of the coefficients on the level bottom; a run joins them."""
    study = load_study("fording")
    monkeypatch.setenv("EXUMOB_RUNS", str(tmp_path))
    crossed, runs = study.compared()
    assert set(runs) == {"coefficients", "networks"}
    lift = {}
    for name, run in runs.items():
        place = study.stations(run)
        n = int(np.argmax(place > 5.0))
        lift[name] = float(run["water_load"].sel(body="hull", axis="z")[n])
    assert lift["coefficients"] == pytest.approx(143.0, rel=0.05) and lift["networks"] == pytest.approx(86.0, rel=0.1)
    save_dataset(runs["coefficients"], tmp_path / study.FLOW_RUN)
    assert "flow in the loop" in study.compared()[1]
    assert study.plot_models(crossed, runs).axes and "| networks (crosses) |" in study.model_lines(crossed, runs)


def test_tuned_driver_holds_the_line_better_than_an_open_loop(tmp_path):
    result = load_study("path_following").main(quick=True, folder=tmp_path).squeeze("water")
    off = result["rms_mm"]
    assert float(off.sel(driver="tuned")) < 0.4 * float(off.sel(driver="open loop"))  # 9.1 of 25.8 mm
    assert float(off.sel(driver="tuned")) < 0.9 * float(off.sel(driver="as shipped"))  # of 10.8 mm
    assert float(result["end_mm"].sel(driver="tuned")) < 10.0  # 8.6 mm; open loop 78 mm
    assert float(result["end_yaw_deg"].sel(driver="tuned")) == pytest.approx(16.2, abs=1.0)  # amidst the line


@pytest.mark.slow
def test_excitation_study_compares_sets_of_runs(tmp_path, monkeypatch):
    """Two sets of two short runs on coarse cells, and three that judge."""
    monkeypatch.setattr("exumob.learning.envelope.envelope_of", lambda vehicle, waters, progress=None: ENVELOPE)
    study = load_study("excitation")
    found = study.main(quick=True, folder=tmp_path)
    assert list(found["set"].values) == ["lane changes", "multisines and steps"] and found.sizes["seconds"] == 1
    assert (found["load_error"] > 0.0).all() and (found["final_mean"] < 100.0).all()
    assert len(list((tmp_path / "runs").glob("*.nc"))) == 7
    plt.close(study.plot(found))
    assert study.lines(found).count("| 0.8 s |") == 2


def test_active_learning_study_follows_its_orders(tmp_path):
    """Four runs, tiny networks: the orders share start and end, active takes the largest disagreement; none twice."""
    study = load_study("active_learning")
    result = study.main(quick=True, work=tmp_path)
    assert result["added"].sel(order="fixed").values.tolist() == ["D40/U0 + D60/U1", "D40/U1", "D60/U0"]
    asked = result["disagreement"].sel(runs=2)
    assert asked.notnull().values.tolist() == [False, False, True, True]
    assert result["added"].sel(order="active", runs=3) == result["candidate"][int(np.nanargmax(asked.values))]
    first = result.isel(seeds=0)
    for measure in ("load_error", "final"):
        assert bool((first[measure] > 0.0).all())
        assert bool((first[measure].sel(order="active") == first[measure].sel(order="fixed")).isel(runs=[0, -1]).all())
    assert float(result["next_disagreement"][0]) > 0.0

    held = np.array([[study.fold(run, seed, 8001) for seed in range(5)] for run in range(9)])
    assert (held.sum(axis=1) == 1).all() and (held[0] != held[1]).any()  # all of a run, by one seed of five each
    written = {file: file.stat().st_mtime_ns for file in tmp_path.rglob("*")}
    assert study.main(quick=True, work=tmp_path).equals(result)
    assert {file: file.stat().st_mtime_ns for file in tmp_path.rglob("*")} == written
    assert "| 3 |" in study.report(result) and study.plot(result).axes and study.plot_forward(result).axes


def test_active_learning_study_measures_luck_and_foresight():
    """Made-up curves: ensembles of other seeds 0.2 apart deviate by 0.2/sqrt(2); disagreement in the error's order."""
    study = load_study("active_learning")
    values = np.zeros((2, 2, 3, 1))
    values[1, 0, :, 0] = 0.2
    values[1, 1, :, 0] = [9.0, -0.2, 9.0]  # the first and the last set are the same in both orders: looked at once
    last = ["D40/U1", "D60/U0"]
    asked = np.array([[np.nan, 1.0, 2.0, 3.0], [np.nan] * 4, [np.nan] * 4])
    table = xr.Dataset(
        {
            "load_error": (("seeds", "order", "runs", "scenario"), values),
            "added": (("order", "runs"), [["D40/U0 + D60/U1", *names] for names in (last, last[::-1])]),
            "disagreement": (("runs", "candidate"), asked), "true_error": (("runs", "candidate"), asked**2),
        },
        {"order": ["active", "fixed"], "runs": [2, 3, 4]},
    )  # fmt: skip
    assert study.seed_deviation(table, "load_error") == pytest.approx(0.2 / np.sqrt(2.0))
    assert study.rank_correlation(table).values[0] == pytest.approx(1.0) and np.isnan(
        study.rank_correlation(table).values[1]
    )
