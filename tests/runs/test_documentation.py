"""The snippets of README.md, docs/quickstart.md and docs/howto run, or are checked; so are the examples.

A comment before a block says what is done with it:

    <!-- not run: reason -->        Python: imports are checked only; shell: nothing is done
    <!-- run with: duration=0.2 --> Python: it is run with this value; shell: it is run with this option added

Without a comment Python is run as it stands (blocks of a page in one namespace), and of shell commands the names of
programs, files, extras and options are checked.
"""

import ast
import importlib
import importlib.util
import re
import shlex
import subprocess
import sys
import tomllib
from pathlib import Path

import matplotlib
import matplotlib.pyplot as plt
import pytest
import typer
from typer.testing import CliRunner

from exumob.__main__ import app
from exumob.simulation.result_files import load_dataset
from exumob.sweeps.study import read_study

matplotlib.use("Agg")
ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", ROOT / "docs/quickstart.md", *sorted((ROOT / "docs/howto").glob("*.md"))]
BLOCK = re.compile(r"(?:<!-- (?P<mark>[^\n]*?) -->\n)?```(?P<language>python|bash|toml)\n(?P<text>.*?)\n```", re.DOTALL)
COMMANDS = typer.main.get_command(app).commands
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


def blocks(page):
    """Language, text and mark of each block of a page; the mark as its kind and its value."""
    for found in BLOCK.finditer(page.read_text()):
        kind, _, value = (found["mark"] or "").partition(": ")
        assert kind in ("", "not run", "run with", "test command"), f"{page.name}: unknown mark {found['mark']!r}"
        yield found["language"], found["text"], kind, value


@pytest.fixture
def workplace(tmp_path, monkeypatch):
    """An empty folder beside which the folders of the repository lie, as the snippets expect them."""
    for name in ("data", "examples", "studies", "vehicle_models"):
        (tmp_path / name).symlink_to(ROOT / name)
    monkeypatch.chdir(tmp_path)
    yield tmp_path
    plt.close("all")


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_snippets(page, workplace):
    namespace = {"__name__": "__main__"}
    for language, text, kind, value in blocks(page):
        if language == "toml":
            (workplace / "study.toml").write_text(text)
            read_study(workplace / "study.toml")
        elif language == "bash" and kind in ("", "run with"):
            for line in text.replace("\\\n", " ").splitlines():
                (run_command if kind else check_command)(shlex.split(line, comments=True), shlex.split(value))
        elif language == "python" and kind == "not run":
            check_imports(text)
        elif language == "python":
            name, _, number = value.partition("=")
            if kind:
                text, changed = re.subn(rf"\b{name}=[\d.]+", f"{name}={number}", text)
                assert changed, f"{page.name}: no {name} to replace"
            exec(compile(text, page.name, "exec"), namespace)


def run_command(words, options):
    if words[0] == "exumob":
        known = {name for parameter in COMMANDS[words[1]].params for name in parameter.opts}
        done = CliRunner().invoke(app, words[1:] + (options if options[0] in known else []))
        assert done.exit_code == 0, done.output
    else:
        subprocess.run(words, check=True)


def check_command(words, _):
    """Refuse a command with a program, option, file or extra that does not exist."""
    if "exumob" in words:
        words = words[words.index("exumob") :]
        with COMMANDS[words[1]].make_context(words[1], words[2:]):
            return
    elif words and words[0] == "pip":
        extras = re.findall(r"\[([\w,]+)\]", " ".join(words))
        assert set(",".join(extras).split(",")) <= set(PROJECT["optional-dependencies"])
    elif words and words[0] in ("python", "cp", "sbatch"):
        source = (ROOT / words[1]).read_text()
        missing = [word for word in words[2:] if word.startswith("--") and f'"{word}"' not in source]
        assert not missing
    else:
        assert not words, f"unknown program {words[0]}"


