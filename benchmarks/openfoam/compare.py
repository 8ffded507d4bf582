"""The flow solver of exumob beside OpenFOAM's interFoam: the same body, water and grid; loads and cost.

Run: `python benchmarks/openfoam/compare.py --work DIR [--case box-0.5 ...]`; see README.md beside this file. Without
OpenFOAM it says so and ends. The folder DIR keeps the runs of interFoam: finished ones are read again, those cut off
go on from the last time saved (every 0.25 s of flow).
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

if "--threads" in sys.argv[:-1]:  # must be known before Numba is imported
    os.environ.setdefault("NUMBA_NUM_THREADS", sys.argv[sys.argv.index("--threads") + 1])

import numpy as np
import xarray as xr
from scipy.signal import detrend

sys.path.insert(0, str(Path(__file__).parent))
import interfoam
from case_files import GRAVITY, TURBULENCE, WATER_DENSITY, profile_points, profile_row
from situations import SITUATIONS, Situation

from exumob.flow import FlowSettings, FlowSolver, Grid, Poses, box, prism
from exumob.flow.solids import HULL_FRICTION, Solid
from exumob.simulation.result_files import save_dataset
from exumob.simulation.results import provenance
from exumob.water.conditions import Water

INTERVAL = 0.005
"""Interval between records of exumob's loads [s]; steps within are as long as the Courant number allows."""
SAMPLE = 0.01
"""Step of the common time axis [s]."""
COMPONENTS = ("Fx", "Fy", "Fz", "Mx", "My", "Mz")
SOLVERS = ("exumob", "interFoam")
BANDS = ((0.0, 2.0), (2.0, 5.0), (5.0, 15.0))
"""Bands of frequencies in which the drag swings [Hz]"""
COST_STEPS, COST_SKIP = 60, 20
"""Steps of a cost run, and how many of the first do not count: the start costs both more."""


# -- exumob -----------------------------------------------------------------------------------------------------------


def start(situation: Situation, threads: int) -> FlowSolver:
    """Start exumob's solver on the grid of the situation, at the instant when the current starts."""
    solid = body(situation)
    settings = FlowSettings(follow=None, far_x=True, far_y=False, threads=threads)
    water = Water(situation.depth, situation.current, density=WATER_DENSITY)
    solver = FlowSolver(Grid(*situation.faces()), (solid,), water, settings)
    solver.start(Poses.at_rest([situation.center]))
    return solver


def body(situation: Situation) -> Solid:
    """Box, or box with a raked bow."""
    length, height = situation.bow
    if not height:
        return box(*situation.size, friction=HULL_FRICTION)
    half, keel, deck = 0.5 * situation.size[0], -0.5 * situation.size[2], 0.5 * situation.size[2]
    outline = [[-half, keel], [half - length, keel], [half, keel + height], [half, deck], [-half, deck]]
    return prism(np.array(outline), situation.size[1], HULL_FRICTION)


def run_exumob(situation: Situation, threads: int) -> interfoam.Run:
    """Compute a situation with exumob's solver."""
    solver = start(situation, threads)
    times, total, shear, profile, profile_times = [], [], [], [], []
    x = 0.5 * (solver.grid.x_faces[:-1] + solver.grid.x_faces[1:])
    columns = np.searchsorted(x, profile_points(situation)[:, 0, 0] - 1e-9)
    steps, iterations, wall, cpu = 0, 0, 0.0, 0.0
    for n in range(1, round(situation.duration / INTERVAL) + 1):
        clock, processor = time.perf_counter(), time.process_time()
        loads = solver.advance(n * INTERVAL)[0]
        wall, cpu = wall + time.perf_counter() - clock, cpu + time.process_time() - processor
        steps, iterations = steps + solver.report.steps, iterations + solver.report.iterations
        times.append((n - 0.5) * INTERVAL)
        total.append(loads)
        shear.append(solver.loads.shear[0, :3])
        if n % 10 == 0:
            profile.append(solver.surface_height()[profile_row(situation), columns])
            profile_times.append(solver.time)
    loads_array = np.array(total)
    return interfoam.Run(
        np.array(times), loads_array[:, :3], np.array(shear), loads_array[:, 3:], x[columns], np.array(profile),
        np.array(profile_times), solver.grid.n_cells, steps, wall / steps, cpu / threads / steps, iterations / steps,
    )  # fmt: skip


