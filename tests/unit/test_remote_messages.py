"""What a flow code at the other end of a socket may send, and what is said of all else."""

import json
import math
import socket
import struct
import threading
import time
import tracemalloc
from contextlib import contextmanager

import numpy as np
import pytest

from exumob.coupling.remote import DEEPEST, LONGEST_ANSWER, LONGEST_STATE, RemoteFlow, receive
from exumob.coupling.reports import MOST_FIGURES, checked_loads, checked_report
from exumob.flow.poses import Poses
from exumob.support.errors import SimulationError
from exumob.water.conditions import Water

POSES = Poses.at_rest(np.zeros((5, 3)))
LOADS = np.zeros((5, 6)).tolist()


def framed(message):
    """A message as it goes over the wire: of an object, or of bytes as they are."""
    text = message if isinstance(message, bytes) else json.dumps(message).encode()
    return struct.pack(">I", len(text)) + text


@contextmanager
def flow_code(*answers, raw=False, then=None, **options):
    """A connected RemoteFlow whose flow code gives these answers, one a question, whatever is asked; then leaves."""
    server = socket.create_server(("localhost", 0))
    done = threading.Event()

    def serve():
        stream, _ = server.accept()
        with stream:
            for answer in answers:
                receive(stream)
                stream.sendall(answer if raw else framed(answer))
            if then is not None:
                then(stream)
                done.wait(5.0)

    thread = threading.Thread(target=serve, daemon=True)
    thread.start()
    flow = RemoteFlow(port=server.getsockname()[1], **({"timeout": 5.0} | options))
    try:
        yield flow
    finally:
        done.set()
        flow.close()
        server.close()
        thread.join(5.0)


def start(flow, vehicle):
    flow.start(vehicle, Water(0.1), POSES, 0.0)


LARGE_LOADS = [[0.0] * 6] * 4 + [[0.0] * 5 + [10**400]]


@pytest.mark.parametrize(("loads", "message"), [
    (None, "loads holds NoneType"), ("much", "loads"), (LOADS[:4], r"shape \(4, 6\); give .*\(5, 6\)"),
    (LOADS + LOADS[:1], r"shape \(6, 6\)"), ([row[:5] for row in LOADS], r"shape \(5, 5\)"),
    ([*LOADS[:4], [0.0]], "loads"),
    ([*LOADS[:4], "abcdef"], "loads"), ([*LOADS[:4], ["1"] * 6], "loads"), ([*LOADS[:4], [None] * 6], "loads"),
    ([*LOADS[:4], [True] * 6], "loads"), ([*LOADS[:4], [math.nan] * 6], "6 of 30 loads are not finite"),
    ([*LOADS[:4], [math.inf] * 6], "not finite"), (LARGE_LOADS, "loads"), ({}, "loads"), ([], "loads"), (3, "loads"),
    ([LOADS], "shape"), ([*LOADS[:4], [{}] * 6], "loads"),
])  # fmt: skip
def test_loads_that_are_none(vehicle, loads, message):
    with flow_code({}, {"loads": loads}) as flow:
        start(flow, vehicle)
        with pytest.raises(SimulationError, match=message) as raised:
            flow.advance(0.1, POSES)
    assert "RemoteFlow" in str(raised.value) and "0.1000 s" in str(raised.value)


def test_masked_loads_of_a_code_in_this_process():
    masked = np.ma.masked_equal(np.arange(30.0).reshape(5, 6), 7.0)
    with pytest.raises(SimulationError, match=r"Code: loads: 1 of 30 values is masked"):
        checked_loads("Code", masked, 5, 0.1)
    given = np.arange(30.0).reshape(5, 6)
    kept = checked_loads("Code", given, 5, 0.1)
    given[:] = 0.0
    assert kept[0, 1] == 1.0 and kept.flags.writeable


