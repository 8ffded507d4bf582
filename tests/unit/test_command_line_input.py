"""The command line before anything runs: help, tables, bad input."""

import importlib.metadata
import math
import re
from pathlib import Path

import pytest
from typer.testing import CliRunner

import exumob
from exumob.__main__ import app
from exumob.commands.options import COMMON_ANGLES, option_names, radians, taken_for_radians, with_option_names
from exumob.commands.report import _compiling
from exumob.commands.shared import aspects, check_targets
from exumob.ground.soil import Soil
from exumob.simulation.settings import time_scale
from exumob.support.declared import declared_fields
from exumob.support.quantities import Quantity
from exumob.sweeps.run import Progress
from exumob.vehicle.parameters import Hull, Suspension, Vehicle, Wheel
from exumob.vehicle.vehicle_file import load_vehicle

SHORT = ["--duration", "0.2", "--micro-step", "5e-4", "--macro-step", "20e-3"]
OPTIONS = {
    "--depth-ratio": "0.6", "--current": "1.0", "--steering": "30", "--soil": "LETE sand",
    "--hydrodynamics": "auto",
    "--vehicle": None, "--duration": "8", "--micro-step": None, "--macro-step": None, "--setting": "fast",
    "--output": None,
    "--networks": None, "--members": None, "--figure": None, "--animate": None, "--cell-size": "0.0115",
    "--coarse": None, "--coupling": "semi-implicit",
    "--threads": "1", "--checkpoint": None, "--resume": None,
}  # fmt: skip
"""Of the specification, with the defaults it states."""


def call(*arguments):
    return CliRunner().invoke(app, [str(a) for a in arguments], env={"COLUMNS": "250", "TERM": "dumb"})


def plain(text):
    """Without colours and line breaks."""
    return " ".join(re.sub(r"\x1b\[[0-9;]*m", "", text).split())


def lane_change(*arguments):
    return call("lane-change", *SHORT, *arguments)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["drive", "--depth", "80cm"], "'--depth': '80cm' is not a number"),
        (["drive", "--depth=80 cm"], "'--depth': '80 cm' is not a number"),
        (["learn", "--jobs", "2.5"], "'--jobs': '2.5' is not a whole number; give one such as 2."),
        (["captive", "--threads", "\x1b[31mred"], "'\\x1b[31mred' is not a whole number"),
    ],
)
def test_what_is_no_number_is_shown(arguments, said):
    answer = call(*arguments)
    assert answer.exit_code == 2 and said in plain(answer.output), answer.output


def test_a_template_is_a_vehicle_file_of_ones_own(tmp_path):
    file = tmp_path / "car.py"
    assert call("parameters", "large_4x4", "--template", file).exit_code == 0
    assert load_vehicle(file) == load_vehicle("large_4x4")
    for arguments, said in (
        ([file], "is there already"), ([tmp_path / "car.txt"], "use .py"), ([tmp_path / "a.py", "truck"], "small_car"),
        ([tmp_path / "no" / "a.py"], "does not exist"), ([tmp_path / "a.py", "small_car", "Hull"], "one vehicle"),
    ):  # fmt: skip
        answer = call("parameters", "--template", *arguments)
        assert answer.exit_code == 2 and said in plain(answer.output), answer.output
    assert [one.name for one in tmp_path.iterdir()] == ["car.py"]


# -- help and tables ---------------------------------------------------------------------------------------------------


def test_help_names_both_commands():
    answer = call("--help")
    assert answer.exit_code == 0
    assert "lane-change" in answer.output
    assert "soils" in answer.output


@pytest.mark.parametrize("option", OPTIONS)
def test_help_explains_every_option_with_its_default(option):
    answer = call("lane-change", "--help")
    assert answer.exit_code == 0
    text = " " + plain(answer.output.split("Run:")[1])
    after = text[text.index(f" {option} ") :].split(" --")[1]
    assert len(after.split()) > 4, f"{option} is not explained"
    if OPTIONS[option]:
        assert re.search(rf"default: {OPTIONS[option]}", after), after


