"""Error bars on the path: the members of an ensemble of networks drive the maneuver one by one."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Any

import numpy as np
import xarray as xr

from exumob.driving.maneuver import Maneuver
from exumob.ground.soil import Soil
from exumob.simulation.run import simulate
from exumob.support.dimensions import with_described_names
from exumob.support.errors import SimulationError
from exumob.surrogates.model import SurrogateHydrodynamics
from exumob.vehicle.parameters import Vehicle
from exumob.water.conditions import Water

logger = logging.getLogger(__name__)


def add_members(
    result: xr.Dataset, vehicle: Vehicle, soil: Soil, water: Water | None, maneuver: Maneuver | None,
    hydrodynamics: SurrogateHydrodynamics, *, progress: Callable[[float], None] | None = None, **options: Any,
) -> xr.Dataset:  # fmt: skip
    """Drive a run anew with each member of its networks alone.

    The ensemble drives with the mean of its members' loads; where their runs end tells how far that can be trusted, as
    far as it comes from chance and from the choice of the training runs.

    Parameters
    ----------
    result : xarray.Dataset
        Result of `exumob.simulate` with `hydrodynamics`.
    vehicle, soil, water, maneuver
        As given to it.
    hydrodynamics : SurrogateHydrodynamics
        Two members at least.
    progress : callable, optional
        Called with the share of all runs that is done, times the run's duration [s].
    **options
        As given to `simulate`.

    Returns
    -------
    xarray.Dataset
        The result with ``member_position`` (member, time, axis) [m] and ``member_yaw`` (member, time) [rad] of the
        hull; nan from where a member broke down.

    Raises
    ------
    ValueError
        If there is but one member.
    """
    members = hydrodynamics.networks
    if len(members) < 2:
        raise ValueError(f"add_members: {len(members)} network gives no spread; give the files of two seeds at least.")
    times = result["time"].values
    position, yaw = np.full((len(members), len(times), 3), np.nan), np.full((len(members), len(times)), np.nan)
    for n, network in enumerate(members):

        def reached(time: float, done: int = n) -> None:
            if progress is not None:
                progress((done * float(times[-1]) + time) / len(members))

        alone = hydrodynamics.member(n)
        try:
            run = simulate(vehicle, soil, water, maneuver, alone, progress=reached, **options)
        except SimulationError as error:
            logger.warning("%s: %s", network.name, error)
            if error.result is None:
                continue
            run = error.result
        rows = min(run.sizes["time"], len(times))
        position[n, :rows] = run["position"].sel(body="hull").values[:rows]
        yaw[n, :rows] = run["yaw"].sel(body="hull").values[:rows]
    names = [network.name for network in members]
    found = result.assign(
        member_position=xr.DataArray(
            position, {"member": names, "time": result["time"], "axis": result["axis"]}, ("member", "time", "axis"),
            attrs={"units": "m", "long_name": "hull's position, driven by each member alone"},
        ),
        member_yaw=xr.DataArray(
            yaw, {"member": names, "time": result["time"]}, ("member", "time"),
            attrs={"units": "rad", "long_name": "hull's yaw, driven by each member alone"},
        ),
    )  # fmt: skip
    return with_described_names(found)
