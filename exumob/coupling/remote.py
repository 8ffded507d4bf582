"""A flow code in another process, or on another machine, as `FlowCode`: messages over a socket.

The messages
------------
Each is four bytes, the length as unsigned big-endian integer, then so many bytes of JSON (UTF-8): one object. The
vehicle asks, the flow code answers each question with one message, in order. Numbers are written with all digits, so
that the same state gives the same bits. Units, axes and order of bodies: `FlowCode`.

| question | answer |
|---|---|
| `{"do": "start", "vehicle": {...}, "water": {...}, "poses": P, "time": t}` | `{}` |
| `{"do": "advance", "time": t, "poses": P}` | `{"loads": [[Fx, Fy, Fz, Mx, My, Mz], ...], "report": {name: number}}` |
| `{"do": "save"}` | `{"state": anything}` |
| `{"do": "restore", "state": what save gave}` | `{}` |
| `{"do": "stop"}` | `{}`, then the code may end |

`vehicle` holds all fields of `exumob.vehicle.parameters.Vehicle`; `water` holds depth [m], density [kg/m^3] and
velocity [m/s], three components; `P` is `{"position": n x 3, "rotation": n x 3 x 3, "velocity": n x 3,
"angular_velocity": n x 3, "spin": n}`; `loads` are the mean wrenches on the n bodies. A code that cannot go on answers
`{"error": "why, and what to do"}`: as the answer to "start" this becomes a ValueError, to anything else a
SimulationError. Answers longer than 1 MiB, or 256 MiB for a state, end the run before they
are read; so do lists and objects nested deeper than 100, and a report of more than 1000 figures, of
changing names or of values that are not finite.

Neither side runs code of the other: messages are data. The connection is not encrypted and nobody is asked for a
password: use a tunnel (ssh -L) beyond machines that you trust.
"""

from __future__ import annotations

import json
import re
import socket
import struct
import time as clock
from dataclasses import fields
from typing import Annotated, Any

from exumob.coupling.reports import checked_loads, checked_report
from exumob.flow.poses import Poses
from exumob.support.arrays import Array
from exumob.support.declared import checked
from exumob.support.errors import SimulationError
from exumob.support.provenance import parameters_json
from exumob.support.quantities import Quantity, shown
from exumob.vehicle.parameters import Vehicle
from exumob.water.conditions import Water

LENGTH = struct.Struct(">I")
LONGEST_ANSWER = 1 << 20
"""Longest answer with loads and figures that is accepted [bytes]."""
LONGEST_STATE = 1 << 28
"""Longest saved state that is accepted [bytes]; a code with larger ones keeps them in files and sends their names."""
DEEPEST = 100
"""Deepest nesting of lists and objects in a message."""
LONGEST_REASON = 500
"""Longest part of an answer's "error" that is shown [characters]."""


