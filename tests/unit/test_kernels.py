"""Kept kernels are compiled again when anything that they hold has changed, and only then."""

import ast
import importlib
import os
import shutil
import sys
import threading
import time
from pathlib import Path

import numba
import pytest
from numba.core import caching

from exumob.ground.terramechanics import wheel_soil_kernel
from exumob.support import compiled, kernels

NJIT = "from made_up.support.kernels import njit\n@njit(cache=True, error_model='numpy')\n"
SOURCES = {
    "__init__.py": "from made_up.drag import drag\n",
    "support/__init__.py": "",
    "support/kernels.py": Path(kernels.__file__).read_text(),
    "constants.py": "DENSITY = 1000.0\n",
    "shapes/__init__.py": "",
    "shapes/area.py": f"from made_up import constants\n{NJIT}def mass(x):\n    return constants.DENSITY * x\n",
    "drag.py": f"from made_up.shapes import (\n    area,\n)\n{NJIT}def drag(v):\n    return 0.5 * area.mass(v)\n",
    "heat.py": f"{NJIT}def heat(x):\n    return 3.0 * x\n",
    "plot.py": "from made_up.drag import drag\n",
}


@pytest.fixture
def package(tmp_path, monkeypatch):
    """A package with the mechanism of this one, whose kernels are kept in a folder of its own."""
    monkeypatch.setattr("numba.config.CACHE_DIR", str(tmp_path / "kept"))
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    monkeypatch.syspath_prepend(tmp_path)
    root = tmp_path / "made_up"
    for name, text in SOURCES.items():
        (root / name).parent.mkdir(exist_ok=True, parents=True)
        (root / name).write_text(text)
    yield root
    unload()


def unload():
    for name in [name for name in sys.modules if name.partition(".")[0] == "made_up"]:
        del sys.modules[name]
    importlib.invalidate_caches()


def value(kernel):
    """What a kernel makes of 2, and whether Numba found it on the disk."""
    return kernel(2.0), sum(kernel.stats.cache_hits.values()) == 1


def next_process():
    """Both kernels as a new process finds them: it imports, reads and decorates everything anew."""
    unload()
    heat = importlib.import_module("made_up.heat").heat  # the package comes first, and with it drag
    return value(sys.modules["made_up.drag"].drag), value(heat)


def change(file, old, new):
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new))


# -- compiled again, or not --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("file", "old", "new", "drag", "heat"),
    [
        ("constants.py", "1000.0", "1025.0", (1025.0, False), (6.0, True)),
        ("shapes/area.py", "DENSITY *", "DENSITY +", (501.0, False), (6.0, True)),
        ("drag.py", "0.5", "0.7", (1400.0, False), (6.0, True)),
        ("heat.py", "3.0", "4.0", (1000.0, True), (8.0, False)),
        ("plot.py", "\n", "\nCOLOUR = 1\n", (1000.0, True), (6.0, True)),
    ],
)
def test_what_a_change_reaches_is_compiled_again_and_nothing_else(package, file, old, new, drag, heat):
    assert next_process() == ((1000.0, False), (6.0, False))
    assert next_process() == ((1000.0, True), (6.0, True))
    change(package / file, old, new)
    assert next_process() == (drag, heat)
    assert next_process() == ((drag[0], True), (heat[0], True))


def test_installed_again_the_same_as_before(package):
    next_process()
    later = time.time() + 10.0
    for file in package.rglob("*.py"):
        os.utime(file, (later, later))
    assert next_process() == ((1000.0, True), (6.0, True))


def test_a_change_of_the_same_length_and_date_counts(package):
    file = package / "constants.py"
    before = file.stat()
    next_process()
    change(file, "1000.0", "1025.0")
    os.utime(file, ns=(before.st_atime_ns, before.st_mtime_ns))
    assert next_process() == ((1025.0, False), (6.0, True))


def test_modules_loaded_again_in_one_process(package):
    next_process()
    change(package / "constants.py", "1000.0", "1025.0")
    for name in ("constants", "shapes.area", "drag"):
        module = importlib.reload(sys.modules[f"made_up.{name}"])
    assert value(module.drag) == (1025.0, False)


def test_what_was_edited_after_it_was_loaded_is_not_taken_for_compiled(package):
    """A process that holds the old code of a file compiles a kernel of another: the next process must not take it."""
    (package / "__init__.py").write_text("")
    importlib.import_module("made_up.shapes.area")
    change(package / "shapes/area.py", "DENSITY *", "DENSITY +")
    assert value(importlib.import_module("made_up.drag").drag) == (1000.0, False)
    unload()
    assert value(importlib.import_module("made_up.drag").drag) == (501.0, False)