def test_help_shows_what_a_beginner_needs_first():
    """Spec: panels run, water, output, expert; six options first."""
    text = call("lane-change", "--help").output
    panels = re.split(r"^(Run|Water|Output|Expert):$", text, flags=re.M)
    assert panels[1::2] == ["Run", "Water", "Output", "Expert"]
    first = [option for option in re.findall(r"^ +(--[a-z-]+)", panels[2], flags=re.M) if option != "--help"]
    assert first == ["--depth-ratio", "--current", "--soil", "--vehicle", "--output", "--figure"]


def test_version_is_that_of_the_package():
    answer = call("--version")
    assert answer.exit_code == 0
    assert answer.output.split() == ["exumob", importlib.metadata.version("exumob")]
    assert exumob.__version__ == importlib.metadata.version("exumob")


def test_soils_lists_all_23():
    answer = call("soils")
    assert answer.exit_code == 0
    lines = answer.output.splitlines()
    for row in Soil.published_table():
        (line,) = [text for text in lines if text.strip().startswith(row.name)]
        assert f"{row.soil.n:g}" in line
    assert len(Soil.published_table()) == 23


def test_parameters_lists_every_field_of_a_vehicle_file():
    """With unit, limits and default, from the declarations; others by their names, in any case."""
    answer = call("parameters")
    for owner in (Vehicle, Hull, Wheel, Suspension):
        for field in declared_fields(owner):
            assert re.search(rf"^  {field.name}( \[|: )", answer.output, re.M), field.name
    assert "  mass [kg]: Mass of tyre and rim (> 0 and <= 1e+06, plausible 0.01 to 3000; needed)" in answer.output
    assert "friction_angle [rad]" in call("parameters", "soil").output
    assert len(call("parameters", "all").output) > 2 * len(answer.output)
    wrong = call("parameters", "Suspensoin")
    assert wrong.exit_code == 2 and "'Suspensoin' has no parameters; use Suspension" in plain(wrong.output)


def test_soils_states_the_values_of_the_source():
    (line,) = [text for text in call("soils").output.splitlines() if "LETE sand" in text]
    assert [float(cell) for cell in line.split()[2:]] == [0.79, 102.0, 5301.0, 1.3, 31.1, 12.0, 0.18, 0.32]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--depth-ratio", "-1"], r"^--depth-ratio = -1"),
        (["--current", "-1"], r"^--current = -1.*--current-direction"),
        (["--current", "nan"], r"^--current = nan"),
        (["--steering", "40", "--duration", "4"], r"40\.0 deg.*35\.0 deg"),
        (["--wheel-speed", "nan"], r"^--wheel-speed = nan"),
        (["--soil", "LETE snad"], "LETE sand"),
        (["--hydrodynamics", "cfd2"], "hydrodynamics"),
        (["--vehicle", "absent.py"], r"absent\.py does not exist"),
        (["--duration", "-1"], "duration"),
        (["--duration", "nan"], r"^--duration = nan"),
        (["--duration", "1e6"], r"--duration = 1e\+06 s.*GiB of memory.*give a --duration of .* s or less"),
        (["--steering", "100"], r"^--steering 100 must be -80 to 80 degrees"),
        (["--current-direction", "3000"], r"^--current-direction 3000 must be -360 to 360 degrees"),
        (["--resume"], r"^--resume: .* without --checkpoint"),
        (["--micro-step", "3e-4"], r"--micro-step = 0\.0003 s"),
        (["--macro-step", "3e-3"], r"of --macro-step = 0\.003 s"),
        (["--output", "absent/run.nc"], r"--output absent/run\.nc.*does not exist.*create"),
        (["--figure", "absent/run.png"], r"--figure absent/run\.png.*does not exist"),
        (["--animate", "absent/run.gif"], r"--animate absent/run\.gif.*does not exist"),
        (["--animate", "run.avi"], r"\.avi.*use \.gif or \.mp4"),
        (["--output", "."], r"folder"),
        (["--no-such-option"], "no-such-option"),
        (["--figure", "run.xyz"], r"run\.xyz.*use \.png, \.pdf or \.svg"),
        (["--duration", "0.02", "--figure", "run.png"], r"--duration 0\.02.*too short to draw"),
    ],
    ids=lambda v: " ".join(v) if isinstance(v, list) else "",
)  # fmt: skip
def test_bad_input_is_said_with_exit_code_2(arguments, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    steps = [a for i in range(0, len(SHORT), 2) if SHORT[i] not in arguments for a in SHORT[i : i + 2]]
    answer = call("lane-change", *steps, *arguments)
    assert answer.exit_code == 2, answer.output
    assert re.search(message, plain(answer.output)), answer.output
    assert "Traceback" not in answer.output
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "text",
    [
        "def car():\n    return 1\n",
        "import dataclasses\nfrom vehicle_models.amphibious import amphibious_vehicle as _base\n"
        "def car():\n    return dataclasses.replace(_base(), wheelbase=-1.0)\n",
        "def car(:\n",
        "import no_such_module_xyz\n",
    ],
    ids=["no vehicle", "bad value", "syntax error", "failing import"],
)  # fmt: skip
def test_unusable_vehicle_file_is_said_with_exit_code_2(text, tmp_path):
    file = tmp_path / "mine.py"
    file.write_text(text)
    answer = lane_change("--vehicle", file)
    assert answer.exit_code == 2
    assert re.search(r"mine\.py|wheelbase", plain(answer.output))


