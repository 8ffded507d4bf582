"""What does a ford do to a car, and do the models of the water's loads agree on one?

A small car and a large 4x4 drive down a bank of 15 %, through 12 m of level bed and up the other side, in 0.3, 0.5 and
0.7 m of water at 0, 1 and 2 m/s from ahead and from the side, beside the published limits of Shand et al. (2011). The
paper's vehicle crosses a ford of its own size with the coefficients, with the networks and with the flow in the loop,
if the folder of runs (environment variable EXUMOB_RUNS, else ``runs``) holds ``ford_flow.nc``; `--flow` computes it.

Run: python studies/fording.py [--flow] [--animate ford.gif]     (six minutes; the flow takes a quarter of an hour more)
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from common import save, study_parser
from matplotlib.figure import Figure

from exumob import CrossSection, SimulationError, Soil, load_dataset
from exumob.coupling.flow_code import BuiltInFlow
from exumob.coupling.flow_in_loop import CfdHydrodynamics
from exumob.flow import FlowSettings
from exumob.flow.output.pictures import animate_surface, plot_surfaces
from exumob.mobility.ford import Ford, FordReport, ford_report, stations
from exumob.mobility.ford_figure import plot_ford
from exumob.paper.reference_runs import work_folder
from exumob.simulation.animation import animate_run
from exumob.simulation.result_files import save_dataset
from exumob.simulation.verdict import wheel_load_share
from exumob.support.figures import STYLE, footnote, trust_notes
from exumob.vehicle.parameters import Vehicle
from vehicle_models.amphibious import amphibious_vehicle
from vehicle_models.large_4x4 import large_4x4
from vehicle_models.small_car import small_car

BANK = 0.15
"""Rise of both banks [-]."""
CARS: dict[str, Callable[[], Vehicle]] = {"small car": small_car, "large 4x4": large_4x4}
DEPTHS = (0.3, 0.5, 0.7)
"""[m]"""
FLOWS = {
    "still": (0.0, 0.0), "1 m/s from ahead": (1.0, 0.0), "1 m/s from the side": (0.0, 1.0),
    "2 m/s from ahead": (2.0, 0.0), "2 m/s from the side": (0.0, 2.0),
}  # fmt: skip
"""Current against the path, and across it to its left [m/s]."""
LIMITS = {"small car": (0.3, 0.3), "large 4x4": (0.5, 0.6)}
"""Deepest still water [m], and largest depth times velocity [m^2/s], in which a car that stands is stable: Shand, Cox,
Blacka & Smith, Australian Rainfall and Runoff P10/S2/020 (2011), Table 3, small passenger car and large 4WD."""
FASTEST = 3.0
"""Largest velocity that the same table allows [m/s]."""
MEASURES = ("time", "station", "wheel_load", "slip", "drift", "freeboard", "hull_load")
"""Numbers of a report that the table keeps; units as in `FordReport`."""
SHOWN = ("large 4x4", 0.5, "1 m/s from the side")
"""Case that is drawn."""
FLOW_RUN = "ford_flow.nc"
"""Result with the flow in the loop on the paper's vehicle's ford, in the folder of runs."""
FLOW_CELLS = 0.025
"""Size of its cells round the vehicle [m]: coarse, 1.1 of them in the gap beside a wheel at full lock."""
SHOWN_TIMES = (1.0, 2.0, 3.5, 5.5)
"""Instants at which the water round the vehicle is drawn [s]."""
SNAPSHOTS = 0.05
"""Interval of the surfaces that it keeps [s]."""


def ford(vehicle: Vehicle, depth: float, against: float, across: float, bottom: float, dry: float) -> Ford:
    """Make a ford with banks of 15 %; the current grows from 0 at the edges to its speed over the level bottom.

    Parameters
    ----------
    vehicle : Vehicle
    depth : float
        [m].
    against, across : float
        Current over the bottom [m/s].
    bottom : float
        Length of the level bottom [m].
    dry : float
        Height of the banks above the water [m].
    """
    edge = dry / BANK
    foot = edge + depth / BANK
    far = foot + bottom
    section = CrossSection(
        station=[0.0, edge, foot, far, far + depth / BANK, far + foot],
        bed=[dry, 0.0, -depth, -depth, 0.0, dry],
        current=[0.0, 0.0, across, across, 0.0, 0.0],
        along=[0.0, 0.0, -against, -against, 0.0, 0.0],
    )
    return Ford(section, 0.0, vehicle, Soil.published("LETE sand"))


def car_ford(car: str, depth: float, flow: str) -> Ford:
    """Make one of the fords of the table."""
    return ford(CARS[car](), depth, *FLOWS[flow], bottom=12.0, dry=1.5)


def own_ford() -> Ford:
    """Make the ford of the paper's vehicle: 0.12 m deep, 0.3 m/s from its right."""
    return ford(amphibious_vehicle(), 0.12, 0.0, 0.3, bottom=2.0, dry=0.45)


