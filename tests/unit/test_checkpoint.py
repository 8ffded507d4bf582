"""Checkpoint files: what was written comes back, and whatever is damaged or of another kind is refused by name."""

import functools
import json
import logging
import zipfile
from dataclasses import dataclass

import numpy as np
import pytest
from damage import damage

from exumob.coupling.explicit import Explicit
from exumob.driving.maneuver import ConstantSteer
from exumob.ground.soil import Soil
from exumob.ground.terrain import Terrain
from exumob.simulation import checkpoint
from exumob.simulation.checkpoint import HEAD, Checkpoints, Fingerprint, read, write
from exumob.simulation.description import RunDescription, Steps
from exumob.support.provenance import parameters_json
from exumob.vehicle.point_force import PointForce
from exumob.water.hydrodynamics import NoWater
from vehicle_models.amphibious import amphibious_vehicle

FINGERPRINT = Fingerprint({"vehicle": "a", "program": "b"})
TREE = {
    "model": {"time": 0.5, "state": np.linspace(0.0, 1.0, 200), "names": ["a", None, True], "empty": np.zeros((0, 3))},
    "hydrodynamics": {"flow": {"count": 3, "flags": np.array([True, False])}},
    "coupling": {"7": [1, 2.5, [np.float64(3.0)]]},
}  # fmt: skip


@pytest.fixture
def file(tmp_path):
    write(tmp_path / "run.npz", 7, TREE, FINGERPRINT, 1.5)
    return tmp_path / "run.npz"


def same(one, other):
    if isinstance(one, dict):
        return set(one) == set(other) and all(same(one[k], other[k]) for k in one)
    if isinstance(one, list):
        return len(one) == len(other) and all(map(same, one, other))
    return np.array_equal(one, other) and np.asarray(one).dtype == np.asarray(other).dtype


def opened(file):
    """As `simulate` reads it before anything runs."""
    return Checkpoints(file, FINGERPRINT, resume=True)


def test_what_was_written_comes_back(file):
    steps, tree = read(file)
    assert steps == 7 and same(tree, TREE)
    store = opened(file)
    assert (store.elapsed, store.released, store.spin_up) == (1.5, True, None)


@pytest.mark.parametrize("seed", range(80))
def test_a_damaged_file_is_the_right_one_or_refused(file, seed):
    """Cut off, bits turned over, pieces left out: at places drawn at random, and at both ends."""
    damage(file, seed, (0, -1, 30, -22))
    try:
        opened(file)
        steps, tree = read(file)
    except ValueError as error:
        assert str(file) in str(error) and ("begin anew" in str(error) or "give another file" in str(error))
    else:
        assert steps == 7 and same(tree, TREE)


def changed(file, change):
    """The file with another head or other arrays, whole as an archive."""
    with np.load(file) as archive:
        arrays = {name: archive[name] for name in archive.files}
    head = json.loads(str(arrays.pop(HEAD)))
    head = change(head, arrays) or head
    np.savez(file, **{HEAD: np.array(head if isinstance(head, str) else json.dumps(head))}, **arrays)


@pytest.mark.parametrize(
    "change",
    [
        lambda head, arrays: head.pop("step"),
        lambda head, arrays: head.pop("tree") and None,
        lambda head, arrays: head.pop("fingerprint") and None,
        lambda head, arrays: head.update(fingerprint=["vehicle"]),
        lambda head, arrays: head.update(step="7"),
        lambda head, arrays: head.update(step=8),
        lambda head, arrays: head.update(elapsed=None),
        lambda head, arrays: head["tree"].update(array="none"),
        lambda head, arrays: head["tree"]["dict"].pop("model") and None,
        lambda head, arrays: arrays.pop("/model/state") is None,
        lambda head, arrays: arrays.update({"/model/state": np.zeros(3)}),
        lambda head, arrays: arrays.update({"/model/state": TREE["model"]["state"].astype(np.float32)}),
        lambda head, arrays: arrays.update({"/model/state": np.array(["a"] * 200)}),
        lambda head, arrays: arrays.update(more=np.zeros(3)),
        lambda head, arrays: "[1, 2]",
        lambda head, arrays: "null",
        lambda head, arrays: "{",
    ],
)
def test_another_content_is_refused(file, change):
    changed(file, change)
    with pytest.raises(ValueError, match=r"run\.npz .*begin anew"):
        opened(file)


def test_other_parts_are_refused(file):
    write(file, 7, {"model": TREE["model"]}, FINGERPRINT)
    with pytest.raises(ValueError, match="it holds model instead of coupling, hydrodynamics, model"):
        opened(file)
    write(file, -1, {}, FINGERPRINT)
    with pytest.raises(ValueError, match="it holds nothing instead of spin_up"):
        opened(file)


@pytest.mark.parametrize(
    "content", [b"", b"\0", b"{}", b"PK\x03\x04", b"PK\x05\x06" + 18 * b"\0", b"\x93NUMPY", 900 * b"x"]
)
def test_other_files_are_refused(tmp_path, content):
    (tmp_path / "run.npz").write_bytes(content)
    with pytest.raises(ValueError, match=r"run\.npz .*(cannot be read|is not one of exumob)"):
        opened(tmp_path / "run.npz")


def test_archives_of_others_are_refused(tmp_path):
    file = tmp_path / "run.npz"
    np.savez(file, a=np.zeros(3))
    with pytest.raises(ValueError, match="is not one of exumob; give another file"):
        opened(file)
    with file.open("wb") as stream:
        np.save(stream, np.zeros(3))
    with pytest.raises(ValueError, match="it is no numpy archive"):
        opened(file)
    np.savez(file, **{HEAD: np.array([{"step": 1}], dtype=object)})
    with pytest.raises(ValueError, match=r"run\.npz cannot be read .*holds Python objects") as error:
        opened(file)
    assert "allow_pickle" not in str(error.value)  # numpy's hint would run what the file holds
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:  # a small file of a large content
        archive.writestr(f"{HEAD}.npy", bytes(10_000_000))
    with pytest.raises(ValueError, match="it is compressed"):
        opened(file)


