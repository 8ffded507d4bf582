"""All cases of `exumob verify`, in the order in which they run."""

from __future__ import annotations

from exumob.verification import (
    added_mass,
    basins,
    beds,
    bores,
    columns,
    coupled,
    coupled_spring,
    coupled_vehicle,
    dam_breaks,
    far_field,
    floating,
    frames,
    hydrostatics,
    load_convergence,
    momentum,
    moving_bodies,
    squat,
    towing,
    waves,
    worst_case,
)
from exumob.verification.check import Case

CASES: tuple[Case, ...] = (
    *basins.CASES, *frames.CASES, *waves.CASES, *far_field.CASES, *beds.CASES, *hydrostatics.CASES, *added_mass.CASES,
    *momentum.CASES, *moving_bodies.CASES, *floating.CASES, *coupled_spring.CASES, *coupled.CASES,
    *coupled_vehicle.CASES, *dam_breaks.CASES, *bores.CASES, *columns.CASES, *squat.CASES, *towing.CASES,
    *worst_case.CASES, *load_convergence.CASES,
)  # fmt: skip