class RemoteFlow:
    """A flow code that listens at an address.

    Parameters
    ----------
    host : str
    port : int
    timeout : float
        Longest wait for one answer [s]; a flow step may take long.
    parameters : dict, optional
        Description of the code and its settings: kept in results and compared when a run is resumed.
    """

    @checked
    def __init__(
        self,
        host: str = "localhost",
        port: Annotated[int, Quantity("1", at_least=1, at_most=65535)] = 5005,
        *,
        timeout: Annotated[float, Quantity("s", above=0.0, at_most=1e7)] = 3600.0,
        parameters: dict[str, Any] | None = None,
    ) -> None:
        self.address, self.timeout = (host, port), timeout
        self.parameters = parameters or {}
        self._socket: socket.socket | None = None
        self._report: dict[str, float] = {}
        self._names: list[str] | None = None

    def start(self, vehicle: Vehicle, water: Water, poses: Poses, time: float) -> None:
        """See `FlowCode`.

        Raises
        ------
        ValueError
            If nothing listens at the address, or the code refuses.
        """
        if self._socket is None:
            try:
                self._socket = socket.create_connection(self.address, self.timeout)
                self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)  # small messages, at once
            except (OSError, UnicodeError) as error:
                host, port = self.address
                raise ValueError(
                    f"RemoteFlow: no flow code answers at {host}:{port} ({error}); start it first, or give its address."
                ) from None
        self._names = None
        question = {
            "vehicle": json.loads(parameters_json({"vehicle": vehicle}))["vehicle"]["Vehicle"],
            "water": {"depth": water.uniform_depth, "density": water.density, "velocity": water.velocity.tolist()},
            "poses": _as_lists(poses), "time": time,
        }  # fmt: skip
        try:
            self._ask("start", **question)
        except SimulationError as error:
            raise ValueError(str(error)) from None

    def advance(self, time: float, poses: Poses) -> Array:
        """See `FlowCode`."""
        answer = self._ask("advance", time=time, poses=_as_lists(poses))
        loads = checked_loads("RemoteFlow", answer.get("loads"), len(poses.position), time)
        self._report = checked_report("RemoteFlow", answer.get("report", {}), self._names)
        self._names = sorted(self._report)
        return loads

    def save(self) -> Any:
        """See `FlowCode`; as text, so that it can be anything that JSON can hold."""
        answer = self._ask("save")
        if "state" not in answer:
            raise SimulationError(
                "RemoteFlow: the answer to 'save' holds no \"state\"; send one, null if there is none."
            )
        return json.dumps(answer["state"])

    def restore(self, saved: Any) -> None:
        """See `FlowCode`."""
        self._ask("restore", state=json.loads(saved))

    def report(self) -> dict[str, float]:
        """Return the figures that the code reported with its last advance."""
        return self._report

    def close(self) -> None:
        """Tell the code that it may end, and close the connection."""
        if self._socket is not None:
            try:
                self._ask("stop")
            except SimulationError:
                pass  # it has ended already
            self._lose()

    def _ask(self, what: str, **question: Any) -> dict[str, Any]:
        """Send a question and return its answer; SimulationError if the code is lost or answers with an error."""
        if self._socket is None:
            raise SimulationError("RemoteFlow: not connected; call start first.")
        try:
            self._socket.settimeout(self.timeout)
            send(self._socket, {"do": what, **question})
            longest = LONGEST_STATE if what == "save" else LONGEST_ANSWER
            answer = receive(self._socket, longest, self.timeout)
        except TimeoutError:
            self._lose()
            raise SimulationError(
                f"RemoteFlow: the flow code gave no answer to {what!r} within {self.timeout:g} s; give a longer "
                "timeout, or look what holds it up."
            ) from None
        except (OSError, EOFError, ValueError, RecursionError, OverflowError) as error:
            self._lose()
            raise SimulationError(f"RemoteFlow: the flow code was lost during {what!r}: {error}") from None
        if "error" in answer:
            raise SimulationError(f"RemoteFlow: {_reason(answer['error'])}")
        return answer

    def _lose(self) -> None:
        """Close a connection on which question and answer no longer fit together."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None


def send(stream: socket.socket, message: dict[str, Any]) -> None:
    """Write one message."""
    text = json.dumps(message).encode()
    stream.sendall(LENGTH.pack(len(text)) + text)


def receive(
    stream: socket.socket, longest: int = LONGEST_STATE, timeout: float | None = None
) -> dict[str, Any]:  # fmt: skip
    """Read one message of at most `longest` bytes, the whole of it within `timeout` [s] if that is given.

    Raises
    ------
    EOFError
        If the other side has gone.
    TimeoutError
        If it takes longer.
    ValueError
        If the message is longer, or is not one JSON object.
    """
    end = None if timeout is None else clock.monotonic() + timeout
    (length,) = LENGTH.unpack(_read_bytes(stream, LENGTH.size, end))
    if length > longest:
        raise ValueError(f"a message of {length} bytes is longer than {longest}; is this the right port?")
    text = _read_bytes(stream, length, end)
    if _depth(text) > DEEPEST:
        raise ValueError(f"a message is nested deeper than {DEEPEST}")
    try:
        message = json.loads(text)
    except ValueError as error:  # of JSON, or of the encoding
        raise ValueError(f"a message is not JSON ({error}); it begins with {shown(text[:40])}") from None
    if not isinstance(message, dict):
        raise ValueError(f"a message is {shown(message)}; it must be one JSON object")
    return message


_MARKS = re.compile(rb'"[^"\\]*+(?:\\.[^"\\]*+)*+"?|[\[{\]}]', re.DOTALL)
"""Strings, and brackets outside them."""


def _depth(text: bytes) -> int:
    """Deepest nesting of lists and objects in a text; brackets within strings do not count."""
    if text.count(b"[") + text.count(b"{") <= DEEPEST:
        return 0
    level = deepest = 0
    for found in _MARKS.finditer(text):
        mark = found[0]
        if mark in (b"[", b"{"):
            level += 1
            deepest = max(deepest, level)
        elif mark in (b"]", b"}"):
            level -= 1
    return deepest


def _reason(found: Any) -> str:
    """What an answer gives as its error, on one line."""
    text = " ".join(found.split()) if isinstance(found, str) else shown(found)
    if not text:
        return "the flow code answers with an error, and does not say which; look at its own messages."
    return text if len(text) <= LONGEST_REASON else f"{text[:LONGEST_REASON]} ... ({len(text)} characters)"


def _read_bytes(stream: socket.socket, count: int, end: float | None) -> bytes:
    """Read so many bytes, however they arrive; EOFError if the connection ends before, TimeoutError after `end`."""
    parts = bytearray()
    while len(parts) < count:
        if end is not None:
            left = end - clock.monotonic()
            if left <= 0.0:
                raise TimeoutError
            stream.settimeout(left)
        part = stream.recv(min(count - len(parts), 1 << 20))
        if not part:
            raise EOFError("the connection was closed")
        parts += part
    return bytes(parts)


def _as_lists(poses: Poses) -> dict[str, Any]:
    """Return the fields of poses as nested lists, for JSON."""
    return {f.name: getattr(poses, f.name).tolist() for f in fields(Poses)}
