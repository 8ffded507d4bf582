"""`exumob learn`: runs side by side that are killed and go on, training, report card, and the whole with the flow."""

import base64
import multiprocessing
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from made_up_learning import ENVELOPE, coefficient_flow, killed_once, of_another_version, quick, slow
from typer.testing import CliRunner

from exumob.__main__ import app
from exumob.learning.campaign import LearningFolder, run_campaign
from exumob.learning.dataset import load_runs
from exumob.learning.plan import LearningRange, make_plan
from exumob.simulation.result_files import load_dataset
from exumob.surrogates.ensemble import card_of, load_members
from vehicle_models.amphibious import amphibious_vehicle

pytest.importorskip("torch")
from exumob.learning.learn import CARD, learn_from

CAR = amphibious_vehicle()
MPIEXEC = shutil.which("mpiexec", path=Path(sys.executable).parent) or shutil.which("mpiexec")
"""Of the environment's own MPI, if it has one."""
OPEN_MPI = {
    "OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1", "OMPI_MCA_rmaps_base_oversubscribe": "1"
}  # fmt: skip
RANKS = """
from pathlib import Path
from made_up_learning import ENVELOPE, quick
from exumob.learning.campaign import LearningFolder, run_campaign, working_ranks
from exumob.learning.plan import LearningRange, make_plan
from vehicle_models.amphibious import amphibious_vehicle

if __name__ == "__main__":
    car = amphibious_vehicle()
    wanted = LearningRange(depth=(0.45, 0.65), current=(0.0, 1.0))
    plan = make_plan(car, wanted, 0.012, 0.06, ENVELOPE, run_time=0.4)
    failed = run_campaign(plan.tasks, car, LearningFolder(Path({folder!r})), mpi=True, compute=quick)
    print(*failed, "made by", working_ranks())
"""
WANTED = LearningRange(depth=(0.45, 0.65), current=(0.0, 1.0))  # wet hulls, which larger loads do not float off


@pytest.fixture(scope="module")
def short():
    """A few runs, as short as they can be."""
    return make_plan(CAR, WANTED, 0.012, 0.06, ENVELOPE, run_time=0.4)


def test_runs_are_made_side_by_side_and_only_once(short, tmp_path):
    folder, said = LearningFolder(tmp_path / "a"), []
    failed = run_campaign(short.tasks, CAR, folder, jobs=2, progress=said.append, compute=quick)
    broken = [task.name for task in short.tasks if "003" in task.name]
    assert list(failed) == broken and "it broke down" in failed[broken[0]]
    assert {f.stem for f in folder.runs.glob("*.nc")} == {task.name for task in short.tasks} - set(broken)
    assert [f.name for f in folder.work.iterdir()] == [f"{broken[0]}.npz"]  # what it goes on from
    assert {step.name for step in said if step.done} == {task.name for task in short.tasks}
    assert [task.name for task in folder.unfinished(short.tasks)] == broken
    runs = load_runs(folder.runs.glob("*.nc"))
    assert set(runs) == set(folder.load()) and all("flow_revision" in run.attrs for run in runs.values())


def test_a_killed_run_goes_on_from_its_checkpoint(short, tmp_path):
    """Each of three runs is killed once: after the second death the campaign goes on, after the third it says so."""
    folder, tasks = LearningFolder(tmp_path), short.tasks[:3]
    failed = run_campaign(tasks, CAR, folder, compute=killed_once)
    assert list(failed) == [tasks[2].name] and "the same command goes on" in failed[tasks[2].name]
    assert folder.unfinished(tasks) == [tasks[2]] and (folder.work / f"{tasks[2].name}.npz").exists()
    assert not run_campaign(tasks, CAR, folder, compute=killed_once) and not folder.unfinished(tasks)


def test_a_checkpoint_of_another_version_is_begun_anew(short, tmp_path):
    folder, tasks = LearningFolder(tmp_path), short.tasks[:1]
    (folder.work / f"{tasks[0].name}.npz").write_text("of another version")
    assert not run_campaign(tasks, CAR, folder, compute=of_another_version) and not folder.unfinished(tasks)
    assert not list(folder.work.iterdir())


def test_a_campaign_that_is_stopped_ends_its_processes(short, tmp_path):
    begun = []

    def stop(step):
        begun.extend(multiprocessing.active_children())
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_campaign(short.tasks[:1], CAR, LearningFolder(tmp_path), progress=stop, compute=slow)
    assert begun
    for process in begun:
        process.join(20.0)
        assert not process.is_alive()


@pytest.mark.skipif(MPIEXEC is None, reason="no MPI")
def test_runs_are_made_on_ranks_of_mpi(short, tmp_path):
    """One leads, two work; without ranks it is said how to start them."""
    pytest.importorskip("mpi4py")
    here = Path(__file__).parents[1]
    script = tmp_path / "script.py"
    script.write_text(RANKS.format(folder=str(tmp_path / "out")))
    paths = os.pathsep.join([str(here), str(here.parent), os.environ.get("PYTHONPATH", "")])
    command = [MPIEXEC, "-n", "3", sys.executable, "-m", "mpi4py.futures", str(script)]
    answer = subprocess.run(
        command, env=os.environ | OPEN_MPI | {"PYTHONPATH": paths}, capture_output=True, text=True, check=False,
        timeout=300,
    )  # fmt: skip
    assert answer.returncode == 0, answer.stderr
    broken = [task.name for task in short.tasks if "003" in task.name]
    assert answer.stdout.split() == [*broken, "made", "by", "2"]
    assert {f.stem for f in (tmp_path / "out" / "runs").glob("*.nc")} == {t.name for t in short.tasks} - set(broken)
    with pytest.raises(ValueError, match=r"mpiexec -n 4 python -m mpi4py\.futures"):
        run_campaign(short.tasks, CAR, LearningFolder(tmp_path / "alone"), mpi=True, compute=quick)


