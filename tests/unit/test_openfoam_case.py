"""The comparison with OpenFOAM without OpenFOAM: consistent dictionaries, and what is read from samples of a run."""

import re
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks" / "openfoam"))
from bore import bore_files
from case_files import TURBULENCE, case_files, profile_points, write_case
from compare import spectrum_shares
from interfoam import OpenFoamError, joined, missing, parse_cells, parse_log, parse_table, read_forces
from situations import SITUATIONS, graded

from exumob.flow import Grid
from exumob.verification.dam_breaks import FILM, GATE, HELD, bore_faces

PATCHES = {"inlet", "outlet", "sides", "bed", "atmosphere", "body"}

# from a run of box-0.5 with 21,924 cells, the lines that are read and some between them
LOG = """
Time = 0.0001200192

PIMPLE: iteration 1
smoothSolver:  Solving for alpha.water, Initial residual = 1.027343592e-06, Final residual = 3.6e-14, No Iterations 1
GAMG:  Solving for p_rgh, Initial residual = 1, Final residual = 0.00207415775, No Iterations 1
GAMG:  Solving for p_rgh, Initial residual = 0.0006818558977, Final residual = 5.569337752e-08, No Iterations 10
ExecutionTime = 0.35 s  ClockTime = 1 s

Courant Number mean: 0.000713970646 max: 0.002788780663
Time = 0.00026404225

GAMG:  Solving for p_rgh, Initial residual = 0.001062817362, Final residual = 6.348248377e-06, No Iterations 5
GAMG:  Solving for p_rgh, Initial residual = 7.812528249e-06, Final residual = 7.368326996e-08, No Iterations 5
ExecutionTime = 0.46 s  ClockTime = 2 s
"""
FORCE = """# Force           
# CofR            : (0.0000000000e+00 0.0000000000e+00 1.7800000000e-01)
#
# Time            	(total_x total_y total_z)	(pressure_x pressure_y pressure_z)	(viscous_x viscous_y viscous_z)
0.0001200192      	(-1.55e+02 -1.13e-04 1.81e+02)	(-1.549e+02 -1.13e-04 1.81e+02)	(-6.63e-02 -5.16e-10 6.38e-05)
0.00026404225     	(-1.20e+02 8.82e-06 1.83e+02)	(-1.203e+02 8.82e-06 1.83e+02)	(-6.64e-02 -4.45e-10 -2.90e-05)
0.0004368699      	(-6.30e+01 -6.80e-05 1.83e+02)	(-6.292e+01 -6.80e-05 1.83e+02)	(-6.65e-02 -9.07e-10 -1.16e-04)
"""  # noqa: W291
MESH = """Mesh stats
    points:           24826
    cells:            21924
    faces per cell:   6
"""


@pytest.mark.parametrize("situation", SITUATIONS.values(), ids=SITUATIONS.keys())
@pytest.mark.parametrize("cells", [20_000, 100_000, 300_000])
def test_grid_suits_both_solvers(situation, cells):
    """Our grid takes the faces; they lie on the window's ends, the still level, and the body's sides."""
    situation = situation.with_cells(cells)
    faces = situation.faces()
    grid = Grid(*faces)
    within = 0.3 if situation.bow[1] else 0.25  # the layers between keel, level and the rake's end are few
    assert grid.n_cells == situation.n_cells == pytest.approx(cells, rel=within)
    for axis in range(3):
        assert faces[axis][[0, -1]] == pytest.approx([situation.low[axis], situation.high[axis]])
    assert np.abs(faces[2] - situation.depth).min() < 1e-12
    for axis in range(3):
        for side in (-0.5, 0.5):
            end = situation.center[axis] + side * situation.size[axis]
            if axis < 2 or 0.0 < end < situation.depth:
                assert np.abs(faces[axis] - end).min() < 1e-12


@pytest.mark.parametrize("situation", SITUATIONS.values(), ids=SITUATIONS.keys())
@pytest.mark.parametrize("turbulence", TURBULENCE)
def test_case_is_consistent(situation, turbulence, tmp_path):
    """Every patch has a condition in every field, brackets close, fields fit the model, mesh and grid agree."""
    files = case_files(situation, turbulence, 2, 1.0)
    write_case(tmp_path, files)
    for name in files:
        text = (tmp_path / name).read_text()
        assert text.startswith("FoamFile")
        for a, b in ("{}", "()"):
            assert text.count(a) == text.count(b), name
        assert not re.search(r"#calc|coded|\bnan\b|\binf\b", text), name
        if name.startswith("0/"):
            assert set(re.findall(r"^  (\w+) \{ type", text, re.MULTILINE)) == PATCHES, name
    wanted = {"kOmegaSST": {"k", "omega", "nut"}, "Smagorinsky": {"nut"}, "laminar": set()}[turbulence]
    assert {Path(n).name for n in files if n.startswith("0/")} == {"U", "p_rgh", "alpha.water", *wanted}
    mesh = files["system/blockMeshDict"]
    counts = [int(n) for n in re.search(r"hex \(.*?\) \((\d+ \d+ \d+)\)", mesh).group(1).split()]
    widths = [float(w) for w in re.findall(r"\(([\d.e-]+) 1 1\)", mesh)]
    assert counts == [len(f) - 1 for f in situation.faces()]
    assert widths == pytest.approx(np.concatenate([np.diff(f) for f in situation.faces()]))
    assert f"uniform ({-situation.current:g} 0 0)" in files["0/U"]


