"""Arrays that users give: what numpy would read without a word, and must not."""

import datetime
import fractions

import numpy as np
import pytest

from exumob.support.arrays import checked_array

GAP = np.ma.masked_equal(np.array([[1.0, 2.0, -9999.0], [4.0, -9999.0, 6.0]]), -9999.0)


class WithUnit(np.ndarray):
    """As astropy's quantities: an array with a unit, which numpy drops."""

    unit = "km"


@pytest.mark.parametrize(
    ("value", "message"),
    [
        (GAP, r"Field.values: 2 of 6 values are masked, the first at \[0, 2\]; fill the gaps"),
        (list(GAP), r"Field.values\[0\]: 1 of 3 values is masked, the first at \[2\]"),
        ([[1.0, np.ma.masked, 2.0], [0.0, 0.0, 0.0]], r"Field.values\[0\]\[1\] is masked"),
        ([[1.0, 2.0, np.nan], [0.0, np.inf, 0.0]], r"2 of 6 values are not finite, the first at \[0, 2\] \(nan\)"),
        (np.full((2, 3), np.longdouble("1e4000")), "6 of 6 values are not finite"),
        ([[1.0, 2.0, 3.0], [4.0, 5.0]], "Field.values is no array .*; give numbers in rows of equal length"),
        ([[10**400, 1, 1], [1, 1, 1]], "whole numbers beyond double precision"),
        ([[True, 0.0, 0.0], [0.0, 0.0, 0.0]], r"Field.values\[0\]\[0\] is True, a logical value"),
        (np.ones((2, 3), bool), "holds logical values"),
        (np.ones((2, 3), complex), "holds complex values"),
        ([["1", "2", "3"], ["4", "5", "6"]], "holds texts"),
        (np.full((2, 3), np.datetime64("2026-01-01")), "holds dates"),
        ([[datetime.date(2026, 1, 1)] * 3] * 2, "holds date objects"),
        ([[fractions.Fraction(1, 2)] * 3] * 2, "holds Fraction objects"),
        (np.array([[1.0, 2.0, None], [0.0, 0.0, 0.0]]), "holds NoneType objects"),
        (np.zeros((2, 3), [("z", float)]), "holds records"),
        (np.ones((2, 3)).view(WithUnit), r"has a unit of its own \(km\)"),
        (None, "holds NoneType objects"),
        ({"a": 1}, "holds dict objects"),
        ((x for x in [1.0]), "holds generator objects"),
        (3.0, r"has shape \(\); give an array of shape \(n, 3\)"),
        (np.zeros((3, 2)), r"has shape \(3, 2\); give an array of shape \(n, 3\)"),
        ([], r"has shape \(0,\); give"),
    ],
)  # fmt: skip
def test_refuses(value, message):
    with pytest.raises(ValueError, match=message):
        checked_array("Field.values", value, ("n", 3))


def test_equal_names_mean_equal_lengths():
    with pytest.raises(ValueError, match=r"shape \(2, 3\); give an array of shape \(n, n\)"):
        checked_array("Table.rows", np.zeros((2, 3)), ("n", "n"))
    assert checked_array("Table.rows", np.zeros((3, 3)), ("n", "n")).shape == (3, 3)


@pytest.mark.parametrize(
    "value", [[[1, 2, 3]], ((1.0, 2, 3),), np.ma.array([[1, 2, 3]]), np.array([[1, 2, 3]], np.uint8).T.copy().T,
              np.array([[1, 2, 3]], ">f4"), np.asfortranarray([[1.0, 2.0, 3.0]])],
)  # fmt: skip
def test_returns_a_read_only_copy(value):
    found = checked_array("Field.values", value, (1, 3))
    assert type(found) is np.ndarray
    assert found.dtype == np.float64
    assert found.flags.c_contiguous
    assert not found.flags.writeable
    assert not np.shares_memory(found, np.asarray(value))
    assert found.tolist() == [[1.0, 2.0, 3.0]]


def test_gaps_are_allowed_where_asked():
    assert np.isnan(checked_array("Record.value", [1.0, np.nan], (2,), finite=False)[1])
    with pytest.raises(ValueError, match="masked"):
        checked_array("Record.value", np.ma.array([1.0, 2.0], mask=[True, False]), (2,), finite=False)
    assert checked_array("Record.value", 3, ()) == 3.0
    with pytest.raises(ValueError, match=r"Record.value is not finite \(nan\)"):
        checked_array("Record.value", np.nan, ())
