"""`exumob drive` and `exumob ford`: runs, files, what is printed, exit codes."""

import json
import math
import re
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pytest
from typer.testing import CliRunner

from exumob.__main__ import app
from exumob.ground.soil import Soil
from exumob.mobility.ford import Ford, ford_report
from exumob.mobility.ford_figure import plot_ford
from exumob.simulation.result_files import load_dataset
from exumob.surrogates.model import SurrogateHydrodynamics
from exumob.water.cross_section import CrossSection
from vehicle_models.amphibious import amphibious_vehicle
from vehicle_models.small_car import small_car

ROOT = Path(__file__).parents[2]
BROOK = """station [m], bed [m], current [m/s]
0, 0.06, 0
1, 0.05, 0
1.8, -0.04, 0.12
2.2, -0.12, 0.30
2.8, -0.03, 0.15
3.4, 0.06, 0
"""


def call(*arguments):
    return CliRunner().invoke(app, [str(a) for a in arguments], env={"COLUMNS": "250", "TERM": "dumb"})


def plain(text):
    """Without colours and line breaks."""
    return " ".join(re.sub(r"\x1b\[[0-9;]*m", "", text).split())


@pytest.fixture
def brook(tmp_path):
    (tmp_path / "brook.csv").write_text(BROOK)
    return tmp_path / "brook.csv"


def test_a_brook_is_forded_reported_and_drawn(brook, tmp_path):
    """1.6 m of water, 0.12 m deep: from half a vehicle before it to past it at 0.7 to 1 m/s."""
    files = {ending: tmp_path / f"run.{ending}" for ending in ("nc", "png", "gif")}
    answer = call(
        "ford", brook, "--level", "0", "--hydrodynamics", "coefficients", "--duration", "5",
        "--output", files["nc"], "--figure", files["png"], "--animate", files["gif"],
    )  # fmt: skip
    assert answer.exit_code == 0, answer.output
    said = plain(answer.output)
    assert "water 1.556 m wide, from station 1.444 to 3 m; at most 0.12 m deep (0.60 diameters of the tyre)" in said
    assert "banks down at most 20.0 %, up at most 15.0 %" in said
    assert "standing at station 0.4444 m; its tyres at 1 m/s; 3.056 m to go, 5 s to do it in" in said
    seconds = float(re.search(r"verdict crosses: all of it is past the far edge after ([0-9.]+) s", said)[1])
    assert 3.2 < seconds < 5.0
    for word in ("trust", "deepest", "wheel load", "slip", "freeboard", "clearance", "drift"):
        assert f" {word} " in said
    run = load_dataset(files["nc"])
    assert float(run["time"][-1]) == pytest.approx(5.0)
    assert float(run["position"].sel(body="hull", axis="x")[0]) == pytest.approx(0.444, abs=0.02)
    assert float(run["water_depth"].max()) == pytest.approx(0.12, abs=0.01)
    assert float(run["current"].sel(axis="y").max()) == pytest.approx(0.3, abs=0.02)
    assert files["png"].read_bytes().startswith(b"\x89PNG") and files["gif"].read_bytes().startswith(b"GIF8")


def test_a_ford_is_drawn_with_the_whole_vehicle_and_one_axis_of_stations():
    """On the bank a car stands inclined: its highest corner is in the picture, and the panels are equally wide."""
    from matplotlib.patches import Polygon

    ford = Ford(CrossSection.read(ROOT / "examples" / "ford.csv"), 99.9, small_car(), Soil.published("LETE sand"),
                duration=0.6)  # fmt: skip
    run = ford.drive("coefficients")
    figure = plot_ford(run, ford, ford_report(run, ford))
    figure.canvas.draw()
    side, *others = figure.axes
    corners = np.concatenate([patch.get_xy() for patch in side.patches if isinstance(patch, Polygon)])
    assert corners[:, 1].max() < side.get_ylim()[1] and corners[:, 0].min() > side.get_xlim()[0]
    for axes in others:
        assert axes.get_position().intervalx == pytest.approx(side.get_position().intervalx, abs=2e-3)
    plt.close(figure)


def test_the_members_of_an_ensemble_ford_the_brook_one_by_one(brook, tmp_path):
    files = "--output", tmp_path / "run.nc", "--figure", tmp_path / "run.png"
    answer = call("ford", brook, "--level", "0", "--members", "--duration", "0.4", *files)
    assert answer.exit_code == 0, answer.output
    assert re.search(
        r"members 0 of 5 networks, each driving alone, come out past the far edge; drift", plain(answer.output)
    )
    run = load_dataset(tmp_path / "run.nc")
    hull = run["position"].sel(body="hull").values
    assert np.abs(run["member_position"].values - hull).max() < 0.02  # over this ground, from this start
    one = Ford(CrossSection.read(brook), 0.0, amphibious_vehicle(), Soil.published("LETE sand"), duration=0.4)
    networks = SurrogateHydrodynamics()
    again = one.add_members(one.drive(networks), networks)
    assert np.array_equal(again["member_position"].values, run["member_position"].values)


