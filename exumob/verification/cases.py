"""All cases of `exumob verify`, in the order in which they run."""

from __future__ import annotations

from exumob.verification import Case, basins, bodies, columns, dam_breaks, floating, frames, waves

CASES: tuple[Case, ...] = (
    *basins.CASES, *frames.CASES, *waves.CASES, *bodies.CASES, *floating.CASES, *dam_breaks.CASES, *columns.CASES,
)  # fmt: skip
