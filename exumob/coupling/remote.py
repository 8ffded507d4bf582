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
SimulationError.
"""

from __future__ import annotations

import json
import socket
import struct
from dataclasses import fields
from typing import Any

import numpy as np

from exumob.flow.poses import Poses
from exumob.support.arrays import Array
from exumob.support.checks import require_positive
from exumob.support.errors import SimulationError
from exumob.support.provenance import parameters_json
from exumob.vehicle.parameters import Vehicle
from exumob.water.conditions import Water

LENGTH = struct.Struct(">I")
LONGEST = 2**31
"""Longest message that is accepted [bytes]; a code with larger states saves them in files of its own."""


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

    def __init__(
        self, host: str = "localhost", port: int = 5005, *, timeout: float = 3600.0,
        parameters: dict[str, Any] | None = None,
    ) -> None:  # fmt: skip
        require_positive("RemoteFlow", timeout=timeout)
        self.address, self.timeout = (host, port), timeout
        self.parameters = parameters or {}
        self._socket: socket.socket | None = None
        self._report: dict[str, float] = {}

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
            except OSError as error:
                host, port = self.address
                raise ValueError(
                    f"RemoteFlow: no flow code answers at {host}:{port} ({error}); start it first, or give its address."
                ) from None
        question = {
            "vehicle": json.loads(parameters_json({"vehicle": vehicle}))["vehicle"]["Vehicle"],
            "water": {"depth": water.depth, "density": water.density, "velocity": water.velocity.tolist()},
            "poses": _as_lists(poses), "time": time,
        }  # fmt: skip
        try:
            self._ask("start", **question)
        except SimulationError as error:
            raise ValueError(str(error)) from None

    def advance(self, time: float, poses: Poses) -> Array:
        """See `FlowCode`."""
        answer = self._ask("advance", time=time, poses=_as_lists(poses))
        self._report = {name: float(value) for name, value in answer.get("report", {}).items()}
        wrenches = np.asarray(answer.get("loads"), dtype=float)
        if wrenches.shape != (len(poses.position), 6):
            raise SimulationError(
                f"RemoteFlow: loads of shape {wrenches.shape} came back; it must be ({len(poses.position)}, 6)."
            )
        return wrenches

    def save(self) -> Any:
        """See `FlowCode`; as text, so that it can be anything that JSON can hold."""
        return json.dumps(self._ask("save").get("state"))

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
            self._socket.close()
            self._socket = None

    def _ask(self, what: str, **question: Any) -> dict[str, Any]:
        """Send a question and return its answer; SimulationError if the code is lost or answers with an error."""
        if self._socket is None:
            raise SimulationError("RemoteFlow: not connected; call start first.")
        try:
            send(self._socket, {"do": what, **question})
            answer = receive(self._socket)
        except (OSError, EOFError, ValueError) as error:
            raise SimulationError(f"RemoteFlow: the flow code was lost during {what!r}: {error}") from None
        if "error" in answer:
            raise SimulationError(f"RemoteFlow: {answer['error']}")
        return answer


def send(stream: socket.socket, message: dict[str, Any]) -> None:
    """Write one message."""
    text = json.dumps(message).encode()
    stream.sendall(LENGTH.pack(len(text)) + text)


def receive(stream: socket.socket) -> dict[str, Any]:
    """Read one message; EOFError if the other side has gone."""
    (length,) = LENGTH.unpack(_read_bytes(stream, LENGTH.size))
    if length > LONGEST:
        raise ValueError(f"a message of {length} bytes is longer than {LONGEST}; is this the right port?")
    message = json.loads(_read_bytes(stream, length))
    if not isinstance(message, dict):
        raise ValueError("a message must be one JSON object")
    return message


def _read_bytes(stream: socket.socket, count: int) -> bytes:
    """Read so many bytes, however they arrive; EOFError if the connection ends before."""
    parts = bytearray()
    while len(parts) < count:
        part = stream.recv(min(count - len(parts), 1 << 20))
        if not part:
            raise EOFError("the connection was closed")
        parts += part
    return bytes(parts)


def _as_lists(poses: Poses) -> dict[str, Any]:
    """Return the fields of poses as nested lists, for JSON."""
    return {f.name: getattr(poses, f.name).tolist() for f in fields(Poses)}
