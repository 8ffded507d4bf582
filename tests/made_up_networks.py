"""Networks with random weights, and ones that add given loads to the coefficient model's."""

import numpy as np

from exumob.surrogates.networks import RANGE_STATES, Architecture, NetworkSet
from exumob.surrogates.vehicle_shape import geometry
from exumob.water.wave_loads import fitted_coefficients

SMALL = Architecture(inputs=("forward_flow", "lateral_flow", "yaw_rate"), taps=4, stride=5, width=7, dense=5)


def made_up(architecture, vehicle, seed=0):
    """Networks with random weights."""
    rng = np.random.default_rng(seed)
    k = len(architecture.inputs)
    arrays = {n: 0.5 * rng.standard_normal((5, *s)) for n, s in architecture.shapes().items()}
    arrays |= {
        "input_mean": np.full((5, k), 0.1), "input_scale": np.full((5, k), 0.5), "input_low": np.full((5, k), -1.0),
        "input_high": np.full((5, k), 1.0), "range_states": np.zeros((5, RANGE_STATES, k)),
        "range_reach": np.full(5, 3.0), "output_mean": rng.standard_normal((5, 6)),
        "output_scale": np.full((5, 6), 2.0),
    }  # fmt: skip
    about = {"preset": "made up", "seed": seed, "geometry": geometry(vehicle)}
    if architecture.base == "coefficients":
        about["waves"] = fitted_coefficients().terms
    return NetworkSet(architecture, {n: a.astype(np.float32) for n, a in arrays.items()}, about)


def residual(vehicle, loads=0.0, **ranges):
    """Networks that add constant loads to those of the calibrated coefficients."""
    network = made_up(Architecture(SMALL.inputs, 1, 1, "polynomial", degree=1, base="coefficients"), vehicle)
    arrays = network.arrays | {
        "coefficients": np.zeros_like(network.arrays["coefficients"]),
        "output_mean": np.full((5, 6), loads, np.float32),
        "input_low": np.full((5, 3), -50.0, np.float32), "input_high": np.full((5, 3), 50.0, np.float32),
        "range_reach": np.full(5, 500.0, np.float32),
    }  # fmt: skip
    return NetworkSet(network.architecture, arrays | ranges, network.about)