def test_a_folder_that_cannot_be_written_is_noticed_first(tmp_path, monkeypatch):
    def full(number):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(ValueError, match=r"checkpoint .*run\.npz cannot be written: No space left on device; give"):
        Checkpoints(tmp_path / "run.npz", FINGERPRINT, resume=False)
    (tmp_path / "folder.npz").mkdir()
    with pytest.raises(ValueError, match="this is a folder; give a file name"):
        Checkpoints(tmp_path / "folder.npz", FINGERPRINT, resume=True)


def test_a_full_disk_during_the_run_is_lived_through(file, monkeypatch, caplog):
    store, whole = opened(file), file.read_bytes()
    real = checkpoint.write

    def full(*_):
        raise OSError(28, "No space left on device")

    with caplog.at_level(logging.WARNING):
        monkeypatch.setattr(checkpoint, "write", full)
        assert [store._keep(8, TREE, "at 1 s"), store._keep(9, TREE, "at 1.5 s")] == [False, False]
        monkeypatch.setattr(checkpoint, "write", real)
        assert store._keep(10, TREE, "at 2 s")
    assert len(caplog.messages) == 2
    assert "could not be written at 1 s (No space left on device); the run goes on" in caplog.messages[0]
    assert "could be written again at 2 s" in caplog.messages[1]
    assert read(file)[0] == 10 and len(whole) > 0


# -- forces of the user's own ------------------------------------------------------------------------------------------


def pull(time, position, velocity, stiffness=100.0):
    return -stiffness * position


def push(time, position, velocity):
    return 100.0 * position


def rope(stiffness):
    return lambda time, position, velocity: -stiffness * position


@dataclass(frozen=True)
class Winch:
    strength: float

    def __call__(self, time, position, velocity):
        return self.strength, 0.0, 0.0


def fingerprint(*forces, **options):
    run = RunDescription(
        amphibious_vehicle(), Soil.published("LETE sand"), None, Terrain(), ConstantSteer(), NoWater(), Explicit(),
        Steps(0.1, 1e-3, 0.02, 0.01), 0.0, forces, **options,
    )  # fmt: skip
    parameters_json(run.parts())
    return Fingerprint.of(run)


FORCES = {
    "function": lambda: PointForce(pull),
    "another": lambda: PointForce(push),
    "place": lambda: PointForce(pull, point=(0.1, 0.0, 0.3)),
    "body": lambda: PointForce(pull, body="rear_left"),
    "default": lambda: PointForce(functools.partial(pull, stiffness=50.0)),
    "closure": lambda: PointForce(rope(1.0)),
    "another closure": lambda: PointForce(rope(2.0)),
    "object": lambda: PointForce(Winch(1.0)),
    "another object": lambda: PointForce(Winch(2.0)),
    "lambda": lambda: [PointForce(lambda t, x, v: 1.0 * x), PointForce(lambda t, x, v: 2.0 * x)][0],
    "lambda of the same line": lambda: [PointForce(lambda t, x, v: 1.0 * x), PointForce(lambda t, x, v: 2.0 * x)][1],
}  # fmt: skip


def test_forces_are_told_from_each_other(tmp_path):
    """The same again is the same; every two of them differ, and nothing else does."""
    kinds = list(FORCES.values())
    texts = [fingerprint(make()).parts["forces"] for make in kinds]
    assert [fingerprint(make()).parts["forces"] for make in kinds] == texts
    assert len(set(texts)) == len(texts)
    for one, other, said in (
        ("function", "another", r"forces \(\[0\]\.force was pull, is push; .*\) differs"),
        ("object", "another object", r"forces \(\[0\]\.force\.strength was 1\.0, is 2\.0\) differs"),
        ("function", "place", r"forces \(\[0\]\.point\[0\] was 0\.0, is 0\.1\) differs"),
        ("lambda", "lambda of the same line", r"forces \(source of test_checkpoint.* differs"),
    ):
        file = tmp_path / f"{one}.npz"
        write(file, 7, TREE, fingerprint(FORCES[one]()))
        Checkpoints(file, fingerprint(FORCES[one]()), resume=True)
        with pytest.raises(ValueError, match=rf"belongs to another run: {said}\. Resume with what it was made with"):
            Checkpoints(file, fingerprint(FORCES[other]()), resume=True)


def test_user_loads_and_a_force_more_are_another_run():
    one = fingerprint(PointForce(pull))
    assert one.differences(fingerprint(PointForce(pull), user_loads=True).parts) == ["user_loads"]
    (found,) = one.differences(fingerprint().parts)
    assert found.startswith("forces (")
    assert one.differences(one.parts | {"forces": "torn"}) == ["forces"]


def test_forces_are_described_without_being_copied():
    """What a user's function holds may not allow it; a result names the function, or the fields of a dataclass."""

    class Held:
        def __deepcopy__(self, memo):
            raise TypeError("held")

        def __call__(self, time, position, velocity):
            return position

    described = json.loads(parameters_json({"f": [PointForce(Held()), PointForce(Winch(3.0)), PointForce(pull)]}))["f"]
    held, winch, function = (one["PointForce"]["force"] for one in described)
    assert held == "Held" and winch == {"strength": 3.0} and function.startswith("pull (")
