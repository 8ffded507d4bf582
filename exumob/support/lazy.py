"""Packages that import what they export when it is first used.

A package lists what it exports as imports for type checkers alone, and those are what is done on first use: each name
stands once, where mypy, editors and `tests/unit/test_layers.py` read it, too.
"""

from __future__ import annotations

import importlib
import importlib.util
import sys
from collections.abc import Callable
from functools import cache
from typing import Any


def on_first_use(package: str) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """Return ``__getattr__`` and ``__dir__`` of a package that imports its public names on first use (PEP 562).

    The names are those that the package imports under ``if TYPE_CHECKING:``. Its modules are found as attributes, too,
    as if they had been imported.

    Parameters
    ----------
    package : str
        Its name; it has a literal ``__all__``.

    Raises
    ------
    ImportError
        On first use of a name, if the source of the package is not installed.
    """
    module = sys.modules[package]

    @cache
    def places() -> dict[str, tuple[str, str]]:
        """Names with the modules that define them, and their names there."""
        import ast  # only where a name is used: the help of the command line needs none

        read = getattr(getattr(module.__spec__, "loader", None), "get_source", None)
        source = None if read is None else read(package)
        if source is None:
            raise ImportError(f"the source of {package}/__init__.py is missing; install exumob with its .py files.")
        return {
            alias.asname or alias.name: (found.module, alias.name)
            for block in ast.parse(source).body
            if isinstance(block, ast.If) and isinstance(block.test, ast.Name) and block.test.id == "TYPE_CHECKING"
            for found in block.body
            if isinstance(found, ast.ImportFrom) and found.module is not None
            for alias in found.names
        }

    def find(name: str) -> Any:
        if not name.startswith("_") or name in vars(module).get("__all__", ()):
            if name in places():
                origin, original = places()[name]
                value = getattr(importlib.import_module(origin), original)
                setattr(module, name, value)  # found at once from now on
                return value
            if importlib.util.find_spec(f"{package}.{name}") is not None:
                return importlib.import_module(f"{package}.{name}")
        raise AttributeError(f"module {package!r} has no attribute {name!r}", name=name, obj=module)

    def names() -> list[str]:
        return sorted({*vars(module), *module.__all__})

    return find, names
