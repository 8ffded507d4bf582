"""All cases of `exumob verify`, in the order in which they run."""

from __future__ import annotations

from exumob.verification import Case, basins, frames

CASES: tuple[Case, ...] = (*basins.CASES, *frames.CASES)
