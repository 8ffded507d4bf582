"""Settings of the flow solver."""

from __future__ import annotations

from dataclasses import dataclass

import numba

from exumob.flow.turbulence import closures
from exumob.support.checks import require_positive, require_within

DEFAULT_CLOSURE = closures.Smagorinsky()
SURFACES = "thinc", "plic"


@dataclass(frozen=True)
class FlowSettings:
    """Settings of the flow solver; the defaults are those of the vehicle runs.

    Parameters
    ----------
    follow : int or None
        Solid whose place and heading the grid follows (0 the hull); None: the grid stays in the world's axes.
    far_x, far_y : bool
        Whether the sides across x and across y are far field (the undisturbed current, with a zone before it that
        absorbs waves); walls otherwise.
    absorbing_width : float
        Width of that zone [m].
    absorbing_strength : float
        Relaxation rate at the very side, times the zone's width over sqrt(g depth) [-]; it falls with the cube of the
        distance. A long wave comes back from a side with exp(-strength / 2) of its height, one that meets it at an
        angle a with exp(-strength cos(a) / 2); more strength than needed for that reflects waves on the way in.
    closed_top : bool
        True: the top is a wall, for basins full of water.
    closure : object or None
        Turbulence model (`exumob.flow.turbulence.closures.Closure`); None: laminar.
    viscosity : float
        Molecular, kinematic [m^2/s].
    surface : str
        How the surface is carried: "thinc", a smooth profile, or "plic", a plane in each cell, as a cross-check.
    wall_shear : bool
        Whether solids exert wall friction.
    bed_roughness : float or None
        Equivalent sand roughness of the bed [m], 0 smooth: the bed, at rest in the world, exerts the shear of the log
        law. None: it slips, and an undisturbed current stays uniform, as the far field supposes.
    sharp_edges : bool
        Whether cells at sharp edges of solids are closed when their centre is inside, so that the flow separates
        there. It costs momentum of bodies that move through the grid (not of those that it follows).
    pore_pressure : bool
        Whether the pressure on solids goes on below the bed (saturated soil).
    courant : float
        Largest sum over the axes of speed times step over width [-]; longer steps are divided.
    tolerance : float
        Divergence times step left by the pressure solution [-].
    iterations : int
        Largest number of pressure iterations.
    closest_surface : float
        Least distance of the surface from a cell's centre over the distance between centres [-].
    void_stiffness : float
        Closing of voids, div u = -void_stiffness (1 - fraction)^2 p / density [s/m^2].
    refill_depth : float
        How deep solids are refilled with the fraction beside them [cells].
    fastest : float
        Speed relative to the grid above which a step counts as failed [m/s].
    threads : int
        Threads of the kernels.
    """

    follow: int | None = 0
    far_x: bool = True
    far_y: bool = True
    absorbing_width: float = 0.6
    absorbing_strength: float = 10.0
    closed_top: bool = False
    closure: closures.Closure | None = DEFAULT_CLOSURE
    viscosity: float = closures.MOLECULAR_VISCOSITY
    surface: str = "thinc"
    wall_shear: bool = True
    bed_roughness: float | None = None
    sharp_edges: bool = True
    pore_pressure: bool = True
    courant: float = 0.4
    tolerance: float = 1.0e-7
    iterations: int = 60
    closest_surface: float = 0.01
    void_stiffness: float = 1000.0
    refill_depth: float = 3.0
    fastest: float = 30.0
    threads: int = 1

    def __post_init__(self) -> None:
        require_positive(
            "FlowSettings", absorbing_width=self.absorbing_width, tolerance=self.tolerance, fastest=self.fastest,
            iterations=self.iterations,
        )  # fmt: skip
        if self.surface not in SURFACES:
            raise ValueError(f"FlowSettings.surface = {self.surface!r}; take one of {', '.join(SURFACES)}.")
        require_within("FlowSettings", 0.0, 1.0e2, absorbing_strength=self.absorbing_strength)
        require_within("FlowSettings", 0.0, 1.0e5, void_stiffness=self.void_stiffness)
        require_within("FlowSettings", 0.0, 1.0, viscosity=self.viscosity)
        if self.bed_roughness is not None:
            require_within("FlowSettings", 0.0, 0.1, bed_roughness=self.bed_roughness)
        require_within(
            "FlowSettings", 0.01, 0.5, "the transport of the fraction is bounded up to 0.5.", courant=self.courant
        )  # fmt: skip
        require_within("FlowSettings", 1e-4, 0.2, closest_surface=self.closest_surface)
        require_within("FlowSettings", 1.0, 6.0, refill_depth=self.refill_depth)
        most = int(numba.config.NUMBA_NUM_THREADS)
        require_within(
            "FlowSettings", 1, most, "set the environment variable NUMBA_NUM_THREADS before the start for more.",
            threads=self.threads,
        )  # fmt: skip
        if self.follow is not None and not (self.far_x and self.far_y):
            raise ValueError(
                "FlowSettings.follow: a grid that moves has no walls; set follow=None for a tank, or "
                "far_x = far_y = True."
            )
