"""The renderer: perspective, hidden surfaces, what cannot be drawn."""

import numpy as np
import pytest

from exumob.flow.output.pictures import fill_masked
from exumob.flow.output.render import Camera, render


def square(z, size):
    p = np.array([[-size, -size, z], [size, -size, z], [size, size, z], [-size, size, z]])
    return np.array([p[[0, 1, 2]], p[[0, 2, 3]]])


def test_near_hides_far_whatever_the_order():
    camera = Camera((0.0, -0.001, 10.0), (0.0, 0.0, 0.0), 60, 60, 250.0, (30.0, 30.0))
    low, high = square(0.0, 1.0), square(1.0, 0.4)
    red, blue = np.tile([1.0, 0.0, 0.0], (2, 3, 1)), np.tile([0.0, 0.0, 1.0], (2, 3, 1))
    one = render(np.concatenate([low, high]), np.concatenate([red, blue]), camera)
    other = render(np.concatenate([high, low]), np.concatenate([blue, red]), camera)
    assert (one == other).all()
    assert one[30, 30] == pytest.approx([0.0, 0.0, 1.0])
    assert one[30, 10] == pytest.approx([1.0, 0.0, 0.0])
    assert one[1, 1] == pytest.approx([1.0, 1.0, 1.0])


def test_size_on_the_picture_is_that_of_the_perspective():
    """A square of 2 m seen from 10 m at 250 pixels a radian: 50 pixels, 2500 of area."""
    camera = Camera((0.0, -1e-4, 10.0), (0.0, 0.0, 0.0), 80, 80, 250.0, (40.0, 40.0))
    image = render(square(0.0, 1.0), np.zeros((2, 3, 3)), camera)
    assert (1.0 - image[..., 0]).sum() == pytest.approx(2500.0, rel=0.02)


def test_camera_around_holds_everything():
    points = np.random.default_rng(1).normal(size=(50, 3))
    camera = Camera.around(points, (-9.0, -6.0, 8.0), 300, 200)
    x, y, inverse = camera.project(points).T
    assert (inverse > 0.0).all()
    assert x.min() >= 0.0
    assert x.max() <= 300.0
    assert y.min() >= 0.0
    assert y.max() <= 200.0
    assert max(np.ptp(x) / 300.0, np.ptp(y) / 200.0) == pytest.approx(0.96)


def test_triangles_that_cannot_be_drawn_are_left_out():
    camera = Camera((0.0, -1e-4, 10.0), (0.0, 0.0, 0.0), 40, 40, 100.0, (20.0, 20.0))
    bad = square(0.0, 1.0)
    bad[:, 0, 2] = np.nan
    behind = square(11.0, 1.0)
    assert (render(np.concatenate([bad, behind]), np.zeros((4, 3, 3)), camera) == 1.0).all()


def test_masked_cells_are_filled_only_near_others():
    values = np.full((1, 9), np.nan)
    values[0, :2] = [1.0, 2.0]
    assert fill_masked(values, 2)[0] == pytest.approx([1, 2, 2, 2, *[np.nan] * 5], nan_ok=True)
