"""Tuning: Exudyn's optimisers find a known optimum, go on where they were, and survive what breaks down."""

import json
import math
from dataclasses import dataclass, replace

import pytest
import xarray as xr

from exumob.support.errors import SimulationError
from exumob.sweeps import Genetic, Simplex, tune
from exumob.sweeps.experiment import Experiment, amphibious_lane_change

RANGES = {"hull.mass": (30.0, 60.0), "wheelbase": (0.5, 0.9)}
MODEL = replace(amphibious_lane_change(), hydrodynamics="coefficients")


@dataclass(frozen=True)
class Bowl(Experiment):
    """No vehicle: the distance from 42 kg and 0.8 m, over the widths of the ranges."""

    def __call__(self, values):
        """A Dataset with one number."""
        if values["hull.mass"] > 55.0:
            raise SimulationError("too heavy")
        off = ((values["hull.mass"] - 42.0) / 30.0) ** 2 + ((values["wheelbase"] - 0.8) / 0.4) ** 2
        return xr.Dataset({"off": off + values.get("duration", 0.0)})


BOWL = Bowl(**{name: getattr(MODEL, name) for name in MODEL.__dataclass_fields__})


def off(run):
    """Objective."""
    return float(run["off"])


def nowhere(run):
    """An objective that is not a number."""
    return math.nan


def test_simplex_finds_the_optimum_and_says_what_it_tried(tmp_path):
    found = tune(BOWL, RANGES, off, tmp_path, method=Simplex(tolerance=1e-4, evaluations=200))
    assert found.best["hull.mass"] == pytest.approx(42.0, abs=0.1)
    assert found.best["wheelbase"] == pytest.approx(0.8, abs=2e-3)
    assert found.objective == pytest.approx(0.0, abs=1e-5)
    assert found.objective == float(found.evaluations["objective"].min())
    assert (tmp_path / "tuning.nc").exists()


def test_genetic_search_comes_near_side_by_side_and_is_repeatable(tmp_path):
    method = Genetic(population=20, generations=6, workers=2, seed=3)
    found = tune(BOWL, RANGES, off, tmp_path / "a", method=method)
    assert found.objective < 0.01
    assert found.evaluations["objective"].max() == 1e6  # the heavy ones broke down, and did no harm
    again = tune(BOWL, RANGES, off, tmp_path / "b", method=replace(method, workers=1))
    assert again.best == found.best


def test_same_call_goes_on_with_what_was_computed(tmp_path):
    method = Simplex(evaluations=12)
    first = tune(BOWL, RANGES, off, tmp_path, method=method)
    files = sorted((tmp_path / "evaluations").iterdir())
    spoilt = files[0]
    spoilt.write_text(json.dumps(json.loads(spoilt.read_text()) | {"objective": -1.0}))  # would show if it were used
    assert tune(BOWL, RANGES, off, tmp_path, method=method).objective == -1.0
    assert len(first.evaluations["objective"]) == len(files)
    with pytest.raises(ValueError, match="another tuning"):
        tune(replace(BOWL, duration=3.0), RANGES, off, tmp_path, method=method)


def test_evaluations_are_not_relabelled_and_damage_is_named(tmp_path):
    method = Simplex(evaluations=6)
    first = tune(BOWL, RANGES, off, tmp_path, method=method)
    files = sorted((tmp_path / "evaluations").iterdir())
    files[0].write_bytes(files[0].read_bytes()[:20])  # torn: made again
    assert tune(BOWL, RANGES, off, tmp_path, method=method).best == first.best
    (tmp_path / "tuning.json").unlink()
    with pytest.raises(ValueError, match="is an evaluation of another tuning"):
        tune(BOWL, RANGES, nowhere, tmp_path, method=method)
    (tmp_path / "tuning.json").write_text("{")
    with pytest.raises(ValueError, match=r"tuning\.json cannot be read.*remove it"):
        tune(BOWL, RANGES, off, tmp_path, method=method)
    (tmp_path / "tuning.json").write_text("{}")
    with pytest.raises(ValueError, match="not of this version"):
        tune(BOWL, RANGES, off, tmp_path, method=method)
    (tmp_path / "tuning.json").unlink()
    (tmp_path / "evaluations" / "notes.json").write_text("{}")
    with pytest.raises(ValueError, match=r"notes\.json is no evaluation.*move it out"):
        tune(BOWL, RANGES, off, tmp_path, method=method)


def test_objective_is_averaged_over_cases(tmp_path):
    cases = [{"duration": 0.5}, {"duration": 1.5}]
    found = tune(BOWL, RANGES, off, tmp_path, cases=cases, method=Simplex(evaluations=60))
    assert found.objective == pytest.approx(1.0, abs=1e-2)


def test_simplex_leaves_the_lower_end_of_the_ranges(tmp_path):
    method = Simplex(start={"hull.mass": 30.0, "wheelbase": 0.5}, evaluations=200)
    found = tune(BOWL, RANGES, off, tmp_path, method=method)
    assert found.objective == pytest.approx(0.0, abs=1e-4)


def test_other_ranges_in_the_same_folder_get_their_own_best(tmp_path):
    method = Simplex(evaluations=60)
    tune(BOWL, RANGES, off, tmp_path, method=method)
    narrow = {"wheelbase": (0.5, 0.6), "hull.mass": (30.0, 35.0)}  # in another order, too
    found = tune(BOWL, narrow, off, tmp_path, method=method)
    assert 30.0 <= found.best["hull.mass"] <= 35.0
    assert found.best["wheelbase"] == pytest.approx(0.6, abs=1e-2)


def test_a_tuning_in_which_nothing_works_gives_no_answer(tmp_path):
    with pytest.raises(RuntimeError, match=r"every run broke down; the first: the objective is nan"):
        tune(BOWL, RANGES, nowhere, tmp_path, method=Simplex(evaluations=3))


@pytest.mark.parametrize(
    ("change", "match"),
    [
        ({"ranges": {}}, r"ranges = \{\} is empty"),
        ({"ranges": {"hull.mass": 3.0}}, "must be two finite numbers"),
        ({"ranges": {"hull.mass": ("a", "b")}}, "must be two finite numbers"),
        ({"experiment": 3}, r"tune\.experiment = 3"),
        ({"objective": 3}, r"tune\.objective = 3"),
        ({"cases": [3]}, "must be a list of dicts"),
        ({"ranges": {"hull.mas": (1.0, 2.0)}}, r"did you mean hull\.mass"),
        ({"ranges": {"hull.mass": (2.0, 1.0)}}, "lower end first"),
        ({"ranges": {"hull.mass": (-2.0, 1.0)}}, "mass"),
        ({"method": "guess"}, "must be a Genetic or a Simplex"),
        ({"cases": []}, "cases is empty"),
        ({"method": Simplex({"hull.mass": 40.0})}, r"Simplex\.start has the names hull\.mass"),
    ],
)
def test_bad_requests_are_refused_before_anything_runs(tmp_path, change, match):
    with pytest.raises(ValueError, match=match):
        tune(**({"experiment": BOWL, "ranges": RANGES, "objective": off, "folder": tmp_path} | change))
    assert not list(tmp_path.glob("evaluations/*"))


def test_bad_settings_of_the_optimisers_are_refused():
    with pytest.raises(ValueError, match=r"Genetic\.population = 2"):
        Genetic(population=2)
    with pytest.raises(ValueError, match=r"Genetic\.workers = 1\.5"):
        Genetic(workers=1.5)
    with pytest.raises(ValueError, match=r"Simplex\.tolerance = 0\.0"):
        Simplex(tolerance=0.0)