def cost_exumob(situation: Situation, threads: int) -> interfoam.Run:
    """Measure the cost of exumob's solver over the same number of steps of the same length."""
    solver = start(situation, threads)
    dt = 0.25 * solver.grid.smallest_width / situation.current
    walls, cpus, iterations = [], [], []
    for n in range(1, COST_STEPS + 1):
        clock, processor = time.perf_counter(), time.process_time()
        solver.advance(n * dt)
        parts = solver.report.steps
        walls.append((time.perf_counter() - clock) / parts)
        cpus.append((time.process_time() - processor) / parts)
        iterations.append(solver.report.iterations / parts)
    empty = np.zeros((0, 3))
    return interfoam.Run(
        np.zeros(0), empty, empty, empty, np.zeros(0), np.zeros((0, 0)), np.zeros(0), solver.grid.n_cells, COST_STEPS,
        *(float(np.mean(v[COST_SKIP:])) for v in (walls, np.array(cpus) / threads, iterations)),
    )  # fmt: skip


# -- side by side -----------------------------------------------------------------------------------------------------


def dataset(situation: Situation, runs: Sequence[interfoam.Run], turbulence: str, ranks: int) -> xr.Dataset:
    """Put both runs on one time axis, and the profiles of the surface as means after the start."""
    end = min(situation.duration, *(r.time[-1] for r in runs))
    t = np.arange(SAMPLE, end, SAMPLE)
    loads = np.stack(
        [[np.interp(t, r.time, c) for c in (*r.force.T, *r.moment.T)] for r in runs]
    ).transpose(0, 2, 1)  # fmt: skip
    shear = np.stack([np.interp(t, r.time, r.viscous[:, 0]) for r in runs])
    profile = np.stack([r.profile[r.profile_time >= situation.settled].mean(axis=0) for r in runs])
    result = xr.Dataset(
        {
            "loads": (("solver", "time", "component"), loads, {"units": "N, N m", "long_name": "loads on the body"}),
            "shear": (("solver", "time"), shear, {"units": "N", "long_name": "wall shear along x"}),
            "surface": (("solver", "x"), profile, {"units": "m", "long_name": "mean height of the water at y = 0"}),
            "cells": (("solver",), [r.cells for r in runs], {"units": "1", "long_name": "cells"}),
            "steps": (("solver",), [r.steps for r in runs], {"units": "1", "long_name": "time steps"}),
            "wall": (("solver",), [r.wall for r in runs], {"units": "s", "long_name": "wall time per step"}),
        },
        coords={
            "solver": list(SOLVERS),
            "time": ("time", t, {"units": "s"}),
            "component": list(COMPONENTS),
            "x": ("x", runs[0].profile_x, {"units": "m"}),
        },
    )
    result.attrs.update(
        situation=repr(situation), turbulence=turbulence, ranks=ranks, settled=situation.settled, **provenance()
    )
    return result


