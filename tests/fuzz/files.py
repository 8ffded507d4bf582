"""Files that users give, whole, damaged and made up."""

from __future__ import annotations

import csv
import functools
import io
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from hypothesis import strategies as st

import exumob
from exumob.sweeps import study
from exumob.water.wetted_surface import hull_surface

from .examples import VEHICLES
from .outcome import Outcome, Silent, finite, outcome_of
from .targets import BEFORE_SWEEPS, Target, _numbers, in_empty_folder, verify_object

ROOT = Path(__file__).parents[2]


class Content(NamedTuple):
    """What a file holds, and how it came about."""

    data: bytes
    story: str

    def __repr__(self) -> str:
        return f"{self.story}: {self.data[:200]!r}{'...' if len(self.data) > 200 else ''}"


class Folder(NamedTuple):
    """Files of a folder, and what was done to one of them."""

    files: dict[str, bytes]
    name: str
    story: str

    def __repr__(self) -> str:
        return f"{self.name} {self.story}: {self.files.get(self.name, b'')[:300]!r}"


def damaged(whole: Callable[[], bytes]) -> st.SearchStrategy[Content]:
    """A file that was cut off, overwritten, doubled, or is another one."""

    @st.composite
    def build(draw: Any) -> Content:
        data = bytearray(whole())
        way = draw(st.sampled_from(["whole", "cut", "flip", "flip", "front", "insert", "remove", "double", "other"]))
        place = draw(st.integers(0, len(data) - 1))
        if way == "cut":
            del data[place:]
        elif way == "front":
            del data[:place]
        elif way == "flip":
            for at in draw(st.lists(st.integers(0, min(len(data), 4000) - 1), min_size=1, max_size=8)):
                data[at] = draw(st.integers(0, 255))
        elif way == "insert":
            data[place:place] = draw(st.binary(max_size=20))
        elif way == "remove":
            del data[place : place + draw(st.integers(1, 200))]
        elif way == "double":
            data = data * 2
        elif way == "other":
            data = bytearray(draw(st.sampled_from(OTHER_FILES)))
        return Content(bytes(data), f"{way}, {place}")

    return build()


OTHER_FILES = [
    b"", b"\0", b"\n", b"{}", b"[]", b"null", b"a,b\n1,2\n", b"\xff\xfe\x00", b"\x89HDF\r\n\x1a\n", b"PK\x03\x04",
    b"CDF\x01",
    b"time [s]\n", "käse;1\n".encode("latin-1"), b"\x00" * 100, b"x" * 10_000, b"1e999\n", b"\xef\xbb\xbf",
]  # fmt: skip
"""Contents of quite other files"""


def damaged_text(whole: Callable[[], str], pieces: list[str]) -> st.SearchStrategy[Content]:
    """A text some of whose words are replaced by others, or lines left out or doubled; or a damaged file."""

    @st.composite
    def build(draw: Any) -> Content:
        lines = whole().splitlines()
        story = ""
        for _ in range(draw(st.integers(1, 3))):
            n = draw(st.integers(0, len(lines) - 1))
            way = draw(st.sampled_from(["word", "word", "word", "line", "drop", "twice"]))
            if way == "word":
                words = lines[n].split(" ")
                words[draw(st.integers(0, len(words) - 1))] = draw(st.sampled_from(pieces))
                lines[n] = " ".join(words)
            elif way == "line":
                lines.insert(n, draw(st.sampled_from(pieces)))
            elif way == "drop":
                del lines[n]
            else:
                lines.insert(n, lines[n])
            story += f"{way} in line {n + 1}: {lines[n][:60] if n < len(lines) else ''!r}; "
            lines = lines or [""]
        return Content("\n".join(lines).encode("utf-8", "surrogatepass"), story)

    return st.one_of(build(), build(), damaged(lambda: whole().encode()))


def file_target(
    name: str, file: str, contents: st.SearchStrategy[Content], load: Callable[[Path], Any], *,
    also: tuple[str, ...] = (), verify: Callable[[Any], None] | None = None, around: Any = None,
    time_limit: float = 20.0,
) -> Target:  # fmt: skip
    """A function that reads a file."""

    def answer(content: Content) -> Outcome:
        with in_empty_folder() as folder:
            path = folder / file
            path.write_bytes(content.data)
            if around is None:
                return outcome_of(lambda: load(path), [file, *also], verify=verify, time_limit=time_limit)
            with around():
                return outcome_of(lambda: load(path), [file, *also], verify=verify, time_limit=time_limit)

    return Target(name, contents, answer, group="files")


# -- the files ---------------------------------------------------------------------------------------------------------

