"""The state of a run in one file, from which it goes on: arrays under their names and a text that holds them together.

A file is an uncompressed numpy archive (.npz): every array under its own name, and one text, JSON, that says how they
hang together and what run they belong to, with a digest of all. No pickle: a file from elsewhere can do no harm. It is
written under another name and then renamed, so that a killed run leaves the last whole one. What is damaged is refused.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from exumob.support.files import CHECKPOINTS, atomic_write, require_ending, require_writable
from exumob.support.identity import differences

HEAD = "contents"
"""Name of the JSON text in the archive."""
ROOM = 4_000_000
"""Room that a folder must have for a first checkpoint [bytes]; those of the flow are larger, which only shows later."""


@dataclass(frozen=True)
class Fingerprint:
    """Texts that tell one run from another, by part: a saved state fits only a run with the same."""

    parts: dict[str, str]

    def differences(self, other: dict[str, str]) -> list[str]:
        """Names of the parts that differ; of forces also what of them."""
        found = [name for name in self.parts if self.parts[name] != other.get(name)]
        if "forces" in found:
            with contextlib.suppress(KeyError, TypeError, ValueError, AttributeError):  # of a damaged file
                said = differences(json.loads(other["forces"]), json.loads(self.parts["forces"]))
                found[found.index("forces")] = f"forces ({said})"
        return found


def write(file: Path, step: int, tree: dict[str, Any], fingerprint: Fingerprint, elapsed: float = 0.0) -> None:
    """Write a tree of dicts, lists, arrays, numbers and text, whole or not at all; `elapsed` [s] is what it took."""
    arrays: dict[str, np.ndarray] = {}
    head = {"step": step, "fingerprint": fingerprint.parts, "elapsed": elapsed, "tree": _taken_apart(tree, "", arrays)}
    head["digest"] = _digest(json.loads(json.dumps(head)), arrays)
    with atomic_write(file) as temporary, temporary.open("wb") as stream:
        np.savez(stream, allow_pickle=False, **{HEAD: np.array(json.dumps(head))}, **arrays)


def read(file: Path) -> tuple[int, dict[str, Any]]:
    """Return the number of steps done (of a vehicle that is not released yet -1), and the tree given to `write`.

    Raises
    ------
    ValueError
        If the file is damaged, or not what `write` has written.
    """
    with opened(file) as archive:
        head = head_of(file, archive)
        arrays = {name: archive[name] for name in archive.files if name != HEAD}
        if head.pop("digest", None) != _digest(head, arrays):
            refuse(file, "it is not what was written: its digest differs")
        tree: dict[str, Any] = _put_together(head["tree"], arrays)
    return head["step"], tree


def _digest(head: dict[str, Any], arrays: dict[str, np.ndarray]) -> str:
    """Digest of all that a checkpoint holds."""
    found = hashlib.sha256(json.dumps(head, sort_keys=True).encode())
    for name in sorted(arrays):
        array = np.ascontiguousarray(arrays[name])
        found.update(f"{name} {array.dtype.str} {array.shape}".encode())
        found.update(array.reshape(-1).view(np.uint8).data if array.size else b"")
    return found.hexdigest()


def require_place(file: Path) -> None:
    """Raise ValueError if the file cannot be written, before anything runs."""
    require_ending("checkpoint", file, CHECKPOINTS)
    if not file.parent.is_dir():
        raise ValueError(f"checkpoint {file}: the folder {file.parent} does not exist; create it first.")
    if file.is_dir():
        raise ValueError(f"checkpoint {file}: this is a folder; give a file name.")
    try:
        require_writable(file, max(ROOM, file.stat().st_size if file.exists() else 0))
    except (OSError, ValueError) as error:
        raise ValueError(f"checkpoint {error}") from None


@contextmanager
def opened(file: Path) -> Iterator[Any]:
    """Open an archive whose members are whole; whatever goes wrong in it is a ValueError that names the file."""
    try:
        with file.open("rb") as stream:
            archive = np.load(stream, allow_pickle=False)
            if not isinstance(archive, np.lib.npyio.NpzFile) or archive.zip is None:
                raise _Damaged("it is no numpy archive")
            if any(member.compress_type != zipfile.ZIP_STORED for member in archive.zip.infolist()):
                raise _Damaged("it is compressed, which ours are not")
            bad = archive.zip.testzip()  # before any array is made of what may be damaged
            if bad is not None:
                raise _Damaged(f"the checksum of its part {bad} is wrong")
            yield archive
    except OSError as error:
        if isinstance(error, FileNotFoundError | PermissionError):
            raise ValueError(f"checkpoint {file} cannot be opened ({error.strerror}); give another file.") from None
        refuse(file, str(error))
    except _Refused:
        raise
    except Exception as error:  # of zipfile, zlib and numpy: a dozen kinds, for whatever is wrong inside
        if "pickle" in str(error):  # numpy's advice, to load it all the same, is bad advice for a file from elsewhere
            error = _Damaged("it holds Python objects, or is no numpy archive")
        refuse(file, str(error) if isinstance(error, _Damaged) else f"{type(error).__name__}: {error}")


class _Damaged(Exception):
    """What is wrong with a file."""


class _Refused(ValueError):
    """A file is refused, and the message says why."""


def refuse(file: Path, why: str) -> NoReturn:
    """Raise ValueError for a file that cannot be read, with the remedy."""
    raise _Refused(
        f"checkpoint {file} cannot be read ({' '.join(why.split())[:300]}); it is damaged, cut off or of another kind; "
        "move it away and begin anew."
    ) from None


def head_of(file: Path, archive: Any) -> dict[str, Any]:
    """Return what the archive says of itself, its kinds checked."""
    if HEAD not in archive.files:
        raise _Refused(f"checkpoint {file} is not one of exumob; give another file.")
    head = json.loads(str(archive[HEAD]))
    kinds = {"step": int, "fingerprint": dict, "elapsed": float, "tree": dict}
    wrong = [name for name, kind in kinds.items() if not isinstance(head, dict) or not isinstance(head.get(name), kind)]
    if wrong:
        refuse(file, f"its head has no right {', no right '.join(wrong)}")
    return dict(head)


def _taken_apart(value: Any, name: str, arrays: dict[str, np.ndarray]) -> Any:
    """JSON of a tree, its arrays put aside under names of their own."""
    if isinstance(value, np.ndarray):
        arrays[name] = value
        return {"array": name}
    if isinstance(value, dict):
        return {"dict": {key: _taken_apart(part, f"{name}/{key}", arrays) for key, part in value.items()}}
    if isinstance(value, list | tuple):
        return {"list": [_taken_apart(part, f"{name}/{n}", arrays) for n, part in enumerate(value)]}
    if isinstance(value, np.generic):
        value = value.item()
    if value is None or isinstance(value, bool | int | float | str):
        return {"plain": value}
    raise TypeError(f"checkpoint: {name} is a {type(value).__name__}; save() must give dicts, lists, arrays, numbers.")


def _put_together(node: Any, arrays: dict[str, np.ndarray]) -> Any:
    ((kind, value),) = node.items()
    if kind == "array":
        return arrays[value]
    if kind == "dict":
        return {key: _put_together(part, arrays) for key, part in value.items()}
    if kind == "list":
        return [_put_together(part, arrays) for part in value]
    return value
