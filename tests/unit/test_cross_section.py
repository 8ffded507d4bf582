"""Cross-sections: what is read, what is refused with its line, the water over them."""

import numpy as np
import pytest

from exumob.support.quantities import ImplausibleValue
from exumob.water.cross_section import CrossSection
from exumob.water.water_field import water_at

STATION, BED = [0.0, 4.0, 6.0, 10.0, 14.0, 20.0], [1.0, 1.0, 0.5, 0.3, 0.9, 1.2]
SECTION = CrossSection(STATION, BED)


def file(tmp_path, text):
    path = tmp_path / "section.csv"
    path.write_text(text)
    return path


def test_geometry_of_the_water():
    """By hand: level 0.8 meets the near bank at 4.8 m and the far one at 13.333 m."""
    near, far = SECTION.edges(0.8)
    assert (near, far) == pytest.approx((4.8, 10.0 + 4.0 * 0.5 / 0.6))
    assert SECTION.width(0.8) == pytest.approx(far - near)
    assert SECTION.greatest_depth(0.8) == pytest.approx(0.5)
    assert SECTION.level_at_depth(0.5) == pytest.approx(0.8)
    assert SECTION.slopes == pytest.approx((0.25, 0.15))


def test_a_shoal_parts_the_water():
    section = CrossSection([0.0, 1.0, 2.0, 3.0, 4.0], [1.0, 0.0, 1.0, 0.0, 1.0])
    assert section.wetted(0.5) == [pytest.approx((0.5, 1.5)), pytest.approx((2.5, 3.5))]
    assert section.width(0.5) == pytest.approx(2.0)
    assert section.edges(0.5) == pytest.approx((0.5, 3.5))


@pytest.mark.parametrize(
    ("level", "text"),
    [
        (0.2, "below the bed everywhere"),
        (1.05, r"begins under water, 0\.05 m deep at its first station \(0 m\)"),
    ],
)
def test_levels_that_are_no_ford(level, text):
    for function in (SECTION.check_level, SECTION.edges, SECTION.water):
        with pytest.raises(ValueError, match=text):
            function(level)
    with pytest.raises(ValueError, match="ends under water"):
        CrossSection(STATION, [1.3, *BED[1:]]).water(1.25)


def test_a_level_that_leaves_twenty_metres_of_water_is_asked_about():
    """As a depth of 21 m is: a section in millimetres, or two data."""
    section = CrossSection([0.0, 5000.0, 10000.0], [100.0, 0.0, 100.0])
    with pytest.raises(ImplausibleValue, match=r"level = 60 m lies 60 m above the lowest point of the bed .* in mm"):
        section.check_level(60.0)
    section.check_level(15.0)


def test_terrain_is_the_section_moved_and_turned():
    """At the stations the bed; beyond its ends level; alike along the river. 1e-9."""
    for origin, direction in (((0.0, 0.0), 0.0), ((100.0, -50.0), 2.1)):
        terrain = SECTION.terrain(origin, direction)
        c, s = np.cos(direction), np.sin(direction)
        for station, bed in [*zip(STATION, BED, strict=True), (-5.0, 1.0), (28.0, 1.2)]:
            for left in (0.0, 40.0, -300.0):
                place = origin[0] + c * station - s * left, origin[1] + s * station + c * left
                assert terrain.height_and_normal(*place)[0] == pytest.approx(bed, abs=1e-9)
                assert terrain.holds(place)


def velocity(water, x, y=0.0):
    record, nodes = water.as_arrays(SECTION.terrain())
    return water_at(record[0], nodes, x, y)[1:]


def test_still_water_without_a_current():
    assert SECTION.water(0.8).parameters["level"] == 0.8
    assert velocity(SECTION.water(0.8), 10.0) == (0.0, 0.0)


