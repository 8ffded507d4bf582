"""The report on a ford, from runs that were never computed; what is no ford is refused."""

import math

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
import pytest
from made_up_runs import made_up_run, sized_amphibious

from exumob.ground.soil import Soil
from exumob.mobility.ford import Ford, ford_report
from exumob.mobility.ford_figure import plot_ford
from exumob.simulation.settings import time_scale, usual_speed
from exumob.water.cross_section import CrossSection

SECTION = CrossSection([-2.0, 0.0, 1.0, 1.5, 2.5, 3.0, 4.0], [0.1, 0.1, 0.0, -0.12, -0.12, 0.0, 0.1])
"""Water from station 1 to 3 m at level 0"""
SAND = Soil.published("LETE sand")


def ford(factor=1.0, **options):
    section = CrossSection(factor * np.array(SECTION.station), factor * np.array(SECTION.bed))
    return Ford(section, 0.0, sized_amphibious(factor), SAND, **options)


def drive(clearance=0.05, bank=None, **options):
    """A made-up run with what a report needs besides; `bank`: station from which it is sideways [m] (and how far)."""
    run = made_up_run(**options)
    n = run.sizes["time"]
    x = run["position"].values[:, 0, 0]
    run["position"].values[:, 1:3, 0] += 0.357
    run["position"].values[:, 3:, 0] -= 0.357
    if bank is not None:
        run["position"].values[:, :, 1] = np.where(np.abs(x - bank[0]) < 0.1, bank[1], 0.0)[:, None]
    run["water_depth"] = ("time", np.interp(x, [1.0, 1.5, 2.5, 3.0], [0.0, 0.12, 0.12, 0.0]))
    run["water_level"] = ("time", np.zeros(n))
    run["keel_clearance"] = ("time", clearance - 0.02 * np.exp(-((x - 2.0) ** 2)))
    run["hull_load_share"] = ("time", np.zeros(n))
    return run.assign_attrs(trust="made up")


def test_start_way_speed_and_time_are_those_of_the_vehicle():
    """Half a vehicle of 1 m before the edge; past the far edge with its rear; half the speed of its tyres, and 1 s."""
    one = ford()
    assert one.start.x == pytest.approx(0.0, abs=1e-12)
    assert one.way == pytest.approx(3.5)
    assert one.tread_speed == pytest.approx(1.0)
    assert one.time == pytest.approx(8.0)
    assert one.maneuver.wheel_speed(5.0)[0] == pytest.approx(10.0)
    assert ford(speed=2.0).time == pytest.approx(4.5) and ford(duration=3.0).time == 3.0


@pytest.mark.parametrize(("slip", "said"), [
    (0.123, "12 % at most"), (0.002, "none: the vehicle is as fast as"), (-0.082, "at least 8 % faster than the tread"),
])  # fmt: skip
def test_slip_is_said_of_wheels_behind_and_ahead_of_their_tread(slip, said):
    run = drive()
    run["slip_ratio"] = run["slip_ratio"] * 0.0 + slip
    assert said in ford_report(run, ford()).lines()["slip"]