def rows(situation: Situation, data: xr.Dataset) -> list[tuple[str, float, float, float]]:
    """Return rows of quantity, exumob's value, interFoam's, difference in per cent of interFoam's."""
    late = data.sel(time=slice(situation.settled, None))
    drag = -late["loads"].sel(component="Fx")
    result = [("drag [N]", *drag.mean("time").values)]
    result.append(("  of it wall shear [N]", *(-late["shear"]).mean("time").values))
    if situation.vertical_loads:
        rest = buoyancy(situation)
        lift = late["loads"].sel(component="Fz").mean("time").values
        result += [
            ("vertical force [N]", *lift),
            (f"  less buoyancy at rest, {rest:.1f} N [N]", *(lift - rest)),
            ("trim moment My [N m]", *late["loads"].sel(component="My").mean("time").values),
        ]
    else:
        result.append(("side force, rms [N]", *late["loads"].sel(component="Fy").std("time").values))
    result.append(("drag, rms about its mean [N]", *drag.std("time").values))
    parts = [spectrum_shares(late.time.values, series) for series in drag.values]
    for name, here, there in zip(BANDS, *parts, strict=True):
        result.append((f"  of its square at {name[0]:g} to {name[1]:g} Hz [%]", 100.0 * here, 100.0 * there))
    head = data["surface"].sel(x=data.x > situation.center[0])
    result.append(("rise before the bow [mm]", *(1e3 * (head.isel(x=0) - situation.depth)).values))
    wake = data["surface"].sel(x=data.x < situation.center[0])
    result.append(("rise behind the stern [mm]", *(1e3 * (wake.isel(x=-1) - situation.depth)).values))
    return [(name, float(a), float(b), 100.0 * (float(a) / float(b) - 1.0)) for name, a, b in result]


def spectrum_shares(time: np.ndarray, series: np.ndarray) -> list[float]:
    """Return how much of a series' square, its trend taken out, lies in `BANDS` [-]; a Hann window is used."""
    rest = detrend(series) * np.hanning(len(series))
    power = np.abs(np.fft.rfft(rest)) ** 2
    frequency = np.fft.rfftfreq(len(rest), time[1] - time[0])
    total = power[1:].sum()
    return [float(power[1:][(frequency[1:] >= low) & (frequency[1:] < high)].sum() / total) for low, high in BANDS]


def buoyancy(situation: Situation) -> float:
    """Buoyancy of the body in still water [N]; a raked bow rises beyond the surface."""
    draught, (length, height) = situation.depth - situation.bottom, situation.bow
    side = situation.size[0] * draught - (0.5 * length * draught**2 / height if height else 0.0)
    return WATER_DENSITY * GRAVITY * situation.size[1] * side


def table(situation: Situation, data: xr.Dataset) -> str:
    """Return a Markdown table of the means after the start."""
    lines = [f"| {situation.about} | exumob | interFoam | difference |", "|---|---:|---:|---:|"]
    for name, here, there, difference in rows(situation, data):
        apart = f"{difference:+.1f} %" if abs(difference) < 300.0 else "-"  # of next to nothing
        lines.append(f"| {name} | {here:.3f} | {there:.3f} | {apart} |")
    return "\n".join(lines)


def cost_line(situation: Situation, runs: Sequence[interfoam.Run], threads: int, ranks: int) -> str:
    """Return the cost per cell and step of both, wall clock and processor time, and the ratio."""
    own, other = runs
    each = [(1e9 * r.wall / r.cells, 1e9 * r.cpu / r.cells) for r in runs]
    return (
        f"{situation.name}: {own.cells} cells; exumob {1e3 * own.wall:.1f} ms a step ({each[0][0]:.0f} ns a cell and "
        f"step, {threads} threads, {own.iterations:.1f} pressure iterations), interFoam {1e3 * other.wall:.1f} ms "
        f"({each[1][0]:.0f} ns, {ranks} ranks, {other.iterations:.1f}): interFoam / exumob = "
        f"{each[1][0] / each[0][0]:.1f} by the wall clock, {each[1][1] / each[0][1]:.1f} by processor time of one "
        "thread or rank"
    )


