"""Settings of the flow solver."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

import numba

from exumob.flow.turbulence import closures
from exumob.support.declared import Declared
from exumob.support.quantities import Quantity

DEFAULT_CLOSURE = closures.Smagorinsky()
ABSORBING = 0.6
"""Width of the zones that absorb waves before the window's sides, over the reference length [-]."""
SurfaceTransport = Literal["thinc", "plic"]
"""How the surface is carried, by name."""


@dataclass(frozen=True)
class FlowSettings(Declared):
    """Settings of the flow solver; the defaults are those of the vehicle runs."""

    follow: Annotated[int | None, Quantity("1", at_least=0, at_most=10**6)] = 0
    """Solid whose place and heading the grid follows (0 the hull); None: the grid stays in the world's axes"""
    far_x: bool = True
    """Whether the sides across x are far field: the undisturbed current, with a zone before it that absorbs waves;
    walls otherwise"""
    far_y: bool = True
    """The same of the sides across y"""
    reference_length: Annotated[float | None, Quantity("m", at_least=1e-3, at_most=1e4)] = None
    """Length that sets, by Froude's law, what has dimensions of its own: the width of the absorbing zones, the rate at
    which faces hardly open are drawn to the slip velocity, the fastest fall of thin water, the closing of voids [m].
    None: that of the vehicle in the window, if there is one (`exumob.flow.vehicle_window.settings_for_vehicle`),
    else 1 m"""
    absorbing_width: Annotated[float | None, Quantity("m", at_least=1e-4, at_most=1e4)] = None
    """Width of that zone [m]; None: 0.6 of the reference length"""
    absorbing_strength: Annotated[float, Quantity("1", at_least=0.0, at_most=100.0)] = 10.0
    """Relaxation rate at the very side, times the zone's width over sqrt(g depth) [-]; it falls with the cube of the
    distance. A long wave comes back from a side with exp(-strength / 2) of its height, one that meets it at an angle a
    with exp(-strength cos(a) / 2); more strength than needed for that reflects waves on the way in"""
    closed_top: bool = False
    """True: the top is a wall, for basins full of water"""
    closure: closures.Closure | None = DEFAULT_CLOSURE
    """Turbulence model (`exumob.flow.turbulence.closures`): `Smagorinsky`, `KOmegaSST` or one of your own; None:
    laminar"""
    viscosity: Annotated[float, Quantity("m^2/s", at_least=0.0, at_most=1.0)] = closures.MOLECULAR_VISCOSITY
    """Molecular, kinematic [m^2/s]"""
    surface: SurfaceTransport = "thinc"
    """How the surface is carried: "thinc", a smooth profile, or "plic", a plane in each cell, as a cross-check"""
    wall_shear: bool = True
    """Whether solids exert wall friction"""
    bed_roughness: Annotated[float | None, Quantity("m", at_least=0.0, at_most=0.1)] = None
    """Equivalent sand roughness of the bed [m], 0 smooth: the bed, at rest in the world, exerts the shear of the log
    law. None: it slips, and an undisturbed current stays uniform, as the far field supposes"""
    sharp_edges: bool = True
    """Whether cells at sharp edges of solids are closed when their centre is inside, so that the flow separates there.
    It costs momentum of bodies that move through the grid (not of those that it follows)"""
    smooth_separation: bool = False
    """Whether smooth walls that water moves away from hold it fast, so that the flow separates behind round bodies.
    Without it the water follows them, and a round column has half its drag. Off: what comes with exumob (runs,
    networks, coefficients) was made without"""
    pore_pressure: bool = True
    """Whether the pressure on solids goes on below the bed (saturated soil)"""
    courant: Annotated[
        float,
        Quantity("1", at_least=0.01, at_most=0.5, remedy="the transport of the fraction is bounded up to 0.5."),
    ] = 0.4
    """Largest sum over the axes of speed times step over width [-]; longer steps are divided"""
    tolerance: Annotated[float, Quantity("1", at_least=1e-14, at_most=1.0)] = 1.0e-7
    """Divergence times step left by the pressure solution [-]"""
    iterations: Annotated[int, Quantity("1", at_least=1, at_most=100_000)] = 60
    """Largest number of pressure iterations"""
    closest_surface: Annotated[float, Quantity("1", at_least=1e-4, at_most=0.2)] = 0.01
    """Least distance of the surface from a cell's centre over the distance between centres [-]"""
    void_stiffness: Annotated[float, Quantity("s/m^2", at_least=0.0, at_most=1e5)] = 1000.0
    """Closing of voids, div u = -void_stiffness (1 - fraction)^2 p / density [s/m^2], at a reference length of 1 m; it
    falls with the power 1.5 of that length"""
    refill_depth: Annotated[float, Quantity("1", at_least=1.0, at_most=6.0)] = 3.0
    """How deep solids are refilled with the fraction beside them [cells]"""
    fastest: Annotated[float, Quantity("m/s", at_least=1e-3, at_most=1e4)] = 30.0
    """Speed relative to the grid above which a step counts as failed [m/s]"""
    threads: Annotated[int, Quantity("1", at_least=1)] = 1
    """Threads of the kernels"""

    @property
    def size(self) -> float:
        """Reference length over 1 m [-]: the paper's vehicle has exactly 1."""
        return 1.0 if self.reference_length is None else self.reference_length

    @property
    def zone_width(self) -> float:
        """Width of the zone that absorbs waves [m]."""
        return ABSORBING * self.size if self.absorbing_width is None else self.absorbing_width

    def _check(self) -> None:
        most = int(numba.config.NUMBA_NUM_THREADS)
        if self.threads > most:
            raise ValueError(
                f"FlowSettings.threads = {self.threads} must be >= 1 and <= {most}; set the environment variable "
                "NUMBA_NUM_THREADS before the start for more."
            )
        if self.follow is not None and not (self.far_x and self.far_y):
            raise ValueError(
                f"FlowSettings.follow = {self.follow}: a grid that moves has no walls; set follow=None for a tank, or "
                "far_x = far_y = True."
            )
