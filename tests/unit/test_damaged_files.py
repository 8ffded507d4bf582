"""Files that are damaged, cut off, of another kind or of another program: refused by name, or read right."""

import json
import struct

import numpy as np
import pytest
import xarray as xr
from safetensors.numpy import save

from exumob import Soil, load_dataset, load_vehicle, save_dataset, simulate
from exumob.driving.maneuver import ConstantSteer
from exumob.learning.dataset import load_runs
from exumob.simulation.checkpoint import Fingerprint, read, write
from exumob.surrogates.model import shipped_networks
from exumob.surrogates.networks import NetworkSet

DAMAGES = 60


def damaged(data, generator):
    """A file cut off, with some bytes changed, or with some left out."""
    kind, n = generator.integers(3), len(data)
    place = int(generator.integers(n))
    if kind == 0:
        return data[:place]
    changed = bytearray(data)
    if kind == 1:
        for _ in range(int(generator.integers(1, 20))):
            changed[int(generator.integers(n))] ^= int(generator.integers(1, 256))
    else:
        del changed[place : place + int(generator.integers(1, 200))]
    return bytes(changed)


def refused_or_read(file, data, reader, name):
    """Try a file with many damages: each ends in a ValueError that names it, or in something read."""
    generator, refused = np.random.default_rng(1), 0
    for n in range(DAMAGES):
        file.write_bytes(damaged(data, generator))
        try:
            reader(file)
        except ValueError as error:
            assert name in str(error), f"damage {n}: {error}"
            assert any(word in str(error) for word in ("make", "move", "take", "Take", "train", "give")), error
            refused += 1
    return refused


# -- checkpoints -------------------------------------------------------------------------------------------------------

TREE = {"model": {"time": 1.0, "q": np.arange(500.0)}, "hydrodynamics": {"list": [1, "a", None]}, "coupling": {}}


def test_damaged_checkpoints(tmp_path):
    file = tmp_path / "run.npz"
    write(file, 3, TREE, Fingerprint({"vehicle": "a"}))
    data = file.read_bytes()
    assert read(file)[1]["model"]["q"] == pytest.approx(TREE["model"]["q"])
    assert refused_or_read(file, data, read, "checkpoint") > DAMAGES / 2


def head_of(**changes):
    good = {"step": 3, "fingerprint": {}, "elapsed": 0.0, "tree": {"dict": {}}}
    return {key: value for key, value in (good | changes).items() if value is not ...}


@pytest.mark.parametrize("head", [
    [], 3, None, {}, head_of(step="a"), head_of(step=None), head_of(fingerprint=3), head_of(tree=3), head_of(tree=...),
    head_of(tree={"array": "none"}), head_of(tree={}), head_of(elapsed="long"), head_of(),
    head_of(tree={"dict": {"model": {"plain": 1}}}),
])  # fmt: skip
def test_checkpoints_with_a_wrong_head(tmp_path, head):
    file = tmp_path / "run.npz"
    np.savez(file, contents=np.array(json.dumps(head)))
    with pytest.raises(ValueError, match=r"checkpoint .*run\.npz .*(move it away|another file)"):
        read(file)


def test_a_checkpoint_whose_parts_do_not_fit_the_run(tmp_path, vehicle, sand):
    file = tmp_path / "run.npz"

    def stop(time):
        raise KeyboardInterrupt

    arguments = {"maneuver": ConstantSteer(), "duration": 0.04, "checkpoint": file}
    with pytest.raises(KeyboardInterrupt):
        simulate(vehicle, sand, **arguments, progress=stop)
    step, tree = read(file)
    with np.load(file) as archive:
        fingerprint = Fingerprint(json.loads(str(archive["contents"]))["fingerprint"])
    for spoilt in (
        tree | {"model": {"time": 0.0}},
        tree | {"model": tree["model"] | {"coordinates": {"ODE2Coords": np.zeros(3)}}},
        tree | {"model": 3},
        tree | {"hydrodynamics": None, "coupling": 3, "model": tree["model"] | {"loads": np.zeros((7, 7))}},
    ):
        write(file, step, spoilt, fingerprint)
        with pytest.raises(ValueError, match=r"checkpoint .*run\.npz cannot be read.*move it away"):
            simulate(vehicle, sand, **arguments, resume=True)


