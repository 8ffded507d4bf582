"""Sweeps before anything runs: what makes two the same, and what is kept of them."""

import errno
import functools
import importlib
import json
import os
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import xarray as xr

from exumob.driving.maneuver import Recorded
from exumob.support.identity import digest, identity
from exumob.sweeps import case_store, sweep
from exumob.sweeps.case_rows import case_text
from exumob.sweeps.case_store import CaseStore, StorageError
from exumob.sweeps.experiment import amphibious_lane_change
from exumob.vehicle.point_force import PointForce
from exumob.water.hydrodynamics import NoWater


@pytest.fixture
def written(tmp_path, monkeypatch):
    """Writes a module and imports it anew; its functions can be pickled."""
    monkeypatch.syspath_prepend(tmp_path)

    def write(text):
        sys.modules.pop("of_a_user", None)
        (tmp_path / "of_a_user.py").write_text(text)
        importlib.invalidate_caches()
        return importlib.import_module("of_a_user")

    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    yield write
    sys.modules.pop("of_a_user", None)


FUNCTION = "def answer(case, factor=1.0):\n    return {{'y': {} * factor * case['x']}}\n"
CALLABLE = """
from dataclasses import dataclass
@dataclass
class Answer:
    factor: float
    def __call__(self, case):
        return {{'y': {} * self.factor * case['x']}}
    def method(self, case):
        return self(case)
"""
UNREADABLE = 'exec(\'def answer(case):\\n    return {{"y": {} * case["x"]}}\')\n'


HELPER = "FACTOR = {}\ndef scaled(x):\n    return FACTOR * x\n"
USES_HELPER = "import helper_of_a_user\ndef answer(case):\n    return {'y': helper_of_a_user.scaled(case['x'])}\n"
USES_FUNCTION = "from helper_of_a_user import scaled\ndef answer(case):\n    return {'y': scaled(case['x'])}\n"


def prepare(folder, function, cases=({"x": 1.0},)):
    CaseStore(folder, function, cases, None, False).prepare([])


def square(case):
    """Numbers by name."""
    return {"square": case["x"] ** 2}


@dataclass
class Holder:
    """A function that holds something."""

    held: Any

    def __call__(self, case):
        """Nothing of it counts here."""
        return {"y": 1.0}


@pytest.mark.parametrize("text, made", [
    (FUNCTION, lambda m: m.answer),
    (FUNCTION, lambda m: functools.partial(m.answer, factor=2.0)),
    (CALLABLE, lambda m: m.Answer(2.0)),
    (UNREADABLE, lambda m: m.answer),
], ids=["function", "partial", "callable", "no source"])  # fmt: skip
def test_changed_source_is_refused(text, made, written, tmp_path):
    prepare(tmp_path / "sweep", made(written(text.format(1))))
    prepare(tmp_path / "sweep", made(written(text.format(1))))
    with pytest.raises(ValueError, match=r"before its source was changed; give another folder.*sweep\.json alone"):
        prepare(tmp_path / "sweep", made(written(text.format(2))))
    (tmp_path / "sweep" / "sweep.json").unlink()
    prepare(tmp_path / "sweep", made(written(text.format(2))))


@pytest.mark.parametrize("other, what", [
    (lambda m: functools.partial(m.answer, factor=3.0), "another experiment or function"),
    (lambda m: functools.partial(m.answer, 3.0), "another experiment or function"),
    (lambda m: m.answer, "another experiment or function"),
])  # fmt: skip
def test_other_arguments_of_a_partial_are_refused(other, what, written, tmp_path):
    module = written(FUNCTION.format(1))
    prepare(tmp_path / "sweep", functools.partial(module.answer, factor=2.0))
    with pytest.raises(ValueError, match=what):
        prepare(tmp_path / "sweep", other(module))


def test_other_fields_and_cases_are_refused(written, tmp_path):
    module = written(CALLABLE.format(1))
    prepare(tmp_path / "sweep", module.Answer(2.0).method)
    prepare(tmp_path / "sweep", module.Answer(2.0).method)
    with pytest.raises(ValueError, match="another experiment or function"):
        prepare(tmp_path / "sweep", module.Answer(3.0).method)
    with pytest.raises(ValueError, match="other cases"):
        prepare(tmp_path / "sweep", module.Answer(2.0).method, [{"x": 2.0}])


