"""Networks that are no better than coefficients are called so, with what to do."""

import pytest

from exumob.learning.validation import shortfall


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
        "load_error": loads[0], "coefficients_load_error": loads[1],
        "drives": [{"end": one, "coefficients_end": other} for one, other in ends],
    }  # fmt: skip
    text = shortfall(figures)
    assert all(part in text for part in said) and bool(text) == bool(said)
    assert not said or "--budget" in text
