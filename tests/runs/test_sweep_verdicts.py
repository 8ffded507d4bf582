"""Sweeps of runs: each row carries its verdict and when it came about, also where the run could not start."""

import math
from dataclasses import replace

import numpy as np

from exumob.simulation.result_files import load_dataset
from exumob.support.errors import SimulationError
from exumob.support.quantities import unusual
from exumob.sweeps import sweep
from exumob.sweeps.experiment import amphibious_crossing


def broken(case):
    """A run that breaks without a result."""
    raise SimulationError("Newton did not converge")


def test_rows_carry_their_verdict(tmp_path):
    experiment = replace(amphibious_crossing(), hydrodynamics="coefficients", duration=0.8)
    common = {"water.current_speed": 0.0, "water.depth": 0.1, "soil.k_c": 102e3, "soil.k_phi": 5.3e6}
    cases = [
        common,
        common | {"water.depth": 0.5},
        common | {"soil.k_phi": unusual(4e3), "soil.k_c": 0.0},
    ]  # fmt: skip
    result = sweep(experiment, cases, tmp_path)
    assert list(result["status"].values) == ["completed", "completed", "broke down"]
    assert list(result["verdict"].values) == ["drives", "afloat", "sunk"]
    np.testing.assert_equal(result["verdict_since"].values, [math.nan, 0.0, 0.0])
    assert np.isnan(result["mean_slip"].values[1])  # no wheel in contact
    kept = load_dataset(tmp_path / "sweep.nc")
    assert list(kept["verdict"].values) == ["drives", "afloat", "sunk"]


def test_an_error_without_a_result_has_a_verdict(tmp_path):
    result = sweep(broken, [{"x": 1}], tmp_path)
    assert list(result["verdict"].values) == ["broke down"]
