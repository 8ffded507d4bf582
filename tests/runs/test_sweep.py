"""Sweeps: every case ends with a status, none is lost, none is run twice, whatever is killed."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from exumob.__main__ import app
from exumob.simulation.result_files import load_dataset
from exumob.support.errors import SimulationError
from exumob.surrogates.ensemble import save_ensemble
from exumob.surrogates.model import SurrogateHydrodynamics
from exumob.sweeps import grid, sweep
from exumob.sweeps.case_store import StorageError
from exumob.sweeps.experiment import amphibious_lane_change
from exumob.vehicle.point_force import PointForce

HERE = Path(__file__).parent


def square(case):
    """Numbers by name."""
    return {"square": case["x"] ** 2}


def noted(case):
    """Leaves a mark for each time that it is run."""
    with (Path(case["folder"]) / f"ran_{case['x']}").open("a") as file:
        file.write("x")
    time.sleep(case.get("sleep", 0.0))
    return {"square": case["x"] ** 2}


def faulty(case):
    """Fails in every way that a case can."""
    how = case["how"]
    if how == "raise":
        raise KeyError("a hole in the road")
    if how == "refuse":
        raise ValueError("hull.mass = -1 must be > 0")
    if how == "break":
        raise SimulationError("Newton did not converge")
    if how == "hang":
        time.sleep(60.0)
    if how == "hang deaf":
        signal.signal(signal.SIGALRM, signal.SIG_IGN)
        time.sleep(60.0)
    if how == "die":
        os.kill(os.getpid(), signal.SIGKILL)
    if how == "exit":
        os._exit(0)
    if how == "abort":
        os.abort()
    return {"value": 1.0}


def filling(case):
    """From the fourth case on no file can grow: what a full disk does."""
    if case["x"] >= 3 and case["full"]:
        import resource

        resource.setrlimit(resource.RLIMIT_FSIZE, (0, resource.getrlimit(resource.RLIMIT_FSIZE)[1]))
    return {"square": case["x"] ** 2}


def wrong(case):
    """Returns what no row can hold."""
    return case["x"] * ["no numbers"]


def test_results_and_parameters_are_gathered(tmp_path):
    cases = grid({"x": [1, 2, 3], "name": ["a", "b"]})
    reports = []
    result = sweep(square, cases, tmp_path, progress=reports.append)
    assert list(result["square"].values) == [1, 1, 4, 4, 9, 9]
    assert list(result["x"].values) == [1, 1, 2, 2, 3, 3] and list(result["name"].values) == ["a", "b"] * 3
    assert set(result["status"].values) == {"completed"} and result.attrs["parameters"] == "x name"
    assert reports[0].done == 0 and reports[-1].done == reports[-1].total == 6
    with load_dataset(tmp_path / "sweep.nc") as kept:
        assert list(kept["square"].values) == list(result["square"].values)


def test_every_fault_becomes_a_row(tmp_path, monkeypatch):
    """The others are completed; dying cases are given up after the second time."""
    monkeypatch.setattr("exumob.sweeps.processes.GRACE", 1.0)
    hows = ["no", "raise", "refuse", "break", "hang", "hang deaf", "die", "abort", "no"]
    result = sweep(faulty, [{"how": how, "n": n} for n, how in enumerate(hows)], tmp_path, time_limit=1.5)
    status = dict(zip(hows, result["status"].values, strict=True))
    assert status == {
        "no": "completed", "raise": "failed", "refuse": "refused", "break": "broke down", "hang": "out of time",
        "hang deaf": "out of time", "die": "killed", "abort": "killed",
    }  # fmt: skip
    assert result["status"].values[0] == result["status"].values[-1] == "completed"
    reasons = dict(zip(hows, result["reason"].values, strict=True))
    assert "a hole in the road" in reasons["raise"] and "must be > 0" in reasons["refuse"]
    assert "Newton did not converge" in reasons["break"] and "2 times" in reasons["die"]
    assert np.isnan(result["value"].values[1]) and result["value"].values[0] == 1.0


@pytest.mark.parametrize("workers", [1, 2])
@pytest.mark.parametrize("hows", [["no", "die", "exit", "abort", "no"], ["die"]], ids=["several", "alone"])
def test_cases_that_end_their_process_become_rows(workers, hows, tmp_path):
    """Also the only case that is left, and where one runs after another."""
    result = sweep(faulty, [{"how": how, "n": n} for n, how in enumerate(hows)], tmp_path, workers=workers)
    assert list(result["status"].values) == ["completed" if how == "no" else "killed" for how in hows]


def tow(time, position, velocity):
    return 100.0 * time, 0.0, 0.0


@dataclass(frozen=True)
class Winch:
    strength: float

    def __call__(self, time, position, velocity):
        return self.strength * min(time, 0.2), 0.0, 0.0


def test_forces_are_swept(tmp_path):
    """A stronger winch pulls the vehicle further; the same call finds its cases again."""
    experiment = replace(
        amphibious_lane_change(), hydrodynamics="coefficients", duration=0.4,
        forces=[PointForce(Winch(0.0), (0.5, 0.0, 0.1)), PointForce(tow)],
    )  # fmt: skip
    cases = grid({"forces.0.force.strength": [0.0, 400.0]})
    reports = []
    for _ in range(2):
        result = sweep(experiment, cases, tmp_path / "winch", progress=reports.append)
        reached = result["forward"].values
        assert set(result["status"].values) == {"completed"} and reached[1] > reached[0] + 1e-3
    assert [report.kept for report in reports][-1] == 2 and "forces of your own 2" in result.attrs["trust"]
    whole = sweep(experiment, [{"forces": (PointForce(Winch(400.0), (0.5, 0.0, 0.1)), PointForce(tow))}],
                  tmp_path / "whole")  # fmt: skip
    assert whole["forward"].item() == reached[1]


def test_a_sweep_with_networks_of_ones_own(tmp_path):
    """At the command line: its members drive, what is known of them is said, and another file is another sweep."""
    shipped = SurrogateHydrodynamics().networks
    file = save_ensemble(shipped[:2], tmp_path / "mine.safetensors")
    arguments = ["sweep", "--networks", str(file), "--vary", "hydrodynamics.member=0,1", "--set", "duration=0.3",
                 "--workers", "1", "--output", str(tmp_path / "sweep")]  # fmt: skip
    answer = CliRunner().invoke(app, arguments, env={"COLUMNS": "200", "TERM": "dumb"})
    assert answer.exit_code == 0 and "trust" in answer.output, answer.output
    found = load_dataset(tmp_path / "sweep" / "sweep.nc")
    ends = found["forward"].values
    assert set(found["status"].values) == {"completed"} and 0.0 < abs(ends[0] - ends[1]) < 1e-2
    again = CliRunner().invoke(app, arguments, env={"COLUMNS": "200", "TERM": "dumb"})
    assert again.exit_code == 0 and "2 kept, 0 run" in " ".join(again.output.split())
    save_ensemble(shipped[2:4], file)
    other = CliRunner().invoke(app, arguments, env={"COLUMNS": "200", "TERM": "dumb"})
    assert other.exit_code == 2 and "ensemble was" in " ".join(other.output.split()), other.output


def test_done_cases_are_not_run_again(tmp_path):
    cases = [{"x": n, "folder": str(tmp_path)} for n in range(6)]
    sweep(noted, cases, tmp_path / "sweep")
    sweep(noted, cases, tmp_path / "sweep")
    assert all((tmp_path / f"ran_{n}").read_text() == "x" for n in range(6))
    sweep(noted, cases, tmp_path / "sweep", again=["completed"])
    assert all((tmp_path / f"ran_{n}").read_text() == "xx" for n in range(6))


def test_another_sweep_is_refused(tmp_path):
    sweep(square, [{"x": 1}], tmp_path)
    with pytest.raises(ValueError, match="holds another sweep"):
        sweep(square, [{"x": 2}], tmp_path)
    with pytest.raises(ValueError, match="holds another sweep"):
        sweep(noted, [{"x": 1}], tmp_path)


def test_a_function_that_cannot_be_given_away_is_named(tmp_path):
    with pytest.raises(ValueError, match="top level of a module"):
        sweep(lambda case: {}, [{"x": 1}], tmp_path)


@pytest.mark.skipif(sys.platform == "win32", reason="no such limit")
@pytest.mark.parametrize("workers", [1, 2])
def test_full_disk_ends_a_sweep_with_one_message(workers, tmp_path, capfd):
    """What had ended is kept, nothing half written stays, and the same call goes on when there is room."""
    cases = [{"x": n, "full": True} for n in range(8)]
    with pytest.raises(StorageError, match=r"json cannot be written \(File too large\); make room.*is kept in"):
        sweep(filling, cases, tmp_path / "sweep", workers=workers)
    assert capfd.readouterr().err == ""  # no traceback, of any process
    folder = tmp_path / "sweep"
    assert {int(file.stem) for file in (folder / "cases").glob("*.json")} >= {0, 1, 2}
    assert all(file.stat().st_size for file in folder.rglob("*") if file.is_file() and file.name != ".lock")
    assert not list(folder.rglob("*.partial")) and not list((folder / "begun").iterdir())


def test_results_that_are_none_become_rows(tmp_path):
    result = sweep(wrong, [{"x": 1}, {"x": 2}], tmp_path)
    assert list(result["status"].values) == ["failed"] * 2
    assert "it returned list" in str(result["reason"].values[0])


def test_torn_rows_are_run_again_and_copies_refused(tmp_path):
    cases = [{"x": n} for n in range(4)]
    first = sweep(square, cases, tmp_path)
    rows = tmp_path / "cases"
    (rows / "2.json").write_bytes((rows / "2.json").read_bytes()[:30])
    (rows / "3.json").write_bytes(b"")
    assert sweep(square, cases, tmp_path)["square"].equals(first["square"])
    (rows / "3.json").write_bytes((rows / "1.json").read_bytes())
    with pytest.raises(ValueError, match=r"3\.json is another case: x was 1, is 3"):
        sweep(square, cases, tmp_path)


def test_bad_names_are_found_before_anything_runs(tmp_path):
    with pytest.raises(ValueError, match=r"did you mean hull\.mass"):
        sweep(amphibious_lane_change(), [{"hull.mas": 1.0}], tmp_path)
    assert not (tmp_path / "cases").exists()


SCRIPT = """
import sys
from pathlib import Path
sys.path.insert(0, {here!r})
from test_sweep import noted
from exumob.sweeps import sweep
if __name__ == "__main__":
    marks = Path({marks!r})
    sweep(noted, [{{"x": n, "folder": str(marks), "sleep": 0.15}} for n in range(20)], marks / "sweep")
