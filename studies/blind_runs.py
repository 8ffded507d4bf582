"""Do the measured errors hold on runs that were drawn when everything was frozen?

Four scenarios were drawn by a seed after networks, coefficients and the floor of the error bars were what they are
(`exumob.paper.scenarios.DRAWN`), computed once with the flow in the loop, and driven once with each model. Nothing was
chosen by them. The error bars have their floor from the four unseen runs, so these runs also say how much they hold.

Run: python studies/blind_runs.py [--jobs 2]     (a minute; with `data/cfd_mbd/drawn` removed, which is made again,
     an hour and a half of one core)
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from common import CFD_RUNS, save, study_parser
from matplotlib.figure import Figure

from exumob.learning.compact import thinned
from exumob.learning.dataset import load_run, pack
from exumob.learning.error_bars import share_within
from exumob.learning.evaluation import closed_loop, drive, open_loop
from exumob.learning.validation import Compared, compare_loads
from exumob.paper.reference_runs import FlowRun, compute_all, set_up_log, work_folder
from exumob.paper.scenarios import DRAWN, Scenario
from exumob.simulation.result_files import save_dataset
from exumob.support.figures import STYLE
from exumob.surrogates.ensemble import bars_of, load_floor
from exumob.surrogates.model import SurrogateHydrodynamics
from exumob.surrogates.networks import PAPER
from exumob.vehicle.motion import BODIES, WRENCH_COMPONENTS
from exumob.water.calibrated import CalibratedHydrodynamics
from exumob.water.coefficients import CoefficientHydrodynamics
from exumob.water.hydrodynamics import Hydrodynamics
from vehicle_models.amphibious import amphibious_vehicle

FOLDER = CFD_RUNS / "drawn"
MODELS = ("networks", PAPER, "fitted coefficients", "calibrated", "published coefficients")
MEASURES = {"path": "%", "final": "%", "yaw": "deg", "lateral_velocity": "m s-1"}
"""Of `exumob.learning.evaluation.closed_loop`."""
DEVIATIONS = (1.0, 2.0, 3.0)
"""Widths of error bars that are asked for [standard deviations]."""
SHOWN = (("hull", "Fx", "N"), ("hull", "Fz", "N"), ("hull", "My", "N m"), ("front_left", "Fy", "N"))
"""Loads that are drawn."""


def flow_runs(scenarios: Sequence[Scenario], jobs: int) -> dict[str, xr.Dataset]:
    """Runs with the flow in the loop by name; those that are missing are made."""
    files = {s: FOLDER / f"{s.file_stem}.nc" for s in scenarios}
    missing = [FlowRun(s) for s, file in files.items() if not file.exists()]
    for run, result in compute_all(missing, amphibious_vehicle(), work_folder(), jobs) if missing else ():
        if isinstance(result, Exception):
            raise result
        FOLDER.mkdir(parents=True, exist_ok=True)
        save_dataset(thinned(pack(result)), files[run.scenario])
    return {s.name: load_run(file) for s, file in files.items()}


def models() -> dict[str, Hydrodynamics]:
    """Models that are compared, by name."""
    ensemble = SurrogateHydrodynamics()
    found: dict[str, Hydrodynamics] = {"networks": ensemble, PAPER: SurrogateHydrodynamics(PAPER)}
    return found | {
        "fitted coefficients": CalibratedHydrodynamics(waves=ensemble.waves), "calibrated": CalibratedHydrodynamics(),
        "published coefficients": CoefficientHydrodynamics(),
    }  # fmt: skip


def table(
    runs: Mapping[str, xr.Dataset], drives: Mapping[tuple[str, str], xr.Dataset], compared: Mapping[str, Compared],
    floor: np.ndarray,
) -> xr.Dataset:  # fmt: skip
    """Where drives end, how far the ensemble's loads are off, and how many of them the error bars hold."""
    vehicle, members = amphibious_vehicle(), SurrogateHydrodynamics().networks
    ends = {key: closed_loop(run, runs[key[1]]) for key, run in drives.items()}
    errors = [one.networks - one.flow for one in compared.values()]
    bars = [bars_of(one.spread, floor) for one in compared.values()]
    spreads = [one.spread for one in compared.values()]
    deviation = np.std(np.concatenate([one.flow for one in compared.values()]), axis=0)
    loads = np.stack([open_loop(members, run, vehicle).values for run in runs.values()])
    names = list(MODELS)
    return xr.Dataset(
        {
            **{
                name: (("model", "scenario"), [[ends[m, s][name] for s in runs] for m in names], {"units": unit})
                for name, unit in MEASURES.items()
            },
            "load_error": (("scenario", "body", "component"), loads, {"units": "1"}),
            "within": ("deviations", [share_within(errors, bars, z) for z in DEVIATIONS], {"units": "1"}),
            "within_spread": ("deviations", [share_within(errors, spreads, z) for z in DEVIATIONS], {"units": "1"}),
            "within_run": ("scenario", [share_within([e], [b]) for e, b in zip(errors, bars, strict=True)],
                           {"units": "1"}),
            "width": (("body", "component"), np.sqrt(np.mean(np.concatenate(bars) ** 2, axis=0)) / deviation,
                      {"units": "1"}),
        },
        {
            "model": names, "scenario": list(runs), "body": list(BODIES), "component": list(WRENCH_COMPONENTS),
            "deviations": list(DEVIATIONS),
        },
    )  # fmt: skip


