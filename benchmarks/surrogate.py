"""What does a call of the five networks cost, and how near is it to the time that reading their weights takes?

An LSTM with a window of three reads its recurrent weights twice (the first step starts from h = 0); everything else is
read once. With a window of one they are not read at all. The bandwidth is that of a sum over as many bytes, measured in
the same run, one thread.

Then the call of the members that come with exumob, with the coefficient model, error bars and range: by part, and over
that of revision 636969b (`past.toml`). Machines differ, and one machine from minute to minute: each time is divided by
that of numpy additions of two wrenches, measured in turn with it.

Run: python benchmarks/surrogate.py
"""

import os

os.environ["NUMBA_NUM_THREADS"] = "1"

import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numba import njit
from past import past, ratio

from exumob.learning.presets import PRESETS
from exumob.surrogates.inputs import network_inputs, window_rows
from exumob.surrogates.model import SurrogateHydrodynamics
from exumob.surrogates.networks import RANGE_STATES, NetworkSet
from exumob.surrogates.vehicle_shape import geometry
from exumob.vehicle.motion import BodyStates
from exumob.water.coefficients import CoefficientHydrodynamics
from exumob.water.conditions import Water
from vehicle_models.amphibious import amphibious_vehicle

CALLS = 200
MOST_CALLS = 3000
WATER = Water(0.12, 1.0)
WRENCHES = np.ones((5, 6))


@njit(cache=True, fastmath=True)
def _read(values: np.ndarray) -> float:
    total = np.float32(0.0)
    for n in range(values.size):  # by index: this form is vectorised
        total += values[n]
    return total


def best(work: Callable[[], object], calls: int = CALLS) -> float:
    """Median time of a call [s]."""
    work()
    times = []
    for _ in range(calls):
        began = time.perf_counter()
        work()
        times.append(time.perf_counter() - began)
    return float(np.median(times))


def made_up(preset: str) -> NetworkSet:
    """Networks of a preset with small random weights: they cost what trained ones do."""
    architecture = PRESETS[preset].architecture
    rng, k = np.random.default_rng(0), len(architecture.inputs)
    arrays = {name: 0.05 * rng.standard_normal((5, *shape)) for name, shape in architecture.shapes().items()}
    arrays |= {name: np.zeros((5, k)) for name in ("input_mean", "input_low")}
    arrays |= {name: np.ones((5, k)) for name in ("input_scale", "input_high")}
    arrays |= {"range_states": rng.standard_normal((5, RANGE_STATES, k)), "range_reach": np.ones(5)}
    arrays |= {"output_mean": np.zeros((5, 6)), "output_scale": np.ones((5, 6))}
    about = {"geometry": geometry(amphibious_vehicle())}
    return NetworkSet(architecture, {n: a.astype(np.float32) for n, a in arrays.items()}, about)


def history(rows: int = 600) -> BodyStates:
    """Some motion."""
    rng = np.random.default_rng(1)
    turn = np.broadcast_to(np.eye(3), (rows, 5, 3, 3))
    vectors = [0.1 * rng.standard_normal((rows, 5, 3)) for _ in range(5)]
    position, velocity, spin, acceleration, twist = vectors
    return BodyStates(
        1e-3 * np.arange(rows), position, turn, velocity, spin, acceleration, twist, np.zeros((rows, 4))
    )  # fmt: skip


def additions() -> None:
    """Add two wrenches a hundred times: what numpy costs for small arrays, whatever this program does."""
    for _ in range(100):
        WRENCHES + WRENCHES


def in_turn(works: dict[str, Callable[[], object]]) -> dict[str, float]:
    """Median time of a call of each, measured in turn [s]."""
    times: dict[str, list[float]] = {name: [] for name in works}
    for work in works.values():
        work()
    for _ in range(MOST_CALLS):
        for name, work in works.items():
            began = time.perf_counter()
            work()
            times[name].append(time.perf_counter() - began)
    return {name: float(np.median(values)) for name, values in times.items()}


def standing() -> BodyStates:
    """The vehicle at 1 m/s, 5 mm deep in the soil."""
    states, vehicle = history(), amphibious_vehicle()
    origins = np.vstack([vehicle.hull_origin, vehicle.wheel_centers]) - [0.0, 0.0, 0.005]
    return replace(
        states, position=origins + 0.01 * states.position, velocity=0.1 * states.velocity + [1.0, 0.0, 0.0]
    )  # fmt: skip


def members() -> None:
    """Print the call of the networks that come with exumob, by part."""
    states, model = standing(), SurrogateHydrodynamics()
    model.start(amphibious_vehicle(), WATER, 20e-3)
    ((networks, _),) = model._groups
    architecture, coefficients = networks.architecture, CoefficientHydrodynamics()
    coefficients.start(amphibious_vehicle(), WATER, 20e-3)
    window = network_inputs(states, WATER, architecture.inputs, np.array([-1])).transpose(1, 0, 2)
    weights = np.ones(networks.size // 4, np.float32)
    found = in_turn({
        "whole call": lambda: model.wrenches(states, lambda: states),
        "100 numpy additions": additions,
        "coefficient model": lambda: coefficients.wrenches(states, lambda: states),
        "inputs of the five bodies": lambda: network_inputs(
            states, WATER, architecture.inputs, window_rows(states.time, architecture.taps, architecture.stride)
        ),
        "25 networks": lambda: networks.wrenches(window),
        "training range": lambda: networks.excess(window[:, -1]),
        "(reading their weights)": lambda: _read(weights),
    })  # fmt: skip
    for name, value in found.items():
        print(f"{name:<26} {1e6 * value:6.1f} us")
    now, then = found["whole call"] / found["100 numpy additions"], past("networks_call")["members of exumob"]
    print(f"whole call over that of {then['revision']} ({then['date']}): {ratio(now, then, 'over_additions')}")


def main() -> None:
    """Print a row for each preset, then the parts of a call."""
    states = history()
    print("preset        weights  read   networks  of limit  whole call")
    for preset in PRESETS:
        network = made_up(preset)
        a = network.architecture
        passes = network.size + (network.arrays["U"].nbytes * (a.taps - 2) if a.layer == "lstm" else 0)
        values = np.ones(passes // 4, np.float32) if a.layer != "lstm" else np.ones(network.size // 4, np.float32)
        limit = best(lambda values=values: _read(values)) * passes / values.nbytes
        inputs = np.random.default_rng(2).uniform(0.0, 1.0, (5, a.taps, len(a.inputs)))
        call = best(lambda network=network, inputs=inputs: network.wrenches(inputs))
        model = SurrogateHydrodynamics(network, fallback=False)
        model.start(amphibious_vehicle(), WATER, 1e-3)
        whole = best(lambda model=model: model.wrenches(states, lambda: states))
        times = f"{1e6 * limit:6.0f} us {1e6 * call:6.0f} us  {100 * limit / call:5.0f} %   {1e6 * whole:6.0f} us"
        print(f"{preset:<13} {network.size / 1e6:5.2f} MB {times}")
    members()


if __name__ == "__main__":
    main()