def test_networks_learn_and_the_card_says_what_they_are_worth(tmp_path):
    """Loads of 1.3 times the coefficient model's, of which waves know little: networks learn some of the rest."""
    plan = make_plan(CAR, WANTED, 0.055, 0.06, ENVELOPE, seeds=2, run_time=6.0)
    folder = LearningFolder(tmp_path)
    assert not run_campaign(plan.tasks, CAR, folder, jobs=2, compute=coefficient_flow)
    found = learn_from(plan, folder, jobs=2)
    figures = found.figures
    assert figures["load_error"] < 0.8 * figures["coefficients_load_error"] and figures["rests"]
    assert figures["runs"] >= 2 and figures["members"] == 2 and len(figures["drives"]) >= 1
    for one in figures["drives"]:
        assert one["end"] < 0.05 and one["coefficients_end"] < 0.05
        assert one["outside"] < 0.6  # in five drives not all is met that others do
    members = load_members(found.networks)
    assert card_of(members) == figures and card_of(members[:1]) is None

    page = found.card.read_text()
    images = re.findall(r'src="data:image/png;base64,([^"]+)"', page)
    assert len(images) == 4 and all(base64.b64decode(image).startswith(b"\x89PNG") for image in images)
    text = re.sub(r'src="data:image/png;base64,[^"]+"', "", page)  # pictures may hold any letters
    assert "http" not in text and 'src="' not in text  # needs no other file
    for text in ("Range covered", "Drives, beside the same", "drives longer than", "What these networks do not know",
                 "lane change", f"{figures['load_error']:.2f}", "captive_004",
                 "What the cells do not resolve"):  # fmt: skip
        assert text in page

    answer = CliRunner().invoke(
        app, ["drive", "--depth-ratio", "0.5", "--networks", str(found.networks), "--duration", "0.4", "--output",
              str(tmp_path / "run.nc")], env={"COLUMNS": "200", "TERM": "dumb"},
    )  # fmt: skip
    assert answer.exit_code == 0, answer.output
    trust = load_dataset(tmp_path / "run.nc").attrs["trust"]
    assert trust.startswith("networks") and f"off by {figures['load_error']:.2g} of their deviation" in trust


def test_what_is_wrong_in_a_folder_is_said_before_anything_is_computed(tmp_path, monkeypatch):
    """A file that is no run, and then a range of depths that is none."""

    def never(*_):
        raise AssertionError("drives for the envelope")

    monkeypatch.setattr("exumob.learning.envelope.envelope_of", never)
    folder = LearningFolder(tmp_path / "out")
    (folder.runs / "mine.nc").write_text("no run")
    for more, said in (((), "mine.nc cannot be read"), (("--depth", "0.5"), "--depth 0.5: write from:to")):
        answer = CliRunner().invoke(app, ["learn", "--output", str(folder.path), *more], env={"COLUMNS": "200"})
        assert answer.exit_code == 2 and said in answer.output and "Traceback" not in answer.output


def test_the_whole_with_the_flow(tmp_path, monkeypatch):
    """On cells that resolve nothing and for a second in all: it runs to its end, and again with nothing to do."""
    monkeypatch.setattr("exumob.learning.envelope.envelope_of", lambda vehicle, waters, progress=None: ENVELOPE)
    monkeypatch.setattr("exumob.learning.plan.LEAST_DRIVES", 1)  # each takes two seconds of spin-up
    arguments = ["learn", "--output", tmp_path / "out", "--budget", "0.002", "--cell-size", "0.08", "--run-time", "0.2",
                 "--seeds", "1", "--depth", "0.4:0.6", "--current", "0:0.5", "--directions", "ahead"]  # fmt: skip
    call = [str(argument) for argument in arguments]
    answer = CliRunner().invoke(app, call, env={"COLUMNS": "200", "TERM": "dumb"})
    assert answer.exit_code == 0, answer.output
    assert "lost: the gap between keel and bed" in answer.output and "card" in answer.output
    assert re.search(r"run 1 of (\d+), \w+: finished after .* \(planned: (?s:.*)run \1 of \1, ", answer.output)
    runs = load_runs((tmp_path / "out" / "runs").glob("captive*.nc"))
    assert all(float(np.abs(run["water_wrench"].values[:, 0, 2]).max()) > 1.0 for run in runs.values())
    page = (tmp_path / "out" / CARD).read_text()
    assert len(page) > 50_000
    assert "1 set of networks" in page and "spread alone" not in page and "The error bar of a load" in page
    again = CliRunner().invoke(app, call, env={"COLUMNS": "200", "TERM": "dumb"})
    assert again.exit_code == 0 and re.search(r"(\d+) of \1 runs are there already", again.output)
    other = CliRunner().invoke(app, [*call, "--cell-size", "0.07"], env={"COLUMNS": "200", "TERM": "dumb"})
    assert other.exit_code == 2 and "holds runs on cells of 0.08 m" in other.output