def plot(
    runs: Mapping[str, xr.Dataset], drives: Mapping[tuple[str, str], xr.Dataset], compared: Mapping[str, Compared],
    floor: np.ndarray,
) -> Figure:  # fmt: skip
    """Draw the paths, and loads of each run with their error bars."""
    with plt.rc_context(STYLE):
        figure = plt.figure(figsize=(11.0, 8.0), layout="constrained")
        above, below = figure.subfigures(2, 1, height_ratios=(1.0, 2.4))
        axes = above.subplots()
        for n, (name, run) in enumerate(runs.items()):
            for data, style in ((run, {"ls": "--", "lw": 1.6}), (drives["networks", name], {"lw": 1.1, "label": name})):
                x, y = data["position"].sel(body="hull").values[:, :2].T
                axes.plot(x, y, color=f"C{n}", **style)
        axes.set(xlabel="x [m]", ylabel="y [m]", title="networks; dashed: flow in the loop")
        axes.set_aspect("equal")
        axes.legend(fontsize="x-small")
        panels = below.subplots(len(SHOWN), len(runs), sharex=True, sharey="row", squeeze=False)
        for column, (name, one) in zip(panels.T, compared.items(), strict=True):
            bars = bars_of(one.spread, floor)
            for panel, (body, component, unit) in zip(column, SHOWN, strict=True):
                at = (slice(None), BODIES.index(body), WRENCH_COMPONENTS.index(component))
                mean, width = one.networks[at], 2.0 * bars[at]
                panel.fill_between(one.time, mean - width, mean + width, alpha=0.25, lw=0.0)
                panel.plot(one.time, one.flow[at], "k", lw=0.9, label="flow")
                panel.plot(one.time, mean, "C0", lw=1.1, label="networks, two standard deviations")
                if panel in panels[:, 0]:
                    panel.set_ylabel(f"{body.replace('_', ' ')} {component} [{unit}]")
            column[0].set_title(name)
            column[-1].set_xlabel("time [s]")
        below.legend(*panels[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return figure


def lines(found: xr.Dataset) -> str:
    """Return the tables as they stand on the page of the study."""
    rows = [f"| final position [% of the path] | {' | '.join(map(str, found['scenario'].values))} | mean |"]
    rows.append("|---" * (found.sizes["scenario"] + 2) + "|")
    for model in found["model"].values:
        ends = found["final"].sel(model=model).values
        rows.append(f"| {model} | {' | '.join(f'{end:.1f}' for end in ends)} | {ends.mean():.2f} |")
    loads = found["load_error"]
    hull = [loads.sel(body="hull", component=name) for name in ("Fz", "My")]
    for label, values in (("all loads", loads.mean(["body", "component"])), ("hull Fz", hull[0]), ("hull My", hull[1])):
        each = " | ".join(f"{v:.2f}" for v in values.values)
        rows.append(f"| load error of the networks: {label} [-] | {each} | {float(values.mean()):.2f} |")
    within = " | ".join(f"{100.0 * v:.0f} %" for v in found["within_run"].values)
    both = 100.0 * float(found["within"].sel(deviations=2.0))
    rows.append(f"| loads within two error bars | {within} | {both:.0f} % |")
    shares = {name: [f"{100.0 * v:.1f}" for v in found[name].values] for name in ("within", "within_spread")}
    rows.append(
        f"\nOne, two, three error bars hold {', '.join(shares['within'])} % of all loads (normal errors: 68.3, 95.4, "
        f"99.7 %), the spread alone {', '.join(shares['within_spread'])} %; a bar is "
        f"{float(found['width'].mean()):.2f} of the loads' deviation wide."
    )
    return "\n".join(rows)


def main(quick: bool = False, jobs: int = 2) -> xr.Dataset:
    """Compare; return the table. With `quick` the first run and no figure."""
    vehicle, chosen = amphibious_vehicle(), models()
    runs = flow_runs(DRAWN[:1] if quick else DRAWN, jobs)
    drives = {
        (model, name): drive(Scenario.named(name), hydrodynamics, vehicle)
        for name in runs
        for model, hydrodynamics in chosen.items()
    }
    ensemble = chosen["networks"]
    assert isinstance(ensemble, SurrogateHydrodynamics)
    floor = load_floor(ensemble.networks)
    assert floor is not None
    compared = {name: compare_loads(ensemble.networks, run, vehicle) for name, run in runs.items()}
    found = table(runs, drives, compared, floor)
    if not quick:
        save({"blind_runs.png": plot(runs, drives, compared, floor), "blind_runs.nc": found})
    return found


if __name__ == "__main__":
    parser = study_parser(__doc__)
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    set_up_log()
    print(lines(main(**vars(parser.parse_args()))))
