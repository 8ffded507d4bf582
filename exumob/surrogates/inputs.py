"""Input features of the networks: quantities by name, the same in training and in the loop.

`PAPER_INPUTS` are the five states of paper Eq. (7). The others add quantities on which the water's wrenches depend
besides: velocities through the water, rates of rotation, immersion and tilt.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from exumob.support.arrays import Array
from exumob.vehicle.motion import BodyStates
from exumob.water.conditions import Water
from exumob.water.flow_states import FLOW_STATE_UNITS, FLOW_STATES, HorizontalMotion, flow_states, horizontal_motion


class Input(NamedTuple):
    """One input feature of a network."""

    unit: str
    mirror: int
    """-1: the feature changes its sign when the motion is mirrored in the plane of symmetry; 1: it does not"""
    meaning: str


INPUTS = {
    **{
        name: Input(unit, -1 if name in ("sideslip_angle", "angle_of_attack") else 1, "paper Eq. (7)")
        for name, unit in zip(FLOW_STATES, FLOW_STATE_UNITS, strict=True)
    },
    "forward_flow": Input("m/s", 1, "speed through the water, along the body's heading"),
    "lateral_flow": Input("m/s", -1, "speed through the water, to the left of the heading"),
    "forward_speed": Input("m/s", 1, "speed over ground, along the heading"),
    "lateral_speed": Input("m/s", -1, "speed over ground, to the left of the heading"),
    "yaw_rate": Input("rad/s", -1, "of the body"),
    "roll_rate": Input("rad/s", -1, "about the body's x axis"),
    "pitch_rate": Input("rad/s", 1, "about the body's y axis"),
    "heave_rate": Input("m/s", 1, "upward speed of the body's origin"),
    "immersion": Input("m", 1, "still level above the body's origin"),
    "roll": Input("1", -1, "world z component of the body's y axis"),
    "pitch": Input("1", 1, "world z component of the body's x axis, reversed: bow down positive"),
    "steering": Input("rad", -1, "mean heading of the front wheels less the hull's"),
    "hull_yaw_rate": Input("rad/s", -1, "of the hull"),
    "hull_attack": Input("rad", -1, "angle of attack of the hull"),
}
"""All input features, by name."""
PAPER_INPUTS = FLOW_STATES
"""Input features of the paper, Eq. (7)."""
MIRRORED_BODIES = (0, 2, 1, 4, 3)
"""Index of the body that takes each body's place in the mirrored motion."""
MIRRORED_LOADS = np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])
"""Signs of a wrench (Fx, Fy, Fz, Mx, My, Mz) in the mirrored motion."""


def network_inputs(states: BodyStates, water: Water, names: Sequence[str]) -> Array:
    """Return the input features of the five networks.

    Parameters
    ----------
    states : BodyStates
        n instants.
    water : Water
    names : sequence of str
        Names from `INPUTS`.

    Returns
    -------
    array, shape (n, 5, len(names))
        Instant, body, feature, in the units of `INPUTS`.

    Raises
    ------
    ValueError
        If a name is not known.
    """
    unknown = [name for name in names if name not in INPUTS]
    if unknown:
        raise ValueError(f"network input {unknown[0]!r} is not known; use {', '.join(INPUTS)}.")
    motion = horizontal_motion(states)
    columns = np.moveaxis(flow_states(states, water, motion), -1, 0)
    found: dict[str, Array] = dict(zip(FLOW_STATES, columns, strict=True))
    if not set(names) <= set(found):
        found |= _additional_features(states, water, motion, found)
    return np.stack([found[name] for name in names], axis=-1)


def mirror_signs(names: Sequence[str]) -> Array:
    """Return the signs of input features in the mirrored motion, shape (len(names),)."""
    return np.array([float(INPUTS[name].mirror) for name in names])


def _additional_features(
    states: BodyStates, water: Water, motion: HorizontalMotion, flow: dict[str, Array]
) -> dict[str, Array]:  # fmt: skip
    """Return all features that are not among the flow states of Eq. (7); `flow` holds those."""
    rotation = states.rotation
    heading, cos, sin, forward, lateral = motion
    current_x, current_y, _ = water.velocity
    angular_velocity = np.einsum("nbij,nbi->nbj", rotation, states.angular_velocity)  # body axes
    steering = np.arctan2(np.sin(heading[:, 1:3] - heading[:, :1]), np.cos(heading[:, 1:3] - heading[:, :1]))

    def for_all_bodies(value: Array) -> Array:
        return np.broadcast_to(value[:, None], heading.shape)

    return {
        "forward_flow": forward - cos * current_x - sin * current_y,
        "lateral_flow": lateral - cos * current_y + sin * current_x,
        "forward_speed": forward,
        "lateral_speed": lateral,
        "yaw_rate": states.angular_velocity[..., 2],
        "roll_rate": angular_velocity[..., 0],
        "pitch_rate": angular_velocity[..., 1],
        "heave_rate": states.velocity[..., 2],
        "immersion": water.depth - states.position[..., 2],
        "roll": rotation[..., 2, 1],
        "pitch": -rotation[..., 2, 0],
        "steering": for_all_bodies(steering.mean(axis=1)),
        "hull_yaw_rate": for_all_bodies(states.angular_velocity[:, 0, 2]),
        "hull_attack": for_all_bodies(flow["angle_of_attack"][:, 0]),
    }
