"""A flow code in another process: the same run, and what is said when it dies or does not answer."""

import re
import subprocess
import sys

import pytest
from coupled_runs import EXAMPLE, StandIn, assert_same, run

from exumob.coupling.remote import RemoteFlow
from exumob.coupling.semi_implicit import SemiImplicit
from exumob.coupling.strong import Strong
from exumob.support.errors import SimulationError


@pytest.fixture
def served():
    """The stand-in in a process of its own; its port."""
    process = subprocess.Popen(
        [sys.executable, str(EXAMPLE / "stand_in.py"), "--port", "0"], stdout=subprocess.PIPE, text=True
    )
    try:
        yield int(re.search(r"\d+", process.stdout.readline()).group())
    finally:
        process.kill()
        process.wait()
        process.stdout.close()


@pytest.mark.parametrize("scheme", [SemiImplicit, Strong])
def test_flow_code_in_another_process_gives_the_same_run(vehicle, sand, served, scheme):
    flow = RemoteFlow(port=served)
    remote = run(vehicle, sand, flow, duration=0.05, coupling=scheme())
    flow.close()
    assert_same(run(vehicle, sand, duration=0.05, coupling=scheme()), remote)


def test_flow_code_that_dies_is_named(vehicle, sand, served):
    flow = RemoteFlow(port=served)

    def kill(now):
        if now > 0.02 and flow._socket is not None:
            flow._socket.shutdown(2)

    with pytest.raises(SimulationError, match="the flow code was lost during 'advance'") as caught:
        run(vehicle, sand, flow, duration=0.05, progress=kill)
    assert caught.value.result.sizes["time"] > 1
    flow.close()


def test_flow_code_that_does_not_answer_is_named(vehicle, sand):
    with pytest.raises(ValueError, match=r"no flow code answers at localhost:1 .*start it first"):
        run(vehicle, sand, RemoteFlow(port=1))


@pytest.mark.parametrize(("part", "message"), [
    ({"report": {"another": 1}}, "names of the report have changed"),
    ({"loads": [[float("nan")] * 6] * 5}, "30 of 30 loads are not finite"),
])  # fmt: skip
def test_a_wrong_answer_keeps_what_was_computed(vehicle, sand, served, monkeypatch, part, message):
    flow, ask = RemoteFlow(port=served), RemoteFlow._ask

    def spoilt(self, what, **question):
        answer = ask(self, what, **question)
        if what == "advance" and question["time"] > 0.02:
            answer |= part
        return answer

    monkeypatch.setattr(RemoteFlow, "_ask", spoilt)
    with pytest.raises(SimulationError, match=message) as caught:
        run(vehicle, sand, flow, duration=0.05)
    flow.close()
    result = caught.value.result
    assert result["time"][-1] == pytest.approx(0.02, abs=2e-3)
    assert "hydrodynamics_iterations" in result and result.attrs["status"].startswith("broke down at 0.0")


@pytest.mark.parametrize(("change", "message"), [
    ({"report": lambda self: {"iterations": 1.0, f"n{len(self.asked)}": 2.0}}, "StandIn: the names of the report"),
    ({"advance": lambda self, time, poses: [[1.0], [2.0, 3.0]]}, "StandIn: loads"),
])  # fmt: skip
def test_a_flow_code_in_this_process_is_checked_in_the_same_way(vehicle, sand, change, message):
    class Spoilt(StandIn):
        asked = ()

    def counted(self):
        self.asked = (*self.asked, 1)
        return change["report"](self)

    for name, function in change.items():
        setattr(Spoilt, name, counted if name == "report" else function)
    Spoilt.__name__ = "StandIn"
    with pytest.raises(SimulationError, match=message):
        run(vehicle, sand, Spoilt(), duration=0.02)