def test_the_wheel_that_slips_most_is_named_if_it_has_a_bite():
    """Not one off the ground, nor one that hardly bears, nor before the wheels are at speed; the mean stands beside."""
    run = drive()
    run["slip_ratio"].loc[{"wheel": "front_left"}] = 1.0
    run["soil_force"].loc[{"wheel": "front_left"}] = 0.01
    run["slip_ratio"].loc[{"wheel": "rear_right", "time": slice(2.0, 2.1)}] = 0.62
    run["slip_ratio"].loc[{"time": slice(0.0, 0.9)}] = 0.95
    report = ford_report(run, ford())
    assert report.slipping_wheel == "rear_right" and report.wheel_slip.value == pytest.approx(0.62)
    assert report.wheel_slip.time == pytest.approx(2.0) and report.figures()["wheel_slip"] == report.wheel_slip.value
    said = report.lines()["slip"]
    assert said.startswith("56 % at most (mean of the wheels in contact, from 1 s on, when they are at speed)")
    assert "; 62 % at the rear right wheel alone (of those that bear 5 % of the weight), at station" in said
    run["slip_ratio"] = run["slip_ratio"] * 0.0 - 0.25
    run["slip_ratio"].loc[{"wheel": "rear_left"}] = 0.7
    said = ford_report(run, ford()).lines()["slip"]
    assert said.startswith("none: ") and "70 % at the rear left wheel" in said
    run["slip_ratio"] = run["slip_ratio"] * 0.0 + 0.2
    assert "alone" not in ford_report(run, ford()).lines()["slip"]
    run["soil_force"] = run["soil_force"] * 0.0
    assert ford_report(run, ford()).slipping_wheel == ""


@pytest.mark.parametrize("factor", [0.5, 4.0])
def test_a_similar_ford_is_driven_similarly(factor):
    """Froude: lengths by the factor, speed and time by its root."""
    small, large = ford(), ford(factor)
    root = math.sqrt(factor)
    assert usual_speed(large.vehicle) == pytest.approx(root) and time_scale(large.vehicle) == pytest.approx(root)
    assert large.way == pytest.approx(factor * small.way)
    assert large.tread_speed == pytest.approx(root)
    assert large.time == pytest.approx(root * small.time, abs=0.1)


def test_a_vehicle_that_comes_out_has_crossed():
    report = ford_report(drive(forward=0.8), ford())
    assert report.crosses and report.kind == "crosses"
    assert report.time == pytest.approx(3.5 / 0.8, abs=0.011) and report.out == report.time
    assert report.station == pytest.approx(3.5, abs=0.01)
    assert "after 4.38 s, at 0.80 m/s on average (80 % of the speed of its tyres)" in report.sentence
    assert report.depth.value == pytest.approx(0.12)
    assert report.clearance.value == pytest.approx(0.03, abs=1e-3)
    assert report.clearance.station == pytest.approx(2.0, abs=0.02)
    assert report.wheel_load.value == pytest.approx(0.6, abs=1e-6)
    assert report.slip.value == pytest.approx(0.3)
    vehicle = sized_amphibious(1.0).hull
    top = 0.17 + vehicle.ground_clearance + vehicle.height - vehicle.center_of_mass_height
    assert report.freeboard.value == pytest.approx(top)
    assert report.figures()["crosses"] == 1.0
    assert str(report).startswith("verdict") and "made up" in str(report)


def test_what_happens_after_the_crossing_does_not_count():
    run = drive(forward=0.8, roll=lambda t: 1.5 if t > 4.6 else 0.0, status="broke down at 5.9 s: it")
    assert ford_report(run, ford()).crosses


@pytest.mark.parametrize(("options", "kind", "station", "time"), [
    ({"forward": lambda t: 0.8 if t < 2.0 else 0.0}, "stuck", 1.6, 2.0),
    ({"forward": lambda t: 0.8 if t < 2.0 else 0.0, "belly": 0.4}, "bottomed", 1.6, 2.0),
    ({"load": lambda t: 0.6 if t < 2.5 else 0.01}, "afloat", 2.0, 2.5),
    ({"load": lambda t: 0.6 if not 2.0 < t < 3.5 else 0.01}, "afloat", 1.6, 2.0),
    ({"roll": lambda t: 1.2 if t > 2.5 else 0.0}, "tipped", 2.0, 2.5),
    ({"forward": 0.3}, "too slow", 1.8, 6.0),
    ({"forward": 0.3, "status": "interrupted at 6.0 s"}, "stopped", 1.8, 6.0),
    ({"forward": 0.3, "status": "broke down at 6.0 s: it"}, "broke down", 1.8, 6.0),
])  # fmt: skip
def test_a_failure_says_what_where_and_when(options, kind, station, time):
    report = ford_report(drive(**({"forward": 0.8} | options)), ford())
    assert report.kind == kind and not report.crosses
    assert report.time == pytest.approx(time, abs=0.02)
    assert report.station == pytest.approx(station, abs=0.02)
    assert report.sentence.startswith("does not cross: ")
    assert f"at station {report.station:.2f} m" in report.sentence
    assert report.figures()["crosses"] == 0.0


