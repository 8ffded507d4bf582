"""How much water does an accelerated body carry along?

A sphere in unbounded water carries half the mass that it displaces (Lamb, Hydrodynamics, 1932, art. 92), and so does a
half submerged one that heaves at infinite frequency (Hulme, J. Fluid Mech. 121 (1982) 443). Limits: 4 % at five cells
to the radius, 2 % at eight, for the worst of several places within a cell; spread over the places 1 %; order at
least 1.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from exumob.flow import FlowSettings, FlowSolver, Grid, Solid, sphere
from exumob.support.declared import checked
from exumob.verification.check import Case, Check, absolute, at_least, relative, reported
from exumob.verification.measures import observed_order
from exumob.verification.options import Cells, CellSize
from exumob.verification.single_body import loads_over, one_pose
from exumob.water.conditions import Water

PLACES = ((0.0, 0.0, 0.0), (0.25, 0.1, 0.3), (0.5, 0.0, 0.0), (0.5, 0.5, 0.5))
"""Places of a solid's centre within a cell [cells], shape (n, 3)."""


@checked
def sphere_added_mass(cells: Cells, place: Sequence[float] = (0.0, 0.0, 0.0)) -> float:
    """Added mass of an accelerated sphere over the mass of its volume of water; 0.5 in unbounded water.

    The basin's walls are nine radii away, which adds about 0.2 %.

    Parameters
    ----------
    cells : float
        Number of cells to the radius [-].
    place : sequence of 3 float
        Place of the centre within a cell [cells].
    """
    radius, reach = 0.1, 0.9
    size = radius / cells
    grid = Grid.stretched((-0.2, -0.2, 0.0), (0.2, 0.2, 0.4), (-reach, -reach, 0.0), (reach, reach, 1.2), size, 1.08)
    z = grid.z_faces[-1] - grid.z_faces[::-1]  # fine cells at the top, mirrored below
    z = np.concatenate([z, z[-1] + grid.z_faces[1:]])
    grid = Grid(grid.x_faces, grid.y_faces, z)
    settings = FlowSettings(
        follow=None, far_x=False, far_y=False, closed_top=True, closure=None, viscosity=0.0, wall_shear=False
    )
    solver = FlowSolver(grid, (sphere(radius),), Water(float(z[-1])), settings)
    center = np.array([0.0, 0.0, 0.5 * z[-1]]) + size * np.asarray(place)
    ahead = np.array([1.0, 0.0, 0.0])
    loads = loads_over(solver, lambda t: one_pose(center + 0.5 * t * t * ahead, t * ahead), 1e-3, 3e-3)
    return float(-loads[-1, 0] / (1000.0 * 4.0 / 3.0 * math.pi * radius**3))


def check_sphere_added_mass() -> list[Check]:
    """Three grids a factor of sqrt(2) apart at four places within a cell each."""
    checks, means = [], []
    for cells, limit in ((4.0, math.inf), (4.0 * math.sqrt(2.0), math.inf), (5.0, 0.04), (8.0, 0.02)):
        values = [sphere_added_mass(cells, place) for place in PLACES]
        worst = max(values, key=lambda value: abs(value - 0.5))
        checks.append(relative(f"added mass, R/h = {cells:.3g}, worst of four places", worst, 0.5, limit))
        if limit < math.inf:
            spread = (max(values) - min(values)) / 0.5
            checks.append(absolute(f"spread over places, R/h = {cells:.3g}", spread, 0.0, 0.01))
        if cells != 5.0:
            means.append(float(np.mean(values)))
    order = observed_order(means, math.sqrt(2.0))
    checks.append(at_least("order of the mean over places, R/h = 4, 5.66, 8", order, 1.0))
    gain = math.sqrt(2.0) ** order - 1.0
    checks.append(reported("added mass extrapolated to h = 0", means[2] + (means[2] - means[1]) / gain, 0.5))
    return checks


@checked
def surface_added_mass(solid: Solid, half_width: float, draught: float, displaced: float, cell_size: CellSize,
                       depth: float, shift: float = 0.0) -> float:  # fmt: skip
    """Added mass in heave at infinite frequency (p = 0 on the surface) over the mass of water displaced.

    The acceleration is 10 m/s^2, that a jump of the buoyancy by 0.2 %, when the level passes the middle of a cell, does
    not weigh in (measured by `lift_jump`).

    Parameters
    ----------
    solid : Solid
        Its origin lies in the water's surface.
    half_width : float
        Largest horizontal extent from the origin [m].
    draught : float
        Depth of the solid's lowest point [m].
    displaced : float
        Volume of water displaced [m^3].
    cell_size : float
        Cell size near the solid [m].
    depth : float
        Depth of the basin [m]; its walls are six half widths away.
    shift : float
        Place of the level and the solid within a cell [cells].
    """
    reach, near = 6.0 * half_width, 1.5 * half_width
    air = 0.8 * half_width
    fine = Grid.stretched(
        (-near, -near, 0.0), (near, near, draught + near), (-reach, -reach, 0.0), (reach, reach, depth), cell_size, 1.08
    )
    below = fine.z_faces[-1] - fine.z_faces[::-1]
    step = below[-1] - below[-2]
    z = np.concatenate([below, below[-1] + step * np.arange(1, math.ceil(air / step) + 1)])
    level = float(below[-1]) + shift * cell_size
    settings = FlowSettings(follow=None, far_x=False, far_y=False, closure=None, viscosity=0.0, wall_shear=False)
    solver = FlowSolver(Grid(fine.x_faces, fine.y_faces, z), (solid,), Water(level), settings)
    origin, down = np.array([0.0, 0.0, level]), np.array([0.0, 0.0, -1.0])
    still = one_pose(origin, 0.0 * down)
    buoyancy = loads_over(solver, lambda t: still, 1e-3, 1e-3)[-1, 2]
    loads = loads_over(solver, lambda t: one_pose(origin + 5.0 * t * t * down, 10.0 * t * down), 1e-3, 3e-3)
    return float((loads[-1, 2] - buoyancy) / (10.0 * 1000.0 * displaced))


@checked
def floating_sphere_added_mass(cells: Cells, shift: float = 0.0) -> float:
    """Heave of a half submerged sphere at infinite frequency: 0.5 (Hulme, J. Fluid Mech. 121 (1982) 443)."""
    radius = 0.1
    volume = 2.0 / 3.0 * math.pi * radius**3
    return surface_added_mass(sphere(radius), radius, radius, volume, radius / cells, 0.7, shift)


@checked
def check_floating_added_mass(cells: Cells = 6.0) -> list[Check]:
    """A half submerged sphere at four places of the level within a cell; limit as for the sphere in the depth."""
    values = [floating_sphere_added_mass(cells, shift) for shift in (0.0, 0.25, 0.5, 0.75)]
    worst = max(values, key=lambda value: abs(value - 0.5))
    return [
        relative(f"added mass in heave at the surface, R/h = {cells:g}, worst of four levels", worst, 0.5, 0.04),
        absolute("spread over levels", (max(values) - min(values)) / 0.5, 0.0, 0.01),
    ]


CASES: tuple[Case, ...] = (
    Case(
        "added-mass",
        "An accelerated sphere in unbounded water: half its displaced mass (Lamb 1932, art. 92)",
        check_sphere_added_mass,
        2.0,
        slow=True,
    ),
    Case(
        "floating-added-mass",
        "A half submerged sphere in fast heave: half its displaced mass (Hulme 1982)",
        check_floating_added_mass,
        0.2,
    ),
)