EXPRESSIONS = [
    "1/0", "raise KeyError('x')", "raise RuntimeError", "raise SystemExit(3)", "import nothing_of_this_name", "0.0",
    "-1.0", "'a'",
    "None", "float('nan')", "10**400", "[1]", "Hull(", ")", "}", "def f(a): return 3", "def f(): return 3",
    "x = lambda: 3",
    "class A: pass", "return", "    ", "\t", "\x00", "äöü = 3", "mass=1e9,", "width=0.8e3,", "assert False",
    "del Vehicle",
    "exit()", "length=1000.0,", "\ud800", "from __future__ import annotations", "unknown=3,", "while False: pass",
    "[/red]",
]  # fmt: skip
VALUES = [
    "3", "-1", "1e999", "nan", "true", "'a'", '""', "[]", "{}", "[3]", "[0.5, 1.0]", "{ from = 0, to = 1, number = 3 }",
    "{ from = 0, to = 1, number = 1e10 }", "{ normal = [1.0] }", "{ normal = [1300.0, 200.0] }", "{ uniform = [2, 1] }",
    "base = 3", "sample = []", "vary = 'x'", "correlations = 3", "soil = [3]", "maneuver = 'straight'", "[sample]",
    "[other]",
    "maneuver.speed = 4.0", "number = 10", "number = -1", "seed = 'x'", "method = 'none'", "water = 3",
    "water.depth = 1979-05-27",
    "hull.mass = 1e400", "=", "[", "\x00", "äöü", "vehicle = 'none.py'", "vehicle = 3", "hydrodynamics.member = 99",
    "setting = 'x'",
]  # fmt: skip
STUDY = "\n".join(
    line.split("#")[0].rstrip() for line in str(study.__doc__).splitlines()[2:] if not line.startswith("vehicle")
)
"""The study file that its reader shows, on the paper's vehicle"""


def vehicle_source() -> str:
    """The paper's vehicle file without its comments."""
    lines = (ROOT / "vehicle_models" / "amphibious.py").read_text().splitlines()
    return "\n".join(line.split("  #")[0] for line in lines)


@functools.cache
def result_file() -> bytes:
    """A small netCDF file."""
    with tempfile.TemporaryDirectory() as folder:
        file = exumob.save_dataset(exumob_dataset(), Path(folder) / "run.nc")
        return file.read_bytes()


def exumob_dataset() -> Any:
    """A Dataset such as a run gives, in small."""
    import xarray as xr

    return xr.Dataset({"a": ("time", np.arange(5.0), {"units": "m"})}, {"time": np.arange(5.0)}, {"title": "x"})


@functools.cache
def networks_file() -> bytes:
    """Networks of few weights."""
    from made_up_networks import SMALL, made_up

    with tempfile.TemporaryDirectory() as folder:
        return made_up(SMALL, VEHICLES[0]()).save(Path(folder) / "small.safetensors").read_bytes()


@functools.cache
def histories_file() -> str:
    """Motion of a vehicle that moves straight on, and loads on it, as another program writes them."""
    n = 41
    time = np.linspace(0.0, 0.2, n)
    columns = {"time [s]": time}
    places = {"hull": (0.0, 0.0), "front_left": (0.357, 0.33), "front_right": (0.357, -0.33), "rear_left": (-0.357,
    0.33),
              "rear_right": (-0.357, -0.33)}  # fmt: skip
    for body, (x, y) in places.items():
        columns |= {
            f"{body}_x [m]": x + 0.5 * time, f"{body}_y [m]": np.full(n, y), f"{body}_z [m]": np.full(n, 0.15),
            f"{body}_roll [deg]": np.zeros(n), f"{body}_pitch [deg]": np.zeros(n), f"{body}_yaw [deg]": np.zeros(n),
        }  # fmt: skip
        columns |= {f"{body}_{k} [{'N' if k[0] == 'F' else 'N m'}]": 10.0 + np.sin(9.0 * time + len(k)) for k in LOADS}
    stream = io.StringIO()
    writer = csv.writer(stream)
    writer.writerow(columns)
    writer.writerows(np.stack(list(columns.values()), axis=1).tolist())
    return stream.getvalue()


LOADS = ("Fx", "Fy", "Fz", "Mx", "My", "Mz")


@functools.cache
def mesh_file() -> bytes:
    """A watertight box as STL."""
    import trimesh

    box = trimesh.creation.box((1.0, 0.44, 0.2))
    box.apply_translation((0.0, 0.0, 0.178))
    return bytes(box.export(file_type="stl"))


def _wetted_hull(path: Path) -> Any:
    vehicle = VEHICLES[0]()
    return hull_surface(replace(vehicle, hull=replace(vehicle.hull, mesh=path)))


def _verify_surface(surface: Any) -> None:
    finite("the hull's surface", surface.triangles)


def _verify_run(run: Any) -> None:
    for name, variable in run.data_vars.items():
        if variable.dtype.kind == "f" and not np.isfinite(variable.values).all():
            raise Silent(f"{name} is not finite")


def section_file() -> str:
    """A small cross-section."""
    rows = "\n".join(f"{2 * n} , {abs(n - 3) - 2} , 0.1" for n in range(7))
    return f"station [m] , bed [m] , current [m/s]\n{rows}\n"


@functools.cache
def river_file() -> bytes:
    """A small river from another program."""
    import xarray as xr

    values = np.ones((3, 4))
    fields = {"BOTTOM": 0.1 * values, "FREE SURFACE": values, "VELOCITY U": values, "VELOCITY V": values}
    data = xr.Dataset({name: (("y", "x"), v) for name, v in fields.items()}, {"x": np.arange(4.0), "y": np.arange(3.0)})
    with tempfile.TemporaryDirectory() as folder:
        file = exumob.save_dataset(data, Path(folder) / "river.nc")
        return file.read_bytes()


