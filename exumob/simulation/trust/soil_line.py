"""What the forces of the soil rest on, in a sentence for the line of trust."""

from __future__ import annotations

import math
from collections.abc import Sequence

from exumob.ground.soil import Soil
from exumob.simulation.description import RunDescription
from exumob.support.measured import measured_errors
from exumob.support.wording import percents


def soil_line(runs: Sequence[RunDescription]) -> str:
    """Say what the forces of the soil rest on."""
    wheel = measured_errors()["soil_forces"]
    names = list(dict.fromkeys(run.soil.name or "soil" for run in runs))
    named = ", ".join(names[:2]) + (f" and {len(names) - 2} more" if len(names) > 2 else "")
    own = any(not is_published(run.soil) for run in runs)
    flat = all(run.terrain.is_flat for run in runs)
    off = percents(wheel["error_low"], wheel["error_high"])
    return (
        f"Soil: {'your own' if own else 'published'} values ({named}), {'flat' if flat else 'given terrain'}; "
        f"{off} of the load off on one measured wheel ({wheel['wheel']}), up to {wheel['side_slip_deg']:g} deg of side "
        f"slip.{_soil_under_water(runs)}{_too_steep(runs)}"
    )


def _too_steep(runs: Sequence[RunDescription]) -> str:
    """Say where the ground is steeper than its soil stands without cohesion: there it would slide."""
    steep = [(run.terrain.largest_slope, run.soil) for run in runs if not run.terrain.is_flat]
    slope, soil = max(steep, key=lambda found: found[0] - found[1].friction_angle, default=(0.0, None))
    if soil is None or slope <= soil.friction_angle + 1e-9:
        return ""
    return (
        f" The ground is up to {math.degrees(slope):.0f} deg steep, and {soil.name or 'this soil'} stands to "
        f"{math.degrees(soil.friction_angle):.0f} deg by its friction alone, without its cohesion: steeper parts may "
        "slide."
    )


def _soil_under_water(runs: Sequence[RunDescription]) -> str:
    """Say at which moisture a published soil that is under water was measured."""
    wet = {run.soil.name for run in runs if run.water is not None and is_published(run.soil)}
    said = [f"{row.name} {row.under_water}" for row in Soil.published_table() if row.name in wet]
    if not said:
        return ""
    more = f", and {len(said) - 1} more likewise" if len(said) > 1 else ""
    return f" Under water soil is saturated: {said[0]}{more}."


def is_published_as(soil: Soil, name: str) -> bool:
    """Whether a soil is the published one of that name, with its values."""
    return soil.name == name and soil == Soil.published(name)


def is_published(soil: Soil) -> bool:
    """Whether a soil is a published one, with its values."""
    try:
        return soil == Soil.published(soil.name)
    except ValueError:
        return False
