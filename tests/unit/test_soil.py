"""Soil: units, published table, bad input."""

import itertools
import math
from dataclasses import fields, replace

import pytest

from exumob.ground.published_soils import WETTER
from exumob.ground.soil import WIDEST_PUBLISHED, Soil
from exumob.support.quantities import ImplausibleValue, unusual

LETE = Soil.published("LETE sand")


def test_pressure_of_a_plate_in_both_forms():
    width, sinkage = 0.08, 0.01
    assert LETE.pressure(sinkage, width) == pytest.approx((102e3 / width + 5301e3) * sinkage**0.79)
    reece = replace(LETE, k_c=1.0e4, k_phi=5.0e5, n=0.9, pressure_form="reece")
    assert reece.pressure(sinkage, width) == pytest.approx((1.0e4 + 5.0e5 * width) * (sinkage / width) ** 0.9)
    assert LETE.pressure(0.0, width) == 0.0


def test_reece_and_bekker_agree_where_they_are_the_same_law():
    """At n = 1: (k_c + k_phi b) (z / b) = (k_c / b + k_phi) z."""
    linear = replace(LETE, n=1.0)
    assert replace(linear, pressure_form="reece").pressure(0.013, 0.07) == pytest.approx(linear.pressure(0.013, 0.07))


def test_table_holds_the_published_values_and_their_provenance():
    table = Soil.published_table()
    assert len(table) == 23
    rows = {row.name: row for row in table}
    lete = rows["LETE sand"]
    assert lete.shear_modulus_published
    assert (lete.soil.k_c, lete.soil.k_phi, lete.soil.cohesion, lete.soil.shear_modulus_x) == (
        102e3,
        5301e3,
        1300.0,
        0.012,
    )
    assert math.degrees(lete.soil.friction_angle) == pytest.approx(31.1)
    assert sum(row.shear_modulus_published for row in table) == 3
    assert all("published" in row.source for row in table)
    assert not rows["Heavy clay 25 %"].shear_modulus_published
    assert "K of clay" in rows["Heavy clay 25 %"].source


def test_name_is_found_without_case():
    assert Soil.published("  lete SAND ") is LETE


def test_unknown_name_lists_near_ones():
    with pytest.raises(ValueError, match=r"no soil is called 'Lete snad'; did you mean 'LETE sand'"):
        Soil.published("Lete snad")
    with pytest.raises(
        ValueError,
        match=r"did you mean ('[\w ]*[Cc]lay[\w %]*'( or )?){3}\? There are more in `exumob soils`",
    ):
        Soil.published("clay")
    with pytest.raises(ValueError, match=r"'zzzzqqq'; use one of those in `exumob soils` \(Soil\.published_table\)\.$"):
        Soil.published("zzzzqqq")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"k_c": -1.0}, r"k_c = -1.0 .*must be"),
        ({"k_c": 0.0, "k_phi": 0.0}, "carries no load"),
        ({"n": 0.0}, "n = 0.0 must be > 0"),
        ({"n": math.nan}, "n = nan is not a finite number"),
        ({"cohesion": -10.0}, "cohesion = -10.0 .*must be"),
        ({"friction_angle": 31.1}, r"friction_angle = 31.1 rad must be .*degrees.*math.radians"),
        ({"shear_modulus_x": 0.0}, "shear_modulus_x = 0.0 .*must be"),
        ({"shear_modulus_y": -0.01}, "shear_modulus_y = -0.01 .*must be"),
        ({"c1": -0.1}, "c1 = -0.1 must be"),
        ({"c1": 0.7, "c2": 0.4}, r"c1 \+ Soil.c2 = 1.1 must be <= 1"),
        ({"rebound_ratio": 1.2}, "rebound_ratio = 1.2 must be"),
        ({"damping": -0.1}, "damping = -0.1 .*must be"),
        ({"pressure_form": "janosi"}, "pressure_form = 'janosi' is not known"),
        ({"shear_limit": "none"}, "shear_limit = 'none' is not known"),
    ],
)
def test_bad_input_is_named(change, message):
    with pytest.raises(ValueError, match=message):
        replace(LETE, **change)


