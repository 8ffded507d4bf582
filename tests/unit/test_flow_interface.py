"""Planes in cells (PLIC) against exact volumes."""

import numpy as np
import pytest

from exumob.flow import FlowSettings
from exumob.flow.free_surface import plane_offset, plic_flux, volume_below

RNG = np.random.default_rng(3)


def normals(count):
    """Ordered, positive, of sum 1; with zeros among them."""
    m = RNG.random((count, 3)) ** 3 * (RNG.random((count, 3)) > 0.2)
    m = m[m.sum(axis=1) > 0.0]
    return np.sort(m / m.sum(axis=1, keepdims=True), axis=1)


def sampled(m, offset, low=0.0, high=1.0, n=200):
    """Volume below the plane with the first coordinate between two bounds, by midpoints along two axes, exact in z."""
    x, y = low + (high - low) * (np.arange(n) + 0.5) / n, (np.arange(n) + 0.5) / n
    depth = (offset - m[0] * x[:, None] - m[1] * y[None, :]) / m[2]
    return (high - low) * np.clip(depth, 0.0, 1.0).mean()


def test_volume_below_a_plane():
    for m in normals(60):
        for offset in RNG.random(4):
            assert volume_below(*m, offset) == pytest.approx(sampled(m, offset), abs=2e-4)


def test_offset_is_the_inverse():
    for m in normals(400):
        for share in (*RNG.random(5), 1e-8, 1.0 - 1e-8, 0.5):
            assert volume_below(*m, plane_offset(*m, share)) == pytest.approx(share, abs=1e-11)


@pytest.mark.parametrize("courant", [0.3, -0.3, 0.05])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_flux_is_the_volume_in_the_slab_that_leaves(courant, sign):
    size = abs(courant)
    for m in normals(40):
        along, others = m[0], m[1:]
        offset = RNG.random()
        fraction = sampled((along, *others), offset, n=400)
        # water at low x if the fraction falls with x; the slab at the face through which the water leaves
        at_high_face = courant > 0.0
        near_water = at_high_face == (sign > 0.0)
        low, high = (0.0, size) if near_water else (1.0 - size, 1.0)
        found = plic_flux(fraction, sign * along, others[0], -others[1], courant)
        assert found == pytest.approx(np.sign(courant) * sampled((along, *others), offset, low, high), abs=5e-4)


def test_full_and_empty_cells_and_no_flow():
    assert plic_flux(0.4, 0.2, 0.3, 0.5, 0.0) == 0.0
    assert plic_flux(1.0, 0.2, 0.3, 0.5, 0.25) == pytest.approx(0.25)
    assert plic_flux(0.0, 0.2, 0.3, 0.5, 0.25) == 0.0


def test_unknown_surface_is_refused():
    with pytest.raises(ValueError, match=r"FlowSettings\.surface = 'mule' is not known; use 'thinc' or 'plic'"):
        FlowSettings(surface="mule")
