"""Shared by the tests: the vehicle, the soil and two runs of the reference maneuver (about 4 s each, made once)."""

import math
import os
import signal
from pathlib import Path

ROOT = Path(__file__).parents[1]
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # matrices are small: threads that wait for each other cost more
if "NUMBA_CACHE_DIR" not in os.environ:  # Numba reads it when imported; processes that tests start inherit it
    os.environ["NUMBA_CACHE_DIR"] = str(ROOT / ".numba_cache")

import pytest

from exumob.driving.maneuver import lane_change
from exumob.ground.soil import Soil
from exumob.simulation import water_models
from exumob.simulation.run import simulate
from exumob.water.conditions import Water
from vehicle_models.amphibious import amphibious_vehicle


def of_flow(path):
    """Whether a file's tests need the flow's kernels, which take minutes to compile."""
    return path.startswith(("tests/physics/test_flow", "tests/physics/test_captive"))


def pytest_collection_modifyitems(items):
    """The flow's tests come first, small files last, so that no process is left with a long one at the end."""
    items.sort(key=lambda item: (not of_flow(item.nodeid), item.nodeid.startswith("tests/unit")))


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config, log):
    """Tests are divided among processes by files, which share fixtures; all of the flow's go to one.

    Studies are divided singly, and what tries any input by its functions: each is longer than most files.
    """
    from xdist.scheduler import LoadScopeScheduling

    class ByCost(LoadScopeScheduling):
        def _split_scope(self, nodeid):
            path = nodeid.split("::")[0]
            if path.startswith("tests/fuzz"):
                return nodeid.split("[")[0]
            return "flow" if of_flow(path) else nodeid if path == "tests/runs/test_studies.py" else path

    return ByCost(config, log)


COARSE = {"micro_step": 5e-4, "macro_step": 20e-3}
"""The fast setting of the design."""


@pytest.fixture(scope="session")
def vehicle():
    return amphibious_vehicle()


@pytest.fixture(scope="session")
def sand():
    return Soil.published("LETE sand")


@pytest.fixture(scope="session")
def dry_run(vehicle, sand):
    """The whole lane change on dry sand."""
    return simulate(vehicle, sand, maneuver=lane_change(), **COARSE)


@pytest.fixture(scope="session")
def wet_run(vehicle, sand):
    """The whole lane change in D60/U1 with the coefficient model."""
    return simulate(vehicle, sand, Water.at_ratio(0.6, 1.0), lane_change(), "coefficients", **COARSE)


@pytest.fixture(scope="session")
def mirrored_wet_run(vehicle, sand):
    return simulate(vehicle, sand, Water.at_ratio(0.6, 1.0), lane_change(-math.radians(30.0)), "coefficients", **COARSE)


@pytest.fixture(scope="session")
def short_run(vehicle, sand):
    """0.2 s in D60/U1, for tests of files and figures that do not need a whole run."""
    return simulate(vehicle, sand, Water.at_ratio(0.6, 1.0), lane_change(), "coefficients", duration=0.2, **COARSE)


@pytest.fixture(scope="session")
def runs(vehicle, sand):
    """Half a second of driving in three waters, with the coefficient model's loads."""
    from exumob.learning.dataset import pack

    found = {}
    for name, depth, current in (("D40/U0", 0.08, 0.0), ("D50/U0.5", 0.1, 0.5), ("D60/U1", 0.12, 1.0)):
        run = simulate(
            vehicle, sand, Water(depth, current), lane_change(), "coefficients", duration=0.5, micro_step=5e-4,
            macro_step=1e-3, record_step=1e-3,
        )  # fmt: skip
        found[name] = pack(run).assign_attrs(scenario=name)
    return found


@pytest.fixture
def interruptible():
    """Ctrl-C interrupts this process and its children, though a shell that runs tests in the background ignores it.

    A command started with `&` from a script ignores SIGINT, as Unix wants it; so do its children.
    """
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture
def fresh_warnings():
    """Warnings that a process gives once are given again."""
    water_models._warn_once.cache_clear()