@pytest.mark.parametrize("pressure_form", ["bekker", "reece"])
@pytest.mark.parametrize("shear_limit", ["per_axis", "resultant"])
def test_record_holds_every_parameter_by_its_name(pressure_form, shear_limit):
    soil = replace(Soil.published("LETE sand"), pressure_form=pressure_form, shear_limit=shear_limit, rebound_ratio=0.1)
    (record,) = soil.as_record()
    shared = set(record.dtype.names) & {f.name for f in fields(soil)}
    assert len(shared) == len(record.dtype.names) - 3
    assert all(record[name] == getattr(soil, name) for name in shared)
    assert record["tan_friction_angle"] == math.tan(soil.friction_angle)
    assert (record["reece_pressure"], record["shear_resultant"]) == (
        pressure_form == "reece",
        shear_limit == "resultant",
    )


@pytest.mark.parametrize("factor", [1e-12, 1e-3, 0.3, 1.0])
@pytest.mark.parametrize("row", Soil.published_table(), ids=lambda row: row.name)
def test_values_that_a_scatter_reaches_pass_and_kilonewtons_do_not(row, factor):
    """k_c may be anything beside k_phi; what a table prints in kPa and kN is refused in k_phi and cohesion."""
    soil = row.soil
    assert replace(soil, k_c=factor * soil.k_c).k_c == factor * soil.k_c
    for name in ("k_phi", "cohesion"):
        assert getattr(replace(soil, **{name: 0.0}), name) == 0.0
        with pytest.raises(ValueError, match=rf"Soil\.{name} = .*is it in k"):
            replace(soil, **{name: 1e-3 * getattr(soil, name)})
    assert replace(soil, cohesion=0.45 * soil.cohesion, k_phi=0.45 * soil.k_phi).name == row.name


@pytest.mark.parametrize("row", Soil.published_table(), ids=lambda row: row.name)
def test_swapped_moduli_are_refused_and_published_ones_are_far_from_it(row):
    soil = row.soil
    assert soil.k_c / soil.k_phi <= WIDEST_PUBLISHED
    k_c, k_phi = max(soil.k_phi, 1e6), max(soil.k_c, 6e3)  # what kilonewtons would look like is refused by its size
    with pytest.raises(ImplausibleValue, match=r"k_c = .* k_phi = .* swapped.*unusual"):
        replace(soil, k_c=k_c, k_phi=k_phi)
    for change in ({"k_c": unusual(k_c), "k_phi": k_phi}, {"k_c": k_c, "k_phi": unusual(k_phi)}):
        assert replace(soil, **change).k_c == k_c
    assert replace(soil, k_c=k_c, k_phi=0.0).k_phi == 0.0
    assert replace(soil, k_c=12.0).k_c == 12.0


# -- under water -------------------------------------------------------------------------------------------------------


def test_published_soils_say_at_which_moisture_they_were_measured():
    rows = {row.name: row for row in Soil.published_table()}
    assert rows["Sandy loam 15 %"].moisture == pytest.approx(0.15)
    assert rows["LETE sand"].moisture == 0.0
    assert math.isnan(rows["Lunar soil"].moisture)
    assert rows["Sandy loam 15 %"].under_water == (
        "was measured at 15 % moisture; 'Sandy loam 22 %' is the same soil wetter"
    )
    assert rows["Sandy loam 22 %"].under_water.endswith("22 % moisture, the wettest published")
    assert rows["LETE sand"].under_water == "was measured dry"
    assert all(row.under_water for row in rows.values())


def test_a_wetter_variant_is_the_next_one_of_its_kind_in_the_table():
    """Wetter is not always softer: of 11 and 23 % the wetter sandy loam sinks less under 50 kPa."""
    rows = list(Soil.published_table())
    for row, following in itertools.pairwise(rows):
        if row.name in WETTER:
            assert following.name == WETTER[row.name]
            assert following.moisture > row.moisture
            assert following.name.rsplit(" ", 2)[0] == row.name.rsplit(" ", 2)[0]
    assert len(WETTER) == 6