def test_a_vehicle_that_floated_has_not_forded_though_it_came_out():
    report = ford_report(drive(forward=0.8, load=lambda t: 0.6 if not 2.0 < t < 3.5 else 0.01), ford())
    assert report.kind == "afloat" and report.out == pytest.approx(3.5 / 0.8, abs=0.011)
    assert "came out on the far bank all the same, after 4.38 s" in report.sentence


def test_one_that_was_stuck_for_a_while_crosses_and_it_is_said():
    report = ford_report(drive(forward=lambda t: 0.9 if not 1.0 < t < 2.0 else 0.0), ford())
    assert report.crosses
    assert "on the way stuck from station 0.9" in report.sentence


def test_the_largest_drift_is_reported_not_that_at_the_end():
    report = ford_report(drive(forward=0.8, bank=(2.0, -0.4)), ford())
    assert report.drift.value == pytest.approx(-0.4) and report.drift.station == pytest.approx(2.0, abs=0.11)
    assert "0.40 m to the right of the path at most" in str(report)


def with_members(run, shares, sideways):
    """The run with members that go a share of its way and a distance to the left of it."""
    hull = run["position"].values[:, 0]
    places = np.stack(
        [hull * [share, 1.0, 1.0] + [0.0, aside, 0.0] for share, aside in zip(shares, sideways, strict=True)]
    )
    return run.assign(
        member_position=(("member", "time", "axis"), places), member_yaw=(("member", "time"), 0.0 * places[..., 0])
    )


def test_members_are_reported_with_their_times_and_drift_until_they_are_out():
    """0.8, 0.72 and 0.4 m/s over 3.5 m in 6 s; the second drifts further once it is out, which does not count."""
    run = with_members(drive(forward=0.8), (1.0, 0.9, 0.5), (0.02, 0.07, -0.01))
    run["member_position"].values[1, 500:, 1] = 0.9
    report = ford_report(run, ford())
    assert report.members.out == pytest.approx([4.38, 4.87, np.nan], abs=0.011, nan_ok=True)
    assert report.members.drift == pytest.approx([0.02, 0.07, -0.01])
    assert report.lines()["members"] == (
        "2 of 3 networks, each driving alone, come out past the far edge, after 4.38 to 4.87 s; drift at most 0.01 m "
        "to the right, 0.07 m to the left"
    )
    assert report.crosses and "members" not in ford_report(drive(forward=0.8), ford()).lines()


@pytest.mark.parametrize(("sideways", "said"), [
    ((0.02, 0.07), "drift of 0.02 to 0.07 m to the left"), ((-0.07, -0.02), "drift of 0.02 to 0.07 m to the right"),
])  # fmt: skip
def test_members_that_do_not_come_out_or_broke_down_are_counted(sideways, said):
    run = with_members(drive(forward=0.8), (0.3, 1.0), sideways)
    run["member_position"].values[1, 100:] = np.nan
    run["member_yaw"].values[1, 100:] = np.nan
    text = ford_report(run, ford()).lines()["members"]
    assert text == f"0 of 2 networks, each driving alone, come out past the far edge; {said}"


