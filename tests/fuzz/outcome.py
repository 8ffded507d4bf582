"""What a call answers: accepted, clearly refused, unclear, silent or hanging."""

from __future__ import annotations

import math
import re
import resource
import signal
import threading
import time
import traceback
import warnings
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from exumob.support.errors import SimulationError

KINDS = ("accepted", "clear", "unclear", "silent", "hang")
PACKAGE = Path(__file__).parents[2] / "exumob"
TIME_LIMIT = 20.0
"""Of one call [s of this process's computing]; in six times as much it must have ended on a busy machine, too"""
MEMORY = 6 * 2**30
"""That a call may take beyond what the process has [bytes]"""
REMEDY = re.compile(
    r"\b(must|give|use|choose|leave|fill|is it in|did you mean|write|mend|check|steer less|move|round|raise|lower|"
    r"install|create|remove|sort|shift|ramp|add|pick|start|look|name|try|delete|make|turn|put|take|keep|wait|stop|"
    r"allow|exchange|widen|needs?|lies|want|set|reduce|shorten|lengthen|increase|load|run|accept|draw|save|"
    r"wants?|exchange|within|if it is meant|makes?|holds|does not exist|close|lists?|it has|halve|soften|export|"
    r"at line \d+|at end of document)\b|outside \[",
    re.IGNORECASE,
)
"""Words of a remedy, or of what is wanted"""


class Outcome(NamedTuple):
    """Answer of a call."""

    kind: str
    """One of `KINDS`"""
    detail: str = ""
    """The message, or what is wrong with the answer"""

    @property
    def fine(self) -> bool:
        """Whether a user is left with a result or with a clear word."""
        return self.kind in ("accepted", "clear")


class Reached(BaseException):
    """The call has passed all checks and would begin to compute; no `except Exception` may swallow it."""


class _TooLong(BaseException):
    pass


class Silent(Exception):
    """Raised by a verification: the answer was accepted, and is wrong."""


def outcome_of(
    call: Callable[[], Any], names: Iterable[str], *, refused: bool = False, verify: Callable[[Any],
    None] | None = None,
    clear: tuple[type[BaseException], ...] = (ValueError, SimulationError), time_limit: float = TIME_LIMIT,
) -> Outcome:  # fmt: skip
    """Call, and classify the answer.

    Parameters
    ----------
    call : callable
    names : iterable of str
        One of them must stand in the text of an error, or it is unclear.
    refused : bool
        The input has no meaning: to accept it is silent nonsense.
    verify : callable, optional
        Takes what was returned; raises `Silent` if it is wrong.
    clear : tuple of exception types
        Those that may say no.
    time_limit : float
        Computing time beyond which it hangs [s].
    """
    began = time.process_time()
    try:
        with warnings.catch_warnings(), _limits(time_limit):
            warnings.simplefilter("error")
            try:
                found = call()
            except Reached:
                found = None
            if refused:
                return Outcome("silent", "an impossible value was accepted")
            if verify is not None and found is not None:
                verify(found)
    except _TooLong:
        return Outcome("hang", f"after {time_limit:g} s at\n{_place_of_hang()}")
    except Silent as error:
        return Outcome("silent", str(error))
    except BaseException as error:
        if isinstance(error, KeyboardInterrupt):
            raise
        return _refusal(error, names, clear)
    if time.process_time() - began > time_limit:  # within compiled code, which no signal ends
        return Outcome("hang", f"{time.process_time() - began:.1f} s")
    return Outcome("accepted")


def _refusal(error: BaseException, names: Iterable[str], clear: tuple[type[BaseException], ...]) -> Outcome:
    text = str(error)
    where = Path(traceback.extract_tb(error.__traceback__)[-1].filename) if error.__traceback__ else Path()
    fault = ""
    if not isinstance(error, clear):
        fault = "raised"
    elif not where.is_relative_to(PACKAGE) or type(error) is AssertionError:
        fault = f"raised by {'/'.join(where.parts[-3:])}"
    elif not any(names_it(name, text) for name in names):
        fault = f"names none of {', '.join(names)}"
    elif not REMEDY.search(text):
        fault = "no remedy"
    elif len(text) > 2000:
        fault = f"{len(text)} characters long"
    short = text if len(text) < 400 else text[:400] + "..."
    if not fault:
        return Outcome("clear", f"{type(error).__name__}: {short}")
    frames = [
        f"{Path(frame.filename).name}:{frame.lineno} {frame.name}"
        for frame in traceback.extract_tb(error.__traceback__)
    ]
    return Outcome("unclear", f"{fault}: {type(error).__name__}: {short}  [{' < '.join(frames[::-1][:4])}]")


def names_it(name: str, text: str) -> bool:
    """Whether a text holds a name as a word."""
    return re.search(rf"(?<![A-Za-z0-9]){re.escape(name)}(?![A-Za-z0-9])", text) is not None


_hung_at = [""]


def _place_of_hang() -> str:
    return _hung_at[0]


@contextmanager
def _limits(seconds: float) -> Iterator[None]:
    """End a call that takes too long, and refuse it memory that this machine may not have."""

    def too_long(number: int, frame: Any) -> None:
        _hung_at[0] = "".join(traceback.format_stack(frame)[-6:])
        raise _TooLong

    main = threading.current_thread() is threading.main_thread()
    timers = ((signal.SIGPROF, signal.ITIMER_PROF, seconds), (signal.SIGALRM, signal.ITIMER_REAL, 6.0 * seconds))
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    with open("/proc/self/statm") as file:
        most = int(file.read().split()[0]) * resource.getpagesize() + MEMORY
    if hard != resource.RLIM_INFINITY:
        most = min(most, hard)
    resource.setrlimit(resource.RLIMIT_AS, (most, hard))
    before = {number: signal.signal(number, too_long) for number, _, _ in timers if main}
    for _, timer, limit in timers if main else ():
        signal.setitimer(timer, limit)
    try:
        yield
    finally:
        for number, timer, _ in timers if main else ():
            signal.setitimer(timer, 0.0)
            signal.signal(number, before[number])
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))


def finite(where: str, value: Any) -> None:
    """Raise `Silent` if a number or an array is not finite."""
    import numpy as np

    if isinstance(value, int | float):
        good = math.isfinite(value)
    else:
        good = bool(np.isfinite(np.asarray(value, dtype=float)).all())
    if not good:
        raise Silent(f"{where} is not finite: {value!r:.200}")
