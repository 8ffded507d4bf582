"""Help, wrong options and `import exumob` need no numerical package; what is exported is found all the same."""

import ast
import importlib
import os
import pickle
import pkgutil
import subprocess
import sys
from pathlib import Path

import pytest

from exumob.__main__ import COMMANDS

LAZY = ("exumob", "exumob.flow", "exumob.sweeps", "exumob.towing_tank")
"""Packages that import what they export on first use."""
HEAVY = {"exudyn", "h5py", "matplotlib", "netCDF4", "numba", "numpy", "pandas", "scipy", "torch", "xarray"}
CALLS = "import sys\nfrom exumob.__main__ import app\nfor call in {}:\n    try: app(call)\n    except SystemExit: pass"


def python(code, **variables):
    """What a new process prints, and the heavy packages that it has imported by the end."""
    code += f"\nimport sys; print('imported:', *sorted({HEAVY} & set(sys.modules)))"
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), "NO_COLOR": "1", **variables}
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=environment, check=True)
    text, _, imported = found.stdout.rpartition("imported:")
    return text, found.stderr, imported.split()


# -- without numerical packages ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("module", [*LAZY, "exumob.__main__"])
def test_an_import_alone_needs_no_numerical_package(module):
    assert python(f"import {module}")[2] == []


def test_no_help_needs_a_numerical_package():
    calls = [["--help"], *([name, "--help"] for name in COMMANDS)]
    text, said, imported = python(CALLS.format(calls))
    assert imported == [] and said == ""
    assert text.count("Usage: ") == len(calls) and "[m, 0.001 to 20]" in text  # of DEPTH


def test_no_wrong_option_needs_a_numerical_package():
    calls = [["--wrong"], ["fly"], *([name, "--wrong"] for name in COMMANDS), ["lane-change", "--current", "fast"]]
    _, said, imported = python(CALLS.format(calls))
    assert imported == [] and "Traceback" not in said
    assert said.count("Error: ") == len(calls)


def test_the_shell_completes_commands_and_options_without_a_numerical_package():
    code = "import sys\nsys.argv = ['exumob']\nfrom exumob.__main__ import app\ntry: app(prog_name='exumob')\n"
    code += "except SystemExit: pass"
    for typed, number, found in (("exumob la", 1, "lane-change"), ("exumob lane-change --cu", 2, "--current")):
        text, _, imported = python(
            code, _EXUMOB_COMPLETE="complete_bash", COMP_WORDS=typed, COMP_CWORD=str(number)
        )  # fmt: skip
        assert found in text.split() and imported == []


# -- what is exported --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("package", LAZY)
def test_every_exported_name_is_found_and_can_be_pickled(package):
    module = importlib.import_module(package)
    assert set(module.__all__) <= set(dir(module))
    for name in module.__all__:
        thing = getattr(module, name)
        assert name == "__version__" or (thing.__name__ == name and pickle.loads(pickle.dumps(thing)) is thing)
        assert vars(module)[name] is thing  # found at once from now on


@pytest.mark.parametrize("package", LAZY)
def test_type_checkers_see_what_is_exported(package):
    module = importlib.import_module(package)
    blocks = [block for block in ast.parse(Path(module.__file__).read_text()).body if isinstance(block, ast.If)]
    seen = [alias.asname or alias.name for found in blocks[0].body for alias in found.names]
    assert sorted(seen) == sorted(module.__all__)


@pytest.mark.parametrize("package", LAZY)
def test_no_exported_name_is_a_module_too(package):
    """Python would put the module in its place when that is imported."""
    module = importlib.import_module(package)
    assert not {found.name for found in pkgutil.iter_modules(module.__path__)} & set(module.__all__)


@pytest.mark.parametrize("package", LAZY)
def test_an_unknown_name_is_refused_as_in_any_module(package):
    module = importlib.import_module(package)
    for name in ("Sol", "_hidden", "__wrapped__"):
        with pytest.raises(AttributeError, match=rf"module '{package}' has no attribute '{name}'"):
            getattr(module, name)
        assert not hasattr(module, name)
    with pytest.raises(ImportError, match="cannot import name 'Sol'"):
        exec(f"from {package} import Sol")


def test_star_imports_and_modules_as_attributes():
    code = "from exumob import *\nimport exumob\n"
    code += "print(Soil is exumob.ground.soil.Soil, simulate is exumob.simulation.run.simulate, exumob.flow.Grid)"
    assert python(code)[0].split() == ["True", "True", "<class", "'exumob.flow.grid.Grid'>"]
