"""Compiled kernels kept between test sessions, without those that a change has made stale.

Numba renews a kernel only when its own file changes, though it holds whatever it calls and every constant that it reads
in other files, too. Before a session, the kernels of every file that imports a changed one, at whatever distance, are
deleted.
"""

import ast
import hashlib
import json
import os
import stat
import tempfile
from pathlib import Path


def prepare(cache, package):
    """Delete what is stale in the folder `cache` of the kernels of `package` (a folder), and let Numba use the rest."""
    cache.mkdir(exist_ok=True, mode=0o700)
    place = cache.lstat()  # kernels are kept as pickles, which run what they hold
    if (
        not stat.S_ISDIR(place.st_mode)
        or (hasattr(os, "getuid") and place.st_uid != os.getuid())
        or place.st_mode & 0o022
    ):
        raise PermissionError(f"{cache} is a link, or others may write there: delete it")
    listed = cache / "digests.json"
    before = json.loads(listed.read_text()) if listed.exists() else {}
    now = {file.relative_to(package).as_posix(): digest for file, digest in digests(package).items()}
    for name in before:
        if now.get(name) != before[name]:
            for kernel in cache.glob(f"*/{Path(name).stem}.*.nb[ic]"):  # also of a namesake in another folder: no harm
                kernel.unlink(missing_ok=True)
    if now != before:
        number, new = tempfile.mkstemp(dir=cache)
        with open(number, "w") as stream:
            json.dump(now, stream, indent=1)
        os.replace(new, listed)


def digests(package):
    """Digest of every file with kernels and of all that it imports from the package."""
    files = sorted(package.rglob("*.py"))
    text = {file: file.read_bytes() for file in files}
    needs = {file: imported(text[file], file, package) for file in files}
    found = {}
    for file in files:
        if b"numba" not in text[file]:
            continue
        reached, new = set(), {file}
        while new:
            reached |= new
            new = set().union(*(needs[one] for one in new)) - reached
        found[file] = hashlib.sha256(b"\0".join(text[one] for one in sorted(reached))).hexdigest()
    return found


def imported(text, file, package):
    """Files of the package that a file imports by name, at its top or within functions."""
    found = set()
    for node in ast.walk(ast.parse(text, str(file))):
        if isinstance(node, ast.Import):
            found |= {place(alias.name, package) for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            for alias in node.names:  # a module of a package, or else a name in one
                found.add(place(f"{node.module}.{alias.name}", package) or place(node.module, package))
    return found - {None}


def place(name, package):
    """File of the module of this name, if it is one of the package's."""
    path = package.parent.joinpath(*name.split("."))
    for file in (path.with_suffix(".py"), path / "__init__.py"):
        if file.is_relative_to(package) and file.is_file():
            return file
    return None
