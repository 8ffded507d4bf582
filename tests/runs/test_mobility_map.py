"""Mobility maps, computed: refinement along a known border, restart, faults, confidence."""

import time
from dataclasses import dataclass, replace

import numpy as np
import pytest
import xarray as xr
from scipy.stats import binomtest

from exumob.mobility.crossing import FAILURES, Crossing, Limits
from exumob.mobility.lattice import Lattice
from exumob.mobility.map import Axis, MobilityMap, compute_map
from exumob.mobility.map_figure import plot_map
from exumob.simulation.result_files import load_dataset
from exumob.surrogates.ensemble import save_ensemble
from exumob.surrogates.model import SurrogateHydrodynamics
from exumob.sweeps.experiment import amphibious_crossing
from exumob.sweeps.sampling import Normal

QUICK = replace(amphibious_crossing(), hydrodynamics="coefficients", duration=1.5)
BRIEF = Limits(window=0.5)


@dataclass(frozen=True)
class Ellipse(Crossing):
    """Crosses where depth and current lie within an ellipse: a border that is known."""

    def __call__(self, values):
        """No vehicle, but a verdict."""
        x, y = values["water.current_speed"], values["water.depth_ratio"]
        inside = (x / 1.05) ** 2 + ((y - 0.3) / 0.31) ** 2 < 1.0
        numbers = dict.fromkeys(("speed", "drift", "slip", "power", "wheel_load", "tilt"), 1.0 - x)
        return {
            "crossed": float(inside), "failure": 0.0 if inside else float(FAILURES.index("too slow")), **numbers,
            "out_of_range": float(y > 0.65),
        }  # fmt: skip


def test_refined_map_has_the_border_of_the_full_one(tmp_path):
    wanted = MobilityMap(Ellipse(QUICK, BRIEF), y=Axis("water.depth_ratio", 0.3, 0.7), scatter={}, levels=3)
    quick = compute_map(wanted, tmp_path / "refined")
    full = compute_map(wanted, tmp_path / "full", full=True)
    np.testing.assert_array_equal(quick["probability"] >= 0.5, full["probability"] >= 0.5)
    assert quick.attrs["computed_share"] < 0.4
    assert full.attrs["computed_share"] == 1.0
    there = quick["runs"].values > 0
    np.testing.assert_array_equal(quick["speed"].values[there], full["speed"].values[there])
    np.testing.assert_allclose(quick["speed"], full["speed"], atol=1e-12)  # linear: interpolation is exact
    assert set(np.unique(full["failure"])) == {0, FAILURES.index("too slow")}
    np.testing.assert_array_equal(quick["failure"].values == -1, ~there)
    assert load_dataset(tmp_path / "full" / "map.nc").identical(full)
    assert np.isnan(full["out_of_range"]).all()  # coefficients have no training range
    assert "depth ratio 0.3 to 0.7 (0.4 to 0.6)" in full.attrs["trust"]
    assert (full["x"].attrs["units"], full["y"].attrs["units"]) == ("m s-1", "1")


def test_a_map_goes_on_where_it_was(tmp_path):
    wanted = MobilityMap(Ellipse(QUICK, BRIEF), scatter={}, levels=1)
    first = compute_map(wanted, tmp_path)
    files = {f: f.stat().st_mtime_ns for f in (tmp_path / "level0" / "cases").iterdir()}
    again = compute_map(wanted, tmp_path)
    assert {f: f.stat().st_mtime_ns for f in (tmp_path / "level0" / "cases").iterdir()} == files
    np.testing.assert_array_equal(first["probability"], again["probability"])
    with pytest.raises(ValueError, match=r"another map: crossing\.limits\.drift was 1\.0, and is 2\.0"):
        compute_map(replace(wanted, crossing=Ellipse(QUICK, Limits(window=0.5, drift=2.0))), tmp_path)


@dataclass(frozen=True)
class Tongue(Crossing):
    """A narrow tongue of go between two coarse rows, which only its root shows to the first level."""

    def __call__(self, values):
        """No vehicle, but a verdict."""
        x, y = values["water.current_speed"], values["water.depth_ratio"]
        inside = x < 0.4 or (abs(y - 0.45) < 0.02 and x < 1.3)
        return {"crossed": float(inside), "failure": 0.0 if inside else 6.0, "out_of_range": 0.0}


def test_a_map_with_networks_of_ones_own(tmp_path):
    """Its folder knows them by their contents, wherever the file lies."""
    shipped = SurrogateHydrodynamics().networks
    file = save_ensemble(shipped[:2], tmp_path / "mine.safetensors")

    def mapped(networks):
        crossing = Crossing(replace(QUICK, hydrodynamics="auto", duration=0.6).with_networks([networks]), BRIEF)
        axes = Axis("water.current_speed", 0.2, 0.4, 1), Axis("water.depth_ratio", 0.45, 0.55, 1)
        return compute_map(MobilityMap(crossing, *axes, {"LETE sand": {}}, scatter={}, draws=1, levels=0),
                           tmp_path / "map", workers=1)  # fmt: skip

    first = mapped(file)
    assert first.attrs["training_range"] == "of the networks" and (first["speed"] > 0.0).all()
    (tmp_path / "elsewhere").mkdir()
    moved = file.rename(tmp_path / "elsewhere" / file.name)
    xr.testing.assert_equal(mapped(moved), first)
    save_ensemble(shipped[2:4], moved)
    with pytest.raises(ValueError, match=r"holds another map: crossing\.experiment\.networks was"):
        mapped(moved)