def test_cells_too_coarse_are_said_with_exit_code_2():
    answer = call("lane-change", "--hydrodynamics", "cfd", "--cell-size", "0.05", "--duration", "0.1")
    assert answer.exit_code == 2
    assert "a wheel's width of 80.0 mm" in plain(answer.output)
    assert re.search(
        r"use a cell size of 0\.02 m or less \(about .* cells, .* GiB of memory, .*--coarse", plain(answer.output)
    )


@pytest.mark.parametrize("model, extra, word", [
    ("coefficients", ["--networks", "a.safetensors"], "--networks has no effect with --hydrodynamics coefficients"),
    ("coefficients", ["--members"], "--members has no effect with --hydrodynamics coefficients"),
])  # fmt: skip
def test_networks_are_asked_for_where_they_act(model, extra, word):
    answer = lane_change("--hydrodynamics", model, *extra)
    assert answer.exit_code == 2 and word in plain(answer.output)


@pytest.mark.parametrize(
    ("options", "text"),
    [
        (("--depth", "0.4"), "--depth 0.4: write from:to"),
        (("--current", "1:0"), "low = 1.0 must be below high = 0.0"),
        (("--soil", "mud"), "no soil is called 'mud'"),
        (("--hydrodynamics", "magic"), "hydrodynamics = 'magic' is not known"),
        (("--networks", "no_such.safetensors"), "no_such.safetensors does not exist"),
        (("--networks", "paper-lstm", "--networks", "paper-lstm"), "--networks names a file twice"),
        (("--networks", "paper-lstm", "--hydrodynamics", "coefficients"), "(paper-lstm) have no effect with"),
        (("--draws", "0"), "draws = 0"),
        (("--time", "0"), "Limits.time = 0.0"),
    ],
)
def test_bad_maps_are_refused(tmp_path, options, text):
    answer = call("map", "--output", tmp_path / "map", *options)
    assert answer.exit_code == 2
    assert text in plain(answer.output)
    assert not (tmp_path / "map").exists()


def test_a_checkpoint_that_exists_asks_for_the_option(tmp_path):
    (tmp_path / "run.npz").write_bytes(b"")
    answer = lane_change("--checkpoint", tmp_path / "run.npz")
    assert answer.exit_code == 2
    assert "run.npz exists already; resume from it (--resume) or move it away" in plain(answer.output)


def test_what_is_replaced_is_said_and_other_files_are_never_replaced(tmp_path, capsys):
    for name in ("run.nc", "run.png", "vehicle.py"):
        (tmp_path / name).write_text("kept")
    check_targets({"--output": tmp_path / "new.nc"})
    assert capsys.readouterr().err == ""
    check_targets({"--output": tmp_path / "run.nc", "--figure": tmp_path / "run.png", "--animate": None})
    said = capsys.readouterr().err
    assert "run.nc" in said and "run.png exist and are replaced at the end" in said
    with pytest.raises(ValueError, match=r"vehicle\.py: the ending '\.py' does not fit; use \.nc"):
        check_targets({"--output": tmp_path / "vehicle.py"})
    assert {file.read_text() for file in tmp_path.iterdir()} == {"kept"}


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("Water.current_speed = -1.0 m/s must be >= 0; turn the flow with its direction.",
         "--current = -1.0 m/s must be >= 0; turn the flow with --current-direction."),
        ("the flow gave a load that is not finite at 0.1 s; halve macro_step.",
         "the flow gave a load that is not finite at 0.1 s; halve --macro-step."),
        ("the interval at which its duration ends", "the interval at which its duration ends"),
        ("--duration 3 is too short; car.py: record_step", "--duration 3 is too short; car.py: record_step"),
    ],
)  # fmt: skip
def test_errors_name_options_where_there_are_any(text, said):
    assert with_option_names(text) == said
    with pytest.raises(ValueError, match=re.escape(said)), option_names():
        raise ValueError(text)


