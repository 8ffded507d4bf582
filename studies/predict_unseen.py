"""Do the networks predict runs that they have never seen? (paper Sec. 5.2, Figs. 12 to 14)

Four lane changes with the flow in the loop were kept from training and from every choice: D50/U0.5, D60/U0.5, D50/U1
and D50/U0.5 steered by 15 instead of 30 degrees. The vehicle drives them at 0.5/20 ms with the published coefficients,
with a regression fitted to the training runs, with the paper's networks and with those of exumob, five seeds each.

First: exumob train --output networks
Run: python studies/predict_unseen.py --networks networks     (about a quarter of an hour)
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from common import CFD_RUNS, add_networks, save, study_parser
from matplotlib.figure import Figure

from exumob.learning.dataset import load_runs
from exumob.learning.evaluation import compare
from exumob.learning.report import ENSEMBLE, OF_LANE_CHANGES, by_scenario, load_models, markdown, plot_paths
from exumob.paper.scenarios import UNSEEN
from exumob.support.figures import STYLE
from exumob.support.smoothing import smoothed
from exumob.vehicle.motion import WRENCH_COMPONENTS
from vehicle_models.amphibious import amphibious_vehicle

Runs = Mapping[tuple[str, str], Sequence[xr.Dataset]]
"""Runs of the members by model and scenario."""


def motions(runs: Runs, references: Mapping[str, xr.Dataset], model: str) -> Figure:
    """Draw lateral velocity and yaw (paper Fig. 13)."""
    with plt.rc_context(STYLE):
        figure, (left, right) = plt.subplots(1, 2, figsize=(11.0, 3.4), layout="constrained")
        for n, (scenario, reference) in enumerate(references.items()):
            run = runs[model, scenario][0]
            for data, style in ((reference, {"ls": "--", "lw": 1.6}), (run, {"lw": 1.1, "label": scenario})):
                left.plot(data["time"], data["lateral_velocity"], color=f"C{n}", **style)
                right.plot(data["time"], np.degrees(data["yaw"].sel(body="hull")), color=f"C{n}", **style)
        left.set(xlabel="time [s]", ylabel="lateral velocity [m/s]")
        right.set(xlabel="time [s]", ylabel="yaw [deg]")
        right.legend(title=f"{model}\n(dashed: CFD-MBD)")
    return figure


def hull_loads(runs: Runs, references: Mapping[str, xr.Dataset], model: str, scenario: str = "D50/U0.5") -> Figure:
    """Draw the loads on the hull (paper Fig. 14), with two standard deviations of the members."""
    run, reference = runs[model, scenario][0], references[scenario]
    true = smoothed(reference["water_wrench"].sel(body="hull").values, 1e-3, 0.05)
    macro = run["hydrodynamics_load_spread"]["macro_time"]
    with plt.rc_context(STYLE):
        figure, rows = plt.subplots(2, 3, figsize=(11.0, 5.2), sharex=True, layout="constrained")
        for n, (axes, component) in enumerate(zip(rows.flat, WRENCH_COMPONENTS, strict=True)):
            loads = run["water_wrench"].sel(body="hull", component=component)
            spread = run["hydrodynamics_load_spread"].sel(body="hull", component=component)
            middle = np.interp(macro, run["time"], loads)
            axes.plot(reference["time"], true[:, n], "k--", lw=1.0, label="CFD-MBD (50 ms mean)")
            axes.fill_between(macro, middle - 2.0 * spread, middle + 2.0 * spread, alpha=0.25, lw=0.0)
            axes.plot(run["time"], loads, color="C0", lw=1.1, label=f"{model}, 2 standard deviations")
            axes.set_ylabel(f"${component[0]}_{component[1]}$ [{'N' if component[0] == 'F' else 'N m'}]")
        for axes in rows[1]:
            axes.set_xlabel("time [s]")
        rows[0, 0].legend(fontsize="x-small")
        figure.suptitle(f"Loads on the hull, {scenario}")
    return figure


def main(quick: bool = False, networks: Path = Path("networks")) -> xr.Dataset:
    """Drive the unseen scenarios with every model; return the table (see `exumob.learning.evaluation.compare`)."""
    names = [scenario.name for scenario in (UNSEEN[:1] if quick else UNSEEN)]
    files = [CFD_RUNS / f"{scenario.file_stem}.nc" for scenario in UNSEEN if scenario.name in names]
    runs_by_name = load_runs(files)
    references = {name: runs_by_name[name] for name in names}
    chosen = load_models(networks, () if quick else OF_LANE_CHANGES)
    if quick:
        chosen = {ENSEMBLE: chosen[ENSEMBLE]}
    table, runs = compare(chosen, references, amphibious_vehicle(), progress=None if quick else print)
    if quick:
        return table
    save(
        {
            "unseen_paths.png": plot_paths(runs, references, [ENSEMBLE]),
            "unseen_motions.png": motions(runs, references, ENSEMBLE),
            "unseen_hull_loads.png": hull_loads(runs, references, ENSEMBLE),
            "predict_unseen.nc": table,
        }
    )
    return table


if __name__ == "__main__":
    parser = study_parser(__doc__)
    add_networks(parser)
    answer = main(**vars(parser.parse_args()))
    print(markdown(answer), by_scenario(answer), sep="\n\n")
