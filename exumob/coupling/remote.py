"""A flow code in another process, or on another machine, as `FlowCode`: messages over a socket.

The messages
------------
Each is four bytes, the length as unsigned big-endian integer, then so many bytes of JSON (UTF-8): one object. The
vehicle asks, the flow code answers each question with one message, in order. Numbers are written with all digits, so
that the same state gives the same bits. Units, axes and order of bodies: `FlowCode`.

| question | answer |
|---|---|
| `{"do": "start", "version": 1, "vehicle": {...}, "water": {...}, "poses": P, "time": t}` | `{}` or `{"version": 1}` |
| `{"do": "advance", "time": t, "poses": P}` | `{"loads": [[Fx, Fy, Fz, Mx, My, Mz], ...], "report": {name: number}}` |
| `{"do": "save"}` | `{"state": anything}` |
| `{"do": "restore", "state": what save gave}` | `{}` |
| `{"do": "stop"}` | `{}`, then the code may end |

`vehicle` holds all fields of `exumob.vehicle.parameters.Vehicle`; `water` holds depth [m], density [kg/m^3] and
velocity [m/s], three components; `P` is `{"position": n x 3, "rotation": n x 3 x 3, "velocity": n x 3,
"angular_velocity": n x 3, "spin": n}`; `loads` are the mean wrenches on the n bodies. A code that cannot go on answers
`{"error": "why, and what to do"}`: as the answer to "start" this becomes a ValueError, to anything else a
SimulationError. So does an answer that is not of this form: loads must be 6 n finite numbers, a report must have the
same names each time, and a message may be as long as `LONGEST_ANSWER`, a saved state as `LONGEST_STATE`. Nothing that
arrives is run, and memory is taken as bytes arrive, up to these limits. The connection is neither encrypted nor
authenticated: keep it on one machine, or within a network or tunnel (ssh) that you trust.
"""

from __future__ import annotations

import json
import math
import socket
import struct
import time as clock
from dataclasses import fields
from typing import Annotated, Any

import numpy as np

from exumob.flow.poses import Poses
from exumob.support.arrays import Array
from exumob.support.declared import checked
from exumob.support.errors import SimulationError
from exumob.support.provenance import parameters_json
from exumob.support.quantities import Quantity, shown
from exumob.vehicle.parameters import Vehicle
from exumob.water.conditions import Water