def test_unusual_values_pass_when_they_are_meant():
    quantity = Quantity("rad", plausible=(-math.pi, math.pi))
    assert radians("--angle", 90.0, quantity) == math.pi / 2.0
    with pytest.raises(ValueError, match="--angle 720 must be -180 to 180 degrees"):
        radians("--angle", 720.0, quantity)
    assert radians("--angle", 720.0, quantity, unusual=True) == 4.0 * math.pi
    for wrong in (math.nan, math.inf, 1e308):
        with pytest.raises(ValueError, match="--angle"):
            radians("--angle", wrong, quantity)


FLOW = (["--threads", "0"], ["--threads", "2"], ["--cell-size", "0.018"], ["--coupling", "strong"], ["--coarse"])
"""Options of the flow in the loop."""
WITHOUT_EFFECT = [
    *[(["lane-change", *model, *option], option[0], "add --hydrodynamics cfd")
      for option in FLOW for model in ([], ["--hydrodynamics", "networks"], ["--hydrodynamics", "coefficients"])],
    *[(["lane-change", "--depth-ratio", "0", *option], option[0], "on dry ground .*leave it out")
      for option in (*FLOW, ["--hydrodynamics", "cfd"], ["--hydrodynamics", "networks"], ["--members"],
                     ["--current", "1"], ["--current-direction", "90"], ["--networks", "a.safetensors"])],
    (["lane-change", "--hydrodynamics", "none", "--current", "1"], "--current", "with --hydrodynamics none"),
    (["lane-change", "--cell-size", "0.018", "--coupling", "strong"], "--cell-size and --coupling", "leave them"),
    (["lane-change", "--setting", "fine", "--micro-step", "1e-4", "--macro-step", "1e-3"], "--setting", "leave it out"),
    (["sweep", "--vary", "hull.mass=49,53", "--samples", "3"], "--samples", "nothing is drawn"),
    (["sweep", "--vary", "hull.mass=49,53", "--seed", "0"], "--seed", "nothing is drawn"),
    *[(["sweep", "study.toml", *option], option[0], "beside a study file")
      for option in (["--seed", "1"], ["--samples", "4"], ["--setting", "fast"], ["--unusual"], ["--set", "soil.n=1"])],
    (["sweep", "--vary", "hull.mass=49,53", "--mpi", "--workers", "2"], "--workers", "with --mpi"),
    (["map", "--draws", "1", "--seed", "1"], "--seed", "with --draws 1"),
    (["verify", "--list", "--slow"], "--slow", "with --list"),
    (["verify", "--list", "sloshing"], "NAMES", "with --list"),
    (["verify", "sloshing", "--slow"], "--slow", "where cases are named"),
]  # fmt: skip