def check_imports(text):
    """Import what a block imports, without running the rest."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.ImportFrom):
            module = importlib.import_module(node.module)
            assert all(hasattr(module, name.name) for name in node.names), ast.unparse(node)
        elif isinstance(node, ast.Import):
            for name in node.names:
                importlib.import_module(name.name)


def test_sweep_over_a_ford_runs_as_a_file_and_goes_on(workplace):
    """Two processes; with one row lost the same command runs that case alone."""
    text = next(text for language, text, *_ in blocks(ROOT / "docs/howto/fording.md") if "DriveThrough" in text)
    text = text.replace('Soil.published("LETE sand"))', 'Soil.published("LETE sand"), duration=0.3)')
    text = text.replace("[99.8, 99.9, 100.0]", "[99.9]")
    (workplace / "levels.py").write_text(text)
    command = [sys.executable, "levels.py"]
    first = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    assert first.count("too short to tell") + first.count("too slow") == 2
    rows = {file.name: file.read_bytes() for file in (workplace / "levels" / "cases").iterdir()}
    (workplace / "levels" / "cases" / "1.json").unlink()
    assert subprocess.run(command, check=True, capture_output=True, text=True).stdout == first
    assert (workplace / "levels" / "cases" / "0.json").read_bytes() == rows["0.json"] and len(rows) == 2
    with load_dataset(workplace / "levels" / "sweep.nc") as found:
        assert found["wheel_load"].attrs["units"] == "1" and found["station"].attrs["units"] == "m"
        assert list(found["speed"].values) == [1.5, 2.5] and (found["station"] > 4.0).all()


def test_readme_is_short():
    assert len((ROOT / "README.md").read_text().splitlines()) <= 150


@pytest.mark.parametrize("page", ["README.md", "CONTRIBUTING.md", "data/cfd_mbd/README.md"])
def test_links_lead_somewhere(page):
    targets = re.findall(r"\]\((?!https?:)([^)#\s]+)", (ROOT / page).read_text())
    assert not [target for target in targets if not ((ROOT / page).parent / target).exists()]


def test_every_folder_is_in_the_reference():
    listed = set(re.findall(r"^   exumob\.(\w+)$", "".join(p.read_text() for p in ROOT.glob("docs/api/*.md")), re.M))
    folders = {path.parent.name for path in ROOT.glob("exumob/*/__init__.py")}
    assert folders - listed == {"commands"}  # which have docs/cli.md


def test_notebook(workplace):
    nbformat, nbclient = pytest.importorskip("nbformat"), pytest.importorskip("nbclient")
    notebook = nbformat.read(ROOT / "examples/first_run.ipynb", as_version=4)
    assert not any(cell.get("outputs") for cell in notebook.cells)  # stored outputs only grow the repository
    for cell in notebook.cells:
        cell.source = cell.source.replace("duration=8.0", "duration=0.5")
    nbclient.NotebookClient(notebook, timeout=600, resources={"metadata": {"path": str(workplace)}}).execute()
    printed = "".join(output.get("text", "") for cell in notebook.cells for output in cell.get("outputs", []))
    assert "m forward" in printed


def test_parameter_variation():
    """A head current slows the vehicle, weight on the wheels helps it, and the search comes near the wanted speed."""
    spec = importlib.util.spec_from_file_location("parameter_variation", ROOT / "examples/parameter_variation.py")
    example = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(example)
    (_, speeds), (best, error, *_) = example.main(use_multi_processing=False)
    light, heavy = speeds[::2], speeds[1::2]
    assert light == pytest.approx([0.740, 0.647, 0.506], abs=0.005)  # m/s at currents of 0, 0.5 and 1 m/s
    assert all(b > a for a, b in zip(light, heavy, strict=True))
    assert 4.5 < best["wheel_speed"] < 5.7 and error < 0.02  # [rad/s], [m/s]


def test_version_is_the_same_everywhere():
    """Of the package, of what is cited, and of the changelog's latest release."""
    released = re.search(r"^## \[(\d[^\]]*)\] - (\S+)$", (ROOT / "CHANGELOG.md").read_text(), re.MULTILINE)
    cited = (ROOT / "CITATION.cff").read_text()
    assert released is not None and released[1] == PROJECT["version"]
    assert f"\nversion: {released[1]}\ndate-released: {released[2]}\n" in cited