@pytest.mark.parametrize(("report", "message"), [
    (None, "the report None"), ([], "the report"), ("a", "the report"), ({"a": "1"}, "report's a is '1'"),
    ({"a": None}, "report's a is None"), ({"a": {"b": 1}}, "report's a"), ({"a": [1]}, "report's a"),
    ({"a": True}, "report's a is True"), ({"": 1}, "names a figure ''"), ({"a/b": 1}, "names a figure 'a/b'"),
    ({"\ud800": 1}, "names a figure"), ({"a\nb": 1}, "names a figure"), ({"é": 1}, "names a figure"),
    ({"a" * 101: 1}, "names a figure"), ({f"a{n}": n for n in range(MOST_FIGURES + 1)}, "at most 1000"),
])  # fmt: skip
def test_reports_that_are_none(vehicle, report, message):
    with flow_code({}, {"loads": LOADS, "report": report}) as flow:
        start(flow, vehicle)
        with pytest.raises(SimulationError, match=message):
            flow.advance(0.1, POSES)


@pytest.mark.parametrize("second", [{"b": 1}, {}, {"a": 1, "b": 2}])
def test_names_of_a_report_stay(vehicle, second):
    with flow_code({}, *[{"loads": LOADS, "report": r} for r in ({"a": 1}, {"a": 10**300}, second)]) as flow:
        start(flow, vehicle)
        flow.advance(0.1, POSES)
        flow.advance(0.2, POSES)
        assert flow.report() == {"a": 1e300}
        with pytest.raises(SimulationError, match="names of the report have changed"):
            flow.advance(0.3, POSES)
    assert checked_report("Code", {"b": np.float32(2.0), "a": np.int64(1)}, ["a", "b"]) == {"a": 1.0, "b": 2.0}


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, np.float32("nan"), 10**400])
def test_figures_that_are_not_finite_are_named(value):
    with pytest.raises(SimulationError, match=r"Code: the report's residual is .*it must be (finite|a number)"):
        checked_report("Code", {"steps": 1, "residual": value}, None)


NESTED = 100_000


@pytest.mark.parametrize(("answer", "message"), [
    (b"{'loads': []}", "is not JSON"), (b"", "is not JSON"), (b"\xff\xfe\x00", "is not JSON"),
    (b"[]", "one JSON object"),
    (b"3", "one JSON object"), (b"null", "one JSON object"), (b'"text"', "one JSON object"), (b"{}{}", "is not JSON"),
    (b"[" * NESTED, f"nested deeper than {DEEPEST}"), (b'{"a":' * NESTED, "nested"),
    (b'{"a":' + b"[" * NESTED + b"]" * NESTED + b"}", "nested"), (b'{"loads": ' + b"9" * 5000 + b"}", "is not JSON"),
    (b'{"a": "\\" [', "is not JSON"),
])  # fmt: skip
@pytest.mark.parametrize("asked", ["start", "advance"])
def test_messages_that_are_no_objects(vehicle, answer, message, asked):
    """While starting it is bad input, later a run that breaks."""
    answers = (answer,) if asked == "start" else ({}, answer)
    with flow_code(*answers) as flow:
        with pytest.raises((ValueError, SimulationError), match=f"lost during '{asked}'.*{message}") as raised:
            start(flow, vehicle)
            flow.advance(0.1, POSES)
        assert isinstance(raised.value, ValueError if asked == "start" else SimulationError)
        assert len(str(raised.value)) < 400
        with pytest.raises(SimulationError, match="not connected"):  # question and answer no longer fit together
            flow.advance(0.1, POSES)


def test_brackets_in_texts_are_no_nesting(vehicle):
    state = {"name": "[{" * 1000 + '\\"['}
    with flow_code({}, {"state": state}, {}) as flow:
        start(flow, vehicle)
        saved = flow.save()
        flow.restore(saved)
    assert json.loads(saved) == state


@pytest.mark.parametrize("length", [2**31, 2**32 - 1, LONGEST_STATE + 1, LONGEST_ANSWER + 1])
def test_too_long_a_message_is_refused_before_it_is_read(vehicle, length):
    tracemalloc.start()
    with flow_code(framed({}), struct.pack(">I", length), raw=True, then=lambda stream: None) as flow:
        start(flow, vehicle)
        before = time.monotonic()
        with pytest.raises(SimulationError, match=rf"a message of {length} bytes is longer than {LONGEST_ANSWER}"):
            flow.advance(0.1, POSES)
        assert time.monotonic() - before < 2.0  # not waited for
    largest = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert largest < 20e6