@pytest.mark.parametrize("turbulence", TURBULENCE)
def test_the_bore_has_the_tank_of_exumob(turbulence, tmp_path):
    """Its mesh is exumob's grid; every patch has a condition in every field; the water is as much as exumob's."""
    files = bore_files(0.02, turbulence, 1.0)
    write_case(tmp_path, files)
    for name in files:
        text = (tmp_path / name).read_text()
        assert text.count("{") == text.count("}") and text.count("(") == text.count(")"), name
        if name.startswith("0/"):
            assert set(re.findall(r"^  (\w+) \{ type", text, re.MULTILINE)) == {"walls", "atmosphere", "body"}, name
    faces = bore_faces(0.02)
    widths = [float(w) for w in re.findall(r"\(([\d.e-]+) 1 1\)", files["system/blockMeshDict"])]
    assert widths == pytest.approx(np.concatenate([np.diff(f) for f in faces]))
    layers = re.findall(
        r"box \((\S+) -9 (\S+)\) \((\S+) 9 (\S+)\); fieldValues \( volScalarFieldValue alpha.water (\S+) \)",
        files["system/setFieldsDict"],
    )
    numbers = np.array(layers, dtype=float)
    for begin, level in ((-9.0, HELD), (GATE, FILM)):
        part = numbers[numbers[:, 0] == begin]
        assert ((part[:, 3] - part[:, 1]) * part[:, 4]).sum() == pytest.approx(level)


def test_recorded_columns_lie_outside_the_body():
    situation = SITUATIONS["box-0.5"]
    points = profile_points(situation)
    assert points.shape == (len(points), len(situation.faces()[2]) - 1, 3)
    assert np.abs(points[..., 0] - situation.center[0]).min() > 0.5 * situation.size[0]
    assert np.ptp(points[..., 1]) == 0.0
    assert np.abs(points[0, 0, 1]) < 0.04


def test_log_gives_cost():
    steps, wall, cpu, iterations = parse_log(LOG)
    assert (steps, iterations) == (2, 10.5)
    assert (wall, cpu) == pytest.approx((1.0, 0.11))
    assert parse_log(LOG + LOG)[2] == pytest.approx(0.11)  # continued: the clock began anew
    assert parse_cells(MESH) == 21924
    with pytest.raises(OpenFoamError, match="cells"):
        parse_cells("")


def test_records_of_a_continued_run_are_joined(tmp_path):
    for begin, text in (("0", FORCE), ("0.00025", FORCE[: FORCE.index("0.0001200192")] + FORCE.splitlines()[-1])):
        for file in ("force.dat", "moment.dat"):
            path = tmp_path / "postProcessing" / "forces" / begin / file
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text)
    assert parse_table(FORCE).shape == (3, 10)
    assert joined(tmp_path, "forces", "force.dat")[:, 0] == pytest.approx([0.0001200192, 0.00026404225, 0.0004368699])
    _, force, viscous, moment = read_forces(tmp_path)
    assert force[:, 0] == pytest.approx([-155.0, -120.0, -63.0])
    assert viscous[0, 0] == pytest.approx(-0.0663)
    assert moment.shape == (3, 3)


def test_bad_settings_are_named():
    situation = SITUATIONS["box-0.5"]
    with pytest.raises(ValueError, match=r"turbulence = 'k-epsilon'; choose"):
        case_files(situation, "k-epsilon", 1, 1.0)
    with pytest.raises(ValueError, match=r"cell_size = 0\.2 m"):
        replace(situation, cell_size=0.2)
    with pytest.raises(ValueError, match="settled"):
        replace(situation, duration=1.0)


def test_absent_openfoam_is_said_clearly(monkeypatch):
    monkeypatch.setenv("PATH", "")
    assert "not installed" in missing()


def test_growing_cells_end_where_they_should():
    faces = graded((-0.05, 0.05), 0.1, 0.2, -1.0, 2.0, 0.0125)
    widths = np.diff(faces)
    assert faces[[0, -1]] == pytest.approx([-1.0, 2.0])
    assert np.exp(np.abs(np.diff(np.log(widths)))).max() < 1.08


def test_shares_of_a_spectrum_are_those_of_its_sines():
    """Squares of 9, 4 and 1 at 1, 3 and 10 Hz on a mean and a trend, which do not count."""
    time = 0.01 * np.arange(1, 401)
    series = 50.0 + 3.0 * time + sum(
        a * np.sin(2.0 * np.pi * f * time) for a, f in ((3.0, 1.0), (2.0, 3.0), (1.0, 10.0))
    )  # fmt: skip
    assert spectrum_shares(time, series) == pytest.approx([9.0 / 14.0, 4.0 / 14.0, 1.0 / 14.0], abs=0.03)
