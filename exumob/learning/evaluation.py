"""Errors of networks: of their loads along a run's own motion (open loop), and driving the vehicle (closed loop)."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from exumob.ground.soil import Soil
from exumob.learning.dataset import SAMPLING, base_loads, body_states, usable, water_of, windows
from exumob.paper.reference_runs import SOIL
from exumob.paper.scenarios import Scenario
from exumob.simulation.run import simulate
from exumob.support.arrays import Array
from exumob.support.dimensions import with_described_names
from exumob.support.errors import SimulationError
from exumob.surrogates.inputs import network_inputs
from exumob.surrogates.model import SurrogateHydrodynamics
from exumob.surrogates.networks import TRAINED_DENSITY, NetworkSet
from exumob.surrogates.vehicle_shape import times_as_large
from exumob.vehicle.motion import BODIES, WRENCH_COMPONENTS
from exumob.vehicle.parameters import Vehicle
from exumob.water.hydrodynamics import Hydrodynamics
from exumob.water.wave_loads import WaveCoefficients, wave_loads_along

logger = logging.getLogger(__name__)

FAST = {"setting": "fast"}
"""The paper's fast setting (Sec. 5.3)."""
THINNING = 4
"""Interval at which loads are compared, in samples of 1 ms."""
MEASURES = {
    # name: (unit, meaning)
    "path": ("%", "distance from the reference, root mean square over the length of its path"),
    "final": ("%", "final distance from the reference over the length of its path"),
    "yaw": ("deg", "error of the yaw, root mean square"),
    "lateral_velocity": ("m s-1", "error of the lateral velocity, root mean square"),
    "forward": ("m", "forward displacement less that of the reference"),
    "lateral": ("m", "lateral displacement less that of the reference"),
}
"""What `closed_loop` measures."""
LOAD_ERROR = "error of the loads, root mean square over their standard deviation"
"""What `open_loop` measures."""


def predicted_loads(
    network: NetworkSet, run: xr.Dataset, vehicle: Vehicle, rows: np.ndarray, base: Array | None = None
) -> Array:
    """Loads that a network predicts along a run's own motion (open loop).

    Parameters
    ----------
    network : NetworkSet
    run : xarray.Dataset
        Packed or imported run.
    vehicle : Vehicle
        Vehicle of the run.
    rows : array of int
        Instants of the run at which loads are wanted.
    base : array, optional
        `base_loads` of the published coefficients, of the whole run, if they are known already.

    Returns
    -------
    array, shape (len(rows), 5, 6)
        Force [N] and moment [N m], body axes.

    Raises
    ------
    ValueError
        If the networks were trained for another vehicle, or for this one in another size.
    """
    if times_as_large(vehicle, network.about["geometry"]) != 1.0:
        raise ValueError(
            f"predicted_loads.vehicle: {vehicle.name} is not the vehicle of these networks ({network.name}); give runs "
            "of the vehicle that they know, in its own size."
        )
    architecture, states, water = network.architecture, body_states(run), water_of(run)
    inputs = network_inputs(states, water, architecture.inputs)
    loads = network.batch_wrenches(np.moveaxis(windows(inputs, rows, architecture), 2, 1))
    loads = loads * (water.density / TRAINED_DENSITY)
    if network.waves is not None:
        loads += coefficient_loads(network.waves, run, vehicle, rows, base)
    return loads


def coefficient_loads(
    waves: WaveCoefficients, run: xr.Dataset, vehicle: Vehicle, rows: np.ndarray, base: Array | None = None
) -> Array:
    """Loads of the published coefficients with those of the vehicle's waves, along a run's own motion.

    Parameters
    ----------
    waves : WaveCoefficients
    run, vehicle, rows, base
        As for `predicted_loads`.

    Returns
    -------
    array, shape (len(rows), 5, 6)
        Force [N] and moment [N m], body axes.
    """
    water, published = water_of(run), base_loads(run, vehicle) if base is None else base
    added = wave_loads_along(vehicle, water.over(), water.density, body_states(run)[rows], waves)
    return np.asarray(published[rows] + added)


def open_loop(
    networks: NetworkSet | Sequence[NetworkSet], run: xr.Dataset, vehicle: Vehicle, base: Array | None = None
) -> xr.DataArray:
    """Root mean square error of predicted loads over the standard deviation of the run's smoothed loads [-].

    Parameters
    ----------
    networks : NetworkSet or sequence of NetworkSet
        With several networks the mean of their loads is compared.
    run, vehicle, base
        As for `predicted_loads`.

    Returns
    -------
    xarray.DataArray, dims (body, component)
    """
    members = [networks] if isinstance(networks, NetworkSet) else networks
    rows = np.flatnonzero(usable(run))[::THINNING]
    if base is None and any(network.waves is not None for network in members):
        base = base_loads(run, vehicle)
    loads = np.mean([predicted_loads(network, run, vehicle, rows, base) for network in members], axis=0)
    reference = run["water_wrench_smooth"].values[rows]
    error = np.sqrt(np.mean((loads - reference) ** 2, axis=0)) / np.maximum(reference.std(axis=0), 1e-9)
    return xr.DataArray(
        error, {"body": list(BODIES), "component": list(WRENCH_COMPONENTS)}, ("body", "component"),
        attrs={"units": "1", "long_name": LOAD_ERROR},
    )  # fmt: skip


