"""Errors of loads, and networks that are no better than coefficients: they are called so, with what to do."""

from types import SimpleNamespace

import numpy as np
import pytest

from exumob.learning.dataset import LEAST_LOAD
from exumob.learning.presets import PRESETS
from exumob.learning.report_card import unknown
from exumob.learning.validation import Compared, load_errors, shortfall
from exumob.support.constants import GRAVITY
from vehicle_models.amphibious import amphibious_vehicle
from vehicle_models.small_car import small_car


@pytest.mark.parametrize("vehicle", [amphibious_vehicle(), small_car()], ids=lambda vehicle: vehicle.name)
@pytest.mark.parametrize("part", [10.0, 0.1], ids=["felt", "next to nothing"])
def test_errors_are_taken_over_deviations_that_a_vehicle_feels(vehicle, part):
    """Loads that are 1 and -1 times a deviation; networks off by half of it, coefficients by twice."""
    least = LEAST_LOAD * vehicle.mass * GRAVITY * np.repeat([1.0, 0.5 * vehicle.wheelbase], 3)
    signs = np.tile([1.0, -1.0], 50)[:, None, None] * np.ones((5, 6))
    flow = part * least * signs
    one = Compared(np.arange(100.0), flow, 1.5 * flow, np.zeros_like(flow), -flow)
    errors = load_errors({"a": one, "b": one}, vehicle)
    assert errors["networks"].values == pytest.approx(np.full((5, 6), 0.5 * min(part, 1.0)))
    assert errors["coefficients"].values == pytest.approx(np.full((5, 6), 2.0 * min(part, 1.0)))
    assert errors["by_run"].values == pytest.approx([0.5 * min(part, 1.0)] * 2)
    assert errors["deviation"].values == pytest.approx(np.tile(max(part, 1.0) * least, (5, 1)))


@pytest.mark.parametrize(
    ("loads", "ends", "said"),
    [
        ((0.2, 0.5), [(0.01, 0.1)], ()),
        ((0.5, 0.5), [(0.01, 0.1)], ("in the loads",)),
        ((0.2, 0.5), [(0.2, 0.1)], ("in where drives end",)),
        ((0.6, 0.5), [(0.2, 0.1), (0.1, None)], ("in the loads", "in where drives end")),
        ((0.2, 0.5), [], ()),
    ],
)
def test_networks_no_better_than_coefficients_are_called_so(loads, ends, said):
    figures = {
        "rests": True, "load_error": loads[0], "coefficients_load_error": loads[1],
        "drives": [{"end": one, "coefficients_end": other} for one, other in ends],
    }  # fmt: skip
    text = shortfall(figures)
    assert all(part in text for part in said) and bool(text) == bool(said)
    assert not said or "--budget" in text
    assert not said or "add --hydrodynamics calibrated" in text
    text = shortfall(figures | {"rests": False})
    assert not said or "than the calibrated coefficients: drive with these (without --networks" in text


def test_networks_no_better_than_exumobs_own_coefficients_are_called_so():
    """Coefficients fitted to few runs may be far worse than those that come with exumob; to be better is no praise."""
    one = {"end": 0.02, "coefficients_end": 0.08, "calibrated_end": 0.015}
    figures = {"rests": True, "load_error": 0.4, "coefficients_load_error": 0.6, "drives": [one]}
    own = "that come with exumob: drive with --hydrodynamics calibrated and without --networks"
    assert own in shortfall(figures)
    assert own in shortfall(figures | {"drives": [one | {"coefficients_end": 0.02}]})  # neither are the fitted ones
    assert "fitted to the same runs" in shortfall(figures | {"drives": [one | {"coefficients_end": 0.01}]})
    assert not shortfall(figures | {"drives": [one | {"calibrated_end": 0.05}]})
    assert not shortfall(figures | {"drives": [one | {"calibrated_end": None}]})  # that drive broke down


def test_the_card_says_what_networks_do_not_know():
    def listed(*versions):
        contents = SimpleNamespace(
            figures={
                "depth_ratio": [0.2, 0.9], "current_speed": [0.0, 1.5], "directions": "ahead", "soils": ["LETE sand"],
                "drives_failed": 0, "runs": 9,
            },
            plan=SimpleNamespace(lost=("a gap",), preset=PRESETS["residual"]), failed={"free_001": "it sank"},
            drives=[SimpleNamespace(duration=6.0), SimpleNamespace(duration=4.0)], apart={},
            taught={str(n): SimpleNamespace(attrs=version) for n, version in enumerate(versions)},
        )  # fmt: skip
        return " ".join(unknown(contents))

    old, new = {"flow_revision": "old"}, {"flow_revision": "new"}
    text = listed(new, new, {})  # the last one of another program
    for said in ("a gap", "from any side but ahead", "drives longer than 6 s", "free_001 broke down", "it sank"):
        assert said in text
    assert "version of the flow solver" not in text
    assert "version of the flow solver: the runs are of 2" in listed(old, new, {})