def test_border_is_followed_out_of_the_cells_in_which_it_was_found(tmp_path):
    wanted = MobilityMap(Tongue(QUICK, BRIEF), scatter={}, levels=2)
    quick = compute_map(wanted, tmp_path / "refined")
    full = compute_map(wanted, tmp_path / "full", full=True)
    np.testing.assert_array_equal(quick["probability"] >= 0.5, full["probability"] >= 0.5)
    assert float(full["probability"].sel(x=1.225, y=0.45, method="nearest").squeeze()) == 1.0
    assert quick.attrs["computed_share"] < 0.7


@dataclass(frozen=True)
class Faulty(Crossing):
    """Runs that end otherwise than with a verdict."""

    how: str = ""

    def __call__(self, values):
        """Breaks at one corner."""
        if values["water.current_speed"] > 1.0:
            if self.how == "refuse":
                raise ValueError("hull.length is not that of the networks")
            if self.how == "fail":
                raise KeyError("a hole in the road")
            time.sleep(5.0)
        return {"crossed": 1.0, "failure": 0.0, "out_of_range": 0.0}


@pytest.mark.parametrize(
    ("how", "error", "match"), [("refuse", ValueError, r"hull\.length"), ("fail", RuntimeError, "a hole in the road")]
)
def test_cases_that_cannot_be_run_are_no_vehicles_that_cannot_cross(tmp_path, how, error, match):
    with pytest.raises(error, match=match):
        compute_map(MobilityMap(Faulty(QUICK, BRIEF, how), scatter={}, levels=0), tmp_path)


def test_runs_out_of_time_do_not_count_and_leave_no_answer(tmp_path, caplog):
    wanted = MobilityMap(
        Faulty(QUICK, BRIEF), Axis("water.current_speed", 0.0, 1.4, 1), Axis("water.depth_ratio", 0.3, 0.6, 1),
        scatter={}, levels=1,
    )  # fmt: skip
    found = compute_map(wanted, tmp_path, time_limit=1.0)
    assert "out of time or killed; they do not count" in caplog.text
    np.testing.assert_array_equal(found["runs"].sel(x=1.4), 0)
    assert np.isnan(found["probability"].sel(x=1.4)).all()
    np.testing.assert_array_equal(found["probability"].sel(x=0.0), 1.0)
    found.attrs |= {"x": "water.current_speed", "y": "water.depth_ratio"}
    assert plot_map(found).axes  # and nothing of it is coloured as if it were known


def test_probability_and_interval_at_a_scattered_node(tmp_path):
    """The current at which half the draws fail is that of the border; Wilson's interval is scipy's."""
    wanted = MobilityMap(
        Ellipse(QUICK, BRIEF), Axis("water.current_speed", 0.0, 2.1, 2), Axis("water.depth_ratio", 0.3, 0.6, 1),
        scatter={"water.current_speed": Normal(1.0, 0.1)}, draws=64, levels=0,
    )  # fmt: skip
    found = compute_map(wanted, tmp_path)
    at_border = found["probability"].isel(panel=0, y=0, x=1)  # nominally 1.05 m/s
    assert float(at_border) == pytest.approx(0.5, abs=0.05)
    bounds = binomtest(round(64 * float(at_border)), 64).proportion_ci(0.95, "wilson")
    assert float(found["probability_low"].isel(panel=0, y=0, x=1)) == pytest.approx(bounds.low)
    assert float(found["probability_high"].isel(panel=0, y=0, x=1)) == pytest.approx(bounds.high)
    assert float(found["probability"].isel(panel=0, y=0, x=0)) == 1.0


def test_cells_out_of_range_are_not_refined():
    x, y = (axis.values(0) for axis in (MobilityMap.x, MobilityMap.y))
    grid = Lattice(["sand"], x, y, BRIEF.range_share)
    nodes = grid.pending()
    checked = np.array([[p, i, j] for p, i, j in nodes])
    go = checked[:, 2] < 2
    rows = xr.Dataset(
        {
            "status": ("case", ["completed"] * len(nodes)),
            "crossed": ("case", go.astype(float)),
            "failure": ("case", np.where(go, 0.0, 5.0)),
            "out_of_range": ("case", np.where(checked[:, 1] > 2, 1.0, 0.0)),
        }
    )
    grid.fill(nodes, rows, 1)
    fresh = {(i, j) for _, i, j in grid.refined().pending()}
    assert {(1, 3), (3, 3)} <= fresh  # in the middle of a border cell that counts
    assert not any(i > 6 for i, _ in fresh)
    assert not any(j > 4 or j < 2 for _, j in fresh)