def _load_networks(path: Path) -> Any:
    from exumob.surrogates.networks import NetworkSet

    return NetworkSet.load(path)


def _import(path: Path) -> Any:
    from exumob.learning.importing import import_histories

    return import_histories(path, exumob.Water(0.12, 1.0))


def _read_study(path: Path) -> Any:
    from exumob.sweeps.study import read_study

    return read_study(path)


def _verify_study(found: Any) -> None:
    experiment, cases = found
    if len(cases) > 100_000:
        raise Silent(f"{len(cases)} cases")
    verify_object(experiment.vehicle)
    verify_object(experiment.soil)


# -- folders of sweeps -------------------------------------------------------------------------------------------------

SWEPT = [{"a": float(n)} for n in range(4)]


@functools.cache
def sweep_folder() -> dict[str, bytes]:
    """Files of a finished sweep."""
    from exumob.sweeps.run import sweep

    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder) / "sweep"
        sweep(_numbers, SWEPT, place, workers=1)
        return {str(f.relative_to(place)): f.read_bytes() for f in sorted(place.rglob("*")) if f.is_file()}


@st.composite
def damaged_sweeps(draw: Any) -> Folder:
    """A sweep's folder one file of which is missing, damaged, or in another's place."""
    files = dict(sweep_folder())
    name = draw(st.sampled_from(sorted(files)))
    way = draw(st.sampled_from(["missing", "damaged", "damaged", "copied", "more"]))
    if way == "missing":
        del files[name]
    elif way == "damaged":
        files[name] = draw(damaged(lambda: files[name] or b"{}")).data
    elif way == "copied":
        files[draw(st.sampled_from(sorted(files)))] = files[name]
    else:
        files["cases/" + draw(st.sampled_from(["notes.json", "99.json", "x", "0.json.partial", "-1.json"]))] = b"{}"
    return Folder(files, name, way)


def _answer_of_sweep(given: Folder) -> Outcome:
    from exumob.sweeps.run import sweep

    files, name, _ = given
    with in_empty_folder() as folder, BEFORE_SWEEPS():
        for file, content in files.items():
            path = folder / "sweep" / file
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)

        def verify(rows: Any) -> None:
            if rows["a"].values.tolist() != [case["a"] for case in SWEPT]:
                raise Silent(f"rows of other cases: {rows['a'].values}")
            done = rows["number"].values[rows["status"].values == "completed"] if "number" in rows else np.ones(0)
            if not (done == 1.0).all():
                raise Silent(f"other results: {done}")

        return outcome_of(
            lambda: sweep(_numbers, SWEPT, folder / "sweep", workers=1), [name, Path(name).name, "sweep"], verify=verify
        )


# -- checkpoints -------------------------------------------------------------------------------------------------------

SHORT = {"duration": 0.04, "hydrodynamics": "none"}


@functools.cache
def checkpoint_file() -> bytes:
    """The checkpoint of a run of two steps."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "run.npz"
        exumob.simulate(VEHICLES[0](), exumob.Soil.published("LETE sand"), checkpoint=file, **SHORT)
        return file.read_bytes()


def _resume(path: Path) -> Any:
    return exumob.simulate(VEHICLES[0](), exumob.Soil.published("LETE sand"), checkpoint=path, resume=True, **SHORT)


def file_targets() -> list[Target]:
    """Every kind of file that the package reads."""
    return [
        file_target("vehicle file", "mine.py", damaged_text(vehicle_source, EXPRESSIONS), exumob.load_vehicle,
                    also=("vehicle file", "Hull", "Wheel", "Suspension", "Steering", "Vehicle"), verify=verify_object),
        file_target("result file", "run.nc", damaged(result_file), exumob.load_dataset),
        file_target("study file", "study.toml", damaged_text(lambda: STUDY, VALUES), _read_study, verify=_verify_study,
                    also=("study file",)),
        file_target("cross-section", "ford.csv", damaged_text(section_file, ["nan", "", ",", "1e30", "-5",
        "[mm]", "ä"]),
                    exumob.CrossSection.read),
        file_target("river file", "river.nc", damaged(river_file), exumob.read_river),
        file_target("networks file", "small.safetensors", damaged(networks_file), _load_networks),
        file_target("histories, CSV", "run.csv", damaged_text(histories_file, ["nan", "", ",", "1e30", "'", "time",
        "[mm]", "ä"]),
                    _import, verify=_verify_run),
        file_target("histories, netCDF", "run.nc", damaged(result_file), _import, verify=_verify_run),
        file_target("mesh file", "hull.stl", damaged(mesh_file), _wetted_hull, also=("Hull.mesh",),
        verify=_verify_surface),
        file_target("checkpoint", "run.npz", damaged(checkpoint_file), _resume, verify=None, also=("checkpoint",)),
        Target("folder of a sweep", damaged_sweeps(), _answer_of_sweep, group="files"),
    ]  # fmt: skip
