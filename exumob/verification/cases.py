"""All cases of `exumob verify`, in the order in which they run."""

from __future__ import annotations

from exumob.verification import Case, basins, far_field, frames, waves

CASES: tuple[Case, ...] = (*basins.CASES, *frames.CASES, *waves.CASES, *far_field.CASES)