# -- networks ----------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def networks():
    data = shipped_networks()[0].read_bytes()
    size = struct.unpack("<Q", data[:8])[0]
    header = json.loads(json.loads(data[8 : 8 + size])["__metadata__"]["exumob"])
    header.pop("digest", None)  # of what is not changed
    return data, header, NetworkSet.load(shipped_networks()[0]).arrays


def test_damaged_networks(tmp_path, networks):
    refused_or_read(tmp_path / "nets.safetensors", networks[0], NetworkSet.load, "nets.safetensors")
    assert refused_or_read(tmp_path / "nets.safetensors", networks[0][:2000], NetworkSet.load, "nets.safetensors") > 50


@pytest.mark.parametrize("change", [
    lambda h: [], lambda h: 3, lambda h: {}, lambda h: h | {"version": None}, lambda h: h | {"version": {}},
    lambda h: {k: v for k, v in h.items() if k != "version"}, lambda h: {k: v for k, v in h.items() if k != "about"},
    lambda h: h | {"about": []}, lambda h: h | {"about": h["about"] | {"geometry": None}},
    lambda h: h | {"about": h["about"] | {"geometry": {"hull.length": 1.0}}}, lambda h: h | {"architecture": None},
    lambda h: h | {"architecture": h["architecture"] | {"taps": "a"}},
    lambda h: h | {"architecture": h["architecture"] | {"inputs": 3}},
    lambda h: h | {"architecture": h["architecture"] | {"width": 10**9}},
    lambda h: h | {"architecture": h["architecture"] | {"layer": "gru"}},
])  # fmt: skip
def test_networks_with_a_wrong_header(tmp_path, networks, change):
    file = tmp_path / "nets.safetensors"
    file.write_bytes(save(networks[2], {"exumob": json.dumps(change(networks[1]))}))
    with pytest.raises(ValueError, match=r"nets\.safetensors"):
        NetworkSet.load(file)


@pytest.mark.parametrize("change", [
    lambda a: np.full_like(a, np.nan), lambda a: a[:4], lambda a: a.astype(np.int32), lambda a: a.T.copy(),
    lambda a: a.astype(bool), lambda a: np.zeros((0,), np.float32),
])  # fmt: skip
def test_networks_with_wrong_arrays(tmp_path, networks, change):
    file = tmp_path / "nets.safetensors"
    arrays = networks[2] | {"output_mean": change(networks[2]["output_mean"])}
    file.write_bytes(save(arrays, {"exumob": json.dumps(networks[1])}))
    with pytest.raises(ValueError, match=r"nets\.safetensors: output_mean is of shape"):
        NetworkSet.load(file)


# -- netCDF ------------------------------------------------------------------------------------------------------------


def test_damaged_results(tmp_path, short_run):
    file = tmp_path / "run.nc"
    save_dataset(short_run, file)
    assert refused_or_read(file, file.read_bytes(), load_dataset, "run.nc") > DAMAGES / 3


@pytest.mark.parametrize("content", [b"", b"a", b"\x89HDF\r\n\x1a\n" + bytes(200), b"CDF\x01" + bytes(20), bytes(5000)])
def test_files_that_are_no_results(tmp_path, content):
    file = tmp_path / "run.nc"
    file.write_bytes(content)
    with pytest.raises(ValueError, match=r"run\.nc cannot be read as netCDF"):
        load_dataset(file)
    with pytest.raises(ValueError, match=r"run\.nc cannot be read as netCDF"):
        load_runs([file])


def test_places_that_are_no_results(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"none\.nc does not exist"):
        load_dataset(tmp_path / "none.nc")
    with pytest.raises(ValueError, match="is a folder"):
        load_dataset(tmp_path)
    save_dataset(xr.Dataset({"a": ("x", [1.0])}), tmp_path / "other.nc")
    with pytest.raises(ValueError, match=r"other\.nc is not a run to learn from"):
        load_runs([tmp_path / "other.nc"])


