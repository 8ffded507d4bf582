"""The networks' call against NumPy written straight from the definitions: inputs, window, range, mean and spread."""

import math
from dataclasses import replace

import numpy as np
import pytest
from made_up_networks import SMALL, made_up

from exumob.coupling.scheme import checked_wrenches
from exumob.support.errors import SimulationError
from exumob.surrogates.inputs import INPUTS, SAMPLING, network_inputs, window_rows
from exumob.surrogates.model import SurrogateHydrodynamics, shipped_networks
from exumob.surrogates.network_kernels import mean_and_spread
from exumob.surrogates.networks import NetworkSet, range_scale
from exumob.vehicle.motion import BodyStates
from exumob.water.conditions import Water
from exumob.water.flow_states import FLOW_STATES, flow_states

WATERS = [Water(0.12, 1.0), Water(0.1, 0.5, 2.0), Water(0.1)]


def motion(n=60, seed=0):
    """Some motion: small turns about a course, velocities of the order of 1 m/s, slow ones among them."""
    rng = np.random.default_rng(seed)
    turn = np.linalg.qr(rng.standard_normal((n, 5, 3, 3)))[0]
    turn *= np.linalg.det(turn)[..., None, None]
    vectors = [rng.standard_normal((n, 5, 3)) for _ in range(5)]
    vectors[1] *= 10.0 ** rng.uniform(-4.0, 0.0, (n, 5, 1))
    return BodyStates(1e-3 * np.arange(n), vectors[0], turn, *vectors[1:], np.zeros((n, 4)))


def features(states, water):
    """All of `INPUTS`, from their definitions."""
    turn, (x, y, z) = states.rotation, np.moveaxis(states.velocity, -1, 0)
    heading = np.arctan2(turn[..., 1, 0], turn[..., 0, 0])
    cos, sin = np.cos(heading), np.sin(heading)
    through_x, through_y = x - water.velocity[0], y - water.velocity[1]
    spin = np.einsum("nbij,nbi->nbj", turn, states.angular_velocity)
    speed = np.hypot(x, y)
    fade = np.clip((speed - 1e-3) / 9e-3, 0.0, 1.0)
    attack = np.angle(np.exp(1j * (heading - water.current_direction - math.pi)))
    wheels = np.angle(np.exp(1j * (heading[:, 1:3] - heading[:, :1]))).mean(axis=1)
    ones = np.ones_like(heading)
    return {
        "sideslip_angle": fade**2 * (3.0 - 2.0 * fade) * np.arctan2(cos * y - sin * x, cos * x + sin * y),
        "angle_of_attack": attack, "speed": speed, "current_speed": water.current_speed * ones,
        "water_depth": water.depth * ones, "forward_flow": cos * through_x + sin * through_y,
        "lateral_flow": cos * through_y - sin * through_x, "forward_speed": cos * x + sin * y,
        "lateral_speed": cos * y - sin * x, "yaw_rate": states.angular_velocity[..., 2], "roll_rate": spin[..., 0],
        "pitch_rate": spin[..., 1], "heave_rate": z, "immersion": water.depth - states.position[..., 2],
        "roll": turn[..., 2, 1], "pitch": -turn[..., 2, 0], "steering": wheels[:, None] * ones,
        "hull_yaw_rate": states.angular_velocity[:, :1, 2] * ones, "hull_attack": attack[:, :1] * ones,
    }  # fmt: skip


@pytest.mark.parametrize("water", WATERS, ids=lambda w: f"{w.current_speed:g} m/s")
def test_inputs_are_as_defined(water):
    """Every feature, in any order, of all instants and of some, of a motion kept in one array or in records."""
    states = motion()
    expected = features(states, water)
    names = tuple(reversed(INPUTS))
    found = network_inputs(states, water, names)
    assert set(expected) == set(INPUTS)
    for place, name in enumerate(names):
        np.testing.assert_allclose(found[..., place], expected[name], rtol=1e-12, atol=1e-13, err_msg=name)
    rows = np.array([7, 3, 59])
    np.testing.assert_array_equal(network_inputs(states, water, names, rows), found[rows])
    strided = BodyStates(*(np.repeat(getattr(states, n), 2, axis=0)[::2] for n in states.__dataclass_fields__))
    np.testing.assert_array_equal(network_inputs(strided, water, names), found)
    np.testing.assert_array_equal(network_inputs(states, water, FLOW_STATES), flow_states(states, water))
    with pytest.raises(ValueError, match="'depth' is not known; use sideslip_angle, "):
        network_inputs(states, water, ("speed", "depth"))