def test_members_are_refused_without_networks_in_a_ford(brook):
    answer = call("ford", brook, "--level", "0", "--members", "--hydrodynamics", "coefficients")
    assert answer.exit_code == 2 and "--members has no effect with --hydrodynamics coefficients" in plain(answer.output)
    car = ROOT / "vehicle_models" / "small_car.py"
    answer = call("ford", ROOT / "examples" / "ford.csv", "--depth", "0.3", "--members", "--vehicle", car)
    assert answer.exit_code == 2 and "--members needs networks of two seeds at least" in plain(answer.output)


def test_too_slow_for_its_time_is_said_with_the_place(brook, tmp_path):
    answer = call("ford", brook, "--depth", "0.1", "--speed", "0.5", "--duration", "2", "--hydrodynamics", "none")
    assert answer.exit_code == 0, answer.output
    said = plain(answer.output)
    assert re.search(
        r"does not cross: it is still under way at 0\.\d\d m/s when its 2 s are over, at station 1\.", said
    )
    assert "give it more time" in said


def test_a_drive_along_waypoints_over_a_slope_through_water(tmp_path):
    """Start, path, ground, water and soil are those asked for, and the vehicle starts rolling."""
    (tmp_path / "line.csv").write_text("x [m]; y [m]\n3,0; 5\n3; 9,5\n")
    answer = call(
        "drive", "--path", tmp_path / "line.csv", "--start-x", "3", "--start-y", "6", "--heading", "90",
        "--slope", "3", "--slope-direction", "90", "--level", "0.4", "--current", "0.2", "--current-direction", "0",
        "--initial-speed", "0.8", "--speed", "0.8", "--soil-value", "cohesion=1500", "--soil-value",
        "friction_angle=25", "--duration", "0.6", "--hydrodynamics", "coefficients", "--output", tmp_path / "run.nc",
    )  # fmt: skip
    assert answer.exit_code == 0, answer.output
    run = load_dataset(tmp_path / "run.nc")
    place = run["position"].sel(body="hull").values
    assert place[0, :2] == pytest.approx([3.0, 6.0], abs=0.03)
    assert place[-1, 1] - place[0, 1] > 0.3 and abs(place[-1, 0] - 3.0) < 0.05
    assert float(run["forward_velocity"][0]) == pytest.approx(0.8, abs=0.02)
    assert float(run["water_depth"][0]) == pytest.approx(0.4 - 6.0 * math.tan(math.radians(3.0)), abs=2e-3)
    parts = json.loads(run.attrs["parameters"])
    soil = next(iter(parts["soil"].values()))
    assert soil["cohesion"] == 1500.0 and soil["friction_angle"] == pytest.approx(math.radians(25.0))
    assert soil["name"] == "LETE sand, changed"
    assert "PathFollowing" in parts["maneuver"]


def test_a_recorded_drive_over_a_field_of_heights(tmp_path):
    time = np.arange(0.0, 1.01, 0.1)
    rows = "\n".join(f"{t:.1f}, {5.0 * t * t:.4f}, {8.0 * t:.4f}" for t in time)
    (tmp_path / "drive.csv").write_text(f"time [s], steering [deg], wheel speed [rad/s]\n{rows}\n")
    heights = "\n".join(" ".join(f"{50.0 + 0.01 * i:.2f}" for i in range(13)) for _ in range(9))
    header = "ncols 13\nnrows 9\nxllcorner 97\nyllcorner 198\ncellsize 0.5\n"
    (tmp_path / "ground.asc").write_text(header + heights + "\n")
    answer = call(
        "drive", "--recorded", tmp_path / "drive.csv", "--terrain", tmp_path / "ground.asc", "--start-x", "100",
        "--start-y", "200", "--duration", "0.4", "--output", tmp_path / "run.nc",
    )  # fmt: skip
    assert answer.exit_code == 0, answer.output
    run = load_dataset(tmp_path / "run.nc")
    assert float(run["position"].sel(body="front_left", axis="z")[0]) == pytest.approx(50.16, abs=0.03)
    assert float(run["wheel_speed"][-1].mean()) == pytest.approx(3.2, abs=0.3)


def test_speed_and_time_of_a_drive_go_with_the_vehicle(tmp_path):
    """A wheelbase of 2.46 m: 1.86 m/s, and a lane change that is 1.86 times as long."""
    car = ROOT / "vehicle_models" / "small_car.py"
    options = ["--maneuver", "lane-change", "--vehicle", car, "--duration", "0.2", "--output", tmp_path / "run.nc"]
    answer = call("drive", *options)
    assert answer.exit_code == 0, answer.output
    maneuver = next(iter(json.loads(load_dataset(tmp_path / "run.nc").attrs["parameters"])["maneuver"].values()))
    unit = math.sqrt(2.46 / 0.714)
    assert maneuver["speed"] * 0.3015 == pytest.approx(unit, rel=1e-6)
    assert (maneuver["start"], maneuver["end"]) == pytest.approx((2.0 * unit, 5.5 * unit))
