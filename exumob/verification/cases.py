"""All cases of `exumob verify`, in the order in which they run."""

from __future__ import annotations

from exumob.verification import (
    Case,
    basins,
    beds,
    bodies,
    columns,
    coupled,
    dam_breaks,
    far_field,
    floating,
    frames,
    squat,
    towing,
    waves,
)

CASES: tuple[Case, ...] = (
    *basins.CASES, *frames.CASES, *waves.CASES, *far_field.CASES, *beds.CASES, *bodies.CASES, *floating.CASES,
    *coupled.CASES, *dam_breaks.CASES, *columns.CASES, *squat.CASES, *towing.CASES,
)  # fmt: skip
