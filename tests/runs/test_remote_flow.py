"""A flow code in another process: the same run, and what is said when it dies or does not answer."""

import re
import subprocess
import sys

import pytest
from coupled_runs import EXAMPLE, assert_same, run

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
    flow._socket.close()


def test_flow_code_that_does_not_answer_is_named(vehicle, sand):
    with pytest.raises(ValueError, match=r"no flow code answers at localhost:1 .*start it first"):
        run(vehicle, sand, RemoteFlow(port=1))