# -- vehicle files -----------------------------------------------------------------------------------------------------

BASE = "from vehicle_models.amphibious import amphibious_vehicle as _base\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("d = {}\nd['x']\n", "line 2: KeyError: 'x'"),
        ("\n\n1/0\n", "line 3: ZeroDivisionError"),
        ("raise RuntimeError('no\\nroad')\n", "line 1: RuntimeError: no road"),
        ("import sys\nsys.exit(3)\n", "line 2: SystemExit: 3"),
        ("def car(:\n", "line 1: SyntaxError"),
        ("import no_such_module\n", "line 1: ModuleNotFoundError"),
        (BASE + "def car():\n    return _base().no_such\n", "line 3: AttributeError"),
        ("", "defines 0 public functions"),
        (BASE + "def car():\n    raise SystemExit\n", "line 3: SystemExit"),
        ("class Car:\n    pass\n", "defines 0 public functions"),
        (BASE + "def car(size):\n    return _base()\n", r"takes arguments \(size\)"),
        (BASE + "def car():\n    return 3\n", "returned int"),
        (BASE + "def car():\n    return _base()\ndef cart():\n    return _base()\n", "2 public functions: car, cart"),
        ("from vehicle_models.amphibious import amphibious_vehicle\n", "defines 0 public functions"),
        (b"\xff\xfe\x00a", "vehicle file"),
        (b"a = '\xe9'\n", "vehicle file"),
        (b"\x00\x01", "vehicle file"),
    ],
)
def test_vehicle_files_that_fail_say_where(tmp_path, text, message):
    file = tmp_path / "car.py"
    file.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(ValueError, match=message) as raised:
        load_vehicle(file)
    assert "car.py" in str(raised.value)


@pytest.mark.parametrize("text", [
    "from __future__ import annotations\nfrom dataclasses import dataclass\n" + BASE
    + "@dataclass\nclass Part:\n    size: float = 1.0\ndef car():\n    return _base()\n",
    "import functools\n" + BASE + "@functools.cache\ndef car():\n    return _base()\n",
    BASE + "def car(size=1.0, *more, **others):\n    return _base()\nsame = car\n",
    BASE + "def _helper(x):\n    return x\ndef car():\n    return _helper(_base())\n",
])  # fmt: skip
def test_vehicle_files_that_are_right(tmp_path, text, vehicle):
    (tmp_path / "car.py").write_text(text)
    assert load_vehicle(tmp_path / "car.py") == vehicle


def test_modules_beside_a_vehicle_file_are_its_own(tmp_path):
    """Two folders, each with a module of the same name; neither is left behind, and none shadows what is installed."""
    for folder, mass in (("one", 50.0), ("two", 51.0)):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "parts.py").write_text(f"MASS = {mass}\n")
        (tmp_path / folder / "json.py").write_text("raise RuntimeError('not this one')\n")
        (tmp_path / folder / "car.py").write_text(
            "import json\nfrom dataclasses import replace\nimport parts\n" + BASE
            + "def car():\n    return replace(_base(), hull=replace(_base().hull, mass=parts.MASS))\n"
        )  # fmt: skip
    masses = [load_vehicle(tmp_path / folder / "car.py").hull.mass for folder in ("one", "two", "one")]
    assert masses == [50.0, 51.0, 50.0]


def test_a_folder_and_another_kind_of_file_are_no_vehicle_files(tmp_path):
    with pytest.raises(ValueError, match="is a folder"):
        load_vehicle(tmp_path)
    (tmp_path / "car.txt").write_text("def car(): pass\n")
    with pytest.raises(ValueError, match=r"must end in \.py"):
        load_vehicle(tmp_path / "car.txt")


def test_soil_is_read_by_name_alone():
    with pytest.raises(ValueError, match=r"no soil is called '\[/red\]'"):
        Soil.published("[/red]")