"""


def start(tmp_path):
    script = tmp_path / "script.py"
    script.write_text(SCRIPT.format(here=str(HERE), marks=str(tmp_path)))
    with (tmp_path / "errors").open("w") as errors:
        return subprocess.Popen([sys.executable, script], cwd=HERE, stderr=errors)


def wait_for(tmp_path, count, seconds=300.0):
    end = time.monotonic() + seconds
    while len(list((tmp_path / "sweep" / "cases").glob("[0-9]*.json"))) < count:
        assert time.monotonic() < end, "the sweep does not get on"
        time.sleep(0.02)


@pytest.mark.skipif(sys.platform == "win32", reason="signals")
def test_killed_sweep_goes_on_and_a_locked_one_waits(tmp_path):
    """kill -9 of the leader: its processes end with it, what had ended is kept and nothing of it is run again."""
    running = start(tmp_path)
    wait_for(tmp_path, 4)
    cases = [{"x": n, "folder": str(tmp_path), "sleep": 0.15} for n in range(20)]
    with pytest.raises(RuntimeError, match="another sweep is at work"):
        sweep(noted, cases, tmp_path / "sweep")
    running.kill()
    running.wait()
    time.sleep(1.5)
    ended = {int(file.stem) for file in (tmp_path / "sweep" / "cases").glob("[0-9]*.json")}
    assert 4 <= len(ended) < 20
    time.sleep(1.0)
    assert {int(file.stem) for file in (tmp_path / "sweep" / "cases").glob("[0-9]*.json")} == ended  # nobody is left
    result = sweep(noted, cases, tmp_path / "sweep")
    assert set(result["status"].values) == {"completed"}
    runs = {n: len((tmp_path / f"ran_{n}").read_text()) for n in range(20)}
    assert all(runs[n] == 1 for n in ended)
    assert sum(runs.values()) <= 20 + 2  # those in hand when it was killed begin anew


@pytest.mark.skipif(sys.platform == "win32", reason="signals")
def test_killed_worker_is_replaced(tmp_path):
    """kill -9 of a process that has a case in hand: the sweep ends by itself, every case completed."""
    running = start(tmp_path)
    wait_for(tmp_path, 4)
    for _ in range(200):
        begun = [json.loads(f.read_text()) for f in (tmp_path / "sweep" / "begun").glob("[0-9]*.json")]
        if begun:
            os.kill(begun[0]["pid"], signal.SIGKILL)
            break
        time.sleep(0.01)
    assert running.wait(300.0) == 0
    with load_dataset(tmp_path / "sweep" / "sweep.nc") as result:
        assert set(result["status"].values) == {"completed"} and result.sizes["case"] == 20
    assert sum(len((tmp_path / f"ran_{n}").read_text()) for n in range(20)) <= 20 + 3  # the lost one, two in hand
    if sys.platform == "linux":
        assert (tmp_path / "errors").read_text() == ""  # of semaphores left behind, for one


def test_lane_changes_by_command(tmp_path):
    """Three short lane changes, one of which sinks in: its row says so."""
    arguments = [
        "sweep", "--set", "duration=0.3", "--set", "hydrodynamics=coefficients", "--vary", "hull.mass=45,49,4000",
        "--output", tmp_path / "sweep[1]", "--keep-runs", "--unusual",
    ]  # fmt: skip

    def call():
        return subprocess.run(
            [sys.executable, "-m", "exumob", *map(str, arguments)],
            cwd=tmp_path, capture_output=True, text=True, check=False,
        )  # fmt: skip

    answer = call()
    assert answer.returncode == 1, answer.stderr
    assert "cases        3: 0 kept, 3 run" in answer.stdout
    assert "completed    2 of 3 cases" in answer.stdout and "broke down   1 of 3 cases" in answer.stdout
    assert "sweep of 3 cases, about 3 s" in answer.stderr and "sweep: 100 % (3 of 3 cases)" in answer.stderr
    assert "\ntrust        coefficients, " in answer.stdout and "hull.mass" in answer.stdout
    assert "broke down: case 2 (hull.mass = 4000" in answer.stderr
    assert f"result       {tmp_path / 'sweep[1]' / 'sweep.nc'}" in answer.stdout.replace("\n", "")
    with load_dataset(tmp_path / "sweep[1]" / "sweep.nc") as result:
        assert (result["forward"].values[:2] > 0.0).all() and len(set(result["forward"].values[:2])) == 2
        assert all("units" in v.attrs and "long_name" in v.attrs for v in result.variables.values())
        assert result["hull.mass"].attrs["units"] == "kg" and result["forward"].attrs["units"] == "m"
    assert (tmp_path / "sweep[1]" / "runs" / "0.nc").exists()
    again = call()
    assert again.returncode == 1 and "cases        3: 3 kept, 0 run" in again.stdout


MPIEXEC = shutil.which("mpiexec", path=Path(sys.executable).parent) or shutil.which("mpiexec")
"""Of the environment's own MPI, if it has one."""


@pytest.mark.skipif(MPIEXEC is None, reason="no MPI")
def test_three_ranks(tmp_path):
    """One leads, two work."""
    pytest.importorskip("mpi4py")
    script = tmp_path / "script.py"
    text = SCRIPT.format(here=str(HERE), marks=str(tmp_path)).replace('/ "sweep")', '/ "sweep", mpi=True)')
    script.write_text(text)
    settings = {
        "OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1", "OMPI_MCA_rmaps_base_oversubscribe": "1"
    }  # fmt: skip
    command = [MPIEXEC, "-n", "3", sys.executable, "-m", "mpi4py.futures", str(script)]
    answer = subprocess.run(
        command, env=os.environ | settings, capture_output=True, text=True, check=False, timeout=600, cwd=HERE
    )
    assert answer.returncode == 0, answer.stderr
    with load_dataset(tmp_path / "sweep" / "sweep.nc") as result:
        assert result.sizes["case"] == 20 and set(result["status"].values) == {"completed"}
    assert all((tmp_path / f"ran_{n}").read_text() == "x" for n in range(20))
