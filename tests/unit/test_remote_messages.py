"""What a flow code may send, and what is said of everything else."""

import json
import socket
import threading

import numpy as np
import pytest

from exumob.coupling import remote
from exumob.coupling.remote import LENGTH, RemoteFlow
from exumob.flow.poses import Poses
from exumob.support.errors import SimulationError
from exumob.water.conditions import Water

POSES = Poses.at_rest(np.zeros((5, 3)))
LOADS = np.arange(30.0).reshape(5, 6).tolist()


def framed(message):
    """A message as it goes over the line."""
    text = message if isinstance(message, bytes) else json.dumps(message).encode()
    return LENGTH.pack(len(text)) + text


@pytest.fixture
def answering(vehicle):
    """Start a flow code that answers with the given bytes, one after the other, and then is silent or gone."""
    opened = []

    def begin(*answers, gone=False, timeout=5.0):
        server = socket.create_server(("localhost", 0))

        def serve():
            connection, _ = server.accept()
            opened.append(connection)
            for answer in answers:
                (length,) = LENGTH.unpack(connection.recv(4, socket.MSG_WAITALL))
                connection.recv(length, socket.MSG_WAITALL)
                connection.sendall(answer)
            if gone:
                connection.close()

        thread = threading.Thread(target=serve, daemon=True)
        thread.start()
        opened.append(server)
        flow = RemoteFlow("localhost", server.getsockname()[1], timeout=timeout)
        flow.begin = lambda: flow.start(vehicle, Water(0.1), POSES, 0.0)
        opened.append(flow)
        return flow

    yield begin
    for one in opened:
        one._leave() if isinstance(one, RemoteFlow) else one.close()


@pytest.mark.parametrize(
    ("answer", "message"),
    [
        ({}, "loads came back as None; they must be 5 rows of 6 numbers"),
        ({"loads": "many"}, "loads came back as 'many'"),
        ({"loads": LOADS[:4]}, "4 rows of 6 values; they must be 5 rows"),
        ({"loads": [*LOADS[:4], [1.0, 2.0]]}, "5 rows of 2 or 6 values"),
        ({"loads": [[1.0] * 5] * 5 + [3]}, "6 rows of 1 or 5 values"),
        ({"loads": [*LOADS[:4], [1.0, 2.0, "3", 4.0, 5.0, 6.0]]}, "the loads on body 4 hold '3'; they must be finite"),
        ({"loads": [*LOADS[:4], [1.0, 2.0, None, 4.0, 5.0, 6.0]]}, "body 4 hold None"),
        ({"loads": [[True] * 6] * 5}, "body 0 hold True"),
        ({"loads": [[float("nan")] * 6] * 5}, "body 0 hold nan"),
        ({"loads": [[[1.0]] * 6] * 5}, r"body 0 hold \[1\.0\]"),
        ({"loads": [[10**400] * 6] * 5}, "body 0 hold 1000"),
        ({"loads": LOADS, "report": [1]}, r"the report is \[1\]; it must be"),
        ({"loads": LOADS, "report": {"a": "b"}}, "the report holds 'a': 'b'"),
        ({"loads": LOADS, "report": {"a/b": 1.0}}, "the report holds 'a/b': 1.0; it must be a name of letters"),
        ({"loads": LOADS, "report": {"a": float("inf")}}, "the report holds 'a': inf"),
        ({"loads": LOADS, "report": {f"a{n}": 1 for n in range(101)}}, "the report is 101 figures"),
        ({"error": "no licence"}, "RemoteFlow: no licence"),
        ({"error": ["no", "licence"]}, r"RemoteFlow: \['no', 'licence'\]"),
        ([1, 2], r"its message is \[1, 2\]; it must be one JSON object"),
        (b"\xff\xfe", "its message is not JSON"),
        (b"[" * 100_000, "lost during 'advance'"),
        (b"", "its message is not JSON"),
    ],
)
def test_answers_of_another_form_are_named(answering, answer, message):
    flow = answering(framed({}), framed(answer))
    flow.begin()
    with pytest.raises(SimulationError, match=message):
        flow.advance(0.01, POSES)