@pytest.mark.parametrize("discharge", [0.9, -0.9])
def test_discharge_is_the_integral_of_current_times_depth(discharge):
    """Integral on a fine grid: 1e-3; in proportion to depth^(2/3): 1 %; none on dry land."""
    water, terrain = SECTION.water(0.8, discharge), SECTION.terrain()
    x = np.linspace(0.0, 20.0, 20_001)
    bed = np.array([terrain.height_and_normal(a, 0.0)[0] for a in x])
    _, current = water.at(np.stack([x, 0.0 * x], axis=-1))
    depth = np.maximum(0.8 - bed, 0.0)
    assert np.trapezoid(current[:, 1] * depth, x) == pytest.approx(discharge, rel=1e-3)
    np.testing.assert_allclose(current[:, 0], 0.0)
    deep = depth > 0.05
    ratio = current[deep, 1] / depth[deep] ** (2.0 / 3.0)
    assert np.ptp(ratio) < 0.01 * abs(ratio.mean())
    assert np.abs(current[depth == 0.0]).max() < 0.05 * np.abs(current).max()  # between a dry and a wet point
    assert velocity(water, 2.0) == (0.0, 0.0)


def test_measured_current_is_across_to_the_left_and_along():
    section = CrossSection(STATION, BED, current=[9.0, 9.0, 0.5, 1.0, 9.0, 9.0], along=[0.1] * 6)
    assert velocity(section.water(0.8), 10.0) == pytest.approx((0.1, 1.0), abs=0.02)
    assert velocity(section.water(0.8), 2.0) == (0.0, 0.0)
    turned = section.water(0.8, origin=(7.0, 7.0), direction=np.pi / 2)
    assert velocity(turned, 7.0, 17.0) == pytest.approx((-1.0, 0.1), abs=0.02)
    with pytest.raises(ValueError, match="beside discharge"):
        section.water(0.8, 1.0)


def test_reads_a_table(tmp_path):
    path = file(tmp_path, "# ford\nStation [m]; bed (m); current [m/s]\n0;1,5;0\n\n2;1,25;0,4\n5;1,5;0\n")
    section = CrossSection.read(path)
    np.testing.assert_array_equal(section.station, [0.0, 2.0, 5.0])
    np.testing.assert_array_equal(section.bed, [1.5, 1.25, 1.5])
    np.testing.assert_array_equal(section.current, [0.0, 0.4, 0.0])
    assert section.along is None


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("station,bed\n0,1\n\n2,0\n1,1\n", r"line 5: station 1 m follows 2 m"),
        ("station,bed\n0,1\n0,0\n", r"line 3: station 0 m follows 0 m"),
        ("station,bed\n0,1\n1,\n2,1\n", r"line 3: bed is missing"),
        ("station,bed\n0,1\n1,nan\n2,1\n", r"line 3: bed is missing"),
        ("station,bed\n0,1\n", r"line 2 is the only point"),
        ("station,bed\n", "no rows"),
        ("station [ft],bed [m]\n0,1\n1,0\n", r"'station \[ft\]' is in ft; convert it to m"),
        ("station,bed,current [m]\n0,1,0\n1,0,0\n", r"is in m; convert it to m/s"),
        ("station,depth\n0,1\n1,0\n", "'depth' is not known"),
        ("station,curent\n0,1\n1,0\n", "did you mean current"),
        ("bed\n0\n1\n", "no column station"),
        ("station,Station,bed\n0,0,1\n1,1,0\n", "stands twice"),
        ("station,bed\n0,1\n1,-99999\n", r"line 3: bed = -99999\.0 m must be"),
        (
            "# in cm\nstation,bed,current\n0,10060,0\n1,9960,0.2\n",
            r"line 4: bed = 9960\.0 m .*in cm\? Then give 99\.6",
        ),
        ("station,bed,current\n0,1,0\n1,0,40\n", r"line 3: current = 40\.0 m/s is outside"),
    ],
)
def test_refuses_tables_by_line(tmp_path, text, message):
    with pytest.raises(ValueError, match=message):
        CrossSection.read(file(tmp_path, text))


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"station": [0.0], "bed": [0.0]}, "two at least"),
        ({"station": [0.0, 2.0, 1.0, 3.0, 4.0, 5.0]}, "point 3 follows 2 m"),
        ({"bed": [1.0, 0.0]}, "one at each"),
        ({"bed": [1.0, 0.0, 1.0, np.nan, 1.0, 1.0]}, "not finite"),
    ],
)
def test_refuses_arrays(change, text):
    with pytest.raises(ValueError, match=text):
        CrossSection(**({"station": STATION, "bed": BED} | change))
