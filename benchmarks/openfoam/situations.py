"""The situations that both solvers compute: body, water, window, and one grid for both."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

GROWTH = 1.05
"""Ratio of neighbouring cell widths outside the core [-]."""
RAKE_GROWTH = 1.12
"""The same along the hull, from a raked bow on [-]."""
MISMATCH = 1.125
"""Largest ratio of the widths on the two sides of a mark [-]; `exumob.flow.Grid` allows 1.15."""


@dataclass(frozen=True)
class Situation:
    """A body held in a channel with a uniform current towards -x; the side walls and the bed slip freely.

    Parameters
    ----------
    name, about : str
        Name for the command line, title for the table.
    size : tuple of 3 floats
        Edges of the body along x, y, z [m]; it is a box, cut out of the grid along cell faces.
    center : tuple of 3 floats
        Centre of the body, and reference point of the moments [m]; the bed is at z = 0.
    depth, current : float
        Depth of the still water [m], speed of the undisturbed flow [m/s].
    low, high : tuple of 3 floats
        Corners of the window [m].
    margin : tuple of 4 floats
        Cells of equal width reach this far beyond the body: ahead, behind, aside, above the still water [m].
    cell_size : float
        Horizontal width of these cells [m].
    flatness : float
        Their height over their width [-].
    duration, settled : float
        Time computed; means are taken from `settled` on [s].
    vertical_loads : bool
        Whether lift and trim moment mean anything (not for a column that passes through bed and window).
    """

    name: str
    about: str
    size: tuple[float, float, float]
    center: tuple[float, float, float]
    depth: float
    current: float
    low: tuple[float, float, float]
    high: tuple[float, float, float]
    margin: tuple[float, float, float, float]
    cell_size: float
    flatness: float = 1.0
    duration: float = 4.0
    settled: float = 2.0
    vertical_loads: bool = True
    bow: tuple[float, float] = (0.0, 0.0)
    """Over this length at the bow the keel rises by this height [m]; the faces of the cells meet on the rake."""

    def __post_init__(self) -> None:
        if not self.cell_size > 0.0 or self.cell_size > min(self.size[:2]) / 3.0:
            raise ValueError(
                f"Situation.cell_size = {self.cell_size} m; choose it positive and at most a third of the body's least "
                f"horizontal edge, {min(self.size[:2]) / 3.0:.3g} m."
            )
        if not 0.0 <= self.settled < self.duration:
            raise ValueError(
                f"Situation.settled = {self.settled} s must lie before the end at {self.duration} s; lengthen duration."
            )

    @property
    def bottom(self) -> float:
        """Height of the body's lower side above the bed [m]."""
        return self.center[2] - 0.5 * self.size[2]

    def faces(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Cell faces along x, y and z [m]: on the body's sides and on the still water level, for both solvers."""
        ahead, behind, aside, above = self.margin
        c, half = self.center, [0.5 * s for s in self.size]
        s = self.cell_size
        x = graded((c[0] - half[0], c[0] + half[0]), behind, ahead, self.low[0], self.high[0], s)
        y = graded((c[1] - half[1], c[1] + half[1]), aside, aside, self.low[1], self.high[1], s)
        lower = (0.0, self.bottom) if 0.0 < self.bottom < self.depth else (0.0,)
        length, height = self.bow
        upper = (self.bottom + height,) if height else ()
        z = graded((*lower, self.depth, *upper), 0.0, above, 0.0, self.high[2], self.flatness * s)
        if height:
            rake = z[(z > self.bottom - 1e-9) & (z < self.bottom + height + 1e-9)]
            x = self._along(c[0] + half[0] - length + length / height * (rake - self.bottom))
        return x, y, z

    def boxes(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """Corners of the boxes whose cells interFoam leaves out [m]; a raked bow goes up in steps of a cell.

        The cells that the rake cuts in half are left out.
        """
        center, half = np.array(self.center), 0.5 * np.array(self.size)
        low, high = center - half, center + half
        length, height = self.bow
        if not height:
            return [(low, high)]
        x, _, z = self.faces()
        rake = np.flatnonzero((z > self.bottom - 1e-9) & (z < self.bottom + height + 1e-9))
        foot = int(np.argmin(np.abs(x - (high[0] - length))))
        parts = [(np.array([low[0], low[1], z[rake[-1]]]), high)]
        for n, k in enumerate(rake[:-1]):
            corner = np.array([x[foot + n + 1], high[1], z[k + 1]])
            parts.append((np.array([low[0], low[1], z[k]]), corner))
        return parts

    def _along(self, rake: np.ndarray) -> np.ndarray:
        """Faces along x through those of the rake [m], growing to `cell_size` on either side."""
        _, behind, _, _ = self.margin
        stern, s = self.center[0] - 0.5 * self.size[0], self.cell_size
        widths = [rake[1] - rake[0]]
        while sum(widths) < rake[0] - stern - s:
            widths.append(min(RAKE_GROWTH * widths[-1], s))
        widths = np.array(widths) * (rake[0] - stern) / sum(widths)
        hull = rake[0] - np.cumsum(widths)
        aft = stern - outward(stern - self.low[0], behind, float(widths[-1]), GROWTH)
        fore = outward(self.high[0] - rake[-1], 0.03, float(rake[-1] - rake[-2]), GROWTH) + rake[-1]
        return np.concatenate([aft[::-1], hull[::-1], rake, fore])

    @property
    def n_cells(self) -> int:
        """Cells of the window, those inside the body included."""
        return math.prod(len(f) - 1 for f in self.faces())

    def with_cells(self, cells: int) -> Situation:
        """Return the same situation with a cell size that gives about this many cells."""
        sizes = np.geomspace(0.2, 5.0, 120) * self.cell_size
        sizes = sizes[sizes <= min(self.size[:2]) / 3.0]
        counts = np.array([replace(self, cell_size=float(s)).n_cells for s in sizes])
        return replace(self, cell_size=float(sizes[np.argmin(np.abs(np.log(counts / cells)))]))


def graded(
    marks: tuple[float, ...], below: float, above: float, low: float, high: float, size: float, growth: float = GROWTH
) -> np.ndarray:
    """Faces [m] that pass through all `marks`, of nearly equal width between and near them, growing outwards.

    Parameters
    ----------
    marks : tuple of floats
        Places that become faces [m].
    below, above : float
        Widths stay equal this far beyond the first and the last mark [m].
    low, high : float
        Ends of the axis [m].
    size : float
        Wanted width [m]; whole cells are fitted.
    growth : float
        Ratio of neighbouring widths beyond [-].
    """
    counts = cell_counts(np.diff(marks), size)
    widths = np.diff(marks) / counts
    parts = [np.linspace(a, b, n + 1)[1:] for a, b, n in zip(marks[:-1], marks[1:], counts, strict=True)]
    lower = marks[0] - outward(marks[0] - low, below, float(widths[0]), growth)
    upper = marks[-1] + outward(high - marks[-1], above, float(widths[-1]), growth)
    return np.concatenate([lower[::-1], [marks[0]], *parts, upper])


def cell_counts(stretches: np.ndarray, size: float) -> np.ndarray:
    """Cells in each stretch [m]: widths near `size`, and from one to the next less than `MISMATCH` apart."""
    near = [range(max(round(n) - 2, 1), round(n) + 3) for n in stretches / size]

    def misfit(counts: tuple[int, ...]) -> tuple[bool, float]:
        widths = np.log(stretches / np.array(counts))
        return bool(np.any(np.abs(np.diff(widths)) > np.log(MISMATCH))), float(np.max(np.abs(widths - np.log(size))))

    return np.array(min(product(*near), key=misfit))


def outward(extent: float, equal: float, width: float, growth: float) -> np.ndarray:
    """Distances [m] of faces from a mark: equal widths as far as `equal`, then growing to end at `extent`."""
    if extent <= 1e-9:
        return np.zeros(0)
    core = width * np.arange(1, min(math.ceil(equal / width - 1e-9), math.floor(extent / width)) + 1)
    rest = extent - (core[-1] if len(core) else 0.0)
    if rest < 0.5 * width:
        return core * extent / core[-1]
    count = max(round(math.log(1.0 + rest / width * (growth - 1.0) / growth) / math.log(growth)), 1)
    steps = np.arange(1, count + 1)
    low, high = 0.7, 1.5  # the ratio that ends exactly at `extent`
    for _ in range(60):
        ratio = 0.5 * (low + high)
        low, high = (ratio, high) if width * np.sum(ratio**steps) < rest else (low, ratio)
    return np.concatenate([core, extent - rest + width * np.cumsum(ratio**steps)])


BOX = Situation(
    name="box-0.5", about="box 1.00 x 0.44 m, draught 42 mm, 0.5 m/s", size=(1.0, 0.44, 0.2),
    center=(0.0, 0.0, 0.178), depth=0.12, current=0.5, low=(-2.0, -1.2, 0.0), high=(1.9, 1.2, 0.4),
    margin=(0.2, 0.25, 0.12, 0.08), cell_size=0.035, flatness=0.4,
)  # fmt: skip
"""The vehicle's hull without rake, as deep in the water as at D60."""
COLUMN = Situation(
    name="square-column", about="square column, side 0.10 m, 0.5 m/s", size=(0.1, 0.1, 0.388),
    center=(0.0, 0.0, 0.186), depth=0.12, current=0.5, low=(-1.2, -0.8, 0.0), high=(1.2, 0.8, 0.24),
    margin=(0.1, 0.3, 0.1, 0.04), cell_size=0.0145, duration=3.0, settled=1.5, vertical_loads=False,
)  # fmt: skip
SITUATIONS = {
    s.name: s
    for s in (
        BOX,
        replace(BOX, name="box-1.0", about="box 1.00 x 0.44 m, draught 42 mm, 1.0 m/s", current=1.0),
        replace(
            BOX,
            name="box-2.0",
            about="box 1.00 x 0.44 m, draught 42 mm, 2.0 m/s",
            current=2.0,
            duration=3.0,
            settled=1.0,
        ),
        COLUMN,
        replace(
            BOX, name="rake-1.0", about="hull with a raked bow, draught 42 mm, 1.0 m/s", current=1.0, bow=(0.12, 0.12)
        ),
        replace(
            BOX,
            name="rake-2.0",
            about="hull with a raked bow, draught 42 mm, 2.0 m/s",
            current=2.0,
            duration=3.0,
            settled=1.0,
            bow=(0.12, 0.12),
        ),
    )
}