# -- wherever kernels are kept -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("place", ["beside the sources", "home", "locators of the user", "archive"])
def test_in_every_place_where_numba_keeps_kernels(package, monkeypatch, place):
    monkeypatch.setattr("numba.config.CACHE_DIR", "")
    monkeypatch.setenv("XDG_CACHE_HOME", str(package.parent / "home"))
    kept = package.parent / "home"
    if place == "beside the sources":
        kept = package
    elif place == "home":
        for folder in (package, package / "shapes"):
            (folder / "__pycache__").touch()
    elif place == "locators of the user":
        if not hasattr(numba.config, "CACHE_LOCATOR_CLASSES"):
            pytest.skip("this numba has no such setting")
        monkeypatch.setattr("numba.config.CACHE_LOCATOR_CLASSES", "UserWideCacheLocator")
    else:
        monkeypatch.syspath_prepend(package.parent / "packed.zip")

    def pack():
        if place == "archive":
            source = package.parent / "made_up"
            shutil.make_archive(str(package.parent / "packed"), "zip", package.parent, "made_up")
            source.rename(package.parent / "away")

    pack()
    assert next_process() == ((1000.0, False), (6.0, False))
    assert next_process() == ((1000.0, True), (6.0, True))
    assert len(list(kept.rglob("*.nbi"))) == 3
    if place == "archive":
        (package.parent / "away").rename(package)
        sys.path_importer_cache.clear()
    change(package / "constants.py", "1000.0", "1025.0")
    pack()
    assert next_process() == ((1025.0, False), (6.0, place != "archive"))  # an archive is taken as a whole


def test_whether_a_kernel_is_kept(package):
    unload()
    drag = importlib.import_module("made_up.drag").drag
    assert not compiled.is_compiled(drag)
    drag(2.0)
    unload()
    assert compiled.is_compiled(importlib.import_module("made_up.drag").drag)
    unload()
    change(package / "constants.py", "1000.0", "1025.0")
    assert not compiled.is_compiled(importlib.import_module("made_up.drag").drag)


@pytest.mark.parametrize("missing", ["FunctionCache", "CompileResultCacheImpl", "IndexDataCacheFile"])
def test_a_numba_that_keeps_kernels_in_another_way_keeps_none(package, monkeypatch, caplog, missing):
    """Slow and right, and said once."""
    if missing == "IndexDataCacheFile":  # asks nobody for a stamp
        monkeypatch.setattr(caching, missing, lambda **options: type("File", (), {"_source_stamp": 1})())
    else:
        monkeypatch.delattr(caching, missing)
    for _ in range(2):
        caplog.clear()
        assert next_process() == ((1000.0, False), (6.0, False))
        (said,) = [record.message for record in caplog.records]
        assert f"numba {numba.__version__} keeps compiled kernels in a way" in said
    assert not list(package.parent.rglob("*.nb[ic]"))


# -- this package ------------------------------------------------------------------------------------------------------


def test_all_kernels_of_this_package_are_kept_so_and_every_import_is_found():
    """What a parser finds; others that the faster way finds beside it (in texts) do no harm."""
    assert isinstance(wheel_soil_kernel._cache, kernels._cache_class())
    for path in sorted(kernels.PACKAGE.rglob("*.py")):
        wanted, text = set(), path.read_bytes()
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.Import):
                wanted |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                assert node.level == 0, f"{path}: a relative import"
                assert node.module != "numba" or [alias.name for alias in node.names] == ["prange"], path
                wanted |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
            elif isinstance(node, ast.Attribute) and node.attr in ("njit", "jit", "vectorize", "guvectorize", "cfunc"):
                assert path == Path(kernels.__file__)
        wanted = {name for name in wanted if name.partition(".")[0] == "exumob" and kernels._file(name)}
        assert wanted <= kernels._imported(text), path


def test_the_clock_of_computing_stands_still_while_numba_compiles(package):
    """It counts what this thread compiles: not what another one does, nor what is found on the disk."""

    def work(x):
        total = 0.0
        for k in range(40):
            total += x**k
        return total

    wall, computing, compiling = time.perf_counter(), compiled.computing_clock(), compiled.compiling_time()
    numba.njit(work)(1.0)
    took = compiled.compiling_time() - compiling
    computed = compiled.computing_clock() - computing
    passed = time.perf_counter() - wall
    assert took > 0.0 and computed > 0.0 and computed + took <= passed

    before, elsewhere = compiled.compiling_time(), []

    def other():
        numba.njit(work)(1.0)
        elsewhere.append(compiled.compiling_time())

    thread = threading.Thread(target=other)
    thread.start()
    thread.join()
    assert compiled.compiling_time() == before and elsewhere[0] > 0.0

    assert next_process() == ((1000.0, False), (6.0, False))
    first = compiled.compiling_time()
    assert first > before
    assert next_process() == ((1000.0, True), (6.0, True)) and compiled.compiling_time() == first
