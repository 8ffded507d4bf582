"""What a run takes, told before it begins: memory, disk and time, beside what this machine has.

Estimates come from the parts that know their size (`exumob.flow.cost`, `exumob.simulation.cost`); here they are put in
words, and refused where they cannot fit. Nothing is allocated for it.
"""

from __future__ import annotations

import logging
import math
import os
import shutil
from pathlib import Path

logger = logging.getLogger(__name__)

WORTH_SAYING = 20.0
"""Time from which a run says beforehand what it takes [s]."""
LONG = 600.0
"""Time from which it says so as a warning, which Python shows by default [s]."""
MOST_FRAMES = 20_000
"""Frames of an animation; half an hour at 12 a second."""
TIME_PER_FRAME = 0.1
"""Time to draw one [s]."""
NOTED = 1.4
"""How many times longer work takes beside other programs from which that is said [-]."""
CONTROL_GROUPS = Path("/sys/fs/cgroup")
UNITS = ((365.25 * 86400.0, "years"), (86400.0, "days"), (3600.0, "h"), (60.0, "min"))


def memory_limit() -> float:
    """Return the memory that this process may use [bytes]: the machine's, or less in a container; inf if unknown."""
    limits = [_physical_memory(), *_control_group_limits()]
    try:
        import resource

        limits += [float(n) for n in resource.getrlimit(resource.RLIMIT_AS) if n != resource.RLIM_INFINITY]
    except (ImportError, OSError):  # Windows
        pass
    return min(limits)


def _physical_memory() -> float:
    try:
        return float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    except (AttributeError, ValueError, OSError):  # Windows, and systems that do not tell
        return math.inf


def _control_group_limits() -> list[float]:
    """Limits [bytes] of the control groups that hold this process: containers and batch systems set them."""
    found = []
    try:
        groups = [line.split(":", 2) for line in Path("/proc/self/cgroup").read_text().splitlines()]
    except (OSError, UnicodeDecodeError):
        return []
    for _, controllers, place in (group for group in groups if len(group) == 3):
        if controllers and "memory" not in controllers.split(","):
            continue
        root, name = (CONTROL_GROUPS / "memory", "memory.limit_in_bytes") if controllers else (
            CONTROL_GROUPS, "memory.max"
        )  # fmt: skip
        folder = root / place.lstrip("/")
        for level in (folder, *folder.parents):
            try:
                found.append(float((level / name).read_text()))
            except (OSError, ValueError):  # no such file; "max"
                pass
            if level == root:
                break
    return found


def cores() -> int:
    """Return the number of cores that this process may use."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:  # macOS, Windows
        return os.cpu_count() or 1


def spelled_time(seconds: float) -> str:
    """Return a time in words, as "3.5 h"."""
    for unit, name in UNITS:
        if seconds >= unit:
            return f"{seconds / unit:.2g} {name}" if seconds < 99.5 * unit else f"{seconds / unit:,.0f} {name}"
    return f"{max(seconds, 1.0):.0f} s"


def expected_time(seconds: float, processes: int = 1) -> str:
    """Return in words what work will take on this machine, and what beside the programs that are at work on it now.

    Parameters
    ----------
    seconds : float
        Time that it takes where nothing else runs [s].
    processes : int
        Number of processes that will be at work on it.
    """
    number = cores()
    text = f"about {spelled_time(seconds)}, if no other program takes its share of the {number} core"
    text += "s" if number > 1 else ""
    slower = (_busy() + processes) / max(number, processes)
    return f"{text} (about {spelled_time(slower * seconds)} beside those at work now)" if slower > NOTED else text


def _busy() -> float:
    """Number of processes that were at work in the last minute; 0 if the system does not tell."""
    try:
        return os.getloadavg()[0]
    except (AttributeError, OSError):  # Windows
        return 0.0


def spelled_size(number: float) -> str:
    """Return a number of bytes in words, as "0.21 GiB"."""
    size = number / 2**30
    if not size < 1e6:
        return f"{size:.2g} GiB" if math.isfinite(size) else "more GiB than can be counted"
    return f"{size:,.0f} GiB" if size >= 99.5 else f"{size:.2g} GiB" if size >= 0.1 else f"{number / 2**20:.2g} MiB"


def require_memory(what: str, needed: float, remedy: str) -> None:
    """Refuse what cannot fit into memory.

    Parameters
    ----------
    what : str
        What needs it, with the values that decide.
    needed : float
        [bytes]
    remedy : str
        What to do instead.

    Raises
    ------
    ValueError
        If this process may not use as much.
    """
    limit = memory_limit()
    if not needed <= limit:
        raise ValueError(
            f"{what}: about {spelled_size(needed)} of memory, and this machine has {spelled_size(limit)}; {remedy}"
        )


def require_disk(what: str, needed: float, folder: Path, remedy: str) -> None:
    """Refuse what cannot fit on the disk of a folder; see `require_memory`."""
    try:
        free = shutil.disk_usage(folder).free
    except OSError:  # not there yet, or no right to look: whoever writes says so
        return
    if needed > free:
        raise ValueError(
            f"{what}: up to {spelled_size(needed)} on the disk of {folder}, where {spelled_size(free)} are free; "
            f"{remedy}"
        )


def require_frames(what: str, frames: int, pixels: int, remedy: str) -> None:
    """Refuse an animation that cannot be drawn: all frames of a GIF are in memory at once.

    Parameters
    ----------
    what : str
        The function that draws it.
    frames : int
        Number of frames.
    pixels : int
        Pixels of one.
    remedy : str
        What to do instead.

    Raises
    ------
    ValueError
        If memory cannot hold the frames, or there are more than `MOST_FRAMES`.
    """
    require_memory(f"{what}: {frames:,} frames", 8.0 * frames * pixels, remedy)
    if frames > MOST_FRAMES:
        raise ValueError(
            f"{what}: {frames:,} frames would take about {spelled_time(frames * TIME_PER_FRAME)} to draw, more than "
            f"{MOST_FRAMES:,} are not drawn; {remedy}"
        )


def announce(text: str, seconds: float = 0.0) -> None:
    """Say what a run will take; as a warning if that is long, not at all if it is short.

    The command line shows it always, Python by default only the warnings (`logging`).
    """
    if seconds >= WORTH_SAYING:
        logger.log(logging.WARNING if seconds >= LONG else logging.INFO, "%s", text)
