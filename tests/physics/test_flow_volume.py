"""What the motion of solids adds to the water goes back to the surface near them: all of it, smoothly, mirrored."""

import numpy as np
import pytest

from exumob.flow import FlowSettings, Grid, Poses, box, cylinder
from exumob.flow.placement import Placement
from exumob.flow.volume_at_solids import ClosedParts, return_volume
from exumob.support.rotations import about_z

STEERED = 0.2
"""Angle of the wheels [rad]"""


def placed(side=1.0):
    """A box between two steered wheels, 2 cm over a bed, on a grid that is stretched and symmetric about y = 0."""
    grid = Grid.stretched((-0.2, -0.25, 0.0), (0.2, 0.25, 0.2), (-0.5, -0.5, 0.0), (0.5, 0.5, 0.3), 0.025)
    solids = box(0.3, 0.16, 0.2), cylinder(0.06, 0.04, 0.01), cylinder(0.06, 0.04, 0.01)
    placement = Placement(grid, solids, None, FlowSettings())
    turned = about_z(side * STEERED)
    where = [[0.012, 0.0, 0.12], [0.031, 0.187, 0.08], [0.031, -0.187, 0.08]]
    placement.place(Poses.at_rest(where, np.array([np.eye(3), turned, turned])), np.zeros(3))
    return grid, placement


def wavy(grid, seed=0):
    """Fraction of water with an uneven surface about 0.11 m above the bed, and spray above it, halo included."""
    rng, shape, m = np.random.default_rng(seed), grid.padded_shape, grid.metrics
    level = 0.11 + 0.02 * rng.random((shape[0], 1, shape[2]))
    fraction = np.clip((level - m.zf[None, :-1, None]) / m.dz[None, :, None], 0.0, 1.0)
    spray = (rng.random(shape) < 0.02) & (fraction == 0.0)
    return np.where(spray, 0.3, fraction)


def returned(placement, fraction, gained):
    """Change of the fraction by `return_volume`, and the closed share of the cells."""
    changed, closed, regions = fraction.copy(), ClosedParts(fraction.shape), placement.solids.regions
    closed.mark(placement.bodies, regions, placement.metrics)
    return_volume(
        changed, np.empty_like(changed), np.array(gained), closed.now, placement.bodies, regions, placement.margin,
        placement.bed_heights, placement.metrics,
    )  # fmt: skip
    return changed - fraction, closed.now


@pytest.mark.parametrize("gained", [(2e-6, 1e-6, 3e-6), (-2e-6, -1e-6, -3e-6), (2e-6, -1e-6, 0.0)])
def test_volume_is_what_was_gained(gained):
    grid, placement = placed()
    change, closed = returned(placement, wavy(grid), gained)
    m = placement.metrics
    volumes = change * (1.0 - closed) * m.dy[:, None, None] * m.dz[:, None] * m.dx
    for n, value in enumerate(gained):
        assert volumes[placement.bodies.nearest == n].sum() == pytest.approx(-value, rel=1e-10, abs=1e-20)


@pytest.mark.parametrize("gained", [(2e-6, 1e-6, 3e-6), (-2e-6, -1e-6, -3e-6), (2e-6, -1e-6, 3e-6)])
def test_mirrored_water_takes_its_mirror_image(gained):
    """To what area fractions in single precision leave; index boxes are a cell longer on one side."""
    grid, placement = placed()
    fraction = wavy(grid)
    here, _ = returned(placement, fraction, gained)
    _, mirrored = placed(side=-1.0)
    there, _ = returned(mirrored, fraction[::-1].copy(), (gained[0], gained[2], gained[1]))
    assert np.abs(here).max() > 1e-3
    assert here == pytest.approx(there[::-1], abs=1e-6 * np.abs(here).max())


@pytest.mark.parametrize("gained", [1e-6, -1e-6])
def test_only_the_surface_takes_part(gained):
    """Neither cells that lack a last digit of water, nor films and drops of one, take or give more than that."""
    grid, placement = placed()
    fraction = wavy(grid)
    rng = np.random.default_rng(1)
    digits = 1e-7 * rng.random(fraction.shape)
    other = np.where(fraction > 0.5, fraction - digits, fraction + digits)
    here, there = (returned(placement, c, (gained,) * 3)[0] for c in (fraction, other))
    assert here == pytest.approx(there, abs=1e-4 * np.abs(here).max())
    deep = fraction[:, 2:-2] + fraction[:, 3:-1] == 2.0
    assert np.abs(here[:, 2:-2][deep]).max() == 0.0
    spray = (fraction[:, 2:-2] > 0.0) & (fraction[:, 1:-3] < 0.5)
    assert spray.sum() > 20
    assert (here[:, 2:-2][spray] <= 0.0).all()