LENGTH = struct.Struct(">I")
VERSION = 1
"""Version of the messages."""
LONGEST_ANSWER = 2**20
"""Longest answer that is accepted [bytes]; the loads of five bodies take about a thousand."""
LONGEST_STATE = 2**26
"""Longest saved state that is accepted [bytes]; a code with larger ones saves them in files and answers their names."""
MOST_REPORTED = 100
"""Largest number of figures in a report."""
PARTING = 10.0
"""Longest wait for the answer to "stop" [s]."""


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
        self, host: str = "localhost", port: Annotated[int, Quantity("1", at_least=1, at_most=65535)] = 5005, *,
        timeout: Annotated[float, Quantity("s", above=0.0, at_most=1e6)] = 3600.0,
        parameters: dict[str, Any] | None = None,
    ) -> None:  # fmt: skip
        self.address, self.timeout = (host, port), timeout
        self.parameters = parameters or {}
        self._socket: socket.socket | None = None
        self._report: dict[str, float] = {}
        self._report_names: list[str] | None = None

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
            except (OSError, UnicodeError) as error:  # also a host that cannot be a name
                host, port = self.address
                raise ValueError(
                    f"RemoteFlow: no flow code answers at {host}:{port} ({error}); start it first, or give its address."
                ) from None
        question = {
            "vehicle": json.loads(parameters_json({"vehicle": vehicle}))["vehicle"]["Vehicle"],
            "water": {"depth": water.depth, "density": water.density, "velocity": water.velocity.tolist()},
            "poses": _as_lists(poses), "time": time, "version": VERSION,
        }  # fmt: skip
        self._report, self._report_names = {}, None
        try:
            answer = self._ask("start", **question)
        except SimulationError as error:
            raise ValueError(str(error)) from None
        if answer.get("version", VERSION) != VERSION:
            self._leave()
            raise ValueError(
                f"RemoteFlow: the flow code speaks version {shown(answer['version'])} of the messages, and exumob "
                f"version {VERSION}; use versions of both that fit."
            )

    def advance(self, time: float, poses: Poses) -> Array:
        """See `FlowCode`."""
        answer = self._ask("advance", time=time, poses=_as_lists(poses))
        wrenches = _wrenches(answer.get("loads"), len(poses.position))
        report = _report(answer.get("report", {}))
        if self._report_names is None:
            self._report_names = list(report)
        if set(report) != set(self._report_names):
            raise SimulationError(
                f"RemoteFlow: the code reported {_listed(self._report_names)} at first and {_listed(list(report))} at "
                f"{time:g} s; it must always report the same."
            )
        self._report = {name: report[name] for name in self._report_names}
        return wrenches

    def save(self) -> Any:
        """See `FlowCode`; as text, so that it can be anything that JSON can hold."""
        answer = self._ask("save")
        if "state" not in answer:
            raise SimulationError("RemoteFlow: the answer to 'save' holds no state; it must be {'state': ...}.")
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
            self._leave()

    def _leave(self) -> None:
        """Close the connection without a word."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def _ask(self, what: str, **question: Any) -> dict[str, Any]:
        """Send a question and return its answer; SimulationError if the code is lost or answers with an error."""
        if self._socket is None:
            raise SimulationError("RemoteFlow: not connected; call start first.")
        wait = min(self.timeout, PARTING) if what == "stop" else self.timeout
        try:
            self._socket.settimeout(wait)
            send(self._socket, {"do": what, **question})
            answer = receive(self._socket, wait, LONGEST_STATE if what == "save" else LONGEST_ANSWER)
        except (OSError, EOFError, ValueError, RecursionError) as error:
            self._leave()  # what comes later would answer another question
            why = f"no answer within {wait:g} s" if isinstance(error, TimeoutError) else str(error)
            raise SimulationError(
                f"RemoteFlow: the flow code was lost during {what!r}: {why}. Look at its own messages, start it again, "
                "and resume the run from its checkpoint."
            ) from None
        if "error" in answer:
            text = answer["error"] if isinstance(answer["error"], str) else shown(answer["error"])
            raise SimulationError(f"RemoteFlow: {text[:2000]}")
        return answer


def _wrenches(loads: Any, bodies: int) -> Array:
    """Loads as an array, or SimulationError: what another program sends can be anything."""
    rows = loads if isinstance(loads, list) else []
    sound = len(rows) == bodies and all(isinstance(row, list) and len(row) == 6 for row in rows)
    if not sound:
        lengths = sorted({len(row) if isinstance(row, list) else 1 for row in rows})
        found = f"{len(rows)} rows of {' or '.join(map(str, lengths)) or 'no'} values" if rows else shown(loads)
        raise SimulationError(f"RemoteFlow: loads came back as {found}; they must be {bodies} rows of 6 numbers.")
    for body, row in enumerate(rows):
        for value in row:
            if not _is_number(value):
                raise SimulationError(
                    f"RemoteFlow: the loads on body {body} hold {shown(value)}; they must be finite numbers, forces "
                    "[N] and moments [N m]."
                )
    return np.array(rows, dtype=float)


def _report(given: Any) -> dict[str, float]:
    """Figures that were reported, or SimulationError."""
    if not isinstance(given, dict) or len(given) > MOST_REPORTED:
        what = f"{len(given)} figures" if isinstance(given, dict) else shown(given)
        raise SimulationError(
            f"RemoteFlow: the report is {what}; it must be {{name: number}}, at most {MOST_REPORTED}."
        )
    for name, value in given.items():
        if not (name.isidentifier() and len(name) <= 64) or not _is_number(value):
            raise SimulationError(
                f"RemoteFlow: the report holds {shown(name)}: {shown(value)}; it must be a name of letters, digits and "
                "underscores, and a finite number."
            )
    return {name: float(value) for name, value in given.items()}


def _is_number(value: Any) -> bool:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    try:
        return math.isfinite(value)
    except OverflowError:  # an int that is no float
        return False


def _listed(names: list[str]) -> str:
    return ", ".join(sorted(names)) or "nothing"


def send(stream: socket.socket, message: dict[str, Any]) -> None:
    """Write one message."""
    text = json.dumps(message).encode()
    stream.sendall(LENGTH.pack(len(text)) + text)


def receive(stream: socket.socket, timeout: float, longest: int = LONGEST_ANSWER) -> dict[str, Any]:
    """Read one message.

    Parameters
    ----------
    stream : socket
    timeout : float
        Longest wait for the whole of it [s].
    longest : int
        Longest message that is accepted [bytes].

    Raises
    ------
    EOFError
        If the other side has gone.
    TimeoutError
        If the message is not whole in time.
    ValueError
        If it is too long, or not one JSON object.
    """
    deadline = clock.monotonic() + timeout
    (length,) = LENGTH.unpack(_read_bytes(stream, LENGTH.size, deadline))
    if length > longest:
        raise ValueError(f"it sends a message of {length} bytes, at most {longest} are accepted; is the port right?")
    try:
        message = json.loads(_read_bytes(stream, length, deadline))
    except ValueError as error:
        raise ValueError(f"its message is not JSON ({error})") from None
    if not isinstance(message, dict):
        raise ValueError(f"its message is {shown(message)}; it must be one JSON object")
    return message


def _read_bytes(stream: socket.socket, count: int, deadline: float) -> bytes:
    """Read so many bytes, however they arrive; EOFError if it ends before, TimeoutError if they are late."""
    parts = bytearray()
    while len(parts) < count:
        left = deadline - clock.monotonic()
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
