"""Ctrl-C during a run: it waits for the end of the macro step."""

from __future__ import annotations

import signal
import threading
from typing import Any

from exumob.support.processes import asked_to_stop


class StopRequest:
    """Ctrl-C waits for the end of the macro step, so that nothing is left half done; a second one does not."""

    def __init__(self) -> None:
        self._asked = False
        self._before: Any = None

    def __enter__(self) -> None:
        if threading.current_thread() is threading.main_thread():
            self._before = signal.getsignal(signal.SIGINT)
            if self._before is signal.default_int_handler:
                signal.signal(signal.SIGINT, self._ask)
        asked_to_stop.append(self._ask)

    def __exit__(self, *_: object) -> None:
        asked_to_stop.remove(self._ask)
        if self._before is signal.default_int_handler:
            signal.signal(signal.SIGINT, self._before)

    def _ask(self, number: int, frame: Any) -> None:
        if self._asked:
            raise KeyboardInterrupt
        self._asked = True

    def check(self) -> None:
        """Stop now if asked to."""
        if self._asked:
            raise KeyboardInterrupt
