"""Rotations about the axes: sense, orthogonality, composition."""

import math

import numpy as np
import pytest

from exumob.support.rotations import about_x, about_y, about_z


def test_yaw_turns_the_bow_to_the_left_and_pitch_turns_it_down():
    quarter = 0.5 * math.pi
    assert about_z(quarter) @ [1.0, 0.0, 0.0] == pytest.approx([0.0, 1.0, 0.0])
    assert about_y(quarter) @ [1.0, 0.0, 0.0] == pytest.approx([0.0, 0.0, -1.0])
    assert about_x(quarter) @ [0.0, -1.0, 0.0] == pytest.approx([0.0, 0.0, -1.0])  # the right side goes down


@pytest.mark.parametrize("about", [about_x, about_y, about_z])
def test_rotations_about_one_axis_add_up(about):
    turned = about(0.3) @ about(0.5)
    assert np.abs(turned - about(0.8)).max() < 1e-15
    assert np.abs(turned @ turned.T - np.eye(3)).max() < 1e-15
    assert np.linalg.det(turned) == pytest.approx(1.0)
