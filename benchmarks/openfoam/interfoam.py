"""Running interFoam and reading what it wrote."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import time
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from case_files import case_files, profile_points, write_case
from situations import Situation

DEBIAN_FOLDER = Path("/usr/share/openfoam")
"""Folder in which Debian's package keeps etc/."""
PROGRAMS = "blockMesh topoSet subsetMesh setFields checkMesh decomposePar interFoam".split()


class OpenFoamError(RuntimeError):
    """A program of OpenFOAM failed; the message names its log."""


@dataclass(frozen=True)
class Run:
    """Result of a run, of either solver.

    Parameters
    ----------
    time : array, shape (n,)
        [s]
    force, viscous : array, shape (n, 3)
        All of it, and the wall shear's part [N].
    moment : array, shape (n, 3)
        About the body's centre [N m].
    profile_x, profile : array, shape (m,) and (p, m)
        Along the flow [m]; height of the surface above the bed [m].
    profile_time : array, shape (p,)
        [s]
    cells, steps : int
    wall, cpu : float
        Per step [s]; cpu is that of one process.
    """

    time: np.ndarray
    force: np.ndarray
    viscous: np.ndarray
    moment: np.ndarray
    profile_x: np.ndarray
    profile: np.ndarray
    profile_time: np.ndarray
    cells: int
    steps: int
    wall: float
    cpu: float
    iterations: float = float("nan")
    """Pressure iterations a step"""


def missing() -> str:
    """Why OpenFOAM cannot be used; empty if it can."""
    absent = [name for name in PROGRAMS if shutil.which(name) is None]
    if absent:
        return f"OpenFOAM is not installed ({', '.join(absent)} not found); on Debian: apt-get install openfoam."
    folder = environment()["WM_PROJECT_DIR"]
    if not (Path(folder) / "etc" / "controlDict").exists():
        return f"OpenFOAM's etc/controlDict is not in {folder}; set WM_PROJECT_DIR to the folder that holds etc/."
    return ""


def environment() -> dict[str, str]:
    """Return the environment of the programs: WM_PROJECT_DIR names the folder with etc/, mpirun may run as root."""
    result = dict(os.environ)
    result.setdefault("WM_PROJECT_DIR", str(DEBIAN_FOLDER))
    result.update(OMPI_ALLOW_RUN_AS_ROOT="1", OMPI_ALLOW_RUN_AS_ROOT_CONFIRM="1")
    return result


def call(folder: Path, log: str, *command: str) -> list[float]:
    """Run a program with its output in a log (appended); the clock at each time step that it announces [s]."""
    stamps = []
    with (folder / log).open("a") as file:
        process = subprocess.Popen(
            command, cwd=folder, env={**environment(), "PWD": str(folder)}, text=True,
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        )  # fmt: skip
        assert process.stdout is not None
        for line in process.stdout:
            if line.startswith("Time = "):
                stamps.append(time.perf_counter())
            file.write(line)
        if process.wait() != 0:
            raise OpenFoamError(f"{command[0]} failed with code {process.returncode}; see {folder / log}.")
    return stamps


def make_mesh(folder: Path) -> None:
    """Grid, body and initial fields."""
    call(folder, "log.mesh", "blockMesh")
    call(folder, "log.mesh", "topoSet")
    call(folder, "log.mesh", "subsetMesh", "water", "-patch", "body", "-overwrite")
    call(folder, "log.checkMesh", "checkMesh", "-constant")
    call(folder, "log.mesh", "setFields")


def run(
    situation: Situation, turbulence: str, ranks: int, work: Path, *, steps: int | None = None, skip: int = 0
) -> Run:
    """Compute a situation in a folder of its own below `work`; what is there is kept, and gone on with.

    Parameters
    ----------
    situation : Situation
    turbulence : str
        See `case_files.TURBULENCE`.
    ranks : int
        Processes.
    work : Path
    steps, skip : int
        Steps of a run for the cost alone, and how many of the first do not count. It is always computed anew.
    """
    name = f"{situation.name}-{round(1e4 * situation.cell_size)}-{turbulence}" + ("-cost" if steps else "")
    folder = work / name
    files = case_files(situation, turbulence, ranks, situation.duration, steps=steps)
    asked = {**asdict(situation), "turbulence": turbulence}
    del asked["duration"], asked["settled"], asked["about"]
    asked = json.loads(json.dumps(asked))
    settings = folder / "case.json"
    if folder.exists() and (steps or not settings.exists() or json.loads(settings.read_text()) != asked):
        shutil.rmtree(folder)
    if not settings.exists():
        write_case(folder, files)
        make_mesh(folder)
        settings.write_text(json.dumps(asked, indent=1))
    log = folder / "log.interFoam"
    stamps: list[float] = []
    if latest_time(folder) < situation.duration - 1e-6 if steps is None else True:
        stamps = solve(folder, files, ranks)
    cells = parse_cells((folder / "log.checkMesh").read_text())
    count, wall, cpu, iterations = parse_log(log.read_text(), skip)
    if steps:
        wall = (stamps[-1] - stamps[skip]) / (len(stamps) - 1 - skip)
    return Run(*read_forces(folder), *read_profile(folder, situation), cells, count, wall, cpu, iterations)