def figure(situation: Situation, data: xr.Dataset, path: Path) -> None:
    """Draw the histories of the loads and the mean profile of the surface."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    shown = [("Fx", "force along x [N]"), ("Fz", "vertical force [N]"), ("My", "trim moment [N m]")]
    if not situation.vertical_loads:
        shown = [("Fx", "force along x [N]"), ("Fy", "side force [N]")]
    fig, axes = plt.subplots(len(shown) + 1, 1, figsize=(7.0, 2.1 * (len(shown) + 1)), layout="constrained")
    late = data.sel(time=slice(0.2, None))["loads"]
    for ax, (component, label) in zip(axes, shown, strict=False):
        for name in SOLVERS:
            ax.plot(late.time, late.sel(solver=name, component=component), lw=0.9, label=name)
        ax.axvline(situation.settled, color="0.7", lw=0.8)
        ax.set(xlabel="time [s]", ylabel=label)
    axes[0].legend(frameon=False)
    axes[0].set_title(f"{situation.about}; means from {situation.settled:g} s on")
    for name in SOLVERS:
        for part in (data.x < situation.center[0], data.x > situation.center[0]):
            line = data["surface"].sel(solver=name).isel(x=np.flatnonzero(part))
            axes[-1].plot(line.x, 1e3 * (line - situation.depth), lw=0.9, color=f"C{SOLVERS.index(name)}")
    axes[-1].set(xlabel="x [m], the current comes from the right", ylabel="mean level\nat y = 0 [mm]")
    fig.savefig(path, dpi=130)
    plt.close(fig)


def compare(situation: Situation, turbulence: str, ranks: int, threads: int, work: Path) -> xr.Dataset:
    """Run both, print and save loads and cost."""
    interfoam_run = interfoam.run(situation, turbulence, ranks, work)
    print(f"{situation.name}: interFoam done ({interfoam_run.cells} cells, {interfoam_run.steps} steps)", flush=True)
    runs = run_exumob(situation, threads), interfoam_run
    data = dataset(situation, runs, turbulence, ranks)
    stem = f"{situation.name}-{round(1e4 * situation.cell_size)}-{turbulence}"
    save_dataset(data, work / f"{stem}.nc")
    figure(situation, data, work / f"{stem}.png")
    print(table(situation, data))
    print(cost_line(situation, runs, threads, ranks), flush=True)
    return data


def arguments(argv: Sequence[str] | None) -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--case", nargs="+", choices=list(SITUATIONS), default=list(SITUATIONS), help="situations")
    parser.add_argument("--work", type=Path, required=True, help="folder for the runs, outside the repository")
    size = parser.add_mutually_exclusive_group()
    size.add_argument("--cells", type=int, help="number of cells, about; default: as the situation says")
    size.add_argument("--cell-size", type=float, help="horizontal cell size near the body [mm]")
    parser.add_argument("--duration", type=float, help="time computed [s]; means over the second half")
    parser.add_argument("--turbulence", choices=TURBULENCE, default=TURBULENCE[0], help="interFoam's model")
    parser.add_argument("--ranks", type=int, default=1, help="processes of interFoam")
    parser.add_argument("--threads", type=int, default=1, help="threads of exumob")
    parser.add_argument("--only-cost", action="store_true", help=f"{COST_STEPS} steps of both, no loads")
    return parser.parse_args(argv)


def main(argv: Sequence[str] | None = None) -> int:
    """Compare; 0 also where OpenFOAM is absent."""
    options = arguments(argv)
    absent = interfoam.missing()
    if absent:
        print(f"Comparison skipped: {absent}")
        return 0
    options.work.mkdir(parents=True, exist_ok=True)
    for name in options.case:
        situation = SITUATIONS[name]
        if options.duration:
            situation = replace(situation, duration=options.duration, settled=0.5 * options.duration)
        if options.cell_size:
            situation = replace(situation, cell_size=1e-3 * options.cell_size)
        if options.cells:
            situation = situation.with_cells(options.cells)
        if options.only_cost:
            interfoam_run = interfoam.run(
                situation, options.turbulence, options.ranks, options.work, steps=COST_STEPS, skip=COST_SKIP
            )
            print(
                cost_line(
                    situation, (cost_exumob(situation, options.threads), interfoam_run), options.threads, options.ranks
                )
            )
        else:
            compare(situation, options.turbulence, options.ranks, options.threads, options.work)
    return 0


if __name__ == "__main__":
    sys.exit(main())