def drive(
    scenario: Scenario, hydrodynamics: Hydrodynamics, vehicle: Vehicle, steps: Mapping[str, Any] = FAST,
    soil: str = SOIL,
) -> xr.Dataset:  # fmt: skip
    """Simulate a scenario's lane change as in the CFD-MBD runs, with another model of the water's loads."""
    return simulate(
        vehicle, Soil.published(soil), scenario.water(vehicle), scenario.maneuver(), hydrodynamics,
        record_step=10e-3, **steps,
    )  # fmt: skip


def closed_loop(run: xr.Dataset, reference: xr.Dataset) -> dict[str, float]:
    """Measure how far a run departs from a reference.

    Returns
    -------
    dict
        path, final [%]: root mean square and final distance in the plane over the length of the reference's path; yaw
        [deg], lateral_velocity [m/s]: root mean square; forward, lateral [m]: the run's displacement less the
        reference's.
    """
    times = run["time"].values
    rows = np.clip(np.round(times / SAMPLING).astype(int), 0, reference.sizes["time"] - 1)
    path, true = (r["position"].sel(body="hull").values[:, :2].astype(float) for r in (run, reference))
    length = float(np.hypot(*np.diff(true, axis=0).T).sum())
    off = (path - path[0]) - (true[rows] - true[0])
    distance = np.hypot(*off.T)
    yaw = np.degrees(run["yaw"].sel(body="hull").values - reference["yaw"].sel(body="hull").values[rows])
    sideways = run["lateral_velocity"].values - reference["lateral_velocity"].values[rows]
    return {
        "path": 100.0 * float(np.sqrt(np.mean(distance**2))) / length,
        "final": 100.0 * float(distance[-1]) / length,
        "yaw": float(np.sqrt(np.mean(yaw**2))),
        "lateral_velocity": float(np.sqrt(np.mean(sideways**2))),
        "forward": float(off[-1, 0]),
        "lateral": float(off[-1, 1]),
    }


def compare(
    models: Mapping[str, Sequence[Hydrodynamics]], references: Mapping[str, xr.Dataset], vehicle: Vehicle,
    steps: Mapping[str, Any] = FAST, progress: Callable[[str], None] | None = None,
) -> tuple[xr.Dataset, dict[tuple[str, str], list[xr.Dataset]]]:  # fmt: skip
    """Drive scenarios with several models and compare each run with CFD-MBD.

    Parameters
    ----------
    models : mapping
        Members (seeds) by the name of the model.
    references : mapping
        CFD-MBD runs by scenario.
    vehicle : Vehicle
    steps : mapping
        Further arguments of `exumob.simulate`: its steps.
    progress : callable, optional
        Called after each run with a line of text.

    Returns
    -------
    table : xarray.Dataset
        The measures of `closed_loop`, dims (model, scenario, member), and ``load_error`` (`open_loop`), dims (...,
        body, component); nan for models without networks and for runs that break down (a warning names them).
    runs : dict
        By model and scenario: the members' runs.
    """
    most = max(len(members) for members in models.values())
    values = {name: np.full((len(models), len(references), most), np.nan) for name in MEASURES}
    loads = np.full((len(models), len(references), most, len(BODIES), len(WRENCH_COMPONENTS)), np.nan)
    runs: dict[tuple[str, str], list[xr.Dataset]] = {}
    for m, (model, members) in enumerate(models.items()):
        for s, (scenario, reference) in enumerate(references.items()):
            runs[model, scenario] = []
            for n, member in enumerate(members):
                if isinstance(member, SurrogateHydrodynamics):
                    loads[m, s, n] = open_loop(member.networks, reference, vehicle)
                try:
                    run = drive(Scenario.named(scenario), member, vehicle, steps)
                except SimulationError as error:
                    logger.warning("%s, %s, member %d: %s", model, scenario, n, error)
                    continue
                runs[model, scenario].append(run)
                for name, value in closed_loop(run, reference).items():
                    values[name][m, s, n] = value
                if progress is not None:
                    progress(
                        f"{model}, {scenario}, {n}: final position off by {values['final'][m, s, n]:.2f} % of the path"
                    )
    dims = ("model", "scenario", "member")
    table = xr.Dataset(
        {name: (dims, v, dict(zip(("units", "long_name"), MEASURES[name], strict=True))) for name, v in values.items()}
        | {"load_error": ((*dims, "body", "component"), loads, {"units": "1", "long_name": LOAD_ERROR})},
        coords={
            "model": list(models),
            "scenario": list(references),
            "body": list(BODIES),
            "component": list(WRENCH_COMPONENTS),
        },
    )
    return with_described_names(table), runs
