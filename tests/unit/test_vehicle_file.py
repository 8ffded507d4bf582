"""Vehicle files: whatever is wrong in one is said with file, line, kind and text; what is right loads."""

import pickle
import sys
from pathlib import Path

import pytest

from exumob.vehicle.vehicle_file import load_vehicle
from vehicle_models.amphibious import amphibious_vehicle

ROOT = Path(__file__).parents[2]

HEADER = "from vehicle_models.amphibious import amphibious_vehicle as _base\n"
GOOD = HEADER + "def car():\n    return _base()\n"


def write(folder, text, name="mine.py"):
    path = folder / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def test_vehicles_that_come_with_it_have_names():
    """The names work from any folder; a file that is there comes first."""
    assert load_vehicle("small_car") == load_vehicle(ROOT / "vehicle_models" / "small_car.py")
    with pytest.raises(FileNotFoundError, match="a vehicle that comes with exumob: amphibious, large_4x4"):
        load_vehicle("small_cat")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{}['x']\n", r"line 1: KeyError: 'x'; mend it"),
        ("raise RuntimeError('no licence')\n", r"line 1: RuntimeError: no licence"),
        ("\n1/0\n", r"line 2: ZeroDivisionError: division by zero"),
        ("raise SystemExit(3)\n", r"line 1: SystemExit: 3"),
        ("exit()\n", r"line 1: SystemExit"),
        ("raise BaseException\n", r"line 1: BaseException; mend it"),
        ("assert False\n", r"line 1: AssertionError"),
        ("import no_such_module_xyz\n", r"line 1: ModuleNotFoundError: No module named 'no_such_module_xyz'"),
        ("open('/no/such/file')\n", r"line 1: FileNotFoundError"),
        ("10.0 ** 1000\n", r"line 1: OverflowError"),
        ("def f():\n    return f()\ndef _g(): ...\nf()\n", r"line 2: RecursionError"),
        ("class A:\n    pass\nA().b\n", r"line 3: AttributeError: 'A' object has no attribute 'b'"),
        ("def car(:\n", r"is not Python, line 1: SyntaxError: invalid syntax"),
        ("x = 1\n\x00\n", r"is not Python: .*source code string cannot contain null bytes"),
        ("name = 'käse'\n".encode("latin-1"), r"is not Python.*'utf-8' codec can't decode"),
        ("# coding: no-such\n", r"is not Python.*unknown encoding"),
        ("\ufeff" * 2, r"is not Python"),
        (b"PK\x03\x04\x00\x01", r"is not Python"),
        ("", r"defines 0 public functions"),
        ("def a(): ...\ndef b(): ...\n", r"defines 2 public functions: a, b"),
        ("car = lambda: 3\ncar2 = car\n", r"returned int; it must return a Vehicle"),
        ("def car():\n    return 1/0\n", r"line 2: ZeroDivisionError"),
        ("def car():\n    raise SystemExit('[/red] :smile:')\n", r"line 2: SystemExit: \[/red\] :smile:; mend it"),
        ("def car(a, *b, c=1):\n    return a\n", r"car takes arguments \(a\); it must need none"),
        ("from exumob import Vehicle\ndef car():\n    return Vehicle\n", r"returned the class Vehicle itself"),
        (HEADER + "def car():\n    return [_base()]\n", r"returned list"),
        ("from exumob import Hull\ndef car():\n    return Hull(mas=3)\n", "line 3: Hull has no.*mean mass"),
        ("from exumob import Hull\ndef car():\n    return Hull(3.0, height=1.0)\n",
         r"line 3: Hull lacks length \[m\], width \[m\], ground_clearance \[m\], center_of_mass_h.*exumob p"),
        ("from math import pi\nfrom vehicle_models.small_car import small_car\n", r"Imported ones \(small_car\) do"),
        ("from dataclasses import replace\nVEHICLE = 3\n", r"which returns the vehicle\.$"),
        (HEADER + "car = _base()\n", r"car is a Vehicle: let a function return it"),
        ("def car():\n    return len(3)\n", r"line 2: TypeError: .*has no len\(\); mend it"),
    ],
)  # fmt: skip
def test_whatever_breaks_is_said_with_file_line_and_kind(tmp_path, text, message):
    path = list(sys.path)
    with pytest.raises(ValueError, match=message) as caught:
        load_vehicle(write(tmp_path, text))
    assert "mine.py" in str(caught.value) and "\n" not in str(caught.value)
    assert sys.path == path