def drive(crossed: Ford, model: str) -> xr.Dataset:
    """Drive through a ford; a run that breaks down is kept up to where it did."""
    try:
        return crossed.drive(model)
    except SimulationError as error:
        if error.result is None:
            raise
        return error.result


def allowed(car: str, depth: float, speed: float) -> bool:
    """Tell whether the published limits allow it."""
    still, product = LIMITS[car]
    return depth <= still and depth * speed <= product + 1e-9 and speed <= FASTEST


def table(cars: Mapping[str, object], depths: tuple[float, ...], flows: tuple[str, ...]) -> xr.Dataset:
    """Drive the cars through all fords; kind and numbers of the reports, what the limits allow, and the times taken."""
    shape = (len(cars), len(depths), len(flows))
    dims = ("car", "depth", "flow")
    kinds, sentences = np.empty(shape, object), np.empty(shape, object)
    numbers = {name: np.full(shape, np.nan) for name in (*MEASURES, "wall_time")}
    permitted = np.zeros(shape, bool)
    trust = ""
    for at in np.ndindex(shape):
        car, depth, flow = list(cars)[at[0]], depths[at[1]], flows[at[2]]
        crossed = car_ford(car, depth, flow)
        began = time.perf_counter()
        run = drive(crossed, "coefficients")
        report = ford_report(run, crossed)
        numbers["wall_time"][at] = time.perf_counter() - began
        kinds[at], sentences[at], trust = report.kind, report.sentence, report.trust
        permitted[at] = allowed(car, depth, max(FLOWS[flow]))
        for name in MEASURES:
            numbers[name][at] = report.figures()[name]
        print(f"{car}, {depth} m, {flow}: {report.sentence} ({numbers['wall_time'][at]:.1f} s)", flush=True)
    found = {name: (dims, values) for name, values in numbers.items()}
    words = {"kind": (dims, kinds.astype(str)), "sentence": (dims, sentences.astype(str))}
    return xr.Dataset(
        {**words, **found, "allowed": (dims, permitted)},
        coords={"car": list(cars), "depth": ("depth", list(depths), {"units": "m"}), "flow": list(flows)},
        attrs={"trust": trust},
    )


def compared() -> tuple[Ford, dict[str, xr.Dataset]]:
    """Drive the paper's vehicle through its ford with each model, and take the flow in the loop from its file."""
    crossed = own_ford()
    runs = {name: drive(crossed, name) for name in ("coefficients", "networks")}
    computed = work_folder() / FLOW_RUN
    if computed.is_file():
        runs["flow in the loop"] = load_dataset(computed)
    return crossed, runs


def compute_flow() -> Path:
    """Drive the paper's vehicle through its ford with the flow in the loop, or go on from the checkpoint."""
    file = work_folder() / FLOW_RUN
    if not file.is_file():
        file.parent.mkdir(parents=True, exist_ok=True)
        flow = BuiltInFlow(
            FLOW_CELLS, settings=FlowSettings(threads=1), allow_coarse=True, snapshots=SNAPSHOTS
        )  # fmt: skip
        save_dataset(
            own_ford().drive(CfdHydrodynamics(flow), checkpoint=file.with_suffix(".npz"), resume=True), file
        )  # fmt: skip
    return file


def plot_models(crossed: Ford, runs: Mapping[str, xr.Dataset]) -> Figure:
    """Draw bed, path, speed, wheel load and the water's force on the hull over the station, model beside model."""
    near, far = crossed.edges
    with plt.rc_context(STYLE):
        figure, grid = plt.subplots(3, 2, figsize=(11.0, 8.0), sharex=True, layout="constrained")
        axes = grid.ravel()
        titles = (
            "Path: hull to the left of the line [mm]", "Speed ahead [m/s]", "Share of the weight on the wheels [%]",
            "Water on the hull: against the path [N]", "Water on the hull: to the left [N]",
            "Water on the hull: upwards [N]",
        )  # fmt: skip
        for one, title in zip(axes, titles, strict=True):
            one.set_title(title, loc="left")
            one.axvspan(near, far, color="C0", alpha=0.08, lw=0)
            one.axvspan(near + 0.12 / BANK, far - 0.12 / BANK, color="C0", alpha=0.08, lw=0)
        for name, run in runs.items():
            end = ford_report(run, crossed).last + 1
            driven = run.isel(time=slice(end))
            place = stations(driven)
            force = driven["water_load"].sel(body="hull").values
            curves = (
                1e3 * driven["position"].sel(body="hull", axis="y").values, driven["forward_velocity"].values,
                100.0 * wheel_load_share(driven, crossed.vehicle), -force[:, 0], force[:, 1], force[:, 2],
            )  # fmt: skip
            for one, curve in zip(axes, curves, strict=True):
                one.plot(place, curve, lw=1.2, label=name)
        for one in grid[-1]:
            one.set_xlabel("station of the middle between the wheels [m]")
        axes[0].legend(frameon=False)
        footnote(figure, "shaded: water, darker: level bottom", *trust_notes(runs.values()))
    return figure