@pytest.mark.parametrize(
    ("arguments", "option", "remedy"), WITHOUT_EFFECT, ids=lambda v: " ".join(v) if isinstance(v, list) else ""
)
def test_options_without_effect_are_refused(arguments, option, remedy, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    answer = call(*arguments)
    said = plain(answer.output)
    assert answer.exit_code == 2, said
    assert re.search(rf"{option}.* ha(s|ve) no effect .*{remedy}", said), said
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("arguments", [
    ["--depth-ratio", "0", "--current", "0"], ["--depth-ratio", "0", "--hydrodynamics", "none"],
    ["--hydrodynamics", "cfd", "--cell-size", "0.0002", "--threads", "2", "--coupling", "strong"],
    ["--setting", "fine", "--micro-step", "1e-4"], ["--hydrodynamics", "none", "--depth-ratio", "0.5"],
])  # fmt: skip
def test_options_that_say_what_is_so_pass(arguments):
    """They get as far as the soil, or the memory that cells of 0.2 mm need."""
    said = plain(call("lane-change", *arguments, "--soil", "LETE snad").output)
    assert "no effect" not in said and re.search("LETE sand|would fit", said), said


@pytest.mark.parametrize(("arguments", "option"), [
    (["lane-change"], "--output"), (["lane-change"], "--figure"), (["lane-change"], "--animate"),
    (["lane-change"], "--checkpoint"), (["lane-change", "--resume"], "--checkpoint"), (["captive"], "--output"),
    (["captive"], "--animate"), (["map"], "--csv"), (["map"], "--figure"), (["verify", "sloshing"], "--output"),
    (["verify", "grid-convergence"], "--figure"), (["export", "n.safetensors"], "--output"),
])  # fmt: skip
@pytest.mark.parametrize("name", ["mine.py", "mine.txt", "mine.h5", "mine"])
def test_an_ending_that_does_not_fit_the_format_is_refused(arguments, option, name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for content in (None, "precious"):
        if content:
            (tmp_path / name).write_text(content)
        answer = call(*arguments, option, name)
        said = plain(answer.output)
        assert answer.exit_code == 2, said
        assert re.search(
            rf"{option[2:]} {name}: (the ending '.*' does not fit|the name has no ending); use \.", said
        ), said
    assert (tmp_path / name).read_text() == "precious"


@pytest.mark.parametrize(("arguments", "message"), [
    (["sweep", "--vary", "hull.mass=49,49"], "hull.mass = 49 stands twice"),
    (["sweep", "--vary", "soil=LETE sand,LETE sand"], "soil = 'LETE sand' stands twice"),
    (["sweep", "--vary", "hull.mass=49,50", "--set", "hull.mass=50"], "both varied and set"),
    (["sweep", "--vary", "hull.mass=49,50", "--set", "soil.n=1", "--set", "soil.n=0.9"], "soil.n is set already"),
    (["map", "--soil", "LETE sand", "--soil", "LETE sand"], "--soil names a soil twice"),
    (["lane-change", "--networks", "a.safetensors", "--networks", "./a.safetensors"], "--networks names a file twice"),
])  # fmt: skip
def test_what_is_given_twice_is_refused(arguments, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    answer = call(*arguments)
    assert answer.exit_code == 2 and message in plain(answer.output), answer.output
    assert list(tmp_path.iterdir()) == []


FORD = Path(__file__).parents[2] / "examples" / "ford.csv"
NO_FORD = [
    ([], "neither --level nor --depth is given"), (["--level", "100", "--depth", "0.4"], "are both given"),
    (["--level", "90"], r"--level = 90 m lies below the bed everywhere .*Raise it"),
    (["--level", "nan"], r"--level = nan is not a finite number"),
    (["--level", "101"], r"ford\.csv: the section begins under water.*lower the level"),
    (["--depth", "5"], r"ford\.csv: the section begins under water.*give a smaller --depth"),
    (["--depth", "0"], r"--depth = 0\.0 m must be > 0"), (["--depth", "-0.3"], r"--depth = -0\.3 m must be > 0"),
    (["--depth", "60", "--unusual"], "begins under water"), (["--depth", "60"], r"--depth = 60\.0 m is outside"),
    (["--level", "100", "--speed", "0"], r"--speed = 0\.0 m/s must be > 0"),
    (["--level", "100", "--speed", "40"], r"--speed = 40\.0 m/s is outside .*--unusual"),
    (["--level", "100", "--duration", "0"], r"--duration = 0\.0 s must be"),
    (["--level", "100", "--duration", "0.01"], r"--duration = 0\.01 s must be a whole multiple of --macro-step"),
    (["--level", "100", "--micro-step", "0"], r"^(?!.*simulate\.).*--micro-step = 0\.0 s must be"),
    *[(["--level", "100", "--hydrodynamics", "cfd", "--coarse", "--micro-step", step], said)
      for step, said in (("0", "step = 0.0 s must be"), ("nan", "step = nan is not a finite number"),
                         ("1e-320", "step = 1e-320 s must be"), ("-1e-3", "step = -0.001 s must be"))],
    (["--level", "100", "--initial-speed", "-1"], r"--initial-speed = -1\.0 m/s must be"),
    (["--level", "100", "--density", "0"], r"--density = 0\.0 kg/m\^3 must be"),
    (["--level", "100", "--discharge", "2"], r"--discharge: the section has a current of its own"),
    (["--level", "100", "--hydrodynamics", "cfd", "--cell-size", "0.0002"], r"--cell-size = 0\.0002 m makes"),
    (["--level", "100", "--cell-size", "0.02"], r"--cell-size has no effect .*add --hydrodynamics cfd"),
    (["--level", "100", "--resume"], r"--resume: there is nothing to go on from without --checkpoint"),
    (["--level", "100", "--soil-value", "cohesoin=1"], r"--soil-value 'cohesoin=1' is not known; use cohesion=VALUE"),
    (["--level", "100", "--soil", "LETE snad"], r"--soil: no soil is called"),
    (["--level", "100", "--output", "mine.txt"], r"--output mine\.txt: the ending"),
    (["--level", "100", "--hydrodynamics", "coefficients", "--networks", "a"], r"--networks has no effect"),
]  # fmt: skip


@pytest.mark.parametrize(("arguments", "text"), NO_FORD, ids=lambda v: " ".join(v) if isinstance(v, list) else "")
def test_what_is_no_ford_is_refused_in_the_options_names(arguments, text, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    answer = call("ford", FORD, *arguments)
    assert answer.exit_code == 2 and re.search(text, plain(answer.output)), answer.output
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("text", "said"), [
    ("station [m], bed [m]\n0, 1\n2, 0\n1, 0\n3, 1\n", r"line 4: station 1 m follows 2 m"),
    ("station [m], bed [m]\n0, 1\n1,\n2, 0\n3, 1\n", r"line 3: bed is missing"),
    ("station [m], bed [m]\n0, 1\n2, 0\n", r"ends under water, 0\.3 m deep"),
    ("station [km], bed [m]\n0, 1\n2, 0\n3, 1\n", r"is in km; convert it to m"),
    ("x, y\n0, 1\n2, 0\n3, 1\n", r"column 'x' is not known"), ("", r"is empty"),
])  # fmt: skip
def test_bad_sections_are_refused_with_their_line(text, said, tmp_path):
    (tmp_path / "bad.csv").write_text(text)
    answer = call("ford", tmp_path / "bad.csv", "--depth", "0.3")
    assert answer.exit_code == 2 and re.search(said, plain(answer.output)), answer.output


FILES = {
    "line.csv": "x [m], y [m]\n-1, 0\n5, 0\n",
    "far.csv": "x [m], y [m]\n900, 0\n950, 0\n",
    "bare.csv": "x, y\n0, 0\n5, 0\n",
    "hole.csv": "x [m], y [m]\n0, 0\n5,\n",
    "turn.csv": "time [s], steering [deg], wheel speed [rad/s]\n0, 0, 0\n1, 90, 1\n2, 0, 1\n3, 0, 1\n",
    "grid.asc": "ncols 2\nnrows 2\nxllcorner 0\nyllcorner 0\ncellsize 1\nNODATA_value -9\n0 0\n0 -9\n",
    "short.asc": "ncols 3\nnrows 2\nxllcorner 0\nyllcorner 0\ncellsize 1\n0 0\n0 1\n",
    "far.asc": "ncols 2\nnrows 2\nxllcorner 900\nyllcorner 0\ncellsize 1\n0 0\n0 1\n",
    "word.asc": "ncols 2\nnrows 2\nxllcorner 0\nyllcorner 0\ncellsize 1\n0 a\n0 1\n",
}
NO_DRIVE = [
    (["--path", "line.csv", "--recorded", "turn.csv"], "--path and --recorded each say the maneuver"),
    (["--maneuver", "straight", "--path", "line.csv"], "--maneuver and --path each say the maneuver"),
    (["--depth", "0.1", "--level", "0.1"], "--depth and --level each say the water"),
    (["--slope", "5", "--terrain", "grid.asc"], "--slope and --terrain each say the ground"),
    (["--slope", "5", "--depth", "0.1"], "--depth goes with level ground, and with --slope it is not"),
    (["--section", str(FORD), "--depth-ratio", "0.5"], "--depth-ratio goes with level ground"),
    (["--section", str(FORD), "--depth", "0.2", "--current", "1"], "--current has no effect with --section"),
    (["--steering", "20"], "--steering has no effect without the lane change"),
    (["--slope-direction", "20"], "--slope-direction has no effect on level ground"),
    (["--recorded", "turn.csv", "--speed", "2"], "--speed has no effect with --recorded"),
    (["--depth", "0.1", "--discharge", "2"], "--discharge has no effect without a section"),
    (["--current", "1"], "--current has no effect on dry ground; leave it out, or give --depth"),
    (["--slope", "70"], "--slope 70 must be -60 to 60 degrees"), (["--heading", "400"], "--heading 400 must be"),
    (["--speed", "nan"], "--speed = nan is not a finite"), (["--start-x", "nan"], "--start-x = nan is not a finite"),
    (["--soil-value", "cohesoin=9"], "--soil-value 'cohesoin=9' is not known; use cohesion=VALUE"),
    (["--soil-value", "phi=30"], "--soil-value 'phi=30' is not known; use friction_angle=VALUE"),
    (["--soil-value", "n=x"], "--soil-value 'n=x' holds no number"),
    (["--soil-value", "n=1", "--soil-value", "n=1"], "--soil-value n stands twice"),
    (["--soil-value", "friction_angle=95"], "--soil-value friction_angle 95 must be 0 to 80 degrees"),
    (["--soil-value", "cohesion=-3"], "--soil-value cohesion = -3\\.0 Pa must be >= 0"),
    (["--path", "none.csv"], "none.csv does not exist; give a table .* x \\[m\\], y \\[m\\]"),
    (["--recorded", "."], "is a folder; give a table .* time \\[s\\]"),
    (["--path", "far.csv"], "--path: the path comes no nearer"),
    (["--path", "bare.csv"], "column .x. names no unit; write"), (["--path", "hole.csv"], "line 3: y is missing"),
    (["--recorded", "line.csv"], "column 'x \\[m\\]' is not known here.*give time"),
    (["--recorded", "turn.csv"], "turn.csv, line 3: the steering is 90 degrees, and must be -80 to 80"),
    (["--terrain", "none.asc"], "none.asc cannot be read"), (["--terrain", "grid.asc"], "1 heights are missing"),
    (["--terrain", "short.asc"], "holds 4 heights, and ncols times nrows is 6"),
    (["--terrain", "line.csv"], "does not say ncols"), (["--terrain", "word.asc"], "line 6: 'a' is not a number"),
    (["--terrain", "far.asc"], "the vehicle at its start"),
    (["--river", "none.nc"], "--river none.nc does not exist; give a netCDF"),
    (["--river", "."], "--river \\. is a folder; give a netCDF file of bed"),
    (["--river", "line.csv"], "line.csv is not a netCDF file; give a netCDF file of bed, level and velocity"),
    (["--section", "."], "file \\. is a folder; give a table of stations"),
    (["--terrain", "."], "\\. cannot be read .Is a directory"),
    (["--vehicle", "."], "vehicle file \\. is a folder"), (["--soil", "clya"], "`exumob soils`"),
    (["--depth", "0.1", "--networks", "."], "file of networks \\. is a folder"),
    (["--slope", "5", "--level", "0.1", "--hydrodynamics", "cfd", "--cell-size", "0.0002"], "--cell-size = 0.0002 m"),
]  # fmt: skip


@pytest.mark.parametrize(("arguments", "text"), NO_DRIVE, ids=lambda v: " ".join(v) if isinstance(v, list) else "")
def test_what_cannot_be_driven_is_refused_in_the_options_names(arguments, text, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name, content in FILES.items():
        (tmp_path / name).write_text(content)
    answer = call("drive", "--output", "run.nc", *arguments)
    assert answer.exit_code == 2 and re.search(text, plain(answer.output)), answer.output
    assert {file.name for file in tmp_path.iterdir()} == set(FILES)


def test_a_section_that_is_not_there_is_named_by_its_file():
    said = plain(call("ford", "none.csv", "--depth", "0.3").output)
    assert said == "file none.csv does not exist; give a table of stations and bed (CSV)."


@pytest.mark.parametrize(("text", "lines"), [
    ("networks, measured: 1.4 % (worst 3.7 %).", 1),
    ("coefficients, not validated: none. Elsewhere 16 %. Soil: given; 13 to 16 % off. Under water it is saturated.", 4),
])  # fmt: skip
def test_the_line_of_trust_has_one_aspect_a_line_and_all_its_words(text, lines):
    shown = aspects(text, 13)
    assert shown.count("\n") + 1 == lines and " ".join(shown.split()) == text


@pytest.mark.parametrize("arguments", [["sweep", "--vary", "hull.mass=49,50"], ["map"]])
@pytest.mark.parametrize("name", ["x.nc", "x.csv"])
def test_a_folder_with_the_name_of_a_file_is_refused(arguments, name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    answer = call(*arguments, "--output", name)
    said = plain(answer.output)
    assert answer.exit_code == 2 and f" {name}: this is to be a folder, and {name[1:]} is the ending" in said, said
    assert list(tmp_path.iterdir()) == []


def test_angles_that_are_given_in_radians_are_noticed(capsys):
    """Four digits of a common angle in radians; angles that people give in degrees are none of them."""
    for angle in map(math.radians, COMMON_ANGLES):
        assert len(f"{angle:.4g}".lstrip("0.").replace(".", "")) == 4
        for digits in (4, 6, 16):
            assert taken_for_radians(float(f"{angle:.{digits}g}")), angle
            assert taken_for_radians(-float(f"{angle:.{digits}g}")), angle
    for degrees in (
        *(0.5 * n for n in range(-720, 721)),
        0.1,
        0.52,
        0.8,
        1.57,
        3.14,
        6.28,
        math.degrees(math.pi / 6.0),
    ):
        assert not taken_for_radians(degrees), degrees
    quantity = Quantity("rad", at_least=-math.pi, at_most=math.pi)
    assert radians("--steering", 0.5236, quantity) == math.radians(0.5236)
    assert "--steering 0.5236 was understood in degrees; in radians it would be 30 deg" in capsys.readouterr().err
    radians("--steering", 30.0, quantity)
    assert capsys.readouterr().err == ""


# -- another vehicle ---------------------------------------------------------------------------------------------------


def test_maps_and_sweeps_say_how_another_vehicle_is_driven(tmp_path, monkeypatch):
    """By Froude's law, and over a window that goes with its size; said once all is checked."""
    asked = []

    def map_of(wanted, folder, workers, progress):
        asked.append(wanted)
        progress("level 0", Progress(0, 4, math.nan))
        raise ValueError("as far as this")

    def sweep_of(experiment, cases, folder, progress, **options):
        asked.append(experiment)
        progress(Progress(0, 2, math.nan))
        raise ValueError("as far as this")

    monkeypatch.setattr("exumob.mobility.map.compute_map", map_of)
    monkeypatch.setattr("exumob.sweeps.run.sweep", sweep_of)
    unit = time_scale(load_vehicle("small_car"))
    said = plain(call("map", "--vehicle", "small_car", "--hydrodynamics", "calibrated", "--output", tmp_path).output)
    limits, experiment = asked[0].crossing.limits, asked[0].crossing.experiment
    assert limits.window == pytest.approx(1.5 * unit) and experiment.duration == pytest.approx(4.0 * unit, abs=0.02)
    assert (
        f"small car, {experiment.duration:g} s; tyres at 1.86 m/s (6.16 rad/s) at the end, judged over the last 2.8 s"
        in said
    )
    call("map", "--output", tmp_path)
    assert asked[1].crossing.limits.window == 1.5 and asked[1].crossing.experiment.duration == 4.0
    said = plain(call("sweep", "--vehicle", "small_car", "--vary", "hull.mass=900,1000", "--output", tmp_path).output)
    assert f"driven, unless varied: small car, {asked[2].duration:g} s; tyres at 1.86 m/s" in said


def test_time_of_compiling_is_said_where_it_is_felt():
    assert _compiling(0.3) == "" and _compiling(57.2) == "; 57 s to compile kernels, which are kept"
