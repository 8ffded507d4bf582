"""What does a call of the five networks cost, and how near is it to the time that reading their weights takes?

An LSTM with a window of three reads its recurrent weights twice (the first step starts from h = 0); everything else is
read once. The bandwidth is that of a sum over as many bytes, measured in the same run, one thread.

Run: python benchmarks/surrogate.py
"""

import os

os.environ["NUMBA_NUM_THREADS"] = "1"

import time
from collections.abc import Callable

import numpy as np
from numba import njit

from exumob.learning.presets import PRESETS
from exumob.surrogates.model import SurrogateHydrodynamics
from exumob.surrogates.networks import NetworkSet, geometry
from exumob.vehicle.motion import BodyStates
from exumob.water.conditions import Water
from vehicle_models.amphibious import amphibious_vehicle

CALLS = 200


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
    arrays |= {"joint_inverse": np.tile(np.eye(k), (5, 1, 1)), "joint_limit": np.ones(5)}
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


def main() -> None:
    """Print a row for each preset."""
    states = history()
    print("preset        weights  read   networks  of limit  whole call")
    for preset in PRESETS:
        network = made_up(preset)
        a = network.architecture
        passes = network.size + (network.arrays["U"].nbytes * max(a.taps - 2, 0) if a.layer == "lstm" else 0)
        values = np.ones(passes // 4, np.float32) if a.layer != "lstm" else np.ones(network.size // 4, np.float32)
        limit = best(lambda values=values: _read(values)) * passes / values.nbytes
        inputs = np.random.default_rng(2).uniform(0.0, 1.0, (5, a.taps, len(a.inputs)))
        call = best(lambda network=network, inputs=inputs: network.wrenches(inputs))
        model = SurrogateHydrodynamics(network, fallback=False)
        model.start(amphibious_vehicle(), Water(0.12, 1.0), 1e-3)
        whole = best(lambda model=model: model.wrenches(states, lambda: states))
        times = f"{1e6 * limit:6.0f} us {1e6 * call:6.0f} us  {100 * limit / call:5.0f} %   {1e6 * whole:6.0f} us"
        print(f"{preset:<13} {network.size / 1e6:5.2f} MB {times}")


if __name__ == "__main__":
    main()
