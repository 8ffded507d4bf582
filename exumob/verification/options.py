"""What the cases may be given: cells, times and threads, each with its bounds."""

from __future__ import annotations

from typing import Annotated

from exumob.support.quantities import DURATION, Quantity

CELL_SIZE = Quantity("m", above=0.0, at_most=10.0, plausible=(1e-6, 1.0))
"""Width of the cells of a case"""

CellSize = Annotated[float, CELL_SIZE]
Cells = Annotated[float, Quantity("1", at_least=1.0, at_most=1e4)]
"""Number of cells to a length"""
WholeCells = Annotated[int, Quantity("1", at_least=1, at_most=10_000)]
"""The same where they must fill it"""
Duration = Annotated[float, DURATION]
Interval = Annotated[float, DURATION]
"""Step of time, or interval between samples [s]"""
Threads = Annotated[int, Quantity("1", at_least=1, at_most=1024)]
