"""State of the flow that passes from step to step, and the reports of the solver."""

from __future__ import annotations

from dataclasses import dataclass, field, fields

import numpy as np
from numpy.typing import NDArray

from exumob.flow.active_rows import ActiveRows
from exumob.support.arrays import Array


@dataclass
class FlowState:
    """All that changes in time and cannot be computed from the rest; arrays carry the halo.

    The names of the fields are those of saved states.
    """

    u: Array
    v: Array
    w: Array
    """Absolute velocity on the low faces, grid axes [m/s]; this and what follows: 0 outside `lo`, `hi`"""
    ex: Array
    ey: Array
    ez: Array
    """... extended from faces at least half open into those less open [m/s]"""
    cx: Array
    cy: Array
    cz: Array
    """Velocity on full faces that carries fraction and momentum [m/s]"""
    lo: NDArray[np.int32]
    hi: NDArray[np.int32]
    """Bounds of the rows where velocity is kept up (`ActiveRows`)"""
    fraction: Array
    """Water per full cell [-]"""
    wet: NDArray[np.uint8]
    """Cells that were at least half full when the pressure was solved"""
    phi: Array
    """dt times piezometric pressure over density [m^2/s]"""
    eta_y: Array
    """In the far field's zones, the part of the level's rise that water flowing along y brought [m], shape (ny, nx)"""
    phi_dt: float
    """The dt in phi [s]"""
    time: float
    """[s]"""
    frame: Array
    """Pose of the grid: origin x, y [m] and yaw [rad] in the world, shape (3,)"""
    steps: int = 0
    """Steps done"""
    step: float = 0.0
    """Length of the last step [s]"""
    calm: int = 0
    """Steps since one as short was needed"""
    courant_rate: float = 0.0
    """Largest rate at which water crosses cells [1/s]"""
    volume_added: float = 0.0
    """Water that the far field has added to the window [m^3]"""
    turbulence: Array = field(default_factory=lambda: np.zeros(0))
    """Fields of the closure, shape (number, ny, nz, nx)"""

    @classmethod
    def zeros(cls, shape: tuple[int, int, int], turbulence_fields: int = 0) -> FlowState:
        """All zero, for fields of this shape."""
        u, v, w, ex, ey, ez, cx, cy, cz, fraction, phi = (np.zeros(shape) for _ in range(11))
        rows, wet = ActiveRows.padded(shape), np.zeros(shape, dtype=np.uint8)
        return cls(
            u, v, w, ex, ey, ez, cx, cy, cz, rows.lo, rows.hi, fraction, wet, phi, np.zeros((shape[0], shape[2])),
            1.0, 0.0, np.zeros(3),
            turbulence=np.zeros((turbulence_fields, *shape)),
        )  # fmt: skip

    def copy_from(self, other: FlowState) -> None:
        """Take the values of another state."""
        for f in fields(self):
            value = getattr(other, f.name)
            if isinstance(value, np.ndarray):
                getattr(self, f.name)[...] = value
            else:
                setattr(self, f.name, value)

    @property
    def velocity(self) -> tuple[Array, Array, Array]:
        """Its three components [m/s]."""
        return self.u, self.v, self.w

    @property
    def extended(self) -> tuple[Array, Array, Array]:
        """Extended velocity [m/s]."""
        return self.ex, self.ey, self.ez

    @property
    def carrying(self) -> tuple[Array, Array, Array]:
        """Velocity on full faces [m/s]."""
        return self.cx, self.cy, self.cz


@dataclass(frozen=True)
class Loads:
    """Loads on n solids in their own axes about their origins: force [N] and moment [N m], each of shape (n, 6)."""

    pressure: Array
    shear: Array
    """Wall friction, and the drag of lugs (`exumob.flow.tread`)"""
    slip_momentum: Array
    """Momentum that faces hardly open pass to the wall (`exumob.flow.velocity_extension.blend`)"""

    @classmethod
    def zeros(cls, n: int) -> Loads:
        """No loads on n solids."""
        return cls(np.zeros((n, 6)), np.zeros((n, 6)), np.zeros((n, 6)))

    def plus(self, other: Loads, share: float) -> Loads:
        """These and a share of others."""
        return Loads(
            self.pressure + share * other.pressure, self.shear + share * other.shear,
            self.slip_momentum + share * other.slip_momentum,
        )  # fmt: skip

    @property
    def total(self) -> Array:
        """Sum of the three, shape (n, 6)."""
        return self.pressure + self.shear + self.slip_momentum


@dataclass(frozen=True)
class StepReport:
    """Effort of one call of `FlowSolver.advance`."""

    steps: int
    """Sub-steps"""
    iterations: int
    """Pressure iterations, all sub-steps together"""
    residual: float
    """Largest divergence times step left [-]"""
    courant: float
    """Largest Courant number [-]"""
    halvings: int
    """Steps that failed and were halved"""