def test_addresses_do_not_count(written, tmp_path):
    """Two objects that are alike, at different addresses."""
    module = written(FUNCTION.format(1))
    one, other = (functools.partial(module.answer, factor=SimpleNamespace(a=object())) for _ in range(2))
    assert identity(one) == identity(other)


@pytest.mark.parametrize("text", [USES_HELPER, USES_FUNCTION], ids=["module", "function"])
def test_helpers_of_a_function_belong_to_it(text, written, tmp_path):
    """Also their constants; a function that is not called does not count where single ones are named."""

    def made(factor, more=""):
        sys.modules.pop("helper_of_a_user", None)
        (tmp_path / "helper_of_a_user.py").write_text(HELPER.format(factor) + more)
        importlib.invalidate_caches()
        return identity(written(text).answer)

    first = made(1)
    assert made(1) == first
    assert made(2).code_digest() != first.code_digest()
    assert made(2).values == first.values
    if text is USES_FUNCTION:
        assert made(1, "def other():\n    pass\n") == first
    sys.modules.pop("helper_of_a_user", None)


DECORATED = """
import functools
FACTOR = {}
def times(factor):
    def wrapping(inner):
        @functools.wraps(inner)
        def wrapper(case):
            return {{'y': factor * inner(case)['y']}}
        return wrapper
    return wrapping
"""
HOLDING = {
    "default": DECORATED + "def answer(case, factor=FACTOR * 1):\n    return {{'y': factor}}\n",
    "keyword default": DECORATED + "def answer(case, *, factor=FACTOR * 1):\n    return {{'y': factor}}\n",
    "closure": DECORATED + "@times(FACTOR)\ndef answer(case):\n    return {{'y': 1.0}}\n",
    "closure of a helper": DECORATED + "@times(FACTOR)\ndef helper(case):\n    return {{'y': 1.0}}\n"
                           "def answer(case):\n    return helper(case)\n",
    "partial as helper": DECORATED + "def _helper(factor, case):\n    return {{'y': factor}}\n"
                         "helper = functools.partial(_helper, FACTOR)\ndef answer(case):\n    return helper(case)\n",
    "object as helper": DECORATED + "class Helper:\n    def __init__(self, factor):\n        self.factor = factor\n"
                        "helper = Helper(FACTOR)\ndef answer(case):\n    return {{'y': helper.factor}}\n",
    "bound method as helper": DECORATED + "class Helper:\n"
                              "    def __init__(self, factor):\n        self.factor = factor\n"
                              "    def times(self, case):\n        return {{'y': self.factor}}\n"
                              "helper = Helper(FACTOR).times\ndef answer(case):\n    return helper(case)\n",
    "default of a method": DECORATED + "class Helper:\n    def __call__(self, case, factor=FACTOR * 1):\n"
                           "        return {{'y': factor}}\nanswer = Helper()\n",
    "value of a class": DECORATED + "class Helper:\n    factor = FACTOR * 1\n    def __call__(self, case):\n"
                        "        return {{'y': self.factor}}\nanswer = Helper()\n",
    "second of two alike": DECORATED + "def inner(case):\n    return {{'y': 1.0}}\none = times(1)(inner)\n"
                           "two = times(FACTOR)(inner)\ndef answer(case):\n    return one(case) | two(case)\n",
}  # fmt: skip


@pytest.mark.parametrize("kind", HOLDING)
def test_what_functions_are_bound_to_belongs_to_them(kind, written):
    """Computed when the module is imported, so that the source of the function does not show it."""
    first = identity(written(HOLDING[kind].format(2)).answer)
    assert identity(written(HOLDING[kind].format(2)).answer) == first
    assert identity(written(HOLDING[kind].format(3)).answer) != first


def test_another_default_is_named(written, tmp_path):
    prepare(tmp_path / "sweep", written(HOLDING["default"].format(2)).answer)
    with pytest.raises(ValueError, match="another experiment or function: factor was 2, is 3"):
        prepare(tmp_path / "sweep", written(HOLDING["default"].format(3)).answer)


def test_functions_that_name_each_other_have_an_end(written):
    text = (
        "def answer(case, more=[]):\n    return helper\ndef helper(inner=answer):\n    pass\n"
        "answer.__defaults__[0].append(helper)\n"
    )
    assert identity(written(text).answer) == identity(written(text).answer)


