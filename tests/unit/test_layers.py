"""Imports point downward only: the order of the folders, and no cycle among files."""

import ast
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[2] / "exumob"
LAYERS = (
    "support", "ground", "vehicle", "driving", "multibody", "water", "surrogates", "flow", "towing_tank", "coupling",
    "simulation", "paper", "learning", "sweeps", "mobility", "verification", "commands",
)  # fmt: skip
"""From the ground up; a folder may import from itself and from those before it."""
HEAVY = {
    "torch": {"learning"},
    "exudyn": {"support", "multibody", "sweeps"},
    "typer": {"commands"},
    "rich": {"commands"},
}
"""Packages that only these folders import."""


def _module(path):
    parts = path.relative_to(PACKAGE.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def _imports(path, lazy=True):
    """Modules that a file imports, also inside functions; `lazy` False: not those for type checking."""
    tree = ast.parse(path.read_text())
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
            yield node.module
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


FILES = {_module(path): path for path in sorted(PACKAGE.rglob("*.py"))}
GRAPH = {name: {found for found in _imports(path) if found in FILES and found != name} for name, path in FILES.items()}


def _folder(module):
    parts = module.split(".")
    return parts[1] if len(parts) > 1 else ""


def test_every_folder_has_its_place_in_the_order():
    folders = {path.parent.name for path in PACKAGE.glob("*/__init__.py")}
    assert folders == set(LAYERS)


@pytest.mark.parametrize("folder", LAYERS)
def test_imports_point_downward(folder):
    allowed = LAYERS[: LAYERS.index(folder) + 1]
    upward = [
        f"{name} -> {found}"
        for name, imports in GRAPH.items()
        if _folder(name) == folder
        for found in imports
        if _folder(found) not in allowed
    ]
    assert not upward


def test_no_cycles_among_files():
    """Packages are left out: their `__init__` gathers what is public."""
    graph = {
        name: {found for found in imports if not FILES[found].name == "__init__.py"}
        for name, imports in GRAPH.items()
        if FILES[name].name != "__init__.py"
    }
    done, path, cycles = set(), [], []

    def visit(name):
        if name in path:
            cycles.append(" -> ".join([*path[path.index(name) :], name]))
        elif name not in done:
            path.append(name)
            for found in sorted(graph[name]):
                visit(found)
            path.pop()
            done.add(name)

    for name in graph:
        visit(name)
    assert not cycles


@pytest.mark.parametrize("package", HEAVY)
def test_heavy_packages_stay_where_they_belong(package):
    users = {
        _folder(name) or "commands"
        for name, path in FILES.items()
        if any(i.split(".")[0] == package for i in _imports(path))
    }
    assert users - {"__main__"} <= HEAVY[package]


@pytest.mark.parametrize("folder", LAYERS)
def test_functions_with_many_arguments_say_why(folder):
    """More than eight arguments need a comment at the head of the function; a record or a staggered field is one."""
    silent = []
    for path in sorted((PACKAGE / folder).rglob("*.py")):
        lines = path.read_text().splitlines()
        for node in ast.walk(ast.parse("\n".join(lines))):
            if not isinstance(node, ast.FunctionDef):
                continue
            names = [a.arg for a in (*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs)]
            head = lines[max(0, node.lineno - 2) : node.body[0].lineno]
            if len(names) - (names[:1] in (["self"], ["cls"])) > 8 and not any("# " in line for line in head):
                silent.append(f"{path.name}: {node.name}")
    assert not silent