def test_a_length_that_is_promised_is_not_allocated_before_it_comes(vehicle):
    """A code that promises the longest state and leaves has cost nothing."""
    tracemalloc.start()
    with flow_code(framed({}), struct.pack(">I", LONGEST_STATE) + b"{", raw=True) as flow:
        start(flow, vehicle)
        with pytest.raises(SimulationError, match="lost during 'save': the connection was closed"):
            flow.save()
    largest = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert largest < 20e6


@pytest.mark.parametrize("greeting", [b"HTTP/1.1 400 Bad Request\r\n\r\n", b"SSH-2.0-OpenSSH_9.6\r\n", b"220 mail\r\n"])
def test_another_protocol_at_the_port(vehicle, greeting):
    with flow_code(greeting, raw=True) as flow, pytest.raises(ValueError, match="is this the right port"):
        start(flow, vehicle)


@pytest.mark.parametrize("part", [b"", b"\x00", b"\x00\x00\x00\x02", b'\x00\x00\x00\x20{"loads": '])
def test_a_connection_closed_in_the_midst(vehicle, part):
    with flow_code(framed({}), part, raw=True) as flow:
        start(flow, vehicle)
        with pytest.raises(SimulationError, match="lost during 'advance': the connection was closed"):
            flow.advance(0.1, POSES)


def slowly(stream):
    """Begin an answer, and send a byte of it now and then."""
    receive(stream)
    stream.sendall(struct.pack(">I", 1000))
    for _ in range(30):
        try:
            stream.sendall(b" ")
        except OSError:
            return
        time.sleep(0.1)


@pytest.mark.parametrize("then", [lambda stream: None, slowly], ids=["silent", "a byte now and then"])
def test_no_answer_within_the_time(vehicle, then):
    """The time is for the whole answer: a trickle does not prolong it."""
    with flow_code({}, then=then, timeout=0.3) as flow:
        start(flow, vehicle)
        before = time.monotonic()
        with pytest.raises(SimulationError, match=r"no answer to 'advance' within 0\.3 s; give a longer timeout"):
            flow.advance(0.1, POSES)
        assert time.monotonic() - before < 2.0


@pytest.mark.parametrize(("answer", "message"), [
    ({"error": "no licence\nask for one"}, "RemoteFlow: no licence ask for one$"),
    ({"error": "x" * 900_000}, r"RemoteFlow: x{500} \.\.\. \(900000 characters\)$"),
    ({"error": ""}, "does not say which"), ({"error": None}, "RemoteFlow: None$"),
    ({"error": {"a": ["b"] * 10_000}}, "RemoteFlow: {'a': "), ({"error": 3, "loads": LOADS}, "RemoteFlow: 3$"),
])  # fmt: skip
def test_answers_that_are_errors(vehicle, answer, message):
    with flow_code(answer) as flow, pytest.raises(ValueError, match=message):
        start(flow, vehicle)
    with flow_code({}, answer, {"loads": LOADS}) as flow:
        start(flow, vehicle)
        with pytest.raises(SimulationError, match=message) as raised:
            flow.advance(0.1, POSES)
        assert len(str(raised.value)) < 1000
        assert (flow.advance(0.2, POSES) == 0.0).all()  # the connection stands


def test_a_save_without_a_state(vehicle):
    with flow_code({}, {}, {"state": None}) as flow:
        start(flow, vehicle)
        with pytest.raises(SimulationError, match='holds no "state"'):
            flow.save()
        assert flow.save() == "null"


@pytest.mark.parametrize("host", ["", "no such host", "a" * 300, "é" * 80, ".", "256.256.256.256"])
def test_addresses_that_are_none(vehicle, host):
    with pytest.raises(ValueError, match="no flow code answers at"):
        start(RemoteFlow(host, 1, timeout=1.0), vehicle)