HELD = [
    lambda: np.arange(5000.0),
    lambda: np.ma.masked_equal(np.arange(5.0), 3.0),
    lambda: [0.1 * n for n in range(2000)],
    lambda: {"a": [1, {"b": 2.0}]},
    lambda: xr.Dataset({"v": ("n", np.arange(3000.0))}),
    lambda: Recorded([0.0, 1.0, 2.0, 3.0], [0.0, 0.1, 0.1, 0.0], [0.0, 1.0, 1.0, 1.0]),
    lambda: replace(amphibious_lane_change(), duration=3.0),
]


def _other(thing):
    """The same with one of its numbers changed."""
    if isinstance(thing, np.ndarray):
        changed = thing.copy()
        changed[len(changed) // 2] += 0.5
        return changed
    if isinstance(thing, list):
        return [*thing[:1000], 7.0, *thing[1001:]]
    if isinstance(thing, dict):
        return {"a": [1, {"b": 3.0}]}
    if isinstance(thing, xr.Dataset):
        return xr.Dataset({"v": ("n", _other(thing["v"].values))})
    if isinstance(thing, Recorded):
        return Recorded([0.0, 1.0, 2.0, 3.0], [0.0, 0.1, 0.2, 0.0], [0.0, 1.0, 1.0, 1.0])
    return replace(thing, duration=4.0)


@pytest.mark.parametrize("make", HELD, ids=lambda make: type(make()).__name__)
def test_all_that_a_function_holds_belongs_to_it(make):
    """Also in the midst of what is shown abridged."""
    assert identity(Holder(make())) == identity(Holder(make()))
    assert identity(Holder(make())).values != identity(Holder(_other(make()))).values


def test_contents_of_files_belong_to_a_sweep(tmp_path):
    mesh = tmp_path / "hull.stl"
    mesh.write_text("a hull")
    prepare(tmp_path / "held", Holder(mesh))
    prepare(tmp_path / "varied", square, [{"x": 1.0, "mesh": mesh}])
    os.utime(mesh, (1.0, 1.0))  # the time does not count
    prepare(tmp_path / "held", Holder(mesh))
    prepare(tmp_path / "varied", square, [{"x": 1.0, "mesh": mesh}])
    (tmp_path / "elsewhere").mkdir()
    moved = mesh.rename(tmp_path / "elsewhere" / "hull.stl")
    prepare(tmp_path / "held", Holder(moved))  # nor does the place
    mesh.write_text("another")
    with pytest.raises(ValueError, match=r"another experiment or function: held was .*hull\.stl"):
        prepare(tmp_path / "held", Holder(mesh))
    with pytest.raises(ValueError, match="other cases"):
        prepare(tmp_path / "varied", square, [{"x": 1.0, "mesh": mesh}])


def test_mesh_of_a_hull_belongs_to_an_experiment(tmp_path):
    """Whether it is the vehicle's, or varied by the text that a study file holds."""
    mesh = tmp_path / "hull.stl"
    mesh.write_text("a hull")
    base = amphibious_lane_change()
    shaped = replace(base, vehicle=replace(base.vehicle, hull=replace(base.vehicle.hull, mesh=mesh)))
    first, text = (
        identity(shaped).values["vehicle.hull.mesh"],
        case_text(base.typed({"hull.mesh": str(mesh)})),
    )
    mesh.write_text("another")
    assert identity(shaped).values["vehicle.hull.mesh"] != first
    assert case_text(base.typed({"hull.mesh": str(mesh)})) != text


# -- rows --------------------------------------------------------------------------------------------------------------

CASES = [{"x": 1.0, "name": "[a]"}, {"x": 2.0, "name": "b"}, {"x": 3.0, "name": "c"}]


@pytest.fixture
def finished(tmp_path):
    """Folder of a sweep whose three cases have ended, without a process."""
    store = CaseStore(tmp_path / "sweep", square, CASES, None, False)
    store.prepare([])
    for number, case in enumerate(CASES):
        store.begin(number, mpi=False)
        store.end(number, "completed", "", 0.1, square(case))
    store.save(store.gather())
    return tmp_path / "sweep"


def again(folder, function=square, cases=CASES):
    store = CaseStore(folder, function, cases, None, False)
    store.prepare([])
    return store


def edited(file, **changes):
    row = json.loads(file.read_text()) | changes
    row["check"] = digest(json.dumps({name: part for name, part in row.items() if name != "check"}))
    file.write_text(json.dumps({name: value for name, value in row.items() if value is not None}))


def test_rows_are_kept_and_gathered(finished):
    result = again(finished).gather()
    assert list(result["square"].values) == [1.0, 4.0, 9.0] and list(result["name"].values) == ["[a]", "b", "c"]
    assert all("units" in v.attrs and "long_name" in v.attrs for v in result.variables.values())


def test_rows_are_not_relabelled(finished):
    """Neither without the description of the sweep, nor by copying, nor by editing."""
    (finished / "sweep.json").unlink()
    other = [CASES[0], CASES[1] | {"x": 2.5}, CASES[2]]
    with pytest.raises(ValueError, match=r"1\.json is another case: x was 2\.0, is 2\.5\. .*remove the file"):
        again(finished, cases=other)
    with pytest.raises(ValueError, match=r"0\.json was computed by another experiment or function"):
        again(finished, function=Holder(1.0))
    again(finished)  # nothing has changed
    (finished / "cases" / "2.json").write_bytes((finished / "cases" / "0.json").read_bytes())
    with pytest.raises(ValueError, match=r'2\.json is another case: x was 1\.0, is 3\.0; name was "\[a\]", is "c"'):
        again(finished)


@pytest.mark.parametrize("spoil, word", [
    (lambda f: (f / "cases" / "1.json").write_text("{}"), r"1\.json is not how a case ended \(.*another version"),
    (lambda f: (f / "cases" / "1.json").write_text("[1, 2]"), r"1\.json is not how a case ended \(it holds a list"),
    (lambda f: edited(f / "cases" / "1.json", format=1), "layout of another version"),
    (lambda f: edited(f / "cases" / "1.json", exumob="0.0.1"), r"was computed by exumob 0\.0\.1, this is"),
    (lambda f: edited(f / "cases" / "1.json", status=None), "status is missing"),
    (lambda f: edited(f / "cases" / "1.json", status="fine"), "status is 'fine'"),
    (lambda f: edited(f / "cases" / "1.json", values=[1.0]), r"values is \[1\.0\]"),
    (lambda f: edited(f / "cases" / "1.json", values={"square": [1]}), r"the value of square is \[1\]"),
    (lambda f: (f / "cases" / "1.json").write_text((f / "cases" / "1.json").read_text().replace("4.0", "4.5")),
     r"1\.json was changed after it was written"),
    (lambda f: edited(f / "cases" / "1.json", wall_time="long"), "wall_time is 'long'"),
    (lambda f: (f / "cases" / "notes.json").write_text("{}"), r"notes\.json: no case of this sweep.*move it out"),
    (lambda f: (f / "cases" / "03.json").write_text("{}"), r"03\.json: no case of this sweep"),
    (lambda f: (f / "cases" / "7.json").write_text("{}"), r"7\.json: no case of this sweep"),
    (lambda f: (f / "cases" / "9.json").mkdir(), r"9\.json: no case of this sweep"),
    (lambda f: (f / "sweep.json").write_text((f / "sweep.json").read_text()[:40]), r"\.json cannot be read.*remove"),
    (lambda f: (f / "sweep.json").write_bytes(b""), r"sweep\.json cannot be read"),
    (lambda f: (f / "sweep.json").write_text("[" * 100_000), r"sweep\.json cannot be read"),
    (lambda f: (f / "sweep.json").write_text("[]"), r"sweep\.json was written by another version"),
    (lambda f: (f / "sweep.json").write_text("{}"), r"sweep\.json is not the description .*format is"),
    (lambda f: edited(f / "sweep.json", number="three"), "number is missing or wrong"),
    (lambda f: edited(f / "sweep.json", exumob="0.0.1"), r"holds a sweep of exumob 0\.0\.1"),
    (lambda f: edited(f / "sweep.json", format=1), "another version of exumob"),
])  # fmt: skip
def test_damaged_folders_are_refused_by_name(spoil, word, finished):
    spoil(finished)
    with pytest.raises(ValueError, match=word):
        again(finished)


@pytest.mark.parametrize("rest", [b"", b"{", b"\xff\x00", None], ids=["empty", "cut off", "no text", "half"])
def test_torn_rows_are_run_again(rest, finished, caplog):
    file = finished / "cases" / "1.json"
    whole = file.read_bytes()
    file.write_bytes(whole[: len(whole) // 2] if rest is None else rest)
    assert again(finished).left() == [1]
    assert "1.json was not written to its end" in caplog.text and "run again" in caplog.text


def test_other_files_do_no_harm(finished):
    """Marks that cannot be read, half files of killed processes, files of editors and file systems."""
    (finished / "begun" / "0.json").write_text("{}")
    (finished / "begun" / "2.json").write_bytes(b"")
    (finished / "cases" / ".1.json.77.partial").write_bytes(b"")
    (finished / "cases" / "1.json~").write_text("x")
    (finished / "notes.txt").write_text("x")
    assert again(finished).left() == []
    assert not list(finished.rglob("*.partial")) and not list((finished / "begun").iterdir())


def test_rows_of_other_code_are_counted(finished, caplog):
    """Who has removed the description by intent is told what is mixed."""
    edited(finished / "cases" / "1.json", code="0" * 16)
    result = again(finished).gather()
    assert "1 cases are kept that other code has computed" in caplog.text
    assert result.attrs["cases_of_other_code"] == 1


def test_a_link_in_the_place_of_the_lock_is_not_followed(finished, tmp_path):
    target = tmp_path / "precious"
    target.write_text("mine")
    (finished / ".lock").symlink_to(target)
    with pytest.raises(StorageError, match=r"\.lock|sweep"), again(finished).locked():
        pass
    assert target.read_text() == "mine"


# -- disks -------------------------------------------------------------------------------------------------------------


def full(*_, **__):
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


@pytest.mark.parametrize("number, word", [
    (errno.ENOSPC, "No space left on device.*make room"), (errno.EROFS, "Read-only.*folder that can be written"),
    (errno.EACCES, "folder that can be written"), (errno.EIO, "look after the disk"),
])  # fmt: skip
@pytest.mark.parametrize("place", ["folders", "begin", "end"])
def test_errors_of_the_disk_say_what_to_do(number, word, place, finished, monkeypatch):
    store = again(finished)

    def broken(*_, **__):
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(Path, "mkdir" if place == "folders" else "write_text", broken)
    with pytest.raises(StorageError, match=f"{word}.*What has ended is kept"):
        if place == "folders":
            store.prepare([])
        elif place == "begin":
            store.begin(0, mpi=False)
        else:
            store.end(0, "completed", "", 0.1, {"square": 1.0})
    assert not list(finished.rglob("*.partial"))
    assert all(file.stat().st_size for file in finished.rglob("*.json"))


def test_a_result_that_cannot_be_written_goes_nowhere_else(finished, monkeypatch):
    """It is gathered again in no time; its place is not the temporary folder."""
    store = again(finished)
    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(StorageError, match=r"sweep\.nc cannot be written"):
        store.save(store.gather())


def test_too_little_room_is_found_beforehand(tmp_path, monkeypatch):
    monkeypatch.setattr(case_store.shutil, "disk_usage", lambda folder: SimpleNamespace(free=10_000))
    with pytest.raises(StorageError, match=r"3 cases need about .*MiB, and the disk has .*MiB left; make room"):
        prepare(tmp_path / "sweep", square, CASES)
    with pytest.raises(StorageError, match="1 cases need about"):
        CaseStore(tmp_path / "runs", amphibious_lane_change(), [{"hull.mass": 49.0}], None, True).prepare([])
    prepare(tmp_path / "sweep", square, CASES[:2])


@pytest.mark.skipif(not hasattr(os, "statvfs"), reason="no such limit known")
def test_too_few_files_are_found_beforehand(tmp_path, monkeypatch):
    monkeypatch.setattr(os, "statvfs", lambda folder: SimpleNamespace(
        f_files=100, f_favail=5, f_bavail=10**9, f_blocks=10**9, f_bfree=10**9, f_frsize=4096
    ))  # fmt: skip
    with pytest.raises(StorageError, match="need as many files, and the disk has room for 5"):
        prepare(tmp_path / "sweep", square, CASES)


# -- forces of the user's own ------------------------------------------------------------------------------------------

TOWING = """
from dataclasses import dataclass

@dataclass(frozen=True)
class Rope:
    stiffness: float = 100.0
    def __call__(self, time, position, velocity):
        return -{} * self.stiffness * position

def gust(time, position, velocity):
    return 0.0, {} * 10.0, 0.0
"""


def towed(module, stiffness=100.0):
    rope = PointForce(module.Rope(stiffness), point=(0.5, 0.0, 0.2))
    return replace(amphibious_lane_change(), forces=[rope, PointForce(module.gust)])


def test_fields_of_a_force_are_names(written):
    module = written(TOWING.format(1, 1))
    experiment = towed(module)
    names = {"forces.0.force.stiffness": 200.0, "forces.0.point": (0.1, 0.0, 0.3), "forces.1.body": "rear_left"}
    changed = experiment.with_values(names)
    assert {name: changed.value(name) for name in names} == names
    assert changed.forces[0].force == module.Rope(200.0) and changed.forces[1].force is module.gust
    assert experiment.with_values({"forces": [PointForce(module.gust)]}).forces == (PointForce(module.gust),)
    assert experiment.with_values({"forces": ()}).description(NoWater()).forces == ()
    assert changed.description(NoWater()).forces == changed.forces
    for bad, message in (
        ({"forces.2.body": "hull"}, "'forces.2.body' is not known; did you mean forces.1.body"),
        ({"forces.0.force.length": 1.0}, "is not known"),
        ({"forces.1.body": "roof"}, "body"),
        ({"forces.0.point": (99.0, 0.0, 0.0)}, "plausible"),
        ({"forces": module.gust}, "must be a list of PointForce"),
        ({"forces": "gust"}, "must be a list of PointForce; give it in Python"),
    ):
        with pytest.raises(ValueError, match=message):
            experiment.with_values(bad)


def test_another_force_is_another_sweep(written, tmp_path):
    prepare(tmp_path / "sweep", towed(written(TOWING.format(1, 1))), [{"hull.mass": 49.0}])
    prepare(tmp_path / "sweep", towed(written(TOWING.format(1, 1))), [{"hull.mass": 49.0}])
    with pytest.raises(ValueError, match=r"forces\[0\]\.force\.stiffness was 100\.0, is 50\.0"):
        prepare(tmp_path / "sweep", towed(written(TOWING.format(1, 1)), 50.0), [{"hull.mass": 49.0}])
    for changed in ((2, 1), (1, 2)):
        with pytest.raises(ValueError, match=r"before its source was changed; .*of_a_user\.(Rope|gust)"):
            prepare(tmp_path / "sweep", towed(written(TOWING.format(*changed))), [{"hull.mass": 49.0}])


def test_a_case_with_another_force_is_another_case(written, tmp_path):
    """Of the same name, which a text of the function alone would not show."""

    def cases(factor):
        module = written(TOWING.format(1, factor))
        return [{"forces": (PointForce(module.gust),)}, {"forces": ()}]

    store = CaseStore(tmp_path / "sweep", square, cases(1), None, False)
    store.prepare([])
    store.end(0, "completed", "", 1.0, {"y": 1.0})
    store.end(1, "completed", "", 1.0, {"y": 2.0})
    first = store.gather()
    assert len(set(first["forces"].values)) == 2 and " at 0x" not in str(first["forces"].values)
    again = CaseStore(tmp_path / "sweep", square, cases(1), None, False)
    again.prepare([])
    assert again.ended() == {0, 1} and list(again.gather()["forces"].values) == list(first["forces"].values)
    with pytest.raises(ValueError, match="other cases"):
        prepare(tmp_path / "sweep", square, cases(2))
    (tmp_path / "sweep" / "sweep.json").unlink()
    with pytest.raises(ValueError, match=r"0\.json is another case: forces was"):
        prepare(tmp_path / "sweep", square, cases(2))


def test_forces_that_cannot_be_handed_over_are_named(tmp_path):
    local = PointForce(lambda time, position, velocity: position)
    with pytest.raises(ValueError, match=r"sweep\.function cannot be given to another process .*top level of a module"):
        sweep(replace(amphibious_lane_change(), forces=[local]), [{"hull.mass": 49.0}], tmp_path)
    with pytest.raises(ValueError, match=r"sweep\.cases: forces of case 1 cannot be given to another process"):
        sweep(amphibious_lane_change(), [{"forces": ()}, {"forces": (local,)}], tmp_path)


def test_a_class_whose_types_are_not_there_declares_nothing(written):
    text = "from __future__ import annotations\n" + TOWING.format(1, 1).replace("stiffness: float", "stiffness: Unit")
    experiment = towed(written(text))
    assert experiment.declaration("forces.0.force.stiffness") is None
    assert experiment.meaning("forces.0.force.stiffness") == ("1", "forces.0.force.stiffness")
    assert experiment.typed({"forces.0.force.stiffness": 3.0}) == {"forces.0.force.stiffness": 3.0}