@pytest.mark.parametrize("given", [None, 3, "", "a\0b", b"mine.py", []])
def test_what_is_no_path_is_refused(given):
    with pytest.raises(ValueError, match=r"load_vehicle\.file = .* the path of a file"):
        load_vehicle(given)


def test_folders_and_other_files(tmp_path, monkeypatch):
    (tmp_path / "car.py").mkdir()
    with pytest.raises(ValueError, match="is a folder; give a file in it"):
        load_vehicle(tmp_path / "car.py")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "small_car").mkdir()  # such as the folder of its runs
    assert load_vehicle("small_car") == load_vehicle(ROOT / "vehicle_models" / "small_car.py")
    for name in ("mine.txt", "mine", "mine.PY.bak"):
        with pytest.raises(ValueError, match=r"must end in \.py"):
            load_vehicle(write(tmp_path, GOOD, name))


def test_dataclasses_with_postponed_annotations(tmp_path):
    text = (
        "from __future__ import annotations\nfrom dataclasses import dataclass, replace\n" + HEADER
        + "@dataclass(frozen=True)\nclass Load:\n    mass: float = 5.0\n    inner: Load | None = None\n"
        + "def car():\n    return replace(_base(), name=f'carries {Load().mass}')\n"
    )  # fmt: skip
    found = load_vehicle(write(tmp_path, text))
    assert found.name == "carries 5.0"
    assert pickle.loads(pickle.dumps(found)) == found


def test_functions_imported_from_elsewhere_and_classes_do_not_count(tmp_path):
    text = (
        "from vehicle_models.amphibious import amphibious_vehicle\nfrom vehicle_models.light_4x4 import *\n"
        "from functools import partial\nclass Public:\n    def __call__(self): ...\n"
        "short = partial(amphibious_vehicle)\n"
        "def car():\n    return amphibious_vehicle()\nsame = car\n"
    )
    assert load_vehicle(write(tmp_path, text)) == amphibious_vehicle()


def test_modules_beside_the_file_are_its_own(tmp_path):
    """Two files with different helpers of one name; neither they nor their folders stay."""
    for folder, name in (("a", "one"), ("b", "other")):
        (tmp_path / folder / "parts").mkdir(parents=True)
        write(tmp_path / folder, f"NAME = {name!r}\n", "helper_of_test.py")
        write(tmp_path / folder / "parts", "DOUBLED = 2\n", "more.py")
        write(
            tmp_path / folder,
            "import dataclasses\nimport helper_of_test\n" + HEADER
            + "def car():\n    from parts.more import DOUBLED\n"
            + "    return dataclasses.replace(_base(), name=DOUBLED * helper_of_test.NAME)\n",
        )  # fmt: skip
    path = list(sys.path)
    assert load_vehicle(tmp_path / "a" / "mine.py").name == "oneone"
    assert load_vehicle(tmp_path / "b" / "mine.py").name == "otherother"
    assert sys.path == path and not {"helper_of_test", "parts", "parts.more"} & set(sys.modules)


def test_an_error_in_a_module_beside_is_found(tmp_path):
    write(tmp_path, "\n\nx = {}['mass']\n", "helper_of_test.py")
    with pytest.raises(ValueError, match=r"mine\.py, line 2 \(helper_of_test\.py, line 3\): KeyError: 'mass'"):
        load_vehicle(write(tmp_path, "\nimport helper_of_test\n"))


def test_a_helper_does_not_take_the_place_of_a_package(tmp_path):
    write(tmp_path, "raise RuntimeError\n", "numpy.py")
    write(tmp_path, "raise RuntimeError\n", "random.py")
    text = "import random, numpy\n" + GOOD
    assert load_vehicle(write(tmp_path, text)) == amphibious_vehicle()


def test_ctrl_c_stays_ctrl_c(tmp_path):
    with pytest.raises(KeyboardInterrupt):
        load_vehicle(write(tmp_path, "raise KeyboardInterrupt\n"))
