"""Kernels compiled by Numba, kept on the disk until something that they hold has changed."""

from __future__ import annotations

import functools
import hashlib
import inspect
import logging
import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba

logger = logging.getLogger(__name__)

PACKAGE = Path(__file__).parents[1]
IMPORT = re.compile(
    rf"^[ \t]*(?:from|import)[ \t]+({PACKAGE.name}(?:\.\w+)*)(?:[ \t]+import[ \t]+(\([^)]*\)|[^\n]*))?".encode(), re.M
)


def njit(**options: Any) -> Callable[[Callable[..., Any]], Any]:
    """Compile a function of this package as ``numba.njit`` does, with a ``cache`` that knows what a kernel calls.

    A compiled kernel holds whatever it calls, and every constant that it reads, in other files, too. Numba takes it for
    fresh as long as its own file is the same: after an upgrade or an edit of another file the old code would run
    without a word. Here it is compiled again when its file or one that this imports, at whatever distance, differs.

    Parameters
    ----------
    **options
        Those of ``numba.njit``.

    Returns
    -------
    callable
        The decorator.
    """
    kept = options.pop("cache", False)

    def decorate(function: Callable[..., Any]) -> Any:
        kernel = numba.njit(**options)(function)
        if kept and kernel is not function:  # plain Python if NUMBA_DISABLE_JIT is set
            cache = _cache(function)
            if cache is not None:
                kernel._cache = cache
        return kernel

    return decorate


def _cache(function: Callable[..., Any]) -> Any:
    """Return Numba's cache for a function, with a stamp of ours; none if this Numba has no place for the stamp."""
    try:
        cache = _cache_class()(function)
        if cache._cache_file._source_stamp == cache._impl.stamp:
            return cache
    except (ImportError, AttributeError, TypeError):  # all of this is private to Numba, which may change it
        pass
    _say_not_kept()
    return None


@functools.cache
def _cache_class() -> Any:
    from numba.core.caching import CompileResultCacheImpl, FunctionCache

    class Implementation(CompileResultCacheImpl):
        def __init__(self, function: Callable[..., Any]) -> None:
            super().__init__(function)  # finds the folder, whichever way Numba and its settings want it
            self.stamp = sources_stamp(Path(inspect.getfile(function))) or self.locator.get_source_stamp()
            self.locator.get_source_stamp = lambda: self.stamp

    class SourcesCache(FunctionCache):
        _impl_class = Implementation

    return SourcesCache


@functools.cache
def _say_not_kept() -> None:
    logger.warning(
        "numba %s keeps compiled kernels in a way that exumob does not know: each process compiles its own (minutes "
        "for the flow solver); use an older numba, or a newer exumob.",
        numba.__version__,
    )


# -- what a kernel may hold --------------------------------------------------------------------------------------------

_stamps: dict[str, tuple[object, str]] = {}
_sources: dict[str, tuple[object, bytes, set[str]]] = {}


def sources_stamp(file: Path) -> str:
    """Return a digest of a file of this package and of all its files that it imports, at whatever distance.

    It is of the sources as they were when their modules were loaded, or nearly so: a module loaded anew is read anew.

    Parameters
    ----------
    file : path
        The file.

    Returns
    -------
    str
        The digest; of the whole archive if the package is imported from one. Empty if there is no such file (a program
        frozen into one executable).
    """
    if not file.is_file():
        return _archive_digest(file)
    parts = file.relative_to(PACKAGE.parent).with_suffix("").parts
    first = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
    known = _stamps.get(first)
    if known is not None and known[0] is _loaded(first):
        return known[1]
    reached: dict[str, bytes] = {}
    new = {first}
    while new:
        found = {name: _source(name) for name in new}
        reached |= {name: digest for name, (digest, _) in found.items()}
        new = set().union(*(imported for _, imported in found.values())) - reached.keys()
    stamp = hashlib.sha256(repr(sorted(reached.items())).encode()).hexdigest()
    _stamps[first] = (_loaded(first), stamp)
    return stamp


def _loaded(name: str) -> object:
    """Return what changes whenever a module is loaded (`importlib.reload`); none before."""
    return getattr(sys.modules.get(name), "__spec__", None)


def _source(name: str) -> tuple[bytes, set[str]]:
    """Return the digest of a module's file, and the modules of this package that it imports."""
    known = _sources.get(name)
    if known is None or known[0] is not _loaded(name):
        file = _file(name)
        text = b"" if file is None else file.read_bytes()
        known = _sources[name] = (_loaded(name), hashlib.sha256(text).digest(), _imported(text))
    return known[1:]


def _imported(text: bytes) -> set[str]:
    found = set()
    for module, names in IMPORT.findall(text):  # much faster than a parser
        name = module.decode()
        found.add(name)
        if names and PACKAGE.parent.joinpath(*name.split(".")).is_dir():  # a package: some may be its modules
            found |= {f"{name}.{part}" for part in re.findall(r"\w+", names.decode())}
    return {name for name in found if _file(name) is not None}


def _file(name: str) -> Path | None:
    path = PACKAGE.parent.joinpath(*name.split("."))
    return next((file for file in (path.with_suffix(".py"), path / "__init__.py") if file.is_file()), None)


@functools.cache
def _archive_digest(file: Path) -> str:
    archive = next((folder for folder in file.parents if folder.is_file()), None)
    return "" if archive is None else hashlib.sha256(archive.read_bytes()).hexdigest()