def test_sound_answers_are_taken(answering):
    sound = framed({"loads": LOADS, "report": {"a": 1, "b": 2.5}, "more": 3})
    other = framed({"loads": LOADS, "report": {"b": 3.5, "a": 2}})
    flow = answering(framed({"version": 1}), sound, other, framed({"state": {"a": [1.5]}}), framed({}))
    flow.begin()
    assert flow.advance(0.01, POSES).tolist() == LOADS and flow.report() == {"a": 1.0, "b": 2.5}
    flow.advance(0.02, POSES)
    assert list(flow.report().items()) == [("a", 2.0), ("b", 3.5)]
    assert flow.save() == '{"a": [1.5]}'
    flow.restore('{"a": [1.5]}')


def test_reports_must_keep_their_names(answering):
    flow = answering(framed({}), framed({"loads": LOADS, "report": {"a": 1}}), framed({"loads": LOADS}))
    flow.begin()
    flow.advance(0.01, POSES)
    with pytest.raises(SimulationError, match=r"reported a at first and nothing at 0\.02 s; it must"):
        flow.advance(0.02, POSES)


@pytest.mark.parametrize("length", [2**20 + 1, 2**31, 2**32 - 1])
def test_a_long_message_is_refused_before_it_is_read(answering, length):
    flow = answering(framed({}), LENGTH.pack(length))
    flow.begin()
    with pytest.raises(SimulationError, match=rf"a message of {length} bytes, at most 1048576 are accepted"):
        flow.advance(0.01, POSES)
    with pytest.raises(SimulationError, match="not connected"):  # what comes now would answer another question
        flow.advance(0.01, POSES)


def test_a_state_may_be_longer_but_not_endless(answering, monkeypatch):
    monkeypatch.setattr(remote, "LONGEST_STATE", 3 * 2**20)
    long = "x" * 2**21
    flow = answering(framed({}), framed({"state": long}), LENGTH.pack(2**22))
    flow.begin()
    assert json.loads(flow.save()) == long
    with pytest.raises(SimulationError, match="a message of 4194304 bytes"):
        flow.save()


def test_no_state_is_named(answering):
    flow = answering(framed({}), framed({}))
    flow.begin()
    with pytest.raises(SimulationError, match="the answer to 'save' holds no state"):
        flow.save()


def test_silence_and_a_closed_connection_are_named(answering):
    flow = answering(framed({}), framed({"loads": LOADS})[:20], timeout=0.2)
    flow.begin()
    with pytest.raises(SimulationError, match=r"lost during 'advance': no answer within 0\.2 s\. Look at"):
        flow.advance(0.01, POSES)
    flow = answering(framed({}), framed({"loads": LOADS})[:20], gone=True)
    flow.begin()
    with pytest.raises(SimulationError, match="lost during 'advance': the connection was closed"):
        flow.advance(0.01, POSES)


def test_another_version_and_a_refusal_are_input_errors(answering):
    with pytest.raises(ValueError, match=r"speaks version 7 of the messages, and exumob version 1"):
        answering(framed({"version": 7})).begin()
    with pytest.raises(ValueError, match="the box is too small"):
        answering(framed({"error": "the box is too small"})).begin()
    with pytest.raises(ValueError, match="lost during 'start'"):
        answering(b"HTTP/1.1 400 Bad Request\r\n\r\n").begin()


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"host": 3}, "host"), ({"port": 0}, "port = 0"), ({"port": 70000}, "port = 70000"), ({"port": "5005"}, "port"),
        ({"timeout": 0.0}, "timeout"), ({"timeout": float("nan")}, "timeout"), ({"parameters": [1]}, "parameters"),
    ],
)  # fmt: skip
def test_addresses_are_checked(given, message):
    with pytest.raises(ValueError, match=rf"RemoteFlow\.{message}"):
        RemoteFlow(**given)


@pytest.mark.parametrize("host", ["no.such.host.invalid", "a" * 300, "\0", ""])
def test_a_host_that_is_none_is_named(vehicle, host):
    with pytest.raises(ValueError, match="no flow code answers at"):
        RemoteFlow(host, 1, timeout=2.0).start(vehicle, Water(0.1), POSES, 0.0)