def plot_flow(run: xr.Dataset) -> Figure:
    """Draw the water round the vehicle on its way down, in midstream and up the other side."""
    with plt.rc_context(STYLE):
        figure = plt.figure(figsize=(11.0, 7.2), layout="constrained")
        plot_surfaces(figure, run, times=SHOWN_TIMES)
    return figure


def model_lines(crossed: Ford, runs: Mapping[str, xr.Dataset]) -> str:
    """Put the reports of the models side by side as a table."""
    lines = [
        "| model | time [s] | least wheel load [%] | largest slip [%] | drift [mm] |",
        "|---" * 5 + "|",
    ]
    for name, run in runs.items():
        found = ford_report(run, crossed)
        lines.append(
            f"| {name} ({found.kind}) | {found.time:.2f} | {100.0 * found.wheel_load.value:.0f} | "
            f"{100.0 * found.slip.value:.1f} | {1e3 * found.drift.value:.0f} |"
        )
    return "\n".join([*lines, *(f"{name}: {run.attrs['trust']}" for name, run in runs.items())])


def draw_case(car: str, depth: float, flow: str) -> Figure:
    """Draw one case of the table as `exumob ford` does."""
    crossed = car_ford(car, depth, flow)
    run = drive(crossed, "coefficients")
    report: FordReport = ford_report(run, crossed)
    return plot_ford(run, crossed, report)


def main(quick: bool = False, animate: Path | None = None, flow: bool = False) -> xr.Dataset:
    """Drive all cases, compare the models, save figures and table; return the table."""
    if quick:
        return table({"small car": small_car}, (0.3, 0.5), ("still", "2 m/s from the side"))
    if flow:
        compute_flow()
    crossed, runs = compared()
    print(model_lines(crossed, runs))
    save({"fording_models.png": plot_models(crossed, runs)})
    if "flow in the loop" in runs:
        save({"fording_flow.png": plot_flow(runs["flow in the loop"])})
    if animate is not None:
        last = list(runs.values())[-1]
        if "hydrodynamics_elevation" in last:
            until = ford_report(last, crossed).time
            animate_surface(last.sel(snapshot=slice(0.0, until)).isel(snapshot=slice(None, None, 4)), animate)
        else:
            animate_run(last, animate)
    result = table(CARS, DEPTHS, tuple(FLOWS))
    save({"fording.nc": result, "fording_case.png": draw_case(*SHOWN)})
    return result


def report_lines(result: xr.Dataset) -> str:
    """Put the table into words, and say what a run takes."""
    lines = [
        "| car | depth [m] | current | it | station [m] | wheel load [%] | slip [%] | drift [m] | limits |",
        "|---" * 9 + "|",
    ]
    for car in result["car"].values:
        for depth in result["depth"].values:
            for flow in result["flow"].values:
                one = result.sel(car=car, depth=depth, flow=flow)
                lines.append(
                    f"| {car} | {depth:g} | {flow} | {one['kind'].item()} | {float(one['station']):.1f} | "
                    f"{100.0 * float(one['wheel_load']):.0f} | {100.0 * float(one['slip']):.0f} | "
                    f"{float(one['drift']):+.2f} | {'allow it' if bool(one['allowed']) else 'forbid it'} |"
                )
    wall = result["wall_time"].values
    lines.append(f"a run takes {np.median(wall):.1f} s ({wall.min():.1f} to {wall.max():.1f} s)")
    return "\n".join([*lines, f"trust: {result.attrs['trust']}"])


if __name__ == "__main__":
    parser = study_parser(__doc__)
    parser.add_argument("--animate", type=Path, help="file of an animation of the paper's vehicle, .gif or .mp4")
    parser.add_argument("--flow", action="store_true", help="compute the run with the flow in the loop")
    print(report_lines(main(**vars(parser.parse_args()))))