@pytest.mark.parametrize("members", [(), (0.02, 0.07, -0.01)])
def test_the_drift_is_drawn_with_the_range_of_the_members(members):
    run = drive(forward=0.8, bank=(2.0, 0.2)).assign(
        gravity_load=(("time", "body", "axis"), np.full((601, 5, 3), -1.0))
    )
    run = run.assign_attrs(hydrodynamics="SurrogateHydrodynamics")
    if members:
        run = with_members(run, (1.0, 0.9, 0.5), members)
    figure = plot_ford(run, ford(), ford_report(run, ford()))
    drift = next(axes for axes in figure.axes if axes.get_ylabel().startswith("drift"))
    assert drift.get_lines()[0].get_ydata().max() == pytest.approx(0.2)
    assert len(drift.collections) == (1 if members else 0) and drift.get_xlabel() == "station [m]"
    if members:
        band = drift.collections[0].get_paths()[0].vertices
        for station, low, high in ((0.5, -0.01, 0.07), (3.0, 0.02, 0.07)):  # the slow one ends at 2.4 m
            near = band[np.abs(band[:, 0] - station) < 0.02, 1]
            assert (near.min(), near.max()) == pytest.approx((low, high))
    plt.close(figure)


@pytest.mark.parametrize(("change", "text"), [
    ({"level": -0.2}, r"lies below the bed everywhere"),
    ({"level": 0.2}, r"begins under water.*lower the level"),
    ({"section": CrossSection([0, 1, 2], [0.1, -0.1, -0.1])}, r"ends under water"),
    ({"speed": 0.0}, r"Ford\.speed = 0\.0 m/s must be > 0"), ({"speed": 1e3}, r"Ford\.speed"),
    ({"initial_speed": -1.0}, r"Ford\.initial_speed"), ({"duration": 0.0}, r"Ford\.duration"),
    ({"level": math.nan}, r"Ford\.level"), ({"discharge": math.inf}, r"Ford\.discharge"),
    ({"section": CrossSection([0, 1, 2], [0.1, -0.1, 0.1], [0, 1, 0]), "discharge": 1.0}, r"give only one"),
])  # fmt: skip
def test_what_is_no_ford_is_refused(change, text):
    with pytest.raises(ValueError, match=text):
        Ford(**({"section": SECTION, "level": 0.0, "vehicle": sized_amphibious(1.0), "soil": SAND} | change))


def test_what_will_be_driven_is_said():
    lines = ford(discharge=-0.05).lines()
    assert lines["water"].startswith(
        "2 m wide, from station 1 to 3 m; at most 0.12 m deep (0.60 diameters of the tyre)"
    )
    assert "0.05 m^3/s to the right" in lines["water"]
    assert lines["banks"] == "down at most 24.0 %, up at most 24.0 %"
    assert "standing at station 0 m; its tyres at 1 m/s; 3.5 m to go, 8 s" in lines["drive"].replace("-0 m", "0 m")


def test_ground_beyond_the_section_is_said_to_be_taken_as_level():
    """The vehicle needs more dry bank than was measured, on both sides; with enough of it nothing is said."""
    short = CrossSection([0.0, 4.0, 5.0, 9.0], [0.5, -0.4, -0.4, 0.5])
    said = Ford(short, 0.4, sized_amphibious(1.0), SAND).lines()["banks"]
    assert "taken as level before station 0 m and after station 9 m, where the section has no points" in said
    long = CrossSection([-20.0, 0.0, 4.0, 5.0, 9.0, 30.0], [0.5, 0.5, -0.4, -0.4, 0.5, 0.5])
    assert "taken as level" not in Ford(long, 0.4, sized_amphibious(1.0), SAND).lines()["banks"]


def test_bends_of_the_bed_beyond_the_way_are_no_banks():
    station = [-9.0, -8.0, 0.0, 1.0, 1.5, 2.5, 3.0, 4.0, 20.0, 21.0]
    bed = [5.0, 0.1, 0.1, 0.0, -0.12, -0.12, 0.0, 0.1, 0.1, 5.0]
    banks = Ford(CrossSection(station, bed), 0.0, sized_amphibious(1.0), SAND).banks
    assert banks == pytest.approx((0.24, 0.24))
