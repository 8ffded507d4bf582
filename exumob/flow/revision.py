"""Which flow solver computed a run: a digest of its sources, as runs of two solvers are not alike."""

from __future__ import annotations

import hashlib
from pathlib import Path

from exumob.support.files import PACKAGE


def solver_revision(*further: str, package: Path = PACKAGE) -> str:
    """Return a digest of all sources of the flow solver; what only draws or writes a flow is left out.

    Parameters
    ----------
    further : str
        Folders of the package whose sources count as well.
    package : Path
        Folder of the package.
    """
    digest = hashlib.sha256()
    for file in sorted(file for folder in ("flow", *further) for file in (package / folder).rglob("*.py")):
        place = file.relative_to(package).as_posix()
        if not place.startswith("flow/output/") and file.name not in ("plots.py", "cost.py", "revision.py"):
            digest.update(place.encode() + file.read_bytes())
    return digest.hexdigest()[:12]