def test_inputs_of_a_vehicle_that_is_taken_as_still():
    states, names = motion(), tuple(INPUTS)
    zero = np.zeros_like(states.velocity)
    expected = network_inputs(replace(states, velocity=zero, angular_velocity=zero), WATERS[1], names)
    np.testing.assert_allclose(network_inputs(states, WATERS[1], names, still=True), expected, atol=1e-15)


@pytest.mark.parametrize(("taps", "stride"), [(1, 1), (3, 1), (5, 25), (200, 3)])
def test_window_is_the_first_row_at_or_after(taps, stride):
    time = np.sort(np.r_[1e-3 * np.arange(400), 0.3995, 0.1234])
    for n in (1, 2, 57, 130, len(time)):
        wanted = time[n - 1] - SAMPLING * stride * np.arange(taps - 1, -1, -1)
        expected = np.minimum(np.searchsorted(time[:n], wanted - 1e-7), n - 1)
        assert window_rows(time[:n], taps, stride).tolist() == expected.tolist()


def test_excess_is_as_defined():
    sets = [NetworkSet.load(file) for file in shipped_networks()]
    together = NetworkSet.stacked(sets)
    rng = np.random.default_rng(4)
    for scale in (0.1, 1.0, 10.0):
        inputs = scale * rng.standard_normal((5, len(sets[0].architecture.inputs)))
        expected = []
        for one in sets:
            a = {name: values.astype(float) for name, values in one.arrays.items()}
            varied = one.arrays["input_high"] > one.arrays["input_low"]
            compared, slack = range_scale(one.architecture.inputs, one.arrays["input_scale"], varied)
            low, high = (
                (one.arrays["input_low"] - slack).astype(float),
                (one.arrays["input_high"] + slack).astype(float),
            )
            single = (np.maximum(low - inputs, inputs - high) / (high - low)).max(axis=1)
            z = (inputs - a["input_mean"]) / compared
            distance = np.linalg.norm(z[:, None] - a["range_states"], axis=2).min(axis=1)
            expected.append(np.stack([single, distance / a["range_reach"] - 1.0], axis=1))
        np.testing.assert_allclose(together.excess(inputs), np.concatenate(expected), rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("members", [1, 2, 5])
def test_mean_and_spread(members):
    values = np.random.default_rng(5).standard_normal((members, 5, 6))
    mean, spread = mean_and_spread(values)
    np.testing.assert_allclose(mean, values.mean(axis=0), rtol=1e-12, atol=1e-15)
    expected = values.std(axis=0, ddof=1) if members > 1 else np.zeros((5, 6))
    np.testing.assert_allclose(spread, expected, rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize("fallback", [True, False])
@pytest.mark.parametrize("layer", ["lstm", "dense", "polynomial"])
@pytest.mark.parametrize(
    ("quantity", "value"), [("velocity", math.nan), ("velocity", -math.inf), ("rotation", math.nan)]
)
def test_motion_that_is_not_finite_is_said(vehicle, layer, fallback, quantity, value):
    """Of one body at one instant, whatever the layers: never a load that looks sound."""
    architecture = replace(SMALL, layer=layer, taps=1 if layer == "polynomial" else SMALL.taps)
    model = SurrogateHydrodynamics(made_up(architecture, vehicle), fallback=fallback)
    model.start(vehicle, WATERS[0], 1e-3)
    states = motion()
    getattr(states, quantity)[-1, 2] = value
    with pytest.raises(SimulationError, match=r"SurrogateHydrodynamics gave a load that is not finite at 0\.0590 s"):
        checked_wrenches(model, states, lambda: states)