def latest_time(folder: Path) -> float:
    """Saved last [s]; 0 if none."""
    names = [p.name for p in (*folder.glob("processor0/*"), *folder.glob("*"))]
    return max((float(name) for name in names if re.fullmatch(r"[\d.]+", name)), default=0.0)


def solve(folder: Path, files: dict[str, str], ranks: int) -> list[float]:
    """Start interFoam, or go on from the time saved last, with as many processes as it began with."""
    write_case(folder, {k: v for k, v in files.items() if k.startswith("system/")})
    began = len(list(folder.glob("processor[0-9]*")))
    if began == 0 and latest_time(folder) == 0.0 and ranks > 1:
        call(folder, "log.mesh", "decomposePar")
        began = ranks
    if began:
        return call(folder, "log.interFoam", "mpirun", "-np", str(began), "interFoam", "-parallel")
    return call(folder, "log.interFoam", "interFoam")


# -- reading ----------------------------------------------------------------------------------------------------------


def parse_cells(text: str) -> int:
    """Number of cells, from checkMesh."""
    found = re.search(r"^\s*cells:\s+(\d+)", text, re.MULTILINE)
    if found is None:
        raise OpenFoamError("checkMesh names no number of cells.")
    return int(found.group(1))


def parse_log(text: str, skip: int = 0) -> tuple[int, float, float, float]:
    """Steps, wall and processor time per step [s], pressure iterations per step; `skip` steps do not count.

    Both clocks start anew when a run is continued: only what passes from one step to the next is summed up. The wall
    clock is in whole seconds, too coarse for a short run.
    """
    clock = [(float(a), float(b)) for a, b in re.findall(r"ExecutionTime = ([\d.]+) s\s+ClockTime = ([\d.]+) s", text)]
    solved = [int(n) for n in re.findall(r"Solving for p_rgh,.*No Iterations (\d+)", text)]
    steps = len(clock)
    if steps < skip + 2:
        return steps, float("nan"), float("nan"), float("nan")
    passed = np.diff(np.array(clock[skip:]), axis=0)
    passed = passed[passed[:, 0] >= 0.0]
    cpu, wall = passed.mean(axis=0)
    return steps, float(wall), float(cpu), sum(solved) / steps


def parse_table(text: str) -> np.ndarray:
    """Numbers of a file of a function object; brackets and lines with # are passed over."""
    rows = [line.replace("(", " ").replace(")", " ").split() for line in text.splitlines() if not line.startswith("#")]
    width = max((len(r) for r in rows), default=0)
    return np.array([[float(v) for v in r] for r in rows if len(r) == width and r], dtype=float).reshape(-1, width)


def joined(folder: Path, record: str, file: str) -> np.ndarray:
    """A record from all starts of a run; where they overlap, the later start counts."""
    found = sorted((folder / "postProcessing" / record).glob(f"*/{file}"), key=lambda p: float(p.parent.name))
    tables: list[np.ndarray] = []
    for path in found:
        table = parse_table(path.read_text())
        if not len(table):
            continue
        tables = [t[t[:, 0] < table[0, 0] - 1e-9] for t in tables]
        tables.append(table)
    return np.concatenate(tables) if tables else np.zeros((0, 0))


def read_forces(folder: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Time, force, its viscous part, moment."""
    force, moment = joined(folder, "forces", "force.dat"), joined(folder, "forces", "moment.dat")
    if force.shape[1] < 10 or len(force) != len(moment):
        raise OpenFoamError(f"the records of the forces in {folder} are incomplete; delete the folder and start anew.")
    return force[:, 0], force[:, 1:4], force[:, 7:10], moment[:, 1:4]


def read_profile(folder: Path, situation: Situation) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Places along the flow, heights above the bed, times; empty if not recorded."""
    table, points = joined(folder, "profile", "alpha.water"), profile_points(situation)
    if not len(table):
        return np.zeros(0), np.zeros((0, 0)), np.zeros(0)
    fraction = table[:, 1:].reshape(-1, *points.shape[:2])
    return points[:, 0, 0], fraction @ np.diff(situation.faces()[2]), table[:, 0]
